//! Noise and White Noise: Perlin's gradient noise ("Improving Noise", SIGGRAPH 2002) in one to four
//! dimensions and its fractal sums (Musgrave, "Texturing and Modeling", 1994).

use glam::{Vec3A, Vec4};

use super::super::operation::Args;
use super::hash::{LANES, Lanes};
use super::{hash, lerp, quintic};

/// Noise repeats with this period, which keeps floats exact far from the origin.
const PERIOD: f32 = 100_000.0;

/// Scale that brings each dimension's noise into -1 to 1.
const SCALES: [f32; 4] = [0.25, 0.6616, 0.982, 0.8344];

/// The gradients of lattice points, times the offsets from them. Choices are made in each lane, so that
/// no lane waits for another.
#[inline(always)]
fn gradients<const N: usize>(hashes: &Lanes<u32>, offsets: &[Lanes<f32>; N]) -> Lanes<f32> {
    let mut values = [0.0; LANES];
    for (lane, value) in values.iter_mut().enumerate() {
        let at = |axis: usize| offsets.get(axis).map_or(0.0, |lanes| lanes[lane]);
        *value = gradient::<N>(hashes[lane], at(0), at(1), at(2), at(3));
    }
    values
}

/// The gradient of one lattice point, times the offset from it.
#[inline(always)]
fn gradient<const N: usize>(hash: u32, x: f32, y: f32, z: f32, w: f32) -> f32 {
    let pick = |is_first: bool, first: f32, second: f32| if is_first { first } else { second };
    // The bit that flips the sign, moved to where floats have theirs.
    let signed = |value: f32, bit: u32| {
        let sign = (hash & bit) << (31 - bit.trailing_zeros());
        f32::from_bits(value.to_bits() ^ sign)
    };
    match N {
        1 => signed(1.0 + (hash & 7) as f32, 8) * x,
        2 => {
            let is_low = hash & 7 < 4;
            let (u, v) = (pick(is_low, x, y), pick(is_low, y, x));
            signed(u, 1) + signed(2.0 * v, 2)
        }
        3 => {
            let h = hash & 15;
            let u = pick(h < 8, x, y);
            let v = pick(h < 4, y, pick(h & 13 == 12, x, z));
            signed(u, 1) + signed(v, 2)
        }
        _ => {
            let h = hash & 31;
            let u = pick(h < 24, x, y);
            let v = pick(h < 16, y, z);
            let s = pick(h < 8, z, w);
            signed(u, 1) + signed(v, 2) + signed(s, 4)
        }
    }
}

/// Perlin noise in about -1 to 1. Loops, as closures over arrays are not always inlined: textures of
/// many octaves spend their time here. Corners go in groups of lanes.
fn perlin<const N: usize>(mut p: [f32; N]) -> f32 {
    let (mut low, mut cell) = ([0.0; N], [0; N]);
    for axis in 0..N {
        let x = p[axis];
        // The remainder, which is dear, of a smaller number is that number.
        p[axis] = if x.abs() < PERIOD { x } else { x % PERIOD };
        p[axis] += if x.abs() >= 1e6 { 0.5 } else { 0.0 };
        low[axis] = p[axis].floor();
        cell[axis] = low[axis] as i32;
    }
    let mut corners = [0.0; 16];
    for (group, values) in corners.as_chunks_mut().0.iter_mut().enumerate() {
        if group * LANES >= 1 << N {
            break;
        }
        let mut keys = [[0; LANES]; N];
        let mut offsets = [[0.0; LANES]; N];
        for axis in 0..N {
            for lane in 0..LANES {
                let step = ((group * LANES + lane) >> axis) & 1;
                keys[axis][lane] = cell[axis].wrapping_add(step as i32) as u32;
                offsets[axis][lane] = p[axis] - low[axis] - step as f32;
            }
        }
        *values = gradients(&hash::words_of_lanes(&keys), &offsets);
    }
    for axis in 0..N {
        let t = quintic(p[axis] - low[axis]);
        for pair in 0..1 << (N - 1 - axis) {
            corners[pair] = lerp(corners[2 * pair], corners[2 * pair + 1], t);
        }
    }
    SCALES[N - 1] * corners[0]
}

