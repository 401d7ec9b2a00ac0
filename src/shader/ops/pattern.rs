//! Regular textures: Wave, Magic, Checker, Brick, Gradient.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::Vec3A;

use super::super::operation::Args;
use super::{noise::Fractal, smoothstep};

/// A step off whole coordinates, where rounding would decide; Blender takes the same.
fn off_the_edge(p: Vec3A) -> Vec3A {
    (p + 1e-6) * 0.999_999
}

pub fn wave(a: &Args) -> Vec3A {
    let p = off_the_edge(a.vector(0) * a.float(1));
    let (distortion, phase) = (a.float(2), a.float(6));
    let mut n = match (a.mode(0), a.mode(1), a.mode(2)) {
        (0, 3, _) => 10.0 * p.element_sum(),
        (0, axis, _) => 20.0 * p[axis],
        (_, _, 3) => 20.0 * p.length(),
        (_, _, axis) => {
            let mut across = p;
            across[axis] = 0.0;
            20.0 * across.length()
        }
    };
    n += phase;
    if distortion != 0.0 {
        let fractal = Fractal {
            kind: 3,
            detail: a.float(3).clamp(0.0, 15.0),
            roughness: a.float(5),
            lacunarity: 2.0,
            offset: 0.0,
            gain: 0.0,
            is_normalized: true,
        };
        n += distortion * (2.0 * fractal.brownian((p * a.float(4)).to_array()) - 1.0);
    }
    let turns = n / TAU;
    Vec3A::splat(match a.mode(3) {
        0 => 0.5 + 0.5 * (n - FRAC_PI_2).sin(),
        1 => turns - turns.floor(),
        _ => 2.0 * (turns - (turns + 0.5).floor()).abs(),
    })
}

/// One fold of Magic: which coordinate it replaces, by which function, of which signed sum.
type Fold = (usize, fn(f32) -> f32, [f32; 3]);

#[rustfmt::skip]
const FOLDS: [Fold; 10] = [
    (1, |x| -x.cos(), [1.0, -1.0, 1.0]),
    (0, f32::cos, [1.0, -1.0, -1.0]),
    (2, f32::sin, [-1.0, -1.0, -1.0]),
    (0, |x| -x.cos(), [-1.0, 1.0, -1.0]),
    (1, |x| -x.sin(), [-1.0, 1.0, 1.0]),
    (1, |x| -x.cos(), [-1.0, 1.0, 1.0]),
    (0, f32::cos, [1.0, 1.0, 1.0]),
    (2, f32::sin, [1.0, 1.0, -1.0]),
    (0, |x| -x.cos(), [-1.0, -1.0, 1.0]),
    (1, |x| -x.sin(), [1.0, -1.0, 1.0]),
];

pub fn magic(a: &Args) -> Vec3A {
    let (scale, distortion, depth) = (a.float(1), a.float(2), a.float(3));
    let p = (a.vector(0) * scale).map(|x| x % TAU);
    let mut v = Vec3A::new(
        (5.0 * p.element_sum()).sin(),
        (5.0 * (-p.x + p.y - p.z)).cos(),
        -(5.0 * (-p.x - p.y + p.z)).cos(),
    );
    if depth > 0.0 {
        v *= distortion;
    }
    for (axis, function, signs) in FOLDS.iter().take(depth as usize) {
        v[*axis] = distortion * function(v.dot(Vec3A::from_array(*signs)));
    }
    if distortion != 0.0 {
        v /= 2.0 * distortion;
    }
    let color = 0.5 - v;
    match a.mode(0) {
        0 => color,
        _ => Vec3A::splat(color.element_sum() / 3.0),
    }
}

pub fn checker(a: &Args) -> Vec3A {
    let cell = off_the_edge(a.vector(0) * a.float(3)).floor();
    let is_odd = |x: f32| (x as i32).rem_euclid(2) == 1;
    let is_first = (is_odd(cell.x) == is_odd(cell.y)) == is_odd(cell.z);
    match (a.mode(0), is_first) {
        (0, true) => a.vector(1),
        (0, false) => a.vector(2),
        (_, is_first) => Vec3A::splat(f32::from(is_first)),
    }
}

/// A random number in 0 to 1 for each brick.
fn brick_tint(row: i32, brick: i32) -> f32 {
    let n = (row << 16).wrapping_add(brick & 0xffff) as u32;
    let n = n.wrapping_add(1013) & 0x7fff_ffff;
    let n = (n >> 13) ^ n;
    let cubic = n
        .wrapping_mul(n)
        .wrapping_mul(60_493)
        .wrapping_add(19_990_303);
    let n = n.wrapping_mul(cubic).wrapping_add(1_376_312_589) & 0x7fff_ffff;
    0.5 * (n as f32 / 1_073_741_824.0)
}

pub fn brick(a: &Args) -> Vec3A {
    let [
        _,
        _,
        _,
        _,
        scale,
        mortar_size,
        mortar_smooth,
        bias,
        width,
        row_height,
    ] = a.floats();
    let [shift, shift_rows, squash, squash_rows] = [10, 11, 12, 13].map(|i| a.float(i));
    let p = a.vector(0) * scale;
    let row = (p.y / row_height).floor() as i32;
    let is_row = |every: f32| row % (every as i32).max(1) == 0;
    let (mut width, mut offset) = (width, 0.0);
    if shift_rows >= 1.0 && squash_rows >= 1.0 {
        width *= if is_row(squash_rows) { squash } else { 1.0 };
        offset = if is_row(shift_rows) {
            width * shift
        } else {
            0.0
        };
    }
    let brick = ((p.x + offset) / width).floor() as i32;
    let x = p.x + offset - width * brick as f32;
    let y = p.y - row_height * row as f32;
    let tint = (brick_tint(row, brick) + bias).clamp(0.0, 1.0);
    let edge = x.min(y).min(width - x).min(row_height - y);
    let mortar = if edge >= mortar_size {
        0.0
    } else if mortar_smooth == 0.0 {
        1.0
    } else {
        smoothstep((1.0 - edge / mortar_size) / mortar_smooth)
    };
    match a.mode(0) {
        0 => a
            .vector(1)
            .lerp(a.vector(2), tint)
            .lerp(a.vector(3), mortar),
        _ => Vec3A::splat(mortar),
    }
}

pub fn gradient(a: &Args) -> Vec3A {
    let p = a.vector(0);
    // A little less than one: points of a unit sphere are to give zero in spite of rounding.
    let inside = (0.999_999 - p.length()).max(0.0);
    let share = match a.mode(0) {
        0 => p.x,
        1 => p.x.max(0.0).powi(2),
        2 => smoothstep(p.x),
        3 => 0.5 * (p.x + p.y),
        4 => inside,
        5 => inside * inside,
        _ => p.y.atan2(p.x) / TAU + 0.5,
    };
    Vec3A::splat(share.clamp(0.0, 1.0))
}
