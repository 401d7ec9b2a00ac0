//! What a frame's pixels add up to, and the passes made from it.

use glam::{Vec2, Vec3A};
use rayon::prelude::*;

use crate::contract::{PassSpec, Settings};
use crate::error::{Error, Result};
use crate::math::{PixelFilter, luminance};

mod catcher;
mod extra;

pub use catcher::{CatcherSums, Caught};
pub use extra::{Extra, Layout, Row};

/// Depth of a pixel that shows the background, as Blender writes it [m].
const BACKGROUND_DEPTH: f32 = 1e10;

/// The rectangle of a frame that is rendered, in pixels from the lower left corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// Width of the whole frame.
    pub frame_width: usize,
    /// Height of the whole frame.
    pub frame_height: usize,
    /// Left edge of the rectangle.
    pub x: usize,
    /// Lower edge of the rectangle.
    pub y: usize,
    /// Width of the rectangle.
    pub width: usize,
    /// Height of the rectangle.
    pub height: usize,
}

impl Region {
    /// The same rectangle, known to be inside its frame and not empty.
    ///
    /// # Errors
    /// An empty rectangle, or one that reaches beyond the frame.
    pub fn checked(self) -> Result<Self> {
        let inside =
            self.x + self.width <= self.frame_width && self.y + self.height <= self.frame_height;
        // Pixels are numbered in 32 bits.
        let countable = self.frame_width.saturating_mul(self.frame_height) < u32::MAX as usize;
        if inside && countable && self.width * self.height > 0 {
            return Ok(self);
        }
        Err(Error::Range {
            field: "region",
            value: format!(
                "{} x {} at ({}, {})",
                self.width, self.height, self.x, self.y
            ),
            range: format!(
                "rectangles of at least one pixel inside {} x {}",
                self.frame_width, self.frame_height
            ),
        })
    }

    /// Column and row of a pixel of the rectangle in the whole frame: what its random numbers depend on.
    pub fn pixel(&self, x: usize, y: usize) -> [u32; 2] {
        [self.x + x, self.y + y].map(|at| at as u32)
    }

    /// A point of the film, as shares of the frame, in a pixel of the rectangle.
    pub fn film(&self, x: usize, y: usize, offset: Vec2) -> Vec2 {
        let pixel = Vec2::new((self.x + x) as f32, (self.y + y) as f32) + 0.5 + offset;
        pixel / Vec2::new(self.frame_width as f32, self.frame_height as f32)
    }

    /// By how many pixels one point of the film lies beside another, to the nearest.
    pub fn shift(&self, from: Vec2, to: Vec2) -> (i64, i64) {
        let size = Vec2::new(self.frame_width as f32, self.frame_height as f32);
        let shift = ((to - from) * size).round();
        (shift.x as i64, shift.y as i64)
    }

    /// The pixel of the rectangle that a point of the film falls into; it may lie outside.
    pub fn pixel_at(&self, film: Vec2) -> (i64, i64) {
        let pixel = film * Vec2::new(self.frame_width as f32, self.frame_height as f32);
        let (x, y) = (pixel.x.floor() as i64, pixel.y.floor() as i64);
        (x - self.x as i64, y - self.y as i64)
    }
}

/// Sums over the iterations of one pixel.
#[derive(Debug, Clone, Copy, Default)]
pub struct PixelSums {
    radiance: [f32; 3],
    coverage: f32,
    normal: [f32; 3],
    albedo: [f32; 3],
    /// Depth of the first iteration: depths do not average.
    depth: f32,
    effective_samples: f32,
}

/// What a camera ray saw, apart from the light that is still to be added.
#[derive(Debug, Clone, Copy)]
pub struct Sighting {
    /// 1 where something is, 0 where the background is transparent.
    pub coverage: f32,
    /// Shading normal, world space; zero for the background.
    pub normal: Vec3A,
    /// Share of light that the surface reflects.
    pub albedo: Vec3A,
    /// Distance along the viewing axis [m]; `None` for the background.
    pub depth: Option<f32>,
}

impl Sighting {
    /// A transparent background.
    pub const NOTHING: Self = Self {
        coverage: 0.0,
        normal: Vec3A::ZERO,
        albedo: Vec3A::ZERO,
        depth: None,
    };

    /// A background that shows.
    pub const BACKGROUND: Self = Self {
        coverage: 1.0,
        ..Self::NOTHING
    };
}

impl PixelSums {
    /// Adds radiance that reaches the camera through this pixel.
    pub fn add_radiance(&mut self, radiance: Vec3A) {
        // One number that is not finite would spoil the pixel for good. There should be none.
        debug_assert!(radiance.is_finite(), "{radiance}");
        if radiance.is_finite() {
            let sum = Vec3A::from(self.radiance) + radiance;
            self.radiance = sum.into();
        }
    }

