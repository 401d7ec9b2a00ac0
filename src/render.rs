//! Frames in, films out: prepares each frame of a window, runs the iterations, makes the passes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::Vec3A;

use crate::accel::Accel;
use crate::contract::{Method, Settings};
use crate::error::{Error, Result};
use crate::film::{Film, Layout, Region, pixel_filter};
use crate::media::Media;
use crate::path::Tracer;
use crate::progress::{Phase, Progress};
use crate::reuse::{
    Canvas, Catchers, Estimator, LightTree, Sharing, View, WithEstimator, lenders, window_frames,
    with_estimator,
};
use crate::sampling::{LightSampler, ShutterTimes};
use crate::scene::{FrameWindow, Instance, SceneFrame, Visibility};

/// Stack of a tracing thread: paths recurse once per bounce, and the limit may be set to 1024.
const STACK_BYTES: usize = 16 << 20;

/// A render to do.
pub struct Job {
    /// Frames of the scene, in ascending order: at least those of [`window_frames`].
    pub frames: Vec<Arc<SceneFrame>>,
    /// Frames to render.
    pub targets: Vec<i32>,
    /// Distance between rendered frames.
    pub step: i32,
    /// Rectangle to render.
    pub region: Region,
    /// Settings.
    pub settings: Settings,
    /// Names of the passes that are wanted.
    pub passes: Vec<String>,
    /// Threads; 0 means as many as the machine has.
    pub threads: usize,
}

/// One rendered frame.
pub struct Rendered {
    /// The frame's number.
    pub frame: i32,
    /// The passes that were asked for, by name.
    pub passes: Vec<(String, Vec<f32>)>,
    /// What it took.
    pub report: Report,
}

/// What a frame took: its share of what was spent on all frames of the job.
#[derive(Debug, Clone, Copy, Default)]
pub struct Report {
    /// Building trees and tables [s].
    pub build_seconds: f64,
    /// Tracing samples [s].
    pub pass_1_seconds: f64,
    /// Sharing them [s].
    pub pass_2_seconds: f64,
    /// Making passes [s].
    pub resolve_seconds: f64,
    /// Rays.
    pub rays: u64,
    /// Samples per pixel.
    pub samples: u32,
    /// Noise as a share of the brightness, where a limit on noise or time asked for it.
    pub noise: Option<f32>,
    /// Mean over the pixels of gather samples that each is worth, borrowed ones included.
    pub effective_samples: f32,
    /// Bytes held for the frame's pixels, records included.
    pub pixel_memory_bytes: usize,
}

/// Renders `job`.
///
/// # Errors
/// A frame that is missing, an empty region, or [`Error::Cancelled`].
pub fn render(job: &Job, progress: &Progress) -> Result<Vec<Rendered>> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(job.threads)
        .stack_size(STACK_BYTES)
        .build();
    let pool = pool.map_err(|error| Error::Threads {
        reason: error.to_string(),
    })?;
    let rendered = pool.install(|| prepare_and_run(job, progress));
    progress.enter(Phase::Done);
    rendered
}

/// What tracing paths needs beside a frame itself.
struct Stage {
    accel: Accel,
    lights: LightSampler,
    see_through: Vec<bool>,
    media: Media,
}

impl Stage {
    /// What is costly to make and unchanged is taken over from the frame before.
    fn of(frame: &SceneFrame, before: Option<(&SceneFrame, &Self)>) -> Self {
        let accel = Accel::build(frame, before.map(|(frame, _)| frame));
        Self {
            lights: LightSampler::build(frame, before.map(|(_, stage)| &stage.lights)),
            see_through: see_through(frame),
            media: Media::of(frame, accel.bounds()),
            accel,
        }
    }

    fn tracer<'a>(&'a self, frame: &'a SceneFrame, settings: &'a Settings) -> Tracer<'a> {
        Tracer {
            frame,
            accel: &self.accel,
            lights: &self.lights,
            settings,
            see_through: &self.see_through,
            media: &self.media,
        }
    }
}

