//! What a pixel lends, and the classes of light.

use glam::Vec3A;

use crate::path::Gathered;
use crate::record::RowMut;
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

/// Below this tan(beta) a part of the sky is its pixel's own: a 3.4 degree disk, seven suns wide.
pub const OWN_BELOW: f32 = 0.03;
/// Below this tan(beta) a part of the sky counts as narrow.
const NARROW_BELOW: f32 = 0.2;

impl Class {
    /// The class of what a gather ray found; `tan_beta` is asked for where it left the scene.
    pub fn of(gathered: &Gathered, tan_beta: impl FnOnce() -> f32) -> Self {
        if gathered.distance.is_finite() {
            return Class::Indirect;
        }
        match tan_beta() {
            t if t < OWN_BELOW => Class::Own,
            t if t < NARROW_BELOW => Class::Narrow,
            _ => Class::Wide,
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
    cosine_limit: f32,
    class: f32,
    object: f32,
}

/// How many times its own cosine a record may count for. Beyond it a grazing sample with a small
/// density would become a firefly on a neighbour that faces it.
const COSINE_LIMIT: f32 = 3.0;

/// First columns of a record's fields in the buffer.
pub mod column {
    #![allow(missing_docs, reason = "named after the fields of a record")]
    pub const POSITION: usize = 0;
    pub const NORMAL: usize = 3;
    pub const DIRECTION: usize = 6;
    pub const VALUE: usize = 9;
    pub const COSINE_LIMIT: usize = 12;
    pub const CLASS: usize = 13;
    pub const OBJECT: usize = 14;
}

impl Record {
    /// Columns of a record.
    pub const COLUMNS: usize = 15;

    /// A record of a surface that has not gathered anything: dark in every class.
    pub fn at(surface: &Surface, object: u32) -> Self {
        Self {
            position: surface.position,
            normal: surface.geometric_normal,
            direction: surface.geometric_normal,
            object: object as f32,
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
        self.cosine_limit = COSINE_LIMIT * direction.dot(surface.bsdf.lambert_normal()).max(0.0);
        self.class = class as u32 as f32;
    }

    /// Writes the record of pixel `x`.
    pub fn write(&self, row: &mut RowMut, x: usize) {
        let mut vector = |first: usize, v: Vec3A| {
            for (axis, value) in v.to_array().into_iter().enumerate() {
                row.set(first + axis, x, value);
            }
        };
        vector(column::POSITION, self.position);
        vector(column::NORMAL, self.normal);
        vector(column::DIRECTION, self.direction);
        vector(column::VALUE, self.value);
        row.set(column::COSINE_LIMIT, x, self.cosine_limit);
        row.set(column::CLASS, x, self.class);
        row.set(column::OBJECT, x, self.object);
    }
}
