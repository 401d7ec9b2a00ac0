//! Panoramic cameras: maps between the film and directions.
//!
//! The maps are those of Cycles' panoramic cameras. Directions are in camera space: x to the right,
//! y up, -z ahead. Film positions are shares of the width and height from the lower left corner.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Vec2, Vec3A};

/// A map of the film onto directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Panorama {
    /// Longitude across, latitude up.
    Equirectangular {
        /// From and to [rad]; zero is ahead, positive to the right.
        longitude: [f32; 2],
        /// From and to [rad]; positive is up.
        latitude: [f32; 2],
    },
    /// The angle from the axis grows with the distance from the middle of the film.
    FisheyeEquidistant {
        /// Angle [rad] that fills width and height.
        field_of_view: f32,
    },
    /// Solid angles keep their size.
    FisheyeEquisolid {
        /// Angle [rad] beyond which nothing is seen.
        field_of_view: f32,
        /// In the unit of the sensor.
        focal_length: f32,
        /// Width and height.
        sensor: Vec2,
    },
    /// The angle from the axis is a polynomial of the distance from the middle.
    FisheyePolynomial {
        /// Angle [rad] beyond which nothing is seen.
        field_of_view: f32,
        /// Width and height.
        sensor: Vec2,
        /// Of the powers 0 to 4 of the distance, in the unit of the sensor; the angle is negative.
        coefficients: [f32; 5],
    },
    /// What a mirror ball shows from afar.
    MirrorBall,
    /// One face of a cube map with equal angles.
    CubeFace,
    /// A cylinder around the camera, unrolled.
    Cylinder {
        /// From and to [rad]; zero is ahead, positive to the right.
        longitude: [f32; 2],
        /// From and to, over the distance from the axis.
        height: [f32; 2],
    },
}

impl Panorama {
    /// The direction that a point of the film sees, of any length; none outside of the picture.
    pub fn direction(&self, film: Vec2) -> Option<Vec3A> {
        match *self {
            Self::Equirectangular {
                longitude,
                latitude,
            } => {
                let (sin, cos) = mix(latitude, film.y).sin_cos();
                let around = cos * Vec2::from_angle(mix(longitude, film.x));
                Some(Vec3A::new(around.y, sin, -around.x))
            }
            Self::FisheyeEquidistant { field_of_view } => {
                let plane = 2.0 * film - 1.0;
                let inside = plane.length() <= 1.0;
                inside.then(|| around_axis(plane, 0.5 * field_of_view * plane.length()))
            }
            Self::FisheyeEquisolid {
                field_of_view,
                focal_length,
                sensor,
            } => {
                let plane = (film - 0.5) * sensor;
                let sin_half = plane.length() / (2.0 * focal_length);
                let inside = sin_half <= (0.25 * field_of_view).sin();
                inside.then(|| around_axis(plane, 2.0 * sin_half.asin()))
            }
            Self::FisheyePolynomial {
                field_of_view,
                sensor,
                coefficients,
            } => {
                let plane = (film - 0.5) * sensor;
                let angle = -polynomial(&coefficients, plane.length());
                let inside = angle.abs() <= 0.5 * field_of_view;
                inside.then(|| around_axis(plane, angle))
            }
            Self::MirrorBall => mirrored(2.0 * film - 1.0),
            Self::CubeFace => {
                let plane = (film - 0.5) * FRAC_PI_2;
                Some(Vec3A::new(plane.x.tan(), plane.y.tan(), -1.0))
            }
            Self::Cylinder { longitude, height } => {
                let around = Vec2::from_angle(mix(longitude, film.x));
                Some(Vec3A::new(around.y, mix(height, film.y), -around.x))
            }
        }
    }

