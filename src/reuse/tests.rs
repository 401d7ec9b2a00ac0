//! What every method must keep: energy, and the same bits however the work is divided.

use std::sync::Arc;

use glam::{Affine3A, Mat4, Vec2, Vec3, Vec3A};

use super::*;
use crate::contract::{Filter, Recheck, Share};
use crate::scene::{
    Camera, Lens, Light, LightKind, Material, Panorama, Projection, Reach, SceneFrame, Visibility,
    World,
};
use crate::testing::{
    Estimate, MAX_SCORE, SEEDS, Scene, Shoot, any_camera, camera, cube, diffuse, glass, glossy,
    glowing, image_world, lacquer, mean_radiance, paper, plain_world, smooth, sphere, square,
};

const METHODS: [Method; 5] = [
    Method::Path,
    Method::DualCone,
    Method::Paper,
    Method::Bilateral,
    Method::IrradianceCache,
];

fn settings(method: Method) -> Settings {
    Settings {
        method,
        samples: 4,
        filter: Filter::Box,
        ..Settings::default()
    }
}

fn shoot<'a>(frames: &'a [Arc<SceneFrame>], settings: Settings) -> Shoot<'a> {
    Shoot {
        frames,
        settings,
        size: 24,
        threads: 1,
    }
}

/// A sky of this radiance, as an image: light sampling leaves a plain one to scattered rays.
fn even_sky(radiance: f32) -> World {
    image_world([16, 8], |_, _| Vec3::splat(radiance))
}

/// A cube and a ball on a floor under a sun and a sky; the ball rolls, the cube stays.
fn yard(frame: i32) -> Arc<SceneFrame> {
    let [at, target] = yard_view(frame);
    yard_seen_by(frame, camera(at, target, 0.7))
}

/// The yard under a sky that light sampling draws.
fn yard_under(sky: f32, frame: i32) -> Arc<SceneFrame> {
    let mut scene = SceneFrame::clone(&yard(frame));
    scene.world = even_sky(sky);
    Arc::new(scene)
}

/// Where the yard's camera is and what it looks at.
fn yard_view(frame: i32) -> [Vec3; 2] {
    [
        Vec3::new(0.1 * frame as f32, -5.0, 3.0),
        Vec3::new(0.0, 0.0, 0.5),
    ]
}

fn yard_seen_by(frame: i32, camera: Camera) -> Arc<SceneFrame> {
    let mut scene = Scene::new();
    scene.world = plain_world(0.4);
    scene.camera = camera;
    let floor = Affine3A::from_scale(Vec3::splat(8.0));
    scene.add(square(), floor, diffuse(0.6));
    let cube_place = Affine3A::from_translation(Vec3::new(-1.2, 0.0, 0.7));
    scene.add(
        cube(),
        cube_place * Affine3A::from_scale(Vec3::splat(0.7)),
        glossy(0.8, 0.4),
    );
    let ball_place = Affine3A::from_translation(Vec3::new(0.8 + 0.2 * frame as f32, 0.3, 0.6));
    let roll = Affine3A::from_rotation_y(0.3 * frame as f32);
    scene.add(
        sphere(8),
        ball_place * roll * Affine3A::from_scale(Vec3::splat(0.6)),
        diffuse(0.5),
    );
    scene.lights.push(Light {
        kind: LightKind::Sun { angle: 0.02 },
        key: 1,
        world_from_light: Affine3A::from_rotation_x(0.6),
        power: Vec3A::splat(2.0),
        scale: Vec3A::ONE,
        material: None,
        reach: Reach {
            visibility: Visibility::from_bits(0b1_1110),
            ..Reach::ALL
        },
    });
    scene.frame(frame)
}

/// A box with an opening, lit from outside: nearly all of its light is indirect.
fn room(frame: i32) -> Arc<SceneFrame> {
    room_of(frame, diffuse(0.7))
}

fn room_of(frame: i32, material: Material) -> Arc<SceneFrame> {
    let camera = camera(Vec3::new(0.0, -0.9, 0.0), Vec3::new(0.3, 1.0, -0.2), 1.2);
    room_seen_by(frame, camera, material)
}

fn room_seen_by(frame: i32, camera: Camera, material: Material) -> Arc<SceneFrame> {
    let mut scene = Scene::new();
    scene.camera = camera;
    let wall = |turn: Affine3A| turn * Affine3A::from_translation(Vec3::new(0.0, 0.0, -1.0));
    for turn in [
        Affine3A::IDENTITY,
        Affine3A::from_rotation_x(std::f32::consts::FRAC_PI_2),
        Affine3A::from_rotation_x(-std::f32::consts::FRAC_PI_2),
        Affine3A::from_rotation_y(std::f32::consts::FRAC_PI_2),
        Affine3A::from_rotation_x(std::f32::consts::PI),
    ] {
        scene.add(square(), wall(turn), material.clone());
    }
    scene.frame(frame)
}

