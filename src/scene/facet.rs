//! A triangle of an instance, and its points as programs see them.

use std::borrow::Cow;

use glam::{Vec2, Vec3A, Vec4};

use super::{Camera, Instance, Mesh, Placement, SceneFrame, interpolate};
use crate::shader::{Attributes, FILTER_WIDTH, Point, RayInfo};

/// A triangle of an instance at one time.
#[derive(Clone)]
pub struct Facet<'a> {
    camera: &'a Camera,
    instance: &'a Instance,
    number: Option<u32>,
    placement: Cow<'a, Placement>,
    mesh: &'a Mesh,
    triangle: u32,
    time: f32,
}

impl Attributes for Facet<'_> {
    fn corners(&self, key: u32) -> Option<[Vec4; 3]> {
        if key == 0 {
            let uvs = self.mesh.faces[self.triangle as usize].uvs;
            return Some(uvs.map(|uv| uv.extend(0.0).extend(1.0)));
        }
        let layer = self.mesh.layers.iter().find(|(known, _)| *known == key);
        layer.map(|(_, values)| values[self.triangle as usize])
    }
}

impl<'a> Facet<'a> {
    /// The triangle of this number at a share of the shutter's time.
    pub fn new(frame: &'a SceneFrame, instance: u32, triangle: u32, time: f32) -> Self {
        let placed = &frame.instances[instance as usize];
        let (camera, mesh) = (&frame.camera, frame.mesh_of(instance));
        Self {
            number: Some(instance),
            ..Self::of(camera, placed, mesh, triangle, time)
        }
    }

    /// The triangle of this number of an instance that shows `mesh`.
    pub fn of(
        camera: &'a Camera,
        instance: &'a Instance,
        mesh: &'a Mesh,
        triangle: u32,
        time: f32,
    ) -> Self {
        Self {
            camera,
            instance,
            number: None,
            placement: instance.placement_at(time),
            mesh,
            triangle,
            time,
        }
    }

    /// A point of the triangle, seen along a ray of this direction (of any length) that is
    /// `ray_length` [m] long.
    pub fn point(
        &'a self,
        barycentric: Vec2,
        direction: Vec3A,
        ray_length: f32,
        ray: &'a RayInfo<'a>,
    ) -> Point<'a> {
        let placement = &*self.placement;
        let corners = self.mesh.corners_at(self.triangle, self.time);
        let edges_object = [corners[1] - corners[0], corners[2] - corners[0]];
        let incoming = -direction.normalize();
        let front = placement.world_from_normal * edges_object[0].cross(edges_object[1]);
        let front = front.try_normalize().unwrap_or(incoming);
        let is_back = front.dot(incoming) < 0.0;
        let geometric_normal = if is_back { -front } else { front };
        let corner_normals = self.mesh.corner_normals_at(self.triangle, &corners);
        let normal_object = interpolate(&corner_normals, barycentric);
        let shading = placement.world_from_normal * normal_object;
        let shading = shading.try_normalize().unwrap_or(geometric_normal);
        Point {
            // From the corners, not along the ray: the error then does not grow with the distance.
            position: placement
                .world_from_object
                .transform_point3a(interpolate(&corners, barycentric)),
            normal: if shading.dot(geometric_normal) < 0.0 {
                -shading
            } else {
                shading
            },
            geometric_normal,
            normal_object,
            incoming,
            barycentric,
            edges: edges_object.map(|e| placement.world_from_object.transform_vector3a(e)),
            is_back,
            ray_length,
            filter_width: FILTER_WIDTH,
            world_from_object: &placement.world_from_object,
            object_from_world: &placement.object_from_world,
            object: &self.instance.info,
            instance: self.number,
            attributes: self,
            view: self.camera,
            ray,
        }
    }
}
