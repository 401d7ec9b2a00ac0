//! Cameras: which ray a point of the film sees, and where a point of the world falls on the film.
//!
//! Perspective and orthographic cameras are given by Blender's own projection matrix, panoramas by
//! their map. Depth of field moves the ray's origin over the aperture; projecting a point always
//! goes through the aperture's middle.

mod lens;
mod motion;
mod panorama;

use glam::{Affine3A, Mat4, Vec2, Vec3A};

use crate::error::{Error, Result};
use crate::math::{MIDDLE_TIME, Ray};
use crate::shader::View;
pub use lens::Lens;
pub use motion::CameraMotion;
pub use panorama::Panorama;

/// A camera.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    world_from_camera: Affine3A,
    camera_from_world: Affine3A,
    projection: Projection,
    lens: Lens,
    clip: [f32; 2],
    /// Of the whole frame, in pixels.
    frame_width: u32,
}

/// How the film sees camera space: x to the right, y up, -z ahead.
#[derive(Debug, Clone, Copy)]
pub enum Projection {
    /// Through one point.
    Perspective(ImagePlane),
    /// Along the axis.
    Orthographic(ImagePlane),
    /// Around the camera. The film is moved by the shift, in shares of its width and height.
    Panorama(Panorama, Vec2),
}

/// The image plane: at distance one in a perspective, anywhere along the axis in an orthographic
/// view [m].
#[derive(Debug, Clone, Copy)]
pub struct ImagePlane {
    half: Vec2,
    /// Its middle; not zero with a lens shift.
    centre: Vec2,
}

impl ImagePlane {
    fn at(&self, film: Vec2) -> Vec2 {
        self.centre + self.half * (2.0 * film - 1.0)
    }

    /// The plane a share `s` of the way to another.
    fn towards(&self, next: &Self, s: f32) -> Self {
        Self {
            half: self.half.lerp(next.half, s),
            centre: self.centre.lerp(next.centre, s),
        }
    }

    fn film(&self, plane: Vec2) -> Vec2 {
        0.5 + 0.5 * (plane - self.centre) / self.half
    }
}

impl Projection {
    /// The projection of Blender's matrix: a perspective, or orthographic.
    ///
    /// # Errors
    /// Another matrix.
    pub fn from_matrix(clip_from_camera: Mat4) -> Result<Self> {
        let m = &clip_from_camera;
        // Clip space is homogeneous: an orthographic projection leaves w as it is.
        let (along, w) = (-m.z_axis.w, m.w_axis.w);
        let is_perspective = along > 0.0 && w.abs() < 1e-3 * along;
        let is_orthographic = w > 0.0 && along.abs() < 1e-3 * w;
        let scale = Vec2::new(m.x_axis.x, m.y_axis.y);
        if !((is_perspective || is_orthographic) && scale.min_element() > 0.0) {
            return Err(range(
                "clip_from_camera",
                "this matrix".into(),
                "perspective and orthographic projections",
            ));
        }
        Ok(if is_perspective {
            Self::Perspective(ImagePlane {
                half: along / scale,
                centre: Vec2::new(m.z_axis.x, m.z_axis.y) / scale,
            })
        } else {
            Self::Orthographic(ImagePlane {
                half: w / scale,
                centre: -Vec2::new(m.w_axis.x, m.w_axis.y) / scale,
            })
        })
    }
}

