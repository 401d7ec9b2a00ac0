use super::*;
use crate::math::statistics::{DirectionTest, MAX_SCORE, Random};

fn seen_under(cos: f32) -> Bsdf {
    let wo = Vec3A::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    Bsdf::new(Vec3A::Z, Vec3A::Z, wo)
}

fn principled(base_color: Vec3A, metallic: f32, roughness: f32) -> Principled {
    Principled {
        base_color,
        metallic,
        roughness,
        ior: 1.5,
        specular: 0.5,
    }
}

/// Light that comes back from a white surrounding, and its standard deviation.
fn furnace(bsdf: &Bsdf) -> (Vec3A, f32) {
    let mut random = Random::new(6);
    let samples = 40_000;
    let (mut sum, mut squares) = (Vec3A::ZERO, 0.0);
    for _ in 0..samples {
        let u_lobe = random.next();
        if let Some(sample) = bsdf.sample(u_lobe, random.next_2d()) {
            let weight = sample.value.sum() / bsdf.pdf(sample.pdfs);
            sum += weight;
            squares += weight.x * weight.x;
        }
    }
    let mean = sum / samples as f32;
    let variance = (squares / samples as f32 - mean.x * mean.x).max(0.0);
    (mean, (variance / samples as f32).sqrt())
}

const COSINES: [f32; 4] = [1.0, 0.7, 0.4, 0.15];
const ROUGHNESSES: [f32; 5] = [0.0, 0.1, 0.3, 0.6, 1.0];

/// Five standard deviations: error rate 6e-7 for each of 60 comparisons.
#[test]
fn white_metal_in_a_white_furnace_is_invisible() {
    for roughness in ROUGHNESSES {
        for cos in COSINES {
            let mut metal = seen_under(cos);
            metal.add_principled(1.0, &principled(Vec3A::ONE, 1.0, roughness));
            let mut glossy = seen_under(cos);
            glossy.add_glossy(1.0, Vec3A::ONE, roughness);
            for bsdf in [metal, glossy] {
                let (mean, sigma) = furnace(&bsdf);
                assert!(
                    (mean.x - 1.0).abs() < 0.01 + 5.0 * sigma,
                    "roughness {roughness}, cos {cos}: {mean}"
                );
            }
        }
    }
}

#[test]
fn white_plastic_neither_gains_nor_loses_much() {
    for roughness in ROUGHNESSES {
        for cos in COSINES {
            let mut bsdf = seen_under(cos);
            bsdf.add_principled(1.0, &principled(Vec3A::ONE, 0.0, roughness));
            let (mean, sigma) = furnace(&bsdf);
            assert!(
                mean.x < 1.01 + 5.0 * sigma && mean.x > 0.97 - 5.0 * sigma,
                "roughness {roughness}, cos {cos}: {mean}"
            );
        }
    }
}

#[test]
fn albedo_is_what_a_furnace_measures() {
    for roughness in ROUGHNESSES {
        for cos in COSINES {
            for metallic in [0.0, 1.0] {
                let mut bsdf = seen_under(cos);
                let color = Vec3A::new(0.8, 0.3, 0.05);
                bsdf.add_principled(1.0, &principled(color, metallic, roughness));
                let (mean, sigma) = furnace(&bsdf);
                let error = (mean - bsdf.albedo()).abs().max_element();
                assert!(
                    error < 0.03 + 5.0 * sigma,
                    "roughness {roughness}, cos {cos}, metallic {metallic}: {mean} {}",
                    bsdf.albedo()
                );
            }
        }
    }
}

