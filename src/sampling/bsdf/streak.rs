//! The gleam of a thread: light that it mirrors or lets pass in a cone about itself, as far from its
//! axis as the viewer.
//!
//! Blender's Hair BSDF, as Cycles has it: Cauchy's distribution of the angle along the thread, which
//! it also has around it for light that passes; mirrored light is spread by a cosine.
//!
//! Directions are in the basis of [`super::fibre`].
//!
//! # Departures from Cycles
//! Cycles checks the side of the surface and right angles about the viewer for light samples alone.
//! Here light of a strand stays within a right angle of the viewer, or of straight on, whatever finds
//! it, and its sides are not asked for; those of a mesh are.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3A;

use super::{Part, Scattered};

/// A thread seen from a fixed direction.
#[derive(Debug, Clone, Copy)]
pub struct Streak {
    pub weight: Vec3A,
    /// The surface's normal: light is mirrored above it and passes below; zero for strands.
    normal: Vec3A,
    /// Width along and around the thread.
    widths: [f32; 2],
    /// By how much the cone is turned towards the root [rad].
    offset: f32,
    passes: bool,
}

/// Within this angle of the thread's own direction it is black [rad].
const ALONG: f32 = 1e-3;

impl Streak {
    /// A thread of Blender's widths, 0 to 1 each.
    pub fn new(weight: Vec3A, normal: Vec3A, widths: [f32; 2], offset: f32, passes: bool) -> Self {
        Self {
            weight,
            normal,
            widths: widths.map(|width| width.clamp(1e-3, 1.0)),
            offset,
            passes,
        }
    }

    /// The ends of the angle between the cone and the halfway direction, as Cauchy's distribution
    /// sees them.
    fn ends(&self, theta_o: f32) -> [f32; 2] {
        [-FRAC_PI_2, FRAC_PI_2]
            .map(|end| (((end + theta_o) * 0.5 - self.offset) / self.widths[0]).atan())
    }

    /// Density [1/rad] of an azimuth from the viewer.
    fn pdf_around(&self, azimuth: f32) -> f32 {
        let width = self.widths[1];
        if self.passes {
            let rest = PI - azimuth.abs();
            let density =
                width / (2.0 * (FRAC_PI_2 / width).atan() * (rest * rest + width * width));
            return if rest <= FRAC_PI_2 { density } else { 0.0 };
        }
        let is_near = azimuth.abs() < width * PI && azimuth.abs() <= FRAC_PI_2;
        if is_near {
            (0.5 * azimuth / width).cos() * 0.25 / width
        } else {
            0.0
        }
    }

    /// `f cos` [1/sr] and the density of [`Streak::sample`] [1/sr].
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> Option<Scattered> {
        let (theta_o, theta) = (wo.x.clamp(-1.0, 1.0).asin(), wi.x.clamp(-1.0, 1.0).asin());
        let is_below = self.normal.dot(wi) < 0.0;
        let is_on_side = self.normal == Vec3A::ZERO || is_below == self.passes;
        if FRAC_PI_2 - theta.abs() < ALONG || !is_on_side {
            return None;
        }
        let [low, high] = self.ends(theta_o);
        let (from_cone, width) = (0.5 * (theta + theta_o) - self.offset, self.widths[0]);
        let cauchy = width / (2.0 * (from_cone * from_cone + width * width) * (high - low));
        let pdf_solid_angle = cauchy / theta.cos() * self.pdf_around(wi.y.atan2(wi.z));
        (pdf_solid_angle > 0.0).then_some(Scattered {
            part: self.part(),
            value: self.weight * pdf_solid_angle,
            pdf_solid_angle,
        })
    }

    /// What its light counts to.
    pub fn part(&self) -> Part {
        if self.passes {
            Part::Transmission
        } else {
            Part::Glossy
        }
    }

    /// A unit direction; none where it is black.
    pub fn sample(&self, wo: Vec3A, u: [f32; 2]) -> Option<Vec3A> {
        let theta_o = wo.x.clamp(-1.0, 1.0).asin();
        let [low, high] = self.ends(theta_o);
        let from_cone = self.widths[0] * (u[0] * (high - low) + low).tan();
        let theta = 2.0 * (from_cone + self.offset) - theta_o;
        let width = self.widths[1];
        let azimuth = if self.passes {
            PI + width * (2.0 * (FRAC_PI_2 / width).atan() * (u[1] - 0.5)).tan()
        } else {
            2.0 * (1.0 - 2.0 * u[1]).asin() * width
        };
        let ((x, across), (y, z)) = (theta.sin_cos(), azimuth.sin_cos());
        let wi = Vec3A::new(x, across * y, across * z);
        self.eval(wo, wi).map(|_| wi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::{DirectionTest, MAX_SCORE};

    #[test]
    fn directions_follow_their_density() {
        for passes in [false, true] {
            for (theta, widths) in [(0.0f32, [0.3, 0.3]), (0.7, [0.5, 0.2]), (-1.0, [0.8, 0.9])] {
                let wo = Vec3A::new(theta.sin(), 0.0, theta.cos());
                let normal = Vec3A::new(0.0, 0.4, 0.84).normalize();
                let streak = Streak::new(Vec3A::ONE, normal, widths, 0.1, passes);
                // Not about the thread, where the density has poles.
                let test = DirectionTest {
                    quadrature: 96,
                    ..DirectionTest::sphere(Vec3A::Z)
                };
                let score = test.score(
                    |random| streak.sample(wo, random.next_2d()),
                    |wi| {
                        streak
                            .eval(wo, wi)
                            .map_or(0.0, |found| found.pdf_solid_angle)
                    },
                );
                assert!(score < MAX_SCORE, "{passes} {theta} {widths:?}: {score}");
            }
        }
    }

    #[test]
    fn a_thin_thread_mirrors_all_light_and_to_the_other_end() {
        let wo = Vec3A::new(0.6, 0.0, 0.8);
        let streak = Streak::new(Vec3A::ONE, Vec3A::Z, [0.01, 0.2], 0.0, false);
        let found = streak.sample(wo, [0.5, 0.5]).unwrap();
        assert!((found.x + 0.6).abs() < 0.02, "{found}");
        let (mut sum, steps) = (0.0f64, 400);
        for i in 0..steps {
            for j in 0..steps {
                let middle = |k: i32| (f64::from(k) + 0.5) / f64::from(steps) - 0.5;
                let (theta, azimuth) = (
                    (middle(i) * std::f64::consts::PI) as f32,
                    (middle(j) * std::f64::consts::TAU) as f32,
                );
                let ((x, across), (y, z)) = (theta.sin_cos(), azimuth.sin_cos());
                let wi = Vec3A::new(x, across * y, across * z);
                let value = streak.eval(wo, wi).map_or(0.0, |found| found.value.x);
                sum += f64::from(value * across);
            }
        }
        let area = 2.0 * std::f64::consts::PI.powi(2) / f64::from(steps * steps);
        assert!((sum * area - 1.0).abs() < 0.01, "{}", sum * area);
    }
}
