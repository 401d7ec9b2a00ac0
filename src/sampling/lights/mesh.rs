//! An instance whose triangles glow, to both sides as in Cycles.

use std::borrow::Cow;
use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use glam::{Vec2, Vec3A};

use super::tree::{Extent, NormalCone};
use super::{Emitter, LightClass, LightSample, Receiver};
use crate::math::warp::sample_triangle;
use crate::math::{MIDDLE_TIME, facing, luminance, offset_origin};
use crate::sampling::discrete::Discrete;
use crate::scene::{self, Camera, Image, Instance, Material, Mesh, Reach, SceneFrame};
use crate::shader::{Closure, Point, Program, RayInfo};

/// The light of a program: where the ray that arrives has a direction, what leaves against it.
pub(super) fn glow_of(emission: &Program, point: &Point, images: &[Arc<Image>]) -> Vec3A {
    let mut radiance = Vec3A::ZERO;
    emission.run(point, images, &mut |closure| {
        if let Closure::Emission(light) = closure {
            radiance += *light;
        }
    });
    if radiance.is_finite() {
        radiance
    } else {
        Vec3A::ZERO
    }
}

/// Radiance that leaves a point of a surface on its own, against a ray of this direction.
pub fn emitted_radiance(
    frame: &SceneFrame,
    instance: u32,
    triangle: u32,
    barycentric: Vec2,
    direction: Vec3A,
) -> Vec3A {
    let Some(material) = frame.material_of(instance, triangle) else {
        return Vec3A::ZERO;
    };
    let facet = scene::Facet::new(frame, instance, triangle, MIDDLE_TIME);
    let ray = RayInfo::default();
    let point = facet.point(barycentric, direction, direction.length(), &ray);
    glow_of(&material.emission, &point, &frame.images)
}

#[derive(Debug, Clone)]
struct Facet {
    triangle: u32,
    corners: [Vec3A; 3],
    /// Index into [`MeshLight::glows`].
    glow: u32,
}

impl Facet {
    /// Normal with the area as its length.
    fn area_normal(&self) -> Vec3A {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a)
    }

    fn normal(&self) -> Vec3A {
        self.area_normal().normalize_or_zero()
    }
}

/// How a material shines.
enum Glow {
    Dark,
    /// The same everywhere.
    Uniform(Vec3A),
    /// As its nodes compute.
    Nodes(Program),
}

impl Glow {
    fn of(material: &Material) -> Self {
        // What depends on the things around is known only where a ray arrives.
        if !material.is_emissive() || material.emission.asks_around() {
            return Glow::Dark;
        }
        if !material.emission.is_uniform() {
            return Glow::Nodes(material.emission.clone());
        }
        let radiance = glow_of(&material.emission, &Point::nowhere(), &[]);
        if radiance == Vec3A::ZERO {
            Glow::Dark
        } else {
            Glow::Uniform(radiance)
        }
    }
}

/// What nodes read, where some material shines as they compute, and where it is at any time.
struct Shading {
    images: Vec<Arc<Image>>,
    camera: Camera,
    instance: Instance,
    mesh: Arc<Mesh>,
}

impl Shading {
    fn of(frame: &SceneFrame, instance: u32) -> Self {
        let placed = &frame.instances[instance as usize];
        Self {
            images: frame.images.clone(),
            camera: frame.camera,
            instance: placed.clone(),
            mesh: frame.meshes[placed.mesh as usize].clone(),
        }
    }

    /// Corners of a triangle, world space.
    fn corners_at(&self, triangle: u32, time: f32) -> [Vec3A; 3] {
        let placement = self.instance.placement_at(time);
        let corners = self.mesh.corners_at(triangle, time);
        corners.map(|corner| placement.world_from_object.transform_point3a(corner))
    }

    fn radiance(&self, nodes: &Program, spot: Spot, direction: Vec3A) -> Vec3A {
        let Spot { triangle, at, time } = spot;
        let facet = scene::Facet::of(&self.camera, &self.instance, &self.mesh, triangle, time);
        let ray = RayInfo::default();
        let point = facet.point(at, direction, direction.length(), &ray);
        glow_of(nodes, &point, &self.images)
    }
}

