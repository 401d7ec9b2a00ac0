//! Method PAPER: Zhou and Chen 2015 as printed, for comparison.
//!
//! Source: "Variance reduction using interframe coherence for animated scenes", Computational Visual
//! Media 1(4), sections 3 and 4. Equations, symbols and what the method costs in bias are in
//! docs/method.md.
//!
//! # As printed
//! - Pass 1 traces a camera ray and one gather ray by the BSDF, and records position and normal,
//!   direction and length R of the gather ray, the solid angle A of the light in its direction, and
//!   F = f L cos / p. A ray that leaves the scene brings the mean radiance of its leaf of the light
//!   tree and has R = infinity; one that does not has its length as R, and brings no light unless
//!   bounces are on.
//! - Pass 2 traces a second camera ray to a point x_i and goes through the N x N pixels around the
//!   same pixel in all B frames of the block. Records on another surface are left out: farther away
//!   than the projected block, or with a cosine of the normals below 0.9. The others count by the
//!   overlap C of Eq. 2 and 3; the pixel gets `sum C F / sum C` (Eq. 4, over frames Eq. 5).
//! - Blocks of B frames are disjoint. Iterations refine the picture (section 4.4).
//! - Lamps, suns and other small lights are found by sampling lights (section 4).
//!
//! # What the paper leaves open
//! - Recheck. A record is tested from x_i; what x_i sees replaces what the lender saw, and no record
//!   leaves the sum of C. NONE tests nothing, LIT the records that brought light, ALL every one.
//!   For ALL a record also holds the light that its ray would have brought had nothing been in the
//!   way.
//! - Where all C are zero the estimate is 0 / 0. Such a pixel gathers for itself.
//! - With bounces, a gather ray that hits a surface brings that surface's path-traced radiance.
//! - The normals compared are those of the triangles, not the shading normals.
//!
//! # Departures
//! - The sun of an environment image is a light of its own and not part of the light tree: as a leaf
//!   it would be the small area light for which the paper recommends light sampling.
//! - Eq. 2 by its fast form, off by at most 3.3e-5.
//! - Light samples of lamps and suns are joined by multiple importance sampling with the gather ray
//!   where that ray met the same light; neither part is borrowed.

use glam::Vec3A;
use rayon::prelude::*;

use super::{Canvas, Estimator, Sharing, View, rows_or_none};
use crate::contract::{Recheck, Settings};
use crate::error::Result;
use crate::film::Region;
use crate::math::cone::overlap_fast;
use crate::math::{Ray, luminance};
use crate::path::{Bounces, Continuation};
use crate::record::{RecordBuffer, Row, RowMut};
use crate::sampling::{Bsdf, Sampler, Strategy};
use crate::scene::Links;
use crate::surface::Surface;

/// Smallest cosine between the normals of pixels that share samples (section 4.1).
const NORMAL_COSINE: f32 = 0.9;

/// Smallest cosine of the viewing angle in the projected size of a block: beyond it the search
/// region would stretch along the surface without end.
const VIEW_COSINE: f32 = 0.15;

/// Marks the iteration number of pass 2: its camera ray has random numbers of its own.
const SECOND_PASS: u32 = 1 << 31;

/// Share of the distance to a recorded hit at which the recheck ends, so that it does not meet the
/// surface that was hit.
const RECHECK_END: f32 = 1.0 - 1e-3;

/// Neighbours at a time.
const LANES: usize = 8;
type Lanes = [f32; LANES];

/// Columns of the records. A record with a zero normal is none.
mod column {
    pub const POSITION: usize = 0;
    pub const NORMAL: usize = 3;
    pub const DIRECTION: usize = 6;
    /// F = f L cos / p.
    pub const CARRIED: usize = 9;
    /// r = R tan(beta) [m].
    pub const RADIUS: usize = 12;
    /// R [m], where visibility is tested again.
    pub const LENGTH: usize = 13;
    /// F as if nothing had been in the way, where every record is tested again.
    pub const OPEN: usize = 14;
}

/// Method PAPER.
pub struct Paper {
    half_block: usize,
    recheck: Recheck,
}

impl Paper {
    /// The method with the settings' block and recheck.
    pub fn new(settings: &Settings) -> Self {
        Self {
            half_block: settings.block as usize / 2,
            recheck: settings.recheck,
        }
    }

    fn columns(&self) -> usize {
        match self.recheck {
            Recheck::None => column::LENGTH,
            Recheck::Lit => column::OPEN,
            Recheck::All => column::OPEN + 3,
        }
    }
}

impl Estimator for Paper {
    type Memory = RecordBuffer;
    type History = ();

    fn memory(&self, region: Region) -> RecordBuffer {
        RecordBuffer::new(self.columns(), region.width, region.height)
    }

