//! One path in one frame: where a ray arrives, and what light comes back along it.
//!
//! A unidirectional path tracer. Light is found both by sampling lights and by sampling surfaces,
//! joined by multiple importance sampling with the balance heuristic (Veach, "Robust Monte Carlo
//! Methods for Light Transport Simulation", 1997, section 9.2). It is the plain reference, method
//! PATH, and the source of every sample that the other methods share.

use std::cell::Cell;

use glam::Vec3A;

use crate::accel::Accel;
use crate::contract::Settings;
use crate::math::Ray;
use crate::media::Media;
use crate::sampling::{
    Bsdf, BsdfSample, LightSampler, LobeValues, Part, Receiver, Sampler, Strategy,
};
use crate::scene::{Links, Membership, SceneFrame};
use crate::subsurface;
use crate::surface::{self, Surface};

mod arrival;
mod background;
mod body;
mod bounces;
mod direct;
mod found;
mod groups;
mod in_scattering;
mod light;
mod passed;
mod shadow;

use body::Entered;
pub use bounces::Bounces;
use light::clamp_factor;
pub use light::{Divided, Gathered, Reflected, clamped};
pub use passed::Passed;

/// Bounces before Russian roulette may end a path; Cycles begins there too.
const ROULETTE_FROM: u32 = 3;

/// Everything a path needs of one frame.
pub struct Tracer<'a> {
    /// The frame.
    pub frame: &'a SceneFrame,
    /// Its geometry.
    pub accel: &'a Accel,
    /// Its lights.
    pub lights: &'a LightSampler,
    /// The settings.
    pub settings: &'a Settings,
    /// For each instance whether it lets light through or is not seen by some rays; empty where
    /// none does.
    pub see_through: &'a [bool],
    /// What fills its bodies and its world.
    pub media: &'a Media,
}

/// A ray that goes on from a surface.
#[derive(Debug, Clone, Copy)]
pub struct Continuation {
    /// The ray.
    pub ray: Ray,
    /// Density of its direction [1/sr], for the weight of the light that it meets.
    pub pdf_solid_angle: f32,
    /// What that counts for beside light samples: see [`Surface::odds`].
    pub odds: f32,
    /// Point that it leaves, not moved off the surface.
    pub position: Vec3A,
    /// The sets of things that the surface there is in.
    pub membership: Membership,
    /// Shading normal there, on the side that the ray leaves to.
    pub normal: Vec3A,
    /// How lights were sampled there.
    pub strategy: Strategy,
    /// Scattering events so far.
    pub bounces: Bounces,
    /// Share of the camera's importance that the path still carries, for Russian roulette.
    pub throughput: f32,
    /// Whether the length of the ray is wanted even where only its visibility matters for light.
    pub wants_distance: bool,
}

impl Continuation {
    /// From a surface in a direction of this density [1/sr], which lights are sampled for by `strategy`
    /// unless that is done elsewhere; `bounces` counts the event there.
    pub fn leaving(
        surface: &Surface,
        direction: Vec3A,
        pdf_solid_angle: f32,
        strategy: Strategy,
        bounces: Bounces,
    ) -> Self {
        let strategy = match surface.is_lit_apart {
            true => strategy_at(bounces.lit_vertex()),
            false => strategy,
        };
        Self {
            ray: surface.ray_towards(direction),
            pdf_solid_angle,
            odds: surface.odds,
            position: surface.position,
            membership: surface.membership,
            normal: surface.normal_towards(direction),
            strategy,
            bounces,
            throughput: 1.0,
            wants_distance: false,
        }
    }

    /// Density of its direction for the weight of light that light samples find as well.
    fn pdf_beside_samples(&self) -> f32 {
        self.pdf_solid_angle * self.odds
    }

    fn receiver(&self) -> Receiver {
        Receiver {
            point: self.position,
            normal: self.normal,
            time: self.ray.time,
        }
    }
}

/// How a path goes on from a surface.
struct Step {
    next: Continuation,
    /// `f cos` of its direction [1/sr].
    value: LobeValues,
    /// Probability of going on.
    survival: f32,
}

thread_local! {
    static RAYS: Cell<u64> = const { Cell::new(0) };
}

/// Rays that this thread traced since the last call.
pub fn take_rays() -> u64 {
    RAYS.take()
}

fn count_ray() {
    RAYS.set(RAYS.get() + 1);
}