/// A glass ball, a pane of rough glass and a sheet of paper on a floor, between a sun and the camera.
fn glasshouse(frame: i32) -> Arc<SceneFrame> {
    let mut scene = Scene::new();
    scene.world = plain_world(0.4);
    let [at, target] = yard_view(frame);
    scene.camera = camera(at, target, 0.7);
    let floor = Affine3A::from_scale(Vec3::splat(8.0));
    scene.add(square(), floor, diffuse(0.6));
    let ball = Affine3A::from_translation(Vec3::new(0.8, 0.3, 0.6));
    scene.add(
        sphere(16),
        ball * Affine3A::from_scale(Vec3::splat(0.6)),
        glass(0.1),
    );
    let upright = Affine3A::from_rotation_x(1.4) * Affine3A::from_scale(Vec3::splat(0.5));
    for (x, material) in [(-1.2, glass(0.5)), (-0.1, paper())] {
        let place = Affine3A::from_translation(Vec3::new(x, 0.2, 0.6));
        scene.add(square(), place * upright, material);
    }
    scene.lights.push(Light {
        kind: LightKind::Sun { angle: 0.3 },
        key: 1,
        world_from_light: Affine3A::from_rotation_x(-0.8),
        power: Vec3A::splat(2.0),
        scale: Vec3A::ONE,
        material: None,
        reach: Reach {
            visibility: Visibility::from_bits(0b1_1110),
            ..Reach::ALL
        },
    });
    scene.frame(frame)
}

#[test]
fn white_spheres_in_a_white_world_are_invisible() {
    let mut scene = Scene::new();
    scene.camera = camera(Vec3::new(0.0, -6.0, 0.0), Vec3::ZERO, 0.6);
    for x in [-1.0, 1.0] {
        let place = Affine3A::from_translation(Vec3::new(x, 0.0, 0.0));
        scene.add(sphere(24), place, diffuse(1.0));
    }
    let frames = [
        scene.frame(0),
        scene.frame(1),
        scene.frame(2),
        scene.frame(3),
    ];
    for method in METHODS {
        let settings = Settings {
            max_bounces: 200,
            diffuse_bounces: 200,
            // A recheck finds that directions copied from a turned facet point into the sphere.
            recheck: Recheck::None,
            ..settings(method)
        };
        let mut shoot = shoot(&frames, settings);
        let furnace = shoot.mean_of(1, SEEDS);
        // The limit on a record's cosine costs light where neighbours are turned, here by 7.5
        // degrees: without the share of hemispheres in the weights it would be 0.3 %.
        let bias = match method {
            Method::DualCone => 1.5e-3,
            // Where its records lie depends on what they saw.
            Method::IrradianceCache => 3e-3,
            _ => 1e-5,
        };
        assert!(
            (furnace.mean - 1.0).abs() < MAX_SCORE * furnace.error + bias,
            "{method:?}: {furnace:?}"
        );
        assert!(furnace.error < 5e-3, "{method:?}: {furnace:?}");
    }
}

#[test]
fn white_glass_and_white_paper_in_a_white_world_are_invisible() {
    let mut scene = Scene::new();
    scene.camera = camera(Vec3::new(0.0, -6.0, 0.0), Vec3::ZERO, 0.6);
    for (x, material) in [(-1.0, glass(0.2)), (1.0, paper())] {
        let place = Affine3A::from_translation(Vec3::new(x, 0.0, 0.0));
        scene.add(sphere(24), place, material);
    }
    let frames = [scene.frame(0), scene.frame(1), scene.frame(2)];
    for method in [Method::Path, Method::DualCone] {
        let settings = Settings {
            max_bounces: 400,
            diffuse_bounces: 400,
            glossy_bounces: 400,
            transmission_bounces: 400,
            ..settings(method)
        };
        let furnace = shoot(&frames, settings).mean_of(1, SEEDS);
        // Microfacets that send light to the wrong side of a facet lose some.
        assert!(
            (furnace.mean - 1.0).abs() < MAX_SCORE * furnace.error + 5e-3,
            "{method:?}: {furnace:?}"
        );
        assert!(furnace.error < 5e-3, "{method:?}: {furnace:?}");
    }
}

#[test]
fn threads_and_the_split_of_a_range_change_no_bit() {
    let frames: Vec<_> = (-3..=9).map(yard).collect();
    for method in METHODS {
        let together = shoot(&frames, settings(method)).pictures(&[1, 2, 3, 4]);
        let mut many = shoot(&frames, settings(method));
        many.threads = 3;
        assert!(
            together == many.pictures(&[1, 2, 3, 4]),
            "{method:?}: threads"
        );
        let split = [&[1, 2][..], &[3], &[4]]
            .map(|part| many.pictures(part))
            .concat();
        assert!(together == split, "{method:?}: split");
        let other_seed = Settings {
            seed: 1,
            ..settings(method)
        };
        let others = shoot(&frames, other_seed).pictures(&[1, 2, 3, 4]);
        assert!(together != others, "{method:?}: seed");
    }
}

/// The passes Combined and Borrowing of each target, and the number of rays.
fn borrowing(shoot: &Shoot, targets: &[i32]) -> (Vec<[Vec<f32>; 2]>, u64) {
    let progress = Progress::default();
    let rendered = crate::render::render(&shoot.job(targets), &progress).unwrap();
    let passes = |rendered: &crate::render::Rendered| {
        ["Combined", "Borrowing"].map(|name| {
            let pass = rendered.passes.iter().find(|pass| pass.0 == name);
            pass.unwrap().1.clone()
        })
    };
    (rendered.iter().map(passes).collect(), progress.rays())
}

