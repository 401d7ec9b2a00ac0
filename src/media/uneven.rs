//! Media that differ from place to place: the program of a material, run at points inside of a body.

use glam::{Affine3A, Vec2, Vec3A, Vec4};

use super::majorant::{Cell, Look, Majorants};
use crate::math::Ray;
use crate::scene::{Content, Medium, Placement, SceneFrame};
use crate::shader::{
    Attributes, FILTER_WIDTH, GENERATED, ObjectInfo, Point, Program, RayInfo, RayKind,
};

/// A medium that a program tells.
pub struct Uneven {
    /// The body; the world without one.
    instance: Option<u32>,
    program: Program,
    /// Lower corner and size of what Generated coordinates count from 0 to 1.
    texture_space: [Vec3A; 2],
    /// What its coefficients are multiplied with.
    density_scale: f32,
    majorants: Majorants,
}

/// A ray on its way, and the frame that it is in.
#[derive(Clone, Copy)]
pub struct Journey<'a> {
    /// The frame.
    pub frame: &'a SceneFrame,
    /// The ray, with a unit direction.
    pub ray: &'a Ray,
    /// What programs are told of it.
    pub info: &'a RayInfo<'a>,
}

/// What a volume's program finds at a point: grids, and Generated coordinates.
struct Inside<'a> {
    content: Option<&'a Content>,
    texture_space: [Vec3A; 2],
    /// Object space.
    position: Vec3A,
}

impl Attributes for Inside<'_> {
    fn corners(&self, key: u32) -> Option<[Vec4; 3]> {
        if key == GENERATED {
            let [low, size] = self.texture_space;
            return Some([((self.position - low) / size).extend(1.0); 3]);
        }
        let grids = &self.content?.grids;
        let (_, grid) = grids.iter().find(|(known, _)| *known == key)?;
        Some([grid.at(self.position); 3])
    }
}

static NOWHERE: ObjectInfo = ObjectInfo {
    color: Vec4::ONE,
    index: 0.0,
    random: 0.0,
    particle: None,
};

/// What a point is in.
struct Body<'a> {
    content: Option<&'a Content>,
    texture_space: [Vec3A; 2],
    placement: &'a Placement,
    info: &'a ObjectInfo,
}

/// What a program says of a point `t` along a ray, through a body.
fn medium_at(program: &Program, body: &Body, journey: &Journey, t: f32) -> Option<Medium> {
    let (frame, back) = (journey.frame, -journey.ray.direction);
    let position = journey.ray.at(t);
    let object_from_world = &body.placement.object_from_world;
    let inside = Inside {
        content: body.content,
        texture_space: body.texture_space,
        position: object_from_world.transform_point3a(position),
    };
    // As in Cycles a volume's point faces the ray.
    let point = Point {
        position,
        normal: back,
        geometric_normal: back,
        normal_object: back,
        incoming: back,
        barycentric: Vec2::ZERO,
        edges: [Vec3A::X, Vec3A::Y],
        is_back: false,
        ray_length: t,
        filter_width: FILTER_WIDTH,
        world_from_object: &body.placement.world_from_object,
        object_from_world,
        object: body.info,
        instance: None,
        attributes: &inside,
        view: &frame.camera,
        ray: journey.info,
    };
    Medium::at(program, &point, &frame.images)
}

/// What fills a body by a program that says the same of all its places.
pub fn medium_of(program: &Program, frame: &SceneFrame, instance: u32) -> Option<Medium> {
    let placed = &frame.instances[instance as usize];
    let content = &frame.mesh_of(instance).content;
    let body = Body {
        content: Some(content),
        texture_space: [Vec3A::ZERO, Vec3A::ONE],
        placement: &placed.placement,
        info: &placed.info,
    };
    let ray = Ray::new(placed.placement.world_from_object.translation, Vec3A::Z);
    let info = RayInfo::default();
    let journey = Journey {
        frame,
        ray: &ray,
        info: &info,
    };
    let medium = medium_at(program, &body, &journey, 0.0)?;
    Some(medium.times(density_scale(content, &placed.placement)))
}

/// What coefficients are multiplied with where an object is scaled: as in Cycles after the length of a
/// diagonal.
pub fn density_scale(content: &Content, placement: &Placement) -> f32 {
    let diagonal = Vec3A::splat(1.0f32 / 3.0f32.sqrt());
    match content.is_scaled {
        true => 1.0 / (placement.world_from_object.matrix3 * diagonal).length(),
        false => 1.0,
    }
}

/// A ray as programs of volumes see any one of this kind.
fn info_of(kind: RayKind) -> RayInfo<'static> {
    RayInfo {
        kind,
        ..RayInfo::default()
    }
}

