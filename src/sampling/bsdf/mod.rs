//! How a surface scatters light at a hit: a Lambert part and a few GGX lobes, kept apart because
//! only the diffuse part takes borrowed light.
//!
//! Weights follow Cycles' Principled BSDF (4.x and 5.x) without transmission, coat, sheen and
//! subsurface: metal (Schlick from the base colour to white), else a dielectric layer over Lambert;
//! what the layer reflects towards the viewer is missing below it. GGX is compensated for multiple
//! scattering ("Multiscatter GGX", Blender's default).
//!
//! # Geometric and shading normal
//! Directions below the geometric surface scatter nothing, in evaluation and in sampling alike, so
//! the estimators agree. Seen from behind its shading normal a lobe would be black: its normal is
//! bent just so far that the mirror direction leaves the surface. Neither rescales energy: smooth
//! shading of coarse meshes loses some near the terminator, where the mesh shadows itself anyway.
//!
//! # Departures from Cycles
//! Cycles checks the geometric normal in sampling only; roughness below 0.01 counts as 0.01.

mod energy;
mod fresnel;
mod lobe;

use glam::Vec3A;

use crate::math::warp::{pdf_cosine_hemisphere, sample_cosine_hemisphere};
use crate::math::{Frame, luminance};
use fresnel::{Curve, f0_from_ior, ior_from_f0};
pub use lobe::ALPHA_MIN;
use lobe::Lobe;

/// GGX lobes a surface may have: two Principled BSDFs, mixed. Further ones share the roughness of
/// the last; each place costs time at every hit.
pub const MAX_LOBES: usize = 4;

/// Principled BSDF after its textures.
#[derive(Debug, Clone, Copy)]
pub struct Principled {
    /// Base colour.
    pub base_color: Vec3A,
    /// Metallic, 0 to 1.
    pub metallic: f32,
    /// Blender's roughness, 0 to 1; GGX alpha is its square.
    pub roughness: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Specular IOR Level: F0 is multiplied by twice this.
    pub specular: f32,
}

/// `f cos` of each part [1/sr].
#[derive(Debug, Clone, Copy, Default)]
pub struct LobeValues {
    /// Lambert part.
    pub diffuse: Vec3A,
    /// All GGX lobes.
    pub glossy: Vec3A,
}

impl LobeValues {
    /// The whole surface.
    pub fn sum(&self) -> Vec3A {
        self.diffuse + self.glossy
    }
}

/// Density [1/sr] of each part's own sampler, without the probability of choosing the part.
#[derive(Debug, Clone, Copy, Default)]
pub struct LobePdfs {
    /// Of [`Bsdf::sample_diffuse`].
    pub diffuse: f32,
    /// Of [`Bsdf::sample_glossy`].
    pub glossy: f32,
}

/// Which part a direction was drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Lambert.
    Diffuse,
    /// A GGX lobe.
    Glossy,
}

/// A scattered direction.
#[derive(Debug, Clone, Copy)]
pub struct BsdfSample {
    /// Unit vector away from the surface, world space.
    pub direction: Vec3A,
    /// The part it was drawn from.
    pub part: Part,
    /// `f cos` of both parts [1/sr].
    pub value: LobeValues,
    /// Densities of both parts [1/sr].
    pub pdfs: LobePdfs,
}

/// A surface at a hit, seen from one direction.
#[derive(Debug, Clone, Copy)]
pub struct Bsdf {
    geometric_normal: Vec3A,
    diffuse_frame: Frame,
    glossy_frame: Frame,
    /// Direction to the viewer in `glossy_frame`.
    wo_local: Vec3A,
    diffuse: Vec3A,
    lobes: [Lobe; MAX_LOBES],
    lobe_count: usize,
}

impl Bsdf {
    /// A black surface seen from `wo`. All are unit vectors in world space; `geometric_normal` is
    /// on the side of `wo`, and `shading_normal` on the side of `geometric_normal`.
    pub fn new(shading_normal: Vec3A, geometric_normal: Vec3A, wo: Vec3A) -> Self {
        let glossy_normal = reflecting_normal(shading_normal, geometric_normal, wo);
        let glossy_frame = Frame::from_normal(glossy_normal);
        let mut wo_local = glossy_frame.to_local(wo);
        wo_local.z = wo_local.z.max(1e-6);
        Self {
            geometric_normal,
            diffuse_frame: Frame::from_normal(shading_normal),
            glossy_frame,
            wo_local,
            diffuse: Vec3A::ZERO,
            lobes: [Lobe::BLACK; MAX_LOBES],
            lobe_count: 0,
        }
    }

