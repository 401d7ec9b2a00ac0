//! The top level: a tree over the boxes of instances.

use super::{
    simd::{Job, Lanes, run_widest},
    wide::{Walk, WideTree},
};
use crate::math::Ray;
use glam::Vec3A;
use obvhs::aabb::Aabb;

/// A bounding volume hierarchy over boxes whose contents the caller knows how to intersect.
#[derive(Debug, Clone)]
pub struct InstanceBvh {
    /// None when there is nothing to hit.
    tree: Option<WideTree>,
}

impl InstanceBvh {
    /// Builds the tree. `boxes` are lower and upper corners; those that are not finite, or empty
    /// (a lower corner above its upper one), are never visited.
    pub fn build(boxes: &[(Vec3A, Vec3A)]) -> Self {
        let is_met = |&(lower, upper): &(Vec3A, Vec3A)| {
            lower.is_finite() && upper.is_finite() && lower.cmple(upper).all()
        };
        let members: Vec<u32> = (0u32..)
            .zip(boxes)
            .filter(|(_, bounds)| is_met(bounds))
            .map(|(id, _)| id)
            .collect();
        let boxes: Vec<Aabb> = boxes.iter().map(|&(l, u)| Aabb::new(l, u)).collect();
        let tree = (!members.is_empty()).then(|| {
            let (mut tree, leaves) = WideTree::build(&boxes, members, 1);
            tree.renumber(|leaf| leaves[leaf as usize][0]);
            tree
        });
        Self { tree }
    }

    /// Visits the instances whose boxes the ray meets, roughly the nearest first. `visit` gets
    /// the instance and the largest `t` that still counts, and returns a shorter one after a hit.
    pub fn closest(&self, ray: &Ray, visit: impl FnMut(u32, f32) -> Option<f32>) {
        if let Some(tree) = &self.tree {
            run_widest(Closest { tree, ray, visit });
        }
    }

    /// Visits the instances whose boxes the ray meets until `visit` returns true; whether it did.
    pub fn any(&self, ray: &Ray, visit: impl FnMut(u32) -> bool) -> bool {
        let tree = self.tree.as_ref();
        tree.is_some_and(|tree| run_widest(Any { tree, ray, visit }))
    }

    /// Lower and upper corner of all boxes, None when there are none.
    pub fn bounds(&self) -> Option<(Vec3A, Vec3A)> {
        self.tree.as_ref().map(WideTree::bounds)
    }
}

struct Closest<'a, V> {
    tree: &'a WideTree,
    ray: &'a Ray,
    visit: V,
}

impl<V: FnMut(u32, f32) -> Option<f32>> Job for Closest<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let Some(mut walk) = Walk::<L, ()>::new(self.tree, &[], self.ray) else {
            return;
        };
        let mut t_max = self.ray.t_max;
        while let Some(instance) = walk.next_nearest(t_max) {
            t_max = (self.visit)(instance, t_max).unwrap_or(t_max);
        }
    }
}

struct Any<'a, V> {
    tree: &'a WideTree,
    ray: &'a Ray,
    visit: V,
}

impl<V: FnMut(u32) -> bool> Job for Any<'_, V> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(mut self) -> bool {
        let Some(mut walk) = Walk::<L, ()>::new(self.tree, &[], self.ray) else {
            return false;
        };
        while let Some(instance) = walk.next_largest(self.ray.t_max) {
            if (self.visit)(instance) {
                return true;
            }
        }
        false
    }
}
