//! An instance whose triangles glow, to both sides as in Cycles.

mod choice;
mod facet;
mod glow;
mod shape;
mod sides;

use std::borrow::Cow;
use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Vec2, Vec3A};

use super::tree::Extent;
use super::{Emitter, LightClass, LightSample, Receiver};
use crate::math::{facing, offset_origin};
use crate::scene::{Reach, SceneFrame};
use facet::Facet;
use glow::{Glow, Shading, Spot};
pub use glow::{emitted_radiance, glow_of};
use shape::Origin;
pub use shape::Shape;
use sides::Sides;

pub(super) struct MeshLight {
    shape: Arc<Shape>,
    /// Where some of its glow is computed by nodes, and where the instance moves.
    shading: Option<Shading>,
}

impl MeshLight {
    /// The light of an instance, which had this shape in another frame; `None` if no triangle of it glows.
    pub(super) fn new(
        frame: &SceneFrame,
        instance: u32,
        previous: Option<&Arc<Shape>>,
    ) -> Option<Self> {
        let origin = Origin::of(frame, instance)?;
        let is_shaded = origin.has_nodes() || origin.is_moving;
        let shading = is_shaded.then(|| Shading::of(frame, instance));
        let shape = Shape::new(frame, instance, origin, shading.as_ref(), previous)?;
        Some(Self { shape, shading })
    }

    pub(super) fn shape(&self) -> &Arc<Shape> {
        &self.shape
    }

    fn radiance(&self, facet: &Facet, at: Vec2, time: f32, direction: Vec3A) -> Vec3A {
        match (self.shape.glow(facet), &self.shading) {
            (Glow::Uniform(radiance), _) => *radiance,
            (Glow::Nodes(nodes), Some(shading)) => {
                let triangle = facet.triangle;
                shading.radiance(nodes, Spot { triangle, at, time }, direction)
            }
            _ => Vec3A::ZERO,
        }
    }

    /// A facet where it is at a share of the shutter's time.
    fn facet_at(&self, index: usize, time: f32) -> Cow<'_, Facet> {
        let facet = &self.shape.facets[index];
        match &self.shading {
            Some(shading) if self.shape.is_moving() => Cow::Owned(Facet {
                corners: shading.corners_at(facet.triangle, time),
                ..*facet
            }),
            _ => Cow::Borrowed(facet),
        }
    }

    /// Density [1/sr] of the point of a facet at `offset` from the receiver; zero on sides that are left to
    /// rays.
    fn pdf_of_facet(&self, pmf: f32, facet: &Facet, receiver: &Receiver, offset: Vec3A) -> f32 {
        let away = offset.dot(facet.area_normal());
        match self.shape.sides {
            Sides::Front if away > 0.0 => return 0.0,
            Sides::Back if away < 0.0 => return 0.0,
            _ => {}
        }
        let density = pmf * facet.pdf(receiver.point, offset);
        if density.is_finite() { density } else { 0.0 }
    }
}

impl Emitter for MeshLight {
    /// The whole instance as a ball of its size around its middle.
    fn irradiance(&self, receiver: &Receiver) -> f32 {
        let Extent { low, high, .. } = self.shape.extent;
        let (center, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
        let to_center = center - receiver.point;
        let distance = to_center.length().max(radius).max(f32::MIN_POSITIVE);
        let above = receiver.normal.dot(to_center) + radius;
        let cos = (above / distance).clamp(0.0, 1.0);
        self.shape.power * cos / (4.0 * PI * distance * distance)
    }

    fn sample(&self, receiver: &Receiver, u_choice: f32, u: [f32; 2]) -> Option<LightSample> {
        let (index, pmf) = self.shape.choice.sample(receiver, u_choice)?;
        let facet = self.facet_at(index, receiver.time);
        let b = facet.sample(receiver.point, u);
        let weights = [1.0 - b.x - b.y, b.x, b.y];
        let mix = |k: usize| weights[k] * facet.corners[k];
        let point = mix(0) + mix(1) + mix(2);
        let offset = point - receiver.point;
        let distance = offset.length();
        let pdf_solid_angle = self.pdf_of_facet(pmf, &facet, receiver, offset);
        if !(pdf_solid_angle > 0.0 && distance > 0.0) {
            return None;
        }
        let radiance = self.radiance(&facet, b, receiver.time, offset);
        Some(LightSample {
            direction: offset / distance,
            distance,
            end: Some(offset_origin(point, facing(facet.normal(), -offset))),
            radiance: Some(radiance),
            pdf_solid_angle,
            is_delta: false,
            class: LightClass::Local,
            reach: Reach::ALL,
        })
    }

    fn pdf_of_triangle(&self, receiver: &Receiver, triangle: u32, hit: Vec3A) -> f32 {
        let found = self
            .shape
            .facets
            .binary_search_by_key(&triangle, |f| f.triangle);
        found.map_or(0.0, |index| {
            let facet = self.facet_at(index, receiver.time);
            let pmf = self.shape.choice.pmf(receiver, index);
            self.pdf_of_facet(pmf, &facet, receiver, hit - receiver.point)
        })
    }

    fn extent(&self) -> Option<Extent> {
        Some(self.shape.extent)
    }
}
