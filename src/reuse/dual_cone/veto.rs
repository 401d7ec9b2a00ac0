//! From where a pixel borrows: decided tile by tile. Two pilot iterations render each pixel by the
//! whole window's samples and by its frame's, and some pixels also alone, as path tracing would. Later,
//! each time the iterations have doubled, those pixels say whether path tracing has overtaken: its
//! stratified samples may converge faster than shared ones.
//!
//! With V the variance of a pixel and c its cost, the way with the least work-normalised variance V c
//! (Glynn and Whitt 1992) is the best one. Variances are those of two runs, relative to the tile's
//! brightness and not clamped: clamped ones make noisy tiles look alike. Costs are counted, not
//! clocked, so that a picture does not depend on the machine.
//!
//! A tile has few observations, of which a spike may be worth all the others. So it is taken for the
//! mean of the frame as far as it knows little of itself (Efron and Morris 1975): indoors a tile with
//! spikes goes on borrowing, where borrowing pays nowhere it is left even for a small gain.
//!
//! The decision is smooth: gains are averaged over neighbouring tiles and interpolated, and every way
//! renders the same light, so that no seams show.

use rayon::prelude::*;

use super::tiles::Tiles;
use crate::contract::Settings;
use crate::film::{Film, Region};

/// Iterations that render all ways.
pub const PILOT_ITERATIONS: u32 = 2;

/// Iterations before tiles are judged again: the halves of fewer say little.
const JUDGE_FROM: u32 = 8;
/// Every so many pixels along rows and columns one is rendered alone as well, in pilot iterations.
const PILOT_SPACING: usize = 2;
/// The same later.
const SPACING: usize = 4;
/// What a ray costs with the shading where it ends, in borrowed records.
const RECORDS_PER_RAY: f32 = 160.0;
/// What borrowing costs a pixel beside its records, what it lends included.
const RECORDS_PER_BLOCK: f32 = 90.0;
/// Share of a sample's cost that it has in a frame which only lends: light samples are left out.
const LENT_SAMPLE: f32 = 0.65;
/// Observations for which the mean of the frame counts in a tile.
const PRIOR: f64 = 8.0;
/// By how much the squared gap between two runs shrinks when they get twice as long: of independent
/// samples, and the least that is believed.
const INDEPENDENT: f64 = 0.5;
const LEAST_SHRINKING: f64 = 0.2;
/// Added to a squared luminance, so that dark pixels do not rule.
const DARK: f32 = 0.01;

/// Whose samples a pixel takes beside its own.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Lending {
    /// Nobody's.
    #[default]
    None,
    /// Those of its frame.
    Frame,
    /// Those of the frames around it too.
    Window,
}

impl Lending {
    /// Whether it takes any.
    pub fn is_some(self) -> bool {
        self != Lending::None
    }
}

fn spacing(iteration: u32) -> usize {
    match iteration {
        ..PILOT_ITERATIONS => PILOT_SPACING,
        _ => SPACING,
    }
}

/// Whether a pixel that borrows is also rendered alone.
pub fn is_probe(x: usize, y: usize, iteration: u32) -> bool {
    let spacing = spacing(iteration);
    x.is_multiple_of(spacing) && y.is_multiple_of(spacing)
}

/// The pixels that are rendered alone as well.
fn probes(region: Region, iteration: u32) -> impl Iterator<Item = usize> {
    let (width, spacing) = (region.width, spacing(iteration));
    let rows = (0..region.height).step_by(spacing);
    rows.flat_map(move |y| (0..width).step_by(spacing).map(move |x| y * width + x))
}

/// Luminance of a probe's sum by each way to take samples.
#[derive(Debug, Clone, Copy, Default)]
struct Ways {
    /// As it is rendered.
    chosen: f32,
    /// [`Lending::Frame`].
    frame: f32,
    /// [`Lending::None`].
    alone: f32,
}

