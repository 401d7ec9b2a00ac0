//! How a surface scatters light at a hit: a Lambert part, which takes borrowed light, and a short
//! list of other closures, each with its own normal.
//!
//! Closures and their weights follow Cycles (Blender 4.2 to 5.2): see [`principled`],
//! [`microfacet`] and [`diffuse`].
//!
//! # Geometric and shading normal
//! Reflection goes to the viewer's side of the geometric surface and transmission to the other, in
//! evaluation and in sampling alike, so the estimators agree. Seen from behind its shading normal a
//! lobe would be black: its normal is bent just so far that the mirror direction leaves the surface.
//! Neither rescales energy: smooth shading of coarse meshes loses some near the terminator, where
//! the mesh shadows itself anyway.
//!
//! # Departures from Cycles
//! Cycles checks the geometric normal in sampling only. Roughness below 0.01 counts as 0.01; an index of refraction within
//! 0.001 of one counts as 0.001 away; bumps of less than 16 degrees do not shadow each other.

mod diffuse;
mod fibre;
mod lobe;
mod microfacet;
mod phase;
mod principled;
mod streak;
mod toon;
mod velvet;

use glam::{Quat, Vec3A};
use smallvec::SmallVec;

use crate::math::warp::{pdf_cosine_hemisphere, sample_cosine_hemisphere};
use crate::math::{Beckmann, Frame, Ggx, luminance, reflecting_normal};
use crate::optics::ThinFilm;
use crate::optics::fresnel::{Curve, Fresnel, f0_from_ior};
use crate::shader::Distribution;
use diffuse::{OrenNayar, Sheen, Translucent};
use fibre::Fibre;
pub use fibre::Hair;
use lobe::{Lobe, Model};
pub use microfacet::ALPHA_MIN;
use microfacet::{Glass, Interface, Reflection};
use phase::Phase;
pub use phase::{pdf_scattered, sample_scattered};
pub use principled::{Brushed, Principled};
use streak::Streak;
use toon::Toon;
use velvet::Velvet;

/// Closures that a surface may have beside its Lambert part: four Principled BSDFs with all their layers.
/// Further ones take the shape of the last one of their kind.
pub const MAX_LOBES: usize = 32;

/// Different normals and tangents that a surface's closures may have; further ones take the last.
const MAX_VIEWS: usize = 16;

/// Closures, and normals, that are kept without asking for memory: most surfaces have no more, and what is never written
/// costs no time. A surface is moved some times on its way to the path.
const INLINE: usize = 1;

/// Which part of a surface scattered light, as bounce limits and passes count it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Reflection without a mirror direction.
    Diffuse,
    /// Reflection about a mirror direction.
    Glossy,
    /// Everything that goes through the surface.
    Transmission,
    /// Scattering within a medium, to all sides.
    Volume,
}

impl Part {
    /// Whether it scatters to the viewer's side of the geometric surface, or else to the other.
    fn may_leave(self, is_above: bool) -> bool {
        self == Part::Volume || is_above != (self == Part::Transmission)
    }
}

/// `f cos` of each part [1/sr].
#[derive(Debug, Clone, Copy, Default)]
pub struct LobeValues {
    /// Lambert part.
    pub lambert: Vec3A,
    /// Other diffuse reflection.
    pub diffuse: Vec3A,
    /// Glossy reflection.
    pub glossy: Vec3A,
    /// Refraction.
    pub transmission: Vec3A,
    /// Diffuse transmission.
    pub translucent: Vec3A,
}

impl LobeValues {
    /// The whole surface.
    pub fn sum(&self) -> Vec3A {
        self.lambert + self.own()
    }

    /// All but the Lambert part.
    pub fn own(&self) -> Vec3A {
        self.diffuse + self.glossy + self.transmission + self.translucent
    }

    /// As passes divide it: diffuse to either side, mirrored, refracted.
    pub fn by_pass(&self) -> [Vec3A; 3] {
        [
            self.lambert + self.diffuse + self.translucent,
            self.glossy,
            self.transmission,
        ]
    }

    fn add_scattered(&mut self, scattered: &Scattered, is_wide: bool, factor: f32) {
        let sum = match scattered.part {
            Part::Diffuse | Part::Volume => &mut self.diffuse,
            Part::Glossy => &mut self.glossy,
            Part::Transmission if is_wide => &mut self.translucent,
            Part::Transmission => &mut self.transmission,
        };
        *sum += factor * scattered.value;
    }
}

impl std::ops::AddAssign for LobeValues {
    fn add_assign(&mut self, other: Self) {
        self.lambert += other.lambert;
        self.diffuse += other.diffuse;
        self.glossy += other.glossy;
        self.transmission += other.transmission;
        self.translucent += other.translucent;
    }
}

