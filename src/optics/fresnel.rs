//! Fresnel reflectance as a curve from F0 at normal incidence to F90 at grazing.

use glam::Vec3A;

use super::energy;
use super::thin_film::{Ground, ThinFilm, Waves};

/// Reflectance at normal incidence of a dielectric with this index of refraction.
pub fn f0_from_ior(ior: f32) -> f32 {
    let ratio = (ior - 1.0) / (ior + 1.0);
    ratio * ratio
}

/// Index of refraction, at least one, that reflects this share at normal incidence.
pub fn ior_from_f0(f0: f32) -> f32 {
    let root = f0.clamp(0.0, 0.99).sqrt();
    (1.0 + root) / (1.0 - root)
}

/// Unpolarised reflectance of a dielectric for a cosine of incidence in [0, 1].
pub fn dielectric(cos: f32, ior: f32) -> f32 {
    amplitudes(cos, ior).map_or(1.0, |(_, [s, p])| 0.5 * (s * s + p * p))
}

/// Cosine of the refracted ray, and the amplitudes that a dielectric reflects of waves across the plane of
/// incidence and in it, for a cosine of incidence in [0, 1]; none where all is reflected.
pub fn amplitudes(cos: f32, ior: f32) -> Option<(f32, [f32; 2])> {
    let cos_transmitted_squared = 1.0 - (1.0 - cos * cos) / (ior * ior);
    if cos_transmitted_squared <= 0.0 {
        return None;
    }
    let cos_transmitted = cos_transmitted_squared.sqrt();
    let s = (cos - ior * cos_transmitted) / (cos + ior * cos_transmitted);
    let p = (ior * cos - cos_transmitted) / (ior * cos + cos_transmitted);
    Some((cos_transmitted, [s, p]))
}

/// How reflectance goes from F0 to F90: `F = F0 + s (F90 - F0)` with a curve s of the cosine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Curve {
    /// Schlick's fifth power: metals.
    Schlick,
    /// A dielectric's exact reflectance, rescaled to begin at 0. Principled's F0 is a free
    /// parameter, so that its level can be changed without changing the shape.
    Dielectric {
        /// Index of refraction.
        ior: f32,
    },
}

impl Curve {
    /// s at a cosine between direction and microfacet.
    pub fn at(self, cos: f32) -> f32 {
        match self {
            Curve::Schlick => {
                let rest = (1.0 - cos).clamp(0.0, 1.0);
                rest * (rest * rest) * (rest * rest)
            }
            Curve::Dielectric { ior } => {
                let f0 = f0_from_ior(ior);
                ((dielectric(cos, ior) - f0) / (1.0 - f0)).clamp(0.0, 1.0)
            }
        }
    }

    /// The mean of s over the hemisphere, weighted by the cosine.
    ///
    /// Schlick's is 1/21. The dielectric's is a fit by Kulla and Conty, "Revisiting Physically
    /// Based Shading at Imageworks", 2017; it is off by up to 0.007, which only light of several
    /// bounces sees.
    pub fn mean(self) -> f32 {
        match self {
            Curve::Schlick => 1.0 / 21.0,
            Curve::Dielectric { ior } => {
                let mean = if ior < 1.0 {
                    0.997_118 + ior * (0.1014 - ior * (0.965_241 + ior * 0.130_607))
                } else {
                    (ior - 1.0) / (4.085_67 + 1.000_71 * ior)
                };
                let f0 = f0_from_ior(ior);
                ((mean - f0) / (1.0 - f0)).clamp(0.0, 1.0)
            }
        }
    }
}

/// The reflectance of a microfacet as a function of its cosine.
#[derive(Debug, Clone, Copy)]
pub enum Fresnel {
    /// By a curve.
    Curved(Curved),
    /// By adding up waves.
    Waves(Waves),
}

impl Fresnel {
    /// Reflectance that follows `curve` from `f0` to `f90`.
    pub fn new(curve: Curve, f0: Vec3A, f90: Vec3A) -> Self {
        Self::Curved(Curved::new(curve, f0, f90))
    }

    /// A metal whose Schlick reflectance is multiplied by `edge_tint` at about 82 degrees, below a film.
    ///
    /// Source: Kutz, Hasan and Edmondson, "Novel aspects of the Adobe Standard Material", 2023
    /// (F82-tint); Blender's Principled BSDF takes Specular Tint for it.
    pub fn metal(f0: Vec3A, edge_tint: Vec3A, film: ThinFilm) -> Self {
        let edge = edge_tint * Curved::new(Curve::Schlick, f0, Vec3A::ONE).at(EDGE_COS);
        match film.is_none() {
            true => Self::Curved(Curved::metal(f0, edge)),
            false => Self::Waves(Waves::new(film, Ground::metal(f0, edge))),
        }
    }

