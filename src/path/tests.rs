use super::*;
use crate::contract::{Filter, Method};
use crate::scene::{Filling, Light, LightKind, Material, Medium, Reach};
use crate::shader::{Draft, Row};
use crate::testing::{
    Scene, Shoot, camera, cube, diffuse, glossy, glowing, mean_radiance, plain_world, square,
};
use glam::{Affine3A, Vec3};

/// A diffuse floor beside a mirror wall: without caustics the wall gives it nothing.
#[test]
fn diffuse_surfaces_get_no_caustics_when_they_are_off() {
    let mean = |caustics_reflective, reflectance| {
        let mut scene = Scene::new();
        scene.world = plain_world(1.0);
        scene.camera = camera(Vec3::new(0.0, 0.0, 1.5), Vec3::ZERO, 0.7);
        scene.add(square(), Affine3A::IDENTITY, diffuse(0.5));
        let wall = Affine3A::from_rotation_y(std::f32::consts::FRAC_PI_2);
        let wall = Affine3A::from_translation(Vec3::new(-0.6, 0.0, 0.0)) * wall;
        scene.add(square(), wall, glossy(reflectance, 0.3));
        let frames = [scene.frame(1)];
        let settings = Settings {
            method: Method::Path,
            samples: 64,
            filter: Filter::Box,
            caustics_reflective,
            ..Settings::default()
        };
        let shoot = Shoot {
            frames: &frames,
            settings,
            size: 8,
            threads: 1,
        };
        mean_radiance(&shoot.pictures(&[1])[0])
    };
    let (off, black) = (mean(false, 0.9), mean(true, 0.0));
    // The numbers choose the same directions: only rounding of the light's choice differs.
    assert!((off / black - 1.0).abs() < 0.01, "{off} {black}");
    assert!(mean(true, 0.9) > 1.05 * black);
}

fn seen(scene: &Scene) -> f64 {
    seen_after(scene, Settings::default())
}

fn seen_after(scene: &Scene, settings: Settings) -> f64 {
    mean_radiance(&picture(scene, settings))
}

fn picture(scene: &Scene, settings: Settings) -> Vec<f32> {
    let frames = [scene.frame(1)];
    let settings = Settings {
        method: Method::Path,
        samples: 256,
        filter: Filter::Box,
        ..settings
    };
    let shoot = Shoot {
        frames: &frames,
        settings,
        size: 8,
        threads: 1,
    };
    shoot.pictures(&[1]).swap_remove(0)
}

/// A cube of fog in a white world, with what its nodes say per metre.
fn fog(scatter: f32, absorption: f32, emission: f32) -> Scene {
    let coefficients = [
        ("Weight", 1.0),
        ("Scatter", scatter),
        ("Absorption", absorption),
        ("Emission", emission),
        ("Anisotropy", 0.4),
    ];
    let bare: [(&str, f32); 2] = [("Weight", 1.0), ("Color", 1.0)];
    let material = Material::of(&[("volume", &coefficients), ("transparent", &bare)]);
    let mut scene = Scene::new();
    let place = Affine3A::from_translation(Vec3::new(0.0, 4.0, 0.0));
    scene.add(
        cube(),
        place * Affine3A::from_scale(Vec3::new(9.0, 1.0, 9.0)),
        material,
    );
    scene
}

/// A slab of colour, 2 m thick, before a wall that shines: each channel falls by its own law. The
/// picture is 0.02 rad wide; five standard deviations of numbers left to themselves.
#[test]
fn each_channel_of_what_lies_behind_fog_follows_beer() {
    let absorption = Vec3A::new(0.1, 0.5, 1.0);
    let mut fog = Material::of(&[("transparent", &[("Weight", 1.0), ("Color", 1.0)])]);
    fog.medium = Some(Filling::Even(Medium {
        scattering: Vec3A::ZERO,
        absorption,
        emission: Vec3A::ZERO,
        anisotropy: 0.0,
    }));
    let mut scene = Scene::new();
    scene.world = plain_world(0.0);
    scene.camera = camera(Vec3::ZERO, Vec3::Y, 0.02);
    let place = Affine3A::from_translation(Vec3::new(0.0, 4.0, 0.0));
    scene.add(cube(), place, fog);
    let wall = Affine3A::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let wall = Affine3A::from_translation(Vec3::new(0.0, 8.0, 0.0)) * wall;
    scene.add(square(), wall, glowing(1.0));
    let picture = picture(&scene, Settings::default());
    let pixels = picture.as_chunks::<4>().0;
    for channel in 0..3 {
        let sum: f32 = pixels.iter().map(|pixel| pixel[channel]).sum();
        let mean = sum / pixels.len() as f32;
        let expected = (-2.0 * absorption[channel]).exp();
        assert!(
            (mean - expected).abs() < 0.03,
            "{channel}: {mean} {expected}"
        );
    }
}

