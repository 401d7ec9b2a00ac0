//! A lamp with nodes: the plain lamp, times what its program shines at the point that is seen.
//!
//! What nodes read of a lamp follows Cycles 5.0: a ball's normal points outwards, that of a point or
//! a disk at the viewer; texture coordinates are those of the whole sphere, of a spot those of the
//! square around its cone, of an area lamp its own. A sun's points lie one metre from the origin.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3A, Vec3Swizzles, Vec4};

use super::mesh::glow_of;
use super::tree::Extent;
use super::{Emitter, LightHit, LightSample, Receiver};
use crate::math::warp::sample_sphere;
use crate::math::{MIDDLE_TIME, Ray, luminance};
use crate::scene::world::uv_of_direction;
use crate::scene::{Camera, Image, Light, LightKind, SceneFrame};
use crate::shader::{Attributes, FILTER_WIDTH, Point, Program, RayInfo};

pub(super) struct Shaded {
    lamp: Box<dyn Emitter>,
    kind: LightKind,
    world_from_lamp: Affine3A,
    lamp_from_world: Affine3A,
    program: Program,
    images: Vec<Arc<Image>>,
    camera: Camera,
    /// Luminance of the program's light, about.
    mean: f32,
}

/// A lamp has one layer: its texture coordinate.
struct Uv(Vec2);

impl Attributes for Uv {
    fn corners(&self, key: u32) -> Option<[Vec4; 3]> {
        (key == 0).then(|| [self.0.extend(0.0).extend(1.0); 3])
    }
}

/// A point of a lamp, seen in a direction of world space from this far away [m].
#[derive(Clone, Copy)]
struct Seen {
    position: Vec3A,
    direction: Vec3A,
    distance: f32,
}

impl Seen {
    fn new(origin: Vec3A, direction: Vec3A, distance: f32) -> Self {
        let is_far = distance == f32::INFINITY;
        Self {
            position: if is_far {
                direction
            } else {
                origin + distance * direction
            },
            direction,
            distance: distance.min(f32::MAX),
        }
    }
}

impl Shaded {
    pub(super) fn new(
        lamp: Box<dyn Emitter>,
        light: &Light,
        program: &Program,
        frame: &SceneFrame,
    ) -> Self {
        let world_from_lamp = light.world_from_light * Affine3A::from_scale(light.scale.into());
        let mut shaded = Self {
            lamp,
            kind: light.kind,
            world_from_lamp,
            lamp_from_world: world_from_lamp.inverse(),
            program: program.clone(),
            images: frame.images.clone(),
            camera: frame.camera,
            mean: 1.0,
        };
        shaded.mean = shaded.probed();
        shaded
    }

    /// The mean luminance of the program's light as it is seen from around the lamp.
    fn probed(&self) -> f32 {
        /// Along each axis of the sphere of directions.
        const PROBES: u32 = 8;
        /// What looks dark may shine between the probes.
        const LEAST: f32 = 1e-3;
        let center = self.world_from_lamp.translation;
        let numbers = |i: u32| (i as f32 + 0.5) / PROBES as f32;
        let grid = (0..PROBES * PROBES).map(|i| [numbers(i / PROBES), numbers(i % PROBES)]);
        let probe = |u: [f32; 2]| {
            let outward = sample_sphere(u);
            let receiver = Receiver {
                point: center + outward,
                normal: -outward,
                time: MIDDLE_TIME,
            };
            let sample = self.lamp.sample(&receiver, 0.5, [u[1], u[0]])?;
            let seen = Seen::new(receiver.point, sample.direction, sample.distance);
            Some(luminance(self.factor(seen).abs()))
        };
        let (sum, count) = grid
            .filter_map(probe)
            .fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
        let mean: f32 = sum / f32::max(count, 1.0);
        if mean.is_finite() {
            mean.max(LEAST)
        } else {
            1.0
        }
    }

