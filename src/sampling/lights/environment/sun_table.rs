//! The sun of an image: where it is, and drawing its directions by their light.
//!
//! The image is filtered bilinearly, so that its light is a sum of tents, one around each texel. A texel is
//! drawn by its light and a point of its tent by the tent's height: no sample is brighter than another, however
//! few texels the disk has.

use std::collections::{BTreeSet, VecDeque};
use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3A};

use super::super::table::Grid;
use super::Cells;
use crate::math::luminance;
use crate::sampling::discrete::Discrete;
use crate::scene::Image;
use crate::scene::world::{direction_of_uv, uv_of_direction};

/// A sun's cells are at least this share of the brightest cell: its glow in hazy air is sky.
const SUN_EDGE: f32 = 1.0 / 64.0;
/// ... and this many times the mean of the whole image: what is dimmer needs no light of its own.
const SUN_CONTRAST: f32 = 16.0;
/// A sun is no larger than this [sr], a disk 6.5 degrees wide: larger ones cast soft shadows.
const SUN_SOLID_ANGLE: f32 = 0.01;
/// A sun gives at least this share of all light; below, it is not worth its samples.
const SUN_SHARE: f32 = 0.01;

/// The sun's texels.
#[derive(Debug)]
pub struct SunTable {
    /// The sky's grid, and the cells of it that are the sun's and not the sky's, in rising order.
    sky: Grid,
    sky_cells: Vec<usize>,
    /// The image, and the texels whose tents reach into those cells, in rising order.
    image: Grid,
    texels: Vec<u32>,
    choice: Discrete,
    /// Towards the middle of its light.
    pub direction: Vec3A,
    /// Cosine of a cone around `direction` that holds all cells: most directions need no search.
    least_cosine: f32,
    /// Luminance times solid angle: what a facing plane receives.
    pub irradiance: f32,
}

impl SunTable {
    /// The image's sun, if it has one, filled up to whole cells of the sky's grid, of which each
    /// holds `division` x `division` of the given ones.
    pub fn find(image: &Image, fine: &Cells, division: usize) -> Option<Self> {
        let (grid, luminances) = (fine.grid, &fine.luminances);
        let total: f64 = fine.energies.iter().copied().map(f64::from).sum();
        let mean = total as f32 / (4.0 * PI);
        let (peak, &brightest) = luminances
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(b.1))?;
        let threshold = (SUN_EDGE * brightest).max(SUN_CONTRAST * mean);
        if !(brightest > threshold) {
            return None;
        }
        let region = grown_region(grid, peak, |cell| luminances[cell] > threshold)?;
        let parents = region.iter().map(|&cell| grid.parent(cell, division));
        let sky_cells: BTreeSet<usize> = parents.collect();
        let table = Self::of_cells(image, grid.coarser(division), sky_cells)?;
        (f64::from(table.irradiance) > f64::from(SUN_SHARE) * total).then_some(table)
    }

    fn of_cells(image: &Image, sky: Grid, sky_cells: BTreeSet<usize>) -> Option<Self> {
        let (width, height) = image.size();
        let grid = Grid { width, height };
        let texels = texels_of(grid, sky, &sky_cells);
        let energy = |&texel: &u32| {
            let (row, column) = (texel as usize / width, texel as usize % width);
            let light = luminance(Vec3A::from_vec4(image.texel(column, row)).max(Vec3A::ZERO));
            light * grid.solid_angle(row)
        };
        let toward = |texel: &u32| energy(texel) * grid.direction(*texel as usize, [0.5, 0.5]);
        let direction = texels.iter().map(toward).sum::<Vec3A>();
        let direction = direction.normalize_or(Vec3A::Z);
        let sky_cells: Vec<usize> = sky_cells.into_iter().collect();
        Some(Self {
            choice: Discrete::new(texels.iter().map(energy))?,
            irradiance: texels.iter().map(energy).sum(),
            least_cosine: least_cosine(sky, &sky_cells, direction),
            direction,
            texels,
            image: grid,
            sky,
            sky_cells,
        })
    }

    /// The cells of the sky's grid that are left to it.
    pub fn sky_cells(&self) -> &[usize] {
        &self.sky_cells
    }

    fn holds(&self, direction: Vec3A) -> bool {
        direction.dot(self.direction) >= self.least_cosine
            && self
                .sky_cells
                .binary_search(&self.sky.cell(direction))
                .is_ok()
    }

    /// A direction and its density [1/sr]; `None` for one that is the sky's, beside the sun's cells.
    pub fn sample(&self, u_choice: f32, u: [f32; 2]) -> Option<(Vec3A, f32)> {
        let (index, ..) = self.choice.sample(u_choice);
        let texel = self.texels[index] as usize;
        let at = [texel % self.image.width, texel / self.image.width];
        let at = [0, 1].map(|k| at[k] as f32 + 0.5 + sample_tent(u[k]));
        let uv = Vec2::from(at) / self.size();
        let direction = direction_of_uv(uv);
        let density = self.pdf(direction);
        (density > 0.0 && (0.0..1.0).contains(&uv.y)).then_some((direction, density))
    }

    /// Density [1/sr] of a direction.
    pub fn pdf(&self, direction: Vec3A) -> f32 {
        if !self.holds(direction) {
            return 0.0;
        }
        let at = uv_of_direction(direction) * self.size() - 0.5;
        let (low, share) = (at.floor(), at - at.floor());
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(right, up)| {
            let across = if right == 1 { share.x } else { 1.0 - share.x };
            let along = if up == 1 { share.y } else { 1.0 - share.y };
            across * along * self.probability(low.x as i64 + right, low.y as i64 + up)
        });
        let per_texel: f32 = corners.iter().sum();
        let sin_polar = (1.0 - direction.z * direction.z).max(0.0).sqrt();
        let texel = TAU / self.size().x * PI / self.size().y * sin_polar;
        per_texel / texel.max(f32::MIN_POSITIVE)
    }

    /// Of choosing a texel.
    fn probability(&self, column: i64, row: i64) -> f32 {
        let Grid { width, height } = self.image;
        if !(0..height as i64).contains(&row) {
            return 0.0;
        }
        let texel = row as u32 * width as u32 + column.rem_euclid(width as i64) as u32;
        let found = self.texels.binary_search(&texel);
        found.map_or(0.0, |index| self.choice.pmf(index))
    }

    fn size(&self) -> Vec2 {
        Vec2::new(self.image.width as f32, self.image.height as f32)
    }
}

