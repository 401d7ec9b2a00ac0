//! The records, their gradients, and where to find them.

use std::collections::HashMap;
use std::f32::consts::{PI, TAU};

use glam::Vec3A;

use crate::math::Frame;

/// Cells of the hemisphere from the pole to the horizon, of equal projected area.
pub const RINGS: usize = 6;
/// Cells around the pole: about pi times as many make cells square.
pub const SECTORS: usize = 19;

/// How far behind a record, as a share of its radius, a point may lie that it lights.
const BEHIND: f32 = 0.05;
/// Keeps the weight of a record at its own place finite.
const NEAREST: f32 = 1e-4;

/// A point to be lit.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    pub position: Vec3A,
    pub normal: Vec3A,
}

/// What was seen around a place: radiance, distance and the angle's tangent of each cell's ray,
/// ring by ring.
pub struct Hemisphere {
    pub frame: Frame,
    pub rays: Vec<(Vec3A, f32, f32)>,
}

/// Irradiance over pi at a place, and how it changes.
struct Record {
    place: Place,
    light: Vec3A,
    /// By colour: change with a turn of the normal [1/rad], along the axis of the turn.
    rotation: [Vec3A; 3],
    /// By colour: change with a move [1/m].
    translation: [Vec3A; 3],
    /// Harmonic mean distance of what was seen [m], clamped.
    radius: f32,
}

/// The records of one iteration.
pub struct Cache {
    tolerance: f32,
    records: Vec<Record>,
    /// Records by the cells of a grid that their validity reaches into, a grid for each power of
    /// two of their size.
    cells: HashMap<(i32, [i32; 3]), Vec<u32>>,
    levels: Vec<i32>,
}

impl Hemisphere {
    fn ray(&self, ring: usize, sector: usize) -> &(Vec3A, f32, f32) {
        &self.rays[ring * SECTORS + sector]
    }

    fn mean(&self) -> Vec3A {
        self.rays.iter().map(|ray| ray.0).sum::<Vec3A>() / self.rays.len() as f32
    }

    fn harmonic_mean_distance(&self) -> f32 {
        let inverse: f32 = self.rays.iter().map(|ray| 1.0 / ray.1).sum();
        self.rays.len() as f32 / inverse
    }

    /// Unit vector in the surface's plane at this angle.
    fn tangent(&self, angle: f32) -> Vec3A {
        let (sin, cos) = angle.sin_cos();
        self.frame.to_world(Vec3A::new(cos, sin, 0.0))
    }

    /// Ward and Heckbert's rotation gradient, over pi: a turn about `around` raises the sector's
    /// directions towards the normal.
    fn rotation(&self) -> [Vec3A; 3] {
        let mut gradient = [Vec3A::ZERO; 3];
        for sector in 0..SECTORS {
            let around = self.tangent(TAU * (sector as f32 + 0.5) / SECTORS as f32 + PI / 2.0);
            for ring in 0..RINGS {
                let (light, _, tangent) = self.ray(ring, sector);
                add_outer(&mut gradient, *light * *tangent, around);
            }
        }
        gradient.map(|axis| axis / self.rays.len() as f32)
    }

    /// Ward and Heckbert's translation gradient, over pi: how much more of the brighter of two
    /// neighbouring cells comes into view with a move across their border.
    fn translation(&self) -> [Vec3A; 3] {
        let mut gradient = [Vec3A::ZERO; 3];
        let sin = |border: usize| (border as f32 / RINGS as f32).sqrt();
        for sector in 0..SECTORS {
            let angle = TAU * sector as f32 / SECTORS as f32;
            let outward = self.tangent(angle + PI / SECTORS as f32);
            let around = self.tangent(angle + PI / 2.0);
            let before = (sector + SECTORS - 1) % SECTORS;
            for ring in 0..RINGS {
                let here = self.ray(ring, sector);
                if ring > 0 {
                    let inner = self.ray(ring - 1, sector);
                    let cos_squared = 1.0 - ring as f32 / RINGS as f32;
                    let share = TAU / SECTORS as f32 * sin(ring) * cos_squared;
                    let change = (here.0 - inner.0) * (share / here.1.min(inner.1));
                    add_outer(&mut gradient, change, outward);
                }
                let beside = self.ray(ring, before);
                let share = sin(ring + 1) - sin(ring);
                let change = (here.0 - beside.0) * (share / here.1.min(beside.1));
                add_outer(&mut gradient, change, around);
            }
        }
        gradient.map(|axis| axis / PI)
    }
}

