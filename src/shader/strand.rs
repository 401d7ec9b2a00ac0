//! Strands: hair and curves, which come as tubes of triangles but are meant to be round.

use std::f32::consts::{PI, TAU};

use glam::Vec3A;

use super::point::Point;

/// Key of the layer of vectors along a strand, as long as its radius [m, object space], and of how
/// many sides its tube has.
pub const STRAND: u32 = 4;
/// Key of the layer of what Hair Info tells: share of the strand's length up to the point, that
/// length [m, object space], and the strand's number.
pub const STRAND_INFO: u32 = 5;

/// A strand at a point of its tube, world space.
#[derive(Debug, Clone, Copy)]
pub struct Strand {
    /// Unit vector towards the tip.
    pub tangent: Vec3A,
    /// Radius of the round strand [m].
    pub radius: f32,
    sides: f32,
    /// From the axis to the point, at a right angle [m].
    from_axis: Vec3A,
    /// Unit normal of the tube's side, across the strand.
    side: Vec3A,
}

/// Diameters of its tube after which a ray along a strand counts as outside.
const LONGEST_WAY: f32 = 15.0;

impl Strand {
    /// The strand that a point is on; none on other meshes.
    pub fn at(point: &Point) -> Option<Self> {
        let layer = point.attribute(STRAND)?;
        let along = point
            .world_from_object
            .transform_vector3a(Vec3A::from_vec4(layer));
        let tangent = along.try_normalize()?;
        let across = |v: Vec3A| (v - v.dot(tangent) * tangent).try_normalize();
        let outwards = if point.is_back { -1.0 } else { 1.0 };
        let side = outwards * across(point.geometric_normal)?;
        let from_axis = outwards * across(point.normal)?;
        let mut strand = Self {
            tangent,
            radius: along.length(),
            sides: layer.w.round().max(3.0),
            from_axis,
            side,
        };
        // The side is flat: its middle is nearest to the axis.
        let nearest = (PI / strand.sides).cos();
        let cos = from_axis.dot(side).clamp(nearest, 1.0);
        strand.from_axis *= strand.corner_radius() * nearest / cos;
        Some(strand)
    }

    /// Distance of the tube's corners from the axis [m]: tubes are as wide as the strand on average.
    fn corner_radius(&self) -> f32 {
        let half = PI / self.sides;
        self.radius * half / half.sin()
    }

    /// Where a viewer's ray meets the strand: its distance from the axis as a share of the tube's
    /// half width there, -1 to 1; positive towards y in a basis with x along the strand and z to the
    /// viewer. All of the width is then met evenly, as of a round strand.
    pub fn offset(&self, viewer: Vec3A) -> f32 {
        let across = viewer - viewer.dot(self.tangent) * self.tangent;
        let Some(y) = across.cross(self.tangent).try_normalize() else {
            return 0.0;
        };
        let distance = self.from_axis.dot(y);
        let cos = self.side.dot(y) * distance.signum();
        let step = TAU / self.sides;
        let from_corner = cos.clamp(-1.0, 1.0).acos() % step - 0.5 * step;
        (distance / (self.corner_radius() * from_corner.cos())).clamp(-1.0, 1.0)
    }

    /// How far a ray from the point in this unit direction is within the tube [m].
    pub fn way_out(&self, direction: Vec3A) -> f32 {
        // Neighbouring pieces of a bent strand may stand out a little.
        const MARGIN: f32 = 1.01;
        let radius = MARGIN * self.corner_radius();
        let across = direction - direction.dot(self.tangent) * self.tangent;
        let (a, b) = (across.length_squared(), self.from_axis.dot(across));
        let c = self.from_axis.length_squared() - radius * radius;
        let distance = ((b * b - a * c).max(0.0).sqrt() - b) / a;
        // Also for a ray along the axis, for which there is no such number.
        distance.min(2.0 * LONGEST_WAY * radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point of an octagonal tube of radius 2 about the x axis, at an angle from the y axis.
    fn on_tube(angle: f32) -> Strand {
        let (step, unit) = (TAU / 8.0, |a: f32| Vec3A::new(0.0, a.cos(), a.sin()));
        let middle = (angle / step).floor() * step + 0.5 * step;
        let mut strand = Strand {
            tangent: Vec3A::X,
            radius: 2.0,
            sides: 8.0,
            from_axis: unit(angle),
            side: unit(middle),
        };
        strand.from_axis *=
            strand.corner_radius() * (0.5 * step).cos() / unit(angle).dot(unit(middle));
        strand
    }

    #[test]
    fn offsets_reach_from_edge_to_edge_whatever_the_tube_looks_like_from_there() {
        for turn in [0.0f32, 0.1, 0.39, 0.6] {
            let viewer = Vec3A::new(0.5, turn.cos(), turn.sin()).normalize();
            let points = (0..2000).map(|i| on_tube(i as f32 / 2000.0 * TAU));
            let seen = points.filter(|point| point.side.dot(viewer) > 0.0);
            let offsets = seen.map(|point| point.offset(viewer));
            let (low, high) = offsets.fold((1.0f32, -1.0f32), |(low, high), h| {
                (low.min(h), high.max(h))
            });
            assert!(low < -0.996 && high > 0.996, "{turn}: {low} {high}");
            assert!(on_tube(turn).offset(viewer).abs() < 1e-5);
        }
        // The middle of a side, seen from a corner: y is -z here.
        let above = on_tube(PI / 8.0).offset(Vec3A::Y);
        let expected = (PI / 8.0).sin() * (PI / 8.0).cos();
        assert!((above + expected).abs() < 1e-5, "{above} {expected}");
    }

    #[test]
    fn the_way_out_ends_off_the_tube() {
        for angle in [0.0f32, 0.3, 2.0, 5.0] {
            let strand = on_tube(angle);
            for direction in [Vec3A::Y, -Vec3A::Z, Vec3A::new(0.7, -0.5, 0.51).normalize()] {
                let end = strand.from_axis + strand.way_out(direction) * direction;
                let radius = end.with_x(0.0).length();
                assert!(
                    (radius - 1.01 * strand.corner_radius()).abs() < 1e-4,
                    "{radius}"
                );
            }
            let along = strand.way_out(Vec3A::X);
            assert!(along.is_finite() && along > 10.0, "{along}");
        }
    }
}
