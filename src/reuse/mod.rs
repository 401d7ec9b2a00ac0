//! The estimators: ways to turn camera rays and shared samples into pixels.
//!
//! Each is one file and one line in [`with_estimator`]. An iteration has two passes. In the first,
//! every frame of the window traces one sample per pixel and leaves records; in the second, every
//! target frame gathers from the records of its lenders.

mod bilateral;
mod dual_cone;
mod irradiance_cache;
mod light_tree;
mod paper;
mod plain;

pub use light_tree::LightTree;

use glam::{Vec2, Vec3A};
use rayon::prelude::*;

use crate::contract::{Method, Settings};
use crate::error::{Error, Result};
use crate::film::{Caught, Film, FilmRow, Pixel, Region, Sighting};
use crate::math::warp::sample_cosine_hemisphere;
use crate::math::{Frame, PixelFilter, Ray};
use crate::passes::{self, Seen};
use crate::path::{Bounces, Divided, Reflected, Tracer, take_rays};
use crate::progress::Progress;
use crate::sampling::{Sampler, ShutterTimes, Strategy};
use crate::scene::FrameWindow;
use crate::shader::RayKind;
use crate::surface::Surface;

/// One frame, ready to trace.
pub struct View<'a> {
    /// Traces paths in the frame.
    pub tracer: Tracer<'a>,
    /// The same in the frame without anything but its shadow catchers, if it has any.
    pub catchers: Option<Tracer<'a>>,
    /// Position of the frame in the window.
    pub index: usize,
    /// The window.
    pub window: &'a FrameWindow,
    /// The rectangle that is rendered.
    pub region: Region,
    /// Where camera rays go within a pixel.
    pub filter: &'a PixelFilter,
    /// When camera rays meet the scene.
    pub shutter: &'a ShutterTimes,
    /// How the frame's surroundings divide into areas of light.
    pub light_tree: &'a LightTree,
    /// Diameter of the scene [m].
    pub scene_size: f32,
    /// Counts rays and carries the wish to stop.
    pub progress: &'a Progress,
}

/// One camera ray and what it met.
pub struct Shot {
    /// The numbers of this iteration of this pixel.
    pub sampler: Sampler,
    /// The ray; none outside of a fisheye's picture.
    pub ray: Option<Ray>,
    /// Share of the light from its end that what it passed lets through, over the probability of
    /// passing.
    pub share: f32,
    /// The surface, if the ray met one.
    pub surface: Option<Surface>,
    /// What goes into the passes.
    pub seen: Sighting,
    /// Radiance that the camera sees of lamps and of a glowing surface.
    pub emission: Vec3A,
    /// Radiance that it sees of the background.
    pub environment: Vec3A,
    /// What comes from below the surface.
    pub below: Option<Reflected>,
    /// What it finds on a shadow catcher.
    pub caught: Option<Caught>,
}

impl Shot {
    /// Radiance that is the pixel's own whatever it shares: all but what the surface reflects.
    pub fn radiance(&self) -> Vec3A {
        let below = self.below.as_ref().map_or(Vec3A::ZERO, Reflected::sum);
        self.emission + self.environment + below
    }

    /// Adds what comes from below the surface to what passes keep.
    fn divide_below(&self, divided: &mut Divided) {
        if let Some(below) = &self.below {
            below.divide(divided, 1.0);
        }
    }

    /// Of a pixel outside of a fisheye's picture: black and opaque, as in Cycles.
    fn outside(sampler: Sampler) -> Self {
        Self {
            sampler,
            ray: None,
            share: 1.0,
            surface: None,
            seen: Sighting::BACKGROUND,
            emission: Vec3A::ZERO,
            environment: Vec3A::ZERO,
            below: None,
            caught: None,
        }
    }
}

