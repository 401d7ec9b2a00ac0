//! A render in the background.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::contract::settings;
use super::scene::SceneFrame;
use crate::contract::always_kept;
use crate::error::Error;
use crate::film::{Region, channels};
use crate::progress::{Phase, Progress};
use crate::render::{Job, Rendered, Report, render};

/// Renders frames in the background, beginning at once. Python polls and may cancel.
#[pyclass(frozen)]
pub struct Render {
    progress: Arc<Progress>,
    started: Instant,
    width: usize,
    height: usize,
    outcome: Mutex<Outcome>,
}

enum Outcome {
    Running(Receiver<Result<Vec<Rendered>, Error>>),
    Finished(Vec<Rendered>),
    Failed(String),
}

#[pymethods]
impl Render {
    #[new]
    #[pyo3(signature = (frames, targets, step, region, settings, threads, passes = None))]
    fn new(
        frames: Vec<PyRef<'_, SceneFrame>>,
        targets: Vec<i32>,
        step: i32,
        region: &Bound<'_, PyDict>,
        settings: &Bound<'_, PyDict>,
        threads: usize,
        passes: Option<Vec<String>>,
    ) -> PyResult<Self> {
        let job = Job {
            frames: frames.iter().map(|frame| frame.0.clone()).collect(),
            targets,
            step,
            region: region_of(region)?,
            settings: self::settings(settings)?,
            passes: passes.unwrap_or_else(always_kept),
            threads,
        };
        let progress = Arc::new(Progress::default());
        let (sender, receiver) = channel();
        let (width, height) = (job.region.width, job.region.height);
        let watched = progress.clone();
        let thread = std::thread::Builder::new().name("dualcone".into());
        let thread = thread.spawn(move || {
            // Nobody may be listening any more; then the pictures are not wanted.
            let _ = sender.send(render(&job, &watched));
        });
        thread.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        Ok(Self {
            progress,
            started: Instant::now(),
            width,
            height,
            outcome: Mutex::new(Outcome::Running(receiver)),
        })
    }

    /// What the render does and how far it is.
    fn progress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (done, total) = self.progress.iterations();
        let phase = self.progress.phase();
        let fraction = f64::from(done) / f64::from(total.max(1));
        let elapsed = self.started.elapsed().as_secs_f64();
        let left = (done > 0).then(|| elapsed * (1.0 - fraction) / fraction);
        let dict = PyDict::new(py);
        dict.set_item("phase", phase.name())?;
        dict.set_item("done", phase == Phase::Done)?;
        dict.set_item("samples_done", done)?;
        dict.set_item("samples_total", total)?;
        dict.set_item("fraction", fraction)?;
        dict.set_item("seconds_elapsed", elapsed)?;
        dict.set_item("seconds_left", left)?;
        dict.set_item("rays", self.progress.rays())?;
        dict.set_item("memory_bytes", self.progress.memory_bytes())?;
        Ok(dict)
    }

    /// Asks the render to stop and returns at once; it winds down within a row of pixels.
    fn cancel(&self) {
        self.progress.cancel();
    }

    /// Waits until the render has finished, at most so long; whether it has.
    fn wait(&self, py: Python<'_>, seconds: f64) -> bool {
        let limit = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::ZERO);
        py.detach(|| {
            let mut outcome = self.outcome.lock().unwrap_or_else(PoisonError::into_inner);
            let Outcome::Running(receiver) = &*outcome else {
                return true;
            };
            *outcome = match receiver.recv_timeout(limit) {
                Err(RecvTimeoutError::Timeout) => return false,
                Ok(Ok(rendered)) => Outcome::Finished(rendered),
                Ok(Err(error)) => Outcome::Failed(error.to_string()),
                Err(RecvTimeoutError::Disconnected) => {
                    Outcome::Failed("the renderer stopped unexpectedly; please report it".into())
                }
            };
            true
        })
    }

    /// The picture so far of a frame (H, W, 4), rows from the bottom; `None` where none is ready.
    fn preview<'py>(
        &self,
        py: Python<'py>,
        frame: i32,
    ) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        let combined = self.progress.preview(frame);
        combined
            .map(|numbers| self.array(py, numbers, 4))
            .transpose()
    }

    /// Passes and report of a frame of a render that has finished. Each frame is handed out once.
    fn result<'py>(&self, py: Python<'py>, frame: i32) -> PyResult<Bound<'py, PyDict>> {
        let mut outcome = self.outcome.lock().unwrap_or_else(PoisonError::into_inner);
        let rendered = match &mut *outcome {
            Outcome::Running(_) => return Err(PyRuntimeError::new_err("the render still runs")),
            Outcome::Failed(message) => return Err(PyRuntimeError::new_err(message.clone())),
            Outcome::Finished(all) => {
                let found = all.iter().position(|rendered| rendered.frame == frame);
                let place = found.ok_or_else(|| {
                    PyValueError::new_err(format!("frame {frame} is not there (any more)"))
                })?;
                all.swap_remove(place)
            }
        };
        let passes = PyDict::new(py);
        for (name, numbers) in rendered.passes {
            let array = self.array(py, numbers, channels(&name))?;
            passes.set_item(name, array)?;
        }
        let dict = PyDict::new(py);
        dict.set_item("passes", passes)?;
        dict.set_item("report", report(py, &rendered.report)?)?;
        Ok(dict)
    }
}

impl Render {
    /// The numbers as an array (H, W, channels) that owns them.
    fn array<'py>(
        &self,
        py: Python<'py>,
        numbers: Vec<f32>,
        channels: usize,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        PyArray1::from_vec(py, numbers).reshape([self.height, self.width, channels])
    }
}

impl Drop for Render {
    fn drop(&mut self) {
        self.progress.cancel();
    }
}

fn region_of(dict: &Bound<'_, PyDict>) -> PyResult<Region> {
    let get = |name: &'static str| -> PyResult<usize> {
        let value = dict.get_item(name)?;
        value.ok_or(Error::Missing { field: name })?.extract()
    };
    let (x, y) = (get("x_min")?, get("y_min")?);
    Ok(Region {
        frame_width: get("width")?,
        frame_height: get("height")?,
        x,
        y,
        width: get("x_max")?.saturating_sub(x),
        height: get("y_max")?.saturating_sub(y),
    }
    .checked()?)
}

fn report<'py>(py: Python<'py>, report: &Report) -> PyResult<Bound<'py, PyDict>> {
    let seconds = PyDict::new(py);
    seconds.set_item("build", report.build_seconds)?;
    seconds.set_item("pass_1", report.pass_1_seconds)?;
    seconds.set_item("pass_2", report.pass_2_seconds)?;
    seconds.set_item("resolve", report.resolve_seconds)?;
    let dict = PyDict::new(py);
    dict.set_item("seconds", seconds)?;
    dict.set_item("rays", report.rays)?;
    dict.set_item("samples", report.samples)?;
    dict.set_item("noise", report.noise)?;
    dict.set_item("effective_samples", report.effective_samples)?;
    dict.set_item("pixel_memory_bytes", report.pixel_memory_bytes)?;
    Ok(dict)
}
