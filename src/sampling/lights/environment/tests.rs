use super::*;
use crate::contract::{Given, Numbers};
use crate::math::statistics::{DirectionTest, MAX_SCORE, Random};
use crate::math::warp::sample_sphere;
use crate::scene::{Lookup, Reach};

const WIDTH: usize = 256;
const HEIGHT: usize = 128;

/// A smooth sky, dark below; where there is a `sun`, a block of 2 x 2 texels of that radiance.
fn image(sun: Option<(usize, usize, f32)>) -> Arc<Image> {
    let mut pixels = vec![1.0f32; WIDTH * HEIGHT * 4];
    for (i, pixel) in pixels.chunks_mut(4).enumerate() {
        let (x, y) = ((i % WIDTH) as f32, i / WIDTH);
        let up = y as f32 / HEIGHT as f32;
        let value = if y < 8 {
            0.0
        } else {
            up * (1.2 + (x * 0.05).sin())
        };
        pixel[..3].copy_from_slice(&[0.7 * value, value, 1.4 * value]);
    }
    if let Some((x, y, radiance)) = sun {
        for (dx, dy) in (0..4).map(|i| (i % 2, i / 2)) {
            let at = 4 * ((y + dy) * WIDTH + (x + dx) % WIDTH);
            pixels[at..at + 3].fill(radiance);
        }
    }
    let given = Given {
        name: "pixels".into(),
        shape: vec![HEIGHT, WIDTH, 4],
        numbers: Numbers::F32(&pixels),
    };
    let image = Image::new(vec![given], Lookup::default());
    Arc::new(image.unwrap())
}

fn world(image: Arc<Image>, environment_from_world: Mat3A) -> World {
    World {
        radiance: Vec3A::splat(0.5),
        image: Some(image),
        camera_image: None,
        environment_from_world,
        reach: Reach::ALL,
    }
}

fn turned() -> Mat3A {
    Mat3A::from_rotation_z(0.7) * Mat3A::from_rotation_x(0.4)
}

/// Not a rotation: the image is stretched over the sky.
fn stretched() -> Mat3A {
    turned() * Mat3A::from_diagonal(glam::Vec3::new(1.0, 1.6, 0.7))
}

const RECEIVER: Receiver = Receiver {
    point: Vec3A::ZERO,
    normal: Vec3A::Z,
    time: 0.5,
};

/// Luminance of the world over the sphere by brute force: 1024 x 512 directions.
fn energy(world: &World) -> f64 {
    let grid = Grid {
        width: 1024,
        height: 512,
    };
    let cells = (0..grid.cells()).map(|cell| {
        let radiance = world.radiance(grid.direction(cell, [0.5, 0.5]));
        f64::from(luminance(radiance) * grid.solid_angle(cell / grid.width))
    });
    cells.sum()
}

#[test]
fn sky_and_sun_together_hold_the_energy_of_the_image() {
    for sun in [None, Some((80, 100, 6e3)), Some((255, 90, 4e4))] {
        let world = world(image(sun), Mat3A::IDENTITY);
        let (sky, found, _) = lights_of(&world, None);
        assert_eq!(found.is_some(), sun.is_some());
        let sun_energy = found.map_or(0.0, |sun| f64::from(sun.irradiance));
        let sky_energy = sky.map_or(0.0, |sky| f64::from(sky.mean) * 4.0 * std::f64::consts::PI);
        let total = sun_energy + sky_energy;
        // The table rounds edges of texels at the poles, by less than half a percent.
        assert!(
            (total / energy(&world) - 1.0).abs() < 5e-3,
            "{sun:?}: {total}"
        );
        if let Some((_, _, radiance)) = sun {
            let solid_angle = 4.0 * (2.0 * PI / WIDTH as f32) * (PI / HEIGHT as f32);
            let most = 0.5 * f64::from(radiance * solid_angle);
            assert!(
                sun_energy > 0.3 * most && sun_energy < 1.2 * most,
                "{sun_energy}"
            );
        }
    }
}

