//! AVX2 with fused multiply-add. Boxes fuse (their padding covers either rounding), triangles do
//! not: see the kernel's promises.

use super::{
    node::{Boxes, Node, WIDTH},
    shear::Shear,
    simd::{Corner, Job, LEAF_TRIANGLES, Lanes, Meetings, Met, Packet, resolve_zeros},
    slabs::Slabs,
    stack::{Room, SLOT},
};
use std::arch::x86_64::*;

/// Only [`run`] names this type, so that its tests run only where the features are.
struct Avx2;

#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub fn run<J: Job>(job: J) -> J::Output {
    job.run::<Avx2>()
}

impl Lanes for Avx2 {
    #[inline(always)]
    fn meet_by_distance(node: &Node, slabs: &Slabs, t_max: f32, room: Room) -> Met {
        // SAFETY: inside `run`, the features are there.
        unsafe { meet_by_distance(node, slabs, t_max, room) }
    }

    #[inline(always)]
    fn meet_in_order(node: &Node, slabs: &Slabs, t_max: f32, room: Room) -> Met {
        // SAFETY: inside `run`, the features are there.
        unsafe { meet_in_order(node, slabs, t_max, room) }
    }

    #[inline(always)]
    fn meet_triangles(packet: &Packet, shear: &Shear, t_max: f32, meetings: &mut Meetings) -> u32 {
        // SAFETY: inside `run`, the features are there.
        unsafe { meet_triangles(packet, shear, t_max, meetings) }
    }
}

/// Where the ray enters the boxes, and a mask of those that it misses in `[t_min, t_max]`.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn enter_boxes(boxes: &Boxes, slabs: &Slabs, t_max: f32) -> (__m256, __m256) {
    let plane = |number: u32, axis: usize, offset: f32| {
        debug_assert!(number < 6);
        // SAFETY: slabs name planes by numbers below six.
        let coordinates = load8(unsafe { boxes.planes.get_unchecked(number as usize) });
        let inverse = _mm256_set1_ps(slabs.inverse[axis]);
        _mm256_fmsub_ps(coordinates, inverse, _mm256_set1_ps(offset))
    };
    let near = |axis: usize| plane(slabs.near[axis], axis, slabs.near_offset[axis]);
    let far = |axis: usize| plane(slabs.near[axis] ^ 1, axis, slabs.far_offset[axis]);
    let (t_min, t_max) = (_mm256_set1_ps(slabs.t_min), _mm256_set1_ps(t_max));
    let enter = _mm256_max_ps(
        _mm256_max_ps(near(0), near(1)),
        _mm256_max_ps(near(2), t_min),
    );
    let leave = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), _mm256_min_ps(far(2), t_max));
    (enter, _mm256_cmp_ps::<_CMP_NLE_UQ>(enter, leave))
}