#[test]
fn lambert_is_exact_and_specular_zero_leaves_only_it() {
    let color = Vec3A::new(0.8, 0.3, 0.05);
    let mut bsdf = seen_under(0.5);
    let no_specular = Principled {
        specular: 0.0,
        ..principled(color, 0.0, 0.5)
    };
    bsdf.add_principled(0.5, &no_specular);
    bsdf.add_diffuse(0.5 * color);
    assert_eq!(bsdf.probability_diffuse(), 1.0);
    assert_eq!(bsdf.glossy_alphas(), None);
    let (value, pdfs) = bsdf.eval(Vec3A::new(0.6, 0.0, 0.8));
    let expected = color * 0.8 / std::f32::consts::PI;
    assert!((value.sum() - expected).length() < 1e-6);
    assert!((bsdf.pdf(pdfs) - 0.8 / std::f32::consts::PI).abs() < 1e-6);
}

/// The GGX lobe itself is symmetric; what depends on the viewer only is its compensation, which
/// is divided out here by comparing with the mirror pair.
#[test]
fn single_bounce_ggx_is_reciprocal() {
    let mut random = Random::new(7);
    for _ in 0..1000 {
        let [a, b] = [random.next_2d(), random.next_2d()].map(sample_cosine_hemisphere);
        if a.z < 0.05 || b.z < 0.05 {
            continue;
        }
        let f = |wo: Vec3A, wi: Vec3A| {
            let mut bsdf = Bsdf::new(Vec3A::Z, Vec3A::Z, wo);
            bsdf.add_glossy(1.0, Vec3A::ONE, 0.6);
            let compensation = 1.0 / energy::directional_albedo(0.6, wo.z);
            bsdf.eval(wi).0.glossy.x / wi.z / compensation
        };
        let (there, back) = (f(a, b), f(b, a));
        assert!((there / back - 1.0).abs() < 1e-3, "{a} {b}: {there} {back}");
    }
}

fn bumpy() -> (Vec3A, Vec3A) {
    let normal = Vec3A::new(0.3, -0.2, 0.93).normalize();
    (normal, Vec3A::new(-0.1, 0.1, 1.0).normalize())
}

fn chi_square(bsdf: &Bsdf, axis: Vec3A, one_minus_cos_max: f64) -> f64 {
    let test = DirectionTest {
        one_minus_cos_max,
        quadrature: 48,
        ..DirectionTest::sphere(axis)
    };
    let draw = |random: &mut Random| {
        let u_lobe = random.next();
        Some(bsdf.sample(u_lobe, random.next_2d())?.direction)
    };
    test.score(draw, |wi| bsdf.pdf(bsdf.eval(wi).1))
}

#[test]
fn sampler_follows_its_pdf() {
    let (normal, geometric) = bumpy();
    for cos in [0.9f32, 0.3] {
        let wo =
            Frame::from_normal(geometric).to_world(Vec3A::new((1.0 - cos * cos).sqrt(), 0.0, cos));
        for roughness in [0.3f32, 0.5, 0.8] {
            for metallic in [0.0, 0.6, 1.0] {
                let mut bsdf = Bsdf::new(normal, geometric, wo);
                bsdf.add_principled(0.7, &principled(Vec3A::splat(0.3), metallic, roughness));
                bsdf.add_glossy(0.3, Vec3A::splat(0.9), 0.5);
                let mirror = 2.0 * wo.dot(normal) * normal - wo;
                let score = chi_square(&bsdf, mirror, 2.0);
                assert!(score < MAX_SCORE, "{cos} {roughness} {metallic}: {score}");
            }
        }
    }
}

#[test]
fn narrow_lobes_follow_their_pdf() {
    for roughness in [0.03f32, 0.07] {
        let mut bsdf = seen_under(0.6);
        bsdf.add_glossy(1.0, Vec3A::ONE, roughness);
        let mirror = Vec3A::new(-0.8, 0.0, 0.6);
        let width = f64::from(roughness).powi(4) * 40.0;
        let score = chi_square(&bsdf, mirror, width);
        assert!(score < MAX_SCORE, "{roughness}: {score}");
    }
}

