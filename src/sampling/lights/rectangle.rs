//! Directions to a rectangle, each as likely as any other.
//!
//! Source: Ureña, Fajardo and King, "An Area-Preserving Parametrization for Spherical Rectangles", Computer
//! Graphics Forum 32(4), 2013; names are theirs.

use std::f32::consts::PI;

use glam::Vec2;

/// A rectangle as a point sees it that lies at this height over its plane, `low` and `high` being its corners
/// from the point's foot.
pub struct SphericalRectangle {
    low: Vec2,
    high: Vec2,
    height: f32,
    /// Solid angle [sr].
    pub solid_angle: f32,
    /// The angle at which drawing begins, and the heights of the normals of the planes through the point and
    /// the sides of y.
    k: f32,
    b0: f32,
    b1: f32,
}

impl SphericalRectangle {
    /// For heights above zero.
    pub fn new(low: Vec2, high: Vec2, height: f32) -> Self {
        // Their angles at the corners are these over and under a right one: no cosine is turned back into an
        // angle, which would lose half the digits for points in the plane of a lamp.
        let quarter = |x: f32, y: f32| {
            let distance = (x * x + y * y + height * height).sqrt();
            (x * y).atan2(height * distance)
        };
        let [at_low, at_high] = [low.x, high.x].map(|x| [low.y, high.y].map(|y| quarter(x, y)));
        let start = at_low[1] - at_low[0];
        Self {
            low,
            high,
            height,
            solid_angle: at_high[1] - at_high[0] - start,
            k: PI + start,
            b0: -low.y / low.y.hypot(height),
            b1: high.y / high.y.hypot(height),
        }
    }

    /// A point of the rectangle, from the point's foot.
    pub fn sample(&self, [u, v]: [f32; 2]) -> Vec2 {
        let (sin, cos) = (u * self.solid_angle + self.k).sin_cos();
        let f = (cos * self.b0 - self.b1) / sin;
        let c = (f.signum() / (f * f + self.b0 * self.b0).sqrt()).clamp(-1.0, 1.0);
        let x = c * self.height / (1.0 - c * c).max(f32::MIN_POSITIVE).sqrt();
        let x = x.clamp(self.low.x, self.high.x);
        let distance = x.hypot(self.height);
        let of = |y: f32| y / y.hypot(distance);
        let (low, high) = (of(self.low.y), of(self.high.y));
        let h = low + v * (high - low);
        let y = h * distance / (1.0 - h * h).max(f32::MIN_POSITIVE).sqrt();
        Vec2::new(x, y.clamp(self.low.y, self.high.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solid angle between the foot and a corner (Van Oosterom and Strackee), summed up with signs.
    fn solid_angle(low: Vec2, high: Vec2, height: f32) -> f64 {
        let [low, high] = [low, high].map(Vec2::as_dvec2);
        let height = f64::from(height);
        let corner = |x: f64, y: f64| {
            let distance = (x * x + y * y + height * height).sqrt();
            (x * y / (height * distance)).atan()
        };
        corner(high.x, high.y) - corner(low.x, high.y) - corner(high.x, low.y)
            + corner(low.x, low.y)
    }

    #[test]
    fn the_solid_angle_is_the_closed_form() {
        for (low, high, height) in [
            ([-1.0, -1.0], [1.0, 1.0], 1.0),
            ([0.3, -2.0], [1.5, 0.5], 0.7),
            ([-3.0, 0.1], [5.0, 0.9], 0.01),
            ([0.5, 0.5], [1.0, 2.0], 2.0),
            ([0.02, -0.03], [0.2, 0.1], 1e-3),
        ] {
            let (low, high) = (Vec2::from(low), Vec2::from(high));
            let found = SphericalRectangle::new(low, high, height).solid_angle;
            let error = f64::from(found) / solid_angle(low, high, height) - 1.0;
            assert!(error.abs() < 1e-5, "{low} {high} {height}: {error}");
        }
    }

    /// A quarter of the numbers find a quarter of the solid angle: u divides by x, v by y for each x.
    #[test]
    fn parts_of_the_numbers_are_parts_of_the_solid_angle() {
        let (low, high, height) = (Vec2::new(-0.4, 0.2), Vec2::new(1.6, 1.1), 0.6);
        let rectangle = SphericalRectangle::new(low, high, height);
        let whole = solid_angle(low, high, height);
        for u in [0.1, 0.35, 0.5, 0.8, 0.99] {
            let x = rectangle.sample([u, 0.5]).x;
            let part = solid_angle(low, Vec2::new(x, high.y), height) / whole;
            assert!((part - f64::from(u)).abs() < 1e-4, "{u}: {part}");
            let strip = |y| {
                let [near, far] = [x - 1e-2, x + 1e-2];
                solid_angle(Vec2::new(near, low.y), Vec2::new(far, y), height)
            };
            let y = rectangle.sample([u, 0.3]).y;
            let part = strip(y) / strip(high.y);
            assert!((part - 0.3).abs() < 1e-3, "{u}: {part}");
        }
    }
}
