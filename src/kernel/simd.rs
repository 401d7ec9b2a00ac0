//! The two tests a traversal spends its time in, on eight boxes and on four triangles at once.
//!
//! [`Lanes`] is an instruction set. A [`Job`] is written once, over any of them, and compiled for
//! each; [`run_widest`] picks the best one the machine has.

use super::{
    shear::{Shear, exact_edges},
    slabs::Slabs,
};
use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;

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

    pub fn get(&self, slot: usize) -> Aabb {
        let corner = |upper: usize| {
            let [x, y, z] = [0, 2, 4].map(|plane| self.planes[plane + upper][slot]);
            Vec3A::new(x, y, z)
        };
        Aabb::new(corner(0), corner(1))
    }

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
        let all = |axis: usize| self.vertices.iter().flat_map(move |vertex| vertex[axis]);
        let lower = |axis| all(axis).fold(f32::INFINITY, f32::min);
        let upper = |axis| all(axis).fold(f32::NEG_INFINITY, f32::max);
        Aabb::new(
            Vec3A::new(lower(0), lower(1), lower(2)),
            Vec3A::new(upper(0), upper(1), upper(2)),
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

/// An instruction set. Both tests return a bit mask of what the ray meets.
pub trait Lanes {
    /// Boxes met in `[t_min, t_max]`; `entry` gets where the ray enters each.
    fn meet_boxes(boxes: &Boxes, slabs: &Slabs, t_max: f32, entry: &mut [f32; WIDTH]) -> u32;

    /// Triangles met in `[t_min, t_max]`; `meetings` gets where.
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
    {
        // SAFETY: the features that `run` asks for were just found.
        return unsafe { avx2::run(job) };
    }
    job.run::<Portable>()
}

/// Plain Rust, for every machine.
pub struct Portable;

impl Lanes for Portable {
    #[inline(always)]
    fn meet_boxes(boxes: &Boxes, slabs: &Slabs, t_max: f32, entry: &mut [f32; WIDTH]) -> u32 {
        let mut exit = [t_max; WIDTH];
        *entry = [slabs.t_min; WIDTH];
        for axis in 0..3 {
            let backward = usize::from(slabs.backward[axis]);
            let near = &boxes.planes[2 * axis + backward];
            let far = &boxes.planes[2 * axis + 1 - backward];
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
type Corner = [[f32; LEAF_TRIANGLES]; 3];

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
fn resolve_zeros(zeros: u32, corners: [Corner; 3], edges: &mut [[f32; LEAF_TRIANGLES]; 3]) {
    for lane in bits(zeros) {
        let [x, y] = [0, 1].map(|axis| corners.map(|corner| corner[axis][lane]));
        let exact = exact_edges(x, y);
        (0..3).for_each(|i| edges[i][lane] = exact[i]);
    }
}

/// AVX2 with fused multiply-add. Boxes fuse (their padding covers either rounding), triangles do
/// not: see the kernel's promises.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{
        Boxes, Job, LEAF_TRIANGLES, Lanes, Meetings, Packet, Shear, Slabs, WIDTH, resolve_zeros,
    };
    use std::arch::x86_64::*;

    /// Only [`run`] names this type, so that its tests run only where the features are.
    struct Avx2;

    #[target_feature(enable = "avx2,fma,bmi1")]
    pub fn run<J: Job>(job: J) -> J::Output {
        job.run::<Avx2>()
    }

    impl Lanes for Avx2 {
        #[inline(always)]
        fn meet_boxes(boxes: &Boxes, slabs: &Slabs, t_max: f32, entry: &mut [f32; WIDTH]) -> u32 {
            // SAFETY: inside `run`, the features are there.
            unsafe { meet_boxes(boxes, slabs, t_max, entry) }
        }

        #[inline(always)]
        fn meet_triangles(
            packet: &Packet,
            shear: &Shear,
            t_max: f32,
            meetings: &mut Meetings,
        ) -> u32 {
            // SAFETY: inside `run`, the features are there.
            unsafe { meet_triangles(packet, shear, t_max, meetings) }
        }
    }

    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1")]
    fn meet_boxes(boxes: &Boxes, slabs: &Slabs, t_max: f32, entry: &mut [f32; WIDTH]) -> u32 {
        let plane = |axis: usize, upper: bool, offset: f32| {
            let coordinates = load8(&boxes.planes[2 * axis + usize::from(upper)]);
            let inverse = _mm256_set1_ps(slabs.inverse[axis]);
            _mm256_fmsub_ps(coordinates, inverse, _mm256_set1_ps(offset))
        };
        let near = |axis| plane(axis, slabs.backward[axis], slabs.near_offset[axis]);
        let far = |axis| plane(axis, !slabs.backward[axis], slabs.far_offset[axis]);
        let (t_min, t_max) = (_mm256_set1_ps(slabs.t_min), _mm256_set1_ps(t_max));
        let enter = _mm256_max_ps(
            _mm256_max_ps(near(0), near(1)),
            _mm256_max_ps(near(2), t_min),
        );
        let leave = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), _mm256_min_ps(far(2), t_max));
        // SAFETY: `entry` has room for eight.
        unsafe { _mm256_storeu_ps(entry.as_mut_ptr(), enter) };
        _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave)) as u32
    }

    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1")]
    fn meet_triangles(packet: &Packet, shear: &Shear, t_max: f32, meetings: &mut Meetings) -> u32 {
        let corners = [
            sheared(&packet.vertices[0], shear),
            sheared(&packet.vertices[1], shear),
            sheared(&packet.vertices[2], shear),
        ];
        let [a, b, c] = corners;
        let zero = _mm_setzero_ps();
        let mut edges = [cross(c, b), cross(a, c), cross(b, a)];
        let is_zero = |edge| _mm_cmpeq_ps(edge, zero);
        let any_zero = _mm_or_ps(is_zero(edges[0]), is_zero(edges[1]));
        let zeros = _mm_movemask_ps(_mm_or_ps(any_zero, is_zero(edges[2])));
        if zeros != 0 {
            edges = resolved(zeros as u32, corners, edges);
        }
        let [u, v, w] = edges;
        // A NaN, which marks an unused lane, fails the comparison of the determinant.
        let least = _mm_min_ps(_mm_min_ps(u, v), w);
        let most = _mm_max_ps(_mm_max_ps(u, v), w);
        let inside = _mm_or_ps(_mm_cmpge_ps(least, zero), _mm_cmple_ps(most, zero));
        let determinant = _mm_add_ps(_mm_add_ps(u, v), w);
        let inside = _mm_and_ps(inside, _mm_cmp_ps::<_CMP_NEQ_OQ>(determinant, zero));
        if _mm_movemask_ps(inside) == 0 {
            return 0;
        }
        let scaled = _mm_add_ps(_mm_mul_ps(u, a[2]), _mm_mul_ps(v, b[2]));
        let scaled = _mm_add_ps(scaled, _mm_mul_ps(w, c[2]));
        let t = _mm_div_ps(scaled, determinant);
        let after = _mm_cmpge_ps(t, _mm_set1_ps(shear.t_min));
        let before = _mm_cmple_ps(t, _mm_set1_ps(t_max));
        let met = _mm_movemask_ps(_mm_and_ps(inside, _mm_and_ps(after, before)));
        if met != 0 {
            meetings.t = store4(t);
            meetings.u = store4(_mm_div_ps(v, determinant));
            meetings.v = store4(_mm_div_ps(w, determinant));
        }
        met as u32
    }

    /// [`super::sheared`] in registers.
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1")]
    fn sheared(vertex: &super::Corner, shear: &Shear) -> [__m128; 3] {
        let moved = |k: usize| _mm_sub_ps(load4(&vertex[k]), _mm_set1_ps(shear.origin[k]));
        let [x, y, z] = shear.axes;
        let [x, y, z] = [moved(x), moved(y), moved(z)];
        let along = |s: f32| _mm_mul_ps(_mm_set1_ps(s), z);
        let [sx, sy, sz] = shear.shear;
        let [sx, sy, sz] = [along(sx), along(sy), along(sz)];
        [_mm_sub_ps(x, sx), _mm_sub_ps(y, sy), sz]
    }

    /// [`resolve_zeros`] out of registers.
    #[cold]
    #[target_feature(enable = "avx2,fma,bmi1")]
    fn resolved(zeros: u32, corners: [[__m128; 3]; 3], edges: [__m128; 3]) -> [__m128; 3] {
        let store = |p: [__m128; 3]| [store4(p[0]), store4(p[1]), store4(p[2])];
        let mut stored = store(edges);
        resolve_zeros(zeros, corners.map(store), &mut stored);
        [load4(&stored[0]), load4(&stored[1]), load4(&stored[2])]
    }

    /// `p.x q.y - p.y q.x`, each product rounded.
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1")]
    fn cross(p: [__m128; 3], q: [__m128; 3]) -> __m128 {
        _mm_sub_ps(_mm_mul_ps(p[0], q[1]), _mm_mul_ps(p[1], q[0]))
    }

    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1")]
    fn load8(from: &[f32; WIDTH]) -> __m256 {
        // SAFETY: there are eight.
        unsafe { _mm256_loadu_ps(from.as_ptr()) }
    }

    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1")]
    fn load4(from: &[f32; LEAF_TRIANGLES]) -> __m128 {
        // SAFETY: there are four.
        unsafe { _mm_loadu_ps(from.as_ptr()) }
    }

    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1")]
    fn store4(from: __m128) -> [f32; LEAF_TRIANGLES] {
        let mut to = [0.0; LEAF_TRIANGLES];
        // SAFETY: there is room for four.
        unsafe { _mm_storeu_ps(to.as_mut_ptr(), from) };
        to
    }
}
