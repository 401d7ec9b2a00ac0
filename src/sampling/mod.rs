//! Random numbers, and what they choose: directions of surfaces and of lights.

mod sampler;

pub use sampler::{CameraSample, LightUse, Sampler, ScatterUse};
