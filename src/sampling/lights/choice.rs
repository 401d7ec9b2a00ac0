//! Which light gets a sample: one of all, in proportion to the irradiance that each may give.
//!
//! Up to [`EVALUATED_MAX`] lights are weighed at every point. Of more, those with a place stand in a
//! tree ([`EmitterTree`]), of which a few nodes are weighed in their stead.

use super::tree::{EmitterTree, Extent};
use super::{ALMOST_ONE, Emitter, Receiver, WEIGHT_MAX};

/// Up to this many lights are weighed at every point. More cost more than a shadow ray.
pub(super) const EVALUATED_MAX: usize = 32;

/// Nodes of the tree that are weighed at every point: near ones are told from far ones before the
/// walk down begins, whose first steps know least.
const CLUSTERS: usize = 16;

/// What is weighed at every point.
#[derive(Debug, Clone, Copy)]
enum Entry {
    Light(usize),
    /// A node of the tree.
    Cluster(u32),
}

/// Lights with a place.
struct Placed {
    tree: EmitterTree,
    /// Each of the tree's lights, by its index among all.
    lights: Vec<u32>,
    /// The other way round.
    place_of: Vec<u32>,
}

/// The choice between a frame's lights.
pub(super) struct Choice {
    entries: Vec<Entry>,
    /// The entry of each light.
    entry_of: Vec<u32>,
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
    fn irradiance(&self, index: usize) -> f32 {
        // At a lamp's very centre its irradiance has no bound.
        self.lights[index].irradiance(self.receiver).min(WEIGHT_MAX)
    }
}

impl Choice {
    pub(super) fn new(lights: &[Box<dyn Emitter>]) -> Self {
        let extents: Vec<Option<Extent>> = lights.iter().map(|light| light.extent()).collect();
        let is_placed = |&index: &usize| extents[index].is_some();
        let placed: Vec<u32> = (0..lights.len())
            .filter(is_placed)
            .map(|index| index as u32)
            .collect();
        if lights.len() <= EVALUATED_MAX || placed.is_empty() {
            return Self {
                entries: (0..lights.len()).map(Entry::Light).collect(),
                entry_of: (0..lights.len() as u32).collect(),
                placed: None,
            };
        }
        let far = (0..lights.len()).filter(|index| !is_placed(index));
        let mut entries: Vec<Entry> = far.map(Entry::Light).collect();
        let mut entry_of = vec![0; lights.len()];
        for (at, entry) in entries.iter().enumerate() {
            if let Entry::Light(index) = entry {
                entry_of[*index] = at as u32;
            }
        }
        let in_tree: Vec<Extent> = extents.iter().copied().flatten().collect();
        let tree = EmitterTree::new(&in_tree);
        let clusters = tree.clusters(CLUSTERS);
        let mut place_of = vec![0; lights.len()];
        for (place, &index) in (0u32..).zip(&placed) {
            place_of[index as usize] = place;
            let cluster = tree.cluster_of(place, &clusters);
            entry_of[index as usize] = (entries.len() + cluster) as u32;
        }
        entries.extend(clusters.into_iter().map(Entry::Cluster));
        Self {
            entries,
            entry_of,
            placed: Some(Placed {
                tree,
                lights: placed,
                place_of,
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
        let mut rest = u * total;
        let mut chosen = None;
        for (at, &weight) in weights.iter().enumerate() {
            if weight > 0.0 {
                // Where rounding leaves a rest behind the last one, that is taken.
                chosen = Some((at, weight / total, (rest / weight).clamp(0.0, ALMOST_ONE)));
                if rest < weight {
                    break;
                }
            }
            rest -= weight;
        }
        let (at, probability, u) = chosen?;
        match (self.entries[at], &self.placed) {
            (Entry::Light(index), _) => Some(Chosen {
                index,
                probability,
                u,
            }),
            (Entry::Cluster(node), Some(placed)) => {
                let (index, below) = placed.sample(node, &seen, u)?;
                Some(Chosen {
                    index,
                    probability: probability * below,
                    u: inside,
                })
            }
            _ => None,
        }
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
        let at = self.entry_of[index] as usize;
        if !(total > 0.0) {
            return 0.0;
        }
        let probability = weights[at] / total;
        match (self.entries[at], &self.placed) {
            (Entry::Cluster(node), Some(placed)) => probability * placed.pmf(node, &seen, index),
            _ => probability,
        }
    }

    /// Room for the weights; on the heap only for scenes of dozens of suns.
    fn buffer<'a>(
        &self,
        few: &'a mut [f32; EVALUATED_MAX],
        many: &'a mut Vec<f32>,
    ) -> &'a mut [f32] {
        let count = self.entries.len();
        if count <= EVALUATED_MAX {
            return &mut few[..count];
        }
        many.resize(count, 0.0);
        many
    }

    /// Weighs every entry and returns the sum.
    fn weigh(&self, seen: &Seen, is_among: impl Fn(usize) -> bool, weights: &mut [f32]) -> f32 {
        let mut total = 0.0;
        for (weight, entry) in weights.iter_mut().zip(&self.entries) {
            *weight = match (*entry, &self.placed) {
                (Entry::Light(index), _) if is_among(index) => seen.irradiance(index),
                (Entry::Cluster(node), Some(placed)) => placed.irradiance(node, seen),
                _ => continue,
            };
            total += *weight;
        }
        total
    }
}

impl Placed {
    fn irradiance(&self, node: u32, seen: &Seen) -> f32 {
        let of_light = |light: u32| seen.irradiance(self.lights[light as usize] as usize);
        self.tree.irradiance(node, seen.receiver, &of_light)
    }

    fn sample(&self, node: u32, seen: &Seen, u: f32) -> Option<(usize, f32)> {
        let of_light = |light: u32| seen.irradiance(self.lights[light as usize] as usize);
        let (light, pmf) = self.tree.sample(node, seen.receiver, &of_light, u)?;
        Some((self.lights[light as usize] as usize, pmf))
    }

    fn pmf(&self, node: u32, seen: &Seen, index: usize) -> f32 {
        let of_light = |light: u32| seen.irradiance(self.lights[light as usize] as usize);
        let light = self.place_of[index];
        self.tree.pmf(light, node, seen.receiver, &of_light)
    }
}
