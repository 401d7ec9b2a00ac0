//! How much a GGX surface reflects: tables made once, at first use, by our own sampler.
//!
//! Axes, as in Cycles so that materials look the same there: roughness (square root of alpha), the
//! cosine of the view, and for dielectrics the fourth root of F0, all in equal steps over [0, 1].

use std::sync::LazyLock;

use glam::Vec3A;

use super::fresnel::{Curve, Fresnel, dielectric, f0_from_ior, ior_from_f0};
use crate::math::Ggx;

/// Steps of roughness and cosine of the tables without Fresnel.
const FINE: usize = 32;
/// Steps of every axis of the tables with Fresnel.
const COARSE: usize = 16;
/// Points per entry: 1024 leave an error of 1e-3.
const POINTS: u32 = 1024;
/// The axes start here instead of at zero, where nothing is defined.
const AXIS_MIN: f32 = 1e-4;

struct Tables {
    /// Share reflected by a white surface, `[roughness][cosine]`.
    directional: Box<[[f32; FINE]; FINE]>,
    /// Its mean over the hemisphere, weighted by the cosine.
    average: [f32; FINE],
    /// Mean of Schlick's curve, `[roughness][cosine]`.
    schlick: Box<[[f32; COARSE]; COARSE]>,
    /// Mean of the dielectric curve, `[fourth root of F0][roughness][cosine]`.
    dielectric: Box<[[[f32; COARSE]; COARSE]; COARSE]>,
}

static TABLES: LazyLock<Tables> = LazyLock::new(Tables::new);

/// Share of light that a white GGX surface reflects in one bounce, seen under this cosine.
pub fn directional_albedo(roughness: f32, cos: f32) -> f32 {
    bilinear(&TABLES.directional, roughness, cos)
}

/// The mean of [`directional_albedo`] over the hemisphere, weighted by the cosine.
pub fn average_albedo(roughness: f32) -> f32 {
    let (i, t) = cell::<FINE>(roughness);
    lerp(TABLES.average[i], TABLES.average[i + 1], t)
}

/// What the single bounces of a lobe with this albedo, whose Fresnel reflectance is `fresnel` on
/// average, must be multiplied with.
pub fn compensation(single: f32, average: f32, fresnel: Vec3A) -> Vec3A {
    let multiple = fresnel * average / (Vec3A::ONE - fresnel * (1.0 - average));
    Vec3A::ONE + multiple * ((1.0 - single) / single)
}

/// What the single bounces of GGX microfacets that reflect, seen under this cosine, must be multiplied
/// with to give back the light of several, and the share of white light that is reflected then.
pub fn multiscatter(fresnel: &Fresnel, roughness: f32, cos: f32) -> (Vec3A, Vec3A) {
    let single = directional_albedo(roughness, cos);
    let scale = compensation(single, average_albedo(roughness), fresnel.mean());
    (scale, scale * single * fresnel.seen_under(roughness, cos))
}

/// The mean of a Fresnel curve over the microfacets seen under this cosine; those that reflect
/// below the horizon count as zero, as in Cycles. The table knows light that enters only: that of light
/// that leaves is taken to be the same, as in Cycles.
pub fn mean_curve(curve: Curve, roughness: f32, cos: f32) -> f32 {
    match curve {
        Curve::Schlick => bilinear(&TABLES.schlick, roughness, cos),
        Curve::Dielectric { ior } => {
            let (i, t) = cell::<COARSE>(f0_from_ior(ior).sqrt().sqrt());
            let at = |i: usize| bilinear(&TABLES.dielectric[i], roughness, cos);
            lerp(at(i), at(i + 1), t)
        }
    }
}

/// Points per entry of the tables of glass, which are many.
const GLASS_POINTS: u32 = 256;

/// Shares of light that white glass reflects and refracts in one bounce, for one side of it.
struct GlassTables {
    /// `[fourth root of F0][roughness][cosine]`.
    directional: Box<[[[f32; COARSE]; COARSE]; COARSE]>,
    /// The mean over the hemisphere, weighted by the cosine, `[fourth root of F0][roughness]`.
    average: Box<[[f32; COARSE]; COARSE]>,
}

static GLASS_ENTERED: LazyLock<GlassTables> = LazyLock::new(|| GlassTables::new(false));
static GLASS_LEFT: LazyLock<GlassTables> = LazyLock::new(|| GlassTables::new(true));

/// Share of light that white glass, seen under this cosine, reflects and refracts in one bounce.
/// `ior` is the index beyond the surface over that on the viewer's side.
pub fn glass_albedo(ior: f32, roughness: f32, cos: f32) -> f32 {
    let (i, t) = cell::<COARSE>(f0_from_ior(ior).sqrt().sqrt());
    let at = |i: usize| bilinear(&glass_tables(ior).directional[i], roughness, cos);
    lerp(at(i), at(i + 1), t)
}

