//! The ray as the box test wants it.

use crate::math::Ray;
use glam::Vec3A;

/// Per axis the linear function that takes a plane's coordinate to the ray's parameter there,
/// padded so that boxes grow by more than the rounding error of the box and triangle tests.
///
/// `t = plane * inverse - offset`, with one offset for the near and one for the far plane.
#[derive(Debug, Clone, Copy)]
pub struct Slabs {
    pub inverse: [f32; 3],
    pub near_offset: [f32; 3],
    pub far_offset: [f32; 3],
    /// Per axis which of the planes of [`Boxes`](super::node::Boxes) the ray meets first; the other
    /// one's number differs in the last bit.
    pub near: [u32; 3],
    pub t_min: f32,
}

/// Boxes grow by this share of the coordinates involved. Woop et al. 2013, Section 3.3, derive 5
/// half units in the last place (2^-24) for the triangle test; the product form of the box test
/// adds 4 more. This is 16: larger costs visits, smaller than 9 could lose hits.
const PADDING: f32 = 1.0 / (1 << 20) as f32;

/// A component of a direction is at least this share of its largest one, so that no inverse is
/// infinite and no product NaN. It moves the ray by 2^-30 of its reach, well inside the padding.
const LEAST_SLOPE: f32 = 1.0 / (1 << 30) as f32;

impl Slabs {
    /// For boxes inside `bounds`. None when the ray has no direction, is not finite, or is out of
    /// the range of the arithmetic (a direction shorter than about 1e-20), and so meets nothing.
    #[inline(always)]
    pub fn new(ray: &Ray, bounds: (Vec3A, Vec3A)) -> Option<Self> {
        let magnitude = ray.direction.abs();
        let steepest = magnitude.max_element();
        if !(steepest > 0.0 && steepest < f32::INFINITY) {
            return None;
        }
        let least = Vec3A::splat(steepest * LEAST_SLOPE);
        let slopes = magnitude.max(least).copysign(ray.direction);
        let inverse = slopes.recip();
        let reach = (bounds.0 - ray.origin)
            .abs()
            .max((bounds.1 - ray.origin).abs());
        let is_steepest = magnitude.cmpge(Vec3A::splat(steepest));
        let forward = Vec3A::select(is_steepest, reach, Vec3A::ZERO).max_element();
        let padding = (ray.origin.abs() + reach + forward) * PADDING * inverse.abs();
        let origin = ray.origin * inverse;
        let (near_offset, far_offset) = (origin + padding, origin - padding);
        let backward = inverse.cmplt(Vec3A::ZERO).bitmask();
        // From here on no NaN: an empty box would pass for a box that is met. The sum is finite only
        // where both are.
        (near_offset + far_offset).is_finite().then(|| Self {
            inverse: inverse.to_array(),
            near_offset: near_offset.to_array(),
            far_offset: far_offset.to_array(),
            near: [backward & 1, 2 | backward >> 1 & 1, 4 | backward >> 2],
            t_min: ray.t_min,
        })
    }
}
