//! The surroundings as a light: their sky, and apart from it their sun.
//!
//! An image's sun is a compact region that is far brighter than the rest. It becomes a light of its
//! own, so that a point in its shadow does not waste its samples on it, and so that light that
//! must not be borrowed (method, section 3) can be told from light that may.

use std::collections::VecDeque;
use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Mat3A, Vec3A};

use super::table::{CellTable, Grid};
use super::{Emitter, LightClass, LightSample, Receiver};
use crate::math::luminance;
use crate::sampling::discrete::Discrete;
use crate::scene::{Image, Reach, World};

/// Columns of the sky's grid at most: its tables stay in the fastest caches, and a finer grid lowers
/// the noise hardly further once the sun is apart.
const SKY_WIDTH: usize = 128;
/// Columns of the grid in which the sun is sought: a fifth of its disk for each cell.
const SUN_WIDTH: usize = 4096;
/// A sun's cells are at least this share of the brightest cell: its glow in hazy air is sky.
const SUN_EDGE: f32 = 1.0 / 64.0;
/// ... and this many times the mean of the whole image: what is dimmer needs no light of its own.
const SUN_CONTRAST: f32 = 16.0;
/// A sun is no larger than this [sr], a disk 6.5 degrees wide: larger ones cast soft shadows.
const SUN_SOLID_ANGLE: f32 = 0.01;
/// A sun gives at least this share of all light; below, it is not worth its samples.
const SUN_SHARE: f32 = 0.01;

/// What an image says about where light comes from; made once and shared by frames.
#[derive(Debug)]
pub(super) struct ImageTables {
    image: Arc<Image>,
    sky: Option<CellTable>,
    sun: Option<SunTable>,
    /// Mean luminance of the sky over the sphere.
    sky_mean: f32,
}

/// The sun's cells.
#[derive(Debug)]
struct SunTable {
    grid: Grid,
    /// In rising order.
    cells: Vec<u32>,
    choice: Discrete,
    /// Towards the middle of its light.
    direction: Vec3A,
    /// Cosine of a cone around `direction` that holds all cells: most directions need no search.
    least_cosine: f32,
    /// Luminance times solid angle: what a facing plane receives.
    irradiance: f32,
}