/// A point of a triangle at a time.
#[derive(Clone, Copy)]
struct Spot {
    triangle: u32,
    /// Barycentric coordinates.
    at: Vec2,
    time: f32,
}

pub(super) struct MeshLight {
    facets: Vec<Facet>,
    choice: Discrete,
    /// By material slot.
    glows: Vec<Glow>,
    /// Where some of them are computed by nodes, and where the instance moves.
    shading: Option<Shading>,
    is_moving: bool,
    center: Vec3A,
    radius: f32,
    power: f32,
}

impl MeshLight {
    /// The light of an instance; `None` if no triangle of it glows.
    pub(super) fn new(frame: &SceneFrame, instance: u32) -> Option<Self> {
        let materials = frame.instances[instance as usize].materials.iter();
        let glows: Vec<Glow> = materials
            .map(|&material| Glow::of(&frame.materials[material as usize]))
            .collect();
        if glows.iter().all(|glow| matches!(glow, Glow::Dark)) {
            return None;
        }
        let has_nodes = glows.iter().any(|glow| matches!(glow, Glow::Nodes(_)));
        let is_moving = frame.moves(instance);
        let shading = (has_nodes || is_moving).then(|| Shading::of(frame, instance));
        let facets = facets(frame, instance, &glows);
        let powers = powers(&facets, &glows, shading.as_ref());
        let choice = Discrete::new(powers.iter().copied())?;
        let corners = || facets.iter().flat_map(|f| f.corners);
        let mut low = corners().fold(Vec3A::INFINITY, Vec3A::min);
        let mut high = corners().fold(Vec3A::NEG_INFINITY, Vec3A::max);
        if let Some((lower, upper)) = is_moving.then(|| frame.bounds_of(instance)).flatten() {
            (low, high) = (lower, upper);
        }
        Some(Self {
            choice,
            center: 0.5 * (low + high),
            radius: 0.5 * (high - low).length(),
            power: powers.iter().sum(),
            facets,
            glows,
            shading,
            is_moving,
        })
    }

    fn radiance(&self, facet: &Facet, at: Vec2, time: f32, direction: Vec3A) -> Vec3A {
        match (&self.glows[facet.glow as usize], &self.shading) {
            (Glow::Uniform(radiance), _) => *radiance,
            (Glow::Nodes(nodes), Some(shading)) => {
                let triangle = facet.triangle;
                shading.radiance(nodes, Spot { triangle, at, time }, direction)
            }
            _ => Vec3A::ZERO,
        }
    }

    /// A facet where it is at a share of the shutter's time.
    fn facet_at(&self, index: usize, time: f32) -> Cow<'_, Facet> {
        let facet = &self.facets[index];
        match &self.shading {
            Some(shading) if self.is_moving => Cow::Owned(Facet {
                corners: shading.corners_at(facet.triangle, time),
                ..*facet
            }),
            _ => Cow::Borrowed(facet),
        }
    }

    /// Density [1/sr] with which the point at `offset` of a facet is drawn.
    fn pdf_of_facet(&self, index: usize, facet: &Facet, offset: Vec3A) -> f32 {
        let distance_squared = offset.length_squared();
        let cos_times_area = offset.dot(facet.area_normal()).abs() / distance_squared.sqrt();
        let density = self.choice.pmf(index) * distance_squared / cos_times_area;
        if density.is_finite() { density } else { 0.0 }
    }
}

fn facets(frame: &SceneFrame, instance: u32, glows: &[Glow]) -> Vec<Facet> {
    let placed = &frame.instances[instance as usize];
    let mesh = frame.mesh_of(instance);
    let slots = mesh.faces.iter().map(|face| face.slot).enumerate();
    slots
        .map(|(triangle, slot)| (triangle as u32, (slot as usize).min(glows.len() - 1)))
        .filter(|&(_, slot)| !matches!(glows[slot], Glow::Dark))
        .map(|(triangle, slot)| Facet {
            triangle,
            corners: mesh
                .corners(triangle)
                .map(|corner| placed.placement.world_from_object.transform_point3a(corner)),
            glow: slot as u32,
        })
        .collect()
}

