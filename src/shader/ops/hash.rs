//! The hashes behind Blender's textures: Jenkins' lookup3 (2006, public domain) for floats, and PCG
//! of Jarzynski and Olano ("Hash Functions for GPU Rendering", JCGT 9(3), 2020) with signed numbers
//! for Voronoi's cells.

/// lookup3 of one to four words.
pub fn words(words: &[u32]) -> u32 {
    let start = 0xdead_beef_u32
        .wrapping_add((words.len() as u32) << 2)
        .wrapping_add(13);
    let word = |i: usize| words.get(i).copied().unwrap_or(0);
    let mut abc = [0, 1, 2].map(|i| start.wrapping_add(word(i)));
    if words.len() == 4 {
        mix(&mut abc);
        abc[0] = abc[0].wrapping_add(word(3));
    }
    finish(&mut abc);
    abc[2]
}

fn mix(abc: &mut [u32; 3]) {
    // Each step changes one number by the one before it, and that by the one after.
    for (step, turn) in [4, 6, 8, 16, 19, 4].into_iter().enumerate() {
        let (a, b, c) = (step % 3, (step + 1) % 3, (step + 2) % 3);
        abc[a] = abc[a].wrapping_sub(abc[c]) ^ abc[c].rotate_left(turn);
        abc[c] = abc[c].wrapping_add(abc[b]);
    }
}

fn finish(abc: &mut [u32; 3]) {
    for (step, turn) in [14, 11, 25, 16, 4, 14, 24].into_iter().enumerate() {
        let (c, b) = ((step + 2) % 3, (step + 1) % 3);
        abc[c] = (abc[c] ^ abc[b]).wrapping_sub(abc[b].rotate_left(turn));
    }
}

/// lookup3 of the bits of floats, in 0 to 1.
pub fn floats(floats: &[f32]) -> f32 {
    let mut bits = [0; 4];
    for (bits, float) in bits.iter_mut().zip(floats) {
        *bits = float.to_bits();
    }
    words(&bits[..floats.len()]) as f32 / u32::MAX as f32
}

/// PCG of two to four whole numbers, each result in 0 to 1. Unlike the others the two-dimensional
/// one mixes with its own multiplier.
pub fn cell<const N: usize>(numbers: [i32; N]) -> [f32; N] {
    const MULTIPLIER: i32 = 1_664_525;
    let mut v = numbers.map(|n| n.wrapping_mul(MULTIPLIER).wrapping_add(1_013_904_223));
    let stir = |v: &mut [i32; N]| {
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
    };
    stir(&mut v);
    v = v.map(|n| n ^ (n >> 16));
    stir(&mut v);
    v.map(|n| (n & 0x7fff_ffff) as f32 / 0x7fff_ffff as f32)
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
