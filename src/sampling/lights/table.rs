//! A grid over the sphere of directions: rows of equal polar angle, columns of equal azimuth, as in
//! an equirectangular image; and drawing its cells by their light.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3A};

use crate::sampling::discrete::{Discrete, step};
use crate::scene::world::uv_of_direction;

/// Shape of a grid. Row 0 is at the bottom, around -Z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grid {
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Grid {
    /// The grid in which blocks of `side` x `side` cells, or what is left of them, are one.
    pub(super) fn coarser(&self, side: usize) -> Self {
        Self {
            width: (self.width / side).max(1),
            height: (self.height / side).max(1),
        }
    }

    /// The grid in which each cell is divided into `side` x `side`.
    pub(super) fn finer(&self, side: usize) -> Self {
        Self {
            width: self.width * side,
            height: self.height * side,
        }
    }

    /// The cell of the coarser grid, of `division` x `division` cells each, that holds this one.
    pub(super) fn parent(&self, cell: usize, division: usize) -> usize {
        let (row, column) = (cell / self.width, cell % self.width);
        row / division * (self.width / division) + column / division
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
        self.direction_between([self.edge(row), self.edge(row + 1)], column, u)
    }

    fn direction_between(&self, [low, high]: [f32; 2], column: usize, u: [f32; 2]) -> Vec3A {
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
    /// z of the edges between rows.
    edges: Vec<f32>,
    rows: Discrete,
    /// A cumulative distribution of `width + 1` steps for each row.
    columns: Vec<f32>,
    /// Where to look in each row's distribution.
    guides: Vec<u32>,
    /// Density [1/sr] of each cell's directions: exactly what the distributions draw.
    densities: Vec<f32>,
}

impl CellTable {
    /// A table of these weights, one for each cell; `None` if all are zero.
    pub(super) fn new(grid: Grid, weights: &[f32]) -> Option<Self> {
        let rows = Discrete::new(weights.chunks(grid.width).map(|row| row.iter().sum()))?;
        let stride = grid.width + 1;
        let mut columns = Vec::with_capacity(stride * grid.height);
        let mut guides = Vec::with_capacity(grid.cells());
        let mut densities = Vec::with_capacity(grid.cells());
        for (row, weights) in weights.chunks(grid.width).enumerate() {
            match Discrete::new(weights.iter().copied()) {
                Some(discrete) => {
                    columns.extend_from_slice(discrete.cumulative());
                    guides.extend_from_slice(discrete.guide());
                }
                None => {
                    columns.resize(columns.len() + stride, 0.0);
                    guides.resize(guides.len() + grid.width, 0);
                }
            }
            let scale = rows.pmf(row) / grid.solid_angle(row);
            let steps = columns[row * stride..].windows(2);
            densities.extend(steps.map(|step| scale * (step[1] - step[0])));
        }
        Some(Self {
            edges: (0..=grid.height).map(|row| grid.edge(row)).collect(),
            grid,
            rows,
            columns,
            guides,
            densities,
        })
    }

    pub(super) fn grid(&self) -> Grid {
        self.grid
    }

    /// Probability of a cell.
    pub(super) fn probability(&self, cell: usize) -> f32 {
        self.densities[cell] * self.grid.solid_angle(cell / self.grid.width)
    }

    /// A direction and its density [1/sr].
    pub(super) fn sample(&self, u: [f32; 2]) -> (Vec3A, f32) {
        let (row, _, v) = self.rows.sample(u[1]);
        let stride = self.grid.width + 1;
        let cumulative = &self.columns[row * stride..(row + 1) * stride];
        let guide = &self.guides[row * self.grid.width..(row + 1) * self.grid.width];
        let (column, _, u) = step(cumulative, guide, u[0]);
        let edges = [self.edges[row], self.edges[row + 1]];
        let direction = self.grid.direction_between(edges, column, [u, v]);
        (direction, self.densities[row * self.grid.width + column])
    }

    /// Density [1/sr] of a direction.
    pub(super) fn pdf(&self, direction: Vec3A) -> f32 {
        self.densities[self.grid.cell(direction)]
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