impl std::ops::Mul<f32> for LobeValues {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        self * Vec3A::splat(factor)
    }
}

impl std::ops::Mul<Vec3A> for LobeValues {
    type Output = Self;

    fn mul(self, factor: Vec3A) -> Self {
        Self {
            lambert: factor * self.lambert,
            diffuse: factor * self.diffuse,
            glossy: factor * self.glossy,
            transmission: factor * self.transmission,
            translucent: factor * self.translucent,
        }
    }
}

/// Density [1/sr] of the two samplers, without the probability of choosing one.
#[derive(Debug, Clone, Copy, Default)]
pub struct LobePdfs {
    /// Of [`Bsdf::sample_lambert`].
    pub lambert: f32,
    /// Of [`Bsdf::sample_own`].
    pub own: f32,
}

/// What one closure scatters in a direction.
#[derive(Debug, Clone, Copy)]
struct Scattered {
    part: Part,
    /// `f cos` [1/sr].
    value: Vec3A,
    pdf_solid_angle: f32,
}

/// A scattered direction.
#[derive(Debug, Clone, Copy)]
pub struct BsdfSample {
    /// Unit vector away from the surface, world space.
    pub direction: Vec3A,
    /// The part it was drawn from.
    pub part: Part,
    /// GGX alpha of the closure it was drawn from; one without microfacets.
    pub alpha: f32,
    /// `f cos` of all parts [1/sr].
    pub value: LobeValues,
    /// Densities of both samplers [1/sr].
    pub pdfs: LobePdfs,
}

/// A direction of one closure.
#[derive(Debug, Clone, Copy)]
pub struct Drawn {
    /// Unit vector away from the surface, world space.
    pub direction: Vec3A,
    /// The part it was drawn from.
    pub part: Part,
    /// GGX alpha of the closure; one without microfacets.
    pub alpha: f32,
    origin: Origin,
}

/// Which closure a direction was drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Origin {
    Lambert,
    Lobe(u8),
}

/// What describes a reflecting closure without grain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gloss {
    /// GGX alpha.
    pub alpha: f32,
    /// Index of refraction of a dielectric; 0 where reflectance follows Schlick's curve.
    pub ior: f32,
    /// Reflectance at normal incidence, the closure's weight included.
    pub f0: Vec3A,
    /// Reflectance at grazing incidence, the closure's weight included.
    pub f90: Vec3A,
    /// Which closure it is.
    index: usize,
}

/// What denoisers are told of a surface.
#[derive(Debug, Clone, Copy, Default)]
pub struct Guides {
    /// Mean of the closures' unit normals, weighted by their albedo; world space.
    pub normal: Vec3A,
    /// Albedo of the closures that show the surface itself.
    pub wide: Vec3A,
    /// Albedo of those that show other things, clearly.
    pub clear: Vec3A,
    /// Share of the first in both; 1 for a black surface.
    pub wide_share: f32,
}

/// A basis that closures share, and the viewer in it.
#[derive(Debug, Clone, Copy)]
struct View {
    frame: Frame,
    /// What the basis' x axis was made of; zero where it is arbitrary.
    tangent: Vec3A,
    /// Direction to the viewer.
    wo: Vec3A,
    /// Squared alpha of the bumps that bent the normal; see [`Bsdf::bump_shadow`].
    bump: f32,
    /// Whether the normal is on the other side of the smooth surface: what is reflected leaves there.
    is_turned: bool,
}

impl View {
    /// Direction to the viewer, lifted above z = 0: microfacets know no other.
    fn lifted(&self) -> Vec3A {
        self.wo.with_z(self.wo.z.max(1e-6))
    }

    /// The same for a closure; `None` where it scatters nothing, the viewer being behind the normal.
    fn wo_for(&self, lobe: &Lobe) -> Option<Vec3A> {
        match lobe.model {
            Model::OrenNayar(_) => Some(self.wo),
            _ if self.wo.z < 0.0 && lobe.is_of_facets() => None,
            _ => Some(self.lifted()),
        }
    }
}

/// A surface at a hit, seen from one direction.
#[derive(Debug, Clone)]
pub struct Bsdf {
    geometric_normal: Vec3A,
    /// The normal without bumps and normal maps.
    smooth_normal: Vec3A,
    wo: Vec3A,
    is_front: bool,
    has_bump_correction: bool,
    /// Albedo of the Lambert part.
    lambert: Vec3A,
    lambert_view: u8,
    lobes: SmallVec<[Lobe; INLINE]>,
    views: SmallVec<[View; INLINE]>,
}

