//! Media that fill bodies or the world: how much light a ray loses in them, and where it is scattered.
//!
//! Where a ray is inside a closed mesh follows from the number of surfaces ahead of it, so that no path
//! must remember what it entered. Most media are even: what their nodes say holds for a whole body, and
//! all about them is known in closed form. Free flights are drawn from the channels in turn and weighted
//! by the balance heuristic, as in the walks of [`crate::subsurface`]. Flights through media that differ
//! from place to place are in [`track`].

mod in_scattering;
mod majorant;
mod track;
mod uneven;

use glam::Vec3A;

use crate::accel::Accel;
use crate::math::Ray;
use crate::sampling::Walk;
use crate::scene::{Filling, Medium, SceneFrame};
use crate::shader::{GENERATED, Point, View};
use track::Mark;
pub use uneven::Journey;
use uneven::{Uneven, density_scale, medium_of};

/// The media of a frame.
#[derive(Default)]
pub struct Media {
    everywhere: Option<Filler>,
    /// Instances that are filled.
    bodies: Vec<(u32, Filler)>,
    /// Those fillers that differ from place to place.
    uneven: Vec<Uneven>,
}

/// What fills the world or a body.
#[derive(Debug, Clone, Copy)]
enum Filler {
    Even(Medium),
    /// A row of [`Media::uneven`].
    Uneven(usize),
}

/// A part of a ray with one medium, or several on top of each other.
#[derive(Debug, Clone)]
struct Span {
    start: f32,
    end: f32,
    /// The even ones.
    medium: Medium,
    /// The others: rows of [`Media::uneven`].
    uneven: Vec<usize>,
}

/// What lies along a ray, and where the ray is scattered.
#[derive(Debug, Default)]
pub struct Flight {
    spans: Vec<Span>,
    /// Where it is scattered, infinite where it is not.
    end: f32,
    /// Of a flight through uneven media what it carried, in the order of distances.
    marks: Vec<Mark>,
    /// Light that such media gave off.
    glow: Vec3A,
}

/// Where a ray is scattered.
#[derive(Debug, Clone, Copy)]
pub struct Collision {
    /// The ray's parameter.
    pub t: f32,
    /// What it carries then.
    pub weight: Vec3A,
    /// Mean cosine of scattering.
    pub anisotropy: f32,
}

/// Optical depth; nothing times an endless way is nothing.
fn depth(extinction: Vec3A, length: f32) -> Vec3A {
    extinction.map(|e| if e > 0.0 { e * length } else { 0.0 })
}

/// Light that a part of a ray gives off, less what is lost on its way out of there, and of which this
/// share arrives.
fn glow_of(share: Vec3A, medium: &Medium, length: f32) -> Vec3A {
    let extinction = medium.extinction();
    let seen = Vec3A::select(
        extinction.cmpgt(Vec3A::splat(1e-9)),
        (1.0 - (-depth(extinction, length)).exp()) / extinction,
        Vec3A::splat(length),
    );
    share * medium.emission * seen
}

impl Media {
    /// What fills the frame's world and bodies; `bounds` is the box around all things, if there are any.
    pub fn of(frame: &SceneFrame, bounds: Option<(Vec3A, Vec3A)>) -> Self {
        let mut media = Self::default();
        for (index, body) in (0u32..).zip(&frame.instances) {
            let mut materials = body.materials.iter();
            let filling = materials.find_map(|&m| frame.materials[m as usize].medium.as_ref());
            if let Some(filler) = filling.and_then(|f| media.filler(frame, index, f)) {
                media.bodies.push((index, filler));
            }
        }
        if let Some(filling) = &frame.medium {
            media.everywhere = media.world(frame, filling, bounds);
        }
        media
    }

    /// What fills the world around things within this box, if there are any; `None` for nothing.
    fn world(
        &mut self,
        frame: &SceneFrame,
        filling: &Filling,
        bounds: Option<(Vec3A, Vec3A)>,
    ) -> Option<Filler> {
        match filling {
            Filling::Even(medium) => Some(Filler::Even(*medium)),
            Filling::Uneven(program) if program.differs_in(|key| key == GENERATED) => {
                let eye = frame.camera.camera_from_world().inverse().translation;
                let (lower, upper) = bounds.unwrap_or((eye - 1.0, eye + 1.0));
                let bounds = [lower.min(eye), upper.max(eye)];
                let uneven = Uneven::of_world(frame, bounds, program);
                Some(self.kept(uneven))
            }
            Filling::Uneven(program) => {
                Medium::at(program, &Point::nowhere(), &frame.images).map(Filler::Even)
            }
        }
    }