    fn factor(&self, seen: Seen) -> Vec3A {
        let normal = self.normal(seen);
        let uv = Uv(self.uv(seen, normal));
        let (world, lamp) = (&self.world_from_lamp, &self.lamp_from_world);
        let normal_object = world.matrix3.transpose() * normal;
        let point = Point {
            position: seen.position,
            normal,
            geometric_normal: normal,
            normal_object: normal_object.normalize_or(Vec3A::Z),
            incoming: -seen.direction,
            ray_length: seen.distance,
            filter_width: FILTER_WIDTH,
            world_from_object: world,
            object_from_world: lamp,
            attributes: &uv,
            view: &self.camera,
            ray: &RayInfo::default(),
            ..Point::nowhere()
        };
        glow_of(&self.program, &point, &self.images)
    }

    fn normal(&self, seen: Seen) -> Vec3A {
        let outward = seen.position - self.world_from_lamp.translation;
        match self.kind {
            LightKind::AreaRectangle { .. } | LightKind::AreaEllipse { .. } => {
                -self.world_from_lamp.matrix3.z_axis.normalize_or(Vec3A::Z)
            }
            LightKind::Point {
                radius,
                soft_falloff: false,
            }
            | LightKind::Spot {
                radius,
                soft_falloff: false,
                ..
            } if radius > 0.0 => outward.normalize_or(-seen.direction),
            _ => -seen.direction,
        }
    }

    fn uv(&self, seen: Seen, normal: Vec3A) -> Vec2 {
        let to_lamp = |v: Vec3A| self.lamp_from_world.transform_vector3a(v);
        match self.kind {
            LightKind::AreaRectangle { size, .. } | LightKind::AreaEllipse { size, .. } => {
                let offset = seen.position - self.world_from_lamp.translation;
                let along = |axis: Vec3A| offset.dot(axis.normalize_or_zero());
                let axes = self.world_from_lamp.matrix3;
                let on = Vec2::new(along(axes.x_axis), along(axes.y_axis));
                on / Vec2::from(size) + 0.5
            }
            LightKind::Spot { cone_angle, .. } => {
                let ray = to_lamp(-seen.direction);
                let width = -2.0 * ray.z * (0.5 * cone_angle).tan();
                Vec2::new(ray.x, ray.y) / width + 0.5
            }
            // The world's map, with +Y in the middle.
            LightKind::Point { .. } => {
                uv_of_direction(to_lamp(normal).normalize_or(Vec3A::Z).yxz())
            }
            LightKind::Sun { angle } => {
                let to_sun = to_lamp(seen.direction);
                let width = 2.0 * (0.5 * angle).sin();
                (Vec2::new(to_sun.x, to_sun.y) / width.max(f32::MIN_POSITIVE)).clamp_length_max(0.5)
                    + 0.5
            }
        }
    }
}

impl Emitter for Shaded {
    fn irradiance(&self, receiver: &Receiver) -> f32 {
        self.mean * self.lamp.irradiance(receiver)
    }

    fn sample(&self, receiver: &Receiver, u_choice: f32, u: [f32; 2]) -> Option<LightSample> {
        let sample = self.lamp.sample(receiver, u_choice, u)?;
        let seen = Seen::new(receiver.point, sample.direction, sample.distance);
        let radiance = sample.radiance.map(|radiance| radiance * self.factor(seen));
        Some(LightSample { radiance, ..sample })
    }

    fn intersect(&self, ray: &Ray, normal: Vec3A) -> Option<LightHit> {
        let hit = self.lamp.intersect(ray, normal)?;
        let seen = Seen::new(ray.origin, ray.direction, hit.t);
        let radiance = hit.radiance * self.factor(seen);
        Some(LightHit { radiance, ..hit })
    }

    fn extent(&self) -> Option<Extent> {
        let extent = self.lamp.extent()?;
        Some(Extent {
            intensity: self.mean * extent.intensity,
            ..extent
        })
    }
}
