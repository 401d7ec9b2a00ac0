//! What is known of the point, the object, the camera and the ray.

use glam::{Vec3A, Vec4};

use super::super::operation::Args;
use super::super::point::{Point, RayInfo, RayKind, Search};
use super::super::strand::{STRAND, STRAND_INFO, Strand};
use super::hash;

fn layer(a: &Args) -> Vec4 {
    a.point.attribute(a.parameter).unwrap_or_default()
}

pub fn attribute(a: &Args) -> Vec3A {
    Vec3A::from_vec4(layer(a))
}

/// One where there is no such layer.
pub fn attribute_or_one(a: &Args) -> Vec3A {
    Vec3A::from_vec4(a.point.attribute(a.parameter).unwrap_or(Vec4::ONE))
}

pub fn attribute_alpha(a: &Args) -> Vec3A {
    Vec3A::splat(layer(a).w)
}

pub fn geometry(a: &Args) -> Vec3A {
    let p = a.point;
    match a.mode(0) {
        0 => p.position,
        1 => p.normal,
        2 => p.geometric_normal,
        3 => p.incoming,
        4 => Vec3A::new(1.0 - p.barycentric.element_sum(), p.barycentric.x, 0.0),
        _ => Vec3A::splat(f32::from(p.is_back)),
    }
}

/// In camera space, looking along +Z as Cycles does.
fn camera_position(p: &Point) -> Vec3A {
    let v = p.view.camera_from_world().transform_point3a(p.position);
    Vec3A::new(v.x, v.y, -v.z)
}

pub fn coordinate(a: &Args) -> Vec3A {
    let p = a.point;
    match a.mode(0) {
        0 => (p.world_from_object.matrix3.transpose() * p.normal).normalize_or_zero(),
        1 => p.object_from_world.transform_point3a(p.position),
        2 => camera_position(p),
        3 => p
            .view
            .project(p.position)
            .unwrap_or_default()
            .extend(0.0)
            .into(),
        _ => 2.0 * p.normal.dot(p.incoming) * p.normal - p.incoming,
    }
}

pub fn object_info(a: &Args) -> Vec3A {
    let object = a.point.object;
    match a.mode(0) {
        0 => a.point.world_from_object.translation,
        1 => Vec3A::from_vec4(object.color),
        2 => Vec3A::splat(object.color.w),
        3 => Vec3A::splat(object.index),
        _ => Vec3A::splat(object.random),
    }
}

/// Of the particle that the instance shows; zeros without one.
pub fn particle_info(a: &Args) -> Vec3A {
    let Some(particle) = &a.point.object.particle else {
        return Vec3A::ZERO;
    };
    Vec3A::splat(match a.mode(0) {
        0 => particle.index,
        1 => hash_of_number(particle.index),
        2 => particle.age,
        3 => particle.lifetime,
        4 => return particle.location,
        5 => particle.size,
        6 => return particle.velocity,
        _ => return particle.angular_velocity,
    })
}

/// Cycles' random number, 0 to 1, of the strand or particle of a number.
fn hash_of_number(number: f32) -> f32 {
    hash::words(&[number.round() as u32, 0]) as f32 / u32::MAX as f32
}

/// Of a strand; all zeros elsewhere.
pub fn hair_info(a: &Args) -> Vec3A {
    let p = a.point;
    let info = || p.attribute(STRAND_INFO).unwrap_or_default();
    let number = match a.mode(0) {
        0 => f32::from(p.attribute(STRAND).is_some()),
        1 => info().x,
        2 => info().y,
        3 => Strand::at(p).map_or(0.0, |strand| 2.0 * strand.radius),
        4 => {
            let across = |s: Strand| p.incoming - p.incoming.dot(s.tangent) * s.tangent;
            return Strand::at(p).map_or(Vec3A::ZERO, |s| across(s).normalize_or_zero());
        }
        _ => match p.attribute(STRAND_INFO) {
            Some(info) => hash_of_number(info.z),
            None => 0.0,
        },
    };
    Vec3A::splat(number)
}

pub fn camera_data(a: &Args) -> Vec3A {
    let v = camera_position(a.point);
    match a.mode(0) {
        0 => v.normalize_or_zero(),
        1 => Vec3A::splat(v.z),
        _ => Vec3A::splat(v.length()),
    }
}

/// Share of directions in which nothing is near. Modes: inside the surface; by its own object only.
pub fn ambient_occlusion(a: &Args) -> Vec3A {
    let p = a.point;
    let search = Search {
        distance: a.float(0),
        count: a.float(2) as u32,
        is_local: a.is_on(1),
    };
    let normal = a.vector(1).try_normalize().unwrap_or(p.normal);
    let normal = if a.is_on(0) { -normal } else { normal };
    let open = match p.ray.around {
        Some(around) if search.distance > 0.0 && search.count > 0 => {
            around.openness(p, normal, &search)
        }
        _ => 1.0,
    };
    Vec3A::splat(open)
}

/// The normal of a surface whose edges are round. A bent normal stays as bent as it is.
pub fn bevel(a: &Args) -> Vec3A {
    let (p, radius, count) = (a.point, a.float(0), a.float(2) as u32);
    let bent = a.vector(1).try_normalize().unwrap_or(p.normal);
    let rounded = match p.ray.around {
        Some(around) if radius > 0.0 && count > 0 => around.rounded(p, radius, count),
        _ => None,
    };
    match rounded {
        Some(rounded) => (bent + rounded - p.normal).normalize_or(bent),
        None => bent,
    }
}

