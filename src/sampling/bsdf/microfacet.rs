//! Microfacets that reflect, or reflect and refract, seen from a fixed direction in the basis of
//! their normal.

use glam::Vec3A;

use super::{Part, Scattered};
use crate::math::{Beckmann, Ggx};
use crate::optics::ThinFilm;
use crate::optics::energy;
use crate::optics::fresnel::{Fresnel, dielectric};

/// Smallest GGX alpha (a roughness of 0.01): keeps every density finite in single precision. A
/// mirror blurs by a hundredth of a degree, a hundredth of the sun's disk.
pub const ALPHA_MIN: f32 = 1e-4;

/// A distribution of microfacets in the basis of their mean normal.
pub trait Facets: Copy {
    /// Its width: the geometric mean of those along and across a grain.
    fn alpha(self) -> f32;
    /// Density of normals [1/sr], zero below the horizon.
    fn distribution(self, normal: Vec3A) -> f32;
    /// Share of them that both directions see.
    fn masking_shadowing(self, wo: Vec3A, wi: Vec3A) -> f32;
    /// A normal; one that is met from behind scatters nothing.
    fn sample(self, wo: Vec3A, u: [f32; 2]) -> Vec3A;
    /// Density of samples over that of the normals, times the cosine of `wo` to the mean normal over
    /// that to `normal`.
    fn sampled(self, wo: Vec3A, normal: Vec3A) -> f32;
}

impl Facets for Ggx {
    fn alpha(self) -> f32 {
        self.alpha()
    }

    fn distribution(self, normal: Vec3A) -> f32 {
        self.distribution(normal)
    }

    fn masking_shadowing(self, wo: Vec3A, wi: Vec3A) -> f32 {
        self.masking_shadowing(wo, wi)
    }

    fn sample(self, wo: Vec3A, u: [f32; 2]) -> Vec3A {
        self.sample_visible_normal(wo, u)
    }

    fn sampled(self, wo: Vec3A, _: Vec3A) -> f32 {
        self.masking(wo)
    }
}

impl Facets for Beckmann {
    fn alpha(self) -> f32 {
        self.alpha()
    }

    fn distribution(self, normal: Vec3A) -> f32 {
        self.distribution(normal)
    }

    fn masking_shadowing(self, wo: Vec3A, wi: Vec3A) -> f32 {
        self.masking_shadowing(wo, wi)
    }

    fn sample(self, _: Vec3A, u: [f32; 2]) -> Vec3A {
        self.sample(u)
    }

    fn sampled(self, wo: Vec3A, normal: Vec3A) -> f32 {
        normal.z * wo.z / wo.dot(normal).abs().max(f32::MIN_POSITIVE)
    }
}

/// Microfacets that reflect. Weight and compensation for multiple scattering are in the colours.
#[derive(Debug, Clone, Copy)]
pub struct Reflection<F = Ggx> {
    pub facets: F,
    pub fresnel: Fresnel,
}

impl<F: Facets> Reflection<F> {
    /// Microfacets seen under the cosine `cos_wo`, and the share of white light that they reflect
    /// towards the viewer.
    ///
    /// Light that bounces between microfacets is given back by scaling the lobe, as Cycles does
    /// for its "Multiscatter GGX": `1 + Fms (1 - E) / E` with Fms after Kulla and Conty 2017.
    pub fn new(
        weight: Vec3A,
        facets: F,
        fresnel: Fresnel,
        is_multiscatter: bool,
        cos_wo: f32,
    ) -> (Self, Vec3A) {
        let roughness = facets.alpha().sqrt();
        let (scale, albedo) = match is_multiscatter {
            true => energy::multiscatter(&fresnel, roughness, cos_wo),
            false => (Vec3A::ONE, fresnel.seen_under(roughness, cos_wo)),
        };
        let (scale, albedo) = (weight * scale, weight * albedo);
        let fresnel = fresnel.scaled(scale);
        (Self { facets, fresnel }, albedo)
    }

