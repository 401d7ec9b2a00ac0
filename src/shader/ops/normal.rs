//! What depends on the normal, and what bends it.

use glam::{Mat3A, Vec3A};

use super::super::operation::Args;
use super::super::point::Point;
use super::lerp;

/// The normal given, or the surface's own in the place of zero.
fn normal_or_own(point: &Point, given: Vec3A) -> Vec3A {
    if given == Vec3A::ZERO {
        point.normal
    } else {
        given
    }
}

/// The unit normal given, or the surface's own where there is none.
pub(super) fn unit_normal(point: &Point, given: Vec3A) -> Vec3A {
    given.try_normalize().unwrap_or(point.normal)
}

/// Share that a smooth dielectric reflects; `eta` is the index of the far side over the near one.
fn fresnel_dielectric(cos: f32, eta: f32) -> f32 {
    let cos = cos.abs();
    let squared = eta * eta - 1.0 + cos * cos;
    if squared <= 0.0 {
        return 1.0;
    }
    let g = squared.sqrt();
    let a = (g - cos) / (g + cos);
    let b = (cos * (g + cos) - 1.0) / (cos * (g - cos) + 1.0);
    0.5 * a * a * (1.0 + b * b)
}

pub fn fresnel(a: &Args) -> Vec3A {
    let eta = a.float(0).max(1e-5);
    let eta = if a.point.is_back { 1.0 / eta } else { eta };
    let cos = a.point.incoming.dot(normal_or_own(a.point, a.vector(1)));
    Vec3A::splat(fresnel_dielectric(cos, eta))
}

pub fn layer_weight(a: &Args) -> Vec3A {
    let blend = a.float(0);
    let cos = a.point.incoming.dot(normal_or_own(a.point, a.vector(1)));
    if a.mode(0) == 0 {
        let eta = (1.0 - blend).max(1e-5);
        let eta = if a.point.is_back { eta } else { 1.0 / eta };
        return Vec3A::splat(fresnel_dielectric(cos, eta));
    }
    let blend = blend.clamp(0.0, 1.0 - 1e-5);
    let exponent = if blend < 0.5 {
        2.0 * blend
    } else {
        0.5 / (1.0 - blend)
    };
    Vec3A::splat(1.0 - cos.abs().powf(exponent))
}

/// World space from the object's normals; unit length.
fn world_normal(point: &Point, normal_object: Vec3A) -> Vec3A {
    (point.object_from_world.matrix3.transpose() * normal_object).normalize_or_zero()
}

pub fn normal_map(a: &Args) -> Vec3A {
    let (strength, point) = (a.float(0), a.point);
    let color = 2.0 * a.vector(1) - 1.0;
    let side = if point.is_back { -1.0 } else { 1.0 };
    let bent = match a.mode(0) {
        0 => {
            let (tangent, sign) = (a.vector(2), a.float(3));
            if tangent == Vec3A::ZERO {
                return point.normal;
            }
            let normal = point.normal_object;
            let bitangent = sign * normal.cross(tangent);
            let z = lerp(1.0, color.z, strength.clamp(0.0, 1.0));
            let local = Vec3A::new(color.x * strength, color.y * strength, z);
            let axes = Mat3A::from_cols(tangent, bitangent, normal);
            side * world_normal(point, axes * local)
        }
        space => {
            // Blender's own baked maps count Y and Z the other way.
            let flip = if space >= 3 {
                Vec3A::new(1.0, -1.0, -1.0)
            } else {
                Vec3A::ONE
            };
            let color = color * flip;
            let mapped = if space % 2 == 1 {
                world_normal(point, color)
            } else {
                color.normalize_or_zero()
            };
            let mapped = side * mapped;
            (point.normal + (mapped - point.normal) * strength.max(0.0)).normalize_or_zero()
        }
    };
    if bent.is_finite() {
        normal_or_own(point, bent)
    } else {
        point.normal
    }
}

/// The normal of the surface lifted by a height, from the height at the point and its neighbours.
///
/// After Mikkelsen, "Bump Mapping Unparametrized Surfaces on the GPU" (JGT 2010), as in Cycles.
pub fn bump(a: &Args) -> Vec3A {
    let [strength, distance] = a.floats();
    let normal = normal_or_own(a.point, a.vector(2));
    let [x, y] = match a.is_on(1) {
        true => a.point.undisplaced_steps(),
        false => a.point.steps(),
    };
    let (along_x, along_y) = (y.cross(normal), normal.cross(x));
    let height = a.float(3);
    let gradient = (a.float(4) - height) * along_x + (a.float(5) - height) * along_y;
    let determinant = x.dot(along_x);
    let distance = if a.is_on(0) { -distance } else { distance };
    let lifted = determinant.abs() * normal - distance * determinant.signum() * gradient;
    let Some(lifted) = lifted.try_normalize() else {
        return normal;
    };
    let strength = strength.max(0.0);
    (strength * lifted + (1.0 - strength) * normal).normalize_or(normal)
}

/// Where a displaced point goes, in world space; object space gives the object's units.
pub fn displacement(a: &Args) -> Vec3A {
    let [height, midlevel, scale] = a.floats();
    let (distance, point) = ((height - midlevel) * scale, a.point);
    let normal = normal_or_own(point, a.vector(3));
    if a.mode(0) == 1 {
        return distance * normal;
    }
    let normal_object = (point.world_from_object.matrix3.transpose() * normal).normalize_or_zero();
    point
        .world_from_object
        .transform_vector3a(distance * normal_object)
}

/// The same by a vector: in the object's space, in world space, or along tangent, normal and
/// bitangent of a UV map.
pub fn vector_displacement(a: &Args) -> Vec3A {
    let (point, mode) = (a.point, a.mode(0));
    let moved = (a.vector(0) - a.float(1)) * a.float(2);
    if mode == 2 {
        return moved;
    }
    let moved = match mode {
        0 => {
            let normal = point.world_from_object.matrix3.transpose() * point.normal;
            let normal = normal.normalize_or_zero();
            let tangent = a.vector(3).try_normalize();
            let tangent = tangent.unwrap_or_else(|| normal.any_orthonormal_vector());
            let bitangent = a.float(4) * normal.cross(tangent).normalize_or_zero();
            Mat3A::from_cols(tangent, normal, bitangent) * moved
        }
        _ => moved,
    };
    point.world_from_object.transform_vector3a(moved)
}

/// How far a displacement lifts the surface.
pub fn height(a: &Args) -> Vec3A {
    Vec3A::splat(a.vector(0).dot(a.point.normal))
}

/// World space, at right angles to the normal.
fn as_tangent(point: &Point, tangent_object: Vec3A) -> Vec3A {
    let tangent = world_normal(point, tangent_object);
    point
        .normal
        .cross(tangent.cross(point.normal).normalize_or_zero())
}

/// Along the first axis of a UV map.
pub fn uv_tangent(a: &Args) -> Vec3A {
    let tangent = a.point.attribute(a.parameter).unwrap_or_default();
    as_tangent(a.point, Vec3A::from_vec4(tangent))
}

/// Around an axis of the object's bounds.
pub fn radial_tangent(a: &Args) -> Vec3A {
    let g = a.vector(0) - 0.5;
    let tangent = match a.mode(0) {
        0 => Vec3A::new(0.0, -g.z, g.y),
        1 => Vec3A::new(-g.z, 0.0, g.x),
        _ => Vec3A::new(-g.y, g.x, 0.0),
    };
    as_tangent(a.point, tangent)
}
