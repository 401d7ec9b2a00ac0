//! What camera rays tell for the passes that were asked for: one small function for each.
//!
//! What a pass is, its name and its channels stand in [`crate::contract::PASSES`]; how a film keeps
//! its numbers, in [`crate::film`].

mod denoising;

use glam::{Affine3A, Vec2, Vec3A};

use crate::accel::Hit;
use crate::film::{Extra, Layout, Region, Row};
use crate::math::Ray;
use crate::path::Divided;
use crate::scene::{Flow, SceneFrame, interpolate};
use crate::shader::RayInfo;
use crate::surface::{self, Surface};
pub use denoising::add_guides;

/// What a camera ray saw.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    /// The frame.
    pub frame: &'a SceneFrame,
    /// The rectangle that is rendered of it.
    pub region: Region,
    /// The surface, or the point of a medium; none where the background shows, or a hole.
    pub arrived: Option<&'a Surface>,
    /// The surface; none where a medium shows, the background or a hole.
    pub surface: Option<&'a Surface>,
    /// The surface that passes of data show: see [`Shown`].
    pub shown: &'a Shown<'a>,
    /// The ray; none outside of a fisheye's picture.
    pub ray: Option<&'a Ray>,
    /// What its programs may ask.
    pub info: &'a RayInfo<'a>,
    /// Share of its light that what lies in front lets pass, over the probability of seeing it.
    pub share: f32,
}

/// The surface that passes of what is seen show. As in Cycles they look through surfaces of less than
/// the view layer's opacity; what is left of them, if nothing denser follows, counts for passes of
/// one sample and not for means.
#[derive(Default)]
pub struct Shown<'a> {
    /// A surface that the camera ray passed, and that is shown in the place of its end.
    pub passed: Option<Box<Surface>>,
    /// The surface at the ray's end.
    pub end: Option<&'a Surface>,
    /// Whether it has the opacity.
    pub is_dense: bool,
}

impl Shown<'_> {
    /// The surface.
    pub fn surface(&self) -> Option<&Surface> {
        self.passed.as_deref().or(self.end)
    }

    /// The surface, if it has the opacity.
    pub fn dense(&self) -> Option<&Surface> {
        self.surface().filter(|_| self.is_dense)
    }
}

/// What a pass shows of it; nothing where there is nothing to add.
type Show = fn(&Seen) -> Option<[f32; 4]>;

/// The passes of what is seen, whatever light falls on it.
const DATA: &[(Row, Show)] = &[
    (Row::of("Mist"), mist),
    (Row::of("Position"), position),
    (Row::of("Vector"), vector),
    (Row::of("UV"), uv),
    (Row::of("Object Index"), object_index),
    (Row::of("Material Index"), material_index),
];

/// Adds what a camera ray saw to the passes that are kept.
pub fn add_data(extra: &mut Extra, iteration: u32, seen: &Seen) {
    for (row, show) in DATA {
        if extra.layout.keeps(*row)
            && let Some(values) = show(seen)
        {
            extra.add(*row, iteration, &values);
        }
    }
}

const OBJECT: Row = Row::of("CryptoObject");
const MATERIAL: Row = Row::of("CryptoMaterial");
const ASSET: Row = Row::of("CryptoAsset");

/// Adds the names of what a camera ray saw, weighted by how much of it is seen.
pub fn add_mattes(extra: &mut Extra, seen: &Seen) {
    let Some(surface) = seen.surface else {
        return;
    };
    let weight = seen.share * (1.0 - surface.holdout);
    let (hit, mattes) = (&surface.hit, &seen.frame.passes.mattes);
    if !(weight > 0.0) {
        return;
    }
    if let Some(&[object, asset]) = mattes.instances.get(hit.instance as usize) {
        extra.add_ranked(OBJECT, object, weight);
        extra.add_ranked(ASSET, asset, weight);
    }
    let material = seen.frame.material_number_of(hit.instance, hit.triangle);
    if let Some(&name) = material.and_then(|number| mattes.materials.get(number as usize)) {
        extra.add_ranked(MATERIAL, name, weight);
    }
}

