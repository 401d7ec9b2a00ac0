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

use super::veto::Lending;
use crate::film::Region;

/// Iterations before the first decision: fewer say little.
const DECIDE_FROM: u32 = 8;
/// Fewer iterations than these must say it more clearly: where they err, too little is borrowed.
const SURE: u32 = 32;
/// Squared mean of D over its variance where borrowing ends. 1.5 would be best were both known; where
/// nothing drifts, 25 pixels exceed that six times as often as this.
const END: f32 = 2.5;
/// Half the side of the square of pixels that are judged together.
const HALF: usize = 2;

/// Luminance of pixels' own light less that of what they borrowed, over the iterations.
pub struct Drift {
    /// Sum of each pixel.
    pub sums: Vec<f32>,
    /// Each sum when the number of iterations was last a power of two; the halves tell the noise.
    first_half: Vec<f32>,
}

impl Drift {
    /// None yet.
    pub fn new(region: Region) -> Self {
        let zeros = vec![0.0; region.width * region.height];
        Self {
            sums: zeros.clone(),
            first_half: zeros,
        }
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.sums[..]) + size_of_val(&self.first_half[..])
    }

    /// Each time the iterations have doubled, stops the borrowing of pixels to which it has surely
    /// brought as much bias as it is worth.
    pub fn look(&mut self, region: Region, iterations: u32, lending: &mut [Lending]) {
        if !iterations.is_power_of_two() {
            return;
        }
        if iterations >= DECIDE_FROM {
            stop(region, &self.excesses(iterations), lending);
        }
        self.first_half.copy_from_slice(&self.sums);
    }

    /// By how much the squared mean of D exceeds the limit in each pixel.
    fn excesses(&self, iterations: u32) -> Vec<f32> {
        let half = (iterations / 2) as f32;
        let end = END * (SURE as f32 / iterations as f32).sqrt().max(1.0);
        let excess = |(&sum, &first): (&f32, &f32)| {
            let mean = sum / (2.0 * half);
            let error = 0.5 * (first - (sum - first)) / half;
            mean * mean - end * error * error
        };
        self.sums.iter().zip(&self.first_half).map(excess).collect()
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    const REGION: Region = Region {
        frame_width: 9,
        frame_height: 9,
        x: 0,
        y: 0,
        width: 9,
        height: 9,
    };

    /// Whether a block goes on borrowing whose D is seen to have this squared mean, its error being one.
    fn goes_on(iterations: u32, squared_mean: f32) -> bool {
        let (count, mean) = (iterations as f32, squared_mean.sqrt());
        let pixels = REGION.width * REGION.height;
        let mut drift = Drift::new(REGION);
        drift.sums = vec![count * mean; pixels];
        drift.first_half = vec![0.5 * count * (mean + 1.0); pixels];
        let mut lending = vec![Lending::Window; pixels];
        drift.look(REGION, iterations, &mut lending);
        let stopped = lending
            .iter()
            .filter(|&l| matches!(l, Lending::None))
            .count();
        assert!(stopped == 0 || stopped == pixels, "{stopped} of {pixels}");
        stopped == 0
    }

    /// The fewer iterations there were, the more clearly they must say it.
    #[test]
    fn borrowing_ends_where_its_bias_is_sure() {
        for (iterations, limit) in [(8, 5.0), (16, 3.54), (32, 2.5), (1024, 2.5)] {
            assert!(goes_on(iterations, 0.95 * limit), "{iterations}");
            assert!(!goes_on(iterations, 1.05 * limit), "{iterations}");
        }
        // Two or four say too little, and between powers of two the halves are not alike.
        assert!(
            [2, 4, 12, 48]
                .into_iter()
                .all(|iterations| goes_on(iterations, 1e3))
        );
    }
}
