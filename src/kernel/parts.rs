//! Large sets of boxes are divided into parts, and a tree is built for each part by itself: parts are
//! built side by side, their trees fit into the processor's cache while they are made, and what is
//! needed in between takes little memory. Small ones are one part.

use super::node::WIDTH;
use obvhs::aabb::Aabb;

/// Boxes of a part at most. Larger parts take longer to build and gain nothing for rays.
const PART: usize = 1 << 13;

/// Boxes of a set that is not divided: above fewer parts than a node has children there would be a
/// node more on the way of each ray.
pub const UNDIVIDED: usize = WIDTH * PART;

/// Planes between which a set may be divided, along its widest axis, and one.
const BINS: usize = 32;

/// Reorders `members`, numbers of boxes, so that each part is one stretch of them. The parts do not
/// depend on the number of threads.
pub fn divide<'a>(boxes: &[Aabb], members: &'a mut [u32]) -> Vec<&'a mut [u32]> {
    if members.len() <= UNDIVIDED {
        return vec![members];
    }
    divided(boxes, members)
}

fn divided<'a>(boxes: &[Aabb], members: &'a mut [u32]) -> Vec<&'a mut [u32]> {
    if members.len() <= PART {
        return vec![members];
    }
    let middle = split(boxes, members);
    let (first, second) = members.split_at_mut(middle);
    let (mut parts, others) = rayon::join(|| divided(boxes, first), || divided(boxes, second));
    parts.extend(others);
    parts
}

/// The boxes whose centres lie in a slice of space.
#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self {
        bounds: Aabb::INVALID,
        count: 0,
    };

    fn and(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&other.bounds),
            count: self.count + other.count,
        }
    }

    /// What rays pay for it.
    fn cost(&self) -> f32 {
        if self.count == 0 {
            return f32::INFINITY; // nothing is no half
        }
        self.bounds.half_area() * self.count as f32
    }
}

/// Brings the members of the first half to the front, and returns how many they are: of the planes
/// between bins along the widest axis, that by which rays pay least (Wald, "On fast Construction of
/// SAH-based Bounding Volume Hierarchies", RT 2007).
fn split(boxes: &[Aabb], members: &mut [u32]) -> usize {
    let centre = |member: u32| boxes[member as usize].center();
    let mut centres = Aabb::INVALID;
    for &member in &*members {
        centres.extend(centre(member));
    }
    let size = centres.diagonal();
    let axis = (0..3).fold(0, |a, b| if size[b] > size[a] { b } else { a });
    let (lower, scale) = (centres.min[axis], BINS as f32 / size[axis]);
    let bin_of = |member: u32| (((centre(member)[axis] - lower) * scale) as usize).min(BINS - 1);
    let mut bins = [Bin::EMPTY; BINS];
    for &member in &*members {
        let bin = &mut bins[bin_of(member)];
        bin.bounds = bin.bounds.union(&boxes[member as usize]);
        bin.count += 1;
    }
    match cheapest_plane(&bins) {
        Some(plane) => partition(members, |member| bin_of(member) < plane),
        None => members.len() / 2, // all centres are the same
    }
}

/// The first bin of the second half; None where all are in one bin.
fn cheapest_plane(bins: &[Bin; BINS]) -> Option<usize> {
    let mut above = [Bin::EMPTY; BINS];
    above[BINS - 1] = bins[BINS - 1];
    for i in (0..BINS - 1).rev() {
        above[i] = above[i + 1].and(&bins[i]);
    }
    let (mut best, mut least) = (None, f32::INFINITY);
    let mut below = Bin::EMPTY;
    for plane in 1..BINS {
        below = below.and(&bins[plane - 1]);
        let cost = below.cost() + above[plane].cost();
        if cost < least {
            (best, least) = (Some(plane), cost);
        }
    }
    best
}

/// Brings those that are `first` to the front, and returns how many they are.
fn partition(members: &mut [u32], first: impl Fn(u32) -> bool) -> usize {
    let mut count = 0;
    for i in 0..members.len() {
        if first(members[i]) {
            members.swap(i, count);
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3A;

    fn boxes(place: impl Fn(usize) -> Vec3A) -> Vec<Aabb> {
        let around = |at: Vec3A| Aabb::new(at - 0.1, at + 0.1);
        (0..10 * PART).map(|i| around(place(i))).collect()
    }

    #[test]
    fn parts_are_small_and_hold_every_box_once() {
        let spread = |i: usize| Vec3A::new((i % 97) as f32, (i % 89) as f32, (i % 1013) as f32);
        for boxes in [boxes(spread), boxes(|_| Vec3A::ONE)] {
            let mut members: Vec<u32> = (0..boxes.len() as u32).collect();
            let parts = divide(&boxes, &mut members);
            assert!(parts.iter().all(|part| (1..=PART).contains(&part.len())));
            members.sort_unstable();
            assert!(members.into_iter().eq(0..boxes.len() as u32));
        }
    }

    #[test]
    fn a_gap_is_where_a_set_is_divided() {
        let two_heaps = |i: usize| {
            Vec3A::X
                * if i.is_multiple_of(5) {
                    100.0
                } else {
                    (i % 7) as f32
                }
        };
        let boxes = boxes(two_heaps);
        let mut members: Vec<u32> = (0..boxes.len() as u32).collect();
        let count = split(&boxes, &mut members);
        assert_eq!(count, 8 * PART);
        assert!(members[..count].iter().all(|&m| m % 5 != 0));
    }
}
