//! What a film keeps for passes beside what every film keeps: only what was asked for.

use std::ops::Range;

use crate::contract::{Keep, PASSES, PassSpec};
use crate::error::Result;

/// A row of the table of passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row(usize);

impl Row {
    /// The row of a name that code knows: one that is not there does not compile as a constant.
    pub const fn of(name: &str) -> Self {
        let mut row = 0;
        while !is_same(PASSES[row].name, name) {
            row += 1;
        }
        Self(row)
    }

    fn spec(self) -> &'static PassSpec {
        &PASSES[self.0]
    }

    /// Numbers that a pixel keeps for each of its names.
    fn width(self) -> usize {
        let channels = self.spec().channels.len();
        match self.spec().keep {
            Keep::Always => 0,
            Keep::MeanSeen => channels + 1,
            _ => channels,
        }
    }
}

const fn is_same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// Where the pixels of a film keep the numbers of passes.
#[derive(Debug, Clone)]
pub struct Layout {
    /// One for each row of the table.
    places: Vec<Place>,
    /// Numbers of a pixel.
    stride: usize,
}

/// Where pixels keep the numbers of a row of the table.
#[derive(Debug, Clone, Default)]
struct Place {
    start: usize,
    /// What stands behind the row's name in those of the passes, in the order of their numbers; one
    /// that is empty for most rows, none where the row is not kept.
    keys: Vec<String>,
    /// The keys that are numbers.
    numbers: Vec<Option<u32>>,
}

impl Layout {
    /// Places for the passes of these names, and for those that they are divided by.
    ///
    /// # Errors
    /// A name that the contract does not have.
    pub fn new<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let mut places = vec![Place::default(); PASSES.len()];
        let mut keep = |row: Row, key: &str| {
            let keys = &mut places[row.0].keys;
            if row.width() > 0 && !keys.iter().any(|known| known == key) {
                keys.push(key.to_owned());
            }
        };
        for name in names {
            let (spec, key) = PassSpec::named(name)?;
            keep(Row::of(spec.name), key);
            if let Keep::Over(divisor) = spec.keep {
                keep(Row::of(divisor), "");
            }
        }
        let mut stride = 0;
        for (row, place) in places.iter_mut().enumerate() {
            place.start = stride;
            place.numbers = place.keys.iter().map(|key| key.parse().ok()).collect();
            stride += Row(row).width() * place.keys.len();
        }
        Ok(Self { places, stride })
    }

    /// The numbers of a row, if it is kept: those of all its names.
    fn range(&self, row: Row) -> Option<Range<usize>> {
        let place = &self.places[row.0];
        let count = row.width() * place.keys.len();
        (count > 0).then(|| place.start..place.start + count)
    }

    /// Whether a row is kept.
    pub fn keeps(&self, row: Row) -> bool {
        !self.places[row.0].keys.is_empty()
    }

    /// The place of the pass whose key is this number among those of its row.
    pub fn key_of(&self, row: Row, number: u32) -> Option<usize> {
        let numbers = &self.places[row.0].numbers;
        numbers.iter().position(|known| *known == Some(number))
    }

    /// Numbers that each pixel keeps.
    pub fn stride(&self) -> usize {
        self.stride
    }
}

/// The numbers of one pixel.
pub struct Extra<'a> {
    /// Where they are.
    pub layout: &'a Layout,
    /// The numbers, as many as the layout says.
    pub numbers: &'a mut [f32],
}

impl Extra<'_> {
    /// Whether any pass is kept.
    pub fn is_any(&self) -> bool {
        self.layout.stride > 0
    }

    /// Adds what an iteration brought to a pass, if it is kept.
    pub fn add(&mut self, row: Row, iteration: u32, values: &[f32]) {
        self.add_to(row, 0, iteration, values);
    }

    /// The same for the pass of the key of this number.
    pub fn add_to(&mut self, row: Row, key: usize, iteration: u32, values: &[f32]) {
        let Some(range) = self.layout.range(row) else {
            return;
        };
        let keep = row.spec().keep;
        // One number that is not finite would spoil the pixel for good.
        if (keep == Keep::First && iteration > 0) || values.iter().any(|v| !v.is_finite()) {
            return;
        }
        let numbers = &mut self.numbers[range][key * row.width()..];
        let channels = row.spec().channels.len();
        for (number, value) in numbers.iter_mut().zip(&values[..channels]) {
            *number += value;
        }
        if keep == Keep::MeanSeen {
            numbers[channels] += 1.0;
        }
    }

    /// Adds the weight of a thing to a row that ranks things, if it is kept. As in Cycles, things that
    /// find no place any more count to the last one.
    pub fn add_ranked(&mut self, row: Row, name: f32, weight: f32) {
        let Some(range) = self.layout.range(row) else {
            return;
        };
        let pairs = self.numbers[range].as_chunks_mut::<2>().0;
        let known = pairs
            .iter()
            .position(|pair| pair[0] == name || pair[0] == 0.0);
        let place = known.unwrap_or(pairs.len() - 1);
        if pairs[place][0] == 0.0 {
            pairs[place][0] = name;
        }
        pairs[place][1] += weight;
    }
}