    fn memory_bytes(&self, memory: &RecordBuffer) -> usize {
        memory.memory_bytes()
    }

    /// Pass 1 of section 4.3.
    fn history(&self, _: Region) {}

    fn sample(
        &self,
        view: &View,
        iteration: u32,
        memory: &mut RecordBuffer,
        canvas: Option<Canvas<()>>,
    ) -> Result<()> {
        let width = view.region.width;
        let film = canvas.map(|canvas| canvas.film.rows_mut());
        let rows = rows_or_none(film, view.region).zip(memory.rows_mut());
        view.for_rows(rows, |y, (mut film, mut records)| {
            for x in 0..width {
                let shot = view.shoot(x, y, iteration);
                let Some(surface) = &shot.surface else {
                    self.write_nothing(&mut records, x);
                    continue;
                };
                let gathered = gather(view, surface, &shot.sampler);
                if let Some(row) = &mut film {
                    row.pixel(x).sums.add_radiance(gathered.own);
                }
                self.write(&mut records, x, surface, &gathered);
            }
        })
    }

    /// Pass 2 of section 4.3.
    fn share(&self, sharing: &Sharing<RecordBuffer>, canvas: Canvas<()>) -> Result<()> {
        let (view, iteration) = (sharing.view(), sharing.iteration);
        let lenders = sharing.lenders.iter();
        let lenders: Vec<&RecordBuffer> = lenders.map(|&index| &sharing.memories[index]).collect();
        view.for_rows(canvas.film.rows_mut(), |y, mut row| {
            for x in 0..row.width() {
                let shot = view.shoot(x, y, iteration | SECOND_PASS);
                let mut pixel = row.pixel(x);
                view.see(&shot, iteration, &mut pixel);
                let pixel = pixel.sums;
                if let Some(surface) = &shot.surface {
                    pixel.add_radiance(small_lights(view, surface, &shot.sampler));
                    let receiver = Receiver::new(view, surface, &shot.sampler, self);
                    let sums = receiver.borrow(&lenders, x, y);
                    let own = || gather(view, surface, &shot.sampler).carried;
                    pixel.add_radiance(sums.mean().unwrap_or_else(own));
                    pixel.add_effective_samples(sums.effective_samples());
                }
            }
        })
    }
}

impl Paper {
    fn write(&self, row: &mut RowMut, x: usize, surface: &Surface, gathered: &Gather) {
        let mut set = |first: usize, vector: Vec3A| {
            for (axis, value) in vector.to_array().into_iter().enumerate() {
                row.set(first + axis, x, value);
            }
        };
        set(column::POSITION, surface.position);
        set(column::NORMAL, surface.geometric_normal);
        set(column::DIRECTION, gathered.direction);
        set(column::CARRIED, gathered.carried);
        if self.recheck == Recheck::All {
            set(column::OPEN, gathered.open);
        }
        row.set(column::RADIUS, x, gathered.radius);
        if self.recheck != Recheck::None {
            row.set(column::LENGTH, x, gathered.length);
        }
    }

    fn write_nothing(&self, row: &mut RowMut, x: usize) {
        for axis in 0..3 {
            row.set(column::NORMAL + axis, x, 0.0);
        }
    }
}

/// What one gather ray brings.
struct Gather {
    direction: Vec3A,
    /// R: length of the ray [m].
    length: f32,
    /// r: radius of the cone's base [m], infinite where every shift leaves C at one.
    radius: f32,
    /// F: what the ray brought, for lending.
    carried: Vec3A,
    /// F as if nothing had been in the way.
    open: Vec3A,
    /// Light of lamps and suns that the ray met: the pixel's own.
    own: Vec3A,
}

/// Traces a gather ray off a surface that the camera sees.
fn gather(view: &View, surface: &Surface, sampler: &Sampler) -> Gather {
    let numbers = sampler.scatter(0);
    let Some(sample) = surface.bsdf.sample(numbers.lobe, numbers.direction) else {
        // No direction, no light: a dark sample that any neighbour could have drawn.
        return Gather {
            direction: surface.normal,
            length: f32::INFINITY,
            radius: f32::INFINITY,
            carried: Vec3A::ZERO,
            open: Vec3A::ZERO,
            own: Vec3A::ZERO,
        };
    };
    let pdf_solid_angle = surface.bsdf.pdf(sample.pdfs);
    let weight = sample.value.sum() / pdf_solid_angle;
    let direction = sample.direction;
    let start = Bounces::default();
    let bounces = view.tracer.after(start, surface, sample.part, sample.alpha);
    let strategy = Strategy::WithoutSky;
    let from = Continuation {
        throughput: weight.max_element(),
        wants_distance: true,
        ..Continuation::leaving(surface, direction, pdf_solid_angle, strategy, bounces)
    };
    let gathered = view.tracer.gather(&from, sampler);
    let leaf = view.light_tree.leaf(direction);
    let world = &view.tracer.frame.world;
    let is_seen = world.reach.includes(from.bounces.kind(), 0)
        && !view.tracer.hides_background(&from.bounces);
    let open = match is_seen {
        true => weight * leaf.radiance,
        false => Vec3A::ZERO,
    };
    let missed = gathered.distance == f32::INFINITY;
    let is_sun = view.tracer.lights.is_sun(direction);
    let sun = if is_sun {
        gathered.environment
    } else {
        Vec3A::ZERO
    };
    Gather {
        direction,
        length: gathered.distance,
        radius: base_radius(gathered.distance, leaf.tan_beta),
        carried: if missed {
            open
        } else {
            weight * gathered.indirect
        },
        open,
        own: weight * (gathered.lamps + sun),
    }
}

