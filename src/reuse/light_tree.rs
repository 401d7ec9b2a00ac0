//! The environment as a group of area lights, each of nearly constant radiance.
//!
//! Source: Zhou and Chen 2015, section 4: the image is cut into an axis-aligned kd-tree whose nodes
//! are cut at half their intensity; its leaves are the lights, each with the mean of its texels.
//!
//! The paper does not say where to stop. Here: take the estimator of the environment's intensity
//! that picks a leaf by its intensity and a direction uniformly in it. Its relative variance,
//! `sum_l (A_l S_l / E_l - E_l) / sum_l E_l` (A solid angle, E and S the integrals of luminance and
//! of its square), is zero where every leaf is constant, and each leaf has its own term. The leaf
//! with the largest term is cut until the sum is below [`MAX_RELATIVE_VARIANCE`]: a uniform sky is
//! one light, and no sky needs more lights than texels.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3A};
use rayon::prelude::*;

use crate::math::cone::tan_beta;
use crate::math::luminance;
use crate::scene::World;
use crate::scene::world::{direction_of_uv, uv_of_direction};

/// Relative variance of the leaves below which no more are made.
///
/// A leaf brings its mean, whatever the cosine prefers within it: larger bounds darken a plane under
/// an overcast sky (0.03 by 4 %, 0.01 by 1.6 %, 0.002 by 0.3 %). Smaller ones make more leaves (32,
/// 93, hundreds) and so narrower cones, which borrow less and prefer light to shadow more. The
/// paper's Figure 2 has the solid angles of 30 to 1500 leaves.
const MAX_RELATIVE_VARIANCE: f64 = 0.01;

/// Most leaves of a tree: the paper's Figure 2 shows solid angles down to 4 pi / 1500.
const MAX_LEAVES: usize = 1500;

/// Widest grid that is cut; wider images are averaged to it. Its cells are 0.18 degrees wide, a
/// third of the sun's disk, and its tables take 34 MB while the tree is built.
const MAX_COLUMNS: usize = 2048;

/// A directional area light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leaf {
    /// A: solid angle [sr].
    pub solid_angle: f32,
    /// Mean radiance.
    pub radiance: Vec3A,
    /// Tangent of the half angle of the cone with this solid angle; infinite from a hemisphere on.
    pub tan_beta: f32,
}

/// Below this tan(beta) a part of the sky is small: a 3.4 degree disk, seven suns wide. A copy of a
/// ray to it misses the edges of its shadows.
const SMALL_BELOW: f32 = 0.03;

impl Leaf {
    /// Whether light sampling finds this part of the sky better than sharing does.
    pub fn is_small(&self) -> bool {
        self.tan_beta < SMALL_BELOW
    }
}

/// The leaves, which partition the sphere.
pub struct LightTree {
    world: World,
    grid: Grid,
    /// Leaf of each cell of the grid, row by row from the bottom.
    leaf_of_cell: Vec<u16>,
    leaves: Vec<Leaf>,
}

impl LightTree {
    /// The tree of a world; a world without an image is one leaf. Directions (world space) for
    /// which `is_sun` holds are black here: their light is found by sampling it.
    pub fn build(world: &World, is_sun: impl Fn(Vec3A) -> bool + Sync) -> Self {
        let (width, height) = world.image.as_ref().map_or((1, 1), |image| image.size());
        let world_from_environment = world.environment_from_world.inverse();
        let texel_radiance = |x, y| {
            let Some(image) = &world.image else {
                return world.radiance;
            };
            let uv = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let uv = uv / Vec2::new(width as f32, height as f32);
            let direction = world_from_environment * direction_of_uv(uv);
            if is_sun(direction.normalize_or_zero()) {
                Vec3A::ZERO
            } else {
                world.radiance * Vec3A::from_vec4(image.texel(x, y))
            }
        };
        Self::of_texels(Grid::new(width, height), texel_radiance, world.clone())
    }

