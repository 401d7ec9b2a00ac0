use std::f32::consts::PI;

use glam::{Affine3A, EulerRot, Mat3A, Quat, Vec2, Vec3};

use super::*;
use crate::contract::{Given, Numbers};
use crate::math::MIDDLE_TIME;
use crate::math::statistics::{DirectionTest, MAX_SCORE, Random, chi_square_score};
use crate::scene::{
    ForPasses, Instance, Links, Material, Membership, Mesh, Placement, Shutter, Visibility,
};
use crate::shader::{Draft, ObjectInfo};
use crate::testing::image_world;

mod many;
mod meshes;

fn plain_world(radiance: f32) -> World {
    World {
        radiance: Vec3A::splat(radiance),
        image: None,
        camera_image: None,
        environment_from_world: Mat3A::IDENTITY,
        reach: Reach::ALL,
    }
}

/// The same from all sides, as an image.
fn even_world(radiance: f32) -> World {
    image_world([16, 8], |_, _| Vec3::splat(radiance))
}

/// A point at the frame's own time.
fn receiver_at(point: Vec3A, normal: Vec3A) -> Receiver {
    Receiver {
        point,
        normal,
        time: MIDDLE_TIME,
    }
}

fn frame_of(lights: Vec<Light>, world: World) -> SceneFrame {
    SceneFrame {
        frame: 1,
        meshes: vec![],
        instances: vec![],
        materials: vec![],
        images: vec![],
        lights,
        camera: crate::testing::camera(Vec3::ZERO, Vec3::Y, 1.0),
        shutter: Shutter::default(),
        medium: None,
        passes: ForPasses::default(),
        world,
    }
}

fn lamp_at(kind: LightKind, position: Vec3, turn: Quat) -> Light {
    Light {
        kind,
        key: 0,
        world_from_light: Affine3A::from_rotation_translation(turn, position),
        power: Vec3A::new(80.0, 100.0, 120.0),
        scale: Vec3A::ONE,
        material: None,
        reach: Reach::ALL,
    }
}

/// A lamp two metres above the origin, shining down.
fn lamp_above(kind: LightKind) -> Light {
    lamp_at(kind, Vec3::new(0.0, 0.0, 2.0), Quat::IDENTITY)
}

fn sampler(lights: Vec<Light>) -> LightSampler {
    LightSampler::build(&frame_of(lights, plain_world(0.0)), None)
}

fn point_lamp(radius: f32, soft_falloff: bool) -> LightKind {
    LightKind::Point {
        radius,
        soft_falloff,
    }
}

fn spot(radius: f32, soft_falloff: bool, blend: f32) -> LightKind {
    LightKind::Spot {
        radius,
        soft_falloff,
        cone_angle: 1.0,
        blend,
    }
}

/// An instance of these triangles, whose materials have these emissions.
fn glowing(
    vertices: &[f32],
    triangles: &[u32],
    slots: &[u32],
    radiances: &[f32],
    placement: Affine3A,
) -> SceneFrame {
    let given = |name: &str, shape: &[usize], numbers| Given {
        name: name.into(),
        shape: shape.into(),
        numbers,
    };
    let count = slots.len();
    let (normals, uvs) = (vec![0.0; 9 * count], vec![0.0; 6 * count]);
    let mesh = Mesh::new(vec![
        given("vertices", &[vertices.len() / 3, 3], Numbers::F32(vertices)),
        given("triangles", &[count, 3], Numbers::U32(triangles)),
        given("corner_normals", &[count, 3, 3], Numbers::F32(&normals)),
        given("corner_uvs", &[count, 3, 2], Numbers::F32(&uvs)),
        given("layer_keys", &[0], Numbers::U32(&[])),
        given("layer_values", &[0, count, 3, 4], Numbers::F32(&[])),
        given("material_slots", &[count], Numbers::U32(slots)),
    ]);
    let material =
        |&radiance| Material::of(&[("emission", &[("Weight", 0.5), ("Color", radiance)])]);
    let instance = Instance {
        mesh: 0,
        key: 0,
        placement: Placement::new(placement),
        motion: None,
        info: ObjectInfo::default(),
        materials: (0..radiances.len() as u32).collect(),
        visibility: Visibility::ALL,
        lift_cosine: 0.0,
        is_holdout: false,
        is_catcher: false,
        membership: Membership::ALL,
        links: Links::default(),
    };
    let mut frame = frame_of(vec![], plain_world(0.0));
    frame.meshes = vec![Arc::new(mesh.unwrap())];
    frame.materials = radiances.iter().map(material).collect();
    frame.instances = vec![instance];
    frame
}

