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

    /// Numbers that a pixel keeps.
    fn width(self) -> usize {
        let channels = self.spec().channels.len();
        match self.spec().keep {
            Keep::Always => 0,
            Keep::MeanSeen => channels + 1,
            Keep::First | Keep::Mean | Keep::Over(_) => channels,
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
#[derive(Debug, Clone, Default)]
pub struct Layout {
    /// First number of each row of the table, if it is kept.
    starts: [Option<usize>; PASSES.len()],
    /// Numbers of a pixel.
    stride: usize,
}

impl Layout {
    /// Places for the passes of these names, and for those that they are divided by.
    ///
    /// # Errors
    /// A name that the contract does not have.
    pub fn new<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let mut layout = Self::default();
        for name in names {
            let spec = PassSpec::named(name)?;
            layout.keep(Row::of(spec.name));
            if let Keep::Over(divisor) = spec.keep {
                layout.keep(Row::of(divisor));
            }
        }
        Ok(layout)
    }

    fn keep(&mut self, row: Row) {
        if self.starts[row.0].is_none() && row.width() > 0 {
            self.starts[row.0] = Some(self.stride);
            self.stride += row.width();
        }
    }

    fn place(&self, row: Row) -> Option<Range<usize>> {
        let start = self.starts[row.0]?;
        Some(start..start + row.width())
    }

    /// Whether a pass is kept.
    pub fn keeps(&self, row: Row) -> bool {
        self.starts[row.0].is_some()
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
        let Some(place) = self.layout.place(row) else {
            return;
        };
        let keep = row.spec().keep;
        // One number that is not finite would spoil the pixel for good.
        if (keep == Keep::First && iteration > 0) || values.iter().any(|v| !v.is_finite()) {
            return;
        }
        let numbers = &mut self.numbers[place];
        let channels = row.spec().channels.len();
        for (number, value) in numbers.iter_mut().zip(&values[..channels]) {
            *number += value;
        }
        if keep == Keep::MeanSeen {
            numbers[channels] += 1.0;
        }
    }
}

/// The finished numbers of a pass, from those that the pixels keep over `samples` iterations.
pub fn resolve(layout: &Layout, numbers: &[f32], row: Row, samples: u32) -> Vec<f32> {
    let Some(place) = layout.place(row) else {
        return Vec::new();
    };
    let channels = row.spec().channels.len();
    let mean = 1.0 / samples.max(1) as f32;
    let divisor = match row.spec().keep {
        Keep::Over(name) => layout.place(Row::of(name)),
        _ => None,
    };
    let pixel = |pixel: &[f32]| {
        let sums = &pixel[place.clone()];
        let mut values = [0.0; 4];
        values[..channels].copy_from_slice(&sums[..channels]);
        match row.spec().keep {
            Keep::Always | Keep::First => values,
            Keep::Mean => values.map(|v| v * mean),
            Keep::MeanSeen => values.map(|v| v / sums[channels].max(1.0)),
            Keep::Over(_) => match &divisor {
                Some(divisor) => even_quotient(values, &pixel[divisor.clone()]),
                None => values,
            },
        }
    };
    numbers
        .chunks_exact(layout.stride)
        .flat_map(|numbers| pixel(numbers).into_iter().take(channels))
        .collect()
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
        let resolved = |row| resolve(&layout, &numbers, row, 2);
        assert_eq!(resolved(POSITION), [1.0, 2.0, 3.0]);
        assert_eq!(resolved(MIST), [0.75]);
        // One of the two samples showed a surface.
        assert_eq!(resolved(VECTOR), [1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn what_is_not_asked_for_takes_no_place() {
        let names = ["Combined", "Depth", "Normal"];
        let (layout, _) = film_of(&names, &[(MIST, 0, &[1.0])]);
        assert_eq!(layout.stride(), 0);
        assert!(resolve(&layout, &[], MIST, 1).is_empty());
        assert!(Layout::new(["Moonlight"]).is_err());
    }

    #[test]
    fn a_channel_without_colour_is_the_mean_of_the_others() {
        let light = [4.0, 1.0, 6.0, 0.0];
        assert_eq!(even_quotient(light, &[2.0, 1.0, 2.0]), [2.0, 1.0, 3.0, 0.0]);
        assert_eq!(even_quotient(light, &[2.0, 0.0, 2.0]), [2.0, 2.5, 3.0, 0.0]);
        assert_eq!(even_quotient(light, &[0.0; 3]), [0.0; 4]);
    }
}
