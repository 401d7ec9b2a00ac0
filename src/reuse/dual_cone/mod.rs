//! Method DUAL_CONE: multiple importance sampling over the records of a block of pixels and frames,
//! with the dual cone's overlap as confidence.
//!
//! Light that gather rays find falls into classes, and a class fixes the cone of Eq. 3, so that the
//! weight of every neighbour is known for every class, whatever direction the neighbour happened to
//! sample. With w_jk the weight of neighbour j for class k, a pixel's irradiance is
//!
//! ```text
//! E_i = sum_k [ sum_{j of class k} w_jk v_j cos_i ] / [ sum_{all j} w_jk ]
//! ```
//!
//! where v_j = L_j / (pi p_j) is the record's radiance over its density. The denominator runs over
//! all valid neighbours: one that found light of another class says that this class was dark in
//! its direction. Lamps, suns and glossy reflection stay the pixel's own.
//!
//! Departures from the paper, each for a measured reason (docs/method.md): a sum of weights per class
//! in place of one sum; a distance R that does not depend on the sample's own outcome; the
//! reflectance and cosine of the receiver in place of the lender's; blocks that follow the camera's
//! and the objects' motion; a smooth kernel in place of the overlap's arc cosine.

mod borrow;
mod drift;
mod gloss;
mod reads;
mod records;
mod sample;
mod tiles;
mod veto;

use rayon::prelude::*;

use self::borrow::{Borrow, BorrowingRow, Receiver, kernel_floor};
use self::drift::Drift;
use self::reads::{Reads, either};
use self::records::{Class, LENT_CLASSES, Records};
use self::sample::Pass;
use self::tiles::Tiles;
use self::veto::{Costs, Lending, PILOT_ITERATIONS, Trials};
use super::{Canvas, Estimator, Sharing, View, rows_or_none};
use crate::contract::{Settings, Share};
use crate::error::Result;
use crate::film::{Film, Region};
use crate::kernel::vector::{to_upper_half, upper_half};
use crate::path::Bounces;
use crate::sampling::Part;
use crate::scene::Motion;

/// Iterations whose hit distances make up R; after them it is frozen, so that later estimates do not
/// depend on their own samples.
const REACH_ITERATIONS: u32 = 4;
/// Half the side of the block of pixels over which R is pooled.
const REACH_HALF: usize = 2;

/// Method DUAL_CONE.
pub struct DualCone {
    half_block: usize,
    /// Whether a pixel borrows from one pixel of each other frame alone.
    is_one_to_one: bool,
}

/// What a frame keeps between passes.
pub struct Memory {
    records: Records,
    receivers: Vec<Receiver>,
    reach: Vec<Reach>,
    /// R of each pixel [m].
    distances: Vec<f32>,
    /// The tiles whose records are read; all without.
    read: Option<Tiles<bool>>,
}

/// What a frame that borrows keeps between iterations.
pub struct History {
    /// From where each pixel borrows.
    lending: Vec<Lending>,
    /// Rays of the pilot iterations.
    pilot_rays: u64,
    /// How far what pixels borrow is from what they find themselves.
    drift: Drift,
    /// How some pixels would fare by other ways.
    trials: Trials,
    /// Which records it reads.
    reads: Reads,
}

/// Sums towards the harmonic mean of a pixel's hit distances.
#[derive(Clone, Copy, Default)]
struct Reach {
    /// Upper half of a float: what R is made of need not be exact.
    inverse_sum: i16,
    count: u16,
}

impl Reach {
    fn add(&mut self, distance: f32) {
        let sum = upper_half(self.inverse_sum) + 1.0 / distance.max(f32::MIN_POSITIVE);
        self.inverse_sum = to_upper_half(sum);
        self.count += 1;
    }
}

