//! Meshes of many triangles that glow.

use super::*;
use crate::sampling::lights::mesh::MeshLight;

/// A ball of squares around the origin, cut along circles of latitude and longitude; each corner is a vertex
/// of its own, as after export.
fn ball(rows: u32, columns: u32) -> (Vec<f32>, Vec<u32>) {
    let at = |row: u32, column: u32| {
        let polar = PI * row as f32 / rows as f32;
        // The poles and the seam are at one place, to the bit.
        let (sin, cos) = match row {
            0 => (0.0, 1.0),
            _ if row == rows => (0.0, -1.0),
            _ => polar.sin_cos(),
        };
        let around = 2.0 * PI * (column % columns) as f32 / columns as f32;
        [sin * around.cos(), sin * around.sin(), cos]
    };
    let mut vertices = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            if row > 0 {
                vertices.extend([a, c, b].concat());
            }
            if row + 1 < rows {
                vertices.extend([b, c, d].concat());
            }
        }
    }
    let triangles = (0..vertices.len() as u32 / 3).collect();
    (vertices, triangles)
}

fn ball_at(scale: f32, center: Vec3, radiance: f32) -> SceneFrame {
    let (vertices, triangles) = ball(24, 48);
    let placement = Affine3A::from_scale_rotation_translation(
        Vec3::splat(scale),
        Quat::from_rotation_x(0.3),
        center,
    );
    let slots = vec![0; triangles.len() / 3];
    // Its material gives half of what it is given.
    glowing(&vertices, &triangles, &slots, &[2.0 * radiance], placement)
}

/// A ball gives pi L sin^2 to a plane that faces it; up to a per cent is missing between the squares. Chosen by
/// power alone, both sides of its triangles have an error of 6.5 for one sample at the first distance.
#[test]
fn a_glowing_ball_is_sampled_where_it_can_be_seen() {
    for (distance, most) in [(1.2f32, 2.5), (2.0, 1.5), (10.0, 1.3)] {
        let lights = LightSampler::build(&ball_at(1.0, Vec3::Z * distance, 3.0), None);
        let expected = PI * 3.0 / (distance * distance);
        let (mean, sigma) = seen_from_outside(&lights, distance);
        assert!(
            (mean / expected - 1.0).abs() < 0.01,
            "{distance}: {mean} {expected}"
        );
        let error_of_one = sigma * 200_000f32.sqrt() / mean;
        assert!(error_of_one < most, "{distance}: {error_of_one}");
    }
}

/// Irradiance at the origin of what does not lie behind the ball's own horizon.
fn seen_from_outside(lights: &LightSampler, distance: f32) -> (f32, f32) {
    let mut random = Random::new(3);
    let samples = 200_000;
    let (mut sum, mut squares) = (0.0f64, 0.0f64);
    let horizon = (distance * distance - 1.0).sqrt() + 1e-3;
    for _ in 0..samples {
        let drawn = draw(lights, Vec3A::ZERO, Vec3A::Z, &mut random);
        let seen = drawn.filter(|light| light.distance < horizon);
        let value = seen.map_or(0.0, |light| {
            let cos = light.direction.z.max(0.0);
            f64::from(light.radiance.unwrap().y * cos / light.pdf_solid_angle)
        });
        sum += value;
        squares += value * value;
    }
    let count = f64::from(samples);
    let mean = sum / count;
    let sigma = ((squares / count - mean * mean) / count).sqrt();
    (mean as f32, sigma as f32)
}

/// Every triangle is drawn as often as its density says, which rays that meet it ask for.
#[test]
fn densities_are_those_of_the_samples() {
    for (scale, center) in [
        (1.0, Vec3::Z * 1.1),
        (30.0, Vec3::Z * 10.0),
        (0.1, Vec3::Z * 3.0),
    ] {
        let frame = ball_at(scale, center, 3.0);
        let light = MeshLight::new(&frame, 0, None).unwrap();
        let receiver = receiver_at(Vec3A::ZERO, Vec3A::new(0.6, 0.0, 0.8));
        let mut random = Random::new(4);
        let (count, mut total, mut seen) = (2_000, 0.0, 0.0);
        for _ in 0..count {
            let (u, [v, w]) = (random.next(), random.next_2d());
            let Some(sample) = light.sample(&receiver, u, [v, w]) else {
                continue;
            };
            let point = sample.distance * sample.direction;
            let found = (0..frame.meshes[0].triangles.len() as u32)
                .map(|triangle| (facet_distance(&frame, triangle, point), triangle))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap()
                .1;
            let pdf = light.pdf_of_triangle(&receiver, found, point);
            let ratio = pdf / sample.pdf_solid_angle;
            // Next to an edge the neighbour may be nearer by rounding.
            total += 1.0;
            seen += f32::from(u8::from((ratio - 1.0).abs() < 1e-3));
        }
        assert!(
            total > 0.3 * count as f32 && seen > 0.98 * total,
            "{scale}: {seen} of {total}"
        );
    }
}

