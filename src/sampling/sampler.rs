//! Well-distributed random numbers, each a pure function of (seed, frame, pixel, iteration, use).
//!
//! Owen-scrambled Sobol points, padded: every use owns a four-dimensional point of its own, and the
//! uses are decorrelated by seed. Source: Burley, "Practical Hash-based Owen Scrambling", JCGT
//! 9(4), 2020, section 5. Padding gives every use the two best Sobol dimensions, has no limit on
//! the number of uses, and adding a use shifts no other. This is the only file that knows the
//! sequence crate.
//!
//! The pixels of a tile take runs of one sequence, in the order of a Z-shaped curve: two neighbours
//! together, a square of four, of sixteen are stratified as one pixel with so many samples would be.
//! What neighbours lend each other then makes up for each other's gaps, and what is left is noise of
//! high frequency, which eyes and denoisers take out best. Source: Ahmed and Wonka, "Screen-Space
//! Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels", ACM TOG
//! 39(6), 2020. Departure: their shuffling of the four quadrants is Burley's of the halves.

use std::sync::LazyLock;

use sobol_burley::parts::{
    Int4, hash, hash_int4, owen_scramble_int4_rev, owen_scramble_rev, sobol_int4_rev,
};

/// Samples of the sequence before the crate's direction numbers run out.
const SEQUENCE_BITS: u32 = 16;

/// The random numbers of one path.
///
/// Consecutive iterations of a pixel are stratified against each other, so give a path's
/// iterations the indices 0, 1, 2, ...: taking every fourth index only would confine a pixel to a
/// quarter of each hemisphere. Fewer than there were to be are stratified as well, but less so
/// against those of other pixels.
#[derive(Debug, Clone, Copy)]
pub struct Sampler {
    seed: u32,
    index: u32,
}

/// What a camera ray needs.
#[derive(Debug, Clone, Copy)]
pub struct CameraSample {
    /// Position inside the pixel.
    pub pixel: [f32; 2],
    /// Position on the lens.
    pub lens: [f32; 2],
}

/// What choosing a light, and a direction towards it, needs.
#[derive(Debug, Clone, Copy)]
pub struct LightUse {
    /// Chooses the light.
    pub choice: f32,
    /// Chooses a part of it, where `choice` is spent on finding it among many.
    pub inside: f32,
    /// Chooses the direction.
    pub direction: [f32; 2],
}

/// What continuing a path needs.
#[derive(Debug, Clone, Copy)]
pub struct ScatterUse {
    /// Chooses the lobe.
    pub lobe: f32,
    /// Chooses the direction.
    pub direction: [f32; 2],
    /// Russian roulette.
    pub roulette: f32,
}

/// Numbers for a walk: the first [`WELL_DISTRIBUTED`] are points of the sequence, four at a time, the others
/// plain random ones.
#[derive(Debug, Clone)]
pub struct Walk {
    point: [f32; 4],
    /// Of the sequence.
    index: u32,
    set: u32,
    seed: u32,
    count: u32,
}

/// The first steps of a walk decide most; later ones are too many for their stratification to show.
const WELL_DISTRIBUTED: u32 = 32;

impl Walk {
    /// The next number, from 0 to below 1.
    #[allow(clippy::should_implement_trait, reason = "it never ends")]
    pub fn next(&mut self) -> f32 {
        let index = self.count;
        if index.is_multiple_of(4) && index > 0 {
            self.point = self.fresh(index);
        }
        self.count += 1;
        self.point[index as usize % 4]
    }

    /// The next four numbers that belong together: what is left of four is skipped.
    pub fn next_point(&mut self) -> [f32; 4] {
        let index = self.count.next_multiple_of(4);
        if index > 0 {
            self.point = self.fresh(index);
        }
        self.count = index + 4;
        self.point
    }

    fn fresh(&self, index: u32) -> [f32; 4] {
        /// The bits that a float holds.
        const UNIT: f32 = 1.0 / (1 << 24) as f32;
        if index < WELL_DISTRIBUTED {
            return point_4d(self.index, mix(self.set ^ index));
        }
        std::array::from_fn(|k| {
            let place = (index + k as u32).wrapping_mul(0x9e37_79b9);
            (mix(self.seed.wrapping_add(place)) >> 8) as f32 * UNIT
        })
    }
}