/// Two glowing triangles and a dark one: the square of half edge 1 two metres up, shining down and
/// up, in an instance that is half as wide as long.
fn glowing_square() -> SceneFrame {
    let vertices = [
        -1., -1., 0., 1., -1., 0., 1., 1., 0., -1., 1., 0., 5., 5., 5f32,
    ];
    let triangles = [0, 1, 2, 2, 3, 4, 0, 2, 3u32];
    let scale = Vec3::new(0.5, 1.0, 1.0);
    let placement =
        Affine3A::from_scale_rotation_translation(scale, Quat::IDENTITY, Vec3::new(0.0, 0.0, 2.0));
    glowing(&vertices, &triangles, &[1, 0, 7], &[0.0, 10.0], placement)
}

fn numbers(random: &mut Random) -> LightUse {
    LightUse {
        choice: random.next(),
        inside: random.next(),
        direction: random.next_2d(),
    }
}

/// One sample of all lights.
fn draw(
    lights: &LightSampler,
    point: Vec3A,
    normal: Vec3A,
    random: &mut Random,
) -> Option<LightSample> {
    lights.sample(
        &receiver_at(point, normal),
        Strategy::One,
        &numbers(random),
        || [0.5; 2],
    )[0]
}

/// Irradiance by light sampling at a receiver, green, and its standard deviation.
fn irradiance(
    lights: &LightSampler,
    point: Vec3A,
    normal: Vec3A,
    strategy: Strategy,
) -> (f32, f32) {
    let mut random = Random::new(11);
    let samples = 200_000;
    let (mut sum, mut squares) = (0.0f64, 0.0f64);
    for _ in 0..samples {
        let numbers = numbers(&mut random);
        let drawn = lights.sample(&receiver_at(point, normal), strategy, &numbers, || {
            random.next_2d()
        });
        let value = |light: LightSample| {
            let cos = light.direction.dot(normal).max(0.0);
            f64::from(lights.radiance(&light).y * cos / light.pdf_solid_angle)
        };
        let value: f64 = drawn.into_iter().flatten().map(value).sum();
        sum += value;
        squares += value * value;
    }
    let mean = sum / f64::from(samples);
    let variance = (squares / f64::from(samples) - mean * mean).max(0.0);
    (mean as f32, (variance / f64::from(samples)).sqrt() as f32)
}

/// Five standard deviations and rounding: error rate 6e-7 a comparison, fewer than 80 of them.
fn assert_irradiance(lights: &LightSampler, normal: Vec3A, expected: f32) {
    for strategy in [Strategy::One, Strategy::SkyApart] {
        let (mean, sigma) = irradiance(lights, Vec3A::ZERO, normal, strategy);
        assert!(
            (mean - expected).abs() <= 5.0 * sigma + 2e-4 * expected,
            "{strategy:?}: {mean} +- {sigma}, expected {expected}"
        );
    }
}

#[test]
fn a_sun_gives_its_irradiance_whatever_its_size() {
    for angle in [0.0, 0.009_18, 1.0, PI] {
        let lights = sampler(vec![lamp_above(LightKind::Sun { angle })]);
        assert_irradiance(&lights, Vec3A::Z, 100.0);
    }
    let turn = Quat::from_euler(EulerRot::XYZ, 1.0, 0.0, 0.0);
    let kind = LightKind::Sun { angle: 0.009_18 };
    let lights = sampler(vec![lamp_at(kind, Vec3::ZERO, turn)]);
    assert_irradiance(&lights, Vec3A::Z, 100.0 * 1f32.cos());
}

