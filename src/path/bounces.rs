//! What happened to a path so far, and what its limits make of it.

use crate::contract::Settings;
use crate::sampling::Part;
use crate::shader::{Around, RayInfo, RayKind};

/// Scattering events so far, as the bounce limits count them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Bounces {
    pub(super) total: u32,
    diffuse: u32,
    glossy: u32,
    transmission: u32,
    volume: u32,
    /// How many of them went through glass that counts as clear; see [`super::Tracer::after`].
    clear: u32,
    /// See-through surfaces that the path passed; they are no events.
    pub(super) passed: u32,
    /// What scattered the ray last; none for a camera ray.
    pub(super) last: Option<Part>,
    /// Smallest density [1/sr] of the directions so far, once there was one.
    pub(super) least_pdf: Option<f32>,
}

impl Bounces {
    /// One event more.
    pub fn after(self, part: Part) -> Self {
        let count = |counted| u32::from(part == counted);
        Self {
            total: self.total + 1,
            diffuse: self.diffuse + count(Part::Diffuse),
            glossy: self.glossy + count(Part::Glossy),
            transmission: self.transmission + count(Part::Transmission),
            volume: self.volume + count(Part::Volume),
            last: Some(part),
            ..self
        }
    }

    /// The same, with the density [1/sr] of the direction that the last event chose.
    pub(super) fn along(self, pdf_solid_angle: f32) -> Self {
        let least = self.least_pdf.unwrap_or(f32::INFINITY);
        Self {
            least_pdf: Some(least.min(pdf_solid_angle)),
            ..self
        }
    }

    /// The same, behind this many see-through surfaces.
    pub(super) fn behind(self, passed: u32) -> Self {
        Self { passed, ..self }
    }

    /// The same, where the last event went through glass that counts as clear.
    pub(super) fn through_clear_glass(self) -> Self {
        Self {
            clear: self.clear + 1,
            ..self
        }
    }

    /// Whether nothing but clear glass scattered the path.
    pub(super) fn is_clear(&self) -> bool {
        self.clear == self.total
    }

    /// What the ray that follows is.
    pub fn kind(&self) -> RayKind {
        match self.last {
            None => RayKind::Camera,
            Some(Part::Diffuse | Part::Volume) => RayKind::Diffuse,
            Some(Part::Glossy) => RayKind::Glossy,
            Some(Part::Transmission) => RayKind::Transmission,
        }
    }

    /// What the Light Path node tells of the ray that follows.
    pub fn ray_info<'a>(&self, around: Option<&'a dyn Around>) -> RayInfo<'a> {
        RayInfo {
            kind: self.kind(),
            depth: self.total,
            diffuse_depth: self.diffuse,
            glossy_depth: self.glossy,
            transmission_depth: self.transmission,
            transparent_depth: self.passed,
            around,
            ..RayInfo::default()
        }
    }

    /// The same of a ray that looks for a light.
    pub fn shadow_info(&self) -> RayInfo<'static> {
        RayInfo {
            kind: RayKind::Shadow,
            ..self.ray_info(None)
        }
    }

    /// See-through surfaces that the ray that follows may pass. As in Cycles a limit of zero still lets
    /// the path pass one.
    pub(super) fn passes_left(&self, settings: &Settings) -> u32 {
        let limit = settings.transparent_max_bounces.max(1);
        limit.saturating_sub(self.passed)
    }

    /// Number of the vertex that is lit by what the ray that follows finds; the camera's counts as
    /// the first surface.
    pub(super) fn lit_vertex(&self) -> u32 {
        self.total.saturating_sub(1)
    }

    /// Whether the ray that follows only looks for lights. As in Cycles, a limit of zero leaves
    /// direct light: the ray that follows the first event still sees what shines.
    pub fn at_limit(&self, settings: &Settings) -> bool {
        self.total > settings.max_bounces
            || self.diffuse > settings.diffuse_bounces
            || self.glossy > settings.glossy_bounces
            || self.transmission > settings.transmission_bounces
            || self.volume > settings.volume_bounces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_of_event_has_its_limit() {
        let settings = Settings {
            max_bounces: 4,
            diffuse_bounces: 1,
            glossy_bounces: 2,
            transmission_bounces: 3,
            volume_bounces: 0,
            ..Settings::default()
        };
        let parts = [
            (Part::Diffuse, 1),
            (Part::Glossy, 2),
            (Part::Transmission, 3),
            (Part::Volume, 0),
        ];
        for (part, limit) in parts {
            let mut bounces = Bounces::default();
            for event in 1..=limit + 1 {
                assert!(!bounces.at_limit(&settings), "{part:?} {event}");
                bounces = bounces.after(part);
            }
            assert!(bounces.at_limit(&settings), "{part:?}");
        }
        let mixed = [
            Part::Glossy,
            Part::Glossy,
            Part::Diffuse,
            Part::Transmission,
        ];
        let mixed = mixed.into_iter().fold(Bounces::default(), Bounces::after);
        assert!(!mixed.at_limit(&settings));
        assert!(mixed.after(Part::Transmission).at_limit(&settings));
    }
}
