//! What denoisers are guided by: colours and normals of what a camera ray finds, in mirrors and
//! through clear glass too.
//!
//! After Cycles (kernel/film/denoising_passes.h, Blender 4.2 to 5.0). Departures: what is seen
//! through shows by its share, as in Blender 5.2; and what shines in a mirror is tinted once, not
//! twice.

use glam::Vec3A;

use super::Seen;
use crate::film::{Extra, Row};
use crate::path::{Bounces, Tracer};
use crate::sampling::Sampler;
use crate::surface::Surface;

const NORMAL: Row = Row::of("Denoising Normal");
const ALBEDO: Row = Row::of("Denoising Albedo");
const DEPTH: Row = Row::of("Denoising Depth");

/// Largest GGX alpha of closures that the guides look into: the others show their own colour.
const CLEAR_ALPHA: f32 = 0.075;

/// Largest share of other closures in a surface that the guides look into.
const LARGEST_REST: f32 = 0.25;

/// What a denoiser is told of one sample.
#[derive(Default)]
struct Guides {
    /// In the camera's space, with z to the front.
    normal: Vec3A,
    /// Share of light that comes back, or light that shines.
    albedo: Vec3A,
    /// Length of the way to it from the near clipping plane [m].
    depth: f32,
}

/// Adds what denoisers are guided by, if a pass asks for it. `light` is what the camera sees of
/// sources.
pub fn add_guides(
    extra: &mut Extra,
    iteration: u32,
    seen: &Seen,
    light: Vec3A,
    (tracer, sampler): (&Tracer, &Sampler),
) {
    if ![NORMAL, ALBEDO, DEPTH]
        .iter()
        .any(|row| extra.layout.keeps(*row))
    {
        return;
    }
    let mut guides = Guides {
        albedo: light,
        ..Guides::default()
    };
    if let (Some(surface), Some(ray)) = (seen.arrived, seen.ray) {
        guides.depth = -ray.t_min;
        guides.follow(surface, tracer, sampler);
    }
    extra.add(NORMAL, iteration, &guides.normal.to_array());
    extra.add(ALBEDO, iteration, &guides.albedo.to_array());
    extra.add(DEPTH, iteration, &[guides.depth]);
}

impl Guides {
    /// Follows mirrors and clear glass to what they show.
    fn follow(&mut self, first: &Surface, tracer: &Tracer, sampler: &Sampler) {
        let mut bounces = Bounces::default();
        let mut share = Vec3A::ONE;
        let mut next = None;
        loop {
            let surface = next.as_ref().unwrap_or(first);
            self.depth += surface.distance * share.element_sum() / 3.0;
            let parts = surface.guides(CLEAR_ALPHA);
            if parts.wide_share > LARGEST_REST {
                self.normal = tracer.frame.camera.to_view(parts.normal);
                self.albedo += share * parts.wide;
                return;
            }
            share *= parts.clear;
            let scattered = tracer.scattered(surface, bounces, sampler);
            let Some((sample, after)) = scattered.filter(|_| share != Vec3A::ZERO) else {
                return;
            };
            bounces = after;
            if bounces.at_limit(tracer.settings) {
                return;
            }
            let ray = surface.ray_towards(sample.direction);
            let (met, _) = tracer.arrive(&ray, &bounces, sampler);
            let light = match &met {
                Some(surface) => surface.emission,
                None => tracer.environment(ray.direction, &bounces),
            };
            self.albedo += share * light;
            if met.is_none() {
                return;
            }
            next = met;
        }
    }
}
