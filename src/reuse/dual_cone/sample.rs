//! The first pass: one sample of a pixel, divided into what is its own and what it lends.

use std::f32::consts::PI;

use glam::Vec3A;

use super::REACH_ITERATIONS;
use super::borrow::Receiver;
use super::records::{Class, Record};
use super::veto::{Lending, is_probe};
use crate::film::Pixel;
use crate::math::luminance;
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

/// How lights are sampled where a pixel borrows nothing: as path tracing does.
const ALONE: Strategy = Strategy::SkyApart;

/// The first pass of an iteration over a frame.
pub struct Pass<'a> {
    view: &'a View<'a>,
    iteration: u32,
    /// How the first surface samples lights where pixels share.
    shared_strategy: Strategy,
}

/// What a gather ray found.
struct Gather {
    from: Continuation,
    /// `f cos` of its direction [1/sr].
    value: LobeValues,
    gathered: Gathered,
    class: Class,
}

impl Gather {
    /// Puts into the record what others may borrow: all but light of lamps and suns. Light sampling
    /// finds it better, and borrowed it would smear their shadows.
    fn lend(&self, surface: &Surface, record: &mut Record) {
        let lent = match self.class {
            Class::Own => Vec3A::ZERO,
            Class::Indirect => self.gathered.indirect,
            Class::Narrow | Class::Wide => self.gathered.open_sky,
        };
        let value = lent / (PI * self.from.pdf_solid_angle);
        record.lend(self.from.ray.direction, value, surface, self.class);
    }

    /// What the closures do with it that take borrowed light in its place.
    fn borrowing(&self, surface: &Surface) -> LobeValues {
        let gloss = Receiver::gloss(surface);
        let gloss = gloss.map(|gloss| surface.bsdf.eval_gloss(&gloss, self.from.ray.direction));
        LobeValues {
            lambert: self.value.lambert,
            glossy: gloss.unwrap_or(Vec3A::ZERO),
            ..LobeValues::default()
        }
    }

    /// What the pixel keeps, if the closures `borrowing` take borrowed light.
    fn kept(&self, borrowing: LobeValues, divided: &mut Option<Divided>) -> Vec3A {
        let (all, scale) = (self.gathered.by_way(), 1.0 / self.from.pdf_solid_angle);
        let kept = match self.class {
            Class::Own => all,
            _ => [self.gathered.lamps, Vec3A::ZERO],
        };
        let rest = LobeValues {
            lambert: self.value.lambert - borrowing.lambert,
            glossy: (self.value.glossy - borrowing.glossy).max(Vec3A::ZERO),
            ..self.value
        };
        if let Some(divided) = divided {
            divided.add(&borrowing, kept, scale);
            divided.add(&rest, all, scale);
        }
        let kept = (kept[0] + kept[1]) * borrowing.sum();
        (kept + self.gathered.sum() * rest.sum()) * scale
    }
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
    /// Of a probe: luminance that it would have found alone less what it keeps for itself.
    pub excess: f32,
}

impl<'a> Pass<'a> {
    /// The pass of an iteration over a frame.
    pub fn new(view: &'a View<'a>, iteration: u32) -> Self {
        let needs_light_samples = view.light_tree.small_share() > SMALL_SKY_SHARE;
        Self {
            view,
            iteration,
            shared_strategy: match needs_light_samples {
                true => Strategy::SmallSkyApart,
                false => Strategy::WithoutSky,
            },
        }
    }

    /// Traces one sample. What is the pixel's own goes to `own`, if the frame is rendered; what
    /// others may borrow is returned, if the pixel `lends`.
    pub fn sample_pixel(
        &self,
        x: usize,
        y: usize,
        lends: bool,
        own: Option<(Pixel, Lending)>,
    ) -> PixelSample {
        let mut sample = PixelSample::default();
        if !lends && own.is_none() {
            return sample;
        }
        let shot = self.view.shoot(x, y, self.iteration);
        // What is black looks for no light, so its dark records would say nothing.
        let shares =
            |s: &Surface| !s.bsdf.is_black() && s.bsdf.probability_lambert() >= LEAST_LAMBERT;
        let lending = own.as_ref().map(|(_, lending)| *lending);
        let is_divided = |(pixel, _): &(Pixel, _)| passes::wants_scattered(pixel.extra.layout);
        let mut divided = match &shot.surface {
            Some(surface) if own.as_ref().is_some_and(is_divided) => Some(Divided::of(surface)),
            _ => None,
        };
        let mut effective_samples = 1.0;
        let reflected = match &shot.surface {
            Some(surface) if shares(surface) => {
                if lending != Some(Lending::None) {
                    effective_samples = 0.0;
                }
                let gather = self.gather(&shot, surface, lending);
                self.lend(surface, gather.as_ref(), &mut sample);
                let reflected = lending.map_or(Vec3A::ZERO, |lending| {
                    self.kept(&shot, surface, lending, gather.as_ref(), &mut divided)
                });
                if is_probe(x, y, self.iteration) && lending.is_some_and(Lending::is_some) {
                    let alone = self.alone(&shot, surface, gather);
                    sample.excess = luminance(alone - reflected);
                }
                reflected
            }
            Some(surface) if own.is_some() => {
                let (tracer, sampler) = (&self.view.tracer, &shot.sampler);
                let reflected = tracer.reflected(surface, Bounces::default(), 1.0, sampler);
                if let Some(divided) = &mut divided {
                    reflected.divide(divided, 1.0);
                }
                reflected.sum()
            }
            _ => Vec3A::ZERO,
        };
        if let Some((mut pixel, _)) = own {
            if let Some(mut divided) = divided {
                shot.divide_below(&mut divided);
                passes::add_scattered(&mut pixel.extra, self.iteration, &divided);
            }
            self.view.note(&shot, self.iteration, &mut pixel);
            pixel.sums.add_radiance(shot.radiance() + reflected);
            pixel.sums.add_effective_samples(effective_samples);
        }
        sample
    }