/// Light of lamps and suns by light sampling; gather rays find the sky.
fn small_lights(view: &View, surface: &Surface, sampler: &Sampler) -> Vec3A {
    let tracer = &view.tracer;
    let (from, strategy) = (Bounces::default(), Strategy::WithoutSky);
    let direct = tracer.direct(surface, &from, strategy, sampler, Bsdf::mixed);
    direct.sum()
}

/// r = R tan(beta); a light of a hemisphere or more covers every shift, however near.
fn base_radius(distance: f32, tan_beta: f32) -> f32 {
    if tan_beta == f32::INFINITY {
        tan_beta
    } else {
        distance * tan_beta
    }
}

/// The point x_i that borrows.
struct Receiver<'a> {
    view: &'a View<'a>,
    surface: &'a Surface,
    sampler: &'a Sampler,
    paper: &'a Paper,
    /// Square of the search region's radius [m^2].
    distance_squared: f32,
}

impl<'a> Receiver<'a> {
    fn new(view: &'a View, surface: &'a Surface, sampler: &'a Sampler, paper: &'a Paper) -> Self {
        let camera = &view.tracer.frame.camera;
        let wo = camera.direction_from(surface.position);
        let cosine = surface.geometric_normal.dot(wo).max(VIEW_COSINE);
        let depth = camera.depth(surface.position);
        let pixel_size = camera.pixel_size(depth, view.region.frame_width) / cosine;
        let side = (2 * paper.half_block + 1) as f32 * pixel_size;
        Self {
            view,
            surface,
            sampler,
            paper,
            // Half the diagonal of the projected block.
            distance_squared: 0.5 * side * side,
        }
    }

    /// Sums of Eq. 5 over the block around pixel (`x`, `y`) in every frame.
    fn borrow(&self, lenders: &[&RecordBuffer], x: usize, y: usize) -> Sums {
        let half = self.paper.half_block;
        let region = self.view.region;
        let last_x = (x + half + 1).min(region.width);
        let last_y = (y + half + 1).min(region.height);
        let mut sums = Sums::default();
        for records in lenders {
            for y in y.saturating_sub(half)..last_y {
                let row = records.row(y);
                for start in (x.saturating_sub(half)..last_x).step_by(LANES) {
                    self.add(&row, start, last_x - start, &mut sums);
                }
            }
        }
        sums
    }

    /// Adds up to `count` of eight neighbouring records.
    #[inline]
    fn add(&self, row: &Row, x: usize, count: usize, sums: &mut Sums) {
        let Some(neighbours) = Neighbours::load(row, x as i64) else {
            return;
        };
        let mut overlaps = neighbours.overlaps(self);
        for overlap in overlaps.iter_mut().skip(count) {
            *overlap = 0.0;
        }
        if self.paper.recheck == Recheck::None {
            sums.add(&overlaps, neighbours.carried);
        } else {
            let light = self.rechecked(row, x, &overlaps);
            sums.add(&overlaps, light.each_ref());
        }
    }

    /// The records' F with the visibility at x_i in place of their own.
    fn rechecked(&self, row: &Row, x: usize, overlaps: &Lanes) -> [Lanes; 3] {
        let mut light = [[0.0; LANES]; 3];
        for (lane, overlap) in overlaps.iter().enumerate() {
            if *overlap > 0.0 {
                let visible = self.visible_light(row, x + lane).to_array();
                for (channel, value) in light.iter_mut().zip(visible) {
                    channel[lane] = value;
                }
            }
        }
        light
    }

