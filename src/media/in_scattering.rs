//! Where on its way a ray looks for light that even media scatter towards its start.
//!
//! Free flights end where the medium is dense; a thin one hardly ever ends one, and a lamp within it is seen
//! near the lamp. So a point of its own is drawn for light samples on every ray: one half as free flights
//! that surely end before the ray does, the other by even steps of the angle under which one of the lamps
//! sees the ray, which takes out the inverse square of the distance.
//!
//! Source: Kulla and Fajardo, "Importance Sampling Techniques for Path Tracing in Participating Media",
//! Computer Graphics Forum 31(4), 2012.

use glam::Vec3A;

use super::{Collision, Flight, Span, depth};
use crate::math::Ray;
use crate::sampling::LightBall;

/// Lamps whose angles are divided, those that count most.
const FANS: usize = 8;

/// Angles by which a lamp sees a ray.
struct Fan {
    /// The ray's parameter next to the lamp, and how far from it that is [m].
    nearest: f32,
    distance: f32,
    /// Angles of the two ends.
    from: f32,
    to: f32,
    /// Light that the ray would get from the lamp if nothing were lost, over that of all lamps.
    share: f32,
}

impl Fan {
    /// Of a lamp, between two parameters of a ray. Next to a large one, light changes as slowly as it is
    /// large.
    fn new(ray: &Ray, lamp: &LightBall, [start, end]: [f32; 2]) -> Self {
        let nearest = (lamp.center - ray.origin).dot(ray.direction);
        let distance = (lamp.center - ray.at(nearest)).length();
        let distance = distance.max(0.5 * lamp.radius).max(1e-6);
        let angle = |t: f32| ((t - nearest) / distance).atan();
        let (from, to) = (angle(start), angle(end));
        Self {
            nearest,
            distance,
            from,
            to,
            share: lamp.intensity * (to - from) / distance,
        }
    }

    /// Of the lamps that count most.
    fn of(ray: &Ray, lamps: &[LightBall], range: [f32; 2]) -> Vec<Self> {
        let fans = lamps.iter().map(|lamp| Self::new(ray, lamp, range));
        let mut fans: Vec<Self> = fans.filter(|fan| fan.share > 0.0).collect();
        if fans.len() > FANS {
            fans.select_nth_unstable_by(FANS, |a, b| b.share.total_cmp(&a.share));
            fans.truncate(FANS);
        }
        let sum: f32 = fans.iter().map(|fan| fan.share).sum();
        fans.iter_mut().for_each(|fan| fan.share /= sum);
        fans
    }

    fn sample(fans: &[Self], mut u: f32) -> Option<f32> {
        let last = fans.len().checked_sub(1)?;
        for fan in &fans[..last] {
            if u < fan.share {
                return Some(fan.at(u / fan.share));
            }
            u -= fan.share;
        }
        Some(fans[last].at((u / fans[last].share).min(1.0)))
    }

    fn at(&self, u: f32) -> f32 {
        self.nearest + self.distance * (self.from + u * (self.to - self.from)).tan()
    }

    /// Density [1/m].
    fn pdf(&self, t: f32) -> f32 {
        let away = t - self.nearest;
        let squared = self.distance * self.distance + away * away;
        self.share * self.distance / ((self.to - self.from) * squared)
    }
}

impl Flight {
    /// A point of the ray for light samples, weighted by the share of the light that is scattered there and
    /// arrives over the density of drawing it; with [`Flight::odds`] there.
    pub fn scatter(
        &self,
        ray: &Ray,
        lamps: &[LightBall],
        [choice, u]: [f32; 2],
    ) -> Option<(Collision, f32)> {
        let fans = Fan::of(ray, lamps, self.range()?);
        let t = match fans.is_empty() {
            true => self.sample_end(choice, u)?,
            false if u < 0.5 => Fan::sample(&fans, 2.0 * u)?,
            false => self.sample_end(choice, 2.0 * u - 1.0)?,
        };
        let span = self.span_at(t)?;
        let passed = self.transmittance(t);
        let pdf = self.pdf_of_scatter(&fans, t, span, passed);
        let weight = span.medium.scattering * passed / pdf;
        let collision = Collision {
            t,
            weight,
            anisotropy: span.medium.anisotropy,
        };
        let odds = pdf_of_flight(span, self.reaching(t)) / pdf;
        weight.is_finite().then_some((collision, odds))
    }

    /// The density of a free flight that ends at a point over that of [`Flight::scatter`]. It tells apart
    /// light that samples of lights find from light that rays find which free flights scatter: near a lamp
    /// these would be rare and great finds.
    pub fn odds(&self, ray: &Ray, lamps: &[LightBall], t: f32) -> f32 {
        let (Some(range), Some(span)) = (self.range(), self.span_at(t)) else {
            return 1.0;
        };
        let passed = self.transmittance(t);
        let fans = Fan::of(ray, lamps, range);
        pdf_of_flight(span, self.reaching(t)) / self.pdf_of_scatter(&fans, t, span, passed)
    }

    /// Density [1/m] of [`Flight::scatter`].
    fn pdf_of_scatter(&self, fans: &[Fan], t: f32, span: &Span, passed: Vec3A) -> f32 {
        let by_ending = self.pdf_of_end(span, passed);
        match fans.is_empty() {
            true => by_ending,
            false => 0.5 * (by_ending + fans.iter().map(|fan| fan.pdf(t)).sum::<f32>()),
        }
    }

    fn span_at(&self, t: f32) -> Option<&Span> {
        self.spans.iter().find(|s| s.start <= t && t < s.end)
    }

    /// Where media that scatter begin and end.
    fn range(&self) -> Option<[f32; 2]> {
        let mut scattering = self.spans.iter().filter(|s| s.scatters());
        let first = scattering.next()?;
        let last = scattering.next_back().unwrap_or(first);
        Some([first.start, last.end])
    }

    /// Optical depth of each channel up to the ray's end.
    fn depths(&self) -> Vec3A {
        let depths = self.spans.iter().map(Span::depth);
        depths.sum()
    }

    /// Where a free flight of one of the channels ends that ends within the media.
    fn sample_end(&self, choice: f32, u: f32) -> Option<f32> {
        let depths = self.depths();
        let mut channels = (0..3).filter(|&channel| depths[channel] > 0.0);
        let chosen = (choice * channels.clone().count() as f32) as usize;
        let channel = channels.clone().nth(chosen).or(channels.next_back())?;
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

/// Density [1/m] of free flights to end at a point of a span that those of each channel reach so often.
fn pdf_of_flight(span: &Span, reaching: Vec3A) -> f32 {
    (span.medium.scattering * reaching).element_sum() / 3.0
}

impl Span {
    fn scatters(&self) -> bool {
        self.end > self.start && self.medium.scattering.max_element() > 0.0
    }

    fn depth(&self) -> Vec3A {
        depth(self.medium.extinction(), self.end - self.start)
    }
}
