//! What a ray finds at a hit: the triangle's geometry and its material's closures, textures looked
//! up.

use glam::{Vec2, Vec3A};

use crate::accel::Hit;
use crate::math::{Ray, offset_origin};
use crate::sampling::{Bsdf, Principled};
use crate::scene::{Closure, ClosureKind, Image, SceneFrame, interpolate};

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
    /// Distance along the ray.
    pub distance: f32,
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
        Ray::new(origin, direction)
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

/// The surface that `ray` meets at `hit`.
pub fn at(frame: &SceneFrame, hit: &Hit, ray: &Ray) -> Surface {
    let barycentric = Vec2::new(hit.u, hit.v);
    let instance = &frame.instances[hit.instance as usize];
    let mesh = frame.mesh_of(hit.instance);
    let corners = mesh.corners(hit.triangle);
    // From the corners, not along the ray: the error then does not grow with the distance.
    let position = instance
        .world_from_object
        .transform_point3a(interpolate(&corners, barycentric));
    let wo = -ray.direction.normalize();
    let edges = [corners[1] - corners[0], corners[2] - corners[0]];
    let [one, other] = edges.map(|e| instance.world_from_object.transform_vector3a(e).abs());
    let normal_object = edges[0].cross(edges[1]);
    let outward = instance.world_from_normal * normal_object;
    let is_front = outward.dot(wo) >= 0.0;
    let geometric_normal = facing(outward.try_normalize().unwrap_or(wo), wo);
    let corner_normals = mesh.corner_normals[hit.triangle as usize].map(Vec3A::from);
    let shading = instance.world_from_normal * interpolate(&corner_normals, barycentric);
    let shading = shading.try_normalize().unwrap_or(geometric_normal);
    let normal = if shading.dot(geometric_normal) < 0.0 {
        -shading
    } else {
        shading
    };
    let bsdf = Bsdf::new(geometric_normal, wo, is_front);
    let (bsdf, emission) = shade(frame, hit, normal, bsdf);
    Surface {
        hit: *hit,
        position,
        geometric_normal,
        normal,
        bsdf,
        emission,
        distance: hit.t,
        clearance: CLEARANCE * one.max(other).max_element(),
    }
}

/// `normal`, turned to the side of `direction`.
fn facing(normal: Vec3A, direction: Vec3A) -> Vec3A {
    if normal.dot(direction) < 0.0 {
        -normal
    } else {
        normal
    }
}

/// The closures' reflection and emission, given that the ray did not pass straight on.
fn shade(frame: &SceneFrame, hit: &Hit, normal: Vec3A, mut bsdf: Bsdf) -> (Bsdf, Vec3A) {
    let Some(material) = frame.material_of(hit.instance, hit.triangle) else {
        bsdf.add_diffuse(Vec3A::ONE, DEFAULT_COLOR, normal, 0.0);
        return (bsdf, Vec3A::ZERO);
    };
    let textures = Textures::new(frame, hit);
    // A surface that stops a fraction of the rays, and is seen by those, reflects its weight over
    // that fraction.
    let opacity = opacity(frame, hit);
    let scale = if opacity > 0.0 { 1.0 / opacity } else { 0.0 };
    let mut emission = Vec3A::ZERO;
    for closure in &material.closures {
        let weight = closure.weight * textures.alpha(closure) * scale;
        emission += closure.emission * weight;
        let weight = Vec3A::splat(weight);
        add_closure(&mut bsdf, closure, weight, normal, &textures);
    }
    (bsdf, emission)
}

fn add_closure(
    bsdf: &mut Bsdf,
    closure: &Closure,
    weight: Vec3A,
    normal: Vec3A,
    textures: &Textures,
) {
    match closure.kind {
        ClosureKind::Principled => {
            let principled = Principled {
                base_color: textures.color(closure),
                metallic: closure.metallic,
                roughness: textures.roughness(closure),
                ior: closure.ior,
                specular_level: closure.specular,
                ..Principled::new(normal)
            };
            bsdf.add_principled(weight, &principled);
        }
        ClosureKind::Diffuse => {
            bsdf.add_diffuse(weight, textures.color(closure), normal, 0.0);
        }
        ClosureKind::Glossy => {
            let (color, roughness) = (textures.color(closure), textures.roughness(closure));
            bsdf.add_glossy(weight, color, normal, roughness, (0.0, Vec3A::ZERO), true);
        }
        ClosureKind::Emission | ClosureKind::Transparent => {}
    }
}

/// The probability with which a surface stops a ray.
pub fn opacity(frame: &SceneFrame, hit: &Hit) -> f32 {
    let Some(material) = frame.material_of(hit.instance, hit.triangle) else {
        return 1.0;
    };
    if !material.is_see_through() {
        return 1.0;
    }
    let textures = Textures::new(frame, hit);
    let passing = |c: &Closure| match c.kind {
        // A tinted closure passes the share that its colour passes on average.
        ClosureKind::Transparent => c.weight * textures.color(c).element_sum() / 3.0,
        ClosureKind::Principled => c.weight * (1.0 - textures.alpha(c)),
        _ => 0.0,
    };
    let passed: f32 = material.closures.iter().map(passing).sum();
    (1.0 - passed).clamp(0.0, 1.0)
}

/// Looks up images at one point.
struct Textures<'a> {
    frame: &'a SceneFrame,
    uv: Vec2,
}

impl<'a> Textures<'a> {
    fn new(frame: &'a SceneFrame, hit: &Hit) -> Self {
        let uv = frame.uv(hit.instance, hit.triangle, Vec2::new(hit.u, hit.v));
        Self { frame, uv }
    }

    fn image(&self, index: Option<u32>) -> Option<&'a Image> {
        index.map(|i| &*self.frame.images[i as usize])
    }

    fn color(&self, closure: &Closure) -> Vec3A {
        let image = self.image(closure.color_image);
        image.map_or(closure.color, |i| Vec3A::from_vec4(i.sample(self.uv)))
    }

    fn roughness(&self, closure: &Closure) -> f32 {
        let image = self.image(closure.roughness_image);
        let mean = |i: &Image| Vec3A::from_vec4(i.sample(self.uv)).element_sum() / 3.0;
        image.map_or(closure.roughness, mean)
    }

    fn alpha(&self, closure: &Closure) -> f32 {
        let image = self.image(closure.alpha_image);
        let alpha = image.map_or(closure.alpha, |i| i.sample(self.uv).w);
        if closure.kind == ClosureKind::Principled {
            alpha.clamp(0.0, 1.0)
        } else {
            1.0
        }
    }
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
            let surface = at(&frame, &hit, &ray);
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