impl Uneven {
    /// What fills a body; `None` where its mesh is empty.
    pub fn of_body(frame: &SceneFrame, instance: u32, program: &Program) -> Option<Self> {
        let mesh = frame.mesh_of(instance);
        let (lower, upper) = mesh.bounds()?;
        let content = &mesh.content;
        let placement = &frame.instances[instance as usize].placement;
        let diagonal = placement
            .world_from_object
            .transform_vector3a(upper - lower)
            .length();
        let mut uneven = Self {
            instance: Some(instance),
            program: program.clone(),
            texture_space: content.texture_space.unwrap_or([lower, upper - lower]),
            density_scale: density_scale(content, placement),
            majorants: Majorants::of_nothing(),
        };
        let sizes = content.grids.iter().map(|(_, grid)| grid.size());
        let points = sizes.reduce(|a, b| [0, 1, 2].map(|axis| a[axis].max(b[axis])));
        let world_from_object = placement.world_from_object;
        let look = |p: Vec3A| uneven.look(frame, world_from_object.transform_point3a(p));
        uneven.majorants =
            Majorants::of_body([lower, upper], diagonal, points.unwrap_or([1; 3]), look);
        Some(uneven)
    }

    /// What fills the world around things within this box.
    pub fn of_world(frame: &SceneFrame, bounds: [Vec3A; 2], program: &Program) -> Self {
        let mut uneven = Self {
            instance: None,
            program: program.clone(),
            texture_space: [Vec3A::ZERO, Vec3A::ONE],
            density_scale: 1.0,
            majorants: Majorants::of_nothing(),
        };
        uneven.majorants = Majorants::of_world(bounds, |p| uneven.look(frame, p));
        uneven
    }

    /// What a place of the world is filled with, seen along a ray.
    pub fn at(&self, journey: &Journey, t: f32) -> Medium {
        let frame = journey.frame;
        let empty = Content::default();
        let medium = match self.instance {
            None => {
                let body = Body {
                    content: Some(&empty),
                    texture_space: self.texture_space,
                    placement: &WORLD,
                    info: &NOWHERE,
                };
                medium_at(&self.program, &body, journey, t)
            }
            Some(instance) => {
                let placed = &frame.instances[instance as usize];
                let body = Body {
                    content: Some(&frame.mesh_of(instance).content),
                    texture_space: self.texture_space,
                    placement: &placed.placement_at(journey.ray.time),
                    info: &placed.info,
                };
                medium_at(&self.program, &body, journey, t)
            }
        };
        medium.unwrap_or_default().times(self.density_scale)
    }

    /// The most that a place of the world shows to any ray, at the frame's own time.
    fn look(&self, frame: &SceneFrame, position: Vec3A) -> Look {
        const KINDS: [RayKind; 5] = [
            RayKind::Camera,
            RayKind::Diffuse,
            RayKind::Glossy,
            RayKind::Transmission,
            RayKind::Shadow,
        ];
        let kinds = match self.program.asks_ray() {
            true => &KINDS[..],
            false => &KINDS[..1],
        };
        let ray = Ray::new(position, Vec3A::Z).at_time(0.5);
        kinds.iter().fold([0.0; 2], |most, &kind| {
            let info = info_of(kind);
            let journey = Journey {
                frame,
                ray: &ray,
                info: &info,
            };
            let medium = self.at(&journey, 0.0);
            [
                most[0].max(medium.extinction().max_element()),
                most[1].max(medium.emission.max_element()),
            ]
        })
    }

    /// The part with one majorant that a ray is in at `t`.
    pub fn cell(&self, journey: &Journey, t: f32) -> Cell {
        let ray = journey.ray;
        match self.instance {
            None => self.majorants.cell(ray.origin, ray.direction, t),
            Some(instance) => {
                let placed = &journey.frame.instances[instance as usize];
                let object_from_world = placed.placement_at(ray.time).object_from_world;
                let origin = object_from_world.transform_point3a(ray.origin);
                let direction = object_from_world.transform_vector3a(ray.direction);
                self.majorants.cell(origin, direction, t)
            }
        }
    }
}

#[cfg(test)]
impl Uneven {
    /// Multiplies all majorants.
    pub fn lower_limits(&mut self, factor: f32) {
        self.majorants.scale(factor);
    }
}

static WORLD: Placement = Placement {
    world_from_object: Affine3A::IDENTITY,
    object_from_world: Affine3A::IDENTITY,
    world_from_normal: glam::Mat3A::IDENTITY,
};
