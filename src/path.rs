//! One path in one frame: where a ray arrives, and what light comes back along it.
//!
//! A unidirectional path tracer. Light is found both by sampling lights and by sampling surfaces,
//! joined by multiple importance sampling with the balance heuristic (Veach, "Robust Monte Carlo
//! Methods for Light Transport Simulation", 1997, section 9.2). It is the plain reference, method
//! PATH, and the source of every sample that the other methods share.

use std::cell::Cell;

use glam::Vec3A;

use crate::accel::{Accel, Hit};
use crate::contract::Settings;
use crate::math::Ray;
use crate::sampling::{
    Bsdf, LightSample, LightSampler, LobePdfs, LobeValues, Part, Sampler, Strategy,
};
use crate::scene::SceneFrame;
use crate::shader::RayInfo;
use crate::surface::{self, Surface};

/// Bounces before Russian roulette may end a path; Cycles begins there too.
const ROULETTE_FROM: u32 = 3;

/// Share of the distance to a light at which a shadow ray ends, so that it does not meet the light.
const SHADOW_END: f32 = 1.0 - 1e-4;

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
    /// Whether a surface of the frame lets light through.
    pub see_through: bool,
}

/// Scattering events so far, as the bounce limits count them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Bounces {
    total: u32,
    diffuse: u32,
    glossy: u32,
    transmission: u32,
}

impl Bounces {
    /// One event more.
    pub fn after(self, part: Part) -> Self {
        let count = |counted| u32::from(part == counted);
        Self {
            total: self.total + 1,
            diffuse: self.diffuse + count(Part::Diffuse),
            glossy: self.glossy + count(Part::Glossy),
            transmission: self.transmission + count(Part::Transmission),
        }
    }

    /// Whether the ray that follows only looks for lights. As in Cycles, a limit of zero leaves
    /// direct light: the ray that follows the first event still sees what shines.
    pub fn at_limit(&self, settings: &Settings) -> bool {
        self.total > settings.max_bounces
            || self.diffuse > settings.diffuse_bounces
            || self.glossy > settings.glossy_bounces
            || self.transmission > settings.transmission_bounces
    }
}

/// A ray that goes on from a surface.
#[derive(Debug, Clone, Copy)]
pub struct Continuation {
    /// The ray.
    pub ray: Ray,
    /// Density of its direction [1/sr], for the weight of the light that it meets.
    pub pdf_solid_angle: f32,
    /// Point that it leaves, not moved off the surface.
    pub position: Vec3A,
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

/// What comes back along a ray, apart by origin. Radiance of lights that light sampling also finds
/// is weighted already.
#[derive(Debug, Clone, Copy, Default)]
pub struct Gathered {
    /// From the world, where the ray left the scene.
    pub environment: Vec3A,
    /// From lamps, suns and glowing surfaces that the ray met.
    pub lamps: Vec3A,
    /// Reflected at the surface that the ray met.
    pub indirect: Vec3A,
    /// Length of the ray [m]; infinite where it left the scene.
    pub distance: f32,
}

impl Gathered {
    /// All of it.
    pub fn sum(&self) -> Vec3A {
        self.environment + self.lamps + self.indirect
    }
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
    /// The surface that a ray meets first. `vertex` is the number of the path's vertex there.
    pub fn arrive(&self, ray: &Ray, vertex: u32, sampler: &Sampler) -> Option<Surface> {
        count_ray();
        let hit = if self.see_through {
            let accept = |hit: &Hit| self.is_stopped(hit, ray, vertex, sampler);
            self.accel.closest_hit_where(self.frame, ray, accept)
        } else {
            self.accel.closest_hit(self.frame, ray)
        }?;
        Some(surface::at(self.frame, &hit, ray, &RayInfo::default()))
    }