    /// `f cos` [1/sr] and the density of [`Reflection::sample`] [1/sr]; `wo` is above z = 0.
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> Option<Scattered> {
        if wi.z <= 0.0 {
            return None;
        }
        let half = (wo + wi).normalize_or(Vec3A::Z);
        let common = self.facets.distribution(half) / (4.0 * wo.z);
        let fresnel = self.fresnel.at(wo.dot(half).clamp(0.0, 1.0));
        Some(Scattered {
            part: Part::Glossy,
            value: fresnel * (common * self.facets.masking_shadowing(wo, wi)),
            pdf_solid_angle: common * self.facets.sampled(wo, half),
        })
    }

    /// A unit direction; it may lie below z = 0, where the lobe is black.
    pub fn sample(&self, wo: Vec3A, u: [f32; 2]) -> Vec3A {
        let half = self.facets.sample(wo, u);
        (2.0 * wo.dot(half) * half - wo).normalize()
    }
}

/// Microfacets of glass: they reflect and refract.
#[derive(Debug, Clone, Copy)]
pub struct Interface<F = Ggx> {
    pub facets: F,
    /// Index of refraction beyond the surface over that on the viewer's side.
    ior: f32,
    /// Whether it follows Fresnel; else all is refracted unless it cannot be.
    reflects: bool,
    /// Reflectance at normal incidence.
    f0: Vec3A,
    /// What lies on the surface, as the viewer sees it.
    film: ThinFilm,
    /// Factor on what is reflected, weight and compensation included.
    reflection: Vec3A,
    /// Factor on what is refracted, weight and compensation included.
    transmission: Vec3A,
}

/// What a glass surface is made of.
#[derive(Debug, Clone, Copy)]
pub struct Glass {
    /// Alpha of its microfacets.
    pub alpha: f32,
    /// Index of refraction beyond the surface over that on the viewer's side.
    pub ior: f32,
    /// Reflectance at normal incidence; `None` where all is refracted unless it cannot be.
    pub f0: Option<Vec3A>,
    /// What lies on the surface, as the viewer sees it.
    pub film: ThinFilm,
    /// Colour of what is reflected.
    pub reflection_tint: Vec3A,
    /// Colour of what is refracted.
    pub transmission_tint: Vec3A,
}

/// Indices of refraction keep this distance from one: there half vectors have no digits left. Rays
/// then bend by less than a thousandth.
const IOR_STEP: f32 = 1e-3;

impl<F: Facets> Interface<F> {
    /// Glass seen under the cosine `cos_wo`, and the shares of white light that it reflects and
    /// refracts towards the viewer.
    ///
    /// As in Cycles the tint of transmission stands for the colour that light takes on between the
    /// microfacets.
    pub fn new(
        weight: Vec3A,
        glass: &Glass,
        facets: F,
        is_multiscatter: bool,
        cos_wo: f32,
    ) -> (Self, [Vec3A; 2]) {
        let ior = if (glass.ior - 1.0).abs() < IOR_STEP {
            1.0 + IOR_STEP.copysign(glass.ior - 1.0)
        } else {
            glass.ior
        };
        let roughness = glass.alpha.sqrt();
        let mut scale = weight;
        let mut single = 1.0;
        if is_multiscatter {
            single = energy::glass_albedo(ior, roughness, cos_wo);
            let average = energy::glass_average_albedo(ior, roughness);
            scale *= energy::compensation(single, average, glass.transmission_tint);
        }
        let interface = Self {
            facets,
            ior,
            reflects: glass.f0.is_some(),
            f0: glass.f0.unwrap_or(Vec3A::ZERO),
            film: glass.film,
            reflection: scale * glass.reflection_tint,
            transmission: scale * glass.transmission_tint,
        };
        let seen = match interface.reflects {
            true => interface.fresnel().seen_under(roughness, cos_wo),
            false => Vec3A::ZERO,
        };
        let albedos = [
            seen * interface.reflection * single,
            (Vec3A::ONE - seen) * interface.transmission * single,
        ];
        (interface, albedos)
    }

    /// Whether it refracts.
    pub fn is_transmissive(&self) -> bool {
        self.transmission != Vec3A::ZERO
    }

    /// Takes up what another one scatters.
    pub fn add(&mut self, other: &Self) {
        self.reflection += other.reflection;
        self.transmission += other.transmission;
    }

    /// Multiplies what it scatters by a colour.
    pub fn tint(&mut self, color: Vec3A) {
        self.reflection *= color;
        self.transmission *= color;
    }

