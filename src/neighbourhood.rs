//! What lies around a point of a surface, for programs that ask.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3A};

use crate::accel::{Accel, Hit};
use crate::math::warp::sample_cosine_hemisphere;
use crate::math::{Frame, Ray};
use crate::sampling::Sampler;
use crate::scene::{Facet, SceneFrame};
use crate::shader::{Around, Point, RayInfo, RayKind, Search};
use crate::surface::ray_off;

/// The things around a point that a ray met.
pub struct Neighbourhood<'a> {
    /// The frame.
    pub frame: &'a SceneFrame,
    /// Its geometry.
    pub accel: &'a Accel,
    /// The numbers of the path.
    pub sampler: &'a Sampler,
    /// Scattering events before.
    pub vertex: u32,
    /// Whether the ray has been scattered so widely that nobody sees rounded edges.
    pub is_blurred: bool,
    /// When the ray meets the scene: the share of the shutter's time that has passed.
    pub time: f32,
}

/// The plane's most even additive recurrence: one over the plastic number, and its square.
///
/// Source: Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018.
const STEPS: [f32; 2] = [0.754_877_7, 0.569_840_3];

impl Around for Neighbourhood<'_> {
    fn openness(&self, point: &Point, normal: Vec3A, search: &Search) -> f32 {
        let first = self.sampler.around(self.vertex);
        let about = Frame::from_normal(normal);
        let is_open = |i: &u32| {
            let u = [0, 1].map(|axis| (first[axis] + *i as f32 * STEPS[axis]).fract());
            let direction = about.to_world(sample_cosine_hemisphere(u));
            let ray = Ray {
                t_max: search.distance,
                ..ray_off(point, direction).at_time(self.time)
            };
            match point.instance {
                Some(own) if search.is_local => {
                    self.accel.closest_hit_of(self.frame, &ray, own).is_none()
                }
                _ => !self.is_blocked(&ray),
            }
        };
        (0..search.count).filter(is_open).count() as f32 / search.count as f32
    }

    /// As in Cycles (kernel/svm/bevel.h): the mean of the normals that lines through the ball around
    /// the point meet, half of them along the normal and a quarter along each of two others, joined
    /// by the power heuristic (King and others, "BSSRDF Importance Sampling", SIGGRAPH 2013).
    fn rounded(&self, point: &Point, radius: f32, count: u32) -> Option<Vec3A> {
        let own = point.instance.filter(|_| !self.is_blurred)?;
        let first = self.sampler.around(self.vertex);
        let normal = point.geometric_normal;
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let line = |i: u32| {
            let [u, v] = [0, 1].map(|axis| (first[axis] + i as f32 * STEPS[axis]).fract());
            let (axes, pmfs, turn) = match u {
                ..0.5 => ([normal, tangent, bitangent], [0.5, 0.25, 0.25], 2.0 * u),
                ..0.75 => (
                    [tangent, normal, bitangent],
                    [0.25, 0.5, 0.25],
                    4.0 * u - 2.0,
                ),
                _ => (
                    [bitangent, tangent, normal],
                    [0.25, 0.25, 0.5],
                    4.0 * u - 3.0,
                ),
            };
            Line {
                axes,
                pmfs,
                turn,
                u: v,
            }
        };
        let sum: Vec3A = (0..count)
            .map(|i| self.normals_along(point, own, radius, &line(i)))
            .sum();
        let side = if point.is_back { -1.0 } else { 1.0 };
        Some((side * sum).try_normalize().unwrap_or(point.normal))
    }
}

/// A line that looks for normals.
struct Line {
    /// Its direction, and two across it.
    axes: [Vec3A; 3],
    /// Probabilities of choosing each of them.
    pmfs: [f32; 3],
    /// Where about the point it lies, in turns.
    turn: f32,
    /// Share of all lines that are nearer to the point.
    u: f32,
}

/// How much a normal counts at this share of the radius.
fn nearness(share: f32) -> f32 {
    (1.0 - share).max(0.0).powi(3)
}

/// The share of the radius within which a share `u` of a disk lies where points count by
/// [`nearness`].
fn share_within(u: f32) -> f32 {
    // The integral of 20 x (1 - x)^3, which has no inverse in closed form.
    let below = |x: f32| 1.0 - (1.0 - x).powi(4) * (1.0 + 4.0 * x);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if below(middle) < u {
            low = middle;
        } else {
            high = middle;
        }
    }
    // Not the rim, where nothing counts.
    (0.5 * (low + high)).min(0.999)
}

