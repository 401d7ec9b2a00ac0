//! From where a pixel borrows: decided tile by tile after two pilot iterations, which render each
//! pixel by the whole window's samples, by its frame's, and by its own.
//!
//! With V the variance of a pixel and c its cost, the way with the least V c is the best one. Variances
//! are those of two iterations, relative to the tile's brightness and not clamped: clamped ones make noisy
//! tiles look alike, and to borrow too little is far dearer than to borrow too much. So a tile turns
//! away from the whole window only where that gains more than twice the gain's standard error. Costs
//! are counted, not clocked, so that a picture does not depend on the machine.
//!
//! The decision is smooth: gains are averaged over neighbouring tiles and interpolated, and every way
//! renders the same light, so that no seams show.

use crate::film::Region;

/// Iterations that render all ways.
pub const PILOT_ITERATIONS: u32 = 2;

/// Pixels on each side of a tile.
const TILE: usize = 16;
/// What a ray costs, in borrowed records.
const RECORDS_PER_RAY: f32 = 200.0;
/// What borrowing costs a pixel beside its records.
const RECORDS_PER_BLOCK: f32 = 30.0;
/// Standard errors by which another way must gain.
const SURE: f64 = 2.0;
/// Added to a squared luminance, so that dark pixels do not rule.
const DARK: f32 = 0.01;

/// Whose samples a pixel takes beside its own.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Lending {
    /// Nobody's.
    #[default]
    None,
    /// Those of its frame.
    Frame,
    /// Those of the frames around it too.
    Window,
}

/// Luminance of a pixel's sum by each way to take samples.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pilot {
    /// [`Lending::Window`].
    pub window: f32,
    /// [`Lending::Frame`].
    pub frame: f32,
    /// [`Lending::None`].
    pub own: f32,
}

impl Pilot {
    /// All without what was there before.
    pub fn less(self, before: f32) -> Self {
        Self {
            window: self.window - before,
            frame: self.frame - before,
            own: self.own - before,
        }
    }
}

/// What a sample costs that borrows from the window and from its frame, over one that does not.
#[derive(Debug, Clone, Copy)]
pub struct Costs {
    window: f32,
    frame: f32,
}

impl Costs {
    /// `records` are those of a block in one of `lenders` frames.
    pub fn new(records: usize, lenders: usize, has_bounces: bool) -> Self {
        // To the surface, to a lamp, to the sky; and where light bounces, about as many again.
        let rays = if has_bounces { 6.0 } else { 3.0 };
        let cost =
            |records: usize| 1.0 + (records as f32 + RECORDS_PER_BLOCK) / (rays * RECORDS_PER_RAY);
        Self {
            window: cost(records * lenders),
            frame: cost(records),
        }
    }
}

/// What a tile's pixels gain by another way than the window.
#[derive(Debug, Clone, Copy, Default)]
struct Gain {
    count: f64,
    sum: f64,
    squares: f64,
}

impl Gain {
    fn of(gain: f32) -> Self {
        let gain = f64::from(gain);
        Self {
            count: 1.0,
            sum: gain,
            squares: gain * gain,
        }
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// The mean, less what chance may have added.
    fn sure(&self) -> f32 {
        let count = self.count.max(1.0);
        let mean = self.sum / count;
        let variance = (self.squares / count - mean * mean).max(0.0);
        (mean - SURE * (variance / count).sqrt()) as f32
    }
}

/// V c of the window less that of the frame and of the pixel alone, over the squared brightness.
fn gains(first: &Pilot, second: &Pilot, brightness: f32, costs: Costs) -> [f32; 2] {
    let scale = 0.5 / (brightness * brightness + DARK);
    let variance = |a: f32, b: f32| (a - b) * (a - b) * scale;
    let window = variance(first.window, second.window) * costs.window;
    [
        window - variance(first.frame, second.frame) * costs.frame,
        window - variance(first.own, second.own),
    ]
}

/// A number for each tile.
struct Tiles<T> {
    columns: usize,
    rows: usize,
    values: Vec<T>,
}

/// The tile of each pixel, pixels row by row.
fn tile_of(region: Region) -> impl Fn(usize) -> usize {
    let columns = region.width.div_ceil(TILE);
    move |pixel| pixel / region.width / TILE * columns + pixel % region.width / TILE
}

impl<T: Copy + Default> Tiles<T> {
    fn new(region: Region) -> Self {
        let (columns, rows) = (region.width.div_ceil(TILE), region.height.div_ceil(TILE));
        Self {
            columns,
            rows,
            values: vec![T::default(); columns * rows],
        }
    }
}

/// Mean brightness of each tile. A pixel's own would not do: where both its samples by one way are
/// dark by chance, their variance over their brightness would be small by that way only.
fn brightness(region: Region, first: &[Pilot], second: &[Pilot]) -> Tiles<f32> {
    let (mut tiles, tile_of) = (Tiles::new(region), tile_of(region));
    let mut counts = vec![0.0; tiles.values.len()];
    for (pixel, (first, second)) in first.iter().zip(second).enumerate() {
        tiles.values[tile_of(pixel)] += 0.5 * (first.window + second.window);
        counts[tile_of(pixel)] += 1.0;
    }
    tiles
        .values
        .iter_mut()
        .zip(counts)
        .for_each(|(sum, count)| *sum /= count);
    tiles
}

impl Tiles<[Gain; 2]> {
    fn of_pixels(region: Region, first: &[Pilot], second: &[Pilot], costs: Costs) -> Self {
        let (mut tiles, tile_of) = (Self::new(region), tile_of(region));
        let brightness = brightness(region, first, second);
        for (pixel, (first, second)) in first.iter().zip(second).enumerate() {
            let tile = tile_of(pixel);
            let gains = gains(first, second, brightness.values[tile], costs);
            (0..2).for_each(|way| tiles.values[tile][way].add(&Gain::of(gains[way])));
        }
        tiles
    }