    fn of_texels(
        grid: Grid,
        texel_radiance: impl Fn(usize, usize) -> Vec3A + Sync,
        world: World,
    ) -> Self {
        let cells: Vec<Vec3A> = (0..grid.rows)
            .into_par_iter()
            .flat_map_iter(|y| (0..grid.columns).map(move |x| (x, y)))
            .map(|(x, y)| grid.cell_mean(x, y, &texel_radiance))
            .collect();
        let regions = partition(&Integrals::new(&grid, &cells));
        let mut leaf_of_cell = vec![0; cells.len()];
        let mut leaves = Vec::with_capacity(regions.len());
        for (index, region) in regions.iter().enumerate() {
            let mut power = DVec3::ZERO;
            for (x, y) in region.cells() {
                let cell = y * grid.columns + x;
                leaf_of_cell[cell] = index as u16;
                power += cells[cell].as_dvec3() * grid.solid_angle(&Region::cell(x, y));
            }
            let solid_angle = grid.solid_angle(region);
            leaves.push(Leaf {
                solid_angle: solid_angle as f32,
                radiance: (power / solid_angle).as_vec3a(),
                tan_beta: tan_beta(solid_angle as f32),
            });
        }
        Self {
            world,
            grid,
            leaf_of_cell,
            leaves,
        }
    }

    /// Whether this is the tree of `world`, so that a frame can take over that of another.
    pub fn is_of(&self, world: &World) -> bool {
        let same_image = match (&self.world.image, &world.image) {
            (None, None) => true,
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            _ => false,
        };
        same_image
            && self.world.radiance == world.radiance
            && self.world.environment_from_world == world.environment_from_world
    }

    /// Share of the light that comes from small leaves; 0 for a black sky.
    pub fn small_share(&self) -> f32 {
        let light = |leaf: &Leaf| f64::from(leaf.solid_angle * luminance(leaf.radiance));
        let all: f64 = self.leaves.iter().map(light).sum();
        let narrow = self.leaves.iter().filter(|leaf| leaf.is_small());
        if all > 0.0 {
            (narrow.map(light).sum::<f64>() / all) as f32
        } else {
            0.0
        }
    }

    /// The leaf that a direction (unit length, world space, away from the viewer) lies in.
    pub fn leaf(&self, direction: Vec3A) -> &Leaf {
        let direction = self.world.environment_from_world * direction;
        let uv = uv_of_direction(direction.normalize_or_zero());
        &self.leaves[self.leaf_of_cell[self.grid.cell_of_uv(uv)] as usize]
    }

    /// All leaves.
    pub fn leaves(&self) -> &[Leaf] {
        &self.leaves
    }
}

/// Cells of `step` x `step` texels of an equirectangular image; those at the upper and right border
/// may be smaller.
#[derive(Debug, Clone, Copy)]
struct Grid {
    width: usize,
    height: usize,
    step: usize,
    columns: usize,
    rows: usize,
}

impl Grid {
    fn new(width: usize, height: usize) -> Self {
        let step = width.div_ceil(MAX_COLUMNS).max(1);
        Self {
            width,
            height,
            step,
            columns: width.div_ceil(step),
            rows: height.div_ceil(step),
        }
    }

    fn cell_of_uv(&self, uv: Vec2) -> usize {
        // A float that is negative becomes zero as an integer.
        let x = ((uv.x * self.width as f32) as usize).min(self.width - 1) / self.step;
        let y = ((uv.y * self.height as f32) as usize).min(self.height - 1) / self.step;
        y * self.columns + x
    }

    /// Azimuth, measured along u, of the edge before a column.
    fn azimuth(&self, column: usize) -> f64 {
        (column * self.step).min(self.width) as f64 / self.width as f64 * TAU
    }

    /// Polar angle, measured from the nadir, of the edge below a row.
    fn polar(&self, row: usize) -> f64 {
        (row * self.step).min(self.height) as f64 / self.height as f64 * PI
    }

    fn solid_angle(&self, region: &Region) -> f64 {
        let width = self.azimuth(region.end[0]) - self.azimuth(region.start[0]);
        width * (self.polar(region.start[1]).cos() - self.polar(region.end[1]).cos())
    }