const OUTPUT_COLOR: Row = Row::of("AOV Color");
const OUTPUT_VALUE: Row = Row::of("AOV Value");

/// Adds what the nodes of the surface send to passes of the user's own.
pub fn add_outputs(extra: &mut Extra, iteration: u32, seen: &Seen) {
    let layout = extra.layout;
    let (Some(surface), Some(ray)) = (seen.shown.surface(), seen.ray) else {
        return;
    };
    if !layout.keeps(OUTPUT_COLOR) && !layout.keeps(OUTPUT_VALUE) {
        return;
    }
    surface::outputs(
        seen.frame,
        &surface.hit,
        ray,
        seen.info,
        &mut |name, color, value| {
            if let Some(key) = layout.key_of(OUTPUT_COLOR, name) {
                extra.add_to(OUTPUT_COLOR, key, iteration, &color.extend(1.0).to_array());
            }
            if let Some(key) = layout.key_of(OUTPUT_VALUE, name) {
                extra.add_to(OUTPUT_VALUE, key, iteration, &[value]);
            }
        },
    );
}

/// Diffuse, glossy, transmission; each straight from its source, by way of other surfaces, and the
/// colour that both are divided by.
const SCATTERED: [[Row; 3]; 3] = [
    [
        Row::of("Diffuse Direct"),
        Row::of("Diffuse Indirect"),
        Row::of("Diffuse Color"),
    ],
    [
        Row::of("Glossy Direct"),
        Row::of("Glossy Indirect"),
        Row::of("Glossy Color"),
    ],
    [
        Row::of("Transmission Direct"),
        Row::of("Transmission Indirect"),
        Row::of("Transmission Color"),
    ],
];
/// The same for media, which are no part of that: straight from its source, by way of other places.
const MEDIUM: [Row; 2] = [Row::of("Volume Direct"), Row::of("Volume Indirect")];
/// What ambient light reaches the surface.
pub const AMBIENT: Row = Row::of("Ambient Occlusion");
const EMISSION: Row = Row::of("Emission");
const ENVIRONMENT: Row = Row::of("Environment");

const GROUP: Row = Row::of("Light Group");

/// Whether a pass shows a light group.
pub fn wants_groups(layout: &Layout) -> bool {
    layout.keeps(GROUP)
}

/// Adds light of a group to its pass, if there is one.
pub fn add_group(extra: &mut Extra, iteration: u32, group: u8, light: Vec3A) {
    if let Some(key) = extra.layout.key_of(GROUP, u32::from(group)) {
        extra.add_to(GROUP, key, iteration, &light.to_array());
    }
}

/// Whether a pass asks how surfaces scattered the light that they send to the camera.
pub fn wants_scattered(layout: &Layout) -> bool {
    let rows = SCATTERED
        .iter()
        .flat_map(|[direct, indirect, _]| [direct, indirect])
        .chain(&MEDIUM);
    layout.stride() > 0 && rows.into_iter().any(|row| layout.keeps(*row))
}

/// Adds light that media scattered straight from its source to the camera, before the ray's end.
pub fn add_in_scattered(extra: &mut Extra, iteration: u32, light: Vec3A) {
    extra.add(MEDIUM[0], iteration, &light.to_array());
}

/// Adds light that a surface sent to the camera.
pub fn add_scattered(extra: &mut Extra, iteration: u32, light: &Divided) {
    if light.is_of_medium {
        for (row, parts) in MEDIUM.iter().zip([&light.direct, &light.indirect]) {
            let sum: Vec3A = parts.iter().sum();
            extra.add(*row, iteration, &sum.to_array());
        }
        return;
    }
    let parts = SCATTERED
        .iter()
        .zip(light.direct.iter().zip(&light.indirect));
    for ([in_direct, in_indirect, _], (direct, indirect)) in parts {
        extra.add(*in_direct, iteration, &direct.to_array());
        extra.add(*in_indirect, iteration, &indirect.to_array());
    }
}

/// Adds the colours of a surface.
pub fn add_colors(extra: &mut Extra, iteration: u32, surface: &Surface) {
    for ([_, _, row], color) in SCATTERED.iter().zip(surface.colors()) {
        extra.add(*row, iteration, &color.to_array());
    }
}