    /// Luminance of the sum.
    pub fn luminance(&self) -> f32 {
        luminance(Vec3A::from(self.radiance))
    }

    /// Adds what the camera ray of an iteration saw.
    pub fn add_sighting(&mut self, iteration: u32, seen: &Sighting) {
        self.coverage += seen.coverage;
        self.normal = (Vec3A::from(self.normal) + seen.normal).into();
        self.albedo = (Vec3A::from(self.albedo) + seen.albedo).into();
        if iteration == 0 {
            self.depth = seen.depth.unwrap_or(BACKGROUND_DEPTH);
        }
    }

    /// Adds how many gather samples this iteration's estimate was worth.
    pub fn add_effective_samples(&mut self, samples: f32) {
        self.effective_samples += samples;
    }
}

/// A row of pixels, to write.
pub struct FilmRow<'a> {
    sums: &'a mut [PixelSums],
    layout: &'a Layout,
    numbers: &'a mut [f32],
    catchers: &'a mut [CatcherSums],
}

/// One pixel, to write.
pub struct Pixel<'a> {
    /// What every film keeps.
    pub sums: &'a mut PixelSums,
    /// What passes keep that were asked for.
    pub extra: Extra<'a>,
    /// What shadow catchers found, where there are any.
    pub catcher: Option<&'a mut CatcherSums>,
}

impl FilmRow<'_> {
    /// The pixel in column `x`.
    pub fn pixel(&mut self, x: usize) -> Pixel<'_> {
        let (layout, stride) = (self.layout, self.layout.stride());
        Pixel {
            sums: &mut self.sums[x],
            extra: Extra {
                layout,
                numbers: &mut self.numbers[x * stride..(x + 1) * stride],
            },
            catcher: self.catchers.get_mut(x),
        }
    }

    /// What its pixels keep for passes.
    pub fn layout(&self) -> &Layout {
        self.layout
    }

    /// Pixels in the row.
    pub fn width(&self) -> usize {
        self.sums.len()
    }
}

/// The sums of a frame's pixels.
pub struct Film {
    /// The rectangle.
    pub region: Region,
    pixels: Vec<PixelSums>,
    layout: Layout,
    /// Numbers of passes, pixel by pixel as the layout says.
    numbers: Vec<f32>,
    /// One for each pixel, where the frame has shadow catchers.
    catchers: Vec<CatcherSums>,
    samples: u32,
    noise: Option<NoiseMeter>,
}

/// How the noise of a frame is measured: by the difference of two halves of its iterations. Pixels
/// that share samples are as noisy as the halves, which share none, say.
#[derive(Default)]
struct NoiseMeter {
    /// Luminance of each pixel's sum when the number of iterations was last a power of two; empty
    /// before it ever was.
    first_half: Vec<f32>,
    measured: Option<Noise>,
}

/// What was measured after some iterations.
#[derive(Debug, Clone, Copy)]
struct Noise {
    samples: u32,
    /// Mean of the squared error over the squared luminance.
    relative_variance: f64,
}

/// Added to a squared luminance, so that dark pixels do not rule the noise.
const DARK: f64 = 0.01;
/// Iterations from which on the noise is measured: fewer say little.
const NOISE_FROM: u32 = 8;

impl NoiseMeter {
    /// Measures where the number of iterations is a power of two: its halves are then the
    /// iterations since the last one, and those before.
    fn look(&mut self, pixels: &[PixelSums], samples: u32) {
        if !samples.is_power_of_two() {
            return;
        }
        let sums = pixels.iter().map(PixelSums::luminance);
        if samples >= NOISE_FROM && self.first_half.len() == pixels.len() {
            let halves = sums.clone().zip(&self.first_half);
            let terms = halves.map(|(all, &first)| {
                let scale = 1.0 / f64::from(samples);
                let mean = f64::from(all) * scale;
                // The mean of two halves is off by half their difference.
                let error = (f64::from(all) - 2.0 * f64::from(first)) * scale;
                // A single firefly must not keep a frame from ending.
                (error * error / (mean * mean + DARK)).min(1.0)
            });
            self.measured = Some(Noise {
                samples,
                relative_variance: terms.sum::<f64>() / pixels.len() as f64,
            });
        }
        self.first_half.clear();
        self.first_half.extend(sums);
    }
}

impl Film {
    /// A film without samples, for the passes of a layout.
    pub fn new(region: Region, layout: Layout) -> Self {
        let pixels = region.width * region.height;
        Self {
            region,
            pixels: vec![PixelSums::default(); pixels],
            numbers: vec![0.0; pixels * layout.stride()],
            layout,
            catchers: Vec::new(),
            samples: 0,
            noise: None,
        }
    }

