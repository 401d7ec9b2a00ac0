//! Eight numbers at a time, for loops that the compiler does not vectorise by itself.
//!
//! [`Vector`] is eight lanes of `f32` on some instruction set; a [`Work`] is written once, over any
//! of them, and [`run_on_vectors`] picks the widest that the machine has. All sets give the same
//! bits: nothing is fused, minimum and maximum return their second argument unless the comparison
//! holds, and sums over lanes have one order.
//!
//! A comparison gives a mask, a vector whose lanes have all bits set or none.

use std::ops::{Add, BitAnd, Div, Mul, Sub};

/// Lanes of a vector.
pub const LANES: usize = 8;

/// Eight lanes of `f32`.
pub trait Vector:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + BitAnd<Output = Self>
{
    /// The same number in every lane.
    fn splat(value: f32) -> Self;
    /// Eight numbers.
    fn load(from: &[f32; LANES]) -> Self;
    /// Eight whole numbers.
    fn load_i16(from: &[i16; LANES]) -> Self;
    /// Eight numbers of which only the upper halves were kept: sign, exponent, seven bits.
    fn load_upper_halves(from: &[i16; LANES]) -> Self;
    /// The lanes as numbers.
    fn to_array(self) -> [f32; LANES];
    /// The square roots.
    fn sqrt(self) -> Self;
    /// The smaller of each pair.
    fn min(self, other: Self) -> Self;
    /// The larger of each pair.
    fn max(self, other: Self) -> Self;
    /// Mask of the lanes where `self <= other`; false for NaN.
    fn at_most(self, other: Self) -> Self;
    /// Mask of the lanes where `self == other`.
    fn equals(self, other: Self) -> Self;
    /// Whether any lane of a mask is set.
    fn any(self) -> bool;

    /// Sum over the lanes: halves, then pairs, then two.
    #[inline(always)]
    fn sum(self) -> f32 {
        let [a, b, c, d, e, f, g, h] = self.to_array();
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }
}

/// Work over any instruction set. Implementations mark `run`, and all that it calls with vectors,
/// `#[inline(always)]`, so that all of it is compiled for the set that it runs on.
pub trait Work {
    /// What it yields.
    type Output;
    /// Does it.
    fn run<V: Vector>(self) -> Self::Output;
}

/// Runs the work on the widest instruction set of this machine.
#[inline]
pub fn run_on_vectors<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the feature that `run` asks for was just found.
        return unsafe { avx2::run(work) };
    }
    work.run::<Portable>()
}

/// Plain Rust, for every machine.
#[derive(Clone, Copy)]
#[repr(align(32))]
struct Portable([f32; LANES]);

impl Portable {
    #[inline(always)]
    fn each(self, other: Self, operation: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|lane| {
            operation(self.0[lane], other.0[lane])
        }))
    }

    #[inline(always)]
    fn compare(self, other: Self, holds: impl Fn(f32, f32) -> bool) -> Self {
        self.each(other, |a, b| {
            f32::from_bits(if holds(a, b) { u32::MAX } else { 0 })
        })
    }
}

impl Add for Portable {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.each(other, |a, b| a + b)
    }
}

impl Sub for Portable {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.each(other, |a, b| a - b)
    }
}

impl Mul for Portable {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.each(other, |a, b| a * b)
    }
}

impl Div for Portable {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.each(other, |a, b| a / b)
    }
}

impl BitAnd for Portable {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        self.each(other, |a, b| f32::from_bits(a.to_bits() & b.to_bits()))
    }
}

