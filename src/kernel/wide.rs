//! The 8-wide tree: how it is joined of its parts and fitted to what has moved, and the walks through it.

use super::{
    node::{LEAF, NO_CHILD, Node, WIDTH, rename},
    pages,
    parts::divide,
    simd::{Lanes, prefetch},
    slabs::Slabs,
    stack::{Stack, key},
    subtree::{Leaf, Subtree},
};
use crate::math::Ray;
use glam::Vec3A;
use obvhs::aabb::Aabb;
use rayon::prelude::*;
use std::collections::HashMap;
use std::marker::PhantomData;

/// A tree over boxes. What its leaves hold is its owner's business.
#[derive(Debug, Clone)]
pub struct WideTree {
    /// Parents before their children: first those above the parts, then one part after the other.
    nodes: Vec<Node>,
    /// Root of each part. The first is the root of all where it is the only one.
    parts: Vec<u32>,
    bounds: (Vec3A, Vec3A),
}

impl WideTree {
    /// A tree over those of the `boxes` (finite, not inverted) that are `members` (at least one), and
    /// what its leaves hold: `leaf_size` of them at most.
    pub fn build(boxes: &[Aabb], mut members: Vec<u32>, leaf_size: usize) -> (Self, Vec<Leaf>) {
        let parts = divide(boxes, &mut members);
        let build = |part: &&mut [u32]| Subtree::build(boxes, part, leaf_size);
        let subtrees: Vec<Subtree> = parts.par_iter().map(build).collect();
        drop(members);
        Self::joined(subtrees)
    }

    /// One tree above others.
    fn joined(subtrees: Vec<Subtree>) -> (Self, Vec<Leaf>) {
        let roots: Vec<Aabb> = subtrees.iter().map(|subtree| subtree.bounds).collect();
        let numbers: Vec<u32> = (0..roots.len() as u32).collect();
        let above = (roots.len() > 1).then(|| Subtree::build(&roots, &numbers, 1));
        let mut count = above.as_ref().map_or(0, |above| above.nodes.len());
        let mut parts = Vec::with_capacity(roots.len());
        for subtree in &subtrees {
            parts.push(count as u32);
            count += subtree.nodes.len();
        }
        let mut nodes = pages::with_capacity(count);
        let mut leaves: Vec<Leaf> =
            Vec::with_capacity(subtrees.iter().map(|s| s.leaves.len()).sum());
        if let Some(mut above) = above {
            rename(
                &mut above.nodes,
                |node| node,
                |leaf| parts[above.leaves[leaf as usize][0] as usize],
            );
            nodes.append(&mut above.nodes);
        }
        for (mut subtree, first) in subtrees.into_iter().zip(&parts) {
            let first_leaf = leaves.len() as u32;
            rename(
                &mut subtree.nodes,
                |node| first + node,
                |leaf| LEAF | (first_leaf + leaf),
            );
            nodes.append(&mut subtree.nodes);
            leaves.append(&mut subtree.leaves);
        }
        let bounds = roots
            .iter()
            .fold(Aabb::INVALID, |all, root| all.union(root));
        let bounds = (bounds.min, bounds.max);
        (
            Self {
                nodes,
                parts,
                bounds,
            },
            leaves,
        )
    }

    /// Gives the leaves other numbers.
    pub fn renumber(&mut self, number: impl Fn(u32) -> u32) {
        rename(&mut self.nodes, |node| node, |leaf| LEAF | number(leaf));
    }

    /// Lower and upper corner.
    pub fn bounds(&self) -> (Vec3A, Vec3A) {
        self.bounds
    }