impl View<'_> {
    /// Whether the camera was cut between this frame and `next`.
    pub fn is_cut_before(&self, next: &View) -> bool {
        let size = self.scene_size.max(next.scene_size);
        let camera = &self.tracer.frame.camera;
        camera.is_cut_before(&next.tracer.frame.camera, size)
    }

    /// # Errors
    /// [`Error::Cancelled`] once the user wants to stop.
    pub fn check_cancelled(&self) -> Result<()> {
        if self.progress.is_cancelled() {
            return Err(Error::Cancelled);
        }
        Ok(())
    }

    /// Works through the rows of a frame, from the lowest, on all threads.
    ///
    /// # Errors
    /// [`Error::Cancelled`] once the user wants to stop.
    pub fn for_rows<R: Send>(
        &self,
        rows: impl IndexedParallelIterator<Item = R>,
        work: impl Fn(usize, R) + Sync,
    ) -> Result<()> {
        self.count_rays(rows, work).map(|_| ())
    }

    /// The same; returns the number of rays.
    ///
    /// # Errors
    /// [`Error::Cancelled`] once the user wants to stop.
    pub fn count_rays<R: Send>(
        &self,
        rows: impl IndexedParallelIterator<Item = R>,
        work: impl Fn(usize, R) + Sync,
    ) -> Result<u64> {
        let rays = rows.enumerate().map(|(y, row)| {
            self.check_cancelled()?;
            work(y, row);
            let rays = take_rays();
            self.progress.count_rays(rays);
            Ok(rays)
        });
        rays.try_reduce(|| 0, |a, b| Ok(a + b))
    }

    /// The random numbers of an iteration of pixel (`x`, `y`) of the region.
    pub fn sampler(&self, x: usize, y: usize, iteration: u32) -> Sampler {
        let tracer = &self.tracer;
        let pixel_index = self.region.pixel_index(x, y);
        Sampler::new(
            tracer.settings.seed,
            tracer.frame.frame,
            pixel_index,
            iteration,
        )
    }

    /// Traces the camera ray of an iteration through pixel (`x`, `y`) of the region.
    pub fn shoot(&self, x: usize, y: usize, iteration: u32) -> Shot {
        let tracer = &self.tracer;
        let sampler = self.sampler(x, y, iteration);
        let numbers = sampler.camera();
        let offset = Vec2::from_array(numbers.pixel.map(|u| self.filter.sample(u)));
        let film = self.region.film(x, y, offset);
        let time = self.shutter.time(&sampler);
        let Some(ray) = tracer.frame.camera_ray(film, numbers.lens, time) else {
            return Shot::outside(sampler);
        };
        let (surface, passed) = tracer.arrive(&ray, &Bounces::default(), &sampler);
        let distance = surface.as_ref().map_or(ray.t_max, |s| s.distance);
        // Lamps hide nothing: they shine through each other and in front of what is behind.
        let seen_ray = Ray {
            t_max: distance,
            ..ray
        };
        let lamps =
            tracer
                .lights
                .lamps_along(&seen_ray, -ray.direction, Strategy::One, RayKind::Camera, 0);
        let lamps: Vec3A = lamps.map(|lamp| passed.share(lamp.t) * lamp.radiance).sum();
        let is_hole = |surface: &Surface| {
            let instance = surface.hit.instance as usize;
            !surface.is_medium && tracer.frame.instances[instance].is_holdout
        };
        let hidden_background = tracer.settings.film_transparent;
        let (is_held_out, surface) = match surface {
            Some(surface) if is_hole(&surface) => (true, None),
            surface => (false, surface),
        };
        let (seen, environment) = match &surface {
            // As in Cycles a hole is a hole even where the background shows.
            None if is_held_out => (Sighting::NOTHING, Vec3A::ZERO),
            Some(surface) => (self.sighting(surface), Vec3A::ZERO),
            None if hidden_background => {
                let coverage = 1.0 - passed.share(distance).element_sum() / 3.0;
                let sighting = Sighting {
                    coverage,
                    ..Sighting::NOTHING
                };
                (sighting, Vec3A::ZERO)
            }
            None => {
                let radiance =
                    tracer
                        .lights
                        .environment_radiance(ray.direction, RayKind::Camera, 0);
                (Sighting::BACKGROUND, passed.share(distance) * radiance)
            }
        };
        let glow = surface.as_ref().map_or(Vec3A::ZERO, |s| s.emission);
        let below = |surface| tracer.from_below(surface, Bounces::default(), 1.0, &sampler);
        Shot {
            below: surface.as_ref().and_then(below),
            sampler,
            ray: Some(ray),
            share: passed.share(distance).element_sum() / 3.0,
            surface,
            seen,
            emission: glow + lamps + passed.glow,
            environment,
            caught: self.caught(&seen_ray, &sampler),
        }
    }

    /// What a camera ray finds on a shadow catcher before it ends, which the picture does not show.
    fn caught(&self, ray: &Ray, sampler: &Sampler) -> Option<Caught> {
        let alone = self.catchers.as_ref()?;
        let surface = alone.arrive(ray, &Bounces::default(), sampler).0?;
        let light = |tracer: &Tracer| {
            let reflected = tracer.reflected(&surface, Bounces::default(), 1.0, sampler);
            surface.emission + reflected.sum()
        };
        Some(Caught {
            among_all: light(&self.tracer),
            alone: light(alone),
        })
    }

    /// Adds what the camera ray of an iteration saw to the passes of its pixel, but for light that is
    /// scattered.
    pub fn note(&self, shot: &Shot, iteration: u32, pixel: &mut Pixel) {
        pixel.sums.add_sighting(iteration, &shot.seen);
        if let Some(catcher) = &mut pixel.catcher {
            catcher.add(shot.caught, shot.environment);
        }
        if pixel.extra.is_any() {
            let seen = Seen {
                frame: self.tracer.frame,
                region: self.region,
                surface: shot.surface.as_ref().filter(|s| !s.is_medium),
                ray: shot.ray.as_ref(),
                share: shot.share,
            };
            let extra = &mut pixel.extra;
            passes::add_data(extra, iteration, &seen);
            passes::add_mattes(extra, &seen);
            passes::add_outputs(extra, iteration, &seen);
            passes::add_seen_light(extra, iteration, shot.emission, shot.environment);
            if let Some(surface) = seen.surface {
                passes::add_colors(extra, iteration, surface);
                if extra.layout.keeps(passes::AMBIENT) {
                    let ambient = shot.share * self.ambient(surface, &shot.sampler);
                    extra.add(passes::AMBIENT, iteration, &ambient.to_array());
                }
            }
        }
    }

    /// Share of even light from all sides that reaches a surface, by one ray.
    fn ambient(&self, surface: &Surface, sampler: &Sampler) -> Vec3A {
        let bsdf = &surface.bsdf;
        let normal = match bsdf.albedo_lambert() == Vec3A::ZERO {
            true => surface.normal,
            false => bsdf.lambert_normal(),
        };
        let local = sample_cosine_hemisphere(sampler.scatter(0).direction);
        let direction = Frame::from_normal(normal).to_world(local);
        let distance = self.tracer.frame.passes.ambient_distance;
        self.tracer.ambient(surface, direction, distance)
    }

    fn sighting(&self, surface: &Surface) -> Sighting {
        Sighting {
            coverage: 1.0 - surface.holdout,
            normal: surface.normal,
            albedo: surface.albedo(),
            depth: Some(self.tracer.frame.camera.depth(surface.position)),
        }
    }
}

