//! How things move while the shutter is open.

use glam::{Affine3A, BVec3A, Mat3A, Quat, Vec3A};

/// A placement and what follows from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// The placement.
    pub world_from_object: Affine3A,
    /// Its inverse.
    pub object_from_world: Affine3A,
    /// Inverse transpose of the placement's linear part, for normals.
    pub world_from_normal: Mat3A,
}

impl Placement {
    /// What follows from a matrix that has an inverse.
    pub fn new(world_from_object: Affine3A) -> Self {
        let object_from_world = world_from_object.inverse();
        Self {
            world_from_object,
            object_from_world,
            world_from_normal: object_from_world.matrix3.transpose(),
        }
    }
}

/// Lower and upper corner of a box.
pub type Bounds = (Vec3A, Vec3A);

/// The box around a placed box.
pub(super) fn bounds_of_placed(world_from_object: Affine3A, (lower, upper): Bounds) -> Bounds {
    /// Growth relative to the numbers that went in, against their rounding (2^-24 each, a dozen
    /// of them here and in the ray that is taken to object space).
    const PADDING: f32 = 1.0 / (1 << 20) as f32;
    let (centre, half) = (0.5 * (lower + upper), 0.5 * (upper - lower));
    let magnitude = Affine3A {
        matrix3: world_from_object.matrix3.abs(),
        translation: world_from_object.translation.abs(),
    };
    let padding = magnitude.transform_point3a(centre.abs() + half) * PADDING;
    let centre = world_from_object.transform_point3a(centre);
    let half = magnitude.transform_vector3a(half) + padding;
    (centre - half, centre + half)
}

/// Placements at equal steps of the shutter's time, and all in between: there, as in Cycles, places
/// and stretches move evenly, and rotations turn evenly along the shortest way.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    keys: Vec<Key>,
}

/// A placement, taken apart: it stretches, turns, then moves.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Key {
    translation: Vec3A,
    rotation: Quat,
    /// Symmetric; negative where the placement mirrors.
    stretch: Mat3A,
}

impl Key {
    fn of(placement: Affine3A) -> Self {
        let rotation = rotation_of(placement.matrix3);
        Self {
            translation: placement.translation,
            rotation: Quat::from_mat3a(&rotation).normalize(),
            stretch: rotation.transpose() * placement.matrix3,
        }
    }

    /// The placement a share `s` of the way to the next key.
    fn towards(&self, next: &Self, s: f32) -> Affine3A {
        let rotation = Mat3A::from_quat(self.rotation.slerp(next.rotation, s));
        Affine3A {
            matrix3: rotation * (self.stretch * (1.0 - s) + next.stretch * s),
            translation: self.translation.lerp(next.translation, s),
        }
    }
}

/// The rotation of the polar decomposition, by Newton's iteration for the nearest orthogonal matrix
/// (Higham, "Computing the polar decomposition with applications", 1986).
fn rotation_of(linear: Mat3A) -> Mat3A {
    /// It converges quadratically, once it has halved the longest axis down to one.
    const STEPS: usize = 40;
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis].map(Vec3A::length);
    let mut rotation = linear * (1.0 / x.max(y).max(z));
    for _ in 0..STEPS {
        let next = (rotation + rotation.inverse().transpose()) * 0.5;
        let is_there = next.abs_diff_eq(rotation, 1e-7);
        rotation = next;
        if is_there {
            break;
        }
    }
    rotation * rotation.determinant().signum()
}

/// The step of `count` that a share of the shutter's time lies in, and how far within it.
pub(super) fn step_at(time: f32, count: usize) -> (usize, f32) {
    let place = time.clamp(0.0, 1.0) * count as f32;
    let step = (place as usize).min(count - 1);
    (step, place - step as f32)
}

impl Trajectory {
    /// A way through at least two placements; `None` for fewer, or where one cannot be inverted.
    pub fn new(placements: &[Affine3A]) -> Option<Self> {
        let keys: Vec<Key> = placements.iter().copied().map(Key::of).collect();
        let is_regular = |placement: &Affine3A| placement.inverse().is_finite();
        (keys.len() > 1 && placements.iter().all(is_regular)).then_some(Self { keys })
    }

    /// The placement at a share of the shutter's time.
    pub fn at(&self, time: f32) -> Affine3A {
        let (step, s) = step_at(time, self.keys.len() - 1);
        self.keys[step].towards(&self.keys[step + 1], s)
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.keys.len() - 1
    }

