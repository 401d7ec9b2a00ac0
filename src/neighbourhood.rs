//! What lies around a point of a surface, for programs that ask.

use glam::Vec3A;

use crate::accel::{Accel, Hit};
use crate::math::warp::sample_cosine_hemisphere;
use crate::math::{Frame, Ray};
use crate::sampling::Sampler;
use crate::scene::SceneFrame;
use crate::shader::{Around, Point, RayKind};
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
    fn openness(&self, point: &Point, normal: Vec3A, distance: f32, count: u32) -> f32 {
        let first = self.sampler.around(self.vertex);
        let about = Frame::from_normal(normal);
        let is_open = |i: &u32| {
            let u = [0, 1].map(|axis| (first[axis] + *i as f32 * STEPS[axis]).fract());
            let direction = about.to_world(sample_cosine_hemisphere(u));
            let ray = Ray {
                t_max: distance,
                ..ray_off(point, direction).at_time(self.time)
            };
            // Whatever stops light counts, be it transparent.
            let stops = |hit: &Hit| {
                let instance = &self.frame.instances[hit.instance as usize];
                instance.visibility.includes(RayKind::Shadow)
            };
            !self.accel.occluded_where(self.frame, &ray, stops)
        };
        (0..count).filter(is_open).count() as f32 / count as f32
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
    fn openness(side: f32, roof: Visibility) -> f32 {
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
            around.openness(&point, side * Vec3A::Z, 2.0, 16)
        };
        (0..64).map(open).sum::<f32>() / 64.0
    }

    /// Directions whose cosine is less than half pass below the roof's reach: a quarter by cosine.
    /// The tolerance is three standard deviations of 1024 independent directions.
    #[test]
    fn a_roof_closes_what_it_is_near_to() {
        let open = openness(1.0, Visibility::ALL);
        assert!((open - 0.25).abs() < 0.04, "{open}");
        assert_eq!(openness(-1.0, Visibility::ALL), 1.0);
        let unseen = Visibility::ALL.without(RayKind::Shadow);
        assert_eq!(openness(1.0, unseen), 1.0);
    }
}