/// Adds a colour times a direction.
fn add_outer(sum: &mut [Vec3A; 3], color: Vec3A, direction: Vec3A) {
    for (axis, channel) in sum.iter_mut().zip(color.to_array()) {
        *axis += channel * direction;
    }
}

/// Each colour's gradient along a vector.
fn along(gradient: &[Vec3A; 3], vector: Vec3A) -> Vec3A {
    Vec3A::from_array(gradient.map(|axis| axis.dot(vector)))
}

impl Record {
    /// Ward's weight, made zero where the tolerance is reached, so that records blend in smoothly.
    fn weight(&self, place: &Place, tolerance: f32) -> f32 {
        let offset = place.position - self.place.position;
        let behind = -0.5 * offset.dot(place.normal + self.place.normal);
        if behind > BEHIND * self.radius {
            return 0.0;
        }
        let turned = (1.0 - place.normal.dot(self.place.normal)).max(0.0).sqrt();
        let error = offset.length() / self.radius + turned;
        (1.0 / (error + NEAREST) - 1.0 / tolerance).max(0.0)
    }

    fn extrapolated(&self, place: &Place) -> Vec3A {
        let turn = self.place.normal.cross(place.normal);
        let offset = place.position - self.place.position;
        let light = self.light + along(&self.rotation, turn) + along(&self.translation, offset);
        light.max(Vec3A::ZERO)
    }
}

impl Cache {
    /// Nothing yet; `tolerance` is Ward's a.
    pub fn new(tolerance: f32) -> Self {
        Self {
            tolerance,
            records: Vec::new(),
            cells: HashMap::new(),
            levels: Vec::new(),
        }
    }

    /// Bytes held by the records.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.records[..])
    }

    /// Irradiance over pi, interpolated; `None` where no record is near enough.
    pub fn at(&self, place: &Place) -> Option<Vec3A> {
        let (mut sum, mut weights) = (Vec3A::ZERO, 0.0);
        for record in self.near(place.position) {
            let record = &self.records[record as usize];
            let weight = record.weight(place, self.tolerance);
            if weight > 0.0 {
                sum += weight * record.extrapolated(place);
                weights += weight;
            }
        }
        (weights > 0.0).then(|| sum / weights)
    }

    /// Makes a record; its validity radius stays within `radii` [m].
    pub fn insert(&mut self, place: Place, seen: &Hemisphere, radii: [f32; 2]) {
        let light = seen.mean();
        let translation = seen.translation();
        // A gradient may not take away more light than there is: Ward and Heckbert's limit.
        let steepest = translation.map(Vec3A::length);
        let mut radius = seen.harmonic_mean_distance();
        for (channel, slope) in light.to_array().into_iter().zip(steepest) {
            if slope > 0.0 {
                radius = radius.min(channel / slope);
            }
        }
        let [least, most] = radii.map(|radius| radius / self.tolerance);
        radius = radius.clamp(least, most);
        // Neighbor clamping: what is seen nearby from there can be no further from here.
        let neighbours: Vec<u32> = self.near(place.position).collect();
        let distance = |record: &Record| record.place.position.distance(place.position);
        for &index in &neighbours {
            let record = &self.records[index as usize];
            radius = radius.min(record.radius + distance(record));
        }
        for index in neighbours {
            let record = &mut self.records[index as usize];
            record.radius = record.radius.min(radius + distance(record));
        }
        self.enter(place.position, self.tolerance * radius);
        self.records.push(Record {
            place,
            light,
            rotation: seen.rotation(),
            translation,
            radius,
        });
    }

    /// Enters the next record's number into the cells within `reach` of it.
    fn enter(&mut self, position: Vec3A, reach: f32) {
        let level = (2.0 * reach).log2().ceil() as i32;
        if let Err(place) = self.levels.binary_search(&level) {
            self.levels.insert(place, level);
        }
        let low = cell(position - reach, level);
        let high = cell(position + reach, level);
        let number = self.records.len() as u32;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    self.cells
                        .entry((level, [x, y, z]))
                        .or_default()
                        .push(number);
                }
            }
        }
    }

    /// Records whose validity may reach a point.
    fn near(&self, position: Vec3A) -> impl Iterator<Item = u32> {
        let lists = self
            .levels
            .iter()
            .filter_map(move |&level| self.cells.get(&(level, cell(position, level))));
        lists.flatten().copied()
    }
}

