//! What a frame tells for passes alone.

use glam::{Affine3A, Vec3, Vec3A};

use super::Camera;

/// What nothing but passes reads.
#[derive(Debug, Clone, Default)]
pub struct ForPasses {
    /// The world's mist.
    pub mist: Mist,
    /// How far away what is near may be [m].
    pub ambient_distance: f32,
    /// Opacity of the surfaces that passes of what is seen show; they look through others.
    pub alpha_threshold: f32,
    /// Where things are in the frames around, if a pass asks for it.
    pub flow: Option<Flow>,
    /// Cryptomatte's names of things, if a pass asks for them.
    pub mattes: Mattes,
}

/// Numbers that name things.
#[derive(Debug, Clone, Default)]
pub struct Mattes {
    /// Of the object and of the asset of each instance.
    pub instances: Vec<[f32; 2]>,
    /// Of each material.
    pub materials: Vec<f32>,
}

/// The world's mist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mist {
    /// Distance from the camera at which it begins [m].
    pub start: f32,
    /// Distance from there to where nothing else is seen [m].
    pub depth: f32,
    /// Power of the share of that distance.
    pub exponent: f32,
}

impl Default for Mist {
    /// Without a world, as in Cycles.
    fn default() -> Self {
        Self {
            start: 0.0,
            depth: 100.0,
            exponent: 1.0,
        }
    }
}

impl Mist {
    /// How much of what is this far away [m] the mist hides.
    pub fn at(&self, distance: f32) -> f32 {
        let share = (distance - self.start) / self.depth;
        // A mist without depth is a wall.
        let share = if share.is_nan() { 1.0 } else { share };
        share.clamp(0.0, 1.0).powf(self.exponent)
    }
}

/// Where things are in the frames before (0) and after (1).
#[derive(Debug, Clone)]
pub struct Flow {
    /// The cameras.
    pub cameras: [Camera; 2],
    /// Each instance that is elsewhere, or has another form.
    pub moved: Vec<Option<Moved>>,
    /// Vertices of the other forms, object space.
    pub vertices: [Vec<Vec3>; 2],
}

/// An instance in the frames before and after.
#[derive(Debug, Clone, Copy)]
pub struct Moved {
    /// Its placements.
    pub placements: [Affine3A; 2],
    /// Where in [`Flow::vertices`] those of its mesh begin, if they are others.
    pub first_vertex: Option<usize>,
}

impl Flow {
    /// The corners of a triangle of an instance in the frame before or after, object space; `None`
    /// where they are those of the frame itself.
    pub fn corners(&self, side: usize, moved: &Moved, corners: [u32; 3]) -> Option<[Vec3A; 3]> {
        let first = moved.first_vertex?;
        Some(corners.map(|vertex| self.vertices[side][first + vertex as usize].into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mist_grows_from_its_start_over_its_depth() {
        let mist = Mist {
            start: 2.0,
            depth: 4.0,
            exponent: 2.0,
        };
        let found = [0.0, 2.0, 4.0, 6.0, 9.0].map(|distance| mist.at(distance));
        assert_eq!(found, [0.0, 0.0, 0.25, 1.0, 1.0]);
        let wall = Mist { depth: 0.0, ..mist };
        assert_eq!([1.0, 2.0, 3.0].map(|d| wall.at(d)), [0.0, 1.0, 1.0]);
    }
}
