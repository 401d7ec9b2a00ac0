//! The surroundings: one colour, or an equirectangular image.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Mat3A, Vec2, Vec3A};

use super::Reach;
use crate::image::Image;

/// The surroundings of a frame.
#[derive(Debug, Clone)]
pub struct World {
    /// Radiance of a plain world; with an image, the factor on its colour.
    pub radiance: Vec3A,
    /// Equirectangular image.
    pub image: Option<Arc<Image>>,
    /// What the camera sees in place of `image`.
    pub camera_image: Option<Arc<Image>>,
    /// Linear part of the image's mapping.
    pub environment_from_world: Mat3A,
    /// Which rays see it.
    pub reach: Reach,
}

impl World {
    /// Radiance that arrives from a direction (unit length, world space, away from the viewer).
    pub fn radiance(&self, direction: Vec3A) -> Vec3A {
        self.radiance_of(self.image.as_ref(), direction)
    }

    /// What the camera sees in a direction.
    pub fn radiance_for_camera(&self, direction: Vec3A) -> Vec3A {
        self.radiance_of(
            self.camera_image.as_ref().or(self.image.as_ref()),
            direction,
        )
    }

    fn radiance_of(&self, image: Option<&Arc<Image>>, direction: Vec3A) -> Vec3A {
        match image {
            None => self.radiance,
            Some(image) => {
                let direction = self.environment_from_world * direction;
                let uv = uv_of_direction(direction.normalize_or_zero());
                self.radiance * Vec3A::from_vec4(image.sample(uv))
            }
        }
    }
}

/// Where a direction of environment space lies in an equirectangular image: +X in the middle, +Z at
/// the top, u growing clockwise seen from above. The convention of Blender.
pub fn uv_of_direction(direction: Vec3A) -> Vec2 {
    Vec2::new(
        0.5 - direction.y.atan2(direction.x) / TAU,
        1.0 - direction.z.clamp(-1.0, 1.0).acos() / PI,
    )
}

/// The inverse of [`uv_of_direction`].
pub fn direction_of_uv(uv: Vec2) -> Vec3A {
    let (azimuth, polar) = ((0.5 - uv.x) * TAU, (1.0 - uv.y) * PI);
    let ring = Vec2::from_angle(azimuth) * polar.sin();
    Vec3A::new(ring.x, ring.y, polar.cos())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_texture_coordinates_are_inverse() {
        for uv in [(0.5, 0.5), (0.1, 0.9), (0.87, 0.03)].map(Vec2::from) {
            assert!((uv_of_direction(direction_of_uv(uv)) - uv).length() < 1e-5);
        }
        assert!((direction_of_uv(Vec2::splat(0.5)) - Vec3A::X).length() < 1e-6);
        assert!((direction_of_uv(Vec2::new(0.25, 0.5)) - Vec3A::Y).length() < 1e-6);
    }
}