    fn visible_light(&self, row: &Row, x: usize) -> Vec3A {
        let vector =
            |first: usize| Vec3A::from_array([0, 1, 2].map(|axis| row.get(first + axis, x)));
        let carried = vector(column::CARRIED);
        let direction = vector(column::DIRECTION);
        let length = row.get(column::LENGTH, x);
        let missed = length == f32::INFINITY;
        let all = self.paper.recheck == Recheck::All;
        let open = if all { vector(column::OPEN) } else { carried };
        let sees_sky = || self.is_free(&self.surface.ray_towards(direction));
        let sees_hit = || {
            let offset = vector(column::POSITION) + length * direction - self.surface.position;
            let distance = offset.length();
            let mut ray = self.surface.ray_towards(offset / distance);
            ray.t_max = distance * RECHECK_END;
            self.is_free(&ray)
        };
        if (all || missed) && open != Vec3A::ZERO && sees_sky() {
            open
        } else if !missed && carried != Vec3A::ZERO && sees_hit() {
            carried
        } else {
            Vec3A::ZERO
        }
    }

    /// Whether nothing lies on a ray; what lets a share of the light through does so by chance.
    fn is_free(&self, ray: &Ray) -> bool {
        let (info, tracer) = (Bounces::default().shadow_info(), &self.view.tracer);
        let share = tracer.unblocked_share(ray, &info, Links::default());
        luminance(share) > self.sampler.transparency(0)
    }
}

/// Eight records side by side.
struct Neighbours<'a> {
    position: [&'a Lanes; 3],
    normal: [&'a Lanes; 3],
    direction: [&'a Lanes; 3],
    carried: [&'a Lanes; 3],
    radius: &'a Lanes,
}

impl<'a> Neighbours<'a> {
    #[inline]
    fn load(row: &Row<'a>, x: i64) -> Option<Self> {
        let vector = |first: usize| -> Option<[&'a Lanes; 3]> {
            Some([
                row.lanes(first, x)?,
                row.lanes(first + 1, x)?,
                row.lanes(first + 2, x)?,
            ])
        };
        Some(Self {
            position: vector(column::POSITION)?,
            normal: vector(column::NORMAL)?,
            direction: vector(column::DIRECTION)?,
            carried: vector(column::CARRIED)?,
            radius: row.lanes(column::RADIUS, x)?,
        })
    }

    /// C of Eq. 2 and 3 for valid records, zero for the others.
    #[inline]
    fn overlaps(&self, receiver: &Receiver) -> Lanes {
        let position = receiver.surface.position.to_array();
        let normal = receiver.surface.geometric_normal.to_array();
        let mut overlaps = [0.0; LANES];
        for lane in 0..LANES {
            let offset = [0, 1, 2].map(|axis| self.position[axis][lane] - position[axis]);
            let direction = self.direction.map(|d| d[lane]);
            let cosine = dot(self.normal.map(|n| n[lane]), normal);
            let near = dot(offset, offset) <= receiver.distance_squared;
            let is_valid = near & (cosine >= NORMAL_COSINE);
            overlaps[lane] =
                f32::from(u8::from(is_valid)) * overlap(offset, direction, self.radius[lane]);
        }
        overlaps
    }
}

#[inline]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Eq. 2 and 3; the same as `cone::overlap(cone::shift(..))`, without branches.
#[inline]
fn overlap(offset: [f32; 3], direction: [f32; 3], radius: f32) -> f32 {
    let along = dot(offset, direction);
    let across = [0, 1, 2].map(|axis| offset[axis] - along * direction[axis]);
    let shift = dot(across, across).sqrt();
    // Points without a shift see the same light, even one without extent (0 / 0).
    let g = if shift > 0.0 {
        shift / (2.0 * radius)
    } else {
        0.0
    };
    overlap_fast(g.min(1.0))
}

/// Sums of Eq. 5; one lane each.
#[derive(Default)]
struct Sums {
    /// W.
    overlap: Lanes,
    overlap_squared: Lanes,
    light: [Lanes; 3],
}

impl Sums {
    #[inline]
    fn add(&mut self, overlaps: &Lanes, light: [&Lanes; 3]) {
        for lane in 0..LANES {
            self.overlap[lane] += overlaps[lane];
            self.overlap_squared[lane] += overlaps[lane] * overlaps[lane];
            for (sum, light) in self.light.iter_mut().zip(light) {
                sum[lane] += overlaps[lane] * light[lane];
            }
        }
    }

    /// Eq. 5 for one camera ray; `None` where it is 0 / 0.
    fn mean(&self) -> Option<Vec3A> {
        let total = |lanes: &Lanes| lanes.iter().sum::<f32>();
        let overlap = total(&self.overlap);
        (overlap > 0.0).then(|| Vec3A::from_array(self.light.each_ref().map(total)) / overlap)
    }

    /// Samples of equal weight that would be as good; one where the pixel gathers for itself.
    fn effective_samples(&self) -> f32 {
        let sum: f32 = self.overlap.iter().sum();
        let squares: f32 = self.overlap_squared.iter().sum();
        if squares > 0.0 {
            sum * sum / squares
        } else {
            1.0
        }
    }
}

#[cfg(test)]
mod tests;
