//! Free flights through media that differ from place to place.
//!
//! Delta tracking (Woodcock 1965): a ray makes steps as if it went through the majorant, and decides at
//! each end of a step what happens there. Weights keep what chances do not show: flights end by
//! scattering alone, so that absorption is a factor and no chance; channels differ, so that the one
//! that a flight was drawn from counts by the balance heuristic over all of them; and where a medium is
//! denser than its majorant a factor is negative, which is right on the mean. After Miller, Georgiev
//! and Jarosz, "A Null-Scattering Path Integral Formulation of Light Transport" (2019), and Galtier et
//! al., "Integral formulation of null-collision Monte Carlo algorithms" (2013). Rays that look for
//! light multiply what each step leaves: ratio tracking (Novák, Selle and Jarosz 2014).

use glam::Vec3A;

use super::uneven::{Journey, Uneven};
use super::{Collision, Flight, Span, depth, glow_of};
use crate::sampling::Walk;
use crate::scene::Medium;

/// Below this share a ray goes on by chance only.
const FAINT: f32 = 0.05;
/// The chance.
const GOES_ON: f32 = 0.25;

/// What a flight carries from some `t` on.
#[derive(Debug, Clone, Copy)]
pub struct Mark {
    t: f32,
    carried: Carried,
    /// What it goes through from there to the next mark.
    medium: Medium,
}

/// Share of the light over the probability of getting here, and that probability for a flight of each
/// channel over their mean.
#[derive(Debug, Clone, Copy)]
struct Carried {
    share: Vec3A,
    odds: Vec3A,
}

impl Carried {
    const ALL: Self = Self {
        share: Vec3A::ONE,
        odds: Vec3A::ONE,
    };

    /// After an event that leaves `factor` of the light, and happens to a flight of each channel with
    /// these probabilities, or densities.
    fn after(self, factor: Vec3A, probability: Vec3A) -> Self {
        let odds = self.odds * probability;
        let mean = odds.element_sum() / 3.0;
        if !(mean > 0.0) {
            return Self {
                share: Vec3A::ZERO,
                ..self
            };
        }
        Self {
            share: self.share * factor / mean,
            odds: odds / mean,
        }
    }

    /// After going through an even medium without being scattered.
    fn through(self, medium: &Medium, length: f32) -> Self {
        let [passed, unscattered] =
            [medium.extinction(), medium.scattering].map(|loss| (-depth(loss, length)).exp());
        self.after(passed, unscattered)
    }
}

/// Steps through the majorants of a span.
struct Steps<'a> {
    bodies: &'a [Uneven],
    span: &'a Span,
    journey: &'a Journey<'a>,
    stop: f32,
    t: f32,
    /// Optical depth to the next event.
    rest: f32,
}

impl Steps<'_> {
    fn limit_and_end(&self) -> (f32, f32) {
        let even = self.span.medium.extinction().max_element();
        let mut parts = (even, self.stop);
        for &body in &self.span.uneven {
            let cell = self.bodies[body].cell(self.journey, self.t);
            parts = (parts.0 + cell.limit, parts.1.min(cell.end));
        }
        parts
    }

    /// Goes on to the next event: what is there, and the majorant; `None` beyond the end.
    fn next(&mut self, numbers: &mut Walk) -> Option<(Medium, f32)> {
        while self.t < self.stop {
            let (limit, end) = self.limit_and_end();
            let length = self.rest / limit;
            if self.t + length < end {
                self.t += length;
                self.rest = exponential(numbers);
                let uneven = self.span.uneven.iter();
                let media = uneven.map(|&body| self.bodies[body].at(self.journey, self.t));
                return Some((media.fold(self.span.medium, Medium::and), limit));
            }
            if end.is_infinite() {
                return None;
            }
            self.rest -= limit * (end - self.t);
            self.t = end;
        }
        None
    }
}

fn exponential(numbers: &mut Walk) -> f32 {
    -(1.0 - numbers.next()).ln()
}

