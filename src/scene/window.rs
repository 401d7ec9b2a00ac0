//! Frames that are rendered together, and how things move between them.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Affine3A;

use super::{Instance, SceneFrame};
use crate::error::{Error, Result};

/// Frames that share samples, in ascending order, with one name for each thing that they show.
pub struct FrameWindow {
    frames: Vec<Arc<SceneFrame>>,
    /// Per frame and instance: the object's number throughout the window.
    objects: Vec<Vec<u32>>,
    /// Per frame and object: its instance, where the frame shows it.
    instances: Vec<Vec<Option<u32>>>,
}

/// What carries an object's points from one frame to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Nothing: it stays where it is.
    Still,
    /// This matrix, world space.
    Rigid(Affine3A),
    /// One of the frames does not show it.
    Absent,
}

/// Relative difference of two placements below which an object counts as still. Blender evaluates
/// constraints in single precision, so that a still object can differ in the last bits.
const STILL: f32 = 1e-6;

impl FrameWindow {
    /// A window over `frames`.
    ///
    /// # Errors
    /// No frames, or frames that are not in ascending order.
    pub fn new(frames: Vec<Arc<SceneFrame>>) -> Result<Self> {
        if frames.is_empty() {
            return Err(Error::Missing { field: "frames" });
        }
        if let Some(pair) = frames.windows(2).find(|p| p[0].frame >= p[1].frame) {
            return Err(Error::Frame {
                frame: pair[1].frame,
                reason: "frames must be in ascending order".into(),
            });
        }
        let mut numbers = HashMap::new();
        let mut objects = Vec::new();
        for frame in &frames {
            let mut seen: HashMap<u64, u64> = HashMap::new();
            let numbered = frame.instances.iter().map(|instance| {
                // Two things of one key in one frame are told apart by their order.
                let copy = seen
                    .entry(instance.key)
                    .and_modify(|n| *n += 1)
                    .or_insert(0);
                let next = numbers.len() as u32;
                *numbers.entry((instance.key, *copy)).or_insert(next)
            });
            objects.push(numbered.collect::<Vec<u32>>());
        }
        let instances = frames
            .iter()
            .zip(&objects)
            .map(|(frame, objects)| {
                let mut instances = vec![None; numbers.len()];
                for (instance, &object) in (0..frame.instances.len() as u32).zip(objects) {
                    instances[object as usize] = Some(instance);
                }
                instances
            })
            .collect();
        Ok(Self {
            frames,
            objects,
            instances,
        })
    }

    /// The frames.
    pub fn frames(&self) -> &[Arc<SceneFrame>] {
        &self.frames
    }

    /// The position of a frame number among the frames.
    pub fn position(&self, frame: i32) -> Option<usize> {
        self.frames.iter().position(|f| f.frame == frame)
    }

    /// The number, throughout the window, of what an instance of a frame shows.
    pub fn object(&self, frame: usize, instance: u32) -> u32 {
        self.objects[frame][instance as usize]
    }

    /// Per object, what carries its points from frame `from` to frame `to`. It depends on these two
    /// frames alone, so that the other frames of a window change no pixel.
    pub fn motions(&self, from: usize, to: usize) -> Vec<Motion> {
        let pairs = self.instances[from].iter().zip(&self.instances[to]);
        pairs
            .map(|pair| match pair {
                (Some(a), Some(b)) => {
                    let source = &self.frames[from].instances[*a as usize];
                    motion(source, &self.frames[to].instances[*b as usize])
                }
                _ => Motion::Absent,
            })
            .collect()
    }
}

fn motion(source: &Instance, target: &Instance) -> Motion {
    let (source, target) = (&source.placement, &target.placement);
    let size = source.world_from_object.translation.abs().max_element();
    let tolerance = STILL * size.max(1.0);
    let (a, b) = (source.world_from_object, target.world_from_object);
    if a.abs_diff_eq(b, tolerance) {
        Motion::Still
    } else {
        Motion::Rigid(b * source.object_from_world)
    }
}
