use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Affine3A, Vec3};

use super::*;
use crate::contract::{Filter, Method};
use crate::math::cone::{self, tan_beta};
use crate::math::statistics::Random;
use crate::math::warp::sample_sphere;
use crate::reuse::lenders;
use crate::scene::{Light, LightKind, Reach, SceneFrame, Visibility, World};
use crate::testing::{
    Estimate, MAX_SCORE, SEEDS, Scene, Shoot, camera, cube, diffuse, glossy, glowing, image_world,
    mean_radiance, plain_world, sphere, square,
};

fn settings(method: Method) -> Settings {
    Settings {
        method,
        samples: 4,
        block: 7,
        window: 1,
        recheck: Recheck::None,
        max_bounces: 0,
        filter: Filter::Box,
        ..Settings::default()
    }
}

/// A sky that is three times as bright at the zenith as at the horizon (CIE overcast), and its
/// mirror image as ground.
fn overcast() -> World {
    image_world([64, 32], |_, y| {
        let height = ((y as f32 + 0.5) / 32.0 - 0.5) * PI;
        Vec3::splat((1.0 + 2.0 * height.sin().abs()) / 3.0)
    })
}

fn shoot<'a>(frames: &'a [Arc<SceneFrame>], settings: Settings) -> Shoot<'a> {
    Shoot {
        frames,
        settings,
        size: 32,
        threads: 1,
    }
}

/// A floor at z = 0 that fills the view.
fn floor(reflectance: f32) -> Scene {
    let mut scene = Scene::new();
    scene.camera = camera(Vec3::new(0.0, -2.0, 3.0), Vec3::ZERO, 0.5);
    scene.add(
        square(),
        Affine3A::from_scale(Vec3::splat(50.0)),
        diffuse(reflectance),
    );
    scene
}

/// A narrow street between two walls, seen from above.
fn street() -> Scene {
    let mut scene = floor(0.8);
    scene.world = overcast();
    scene.camera = camera(Vec3::new(0.0, -1.0, 4.0), Vec3::ZERO, 0.4);
    for side in [-1.0, 1.0] {
        let size = Affine3A::from_scale(Vec3::new(0.2, 20.0, 1.0));
        let place = Affine3A::from_translation(Vec3::new(side * 0.8, 0.0, 0.0));
        scene.add(cube(), place * size, diffuse(0.8));
    }
    scene
}

#[test]
fn overlaps_are_those_of_equations_2_and_3() {
    let mut random = Random::new(21);
    for _ in 0..10_000 {
        let [offset, direction] = [0; 2].map(|_| sample_sphere(random.next_2d()));
        let (distance, solid_angle) = (10.0 * random.next(), 13.0 * random.next());
        let radius = base_radius(distance, tan_beta(solid_angle));
        let own = |offset: Vec3A| overlap(offset.to_array(), direction.to_array(), radius);
        let g = cone::shift(offset, direction, distance, tan_beta(solid_angle));
        assert!((own(offset) - cone::overlap(g)).abs() < 1e-4);
        // The same from either point.
        assert_eq!(own(offset), own(-offset));
    }
    let up = [0.0, 0.0, 1.0];
    let aside = [1.0, 0.0, 0.0];
    for (offset, radius, expected) in [
        ([0.0; 3], 0.0, 1.0),
        (aside, 0.0, 0.0),
        (aside, f32::INFINITY, 1.0),
    ] {
        assert!((overlap(offset, up, radius) - expected).abs() < 1e-4);
    }
    assert_eq!(base_radius(0.0, f32::INFINITY), f32::INFINITY);
}

#[test]
fn a_white_sphere_in_a_white_world_is_invisible() {
    let mut scene = Scene::new();
    scene.camera = camera(Vec3::new(0.0, -6.0, 0.0), Vec3::ZERO, 0.5);
    scene.add(sphere(12), Affine3A::IDENTITY, diffuse(1.0));
    let frames = [scene.frame(1)];
    for pixel in shoot(&frames, settings(Method::Paper))
        .pictures(&[1])
        .concat()
    {
        assert!((pixel - 1.0).abs() < 1e-4, "{pixel}");
    }
}

#[test]
fn rechecks_darken_a_curved_surface_a_little() {
    // A direction that was copied from a facet turned another way may point into the sphere.
    let mut scene = Scene::new();
    scene.camera = camera(Vec3::new(0.0, -6.0, 0.0), Vec3::ZERO, 0.2);
    scene.add(sphere(24), Affine3A::IDENTITY, diffuse(1.0));
    let frames = [scene.frame(1)];
    for recheck in [Recheck::Lit, Recheck::All] {
        let settings = Settings {
            recheck,
            ..settings(Method::Paper)
        };
        let mean = mean_radiance(&shoot(&frames, settings).pictures(&[1])[0]);
        assert!(mean < 1.0 && mean > 0.98, "{recheck:?}: {mean}");
    }
}