    fn kept(&mut self, uneven: Uneven) -> Filler {
        self.uneven.push(uneven);
        Filler::Uneven(self.uneven.len() - 1)
    }

    /// What fills a body; `None` for nothing.
    fn filler(&mut self, frame: &SceneFrame, instance: u32, filling: &Filling) -> Option<Filler> {
        match filling {
            Filling::Even(medium) => {
                let placement = &frame.instances[instance as usize].placement;
                let content = &frame.mesh_of(instance).content;
                let medium = match content.is_scaled {
                    true => medium.times(density_scale(content, placement)),
                    false => *medium,
                };
                Some(Filler::Even(medium))
            }
            Filling::Uneven(program) => {
                let content = &frame.mesh_of(instance).content;
                if !program.differs_in(|key| key == GENERATED || content.has(key)) {
                    return medium_of(program, frame, instance).map(Filler::Even);
                }
                let uneven = Uneven::of_body(frame, instance, program)?;
                Some(self.kept(uneven))
            }
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.everywhere.is_none() && self.bodies.is_empty()
    }

    /// What lies along a ray with a unit direction, from its start to its end: as in Cycles cameras see
    /// nothing before their clipping plane, media included.
    pub fn along(&self, frame: &SceneFrame, accel: &Accel, ray: &Ray) -> Flight {
        let mut events: Vec<(f32, f32, Filler)> = Vec::new();
        if let Some(filler) = self.everywhere {
            events.push((ray.t_min, ray.t_max, filler));
        }
        for (instance, filler) in &self.bodies {
            let mut crossings = accel.crossings(frame, ray, *instance);
            if crossings.len() % 2 == 1 {
                crossings.insert(0, ray.t_min);
            }
            for pair in crossings.chunks_exact(2) {
                events.push((pair[0], pair[1].min(ray.t_max), *filler));
            }
        }
        Flight {
            spans: flattened(&events),
            end: f32::INFINITY,
            ..Flight::default()
        }
    }

    /// What becomes of a ray before its end: the flight, with what it shows, and where it is scattered.
    /// Numbers of an uneven flight come from `numbers`, those of an even one are its first two.
    pub fn fly(
        &self,
        journey: &Journey,
        accel: &Accel,
        numbers: impl FnOnce() -> Walk,
        even_numbers: [f32; 2],
    ) -> (Flight, Option<Collision>) {
        let end = journey.ray.t_max;
        let mut flight = self.along(journey.frame, accel, journey.ray);
        let collision = if flight.is_even() {
            flight.glow = flight.glow_until(end);
            let [u_channel, u] = even_numbers;
            flight.collide(end, u_channel, u)
        } else {
            flight.track(&self.uneven, journey, end, &mut numbers())
        };
        (flight, collision)
    }

    /// Share of the light from a ray's end that arrives; on the mean, by these numbers, where media are
    /// uneven.
    pub fn transmittance(
        &self,
        journey: &Journey,
        accel: &Accel,
        numbers: impl FnOnce() -> Walk,
    ) -> Vec3A {
        let flight = self.along(journey.frame, accel, journey.ray);
        match flight.is_even() {
            true => flight.transmittance(journey.ray.t_max),
            false => flight.tracked_transmittance(&self.uneven, journey, &mut numbers()),
        }
    }
}

/// The parts between the ends of intervals that may overlap.
fn flattened(intervals: &[(f32, f32, Filler)]) -> Vec<Span> {
    let mut cuts: Vec<f32> = intervals.iter().flat_map(|i| [i.0, i.1]).collect();
    cuts.sort_unstable_by(f32::total_cmp);
    cuts.dedup();
    let part = |cut: &[f32]| {
        let inside = |i: &&(f32, f32, Filler)| i.0 <= cut[0] && i.1 >= cut[1];
        let (mut even, mut uneven): (Option<Medium>, _) = (None, Vec::new());
        for (_, _, filler) in intervals.iter().filter(inside) {
            match *filler {
                Filler::Even(medium) => even = Some(even.map_or(medium, |m| m.and(medium))),
                Filler::Uneven(row) => uneven.push(row),
            }
        }
        (even.is_some() || !uneven.is_empty()).then(|| Span {
            start: cut[0],
            end: cut[1],
            medium: even.unwrap_or_default(),
            uneven,
        })
    };
    cuts.windows(2).filter_map(part).collect()
}

impl Flight {
    /// Whether all of its media are.
    fn is_even(&self) -> bool {
        self.spans.iter().all(|span| span.uneven.is_empty())
    }