#[test]
fn nothing_is_scattered_below_the_surface() {
    let (normal, geometric) = bumpy();
    let mut bsdf = Bsdf::new(normal, geometric, geometric);
    bsdf.add_principled(1.0, &principled(Vec3A::splat(0.5), 0.5, 1.0));
    let mut random = Random::new(8);
    for _ in 0..10_000 {
        let u_lobe = random.next();
        if let Some(sample) = bsdf.sample(u_lobe, random.next_2d()) {
            assert!(sample.direction.dot(geometric) > 0.0);
            assert!(bsdf.pdf(sample.pdfs) > 0.0);
        }
        let wi = crate::math::warp::sample_sphere(random.next_2d());
        if wi.dot(geometric) <= 0.0 {
            assert_eq!(bsdf.eval(wi).0.sum(), Vec3A::ZERO);
        }
    }
}

/// A shading normal that faces away from the viewer still reflects, upwards.
#[test]
fn nothing_is_scattered_by_a_black_surface() {
    let black = seen_under(0.7);
    let mut random = Random::new(9);
    for _ in 0..100 {
        assert!(black.sample(random.next(), random.next_2d()).is_none());
    }
}

#[test]
fn lobes_survive_a_shading_normal_seen_from_behind() {
    let wo = Vec3A::new(0.995, 0.0, 0.1).normalize();
    let normal = Vec3A::new(-0.4, 0.0, 0.9).normalize();
    assert!(wo.dot(normal) < 0.0);
    let mut bsdf = Bsdf::new(normal, Vec3A::Z, wo);
    bsdf.add_glossy(1.0, Vec3A::ONE, 0.05);
    let (mean, _) = furnace(&bsdf);
    assert!(mean.x > 0.5, "{mean}");
}

#[test]
fn more_lobes_than_there_is_room_for_keep_their_energy() {
    let mut bsdf = seen_under(0.8);
    for _ in 0..2 * MAX_LOBES {
        bsdf.add_glossy(0.5 / MAX_LOBES as f32, Vec3A::splat(0.6), 0.4);
    }
    let mut one = seen_under(0.8);
    one.add_glossy(1.0, Vec3A::splat(0.6), 0.4);
    assert!((bsdf.albedo() - one.albedo()).length() < 1e-5);
    let wi = Vec3A::new(-0.5, 0.1, 0.8).normalize();
    let (many, single) = (bsdf.eval(wi).0.glossy, one.eval(wi).0.glossy);
    assert!((many - single).length() < 1e-4 * single.length());
}

/// No input gives a NaN: mirrors, grazing views, extreme parameters.
#[test]
fn extreme_parameters_stay_finite() {
    let mut random = Random::new(9);
    for cos in [1e-7f32, 1e-3, 1.0] {
        for roughness in [-1.0, 0.0, 1e-6, 1.0, 5.0] {
            for ior in [0.0, 0.5, 1.0, 1.0001, 1e6] {
                for specular in [0.0, 0.5, 100.0] {
                    let mut bsdf = seen_under(cos);
                    let params = Principled {
                        base_color: Vec3A::new(0.0, 1.0, 2.0),
                        metallic: 0.5,
                        roughness,
                        ior,
                        specular,
                    };
                    bsdf.add_principled(1.0, &params);
                    for _ in 0..20 {
                        let u_lobe = random.next();
                        if let Some(sample) = bsdf.sample(u_lobe, random.next_2d()) {
                            let weight = sample.value.sum() / bsdf.pdf(sample.pdfs);
                            assert!(weight.is_finite(), "{params:?} {cos}: {sample:?}");
                        }
                    }
                }
            }
        }
    }
}

