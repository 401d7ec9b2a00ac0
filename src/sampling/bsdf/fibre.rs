//! A hair as a rough cylinder of tinted glass.
//!
//! Source: Chiang, Bitterli, Tappan and Burley, "A Practical and Controllable Hair and Fur Model for
//! Production Path Tracing", 2016, after Marschner et al. 2003 and d'Eon et al. 2011. Light is
//! mirrored (R), passes (TT), is mirrored once inside (TRT), or more often; each of these is a share
//! of the light times a longitudinal density times an azimuthal one.
//!
//! Directions are in a basis whose x axis runs along the hair and whose z axis is across it on the
//! viewer's side: the viewer is at azimuth zero, and an azimuth is the angle from z towards y.
//!
//! # Departures from Cycles
//! Bessel's function is that of Abramowitz and Stegun at all widths. Mirrored light is drawn with
//! the coat's own width, which its density has in Cycles too.

use std::f32::consts::{PI, TAU};

use glam::Vec3A;

use super::{Part, Scattered};
use crate::math::luminance;
use crate::optics::fresnel::dielectric;

/// What a hair is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hair {
    /// Absorption per radius of the hair.
    pub sigma: Vec3A,
    /// Blender's roughness along the hair, 0 to 1.
    pub roughness: f32,
    /// The same around it.
    pub radial_roughness: f32,
    /// By how much mirrored light is less rough, 0 to 1.
    pub coat: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Tilt of the scales that cover it, towards the root [rad].
    pub tilt: f32,
}

impl Hair {
    /// The absorption that gives many hairs a colour (Chiang et al., equation 9).
    pub fn absorption_of(color: Vec3A, radial_roughness: f32) -> Vec3A {
        let scale = albedo_scale(radial_roughness);
        let root = |c: f32| c.max(1e-30).ln() / scale;
        let root = Vec3A::from(color.to_array().map(root));
        root * root
    }

    /// The absorption of an amount of melanin, 0 to 1 as the eye judges it, of which `redness` is
    /// pheomelanin (d'Eon et al. 2011, with Bitterli's scale of amounts).
    pub fn absorption_of_melanin(amount: f32, redness: f32) -> Vec3A {
        const EUMELANIN: Vec3A = Vec3A::new(0.506, 0.841, 1.653);
        const PHEOMELANIN: Vec3A = Vec3A::new(0.343, 0.733, 1.924);
        let concentration = -(1.0 - amount).max(1e-4).ln();
        concentration * EUMELANIN.lerp(PHEOMELANIN, redness)
    }
}

/// Ways through the hair that are told apart; the last one takes all that are longer.
const WAYS: usize = 4;

/// A hair seen from a fixed direction.
#[derive(Debug, Clone, Copy)]
pub struct Fibre {
    /// Shares of the light, weight included, red, green and blue.
    shares: [[f32; 3]; WAYS],
    /// Longitudinal variances of R and, before its factor, of the other ways.
    variances: [f32; 2],
    /// Scale of the azimuthal logistic distribution.
    scale: f32,
    tilt: f32,
    /// Angles to the hair's normal outside and inside, in the plane across the hair [rad].
    gammas: [f32; 2],
}

/// The narrowest roughness; Cycles has the same.
const ROUGHNESS_MIN: f32 = 1e-3;

/// Longitudinal variance of a roughness (Chiang et al., equation 7).
fn variance_of(roughness: f32) -> f32 {
    let x = roughness.clamp(ROUGHNESS_MIN, 1.0);
    let root = 0.726 * x + 0.812 * x * x + 3.7 * x.powi(20);
    root * root
}

/// Azimuthal scale of a roughness (the same, equation 8).
fn scale_of(roughness: f32) -> f32 {
    let x = roughness.clamp(ROUGHNESS_MIN, 1.0);
    (PI / 8.0).sqrt() * (0.265 * x + 1.194 * x * x + 5.372 * x.powi(22))
}

fn cos_of(sin: f32) -> f32 {
    (1.0 - sin * sin).max(0.0).sqrt()
}

