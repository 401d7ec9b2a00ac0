//! Blender's Principled BSDF, version 2 (Blender 4.0 to 5.2), as a stack of closures.
//!
//! From above: sheen, coat, then metal, transmission and a dielectric mixed by their weights; the
//! dielectric lies over diffuse. What a layer reflects towards the viewer is missing below it
//! (Cycles' albedo scaling). Emission lies below sheen and coat too; the caller adds it.

use glam::Vec3A;

use super::microfacet::Glass;
use super::{Bsdf, rotated_about};
use crate::math::Ggx;
use crate::optics::fresnel::{Fresnel, f0_from_ior, ior_from_f0};
use crate::optics::{Coat, Layers, Sheen, ThinFilm, below};
use crate::shader::Distribution;

/// Principled BSDF after its textures. Names and ranges are those of the node's sockets.
#[derive(Debug, Clone, Copy)]
pub struct Principled {
    /// Base colour.
    pub base_color: Vec3A,
    /// Metallic, 0 to 1.
    pub metallic: f32,
    /// Blender's roughness, 0 to 1; GGX alpha is its square.
    pub roughness: f32,
    /// Roughness of the diffuse layer, 0 to 1.
    pub diffuse_roughness: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Specular IOR Level: F0 is multiplied by twice this.
    pub specular_level: f32,
    /// Colour of the dielectric's reflection at normal incidence, of a metal's at its edge.
    pub specular_tint: Vec3A,
    /// Anisotropic, 0 to 1.
    pub anisotropic: f32,
    /// Turn of the tangent about the normal, 1 for a full circle.
    pub anisotropic_rotation: f32,
    /// Tangent, world space, of any length; not asked for without anisotropy.
    pub tangent: Vec3A,
    /// Transmission weight, 0 to 1.
    pub transmission: f32,
    /// Subsurface weight, 0 to 1; the scattering itself is the caller's.
    pub subsurface: f32,
    /// Coat weight.
    pub coat: f32,
    /// Coat roughness.
    pub coat_roughness: f32,
    /// Coat index of refraction.
    pub coat_ior: f32,
    /// Colour of light that passes the coat straight.
    pub coat_tint: Vec3A,
    /// Unit normal of the coat on the viewer's side, world space.
    pub coat_normal: Vec3A,
    /// Sheen weight.
    pub sheen: f32,
    /// Sheen roughness.
    pub sheen_roughness: f32,
    /// Sheen tint.
    pub sheen_tint: Vec3A,
    /// What lies on metal, glass and dielectric, below the coat, seen from outside.
    pub film: ThinFilm,
    /// Whether it lies on metal, too: not before Blender 5.0.
    pub has_filmed_metal: bool,
    /// Unit shading normal on the viewer's side, world space.
    pub normal: Vec3A,
    /// Whether light that bounces between microfacets is kept ("Multiscatter GGX").
    pub is_multiscatter: bool,
}

/// How microfacets lie that may have a grain, as Principled BSDF and Metallic BSDF say it.
#[derive(Debug, Clone, Copy)]
pub struct Brushed {
    /// Unit shading normal on the viewer's side, world space.
    pub normal: Vec3A,
    /// Blender's roughness, 0 to 1; GGX alpha is its square.
    pub roughness: f32,
    /// Anisotropic, 0 to 1.
    pub anisotropic: f32,
    /// Turn of the tangent about the normal, 1 for a full circle.
    pub rotation: f32,
    /// Tangent, world space, of any length; not asked for without anisotropy.
    pub tangent: Vec3A,
}

impl Principled {
    /// The node's defaults, with this normal.
    pub fn new(normal: Vec3A) -> Self {
        Self {
            base_color: Vec3A::splat(0.8),
            metallic: 0.0,
            roughness: 0.5,
            diffuse_roughness: 0.0,
            ior: 1.5,
            specular_level: 0.5,
            specular_tint: Vec3A::ONE,
            anisotropic: 0.0,
            anisotropic_rotation: 0.0,
            tangent: Vec3A::ZERO,
            transmission: 0.0,
            subsurface: 0.0,
            coat: 0.0,
            coat_roughness: 0.03,
            coat_ior: 1.5,
            coat_tint: Vec3A::ONE,
            coat_normal: normal,
            sheen: 0.0,
            sheen_roughness: 0.5,
            sheen_tint: Vec3A::ONE,
            film: ThinFilm::NONE,
            has_filmed_metal: true,
            normal,
            is_multiscatter: true,
        }
    }

    /// What lies above all else.
    pub(super) fn layers(&self) -> Layers {
        Layers {
            sheen: Sheen {
                weight: self.sheen,
                roughness: self.sheen_roughness,
                tint: self.sheen_tint,
            },
            coat: Coat {
                weight: self.coat,
                roughness: self.coat_roughness,
                ior: self.coat_ior,
                tint: self.coat_tint,
            },
            normal: self.normal,
            coat_normal: self.coat_normal,
        }
    }
}

