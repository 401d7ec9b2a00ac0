//! An orthonormal basis around a normal.

use glam::Vec3A;

/// A right-handed orthonormal basis whose z axis is a given unit vector.
///
/// Source: Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    x: Vec3A,
    y: Vec3A,
    z: Vec3A,
}

impl Frame {
    /// The basis of the parent space itself.
    pub const IDENTITY: Self = Self {
        x: Vec3A::X,
        y: Vec3A::Y,
        z: Vec3A::Z,
    };

    /// The basis around `normal`, which must have unit length.
    pub fn from_normal(normal: Vec3A) -> Self {
        let sign = 1f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            x: Vec3A::new(
                1.0 + sign * normal.x * normal.x * a,
                sign * b,
                -sign * normal.x,
            ),
            y: Vec3A::new(b, sign + normal.y * normal.y * a, -normal.y),
            z: normal,
        }
    }

    /// The basis around `normal` whose x axis is as near to `tangent` as it can be; any basis where
    /// the two are parallel. `normal` must have unit length, `tangent` any.
    pub fn from_normal_and_tangent(normal: Vec3A, tangent: Vec3A) -> Self {
        match normal.cross(tangent).try_normalize() {
            Some(y) => Self {
                x: y.cross(normal),
                y,
                z: normal,
            },
            None => Self::from_normal(normal),
        }
    }

    /// A direction given in this basis, in the basis' parent space.
    pub fn to_world(&self, local: Vec3A) -> Vec3A {
        self.x * local.x + self.y * local.y + self.z * local.z
    }

    /// A direction of the parent space, in this basis.
    pub fn to_local(&self, world: Vec3A) -> Vec3A {
        Vec3A::new(world.dot(self.x), world.dot(self.y), world.dot(self.z))
    }

    /// The z axis.
    pub fn normal(&self) -> Vec3A {
        self.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_orthonormal_and_right_handed_at_the_poles_too() {
        for normal in [Vec3A::Z, -Vec3A::Z, Vec3A::X, Vec3A::new(0.6, -0.48, -0.64)] {
            let frame = Frame::from_normal(normal);
            assert!(frame.x.dot(frame.y).abs() < 1e-6);
            assert!((frame.x.cross(frame.y) - normal).length() < 1e-6);
            let direction = Vec3A::new(0.3, -0.5, 0.8).normalize();
            let there_and_back = frame.to_local(frame.to_world(direction));
            assert!((there_and_back - direction).length() < 1e-6);
        }
    }

    #[test]
    fn a_tangent_turns_the_x_axis_and_a_useless_one_does_not_spoil_the_basis() {
        let normal = Vec3A::new(0.6, -0.48, 0.64);
        let frame = Frame::from_normal_and_tangent(normal, Vec3A::new(3.0, 0.0, 0.0));
        assert!(frame.x.dot(normal).abs() < 1e-6 && frame.x.x > 0.79);
        assert!(frame.y.x.abs() < 1e-6);
        assert!((frame.x.cross(frame.y) - normal).length() < 1e-6);
        for tangent in [Vec3A::ZERO, 2.0 * normal] {
            let frame = Frame::from_normal_and_tangent(normal, tangent);
            assert!((frame.x.length() - 1.0).abs() < 1e-6);
        }
    }
}
