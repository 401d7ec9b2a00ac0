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

use crate::accel::Hit;
use crate::contract::{Method, Settings};
use crate::error::{Error, Result};
use crate::film::{Caught, Extra, Film, Pixel, Region, Sighting};
use crate::math::warp::sample_cosine_hemisphere;
use crate::math::{Frame, PixelFilter, Ray};
use crate::passes::{self, Seen, Shown};
use crate::path::{Bounces, Divided, Passed, Reflected, Tracer, clamped, take_rays};
use crate::progress::Progress;
use crate::sampling::{LightHit, Sampler, ShutterTimes, Strategy};
use crate::scene::FrameWindow;
use crate::shader::{Around, RayInfo, RayKind};
use crate::surface::Surface;

/// One frame, ready to trace.
pub struct View<'a> {
    /// Traces paths in the frame.
    pub tracer: Tracer<'a>,
    /// Its shadow catchers, if it has any.
    pub catchers: Option<Catchers<'a>>,
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

/// The shadow catchers of a frame.
pub struct Catchers<'a> {
    /// Traces paths in the frame without anything else.
    pub alone: Tracer<'a>,
    /// What number each of its instances has among all.
    pub numbers: Vec<u32>,
}

/// One camera ray and what it met.
pub struct Shot {
    /// The numbers of this iteration of this pixel.
    pub sampler: Sampler,
    /// The surface, if the ray met one that is no hole in the picture.
    pub surface: Option<Surface>,
    /// The ray up to its end; none outside of a fisheye's picture.
    ray: Option<Ray>,
    passed: Passed,
    is_hole: bool,
    /// The shadow catcher at its end: the camera sees its shadows, and past them the background.
    catcher: Option<Surface>,
}

/// What the camera sees along a ray, but for what the surface reflects.
pub struct Sight {
    seen: Sighting,
    /// Share of the light from the ray's end that what it passed lets through, over the probability of
    /// passing.
    share: f32,
    /// Radiance of lamps, of media and of a glowing surface.
    emission: Vec3A,
    /// Radiance of the background.
    environment: Vec3A,
    /// Light that media on the ray's way scatter straight from its source.
    in_scattered: Vec3A,
    /// What comes from below the surface.
    below: Option<Reflected>,
    /// What is found on a shadow catcher.
    caught: Option<Caught>,
}

impl Sight {
    /// Outside of a fisheye's picture: black and opaque, as in Cycles.
    const OUTSIDE: Self = Self {
        seen: Sighting::BACKGROUND,
        share: 1.0,
        emission: Vec3A::ZERO,
        environment: Vec3A::ZERO,
        in_scattered: Vec3A::ZERO,
        below: None,
        caught: None,
    };

    /// All of its radiance: the pixel's own whatever it shares.
    fn radiance(&self) -> Vec3A {
        let below = self.below.as_ref().map_or(Vec3A::ZERO, Reflected::sum);
        self.emission + self.environment + self.in_scattered + below
    }

    /// Adds what comes from below the surface to what passes keep.
    fn divide_below(&self, divided: &mut Divided) {
        if let Some(below) = &self.below {
            below.divide(divided, 1.0);
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
        Sampler::new(
            tracer.settings.seed,
            tracer.frame.frame,
            self.region.pixel(x, y),
            iteration,
            tracer.settings.samples,
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
        let Some(mut ray) = tracer.frame.camera_ray(film, numbers.lens, time) else {
            return Shot {
                sampler,
                surface: None,
                ray: None,
                passed: Passed::default(),
                is_hole: false,
                catcher: None,
            };
        };
        let catchers = self.catchers.as_ref();
        let catcher = catchers.and_then(|c| c.alone.arrive(&ray, &Bounces::default(), &sampler).0);
        if let Some(catcher) = &catcher {
            ray.t_max = catcher.distance;
        }
        let (surface, passed) = tracer.arrive(&ray, &Bounces::default(), &sampler);
        if let Some(surface) = &surface {
            ray.t_max = surface.distance;
        }
        let is_hole = |surface: &Surface| {
            let instance = surface.hit.instance as usize;
            !surface.is_medium && tracer.frame.instances[instance].is_holdout
        };
        let is_hole = surface.as_ref().is_some_and(is_hole);
        Shot {
            sampler,
            catcher: catcher.filter(|_| surface.is_none()),
            surface: surface.filter(|_| !is_hole),
            ray: Some(ray),
            passed,
            is_hole,
        }
    }

    /// The surface that passes of what is seen show.
    fn shown<'a>(&self, shot: &'a Shot, info: &RayInfo) -> Shown<'a> {
        let (Some(ray), false) = (&shot.ray, shot.is_hole) else {
            return Shown::default();
        };
        let (tracer, threshold) = (&self.tracer, self.tracer.frame.passes.alpha_threshold);
        let first = shot.passed.first_of(threshold);
        let last = || shot.passed.last().filter(|_| shot.surface.is_none());
        let end = shot.surface.as_ref().filter(|s| !s.is_medium);
        let is_end_dense =
            || end.is_some_and(|end| tracer.opacity(&end.hit, ray, info) >= threshold);
        Shown {
            is_dense: first.is_some() || is_end_dense(),
            passed: first
                .or_else(last)
                .map(|hit| Box::new(tracer.surface_at(hit, ray, info))),
            end,
        }
    }

