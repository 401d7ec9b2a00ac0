//! What a ray finds at a hit: the triangle's geometry, and what its material's program makes of it.

use std::f32::consts::TAU;

use glam::{Quat, Vec2, Vec3A};

use crate::accel::Hit;
use crate::math::{Ray, facing, offset_origin};
use crate::media::Collision;
use crate::optics::ThinFilm;
use crate::optics::fresnel::Fresnel;
use crate::sampling::{Brushed, Bsdf, Guides, LightSample, Principled, alpha_of};
use crate::scene::{Facet, Material, Membership, SceneFrame};
use crate::shader::{
    self, Closure, Glass, Glossy, Metal, Metallic, Point, RayInfo, RayKind, Strand,
    SubsurfaceMethod,
};
use crate::subsurface::Subsurface;

mod hair;

/// A point on a surface, seen along a ray.
#[derive(Clone)]
pub struct Surface {
    /// The hit.
    pub hit: Hit,
    /// World space [m].
    pub position: Vec3A,
    /// Unit normal of the triangle on the viewer's side, world space.
    pub geometric_normal: Vec3A,
    /// Unit shading normal on the viewer's side, world space.
    pub normal: Vec3A,
    /// How it reflects.
    pub bsdf: Bsdf,
    /// Light that enters and leaves elsewhere.
    pub below: Vec<Subsurface>,
    /// Radiance that it emits towards the viewer.
    pub emission: Vec3A,
    /// The sets of things that it is in.
    pub membership: Membership,
    /// Share of it that is a hole in the picture.
    pub holdout: f32,
    /// Whether it is a point of a medium, and no surface at all.
    pub is_medium: bool,
    /// Whether light samples are taken elsewhere, all along the ray.
    pub is_lit_apart: bool,
    /// What densities of rays from there count for beside light samples, whose points are drawn elsewhere.
    pub odds: f32,
    /// Distance along the ray.
    pub distance: f32,
    /// See-through surfaces that the path passed before it.
    pub passed: u32,
    /// When the ray found it: the share of the shutter's time that has passed.
    pub time: f32,
    /// The strand of hair that it is: rays leave it where they leave the strand.
    strand: Option<Strand>,
    /// Height [m] above the triangle below which a ray may meet it again.
    clearance: f32,
}

/// [`Surface::clearance`] per metre of the triangle. The test of a ray against a triangle rounds
/// the corners relative to the ray's origin, so its error grows with the triangle: eight units in
/// the last place of the longest edge.
const CLEARANCE: f32 = 8.0 * f32::EPSILON;

impl Surface {
    /// A ray from the surface that does not meet it again at once.
    pub fn ray_towards(&self, direction: Vec3A) -> Ray {
        if self.is_medium {
            return Ray::new(self.position, direction).at_time(self.time);
        }
        if let Some(strand) = &self.strand {
            let t_min = strand.way_out(direction) + self.clearance;
            let ray = Ray::new(self.position, direction).at_time(self.time);
            return Ray { t_min, ..ray };
        }
        let out = facing(self.geometric_normal, direction);
        let origin = offset_origin(self.position + self.clearance * out, out);
        Ray::new(origin, direction).at_time(self.time)
    }

    /// A ray to a light. It starts on the smooth form of the surface, more so the lower the light stands,
    /// as in Cycles, and ends where the light is seen from there.
    pub fn ray_to_light(&self, frame: &SceneFrame, light: &LightSample) -> Ray {
        let off = self.ray_towards(light.direction);
        let origin = self.lifted_origin(frame, light.direction);
        let origin = origin.unwrap_or(off.origin);
        if light.distance.is_infinite() {
            return Ray { origin, ..off };
        }
        let end = light.end;
        let end = end.unwrap_or_else(|| self.position + light.distance * light.direction);
        let t_max = (end - origin).length();
        let direction = (end - origin) / t_max;
        Ray {
            t_min: off.t_min,
            t_max,
            ..Ray::new(origin, direction).at_time(self.time)
        }
    }