/// The rows of the film of a frame, or none for each row of a frame that has no film.
fn film_rows(
    film: Option<&mut Film>,
    region: Region,
) -> impl IndexedParallelIterator<Item = Option<FilmRow<'_>>> {
    let rows: Vec<_> = match film {
        Some(film) => film.rows_mut().map(Some).collect(),
        None => (0..region.height).map(|_| None).collect(),
    };
    rows.into_par_iter()
}

/// A frame that is rendered, as an estimator works on it.
pub struct Canvas<'a, H> {
    /// What its pixels add up to.
    pub film: &'a mut Film,
    /// What the estimator keeps of it.
    pub history: &'a mut H,
}

/// The samples of one iteration, and a frame that may borrow them.
pub struct Sharing<'a, M> {
    /// The frames of the window.
    pub views: &'a [View<'a>],
    /// What the first pass left of each.
    pub memories: &'a [M],
    /// The frame that borrows, a position in the window.
    pub target: usize,
    /// The frames that lend, itself among them.
    pub lenders: &'a [usize],
    /// The iteration.
    pub iteration: u32,
}

impl<'a, M> Sharing<'a, M> {
    /// The frame that borrows.
    pub fn view(&self) -> &'a View<'a> {
        &self.views[self.target]
    }
}

/// A way to render.
///
/// What an estimator adds to a film may depend on the frame and its lenders, on the pixel and the
/// iteration, and on nothing else: not on the other frames of the window, not on the order of work.
pub trait Estimator: Sync {
    /// What a frame keeps from one pass to the next.
    type Memory: Send + Sync;
    /// What a frame that is rendered keeps from one iteration to the next.
    type History;