impl Neighbourhood<'_> {
    /// The normals, weighted by how near they are to a point, that a line through the ball around it
    /// meets.
    fn normals_along(&self, point: &Point, own: u32, radius: f32, search: &Line) -> Vec3A {
        let Line {
            axes,
            pmfs,
            turn,
            u,
        } = *search;
        let [along, one, other] = axes;
        let near = radius * share_within(u);
        let (sin, cos) = (TAU * turn).sin_cos();
        let half = (radius * radius - near * near).sqrt();
        let across = near * (cos * one + sin * other);
        let ray = Ray {
            t_max: 2.0 * half,
            ..Ray::new(point.position + half * along + across, -along).at_time(self.time)
        };
        let info = RayInfo::default();
        let weighted = |hit: &Hit| {
            let facet = Facet::new(self.frame, own, hit.triangle, self.time);
            let met = facet.point(Vec2::new(hit.u, hit.v), ray.direction, hit.t, &info);
            let outside = if met.is_back { -met.normal } else { met.normal };
            let pdfs = [0, 1, 2].map(|i| pmfs[i] * axes[i].dot(met.geometric_normal).abs());
            let weight = pdfs[0] / pdfs.map(|pdf| pdf * pdf).iter().sum::<f32>();
            let distance = met.position.distance(point.position);
            outside * (weight * nearness(distance / radius) / nearness(near / radius))
        };
        let hits = self.accel.hits_of(self.frame, &ray, own);
        hits.iter().map(weighted).sum()
    }

    /// Whether anything lies on a ray that stops light, be it transparent.
    fn is_blocked(&self, ray: &Ray) -> bool {
        let stops = |hit: &Hit| {
            let instance = &self.frame.instances[hit.instance as usize];
            instance.visibility.includes(RayKind::Shadow)
        };
        self.accel.occluded_where(self.frame, ray, stops)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::MIDDLE_TIME;
    use crate::scene::Visibility;
    use crate::testing::{Scene, diffuse, mesh, square};
    use glam::{Affine3A, Vec2, Vec3};

    /// The openness of a floor, on one of its sides, within 2 m below a roof 1 m above it.
    fn openness(side: f32, roof: Visibility, is_local: bool) -> f32 {
        let mut scene = Scene::new();
        let wide = Affine3A::from_scale(Vec3::splat(100.0));
        scene.add(square(), wide, diffuse(0.5));
        let above = Affine3A::from_translation(Vec3::Z) * wide;
        let above = scene.add(square(), above, diffuse(0.5));
        scene.instances[above].visibility = roof;
        let frame = scene.frame(1);
        let accel = Accel::build(&frame, None);
        let facet = Facet::new(&frame, 0, 0, MIDDLE_TIME);
        let info = RayInfo::default();
        let point = facet.point(Vec2::splat(0.3), -Vec3A::Z, 1.0, &info);
        let open = |iteration| {
            let around = Neighbourhood {
                frame: &frame,
                accel: &accel,
                sampler: &Sampler::new(0, 1, [0; 2], iteration, 1 << 16),
                vertex: 0,
                is_blurred: false,
                time: MIDDLE_TIME,
            };
            let search = Search {
                distance: 2.0,
                count: 16,
                is_local,
            };
            around.openness(&point, side * Vec3A::Z, &search)
        };
        (0..64).map(open).sum::<f32>() / 64.0
    }

    /// Directions whose cosine is less than half pass below the roof's reach: a quarter by cosine.
    /// The tolerance is three standard deviations of 1024 independent directions.
    #[test]
    fn a_roof_closes_what_it_is_near_to() {
        let open = openness(1.0, Visibility::ALL, false);
        assert!((open - 0.25).abs() < 0.04, "{open}");
        assert_eq!(openness(-1.0, Visibility::ALL, false), 1.0);
        assert_eq!(openness(1.0, Visibility::ALL, true), 1.0);
        let unseen = Visibility::ALL.without(RayKind::Shadow);
        assert_eq!(openness(1.0, unseen, false), 1.0);
    }

    /// The normal of a shelf's top at this distance from its edge, at which its front goes down, with
    /// a radius of 0.2 m.
    fn rounded(distance: f32, is_blurred: bool) -> Option<Vec3A> {
        let vertices = [-1.0f32, 1.0]
            .map(|x| [(-1.0, 0.0), (0.0, 0.0), (0.0, -1.0)].map(|(y, z)| Vec3::new(x, y, z)));
        let quads = [[0, 3, 1], [3, 4, 1], [1, 4, 2], [4, 5, 2]];
        let mut scene = Scene::new();
        let shelf = mesh(vertices.as_flattened(), &quads);
        scene.add(shelf, Affine3A::IDENTITY, diffuse(0.5));
        let frame = scene.frame(1);
        let accel = Accel::build(&frame, None);
        let around = Neighbourhood {
            frame: &frame,
            accel: &accel,
            sampler: &Sampler::new(0, 1, [0; 2], 0, 1),
            vertex: 0,
            is_blurred,
            time: MIDDLE_TIME,
        };
        let facet = Facet::new(&frame, 0, 0, MIDDLE_TIME);
        let info = RayInfo::default();
        // Weights of the corners (1, -1, 0) and (-1, 0, 0).
        let point = facet.point(
            Vec2::new(0.5 * distance, 1.0 - distance),
            -Vec3A::Z,
            1.0,
            &info,
        );
        assert!((point.position.y + distance).abs() < 1e-6);
        around.rounded(&point, 0.2, 4096)
    }

    /// On the edge both sides count alike; beyond the radius nothing but the top does.
    #[test]
    fn an_edge_is_rounded_as_far_as_the_radius_reaches() {
        let middle = Vec3A::new(0.0, 1.0, 1.0).normalize();
        let at_edge = rounded(1e-4, false).unwrap();
        assert!(at_edge.distance(middle) < 0.02, "{at_edge}");
        let near = rounded(0.05, false).unwrap();
        assert!(near.z > middle.z + 0.05 && near.z < 0.99, "{near}");
        assert!(rounded(0.3, false).unwrap().distance(Vec3A::Z) < 1e-6);
        assert!(rounded(0.05, true).is_none());
    }
}
