//! The two tests the traversal spends its time in, on eight boxes and four triangles at once.
//!
//! A [`Lanes`] is an instruction set. The traversal is generic over it and compiled once for each.

use super::{
    shear::{Shear, exact_edges},
    slabs::Slabs,
};

/// Children of a node.
pub const WIDTH: usize = 8;
/// Triangles of a leaf.
pub const LEAF_TRIANGLES: usize = 4;

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
}

/// Four triangles, `vertices[vertex][axis][lane]`. An unused lane is NaN, and no ray meets it.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub struct Packet {
    pub vertices: [[[f32; LEAF_TRIANGLES]; 3]; 3],
    pub ids: [u32; LEAF_TRIANGLES],
}

impl Packet {
    pub const EMPTY: Self = Self {
        vertices: [[[f32::NAN; LEAF_TRIANGLES]; 3]; 3],
        ids: [u32::MAX; LEAF_TRIANGLES],
    };
}

/// The meetings of a ray with the triangles of a packet; lanes outside the mask are unspecified.
#[derive(Debug, Clone, Copy, Default)]
pub struct Meetings {
    pub t: [f32; LEAF_TRIANGLES],
    pub u: [f32; LEAF_TRIANGLES],
    pub v: [f32; LEAF_TRIANGLES],
}

/// An instruction set.
pub trait Lanes {
    /// Bit mask of the boxes the ray meets up to `t_max`, and where it enters each.
    fn meet_boxes(boxes: &Boxes, slabs: &Slabs, t_max: f32) -> (u32, [f32; WIDTH]);

    /// Bit mask of the triangles the ray meets in `[t_min, t_max]`, and where.
    fn meet_triangles(packet: &Packet, shear: &Shear, t_max: f32) -> (u32, Meetings);
}

/// Plain Rust, for every machine; compilers turn most of it into vector instructions.
pub struct Portable;

impl Lanes for Portable {
    #[inline(always)]
    fn meet_boxes(boxes: &Boxes, slabs: &Slabs, t_max: f32) -> (u32, [f32; WIDTH]) {
        let mut entry = [slabs.t_min; WIDTH];
        let mut exit = [t_max; WIDTH];
        for axis in 0..3 {
            let near = &boxes.planes[2 * axis + slabs.backward[axis]];
            let far = &boxes.planes[2 * axis + 1 - slabs.backward[axis]];
            let inverse = slabs.inverse[axis];
            for lane in 0..WIDTH {
                let enter = near[lane] * inverse - slabs.near_offset[axis];
                let leave = far[lane] * inverse - slabs.far_offset[axis];
                entry[lane] = if enter > entry[lane] {
                    enter
                } else {
                    entry[lane]
                };
                exit[lane] = if leave < exit[lane] {
                    leave
                } else {
                    exit[lane]
                };
            }
        }
        let mut mask = 0;
        for lane in 0..WIDTH {
            mask |= u32::from(entry[lane] <= exit[lane]) << lane;
        }
        (mask, entry)
    }

    #[inline(always)]
    fn meet_triangles(packet: &Packet, shear: &Shear, t_max: f32) -> (u32, Meetings) {
        let [a, b, c] = [0, 1, 2].map(|vertex| transform(&packet.vertices[vertex], shear));
        let mut edges = [[0.0f32; LEAF_TRIANGLES]; 3];
        for lane in 0..LEAF_TRIANGLES {
            edges[0][lane] = c[0][lane] * b[1][lane] - c[1][lane] * b[0][lane];
            edges[1][lane] = a[0][lane] * c[1][lane] - a[1][lane] * c[0][lane];
            edges[2][lane] = b[0][lane] * a[1][lane] - b[1][lane] * a[0][lane];
        }
        for lane in 0..LEAF_TRIANGLES {
            if edges.iter().any(|edge| edge[lane] == 0.0) {
                let exact =
                    exact_edges([a, b, c].map(|p| p[0][lane]), [a, b, c].map(|p| p[1][lane]));
                (0..3).for_each(|i| edges[i][lane] = exact[i]);
            }
        }
        let mut mask = 0;
        let mut meetings = Meetings::default();
        for lane in 0..LEAF_TRIANGLES {
            let [u, v, w] = edges.map(|edge| edge[lane]);
            let determinant = u + v + w;
            let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
            let t = (u * a[2][lane] + v * b[2][lane] + w * c[2][lane]) / determinant;
            let met = inside && determinant != 0.0 && t >= shear.t_min && t <= t_max;
            mask |= u32::from(met) << lane;
            meetings.t[lane] = t;
            meetings.u[lane] = v / determinant;
            meetings.v[lane] = w / determinant;
        }
        (mask, meetings)
    }
}

/// One vertex of each triangle, in the space in which the ray runs along +Z.
#[inline(always)]
fn transform(vertex: &[[f32; LEAF_TRIANGLES]; 3], shear: &Shear) -> [[f32; LEAF_TRIANGLES]; 3] {
    let [x, y, z] = shear.axes.map(|k| vertex[k].map(|p| p - shear.origin[k]));
    let mut out = [[0.0; LEAF_TRIANGLES]; 3];
    for lane in 0..LEAF_TRIANGLES {
        out[0][lane] = x[lane] - shear.shear[0] * z[lane];
        out[1][lane] = y[lane] - shear.shear[1] * z[lane];
        out[2][lane] = shear.shear[2] * z[lane];
    }
    out
}
