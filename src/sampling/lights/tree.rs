//! A tree over the lights that have a place, for scenes with too many of them to weigh each at every
//! point: choosing one takes a walk from a node down to a light, O(log lights).
//!
//! Source: Conty Estevez and Kulla, "Importance Sampling of Many Lights with Adaptive Tree
//! Splitting", HPG 2018: nodes bound the positions and the directions of their light (section 4.1),
//! the tree is split where energy, extent and spread of direction are least (4.4), and a node's
//! importance at a point follows from its bounds (5.1).
//!
//! # Departures
//! - One light is drawn for each sample; in the place of adaptive splitting the walk begins at one of
//!   a fixed number of nodes, all of which are weighed at each point ([`EmitterTree::clusters`]).
//! - A node has up to four parts, which are weighed at once; the paper's two are merged after the tree has
//!   been split.
//! - A single light is weighed by its own estimate of the irradiance it gives, not by its bounds.
//! - The extent of a box is the square of its diagonal: areas vanish for lamps in a row.

mod binary;
mod wide;

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::ops::Range;

use glam::{Vec3A, Vec4};

use super::Receiver;
use crate::sampling::discrete::pick;
use binary::Binary;
use wide::{Below, WIDTH, Wide};

/// Where a light is, and where it shines.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    /// Corners of a box around it.
    pub low: Vec3A,
    pub high: Vec3A,
    /// Most of its intensity in any direction [luminance of W/sr].
    pub intensity: f32,
    /// The directions of its surfaces.
    pub normals: NormalCone,
    /// Angle [rad] to the nearest of its normals beyond which it gives no light.
    pub reach: f32,
    /// Whether it shines against its normals as well.
    pub both_sides: bool,
}

/// A cone of directions.
#[derive(Debug, Clone, Copy)]
pub(super) struct NormalCone {
    pub axis: Vec3A,
    /// Half its opening [rad].
    pub angle: f32,
}

impl NormalCone {
    pub(super) const ALL: Self = Self {
        axis: Vec3A::Z,
        angle: PI,
    };

    /// The smallest cone around two.
    fn union(self, other: Self) -> Self {
        let (wide, narrow) = if self.angle >= other.angle {
            (self, other)
        } else {
            (other, self)
        };
        let between = wide.axis.dot(narrow.axis).clamp(-1.0, 1.0).acos();
        if (between + narrow.angle).min(PI) <= wide.angle {
            return wide;
        }
        let angle = 0.5 * (wide.angle + between + narrow.angle);
        if angle >= PI {
            return Self::ALL;
        }
        let aside = narrow.axis - wide.axis * wide.axis.dot(narrow.axis);
        let aside = aside.try_normalize();
        let aside = aside.unwrap_or_else(|| wide.axis.any_orthonormal_vector());
        let (sin, cos) = (angle - wide.angle).sin_cos();
        Self {
            axis: (cos * wide.axis + sin * aside).normalize(),
            angle,
        }
    }
}

impl Extent {
    pub(super) fn union(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            intensity: self.intensity + other.intensity,
            normals: self.normals.union(other.turned_to(self.normals)),
            reach: self.reach.max(other.reach),
            both_sides: self.both_sides || other.both_sides,
        }
    }

    /// Its normals, towards others if they may be turned.
    fn turned_to(&self, others: NormalCone) -> NormalCone {
        let turn = match self.both_sides && others.axis.dot(self.normals.axis) < 0.0 {
            true => -1.0,
            false => 1.0,
        };
        NormalCone {
            axis: turn * self.normals.axis,
            ..self.normals
        }
    }

    fn center(&self) -> Vec3A {
        0.5 * (self.low + self.high)
    }

    /// What light that begins anywhere in it costs: its energy, extent and spread of direction.
    fn cost(&self) -> f32 {
        let (normal, widest) = (
            self.normals.angle,
            (self.normals.angle + self.reach).min(PI),
        );
        let (sin, cos) = normal.sin_cos();
        let fringe = 2.0 * widest * sin - (normal - 2.0 * widest).cos() - 2.0 * normal * sin + cos;
        let spread = TAU * (1.0 - cos) + FRAC_PI_2 * fringe;
        self.intensity * (self.high - self.low).length_squared() * spread
    }
}

/// Neighbours in the tree that were chosen together.
#[derive(Debug)]
pub(super) struct Part {
    /// Their places in [`EmitterTree::order`].
    pub places: Range<usize>,
    /// With which they are chosen.
    pub probability: f32,
    /// A number that is uniform again.
    pub u: f32,
}

impl Part {
    fn times(self, share: f32) -> Self {
        Self {
            probability: share * self.probability,
            ..self
        }
    }
}

/// How a walk down the tree weighs its way, and where it ends.
pub(super) trait Guide {
    /// Where light arrives.
    fn receiver(&self) -> &Receiver;

    /// About how much of it a light gives; `None` leaves that to its bounds.
    fn irradiance(&self, light: u32) -> Option<f32>;

    /// Whether the walk ends at lights that look alike.
    fn takes_parts(&self) -> bool;
}

/// The tree.
#[derive(Debug)]
pub(super) struct EmitterTree {
    nodes: Vec<Wide>,
    /// The first nodes hold all lights together; so many parts of them are not empty.
    clusters: usize,
    order: Vec<u32>,
    /// The place of each light in it.
    place_of: Vec<u32>,
}