    /// Where rays to a light in this direction start, if not from the triangle.
    fn lifted_origin(&self, frame: &SceneFrame, direction: Vec3A) -> Option<Vec3A> {
        let side = match self.normal.dot(direction) < 0.0 {
            true => -1.0,
            false => 1.0,
        };
        let amount = self.lift_amount(frame, side * direction);
        if amount <= 0.0 {
            return None;
        }
        let facet = Facet::new(frame, self.hit.instance, self.hit.triangle, self.time);
        let side = side * self.geometric_normal;
        let lift = amount * facet.lift(Vec2::new(self.hit.u, self.hit.v), side);
        // Above the triangle, also where the light is below it: it may pass by its edge.
        let foot = self.position + self.clearance * side + lift;
        Some(offset_origin(foot, side))
    }

    /// How much of the way to the smooth form, for light on this side of it: all of it at the horizon,
    /// none where both normals are far enough from it.
    fn lift_amount(&self, frame: &SceneFrame, direction: Vec3A) -> f32 {
        if self.is_medium || self.strand.is_some() {
            return 0.0;
        }
        let cutoff = frame.instances[self.hit.instance as usize].lift_cosine;
        if cutoff <= 0.0 {
            return 0.0;
        }
        let smooth = self.normal.dot(direction);
        let flat = self.geometric_normal.dot(direction);
        let amount = match smooth < cutoff {
            true => 2.0 - (flat + smooth) / cutoff,
            false => 1.0 - flat / cutoff,
        };
        amount.clamp(0.0, 1.0)
    }

    /// A ray that starts on the surface itself and does not meet it at once: below it, a mean free
    /// path may be no longer than what keeps other rays off it.
    pub fn ray_into(&self, direction: Vec3A) -> Ray {
        let off = self.ray_towards(direction);
        let height = off.origin.distance(self.position);
        let cos = direction.dot(self.geometric_normal).abs();
        Ray {
            origin: self.position,
            t_min: height / cos.max(1e-3),
            ..off
        }
    }

    /// The same surface if it only shone, by this factor.
    pub fn glowing_alone(self, factor: f32) -> Self {
        let bsdf = Bsdf::new(self.geometric_normal, -self.geometric_normal, true);
        Self {
            bsdf,
            below: Vec::new(),
            emission: self.emission * factor,
            ..self
        }
    }

    /// Puts it behind glass that lets this share of its light pass.
    pub fn put_behind(&mut self, share: Vec3A) {
        if share != Vec3A::ONE {
            self.bsdf.tint(share);
            self.emission *= share;
            for below in &mut self.below {
                below.weight *= share;
            }
        }
    }

    /// Share of white light that comes back, from below the surface too.
    pub fn albedo(&self) -> Vec3A {
        self.bsdf.albedo() + self.albedo_below()
    }

    fn albedo_below(&self) -> Vec3A {
        self.below.iter().map(|below| below.weight).sum()
    }

    /// The same, as passes divide it: see [`Bsdf::colors`].
    pub fn colors(&self) -> [Vec3A; 3] {
        let mut colors = self.bsdf.colors();
        colors[0] += self.albedo_below();
        colors
    }

    /// What denoisers are told of it: see [`Bsdf::guides`].
    pub fn guides(&self, clear_alpha: f32) -> Guides {
        let below = self.below.iter();
        let below = below.map(|below| (below.weight, below.normal));
        self.bsdf.guides(clear_alpha, below)
    }

    /// The shading normal on the side of the surface that `direction` leaves to.
    pub fn normal_towards(&self, direction: Vec3A) -> Vec3A {
        if direction.dot(self.geometric_normal) < 0.0 {
            -self.normal
        } else {
            self.normal
        }
    }
}

/// Reflectance of a surface without a material: Blender's default grey.
const DEFAULT_COLOR: Vec3A = Vec3A::splat(0.8);

/// [`Surface::clearance`] of a point.
fn clearance_of(point: &Point) -> f32 {
    let [one, other] = point.edges.map(Vec3A::abs);
    CLEARANCE * one.max(other).max_element()
}

