//! Voronoi: one point in each cell of a lattice (Worley, "A Cellular Texture Basis Function",
//! SIGGRAPH 1996). The distance to edges is Quilez' ("Voronoi edges", 2012), as in Blender.

use glam::{Vec3A, Vec4};

use super::super::operation::Args;
use super::{divided, hash, lerp, noise, smoothstep};

/// Inputs of the node after their ranges.
struct Voronoi {
    dimensions: usize,
    metric: usize,
    feature: usize,
    scale: f32,
    detail: f32,
    roughness: f32,
    lacunarity: f32,
    smoothness: f32,
    exponent: f32,
    randomness: f32,
    is_normalized: bool,
    hash: Hash,
}

/// Blender 5.0 changed the hash of cells in more than one dimension.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Hash {
    Lookup3,
    Pcg,
}

/// What a point knows of the cells around it.
#[derive(Clone, Copy, Default)]
struct Found {
    distance: f32,
    color: Vec3A,
    position: Vec4,
}

/// A cell's point, relative to the cell at hand.
#[derive(Clone, Copy)]
struct Cell {
    /// Of the cell itself.
    offset: Vec4,
    point: Vec4,
}

const F2: usize = 1;
const SMOOTH_F1: usize = 2;

impl Voronoi {
    /// Visits cells up to `reach` away, in Blender's order: the first axis fastest. Loops, as an
    /// iterator of iterators takes several times as long.
    #[inline]
    fn for_cells(&self, lattice: Vec4, reach: i32, mut visit: impl FnMut(Cell)) {
        let range = |axis: usize| {
            let reach = if axis < self.dimensions { reach } else { 0 };
            -reach..=reach
        };
        for w in range(3) {
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        let offset = Vec4::new(x as f32, y as f32, z as f32, w as f32);
                        let point = offset + self.jitter(lattice + offset) * self.randomness;
                        visit(Cell { offset, point });
                    }
                }
            }
        }
    }

    /// Where in its cell the point lies.
    fn jitter(&self, cell: Vec4) -> Vec4 {
        let [x, y, z, w] = cell.to_array();
        match (self.dimensions, self.hash) {
            (1, _) => Vec4::new(hash::floats(&[x]), 0.0, 0.0, 0.0),
            (2, Hash::Lookup3) => {
                Vec4::new(hash::floats(&[x, y]), hash::floats(&[x, y, 1.0]), 0.0, 0.0)
            }
            (3, Hash::Lookup3) => noise::color_of_three(cell.truncate().into()).extend(0.0),
            (_, Hash::Lookup3) => Vec4::new(
                hash::floats(&[x, y, z, w]),
                hash::floats(&[w, x, y, z]),
                hash::floats(&[z, w, x, y]),
                hash::floats(&[y, z, w, x]),
            ),
            (2, Hash::Pcg) => {
                let [u, v] = hash::cell([x as i32, y as i32]);
                Vec4::new(u, v, 0.0, 0.0)
            }
            (3, Hash::Pcg) => self.color(cell).extend(0.0),
            (_, Hash::Pcg) => Vec4::from_array(hash::cell([x, y, z, w].map(|v| v as i32))),
        }
    }

    fn color(&self, cell: Vec4) -> Vec3A {
        let [x, y, z, w] = cell.to_array();
        let pcg = |z: f32| Vec3A::from_array(hash::cell([x, y, z].map(|v| v as i32)));
        match (self.dimensions, self.hash) {
            (1, _) => noise::color_of_number(x),
            (2, Hash::Lookup3) => noise::color_of_two(x, y),
            (3, Hash::Lookup3) => noise::color_of_three(cell.truncate().into()),
            (_, Hash::Lookup3) => noise::color_of(cell),
            (2, Hash::Pcg) => pcg(0.0),
            (3, Hash::Pcg) => pcg(z),
            (_, Hash::Pcg) => {
                let [r, g, b, _] = hash::cell([x, y, z, w].map(|v| v as i32));
                Vec3A::new(r, g, b)
            }
        }
    }

    fn distance(&self, a: Vec4, b: Vec4) -> f32 {
        let d = (a - b).abs();
        match self.metric {
            _ if self.dimensions == 1 => d.x,
            0 => d.length(),
            1 => d.element_sum(),
            2 => d.max_element(),
            _ => d
                .powf(self.exponent)
                .element_sum()
                .powf(1.0 / self.exponent),
        }
    }

    fn found(&self, lattice: Vec4, cell: Cell, distance: f32) -> Found {
        Found {
            distance,
            color: self.color(lattice + cell.offset),
            position: lattice + cell.point,
        }
    }

    /// The nearest point, or the second nearest.
    fn nearest(&self, p: Vec4) -> Found {
        let lattice = p.floor();
        let local = p - lattice;
        let nowhere = Cell {
            offset: Vec4::ZERO,
            point: Vec4::ZERO,
        };
        let (mut first, mut second) = ((f32::MAX, nowhere), (f32::MAX, nowhere));
        self.for_cells(lattice, 1, |cell| {
            let distance = self.distance(cell.point, local);
            if distance < first.0 {
                second = first;
                first = (distance, cell);
            } else if distance < second.0 {
                second = (distance, cell);
            }
        });
        let (distance, cell) = if self.feature == F2 { second } else { first };
        self.found(lattice, cell, distance)
    }

    /// A blend of the near points in the order of their cells.
    fn smooth(&self, p: Vec4) -> Found {
        let lattice = p.floor();
        let local = p - lattice;
        let mut sum = Found::default();
        let mut is_first = true;
        self.for_cells(lattice, 2, |cell| {
            let distance = self.distance(cell.point, local);
            let h = if is_first {
                1.0
            } else {
                smoothstep(0.5 + 0.5 * (sum.distance - distance) / self.smoothness)
            };
            is_first = false;
            let correction = self.smoothness * h * (1.0 - h);
            sum.distance = lerp(sum.distance, distance, h) - correction;
            let correction = correction / (1.0 + 3.0 * self.smoothness);
            let color = self.color(lattice + cell.offset);
            sum.color = sum.color.lerp(color, h) - correction;
            sum.position = sum.position.lerp(cell.point, h) - correction;
        });
        sum.position += lattice;
        sum
    }

    /// Distance to the nearest edge between two cells.
    fn edge(&self, p: Vec4) -> f32 {
        /// Squared distance of points below which they are the same.
        const SAME: f32 = 1e-4;
        let lattice = p.floor();
        let local = p - lattice;
        if self.dimensions == 1 {
            return self.edge_in_one_dimension(lattice, local.x);
        }
        let mut nearest = Vec4::MAX;
        self.for_cells(lattice, 1, |cell| {
            let v = cell.point - local;
            if v.length_squared() < nearest.length_squared() {
                nearest = v;
            }
        });
        let mut edge = f32::MAX;
        self.for_cells(lattice, 1, |cell| {
            let v = cell.point - local;
            if (v - nearest).length_squared() > SAME {
                let middle = 0.5 * (nearest + v);
                edge = edge.min(middle.dot((v - nearest).normalize_or_zero()));
            }
        });
        edge
    }

    fn edge_in_one_dimension(&self, lattice: Vec4, local: f32) -> f32 {
        let (mut before, mut edge) = (None, f32::MAX);
        self.for_cells(lattice, 1, |cell| {
            let point = cell.point.x;
            if let Some(before) = before.replace(point) {
                edge = edge.min((0.5 * (before + point) - local).abs());
            }
        });
        edge
    }

    /// Half the distance from the nearest point to the one nearest to that.
    fn radius(&self, p: Vec4) -> f32 {
        let lattice = p.floor();
        let local = p - lattice;
        let (mut distance, mut point, mut offset) = (f32::MAX, Vec4::ZERO, Vec4::ZERO);
        self.for_cells(lattice, 1, |cell| {
            let here = cell.point.distance(local);
            if here < distance {
                (distance, point, offset) = (here, cell.point, cell.offset);
            }
        });
        let mut nearest = f32::MAX;
        self.for_cells(lattice + offset, 1, |cell| {
            if cell.offset != Vec4::ZERO {
                nearest = nearest.min((offset + cell.point).distance(point));
            }
        });
        0.5 * nearest
    }

    /// Octaves, summed like noise.
    fn fractal(&self, p: Vec4) -> Found {
        let is_single = self.detail == 0.0 || self.roughness == 0.0;
        let (mut amplitude, mut total, mut scale) = (1.0, 0.0, 1.0);
        let mut sum = Found::default();
        for octave in 0..=self.detail.ceil() as u32 {
            let found = self.octave(p * scale);
            if is_single {
                (sum, total) = (found, 1.0);
                break;
            }
            // The last octave counts by its fraction.
            let share = (self.detail - octave as f32 + 1.0).min(1.0);
            total += share * amplitude;
            sum.distance += share * amplitude * found.distance;
            sum.color += share * amplitude * found.color;
            sum.position = sum.position.lerp(found.position / scale, share * amplitude);
            scale *= self.lacunarity;
            amplitude *= self.roughness;
        }
        if self.is_normalized {
            sum.distance /= total * self.largest_distance();
            sum.color /= total;
        }
        sum.position = Vec4::from_array(sum.position.to_array().map(|x| divided(x, self.scale)));
        sum
    }

    fn octave(&self, p: Vec4) -> Found {
        if self.feature == SMOOTH_F1 && self.smoothness != 0.0 {
            self.smooth(p)
        } else {
            self.nearest(p)
        }
    }

    /// The largest distance that can be expected.
    fn largest_distance(&self) -> f32 {
        let half = 0.5 + 0.5 * self.randomness;
        let axes = [0, 1, 2, 3].map(|axis| if axis < self.dimensions { half } else { 0.0 });
        let factor = if self.feature == F2 { 2.0 } else { 1.0 };
        factor * self.distance(Vec4::ZERO, Vec4::from_array(axes))
    }

    fn fractal_edge(&self, p: Vec4) -> f32 {
        let largest = 0.5 + 0.5 * self.randomness;
        let is_single = self.detail == 0.0 || self.roughness == 0.0;
        let (mut amplitude, mut total, mut scale, mut distance) = (1.0, largest, 1.0, 8.0_f32);
        for octave in 0..=self.detail.ceil() as u32 {
            let edge = self.edge(p * scale);
            if is_single {
                distance = edge;
                break;
            }
            let share = (self.detail - octave as f32 + 1.0).min(1.0);
            total = lerp(total, lerp(total, largest / scale, amplitude), share);
            let nearer = lerp(distance, distance.min(edge / scale), amplitude);
            distance = lerp(distance, nearer.min(distance), share);
            scale *= self.lacunarity;
            amplitude *= self.roughness;
        }
        if self.is_normalized {
            distance / total
        } else {
            distance
        }
    }
}

