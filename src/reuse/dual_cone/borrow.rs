//! The second pass: eight neighbours at a time.
//!
//! No vector goes through a closure or a method of arrays here: those are compiled without the
//! vectors' instruction set where the compiler does not inline them.

use glam::Vec3A;

use super::Memory;
use super::gloss::{Gloss, LEAST_ALPHA, Lobe, Share};
use super::reads::Reads;
use super::records::{
    COSINE_LIMIT, Class, LENT_CLASSES, Light, Neighbours, TAN_BETA, UNIT, column, wide_column,
};
use super::veto::{Lending, ProbeRow};
use crate::film::{Extra, FilmRow, Pixel};
use crate::kernel::vector::{LANES, Vector, Work, run_on_vectors};
use crate::math::luminance;
use crate::passes;
use crate::path::Divided;
use crate::record::PADDING;
use crate::reuse::Sharing;
use crate::sampling;
use crate::scene::Motion;
use crate::surface::Surface;

/// The number of each lane.
const LANE: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

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

/// Least radius of a kernel in projected pixels, in an iteration.
pub fn kernel_floor(iteration: u32) -> f32 {
    KERNEL_FLOOR * ((iteration + 1) as f32).powf(-0.25)
}

/// How the pixel that borrows reflects, 22 bytes.
#[derive(Clone, Copy, Default)]
pub struct Receiver {
    /// Share of light that its Lambert part reflects.
    albedo: Share,
    /// The glossy closure about the same normal, if it is wide enough to borrow.
    gloss: Gloss,
}

impl Receiver {
    /// What a surface needs to borrow.
    pub fn at(surface: &Surface, gloss: Option<&sampling::Gloss>) -> Self {
        Self {
            albedo: Share::new(surface.bsdf.albedo_lambert()),
            gloss: gloss.map(Gloss::new).unwrap_or_default(),
        }
    }

    /// The closure of a surface that takes borrowed light beside the Lambert part.
    pub fn gloss(surface: &Surface) -> Option<sampling::Gloss> {
        surface.bsdf.gloss(LEAST_ALPHA).filter(Gloss::fits)
    }
}

/// The frames of one borrowing pass.
pub struct Borrow<'a> {
    pub sharing: &'a Sharing<'a, Memory>,
    /// Per lender and object: what carries the target's points to the lender.
    pub motions: &'a [Vec<Motion>],
    /// Which records of the lenders it reads.
    pub reads: &'a Reads,
    /// Classes that the frame's light may be of.
    pub classes: [bool; LENT_CLASSES],
    pub half_block: usize,
    /// Whether each pixel of another frame lends to one pixel alone, as a denoiser needs it: it
    /// cannot remove noise that neighbours have in common.
    pub is_one_to_one: bool,
    /// Least radius of a kernel in projected pixels.
    pub kernel_floor: f32,
}

/// What a pixel looks for in its neighbours.
pub struct Block {
    position: Vec3A,
    /// The shading normal of the Lambert part: light is gathered about it.
    normal: Vec3A,
    object: f32,
    /// Direction to the viewer.
    wo: Vec3A,
    gloss: Gloss,
    /// Radius of the kernel of light for that closure [m].
    gloss_radius: f32,
    /// Largest squared distance of a valid neighbour [m^2].
    distance_squared: f32,
    /// 1 / rho^2 of each class [1/m^2].
    inverse_radius_squared: [f32; LENT_CLASSES],
}

/// Where a block lies in a lender.
pub struct Place {
    position: Vec3A,
    /// Lower left pixel of the block.
    pub x: i64,
    pub y: i64,
    /// Whether only records of the block's object are valid.
    is_of_object: bool,
}

/// What a pixel gets, as luminance.
#[derive(Clone, Copy, Default)]
struct Got {
    /// From everywhere it borrows.
    borrowed: f32,
    /// From its frame alone.
    frame: f32,
    /// By its own gather ray alone.
    own: f32,
}

/// One row of pixels that borrow.
pub struct BorrowingRow<'a> {
    pub y: usize,
    pub pixels: FilmRow<'a>,
    /// From where each borrows.
    pub lending: &'a [Lending],
    pub probes: ProbeRow<'a>,
    /// Luminance that each would have got by its own gather ray less that of what it borrowed.
    pub drift: &'a mut [f32],
}

