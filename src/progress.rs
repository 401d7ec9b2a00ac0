//! The only thing that flows back while a render runs: counters, and the wish to stop.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Shared between a render and whoever watches it.
#[derive(Debug, Default)]
pub struct Progress {
    cancelled: AtomicBool,
    iterations_done: AtomicU32,
    iterations_total: AtomicU32,
    phase: AtomicU32,
    rays: AtomicU64,
    memory_bytes: AtomicU64,
    preview: Mutex<Preview>,
}

/// The picture so far of one frame, made when somebody wants it.
#[derive(Debug, Default)]
struct Preview {
    wanted: Option<i32>,
    made: Option<(i32, Vec<f32>)>,
}

/// What a render is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Phase {
    /// Building trees and light tables.
    Build,
    /// Tracing.
    Sample,
    /// Making passes.
    Resolve,
    /// Finished, one way or another.
    Done,
}

impl Phase {
    /// Its word at the boundary.
    pub fn name(self) -> &'static str {
        match self {
            Phase::Build => "build",
            Phase::Sample => "sample",
            Phase::Resolve => "resolve",
            Phase::Done => "done",
        }
    }
}

impl Progress {
    /// Asks the render to stop; it does so within a row of pixels.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the render shall stop.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Says what the render does now.
    pub fn enter(&self, phase: Phase) {
        self.phase.store(phase as u32, Ordering::Relaxed);
    }

    /// What the render does.
    pub fn phase(&self) -> Phase {
        match self.phase.load(Ordering::Relaxed) {
            0 => Phase::Build,
            1 => Phase::Sample,
            2 => Phase::Resolve,
            _ => Phase::Done,
        }
    }

    /// Sets how many iterations there are.
    pub fn expect_iterations(&self, total: u32) {
        self.iterations_total.store(total, Ordering::Relaxed);
    }

    /// Counts one iteration.
    pub fn count_iteration(&self) {
        self.iterations_done.fetch_add(1, Ordering::Relaxed);
    }

    /// Iterations done, and in all.
    pub fn iterations(&self) -> (u32, u32) {
        let done = self.iterations_done.load(Ordering::Relaxed);
        (done, self.iterations_total.load(Ordering::Relaxed))
    }

    /// Counts rays.
    pub fn count_rays(&self, rays: u64) {
        self.rays.fetch_add(rays, Ordering::Relaxed);
    }

    /// Rays so far.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Says how much memory the render holds.
    pub fn set_memory_bytes(&self, bytes: usize) {
        self.memory_bytes.store(bytes as u64, Ordering::Relaxed);
    }

    /// Memory that the render holds.
    pub fn memory_bytes(&self) -> u64 {
        self.memory_bytes.load(Ordering::Relaxed)
    }

    /// The latest picture of a frame, red, green, blue and alpha of each pixel; a newer one is made
    /// after the iteration that runs now.
    pub fn preview(&self, frame: i32) -> Option<Vec<f32>> {
        let mut preview = self.preview.lock().unwrap_or_else(PoisonError::into_inner);
        preview.wanted = Some(frame);
        preview
            .made
            .take_if(|made| made.0 == frame)
            .map(|made| made.1)
    }

    /// The frame whose picture somebody wants.
    pub fn wanted_preview(&self) -> Option<i32> {
        let preview = self.preview.lock().unwrap_or_else(PoisonError::into_inner);
        preview.wanted
    }

    /// Hands over the picture so far of a frame.
    pub fn show_preview(&self, frame: i32, combined: Vec<f32>) {
        let mut preview = self.preview.lock().unwrap_or_else(PoisonError::into_inner);
        *preview = Preview {
            wanted: None,
            made: Some((frame, combined)),
        };
    }
}
