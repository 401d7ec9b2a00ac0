//! Method IRRADIANCE_CACHE, a rival for the chart: irradiance is found at few points and
//! interpolated between them.
//!
//! Sources: Ward, Rubinstein and Clear, "A Ray Tracing Solution for Diffuse Interreflection",
//! SIGGRAPH 1988 (the weights); Ward and Heckbert, "Irradiance Gradients", EGWR 1992 (rotation and
//! translation); Křivánek et al., "Making Radiance and Irradiance Caching Practical: Adaptive
//! Caching and Neighbor Clamping", EGSR 2006.
//!
//! Only what gather rays of the Lambert part find is cached; light samples and all other closures
//! are each pixel's own. Every iteration fills a cache of its own and the film averages over them;
//! the tolerance falls with the iterations, so the bias does too.

mod cache;

use std::f32::consts::TAU;

use glam::Vec3A;
use rayon::prelude::*;

use self::cache::{Cache, Hemisphere, Place, RINGS, SECTORS};
use super::{Canvas, Estimator, Sharing, Shot, View};
use crate::error::Result;
use crate::film::Region;
use crate::math::Frame;
use crate::path::{Bounces, Continuation, Gathered, take_rays};
use crate::sampling::{LobePdfs, Part, Sampler, Strategy};
use crate::surface::Surface;

/// Ward's tolerance in the first iteration; it falls as (n + 1)^(-1/4).
const TOLERANCE: f32 = 0.3;
/// Least and greatest validity radius of a record in pixels.
const RADIUS_PIXELS: [f32; 2] = [1.5, 24.0];
/// Pixels are visited in ever finer grids, so that records spread before they fill gaps.
const COARSEST_STEP: usize = 8;

/// The method.
pub struct IrradianceCache;

/// What a frame keeps from one pass to the next.
pub struct Memory {
    surfaces: Vec<Option<Surface>>,
    cache: Cache,
}

impl Estimator for IrradianceCache {
    type Memory = Memory;
    type History = ();

    fn memory(&self, region: Region) -> Memory {
        let pixels = region.width * region.height;
        Memory {
            surfaces: (0..pixels).map(|_| None).collect(),
            cache: Cache::new(TOLERANCE),
        }
    }

    fn memory_bytes(&self, memory: &Memory) -> usize {
        size_of_val(&memory.surfaces[..]) + memory.cache.memory_bytes()
    }

    fn history(&self, _: Region) {}

    fn sample(
        &self,
        view: &View,
        iteration: u32,
        memory: &mut Memory,
        canvas: Option<Canvas<()>>,
    ) -> Result<()> {
        let Some(Canvas { film, .. }) = canvas else {
            return Ok(());
        };
        let surfaces = memory.surfaces.par_chunks_mut(view.region.width);
        let rows = film.rows_mut().zip(surfaces);
        view.for_rows(rows, |y, (mut row, surfaces)| {
            for (x, place) in surfaces.iter_mut().enumerate() {
                let shot = view.shoot(x, y, iteration);
                let mut pixel = row.pixel(x);
                view.see(&shot, iteration, &mut pixel);
                pixel.sums.add_effective_samples(1.0);
                pixel.sums.add_radiance(own_light(view, &shot));
                *place = shot.surface;
            }
        })?;
        fill(view, iteration, memory)
    }

    fn share(&self, sharing: &Sharing<Memory>, canvas: Canvas<()>) -> Result<()> {
        let (view, memory) = (sharing.view(), &sharing.memories[sharing.target]);
        let surfaces = memory.surfaces.par_chunks(view.region.width);
        let rows = canvas.film.rows_mut().zip(surfaces);
        view.for_rows(rows, |_, (mut row, surfaces)| {
            for (x, surface) in surfaces.iter().enumerate() {
                let lit = surface
                    .as_ref()
                    .and_then(|s| Some(s.bsdf.albedo_lambert() * memory.cache.at(&place(s))?));
                row.pixel(x).sums.add_radiance(lit.unwrap_or(Vec3A::ZERO));
            }
        })
    }
}

fn place(surface: &Surface) -> Place {
    Place {
        position: surface.position,
        normal: surface.bsdf.lambert_normal(),
    }
}

