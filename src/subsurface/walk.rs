//! Light that enters a body, walks about in it and leaves it somewhere else.
//!
//! A random walk inside the mesh itself, in a medium whose albedo and density give the surface the
//! colour and the radius that users ask for: Chiang, Kutz and Burley, "Practical and Controllable
//! Subsurface Scattering for Production Path Tracing", 2016; the fit with anisotropy after Wrenninge,
//! Villemin and Hery, "Path Traced Subsurface Scattering using Anisotropic Phase Functions and
//! Non-Exponential Free Flights", 2017, with the coefficients of Cycles 4.2 to 5.0. The walk begins
//! in a refracted direction, and ends in a Lambert surface where it meets the mesh again. Every other step
//! is guided towards the surface: see [`Guide`].

use std::f32::consts::TAU;

use glam::Vec3A;

use super::{Body, Exit, Method, Subsurface, WIDTH, choose_channel};
use crate::math::{Frame, Ggx, Ray};
use crate::sampling::{ALPHA_MIN, Walk, pdf_scattered, sample_scattered};

/// Steps of a walk; what is still inside is lost, as in Cycles.
const STEPS_MAX: u32 = 256;

/// From this step on the medium scatters evenly, and less: of many steps the sum is the same
/// (similarity theory), as in Cycles.
const ISOTROPIC_FROM: u32 = 10;

/// From this step on walks that carry little end by chance.
const ROULETTE_FROM: u32 = 8;

/// Albedos of the medium below this are raised, and what the walk carries lowered: as in Cycles.
const ALBEDO_MIN: f32 = 0.2;

/// A medium of three channels.
struct Medium {
    /// Extinction coefficient [1/m].
    extinction: Vec3A,
    /// Share of the light that a collision leaves.
    albedo: Vec3A,
    /// What a walk carries at its start.
    carried: Vec3A,
}

impl Medium {
    /// The medium that scatters evenly and is alike after many steps.
    fn isotropic(&self, anisotropy: f32) -> Self {
        let scattering = self.extinction * self.albedo;
        let reduced = scattering * (1.0 - anisotropy);
        let extinction = self.extinction - scattering + reduced;
        Self {
            extinction,
            albedo: reduced / extinction,
            ..*self
        }
    }
}

/// Steps as light takes them that will get out of a half space: towards its surface more often, and with longer
/// flights that way. They mix with those of the medium itself by the balance heuristic, for a body may be no half
/// space.
///
/// Source: d'Eon and Křivánek, "A Zero-Variance-Based Sampling Scheme for Monte Carlo Subsurface Scattering",
/// SIGGRAPH Talks 2014, after Dwivedi 1982; the mixing after Meng, Hanika and Dachsbacher, "Improving the
/// Dwivedi Sampling Scheme", 2016.
struct Guide {
    /// Out of the half space.
    normal: Vec3A,
    /// How deep light gets, in free paths: above one.
    depth: f32,
    /// Logarithm of `(depth + 1) / (depth - 1)`.
    log_ratio: f32,
    /// Share of the steps that are guided.
    share: f32,
}

/// Share of the steps that the medium alone decides, at least.
const LEAST_UNGUIDED: f32 = 0.5;

impl Guide {
    /// For a medium of this albedo; forward scattering leads away from the surface, and is less guided, as in
    /// Cycles.
    fn new(normal: Vec3A, albedo: Vec3A, anisotropy: f32) -> Self {
        /// The exact depth is the root of a transcendental equation: this is d'Eon's fit.
        fn depth(albedo: f32) -> f32 {
            let albedo = albedo.clamp(ALBEDO_MIN, 0.999_999);
            let exponent = 2.442_94 - 0.021_581_3 * albedo + 0.578_637 / albedo;
            (1.0 - albedo.powf(exponent)).sqrt().recip().max(1.0 + 1e-4)
        }
        // That of the brightest channel: too short a depth makes fireflies, too great a one a little noise.
        let depth = depth(albedo.max_element());
        Self {
            normal,
            depth,
            log_ratio: ((depth + 1.0) / (depth - 1.0)).ln(),
            share: 1.0 - anisotropy.abs().powf(0.125).max(LEAST_UNGUIDED),
        }
    }

