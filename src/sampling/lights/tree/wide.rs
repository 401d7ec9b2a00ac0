//! Four neighbouring parts of the tree, weighed at once.

use glam::{BVec4A, Vec4};

use super::binary::{self, Binary};
use super::{Extent, Part};
use crate::sampling::lights::{Receiver, WEIGHT_MAX};

/// Parts of a node.
pub const WIDTH: usize = 4;

/// What is below a part.
#[derive(Debug, Clone, Copy)]
pub enum Below {
    Nothing,
    /// A light, by its place in the list that the tree was built from.
    Light(u32),
    /// A node.
    Node(u32),
    /// A node of two parts that has none of four yet.
    Unmerged(u32),
}

/// The extents of four parts as their importance wants them, and what is below.
#[derive(Debug)]
pub struct Wide {
    center: [Vec4; 3],
    /// Of balls around everything.
    radius: Vec4,
    intensity: Vec4,
    axis: [Vec4; 3],
    cos_normals: Vec4,
    sin_normals: Vec4,
    cos_reach: Vec4,
    both_sides: BVec4A,
    first: [u32; WIDTH],
    count: [u32; WIDTH],
    pub below: [Below; WIDTH],
}

/// Cosines may be off by this much through rounding: no light is lost at the edge of its reach.
const SLACK: f32 = 1e-4;

/// Lights look alike from this many times the radius of the ball around them, if their normals agree as well
/// as this.
const ALIKE_DISTANCE: f32 = 4.0;
const ALIKE_COSINE: f32 = 0.9;

impl Wide {
    /// A node whose parts are these of another tree.
    pub fn new(binary: &Binary, parts: &[u32]) -> Self {
        let mut wide = Self::empty();
        for (part, &index) in parts.iter().enumerate() {
            let node = &binary.nodes[index as usize];
            wide.set(part, &node.extent);
            wide.first[part] = node.first;
            wide.count[part] = node.count;
            wide.below[part] = match node.below {
                binary::Below::Light(light) => Below::Light(light),
                binary::Below::Nodes(_) => Below::Unmerged(index),
            };
        }
        wide
    }

    fn empty() -> Self {
        Self {
            center: [Vec4::ZERO; 3],
            radius: Vec4::ZERO,
            intensity: Vec4::ZERO,
            axis: [Vec4::ZERO; 3],
            cos_normals: Vec4::ONE,
            sin_normals: Vec4::ZERO,
            cos_reach: Vec4::ONE,
            both_sides: BVec4A::FALSE,
            first: [u32::MAX; WIDTH],
            count: [0; WIDTH],
            below: [Below::Nothing; WIDTH],
        }
    }

    fn set(&mut self, part: usize, extent: &Extent) {
        let (center, normals) = (extent.center(), &extent.normals);
        for k in 0..3 {
            self.center[k][part] = center[k];
            self.axis[k][part] = normals.axis[k];
        }
        let radius = 0.5 * (extent.high - extent.low).length();
        self.radius[part] = radius * (1.0 + 4.0 * f32::EPSILON);
        self.intensity[part] = extent.intensity;
        self.cos_normals[part] = normals.angle.cos();
        self.sin_normals[part] = normals.angle.sin();
        self.cos_reach[part] = extent.reach.min(std::f32::consts::PI).cos();
        self.both_sides.set(part, extent.both_sides);
    }

    /// About how much light a plane at the receiver gets from all below each part, were it all as near, as
    /// much faced and as well directed as the bounds allow; zero only where there is none.
    pub fn importance(&self, receiver: &Receiver) -> Vec4 {
        let (point, normal) = (receiver.point, receiver.normal);
        let to_center = [0, 1, 2].map(|k| self.center[k] - point[k]);
        let [x, y, z] = to_center;
        let distance_squared = x * x + y * y + z * z;
        let radius_squared = self.radius * self.radius;
        let is_inside = distance_squared.cmple(radius_squared);
        let per_distance = distance_squared.sqrt().recip();
        let sin_size = (self.radius * per_distance).min(Vec4::ONE);
        let cos_size = (Vec4::ONE - sin_size * sin_size).sqrt();
        let cos_receiver = (normal.x * x + normal.y * y + normal.z * z) * per_distance;
        let cos_receiver = cos_of_rest(cos_receiver, cos_size, sin_size) + SLACK;
        let cos_axis = -(self.axis[0] * x + self.axis[1] * y + self.axis[2] * z) * per_distance;
        let cos_axis = Vec4::select(self.both_sides, cos_axis.abs(), cos_axis);
        let cos_normals = cos_of_rest(cos_axis, self.cos_normals, self.sin_normals);
        let cos_light = cos_of_rest(cos_normals, cos_size, sin_size) + SLACK;
        let is_lit = cos_receiver.cmpgt(Vec4::ZERO) & cos_light.cmpge(self.cos_reach);
        // A spot's light does not fall with the cosine, and may leave at more than a right angle.
        let lit = cos_receiver * cos_light.max(Vec4::splat(0.05)) / distance_squared;
        let outside = Vec4::select(is_lit, lit, Vec4::ZERO);
        let inside = radius_squared.max(Vec4::splat(f32::MIN_POSITIVE)).recip();
        let weight = self.intensity * Vec4::select(is_inside, inside, outside);
        let weight = Vec4::select(self.intensity.cmpgt(Vec4::ZERO), weight, Vec4::ZERO);
        weight.min(Vec4::splat(WEIGHT_MAX))
    }

    /// Whether the lights of a part look alike from the receiver.
    pub fn looks_alike(&self, part: usize, receiver: &Receiver) -> bool {
        let near = ALIKE_DISTANCE * self.radius[part];
        let center = glam::Vec3A::from(self.center.map(|axis| axis[part]));
        self.cos_normals[part] > ALIKE_COSINE
            && (center - receiver.point).length_squared() > near * near
    }

    /// The first place in the tree's order of what it holds.
    pub fn begins(&self) -> u32 {
        self.first[0]
    }

    /// The part with the light at a place of the tree's order.
    pub fn part_with(&self, place: u32) -> usize {
        let is_before = |&&first: &&u32| first <= place;
        self.first.iter().take_while(is_before).count().max(1) - 1
    }

    /// That part and its share of all; `None` where nothing shines.
    pub fn choose_place(&self, weights: Vec4, place: usize) -> Option<(usize, f32)> {
        let part = self.part_with(place as u32);
        let total = super::sum(weights);
        (total > 0.0).then(|| (part, weights[part] / total))
    }

    /// A part, as it is chosen.
    pub fn chosen(&self, part: usize, probability: f32) -> Part {
        let first = self.first[part] as usize;
        Part {
            places: first..first + self.count[part] as usize,
            probability,
            u: 0.0,
        }
    }
}

/// Cosine of `a - b`, held at one where b is larger. Angles are between 0 and pi.
fn cos_of_rest(cos_a: Vec4, cos_b: Vec4, sin_b: Vec4) -> Vec4 {
    let sin_a = (Vec4::ONE - cos_a * cos_a).max(Vec4::ZERO).sqrt();
    let rest = cos_a * cos_b + sin_a * sin_b;
    Vec4::select(cos_a.cmpge(cos_b), Vec4::ONE, rest)
}
