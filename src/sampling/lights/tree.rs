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
//! - A single light is weighed by its own estimate of the irradiance it gives, not by its bounds.
//! - The extent of a box is the square of its diagonal: areas vanish for lamps in a row.

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::ops::Range;

use glam::Vec3A;

use super::{ALMOST_ONE, Receiver, WEIGHT_MAX};

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

/// Extent of a node as its importance wants it, and what is below.
#[derive(Debug)]
struct Node {
    center: Vec3A,
    /// Of a ball around everything.
    radius: f32,
    intensity: f32,
    axis: Vec3A,
    cos_normals: f32,
    cos_reach: f32,
    both_sides: bool,
    /// Where in the tree's order those below it begin, and how many they are.
    first: u32,
    count: u32,
    /// Index of the node above; the root names itself.
    parent: u32,
    below: Below,
}

#[derive(Debug, Clone, Copy)]
enum Below {
    /// A light, by its place in the list that the tree was built from.
    Light(u32),
    /// Two nodes: the next one, and this.
    Nodes(u32),
}

/// The tree.
#[derive(Debug)]
pub(super) struct EmitterTree {
    /// A node comes before those below it, which follow it without a gap.
    nodes: Vec<Node>,
    /// The node of each light.
    leaves: Vec<u32>,
    /// The lights from the tree's first to its last.
    order: Vec<u32>,
}

/// Neighbours in the tree that look alike from somewhere: there is no need to weigh one against the other.
#[derive(Debug)]
pub(super) struct Part {
    /// Their places in [`EmitterTree::order`].
    pub places: Range<usize>,
    /// With which it is chosen.
    pub probability: f32,
    /// A number that is uniform again.
    pub u: f32,
}

/// Cosine of `a - b`, held at one where b is larger. Angles are between 0 and pi.
fn cos_of_rest(cos_a: f32, cos_b: f32) -> f32 {
    if cos_a >= cos_b {
        return 1.0;
    }
    let sines = (1.0 - cos_a * cos_a).max(0.0) * (1.0 - cos_b * cos_b).max(0.0);
    cos_a * cos_b + sines.sqrt()
}

/// Cosines may be off by this much through rounding: no light is lost at the edge of its reach.
const SLACK: f32 = 1e-4;

impl Node {
    /// About how much light a plane at the receiver gets from all below, were it all as near, as
    /// much faced and as well directed as the bounds allow; zero only where there is none.
    fn importance(&self, receiver: &Receiver) -> f32 {
        let to_center = self.center - receiver.point;
        let distance_squared = to_center.length_squared();
        let radius_squared = self.radius * self.radius;
        if distance_squared <= radius_squared {
            return self.intensity / radius_squared.max(f32::MIN_POSITIVE);
        }
        let direction = to_center / distance_squared.sqrt();
        let cos_size = (1.0 - radius_squared / distance_squared).max(0.0).sqrt();
        let cos_receiver = cos_of_rest(receiver.normal.dot(direction), cos_size) + SLACK;
        let cos_axis = match self.both_sides {
            true => direction.dot(self.axis).abs(),
            false => -direction.dot(self.axis),
        };
        let cos_normals = cos_of_rest(cos_axis, self.cos_normals);
        let cos_light = cos_of_rest(cos_normals, cos_size) + SLACK;
        if cos_receiver <= 0.0 || cos_light < self.cos_reach {
            return 0.0;
        }
        // A spot's light does not fall with the cosine, and may leave at more than a right angle.
        self.intensity * cos_receiver * cos_light.max(0.05) / distance_squared
    }
}

/// Lights look alike from this many times the radius of the ball around them, if their normals agree as well
/// as this.
const ALIKE_DISTANCE: f32 = 8.0;
const ALIKE_COSINE: f32 = 0.9;

impl Node {
    fn looks_alike(&self, receiver: &Receiver) -> bool {
        let near = ALIKE_DISTANCE * self.radius;
        self.cos_normals > ALIKE_COSINE
            && (self.center - receiver.point).length_squared() > near * near
    }

    fn part(&self, probability: f32) -> Part {
        let first = self.first as usize;
        Part {
            places: first..first + self.count as usize,
            probability,
            u: 0.0,
        }
    }
}

