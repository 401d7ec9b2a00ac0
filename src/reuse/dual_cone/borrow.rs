//! The second pass: four neighbours at a time.

use glam::{Vec3A, Vec4};

use super::Memory;
use super::records::{LENT_CLASSES, TAN_BETA, column};
use crate::film::PixelSums;
use crate::record::{PADDING, Row};
use crate::reuse::View;
use crate::scene::Motion;
use crate::surface::Surface;

/// Neighbours at a time, one in each lane of a [`Vec4`]. Left to itself the compiler does one.
const LANES: usize = 4;
/// The number of each lane.
const LANE: Vec4 = Vec4::new(0.0, 1.0, 2.0, 3.0);

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
fn brought(cosine: Vec4) -> Vec4 {
    (0.74 * cosine + 0.26).min(Vec4::ONE)
}

/// The pixel that borrows.
#[derive(Clone, Copy, Default)]
pub struct Receiver {
    /// Share of light that its Lambert part reflects.
    albedo: [f32; 3],
    /// The shading normal of that part.
    normal: [f32; 3],
}

impl Receiver {
    /// What a surface needs to borrow.
    pub fn at(surface: &Surface) -> Self {
        Self {
            albedo: surface.bsdf.albedo_lambert().to_array(),
            normal: surface.bsdf.lambert_normal().to_array(),
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
    weight: [Vec4; LENT_CLASSES],
    value: [[Vec4; 3]; LENT_CLASSES],
    /// Squared weights of the widest class, for the effective number of samples.
    weight_squared: Vec4,
}

impl Borrow<'_> {
    /// Adds what the pixels of row `y` borrow.
    pub fn add_row(&self, y: usize, pixels: &mut [PixelSums]) {
        let memory = &self.memories[self.target];
        let row = memory.records.row(y);
        for (x, pixel) in pixels.iter_mut().enumerate() {
            let Some(block) = self.block(&row, x, y) else {
                continue;
            };
            let mut sums = Sums::default();
            self.add_lenders(&block, x, y, &mut sums);
            let receiver = &memory.receivers[y * self.width() + x];
            pixel.add_radiance(Vec3A::from(receiver.albedo) * sums.irradiance());
            pixel.add_effective_samples(sums.effective_samples());
        }
    }

    fn width(&self) -> usize {
        self.views[self.target].region.width
    }

    /// The block around a pixel, or `None` where it shows no surface.
    #[inline]
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
        let wo = camera.direction_from(position);
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
    #[inline]
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

    #[inline]
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
    /// Adds the first `count` of four neighbours that start at pixel `x` of a row.
    #[inline]
    fn add(&mut self, block: &Block, place: &Place, row: &Row, x: i64, count: usize) {
        let Some(neighbours) = Neighbours::load(row, x) else {
            return;
        };
        let offset = neighbours.position - Lanes3::splat(place.position);
        let distance_squared = offset.dot(&offset);
        let turned = neighbours
            .normal
            .dot(&Lanes3::splat(place.geometric_normal));
        let mut valid = distance_squared.cmple(Vec4::splat(block.distance_squared))
            & turned.cmpge(Vec4::splat(NORMAL_COSINE))
            & LANE.cmplt(Vec4::splat(count as f32));
        if place.object >= 0.0 {
            valid &= neighbours.object.cmpeq(Vec4::splat(place.object));
        }
        if !valid.any() {
            return;
        }
        let brought = brought(turned);
        let cosine = neighbours.direction.dot(&Lanes3::splat(block.normal));
        let cosine = cosine.max(Vec4::ZERO).min(neighbours.cosine_limit);
        for class in 0..LENT_CLASSES {
            let falloff = Vec4::ONE - distance_squared * block.inverse_radius_squared[class];
            let falloff = Vec4::select(valid, falloff.max(Vec4::ZERO), Vec4::ZERO);
            let weight = falloff * falloff;
            self.weight[class] += weight * brought;
            if class == LENT_CLASSES - 1 {
                self.weight_squared += weight * weight;
            }
            let of_class = neighbours.class.cmpeq(Vec4::splat(class as f32));
            let share = Vec4::select(of_class, weight * cosine, Vec4::ZERO);
            for (sum, value) in self.value[class].iter_mut().zip(neighbours.value.0) {
                *sum += share * value;
            }
        }
    }

    /// Irradiance over pi: the classes' weighted means, added up.
    fn irradiance(&self) -> Vec3A {
        let mut irradiance = Vec3A::ZERO;
        for (weight, value) in self.weight.iter().zip(&self.value) {
            let weight = weight.element_sum();
            if weight > 0.0 {
                irradiance += Vec3A::from_array(value.map(Vec4::element_sum)) / weight;
            }
        }
        irradiance
    }

    /// Samples of equal weight that would be as good, for the widest class.
    fn effective_samples(&self) -> f32 {
        let sum = self.weight[LENT_CLASSES - 1].element_sum();
        let squares = self.weight_squared.element_sum();
        if squares > 0.0 {
            sum * sum / squares
        } else {
            0.0
        }
    }
}

/// Four vectors, one axis after the other.
#[derive(Clone, Copy)]
struct Lanes3([Vec4; 3]);

impl Lanes3 {
    #[inline]
    fn splat(v: Vec3A) -> Self {
        Self([v.x, v.y, v.z].map(Vec4::splat))
    }

    #[inline]
    fn load(row: &Row, first: usize, x: i64) -> Option<Self> {
        let axis = |axis| row.lanes::<LANES>(first + axis, x).map(|&v| Vec4::from(v));
        Some(Self([axis(0)?, axis(1)?, axis(2)?]))
    }

    #[inline]
    fn dot(&self, other: &Self) -> Vec4 {
        let ([ax, ay, az], [bx, by, bz]) = (self.0, other.0);
        ax * bx + ay * by + az * bz
    }
}

impl std::ops::Sub for Lanes3 {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        let ([ax, ay, az], [bx, by, bz]) = (self.0, other.0);
        Self([ax - bx, ay - by, az - bz])
    }
}

/// Four records side by side.
struct Neighbours {
    position: Lanes3,
    normal: Lanes3,
    direction: Lanes3,
    value: Lanes3,
    cosine_limit: Vec4,
    class: Vec4,
    object: Vec4,
}

impl Neighbours {
    #[inline]
    fn load(row: &Row, x: i64) -> Option<Self> {
        let scalar = |column| row.lanes::<LANES>(column, x).map(|&v| Vec4::from(v));
        Some(Self {
            position: Lanes3::load(row, column::POSITION, x)?,
            normal: Lanes3::load(row, column::NORMAL, x)?,
            direction: Lanes3::load(row, column::DIRECTION, x)?,
            value: Lanes3::load(row, column::VALUE, x)?,
            cosine_limit: scalar(column::COSINE_LIMIT)?,
            class: scalar(column::CLASS)?,
            object: scalar(column::OBJECT)?,
        })
    }
}