    fn look(&self, shot: &Shot, shown: &Shown) -> Sight {
        let Some(ray) = &shot.ray else {
            return Sight::OUTSIDE;
        };
        let (tracer, passed) = (&self.tracer, &shot.passed);
        let lamps = self.lamps_seen(ray);
        let lamps: Vec3A = lamps
            .map(|lamp| passed.mean_share(lamp.t) * lamp.radiance)
            .sum();
        let surface = shot.surface.as_ref();
        let glow = self.glow_seen(shot).map_or(Vec3A::ZERO, |(glow, _)| glow);
        let share = passed.share(ray.t_max);
        let (coverage, environment) = self.behind(shot, ray, share);
        Sight {
            seen: self.sighting(shot, shown, coverage),
            share: share.element_sum() / 3.0,
            emission: self.limited(glow) + self.limited(lamps) + self.limited(passed.glow),
            environment: self.limited(environment),
            in_scattered: tracer.in_scattered(ray, passed, &Bounces::default(), 1.0, &shot.sampler),
            below: surface.and_then(|surface| {
                tracer.from_below(surface, Bounces::default(), 1.0, &shot.sampler)
            }),
            caught: self.caught(shot),
        }
    }

    /// Light that the surface at the ray's end gives off, and its light group: on the mean where even media
    /// lie before it, which may have scattered the ray.
    fn glow_seen(&self, shot: &Shot) -> Option<(Vec3A, u8)> {
        match shot.passed.behind {
            Some(behind) => behind.glow.filter(|_| !shot.is_hole),
            None => {
                let surface = shot.surface.as_ref()?;
                Some((surface.emission, self.tracer.group_of(surface)))
            }
        }
    }

    /// Light that the camera sees at its source; it is limited as direct light is, as in Cycles.
    fn limited(&self, light: Vec3A) -> Vec3A {
        clamped(light, 1.0, self.tracer.settings.clamp_direct)
    }

    /// How much of the film the end of a ray covers, of whose light `share` arrives, and the radiance of
    /// the background if that is it.
    fn behind(&self, shot: &Shot, ray: &Ray, share: Vec3A) -> (f32, Vec3A) {
        // As in Cycles a hole is a hole even where the background shows.
        if shot.is_hole {
            return (0.0, Vec3A::ZERO);
        }
        let is_transparent = self.tracer.settings.film_transparent;
        let coverage = match &shot.surface {
            Some(surface) => {
                let seen_through = self.tracer.seen_through(surface, &shot.sampler);
                1.0 - surface.holdout - seen_through
            }
            None if is_transparent => 1.0 - share.element_sum() / 3.0,
            None => 1.0,
        };
        let share = match &shot.passed.behind {
            Some(behind) if behind.glow.is_none() => behind.share,
            None if shot.surface.is_none() => share,
            _ => return (coverage, Vec3A::ZERO),
        };
        if is_transparent {
            return (coverage, Vec3A::ZERO);
        }
        let lights = &self.tracer.lights;
        let radiance = lights.environment_radiance(ray.direction, RayKind::Camera, 0);
        (coverage, share * radiance)
    }

    /// What a camera ray finds on the shadow catcher at its end, which the picture does not show.
    fn caught(&self, shot: &Shot) -> Option<Caught> {
        let (Catchers { alone, numbers }, surface) =
            (self.catchers.as_ref()?, shot.catcher.as_ref()?);
        let light = |tracer: &Tracer, hit: Hit| {
            let mut surface = surface.clone();
            surface.hit = hit;
            let reflected = tracer.reflected(&surface, Bounces::default(), 1.0, &shot.sampler);
            surface.emission + reflected.sum()
        };
        let own = surface.hit;
        let among_all = Hit {
            instance: match surface.is_medium {
                true => own.instance,
                false => numbers[own.instance as usize],
            },
            ..own
        };
        Some(Caught {
            among_all: light(&self.tracer, among_all),
            alone: light(alone, own),
        })
    }

