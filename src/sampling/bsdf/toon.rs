//! Cartoon shading: even light within a cone, which may fade out at its rim.
//!
//! As in Cycles: the share of light that lies within the rim is one, beyond it it falls linearly with
//! the angle, and the lobe is not scaled to keep its energy.

use std::f32::consts::FRAC_PI_2;

use glam::Vec3A;

use super::{Part, Scattered};
use crate::math::Frame;
use crate::math::warp::{one_minus_cos_from_sin_squared, pdf_cone, sample_cone};

/// A cone of light seen from a fixed direction.
#[derive(Debug, Clone, Copy)]
pub struct Toon {
    pub weight: Vec3A,
    /// Angle from the cone's axis up to which it is even [rad].
    size: f32,
    /// Angle over which it fades beyond [rad].
    smooth: f32,
    /// Whether its axis is the mirror direction, or else the normal.
    is_glossy: bool,
}

impl Toon {
    /// A cone of Blender's Size and Smooth, 0 to 1 each: shares of a right angle.
    pub fn new(weight: Vec3A, size: f32, smooth: f32, is_glossy: bool) -> Self {
        Self {
            weight,
            size: size.clamp(1e-5, 1.0) * FRAC_PI_2,
            smooth: smooth.clamp(0.0, 1.0) * FRAC_PI_2,
            is_glossy,
        }
    }

    /// Whether it counts as glossy, or else as diffuse.
    pub fn is_glossy(&self) -> bool {
        self.is_glossy
    }

    /// Cosine complement of the whole cone's half angle.
    fn one_minus_cos(&self) -> f32 {
        let sin = (self.size + self.smooth).min(FRAC_PI_2).sin();
        one_minus_cos_from_sin_squared(sin * sin)
    }

    fn axis(&self, wo: Vec3A) -> Vec3A {
        match self.is_glossy {
            true => Vec3A::new(-wo.x, -wo.y, wo.z),
            false => Vec3A::Z,
        }
    }

    /// `f cos` [1/sr] and the density of [`Toon::sample`] [1/sr]; `wo` is above z = 0.
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> Option<Scattered> {
        // Half the chord has the half angle's sine, which keeps its digits in narrow cones.
        let angle = 2.0 * (0.5 * (wi - self.axis(wo)).length()).min(1.0).asin();
        let rim = (self.size + self.smooth).min(FRAC_PI_2);
        if wi.z <= 0.0 || angle >= rim {
            return None;
        }
        let faded = if angle < self.size {
            1.0
        } else {
            1.0 - (angle - self.size) / self.smooth
        };
        let pdf_solid_angle = pdf_cone(self.one_minus_cos());
        Some(Scattered {
            part: if self.is_glossy {
                Part::Glossy
            } else {
                Part::Diffuse
            },
            value: self.weight * (pdf_solid_angle * faded),
            pdf_solid_angle,
        })
    }

    /// A unit direction; it may lie below z = 0, where the lobe is black.
    pub fn sample(&self, wo: Vec3A, u: [f32; 2]) -> Vec3A {
        let about = Frame::from_normal(self.axis(wo));
        about.to_world(sample_cone(self.one_minus_cos(), u))
    }
}
