//! Motion blur: closed forms of what moves, and the same light by every method.

use std::sync::Arc;

use glam::{Affine3A, Vec3};

use crate::contract::{Filter, Given, Method, Numbers, Settings};
use crate::scene::{CameraMotion, Mesh, SceneFrame, Shutter, Trajectory};
use crate::testing::{
    Estimate, MAX_SCORE, SEEDS, Scene, Shoot, camera, cube, diffuse, glowing, mean_radiance, mesh,
    plain_world, sphere, square,
};

/// Pixels a side.
const SIZE: usize = 24;
/// Half the side of what the camera of [`board`] sees [m].
const HALF_VIEW: f32 = 2.0;

fn settings(method: Method, samples: u32) -> Settings {
    Settings {
        method,
        samples,
        filter: Filter::Box,
        ..Settings::default()
    }
}

fn shoot(frames: &[Arc<SceneFrame>], settings: Settings) -> Shoot<'_> {
    Shoot {
        frames,
        settings,
        size: SIZE,
        threads: 1,
    }
}

fn shift(x: f32) -> Affine3A {
    Affine3A::from_translation(Vec3::new(x, 0.0, 0.0))
}

/// A glowing square of side 2 before nothing, seen from straight above.
fn board() -> Scene {
    let mut scene = Scene::new();
    scene.world = plain_world(0.0);
    scene.camera = camera(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 2.0 * 0.4f32.atan());
    scene.add(square(), Affine3A::IDENTITY, glowing(1.0));
    scene
}

/// Mean of each column of the picture.
fn columns(frame: &Arc<SceneFrame>) -> Vec<f64> {
    let frames = [frame.clone()];
    let picture = shoot(&frames, settings(Method::Path, 256))
        .pictures(&[1])
        .remove(0);
    let at = |x: usize, y: usize| f64::from(picture[4 * (y * SIZE + x)]);
    (0..SIZE)
        .map(|x| (0..SIZE).map(|y| at(x, y)).sum::<f64>() / SIZE as f64)
        .collect()
}

/// What the columns of the board show while the square moves evenly from x = `from` to `to`: the
/// share of time that it covers each place, averaged over the column. Half of the rows see it.
fn swept(from: f32, to: f32) -> Vec<f64> {
    const FINE: usize = 100;
    let covered = |x: f32| {
        let is_there = |i: &usize| {
            let middle = from + (to - from) * (*i as f32 + 0.5) / 1000.0;
            (x - middle).abs() < 1.0
        };
        (0..1000).filter(is_there).count() as f64 / 1000.0
    };
    (0..SIZE)
        .map(|column| {
            let place = |i: usize| (column as f32 + (i as f32 + 0.5) / FINE as f32) / SIZE as f32;
            let sum: f64 = (0..FINE)
                .map(|i| covered(HALF_VIEW * (2.0 * place(i) - 1.0)))
                .sum();
            0.5 * sum / FINE as f64
        })
        .collect()
}

/// 256 stratified samples of 24 pixels leave a standard error below 0.002; 5 of them.
fn assert_shows(scene: &Scene, expected: &[f64], what: &str) {
    for (x, (shown, expected)) in columns(&scene.frame(1)).iter().zip(expected).enumerate() {
        let off = (shown - expected).abs();
        assert!(off < 0.01, "{what}, column {x}: {shown} {expected}");
    }
}

#[test]
fn a_moving_square_is_as_bright_as_the_time_it_covers() {
    let mut scene = board();
    scene.instances[0].motion = Trajectory::new(&[shift(-0.8), shift(0.0), shift(0.8)]);
    assert_shows(&scene, &swept(-0.8, 0.8), "even");
    assert!(swept(0.0, 0.0) != swept(-0.8, 0.8));

    // Two steps of different speed: half of the time each.
    scene.instances[0].motion = Trajectory::new(&[shift(-0.8), shift(0.6), shift(0.8)]);
    let (fast, slow) = (swept(-0.8, 0.6), swept(0.6, 0.8));
    let mean: Vec<f64> = fast.iter().zip(&slow).map(|(a, b)| 0.5 * (a + b)).collect();
    assert_shows(&scene, &mean, "two speeds");
}

#[test]
fn the_shutter_curve_weighs_times() {
    let mut scene = board();
    scene.instances[0].motion = Trajectory::new(&[shift(-0.8), shift(0.8)]);
    scene.shutter.curve = vec![1.0, 0.0];
    assert_shows(&scene, &swept(-0.8, 0.0), "closes half-way");
    scene.shutter.curve = vec![0.0, 0.0, 1.0, 3.0];
    let (third, fourth) = (swept(0.0, 0.4), swept(0.4, 0.8));
    let mixed: Vec<f64> = third
        .iter()
        .zip(&fourth)
        .map(|(a, b)| 0.25 * a + 0.75 * b)
        .collect();
    assert_shows(&scene, &mixed, "opens late");
}

