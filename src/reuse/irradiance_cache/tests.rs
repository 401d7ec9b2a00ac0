//! The method in whole scenes: tests.rs of `reuse` asks for energy and for equal bits.

use glam::Affine3A;

use crate::contract::{Method, Settings};
use crate::testing::{Scene, Shoot, diffuse, square};

/// A floor under an even sky has its albedo times the sky, without any noise.
#[test]
fn an_open_floor_is_exact() {
    let mut scene = Scene::new();
    scene.camera = crate::testing::camera(glam::Vec3::new(0.0, -3.0, 3.0), glam::Vec3::ZERO, 0.5);
    let place = Affine3A::from_scale(glam::Vec3::splat(50.0));
    scene.add(square(), place, diffuse(0.5));
    let frames = [scene.frame(1)];
    let settings = Settings {
        method: Method::IrradianceCache,
        samples: 2,
        ..Settings::default()
    };
    let mut shoot = Shoot {
        frames: &frames,
        settings,
        size: 16,
        threads: 2,
    };
    let lit = shoot.mean(4);
    // Light samples and gathers are joined by weights that differ from ray to ray: a little noise.
    assert!((lit.mean - 0.5).abs() < 4.0 * lit.error + 1e-3, "{lit:?}");
    assert!(lit.error < 5e-3, "{lit:?}");
}