/// The mean of [`glass_albedo`] over the hemisphere, weighted by the cosine.
pub fn glass_average_albedo(ior: f32, roughness: f32) -> f32 {
    bilinear(
        &glass_tables(ior).average,
        f0_from_ior(ior).sqrt().sqrt(),
        roughness,
    )
}

fn glass_tables(ior: f32) -> &'static GlassTables {
    if ior < 1.0 {
        &GLASS_LEFT
    } else {
        &GLASS_ENTERED
    }
}

impl GlassTables {
    fn new(is_left: bool) -> Self {
        let mut directional = Box::new([[[0.0; COARSE]; COARSE]; COARSE]);
        let mut average = Box::new([[0.0; COARSE]; COARSE]);
        for (i, (table, means)) in directional.iter_mut().zip(average.iter_mut()).enumerate() {
            // Without a change of medium nothing is bent: the table's first entry is near it.
            let ior = ior_from_f0(axis::<COARSE>(i).clamp(0.02, 0.99).powi(4));
            let ior = if is_left { 1.0 / ior } else { ior };
            for (roughness, (row, mean)) in table.iter_mut().zip(means.iter_mut()).enumerate() {
                for (cos, entry) in row.iter_mut().enumerate() {
                    *entry = scattered(ior, axis::<COARSE>(roughness), axis::<COARSE>(cos));
                }
                *mean = cosine_mean(row);
            }
        }
        Self {
            directional,
            average,
        }
    }
}

/// The entry of the tables of glass, by sampling.
fn scattered(ior: f32, roughness: f32, cos: f32) -> f32 {
    let ggx = Ggx::isotropic(roughness * roughness);
    let wo = seen_under(cos);
    let mut sum = 0.0;
    for i in 0..GLASS_POINTS {
        let normal = ggx.sample_visible_normal(wo, hammersley(i, GLASS_POINTS));
        let cos_facet = wo.dot(normal).max(0.0);
        let reflectance = dielectric(cos_facet, ior);
        let share = |wi: Vec3A| ggx.masking_shadowing(wo, wi) / ggx.masking(wo);
        let reflected = 2.0 * cos_facet * normal - wo;
        if reflected.z > 0.0 {
            sum += reflectance * share(reflected);
        }
        let cos_squared = 1.0 - (1.0 - cos_facet * cos_facet) / (ior * ior);
        if cos_squared > 0.0 {
            let refracted = (cos_facet / ior - cos_squared.sqrt()) * normal - wo / ior;
            // Light that a facet refracts back up counts although the lobe drops it, as in the
            // tables of Cycles: rough glass stays a little dark from within.
            sum += (1.0 - reflectance) * share(refracted);
        }
    }
    (sum / GLASS_POINTS as f32).clamp(1e-3, 1.0)
}

impl Tables {
    fn new() -> Self {
        let mut tables = Self {
            directional: Box::new([[0.0; FINE]; FINE]),
            average: [0.0; FINE],
            schlick: Box::new([[0.0; COARSE]; COARSE]),
            dielectric: Box::new([[[0.0; COARSE]; COARSE]; COARSE]),
        };
        for roughness in 0..FINE {
            let row = &mut tables.directional[roughness];
            for (cos, entry) in row.iter_mut().enumerate() {
                *entry = reflected(axis::<FINE>(roughness), axis::<FINE>(cos));
            }
            tables.average[roughness] = cosine_mean(row);
        }
        tables.fill_curves();
        tables
    }

    fn fill_curves(&mut self) {
        let iors: [f32; COARSE] =
            std::array::from_fn(|i| ior_from_f0(axis::<COARSE>(i).min(0.99).powi(4)));
        for roughness in 0..COARSE {
            for cos in 0..COARSE {
                let (r, c) = (axis::<COARSE>(roughness), axis::<COARSE>(cos));
                let facets: Vec<f32> = visible_facets(r, c).map(|(facet, _)| facet).collect();
                let mean = |curve: Curve| {
                    facets.iter().map(|&cos| curve.at(cos)).sum::<f32>() / POINTS as f32
                };
                self.schlick[roughness][cos] = mean(Curve::Schlick);
                for (table, &ior) in self.dielectric.iter_mut().zip(&iors) {
                    table[roughness][cos] = mean(Curve::Dielectric { ior });
                }
            }
        }
    }
}

/// (cosine between view and microfacet, shadowing given masking) of the microfacets that are seen
/// under `cos` and reflect upwards, out of [`POINTS`].
fn visible_facets(roughness: f32, cos: f32) -> impl Iterator<Item = (f32, f32)> {
    let ggx = Ggx::isotropic(roughness * roughness);
    let wo = seen_under(cos);
    (0..POINTS).filter_map(move |i| {
        let normal = ggx.sample_visible_normal(wo, hammersley(i, POINTS));
        let cos_facet = wo.dot(normal).max(0.0);
        let wi = 2.0 * cos_facet * normal - wo;
        let shadowing = || ggx.masking_shadowing(wo, wi) / ggx.masking(wo);
        (wi.z > 0.0).then(|| (cos_facet, shadowing()))
    })
}