/// A uniform ball lights a plane that sees it whole like a point; a disk that turns towards the
/// plane, of radiance P / (4 pi^2 r^2), gives pi L sin^2.
#[test]
fn point_lamps_of_any_radius_give_their_power() {
    let as_point = 100.0 / (4.0 * PI) / 4.0;
    for (radius, soft) in [(0.0, false), (0.0, true), (0.1, false), (1.0, false)] {
        let lights = sampler(vec![lamp_above(point_lamp(radius, soft))]);
        assert_irradiance(&lights, Vec3A::Z, as_point);
        let tilted = Vec3A::new(0.6, 0.0, 0.8);
        if radius < 1.0 {
            assert_irradiance(&lights, tilted, 0.8 * as_point);
        }
    }
    for radius in [0.1f32, 1.0] {
        let lights = sampler(vec![lamp_above(point_lamp(radius, true))]);
        let sin_squared = radius * radius / (4.0 + radius * radius);
        let expected = 100.0 / (4.0 * PI * radius * radius) * sin_squared;
        assert_irradiance(&lights, Vec3A::Z, expected);
    }
}

/// Inside a ball of radiance L a plane receives pi L.
#[test]
fn a_lamp_around_the_point_is_a_furnace() {
    let lights = sampler(vec![lamp_above(point_lamp(3.0, false))]);
    assert_irradiance(&lights, Vec3A::Z, PI * 100.0 / (4.0 * PI * PI * 9.0));
}

/// Cycles: smoothstep of (cos - cos half angle) / ((1 - cos half angle) blend).
#[test]
fn spots_fade_towards_their_edge() {
    for blend in [0.15f32, 1.0] {
        for angle in [0.0f32, 0.2, 0.4, 0.49, 0.51] {
            let across = 2.0 * angle.tan();
            let kind = spot(0.0, false, blend);
            let light = lamp_at(kind, Vec3::new(across, 0.0, 2.0), Quat::IDENTITY);
            let edge = 0.5f32.cos();
            let x = ((angle.cos() - edge) / ((1.0 - edge) * blend)).clamp(0.0, 1.0);
            let intensity = 100.0 / (4.0 * PI) * x * x * (3.0 - 2.0 * x);
            let expected = intensity * angle.cos() / (4.0 + across * across);
            assert_irradiance(&sampler(vec![light]), Vec3A::Z, expected);
        }
    }
}

/// Form factor of a rectangle seen from under its middle; sides in units of the distance.
fn form_factor(width: f32, length: f32) -> f32 {
    let (x, y) = (0.5 * width, 0.5 * length);
    let (hx, hy) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    2.0 / PI * (x / hx * (y / hx).atan() + y / hy * (x / hy).atan())
}

#[test]
fn area_lamps_follow_their_form_factors_and_shine_to_one_side() {
    let size = [1.0, 0.5];
    let rectangle = LightKind::AreaRectangle { size, spread: PI };
    let radiance = 100.0 / (PI * 0.5);
    let lights = sampler(vec![lamp_above(rectangle)]);
    assert_irradiance(&lights, Vec3A::Z, PI * radiance * form_factor(0.5, 0.25));
    let disk = LightKind::AreaEllipse {
        size: [1.0, 1.0],
        spread: PI,
    };
    let lights = sampler(vec![lamp_above(disk)]);
    let radiance = 100.0 / (PI * 0.25 * PI);
    assert_irradiance(&lights, Vec3A::Z, PI * radiance * 0.25 / 4.25);
    let upwards = Quat::from_rotation_x(PI);
    let lights = sampler(vec![lamp_at(rectangle, Vec3::new(0.0, 0.0, 2.0), upwards)]);
    assert_irradiance(&lights, Vec3A::Z, 0.0);
}