    /// A conductor of this complex index of refraction, `index + i extinction`, below a film.
    pub fn conductor(index: Vec3A, extinction: Vec3A, film: ThinFilm) -> Self {
        Self::Waves(Waves::new(film, Ground::conductor(index, extinction)))
    }

    /// A dielectric whose reflectance at normal incidence is changed to `f0`, below a film.
    pub fn dielectric(ior: f32, f0: Vec3A, film: ThinFilm) -> Self {
        match film.is_none() {
            true => Self::new(Curve::Dielectric { ior }, f0, Vec3A::ONE),
            false => Self::Waves(Waves::new(film, Ground::dielectric(ior, f0))),
        }
    }

    /// Reflectance under a cosine in [0, 1].
    #[inline]
    pub fn at(&self, cos: f32) -> Vec3A {
        match self {
            Self::Curved(curved) => curved.at(cos),
            Self::Waves(waves) => waves.at(cos),
        }
    }

    /// The mean over the hemisphere, weighted by the cosine. A film does not count in it.
    pub fn mean(&self) -> Vec3A {
        match self {
            Self::Curved(curved) => curved.mean(),
            Self::Waves(waves) => waves.bare_mean(),
        }
    }

    /// The mean over the microfacets of this roughness seen under a cosine; that of waves is taken as
    /// that of a mirror.
    pub fn seen_under(&self, roughness: f32, cos: f32) -> Vec3A {
        match self {
            Self::Curved(curved) => curved.seen_under(roughness, cos),
            Self::Waves(waves) => waves.at(cos),
        }
    }

    /// Takes up another reflectance, but keeps what it is of.
    pub fn add(&mut self, other: &Fresnel) {
        match (self, other) {
            (Self::Curved(own), Self::Curved(other)) => own.add(other),
            (Self::Waves(own), Self::Waves(other)) => own.add(other.factor()),
            (Self::Curved(own), Self::Waves(other)) => own.f90 += other.factor(),
            (Self::Waves(own), Self::Curved(other)) => own.add(other.f90),
        }
    }

    /// Index of refraction, 0 for Schlick's curve, with the reflectances at normal and at grazing
    /// incidence; none for a metal whose edge is tinted, and none by waves.
    pub fn parts(&self) -> Option<(f32, Vec3A, Vec3A)> {
        match self {
            Self::Curved(curved) => curved.parts(),
            Self::Waves(_) => None,
        }
    }

    /// The same, multiplied by a colour.
    pub fn scaled(&self, factor: Vec3A) -> Self {
        match self {
            Self::Curved(curved) => Self::Curved(curved.scaled(factor)),
            Self::Waves(waves) => Self::Waves(waves.scaled(factor)),
        }
    }
}

/// Reflectance by a curve.
#[derive(Debug, Clone, Copy)]
pub struct Curved {
    curve: Curve,
    f0: Vec3A,
    f90: Vec3A,
    /// What is taken away around 82 degrees: the factor of `cos (1 - cos)^6`.
    dip: Vec3A,
}

/// Cosine of the angle, about 82 degrees, at which a metal's edge tint acts.
pub const EDGE_COS: f32 = 1.0 / 7.0;

impl Curved {
    /// Reflectance that follows `curve` from `f0` to `f90`.
    pub fn new(curve: Curve, f0: Vec3A, f90: Vec3A) -> Self {
        Self {
            curve,
            f0,
            f90,
            dip: Vec3A::ZERO,
        }
    }

    /// A metal that reflects `f0` at normal incidence and `edge` at about 82 degrees.
    pub fn metal(f0: Vec3A, edge: Vec3A) -> Self {
        let schlick = Self::new(Curve::Schlick, f0, Vec3A::ONE);
        let shape = EDGE_COS * Curve::Schlick.at(EDGE_COS) * (1.0 - EDGE_COS);
        Self {
            dip: (schlick.at(EDGE_COS) - edge) / shape,
            ..schlick
        }
    }

    /// Reflectance under a cosine in [0, 1].
    #[inline]
    pub fn at(&self, cos: f32) -> Vec3A {
        let s = self.curve.at(cos);
        let reflectance = mix(self.f0, self.f90, s);
        match self.curve {
            Curve::Schlick => (reflectance - self.dip * (cos * s * (1.0 - cos))).max(Vec3A::ZERO),
            Curve::Dielectric { .. } => reflectance,
        }
    }

