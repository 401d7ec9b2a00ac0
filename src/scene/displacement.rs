//! Vertices moved by the displacement of their materials.
//!
//! As in Cycles (scene/mesh_displace.cpp): whatever vertices there are move, however coarse the mesh;
//! each by the material of the first triangle that has it, seen from above. A mesh that several objects
//! show with the same materials moves as that of the first of them.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use glam::{Vec2, Vec3, Vec3A};
use rayon::prelude::*;

use super::{Displacement, Facet, Instance, Material, Mesh, SceneFrame};
use crate::math::MIDDLE_TIME;
use crate::shader::RayInfo;

/// Where a vertex is found: a triangle and which of its corners.
type Corner = (u32, usize);

/// Puts displaced meshes in the place of those whose materials displace them.
pub fn displace(frame: &mut SceneFrame) {
    if frame.materials.iter().all(|m| m.displacement.is_none()) {
        return;
    }
    let mut meshes: Vec<Arc<Mesh>> = Vec::new();
    let mut numbers = HashMap::new();
    let mut shown = Vec::with_capacity(frame.instances.len());
    for instance in &frame.instances {
        let mesh = &frame.meshes[instance.mesh as usize];
        let is_displaced = mesh.flat().is_some() && is_displacing(frame, instance);
        let materials = is_displaced.then_some(&instance.materials);
        let number = *numbers
            .entry((instance.mesh, materials))
            .or_insert(meshes.len());
        if number == meshes.len() {
            let made = is_displaced.then(|| displaced(frame, instance, mesh));
            meshes.push(made.unwrap_or_else(|| mesh.clone()));
        }
        shown.push(number);
    }
    carry_flow(frame, &shown, &meshes);
    for (instance, number) in frame.instances.iter_mut().zip(shown) {
        instance.mesh = number as u32;
    }
    frame.meshes = meshes;
}

fn is_displacing(frame: &SceneFrame, instance: &Instance) -> bool {
    let displaces = |&m: &u32| frame.materials[m as usize].displacement.is_some();
    instance.materials.iter().any(displaces)
}

/// Moves what the pass Vector knows of other frames: a form there is displaced as it is here.
fn carry_flow(frame: &mut SceneFrame, shown: &[usize], meshes: &[Arc<Mesh>]) {
    let Some(flow) = &mut frame.passes.flow else {
        return;
    };
    let mut carried = HashSet::new();
    for ((instance, &number), moved) in frame.instances.iter().zip(shown).zip(&flow.moved) {
        let first = moved.and_then(|moved| moved.first_vertex);
        let Some(first) = first.filter(|&first| carried.insert(first)) else {
            continue;
        };
        let before = &frame.meshes[instance.mesh as usize].vertices;
        let after = &meshes[number].vertices;
        for (vertex, (before, after)) in before.iter().zip(after.iter()).enumerate() {
            for side in &mut flow.vertices {
                side[first + vertex] += after - before;
            }
        }
    }
}

fn displaced(frame: &SceneFrame, instance: &Instance, mesh: &Mesh) -> Arc<Mesh> {
    let offsets: Vec<Vec3> = first_corners(frame, instance, mesh)
        .par_iter()
        .map(|corner| corner.map_or(Vec3::ZERO, |corner| offset(frame, instance, mesh, corner)))
        .collect();
    let mut materials = instance
        .materials
        .iter()
        .map(|&m| &frame.materials[m as usize]);
    let is_bumped = |m: &Material| m.displacement.as_ref().is_some_and(|d| d.keeps_normals);
    let is_bumped = materials.any(is_bumped);
    mesh.displaced(&offsets, is_bumped, |moved| {
        corner_normals(frame, instance, mesh, moved)
    })
}

/// Normals at the corners of the triangles once their vertices are `moved`.
fn corner_normals(
    frame: &SceneFrame,
    instance: &Instance,
    mesh: &Mesh,
    moved: &[Vec3],
) -> Vec<[Vec3; 3]> {
    let (before, after) = (
        vertex_normals(mesh, &mesh.vertices),
        vertex_normals(mesh, moved),
    );
    let flat = mesh.flat();
    let normals = |(triangle, vertices): (usize, &[u32; 3])| {
        let own = mesh.faces[triangle].normals;
        if displacement(frame, instance, mesh, triangle).is_some_and(|d| d.keeps_normals) {
            return own;
        }
        if flat.as_ref().is_some_and(|is_flat| is_flat(triangle)) {
            return [face_normal(moved, *vertices); 3];
        }
        // Sharp edges stay sharp: what changes is added to what there was.
        std::array::from_fn(|corner| {
            let vertex = vertices[corner] as usize;
            (own[corner] + after[vertex] - before[vertex]).normalize_or(own[corner])
        })
    };
    mesh.triangles.iter().enumerate().map(normals).collect()
}

/// For each vertex that is displaced where it is found first.
fn first_corners(frame: &SceneFrame, instance: &Instance, mesh: &Mesh) -> Vec<Option<Corner>> {
    let mut found = vec![None; mesh.vertices.len()];
    for (triangle, vertices) in mesh.triangles.iter().enumerate() {
        if displacement(frame, instance, mesh, triangle).is_some() {
            for (corner, &vertex) in vertices.iter().enumerate() {
                found[vertex as usize].get_or_insert((triangle as u32, corner));
            }
        }
    }
    found
}