    /// Whether anything lies on a ray.
    pub fn is_occluded(&self, ray: &Ray, vertex: u32, sampler: &Sampler) -> bool {
        count_ray();
        if self.see_through {
            let accept = |hit: &Hit| self.is_stopped(hit, ray, vertex, sampler);
            self.accel.occluded_where(self.frame, ray, accept)
        } else {
            self.accel.occluded(self.frame, ray)
        }
    }

    /// Transparency by chance: a surface of opacity a stops a ray with probability a. The chance is
    /// the surface's own, so that the order in which the tree meets surfaces does not matter.
    fn is_stopped(&self, hit: &Hit, ray: &Ray, vertex: u32, sampler: &Sampler) -> bool {
        let opacity = surface::opacity(self.frame, hit, ray, &RayInfo::default());
        if opacity >= 1.0 {
            return true;
        }
        let name = hit.instance.wrapping_mul(0x9e37_79b9) ^ hit.triangle.wrapping_mul(0x85eb_ca6b);
        sampler.transparency(name ^ vertex.rotate_left(24)) < opacity
    }

    /// Radiance that a surface reflects: `f cos` times light over all directions, by one light
    /// sample and one path that goes on.
    pub fn reflected(
        &self,
        surface: &Surface,
        from: Bounces,
        throughput: f32,
        sampler: &Sampler,
    ) -> Vec3A {
        let direct = self.direct(
            surface,
            from.total,
            strategy_at(from.total),
            sampler,
            |bsdf, pdfs| {
                let pdf = bsdf.pdf(pdfs);
                LobePdfs {
                    lambert: pdf,
                    own: pdf,
                }
            },
        );
        direct.sum() + self.continued(surface, from, throughput, sampler)
    }

    fn continued(
        &self,
        surface: &Surface,
        from: Bounces,
        throughput: f32,
        sampler: &Sampler,
    ) -> Vec3A {
        let numbers = sampler.scatter(from.total);
        let Some(sample) = surface.bsdf.sample(numbers.lobe, numbers.direction) else {
            return Vec3A::ZERO;
        };
        let pdf_solid_angle = surface.bsdf.pdf(sample.pdfs);
        let weight = sample.value.sum() / pdf_solid_angle;
        let throughput = throughput * weight.max_element();
        let survival = survival_probability(from.total + 1, throughput);
        if !(survival > 0.0) || numbers.roulette >= survival {
            return Vec3A::ZERO;
        }
        let next = Continuation {
            ray: surface.ray_towards(sample.direction),
            pdf_solid_angle,
            position: surface.position,
            normal: surface.normal_towards(sample.direction),
            strategy: strategy_at(from.total),
            bounces: from.after(sample.part),
            throughput: throughput / survival,
            wants_distance: false,
        };
        self.gather(&next, sampler).sum() * weight / survival
    }

    /// What comes back along a ray that goes on from a surface.
    pub fn gather(&self, from: &Continuation, sampler: &Sampler) -> Gathered {
        let ray = &from.ray;
        let vertex = from.bounces.total;
        let last = from.bounces.at_limit(self.settings);
        if last && !from.wants_distance && !self.lights.can_be_met() {
            // Only whether the ray leaves the scene matters now.
            let hidden = self.is_occluded(ray, vertex, sampler);
            let environment = if hidden {
                Vec3A::ZERO
            } else {
                self.environment(from)
            };
            let distance = f32::INFINITY;
            return Gathered {
                environment,
                distance,
                ..Gathered::default()
            };
        }
        let surface = self.arrive(ray, vertex, sampler);
        let distance = surface.as_ref().map_or(ray.t_max, |s| s.distance);
        let mut gathered = Gathered {
            distance,
            ..Gathered::default()
        };
        gathered.lamps = self.lamps(from, distance);
        let Some(surface) = surface else {
            gathered.environment = self.environment(from);
            return gathered;
        };
        if surface.emission != Vec3A::ZERO {
            let pdf_light = self.lights.emissive_pdf(
                surface.hit.instance,
                surface.hit.triangle,
                from.position,
                from.normal,
                from.strategy,
                surface.position,
            );
            gathered.lamps += surface.emission * balance(from.pdf_solid_angle, pdf_light);
        }
        if !last {
            gathered.indirect = self.reflected(&surface, from.bounces, from.throughput, sampler);
        }
        gathered
    }

