//! What a pixel lends, and the classes of light.

use glam::Vec3A;
use rayon::prelude::*;

use crate::kernel::vector::{Vector, to_upper_half};
use crate::record::{RecordBuffer, Row, RowMut};
use crate::reuse::light_tree::Leaf;
use crate::surface::Surface;

/// Kinds of light that differ in how far a sample of it can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// A part of the sky that is small for its share of light.
    Narrow = 0,
    /// A wide, even part of the sky.
    Wide = 1,
    /// Light reflected by surfaces.
    Indirect = 2,
    /// Never lent: so small a light that a moved copy misses its shadow.
    Own = 3,
}

/// Classes that are lent.
pub const LENT_CLASSES: usize = 3;

/// tan(beta) that stands for each class in Eq. 3. They are the middle of what each class holds;
/// larger ones borrow from farther and blur more (docs/method.md, section 3).
pub const TAN_BETA: [f32; LENT_CLASSES] = [0.1, 0.3, 0.45];

/// Below this tan(beta) a part of the sky counts as narrow.
const NARROW_BELOW: f32 = 0.2;

impl Class {
    /// The class of light from a part of the sky that is lent.
    pub fn of_sky(leaf: &Leaf) -> Self {
        match leaf.tan_beta < NARROW_BELOW {
            true => Class::Narrow,
            false => Class::Wide,
        }
    }
}

/// One pixel's record.
#[derive(Debug, Clone, Copy, Default)]
pub struct Record {
    position: Vec3A,
    /// Zero where there is nothing to borrow from.
    normal: Vec3A,
    direction: Vec3A,
    /// L / (pi p): radiance over its density, without reflectance and cosine.
    value: Vec3A,
    /// Cosine of the direction with the shading normal.
    cosine: f32,
    class: i16,
    object: u32,
}

/// How many times its own cosine a record may count for. Beyond it a grazing sample with a small
/// density would become a firefly on a neighbour that faces it.
pub const COSINE_LIMIT: f32 = 3.0;

/// First columns of the fields in single precision, 16 bytes in all.
pub mod wide_column {
    #![allow(missing_docs, reason = "named after the fields of a record")]
    pub const POSITION: usize = 0;
    pub const OBJECT: usize = 3;
    pub const COUNT: usize = 4;
}

/// First columns of the fields in 16 bits, 22 bytes in all. Unit vectors and cosines are whole
/// numbers of 1 / [`UNIT`]: off by 2e-5. Values are upper halves of floats: off by 0.4 % at most and
/// by nothing on average.
pub mod column {
    #![allow(missing_docs, reason = "named after the fields of a record")]
    pub const NORMAL: usize = 0;
    pub const DIRECTION: usize = 3;
    pub const VALUE: usize = 6;
    pub const COSINE: usize = 9;
    pub const CLASS: usize = 10;
    pub const COUNT: usize = 11;
}

/// What a component of one is kept as.
pub const UNIT: f32 = 32767.0;

/// A component of a unit vector as it is kept.
pub fn quantised(component: f32) -> i16 {
    (component.clamp(-1.0, 1.0) * UNIT).round() as i16
}

impl Record {
    /// A record of a surface that has not gathered anything: dark in every class.
    pub fn at(surface: &Surface, object: u32) -> Self {
        Self {
            position: surface.position,
            normal: surface.bsdf.lambert_normal(),
            direction: surface.bsdf.lambert_normal(),
            object,
            ..Self::default()
        }
    }

    /// Adds what the gather ray found.
    pub fn lend(&mut self, direction: Vec3A, value: Vec3A, surface: &Surface, class: Class) {
        if class == Class::Own || !value.is_finite() {
            return;
        }
        self.direction = direction;
        self.value = value;
        self.cosine = direction.dot(surface.bsdf.lambert_normal()).max(0.0);
        self.class = class as i16;
    }