/// What only scatters is not seen in a white world, whatever the way of the light.
#[test]
fn fog_that_does_not_absorb_is_white_in_a_white_world() {
    let settings = Settings {
        max_bounces: 1024,
        volume_bounces: 1024,
        transparent_max_bounces: 1024,
        ..Settings::default()
    };
    let radiance = seen_after(&fog(1.5, 0.0, 0.0), settings);
    assert!((radiance - 1.0).abs() < 5e-3, "{radiance}");
}

/// The same cube with fog that is 1.5 / m thick times what a noise says, up to seven times that.
fn uneven_fog() -> Scene {
    let rows: &[Row] = &[
        ("coordinate", &[], 1),
        // Three dimensions, FBM, normalised, Fac.
        (
            "noise",
            &[0, -1, -2, -2, -3, -2, -1, -1, -1],
            2 + 4 * (3 + 5),
        ),
        ("multiply", &[1, -4], 0),
        ("multiply", &[2, 1], 0),
        ("volume", &[-5, 3, -1, -1, -3], 0),
        ("transparent", &[-5, -5], 0),
    ];
    let constants = [[0.0; 3], [2.0; 3], [0.5; 3], [10.0; 3], [1.0; 3]];
    let mut scene = Scene::new();
    let place = Affine3A::from_translation(Vec3::new(0.0, 4.0, 0.0));
    scene.add(
        cube(),
        place * Affine3A::from_scale(Vec3::new(9.0, 1.0, 9.0)),
        Material::new(&Draft::of(rows, &constants).unwrap()),
    );
    scene
}

#[test]
fn uneven_fog_that_does_not_absorb_is_white_in_a_white_world() {
    let settings = Settings {
        max_bounces: 1024,
        volume_bounces: 1024,
        transparent_max_bounces: 1024,
        ..Settings::default()
    };
    let radiance = seen_after(&uneven_fog(), settings);
    assert!((radiance - 1.0).abs() < 5e-3, "{radiance}");
}

#[test]
fn uneven_fog_is_the_same_for_any_number_of_threads() {
    let frames = [uneven_fog().frame(1)];
    for method in [Method::Path, Method::DualCone] {
        let pictures = |threads| {
            let settings = Settings {
                method,
                samples: 4,
                window: 1,
                volume_bounces: 2,
                ..Settings::default()
            };
            let shoot = Shoot {
                frames: &frames,
                settings,
                size: 16,
                threads,
            };
            shoot.pictures(&[1])
        };
        assert_eq!(pictures(1), pictures(3));
    }
}

/// Along a ray of slope `1 / cos` the way through the slab, 2 m thick, is `2 / cos`.
#[test]
fn fog_that_does_not_scatter_follows_beer() {
    let radiance = seen_after(&fog(0.0, 0.3, 0.6), Settings::default());
    let open = (-0.6f64).exp();
    let expected = open + 2.0 * (1.0 - open);
    // The picture is 0.7 rad wide: ways are up to 1.13 times longer at its corners.
    assert!(
        (radiance / expected - 1.0).abs() < 0.03,
        "{radiance} {expected}"
    );
    assert!(radiance > expected, "the ways are longer");
}