/// Point `i` of `count` well-spread ones in the unit square.
fn hammersley(i: u32, count: u32) -> [f32; 2] {
    let radical_inverse = (i.reverse_bits() >> 8) as f32 / (1u32 << 24) as f32;
    [(i as f32 + 0.5) / count as f32, radical_inverse]
}

fn seen_under(cos: f32) -> Vec3A {
    Vec3A::new((1.0 - cos * cos).sqrt(), 0.0, cos)
}

fn reflected(roughness: f32, cos: f32) -> f32 {
    let sum: f32 = visible_facets(roughness, cos).map(|(_, share)| share).sum();
    (sum / POINTS as f32).min(1.0)
}

/// `2 int cos f(cos) dcos` of a function that is linear between its entries.
fn cosine_mean<const N: usize>(row: &[f32; N]) -> f32 {
    let step = 1.0 / (N - 1) as f32;
    let mut sum = 0.0;
    for (i, pair) in row.windows(2).enumerate() {
        let left = i as f32 * step;
        let middle = 4.0 * (left + 0.5 * step) * 0.5 * (pair[0] + pair[1]);
        sum += step / 6.0 * (left * pair[0] + middle + (left + step) * pair[1]); // Simpson: exact
    }
    (2.0 * sum).min(1.0)
}

/// Value of an axis at its entry `i`.
fn axis<const N: usize>(i: usize) -> f32 {
    (i as f32 / (N - 1) as f32).max(AXIS_MIN)
}

/// Entry below `x` and how far `x` lies towards the next one.
fn cell<const N: usize>(x: f32) -> (usize, f32) {
    let scaled = x.clamp(0.0, 1.0) * (N - 1) as f32;
    let i = (scaled as usize).min(N - 2);
    (i, scaled - i as f32)
}

fn bilinear<const N: usize>(table: &[[f32; N]; N], x: f32, y: f32) -> f32 {
    let ((i, s), (j, t)) = (cell::<N>(x), cell::<N>(y));
    lerp(
        lerp(table[i][j], table[i][j + 1], t),
        lerp(table[i + 1][j], table[i + 1][j + 1], t),
        s,
    )
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + t * (b - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_reflects_all() {
        for cos in [0.05, 0.3, 1.0] {
            assert!((directional_albedo(0.0, cos) - 1.0).abs() < 1e-3);
        }
    }

    /// The reflectance integrated over the hemisphere in the plain way, which neither the sampler
    /// nor the ratio of masking functions enters.
    #[test]
    fn directional_albedo_is_the_integral_of_the_lobe() {
        for (roughness, cos) in [(0.5f32, 0.8f32), (0.7, 0.3), (1.0, 1.0), (1.0, 0.5)] {
            let ggx = Ggx::isotropic(roughness * roughness);
            let wo = seen_under(cos);
            let steps = 1000;
            let mut sum = 0.0;
            for (i, j) in (0..steps * steps).map(|k| (k / steps, k % steps)) {
                let z = (i as f32 + 0.5) / steps as f32;
                let (y, x) = ((j as f32 + 0.5) / steps as f32 * std::f32::consts::TAU).sin_cos();
                let around = (1.0 - z * z).sqrt();
                let wi = Vec3A::new(around * x, around * y, z);
                let lobe = ggx.distribution((wo + wi).normalize()) * ggx.masking_shadowing(wo, wi)
                    / (4.0 * cos);
                sum += f64::from(lobe);
            }
            let integral = sum / f64::from(steps * steps) * std::f64::consts::TAU;
            let table = f64::from(directional_albedo(roughness, cos));
            assert!(
                (table - integral).abs() < 2e-3,
                "{roughness} {cos}: {table} {integral}"
            );
        }
    }

    #[test]
    fn average_is_the_cosine_mean_of_the_directional_albedo() {
        let steps = 1000;
        for roughness in [0.2, 0.6, 1.0] {
            let mean: f32 = (0..steps)
                .map(|i| (i as f32 + 0.5) / steps as f32)
                .map(|cos| 2.0 * cos * directional_albedo(roughness, cos) / steps as f32)
                .sum();
            assert!((mean - average_albedo(roughness)).abs() < 1e-3);
        }
    }

    #[test]
    fn mean_curve_of_a_mirror_is_the_curve() {
        for curve in [Curve::Schlick, Curve::Dielectric { ior: 1.5 }] {
            for cos in [0.2f32, 0.6, 1.0] {
                let grid = mean_curve(curve, 0.0, cos);
                assert!(
                    (grid - curve.at(cos)).abs() < 0.01,
                    "{curve:?} {cos}: {grid}"
                );
            }
        }
    }
}