/// A ray from a point that does not meet its triangle at once.
pub fn ray_off(point: &Point, direction: Vec3A) -> Ray {
    let out = facing(point.geometric_normal, direction);
    let origin = offset_origin(point.position + clearance_of(point) * out, out);
    Ray::new(origin, direction)
}

/// The surface that `ray` meets at `hit`.
#[inline]
pub fn at(frame: &SceneFrame, hit: &Hit, ray: &Ray, info: &RayInfo) -> Surface {
    let facet = Facet::new(frame, hit.instance, hit.triangle, ray.time);
    let point = point_of(&facet, hit, ray, info);
    // Filled in place: a surface is large to copy.
    let mut surface = bare(frame, hit, &point, ray.time);
    surface.shade(frame, &point);
    surface
}

/// A surface that scatters nothing yet.
#[inline(always)]
fn bare(frame: &SceneFrame, hit: &Hit, point: &Point, time: f32) -> Surface {
    Surface {
        hit: *hit,
        position: point.position,
        geometric_normal: point.geometric_normal,
        normal: point.normal,
        bsdf: Bsdf::new(point.geometric_normal, point.incoming, !point.is_back)
            .with_smooth_normal(point.normal),
        below: Vec::new(),
        emission: Vec3A::ZERO,
        membership: frame.instances[hit.instance as usize].membership,
        holdout: 0.0,
        is_medium: false,
        is_lit_apart: false,
        odds: 1.0,
        distance: hit.t,
        passed: 0,
        time,
        strand: None,
        clearance: clearance_of(point),
    }
}

fn point_of<'a>(facet: &'a Facet<'a>, hit: &Hit, ray: &Ray, info: &'a RayInfo<'a>) -> Point<'a> {
    let ray_length = hit.t * ray.direction.length();
    facet.point(Vec2::new(hit.u, hit.v), ray.direction, ray_length, info)
}

impl Surface {
    /// Adds what the closures scatter and shine, given that the ray did not pass straight on.
    fn shade(&mut self, frame: &SceneFrame, point: &Point) {
        let Some(material) = frame.material_of(self.hit.instance, self.hit.triangle) else {
            let color = DEFAULT_COLOR;
            self.bsdf.add_diffuse(Vec3A::ONE, color, point.normal, 0.0);
            return;
        };
        self.bsdf.set_bump_correction(material.has_bump_correction);
        // A surface that stops a fraction of the rays, and is seen by those, reflects its weight
        // over that fraction.
        let stopped = 1.0 - Passage::of(frame, material, point).probability;
        let scale = if stopped > 0.0 { 1.0 / stopped } else { 0.0 };
        material.surface.run(point, &frame.images, &mut |closure| {
            self.add(closure, scale, point);
        });
    }

