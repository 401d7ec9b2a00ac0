//! Where a ray arrives: at a surface, or where a medium scatters it.

use super::bounces::Bounces;
use super::passed::{Behind, Chance, Passed};
use super::{Tracer, count_ray};
use crate::accel::Hit;
use crate::math::Ray;
use crate::media::Journey;
use crate::neighbourhood::Neighbourhood;
use crate::sampling::Sampler;
use crate::shader::RayInfo;
use crate::surface::{self, Passage, Surface};

/// Density [1/sr] below which a scattered ray sees no bevels; Cycles has the same limit.
const BLURRED_PDF: f32 = 8.0;

impl Tracer<'_> {
    /// The surface that a ray meets first after the events `bounces`, or the point of a medium that
    /// scatters it, seen through what it passed.
    pub fn arrive(
        &self,
        ray: &Ray,
        bounces: &Bounces,
        sampler: &Sampler,
    ) -> (Option<Surface>, Passed) {
        let (mut surface, mut passed) = self.meet(ray, bounces, sampler);
        if !self.media.is_empty() {
            (surface, passed) = self.fly(ray, surface, passed, bounces, sampler);
        }
        if let Some(surface) = &mut surface {
            surface.passed = bounces.passed + passed.count(surface.distance) as u32;
        }
        (surface, passed)
    }

    /// What a ray meets in the media before the surface that it would meet without them.
    fn fly(
        &self,
        ray: &Ray,
        mut surface: Option<Surface>,
        mut passed: Passed,
        bounces: &Bounces,
        sampler: &Sampler,
    ) -> (Option<Surface>, Passed) {
        let end = surface.as_ref().map_or(ray.t_max, |s| s.distance);
        let journey = Journey {
            frame: self.frame,
            ray: &Ray { t_max: end, ..*ray },
            info: &bounces.ray_info(None),
        };
        let vertex = bounces.total;
        let numbers = || sampler.flight(vertex);
        let (flight, collision) =
            self.media
                .fly(&journey, self.accel, numbers, sampler.medium(vertex));
        passed.glow = flight.glow();
        passed.behind = flight.is_lit_on_the_way().then(|| {
            let share = flight.mean_share(end);
            let glow = |s: &Surface| (s.emission * share, self.group_of(s));
            Behind {
                share: share * passed.share(end),
                glow: surface.as_ref().map(glow),
            }
        });
        if let Some(mut collision) = collision {
            collision.weight *= passed.share(collision.t);
            let mut point = surface::in_medium(ray, &collision);
            point.is_lit_apart = flight.is_lit_on_the_way();
            if point.is_lit_apart {
                point.odds = flight.odds(ray, self.lights.balls(), point.distance);
            }
            surface = Some(point);
        } else if let Some(surface) = &mut surface {
            surface.put_behind(flight.share(end));
        }
        passed.flight = flight;
        (surface, passed)
    }

    /// The surface that a ray meets first, as if there were no media.
    fn meet(&self, ray: &Ray, bounces: &Bounces, sampler: &Sampler) -> (Option<Surface>, Passed) {
        count_ray();
        let around = self.around(ray, bounces, sampler);
        let info = bounces.ray_info(Some(&around));
        let at = |hit: &Hit| surface::at(self.frame, hit, ray, &info);
        let mut passed = Passed::default();
        if self.see_through.is_empty() {
            return (
                self.accel.closest_hit(self.frame, ray).as_ref().map(at),
                passed,
            );
        }
        let chance = Chance::new(info.kind, bounces, sampler);
        let limit = bounces.passes_left(self.settings);
        let accept = |hit: &Hit| {
            passed.has_ended(hit.t, limit) || self.stops(hit, ray, &info, &chance, &mut passed)
        };
        let hit = self.accel.closest_hit_where(self.frame, ray, accept);
        let end = hit.map_or(f32::INFINITY, |hit| hit.t);
        let last = passed.end_at(end, limit).or(hit);
        let mut surface = last.as_ref().map(at);
        if passed.reaches(limit) {
            surface = surface.map(|last| self.glow_alone(last, ray, &info));
        }
        if let Some(surface) = &mut surface {
            surface.put_behind(passed.share(surface.distance));
        }
        (surface, passed)
    }

    /// The surface at which a ray ends that may pass no more. As in Cycles it shines, and does nothing
    /// else.
    fn glow_alone(&self, surface: Surface, ray: &Ray, info: &RayInfo) -> Surface {
        let is_see_through = self.see_through[surface.hit.instance as usize];
        let stopped = match is_see_through {
            true => 1.0 - Passage::at(self.frame, &surface.hit, ray, info).probability,
            false => 1.0,
        };
        surface.glowing_alone(stopped)
    }

    /// Whether a ray meets what lies on it, or does not even see it.
    pub(super) fn is_seen(&self, hit: &Hit, info: &RayInfo) -> bool {
        let instance = &self.frame.instances[hit.instance as usize];
        instance.visibility.includes(info.kind)
    }

    /// Whether a surface stops a ray, by chance where it lets some light through.
    fn stops(
        &self,
        hit: &Hit,
        ray: &Ray,
        info: &RayInfo,
        chance: &Chance,
        passed: &mut Passed,
    ) -> bool {
        if !self.see_through[hit.instance as usize] {
            return true;
        }
        if !self.is_seen(hit, info) {
            return false;
        }
        let passage = Passage::at(self.frame, hit, ray, info);
        let probability = passage.probability;
        probability <= 0.0 || chance.of(hit) >= probability || passed.note(hit, passage)
    }

    /// Mean share of a camera ray's light that a surface does not let through.
    pub fn opacity(&self, hit: &Hit, ray: &Ray, info: &RayInfo) -> f32 {
        if self.see_through.get(hit.instance as usize) != Some(&true) {
            return 1.0;
        }
        let share = Passage::at(self.frame, hit, ray, info).share;
        1.0 - share.element_sum() / 3.0
    }

    /// The surface that a camera ray meets at a hit.
    pub fn surface_at(&self, hit: &Hit, ray: &Ray, info: &RayInfo) -> Surface {
        surface::at(self.frame, hit, ray, info)
    }

    /// What is around where a ray arrives after the events `bounces`.
    pub fn around<'b>(
        &'b self,
        ray: &Ray,
        bounces: &Bounces,
        sampler: &'b Sampler,
    ) -> Neighbourhood<'b> {
        Neighbourhood {
            frame: self.frame,
            accel: self.accel,
            sampler,
            vertex: bounces.total,
            is_blurred: bounces.least_pdf.is_some_and(|pdf| pdf < BLURRED_PDF),
            time: ray.time,
        }
    }
}
