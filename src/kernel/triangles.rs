//! A tree over the triangles of one mesh.

use super::{
    pages,
    shear::Shear,
    simd::{Job, LEAF_TRIANGLES, Lanes, Meetings, Packet, bits, run_widest},
    subtree::Leaf,
    wide::{Walk, WideTree},
};
use crate::math::Ray;
use glam::{DVec3, Vec3, Vec3A};
use obvhs::aabb::Aabb;
use rayon::prelude::*;

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleHit {
    /// The ray's parameter, in units of its direction.
    pub t: f32,
    /// Index into the triangles the tree was built from.
    pub triangle: u32,
    /// Barycentric coordinate of the triangle's second vertex.
    pub u: f32,
    /// Barycentric coordinate of the triangle's third vertex.
    pub v: f32,
}

/// A bounding volume hierarchy over triangles, which may move. See the [module](super) for what it
/// promises.
#[derive(Debug, Clone)]
pub struct TriangleBvh {
    /// None when there is nothing to hit.
    tree: Option<WideTree>,
    packets: Vec<Packet>,
    /// Where the packets are at the end of their motion; empty where they stand still.
    ends: Vec<Packet>,
    /// Of the tree as it was built.
    cost: f32,
    /// Number of triangles in it.
    members: usize,
}

/// Positions of vertices, which move evenly along straight lines.
#[derive(Debug, Clone, Copy)]
pub struct Positions<'a> {
    start: &'a [Vec3],
    /// None where they stand still.
    end: Option<&'a [Vec3]>,
}

impl<'a> Positions<'a> {
    /// Vertices that stand still.
    pub fn still(positions: &'a [Vec3]) -> Self {
        Self {
            start: positions,
            end: None,
        }
    }

    /// Vertices that move from `start`, at time 0, to `end`, at time 1.
    pub fn moving(start: &'a [Vec3], end: &'a [Vec3]) -> Self {
        Self {
            start,
            end: Some(end),
        }
    }

    fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|v| self.start[v as usize])
    }

    /// Where they are at the end; None for vertices that stand still.
    fn end_corners(&self, triangle: [u32; 3]) -> Option<[Vec3; 3]> {
        let end = self.end?;
        Some(triangle.map(|v| end[v as usize]))
    }

    /// Whether a triangle can be hit at some time.
    fn has_area(&self, triangle: [u32; 3]) -> bool {
        let start = self.corners(triangle);
        match self.end_corners(triangle) {
            None => has_area(&start),
            Some(end) => {
                let are_finite = [start, end].as_flattened().iter().all(|c| c.is_finite());
                are_finite && (has_area(&start) || has_area(&end))
            }
        }
    }

    fn bounds(&self, triangle: [u32; 3]) -> Aabb {
        let bounds = |corners: [Vec3; 3]| Aabb::from_points(&corners.map(Vec3A::from));
        let start = bounds(self.corners(triangle));
        let end = self.end_corners(triangle).map(bounds);
        end.map_or(start, |end| start.union(&end))
    }
}

/// A refitted tree that costs more than this factor of what it did is built anew. Rebuilding takes
/// two or three times as long as refitting, and pays where each triangle is met by many rays.
const COST_GROWTH: f32 = 1.5;

impl TriangleBvh {
    /// Builds the tree. `triangles` index `positions`. Triangles without area and triangles with
    /// a vertex that is not finite are never hit.
    pub fn build(positions: Positions, triangles: &[[u32; 3]]) -> Self {
        let bounds = |&triangle: &[u32; 3]| match positions.has_area(triangle) {
            true => positions.bounds(triangle),
            false => Aabb::INVALID,
        };
        let boxes: Vec<Aabb> = in_pieces(triangles).map(bounds).collect();
        let is_met = |&id: &u32| boxes[id as usize].valid();
        let members: Vec<u32> = (0..boxes.len() as u32).filter(is_met).collect();
        let count = members.len();
        let built = (count > 0).then(|| WideTree::build(&boxes, members, LEAF_TRIANGLES));
        drop(boxes);
        let (tree, leaves) = built.unzip();
        let leaves = leaves.unwrap_or_default();
        let (packets, ends) = packets(in_pieces(&leaves).copied(), &positions, triangles);
        Self {
            cost: tree.as_ref().map_or(0.0, WideTree::cost),
            tree,
            packets,
            ends,
            members: count,
        }
    }