fn scaled<const N: usize>(mut p: [f32; N], scale: f32) -> [f32; N] {
    for x in &mut p {
        *x *= scale;
    }
    p
}

/// The numbers of the Noise node that shape the sum of octaves.
#[derive(Clone, Copy)]
pub struct Fractal {
    pub kind: usize,
    pub detail: f32,
    pub roughness: f32,
    pub lacunarity: f32,
    pub offset: f32,
    pub gain: f32,
    pub is_normalized: bool,
}

impl Fractal {
    fn at<const N: usize>(&self, p: [f32; N]) -> f32 {
        match self.kind {
            0 => self.multifractal(p),
            1 => self.ridged(p),
            2 => self.hybrid(p),
            3 => self.brownian(p),
            _ => self.terrain(p),
        }
    }

    /// Whole octaves after the first, and the share of one more.
    fn octaves(&self) -> (u32, f32) {
        (self.detail as u32, self.detail.fract())
    }

    pub fn brownian<const N: usize>(&self, p: [f32; N]) -> f32 {
        let (octaves, rest) = self.octaves();
        let (mut scale, mut amplitude, mut total, mut sum) = (1.0, 1.0, 0.0, 0.0);
        let normalized = |sum: f32, total: f32| {
            if self.is_normalized {
                0.5 * sum / total + 0.5
            } else {
                sum
            }
        };
        for _ in 0..=octaves {
            sum += amplitude * perlin(scaled(p, scale));
            total += amplitude;
            amplitude *= self.roughness;
            scale *= self.lacunarity;
        }
        if rest == 0.0 {
            return normalized(sum, total);
        }
        let more = sum + amplitude * perlin(scaled(p, scale));
        lerp(
            normalized(sum, total),
            normalized(more, total + amplitude),
            rest,
        )
    }

    fn multifractal<const N: usize>(&self, mut p: [f32; N]) -> f32 {
        let (octaves, rest) = self.octaves();
        let (mut value, mut power) = (1.0, 1.0);
        for _ in 0..=octaves {
            value *= power * perlin(p) + 1.0;
            power *= self.roughness;
            p = scaled(p, self.lacunarity);
        }
        if rest == 0.0 {
            return value;
        }
        value * (rest * power * perlin(p) + 1.0)
    }

    fn terrain<const N: usize>(&self, mut p: [f32; N]) -> f32 {
        let (octaves, rest) = self.octaves();
        let mut power = self.roughness;
        let mut value = self.offset + perlin(p);
        for _ in 0..octaves {
            p = scaled(p, self.lacunarity);
            value += (perlin(p) + self.offset) * power * value;
            power *= self.roughness;
        }
        if rest == 0.0 {
            return value;
        }
        p = scaled(p, self.lacunarity);
        value + rest * (perlin(p) + self.offset) * power * value
    }

    fn hybrid<const N: usize>(&self, mut p: [f32; N]) -> f32 {
        /// Octaves of less weight are not worth their time; Blender stops there too.
        const LEAST_WEIGHT: f32 = 0.001;
        let (octaves, rest) = self.octaves();
        let (mut power, mut value, mut weight) = (1.0, 0.0, 1.0_f32);
        for octave in 0..=octaves + 1 {
            let share = if octave <= octaves { 1.0 } else { rest };
            if weight <= LEAST_WEIGHT || share == 0.0 {
                break;
            }
            weight = weight.min(1.0);
            let signal = (perlin(p) + self.offset) * power;
            value += share * weight * signal;
            power *= self.roughness;
            weight *= self.gain * signal;
            p = scaled(p, self.lacunarity);
        }
        value
    }

    /// The only sum that knows no part of an octave.
    fn ridged<const N: usize>(&self, mut p: [f32; N]) -> f32 {
        let ridge = |p: [f32; N]| (self.offset - perlin(p).abs()).powi(2);
        let mut signal = ridge(p);
        let mut value = signal;
        let mut power = self.roughness;
        for _ in 0..self.octaves().0 {
            p = scaled(p, self.lacunarity);
            signal = ridge(p) * (signal * self.gain).clamp(0.0, 1.0);
            value += signal * power;
            power *= self.roughness;
        }
        value
    }

