//! Choosing between lights, few and many.

use super::*;

fn random_receiver(random: &mut Random) -> Receiver {
    receiver_at(
        Vec3A::new(random.next(), random.next(), random.next()) * 8.0,
        crate::math::warp::sample_sphere(random.next_2d()),
    )
}

/// Few lights: no sample is lost. Many: some walks end between two nodes that only seemed to shine.
#[test]
fn probabilities_of_the_lights_sum_to_one() {
    for count in [5, EVALUATED_MAX - 1, 100, 1000] {
        let lights = LightSampler::build(&frame_of(many_lamps(count), even_world(1.0)), None);
        assert_eq!(lights.len(), count + 1);
        let mut random = Random::new(13);
        let mut mean = 0.0;
        for _ in 0..100 {
            let receiver = random_receiver(&mut random);
            let pmf = |i| lights.pmf(i, Strategy::One, &receiver);
            let sum: f32 = (0..lights.len()).map(pmf).sum();
            let is_right = if count < EVALUATED_MAX {
                (sum - 1.0).abs() < 1e-5
            } else {
                sum < 1.0 + 1e-5
            };
            assert!(is_right, "{count}: {sum}");
            mean += sum / 100.0;
        }
        assert!(mean > 0.97, "{count}: {mean}");
    }
}

#[test]
fn lights_are_drawn_with_their_probabilities() {
    for count in [EVALUATED_MAX - 1, 100, 1000] {
        let lights = LightSampler::build(&frame_of(many_lamps(count), even_world(1.0)), None);
        let receiver = receiver_at(Vec3A::ONE, Vec3A::Z);
        let pmf = |i: usize| lights.pmf(i, Strategy::One, &receiver);
        let draws = 200_000;
        let mut random = Random::new(13);
        // The last one counts draws that end nowhere.
        let mut observed = vec![0.0; count + 2];
        let mut expected: Vec<f64> = (0..=count)
            .map(|i| f64::from(draws) * f64::from(pmf(i)))
            .collect();
        expected.push((f64::from(draws) - expected.iter().sum::<f64>()).max(0.0));
        for _ in 0..draws {
            let chosen = lights.choose(&receiver, Strategy::One, &numbers(&mut random));
            if let Some(chosen) = chosen {
                let pmf = pmf(chosen.index);
                assert!((chosen.probability / pmf - 1.0).abs() < 1e-5);
                assert!((0.0..1.0).contains(&chosen.u));
            }
            observed[chosen.map_or(count + 1, |chosen| chosen.index)] += 1.0;
        }
        let score = chi_square_score(&observed, &expected);
        assert!(score < MAX_SCORE, "{count}: {score}");
    }
}

/// What a light gives, it can be drawn for: no bound of a node hides it.
#[test]
fn no_light_that_shines_is_out_of_reach() {
    let lights = sampler(many_lamps(300));
    let mut random = Random::new(15);
    let mut shining = 0;
    for _ in 0..300 {
        let receiver = random_receiver(&mut random);
        for (index, light) in lights.lights.iter().enumerate() {
            if light.irradiance(&receiver) > 0.0 {
                let pmf = lights.pmf(index, Strategy::One, &receiver);
                assert!(pmf > 0.0, "{index} at {receiver:?}");
                shining += 1;
            }
        }
    }
    assert!(shining > 10_000, "{shining}");
}

/// A city: a thousand lamps, each of which lights little but its surroundings.
fn city() -> Vec<Light> {
    let mut random = Random::new(16);
    let lamp = |_| {
        let place = Vec3::new(random.next() - 0.5, random.next() - 0.5, 0.0) * 200.0;
        let power = random.next();
        let kind = if random.next() < 0.5 {
            point_lamp(0.1, false)
        } else {
            let size = [0.4, 0.4];
            LightKind::AreaRectangle { size, spread: PI }
        };
        let mut light = lamp_at(kind, place.with_z(3.0), Quat::IDENTITY);
        light.power *= power;
        light
    };
    (0..1000).map(lamp).collect()
}

/// Mean and variance of a sample of the irradiance from above (green).
fn statistics(mut sample: impl FnMut() -> f64, samples: u32) -> (f64, f64) {
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..samples {
        let value = sample();
        sum += value;
        squares += value * value;
    }
    let mean = sum / f64::from(samples);
    (mean, squares / f64::from(samples) - mean * mean)
}

/// The oracle takes every lamp in turn, the rival draws them by power.
#[test]
fn a_thousand_lamps_are_right_and_much_less_noisy_than_by_power() {
    let lamps = city();
    let lights = sampler(lamps.clone());
    let alone: Vec<LightSampler> = lamps.iter().map(|&lamp| sampler(vec![lamp])).collect();
    let powers = crate::sampling::discrete::Discrete::new(lamps.iter().map(|l| l.power.y));
    let powers = powers.unwrap();
    let mut random = Random::new(17);
    let received = |light: Option<LightSample>, pmf: f32| {
        light.map_or(0.0, |light| {
            let radiance = light.radiance.unwrap().y;
            f64::from(radiance * light.direction.z / (light.pdf_solid_angle * pmf))
        })
    };
    let mut gains = vec![];
    for _ in 0..8 {
        let point = Vec3A::new(random.next() - 0.5, random.next() - 0.5, 0.0) * 150.0;
        let each = |lamp: &LightSampler, random: &mut Random| {
            received(draw(lamp, point, Vec3A::Z, random), 1.0)
        };
        let rounds = 40;
        let whole = |random: &mut Random| alone.iter().map(|lamp| each(lamp, random)).sum::<f64>();
        let (truth, oracle) = statistics(|| whole(&mut random), rounds);
        let samples = 20_000;
        let by_tree = || received(draw(&lights, point, Vec3A::Z, &mut random), 1.0);
        let (mean, variance) = statistics(by_tree, samples);
        let by_power = || {
            let (index, pmf, _) = powers.sample(random.next());
            received(draw(&alone[index], point, Vec3A::Z, &mut random), pmf)
        };
        let (_, rival) = statistics(by_power, samples);
        let sigma = (variance / f64::from(samples) + oracle / f64::from(rounds)).sqrt();
        // Error rate 6e-7 a comparison.
        assert!((mean - truth).abs() < 5.0 * sigma, "{mean} {truth} {sigma}");
        gains.push(rival / variance);
    }
    gains.sort_by(f64::total_cmp);
    assert!(gains[0] > 4.0 && gains[4] > 20.0, "{gains:?}");
}

/// The tree of boxes against a loop over all lamps.
#[test]
fn rays_meet_the_same_lamps_however_many_there_are() {
    let lamps = many_lamps(200);
    let lights = sampler(lamps.clone());
    let alone: Vec<LightSampler> = lamps.iter().map(|&lamp| sampler(vec![lamp])).collect();
    let met = |lights: &LightSampler, ray: &Ray| -> Vec<f32> {
        let kind = RayKind::Diffuse;
        let hits = lights.lamps_along(ray, Vec3A::Z, Strategy::One, kind, 0);
        hits.map(|hit| hit.t).collect()
    };
    let mut random = Random::new(18);
    let mut count = 0;
    for i in 0..3000 {
        let from = random_receiver(&mut random);
        let t_max = if i % 2 == 0 { 4.0 } else { f32::INFINITY };
        let ray = Ray::segment(from.point, from.normal, t_max);
        let expected: Vec<f32> = alone.iter().flat_map(|lamp| met(lamp, &ray)).collect();
        assert_eq!(met(&lights, &ray), expected);
        count += expected.len();
    }
    assert!(count > 30, "{count}");
}