/// A lamp fills half of what a point in front of it sees: directions drawn evenly have cosines of mean
/// 1/2 and mean square 1/3, an error of 0.58 a sample; points drawn evenly have one of 30 at a hundredth.
#[test]
fn next_to_a_lamp_its_light_has_little_noise() {
    for height in [0.01f32, 0.05, 0.2] {
        let at = |kind| sampler(vec![lamp_at(kind, Vec3::Z * height, Quat::IDENTITY)]);
        let size = [1.0, 0.5];
        let rectangle = at(LightKind::AreaRectangle { size, spread: PI });
        let seen = form_factor(1.0 / height, 0.5 / height);
        assert_irradiance(&rectangle, Vec3A::Z, 100.0 / 0.5 * seen);
        let size = [1.0, 1.0];
        let disk = at(LightKind::AreaEllipse { size, spread: PI });
        let seen = 0.25 / (0.25 + height * height);
        assert_irradiance(&disk, Vec3A::Z, 100.0 / (0.25 * PI) * seen);
        for lights in [rectangle, disk] {
            let (mean, sigma) = irradiance(&lights, Vec3A::ZERO, Vec3A::Z, Strategy::One);
            let error_of_one = sigma * 200_000f32.sqrt() / mean;
            assert!(error_of_one < 1.0, "{height}: {error_of_one}");
        }
    }
}

#[test]
fn glowing_triangles_shine_to_both_sides() {
    let frame = glowing_square();
    let lights = LightSampler::build(&frame, None);
    let expected = PI * 5.0 * form_factor(0.5, 1.0);
    assert_irradiance(&lights, Vec3A::Z, expected);
    let (mean, sigma) = irradiance(&lights, Vec3A::new(0.0, 0.0, 4.0), -Vec3A::Z, Strategy::One);
    assert!((mean - expected).abs() < 5.0 * sigma);
    assert_eq!(
        emitted_radiance(&frame, 0, 0, Vec2::splat(0.2), -Vec3A::Z),
        Vec3A::splat(5.0)
    );
    assert_eq!(
        emitted_radiance(&frame, 0, 1, Vec2::splat(0.2), -Vec3A::Z),
        Vec3A::ZERO
    );
}

#[test]
fn triangles_that_shine_by_nodes_are_sampled_wherever_they_shine() {
    let mut frame = glowing_square();
    // Light where x is above zero: half of the square.
    let rows: &[(&str, &[i64], u32)] = &[
        ("geometry", &[], 0),
        ("vector_math", &[0, -1, -2, -2], 2),
        ("average", &[1], 0),
        ("math", &[2, -2, -2], 14),
        ("emission", &[-3, 3], 0),
    ];
    let constants = [[1.0, 0.0, 0.0], [0.0; 3], [10.0; 3]];
    frame.materials[1] = Material::new(&Draft::of(rows, &constants).unwrap());
    assert!(frame.materials[1].is_emissive());
    let at = |barycentric| emitted_radiance(&frame, 0, 0, barycentric, -Vec3A::Z);
    assert_eq!(at(Vec2::new(0.8, 0.1)), Vec3A::splat(10.0));
    assert_eq!(at(Vec2::new(0.1, 0.1)), Vec3A::ZERO);
    let lights = LightSampler::build(&frame, None);
    assert_irradiance(&lights, Vec3A::Z, 0.5 * PI * 10.0 * form_factor(0.5, 1.0));
}

#[test]
fn a_plain_sky_is_left_to_scattered_rays() {
    let lights = LightSampler::build(&frame_of(vec![], plain_world(0.7)), None);
    assert!(lights.is_empty());
    let receiver = receiver_at(Vec3A::ZERO, Vec3A::Z);
    for strategy in [Strategy::One, Strategy::SkyApart] {
        assert_eq!(lights.environment_pdf(&receiver, strategy, Vec3A::Z), 0.0);
    }
    assert_eq!(
        lights.environment_radiance(Vec3A::X, RayKind::Diffuse, 0),
        Vec3A::splat(0.7)
    );
}