impl Fibre {
    /// A hair that the viewer's ray meets at `h`, from -1 to 1 across it, and the colour by which
    /// passes divide its light.
    pub fn new(weight: Vec3A, hair: &Hair, wo: Vec3A, h: f32) -> (Self, Vec3A) {
        let (h, ior) = (h.clamp(-1.0, 1.0), hair.ior.max(1e-3));
        let (sin, cos) = (wo.x, cos_of(wo.x));
        let sin_inside = (sin / ior).clamp(-1.0, 1.0);
        // Bravais: in the plane across, the index looks larger from aslant.
        let sin_gamma = h * cos / (ior * ior - sin * sin).max(1e-6).sqrt();
        let sin_gamma = sin_gamma.clamp(-1.0, 1.0);
        let mirrored = dielectric(cos * cos_of(h), ior);
        let length = 2.0 * cos_of(sin_gamma) / cos_of(sin_inside).max(1e-6);
        let fibre = Self {
            shares: shares(mirrored, (-hair.sigma * length).exp())
                .map(|share| (weight * share).into()),
            variances: [
                variance_of((1.0 - hair.coat.clamp(0.0, 1.0)) * hair.roughness),
                variance_of(hair.roughness),
            ],
            scale: scale_of(hair.radial_roughness),
            tilt: hair.tilt,
            gammas: [h.asin(), sin_gamma.asin()],
        };
        let root = Vec3A::from(hair.sigma.to_array().map(f32::sqrt));
        let passing = (-root * albedo_scale(fibre.variances[1])).exp();
        (fibre, weight * (passing + mirrored))
    }

    /// Multiplies all that it scatters by a colour.
    pub fn tint(&mut self, color: Vec3A) {
        self.shares = self.shares.map(|share| (color * Vec3A::from(share)).into());
    }

    /// Takes up the light of another one, but keeps its own shape.
    pub fn absorb(&mut self, other: &Self) {
        for (own, other) in self.shares.iter_mut().zip(other.shares) {
            *own = (Vec3A::from(*own) + Vec3A::from(other)).into();
        }
    }

    /// Widens it to at least this roughness, as Cycles does it.
    pub fn widen(&mut self, roughness: f32) {
        self.variances = self.variances.map(|variance| variance.max(roughness));
        self.scale = self.scale.max(roughness);
    }

    /// Probabilities of the ways.
    fn probabilities(&self) -> [f32; WAYS] {
        let lights = self.shares.map(|share| luminance(share.into()));
        let sum: f32 = lights.iter().sum();
        lights.map(|light| if sum > 0.0 { light / sum } else { 0.0 })
    }

    /// Longitudinal variance of a way.
    fn variance(&self, way: usize) -> f32 {
        match way {
            0 => self.variances[0],
            1 => 0.25 * self.variances[1],
            _ => 4.0 * self.variances[1],
        }
    }

    /// The viewer's angle above the plane across the hair, as the tilted scales turn it for a way.
    fn tilted(&self, wo: Vec3A, way: usize) -> f32 {
        let turns = [2.0, -1.0, -4.0, 0.0][way];
        let (sin, cos) = (wo.x.asin() + turns * self.tilt).sin_cos();
        sin.atan2(cos.abs())
    }

    /// Azimuth of a way through an even cylinder; none for the longest ones, which go everywhere.
    fn azimuth(&self, way: usize) -> Option<f32> {
        let [outside, inside] = self.gammas;
        let turn = way as f32;
        (way + 1 < WAYS).then_some(2.0 * outside - turn * (2.0 * inside + PI))
    }

    /// `f cos` [1/sr] and the density of [`Fibre::sample`] [1/sr]. All of it counts as glossy.
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> Scattered {
        let (theta, azimuth) = (wi.x.clamp(-1.0, 1.0).asin(), wi.y.atan2(wi.z));
        let (mut value, mut pdf_solid_angle) = (Vec3A::ZERO, 0.0);
        for (way, probability) in self.probabilities().into_iter().enumerate() {
            let around = match self.azimuth(way) {
                Some(mean) => pdf_logistic(wrapped(azimuth - mean), self.scale),
                None => 1.0 / TAU,
            };
            let density = around * pdf_along(theta, self.tilted(wo, way), self.variance(way));
            value += Vec3A::from(self.shares[way]) * density;
            pdf_solid_angle += probability * density;
        }
        Scattered {
            part: Part::Glossy,
            value,
            pdf_solid_angle,
        }
    }

