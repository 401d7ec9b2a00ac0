//! A perspective camera, given by Blender's own projection matrix.

use glam::{Affine3A, Mat4, Vec2, Vec3A};

use crate::error::{Error, Result};
use crate::math::Ray;

/// A perspective camera.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    world_from_camera: Affine3A,
    camera_from_world: Affine3A,
    /// Half size of the image plane at distance one.
    plane_half: Vec2,
    /// Middle of the image plane at distance one; not zero with a lens shift.
    plane_centre: Vec2,
    clip: [f32; 2],
}

impl Camera {
    /// A camera at `world_from_camera` that sees through `clip_from_camera`, between the distances
    /// `clip` [m] along its axis.
    ///
    /// # Errors
    /// A placement that cannot be inverted, or a projection that is not a perspective.
    pub fn new(
        world_from_camera: Affine3A,
        clip_from_camera: Mat4,
        clip: [f32; 2],
    ) -> Result<Self> {
        if !(world_from_camera.matrix3.determinant().abs() > 0.0) {
            return Err(Error::Singular {
                field: "world_from_camera",
                row: 0,
            });
        }
        let range = |field, value: String, range: &str| Error::Range {
            field,
            value,
            range: range.into(),
        };
        // Clip space is homogeneous: an orthographic projection leaves w as it is.
        let w = -clip_from_camera.z_axis.w;
        let scale = Vec2::new(clip_from_camera.x_axis.x, clip_from_camera.y_axis.y) / w;
        if !(w > 0.0 && clip_from_camera.w_axis.w.abs() < 1e-3 * w && scale.min_element() > 0.0) {
            let value = "this matrix".to_owned();
            return Err(range("clip_from_camera", value, "perspective projections"));
        }
        if !(clip[0] >= 0.0 && clip[1] > clip[0]) {
            let value = format!("{} to {}", clip[0], clip[1]);
            return Err(range("camera_clip", value, "growing distances from 0"));
        }
        let shift = Vec2::new(clip_from_camera.z_axis.x, clip_from_camera.z_axis.y) / w;
        Ok(Self {
            world_from_camera,
            camera_from_world: world_from_camera.inverse(),
            plane_half: 1.0 / scale,
            plane_centre: shift / scale,
            clip,
        })
    }

    /// Where the camera is, world space.
    pub fn position(&self) -> Vec3A {
        self.world_from_camera.translation
    }

    /// The ray through a point of the film, given as shares of the frame's width and height from the
    /// lower left corner. Its direction has unit length, its bounds are the clipping distances.
    pub fn ray(&self, film: Vec2) -> Ray {
        let plane = self.plane_centre + self.plane_half * (2.0 * film - 1.0);
        let direction_camera = Vec3A::new(plane.x, plane.y, -1.0);
        let length = direction_camera.length();
        Ray {
            origin: self.position(),
            direction: self.world_from_camera.transform_vector3a(direction_camera) / length,
            t_min: self.clip[0] * length,
            t_max: self.clip[1] * length,
        }
    }

    /// Where a point of world space falls on the film, as shares of the frame's width and height;
    /// `None` behind the camera.
    pub fn project(&self, point: Vec3A) -> Option<Vec2> {
        let camera = self.camera_from_world.transform_point3a(point);
        let distance = -camera.z;
        (distance > 0.0).then(|| {
            let plane = Vec2::new(camera.x, camera.y) / distance;
            0.5 + 0.5 * (plane - self.plane_centre) / self.plane_half
        })
    }

    /// Distance of a point of world space along the viewing axis [m].
    pub fn depth(&self, point: Vec3A) -> f32 {
        -self.camera_from_world.transform_point3a(point).z
    }

    /// Side of a pixel's projection at a depth [m], for a frame that is `width` pixels wide.
    pub fn pixel_size(&self, depth: f32, width: usize) -> f32 {
        2.0 * self.plane_half.x * depth.abs() / width as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projecting_a_point_of_a_ray_gives_its_film_position() {
        let projection = Mat4::from_cols_array_2d(&[
            [2.0, 0.0, 0.0, 0.0],
            [0.0, 3.0, 0.0, 0.0],
            [0.2, -0.1, -1.002, -1.0],
            [0.0, 0.0, -0.2, 0.0],
        ]);
        let translation = Affine3A::from_translation(glam::Vec3::new(1.0, 2.0, 3.0));
        let placement = Affine3A::from_rotation_y(0.4) * translation;
        let camera = Camera::new(placement, projection, [0.1, 100.0]).unwrap();
        for film in [(0.5, 0.5), (0.0, 0.0), (0.9, 0.2)].map(Vec2::from) {
            let point = camera.ray(film).at(7.0);
            assert!((camera.project(point).unwrap() - film).length() < 1e-5);
        }
        let ray = camera.ray(Vec2::new(0.1, 0.9));
        assert!((camera.depth(ray.at(ray.t_max)) - 100.0).abs() < 1e-3);
        // The third column shifts the principal point.
        let axis = camera.position() + placement.transform_vector3a(-Vec3A::Z);
        assert!((camera.project(axis).unwrap() - Vec2::new(0.4, 0.55)).length() < 1e-5);
        assert!(Camera::new(placement, Mat4::IDENTITY, [0.1, 1.0]).is_err());
    }
}
