//! Textures: RGBA texels with Blender's row order, filtered as Cycles filters them.

use std::sync::{Arc, LazyLock};

use glam::{Vec2, Vec4};

use crate::contract::{Arrays, Given, IMAGE};
use crate::error::{Error, Result};

/// What lies outside the unit square.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extension {
    /// The image again.
    Repeat,
    /// The texels of the border.
    Extend,
    /// Nothing: transparent black.
    Clip,
    /// The image again, every other time reversed.
    Mirror,
}

/// What lies between texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// A bilinear blend of four texels.
    Linear,
    /// The nearest texel.
    Closest,
    /// A blend of sixteen texels by uniform cubic B-splines, which blurs.
    Cubic,
}

/// What the numbers of an image mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Scene linear, of any size.
    Linear,
    /// Scene linear, 0 to 1, held in 8 bits.
    Byte,
    /// sRGB, 0 to 1, held in 8 bits. Decoded behind the filter, as Cycles does.
    Srgb,
}

/// How texels are looked up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lookup {
    /// Outside the unit square.
    pub extension: Extension,
    /// Between texels.
    pub interpolation: Interpolation,
    /// What the texels say.
    pub encoding: Encoding,
    /// Whether colours are divided by alpha behind the filter.
    pub divides_alpha: bool,
}

impl Default for Lookup {
    fn default() -> Self {
        Self {
            extension: Extension::Repeat,
            interpolation: Interpolation::Linear,
            encoding: Encoding::Linear,
            divides_alpha: false,
        }
    }
}

#[derive(Debug)]
enum Texels {
    Floats(Vec<[f32; 4]>),
    Bytes(Vec<[u8; 4]>),
}

/// What is seen where an image should be and is none, as in Blender.
const MISSING: Vec4 = Vec4::new(1.0, 0.0, 1.0, 1.0);

/// Number of the first tile, and how many lie side by side: Blender's UDIM.
const FIRST_TILE: u32 = 1001;
const TILES_ACROSS: u32 = 10;
/// Rows of tiles that numbers of four digits can name.
const TILE_ROWS: f32 = 900.0;

/// An image in memory.
#[derive(Debug)]
pub struct Image {
    width: usize,
    height: usize,
    texels: Texels,
    lookup: Lookup,
    replaced_texels: usize,
    /// UDIM tiles by their numbers: with them the image has no texels of its own.
    tiles: Vec<(u32, Arc<Image>)>,
}

impl Image {
    /// An image from the array of [`IMAGE`]. Texels with a NaN or an infinity become black.
    ///
    /// # Errors
    /// An array that breaks the contract, or an image without texels.
    pub fn new(given: Vec<Given>, lookup: Lookup) -> Result<Self> {
        let arrays = Arrays::checked(IMAGE, given)?;
        let (width, height) = (arrays.length("W"), arrays.length("H"));
        if width * height == 0 {
            return Err(Error::Range {
                field: "pixels",
                value: format!("{width} x {height}"),
                range: "1 x 1 and more".into(),
            });
        }
        let mut replaced_texels = 0;
        let mut finite = |texel: &[f32; 4]| {
            if texel.iter().all(|v| v.is_finite()) {
                return *texel;
            }
            replaced_texels += 1;
            [0.0, 0.0, 0.0, 1.0]
        };
        let given = arrays.f32s("pixels").as_chunks::<4>().0.iter();
        let texels = match lookup.encoding {
            Encoding::Linear => Texels::Floats(given.map(finite).collect()),
            _ => Texels::Bytes(given.map(|texel| finite(texel).map(byte)).collect()),
        };
        Ok(Self {
            width,
            height,
            texels,
            lookup,
            replaced_texels,
            tiles: Vec::new(),
        })
    }

    /// An image of UDIM tiles, each with its number; magenta where there is none.
    pub fn tiled(tiles: Vec<(u32, Arc<Image>)>) -> Self {
        Self {
            width: 1,
            height: 1,
            texels: Texels::Floats(vec![MISSING.to_array()]),
            lookup: Lookup::default(),
            replaced_texels: tiles.iter().map(|(_, tile)| tile.replaced_texels).sum(),
            tiles,
        }
    }

