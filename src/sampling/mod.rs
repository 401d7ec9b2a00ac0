//! Random numbers, and what they choose: directions of surfaces and of lights.

pub mod bsdf;
mod discrete;
pub mod lights;
mod sampler;
mod shutter;

pub use bsdf::{
    ALPHA_MIN, Brushed, Bsdf, BsdfSample, Gloss, Guides, Hair, LobePdfs, LobeValues, Part,
    Principled, alpha_of, pdf_scattered, sample_scattered,
};
pub use lights::{
    LightBall, LightClass, LightHit, LightSample, LightSampler, Receiver, Strategy,
    emitted_radiance,
};
pub use sampler::{CameraSample, LightUse, Sampler, ScatterUse, Walk};
pub use shutter::ShutterTimes;
