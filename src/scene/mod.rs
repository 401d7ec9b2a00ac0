//! What one frame shows. A [`SceneFrame`] that exists is valid and does not change; nothing below
//! checks again.

mod camera;
mod displacement;
mod facet;
mod frame;
mod grid;
mod light;
mod material;
mod mesh;
mod motion;
mod passes;
mod visibility;
mod window;
pub mod world;

pub use crate::image::{Encoding, Extension, Image, Interpolation, Lookup};
pub use camera::{Camera, CameraMotion, Lens, Panorama, Projection};
pub use facet::Facet;
pub use frame::{Instance, SceneFrame, Shutter, interpolate};
pub use grid::{Content, Grid};
pub use light::{Light, LightKind};
pub use material::{Displacement, Filling, Material, Medium};
pub use mesh::{Face, Mesh};
pub use motion::{Placement, Trajectory};
pub use passes::{Flow, ForPasses, Mattes, Mist, Moved};
pub use visibility::{Links, Membership, Reach, Visibility};
pub use window::{FrameWindow, Motion};
pub use world::World;