#[test]
fn bright_but_wide_and_small_but_dim_regions_are_sky() {
    // A window as wide as a quarter of the image, and a lamp of a tenth of a percent.
    let mut wide = vec![0.01f32; WIDTH * HEIGHT * 4];
    for y in 60..100 {
        wide[4 * (y * WIDTH + 40)..4 * (y * WIDTH + 104)].fill(100.0);
    }
    let given = Given {
        name: "pixels".into(),
        shape: vec![HEIGHT, WIDTH, 4],
        numbers: Numbers::F32(&wide),
    };
    let wide = Image::new(vec![given], Lookup::default()).unwrap();
    for image in [Arc::new(wide), image(Some((80, 100, 4.0)))] {
        assert!(lights_of(&world(image, Mat3A::IDENTITY), None).1.is_none());
    }
}

fn score(light: &dyn Emitter, test: &DirectionTest) -> f64 {
    test.score(
        |random| {
            let u_choice = random.next();
            Some(
                light
                    .sample(&RECEIVER, u_choice, random.next_2d())?
                    .direction,
            )
        },
        |direction| light.pdf_of_direction(&RECEIVER, direction),
    )
}

#[test]
fn sky_follows_its_pdf_under_any_mapping() {
    for mapping in [Mat3A::IDENTITY, turned(), stretched()] {
        let (sky, _, _) = lights_of(&world(image(None), mapping), None);
        let test = DirectionTest {
            quadrature: 48,
            ..DirectionTest::sphere(Vec3A::Z)
        };
        let score = score(&sky.unwrap(), &test);
        assert!(score < MAX_SCORE, "{mapping}: {score}");
    }
}

#[test]
fn sun_follows_its_pdf_under_any_mapping() {
    for mapping in [Mat3A::IDENTITY, turned(), stretched()] {
        let world = world(image(Some((80, 100, 6e3))), mapping);
        let (_, sun, _) = lights_of(&world, None);
        let sun = sun.unwrap();
        let test = DirectionTest {
            one_minus_cos_max: 0.012,
            quadrature: 96,
            ..DirectionTest::sphere(sun.direction)
        };
        let score = score(&sun, &test);
        assert!(score < MAX_SCORE, "{mapping}: {score}");
    }
}

/// The density over the whole sphere, by uniform directions: 5 standard deviations.
#[test]
fn densities_integrate_to_one() {
    for mapping in [Mat3A::IDENTITY, stretched()] {
        let world = world(image(Some((80, 100, 6e3))), mapping);
        let (sky, _, _) = lights_of(&world, None);
        let sky = sky.unwrap();
        let mut random = Random::new(15);
        let (mut sum, mut squares, samples) = (0.0, 0.0, 400_000);
        for _ in 0..samples {
            let direction = sample_sphere(random.next_2d());
            let value =
                f64::from(sky.pdf_of_direction(&RECEIVER, direction)) * 4.0 * std::f64::consts::PI;
            sum += value;
            squares += value * value;
        }
        let mean = sum / f64::from(samples);
        let sigma = ((squares / f64::from(samples) - mean * mean) / f64::from(samples)).sqrt();
        assert!((mean - 1.0).abs() < 5.0 * sigma, "{mean} +- {sigma}");
    }
}

