//! Numbers: conversions, Math, Clamp, Map Range, Mix.

use glam::Vec3A;

use super::super::operation::Args;
use super::{divided, divided3, names, smootherstep, smoothstep};
use crate::math;

pub fn luminance(a: &Args) -> Vec3A {
    Vec3A::splat(math::luminance(a.vector(0)))
}

pub fn average(a: &Args) -> Vec3A {
    Vec3A::splat(a.vector(0).element_sum() * (1.0 / 3.0))
}

pub fn add(a: &Args) -> Vec3A {
    a.vector(0) + a.vector(1)
}

pub fn multiply(a: &Args) -> Vec3A {
    a.vector(0) * a.vector(1)
}

pub fn saturate(a: &Args) -> Vec3A {
    a.vector(0).clamp(Vec3A::ZERO, Vec3A::ONE)
}

pub fn one_minus(a: &Args) -> Vec3A {
    1.0 - a.vector(0)
}

type Ternary = fn(f32, f32, f32) -> f32;

/// The Math node's operations by Blender's identifiers.
#[rustfmt::skip]
const MATH: [(&str, Ternary); 41] = [
    ("ADD", |a, b, _| a + b),
    ("SUBTRACT", |a, b, _| a - b),
    ("MULTIPLY", |a, b, _| a * b),
    ("DIVIDE", |a, b, _| divided(a, b)),
    ("MULTIPLY_ADD", |a, b, c| a * b + c),
    ("POWER", |a, b, _| power(a, b)),
    ("LOGARITHM", |a, b, _| if a > 0.0 && b > 0.0 { divided(a.ln(), b.ln()) } else { 0.0 }),
    ("SQRT", |a, _, _| a.max(0.0).sqrt()),
    ("INVERSE_SQRT", |a, _, _| if a > 0.0 { 1.0 / a.sqrt() } else { 0.0 }),
    ("ABSOLUTE", |a, _, _| a.abs()),
    ("EXPONENT", |a, _, _| a.exp()),
    ("MINIMUM", |a, b, _| a.min(b)),
    ("MAXIMUM", |a, b, _| a.max(b)),
    ("LESS_THAN", |a, b, _| f32::from(a < b)),
    ("GREATER_THAN", |a, b, _| f32::from(a > b)),
    ("SIGN", |a, _, _| sign(a)),
    ("COMPARE", |a, b, c| f32::from((a - b).abs() <= c.max(f32::EPSILON))),
    ("SMOOTH_MIN", smooth_min),
    ("SMOOTH_MAX", |a, b, c| -smooth_min(-a, -b, c)),
    ("ROUND", |a, _, _| (a + 0.5).floor()),
    ("FLOOR", |a, _, _| a.floor()),
    ("CEIL", |a, _, _| a.ceil()),
    ("TRUNC", |a, _, _| a.trunc()),
    ("FRACT", |a, _, _| a - a.floor()),
    ("MODULO", |a, b, _| modulo(a, b)),
    ("FLOORED_MODULO", |a, b, _| if b == 0.0 { 0.0 } else { a - (a / b).floor() * b }),
    ("WRAP", wrap),
    ("SNAP", |a, b, _| divided(a, b).floor() * b),
    ("PINGPONG", |a, b, _| pingpong(a, b)),
    ("SINE", |a, _, _| a.sin()),
    ("COSINE", |a, _, _| a.cos()),
    ("TANGENT", |a, _, _| a.tan()),
    ("ARCSINE", |a, _, _| a.clamp(-1.0, 1.0).asin()),
    ("ARCCOSINE", |a, _, _| a.clamp(-1.0, 1.0).acos()),
    ("ARCTANGENT", |a, _, _| a.atan()),
    ("ARCTAN2", |a, b, _| a.atan2(b)),
    ("SINH", |a, _, _| a.sinh()),
    ("COSH", |a, _, _| a.cosh()),
    ("TANH", |a, _, _| a.tanh()),
    ("RADIANS", |a, _, _| a.to_radians()),
    ("DEGREES", |a, _, _| a.to_degrees()),
];

pub const MATH_NAMES: [&str; 41] = names(&MATH);

pub fn math(a: &Args) -> Vec3A {
    let [x, y, z] = a.floats();
    let result = MATH[a.mode(0)].1(x, y, z);
    Vec3A::splat(if a.is_on(1) {
        result.clamp(0.0, 1.0)
    } else {
        result
    })
}

/// A negative base has powers with whole exponents only.
pub fn power(a: f32, b: f32) -> f32 {
    if a < 0.0 && b != b.trunc() {
        0.0
    } else {
        a.powf(b)
    }
}

pub fn sign(a: f32) -> f32 {
    if a == 0.0 { 0.0 } else { a.signum() }
}

pub fn modulo(a: f32, b: f32) -> f32 {
    if b == 0.0 { 0.0 } else { a % b }
}

pub fn wrap(value: f32, max: f32, min: f32) -> f32 {
    let range = max - min;
    if range == 0.0 {
        min
    } else {
        value - range * ((value - min) / range).floor()
    }
}

fn pingpong(a: f32, b: f32) -> f32 {
    if b == 0.0 {
        return 0.0;
    }
    let turns = (a - b) / (2.0 * b);
    ((turns - turns.floor()) * 2.0 * b - b).abs()
}

/// A minimum whose crease is rounded over the width `k`.
fn smooth_min(a: f32, b: f32, k: f32) -> f32 {
    if k == 0.0 {
        return a.min(b);
    }
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * h * k / 6.0
}

pub fn clamp(a: &Args) -> Vec3A {
    let [value, min, max] = a.floats();
    let is_range = a.mode(0) == 1;
    let (min, max) = if is_range && min > max {
        (max, min)
    } else {
        (min, max)
    };
    // As Cycles: the maximum wins where the minimum is above it.
    Vec3A::splat(value.max(min).min(max))
}

pub fn map_range(a: &Args) -> Vec3A {
    let [value, from_min, from_max, to_min, to_max, steps] = std::array::from_fn(|i| a.vector(i));
    let is_float = a.mode(2) == 0;
    if is_float && from_min.x == from_max.x {
        return Vec3A::ZERO;
    }
    let share = divided3(value - from_min, from_max - from_min);
    let stepped = |share: f32, steps: f32| {
        if steps > 0.0 {
            (share * (steps + 1.0)).floor() / steps
        } else {
            0.0
        }
    };
    let factor = match a.mode(0) {
        0 => share,
        1 => super::each2(share, steps, stepped),
        2 => share.map(smoothstep),
        _ => share.map(smootherstep),
    };
    let result = to_min + factor * (to_max - to_min);
    if a.is_on(1) {
        result.clamp(to_min.min(to_max), to_min.max(to_max))
    } else {
        result
    }
}

pub fn mix(a: &Args) -> Vec3A {
    let [factor, first, second] = std::array::from_fn(|i| a.vector(i));
    let factor = if a.is_on(0) {
        factor.clamp(Vec3A::ZERO, Vec3A::ONE)
    } else {
        factor
    };
    first * (1.0 - factor) + second * factor
}