/// Building a surface. Weights are what mixing leaves of a closure; normals are unit vectors in world
/// space on the viewer's side of the geometric surface; roughness is Blender's, 0 to 1.
impl Bsdf {
    /// A black surface seen from `wo`, from outside where `is_front`. Both are unit vectors in world
    /// space; `geometric_normal` is on the side of `wo`.
    #[inline(always)]
    pub fn new(geometric_normal: Vec3A, wo: Vec3A, is_front: bool) -> Self {
        Self {
            geometric_normal,
            smooth_normal: geometric_normal,
            wo,
            is_front,
            has_bump_correction: true,
            lambert: Vec3A::ZERO,
            lambert_view: 0,
            lobes: SmallVec::new(),
            views: SmallVec::new(),
        }
    }

    /// The same with a smooth shading normal (a unit vector), from which bumps are told.
    pub fn with_smooth_normal(mut self, smooth_normal: Vec3A) -> Self {
        self.set_smooth_normal(smooth_normal);
        self
    }

    /// Changes the smooth shading normal (a unit vector) of the closures that follow.
    pub fn set_smooth_normal(&mut self, smooth_normal: Vec3A) {
        self.smooth_normal = smooth_normal;
    }

    /// Whether normals of the closures that follow are bent back and bumps shadow each other, as in Cycles.
    pub fn set_bump_correction(&mut self, has_bump_correction: bool) {
        self.has_bump_correction = has_bump_correction;
    }

    /// Adds a Diffuse BSDF: Lambert's, or Oren and Nayar's where it is rough. Where bumps shadow
    /// each other it is none that others could lend light to.
    pub fn add_diffuse(&mut self, weight: Vec3A, color: Vec3A, normal: Vec3A, roughness: f32) {
        let color = color.max(Vec3A::ZERO);
        let albedo = weight * color;
        if !(albedo.max_element() > 0.0) {
            return;
        }
        let view = self.view(normal, None);
        let is_first = self.lambert == Vec3A::ZERO;
        let View {
            bump, is_turned, ..
        } = self.views[view as usize];
        let is_even = bump < BUMP_SEEN && !is_turned;
        if roughness <= 0.0 && is_even && (is_first || self.lambert_view == view) {
            self.lambert_view = view;
            self.lambert += albedo;
            return;
        }
        let model = OrenNayar::new(albedo, color, roughness.clamp(0.0, 1.0), self.cos_wo(view));
        self.add(view, Model::OrenNayar(model), [albedo, Vec3A::ZERO]);
    }

    /// Adds a Translucent BSDF; the weight includes its colour.
    pub fn add_translucent(&mut self, weight: Vec3A, normal: Vec3A) {
        let view = self.view(self.reflecting_normal(normal), None);
        let model = Model::Translucent(Translucent { weight });
        self.add(view, model, [Vec3A::ZERO, weight]);
    }

    /// Adds a Glossy BSDF. `anisotropy` is between -1 and 1; `tangent` has any length and is not
    /// asked for without anisotropy.
    pub fn add_glossy(
        &mut self,
        weight: Vec3A,
        color: Vec3A,
        normal: Vec3A,
        roughness: f32,
        (anisotropy, tangent): (f32, Vec3A),
        distribution: Distribution,
    ) {
        let color = color.clamp(Vec3A::ZERO, Vec3A::ONE);
        let normal = self.reflecting_normal(normal);
        let alpha = alpha_of(roughness);
        let anisotropy = anisotropy.clamp(-0.99, 0.99);
        let (tangent, [along, across]) = if anisotropy == 0.0 {
            (None, [alpha, alpha])
        } else {
            let (narrow, wide) = (1.0 - anisotropy.abs(), 1.0 / (1.0 - anisotropy.abs()));
            let [along, across] = if anisotropy < 0.0 {
                [wide, narrow]
            } else {
                [narrow, wide]
            };
            let limited = |factor: f32| (alpha * factor).clamp(ALPHA_MIN, 1.0);
            (Some(tangent), [limited(along), limited(across)])
        };
        let view = self.view(normal, tangent);
        let fresnel = Fresnel::new(Curve::Schlick, color, color);
        self.add_facets(view, weight, [along, across], fresnel, distribution);
    }

    /// Adds a Metallic BSDF.
    pub fn add_metallic(
        &mut self,
        weight: Vec3A,
        fresnel: Fresnel,
        brushed: &Brushed,
        distribution: Distribution,
    ) {
        let (view, alphas) = self.brushed(brushed);
        self.add_facets(view, weight, alphas, fresnel, distribution);
    }

    /// Adds microfacets that reflect, with these alphas along and across a grain.
    fn add_facets(
        &mut self,
        view: u8,
        weight: Vec3A,
        [along, across]: [f32; 2],
        fresnel: Fresnel,
        distribution: Distribution,
    ) {
        if distribution == Distribution::Beckmann {
            let (facets, cos) = (Beckmann::new(along, across), self.cos_wo(view));
            let (model, albedo) = Reflection::new(weight, facets, fresnel, false, cos);
            let model = Model::BeckmannReflection(model);
            self.add(view, model, [albedo, Vec3A::ZERO]);
            return;
        }
        let (ggx, is_multiscatter) = (
            Ggx::new(along, across),
            distribution == Distribution::MultiGgx,
        );
        self.add_reflection(view, weight, ggx, fresnel, is_multiscatter);
    }