/// The same; what pixels get is divided for passes where some are `DIVIDED`.
struct BorrowWork<'a, const DIVIDED: bool> {
    borrow: &'a Borrow<'a>,
    row: BorrowingRow<'a>,
}

impl<const DIVIDED: bool> Work for BorrowWork<'_, DIVIDED> {
    type Output = ();

    #[inline(always)]
    fn run<V: Vector>(mut self) {
        let row = &mut self.row;
        for x in 0..row.pixels.width() {
            let lending = row.lending[x];
            if lending == Lending::None {
                continue;
            }
            let mut pixel = row.pixels.pixel(x);
            let got = self
                .borrow
                .add_pixel::<V, DIVIDED>(x, row.y, lending, &mut pixel);
            if let Some(excess) = row.probes.at(x) {
                excess.frame += got.frame - got.borrowed;
                excess.alone -= got.borrowed;
            }
            row.drift[x] += got.own - got.borrowed;
        }
    }
}

impl Borrow<'_> {
    /// Adds what the pixels of a row borrow.
    pub fn add_row(&self, row: BorrowingRow) {
        if passes::wants_scattered(row.pixels.layout()) {
            run_on_vectors(BorrowWork::<true> { borrow: self, row });
        } else {
            run_on_vectors(BorrowWork::<false> { borrow: self, row });
        }
    }

    /// Adds what a pixel gets from there; returns it, and what it would have got otherwise.
    #[inline(always)]
    fn add_pixel<V: Vector, const DIVIDED: bool>(
        &self,
        x: usize,
        y: usize,
        lending: Lending,
        pixel: &mut Pixel,
    ) -> Got {
        let Some(block) = self.block(x, y) else {
            return Got::default();
        };
        let albedo = self.receiver(x, y).albedo.color();
        let mut wanted = Wanted::<V>::new(&block);
        let own = self.own::<V, DIVIDED>(&wanted, x, y).reflected(albedo);
        let mut sums = Sums::<V, DIVIDED>::new();
        let is_own = |lender: &usize| self.sharing.lenders[*lender] == self.sharing.target;
        for lender in (0..self.sharing.lenders.len()).filter(is_own) {
            self.add_lender(&block, lender, x, y, &mut wanted, &mut sums);
        }
        let frame = sums.reflected(albedo);
        if lending == Lending::Window {
            for lender in (0..self.sharing.lenders.len()).filter(|lender| !is_own(lender)) {
                self.add_lender(&block, lender, x, y, &mut wanted, &mut sums);
            }
        }
        sums.divide(albedo, &mut pixel.extra);
        let borrowed = sums.reflected(albedo);
        pixel.sums.add_radiance(borrowed);
        pixel
            .sums
            .add_effective_samples(sums.effective_samples(self.classes));
        Got {
            borrowed: luminance(borrowed),
            frame: luminance(frame),
            own: luminance(own),
        }
    }

    /// The pixel's own record alone.
    #[inline(always)]
    fn own<V: Vector, const DIVIDED: bool>(
        &self,
        wanted: &Wanted<V>,
        x: usize,
        y: usize,
    ) -> Sums<V, DIVIDED> {
        let rows = self.sharing.memories[self.sharing.target].records.rows(y);
        let neighbours = Neighbours::new(rows, x as i64);
        let mut sums = Sums::new();
        let first = V::load(&LANE).at_most(V::splat(0.5));
        sums.add(wanted, &neighbours, first, self.classes);
        sums
    }

    fn receiver(&self, x: usize, y: usize) -> &Receiver {
        &self.sharing.memories[self.sharing.target].receivers[y * self.width() + x]
    }

    fn width(&self) -> usize {
        self.sharing.view().region.width
    }

    /// The block around a pixel, or `None` where it shows no surface.
    pub fn block(&self, x: usize, y: usize) -> Option<Block> {
        let memory = &self.sharing.memories[self.sharing.target];
        let (wide, narrow) = memory.records.rows(y);
        let normal = [0, 1, 2].map(|axis| narrow.get(column::NORMAL + axis, x));
        if normal == [0; 3] {
            return None;
        }
        let normal = Vec3A::from_array(normal.map(f32::from)) / UNIT;
        let position =
            Vec3A::from_array([0, 1, 2].map(|axis| wide.get(wide_column::POSITION + axis, x)));
        let view = self.sharing.view();
        let camera = &view.tracer.frame.camera;
        let wo = camera.direction_from(position);
        let cosine = normal.dot(wo).abs().max(VIEW_COSINE);
        let pixel_size =
            camera.pixel_size(camera.depth(position), view.region.frame_width) / cosine;
        let side = self.half_block as f32 + 0.7;
        let floor = self.kernel_floor * pixel_size;
        let index = y * self.width() + x;
        let distance = memory.distances[index];
        // Eq. 3 reaches g = 1 at d = 2 R tan(beta).
        let radius = |tan_beta: f32| KERNEL_SCALE * (2.0 * distance * tan_beta).max(floor);
        let receiver = self.receiver(x, y);
        Some(Block {
            position,
            normal,
            object: wide.get(wide_column::OBJECT, x),
            wo,
            gloss: receiver.gloss,
            gloss_radius: radius(receiver.gloss.tan_beta()),
            distance_squared: (DIAGONAL * side * pixel_size).powi(2),
            inverse_radius_squared: TAN_BETA.map(|tan_beta| radius(tan_beta).powi(-2)),
        })
    }

    /// Where the block lies in a lender: the same pixel in the target itself; elsewhere around the
    /// projection of the point, which moves with its object. Records keep their directions: where the
    /// object has turned too far, their normals say that they looked elsewhere.
    pub fn place(&self, block: &Block, lender: usize, x: usize, y: usize) -> Option<Place> {
        let half = self.half_block as i64;
        let frame = self.sharing.lenders[lender];
        if frame == self.sharing.target {
            return Some(Place {
                position: block.position,
                x: x as i64 - half,
                y: y as i64 - half,
                is_of_object: false,
            });
        }
        let (position, is_of_object) = match self.motions[lender][block.object as usize] {
            Motion::Absent => return None,
            Motion::Still => (block.position, false),
            Motion::Rigid(matrix) => (matrix.transform_point3a(block.position), true),
        };
        let view = &self.sharing.views[frame];
        let there = view.tracer.frame.camera.project(position)?;
        let (x, y) = if self.is_one_to_one {
            // Projected one by one, the scattered samples of two pixels would meet the same one.
            let camera = self.sharing.view().tracer.frame.camera;
            let (dx, dy) = view.region.shift(camera.project(block.position)?, there);
            (x as i64 + dx, y as i64 + dy)
        } else {
            view.region.pixel_at(there)
        };
        // A row's padding holds what reaches over its ends.
        let reach = (PADDING - LANES) as i64 - half;
        let near = x > -reach && x < view.region.width as i64 + reach;
        near.then_some(Place {
            position,
            x: x - half,
            y: y - half,
            is_of_object,
        })
    }

    /// Adds what the block holds in one lender.
    #[inline(always)]
    fn add_lender<V: Vector, const DIVIDED: bool>(
        &self,
        block: &Block,
        lender: usize,
        x: usize,
        y: usize,
        wanted: &mut Wanted<V>,
        sums: &mut Sums<V, DIVIDED>,
    ) {
        let Some(place) = self.place(block, lender, x, y) else {
            return;
        };
        let side = 2 * self.half_block + 1;
        let frame = self.sharing.lenders[lender];
        let is_own = frame == self.sharing.target;
        if !is_own && !self.reads.includes(frame, place.x, place.y, side as i64) {
            return;
        }
        wanted.move_to(block, &place);
        let classes = self.classes_from(frame);
        let height = self.sharing.views[frame].region.height as i64;
        let first = place.y.clamp(0, height);
        let last = (place.y + side as i64).clamp(0, height);
        for y in first..last {
            let rows = self.sharing.memories[frame].records.rows(y as usize);
            for start in (0..side).step_by(LANES) {
                let inside = V::load(&LANE).at_most(V::splat((side - start) as f32 - 0.5));
                let neighbours = Neighbours::new(rows, place.x + start as i64);
                sums.add(wanted, &neighbours, inside, classes);
            }
        }
    }

    /// Classes that a frame lends. The shadows of narrow light move: without a block to smooth them,
    /// those of other frames would show as ghosts.
    fn classes_from(&self, frame: usize) -> [bool; LENT_CLASSES] {
        let mut classes = self.classes;
        if self.is_one_to_one && frame != self.sharing.target {
            classes[Class::Narrow as usize] = false;
        }
        classes
    }
}