/// The share that comes through and what a sheet shines add up, in a white world. The chance to
/// pass is stratified over 16384 samples: five standard deviations of one left to itself.
#[test]
fn a_sheet_shows_what_it_lets_pass_and_what_it_shines() {
    let cases: [(&[(&str, f32)], f64); 3] = [
        (&[("transparent", 0.25)], 0.25),
        (&[("transparent", 0.25), ("emission", 3.0)], 3.25),
        (&[("transparent", 1.0), ("emission", 3.0)], 4.0),
    ];
    for (closures, expected) in cases {
        let inputs = closures
            .iter()
            .map(|(_, c)| [("Weight", 1.0), ("Color", *c)]);
        let inputs: Vec<_> = inputs.collect();
        let named = closures.iter().zip(&inputs);
        let named: Vec<_> = named
            .map(|((name, _), inputs)| (*name, &inputs[..]))
            .collect();
        let mut scene = Scene::new();
        scene.camera = camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, 0.7);
        scene.add(square(), Affine3A::IDENTITY, Material::of(&named));
        let mean = seen(&scene);
        let deviation = 5.0 * 3.0 * 0.5 / 16384f64.sqrt();
        assert!((mean - expected).abs() < deviation, "{closures:?}: {mean}");
    }
}

/// Sheets that let half of the light pass and shine by one, above a white floor in a white world.
fn below_sheets(count: usize, limit: u32) -> f64 {
    let sheet: [(&str, &[(&str, f32)]); 2] = [
        ("transparent", &[("Weight", 1.0), ("Color", 0.5)]),
        ("emission", &[("Weight", 1.0), ("Color", 1.0)]),
    ];
    let mut scene = Scene::new();
    scene.camera = camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, 0.1);
    scene.add(square(), Affine3A::IDENTITY, diffuse(1.0));
    for layer in 1..=count {
        let up = Affine3A::from_translation(0.01 * layer as f32 * Vec3::Z);
        scene.add(square(), up, Material::of(&sheet));
    }
    seen_after(
        &scene,
        Settings {
            transparent_max_bounces: limit,
            ..Settings::default()
        },
    )
}

/// Closed forms: what the camera's ray passes, what the floor's rays pass on, and that the surface
/// after the last one allowed shines and does nothing else.
#[test]
fn a_path_passes_no_more_surfaces_than_it_may() {
    // The floor is white: it shows the sheets' glow from below, and the world if rays may pass them.
    let cases = [
        (4, 2, 1.0 + 0.5 + 0.25),
        (2, 2, 1.0 + 0.5),
        (1, 2, 1.0 + 0.5 * (1.0 + 0.5)),
        (2, 3, 1.0 + 0.5 + 0.25 * (1.0 + 0.5)),
        (2, 4, 1.0 + 0.5 + 0.25 * (1.0 + 0.5 + 0.25)),
        (1, 0, 1.0),
    ];
    for (count, limit, expected) in cases {
        let mean = below_sheets(count, limit);
        // A sample is at most four; 16384 of them.
        let deviation = 5.0 * 2.0 / 16384f64.sqrt();
        assert!(
            (mean - expected).abs() < deviation,
            "{count} sheets, {limit}: {mean}"
        );
    }
}

/// A sun above a sheet: shadows take the share itself and no chance.
#[test]
fn a_shadow_is_as_deep_as_its_sheet() {
    let floor_lit_through = |color: f32, has_transparent_shadow: bool| {
        let mut scene = Scene::new();
        scene.world = plain_world(0.0);
        scene.camera = camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, 0.7);
        scene.lights.push(Light {
            kind: LightKind::Sun { angle: 0.0 },
            key: 1,
            world_from_light: Affine3A::IDENTITY,
            power: Vec3A::ONE,
            scale: Vec3A::ONE,
            material: None,
            reach: Reach::ALL,
        });
        scene.add(square(), Affine3A::IDENTITY, diffuse(0.5));
        let sheet = Material::of(&[("transparent", &[("Weight", 1.0), ("Color", color)])]);
        let above = Affine3A::from_translation(2.0 * Vec3::Z);
        let sheet = Material {
            has_transparent_shadow,
            ..sheet
        };
        scene.add(square(), above, sheet);
        seen(&scene)
    };
    let share = floor_lit_through(0.3, true) / floor_lit_through(1.0, true);
    assert!((share - 0.3).abs() < 1e-4, "{share}");
    assert_eq!(floor_lit_through(0.3, false), 0.0);
}

