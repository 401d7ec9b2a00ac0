//! How dense a medium may be where nobody has looked yet: upper limits, cell by cell.
//!
//! A medium is looked at in the points of a lattice, and each cell takes the most that it shows there,
//! with a margin for what lies between. No limit found so is certain; where one is exceeded tracking
//! goes on with negative weights, which is noise and no bias (see [`super::track`]).

use glam::Vec3A;
use rayon::prelude::*;

/// Intervals of the lattice for each side of a cell.
const STEPS: usize = 2;
/// Cells along each side of the box around a body, and the most of them if grids are finer.
const CELLS: usize = 16;
const CELLS_MAX: usize = 64;
/// Share of a cell's variation that is added for what lies between the points of the lattice.
const MARGIN: f32 = 0.25;
/// Events that the floor below all limits adds to a ray across the box, at most; without anything but
/// the floor that many. Places that the lattice has missed are found by them.
const FLOOR_EVENTS: f32 = 2.0;
const BLIND_EVENTS: f32 = 0.5;
/// The floor as a share of the highest limit.
const FLOOR: f32 = 0.05;
/// Events on a ray across the box where it shines its most: light is summed up at events.
const GLOW_EVENTS: f32 = 8.0;
/// Doublings of the box around the world's things before nothing is there any more.
const WORLD_LEVELS: usize = 12;
/// Cells along each side of each of these boxes; the middle four are the next smaller box.
const WORLD_CELLS: usize = 8;

/// What a lattice's point shows: extinction [1/m], and light given off [W / (sr m^3)].
pub type Look = [f32; 2];

/// A box of cells with a limit each.
#[derive(Debug)]
struct Level {
    lower: Vec3A,
    cells_per_metre: Vec3A,
    count: [usize; 3],
    /// The last cell along each side.
    last: Vec3A,
    limits: Vec<f32>,
}

/// Upper limits on the extinction of a medium [1/m], never zero inside of its boxes.
#[derive(Debug)]
pub struct Majorants {
    /// Boxes within each other, the smallest first; or one.
    levels: Vec<Level>,
    /// Whether nothing is where the boxes end, or else whatever is at their border.
    is_bounded: bool,
}

/// A part of a ray with one limit.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// Extinction is not likely to be more [1/m].
    pub limit: f32,
    /// Where the part ends, in the ray's parameter.
    pub end: f32,
}

impl Majorants {
    /// Limits in the box of a body, in its own space; `diagonal` is its length in the world [m], and
    /// `points` are those of the finest grid in it.
    pub fn of_body(
        [lower, upper]: [Vec3A; 2],
        diagonal: f32,
        points: [usize; 3],
        look: impl Fn(Vec3A) -> Look + Sync,
    ) -> Self {
        let count = points.map(|points| (points / STEPS).clamp(CELLS, CELLS_MAX));
        Self {
            levels: vec![Level::of([lower, upper], diagonal, count, look)],
            is_bounded: false,
        }
    }

    /// Limits in the world around things within this box.
    pub fn of_world([lower, upper]: [Vec3A; 2], look: impl Fn(Vec3A) -> Look + Sync) -> Self {
        let centre = 0.5 * (lower + upper);
        let half = 0.5 * (upper - lower).max_element().max(1e-3);
        let level = |doublings: usize| {
            let half = Vec3A::splat(half * (1 << doublings) as f32);
            let bounds = [centre - half, centre + half];
            Level::of(bounds, 2.0 * half.length(), [WORLD_CELLS; 3], &look)
        };
        Self {
            levels: (0..WORLD_LEVELS).map(level).collect(),
            is_bounded: true,
        }
    }

    /// Limits before anybody has looked: nothing is anywhere.
    pub fn of_nothing() -> Self {
        Self {
            levels: Vec::new(),
            is_bounded: true,
        }
    }

