//! What the watertight triangle test knows of a ray, and its rare case.

use crate::math::Ray;
use glam::Vec3A;

/// A ray as the triangle test wants it: a shear and scale that take its direction to +Z.
///
/// Symbols of Woop et al. 2013, Section 3.1: `axes` = (kx, ky, kz), `shear` = (Sx, Sy, Sz).
#[derive(Debug, Clone, Copy)]
pub struct Shear {
    pub origin: [f32; 3],
    /// The axis of the direction's largest component last, the other two in cyclic order.
    pub axes: [usize; 3],
    pub shear: [f32; 3],
    pub t_min: f32,
}

impl Shear {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];
        let d = ray.direction.to_array();
        let axes = AXES[largest_axis(ray.direction)];
        let [x, y, z] = axes.map(|axis| d[axis]);
        Self {
            origin: ray.origin.to_array(),
            axes,
            shear: (Vec3A::new(x, y, 1.0) / z).to_array(),
            t_min: ray.t_min,
        }
    }
}

/// The edge functions U, V, W of a sheared triangle, with the sign they have in exact arithmetic.
///
/// Needed where single precision says zero: two products of single-precision numbers are exact in
/// double precision, so their difference has the right sign, and zero means "on the edge".
pub fn exact_edges(x: [f32; 3], y: [f32; 3]) -> [f32; 3] {
    let edge = |i: usize, j: usize| {
        (f64::from(x[i]) * f64::from(y[j]) - f64::from(y[i]) * f64::from(x[j])) as f32
    };
    [edge(2, 1), edge(0, 2), edge(1, 0)]
}

/// The axis of the largest component, the later one of equals.
#[inline(always)]
fn largest_axis(v: Vec3A) -> usize {
    let v = v.abs();
    // Without branches: which axis it is nobody can predict.
    let largest = v.cmpge(Vec3A::splat(v.max_element())).bitmask();
    (largest | 1).ilog2() as usize
}
