//! To which sides a glowing mesh shines on others: of a closed one whose faces all glow, nobody outside sees
//! the inner ones, and half of all light samples would end there.
//!
//! Rays that do meet a side which is not sampled count in full, so that the picture is right either way.

use std::collections::HashMap;

use glam::Vec3A;

use super::facet::Facet;
use crate::scene::{Mesh, SceneFrame, Visibility};

/// To which sides of their triangles a mesh shines on others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    Both,
    /// Where the normal points to.
    Front,
    Back,
}

/// Meshes of more triangles are taken to be open, which costs no time.
const TRIANGLES_MAX: usize = 1 << 17;

/// Whether nobody may see one of the sides of an instance, if it is closed and glows all over: none of it is
/// see-through, no kind of ray passes it, and the camera is not inside.
pub fn may_hide_a_side(frame: &SceneFrame, instance: u32) -> bool {
    let placed = &frame.instances[instance as usize];
    let mut materials = placed.materials.iter();
    let eye = frame.camera.position();
    let holds_camera = |(low, high): (Vec3A, Vec3A)| eye.cmpge(low).all() && eye.cmple(high).all();
    placed.visibility == Visibility::ALL
        && !materials.any(|&material| frame.materials[material as usize].is_see_through())
        && !frame.bounds_of(instance).is_some_and(holds_camera)
}

/// The sides that others see of such an instance whose glowing triangles are these.
pub fn sides_of(mesh: &Mesh, facets: &[Facet]) -> Sides {
    if facets.len() < mesh.triangles.len() || facets.len() > TRIANGLES_MAX || !is_closed(mesh) {
        return Sides::Both;
    }
    match volume(facets) {
        volume if volume > 0.0 => Sides::Front,
        volume if volume < 0.0 => Sides::Back,
        _ => Sides::Both,
    }
}

/// Volume within, below zero where normals point inwards.
fn volume(facets: &[Facet]) -> f64 {
    let Some(origin) = facets.first().map(|facet| facet.corners[0]) else {
        return 0.0;
    };
    let of_one = |facet: &Facet| {
        let [a, b, c] = facet.corners.map(|corner| (corner - origin).as_dvec3());
        a.dot(b.cross(c))
    };
    facets.iter().map(of_one).sum()
}

/// Whether each edge has one triangle on either side, which go round it in opposite directions. Vertices at
/// one place are one.
fn is_closed(mesh: &Mesh) -> bool {
    let mut places = HashMap::new();
    let place_of: Vec<u32> = mesh
        .vertices
        .iter()
        .map(|vertex| {
            let next = places.len() as u32;
            let bits = (*vertex + 0.0).to_array().map(f32::to_bits);
            *places.entry(bits).or_insert(next)
        })
        .collect();
    let mut edges: Vec<(u32, u32)> = Vec::with_capacity(3 * mesh.triangles.len());
    for triangle in mesh.triangles.iter() {
        let [a, b, c] = triangle.map(|vertex| place_of[vertex as usize]);
        edges.extend([(a, b), (b, c), (c, a)]);
    }
    edges.sort_unstable();
    let is_once = edges.windows(2).all(|pair| pair[0] != pair[1]);
    let has_twin = |&(from, to): &(u32, u32)| edges.binary_search(&(to, from)).is_ok();
    is_once && edges.iter().all(has_twin)
}