    /// Corners of a box around all that a box in object space passes.
    ///
    /// A step is cut into short pieces. Within a piece of duration h, a share of the step, a point
    /// T(t) + R(t) S(t) x leaves the chord by at most h^2 / 8 times its largest acceleration, which is
    /// |w|^2 |S x| + 2 |w| |S' x| with w the angular velocity.
    pub fn bounds(&self, (low, high): Bounds) -> Bounds {
        /// Largest angle [rad] that a piece turns by.
        const PIECE: f32 = 0.1;
        let corners: [Vec3A; 8] = std::array::from_fn(|corner| {
            let is_upper = [1, 2, 4].map(|bit| corner & bit != 0);
            Vec3A::select(BVec3A::from_array(is_upper), high, low)
        });
        let mut lower = Vec3A::INFINITY;
        let mut upper = Vec3A::NEG_INFINITY;
        for pair in self.keys.windows(2) {
            let angle = pair[0].rotation.angle_between(pair[1].rotation);
            let pieces = (angle / PIECE).ceil() + 1.0;
            for corner in corners {
                let [start, end] = [0, 1].map(|i: usize| pair[i].stretch * corner);
                let reach = start.length().max(end.length());
                let acceleration = angle * (angle * reach + 2.0 * start.distance(end));
                let leeway = Vec3A::splat(acceleration / (8.0 * pieces * pieces));
                for piece in 0..=pieces as usize {
                    let placement = pair[0].towards(&pair[1], piece as f32 / pieces);
                    let point = placement.transform_point3a(corner);
                    lower = lower.min(point - leeway);
                    upper = upper.max(point + leeway);
                }
            }
        }
        // Rounding is that of a placed box.
        bounds_of_placed(Affine3A::IDENTITY, (lower, upper))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::Random;
    use glam::Vec3;

    fn placement(random: &mut Random) -> Affine3A {
        let mut point = || Vec3::from([(); 3].map(|()| 2.0 * random.next() - 1.0));
        let (at, turn, scale) = (point() * 3.0, point() * 2.0, Vec3::ONE + 0.6 * point());
        let shear = Mat3A::from_cols(Vec3A::X, Vec3A::new(0.3, 1.0, 0.0), Vec3A::Z);
        Affine3A::from_scale_rotation_translation(scale, Quat::from_scaled_axis(turn), at)
            * Affine3A::from_mat3(shear.into())
    }

    #[test]
    fn a_way_passes_its_keys_mirrored_ones_too() {
        let mut random = Random::new(1);
        for mirror in [1.0, -1.0] {
            let mirror = Affine3A::from_scale(Vec3::new(mirror, 1.0, 1.0));
            let keys = [(); 3].map(|()| placement(&mut random) * mirror);
            let way = Trajectory::new(&keys).unwrap();
            for (key, time) in keys.iter().zip([0.0, 0.5, 1.0]) {
                assert!(way.at(time).abs_diff_eq(*key, 1e-4), "{time}");
            }
        }
    }

    #[test]
    fn between_keys_things_turn_and_move_evenly() {
        let turn = |angle| Affine3A::from_rotation_z(angle);
        let way = Trajectory::new(&[turn(0.0), turn(2.0)]).unwrap();
        assert!(way.at(0.25).abs_diff_eq(turn(0.5), 1e-6));
        let to = Affine3A::from_scale_rotation_translation(
            Vec3::splat(3.0),
            Quat::IDENTITY,
            Vec3::new(4.0, 0.0, 0.0),
        );
        let way = Trajectory::new(&[Affine3A::IDENTITY, to, to]).unwrap();
        let quarter = Affine3A::from_scale_rotation_translation(
            Vec3::splat(2.0),
            Quat::IDENTITY,
            Vec3::new(2.0, 0.0, 0.0),
        );
        assert!(way.at(0.25).abs_diff_eq(quarter, 1e-5));
        assert!(way.at(0.8).abs_diff_eq(to, 1e-5));
    }

    #[test]
    fn bounds_hold_every_point_at_every_time() {
        let mut random = Random::new(3);
        for _ in 0..50 {
            let way = Trajectory::new(&[(); 3].map(|()| placement(&mut random))).unwrap();
            let corners: [Vec3A; 8] = std::array::from_fn(|i| {
                Vec3A::from([1, 2, 4].map(|bit| if i & bit == 0 { -1.0 } else { 2.0 }))
            });
            let (lower, upper) = way.bounds((Vec3A::splat(-1.0), Vec3A::splat(2.0)));
            for i in 0..=400 {
                let at = way.at(i as f32 / 400.0);
                for corner in corners {
                    let point = at.transform_point3a(corner);
                    assert!(lower.cmple(point).all() && point.cmple(upper).all());
                }
            }
        }
    }

    #[test]
    fn a_placed_box_holds_its_corners() {
        let turn = Affine3A::from_rotation_z(0.7) * Affine3A::from_translation(Vec3::splat(1e4));
        let (lower, upper) = (Vec3A::new(-1.0, 2.0, 0.0), Vec3A::new(3.0, 2.5, 1.0));
        let (low, high) = bounds_of_placed(turn, (lower, upper));
        for corner in 0..8 {
            let mask = [1, 2, 4].map(|bit| corner & bit != 0);
            let corner = Vec3A::select(BVec3A::from_array(mask), upper, lower);
            let placed = turn.transform_point3a(corner);
            assert!(low.cmple(placed).all() && placed.cmple(high).all());
        }
    }
}