    fn sample(&self, [u, turn]: [f32; 2]) -> Vec3A {
        let cos = self.depth - (self.depth + 1.0) * (-u * self.log_ratio).exp();
        let cos = cos.clamp(-1.0, 1.0);
        let (y, x) = (TAU * turn).sin_cos();
        let ring = (1.0 - cos * cos).max(0.0).sqrt();
        let frame = Frame::from_normal(self.normal);
        frame
            .to_world(Vec3A::new(ring * x, ring * y, cos))
            .normalize()
    }

    /// Density [1/sr] of directions with this cosine to the normal.
    fn pdf(&self, cos: f32) -> f32 {
        1.0 / (TAU * self.log_ratio * (self.depth - cos))
    }

    /// By how much extinction seems less or more in such directions.
    fn stretch(&self, cos: f32) -> f32 {
        1.0 - cos / self.depth
    }
}

/// What the steps of a walk are drawn by.
struct Scattering {
    medium: Medium,
    anisotropy: f32,
    guide: Guide,
}

/// A step of a walk.
struct Step {
    direction: Vec3A,
    /// Of the phase function [1/sr].
    phase: f32,
    /// Probabilities of the channels of which one decided its length.
    pmf: Vec3A,
    /// How far it gets if nothing is in the way [m].
    length: f32,
    /// Share of the steps like this that are guided.
    guided: f32,
}

impl Scattering {
    fn new(medium: Medium, anisotropy: f32, normal: Vec3A) -> Self {
        Self {
            guide: Guide::new(normal, medium.albedo, anisotropy),
            medium,
            anisotropy,
        }
    }

    /// What comes to the same after many steps.
    fn isotropic(&self) -> Self {
        let medium = self.medium.isotropic(self.anisotropy);
        Self::new(medium, 0.0, self.guide.normal)
    }

    /// A step in a direction that is given; `None` for a walk that carries nothing.
    fn first_step(&self, direction: Vec3A, carried: Vec3A, u: [f32; 4]) -> Option<Step> {
        let (channel, pmf) = choose_channel(carried * self.medium.albedo, u[3])?;
        Some(Step {
            direction,
            phase: 1.0,
            pmf,
            length: -(1.0 - u[2]).ln() / self.medium.extinction[channel],
            guided: 0.0,
        })
    }

    /// A step after one that went in this direction; `None` for a walk that carries nothing.
    fn step(
        &self,
        before: Vec3A,
        carried: Vec3A,
        [x, y, u_way, u_choice]: [f32; 4],
    ) -> Option<Step> {
        let (channel, pmf) = choose_channel(carried * self.medium.albedo, u_choice)?;
        let below = [0.0, pmf.x, pmf.x + pmf.y][channel];
        let is_guided = (u_choice - below) / pmf[channel] < self.guide.share;
        let (direction, extinction) = if is_guided {
            let direction = self.guide.sample([x, y]);
            (direction, self.stretched_extinction(direction))
        } else {
            let direction = sample_scattered(before, self.anisotropy, [x, y]);
            (direction, self.medium.extinction)
        };
        Some(Step {
            direction,
            phase: pdf_scattered(before, self.anisotropy, direction),
            pmf,
            length: -(1.0 - u_way).ln() / extinction[channel],
            guided: self.guide.share,
        })
    }

    /// What light carries on that gets this far [m] by a step, to a surface or else a collision, over the
    /// density of all ways to draw that.
    fn weight(&self, step: &Step, way: f32, meets: bool) -> Vec3A {
        let flown = |extinction: Vec3A| match meets {
            true => (-way * extinction).exp(),
            false => extinction * (-way * extinction).exp(),
        };
        let own = step.phase * flown(self.medium.extinction);
        let guided = self.guide.pdf(step.direction.dot(self.guide.normal))
            * flown(self.stretched_extinction(step.direction));
        own / step.pmf.dot(own.lerp(guided, step.guided))
    }

