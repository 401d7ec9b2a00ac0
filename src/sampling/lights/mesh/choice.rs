//! Which triangle of a glowing instance gets a sample.

use std::f32::consts::{FRAC_PI_2, PI};
use std::ops::Range;

use super::facet::Facet;
use super::sides::Sides;
use crate::sampling::discrete::Discrete;
use crate::sampling::lights::Receiver;
use crate::sampling::lights::tree::{EmitterTree, Extent, Guide, NormalCone, Part};

/// More triangles than this stand in the tree by groups that follow each other in the mesh.
const LEAVES_MAX: usize = 1 << 14;

/// One node of the tree.
const CLUSTERS: usize = 4;

/// Triangles are weighed by their bounds, and not at all against those that look alike.
struct Bounds<'a>(&'a Receiver);

impl Guide for Bounds<'_> {
    fn receiver(&self) -> &Receiver {
        self.0
    }

    fn irradiance(&self, _light: u32) -> Option<f32> {
        None
    }

    fn takes_parts(&self) -> bool {
        true
    }
}

/// By power, or where they are known ahead by place as well.
pub struct FacetChoice {
    /// In the order of the tree, if there is one.
    by_power: Discrete,
    by_place: Option<ByPlace>,
}

struct ByPlace {
    /// Over groups of triangles.
    tree: EmitterTree,
    /// Where in the tree's order the triangles of each group begin, and the end.
    starts: Vec<u32>,
    /// The triangle at each of these places.
    facets: Vec<u32>,
    /// The other way round.
    place_of: Vec<u32>,
}

impl FacetChoice {
    /// `None` where no power is above zero.
    pub fn new(facets: &[Facet], powers: &[f32], sides: Sides, is_moving: bool) -> Option<Self> {
        if is_moving || facets.len() < 2 {
            let by_power = Discrete::new(powers.iter().copied())?;
            let by_place = None;
            return Some(Self { by_power, by_place });
        }
        let by_place = ByPlace::new(facets, powers, sides);
        let power_at = |&facet: &u32| powers[facet as usize];
        Some(Self {
            by_power: Discrete::new(by_place.facets.iter().map(power_at))?,
            by_place: Some(by_place),
        })
    }

    /// A triangle and its probability; `None` where none shines on the receiver.
    pub fn sample(&self, receiver: &Receiver, u: f32) -> Option<(usize, f32)> {
        let Some(by_place) = &self.by_place else {
            let (index, pmf, _) = self.by_power.sample(u);
            return Some((index, pmf));
        };
        let part = by_place.tree.draw(&Bounds(receiver), u)?;
        let places = by_place.places(&part);
        let (place, pmf) = self.by_power.sample_among(places, part.u)?;
        Some((by_place.facets[place] as usize, part.probability * pmf))
    }

    /// The probability with which a triangle is found.
    pub fn pmf(&self, receiver: &Receiver, index: usize) -> f32 {
        let Some(by_place) = &self.by_place else {
            return self.by_power.pmf(index);
        };
        let place = by_place.place_of[index] as usize;
        let group = by_place
            .starts
            .partition_point(|&start| start as usize <= place)
            - 1;
        let part = by_place.tree.drawn_with(&Bounds(receiver), group);
        part.map_or(0.0, |part| {
            part.probability * self.by_power.pmf_among(by_place.places(&part), place)
        })
    }
}

impl ByPlace {
    fn new(facets: &[Facet], powers: &[f32], sides: Sides) -> Self {
        let size = facets.len().div_ceil(LEAVES_MAX);
        let groups = facets.chunks(size).zip(powers.chunks(size));
        let extents = groups.filter_map(|(f, p)| extent_of(f, p, sides));
        let tree = EmitterTree::new(&extents.collect::<Vec<_>>(), CLUSTERS);
        let mut by_place = Self {
            starts: vec![0],
            facets: Vec::with_capacity(facets.len()),
            place_of: vec![0; facets.len()],
            tree,
        };
        for &group in by_place.tree.order() {
            let first = group as usize * size;
            for facet in first..(first + size).min(facets.len()) {
                by_place.place_of[facet] = by_place.facets.len() as u32;
                by_place.facets.push(facet as u32);
            }
            by_place.starts.push(by_place.facets.len() as u32);
        }
        by_place
    }

    /// Of the triangles of a part.
    fn places(&self, part: &Part) -> Range<usize> {
        let Range { start, end } = part.places;
        self.starts[start] as usize..self.starts[end] as usize
    }
}

/// Where triangles are, and where they shine; `None` where there are none.
pub fn extent_of(facets: &[Facet], powers: &[f32], sides: Sides) -> Option<Extent> {
    let lit = facets.iter().zip(powers);
    let extents = lit.map(|(facet, &power)| {
        let [a, b, c] = facet.corners;
        let turn = if sides == Sides::Back { -1.0 } else { 1.0 };
        let of_both = if sides == Sides::Both { 0.5 } else { 1.0 };
        Extent {
            low: a.min(b).min(c),
            high: a.max(b).max(c),
            intensity: of_both * power / PI,
            normals: NormalCone {
                axis: turn * facet.normal(),
                angle: 0.0,
            },
            reach: FRAC_PI_2,
            both_sides: sides == Sides::Both,
        }
    });
    extents.reduce(Extent::union)
}
