//! Light that leaves by its distance alone from where it entered.
//!
//! The profile is that of Christensen and Burley, "Approximate Reflectance Profiles for Efficient
//! Subsurface Scattering", 2015. Places are found after King, Kulla, Conty and Fajardo, "BSSRDF
//! Importance Sampling", 2013: a ray probes the body through a disk about the entrance, along its
//! normal or one of two tangents, and the three are weighed against each other. Of the places that
//! the ray goes through one is chosen.
//!
//! As in Cycles the width of the profile is a share of the radius alone, the same for every colour:
//! its fit of the paper's Eq. 6 has no caller. As there, too, places are weighed by the profile over
//! the density of the drawn radius, as if both distances went with circles of the same size: bodies
//! gain some light where their surface turns away from the disk.
//!
//! # Departures from Cycles
//! All places of a probe may be chosen, not four of them.

use std::f32::consts::TAU;

use glam::{Vec3A, Vec3Swizzles};

use super::{Body, Exit, Subsurface, WIDTH, choose_channel};
use crate::math::{Frame, Ray};
use crate::sampling::Walk;

/// Widths of the profile within which light leaves: what the paper has beyond, 0.4 %, is spread over
/// the rest, as in Cycles.
const REACH: f32 = 16.0;

/// Share of the light that the paper's profile has within [`REACH`].
const WITHIN_REACH: f32 = 0.996_379;

/// How often a probe goes along each axis of the frame about the normal.
const SHARES: Vec3A = Vec3A::new(0.25, 0.25, 0.5);

/// A ray through the disk.
struct Probe {
    ray: Ray,
    /// Distance [m] from the disk's centre.
    radius: f32,
    /// The axis that it goes along.
    axis: usize,
}

/// Where light that enters here leaves.
pub(super) fn scatter<B: Body>(
    below: &Subsurface,
    body: &B,
    numbers: &mut Walk,
) -> Option<Exit<B::Hit>> {
    let frame = frame_about(body.geometric_normal());
    let probe = below.probe(body, &frame, numbers)?;
    let pdf = below.profile(probe.radius).dot(below.spreads()) / below.spreads().element_sum();
    let (mut choice, mut total, mut chosen) = (numbers.next(), 0.0, None);
    for crossing in body.cross(&probe.ray) {
        let place = probe.ray.at(crossing.t);
        let found = SHARES * frame.to_local(crossing.normal).abs();
        // The power heuristic's weight, over how likely this axis finds the place.
        let weight = found[probe.axis] / found.length_squared();
        let carried = below.profile(place.distance(body.position())) * (weight / pdf);
        let share = carried.element_sum();
        if !(share > 0.0) || !share.is_finite() {
            continue;
        }
        total += share;
        // Each place takes the place of those before it with its share of the sum so far.
        let probability = share / total;
        if choice < probability {
            chosen = Some((carried / share, place, crossing));
            choice /= probability;
        } else {
            choice = (choice - probability) / (1.0 - probability);
        }
    }
    let (color, place, crossing) = chosen?;
    let ray = Ray::new(place - crossing.normal, crossing.normal);
    Some(Exit {
        ray: ray.at_time(probe.ray.time),
        hit: crossing.hit,
        carried: color * total,
    })
}

/// The tangents are Cycles', as the weights depend on them a little: one is at right angles to the
/// diagonal of the axes.
fn frame_about(normal: Vec3A) -> Frame {
    Frame::from_normal_and_tangent(normal, normal.cross(Vec3A::ONE))
}

impl Subsurface {
    /// Width `d` of each channel's profile [m].
    fn width(&self) -> Vec3A {
        WIDTH * self.radius
    }

    /// Share of the light that leaves per metre of distance.
    fn profile(&self, distance: f32) -> Vec3A {
        let width = self.width().max(Vec3A::splat(f32::MIN_POSITIVE));
        let x = distance / width;
        let density = 0.25 * ((-x).exp() + (x / -3.0).exp()) / (WITHIN_REACH * width);
        Vec3A::select(
            x.cmplt(Vec3A::splat(REACH)),
            density * self.spreads(),
            Vec3A::ZERO,
        )
    }

    /// A ray at a distance from the entrance that the profile of a channel draws; it covers the ball
    /// that the channel reaches.
    fn probe<B: Body>(&self, body: &B, frame: &Frame, numbers: &mut Walk) -> Option<Probe> {
        let (near, turn) = (numbers.next(), TAU * numbers.next());
        let (channel, _) = choose_channel(self.spreads(), numbers.next())?;
        let (axis, _) = choose_channel(SHARES, numbers.next())?;
        let width = self.width()[channel];
        let radius = width * distance_within(WITHIN_REACH * near);
        let height = ((REACH * width).powi(2) - radius * radius).max(0.0).sqrt();
        let upright = Vec3A::new(radius * turn.cos(), radius * turn.sin(), height);
        let (start, along) = match axis {
            0 => (upright.zxy(), Vec3A::NEG_X),
            1 => (upright.yzx(), Vec3A::NEG_Y),
            _ => (upright, Vec3A::NEG_Z),
        };
        let ray = Ray {
            origin: body.position() + frame.to_world(start),
            t_min: 0.0,
            t_max: 2.0 * height,
            ..body.ray_into(frame.to_world(along))
        };
        Some(Probe { ray, radius, axis })
    }
}

