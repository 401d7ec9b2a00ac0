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
mod records;
mod sample;
mod veto;

use rayon::prelude::*;

use self::borrow::{Borrow, Notes, Receiver, kernel_floor};
use self::records::{Class, LENT_CLASSES, Records};
use self::sample::Pass;
use self::veto::{Costs, PILOT_ITERATIONS};
use super::{Estimator, View, film_rows};
use crate::contract::{Settings, Share};
use crate::error::Result;
use crate::film::{Film, Lending, Pilot, Region};
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

    fn memory(&self, region: Region) -> Memory {
        let pixels = region.width * region.height;
        Memory {
            records: Records::new(region.width, region.height),
            receivers: vec![Receiver::default(); pixels],
            reach: vec![Reach::default(); pixels],
            distances: vec![0.0; pixels],
        }
    }

    fn memory_bytes(&self, memory: &Memory) -> usize {
        memory.records.memory_bytes()
            + size_of_val(&memory.receivers[..])
            + size_of_val(&memory.reach[..])
            + size_of_val(&memory.distances[..])
    }

    fn sample(
        &self,
        view: &View,
        iteration: u32,
        memory: &mut Memory,
        film: Option<&mut Film>,
    ) -> Result<()> {
        let pass = Pass::new(view, iteration);
        let width = view.region.width;
        let receivers = memory.receivers.par_chunks_mut(width);
        let reach = memory.reach.par_chunks_mut(width);
        let rows = film_rows(film, view.region)
            .zip(memory.records.rows_mut())
            .zip(receivers)
            .zip(reach);
        view.for_rows(rows, |y, (((mut film, mut records), receivers), reach)| {
            for x in 0..width {
                let mut pixel = film.as_deref_mut().map(|row| &mut row[x]);
                let sample = pass.sample_pixel(x, y, &mut pixel);
                sample.record.write(&mut records, x);
                receivers[x] = sample.receiver;
                if iteration < REACH_ITERATIONS
                    && let Some(distance) = sample.distance
                {
                    reach[x].add(distance);
                }
            }
        })?;
        if iteration < REACH_ITERATIONS {
            pool_distances(view, memory);
        }
        Ok(())
    }

    fn share(
        &self,
        views: &[View],
        memories: &[Memory],
        target: usize,
        lenders: &[usize],
        iteration: u32,
        film: &mut Film,
    ) -> Result<()> {
        let view = &views[target];
        let motions: Vec<Vec<Motion>> = lenders
            .iter()
            .map(|&lender| view.window.motions(target, lender))
            .collect();
        let borrow = Borrow {
            views,
            memories,
            target,
            lenders,
            motions: &motions,
            classes: lent_classes(view),
            half_block: self.half_block,
            is_one_to_one: self.is_one_to_one,
            kernel_floor: kernel_floor(iteration),
        };
        if iteration >= PILOT_ITERATIONS {
            share_as_chosen(&borrow, film)?;
            drift::look(
                view.region,
                iteration + 1,
                &mut film.drift,
                &mut film.lending,
            );
            return Ok(());
        }
        let pilot = share_all_ways(&borrow, film)?;
        self.choose(view, lenders.len(), pilot, film);
        Ok(())
    }
}

impl DualCone {
    /// Once both pilot iterations are there, chooses from where pixels go on borrowing.
    fn choose(&self, view: &View, lenders: usize, pilot: Vec<Pilot>, film: &mut Film) {
        if film.pilot.is_empty() {
            film.lending = vec![Lending::Window; pilot.len()];
            film.pilot = pilot;
            return;
        }
        let first = std::mem::take(&mut film.pilot);
        let both = pilot.iter().zip(&first);
        let second: Vec<Pilot> = both.map(|(sum, first)| sum.less(first.window)).collect();
        let records = (2 * self.half_block + 1).pow(2);
        let costs = Costs::new(records, lenders, lends_indirect(view));
        film.lending = veto::choose(view.region, &first, &second, costs);
        film.drift = drift::none(view.region);
    }
}

/// Every pixel borrows; returns what each has then, and what it would have otherwise.
fn share_all_ways(borrow: &Borrow, film: &mut Film) -> Result<Vec<Pilot>> {
    let view = &borrow.views[borrow.target];
    let Region { width, height, .. } = view.region;
    let mut pilot = vec![Pilot::default(); width * height];
    let rows = film.rows_mut().zip(pilot.par_chunks_mut(width));
    view.for_rows(rows, |y, (pixels, pilot)| {
        borrow.add_row(y, pixels, Notes::Pilot(pilot));
    })?;
    Ok(pilot)
}

/// Every pixel borrows from where it was chosen to.
fn share_as_chosen(borrow: &Borrow, film: &mut Film) -> Result<()> {
    let view = &borrow.views[borrow.target];
    let width = view.region.width;
    let (pixels, lending, drift) = film.pixels_and_lending();
    let rows = pixels.par_chunks_mut(width);
    let choices = lending.par_chunks(width);
    let sums = drift.sums.par_chunks_mut(width);
    view.for_rows(
        rows.zip(choices).zip(sums),
        |y, ((pixels, choice), drift)| {
            borrow.add_row(y, pixels, Notes::Choice(choice, drift));
        },
    )
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