#[test]
fn a_sky_gives_pi_times_its_radiance() {
    let lights = LightSampler::build(&frame_of(vec![], even_world(0.7)), None);
    assert_irradiance(&lights, Vec3A::new(0.6, 0.0, 0.8), 0.7 * PI);
}

#[test]
fn sky_and_sun_add_up_however_they_are_sampled() {
    let sun = lamp_above(LightKind::Sun { angle: 0.01 });
    let irradiance = sun.power.y;
    let lights = LightSampler::build(&frame_of(vec![sun], even_world(0.7)), None);
    assert_irradiance(&lights, Vec3A::Z, irradiance + 0.7 * PI);
}

/// The density that a ray's hits report for light sampling.
fn pdf_along(lights: &LightSampler, receiver: &Receiver, direction: Vec3A) -> f32 {
    let ray = Ray::new(receiver.point, direction);
    let hits = lights.lamps_along(&ray, receiver.normal, Strategy::One, RayKind::Diffuse, 0);
    let lamps: f32 = hits.map(|hit| hit.pdf_solid_angle).sum();
    lamps + lights.environment_pdf(receiver, Strategy::One, direction)
}

/// Light samples against the density that rays which meet the light by chance report: what multiple
/// importance sampling rests on.
#[test]
fn light_samples_follow_the_densities_of_the_rays_that_find_them() {
    let near = Vec3::new(0.5, -0.3, 1.5);
    // Towards the receiver but for half a spot's cone: the edge of the cone crosses the lamp.
    let tilt = Quat::from_rotation_x(0.45) * Quat::from_rotation_arc(Vec3::Z, near.normalize());
    let size = [1.0, 0.6];
    let kinds = [
        (LightKind::Sun { angle: 0.4 }, 0.05),
        (LightKind::Sun { angle: 0.009_18 }, 2e-5),
        (point_lamp(0.3, false), 0.05),
        (point_lamp(0.3, true), 0.05),
        (point_lamp(0.004, false), 1e-5),
        (point_lamp(4.0, false), 2.0),
        (spot(0.2, false, 0.3), 0.05),
        (LightKind::AreaRectangle { size, spread: PI }, 0.2),
        (LightKind::AreaEllipse { size, spread: PI }, 0.2),
    ];
    let receiver = receiver_at(Vec3A::ZERO, Vec3A::new(0.6, 0.0, 0.8));
    for (kind, one_minus_cos_max) in kinds {
        let light = lamp_at(kind, near, tilt);
        let axis = match kind {
            LightKind::Sun { .. } => light.world_from_light.matrix3.z_axis,
            _ => Vec3A::from(near),
        };
        let lights = sampler(vec![light]);
        let test = DirectionTest {
            one_minus_cos_max,
            quadrature: 48,
            ..DirectionTest::sphere(axis.normalize())
        };
        let score = test.score(
            |random| {
                let drawn = draw(&lights, receiver.point, receiver.normal, random)?;
                Some(drawn.direction)
            },
            |direction| pdf_along(&lights, &receiver, direction),
        );
        assert!(score < MAX_SCORE, "{kind:?}: {score}");
    }
}

#[test]
fn glowing_triangles_follow_their_density() {
    let lights = LightSampler::build(&glowing_square(), None);
    let (point, normal) = (Vec3A::new(0.3, 0.2, 0.5), Vec3A::Z);
    let test = DirectionTest {
        one_minus_cos_max: 0.7,
        quadrature: 48,
        ..DirectionTest::sphere(Vec3A::Z)
    };
    let score = test.score(
        |random| {
            let drawn = draw(&lights, point, normal, random)?;
            Some(drawn.direction)
        },
        |direction| {
            // The plane z = 2; triangle 0 is right of the diagonal, triangle 2 left of it.
            let hit = point + direction * (1.5 / direction.z);
            let (x, y) = (2.0 * hit.x, hit.y);
            if x.abs().max(y.abs()) > 1.0 {
                return 0.0;
            }
            let triangle = if x > y { 0 } else { 2 };
            lights.emissive_pdf(&receiver_at(point, normal), Strategy::One, 0, triangle, hit)
        },
    );
    assert!(score < MAX_SCORE, "{score}");
    assert_eq!(
        lights.emissive_pdf(&receiver_at(point, normal), Strategy::One, 0, 1, Vec3A::X),
        0.0
    );
    assert_eq!(
        lights.emissive_pdf(&receiver_at(point, normal), Strategy::One, 3, 0, Vec3A::X),
        0.0
    );
}

