//! Light that enters a body and leaves it somewhere else: by a walk, or by the distance alone.
//!
//! A method is a file of this folder and a line of [`Subsurface::scatter`]. Where light leaves, the
//! surface is a Lambert one. Of several such closures of a surface one is chosen by its weight.

mod disk;
mod walk;

use std::f32::consts::PI;

use glam::Vec3A;

use crate::math::{Ray, luminance};
use crate::sampling::Walk;
use crate::shader::SubsurfaceMethod as Method;

/// Radii below this [m] scatter nowhere.
const RADIUS_MIN: f32 = 1e-8;

/// Mean free path and width of the profile per radius: Cycles' scale, which keeps the look of older
/// models.
const WIDTH: f32 = 0.25 / PI;

/// Below a surface: what the nodes ask for, and from where it is seen.
#[derive(Debug, Clone, Copy)]
pub struct Subsurface {
    /// Share of the light, the colour included.
    pub weight: Vec3A,
    /// What a flat surface of the body reflects.
    pub color: Vec3A,
    /// How far each channel spreads [m].
    pub radius: Vec3A,
    /// Mean cosine of scattering, 0 to 0.9.
    pub anisotropy: f32,
    /// Index of refraction.
    pub ior: f32,
    /// GGX alpha of the interface.
    pub alpha: f32,
    /// Unit shading normal, world space; as it reaches a walk, a mirror there looks above the surface.
    pub normal: Vec3A,
    /// Towards the viewer.
    pub incoming: Vec3A,
    /// How light scatters, and what the radius means.
    pub method: Method,
}

/// A body, and the place of its surface where light enters.
pub trait Body {
    /// Another place of its surface.
    type Hit;

    /// Where light enters, world space [m].
    fn position(&self) -> Vec3A;

    /// Unit geometric normal there, on the side that light comes from.
    fn geometric_normal(&self) -> Vec3A;

    /// A ray that starts there and does not meet the surface at once.
    fn ray_into(&self, direction: Vec3A) -> Ray;

    /// Where a ray first meets the surface, and at which of its parameters.
    fn meet(&self, ray: &Ray) -> Option<(f32, Self::Hit)>;

    /// All places where a ray meets the surface, by their distance.
    fn cross(&self, ray: &Ray) -> Vec<Crossing<Self::Hit>>;
}

/// Where a ray goes through a body's surface.
pub struct Crossing<H> {
    /// The ray's parameter.
    pub t: f32,
    /// Unit geometric normal, on the same side of the surface as [`Body::geometric_normal`].
    pub normal: Vec3A,
    /// The place.
    pub hit: H,
}

/// Where light leaves a body.
pub struct Exit<H> {
    /// The last part of the way.
    pub ray: Ray,
    /// Where it ends.
    pub hit: H,
    /// Share of the light that it carries.
    pub carried: Vec3A,
}

impl Subsurface {
    /// Where light that enters a body leaves it again; if nowhere, it is lost.
    pub fn scatter<B: Body>(&self, body: &B, numbers: &mut Walk) -> Option<Exit<B::Hit>> {
        match self.method {
            Method::Plain | Method::Skin => walk::scatter(self, body, numbers),
            Method::Burley => disk::scatter(self, body, numbers),
        }
    }

    /// Channels that spread far enough to be worth it.
    pub fn spreads(&self) -> Vec3A {
        let is_wide = self.radius.cmpgt(Vec3A::splat(RADIUS_MIN));
        Vec3A::select(is_wide, Vec3A::ONE, Vec3A::ZERO)
    }
}

/// One of several closures of a surface, by its weight, and its probability.
pub fn choose<'a>(closures: &'a [Subsurface], numbers: &mut Walk) -> Option<(&'a Subsurface, f32)> {
    if let [only] = closures {
        return Some((only, 1.0));
    }
    let weight = |closure: &Subsurface| luminance(closure.weight);
    let total: f32 = closures.iter().map(weight).sum();
    let mut rest = numbers.next() * total;
    for closure in closures {
        rest -= weight(closure);
        if rest < 0.0 {
            return Some((closure, weight(closure) / total));
        }
    }
    let last = closures.last().filter(|last| weight(last) > 0.0)?;
    Some((last, weight(last) / total))
}

/// A channel by these weights, and the probability of each.
fn choose_channel(weights: Vec3A, u: f32) -> Option<(usize, Vec3A)> {
    let total = weights.element_sum();
    if !(total > 0.0) || !total.is_finite() {
        return None;
    }
    let pmf = weights / total;
    let channel = match u {
        u if u < pmf.x => 0,
        u if u < pmf.x + pmf.y || pmf.z == 0.0 => 1,
        _ => 2,
    };
    Some((channel, pmf))
}
