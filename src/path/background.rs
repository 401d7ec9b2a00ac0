//! The film's transparent background, which clear glass shows.

use glam::Vec3A;

use super::Tracer;
use super::bounces::Bounces;
use crate::sampling::{Sampler, alpha_of};
use crate::surface::Surface;

impl Tracer<'_> {
    /// Largest GGX alpha of glass through which the film's transparent background is seen; none is
    /// so smooth where the background shows.
    pub(super) fn clear_alpha(&self) -> f32 {
        let settings = self.settings;
        match settings.film_transparent && settings.film_transparent_glass {
            true => alpha_of(settings.film_transparent_roughness),
            false => 0.0,
        }
    }

    /// Whether a ray that finds the background adds nothing to the picture but transparency.
    pub fn hides_background(&self, bounces: &Bounces) -> bool {
        self.settings.film_transparent && bounces.is_clear()
    }

    /// Share of the film's transparent background that is seen through the clear glass of a surface,
    /// by one path: as in Cycles all that glass lets pass, whatever it does to directions.
    pub fn seen_through(&self, surface: &Surface, sampler: &Sampler) -> f32 {
        let (mut bounces, mut throughput) = (Bounces::default(), Vec3A::ONE);
        let mut next = None;
        loop {
            let surface = next.as_ref().unwrap_or(surface);
            if self.clear_alpha() == 0.0 || !surface.bsdf.is_transmissive() {
                return 0.0;
            }
            let Some((sample, after)) = self.scattered(surface, bounces, sampler) else {
                return 0.0;
            };
            bounces = after;
            if !self.hides_background(&bounces) {
                return 0.0;
            }
            throughput *= sample.value.sum() / surface.bsdf.pdf(sample.pdfs);
            let ray = surface.ray_towards(sample.direction);
            let (met, passed) = self.arrive(&ray, &bounces, sampler);
            match met {
                None => return (throughput * passed.share(ray.t_max)).element_sum() / 3.0,
                Some(_) if bounces.at_limit(self.settings) => return 0.0,
                met => next = met,
            }
        }
    }
}