fn many_lamps(count: usize) -> Vec<Light> {
    let mut random = Random::new(12);
    (0..count)
        .map(|i| {
            let position = Vec3::new(random.next(), random.next(), random.next() - 0.2) * 8.0;
            let kind = match i % 4 {
                0 => point_lamp(0.1, false),
                1 => spot(0.1, true, 0.2),
                2 => LightKind::AreaRectangle {
                    size: [0.5, 0.2],
                    spread: PI,
                },
                _ => LightKind::Sun { angle: 0.01 },
            };
            let turn = Quat::from_rotation_x(0.3 * i as f32);
            let mut light = lamp_at(kind, position, turn);
            light.power *= random.next();
            light
        })
        .collect()
}

/// Skipping a lamp that cannot reach the point must lose no light: the sum over lamps one by one.
#[test]
fn irradiance_of_many_lamps_is_the_sum_over_the_lamps() {
    for count in [9, 60] {
        let lamps = many_lamps(count);
        let (point, normal) = (Vec3A::new(3.0, 4.0, 1.0), Vec3A::new(0.0, 0.6, 0.8));
        let (mut sum, mut variance) = (0.0, 0.0);
        for light in &lamps {
            let (mean, sigma) = irradiance(&sampler(vec![*light]), point, normal, Strategy::One);
            sum += mean;
            variance += sigma * sigma;
        }
        let (mean, sigma) = irradiance(&sampler(lamps), point, normal, Strategy::One);
        let sigma = (sigma * sigma + variance).sqrt();
        assert!(
            (mean - sum).abs() < 5.0 * sigma,
            "{count}: {mean} +- {sigma}, {sum}"
        );
    }
}

#[test]
fn rays_meet_lamps_up_to_their_end_and_the_camera_only_those_it_sees() {
    let mut hidden = lamp_above(point_lamp(0.5, false));
    hidden.reach.visibility = Visibility::from_bits(0b1_1110);
    let lights = sampler(vec![
        hidden,
        lamp_above(LightKind::AreaRectangle {
            size: [1.0, 1.0],
            spread: PI,
        }),
        lamp_above(LightKind::Sun { angle: 0.01 }),
    ]);
    let met = |t_max, kind| {
        let ray = Ray::segment(Vec3A::ZERO, Vec3A::Z, t_max);
        let hits = lights.lamps_along(&ray, Vec3A::Z, Strategy::One, kind, 0);
        hits.map(|hit| hit.t).collect::<Vec<f32>>()
    };
    assert_eq!(
        met(f32::INFINITY, RayKind::Diffuse),
        [1.5, 2.0, f32::INFINITY]
    );
    assert_eq!(met(f32::INFINITY, RayKind::Camera), [2.0, f32::INFINITY]);
    assert_eq!(met(1.8, RayKind::Diffuse), [1.5]);
    assert!(met(1.0, RayKind::Diffuse).is_empty());
}

/// No placement gives a NaN: at the lamp's centre, on its surface, in its plane, far away.
#[test]
fn extreme_receivers_stay_finite() {
    let size = [1.0, 1.0];
    let kinds = [
        LightKind::Sun { angle: 1e-6 },
        point_lamp(0.0, false),
        point_lamp(1e-7, false),
        point_lamp(0.5, false),
        point_lamp(0.5, true),
        spot(0.5, false, 0.0),
        LightKind::AreaRectangle { size, spread: PI },
        LightKind::AreaEllipse { size, spread: PI },
    ];
    let mut random = Random::new(14);
    for kind in kinds {
        let lights = sampler(vec![lamp_above(kind)]);
        for height in [2.0, 1.5, 2.5, 2.0 - 1e-6, -1e6, 1e-20] {
            for _ in 0..50 {
                let point = Vec3A::new(0.0, 0.0, height);
                let normal = crate::math::warp::sample_sphere(random.next_2d());
                if let Some(light) = draw(&lights, point, normal, &mut random) {
                    let value = lights.radiance(&light) / light.pdf_solid_angle;
                    assert!(value.is_finite(), "{kind:?} {height}: {light:?}");
                    assert!(light.direction.is_normalized() && light.distance > 0.0);
                }
            }
        }
    }
}

