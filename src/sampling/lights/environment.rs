//! The surroundings as a light: their sky, and apart from it their sun.
//!
//! An image's sun is a compact region that is far brighter than the rest. It becomes a light of its
//! own, so that a point in its shadow does not waste its samples on it, and so that light that
//! must not be borrowed (method, section 3) can be told from light that may.

mod sun_table;

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Mat3A, Vec3A};

use super::table::{CellTable, Grid};
use super::{Emitter, LightClass, LightSample, Receiver};
use crate::math::luminance;
use crate::scene::{Image, Reach, World};
use sun_table::SunTable;

/// Columns of the sky's grid at most: its tables stay in the fastest caches, and a finer grid lowers
/// the noise hardly further once the sun is apart.
const SKY_WIDTH: usize = 128;
/// Columns of the grid in which the sun is sought: a fifth of its disk for each cell.
const SUN_WIDTH: usize = 4096;
/// What an image says about where light comes from; made once and shared by frames.
#[derive(Debug)]
pub(super) struct ImageTables {
    image: Arc<Image>,
    sky: Option<CellTable>,
    sun: Option<SunTable>,
    /// Mean luminance of the sky over the sphere.
    sky_mean: f32,
}

impl ImageTables {
    pub(super) fn new(image: &Arc<Image>) -> Self {
        let (width, height) = image.size();
        let texels = Grid { width, height };
        let sky_grid = texels.coarser(width.div_ceil(SKY_WIDTH));
        // The sun's cells divide those of the sky, so that the two share the sphere exactly.
        let division = (width.min(SUN_WIDTH) / sky_grid.width).min(height / sky_grid.height);
        let fine = Cells::of_image(image, sky_grid.finer(division));
        let sun = SunTable::find(image, &fine, division);
        let mut sky = vec![0.0; sky_grid.cells()];
        for (cell, energy) in fine.energies.iter().enumerate() {
            sky[fine.grid.parent(cell, division)] += energy;
        }
        for &cell in sun.iter().flat_map(SunTable::sky_cells) {
            sky[cell] = 0.0;
        }
        let sky_energy: f64 = sky.iter().copied().map(f64::from).sum();
        Self {
            image: image.clone(),
            sky: CellTable::new(sky_grid, &sky),
            sun,
            sky_mean: sky_energy as f32 / (4.0 * PI),
        }
    }
}

/// An image's light, cell by cell.
struct Cells {
    grid: Grid,
    luminances: Vec<f32>,
    /// Luminance times solid angle.
    energies: Vec<f32>,
}

impl Cells {
    /// Means over the cells of the bilinearly filtered image.
    ///
    /// The mean over a texel of a bilinear blend weighs the texel and its neighbours 6 : 1 : 1
    /// along each axis, so that no lit direction lies in a cell without weight.
    fn of_image(image: &Image, grid: Grid) -> Self {
        let (width, height) = image.size();
        let texel = |x, y| luminance(Vec3A::from_vec4(image.texel(x, y)).max(Vec3A::ZERO));
        let across = |x: usize, y: usize| {
            let (left, right) = ((x + width - 1) % width, (x + 1) % width);
            (texel(left, y) + 6.0 * texel(x, y) + texel(right, y)) / 8.0
        };
        let mut luminances = vec![0.0; grid.cells()];
        let mut texels = vec![0u32; grid.cells()];
        for y in 0..height {
            let (below, above) = (y.saturating_sub(1), (y + 1).min(height - 1));
            let row = y * grid.height / height * grid.width;
            for x in 0..width {
                let mean = (across(x, below) + 6.0 * across(x, y) + across(x, above)) / 8.0;
                let cell = row + x * grid.width / width;
                luminances[cell] += mean;
                texels[cell] += 1;
            }
        }
        for (luminance, &texels) in luminances.iter_mut().zip(&texels) {
            *luminance /= texels as f32;
        }
        let solid_angles = (0..grid.cells()).map(|cell| grid.solid_angle(cell / grid.width));
        Self {
            energies: luminances
                .iter()
                .zip(solid_angles)
                .map(|(l, s)| l * s)
                .collect(),
            grid,
            luminances,
        }
    }
}