#[test]
fn a_camera_that_moves_shows_what_moves_the_other_way() {
    let mut scene = board();
    let place = |x: f32| Affine3A::from_translation(Vec3::new(x, 0.0, 5.0));
    let camera = CameraMotion::new(&[place(0.8), place(-0.8)], vec![]).unwrap();
    scene.shutter = Shutter {
        camera: Some(camera),
        ..Shutter::default()
    };
    assert_shows(&scene, &swept(-0.8, 0.8), "camera");
}

/// The square whose vertices move.
fn sliding(positions: [f32; 2]) -> Mesh {
    let still = square();
    let at = |x: f32| {
        still
            .vertices
            .iter()
            .map(move |v| *v + Vec3::new(x, 0.0, 0.0))
    };
    let numbers: Vec<f32> = positions
        .into_iter()
        .flat_map(at)
        .flat_map(|v| v.to_array())
        .collect();
    let given = Given {
        name: "motion_vertices".into(),
        shape: vec![2, still.vertices.len(), 3],
        numbers: Numbers::F32(&numbers),
    };
    still.moving(vec![given]).unwrap()
}

#[test]
fn vertices_that_move_blur_as_an_object_does() {
    let mut scene = board();
    scene.instances.clear();
    scene.add(sliding([-0.8, 0.8]), Affine3A::IDENTITY, glowing(1.0));
    // The instance shows the second mesh and material of the board.
    assert_shows(&scene, &swept(-0.8, 0.8), "vertices");
}

/// The edge of a half plane turns by a quarter: the share of time that it covers a place grows evenly
/// with the angle. Places near the middle, where pixels see many angles, are left out.
#[test]
fn a_turning_edge_leaves_an_even_fan() {
    let mut scene = board();
    let quarter = std::f32::consts::FRAC_PI_2;
    // It turns about its origin, which therefore stays; its far corners never come into view.
    let corners = [[0.0, -9.0], [9.0, -9.0], [9.0, 9.0], [0.0, 9.0]];
    let corners = corners.map(|[x, y]| Vec3::new(x, y, 0.0));
    scene.instances.clear();
    let half_plane = mesh(&corners, &[[0, 1, 2], [0, 2, 3]]);
    scene.add(half_plane, Affine3A::IDENTITY, glowing(1.0));
    let ends = [0.0, quarter].map(Affine3A::from_rotation_z);
    scene.instances[0].motion = Trajectory::new(&ends);
    let frames = [scene.frame(1)];
    let picture = shoot(&frames, settings(Method::Path, 256))
        .pictures(&[1])
        .remove(0);
    let (mut compared, mut sum) = (0, 0.0);
    for (i, pixel) in picture.as_chunks::<4>().0.iter().enumerate() {
        let place = |p: usize| (p as f32 + 0.5) / SIZE as f32 * 2.0 - 1.0;
        let (x, y) = (place(i % SIZE), place(i / SIZE));
        let angle = y.atan2(x);
        let from_kink = (angle / quarter - (angle / quarter).round()).abs();
        if x.hypot(y) < 0.5 || from_kink < 0.1 {
            continue;
        }
        // Covered while the turned normal is within a quarter of the place's direction.
        let [from, to] = [angle - quarter, angle + quarter].map(|a| (a / quarter).clamp(0.0, 1.0));
        let off = pixel[0] - (to - from);
        // A standard error of at most a half over 16.
        assert!(off.abs() < 0.1, "{x} {y}: {} {}", pixel[0], to - from);
        (sum, compared) = (sum + off, compared + 1);
    }
    assert!(compared > 200, "{compared}");
    assert!((sum / compared as f32).abs() < 0.005, "{sum} {compared}");
}

/// A cube that flies and a ball that spins and swells over a floor, under a sky with a wall, by a
/// camera that pans: everything moves.
fn fair(number: i32) -> Arc<SceneFrame> {
    let mut scene = Scene::new();
    scene.world = plain_world(1.0);
    let frame = |time: f32| number as f32 + 0.8 * (time - 0.5);
    scene.camera = camera(Vec3::new(0.0, -6.0, 3.0), Vec3::ZERO, 0.7);
    scene.add(
        square(),
        Affine3A::from_scale(Vec3::splat(8.0)),
        diffuse(0.6),
    );
    let flight = |time: f32| {
        Affine3A::from_translation(Vec3::new(0.9 * frame(time) - 1.5, 0.4, 0.7))
            * Affine3A::from_rotation_z(0.7 * frame(time))
            * Affine3A::from_scale(Vec3::splat(0.6))
    };
    let spin = |time: f32| {
        Affine3A::from_translation(Vec3::new(0.9, -0.8, 0.6))
            * Affine3A::from_rotation_y(2.0 * frame(time))
            * Affine3A::from_scale(Vec3::new(0.6, 0.6, 0.5 + 0.1 * time))
    };
    let meshes = [cube(), sphere(8)];
    for (mesh, way) in meshes
        .into_iter()
        .zip([&flight as &dyn Fn(f32) -> Affine3A, &spin])
    {
        let instance = scene.add(mesh, way(0.5), diffuse(0.7));
        scene.instances[instance].motion = Trajectory::new(&[way(0.0), way(0.5), way(1.0)]);
    }
    let pan = |time: f32| {
        let turn = Affine3A::from_rotation_z(0.1 * (time - 0.5));
        let at = Affine3A::from_translation(Vec3::new(0.0, -6.0, 3.0));
        turn * at * Affine3A::from_rotation_x((2.0f32).atan())
    };
    let way = [pan(0.0), pan(0.5), pan(1.0)];
    scene.shutter.camera = Some(CameraMotion::new(&way, vec![]).unwrap());
    scene.frame(number)
}