impl ImageTables {
    pub(super) fn new(image: &Arc<Image>) -> Self {
        let (width, height) = image.size();
        let texels = Grid { width, height };
        let sky_grid = texels.coarser(width.div_ceil(SKY_WIDTH));
        // The sun's cells divide those of the sky, so that the two share the sphere exactly.
        let division = (width.min(SUN_WIDTH) / sky_grid.width).min(height / sky_grid.height);
        let fine = Cells::of_image(image, sky_grid.finer(division));
        let sun = SunTable::find(&fine, division);
        let mut sky = vec![0.0; sky_grid.cells()];
        for (cell, energy) in fine.energies.iter().enumerate() {
            sky[fine.grid.parent(cell, division)] += energy;
        }
        for &cell in sun.iter().flat_map(|sun| &sun.cells) {
            sky[fine.grid.parent(cell as usize, division)] = 0.0;
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

impl SunTable {
    /// The image's sun, if it has one, filled up to whole cells of the sky's grid, of which each
    /// holds `division` x `division` of these cells.
    fn find(fine: &Cells, division: usize) -> Option<Self> {
        let Cells {
            grid,
            luminances,
            energies,
        } = fine;
        let total: f64 = energies.iter().copied().map(f64::from).sum();
        let mean = total as f32 / (4.0 * PI);
        let (peak, &brightest) = luminances
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(b.1))?;
        let threshold = (SUN_EDGE * brightest).max(SUN_CONTRAST * mean);
        if !(brightest > threshold) {
            return None;
        }
        let region = grown_region(*grid, peak, |cell| luminances[cell] > threshold)?;
        let cells = filled_up(*grid, &region, division);
        let energy = |cell: &u32| energies[*cell as usize];
        let irradiance: f32 = cells.iter().map(energy).sum();
        let toward = |cell: &u32| energy(cell) * grid.direction(*cell as usize, [0.5, 0.5]);
        (f64::from(irradiance) > f64::from(SUN_SHARE) * total).then_some(())?;
        let direction = cells.iter().map(toward).sum::<Vec3A>();
        let direction = direction.normalize_or(Vec3A::Z);
        Some(Self {
            grid: *grid,
            choice: Discrete::new(cells.iter().map(energy))?,
            direction,
            least_cosine: least_cosine(*grid, &cells, direction),
            irradiance,
            cells,
        })
    }

    fn sample(&self, u_choice: f32, u: [f32; 2]) -> (Vec3A, f32) {
        let (index, pmf, _) = self.choice.sample(u_choice);
        let cell = self.cells[index] as usize;
        let density = pmf / self.grid.solid_angle(cell / self.grid.width);
        (self.grid.direction(cell, u), density)
    }

    fn pdf(&self, direction: Vec3A) -> f32 {
        if direction.dot(self.direction) < self.least_cosine {
            return 0.0;
        }
        let cell = self.grid.cell(direction);
        let found = self.cells.binary_search(&(cell as u32));
        found.map_or(0.0, |index| {
            self.choice.pmf(index) / self.grid.solid_angle(cell / self.grid.width)
        })
    }
}

/// Cosine of a cone around `direction` that holds these cells.
fn least_cosine(grid: Grid, cells: &[u32], direction: Vec3A) -> f32 {
    let middle = |cell: &u32| grid.direction(*cell as usize, [0.5, 0.5]);
    let cosines = cells.iter().map(|cell| middle(cell).dot(direction));
    let farthest = cosines.fold(1.0, f32::min).max(-1.0).acos();
    // No point of a cell is farther from its middle than a cell is high and wide.
    (farthest + PI / grid.height as f32 + PI / grid.width as f32)
        .min(PI)
        .cos()
}

/// The cells that hang together with `start` and are bright, and a rim of one cell, which takes up
/// what the filter spreads; in rising order. `None` where the bright ones exceed
/// [`SUN_SOLID_ANGLE`].
fn grown_region(grid: Grid, start: usize, bright: impl Fn(usize) -> bool) -> Option<Vec<u32>> {
    let mut region = std::collections::BTreeSet::from([start as u32]);
    let mut queue = VecDeque::from([start]);
    let mut solid_angle = 0.0;
    while let Some(cell) = queue.pop_front() {
        solid_angle += grid.solid_angle(cell / grid.width);
        if solid_angle > SUN_SOLID_ANGLE {
            return None;
        }
        for neighbour in neighbours(grid, cell) {
            if region.insert(neighbour as u32) && bright(neighbour) {
                queue.push_back(neighbour);
            }
        }
    }
    Some(region.into_iter().collect())
}

/// All cells of the coarser cells that a region touches, in rising order.
fn filled_up(grid: Grid, region: &[u32], division: usize) -> Vec<u32> {
    let parents = region
        .iter()
        .map(|&cell| grid.parent(cell as usize, division));
    let mut parents: Vec<usize> = parents.collect();
    parents.sort_unstable();
    parents.dedup();
    let columns = grid.width / division;
    let mut cells: Vec<u32> = parents
        .into_iter()
        .flat_map(|parent| {
            let corner = parent / columns * division * grid.width + parent % columns * division;
            (0..division * division)
                .map(move |i| (corner + i / division * grid.width + i % division) as u32)
        })
        .collect();
    cells.sort_unstable();
    cells
}

/// The up to eight neighbours of a cell; columns wrap around.
fn neighbours(grid: Grid, cell: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (cell / grid.width, cell % grid.width);
    let rows = row.saturating_sub(1)..=(row + 1).min(grid.height - 1);
    rows.flat_map(move |row| {
        [grid.width - 1, 0, 1].map(|shift| row * grid.width + (column + shift) % grid.width)
    })
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
        let (direction, pdf) = self.tables.sun.as_ref()?.sample(u_choice, u);
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