    /// Adds a Refraction BSDF; the weight includes its colour.
    pub fn add_refraction(
        &mut self,
        weight: Vec3A,
        normal: Vec3A,
        roughness: f32,
        ior: f32,
        distribution: Distribution,
    ) {
        let glass = Glass {
            alpha: alpha_of(roughness),
            ior: self.relative_ior(ior),
            f0: None,
            film: ThinFilm::NONE,
            reflection_tint: Vec3A::ZERO,
            transmission_tint: Vec3A::ONE,
        };
        self.add_interface(weight, normal, &glass, distribution);
    }

    /// Adds a Glass BSDF, with what lies on it, seen from outside.
    pub fn add_glass(
        &mut self,
        weight: Vec3A,
        color: Vec3A,
        normal: Vec3A,
        roughness: f32,
        (ior, film): (f32, ThinFilm),
        distribution: Distribution,
    ) {
        let color = color.max(Vec3A::ZERO);
        let glass = Glass {
            alpha: alpha_of(roughness),
            ior: self.relative_ior(ior),
            f0: Some(Vec3A::splat(f0_from_ior(ior.max(1e-5)))),
            film: self.seen_film(film, ior),
            reflection_tint: color,
            transmission_tint: color,
        };
        self.add_interface(weight, normal, &glass, distribution);
    }

    /// Adds a Sheen BSDF (microfibre); the weight includes its colour. Returns its albedo.
    pub fn add_sheen(&mut self, weight: Vec3A, normal: Vec3A, roughness: f32) -> Vec3A {
        let view = self.view(normal, None);
        let wo = self.views[view as usize].wo;
        let (sheen, albedo) = Sheen::new(weight, roughness, wo);
        self.add(view, Model::Sheen(sheen), [albedo, Vec3A::ZERO]);
        albedo
    }

    /// Adds a Sheen BSDF by Ashikhmin; the weight includes its colour. Choosing takes that weight for
    /// its albedo, as in Cycles: what it reflects is between nothing and twice as much.
    pub fn add_velvet(&mut self, weight: Vec3A, normal: Vec3A, roughness: f32) {
        let view = self.view(normal, None);
        let velvet = Velvet::new(weight, roughness);
        self.add(view, Model::Velvet(velvet), [weight, Vec3A::ZERO]);
    }

    /// Adds a Toon BSDF; the weight includes its colour. `size` and `smooth` are shares of a right
    /// angle.
    pub fn add_toon(
        &mut self,
        weight: Vec3A,
        normal: Vec3A,
        size: f32,
        smooth: f32,
        is_glossy: bool,
    ) {
        let view = self.view(normal, None);
        let toon = Toon::new(weight, size, smooth, is_glossy);
        self.add(view, Model::Toon(toon), [weight, Vec3A::ZERO]);
    }

    /// Adds a Principled Hair BSDF along `tangent` (unit) where the viewer's ray meets a strand at
    /// `across`, from -1 to 1: see [`Bsdf::viewed_across`].
    pub fn add_hair(&mut self, weight: Vec3A, hair: &Hair, tangent: Vec3A, across: f32) {
        let view = self.view(self.viewed_across(tangent), Some(tangent));
        let wo = self.views[view as usize].wo;
        let (fibre, color) = Fibre::new(weight, hair, wo, across);
        self.add(view, Model::Fibre(fibre), [color, Vec3A::ZERO]);
    }

    /// Adds a Hair BSDF along `tangent` (unit); the weight includes its colour. `normal` is zero for
    /// strands, which are round; `widths` are Blender's roughness along the strand and around it;
    /// `offset` is in radians.
    pub fn add_streak(
        &mut self,
        weight: Vec3A,
        (tangent, normal): (Vec3A, Vec3A),
        widths: [f32; 2],
        offset: f32,
        passes: bool,
    ) {
        let view = self.view(self.viewed_across(tangent), Some(tangent));
        let normal = self.views[view as usize].frame.to_local(normal);
        let streak = Streak::new(weight, normal, widths, offset, passes);
        let albedos = match passes {
            true => [Vec3A::ZERO, weight],
            false => [weight, Vec3A::ZERO],
        };
        self.add(view, Model::Streak(streak), albedos);
    }

    /// The unit direction to the viewer, across `tangent` (unit): the normal that strands have.
    fn viewed_across(&self, tangent: Vec3A) -> Vec3A {
        let across = self.wo - self.wo.dot(tangent) * tangent;
        let across = across.try_normalize();
        across.unwrap_or_else(|| tangent.any_orthonormal_vector())
    }

