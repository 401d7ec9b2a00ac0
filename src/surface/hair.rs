//! What the nodes of hair mean at a point.

use glam::Vec3A;

use super::{Surface, normal_at};
use crate::sampling::Hair;
use crate::shader::{self, Pigment, Point, Strand};

impl Surface {
    /// Adds a Principled Hair BSDF. Rays leave a strand on its far side.
    pub(super) fn add_hair(&mut self, h: &shader::Hair, weight: Vec3A, point: &Point) {
        self.strand = Strand::at(point);
        let (tangent, across) = match &self.strand {
            Some(strand) => (strand.tangent, strand.offset(point.incoming)),
            None => across_mesh(point),
        };
        self.bsdf.add_hair(weight, &hair_of(h), tangent, across);
    }

    /// Adds a Hair BSDF.
    pub(super) fn add_streak(&mut self, s: &shader::Streak, weight: Vec3A, point: &Point) {
        self.strand = Strand::at(point);
        let (own, normal, offset) = match &self.strand {
            Some(strand) => (strand.tangent, Vec3A::ZERO, s.offset),
            // As in Cycles: along the second edge of the triangle, without an offset.
            None => (
                point.edges[1].normalize_or(Vec3A::X),
                normal_at(point, Vec3A::ZERO),
                0.0,
            ),
        };
        let given = s.tangent.try_normalize();
        let tangent = given.unwrap_or(own);
        let offset = given.map_or(offset, |_| s.offset);
        let weight = weight * s.color.max(Vec3A::ZERO);
        self.bsdf
            .add_streak(weight, (tangent, normal), s.widths, -offset, s.passes);
    }
}

/// The grain of a mesh that has hair's shader, and where it is met: as in Cycles the triangle's first
/// edge, and as if the triangle were a part of a strand.
fn across_mesh(point: &Point) -> (Vec3A, f32) {
    let tangent = point.edges[0].normalize_or(Vec3A::X);
    let y = point.incoming.cross(tangent).normalize_or_zero();
    (tangent, point.geometric_normal.dot(y))
}

/// The hair that the node's inputs describe, varied at random as Cycles does it.
fn hair_of(h: &shader::Hair) -> Hair {
    let varied = |range: f32| 1.0 + 2.0 * (h.random - 0.5) * range;
    let [roughness, radial_roughness] =
        [h.roughness, h.radial_roughness].map(|value| value * varied(h.random_roughness));
    let sigma = match h.pigment {
        Pigment::Absorption(sigma) => sigma,
        Pigment::Color(color) => Hair::absorption_of(color, radial_roughness),
        Pigment::Melanin {
            amount,
            redness,
            tint,
        } => {
            let amount = amount * varied(h.random_color.clamp(0.0, 1.0));
            Hair::absorption_of_melanin(amount, redness)
                + Hair::absorption_of(tint, radial_roughness)
        }
    };
    Hair {
        sigma: sigma.max(Vec3A::ZERO),
        roughness,
        radial_roughness,
        coat: h.coat,
        ior: h.ior,
        tilt: h.offset,
    }
}
