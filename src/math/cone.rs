//! The dual cone: how far light seen from one point can be trusted at another.
//!
//! Source: Zhou and Chen 2015, section 3. Two parallel cones of equal size look from two points
//! towards the same light; the overlap of their bases, as a share of one base, is the probability
//! that a ray drawn towards the one base still meets it when copied to the other point.
//!
//! Symbols: A `solid_angle`, R `distance`, beta half angle, `d` distance of the points across the
//! direction, `g` (Eq. 3), C [`overlap`] (Eq. 2).
//!
//! Departures: `g` is clamped to [0, 1] (the arc cosine has no value beyond), and no input, not
//! even infinite or coincident, gives a NaN.

use std::f32::consts::{FRAC_2_PI, PI, TAU};

use glam::Vec3A;

/// Eq. 2: share of the disk that its copy covers when shifted by `g` of its diameter.
pub fn overlap(g: f32) -> f32 {
    if g >= 1.0 {
        return 0.0;
    }
    let g = g.max(0.0);
    FRAC_2_PI * (g.acos() - g * (1.0 - g * g).sqrt())
}

/// [`overlap`] without an arc cosine, for inner loops; off by at most 3.3e-5.
///
/// `C = (1 - g)^1.5 P(g)`: the power is the exact behaviour at g = 1, P the least-maximum cubic.
pub fn overlap_fast(g: f32) -> f32 {
    let g = g.clamp(0.0, 1.0);
    let rest = 1.0 - g;
    let cubic = 1.000_031_6 + g * (0.226_086_5 + g * (-0.031_473_8 + g * 0.005_803));
    rest * rest.sqrt() * cubic
}

/// Tangent of the half angle of a cone of this solid angle [sr]; infinite from a hemisphere on,
/// where the cone's base covers every shift and [`overlap`] is one.
pub fn tan_beta(solid_angle: f32) -> f32 {
    let one_minus_cos = solid_angle.max(0.0) / TAU;
    if one_minus_cos >= 1.0 {
        return f32::INFINITY;
    }
    (one_minus_cos * (2.0 - one_minus_cos)).sqrt() / (1.0 - one_minus_cos)
}

/// Radius over distance of the flat disk whose area is the solid angle [sr].
///
/// A departure that stays finite up to the whole sphere, where it is 2. It lies below
/// [`tan_beta`] by 0.2 % at 4 pi / 1500 and by 5 % at 4 pi / 30.
pub fn tan_beta_equal_area(solid_angle: f32) -> f32 {
    (solid_angle.max(0.0) / PI).sqrt()
}

