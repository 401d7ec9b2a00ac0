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
use crate::shader::{RayInfo, RayKind};
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
    /// For each instance whether it lets light through or is not seen by some rays; empty where
    /// none does.
    pub see_through: &'a [bool],
}

/// Scattering events so far, as the bounce limits count them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Bounces {
    total: u32,
    diffuse: u32,
    glossy: u32,
    transmission: u32,
    /// What scattered the ray last; none for a camera ray.
    last: Option<Part>,
    /// Smallest density [1/sr] of the directions so far, once there was one.
    least_pdf: Option<f32>,
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
            last: Some(part),
            ..self
        }
    }

    /// The same, with the density [1/sr] of the direction that the last event chose.
    fn along(self, pdf_solid_angle: f32) -> Self {
        let least = self.least_pdf.unwrap_or(f32::INFINITY);
        Self {
            least_pdf: Some(least.min(pdf_solid_angle)),
            ..self
        }
    }

    /// What the ray that follows is.
    pub fn kind(&self) -> RayKind {
        match self.last {
            None => RayKind::Camera,
            Some(Part::Diffuse) => RayKind::Diffuse,
            Some(Part::Glossy) => RayKind::Glossy,
            Some(Part::Transmission) => RayKind::Transmission,
        }
    }

    /// What the Light Path node tells of the ray that follows.
    fn ray_info(&self) -> RayInfo {
        RayInfo {
            kind: self.kind(),
            depth: self.total,
            diffuse_depth: self.diffuse,
            glossy_depth: self.glossy,
            transmission_depth: self.transmission,
            ..RayInfo::default()
        }
    }

    /// Number of the vertex that is lit by what the ray that follows finds; the camera's counts as
    /// the first surface.
    fn lit_vertex(&self) -> u32 {
        self.total.saturating_sub(1)
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
    /// Probability of the Lambert part of the surface that the ray met; 0 without one.
    pub probability_lambert: f32,
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

/// The numbers that decide whether surfaces stop a ray. Each is the surface's own, so that the order
/// in which the tree meets surfaces does not matter.
struct Chance<'a> {
    sampler: &'a Sampler,
    vertex: u32,
}

impl<'a> Chance<'a> {
    fn new(bounces: &Bounces, sampler: &'a Sampler) -> Self {
        Self {
            sampler,
            vertex: bounces.total,
        }
    }

    fn of(&self, hit: &Hit) -> f32 {
        let name = hit.instance.wrapping_mul(0x9e37_79b9) ^ hit.triangle.wrapping_mul(0x85eb_ca6b);
        self.sampler
            .transparency(name ^ self.vertex.rotate_left(24))
    }
}

/// The transparent surfaces that a ray passed, in the order in which the tree showed them.
#[derive(Default)]
struct Passed(Vec<Hit>);

impl Passed {
    /// Remembers a surface; false, for it stops nothing.
    fn note(&mut self, hit: &Hit) -> bool {
        self.0.push(*hit);
        false
    }

    /// The surface nearer than `end` at which a ray that passes `limit` ones must stop.
    fn beyond(self, limit: u32, end: f32) -> Option<Hit> {
        let mut passed = self.0;
        passed.retain(|hit| hit.t < end);
        let limit = limit as usize;
        (passed.len() > limit).then(|| *passed.select_nth_unstable_by(limit, by_distance).1)
    }
}

/// What light must be multiplied with, so that a path that carries `throughput` brings the pixel at
/// most `limit`, as a mean over the channels. Zero sets no limit.
fn clamp_factor(radiance: Vec3A, throughput: f32, limit: f32) -> f32 {
    let brought = throughput * radiance.element_sum() / 3.0;
    if limit > 0.0 && brought > limit {
        limit / brought
    } else {
        1.0
    }
}

fn clamped(radiance: Vec3A, throughput: f32, limit: f32) -> Vec3A {
    radiance * clamp_factor(radiance, throughput, limit)
}

