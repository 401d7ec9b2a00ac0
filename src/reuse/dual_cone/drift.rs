//! When to stop borrowing, so that a picture converges: borrowed light has a bias, which no number of
//! iterations takes away.
//!
//! Let D be a pixel's own light of an iteration less what it borrowed: its mean is the bias b, its
//! variance about what borrowing saves. A pixel that borrows in m of n iterations and renders the
//! rest alone has the error
//!
//! ```text
//! MSE = (m^2 b^2 + m V_shared + (n - m) V_own) / n^2
//! ```
//!
//! which is least at m = (V_own - V_shared) / (2 b^2), whatever n will be, and from there on below
//! V_own / n, that of path tracing. The moment has come where the squared mean of D is well above
//! what chance makes it. What chance makes it, the two halves of the iterations say: their difference
//! is free of b. The scatter of single iterations would not do, as their samples are stratified: the
//! mean of D is three times less noisy than they say.
//!
//! What an iteration adds is chosen from iterations before it. A weight that depends on the sample
//! which it weighs would darken the picture.

use rayon::prelude::*;

use crate::film::{Drift, Lending, Region};

use super::PILOT_ITERATIONS;

/// Iterations before the first decision: fewer say little, and borrow too little where they err.
const DECIDE_FROM: u32 = 32;
/// Squared mean of D over its variance where borrowing ends. 1.5 would be best were both known; where
/// nothing drifts, 25 pixels exceed that six times as often as this.
const END: f32 = 2.5;
/// Half the side of the square of pixels that are judged together.
const HALF: usize = 2;

/// No drift yet.
pub fn none(region: Region) -> Drift {
    let zeros = vec![0.0; region.width * region.height];
    Drift {
        sums: zeros.clone(),
        first_half: zeros,
    }
}

/// Each time the iterations have doubled, stops the borrowing of pixels to which it has surely
/// brought as much bias as it is worth.
pub fn look(region: Region, iterations: u32, drift: &mut Drift, lending: &mut [Lending]) {
    if !iterations.is_power_of_two() {
        return;
    }
    if iterations >= DECIDE_FROM {
        stop(region, &excesses(iterations, drift), lending);
    }
    drift.first_half.copy_from_slice(&drift.sums);
}

/// By how much the squared mean of D exceeds the limit in each pixel.
fn excesses(iterations: u32, drift: &Drift) -> Vec<f32> {
    let half = (iterations / 2) as f32;
    let pilot = PILOT_ITERATIONS as f32;
    let excess = |(&sum, &first): (&f32, &f32)| {
        let mean = sum / (2.0 * half - pilot);
        let error = 0.5 * (first / (half - pilot) - (sum - first) / half);
        mean * mean - END * error * error
    };
    drift
        .sums
        .iter()
        .zip(&drift.first_half)
        .map(excess)
        .collect()
}

/// Stops where the excesses around a pixel are positive together.
fn stop(region: Region, excesses: &[f32], lending: &mut [Lending]) {
    let (width, height) = (region.width, region.height);
    let rows = lending.par_chunks_mut(width).enumerate();
    rows.for_each(|(y, row)| {
        let lines = y.saturating_sub(HALF)..(y + HALF + 1).min(height);
        for (x, lending) in row.iter_mut().enumerate() {
            let columns = x.saturating_sub(HALF)..(x + HALF + 1).min(width);
            let line = |y: usize| &excesses[y * width..][columns.clone()];
            let sum: f32 = lines.clone().flat_map(line).sum();
            if sum > 0.0 {
                *lending = Lending::None;
            }
        }
    });
}