    /// The way that a number draws, and what is left of the number.
    fn choose(&self, mut u: f32) -> (usize, f32) {
        let probabilities = self.probabilities();
        let mut chosen = (0, 0.0);
        for (way, probability) in probabilities.into_iter().enumerate() {
            if probability > 0.0 {
                // Rounding may leave a rest behind the last way.
                chosen = (way, (u / probability).min(1.0));
                if u < probability {
                    break;
                }
            }
            u -= probability;
        }
        chosen
    }

    /// Whether the number that chooses a way draws one through the hair.
    pub fn passes(&self, u_choice: f32) -> bool {
        self.choose(u_choice).0 > 0
    }

    /// A unit direction.
    pub fn sample(&self, wo: Vec3A, u_choice: f32, u: [f32; 2]) -> Vec3A {
        let (way, rest) = self.choose(u_choice);
        let sin = sample_along(self.tilted(wo, way), self.variance(way), [rest, u[1]]);
        let azimuth = match self.azimuth(way) {
            Some(mean) => mean + sample_logistic(self.scale, u[0]),
            None => TAU * u[0],
        };
        let (y, z) = azimuth.sin_cos();
        let cos = cos_of(sin);
        Vec3A::new(sin, cos * y, cos * z)
    }
}

/// Shares of white light that take each way, of which `mirrored` is turned back at each wall and
/// `passed` is left after each crossing.
fn shares(mirrored: f32, passed: Vec3A) -> [Vec3A; WAYS] {
    let through = (1.0 - mirrored) * (1.0 - mirrored) * passed;
    let back = through * passed * mirrored;
    // The sum of a geometric series.
    let rest = 1.0 - passed * mirrored;
    let longer = back * passed * mirrored / rest.max(Vec3A::splat(f32::MIN_POSITIVE));
    [Vec3A::splat(mirrored), through, back, longer]
}

/// By which the root of the absorption becomes the exponent of the albedo of many hairs, as a fit to
/// simulations (Chiang et al., equation 9).
fn albedo_scale(radial_roughness: f32) -> f32 {
    let x = radial_roughness;
    (((((0.245 * x) + 5.574) * x - 10.73) * x + 2.532) * x - 0.215) * x + 5.969
}

/// `exp(-x) I0(x)` for x >= 0, I0 being Bessel's modified function of order zero: Abramowitz and
/// Stegun, 9.8.1 and 9.8.2, good to seven digits.
fn bessel_i0_scaled(x: f32) -> f32 {
    let series = |t: f32, terms: &[f32]| terms.iter().rev().fold(0.0, |sum, term| sum * t + term);
    if x < 3.75 {
        let t = x / 3.75;
        let terms = [
            1.0,
            3.515_623,
            3.089_942_4,
            1.206_749_2,
            0.265_973_2,
            0.036_076_8,
            0.004_581_3,
        ];
        return (-x).exp() * series(t * t, &terms);
    }
    let terms = [
        0.398_942_3,
        0.013_285_92,
        0.002_253_19,
        -0.001_575_65,
        0.009_162_81,
        -0.020_577_06,
        0.026_355_37,
        -0.016_476_33,
        0.003_923_77,
    ];
    series(3.75 / x, &terms) / x.sqrt()
}

/// Density over the sphere, up to the azimuth, of the angle `theta` above the plane across a hair, for
/// light that comes from `theta_o` (d'Eon et al. 2011, equation 7). Both are in [-pi/2, pi/2].
fn pdf_along(theta: f32, theta_o: f32, variance: f32) -> f32 {
    let inverse = 1.0 / variance;
    let x = theta.cos() * theta_o.cos() * inverse;
    // cos(theta + theta_o) - 1, which keeps its digits in narrow lobes.
    let half = (0.5 * (theta + theta_o)).sin();
    let exponent = -2.0 * half * half * inverse;
    bessel_i0_scaled(x.max(0.0)) * exponent.exp() * inverse / -(-2.0 * inverse).exp_m1()
}