/// Fog that loses nothing fills a room whose walls shine: wherever light was scattered, it began with the
/// radiance of the walls. Light of rays and light of samples must add up wherever fog is near a wall.
#[test]
fn light_of_walls_is_the_same_everywhere_in_fog() {
    let mut scene = Scene::new();
    scene.world = plain_world(0.0);
    scene.medium = Some(Filling::Even(Medium {
        scattering: Vec3A::splat(0.6),
        absorption: Vec3A::ZERO,
        emission: Vec3A::ZERO,
        anisotropy: 0.3,
    }));
    let room = Affine3A::from_scale(Vec3::splat(4.0));
    scene.add(cube(), room, glowing(1.0));
    let settings = Settings {
        max_bounces: 64,
        volume_bounces: 64,
        ..Settings::default()
    };
    let mean = seen_after(&scene, settings);
    assert!((mean - 1.0).abs() < 1e-3, "{mean}");
}

/// A floor close below a panel that shines, and both a kilometre from the origin, where floats are
/// coarse: rays from the one must not end on the panel itself.
#[test]
fn panels_light_what_is_near_them_anywhere() {
    let seen_at = |place: Vec3| {
        let mut scene = Scene::new();
        scene.world = plain_world(0.0);
        let tilt = Affine3A::from_translation(place) * Affine3A::from_rotation_x(0.7);
        let at = |height| tilt * Affine3A::from_translation(Vec3::new(0.0, 0.0, height));
        let eye = tilt.transform_point3(Vec3::new(0.0, -3.0, 0.4));
        scene.camera = camera(eye, place, 0.1);
        let floor = at(0.0) * Affine3A::from_scale(Vec3::splat(0.5));
        scene.add(square(), floor, diffuse(0.5));
        scene.add(square(), at(0.5), glowing(1.0));
        seen(&scene)
    };
    let near = seen_at(Vec3::ZERO);
    let far = seen_at(Vec3::new(300.0, -500.0, 1000.0));
    // Rays begin and end up to 1.5 cm off their surfaces there.
    assert!((far / near - 1.0).abs() < 0.03, "{far} {near}");
}

/// A lamp in fog and nothing else: the fog shows it.
#[test]
fn fog_is_seen_where_there_is_nothing_else() {
    let mut scene = Scene::new();
    scene.world = plain_world(0.0);
    let (scattering, distance, power) = (0.1, 5.0, 40.0);
    scene.medium = Some(Filling::Even(Medium {
        scattering: Vec3A::splat(scattering),
        absorption: Vec3A::ZERO,
        emission: Vec3A::ZERO,
        anisotropy: 0.0,
    }));
    scene.camera = camera(Vec3::ZERO, Vec3::Y, 0.02);
    scene.lights.push(Light {
        kind: LightKind::Point {
            radius: 0.0,
            soft_falloff: false,
        },
        key: 1,
        world_from_light: Affine3A::from_translation(Vec3::new(1.0, distance, 0.0)),
        power: Vec3A::splat(power),
        scale: Vec3A::ONE,
        material: None,
        reach: Reach::ALL,
    });
    let settings = Settings {
        volume_bounces: 0,
        ..Settings::default()
    };
    // Radiant intensity over the squared distance, scattered evenly, along the ray.
    let steps = (0..200_000).map(|i| (f64::from(i) + 0.5) * 1e-3);
    let light = steps.map(|t| {
        let squared = (t - f64::from(distance)).powi(2) + 1.0;
        (-f64::from(scattering) * (t + squared.sqrt())).exp() / squared * 1e-3
    });
    let scale = f64::from(scattering * power) / (4.0 * std::f64::consts::PI).powi(2);
    let expected = scale * light.sum::<f64>();
    let mean = seen_after(&scene, settings);
    assert!((mean / expected - 1.0).abs() < 0.05, "{mean} {expected}");
}
