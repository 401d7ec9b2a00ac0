//! Wide glossy reflection of borrowed light: the receiver's own microfacets under the directions that
//! its neighbours sampled, eight at a time.
//!
//! A neighbour's record brings radiance over its density, so the receiver's closure replaces the
//! lender's as it does for the Lambert part. All that must hold is that the lender's density covers
//! the receiver's lobe. The Lambert part of the lender sees to that, as long as the lobe is wide.

use glam::Vec3A;

use super::borrow::{dot, splats};
use super::records::UNIT;
use crate::kernel::vector::Vector;
use crate::sampling;

/// Least GGX alpha of a closure whose light is shared: a roughness of 0.3. A narrower lobe peaks
/// above the density of a diffuse neighbour, and shows the offset between the two as a blur.
pub const LEAST_ALPHA: f32 = 0.09;
/// Radius of the kernel over R for a lobe, as tan(beta) in Eq. 3, and the same over alpha: what the
/// offset turns a reflected direction by must be small against the lobe.
const TAN_BETA: f32 = 0.1;
const TAN_BETA_PER_ALPHA: f32 = 0.5;
/// Largest angle between the normals of pixels that share, over alpha.
const TURN_PER_ALPHA: f32 = 0.5;

/// What a reflectance or an index of one is kept as. Up to four are kept, and black is exact.
const SHARE_UNIT: f32 = 16383.0;
/// What an alpha of one is kept as.
const ALPHA_UNIT: f32 = 65535.0;

/// The nearest number that fits; the cast saturates.
fn kept(value: f32, unit: f32) -> u16 {
    (value * unit).round() as u16
}

/// Shares of light, in units of 1 / [`SHARE_UNIT`].
#[derive(Clone, Copy, Default)]
pub struct Share([u16; 3]);

impl Share {
    pub fn new(color: Vec3A) -> Self {
        Self(color.to_array().map(|c| kept(c, SHARE_UNIT)))
    }

    pub fn color(self) -> Vec3A {
        Vec3A::from_array(self.0.map(f32::from)) / SHARE_UNIT
    }
}

/// The closure of a pixel that takes borrowed light, 16 bytes.
#[derive(Clone, Copy, Default)]
pub struct Gloss {
    /// In units of 1 / [`ALPHA_UNIT`]; 0 for none.
    alpha: u16,
    /// Index of refraction in units of 1 / [`SHARE_UNIT`]; 0 for Schlick's curve.
    ior: u16,
    /// Reflectances at normal and at grazing incidence.
    f0: Share,
    f90: Share,
}

impl Gloss {
    /// The closure, as precisely as a pixel keeps it.
    pub fn new(gloss: &sampling::Gloss) -> Self {
        Self {
            alpha: kept(gloss.alpha, ALPHA_UNIT),
            ior: kept(gloss.ior, SHARE_UNIT),
            f0: Share::new(gloss.f0),
            f90: Share::new(gloss.f90),
        }
    }

    /// Whether the closure is kept without loss: what is shared must be what the pixel leaves out.
    pub fn fits(gloss: &sampling::Gloss) -> bool {
        let largest = gloss.ior.max(gloss.f90.max(gloss.f0).max_element());
        largest * SHARE_UNIT <= f32::from(u16::MAX)
    }

    /// Whether there is one.
    pub fn is_some(&self) -> bool {
        self.alpha > 0
    }

    fn alpha(&self) -> f32 {
        f32::from(self.alpha) / ALPHA_UNIT
    }

    /// tan(beta) that stands for the lobe in Eq. 3.
    pub fn tan_beta(&self) -> f32 {
        TAN_BETA.min(TAN_BETA_PER_ALPHA * self.alpha())
    }
}

/// A closure and the viewer in every lane.
pub struct Lobe<V> {
    wo: [V; 3],
    normal: [V; 3],
    cos_wo: V,
    alpha_squared: V,
    /// sqrt(1 + alpha^2 tan^2) of the viewer, from Smith's masking function.
    width_wo: V,
    ior: Option<Dielectric<V>>,
    f0: [V; 3],
    /// f90 - f0.
    rise: [V; 3],
    /// 1 / rho^2 of the kernel [1/m^2].
    pub inverse_radius_squared: V,
    /// Least cosine between normals.
    pub least_cosine: V,
}

/// A dielectric's curve: see `sampling::bsdf::fresnel`.
struct Dielectric<V> {
    ior_squared: V,
    f0: V,
    inverse_rise: V,
}

impl<V: Vector> Dielectric<V> {
    #[inline(always)]
    fn new(ior: f32) -> Self {
        let ratio = (ior - 1.0) / (ior + 1.0);
        let f0 = ratio * ratio;
        Self {
            ior_squared: V::splat(ior * ior),
            f0: V::splat(f0),
            inverse_rise: V::splat(1.0 / (1.0 - f0)),
        }
    }

    /// Fresnel's equations, brought over one denominator: divisions are dear here.
    #[inline(always)]
    fn at(&self, cos: V) -> V {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let refracted = (self.ior_squared - one + cos * cos).max(zero).sqrt();
        let (s, s_below) = (cos - refracted, cos + refracted);
        let parallel = self.ior_squared * cos;
        let (p, p_below) = (parallel - refracted, parallel + refracted);
        let (a, b, below) = (s * p_below, p * s_below, s_below * p_below);
        let reflectance = V::splat(0.5) * (a * a + b * b) / (below * below);
        ((reflectance - self.f0) * self.inverse_rise)
            .max(zero)
            .min(one)
    }
}

