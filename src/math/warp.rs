//! Warps of the unit square: every `sample_x` stands beside its `pdf_x`.
//!
//! Directions are in a local basis with z along the axis; see [`Frame`](super::Frame). Random
//! numbers lie in [0, 1).

use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, TAU};

use glam::{Vec2, Vec3A};

/// A point of the unit disk, uniform in area; keeps neighbouring points neighbours.
///
/// Source: Shirley and Chiu, "A Low Distortion Map Between Disk and Square", 1997.
pub fn sample_disk(u: [f32; 2]) -> Vec2 {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return Vec2::ZERO;
    }
    let (radius, angle) = if a.abs() > b.abs() {
        (a, FRAC_PI_4 * (b / a))
    } else {
        (b, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (a / b))
    };
    radius * Vec2::from_angle(angle)
}

/// Density of [`sample_disk`] per unit of area.
pub fn pdf_disk() -> f32 {
    FRAC_1_PI
}

/// A direction of the upper hemisphere with a density proportional to its cosine.
pub fn sample_cosine_hemisphere(u: [f32; 2]) -> Vec3A {
    let point = sample_disk(u);
    let z = (1.0 - point.length_squared()).max(0.0).sqrt();
    Vec3A::new(point.x, point.y, z)
}

/// Density of [`sample_cosine_hemisphere`] per steradian.
pub fn pdf_cosine_hemisphere(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// A direction of the sphere, uniform in solid angle.
pub fn sample_sphere(u: [f32; 2]) -> Vec3A {
    sample_cone(2.0, u)
}

/// Density of [`sample_sphere`] per steradian.
pub fn pdf_sphere() -> f32 {
    0.5 / TAU
}

/// A direction within a cone about z, uniform in solid angle.
///
/// The cone is given by `1 - cos(half angle)`: for a sun the cosine itself has no digits left.
pub fn sample_cone(one_minus_cos_max: f32, u: [f32; 2]) -> Vec3A {
    let one_minus_cos = u[0] * one_minus_cos_max;
    let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    let around = sin * Vec2::from_angle(TAU * u[1]);
    Vec3A::new(around.x, around.y, 1.0 - one_minus_cos)
}

/// Density of [`sample_cone`] per steradian.
pub fn pdf_cone(one_minus_cos_max: f32) -> f32 {
    1.0 / (TAU * one_minus_cos_max)
}

/// `1 - cos x` from `sin^2 x` for x up to a right angle, without cancellation.
pub fn one_minus_cos_from_sin_squared(sin_squared: f32) -> f32 {
    sin_squared / (1.0 + (1.0 - sin_squared).max(0.0).sqrt())
}

/// Barycentric coordinates of the second and third vertex, uniform in area.
///
/// Source: Heitz, "A Low-Distortion Map Between Triangle and Square", 2019.
pub fn sample_triangle(u: [f32; 2]) -> Vec2 {
    let [x, y] = u;
    if y > x {
        Vec2::new(0.5 * x, y - 0.5 * x)
    } else {
        Vec2::new(x - 0.5 * y, 0.5 * y)
    }
}

/// Density of [`sample_triangle`] per square metre of a triangle of this area [m^2].
pub fn pdf_triangle(area: f32) -> f32 {
    1.0 / area
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::{DirectionTest, MAX_SCORE, Random, chi_square_score};

    #[test]
    fn disk_is_uniform_in_polar_cells() {
        let mut random = Random::new(2);
        let mut observed = vec![0.0; 128];
        for _ in 0..100_000 {
            let point = sample_disk(random.next_2d());
            let turn = point.to_angle() / TAU;
            let ring = (point.length_squared() * 8.0) as usize;
            let sector = ((turn - turn.floor()) * 16.0) as usize;
            observed[ring.min(7) * 16 + sector.min(15)] += 1.0;
        }
        let expected = vec![100_000.0 * f64::from(pdf_disk() * std::f32::consts::PI) / 128.0; 128];
        assert!(chi_square_score(&observed, &expected) < MAX_SCORE);
    }

    #[test]
    fn cosine_hemisphere_follows_its_pdf() {
        let score = DirectionTest::sphere(Vec3A::Z).score(
            |random| Some(sample_cosine_hemisphere(random.next_2d())),
            |direction| pdf_cosine_hemisphere(direction.z),
        );
        assert!(score < MAX_SCORE, "{score}");
    }

    #[test]
    fn sphere_follows_its_pdf() {
        let score = DirectionTest::sphere(Vec3A::X).score(
            |random| Some(sample_sphere(random.next_2d())),
            |_| pdf_sphere(),
        );
        assert!(score < MAX_SCORE, "{score}");
    }

    #[test]
    fn cone_follows_its_pdf_from_a_star_to_a_hemisphere() {
        for half_angle in [1e-4f32, 0.004_65, 0.3, std::f32::consts::FRAC_PI_2] {
            let one_minus_cos = one_minus_cos_from_sin_squared(half_angle.sin().powi(2));
            let test = DirectionTest {
                one_minus_cos_max: f64::from(one_minus_cos) * 1.001,
                ..DirectionTest::sphere(Vec3A::Z)
            };
            let score = test.score(
                |random| Some(sample_cone(one_minus_cos, random.next_2d())),
                |d| {
                    let inside = f64::from((d - Vec3A::Z).length_squared()) / 2.0
                        <= f64::from(one_minus_cos) * 1.0005;
                    if inside { pdf_cone(one_minus_cos) } else { 0.0 }
                },
            );
            assert!(score < MAX_SCORE, "{half_angle}: {score}");
        }
    }

    #[test]
    fn triangle_is_uniform() {
        let mut random = Random::new(4);
        let mut observed = vec![0.0; 100];
        for _ in 0..100_000 {
            let b = sample_triangle(random.next_2d());
            assert!(b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0 + 1e-6);
            // Fold the triangle into cells of equal area: rows of equal area, then along the row.
            let rest = 1.0 - b.x;
            let row = ((1.0 - rest * rest) * 10.0) as usize;
            let along = (b.y / rest.max(1e-9) * 10.0) as usize;
            observed[row.min(9) * 10 + along.min(9)] += 1.0;
        }
        let expected = vec![100_000.0 * f64::from(pdf_triangle(0.5)) * 0.005; 100];
        assert!(chi_square_score(&observed, &expected) < MAX_SCORE);
    }
}