    /// Mean radiance of a cell's texels, weighted by their solid angles.
    fn cell_mean(&self, x: usize, y: usize, texel: impl Fn(usize, usize) -> Vec3A) -> Vec3A {
        let span = |i: usize, size: usize| i * self.step..((i + 1) * self.step).min(size);
        let (columns, mut sum, mut weights) = (span(x, self.width), DVec3::ZERO, 0.0);
        for row in span(y, self.height) {
            let edge = |row: usize| (row as f64 / self.height as f64 * PI).cos();
            let weight = edge(row) - edge(row + 1);
            let texels: DVec3 = columns.clone().map(|x| texel(x, row).as_dvec3()).sum();
            sum += weight * texels;
            weights += weight * columns.len() as f64;
        }
        (sum / weights).as_vec3a()
    }
}

/// A rectangle of cells; the coordinates are (column, row).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Region {
    start: [usize; 2],
    end: [usize; 2],
}

impl Region {
    fn cell(x: usize, y: usize) -> Self {
        Self {
            start: [x, y],
            end: [x + 1, y + 1],
        }
    }

    fn length(&self, axis: usize) -> usize {
        self.end[axis] - self.start[axis]
    }

    fn cells(&self) -> impl Iterator<Item = (usize, usize)> {
        let (start, end) = (self.start, self.end);
        (start[1]..end[1]).flat_map(move |y| (start[0]..end[0]).map(move |x| (x, y)))
    }

    /// The parts before and after the edge `at` of an axis.
    fn split(&self, axis: usize, at: usize) -> [Self; 2] {
        let (mut low, mut high) = (*self, *self);
        low.end[axis] = at;
        high.start[axis] = at;
        [low, high]
    }
}

/// Integrals of luminance and of its square over any region, in constant time: summed-area tables,
/// in double precision because a sun's square is 1e10 times the sky's.
///
/// Source: Crow, "Summed-Area Tables for Texture Mapping", SIGGRAPH 1984.
struct Integrals<'a> {
    grid: &'a Grid,
    luminance: Vec<f64>,
    luminance_squared: Vec<f64>,
}

impl<'a> Integrals<'a> {
    fn new(grid: &'a Grid, cells: &[Vec3A]) -> Self {
        let stride = grid.columns + 1;
        let mut tables = [0, 1].map(|_| vec![0.0; stride * (grid.rows + 1)]);
        for y in 0..grid.rows {
            let mut row = [0.0; 2];
            for x in 0..grid.columns {
                // Negative texels are no light.
                let value = f64::from(luminance(cells[y * grid.columns + x])).max(0.0);
                let intensity = value * grid.solid_angle(&Region::cell(x, y));
                row = [row[0] + intensity, row[1] + intensity * value];
                let at = (y + 1) * stride + x + 1;
                for (table, sum) in tables.iter_mut().zip(row) {
                    table[at] = table[at - stride] + sum;
                }
            }
        }
        let [luminance, luminance_squared] = tables;
        Self {
            grid,
            luminance,
            luminance_squared,
        }
    }

    fn sum(&self, table: &[f64], region: &Region) -> f64 {
        let at = |x: usize, y: usize| table[y * (self.grid.columns + 1) + x];
        let ([x0, y0], [x1, y1]) = (region.start, region.end);
        let sum = (at(x1, y1) - at(x0, y1)) - (at(x1, y0) - at(x0, y0));
        sum.max(0.0)
    }

    fn intensity(&self, region: &Region) -> f64 {
        self.sum(&self.luminance, region)
    }

    /// The region's term of the variance, times the environment's intensity.
    fn excess(&self, region: &Region) -> f64 {
        let intensity = self.intensity(region);
        if region.length(0) * region.length(1) == 1 || !(intensity > 0.0) {
            return 0.0;
        }
        let square = self.sum(&self.luminance_squared, region);
        (self.grid.solid_angle(region) * square / intensity - intensity).max(0.0)
    }

