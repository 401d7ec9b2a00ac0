//! The see-through surfaces that a ray passes on its way.

use glam::Vec3A;

use super::bounces::Bounces;
use crate::accel::Hit;
use crate::media::Flight;
use crate::sampling::Sampler;
use crate::shader::RayKind;
use crate::surface::Passage;

/// The numbers that decide whether surfaces stop a ray. Each is the surface's own, so that the order
/// in which the tree meets surfaces does not matter.
pub(super) struct Chance<'a> {
    sampler: &'a Sampler,
    vertex: u32,
}

impl<'a> Chance<'a> {
    /// Chances of a ray of this kind. A shadow ray may meet what the ray before it passed, and has
    /// its own luck.
    pub(super) fn new(kind: RayKind, bounces: &Bounces, sampler: &'a Sampler) -> Self {
        let is_shadow = u32::from(kind == RayKind::Shadow);
        Self {
            sampler,
            vertex: bounces.total ^ is_shadow << 7,
        }
    }

    pub(super) fn of(&self, hit: &Hit) -> f32 {
        let name = hit.instance.wrapping_mul(0x9e37_79b9) ^ hit.triangle.wrapping_mul(0x85eb_ca6b);
        self.sampler
            .transparency(name ^ self.vertex.rotate_left(24))
    }
}

/// A transparent surface that a ray passed.
#[derive(Clone, Copy)]
struct Crossing {
    hit: Hit,
    /// Share of the light that it lets through, over its probability of letting the ray pass.
    share: Vec3A,
    /// Mean share of the light that it does not let through.
    opacity: f32,
}

/// The transparent surfaces that a ray passed, in the order in which the tree showed them, and the
/// media in between.
#[derive(Default)]
pub struct Passed {
    surfaces: Vec<Crossing>,
    pub(super) flight: Flight,
    /// Light that the media gave off.
    pub glow: Vec3A,
    /// What lies behind even media, whether or not they scattered the ray before.
    pub behind: Option<Behind>,
}

/// What a ray ends at behind media.
#[derive(Clone, Copy)]
pub struct Behind {
    /// Share of the light from there that arrives, on the mean.
    pub share: Vec3A,
    /// The light that a surface there gives off and that arrives, on the mean, and its light group; `None`
    /// where the ray leaves the scene.
    pub glow: Option<(Vec3A, u8)>,
}

impl Passed {
    /// Remembers a surface; false, for it stops nothing.
    pub(super) fn note(&mut self, hit: &Hit, Passage { share, probability }: Passage) -> bool {
        self.surfaces.push(Crossing {
            hit: *hit,
            share: share / probability,
            opacity: 1.0 - share.element_sum() / 3.0,
        });
        false
    }

    /// The nearest surface of at least this opacity.
    pub fn first_of(&self, opacity: f32) -> Option<&Hit> {
        let dense = self.surfaces.iter().filter(|c| c.opacity >= opacity);
        dense.min_by(|a, b| by_distance(a, b)).map(|c| &c.hit)
    }

    /// The farthest surface.
    pub fn last(&self) -> Option<&Hit> {
        let last = self.surfaces.iter().max_by(|a, b| by_distance(a, b));
        last.map(|c| &c.hit)
    }

    /// Takes back what lies beyond `end`; the surface at which a ray that passes `limit` ones must
    /// stop.
    pub(super) fn end_at(&mut self, end: f32, limit: u32) -> Option<Hit> {
        self.surfaces.retain(|c| c.hit.t < end);
        let limit = limit as usize;
        if self.surfaces.len() <= limit {
            return None;
        }
        let last = self
            .surfaces
            .select_nth_unstable_by(limit, by_distance)
            .1
            .hit;
        self.surfaces.truncate(limit);
        Some(last)
    }

    /// Whether there are as many as this.
    pub(super) fn reaches(&self, limit: u32) -> bool {
        self.surfaces.len() == limit as usize
    }

    /// Number of surfaces nearer than this.
    pub(super) fn count(&self, distance: f32) -> usize {
        self.surfaces.iter().filter(|c| c.hit.t < distance).count()
    }

    /// Whether a ray that passes `limit` surfaces has ended before this distance.
    pub(super) fn has_ended(&self, distance: f32, limit: u32) -> bool {
        let limit = limit as usize;
        self.surfaces.len() > limit && self.count(distance) > limit
    }

    /// Share of the light from this distance that arrives.
    pub fn share(&self, distance: f32) -> Vec3A {
        self.surfaces_share(distance) * self.flight.share(distance)
    }

    /// The same on the mean over all that may become of the ray in even media: for light that ends no ray.
    pub fn mean_share(&self, distance: f32) -> Vec3A {
        self.surfaces_share(distance) * self.flight.mean_share(distance)
    }

    /// The same as if there were no media.
    pub(super) fn surfaces_share(&self, distance: f32) -> Vec3A {
        let nearer = self.surfaces.iter().filter(|c| c.hit.t < distance);
        nearer.map(|c| c.share).product()
    }
}

fn by_distance(a: &Crossing, b: &Crossing) -> std::cmp::Ordering {
    a.hit.t.total_cmp(&b.hit.t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_where_a_ray_must_stop_is_the_nearest_beyond_the_limit() {
        let hit = |t| Hit {
            t,
            instance: 0,
            triangle: 0,
            u: 0.0,
            v: 0.0,
        };
        let passed = || {
            let mut passed = Passed::default();
            for t in [3.0, 1.0, 4.0, 2.0] {
                let passage = Passage {
                    share: 0.2 * Vec3A::splat(t),
                    probability: 0.2,
                };
                assert!(!passed.note(&hit(t), passage));
            }
            passed
        };
        let stop = |limit, end| passed().end_at(end, limit).map(|hit| hit.t);
        assert_eq!(stop(0, f32::INFINITY), Some(1.0));
        assert_eq!(stop(2, f32::INFINITY), Some(3.0));
        assert_eq!(stop(2, 2.5), None);
        assert_eq!(stop(4, f32::INFINITY), None);
        assert!(passed().has_ended(3.5, 2) && !passed().has_ended(3.0, 2));
        let mut passed = passed();
        assert!((passed.share(2.5) - 2.0).abs().max_element() < 1e-6);
        let first_of = |opacity| passed.first_of(opacity).map(|hit| hit.t);
        assert_eq!(first_of(0.0), Some(1.0));
        assert_eq!(first_of(0.9), None);
        assert_eq!(passed.last().map(|hit| hit.t), Some(4.0));
        passed.end_at(f32::INFINITY, 3);
        assert!((passed.share(f32::INFINITY) - 6.0).abs().max_element() < 1e-5);
    }
}
