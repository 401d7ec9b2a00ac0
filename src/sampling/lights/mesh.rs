//! An instance whose triangles glow, to both sides as in Cycles.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Vec2, Vec3A};

use super::{Emitter, LightClass, LightSample, Receiver};
use crate::math::luminance;
use crate::math::warp::sample_triangle;
use crate::sampling::discrete::Discrete;
use crate::scene::{Closure, ClosureKind, Image, SceneFrame};

/// Light of one closure: its radiance, and the image whose alpha lets some of it through unlit.
#[derive(Debug, Clone)]
struct Glow {
    radiance: Vec3A,
    alpha: Option<Arc<Image>>,
}

impl Glow {
    fn of(closure: &Closure, images: &[Arc<Image>]) -> Option<Self> {
        let alpha = match closure.kind {
            ClosureKind::Principled => closure.alpha.clamp(0.0, 1.0),
            ClosureKind::Emission => 1.0,
            _ => return None,
        };
        let image = closure
            .alpha_image
            .filter(|_| closure.kind == ClosureKind::Principled);
        let factor = closure.weight * if image.is_some() { 1.0 } else { alpha };
        let radiance = factor * closure.emission.max(Vec3A::ZERO);
        (radiance.max_element() > 0.0).then(|| Self {
            radiance,
            alpha: image.map(|i| images[i as usize].clone()),
        })
    }

    fn at(&self, uv: Vec2) -> Vec3A {
        let alpha = |image: &Arc<Image>| image.sample(uv).w.clamp(0.0, 1.0);
        self.radiance * self.alpha.as_ref().map_or(1.0, alpha)
    }
}

/// Radiance that leaves a point of a surface on its own, to either side.
pub fn emitted_radiance(
    frame: &SceneFrame,
    instance: u32,
    triangle: u32,
    barycentric: Vec2,
) -> Vec3A {
    let Some(material) = frame.material_of(instance, triangle) else {
        return Vec3A::ZERO;
    };
    let uv = || frame.uv(instance, triangle, barycentric);
    let glows = material.closures.iter();
    glows
        .filter_map(|closure| Glow::of(closure, &frame.images))
        .map(|glow| {
            glow.at(if glow.alpha.is_some() {
                uv()
            } else {
                Vec2::ZERO
            })
        })
        .sum()
}

#[derive(Debug)]
struct Facet {
    triangle: u32,
    corners: [Vec3A; 3],
    uvs: [Vec2; 3],
    /// Index into [`MeshLight::glows`].
    glow: u32,
}

impl Facet {
    /// Normal with the area as its length.
    fn area_normal(&self) -> Vec3A {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a)
    }
}

#[derive(Debug)]
pub(super) struct MeshLight {
    facets: Vec<Facet>,
    choice: Discrete,
    /// Glowing closures by material slot.
    glows: Vec<Vec<Glow>>,
    center: Vec3A,
    radius: f32,
    power: f32,
}

impl MeshLight {
    /// The light of an instance; `None` if no triangle of it glows.
    pub(super) fn new(frame: &SceneFrame, instance: u32) -> Option<Self> {
        let placed = &frame.instances[instance as usize];
        let glows: Vec<Vec<Glow>> = placed
            .materials
            .iter()
            .map(|&material| {
                let closures = frame.materials[material as usize].closures.iter();
                closures
                    .filter_map(|c| Glow::of(c, &frame.images))
                    .collect()
            })
            .collect();
        if glows.iter().all(Vec::is_empty) {
            return None;
        }
        let facets = facets(frame, instance, &glows);
        let powers: Vec<f32> = facets.iter().map(|f| power(f, &glows)).collect();
        let choice = Discrete::new(powers.iter().copied())?;
        let corners = || facets.iter().flat_map(|f| f.corners);
        let low = corners().fold(Vec3A::INFINITY, Vec3A::min);
        let high = corners().fold(Vec3A::NEG_INFINITY, Vec3A::max);
        Some(Self {
            choice,
            center: 0.5 * (low + high),
            radius: 0.5 * (high - low).length(),
            power: powers.iter().sum(),
            facets,
            glows,
        })
    }

    fn pdf_of_facet(&self, index: usize, offset: Vec3A) -> f32 {
        let distance_squared = offset.length_squared();
        let cos_times_area =
            offset.dot(self.facets[index].area_normal()).abs() / distance_squared.sqrt();
        let density = self.choice.pmf(index) * distance_squared / cos_times_area;
        if density.is_finite() { density } else { 0.0 }
    }
}

fn facets(frame: &SceneFrame, instance: u32, glows: &[Vec<Glow>]) -> Vec<Facet> {
    let placed = &frame.instances[instance as usize];
    let mesh = frame.mesh_of(instance);
    let slots = mesh.material_slots.iter().enumerate();
    slots
        .map(|(triangle, &slot)| (triangle as u32, (slot as usize).min(glows.len() - 1)))
        .filter(|&(_, slot)| !glows[slot].is_empty())
        .map(|(triangle, slot)| Facet {
            triangle,
            corners: mesh
                .corners(triangle)
                .map(|corner| placed.world_from_object.transform_point3a(corner)),
            uvs: mesh.corner_uvs[triangle as usize],
            glow: slot as u32,
        })
        .collect()
}

/// Power of a triangle to both sides, its alpha image left out.
fn power(facet: &Facet, glows: &[Vec<Glow>]) -> f32 {
    let radiance: Vec3A = glows[facet.glow as usize].iter().map(|g| g.radiance).sum();
    let power = TAU * luminance(radiance) * facet.area_normal().length();
    if power.is_finite() { power } else { 0.0 }
}

impl Emitter for MeshLight {
    /// The whole instance as a ball of its size around its middle.
    fn irradiance(&self, receiver: &Receiver) -> f32 {
        let to_center = self.center - receiver.point;
        let distance = to_center.length().max(self.radius).max(f32::MIN_POSITIVE);
        let above = receiver.normal.dot(to_center) + self.radius;
        let cos = (above / distance).clamp(0.0, 1.0);
        self.power * cos / (4.0 * PI * distance * distance)
    }

    fn power(&self, _: f32) -> f32 {
        self.power
    }

    fn sample(&self, receiver: &Receiver, u_choice: f32, u: [f32; 2]) -> Option<LightSample> {
        let (index, _, _) = self.choice.sample(u_choice);
        let facet = &self.facets[index];
        let b = sample_triangle(u);
        let weights = [1.0 - b.x - b.y, b.x, b.y];
        let mix = |k: usize| weights[k] * facet.corners[k];
        let offset = mix(0) + mix(1) + mix(2) - receiver.point;
        let uv = |k: usize| weights[k] * facet.uvs[k];
        let uv = uv(0) + uv(1) + uv(2);
        let distance = offset.length();
        let radiance: Vec3A = self.glows[facet.glow as usize]
            .iter()
            .map(|g| g.at(uv))
            .sum();
        let pdf_solid_angle = self.pdf_of_facet(index, offset);
        (pdf_solid_angle > 0.0 && distance > 0.0).then(|| LightSample {
            direction: offset / distance,
            distance,
            radiance: Some(radiance),
            pdf_solid_angle,
            is_delta: false,
            class: LightClass::Local,
        })
    }

    fn pdf_of_triangle(&self, triangle: u32, point: Vec3A, hit: Vec3A) -> f32 {
        let found = self.facets.binary_search_by_key(&triangle, |f| f.triangle);
        found.map_or(0.0, |index| self.pdf_of_facet(index, hit - point))
    }

    fn position(&self) -> Option<Vec3A> {
        Some(self.center)
    }
}