/// Directions of the world and of the image, and how densities change between them.
#[derive(Debug, Clone, Copy)]
struct Mapping {
    environment_from_world: Mat3A,
    world_from_environment: Mat3A,
    determinant: f32,
}

impl Mapping {
    /// `None` for a mapping without inverse: its image covers the sky in no countable way.
    fn new(environment_from_world: Mat3A) -> Option<Self> {
        let determinant = environment_from_world.determinant().abs();
        let world_from_environment = environment_from_world.inverse();
        (determinant > 0.0 && world_from_environment.is_finite()).then_some(Self {
            environment_from_world,
            world_from_environment,
            determinant,
        })
    }

    fn world(&self, direction: Vec3A) -> Vec3A {
        (self.world_from_environment * direction).normalize_or(Vec3A::Z)
    }

    /// The image's direction, and its solid angle per solid angle of the world (1 if it only
    /// turns).
    fn environment(&self, direction: Vec3A) -> (Vec3A, f32) {
        let mapped = self.environment_from_world * direction;
        let length = mapped.length();
        (
            mapped / length,
            self.determinant / (length * length * length),
        )
    }
}

/// The surroundings without their sun.
#[derive(Debug)]
pub(super) struct Sky {
    mean: f32,
    tables: Arc<ImageTables>,
    mapping: Mapping,
}

/// The parts of a sky that are small for their share of its light, as a light of their own.
#[derive(Debug)]
pub(super) struct SmallSky {
    table: CellTable,
    mapping: Mapping,
}

impl SmallSky {
    /// The cells of the sky's grid in which `is_small` holds somewhere; `None` where it does nowhere.
    fn new(sky: &CellTable, mapping: Mapping, is_small: impl Fn(Vec3A) -> bool) -> Option<Self> {
        /// Directions that are asked for along each side of a cell.
        const STEPS: usize = 4;
        let grid = sky.grid();
        let holds_small = |cell: usize| {
            (0..STEPS * STEPS).any(|i| {
                let u = [i % STEPS, i / STEPS].map(|k| (k as f32 + 0.5) / STEPS as f32);
                is_small(mapping.world(grid.direction(cell, u)))
            })
        };
        let weights: Vec<f32> = (0..grid.cells())
            .map(|cell| match sky.probability(cell) {
                weight if weight > 0.0 && holds_small(cell) => weight,
                _ => 0.0,
            })
            .collect();
        Some(Self {
            table: CellTable::new(grid, &weights)?,
            mapping,
        })
    }

    pub(super) fn sample(&self, u: [f32; 2]) -> Option<LightSample> {
        let (direction, pdf) = self.table.sample(u);
        let direction = self.mapping.world(direction);
        let pdf = pdf * self.mapping.environment(direction).1;
        distant(direction, pdf, LightClass::Sky)
    }

    /// Density [1/sr] of a direction; zero for one that is not of these parts.
    pub(super) fn pdf(&self, direction: Vec3A) -> f32 {
        let (direction, stretch) = self.mapping.environment(direction);
        stretch * self.table.pdf(direction)
    }
}

impl Sky {
    /// Its parts where `is_small` holds (world space).
    pub(super) fn small_parts(&self, is_small: impl Fn(Vec3A) -> bool) -> Option<SmallSky> {
        SmallSky::new(self.tables.sky.as_ref()?, self.mapping, is_small)
    }
}

/// The sun of an image.
#[derive(Debug)]
pub(super) struct ImageSun {
    tables: Arc<ImageTables>,
    mapping: Mapping,
    direction: Vec3A,
    irradiance: f32,
}