impl EmitterTree {
    /// A tree over at least one light.
    pub(super) fn new(lights: &[Extent]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(2 * lights.len()),
            leaves: vec![0; lights.len()],
            order: Vec::new(),
        };
        let mut members: Vec<u32> = (0..lights.len() as u32).collect();
        // Parts to build: their members, and the node above whose second part each is.
        let mut todo = vec![(0..members.len(), 0, false)];
        while let Some((range, parent, is_second)) = todo.pop() {
            let index = tree.nodes.len() as u32;
            if is_second {
                tree.nodes[parent as usize].below = Below::Nodes(index);
            }
            let part = &mut members[range.clone()];
            tree.push(lights, part, range.start, parent);
            if part.len() > 1 {
                let middle = range.start + split(lights, part);
                todo.push((middle..range.end, index, true));
                todo.push((range.start..middle, index, false));
            } else {
                tree.leaves[part[0] as usize] = index;
            }
        }
        tree.order = members;
        tree
    }

    fn push(&mut self, lights: &[Extent], members: &[u32], first: usize, parent: u32) {
        let extent = union_of(lights, members);
        self.nodes.push(Node {
            center: extent.center(),
            radius: 0.5 * (extent.high - extent.low).length() * (1.0 + 4.0 * f32::EPSILON),
            intensity: extent.intensity,
            axis: extent.normals.axis,
            cos_normals: extent.normals.angle.cos(),
            cos_reach: extent.reach.min(PI).cos(),
            both_sides: extent.both_sides,
            first: first as u32,
            count: members.len() as u32,
            parent,
            below: Below::Light(members[0]),
        });
    }

    /// Up to `count` nodes that together hold all lights, in rising order: the most extended ones
    /// are opened.
    pub(super) fn clusters(&self, count: usize) -> Vec<u32> {
        let weight = |&node: &u32| match &self.nodes[node as usize] {
            Node {
                below: Below::Light(_),
                ..
            } => -1.0,
            node => node.intensity * node.radius * node.radius,
        };
        let mut clusters = vec![0];
        while clusters.len() < count {
            let weights = clusters.iter().map(weight).enumerate();
            let Some((at, _)) = weights.max_by(|a, b| a.1.total_cmp(&b.1)) else {
                break;
            };
            let Below::Nodes(second) = self.nodes[clusters[at] as usize].below else {
                break;
            };
            clusters[at] += 1;
            clusters.push(second);
        }
        clusters.sort_unstable();
        clusters
    }

    /// Which of some nodes, in rising order, that together hold all lights holds this one.
    pub(super) fn cluster_of(&self, light: u32, clusters: &[u32]) -> usize {
        // What is below a node follows it without a gap.
        clusters.partition_point(|&node| node <= self.leaves[light as usize]) - 1
    }

    /// About how much light a plane at the receiver gets from a node. `of_light` says it of a light.
    pub(super) fn irradiance(
        &self,
        node: u32,
        receiver: &Receiver,
        of_light: &impl Fn(u32) -> f32,
    ) -> f32 {
        let node = &self.nodes[node as usize];
        match node.below {
            Below::Light(light) => of_light(light),
            Below::Nodes(_) => node.importance(receiver).min(WEIGHT_MAX),
        }
    }

    /// The lights in the order in which the tree has them: those below a node follow each other.
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }

    /// A part of lights that look alike from the receiver, all of which are weighed by their bounds; `None`
    /// where the walk ends between two nodes without light.
    pub(super) fn part(&self, receiver: &Receiver, mut u: f32) -> Option<Part> {
        let (mut node, mut probability) = (0, 1.0);
        while let Some(second) = self.below(node, receiver) {
            let [first, other] = self.shares([node + 1, second], receiver)?;
            (node, u, probability) = if u < first {
                (node + 1, u / first, probability * first)
            } else {
                (second, (u - first) / other, probability * other)
            };
            u = u.clamp(0.0, ALMOST_ONE);
        }
        Some(Part {
            u,
            ..self.nodes[node as usize].part(probability)
        })
    }

    /// The part that holds the light at a place of the order.
    pub(super) fn part_with(&self, place: usize, receiver: &Receiver) -> Option<Part> {
        let (mut node, mut probability) = (0, 1.0);
        while let Some(second) = self.below(node, receiver) {
            let [first, other] = self.shares([node + 1, second], receiver)?;
            (node, probability) = if place < self.nodes[second as usize].first as usize {
                (node + 1, probability * first)
            } else {
                (second, probability * other)
            };
        }
        Some(self.nodes[node as usize].part(probability))
    }

    /// The second node below one which does not look alike everywhere.
    fn below(&self, node: u32, receiver: &Receiver) -> Option<u32> {
        let node = &self.nodes[node as usize];
        match node.below {
            Below::Nodes(second) if !node.looks_alike(receiver) => Some(second),
            _ => None,
        }
    }

    /// Probabilities of two nodes.
    fn shares(&self, nodes: [u32; 2], receiver: &Receiver) -> Option<[f32; 2]> {
        let weigh = |node: u32| self.nodes[node as usize].importance(receiver);
        let [first, second] = nodes.map(|node| weigh(node).min(WEIGHT_MAX));
        let total = first + second;
        (total > 0.0).then(|| [first / total, second / total])
    }

    /// A light below a node, and the probability of choosing it there; `None` where the walk ends
    /// between two nodes without light.
    pub(super) fn sample(
        &self,
        mut node: u32,
        receiver: &Receiver,
        of_light: &impl Fn(u32) -> f32,
        mut u: f32,
    ) -> Option<(u32, f32)> {
        let mut probability = 1.0;
        loop {
            let second = match self.nodes[node as usize].below {
                Below::Light(light) => return Some((light, probability)),
                Below::Nodes(second) => second,
            };
            let weights = [node + 1, second].map(|n| self.irradiance(n, receiver, of_light));
            let total = weights[0] + weights[1];
            if !(total > 0.0) {
                return None;
            }
            let [first, other] = weights.map(|weight| weight / total);
            (node, u, probability) = if u < first {
                (node + 1, u / first, probability * first)
            } else {
                (second, (u - first) / other, probability * other)
            };
            u = u.clamp(0.0, ALMOST_ONE);
        }
    }

    /// The probability with which [`EmitterTree::sample`] finds a light from a node that is above it.
    pub(super) fn pmf(
        &self,
        light: u32,
        top: u32,
        receiver: &Receiver,
        of_light: &impl Fn(u32) -> f32,
    ) -> f32 {
        let mut node = self.leaves[light as usize];
        let mut probability = 1.0;
        while node != top {
            let parent = self.nodes[node as usize].parent;
            let Below::Nodes(second) = self.nodes[parent as usize].below else {
                return 0.0;
            };
            let weights = [parent + 1, second].map(|n| self.irradiance(n, receiver, of_light));
            let own = weights[usize::from(node == second)];
            if !(own > 0.0) {
                return 0.0;
            }
            probability *= own / (weights[0] + weights[1]);
            node = parent;
        }
        probability
    }
}

