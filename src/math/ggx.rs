//! The GGX distribution of microfacet normals, with Smith's masking: densities beside what they are
//! the densities of.
//!
//! Directions are in a local basis with z along the normal and x along the tangent.
//!
//! Sources: Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007;
//! Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), 2014.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::{Vec2, Vec3A};

/// A GGX distribution of normals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ggx {
    /// alpha along the tangent.
    along: f32,
    /// alpha across the tangent.
    across: f32,
}

impl Ggx {
    /// A distribution without grain. `alpha` is greater than zero.
    pub const fn isotropic(alpha: f32) -> Self {
        Self::new(alpha, alpha)
    }

    /// A distribution with one alpha along the tangent and one across it, both greater than zero.
    pub const fn new(along: f32, across: f32) -> Self {
        Self { along, across }
    }

    /// Whether alpha is the same along the tangent and across it.
    pub fn is_isotropic(self) -> bool {
        self.along == self.across
    }

    /// The geometric mean of the two alphas.
    pub fn alpha(self) -> f32 {
        (self.along * self.across).sqrt()
    }

    /// The same without grain.
    pub fn isotropic_mean(self) -> Self {
        Self::isotropic(self.alpha())
    }

    /// The same with both alphas at least this large.
    pub fn at_least(self, alpha: f32) -> Self {
        Self::new(self.along.max(alpha), self.across.max(alpha))
    }

    /// Distribution of normals [1/sr], zero below the horizon.
    ///
    /// Uses the sine of the normal's own coordinates: `1 - cos^2` has no digits left for a mirror.
    pub fn distribution(self, normal: Vec3A) -> f32 {
        if normal.z <= 0.0 {
            return 0.0;
        }
        let product = self.along * self.across;
        let (x, y) = (normal.x * self.across, normal.y * self.along);
        let width = (x * x + y * y) / product + product * normal.z * normal.z;
        FRAC_1_PI * product / (width * width)
    }

    /// Smith's masking function G1: the share of microfacets that `direction` sees.
    pub fn masking(self, direction: Vec3A) -> f32 {
        1.0 / (1.0 + self.lambda(direction))
    }

    /// Smith's height-correlated masking and shadowing function G2 (Heitz 2014, Eq. 99). For
    /// transmission, one of the directions lies below the surface.
    pub fn masking_shadowing(self, wo: Vec3A, wi: Vec3A) -> f32 {
        1.0 / (1.0 + self.lambda(wo) + self.lambda(wi))
    }

    fn lambda(self, direction: Vec3A) -> f32 {
        let (x, y) = (direction.x * self.along, direction.y * self.across);
        let width = (x * x + y * y) / (direction.z * direction.z);
        0.5 * ((1.0 + width).sqrt() - 1.0)
    }

    /// A normal as seen from `wo`.
    ///
    /// Source: Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023.
    pub fn sample_visible_normal(self, wo: Vec3A, u: [f32; 2]) -> Vec3A {
        let stretch = Vec3A::new(self.along, self.across, 1.0);
        let wo_stretched = (wo * stretch).normalize();
        let z = (1.0 - u[1]) * (1.0 + wo_stretched.z) - wo_stretched.z;
        let sin = (1.0 - z * z).max(0.0).sqrt();
        let around = sin * Vec2::from_angle(TAU * u[0]);
        let half = Vec3A::new(around.x, around.y, z) + wo_stretched;
        (half * stretch).normalize_or(Vec3A::Z)
    }

    /// Density of [`Ggx::sample_visible_normal`] per steradian of normals.
    pub fn pdf_visible_normal(self, wo: Vec3A, normal: Vec3A) -> f32 {
        self.distribution(normal) * self.masking(wo) * wo.dot(normal).max(0.0) / wo.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::{DirectionTest, MAX_SCORE, Random};

    #[test]
    fn visible_normals_follow_their_pdf() {
        for (along, across) in [
            (0.02f32, 0.02f32),
            (0.1, 0.1),
            (0.5, 0.5),
            (1.0, 1.0),
            (0.8, 0.2),
            (0.1, 0.4),
        ] {
            for cos in [1.0f32, 0.7, 0.1] {
                let ggx = Ggx::new(along, across);
                let sin = (1.0 - cos * cos).sqrt();
                let wo = Vec3A::new(0.6 * sin, 0.8 * sin, cos);
                let widest = along.max(across);
                let test = DirectionTest {
                    one_minus_cos_max: f64::from((8.0 * widest * widest).min(1.0)),
                    // Grain makes the density narrow across the cells.
                    quadrature: 64,
                    ..DirectionTest::sphere(Vec3A::Z)
                };
                let score = test.score(
                    |random: &mut Random| Some(ggx.sample_visible_normal(wo, random.next_2d())),
                    |normal| ggx.pdf_visible_normal(wo, normal),
                );
                assert!(score < MAX_SCORE, "{ggx:?}, cos {cos}: {score}");
            }
        }
    }
}
