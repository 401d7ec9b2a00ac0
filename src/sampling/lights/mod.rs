//! Where light comes from: choosing a light for a point, and a direction towards it.
//!
//! Every light is an [`Emitter`] in a file of its own. One is chosen by the irradiance that it may
//! give at the point: [`choice`] and, for many lights, [`tree`].
//!
//! Light sampling draws one light; [`LightSample::pdf_solid_angle`] holds the probability of that
//! choice. Light that a scattered ray runs into is joined to it by multiple importance sampling,
//! with the densities that [`LightSampler::environment_pdf`], [`LightSampler::emissive_pdf`] and
//! [`LightSampler::lamps_along`] give.
//!
//! # Departures from Cycles
//! An instance that glows is one light, whose triangles stand in a tree of their own. Of a closed one only
//! the outer side is sampled.

mod area;
mod choice;
mod environment;
mod mesh;
mod rectangle;
mod shaded;
mod sphere;
mod sun;
mod table;
mod tree;
mod triangle;

use std::sync::Arc;

use glam::Vec3A;

use super::sampler::LightUse;
use crate::kernel::InstanceBvh;
use crate::math::Ray;
use crate::scene::{Light, LightKind, Links, Reach, SceneFrame, World};
use crate::shader::{Point, RayKind};
use area::Area;
use choice::{Choice, Chosen, EVALUATED_MAX};
use environment::{ImageTables, SmallSky, lights_of};
pub use mesh::emitted_radiance;
use mesh::{MeshLight, Shape, glow_of};
use shaded::Shaded;
use sphere::{Cone, Sphere};
use sun::Sun;
use tree::Extent;

/// What a light's shadow edges are like, and so whether its light may be borrowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightClass {
    /// A distant, small and bright disk.
    Sun,
    /// The surroundings without their sun.
    Sky,
    /// A lamp or a glowing surface in the scene.
    Local,
}

/// Which lights get a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Strategy {
    /// One of all.
    One,
    /// The sky, and one of the others: the choice between sky and sun is the largest part of the
    /// noise outdoors, and a ray more is cheaper than the samples that it would take.
    SkyApart,
    /// One of all but the sky, which scattered rays find.
    WithoutSky,
    /// The small parts of the sky, and one of all but the sky; the rest of it is left to scattered
    /// rays. See [`LightSampler::set_small_sky`].
    SmallSkyApart,
}

impl Strategy {
    /// Whether the whole sky is among the lights.
    fn draws_sky(self) -> bool {
        matches!(self, Strategy::One | Strategy::SkyApart)
    }
}

/// A direction towards a light.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// Unit vector to the light, world space.
    pub direction: Vec3A,
    /// Distance to the light [m], infinite for a distant one.
    pub distance: f32,
    /// Where a ray that looks for the light ends, off the surface that shines; `None` where direction and
    /// distance say it.
    pub end: Option<Vec3A>,
    /// Radiance that arrives unless something is in between; for a light without extent, the
    /// irradiance on a facing plane, so that `f cos radiance / pdf_solid_angle` holds for both.
    /// `None` for the surroundings: [`LightSampler::radiance`] looks their image up once a shadow
    /// ray has got through.
    pub radiance: Option<Vec3A>,
    /// Density [1/sr], the probability of choosing the light included; for a light without extent
    /// that probability alone.
    pub pdf_solid_angle: f32,
    /// Whether the light has no extent, so that no other sampler can find it.
    pub is_delta: bool,
    /// Kind of light.
    pub class: LightClass,
    /// Which rays it lights; [`LightSampler::sample`] knows it, the emitters do not.
    pub reach: Reach,
}

/// A light as a ball, which holds all of it.
#[derive(Debug, Clone, Copy)]
pub struct LightBall {
    /// Its middle, world space.
    pub center: Vec3A,
    /// [m]
    pub radius: f32,
    /// Its greatest radiant intensity, as the light tree has it.
    pub intensity: f32,
}

impl From<Extent> for LightBall {
    fn from(extent: Extent) -> Self {
        Self {
            center: 0.5 * (extent.low + extent.high),
            radius: 0.5 * (extent.high - extent.low).length(),
            intensity: extent.intensity,
        }
    }
}