/// Eq. 3: `g`, clamped to [0, 1].
///
/// `offset` [m] leads from the one point to the other, `direction` is a unit vector to the light
/// at `distance` [m]. Coincident points give 0; a light without extent gives 1 for all others.
pub fn shift(offset: Vec3A, direction: Vec3A, distance: f32, tan_beta: f32) -> f32 {
    let across = offset - direction.dot(offset) * direction;
    let shift_squared = across.length_squared();
    if shift_squared == 0.0 {
        return 0.0;
    }
    let g = shift_squared.sqrt() / (2.0 * distance * tan_beta);
    // `min` takes the number where g is NaN (0 times infinity): no trust without an extent.
    g.clamp(0.0, 1.0).min(1.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::math::statistics::Random;
    use crate::math::warp::sample_disk;

    fn exact(g: f64) -> f64 {
        std::f64::consts::FRAC_2_PI * (g.acos() - g * (1.0 - g * g).sqrt())
    }

    #[test]
    fn a_shift_without_bound_leaves_nothing() {
        for g in [1.0, 2.0, f32::INFINITY] {
            assert_eq!((overlap(g), overlap_fast(g)), (0.0, 0.0));
        }
    }

    #[test]
    fn overlap_agrees_with_double_precision_and_its_fast_form() {
        for i in 0..=10_000 {
            let g = i as f32 / 10_000.0;
            let c = exact(f64::from(g));
            assert!((f64::from(overlap(g)) - c).abs() < 1e-6, "{g}");
            assert!((f64::from(overlap_fast(g)) - c).abs() < 3.3e-5, "{g}");
        }
    }

    #[test]
    fn overlap_has_its_limits() {
        assert_eq!(overlap(0.0), 1.0);
        for beyond in [1.0, 1.0 + 1e-6, 2.0, f32::INFINITY] {
            assert_eq!(overlap(beyond), 0.0);
            assert_eq!(overlap_fast(beyond.min(1e6)), 0.0);
        }
        let small = 1e-3f32;
        assert!((overlap(small) - (1.0 - 4.0 * small / PI)).abs() < 1e-6);
        let rest = 1e-2f32;
        assert!((overlap(1.0 - rest) / (1.2004 * rest.powf(1.5)) - 1.0).abs() < 0.01);
    }

    /// The share of points of a disk that lie in its shifted copy. Each of 9 estimates may be off
    /// by 4.4 standard deviations: error rate 1e-5 each, two-sided.
    #[test]
    fn overlap_is_the_overlap_of_two_disks() {
        let mut random = Random::new(5);
        let samples = 400_000u32;
        for i in 1..10 {
            let g = i as f32 / 10.0;
            let inside = (0..samples)
                .filter(|_| {
                    let mut point = sample_disk(random.next_2d());
                    point.x -= 2.0 * g;
                    point.length_squared() <= 1.0
                })
                .count();
            let c = exact(f64::from(g));
            let sigma = (c * (1.0 - c) / f64::from(samples)).sqrt();
            let share = inside as f64 / f64::from(samples);
            assert!((share - c).abs() < 4.4 * sigma, "{g}: {share} against {c}");
            assert!((f64::from(overlap(g)) - c).abs() < 1e-6);
        }
    }

    #[test]
    fn tangents_of_known_cones() {
        // A cone of half angle beta has the solid angle 2 pi (1 - cos beta).
        for beta in [1e-3f64, 0.1, 0.5, 1.0, 1.5] {
            let solid_angle = std::f64::consts::TAU * 2.0 * (beta / 2.0).sin().powi(2);
            let tangent = f64::from(tan_beta(solid_angle as f32));
            assert!(
                (tangent / beta.tan() - 1.0).abs() < 2e-5,
                "{beta}: {tangent}"
            );
        }
        assert_eq!(tan_beta(0.0), 0.0);
        assert_eq!(tan_beta(TAU), f32::INFINITY);
        assert_eq!(tan_beta(2.0 * TAU), f32::INFINITY);
        assert_eq!(tan_beta_equal_area(2.0 * TAU), 2.0);
        let ratio = |solid_angle: f32| tan_beta_equal_area(solid_angle) / tan_beta(solid_angle);
        assert!((ratio(2.0 * TAU / 1500.0) - 1.0).abs() < 0.0025);
        assert!((ratio(2.0 * TAU / 30.0) - 1.0).abs() < 0.055);
    }

    /// Numbers from a subnormal to a light year, zero and infinity among them.
    fn lengths() -> impl Strategy<Value = f32> {
        prop_oneof![
            Just(0.0),
            Just(f32::INFINITY),
            Just(f32::from_bits(1)),
            (-40.0f32..16.0).prop_map(|exponent| 10f32.powf(exponent)),
        ]
    }

    fn vectors(size: f32) -> impl Strategy<Value = Vec3A> {
        [-size..=size, -size..=size, -size..=size].prop_map(Vec3A::from_array)
    }

    proptest! {
        /// Any two bit patterns that are numbers: a larger shift never leaves more.
        #[test]
        fn overlap_falls_from_one_to_zero(a: f32, b: f32) {
            prop_assume!(!a.is_nan() && !b.is_nan());
            for c in [overlap as fn(f32) -> f32, overlap_fast] {
                let (low, high) = (c(a.min(b)), c(a.max(b)));
                prop_assert!((0.0..=1.000_04).contains(&low) && high >= 0.0);
                prop_assert!(high <= low + 1e-6, "{a} {b}: {low} {high}");
            }
        }

        #[test]
        fn a_larger_light_has_a_wider_cone(a in lengths(), b in lengths()) {
            for tangent in [tan_beta as fn(f32) -> f32, tan_beta_equal_area] {
                let (low, high) = (tangent(a.min(b)), tangent(a.max(b)));
                prop_assert!(low >= 0.0 && low <= high, "{a} {b}: {low} {high}");
            }
        }

        /// Points up to 1e6 m apart, any distance and any light: the overlap is a probability.
        #[test]
        fn trust_is_a_probability_everywhere(
            offset in vectors(1e6),
            toward in vectors(1.0),
            distance in lengths(),
            solid_angle in lengths(),
        ) {
            let direction = toward.normalize_or(Vec3A::Z);
            for tangent in [tan_beta(solid_angle), tan_beta_equal_area(solid_angle)] {
                let g = shift(offset, direction, distance, tangent);
                prop_assert!((0.0..=1.0).contains(&g), "{g}");
                prop_assert!((0.0..=1.0).contains(&overlap(g)));
            }
        }

        /// Eq. 3 in other words: shrinking the whole world changes no trust, nor does looking from
        /// the other point, nor a step along the direction.
        #[test]
        fn trust_does_not_depend_on_scale_or_order(
            offset in vectors(1.0),
            toward in vectors(1.0),
            distance in 0.1f32..10.0,
            tangent in 0.01f32..2.0,
            scale in prop_oneof![Just(1e-4f32), Just(1e6f32)],
            step in -10.0f32..10.0,
        ) {
            let direction = toward.normalize_or(Vec3A::Z);
            let g = shift(offset, direction, distance, tangent);
            for other in [
                shift(offset * scale, direction, distance * scale, tangent),
                shift(-offset, direction, distance, tangent),
                shift(offset + step * direction, direction, distance, tangent),
            ] {
                // Rounding of the step against the offset, as a share of the cone.
                let error = 1e-5 * (1.0 + step.abs()) / (distance * tangent);
                prop_assert!((g - other).abs() < error, "{g} {other}");
            }
        }
    }

    #[test]
    fn shift_is_finite_for_every_input() {
        let offset = Vec3A::new(0.3, 0.0, 5.0);
        let up = Vec3A::Z;
        assert!((shift(offset, up, 2.0, 0.25) - 0.3).abs() < 1e-6);
        for (distance, tangent, expected) in [
            (0.0, 0.5, 1.0),
            (1.0, 0.0, 1.0),
            (f32::INFINITY, 0.5, 0.0),
            (1.0, f32::INFINITY, 0.0),
            (f32::INFINITY, 0.0, 1.0),
            (0.0, f32::INFINITY, 1.0),
            (1e-30, 1e-30, 1.0),
        ] {
            assert_eq!(shift(offset, up, distance, tangent), expected);
            assert_eq!(shift(Vec3A::ZERO, up, distance, tangent), 0.0);
        }
    }
}
