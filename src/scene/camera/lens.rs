//! The aperture: where on the lens a ray starts, for depth of field.

use std::f32::consts::TAU;

use glam::Vec2;

use crate::math::warp::{sample_disk, sample_triangle};

/// An aperture and the plane that it sees sharply.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Radius of the aperture [m]; zero sees everything sharply.
    pub radius: f32,
    /// Distance of the plane in focus along the viewing axis [m]; a sphere for panoramas.
    pub focus_distance: f32,
    /// Sides of the aperture; round with fewer than three.
    pub blades: u32,
    /// Turn of the blades [rad].
    pub rotation: f32,
    /// Height of the aperture over its width: an anamorphic lens has more than one.
    pub ratio: f32,
}

impl Lens {
    /// No depth of field.
    pub const PINHOLE: Self = Self {
        radius: 0.0,
        focus_distance: 1.0,
        blades: 0,
        rotation: 0.0,
        ratio: 1.0,
    };

    /// A point of the aperture [m], uniform in area.
    pub fn sample(&self, u: [f32; 2]) -> Vec2 {
        let point = if self.blades < 3 {
            sample_disk(u)
        } else {
            self.sample_polygon(u)
        };
        self.radius * point * Vec2::new(1.0 / self.ratio, 1.0)
    }

    /// A point of the regular polygon in the unit circle: a triangle between its centre and a side,
    /// then a point of the triangle. The middle of a side lies in the direction of `rotation`.
    fn sample_polygon(&self, [u, v]: [f32; 2]) -> Vec2 {
        let scaled = u * self.blades as f32;
        let side = scaled.floor().min(self.blades as f32 - 1.0);
        let corners = sample_triangle([scaled - side, v]);
        let step = TAU / self.blades as f32;
        let middle = self.rotation + side * step;
        corners.x * Vec2::from_angle(middle - 0.5 * step)
            + corners.y * Vec2::from_angle(middle + 0.5 * step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::Random;

    /// Second moments of a regular n-gon of circumradius R: each axis has
    /// R^2 (2 + cos(2 pi / n)) / 12, and none is preferred.
    #[test]
    fn apertures_have_the_moments_of_their_shape() {
        for blades in [0u32, 3, 5, 8] {
            let lens = Lens {
                radius: 2.0,
                blades,
                rotation: 0.3,
                ratio: 2.0,
                ..Lens::PINHOLE
            };
            let mut random = Random::new(3);
            let (mut sum, mut squares) = (Vec2::ZERO, Vec2::ZERO);
            let count = 100_000;
            for _ in 0..count {
                let point = lens.sample(random.next_2d());
                sum += point;
                squares += point * point;
            }
            let variance = match blades {
                0 => 1.0,
                n => 4.0 * (2.0 + (TAU / n as f32).cos()) / 12.0,
            };
            // Five standard deviations of means of 1e5 numbers below 4.
            assert!((sum / count as f32).length() < 0.03, "{blades}");
            let got = squares / count as f32;
            assert!(
                (got.y - variance).abs() < 0.03,
                "{blades}: {got} {variance}"
            );
            assert!((got.x - 0.25 * variance).abs() < 0.01, "{blades}: {got}");
        }
    }
}