/// Once frames have chosen from where they borrow, samples that nobody reads are left out. Those that
/// only another frame of the range reads must not show.
#[test]
fn what_is_left_out_changes_no_bit() {
    let frames: Vec<_> = (0..=4).map(|frame| yard_under(0.4, frame)).collect();
    let mut shoot = shoot(&frames, settings(Method::DualCone));
    shoot.settings.samples = 6;
    // Nothing but the window lends, so that it is worth its cost in places.
    shoot.settings.block = 1;
    shoot.size = 64;
    let (together, _) = borrowing(&shoot, &[1, 2, 3]);
    let (first, one_frame) = borrowing(&shoot, &[1]);
    let (rest, _) = borrowing(&shoot, &[2, 3]);
    assert!(together == [first, rest].concat());
    let (from, pixels) = (&together[0][1], together[0][1].len() as f32);
    let share = |way: f32| from.iter().filter(|&&from| from == way).count() as f32 / pixels;
    assert!(share(1.0) > 0.1 && share(1.0) < 0.9, "{}", share(1.0));
    shoot.settings.window = 1;
    let (_, alone) = borrowing(&shoot, &[1]);
    let ratio = one_frame as f32 / alone as f32;
    assert!(ratio > 1.1 && ratio < 2.2, "{ratio}");
}

/// Pixels that borrow nothing are what path tracing makes of them, not path tracing without its light
/// samples of the sky. What they are from the ninth sample on follows from the first eight: any noise is
/// below a threshold of one, so that a frame ends there.
#[test]
fn a_pixel_that_borrows_nothing_is_path_tracing() {
    let frames: Vec<_> = (0..=2).map(|frame| yard_under(0.02, frame)).collect();
    let mut shoot = shoot(&frames, settings(Method::DualCone));
    // Russian roulette, which comes later, counts in what the pixel does with what it lends.
    shoot.settings.max_bounces = 2;
    shoot.size = 64;
    shoot.settings.samples = 16;
    let mut sums = |method, seed, samples: u8| {
        shoot.settings.method = method;
        shoot.settings.seed = seed;
        shoot.settings.noise_threshold = if samples < 16 { 1.0 } else { 0.0 };
        let (mut passes, _) = borrowing(&shoot, &[1]);
        let [combined, from] = passes.remove(0);
        let sums = combined.into_iter().map(|mean| mean * f32::from(samples));
        (sums.collect::<Vec<_>>(), from)
    };
    let mut count = 0;
    for seed in 0..6 {
        let (before, from) = sums(Method::DualCone, seed, 8);
        let (all, _) = sums(Method::DualCone, seed, 16);
        let path = [8, 16].map(|samples| sums(Method::Path, seed, samples).0);
        let alone = (0..from.len()).filter(|&pixel| from[pixel] == 0.0);
        for at in alone.map(|pixel| 4 * pixel) {
            let (ours, theirs) = (all[at] - before[at], path[1][at] - path[0][at]);
            assert!(
                (ours - theirs).abs() < 1e-4 * (1.0 + theirs),
                "{ours}, {theirs}"
            );
            count += 1;
        }
    }
    assert!(count > 200, "{count}");
}

/// Light that the camera sees, light that is sampled, found right away and found later: each brings a
/// pixel at most its limit.
#[test]
fn limits_hold_for_all_light_of_a_pixel() {
    const LIMIT: f32 = 0.01;
    let frames: Vec<_> = (0..=2).map(|frame| yard_under(0.4, frame)).collect();
    let mut shoot = shoot(&frames, settings(Method::Path));
    shoot.settings.clamp_direct = LIMIT;
    shoot.settings.clamp_indirect = LIMIT;
    let (mut passes, _) = borrowing(&shoot, &[1]);
    let [combined, _] = passes.remove(0);
    let mut brightest = 0f32;
    for [red, green, blue, _] in combined.as_chunks().0 {
        brightest = brightest.max((red + green + blue) / 3.0);
    }
    assert!(
        brightest > 0.5 * LIMIT && brightest < 4.0 * LIMIT,
        "{brightest}"
    );
}

/// By how much sharing changes the light of frame 1. In the two pilot iterations every pixel borrows,
/// whether that pays or not, and the kernels are at their widest; so there are many pictures of them.
fn energy_bias(frames: &[Arc<SceneFrame>], film_transparent: bool, pictures: u32) -> Estimate {
    let run = |method| {
        let settings = Settings {
            samples: 2,
            film_transparent,
            ..settings(method)
        };
        shoot(frames, settings).mean_of(1, pictures)
    };
    run(Method::DualCone).against(run(Method::Path))
}

/// What the kernels blur here stays below 1 %.
#[test]
fn sharing_keeps_the_energy_of_path_tracing() {
    let yards: Vec<_> = (0..=2).map(yard).collect();
    let rooms: Vec<_> = (0..=2).map(room).collect();
    let glazed: Vec<_> = (0..=2).map(glasshouse).collect();
    for (name, frames) in [
        ("yard", &yards[..]),
        ("room", &rooms[..]),
        ("glasshouse", &glazed[..]),
    ] {
        let bias = energy_bias(frames, false, 8 * SEEDS);
        assert!(
            bias.mean.abs() < 0.01 + MAX_SCORE * bias.error,
            "{name}: {bias:?}"
        );
        assert!(bias.error < 0.01, "{name}: {bias:?}");
    }
}

