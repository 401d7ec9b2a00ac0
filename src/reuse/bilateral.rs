//! Method BILATERAL, a rival for the chart: a cross-bilateral filter over a block of pixels, guided
//! by normal, albedo and depth.
//!
//! What artists' denoisers did before they learned (Dammertz et al., "Edge-Avoiding À-Trous Wavelet
//! Transform for Fast Global Illumination Filtering", HPG 2010, gives the weights). Light that a
//! surface reflects is divided by its albedo, filtered, and multiplied back, in every iteration.
//! Unlike the dual cone the weights know nothing of occluders or of the light's extent, so shadows
//! blur by the width of the block whatever casts them.

use glam::Vec3A;
use rayon::prelude::*;

use super::{Canvas, Estimator, Sharing, View};
use crate::contract::Settings;
use crate::error::Result;
use crate::film::Region;
use crate::path::Bounces;

/// Standard deviation of the spatial weight over half the side of the block.
const SPATIAL_SIGMA: f32 = 0.5;
/// Exponent of the cosine between normals.
const NORMAL_POWER: i32 = 32;
/// Standard deviation of the difference of albedos.
const ALBEDO_SIGMA: f32 = 0.1;
/// Standard deviation of the distance to the receiver's plane, as a share of the depth.
const PLANE_SIGMA: f32 = 0.01;
/// Albedo below which reflected light is not divided by it: black surfaces keep their highlights.
const DARKEST_ALBEDO: f32 = 0.01;

/// The method.
pub struct Bilateral {
    half_block: usize,
}

/// What a pixel's sample tells its neighbours; nothing where it shows no surface.
#[derive(Clone, Copy, Default)]
pub struct Pixel {
    position: Vec3A,
    normal: Vec3A,
    albedo: Vec3A,
    /// Distance from the camera [m]; 0 where there is no surface.
    depth: f32,
    /// Reflected radiance over albedo.
    light: Vec3A,
}

impl Bilateral {
    /// The method with the settings' block.
    pub fn new(settings: &Settings) -> Self {
        Self {
            half_block: settings.block as usize / 2,
        }
    }

    /// The filtered light of the pixel (`x`, `y`).
    fn filtered(&self, pixels: &[Pixel], width: usize, x: usize, y: usize) -> Vec3A {
        let center = &pixels[y * width + x];
        let height = pixels.len() / width;
        let half = self.half_block;
        let sigma = SPATIAL_SIGMA * half.max(1) as f32;
        let (mut sum, mut weights) = (Vec3A::ZERO, 0.0);
        for row in y.saturating_sub(half)..(y + half + 1).min(height) {
            for column in x.saturating_sub(half)..(x + half + 1).min(width) {
                let (across, up) = (column as f32 - x as f32, row as f32 - y as f32);
                let neighbour = &pixels[row * width + column];
                let near = (-0.5 * (across * across + up * up) / (sigma * sigma)).exp();
                let weight = near * likeness(center, neighbour);
                sum += weight * neighbour.light;
                weights += weight;
            }
        }
        // The pixel itself counts fully, so the sum is never empty.
        sum / weights
    }
}

/// How much a neighbour's surface is like the center's, from 0 to 1; 1 for itself.
fn likeness(center: &Pixel, neighbour: &Pixel) -> f32 {
    if neighbour.depth == 0.0 {
        return 0.0;
    }
    let turned = center.normal.dot(neighbour.normal).clamp(0.0, 1.0);
    let plane = center.normal.dot(neighbour.position - center.position);
    let plane = plane / (PLANE_SIGMA * center.depth);
    let albedo = (center.albedo - neighbour.albedo).length_squared() / ALBEDO_SIGMA.powi(2);
    turned.powi(NORMAL_POWER) * (-0.5 * (albedo + plane * plane)).exp()
}

impl Estimator for Bilateral {
    type Memory = Vec<Pixel>;
    type History = ();

    fn memory(&self, region: Region) -> Self::Memory {
        vec![Pixel::default(); region.width * region.height]
    }

    fn memory_bytes(&self, memory: &Self::Memory) -> usize {
        size_of_val(&memory[..])
    }

    fn history(&self, _: Region) {}

