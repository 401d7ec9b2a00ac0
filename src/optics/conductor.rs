//! Waves that conductors reflect. Their index of refraction is a complex number, `n + i k`, whose second
//! part tells how fast waves die away within.
//!
//! Source: Born and Wolf, "Principles of Optics", 7th edition, section 14.4.

use std::ops::{Add, Div, Mul, Sub};

use glam::Vec3A;

/// Unpolarised reflectance of a conductor for a cosine of incidence in [0, 1]; its complex index of
/// refraction is relative to where light comes from.
pub fn reflectance(cos: f32, index: Complex) -> Vec3A {
    let [across, within] = amplitudes(cos, index).map(Complex::length_squared);
    0.5 * (across + within)
}

/// Shares of the waves' amplitudes that a conductor reflects, across the plane of incidence and in it.
/// The complex index of refraction is relative to where the waves come from; real, it is a dielectric's.
pub fn amplitudes(cos: f32, index: Complex) -> [Complex; 2] {
    let square = index * index;
    let inner = (square - Complex::from(Vec3A::splat(1.0 - cos * cos))).sqrt();
    let outer = Complex::from(Vec3A::splat(cos));
    let across = (outer - inner) / (outer + inner);
    let within = (square * cos - inner) / (square * cos + inner);
    [across, within]
}

/// Complex index of refraction of a metal that reflects `facing`, less than one, at normal incidence;
/// `edge` decides between the greatest and the least real part that fit.
///
/// Source: Gulbrandsen, "Artist Friendly Metallic Fresnel", JCGT 3(4), 2014.
pub fn of_colors(facing: Vec3A, edge: Vec3A) -> Complex {
    let root = facing.sqrt();
    let greatest = (1.0 + root) / (1.0 - root);
    let index = greatest + edge * ((1.0 - facing) / (1.0 + facing) - greatest);
    let (less, more) = (index - 1.0, index + 1.0);
    let square = (facing * more * more - less * less) / (1.0 - facing);
    Complex::new(index, square.max(Vec3A::ZERO).sqrt())
}

/// A complex number for each channel.
#[derive(Debug, Clone, Copy)]
pub struct Complex {
    /// Its real part.
    pub re: Vec3A,
    /// Its imaginary part.
    pub im: Vec3A,
}

impl Complex {
    /// From its parts.
    pub const fn new(re: Vec3A, im: Vec3A) -> Self {
        Self { re, im }
    }

    /// The square of its length.
    pub fn length_squared(self) -> Vec3A {
        self.re * self.re + self.im * self.im
    }

    /// The root in the first quadrant of a number that is not below the real axis.
    fn sqrt(self) -> Self {
        let length = self.length_squared().sqrt();
        let half = |twice: Vec3A| (0.5 * twice).max(Vec3A::ZERO).sqrt();
        Self::new(half(length + self.re), half(length - self.re))
    }

    /// The same of length one; one in the place of zero.
    pub fn direction(self) -> Self {
        let length = self.length_squared().sqrt();
        let is_zero = length.cmpeq(Vec3A::ZERO);
        Self {
            re: Vec3A::select(is_zero, Vec3A::ONE, self.re / length),
            im: Vec3A::select(is_zero, Vec3A::ZERO, self.im / length),
        }
    }
}

impl From<Vec3A> for Complex {
    fn from(re: Vec3A) -> Self {
        Self::new(re, Vec3A::ZERO)
    }
}

impl Add for Complex {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }
}

impl Sub for Complex {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.im - other.im)
    }
}

impl Mul for Complex {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}

impl Mul<f32> for Complex {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        self * Vec3A::splat(factor)
    }
}

impl Mul<Vec3A> for Complex {
    type Output = Self;

    fn mul(self, factor: Vec3A) -> Self {
        Self::new(self.re * factor, self.im * factor)
    }
}

impl Div for Complex {
    type Output = Self;

    /// Zero over zero is zero.
    fn div(self, other: Self) -> Self {
        let scale = other.length_squared().max(Vec3A::splat(f32::MIN_POSITIVE));
        let conjugate = Self::new(other.re, -other.im);
        let product = self * conjugate;
        Self::new(product.re / scale, product.im / scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_extinction_a_conductor_is_a_dielectric() {
        for ior in [0.7, 1.33, 1.5, 2.4] {
            for cos in [0.05, 0.3, 0.72, 1.0] {
                let index = Complex::from(Vec3A::splat(ior));
                let expected = super::super::fresnel::dielectric(cos, ior);
                let error = (reflectance(cos, index) - expected).abs().max_element();
                assert!(error < 2e-6, "{ior} {cos}: {error}");
            }
        }
    }

    /// Gold in the middle of the spectrum, computed by hand: `((n - 1)^2 + k^2) / ((n + 1)^2 + k^2)`.
    #[test]
    fn metals_reflect_what_they_do_at_normal_incidence_and_all_at_grazing() {
        let gold = Complex::new(Vec3A::splat(0.42), Vec3A::splat(2.35));
        assert!((reflectance(1.0, gold).x - 5.8589 / 7.5389).abs() < 1e-5);
        assert!((reflectance(0.0, gold).x - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_conductor_made_of_colours_has_the_first_of_them() {
        let facing = Vec3A::new(0.02, 0.5, 0.99);
        for edge in [0.0, 0.3, 1.0].map(Vec3A::splat) {
            let index = of_colors(facing, edge);
            let error = (reflectance(1.0, index) - facing).abs().max_element();
            assert!(error < 1e-3, "{edge}: {error}");
            assert!(index.re.min_element() > 0.0 && index.im.min_element() >= 0.0);
        }
    }
}
