//! A grid over the sphere of directions: rows of equal polar angle, columns of equal azimuth, as in
//! an equirectangular image; and drawing its cells by their light.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3A};

use crate::sampling::discrete::{Discrete, step};
use crate::scene::Image;
use crate::scene::world::uv_of_direction;

/// Widest grid: finer images are averaged down to it. At 4096 columns a cell is a fifth of the
/// sun's disk, and a grid takes 33 MB.
const WIDTH_MAX: usize = 4096;

/// Shape of a grid. Row 0 is at the bottom, around -Z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grid {
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Grid {
    /// The grid for an image, and how many texels make a cell's side.
    pub(super) fn for_image(image: &Image) -> (Self, usize) {
        let (width, height) = image.size();
        let side = width.div_ceil(WIDTH_MAX).min(height).max(1);
        let grid = Self {
            width: width / side,
            height: height / side,
        };
        (grid, side)
    }

    pub(super) fn cells(&self) -> usize {
        self.width * self.height
    }

    /// Cell of a unit direction.
    pub(super) fn cell(&self, direction: Vec3A) -> usize {
        let uv = uv_of_direction(direction);
        let column = ((uv.x * self.width as f32) as usize).min(self.width - 1);
        let row = ((uv.y * self.height as f32) as usize).min(self.height - 1);
        row * self.width + column
    }

    /// z of the lower edge of a row.
    fn edge(&self, row: usize) -> f32 {
        -(PI * row as f32 / self.height as f32).cos()
    }

    /// Solid angle of a cell of a row [sr].
    pub(super) fn solid_angle(&self, row: usize) -> f32 {
        // cos a - cos b as a product: near the poles the cosines are alike.
        let (middle, half) = (row as f32 + 0.5, 0.5);
        let scale = PI / self.height as f32;
        2.0 * (middle * scale).sin() * (half * scale).sin() * TAU / self.width as f32
    }

    /// A direction in a cell, uniform in solid angle.
    pub(super) fn direction(&self, cell: usize, u: [f32; 2]) -> Vec3A {
        let (row, column) = (cell / self.width, cell % self.width);
        let (low, high) = (self.edge(row), self.edge(row + 1));
        let z = low + u[1] * (high - low);
        let azimuth = (0.5 - (column as f32 + u[0]) / self.width as f32) * TAU;
        let ring = Vec2::from_angle(azimuth) * (1.0 - z * z).max(0.0).sqrt();
        Vec3A::new(ring.x, ring.y, z)
    }
}

/// Draws cells of a grid by weight, row first.
#[derive(Debug)]
pub(super) struct CellTable {
    grid: Grid,
    rows: Discrete,
    /// A cumulative distribution of `width + 1` steps for each row.
    columns: Vec<f32>,
}

impl CellTable {
    /// A table of these weights, one for each cell; `None` if all are zero.
    pub(super) fn new(grid: Grid, weights: &[f32]) -> Option<Self> {
        let rows = weights.chunks(grid.width);
        let sums = rows.clone().map(|row| row.iter().sum());
        let zeros = vec![0.0; grid.width + 1];
        Some(Self {
            grid,
            rows: Discrete::new(sums)?,
            columns: rows
                .flat_map(|row| match Discrete::new(row.iter().copied()) {
                    Some(columns) => columns.cumulative().to_vec(),
                    None => zeros.clone(),
                })
                .collect(),
        })
    }

    fn columns(&self, row: usize) -> &[f32] {
        let stride = self.grid.width + 1;
        &self.columns[row * stride..(row + 1) * stride]
    }

    /// A direction and its density [1/sr].
    pub(super) fn sample(&self, u: [f32; 2]) -> (Vec3A, f32) {
        let (row, row_pmf, v) = self.rows.sample(u[1]);
        let (column, column_pmf, u) = step(self.columns(row), u[0]);
        let direction = self.grid.direction(row * self.grid.width + column, [u, v]);
        (direction, row_pmf * column_pmf / self.grid.solid_angle(row))
    }

    /// Density [1/sr] of a direction.
    pub(super) fn pdf(&self, direction: Vec3A) -> f32 {
        let cell = self.grid.cell(direction);
        let (row, column) = (cell / self.grid.width, cell % self.grid.width);
        let columns = self.columns(row);
        let pmf = self.rows.pmf(row) * (columns[column + 1] - columns[column]);
        pmf / self.grid.solid_angle(row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_tile_the_sphere() {
        let grid = Grid {
            width: 64,
            height: 32,
        };
        let total: f32 = (0..32).map(|row| 64.0 * grid.solid_angle(row)).sum();
        assert!((total / (2.0 * TAU) - 1.0).abs() < 1e-5);
        for cell in 0..grid.cells() {
            for u in [[0.01, 0.01], [0.5, 0.5], [0.99, 0.99]] {
                assert_eq!(grid.cell(grid.direction(cell, u)), cell);
            }
        }
    }
}
