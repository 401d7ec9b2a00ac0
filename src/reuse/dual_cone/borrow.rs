//! The second pass: eight neighbours at a time.
#![allow(
    clippy::needless_range_loop,
    reason = "a lane is an index into many arrays"
)]

use glam::Vec3A;

use super::Memory;
use super::records::{LENT_CLASSES, TAN_BETA, column};
use crate::film::PixelSums;
use crate::kernel::Vectorised;
use crate::record::{PADDING, Row};
use crate::reuse::View;
use crate::scene::Motion;
use crate::surface::Surface;

/// Neighbours at a time.
const LANES: usize = 8;
type Lanes = [f32; LANES];

/// Smallest cosine between the normals of pixels that share samples (the paper's section 4.1).
const NORMAL_COSINE: f32 = 0.9;
/// Smallest cosine of the viewing angle in the projected size of a pixel: beyond it the block would
/// stretch along the surface without end.
const VIEW_COSINE: f32 = 0.15;
/// Diagonal over side of the projected block.
const DIAGONAL: f32 = 1.42;
/// Smallest radius of a kernel in projected pixels, in the first iteration. It shrinks as
/// (n + 1)^(-1/4), so that its bias vanishes more slowly than the noise that it saves.
const KERNEL_FLOOR: f32 = 4.0;
/// Radius of the kernel (1 - d^2/rho^2)^2 over the distance where Eq. 2 reaches zero; the two then
/// have the same mean over the disk.
const KERNEL_SCALE: f32 = 0.85;

/// The part of a uniform sky's irradiance that records of a neighbour bring whose normal has this
/// cosine with the receiver's. Its hemisphere covers (1 + cos) / 2 of the receiver's; the limit on
/// the records' cosines takes a little more. The integral of min(cos_i, 3 cos_j) over both
/// hemispheres is this line within 0.2 % for cosines from 0.9 on. Dividing by it keeps a uniform sky
/// uniform on curved surfaces.
#[inline(always)]
fn brought(cosine: f32) -> f32 {
    (0.26 + 0.74 * cosine).min(1.0)
}

/// The pixel that borrows.
#[derive(Clone, Copy, Default)]
pub struct Receiver {
    /// Share of light that its diffuse part reflects.
    albedo: [f32; 3],
    /// Its shading normal.
    normal: [f32; 3],
}

impl Receiver {
    /// What a surface needs to borrow.
    pub fn at(surface: &Surface) -> Self {
        Self {
            albedo: surface.bsdf.albedo_diffuse().to_array(),
            normal: surface.normal.to_array(),
        }
    }
}

/// The frames of one borrowing pass.
pub struct Borrow<'a> {
    pub views: &'a [View<'a>],
    pub memories: &'a [Memory],
    /// The frame that borrows.
    pub target: usize,
    /// The frames that lend, the target among them.
    pub lenders: &'a [usize],
    /// Per lender and object: what carries the target's points to the lender.
    pub motions: &'a [Vec<Motion>],
    pub half_block: usize,
    pub iteration: u32,
}

/// One row of it.
pub struct BorrowRow<'a, 'b> {
    pub borrow: &'b Borrow<'a>,
    pub y: usize,
    pub pixels: &'b mut [PixelSums],
}

impl Vectorised for BorrowRow<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let memory = &self.borrow.memories[self.borrow.target];
        let row = memory.records.row(self.y);
        for (x, pixel) in self.pixels.iter_mut().enumerate() {
            let Some(block) = self.borrow.block(&row, x, self.y) else {
                continue;
            };
            let mut sums = Sums::default();
            self.borrow.add_lenders(&block, x, self.y, &mut sums);
            let receiver = &memory.receivers[self.y * self.borrow.width() + x];
            pixel.add_radiance(Vec3A::from(receiver.albedo) * sums.irradiance());
            pixel.add_effective_samples(sums.effective_samples());
        }
    }
}

/// What a pixel looks for in its neighbours.
struct Block {
    position: Vec3A,
    geometric_normal: Vec3A,
    normal: Vec3A,
    object: f32,
    /// Largest squared distance of a valid neighbour [m^2].
    distance_squared: f32,
    /// 1 / rho^2 of each class [1/m^2].
    inverse_radius_squared: [f32; LENT_CLASSES],
}