/// [`Block`] in every lane, and where it lies in the lender at hand.
struct Wanted<V> {
    position: [V; 3],
    normal: [V; 3],
    /// Of valid records, if they must be of one object.
    object: Option<V>,
    distance_squared: V,
    inverse_radius_squared: [V; LENT_CLASSES],
    /// The glossy closure, if there is one.
    lobe: Option<Lobe<V>>,
}

impl<V: Vector> Wanted<V> {
    /// In the block's own frame.
    #[inline(always)]
    fn new(block: &Block) -> Self {
        Self {
            position: splats(block.position),
            // Records hold whole numbers.
            normal: splats(block.normal / UNIT),
            object: None,
            distance_squared: V::splat(block.distance_squared),
            inverse_radius_squared: splats(Vec3A::from(block.inverse_radius_squared)),
            lobe: match block.gloss.is_some() {
                true => Some(Lobe::new(
                    &block.gloss,
                    block.normal,
                    block.wo,
                    block.gloss_radius,
                )),
                false => None,
            },
        }
    }

    #[inline(always)]
    fn move_to(&mut self, block: &Block, place: &Place) {
        self.position = splats(place.position);
        self.object = place.is_of_object.then_some(V::splat(block.object));
    }
}

/// A vector in every lane.
#[inline(always)]
pub fn splats<V: Vector>(vector: Vec3A) -> [V; 3] {
    [V::splat(vector.x), V::splat(vector.y), V::splat(vector.z)]
}

