//! Glowing triangles in world space, and how likely a point of one is drawn.

use glam::{Vec2, Vec3A};

use super::glow::Glow;
use crate::math::warp::sample_triangle;
use crate::sampling::lights::triangle::SphericalTriangle;
use crate::scene::SceneFrame;

#[derive(Debug, Clone)]
pub struct Facet {
    pub triangle: u32,
    pub corners: [Vec3A; 3],
    /// Index into the glows of the instance's material slots.
    pub glow: u32,
}

impl Facet {
    /// Those of an instance.
    pub fn all(frame: &SceneFrame, instance: u32, glows: &[Glow]) -> Vec<Self> {
        let placed = &frame.instances[instance as usize];
        let mesh = frame.mesh_of(instance);
        let slots = mesh.faces.iter().map(|face| face.slot).enumerate();
        slots
            .map(|(triangle, slot)| (triangle as u32, (slot as usize).min(glows.len() - 1)))
            .filter(|&(_, slot)| !matches!(glows[slot], Glow::Dark))
            .map(|(triangle, slot)| Self {
                triangle,
                corners: mesh
                    .corners(triangle)
                    .map(|corner| placed.placement.world_from_object.transform_point3a(corner)),
                glow: slot as u32,
            })
            .collect()
    }

    /// Normal with the area as its length.
    pub fn area_normal(&self) -> Vec3A {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a)
    }

    pub fn normal(&self) -> Vec3A {
        self.area_normal().normalize_or_zero()
    }

    /// Barycentric coordinates of a point to send a ray to from `from`.
    pub fn sample(&self, from: Vec3A, u: [f32; 2]) -> Vec2 {
        match self.seen_large(from) {
            Some(seen) => seen.sample(u),
            None => sample_triangle(u),
        }
    }

    /// Density [1/sr] with which [`Facet::sample`] finds its point at `offset` from there.
    pub fn pdf(&self, from: Vec3A, offset: Vec3A) -> f32 {
        if let Some(seen) = self.seen_large(from) {
            return seen.solid_angle.recip();
        }
        let distance_squared = offset.length_squared();
        let cos_times_area = offset.dot(self.area_normal()).abs() / distance_squared.sqrt();
        distance_squared / cos_times_area
    }

    /// Where it is so large that directions to it are worth drawing evenly, and not its points.
    fn seen_large(&self, from: Vec3A) -> Option<SphericalTriangle> {
        SphericalTriangle::large(self.corners.map(|corner| corner - from))
    }
}