    /// Where a direction of any length falls on the film: within [0, 1] if the picture shows it.
    pub fn film(&self, direction: Vec3A) -> Option<Vec2> {
        let direction = direction.try_normalize()?;
        let longitude_of = || direction.x.atan2(-direction.z);
        match *self {
            Self::Equirectangular {
                longitude,
                latitude,
            } => {
                let height = direction.y.clamp(-1.0, 1.0).asin();
                Some(Vec2::new(
                    share_of_turn(longitude, longitude_of()),
                    share(latitude, height),
                ))
            }
            Self::FisheyeEquidistant { field_of_view } => {
                let radius = angle_to_axis(direction) / field_of_view;
                Some(0.5 + radius * across(direction))
            }
            Self::FisheyeEquisolid {
                focal_length,
                sensor,
                ..
            } => {
                let radius = 2.0 * focal_length * (0.5 * angle_to_axis(direction)).sin();
                Some(0.5 + radius * across(direction) / sensor)
            }
            Self::FisheyePolynomial {
                sensor,
                coefficients,
                ..
            } => {
                let radius = polynomial_inverse(&coefficients, -angle_to_axis(direction))?;
                Some(0.5 + radius * across(direction) / sensor)
            }
            Self::MirrorBall => {
                // The ball's normal is halfway between what is seen and the way back.
                let normal = Vec3A::new(direction.x, direction.y, 1.0 - direction.z);
                let normal = normal.try_normalize()?;
                Some(0.5 + 0.5 * Vec2::new(normal.x, normal.y))
            }
            Self::CubeFace => {
                let angles = Vec2::new(longitude_of(), direction.y.atan2(-direction.z));
                (direction.z < 0.0).then(|| 0.5 + angles / FRAC_PI_2)
            }
            Self::Cylinder { longitude, height } => {
                let distance = direction.x.hypot(direction.z);
                (distance > 0.0).then(|| {
                    Vec2::new(
                        share_of_turn(longitude, longitude_of()),
                        share(height, direction.y / distance),
                    )
                })
            }
        }
    }

    /// About the angle [rad] that the width of the film spans.
    pub fn angle_across(&self) -> f32 {
        match *self {
            Self::Equirectangular { longitude, .. } | Self::Cylinder { longitude, .. } => {
                (longitude[1] - longitude[0]).abs()
            }
            Self::FisheyeEquidistant { field_of_view } => field_of_view,
            Self::FisheyeEquisolid {
                focal_length,
                sensor,
                ..
            } => sensor.x / focal_length,
            Self::FisheyePolynomial {
                sensor,
                coefficients,
                ..
            } => (sensor.x * coefficients[1]).abs(),
            Self::MirrorBall => TAU,
            Self::CubeFace => FRAC_PI_2,
        }
    }
}

/// The direction at `angle` from the axis, above the direction `plane` of the film.
fn around_axis(plane: Vec2, angle: f32) -> Vec3A {
    let (sin, cos) = angle.sin_cos();
    let across = sin * plane.normalize_or_zero();
    Vec3A::new(across.x, across.y, -cos)
}

fn angle_to_axis(direction: Vec3A) -> f32 {
    direction.x.hypot(direction.y).atan2(-direction.z)
}

fn across(direction: Vec3A) -> Vec2 {
    Vec2::new(direction.x, direction.y).normalize_or_zero()
}

/// What is seen in a mirror ball of radius one at this point of its disk.
fn mirrored(point: Vec2) -> Option<Vec3A> {
    let depth_squared = 1.0 - point.length_squared();
    (depth_squared >= 0.0).then(|| {
        let normal = Vec3A::new(point.x, point.y, depth_squared.sqrt());
        let seen_along = -Vec3A::Z;
        // The camera of the map stands before the ball and looks at it: what it sees straight ahead
        // is behind it, and Blender's camera looks that way.
        let reflected = seen_along - 2.0 * seen_along.dot(normal) * normal;
        Vec3A::new(reflected.x, reflected.y, -reflected.z)
    })
}

