//! Area lamps: rectangles and ellipses that shine to one side, their own -Z.
//!
//! A lamp of power P and area A has the radiance P / (pi A), as in Cycles (4.2 to 5.x). Spread
//! narrows it like the slats of a soft box: of the light at an angle x to the axis the share
//! `1 - tan x / tan a` gets through, with a half the spread (Blender, D10594). The power stays.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use glam::{Affine3A, Vec2, Vec3A};

use super::rectangle::SphericalRectangle;
use super::tree::{Extent, NormalCone};
use super::{Emitter, LARGE, LightClass, LightHit, LightSample, Receiver};
use crate::math::warp::sample_disk;
use crate::math::{Ray, luminance};
use crate::scene::{Links, Reach};

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
    /// `None` for one that shines into the whole half space.
    slats: Option<Slats>,
}

/// What narrows an area lamp's light.
#[derive(Debug, Clone, Copy)]
struct Slats {
    tan_half_spread: f32,
    /// Makes up for the light that the slats take.
    gain: f32,
}

/// [`LARGE`] for round lamps: directions to the corners around them are lost, a fifth of all.
const LARGE_ROUND: f32 = 1.0;

/// Cycles makes no lamp narrower [rad].
const SPREAD_MIN: f32 = PI / 180.0;

impl Slats {
    fn new(spread: f32) -> Option<Self> {
        // The last bits of pi: Blender stores what users typed in degrees.
        if spread >= PI - 1e-4 {
            return None;
        }
        let half = 0.5 * spread.max(SPREAD_MIN);
        let tan = half.tan();
        // The integral over the cone of cos x sin x (1 - tan x / tan a) is (tan a - a) / (2 tan a),
        // without slats 1/2. For small angles the difference has few digits: a^3/3 + 2a^5/15.
        let excess = if half < 0.1 {
            let square = half * half;
            half * square * (1.0 / 3.0 + square * (2.0 / 15.0 + square * (17.0 / 315.0)))
        } else {
            tan - half
        };
        Some(Self {
            tan_half_spread: tan,
            gain: tan / excess,
        })
    }

    /// Factor on the light that leaves at this tangent of the angle to the axis.
    fn factor(&self, tan: f32) -> f32 {
        self.gain * (1.0 - tan / self.tan_half_spread).max(0.0)
    }
}

/// A part of the lamp's plane, in its axes [m].
#[derive(Debug, Clone, Copy)]
struct Patch {
    low: Vec2,
    high: Vec2,
}

/// How points of the lamp are drawn.
enum Drawn {
    /// By the solid angle of the part around them, `foot` being where the point that they light lies over the
    /// plane.
    Seen {
        seen: SphericalRectangle,
        foot: Vec2,
    },
    /// By area, of a part.
    Patch(Patch),
    /// By area.
    Whole,
}

impl Patch {
    fn area(&self) -> f32 {
        let size = (self.high - self.low).max(Vec2::ZERO);
        size.x * size.y
    }
}

