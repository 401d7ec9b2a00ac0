//! The triangles of a glowing instance, and how one of them is chosen.

use std::sync::Arc;

use glam::Affine3A;

use super::choice::{FacetChoice, extent_of};
use super::facet::Facet;
use super::glow::{Glow, Shading, powers};
use super::sides::{Sides, may_hide_a_side, sides_of};
use crate::sampling::lights::tree::{Extent, NormalCone};
use crate::scene::{Mesh, SceneFrame};

/// What the light of an instance is drawn from; frames share it while nothing of it changes.
pub struct Shape {
    origin: Origin,
    /// In rising order.
    pub facets: Vec<Facet>,
    pub choice: FacetChoice,
    pub sides: Sides,
    pub extent: Extent,
    /// To those sides.
    pub power: f32,
}

/// What a shape follows from.
pub struct Origin {
    mesh: Arc<Mesh>,
    world_from_object: Affine3A,
    /// By material slot.
    pub glows: Vec<Glow>,
    pub is_moving: bool,
    may_hide_a_side: bool,
}

impl Origin {
    /// `None` if nothing of the instance glows.
    pub fn of(frame: &SceneFrame, instance: u32) -> Option<Self> {
        let placed = &frame.instances[instance as usize];
        let materials = placed.materials.iter();
        let glows: Vec<Glow> = materials
            .map(|&material| Glow::of(&frame.materials[material as usize]))
            .collect();
        if glows.iter().all(|glow| matches!(glow, Glow::Dark)) {
            return None;
        }
        let is_moving = frame.moves(instance);
        Some(Self {
            mesh: frame.meshes[placed.mesh as usize].clone(),
            world_from_object: placed.placement.world_from_object,
            glows,
            is_moving,
            may_hide_a_side: !is_moving && may_hide_a_side(frame, instance),
        })
    }

    pub fn has_nodes(&self) -> bool {
        self.glows.iter().any(|glow| matches!(glow, Glow::Nodes(_)))
    }

    /// Whether both make the same shape, as far as can be told without making it.
    fn is_same(&self, other: &Self) -> bool {
        let glows = self.glows.iter().zip(&other.glows);
        Arc::ptr_eq(&self.mesh, &other.mesh)
            && self.world_from_object == other.world_from_object
            && self.glows.len() == other.glows.len()
            && glows.into_iter().all(|(a, b)| a.is_same(b))
            && !self.is_moving
            && !other.is_moving
            && self.may_hide_a_side == other.may_hide_a_side
    }
}

impl Shape {
    /// The shape of an instance, or that of another frame if it is the same; `None` if no triangle of it glows.
    pub fn new(
        frame: &SceneFrame,
        instance: u32,
        origin: Origin,
        shading: Option<&Shading>,
        previous: Option<&Arc<Self>>,
    ) -> Option<Arc<Self>> {
        if let Some(previous) = previous.filter(|shape| shape.origin.is_same(&origin)) {
            return Some(previous.clone());
        }
        let facets = Facet::all(frame, instance, &origin.glows);
        let sides = match origin.may_hide_a_side {
            true => sides_of(&origin.mesh, &facets),
            false => Sides::Both,
        };
        let powers = powers(&facets, &origin.glows, shading, sides);
        let mut extent = extent_of(&facets, &powers, sides)?;
        if let Some((low, high)) = origin
            .is_moving
            .then(|| frame.bounds_of(instance))
            .flatten()
        {
            let normals = NormalCone::ALL;
            extent = Extent {
                low,
                high,
                normals,
                ..extent
            };
        }
        Some(Arc::new(Self {
            choice: FacetChoice::new(&facets, &powers, sides, origin.is_moving)?,
            power: powers.iter().sum(),
            extent,
            sides,
            facets,
            origin,
        }))
    }

    /// How the material of a facet shines.
    pub fn glow(&self, facet: &Facet) -> &Glow {
        &self.origin.glows[facet.glow as usize]
    }

    /// Whether it moves while the shutter is open.
    pub fn is_moving(&self) -> bool {
        self.origin.is_moving
    }
}