/// With more lights than this nobody asks for all of them.
const BALLS: usize = 64;

/// A lamp that a ray runs into.
#[derive(Debug, Clone, Copy)]
pub struct LightHit {
    /// Ray parameter, infinite for a sun.
    pub t: f32,
    /// Radiance towards the ray's origin.
    pub radiance: Vec3A,
    /// Density [1/sr] with which light sampling would have drawn this direction.
    pub pdf_solid_angle: f32,
    /// What it lights; [`LightSampler::lamps_along`] knows it, the emitters do not.
    pub links: Links,
}

/// A point that light arrives at.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// World space [m].
    pub point: Vec3A,
    /// The side that light must come from.
    pub normal: Vec3A,
    /// When it arrives: a share of the shutter's time.
    pub time: f32,
}

/// One light.
trait Emitter: Send + Sync {
    /// About how much light a plane at the receiver gets [luminance of W/m^2]; zero only where the
    /// light gives none.
    fn irradiance(&self, receiver: &Receiver) -> f32;

    /// A direction to it; densities are without the probability of choosing this light.
    fn sample(&self, receiver: &Receiver, u_choice: f32, u: [f32; 2]) -> Option<LightSample>;

    /// What a ray with a unit direction meets, for lamps; `normal` is that of its origin.
    fn intersect(&self, _ray: &Ray, _normal: Vec3A) -> Option<LightHit> {
        None
    }

    /// Density [1/sr] of a direction, for the surroundings.
    fn pdf_of_direction(&self, _receiver: &Receiver, _direction: Vec3A) -> f32 {
        0.0
    }

    /// Density [1/sr] of the point `hit` on a triangle, for glowing instances.
    fn pdf_of_triangle(&self, _receiver: &Receiver, _triangle: u32, _hit: Vec3A) -> f32 {
        0.0
    }

    /// Whether this is the sun of the surroundings and shines from this direction.
    fn is_sun(&self, _direction: Vec3A) -> bool {
        false
    }

    /// Where it is and where it shines, unless far away.
    fn extent(&self) -> Option<Extent> {
        None
    }
}

/// All lights of a frame.
pub struct LightSampler {
    lights: Vec<Box<dyn Emitter>>,
    /// Which rays each light lights.
    reaches: Vec<Reach>,
    /// Lamps stand first in `lights`, the parts of the surroundings follow.
    lamps: usize,
    environment: std::ops::Range<usize>,
    /// The surroundings without their sun.
    sky: Option<usize>,
    small_sky: Option<Arc<SmallSky>>,
    /// Glowing instances, in rising order, with what their lights are drawn from; these come last in
    /// `lights`.
    glowing: Vec<(u32, Arc<Shape>)>,
    /// Whether something glows that only rays find.
    has_unsampled: bool,
    choice: Choice,
    /// Where there are too many lamps to ask each whether a ray meets it.
    lamp_finder: Option<LampFinder>,
    /// The lights that have a place, unless they are too many.
    balls: Vec<LightBall>,
    world: World,
    image_tables: Option<Arc<ImageTables>>,
}