pub fn voronoi(a: &Args) -> Vec3A {
    let scale = a.float(2);
    let (v, w) = (a.vector(0) * scale, a.float(1) * scale);
    let voronoi = Voronoi {
        dimensions: a.mode(0) + 1,
        metric: a.mode(1),
        feature: a.mode(2),
        scale,
        detail: a.float(3).clamp(0.0, 15.0),
        roughness: a.float(4).clamp(0.0, 1.0),
        lacunarity: a.float(5),
        smoothness: (0.5 * a.float(6)).clamp(0.0, 0.5),
        exponent: a.float(7),
        randomness: a.float(8).clamp(0.0, 1.0),
        is_normalized: a.is_on(3),
        hash: if a.is_on(5) { Hash::Pcg } else { Hash::Lookup3 },
    };
    let p = match voronoi.dimensions {
        1 => Vec4::new(w, 0.0, 0.0, 0.0),
        2 => Vec4::new(v.x, v.y, 0.0, 0.0),
        3 => v.extend(0.0),
        _ => v.extend(w),
    };
    let (feature, output) = (a.mode(2), a.mode(4));
    match (feature, output) {
        (3, 0) => Vec3A::splat(voronoi.fractal_edge(p)),
        (4, 4) => Vec3A::splat(voronoi.radius(p)),
        (3 | 4, _) => Vec3A::ZERO,
        _ => {
            let found = voronoi.fractal(p);
            let is_line = voronoi.dimensions == 1;
            match output {
                0 => Vec3A::splat(found.distance),
                1 => found.color,
                2 if is_line => Vec3A::ZERO,
                2 => Vec3A::from_vec4(found.position),
                3 if is_line => Vec3A::splat(found.position.x),
                3 => Vec3A::splat(found.position.w),
                _ => Vec3A::ZERO,
            }
        }
    }
}