    /// The region, cut across its longer side on the sphere at the edge nearest to half of its
    /// intensity. It must have more than one cell.
    fn halves(&self, region: &Region) -> [Region; 2] {
        let axis = self.longer_side(region);
        let half = 0.5 * self.intensity(region);
        let below = |at: usize| self.intensity(&region.split(axis, at)[0]);
        let (mut low, mut high) = (region.start[axis] + 1, region.end[axis] - 1);
        while low < high {
            let middle = usize::midpoint(low, high);
            if below(middle) < half {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        let before = (low - 1).max(region.start[axis] + 1);
        let nearer_before = half - below(before) < below(low) - half;
        region.split(axis, if nearer_before { before } else { low })
    }

    fn longer_side(&self, region: &Region) -> usize {
        let [bottom, top] = [region.start[1], region.end[1]].map(|row| self.grid.polar(row));
        // The widest circle of latitude is the one nearest to the equator.
        let widest = (0.5 * PI).clamp(bottom, top).sin();
        let width = self.grid.azimuth(region.end[0]) - self.grid.azimuth(region.start[0]);
        let upright =
            region.length(0) == 1 || (region.length(1) > 1 && top - bottom > width * widest);
        usize::from(upright)
    }
}

/// The regions of the leaves.
fn partition(integrals: &Integrals) -> Vec<Region> {
    let whole = Region {
        start: [0, 0],
        end: [integrals.grid.columns, integrals.grid.rows],
    };
    let candidate = |region: Region| Candidate {
        excess: integrals.excess(&region),
        region,
    };
    let bound = MAX_RELATIVE_VARIANCE * integrals.intensity(&whole);
    let mut heap = BinaryHeap::from([candidate(whole)]);
    let mut excess = integrals.excess(&whole);
    // A single cell has no excess, so what is left to cut has at least two.
    while excess > bound
        && heap.len() < MAX_LEAVES
        && heap.peek().is_some_and(|worst| worst.excess > 0.0)
        && let Some(worst) = heap.pop()
    {
        let halves = integrals.halves(&worst.region).map(candidate);
        excess += halves[0].excess + halves[1].excess - worst.excess;
        heap.extend(halves);
    }
    heap.into_iter().map(|c| c.region).collect()
}

/// A region, ordered by its term of the variance.
struct Candidate {
    excess: f64,
    region: Region,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.excess.total_cmp(&other.excess)
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Candidate {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::Random;
    use crate::math::warp::sample_sphere;
    use crate::scene::Reach;
    use crate::testing::{image_world, plain_world};
    use glam::{Mat3A, Vec3};

    const WIDTH: usize = 96;
    const HEIGHT: usize = 48;
    const SUN: (usize, usize) = (60, 35);

    /// A sky that grows brighter upwards, mottled, over dark ground, with a sun of one texel.
    fn sky(x: usize, y: usize) -> Vec3A {
        if (x, y) == SUN {
            return Vec3A::splat(500.0);
        }
        let mottle = 1.0 + 0.3 * Random::new((y * WIDTH + x) as u64).next();
        let height = y as f32 / HEIGHT as f32;
        let ground = Vec3A::splat(0.1);
        let sky = Vec3A::new(0.5, 0.8, 1.5) * height * mottle;
        if 2 * y < HEIGHT { ground } else { sky }
    }

    fn tree(texel: impl Fn(usize, usize) -> Vec3A + Sync) -> LightTree {
        LightTree::of_texels(Grid::new(WIDTH, HEIGHT), texel, plain_world(1.0))
    }

    fn texel_weight(y: usize, height: usize) -> f64 {
        let edge = |row: usize| (row as f64 / height as f64 * PI).cos();
        TAU / (2 * height) as f64 * (edge(y) - edge(y + 1))
    }

    fn centre(x: usize, y: usize) -> Vec3A {
        direction_of_uv(Vec2::new(
            (x as f32 + 0.5) / WIDTH as f32,
            (y as f32 + 0.5) / HEIGHT as f32,
        ))
    }

    #[test]
    fn leaves_partition_the_sphere() {
        let tree = tree(sky);
        assert!(tree.leaves.len() > 20 && tree.leaves.len() <= MAX_LEAVES);
        // From the leaves, and from the map that lookups use: each texel in one leaf, none empty.
        let sum: f64 = tree.leaves.iter().map(|l| f64::from(l.solid_angle)).sum();
        assert!((sum - 2.0 * TAU).abs() < 1e-4, "{sum}");
        let mut mapped = vec![0.0; tree.leaves.len()];
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                mapped[tree.leaf_of_cell[y * WIDTH + x] as usize] += texel_weight(y, HEIGHT);
            }
        }
        for (leaf, mapped) in tree.leaves.iter().zip(mapped) {
            assert!((f64::from(leaf.solid_angle) / mapped - 1.0).abs() < 1e-5);
        }
        let mut random = Random::new(7);
        for _ in 0..10_000 {
            let leaf = tree.leaf(sample_sphere(random.next_2d()));
            assert!(leaf.solid_angle > 0.0 && leaf.tan_beta > 0.0);
        }
    }

    #[test]
    fn energies_of_the_leaves_add_up_to_the_image() {
        let tree = tree(sky);
        let leaves: DVec3 = (tree.leaves.iter())
            .map(|leaf| leaf.radiance.as_dvec3() * f64::from(leaf.solid_angle))
            .sum();
        let texels: DVec3 = (0..HEIGHT * WIDTH)
            .map(|i| (i % WIDTH, i / WIDTH))
            .map(|(x, y)| sky(x, y).as_dvec3() * texel_weight(y, HEIGHT))
            .sum();
        assert!((leaves / texels - 1.0).abs().max_element() < 1e-6);
    }

    #[test]
    fn a_uniform_sky_is_one_light() {
        let image = tree(|_, _| Vec3A::new(0.1, 0.7, 3.0));
        let world = World {
            radiance: Vec3A::new(0.1, 0.7, 3.0),
            ..plain_world(1.0)
        };
        let color = LightTree::build(&world, |_| false);
        for tree in [image, color] {
            assert_eq!(tree.leaves.len(), 1);
            let leaf = tree.leaf(Vec3A::new(0.6, 0.0, -0.8));
            assert!((leaf.solid_angle - 2.0 * std::f32::consts::TAU).abs() < 1e-5);
            assert!((leaf.radiance - Vec3A::new(0.1, 0.7, 3.0)).length() < 1e-6);
            assert_eq!(leaf.tan_beta, f32::INFINITY);
        }
        assert_eq!(tree(|_, _| Vec3A::ZERO).leaves.len(), 1);
    }

    #[test]
    fn a_sun_gets_a_leaf_of_its_own_and_the_sky_beside_it_small_ones() {
        let tree = tree(sky);
        let sun = tree.leaf(centre(SUN.0, SUN.1));
        assert!((f64::from(sun.solid_angle) / texel_weight(SUN.1, HEIGHT) - 1.0).abs() < 1e-5);
        assert!((sun.radiance - 500.0).length() < 0.01);
        let ground = tree.leaf(-Vec3A::Z);
        assert!(ground.solid_angle > 100.0 * sun.solid_angle);
    }

    #[test]
    fn the_variance_is_below_its_bound() {
        let tree = tree(sky);
        let (mut second, mut total) = (0.0, 0.0);
        for (y, x) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (y, x))) {
            let leaf = &tree.leaves[tree.leaf_of_cell[y * WIDTH + x] as usize];
            let value = f64::from(luminance(sky(x, y)));
            let mean = f64::from(luminance(leaf.radiance));
            second += value * value * texel_weight(y, HEIGHT) / mean;
            total += value * texel_weight(y, HEIGHT);
        }
        let variance = second / total - 1.0;
        assert!(variance <= MAX_RELATIVE_VARIANCE, "{variance}");
    }

    #[test]
    fn halves_have_equal_intensity_within_a_line_of_texels() {
        let grid = Grid::new(WIDTH, HEIGHT);
        let cells: Vec<Vec3A> = (0..WIDTH * HEIGHT)
            .map(|i| sky(i % WIDTH, i / WIDTH))
            .collect();
        let integrals = Integrals::new(&grid, &cells);
        let mut random = Random::new(9);
        for _ in 0..1000 {
            let mut span = |size: usize| {
                let mut ends = [0; 2].map(|_| (random.next() * size as f32) as usize);
                ends.sort_unstable();
                (ends[0], ends[1] + 1)
            };
            let ((x0, x1), (y0, y1)) = (span(WIDTH), span(HEIGHT));
            let region = Region {
                start: [x0, y0],
                end: [x1, y1],
            };
            if region.length(0) * region.length(1) == 1 {
                continue;
            }
            let [low, high] = integrals.halves(&region);
            let axis = usize::from(low.end[0] == high.end[0]);
            assert_eq!(low.end[axis], high.start[axis]);
            let slices = [low.end[axis] - 1, low.end[axis]].map(|at| {
                let [_, rest] = region.split(axis, at);
                integrals.intensity(&rest.split(axis, at + 1)[0])
            });
            let difference = integrals.intensity(&low) - integrals.intensity(&high);
            let line = slices[0].max(slices[1]);
            assert!(difference.abs() <= line * (1.0 + 1e-9), "{region:?}");
        }
    }

    #[test]
    fn the_cut_goes_across_the_longer_side_on_the_sphere() {
        let grid = Grid::new(WIDTH, HEIGHT);
        let integrals = Integrals::new(&grid, &vec![Vec3A::ONE; WIDTH * HEIGHT]);
        let region = |x1: usize, y: [usize; 2]| Region {
            start: [0, y[0]],
            end: [x1, y[1]],
        };
        assert_eq!(integrals.longer_side(&region(WIDTH, [0, HEIGHT])), 0);
        assert_eq!(integrals.longer_side(&region(8, [20, 30])), 1);
        // As many columns as rows, but at the pole columns are narrow.
        assert_eq!(integrals.longer_side(&region(8, [HEIGHT - 6, HEIGHT])), 1);
    }

    #[test]
    fn wide_images_are_averaged_and_keep_their_energy() {
        let (width, height) = (2 * MAX_COLUMNS + 3, 5);
        let bright = |x: usize, _: usize| Vec3A::splat(if x == 4000 { 1e4 } else { 1.0 });
        let tree = LightTree::of_texels(Grid::new(width, height), bright, plain_world(1.0));
        assert!(tree.grid.columns <= MAX_COLUMNS && tree.grid.rows == 2);
        let energy: f64 = (tree.leaves.iter())
            .map(|leaf| f64::from(leaf.radiance.x) * f64::from(leaf.solid_angle))
            .sum();
        let expected = 2.0 * TAU * (1.0 + (1e4 - 1.0) / width as f64);
        assert!((energy / expected - 1.0).abs() < 1e-5, "{energy}");
        let at_bright = direction_of_uv(Vec2::new(4000.5 / width as f32, 0.3));
        assert!(tree.leaf(at_bright).radiance.x > 100.0);
    }

    #[test]
    fn lookups_turn_with_the_world() {
        let world = World {
            camera_image: None,
            environment_from_world: Mat3A::from_rotation_z(0.7),
            reach: Reach::ALL,
            ..plain_world(1.0)
        };
        let turned = LightTree::of_texels(Grid::new(WIDTH, HEIGHT), sky, world);
        let direction = centre(SUN.0, SUN.1);
        let world = Mat3A::from_rotation_z(-0.7) * direction;
        assert!(turned.leaf(world).radiance.x > 100.0);
        assert!(turned.leaf(direction).radiance.x < 100.0);
    }
    #[test]
    fn a_tree_is_of_its_own_world_only() {
        let world = image_world([4, 2], |x, _| Vec3::splat(x as f32));
        let tree = LightTree::build(&world, |_| false);
        assert!(tree.is_of(&world.clone()));
        let turned = Mat3A::from_rotation_z(0.7);
        let others = [
            image_world([4, 2], |x, _| Vec3::splat(x as f32)),
            plain_world(1.0),
            World {
                radiance: 2.0 * world.radiance,
                ..world.clone()
            },
            World {
                camera_image: None,
                environment_from_world: turned,
                reach: Reach::ALL,
                ..world.clone()
            },
        ];
        assert!(others.iter().all(|other| !tree.is_of(other)));
    }
}