/// At 16 samples the kernels have their full size; what they blur here stays below 1 %.
#[test]
fn sharing_keeps_the_energy_of_blurred_frames() {
    let frames: Vec<_> = (0..=2).map(fair).collect();
    let run = |method| shoot(&frames, settings(method, 16)).mean_of(1, SEEDS);
    let bias = run(Method::DualCone).against(run(Method::Path));
    assert!(bias.mean.abs() < 0.01 + MAX_SCORE * bias.error, "{bias:?}");
    assert!(bias.error < 0.01, "{bias:?}");
}

/// A glowing ball on its way over a floor lights it as one at rest would at each place: a picture of
/// the first half and one of the second add up.
#[test]
fn a_glowing_ball_lights_what_it_passes() {
    let at = |x: f32| {
        Affine3A::from_translation(Vec3::new(x, 0.0, 1.2)) * Affine3A::from_scale(Vec3::splat(0.5))
    };
    let lit = |from: f32, to: f32| {
        let mut scene = Scene::new();
        scene.world = plain_world(0.0);
        scene.camera = camera(Vec3::new(0.0, -4.0, 2.0), Vec3::ZERO, 0.5);
        scene.add(
            square(),
            Affine3A::from_scale(Vec3::splat(3.0)),
            diffuse(0.6),
        );
        let ball = scene.add(sphere(6), at(0.5 * (from + to)), glowing(4.0));
        scene.instances[ball].motion = Trajectory::new(&[at(from), at(to)]);
        [scene.frame(1)]
    };
    for method in [Method::Path, Method::DualCone] {
        let mut settings = settings(method, 32);
        // One bounce: what the floor gets from the ball.
        (settings.max_bounces, settings.window) = (0, 1);
        let mean = |frames: &[Arc<SceneFrame>]| shoot(frames, settings.clone()).mean(SEEDS);
        let [first, second, whole] =
            [(-1.0, 0.2), (0.2, 1.4), (-1.0, 1.4)].map(|(from, to)| mean(&lit(from, to)));
        let parts = Estimate {
            mean: 0.5 * (first.mean + second.mean),
            error: 0.5 * first.error.hypot(second.error),
        };
        let bias = whole.against(parts);
        assert!(
            bias.mean.abs() < 0.01 + MAX_SCORE * bias.error,
            "{method:?}: {bias:?}"
        );
        assert!(bias.error < 0.02, "{method:?}: {bias:?}");
    }
}

/// Mean variance of the pixels of a method's pictures, over 8 seeds.
fn variance(frames: &[Arc<SceneFrame>], method: Method) -> f64 {
    let seeded = |seed| Settings {
        seed,
        ..settings(method, 16)
    };
    let picture = |seed| shoot(frames, seeded(seed)).pictures(&[1]).remove(0);
    let pictures: Vec<Vec<f32>> = (1..=8).map(picture).collect();
    let of_pixel = |i: usize| {
        let values = || pictures.iter().map(|picture| f64::from(picture[i]));
        let mean = values().sum::<f64>() / 8.0;
        values().map(|value| (value - mean).powi(2)).sum::<f64>() / 7.0
    };
    (0..pictures[0].len()).map(of_pixel).sum::<f64>() / pictures[0].len() as f64
}

/// The ratio is 0.45 here, and 0.48 if nothing moves.
#[test]
fn sharing_blurred_frames_is_less_noisy_than_path_tracing() {
    let frames: Vec<_> = (0..=2).map(fair).collect();
    let [shared, alone] = [Method::DualCone, Method::Path].map(|m| variance(&frames, m));
    assert!(shared < 0.7 * alone, "{shared} {alone}");
}

#[test]
fn threads_and_the_split_of_a_range_change_no_bit_of_blurred_frames() {
    let frames: Vec<_> = (-2..=6).map(fair).collect();
    for method in [Method::Path, Method::DualCone, Method::Paper] {
        let together = shoot(&frames, settings(method, 4)).pictures(&[1, 2, 3]);
        let mut many = shoot(&frames, settings(method, 4));
        many.threads = 3;
        let split = [many.pictures(&[1]), many.pictures(&[2, 3])].concat();
        assert!(together == split, "{method:?}");
    }
}

#[test]
fn an_open_shutter_changes_no_bit_where_nothing_moves() {
    let mut scene = board();
    let closed = [scene.frame(1)];
    scene.shutter.curve = vec![0.2, 1.0, 0.2];
    let open = [scene.frame(1)];
    let picture = |frames| shoot(frames, settings(Method::Path, 4)).pictures(&[1]);
    assert!(picture(&closed) == picture(&open));
    assert!(mean_radiance(&picture(&open)[0]) > 0.1);
}
