//! For tests: an independent source of random numbers and Pearson's chi-square test of a sampler
//! against its density.

use std::f64::consts::TAU;

use glam::Vec3A;

use super::Frame;

/// Largest standard score that a chi-square test may have.
///
/// One-sided error rate 5e-6 a test; there are fewer than 200 of them, so a correct program fails
/// the whole suite with probability below 1e-3 (Bonferroni). Seeds are fixed and were not chosen.
pub(crate) const MAX_SCORE: f64 = 4.42;

/// PCG-RXS-M-XS-like generator: independent of the sequences under test.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u32 << 24) as f32
    }

    /// Uniform in the unit square.
    pub(crate) fn next_2d(&mut self) -> [f32; 2] {
        [self.next(), self.next()]
    }
}

/// Standard score of Pearson's statistic of `observed` against `expected` counts; cells that
/// expect fewer than five are pooled.
///
/// The cube root of a chi-square variable is nearly normal (Wilson and Hilferty 1931).
pub(crate) fn chi_square_score(observed: &[f64], expected: &[f64]) -> f64 {
    let (mut statistic, mut cells) = (0.0, 0.0);
    let mut pool = (0.0, 0.0);
    let mut add = |o: f64, e: f64| {
        statistic += (o - e) * (o - e) / e;
        cells += 1.0;
    };
    for (&o, &e) in observed.iter().zip(expected) {
        if e >= 5.0 {
            add(o, e);
        } else {
            pool = (pool.0 + o, pool.1 + e);
        }
    }
    if pool.1 >= 5.0 {
        add(pool.0, pool.1);
    } else if pool.0 > 40.0 {
        return f64::INFINITY; // samples where the density says there are almost none
    }
    let freedom: f64 = cells - 1.0;
    assert!(freedom >= 10.0, "too few cells to test: {cells}");
    let spread = 2.0 / (9.0 * freedom);
    ((statistic / freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
}

/// A chi-square test of directions over a grid in (cosine, angle) about an axis.
pub(crate) struct DirectionTest {
    /// Axis of the grid.
    pub axis: Vec3A,
    /// The grid covers cosines from here to 1; what lies outside is one cell.
    pub one_minus_cos_max: f64,
    /// Number of samples.
    pub samples: u32,
    /// The density is integrated with this many points a side of each cell.
    pub quadrature: u32,
}

const RINGS: usize = 16;
const SECTORS: usize = 24;
/// What the quadrature may miss of a density with edges.
const QUADRATURE_ERROR: f64 = 0.01;

impl DirectionTest {
    /// The whole sphere about `axis`.
    pub(crate) fn sphere(axis: Vec3A) -> Self {
        Self {
            axis,
            one_minus_cos_max: 2.0,
            samples: 200_000,
            quadrature: 12,
        }
    }

    /// Standard score of `sample` against `pdf`; a sampler may give up (`None`), which must happen
    /// as often as its density integrates to less than one.
    pub(crate) fn score(
        &self,
        mut sample: impl FnMut(&mut Random) -> Option<Vec3A>,
        pdf: impl Fn(Vec3A) -> f32,
    ) -> f64 {
        let mut observed = vec![0.0; RINGS * SECTORS + 1];
        let mut random = Random::new(1);
        for _ in 0..self.samples {
            let cell = sample(&mut random).map_or(RINGS * SECTORS, |d| self.cell(d));
            observed[cell] += 1.0;
        }
        let mut expected: Vec<f64> = (0..RINGS * SECTORS)
            .map(|cell| self.integral(cell, &pdf) * f64::from(self.samples))
            .collect();
        let samples = f64::from(self.samples);
        let inside: f64 = expected.iter().sum();
        let given_up = observed[RINGS * SECTORS];
        if (inside / samples - 1.0).abs() < QUADRATURE_ERROR
            && given_up < QUADRATURE_ERROR * samples
        {
            // All of the density is in the grid; what is missing, the quadrature lost at edges.
            let scale = (samples - given_up) / inside;
            expected.iter_mut().for_each(|e| *e *= scale);
            observed.pop();
        } else {
            let rest = samples - inside;
            assert!(rest > 0.0, "the density integrates to {}", inside / samples);
            expected.push(rest);
        }
        chi_square_score(&observed, &expected)
    }

    fn cell(&self, direction: Vec3A) -> usize {
        let local = Frame::from_normal(self.axis).to_local(direction);
        // 1 - cos from the chord, exact for tiny angles.
        let one_minus_cos = f64::from((direction - self.axis).length_squared()) / 2.0;
        let ring = (one_minus_cos / self.one_minus_cos_max * RINGS as f64) as usize;
        let turn = f64::from(local.y.atan2(local.x)) / TAU;
        let sector = ((turn - turn.floor()) * SECTORS as f64) as usize;
        if ring < RINGS {
            ring * SECTORS + sector.min(SECTORS - 1)
        } else if self.one_minus_cos_max >= 2.0 {
            (RINGS - 1) * SECTORS + sector.min(SECTORS - 1)
        } else {
            RINGS * SECTORS
        }
    }

    fn integral(&self, cell: usize, pdf: impl Fn(Vec3A) -> f32) -> f64 {
        let frame = Frame::from_normal(self.axis);
        let (ring, sector) = ((cell / SECTORS) as f64, (cell % SECTORS) as f64);
        let steps = self.quadrature;
        let mut sum = 0.0;
        for i in 0..steps {
            for j in 0..steps {
                let middle = |k: u32| (f64::from(k) + 0.5) / f64::from(steps);
                let one_minus_cos = (ring + middle(i)) / RINGS as f64 * self.one_minus_cos_max;
                let sin = (one_minus_cos * (2.0 - one_minus_cos)).sqrt();
                let (y, x) = ((sector + middle(j)) / SECTORS as f64 * TAU).sin_cos();
                let local = Vec3A::new(
                    (sin * x) as f32,
                    (sin * y) as f32,
                    (1.0 - one_minus_cos) as f32,
                );
                sum += f64::from(pdf(frame.to_world(local)));
            }
        }
        let cell_solid_angle = TAU * self.one_minus_cos_max / (RINGS * SECTORS) as f64;
        sum / f64::from(steps * steps) * cell_solid_angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fair_die_passes_and_a_loaded_one_does_not() {
        let mut random = Random::new(3);
        let mut observed = vec![0.0; 60];
        for _ in 0..60_000 {
            observed[(random.next() * 60.0) as usize] += 1.0;
        }
        let fair = vec![1000.0; 60];
        assert!(chi_square_score(&observed, &fair) < MAX_SCORE);
        let loaded: Vec<f64> = (0..60)
            .map(|i| if i < 30 { 960.0 } else { 1040.0 })
            .collect();
        assert!(chi_square_score(&observed, &loaded) > MAX_SCORE);
    }
}