    fn add(&mut self, closure: &Closure, scale: f32, point: &Point) {
        let bsdf = &mut self.bsdf;
        let scaled = |weight: f32| Vec3A::splat(weight * scale);
        let bent = |normal: Vec3A| normal_at(point, normal);
        match *closure {
            Closure::Principled(ref p) => {
                let below = bsdf.add_principled(scaled(p.weight), &principled(p, point));
                if below != Vec3A::ZERO {
                    self.add_subsurface(below_principled(p, below, point), point);
                }
            }
            Closure::Diffuse {
                weight,
                color,
                roughness,
                normal,
            } => bsdf.add_diffuse(scaled(weight), color, bent(normal), roughness),
            Closure::Glossy(ref glossy) => add_glossy(bsdf, glossy, scaled(glossy.weight), point),
            Closure::Metallic(ref m) => add_metallic(bsdf, m, scaled(m.weight), point),
            Closure::Glass(ref glass) => add_glass(bsdf, glass, scaled(glass.weight), point),
            Closure::Refraction(glass) => {
                let weight = scaled(glass.weight) * glass.color.max(Vec3A::ZERO);
                bsdf.add_refraction(
                    weight,
                    bent(glass.normal),
                    glass.roughness,
                    glass.ior,
                    glass.distribution,
                );
            }
            Closure::Translucent {
                weight,
                color,
                normal,
            } => bsdf.add_translucent(scaled(weight) * color.max(Vec3A::ZERO), bent(normal)),
            Closure::Sheen {
                weight,
                color,
                roughness,
                normal,
                is_velvet,
            } => {
                let weight = scaled(weight) * color.max(Vec3A::ZERO);
                if is_velvet {
                    bsdf.add_velvet(weight, bent(normal), roughness);
                } else {
                    bsdf.add_sheen(weight, bent(normal), roughness);
                }
            }
            Closure::Toon(toon) => {
                let weight = scaled(toon.weight) * toon.color.max(Vec3A::ZERO);
                let normal = bent(toon.normal);
                bsdf.add_toon(weight, normal, toon.size, toon.smooth, toon.is_glossy);
            }
            Closure::Hair(ref hair) => self.add_hair(hair, scaled(hair.weight), point),
            Closure::Streak(ref s) => self.add_streak(s, scaled(s.weight), point),
            Closure::Subsurface(ref s) => {
                self.add_subsurface(below_node(s, scaled(s.weight), point), point);
            }
            Closure::Emission(radiance) => self.emission += radiance * scale,
            Closure::Holdout(weight) => self.holdout += weight * scale,
            Closure::Normal(normal) => bsdf.set_smooth_normal(bent(normal)),
            Closure::Transparent(_)
            | Closure::Volume(_)
            | Closure::Displacement { .. }
            | Closure::Output { .. } => {}
        }
    }
}

impl Surface {
    /// Adds subsurface scattering; where it does not spread, or behind a diffuse surface, where Cycles
    /// does without it too, it is diffuse reflection.
    fn add_subsurface(&mut self, below: Subsurface, point: &Point) {
        let spreads = match point.ray.diffuse_depth {
            0 => below.spreads(),
            _ => Vec3A::ZERO,
        };
        let rest = below.weight * (1.0 - spreads);
        let normal = self.bsdf.reflecting_normal(below.normal);
        self.bsdf.add_diffuse(rest, Vec3A::ONE, normal, 0.0);
        let below = Subsurface {
            weight: below.weight * spreads,
            normal,
            ..below
        };
        if below.weight != Vec3A::ZERO {
            self.below.push(below);
        }
    }
}

/// What lies below a Principled BSDF, of which this weight is left.
fn below_principled(p: &shader::Principled, weight: Vec3A, point: &Point) -> Subsurface {
    let node = shader::Subsurface {
        weight: 1.0,
        color: p.base_color,
        scale: p.subsurface_scale,
        radius: p.subsurface_radius,
        ior: match p.subsurface_method {
            SubsurfaceMethod::Skin => p.subsurface_ior,
            _ => p.ior,
        },
        roughness: p.roughness,
        anisotropy: p.subsurface_anisotropy,
        normal: p.normal,
        method: p.subsurface_method,
    };
    below_node(&node, weight, point)
}

/// The same for a Subsurface Scattering node.
fn below_node(s: &shader::Subsurface, weight: Vec3A, point: &Point) -> Subsurface {
    let color = s.color.clamp(Vec3A::ZERO, Vec3A::ONE);
    Subsurface {
        weight: weight * color,
        color,
        radius: (s.radius * s.scale).max(Vec3A::ZERO),
        anisotropy: s.anisotropy.clamp(0.0, 0.9),
        ior: s.ior.clamp(1.01, 3.8),
        alpha: match s.method {
            SubsurfaceMethod::Skin => 1.0,
            _ => alpha_of(s.roughness),
        },
        normal: normal_at(point, s.normal),
        incoming: point.incoming,
        method: s.method,
    }
}

