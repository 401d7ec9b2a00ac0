//! How strongly triangles shine: evenly, or as the nodes of their material compute.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Vec2, Vec3A};

use super::facet::Facet;
use super::sides::Sides;
use crate::math::{MIDDLE_TIME, luminance};
use crate::scene::{self, Camera, Image, Instance, Material, Mesh, SceneFrame};
use crate::shader::{Closure, Point, Program, RayInfo};

/// The light of a program: where the ray that arrives has a direction, what leaves against it.
pub fn glow_of(emission: &Program, point: &Point, images: &[Arc<Image>]) -> Vec3A {
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

/// How a material shines.
pub enum Glow {
    Dark,
    /// The same everywhere.
    Uniform(Vec3A),
    /// As its nodes compute.
    Nodes(Program),
}

impl Glow {
    /// Whether both shine alike; of nodes this is not known.
    pub fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Dark, Self::Dark) => true,
            (Self::Uniform(radiance), Self::Uniform(other)) => radiance == other,
            _ => false,
        }
    }

    pub fn of(material: &Material) -> Self {
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
pub struct Shading {
    images: Vec<Arc<Image>>,
    camera: Camera,
    instance: Instance,
    mesh: Arc<Mesh>,
}

impl Shading {
    pub fn of(frame: &SceneFrame, instance: u32) -> Self {
        let placed = &frame.instances[instance as usize];
        Self {
            images: frame.images.clone(),
            camera: frame.camera,
            instance: placed.clone(),
            mesh: frame.meshes[placed.mesh as usize].clone(),
        }
    }

    /// Corners of a triangle, world space.
    pub fn corners_at(&self, triangle: u32, time: f32) -> [Vec3A; 3] {
        let placement = self.instance.placement_at(time);
        let corners = self.mesh.corners_at(triangle, time);
        corners.map(|corner| placement.world_from_object.transform_point3a(corner))
    }

    pub fn radiance(&self, nodes: &Program, spot: Spot, direction: Vec3A) -> Vec3A {
        let Spot { triangle, at, time } = spot;
        let facet = scene::Facet::of(&self.camera, &self.instance, &self.mesh, triangle, time);
        let ray = RayInfo::default();
        let point = facet.point(at, direction, direction.length(), &ray);
        glow_of(nodes, &point, &self.images)
    }
}

/// A point of a triangle at a time.
#[derive(Clone, Copy)]
pub struct Spot {
    pub triangle: u32,
    /// Barycentric coordinates.
    pub at: Vec2,
    pub time: f32,
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

/// Power of each triangle to these sides, never zero: nodes may make any point of it shine.
pub fn powers(
    facets: &[Facet],
    glows: &[Glow],
    shading: Option<&Shading>,
    sides: Sides,
) -> Vec<f32> {
    let strength = |radiance: Vec3A| luminance(radiance.abs());
    let probed = |facet: &Facet, nodes: &Program, shading: &Shading| {
        let direction = -facet.area_normal();
        let spot = |at: Vec2| Spot {
            triangle: facet.triangle,
            at,
            time: MIDDLE_TIME,
        };
        let at = |probe: Vec2| strength(shading.radiance(nodes, spot(probe), direction));
        PROBES.map(at).iter().sum::<f32>() / PROBES.len() as f32
    };
    let radiances: Vec<f32> = facets
        .iter()
        .map(|facet| match (&glows[facet.glow as usize], shading) {
            (Glow::Nodes(nodes), Some(shading)) => probed(facet, nodes, shading),
            (Glow::Uniform(radiance), _) => strength(*radiance),
            _ => 0.0,
        })
        .collect();
    let mean = radiances.iter().sum::<f32>() / radiances.len().max(1) as f32;
    let least = if mean > 0.0 {
        LEAST_RADIANCE * mean
    } else {
        1.0
    };
    let per_area = if sides == Sides::Both { TAU } else { PI };
    let power = |(facet, radiance): (&Facet, &f32)| {
        let radiance = match glows[facet.glow as usize] {
            Glow::Nodes(_) => radiance.max(least),
            _ => *radiance,
        };
        let power = per_area * radiance * facet.area_normal().length();
        if power.is_finite() { power } else { 0.0 }
    };
    facets.iter().zip(&radiances).map(power).collect()
}