/// A cube that turns by a radian a frame: its sides see another part of an uneven sky each time.
#[test]
fn an_object_that_turns_far_keeps_its_light() {
    let turning = |number: i32| {
        let mut scene = Scene::new();
        scene.world = image_world([8, 4], |column, _| Vec3::splat(0.1 + column as f32 / 4.0));
        scene.camera = camera(Vec3::new(0.0, -5.0, 2.0), Vec3::ZERO, 0.6);
        let turn = Affine3A::from_rotation_z(number as f32);
        scene.add(cube(), turn, diffuse(0.8));
        scene.frame(number)
    };
    let frames: Vec<_> = (0..=2).map(turning).collect();
    let bias = energy_bias(&frames, true, 8 * SEEDS);
    assert!(bias.mean.abs() < 0.003 + MAX_SCORE * bias.error, "{bias:?}");
    assert!(bias.error < 0.002, "{bias:?}");
}

/// A coarse ball with smooth normals: neighbours in one triangle gather over turned hemispheres, which
/// their triangle does not tell.
#[test]
fn coarse_smooth_balls_keep_their_energy() {
    let mut scene = Scene::new();
    scene.world = plain_world(0.4);
    scene.camera = camera(Vec3::new(0.0, -4.0, 2.0), Vec3::ZERO, 0.7);
    scene.add(smooth(sphere(3)), Affine3A::IDENTITY, diffuse(0.8));
    let frames = [scene.frame(0), scene.frame(1), scene.frame(2)];
    let bias = energy_bias(&frames, true, 24 * SEEDS);
    assert!(bias.mean.abs() < 2e-3 + MAX_SCORE * bias.error, "{bias:?}");
    assert!(bias.error < 2e-3, "{bias:?}");
}

/// Black tiles look for no light: were that lent as darkness, white tiles beside them would be darker.
#[test]
fn what_is_black_lends_no_darkness() {
    let mut scene = Scene::new();
    scene.world = plain_world(0.4);
    scene.camera = camera(Vec3::new(0.0, -3.0, 4.0), Vec3::ZERO, 0.7);
    for column in 0..12_i16 {
        let place = Vec3::new(f32::from(column) * 0.4 - 2.2, 0.0, 0.0);
        let stripe = Affine3A::from_scale_rotation_translation(
            Vec3::new(0.2, 3.0, 1.0),
            glam::Quat::IDENTITY,
            place,
        );
        let white = f32::from(column % 2);
        scene.add(square(), stripe, diffuse(0.8 * white));
    }
    let frames = [scene.frame(0), scene.frame(1), scene.frame(2)];
    let bias = energy_bias(&frames, true, 8 * SEEDS);
    assert!(bias.mean.abs() < 2e-3 + MAX_SCORE * bias.error, "{bias:?}");
    assert!(bias.error < 2e-3, "{bias:?}");
}

/// Yards seen by a lens with a wide aperture, along an axis, and all around.
fn yards_by_other_cameras() -> Vec<(&'static str, Vec<Arc<SceneFrame>>)> {
    let wide = Lens {
        radius: 0.3,
        focus_distance: 4.0,
        blades: 5,
        ..Lens::PINHOLE
    };
    let scale = 0.4;
    let along = Mat4::from_cols_array_2d(&[
        [scale, 0.0, 0.0, 0.0],
        [0.0, scale, 0.0, 0.0],
        [0.0, 0.0, -0.02, 0.0],
        [0.0, 0.0, -1.0, 1.0],
    ]);
    let perspective = Mat4::from_cols_array_2d(&[
        [2.7, 0.0, 0.0, 0.0],
        [0.0, 2.7, 0.0, 0.0],
        [0.0, 0.0, -1.0, -1.0],
        [0.0, 0.0, -0.02, 0.0],
    ]);
    let around = Panorama::FisheyeEquidistant { field_of_view: 3.0 };
    let cameras = [
        (
            "aperture",
            Projection::from_matrix(perspective).unwrap(),
            wide,
        ),
        (
            "axis",
            Projection::from_matrix(along).unwrap(),
            Lens::PINHOLE,
        ),
        (
            "fisheye",
            Projection::Panorama(around, Vec2::ZERO),
            Lens::PINHOLE,
        ),
    ];
    let frames = |projection, lens| {
        let frame = |number| {
            let [at, target] = yard_view(number);
            yard_seen_by(number, any_camera(at, target, projection, lens))
        };
        (0..=2).map(frame).collect()
    };
    cameras
        .map(|(name, projection, lens)| (name, frames(projection, lens)))
        .into()
}

/// Blocks are placed through the middle of the aperture and with the size of a sharp pixel: where
/// neighbours lie apart fewer lend, and the energy stays.
#[test]
fn sharing_keeps_the_energy_behind_every_camera() {
    for (name, frames) in yards_by_other_cameras() {
        let bias = energy_bias(&frames, false, 8 * SEEDS);
        assert!(
            bias.mean.abs() < 0.01 + MAX_SCORE * bias.error,
            "{name}: {bias:?}"
        );
        assert!(bias.error < 0.01, "{name}: {bias:?}");
    }
}