    /// Texels across and up.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Texels that were not finite and are black now.
    pub fn replaced_texels(&self) -> usize {
        self.replaced_texels
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        let own = match &self.texels {
            Texels::Floats(texels) => size_of_val(&texels[..]),
            Texels::Bytes(texels) => size_of_val(&texels[..]),
        };
        let tiles = self.tiles.iter().map(|(_, tile)| tile.memory_bytes());
        own + tiles.sum::<usize>()
    }

    /// Scene-linear colour and alpha of one texel; `x` counts from the left, `y` from the bottom,
    /// both inside the image.
    pub fn texel(&self, x: usize, y: usize) -> Vec4 {
        self.decoded(self.stored(y * self.width + x))
    }

    /// Scene-linear colour and alpha at a texture coordinate, filtered and extended as the image
    /// says.
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        if !self.tiles.is_empty() {
            return self.sample_tile(uv);
        }
        let size = Vec2::new(self.width as f32, self.height as f32);
        let filtered = match self.lookup.interpolation {
            Interpolation::Closest => {
                let at = (uv * size).floor();
                self.extended(at.x as i64, at.y as i64)
            }
            // Texel centres lie at half-integers.
            Interpolation::Linear => self.bilinear(uv * size - 0.5),
            Interpolation::Cubic => self.bicubic(uv * size - 0.5),
        };
        self.decoded(filtered)
    }

    /// A tile at its part of the plane. As in Cycles the row and column before the first belong to
    /// the first.
    fn sample_tile(&self, uv: Vec2) -> Vec4 {
        let corner = uv.trunc();
        let columns = 0.0..TILES_ACROSS as f32;
        if !columns.contains(&corner.x) || !(0.0..TILE_ROWS).contains(&corner.y) {
            return MISSING;
        }
        let number = FIRST_TILE + TILES_ACROSS * corner.y as u32 + corner.x as u32;
        let tile = self.tiles.iter().find(|(known, _)| *known == number);
        tile.map_or(MISSING, |(_, tile)| tile.sample(uv - corner))
    }

    fn bilinear(&self, at: Vec2) -> Vec4 {
        let (low, part) = (at.floor(), at - at.floor());
        let (x, y) = self.repeated(low.x as i64, low.y as i64);
        let along = |[left, right]: [Vec4; 2]| left.lerp(right, part.x);
        let [bottom, top] = self
            .inside(x, y)
            .unwrap_or_else(|| [y, y + 1].map(|y| [self.extended(x, y), self.extended(x + 1, y)]));
        along(bottom).lerp(along(top), part.y)
    }

    fn bicubic(&self, at: Vec2) -> Vec4 {
        let (low, part) = (at.floor(), at - at.floor());
        let (across, up) = (spline_weights(part.x), spline_weights(part.y));
        let mut sum = Vec4::ZERO;
        for (y, v) in (low.y as i64 - 1..).zip(up) {
            for (x, u) in (low.x as i64 - 1..).zip(across) {
                sum += u * v * self.extended(x, y);
            }
        }
        sum
    }

    /// Where a texel comes from that repetition puts at (x, y): the other extensions look at each texel.
    fn repeated(&self, x: i64, y: i64) -> (i64, i64) {
        let (width, height) = (self.width as i64, self.height as i64);
        let is_inside = (0..width).contains(&x) && (0..height).contains(&y);
        // Divisions are slow.
        if is_inside || self.lookup.extension != Extension::Repeat {
            return (x, y);
        }
        (x.rem_euclid(width), y.rem_euclid(height))
    }

    /// The four texels from (x, y) on, row by row, where all of them lie inside: nearly always.
    #[inline]
    fn inside(&self, x: i64, y: i64) -> Option<[[Vec4; 2]; 2]> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        if x + 1 >= self.width || y + 1 >= self.height {
            return None;
        }
        let start = y * self.width + x;
        Some([self.pair(start)?, self.pair(start + self.width)?])
    }

    #[inline]
    fn pair(&self, start: usize) -> Option<[Vec4; 2]> {
        match &self.texels {
            Texels::Floats(texels) => {
                let pair = texels.get(start..)?.first_chunk::<2>()?;
                Some(pair.map(Vec4::from))
            }
            Texels::Bytes(texels) => Some(texels.get(start..)?.first_chunk::<2>()?.map(unpacked)),
        }
    }

    fn stored(&self, index: usize) -> Vec4 {
        match &self.texels {
            Texels::Floats(texels) => Vec4::from(texels[index]),
            Texels::Bytes(texels) => unpacked(texels[index]),
        }
    }

    fn extended(&self, x: i64, y: i64) -> Vec4 {
        let (width, height) = (self.width as i64, self.height as i64);
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        // Divisions are slow, and nearly all texels lie inside.
        let (x, y) = match self.lookup.extension {
            _ if inside => (x, y),
            Extension::Repeat => (x.rem_euclid(width), y.rem_euclid(height)),
            Extension::Extend => (x.clamp(0, width - 1), y.clamp(0, height - 1)),
            Extension::Mirror => (mirrored(x, width), mirrored(y, height)),
            Extension::Clip => return Vec4::ZERO,
        };
        self.stored(y as usize * self.width + x as usize)
    }

    fn decoded(&self, stored: Vec4) -> Vec4 {
        let alpha = stored.w;
        let straight = if self.lookup.divides_alpha && alpha != 0.0 {
            (stored / alpha).with_w(alpha)
        } else {
            stored
        };
        match self.lookup.encoding {
            Encoding::Srgb => {
                let [red, green, blue, _] = straight.to_array().map(linear_from_srgb);
                Vec4::new(red, green, blue, alpha)
            }
            Encoding::Linear | Encoding::Byte => straight,
        }
    }
}

fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[inline]
fn unpacked(texel: [u8; 4]) -> Vec4 {
    Vec4::from(texel.map(f32::from)) * (1.0 / 255.0)
}

/// Weights of four texels in a row for a point this far behind the second.
fn spline_weights(t: f32) -> [f32; 4] {
    let (square, cube) = (t * t, t * t * t);
    let rest = 1.0 - t;
    [
        rest * rest * rest,
        3.0 * cube - 6.0 * square + 4.0,
        3.0 * (square - cube + t) + 1.0,
        cube,
    ]
    .map(|weight| weight / 6.0)
}

/// Steps of the table below: between them a line is off by less than 1e-6.
const SRGB_STEPS: usize = 1024;

static SRGB: LazyLock<[f32; SRGB_STEPS + 1]> =
    LazyLock::new(|| std::array::from_fn(|i| srgb_curve(i as f32 / SRGB_STEPS as f32)));

/// IEC 61966-2-1, from a table: powers are slow.
fn linear_from_srgb(encoded: f32) -> f32 {
    let at = encoded * SRGB_STEPS as f32;
    let index = at as usize;
    if !(encoded >= 0.0) || index >= SRGB_STEPS {
        return srgb_curve(encoded);
    }
    let [low, high] = [SRGB[index], SRGB[index + 1]];
    low + (high - low) * (at - index as f32)
}