/// Distance, in widths, within which this share of the light leaves, which is
/// `1 - exp(-x) / 4 - 3 exp(-x / 3) / 4`: a cubic of `t = exp(-x / 3)` without its square, of which
/// `2 sinh` is the solution.
fn distance_within(share: f32) -> f32 {
    let t = 2.0 * ((2.0 * (1.0 - share)).asinh() / 3.0).sinh();
    (-3.0 * t.ln()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::Crossing;
    use super::*;
    use crate::math::statistics::{MAX_SCORE, Random, chi_square_score};
    use crate::sampling::Sampler;
    use crate::shader::SubsurfaceMethod as Method;

    const COUNT: u32 = 200_000;

    /// Widths of 1, 0.5 and 0.2 m.
    fn below() -> Subsurface {
        Subsurface {
            weight: Vec3A::splat(0.5),
            color: Vec3A::splat(0.5),
            radius: Vec3A::new(1.0, 0.5, 0.2) / WIDTH,
            anisotropy: 0.0,
            ior: 1.4,
            alpha: 1.0,
            normal: Vec3A::Z,
            incoming: Vec3A::Z,
            method: Method::Burley,
        }
    }

    /// Planes with these normals and distances from the origin, where light enters along -z.
    struct Planes<'a>(&'a [(Vec3A, f32)]);

    impl Body for Planes<'_> {
        type Hit = usize;

        fn position(&self) -> Vec3A {
            Vec3A::ZERO
        }

        fn geometric_normal(&self) -> Vec3A {
            Vec3A::Z
        }

        fn ray_into(&self, direction: Vec3A) -> Ray {
            Ray::new(Vec3A::ZERO, direction)
        }

        fn meet(&self, _: &Ray) -> Option<(f32, usize)> {
            None
        }

        fn cross(&self, ray: &Ray) -> Vec<Crossing<usize>> {
            let mut crossings = Vec::new();
            for (hit, &(normal, distance)) in self.0.iter().enumerate() {
                let t = (distance - ray.origin.dot(normal)) / ray.direction.dot(normal);
                if t >= ray.t_min && t <= ray.t_max {
                    crossings.push(Crossing { t, normal, hit });
                }
            }
            crossings
        }
    }

    /// By plane and channel the share of the light that leaves, and its standard error.
    fn shares(planes: &[(Vec3A, f32)], below: &Subsurface) -> Vec<[(f64, f64); 3]> {
        let mut sums = vec![[(0.0, 0.0); 3]; planes.len()];
        for i in 0..COUNT {
            let mut numbers = Sampler::new(3, 1, [i, 0], 0, 1).walk(0);
            if let Some(exit) = scatter(below, &Planes(planes), &mut numbers) {
                for (sum, carried) in sums[exit.hit].iter_mut().zip(exit.carried.to_array()) {
                    let carried = f64::from(carried);
                    *sum = (sum.0 + carried, sum.1 + carried * carried);
                }
            }
        }
        let count = f64::from(COUNT);
        for (sum, squares) in sums.iter_mut().flatten() {
            *sum /= count;
            *squares = ((*squares / count - *sum * *sum) / count).sqrt();
        }
        sums
    }

    /// Midpoint rule.
    fn integral(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
        const STEPS: u32 = 4000;
        let step = (to - from) / f64::from(STEPS);
        let values = (0..STEPS).map(|i| f(from + step * (f64::from(i) + 0.5)));
        step * values.sum::<f64>()
    }

    /// The paper's Eq. 3 without the albedo, times the length of a circle, cut off at 16 widths.
    fn expected_profile(width: f64, distance: f64) -> f64 {
        let x = distance / width;
        let cut = 1.0 - (-16f64).exp() / 4.0 - 0.75 * (-16f64 / 3.0).exp();
        match x < 16.0 {
            true => ((-x).exp() + (-x / 3.0).exp()) / (4.0 * width * cut),
            false => 0.0,
        }
    }

    #[test]
    fn the_profile_integrates_to_one_and_is_that_of_the_paper() {
        let below = below();
        for (channel, width) in [1.0, 0.5, 0.2].into_iter().enumerate() {
            let profile = |x: f64| f64::from(below.profile(x as f32)[channel]);
            let sum = integral(0.0, 16.0 * width, profile);
            assert!((sum - 1.0).abs() < 1e-4, "{channel}: {sum}");
            for x in [0.0, 0.1, 1.0, 3.0, 17.0] {
                let off = profile(x) - expected_profile(width, x);
                assert!(off.abs() < 1e-5, "{channel} {x}: {off}");
            }
        }
    }

    /// The distribution function undoes the distance.
    #[test]
    fn distances_hold_their_share_of_the_light() {
        for i in 0..10_000 {
            let share = f64::from(i) / 10_000.0;
            let x = f64::from(distance_within(share as f32));
            let within = 1.0 - 0.25 * (-x).exp() - 0.75 * (-x / 3.0).exp();
            assert!((within - share).abs() < 1e-6, "{share}: {x}");
        }
        assert!((distance_within(WITHIN_REACH) - REACH).abs() < 1e-3);
    }

    /// Drawn distances by a hundred cells of the profile; the score's error rate is that of all
    /// chi-square tests.
    #[test]
    fn drawn_distances_follow_the_profile() {
        let mut random = Random::new(11);
        let (mut observed, count) = (vec![0.0; 100], 100_000);
        for _ in 0..count {
            let x = distance_within(WITHIN_REACH * random.next());
            observed[((x / REACH * 100.0) as usize).min(99)] += 1.0;
        }
        let cell = |i: u32| {
            let from = 0.16 * f64::from(i);
            f64::from(count) * integral(from, from + 0.16, |x| expected_profile(1.0, x))
        };
        let expected: Vec<f64> = (0..100).map(cell).collect();
        let score = chi_square_score(&observed, &expected);
        assert!(score < MAX_SCORE, "{score}");
    }

    /// Five standard errors, which are 0.4 % here: error rate 6e-7 a comparison, three comparisons.
    #[test]
    fn a_plane_loses_nothing() {
        let [shares] = shares(&[(Vec3A::Z, 0.0)], &below())[..] else {
            panic!("one plane");
        };
        for (mean, error) in shares {
            assert!((mean - 1.0).abs() < 5.0 * error, "{mean} +- {error}");
            assert!(error < 4e-3, "{error}");
        }
    }

    /// Beside the plane one that lies 0.3 m below it and a wall 0.4 m away: only probes along one axis
    /// meet each, and what leaves is the profile over the disk. Five standard errors, error rate 6e-7 a
    /// comparison, nine comparisons.
    #[test]
    fn planes_apart_share_what_their_distances_say() {
        let tangent = frame_about(Vec3A::Z).to_world(Vec3A::X);
        let planes = [(Vec3A::Z, 0.0), (Vec3A::NEG_Z, 0.3), (tangent, 0.4)];
        let found = shares(&planes, &below());
        for ((_, distance), found) in planes.into_iter().zip(found) {
            let apart = f64::from(distance);
            for ((mean, error), width) in found.into_iter().zip([1.0, 0.5, 0.2]) {
                let over_disk = |r: f64| expected_profile(width, r.hypot(apart));
                let expected = integral(0.0, 16.0 * width, over_disk);
                let off = (mean - expected).abs();
                assert!(
                    off < 5.0 * error,
                    "{apart} {width}: {mean} +- {error}, {expected}"
                );
            }
        }
    }

    /// A plane that leans against the normal is met along all three axes, with weights that add up to
    /// one but for the sizes of circles (see the head). Five standard errors, error rate 6e-7 a
    /// comparison, three comparisons.
    #[test]
    fn a_leaning_plane_is_found_along_every_axis() {
        let normal = Vec3A::new(0.36, 0.48, 0.8);
        let (frame, axes) = (Frame::from_normal(normal), frame_about(Vec3A::Z));
        let found = SHARES * axes.to_local(normal).abs();
        let expected = integral(0.0, f64::from(TAU), |turn| {
            let (sin, cos) = turn.sin_cos();
            let way = frame.to_world(Vec3A::new(cos as f32, sin as f32, 0.0));
            let along = axes.to_local(way);
            let circles = (1.0 - along * along).powf(0.5);
            f64::from((found * found / circles).element_sum() / found.length_squared())
        }) / f64::from(TAU);
        assert!(expected > 1.05, "{expected}");
        for (mean, error) in shares(&[(normal, 0.0)], &below())[0] {
            let off = (mean - expected).abs();
            assert!(off < 5.0 * error, "{mean} +- {error}, {expected}");
        }
    }

    /// A channel that does not spread leaves the others as they are; five standard errors, error rate
    /// 6e-7 a comparison, two comparisons.
    #[test]
    fn channels_that_do_not_spread_carry_nothing() {
        let below = Subsurface {
            radius: Vec3A::new(1.0, 0.0, 0.2),
            ..below()
        };
        let [red, green, blue] = shares(&[(Vec3A::Z, 0.0)], &below)[0];
        assert_eq!(green, (0.0, 0.0));
        for (mean, error) in [red, blue] {
            assert!((mean - 1.0).abs() < 5.0 * error, "{mean} +- {error}");
        }
    }
}