impl Vector for Portable {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        Self(*from)
    }

    #[inline(always)]
    fn load_i16(from: &[i16; LANES]) -> Self {
        Self(from.map(f32::from))
    }

    #[inline(always)]
    fn load_upper_halves(from: &[i16; LANES]) -> Self {
        Self(from.map(upper_half))
    }

    #[inline(always)]
    fn to_array(self) -> [f32; LANES] {
        self.0
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.each(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.each(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        self.compare(other, |a, b| a <= b)
    }

    #[inline(always)]
    fn equals(self, other: Self) -> Self {
        self.compare(other, |a, b| a == b)
    }

    #[inline(always)]
    fn any(self) -> bool {
        self.0.iter().any(|lane| lane.to_bits() != 0)
    }
}

/// The number whose upper half this is.
#[inline(always)]
pub fn upper_half(bits: i16) -> f32 {
    f32::from_bits(u32::from(bits as u16) << 16)
}

/// The upper half of the nearest number that has zeros in its lower half: off by at most 1 part in
/// 256, and by nothing on average. `value` is finite.
#[inline(always)]
pub fn to_upper_half(value: f32) -> i16 {
    let bits = value.to_bits();
    // Ties go to the even one. What would round up to infinity stays below.
    let rounded = bits.saturating_add(0x7fff + (bits >> 16 & 1));
    let largest = (bits & 0x8000_0000) | 0x7f7f_0000;
    (rounded.min(largest) >> 16) as i16
}

/// AVX2, without fused multiply-add: see the promise above.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;
    use std::ops::{Add, BitAnd, Div, Mul, Sub};

    use super::{LANES, Vector, Work};

    /// Only [`run`] names this type, so that its operations run only where the feature is.
    #[derive(Clone, Copy)]
    struct Avx2(__m256);

    #[target_feature(enable = "avx2")]
    pub fn run<W: Work>(work: W) -> W::Output {
        work.run::<Avx2>()
    }

    impl Add for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_add_ps(self.0, other.0) })
        }
    }

    impl Sub for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_sub_ps(self.0, other.0) })
        }
    }

    impl Mul for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_mul_ps(self.0, other.0) })
        }
    }

    impl Div for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn div(self, other: Self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_div_ps(self.0, other.0) })
        }
    }

    impl BitAnd for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn bitand(self, other: Self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_and_ps(self.0, other.0) })
        }
    }

    impl Vector for Avx2 {
        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_set1_ps(value) })
        }

        #[inline(always)]
        fn load(from: &[f32; LANES]) -> Self {
            // SAFETY: inside `run`, the feature is there; there are eight.
            Self(unsafe { _mm256_loadu_ps(from.as_ptr()) })
        }

        #[inline(always)]
        fn load_i16(from: &[i16; LANES]) -> Self {
            // SAFETY: inside `run`, the feature is there; there are eight, of two bytes each.
            unsafe {
                let halves = _mm_loadu_si128(from.as_ptr().cast());
                Self(_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(halves)))
            }
        }

        #[inline(always)]
        fn load_upper_halves(from: &[i16; LANES]) -> Self {
            // SAFETY: inside `run`, the feature is there; there are eight, of two bytes each.
            unsafe {
                let halves = _mm_loadu_si128(from.as_ptr().cast());
                let shifted = _mm256_slli_epi32::<16>(_mm256_cvtepu16_epi32(halves));
                Self(_mm256_castsi256_ps(shifted))
            }
        }

        #[inline(always)]
        fn to_array(self) -> [f32; LANES] {
            let mut to = [0.0; LANES];
            // SAFETY: inside `run`, the feature is there; there is room for eight.
            unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) };
            to
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_sqrt_ps(self.0) })
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn at_most(self, other: Self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
        }

        #[inline(always)]
        fn equals(self, other: Self) -> Self {
            // SAFETY: inside `run`, the feature is there.
            Self(unsafe { _mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, other.0) })
        }

        #[inline(always)]
        fn any(self) -> bool {
            // SAFETY: inside `run`, the feature is there.
            unsafe { _mm256_movemask_ps(self.0) != 0 }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::Random;

    /// Every operation, its lanes' bits one after the other.
    struct Everything {
        a: [f32; LANES],
        b: [f32; LANES],
        c: [i16; LANES],
    }

    impl Work for Everything {
        type Output = Vec<u32>;

        #[inline(always)]
        fn run<V: Vector>(self) -> Vec<u32> {
            let (a, b) = (V::load(&self.a), V::load(&self.b));
            let results = [
                V::splat(self.a[0]),
                V::load_i16(&self.c),
                V::load_upper_halves(&self.c),
                a + b,
                a - b,
                a * b,
                a / b,
                a.sqrt(),
                a.min(b),
                a.max(b),
                a.at_most(b) & a,
                a.equals(b) & a,
                // Fused, this would round once only.
                a * b + a,
            ];
            let bits = results.into_iter().flat_map(V::to_array).map(f32::to_bits);
            let flags = [a.at_most(b).any(), a.equals(b).any()];
            let last = flags.map(u32::from);
            bits.chain(last).chain([a.sum().to_bits()]).collect()
        }
    }

    #[test]
    fn all_instruction_sets_give_the_same_bits() {
        let mut random = Random::new(3);
        for round in 0..2000 {
            let mut numbers = || {
                let special = [0.0, -0.0, f32::INFINITY, f32::NAN, 1.0, -1.0, 1e-42, 3e38];
                special.map(|s| match random.next() {
                    u if u < 0.2 && round % 2 == 0 => s,
                    u => (u - 0.5) * 1e3,
                })
            };
            let (a, mut b) = (numbers(), numbers());
            b[2] = a[2];
            let c = a.map(|a| a.to_bits() as i16);
            let wide = run_on_vectors(Everything { a, b, c });
            let plain = Everything { a, b, c }.run::<Portable>();
            let is_nan = |bits: u32| f32::from_bits(bits).is_nan();
            let alike = |(&x, &y): (&u32, &u32)| x == y || (is_nan(x) && is_nan(y));
            assert!(wide.iter().zip(&plain).all(alike), "{a:?} {b:?} {c:?}");
        }
    }

    #[test]
    fn halves_are_near_and_even_on_average() {
        let mut random = Random::new(4);
        let mut mean = 0.0;
        for _ in 0..100_000 {
            let value = (40.0 * (random.next() - 0.5)).exp2();
            let error = f64::from(upper_half(to_upper_half(value)) / value) - 1.0;
            assert!(error.abs() <= 1.0 / 256.0, "{value}: {error}");
            mean += error / 1e5;
        }
        // Uniform within the steps: standard deviation below 1 / 256 / sqrt(3) / sqrt(1e5) = 7e-6.
        assert!(mean.abs() < 3.5e-5, "{mean}");
        for exact in [0.0, 1.0, -2.5, 1024.0] {
            assert_eq!(upper_half(to_upper_half(exact)), exact);
        }
        assert!(upper_half(to_upper_half(f32::MAX)).is_finite());
        assert!(upper_half(to_upper_half(f32::MIN)).is_finite());
    }
}
