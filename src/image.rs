//! Textures: scene-linear RGBA texels with Blender's row order.

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
}

/// An image in memory.
#[derive(Debug)]
pub struct Image {
    width: usize,
    height: usize,
    texels: Vec<[f32; 4]>,
    extension: Extension,
    interpolation: Interpolation,
    replaced_texels: usize,
}

impl Image {
    /// An image from the array of [`IMAGE`]. Texels with a NaN or an infinity become black.
    ///
    /// # Errors
    /// An array that breaks the contract, or an image without texels.
    pub fn new(
        given: Vec<Given>,
        extension: Extension,
        interpolation: Interpolation,
    ) -> Result<Self> {
        let arrays = Arrays::checked(IMAGE, given)?;
        let (width, height) = (arrays.length("W"), arrays.length("H"));
        if width * height == 0 {
            return Err(Error::Range {
                field: "pixels",
                value: format!("{width} x {height}"),
                range: "1 x 1 and more".into(),
            });
        }
        let mut texels = arrays.f32s("pixels").as_chunks::<4>().0.to_vec();
        let mut replaced_texels = 0;
        for texel in &mut texels {
            if texel.iter().any(|v| !v.is_finite()) {
                *texel = [0.0, 0.0, 0.0, 1.0];
                replaced_texels += 1;
            }
        }
        Ok(Self {
            width,
            height,
            texels,
            extension,
            interpolation,
            replaced_texels,
        })
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
        self.texels.len() * size_of::<[f32; 4]>()
    }

    /// One texel; `x` counts from the left, `y` from the bottom, both inside the image.
    pub fn texel(&self, x: usize, y: usize) -> Vec4 {
        Vec4::from(self.texels[y * self.width + x])
    }

    /// The colour and alpha at a texture coordinate, filtered and extended as the image says.
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        let size = Vec2::new(self.width as f32, self.height as f32);
        match self.interpolation {
            Interpolation::Closest => {
                let at = (uv * size).floor();
                self.extended(at.x as i64, at.y as i64)
            }
            Interpolation::Linear => {
                // Texel centres lie at half-integers.
                let at = uv * size - 0.5;
                let (low, part) = (at.floor(), at - at.floor());
                let (x, y) = (low.x as i64, low.y as i64);
                if let Some([bottom, top]) = self.inside(x, y) {
                    let along = |[left, right]: [Vec4; 2]| left.lerp(right, part.x);
                    return along(bottom).lerp(along(top), part.y);
                }
                let bottom = self.extended(x, y).lerp(self.extended(x + 1, y), part.x);
                let top = self
                    .extended(x, y + 1)
                    .lerp(self.extended(x + 1, y + 1), part.x);
                bottom.lerp(top, part.y)
            }
        }
    }

    /// The four texels from (x, y) on, row by row, where all of them lie inside: nearly always.
    #[inline]
    fn inside(&self, x: i64, y: i64) -> Option<[[Vec4; 2]; 2]> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        if x + 1 >= self.width || y + 1 >= self.height {
            return None;
        }
        let start = y * self.width + x;
        let row = |start: usize| {
            let pair = self.texels.get(start..)?.first_chunk::<2>()?;
            Some(pair.map(Vec4::from))
        };
        Some([row(start)?, row(start + self.width)?])
    }

    fn extended(&self, x: i64, y: i64) -> Vec4 {
        let (width, height) = (self.width as i64, self.height as i64);
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        // Divisions are slow, and nearly all texels lie inside.
        let (x, y) = match self.extension {
            _ if inside => (x, y),
            Extension::Repeat => (x.rem_euclid(width), y.rem_euclid(height)),
            Extension::Extend => (x.clamp(0, width - 1), y.clamp(0, height - 1)),
            Extension::Mirror => (mirrored(x, width), mirrored(y, height)),
            Extension::Clip => return Vec4::ZERO,
        };
        self.texel(x as usize, y as usize)
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

    fn image(extension: Extension, interpolation: Interpolation) -> Image {
        // Red 0, red 1, and a texel that is not finite.
        let pixels = [
            0.0,
            0.0,
            0.0,
            1.0,
            1.0,
            0.0,
            0.0,
            1.0,
            f32::NAN,
            0.0,
            0.0,
            1.0,
        ];
        let given = Given {
            name: "pixels".into(),
            shape: vec![1, 3, 4],
            numbers: Numbers::F32(&pixels),
        };
        Image::new(vec![given], extension, interpolation).unwrap()
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
}
