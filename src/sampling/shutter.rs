//! When a path meets the scene.

use super::Sampler;
use super::discrete::Discrete;
use crate::math::MIDDLE_TIME;
use crate::scene::SceneFrame;

/// The times that a frame's camera rays are drawn from: as much of each as the shutter lets light in.
#[derive(Debug, Clone)]
pub enum ShutterTimes {
    /// The frame's own time: nothing moves.
    Middle,
    /// All alike.
    Even,
    /// Equal parts of the shutter's time with different shares of the light.
    Curve(Discrete),
}

impl ShutterTimes {
    /// The times of a frame.
    pub fn of(frame: &SceneFrame) -> Self {
        if !frame.is_moving() {
            return Self::Middle;
        }
        let curve = &frame.shutter.curve;
        Discrete::new(curve.iter().map(|&share| share.max(0.0))).map_or(Self::Even, Self::Curve)
    }

    /// The time of a path: a share of the shutter's time.
    pub fn time(&self, sampler: &Sampler) -> f32 {
        match self {
            Self::Middle => MIDDLE_TIME,
            Self::Even => sampler.time(),
            Self::Curve(curve) => {
                let (part, _, rest) = curve.sample(sampler.time());
                (part as f32 + rest) / curve.len() as f32
            }
        }
    }
}