    /// The tree after the vertices have moved to `positions`, for the `triangles` it was built
    /// from. Fits the boxes of this one anew, which is faster than building, unless it would
    /// become a bad tree or lack triangles that had no area before: then it builds.
    pub fn refitted(&self, positions: Positions, triangles: &[[u32; 3]]) -> Self {
        self.try_refit(positions, triangles)
            .unwrap_or_else(|| Self::build(positions, triangles))
    }

    fn try_refit(&self, positions: Positions, triangles: &[[u32; 3]]) -> Option<Self> {
        let leaves = in_pieces(&self.packets).map(|packet| packet.ids);
        let (packets, ends) = packets(leaves, &positions, triangles);
        let mut tree = self.tree.clone()?;
        tree.refit(|leaf| {
            let leaf = leaf as usize;
            let bounds = packets[leaf].bounds();
            ends.get(leaf)
                .map_or(bounds, |end| bounds.union(&end.bounds()))
        });
        let is_good = tree.bounds().0.is_finite()
            && self.holds_all(&positions, triangles)
            && tree.cost() <= COST_GROWTH * self.cost;
        is_good.then_some(Self {
            tree: Some(tree),
            packets,
            ends,
            cost: self.cost,
            members: self.members,
        })
    }

    /// Whether all triangles that can be hit are in the tree.
    fn holds_all(&self, positions: &Positions, triangles: &[[u32; 3]]) -> bool {
        if self.members == triangles.len() {
            return true;
        }
        let has_area = |id: &u32| positions.has_area(triangles[*id as usize]);
        let all = (0..triangles.len() as u32).filter(has_area).count();
        let members = self.packets.iter().flat_map(|packet| packet.ids);
        members
            .filter(|&id| id != u32::MAX)
            .filter(has_area)
            .count()
            == all
    }

    /// The hit with the smallest `t` in `[t_min, t_max]`, of equal ones that of the smallest index.
    pub fn closest_hit(&self, ray: &Ray) -> Option<TriangleHit> {
        self.closest_hit_where(ray, |_| true)
    }

    /// Like [`closest_hit`](Self::closest_hit) among the hits that `accept` accepts.
    ///
    /// It is asked in no particular order, and not about every hit: it must depend on the hit only.
    pub fn closest_hit_where(
        &self,
        ray: &Ray,
        accept: impl FnMut(&TriangleHit) -> bool,
    ) -> Option<TriangleHit> {
        run_widest(Closest {
            bvh: self,
            ray,
            accept,
        })
    }

    /// Whether anything is hit in `[t_min, t_max]`.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.occluded_where(ray, |_| true)
    }

    /// Whether anything is hit that `accept` accepts, which must depend on the hit only.
    pub fn occluded_where(&self, ray: &Ray, accept: impl FnMut(&TriangleHit) -> bool) -> bool {
        run_widest(Any {
            bvh: self,
            ray,
            accept,
        })
    }

    /// The triangles in the order of the leaves: two trees of one shape have the same.
    #[cfg(test)]
    pub fn leaf_triangles(&self) -> impl Iterator<Item = u32> {
        self.packets.iter().flat_map(|packet| packet.ids)
    }

    /// Lower and upper corner of all triangles that can be hit, None when there are none.
    pub fn bounds(&self) -> Option<(Vec3A, Vec3A)> {
        self.tree.as_ref().map(WideTree::bounds)
    }

    /// The triangles of a leaf at a time from 0, the start of their motion, to 1; moving ones in
    /// `moved`.
    #[inline(always)]
    fn packet<'a>(&'a self, leaf: usize, time: f32, moved: &'a mut Option<Packet>) -> &'a Packet {
        let start = &self.packets[leaf];
        match self.ends.get(leaf) {
            None => start,
            Some(end) => moved.insert(start.towards(end, time)),
        }
    }

    /// Memory the tree holds [bytes].
    pub fn memory_bytes(&self) -> usize {
        let nodes = self.tree.as_ref().map_or(0, WideTree::memory_bytes);
        nodes + (self.packets.capacity() + self.ends.capacity()) * size_of::<Packet>()
    }
}

/// The closest accepted hit of a ray.
pub(super) struct Closest<'a, A> {
    pub bvh: &'a TriangleBvh,
    pub ray: &'a Ray,
    pub accept: A,
}