fn by_distance(a: &Hit, b: &Hit) -> std::cmp::Ordering {
    a.t.total_cmp(&b.t)
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
    /// The surface that a ray meets first after the events `bounces`.
    pub fn arrive(&self, ray: &Ray, bounces: &Bounces, sampler: &Sampler) -> Option<Surface> {
        count_ray();
        let info = bounces.ray_info();
        let at = |hit: &Hit| surface::at(self.frame, hit, ray, &info);
        if self.see_through.is_empty() {
            return self.accel.closest_hit(self.frame, ray).as_ref().map(at);
        }
        let mut passed = Passed::default();
        let chance = Chance::new(bounces, sampler);
        let accept = |hit: &Hit| self.is_met(hit, ray, &info, &chance, &mut passed);
        let hit = self.accel.closest_hit_where(self.frame, ray, accept);
        let end = hit.map_or(f32::INFINITY, |hit| hit.t);
        match passed.beyond(self.settings.transparent_max_bounces, end) {
            Some(last) => Some(at(&last).blackened()),
            None => hit.as_ref().map(at),
        }
    }

    /// Whether a scattered ray meets a surface.
    fn is_hidden(&self, ray: &Ray, bounces: &Bounces, sampler: &Sampler) -> bool {
        count_ray();
        if self.see_through.is_empty() {
            self.accel.occluded(self.frame, ray)
        } else {
            self.is_stopped_on_the_way(ray, &bounces.ray_info(), bounces, sampler)
        }
    }

    /// Whether anything lies on a ray that looks for a light after the events `bounces`.
    pub fn is_occluded(&self, ray: &Ray, bounces: &Bounces, sampler: &Sampler) -> bool {
        count_ray();
        if self.see_through.is_empty() {
            return self.accel.occluded(self.frame, ray);
        }
        let info = RayInfo {
            kind: RayKind::Shadow,
            ..bounces.ray_info()
        };
        self.is_stopped_on_the_way(ray, &info, bounces, sampler)
    }

    fn is_stopped_on_the_way(
        &self,
        ray: &Ray,
        info: &RayInfo,
        bounces: &Bounces,
        sampler: &Sampler,
    ) -> bool {
        let mut passed = Passed::default();
        let chance = Chance::new(bounces, sampler);
        let accept = |hit: &Hit| self.is_met(hit, ray, info, &chance, &mut passed);
        let limit = self.settings.transparent_max_bounces;
        self.accel.occluded_where(self.frame, ray, accept)
            || passed.beyond(limit, f32::INFINITY).is_some()
    }

    /// Whether a surface stops a ray that sees it; one that it passes is noted.
    fn is_met(
        &self,
        hit: &Hit,
        ray: &Ray,
        info: &RayInfo,
        chance: &Chance,
        passed: &mut Passed,
    ) -> bool {
        !self.see_through[hit.instance as usize]
            || self.is_seen(hit, info)
                && (self.is_stopped(hit, ray, info, chance) || passed.note(hit))
    }

    /// Whether a ray meets what lies on it, or does not even see it.
    fn is_seen(&self, hit: &Hit, info: &RayInfo) -> bool {
        let instance = &self.frame.instances[hit.instance as usize];
        instance.visibility.includes(info.kind)
    }

    /// Transparency by chance: a surface of opacity a stops a ray with probability a.
    fn is_stopped(&self, hit: &Hit, ray: &Ray, info: &RayInfo, chance: &Chance) -> bool {
        let opacity = surface::opacity(self.frame, hit, ray, info);
        opacity >= 1.0 || chance.of(hit) < opacity
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
            &from,
            strategy_at(from.total),
            sampler,
            Bsdf::mixed,
        );
        let direct = match from.total {
            0 => direct.sum(),
            _ => clamped(direct.sum(), throughput, self.settings.clamp_indirect),
        };
        direct + self.continued(surface, from, throughput, sampler)
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
        let last = from.bounces.at_limit(self.settings);
        // Light right behind the first event comes straight from its source.
        let limit = match from.bounces.total {
            0 | 1 => self.settings.clamp_direct,
            _ => self.settings.clamp_indirect,
        };
        let clamped = |radiance| clamped(radiance, from.throughput, limit);
        if last && !from.wants_distance && !self.lights.can_be_met() {
            // Only whether the ray leaves the scene matters now.
            let hidden = self.is_hidden(ray, &from.bounces, sampler);
            let environment = if hidden {
                Vec3A::ZERO
            } else {
                clamped(self.environment(from))
            };
            let distance = f32::INFINITY;
            return Gathered {
                environment,
                distance,
                ..Gathered::default()
            };
        }
        let mut surface = self.arrive(ray, &from.bounces, sampler);
        let bounces = from.bounces.along(from.pdf_solid_angle);
        if let Some(surface) = &mut surface {
            self.calm(surface, &bounces);
        }
        let distance = surface.as_ref().map_or(ray.t_max, |s| s.distance);
        let mut gathered = Gathered {
            distance,
            ..Gathered::default()
        };
        gathered.lamps = clamped(self.lamps(from, distance));
        let Some(surface) = surface else {
            gathered.environment = clamped(self.environment(from));
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
            let glow = surface.emission * balance(from.pdf_solid_angle, pdf_light);
            gathered.lamps += clamped(glow);
        }
        gathered.probability_lambert = surface.bsdf.probability_lambert();
        if !last {
            gathered.indirect = self.reflected(&surface, bounces, from.throughput, sampler);
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

    fn environment(&self, from: &Continuation) -> Vec3A {
        let direction = from.ray.direction;
        let (kind, vertex) = (from.bounces.kind(), from.bounces.lit_vertex());
        let radiance = self.lights.environment_radiance(direction, kind, vertex);
        if radiance == Vec3A::ZERO {
            return radiance;
        }
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
        let (kind, vertex) = (from.bounces.kind(), from.bounces.lit_vertex());
        let lamps = self
            .lights
            .lamps_along(&ray, from.normal, from.strategy, kind, vertex);
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
        from: &Bounces,
        strategy: Strategy,
        sampler: &Sampler,
        pdfs: impl Fn(&Bsdf, LobePdfs) -> LobePdfs,
    ) -> LobeValues {
        let vertex = from.total;
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
                sum += self.lit_by(&light, surface, from, sampler, &pdfs);
            }
        }
        match vertex {
            0 => sum * clamp_factor(sum.sum(), 1.0, self.settings.clamp_direct),
            _ => sum,
        }
    }

    /// What a light sample contributes; see [`Tracer::direct`].
    fn lit_by(
        &self,
        light: &LightSample,
        surface: &Surface,
        from: &Bounces,
        sampler: &Sampler,
        pdfs: impl Fn(&Bsdf, LobePdfs) -> LobePdfs,
    ) -> LobeValues {
        let (values, own) = surface.bsdf.eval(light.direction);
        let values = found_by(light, values, from.total);
        if values.sum() == Vec3A::ZERO || self.is_shadowed(surface, light, from, sampler) {
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
        from: &Bounces,
        sampler: &Sampler,
    ) -> bool {
        if !light.reach.visibility.includes(RayKind::Shadow) {
            return false;
        }
        let mut ray = surface.ray_towards(light.direction);
        ray.t_max = light.distance * SHADOW_END;
        self.is_occluded(&ray, from, sampler)
    }
}

