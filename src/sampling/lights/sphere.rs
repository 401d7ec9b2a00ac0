//! Point and spot lamps: spheres, disks that turn towards whoever looks (Blender's Soft Falloff),
//! or points without extent.
//!
//! Radiance follows Cycles (4.2 to 5.x): a lamp of power P and radius r shines with P / (4 pi^2 r^2)
//! from its surface; without a radius its intensity is P / (4 pi) [W/sr].

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine3A, Mat3A, Vec3A};

use super::tree::{Extent, NormalCone};
use super::{Emitter, LightClass, LightHit, LightSample, Receiver};
use crate::math::warp::{
    one_minus_cos_from_sin_squared, pdf_cone, pdf_cosine_hemisphere, pdf_disk, sample_cone,
    sample_cosine_hemisphere, sample_disk,
};
use crate::math::{Frame, Ray, luminance};
use crate::scene::{Links, Reach};

/// A lamp with a radius below this [m] counts as a point.
const RADIUS_MIN: f32 = 1e-6;

/// A spot's cone: full light along the axis, none outside, a smooth step between.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cone {
    axis: Vec3A,
    /// To the lamp's own space, in which the cone is round.
    lamp_from_world: Mat3A,
    /// In the lamp's own space.
    cos_half_angle: f32,
    /// Of the widest round cone around it, world space.
    half_angle: f32,
    /// Width of the step in the cosine.
    fade: f32,
}

impl Cone {
    /// `angle` is the full opening [rad], `blend` the share of it that fades.
    pub(super) fn new(world_from_light: &Affine3A, scale: Vec3A, angle: f32, blend: f32) -> Self {
        let half_angle = (0.5 * angle).clamp(0.0, PI);
        let cos_half_angle = half_angle.cos();
        Self {
            axis: -world_from_light.matrix3.z_axis.normalize_or(Vec3A::Z),
            lamp_from_world: (world_from_light.matrix3 * Mat3A::from_diagonal(scale.into()))
                .inverse(),
            half_angle: stretched(half_angle, scale),
            cos_half_angle,
            fade: (1.0 - cos_half_angle) * blend.clamp(0.0, 1.0),
        }
    }

    /// Share of the light that leaves in this direction.
    fn attenuation(&self, direction: Vec3A) -> f32 {
        let local = (self.lamp_from_world * direction).normalize_or_zero();
        let inside = -local.z - self.cos_half_angle;
        if inside <= 0.0 {
            return 0.0;
        }
        let x = (inside / self.fade).min(1.0); // without a fade: infinite, so 1
        x * x * (3.0 - 2.0 * x)
    }

    /// Whether a lamp that is seen under `sin_size` may shine this way.
    fn may_reach(&self, direction: Vec3A, sin_size: f32) -> bool {
        let size = sin_size.clamp(0.0, 1.0).asin();
        direction.dot(self.axis).clamp(-1.0, 1.0).acos() < self.half_angle + size
    }
}

/// What emits.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    Point,
    Sphere,
    Disk,
}

/// Half the angle of a round cone around another that is scaled.
fn stretched(half_angle: f32, scale: Vec3A) -> f32 {
    let wider = scale.x.max(scale.y) / scale.z;
    match half_angle {
        _ if (wider - 1.0).abs() < 1e-3 => half_angle,
        _ if half_angle < FRAC_PI_2 => (wider * half_angle.tan()).atan(),
        _ => PI,
    }
}

#[derive(Debug)]
pub(super) struct Sphere {
    center: Vec3A,
    radius: f32,
    shape: Shape,
    power: Vec3A,
    cone: Option<Cone>,
}

impl Sphere {
    pub(super) fn new(
        world_from_light: &Affine3A,
        power: Vec3A,
        radius: f32,
        soft_falloff: bool,
        cone: Option<Cone>,
    ) -> Self {
        let shape = match (radius >= RADIUS_MIN, soft_falloff) {
            (false, _) => Shape::Point,
            (true, false) => Shape::Sphere,
            (true, true) => Shape::Disk,
        };
        Self {
            center: world_from_light.translation,
            radius,
            shape,
            power,
            cone,
        }
    }

    fn radiance(&self, direction: Vec3A, inside: bool) -> Vec3A {
        let surface = 4.0 * PI * PI * self.radius * self.radius;
        self.power * (self.attenuation(direction, inside) / surface)
    }

    /// Share of the light that goes to someone who sees the lamp in `direction`; from inside the
    /// sphere a spot is seen whole, as in Cycles.
    fn attenuation(&self, direction: Vec3A, inside: bool) -> f32 {
        match self.cone {
            Some(cone) if !inside => cone.attenuation(-direction),
            _ => 1.0,
        }
    }

    fn is_inside(&self, point: Vec3A) -> bool {
        let radius = self.radius;
        self.shape == Shape::Sphere && (self.center - point).length_squared() <= radius * radius
    }

    /// Density with which [`Emitter::sample`] finds this direction to a point at distance `t`.
    fn pdf(&self, point: Vec3A, normal: Vec3A, direction: Vec3A, t: f32) -> f32 {
        let to_center = self.center - point;
        match self.shape {
            Shape::Point => 0.0,
            Shape::Sphere if self.is_inside(point) => pdf_cosine_hemisphere(normal.dot(direction)),
            Shape::Sphere => pdf_cone(self.one_minus_cos(to_center)),
            Shape::Disk => {
                let cos = direction.dot(to_center.normalize_or_zero());
                pdf_disk() / (self.radius * self.radius) * t * t / cos.max(f32::MIN_POSITIVE)
            }
        }
    }

