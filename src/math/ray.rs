//! Rays, and origins that do not hit the surface they start from.

use glam::Vec3A;

/// A half line with bounds on its parameter.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Start.
    pub origin: Vec3A,
    /// Direction; any length, `t` is in units of it.
    pub direction: Vec3A,
    /// Smallest parameter that counts as a hit.
    pub t_min: f32,
    /// Largest parameter that counts as a hit.
    pub t_max: f32,
    /// When it meets the scene: the share of the shutter's time that has passed by then.
    pub time: f32,
}

/// The frame's own time, as [`Ray::time`]: the middle of the shutter's.
pub const MIDDLE_TIME: f32 = 0.5;

impl Ray {
    /// A ray from `origin` without an end.
    pub fn new(origin: Vec3A, direction: Vec3A) -> Self {
        Self::segment(origin, direction, f32::INFINITY)
    }

    /// A ray that ends at `t_max`.
    pub fn segment(origin: Vec3A, direction: Vec3A, t_max: f32) -> Self {
        Self {
            origin,
            direction,
            t_min: 0.0,
            t_max,
            time: MIDDLE_TIME,
        }
    }

    /// The same ray at another time.
    pub fn at_time(self, time: f32) -> Self {
        Self { time, ..self }
    }

    /// The point at parameter `t`.
    pub fn at(&self, t: f32) -> Vec3A {
        self.origin + self.direction * t
    }
}

/// `normal`, turned to the side of `direction`.
pub fn facing(normal: Vec3A, direction: Vec3A) -> Vec3A {
    if normal.dot(direction) < 0.0 {
        -normal
    } else {
        normal
    }
}

/// `point`, moved off its surface along `normal` by a few units in the last place, so that a ray
/// from it does not meet the surface again at any scale.
///
/// Source: Wächter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray
/// Tracing Gems, chapter 6. Near the origin, where floats are too fine to matter, a fixed step.
pub fn offset_origin(point: Vec3A, normal: Vec3A) -> Vec3A {
    /// Below this coordinate [m] the fixed step applies.
    const NEAR: f32 = 1.0 / 32.0;
    /// The fixed step [m]; smaller ones meet their own triangle again.
    const STEP: f32 = 1.0 / 65536.0;
    /// Units in the last place to move by.
    const ULPS: f32 = 256.0;
    let moved = |p: f32, n: f32| {
        if p.abs() < NEAR {
            p + STEP * n
        } else {
            let ulps = (ULPS * n) as i32;
            f32::from_bits((p.to_bits() as i32 + if p < 0.0 { -ulps } else { ulps }) as u32)
        }
    };
    Vec3A::new(
        moved(point.x, normal.x),
        moved(point.y, normal.y),
        moved(point.z, normal.z),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_moves_to_the_side_of_the_normal_at_every_scale() {
        let normal = Vec3A::new(0.48, -0.6, 0.64);
        for scale in [1e-4, 1e-2, 1.0, 1e3, 1e6] {
            let point = Vec3A::new(0.7, -1.3, 0.9) * scale;
            let step = (offset_origin(point, normal) - point).dot(normal);
            assert!(
                step > 0.0 && step < 1e-3 * scale.max(0.1),
                "{scale}: {step}"
            );
        }
    }
}