/// What a surface does with light, as far as rays from its parts would find the light.
fn found_by(light: &LightSample, values: LobeValues, vertex: u32) -> LobeValues {
    let part = |value, kind| match light.reach.includes(kind, vertex) {
        true => value,
        false => Vec3A::ZERO,
    };
    LobeValues {
        lambert: part(values.lambert, RayKind::Diffuse),
        diffuse: part(values.diffuse, RayKind::Diffuse),
        glossy: part(values.glossy, RayKind::Glossy),
        transmission: part(values.transmission, RayKind::Transmission),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::{Filter, Method};
    use crate::testing::{
        Scene, Shoot, camera, diffuse, glossy, mean_radiance, plain_world, square,
    };
    use glam::{Affine3A, Vec3};

    #[test]
    fn light_is_limited_by_what_it_brings_and_zero_is_no_limit() {
        let bright = Vec3A::new(6.0, 3.0, 0.0);
        assert_eq!(clamped(bright, 1.0, 0.0), bright);
        assert_eq!(clamped(bright, 1.0, 3.0), bright);
        assert_eq!(clamped(bright, 2.0, 3.0), 0.5 * bright);
        assert_eq!(clamped(Vec3A::ZERO, 1.0, 3.0), Vec3A::ZERO);
    }

    #[test]
    fn the_surface_where_a_ray_must_stop_is_the_nearest_beyond_the_limit() {
        let hit = |t| Hit {
            t,
            instance: 0,
            triangle: 0,
            u: 0.0,
            v: 0.0,
        };
        let stop = |limit, end| {
            let mut passed = Passed::default();
            for t in [3.0, 1.0, 4.0, 2.0] {
                assert!(!passed.note(&hit(t)));
            }
            passed.beyond(limit, end).map(|hit| hit.t)
        };
        assert_eq!(stop(0, f32::INFINITY), Some(1.0));
        assert_eq!(stop(2, f32::INFINITY), Some(3.0));
        assert_eq!(stop(2, 2.5), None);
        assert_eq!(stop(4, f32::INFINITY), None);
    }

    /// A diffuse floor beside a mirror wall: without caustics the wall gives it nothing.
    #[test]
    fn diffuse_surfaces_get_no_caustics_when_they_are_off() {
        let mean = |caustics_reflective, reflectance| {
            let mut scene = Scene::new();
            scene.world = plain_world(1.0);
            scene.camera = camera(Vec3::new(0.0, 0.0, 1.5), Vec3::ZERO, 0.7);
            scene.add(square(), Affine3A::IDENTITY, diffuse(0.5));
            let wall = Affine3A::from_rotation_y(std::f32::consts::FRAC_PI_2);
            let wall = Affine3A::from_translation(Vec3::new(-0.6, 0.0, 0.0)) * wall;
            scene.add(square(), wall, glossy(reflectance, 0.3));
            let frames = [scene.frame(1)];
            let settings = Settings {
                method: Method::Path,
                samples: 64,
                filter: Filter::Box,
                caustics_reflective,
                ..Settings::default()
            };
            let shoot = Shoot {
                frames: &frames,
                settings,
                size: 8,
                threads: 1,
            };
            mean_radiance(&shoot.pictures(&[1])[0])
        };
        let (off, black) = (mean(false, 0.9), mean(true, 0.0));
        // The numbers choose the same directions: only rounding of the light's choice differs.
        assert!((off / black - 1.0).abs() < 0.01, "{off} {black}");
        assert!(mean(true, 0.9) > 1.05 * black);
    }
}