    /// Writes the record of pixel `x`.
    pub fn write(&self, (wide, narrow): &mut (RowMut, RowMut<i16>), x: usize) {
        for axis in 0..3 {
            wide.set(wide_column::POSITION + axis, x, self.position[axis]);
            narrow.set(column::NORMAL + axis, x, quantised(self.normal[axis]));
            narrow.set(column::DIRECTION + axis, x, quantised(self.direction[axis]));
            narrow.set(column::VALUE + axis, x, to_upper_half(self.value[axis]));
        }
        // Exact up to 2^24 objects.
        wide.set(wide_column::OBJECT, x, self.object as f32);
        narrow.set(column::COSINE, x, quantised(self.cosine));
        narrow.set(column::CLASS, x, self.class);
    }
}

/// The records of a frame.
pub struct Records {
    wide: RecordBuffer,
    narrow: RecordBuffer<i16>,
}

impl Records {
    /// Nothing in any of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            wide: RecordBuffer::new(wide_column::COUNT, width, height),
            narrow: RecordBuffer::new(column::COUNT, width, height),
        }
    }

    /// The columns of row `y`.
    #[inline(always)]
    pub fn rows(&self, y: usize) -> (Row<'_>, Row<'_, i16>) {
        (self.wide.row(y), self.narrow.row(y))
    }

    /// The rows, from the lowest, for writers that work at the same time.
    pub fn rows_mut(
        &mut self,
    ) -> impl IndexedParallelIterator<Item = (RowMut<'_>, RowMut<'_, i16>)> {
        self.wide.rows_mut().zip(self.narrow.rows_mut())
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.wide.memory_bytes() + self.narrow.memory_bytes()
    }
}

/// Eight records side by side, from pixel `x` of a row on; loaded when they are asked for.
pub struct Neighbours<'a> {
    wide: Row<'a>,
    narrow: Row<'a, i16>,
    x: i64,
}

/// What eight records found.
pub struct Light<V> {
    /// In units of 1 / [`UNIT`].
    pub direction: [V; 3],
    pub value: [V; 3],
    pub cosine: V,
    pub class: V,
}

impl<'a> Neighbours<'a> {
    #[inline(always)]
    pub fn new((wide, narrow): (Row<'a>, Row<'a, i16>), x: i64) -> Self {
        Self { wide, narrow, x }
    }

    /// Positions, and normals in units of 1 / [`UNIT`]; `None` beyond the padding.
    #[inline(always)]
    pub fn place<V: Vector>(&self) -> Option<([V; 3], [V; 3])> {
        let position = [
            self.number(wide_column::POSITION)?,
            self.number(wide_column::POSITION + 1)?,
            self.number(wide_column::POSITION + 2)?,
        ];
        Some((position, self.whole_numbers(column::NORMAL)?))
    }

    #[inline(always)]
    pub fn object<V: Vector>(&self) -> Option<V> {
        self.number(wide_column::OBJECT)
    }

    #[inline(always)]
    pub fn light<V: Vector>(&self) -> Option<Light<V>> {
        Some(Light {
            direction: self.whole_numbers(column::DIRECTION)?,
            value: [
                self.upper_half(column::VALUE)?,
                self.upper_half(column::VALUE + 1)?,
                self.upper_half(column::VALUE + 2)?,
            ],
            cosine: self.whole_number::<V>(column::COSINE)? * V::splat(1.0 / UNIT),
            class: self.whole_number(column::CLASS)?,
        })
    }

    #[inline(always)]
    fn number<V: Vector>(&self, column: usize) -> Option<V> {
        Some(V::load(self.wide.lanes(column, self.x)?))
    }

    #[inline(always)]
    fn upper_half<V: Vector>(&self, column: usize) -> Option<V> {
        Some(V::load_upper_halves(self.narrow.lanes(column, self.x)?))
    }

    #[inline(always)]
    fn whole_number<V: Vector>(&self, column: usize) -> Option<V> {
        Some(V::load_i16(self.narrow.lanes(column, self.x)?))
    }

    #[inline(always)]
    fn whole_numbers<V: Vector>(&self, first: usize) -> Option<[V; 3]> {
        Some([
            self.whole_number(first)?,
            self.whole_number(first + 1)?,
            self.whole_number(first + 2)?,
        ])
    }
}
