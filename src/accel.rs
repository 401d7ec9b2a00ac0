//! What a ray meets in a frame: a tree over instances above one tree for each mesh.
//!
//! Rays go to object space without being normalised, so that `t` means the same everywhere. Hits
//! are those of a loop over all instances and triangles: of equal ones that of the smallest
//! instance, then the smallest triangle, counts.

use std::collections::HashMap;

use glam::Vec3A;
use rayon::prelude::*;

use crate::kernel::{InstanceBvh, TriangleBvh, TriangleHit};
use crate::math::Ray;
use crate::scene::{Mesh, SceneFrame};

/// Where a ray meets the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// The ray's parameter, in units of its direction.
    pub t: f32,
    /// Index into [`SceneFrame::instances`].
    pub instance: u32,
    /// Triangle of the instance's mesh.
    pub triangle: u32,
    /// Barycentric coordinate of the triangle's second vertex.
    pub u: f32,
    /// Barycentric coordinate of the triangle's third vertex.
    pub v: f32,
}

impl Hit {
    fn new(instance: u32, hit: &TriangleHit) -> Self {
        Self {
            t: hit.t,
            instance,
            triangle: hit.triangle,
            u: hit.u,
            v: hit.v,
        }
    }
}

/// The tree over the instances of one frame. Its methods want that same frame.
#[derive(Debug, Clone)]
pub struct Accel {
    instances: InstanceBvh,
}

impl Accel {
    /// Builds what is missing: the trees of the frame's meshes, then the one over its instances.
    /// Meshes that have only been deformed since the frame `before` take over its trees.
    pub fn build(frame: &SceneFrame, before: Option<&SceneFrame>) -> Self {
        let earlier = before.map_or_else(|| vec![None; frame.meshes.len()], |b| earlier(frame, b));
        let meshes = frame.meshes.par_iter().zip(earlier);
        meshes.for_each(|(mesh, earlier)| {
            mesh.bvhs_after(earlier);
        });
        let boxes: Vec<_> = (0..frame.instances.len() as u32)
            .map(|index| {
                let nowhere = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
                frame.bounds_of(index).unwrap_or(nowhere)
            })
            .collect();
        Self {
            instances: InstanceBvh::build(&boxes),
        }
    }

    /// Corners of the box around the scene, world space; `None` without geometry.
    pub fn bounds(&self) -> Option<(Vec3A, Vec3A)> {
        self.instances.bounds()
    }

    /// The first hit in `[t_min, t_max]`.
    pub fn closest_hit(&self, frame: &SceneFrame, ray: &Ray) -> Option<Hit> {
        self.closest_hit_where(frame, ray, |_| true)
    }

    /// The first hit that `accept` accepts. It is asked in no particular order, and not about every
    /// hit: it must depend on the hit only.
    pub fn closest_hit_where(
        &self,
        frame: &SceneFrame,
        ray: &Ray,
        mut accept: impl FnMut(&Hit) -> bool,
    ) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        self.instances.closest(ray, |index, t_max| {
            let (bvh, ray) = on_instance(frame, index, ray, t_max);
            let hit = bvh.closest_hit_where(&ray, |hit| accept(&Hit::new(index, hit)))?;
            if best.is_some_and(|best| (best.t, best.instance) < (hit.t, index)) {
                return None;
            }
            best = Some(Hit::new(index, &hit));
            Some(hit.t)
        });
        best
    }

    /// Where a ray crosses the surface of one instance, however far away, in rising order.
    pub fn crossings(&self, frame: &SceneFrame, ray: &Ray, instance: u32) -> Vec<f32> {
        let ray = Ray {
            t_max: f32::INFINITY,
            ..*ray
        };
        let hits = self.hits_of(frame, &ray, instance);
        let mut crossings: Vec<f32> = hits.iter().map(|hit| hit.t).collect();
        // An edge may be met by both of its triangles.
        crossings.dedup_by(|a, b| (*a - *b).abs() <= 1e-6 * b.abs());
        crossings
    }

    /// All hits in `[t_min, t_max]` of one instance, in the order of their distances.
    pub fn hits_of(&self, frame: &SceneFrame, ray: &Ray, instance: u32) -> Vec<Hit> {
        let (bvh, ray) = on_instance(frame, instance, ray, ray.t_max);
        let mut hits = Vec::new();
        bvh.occluded_where(&ray, |hit| {
            hits.push(Hit::new(instance, hit));
            false
        });
        hits.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        hits
    }

    /// The first hit in `[t_min, t_max]` of one instance.
    pub fn closest_hit_of(&self, frame: &SceneFrame, ray: &Ray, instance: u32) -> Option<Hit> {
        let (bvh, ray) = on_instance(frame, instance, ray, ray.t_max);
        Some(Hit::new(instance, &bvh.closest_hit(&ray)?))
    }

    /// Whether anything is hit in `[t_min, t_max]`.
    pub fn occluded(&self, frame: &SceneFrame, ray: &Ray) -> bool {
        self.occluded_where(frame, ray, |_| true)
    }

    /// Whether anything is hit that `accept` accepts, which must depend on the hit only.
    pub fn occluded_where(
        &self,
        frame: &SceneFrame,
        ray: &Ray,
        mut accept: impl FnMut(&Hit) -> bool,
    ) -> bool {
        self.instances.any(ray, |index| {
            let (bvh, ray) = on_instance(frame, index, ray, ray.t_max);
            bvh.occluded_where(&ray, |hit| accept(&Hit::new(index, hit)))
        })
    }
}

