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
}

impl Surface {
    /// A ray from the surface that does not meet it again at once.
    pub fn ray_towards(&self, direction: Vec3A) -> Ray {
        Ray::new(
            offset_origin(self.position, self.geometric_normal),
            direction,
        )
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
    let normal_object = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let geometric_normal = towards(wo, instance.world_from_normal * normal_object);
    let corner_normals = mesh.corner_normals[hit.triangle as usize].map(Vec3A::from);
    let shading = instance.world_from_normal * interpolate(&corner_normals, barycentric);
    let shading = shading.try_normalize().unwrap_or(geometric_normal);
    let normal = if shading.dot(geometric_normal) < 0.0 {
        -shading
    } else {
        shading
    };
    let (bsdf, emission) = shade(frame, hit, Bsdf::new(normal, geometric_normal, wo));
    Surface {
        hit: *hit,
        position,
        geometric_normal,
        normal,
        bsdf,
        emission,
        distance: hit.t,
    }
}

/// Unit `normal`, turned to the side of `wo`.
fn towards(wo: Vec3A, normal: Vec3A) -> Vec3A {
    let normal = normal.try_normalize().unwrap_or(wo);
    if normal.dot(wo) < 0.0 {
        -normal
    } else {
        normal
    }
}

/// The closures' reflection and emission, given that the ray did not pass straight on.
fn shade(frame: &SceneFrame, hit: &Hit, mut bsdf: Bsdf) -> (Bsdf, Vec3A) {
    let Some(material) = frame.material_of(hit.instance, hit.triangle) else {
        bsdf.add_diffuse(DEFAULT_COLOR);
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
        add_closure(&mut bsdf, closure, weight, &textures);
    }
    (bsdf, emission)
}

fn add_closure(bsdf: &mut Bsdf, closure: &Closure, weight: f32, textures: &Textures) {
    match closure.kind {
        ClosureKind::Principled => {
            let principled = Principled {
                base_color: textures.color(closure),
                metallic: closure.metallic,
                roughness: textures.roughness(closure),
                ior: closure.ior,
                specular: closure.specular,
            };
            bsdf.add_principled(weight, &principled);
        }
        ClosureKind::Diffuse => bsdf.add_diffuse(textures.color(closure) * weight),
        ClosureKind::Glossy => {
            bsdf.add_glossy(weight, textures.color(closure), textures.roughness(closure));
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