impl LightSampler {
    /// The lights of a frame. What is costly to make, the tables of the world's image and the trees over
    /// glowing triangles, is taken over from another frame's lights if it fits.
    pub fn build(frame: &SceneFrame, previous: Option<&LightSampler>) -> Self {
        let lamps = frame.lights.iter();
        let (mut lights, mut reaches): (Vec<_>, Vec<_>) = lamps
            .filter_map(|light| Some((lamp_with_nodes(frame, light)?, light.reach)))
            .unzip();
        let lamps = lights.len();
        let tables = previous.and_then(|p| p.image_tables.as_ref());
        let (sky, sun, image_tables) = lights_of(&frame.world, tables);
        let sky_index = sky.as_ref().map(|_| lamps);
        lights.extend(sky.map(|sky| Box::new(sky) as Box<dyn Emitter>));
        lights.extend(sun.map(|sun| Box::new(sun) as Box<dyn Emitter>));
        let environment = lamps..lights.len();
        reaches.resize(lights.len(), frame.world.reach);
        let mut glowing = Vec::new();
        for instance in 0..frame.instances.len() as u32 {
            let shape = previous.and_then(|p| p.glowing_shape(instance));
            if let Some(light) = MeshLight::new(frame, instance, shape) {
                glowing.push((instance, light.shape().clone()));
                lights.push(Box::new(light));
                reaches.push(reach_of_surface(frame, instance));
            }
        }
        let extents = lights.iter().filter_map(|light| light.extent());
        let balls = match extents.clone().count() <= BALLS {
            true => extents.map(LightBall::from).collect(),
            false => Vec::new(),
        };
        Self {
            choice: Choice::new(&lights),
            lamp_finder: (lamps > EVALUATED_MAX).then(|| LampFinder::new(&lights[..lamps])),
            lights,
            reaches,
            lamps,
            environment,
            sky: sky_index,
            small_sky: None,
            glowing,
            has_unsampled: frame.materials.iter().any(|m| m.emission.asks_around()),
            world: frame.world.clone(),
            image_tables,
            balls,
        }
    }

    /// Makes the parts of the sky for which `is_small` holds (a direction of world space) a light for
    /// [`Strategy::SmallSkyApart`].
    pub fn set_small_sky(&mut self, world: &World, is_small: impl Fn(Vec3A) -> bool) {
        let (sky, ..) = lights_of(world, self.image_tables.as_ref());
        self.small_sky = sky.and_then(|sky| sky.small_parts(is_small)).map(Arc::new);
    }

    /// Takes the small parts of the sky over from another frame's lights.
    pub fn take_small_sky(&mut self, previous: &Self) {
        self.small_sky.clone_from(&previous.small_sky);
    }

    /// Whether a direction lies in the small parts of the sky.
    pub fn is_small_sky(&self, direction: Vec3A) -> bool {
        let small = self.small_sky.as_ref();
        small.is_some_and(|small| small.pdf(direction) > 0.0)
    }

    /// Number of lights.
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Whether the frame has no light at all.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// The lights that have a place, or none where they are too many to ask each.
    pub fn balls(&self) -> &[LightBall] {
        &self.balls
    }

    /// Whether a ray can run into a light other than the surroundings.
    pub fn can_be_met(&self) -> bool {
        self.lamps > 0 || !self.glowing.is_empty() || self.has_unsampled
    }

    /// Lights and directions to them from a point. Their contributions add up.
    pub fn sample(
        &self,
        receiver: &Receiver,
        strategy: Strategy,
        numbers: &LightUse,
        sky_numbers: impl FnOnce() -> [f32; 2],
    ) -> [Option<LightSample>; 2] {
        let one = || {
            let chosen = self.choose(receiver, strategy, numbers)?;
            let Chosen {
                index,
                probability,
                u,
            } = chosen;
            self.sample_light(index, probability, receiver, u, numbers.direction)
        };
        match strategy {
            Strategy::One | Strategy::WithoutSky => [one(), None],
            Strategy::SkyApart => {
                let sky = |sky| self.sample_light(sky, 1.0, receiver, 0.0, sky_numbers());
                [one(), self.sky.and_then(sky)]
            }
            Strategy::SmallSkyApart => {
                let small = self.small_sky.as_ref();
                [one(), small.and_then(|small| small.sample(sky_numbers()))]
            }
        }
    }

    fn sample_light(
        &self,
        index: usize,
        pmf: f32,
        receiver: &Receiver,
        u_choice: f32,
        u: [f32; 2],
    ) -> Option<LightSample> {
        let mut sample = self.lights[index].sample(receiver, u_choice, u)?;
        sample.pdf_solid_angle *= pmf;
        sample.reach = self.reaches[index];
        Some(sample)
    }

    /// [`LightSample::radiance`], looked up.
    pub fn radiance(&self, sample: &LightSample) -> Vec3A {
        sample
            .radiance
            .unwrap_or_else(|| self.world.radiance(sample.direction))
    }