    /// Fresh memory for a frame.
    fn memory(&self, region: Region) -> Self::Memory;

    /// Bytes that memory takes.
    fn memory_bytes(&self, memory: &Self::Memory) -> usize;

    /// A fresh history of a frame.
    fn history(&self, region: Region) -> Self::History;

    /// Bytes that a history takes.
    fn history_bytes(&self, _: &Self::History) -> usize {
        0
    }

    /// The pass "Borrowing": 1 where a pixel borrows from all frames, 0.5 from its own, 0 from none.
    fn borrowing(&self, _: &Self::History, region: Region) -> Vec<f32> {
        vec![0.0; region.width * region.height]
    }

    /// Before the first pass of an iteration over a frame, a position in the window: `readers` are
    /// the histories of the frames that may borrow from it, its own among them if it is rendered.
    fn expect(&self, _: &mut Self::Memory, _frame: usize, _readers: &[&Self::History]) {}

    /// First pass of an iteration over one frame. Only targets have a canvas.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    fn sample(
        &self,
        view: &View,
        iteration: u32,
        memory: &mut Self::Memory,
        canvas: Option<Canvas<Self::History>>,
    ) -> Result<()>;

    /// Second pass: what a frame borrows.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    fn share(&self, sharing: &Sharing<Self::Memory>, canvas: Canvas<Self::History>) -> Result<()>;
}

/// Frames whose samples a frame borrows, itself included, in ascending order; `step` is the
/// distance between rendered frames. They follow from the frame alone, whatever range is rendered,
/// so that no split of a range changes a bit.
pub fn lenders(settings: &Settings, frame: i32, step: i32) -> Vec<i32> {
    let (window, step) = (settings.window as i32, step.max(1));
    match settings.method {
        Method::Path | Method::Bilateral | Method::IrradianceCache => vec![frame],
        Method::DualCone => {
            // Centred; an even window looks one frame further back.
            let first = frame - (window / 2) * step;
            (0..window).map(|i| first + i * step).collect()
        }
        Method::Paper => {
            // Disjoint blocks, counted from frame 1, where Blender's scenes begin.
            let place = (frame - 1).div_euclid(step);
            let phase = (frame - 1).rem_euclid(step);
            let first = place.div_euclid(window) * window;
            let blocks = first..first + window;
            blocks.map(|i| 1 + phase + i * step).collect()
        }
    }
}

/// Every frame that must be known to render `targets`, in ascending order.
pub fn window_frames(settings: &Settings, targets: &[i32], step: i32) -> Vec<i32> {
    let mut frames: Vec<i32> = targets
        .iter()
        .flat_map(|&t| lenders(settings, t, step))
        .collect();
    frames.sort_unstable();
    frames.dedup();
    frames
}

/// Work that is done with whichever estimator the settings name.
pub trait WithEstimator {
    /// What the work yields.
    type Output;
    /// Does the work.
    fn run<E: Estimator>(self, estimator: &E) -> Self::Output;
}

/// Runs `work` with the estimator of the settings. A new estimator is a line here.
pub fn with_estimator<W: WithEstimator>(settings: &Settings, work: W) -> W::Output {
    match settings.method {
        Method::Path => work.run(&plain::Plain::new(settings)),
        Method::DualCone => work.run(&dual_cone::DualCone::new(settings)),
        Method::Paper => work.run(&paper::Paper::new(settings)),
        Method::Bilateral => work.run(&bilateral::Bilateral::new(settings)),
        Method::IrradianceCache => work.run(&irradiance_cache::IrradianceCache),
    }
}

#[cfg(test)]
mod tests;