impl Ways {
    /// Each less what it had brought before.
    fn less(self, before: Self) -> Self {
        Self {
            chosen: self.chosen - before.chosen,
            frame: self.frame - before.frame,
            alone: self.alone - before.alone,
        }
    }

    /// By how much each differs.
    fn gap(self, other: Self) -> Self {
        Self {
            chosen: (self.chosen - other.chosen).abs(),
            frame: (self.frame - other.frame).abs(),
            alone: (self.alone - other.alone).abs(),
        }
    }

    fn each(self) -> [f32; 3] {
        [self.chosen, self.frame, self.alone]
    }

    fn times(self, factor: f32) -> Self {
        Self {
            chosen: self.chosen * factor,
            frame: self.frame * factor,
            alone: self.alone * factor,
        }
    }
}

/// What a sample costs that borrows from the window and from its frame, over one that does not.
#[derive(Debug, Clone, Copy)]
pub struct Costs {
    window: f32,
    frame: f32,
}

impl Costs {
    /// `records` are those of a block in one of `lenders` frames, `rays` those that a sample takes.
    pub fn new(records: usize, lenders: usize, rays: f32) -> Self {
        let cost =
            |records: usize| 1.0 + (records as f32 + RECORDS_PER_BLOCK) / (rays * RECORDS_PER_RAY);
        // Of frames rendered together the first and the last borrow from others. By the setting's
        // default: a choice that followed the setting would change the picture.
        let together = Settings::default().frames_together;
        let lent = lenders.saturating_sub(1) as f32 / together as f32;
        Self {
            window: cost(records * lenders) + LENT_SAMPLE * lent,
            frame: cost(records),
        }
    }

    fn of(self, lending: Lending) -> f32 {
        match lending {
            Lending::None => 1.0,
            Lending::Frame => self.frame,
            Lending::Window => self.window,
        }
    }
}

/// Two runs of a pixel.
struct Trial {
    pixel: usize,
    runs: [Ways; 2],
    /// The way that was chosen.
    lending: Lending,
    /// How far two runs of half as many iterations were apart, if that is known.
    gap_before: Option<Ways>,
}

/// V c of a tile's pixels by the way that was chosen and by another one.
#[derive(Debug, Clone, Copy, Default)]
struct Comparison {
    chosen: f64,
    other: f64,
    /// Sum of the squares of both together.
    squares: f64,
}

impl Comparison {
    fn add(&mut self, chosen: f32, other: f32) {
        let (chosen, other) = (f64::from(chosen), f64::from(other));
        self.chosen += chosen;
        self.other += other;
        self.squares += (chosen + other).powi(2);
    }

    fn and(self, more: &Self) -> Self {
        Self {
            chosen: self.chosen + more.chosen,
            other: self.other + more.other,
            squares: self.squares + more.squares,
        }
    }

    /// Part of the chosen way in the sum of both, a half where they are equally good, times the number
    /// of equal observations that say as much as these (Kish 1965), and that number. None of darkness.
    fn evidence(&self) -> [f64; 2] {
        let sum = self.chosen + self.other;
        if self.squares > 0.0 {
            [self.chosen, sum].map(|x| x * sum / self.squares)
        } else {
            [0.0; 2]
        }
    }
}

/// Mean part of the chosen way over all tiles; nothing of darkness.
fn mean_part<'a>(comparisons: impl Iterator<Item = &'a Comparison>) -> f64 {
    let add = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
    let [parts, observations] = comparisons.map(Comparison::evidence).fold([0.0; 2], add);
    parts / observations.max(1.0)
}

impl Trial {
    /// How far its runs are apart.
    fn gap(&self) -> Ways {
        self.runs[0].gap(self.runs[1])
    }

    /// V c of the way that was chosen, of the frame and of the pixel alone, over the squared
    /// brightness. `stratification` is that of each way.
    fn work_normalized(&self, brightness: f32, costs: Costs, stratification: [f32; 3]) -> [f32; 3] {
        let scale = 0.5 / (brightness * brightness + DARK);
        let variance = |value: fn(&Ways) -> f32| {
            let difference = value(&self.runs[0]) - value(&self.runs[1]);
            difference * difference * scale
        };
        [
            variance(|run| run.chosen) * costs.of(self.lending) * stratification[0],
            variance(|run| run.frame) * costs.frame * stratification[1],
            variance(|run| run.alone) * stratification[2],
        ]
    }
}