/// Where a medium scatters a ray.
pub fn in_medium(ray: &Ray, collision: &Collision) -> Surface {
    let Collision {
        t,
        weight,
        anisotropy,
    } = *collision;
    let viewer = -ray.direction;
    let mut bsdf = Bsdf::new(viewer, viewer, true);
    bsdf.add_phase(weight, anisotropy);
    Surface {
        hit: Hit {
            t,
            instance: 0,
            triangle: 0,
            u: 0.0,
            v: 0.0,
        },
        position: ray.at(t),
        geometric_normal: viewer,
        normal: viewer,
        bsdf,
        below: Vec::new(),
        emission: Vec3A::ZERO,
        membership: Membership::ALL,
        holdout: 0.0,
        is_medium: true,
        is_lit_apart: false,
        odds: 1.0,
        distance: t,
        passed: 0,
        time: ray.time,
        strand: None,
        clearance: 0.0,
    }
}

/// Where light from below the surface, along `ray`, comes out at `hit`: a white Lambert surface, seen from
/// outside.
pub fn exit(frame: &SceneFrame, hit: &Hit, ray: &Ray, info: &RayInfo) -> Surface {
    let facet = Facet::new(frame, hit.instance, hit.triangle, ray.time);
    let outside = Ray {
        direction: -ray.direction,
        ..*ray
    };
    let point = point_of(&facet, hit, &outside, info);
    let mut surface = bare(frame, hit, &point, ray.time);
    let normal = bumped_normal(frame, hit, &point);
    let normal = surface.bsdf.reflecting_normal(normal);
    surface
        .bsdf
        .add_diffuse(Vec3A::ONE, Vec3A::ONE, normal, 0.0);
    surface
}

/// The normal of the surface's subsurface scattering.
fn bumped_normal(frame: &SceneFrame, hit: &Hit, point: &Point) -> Vec3A {
    let mut normal = Vec3A::ZERO;
    if let Some(material) = frame.material_of(hit.instance, hit.triangle) {
        let images = &frame.images;
        material
            .surface
            .run(point, images, &mut |closure| match closure {
                Closure::Principled(p) if p.subsurface_weight > 0.0 => normal = p.normal,
                Closure::Subsurface(s) => normal = s.normal,
                _ => {}
            });
    }
    normal_at(point, normal)
}

/// Hands over what passes of the user's own show of a camera ray's hit: name, colour and number.
pub fn outputs(
    frame: &SceneFrame,
    hit: &Hit,
    ray: &Ray,
    info: &RayInfo,
    emit: &mut dyn FnMut(u32, Vec3A, f32),
) {
    let material = frame.material_of(hit.instance, hit.triangle);
    let Some(material) = material.filter(|material| !material.output.is_empty()) else {
        return;
    };
    let facet = Facet::new(frame, hit.instance, hit.triangle, ray.time);
    let point = point_of(&facet, hit, ray, info);
    material.output.run(&point, &frame.images, &mut |closure| {
        if let Closure::Output { name, color, value } = *closure {
            emit(name, color, value);
        }
    });
}

fn add_glossy(bsdf: &mut Bsdf, glossy: &Glossy, weight: Vec3A, point: &Point) {
    let normal = normal_at(point, glossy.normal);
    let turn = Quat::from_axis_angle(normal.into(), TAU * glossy.rotation);
    let grain = (glossy.anisotropy, turn * tangent_at(point, glossy.tangent));
    bsdf.add_glossy(
        weight,
        glossy.color,
        normal,
        glossy.roughness,
        grain,
        glossy.distribution,
    );
}

fn add_glass(bsdf: &mut Bsdf, glass: &Glass, weight: Vec3A, point: &Point) {
    let film = ThinFilm::new(glass.thin_film_thickness, glass.thin_film_ior);
    bsdf.add_glass(
        weight,
        glass.color,
        normal_at(point, glass.normal),
        glass.roughness,
        (glass.ior, film),
        glass.distribution,
    );
}

