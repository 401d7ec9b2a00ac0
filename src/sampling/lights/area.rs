//! Area lamps: rectangles and ellipses that shine to one side, their own -Z.
//!
//! A lamp of power P and area A has the radiance P / (pi A), as in Cycles (4.2 to 5.x).

use std::f32::consts::{FRAC_PI_4, PI};

use glam::{Affine3A, Vec2, Vec3A};

use super::{Emitter, LightClass, LightHit, LightSample, Receiver};
use crate::math::warp::sample_disk;
use crate::math::{Ray, luminance};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Rectangle,
    Ellipse,
}

#[derive(Debug)]
pub(super) struct Area {
    center: Vec3A,
    axes: [Vec3A; 2],
    /// Side it shines to.
    normal: Vec3A,
    half_size: Vec2,
    shape: Shape,
    area: f32,
    power: Vec3A,
    camera_visible: bool,
}

impl Area {
    /// `size` are side lengths or diameters [m]; `None` for a lamp without area, which is black.
    pub(super) fn new(
        world_from_light: &Affine3A,
        power: Vec3A,
        size: [f32; 2],
        shape: Shape,
        camera_visible: bool,
    ) -> Option<Self> {
        let rectangle = size[0] * size[1];
        let area = match shape {
            Shape::Rectangle => rectangle,
            Shape::Ellipse => FRAC_PI_4 * rectangle,
        };
        let axes = world_from_light.matrix3;
        (area > 0.0).then(|| Self {
            center: world_from_light.translation,
            axes: [
                axes.x_axis.normalize_or(Vec3A::X),
                axes.y_axis.normalize_or(Vec3A::Y),
            ],
            normal: -axes.z_axis.normalize_or(Vec3A::Z),
            half_size: 0.5 * Vec2::from(size),
            shape,
            area,
            power,
            camera_visible,
        })
    }

    fn radiance(&self) -> Vec3A {
        self.power / (PI * self.area)
    }

    /// Density per steradian of a point at distance `t` in `direction`, drawn uniformly in area.
    fn pdf(&self, direction: Vec3A, t: f32) -> f32 {
        t * t / (self.area * -direction.dot(self.normal)).max(f32::MIN_POSITIVE)
    }

    fn covers(&self, point: Vec3A) -> bool {
        let offset = point - self.center;
        let on = Vec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1])) / self.half_size;
        match self.shape {
            Shape::Rectangle => on.abs().max_element() <= 1.0,
            Shape::Ellipse => on.length_squared() <= 1.0,
        }
    }
}

impl Emitter for Area {
    /// The lamp as a small source at its centre, kept from growing beyond its surface's `pi L`.
    fn irradiance(&self, receiver: &Receiver) -> f32 {
        let to_center = self.center - receiver.point;
        let reach = self.half_size.length();
        let height = -to_center.dot(self.normal);
        let above = receiver.normal.dot(to_center) + reach;
        if height <= 0.0 || above <= 0.0 {
            return 0.0;
        }
        let distance_squared = to_center.length_squared().max(0.25 * self.area);
        let distance = distance_squared.sqrt();
        let cos_light = (height / distance).max(0.05); // its edges stand higher than its centre
        let cos = (above / distance).min(1.0);
        luminance(self.power) / PI * cos * cos_light / distance_squared
    }

    fn power(&self, _: f32) -> f32 {
        luminance(self.power)
    }

    fn sample(&self, receiver: &Receiver, _: f32, u: [f32; 2]) -> Option<LightSample> {
        let unit = match self.shape {
            Shape::Rectangle => 2.0 * Vec2::from(u) - 1.0,
            Shape::Ellipse => sample_disk(u),
        };
        let on = unit * self.half_size;
        let offset = self.center + on.x * self.axes[0] + on.y * self.axes[1] - receiver.point;
        let distance = offset.length();
        let direction = offset / distance;
        (direction.dot(self.normal) < 0.0).then(|| LightSample {
            direction,
            distance,
            radiance: Some(self.radiance()),
            pdf_solid_angle: self.pdf(direction, distance),
            is_delta: false,
            class: LightClass::Local,
        })
    }

    fn intersect(&self, ray: &Ray, _: Vec3A) -> Option<LightHit> {
        let towards = ray.direction.dot(self.normal);
        let t = (self.center - ray.origin).dot(self.normal) / towards;
        let hits = towards < 0.0 && t > 0.0 && t <= ray.t_max && self.covers(ray.at(t));
        hits.then(|| LightHit {
            t,
            radiance: self.radiance(),
            pdf_solid_angle: self.pdf(ray.direction, t),
        })
    }

    fn camera_visible(&self) -> bool {
        self.camera_visible
    }

    fn position(&self) -> Option<Vec3A> {
        Some(self.center)
    }
}
