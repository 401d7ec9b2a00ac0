//! Where on its way a ray looks for light that even media scatter towards its start.
//!
//! Free flights end where the medium is dense; a thin one hardly ever ends one, and a lamp within it is seen
//! near the lamp. So a point of its own is drawn for light samples on every ray: one half as free flights
//! that surely end before the ray does, the other by even steps of the angle under which a lamp sees the
//! ray, which takes out the inverse square of the distance. Both count by the balance heuristic.
//!
//! Source: Kulla and Fajardo, "Importance Sampling Techniques for Path Tracing in Participating Media",
//! Computer Graphics Forum 31(4), 2012.

use glam::Vec3A;

use super::{Collision, Flight, Span, depth};
use crate::math::Ray;

/// Angles by which a point sees a ray.
struct Fan {
    /// The ray's parameter next to the point, and how far from it that is [m].
    nearest: f32,
    distance: f32,
    /// Angles of the two ends.
    from: f32,
    to: f32,
}

impl Fan {
    /// Of a point, between two parameters of a ray; `None` where there is no angle to divide.
    fn new(ray: &Ray, point: Vec3A, [start, end]: [f32; 2]) -> Option<Self> {
        let nearest = (point - ray.origin).dot(ray.direction);
        let distance = (point - ray.at(nearest)).length();
        let angle = |t: f32| ((t - nearest) / distance).atan();
        let (from, to) = (angle(start), angle(end));
        (to > from).then_some(Self {
            nearest,
            distance,
            from,
            to,
        })
    }

    fn sample(&self, u: f32) -> f32 {
        self.nearest + self.distance * (self.from + u * (self.to - self.from)).tan()
    }

    /// Density [1/m].
    fn pdf(&self, t: f32) -> f32 {
        let away = t - self.nearest;
        let squared = self.distance * self.distance + away * away;
        self.distance / ((self.to - self.from) * squared)
    }
}

impl Flight {
    /// A point of the ray for light samples, that of one of the lights being `light`, weighted by the share
    /// of the light that is scattered there and arrives over the density of drawing it.
    pub fn scatter(&self, ray: &Ray, light: Option<Vec3A>, u: [f32; 2]) -> Option<Collision> {
        let mut scattering = self.spans.iter().filter(|s| s.scatters());
        let first = scattering.next()?;
        let last = scattering.next_back().unwrap_or(first);
        let fan = light.and_then(|light| Fan::new(ray, light, [first.start, last.end]));
        let [choice, u] = u;
        let t = match &fan {
            Some(fan) if u < 0.5 => fan.sample(2.0 * u),
            Some(_) => self.sample_end(choice, 2.0 * u - 1.0)?,
            None => self.sample_end(choice, u)?,
        };
        let span = self.spans.iter().find(|s| s.start <= t && t < s.end)?;
        let passed = self.transmittance(t);
        let by_flight = self.pdf_of_end(span, passed);
        let pdf = match &fan {
            Some(fan) => 0.5 * (fan.pdf(t) + by_flight),
            None => by_flight,
        };
        let weight = span.medium.scattering * passed / pdf;
        weight.is_finite().then_some(Collision {
            t,
            weight,
            anisotropy: span.medium.anisotropy,
        })
    }

    /// Optical depth of each channel up to the ray's end.
    fn depths(&self) -> Vec3A {
        let depths = self.spans.iter().map(Span::depth);
        depths.sum()
    }

    /// Where a free flight of one of the channels ends that ends within the media.
    fn sample_end(&self, choice: f32, u: f32) -> Option<f32> {
        let depths = self.depths();
        let channels = (0..3).filter(|&channel| depths[channel] > 0.0);
        let chosen = (choice * channels.clone().count() as f32) as usize;
        let channel = channels.clone().nth(chosen).or(channels.last())?;
        let mut rest = -(u * (-depths[channel]).exp_m1()).ln_1p();
        for span in &self.spans {
            let here = span.depth()[channel];
            if rest < here {
                return Some(span.start + rest / span.medium.extinction()[channel]);
            }
            rest -= here;
        }
        None
    }

    /// Density [1/m] of [`Flight::sample_end`] at a point of a span that light leaves with this share.
    fn pdf_of_end(&self, span: &Span, passed: Vec3A) -> f32 {
        let depths = self.depths();
        let is_dense = depths.cmpgt(Vec3A::ZERO);
        let ending = depths.map(|depth| -(-depth).exp_m1());
        let density = span.medium.extinction() * passed / ending;
        let sum = Vec3A::select(is_dense, density, Vec3A::ZERO).element_sum();
        sum / is_dense.bitmask().count_ones() as f32
    }
}

impl Span {
    fn scatters(&self) -> bool {
        self.end > self.start && self.medium.scattering.max_element() > 0.0
    }

    fn depth(&self) -> Vec3A {
        depth(self.medium.extinction(), self.end - self.start)
    }
}
