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
use crate::media::{Flight, Journey, Media};
use crate::neighbourhood::Neighbourhood;
use crate::sampling::{
    Bsdf, BsdfSample, LightSample, LightSampler, LobePdfs, LobeValues, Part, Receiver, Sampler,
    Strategy, alpha_of,
};
use crate::scene::{Links, Membership, SceneFrame};
use crate::shader::{Around, RayInfo, RayKind};
use crate::surface::{self, Passage, Surface};

mod body;
mod groups;

use body::Entered;

/// Bounces before Russian roulette may end a path; Cycles begins there too.
const ROULETTE_FROM: u32 = 3;

/// Density [1/sr] below which a scattered ray sees no bevels; Cycles has the same limit.
const BLURRED_PDF: f32 = 8.0;

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
    /// What fills its bodies and its world.
    pub media: &'a Media,
}

/// Scattering events so far, as the bounce limits count them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Bounces {
    total: u32,
    diffuse: u32,
    glossy: u32,
    transmission: u32,
    volume: u32,
    /// How many of them went through glass that counts as clear; see [`Tracer::after`].
    clear: u32,
    /// See-through surfaces that the path passed; they are no events.
    passed: u32,
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
            volume: self.volume + count(Part::Volume),
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
            Some(Part::Diffuse | Part::Volume) => RayKind::Diffuse,
            Some(Part::Glossy) => RayKind::Glossy,
            Some(Part::Transmission) => RayKind::Transmission,
        }
    }

    /// What the Light Path node tells of the ray that follows.
    pub fn ray_info<'a>(&self, around: Option<&'a dyn Around>) -> RayInfo<'a> {
        RayInfo {
            kind: self.kind(),
            depth: self.total,
            diffuse_depth: self.diffuse,
            glossy_depth: self.glossy,
            transmission_depth: self.transmission,
            transparent_depth: self.passed,
            around,
            ..RayInfo::default()
        }
    }

    /// The same of a ray that looks for a light.
    pub fn shadow_info(&self) -> RayInfo<'static> {
        RayInfo {
            kind: RayKind::Shadow,
            ..self.ray_info(None)
        }
    }

    /// See-through surfaces that the ray that follows may pass. As in Cycles a limit of zero still lets
    /// the path pass one.
    fn passes_left(&self, settings: &Settings) -> u32 {
        let limit = settings.transparent_max_bounces.max(1);
        limit.saturating_sub(self.passed)
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
            || self.volume > settings.volume_bounces
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

/// Light that a surface sends to the camera, as passes divide it: see [`LobeValues::by_pass`].
#[derive(Debug, Clone, Copy, Default)]
pub struct Divided {
    /// Whether a medium scattered it.
    pub is_of_medium: bool,
    /// Straight from its source.
    pub direct: [Vec3A; 3],
    /// By way of other surfaces.
    pub indirect: [Vec3A; 3],
}

impl Divided {
    /// Nothing yet, from this surface.
    pub fn of(surface: &Surface) -> Self {
        Self {
            is_of_medium: surface.is_medium,
            ..Self::default()
        }
    }

    /// Adds light (straight from its source, by way of other surfaces) that is scattered by these
    /// values times `scale`.
    pub fn add(&mut self, values: &LobeValues, [direct, indirect]: [Vec3A; 2], scale: f32) {
        for (part, value) in values.by_pass().into_iter().enumerate() {
            self.direct[part] += direct * value * scale;
            self.indirect[part] += indirect * value * scale;
        }
    }

    /// Adds light straight from its source that is scattered already.
    pub fn add_direct(&mut self, scattered: &LobeValues) {
        self.add(scattered, [Vec3A::ONE, Vec3A::ZERO], 1.0);
    }
}

/// What a surface reflects.
#[derive(Default)]
pub struct Reflected {
    /// Light of light samples, scattered.
    direct: LobeValues,
    /// What came along the path that goes on.
    gathered: Gathered,
    /// `f cos` of the direction that it took [1/sr].
    value: LobeValues,
    /// Density of that direction [1/sr], and the probability of going on.
    pdf_solid_angle: f32,
    survival: f32,
}

impl Reflected {
    /// All of it.
    pub fn sum(&self) -> Vec3A {
        if self.survival == 0.0 {
            return self.direct.sum();
        }
        let weight = self.value.sum() / self.pdf_solid_angle;
        self.direct.sum() + self.gathered.sum() * weight / self.survival
    }

    /// All of it times a colour.
    fn tinted(self, color: Vec3A) -> Self {
        Self {
            direct: self.direct * color,
            value: self.value * color,
            ..self
        }
    }

    /// Adds it to what passes keep, times `scale`.
    pub fn divide(&self, divided: &mut Divided, scale: f32) {
        divided.add(&self.direct, [Vec3A::ONE, Vec3A::ZERO], scale);
        if self.survival > 0.0 {
            let scale = scale / (self.pdf_solid_angle * self.survival);
            divided.add(&self.value, self.gathered.by_way(), scale);
        }
    }
}

/// What comes back along a ray, apart by origin. Radiance of lights that light sampling also finds
/// is weighted already.
#[derive(Debug, Clone, Copy, Default)]
pub struct Gathered {
    /// From the world, where the ray left the scene.
    pub environment: Vec3A,
    /// The same, not weighted: as much as it would be if only rays found the world.
    pub open_sky: Vec3A,
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

    /// Straight from its source, and by way of other surfaces.
    pub fn by_way(&self) -> [Vec3A; 2] {
        [self.environment + self.lamps, self.indirect]
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
    /// Chances of a ray of this kind. A shadow ray may meet what the ray before it passed, and has
    /// its own luck.
    fn new(kind: RayKind, bounces: &Bounces, sampler: &'a Sampler) -> Self {
        let is_shadow = u32::from(kind == RayKind::Shadow);
        Self {
            sampler,
            vertex: bounces.total ^ is_shadow << 7,
        }
    }

    fn of(&self, hit: &Hit) -> f32 {
        let name = hit.instance.wrapping_mul(0x9e37_79b9) ^ hit.triangle.wrapping_mul(0x85eb_ca6b);
        self.sampler
            .transparency(name ^ self.vertex.rotate_left(24))
    }
}

/// A transparent surface that a ray passed.
#[derive(Clone, Copy)]
struct Crossing {
    hit: Hit,
    /// Share of the light that it lets through, over its probability of letting the ray pass.
    share: Vec3A,
    /// Mean share of the light that it does not let through.
    opacity: f32,
}

/// The transparent surfaces that a ray passed, in the order in which the tree showed them, and the
/// media in between.
#[derive(Default)]
pub struct Passed {
    surfaces: Vec<Crossing>,
    flight: Flight,
    /// Light that the media gave off.
    pub glow: Vec3A,
}

impl Passed {
    /// Remembers a surface; false, for it stops nothing.
    fn note(&mut self, hit: &Hit, Passage { share, probability }: Passage) -> bool {
        self.surfaces.push(Crossing {
            hit: *hit,
            share: share / probability,
            opacity: 1.0 - share.element_sum() / 3.0,
        });
        false
    }

    /// The nearest surface of at least this opacity.
    pub fn first_of(&self, opacity: f32) -> Option<&Hit> {
        let dense = self.surfaces.iter().filter(|c| c.opacity >= opacity);
        dense.min_by(|a, b| by_distance(a, b)).map(|c| &c.hit)
    }

    /// The farthest surface.
    pub fn last(&self) -> Option<&Hit> {
        let last = self.surfaces.iter().max_by(|a, b| by_distance(a, b));
        last.map(|c| &c.hit)
    }

    /// Takes back what lies beyond `end`; the surface at which a ray that passes `limit` ones must
    /// stop.
    fn end_at(&mut self, end: f32, limit: u32) -> Option<Hit> {
        self.surfaces.retain(|c| c.hit.t < end);
        let limit = limit as usize;
        if self.surfaces.len() <= limit {
            return None;
        }
        let last = self
            .surfaces
            .select_nth_unstable_by(limit, by_distance)
            .1
            .hit;
        self.surfaces.truncate(limit);
        Some(last)
    }

    /// Number of surfaces nearer than this.
    fn count(&self, distance: f32) -> usize {
        self.surfaces.iter().filter(|c| c.hit.t < distance).count()
    }

    /// Whether a ray that passes `limit` surfaces has ended before this distance.
    fn has_ended(&self, distance: f32, limit: u32) -> bool {
        let limit = limit as usize;
        self.surfaces.len() > limit && self.count(distance) > limit
    }

    /// Share of the light from this distance that arrives.
    pub fn share(&self, distance: f32) -> Vec3A {
        let nearer = self.surfaces.iter().filter(|c| c.hit.t < distance);
        let passed: Vec3A = nearer.map(|c| c.share).product();
        passed * self.flight.share(distance)
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

fn by_distance(a: &Crossing, b: &Crossing) -> std::cmp::Ordering {
    a.hit.t.total_cmp(&b.hit.t)
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
        if let Some(mut collision) = collision {
            collision.weight *= passed.share(collision.t);
            surface = Some(surface::in_medium(ray, &collision));
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
        if passed.surfaces.len() == limit as usize {
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

    /// Whether a ray meets what lies on it, or does not even see it.
    fn is_seen(&self, hit: &Hit, info: &RayInfo) -> bool {
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
        let below = surface.below.as_ref()?;
        let entered = Entered {
            tracer: self,
            surface,
        };
        let exit = below.scatter(&entered, &mut sampler.walk(from.total))?;
        let mut outside = surface::exit(self.frame, &exit.hit, &exit.ray, &from.ray_info(None));
        outside.passed = surface.passed;
        Some((outside, below.weight * exit.carried))
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
        let next = Continuation {
            ray: surface.ray_towards(sample.direction),
            pdf_solid_angle,
            position: surface.position,
            membership: surface.membership,
            normal: surface.normal_towards(sample.direction),
            strategy: strategy_at(from.total),
            bounces: self.after(from, surface, sample.part, sample.alpha),
            throughput: throughput / survival,
            wants_distance: false,
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
        Bounces {
            clear: from.clear + u32::from(is_clear),
            passed: surface.passed,
            ..from.after(part)
        }
    }

    /// Largest GGX alpha of glass through which the film's transparent background is seen; none is
    /// so smooth where the background shows.
    fn clear_alpha(&self) -> f32 {
        let settings = self.settings;
        match settings.film_transparent && settings.film_transparent_glass {
            true => alpha_of(settings.film_transparent_roughness),
            false => 0.0,
        }
    }

    /// Whether a ray that finds the background adds nothing to the picture but transparency.
    pub fn hides_background(&self, bounces: &Bounces) -> bool {
        self.settings.film_transparent && bounces.clear == bounces.total
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
            // Only whether the ray leaves the scene matters now.
            let around = self.around(ray, &from.bounces, sampler);
            let info = from.bounces.ray_info(Some(&around));
            let share = self.unblocked_share(ray, &info, Links::default());
            let mut gathered = Gathered {
                distance: f32::INFINITY,
                ..Gathered::default()
            };
            if share != Vec3A::ZERO {
                self.add_environment(from, share, clamped, &mut gathered);
            }
            return gathered;
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
        let Some(surface) = surface else {
            self.add_environment(from, passed.share(distance), clamped, &mut gathered);
            return gathered;
        };
        gathered.lamps += clamped(self.glow(from, &surface));
        gathered.probability_lambert = surface.bsdf.probability_lambert();
        if !last {
            let reflected = self.reflected(&surface, bounces, from.throughput, sampler);
            let below = self.from_below(&surface, bounces, from.throughput, sampler);
            gathered.indirect = reflected.sum() + below.map_or(Vec3A::ZERO, |below| below.sum());
        }
        gathered
    }

    /// Light of a glowing surface that a ray meets, beside the light samples of its strategy.
    fn glow(&self, from: &Continuation, surface: &Surface) -> Vec3A {
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
        surface.emission * balance(from.pdf_solid_angle, pdf_light)
    }

    /// Whether a glowing surface that a ray meets lights the thing that the ray comes from.
    fn is_lit_by_glow(&self, from: &Continuation, glowing: &Surface) -> bool {
        let instance = &self.frame.instances[glowing.hit.instance as usize];
        is_linked(instance.links, from.membership)
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

    /// Radiance of the world where a ray leaves the scene after the events `bounces`.
    pub fn environment(&self, direction: Vec3A, bounces: &Bounces) -> Vec3A {
        let (kind, vertex) = (bounces.kind(), bounces.lit_vertex());
        self.lights.environment_radiance(direction, kind, vertex)
    }

    /// Adds what a ray brings from the world, of which `share` gets through.
    fn add_environment(
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
        balance(from.pdf_solid_angle, pdf_light)
    }

    /// Light of the lamps on a ray up to `distance`, through what it passed.
    fn lamps(&self, from: &Continuation, distance: f32, passed: &Passed) -> Vec3A {
        let mut sum = Vec3A::ZERO;
        self.each_lamp(from, distance, passed, |_, light| sum += light);
        sum
    }

    /// The same lamp by lamp.
    #[inline(always)]
    fn each_lamp(
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
            let weight = balance(from.pdf_solid_angle, lamp.pdf_solid_angle);
            emit(lamp.links, passed.share(lamp.t) * lamp.radiance * weight);
        }
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
        let mut sum = LobeValues::default();
        self.each_lit(surface, from, strategy, sampler, pdfs, |_, lit| sum += lit);
        match from.total {
            0 => sum * clamp_factor(sum.sum(), 1.0, self.settings.clamp_direct),
            _ => sum,
        }
    }

    /// The same light by light, as if nothing limited it.
    #[inline(always)]
    fn each_lit(
        &self,
        surface: &Surface,
        from: &Bounces,
        strategy: Strategy,
        sampler: &Sampler,
        pdfs: impl Fn(&Bsdf, LobePdfs) -> LobePdfs,
        mut emit: impl FnMut(&LightSample, LobeValues),
    ) {
        let vertex = from.total;
        let sides: &[f32] = match surface.bsdf.is_transmissive() {
            true => &[1.0, -1.0],
            false => &[1.0],
        };
        for side in sides {
            let receiver = Receiver {
                point: surface.position,
                normal: side * surface.normal,
                time: surface.time,
            };
            let lights = self
                .lights
                .sample(&receiver, strategy, &sampler.light(vertex), || {
                    sampler.sky(vertex)
                });
            // A light that reaches around the horizon is found from both sides: each counts for its
            // own directions.
            let is_on_side = |light: &LightSample| side * light.direction.dot(surface.normal) > 0.0;
            for light in lights.into_iter().flatten().filter(is_on_side) {
                emit(&light, self.lit_by(&light, surface, from, sampler, &pdfs));
            }
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
        let (mut values, own) = surface.bsdf.eval(light.direction);
        let is_background = light.radiance.is_none();
        if is_background && self.hides_background(from) && surface.bsdf.is_clear(self.clear_alpha())
        {
            values.transmission = Vec3A::ZERO;
        }
        let values = match surface.membership.is_lit_by(light.reach.links) {
            true => found_by(light, values, from.total),
            false => return LobeValues::default(),
        };
        if values.sum() == Vec3A::ZERO {
            return LobeValues::default();
        }
        let share = self.unshadowed(surface, light, from, sampler);
        if share == Vec3A::ZERO {
            return LobeValues::default();
        }
        let own = pdfs(&surface.bsdf, own);
        let radiance = share * self.lights.radiance(light);
        let lit = values * radiance;
        LobeValues {
            lambert: lit.lambert * weight(light, own.lambert),
            ..lit * weight(light, own.own)
        }
    }

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
    fn unshadowed(
        &self,
        surface: &Surface,
        light: &LightSample,
        from: &Bounces,
        sampler: &Sampler,
    ) -> Vec3A {
        if !light.reach.visibility.includes(RayKind::Shadow) {
            return Vec3A::ONE;
        }
        let mut ray = surface.ray_to_light(self.frame, light.direction, light.distance);
        ray.t_max *= SHADOW_END;
        let from = Bounces {
            passed: surface.passed,
            ..*from
        };
        self.lit_share(&ray, &from, light.reach.links, sampler)
    }
}

/// All of the light, or nothing.
fn lit(is_lit: bool) -> Vec3A {
    match is_lit {
        true => Vec3A::ONE,
        false => Vec3A::ZERO,
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
        translucent: part(values.translucent, RayKind::Transmission),
    }
}

/// Weight of a light sample over its density, given the density with which surface sampling finds
/// it.
fn weight(light: &LightSample, own_pdf: f32) -> f32 {
    let weight = if light.is_delta || light.reach.links.blockers != 0 {
        1.0
    } else {
        balance(light.pdf_solid_angle, own_pdf)
    };
    weight / light.pdf_solid_angle
}

/// Whether a light of these links that a ray from a thing of these sets runs into lights it. What
/// other things than the ray's would stop its light is left to light samples, as in Cycles.
fn is_linked(links: Links, membership: Membership) -> bool {
    membership.is_lit_by(links) && links.blockers == 0
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
    use crate::scene::{Filling, Light, LightKind, Material, Medium, Reach};
    use crate::shader::{Draft, Row};
    use crate::testing::{
        Scene, Shoot, camera, cube, diffuse, glossy, glowing, mean_radiance, plain_world, square,
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
        let passed = || {
            let mut passed = Passed::default();
            for t in [3.0, 1.0, 4.0, 2.0] {
                let passage = Passage {
                    share: 0.2 * Vec3A::splat(t),
                    probability: 0.2,
                };
                assert!(!passed.note(&hit(t), passage));
            }
            passed
        };
        let stop = |limit, end| passed().end_at(end, limit).map(|hit| hit.t);
        assert_eq!(stop(0, f32::INFINITY), Some(1.0));
        assert_eq!(stop(2, f32::INFINITY), Some(3.0));
        assert_eq!(stop(2, 2.5), None);
        assert_eq!(stop(4, f32::INFINITY), None);
        assert!(passed().has_ended(3.5, 2) && !passed().has_ended(3.0, 2));
        let mut passed = passed();
        assert!((passed.share(2.5) - 2.0).abs().max_element() < 1e-6);
        let first_of = |opacity| passed.first_of(opacity).map(|hit| hit.t);
        assert_eq!(first_of(0.0), Some(1.0));
        assert_eq!(first_of(0.9), None);
        assert_eq!(passed.last().map(|hit| hit.t), Some(4.0));
        passed.end_at(f32::INFINITY, 3);
        assert!((passed.share(f32::INFINITY) - 6.0).abs().max_element() < 1e-5);
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

    fn seen(scene: &Scene) -> f64 {
        seen_after(scene, Settings::default())
    }

    fn seen_after(scene: &Scene, settings: Settings) -> f64 {
        mean_radiance(&picture(scene, settings))
    }

    fn picture(scene: &Scene, settings: Settings) -> Vec<f32> {
        let frames = [scene.frame(1)];
        let settings = Settings {
            method: Method::Path,
            samples: 256,
            filter: Filter::Box,
            ..settings
        };
        let shoot = Shoot {
            frames: &frames,
            settings,
            size: 8,
            threads: 1,
        };
        shoot.pictures(&[1]).swap_remove(0)
    }

    /// A cube of fog in a white world, with what its nodes say per metre.
    fn fog(scatter: f32, absorption: f32, emission: f32) -> Scene {
        let coefficients = [
            ("Weight", 1.0),
            ("Scatter", scatter),
            ("Absorption", absorption),
            ("Emission", emission),
            ("Anisotropy", 0.4),
        ];
        let bare: [(&str, f32); 2] = [("Weight", 1.0), ("Color", 1.0)];
        let material = Material::of(&[("volume", &coefficients), ("transparent", &bare)]);
        let mut scene = Scene::new();
        let place = Affine3A::from_translation(Vec3::new(0.0, 4.0, 0.0));
        scene.add(
            cube(),
            place * Affine3A::from_scale(Vec3::new(9.0, 1.0, 9.0)),
            material,
        );
        scene
    }

    /// A slab of colour, 2 m thick, before a wall that shines: each channel falls by its own law. The
    /// picture is 0.02 rad wide; five standard deviations of numbers left to themselves.
    #[test]
    fn each_channel_of_what_lies_behind_fog_follows_beer() {
        let absorption = Vec3A::new(0.1, 0.5, 1.0);
        let mut fog = Material::of(&[("transparent", &[("Weight", 1.0), ("Color", 1.0)])]);
        fog.medium = Some(Filling::Even(Medium {
            scattering: Vec3A::ZERO,
            absorption,
            emission: Vec3A::ZERO,
            anisotropy: 0.0,
        }));
        let mut scene = Scene::new();
        scene.world = plain_world(0.0);
        scene.camera = camera(Vec3::ZERO, Vec3::Y, 0.02);
        let place = Affine3A::from_translation(Vec3::new(0.0, 4.0, 0.0));
        scene.add(cube(), place, fog);
        let wall = Affine3A::from_rotation_x(std::f32::consts::FRAC_PI_2);
        let wall = Affine3A::from_translation(Vec3::new(0.0, 8.0, 0.0)) * wall;
        scene.add(square(), wall, glowing(1.0));
        let picture = picture(&scene, Settings::default());
        let pixels = picture.as_chunks::<4>().0;
        for channel in 0..3 {
            let sum: f32 = pixels.iter().map(|pixel| pixel[channel]).sum();
            let mean = sum / pixels.len() as f32;
            let expected = (-2.0 * absorption[channel]).exp();
            assert!(
                (mean - expected).abs() < 0.03,
                "{channel}: {mean} {expected}"
            );
        }
    }

    #[test]
    fn each_kind_of_event_has_its_limit() {
        let settings = Settings {
            max_bounces: 4,
            diffuse_bounces: 1,
            glossy_bounces: 2,
            transmission_bounces: 3,
            volume_bounces: 0,
            ..Settings::default()
        };
        let parts = [
            (Part::Diffuse, 1),
            (Part::Glossy, 2),
            (Part::Transmission, 3),
            (Part::Volume, 0),
        ];
        for (part, limit) in parts {
            let mut bounces = Bounces::default();
            for event in 1..=limit + 1 {
                assert!(!bounces.at_limit(&settings), "{part:?} {event}");
                bounces = bounces.after(part);
            }
            assert!(bounces.at_limit(&settings), "{part:?}");
        }
        let mixed = [
            Part::Glossy,
            Part::Glossy,
            Part::Diffuse,
            Part::Transmission,
        ];
        let mixed = mixed.into_iter().fold(Bounces::default(), Bounces::after);
        assert!(!mixed.at_limit(&settings));
        assert!(mixed.after(Part::Transmission).at_limit(&settings));
    }

    /// What only scatters is not seen in a white world, whatever the way of the light.
    #[test]
    fn fog_that_does_not_absorb_is_white_in_a_white_world() {
        let settings = Settings {
            max_bounces: 1024,
            volume_bounces: 1024,
            transparent_max_bounces: 1024,
            ..Settings::default()
        };
        let radiance = seen_after(&fog(1.5, 0.0, 0.0), settings);
        assert!((radiance - 1.0).abs() < 5e-3, "{radiance}");
    }

    /// The same cube with fog that is 1.5 / m thick times what a noise says, up to seven times that.
    fn uneven_fog() -> Scene {
        let rows: &[Row] = &[
            ("coordinate", &[], 1),
            // Three dimensions, FBM, normalised, Fac.
            (
                "noise",
                &[0, -1, -2, -2, -3, -2, -1, -1, -1],
                2 + 4 * (3 + 5),
            ),
            ("multiply", &[1, -4], 0),
            ("multiply", &[2, 1], 0),
            ("volume", &[-5, 3, -1, -1, -3], 0),
            ("transparent", &[-5, -5], 0),
        ];
        let constants = [[0.0; 3], [2.0; 3], [0.5; 3], [10.0; 3], [1.0; 3]];
        let mut scene = Scene::new();
        let place = Affine3A::from_translation(Vec3::new(0.0, 4.0, 0.0));
        scene.add(
            cube(),
            place * Affine3A::from_scale(Vec3::new(9.0, 1.0, 9.0)),
            Material::new(&Draft::of(rows, &constants).unwrap()),
        );
        scene
    }

    #[test]
    fn uneven_fog_that_does_not_absorb_is_white_in_a_white_world() {
        let settings = Settings {
            max_bounces: 1024,
            volume_bounces: 1024,
            transparent_max_bounces: 1024,
            ..Settings::default()
        };
        let radiance = seen_after(&uneven_fog(), settings);
        assert!((radiance - 1.0).abs() < 5e-3, "{radiance}");
    }

    #[test]
    fn uneven_fog_is_the_same_for_any_number_of_threads() {
        let frames = [uneven_fog().frame(1)];
        for method in [Method::Path, Method::DualCone] {
            let pictures = |threads| {
                let settings = Settings {
                    method,
                    samples: 4,
                    window: 1,
                    volume_bounces: 2,
                    ..Settings::default()
                };
                let shoot = Shoot {
                    frames: &frames,
                    settings,
                    size: 16,
                    threads,
                };
                shoot.pictures(&[1])
            };
            assert_eq!(pictures(1), pictures(3));
        }
    }

    /// Along a ray of slope `1 / cos` the way through the slab, 2 m thick, is `2 / cos`.
    #[test]
    fn fog_that_does_not_scatter_follows_beer() {
        let radiance = seen_after(&fog(0.0, 0.3, 0.6), Settings::default());
        let open = (-0.6f64).exp();
        let expected = open + 2.0 * (1.0 - open);
        // The picture is 0.7 rad wide: ways are up to 1.13 times longer at its corners.
        assert!(
            (radiance / expected - 1.0).abs() < 0.03,
            "{radiance} {expected}"
        );
        assert!(radiance > expected, "the ways are longer");
    }

    /// The share that comes through and what a sheet shines add up, in a white world. The chance to
    /// pass is stratified over 16384 samples: five standard deviations of one left to itself.
    #[test]
    fn a_sheet_shows_what_it_lets_pass_and_what_it_shines() {
        let cases: [(&[(&str, f32)], f64); 3] = [
            (&[("transparent", 0.25)], 0.25),
            (&[("transparent", 0.25), ("emission", 3.0)], 3.25),
            (&[("transparent", 1.0), ("emission", 3.0)], 4.0),
        ];
        for (closures, expected) in cases {
            let inputs = closures
                .iter()
                .map(|(_, c)| [("Weight", 1.0), ("Color", *c)]);
            let inputs: Vec<_> = inputs.collect();
            let named = closures.iter().zip(&inputs);
            let named: Vec<_> = named
                .map(|((name, _), inputs)| (*name, &inputs[..]))
                .collect();
            let mut scene = Scene::new();
            scene.camera = camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, 0.7);
            scene.add(square(), Affine3A::IDENTITY, Material::of(&named));
            let mean = seen(&scene);
            let deviation = 5.0 * 3.0 * 0.5 / 16384f64.sqrt();
            assert!((mean - expected).abs() < deviation, "{closures:?}: {mean}");
        }
    }

    /// Sheets that let half of the light pass and shine by one, above a white floor in a white world.
    fn below_sheets(count: usize, limit: u32) -> f64 {
        let sheet: [(&str, &[(&str, f32)]); 2] = [
            ("transparent", &[("Weight", 1.0), ("Color", 0.5)]),
            ("emission", &[("Weight", 1.0), ("Color", 1.0)]),
        ];
        let mut scene = Scene::new();
        scene.camera = camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, 0.1);
        scene.add(square(), Affine3A::IDENTITY, diffuse(1.0));
        for layer in 1..=count {
            let up = Affine3A::from_translation(0.01 * layer as f32 * Vec3::Z);
            scene.add(square(), up, Material::of(&sheet));
        }
        seen_after(
            &scene,
            Settings {
                transparent_max_bounces: limit,
                ..Settings::default()
            },
        )
    }

    /// Closed forms: what the camera's ray passes, what the floor's rays pass on, and that the surface
    /// after the last one allowed shines and does nothing else.
    #[test]
    fn a_path_passes_no_more_surfaces_than_it_may() {
        // The floor is white: it shows the sheets' glow from below, and the world if rays may pass them.
        let cases = [
            (4, 2, 1.0 + 0.5 + 0.25),
            (2, 2, 1.0 + 0.5),
            (1, 2, 1.0 + 0.5 * (1.0 + 0.5)),
            (2, 3, 1.0 + 0.5 + 0.25 * (1.0 + 0.5)),
            (2, 4, 1.0 + 0.5 + 0.25 * (1.0 + 0.5 + 0.25)),
            (1, 0, 1.0),
        ];
        for (count, limit, expected) in cases {
            let mean = below_sheets(count, limit);
            // A sample is at most four; 16384 of them.
            let deviation = 5.0 * 2.0 / 16384f64.sqrt();
            assert!(
                (mean - expected).abs() < deviation,
                "{count} sheets, {limit}: {mean}"
            );
        }
    }

    /// A sun above a sheet: shadows take the share itself and no chance.
    #[test]
    fn a_shadow_is_as_deep_as_its_sheet() {
        let floor_lit_through = |color: f32, has_transparent_shadow: bool| {
            let mut scene = Scene::new();
            scene.world = plain_world(0.0);
            scene.camera = camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, 0.7);
            scene.lights.push(Light {
                kind: LightKind::Sun { angle: 0.0 },
                key: 1,
                world_from_light: Affine3A::IDENTITY,
                power: Vec3A::ONE,
                scale: Vec3A::ONE,
                material: None,
                reach: Reach::ALL,
            });
            scene.add(square(), Affine3A::IDENTITY, diffuse(0.5));
            let sheet = Material::of(&[("transparent", &[("Weight", 1.0), ("Color", color)])]);
            let above = Affine3A::from_translation(2.0 * Vec3::Z);
            let sheet = Material {
                has_transparent_shadow,
                ..sheet
            };
            scene.add(square(), above, sheet);
            seen(&scene)
        };
        let share = floor_lit_through(0.3, true) / floor_lit_through(1.0, true);
        assert!((share - 0.3).abs() < 1e-4, "{share}");
        assert_eq!(floor_lit_through(0.3, false), 0.0);
    }
}