#[test]
fn white_spheres_that_see_each_other_are_invisible() {
    let mut scene = Scene::new();
    scene.camera = camera(Vec3::new(0.0, -6.0, 0.0), Vec3::ZERO, 0.6);
    for x in [-1.0, 1.0] {
        let place = Affine3A::from_translation(Vec3::new(x, 0.0, 0.0));
        scene.add(sphere(12), place, diffuse(1.0));
    }
    let frames = [scene.frame(1)];
    let mut settings = settings(Method::Paper);
    (settings.max_bounces, settings.diffuse_bounces) = (200, 200);
    let furnace = shoot(&frames, settings).mean(SEEDS);
    assert!(
        (furnace.mean - 1.0).abs() < MAX_SCORE * furnace.error + 1e-5,
        "{furnace:?}"
    );
    assert!(furnace.error < 5e-3);
}

#[test]
fn an_unoccluded_plane_agrees_with_path_tracing() {
    let mut scene = floor(0.6);
    scene.world = overcast();
    let frames = [scene.frame(1)];
    let path = shoot(&frames, settings(Method::Path)).mean(SEEDS);
    for recheck in [Recheck::None, Recheck::Lit, Recheck::All] {
        let settings = Settings {
            recheck,
            ..settings(Method::Paper)
        };
        let bias = shoot(&frames, settings).mean(SEEDS).against(path);
        // 2 %: a leaf brings its mean, whatever the cosine prefers in it.
        assert!(
            bias.mean.abs() < 0.02 + MAX_SCORE * bias.error,
            "{recheck:?}: {bias:?}"
        );
    }
}

#[test]
fn a_street_is_too_bright_and_a_recheck_takes_back_a_part() {
    let frames = [street().frame(1)];
    let path = shoot(&frames, settings(Method::Path)).mean(SEEDS);
    let bias = |recheck| {
        let settings = Settings {
            recheck,
            ..settings(Method::Paper)
        };
        shoot(&frames, settings).mean(SEEDS).against(path)
    };
    let [none, lit, all] = [Recheck::None, Recheck::Lit, Recheck::All].map(bias);
    let above = |high: Estimate, low: Estimate| {
        high.mean - low.mean > MAX_SCORE * high.error.hypot(low.error)
    };
    // Testing only what found light removes light; testing all also finds some. Neither removes the
    // preference for records that found light.
    assert!(
        above(none, all) && above(all, lit),
        "{none:?} {all:?} {lit:?}"
    );
    assert!(lit.mean > MAX_SCORE * lit.error, "{lit:?}");
}

#[test]
fn a_sun_is_each_pixels_own() {
    let mut scene = floor(0.5);
    scene.world = plain_world(0.0);
    scene.lights.push(Light {
        kind: LightKind::Sun { angle: 0.0 },
        key: 1,
        world_from_light: Affine3A::from_rotation_x(0.6),
        power: Vec3A::splat(3.0),
        scale: Vec3A::ONE,
        material: None,
        reach: Reach {
            visibility: Visibility::from_bits(0b1_1110),
            ..Reach::ALL
        },
    });
    let frames = [scene.frame(1)];
    let expected = 0.5 / PI * 3.0 * 0.6f32.cos();
    let picture = &shoot(&frames, settings(Method::Paper)).pictures(&[1])[0];
    for pixel in picture.as_chunks::<4>().0 {
        assert!((pixel[0] / expected - 1.0).abs() < 1e-4, "{}", pixel[0]);
    }
}

#[test]
fn the_sun_of_an_image_is_counted_once() {
    let mut scene = floor(0.5);
    scene.world = image_world([512, 256], |x, y| {
        Vec3::splat(if (x, y) == (200, 200) { 30000.0 } else { 1.0 })
    });
    let frames = [scene.frame(1)];
    let [path, paper] =
        [Method::Path, Method::Paper].map(|m| shoot(&frames, settings(m)).mean(SEEDS));
    let bias = paper.against(path);
    assert!(bias.mean.abs() < 0.005 + MAX_SCORE * bias.error, "{bias:?}");
    assert!(bias.error < 0.01);
}