    fn environment(&self, from: &Continuation) -> Vec3A {
        let direction = from.ray.direction;
        let radiance = self.lights.environment_radiance(direction);
        let pdf_light =
            self.lights
                .environment_pdf(from.position, from.normal, from.strategy, direction);
        radiance * balance(from.pdf_solid_angle, pdf_light)
    }

    /// Light of the lamps on a ray up to `distance`.
    fn lamps(&self, from: &Continuation, distance: f32) -> Vec3A {
        let ray = Ray {
            t_max: distance,
            ..from.ray
        };
        let lamps = self
            .lights
            .lamps_along(&ray, from.normal, from.strategy, false);
        lamps
            .map(|lamp| lamp.radiance * balance(from.pdf_solid_angle, lamp.pdf_solid_angle))
            .sum()
    }

    /// Light found by sampling lights, scattered towards the viewer, for each part of the surface:
    /// from its front, and from behind where light comes through. `pdfs` says with which density
    /// each part's own samples would find the same direction.
    pub fn direct(
        &self,
        surface: &Surface,
        vertex: u32,
        strategy: Strategy,
        sampler: &Sampler,
        pdfs: impl Fn(&Bsdf, LobePdfs) -> LobePdfs,
    ) -> LobeValues {
        let mut sum = LobeValues::default();
        let sides: &[f32] = match surface.bsdf.is_transmissive() {
            true => &[1.0, -1.0],
            false => &[1.0],
        };
        for side in sides {
            let lights = self.lights.sample(
                surface.position,
                side * surface.normal,
                strategy,
                &sampler.light(vertex),
                || sampler.sky(vertex),
            );
            // A light that reaches around the horizon is found from both sides: each counts for its
            // own directions.
            let is_on_side =
                |light: &LightSample| side * light.direction.dot(surface.geometric_normal) > 0.0;
            for light in lights.into_iter().flatten().filter(is_on_side) {
                sum += self.lit_by(&light, surface, vertex, sampler, &pdfs);
            }
        }
        sum
    }

    /// What a light sample contributes; see [`Tracer::direct`].
    fn lit_by(
        &self,
        light: &LightSample,
        surface: &Surface,
        vertex: u32,
        sampler: &Sampler,
        pdfs: impl Fn(&Bsdf, LobePdfs) -> LobePdfs,
    ) -> LobeValues {
        let (values, own) = surface.bsdf.eval(light.direction);
        if values.sum() == Vec3A::ZERO || self.is_shadowed(surface, light, vertex, sampler) {
            return LobeValues::default();
        }
        let own = pdfs(&surface.bsdf, own);
        let radiance = self.lights.radiance(light);
        LobeValues {
            lambert: values.lambert * radiance * weight(light, own.lambert),
            diffuse: values.diffuse * radiance * weight(light, own.own),
            glossy: values.glossy * radiance * weight(light, own.own),
            transmission: values.transmission * radiance * weight(light, own.own),
        }
    }

    fn is_shadowed(
        &self,
        surface: &Surface,
        light: &LightSample,
        vertex: u32,
        sampler: &Sampler,
    ) -> bool {
        let mut ray = surface.ray_towards(light.direction);
        ray.t_max = light.distance * SHADOW_END;
        self.is_occluded(&ray, vertex, sampler)
    }
}

/// Weight of a light sample over its density, given the density with which surface sampling finds
/// it.
fn weight(light: &LightSample, own_pdf: f32) -> f32 {
    let weight = if light.is_delta {
        1.0
    } else {
        balance(light.pdf_solid_angle, own_pdf)
    };
    weight / light.pdf_solid_angle
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
