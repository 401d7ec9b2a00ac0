//! Normals that a mirror may have.

use glam::Vec3A;

/// The normal, bent towards the geometric normal `up` just so far that a mirror sends the viewer's
/// direction `wo` back above the surface; all of them unit vectors.
///
/// In the plane of both normals let the viewer be at distance r and angle phi from the geometric
/// normal. A normal at the angle a sends it back to the height r cos(2a - phi), which is to be
/// `least`: cos(2a) follows. Cycles bends in this plane too.
pub fn reflecting_normal(normal: Vec3A, wo: Vec3A, up: Vec3A) -> Vec3A {
    /// Sine of the angle above the surface that a mirror direction must keep.
    const GRAZING: f32 = 0.01;
    let least = (0.9 * wo.dot(up)).clamp(0.0, GRAZING);
    let mirror = 2.0 * normal.dot(wo) * normal - wo;
    if mirror.dot(up) >= least {
        return normal;
    }
    let Some(side) = normal.reject_from_normalized(up).try_normalize() else {
        return up;
    };
    let (x, z) = (wo.dot(side), wo.dot(up));
    let r_squared = (x * x + z * z).max(f32::MIN_POSITIVE);
    let across = (r_squared - least * least).max(0.0).sqrt();
    let cos_twice = ((z * least - x * across) / r_squared).clamp(-1.0, 1.0);
    (0.5 * (1.0 - cos_twice)).sqrt() * side + (0.5 * (1.0 + cos_twice)).sqrt() * up
}