/// A share of light that is worth following; where it is faint that is left to chance.
fn lasting(share: Vec3A, numbers: &mut Walk) -> Option<Vec3A> {
    if share.abs().max_element() >= FAINT {
        return Some(share);
    }
    (numbers.next() < GOES_ON).then(|| share / GOES_ON)
}

impl Flight {
    fn steps<'a>(
        bodies: &'a [Uneven],
        span: &'a Span,
        journey: &'a Journey,
        end: f32,
        rest: f32,
    ) -> Steps<'a> {
        Steps {
            bodies,
            span,
            journey,
            stop: span.end.min(end),
            t: span.start,
            rest,
        }
    }

    /// Draws where the ray is scattered before it ends at `end`, and remembers the way there and its
    /// glow.
    pub(super) fn track(
        &mut self,
        bodies: &[Uneven],
        journey: &Journey,
        end: f32,
        numbers: &mut Walk,
    ) -> Option<Collision> {
        let channel = ((3.0 * numbers.next()) as usize).min(2);
        let (mut carried, mut rest) = (Carried::ALL, exponential(numbers));
        let spans = std::mem::take(&mut self.spans);
        let mut collision = None;
        for span in spans.iter().take_while(|span| span.start < end) {
            self.mark(span.start, carried, Medium::default());
            collision = match span.uneven.is_empty() {
                true => self.pass(span, end, channel, &mut carried, &mut rest),
                false => {
                    let mut steps = Self::steps(bodies, span, journey, end, rest);
                    let found = self.walk(&mut steps, channel, &mut carried, numbers);
                    rest = steps.rest;
                    found
                }
            };
            if collision.is_some() {
                break;
            }
        }
        self.spans = spans;
        self.end = collision.map_or(f32::INFINITY, |collision| collision.t);
        self.mark(end, carried, Medium::default());
        collision
    }

    fn mark(&mut self, t: f32, carried: Carried, medium: Medium) {
        self.marks.push(Mark { t, carried, medium });
    }

    /// Through an even span.
    fn pass(
        &mut self,
        span: &Span,
        end: f32,
        channel: usize,
        carried: &mut Carried,
        rest: &mut f32,
    ) -> Option<Collision> {
        let (scattering, length) = (span.medium.scattering, span.end.min(end) - span.start);
        self.mark(span.start, *carried, span.medium);
        let glow = glow_of(carried.share, &span.medium, length);
        // Without emission an endless way through nothing is no number.
        if glow.is_finite() {
            self.glow += glow;
        }
        let here = depth(scattering, length)[channel];
        if *rest < here {
            let way = *rest / scattering[channel];
            let there = carried.through(&span.medium, way);
            return Some(Collision {
                t: span.start + way,
                weight: there.after(scattering, scattering).share,
                anisotropy: span.medium.anisotropy,
            });
        }
        *rest -= here.max(0.0);
        *carried = carried.through(&span.medium, length);
        None
    }

    /// Through a span that differs from place to place.
    fn walk(
        &mut self,
        steps: &mut Steps,
        channel: usize,
        carried: &mut Carried,
        numbers: &mut Walk,
    ) -> Option<Collision> {
        while let Some((medium, limit)) = steps.next(numbers) {
            self.glow += carried.share * medium.emission / limit;
            let rest = limit - medium.extinction();
            // Together they are the majorant, wherever it is one.
            let (scatters, passes) = (
                medium.scattering,
                (limit - medium.scattering).max(rest.abs()),
            );
            let chance = scatters / (scatters + passes);
            if numbers.next() < chance[channel] {
                return Some(Collision {
                    t: steps.t,
                    weight: carried.after(scatters, limit * chance).share,
                    anisotropy: medium.anisotropy,
                });
            }
            *carried = carried.after(rest / limit, 1.0 - chance);
            let Some(share) = lasting(carried.share, numbers) else {
                return Some(Collision {
                    t: steps.t,
                    weight: Vec3A::ZERO,
                    anisotropy: 0.0,
                });
            };
            carried.share = share;
            self.mark(steps.t, *carried, Medium::default());
        }
        None
    }

    /// What [`Flight::share`] is after tracking.
    pub(super) fn tracked_share(&self, t: f32) -> Vec3A {
        if t > self.end {
            return Vec3A::ZERO;
        }
        let last = self.marks.iter().rposition(|mark| mark.t <= t);
        let last = last.and_then(|last| self.marks.get(last));
        last.map_or(Vec3A::ONE, |mark| {
            mark.carried.through(&mark.medium, t - mark.t).share
        })
    }

    /// Share of the light from the end of the ray that arrives, on the mean.
    pub(super) fn tracked_transmittance(
        &self,
        bodies: &[Uneven],
        journey: &Journey,
        numbers: &mut Walk,
    ) -> Vec3A {
        let end = journey.ray.t_max;
        let mut share = Vec3A::ONE;
        for span in self.spans.iter().take_while(|span| span.start < end) {
            if span.uneven.is_empty() {
                let length = span.end.min(end) - span.start;
                share *= (-depth(span.medium.extinction(), length)).exp();
                continue;
            }
            let mut steps = Self::steps(bodies, span, journey, end, exponential(numbers));
            while let Some((medium, limit)) = steps.next(numbers) {
                share *= 1.0 - medium.extinction() / limit;
                match lasting(share, numbers) {
                    Some(lasting) => share = lasting,
                    None => return Vec3A::ZERO,
                }
            }
        }
        share
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Accel;
    use crate::math::Ray;
    use crate::media::Media;
    use crate::sampling::Sampler;
    use crate::scene::{Material, Medium, SceneFrame};
    use crate::shader::{Draft, RayInfo, Row};
    use crate::testing::{Scene, cube};
    use glam::Affine3A;
    use std::sync::Arc;

    const SCATTER: [f32; 3] = [1.2, 0.6, 0.1];
    const ABSORB: [f32; 3] = [0.1, 0.5, 1.5];
    const GLOW: [f32; 3] = [0.3, 0.2, 0.1];

    /// Dense as 1.2 m plus the object's Y, in a cube from -1 to 1 m.
    const GRADIENT: &[Row] = &[
        ("coordinate", &[], 1),
        ("separate", &[0], 3),
        ("add", &[1, -1], 0),
        ("multiply", &[2, -2], 0),
        ("multiply", &[2, -3], 0),
        ("multiply", &[2, -4], 0),
        ("volume", &[-5, 3, 4, 5, -6], 0),
    ];

    fn density(y: f32) -> f32 {
        1.2 + y
    }

    fn frame() -> Arc<SceneFrame> {
        let constants = [[1.2; 3], SCATTER, ABSORB, GLOW, [1.0; 3], [0.3; 3]];
        let mut scene = Scene::new();
        let material = Material::new(&Draft::of(GRADIENT, &constants).unwrap());
        scene.add(cube(), Affine3A::IDENTITY, material);
        scene.frame(1)
    }

    struct Means {
        passed: Vec3A,
        scattered: Vec3A,
        glow: Vec3A,
        shade: Vec3A,
    }

    /// Means over many flights through the cube along Y, up to `end` from its face.
    fn means(media: &Media, frame: &SceneFrame, end: f32) -> Means {
        const COUNT: u32 = 1 << 16;
        let accel = Accel::build(frame, None);
        let ray = Ray {
            t_max: 4.0 + end,
            ..Ray::new(-5.0 * Vec3A::Y, Vec3A::Y)
        };
        let info = RayInfo::default();
        let journey = Journey {
            frame,
            ray: &ray,
            info: &info,
        };
        let (mut passed, mut scattered, mut glow, mut shade) = Default::default();
        for index in 0..COUNT {
            let sampler = Sampler::new(7, 1, [0; 2], index, 1 << 16);
            let (flight, collision) = media.fly(&journey, &accel, || sampler.flight(0), [0.0; 2]);
            glow += flight.glow();
            passed += flight.share(ray.t_max);
            scattered += collision.map_or(Vec3A::ZERO, |collision| collision.weight);
            shade += media.transmittance(&journey, &accel, || sampler.shade(0));
        }
        let mean = |sum: Vec3A| sum / COUNT as f32;
        Means {
            passed: mean(passed),
            scattered: mean(scattered),
            glow: mean(glow),
            shade: mean(shade),
        }
    }

    /// What the means must be, by small steps.
    fn integrals(end: f32, even: Medium) -> [Vec3A; 3] {
        const STEPS: usize = 20_000;
        let step = end / STEPS as f32;
        let (mut depth, mut scattered, mut glow) = (Vec3A::ZERO, Vec3A::ZERO, Vec3A::ZERO);
        for index in 0..STEPS {
            let density = density((index as f32 + 0.5) * step - 1.0);
            let extinction = density * (Vec3A::from(SCATTER) + Vec3A::from(ABSORB));
            let passed = (-(depth + 0.5 * step * (extinction + even.extinction()))).exp();
            scattered += passed * (density * Vec3A::from(SCATTER) + even.scattering) * step;
            glow += passed * (density * Vec3A::from(GLOW) + even.emission) * step;
            depth += step * (extinction + even.extinction());
        }
        [(-depth).exp(), scattered, glow]
    }

    /// Errors are below 0.3 % of a light of one in all of these, five standard deviations.
    fn assert_near(found: Vec3A, expected: Vec3A, what: &str) {
        let error = (found - expected).abs().max_element();
        assert!(error < 0.01, "{what}: {found} {expected}");
    }

    fn check(media: &Media, end: f32, even: Medium) {
        let found = means(media, &frame(), end);
        let [passed, scattered, glow] = integrals(end, even);
        assert_near(found.passed, passed, "passed");
        assert_near(found.shade, passed, "shade");
        assert_near(found.scattered, scattered, "scattered");
        assert_near(found.glow, glow, "glow");
    }

    #[test]
    fn flights_bring_what_the_integrals_along_a_gradient_say() {
        let frame = frame();
        let accel = Accel::build(&frame, None);
        check(&Media::of(&frame, accel.bounds()), 2.0, Medium::default());
        check(&Media::of(&frame, accel.bounds()), 0.7, Medium::default());
    }

    /// With a fog that is even on top, before it and behind it.
    #[test]
    fn even_media_are_part_of_the_flight() {
        let even = Medium {
            scattering: Vec3A::new(0.1, 0.2, 0.3),
            absorption: Vec3A::new(0.3, 0.0, 0.1),
            emission: Vec3A::splat(0.2),
            anisotropy: 0.0,
        };
        let mut frame = SceneFrame::clone(&frame());
        let accel = Accel::build(&frame, None);
        frame.medium = Some(crate::scene::Filling::Even(even));
        let media = Media::of(&frame, accel.bounds());
        // Before the cube the ray goes 4 m through the fog alone.
        let before = (-4.0 * even.extinction()).exp();
        let found = means(&media, &frame, 2.0);
        let [passed, scattered, glow] = integrals(2.0, even);
        let first = (1.0 - before) / even.extinction();
        assert_near(found.passed, before * passed, "passed");
        assert_near(found.shade, before * passed, "shade");
        assert_near(
            found.scattered,
            first * even.scattering + before * scattered,
            "scattered",
        );
        assert_near(found.glow, first * even.emission + before * glow, "glow");
    }

    /// A majorant that is none adds noise and nothing else.
    #[test]
    fn limits_that_are_exceeded_leave_the_means() {
        let frame = frame();
        let accel = Accel::build(&frame, None);
        let mut media = Media::of(&frame, accel.bounds());
        media.uneven[0].lower_limits(0.6);
        check(&media, 2.0, Medium::default());
    }
}