    /// Adds a medium that scatters this share to all sides. Estimates may be negative.
    pub fn add_phase(&mut self, weight: Vec3A, anisotropy: f32) {
        let view = self.view(self.geometric_normal, None);
        let phase = Phase { weight, anisotropy };
        let halves = 0.5 * weight.abs();
        self.add(view, Model::Phase(phase), [halves, halves]);
    }

    /// Adds microfacets that reflect and returns their albedo.
    fn add_reflection(
        &mut self,
        view: u8,
        weight: Vec3A,
        ggx: Ggx,
        fresnel: Fresnel,
        is_multiscatter: bool,
    ) -> Vec3A {
        let cos = self.cos_wo(view);
        let (model, albedo) = Reflection::new(weight, ggx, fresnel, is_multiscatter, cos);
        self.add(view, Model::Reflection(model), [albedo, Vec3A::ZERO]);
        albedo
    }

    fn add_interface(
        &mut self,
        weight: Vec3A,
        normal: Vec3A,
        glass: &Glass,
        distribution: Distribution,
    ) {
        let view = self.view(self.reflecting_normal(normal), None);
        let cos = self.cos_wo(view);
        if distribution == Distribution::Beckmann {
            let facets = Beckmann::new(glass.alpha, glass.alpha);
            let (model, albedos) = Interface::new(weight, glass, facets, false, cos);
            self.add(view, Model::BeckmannInterface(model), albedos);
            return;
        }
        let (facets, is_multiscatter) = (
            Ggx::isotropic(glass.alpha),
            distribution == Distribution::MultiGgx,
        );
        let (model, albedos) = Interface::new(weight, glass, facets, is_multiscatter, cos);
        self.add(view, Model::Interface(model), albedos);
    }

    fn add(&mut self, view: u8, model: Model, [reflected, transmitted]: [Vec3A; 2]) {
        let lobe = Lobe {
            view,
            model,
            reflected,
            transmitted,
        };
        if !(lobe.albedo().max_element() > 0.0) {
            return;
        }
        if self.lobes.len() < MAX_LOBES {
            self.lobes.push(lobe);
        } else {
            let like = self.lobes.iter().rposition(|other| other.is_like(&lobe));
            match like {
                Some(index) => self.lobes[index].absorb(&lobe),
                None => self.lobes[MAX_LOBES - 1] = lobe,
            }
        }
    }

    /// The basis around a normal, with its x axis along a tangent where that matters.
    fn view(&mut self, normal: Vec3A, tangent: Option<Vec3A>) -> u8 {
        let fits = |view: &View| {
            view.frame.normal() == normal && tangent.is_none_or(|tangent| tangent == view.tangent)
        };
        if let Some(index) = self.views.iter().position(fits) {
            return index as u8;
        }
        if self.views.len() == MAX_VIEWS {
            return MAX_VIEWS as u8 - 1;
        }
        let frame = match tangent {
            Some(tangent) => Frame::from_normal_and_tangent(normal, tangent),
            None => Frame::from_normal(normal),
        };
        let cos_bump = self.smooth_normal.dot(normal);
        self.views.push(View {
            frame,
            tangent: tangent.unwrap_or(Vec3A::ZERO),
            wo: frame.to_local(self.wo),
            bump: match self.has_bump_correction {
                true => bump_of(cos_bump),
                false => 0.0,
            },
            is_turned: cos_bump < 0.0,
        });
        self.views.len() as u8 - 1
    }

    fn cos_wo(&self, view: u8) -> f32 {
        self.views[view as usize].lifted().z
    }

    /// The index of refraction beyond the surface over that on the viewer's side.
    fn relative_ior(&self, ior: f32) -> f32 {
        let ior = ior.max(1e-5);
        if self.is_front { ior } else { 1.0 / ior }
    }

    /// A film on glass of this index of refraction, from the viewer's side.
    fn seen_film(&self, film: ThinFilm, ior: f32) -> ThinFilm {
        match self.is_front {
            true => film,
            false => film.from_below(ior.max(1e-5)),
        }
    }

    /// The normal, bent so far that a mirror sends the viewer's direction back above the surface.
    pub fn reflecting_normal(&self, normal: Vec3A) -> Vec3A {
        match self.has_bump_correction {
            true => reflecting_normal(normal, self.wo, self.geometric_normal),
            false => normal,
        }
    }

    /// Widens every glossy closure to at least this GGX alpha. Its energy stays what it was.
    pub fn blur(&mut self, alpha: f32) {
        for lobe in &mut self.lobes {
            lobe.widen(alpha);
        }
    }