fn polynomial(coefficients: &[f32; 5], x: f32) -> f32 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// Where the polynomial reaches `value`, by Newton's method from the root of its linear part.
fn polynomial_inverse(coefficients: &[f32; 5], value: f32) -> Option<f32> {
    let [k0, k1, ..] = *coefficients;
    let mut x = (value - k0) / k1;
    for _ in 0..20 {
        let slope = (1..5)
            .rev()
            .fold(0.0, |sum, i| sum * x + i as f32 * coefficients[i]);
        let step = (polynomial(coefficients, x) - value) / slope;
        x -= step;
        if step.abs() < 1e-6 {
            break;
        }
    }
    x.is_finite().then_some(x)
}

fn mix([from, to]: [f32; 2], share: f32) -> f32 {
    from + share * (to - from)
}

fn share([from, to]: [f32; 2], value: f32) -> f32 {
    (value - from) / (to - from)
}

/// The same for an angle that may lie a full turn beyond the range.
fn share_of_turn(range: [f32; 2], angle: f32) -> f32 {
    let middle = 0.5 * (range[0] + range[1]);
    let around = (angle - middle + PI).rem_euclid(TAU) - PI;
    share(range, middle + around)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn each() -> [Panorama; 7] {
        let sensor = Vec2::new(36.0, 24.0);
        [
            Panorama::Equirectangular {
                longitude: [-PI, PI],
                latitude: [-FRAC_PI_2, FRAC_PI_2],
            },
            Panorama::FisheyeEquidistant { field_of_view: 3.0 },
            Panorama::FisheyeEquisolid {
                field_of_view: 3.0,
                focal_length: 15.0,
                sensor,
            },
            Panorama::FisheyePolynomial {
                field_of_view: 3.0,
                sensor,
                coefficients: [-1.173e-5, -0.019_988, -3.593_1e-6, 3.020_7e-6, -2.664_8e-8],
            },
            Panorama::MirrorBall,
            Panorama::CubeFace,
            Panorama::Cylinder {
                longitude: [-2.0, 2.5],
                height: [-1.0, 0.5],
            },
        ]
    }

    #[test]
    fn film_and_direction_are_inverse() {
        for panorama in each() {
            let mut compared = 0;
            for i in 0..400 {
                let film = Vec2::new((i % 20) as f32 + 0.5, (i / 20) as f32 + 0.5) / 20.0;
                let Some(direction) = panorama.direction(film) else {
                    continue;
                };
                let back = panorama.film(direction).unwrap();
                assert!((back - film).length() < 2e-4, "{panorama:?}: {film} {back}");
                compared += 1;
            }
            assert!(compared > 200, "{panorama:?}");
        }
    }

    #[test]
    fn up_on_the_film_is_up_and_right_is_right() {
        for panorama in each() {
            let at = |x, y| panorama.direction(Vec2::new(x, y)).unwrap();
            let middle = at(0.5, 0.5);
            assert!(
                at(0.6, 0.5).x > middle.x && at(0.5, 0.6).y > middle.y,
                "{panorama:?}"
            );
            assert!(middle.z < -0.5);
        }
    }

    #[test]
    fn known_directions() {
        let full = each()[0];
        let right = full.direction(Vec2::new(0.75, 0.5)).unwrap();
        assert!((right - Vec3A::X).length() < 1e-6);
        let half_sphere = Panorama::FisheyeEquidistant { field_of_view: PI };
        let up = half_sphere.direction(Vec2::new(0.5, 1.0)).unwrap();
        assert!((up - Vec3A::Y).length() < 1e-6);
        assert_eq!(half_sphere.direction(Vec2::new(0.95, 0.95)), None);
        // An equal solid angle lens sees 60 degrees from the axis at its focal length.
        let direction = each()[2]
            .direction(Vec2::new(0.5 + 15.0 / 36.0, 0.5))
            .unwrap();
        assert!((direction.x - (PI / 3.0).sin()).abs() < 1e-5);
        // Half way out a mirror ball shows what is beside it.
        let beside = Panorama::MirrorBall.direction(Vec2::new(0.5 + 0.5f32.sqrt() / 2.0, 0.5));
        assert!((beside.unwrap() - Vec3A::X).length() < 1e-3);
    }
}
