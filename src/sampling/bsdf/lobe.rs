//! One closure of a surface, seen from a fixed direction.

use glam::Vec3A;

use super::diffuse::{OrenNayar, Sheen, Translucent};
use super::fibre::Fibre;
use super::microfacet::{Interface, Reflection};
use super::phase::Phase;
use super::streak::Streak;
use super::toon::Toon;
use super::velvet::Velvet;
use super::{Part, Scattered};
use crate::math::Beckmann;
use crate::math::warp::sample_cosine_hemisphere;

/// How a closure scatters.
#[derive(Debug, Clone, Copy)]
pub enum Model {
    Reflection(Reflection),
    Interface(Interface),
    BeckmannReflection(Reflection<Beckmann>),
    BeckmannInterface(Interface<Beckmann>),
    OrenNayar(OrenNayar),
    Sheen(Sheen),
    Velvet(Velvet),
    Translucent(Translucent),
    Phase(Phase),
    Toon(Toon),
    Fibre(Fibre),
    Streak(Streak),
}

/// A closure, and what chooses it.
#[derive(Debug, Clone, Copy)]
pub struct Lobe {
    /// The surface's basis that its directions are in.
    pub view: u8,
    pub model: Model,
    /// Share of white light that it reflects towards the viewer.
    pub reflected: Vec3A,
    /// Share of white light that it lets through towards the viewer.
    pub transmitted: Vec3A,
}

impl Lobe {
    /// Share of white light scattered towards the viewer.
    pub fn albedo(&self) -> Vec3A {
        self.reflected + self.transmitted
    }

    /// The same of what counts to `part`.
    pub fn albedo_of(&self, part: Part) -> Vec3A {
        match (part, self.is_diffuse()) {
            (Part::Transmission, _) => self.transmitted,
            (Part::Diffuse, true) | (Part::Glossy, false) => self.reflected,
            _ => Vec3A::ZERO,
        }
    }

    fn is_diffuse(&self) -> bool {
        match &self.model {
            Model::OrenNayar(_) | Model::Sheen(_) | Model::Velvet(_) => true,
            Model::Toon(toon) => !toon.is_glossy(),
            _ => false,
        }
    }

    /// Whether it consists of microfacets.
    pub fn is_of_facets(&self) -> bool {
        matches!(
            self.model,
            Model::Reflection(_)
                | Model::Interface(_)
                | Model::BeckmannReflection(_)
                | Model::BeckmannInterface(_)
        )
    }

    /// Whether it has no mirror direction.
    pub fn is_wide(&self) -> bool {
        self.is_diffuse() || matches!(self.model, Model::Translucent(_) | Model::Phase(_))
    }

    /// Whether light may come through. The share of it that the viewer sees does not tell: it is
    /// that of a mirror, which may be none where rough facets let some pass.
    pub fn is_transmissive(&self) -> bool {
        match &self.model {
            Model::Interface(interface) => interface.is_transmissive(),
            Model::BeckmannInterface(interface) => interface.is_transmissive(),
            Model::Fibre(_) => true,
            _ => self.transmitted != Vec3A::ZERO,
        }
    }

    /// Whether another closure scatters in the same way.
    pub fn is_like(&self, other: &Lobe) -> bool {
        std::mem::discriminant(&self.model) == std::mem::discriminant(&other.model)
            && self.is_diffuse() == other.is_diffuse()
    }

    /// Takes up the energy of a closure that scatters in the same way, but keeps its own shape.
    pub fn absorb(&mut self, other: &Lobe) {
        self.reflected += other.reflected;
        self.transmitted += other.transmitted;
        match (&mut self.model, &other.model) {
            (Model::Reflection(own), Model::Reflection(other)) => own.fresnel.add(&other.fresnel),
            (Model::Interface(own), Model::Interface(other)) => own.add(other),
            (Model::BeckmannReflection(own), Model::BeckmannReflection(other)) => {
                own.fresnel.add(&other.fresnel);
            }
            (Model::BeckmannInterface(own), Model::BeckmannInterface(other)) => own.add(other),
            (Model::OrenNayar(own), Model::OrenNayar(other)) => own.weight += other.weight,
            (Model::Sheen(own), Model::Sheen(other)) => own.weight += other.weight,
            (Model::Velvet(own), Model::Velvet(other)) => own.weight += other.weight,
            (Model::Translucent(own), Model::Translucent(other)) => own.weight += other.weight,
            (Model::Phase(own), Model::Phase(other)) => own.weight += other.weight,
            (Model::Toon(own), Model::Toon(other)) => own.weight += other.weight,
            (Model::Fibre(own), Model::Fibre(other)) => own.absorb(other),
            (Model::Streak(own), Model::Streak(other)) => own.weight += other.weight,
            _ => {}
        }
    }

    /// Multiplies all that it scatters by a colour.
    pub fn tint(&mut self, color: Vec3A) {
        self.reflected *= color;
        self.transmitted *= color;
        match &mut self.model {
            Model::Reflection(r) => r.fresnel = r.fresnel.scaled(color),
            Model::Interface(i) => i.tint(color),
            Model::BeckmannReflection(r) => r.fresnel = r.fresnel.scaled(color),
            Model::BeckmannInterface(i) => i.tint(color),
            Model::OrenNayar(d) => d.weight *= color,
            Model::Sheen(s) => s.weight *= color,
            Model::Velvet(v) => v.weight *= color,
            Model::Translucent(t) => t.weight *= color,
            Model::Phase(p) => p.weight *= color,
            Model::Toon(t) => t.weight *= color,
            Model::Fibre(f) => f.tint(color),
            Model::Streak(s) => s.weight *= color,
        }
    }