    /// Makes the record of a surface that shares.
    fn lend(&self, surface: &Surface, gather: Option<&Gather>, sample: &mut PixelSample) {
        let (view, instance) = (self.view, surface.hit.instance);
        sample.record = Record::at(surface, view.window.object(view.index, instance));
        sample.receiver = Receiver::at(surface, Receiver::gloss(surface).as_ref());
        if let Some(gather) = gather {
            sample.distance = Some(gather.gathered.distance);
            gather.lend(surface, &mut sample.record);
        }
    }

    /// What a pixel keeps for itself of the light on its surface: all of it, as path tracing has it, if
    /// it borrows nothing.
    fn kept(
        &self,
        shot: &Shot,
        surface: &Surface,
        lending: Lending,
        gather: Option<&Gather>,
        divided: &mut Option<Divided>,
    ) -> Vec3A {
        let direct = self.direct(shot, surface, self.strategy(Some(lending)));
        if let Some(divided) = divided {
            divided.add_direct(&direct);
        }
        let kept = gather.map(|gather| {
            let borrowing = match lending {
                Lending::None => LobeValues::default(),
                _ => gather.borrowing(surface),
            };
            gather.kept(borrowing, divided)
        });
        direct.sum() + kept.unwrap_or(Vec3A::ZERO)
    }

    /// What path tracing makes of a surface from which this gather ray went.
    fn alone(&self, shot: &Shot, surface: &Surface, gather: Option<Gather>) -> Vec3A {
        let direct = self.direct(shot, surface, ALONE).sum();
        let gathered = gather.map(|mut gather| {
            let (gathered, from) = (&mut gather.gathered, &mut gather.from);
            from.strategy = ALONE;
            if gathered.open_sky != Vec3A::ZERO {
                let weight = self.view.tracer.environment_weight(from);
                gathered.environment = gathered.open_sky * weight;
            }
            gather.kept(LobeValues::default(), &mut None)
        });
        direct + gathered.unwrap_or(Vec3A::ZERO)
    }

    /// How a pixel samples lights that borrows from there, or only lends.
    fn strategy(&self, lending: Option<Lending>) -> Strategy {
        match lending {
            Some(Lending::None) => ALONE,
            _ => self.shared_strategy,
        }
    }

    /// Light of light samples: always the pixel's own.
    fn direct(&self, shot: &Shot, surface: &Surface, strategy: Strategy) -> LobeValues {
        let tracer = &self.view.tracer;
        let from = Bounces::default();
        tracer.direct(surface, &from, strategy, &shot.sampler, Bsdf::mixed)
    }

    /// One gather ray for all closures of the surface, as path tracing would follow it.
    fn gather(&self, shot: &Shot, surface: &Surface, lending: Option<Lending>) -> Option<Gather> {
        let numbers = shot.sampler.scatter(0);
        let drawn = surface.bsdf.sample(numbers.lobe, numbers.direction)?;
        let pdf_solid_angle = surface.bsdf.pdf(drawn.pdfs);
        let from = Continuation {
            ray: surface.ray_towards(drawn.direction),
            pdf_solid_angle,
            position: surface.position,
            membership: surface.membership,
            normal: surface.normal_towards(drawn.direction),
            strategy: self.strategy(lending),
            bounces: Bounces::default().after(drawn.part),
            throughput: 1.0,
            wants_distance: self.iteration < REACH_ITERATIONS,
        };
        let gathered = self.view.tracer.gather(&from, &shot.sampler);
        Some(Gather {
            class: self.class_of(&gathered, drawn.direction),
            from,
            value: drawn.value,
            gathered,
        })
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