    /// Adds what the camera sees along the ray of an iteration to its pixel and to the passes, but for
    /// light that the surface reflects; returns it.
    pub fn see(&self, shot: &Shot, iteration: u32, pixel: &mut Pixel) -> Sight {
        let start = Bounces::default();
        let around = shot
            .ray
            .as_ref()
            .map(|ray| self.tracer.around(ray, &start, &shot.sampler));
        let info = start.ray_info(around.as_ref().map(|around| around as &dyn Around));
        let shown = self.shown(shot, &info);
        let sight = self.look(shot, &shown);
        pixel.sums.add_sighting(iteration, &sight.seen);
        pixel.sums.add_radiance(sight.radiance());
        if let Some(catcher) = &mut pixel.catcher {
            catcher.add(sight.caught, sight.environment);
        }
        if pixel.extra.is_any() {
            let seen = Seen {
                frame: self.tracer.frame,
                region: self.region,
                arrived: shot.surface.as_ref(),
                surface: shot.surface.as_ref().filter(|s| !s.is_medium),
                shown: &shown,
                info: &info,
                ray: shot.ray.as_ref(),
                share: sight.share,
            };
            let extra = &mut pixel.extra;
            passes::add_data(extra, iteration, &seen);
            passes::add_mattes(extra, &seen);
            passes::add_outputs(extra, iteration, &seen);
            passes::add_seen_light(extra, iteration, sight.emission, sight.environment);
            if passes::wants_scattered(extra.layout) {
                passes::add_in_scattered(extra, iteration, sight.in_scattered);
            }
            if passes::wants_groups(extra.layout) {
                self.add_groups(extra, iteration, shot, sight.environment);
            }
            let light = sight.emission + sight.environment;
            let means = (&self.tracer, &shot.sampler);
            passes::add_guides(extra, iteration, &seen, light, means);
            if let Some(surface) = seen.surface {
                passes::add_colors(extra, iteration, surface);
                if extra.layout.keeps(passes::AMBIENT) {
                    let ambient = sight.share * self.ambient(surface, &shot.sampler);
                    extra.add(passes::AMBIENT, iteration, &ambient.to_array());
                }
            }
        }
        sight
    }

    /// Adds what the camera sees along a ray of each light group.
    fn add_groups(&self, extra: &mut Extra, iteration: u32, shot: &Shot, environment: Vec3A) {
        let (tracer, mut note) = (&self.tracer, |group, light: Vec3A| {
            passes::add_group(extra, iteration, group, light);
        });
        note(tracer.frame.world.reach.links.group, environment);
        if let Some(ray) = &shot.ray {
            for lamp in self.lamps_seen(ray) {
                let light = shot.passed.mean_share(lamp.t) * lamp.radiance;
                note(lamp.links.group, self.limited(light));
            }
            tracer.note_seen_in_media(ray, &shot.passed, &shot.sampler, &mut note);
        }
        if let Some((glow, group)) = self.glow_seen(shot) {
            note(group, self.limited(glow));
        }
        if let Some(surface) = &shot.surface {
            tracer.note_scattered(surface, &shot.sampler, &mut note);
        }
    }

    /// The lamps that a camera ray meets. They hide nothing: they shine through each other and in front
    /// of what is behind.
    fn lamps_seen(&self, ray: &Ray) -> impl Iterator<Item = LightHit> {
        let lights = &self.tracer.lights;
        lights.lamps_along(ray, -ray.direction, Strategy::One, RayKind::Camera, 0)
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
        self.tracer.ambient(surface, direction, distance, sampler)
    }

    fn sighting(&self, shot: &Shot, shown: &Shown, coverage: f32) -> Sighting {
        let camera = &self.tracer.frame.camera;
        let surface = shot.surface.as_ref();
        Sighting {
            coverage,
            normal: shown.dense().map_or(Vec3A::ZERO, |shown| shown.normal),
            albedo: surface.map_or(Vec3A::ZERO, Surface::albedo),
            depth: shown.surface().map(|shown| camera.depth(shown.position)),
        }
    }
}

/// The rows of a frame, or none for each row of a frame that has none of them.
fn rows_or_none<R: Send>(
    rows: Option<impl IndexedParallelIterator<Item = R>>,
    region: Region,
) -> impl IndexedParallelIterator<Item = Option<R>> {
    let rows: Vec<_> = match rows {
        Some(rows) => rows.map(Some).collect(),
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
