//! Tables and images.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3A, Vec4};

use super::super::operation::Args;
use super::lerp;

/// Rows of a ramp or curve: as many as Cycles samples them at.
pub const TABLE_SIZE: usize = 256;

/// The table at `share` of its length: between rows linear, or the row below.
fn looked_up(a: &Args, share: f32, is_stepped: bool) -> Vec4 {
    let first = a.parameter as usize;
    let rows = &a.tables[first..first + TABLE_SIZE];
    let at = share.clamp(0.0, 1.0) * (TABLE_SIZE - 1) as f32;
    let low = at as usize;
    if is_stepped || low + 1 == TABLE_SIZE {
        rows[low]
    } else {
        rows[low].lerp(rows[low + 1], at.fract())
    }
}

pub fn ramp_color(a: &Args) -> Vec3A {
    Vec3A::from_vec4(looked_up(a, a.float(0), false))
}

pub fn ramp_alpha(a: &Args) -> Vec3A {
    Vec3A::splat(looked_up(a, a.float(0), false).w)
}

pub fn ramp_color_stepped(a: &Args) -> Vec3A {
    Vec3A::from_vec4(looked_up(a, a.float(0), true))
}

pub fn ramp_alpha_stepped(a: &Args) -> Vec3A {
    Vec3A::splat(looked_up(a, a.float(0), true).w)
}

/// One curve for each channel over a range: its start, its end, and whether it goes on beyond.
pub fn curves(a: &Args) -> Vec3A {
    let (factor, value, range) = (a.float(0), a.vector(1), a.vector(2));
    let curved = |channel: usize| {
        let share = (value[channel] - range.x) / (range.y - range.x);
        let inside = looked_up(a, share, false)[channel];
        let over = if share < 0.0 {
            share
        } else {
            (share - 1.0).max(0.0)
        };
        if range.z == 0.0 || over == 0.0 {
            return inside;
        }
        let step = 1.0 / (TABLE_SIZE - 1) as f32;
        let neighbour = looked_up(a, if over < 0.0 { step } else { 1.0 - step }, false)[channel];
        inside + (inside - neighbour) * over.abs() / step
    };
    let result = Vec3A::new(curved(0), curved(1), curved(2));
    (1.0 - factor) * value + factor * result
}

fn image(a: &Args, uv: Vec2) -> Vec4 {
    a.images[a.parameter as usize].sample(uv)
}

fn flat(a: &Args) -> Vec4 {
    let v = a.vector(0);
    image(a, Vec2::new(v.x, v.y))
}

pub fn image_color(a: &Args) -> Vec3A {
    Vec3A::from_vec4(flat(a))
}

pub fn image_alpha(a: &Args) -> Vec3A {
    Vec3A::splat(flat(a).w)
}

pub fn image_box_color(a: &Args) -> Vec3A {
    Vec3A::from_vec4(boxed(a))
}

pub fn image_box_alpha(a: &Args) -> Vec3A {
    Vec3A::splat(boxed(a).w)
}

/// Three projections along the axes of the object, by where the normal points.
fn boxed(a: &Args) -> Vec4 {
    let normal = a.point.world_from_object.matrix3.transpose() * a.point.normal;
    let [wx, wy, wz] = box_weights(normal.abs(), a.float(1)).to_array();
    let p = a.vector(0);
    let flipped = |is_flipped: bool, x: f32| if is_flipped { 1.0 - x } else { x };
    let faces = [
        (wx, Vec2::new(flipped(normal.x < 0.0, p.y), p.z)),
        (wy, Vec2::new(flipped(normal.y > 0.0, p.x), p.z)),
        (wz, Vec2::new(flipped(normal.z > 0.0, p.y), p.x)),
    ];
    let seen = faces.iter().filter(|(weight, _)| *weight > 0.0);
    seen.map(|&(weight, uv)| weight * image(a, uv)).sum()
}

/// Weights of the three faces: one alone near an axis, two near an edge, all near a corner.
fn box_weights(normal: Vec3A, blend: f32) -> Vec3A {
    let n = normal / normal.element_sum();
    let limit = 0.5 * (1.0 + blend);
    let pairs = [(0, 1, 2), (1, 0, 2), (2, 0, 1)];
    for (axis, one, other) in pairs {
        if n[axis] > limit * (n[axis] + n[one]) && n[axis] > limit * (n[axis] + n[other]) {
            return Vec3A::AXES[axis];
        }
    }
    if !(blend > 0.0) {
        return Vec3A::X;
    }
    for (least, one, other) in [(2, 0, 1), (0, 1, 2), (1, 0, 2)] {
        if n[least] < (1.0 - limit) * (n[one] + n[other]) {
            let share = n[one] / (n[one] + n[other]);
            let share = ((share - 0.5 * (1.0 - blend)) / blend).clamp(0.0, 1.0);
            return share * Vec3A::AXES[one] + (1.0 - share) * Vec3A::AXES[other];
        }
    }
    ((2.0 - limit) * n + limit - 1.0) / (2.0 * limit - 1.0)
}

/// What a lamp sends in a direction that points away from it. The image has the polar angle from -Z
/// along its height, from pole to pole, and the angle about Z along its width.
pub fn ies(a: &Args) -> Vec3A {
    let v = a.vector(0).normalize_or_zero();
    let polar = (-v.z).clamp(-1.0, 1.0).acos() / PI;
    let around = v.x.atan2(v.y) / TAU + 0.5;
    // The first and the last row are the poles.
    let rows = a.images[a.parameter as usize].size().1 as f32;
    let across = (polar * (rows - 1.0) + 0.5) / rows;
    Vec3A::splat(image(a, Vec2::new(around, across)).x)
}

/// Longitude and latitude of a direction, from a coordinate in 0 to 1.
pub fn sphere_uv(a: &Args) -> Vec3A {
    let p = centred(a);
    let length = p.length();
    if !(length > 0.0) {
        return Vec3A::ZERO;
    }
    let u = if p.x == 0.0 && p.y == 0.0 {
        0.0
    } else {
        0.5 - p.x.atan2(p.y) / TAU
    };
    Vec3A::new(u, 1.0 - (p.z / length).clamp(-1.0, 1.0).acos() / PI, 0.0)
}

/// Longitude and height.
pub fn tube_uv(a: &Args) -> Vec3A {
    let p = centred(a);
    if p.x == 0.0 && p.y == 0.0 {
        return Vec3A::ZERO;
    }
    Vec3A::new(0.5 - p.x.atan2(p.y) / TAU, lerp(0.5, 1.0, p.z), 0.0)
}

fn centred(a: &Args) -> Vec3A {
    2.0 * a.vector(0) - 1.0
}
