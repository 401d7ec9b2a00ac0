//! Light straight from its source that the media on a ray scatter towards its start.

use glam::Vec3A;

use super::bounces::Bounces;
use super::light::clamped;
use super::{Passed, Tracer, strategy_at};
use crate::math::Ray;
use crate::sampling::{Bsdf, LightSample, LobeValues, Sampler};
use crate::surface;

impl Tracer<'_> {
    /// All of it, for a ray after the events `from` that carries `throughput`.
    ///
    /// It comes beside what the ray meets. Where a flight ends in a medium that is lit in this way, only the
    /// path goes on from there.
    pub fn in_scattered(
        &self,
        ray: &Ray,
        passed: &Passed,
        from: &Bounces,
        throughput: f32,
        sampler: &Sampler,
    ) -> Vec3A {
        let mut sum = Vec3A::ZERO;
        self.each_in_scattered(ray, passed, from, sampler, |_, lit| sum += lit.sum());
        let limit = match from.total {
            0 => self.settings.clamp_direct,
            _ => self.settings.clamp_indirect,
        };
        clamped(sum, throughput, limit)
    }

    /// The same light by light, as if nothing limited it.
    pub(super) fn each_in_scattered(
        &self,
        ray: &Ray,
        passed: &Passed,
        from: &Bounces,
        sampler: &Sampler,
        emit: impl FnMut(&LightSample, LobeValues),
    ) {
        if !passed.flight.is_lit_on_the_way() {
            return;
        }
        let (lamps, numbers) = (self.lights.balls(), sampler.in_scattering(from.total));
        let Some((mut point, odds)) = passed.flight.scatter(ray, lamps, numbers) else {
            return;
        };
        point.weight *= passed.surfaces_share(point.t);
        let mut point = surface::in_medium(ray, &point);
        point.odds = odds;
        point.passed = from.passed + passed.count(point.distance) as u32;
        let strategy = strategy_at(from.total);
        self.each_lit(&point, from, strategy, sampler, Bsdf::mixed, emit);
    }
}