/// From -1 to 1, as often as a tent over these is high.
fn sample_tent(u: f32) -> f32 {
    match u < 0.5 {
        true => (2.0 * u).sqrt() - 1.0,
        false => 1.0 - (2.0 - 2.0 * u).sqrt(),
    }
}

/// The texels in some cells of the sky, and those around them, in rising order.
fn texels_of(image: Grid, sky: Grid, sky_cells: &BTreeSet<usize>) -> Vec<u32> {
    let mut texels = BTreeSet::new();
    for &cell in sky_cells {
        let (row, column) = (cell / sky.width, cell % sky.width);
        // Where sizes do not divide each other, a texel that is cut belongs to both.
        let rows = row * image.height / sky.height..((row + 1) * image.height).div_ceil(sky.height);
        let columns =
            column * image.width / sky.width..((column + 1) * image.width).div_ceil(sky.width);
        for row in rows {
            let inside = columns.clone().map(|column| row * image.width + column);
            texels.extend(inside.flat_map(|texel| neighbours(image, texel)));
        }
    }
    texels.into_iter().map(|texel| texel as u32).collect()
}

/// Cosine of a cone around `direction` that holds these cells.
fn least_cosine(grid: Grid, cells: &[usize], direction: Vec3A) -> f32 {
    let middle = |cell: &usize| grid.direction(*cell, [0.5, 0.5]);
    let cosines = cells.iter().map(|cell| middle(cell).dot(direction));
    let farthest = cosines.fold(1.0, f32::min).max(-1.0).acos();
    // No point of a cell is farther from its middle than a cell is high and wide.
    (farthest + PI / grid.height as f32 + PI / grid.width as f32)
        .min(PI)
        .cos()
}

/// The cells that hang together with `start` and are bright, and a rim of one cell, which takes up
/// what the filter spreads. `None` where the bright ones exceed
/// [`SUN_SOLID_ANGLE`].
fn grown_region(
    grid: Grid,
    start: usize,
    bright: impl Fn(usize) -> bool,
) -> Option<BTreeSet<usize>> {
    let mut region = BTreeSet::from([start]);
    let mut queue = VecDeque::from([start]);
    let mut solid_angle = 0.0;
    while let Some(cell) = queue.pop_front() {
        solid_angle += grid.solid_angle(cell / grid.width);
        if solid_angle > SUN_SOLID_ANGLE {
            return None;
        }
        for neighbour in neighbours(grid, cell) {
            if region.insert(neighbour) && bright(neighbour) {
                queue.push_back(neighbour);
            }
        }
    }
    Some(region)
}

/// The up to eight neighbours of a cell; columns wrap around.
fn neighbours(grid: Grid, cell: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (cell / grid.width, cell % grid.width);
    let rows = row.saturating_sub(1)..=(row + 1).min(grid.height - 1);
    rows.flat_map(move |row| {
        [grid.width - 1, 0, 1].map(|shift| row * grid.width + (column + shift) % grid.width)
    })
}
