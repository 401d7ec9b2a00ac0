//! The back-scattering sheen of cloth whose fibres stand upright.
//!
//! Source: Ashikhmin, Premože and Shirley, "A microfacet-based BRDF generator", 2000, section 5.1: a
//! Gaussian of the facets' slope, turned upside down. As in Cycles it is neither normalised nor does
//! it take light from what lies below.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3A;

use super::{Part, Scattered};

/// Widths below this count as this, as in Cycles.
const SIGMA_MIN: f32 = 0.01;

/// Velvet seen from a fixed direction.
#[derive(Debug, Clone, Copy)]
pub struct Velvet {
    pub weight: Vec3A,
    /// Of the facets' inverted slopes.
    inverse_variance: f32,
}

impl Velvet {
    /// Velvet of Blender's roughness, 0 to 1.
    pub fn new(weight: Vec3A, roughness: f32) -> Self {
        let sigma = roughness.clamp(SIGMA_MIN, 1.0);
        Self {
            weight,
            inverse_variance: 1.0 / (sigma * sigma),
        }
    }

    /// `f cos` [1/sr] and the density of [`Velvet::sample`] [1/sr]; `wo` is above z = 0.
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> Option<Scattered> {
        /// Half vectors nearer to the normal, or farther from the viewer, count as black.
        const EDGE: f32 = 1e-5;
        if wi.z <= 0.0 {
            return None;
        }
        let half = (wo + wi).normalize_or_zero();
        let cos_half = wo.dot(half).abs();
        if half.z >= 1.0 - EDGE || cos_half <= EDGE {
            return None;
        }
        let sin_squared = 1.0 - half.z * half.z;
        let cotangent_squared = half.z * half.z / sin_squared;
        let density = (-cotangent_squared * self.inverse_variance).exp()
            * (self.inverse_variance * FRAC_1_PI / (sin_squared * sin_squared));
        let seen = 2.0 * (half.z / cos_half).max(EDGE) * wo.z.min(wi.z);
        let value = 0.25 * density * seen.min(1.0) / wo.z;
        Some(Scattered {
            part: Part::Diffuse,
            value: self.weight * value,
            pdf_solid_angle: 1.0 / TAU,
        })
    }

    /// A direction of the hemisphere, each as likely: the lobe is widest at its rim.
    pub fn sample([u, v]: [f32; 2]) -> Vec3A {
        let sin = (1.0 - u * u).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (TAU * v).sin_cos();
        Vec3A::new(sin * cos_phi, sin * sin_phi, u)
    }
}