/// For each mesh of `frame` the one that the same instance had in the frame `before`.
fn earlier<'a>(frame: &SceneFrame, before: &'a SceneFrame) -> Vec<Option<&'a Mesh>> {
    let named = before.instances.iter().map(|i| (i.key, i.mesh));
    let mesh_of_key: HashMap<u64, u32> = named.collect();
    let mut earlier = vec![None; frame.meshes.len()];
    for instance in &frame.instances {
        let mesh = mesh_of_key.get(&instance.key);
        earlier[instance.mesh as usize] = mesh.map(|&m| &*before.meshes[m as usize]);
    }
    earlier
}

/// The tree that a ray meets at an instance, and the ray as that tree wants it.
fn on_instance<'a>(
    frame: &'a SceneFrame,
    index: u32,
    ray: &Ray,
    t_max: f32,
) -> (&'a TriangleBvh, Ray) {
    let (bvh, time) = frame.mesh_of(index).bvh_at(ray.time);
    let placement = frame.instances[index as usize].placement_at(ray.time);
    let object_from_world = &placement.object_from_world;
    let ray = Ray {
        origin: object_from_world.transform_point3a(ray.origin),
        direction: object_from_world.transform_vector3a(ray.direction),
        t_min: ray.t_min,
        t_max,
        time,
    };
    (bvh, ray)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::{Given, Numbers};
    use crate::kernel::Positions;
    use crate::math::statistics::Random;
    use crate::scene::{
        ForPasses, Instance, Placement, Reach, Shutter, Trajectory, Visibility, World,
    };
    use glam::{Affine3A, EulerRot, Mat3A, Quat, Vec3};
    use std::sync::Arc;

    fn point(random: &mut Random) -> Vec3 {
        Vec3::from([(); 3].map(|()| 2.0 * random.next() - 1.0))
    }

    /// `count` triangles in the cube of half edge 1, or nothing.
    fn soup(count: usize, random: &mut Random) -> Arc<Mesh> {
        let vertices: Vec<f32> = (0..count)
            .flat_map(|_| {
                let centre = point(random);
                [(); 3].map(|()| (centre + 0.3 * point(random)).to_array())
            })
            .flatten()
            .collect();
        Arc::new(mesh_of(&vertices))
    }

    /// A triangle of each three vertices.
    fn mesh_of(vertices: &[f32]) -> Mesh {
        let count = vertices.len() / 9;
        let triangles: Vec<u32> = (0..3 * count as u32).collect();
        let (normals, uvs) = (vec![0.0; 9 * count], vec![0.0; 6 * count]);
        let slots = vec![0; count];
        let given = |name: &str, shape: &[usize], numbers| Given {
            name: name.into(),
            shape: shape.into(),
            numbers,
        };
        let arrays = vec![
            given("vertices", &[3 * count, 3], Numbers::F32(vertices)),
            given("triangles", &[count, 3], Numbers::U32(&triangles)),
            given("corner_normals", &[count, 3, 3], Numbers::F32(&normals)),
            given("corner_uvs", &[count, 3, 2], Numbers::F32(&uvs)),
            given("layer_keys", &[0], Numbers::U32(&[])),
            given("layer_values", &[0, count, 3, 4], Numbers::F32(&[])),
            given("material_slots", &[count], Numbers::U32(&slots)),
        ];
        Mesh::new(arrays).unwrap()
    }

    fn instance(mesh: u32, world_from_object: Affine3A) -> Instance {
        Instance {
            mesh,
            key: 0,
            placement: Placement::new(world_from_object),
            motion: None,
            info: crate::shader::ObjectInfo::default(),
            materials: vec![],
            visibility: Visibility::ALL,
            lift_cosine: 0.0,
            is_holdout: false,
            is_catcher: false,
            membership: crate::scene::Membership::ALL,
            links: crate::scene::Links::default(),
        }
    }

    /// Turned, stretched and (every third) mirrored instances of two meshes and an empty one.
    fn frame(random: &mut Random) -> SceneFrame {
        let meshes = vec![soup(60, random), soup(0, random), soup(7, random)];
        let instances = (0..40).map(|i| {
            let turn = point(random) * 3.0;
            let mut scale = Vec3::splat(0.7) + 0.4 * point(random);
            if i % 3 == 0 {
                scale.x *= -1.0;
            }
            let turn = Quat::from_euler(EulerRot::XYZ, turn.x, turn.y, turn.z);
            let at = point(random) * 5.0;
            instance(
                i % 3,
                Affine3A::from_scale_rotation_translation(scale, turn, at),
            )
        });
        SceneFrame {
            frame: 1,
            instances: instances.collect(),
            meshes,
            materials: vec![],
            images: vec![],
            lights: vec![],
            camera: crate::testing::camera(Vec3::ZERO, Vec3::Y, 1.0),
            shutter: Shutter::default(),
            medium: None,
            passes: ForPasses::default(),
            world: World {
                radiance: Vec3A::ZERO,
                image: None,
                camera_image: None,
                environment_from_world: Mat3A::IDENTITY,
                reach: Reach::ALL,
            },
        }
    }

    /// All triangles of the frame in world space, and the instance and triangle of each.
    fn flattened(frame: &SceneFrame) -> (TriangleBvh, Vec<(u32, u32)>) {
        let (mut positions, mut names) = (vec![], vec![]);
        for (index, instance) in (0u32..).zip(&frame.instances) {
            let mesh = frame.mesh_of(index);
            for triangle in 0..mesh.triangles.len() as u32 {
                let place =
                    |p| Vec3::from(instance.placement.world_from_object.transform_point3a(p));
                positions.extend(mesh.corners(triangle).map(place));
                names.push((index, triangle));
            }
        }
        let triangles: Vec<_> = (0..names.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
        (
            TriangleBvh::build(Positions::still(&positions), &triangles),
            names,
        )
    }

    #[test]
    fn instances_are_hit_like_their_triangles_in_world_space() {
        let mut random = Random::new(1);
        let frame = frame(&mut random);
        let accel = Accel::build(&frame, None);
        let (flat, names) = flattened(&frame);
        let mut hits = 0;
        for i in 0..4000 {
            let origin = point(&mut random) * 7.0;
            let target = point(&mut random) * 4.0;
            let t_max = if i % 4 == 0 { 0.5 } else { f32::INFINITY };
            let ray = Ray::segment(origin.into(), (target - origin).into(), t_max);
            let hit = accel.closest_hit(&frame, &ray);
            let expected = flat.closest_hit(&ray);
            assert_eq!(hit.is_some(), expected.is_some());
            assert_eq!(accel.occluded(&frame, &ray), expected.is_some());
            if let (Some(hit), Some(expected)) = (hit, expected) {
                let name = names[expected.triangle as usize];
                assert_eq!((hit.instance, hit.triangle), name);
                let off = (hit.t - expected.t) * ray.direction.length();
                let slip = Vec3A::new(off, hit.u - expected.u, hit.v - expected.v);
                assert!(slip.abs().max_element() < 1e-3, "{hit:?} {expected:?}");
                hits += 1;
            }
        }
        assert!(hits > 200, "{hits}");
    }

    /// The frame with every mesh bent; its meshes have no tree yet.
    fn bent(frame: &SceneFrame) -> SceneFrame {
        let bend = |mesh: &Arc<Mesh>| {
            let bent = |p: &Vec3| *p + 0.3 * Vec3::new(p.y * p.y, p.z, (3.0 * p.x).sin());
            let vertices: Vec<f32> = mesh
                .vertices
                .iter()
                .flat_map(|p| bent(p).to_array())
                .collect();
            Arc::new(mesh_of(&vertices))
        };
        SceneFrame {
            frame: frame.frame + 1,
            instances: frame.instances.clone(),
            meshes: frame.meshes.iter().map(bend).collect(),
            materials: vec![],
            images: vec![],
            lights: vec![],
            camera: frame.camera,
            shutter: Shutter::default(),
            medium: None,
            passes: ForPasses::default(),
            world: frame.world.clone(),
        }
    }

    #[test]
    fn a_deformed_mesh_is_hit_as_if_it_were_new() {
        let mut random = Random::new(4);
        let first = frame(&mut random);
        Accel::build(&first, None);
        let second = bent(&first);
        let refitted = Accel::build(&second, Some(&first));
        let third = bent(&first);
        let built = Accel::build(&third, None);
        let tree_of = |frame: &SceneFrame| {
            frame.meshes[0]
                .bvh_at(0.5)
                .0
                .leaf_triangles()
                .collect::<Vec<_>>()
        };
        assert_eq!(
            tree_of(&second),
            tree_of(&first),
            "the tree was not taken over"
        );
        let mut hits = 0;
        for _ in 0..2000 {
            let origin = point(&mut random) * 7.0;
            let ray = Ray::new(origin.into(), (point(&mut random) * 4.0 - origin).into());
            let hit = refitted.closest_hit(&second, &ray);
            assert_eq!(hit, built.closest_hit(&third, &ray));
            hits += usize::from(hit.is_some());
        }
        assert!(hits > 200, "{hits}");
    }

    /// The frame with its meshes bent and its instances moved while the shutter is open.
    fn in_motion(frame: &SceneFrame, random: &mut Random) -> SceneFrame {
        let bent = bent(frame);
        let middle = frame.meshes.iter().zip(&bent.meshes).map(|(mesh, bent)| {
            let times = [mesh, bent, mesh].map(|m| m.vertices.to_vec()).concat();
            let numbers: Vec<f32> = times.iter().flat_map(Vec3::to_array).collect();
            let given = Given {
                name: "motion_vertices".into(),
                shape: vec![3, mesh.vertices.len(), 3],
                numbers: Numbers::F32(&numbers),
            };
            mesh.moving(vec![given])
                .map_or_else(|_| mesh.clone(), Arc::new)
        });
        let meshes = middle.collect();
        let mut moving = SceneFrame { meshes, ..bent };
        for instance in moving.instances.iter_mut().step_by(2) {
            let start = instance.placement.world_from_object;
            let turn = Quat::from_scaled_axis(point(random) * 1.5);
            let end = Affine3A::from_rotation_translation(turn, point(random)) * start;
            instance.motion = Trajectory::new(&[start, end]);
        }
        moving
    }

    /// What a moving frame shows at a time, standing still.
    fn frozen(moving: &SceneFrame, time: f32) -> SceneFrame {
        let still = |mesh: &Arc<Mesh>| {
            let triangles = 0..mesh.triangles.len() as u32;
            let corners = triangles.flat_map(|triangle| mesh.corners_at(triangle, time));
            let vertices: Vec<f32> = corners.flat_map(|corner| corner.to_array()).collect();
            Arc::new(mesh_of(&vertices))
        };
        let mut frozen = bent(moving);
        frozen.meshes = moving.meshes.iter().map(still).collect();
        for instance in &mut frozen.instances {
            instance.placement = *instance.placement_at(time);
            instance.motion = None;
        }
        frozen
    }

    #[test]
    fn what_moves_is_hit_as_if_it_stood_still_where_it_is() {
        let mut random = Random::new(5);
        let moving = in_motion(&frame(&mut random), &mut random);
        let accel = Accel::build(&moving, None);
        let mut hits = 0;
        for i in 0..20 {
            let time = i as f32 / 19.0;
            let still = frozen(&moving, time);
            let twin = Accel::build(&still, None);
            for _ in 0..200 {
                let origin = point(&mut random) * 7.0;
                let target = point(&mut random) * 4.0;
                let ray = Ray::new(origin.into(), (target - origin).into()).at_time(time);
                let hit = accel.closest_hit(&moving, &ray);
                assert_eq!(hit, twin.closest_hit(&still, &ray), "{time}");
                assert_eq!(accel.occluded(&moving, &ray), hit.is_some());
                hits += usize::from(hit.is_some());
            }
        }
        assert!(hits > 200, "{hits}");
    }

    #[test]
    fn of_equal_hits_the_smallest_instance_counts_and_refused_ones_do_not() {
        let mut random = Random::new(2);
        let mut frame = frame(&mut random);
        for i in 0..frame.instances.len() {
            frame.instances[i] = instance(0, Affine3A::IDENTITY);
        }
        let accel = Accel::build(&frame, None);
        let mut hits = 0;
        for _ in 0..200 {
            let origin = point(&mut random) * 3.0;
            let ray = Ray::new(origin.into(), (point(&mut random) - origin).into());
            let hit = accel.closest_hit(&frame, &ray);
            let later = accel.closest_hit_where(&frame, &ray, |hit| hit.instance > 20);
            assert_eq!(hit.map(|hit| hit.instance), hit.map(|_| 0));
            assert_eq!(
                later,
                hit.map(|hit| Hit {
                    instance: 21,
                    ..hit
                })
            );
            let none = |hit: &Hit| hit.instance > 1000;
            assert!(!accel.occluded_where(&frame, &ray, none));
            assert_eq!(
                accel.occluded_where(&frame, &ray, |h| h.instance == 9),
                hit.is_some()
            );
            hits += usize::from(hit.is_some());
        }
        assert!(hits > 50, "{hits}");
    }

    #[test]
    fn a_frame_without_anything_is_never_hit() {
        let mut frame = frame(&mut Random::new(3));
        frame.instances.clear();
        let accel = Accel::build(&frame, None);
        let ray = Ray::new(Vec3A::ZERO, Vec3A::X);
        assert!(accel.closest_hit(&frame, &ray).is_none());
        assert!(!accel.occluded(&frame, &ray));
    }
}