/// The finished numbers of a pass, from those that the pixels keep over `samples` iterations.
pub fn resolve(layout: &Layout, numbers: &[f32], name: &str, samples: u32) -> Vec<f32> {
    let Ok((spec, key)) = PassSpec::named(name) else {
        return Vec::new();
    };
    let row = Row::of(spec.name);
    let keys = &layout.places[row.0].keys;
    let key = keys.iter().position(|known| known == key);
    let (Some(range), Some(key)) = (layout.range(row), key) else {
        return Vec::new();
    };
    let channels = spec.channels.len();
    let mean = 1.0 / samples.max(1) as f32;
    let divisor = match spec.keep {
        Keep::Over(name) => layout.range(Row::of(name)),
        _ => None,
    };
    let pixel = |pixel: &[f32]| {
        let all = &pixel[range.clone()];
        let sums = &all[key * row.width()..];
        let mut values = [0.0; 4];
        values[..channels].copy_from_slice(&sums[..channels]);
        match spec.keep {
            Keep::Always | Keep::First => values,
            Keep::Mean | Keep::Means => values.map(|v| v * mean),
            Keep::MeanSeen => values.map(|v| v / sums[channels].max(1.0)),
            Keep::Over(_) => match &divisor {
                Some(divisor) => even_quotient(values, &pixel[divisor.clone()]),
                None => values,
            },
            Keep::Ranked => ranked(all, key, mean),
        }
    };
    numbers
        .chunks_exact(layout.stride)
        .flat_map(|numbers| pixel(numbers).into_iter().take(channels))
        .collect()
}

/// The names and weights of two things by their rank: those of rank 2 `level` and the next.
fn ranked(pairs: &[f32], level: usize, mean: f32) -> [f32; 4] {
    let mut pairs = pairs.as_chunks::<2>().0.to_vec();
    // Stable: the first of equals stays the first.
    pairs.sort_by(|a, b| b[1].total_cmp(&a[1]));
    let ([first, first_weight], [second, second_weight]) = (pairs[2 * level], pairs[2 * level + 1]);
    [first, first_weight * mean, second, second_weight * mean]
}

/// A colour over another one. As in Cycles, a channel that the divisor does not have is the mean of
/// the others, so that what is grey stays grey.
fn even_quotient(color: [f32; 4], divisor: &[f32]) -> [f32; 4] {
    let quotient = |c: usize| (divisor[c] != 0.0).then(|| color[c] / divisor[c]);
    let found = [0, 1, 2].map(quotient);
    let there = found.iter().flatten();
    let mean = there.clone().sum::<f32>() / there.count().max(1) as f32;
    let [r, g, b] = found.map(|channel| channel.unwrap_or(mean));
    [r, g, b, 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSITION: Row = Row::of("Position");
    const MIST: Row = Row::of("Mist");
    const VECTOR: Row = Row::of("Vector");

    fn film_of(names: &[&str], samples: &[(Row, u32, &[f32])]) -> (Layout, Vec<f32>) {
        let layout = Layout::new(names.iter().copied()).unwrap();
        let mut numbers = vec![0.0; layout.stride()];
        let mut extra = Extra {
            layout: &layout,
            numbers: &mut numbers,
        };
        for &(row, iteration, values) in samples {
            extra.add(row, iteration, values);
        }
        (layout, numbers)
    }

    #[test]
    fn each_pass_keeps_what_its_row_says() {
        let samples: &[(Row, u32, &[f32])] = &[
            (POSITION, 0, &[1.0, 2.0, 3.0]),
            (POSITION, 1, &[9.0, 9.0, 9.0]),
            (MIST, 0, &[1.0]),
            (MIST, 1, &[0.5]),
            (VECTOR, 1, &[1.0, 2.0, 3.0, 4.0]),
        ];
        let (layout, numbers) = film_of(&["Position", "Mist", "Vector"], samples);
        let resolved = |name| resolve(&layout, &numbers, name, 2);
        assert_eq!(resolved("Position"), [1.0, 2.0, 3.0]);
        assert_eq!(resolved("Mist"), [0.75]);
        // One of the two samples showed a surface.
        assert_eq!(resolved("Vector"), [1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn what_is_not_asked_for_takes_no_place() {
        let names = ["Combined", "Depth", "Normal"];
        let (layout, _) = film_of(&names, &[(MIST, 0, &[1.0])]);
        assert_eq!(layout.stride(), 0);
        assert!(resolve(&layout, &[], "Mist", 1).is_empty());
        assert!(Layout::new(["Moonlight"]).is_err());
    }

    #[test]
    fn things_are_ranked_by_weight_and_the_last_place_takes_what_finds_none() {
        const OBJECT: Row = Row::of("CryptoObject");
        let layout = Layout::new(["CryptoObject.00", "CryptoObject.01", "Mist"]).unwrap();
        let mut numbers = vec![0.0; layout.stride()];
        let mut extra = Extra {
            layout: &layout,
            numbers: &mut numbers,
        };
        for (name, weight) in [(7.0, 1.0), (5.0, 3.0), (3.0, 0.5), (7.0, 1.0), (2.0, 0.25)] {
            extra.add_ranked(OBJECT, name, weight);
        }
        extra.add_ranked(OBJECT, 9.0, 0.5);
        let resolved = |name| resolve(&layout, &numbers, name, 2);
        assert_eq!(resolved("CryptoObject.00"), [5.0, 1.5, 7.0, 1.0]);
        assert_eq!(resolved("CryptoObject.01"), [2.0, 0.375, 3.0, 0.25]);
        assert_eq!(resolved("Mist"), [0.0]);
    }

    #[test]
    fn a_channel_without_colour_is_the_mean_of_the_others() {
        let light = [4.0, 1.0, 6.0, 0.0];
        assert_eq!(even_quotient(light, &[2.0, 1.0, 2.0]), [2.0, 1.0, 3.0, 0.0]);
        assert_eq!(even_quotient(light, &[2.0, 0.0, 2.0]), [2.0, 2.5, 3.0, 0.0]);
        assert_eq!(even_quotient(light, &[0.0; 3]), [0.0; 4]);
    }
}
