//! The watertight triangle test: the scalar form, which is also the oracle of the vector forms.

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

/// Where a ray meets a triangle: parameter, and barycentrics of vertices 1 and 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meeting {
    pub t: f32,
    pub u: f32,
    pub v: f32,
}

impl Shear {
    pub fn new(ray: &Ray) -> Self {
        let d = ray.direction.to_array();
        let z = largest_axis(ray.direction);
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        Self {
            origin: ray.origin.to_array(),
            axes,
            shear: [d[axes[0]] / d[z], d[axes[1]] / d[z], 1.0 / d[z]],
            t_min: ray.t_min,
        }
    }

    /// The triangle's meeting with the ray in `[t_min, t_max]`, from either side.
    #[cfg(test)]
    pub fn meet(&self, triangle: [glam::Vec3; 3], t_max: f32) -> Option<Meeting> {
        let [a, b, c] = triangle.map(|p| self.transform(p.to_array()));
        let mut edges = [
            c[0] * b[1] - c[1] * b[0],
            a[0] * c[1] - a[1] * c[0],
            b[0] * a[1] - b[1] * a[0],
        ];
        if edges.contains(&0.0) {
            edges = exact_edges([a[0], b[0], c[0]], [a[1], b[1], c[1]]);
        }
        let [u, v, w] = edges;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let t = (u * a[2] + v * b[2] + w * c[2]) / determinant;
        (t >= self.t_min && t <= t_max).then(|| Meeting {
            t,
            u: v / determinant,
            v: w / determinant,
        })
    }

    /// A vertex in the space in which the ray starts at the origin and runs along +Z.
    #[cfg(test)]
    fn transform(&self, vertex: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.axes.map(|k| vertex[k] - self.origin[k]);
        [
            x - self.shear[0] * z,
            y - self.shear[1] * z,
            self.shear[2] * z,
        ]
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
pub fn largest_axis(v: Vec3A) -> usize {
    let v = v.abs();
    if v.z >= v.x && v.z >= v.y {
        2
    } else if v.y >= v.x {
        1
    } else {
        0
    }
}