/// Light samples, and a path off the closures that are not cached.
fn own_light(view: &View, shot: &Shot) -> Vec3A {
    let Some(surface) = &shot.surface else {
        return Vec3A::ZERO;
    };
    // Lambert part and rest are sampled once each, so each meets light samples with its own density.
    let strategy = Strategy::SkyApart;
    let direct = view.tracer.direct(
        surface,
        &Bounces::default(),
        strategy,
        &shot.sampler,
        |_, pdfs| pdfs,
    );
    direct.sum() + gather_own(view, surface, &shot.sampler)
}

fn gather_own(view: &View, surface: &Surface, sampler: &Sampler) -> Vec3A {
    let numbers = sampler.scatter(0);
    let Some(drawn) = surface.bsdf.sample_own(numbers.lobe, numbers.direction) else {
        return Vec3A::ZERO;
    };
    let direction = drawn.direction;
    let (value, LobePdfs { own: pdf, .. }) = surface.bsdf.eval_drawn(&drawn);
    if !(pdf > 0.0) {
        return Vec3A::ZERO;
    }
    let bounces = view
        .tracer
        .after(Bounces::default(), surface, drawn.part, drawn.alpha);
    gather(view, surface, bounces, direction, pdf, sampler).sum() * value.own() / pdf
}

fn gather(
    view: &View,
    surface: &Surface,
    bounces: Bounces,
    direction: Vec3A,
    pdf_solid_angle: f32,
    sampler: &Sampler,
) -> Gathered {
    let strategy = Strategy::SkyApart;
    let from = Continuation {
        wants_distance: true,
        ..Continuation::leaving(surface, direction, pdf_solid_angle, strategy, bounces)
    };
    view.tracer.gather(&from, sampler)
}

/// Makes records until every pixel can interpolate. Where they lie depends on those before, so
/// they are made one after the other, and only the rays of one go to all threads.
fn fill(view: &View, iteration: u32, memory: &mut Memory) -> Result<()> {
    memory.cache = Cache::new(TOLERANCE * ((iteration + 1) as f32).powf(-0.25));
    let (width, height) = (view.region.width, view.region.height);
    let mut step = COARSEST_STEP;
    while step > 0 {
        for y in (0..height).step_by(step) {
            view.check_cancelled()?;
            for x in (0..width).step_by(step) {
                let Some(surface) = &memory.surfaces[y * width + x] else {
                    continue;
                };
                let is_lit = surface.bsdf.albedo_lambert() != Vec3A::ZERO;
                if is_lit && memory.cache.at(&place(surface)).is_none() {
                    let hemisphere = look_around(view, surface, [x, y], iteration);
                    let camera = &view.tracer.frame.camera;
                    let depth = camera.depth(surface.position);
                    let pixel = camera.pixel_size(depth, view.region.frame_width);
                    let radii = RADIUS_PIXELS.map(|pixels| pixels * pixel);
                    memory.cache.insert(place(surface), &hemisphere, radii);
                }
            }
        }
        step /= 2;
    }
    Ok(())
}

/// Traces one ray through each cell of the hemisphere over a surface.
fn look_around(view: &View, surface: &Surface, [x, y]: [usize; 2], iteration: u32) -> Hemisphere {
    let frame = Frame::from_normal(surface.bsdf.lambert_normal());
    let cells = (RINGS * SECTORS) as u32;
    let rays = (0..cells).into_par_iter().map(|cell| {
        let sampler = view.sampler(x, y, iteration * cells + cell);
        let [u, v] = sampler.scatter(0).direction;
        let ring = (cell as usize / SECTORS) as f32;
        let sector = (cell as usize % SECTORS) as f32;
        let sin_squared = (ring + u) / RINGS as f32;
        let cos = (1.0 - sin_squared).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (TAU * (sector + v) / SECTORS as f32).sin_cos();
        let sin = sin_squared.sqrt();
        let direction = frame.to_world(Vec3A::new(sin * cos_phi, sin * sin_phi, cos));
        let (_, LobePdfs { lambert: pdf, .. }) = surface.bsdf.eval(direction);
        let light = match pdf > 0.0 {
            true => gather(
                view,
                surface,
                Bounces::default().after(Part::Diffuse),
                direction,
                pdf,
                &sampler,
            ),
            // Below the geometric surface: black, and nothing is near.
            false => Gathered {
                distance: f32::INFINITY,
                ..Gathered::default()
            },
        };
        view.progress.count_rays(take_rays());
        (light.sum(), light.distance, sin / cos.max(1e-3))
    });
    Hemisphere {
        frame,
        rays: rays.collect(),
    }
}

#[cfg(test)]
mod tests;