impl Camera {
    /// A camera at `world_from_camera` that sees between the distances `clip` [m]: along its axis,
    /// or along each ray of a panorama. The whole frame is `frame_width` pixels wide.
    ///
    /// # Errors
    /// A placement that cannot be inverted; distances, an aperture or a width out of range.
    pub fn new(
        world_from_camera: Affine3A,
        projection: Projection,
        lens: Lens,
        clip: [f32; 2],
        frame_width: u32,
    ) -> Result<Self> {
        if !(world_from_camera.matrix3.determinant().abs() > 0.0) {
            return Err(Error::Singular {
                field: "world_from_camera",
                row: 0,
            });
        }
        if !(clip[0] >= 0.0 && clip[1] > clip[0]) {
            let value = format!("{} to {}", clip[0], clip[1]);
            return Err(range("camera_clip", value, "growing distances from 0"));
        }
        if !(lens.radius >= 0.0 && lens.focus_distance > 0.0 && lens.ratio > 0.0) {
            let value = format!("{lens:?}");
            return Err(range("camera_lens", value, "sizes and distances above 0"));
        }
        if frame_width == 0 {
            return Err(range("camera_frame_width", "0".into(), "above 0"));
        }
        Ok(Self {
            world_from_camera,
            camera_from_world: world_from_camera.inverse(),
            projection,
            lens,
            clip,
            frame_width,
        })
    }

    /// The camera at a share of the shutter's time.
    pub fn moved(&self, motion: &CameraMotion, time: f32) -> Self {
        self.placed(motion.placement_at(time), motion.projection_at(time))
    }

    /// The camera at another place, with another projection if one is given.
    pub fn placed(&self, world_from_camera: Affine3A, projection: Option<Projection>) -> Self {
        Self {
            world_from_camera,
            camera_from_world: world_from_camera.inverse(),
            projection: projection.unwrap_or(self.projection),
            ..*self
        }
    }

    /// The ray through a point of the film, given as shares of the frame's width and height from the
    /// lower left corner, and the point of the aperture that `u_lens` chooses. Its direction has unit
    /// length, its bounds are the clipping distances. None outside of a fisheye's picture.
    pub fn ray(&self, film: Vec2, u_lens: [f32; 2]) -> Option<Ray> {
        let (mut origin, mut direction) = match self.projection {
            Projection::Perspective(plane) => (Vec3A::ZERO, plane.at(film).extend(-1.0).into()),
            Projection::Orthographic(plane) => (plane.at(film).extend(0.0).into(), -Vec3A::Z),
            Projection::Panorama(panorama, shift) => {
                (Vec3A::ZERO, panorama.direction(film + shift)?.normalize())
            }
        };
        if self.lens.radius > 0.0 {
            // The ray starts elsewhere and meets the sharp one in the plane in focus.
            let sharp = origin + self.lens.focus_distance * direction;
            origin += self.on_aperture(direction, u_lens);
            direction = sharp - origin;
        }
        let direction = direction.normalize();
        // Clipping planes are perpendicular to the axis, those of a panorama to the ray.
        let stretch = match self.projection {
            Projection::Panorama(..) => 1.0,
            _ => -1.0 / direction.z,
        };
        Some(Ray {
            origin: self.world_from_camera.transform_point3a(origin),
            direction: self.world_from_camera.transform_vector3a(direction),
            t_min: self.clip[0] * stretch,
            t_max: self.clip[1] * stretch,
            time: MIDDLE_TIME,
        })
    }

    /// A point of the aperture relative to its middle, camera space. A panorama's turns with the ray.
    fn on_aperture(&self, direction: Vec3A, u_lens: [f32; 2]) -> Vec3A {
        let point = self.lens.sample(u_lens);
        match self.projection {
            Projection::Panorama(..) => {
                let across = (-Vec3A::Z).reject_from_normalized(direction);
                let across = across.normalize_or(direction.any_orthonormal_vector());
                across * point.x + direction.cross(across) * point.y
            }
            _ => point.extend(0.0).into(),
        }
    }

    /// Where a point of world space falls on the film, as shares of the frame's width and height;
    /// `None` where no ray of the camera goes.
    pub fn project(&self, point: Vec3A) -> Option<Vec2> {
        let camera = self.camera_from_world.transform_point3a(point);
        let plane_point = Vec2::new(camera.x, camera.y);
        let distance = -camera.z;
        match self.projection {
            Projection::Perspective(plane) => {
                (distance > 0.0).then(|| plane.film(plane_point / distance))
            }
            Projection::Orthographic(plane) => Some(plane.film(plane_point)),
            Projection::Panorama(panorama, shift) => Some(panorama.film(camera)? - shift),
        }
    }

