//! The first pass: one sample of a pixel, divided into what is its own and what it lends.

use std::f32::consts::PI;

use glam::Vec3A;

use super::REACH_ITERATIONS;
use super::borrow::Receiver;
use super::records::{Class, Record};
use crate::film::Pixel;
use crate::passes;
use crate::path::{Bounces, Continuation, Divided, Gathered};
use crate::reuse::{Shot, View};
use crate::sampling::{Bsdf, LobeValues, Strategy};
use crate::surface::Surface;

/// Share of the sky's light in its small parts from which on they get a light sample. What gather
/// rays find there is each pixel's own, and noisier than a light sample leaves it.
const SMALL_SKY_SHARE: f32 = 0.01;

/// Least probability of the Lambert part of a surface that shares, and of one whose light is shared.
/// One gather ray serves all closures; where the Lambert part is chosen more rarely its samples are few
/// and heavy, and the pixel is better off alone.
const LEAST_LAMBERT: f32 = 0.25;

/// The first pass of an iteration over a frame.
pub struct Pass<'a> {
    view: &'a View<'a>,
    iteration: u32,
    /// How the first surface samples lights.
    strategy: Strategy,
}

/// What a pixel's sample leaves.
#[derive(Default)]
pub struct PixelSample {
    /// For the others.
    pub record: Record,
    /// For the second pass.
    pub receiver: Receiver,
    /// Length of the gather ray [m], where there was one.
    pub distance: Option<f32>,
}

impl<'a> Pass<'a> {
    /// The pass of an iteration over a frame.
    pub fn new(view: &'a View<'a>, iteration: u32) -> Self {
        let needs_light_samples = view.light_tree.small_share() > SMALL_SKY_SHARE;
        Self {
            view,
            iteration,
            strategy: match needs_light_samples {
                true => Strategy::SmallSkyApart,
                false => Strategy::WithoutSky,
            },
        }
    }

    /// Traces one sample; what is the pixel's own goes to `pixel`, what others may borrow is
    /// returned.
    pub fn sample_pixel(&self, x: usize, y: usize, pixel: Option<Pixel>) -> PixelSample {
        let shot = self.view.shoot(x, y, self.iteration);
        let mut sample = PixelSample::default();
        let mut own = shot.radiance();
        // What is black looks for no light, so its dark records would say nothing.
        let shares =
            |s: &Surface| !s.bsdf.is_black() && s.bsdf.probability_lambert() >= LEAST_LAMBERT;
        let mut effective_samples = 1.0;
        let is_divided = |pixel: &Pixel| passes::wants_scattered(pixel.extra.layout);
        let mut divided = (pixel.as_ref().is_some_and(is_divided)).then(Divided::default);
        match &shot.surface {
            None => {}
            Some(surface) if shares(surface) => {
                own += self.direct(&shot, surface, &mut divided)
                    + self.gather(&shot, surface, &mut sample, &mut divided);
                effective_samples = 0.0;
            }
            Some(surface) => {
                let (tracer, sampler) = (&self.view.tracer, &shot.sampler);
                let reflected = tracer.reflected(surface, Bounces::default(), 1.0, sampler);
                own += reflected.sum();
                if let Some(divided) = &mut divided {
                    reflected.divide(divided, 1.0);
                }
            }
        }
        if let Some(mut pixel) = pixel {
            if let Some(mut divided) = divided {
                shot.divide_below(&mut divided);
                passes::add_scattered(&mut pixel.extra, self.iteration, &divided);
            }
            self.view.note(&shot, self.iteration, &mut pixel);
            pixel.sums.add_radiance(own);
            pixel.sums.add_effective_samples(effective_samples);
        }
        sample
    }

    /// Light of light samples: always the pixel's own.
    fn direct(&self, shot: &Shot, surface: &Surface, divided: &mut Option<Divided>) -> Vec3A {
        let (tracer, sampler) = (&self.view.tracer, &shot.sampler);
        let direct = tracer.direct(
            surface,
            &Bounces::default(),
            self.strategy,
            sampler,
            Bsdf::mixed,
        );
        if let Some(divided) = divided {
            divided.add_direct(&direct);
        }
        direct.sum()
    }

