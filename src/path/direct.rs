//! Light that is found by sampling lights.

use glam::Vec3A;

use super::bounces::Bounces;
use super::light::clamp_factor;
use super::{Tracer, balance};
use crate::sampling::{Bsdf, LightSample, LobePdfs, LobeValues, Receiver, Sampler, Strategy};
use crate::shader::RayKind;
use crate::surface::Surface;

impl Tracer<'_> {
    /// Light found by sampling lights, scattered towards the viewer, for each part of the surface:
    /// from its front, and from behind where light comes through. `pdfs` says with which density
    /// each part's own samples would find the same direction.
    pub fn direct(
        &self,
        surface: &Surface,
        from: &Bounces,
        strategy: Strategy,
        sampler: &Sampler,
        pdfs: impl Fn(&Bsdf, LobePdfs) -> LobePdfs,
    ) -> LobeValues {
        let mut sum = LobeValues::default();
        self.each_lit(surface, from, strategy, sampler, pdfs, |_, lit| sum += lit);
        match from.total {
            0 => sum * clamp_factor(sum.sum(), 1.0, self.settings.clamp_direct),
            _ => sum,
        }
    }

    /// The same light by light, as if nothing limited it.
    #[inline(always)]
    pub(super) fn each_lit(
        &self,
        surface: &Surface,
        from: &Bounces,
        strategy: Strategy,
        sampler: &Sampler,
        pdfs: impl Fn(&Bsdf, LobePdfs) -> LobePdfs,
        mut emit: impl FnMut(&LightSample, LobeValues),
    ) {
        if surface.is_lit_apart {
            return;
        }
        let vertex = from.total;
        let sides: &[f32] = match surface.bsdf.is_lit_from_behind() {
            true => &[1.0, -1.0],
            false => &[1.0],
        };
        for side in sides {
            let receiver = Receiver {
                point: surface.position,
                normal: side * surface.normal,
                time: surface.time,
            };
            let lights = self
                .lights
                .sample(&receiver, strategy, &sampler.light(vertex), || {
                    sampler.sky(vertex)
                });
            // A light that reaches around the horizon is found from both sides: each counts for its
            // own directions.
            let is_on_side = |light: &LightSample| side * light.direction.dot(surface.normal) > 0.0;
            for light in lights.into_iter().flatten().filter(is_on_side) {
                emit(&light, self.lit_by(&light, surface, from, sampler, &pdfs));
            }
        }
    }

    /// What a light sample contributes; see [`Tracer::direct`].
    fn lit_by(
        &self,
        light: &LightSample,
        surface: &Surface,
        from: &Bounces,
        sampler: &Sampler,
        pdfs: impl Fn(&Bsdf, LobePdfs) -> LobePdfs,
    ) -> LobeValues {
        let (mut values, own) = surface.bsdf.eval(light.direction);
        let is_background = light.radiance.is_none();
        if is_background && self.hides_background(from) && surface.bsdf.is_clear(self.clear_alpha())
        {
            values.transmission = Vec3A::ZERO;
        }
        let values = match surface.membership.is_lit_by(light.reach.links) {
            true => found_by(light, values, from.total),
            false => return LobeValues::default(),
        };
        if values.sum() == Vec3A::ZERO {
            return LobeValues::default();
        }
        let share = self.unshadowed(surface, light, from, sampler);
        if share == Vec3A::ZERO {
            return LobeValues::default();
        }
        let own = pdfs(&surface.bsdf, own);
        let radiance = share * self.lights.radiance(light);
        let lit = values * radiance;
        LobeValues {
            lambert: lit.lambert * weight(light, own.lambert),
            ..lit * weight(light, own.own * surface.odds)
        }
    }
}

/// What a surface does with light, as far as rays from its parts would find the light.
fn found_by(light: &LightSample, values: LobeValues, vertex: u32) -> LobeValues {
    let part = |value, kind| match light.reach.includes(kind, vertex) {
        true => value,
        false => Vec3A::ZERO,
    };
    LobeValues {
        lambert: part(values.lambert, RayKind::Diffuse),
        diffuse: part(values.diffuse, RayKind::Diffuse),
        glossy: part(values.glossy, RayKind::Glossy),
        transmission: part(values.transmission, RayKind::Transmission),
        translucent: part(values.translucent, RayKind::Transmission),
    }
}

/// Weight of a light sample over its density, given the density with which surface sampling finds
/// it.
fn weight(light: &LightSample, own_pdf: f32) -> f32 {
    let weight = if light.is_delta || light.reach.links.blockers != 0 {
        1.0
    } else {
        balance(light.pdf_solid_angle, own_pdf)
    };
    weight / light.pdf_solid_angle
}