    fn sample(
        &self,
        view: &View,
        iteration: u32,
        memory: &mut Self::Memory,
        canvas: Option<Canvas<()>>,
    ) -> Result<()> {
        let Some(Canvas { film, .. }) = canvas else {
            return Ok(());
        };
        let rows = film
            .rows_mut()
            .zip(memory.par_chunks_mut(view.region.width));
        view.for_rows(rows, |y, (mut row, pixels)| {
            for (x, pixel) in pixels.iter_mut().enumerate() {
                let shot = view.shoot(x, y, iteration);
                let mut target = row.pixel(x);
                view.see(&shot, iteration, &mut target);
                target.sums.add_effective_samples(1.0);
                *pixel = pixel_of(view, &shot);
            }
        })
    }

    fn share(&self, sharing: &Sharing<Self::Memory>, canvas: Canvas<()>) -> Result<()> {
        let (view, pixels) = (sharing.view(), &sharing.memories[sharing.target]);
        let width = view.region.width;
        view.for_rows(canvas.film.rows_mut(), |y, mut row| {
            for x in 0..width {
                let pixel = &pixels[y * width + x];
                if pixel.depth > 0.0 {
                    let light = pixel.albedo * self.filtered(pixels, width, x, y);
                    row.pixel(x).sums.add_radiance(light);
                }
            }
        })
    }
}

fn pixel_of(view: &View, shot: &super::Shot) -> Pixel {
    let Some(surface) = &shot.surface else {
        return Pixel::default();
    };
    let albedo = surface.bsdf.albedo().max(Vec3A::splat(DARKEST_ALBEDO));
    let reflected = view
        .tracer
        .reflected(surface, Bounces::default(), 1.0, &shot.sampler)
        .sum();
    Pixel {
        position: surface.position,
        normal: surface.normal,
        albedo,
        depth: surface.distance,
        light: reflected / albedo,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(x: f32, light: f32) -> Pixel {
        Pixel {
            position: Vec3A::new(x, 0.0, 0.0),
            normal: Vec3A::Z,
            albedo: Vec3A::splat(0.5),
            depth: 10.0,
            light: Vec3A::splat(light),
        }
    }

    #[test]
    fn even_light_stays_even_and_a_firefly_spreads_over_the_block() {
        let filter = Bilateral { half_block: 2 };
        let mut pixels: Vec<_> = (0..81).map(|i| pixel((i % 9) as f32, 3.0)).collect();
        assert!((filter.filtered(&pixels, 9, 4, 4).x - 3.0).abs() < 1e-5);
        assert!((filter.filtered(&pixels, 9, 0, 8).x - 3.0).abs() < 1e-5);
        pixels[4 * 9 + 4].light += 100.0;
        // Gaussian of sigma 1 over 5 x 5 pixels, in closed form.
        let side: f32 = (-2..=2).map(|d| (-0.5 * (d * d) as f32).exp()).sum();
        let expected = 3.0 + 100.0 / (side * side);
        assert!((filter.filtered(&pixels, 9, 4, 4).x - expected).abs() < 1e-3);
        assert!((filter.filtered(&pixels, 9, 7, 4).x - 3.0).abs() < 1e-5);
    }

    #[test]
    fn other_surfaces_lend_nothing() {
        let center = pixel(0.0, 1.0);
        assert_eq!(likeness(&center, &center), 1.0);
        assert_eq!(likeness(&center, &Pixel::default()), 0.0);
        let turned = Pixel {
            normal: Vec3A::X,
            ..center
        };
        let behind = Pixel {
            position: Vec3A::new(0.0, 0.0, -1.0),
            ..center
        };
        let painted = Pixel {
            albedo: Vec3A::ONE,
            ..center
        };
        for other in [turned, behind, painted] {
            assert!(likeness(&center, &other) < 1e-6);
        }
    }

    #[test]
    fn a_block_of_one_pixel_is_path_tracing() {
        let filter = Bilateral { half_block: 0 };
        let pixels: Vec<_> = (0..9).map(|i| pixel(0.0, i as f32)).collect();
        assert_eq!(filter.filtered(&pixels, 3, 1, 1).x, 4.0);
    }
}