    /// The texture: `distortion` moves the point by noise, and colours are three noises apart.
    fn texture<const N: usize>(&self, p: [f32; N], distortion: f32, wants_color: bool) -> Vec3A {
        let mut seed = 0.0;
        let mut next_shift = || {
            let shift = far_shift::<N>(seed);
            seed += 1.0;
            shift
        };
        let moved =
            |p: [f32; N], by: [f32; N]| -> [f32; N] { std::array::from_fn(|i| p[i] + by[i]) };
        let point = p.map(|x| {
            let shift = next_shift();
            if distortion == 0.0 {
                x
            } else {
                x + distortion * perlin(moved(p, shift))
            }
        });
        let first = self.at(point);
        if !wants_color {
            return Vec3A::splat(first);
        }
        let (green, blue) = (next_shift(), next_shift());
        Vec3A::new(
            first,
            self.at(moved(point, green)),
            self.at(moved(point, blue)),
        )
    }
}

/// A shift far enough that noise there has nothing to do with noise here.
fn far_shift<const N: usize>(seed: f32) -> [f32; N] {
    std::array::from_fn(|axis| {
        let random = match N {
            1 => hash::floats(&[seed]),
            _ => hash::floats(&[seed, axis as f32]),
        };
        100.0 + 100.0 * random
    })
}

pub fn noise(a: &Args) -> Vec3A {
    let scale = a.float(2);
    let v = a.vector(0) * scale;
    let w = a.float(1) * scale;
    let fractal = Fractal {
        kind: a.mode(1),
        detail: a.float(3).clamp(0.0, 15.0),
        roughness: a.float(4).max(0.0),
        lacunarity: a.float(5),
        offset: a.float(6),
        gain: a.float(7),
        is_normalized: a.is_on(2),
    };
    let (distortion, wants_color) = (a.float(8), a.mode(3) == 1);
    match a.mode(0) {
        0 => fractal.texture([w], distortion, wants_color),
        1 => fractal.texture([v.x, v.y], distortion, wants_color),
        2 => fractal.texture(v.to_array(), distortion, wants_color),
        _ => fractal.texture([v.x, v.y, v.z, w], distortion, wants_color),
    }
}

/// Three numbers that depend on four, the colours of the four-dimensional hash.
pub fn color_of(v: Vec4) -> Vec3A {
    Vec3A::new(
        hash::floats(&[v.x, v.y, v.z, v.w]),
        hash::floats(&[v.z, v.x, v.w, v.y]),
        hash::floats(&[v.w, v.z, v.y, v.x]),
    )
}

/// Three numbers that depend on one.
pub fn color_of_number(x: f32) -> Vec3A {
    Vec3A::new(
        hash::floats(&[x]),
        hash::floats(&[x, 1.0]),
        hash::floats(&[x, 2.0]),
    )
}

/// Three numbers that depend on two.
pub fn color_of_two(x: f32, y: f32) -> Vec3A {
    Vec3A::new(
        hash::floats(&[x, y]),
        hash::floats(&[x, y, 1.0]),
        hash::floats(&[x, y, 2.0]),
    )
}

/// Three numbers that depend on three.
pub fn color_of_three(v: Vec3A) -> Vec3A {
    let [x, y, z] = v.to_array();
    Vec3A::new(
        hash::floats(&[x, y, z]),
        hash::floats(&[x, y, z, 1.0]),
        hash::floats(&[x, y, z, 2.0]),
    )
}

pub fn white_noise(a: &Args) -> Vec3A {
    let (v, w) = (a.vector(0), a.float(1));
    let wants_color = a.mode(1) == 1;
    match (a.mode(0), wants_color) {
        (0, true) => color_of_number(w),
        (0, false) => Vec3A::splat(hash::floats(&[w])),
        (1, true) => color_of_two(v.x, v.y),
        (1, false) => Vec3A::splat(hash::floats(&[v.x, v.y])),
        (2, true) => color_of_three(v),
        (2, false) => Vec3A::splat(hash::floats(&[v.x, v.y, v.z])),
        (_, true) => color_of(v.extend(w)),
        (_, false) => Vec3A::splat(hash::floats(&[v.x, v.y, v.z, w])),
    }
}