    /// The mean over the hemisphere, weighted by the cosine. That of `cos (1 - cos)^6` is 1/126.
    pub fn mean(&self) -> Vec3A {
        mix(self.f0, self.f90, self.curve.mean()) - self.dip / 126.0
    }

    /// The mean over the microfacets of this roughness seen under a cosine; the dip is taken as that
    /// of a mirror.
    fn seen_under(&self, roughness: f32, cos: f32) -> Vec3A {
        let mean = energy::mean_curve(self.curve, roughness, cos);
        let dip = cos * (1.0 - cos).powi(6);
        (mix(self.f0, self.f90, mean) - self.dip * dip).max(Vec3A::ZERO)
    }

    fn add(&mut self, other: &Self) {
        self.f0 += other.f0;
        self.f90 += other.f90;
        self.dip += other.dip;
    }

    fn parts(&self) -> Option<(f32, Vec3A, Vec3A)> {
        let ior = match self.curve {
            Curve::Schlick => 0.0,
            Curve::Dielectric { ior } => ior,
        };
        (self.dip == Vec3A::ZERO).then_some((ior, self.f0, self.f90))
    }

    fn scaled(&self, factor: Vec3A) -> Self {
        Self {
            curve: self.curve,
            f0: self.f0 * factor,
            f90: self.f90 * factor,
            dip: self.dip * factor,
        }
    }
}

/// `a + s (b - a)`.
fn mix(a: Vec3A, b: Vec3A, s: f32) -> Vec3A {
    a + (b - a) * s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every hit on a glossy surface moves some of them.
    #[test]
    fn waves_take_no_more_room_than_curves() {
        assert_eq!(size_of::<Fresnel>(), size_of::<Curved>());
    }

    #[test]
    fn f0_and_ior_are_inverse() {
        assert!((f0_from_ior(1.5) - 0.04).abs() < 1e-6);
        for ior in [1.0, 1.33, 1.5, 2.4] {
            assert!((ior_from_f0(f0_from_ior(ior)) - ior).abs() < 1e-4);
        }
    }

    #[test]
    fn dielectric_vanishes_at_brewster_only_for_one_polarisation() {
        // tan(Brewster) = ior; there half of the s-polarised reflectance is left.
        let ior = 1.5f32;
        let cos = 1.0 / (1.0 + ior * ior).sqrt();
        let s = (ior * ior - 1.0) / (ior * ior + 1.0);
        assert!((dielectric(cos, ior) - 0.5 * s * s).abs() < 1e-6);
        assert!((dielectric(0.0, ior) - 1.0).abs() < 1e-6);
        assert_eq!(dielectric(0.3, 1.0 / ior), 1.0); // total internal reflection
    }

    #[test]
    fn means_are_the_integrals_of_the_curves() {
        let curves = [1.2, 1.5, 2.0, 0.7].map(|ior| Curve::Dielectric { ior });
        for curve in curves.into_iter().chain([Curve::Schlick]) {
            let steps = 4000;
            let integral: f32 = (0..steps)
                .map(|i| (i as f32 + 0.5) / steps as f32)
                .map(|cos| 2.0 * cos * curve.at(cos) / steps as f32)
                .sum();
            assert!(
                (integral - curve.mean()).abs() < 8e-3,
                "{curve:?}: {integral}"
            );
        }
    }

    #[test]
    fn edge_tint_acts_at_82_degrees_and_its_mean_is_the_integral() {
        let (f0, tint) = (Vec3A::new(0.9, 0.5, 0.1), Vec3A::new(1.0, 0.5, 0.7));
        let [metal, plain] =
            [tint, Vec3A::ONE].map(|tint| Fresnel::metal(f0, tint, ThinFilm::NONE));
        assert!((metal.at(EDGE_COS) - tint * plain.at(EDGE_COS)).length() < 1e-5);
        assert_eq!(metal.at(1.0), f0);
        let steps = 4000;
        let integral: Vec3A = (0..steps)
            .map(|i| (i as f32 + 0.5) / steps as f32)
            .map(|cos| metal.at(cos) * (2.0 * cos / steps as f32))
            .sum();
        // Where the dip is deeper than the curve it is cut off, which the mean leaves out.
        assert!(
            (integral - metal.mean()).abs().max_element() < 2e-3,
            "{integral}"
        );
    }
}
