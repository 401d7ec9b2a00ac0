//! How media scatter: after Henyey and Greenstein, "Diffuse radiation in the galaxy", 1941.

use std::f32::consts::{PI, TAU};

use glam::Vec3A;

use super::{Part, Scattered};
use crate::math::Frame;

/// A point of a medium, seen from a fixed direction.
#[derive(Debug, Clone, Copy)]
pub struct Phase {
    pub weight: Vec3A,
    /// Mean cosine between the ways of the light before and after.
    pub anisotropy: f32,
}

/// Below this anisotropy light goes to all sides alike.
const EVEN: f32 = 1e-3;

/// The cosine, between the ways before and after, that one number draws.
fn sample_cosine(anisotropy: f32, u: f32) -> f32 {
    let (g, u) = (anisotropy, 2.0 * u - 1.0);
    if g.abs() < EVEN {
        return u;
    }
    let s = (1.0 - g * g) / (1.0 + g * u);
    ((1.0 + g * g - s * s) / (2.0 * g)).clamp(-1.0, 1.0)
}

/// The way after, drawn for a unit way before.
pub fn sample_scattered(before: Vec3A, anisotropy: f32, [u, turn]: [f32; 2]) -> Vec3A {
    let cos = sample_cosine(anisotropy, u);
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (y, x) = (TAU * turn).sin_cos();
    Frame::from_normal(before)
        .to_world(Vec3A::new(sin * x, sin * y, cos))
        .normalize()
}

/// Density [1/sr] with which [`sample_scattered`] finds a direction.
pub fn pdf_scattered(before: Vec3A, anisotropy: f32, after: Vec3A) -> f32 {
    pdf_cosine(anisotropy, before.dot(after))
}

/// Density [1/sr] of a cosine.
fn pdf_cosine(anisotropy: f32, cos: f32) -> f32 {
    let g = anisotropy;
    let squared = (1.0 + g * g - 2.0 * g * cos).max(f32::MIN_POSITIVE);
    (1.0 - g * g) / (4.0 * PI * squared * squared.sqrt())
}

impl Phase {
    /// Phase function times weight [1/sr], and the density of [`Phase::sample`] [1/sr].
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> Scattered {
        let pdf_solid_angle = pdf_cosine(self.anisotropy, -wo.dot(wi));
        Scattered {
            part: Part::Volume,
            value: self.weight * pdf_solid_angle,
            pdf_solid_angle,
        }
    }

    /// A direction towards the light.
    pub fn sample(&self, wo: Vec3A, u: [f32; 2]) -> Vec3A {
        sample_scattered(-wo, self.anisotropy, u)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::{DirectionTest, MAX_SCORE};

    #[test]
    fn directions_follow_their_density() {
        let wo = Vec3A::new(0.6, 0.0, 0.8);
        for anisotropy in [-0.5, 0.0, 5e-4, 0.3, 0.8] {
            let phase = Phase {
                weight: Vec3A::ONE,
                anisotropy,
            };
            let score = DirectionTest::sphere(-wo).score(
                |random| Some(phase.sample(wo, random.next_2d())),
                |wi| phase.eval(wo, wi).pdf_solid_angle,
            );
            assert!(score < MAX_SCORE, "{anisotropy}: {score}");
        }
    }
}