/// Where a block lies in a lender.
struct Place {
    position: Vec3A,
    geometric_normal: Vec3A,
    /// Lower left pixel of the block.
    x: i64,
    y: i64,
    /// Only records of this object are valid; of any where it is negative.
    object: f32,
}

/// Weighted sums of each class; one lane each.
#[derive(Default)]
struct Sums {
    weight: [Lanes; LENT_CLASSES],
    value: [[Lanes; 3]; LENT_CLASSES],
    /// Squared weights of the indirect class, for the effective number of samples.
    weight_squared: Lanes,
}

impl Borrow<'_> {
    fn width(&self) -> usize {
        self.views[self.target].region.width
    }

    /// The block around a pixel, or `None` where it shows no surface.
    #[inline(always)]
    fn block(&self, row: &Row, x: usize, y: usize) -> Option<Block> {
        let vector =
            |first: usize| Vec3A::from_array([0, 1, 2].map(|axis| row.get(first + axis, x)));
        let geometric_normal = vector(column::NORMAL);
        if geometric_normal == Vec3A::ZERO {
            return None;
        }
        let view = &self.views[self.target];
        let memory = &self.memories[self.target];
        let camera = &view.tracer.frame.camera;
        let position = vector(column::POSITION);
        let wo = (camera.position() - position).normalize_or_zero();
        let cosine = geometric_normal.dot(wo).abs().max(VIEW_COSINE);
        let pixel_size =
            camera.pixel_size(camera.depth(position), view.region.frame_width) / cosine;
        let side = self.half_block as f32 + 0.7;
        let floor = KERNEL_FLOOR * pixel_size * ((self.iteration + 1) as f32).powf(-0.25);
        let index = y * self.width() + x;
        let distance = memory.distances[index];
        Some(Block {
            position,
            geometric_normal,
            normal: Vec3A::from(memory.receivers[index].normal),
            object: row.get(column::OBJECT, x),
            distance_squared: (DIAGONAL * side * pixel_size).powi(2),
            inverse_radius_squared: TAN_BETA.map(|tan_beta| {
                // Eq. 3 reaches g = 1 at d = 2 R tan(beta).
                let radius = KERNEL_SCALE * (2.0 * distance * tan_beta).max(floor);
                1.0 / (radius * radius)
            }),
        })
    }

    /// Where the block lies in a lender: the same pixel in the target itself; elsewhere around the
    /// projection of the point, which moves with its object.
    #[inline(always)]
    fn place(&self, block: &Block, lender: usize, x: usize, y: usize) -> Option<Place> {
        let half = self.half_block as i64;
        let frame = self.lenders[lender];
        if frame == self.target {
            return Some(Place {
                position: block.position,
                geometric_normal: block.geometric_normal,
                x: x as i64 - half,
                y: y as i64 - half,
                object: -1.0,
            });
        }
        let (position, geometric_normal, object) = match self.motions[lender][block.object as usize]
        {
            Motion::Absent => return None,
            Motion::Still => (block.position, block.geometric_normal, -1.0),
            Motion::Rigid(matrix) => (
                matrix.transform_point3a(block.position),
                matrix
                    .transform_vector3a(block.geometric_normal)
                    .normalize_or_zero(),
                block.object,
            ),
        };
        let view = &self.views[frame];
        let (x, y) = view
            .region
            .pixel_at(view.tracer.frame.camera.project(position)?);
        // A row's padding holds what reaches over its ends.
        let reach = (PADDING - LANES) as i64 - half;
        let near = x > -reach && x < view.region.width as i64 + reach;
        near.then_some(Place {
            position,
            geometric_normal,
            x: x - half,
            y: y - half,
            object,
        })
    }

    #[inline(always)]
    fn add_lenders(&self, block: &Block, x: usize, y: usize, sums: &mut Sums) {
        let side = 2 * self.half_block + 1;
        for lender in 0..self.lenders.len() {
            let Some(place) = self.place(block, lender, x, y) else {
                continue;
            };
            let frame = self.lenders[lender];
            let height = self.views[frame].region.height as i64;
            let first = place.y.clamp(0, height);
            let last = (place.y + side as i64).clamp(0, height);
            for y in first..last {
                let row = self.memories[frame].records.row(y as usize);
                for start in (0..side).step_by(LANES) {
                    let lanes = (side - start).min(LANES);
                    sums.add(block, &place, &row, place.x + start as i64, lanes);
                }
            }
        }
    }
}

