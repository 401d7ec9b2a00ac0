//! DualCone: a path tracer for animations that shares gather samples between pixels and frames.
//!
//! After Zhou and Chen, "Variance reduction using interframe coherence for animated scenes"
//! (Computational Visual Media 1(4), 2015), with the departures listed in `docs/method.md`.
//!
//! # Conventions
//! - World space is Blender's: right-handed, Z up, metres. A camera looks along its own -Z.
//! - Matrices are named `to_from`: `point_world = world_from_object * point_object`.
//! - Colour is scene-linear RGB (Rec. 709 primaries); radiance is in W / (sr m^2).
//! - `pdf_solid_angle` is per steradian, `pdf_area` per square metre, `pmf` dimensionless.
//! - Directions point away from the surface and have unit length unless a name says otherwise.
//! - Every number is a function of (scene, settings, frame, pixel, iteration): threads, chunks and
//!   frame ranges change no bit.
//!
//! Modules are listed in the order in which data meets them; each imports only from those above it.

pub mod error;
pub mod contract;
pub mod math;
pub mod optics;
#[allow(unsafe_code)]
pub mod kernel;
pub mod image;
pub mod shader;
pub mod scene;
pub mod film;
pub mod accel;
pub mod sampling;
pub mod record;
pub mod progress;
pub mod media;
pub mod subsurface;
pub mod surface;
pub mod neighbourhood;
pub mod path;
pub mod passes;
pub mod reuse;
pub mod render;
#[cfg(feature = "python")]
mod python;
#[cfg(test)]
mod testing;
