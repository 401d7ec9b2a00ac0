//! Geometry that knows nothing of scenes: orthonormal frames, rays, cones, warps.

use glam::Vec3A;

mod beckmann;
pub mod cone;
mod filter;
mod frame;
mod ggx;
mod mirror;
mod ray;
#[cfg(test)]
pub(crate) mod statistics;
pub mod warp;

pub use beckmann::Beckmann;
pub use filter::PixelFilter;
pub use frame::Frame;
pub use ggx::Ggx;
pub use mirror::reflecting_normal;
pub use ray::{MIDDLE_TIME, Ray, facing, offset_origin};

/// Rec. 709 luminance of a scene-linear colour.
pub fn luminance(color: Vec3A) -> f32 {
    color.dot(Vec3A::new(0.2126, 0.7152, 0.0722))
}