    /// Multiplies all that the surface scatters by a colour.
    pub fn tint(&mut self, color: Vec3A) {
        self.lambert *= color;
        for lobe in &mut self.lobes {
            lobe.tint(color);
        }
    }

    /// Leaves out what counts to `part`, but for the Lambert part.
    pub fn remove(&mut self, part: Part) {
        self.lobes.retain(|lobe| {
            lobe.remove(part);
            lobe.albedo() != Vec3A::ZERO
        });
    }
}

/// Scattering light.
impl Bsdf {
    /// Probability that [`Bsdf::sample`] chooses the Lambert part: 0 or 1 where the other is black.
    pub fn probability_lambert(&self) -> f32 {
        if self.lobes.is_empty() {
            return 1.0;
        }
        let lambert = luminance(self.lambert);
        let own: f32 = self.lobes.iter().map(|l| luminance(l.albedo())).sum();
        if lambert + own > 0.0 {
            lambert / (lambert + own)
        } else {
            1.0
        }
    }

    /// Whether the surface scatters nothing.
    pub fn is_black(&self) -> bool {
        self.lambert == Vec3A::ZERO && self.lobes.is_empty()
    }

    /// Whether light from behind the surface may reach the viewer.
    pub fn is_lit_from_behind(&self) -> bool {
        self.is_transmissive() || self.views.iter().any(|view| view.is_turned)
    }

    /// Whether light may come through the surface.
    pub fn is_transmissive(&self) -> bool {
        self.lobes.iter().any(Lobe::is_transmissive)
    }

    /// Whether light comes through closures of at most this GGX alpha and through no others.
    pub fn is_clear(&self, alpha: f32) -> bool {
        let mut passing = self.lobes.iter().filter(|lobe| lobe.is_transmissive());
        self.is_transmissive() && passing.all(|lobe| lobe.alpha() <= alpha)
    }

    /// Values and densities towards `wi`, above or below the smooth form of the surface: light just below
    /// its flat faces still reaches it, as in Cycles.
    pub fn eval(&self, wi: Vec3A) -> (LobeValues, LobePdfs) {
        self.eval_from(wi, None)
    }

    /// The same for a direction that was drawn; see [`Bsdf::factor`].
    pub fn eval_drawn(&self, drawn: &Drawn) -> (LobeValues, LobePdfs) {
        self.eval_from(drawn.direction, Some(drawn.origin))
    }

    fn eval_from(&self, wi: Vec3A, origin: Option<Origin>) -> (LobeValues, LobePdfs) {
        let is_above = wi.dot(self.smooth_normal) > 0.0;
        let (mut values, mut pdfs) = (LobeValues::default(), LobePdfs::default());
        let may_find = is_above || origin == Some(Origin::Lambert);
        if may_find && self.lambert != Vec3A::ZERO {
            pdfs.lambert = pdf_cosine_hemisphere(wi.dot(self.lambert_normal()));
            if is_above {
                values.lambert = self.lambert * pdfs.lambert;
            }
        }
        if !self.lobes.is_empty() {
            pdfs.own = self.eval_own(wi, is_above, origin, &mut values);
        }
        (values, pdfs)
    }

    /// Adds the closures' values and returns the density of their sampler.
    fn eval_own(
        &self,
        wi: Vec3A,
        is_above: bool,
        origin: Option<Origin>,
        values: &mut LobeValues,
    ) -> f32 {
        let (mut pdf, mut total) = (0.0, 0.0);
        let (mut view, mut wi_local) = (u8::MAX, Vec3A::ZERO);
        for (index, lobe) in self.lobes.iter().enumerate() {
            if lobe.view != view {
                view = lobe.view;
                wi_local = self.views[view as usize].frame.to_local(wi);
            }
            let weight = luminance(lobe.albedo());
            total += weight;
            let seen = &self.views[view as usize];
            let wo = seen.wo_for(lobe);
            let Some(scattered) = wo.and_then(|wo| lobe.eval(wo, wi_local)) else {
                continue;
            };
            let is_drawn = origin == Some(Origin::Lobe(index as u8));
            let is_outside = is_above != seen.is_turned;
            let may_leave = lobe.may_leave(scattered.part, is_outside);
            if may_leave || is_drawn {
                let factor = self.factor(lobe, &scattered, wi, (may_leave, is_drawn));
                values.add_scattered(&scattered, lobe.is_wide(), factor);
                pdf += weight * scattered.pdf_solid_angle;
            }
        }
        if total > 0.0 { pdf / total } else { 0.0 }
    }