impl EmitterTree {
    /// A tree over at least one light, whose first nodes have up to `clusters` parts.
    pub(super) fn new(lights: &[Extent], clusters: usize) -> Self {
        let binary = Binary::new(lights);
        let mut place_of = vec![0; lights.len()];
        for (place, &light) in (0u32..).zip(&binary.order) {
            place_of[light as usize] = place;
        }
        let tops = binary.opened(0, clusters);
        let mut nodes: Vec<Wide> = tops.chunks(WIDTH).map(|t| Wide::new(&binary, t)).collect();
        let mut todo: Vec<(usize, usize)> = (0..nodes.len()).flat_map(parts_of).collect();
        while let Some((above, part)) = todo.pop() {
            if let Below::Unmerged(node) = nodes[above].below[part] {
                nodes[above].below[part] = Below::Node(nodes.len() as u32);
                todo.extend(parts_of(nodes.len()));
                nodes.push(Wide::new(&binary, &binary.opened(node, WIDTH)));
            }
        }
        Self {
            nodes,
            clusters: tops.len(),
            order: binary.order,
            place_of,
        }
    }

    /// The lights in the order in which the tree has them.
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }

    /// How many parts the first nodes have.
    pub(super) fn clusters(&self) -> usize {
        self.clusters
    }

    /// About how much light the receiver gets from each of them.
    pub(super) fn weigh_clusters(&self, guide: &impl Guide, weights: &mut [f32]) {
        for (node, weights) in (0..).zip(weights.chunks_mut(WIDTH)) {
            weights.copy_from_slice(&self.weigh(node, guide).to_array()[..weights.len()]);
        }
    }

    /// Which of them holds a light.
    pub(super) fn cluster_of(&self, light: u32) -> usize {
        let place = self.place_of[light as usize];
        let tops = &self.nodes[..self.clusters.div_ceil(WIDTH)];
        let node = tops.partition_point(|top| top.begins() <= place) - 1;
        WIDTH * node + tops[node].part_with(place)
    }

    /// Lights of a tree with one first node; `None` where the walk ends between parts without light.
    pub(super) fn draw(&self, guide: &impl Guide, u: f32) -> Option<Part> {
        let (cluster, share, u) = choose(self.weigh(0, guide), u)?;
        Some(self.sample(cluster, guide, u)?.times(share))
    }

    /// What [`EmitterTree::draw`] finds where it finds the light at a place of the order.
    pub(super) fn drawn_with(&self, guide: &impl Guide, place: usize) -> Option<Part> {
        let (cluster, share) = self.nodes[0].choose_place(self.weigh(0, guide), place)?;
        Some(self.part_with(cluster, guide, place)?.times(share))
    }

    /// Lights of a cluster; `None` where the walk ends between parts without light.
    pub(super) fn sample(&self, cluster: usize, guide: &impl Guide, mut u: f32) -> Option<Part> {
        let chosen = self.descend(cluster, guide, |_, weights| {
            let (part, share, rest) = choose(weights, u)?;
            u = rest;
            Some((part, share))
        })?;
        Some(Part { u, ..chosen })
    }

    /// What [`EmitterTree::sample`] finds where it finds the light at a place of the order.
    pub(super) fn part_with(
        &self,
        cluster: usize,
        guide: &impl Guide,
        place: usize,
    ) -> Option<Part> {
        self.descend(cluster, guide, |node, weights| {
            node.choose_place(weights, place)
        })
    }

    /// From a cluster down to where the walk ends; `choose` takes one of a node's parts by their weights, and
    /// says its share of them.
    #[inline]
    fn descend(
        &self,
        cluster: usize,
        guide: &impl Guide,
        mut choose: impl FnMut(&Wide, Vec4) -> Option<(usize, f32)>,
    ) -> Option<Part> {
        let (mut node, mut part, mut probability) = (cluster / WIDTH, cluster % WIDTH, 1.0);
        while let Some(next) = self.below(node, part, guide) {
            let share;
            (part, share) = choose(&self.nodes[next], self.weigh(next, guide))?;
            (node, probability) = (next, probability * share);
        }
        Some(self.nodes[node].chosen(part, probability))
    }

    /// The place of a light in the order.
    pub(super) fn place_of(&self, light: u32) -> usize {
        self.place_of[light as usize] as usize
    }

    /// The node below a part, unless the walk ends there.
    fn below(&self, node: usize, part: usize, guide: &impl Guide) -> Option<usize> {
        let wide = &self.nodes[node];
        match wide.below[part] {
            Below::Node(next) => {
                let ends = guide.takes_parts() && wide.looks_alike(part, guide.receiver());
                (!ends).then_some(next as usize)
            }
            _ => None,
        }
    }

    /// About how much light the receiver gets from each part of a node.
    fn weigh(&self, node: usize, guide: &impl Guide) -> Vec4 {
        let wide = &self.nodes[node];
        let mut weights = wide.importance(guide.receiver());
        for (part, below) in wide.below.iter().enumerate() {
            if let Below::Light(light) = below
                && let Some(irradiance) = guide.irradiance(*light)
            {
                weights[part] = irradiance;
            }
        }
        weights
    }
}

/// Its node's number beside the number of each part.
fn parts_of(node: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..WIDTH).map(move |part| (node, part))
}

/// A part by its weight, with its share, and a number that is uniform again.
fn choose(weights: Vec4, u: f32) -> Option<(usize, f32, f32)> {
    pick(&weights.to_array(), sum(weights), u)
}

/// In the order in which all that weighs parts adds them up.
fn sum(weights: Vec4) -> f32 {
    let [a, b, c, d] = weights.to_array();
    (a + b) + (c + d)
}