    /// Adds a Principled BSDF with this weight (its alpha included).
    pub fn add_principled(&mut self, weight: f32, params: &Principled) {
        let base_color = params.base_color.max(Vec3A::ZERO);
        let metallic = params.metallic.clamp(0.0, 1.0);
        if metallic > 0.0 {
            let f0 = base_color.min(Vec3A::ONE);
            let weight = Vec3A::splat(weight * metallic);
            self.add_lobe(weight, params.roughness, Curve::Schlick, f0, Vec3A::ONE);
        }
        let below = self.add_dielectric(Vec3A::splat(weight * (1.0 - metallic)), params);
        self.diffuse += base_color * below;
    }

    /// Adds a Diffuse BSDF: `color` is the albedo times the weight.
    pub fn add_diffuse(&mut self, color: Vec3A) {
        self.diffuse += color.max(Vec3A::ZERO);
    }

    /// Adds a Glossy BSDF.
    pub fn add_glossy(&mut self, weight: f32, color: Vec3A, roughness: f32) {
        let color = color.clamp(Vec3A::ZERO, Vec3A::ONE);
        self.add_lobe(
            Vec3A::splat(weight),
            roughness,
            Curve::Schlick,
            color,
            color,
        );
    }

    /// Adds the dielectric layer of a Principled BSDF; returns the weight that is left below it.
    fn add_dielectric(&mut self, weight: Vec3A, params: &Principled) -> Vec3A {
        if weight == Vec3A::ZERO {
            return weight;
        }
        let mut ior = params.ior.max(1e-5);
        let mut f0 = f0_from_ior(ior);
        if params.specular != 0.5 {
            f0 *= 2.0 * params.specular.max(0.0);
            let adjusted = ior_from_f0(f0);
            ior = if ior < 1.0 { 1.0 / adjusted } else { adjusted };
        }
        if ior == 1.0 {
            return weight;
        }
        let f0 = Vec3A::splat(f0.min(1.0));
        let curve = Curve::Dielectric { ior };
        let albedo = self.add_lobe(weight, params.roughness, curve, f0, Vec3A::ONE);
        weight * (1.0 - (albedo / weight).max_element()).clamp(0.0, 1.0)
    }

    /// Adds a GGX lobe and returns its albedo.
    fn add_lobe(
        &mut self,
        weight: Vec3A,
        roughness: f32,
        curve: Curve,
        f0: Vec3A,
        f90: Vec3A,
    ) -> Vec3A {
        let lobe = Lobe::new(weight, roughness, curve, f0, f90, self.wo_local.z);
        if lobe.albedo().max_element() <= 0.0 {
            return Vec3A::ZERO;
        }
        if self.lobe_count < MAX_LOBES {
            self.lobes[self.lobe_count] = lobe;
            self.lobe_count += 1;
        } else {
            self.lobes[MAX_LOBES - 1].absorb(&lobe);
        }
        lobe.albedo()
    }

    fn lobes(&self) -> &[Lobe] {
        &self.lobes[..self.lobe_count]
    }

    /// Probability that [`Bsdf::sample`] chooses the diffuse part: 0 or 1 where the other is black.
    pub fn probability_diffuse(&self) -> f32 {
        let diffuse = luminance(self.diffuse);
        let glossy = luminance(self.albedo_glossy());
        if diffuse + glossy > 0.0 {
            diffuse / (diffuse + glossy)
        } else {
            1.0
        }
    }

    /// Whether the surface scatters nothing.
    pub fn is_black(&self) -> bool {
        self.diffuse == Vec3A::ZERO && self.lobe_count == 0
    }

    /// Values and densities of both parts towards `wi`.
    pub fn eval(&self, wi: Vec3A) -> (LobeValues, LobePdfs) {
        if wi.dot(self.geometric_normal) <= 0.0 {
            return Default::default();
        }
        let cosine_pdf = pdf_cosine_hemisphere(wi.dot(self.diffuse_frame.normal()));
        let (glossy, glossy_pdf) = self.eval_glossy(wi);
        let has_diffuse = self.diffuse != Vec3A::ZERO;
        (
            LobeValues {
                diffuse: self.diffuse * cosine_pdf,
                glossy,
            },
            LobePdfs {
                diffuse: if has_diffuse { cosine_pdf } else { 0.0 },
                glossy: glossy_pdf,
            },
        )
    }