    /// Whether light samples look for light all along the ray: then where it is scattered they do not.
    pub fn is_lit_on_the_way(&self) -> bool {
        !self.spans.is_empty() && self.is_even()
    }

    /// Light that the media gave off.
    pub fn glow(&self) -> Vec3A {
        self.glow
    }

    /// Share of the light from this distance that arrives, on the mean: [`Flight::share`] where that is not
    /// known.
    pub fn mean_share(&self, t: f32) -> Vec3A {
        match self.is_even() {
            true => self.transmittance(t),
            false => self.share(t),
        }
    }

    /// Share of the light from this distance that arrives.
    fn transmittance(&self, t: f32) -> Vec3A {
        let spans = self.spans.iter().take_while(|span| span.start < t);
        let depths = spans.map(|s| depth(s.medium.extinction(), s.end.min(t) - s.start));
        (-depths.sum::<Vec3A>()).exp()
    }

    /// Light that the media give off up to this distance.
    fn glow_until(&self, t: f32) -> Vec3A {
        let spans = self.spans.iter().take_while(|span| span.start < t);
        let light = spans.map(|span| {
            let length = span.end.min(t) - span.start;
            glow_of(self.transmittance(span.start), &span.medium, length)
        });
        // Without emission an endless way through nothing is no number.
        light.filter(|light| light.is_finite()).sum()
    }

    /// Probability of a flight of each channel to get to this distance: flights end by scattering alone, so that
    /// absorption is a factor and no chance.
    fn reaching(&self, t: f32) -> Vec3A {
        let spans = self.spans.iter().take_while(|span| span.start < t);
        let depths = spans.map(|s| depth(s.medium.scattering, s.end.min(t) - s.start));
        (-depths.sum::<Vec3A>()).exp()
    }

    /// Draws where the ray is scattered before it ends at `end`, and remembers it.
    fn collide(&mut self, end: f32, u_channel: f32, u: f32) -> Option<Collision> {
        let channel = ((3.0 * u_channel) as usize).min(2);
        let mut rest = -(1.0 - u).ln();
        for span in &self.spans {
            let scattering = span.medium.scattering;
            let here = depth(scattering, span.end.min(end) - span.start)[channel];
            if rest < here {
                let t = span.start + rest / scattering[channel];
                let density = (scattering * self.reaching(t)).element_sum() / 3.0;
                let (weight, anisotropy) = (
                    scattering * self.transmittance(t) / density,
                    span.medium.anisotropy,
                );
                self.end = t;
                return Some(Collision {
                    t,
                    weight,
                    anisotropy,
                });
            }
            rest -= here.max(0.0);
        }
        None
    }