    /// Leaves out what is reflected or what is refracted.
    pub fn remove(&mut self, part: Part) {
        match part {
            Part::Glossy => self.reflection = Vec3A::ZERO,
            Part::Transmission => self.transmission = Vec3A::ZERO,
            Part::Diffuse | Part::Volume => {}
        }
    }

    /// How its microfacets reflect where they follow Fresnel.
    fn fresnel(&self) -> Fresnel {
        Fresnel::dielectric(self.ior, self.f0, self.film)
    }

    /// What a microfacet reflects and what it refracts, under a cosine.
    fn split(&self, cos: f32) -> [Vec3A; 2] {
        let reflectance = if self.reflects {
            self.fresnel().at(cos)
        } else if dielectric(cos, self.ior) < 1.0 {
            Vec3A::ZERO
        } else {
            // Total reflection takes the light away that this closure only refracts.
            return [Vec3A::ZERO; 2];
        };
        [
            reflectance * self.reflection,
            (Vec3A::ONE - reflectance) * self.transmission,
        ]
    }

    /// `f cos` [1/sr] and the density of [`Interface::sample`] [1/sr]; `wo` is above z = 0.
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> Option<Scattered> {
        let is_reflected = wi.z > 0.0;
        let (half, jacobian) = if is_reflected {
            ((wo + wi).normalize_or(Vec3A::Z), 0.25)
        } else {
            self.refracting_half(wo, wi)?
        };
        let split = self.split(wo.dot(half).abs().min(1.0));
        let [reflected, refracted] = split.map(Vec3A::element_sum);
        let total = reflected + refracted;
        if !(total > 0.0) {
            return None;
        }
        let (part, color, probability) = if is_reflected {
            (Part::Glossy, split[0], reflected / total)
        } else {
            (Part::Transmission, split[1], refracted / total)
        };
        let common = self.facets.distribution(half) / wo.z * jacobian;
        Some(Scattered {
            part,
            value: color * (common * self.facets.masking_shadowing(wo, wi)),
            pdf_solid_angle: probability * common * self.facets.sampled(wo, half),
        })
    }

    /// The normal of the microfacets that refract `wi`, which is below z = 0, to `wo`, and the
    /// density of directions over that of normals times the viewer's cosine (Walter et al. 2007,
    /// Eq. 16 and 17).
    ///
    /// Radiance is counted per basic radiance, that is without the factor that a change of medium
    /// brings: rays from the camera come back to air before they meet a light.
    ///
    /// As in Cycles microfacets count that are met from behind, with a density that no sample has:
    /// light samples alone find them. Through glass of roughness 0.8 lamps shine 3 % brighter by them.
    fn refracting_half(&self, wo: Vec3A, wi: Vec3A) -> Option<(Vec3A, f32)> {
        let sum = wo + self.ior * wi;
        let length_squared = sum.length_squared();
        if !(length_squared > 0.0) {
            return None;
        }
        let half = sum / length_squared.sqrt();
        let half = if half.z < 0.0 { -half } else { half };
        let jacobian = self.ior * self.ior * (wo.dot(half) * wi.dot(half)).abs() / length_squared;
        Some((half, jacobian))
    }

    /// A unit direction, reflected or refracted as `u_choice` decides; none where nothing is.
    pub fn sample(&self, wo: Vec3A, u_choice: f32, u: [f32; 2]) -> Option<Vec3A> {
        let half = self.facets.sample(wo, u);
        let cos = wo.dot(half);
        if cos <= 0.0 {
            return None;
        }
        let [reflected, refracted] = self.split(cos.clamp(0.0, 1.0)).map(Vec3A::element_sum);
        let total = reflected + refracted;
        if !(total > 0.0) {
            return None;
        }
        let is_reflected = u_choice * total < reflected;
        let wi = if is_reflected {
            2.0 * cos * half - wo
        } else {
            let cos_squared = 1.0 - (1.0 - cos * cos) / (self.ior * self.ior);
            (cos / self.ior - cos_squared.max(0.0).sqrt()) * half - wo / self.ior
        };
        // A microfacet may send light to the wrong side of the surface: there it is lost.
        (is_reflected == (wi.z > 0.0)).then(|| wi.normalize())
    }
}