#[test]
fn other_surfaces_lend_nothing_but_other_frames_do() {
    let scene = floor(1.0);
    let mut covered = floor(1.0);
    let lid = Affine3A::from_scale_rotation_translation(
        Vec3::splat(5.0),
        glam::Quat::IDENTITY,
        Vec3::new(0.0, 0.0, 1.0),
    );
    covered.add(square(), lid, diffuse(0.0));
    let two_frames = Settings {
        window: 2,
        ..settings(Method::Paper)
    };
    let frames = [scene.frame(1), covered.frame(2)];
    let pictures = shoot(&frames, two_frames.clone()).pictures(&[1, 2]);
    assert!((mean_radiance(&pictures[0]) - 1.0).abs() < 1e-4);
    assert_eq!(mean_radiance(&pictures[1]), 0.0);
    // A grey floor in the second frame: copied F mix, half and half.
    let frames = [scene.frame(1), floor(0.5).frame(2)];
    let mixed = mean_radiance(&shoot(&frames, two_frames).pictures(&[1])[0]);
    assert!((mixed - 0.75).abs() < 0.01, "{mixed}");
}

#[test]
fn surfaces_that_are_turned_lend_nothing() {
    // A white floor on the left meets a black wall on the right in the middle of the picture.
    let mut scene = Scene::new();
    scene.camera = camera(Vec3::new(-4.0, 0.0, 4.0), Vec3::ZERO, 0.2);
    let wall = Affine3A::from_rotation_y(-0.5 * PI);
    scene.add(
        square(),
        Affine3A::from_translation(Vec3::NEG_X),
        diffuse(1.0),
    );
    scene.add(
        square(),
        wall * Affine3A::from_translation(Vec3::X),
        diffuse(0.0),
    );
    let frames = [scene.frame(1)];
    let picture = &shoot(&frames, settings(Method::Paper)).pictures(&[1])[0];
    // The camera looks along +X and down: the floor is in the lower half, the wall in the upper.
    let (floor, wall) = picture.split_at(picture.len() / 2);
    assert!(mean_radiance(floor) > 0.4, "{}", mean_radiance(floor));
    assert_eq!(mean_radiance(wall), 0.0);
}

#[test]
fn a_glowing_surface_over_a_glossy_floor_agrees_with_path_tracing() {
    let mut scene = floor(0.0);
    scene.world = plain_world(0.0);
    let cover = Affine3A::from_translation(Vec3::new(0.0, 0.0, 0.001));
    let wide = Affine3A::from_scale(Vec3::splat(9.0));
    scene.add(square(), cover * wide, glossy(0.8, 0.3));
    let lamp = Affine3A::from_translation(Vec3::new(0.0, 1.5, 1.0));
    scene.add(
        cube(),
        lamp * Affine3A::from_scale(Vec3::splat(0.3)),
        glowing(2.0),
    );
    let frames = [scene.frame(1)];
    let [path, paper] =
        [Method::Path, Method::Paper].map(|m| shoot(&frames, settings(m)).mean(SEEDS));
    let bias = paper.against(path);
    assert!(bias.mean.abs() < MAX_SCORE * bias.error, "{bias:?}");
    assert!(path.mean > 0.05 && bias.error < 0.02, "{path:?} {bias:?}");
}

#[test]
fn threads_and_ranges_change_no_bit() {
    let frames: Vec<_> = (1..=4)
        .map(|number| {
            let mut scene = street();
            let x = 0.1 * number as f32;
            scene.camera = camera(Vec3::new(x, -1.0, 4.0), Vec3::ZERO, 0.4);
            scene.frame(number)
        })
        .collect();
    let run = |targets: &[i32], threads| {
        let settings = Settings {
            window: 2,
            recheck: Recheck::All,
            max_bounces: 2,
            ..settings(Method::Paper)
        };
        let shoot = Shoot {
            threads,
            ..shoot(&frames, settings)
        };
        shoot.pictures(targets)
    };
    let whole = run(&[1, 2, 3, 4], 1);
    assert!(whole.iter().all(|picture| mean_radiance(picture) > 0.05));
    assert_eq!(whole, run(&[1, 2, 3, 4], 3));
    assert_eq!(whole[1..3], run(&[2, 3], 2));
    assert_eq!(whole[3..], run(&[4], 1));
}

#[test]
fn blocks_are_disjoint_and_follow_from_the_frame() {
    let settings = Settings {
        window: 3,
        ..settings(Method::Paper)
    };
    let block = |frame, step| lenders(&settings, frame, step);
    for frame in 1..=3 {
        assert_eq!(block(frame, 1), [1, 2, 3]);
    }
    assert_eq!(block(0, 1), [-2, -1, 0]);
    assert_eq!(block(9, 2), [7, 9, 11]);
    assert_eq!(block(4, 2), [2, 4, 6]);
}