    fn one_minus_cos(&self, to_center: Vec3A) -> f32 {
        let sin_squared = self.radius * self.radius / to_center.length_squared();
        one_minus_cos_from_sin_squared(sin_squared).max(f32::MIN_POSITIVE)
    }

    /// Distance along a unit `direction` to the nearest surface in front.
    fn distance(&self, point: Vec3A, direction: Vec3A) -> Option<f32> {
        let to_center = self.center - point;
        let along = direction.dot(to_center);
        match self.shape {
            Shape::Point => None,
            Shape::Sphere => {
                // The distance from the centre to the line, without cancellation.
                let across = to_center - along * direction;
                let half_chord = (self.radius * self.radius - across.length_squared())
                    .max(0.0)
                    .sqrt();
                let hits = across.length_squared() <= self.radius * self.radius;
                let near = along - half_chord;
                let t = if near > 0.0 { near } else { along + half_chord };
                (hits && t > 0.0).then_some(t)
            }
            Shape::Disk => {
                let t = to_center.length_squared() / along;
                let off = point + t * direction - self.center;
                let hits = along > 0.0 && off.length_squared() <= self.radius * self.radius;
                hits.then_some(t)
            }
        }
    }

    /// A direction to the lamp and the distance to its surface.
    fn direction(&self, receiver: &Receiver, u: [f32; 2]) -> (Vec3A, f32) {
        let to_center = self.center - receiver.point;
        let center_distance = to_center.length();
        let toward = Frame::from_normal(to_center.normalize_or(Vec3A::Z));
        match self.shape {
            Shape::Point => (toward.normal(), center_distance),
            Shape::Sphere if self.is_inside(receiver.point) => {
                let around = Frame::from_normal(receiver.normal);
                let direction = around.to_world(sample_cosine_hemisphere(u));
                let t = self.distance(receiver.point, direction);
                (direction, t.unwrap_or(self.radius))
            }
            Shape::Sphere => {
                let local = sample_cone(self.one_minus_cos(to_center), u);
                let sin_squared = local.x * local.x + local.y * local.y;
                let across_squared = center_distance * center_distance * sin_squared;
                let half_chord = (self.radius * self.radius - across_squared).max(0.0).sqrt();
                let distance = center_distance * local.z - half_chord;
                (toward.to_world(local), distance)
            }
            Shape::Disk => {
                let on_disk = self.radius * sample_disk(u);
                let offset = toward.to_world(Vec3A::new(on_disk.x, on_disk.y, 0.0));
                let to_disk = to_center + offset;
                let distance = to_disk.length();
                (to_disk / distance, distance)
            }
        }
    }
}

impl Emitter for Sphere {
    fn irradiance(&self, receiver: &Receiver) -> f32 {
        let to_center = self.center - receiver.point;
        let distance = to_center.length().max(self.radius).max(f32::MIN_POSITIVE);
        let direction = to_center / distance;
        let sin_size = self.radius / distance;
        let cos = (receiver.normal.dot(direction) + sin_size).clamp(0.0, 1.0);
        let reaches = |cone: Cone| sin_size >= 1.0 || cone.may_reach(-direction, sin_size);
        if !self.cone.is_none_or(reaches) {
            return 0.0;
        }
        luminance(self.power.abs()) * cos / (4.0 * PI * distance * distance)
    }

    fn sample(&self, receiver: &Receiver, _: f32, u: [f32; 2]) -> Option<LightSample> {
        let Receiver { point, normal, .. } = *receiver;
        let (direction, distance) = self.direction(receiver, u);
        let is_delta = self.shape == Shape::Point;
        let radiance = if is_delta {
            let intensity = self.power * (self.attenuation(direction, false) / (4.0 * PI));
            intensity / (distance * distance)
        } else {
            self.radiance(direction, self.is_inside(point))
        };
        let pdf_solid_angle = if is_delta {
            1.0
        } else {
            self.pdf(point, normal, direction, distance)
        };
        let useful = radiance != Vec3A::ZERO && distance > 0.0 && radiance.is_finite();
        (useful && pdf_solid_angle > 0.0).then_some(LightSample {
            direction,
            distance,
            end: None,
            radiance: Some(radiance),
            pdf_solid_angle,
            is_delta,
            class: LightClass::Local,
            reach: Reach::ALL,
        })
    }

    fn intersect(&self, ray: &Ray, normal: Vec3A) -> Option<LightHit> {
        let t = self.distance(ray.origin, ray.direction)?;
        let radiance = self.radiance(ray.direction, self.is_inside(ray.origin));
        (t <= ray.t_max && radiance != Vec3A::ZERO).then(|| LightHit {
            links: Links::default(),
            t,
            radiance,
            pdf_solid_angle: self.pdf(ray.origin, normal, ray.direction, t),
        })
    }

    fn extent(&self) -> Option<Extent> {
        let intensity = luminance(self.power.abs()) / (4.0 * PI);
        let (normals, reach) = match self.cone {
            None => (NormalCone::ALL, FRAC_PI_2),
            Some(cone) => {
                let (axis, angle) = (cone.axis, 0.0);
                (NormalCone { axis, angle }, cone.half_angle)
            }
        };
        Some(Extent {
            low: self.center - self.radius,
            high: self.center + self.radius,
            intensity,
            normals,
            reach,
            both_sides: false,
        })
    }
}
