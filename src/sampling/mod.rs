//! Random numbers, and what they choose: directions of surfaces and of lights.

pub mod bsdf;
mod sampler;

pub use bsdf::{Bsdf, BsdfSample, LobePdfs, LobeValues, Part, Principled};
pub use sampler::{CameraSample, LightUse, Sampler, ScatterUse};