/// Mean brightness of each tile. A pixel's own would not do: where both its samples by one way are
/// dark by chance, their variance over their brightness would be small by that way only.
fn brightness(region: Region, trials: &[Trial]) -> Tiles<f32> {
    let mut sums = Tiles::<[f32; 2]>::new(region);
    for Trial { pixel, runs, .. } in trials {
        let [sum, count] = sums.get_mut(sums.of(*pixel));
        *sum += 0.5 * (runs[0].chosen + runs[1].chosen);
        *count += 1.0;
    }
    sums.map(|[sum, count]| sum / count)
}

/// Variance of the mean of all iterations over what its two halves say, by each way: as chosen, of the
/// frame, and alone.
///
/// The halves of a stratified sequence are each as good as the other, but make up for each other's gaps:
/// with the variance v(n) of n iterations and the gap of the means of two such runs
///
/// ```text
/// v(2n) = v(n) - E[gap(n)^2] / 4
/// ```
///
/// whatever their covariance (Eq. D6b). Summed over all doublings to come, with squared gaps that go on
/// shrinking by the factor r, v(2n) is r / (1 - r) times E[gap(n)^2] / 4: all of it where samples are
/// independent, r = 1/2, a third where the error falls as 1 / n. The whole frame tells r, by absolute
/// values, which spikes spoil less.
fn stratification(brightness: &Tiles<f32>, trials: &[Trial]) -> [f32; 3] {
    let mut sums = [[0.0; 3]; 2];
    for trial in trials {
        let Some(before) = trial.gap_before else {
            continue;
        };
        let brightness = brightness.get(brightness.of(trial.pixel));
        let scale = f64::from((brightness * brightness + DARK).sqrt()).recip();
        for (sum, gap) in sums.iter_mut().zip([before, trial.gap()]) {
            for (sum, gap) in sum.iter_mut().zip(gap.each()) {
                *sum += f64::from(gap) * scale;
            }
        }
    }
    let [before, now] = sums;
    [0, 1, 2].map(|way| match before[way] > 0.0 {
        true => {
            let shrinking = (now[way] / before[way]).powi(2);
            let shrinking = shrinking.clamp(LEAST_SHRINKING, INDEPENDENT) as f32;
            shrinking / (1.0 - shrinking)
        }
        false => 1.0,
    })
}

/// How much of its work each tile wastes that does not turn to the frame or to the pixel alone, over
/// 3 x 3 tiles (Eq. D6).
fn waste(region: Region, trials: &[Trial], costs: Costs) -> Tiles<[f32; 2]> {
    let brightness = brightness(region, trials);
    let stratification = stratification(&brightness, trials);
    let mut tiles = Tiles::<[Comparison; 2]>::new(region);
    for trial in trials {
        let tile = tiles.of(trial.pixel);
        let [chosen, frame, alone] =
            trial.work_normalized(brightness.get(tile), costs, stratification);
        let [by_frame, by_alone] = tiles.get_mut(tile);
        if trial.lending == Lending::Window {
            by_frame.add(chosen, frame);
        }
        by_alone.add(chosen, alone);
    }
    let each = tiles.values().iter();
    let prior = [0, 1].map(|way| PRIOR * mean_part(each.clone().map(|tile| &tile[way])));
    tiles.around(|around| {
        let add = |sum: [Comparison; 2], more: [Comparison; 2]| {
            [sum[0].and(&more[0]), sum[1].and(&more[1])]
        };
        let sum = around.reduce(add).unwrap_or_default();
        [0, 1].map(|way| {
            let [part, observations] = sum[way].evidence();
            ((part + prior[way]) / (observations + PRIOR) - 0.5) as f32
        })
    })
}

