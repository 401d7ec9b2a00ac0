//! A wide tree made from obvhs's binary one, by one thread.

use super::{
    collapse::Collapse,
    node::{Boxes, LEAF, NO_CHILD, Node, WIDTH},
};
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, leaf_collapser, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};

/// What a leaf holds at most.
pub const LEAF_SIZE: usize = 4;

/// What a leaf holds, and `u32::MAX`.
pub type Leaf = [u32; LEAF_SIZE];

/// A tree over some boxes: its nodes, each before its children, and what its leaves hold.
pub struct Subtree {
    pub nodes: Vec<Node>,
    pub leaves: Vec<Leaf>,
    pub bounds: Aabb,
}

impl Subtree {
    /// A tree over those of the `boxes` (finite, not inverted) that are `members` (at least one).
    pub fn build(boxes: &[Aabb], members: &[u32], leaf_size: usize) -> Self {
        let own: Vec<Aabb> = members.iter().map(|&m| boxes[m as usize]).collect();
        let binary = build_binary(&own, leaf_size);
        let collapse = Collapse::new(&binary);
        let mut nodes: Vec<Node> = Vec::with_capacity(binary.nodes.len() / 3 + 1);
        let mut leaves = Vec::with_capacity(members.len() / 2 + 1);
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
                    node.children[slot] = LEAF | leaves.len() as u32;
                    let first = source.first_index as usize;
                    let held = &binary.primitive_indices[first..][..source.prim_count as usize];
                    leaves.push(leaf(held, members));
                } else {
                    todo.push((child, Some((index, slot))));
                }
            }
            nodes.push(node);
        }
        let bounds = *binary.nodes[0].aabb();
        Self {
            nodes,
            leaves,
            bounds,
        }
    }
}

fn leaf(held: &[u32], members: &[u32]) -> Leaf {
    let mut leaf = [u32::MAX; LEAF_SIZE];
    for (place, &number) in leaf.iter_mut().zip(held) {
        *place = members[number as usize];
    }
    leaf
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
