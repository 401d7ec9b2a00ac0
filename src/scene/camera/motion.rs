//! The camera's way while the shutter is open.

use glam::Affine3A;

use super::Projection;
use crate::error::{Error, Result};
use crate::scene::motion::{Trajectory, step_at};

/// Placements and projections of a camera at equal steps of the shutter's time.
#[derive(Debug, Clone)]
pub struct CameraMotion {
    placements: Trajectory,
    /// As many, or none where the projection stays as it is.
    projections: Vec<Projection>,
}

impl CameraMotion {
    /// A way through at least two placements, with a projection at each or none at all.
    ///
    /// # Errors
    /// Fewer placements, other numbers of projections, a placement that cannot be inverted.
    pub fn new(placements: &[Affine3A], projections: Vec<Projection>) -> Result<Self> {
        if !projections.is_empty() && projections.len() != placements.len() {
            return Err(Error::Range {
                field: "camera_motion_clip",
                value: format!("{} projections", projections.len()),
                range: format!("{}, one for each placement", placements.len()),
            });
        }
        let (field, row) = ("camera_motion", 0);
        Ok(Self {
            placements: Trajectory::new(placements).ok_or(Error::Singular { field, row })?,
            projections,
        })
    }

    /// Where the camera is at a share of the shutter's time.
    pub fn placement_at(&self, time: f32) -> Affine3A {
        self.placements.at(time)
    }

    /// Its projection then; `None` where it does not change. Image planes move evenly, as Cycles
    /// zooms.
    pub fn projection_at(&self, time: f32) -> Option<Projection> {
        let (step, s) = step_at(time, self.projections.len().checked_sub(1)?);
        match (self.projections[step], self.projections[step + 1]) {
            (Projection::Perspective(from), Projection::Perspective(to)) => {
                Some(Projection::Perspective(from.towards(&to, s)))
            }
            (Projection::Orthographic(from), Projection::Orthographic(to)) => {
                Some(Projection::Orthographic(from.towards(&to, s)))
            }
            (from, _) => Some(from),
        }
    }
}