    /// The cell that a ray is in at `t`; both in the space of the boxes, where `t` is what it is in the
    /// world.
    pub fn cell(&self, origin: Vec3A, direction: Vec3A, t: f32) -> Cell {
        // A step inwards, for cells to begin where those before them end.
        let t = t + 1e-5 * t.abs().max(1e-3);
        let position = origin + t * direction;
        let found = self.levels.iter().find(|level| level.holds(position));
        match (found, self.levels.last()) {
            (Some(level), _) => level.cell(origin, direction, t),
            (None, Some(level)) if !self.is_bounded => level.cell(origin, direction, t),
            _ => Cell {
                limit: 0.0,
                end: f32::INFINITY,
            },
        }
    }
}

#[cfg(test)]
impl Majorants {
    pub fn scale(&mut self, factor: f32) {
        for level in &mut self.levels {
            level.limits.iter_mut().for_each(|limit| *limit *= factor);
        }
    }
}

impl Level {
    fn of(
        [lower, upper]: [Vec3A; 2],
        diagonal: f32,
        count: [usize; 3],
        look: impl Fn(Vec3A) -> Look + Sync,
    ) -> Self {
        let size = (upper - lower).max(Vec3A::splat(f32::MIN_POSITIVE));
        let lattice = count.map(|count| count * STEPS + 1);
        let spacing = size / Vec3A::from_array(lattice.map(|points| (points - 1) as f32));
        let looks: Vec<Look> = (0..lattice.iter().product())
            .into_par_iter()
            .map(|index| {
                let at = place(index, lattice).map(|x| x as f32);
                look(lower + spacing * Vec3A::from_array(at))
            })
            .collect();
        let cells = (0..count.iter().product()).into_par_iter();
        let most: Vec<Look> = cells
            .map(|index| most_in(place(index, count), lattice, &looks))
            .collect();
        Self {
            lower,
            cells_per_metre: Vec3A::from_array(count.map(|count| count as f32)) / size,
            count,
            last: Vec3A::from_array(count.map(|count| (count - 1) as f32)),
            limits: limits(&most, diagonal),
        }
    }

    fn holds(&self, position: Vec3A) -> bool {
        let cell = (position - self.lower) * self.cells_per_metre;
        (cell.cmpge(Vec3A::ZERO) & cell.cmple(self.last + 0.999)).all()
    }

    /// The cell at `t`, or the one nearest to it.
    fn cell(&self, origin: Vec3A, direction: Vec3A, t: f32) -> Cell {
        let origin = (origin - self.lower) * self.cells_per_metre;
        let direction = direction * self.cells_per_metre;
        let cell = (origin + t * direction).floor();
        let cell = cell.max(Vec3A::ZERO).min(self.last);
        let is_up = direction.cmpgt(Vec3A::ZERO);
        let side = cell + Vec3A::select(is_up, Vec3A::ONE, Vec3A::ZERO);
        let ends = (side - origin) / direction;
        // Beyond the box, and along an axis, there is no next side.
        let is_ahead = ends.cmpgt(Vec3A::splat(t));
        let end = Vec3A::select(is_ahead, ends, Vec3A::INFINITY).min_element();
        let [_, y, z] = self.count;
        let index = (cell.x as usize * y + cell.y as usize) * z + cell.z as usize;
        let limit = self.limits[index];
        Cell { limit, end }
    }
}

/// The coordinates of a place in a box of this size; the last one counts fastest.
fn place(index: usize, [_, y, z]: [usize; 3]) -> [usize; 3] {
    [index / (y * z), index / z % y, index % z]
}