/// Eight keys are sorted whatever they are, since nobody can predict how many there will be.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn meet_by_distance(node: &Node, slabs: &Slabs, t_max: f32, room: Room) -> Met {
    let (enter, missed) = enter_boxes(&node.boxes, slabs, t_max);
    let start = _mm256_castps_si256(_mm256_max_ps(enter, _mm256_setzero_ps()));
    let start = _mm256_andnot_si256(_mm256_set1_epi32(SLOT), start);
    let keys = _mm256_or_si256(start, _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    // Those that are missed are below all others as signed numbers, above them as unsigned ones.
    let keys = _mm256_or_si256(keys, _mm256_castps_si256(missed));
    // The walk goes on there while the others are sorted.
    let next = node.children[(least_unsigned(keys) & SLOT as u32) as usize];
    let sorted = sorted_descending(keys);
    // The last bits of a key, of which alone the permutation takes note, are the slot.
    let children = _mm256_permutevar8x32_epi32(load8_u32(&node.children), sorted);
    // SAFETY: there is room for eight.
    unsafe {
        _mm256_storeu_si256(room.keys.as_mut_ptr().cast(), sorted);
        _mm256_storeu_si256(room.children.as_mut_ptr().cast(), children);
    }
    let count = WIDTH - (_mm256_movemask_ps(missed) as u32).count_ones() as usize;
    Met { count, next }
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn meet_in_order(node: &Node, slabs: &Slabs, t_max: f32, room: Room) -> Met {
    let (_, missed) = enter_boxes(&node.boxes, slabs, t_max);
    let met = !_mm256_movemask_ps(missed) as u32 & 0xff;
    let next = node.children[(met | 1).ilog2() as usize];
    // SAFETY: there are eight, and there is room for eight.
    unsafe {
        let slots = _mm_loadl_epi64(SLOTS[met as usize].as_ptr().cast());
        let slots = _mm256_cvtepu8_epi32(slots);
        let children = _mm256_permutevar8x32_epi32(load8_u32(&node.children), slots);
        _mm256_storeu_si256(room.keys.as_mut_ptr().cast(), _mm256_setzero_si256());
        _mm256_storeu_si256(room.children.as_mut_ptr().cast(), children);
    }
    let count = met.count_ones() as usize;
    Met { count, next }
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn least_unsigned(v: __m256i) -> u32 {
    let v = _mm_min_epu32(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
    let v = _mm_min_epu32(v, _mm_shuffle_epi32::<0b01_00_11_10>(v));
    let v = _mm_min_epu32(v, _mm_shuffle_epi32::<0b10_11_00_01>(v));
    _mm_cvtsi128_si32(v) as u32
}

/// Bitonic sorting in six steps (Batcher 1968): each compares lanes with others, of which the
/// former keep the larger ones.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn sorted_descending(v: __m256i) -> __m256i {
    macro_rules! step {
        ($v:expr, $others:expr, $larger:literal) => {{
            let (v, others) = ($v, $others);
            _mm256_blend_epi32::<$larger>(_mm256_min_epi32(v, others), _mm256_max_epi32(v, others))
        }};
    }
    let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b0101_0101);
    let v = step!(v, _mm256_shuffle_epi32::<0b00_01_10_11>(v), 0b0011_0011);
    let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b0101_0101);
    let reversed = _mm256_shuffle_epi32::<0b00_01_10_11>(v);
    let reversed = _mm256_permute2x128_si256::<1>(reversed, reversed);
    let v = step!(v, reversed, 0b0000_1111);
    let v = step!(v, _mm256_shuffle_epi32::<0b01_00_11_10>(v), 0b0011_0011);
    step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b0101_0101)
}

/// For each mask the numbers of its bits.
static SLOTS: [[u8; WIDTH]; 256] = {
    let mut slots = [[0; WIDTH]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut slot, mut count) = (0, 0);
        while slot < WIDTH {
            if mask & 1 << slot != 0 {
                slots[mask][count] = slot as u8;
                count += 1;
            }
            slot += 1;
        }
        mask += 1;
    }
    slots
};

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
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

/// The `sheared` of [`super::simd`] in registers.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn sheared(vertex: &Corner, shear: &Shear) -> [__m128; 3] {
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
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn resolved(zeros: u32, corners: [[__m128; 3]; 3], edges: [__m128; 3]) -> [__m128; 3] {
    let store = |p: [__m128; 3]| [store4(p[0]), store4(p[1]), store4(p[2])];
    let mut stored = store(edges);
    resolve_zeros(zeros, corners.map(store), &mut stored);
    [load4(&stored[0]), load4(&stored[1]), load4(&stored[2])]
}

/// `p.x q.y - p.y q.x`, each product rounded.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn cross(p: [__m128; 3], q: [__m128; 3]) -> __m128 {
    _mm_sub_ps(_mm_mul_ps(p[0], q[1]), _mm_mul_ps(p[1], q[0]))
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn load8(from: &[f32; WIDTH]) -> __m256 {
    // SAFETY: there are eight.
    unsafe { _mm256_loadu_ps(from.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn load8_u32(from: &[u32; WIDTH]) -> __m256i {
    // SAFETY: there are eight.
    unsafe { _mm256_loadu_si256(from.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn load4(from: &[f32; LEAF_TRIANGLES]) -> __m128 {
    // SAFETY: there are four.
    unsafe { _mm_loadu_ps(from.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn store4(from: __m128) -> [f32; LEAF_TRIANGLES] {
    let mut to = [0.0; LEAF_TRIANGLES];
    // SAFETY: there is room for four.
    unsafe { _mm_storeu_ps(to.as_mut_ptr(), from) };
    to
}