impl Area {
    /// `size` are side lengths or diameters [m]; `None` for a lamp without area, which is black.
    pub(super) fn new(
        world_from_light: &Affine3A,
        power: Vec3A,
        size: [f32; 2],
        spread: f32,
        shape: Shape,
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
            slats: Slats::new(spread),
        })
    }

    /// Radiance in a direction towards the lamp.
    fn radiance(&self, direction: Vec3A) -> Vec3A {
        let factor = self.slats.map_or(1.0, |slats| {
            let cos = -direction.dot(self.normal);
            slats.factor((1.0 - cos * cos).max(0.0).sqrt() / cos)
        });
        self.power * (factor / (PI * self.area))
    }

    /// Where a point lies over the lamp's plane: in its axes, and its height on the lit side.
    fn local(&self, point: Vec3A) -> (Vec2, f32) {
        let offset = point - self.center;
        let on = Vec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1]));
        (on, offset.dot(self.normal))
    }

    /// The part of the lamp from which light may reach a point, where that is a rectangle: of one
    /// with slats. An ellipse lies inside the part.
    fn patch(&self, point: Vec3A) -> Option<Patch> {
        let slats = self.slats?;
        let (on, height) = self.local(point);
        let radius = Vec2::splat(height.max(0.0) * slats.tan_half_spread);
        Some(Patch {
            low: (on - radius).max(-self.half_size),
            high: (on + radius).min(self.half_size),
        })
    }

    /// The part that may light a point (of a round lamp, its square) as the point sees it, where it is
    /// large enough for its solid angle to be worth its price. Next to a lamp, points drawn by area are
    /// hardly ever those that shine most.
    fn large(&self, point: Vec3A) -> Option<(SphericalRectangle, Vec2)> {
        let (on, height) = self.local(point);
        // No part is seen larger than one at the nearest point would be.
        let beside = (on.abs() - self.half_size).max(Vec2::ZERO);
        let nearest_squared = beside.length_squared() + height * height;
        let at_most = height * self.area / (nearest_squared * nearest_squared.sqrt());
        let large = match self.shape {
            Shape::Rectangle => LARGE,
            Shape::Ellipse => LARGE_ROUND,
        };
        if at_most.is_nan() || at_most < large {
            return None;
        }
        let Patch { low, high } = self.patch(point).unwrap_or(Patch {
            low: -self.half_size,
            high: self.half_size,
        });
        let seen = SphericalRectangle::new(low - on, high - on, height);
        (seen.solid_angle > 1e-4).then_some((seen, on))
    }

    /// How its points are drawn for one that it lights.
    fn drawn_for(&self, point: Vec3A) -> Drawn {
        match self.large(point) {
            Some((seen, foot)) => Drawn::Seen { seen, foot },
            None => self.patch(point).map_or(Drawn::Whole, Drawn::Patch),
        }
    }

    /// Density per steradian of a point at distance `t` in `direction`.
    fn pdf(&self, drawn: &Drawn, direction: Vec3A, t: f32) -> f32 {
        let area = match drawn {
            Drawn::Seen { seen, .. } => return seen.solid_angle.recip(),
            Drawn::Patch(patch) => patch.area(),
            Drawn::Whole => self.area,
        };
        t * t / (area * -direction.dot(self.normal)).max(f32::MIN_POSITIVE)
    }

    fn covers(&self, on: Vec2) -> bool {
        let on = on / self.half_size;
        match self.shape {
            Shape::Rectangle => on.abs().max_element() <= 1.0,
            Shape::Ellipse => on.length_squared() <= 1.0,
        }
    }

    /// A point of the lamp, in its axes.
    fn sample_point(&self, drawn: &Drawn, u: [f32; 2]) -> Option<Vec2> {
        let on = match (drawn, self.shape) {
            (Drawn::Seen { seen, foot }, _) => *foot + seen.sample(u),
            (Drawn::Patch(Patch { low, high }), _) => *low + (*high - *low) * Vec2::from(u),
            (Drawn::Whole, Shape::Rectangle) => {
                return Some((2.0 * Vec2::from(u) - 1.0) * self.half_size);
            }
            (Drawn::Whole, Shape::Ellipse) => return Some(sample_disk(u) * self.half_size),
        };
        self.covers(on).then_some(on)
    }

    /// Most of what the slats let through to a point.
    fn largest_factor(&self, point: Vec3A) -> f32 {
        self.slats.map_or(1.0, |slats| {
            let (on, height) = self.local(point);
            let aside = on - on.clamp(-self.half_size, self.half_size);
            slats.factor(aside.length() / height)
        })
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
        let narrowed = luminance(self.power.abs()) * self.largest_factor(receiver.point);
        narrowed / PI * cos * cos_light / distance_squared
    }

    fn sample(&self, receiver: &Receiver, _: f32, u: [f32; 2]) -> Option<LightSample> {
        let drawn = self.drawn_for(receiver.point);
        let on = self.sample_point(&drawn, u)?;
        let offset = self.center + on.x * self.axes[0] + on.y * self.axes[1] - receiver.point;
        let distance = offset.length();
        let direction = offset / distance;
        (direction.dot(self.normal) < 0.0).then(|| LightSample {
            direction,
            distance,
            end: None,
            radiance: Some(self.radiance(direction)),
            pdf_solid_angle: self.pdf(&drawn, direction, distance),
            is_delta: false,
            class: LightClass::Local,
            reach: Reach::ALL,
        })
    }

    fn intersect(&self, ray: &Ray, _: Vec3A) -> Option<LightHit> {
        let towards = ray.direction.dot(self.normal);
        let t = (self.center - ray.origin).dot(self.normal) / towards;
        let in_range = towards < 0.0 && t > 0.0 && t <= ray.t_max;
        let hits = in_range && self.covers(self.local(ray.at(t)).0);
        hits.then(|| LightHit {
            links: Links::default(),
            t,
            radiance: self.radiance(ray.direction),
            pdf_solid_angle: self.pdf(&self.drawn_for(ray.origin), ray.direction, t),
        })
    }

    fn extent(&self) -> Option<Extent> {
        // The ball that `irradiance` takes it for.
        let radius = self.half_size.length();
        let (gain, reach) = self.slats.map_or((1.0, FRAC_PI_2), |slats| {
            (slats.gain, slats.tan_half_spread.atan())
        });
        Some(Extent {
            low: self.center - radius,
            high: self.center + radius,
            intensity: gain * luminance(self.power.abs()) / PI,
            normals: NormalCone {
                axis: self.normal,
                angle: 0.0,
            },
            reach,
            both_sides: false,
        })
    }
}