/// The world's lights: its sky and its sun, where they shine. Tables are taken over from `previous`
/// while the image stays the same.
///
/// A plain sky is no light, as in Cycles: scattered rays find it as well as light samples could, which
/// would cost a shadow ray at each vertex, or take the place of those of a lamp.
pub(super) fn lights_of(
    world: &World,
    previous: Option<&Arc<ImageTables>>,
) -> (Option<Sky>, Option<ImageSun>, Option<Arc<ImageTables>>) {
    let factor = luminance(world.radiance.max(Vec3A::ZERO));
    if !(factor > 0.0) {
        return (None, None, None);
    }
    let mapped = Mapping::new(world.environment_from_world).zip(world.image.as_ref());
    let Some((mapping, image)) = mapped else {
        return (None, None, None);
    };
    let same = previous.filter(|tables| Arc::ptr_eq(&tables.image, image));
    let tables = same.map_or_else(|| Arc::new(ImageTables::new(image)), Arc::clone);
    let sky = tables.sky.is_some().then(|| Sky {
        mean: factor * tables.sky_mean,
        tables: tables.clone(),
        mapping,
    });
    let sun = tables.sun.as_ref().map(|sun| ImageSun {
        tables: tables.clone(),
        mapping,
        direction: mapping.world(sun.direction),
        irradiance: factor * sun.irradiance,
    });
    (sky, sun, Some(tables))
}

fn distant(direction: Vec3A, pdf: f32, class: LightClass) -> Option<LightSample> {
    (pdf > 0.0 && pdf.is_finite()).then_some(LightSample {
        direction,
        distance: f32::INFINITY,
        end: None,
        radiance: None,
        pdf_solid_angle: pdf,
        is_delta: false,
        class,
        reach: Reach::ALL,
    })
}

impl Emitter for Sky {
    fn irradiance(&self, _: &Receiver) -> f32 {
        PI * self.mean
    }

    fn sample(&self, _: &Receiver, _: f32, u: [f32; 2]) -> Option<LightSample> {
        let (direction, pdf) = self.tables.sky.as_ref()?.sample(u);
        let direction = self.mapping.world(direction);
        let pdf = pdf * self.mapping.environment(direction).1;
        distant(direction, pdf, LightClass::Sky)
    }

    fn pdf_of_direction(&self, _: &Receiver, direction: Vec3A) -> f32 {
        let (direction, stretch) = self.mapping.environment(direction);
        let sky = self.tables.sky.as_ref();
        sky.map_or(0.0, |sky| stretch * sky.pdf(direction))
    }
}

impl Emitter for ImageSun {
    fn irradiance(&self, receiver: &Receiver) -> f32 {
        /// Sine of the largest sun's half angle.
        const SIN_HALF_ANGLE: f32 = 0.06;
        let cos = receiver.normal.dot(self.direction);
        self.irradiance * (cos + SIN_HALF_ANGLE).clamp(0.0, 1.0)
    }

    fn sample(&self, _: &Receiver, u_choice: f32, u: [f32; 2]) -> Option<LightSample> {
        let (direction, pdf) = self.tables.sun.as_ref()?.sample(u_choice, u)?;
        let direction = self.mapping.world(direction);
        let pdf = pdf * self.mapping.environment(direction).1;
        distant(direction, pdf, LightClass::Sun)
    }

    fn is_sun(&self, direction: Vec3A) -> bool {
        let (direction, _) = self.mapping.environment(direction);
        let sun = self.tables.sun.as_ref();
        sun.is_some_and(|sun| sun.pdf(direction) > 0.0)
    }

    fn pdf_of_direction(&self, _: &Receiver, direction: Vec3A) -> f32 {
        let (direction, stretch) = self.mapping.environment(direction);
        let sun = self.tables.sun.as_ref();
        sun.map_or(0.0, |sun| stretch * sun.pdf(direction))
    }
}

#[cfg(test)]
mod tests;
