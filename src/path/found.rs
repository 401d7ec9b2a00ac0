//! Light that a ray runs into: the world, lamps, and surfaces that glow.

use glam::Vec3A;

use super::bounces::Bounces;
use super::light::Gathered;
use super::passed::Passed;
use super::{Continuation, Tracer, balance};
use crate::math::Ray;
use crate::scene::{Links, Membership};
use crate::surface::Surface;

impl Tracer<'_> {
    /// Light of a glowing surface that a ray meets, beside the light samples of its strategy.
    pub(super) fn glow(&self, from: &Continuation, surface: &Surface) -> Vec3A {
        if surface.emission == Vec3A::ZERO || !self.is_lit_by_glow(from, surface) {
            return Vec3A::ZERO;
        }
        let (hit, strategy) = (&surface.hit, from.strategy);
        let pdf_light = self.lights.emissive_pdf(
            &from.receiver(),
            strategy,
            hit.instance,
            hit.triangle,
            surface.position,
        );
        surface.emission * balance(from.pdf_beside_samples(), pdf_light)
    }

    /// Whether a glowing surface that a ray meets lights the thing that the ray comes from.
    pub(super) fn is_lit_by_glow(&self, from: &Continuation, glowing: &Surface) -> bool {
        let instance = &self.frame.instances[glowing.hit.instance as usize];
        is_linked(instance.links, from.membership)
    }

    /// Radiance of the world where a ray leaves the scene after the events `bounces`.
    pub fn environment(&self, direction: Vec3A, bounces: &Bounces) -> Vec3A {
        let (kind, vertex) = (bounces.kind(), bounces.lit_vertex());
        self.lights.environment_radiance(direction, kind, vertex)
    }

    /// Adds what a ray brings from the world, of which `share` gets through.
    pub(super) fn add_environment(
        &self,
        from: &Continuation,
        share: Vec3A,
        clamped: impl Fn(Vec3A) -> Vec3A,
        gathered: &mut Gathered,
    ) {
        if self.hides_background(&from.bounces) {
            return;
        }
        let radiance = share * self.environment(from.ray.direction, &from.bounces);
        if radiance != Vec3A::ZERO {
            gathered.open_sky = clamped(radiance);
            gathered.environment = clamped(radiance * self.environment_weight(from));
        }
    }

    /// Weight of what the ray brings from the world, beside the light samples of its strategy.
    pub fn environment_weight(&self, from: &Continuation) -> f32 {
        let direction = from.ray.direction;
        let pdf_light = self
            .lights
            .environment_pdf(&from.receiver(), from.strategy, direction);
        balance(from.pdf_beside_samples(), pdf_light)
    }

    /// Light of the lamps on a ray up to `distance`, through what it passed.
    pub(super) fn lamps(&self, from: &Continuation, distance: f32, passed: &Passed) -> Vec3A {
        let mut sum = Vec3A::ZERO;
        self.each_lamp(from, distance, passed, |_, light| sum += light);
        sum
    }

    /// The same lamp by lamp.
    #[inline(always)]
    pub(super) fn each_lamp(
        &self,
        from: &Continuation,
        distance: f32,
        passed: &Passed,
        mut emit: impl FnMut(Links, Vec3A),
    ) {
        let ray = Ray {
            t_max: distance,
            ..from.ray
        };
        let (kind, vertex) = (from.bounces.kind(), from.bounces.lit_vertex());
        let lamps = self
            .lights
            .lamps_along(&ray, from.normal, from.strategy, kind, vertex)
            .filter(|lamp| is_linked(lamp.links, from.membership));
        for lamp in lamps {
            let weight = balance(from.pdf_beside_samples(), lamp.pdf_solid_angle);
            emit(
                lamp.links,
                passed.mean_share(lamp.t) * lamp.radiance * weight,
            );
        }
    }
}

/// Whether a light of these links that a ray from a thing of these sets runs into lights it. What
/// other things than the ray's would stop its light is left to light samples, as in Cycles.
fn is_linked(links: Links, membership: Membership) -> bool {
    membership.is_lit_by(links) && links.blockers == 0
}