impl Sums {
    /// Adds the first `count` of eight neighbours that start at pixel `x` of a row.
    #[inline(always)]
    fn add(&mut self, block: &Block, place: &Place, row: &Row, x: i64, count: usize) {
        let Some(neighbours) = Neighbours::load(row, x) else {
            return;
        };
        let (shared, distance_squared) = neighbours.shared(block, place, count);
        if shared == [0.0; LANES] {
            return;
        }
        let cosine = neighbours.cosine(block.normal);
        for class in 0..LENT_CLASSES {
            for lane in 0..LANES {
                let falloff = 1.0 - distance_squared[lane] * block.inverse_radius_squared[class];
                let falloff = falloff.max(0.0);
                let kernel = falloff * falloff;
                let weight = kernel * f32::from(u8::from(shared[lane] > 0.0));
                self.weight[class][lane] += kernel * shared[lane];
                if class == LENT_CLASSES - 1 {
                    self.weight_squared[lane] += weight * weight;
                }
                let is_class = f32::from(u8::from(neighbours.class[lane] == class as f32));
                let share = weight * is_class * cosine[lane];
                for channel in 0..3 {
                    self.value[class][channel][lane] += share * neighbours.value[channel][lane];
                }
            }
        }
    }

    /// Irradiance over pi: the classes' weighted means, added up.
    fn irradiance(&self) -> Vec3A {
        let total = |lanes: &Lanes| lanes.iter().sum::<f32>();
        let mut irradiance = Vec3A::ZERO;
        for class in 0..LENT_CLASSES {
            let weight = total(&self.weight[class]);
            if weight > 0.0 {
                let value = Vec3A::from_array(self.value[class].each_ref().map(total));
                irradiance += value / weight;
            }
        }
        irradiance
    }

    /// Samples of equal weight that would be as good, for the widest class.
    fn effective_samples(&self) -> f32 {
        let sum: f32 = self.weight[LENT_CLASSES - 1].iter().sum();
        let squares: f32 = self.weight_squared.iter().sum();
        if squares > 0.0 {
            sum * sum / squares
        } else {
            0.0
        }
    }
}

/// Eight records side by side.
struct Neighbours<'a> {
    position: [&'a Lanes; 3],
    normal: [&'a Lanes; 3],
    direction: [&'a Lanes; 3],
    value: [&'a Lanes; 3],
    cosine_limit: &'a Lanes,
    class: &'a Lanes,
    object: &'a Lanes,
}

impl<'a> Neighbours<'a> {
    #[inline(always)]
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
            value: vector(column::VALUE)?,
            cosine_limit: row.lanes(column::COSINE_LIMIT, x)?,
            class: row.lanes(column::CLASS, x)?,
            object: row.lanes(column::OBJECT, x)?,
        })
    }

    /// For neighbours on the same stretch of surface the part of a uniform sky's irradiance that
    /// their records bring; zero for other neighbours. And squared distances [m^2].
    #[inline(always)]
    fn shared(&self, block: &Block, place: &Place, count: usize) -> (Lanes, Lanes) {
        let (position, normal) = (place.position.to_array(), place.geometric_normal.to_array());
        let mut shared = [0.0; LANES];
        let mut distance_squared = [0.0; LANES];
        for lane in 0..LANES {
            let mut squared = 0.0;
            let mut cosine = 0.0;
            for axis in 0..3 {
                let offset = self.position[axis][lane] - position[axis];
                squared += offset * offset;
                cosine += self.normal[axis][lane] * normal[axis];
            }
            distance_squared[lane] = squared;
            let same_object = place.object < 0.0 || self.object[lane] == place.object;
            let near = squared <= block.distance_squared;
            let is_valid = (lane < count) & near & (cosine >= NORMAL_COSINE) & same_object;
            shared[lane] = f32::from(u8::from(is_valid)) * brought(cosine);
        }
        (shared, distance_squared)
    }

    /// Cosine of each record's direction at the receiver, limited by the record's own.
    #[inline(always)]
    fn cosine(&self, normal: Vec3A) -> Lanes {
        let normal = normal.to_array();
        let mut cosine = [0.0; LANES];
        for lane in 0..LANES {
            let mut dot = 0.0;
            for axis in 0..3 {
                dot += self.direction[axis][lane] * normal[axis];
            }
            cosine[lane] = dot.max(0.0).min(self.cosine_limit[lane]);
        }
        cosine
    }
}
