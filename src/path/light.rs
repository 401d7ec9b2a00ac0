//! Light that comes back along a path, apart by where it is from.

use glam::Vec3A;

use crate::sampling::LobeValues;
use crate::surface::Surface;

/// Light that a surface sends to the camera, as passes divide it: see [`LobeValues::by_pass`].
#[derive(Debug, Clone, Copy, Default)]
pub struct Divided {
    /// Whether a medium scattered it.
    pub is_of_medium: bool,
    /// Straight from its source.
    pub direct: [Vec3A; 3],
    /// By way of other surfaces.
    pub indirect: [Vec3A; 3],
}

impl Divided {
    /// Nothing yet, from this surface.
    pub fn of(surface: &Surface) -> Self {
        Self {
            is_of_medium: surface.is_medium,
            ..Self::default()
        }
    }

    /// Adds light (straight from its source, by way of other surfaces) that is scattered by these
    /// values times `scale`.
    pub fn add(&mut self, values: &LobeValues, [direct, indirect]: [Vec3A; 2], scale: f32) {
        for (part, value) in values.by_pass().into_iter().enumerate() {
            self.direct[part] += direct * value * scale;
            self.indirect[part] += indirect * value * scale;
        }
    }

    /// Adds light straight from its source that is scattered already.
    pub fn add_direct(&mut self, scattered: &LobeValues) {
        self.add(scattered, [Vec3A::ONE, Vec3A::ZERO], 1.0);
    }
}

/// What a surface reflects.
#[derive(Default)]
pub struct Reflected {
    /// Light of light samples, scattered.
    pub(super) direct: LobeValues,
    /// What came along the path that goes on.
    pub(super) gathered: Gathered,
    /// `f cos` of the direction that it took [1/sr].
    pub(super) value: LobeValues,
    /// Density of that direction [1/sr], and the probability of going on.
    pub(super) pdf_solid_angle: f32,
    pub(super) survival: f32,
}

impl Reflected {
    /// All of it.
    pub fn sum(&self) -> Vec3A {
        if self.survival == 0.0 {
            return self.direct.sum();
        }
        let weight = self.value.sum() / self.pdf_solid_angle;
        self.direct.sum() + self.gathered.sum() * weight / self.survival
    }

    /// All of it times a colour.
    pub(super) fn tinted(self, color: Vec3A) -> Self {
        Self {
            direct: self.direct * color,
            value: self.value * color,
            ..self
        }
    }

    /// Adds it to what passes keep, times `scale`.
    pub fn divide(&self, divided: &mut Divided, scale: f32) {
        divided.add(&self.direct, [Vec3A::ONE, Vec3A::ZERO], scale);
        if self.survival > 0.0 {
            let scale = scale / (self.pdf_solid_angle * self.survival);
            divided.add(&self.value, self.gathered.by_way(), scale);
        }
    }
}

/// What comes back along a ray, apart by origin. Radiance of lights that light sampling also finds
/// is weighted already.
#[derive(Debug, Clone, Copy, Default)]
pub struct Gathered {
    /// From the world, where the ray left the scene.
    pub environment: Vec3A,
    /// The same, not weighted: as much as it would be if only rays found the world.
    pub open_sky: Vec3A,
    /// From lamps, suns and glowing surfaces that the ray met.
    pub lamps: Vec3A,
    /// Reflected at the surface that the ray met.
    pub indirect: Vec3A,
    /// Length of the ray [m]; infinite where it left the scene.
    pub distance: f32,
    /// Probability of the Lambert part of the surface that the ray met; 0 without one.
    pub probability_lambert: f32,
}

impl Gathered {
    /// All of it.
    pub fn sum(&self) -> Vec3A {
        self.environment + self.lamps + self.indirect
    }

    /// Straight from its source, and by way of other surfaces.
    pub fn by_way(&self) -> [Vec3A; 2] {
        [self.environment + self.lamps, self.indirect]
    }
}

/// What light must be multiplied with, so that a path that carries `throughput` brings the pixel at
/// most `limit`, as a mean over the channels. Zero sets no limit.
pub(super) fn clamp_factor(radiance: Vec3A, throughput: f32, limit: f32) -> f32 {
    let brought = throughput * radiance.element_sum() / 3.0;
    if limit > 0.0 && brought > limit {
        limit / brought
    } else {
        1.0
    }
}

/// Light, limited so.
pub fn clamped(radiance: Vec3A, throughput: f32, limit: f32) -> Vec3A {
    radiance * clamp_factor(radiance, throughput, limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_limited_by_what_it_brings_and_zero_is_no_limit() {
        let bright = Vec3A::new(6.0, 3.0, 0.0);
        assert_eq!(clamped(bright, 1.0, 0.0), bright);
        assert_eq!(clamped(bright, 1.0, 3.0), bright);
        assert_eq!(clamped(bright, 2.0, 3.0), 0.5 * bright);
        assert_eq!(clamped(Vec3A::ZERO, 1.0, 3.0), Vec3A::ZERO);
    }
}