impl DualCone {
    /// The method with the settings' block.
    pub fn new(settings: &Settings) -> Self {
        let is_one_to_one = match settings.share {
            // A denoiser takes noise that neighbours have in common for a part of the picture.
            Share::Automatic => settings.denoise,
            Share::All => false,
            Share::Frames => true,
        };
        Self {
            half_block: if is_one_to_one {
                0
            } else {
                settings.block as usize / 2
            },
            is_one_to_one,
        }
    }
}

impl Estimator for DualCone {
    type Memory = Memory;
    type History = History;

    fn memory(&self, region: Region) -> Memory {
        let pixels = region.width * region.height;
        Memory {
            records: Records::new(region.width, region.height),
            receivers: vec![Receiver::default(); pixels],
            reach: vec![Reach::default(); pixels],
            distances: vec![0.0; pixels],
            read: None,
        }
    }

    fn memory_bytes(&self, memory: &Memory) -> usize {
        memory.records.memory_bytes()
            + size_of_val(&memory.receivers[..])
            + size_of_val(&memory.reach[..])
            + size_of_val(&memory.distances[..])
    }

    fn history(&self, region: Region) -> History {
        History {
            lending: vec![Lending::Window; region.width * region.height],
            pilot_rays: 0,
            drift: Drift::new(region),
            trials: Trials::new(region),
            reads: Reads::default(),
        }
    }

    fn history_bytes(&self, history: &History) -> usize {
        size_of_val(&history.lending[..])
            + history.drift.memory_bytes()
            + history.trials.memory_bytes()
            + history.reads.memory_bytes()
    }

    fn borrowing(&self, history: &History, _: Region) -> Vec<f32> {
        let share = |&lending: &Lending| 0.5 * lending as u8 as f32;
        history.lending.iter().map(share).collect()
    }

    fn expect(&self, memory: &mut Memory, frame: usize, readers: &[&History]) {
        let mut read = readers.iter().map(|reader| reader.reads.tiles(frame));
        let first = read.next().flatten().cloned();
        memory.read = read.fold(first, |all, more| Some(either(all?, more?)));
    }

    fn sample(
        &self,
        view: &View,
        iteration: u32,
        memory: &mut Memory,
        canvas: Option<Canvas<History>>,
    ) -> Result<()> {
        let pass = Pass::new(view, iteration);
        let width = view.region.width;
        let (film, mut history) = match canvas {
            Some(Canvas { film, history }) => (Some(film.rows_mut()), Some(history)),
            None => (None, None),
        };
        let notes = history.as_deref_mut().map(|history| {
            let lending = history.lending.par_chunks(width);
            lending.zip(history.trials.rows_mut())
        });
        let own = rows_or_none(film, view.region).zip(rows_or_none(notes, view.region));
        let receivers = memory.receivers.par_chunks_mut(width);
        let reach = memory.reach.par_chunks_mut(width);
        let rows = own.zip(memory.records.rows_mut()).zip(receivers.zip(reach));
        let read = memory.read.as_ref();
        let lends = |x, y| read.is_none_or(|tiles| tiles.get(tiles.at(x, y)));
        let rays = view.count_rays(
            rows,
            |y, (((mut film, mut notes), mut records), (receivers, reach))| {
                for x in 0..width {
                    let lends = lends(x, y);
                    let own = film.as_mut().zip(notes.as_ref());
                    let own = own.map(|(row, (lending, _))| (row.pixel(x), lending[x]));
                    let sample = pass.sample_pixel(x, y, lends, own);
                    let probe = notes.as_mut().and_then(|(_, probes)| probes.at(x));
                    if let Some(excess) = probe {
                        excess.alone += sample.excess;
                    }
                    if lends {
                        sample.record.write(&mut records, x);
                        receivers[x] = sample.receiver;
                    }
                    if iteration < REACH_ITERATIONS
                        && let Some(distance) = sample.distance
                    {
                        reach[x].add(distance);
                    }
                }
            },
        )?;
        if let Some(history) = history
            && iteration < PILOT_ITERATIONS
        {
            history.pilot_rays += rays;
        }
        if iteration < REACH_ITERATIONS {
            pool_distances(view, memory);
        }
        Ok(())
    }

