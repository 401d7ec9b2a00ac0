//! The Beckmann distribution of microfacet normals, with Smith's masking, as [`super::Ggx`] has it.
//!
//! Sources: Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007;
//! Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), 2014.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::{Vec2, Vec3A};

/// A Beckmann distribution of normals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beckmann {
    /// alpha along the tangent and across it.
    alphas: Vec2,
}

impl Beckmann {
    /// A distribution with one alpha along the tangent and one across it, both greater than zero.
    pub fn new(along: f32, across: f32) -> Self {
        Self {
            alphas: Vec2::new(along, across),
        }
    }

    /// The geometric mean of the two alphas.
    pub fn alpha(self) -> f32 {
        (self.alphas.x * self.alphas.y).sqrt()
    }

    /// The same with both alphas at least this large.
    pub fn at_least(self, alpha: f32) -> Self {
        Self {
            alphas: self.alphas.max(Vec2::splat(alpha)),
        }
    }

    /// Distribution of normals [1/sr], zero below the horizon.
    pub fn distribution(self, normal: Vec3A) -> f32 {
        if normal.z <= 0.0 {
            return 0.0;
        }
        let slope = Vec2::new(normal.x, normal.y) / (normal.z * self.alphas);
        let widths = self.alphas.x * self.alphas.y * normal.z.powi(4);
        FRAC_1_PI * (-slope.length_squared()).exp() / widths
    }

    /// Smith's height-correlated masking and shadowing function (Heitz 2014, Eq. 99).
    pub fn masking_shadowing(self, wo: Vec3A, wi: Vec3A) -> f32 {
        1.0 / (1.0 + self.lambda(wo) + self.lambda(wi))
    }

    /// By the fit of Walter and others (2007, section 5.2), as in Cycles.
    fn lambda(self, direction: Vec3A) -> f32 {
        let spread = (Vec2::new(direction.x, direction.y) * self.alphas).length();
        let a = direction.z.abs() / spread;
        if a >= 1.6 {
            return 0.0;
        }
        ((0.396 * a - 1.259) * a + 1.0) / ((2.181 * a + 3.535) * a)
    }

    /// A normal, with the density [`Beckmann::distribution`] times its cosine.
    pub fn sample(self, u: [f32; 2]) -> Vec3A {
        let slope = (-(1.0 - u[1]).max(f32::MIN_POSITIVE).ln()).sqrt();
        let slopes = slope * self.alphas * Vec2::from_angle(TAU * u[0]);
        slopes.extend(1.0).normalize().into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::{DirectionTest, MAX_SCORE, Random};

    #[test]
    fn normals_follow_their_pdf() {
        for (along, across) in [(0.1f32, 0.1f32), (0.5, 0.5), (0.8, 0.3)] {
            let facets = Beckmann::new(along, across);
            let widest = along.max(across);
            let test = DirectionTest {
                one_minus_cos_max: f64::from((8.0 * widest * widest).min(1.0)),
                quadrature: 64,
                ..DirectionTest::sphere(Vec3A::Z)
            };
            let score = test.score(
                |random: &mut Random| Some(facets.sample(random.next_2d())),
                |normal| facets.distribution(normal) * normal.z.max(0.0),
            );
            assert!(score < MAX_SCORE, "{facets:?}: {score}");
        }
    }

    /// Against the closed form `(erf(a) - 1) / 2 + exp(-a^2) / (2 a sqrt(pi))` at a = 0.5 and 1.
    #[test]
    fn masking_is_smiths() {
        for (a, expected) in [(0.5f32, 0.199_6), (1.0, 0.025_1)] {
            let direction = Vec3A::new(1.0, 0.0, 0.5 * a).normalize();
            let found = Beckmann::new(0.5, 0.5).lambda(direction);
            assert!((found - expected).abs() < 5e-3, "{a}: {found}");
        }
    }
}