    /// One gather ray for all closures of the surface, as path tracing would follow it. What it
    /// brings to the Lambert part is for lending, except light of lamps and suns: light sampling finds it
    /// better, and borrowed it would smear their shadows. The rest is returned.
    fn gather(
        &self,
        shot: &Shot,
        surface: &Surface,
        sample: &mut PixelSample,
        divided: &mut Option<Divided>,
    ) -> Vec3A {
        let object = self
            .view
            .window
            .object(self.view.index, surface.hit.instance);
        sample.record = Record::at(surface, object);
        let gloss = Receiver::gloss(surface);
        sample.receiver = Receiver::at(surface, gloss.as_ref());
        let numbers = shot.sampler.scatter(0);
        let Some(drawn) = surface.bsdf.sample(numbers.lobe, numbers.direction) else {
            return Vec3A::ZERO;
        };
        let pdf_solid_angle = surface.bsdf.pdf(drawn.pdfs);
        let from = Continuation {
            ray: surface.ray_towards(drawn.direction),
            pdf_solid_angle,
            position: surface.position,
            membership: surface.membership,
            normal: surface.normal_towards(drawn.direction),
            strategy: self.strategy,
            bounces: Bounces::default().after(drawn.part),
            throughput: 1.0,
            wants_distance: self.iteration < REACH_ITERATIONS,
        };
        let gathered = self.view.tracer.gather(&from, &shot.sampler);
        sample.distance = Some(gathered.distance);
        let class = self.class_of(&gathered, drawn.direction);
        let (lent, own) = match class {
            Class::Own => (Vec3A::ZERO, gathered.sum()),
            Class::Indirect => (gathered.indirect, gathered.lamps),
            Class::Narrow | Class::Wide => (gathered.environment, gathered.lamps),
        };
        let record = lent / (PI * pdf_solid_angle);
        sample.record.lend(drawn.direction, record, surface, class);
        let gloss = gloss.map_or(Vec3A::ZERO, |gloss| {
            surface.bsdf.eval_gloss(&gloss, drawn.direction)
        });
        if let Some(divided) = divided {
            let (all, scale) = (gathered.by_way(), 1.0 / pdf_solid_angle);
            let own = match class {
                Class::Own => all,
                _ => [gathered.lamps, Vec3A::ZERO],
            };
            let borrows = LobeValues {
                lambert: drawn.value.lambert,
                glossy: gloss,
                ..LobeValues::default()
            };
            let rest = LobeValues {
                lambert: Vec3A::ZERO,
                glossy: (drawn.value.glossy - gloss).max(Vec3A::ZERO),
                ..drawn.value
            };
            divided.add(&borrows, own, scale);
            divided.add(&rest, all, scale);
        }
        let borrows = drawn.value.lambert + gloss;
        let rest = (drawn.value.own() - gloss).max(Vec3A::ZERO);
        (own * borrows + gathered.sum() * rest) / pdf_solid_angle
    }

    fn class_of(&self, gathered: &Gathered, direction: Vec3A) -> Class {
        let lights = &self.view.tracer.lights;
        // What a medium takes on the way to one pixel it does not on the way to another.
        if !self.view.tracer.media.is_empty() {
            return Class::Own;
        }
        if gathered.distance.is_finite() {
            // What mirrors, glass and water throw (caustics) changes from pixel to pixel: borrowed it
            // would blur, and its rare bright samples would become blots.
            match gathered.probability_lambert < LEAST_LAMBERT {
                true => Class::Own,
                false => Class::Indirect,
            }
        } else if lights.is_sun(direction) || lights.is_small_sky(direction) {
            Class::Own
        } else {
            Class::of_sky(self.view.light_tree.leaf(direction))
        }
    }
}
