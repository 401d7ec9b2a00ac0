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

    /// How far a point of the triangle lies below the smooth surface of which it is a part, as a vector of
    /// world space [m] towards `side`. Rays to lights that start there do not meet the triangle's
    /// neighbours where the smooth surface would not: flat faces would show in the shadow's edge.
    ///
    /// The surface is the quadric over the triangle that has the corners' normals, at least half of it and
    /// at least what the corners' tangent planes allow: Cycles lifts points so (kernel/light/sample.h).
    /// The planes alone are Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021.
    pub fn lift(&self, barycentric: Vec2, side: Vec3A) -> Vec3A {
        let placement = &*self.placement;
        let corners = self.mesh.corners_at(self.triangle, self.time);
        let mut normals = self.mesh.corner_normals_at(self.triangle, &corners);
        let mut normal = interpolate(&normals, barycentric);
        if (placement.world_from_normal * normal).dot(side) <= 0.0 {
            (normals, normal) = (normals.map(|n| -n), -normal);
        }
        let point = interpolate(&corners, barycentric);
        let weights = [
            1.0 - barycentric.x - barycentric.y,
            barycentric.x,
            barycentric.y,
        ];
        let (mut quadric, mut planes) = (0.0, f32::INFINITY);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let bend = (normals[j] - normals[i]).dot(corners[j] - corners[i]);
            quadric += weights[i] * weights[j] * bend;
            // The plane through the corner, moved up until no other corner lies above it.
            let highest = [j, k].map(|other| (corners[other] - corners[i]).dot(normals[i]));
            let plane = highest[0].max(highest[1]).max(0.0);
            planes = planes.min((plane + (corners[i] - point).dot(normals[i])).max(0.0));
        }
        let height = planes.max(0.5 * quadric);
        placement
            .world_from_object
            .transform_vector3a(height * normal)
    }

    /// Unit normal of the triangle's front, world space, unless it has no area.
    pub fn front(&self) -> Option<Vec3A> {
        self.front_of(&self.mesh.corners_at(self.triangle, self.time))
    }

    fn front_of(&self, [a, b, c]: &[Vec3A; 3]) -> Option<Vec3A> {
        let normal = (*b - *a).cross(*c - *a);
        (self.placement.world_from_normal * normal).try_normalize()
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
        let front = self.front_of(&corners).unwrap_or(incoming);
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
            // As Cycles has it: a normal that lies below the face stays there.
            normal: if is_back { -shading } else { shading },
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

#[cfg(test)]
mod tests {
    use glam::Affine3A;

    use super::*;
    use crate::testing::{Scene, diffuse, smooth, sphere, square};

    /// Points of every triangle of a mesh: position, geometric normal, and how far they are lifted.
    fn lifted(mesh: Mesh, side: f32) -> Vec<(Vec3A, Vec3A)> {
        let mut scene = Scene::new();
        scene.add(mesh, Affine3A::IDENTITY, diffuse(0.5));
        let frame = scene.frame(0);
        let triangles = 0..frame.meshes[0].triangles.len() as u32;
        let points = [
            (0.33, 0.33),
            (0.1, 0.2),
            (0.7, 0.2),
            (0.0, 0.5),
            (0.05, 0.9),
        ];
        let at = |(triangle, (u, v)): (u32, (f32, f32))| {
            let facet = Facet::new(&frame, 0, triangle, 0.5);
            let [a, b, c] = facet.mesh.corners_at(triangle, 0.5);
            let barycentric = Vec2::new(u, v);
            let normal = (b - a).cross(c - a).normalize();
            (
                interpolate(&[a, b, c], barycentric),
                facet.lift(barycentric, side * normal),
            )
        };
        let all = triangles.flat_map(|triangle| points.map(|point| (triangle, point)));
        all.map(at).collect()
    }

    /// Over a ball's triangle sum w_i w_j |V_i - V_j|^2 = 1 - |P|^2, twice the height of the ball.
    #[test]
    fn a_point_of_a_ball_is_lifted_at_least_to_it_and_at_most_as_far_again() {
        for (point, lift) in lifted(smooth(sphere(6)), 1.0) {
            let twice = point.length() * (1.0 - point.length_squared());
            let height = lift.dot(point.normalize());
            assert!((height - lift.length()).abs() < 1e-5, "{lift} at {point}");
            assert!(
                height > 0.5 * twice - 1e-5 && height < twice + 1e-5,
                "{height} of {twice}"
            );
        }
    }

    #[test]
    fn flat_faces_are_not_lifted() {
        for side in [1.0, -1.0] {
            let all = lifted(square(), side)
                .into_iter()
                .chain(lifted(sphere(6), side));
            for (point, lift) in all {
                assert!(lift.length() < 1e-6, "{lift} at {point}");
            }
        }
    }
}