    /// From now on keeps what shadow catchers find.
    pub fn catch_shadows(&mut self) {
        self.catchers = vec![CatcherSums::default(); self.pixels.len()];
    }

    /// From now on measures its noise.
    pub fn watch_noise(&mut self) {
        self.noise = Some(NoiseMeter::default());
    }

    /// The noise as a share of the brightness: root of the mean squared relative error of the
    /// luminance, where it was measured. It falls as the root of the iterations.
    pub fn noise(&self) -> Option<f32> {
        let measured = self.noise.as_ref()?.measured?;
        let since = f64::from(measured.samples) / f64::from(self.samples);
        Some((measured.relative_variance * since).sqrt() as f32)
    }

    /// The rows, from the lowest.
    pub fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = FilmRow<'_>> {
        let (width, layout) = (self.region.width, &self.layout);
        let mut rest = &mut self.numbers[..];
        let mut catchers = &mut self.catchers[..];
        let rows = self.pixels.chunks_exact_mut(width).map(|sums| {
            let numbers = rest
                .split_off_mut(..width * layout.stride())
                .unwrap_or_default();
            let catchers = catchers.split_off_mut(..width).unwrap_or_default();
            FilmRow {
                sums,
                layout,
                numbers,
                catchers,
            }
        });
        rows.collect::<Vec<_>>().into_par_iter()
    }

    /// Counts an iteration that is complete in every pixel.
    pub fn count_iteration(&mut self) {
        self.samples += 1;
        if let Some(noise) = &mut self.noise {
            noise.look(&self.pixels, self.samples);
        }
    }

    /// Luminance of a pixel's sum, pixels row by row.
    pub fn luminance(&self, pixel: usize) -> f32 {
        self.pixels[pixel].luminance()
    }

    /// Iterations so far.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Mean of the effective sample numbers over all pixels.
    pub fn mean_effective_samples(&self) -> f32 {
        let sum: f64 = self
            .pixels
            .iter()
            .map(|p| f64::from(p.effective_samples))
            .sum();
        (sum / self.pixels.len() as f64) as f32
    }

    /// The numbers of a pass of the contract, pixel by pixel from the lower left, channels together;
    /// empty for a name that the contract does not have, and for what only an estimator knows.
    pub fn resolve(&self, pass: &str) -> Vec<f32> {
        let mean = 1.0 / self.samples.max(1) as f32;
        let each = |channels: fn(&PixelSums, f32) -> Vec3A| {
            self.pixels
                .iter()
                .flat_map(|p| channels(p, mean).to_array())
                .collect()
        };
        match pass {
            // Whoever calls the renderer denoises Combined, not the renderer.
            "Combined" | "Noisy Image" => self.combined(),
            "Depth" => self.pixels.iter().map(|p| p.depth).collect(),
            "Normal" => each(|p, mean| Vec3A::from(p.normal) * mean),
            "Albedo" => each(|p, mean| Vec3A::from(p.albedo) * mean),
            "Shadow Catcher" => self.light_left_to_catchers(),
            "Sample Count" => vec![self.samples as f32; self.pixels.len()],
            "Effective Samples" => self.pixels.iter().map(|p| p.effective_samples).collect(),
            _ => extra::resolve(&self.layout, &self.numbers, pass, self.samples),
        }
    }

    fn light_left_to_catchers(&self) -> Vec<f32> {
        if self.catchers.is_empty() {
            return vec![1.0; 3 * self.pixels.len()];
        }
        let left = self.catchers.iter().map(CatcherSums::left);
        left.flat_map(|left| left.to_array()).collect()
    }

    /// The picture so far, red, green, blue and alpha of each pixel from the lower left.
    pub fn combined(&self) -> Vec<f32> {
        let mean = 1.0 / self.samples.max(1) as f32;
        let pixel = |p: &PixelSums| {
            let [r, g, b] = p.radiance;
            [r * mean, g * mean, b * mean, p.coverage * mean]
        };
        if self.catchers.is_empty() {
            return self.pixels.iter().flat_map(pixel).collect();
        }
        let both = self.pixels.iter().zip(&self.catchers);
        both.flat_map(|(p, catcher)| catcher.shaded(pixel(p), mean))
            .collect()
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        let halves = self.noise.as_ref().map_or(0, |_| size_of::<f32>());
        self.pixels.len() * (size_of::<PixelSums>() + halves)
            + size_of_val(&self.numbers[..])
            + size_of_val(&self.catchers[..])
    }
}

/// Channels of a pass of the contract.
pub fn channels(pass: &str) -> usize {
    PassSpec::named(pass).map_or(0, |(spec, _)| spec.channels.len())
}

/// The pixel filter that the settings ask for.
pub fn pixel_filter(settings: &Settings) -> PixelFilter {
    PixelFilter::new(settings.filter, settings.filter_width)
}
