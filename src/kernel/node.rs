//! A node of the wide tree.

use glam::Vec3A;
use obvhs::aabb::Aabb;

/// Children of a node.
pub const WIDTH: usize = 8;

/// Set in a child that is a leaf; the other bits are its index.
pub const LEAF: u32 = 1 << 31;
/// A slot without a child.
pub const NO_CHILD: u32 = u32::MAX;

/// Eight children: their boxes, and what they are.
#[derive(Debug, Clone)]
pub struct Node {
    pub boxes: Boxes,
    pub children: [u32; WIDTH],
}

/// Eight child boxes, one plane at a time: lower x, upper x, lower y, upper y, lower z, upper z.
/// An empty slot has its lower planes above its upper ones, and no ray meets it.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub struct Boxes {
    pub planes: [[f32; WIDTH]; 6],
}

impl Boxes {
    pub const EMPTY: Self = {
        let (lower, upper) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self {
            planes: [lower, upper, lower, upper, lower, upper],
        }
    };

    pub fn set(&mut self, slot: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.planes[2 * axis][slot] = bounds.min[axis];
            self.planes[2 * axis + 1][slot] = bounds.max[axis];
        }
    }

    /// The box around all of them.
    pub fn union(&self) -> Aabb {
        let lower = |axis: usize| {
            self.planes[2 * axis]
                .into_iter()
                .fold(f32::INFINITY, f32::min)
        };
        let upper = |axis: usize| {
            let planes = self.planes[2 * axis + 1].into_iter();
            planes.fold(f32::NEG_INFINITY, f32::max)
        };
        Aabb::new(
            Vec3A::new(lower(0), lower(1), lower(2)),
            Vec3A::new(upper(0), upper(1), upper(2)),
        )
    }
}

/// Gives nodes and leaves below `nodes` other numbers; `leaf` returns a child of any kind.
pub fn rename(nodes: &mut [Node], node: impl Fn(u32) -> u32, leaf: impl Fn(u32) -> u32) {
    for child in nodes.iter_mut().flat_map(|node| &mut node.children) {
        *child = match *child {
            NO_CHILD => NO_CHILD,
            own if own & LEAF != 0 => leaf(own & !LEAF),
            own => node(own),
        };
    }
}
