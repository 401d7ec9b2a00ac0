//! The hashes behind Blender's textures: Jenkins' lookup3 (2006, public domain) for floats, and PCG
//! of Jarzynski and Olano ("Hash Functions for GPU Rendering", JCGT 9(3), 2020) with signed numbers
//! for Voronoi's cells.

/// Numbers that are hashed side by side.
pub const LANES: usize = 4;
/// One number for each of them.
pub type Lanes<T> = [T; LANES];

/// lookup3 of one to four words, lane by lane; the compiler makes vector instructions of the loops.
#[inline(always)]
pub fn words_of_lanes<const N: usize>(words: &[Lanes<u32>; N]) -> Lanes<u32> {
    let start = 0xdead_beef_u32.wrapping_add(((N as u32) << 2) + 13);
    let from = |i: usize| {
        words
            .get(i)
            .map_or([start; LANES], |w| added(w, &[start; LANES]))
    };
    let (mut a, mut b, mut c) = (from(0), from(1), from(2));
    if N == 4 {
        for (turn_a, turn_b, turn_c) in [(4, 6, 8), (16, 19, 4)] {
            mix(&mut a, &b, &mut c, turn_a);
            mix(&mut b, &c, &mut a, turn_b);
            mix(&mut c, &a, &mut b, turn_c);
        }
        a = added(&a, &words[N - 1]);
    }
    for (turn_c, turn_a, turn_b) in [(14, 11, 25), (16, 4, 14)] {
        finish(&mut c, &b, turn_c);
        finish(&mut a, &c, turn_a);
        finish(&mut b, &a, turn_b);
    }
    finish(&mut c, &b, 24);
    c
}

/// The same of one lane.
pub fn words<const N: usize>(words: &[u32; N]) -> u32 {
    words_of_lanes(&words.map(|word| [word; LANES]))[0]
}

#[inline(always)]
fn added(one: &Lanes<u32>, other: &Lanes<u32>) -> Lanes<u32> {
    let mut sum = *one;
    for lane in 0..LANES {
        sum[lane] = sum[lane].wrapping_add(other[lane]);
    }
    sum
}

/// Changes a number by the one before it, and that by the one after.
#[inline(always)]
fn mix(number: &mut Lanes<u32>, after: &Lanes<u32>, before: &mut Lanes<u32>, turn: u32) {
    for lane in 0..LANES {
        number[lane] = number[lane].wrapping_sub(before[lane]) ^ before[lane].rotate_left(turn);
        before[lane] = before[lane].wrapping_add(after[lane]);
    }
}

#[inline(always)]
fn finish(number: &mut Lanes<u32>, before: &Lanes<u32>, turn: u32) {
    for lane in 0..LANES {
        let turned = before[lane].rotate_left(turn);
        number[lane] = (number[lane] ^ before[lane]).wrapping_sub(turned);
    }
}

/// lookup3 of the bits of floats, in 0 to 1.
pub fn floats<const N: usize>(floats: &[f32; N]) -> f32 {
    let mut bits = [0; N];
    for (bits, float) in bits.iter_mut().zip(floats) {
        *bits = float.to_bits();
    }
    words(&bits) as f32 / u32::MAX as f32
}

/// PCG of two to four whole numbers, each result in 0 to 1. Unlike the others the two-dimensional
/// one mixes with its own multiplier.
pub fn cell<const N: usize>(numbers: [i32; N]) -> [f32; N] {
    let mut v = numbers;
    for n in &mut v {
        *n = n.wrapping_mul(MULTIPLIER).wrapping_add(1_013_904_223);
    }
    stir(&mut v);
    for n in &mut v {
        *n ^= *n >> 16;
    }
    stir(&mut v);
    let mut found = [0.0; N];
    for (found, n) in found.iter_mut().zip(v) {
        *found = (n & 0x7fff_ffff) as f32 / 0x7fff_ffff as f32;
    }
    found
}

const MULTIPLIER: i32 = 1_664_525;

fn stir<const N: usize>(v: &mut [i32; N]) {
    for i in 0..N {
        // The partners of x, y, z, w.
        let product = match (N, i) {
            (2, _) => v[1 - i].wrapping_mul(MULTIPLIER),
            (3, _) => v[(i + 1) % 3].wrapping_mul(v[(i + 2) % 3]),
            (_, 0) => v[1].wrapping_mul(v[3]),
            (_, 1) => v[2].wrapping_mul(v[0]),
            (_, 2) => v[0].wrapping_mul(v[1]),
            _ => v[1].wrapping_mul(v[2]),
        };
        v[i] = v[i].wrapping_add(product);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Jenkins' own steps, written out.
    fn lookup3(k: [u32; 4]) -> u32 {
        let start = 0xdead_beef_u32.wrapping_add(16 + 13);
        let (mut a, mut b, mut c) = (
            start.wrapping_add(k[0]),
            start.wrapping_add(k[1]),
            start.wrapping_add(k[2]),
        );
        macro_rules! turn {
            ($x:ident, $y:ident, $z:ident, $k:literal) => {
                $x = $x.wrapping_sub($z);
                $x ^= $z.rotate_left($k);
                $z = $z.wrapping_add($y);
            };
        }
        turn!(a, b, c, 4);
        turn!(b, c, a, 6);
        turn!(c, a, b, 8);
        turn!(a, b, c, 16);
        turn!(b, c, a, 19);
        turn!(c, a, b, 4);
        a = a.wrapping_add(k[3]);
        macro_rules! last {
            ($x:ident, $y:ident, $k:literal) => {
                $x ^= $y;
                $x = $x.wrapping_sub($y.rotate_left($k));
            };
        }
        last!(c, b, 14);
        last!(a, c, 11);
        last!(b, a, 25);
        last!(c, b, 16);
        last!(a, c, 4);
        last!(b, a, 14);
        last!(c, b, 24);
        c
    }

    #[test]
    fn four_words_are_hashed_as_jenkins_does() {
        for k in [[0; 4], [1, 2, 3, 4], [u32::MAX, 7, 0x8000_0000, 99]] {
            assert_eq!(words(&k), lookup3(k));
        }
    }
}