#[test]
fn lamps_without_light_or_area_are_no_lights() {
    let mut dark = lamp_above(point_lamp(0.1, false));
    dark.power = Vec3A::ZERO;
    let line = lamp_above(LightKind::AreaRectangle {
        size: [1.0, 0.0],
        spread: PI,
    });
    let lights = sampler(vec![dark, line]);
    assert!(lights.is_empty());
    assert!(draw(&lights, Vec3A::ZERO, Vec3A::Z, &mut Random::new(15)).is_none());
}

#[test]
fn spread_narrows_an_area_lamp_and_keeps_its_power() {
    let size = [1.0, 0.5];
    // The integral of the slats' formula over a plane that is wide enough gives the power back.
    for spread in [0.035, 0.2, 1.0, 2.0] {
        for kind in [
            LightKind::AreaRectangle { size, spread },
            LightKind::AreaEllipse { size, spread },
        ] {
            let lamp = lamp_above(kind);
            let expected = f64::from(lamp.power.x);
            let lights = sampler(vec![lamp]);
            let reach = 2.0 * (0.5 * spread).tan() + 1.0;
            let mut random = Random::new(5);
            let count = 20_000;
            let received: f64 = (0..count)
                .map(|_| {
                    let at = [(); 2].map(|()| reach * (2.0 * random.next() - 1.0));
                    let point = Vec3A::new(at[0], at[1], 0.0);
                    let u = [(); 2].map(|()| random.next());
                    let numbers = LightUse {
                        choice: 0.0,
                        inside: 0.0,
                        direction: u,
                    };
                    let samples =
                        lights.sample(&receiver_at(point, Vec3A::Z), Strategy::One, &numbers, || u);
                    let irradiance = |s: &LightSample| {
                        f64::from(lights.radiance(s).x * s.direction.z / s.pdf_solid_angle)
                    };
                    samples.iter().flatten().map(irradiance).sum::<f64>()
                })
                .sum();
            let power = received / f64::from(count) * f64::from(4.0 * reach * reach);
            // The standard error is 2.7 % with the narrowest cone, less with the others.
            assert!((power / expected - 1.0).abs() < 0.1, "{kind:?}: {power}");
        }
    }
}

/// A frame with one lamp whose light these instructions compute.
fn lamp_with(kind: LightKind, rows: &[crate::shader::Row], constants: &[[f32; 3]]) -> SceneFrame {
    let turn = Quat::from_euler(EulerRot::XYZ, 0.3, -0.2, 0.9);
    let lamp = Light {
        material: Some(0),
        scale: Vec3A::new(1.0, 1.5, 0.8),
        ..lamp_at(kind, Vec3::new(0.2, -0.1, 2.0), turn)
    };
    let mut frame = frame_of(vec![lamp], plain_world(0.0));
    frame.materials = vec![Material::new(&Draft::of(rows, constants).unwrap())];
    frame
}

/// A program that shines as the point's coordinate in the lamp's space, squared.
const PLACE: &[crate::shader::Row] = &[
    ("coordinate", &[], 1),
    ("multiply", &[0, 0], 0),
    ("emission", &[-1, 1], 0),
];

