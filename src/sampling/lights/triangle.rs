//! Directions to a triangle, each as likely as any other.
//!
//! Sources: Arvo, "Stratified Sampling of Spherical Triangles", SIGGRAPH 1995, whose names these are; Van
//! Oosterom and Strackee, "The Solid Angle of a Plane Triangle", IEEE Transactions on Biomedical Engineering
//! 30(2), 1983.

use glam::{Vec2, Vec3A};

use super::LARGE;

/// A triangle as a point sees it.
pub struct SphericalTriangle {
    /// From the point.
    corners: [Vec3A; 3],
    /// The same, of length one.
    directions: [Vec3A; 3],
    /// Solid angle [sr].
    pub solid_angle: f32,
}

impl SphericalTriangle {
    /// One of these corners from the point, unless it looks small from there or is seen edge-on.
    pub fn large(corners: [Vec3A; 3]) -> Option<Self> {
        Self::above(LARGE, corners)
    }

    /// One of at least about this solid angle [sr].
    fn above(least: f32, corners: [Vec3A; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        let lengths = corners.map(Vec3A::length);
        let volume = a.dot(b.cross(c)).abs();
        let [la, lb, lc] = lengths;
        let rest = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        // Both are in proportion to the sine and the cosine of half the solid angle.
        let is_large = volume > 0.5 * least * rest && volume > 1e-6 * la * lb * lc;
        is_large.then(|| Self {
            corners,
            directions: [a / la, b / lb, c / lc],
            solid_angle: 2.0 * volume.atan2(rest),
        })
    }

    /// Barycentric coordinates of the second and third corner.
    pub fn sample(&self, u: [f32; 2]) -> Vec2 {
        self.on_plane(self.direction(u))
    }

    fn direction(&self, [u, v]: [f32; 2]) -> Vec3A {
        let [a, b, c] = self.directions;
        let (beside_b, beside_c) = (a.cross(b), a.cross(c));
        // The angle at `a`.
        let scale = (beside_b.length_squared() * beside_c.length_squared()).sqrt();
        let (sin_alpha, cos_alpha) = (
            a.dot(b.cross(c)).abs() / scale,
            beside_b.dot(beside_c) / scale,
        );
        // The part of the triangle up to a point on the side from `a` to `c` has `u` of the whole; sine and
        // cosine are those of its solid angle without that angle.
        let (sin, cos) = (u * self.solid_angle).sin_cos();
        let s = sin * cos_alpha - cos * sin_alpha;
        let t = cos * cos_alpha + sin * sin_alpha;
        let p = t - cos_alpha;
        let q = s + sin_alpha * a.dot(b);
        let cos = ((q * t - p * s) * cos_alpha - q) / ((q * s + p * t) * sin_alpha);
        let cos = if cos.is_finite() {
            cos.clamp(-1.0, 1.0)
        } else {
            1.0
        };
        let corner = towards(a, c, cos);
        towards(b, corner, 1.0 - v * (1.0 - corner.dot(b)))
    }

    /// Where a direction meets the triangle's plane.
    fn on_plane(&self, direction: Vec3A) -> Vec2 {
        let [a, b, c] = self.corners;
        let parts = Vec3A::new(
            direction.dot(b.cross(c)),
            direction.dot(c.cross(a)),
            direction.dot(a.cross(b)),
        );
        let parts = (parts * a.dot(b.cross(c)).signum()).max(Vec3A::ZERO);
        let shares = parts / parts.element_sum().max(f32::MIN_POSITIVE);
        Vec2::new(shares.y, shares.z)
    }
}

/// The direction on the arc from one to another whose cosine with the first is this.
fn towards(from: Vec3A, to: Vec3A, cos: f32) -> Vec3A {
    let aside = (to - to.dot(from) * from).normalize_or_zero();
    cos * from + (1.0 - cos * cos).max(0.0).sqrt() * aside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::Random;

    /// Parts of a triangle are found as often as they are large, also where it fills half the view.
    #[test]
    fn equal_solid_angles_are_found_equally_often() {
        let wide = [[-1.0, -1.0, 0.2], [1.5, -0.5, 0.2], [0.0, 2.0, 0.2]];
        let near = [[-1.0, -1.0, 0.01], [1.5, -0.5, 0.01], [0.0, 2.0, 0.01]];
        let aside = [[0.2, 0.1, 0.3], [2.0, 0.3, 0.8], [0.5, 1.5, 1.0]];
        for corners in [wide, near, aside] {
            let [a, b, c] = corners.map(Vec3A::from);
            let whole = SphericalTriangle::large([a, b, c]).unwrap();
            // A quarter of the plane's triangle: by how often it should be found.
            let [ab, ac] = [0.5 * (a + b), 0.5 * (a + c)];
            let part = SphericalTriangle::above(0.0, [a, ab, ac]).unwrap();
            let expected = part.solid_angle / whole.solid_angle;
            let mut random = Random::new(7);
            let count = 100_000;
            let found = (0..count)
                .filter(|_| whole.sample(random.next_2d()).element_sum() < 0.5)
                .count() as f32
                / count as f32;
            let sigma = (expected * (1.0 - expected) / count as f32).sqrt();
            assert!((found - expected).abs() < 5.0 * sigma, "{found} {expected}");
        }
    }

    #[test]
    fn an_octant_of_the_sphere_is_half_a_pi() {
        let octant = SphericalTriangle::large([Vec3A::X, Vec3A::Y, Vec3A::Z]).unwrap();
        assert!((octant.solid_angle - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
        let middle = octant.direction([0.5, 0.5]);
        assert!((middle.x - middle.z).abs() < 1e-6, "{middle}");
    }

    #[test]
    fn what_looks_small_or_lies_edge_on_is_left_to_its_area() {
        let at = |height: f32| [Vec3A::X, Vec3A::Y, -Vec3A::X].map(|p| p + height * Vec3A::Z);
        assert!(SphericalTriangle::large(at(1.0)).is_some());
        assert!(SphericalTriangle::large(at(10.0)).is_none());
        assert!(SphericalTriangle::large([Vec3A::X, Vec3A::Y, Vec3A::X + Vec3A::Y]).is_none());
    }
}