/// The sine of an angle drawn with [`pdf_along`].
fn sample_along(theta_o: f32, variance: f32, [u, turn]: [f32; 2]) -> f32 {
    let u = u.max(1e-6);
    let rest = -variance * (u + (1.0 - u) * (-2.0 / variance).exp()).ln();
    let rest = rest.clamp(0.0, 2.0);
    let (sin, cos) = theta_o.sin_cos();
    let across = (rest * (2.0 - rest)).sqrt() * (TAU * turn).cos();
    ((rest - 1.0) * sin + across * cos).clamp(-1.0, 1.0)
}

/// The angle in [-pi, pi].
fn wrapped(angle: f32) -> f32 {
    angle - TAU * ((angle + PI) / TAU).floor()
}

/// Share of the logistic distribution below -pi.
fn below_pi(scale: f32) -> f32 {
    1.0 / (1.0 + (PI / scale).exp())
}

/// Density [1/rad] of the logistic distribution, cut off at -pi and pi.
fn pdf_logistic(angle: f32, scale: f32) -> f32 {
    let e = (-angle.abs() / scale).exp();
    e / (scale * (1.0 + e) * (1.0 + e) * (1.0 - 2.0 * below_pi(scale)))
}

/// An angle drawn with that density.
fn sample_logistic(scale: f32, u: f32) -> f32 {
    let below = below_pi(scale);
    let share = below + u * (1.0 - 2.0 * below);
    (-scale * (1.0 / share - 1.0).ln()).clamp(-PI, PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::{DirectionTest, MAX_SCORE, Random};

    const GLASS: Hair = Hair {
        sigma: Vec3A::ZERO,
        roughness: 0.3,
        radial_roughness: 0.3,
        coat: 0.0,
        ior: 1.55,
        tilt: 0.035,
    };

    /// A hair of these roughnesses, coat and absorption under an angle, met at `h`.
    fn seen(roughnesses: [f32; 2], coat: f32, sigma: f32, theta: f32, h: f32) -> (Fibre, Vec3A) {
        let hair = Hair {
            sigma: Vec3A::new(0.3, 0.7, 1.5) * sigma,
            roughness: roughnesses[0],
            radial_roughness: roughnesses[1],
            coat,
            ..GLASS
        };
        let wo = Vec3A::new(theta.sin(), 0.0, theta.cos());
        (Fibre::new(Vec3A::ONE, &hair, wo, h).0, wo)
    }

    const ANGLES: [f32; 4] = [0.0, -0.4, 0.9, 1.3];
    const PLACES: [f32; 4] = [0.0, 0.5, -0.8, 0.99];

    #[test]
    fn the_ways_share_white_light_without_loss() {
        for mirrored in [0.0, 0.05, 0.5, 0.99, 1.0] {
            let sum: Vec3A = shares(mirrored, Vec3A::ONE).into_iter().sum();
            assert!((sum - Vec3A::ONE).abs().max_element() < 1e-5, "{sum}");
        }
    }

    #[test]
    fn bessels_function_is_the_mean_of_exponentials_over_a_circle() {
        for x in [0.0f64, 0.5, 2.0, 3.7, 3.8, 10.0, 100.0, 3000.0] {
            let steps = 20_000;
            let angle = |i: i32| std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(steps);
            let sum: f64 = (0..steps).map(|i| (x * (angle(i).cos() - 1.0)).exp()).sum();
            let expected = sum / f64::from(steps);
            let found = f64::from(bessel_i0_scaled(x as f32));
            assert!(
                (found / expected - 1.0).abs() < 2e-6,
                "{x}: {found} {expected}"
            );
        }
    }

    /// Five standard deviations: error rate 6e-7 for each of 64 comparisons.
    #[test]
    fn clear_hair_in_a_white_furnace_is_invisible() {
        for roughness in [0.1, 0.3, 0.6, 1.0] {
            for theta in ANGLES {
                for h in PLACES {
                    let (fibre, wo) = seen([roughness, roughness], 0.5, 0.0, theta, h);
                    let mut random = Random::new(4);
                    let (mut sum, mut squares, samples) = (0.0, 0.0, 20_000);
                    for _ in 0..samples {
                        // Evenly over the sphere: a fair judge of what the sampler may hide.
                        let wi = crate::math::warp::sample_sphere(random.next_2d());
                        let value =
                            f64::from(fibre.eval(wo, wi).value.x) * 4.0 * std::f64::consts::PI;
                        sum += value;
                        squares += value * value;
                    }
                    let mean = sum / f64::from(samples);
                    let variance = squares / f64::from(samples) - mean * mean;
                    let error = (variance / f64::from(samples)).sqrt();
                    assert!(
                        (mean - 1.0).abs() < 5.0 * error + 1e-3,
                        "{roughness} {theta} {h}: {mean} +- {error}"
                    );
                }
            }
        }
    }

    #[test]
    fn directions_follow_their_density() {
        for (roughnesses, coat) in [([0.3, 0.3], 0.0), ([0.5, 0.9], 0.4), ([1.0, 0.2], 0.0)] {
            for (theta, h) in ANGLES.into_iter().zip(PLACES) {
                let (fibre, wo) = seen(roughnesses, coat, 0.4, theta, h);
                let test = DirectionTest {
                    quadrature: 24,
                    ..DirectionTest::sphere(Vec3A::X)
                };
                let score = test.score(
                    |random| Some(fibre.sample(wo, random.next(), random.next_2d())),
                    |wi| fibre.eval(wo, wi).pdf_solid_angle,
                );
                assert!(score < MAX_SCORE, "{roughnesses:?} {theta} {h}: {score}");
            }
        }
    }

    #[test]
    fn a_narrow_hair_mirrors_as_a_cylinder_does() {
        // Its normal at h is (0, h, sqrt(1 - h^2)): without tilt light comes from the mirror.
        for (theta, h) in [(0.0f32, 0.3f32), (0.5, -0.6), (-0.8, 0.9)] {
            let hair = Hair {
                sigma: Vec3A::splat(1e3),
                roughness: 0.01,
                radial_roughness: 0.01,
                tilt: 0.0,
                ..GLASS
            };
            let wo = Vec3A::new(theta.sin(), 0.0, theta.cos());
            let (fibre, _) = Fibre::new(Vec3A::ONE, &hair, wo, h);
            let normal = Vec3A::new(0.0, h, cos_of(h));
            let mirror = 2.0 * normal.dot(wo) * normal - wo;
            let found = fibre.sample(wo, 0.5, [0.5, 0.25]);
            assert!((found - mirror).length() < 0.02, "{found} {mirror}");
        }
    }

    #[test]
    fn extreme_hair_stays_finite() {
        for roughness in [0.0, 1e-3, 1.0, 7.0] {
            for ior in [0.0, 1.0, 1.55, 50.0] {
                for h in [-1.0, 0.0, 1.0] {
                    for x in [-1.0f32, 0.0, 0.999_999, 1.0] {
                        let wo = Vec3A::new(x, 0.0, cos_of(x).max(1e-6));
                        let hair = Hair {
                            sigma: Vec3A::new(0.0, 1.0, f32::MAX),
                            roughness,
                            radial_roughness: roughness,
                            coat: 1.0,
                            ior,
                            tilt: 1.5,
                        };
                        let (fibre, color) = Fibre::new(Vec3A::ONE, &hair, wo, h);
                        let wi = fibre.sample(wo, 0.7, [0.3, 0.6]);
                        let found = fibre.eval(wo, wi);
                        let is_finite = found.value.is_finite()
                            && found.pdf_solid_angle.is_finite()
                            && wi.is_finite()
                            && color.is_finite();
                        assert!(is_finite, "{roughness} {ior} {h} {x}: {found:?} {wi}");
                    }
                }
            }
        }
    }
}
