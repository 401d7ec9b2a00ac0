//! Method PATH: every pixel on its own, the unbiased reference and the baseline to beat.

use rayon::prelude::*;

use super::{Estimator, View};
use crate::error::Result;
use crate::film::{Film, PixelSums, Region};
use crate::path::{Bounces, take_rays};

/// Plain path tracing.
pub struct Plain;

impl Estimator for Plain {
    type Memory = ();

    fn memory(&self, _: Region) -> Self::Memory {}

    fn memory_bytes(&self, (): &Self::Memory) -> usize {
        0
    }

    fn sample(
        &self,
        view: &View,
        iteration: u32,
        (): &mut (),
        film: Option<&mut Film>,
    ) -> Result<()> {
        let Some(film) = film else { return Ok(()) };
        let rows = film.pixels_mut().par_chunks_mut(view.region.width);
        rows.enumerate().try_for_each(|(y, row)| {
            view.check_cancelled()?;
            for (x, pixel) in row.iter_mut().enumerate() {
                sample_pixel(view, x, y, iteration, pixel);
            }
            view.progress.count_rays(take_rays());
            Ok(())
        })
    }

    fn share(
        &self,
        _: &[View],
        _: &[()],
        _: usize,
        _: &[usize],
        _: u32,
        _: &mut Film,
    ) -> Result<()> {
        Ok(())
    }
}

fn sample_pixel(view: &View, x: usize, y: usize, iteration: u32, pixel: &mut PixelSums) {
    let shot = view.shoot(x, y, iteration);
    pixel.add_sighting(iteration, &shot.seen);
    pixel.add_effective_samples(1.0);
    let mut radiance = shot.radiance;
    if let Some(surface) = &shot.surface {
        radiance += view
            .tracer
            .reflected(surface, Bounces::default(), 1.0, &shot.sampler);
    }
    pixel.add_radiance(radiance);
}
