//! Tiles of pixels: the squares in which a frame is judged.

use crate::film::Region;

/// Pixels on each side of a tile.
pub const TILE: usize = 16;

/// A value for each tile.
#[derive(Clone)]
pub struct Tiles<T> {
    width: usize,
    columns: usize,
    rows: usize,
    values: Vec<T>,
}

impl<T: Copy + Default> Tiles<T> {
    /// The default in every tile.
    pub fn new(region: Region) -> Self {
        let (columns, rows) = (region.width.div_ceil(TILE), region.height.div_ceil(TILE));
        Self {
            width: region.width,
            columns,
            rows,
            values: vec![T::default(); columns * rows],
        }
    }

    /// The tile of a pixel, counted row by row.
    pub fn of(&self, pixel: usize) -> usize {
        self.at(pixel % self.width, pixel / self.width)
    }

    /// The tile of the pixel in column `x` of row `y`.
    pub fn at(&self, x: usize, y: usize) -> usize {
        y / TILE * self.columns + x / TILE
    }

    /// All values.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The value of a tile.
    pub fn get(&self, tile: usize) -> T {
        self.values[tile]
    }

    /// The value of a tile, to change.
    pub fn get_mut(&mut self, tile: usize) -> &mut T {
        &mut self.values[tile]
    }

    /// The tiles that a rectangle of pixels meets, from column `x` and row `y` on; it may reach
    /// beyond the frame.
    pub fn under(&self, x: i64, y: i64, side: i64) -> impl Iterator<Item = usize> + use<T> {
        let range = |first: i64, count: usize| {
            let tile = |pixel: i64| pixel.div_euclid(TILE as i64).clamp(0, count as i64) as usize;
            tile(first)..tile(first + side - 1 + TILE as i64)
        };
        let (columns, all_columns) = (range(x, self.columns), self.columns);
        range(y, self.rows).flat_map(move |row| columns.clone().map(move |x| row * all_columns + x))
    }

    /// What `value` makes of each tile.
    pub fn map<U>(&self, value: impl Fn(T) -> U) -> Tiles<U> {
        Tiles {
            width: self.width,
            columns: self.columns,
            rows: self.rows,
            values: self.values.iter().map(|&tile| value(tile)).collect(),
        }
    }

    /// What `fold` makes of each tile and those around it.
    pub fn around<U>(&self, fold: impl Fn(&mut dyn Iterator<Item = T>) -> U) -> Tiles<U> {
        let of_tile = |tile: usize| {
            let (x, y) = (tile % self.columns, tile / self.columns);
            let columns = x.saturating_sub(1)..(x + 2).min(self.columns);
            let rows = y.saturating_sub(1)..(y + 2).min(self.rows);
            let tiles = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            fold(&mut tiles.map(|(x, y)| self.values[y * self.columns + x]))
        };
        Tiles {
            width: self.width,
            columns: self.columns,
            rows: self.rows,
            values: (0..self.values.len()).map(of_tile).collect(),
        }
    }
}

impl<const N: usize> Tiles<[f32; N]> {
    /// The values at a pixel, interpolated between the middles of tiles.
    pub fn at_pixel(&self, pixel: usize) -> [f32; N] {
        let place = |pixel: usize| {
            let tile = ((pixel as f32 + 0.5) / TILE as f32 - 0.5).max(0.0);
            (tile as usize, tile.fract())
        };
        let ((x, u), (y, v)) = (place(pixel % self.width), place(pixel / self.width));
        let at = |x: usize, y: usize| {
            self.values[y.min(self.rows - 1) * self.columns + x.min(self.columns - 1)]
        };
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        std::array::from_fn(|i| {
            let low = a[i] * (1.0 - u) + b[i] * u;
            let high = c[i] * (1.0 - u) + d[i] * u;
            low * (1.0 - v) + high * v
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REGION: Region = Region {
        frame_width: 40,
        frame_height: 33,
        x: 0,
        y: 0,
        width: 40,
        height: 33,
    };

    #[test]
    fn a_rectangle_lies_on_the_tiles_of_its_pixels() {
        let tiles = Tiles::<bool>::new(REGION);
        for (x, y, side) in [
            (0, 0, 1),
            (13, 15, 3),
            (-5, -9, 7),
            (30, 20, 17),
            (15, 31, 40),
        ] {
            let mut expected: Vec<usize> = (y..y + side)
                .flat_map(|y| (x..x + side).map(move |x| (x, y)))
                .filter(|(x, y)| (0..40).contains(x) && (0..33).contains(y))
                .map(|(x, y)| tiles.at(x as usize, y as usize))
                .collect();
            expected.sort_unstable();
            expected.dedup();
            let found: Vec<usize> = tiles.under(x, y, side).collect();
            assert_eq!(found, expected, "{x}, {y}, {side}");
        }
    }

    #[test]
    fn values_are_interpolated_between_middles() {
        let mut tiles = Tiles::<[f32; 1]>::new(REGION);
        (0..9).for_each(|tile| *tiles.get_mut(tile) = [(tile % 3) as f32]);
        let row = |x: usize| tiles.at_pixel(20 * 40 + x)[0];
        assert_eq!(row(0), 0.0);
        assert!((row(15) - 15.5 / 16.0 + 0.5).abs() < 1e-6);
        assert!((row(23) - 1.0).abs() < 0.04);
    }
}
