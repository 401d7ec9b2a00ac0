//! The 8-wide tree: how it is made from obvhs's binary one, and the two ways through it.

use super::{
    simd::{Boxes, Lanes, WIDTH},
    slabs::Slabs,
};
use crate::math::Ray;
use glam::Vec3A;
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, leaf_collapser, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};

/// Eight children: their boxes, and what they are.
#[derive(Debug, Clone)]
pub struct Node {
    pub boxes: Boxes,
    pub children: [u32; WIDTH],
}

/// Set in a child that is a leaf; the other bits are its index.
const LEAF: u32 = 1 << 31;

/// A tree over boxes. What its leaves hold is its owner's business.
#[derive(Debug, Clone)]
pub struct WideTree {
    nodes: Vec<Node>,
    bounds: (Vec3A, Vec3A),
    /// Entries the deepest traversal can have waiting.
    stack_size: usize,
}

/// A subtree that waits for its turn: where the ray enters it, and what it is.
#[derive(Debug, Clone, Copy, Default)]
struct Waiting {
    t: f32,
    child: u32,
}

/// Traversals of trees up to this need of entries allocate nothing; others are rare and degenerate.
const USUAL_STACK: usize = 256;

impl WideTree {
    /// A tree over `boxes` (finite, not inverted, at least one). `new_leaf` is called with the
    /// box numbers of each leaf, at most `leaf_size` of them, and returns the leaf's index.
    pub fn build(
        boxes: &[Aabb],
        leaf_size: usize,
        mut new_leaf: impl FnMut(&[u32]) -> u32,
    ) -> Self {
        let binary = build_binary(boxes, leaf_size);
        let mut nodes = Vec::with_capacity(binary.nodes.len() / 3 + 1);
        let mut depth = 0;
        // Depth first, so that a subtree is one stretch of memory.
        let mut todo = vec![(0, 1, None)];
        while let Some((root, level, parent)) = todo.pop() {
            depth = depth.max(level);
            let index = nodes.len();
            if let Some((parent, slot)) = parent {
                let parent: &mut Node = &mut nodes[parent];
                parent.children[slot] = index as u32;
            }
            let mut node = Node {
                boxes: Boxes::EMPTY,
                children: [0; WIDTH],
            };
            for (slot, &child) in descend(&binary, root).iter().enumerate() {
                let source = &binary.nodes[child as usize];
                set_box(&mut node.boxes, slot, source.aabb());
                if source.is_leaf() {
                    let first = source.first_index as usize;
                    let members = first..first + source.prim_count as usize;
                    node.children[slot] = LEAF | new_leaf(&binary.primitive_indices[members]);
                } else {
                    todo.push((child, level + 1, Some((index, slot))));
                }
            }
            nodes.push(node);
        }
        let root = binary.nodes[0].aabb();
        Self {
            nodes,
            bounds: (root.min, root.max),
            stack_size: depth * (WIDTH - 1) + 1,
        }
    }

    /// Lower and upper corner.
    pub fn bounds(&self) -> (Vec3A, Vec3A) {
        self.bounds
    }

    pub fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
    }

    /// Visits the leaves the ray meets, the nearer subtree first, until none is left that it
    /// enters by `t_max`. `visit(leaf, t_max)` returns the new `t_max`.
    #[inline(always)]
    pub fn nearest<L: Lanes>(&self, ray: &Ray, mut visit: impl FnMut(u32, f32) -> f32) {
        let Some(slabs) = Slabs::new(ray, self.bounds) else {
            return;
        };
        let mut t_max = ray.t_max;
        self.with_stack(|stack| {
            let mut waiting = 1;
            stack[0] = Waiting {
                t: f32::NEG_INFINITY,
                child: 0,
            };
            while waiting > 0 {
                waiting -= 1;
                let Waiting { t, child } = stack[waiting];
                if t > t_max {
                    continue;
                }
                if child & LEAF != 0 {
                    t_max = visit(child & !LEAF, t_max);
                    continue;
                }
                let node = &self.nodes[child as usize];
                let (mut mask, entry) = L::meet_boxes(&node.boxes, &slabs, t_max);
                let first = waiting;
                while mask != 0 {
                    let slot = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    let new = Waiting {
                        t: entry[slot],
                        child: node.children[slot],
                    };
                    // Insertion sort: the nearest on top.
                    let mut place = waiting;
                    while place > first && stack[place - 1].t < new.t {
                        stack[place] = stack[place - 1];
                        place -= 1;
                    }
                    stack[place] = new;
                    waiting += 1;
                }
            }
        });
    }

    /// Visits the leaves the ray meets, the larger subtree first, until `visit` returns true;
    /// whether it did.
    #[inline(always)]
    pub fn any<L: Lanes>(&self, ray: &Ray, mut visit: impl FnMut(u32) -> bool) -> bool {
        let Some(slabs) = Slabs::new(ray, self.bounds) else {
            return false;
        };
        self.with_stack(|stack| {
            let mut waiting = 1;
            stack[0].child = 0;
            while waiting > 0 {
                waiting -= 1;
                let child = stack[waiting].child;
                if child & LEAF != 0 {
                    if visit(child & !LEAF) {
                        return true;
                    }
                    continue;
                }
                let node = &self.nodes[child as usize];
                let (mut mask, _) = L::meet_boxes(&node.boxes, &slabs, ray.t_max);
                while mask != 0 {
                    stack[waiting].child = node.children[mask.trailing_zeros() as usize];
                    mask &= mask - 1;
                    waiting += 1;
                }
            }
            false
        })
    }

    #[inline(always)]
    fn with_stack<T>(&self, traverse: impl FnOnce(&mut [Waiting]) -> T) -> T {
        if self.stack_size <= USUAL_STACK {
            traverse(&mut [Waiting::default(); USUAL_STACK])
        } else {
            traverse(&mut vec![Waiting::default(); self.stack_size])
        }
    }
}

/// obvhs's tree by its parts (its own convenience function also validates in debug builds, which
/// takes longer than building): locally ordered clustering, reinsertion, and leaves by cost.
fn build_binary(boxes: &[Aabb], leaf_size: usize) -> Bvh2 {
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

/// Up to eight descendants of a binary node that together cover it, the smallest box first.
/// The largest one is opened until there are eight.
fn descend(tree: &Bvh2, root: u32) -> Vec<u32> {
    let node = |index: u32| &tree.nodes[index as usize];
    let area = |index: u32| node(index).aabb().half_area();
    let mut children = vec![root];
    while children.len() < WIDTH {
        let inner = (0..children.len()).filter(|&i| !node(children[i]).is_leaf());
        let Some(largest) = inner.max_by(|&i, &j| area(children[i]).total_cmp(&area(children[j])))
        else {
            break;
        };
        let first = node(children[largest]).first_index;
        children[largest] = first;
        children.push(first + 1);
    }
    children.sort_by(|&i, &j| area(i).total_cmp(&area(j)));
    children
}

fn set_box(boxes: &mut Boxes, slot: usize, bounds: &Aabb) {
    for axis in 0..3 {
        boxes.planes[2 * axis][slot] = bounds.min[axis];
        boxes.planes[2 * axis + 1][slot] = bounds.max[axis];
    }
}
