//! Lamps. Surfaces that glow are meshes, the world is in `world`.

use glam::{Affine3A, Vec3A};

use super::Reach;

/// The shape of a lamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Parallel light from a disk in the sky.
    Sun {
        /// Angular diameter [rad].
        angle: f32,
    },
    /// A sphere.
    Point {
        /// Radius [m].
        radius: f32,
        /// Blender's Soft Falloff.
        soft_falloff: bool,
    },
    /// A sphere that shines into a cone.
    Spot {
        /// Radius [m].
        radius: f32,
        /// Blender's Soft Falloff.
        soft_falloff: bool,
        /// Full angle of the cone [rad].
        cone_angle: f32,
        /// Share of the cone over which the light fades.
        blend: f32,
    },
    /// A rectangle that shines to one side.
    AreaRectangle {
        /// Side lengths along x and y [m].
        size: [f32; 2],
        /// Full angle [rad] of the cone that each point shines into; pi does not narrow it.
        spread: f32,
    },
    /// An ellipse that shines to one side.
    AreaEllipse {
        /// Diameters along x and y [m].
        size: [f32; 2],
        /// As of a rectangle.
        spread: f32,
    },
}

/// A lamp of the scene.
#[derive(Debug, Clone, Copy)]
pub struct Light {
    /// Shape.
    pub kind: LightKind,
    /// Names the same light in every frame.
    pub key: u64,
    /// Placement without scale; it shines along its own -Z.
    pub world_from_light: Affine3A,
    /// Scale of its axes: of a spot's cone, and of what nodes read. Sizes have it already.
    pub scale: Vec3A,
    /// Power [W] by colour; irradiance [W / m^2] for a sun.
    pub power: Vec3A,
    /// Index of the material whose emission is a factor on its light.
    pub material: Option<u32>,
    /// Which rays find it; without shadow rays nothing stops its light.
    pub reach: Reach,
}