/// Uses of a vertex of a path; the camera counts as vertex 0's neighbour below.
#[derive(Debug, Clone, Copy)]
enum Use {
    Camera,
    Light,
    Scatter,
    Transparency,
    Sky,
    Time,
    Walk,
    Medium,
}

/// Uses a vertex may have, a power of two.
const USES_PER_VERTEX: u32 = 8;

impl Sampler {
    /// The numbers of one of `samples` iterations of a pixel (column, row) of a frame.
    pub fn new(seed: u32, frame: i32, pixel: [u32; 2], iteration: u32, samples: u32) -> Self {
        let samples = samples.min(1 << SEQUENCE_BITS);
        let run_bits = samples.next_power_of_two().trailing_zeros();
        let side_bits = (SEQUENCE_BITS - run_bits) / 2;
        let [column, row] = pixel.map(|at| at >> side_bits);
        let place = pixel.map(|at| at & ((1 << side_bits) - 1));
        let words = [frame as u32, column, row, iteration >> run_bits];
        Self {
            seed: words
                .into_iter()
                .fold(mix(seed), |hash, word| mix(hash ^ word)),
            index: z_order(place) << run_bits | iteration & ((1 << run_bits) - 1),
        }
    }

    /// The camera ray's numbers.
    pub fn camera(&self) -> CameraSample {
        let [x, y, u, v] = self.point(0, Use::Camera);
        CameraSample {
            pixel: [x, y],
            lens: [u, v],
        }
    }

    /// One number that chooses the time at which the path meets the scene.
    pub fn time(&self) -> f32 {
        self.point(0, Use::Time)[0]
    }

    /// Numbers for a light sample at the path's vertex number `vertex`.
    pub fn light(&self, vertex: u32) -> LightUse {
        let [x, y, choice, inside] = self.point(vertex, Use::Light);
        LightUse {
            choice,
            inside,
            direction: [x, y],
        }
    }

    /// Numbers for a direction to the sky, where it has a sample of its own.
    pub fn sky(&self, vertex: u32) -> [f32; 2] {
        let [x, y, ..] = self.point(vertex, Use::Sky);
        [x, y]
    }

    /// Numbers for going on from the path's vertex number `vertex`.
    pub fn scatter(&self, vertex: u32) -> ScatterUse {
        let [x, y, lobe, roulette] = self.point(vertex, Use::Scatter);
        ScatterUse {
            lobe,
            direction: [x, y],
            roulette,
        }
    }

    /// Two numbers that decide where the ray from the path's vertex number `vertex` is scattered.
    pub fn medium(&self, vertex: u32) -> [f32; 2] {
        let [channel, u, ..] = self.point(vertex, Use::Medium);
        [channel, u]
    }

    /// Two numbers that choose where on that ray light is looked for.
    pub fn in_scattering(&self, vertex: u32) -> [f32; 2] {
        let [.., choice, u] = self.point(vertex, Use::Medium);
        [choice, u]
    }

    /// Numbers for a walk of any length below the surface at the path's vertex number `vertex`.
    pub fn walk(&self, vertex: u32) -> Walk {
        self.numbers(vertex, Use::Walk, [vertex, self.index])
    }

    /// Numbers that decide what becomes of the ray from the path's vertex number `vertex` in media
    /// that differ from place to place; the first two are those of [`Sampler::medium`].
    pub fn flight(&self, vertex: u32) -> Walk {
        self.numbers(vertex, Use::Medium, [!vertex, self.index])
    }

    /// The same for the rays that look for light from there.
    pub fn shade(&self, vertex: u32) -> Walk {
        // Only vertex 0 is the camera's: those after it have the place of its numbers to spare.
        let free = vertex.wrapping_add(1);
        self.numbers(free, Use::Camera, [vertex ^ 1 << 31, self.index])
    }

    fn numbers(&self, vertex: u32, purpose: Use, words: [u32; 2]) -> Walk {
        Walk {
            point: self.point(vertex, purpose),
            index: self.index,
            set: self.seed_of(vertex, purpose),
            seed: words
                .into_iter()
                .fold(mix(self.seed), |hash, word| mix(hash ^ word)),
            count: 0,
        }
    }

