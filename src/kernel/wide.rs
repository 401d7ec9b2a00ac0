//! The 8-wide tree: how it is made from obvhs's binary one, and the walks through it.

use super::{
    simd::{Boxes, Lanes, WIDTH, bits},
    slabs::Slabs,
};
use crate::math::Ray;
use glam::Vec3A;
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, leaf_collapser, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};
use std::{marker::PhantomData, mem::MaybeUninit};

/// Eight children: their boxes, and what they are.
#[derive(Debug, Clone)]
pub struct Node {
    pub boxes: Boxes,
    pub children: [u32; WIDTH],
}

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
        let mut nodes = Vec::with_capacity(binary.nodes.len() / 3 + 1);
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
            for (slot, &child) in descend(&binary, root).iter().enumerate() {
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
        let area = |node: &Node| -> f32 {
            let met = (0..WIDTH).filter(|&slot| node.children[slot] != NO_CHILD);
            met.map(|slot| node.boxes.get(slot).half_area()).sum()
        };
        let whole = Aabb::new(self.bounds.0, self.bounds.1).half_area();
        self.nodes.iter().map(area).sum::<f32>() / whole
    }
}

/// A walk through the leaves of a tree that one ray meets.
pub struct Walk<'a, L> {
    nodes: &'a [Node],
    slabs: Slabs,
    waiting: Stack,
    lanes: PhantomData<L>,
}

impl<'a, L: Lanes> Walk<'a, L> {
    /// None when the ray cannot meet anything.
    #[inline(always)]
    pub fn new(tree: &'a WideTree, ray: &Ray) -> Option<Self> {
        let slabs = Slabs::new(ray, tree.bounds)?;
        let mut waiting = Stack::new();
        waiting.push(Waiting {
            t: ray.t_min,
            child: 0,
        });
        Some(Self {
            nodes: &tree.nodes,
            slabs,
            waiting,
            lanes: PhantomData,
        })
    }

    /// The next leaf that the ray enters by `t_max`, the nearer subtree first.
    #[inline(always)]
    pub fn next_nearest(&mut self, t_max: f32) -> Option<u32> {
        let mut entry = [0.0; WIDTH];
        'next: loop {
            let Waiting { t, mut child } = self.waiting.pop()?;
            if t > t_max {
                continue;
            }
            while child & LEAF == 0 {
                let node = &self.nodes[child as usize];
                let met = L::meet_boxes(&node.boxes, &self.slabs, t_max, &mut entry);
                let mut met = bits(met);
                let Some(slot) = met.next() else {
                    continue 'next;
                };
                let of = |slot: usize| Waiting {
                    t: entry[slot],
                    child: node.children[slot],
                };
                let mut nearest = of(slot);
                let others = self.waiting.len;
                for slot in met {
                    let new = of(slot);
                    let (near, far) = if new.t < nearest.t {
                        (new, nearest)
                    } else {
                        (nearest, new)
                    };
                    self.waiting.insert(others, far);
                    nearest = near;
                }
                child = nearest.child;
            }
            return Some(child & !LEAF);
        }
    }

    /// The next leaf that the ray enters by `t_max`, the larger subtree first: it is the likelier
    /// one to hold some hit.
    #[inline(always)]
    pub fn next_largest(&mut self, t_max: f32) -> Option<u32> {
        let mut entry = [0.0; WIDTH];
        'next: loop {
            let mut child = self.waiting.pop()?.child;
            while child & LEAF == 0 {
                let node = &self.nodes[child as usize];
                let met = L::meet_boxes(&node.boxes, &self.slabs, t_max, &mut entry);
                let mut met = bits(met);
                let Some(slot) = met.next() else {
                    continue 'next;
                };
                child = node.children[slot];
                for slot in met {
                    self.waiting.push(Waiting { t: 0.0, child });
                    child = node.children[slot];
                }
            }
            return Some(child & !LEAF);
        }
    }
}

/// A subtree that waits for its turn: where the ray enters it, and what it is.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    t: f32,
    child: u32,
}

/// A stack that is not cleared before use, which would take a tenth of a ray's time.
struct Stack {
    len: usize,
    usual: [MaybeUninit<Waiting>; USUAL_STACK],
    /// What does not fit into `usual`.
    rest: Vec<Waiting>,
}

/// Enough for trees of any size; only very uneven ones need more.
const USUAL_STACK: usize = 192;

impl Stack {
    #[inline(always)]
    fn new() -> Self {
        Self {
            len: 0,
            usual: [const { MaybeUninit::uninit() }; USUAL_STACK],
            rest: Vec::new(),
        }
    }

    #[inline(always)]
    fn push(&mut self, new: Waiting) {
        if let Some(place) = self.usual.get_mut(self.len) {
            place.write(new);
        } else {
            self.rest.push(new);
        }
        self.len += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<Waiting> {
        self.len = self.len.checked_sub(1)?;
        match self.usual.get(self.len) {
            // SAFETY: entries below `len` have been written, by `push` or `insert`.
            Some(entry) => Some(unsafe { entry.assume_init() }),
            None => self.rest.pop(),
        }
    }

    /// Pushes, keeping the entries from `first` on sorted with the nearest on top. (Not beyond
    /// the usual size, where order, which only saves time, is given up.)
    #[inline(always)]
    fn insert(&mut self, first: usize, new: Waiting) {
        let mut place = self.len;
        self.push(new);
        if self.len > USUAL_STACK {
            return;
        }
        while place > first {
            // SAFETY: `place <= len - 1`, and entries below `len` have been written.
            let below = unsafe { self.usual[place - 1].assume_init() };
            if below.t >= new.t {
                break;
            }
            self.usual[place].write(below);
            place -= 1;
        }
        self.usual[place].write(new);
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
