//! Voxels: values at the points of a grid in the space of an object, as simulations and OpenVDB keep
//! them.

use std::sync::Arc;

use glam::{Affine3A, Vec3A, Vec4};

use crate::contract::{Arrays, GRID, Given};
use crate::error::{Error, Result};

/// Values at the points of a grid.
#[derive(Debug)]
pub struct Grid {
    size: [usize; 3],
    /// How many numbers a point has: 1, 3 or 4.
    width: usize,
    /// Point by point; of its coordinates the last one counts fastest.
    values: Vec<f32>,
    index_from_object: Affine3A,
}

impl Grid {
    /// A grid from the arrays of [`GRID`]. Values that are no number become zero.
    ///
    /// # Errors
    /// An array that breaks the contract, a grid without points, a width that is none of 1, 3 and 4.
    pub fn new(given: Vec<Given>) -> Result<Self> {
        let arrays = Arrays::checked(GRID, given)?;
        let size = ["X", "Y", "Z"].map(|letter| arrays.length(letter));
        let width = arrays.length("N");
        let values = arrays.f32s("voxels");
        if values.is_empty() || ![1, 3, 4].contains(&width) {
            return Err(Error::Range {
                field: "voxels",
                value: format!("{size:?} x {width}"),
                range: "1 x 1 x 1 and more, of 1, 3 or 4 numbers each".into(),
            });
        }
        let finite = |&value: &f32| if value.is_finite() { value } else { 0.0 };
        let rows = arrays.f32s("index_from_object").as_chunks::<4>().0;
        let column = |c: usize| Vec3A::new(rows[0][c], rows[1][c], rows[2][c]);
        Ok(Self {
            size,
            width,
            values: values.iter().map(finite).collect(),
            index_from_object: Affine3A {
                matrix3: glam::Mat3A::from_cols(column(0), column(1), column(2)),
                translation: column(3),
            },
        })
    }

    /// The value at a point, object space: trilinear between the grid's points, and to zero within one
    /// step beyond them. A single number is a grey, as for programs' attributes.
    pub fn at(&self, position: Vec3A) -> Vec4 {
        let index = self.index_from_object.transform_point3a(position);
        let low = index.floor();
        let share = index - low;
        // Numbers beyond the range of integers are held at its ends, far outside the grid.
        let corner = low.to_array().map(|x| x as i64);
        let mut sum = Vec4::ZERO;
        for part in 0..8 {
            let step = [part >> 2, (part >> 1) & 1, part & 1];
            let mut weight = 1.0;
            for axis in 0..3 {
                weight *= match step[axis] {
                    0 => 1.0 - share[axis],
                    _ => share[axis],
                };
            }
            if weight > 0.0 {
                let at = [0, 1, 2].map(|axis| corner[axis].saturating_add(step[axis]));
                sum += weight * self.point(at);
            }
        }
        match self.width {
            // Colours are premultiplied, which is undone behind the filter, as in Cycles.
            4 if sum.w > 1e-6 => (sum / sum.w).with_w(sum.w),
            4 => sum,
            _ => sum.with_w(1.0),
        }
    }

    /// Zero beyond the grid.
    fn point(&self, at: [i64; 3]) -> Vec4 {
        let mut index = 0;
        for (&x, size) in at.iter().zip(self.size) {
            match usize::try_from(x) {
                Ok(x) if x < size => index = index * size + x,
                _ => return Vec4::ZERO,
            }
        }
        match self.values[index * self.width..][..self.width] {
            [x, y, z, w] => Vec4::new(x, y, z, w),
            [x, y, z] => Vec4::new(x, y, z, 1.0),
            _ => Vec4::splat(self.values[index]).with_w(1.0),
        }
    }

    /// Points along each of its axes.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.values[..])
    }
}

/// What a mesh encloses, beside what its material says.
#[derive(Debug, Clone, Default)]
pub struct Content {
    /// Grids, by the hash of their name.
    pub grids: Vec<(u32, Arc<Grid>)>,
    /// Lower corner and size of what Generated coordinates count from 0 to 1, object space [m]; that of
    /// the mesh where it is not given.
    pub texture_space: Option<[Vec3A; 2]>,
    /// Whether it gets thinner as the object is scaled up, so that its optical depth stays what it was.
    pub is_scaled: bool,
}

impl Content {
    /// Whether there is a grid of this name.
    pub fn has(&self, key: u32) -> bool {
        self.grids.iter().any(|(known, _)| *known == key)
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.grids.iter().map(|(_, grid)| grid.memory_bytes()).sum()
    }
}

#[cfg(test)]
impl Grid {
    /// A grid of one number at each point.
    pub(crate) fn of(size: [usize; 3], values: Vec<f32>, index_from_object: Affine3A) -> Self {
        Self {
            size,
            width: 1,
            values,
            index_from_object,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A linear function is its own trilinear interpolation, and a grid ends one step beyond its points.
    #[test]
    fn between_the_points_values_are_linear_and_zero_beyond() {
        let size = [3, 4, 5];
        let value = |x: f32, y: f32, z: f32| 1.0 + x + 10.0 * y + 100.0 * z;
        let mut values = vec![];
        for x in 0..size[0] {
            for y in 0..size[1] {
                values.extend((0..size[2]).map(|z| value(x as f32, y as f32, z as f32)));
            }
        }
        // Points half a metre apart, the first one at (1, 0, 0).
        let place = Affine3A::from_scale(Vec3::splat(2.0)) * Affine3A::from_translation(-Vec3::X);
        let grid = Grid::of(size, values, place);
        let at = |x: f32, y: f32, z: f32| {
            let found = grid.at(Vec3A::new(1.0 + 0.5 * x, 0.5 * y, 0.5 * z));
            assert_eq!(found, Vec4::splat(found.x).with_w(found.w));
            found.x
        };
        for (x, y, z) in [(0.0, 0.0, 0.0), (1.25, 2.5, 3.75), (2.0, 3.0, 4.0)] {
            assert!((at(x, y, z) - value(x, y, z)).abs() < 1e-3);
        }
        assert!((at(-0.5, 1.0, 1.0) - 0.5 * value(0.0, 1.0, 1.0)).abs() < 1e-3);
        for (x, y, z) in [(-1.0, 1.0, 1.0), (1.0, 4.0, 1.0), (1e30, 0.0, 0.0)] {
            assert_eq!(at(x, y, z), 0.0);
        }
    }
}
