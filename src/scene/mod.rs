//! What one frame shows. A [`SceneFrame`] that exists is valid and does not change; nothing below
//! checks again.

mod camera;
mod frame;
mod image;
mod light;
mod material;
mod mesh;
mod window;
pub mod world;

pub use camera::{Camera, Lens, Panorama, Projection};
pub use frame::{Instance, SceneFrame, interpolate};
pub use image::{Extension, Image, Interpolation};
pub use light::{Light, LightKind};
pub use material::{Closure, ClosureKind, Material};
pub use mesh::Mesh;
pub use window::{FrameWindow, Motion};
pub use world::World;