/// The balance heuristic's weight of the technique with the first density.
fn balance(pdf: f32, other: f32) -> f32 {
    // Densities of deltas and of far lights may overflow: then the other one is negligible.
    if pdf.is_infinite() {
        1.0
    } else {
        pdf / (pdf + other)
    }
}

impl<'a> Tracer<'a> {
    /// Radiance that a surface reflects: `f cos` times light over all directions, by one light
    /// sample and one path that goes on.
    pub fn reflected(
        &self,
        surface: &Surface,
        from: Bounces,
        throughput: f32,
        sampler: &Sampler,
    ) -> Reflected {
        let strategy = strategy_at(from.total);
        let direct = self.direct(surface, &from, strategy, sampler, Bsdf::mixed);
        let factor = match from.total {
            0 => 1.0,
            _ => clamp_factor(direct.sum(), throughput, self.settings.clamp_indirect),
        };
        let continued = self.continued(surface, from, throughput, sampler);
        Reflected {
            direct: direct * factor,
            ..continued.unwrap_or_default()
        }
    }

    /// What leaves a surface after scattering below it.
    pub fn from_below(
        &self,
        surface: &Surface,
        from: Bounces,
        throughput: f32,
        sampler: &Sampler,
    ) -> Option<Reflected> {
        let (outside, weight) = self.resurfaced(surface, &from, sampler)?;
        let throughput = throughput * weight.max_element();
        let reflected = self.reflected(&outside, from, throughput, sampler);
        Some(reflected.tinted(weight))
    }

    /// Where light from below a surface comes out, and by how much it is weighted.
    fn resurfaced(
        &self,
        surface: &Surface,
        from: &Bounces,
        sampler: &Sampler,
    ) -> Option<(Surface, Vec3A)> {
        let mut numbers = sampler.walk(from.total);
        let (below, pmf) = subsurface::choose(&surface.below, &mut numbers)?;
        let entered = Entered {
            tracer: self,
            surface,
        };
        let exit = below.scatter(&entered, &mut numbers)?;
        let mut outside = surface::exit(self.frame, &exit.hit, &exit.ray, &from.ray_info(None));
        outside.passed = surface.passed;
        Some((outside, below.weight * exit.carried / pmf))
    }

    /// The path that goes on, if one does.
    fn continued(
        &self,
        surface: &Surface,
        from: Bounces,
        throughput: f32,
        sampler: &Sampler,
    ) -> Option<Reflected> {
        let step = self.step(surface, from, throughput, sampler)?;
        Some(Reflected {
            direct: LobeValues::default(),
            gathered: self.gather(&step.next, sampler),
            value: step.value,
            pdf_solid_angle: step.next.pdf_solid_angle,
            survival: step.survival,
        })
    }

    /// The next step of the path, if it goes on.
    fn step(
        &self,
        surface: &Surface,
        from: Bounces,
        throughput: f32,
        sampler: &Sampler,
    ) -> Option<Step> {
        let numbers = sampler.scatter(from.total);
        let sample = surface.bsdf.sample(numbers.lobe, numbers.direction)?;
        let pdf_solid_angle = surface.bsdf.pdf(sample.pdfs);
        let weight = sample.value.sum() / pdf_solid_angle;
        let throughput = throughput * weight.max_element();
        let survival = survival_probability(from.total + 1, throughput);
        if !(survival > 0.0) || numbers.roulette >= survival {
            return None;
        }
        let bounces = self.after(from, surface, sample.part, sample.alpha);
        let strategy = strategy_at(from.total);
        let direction = sample.direction;
        let next = Continuation {
            throughput: throughput / survival,
            ..Continuation::leaving(surface, direction, pdf_solid_angle, strategy, bounces)
        };
        Some(Step {
            next,
            value: sample.value,
            survival,
        })
    }

    /// A direction that the path goes on in, and the events that there are then.
    pub fn scattered(
        &self,
        surface: &Surface,
        from: Bounces,
        sampler: &Sampler,
    ) -> Option<(BsdfSample, Bounces)> {
        let numbers = sampler.scatter(from.total);
        let sample = surface.bsdf.sample(numbers.lobe, numbers.direction)?;
        Some((sample, self.after(from, surface, sample.part, sample.alpha)))
    }