    fn eval_glossy(&self, wi: Vec3A) -> (Vec3A, f32) {
        let wi = self.glossy_frame.to_local(wi);
        if wi.z <= 0.0 || self.lobe_count == 0 {
            return (Vec3A::ZERO, 0.0);
        }
        let (mut value, mut pdf, mut total) = (Vec3A::ZERO, 0.0, 0.0);
        for lobe in self.lobes() {
            let (lobe_value, lobe_pdf) = lobe.eval(self.wo_local, wi);
            let weight = luminance(lobe.albedo());
            value += lobe_value;
            pdf += weight * lobe_pdf;
            total += weight;
        }
        (value, pdf / total)
    }

    /// The density with which [`Bsdf::sample`] draws a direction that has these densities.
    pub fn pdf(&self, pdfs: LobePdfs) -> f32 {
        let diffuse = self.probability_diffuse();
        diffuse * pdfs.diffuse + (1.0 - diffuse) * pdfs.glossy
    }

    /// A direction of the diffuse part; none below the geometric surface.
    pub fn sample_diffuse(&self, u: [f32; 2]) -> Option<Vec3A> {
        let direction = self.diffuse_frame.to_world(sample_cosine_hemisphere(u));
        self.above(direction)
    }

    /// A direction of the glossy part; none below the surface.
    pub fn sample_glossy(&self, u_lobe: f32, u: [f32; 2]) -> Option<Vec3A> {
        let total: f32 = self
            .lobes()
            .iter()
            .map(|lobe| luminance(lobe.albedo()))
            .sum();
        let mut rest = u_lobe * total;
        let lobe = self.lobes().iter().find(|lobe| {
            rest -= luminance(lobe.albedo());
            rest < 0.0
        });
        // Rounding may leave a rest behind the last lobe.
        let lobe = lobe.or(self.lobes().last())?;
        self.above(self.glossy_frame.to_world(lobe.sample(self.wo_local, u)?))
    }

    /// A direction of either part, chosen with [`Bsdf::probability_diffuse`].
    pub fn sample(&self, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let probability = self.probability_diffuse();
        let (part, direction) = if u_lobe < probability {
            (Part::Diffuse, self.sample_diffuse(u)?)
        } else {
            let rescaled = (u_lobe - probability) / (1.0 - probability);
            (Part::Glossy, self.sample_glossy(rescaled, u)?)
        };
        let (value, pdfs) = self.eval(direction);
        // A black surface has no density: dividing by it would spoil the light it emits itself.
        (self.pdf(pdfs) > 0.0).then_some(BsdfSample {
            direction,
            part,
            value,
            pdfs,
        })
    }

    fn above(&self, direction: Vec3A) -> Option<Vec3A> {
        (direction.dot(self.geometric_normal) > 0.0).then_some(direction)
    }

    /// Share of white light that the diffuse part reflects.
    pub fn albedo_diffuse(&self) -> Vec3A {
        self.diffuse
    }

    /// Share of white light that the glossy part reflects towards the viewer.
    pub fn albedo_glossy(&self) -> Vec3A {
        self.lobes().iter().map(Lobe::albedo).sum()
    }

    /// Share of white light reflected towards the viewer.
    pub fn albedo(&self) -> Vec3A {
        self.diffuse + self.albedo_glossy()
    }

    /// Smallest and largest GGX alpha of the glossy part, if there is one.
    pub fn glossy_alphas(&self) -> Option<(f32, f32)> {
        let alphas = self.lobes().iter().map(Lobe::alpha);
        alphas.fold(None, |range: Option<(f32, f32)>, alpha| {
            let (low, high) = range.unwrap_or((alpha, alpha));
            Some((low.min(alpha), high.max(alpha)))
        })
    }
}

/// The shading normal, bent as little as lets a mirror send `wo` back above the surface.
///
/// The mirror direction is lifted to a grazing one; the new normal is halfway between it and `wo`.
fn reflecting_normal(shading_normal: Vec3A, geometric_normal: Vec3A, wo: Vec3A) -> Vec3A {
    /// Sine of the angle above the surface that a mirror direction must keep.
    const GRAZING: f32 = 0.01;
    let least = (0.9 * wo.dot(geometric_normal)).clamp(0.0, GRAZING);
    let mirror = 2.0 * shading_normal.dot(wo) * shading_normal - wo;
    let height = mirror.dot(geometric_normal);
    if height >= least {
        return shading_normal;
    }
    let lifted = (mirror + geometric_normal * (least - height)).normalize_or(geometric_normal);
    (lifted + wo).normalize_or(geometric_normal)
}

#[cfg(test)]
mod tests;