    /// Sure gains over 3 x 3 tiles.
    fn smoothed(&self) -> Tiles<[f32; 2]> {
        let around = |tile: usize| {
            let (x, y) = (tile % self.columns, tile / self.columns);
            let mut sum = [Gain::default(); 2];
            for y in y.saturating_sub(1)..(y + 2).min(self.rows) {
                for x in x.saturating_sub(1)..(x + 2).min(self.columns) {
                    let tile = &self.values[y * self.columns + x];
                    (0..2).for_each(|way| sum[way].add(&tile[way]));
                }
            }
            sum.map(|gain| gain.sure())
        };
        Tiles {
            columns: self.columns,
            rows: self.rows,
            values: (0..self.values.len()).map(around).collect(),
        }
    }
}

impl Tiles<[f32; 2]> {
    /// Interpolated between the middles of tiles.
    fn at_pixel(&self, x: usize, y: usize) -> [f32; 2] {
        let place = |pixel: usize| {
            let tile = ((pixel as f32 + 0.5) / TILE as f32 - 0.5).max(0.0);
            (tile as usize, tile.fract())
        };
        let ((x, u), (y, v)) = (place(x), place(y));
        let at = |x: usize, y: usize| {
            self.values[y.min(self.rows - 1) * self.columns + x.min(self.columns - 1)]
        };
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        [0, 1].map(|way| {
            let low = a[way] * (1.0 - u) + b[way] * u;
            let high = c[way] * (1.0 - u) + d[way] * u;
            low * (1.0 - v) + high * v
        })
    }
}

/// From where each pixel borrows, row by row.
pub fn choose(region: Region, first: &[Pilot], second: &[Pilot], costs: Costs) -> Vec<Lending> {
    let tiles = Tiles::of_pixels(region, first, second, costs).smoothed();
    let choice = |index: usize| match tiles.at_pixel(index % region.width, index / region.width) {
        [frame, own] if own > 0.0 && own >= frame => Lending::None,
        [frame, _] if frame > 0.0 => Lending::Frame,
        _ => Lending::Window,
    };
    (0..first.len()).map(choice).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::Random;

    const SIDE: usize = 128;
    const REGION: Region = Region {
        frame_width: SIDE,
        frame_height: SIDE,
        x: 0,
        y: 0,
        width: SIDE,
        height: SIDE,
    };

    /// Shares of the ways (alone, frame, window) on the left and on the right half, where the window
    /// divides the variance by `window`, the frame by `frame`.
    fn shares(window: [f32; 2], frame: [f32; 2], costs: Costs) -> [[f32; 3]; 2] {
        let mut random = Random::new(9);
        let mut pixels = || -> Vec<Pilot> {
            let pixel = |index: usize| {
                let half = usize::from(index % SIDE >= SIDE / 2);
                let mut noise = |gain: f32| 1.0 + 3.0 * (random.next() - 0.5) / gain.sqrt();
                Pilot {
                    window: noise(window[half]),
                    frame: noise(frame[half]),
                    own: noise(1.0),
                }
            };
            (0..SIDE * SIDE).map(pixel).collect()
        };
        let (first, second) = (pixels(), pixels());
        let mut shares = [[0.0; 3]; 2];
        for (index, way) in choose(REGION, &first, &second, costs).iter().enumerate() {
            let half = usize::from(index % SIDE >= SIDE / 2);
            shares[half][*way as usize] += 2.0 / (SIDE * SIDE) as f32;
        }
        shares
    }

    #[test]
    fn a_tile_borrows_less_only_where_that_surely_gains() {
        let costs = Costs {
            window: 1.5,
            frame: 1.2,
        };
        // The window gains on the left; on the right nothing does. The choice takes a tile and a half
        // of the four on each side to change.
        let [left, right] = shares([9.0, 1.0], [4.0, 1.0], costs);
        assert!(left[2] > 0.8 && left[0] < 0.1, "{left:?}");
        assert!(right[0] > 0.6 && right[2] < 0.1, "{right:?}");
        // The frame is as good as the window; a small gain of the window is no sure loss.
        let [left, right] = shares([4.0, 1.6], [4.0, 1.0], costs);
        assert!(left[1] > 0.5 && right[2] > 0.9, "{left:?} {right:?}");
    }

    #[test]
    fn darkness_borrows() {
        let dark = vec![Pilot::default(); SIDE * SIDE];
        let ways = choose(REGION, &dark, &dark, Costs::new(49, 3, false));
        assert!(ways.iter().all(|&way| way == Lending::Window));
    }
}