    fn share(&self, sharing: &Sharing<Memory>, canvas: Canvas<History>) -> Result<()> {
        let Canvas { film, history } = canvas;
        let view = sharing.view();
        let lenders = sharing.lenders.iter();
        let motions: Vec<Vec<Motion>> = lenders
            .map(|&lender| view.window.motions(sharing.target, lender))
            .collect();
        let reads = std::mem::take(&mut history.reads);
        let borrow = Borrow {
            sharing,
            motions: &motions,
            reads: &reads,
            classes: lent_classes(view),
            half_block: self.half_block,
            is_one_to_one: self.is_one_to_one,
            kernel_floor: kernel_floor(sharing.iteration),
        };
        add_borrowed(&borrow, history, film)?;
        let iterations = sharing.iteration + 1;
        let (costs, lending) = (self.costs(&borrow, history), &mut history.lending);
        history.drift.look(view.region, iterations, lending);
        history.trials.look(film, iterations, costs, lending);
        let may_have_changed = iterations >= PILOT_ITERATIONS && iterations.is_power_of_two();
        history.reads = match may_have_changed {
            true => Reads::of(&borrow, lending),
            false => reads,
        };
        Ok(())
    }
}

impl DualCone {
    fn costs(&self, borrow: &Borrow, history: &History) -> Costs {
        let records = (2 * self.half_block + 1).pow(2);
        let samples = history.lending.len() as f32 * PILOT_ITERATIONS as f32;
        let rays = history.pilot_rays as f32 / samples;
        Costs::new(records, borrow.sharing.lenders.len(), rays)
    }
}

/// Adds what pixels borrow from where they were chosen to.
fn add_borrowed(borrow: &Borrow, history: &mut History, film: &mut Film) -> Result<()> {
    let view = borrow.sharing.view();
    let width = view.region.width;
    let lending = history.lending.par_chunks(width);
    let drift = history.drift.sums.par_chunks_mut(width);
    let probes = history.trials.rows_mut();
    let rows = film.rows_mut().zip(probes).zip(lending.zip(drift));
    view.for_rows(rows, |y, ((pixels, probes), (lending, drift))| {
        borrow.add_row(BorrowingRow {
            y,
            pixels,
            lending,
            probes,
            drift,
        });
    })
}

/// Whether gather rays bring light that surfaces reflect.
fn lends_indirect(view: &View) -> bool {
    let bounces = Bounces::default().after(Part::Diffuse);
    !bounces.at_limit(view.tracer.settings)
}

/// Classes that light in a frame may be of.
fn lent_classes(view: &View) -> [bool; LENT_CLASSES] {
    let mut classes = [false; LENT_CLASSES];
    let mut add = |class: Class| classes[class as usize] = true;
    let leaves = view.light_tree.leaves().iter();
    leaves.for_each(|leaf| add(Class::of_sky(leaf)));
    if lends_indirect(view) {
        add(Class::Indirect);
    }
    classes
}

/// R of every pixel: the harmonic mean of the hit distances around it, which follows the nearest
/// occluders, capped by the size of the scene.
fn pool_distances(view: &View, memory: &mut Memory) {
    let (width, height) = (view.region.width, view.region.height);
    let reach = &memory.reach;
    let inverse_size = 1.0 / view.scene_size;
    memory
        .distances
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(y, row)| {
            for (x, distance) in row.iter_mut().enumerate() {
                let (mut sum, mut count) = (0.0, 0.0);
                for y in y.saturating_sub(REACH_HALF)..(y + REACH_HALF + 1).min(height) {
                    for x in x.saturating_sub(REACH_HALF)..(x + REACH_HALF + 1).min(width) {
                        sum += upper_half(reach[y * width + x].inverse_sum);
                        count += f32::from(reach[y * width + x].count);
                    }
                }
                let inverse = if count > 0.0 { sum / count } else { 0.0 };
                *distance = 1.0 / (inverse + inverse_size);
            }
        });
}