fn add_metallic(bsdf: &mut Bsdf, metallic: &Metallic, weight: Vec3A, point: &Point) {
    let film = ThinFilm::new(metallic.thin_film_thickness, metallic.thin_film_ior);
    let fresnel = match metallic.metal {
        Metal::Conductor { index, extinction } => Fresnel::conductor(index, extinction, film),
        Metal::Colors { base, edge_tint } => Fresnel::metal(base, edge_tint, film),
    };
    let brushed = Brushed {
        normal: normal_at(point, metallic.normal),
        roughness: metallic.roughness,
        anisotropic: metallic.anisotropy,
        rotation: metallic.rotation,
        tangent: tangent_at(point, metallic.tangent),
    };
    bsdf.add_metallic(weight, fresnel, &brushed, metallic.distribution);
}

/// What the node's inputs mean here.
fn principled(p: &shader::Principled, point: &Point) -> Principled {
    let normal = normal_at(point, p.normal);
    Principled {
        base_color: p.base_color,
        metallic: p.metallic,
        roughness: p.roughness,
        diffuse_roughness: p.diffuse_roughness,
        ior: p.ior,
        specular_level: p.specular_ior_level,
        specular_tint: p.specular_tint.max(Vec3A::ZERO),
        anisotropic: p.anisotropic,
        anisotropic_rotation: p.anisotropic_rotation,
        tangent: tangent_at(point, p.tangent),
        transmission: p.transmission_weight,
        subsurface: p.subsurface_weight,
        coat: p.coat_weight,
        coat_roughness: p.coat_roughness,
        coat_ior: p.coat_ior,
        coat_tint: p.coat_tint,
        coat_normal: normal_at(point, p.coat_normal),
        sheen: p.sheen_weight,
        sheen_roughness: p.sheen_roughness,
        sheen_tint: p.sheen_tint,
        film: ThinFilm::new(p.thin_film_thickness, p.thin_film_ior),
        has_filmed_metal: p.has_filmed_metal,
        normal,
        is_multiscatter: p.is_multiscatter,
    }
}

/// A closure's unit normal: the surface's own in the place of zero. It may point below the
/// geometric surface, as in Cycles: a diffuse closure then sees only what lies above both.
fn normal_at(point: &Point, normal: Vec3A) -> Vec3A {
    normal.try_normalize().unwrap_or(point.normal)
}

/// A closure's tangent: in the place of zero an arbitrary one.
fn tangent_at(point: &Point, tangent: Vec3A) -> Vec3A {
    if tangent == Vec3A::ZERO {
        point.normal.any_orthonormal_vector()
    } else {
        tangent
    }
}

/// What a surface lets pass straight on.
#[derive(Debug, Clone, Copy)]
pub struct Passage {
    /// Share of the light of each channel.
    pub share: Vec3A,
    /// Probability with which a ray passes: the mean of that share, or one where there is nothing
    /// else to see.
    pub probability: f32,
}

impl Passage {
    const CLOSED: Self = Self {
        share: Vec3A::ZERO,
        probability: 0.0,
    };

    /// What a surface does to a ray that meets it at `hit`.
    pub fn at(frame: &SceneFrame, hit: &Hit, ray: &Ray, info: &RayInfo) -> Self {
        match frame.material_of(hit.instance, hit.triangle) {
            Some(material) if material.is_see_through() => {
                if info.kind == RayKind::Shadow && !material.has_transparent_shadow {
                    return Self::CLOSED;
                }
                let facet = Facet::new(frame, hit.instance, hit.triangle, ray.time);
                Self::of(frame, material, &point_of(&facet, hit, ray, info))
            }
            _ => Self::CLOSED,
        }
    }

    fn of(frame: &SceneFrame, material: &Material, point: &Point) -> Self {
        /// From here on a surface that adds light to what it lets pass would hardly be seen.
        const NEARLY_ALL: f32 = 0.999;
        let mut share = Vec3A::ZERO;
        material
            .transparency
            .run(point, &frame.images, &mut |closure| {
                if let Closure::Transparent(passed) = closure {
                    share += *passed;
                }
            });
        let mean = share.element_sum() / 3.0;
        let probability = match mean {
            mean if !(mean > 0.0) => 0.0,
            _ if material.surface.is_empty() => 1.0,
            mean if mean < NEARLY_ALL => mean,
            mean => mean / (mean + other_weights(frame, material, point)),
        };
        Self { share, probability }
    }
}

