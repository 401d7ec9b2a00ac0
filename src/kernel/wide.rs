//! The 8-wide tree: how it is made from obvhs's binary one, and the walks through it.

use super::{
    collapse::Collapse,
    node::{Boxes, Node, WIDTH},
    pages,
    simd::{Lanes, prefetch},
    slabs::Slabs,
    stack::{Stack, key},
};
use crate::math::Ray;
use glam::Vec3A;
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, leaf_collapser, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};
use std::marker::PhantomData;

/// Set in a child that is a leaf; the other bits are its index.
const LEAF: u32 = 1 << 31;
/// A slot without a child.
const NO_CHILD: u32 = u32::MAX;

/// A tree over boxes. What its leaves hold is its owner's business.
#[derive(Debug, Clone)]
pub struct WideTree {
    nodes: Vec<Node>,
    bounds: (Vec3A, Vec3A),
}

impl WideTree {
    /// A tree over `boxes` (finite, not inverted, at least one). `new_leaf` is called with the
    /// box numbers of each leaf, at most `leaf_size` of them, and returns the leaf's index.
    pub fn build(
        boxes: &[Aabb],
        leaf_size: usize,
        mut new_leaf: impl FnMut(&[u32]) -> u32,
    ) -> Self {
        let binary = build_binary(boxes, leaf_size);
        let collapse = Collapse::new(&binary);
        let mut nodes = pages::with_capacity(binary.nodes.len() / 3 + 1);
        // Depth first, so that a subtree is one stretch of memory.
        let mut todo = vec![(0, None)];
        while let Some((root, parent)) = todo.pop() {
            let index = nodes.len();
            if let Some((parent, slot)) = parent {
                let parent: &mut Node = &mut nodes[parent];
                parent.children[slot] = index as u32;
            }
            let mut node = Node {
                boxes: Boxes::EMPTY,
                children: [NO_CHILD; WIDTH],
            };
            for (slot, &child) in collapse.children(root).iter().enumerate() {
                let source = &binary.nodes[child as usize];
                node.boxes.set(slot, source.aabb());
                if source.is_leaf() {
                    let first = source.first_index as usize;
                    let members = first..first + source.prim_count as usize;
                    node.children[slot] = LEAF | new_leaf(&binary.primitive_indices[members]);
                } else {
                    todo.push((child, Some((index, slot))));
                }
            }
            nodes.push(node);
        }
        let root = binary.nodes[0].aabb();
        Self {
            nodes,
            bounds: (root.min, root.max),
        }
    }

    /// Lower and upper corner.
    pub fn bounds(&self) -> (Vec3A, Vec3A) {
        self.bounds
    }

    pub fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
    }

    /// Fits all boxes to leaves that have moved. The shape of the tree stays.
    pub fn refit(&mut self, leaf_box: impl Fn(u32) -> Aabb) {
        // Parents come before their children.
        for index in (0..self.nodes.len()).rev() {
            for slot in 0..WIDTH {
                let bounds = match self.nodes[index].children[slot] {
                    NO_CHILD => continue,
                    leaf if leaf & LEAF != 0 => leaf_box(leaf & !LEAF),
                    inner => self.nodes[inner as usize].boxes.union(),
                };
                self.nodes[index].boxes.set(slot, &bounds);
            }
        }
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

/// obvhs's tree by its parts (its own convenience function also validates in debug builds, which
/// takes longer than building): locally ordered clustering, reinsertion, and leaves by cost.
pub fn build_binary(boxes: &[Aabb], leaf_size: usize) -> Bvh2 {
    /// Share of the nodes that are tried in a better place; more gains little.
    const REINSERTED: f32 = 0.05;
    /// Cost of a node in triangle tests. A leaf tests its triangles at once, so larger than
    /// obvhs's default.
    const NODE_COST: f32 = 3.0;
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Medium,
        boxes,
        (0..boxes.len() as u32).collect(),
        SortPrecision::U64,
        3,
    );
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut tree, REINSERTED, None);
    if leaf_size > 1 {
        leaf_collapser::collapse(&mut tree, leaf_size as u32, NODE_COST);
        optimizer.run(&mut tree, 2.0 * REINSERTED, None);
    }
    tree
}