    /// One number that decides whether a ray passes a transparent surface; `surface` counts the
    /// surfaces met along the path.
    pub fn transparency(&self, surface: u32) -> f32 {
        self.point(surface, Use::Transparency)[0]
    }

    /// Where the directions begin in which a program looks around: numbers of a surface that no ray
    /// meets.
    pub fn around(&self, vertex: u32) -> [f32; 2] {
        let [x, y, ..] = self.point(!vertex, Use::Transparency);
        [x, y]
    }

    fn point(&self, vertex: u32, purpose: Use) -> [f32; 4] {
        point_4d(self.index, self.seed_of(vertex, purpose))
    }

    fn seed_of(&self, vertex: u32, purpose: Use) -> u32 {
        let set = vertex.wrapping_mul(USES_PER_VERTEX) + purpose as u32;
        mix(self.seed ^ set.wrapping_mul(0x9e37_79b9))
    }
}

/// For each value of four bits of an index, the highest first, what they add to the first four
/// dimensions of its Sobol point, all with their bits reversed: a point is the sum without carry of
/// what its bits add.
static SOBOL: LazyLock<[[Int4; 16]; 4]> = LazyLock::new(|| {
    std::array::from_fn(|part| {
        std::array::from_fn(|bits| sobol_int4_rev((bits as u32) << (28 - 4 * part), 0))
    })
});

/// What `sobol_burley::sample_4d` returns for the first four dimensions, bit by bit. That one works
/// through the bits of the index in a loop, whose length nobody can predict.
fn point_4d(index: u32, seed: u32) -> [f32; 4] {
    let shuffled = owen_scramble_rev(index.reverse_bits(), hash(seed ^ 0x79c6_8e4a));
    let of_part = |part: usize| SOBOL[part][(shuffled >> (28 - 4 * part)) as usize % 16];
    let sobol = of_part(0) ^ of_part(1) ^ of_part(2) ^ of_part(3);
    let own: Int4 = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8].into();
    let scramble = own ^ [seed.wrapping_mul(0x9c8f_2d3b); 4].into();
    let scrambled = owen_scramble_int4_rev(sobol, hash_int4(scramble));
    scrambled.reverse_bits().to_f32_norm()
}

/// The number of a place on the Z-shaped curve: the bits of both coordinates in turns.
fn z_order([x, y]: [u32; 2]) -> u32 {
    spread(x) | spread(y) << 1
}

/// The lower 16 bits with a zero above each.
fn spread(x: u32) -> u32 {
    let x = (x | x << 8) & 0x00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}