fn displacement<'a>(
    frame: &'a SceneFrame,
    instance: &Instance,
    mesh: &Mesh,
    triangle: usize,
) -> Option<&'a Displacement> {
    let material = instance.material_of_slot(mesh.faces[triangle].slot)?;
    frame.materials[material as usize].displacement.as_ref()
}

/// Where a vertex goes, object space [m]; nowhere if that is not finite.
fn offset(
    frame: &SceneFrame,
    instance: &Instance,
    mesh: &Mesh,
    (triangle, corner): Corner,
) -> Vec3 {
    let Some(displacement) = displacement(frame, instance, mesh, triangle as usize) else {
        return Vec3::ZERO;
    };
    let placement = &instance.placement;
    let normal = mesh.faces[triangle as usize].normals[corner];
    let down = -(placement.world_from_normal * Vec3A::from(normal));
    let barycentric = [Vec2::ZERO, Vec2::X, Vec2::Y][corner];
    let facet = Facet::of(&frame.camera, instance, mesh, triangle, MIDDLE_TIME);
    let info = RayInfo::default();
    let point = facet.point(barycentric, down, 0.0, &info);
    let offset = displacement.offset(&point, &frame.images);
    let offset = placement.object_from_world.transform_vector3a(offset);
    if offset.is_finite() {
        offset.into()
    } else {
        Vec3::ZERO
    }
}

/// Unit normals of vertices: of the sum of those of their triangles.
fn vertex_normals(mesh: &Mesh, vertices: &[Vec3]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; vertices.len()];
    for &triangle in mesh.triangles.iter() {
        let normal = face_normal(vertices, triangle);
        for vertex in triangle {
            sums[vertex as usize] += normal;
        }
    }
    sums.iter().map(|sum| sum.normalize_or_zero()).collect()
}

fn face_normal(vertices: &[Vec3], triangle: [u32; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(|v| vertices[v as usize]);
    (b - a).cross(c - a).normalize_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;
    use crate::testing::{Scene, mesh};
    use glam::{Affine3A, Vec3};

    /// Two triangles that share an edge along X.
    const VERTICES: [Vec3; 4] = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::new(0.0, 1.0, 0.0),
        Vec3::new(0.0, -1.0, 0.0),
    ];
    const TRIANGLES: [[u32; 3]; 2] = [[0, 1, 2], [0, 3, 1]];

    /// They move by (1, 1, 1) in world space, at twice their size.
    fn moved_by_one(mesh: Mesh) -> SceneFrame {
        let mut scene = Scene::new();
        let material = Material::of(&[("displaced", &[("Displacement", 1.0)])]);
        scene.add(mesh, Affine3A::from_scale(Vec3::splat(2.0)), material);
        let mut frame = (*scene.frame(1)).clone();
        displace(&mut frame);
        frame
    }

    #[test]
    fn vertices_go_where_the_program_says() {
        let frame = moved_by_one(mesh(&VERTICES, &TRIANGLES).all_flat(true));
        let expected = VERTICES.map(|vertex| vertex + 0.5);
        assert_eq!(*frame.meshes[0].vertices, expected);
        let strands = moved_by_one(mesh(&VERTICES, &TRIANGLES));
        assert_eq!(*strands.meshes[0].vertices, VERTICES);
    }

    #[test]
    fn what_is_there_already_is_shared() {
        let mut frame = moved_by_one(mesh(&VERTICES, &TRIANGLES).all_flat(true));
        let offsets = [Vec3::Z, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO];
        let base = frame.meshes[0].clone();
        let moved = |offsets: &[Vec3]| base.displaced(offsets, false, |_| vec![[Vec3::Z; 3]; 2]);
        let (first, again, other) = (moved(&offsets), moved(&offsets), moved(&[Vec3::Z; 4]));
        assert!(Arc::ptr_eq(&first, &again));
        assert!(!Arc::ptr_eq(&first, &other));
        frame.instances.push(frame.instances[0].clone());
        displace(&mut frame);
        assert_eq!(frame.meshes.len(), 1);
    }

    #[test]
    fn normals_follow_the_new_form() {
        let normals = |is_flat: bool| {
            let base = mesh(&VERTICES, &TRIANGLES).all_flat(is_flat);
            let mut frame = moved_by_one(base);
            // The far corners come up: a valley along X, each side at 45 degrees.
            let lifted = [0.0, 0.0, 1.0, 1.0].map(|lift| Vec3::Z * lift);
            let base = frame.meshes.remove(0);
            let moved: Vec<Vec3> = (0..4).map(|i| base.vertices[i] + lifted[i]).collect();
            corner_normals(&frame, &frame.instances[0], &base, &moved)
        };
        let [left, right] = [-1.0, 1.0].map(|y: f32| Vec3::new(0.0, y, 1.0).normalize());
        let near = |a: Vec3, b: Vec3| assert!(a.distance(b) < 1e-6, "{a} {b}");
        for (found, expected) in normals(true).into_iter().zip([left, right]) {
            found.iter().for_each(|&normal| near(normal, expected));
        }
        let smooth = normals(false);
        let expected = [[Vec3::Z, Vec3::Z, left], [Vec3::Z, right, Vec3::Z]];
        for (found, expected) in smooth.iter().flatten().zip(expected.iter().flatten()) {
            near(*found, *expected);
        }
    }
}
