//! One GGX reflection lobe, seen from a fixed direction, in the basis of its normal.

use glam::Vec3A;

use super::energy;
use super::fresnel::{Curve, mix};
use crate::math::warp::{
    ggx_distribution, ggx_masking, ggx_masking_shadowing, sample_ggx_visible_normal,
};

/// Smallest GGX alpha (a roughness of 0.01): keeps every density finite in single precision. A
/// mirror blurs by a hundredth of a degree, a hundredth of the sun's disk.
pub const ALPHA_MIN: f32 = 1e-4;

/// A GGX lobe whose weight and multiple-scattering compensation are in its colours.
#[derive(Debug, Clone, Copy)]
pub struct Lobe {
    alpha: f32,
    curve: Curve,
    f0: Vec3A,
    f90: Vec3A,
    /// Share of white light reflected towards the viewer, all bounces.
    albedo: Vec3A,
}

impl Lobe {
    /// No reflection at all: fills unused places.
    pub const BLACK: Lobe = Lobe {
        alpha: 1.0,
        curve: Curve::Schlick,
        f0: Vec3A::ZERO,
        f90: Vec3A::ZERO,
        albedo: Vec3A::ZERO,
    };

    /// A lobe of this Blender roughness whose reflectance follows `curve` from `f0` to `f90`, seen
    /// under the cosine `cos_wo`.
    ///
    /// Light that bounces between microfacets is given back by scaling the lobe, as Cycles does
    /// for its "Multiscatter GGX": `1 + Fms (1 - E) / E` with Fms after Kulla and Conty 2017.
    pub fn new(
        weight: Vec3A,
        roughness: f32,
        curve: Curve,
        f0: Vec3A,
        f90: Vec3A,
        cos_wo: f32,
    ) -> Self {
        let roughness = roughness.clamp(ALPHA_MIN.sqrt(), 1.0);
        let single = energy::directional_albedo(roughness, cos_wo);
        let average = energy::average_albedo(roughness);
        let fresnel_mean = mix(f0, f90, curve.mean());
        let fresnel_multiple =
            fresnel_mean * average / (Vec3A::ONE - fresnel_mean * (1.0 - average));
        let scale = weight * (Vec3A::ONE + fresnel_multiple * ((1.0 - single) / single));
        let fresnel_seen = mix(f0, f90, energy::mean_curve(curve, roughness, cos_wo));
        Self {
            alpha: roughness * roughness,
            curve,
            f0: scale * f0,
            f90: scale * f90,
            albedo: scale * single * fresnel_seen,
        }
    }

    /// GGX alpha.
    pub fn alpha(&self) -> f32 {
        self.alpha
    }

    /// Share of white light reflected towards the viewer.
    pub fn albedo(&self) -> Vec3A {
        self.albedo
    }

    /// Takes up another lobe's energy, but with this lobe's roughness and curve.
    pub fn absorb(&mut self, other: &Lobe) {
        self.f0 += other.f0;
        self.f90 += other.f90;
        self.albedo += other.albedo;
    }

    /// `f cos` [1/sr] and the density of [`Lobe::sample`] [1/sr]; both directions above z = 0.
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> (Vec3A, f32) {
        let half = (wo + wi).normalize_or(Vec3A::Z);
        let common = ggx_distribution(self.alpha, half) / (4.0 * wo.z);
        let fresnel = mix(
            self.f0,
            self.f90,
            self.curve.at(wo.dot(half).clamp(0.0, 1.0)),
        );
        (
            fresnel * (common * ggx_masking_shadowing(self.alpha, wo, wi)),
            common * ggx_masking(self.alpha, wo),
        )
    }

    /// A direction above z = 0, or none where the microfacet reflects downwards.
    pub fn sample(&self, wo: Vec3A, u: [f32; 2]) -> Option<Vec3A> {
        let half = sample_ggx_visible_normal(wo, self.alpha, u);
        let wi = (2.0 * wo.dot(half) * half - wo).normalize();
        (wi.z > 0.0).then_some(wi)
    }
}