fn union_of(lights: &[Extent], members: &[u32]) -> Extent {
    let mut extents = members.iter().map(|&member| lights[member as usize]);
    let first = extents.next().unwrap_or(lights[0]);
    extents.fold(first, Extent::union)
}

/// Parts of each axis between which a split may lie.
const BINS: usize = 12;

/// Orders the members so that the first ones, whose number is returned, are one half of the best
/// split.
fn split(lights: &[Extent], members: &mut [u32]) -> usize {
    let center = |&member: &u32| lights[member as usize].center();
    let low = members.iter().map(center).fold(Vec3A::INFINITY, Vec3A::min);
    let high = members
        .iter()
        .map(center)
        .fold(Vec3A::NEG_INFINITY, Vec3A::max);
    let size = high - low;
    let bin_of = |member: &u32, axis: usize| {
        let share = (center(member)[axis] - low[axis]) / size[axis];
        ((share * BINS as f32) as usize).min(BINS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| size[axis] > 0.0) {
        let mut bins: [Option<Extent>; BINS] = [None; BINS];
        for member in members.iter() {
            let bin = &mut bins[bin_of(member, axis)];
            let light = lights[*member as usize];
            *bin = Some(bin.map_or(light, |bin| bin.union(light)));
        }
        // Long boxes are cut across.
        let regularity = size.max_element() / size[axis];
        for (bin, cost) in split_costs(&bins) {
            let cost = cost * regularity;
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, bin));
            }
        }
    }
    let Some((_, axis, bin)) = best else {
        return members.len() / 2; // all at one place
    };
    members.sort_by_key(|member| bin_of(member, axis));
    members.partition_point(|member| bin_of(member, axis) < bin)
}

/// The cost of splitting before each bin that leaves something on both sides.
fn split_costs(bins: &[Option<Extent>; BINS]) -> impl Iterator<Item = (usize, f32)> {
    let joined = |a: Option<Extent>, b: Option<Extent>| match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        (a, b) => a.or(b),
    };
    let mut above = [None; BINS];
    let mut sum = None;
    for bin in (0..BINS).rev() {
        sum = joined(sum, bins[bin]);
        above[bin] = sum;
    }
    let mut below = None;
    (1..BINS).filter_map(move |bin| {
        below = joined(below, bins[bin - 1]);
        let (below, above) = (below?, above[bin]?);
        Some((bin, below.cost() + above.cost()))
    })
}
