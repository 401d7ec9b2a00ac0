//! Which light gets a sample: one of all, in proportion to the irradiance that each may give.
//!
//! Up to [`EVALUATED_MAX`] lights are weighed at every point. Of more, those with a place stand in a
//! tree ([`EmitterTree`]), of which a few nodes are weighed in their stead.

use super::tree::{EmitterTree, Extent, Guide};
use super::{Emitter, Receiver, WEIGHT_MAX};
use crate::sampling::discrete::pick;

/// Up to this many lights are weighed at every point. More cost more than a shadow ray.
pub(super) const EVALUATED_MAX: usize = 32;

/// Nodes of the tree that are weighed at every point: near ones are told from far ones before the
/// walk down begins, whose first steps know least.
const CLUSTERS: usize = 16;

/// Lights with a place.
struct Placed {
    tree: EmitterTree,
    /// Each of the tree's lights, by its index among all.
    lights: Vec<u32>,
}

/// Where a light is looked for.
#[derive(Debug, Clone, Copy)]
enum Entry {
    /// Among those weighed at every point.
    Alone(u32),
    /// In the tree, by its number there.
    Placed(u32),
}

/// The choice between a frame's lights.
pub(super) struct Choice {
    /// Lights that are weighed at every point, as the clusters of the tree are.
    alone: Vec<u32>,
    /// Of each light.
    entries: Vec<Entry>,
    placed: Option<Placed>,
}

/// A light that was chosen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chosen {
    pub index: usize,
    pub probability: f32,
    /// A number that is uniform again.
    pub u: f32,
}

/// Lights as a point sees them.
struct Seen<'a> {
    lights: &'a [Box<dyn Emitter>],
    receiver: &'a Receiver,
}

impl Seen<'_> {
    fn irradiance(&self, index: u32) -> f32 {
        // At a lamp's very centre its irradiance has no bound.
        self.lights[index as usize]
            .irradiance(self.receiver)
            .min(WEIGHT_MAX)
    }
}

/// The same for the walk down the tree: lights are weighed by their own estimates.
struct Down<'a> {
    seen: &'a Seen<'a>,
    placed: &'a Placed,
}

impl Guide for Down<'_> {
    fn receiver(&self) -> &Receiver {
        self.seen.receiver
    }

    fn irradiance(&self, light: u32) -> Option<f32> {
        Some(self.seen.irradiance(self.placed.lights[light as usize]))
    }

    fn takes_parts(&self) -> bool {
        false
    }
}

impl Choice {
    pub(super) fn new(lights: &[Box<dyn Emitter>]) -> Self {
        let extents: Vec<Option<Extent>> = lights.iter().map(|light| light.extent()).collect();
        let all = 0..lights.len() as u32;
        let is_placed = |&index: &u32| extents[index as usize].is_some();
        if lights.len() <= EVALUATED_MAX || !all.clone().any(|index| is_placed(&index)) {
            return Self {
                entries: all.clone().map(Entry::Alone).collect(),
                alone: all.collect(),
                placed: None,
            };
        }
        let (placed, alone): (Vec<u32>, Vec<u32>) = all.partition(is_placed);
        let mut entries = vec![Entry::Alone(0); lights.len()];
        for (at, &index) in (0u32..).zip(&alone) {
            entries[index as usize] = Entry::Alone(at);
        }
        for (at, &index) in (0u32..).zip(&placed) {
            entries[index as usize] = Entry::Placed(at);
        }
        let in_tree: Vec<Extent> = extents.into_iter().flatten().collect();
        Self {
            alone,
            entries,
            placed: Some(Placed {
                tree: EmitterTree::new(&in_tree, CLUSTERS),
                lights: placed,
            }),
        }
    }

    /// A light of those that are among the ones to choose from, which all in the tree are; `None`
    /// where no light gives any. `inside` is a second random number, for the way down the tree.
    pub(super) fn choose(
        &self,
        lights: &[Box<dyn Emitter>],
        receiver: &Receiver,
        is_among: impl Fn(usize) -> bool,
        u: f32,
        inside: f32,
    ) -> Option<Chosen> {
        let seen = Seen { lights, receiver };
        let (mut few, mut many) = ([0.0; EVALUATED_MAX], Vec::new());
        let weights = self.buffer(&mut few, &mut many);
        let total = self.weigh(&seen, is_among, weights);
        if !(total > 0.0) {
            return None;
        }
        let (at, probability, u) = pick(weights, total, u)?;
        if let Some(&index) = self.alone.get(at) {
            return Some(Chosen {
                index: index as usize,
                probability,
                u,
            });
        }
        let placed = self.placed.as_ref()?;
        let (index, below) = placed.sample(at - self.alone.len(), &seen, u)?;
        Some(Chosen {
            index,
            probability: probability * below,
            u: inside,
        })
    }

    /// The probability with which [`Choice::choose`] finds a light that is among those to choose
    /// from.
    pub(super) fn pmf(
        &self,
        lights: &[Box<dyn Emitter>],
        receiver: &Receiver,
        is_among: impl Fn(usize) -> bool,
        index: usize,
    ) -> f32 {
        let seen = Seen { lights, receiver };
        let (mut few, mut many) = ([0.0; EVALUATED_MAX], Vec::new());
        let weights = self.buffer(&mut few, &mut many);
        let total = self.weigh(&seen, is_among, weights);
        if !(total > 0.0) {
            return 0.0;
        }
        match (self.entries[index], &self.placed) {
            (Entry::Placed(light), Some(placed)) => {
                let cluster = placed.tree.cluster_of(light);
                let probability = weights[self.alone.len() + cluster] / total;
                probability * placed.pmf(cluster, &seen, light)
            }
            (Entry::Alone(at) | Entry::Placed(at), _) => weights[at as usize] / total,
        }
    }

    /// Room for the weights; on the heap only for scenes of dozens of suns.
    fn buffer<'a>(
        &self,
        few: &'a mut [f32; EVALUATED_MAX],
        many: &'a mut Vec<f32>,
    ) -> &'a mut [f32] {
        let clusters = self
            .placed
            .as_ref()
            .map_or(0, |placed| placed.tree.clusters());
        let count = self.alone.len() + clusters;
        if count <= EVALUATED_MAX {
            return &mut few[..count];
        }
        many.resize(count, 0.0);
        many
    }

    /// Weighs the lights that stand alone, then the clusters, and returns the sum.
    fn weigh(&self, seen: &Seen, is_among: impl Fn(usize) -> bool, weights: &mut [f32]) -> f32 {
        let (alone, clusters) = weights.split_at_mut(self.alone.len());
        for (weight, &index) in alone.iter_mut().zip(&self.alone) {
            if is_among(index as usize) {
                *weight = seen.irradiance(index);
            }
        }
        if let Some(placed) = &self.placed {
            let down = Down { seen, placed };
            placed.tree.weigh_clusters(&down, clusters);
        }
        weights.iter().sum()
    }
}

impl Placed {
    fn sample(&self, cluster: usize, seen: &Seen, u: f32) -> Option<(usize, f32)> {
        let down = Down { seen, placed: self };
        let part = self.tree.sample(cluster, &down, u)?;
        let light = self.tree.order()[part.places.start];
        Some((self.lights[light as usize] as usize, part.probability))
    }

    fn pmf(&self, cluster: usize, seen: &Seen, light: u32) -> f32 {
        let down = Down { seen, placed: self };
        let part = self
            .tree
            .part_with(cluster, &down, self.tree.place_of(light));
        part.map_or(0.0, |part| part.probability)
    }
}
