//! How much of a light's radiance arrives.

use glam::Vec3A;

use super::bounces::Bounces;
use super::{Tracer, count_ray};
use crate::accel::Hit;
use crate::math::Ray;
use crate::media::Journey;
use crate::sampling::{LightSample, Sampler};
use crate::scene::Links;
use crate::shader::{RayInfo, RayKind};
use crate::surface::{Passage, Surface};

/// Share of the distance to a light at which a shadow ray ends, so that it does not meet the light.
const SHADOW_END: f32 = 1.0 - 1e-4;

impl Tracer<'_> {
    /// Share of light from `distance` [m] on that arrives at a surface from a direction.
    pub fn ambient(
        &self,
        surface: &Surface,
        direction: Vec3A,
        distance: f32,
        sampler: &Sampler,
    ) -> Vec3A {
        let mut ray = surface.ray_towards(direction);
        ray.t_max = distance;
        self.lit_share(&ray, &Bounces::default(), Links::default(), sampler)
    }

    /// Share of a light's radiance that arrives.
    pub(super) fn unshadowed(
        &self,
        surface: &Surface,
        light: &LightSample,
        from: &Bounces,
        sampler: &Sampler,
    ) -> Vec3A {
        if !light.reach.visibility.includes(RayKind::Shadow) {
            return Vec3A::ONE;
        }
        let mut ray = surface.ray_to_light(self.frame, light);
        ray.t_max *= SHADOW_END;
        let from = from.behind(surface.passed);
        self.lit_share(&ray, &from, light.reach.links, sampler)
    }

    /// Share of the light that a ray lets through which looks for a light after the events
    /// `bounces`.
    fn lit_share(&self, ray: &Ray, bounces: &Bounces, links: Links, sampler: &Sampler) -> Vec3A {
        let share = self.unblocked_share(ray, &bounces.shadow_info(), links);
        share * self.transmittance(ray, share, bounces, sampler)
    }

    /// Share of the light that the surfaces on a ray let through.
    pub fn unblocked_share(&self, ray: &Ray, info: &RayInfo, links: Links) -> Vec3A {
        count_ray();
        if self.see_through.is_empty() && links.blockers == 0 {
            lit(!self.accel.occluded(self.frame, ray))
        } else {
            self.passed_share(ray, info, links)
        }
    }

    /// Share of the light that the media on a ray let through, if any light is left to lose.
    fn transmittance(
        &self,
        ray: &Ray,
        light: Vec3A,
        bounces: &Bounces,
        sampler: &Sampler,
    ) -> Vec3A {
        if self.media.is_empty() || light == Vec3A::ZERO {
            return Vec3A::ONE;
        }
        let journey = Journey {
            frame: self.frame,
            ray,
            info: &bounces.shadow_info(),
        };
        let numbers = || sampler.shade(bounces.total);
        self.media.transmittance(&journey, self.accel, numbers)
    }

    fn passed_share(&self, ray: &Ray, info: &RayInfo, links: Links) -> Vec3A {
        let (mut share, mut count) = (Vec3A::ONE, info.transparent_depth);
        let accept = |hit: &Hit| {
            let instance = hit.instance as usize;
            // Instances are large: few rays need to look at them.
            let has_links = links.blockers != 0;
            if has_links && !self.frame.instances[instance].membership.stops(links) {
                return false;
            }
            if self.see_through.get(instance) != Some(&true) {
                return true;
            }
            if !self.is_seen(hit, info) {
                return false;
            }
            share *= Passage::at(self.frame, hit, ray, info).share;
            count += 1;
            share == Vec3A::ZERO || count > self.settings.transparent_max_bounces
        };
        match self.accel.occluded_where(self.frame, ray, accept) {
            true => Vec3A::ZERO,
            false => share,
        }
    }
}

/// All of the light, or nothing.
fn lit(is_lit: bool) -> Vec3A {
    match is_lit {
        true => Vec3A::ONE,
        false => Vec3A::ZERO,
    }
}