/// Adds light that the camera sees where it comes from.
pub fn add_seen_light(extra: &mut Extra, iteration: u32, emission: Vec3A, environment: Vec3A) {
    extra.add(EMISSION, iteration, &emission.to_array());
    extra.add(ENVIRONMENT, iteration, &environment.to_array());
}

fn mist(seen: &Seen) -> Option<[f32; 4]> {
    let hidden = seen.surface.map_or(1.0, |surface| {
        let distance = seen.frame.camera.distance(surface.position);
        seen.frame.passes.mist.at(distance)
    });
    Some([hidden, 0.0, 0.0, 0.0])
}

fn position(seen: &Seen) -> Option<[f32; 4]> {
    let [x, y, z] = seen.shown.surface()?.position.to_array();
    Some([x, y, z, 0.0])
}

fn uv(seen: &Seen) -> Option<[f32; 4]> {
    let hit = &seen.shown.dense()?.hit;
    let corners = &seen.frame.mesh_of(hit.instance).faces[hit.triangle as usize].uvs;
    // A mesh without a map has zeros at all corners.
    if *corners == [Vec2::ZERO; 3] {
        return None;
    }
    let uv = interpolate(corners, Vec2::new(hit.u, hit.v));
    Some([uv.x, uv.y, 1.0, 0.0])
}

fn object_index(seen: &Seen) -> Option<[f32; 4]> {
    let instance = seen.shown.surface()?.hit.instance as usize;
    Some([seen.frame.instances[instance].info.index, 0.0, 0.0, 0.0])
}

fn material_index(seen: &Seen) -> Option<[f32; 4]> {
    let hit = &seen.shown.surface()?.hit;
    let material = seen.frame.material_of(hit.instance, hit.triangle)?;
    Some([material.pass_index, 0.0, 0.0, 0.0])
}

/// The way in the picture, as in Cycles: what is blurred moves as in the middle of the shutter's
/// time, and the background with the turning of the camera.
fn vector(seen: &Seen) -> Option<[f32; 4]> {
    let flow = seen.frame.passes.flow.as_ref()?;
    let [before, now, after] = match seen.shown.surface() {
        Some(_) if !seen.shown.is_dense => return None,
        Some(surface) => surface_on_film(seen.frame, flow, &surface.hit),
        None => {
            let [before, after] = &flow.cameras;
            [before, &seen.frame.camera, after].map(|c| c.project_direction(seen.ray?.direction))
        }
    };
    let Region {
        frame_width,
        frame_height,
        ..
    } = seen.region;
    let size = Vec2::new(frame_width as f32, frame_height as f32);
    // What is not seen there has no way to here.
    let way = |from: Option<Vec2>, to: Option<Vec2>| match (from, to) {
        (Some(from), Some(to)) => (from - to) * size,
        _ => Vec2::ZERO,
    };
    let (before, after) = (way(before, now), way(now, after));
    Some([before.x, before.y, after.x, after.y])
}

/// Where the point of a hit is in the frame before, in its own and in the one after.
fn surface_on_film(frame: &SceneFrame, flow: &Flow, hit: &Hit) -> [Option<Vec2>; 3] {
    let instance = &frame.instances[hit.instance as usize];
    let mesh = frame.mesh_of(hit.instance);
    let corners = mesh.corners(hit.triangle);
    let now = instance.placement.world_from_object;
    let point = |placement: Affine3A, corners| {
        placement.transform_point3a(interpolate(&corners, Vec2::new(hit.u, hit.v)))
    };
    let at = |side: usize| {
        let there = match &flow.moved[hit.instance as usize] {
            None => point(now, corners),
            Some(moved) => {
                let vertices = mesh.triangles[hit.triangle as usize];
                let form = flow.corners(side, moved, vertices).unwrap_or(corners);
                point(moved.placements[side], form)
            }
        };
        flow.cameras[side].project(there)
    };
    [at(0), frame.camera.project(point(now, corners)), at(1)]
}