    /// Leaves out what counts to `part`. A lobe that is black after it must not be used. Hair stays
    /// as it is, as in Cycles.
    pub fn remove(&mut self, part: Part) {
        if self.is_strand() {
            return;
        }
        match (part, self.is_diffuse()) {
            (Part::Transmission, _) => self.transmitted = Vec3A::ZERO,
            (Part::Diffuse, true) | (Part::Glossy, false) => self.reflected = Vec3A::ZERO,
            _ => return,
        }
        match &mut self.model {
            Model::Interface(interface) => interface.remove(part),
            Model::BeckmannInterface(interface) => interface.remove(part),
            _ => {}
        }
    }

    /// Alpha of its microfacets; one without any.
    pub fn alpha(&self) -> f32 {
        match &self.model {
            Model::Reflection(r) => r.facets.alpha(),
            Model::Interface(i) => i.facets.alpha(),
            Model::BeckmannReflection(r) => r.facets.alpha(),
            Model::BeckmannInterface(i) => i.facets.alpha(),
            _ => 1.0,
        }
    }

    /// Widens its microfacets, if it has any, to at least this alpha.
    pub fn widen(&mut self, alpha: f32) {
        match &mut self.model {
            Model::Reflection(r) => r.facets = r.facets.at_least(alpha),
            Model::Interface(i) => i.facets = i.facets.at_least(alpha),
            Model::BeckmannReflection(r) => r.facets = r.facets.at_least(alpha),
            Model::BeckmannInterface(i) => i.facets = i.facets.at_least(alpha),
            Model::Fibre(f) => f.widen(alpha),
            _ => {}
        }
    }

    /// Whether it is of a strand, which is round whatever its triangles say.
    fn is_strand(&self) -> bool {
        matches!(self.model, Model::Fibre(_) | Model::Streak(_))
    }

    /// Whether light that counts to `part` may leave to the viewer's side of the geometric surface,
    /// or else to the other.
    pub fn may_leave(&self, part: Part, is_above: bool) -> bool {
        self.is_strand() || part.may_leave(is_above)
    }

    /// `f cos` [1/sr] and the density of [`Lobe::sample`] [1/sr], in the basis of its normal; `wo`
    /// is above z = 0. Nothing where it is black.
    pub fn eval(&self, wo: Vec3A, wi: Vec3A) -> Option<Scattered> {
        match &self.model {
            Model::Reflection(r) => r.eval(wo, wi),
            Model::Interface(i) => i.eval(wo, wi),
            Model::BeckmannReflection(r) => r.eval(wo, wi),
            Model::BeckmannInterface(i) => i.eval(wo, wi),
            Model::OrenNayar(d) => d.eval(wo, wi),
            Model::Sheen(s) => s.eval(wi),
            Model::Velvet(v) => v.eval(wo, wi),
            Model::Translucent(t) => t.eval(wi),
            Model::Phase(p) => Some(p.eval(wo, wi)),
            Model::Toon(t) => t.eval(wo, wi),
            Model::Fibre(f) => Some(f.eval(wo, wi)),
            Model::Streak(s) => s.eval(wo, wi),
        }
    }

    /// The part that a direction counts to which `u_choice` drew; none where the closure scatters
    /// nothing there.
    pub fn part_of(&self, wi: Vec3A, u_choice: f32) -> Option<Part> {
        let is_above = wi.z > 0.0;
        match (&self.model, is_above) {
            (Model::Phase(_), _) => Some(Part::Volume),
            (Model::Streak(s), _) => Some(s.part()),
            (Model::Fibre(f), _) if f.passes(u_choice) => Some(Part::Transmission),
            (Model::Fibre(_), _) => Some(Part::Glossy),
            (_, true) if self.is_diffuse() => Some(Part::Diffuse),
            (Model::Translucent(_), true) => None,
            (_, true) => Some(Part::Glossy),
            (Model::Translucent(_) | Model::Interface(_) | Model::BeckmannInterface(_), false) => {
                Some(Part::Transmission)
            }
            _ => None,
        }
    }

    /// A direction in the basis of its normal.
    pub fn sample(&self, wo: Vec3A, u_choice: f32, u: [f32; 2]) -> Option<Vec3A> {
        match &self.model {
            Model::Reflection(r) => Some(r.sample(wo, u)),
            Model::Interface(i) => i.sample(wo, u_choice, u),
            Model::BeckmannReflection(r) => Some(r.sample(wo, u)),
            Model::BeckmannInterface(i) => i.sample(wo, u_choice, u),
            Model::OrenNayar(_) => Some(sample_cosine_hemisphere(u)),
            Model::Sheen(s) => Some(s.sample(u)),
            Model::Velvet(_) => Some(Velvet::sample(u)),
            Model::Translucent(_) => Some(Translucent::sample(u)),
            Model::Phase(p) => Some(p.sample(wo, u)),
            Model::Toon(t) => Some(t.sample(wo, u)),
            Model::Fibre(f) => Some(f.sample(wo, u_choice, u)),
            Model::Streak(s) => s.sample(wo, u),
        }
    }
}
