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
use crate::sampling::{Bsdf, Gloss, LobeValues, Strategy};
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
    fn borrowing(&self, surface: &Surface, gloss: Option<&Gloss>) -> LobeValues {
        let gloss = gloss.map(|gloss| surface.bsdf.eval_gloss(gloss, self.from.ray.direction));
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

/// Whether a surface lends and borrows. What is black looks for no light, so its dark records would say
/// nothing.
fn shares(surface: &Surface) -> bool {
    !surface.bsdf.is_black() && surface.bsdf.probability_lambert() >= LEAST_LAMBERT
}

/// A surface that shares.
struct Shared<'a> {
    surface: &'a Surface,
    /// Its closure that takes borrowed light beside the Lambert part.
    gloss: Option<Gloss>,
    gather: Option<Gather>,
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
        let lending = own.as_ref().map(|(_, lending)| *lending);
        let surface = shot.surface.as_ref().filter(|surface| shares(surface));
        let shared = surface.map(|surface| Shared {
            surface,
            gloss: Receiver::gloss(surface),
            gather: self.gather(&shot, surface, lending),
        });
        if let Some(shared) = &shared {
            sample.distance = shared.gather.as_ref().map(|g| g.gathered.distance);
            if lends {
                self.lend(shared, &mut sample);
            }
        }
        if let Some((mut pixel, lending)) = own {
            let is_probe = is_probe(x, y, self.iteration);
            sample.excess = self.keep(&shot, shared, lending, is_probe, &mut pixel);
        }
        sample
    }

    /// Makes the record of a surface that shares.
    fn lend(&self, shared: &Shared, sample: &mut PixelSample) {
        let (view, surface) = (self.view, shared.surface);
        let object = view.window.object(view.index, surface.hit.instance);
        sample.record = Record::at(surface, object);
        sample.receiver = Receiver::at(surface, shared.gloss.as_ref());
        if let Some(gather) = &shared.gather {
            gather.lend(surface, &mut sample.record);
        }
    }

    /// Adds what a pixel keeps for itself; returns [`PixelSample::excess`].
    fn keep(
        &self,
        shot: &Shot,
        shared: Option<Shared>,
        lending: Lending,
        is_probe: bool,
        pixel: &mut Pixel,
    ) -> f32 {
        let sight = self.view.see(shot, self.iteration, pixel);
        let borrows = shared.is_some() && lending.is_some();
        let samples = if borrows { 0.0 } else { 1.0 };
        pixel.sums.add_effective_samples(samples);
        let Some(surface) = &shot.surface else {
            return 0.0;
        };
        let is_divided = passes::wants_scattered(pixel.extra.layout);
        let mut divided = is_divided.then(|| Divided::of(surface));
        let kept = match &shared {
            Some(shared) => self.kept(shot, shared, lending, &mut divided),
            None => self.reflected(shot, surface, &mut divided),
        };
        pixel.sums.add_radiance(kept);
        if let Some(mut divided) = divided {
            sight.divide_below(&mut divided);
            passes::add_scattered(&mut pixel.extra, self.iteration, &divided);
        }
        match shared {
            Some(shared) if borrows && is_probe => luminance(self.alone(shot, shared) - kept),
            _ => 0.0,
        }
    }

    /// Light on a surface that does not share: path tracing.
    fn reflected(&self, shot: &Shot, surface: &Surface, divided: &mut Option<Divided>) -> Vec3A {
        let (tracer, sampler) = (&self.view.tracer, &shot.sampler);
        let reflected = tracer.reflected(surface, Bounces::default(), 1.0, sampler);
        if let Some(divided) = divided {
            reflected.divide(divided, 1.0);
        }
        reflected.sum()
    }

    /// What a pixel keeps for itself of the light on a surface that shares: all of it, as path tracing
    /// has it, if it borrows nothing.
    fn kept(
        &self,
        shot: &Shot,
        shared: &Shared,
        lending: Lending,
        divided: &mut Option<Divided>,
    ) -> Vec3A {
        let direct = self.direct(shot, shared.surface, self.strategy(Some(lending)));
        if let Some(divided) = divided {
            divided.add_direct(&direct);
        }
        let kept = shared.gather.as_ref().map(|gather| {
            let borrowing = match lending {
                Lending::None => LobeValues::default(),
                _ => gather.borrowing(shared.surface, shared.gloss.as_ref()),
            };
            gather.kept(borrowing, divided)
        });
        direct.sum() + kept.unwrap_or(Vec3A::ZERO)
    }

    /// What path tracing makes of a surface that shares.
    fn alone(&self, shot: &Shot, shared: Shared) -> Vec3A {
        let direct = self.direct(shot, shared.surface, ALONE).sum();
        let gathered = shared.gather.map(|mut gather| {
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
        let tracer = &self.view.tracer;
        let bounces = tracer.after(Bounces::default(), surface, drawn.part, drawn.alpha);
        let (direction, strategy) = (drawn.direction, self.strategy(lending));
        let from = Continuation {
            wants_distance: self.iteration < REACH_ITERATIONS,
            ..Continuation::leaving(surface, direction, pdf_solid_angle, strategy, bounces)
        };
        let gathered = tracer.gather(&from, &shot.sampler);
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