fn srgb_curve(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        encoded.max(0.0) / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// The texel that a walk along the axis meets when it turns round at the borders.
fn mirrored(x: i64, size: i64) -> i64 {
    let x = x.rem_euclid(2 * size);
    x.min(2 * size - 1 - x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::Numbers;

    fn row_of(texels: &[[f32; 4]], lookup: Lookup) -> Image {
        let given = Given {
            name: "pixels".into(),
            shape: vec![1, texels.len(), 4],
            numbers: Numbers::F32(texels.as_flattened()),
        };
        Image::new(vec![given], lookup).unwrap()
    }

    /// Red 0, red 1, and a texel that is not finite.
    fn image(extension: Extension, interpolation: Interpolation) -> Image {
        let texels = [0.0, 1.0, f32::NAN].map(|red| [red, 0.0, 0.0, 1.0]);
        let lookup = Lookup {
            extension,
            interpolation,
            ..Lookup::default()
        };
        row_of(&texels, lookup)
    }

    #[test]
    fn filtering_and_extension_follow_their_names() {
        let linear = image(Extension::Extend, Interpolation::Linear);
        assert_eq!(linear.replaced_texels(), 1);
        assert!((linear.sample(Vec2::new(1.0 / 3.0, 0.5)).x - 0.5).abs() < 1e-6);
        assert_eq!(linear.sample(Vec2::new(-4.0, 9.0)).x, 0.0);
        let repeat = image(Extension::Repeat, Interpolation::Closest);
        assert_eq!(repeat.sample(Vec2::new(-0.5, 0.5)).x, 1.0);
        let mirror = image(Extension::Mirror, Interpolation::Closest);
        let red = |x: f32| mirror.sample(Vec2::new(x, 0.5)).x;
        assert_eq!(
            [-0.5, -0.1, 1.5, 1.9, 2.5].map(red),
            [1.0, 0.0, 1.0, 0.0, 1.0]
        );
        let clip = image(Extension::Clip, Interpolation::Closest);
        assert_eq!(clip.sample(Vec2::new(1.2, 0.5)), Vec4::ZERO);
    }

    #[test]
    fn bytes_are_decoded_behind_the_filter() {
        let texels = [[0.0, 0.2, 1.0, 1.0], [1.0, 0.4, 1.0, 1.0]];
        let lookup = Lookup {
            encoding: Encoding::Srgb,
            ..Lookup::default()
        };
        let middle = row_of(&texels, lookup).sample(Vec2::new(0.5, 0.5));
        let expected = Vec4::new(0.214_041_1, 0.073_238_95, 1.0, 1.0); // sRGB 0.5, 0.3 and 1
        assert!((middle - expected).abs().max_element() < 2e-6, "{middle}");
    }

    #[test]
    fn the_table_of_srgb_is_the_curve() {
        for i in 0..5000 {
            let encoded = i as f32 * 0.000_21;
            let off = linear_from_srgb(encoded) - srgb_curve(encoded);
            assert!(off.abs() < 1e-5, "{encoded}: {off}");
        }
    }

    #[test]
    fn tiles_lie_where_their_numbers_say() {
        let grey = |value| Arc::new(row_of(&[[value; 4]], Lookup::default()));
        let tiled = Image::tiled(vec![
            (1001, grey(0.1)),
            (1002, grey(0.2)),
            (1011, grey(0.3)),
        ]);
        let seen = |u, v| tiled.sample(Vec2::new(u, v));
        let places = [(0.5, 0.5), (1.5, 0.5), (0.5, 1.5), (-0.5, 0.5)];
        assert_eq!(places.map(|(u, v)| seen(u, v).x), [0.1, 0.2, 0.3, 0.1]);
        for (u, v) in [(1.5, 1.5), (-1.5, 0.5), (10.5, 0.5), (0.5, f32::NAN)] {
            assert_eq!(seen(u, v), MISSING, "{u} {v}");
        }
    }

    #[test]
    fn alpha_is_divided_out_behind_the_filter() {
        let texels = [[0.2, 0.0, 0.0, 0.4], [0.0, 0.0, 0.0, 0.0]];
        let lookup = Lookup {
            divides_alpha: true,
            ..Lookup::default()
        };
        let middle = row_of(&texels, lookup).sample(Vec2::new(0.5, 0.5));
        assert!((middle - Vec4::new(0.5, 0.0, 0.0, 0.2)).length() < 1e-6);
    }

    #[test]
    fn cubic_splines_keep_lines_and_blur_peaks() {
        let lookup = Lookup {
            interpolation: Interpolation::Cubic,
            extension: Extension::Clip,
            ..Lookup::default()
        };
        let line: Vec<_> = (0..8).map(|i| [i as f32, 0.0, 0.0, 1.0]).collect();
        let peak = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0].map(|red| [red; 4]);
        // A picture of one row is black above and below, of which the spline sees a third.
        let middle = 2.0 / 3.0;
        let on_line = row_of(&line, lookup).sample(Vec2::new(4.2 / 8.0, 0.5)).x;
        assert!((on_line - 3.7 * middle).abs() < 1e-5, "{on_line}");
        let at_peak = row_of(&peak, lookup).sample(Vec2::splat(0.5)).x;
        assert!((at_peak - middle * middle).abs() < 1e-5, "{at_peak}");
    }
}