    /// Radiance of the surroundings, their sun included, lamps not, for a ray of this kind from
    /// this vertex of a path.
    pub fn environment_radiance(&self, direction: Vec3A, kind: RayKind, vertex: u32) -> Vec3A {
        match kind {
            _ if !self.world.reach.includes(kind, vertex) => Vec3A::ZERO,
            RayKind::Camera => self.world.radiance_for_camera(direction),
            _ => self.world.radiance(direction),
        }
    }

    /// Whether the surroundings' sun, which is a light apart from their sky, is in this direction.
    pub fn is_sun(&self, direction: Vec3A) -> bool {
        let mut environment = self.lights[self.environment.clone()].iter();
        environment.any(|light| light.is_sun(direction))
    }

    /// Density [1/sr] with which [`LightSampler::sample`] draws this direction from the
    /// surroundings.
    pub fn environment_pdf(
        &self,
        receiver: &Receiver,
        strategy: Strategy,
        direction: Vec3A,
    ) -> f32 {
        let small = match (&self.small_sky, strategy) {
            (Some(small), Strategy::SmallSkyApart) => small.pdf(direction),
            _ => 0.0,
        };
        let drawn = |&index: &usize| self.sky != Some(index) || strategy.draws_sky();
        let densities = self.environment.clone().filter(drawn).map(|index| {
            let density = self.lights[index].pdf_of_direction(receiver, direction);
            if density > 0.0 {
                density * self.pmf(index, strategy, receiver)
            } else {
                0.0
            }
        });
        small + densities.sum::<f32>()
    }

    /// The lamps that a ray with a unit direction meets up to its end; a sun only if it has none.
    /// Lamps hide nothing, so all of them count. `normal` is that of the ray's origin and enters
    /// the density only. Lamps that rays of this kind from this vertex of a path do not see are
    /// not met.
    pub fn lamps_along(
        &self,
        ray: &Ray,
        normal: Vec3A,
        strategy: Strategy,
        kind: RayKind,
        vertex: u32,
    ) -> impl Iterator<Item = LightHit> {
        let receiver = Receiver {
            point: ray.origin,
            normal,
            time: ray.time,
        };
        let (all, found) = match &self.lamp_finder {
            Some(finder) => (0..0, finder.candidates(ray)),
            None => (0..self.lamps, Vec::new()),
        };
        let lamps = all.chain(found.into_iter().map(|lamp| lamp as usize));
        let visible = lamps.filter(move |&index| self.reaches[index].includes(kind, vertex));
        visible.filter_map(move |index| {
            let mut hit = self.lights[index].intersect(ray, normal)?;
            hit.pdf_solid_angle *= self.pmf(index, strategy, &receiver);
            hit.links = self.reaches[index].links;
            Some(hit)
        })
    }

    /// Density [1/sr] with which [`LightSampler::sample`] draws the point `hit` on a glowing
    /// triangle; zero for one that does not glow.
    pub fn emissive_pdf(
        &self,
        receiver: &Receiver,
        strategy: Strategy,
        instance: u32,
        triangle: u32,
        hit: Vec3A,
    ) -> f32 {
        let Some(index) = self.glowing_index(instance) else {
            return 0.0;
        };
        let index = self.environment.end + index;
        let density = self.lights[index].pdf_of_triangle(receiver, triangle, hit);
        density * self.pmf(index, strategy, receiver)
    }

    fn glowing_index(&self, instance: u32) -> Option<usize> {
        let found = self
            .glowing
            .binary_search_by_key(&instance, |(glowing, _)| *glowing);
        found.ok()
    }

    fn glowing_shape(&self, instance: u32) -> Option<&Arc<Shape>> {
        Some(&self.glowing[self.glowing_index(instance)?].1)
    }

    fn choose(
        &self,
        receiver: &Receiver,
        strategy: Strategy,
        numbers: &LightUse,
    ) -> Option<Chosen> {
        let is_among = |index| self.is_among(index, strategy);
        let (u, inside) = (numbers.choice, numbers.inside);
        self.choice
            .choose(&self.lights, receiver, is_among, u, inside)
    }