/// Where a triangle's light is looked at to guess its power: its middle and towards its corners.
const PROBES: [Vec2; 4] = [
    Vec2::new(1.0 / 3.0, 1.0 / 3.0),
    Vec2::new(1.0 / 6.0, 1.0 / 6.0),
    Vec2::new(2.0 / 3.0, 1.0 / 6.0),
    Vec2::new(1.0 / 6.0, 2.0 / 3.0),
];

/// A triangle whose probes are dark may shine between them: it is taken for this share of the mean.
const LEAST_RADIANCE: f32 = 0.05;

/// Power of each triangle to both sides, never zero: nodes may make any point of it shine.
fn powers(facets: &[Facet], glows: &[Glow], shading: Option<&Shading>) -> Vec<f32> {
    let probed = |facet: &Facet, nodes: &Program, shading: &Shading| {
        let direction = -facet.area_normal();
        let spot = |at: Vec2| Spot {
            triangle: facet.triangle,
            at,
            time: MIDDLE_TIME,
        };
        let at = |probe: Vec2| luminance(shading.radiance(nodes, spot(probe), direction));
        PROBES.map(at).iter().sum::<f32>() / PROBES.len() as f32
    };
    let radiances: Vec<f32> = facets
        .iter()
        .map(|facet| match (&glows[facet.glow as usize], shading) {
            (Glow::Nodes(nodes), Some(shading)) => probed(facet, nodes, shading),
            (Glow::Uniform(radiance), _) => luminance(*radiance),
            _ => 0.0,
        })
        .collect();
    let mean = radiances.iter().sum::<f32>() / radiances.len().max(1) as f32;
    let least = if mean > 0.0 {
        LEAST_RADIANCE * mean
    } else {
        1.0
    };
    let power = |(facet, radiance): (&Facet, &f32)| {
        let radiance = match glows[facet.glow as usize] {
            Glow::Nodes(_) => radiance.max(least),
            _ => *radiance,
        };
        let power = TAU * radiance * facet.area_normal().length();
        if power.is_finite() { power } else { 0.0 }
    };
    facets.iter().zip(&radiances).map(power).collect()
}

impl Emitter for MeshLight {
    /// The whole instance as a ball of its size around its middle.
    fn irradiance(&self, receiver: &Receiver) -> f32 {
        let to_center = self.center - receiver.point;
        let distance = to_center.length().max(self.radius).max(f32::MIN_POSITIVE);
        let above = receiver.normal.dot(to_center) + self.radius;
        let cos = (above / distance).clamp(0.0, 1.0);
        self.power * cos / (4.0 * PI * distance * distance)
    }

    fn sample(&self, receiver: &Receiver, u_choice: f32, u: [f32; 2]) -> Option<LightSample> {
        let (index, _, _) = self.choice.sample(u_choice);
        let facet = self.facet_at(index, receiver.time);
        let b = sample_triangle(u);
        let weights = [1.0 - b.x - b.y, b.x, b.y];
        let mix = |k: usize| weights[k] * facet.corners[k];
        let point = mix(0) + mix(1) + mix(2);
        let offset = point - receiver.point;
        let distance = offset.length();
        let radiance = self.radiance(&facet, Vec2::new(b.x, b.y), receiver.time, offset);
        let pdf_solid_angle = self.pdf_of_facet(index, &facet, offset);
        (pdf_solid_angle > 0.0 && distance > 0.0).then(|| LightSample {
            direction: offset / distance,
            distance,
            end: Some(offset_origin(point, facing(facet.normal(), -offset))),
            radiance: Some(radiance),
            pdf_solid_angle,
            is_delta: false,
            class: LightClass::Local,
            reach: Reach::ALL,
        })
    }

    fn pdf_of_triangle(&self, receiver: &Receiver, triangle: u32, hit: Vec3A) -> f32 {
        let found = self.facets.binary_search_by_key(&triangle, |f| f.triangle);
        found.map_or(0.0, |index| {
            let facet = self.facet_at(index, receiver.time);
            self.pdf_of_facet(index, &facet, hit - receiver.point)
        })
    }

    fn extent(&self) -> Option<Extent> {
        // Both sides of its triangles shine.
        Some(Extent {
            low: self.center - self.radius,
            high: self.center + self.radius,
            intensity: self.power / (4.0 * PI),
            normals: NormalCone::ALL,
            reach: FRAC_PI_2,
        })
    }
}