impl<A: FnMut(&TriangleHit) -> bool> Job for Closest<'_, A> {
    type Output = Option<TriangleHit>;

    #[inline(always)]
    fn run<L: Lanes>(mut self) -> Self::Output {
        let mut walk = Walk::<L, _>::new(self.bvh.tree.as_ref()?, &self.bvh.packets, self.ray)?;
        // Made at the first leaf: many walks through a mesh's box meet none.
        let mut shear = None;
        let mut meetings = Meetings::default();
        let mut best: Option<TriangleHit> = None;
        let mut t_max = self.ray.t_max;
        let mut moved = None;
        while let Some(leaf) = walk.next_nearest(t_max) {
            let packet = self.bvh.packet(leaf as usize, self.ray.time, &mut moved);
            let shear = shear.get_or_insert_with(|| Shear::new(self.ray));
            let met = L::meet_triangles(packet, shear, t_max, &mut meetings);
            for hit in hits(packet, met, &meetings) {
                let nearer = match best {
                    None => true,
                    Some(best) => (hit.t, hit.triangle) < (best.t, best.triangle),
                };
                if nearer && (self.accept)(&hit) {
                    t_max = hit.t;
                    best = Some(hit);
                }
            }
        }
        best
    }
}

/// Whether a ray has an accepted hit.
pub(super) struct Any<'a, A> {
    pub bvh: &'a TriangleBvh,
    pub ray: &'a Ray,
    pub accept: A,
}

impl<A: FnMut(&TriangleHit) -> bool> Job for Any<'_, A> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(mut self) -> bool {
        let tree = self.bvh.tree.as_ref();
        let Some(mut walk) =
            tree.and_then(|tree| Walk::<L, _>::new(tree, &self.bvh.packets, self.ray))
        else {
            return false;
        };
        // Made at the first leaf: many walks through a mesh's box meet none.
        let mut shear = None;
        let mut meetings = Meetings::default();
        let mut moved = None;
        while let Some(leaf) = walk.next_largest(self.ray.t_max) {
            let packet = self.bvh.packet(leaf as usize, self.ray.time, &mut moved);
            let shear = shear.get_or_insert_with(|| Shear::new(self.ray));
            let met = L::meet_triangles(packet, shear, self.ray.t_max, &mut meetings);
            if hits(packet, met, &meetings).any(|hit| (self.accept)(&hit)) {
                return true;
            }
        }
        false
    }
}

/// The hits of the lanes in `met`.
#[inline(always)]
fn hits<'a>(
    packet: &'a Packet,
    met: u32,
    meetings: &'a Meetings,
) -> impl Iterator<Item = TriangleHit> + 'a {
    bits(met).map(|lane| TriangleHit {
        t: meetings.t[lane],
        triangle: packet.ids[lane],
        u: meetings.u[lane],
        v: meetings.v[lane],
    })
}

/// Items for several threads, if they are many.
fn in_pieces<T: Sync>(items: &[T]) -> impl IndexedParallelIterator<Item = &T> + Clone {
    items.par_iter().with_min_len(4096)
}

/// The packets of the leaves' triangles at the start of their motion and, if they move, at its end.
/// Lanes of triangles that can never be hit are NaN.
fn packets(
    leaves: impl IndexedParallelIterator<Item = Leaf> + Clone,
    positions: &Positions,
    triangles: &[[u32; 3]],
) -> (Vec<Packet>, Vec<Packet>) {
    let of = |vertices: &[Vec3]| {
        let mut packets = pages::with_capacity(leaves.len());
        packets.par_extend(leaves.clone().map(|leaf| {
            let mut packet = Packet::EMPTY;
            for (lane, &id) in leaf.iter().enumerate().filter(|(_, id)| **id != u32::MAX) {
                let triangle = triangles[id as usize];
                let corners = match positions.has_area(triangle) {
                    true => triangle.map(|v| vertices[v as usize]),
                    false => [Vec3::NAN; 3],
                };
                packet.set(lane, id, corners);
            }
            packet
        }));
        packets
    };
    (of(positions.start), positions.end.map_or_else(Vec::new, of))
}

/// False also where a coordinate is not finite. In double precision, for meshes of any size.
fn has_area(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(DVec3::from);
    let normal = (b - a).cross(c - a);
    normal.is_finite() && normal != DVec3::ZERO
}