    /// The extinction by which guided flights in a direction end.
    fn stretched_extinction(&self, direction: Vec3A) -> Vec3A {
        self.medium.extinction * self.guide.stretch(direction.dot(self.guide.normal))
    }
}

/// For each of six parameters of the fit the coefficients of a polynomial in the anisotropy. Of the
/// second and fifth it is an exponent, behind two constants.
const FIT: [[f32; 8]; 6] = [
    [
        1.826_052_4,
        -1.284_510_6,
        -1.799_046_3,
        9.193_933,
        -22.821_56,
        32.023_487,
        -23.626_48,
        7.210_67,
    ],
    [
        0.0,
        31.149_158,
        -201.847_02,
        841.576,
        -2_018.092_9,
        2_731.715_6,
        -1_935.414_2,
        559.009_05,
    ],
    [
        1.096_861,
        -0.394_704_07,
        1.052_581_2,
        -8.839_637,
        28.864_323,
        -46.880_29,
        38.540_283,
        -12.718_105,
    ],
    [
        0.496_310_2,
        0.360_146_58,
        -2.151_393,
        17.889_69,
        -55.298_4,
        82.065_98,
        -58.510_6,
        15.847_83,
    ],
    [
        0.0,
        76.731_63,
        -594.356_8,
        2_448.883_4,
        -5_576.685_5,
        7_116.601_6,
        -4_763.544_4,
        1_303.531_9,
    ],
    [
        2.406_03,
        -2.518_148_2,
        9.184_949,
        -79.219_17,
        259.082_86,
        -403.613_8,
        302.857_12,
        -87.437_05,
    ],
];

/// Albedo of the medium that makes a body reflect this share.
fn albedo_for(color: f32, anisotropy: f32) -> f32 {
    let polynomial = |row: &[f32; 8]| row.iter().rfold(0.0, |sum, c| sum * anisotropy + c);
    let [a, b, c, d, e, f] = FIT.each_ref().map(polynomial);
    let b = 4.985_112 + 0.127_355_96 * b.exp();
    let e = 4.231_903 + 0.003_106_039_5 * e.exp();
    let color = color.clamp(0.0, 1.0);
    let blend = color.powf(0.25);
    let dark = (1.0 - blend) * a * (b * color).atan().powf(c);
    let bright = blend * d * (e * color).atan().powf(f);
    (dark + bright).clamp(0.0, 0.999_999)
}