/// How far a point is from the triangle: outside of its sides, and off its plane.
fn facet_distance(frame: &SceneFrame, triangle: u32, point: Vec3A) -> f32 {
    let placement = &frame.instances[0].placement.world_from_object;
    let corners = frame.meshes[0].corners(triangle);
    let corners = corners.map(|corner| placement.transform_point3a(corner));
    let normal = (corners[1] - corners[0])
        .cross(corners[2] - corners[0])
        .normalize();
    let outside = (0..3).map(|k| {
        let side = (corners[(k + 1) % 3] - corners[k]).normalize();
        normal.cross(side).dot(corners[k] - point)
    });
    outside.fold((point - corners[0]).dot(normal).abs(), f32::max)
}

/// What is closed, glows all over and is looked at from outside is sampled on the outer side alone.
#[test]
fn only_closed_meshes_leave_their_inner_side_to_rays() {
    let is_sampled = |frame: &SceneFrame, from: Vec3A, normal: Vec3A| {
        let light = MeshLight::new(frame, 0, None).unwrap();
        let receiver = receiver_at(from, normal);
        let mut random = Random::new(5);
        (0..200).any(|_| {
            light
                .sample(&receiver, random.next(), random.next_2d())
                .is_some()
        })
    };
    let center = Vec3::Z * 3.0;
    let inside = |frame: &SceneFrame| is_sampled(frame, center.into(), Vec3A::Z);
    let closed = ball_at(1.0, center, 3.0);
    assert!(!inside(&closed) && is_sampled(&closed, Vec3A::ZERO, Vec3A::Z));

    let around_camera = ball_at(9.0, center, 3.0);
    assert!(inside(&around_camera));

    let (vertices, triangles) = ball(24, 48);
    let mut slots = vec![0; triangles.len() / 3];
    let placement = Affine3A::from_translation(center);
    slots[5] = 1;
    assert!(inside(&glowing(
        &vertices,
        &triangles,
        &slots,
        &[6.0, 0.0],
        placement
    )));

    let mut see_through = ball_at(1.0, center, 3.0);
    see_through.materials[0] = Material::of(&[
        ("emission", &[("Weight", 0.5), ("Color", 6.0)]),
        ("transparent", &[("Weight", 0.5), ("Color", 1.0)]),
    ]);
    assert!(see_through.materials[0].is_see_through() && inside(&see_through));

    let mut no_shadow = ball_at(1.0, center, 3.0);
    no_shadow.instances[0].visibility = Visibility::ALL.without(RayKind::Shadow);
    assert!(inside(&no_shadow));

    let open = triangles.len() - 3;
    let slots = vec![0; open / 3];
    assert!(inside(&glowing(
        &vertices,
        &triangles[..open],
        &slots,
        &[6.0],
        placement
    )));
}

/// Frames share what a glowing mesh is drawn from while it stays as it is, and no longer.
#[test]
fn what_stays_as_it_is_is_made_once() {
    let shape_of = |frame: &SceneFrame, previous| {
        let light = MeshLight::new(frame, 0, previous).unwrap();
        light.shape().clone()
    };
    let frame = ball_at(1.0, Vec3::Z * 3.0, 3.0);
    let shape = shape_of(&frame, None);
    let is_shared = |frame: &SceneFrame| Arc::ptr_eq(&shape, &shape_of(frame, Some(&shape)));
    assert!(is_shared(&frame));

    let changed = |change: &dyn Fn(&mut SceneFrame)| {
        let mut frame = frame.clone();
        change(&mut frame);
        frame
    };
    assert!(is_shared(&changed(&|frame| frame.lights = vec![])));
    let moved = Placement::new(Affine3A::from_translation(Vec3::Z));
    assert!(!is_shared(&changed(
        &|frame| frame.instances[0].placement = moved
    )));
    let other = ball_at(1.0, Vec3::Z * 3.0, 4.0);
    assert!(!is_shared(&changed(
        &|frame| frame.materials = other.materials.clone()
    )));
    assert!(!is_shared(&changed(
        &|frame| frame.meshes = other.meshes.clone()
    )));
    let nodes = changed(&|frame| {
        frame.materials[0].emission = lamp_with(point_lamp(0.0, true), PLACE, &[[1.0; 3]])
            .materials[0]
            .emission
            .clone();
    });
    let lit_by_nodes = shape_of(&nodes, None);
    assert!(!Arc::ptr_eq(
        &lit_by_nodes,
        &shape_of(&nodes, Some(&lit_by_nodes))
    ));
}
