//! What lies around a point of a surface, for programs that ask.

use glam::Vec3A;

use crate::accel::{Accel, Hit};
use crate::math::warp::sample_cosine_hemisphere;
use crate::math::{Frame, Ray};
use crate::sampling::Sampler;
use crate::scene::SceneFrame;
use crate::shader::{Around, Point, RayKind, Search};
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
}

impl Neighbourhood<'_> {
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
    use crate::scene::{Facet, Visibility};
    use crate::shader::RayInfo;
    use crate::testing::{Scene, diffuse, square};
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
                sampler: &Sampler::new(0, 1, 0, iteration),
                vertex: 0,
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
}
