//! A sun lamp: parallel light from a disk in the sky, or from a single direction.

use std::f32::consts::PI;

use glam::{Affine3A, Vec3A};

use super::{Emitter, LightClass, LightHit, LightSample, Receiver};
use crate::math::warp::{one_minus_cos_from_sin_squared, pdf_cone, sample_cone};
use crate::math::{Frame, Ray, luminance};
use crate::scene::{Links, Reach};

/// A sun with a disk smaller than this [rad] counts as a single direction.
const ANGLE_MIN: f32 = 1e-5;

#[derive(Debug)]
pub(super) struct Sun {
    frame: Frame,
    irradiance: Vec3A,
    /// Of the disk's half angle; `None` for a single direction.
    one_minus_cos: Option<f32>,
    sin_half_angle: f32,
}

impl Sun {
    /// A sun of this irradiance [W/m^2] on a plane that faces it. `angle` is the diameter [rad].
    pub(super) fn new(world_from_light: &Affine3A, irradiance: Vec3A, angle: f32) -> Self {
        let half_angle = (0.5 * angle).clamp(0.0, 0.5 * PI);
        let sin_half_angle = half_angle.sin();
        let one_minus_cos = one_minus_cos_from_sin_squared(sin_half_angle * sin_half_angle);
        Self {
            frame: Frame::from_normal(world_from_light.matrix3.z_axis.normalize_or(Vec3A::Z)),
            irradiance,
            one_minus_cos: (angle >= ANGLE_MIN).then_some(one_minus_cos),
            sin_half_angle,
        }
    }

    /// The disk's radiance: a facing plane receives `L pi sin^2`, so this is exact for any size.
    fn radiance(&self) -> Vec3A {
        self.irradiance / (PI * self.sin_half_angle * self.sin_half_angle)
    }
}

impl Emitter for Sun {
    fn irradiance(&self, receiver: &Receiver) -> f32 {
        let cos = receiver.normal.dot(self.frame.normal());
        luminance(self.irradiance.abs()) * (cos + self.sin_half_angle).clamp(0.0, 1.0)
    }

    fn sample(&self, _: &Receiver, _: f32, u: [f32; 2]) -> Option<LightSample> {
        let (direction, radiance, pdf_solid_angle) = match self.one_minus_cos {
            None => (self.frame.normal(), self.irradiance, 1.0),
            Some(one_minus_cos) => (
                self.frame.to_world(sample_cone(one_minus_cos, u)),
                self.radiance(),
                pdf_cone(one_minus_cos),
            ),
        };
        Some(LightSample {
            direction,
            distance: f32::INFINITY,
            end: None,
            radiance: Some(radiance),
            pdf_solid_angle,
            is_delta: self.one_minus_cos.is_none(),
            class: LightClass::Sun,
            reach: Reach::ALL,
        })
    }

    fn intersect(&self, ray: &Ray, _: Vec3A) -> Option<LightHit> {
        let one_minus_cos = self.one_minus_cos?;
        // 1 - cos from the chord: the cosine has no digits left for a sun.
        let chord_squared = (ray.direction - self.frame.normal()).length_squared();
        let inside = 0.5 * chord_squared <= one_minus_cos && ray.t_max == f32::INFINITY;
        inside.then(|| LightHit {
            links: Links::default(),
            t: f32::INFINITY,
            radiance: self.radiance(),
            pdf_solid_angle: pdf_cone(one_minus_cos),
        })
    }
}