    pub fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
    }

    /// Fits all boxes to leaves that have moved. The shape of the tree stays.
    pub fn refit(&mut self, leaf_box: impl Fn(u32) -> Aabb + Sync) {
        let (above, mut rest) = self.nodes.split_at_mut(self.parts[0] as usize);
        let mut parts = Vec::with_capacity(self.parts.len());
        let ends = self.parts[1..].iter().copied();
        for (&first, end) in self.parts.iter().zip(ends.chain([u32::MAX])) {
            let length = rest.len().min((end - first) as usize);
            let (part, others) = rest.split_at_mut(length);
            parts.push((first, part));
            rest = others;
        }
        let refit = |(first, part): &mut (u32, &mut [Node])| {
            fit(part, *first, |child| leaf_box(child & !LEAF));
            (*first, part[0].boxes.union())
        };
        let roots: HashMap<u32, Aabb> = parts.par_iter_mut().map(refit).collect();
        fit(above, 0, |root| roots[&root]);
        let root = self.nodes[0].boxes.union();
        self.bounds = (root.min, root.max);
    }

    /// How many nodes and leaves a random ray through the bounds is expected to visit: the sum of
    /// the boxes' areas relative to that of the bounds.
    pub fn cost(&self) -> f32 {
        // Slots without a child are empty, and so are leaves whose triangles have lost their area.
        let area = |planes: &[[f32; WIDTH]; 6], slot: usize| {
            let [x, y, z] = [0, 2, 4].map(|lower| planes[lower + 1][slot] - planes[lower][slot]);
            if x >= 0.0 { x * y + y * z + z * x } else { 0.0 }
        };
        let area =
            |node: &Node| -> f32 { (0..WIDTH).map(|slot| area(&node.boxes.planes, slot)).sum() };
        let whole = Aabb::new(self.bounds.0, self.bounds.1).half_area();
        self.nodes.iter().map(area).sum::<f32>() / whole
    }
}

/// A walk through the leaves of a tree that one ray meets.
pub struct Walk<'a, L, T> {
    nodes: &'a [Node],
    leaves: &'a [T],
    slabs: Slabs,
    waiting: Stack,
    lanes: PhantomData<L>,
}

impl<'a, L: Lanes, T> Walk<'a, L, T> {
    /// `leaves` are what the tree's leaves hold, to be fetched ahead of time. None when the ray cannot
    /// meet anything.
    #[inline(always)]
    pub fn new(tree: &'a WideTree, leaves: &'a [T], ray: &Ray) -> Option<Self> {
        Some(Self {
            nodes: &tree.nodes,
            leaves,
            slabs: Slabs::new(ray, tree.bounds)?,
            waiting: Stack::new(0),
            lanes: PhantomData,
        })
    }

    /// The next leaf that the ray enters by `t_max`, the nearer subtree first.
    #[inline(always)]
    pub fn next_nearest(&mut self, t_max: f32) -> Option<u32> {
        self.next::<true>(t_max)
    }

    /// The next leaf that the ray enters by `t_max`, the larger subtree first: it is the likelier
    /// one to hold some hit.
    #[inline(always)]
    pub fn next_largest(&mut self, t_max: f32) -> Option<u32> {
        self.next::<false>(t_max)
    }

    #[inline(always)]
    fn next<const BY_DISTANCE: bool>(&mut self, t_max: f32) -> Option<u32> {
        let last = key(t_max, WIDTH - 1);
        'next: loop {
            let (key, mut child) = self.waiting.pop()?;
            if key > last {
                continue;
            }
            while child & LEAF == 0 {
                let node = &self.nodes[child as usize];
                let room = self.waiting.room();
                // (As a function that is handed over, it would not be inlined: another instruction set.)
                let met = match BY_DISTANCE {
                    true => L::meet_by_distance(node, &self.slabs, t_max, room),
                    false => L::meet_in_order(node, &self.slabs, t_max, room),
                };
                if met.count == 0 {
                    continue 'next;
                }
                // The last one is not put there to be taken away at once.
                // SAFETY: the others have been written.
                unsafe { self.waiting.grow(met.count - 1) };
                self.fetch_ahead();
                child = met.next;
            }
            return Some(child & !LEAF);
        }
    }

    /// Asks the memory for what is likely to be visited after the next subtree.
    #[inline(always)]
    fn fetch_ahead(&self) {
        let child = self.waiting.top();
        let (nodes, leaves) = (
            self.nodes.as_ptr().cast::<u8>(),
            self.leaves.as_ptr().cast(),
        );
        // Without branches: nobody can predict which of them it is.
        let (start, size) = match child & LEAF == 0 {
            true => (nodes, size_of::<Node>()),
            false => (leaves, size_of::<T>()),
        };
        prefetch(start.wrapping_add((child & !LEAF) as usize * size));
    }
}

/// Fits the boxes of a subtree's nodes, numbered from `first`, to those of children that are `outside`
/// of it.
fn fit(nodes: &mut [Node], first: u32, outside: impl Fn(u32) -> Aabb) {
    for index in (0..nodes.len()).rev() {
        for slot in 0..WIDTH {
            let child = nodes[index].children[slot];
            if child == NO_CHILD {
                continue;
            }
            let inside = nodes.get(child.wrapping_sub(first) as usize);
            let bounds = inside.map_or_else(|| outside(child), |node| node.boxes.union());
            nodes[index].boxes.set(slot, &bounds);
        }
    }
}