    /// The same of what lies far away in a direction; nowhere in an orthographic view.
    pub fn project_direction(&self, direction: Vec3A) -> Option<Vec2> {
        match self.projection {
            Projection::Orthographic(_) => None,
            _ => self.project(self.world_from_camera.translation + direction),
        }
    }

    /// Whether the camera was cut between this and `next`, in a scene of this diameter [m]: further
    /// turned or moved than a shot goes in a frame, so that the two show different places.
    pub fn is_cut_before(&self, next: &Self, scene_size: f32) -> bool {
        /// Cosine of 30 degrees.
        const TURN_COSINE: f32 = 0.866;
        const MOVE: f32 = 0.1;
        let forward = |camera: &Self| camera.world_from_camera.matrix3.z_axis.normalize_or_zero();
        let position = |camera: &Self| camera.world_from_camera.translation;
        forward(self).dot(forward(next)) < TURN_COSINE
            || position(self).distance(position(next)) > MOVE * scene_size
    }

    /// Where it stands, world space.
    pub fn position(&self) -> Vec3A {
        self.world_from_camera.translation
    }

    /// Unit vector from a point of world space towards the camera.
    pub fn direction_from(&self, point: Vec3A) -> Vec3A {
        match self.projection {
            Projection::Orthographic(_) => {
                self.world_from_camera.matrix3.z_axis.normalize_or_zero()
            }
            _ => (self.world_from_camera.translation - point).normalize_or_zero(),
        }
    }

    /// A direction of world space in that of the camera, with z to the front.
    pub fn to_view(&self, direction: Vec3A) -> Vec3A {
        let local = self.camera_from_world.transform_vector3a(direction);
        Vec3A::new(local.x, local.y, -local.z)
    }

    /// Distance of a point of world space [m]: along the viewing axis, or from a panorama's middle.
    pub fn depth(&self, point: Vec3A) -> f32 {
        let camera = self.camera_from_world.transform_point3a(point);
        match self.projection {
            Projection::Panorama(..) => camera.length(),
            _ => -camera.z,
        }
    }

    /// How far away a point of world space is [m]: from the camera, or along the axis where there is
    /// no one point to look from.
    pub fn distance(&self, point: Vec3A) -> f32 {
        match self.projection {
            Projection::Orthographic(_) => self.depth(point).abs(),
            _ => point.distance(self.world_from_camera.translation),
        }
    }

    /// Side of a pixel's projection at a depth [m], for a frame that is `width` pixels wide.
    pub fn pixel_size(&self, depth: f32, width: usize) -> f32 {
        let across = match self.projection {
            Projection::Perspective(plane) => 2.0 * plane.half.x * depth.abs(),
            Projection::Orthographic(plane) => 2.0 * plane.half.x,
            Projection::Panorama(panorama, _) => panorama.angle_across() * depth,
        };
        across / width as f32
    }
}

fn range(field: &'static str, value: String, range: &str) -> Error {
    Error::Range {
        field,
        value,
        range: range.into(),
    }
}

impl View for Camera {
    fn camera_from_world(&self) -> Affine3A {
        self.camera_from_world
    }

    fn project(&self, point: Vec3A) -> Option<Vec2> {
        Camera::project(self, point)
    }

