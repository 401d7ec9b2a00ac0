//! Dividing lights in two, again and again, where energy, extent and spread of direction are least.

use glam::Vec3A;

use super::Extent;

/// Some of the lights.
#[derive(Debug)]
pub struct Node {
    pub extent: Extent,
    /// Where in the tree's order they begin.
    pub first: u32,
    pub count: u32,
    pub below: Below,
}

#[derive(Debug, Clone, Copy)]
pub enum Below {
    /// A light, by its place in the list that the tree was built from.
    Light(u32),
    /// Two nodes.
    Nodes([u32; 2]),
}

/// The tree.
#[derive(Debug)]
pub struct Binary {
    /// The first one holds all.
    pub nodes: Vec<Node>,
    /// The lights from the tree's first to its last: those below a node follow each other.
    pub order: Vec<u32>,
}

impl Binary {
    /// A tree over at least one light.
    pub fn new(lights: &[Extent]) -> Self {
        let mut nodes: Vec<Node> = Vec::with_capacity(2 * lights.len());
        let mut order: Vec<u32> = (0..lights.len() as u32).collect();
        // Parts to build: their members, and which part of the node above they are.
        let mut todo = vec![(0..order.len(), None::<(u32, usize)>)];
        while let Some((range, above)) = todo.pop() {
            let index = nodes.len() as u32;
            if let Some((parent, which)) = above
                && let Below::Nodes(parts) = &mut nodes[parent as usize].below
            {
                parts[which] = index;
            }
            let members = &mut order[range.clone()];
            nodes.push(Node {
                extent: union_of(lights, members),
                first: range.start as u32,
                count: members.len() as u32,
                below: Below::Light(members[0]),
            });
            if members.len() > 1 {
                let middle = range.start + split(lights, members);
                nodes[index as usize].below = Below::Nodes([0; 2]);
                todo.push((middle..range.end, Some((index, 1))));
                todo.push((range.start..middle, Some((index, 0))));
            }
        }
        Self { nodes, order }
    }

    /// Up to `count` nodes that together hold what is below one, in the tree's order: the most extended ones
    /// are opened.
    pub fn opened(&self, node: u32, count: usize) -> Vec<u32> {
        let weight = |&node: &u32| match &self.nodes[node as usize] {
            Node {
                below: Below::Light(_),
                ..
            } => -1.0,
            node => node.extent.intensity * (node.extent.high - node.extent.low).length_squared(),
        };
        let mut opened = vec![node];
        while opened.len() < count {
            let weights = opened.iter().map(weight).enumerate();
            let Some((at, _)) = weights.max_by(|a, b| a.1.total_cmp(&b.1)) else {
                break;
            };
            let Below::Nodes(parts) = self.nodes[opened[at] as usize].below else {
                break;
            };
            opened.splice(at..=at, parts);
        }
        opened
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