/// The most that a cell shows, its border included, with a margin.
fn most_in(cell: [usize; 3], lattice: [usize; 3], looks: &[Look]) -> Look {
    let (mut least, mut most) = ([f32::INFINITY; 2], [0.0f32; 2]);
    let side = STEPS + 1;
    for part in 0..side * side * side {
        let [x, y, z] = place(part, [side; 3]);
        let point = [
            cell[0] * STEPS + x,
            cell[1] * STEPS + y,
            cell[2] * STEPS + z,
        ];
        let look = looks[(point[0] * lattice[1] + point[1]) * lattice[2] + point[2]];
        for what in 0..2 {
            least[what] = least[what].min(look[what]);
            most[what] = most[what].max(look[what]);
        }
    }
    [0, 1].map(|what| most[what] + MARGIN * (most[what] - least[what]))
}

/// The limits of cells that show so much, in a box of this diagonal [m].
fn limits(most: &[Look], diagonal: f32) -> Vec<f32> {
    let highest = |what: usize| most.iter().map(|m| m[what]).fold(0.0, f32::max);
    let (densest, brightest) = (highest(0), highest(1));
    let glow = GLOW_EVENTS / (diagonal * brightest.max(f32::MIN_POSITIVE));
    let floor = match densest.max(brightest) > 0.0 {
        true => (FLOOR * densest.max(glow * brightest)).min(FLOOR_EVENTS / diagonal),
        false => BLIND_EVENTS / diagonal,
    };
    let limit = |m: &Look| m[0].max(glow * m[1]).max(floor);
    most.iter().map(limit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Along any ray cells follow each other without a gap, and what is looked at in between is below
    /// their limits: a function that is linear has its extremes at the corners of cells.
    #[test]
    fn limits_are_above_what_is_linear() {
        let density = |p: Vec3A| (2.0 + p.x - 0.5 * p.y + 0.25 * p.z).max(0.0);
        let bounds = [Vec3A::new(-1.0, -2.0, 0.0), Vec3A::new(3.0, 1.0, 2.0)];
        let majorants = Majorants::of_body(bounds, 5.0, [1; 3], |p| [density(p), 0.0]);
        let origin = Vec3A::new(-2.0, -3.0, -1.0);
        for toward in [
            Vec3A::new(3.0, 1.0, 2.0),
            Vec3A::new(0.0, 0.5, 2.0),
            Vec3A::ONE,
        ] {
            let direction = (toward - origin).normalize();
            let (mut t, mut parts) = (1.5, 0);
            while t < 5.0 {
                let cell = majorants.cell(origin, direction, t);
                assert!(cell.end > t, "{t} {cell:?}");
                for share in [0.01, 0.3, 0.6, 0.99] {
                    let position = origin + (t + share * (cell.end.min(5.0) - t)) * direction;
                    let is_inside =
                        position.cmpge(bounds[0]).all() && position.cmple(bounds[1]).all();
                    assert!(!is_inside || density(position) <= cell.limit * 1.001);
                }
                (t, parts) = (cell.end, parts + 1);
            }
            assert!(parts > 5, "{parts}");
        }
    }

    /// From the camera to far away, and nothing beyond.
    #[test]
    fn the_world_has_limits_as_far_as_its_boxes_reach() {
        let look = |p: Vec3A| [(-0.1 * p.z.abs()).exp(), 0.0];
        let majorants = Majorants::of_world([Vec3A::NEG_ONE, Vec3A::ONE], look);
        let (mut t, mut parts) = (0.0, 0);
        loop {
            let cell = majorants.cell(Vec3A::ZERO, Vec3A::new(0.6, 0.0, 0.8), t);
            if cell.end.is_infinite() {
                break;
            }
            assert!(cell.end > t && cell.limit > 0.0);
            (t, parts) = (cell.end, parts + 1);
        }
        let farthest = (1 << (WORLD_LEVELS - 1)) as f32 / 0.8;
        assert!((t / farthest - 1.0).abs() < 1e-3, "{t}");
        assert!(parts < 10 * WORLD_LEVELS);
        // High above the ground there is little to look for.
        assert!(majorants.cell(1000.0 * Vec3A::Z, Vec3A::Z, 0.0).limit < 0.01);
    }
}