/// The rivals of the chart are biased, but not so far that they would be no rivals.
#[test]
fn rivals_light_a_room_as_path_tracing_does() {
    let room = [room(1)];
    let run = |method| shoot(&room, settings(method)).mean_of(1, SEEDS);
    let path = run(Method::Path);
    for method in [Method::Bilateral, Method::IrradianceCache] {
        let rival = run(method);
        let bias = rival.against(path);
        assert!(
            bias.mean.abs() < 0.03 + MAX_SCORE * bias.error,
            "{method:?}: {bias:?}"
        );
        assert!(bias.error < 0.02, "{method:?}: {bias:?}");
    }
}

/// Splitting costs no energy, and where light makes the noise it pays: eight gathers take away
/// most of it.
#[test]
fn gathers_of_one_camera_ray_are_as_good_as_samples() {
    let room = [room(1)];
    let split = |gathers| {
        let settings = Settings {
            gathers,
            samples: 2,
            ..settings(Method::Path)
        };
        shoot(&room, settings).mean_of(1, SEEDS)
    };
    let (one, eight) = (split(1), split(8));
    let bias = eight.against(one);
    assert!(bias.mean.abs() < MAX_SCORE * bias.error, "{bias:?}");
    assert!(eight.error < 0.6 * one.error, "{one:?} {eight:?}");
}

/// Sharing must pay where it is meant to: the pictures of two seeds differ less.
#[test]
fn a_room_is_less_noisy_with_sharing() {
    let ratio = noise_ratio(&[room(1)]);
    assert!(ratio < 0.25, "{ratio}");
}

/// Squared noise of sharing within a frame over that of path tracing, from two seeds.
fn noise_ratio(frames: &[Arc<SceneFrame>; 1]) -> f64 {
    let noise = |method| {
        let settings = |seed| Settings {
            window: 1,
            seed,
            ..settings(method)
        };
        let [a, b] = [1, 2].map(|seed| shoot(frames, settings(seed)).pictures(&[1]).concat());
        let squares = a.iter().zip(&b).map(|(a, b)| f64::from(a - b).powi(2));
        squares.sum::<f64>()
    };
    noise(Method::DualCone) / noise(Method::Path)
}

/// Were the light that lacquer reflects about the mirror direction each pixel's own, the ratio would be
/// twice as large.
#[test]
fn wide_gloss_is_shared_and_keeps_its_energy() {
    let room = [room_of(1, lacquer(0.7, 0.35))];
    let ratio = noise_ratio(&room);
    assert!(ratio < 0.15, "{ratio}");
    let run = |method| {
        let settings = Settings {
            samples: 16,
            window: 1,
            ..settings(method)
        };
        shoot(&room, settings).mean_of(1, SEEDS)
    };
    let bias = run(Method::DualCone).against(run(Method::Path));
    let bound = 0.01 + MAX_SCORE * bias.error;
    assert!(bias.mean.abs() < bound, "{bias:?}");
    assert!(bias.error < 0.01, "{bias:?}");
}

/// What a denoiser needs: sharing between frames alone takes noise away, and leaves none that
/// neighbours have in common, in frames that stand still and in frames that move.
#[test]
fn sharing_between_frames_leaves_neighbours_independent() {
    let still: Vec<_> = (0..=2).map(room).collect();
    let look = |frame: i32| Vec3::new(0.3 + 0.02 * frame as f32, 1.0, -0.2);
    let turned = |frame| camera(Vec3::new(0.0, -0.9, 0.0), look(frame), 1.2);
    let moving: Vec<_> = (0..=2)
        .map(|frame| room_seen_by(frame, turned(frame), diffuse(0.7)))
        .collect();
    for (name, frames) in [("still", &still), ("moving", &moving)] {
        let path = noise_and_likeness(frames, Method::Path, Share::Frames);
        let ours = noise_and_likeness(frames, Method::DualCone, Share::Frames);
        let blocks = noise_and_likeness(frames, Method::DualCone, Share::All);
        let ratio = ours[0] / path[0];
        assert!(ratio < 0.6, "{name}: {ratio}");
        // Of 552 pairs each of 8 seeds: 0.02 by chance where noise is even, twice that where not.
        assert!(ours[1].abs() < 0.15, "{name}: {ours:?} {path:?}");
        assert!(blocks[1] > 2.0 * ours[1].abs(), "{name}: {blocks:?}");
    }
}

/// The variance of a frame's pixels, and the correlation of neighbours' errors along rows.
fn noise_and_likeness(frames: &[Arc<SceneFrame>], method: Method, share: Share) -> [f64; 2] {
    let picture = |seed| {
        let settings = Settings {
            seed,
            share,
            window: 3,
            ..settings(method)
        };
        let pixels = shoot(frames, settings).pictures(&[1]).concat();
        pixels
            .chunks_exact(4)
            .map(|p| f64::from(p[1]))
            .collect::<Vec<_>>()
    };
    let pictures: Vec<Vec<f64>> = (0..8).map(picture).collect();
    let mean = |i: usize| pictures.iter().map(|p| p[i]).sum::<f64>() / 8.0;
    let means: Vec<f64> = (0..pictures[0].len()).map(mean).collect();
    let (mut squares, mut products) = (0.0, 0.0);
    for picture in &pictures {
        let errors: Vec<f64> = picture.iter().zip(&means).map(|(p, m)| p - m).collect();
        for pair in errors.chunks_exact(24).flat_map(|row| row.windows(2)) {
            squares += 0.5 * (pair[0] * pair[0] + pair[1] * pair[1]);
            products += pair[0] * pair[1];
        }
    }
    [squares, products / squares]
}

