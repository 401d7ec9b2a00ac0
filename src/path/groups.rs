//! What a pixel gets from each light group, by a path of its own.
//!
//! It is the path that method PATH follows, with the same numbers, so that the groups add up to its
//! Combined. Light is noted where it is found, times what the path carries from there to the camera.

use glam::Vec3A;

use super::{Bounces, Continuation, Passed, Tracer, clamp_factor};
use crate::math::Ray;
use crate::sampling::{Bsdf, Sampler};
use crate::surface::Surface;

/// What is to be done with light of a group, 0 being none.
pub type Note<'a> = &'a mut dyn FnMut(u8, Vec3A);

/// What a path carries.
#[derive(Clone, Copy)]
struct Carried {
    /// Share of the light that arrives at the camera.
    share: Vec3A,
    /// The same as [`Continuation::throughput`] has it.
    throughput: f32,
}

impl Carried {
    const ALL: Self = Self {
        share: Vec3A::ONE,
        throughput: 1.0,
    };
}

impl Tracer<'_> {
    /// Notes the light that a surface sends to the camera and does not give off itself.
    pub fn note_scattered(&self, surface: &Surface, sampler: &Sampler, note: Note) {
        self.note_both(surface, Bounces::default(), Carried::ALL, sampler, note);
    }

    /// Notes the light that the media on a camera ray scatter straight from its source to the camera.
    pub fn note_seen_in_media(&self, ray: &Ray, passed: &Passed, sampler: &Sampler, note: Note) {
        self.note_in_scattered(ray, passed, Bounces::default(), Carried::ALL, sampler, note);
    }

    /// Notes what a surface reflects, and what comes from below it.
    fn note_both(
        &self,
        surface: &Surface,
        from: Bounces,
        carried: Carried,
        sampler: &Sampler,
        note: Note,
    ) {
        self.note_reflected(surface, from, carried, sampler, note);
        if let Some((outside, weight)) = self.resurfaced(surface, &from, sampler) {
            let carried = Carried {
                share: carried.share * weight,
                throughput: carried.throughput * weight.max_element(),
            };
            self.note_reflected(&outside, from, carried, sampler, note);
        }
    }

    /// See [`Tracer::reflected`].
    fn note_reflected(
        &self,
        surface: &Surface,
        from: Bounces,
        carried: Carried,
        sampler: &Sampler,
        note: Note,
    ) {
        let strategy = super::strategy_at(from.total);
        let mut lit = Vec::new();
        self.each_lit(
            surface,
            &from,
            strategy,
            sampler,
            Bsdf::mixed,
            |light, values| {
                lit.push((light.reach.links.group, values.sum()));
            },
        );
        self.note_lit(&lit, &from, carried, note);
        if let Some(step) = self.step(surface, from, carried.throughput, sampler) {
            let weight = step.value.sum() / (step.next.pdf_solid_angle * step.survival);
            self.note_gathered(&step.next, carried.share * weight, sampler, note);
        }
    }

    /// See [`Tracer::in_scattered`].
    fn note_in_scattered(
        &self,
        ray: &Ray,
        passed: &Passed,
        from: Bounces,
        carried: Carried,
        sampler: &Sampler,
        note: Note,
    ) {
        let mut lit = Vec::new();
        self.each_in_scattered(ray, passed, &from, sampler, |light, values| {
            lit.push((light.reach.links.group, values.sum()));
        });
        self.note_lit(&lit, &from, carried, note);
    }

    /// Notes light of light samples.
    fn note_lit(&self, lit: &[(u8, Vec3A)], from: &Bounces, carried: Carried, note: Note) {
        let (throughput, limit) = match from.total {
            0 => (1.0, self.settings.clamp_direct),
            _ => (carried.throughput, self.settings.clamp_indirect),
        };
        note_clamped(lit, carried.share, throughput, limit, note);
    }

    /// See [`Tracer::gather`].
    fn note_gathered(&self, from: &Continuation, share: Vec3A, sampler: &Sampler, note: Note) {
        let bounces = from.bounces.along(from.pdf_solid_angle);
        let limit = match from.bounces.total {
            0 | 1 => self.settings.clamp_direct,
            _ => self.settings.clamp_indirect,
        };
        let clamped = |light| share * super::clamped(light, from.throughput, limit);
        let (mut surface, passed) = self.arrive(&from.ray, &bounces, sampler);
        if let Some(surface) = &mut surface {
            self.calm(surface, &bounces);
        }
        let distance = surface.as_ref().map_or(from.ray.t_max, |s| s.distance);
        let mut met = vec![(0, passed.glow)];
        self.each_lamp(from, distance, &passed, |links, light| {
            met.push((links.group, light))
        });
        note_clamped(&met, share, from.throughput, limit, note);
        let carried = Carried {
            share,
            throughput: from.throughput,
        };
        let is_last = from.bounces.at_limit(self.settings);
        if !is_last {
            self.note_in_scattered(&from.ray, &passed, bounces, carried, sampler, note);
        }
        let Some(surface) = surface else {
            if !self.hides_background(&from.bounces) {
                let radiance = self.environment(from.ray.direction, &from.bounces);
                let light = passed.share(distance) * radiance * self.environment_weight(from);
                note(self.frame.world.reach.links.group, clamped(light));
            }
            return;
        };
        note(self.group_of(&surface), clamped(self.glow(from, &surface)));
        if !is_last {
            self.note_both(&surface, bounces, carried, sampler, note);
        }
    }

    /// The group of what a surface gives off; media have none.
    pub fn group_of(&self, surface: &Surface) -> u8 {
        let instance = surface.hit.instance as usize;
        match surface.is_medium {
            true => 0,
            false => self.frame.instances[instance].links.group,
        }
    }
}

/// Notes lights that are limited together: see [`clamp_factor`].
fn note_clamped(lights: &[(u8, Vec3A)], share: Vec3A, throughput: f32, limit: f32, note: Note) {
    let sum = lights.iter().map(|(_, light)| *light).sum();
    let factor = clamp_factor(sum, throughput, limit);
    for (group, light) in lights {
        note(*group, share * *light * factor);
    }
}
