//! What the operations compute, one small function each.
//!
//! Nodes do what Blender's manual and the OSL and SVM sources of Cycles say they do; where a function
//! departs from that, it says so.

pub(super) mod closures;
pub(super) mod color;
pub(super) mod convert;
mod hash;
pub(super) mod input;
pub(super) mod layers;
pub(super) mod noise;
pub(super) mod normal;
pub(super) mod pattern;
pub(super) mod texture;
pub(super) mod vector;
pub(super) mod voronoi;

pub use texture::TABLE_SIZE;

use glam::Vec3A;

/// The quotient, zero where there is none.
fn divided(a: f32, b: f32) -> f32 {
    if b == 0.0 { 0.0 } else { a / b }
}

/// [`divided`] for each component.
fn divided3(a: Vec3A, b: Vec3A) -> Vec3A {
    each2(a, b, divided)
}

fn each2(a: Vec3A, b: Vec3A, f: impl Fn(f32, f32) -> f32) -> Vec3A {
    Vec3A::new(f(a.x, b.x), f(a.y, b.y), f(a.z, b.z))
}

/// The first column of a table of named functions.
const fn names<F: Copy, const N: usize>(table: &[(&'static str, F); N]) -> [&'static str; N] {
    let mut names = [""; N];
    let mut row = 0;
    while row < N {
        names[row] = table[row].0;
        row += 1;
    }
    names
}

/// 3 x^2 - 2 x^3 within 0 to 1.
fn smoothstep(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// 6 x^5 - 15 x^4 + 10 x^3 within 0 to 1.
fn smootherstep(x: f32) -> f32 {
    quintic(x.clamp(0.0, 1.0))
}

/// Perlin's fade curve.
fn quintic(x: f32) -> f32 {
    x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + t * (b - a)
}