impl<V: Vector> Lobe<V> {
    /// The closure about `normal` seen from `wo`; `rho` is the radius of the kernel [m].
    #[inline(always)]
    pub fn new(gloss: &Gloss, normal: Vec3A, wo: Vec3A, rho: f32) -> Self {
        let (f0, f90) = (gloss.f0.color(), gloss.f90.color());
        let alpha = gloss.alpha();
        let cos_wo = normal.dot(wo).max(1e-6);
        let tan_squared = (1.0 - cos_wo * cos_wo).max(0.0) / (cos_wo * cos_wo);
        let ior = f32::from(gloss.ior) / SHARE_UNIT;
        Self {
            wo: splats(wo / UNIT),
            normal: splats(normal / UNIT),
            cos_wo: V::splat(cos_wo),
            alpha_squared: V::splat(alpha * alpha),
            width_wo: V::splat((1.0 + alpha * alpha * tan_squared).sqrt()),
            ior: match ior > 0.0 {
                true => Some(Dielectric::new(ior)),
                false => None,
            },
            f0: splats(f0),
            rise: splats(f90 - f0),
            inverse_radius_squared: V::splat(1.0 / (rho * rho)),
            least_cosine: V::splat((TURN_PER_ALPHA * alpha).cos()),
        }
    }

    /// pi f cos towards directions in units of 1 / [`UNIT`]; black below the normal's horizon.
    ///
    /// With h the half vector, |wo + wi|^2 = 2 + 2 (wo wi), so that both cosines of h follow from
    /// those of wo and wi. All is brought over one denominator.
    #[inline(always)]
    pub fn reflected(&self, direction: [V; 3]) -> [V; 3] {
        let (one, least) = (V::splat(1.0), V::splat(1e-5));
        let cos_wi = dot(direction, self.normal);
        let is_above = least.at_most(cos_wi);
        let cos_wi = cos_wi.max(least).min(one);
        let length_squared = V::splat(2.0) * (one + dot(direction, self.wo));
        let length_squared = length_squared.max(least);
        let cos = (V::splat(0.5) * length_squared.sqrt()).min(one);
        // D = alpha^2 / (pi width^2), here with the width times |wo + wi|^2.
        let sum = cos_wi + self.cos_wo;
        let half_squared = (sum * sum).min(length_squared);
        let width = length_squared - half_squared + half_squared * self.alpha_squared;
        // G2 = 2 / (width_wo + width_wi) (Heitz 2014, Eq. 99), here with the widths times cos_wi.
        let cos_squared = cos_wi * cos_wi;
        let width_wi = (cos_squared + self.alpha_squared * (one - cos_squared)).sqrt();
        let widths = self.width_wo * cos_wi + width_wi;
        let above = self.alpha_squared * length_squared * length_squared * cos_wi;
        let below = V::splat(2.0) * self.cos_wo * width * width * widths;
        let shape = (above / below) & is_above;
        let curve = match &self.ior {
            Some(dielectric) => dielectric.at(cos),
            None => {
                let rest = one - cos;
                rest * (rest * rest) * (rest * rest)
            }
        };
        [
            (self.f0[0] + self.rise[0] * curve) * shape,
            (self.f0[1] + self.rise[1] * curve) * shape,
            (self.f0[2] + self.rise[2] * curve) * shape,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::vector::{LANES, Work, run_on_vectors};
    use crate::math::statistics::Random;
    use crate::math::warp::sample_cosine_hemisphere;
    use crate::reuse::dual_cone::records::quantised;
    use crate::sampling::{Bsdf, Principled};

    struct Towards {
        gloss: Gloss,
        normal: Vec3A,
        wo: Vec3A,
        wi: Vec3A,
    }

    impl Work for Towards {
        type Output = Vec3A;

        #[inline(always)]
        fn run<V: Vector>(self) -> Vec3A {
            let lobe = Lobe::<V>::new(&self.gloss, self.normal, self.wo, 1.0);
            let wi = self
                .wi
                .to_array()
                .map(|c| V::load_i16(&[quantised(c); LANES]));
            Vec3A::from_array(lobe.reflected(wi).map(|v| v.to_array()[0]))
        }
    }

    #[test]
    fn what_borrowed_light_meets_is_the_surface_s_own_closure() {
        let mut random = Random::new(5);
        let mut compared = 0;
        for _ in 0..4000 {
            let mut direction = || {
                let up = sample_cosine_hemisphere(random.next_2d());
                if random.next() < 0.5 { up } else { -up }
            };
            let (normal, wo, wi) = (direction(), direction(), direction());
            if wo.dot(normal) < 0.05 {
                continue;
            }
            let mut bsdf = Bsdf::new(normal, wo, true);
            let principled = Principled {
                roughness: 0.32 + 0.68 * random.next(),
                ior: 1.0 + 2.0 * random.next(),
                specular_tint: Vec3A::new(1.0, random.next(), 0.3),
                coat: 0.0,
                ..Principled::new(normal)
            };
            bsdf.add_principled(Vec3A::new(0.5, 1.0, 0.8), &principled);
            let Some(found) = bsdf.gloss(LEAST_ALPHA) else {
                continue;
            };
            compared += 1;
            let gloss = Gloss::new(&found);
            let shared = run_on_vectors(Towards {
                gloss,
                normal,
                wo,
                wi,
            });
            let own = std::f32::consts::PI * bsdf.eval_gloss(&found, wi);
            // Alpha, reflectance and directions are kept with 14 to 16 bits; grazing cosines lose most.
            let bound = 0.015 * own.max_element() + 2e-3;
            assert!(
                (shared - own).abs().max_element() < bound,
                "{shared} {own} {principled:?}"
            );
        }
        assert!(compared > 1000, "{compared}");
    }
}