    /// Share of what a closure scatters that bumps leave. As in Cycles its own samples are kept where their
    /// direction leaves the flat surface, even if it does not leave the smooth one, but for those that a
    /// diffuse closure reflects; and bumps take nothing from samples that come through.
    fn factor(
        &self,
        lobe: &Lobe,
        scattered: &Scattered,
        wi: Vec3A,
        (may_leave, is_drawn): (bool, bool),
    ) -> f32 {
        let comes_through = is_drawn && scattered.part == Part::Transmission;
        if !lobe.is_wide() || comes_through {
            return 1.0;
        }
        match may_leave {
            true => self.bump_shadow(lobe.view, wi),
            false => 0.0,
        }
    }

    /// Share of the light from `wi` that bumps do not keep from a wide lobe: without it they end
    /// in a hard edge where the smooth surface turns away from the light.
    ///
    /// Source: Conty, Lecocq and Stein, "A Microfacet-Based Shadowing Function to Solve the Bump
    /// Terminator Problem", Ray Tracing Gems, 2019; Cycles does so.
    fn bump_shadow(&self, view: u8, wi: Vec3A) -> f32 {
        let cos = wi.dot(self.smooth_normal);
        let tan_squared = 1.0 / (cos * cos) - 1.0;
        2.0 / (1.0 + (1.0 + self.views[view as usize].bump * tan_squared.max(0.0)).sqrt())
    }

    /// The density with which [`Bsdf::sample`] draws a direction that has these densities.
    pub fn pdf(&self, pdfs: LobePdfs) -> f32 {
        let lambert = self.probability_lambert();
        lambert * pdfs.lambert + (1.0 - lambert) * pdfs.own
    }

    /// The densities that light samples meet where one sample of the mixture serves every part.
    pub fn mixed(&self, pdfs: LobePdfs) -> LobePdfs {
        let pdf = self.pdf(pdfs);
        LobePdfs {
            lambert: pdf,
            own: pdf,
        }
    }

    /// A direction of the Lambert part; none below the geometric surface.
    pub fn sample_lambert(&self, u: [f32; 2]) -> Option<Vec3A> {
        let frame = &self.views.get(self.lambert_view as usize)?.frame;
        let direction = frame.to_world(sample_cosine_hemisphere(u));
        (direction.dot(self.geometric_normal) > 0.0).then_some(direction)
    }

    /// A direction of the other closures; none on the wrong side of the surface.
    pub fn sample_own(&self, u_lobe: f32, u: [f32; 2]) -> Option<Drawn> {
        let weight = |lobe: &Lobe| luminance(lobe.albedo());
        let total: f32 = self.lobes.iter().map(weight).sum();
        let mut rest = u_lobe * total;
        let mut chosen = None;
        for (index, lobe) in self.lobes.iter().enumerate() {
            let weight = weight(lobe);
            if weight > 0.0 {
                // Rounding may leave a rest behind the last lobe.
                chosen = Some((index, rest / weight));
                if rest < weight {
                    break;
                }
            }
            rest -= weight;
        }
        let (index, u_choice) = chosen?;
        let lobe = &self.lobes[index];
        let view = &self.views[lobe.view as usize];
        let local = lobe.sample(view.lifted(), u_choice, u)?;
        let direction = view.frame.to_world(local);
        let is_above = direction.dot(self.geometric_normal) > 0.0;
        let part = lobe.part_of(local, u_choice)?;
        lobe.may_leave(part, is_above).then_some(Drawn {
            direction,
            part,
            alpha: lobe.alpha(),
            origin: Origin::Lobe(index as u8),
        })
    }

    /// A direction of the whole surface, chosen with [`Bsdf::probability_lambert`].
    pub fn sample(&self, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let probability = self.probability_lambert();
        let drawn = if u_lobe < probability {
            Drawn {
                direction: self.sample_lambert(u)?,
                part: Part::Diffuse,
                alpha: 1.0,
                origin: Origin::Lambert,
            }
        } else {
            self.sample_own((u_lobe - probability) / (1.0 - probability), u)?
        };
        let (value, pdfs) = self.eval_drawn(&drawn);
        // A black surface has no density: dividing by it would spoil the light it emits itself.
        (self.pdf(pdfs) > 0.0).then_some(BsdfSample {
            direction: drawn.direction,
            part: drawn.part,
            alpha: drawn.alpha,
            value,
            pdfs,
        })
    }

    /// The shading normal of the Lambert part; that of the geometric surface without one.
    pub fn lambert_normal(&self) -> Vec3A {
        if self.views.is_empty() {
            return self.geometric_normal;
        }
        self.views[self.lambert_view as usize].frame.normal()
    }

    /// Share of white light that the Lambert part reflects.
    pub fn albedo_lambert(&self) -> Vec3A {
        self.lambert
    }