/// Pixels that gain by it borrow from less.
fn turn_away(region: Region, trials: &[Trial], costs: Costs, lending: &mut [Lending]) {
    let waste = waste(region, trials, costs);
    lending
        .par_iter_mut()
        .enumerate()
        .for_each(|(pixel, lending)| {
            *lending = match (waste.at_pixel(pixel), *lending) {
                ([frame, alone], _) if alone > 0.0 && alone >= frame => Lending::None,
                ([frame, _], Lending::Window) if frame > 0.0 => Lending::Frame,
                (_, same) => same,
            };
        });
}

/// How probes fare by the ways that they were not rendered by.
pub struct Trials {
    width: usize,
    /// Of every [`PILOT_SPACING`]-th pixel of every so many rows.
    excess: Vec<Excess>,
    /// Luminance by all ways when the number of iterations was last a power of two, probe after
    /// probe.
    halves: Vec<Ways>,
    /// How far the halves were apart then, if they are known.
    gaps: Vec<Ways>,
}

/// Luminance of a probe's sum by other ways less that of what it has.
#[derive(Debug, Clone, Copy, Default)]
pub struct Excess {
    /// By its frame's samples.
    pub frame: f32,
    /// Alone.
    pub alone: f32,
}

/// The probes in a row of pixels; none in most rows.
pub struct ProbeRow<'a>(&'a mut [Excess]);

impl ProbeRow<'_> {
    /// The pixel in this column, if it may be a probe.
    pub fn at(&mut self, x: usize) -> Option<&mut Excess> {
        match x.is_multiple_of(PILOT_SPACING) {
            true => self.0.get_mut(x / PILOT_SPACING),
            false => None,
        }
    }
}

impl Trials {
    /// None yet.
    pub fn new(region: Region) -> Self {
        let rows = region.height.div_ceil(PILOT_SPACING);
        Self {
            width: region.width,
            excess: vec![Excess::default(); region.width.div_ceil(PILOT_SPACING) * rows],
            halves: Vec::new(),
            gaps: Vec::new(),
        }
    }

