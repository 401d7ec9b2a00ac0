//! Choosing one of many with given weights.

use std::ops::Range;

/// The largest number below one.
const ALMOST_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// A cumulative distribution; what it says is exactly what it draws.
#[derive(Debug, Clone)]
pub struct Discrete {
    /// Starts at 0, ends at 1; the step at an index is its probability.
    cumulative: Vec<f32>,
    /// See [`guide`].
    guide: Vec<u32>,
}

impl Discrete {
    /// A distribution proportional to `weights`; `None` if all are zero or the sum is not finite.
    pub fn new(weights: impl IntoIterator<Item = f32>) -> Option<Self> {
        let mut sum = 0.0;
        let sums: Vec<f64> = weights
            .into_iter()
            .map(|weight| {
                sum += f64::from(weight);
                sum
            })
            .collect();
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        let mut cumulative = vec![0.0];
        cumulative.extend(sums.into_iter().map(|s| (s / sum) as f32));
        Some(Self {
            guide: guide(&cumulative),
            cumulative,
        })
    }

    /// An index and its probability. `u` comes back as a number that is uniform again.
    pub fn sample(&self, u: f32) -> (usize, f32, f32) {
        step(&self.cumulative, &self.guide, u)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.cumulative.len() - 1
    }

    /// Probability of an index.
    pub fn pmf(&self, index: usize) -> f32 {
        self.cumulative[index + 1] - self.cumulative[index]
    }

    /// One of some indices, and its probability among them; `None` if all of theirs are zero.
    pub fn sample_among(&self, range: Range<usize>, u: f32) -> Option<(usize, f32)> {
        let steps = &self.cumulative[range.start..=range.end];
        let [low, high] = [steps[0], steps[range.len()]];
        let u = low + u * (high - low);
        let index = range.start + steps.partition_point(|&step| step <= u).max(1) - 1;
        // Rounding may reach the end: the last one that has a probability is meant.
        let index = (range.start..range.end.min(index + 1)).rfind(|&at| self.pmf(at) > 0.0)?;
        Some((index, self.pmf(index) / (high - low)))
    }

    /// Probability of an index among some.
    pub fn pmf_among(&self, range: Range<usize>, index: usize) -> f32 {
        let all = self.cumulative[range.end] - self.cumulative[range.start];
        if all > 0.0 {
            self.pmf(index) / all
        } else {
            0.0
        }
    }

    /// The distribution as steps from 0 to 1.
    pub fn cumulative(&self) -> &[f32] {
        &self.cumulative
    }

    /// See [`guide`].
    pub fn guide(&self) -> &[u32] {
        &self.guide
    }
}

/// For each of as many equal parts of [0, 1) as there are weights, where in the cumulative
/// distribution to begin looking for a number of that part (Chen and Asau, "On generating random
/// variates from an empirical distribution", 1974): two steps on average, where a binary search
/// mispredicts every other of its branches.
fn guide(cumulative: &[f32]) -> Vec<u32> {
    let parts = cumulative.len() - 1;
    let first_above = |part: usize| {
        let start = part as f32 / parts as f32;
        cumulative.partition_point(|&c| c <= start) as u32
    };
    // `u * parts` may round up to the next part: begin one part earlier.
    (0..parts)
        .map(|part| first_above(part.saturating_sub(1)))
        .collect()
}

/// [`Discrete::sample`] on a borrowed cumulative distribution with its guide.
pub fn step(cumulative: &[f32], guide: &[u32], u: f32) -> (usize, f32, f32) {
    let u = u.clamp(0.0, ALMOST_ONE);
    let part = ((u * guide.len() as f32) as usize).min(guide.len() - 1);
    let mut above = guide[part] as usize;
    while cumulative[above] <= u {
        above += 1;
    }
    let index = above - 1;
    let pmf = cumulative[index + 1] - cumulative[index];
    let rest = ((u - cumulative[index]) / pmf).min(ALMOST_ONE);
    (index, pmf, rest)
}

/// One of a few weights whose sum is known and above zero: its index, its share, and a number that is
/// uniform again.
#[inline]
pub fn pick(weights: &[f32], total: f32, u: f32) -> Option<(usize, f32, f32)> {
    let mut rest = u * total;
    let mut picked = None;
    for (index, &weight) in weights.iter().enumerate() {
        if weight > 0.0 {
            // Where rounding leaves a rest behind the last one, that is taken.
            picked = Some((index, weight, rest));
            if rest < weight {
                break;
            }
        }
        rest -= weight;
    }
    let (index, weight, rest) = picked?;
    Some((
        index,
        weight / total,
        (rest / weight).clamp(0.0, ALMOST_ONE),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_what_it_says_and_never_what_has_no_weight() {
        let weights = [0.0, 3.0, 0.0, 1.0, 4.0, 0.0];
        let discrete = Discrete::new(weights).unwrap();
        let mut count = [0; 6];
        for i in 0..8000 {
            let (index, pmf, rest) = discrete.sample((i as f32 + 0.5) / 8000.0);
            assert_eq!(pmf, discrete.pmf(index));
            assert!((0.0..1.0).contains(&rest));
            count[index] += 1;
        }
        assert_eq!(count, [0, 3000, 0, 1000, 4000, 0]);
        assert_eq!(discrete.sample(0.0).0, 1);
        assert_eq!(discrete.sample(1.0).0, 4);
    }

    #[test]
    fn some_of_them_keep_their_shares() {
        let discrete = Discrete::new([1.0, 3.0, 0.0, 1.0, 4.0, 0.0]).unwrap();
        let mut count = [0; 6];
        for i in 0..400 {
            let (index, pmf) = discrete
                .sample_among(1..4, (i as f32 + 0.5) / 400.0)
                .unwrap();
            assert_eq!(pmf, discrete.pmf_among(1..4, index));
            count[index] += 1;
        }
        assert_eq!(count, [0, 300, 0, 100, 0, 0]);
        assert_eq!(discrete.sample_among(1..4, 1.0).unwrap().0, 3);
        assert!(discrete.sample_among(5..6, 0.5).is_none());
    }

    #[test]
    fn nothing_to_choose_from_is_none() {
        assert!(Discrete::new([]).is_none());
        assert!(Discrete::new([0.0, 0.0]).is_none());
        assert!(Discrete::new([f32::NAN]).is_none());
    }
}