/// The cell of a grid of 2^level metres.
fn cell(position: Vec3A, level: i32) -> [i32; 3] {
    let size = (level as f32).exp2();
    (position / size).to_array().map(|x| x.floor() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hemisphere whose ray in every cell's middle sees `light(direction)` at a distance.
    fn hemisphere(light: impl Fn(Vec3A) -> f32, distance: f32) -> Hemisphere {
        let cells = (0..RINGS).flat_map(|ring| (0..SECTORS).map(move |sector| (ring, sector)));
        let rays = cells.map(|(ring, sector)| {
            let sin_squared = (ring as f32 + 0.5) / RINGS as f32;
            let angle = TAU * (sector as f32 + 0.5) / SECTORS as f32;
            let (sin, cos) = (sin_squared.sqrt(), (1.0 - sin_squared).sqrt());
            let direction = Vec3A::new(sin * angle.cos(), sin * angle.sin(), cos);
            (Vec3A::splat(light(direction)), distance, sin / cos)
        });
        Hemisphere {
            frame: Frame::IDENTITY,
            rays: rays.collect(),
        }
    }

    #[test]
    fn even_light_has_no_gradient() {
        let seen = hemisphere(|_| 2.0, 3.0);
        assert!((seen.mean().x - 2.0).abs() < 1e-6);
        assert!((seen.harmonic_mean_distance() - 3.0).abs() < 1e-5);
        for axis in seen.rotation().into_iter().chain(seen.translation()) {
            assert!(axis.length() < 1e-5, "{axis}");
        }
    }

    /// Radiance 1 + x: irradiance over pi is 1 + (2/3) n.x, so turning the normal about y by t
    /// changes it by (2/3) sin t.
    #[test]
    fn the_rotation_gradient_of_a_linear_sky_is_exact_up_to_the_cells() {
        let seen = hemisphere(|direction| 1.0 + direction.x, 1.0);
        // The middles of 6 rings stand for the horizon, where the tangent grows without bound.
        let cells = (0..RINGS).map(|ring| (ring as f32 + 0.5) / RINGS as f32);
        let mean: f32 = cells.map(|sin| sin / (1.0 - sin).sqrt()).sum::<f32>() / RINGS as f32;
        assert!((0.5 * mean - 2.0 / 3.0).abs() < 0.15);
        let found = seen.rotation()[0];
        let expected = Vec3A::new(0.0, 0.5 * mean, 0.0);
        assert!((found - expected).length() < 1e-3, "{found}");
    }

    /// Under a ceiling at height h with radiance x the irradiance over pi at x is x: its gradient is
    /// 1, whatever h. The cells cut off what lies near the horizon.
    #[test]
    fn the_translation_gradient_of_a_ramp_on_a_ceiling_is_its_slope() {
        let height = 2.0;
        let mut seen = hemisphere(|d| height * d.x / d.z, 0.0);
        for (index, ray) in seen.rays.iter_mut().enumerate() {
            let sin_squared = ((index / SECTORS) as f32 + 0.5) / RINGS as f32;
            ray.1 = height / (1.0 - sin_squared).sqrt();
        }
        let found = seen.translation()[0];
        assert!((found.x - 1.0).abs() < 0.25, "{found}");
        assert!(found.y.abs() < 1e-4 && found.z.abs() < 1e-4, "{found}");
    }

    fn at(x: f32) -> Place {
        Place {
            position: Vec3A::new(x, 0.0, 0.0),
            normal: Vec3A::Z,
        }
    }

    #[test]
    fn a_record_serves_its_surroundings_and_no_more() {
        let mut cache = Cache::new(0.5);
        assert!(cache.at(&at(0.0)).is_none());
        cache.insert(at(0.0), &hemisphere(|_| 2.0, 1.0), [0.0, 10.0]);
        assert!((cache.at(&at(0.4)).unwrap().x - 2.0).abs() < 1e-5);
        assert!(cache.at(&at(0.6)).is_none());
        let turned = Place {
            normal: Vec3A::X,
            ..at(0.0)
        };
        assert!(cache.at(&turned).is_none());
        let behind = Place {
            position: Vec3A::new(0.0, 0.0, -0.2),
            ..at(0.0)
        };
        assert!(cache.at(&behind).is_none());
    }

    #[test]
    fn a_near_wall_seen_by_one_record_is_known_to_its_neighbours() {
        let mut cache = Cache::new(0.5);
        cache.insert(at(0.0), &hemisphere(|_| 2.0, 1.0), [0.0, 10.0]);
        cache.insert(at(0.2), &hemisphere(|_| 2.0, 0.1), [0.0, 10.0]);
        assert!((cache.records[0].radius - 0.3).abs() < 1e-6);
    }
}