    /// Probability of choosing a light.
    fn pmf(&self, index: usize, strategy: Strategy, receiver: &Receiver) -> f32 {
        if !self.is_among(index, strategy) {
            return f32::from(u8::from(strategy == Strategy::SkyApart));
        }
        let is_among = |index| self.is_among(index, strategy);
        self.choice.pmf(&self.lights, receiver, is_among, index)
    }

    /// Whether a light is among those of which one is chosen.
    fn is_among(&self, index: usize, strategy: Strategy) -> bool {
        strategy == Strategy::One || self.sky != Some(index)
    }
}

/// From this solid angle [sr] on directions are drawn evenly instead of points: below it both are alike.
const LARGE: f32 = 0.2;

/// Keeps sums of weights finite.
const WEIGHT_MAX: f32 = 1e30;

/// The emitter of a lamp, its nodes included; `None` for one that cannot shine.
fn lamp_with_nodes(frame: &SceneFrame, light: &Light) -> Option<Box<dyn Emitter>> {
    let Some(material) = light.material else {
        return lamp(light);
    };
    let nodes = &frame.materials[material as usize].emission;
    if nodes.is_uniform() {
        let power = light.power * glow_of(nodes, &Point::nowhere(), &[]);
        return lamp(&Light { power, ..*light });
    }
    Some(Box::new(Shaded::new(lamp(light)?, light, nodes, frame)))
}

/// The emitter of a lamp without its nodes; `None` for one that cannot shine.
fn lamp(light: &Light) -> Option<Box<dyn Emitter>> {
    let (placement, power) = (&light.world_from_light, light.power);
    if power == Vec3A::ZERO || !power.is_finite() {
        return None;
    }
    let sphere = |radius, soft, cone| Box::new(Sphere::new(placement, power, radius, soft, cone));
    let area = |size, spread, shape| {
        let area = Area::new(placement, power, size, spread, shape)?;
        Some(Box::new(area) as Box<dyn Emitter>)
    };
    match light.kind {
        LightKind::Sun { angle } => Some(Box::new(Sun::new(placement, power, angle))),
        LightKind::Point {
            radius,
            soft_falloff,
        } => Some(sphere(radius, soft_falloff, None)),
        LightKind::Spot {
            radius,
            soft_falloff,
            cone_angle,
            blend,
        } => {
            let cone = Cone::new(placement, light.scale, cone_angle, blend);
            Some(sphere(radius, soft_falloff, Some(cone)))
        }
        LightKind::AreaRectangle { size, spread } => area(size, spread, area::Shape::Rectangle),
        LightKind::AreaEllipse { size, spread } => area(size, spread, area::Shape::Ellipse),
    }
}

/// The rays that a glowing surface lights: those that see it. It is a light like any other, whether
/// or not it stops that of others.
fn reach_of_surface(frame: &SceneFrame, instance: u32) -> Reach {
    let instance = &frame.instances[instance as usize];
    Reach {
        visibility: instance.visibility.with(RayKind::Shadow),
        links: instance.links,
        ..Reach::ALL
    }
}

/// The lamps that a ray may meet, where they are many.
struct LampFinder {
    boxes: InstanceBvh,
    /// Lamps without a place: every ray may meet them.
    far: Vec<u32>,
}

impl LampFinder {
    fn new(lamps: &[Box<dyn Emitter>]) -> Self {
        let nowhere = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let extents: Vec<_> = lamps.iter().map(|lamp| lamp.extent()).collect();
        let far = (0u32..).zip(&extents).filter(|(_, e)| e.is_none());
        let boxes = extents
            .iter()
            .map(|extent| extent.map_or(nowhere, |e| (e.low, e.high)));
        Self {
            far: far.map(|(lamp, _)| lamp).collect(),
            boxes: InstanceBvh::build(&boxes.collect::<Vec<_>>()),
        }
    }

    /// In rising order, so that sums over them do not depend on the tree.
    fn candidates(&self, ray: &Ray) -> Vec<u32> {
        let mut found = Vec::new();
        self.boxes.closest(ray, |lamp, _| {
            found.push(lamp);
            None
        });
        if ray.t_max == f32::INFINITY {
            found.extend(&self.far);
        }
        found.sort_unstable();
        found
    }
}

#[cfg(test)]
mod tests;