/// The part of a uniform sky's irradiance that records of a neighbour bring whose normal has this
/// cosine with the receiver's. Its hemisphere covers (1 + cos) / 2 of the receiver's; the limit on
/// the records' cosines takes a little more. The integral of min(cos_i, 3 cos_j) over both
/// hemispheres is this line within 0.2 % for cosines from 0.9 on. Dividing by it keeps a uniform sky
/// uniform on curved surfaces.
#[inline(always)]
fn brought<V: Vector>(cosine: V) -> V {
    (V::splat(0.74) * cosine + V::splat(0.26)).min(V::splat(1.0))
}

#[inline(always)]
pub fn dot<V: Vector>([ax, ay, az]: [V; 3], [bx, by, bz]: [V; 3]) -> V {
    ax * bx + ay * by + az * bz
}

/// The class of light with the widest cone.
#[inline(always)]
fn widest(classes: [bool; LENT_CLASSES]) -> Option<usize> {
    classes.iter().rposition(|&is_there| is_there)
}

/// A weighted mean of colours; black without weight.
#[inline(always)]
fn mean<V: Vector>(weight: V, [x, y, z]: &[V; 3]) -> Vec3A {
    let weight = weight.sum();
    if weight > 0.0 {
        Vec3A::new(x.sum(), y.sum(), z.sum()) / weight
    } else {
        Vec3A::ZERO
    }
}

/// Weighted sums of each class.
struct Sums<V, const DIVIDED: bool> {
    weight: [V; LENT_CLASSES],
    value: [[V; 3]; LENT_CLASSES],
    /// Squared weights of the widest class, for the effective number of samples.
    weight_squared: V,
    /// Sum of the weights of light for the glossy closure.
    gloss_weight: V,
    gloss_value: [V; 3],
    /// The part of it that comes by way of other surfaces, where passes ask for it.
    gloss_indirect: [V; 3],
}

impl<V: Vector, const DIVIDED: bool> Sums<V, DIVIDED> {
    #[inline(always)]
    fn new() -> Self {
        let zero = V::splat(0.0);
        Self {
            weight: [zero; LENT_CLASSES],
            value: [[zero; 3]; LENT_CLASSES],
            weight_squared: zero,
            gloss_weight: zero,
            gloss_value: [zero; 3],
            gloss_indirect: [zero; 3],
        }
    }