/// Error against samples, in a room where a block is a sixth of the picture. With a bias that stays,
/// the slope from 128 to 512 samples was -0.2 and the error above that of path tracing. The scatter
/// of two pictures of 576 pixels makes that of the slope 0.07: an honest -0.75 fails once in 2000
/// times.
#[test]
fn the_error_of_sharing_goes_on_falling() {
    let room = [room(1)];
    let picture = |method, samples, seed| {
        let settings = Settings {
            samples,
            window: 1,
            seed,
            ..settings(method)
        };
        shoot(&room, settings).pictures(&[1]).concat()
    };
    let squares = |a: &[f32], b: &[f32]| -> f64 {
        let differences = a.iter().zip(b).map(|(a, b)| f64::from(a - b));
        differences.map(|difference| difference * difference).sum()
    };
    let clean = [100, 101].map(|seed| picture(Method::Path, 1024, seed));
    let truth: Vec<f32> = clean[0]
        .iter()
        .zip(&clean[1])
        .map(|(a, b)| 0.5 * (a + b))
        .collect();
    let truth_error = squares(&clean[0], &clean[1]) / 4.0;
    let error = |method, samples| {
        let errors = [0, 1].map(|seed| squares(&picture(method, samples, seed), &truth));
        0.5 * (errors[0] + errors[1]) - truth_error
    };
    let [early, late] = [128, 512].map(|samples| error(Method::DualCone, samples));
    let slope = (late / early).ln() / 4_f64.ln();
    assert!(slope < -0.5, "{slope}");
    let ratio = late / error(Method::Path, 512);
    assert!(ratio < 0.9, "{ratio}");
    // To stop by what was seen must not prefer dark or bright samples.
    let energy = mean_radiance(&picture(Method::DualCone, 512, 0)) / mean_radiance(&truth);
    assert!((energy - 1.0).abs() < 0.01, "{energy}");
}

/// A mirror beside a floor throws the only light that gather rays find there. What is borrowed would
/// depend on the block.
#[test]
fn what_a_mirror_throws_stays_with_the_pixel_that_found_it() {
    let mut scene = Scene::new();
    scene.world = plain_world(0.0);
    scene.camera = camera(Vec3::new(0.0, -4.0, 2.0), Vec3::ZERO, 0.7);
    let floor = Affine3A::from_scale(Vec3::splat(3.0));
    scene.add(square(), floor, diffuse(0.6));
    let beside = Affine3A::from_translation(Vec3::new(0.8, 0.5, 0.7));
    let mirror = beside * Affine3A::from_scale(Vec3::splat(0.6));
    scene.add(cube(), mirror, glossy(0.9, 0.3));
    scene.lights.push(Light {
        kind: LightKind::Sun { angle: 0.3 },
        key: 1,
        world_from_light: Affine3A::from_rotation_x(0.8),
        power: Vec3A::splat(2.0),
        scale: Vec3A::ONE,
        material: None,
        reach: Reach::ALL,
    });
    let frames: Vec<_> = (0..=2).map(|number| scene.frame(number)).collect();
    let picture = |block, max_bounces| {
        let settings = Settings {
            block,
            max_bounces,
            ..settings(Method::DualCone)
        };
        shoot(&frames, settings).pictures(&[1]).concat()
    };
    assert_eq!(picture(3, 4), picture(9, 4));
    assert_ne!(picture(3, 4), picture(3, 0), "the mirror throws nothing");
}

#[test]
fn a_glowing_ball_lights_a_floor_alike_in_every_method() {
    let mut scene = Scene::new();
    scene.world = plain_world(0.0);
    scene.camera = camera(Vec3::new(0.0, -4.0, 2.0), Vec3::ZERO, 0.5);
    scene.add(
        square(),
        Affine3A::from_scale(Vec3::splat(3.0)),
        diffuse(0.6),
    );
    let place = Affine3A::from_translation(Vec3::new(0.0, 0.0, 1.5));
    scene.add(
        sphere(6),
        place * Affine3A::from_scale(Vec3::splat(0.3)),
        glowing(4.0),
    );
    let frames: Vec<_> = (0..=3).map(|number| scene.frame(number)).collect();
    let path = shoot(&frames, settings(Method::Path)).mean_of(1, SEEDS);
    for method in [Method::DualCone, Method::Paper] {
        let bias = shoot(&frames, settings(method))
            .mean_of(1, SEEDS)
            .against(path);
        assert!(
            bias.mean.abs() < 0.01 + MAX_SCORE * bias.error,
            "{method:?}: {bias:?}"
        );
    }
}

#[test]
fn lenders_follow_from_the_frame_alone() {
    let with = |method, window| Settings {
        method,
        window,
        ..Settings::default()
    };
    assert_eq!(lenders(&with(Method::Path, 5), 7, 1), [7]);
    assert_eq!(lenders(&with(Method::DualCone, 3), 7, 2), [5, 7, 9]);
    assert_eq!(lenders(&with(Method::DualCone, 4), 7, 1), [5, 6, 7, 8]);
    for frame in 4..=6 {
        assert_eq!(lenders(&with(Method::Paper, 3), frame, 1), [4, 5, 6]);
    }
    assert_eq!(lenders(&with(Method::Paper, 2), -1, 2), [-3, -1]);
    assert_eq!(lenders(&with(Method::Paper, 2), 2, 2), [2, 4]);
    let both = window_frames(&with(Method::DualCone, 3), &[2, 3], 1);
    assert_eq!(both, [1, 2, 3, 4]);
}