/// A bijective hash of 32 bits in which every input bit flips half of the output bits.
///
/// Constants: Ettinger's search, <https://github.com/skeeto/hash-prospector> (bias 0.17).
fn mix(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sobol_burley::sample_4d;

    #[test]
    fn points_are_those_of_the_crate() {
        for index in (0..1 << SEQUENCE_BITS).step_by(7) {
            let seed = mix(index);
            assert_eq!(point_4d(index, seed), sample_4d(index, 0, seed));
        }
    }

    #[test]
    fn numbers_are_a_pure_function_and_differ_in_every_argument() {
        let scatter = |seed, frame, pixel, iteration, samples| {
            let sampler = Sampler::new(seed, frame, pixel, iteration, samples);
            sampler.scatter(5).direction
        };
        let sampler = Sampler::new(1, 2, [3, 7], 4, 16);
        let base = sampler.scatter(5).direction;
        assert_eq!(base, scatter(1, 2, [3, 7], 4, 16));
        for other in [
            scatter(0, 2, [3, 7], 4, 16),
            scatter(1, 3, [3, 7], 4, 16),
            scatter(1, 2, [4, 7], 4, 16),
            scatter(1, 2, [3, 8], 4, 16),
            scatter(1, 2, [3 + 1024, 7], 4, 16),
            scatter(1, 2, [3, 7 + 1024], 4, 16),
            scatter(1, 2, [3, 7], 5, 16),
            scatter(1, 2, [3, 7], 4 + 16, 16),
            sampler.scatter(6).direction,
            sampler.light(5).direction,
        ] {
            assert_ne!(base, other);
        }
    }

    /// How many points fall into each of `columns` x `rows` cells.
    fn counts(points: impl Iterator<Item = [f32; 2]>, columns: usize, rows: usize) -> Vec<u32> {
        let mut counts = vec![0; columns * rows];
        for [x, y] in points {
            counts[(y * rows as f32) as usize * columns + (x * columns as f32) as usize] += 1;
        }
        counts
    }

    /// A (0, 2)-sequence in base 2: the first 256 points put exactly one point into each of the
    /// 16 x 16 cells, and into every other elementary interval of that area.
    #[test]
    fn two_dimensional_points_are_stratified() {
        for (columns, rows) in [(16, 16), (256, 1), (4, 64), (1, 256)] {
            let point = |i| Sampler::new(7, 1, [99, 5], i, 256).light(3).direction;
            let counts = counts((0..256).map(point), columns, rows);
            assert!(counts.iter().all(|&c| c == 1), "{columns} x {rows}");
        }
    }

    /// The same of a square of pixels that have fewer samples each.
    #[test]
    fn neighbouring_pixels_are_stratified_against_each_other() {
        for (side, samples) in [(16, 1), (8, 4), (4, 16), (2, 64)] {
            let pixels = (0..side * side).map(|i| [40 * side + i % side, 6 * side + i / side]);
            let points = pixels.flat_map(|pixel| {
                (0..samples).map(move |i| Sampler::new(7, 1, pixel, i, samples).light(3).direction)
            });
            for (columns, rows) in [(16, 16), (256, 1), (4, 64), (1, 256)] {
                let counts = counts(points.clone(), columns, rows);
                assert!(counts.iter().all(|&c| c == 1), "{columns} x {rows}");
            }
        }
    }

    /// Where a frame ends before all samples are taken, each pixel's are stratified all the same.
    #[test]
    fn the_first_half_of_the_samples_is_stratified() {
        for (columns, rows) in [(4, 4), (16, 1), (1, 16)] {
            let point = |i| Sampler::new(7, 1, [99, 5], i, 32).light(3).direction;
            let counts = counts((0..16).map(point), columns, rows);
            assert!(counts.iter().all(|&c| c == 1), "{columns} x {rows}");
        }
    }

    /// Sum of products of centred numbers over 2^14 tiles: standard deviation 1/12/128, checked
    /// at 5 of them (error rate 6e-7 a comparison, 10 comparisons).
    #[test]
    fn uses_and_tiles_are_uncorrelated() {
        let numbers = |tile: u32| {
            let sampler = Sampler::new(0, 1, [tile << 8, 0], 0, 1);
            let (light, scatter) = (sampler.light(0), sampler.scatter(0));
            let next = Sampler::new(0, 1, [(tile + 1) << 8, 0], 0, 1).light(0);
            [
                light.direction[0],
                light.choice,
                scatter.direction[0],
                scatter.lobe,
                next.direction[0],
            ]
        };
        let mut products = [[0f64; 5]; 5];
        for tile in 0..1 << 14 {
            let x = numbers(tile).map(|x| f64::from(x) - 0.5);
            for (i, row) in products.iter_mut().enumerate() {
                for (j, sum) in row.iter_mut().enumerate() {
                    *sum += x[i] * x[j] / f64::from(1 << 14);
                }
            }
        }
        for (i, row) in products.iter().enumerate() {
            for (j, mean) in row.iter().enumerate().skip(i + 1) {
                assert!(mean.abs() < 5.0 / 12.0 / 128.0, "{i} {j}: {mean}");
            }
        }
    }

    #[test]
    fn any_iteration_and_vertex_is_in_range() {
        for iteration in [0, 65_535, 65_536, 1 << 20, u32::MAX] {
            for (vertex, samples) in [
                (0, 0),
                (63, 1),
                (64, 100),
                (1_024, 65_535),
                (u32::MAX, u32::MAX),
            ] {
                let sampler = Sampler::new(u32::MAX, i32::MIN, [u32::MAX; 2], iteration, samples);
                let scatter = sampler.scatter(vertex);
                let [x, y] = scatter.direction;
                for u in [x, y, scatter.lobe, scatter.roulette] {
                    assert!((0.0..1.0).contains(&u));
                }
            }
        }
    }
}