    fn pixel_size(&self, ray_length: f32) -> f32 {
        Camera::pixel_size(self, ray_length, self.frame_width as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::statistics::Random;

    const MIDDLE: [f32; 2] = [0.5, 0.5];

    fn placement() -> Affine3A {
        let translation = Affine3A::from_translation(glam::Vec3::new(1.0, 2.0, 3.0));
        Affine3A::from_rotation_y(0.4) * translation
    }

    fn perspective() -> Projection {
        let matrix = Mat4::from_cols_array_2d(&[
            [2.0, 0.0, 0.0, 0.0],
            [0.0, 3.0, 0.0, 0.0],
            [0.2, -0.1, -1.002, -1.0],
            [0.0, 0.0, -0.2, 0.0],
        ]);
        Projection::from_matrix(matrix).unwrap()
    }

    fn orthographic() -> Projection {
        let matrix = Mat4::from_cols_array_2d(&[
            [0.5, 0.0, 0.0, 0.0],
            [0.0, 0.7, 0.0, 0.0],
            [0.0, 0.0, -0.02, 0.0],
            [0.1, -0.2, -1.0, 1.0],
        ]);
        Projection::from_matrix(matrix).unwrap()
    }

    fn fisheye() -> Projection {
        let panorama = Panorama::FisheyeEquidistant { field_of_view: 3.0 };
        Projection::Panorama(panorama, Vec2::new(0.1, 0.0))
    }

    fn camera(projection: Projection, lens: Lens) -> Camera {
        Camera::new(placement(), projection, lens, [0.1, 100.0], 100).unwrap()
    }

    #[test]
    fn projecting_a_point_of_a_ray_gives_its_film_position() {
        for projection in [perspective(), orthographic(), fisheye()] {
            let camera = camera(projection, Lens::PINHOLE);
            for film in [(0.5, 0.5), (0.2, 0.3), (0.7, 0.4)].map(Vec2::from) {
                let ray = camera.ray(film, MIDDLE).unwrap();
                let point = ray.at(7.0);
                let back = camera.project(point).unwrap();
                assert!((back - film).length() < 1e-5, "{projection:?}");
                assert!((camera.direction_from(point) + ray.direction).length() < 1e-5);
                assert!((camera.depth(ray.at(ray.t_max)) - 100.0).abs() < 1e-3);
                assert!((camera.depth(ray.at(ray.t_min)) - 0.1).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn the_third_column_shifts_the_principal_point() {
        let camera = camera(perspective(), Lens::PINHOLE);
        let axis = placement().translation + placement().transform_vector3a(-Vec3A::Z);
        assert!((camera.project(axis).unwrap() - Vec2::new(0.4, 0.55)).length() < 1e-5);
        assert!(Projection::from_matrix(Mat4::ZERO).is_err());
    }

    /// A pixel's footprint is what the next pixel sees beside it.
    #[test]
    fn pixel_size_is_the_distance_to_the_next_pixel() {
        for projection in [perspective(), orthographic(), fisheye()] {
            let camera = camera(projection, Lens::PINHOLE);
            let at = |x| camera.ray(Vec2::new(x, 0.5), MIDDLE).unwrap().at(5.0);
            let (here, next) = (at(0.4), at(0.401));
            let size = camera.pixel_size(camera.depth(here), 1000);
            let step = (here - next).length();
            assert!(
                (size / step - 1.0).abs() < 0.1,
                "{projection:?}: {size} {step}"
            );
        }
    }

    /// Every ray through the aperture meets the sharp one where the camera is in focus, and the
    /// circle of confusion grows from there as similar triangles say.
    #[test]
    fn what_is_in_focus_is_sharp() {
        let lens = Lens {
            radius: 0.05,
            focus_distance: 4.0,
            ..Lens::PINHOLE
        };
        let film = Vec2::new(0.3, 0.6);
        let mut random = Random::new(4);
        for projection in [perspective(), orthographic(), fisheye()] {
            let camera = camera(projection, lens);
            let pinhole = self::camera(projection, Lens::PINHOLE);
            let sharp = pinhole.ray(film, MIDDLE).unwrap();
            let axial = |ray: &Ray, depth: f32| ray.at(ray.t_max / 100.0 * depth);
            let mut widest = 0.0f32;
            for _ in 0..2000 {
                let ray = camera.ray(film, random.next_2d()).unwrap();
                let gap = |depth| (axial(&ray, depth) - axial(&sharp, depth)).length();
                if !matches!(projection, Projection::Panorama(..)) {
                    assert!(gap(4.0) < 1e-4, "{projection:?}");
                }
                widest = widest.max(gap(8.0));
            }
            assert!(
                (0.047..0.0501).contains(&widest),
                "{projection:?}: {widest}"
            );
        }
    }
}