/// What rendering needs beside a frame itself.
struct Prepared {
    stage: Stage,
    light_tree: Arc<LightTree>,
    shutter: ShutterTimes,
    /// The frame's shadow catchers, as they are without anything else.
    catchers: Option<Box<(SceneFrame, Stage)>>,
    scene_size: f32,
}

impl Prepared {
    /// What is costly to make and unchanged is taken over from the frame before.
    fn new(frame: &SceneFrame, before: Option<(&SceneFrame, &Self)>) -> Self {
        let previous = before.map(|(_, prepared)| prepared);
        let mut stage = Stage::of(frame, before.map(|(frame, p)| (frame, &p.stage)));
        let (lower, upper) = stage.accel.bounds().unwrap_or((Vec3A::ZERO, Vec3A::ONE));
        let lights = &mut stage.lights;
        let same_world = previous.filter(|p| p.light_tree.is_of(&frame.world));
        let build = || Arc::new(LightTree::build(&frame.world, |d| lights.is_sun(d)));
        let light_tree = same_world.map_or_else(build, |p| p.light_tree.clone());
        match same_world {
            Some(previous) => lights.take_small_sky(&previous.stage.lights),
            None => lights.set_small_sky(&frame.world, |d| light_tree.leaf(d).is_small()),
        }
        let catchers = frame.catchers().map(|catchers| {
            let stage = Stage::of(&catchers, None);
            Box::new((catchers, stage))
        });
        Self {
            stage,
            light_tree,
            shutter: ShutterTimes::of(frame),
            catchers,
            scene_size: (upper - lower).length(),
        }
    }
}

/// [`Tracer::see_through`] of a frame.
fn see_through(frame: &SceneFrame) -> Vec<bool> {
    let is_see_through = |instance: &Instance| {
        let mut materials = instance.materials.iter();
        instance.visibility != Visibility::ALL
            || materials.any(|&material| frame.materials[material as usize].is_see_through())
    };
    let all: Vec<bool> = frame.instances.iter().map(is_see_through).collect();
    if all.contains(&true) { all } else { Vec::new() }
}

fn prepare_and_run(job: &Job, progress: &Progress) -> Result<Vec<Rendered>> {
    let start = Instant::now();
    let region = job.region.checked()?;
    let numbers = window_frames(&job.settings, &job.targets, job.step);
    let needed = |frame: &&Arc<SceneFrame>| numbers.contains(&frame.frame);
    let window = FrameWindow::new(job.frames.iter().filter(needed).cloned().collect())?;
    for &frame in &numbers {
        if window.position(frame).is_none() {
            let reason = "the frames around it need its scene".into();
            return Err(Error::Frame { frame, reason });
        }
    }
    progress.enter(Phase::Build);
    let mut prepared: Vec<Prepared> = Vec::new();
    for (index, frame) in window.frames().iter().enumerate() {
        if progress.is_cancelled() {
            return Err(Error::Cancelled);
        }
        let before = prepared.last().map(|p| (&*window.frames()[index - 1], p));
        prepared.push(Prepared::new(frame, before));
    }
    let filter = pixel_filter(&job.settings);
    let views: Vec<View> = prepared
        .iter()
        .enumerate()
        .map(|(index, prepared)| View {
            tracer: prepared
                .stage
                .tracer(&window.frames()[index], &job.settings),
            catchers: prepared
                .catchers
                .as_deref()
                .map(|(catchers, stage)| Catchers {
                    alone: stage.tracer(catchers, &job.settings),
                    numbers: window.frames()[index].catcher_numbers().collect(),
                }),
            index,
            window: &window,
            region,
            filter: &filter,
            shutter: &prepared.shutter,
            light_tree: &prepared.light_tree,
            scene_size: prepared.scene_size,
            progress,
        })
        .collect();
    let build_seconds = start.elapsed().as_secs_f64();
    let iterations = Iterations {
        job,
        views: &views,
        progress,
        build_seconds,
    };
    with_estimator(&job.settings, iterations)
}