/// Reduced albedo of a half space that reflects this share, in the dipole's approximation (Jensen and
/// others, "A Practical Model for Subsurface Light Transport", 2001), by halving.
fn dipole_albedo(color: f32, boundary: f32) -> f32 {
    if color < 1e-4 {
        return 0.0;
    }
    if color >= 0.995 {
        return 0.999_999;
    }
    let reflected = |albedo: f32| {
        let s = (3.0 * (1.0 - albedo)).sqrt();
        0.5 * albedo * (1.0 + (-boundary * s).exp()) * (-s).exp()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        if reflected(middle) < color {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Where a walk that enters here comes out.
pub(super) fn scatter<B: Body>(
    below: &Subsurface,
    body: &B,
    numbers: &mut Walk,
) -> Option<Exit<B::Hit>> {
    let direction = below.entry(numbers)?;
    if direction.dot(body.geometric_normal()) >= 0.0 {
        return None;
    }
    let normal = body.geometric_normal();
    below.walk(body.ray_into(direction), normal, numbers, |ray| {
        body.meet(ray)
    })
}

impl Subsurface {
    /// Mean free path [m].
    fn free_path(&self) -> Vec3A {
        match self.method {
            Method::Skin => {
                let ior = self.ior;
                let diffuse = (-1.44 / ior + 0.71) / ior + 0.668 + 0.0636 * ior;
                let boundary = 4.0 / 3.0 * (1.0 + diffuse) / (1.0 - diffuse);
                let albedo = self.color.map(|color| dipole_albedo(color, boundary));
                self.radius * (3.0 * (1.0 - albedo)).sqrt()
            }
            _ => self.radius * WIDTH,
        }
    }

    fn medium(&self) -> Medium {
        // The weight has the colour, which scattering makes: it is taken out.
        let albedo = self.color.map(|color| albedo_for(color, self.anisotropy));
        let raised = albedo.max(Vec3A::splat(ALBEDO_MIN));
        Medium {
            extinction: 1.0 / (self.free_path().max(Vec3A::splat(1e-16)) * (1.0 - self.anisotropy)),
            albedo: raised,
            carried: Vec3A::select(
                self.color.cmpgt(Vec3A::ZERO),
                albedo / raised / self.color,
                Vec3A::ZERO,
            ),
        }
    }

    /// The direction in which a walk begins; none where the interface has none.
    fn entry(&self, numbers: &mut Walk) -> Option<Vec3A> {
        let frame = Frame::from_normal(self.normal);
        let [x, y, choice, _] = numbers.next_point();
        let u = [x, y];
        if self.method == Method::Skin && choice < 0.5 {
            return Some(-frame.to_world(crate::math::warp::sample_cosine_hemisphere(u)));
        }
        let wo = frame.to_local(self.incoming);
        if wo.z <= 0.0 {
            return None;
        }
        let normal = Ggx::isotropic(self.alpha.max(ALPHA_MIN)).sample_visible_normal(wo, u);
        let (cos, eta) = (normal.dot(wo), 1.0 / self.ior);
        let cos_inside = (1.0 - eta * eta * (1.0 - cos * cos)).max(0.0).sqrt();
        let inwards = (eta * cos - cos_inside) * normal - eta * wo;
        Some(frame.to_world(inwards).normalize())
    }

    /// Walks from the start of `ray` until it meets the body's surface, whose normal is this about there;
    /// `meet` says at which of the ray's parameters that is. Where it does not, or takes too long, the light
    /// is lost.
    fn walk<H>(
        &self,
        mut ray: Ray,
        normal: Vec3A,
        numbers: &mut Walk,
        meet: impl Fn(&Ray) -> Option<(f32, H)>,
    ) -> Option<Exit<H>> {
        let mut scattering = Scattering::new(self.medium(), self.anisotropy, normal);
        let mut carried = scattering.medium.carried * self.spreads();
        for count in 0..STEPS_MAX {
            if count == ISOTROPIC_FROM {
                scattering = scattering.isotropic();
            }
            let u = numbers.next_point();
            let step = match count {
                0 => scattering.first_step(ray.direction, carried, u)?,
                _ => scattering.step(ray.direction, carried, u)?,
            };
            ray.direction = step.direction;
            ray.t_max = step.length;
            let met = meet(&ray);
            let way = met.as_ref().map_or(step.length, |(t, _)| *t);
            carried *= scattering.weight(&step, way, met.is_some());
            if let Some((_, hit)) = met {
                return carried.is_finite().then_some(Exit { ray, hit, carried });
            }
            carried *= scattering.medium.albedo;
            if count >= ROULETTE_FROM {
                let survival = carried.max_element().sqrt().min(1.0);
                if !(survival > 0.0) || numbers.next() >= survival {
                    return None;
                }
                carried /= survival;
            }
            ray = Ray::new(ray.at(way), ray.direction).at_time(ray.time);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Sampler;
    use crate::subsurface::choose;
    use std::cell::Cell;
    use std::f32::consts::PI;

    fn body(color: f32, anisotropy: f32, method: Method) -> Subsurface {
        Subsurface {
            weight: Vec3A::splat(color),
            color: Vec3A::splat(color),
            radius: Vec3A::new(1.0, 0.5, 0.2),
            anisotropy,
            ior: 1.01,
            alpha: 1.0,
            normal: Vec3A::Z,
            incoming: Vec3A::new(0.6, 0.0, 0.8),
            method,
        }
    }

    /// Below z = 0.
    fn half_space(ray: &Ray) -> Option<(f32, ())> {
        let t = -ray.origin.z / ray.direction.z;
        (ray.direction.z > 0.0 && t <= ray.t_max).then_some((t, ()))
    }

    /// Share of the light that a half space gives back, by channel.
    fn reflected(body: &Subsurface) -> Vec3A {
        const COUNT: u32 = 40_000;
        let walk = |i: u32| {
            let mut numbers = Sampler::new(3, 1, [i, 0], 0, 1).walk(0);
            let direction = body.entry(&mut numbers)?;
            let ray = Ray::new(Vec3A::NEG_Z * 1e-6, direction);
            Some(body.walk(ray, Vec3A::Z, &mut numbers, half_space)?.carried)
        };
        let sum: Vec3A = (0..COUNT).filter_map(walk).sum();
        body.weight * sum / COUNT as f32
    }

    /// The fit promises the colour to some hundredths, for light from all sides; standard errors are
    /// below 0.003.
    #[test]
    fn a_half_space_reflects_its_color() {
        for (color, anisotropy) in [(0.2, 0.0), (0.5, 0.0), (0.8, 0.0), (0.5, 0.6)] {
            for method in [Method::Plain, Method::Skin] {
                let found = reflected(&body(color, anisotropy, method));
                let off = (found - color).abs().max_element();
                assert!(off < 0.06, "{color} {anisotropy} {method:?}: {found}");
            }
        }
    }

    /// Dark bodies are made of a brighter medium; standard errors are below 1 %.
    #[test]
    fn a_dark_half_space_reflects_its_color() {
        let color = 0.01;
        let body = body(color, 0.0, Method::Plain);
        assert!(body.medium().albedo.min_element() >= ALBEDO_MIN);
        let off = reflected(&body) / color - 1.0;
        assert!(off.abs().max_element() < 0.2, "{off}");
    }

    #[test]
    fn radii_become_free_paths() {
        let plain = body(0.5, 0.0, Method::Plain);
        assert!((4.0 * PI * plain.free_path() - plain.radius).length() < 1e-6);
        // Jensen and others 2001, the half space's diffuse reflectance by its reduced albedo, with
        // `A` from the index of refraction: skin has the transport mean free path `1 / s` of it.
        let skin = body(0.5, 0.0, Method::Skin);
        let eta = f64::from(skin.ior);
        let fresnel = -1.44 / (eta * eta) + 0.71 / eta + 0.668 + 0.0636 * eta;
        let a = (1.0 + fresnel) / (1.0 - fresnel);
        for s in (skin.free_path() / skin.radius).to_array() {
            let s = f64::from(s);
            let albedo = 1.0 - s * s / 3.0;
            let reflectance = albedo / 2.0 * (1.0 + (-4.0 / 3.0 * a * s).exp()) * (-s).exp();
            assert!((reflectance - 0.5).abs() < 1e-3, "{reflectance}");
        }
    }

    /// Chosen closures over their probabilities add up to all of them; standard errors are 0.5 %.
    #[test]
    fn closures_of_one_surface_are_chosen_by_weight() {
        let closures = [0.2, 0.6, 0.0].map(|color| body(color, 0.0, Method::Plain));
        const COUNT: u32 = 4_000;
        let (mut sum, mut counts) = (Vec3A::ZERO, [0u32; 3]);
        for i in 0..COUNT {
            let mut numbers = Sampler::new(3, 1, [i, 0], 0, 1).walk(0);
            let (chosen, pmf) = choose(&closures, &mut numbers).unwrap();
            let index = closures.iter().position(|c| c.color == chosen.color);
            counts[index.unwrap()] += 1;
            sum += chosen.weight / pmf;
        }
        let mean = sum / COUNT as f32;
        assert!((mean - 0.8).abs().max_element() < 1e-4, "{mean}");
        let share = counts[0] as f32 / COUNT as f32;
        assert!(counts[2] == 0 && (share - 0.25).abs() < 0.03, "{counts:?}");
        assert!(
            choose(
                &closures[2..],
                &mut Sampler::new(3, 1, [0, 0], 0, 1).walk(0)
            )
            .is_some()
        );
        assert!(choose(&[], &mut Sampler::new(3, 1, [0, 0], 0, 1).walk(0)).is_none());
    }

    /// A walk that meets the surface at its 16th step only carries the albedo to the power of 15, be
    /// it ended by chance or not; standard error 1 %.
    #[test]
    fn walks_that_end_by_chance_lose_no_light() {
        const STEPS: u32 = 15;
        let body = Subsurface {
            radius: Vec3A::ONE,
            ..body(0.3, 0.0, Method::Plain)
        };
        let walk = |i: u32| {
            let steps = Cell::new(0);
            let meet = |_: &Ray| {
                steps.set(steps.get() + 1);
                (steps.get() > STEPS).then_some((0.0, ()))
            };
            let mut numbers = Sampler::new(9, 1, [i, 0], 0, 1).walk(0);
            let exit = body.walk(
                Ray::new(Vec3A::ZERO, Vec3A::NEG_Z),
                Vec3A::Z,
                &mut numbers,
                meet,
            );
            exit.map(|exit| exit.carried)
        };
        const COUNT: u32 = 40_000;
        let mean = (0..COUNT).filter_map(walk).sum::<Vec3A>() / COUNT as f32;
        let medium = body.medium();
        let expected = medium.carried * medium.albedo.powf(STEPS as f32);
        assert!(
            (mean / expected - 1.0).abs().max_element() < 0.05,
            "{mean} {expected}"
        );
    }

    /// The first ray keeps off the surface that it starts on, as the body wants it.
    #[test]
    fn the_first_ray_begins_where_it_is_told() {
        let first = Cell::new(None);
        let meet = |ray: &Ray| {
            first.set(first.get().or(Some((ray.t_min, ray.time))));
            Some((ray.t_min, ()))
        };
        let ray = Ray {
            t_min: 0.25,
            time: 0.75,
            ..Ray::new(Vec3A::ZERO, Vec3A::NEG_Z)
        };
        let mut numbers = Sampler::new(9, 1, [0, 0], 0, 1).walk(0);
        let body = body(0.3, 0.0, Method::Plain);
        assert!(body.walk(ray, Vec3A::Z, &mut numbers, meet).is_some());
        assert_eq!(first.get(), Some((0.25, 0.75)));
    }

    /// Within a medium that does not absorb no light gets lost: what comes in leaves a ball.
    #[test]
    fn a_white_ball_loses_nothing() {
        let body = Subsurface {
            radius: Vec3A::splat(4.0),
            ..body(1.0, 0.0, Method::Plain)
        };
        let ball = |ray: &Ray| {
            let (b, c) = (
                ray.origin.dot(ray.direction),
                ray.origin.length_squared() - 1.0,
            );
            let t = (b * b - c).max(0.0).sqrt() - b;
            (t <= ray.t_max).then_some((t, ()))
        };
        let walk = |i: u32| {
            let mut numbers = Sampler::new(5, 1, [i, 0], 0, 1).walk(0);
            let ray = Ray::new(Vec3A::Z * (1.0 - 1e-6), Vec3A::NEG_Z);
            body.walk(ray, Vec3A::Z, &mut numbers, ball)
                .map(|exit| exit.carried)
        };
        let mean = (0..4000).filter_map(walk).sum::<Vec3A>() / 4000.0;
        assert!((mean - 1.0).abs().max_element() < 2e-3, "{mean}");
    }

    /// What walks: an exponential way to the first collision. Without scattering a slab lets through
    /// `exp(-depth / path)`; standard error 0.2 %.
    #[test]
    fn what_does_not_scatter_falls_off_exponentially() {
        let body = body(1e-3, 0.0, Method::Plain);
        let path = body.free_path();
        let depth = 0.05;
        let slab = |ray: &Ray| (depth <= ray.t_max).then_some((depth, ()));
        let walk = |i: u32| {
            let mut numbers = Sampler::new(7, 1, [i, 0], 0, 1).walk(0);
            let exit = body.walk(
                Ray::new(Vec3A::ZERO, Vec3A::NEG_Z),
                Vec3A::Z,
                &mut numbers,
                slab,
            )?;
            (exit.ray.origin == Vec3A::ZERO).then_some(exit.carried)
        };
        let mean = (0..40_000).filter_map(walk).sum::<Vec3A>() / 40_000.0;
        let share = mean / body.medium().carried;
        let expected = (-depth / path).exp();
        assert!(
            (share - expected).abs().max_element() < 0.01,
            "{share} {expected}"
        );
    }
}
