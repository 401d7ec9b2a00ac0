//! Closures without a mirror direction: rough diffuse, sheen, and light that comes through.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI, TAU};

use glam::{Vec2, Vec3A};

use super::{Part, Scattered};
use crate::math::warp::{pdf_cosine_hemisphere, sample_cosine_hemisphere};
use crate::optics;

/// A rough diffuse surface seen from a fixed direction.
///
/// Sources: Fujii, "A tiny improvement of Oren-Nayar reflectance model", 2012 (the qualitative
/// model); the light of several bounces after Portsmouth, Kutz and Hill, "EON: a practical
/// energy-preserving rough diffuse BRDF", 2025, as in Cycles since Blender 4.3.
#[derive(Debug, Clone, Copy)]
pub struct OrenNayar {
    pub weight: Vec3A,
    a: f32,
    b: f32,
    /// Light of several bounces, but for the factor of the incoming direction [1/sr].
    multiple: Vec3A,
}

/// The albedo of the term that grows with roughness, for a cosine.
fn roughness_albedo(cos: f32) -> f32 {
    if cos < 1e-6 {
        return (FRAC_PI_2 - 2.0 / 3.0) - cos;
    }
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let angle = cos.min(1.0).acos();
    sin * (angle - 2.0 / 3.0 - sin * cos) + 2.0 / 3.0 * (sin / cos) * (1.0 - sin * sin * sin)
}

impl OrenNayar {
    /// A surface of this colour; `cos_wo` is that of the viewer.
    pub fn new(weight: Vec3A, color: Vec3A, roughness: f32, cos_wo: f32) -> Self {
        let a = 1.0 / (PI + roughness * (FRAC_PI_2 - 2.0 / 3.0));
        let b = roughness * a;
        let average = a * PI + (TAU - 5.6) / 3.0 * b;
        let white = color.clamp(Vec3A::ZERO, Vec3A::ONE);
        let lost = 1.0 - (a * PI + b * roughness_albedo(cos_wo.max(0.0)));
        // Without roughness nothing is lost, and the quotient below has no value.
        let multiple = if roughness > 0.0 {
            white * white * (FRAC_1_PI * average / (1.0 - average) * lost)
                / (Vec3A::ONE - white * (1.0 - average))
        } else {
            Vec3A::ZERO
        };
        Self {
            weight,
            a,
            b,
            multiple,
        }
    }

    /// `f cos` [1/sr] and the density of the cosine hemisphere [1/sr].
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> Option<Scattered> {
        if wi.z <= 0.0 {
            return None;
        }
        let mut t = wi.dot(wo) - wi.z * wo.z.max(0.0);
        if t > 0.0 {
            t /= wi.z.max(wo.z);
        }
        let lost = 1.0 - (self.a * PI + self.b * roughness_albedo(wi.z));
        let value = Vec3A::splat(self.a + self.b * t) + self.multiple * lost;
        Some(Scattered {
            part: Part::Diffuse,
            value: self.weight * value.max(Vec3A::ZERO) * wi.z,
            pdf_solid_angle: pdf_cosine_hemisphere(wi.z),
        })
    }
}

/// Light that a diffuse sheet lets through, seen from a fixed direction.
#[derive(Debug, Clone, Copy)]
pub struct Translucent {
    pub weight: Vec3A,
}

impl Translucent {
    /// `f cos` [1/sr] and the density of [`Translucent::sample`] [1/sr].
    pub fn eval(&self, wi: Vec3A) -> Option<Scattered> {
        let pdf_solid_angle = pdf_cosine_hemisphere(-wi.z);
        (wi.z < 0.0).then(|| Scattered {
            part: Part::Transmission,
            value: self.weight * pdf_solid_angle,
            pdf_solid_angle,
        })
    }

    pub fn sample(u: [f32; 2]) -> Vec3A {
        -sample_cosine_hemisphere(u)
    }
}

/// A layer of fibres, seen from a fixed direction.
///
/// Source: Zeltner, Burley and Chiang, "Practical Multiple-Scattering Sheen Using Linearly
/// Transformed Cosines", 2022. Coefficients and albedo are the rational fits by Stephen Hill that
/// MaterialX uses, in place of the paper's tables: the albedo is off by 0.003 on average.
#[derive(Debug, Clone, Copy)]
pub struct Sheen {
    pub weight: Vec3A,
    /// Coefficients of the inverse transform.
    a: f32,
    b: f32,
    /// Cosine and sine of the viewer's angle about the normal.
    viewer: Vec2,
}

impl Sheen {
    /// Sheen seen from `wo`, and the share of white light that it reflects towards the viewer.
    pub fn new(weight: Vec3A, roughness: f32, wo: Vec3A) -> (Self, Vec3A) {
        let (x, y) = (wo.z.min(1.0), roughness.clamp(0.01, 1.0));
        let a = (2.58126 * x + 0.813_703 * y) * y / (1.0 + 0.310_327 * x * x + 2.60994 * x * y);
        let b = (1.0 - x).sqrt() * (y - 1.0) * y * y * y
            / (0.000_025_405_3 + 1.71228 * x - 1.71506 * x * y + 1.34174 * y * y);
        let weight = weight * optics::Sheen::albedo(roughness, wo.z);
        let viewer = Vec2::new(wo.x, wo.y).normalize_or(Vec2::X);
        (
            Self {
                weight,
                a,
                b,
                viewer,
            },
            weight,
        )
    }

    /// `f cos` [1/sr] and the density of [`Sheen::sample`] [1/sr].
    pub fn eval(&self, wi: Vec3A) -> Option<Scattered> {
        if wi.z <= 0.0 {
            return None;
        }
        // In the basis in which the viewer is above the x axis.
        let x = self.viewer.x * wi.x + self.viewer.y * wi.y;
        let y = self.viewer.x * wi.y - self.viewer.y * wi.x;
        let (x, y) = (self.a * x + self.b * wi.z, self.a * y);
        let length_squared = x * x + y * y + wi.z * wi.z;
        let ratio = self.a / length_squared;
        let pdf_solid_angle = FRAC_1_PI * wi.z * ratio * ratio;
        Some(Scattered {
            part: Part::Diffuse,
            value: self.weight * pdf_solid_angle,
            pdf_solid_angle,
        })
    }

    pub fn sample(&self, u: [f32; 2]) -> Vec3A {
        let cosine = sample_cosine_hemisphere(u);
        let (x, y) = (cosine.x - cosine.z * self.b, cosine.y);
        let v = self.viewer;
        Vec3A::new(v.x * x - v.y * y, v.y * x + v.x * y, cosine.z * self.a).normalize()
    }
}