/// The iterations of a job, with whichever estimator it names.
struct Iterations<'a> {
    job: &'a Job,
    views: &'a [View<'a>],
    progress: &'a Progress,
    build_seconds: f64,
}

/// A frame that is rendered: its place in the window, those of its lenders, its film.
struct Target<H> {
    index: usize,
    lenders: Vec<usize>,
    film: Film,
    /// What the estimator keeps of it.
    history: H,
    /// Whether it is clean enough.
    is_done: bool,
}

impl WithEstimator for Iterations<'_> {
    type Output = Result<Vec<Rendered>>;

    fn run<E: Estimator>(self, estimator: &E) -> Self::Output {
        let region = self.views[0].region;
        let mut memories: Vec<E::Memory> = self
            .views
            .iter()
            .map(|_| estimator.memory(region))
            .collect();
        let mut targets = self.targets(estimator)?;
        let pixel_bytes = pixel_bytes(estimator, &memories, &targets);
        let scenes = SceneFrame::memory_bytes(self.views.iter().map(|view| view.tracer.frame));
        self.progress.set_memory_bytes(pixel_bytes + scenes);
        self.progress.expect_iterations(self.job.settings.samples);
        self.progress.enter(Phase::Sample);
        let start = Instant::now();
        let (mut pass_1, mut pass_2) = (Duration::ZERO, Duration::ZERO);
        for iteration in 0..self.job.settings.samples {
            let sampling = Instant::now();
            self.sample(estimator, iteration, &mut memories, &mut targets)?;
            let sharing = Instant::now();
            pass_1 += sharing - sampling;
            self.share(estimator, iteration, &memories, &mut targets)?;
            pass_2 += sharing.elapsed();
            self.progress.count_iteration();
            self.answer_preview(&targets);
            if self.is_out_of_time(start) || targets.iter().all(|target| target.is_done) {
                break;
            }
        }
        let share = 1.0 / targets.len() as f64;
        let report = Report {
            build_seconds: self.build_seconds * share,
            pass_1_seconds: pass_1.as_secs_f64() * share,
            pass_2_seconds: pass_2.as_secs_f64() * share,
            rays: self.progress.rays() / targets.len() as u64,
            pixel_memory_bytes: pixel_bytes / self.views.len(),
            ..Report::default()
        };
        self.progress.enter(Phase::Resolve);
        Ok(targets
            .iter()
            .map(|target| self.rendered(estimator, target, report))
            .collect())
    }
}

/// Bytes held for pixels: films, and what the estimator keeps.
fn pixel_bytes<E: Estimator>(
    estimator: &E,
    memories: &[E::Memory],
    targets: &[Target<E::History>],
) -> usize {
    let memories = memories.iter().map(|m| estimator.memory_bytes(m));
    let of_target = |t: &Target<_>| t.film.memory_bytes() + estimator.history_bytes(&t.history);
    memories.sum::<usize>() + targets.iter().map(of_target).sum::<usize>()
}