    /// Share of the light from this distance that the ray brings, over its probability of getting
    /// there.
    pub fn share(&self, t: f32) -> Vec3A {
        if !self.marks.is_empty() {
            return self.tracked_share(t);
        }
        if self.spans.is_empty() {
            return Vec3A::ONE;
        }
        if t > self.end {
            return Vec3A::ZERO;
        }
        let probability = self.reaching(t).element_sum() / 3.0;
        if probability > 0.0 {
            self.transmittance(t) / probability
        } else {
            Vec3A::ZERO
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;
    use crate::testing::{Scene, cube};
    use glam::Affine3A;

    fn medium(scattering: Vec3A, absorption: Vec3A) -> Medium {
        Medium {
            scattering,
            absorption,
            emission: Vec3A::ONE,
            anisotropy: 0.0,
        }
    }

    /// A thin coloured medium, and a denser one within it from 1 to 2 m.
    fn flight() -> Flight {
        let thin = medium(Vec3A::new(0.1, 0.2, 0.0), Vec3A::new(0.1, 0.0, 0.0));
        let dense = medium(Vec3A::splat(1.0), Vec3A::splat(0.5));
        Flight {
            spans: flattened(&[
                (0.0, 3.0, Filler::Even(thin)),
                (1.0, 2.0, Filler::Even(dense)),
            ]),
            end: f32::INFINITY,
            ..Flight::default()
        }
    }

    #[test]
    fn media_on_top_of_each_other_add_up() {
        let depth = -flight().transmittance(5.0).ln();
        let expected = Vec3A::new(0.6, 0.6, 0.0) + 1.5;
        assert!((depth - expected).abs().max_element() < 1e-5, "{depth}");
    }

    /// Through the diagonals of a cube's faces, which both of their triangles meet, and from within it.
    #[test]
    fn a_body_fills_what_its_surface_encloses() {
        let mut scene = Scene::new();
        let mut fog = Material::of(&[]);
        fog.medium = Some(Filling::Even(medium(Vec3A::splat(0.2), Vec3A::splat(0.3))));
        scene.add(cube(), Affine3A::IDENTITY, fog);
        let frame = scene.frame(1);
        let accel = Accel::build(&frame, None);
        let media = Media::of(&frame, accel.bounds());
        // From outside, from within, and from a plane within, before which nothing counts.
        for (start, t_min, way) in [(-5.0f32, 0.0, 2.0f32), (0.25, 0.0, 0.75), (-5.0, 4.5, 1.5)] {
            let ray = Ray {
                t_min,
                ..Ray::new(start * Vec3A::Y, Vec3A::Y)
            };
            let flight = media.along(&frame, &accel, &ray);
            let off = flight.transmittance(f32::INFINITY) - (-0.5 * way).exp();
            assert!(off.abs().max_element() < 1e-5, "{start}: {off}");
        }
    }

    /// Collisions and what passes make up all of the light: the mean over many is that of the closed
    /// form; standard errors are below 0.5 %.
    #[test]
    fn collisions_bring_what_the_medium_scatters() {
        const COUNT: u32 = 1 << 14;
        let (mut scattered, mut passed) = (Vec3A::ZERO, Vec3A::ZERO);
        for i in 0..COUNT {
            let mut flight = flight();
            let [u, channel] =
                [0.754_877_67_f64, 0.569_840_3].map(|step| (f64::from(i) * step).fract() as f32);
            match flight.collide(2.5, channel, u) {
                Some(collision) => {
                    scattered += collision.weight / COUNT as f32;
                    assert_eq!(flight.share(collision.t + 0.1), Vec3A::ZERO);
                }
                None => passed += flight.share(2.5) / COUNT as f32,
            }
        }
        let expected = flight().transmittance(2.5);
        assert!((passed - expected).abs().max_element() < 5e-3, "{passed}");
        // By small steps.
        let steps = 0..25_000;
        let integral: Vec3A = steps
            .map(|i| {
                let t = (i as f32 + 0.5) * 1e-4;
                let inside = if (1.0..2.0).contains(&t) { 1.0 } else { 0.0 };
                let scattering = Vec3A::new(0.1, 0.2, 0.0) + inside;
                scattering * flight().transmittance(t) * 1e-4
            })
            .sum();
        assert!(
            (scattered - integral).abs().max_element() < 5e-3,
            "{scattered} {integral}"
        );
    }

    #[test]
    fn glow_is_what_is_not_absorbed_on_the_way() {
        let dense = medium(Vec3A::ZERO, Vec3A::new(2.0, 0.5, 0.0));
        let flight = Flight {
            spans: flattened(&[(0.0, 4.0, Filler::Even(dense))]),
            end: f32::INFINITY,
            ..Flight::default()
        };
        let expected = Vec3A::new(
            (1.0 - (-6.0f32).exp()) / 2.0,
            (1.0 - (-1.5f32).exp()) / 0.5,
            3.0,
        );
        assert!((flight.glow_until(3.0) - expected).abs().max_element() < 1e-5);
    }
}