impl Bsdf {
    /// Adds a Principled BSDF with this weight (its alpha included); returns the weight of its subsurface
    /// scattering, without its colour.
    pub fn add_principled(&mut self, weight: Vec3A, params: &Principled) -> Vec3A {
        let mut weight = weight;
        if params.sheen > 0.0 {
            weight = self.add_principled_sheen(weight, params);
        }
        if params.coat > 0.0 {
            weight = self.add_coat(weight, params);
        }
        let metallic = params.metallic.clamp(0.0, 1.0);
        if metallic > 0.0 {
            self.add_metal(weight * metallic, params);
            weight *= 1.0 - metallic;
        }
        let transmission = params.transmission.clamp(0.0, 1.0);
        if transmission > 0.0 {
            self.add_principled_glass(weight * transmission, params);
            weight *= 1.0 - transmission;
        }
        if weight == Vec3A::ZERO {
            return weight;
        }
        weight = self.add_dielectric(weight, params);
        let subsurface = params.subsurface.clamp(0.0, 1.0);
        let (rest, color) = (weight * (1.0 - subsurface), params.base_color);
        self.add_diffuse(rest, color, params.normal, params.diffuse_roughness);
        weight * subsurface
    }

    fn add_principled_sheen(&mut self, weight: Vec3A, params: &Principled) -> Vec3A {
        let layers = params.layers();
        let (sheen, normal) = (&layers.sheen, layers.sheen_normal());
        let albedo = self.add_sheen(weight * sheen.color(), normal, sheen.roughness);
        below(weight, albedo)
    }

    /// Adds the coat; returns the weight that is left below it.
    fn add_coat(&mut self, weight: Vec3A, params: &Principled) -> Vec3A {
        let Layers {
            coat, coat_normal, ..
        } = params.layers();
        let view = self.view(self.reflecting_normal(coat_normal), None);
        let ggx = isotropic(coat.roughness);
        let albedo = self.add_reflection(view, weight * coat.weight, ggx, coat.fresnel(), true);
        below(weight, albedo) * coat.passed(self.cos_wo(view))
    }

    fn add_metal(&mut self, weight: Vec3A, params: &Principled) {
        let f0 = params.base_color.clamp(Vec3A::ZERO, Vec3A::ONE);
        let tint = params.specular_tint.clamp(Vec3A::ZERO, Vec3A::ONE);
        let (view, ggx) = self.grain(params);
        let film = match params.has_filmed_metal {
            true => params.film,
            false => ThinFilm::NONE,
        };
        let fresnel = Fresnel::metal(f0, tint, film);
        self.add_reflection(view, weight, ggx, fresnel, params.is_multiscatter);
    }

    fn add_principled_glass(&mut self, weight: Vec3A, params: &Principled) {
        let ior = params.ior.max(1e-5);
        let f0 = f0_from_ior(ior) * params.specular_tint;
        let glass = Glass {
            alpha: super::alpha_of(params.roughness),
            ior: self.relative_ior(ior),
            f0: Some(f0.clamp(Vec3A::ZERO, Vec3A::ONE)),
            film: self.seen_film(params.film, ior),
            reflection_tint: Vec3A::ONE,
            // Light passes a body through two surfaces: each takes the root of the colour.
            transmission_tint: params.base_color.clamp(Vec3A::ZERO, Vec3A::ONE).powf(0.5),
        };
        let distribution = match params.is_multiscatter {
            true => Distribution::MultiGgx,
            false => Distribution::Ggx,
        };
        self.add_interface(weight, params.normal, &glass, distribution);
    }

    /// Adds the dielectric layer; returns the weight that is left below it.
    fn add_dielectric(&mut self, weight: Vec3A, params: &Principled) -> Vec3A {
        let mut ior = params.ior.max(1e-5);
        let mut f0 = f0_from_ior(ior);
        if params.specular_level != 0.5 {
            f0 *= 2.0 * params.specular_level.max(0.0);
            let adjusted = ior_from_f0(f0);
            ior = if ior < 1.0 { 1.0 / adjusted } else { adjusted };
        }
        if ior == 1.0 && params.film.is_none() {
            return weight;
        }
        let f0 = (f0 * params.specular_tint).clamp(Vec3A::ZERO, Vec3A::ONE);
        // Seen from within, too, Cycles takes this layer for one that is entered.
        let fresnel = Fresnel::dielectric(ior, f0, params.film);
        let (view, ggx) = self.grain(params);
        let albedo = self.add_reflection(view, weight, ggx, fresnel, params.is_multiscatter);
        below(weight, albedo)
    }

    /// The basis and the microfacets of metal and dielectric.
    fn grain(&mut self, params: &Principled) -> (u8, Ggx) {
        let (view, [along, across]) = self.brushed(&Brushed {
            normal: params.normal,
            roughness: params.roughness,
            anisotropic: params.anisotropic,
            rotation: params.anisotropic_rotation,
            tangent: params.tangent,
        });
        (view, Ggx::new(along, across))
    }

    /// The basis of a brushed surface, and the alphas along and across its grain.
    pub(super) fn brushed(&mut self, brushed: &Brushed) -> (u8, [f32; 2]) {
        let normal = self.reflecting_normal(brushed.normal);
        let alpha = super::alpha_of(brushed.roughness);
        let anisotropic = brushed.anisotropic.clamp(0.0, 1.0);
        if anisotropic == 0.0 {
            return (self.view(normal, None), [alpha, alpha]);
        }
        let aspect = (1.0 - 0.9 * anisotropic).sqrt();
        let tangent = rotated_about(normal, brushed.tangent, brushed.rotation);
        let alphas = [(alpha / aspect).min(1.0), alpha * aspect];
        (self.view(normal, Some(tangent)), alphas)
    }
}

fn isotropic(roughness: f32) -> Ggx {
    Ggx::isotropic(super::alpha_of(roughness))
}