    /// The probes of the rows, from the lowest.
    pub fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = ProbeRow<'_>> {
        let width = self.width.div_ceil(PILOT_SPACING);
        let mut rows = Vec::new();
        for row in self.excess.chunks_mut(width) {
            rows.push(ProbeRow(row));
            rows.extend((1..PILOT_SPACING).map(|_| ProbeRow(&mut [])));
        }
        rows.into_par_iter()
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.excess[..]) + size_of_val(&self.halves[..]) + size_of_val(&self.gaps[..])
    }

    /// After the pilot iterations, and each time the iterations have doubled since, lets pixels borrow
    /// from less that are better off so.
    pub fn look(&mut self, film: &Film, iterations: u32, costs: Costs, lending: &mut [Lending]) {
        if !iterations.is_power_of_two() {
            return;
        }
        // The second half of the iterations has the probes of its last one.
        let probes = || probes(film.region, iterations - 1);
        let sums: Vec<Ways> = probes().map(|pixel| self.ways(film, pixel)).collect();
        if iterations == PILOT_ITERATIONS || iterations >= JUDGE_FROM {
            let scale = 2.0 / iterations as f32;
            let halves = sums.iter().zip(&self.halves).enumerate();
            let trials = probes()
                .zip(halves)
                .map(|(pixel, (probe, (&sum, &first)))| Trial {
                    pixel,
                    runs: [first.times(scale), sum.less(first).times(scale)],
                    lending: lending[pixel],
                    gap_before: self.gaps.get(probe).copied(),
                });
            let mut trials: Vec<Trial> = trials.collect();
            self.gaps = match iterations >= JUDGE_FROM {
                true => trials.iter().map(Trial::gap).collect(),
                false => Vec::new(),
            };
            trials.retain(|trial| trial.lending.is_some());
            turn_away(film.region, &trials, costs, lending);
        }
        self.halves = sums;
    }

    fn ways(&self, film: &Film, pixel: usize) -> Ways {
        let [x, y] = [pixel % self.width, pixel / self.width].map(|place| place / PILOT_SPACING);
        let excess = &self.excess[y * self.width.div_ceil(PILOT_SPACING) + x];
        let chosen = film.luminance(pixel);
        Ways {
            chosen,
            frame: chosen + excess.frame,
            alone: chosen + excess.alone,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::*;
    use crate::film::Layout;
    use crate::math::statistics::Random;

    const SIDE: usize = 128;
    const REGION: Region = Region {
        frame_width: SIDE,
        frame_height: SIDE,
        x: 0,
        y: 0,
        width: SIDE,
        height: SIDE,
    };

    /// Shares of the ways (alone, frame, window) on the left and on the right half, where the window
    /// divides the variance by `window`, the frame by `frame`.
    fn shares(window: [f32; 2], frame: [f32; 2], costs: Costs) -> [[f32; 3]; 2] {
        let mut random = Random::new(9);
        let mut run = |pixel: usize| {
            let half = usize::from(pixel % SIDE >= SIDE / 2);
            let mut noise = |gain: f32| 1.0 + 3.0 * (random.next() - 0.5) / gain.sqrt();
            Ways {
                chosen: noise(window[half]),
                frame: noise(frame[half]),
                alone: noise(1.0),
            }
        };
        let trial = |pixel| Trial {
            pixel,
            runs: [run(pixel), run(pixel)],
            lending: Lending::Window,
            gap_before: None,
        };
        let trials: Vec<Trial> = probes(REGION, 0).map(trial).collect();
        let mut lending = vec![Lending::Window; SIDE * SIDE];
        turn_away(REGION, &trials, costs, &mut lending);
        let mut shares = [[0.0; 3]; 2];
        for (index, way) in lending.iter().enumerate() {
            let half = usize::from(index % SIDE >= SIDE / 2);
            shares[half][*way as usize] += 2.0 / (SIDE * SIDE) as f32;
        }
        shares
    }

    #[test]
    fn a_tile_borrows_less_only_where_that_gains() {
        let costs = Costs {
            window: 1.5,
            frame: 1.2,
        };
        // The window gains on the left; on the right nothing does. The choice takes a tile and a half
        // of the four on each side to change.
        let [left, right] = shares([9.0, 1.0], [4.0, 1.0], costs);
        assert!(left[2] > 0.8 && left[0] < 0.1, "{left:?}");
        assert!(right[0] > 0.6 && right[2] < 0.1, "{right:?}");
        // The frame is as good as the window; on the right the window is a little better than its cost.
        let [left, right] = shares([4.0, 1.6], [4.0, 1.0], costs);
        assert!(left[1] > 0.5 && right[2] > 0.9, "{left:?} {right:?}");
    }

    #[test]
    fn darkness_borrows() {
        let mut lending = vec![Lending::Window; SIDE * SIDE];
        let film = Film::new(REGION, Layout::new([]).unwrap());
        let mut trials = Trials::new(REGION);
        for iterations in 1..=16 {
            trials.look(&film, iterations, Costs::new(49, 3, 3.0), &mut lending);
        }
        assert!(lending.iter().all(|&way| way == Lending::Window));
    }

    /// In the left half's middle one spike by the chosen way is worth more than all its other light.
    #[test]
    fn a_spike_is_judged_by_the_rest_of_the_frame() {
        let costs = Costs::new(49, 3, 3.0);
        let spike = SIDE * SIDE / 2 + SIDE / 4;
        for gain in [0.5, 4.0_f32] {
            let run = |pixel: usize, sign: f32| {
                let luminance = |scale: f32| 1.0 + sign * scale;
                Ways {
                    chosen: luminance(if pixel == spike {
                        50.0
                    } else {
                        0.5 / gain.sqrt()
                    }),
                    frame: luminance(5.0),
                    alone: luminance(0.5),
                }
            };
            let trial = |pixel| Trial {
                pixel,
                runs: [run(pixel, 1.0), run(pixel, -1.0)],
                lending: Lending::Window,
                gap_before: None,
            };
            let trials: Vec<Trial> = probes(REGION, 0).map(trial).collect();
            let mut lending = vec![Lending::Window; SIDE * SIDE];
            turn_away(REGION, &trials, costs, &mut lending);
            let expected = if gain > 1.0 {
                Lending::Window
            } else {
                Lending::None
            };
            assert_eq!(lending[spike], expected, "{gain}");
        }
    }

    /// Runs of twice the length are 0.3 of the squared gap apart alone, half of it if shared.
    #[test]
    fn halves_that_make_up_for_each_other_count_less() {
        let at = |gap: [f32; 3]| Ways {
            chosen: 1.0 + gap[0],
            frame: 1.0 + gap[1],
            alone: 1.0 + gap[2],
        };
        let trial = |pixel| Trial {
            pixel,
            runs: [at([0.1; 3]), at([0.0; 3])],
            lending: Lending::Window,
            gap_before: Some(Ways {
                chosen: 0.1 * 2.0_f32.sqrt(),
                frame: 0.1,
                alone: 0.1 / 0.3_f32.sqrt(),
            }),
        };
        let trials: Vec<Trial> = probes(REGION, 0).map(trial).collect();
        let [chosen, frame, alone] = stratification(&brightness(REGION, &trials), &trials);
        // A gap that does not shrink is chance: no more is made of it than of independent samples.
        for (found, expected) in [(chosen, 1.0), (frame, 1.0), (alone, 0.3 / 0.7)] {
            assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        }
        // As good by their halves, path tracing is better in truth.
        let mut lending = vec![Lending::Window; SIDE * SIDE];
        let costs = Costs {
            window: 1.0,
            frame: 1.0,
        };
        turn_away(REGION, &trials, costs, &mut lending);
        assert!(lending.iter().all(|&way| way == Lending::None));
    }

    /// Shared samples scatter alike on both halves. Those of path tracing scatter more on the left; on
    /// the right they are stratified, so that every two of them make up for each other.
    #[test]
    fn tiles_turn_away_once_stratified_samples_have_overtaken() {
        let mut random = Random::new(10);
        let mut film = Film::new(REGION, Layout::new([]).unwrap());
        let mut trials = Trials::new(REGION);
        let mut lending = vec![Lending::Frame; SIDE * SIDE];
        let costs = Costs::new(49, 1, 3.0);
        for iteration in 0..16 {
            film.rows_mut()
                .zip(trials.rows_mut())
                .collect::<Vec<_>>()
                .into_iter()
                .for_each(|(mut row, mut probes)| {
                    for x in 0..SIDE {
                        let shared = random.next();
                        row.pixel(x).sums.add_radiance(Vec3A::splat(shared));
                        let alone = match (x < SIDE / 2, iteration % 2) {
                            (true, _) => 4.0 * random.next() - 1.5,
                            (false, 0) => 0.0,
                            (false, _) => 1.0,
                        };
                        if let Some(excess) = probes.at(x) {
                            excess.alone += alone - shared;
                        }
                    }
                });
            film.count_iteration();
            trials.look(&film, iteration + 1, costs, &mut lending);
            let alone = |right: bool| {
                let pixels = lending.iter().enumerate();
                let here = pixels.filter(|(pixel, _)| (pixel % SIDE >= SIDE / 2) == right);
                here.filter(|(_, lending)| !lending.is_some()).count() as f32
                    / (SIDE * SIDE / 2) as f32
            };
            // Before eight iterations nothing is known; then half a tile between both sides is open.
            let expected = if iteration + 1 < JUDGE_FROM {
                0.0..=0.0
            } else {
                0.6..=1.0
            };
            assert!(
                expected.contains(&alone(true)),
                "{iteration}: {}",
                alone(true)
            );
            assert!(alone(false) < 0.1, "{iteration}: {}", alone(false));
        }
    }
}