/// What Cycles 5.0.1 renders of a plane under a sun without size, by an orthographic camera: the
/// independent oracle of the whole material. Base colour (0.8, 0.3, 0.05), "Multiscatter GGX".
///
/// Rows: metallic, roughness, IOR and Specular IOR Level; cosine of the view and angle of the sun
/// [rad] on the other side of the normal; the pixel for an irradiance of 1.
type Row = ([f32; 4], [f32; 2], [f32; 3]);
#[rustfmt::skip]
const CYCLES_PRINCIPLED: &[Row] = &[
    ([0.0, 0.2, 1.5, 0.5], [0.9, 0.7], [0.207518, 0.090778, 0.032408]),
    ([0.0, 0.2, 1.5, 0.5], [0.3, 1.3], [26.5862, 26.5522, 26.5352]),
    ([0.0, 0.5, 1.5, 0.5], [0.9, 1.3], [0.071060, 0.030144, 0.009686]),
    ([0.0, 0.5, 1.5, 0.5], [0.3, 0.7], [0.231962, 0.123808, 0.069732]),
    ([0.0, 1.0, 1.5, 0.5], [0.3, 1.3], [0.083055, 0.041985, 0.021449]),
    ([1.0, 0.2, 1.5, 0.5], [0.3, 1.3], [99.9236, 51.2262, 27.0855]),
    ([1.0, 0.5, 1.5, 0.5], [0.9, 0.7], [0.795460, 0.284667, 0.046484]),
    ([1.0, 1.0, 1.5, 0.5], [0.3, 0.7], [0.137616, 0.040457, 0.007869]),
    ([0.5, 0.5, 1.5, 0.5], [0.3, 1.3], [1.944233, 1.110554, 0.740736]),
    ([0.5, 1.0, 1.5, 0.5], [0.9, 1.3], [0.068341, 0.021202, 0.004339]),
    ([0.0, 0.4, 1.33, 0.5], [0.5, 0.9], [0.337353, 0.243721, 0.196905]),
    ([0.0, 0.4, 2.0, 0.5], [0.5, 0.9], [0.745061, 0.660684, 0.618496]),
    ([0.0, 0.4, 1.5, 1.0], [0.5, 0.9], [0.624141, 0.537166, 0.493679]),
    ([0.0, 0.4, 1.5, 0.2], [0.5, 0.9], [0.310694, 0.216393, 0.169242]),
    ([0.0, 0.4, 1.5, 0.0], [0.5, 0.9], [0.158292, 0.059359, 0.009893]),
];

/// The same for the Glossy BSDF: roughness, directions, pixel.
#[rustfmt::skip]
const CYCLES_GLOSSY: &[(f32, [f32; 2], [f32; 3])] = &[
    (0.3, [0.9, 0.7], [1.054136, 0.393163, 0.065352]),
    (0.3, [0.3, 0.7], [0.240905, 0.087847, 0.014437]),
    (0.9, [0.9, 0.7], [0.173182, 0.042817, 0.005998]),
    (0.9, [0.3, 0.7], [0.209692, 0.062260, 0.009534]),
];

const CYCLES_COLOR: Vec3A = Vec3A::new(0.8, 0.3, 0.05);

/// Within 0.2 %: both interpolate tables of 32 and 16 steps that were filled by sampling.
fn assert_pixel(bsdf: &Bsdf, sun_angle: f32, pixel: [f32; 3], name: &str) {
    let wi = Vec3A::new(-sun_angle.sin(), 0.0, sun_angle.cos());
    let ours = bsdf.eval(wi).0.sum();
    let error = (ours / Vec3A::from(pixel) - 1.0).abs().max_element();
    assert!(error < 2e-3, "{name}: {ours}, Cycles {pixel:?}");
}

#[test]
fn materials_look_as_in_cycles() {
    for &([metallic, roughness, ior, specular], [cos, sun_angle], pixel) in CYCLES_PRINCIPLED {
        let params = Principled {
            base_color: CYCLES_COLOR,
            metallic,
            roughness,
            ior,
            specular,
        };
        let mut bsdf = seen_under(cos);
        bsdf.add_principled(1.0, &params);
        assert_pixel(&bsdf, sun_angle, pixel, &format!("{params:?}"));
    }
    for &(roughness, [cos, sun_angle], pixel) in CYCLES_GLOSSY {
        let mut bsdf = seen_under(cos);
        bsdf.add_glossy(1.0, CYCLES_COLOR, roughness);
        assert_pixel(&bsdf, sun_angle, pixel, &format!("glossy {roughness}"));
    }
}
