//! The first pass: one sample of a pixel, divided into what is its own and what it lends.

use std::f32::consts::PI;

use glam::Vec3A;

use super::REACH_ITERATIONS;
use super::borrow::Receiver;
use super::records::{Class, OWN_BELOW, Record};
use crate::film::PixelSums;
use crate::path::{Bounces, Continuation, Gathered};
use crate::reuse::{Shot, View};
use crate::sampling::{LobePdfs, Part, Strategy};
use crate::surface::Surface;

/// Share of the sky's light in directions that are each pixel's own, up to which gather rays alone
/// look for the sky: what they find is shared, while a light sample of the sky is its pixel's own.
/// Beyond it the own directions would be noisier than light samples leave them.
const OWN_SKY_SHARE: f32 = 0.01;

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
        let is_gathered = view.light_tree.share_below(OWN_BELOW) <= OWN_SKY_SHARE;
        Self {
            view,
            iteration,
            strategy: match is_gathered {
                true => Strategy::WithoutSky,
                false => Strategy::SkyApart,
            },
        }
    }

    /// Traces one sample; what is the pixel's own goes to `pixel`, what others may borrow is
    /// returned.
    pub fn sample_pixel(
        &self,
        x: usize,
        y: usize,
        pixel: &mut Option<&mut PixelSums>,
    ) -> PixelSample {
        let shot = self.view.shoot(x, y, self.iteration);
        if let Some(pixel) = pixel {
            pixel.add_sighting(self.iteration, &shot.seen);
            pixel.add_radiance(shot.radiance);
        }
        let Some(surface) = &shot.surface else {
            if let Some(pixel) = pixel {
                pixel.add_effective_samples(1.0);
            }
            return PixelSample::default();
        };
        if let Some(pixel) = pixel {
            pixel.add_radiance(self.direct(&shot, surface));
        }
        let object = self
            .view
            .window
            .object(self.view.index, surface.hit.instance);
        let mut sample = PixelSample {
            record: Record::at(surface, object),
            receiver: Receiver::at(surface),
            distance: None,
        };
        if shot.sampler.scatter(0).lobe < surface.bsdf.probability_lambert() {
            let own = self.gather_lambert(&shot, surface, &mut sample);
            if let Some(pixel) = pixel {
                pixel.add_radiance(own);
            }
        } else if let Some(pixel) = pixel {
            pixel.add_radiance(self.gather_own(&shot, surface));
        }
        sample
    }

    /// Light of light samples: always the pixel's own.
    fn direct(&self, shot: &Shot, surface: &Surface) -> Vec3A {
        let lambert = surface.bsdf.probability_lambert();
        let (tracer, sampler) = (&self.view.tracer, &shot.sampler);
        let direct = tracer.direct(surface, 0, self.strategy, sampler, |_, pdfs| LobePdfs {
            lambert: lambert * pdfs.lambert,
            own: (1.0 - lambert) * pdfs.own,
        });
        direct.sum()
    }

    /// One gather ray off the Lambert part. What it finds is for lending, except light of lamps and
    /// suns, which is returned: light sampling finds it better, and borrowed it would smear their
    /// shadows.
    fn gather_lambert(&self, shot: &Shot, surface: &Surface, sample: &mut PixelSample) -> Vec3A {
        let u = shot.sampler.scatter(0).direction;
        let Some(direction) = surface.bsdf.sample_lambert(u) else {
            return Vec3A::ZERO;
        };
        let (value, pdfs) = surface.bsdf.eval(direction);
        let pdf_solid_angle = surface.bsdf.probability_lambert() * pdfs.lambert;
        if !(pdf_solid_angle > 0.0) {
            return Vec3A::ZERO;
        }
        let gathered = self.gather(shot, surface, Part::Diffuse, direction, pdf_solid_angle);
        sample.distance = Some(gathered.distance);
        let class = Class::of(&gathered, || {
            match self.view.tracer.lights.is_sun(direction) {
                true => 0.0,
                false => self.view.light_tree.leaf(direction).tan_beta,
            }
        });
        let (lent, own) = match class {
            Class::Own => (Vec3A::ZERO, gathered.sum()),
            Class::Indirect => (gathered.indirect, gathered.lamps),
            Class::Narrow | Class::Wide => (gathered.environment, gathered.lamps),
        };
        let lent = lent / (PI * pdf_solid_angle);
        sample.record.lend(direction, lent, surface, class);
        own * value.lambert / pdf_solid_angle
    }

    /// One gather ray off the other closures: the pixel's own.
    fn gather_own(&self, shot: &Shot, surface: &Surface) -> Vec3A {
        let numbers = shot.sampler.scatter(0);
        let lambert = surface.bsdf.probability_lambert();
        // The lobe's number was used to choose the part; what is left of it is uniform again.
        let u_lobe = (numbers.lobe - lambert) / (1.0 - lambert);
        let Some((direction, part)) = surface.bsdf.sample_own(u_lobe, numbers.direction) else {
            return Vec3A::ZERO;
        };
        let (value, pdfs) = surface.bsdf.eval(direction);
        let pdf_solid_angle = (1.0 - lambert) * pdfs.own;
        if !(pdf_solid_angle > 0.0) {
            return Vec3A::ZERO;
        }
        let gathered = self.gather(shot, surface, part, direction, pdf_solid_angle);
        gathered.sum() * value.own() / pdf_solid_angle
    }

    fn gather(
        &self,
        shot: &Shot,
        surface: &Surface,
        part: Part,
        direction: Vec3A,
        pdf_solid_angle: f32,
    ) -> Gathered {
        let from = Continuation {
            ray: surface.ray_towards(direction),
            pdf_solid_angle,
            position: surface.position,
            normal: surface.normal_towards(direction),
            strategy: self.strategy,
            bounces: Bounces::default().after(part),
            throughput: 1.0,
            wants_distance: self.iteration < REACH_ITERATIONS,
        };
        self.view.tracer.gather(&from, &shot.sampler)
    }
}