/// What is drawn has the density that its direction has, its radiance is left to the world, and nothing is sky and
/// sun at once.
#[test]
fn sky_and_sun_share_the_sphere() {
    let world = world(image(Some((255, 90, 4e4))), turned());
    let (sky, sun, _) = lights_of(&world, None);
    let parts: [Box<dyn Emitter>; 2] = [Box::new(sky.unwrap()), Box::new(sun.unwrap())];
    let mut random = Random::new(16);
    let (mut doubtful, mut beside) = (0, 0);
    for i in 0..20_000 {
        let (own, other) = (&parts[i % 2], &parts[1 - i % 2]);
        let u_choice = random.next();
        // The tents at the rim of the sun's cells reach beyond them.
        let Some(sample) = own.sample(&RECEIVER, u_choice, random.next_2d()) else {
            beside += 1;
            continue;
        };
        assert_eq!(sample.radiance, None);
        let density = own.pdf_of_direction(&RECEIVER, sample.direction);
        // On a border between cells rounding may tell another cell.
        let differs = (density / sample.pdf_solid_angle - 1.0).abs() > 1e-3;
        let shared = other.pdf_of_direction(&RECEIVER, sample.direction) > 0.0;
        doubtful += u32::from(differs || shared);
    }
    assert!(doubtful < 20 && beside < 100, "{doubtful} {beside}");
}

/// A sun of few texels, most of them at its edge, is drawn by its light: no sample of it is much brighter than
/// another.
#[test]
fn samples_of_the_sun_are_alike() {
    let world = world(image(Some((80, 100, 6e3))), turned());
    let (_, sun, _) = lights_of(&world, None);
    let sun = sun.unwrap();
    let mut random = Random::new(17);
    let (mut sum, mut squares, count) = (0.0, 0.0, 10_000);
    for _ in 0..count {
        let sample = sun.sample(&RECEIVER, random.next(), random.next_2d());
        let value = sample.map_or(0.0, |sample| {
            f64::from(luminance(world.radiance(sample.direction)) / sample.pdf_solid_angle)
        });
        sum += value;
        squares += value * value;
    }
    let mean = sum / f64::from(count);
    let deviation = (squares / f64::from(count) - mean * mean).sqrt() / mean;
    assert!(
        (mean / f64::from(sun.irradiance) - 1.0).abs() < 0.02,
        "{mean}"
    );
    assert!(deviation < 0.1, "{deviation}");
}

#[test]
fn tables_are_made_once_for_an_image() {
    let image = image(None);
    let (_, _, first) = lights_of(&world(image.clone(), Mat3A::IDENTITY), None);
    let first = first.unwrap();
    let (_, _, again) = lights_of(&world(image, turned()), Some(&first));
    assert!(Arc::ptr_eq(&first, &again.unwrap()));
    let (_, _, other) = lights_of(&world(self::image(None), turned()), Some(&first));
    assert!(!Arc::ptr_eq(&first, &other.unwrap()));
}

/// Of the small parts are drawn all the directions that belong to them and no others, with the
/// density that they have.
#[test]
fn small_parts_are_drawn_as_their_density_says() {
    for mapping in [turned(), stretched()] {
        let world = world(image(None), mapping);
        let (sky, ..) = lights_of(&world, None);
        let centre = Vec3A::new(0.6, 0.0, 0.8);
        let is_small = |direction: Vec3A| direction.dot(centre) > 0.98;
        let small = sky.unwrap().small_parts(is_small).unwrap();
        let mut random = Random::new(21);
        let (mut integral, draws) = (0.0, 20_000);
        for _ in 0..draws {
            let direction = sample_sphere(random.next_2d());
            integral += f64::from(small.pdf(direction)) * 4.0 * std::f64::consts::PI;
            assert!(small.pdf(direction) > 0.0 || !is_small(direction));
            let drawn = small.sample(random.next_2d()).unwrap();
            assert!(drawn.direction.dot(centre) > 0.95);
            let pdf = small.pdf(drawn.direction);
            // On a border between cells rounding may tell another cell.
            assert!(pdf == 0.0 || (drawn.pdf_solid_angle / pdf - 1.0).abs() < 1.0);
        }
        // The parts cover a hundredth of the sphere, so that one draw has the standard deviation 10.
        let error = integral / f64::from(draws) - 1.0;
        assert!(
            error.abs() < 4.5 * 12.0 / f64::from(draws).sqrt(),
            "{error}"
        );
        assert!(
            lights_of(&world, None)
                .0
                .unwrap()
                .small_parts(|_| false)
                .is_none()
        );
    }
}