    /// Adds eight neighbours, of which those count that are `inside` the block.
    #[inline(always)]
    fn add(
        &mut self,
        wanted: &Wanted<V>,
        neighbours: &Neighbours,
        inside: V,
        classes: [bool; LENT_CLASSES],
    ) {
        let Some((position, normal)) = neighbours.place() else {
            return;
        };
        let offset = [
            position[0] - wanted.position[0],
            position[1] - wanted.position[1],
            position[2] - wanted.position[2],
        ];
        let distance_squared = dot(offset, offset);
        let turned = dot(normal, wanted.normal);
        let mut valid = distance_squared.at_most(wanted.distance_squared)
            & V::splat(NORMAL_COSINE).at_most(turned)
            & inside;
        if let (Some(wanted), Some(object)) = (wanted.object, neighbours.object::<V>()) {
            valid = valid & object.equals(wanted);
        }
        if !valid.any() {
            return;
        }
        let Some(light) = neighbours.light::<V>() else {
            return;
        };
        if let Some(lobe) = &wanted.lobe {
            let valid = valid & lobe.least_cosine.at_most(turned);
            self.add_gloss(lobe, &light, distance_squared, valid);
        }
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let brought = brought(turned);
        let cosine = dot(light.direction, wanted.normal)
            .max(zero)
            .min(light.cosine * V::splat(COSINE_LIMIT));
        for class in (0..LENT_CLASSES).filter(|&class| classes[class]) {
            let falloff = one - distance_squared * wanted.inverse_radius_squared[class];
            let falloff = falloff.max(zero) & valid;
            let weight = falloff * falloff;
            self.weight[class] = self.weight[class] + weight * brought;
            if Some(class) == widest(classes) {
                self.weight_squared = self.weight_squared + weight * weight;
            }
            let of_class = light.class.equals(V::splat(class as f32));
            let share = (weight * cosine) & of_class;
            for axis in 0..3 {
                let sum = &mut self.value[class][axis];
                *sum = *sum + share * light.value[axis];
            }
        }
    }

    /// Adds what the glossy closure reflects of the light. One kernel serves all classes: its radius
    /// is that of the lobe.
    #[inline(always)]
    fn add_gloss(&mut self, lobe: &Lobe<V>, light: &Light<V>, distance_squared: V, valid: V) {
        let falloff = V::splat(1.0) - distance_squared * lobe.inverse_radius_squared;
        let falloff = falloff.max(V::splat(0.0)) & valid;
        let weight = falloff * falloff;
        self.gloss_weight = self.gloss_weight + weight;
        let [red, green, blue] = light.value;
        let brought = weight * (red + green + blue);
        if !V::splat(f32::MIN_POSITIVE).at_most(brought).any() {
            return;
        }
        let reflected = lobe.reflected(light.direction);
        let [r, g, b] = &mut self.gloss_value;
        *r = *r + weight * reflected[0] * red;
        *g = *g + weight * reflected[1] * green;
        *b = *b + weight * reflected[2] * blue;
        if DIVIDED {
            let indirect = V::splat(Class::Indirect as i16 as f32);
            let weight = weight & light.class.equals(indirect);
            let [r, g, b] = &mut self.gloss_indirect;
            *r = *r + weight * reflected[0] * red;
            *g = *g + weight * reflected[1] * green;
            *b = *b + weight * reflected[2] * blue;
        }
    }

    /// Radiance that both closures reflect.
    #[inline(always)]
    fn reflected(&self, albedo: Vec3A) -> Vec3A {
        albedo * self.irradiance() + self.gloss()
    }

    /// Radiance that the glossy closure reflects.
    #[inline(always)]
    fn gloss(&self) -> Vec3A {
        mean(self.gloss_weight, &self.gloss_value)
    }

    /// Irradiance over pi: the classes' weighted means, added up.
    #[inline(always)]
    fn irradiance(&self) -> Vec3A {
        let mut irradiance = Vec3A::ZERO;
        for class in 0..LENT_CLASSES {
            irradiance += mean(self.weight[class], &self.value[class]);
        }
        irradiance
    }

    /// Adds it all to the passes that ask for it: the sky's classes come straight from their source.
    #[inline(always)]
    fn divide(&self, albedo: Vec3A, extra: &mut Extra) {
        if !DIVIDED {
            return;
        }
        let class = Class::Indirect as usize;
        let irradiance = mean(self.weight[class], &self.value[class]);
        let gloss = mean(self.gloss_weight, &self.gloss_indirect);
        let zero = Vec3A::ZERO;
        let light = Divided {
            is_of_medium: false,
            direct: [
                albedo * (self.irradiance() - irradiance),
                self.gloss() - gloss,
                zero,
            ],
            indirect: [albedo * irradiance, gloss, zero],
        };
        passes::add_scattered(extra, 0, &light);
    }

    /// Samples of equal weight that would be as good, for the widest class.
    #[inline(always)]
    fn effective_samples(&self, classes: [bool; LENT_CLASSES]) -> f32 {
        let sum = match widest(classes) {
            Some(class) => self.weight[class].sum(),
            None => 0.0,
        };
        let squares = self.weight_squared.sum();
        if squares > 0.0 {
            sum * sum / squares
        } else {
            0.0
        }
    }
}
