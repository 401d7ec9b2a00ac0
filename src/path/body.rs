//! The body that light enters at a surface of a path.

use glam::Vec3A;

use super::{Tracer, count_ray};
use crate::accel::Hit;
use crate::math::Ray;
use crate::scene::Facet;
use crate::subsurface::{Body, Crossing};
use crate::surface::Surface;

/// The instance that a surface is part of, entered there.
pub struct Entered<'a> {
    pub tracer: &'a Tracer<'a>,
    pub surface: &'a Surface,
}

impl Entered<'_> {
    /// Normal of the front of the face that was hit.
    fn front(&self, hit: &Hit) -> Option<Vec3A> {
        let frame = self.tracer.frame;
        Facet::new(frame, hit.instance, hit.triangle, self.surface.time).front()
    }
}

impl Body for Entered<'_> {
    type Hit = Hit;

    fn position(&self) -> Vec3A {
        self.surface.position
    }

    fn geometric_normal(&self) -> Vec3A {
        self.surface.geometric_normal
    }

    fn ray_into(&self, direction: Vec3A) -> Ray {
        self.surface.ray_into(direction)
    }

    fn meet(&self, ray: &Ray) -> Option<(f32, Hit)> {
        count_ray();
        let Tracer { frame, accel, .. } = self.tracer;
        let hit = accel.closest_hit_of(frame, ray, self.surface.hit.instance)?;
        Some((hit.t, hit))
    }

    fn cross(&self, ray: &Ray) -> Vec<Crossing<Hit>> {
        count_ray();
        let Tracer { frame, accel, .. } = self.tracer;
        let Some(entry) = self.front(&self.surface.hit) else {
            return Vec::new();
        };
        let side = entry.dot(self.geometric_normal()).signum();
        let hits = accel.hits_of(frame, ray, self.surface.hit.instance);
        let crossings = hits.into_iter().filter_map(|hit| {
            let normal = side * self.front(&hit)?;
            Some(Crossing {
                t: hit.t,
                normal,
                hit,
            })
        });
        crossings.collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Vec3};

    use crate::contract::{Method, Settings};
    use crate::scene::Material;
    use crate::shader::Draft;
    use crate::testing::{Scene, Shoot, camera, diffuse, plain_world, square};

    /// Half of the light leaves, by the profile of distances.
    fn wax() -> Material {
        let inputs = &[-1, -2, -1, -3, -1, -1, -4, -4];
        let constants = [[1.0; 3], [0.5; 3], [0.3; 3], [0.0; 3]];
        Material::new(&Draft::of(&[("subsurface", inputs, 2)], &constants).unwrap())
    }

    /// A sheet over a black one that lies between it and the other half of a white world. Five standard
    /// errors, error rate 6e-7 a comparison, six comparisons.
    #[test]
    fn a_sheet_shows_its_color_on_the_side_that_is_seen() {
        for side in [1.0, -1.0] {
            for scale in [
                Vec3::ONE,
                Vec3::new(1.0, 1.0, -1.0),
                Vec3::new(-1.0, 1.0, 1.0),
            ] {
                let mut scene = Scene::new();
                scene.world = plain_world(1.0);
                scene.camera = camera(Vec3::new(0.0, 0.1, 1.5 * side), Vec3::ZERO, 0.4);
                scene.add(square(), Affine3A::from_scale(scale), wax());
                let below = Affine3A::from_translation(Vec3::new(0.0, 0.0, -0.02 * side));
                let wide = Affine3A::from_scale(Vec3::splat(4.0));
                scene.add(square(), below * wide, diffuse(0.0));
                let settings = Settings {
                    method: Method::Path,
                    samples: 16,
                    ..Settings::default()
                };
                let mut shoot = Shoot {
                    frames: &[scene.frame(1)],
                    settings,
                    size: 8,
                    threads: 1,
                };
                let seen = shoot.mean(32);
                let off = (seen.mean - 0.5).abs();
                assert!(off < 5.0 * seen.error, "{side} {scale}: {seen:?}");
                assert!(seen.error < 0.01, "{seen:?}");
            }
        }
    }
}