#[test]
fn a_time_limit_ends_early_with_a_picture() {
    let frames = [yard(1)];
    let settings = Settings {
        samples: 60_000,
        time_limit: 0.02,
        ..settings(Method::Path)
    };
    let picture = shoot(&frames, settings).pictures(&[1]).concat();
    assert!(picture.iter().all(|value| value.is_finite()));
    assert!(picture.iter().sum::<f32>() > 0.0);
}

/// What lies behind a cut changes no bit before it; without the cut it does.
#[test]
fn a_cut_ends_the_window() {
    let settings = settings(Method::DualCone);
    let after = |is_cut: bool, sky: f32| {
        let mut next = Arc::into_inner(yard(2)).unwrap();
        next.world = plain_world(sky);
        if is_cut {
            next.camera = camera(Vec3::new(4.0, 1.0, 3.0), Vec3::ZERO, 0.7);
        }
        let frames = [yard(0), yard(1), Arc::new(next)];
        shoot(&frames, settings.clone()).pictures(&[1])
    };
    assert!(after(true, 0.1) == after(true, 2.0));
    assert!(after(false, 0.1) != after(false, 2.0));
}

/// The noise that ends a frame is the true one: the error that a picture of as many samples has
/// against a clean one, within a fifth (its own scatter over 576 pixels is a tenth). Each frame ends
/// by itself, whatever range it is rendered in.
#[test]
fn a_noise_threshold_ends_a_frame_when_it_says() {
    let frames: Vec<_> = (0..=3).map(yard).collect();
    let limited = |targets: &[i32]| {
        let settings = Settings {
            samples: 4096,
            noise_threshold: 0.05,
            ..settings(Method::DualCone)
        };
        let job = shoot(&frames, settings).job(targets);
        crate::render::render(&job, &Progress::default()).unwrap()
    };
    let both = limited(&[1, 2]);
    let single = limited(&[2]);
    let combined = |rendered: &crate::render::Rendered| {
        let pass = rendered.passes.iter().find(|pass| pass.0 == "Combined");
        pass.unwrap().1.clone()
    };
    assert!(combined(&both[1]) == combined(&single[0]));
    let report = single[0].report;
    assert!((8..2048).contains(&report.samples), "{report:?}");
    let clean = Settings {
        samples: 2048,
        seed: 1,
        ..settings(Method::DualCone)
    };
    let clean = shoot(&frames, clean).pictures(&[2]).concat();
    let picture = combined(&single[0]);
    let errors = picture.as_chunks::<4>().0.iter().zip(clean.as_chunks().0);
    let luminance = |p: &[f32; 4]| f64::from(crate::math::luminance(Vec3A::new(p[0], p[1], p[2])));
    let relative =
        errors.map(|(a, b)| (luminance(a) - luminance(b)).powi(2) / (luminance(b).powi(2) + 0.01));
    let noise = (relative.sum::<f64>() / 576.0).sqrt();
    let told = f64::from(report.noise.unwrap());
    assert!(
        told <= 0.05 && (noise / told - 1.0).abs() < 0.2,
        "{noise}, told {told}"
    );
}

#[test]
fn a_frame_whose_scene_is_missing_is_named() {
    let frames = [yard(1), yard(2)];
    let job = shoot(&frames, settings(Method::DualCone)).job(&[2]);
    let error = crate::render::render(&job, &Progress::default());
    let message = error.err().map(|error| error.to_string());
    assert_eq!(
        message.as_deref(),
        Some("frame 3: the frames around it need its scene")
    );
}

#[test]
fn a_cancelled_render_ends_without_a_picture() {
    let frames = [yard(1)];
    let settings = Settings {
        samples: 60_000,
        ..settings(Method::Path)
    };
    let job = shoot(&frames, settings).job(&[1]);
    let progress = Progress::default();
    std::thread::scope(|scope| {
        let render = scope.spawn(|| crate::render::render(&job, &progress));
        while progress.rays() == 0 {
            std::thread::yield_now();
        }
        progress.cancel();
        assert_eq!(render.join().unwrap().err(), Some(Error::Cancelled));
    });
}

/// What rays see, by every method, where one knows the answer.
mod visibility {
    use std::f32::consts::PI;

    use glam::{Affine3A, Vec3, Vec3A};

    use crate::contract::Filter;
    use crate::reuse::*;
    use crate::scene::{Light, LightKind, Material, Reach, Visibility};
    use crate::testing::{Scene, Shoot, camera, diffuse, plain_world, square};

    const METHODS: [Method; 3] = [Method::Path, Method::DualCone, Method::Paper];
    const REFLECTANCE: f32 = 0.5;
    /// What the floor reflects under the sun of [`sunny_floor`].
    const LIT: f32 = REFLECTANCE / PI * 3.0;

    fn all_but(kind: RayKind) -> Visibility {
        Visibility::from_bits(!(1 << kind as u32))
    }

