//! Vectors: Vector Math, Mapping, Vector Rotate.

use glam::{EulerRot, Mat3A, Quat, Vec3, Vec3A};

use super::super::operation::Args;
use super::convert::{modulo, power, sign, wrap};
use super::{divided, divided3, each2, names};

type VectorFunction = fn(Vec3A, Vec3A, Vec3A, f32) -> Vec3A;

/// The Vector Math node's operations by Blender's identifiers. Those that give a number write it to
/// all three components.
#[rustfmt::skip]
const VECTOR_MATH: [(&str, VectorFunction); 29] = [
    ("ADD", |a, b, _, _| a + b),
    ("SUBTRACT", |a, b, _, _| a - b),
    ("MULTIPLY", |a, b, _, _| a * b),
    ("DIVIDE", |a, b, _, _| divided3(a, b)),
    ("MULTIPLY_ADD", |a, b, c, _| a * b + c),
    ("CROSS_PRODUCT", |a, b, _, _| a.cross(b)),
    ("PROJECT", |a, b, _, _| b * divided(a.dot(b), b.length_squared())),
    ("REFLECT", |a, b, _, _| reflect(a, b.normalize_or_zero())),
    ("REFRACT", |a, b, _, ior| refract(a, b.normalize_or_zero(), ior)),
    ("FACEFORWARD", |a, b, c, _| if c.dot(b) < 0.0 { a } else { -a }),
    ("DOT_PRODUCT", |a, b, _, _| Vec3A::splat(a.dot(b))),
    ("DISTANCE", |a, b, _, _| Vec3A::splat(a.distance(b))),
    ("LENGTH", |a, _, _, _| Vec3A::splat(a.length())),
    ("SCALE", |a, _, _, scale| a * scale),
    ("NORMALIZE", |a, _, _, _| a.normalize_or_zero()),
    ("ABSOLUTE", |a, _, _, _| a.abs()),
    ("POWER", |a, b, _, _| each2(a, b, power)),
    ("SIGN", |a, _, _, _| a.map(sign)),
    ("MINIMUM", |a, b, _, _| a.min(b)),
    ("MAXIMUM", |a, b, _, _| a.max(b)),
    ("FLOOR", |a, _, _, _| a.floor()),
    ("CEIL", |a, _, _, _| a.ceil()),
    ("FRACTION", |a, _, _, _| a - a.floor()),
    ("MODULO", |a, b, _, _| each2(a, b, modulo)),
    ("WRAP", |a, b, c, _| Vec3A::new(wrap(a.x, b.x, c.x), wrap(a.y, b.y, c.y), wrap(a.z, b.z, c.z))),
    ("SNAP", |a, b, _, _| divided3(a, b).floor() * b),
    ("SINE", |a, _, _, _| a.map(f32::sin)),
    ("COSINE", |a, _, _, _| a.map(f32::cos)),
    ("TANGENT", |a, _, _, _| a.map(f32::tan)),
];

pub const VECTOR_MATH_NAMES: [&str; 29] = names(&VECTOR_MATH);

pub fn math(a: &Args) -> Vec3A {
    VECTOR_MATH[a.mode(0)].1(a.vector(0), a.vector(1), a.vector(2), a.float(3))
}

fn reflect(incident: Vec3A, normal: Vec3A) -> Vec3A {
    incident - 2.0 * incident.dot(normal) * normal
}

/// Snell's law; zero where all is reflected.
fn refract(incident: Vec3A, normal: Vec3A, ior: f32) -> Vec3A {
    let cos = incident.dot(normal);
    let k = 1.0 - ior * ior * (1.0 - cos * cos);
    if k < 0.0 {
        Vec3A::ZERO
    } else {
        ior * incident - (ior * cos + k.sqrt()) * normal
    }
}

/// Blender's Euler angles: about X, then Y, then Z.
pub fn rotation(angles: Vec3A) -> Mat3A {
    Mat3A::from_quat(Quat::from_euler(
        EulerRot::ZYX,
        angles.z,
        angles.y,
        angles.x,
    ))
}

pub fn mapping(a: &Args) -> Vec3A {
    let [vector, location, angles, scale] = std::array::from_fn(|i| a.vector(i));
    let turn = rotation(angles);
    match a.mode(0) {
        0 => turn * (vector * scale) + location,
        1 => divided3(turn.transpose() * (vector - location), scale),
        2 => turn * (vector * scale),
        _ => (turn * divided3(vector, scale)).normalize_or_zero(),
    }
}

pub fn rotate(a: &Args) -> Vec3A {
    let (vector, center) = (a.vector(0), a.vector(1));
    let is_inverse = a.is_on(1);
    let axis = match a.mode(0) {
        0 => a.vector(2),
        1 => Vec3A::X,
        2 => Vec3A::Y,
        3 => Vec3A::Z,
        _ => {
            let turn = rotation(a.vector(4));
            let turn = if is_inverse { turn.transpose() } else { turn };
            return turn * (vector - center) + center;
        }
    };
    let Some(axis) = Vec3::from(axis).try_normalize() else {
        return vector;
    };
    let angle = if is_inverse { -a.float(3) } else { a.float(3) };
    Mat3A::from_axis_angle(axis, angle) * (vector - center) + center
}

/// A vector through a matrix, given by its columns.
pub fn transform(a: &Args) -> Vec3A {
    let v = a.vector(0);
    a.vector(1) * v.x + a.vector(2) * v.y + a.vector(3) * v.z + a.vector(4)
}