    /// The brightest closure without grain that reflects about the normal of the Lambert part with at
    /// least this GGX alpha.
    pub fn gloss(&self, least_alpha: f32) -> Option<Gloss> {
        let gloss = |(index, lobe): (usize, &Lobe)| {
            let Model::Reflection(Reflection {
                facets: ggx,
                fresnel,
            }) = lobe.model
            else {
                return None;
            };
            let is_wide = ggx.is_isotropic() && ggx.alpha() >= least_alpha;
            let (ior, f0, f90) = fresnel.parts()?;
            (is_wide && lobe.view == self.lambert_view).then_some(Gloss {
                alpha: ggx.alpha(),
                ior,
                f0,
                f90,
                index,
            })
        };
        let brightness = |gloss: &Gloss| luminance(self.lobes[gloss.index].albedo());
        let all = self.lobes.iter().enumerate().filter_map(gloss);
        all.max_by(|a, b| brightness(a).total_cmp(&brightness(b)))
    }

    /// `f cos` [1/sr] of such a closure towards `wi`.
    pub fn eval_gloss(&self, gloss: &Gloss, wi: Vec3A) -> Vec3A {
        let lobe = &self.lobes[gloss.index];
        let view = &self.views[lobe.view as usize];
        let is_above = wi.dot(self.geometric_normal) > 0.0;
        let scattered = lobe.eval(view.lifted(), view.frame.to_local(wi));
        match scattered {
            Some(scattered) if is_above => scattered.value,
            _ => Vec3A::ZERO,
        }
    }

    /// Share of white light that a part scatters towards the viewer; Lambert counts as diffuse.
    pub fn albedo_of(&self, part: Part) -> Vec3A {
        let own: Vec3A = self.lobes.iter().map(|l| l.albedo_of(part)).sum();
        if part == Part::Diffuse {
            own + self.lambert
        } else {
            own
        }
    }

    /// Share of white light scattered towards the viewer, as passes divide it: see
    /// [`LobeValues::by_pass`].
    pub fn colors(&self) -> [Vec3A; 3] {
        let mut colors = [self.lambert, Vec3A::ZERO, Vec3A::ZERO];
        for lobe in &self.lobes {
            if lobe.is_wide() {
                colors[0] += lobe.albedo();
            } else {
                colors[1] += lobe.reflected;
                colors[2] += lobe.transmitted;
            }
        }
        colors
    }

    /// What denoisers are told: closures of at most `clear_alpha` show other things. `below` are
    /// albedos and normals of what comes from below the surface.
    pub fn guides(&self, clear_alpha: f32, below: impl Iterator<Item = (Vec3A, Vec3A)>) -> Guides {
        let lambert = (self.lambert, self.lambert_normal(), 1.0);
        let below = below.map(|(albedo, normal)| (albedo, normal, 1.0));
        let normal = |lobe: &Lobe| self.views[lobe.view as usize].frame.normal();
        let lobes = self.lobes.iter();
        let own = lobes.map(|lobe| (lobe.albedo(), normal(lobe), lobe.alpha()));
        let mut guides = Guides::default();
        for (albedo, normal, alpha) in own.chain([lambert]).chain(below) {
            guides.normal += albedo.element_sum() * normal;
            let sum = if alpha > clear_alpha {
                &mut guides.wide
            } else {
                &mut guides.clear
            };
            *sum += albedo;
        }
        let [wide, clear] = [guides.wide, guides.clear].map(Vec3A::element_sum);
        let total = wide + clear;
        if total > 0.0 {
            guides.normal /= total;
        }
        guides.wide_share = if total > 0.0 { wide / total } else { 1.0 };
        guides
    }

    /// Share of white light scattered towards the viewer.
    pub fn albedo(&self) -> Vec3A {
        self.lambert + self.lobes.iter().map(Lobe::albedo).sum::<Vec3A>()
    }
}

/// From this squared alpha on bumps shadow each other so that it is seen: a normal 16 degrees off.
/// Below it they would take less than half a per cent of the light.
const BUMP_SEEN: f32 = 0.01;

/// Squared alpha of the bumps that bend a normal by the angle of this cosine.
fn bump_of(cos: f32) -> f32 {
    let tan_squared = 1.0 / (cos * cos) - 1.0;
    let bump = (0.125 * tan_squared).min(1.0);
    // Rounding, and what cannot be seen.
    if bump > 1e-5 { bump } else { 0.0 }
}

/// GGX alpha of Blender's roughness.
pub fn alpha_of(roughness: f32) -> f32 {
    let roughness = roughness.clamp(0.0, 1.0);
    (roughness * roughness).max(ALPHA_MIN)
}

/// A vector turned about a normal by `turns` circles.
fn rotated_about(normal: Vec3A, vector: Vec3A, turns: f32) -> Vec3A {
    if turns == 0.0 {
        return vector;
    }
    Quat::from_axis_angle(normal.into(), turns * std::f32::consts::TAU) * vector
}

#[cfg(test)]
mod tests;
