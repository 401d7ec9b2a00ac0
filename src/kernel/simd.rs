//! The two tests a traversal spends its time in, on eight boxes and on four triangles at once.
//!
//! [`Lanes`] is an instruction set. A [`Job`] is written once, over any of them, and compiled for
//! each; [`run_widest`] picks the best one the machine has.

#[cfg(target_arch = "x86_64")]
use super::avx2;
use super::{
    node::{Boxes, Node, WIDTH},
    shear::{Shear, exact_edges},
    slabs::Slabs,
    stack::{Room, SLOT, key},
    subtree::LEAF_SIZE,
};
use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;

/// Triangles of a leaf.
pub const LEAF_TRIANGLES: usize = LEAF_SIZE;

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

    pub fn set(&mut self, lane: usize, id: u32, corners: [Vec3; 3]) {
        self.ids[lane] = id;
        for (vertex, corner) in corners.iter().enumerate() {
            for axis in 0..3 {
                self.vertices[vertex][axis][lane] = corner[axis];
            }
        }
    }

    /// The triangles a share `s` of the way to where they are in `end`.
    #[inline(always)]
    pub fn towards(&self, end: &Self, s: f32) -> Self {
        let mut moved = self.clone();
        for (vertex, goal) in moved.vertices.iter_mut().zip(&end.vertices) {
            for (axis, goal) in vertex.iter_mut().zip(goal) {
                for (place, goal) in axis.iter_mut().zip(goal) {
                    *place = *place * (1.0 - s) + goal * s;
                }
            }
        }
        moved
    }

    /// The box around its triangles, without lanes that are NaN.
    pub fn bounds(&self) -> Aabb {
        let [a, b, c] = &self.vertices;
        let all = |axis: usize, outer: fn(f32, f32) -> f32| {
            let of = |lane: usize| outer(outer(a[axis][lane], b[axis][lane]), c[axis][lane]);
            outer(outer(of(0), of(1)), outer(of(2), of(3)))
        };
        let corner = |outer| Vec3A::new(all(0, outer), all(1, outer), all(2, outer));
        let (lower, upper) = (corner(f32::min), corner(f32::max));
        // Of NaN alone, an empty box.
        let nothing = lower.is_nan_mask();
        Aabb::new(
            Vec3A::select(nothing, Vec3A::INFINITY, lower),
            Vec3A::select(nothing, Vec3A::NEG_INFINITY, upper),
        )
    }
}

/// Where a ray meets the triangles of a packet; lanes it does not meet are unspecified.
#[derive(Debug, Clone, Copy, Default)]
pub struct Meetings {
    pub t: [f32; LEAF_TRIANGLES],
    pub u: [f32; LEAF_TRIANGLES],
    pub v: [f32; LEAF_TRIANGLES],
}

/// Which children of a node a ray meets. They have been written to a [`Room`], each behind those to be
/// visited after it.
pub struct Met {
    pub count: usize,
    /// The last one, if there is one.
    pub next: u32,
}

/// An instruction set.
pub trait Lanes {
    /// The children that are met in `[t_min, t_max]`, the nearest to be visited next.
    fn meet_by_distance(node: &Node, slabs: &Slabs, t_max: f32, room: Room) -> Met;

    /// The same, the last of the node to be visited next; keys are zero.
    fn meet_in_order(node: &Node, slabs: &Slabs, t_max: f32, room: Room) -> Met;

    /// Triangles met in `[t_min, t_max]`, as a bit mask; `meetings` gets where.
    fn meet_triangles(packet: &Packet, shear: &Shear, t_max: f32, meetings: &mut Meetings) -> u32;
}

/// Work over any instruction set. Implementations mark `run` `#[inline(always)]`, so that all of
/// it is compiled for the set it runs on.
pub trait Job {
    type Output;
    fn run<L: Lanes>(self) -> Self::Output;
}

/// Runs the job on the best instruction set of this machine.
#[inline]
pub fn run_widest<J: Job>(job: J) -> J::Output {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("popcnt")
    {
        // SAFETY: the features that `run` asks for were just found.
        return unsafe { avx2::run(job) };
    }
    job.run::<Portable>()
}

/// Asks the memory for the 256 bytes from this address on, to be at hand soon.
#[inline(always)]
pub fn prefetch(address: *const u8) {
    #[cfg(target_arch = "x86_64")]
    for line in [0, 64, 128, 192] {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, which any address may be given.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.wrapping_add(line).cast()) };
    }
}

/// Plain Rust, for every machine.
pub struct Portable;