    /// One event more, at a surface's closure of this GGX alpha.
    pub fn after(&self, from: Bounces, surface: &Surface, part: Part, alpha: f32) -> Bounces {
        let is_clear = part == Part::Transmission && alpha <= self.clear_alpha();
        let after = from.after(part).behind(surface.passed);
        match is_clear {
            true => after.through_clear_glass(),
            false => after,
        }
    }

    /// What comes back along a ray that goes on from a surface.
    pub fn gather(&self, from: &Continuation, sampler: &Sampler) -> Gathered {
        let ray = &from.ray;
        let last = from.bounces.at_limit(self.settings);
        // Light right behind the first event comes straight from its source.
        let limit = match from.bounces.total {
            0 | 1 => self.settings.clamp_direct,
            _ => self.settings.clamp_indirect,
        };
        let clamped = |radiance| clamped(radiance, from.throughput, limit);
        let is_plain = !self.lights.can_be_met() && self.media.is_empty();
        if last && !from.wants_distance && is_plain {
            return self.sky_alone(from, clamped, sampler);
        }
        let bounces = from.bounces.along(from.pdf_solid_angle);
        let (mut surface, passed) = self.arrive(ray, &bounces, sampler);
        if let Some(surface) = &mut surface {
            self.calm(surface, &bounces);
        }
        let distance = surface.as_ref().map_or(ray.t_max, |s| s.distance);
        let mut gathered = Gathered {
            distance,
            ..Gathered::default()
        };
        gathered.lamps = clamped(passed.glow + self.lamps(from, distance, &passed));
        if !last {
            gathered.indirect = self.in_scattered(ray, &passed, &bounces, from.throughput, sampler);
        }
        let Some(surface) = surface else {
            self.add_environment(from, passed.share(distance), clamped, &mut gathered);
            return gathered;
        };
        gathered.lamps += clamped(self.glow(from, &surface));
        gathered.probability_lambert = surface.bsdf.probability_lambert();
        if !last {
            let reflected = self.reflected(&surface, bounces, from.throughput, sampler);
            let below = self.from_below(&surface, bounces, from.throughput, sampler);
            gathered.indirect += reflected.sum() + below.map_or(Vec3A::ZERO, |below| below.sum());
        }
        gathered
    }

    /// What the environment adds to a ray that meets nothing that shines: only whether the ray
    /// leaves the scene matters.
    fn sky_alone(
        &self,
        from: &Continuation,
        clamped: impl Fn(Vec3A) -> Vec3A,
        sampler: &Sampler,
    ) -> Gathered {
        let mut gathered = Gathered {
            distance: f32::INFINITY,
            ..Gathered::default()
        };
        let around = self.around(&from.ray, &from.bounces, sampler);
        let info = from.bounces.ray_info(Some(&around));
        let share = self.unblocked_share(&from.ray, &info, Links::default());
        if share != Vec3A::ZERO {
            self.add_environment(from, share, clamped, &mut gathered);
        }
        gathered
    }

    /// What the settings take from a surface that a scattered ray meets, against noise: caustics,
    /// and narrow lobes behind wide bounces. As in Cycles, without its pdf of singular lobes.
    fn calm(&self, surface: &mut Surface, bounces: &Bounces) {
        let settings = self.settings;
        if bounces.last == Some(Part::Diffuse) {
            if !settings.caustics_reflective {
                surface.bsdf.remove(Part::Glossy);
            }
            if !settings.caustics_refractive {
                surface.bsdf.remove(Part::Transmission);
            }
        }
        let width = bounces.least_pdf.unwrap_or(f32::INFINITY) / settings.blur_glossy;
        if settings.blur_glossy > 0.0 && width < 1.0 {
            surface.bsdf.blur(0.5 * (1.0 - width).sqrt());
        }
    }
}

/// How lights are sampled at a vertex of the path. The first one makes most of the noise.
fn strategy_at(vertex: u32) -> Strategy {
    match vertex {
        0 => Strategy::SkyApart,
        _ => Strategy::One,
    }
}

/// Probability with which a path goes on after its event number `bounce`. The square root keeps
/// paths alive a little longer than their share of light, which lowers the noise, as in Cycles.
fn survival_probability(bounce: u32, throughput: f32) -> f32 {
    if bounce <= ROULETTE_FROM {
        1.0
    } else {
        throughput.sqrt().min(1.0)
    }
}

#[cfg(test)]
mod tests;
