//! Pixel filters, sampled by importance: a camera ray counts fully in its own pixel, and the filter
//! decides where in the pixel's neighbourhood it goes.

use std::f32::consts::TAU;

use crate::contract::Filter;

/// Entries of the inverse distribution; finer ones change no picture in 8 bits.
const ENTRIES: usize = 1024;

/// A separable filter as the inverse of its distribution.
pub struct PixelFilter {
    /// Offsets [pixel] at equal steps of probability, for the half right of the middle.
    offsets: Vec<f32>,
}

impl PixelFilter {
    /// The filter of a kind and Blender's filter width [pixel]. As in Cycles a box is one pixel
    /// wide, the others fade out at 3 and 2 times the width.
    pub fn new(kind: Filter, width: f32) -> Self {
        let half = match kind {
            Filter::Box => 0.5,
            Filter::Gaussian => 1.5 * width,
            Filter::BlackmanHarris => width,
        };
        let density = |x: f32| match kind {
            Filter::Box => 1.0,
            // Six standard deviations to the end, the shape that Cycles uses.
            Filter::Gaussian => (-2.0 * (3.0 * x / half).powi(2)).exp(),
            Filter::BlackmanHarris => blackman_harris(x / (2.0 * half) + 0.5),
        };
        let step = half / ENTRIES as f32;
        let mut cumulative = vec![0.0];
        for i in 0..ENTRIES {
            let middle = density((i as f32 + 0.5) * step).max(0.0);
            cumulative.push(cumulative[i] + middle);
        }
        let total = cumulative[ENTRIES];
        let offsets = (0..=ENTRIES)
            .map(|i| {
                let target = total * i as f32 / ENTRIES as f32;
                let after = cumulative
                    .partition_point(|&c| c < target)
                    .clamp(1, ENTRIES);
                let (low, high) = (cumulative[after - 1], cumulative[after]);
                let part = if high > low {
                    (target - low) / (high - low)
                } else {
                    0.0
                };
                (after as f32 - 1.0 + part) * step
            })
            .collect();
        Self { offsets }
    }

    /// The offset from the pixel's centre [pixel] that the number `u` in [0, 1) chooses.
    pub fn sample(&self, u: f32) -> f32 {
        let signed = 2.0 * u - 1.0;
        let at = signed.abs() * ENTRIES as f32;
        let low = (at as usize).min(ENTRIES - 1);
        let offset =
            self.offsets[low] + (self.offsets[low + 1] - self.offsets[low]) * (at - low as f32);
        offset.copysign(signed)
    }
}

/// The four-term Blackman-Harris window over [0, 1]. Source: Harris, "On the use of windows for
/// harmonic analysis with the discrete Fourier transform", Proc. IEEE 66(1), 1978.
fn blackman_harris(x: f32) -> f32 {
    0.35875 - 0.48829 * (TAU * x).cos() + 0.14128 * (2.0 * TAU * x).cos()
        - 0.01168 * (3.0 * TAU * x).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and variance of the sampled offsets against the density's own, by quadrature.
    #[test]
    fn samples_have_the_moments_of_the_filter() {
        for (kind, width, variance) in [
            (Filter::Box, 1.0, 1.0 / 12.0),
            // The standard deviation is a quarter of the width.
            (Filter::Gaussian, 1.5, 1.5f64.powi(2) / 16.0),
            // By quadrature of x^2 under the window in double precision.
            (Filter::BlackmanHarris, 1.5, 0.172_658_5),
        ] {
            let filter = PixelFilter::new(kind, width);
            let n = 100_000;
            let offsets = (0..n).map(|i| f64::from(filter.sample((i as f32 + 0.5) / n as f32)));
            let (sum, squares) = offsets.fold((0.0, 0.0), |(s, q), x| (s + x, q + x * x));
            assert!((sum / f64::from(n)).abs() < 1e-4);
            let got = squares / f64::from(n);
            assert!(
                (got / variance - 1.0).abs() < 0.01,
                "{kind:?}: {got} {variance}"
            );
        }
    }
}