/// About how much a surface scatters and shines.
fn other_weights(frame: &SceneFrame, material: &Material, point: &Point) -> f32 {
    let mut sum = 0.0;
    material.surface.run(point, &frame.images, &mut |closure| {
        sum += match closure {
            Closure::Principled(p) => p.weight,
            Closure::Glossy(glossy) => glossy.weight,
            Closure::Metallic(metallic) => metallic.weight,
            Closure::Subsurface(s) => s.weight,
            Closure::Toon(toon) => toon.weight,
            Closure::Hair(hair) => hair.weight,
            Closure::Streak(streak) => streak.weight,
            Closure::Glass(glass) | Closure::Refraction(glass) => glass.weight,
            Closure::Diffuse { weight, .. }
            | Closure::Translucent { weight, .. }
            | Closure::Sheen { weight, .. }
            | Closure::Holdout(weight) => *weight,
            Closure::Emission(radiance) => radiance.abs().max_element().min(1.0),
            Closure::Transparent(_)
            | Closure::Volume(_)
            | Closure::Normal(_)
            | Closure::Displacement { .. }
            | Closure::Output { .. } => 0.0,
        };
    });
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Accel;
    use crate::math::warp::sample_cosine_hemisphere;
    use crate::testing::{Scene, diffuse, mesh, square};
    use glam::{Affine3A, Quat, Vec3};

    /// Points of the unit square that leave no large gaps (additive recurrence).
    fn spread(i: u32) -> [f32; 2] {
        [0.754_877_7, 0.569_840_3].map(|step: f64| (f64::from(i) * step).fract() as f32)
    }

    /// How many of the rays that leave a plane of `size` m, seen from 100 m above near its middle,
    /// meet it again.
    fn shadowed_by_itself(size: f32, turn: Quat, is_scaled: bool) -> usize {
        let mut scene = Scene::new();
        let half = Vec3::splat(0.5 * size);
        let turned = Affine3A::from_quat(turn);
        if is_scaled {
            scene.add(square(), turned * Affine3A::from_scale(half), diffuse(0.8));
        } else {
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            let vertices = corners.map(|[x, y]| half * Vec3::new(x, y, 0.0));
            let plane = mesh(&vertices, &[[0, 1, 2], [0, 2, 3]]);
            scene.add(plane, turned, diffuse(0.8));
        }
        let frame = scene.frame(1);
        let accel = Accel::build(&frame, None);
        let meets_itself = |i: &u32| {
            let [x, y] = spread(*i).map(|u| (u - 0.5) * size.min(300.0) * 0.9);
            let eye = turned.transform_point3a(Vec3A::new(0.0, 0.0, 100.0));
            let target = turned.transform_point3a(Vec3A::new(x, y, 0.0));
            let ray = Ray::new(eye, target - eye);
            let hit = accel.closest_hit(&frame, &ray).unwrap();
            let surface = at(&frame, &hit, &ray, &RayInfo::default());
            let [u, v] = spread(i + 7);
            let up = sample_cosine_hemisphere([v, u]).with_z(0.01 + 0.3 * u);
            let direction = turned.transform_vector3a(up).normalize();
            accel.occluded(&frame, &surface.ray_towards(direction))
        };
        (1..4000).filter(meets_itself).count()
    }

    #[test]
    fn no_plane_shadows_itself_however_large() {
        let turns = [
            Quat::IDENTITY,
            Quat::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 1.1),
        ];
        for size in [0.1, 10.0, 3000.0, 1e5] {
            for turn in turns {
                for is_scaled in [false, true] {
                    let count = shadowed_by_itself(size, turn, is_scaled);
                    assert_eq!(count, 0, "{size} m, {turn}, scaled: {is_scaled}");
                }
            }
        }
    }
}