/// Asserts the irradiance of a point lamp with a Light Falloff of strength a half, in this mode and of
/// this smoothness, over that of one which shines evenly a metre away.
fn assert_falloff(mode: u32, smooth: f32, expected: impl Fn(f32) -> f32) {
    let rows: &[crate::shader::Row] = &[
        ("light_falloff", &[-2, -3], mode),
        ("emission", &[-1, 0], 0),
    ];
    let constants = [[1.0; 3], [0.5; 3], [smooth; 3]];
    let frame = lamp_with(point_lamp(0.0, true), rows, &constants);
    let lights = LightSampler::build(&frame, None);
    let center = frame.lights[0].world_from_light.translation;
    for distance in [0.5, 1.0, 7.0] {
        let receiver = receiver_at(center - distance * Vec3A::Z, Vec3A::Z);
        let drawn = numbers(&mut Random::new(3));
        let [sample, _] = lights.sample(&receiver, Strategy::One, &drawn, || [0.5; 2]);
        let found = sample.unwrap().radiance.unwrap();
        let expected = 0.5 * frame.lights[0].power / (4.0 * PI) * expected(distance);
        assert!(
            (found / expected - 1.0).abs().max_element() < 1e-5,
            "{found} {expected}"
        );
    }
}

#[test]
fn constant_falloff_undoes_the_distance() {
    assert_falloff(2, 0.0, |_| 1.0);
}

/// Smooth falloff: by `d^2 / (smooth + d^2)`, and linear falloff by the distance.
#[test]
fn linear_falloff_is_smooth_near_the_lamp() {
    assert_falloff(1, 2.0, |distance| distance / (2.0 + distance * distance));
}

#[test]
fn rays_that_meet_a_lamp_with_nodes_see_what_samples_of_it_do() {
    let kinds = [
        point_lamp(0.4, false),
        point_lamp(0.4, true),
        spot(0.3, false, 0.5),
        LightKind::AreaRectangle {
            size: [1.0, 0.5],
            spread: PI,
        },
        LightKind::Sun { angle: 0.2 },
    ];
    for kind in kinds {
        let frame = lamp_with(kind, PLACE, &[[1.0; 3]]);
        let lights = LightSampler::build(&frame, None);
        let receiver = receiver_at(Vec3A::new(0.1, 0.3, 0.0), Vec3A::Z);
        let mut random = Random::new(7);
        let mut shone = Vec3A::ZERO;
        for _ in 0..50 {
            let drawn = numbers(&mut random);
            let [sample, _] = lights.sample(&receiver, Strategy::One, &drawn, || [0.5; 2]);
            let Some(sample) = sample else { continue };
            let ray = Ray::new(receiver.point, sample.direction);
            let met = lights.lamps_along(&ray, receiver.normal, Strategy::One, RayKind::Diffuse, 0);
            let Some(hit) = met.last() else { continue };
            let radiance = sample.radiance.unwrap();
            let off = (hit.radiance - radiance).abs().max_element();
            assert!(
                off <= 2e-3 * radiance.max_element(),
                "{kind:?} {hit:?} {sample:?}"
            );
            shone += radiance;
        }
        assert!(shone.max_element() > 0.0, "{kind:?} is dark");
    }
}

#[test]
fn a_lamp_of_constant_nodes_is_a_plain_lamp() {
    let rows: &[crate::shader::Row] = &[("blackbody", &[-2], 0), ("emission", &[-1, 0], 0)];
    let frame = lamp_with(point_lamp(0.2, true), rows, &[[2.0; 3], [6500.0; 3]]);
    let lights = LightSampler::build(&frame, None);
    let receiver = receiver_at(Vec3A::ZERO, Vec3A::Z);
    let mut plain = frame.lights[0];
    plain.material = None;
    let plain = sampler(vec![plain]);
    let drawn = numbers(&mut Random::new(5));
    let radiance = |lights: &LightSampler| {
        let [sample, _] = lights.sample(&receiver, Strategy::One, &drawn, || [0.5; 2]);
        sample.unwrap().radiance.unwrap()
    };
    let factor = radiance(&lights) / radiance(&plain);
    // 6500 K is nearly white: luminance one, times two.
    assert!(
        (crate::math::luminance(factor) - 2.0).abs() < 0.1,
        "{factor}"
    );
}