impl Iterations<'_> {
    fn targets<E: Estimator>(&self, estimator: &E) -> Result<Vec<Target<E::History>>> {
        let window = self.views[0].window;
        let mut frames = self.job.targets.clone();
        frames.sort_unstable();
        frames.dedup();
        if frames.is_empty() {
            return Err(Error::Missing { field: "targets" });
        }
        let layout = Layout::new(self.job.passes.iter().map(String::as_str))?;
        let target = |&frame: &i32| {
            let index = window.position(frame).unwrap_or_default();
            let frames = lenders(&self.job.settings, frame, self.job.step);
            let positions = frames.iter().filter_map(|&f| window.position(f));
            Target {
                index,
                lenders: positions.filter(|&l| self.is_one_shot(index, l)).collect(),
                film: self.film(&layout),
                history: estimator.history(self.views[0].region),
                is_done: false,
            }
        };
        Ok(frames.iter().map(target).collect())
    }

    /// Whether no cut lies between two frames of the window. The paper's method knows of none.
    fn is_one_shot(&self, a: usize, b: usize) -> bool {
        let shot = &self.views[a.min(b)..=a.max(b)];
        self.job.settings.method == Method::Paper
            || !shot.windows(2).any(|pair| pair[0].is_cut_before(&pair[1]))
    }

    fn film(&self, layout: &Layout) -> Film {
        let mut film = Film::new(self.views[0].region, layout.clone());
        let settings = &self.job.settings;
        if settings.noise_threshold > 0.0 || settings.time_limit > 0.0 {
            film.watch_noise();
        }
        if self.views.iter().any(|view| view.catchers.is_some()) {
            film.catch_shadows();
        }
        film
    }

    /// Whether a frame's noise has fallen to the threshold.
    fn is_clean(&self, film: &Film) -> bool {
        let noise = film.noise().unwrap_or(f32::INFINITY);
        noise <= self.job.settings.noise_threshold
    }

    /// The first pass over every frame of the window that an unfinished target needs.
    fn sample<E: Estimator>(
        &self,
        estimator: &E,
        iteration: u32,
        memories: &mut [E::Memory],
        targets: &mut [Target<E::History>],
    ) -> Result<()> {
        for (index, (view, memory)) in self.views.iter().zip(memories).enumerate() {
            let readers = targets
                .iter()
                .filter(|target| !target.is_done && target.lenders.contains(&index))
                .map(|target| &target.history);
            let readers: Vec<_> = readers.collect();
            if readers.is_empty() {
                continue;
            }
            estimator.expect(memory, index, &readers);
            let mut unfinished = targets.iter_mut().filter(|target| !target.is_done);
            let canvas = unfinished
                .find(|target| target.index == index)
                .map(|target| Canvas {
                    film: &mut target.film,
                    history: &mut target.history,
                });
            estimator.sample(view, iteration, memory, canvas)?;
        }
        Ok(())
    }

    /// The second pass over every unfinished target.
    fn share<E: Estimator>(
        &self,
        estimator: &E,
        iteration: u32,
        memories: &[E::Memory],
        targets: &mut [Target<E::History>],
    ) -> Result<()> {
        for target in targets.iter_mut().filter(|target| !target.is_done) {
            let sharing = Sharing {
                views: self.views,
                memories,
                target: target.index,
                lenders: &target.lenders,
                iteration,
            };
            let canvas = Canvas {
                film: &mut target.film,
                history: &mut target.history,
            };
            estimator.share(&sharing, canvas)?;
            target.film.count_iteration();
            target.is_done = self.is_clean(&target.film);
        }
        Ok(())
    }

    fn is_out_of_time(&self, start: Instant) -> bool {
        let limit = self.job.settings.time_limit * self.job.targets.len() as f32;
        limit > 0.0 && start.elapsed().as_secs_f32() > limit
    }

    fn answer_preview<H>(&self, targets: &[Target<H>]) {
        if let Some(frame) = self.progress.wanted_preview() {
            let shows = |t: &&Target<H>| self.views[t.index].tracer.frame.frame == frame;
            if let Some(target) = targets.iter().find(shows) {
                self.progress.show_preview(frame, target.film.combined());
            }
        }
    }

    fn rendered<E: Estimator>(
        &self,
        estimator: &E,
        target: &Target<E::History>,
        report: Report,
    ) -> Rendered {
        let start = Instant::now();
        let numbers = |pass: &str| match pass {
            "Borrowing" => estimator.borrowing(&target.history, target.film.region),
            _ => target.film.resolve(pass),
        };
        let passes = &self.job.passes;
        let passes = passes.iter().map(|pass| (pass.clone(), numbers(pass)));
        let passes = passes.collect();
        Rendered {
            frame: self.views[target.index].tracer.frame.frame,
            passes,
            report: Report {
                resolve_seconds: start.elapsed().as_secs_f64(),
                samples: target.film.samples(),
                noise: target.film.noise(),
                effective_samples: target.film.mean_effective_samples(),
                ..report
            },
        }
    }
}

#[cfg(test)]
mod tests;