/// One on the edges of triangles, which are as wide as the operand says [m, or with the mode on
/// pixels]: a half on each side.
pub fn wireframe(a: &Args) -> Vec3A {
    let [e, f] = a.point.edges;
    let b = a.point.barycentric;
    let area = e.cross(f).length();
    let weights = [1.0 - b.element_sum(), b.x, b.y];
    let opposite = [f - e, f, e].map(Vec3A::length);
    // A corner's weight is the distance from the edge that it is not on, over its height.
    let unit = if a.is_on(0) { seen_pixel(a.point) } else { 1.0 };
    let half = 0.5 * unit * a.float(0);
    let is_near = |(weight, length): (&f32, f32)| weight.abs() * area < half * length;
    let is_on_edge = weights.iter().zip(opposite).any(is_near);
    Vec3A::splat(f32::from(is_on_edge))
}

/// Width of a pixel's footprint on the surface, as the viewer sees it [m].
fn seen_pixel(p: &Point) -> f32 {
    let (x, y) = p.geometric_normal.any_orthonormal_pair();
    let seen = [x, y].map(|axis| (axis - axis.dot(p.incoming) * p.incoming).length());
    0.5 * (seen[0] + seen[1]) * p.view.pixel_size(p.ray_length)
}

type RayQuestion = fn(&RayInfo) -> f32;

/// Outputs of the Light Path node that the ray answers.
const LIGHT_PATH: [(&str, RayQuestion); 12] = [
    ("Is Camera Ray", |ray| is_kind(ray, RayKind::Camera)),
    ("Is Shadow Ray", |ray| is_kind(ray, RayKind::Shadow)),
    ("Is Diffuse Ray", |ray| is_kind(ray, RayKind::Diffuse)),
    ("Is Glossy Ray", |ray| f32::from(ray.is_glossy())),
    ("Is Singular Ray", |ray| f32::from(ray.is_singular)),
    ("Is Reflection Ray", |ray| f32::from(ray.is_reflection())),
    ("Is Transmission Ray", |ray| {
        is_kind(ray, RayKind::Transmission)
    }),
    ("Ray Depth", |ray| ray.depth as f32),
    ("Diffuse Depth", |ray| ray.diffuse_depth as f32),
    ("Glossy Depth", |ray| ray.glossy_depth as f32),
    ("Transparent Depth", |ray| ray.transparent_depth as f32),
    ("Transmission Depth", |ray| ray.transmission_depth as f32),
];

const LENGTH: usize = LIGHT_PATH.len();

pub const LIGHT_PATH_NAMES: [&str; LENGTH + 1] = {
    let mut names = ["Ray Length"; LENGTH + 1];
    let known = super::names(&LIGHT_PATH);
    let mut row = 0;
    while row < LENGTH {
        names[row] = known[row];
        row += 1;
    }
    names
};

fn is_kind(ray: &RayInfo, kind: RayKind) -> f32 {
    f32::from(ray.kind == kind)
}

pub fn light_path(a: &Args) -> Vec3A {
    let question = LIGHT_PATH.get(a.mode(0));
    Vec3A::splat(question.map_or(a.point.ray_length, |(_, ask)| ask(a.point.ray)))
}

/// A lamp's strength that falls by another power of the distance than two.
pub fn light_falloff(a: &Args) -> Vec3A {
    let (strength, smooth) = (a.float(0), a.float(1));
    let distance_squared = a.point.ray_length * a.point.ray_length;
    let factor = match a.mode(0) {
        0 => 1.0,
        1 => a.point.ray_length,
        _ => distance_squared,
    };
    let near = if smooth > 0.0 && distance_squared.is_finite() {
        distance_squared / (smooth + distance_squared)
    } else {
        1.0
    };
    Vec3A::splat(strength * factor * near)
}

/// Modes: point, vector or normal; from and to world, object or camera.
pub fn vector_transform(a: &Args) -> Vec3A {
    let (v, p) = (a.vector(0), a.point);
    let (kind, from, to) = (a.mode(0), a.mode(1), a.mode(2));
    if from == to {
        return v;
    }
    let flip = |v: Vec3A| Vec3A::new(v.x, v.y, -v.z);
    let camera_from_world = p.view.camera_from_world();
    let world = match (from, kind) {
        (0, _) => v,
        (1, 0) => p.world_from_object.transform_point3a(v),
        (1, 1) => p.world_from_object.transform_vector3a(v),
        (1, _) => (p.object_from_world.matrix3.transpose() * v).normalize_or_zero(),
        (_, 0) => camera_from_world.inverse().transform_point3a(flip(v)),
        (_, 1) => camera_from_world.inverse().transform_vector3a(flip(v)),
        _ => (camera_from_world.matrix3.transpose() * flip(v)).normalize_or_zero(),
    };
    match (to, kind) {
        (0, _) => world,
        (1, 0) => p.object_from_world.transform_point3a(world),
        (1, 1) => p.object_from_world.transform_vector3a(world),
        (1, _) => (p.world_from_object.matrix3.transpose() * world).normalize_or_zero(),
        (_, 0) => flip(camera_from_world.transform_point3a(world)),
        (_, 1) => flip(camera_from_world.transform_vector3a(world)),
        _ => flip((camera_from_world.matrix3 * world).normalize_or_zero()),
    }
}
