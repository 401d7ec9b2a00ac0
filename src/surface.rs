//! What a ray finds at a hit: the triangle's geometry, and what its material's program makes of it.

use std::f32::consts::TAU;

use glam::{Quat, Vec2, Vec3A};

use crate::accel::Hit;
use crate::math::{Ray, offset_origin};
use crate::sampling::{Bsdf, Principled};
use crate::scene::{Facet, Material, Membership, SceneFrame};
use crate::shader::{self, Closure, Glossy, Point, RayInfo};

/// A point on a surface, seen along a ray.
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
    /// Radiance that it emits towards the viewer.
    pub emission: Vec3A,
    /// The sets of things that it is in.
    pub membership: Membership,
    /// Share of it that is a hole in the picture.
    pub holdout: f32,
    /// Distance along the ray.
    pub distance: f32,
    /// When the ray found it: the share of the shutter's time that has passed.
    pub time: f32,
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
        let out = facing(self.geometric_normal, direction);
        let origin = offset_origin(self.position + self.clearance * out, out);
        Ray::new(origin, direction).at_time(self.time)
    }

    /// The same surface, if nothing came from it.
    pub fn blackened(self) -> Self {
        let bsdf = Bsdf::new(self.geometric_normal, -self.geometric_normal, true);
        Self {
            bsdf,
            emission: Vec3A::ZERO,
            ..self
        }
    }

    /// Puts it behind glass that lets this share of its light pass.
    pub fn put_behind(&mut self, share: Vec3A) {
        if share != Vec3A::ONE {
            self.bsdf.tint(share);
            self.emission *= share;
        }
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

/// `normal`, turned to the side of `direction`.
fn facing(normal: Vec3A, direction: Vec3A) -> Vec3A {
    if normal.dot(direction) < 0.0 {
        -normal
    } else {
        normal
    }
}

/// The surface that `ray` meets at `hit`.
#[inline]
pub fn at(frame: &SceneFrame, hit: &Hit, ray: &Ray, info: &RayInfo) -> Surface {
    let facet = Facet::new(frame, hit.instance, hit.triangle, ray.time);
    let point = point_of(&facet, hit, ray, info);
    let [one, other] = point.edges.map(Vec3A::abs);
    // Filled in place: a surface is large to copy.
    let mut surface = Surface {
        hit: *hit,
        position: point.position,
        geometric_normal: point.geometric_normal,
        normal: point.normal,
        bsdf: Bsdf::new(point.geometric_normal, point.incoming, !point.is_back)
            .with_smooth_normal(point.normal),
        emission: Vec3A::ZERO,
        membership: frame.instances[hit.instance as usize].membership,
        holdout: 0.0,
        distance: hit.t,
        time: ray.time,
        clearance: CLEARANCE * one.max(other).max_element(),
    };
    surface.shade(frame, &point);
    surface
}

fn point_of<'a>(facet: &'a Facet<'a>, hit: &Hit, ray: &Ray, info: &'a RayInfo) -> Point<'a> {
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
                bsdf.add_principled(scaled(p.weight), &principled(p, point));
            }
            Closure::Diffuse {
                weight,
                color,
                roughness,
                normal,
            } => bsdf.add_diffuse(scaled(weight), color, bent(normal), roughness),
            Closure::Glossy(ref glossy) => add_glossy(bsdf, glossy, scaled(glossy.weight), point),
            Closure::Glass(glass) => bsdf.add_glass(
                scaled(glass.weight),
                glass.color,
                bent(glass.normal),
                glass.roughness,
                glass.ior,
                glass.is_multiscatter,
            ),
            Closure::Refraction(glass) => {
                let weight = scaled(glass.weight) * glass.color.max(Vec3A::ZERO);
                bsdf.add_refraction(weight, bent(glass.normal), glass.roughness, glass.ior);
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
            } => {
                let weight = scaled(weight) * color.max(Vec3A::ZERO);
                bsdf.add_sheen(weight, bent(normal), roughness);
            }
            Closure::Emission(radiance) => self.emission += radiance * scale,
            Closure::Holdout(weight) => self.holdout += weight * scale,
            Closure::Transparent(_) => {}
        }
    }
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
        glossy.is_multiscatter,
    );
}

/// What the node's inputs mean here. Emission is a closure of its own, which sheen and coat do not
/// dim (in Cycles they do): light sampling could not know it.
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
            Closure::Glass(glass) | Closure::Refraction(glass) => glass.weight,
            Closure::Diffuse { weight, .. }
            | Closure::Translucent { weight, .. }
            | Closure::Sheen { weight, .. }
            | Closure::Holdout(weight) => *weight,
            Closure::Emission(radiance) => radiance.max_element().min(1.0),
            Closure::Transparent(_) => 0.0,
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