impl Lanes for Portable {
    #[inline(always)]
    fn meet_by_distance(node: &Node, slabs: &Slabs, t_max: f32, room: Room) -> Met {
        let mut entry = [0.0; WIDTH];
        let (mut sorted, mut count) = ([0; WIDTH], 0);
        for slot in bits(meet_boxes(&node.boxes, slabs, t_max, &mut entry)) {
            let key = key(entry[slot], slot);
            let mut place = count;
            while place > 0 && sorted[place - 1] < key {
                sorted[place] = sorted[place - 1];
                place -= 1;
            }
            sorted[place] = key;
            count += 1;
        }
        let mut next = 0;
        for (place, &key) in sorted[..count].iter().enumerate() {
            next = node.children[(key & SLOT) as usize];
            room.keys[place].write(key);
            room.children[place].write(next);
        }
        Met { count, next }
    }

    #[inline(always)]
    fn meet_in_order(node: &Node, slabs: &Slabs, t_max: f32, room: Room) -> Met {
        let met = meet_boxes(&node.boxes, slabs, t_max, &mut [0.0; WIDTH]);
        let mut next = 0;
        for (place, slot) in bits(met).enumerate() {
            next = node.children[slot];
            room.keys[place].write(0);
            room.children[place].write(next);
        }
        let count = met.count_ones() as usize;
        Met { count, next }
    }

    #[inline(always)]
    fn meet_triangles(packet: &Packet, shear: &Shear, t_max: f32, meetings: &mut Meetings) -> u32 {
        let [a, b, c] = [0, 1, 2].map(|vertex| sheared(&packet.vertices[vertex], shear));
        let mut edges = [[0.0f32; LEAF_TRIANGLES]; 3];
        for lane in 0..LEAF_TRIANGLES {
            edges[0][lane] = c[0][lane] * b[1][lane] - c[1][lane] * b[0][lane];
            edges[1][lane] = a[0][lane] * c[1][lane] - a[1][lane] * c[0][lane];
            edges[2][lane] = b[0][lane] * a[1][lane] - b[1][lane] * a[0][lane];
        }
        let zeros = mask(|lane| edges.iter().any(|e| e[lane] == 0.0), LEAF_TRIANGLES);
        if zeros != 0 {
            resolve_zeros(zeros, [a, b, c], &mut edges);
        }
        let met = |lane: usize| {
            let [u, v, w] = edges.map(|edge| edge[lane]);
            let determinant = u + v + w;
            let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
            let t = (u * a[2][lane] + v * b[2][lane] + w * c[2][lane]) / determinant;
            meetings.t[lane] = t;
            meetings.u[lane] = v / determinant;
            meetings.v[lane] = w / determinant;
            inside && determinant != 0.0 && t >= shear.t_min && t <= t_max
        };
        mask(met, LEAF_TRIANGLES)
    }
}

/// Boxes met in `[t_min, t_max]`, as a bit mask; `entry` gets where the ray enters each.
#[inline(always)]
fn meet_boxes(boxes: &Boxes, slabs: &Slabs, t_max: f32, entry: &mut [f32; WIDTH]) -> u32 {
    let mut exit = [t_max; WIDTH];
    *entry = [slabs.t_min; WIDTH];
    for axis in 0..3 {
        let near = &boxes.planes[slabs.near[axis] as usize];
        let far = &boxes.planes[(slabs.near[axis] ^ 1) as usize];
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
    mask(|lane| entry[lane] <= exit[lane], WIDTH)
}

/// A bit for each lane that passes.
#[inline(always)]
fn mask(mut passes: impl FnMut(usize) -> bool, lanes: usize) -> u32 {
    (0..lanes).fold(0, |mask, lane| mask | u32::from(passes(lane)) << lane)
}

/// The numbers of the bits that are set, in ascending order.
#[inline(always)]
pub fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        bit
    })
}

/// One vertex of four triangles, one axis at a time.
pub type Corner = [[f32; LEAF_TRIANGLES]; 3];

/// One vertex of each triangle, in the space in which the ray starts at the origin and runs
/// along +Z.
#[inline(always)]
fn sheared(vertex: &Corner, shear: &Shear) -> Corner {
    let [x, y, z] = shear.axes.map(|k| vertex[k].map(|p| p - shear.origin[k]));
    let [sx, sy, sz] = shear.shear;
    let mut out = [[0.0; LEAF_TRIANGLES]; 3];
    for lane in 0..LEAF_TRIANGLES {
        out[0][lane] = x[lane] - sx * z[lane];
        out[1][lane] = y[lane] - sy * z[lane];
        out[2][lane] = sz * z[lane];
    }
    out
}

/// Replaces the edge functions of the lanes in `zeros` by their exact counterparts.
#[cold]
pub fn resolve_zeros(zeros: u32, corners: [Corner; 3], edges: &mut [[f32; LEAF_TRIANGLES]; 3]) {
    for lane in bits(zeros) {
        let [x, y] = [0, 1].map(|axis| corners.map(|corner| corner[axis][lane]));
        let exact = exact_edges(x, y);
        (0..3).for_each(|i| edges[i][lane] = exact[i]);
    }
}