    /// A floor that fills the view, in a black world, under a sun in the zenith.
    fn sunny_floor() -> Scene {
        let mut scene = Scene::new();
        scene.world = plain_world(0.0);
        scene.camera = camera(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, 0.5);
        let place = Affine3A::from_scale(Vec3::splat(9.0));
        scene.add(square(), place, diffuse(REFLECTANCE));
        scene.lights.push(Light {
            kind: LightKind::Sun { angle: 0.0 },
            key: 1,
            world_from_light: Affine3A::IDENTITY,
            power: Vec3A::splat(3.0),
            scale: Vec3A::ONE,
            material: None,
            reach: Reach::ALL,
        });
        scene
    }

    /// The same with a black roof at this height.
    fn roofed(height: f32, visibility: Visibility) -> Scene {
        let mut scene = sunny_floor();
        let up = Affine3A::from_translation(Vec3::new(0.0, 0.0, height));
        let roof = up * Affine3A::from_scale(Vec3::splat(9.0));
        let roof = scene.add(square(), roof, diffuse(0.0));
        scene.instances[roof].visibility = visibility;
        scene
    }

    /// Mean of all pixels: red, green, blue, alpha.
    fn mean(scene: &Scene, method: Method) -> [f32; 4] {
        mean_with(scene, method, Settings::default())
    }

    fn mean_with(scene: &Scene, method: Method, settings: Settings) -> [f32; 4] {
        let frames = [scene.frame(1)];
        let settings = Settings {
            method,
            samples: 4,
            filter: Filter::Box,
            film_transparent: true,
            window: 1,
            ..settings
        };
        let shoot = Shoot {
            frames: &frames,
            settings,
            size: 8,
            threads: 1,
        };
        let picture = &shoot.pictures(&[1])[0];
        let pixels = picture.as_chunks::<4>().0;
        let sum = |channel: usize| pixels.iter().map(|p| p[channel]).sum::<f32>();
        [0, 1, 2, 3].map(|channel| sum(channel) / pixels.len() as f32)
    }

    #[track_caller]
    fn assert_shows(scene: &Scene, expected: f32) {
        for method in METHODS {
            let [red, .., alpha] = mean(scene, method);
            assert!(
                (red - expected).abs() < 1e-3 * LIT,
                "{method:?}: {red}, {expected}"
            );
            assert_eq!(alpha, 1.0);
        }
    }

    #[test]
    fn a_roof_shades_unless_shadow_rays_do_not_see_it() {
        assert_shows(&roofed(4.0, Visibility::ALL), 0.0);
        assert_shows(&roofed(4.0, all_but(RayKind::Shadow)), LIT);
        assert_shows(&roofed(4.0, all_but(RayKind::Camera)), 0.0);
    }

    #[test]
    fn the_camera_looks_through_what_it_does_not_see() {
        let both = Visibility::from_bits(0b0_1110);
        assert_shows(&roofed(1.0, both), LIT);
        assert_shows(&roofed(1.0, all_but(RayKind::Shadow)), 0.0);
    }

    #[test]
    fn a_lamp_without_shadows_shines_through_roofs() {
        let mut scene = roofed(4.0, Visibility::ALL);
        scene.lights[0].reach.visibility = all_but(RayKind::Shadow);
        assert_shows(&scene, LIT);
    }

    #[test]
    fn lights_stay_dark_for_the_closures_that_do_not_see_them() {
        for (kind, expected) in [(RayKind::Diffuse, 0.0), (RayKind::Glossy, LIT)] {
            let mut scene = sunny_floor();
            scene.lights[0].reach.visibility = all_but(kind);
            assert_shows(&scene, expected);
            let mut scene = sunny_floor();
            scene.lights.clear();
            scene.world = plain_world(LIT / REFLECTANCE);
            scene.world.reach.visibility = all_but(kind);
            for method in METHODS {
                let red = mean(&scene, method)[0];
                assert!((red - expected).abs() < 0.1 * LIT, "{method:?}: {red}");
            }
        }
    }

    /// Panes that send all light on, over nothing.
    #[test]
    fn clear_glass_is_as_transparent_as_the_film() {
        let panes = |roughness: f32| {
            let mut scene = Scene::new();
            scene.world = plain_world(1.0);
            scene.camera = camera(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, 0.5);
            let inputs = [
                ("Weight", 1.0),
                ("Color", 1.0),
                ("IOR", 1.3),
                ("Roughness", roughness),
            ];
            let glass = Material::of(&[("refraction", &inputs)]);
            scene.add(square(), Affine3A::from_scale(Vec3::splat(9.0)), glass);
            scene
        };
        for method in METHODS {
            for (roughness, film_transparent_glass, alpha) in [
                (0.0, true, 0.0),
                (0.05, true, 0.0),
                (0.0, false, 1.0),
                (0.2, true, 1.0),
            ] {
                let settings = Settings {
                    film_transparent_glass,
                    ..Settings::default()
                };
                let [red, .., seen] = mean_with(&panes(roughness), method, settings);
                let is_off = (red - alpha).abs().max((seen - alpha).abs()) > 0.01;
                assert!(!is_off, "{method:?} {roughness}: {red} {seen}");
            }
        }
    }

    #[test]
    fn a_holdout_is_a_hole() {
        let mut scene = sunny_floor();
        scene.instances[0].is_holdout = true;
        for method in METHODS {
            assert_eq!(mean(&scene, method), [0.0; 4]);
        }
    }
}
