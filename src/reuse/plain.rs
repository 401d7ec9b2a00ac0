//! Method PATH: every pixel on its own, the unbiased reference and the baseline to beat.
//!
//! A camera ray may carry several gathers, paths that go on from the one surface it found. That
//! saves camera rays where light makes the noise and edges do not (Arvo and Kirk, "Particle
//! Transport and Image Synthesis", 1990, call it splitting).

use glam::Vec3A;

use super::{Canvas, Estimator, Sharing, View};
use crate::contract::Settings;
use crate::error::Result;
use crate::film::{Pixel, Region};
use crate::passes;
use crate::path::{Bounces, Divided};

/// Plain path tracing.
pub struct Plain {
    gathers: u32,
}

impl Plain {
    /// The method with the settings' number of gathers.
    pub fn new(settings: &Settings) -> Self {
        Self {
            gathers: settings.gathers,
        }
    }
}

impl Estimator for Plain {
    type Memory = ();
    type History = ();

    fn memory(&self, _: Region) -> Self::Memory {}

    fn memory_bytes(&self, (): &Self::Memory) -> usize {
        0
    }

    fn history(&self, _: Region) {}

    fn sample(
        &self,
        view: &View,
        iteration: u32,
        (): &mut (),
        canvas: Option<Canvas<()>>,
    ) -> Result<()> {
        let Some(Canvas { film, .. }) = canvas else {
            return Ok(());
        };
        view.for_rows(film.rows_mut(), |y, mut row| {
            for x in 0..row.width() {
                self.sample_pixel(view, x, y, iteration, row.pixel(x));
            }
        })
    }

    fn share(&self, _: &Sharing<()>, _: Canvas<()>) -> Result<()> {
        Ok(())
    }
}

impl Plain {
    fn sample_pixel(&self, view: &View, x: usize, y: usize, iteration: u32, mut pixel: Pixel) {
        let shot = view.shoot(x, y, iteration);
        let sight = view.see(&shot, iteration, &mut pixel);
        pixel.sums.add_effective_samples(self.gathers as f32);
        if let Some(surface) = &shot.surface {
            let is_divided = passes::wants_scattered(pixel.extra.layout);
            let mut sum = Vec3A::ZERO;
            let mut divided = Divided::of(surface);
            for gather in 0..self.gathers {
                // Consecutive, so that all gathers of a pixel are stratified against each other.
                let index = iteration * self.gathers + gather;
                let sampler = view.sampler(x, y, index);
                let reflected = view
                    .tracer
                    .reflected(surface, Bounces::default(), 1.0, &sampler);
                sum += reflected.sum();
                if is_divided {
                    reflected.divide(&mut divided, 1.0 / self.gathers as f32);
                }
            }
            pixel.sums.add_radiance(sum / self.gathers as f32);
            if is_divided {
                sight.divide_below(&mut divided);
                passes::add_scattered(&mut pixel.extra, iteration, &divided);
            }
        }
    }
}
