//! Where a program is evaluated.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3A, Vec4};

/// Key of the layer that is one where a triangle is flat; the texture coordinate has the key 0.
pub const FLAT: u32 = 1;
/// Key of the layer of positions before they were displaced, object space [m].
pub const UNDISPLACED: u32 = 2;
/// Key of the layer of Generated coordinates within a volume.
pub const GENERATED: u32 = 3;

/// Values that a mesh keeps at the corners of its triangles, at one triangle.
pub trait Attributes {
    /// Values of the layer `key` at the three corners; `None` if the mesh has no such layer.
    fn corners(&self, key: u32) -> Option<[Vec4; 3]>;
}

/// What the Object Info node tells.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectInfo {
    /// The object's colour and alpha.
    pub color: Vec4,
    /// Its pass index.
    pub index: f32,
    /// A random number in 0 to 1, the instance's own.
    pub random: f32,
    /// The particle that it shows, where a material asks for it.
    pub particle: Option<Arc<Particle>>,
}

/// What the Particle Info node tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Its number in its system.
    pub index: f32,
    /// Frames since its birth, and from there to its death.
    pub age: f32,
    /// See `age`.
    pub lifetime: f32,
    /// Its size.
    pub size: f32,
    /// World space [m].
    pub location: Vec3A,
    /// World space [m/s].
    pub velocity: Vec3A,
    /// World space [rad/s].
    pub angular_velocity: Vec3A,
}

impl Default for ObjectInfo {
    fn default() -> Self {
        Self {
            color: Vec4::ONE,
            index: 0.0,
            random: 0.0,
            particle: None,
        }
    }
}

/// The camera, for coordinates that depend on it.
pub trait View {
    /// Camera space, looking along -Z, from world space.
    fn camera_from_world(&self) -> Affine3A;

    /// Shares of the picture's width and height at which a point of world space appears; `None`
    /// where it cannot be seen.
    fn project(&self, point: Vec3A) -> Option<Vec2>;

    /// Side of a pixel's footprint where rays of this length end [m].
    fn pixel_size(&self, ray_length: f32) -> f32;
}

/// A ray, named after where it starts: at the camera, by which scattering, or for a test whether
/// light arrives. In the order of the contract's bits of Ray Visibility.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RayKind {
    /// From the camera, through whatever is transparent.
    #[default]
    Camera,
    /// Reflected by a diffuse closure.
    Diffuse,
    /// Reflected by a glossy closure.
    Glossy,
    /// Passed on by any closure to the other side.
    Transmission,
    /// Between a surface and a light.
    Shadow,
}

/// What programs may ask of the things around a point.
pub trait Around {
    /// Share of the directions about a unit normal at a point, weighted by their cosine, in which
    /// nothing lies.
    fn openness(&self, point: &Point, normal: Vec3A, search: &Search) -> f32;

    /// The unit normal of the point's own instance once its edges are rounded with a radius [m], on
    /// the viewer's side, from `count` points nearby; `None` where nobody would see it.
    fn rounded(&self, point: &Point, radius: f32, count: u32) -> Option<Vec3A>;
}

/// How a program looks for things around.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// How far [m].
    pub distance: f32,
    /// In how many directions.
    pub count: u32,
    /// Whether only the point's own instance counts.
    pub is_local: bool,
}

/// What the Light Path node tells of the ray that arrives.
#[derive(Clone, Copy, Default)]
pub struct RayInfo<'a> {
    /// What it comes from.
    pub kind: RayKind,
    /// Whether the last surface was a perfect mirror or pane.
    pub is_singular: bool,
    /// Scattering events so far, and how many were of each kind.
    pub depth: u32,
    /// Diffuse ones.
    pub diffuse_depth: u32,
    /// Glossy ones.
    pub glossy_depth: u32,
    /// Transmissions.
    pub transmission_depth: u32,
    /// Transparent surfaces passed.
    pub transparent_depth: u32,
    /// What is around where it arrives. None for shadow rays, as in Cycles, and where lights are
    /// sampled, which is why surfaces that shine by it are not.
    pub around: Option<&'a dyn Around>,
}

impl RayInfo<'_> {
    /// Whether it was scattered to the side that it came from.
    pub fn is_reflection(&self) -> bool {
        matches!(self.kind, RayKind::Diffuse | RayKind::Glossy)
    }

    /// Whether a glossy closure scattered it to either side: whatever comes through counts as such.
    pub fn is_glossy(&self) -> bool {
        matches!(self.kind, RayKind::Glossy | RayKind::Transmission)
    }
}

/// A point of a surface as programs see it. Directions are unit vectors in world space.
#[derive(Clone, Copy)]
pub struct Point<'a> {
    /// World space [m].
    pub position: Vec3A,
    /// Shading normal on the viewer's side.
    pub normal: Vec3A,
    /// Normal of the triangle on the viewer's side.
    pub geometric_normal: Vec3A,
    /// Normals of the triangle's corners, interpolated only: object space, on the front side.
    pub normal_object: Vec3A,
    /// Towards the viewer.
    pub incoming: Vec3A,
    /// Weights of the triangle's second and third corner.
    pub barycentric: Vec2,
    /// Edges from the first corner to the second and third, world space [m].
    pub edges: [Vec3A; 2],
    /// Whether the triangle is seen from behind.
    pub is_back: bool,
    /// Length of the ray that arrives [m].
    pub ray_length: f32,
    /// How far away the neighbours are that bumps look at, in pixels.
    pub filter_width: f32,
    /// Placement of the object.
    pub world_from_object: &'a Affine3A,
    /// Its inverse.
    pub object_from_world: &'a Affine3A,
    /// The object itself.
    pub object: &'a ObjectInfo,
    /// Number of the instance, where programs may ask what is around.
    pub instance: Option<u32>,
    /// Layers of the mesh at the triangle.
    pub attributes: &'a dyn Attributes,
    /// The camera.
    pub view: &'a dyn View,
    /// The ray that arrives.
    pub ray: &'a RayInfo<'a>,
}

/// Blender's own Filter Width of a new Bump node.
pub const FILTER_WIDTH: f32 = 0.1;

impl<'a> Point<'a> {
    /// The point itself, and its neighbours along two orthogonal directions of the triangle's plane,
    /// so many pixels away.
    pub fn variations(&self, filter_width: f32) -> [Self; 3] {
        let centre = Self {
            filter_width,
            ..*self
        };
        let [x, y] = centre.steps();
        [centre, centre.moved(x), centre.moved(y)]
    }

    /// Where the neighbours lie, relative to the point [m]. As in Cycles the pixel's footprint is a
    /// square about the surface's normal, however it is tilted; it grows along the last ray only.
    pub fn steps(&self) -> [Vec3A; 2] {
        // Positions far from the origin are coarser than the footprint.
        let least = 64.0 * f32::EPSILON * self.position.abs().max_element();
        let pixel = self.view.pixel_size(self.ray_length);
        let size = (self.filter_width * pixel).max(least).max(1e-7);
        let [x, y] = across(self.geometric_normal);
        [x * size, y * size]
    }

    /// The same before the surface was displaced: steps to the same points of the mesh.
    pub fn undisplaced_steps(&self) -> [Vec3A; 2] {
        let steps = self.steps();
        let Some([a, b, c]) = self.attributes.corners(UNDISPLACED) else {
            return steps;
        };
        let edge = |end: Vec4| {
            let edge = Vec3A::from_vec4(end - a);
            self.world_from_object.transform_vector3a(edge)
        };
        let (e, f) = (edge(b), edge(c));
        steps.map(|step| {
            let change = self.barycentric_change(step);
            change.x * e + change.y * f
        })
    }

    /// How a step [m] changes the weights of the triangle's corners.
    fn barycentric_change(&self, step: Vec3A) -> Vec2 {
        // Least squares in the plane of the two edges.
        let [e, f] = self.edges;
        let (ee, ef, ff) = (e.dot(e), e.dot(f), f.dot(f));
        let (se, sf) = (step.dot(e), step.dot(f));
        let determinant = ee * ff - ef * ef;
        let scale = if determinant > 0.0 {
            1.0 / determinant
        } else {
            0.0
        };
        Vec2::new(se * ff - sf * ef, sf * ee - se * ef) * scale
    }

    fn moved(&self, step: Vec3A) -> Self {
        Self {
            position: self.position + step,
            barycentric: self.barycentric + self.barycentric_change(step),
            ..*self
        }
    }

    /// The value of a layer of the mesh here; `None` if the mesh has no such layer.
    pub fn attribute(&self, key: u32) -> Option<Vec4> {
        let [a, b, c] = self.attributes.corners(key)?;
        let (u, v) = (self.barycentric.x, self.barycentric.y);
        Some(a * (1.0 - u - v) + b * u + c * v)
    }
}

/// Two orthonormal directions across a unit normal. They are those of Cycles, as where heights change
/// within a pixel, a bump depends on where they are looked up.
fn across(normal: Vec3A) -> [Vec3A; 2] {
    let is_diagonal = normal.x == normal.y && normal.x == normal.z;
    let reference = Vec3A::new(if is_diagonal { -1.0 } else { 1.0 }, 1.0, 1.0);
    let x = reference.cross(normal).normalize();
    [x, normal.cross(x)]
}

/// A mesh without layers, and a camera that sees nothing.
struct Bare;

impl View for Bare {
    fn camera_from_world(&self) -> Affine3A {
        Affine3A::IDENTITY
    }

    fn project(&self, _: Vec3A) -> Option<Vec2> {
        None
    }

    fn pixel_size(&self, ray_length: f32) -> f32 {
        1e-3 * ray_length
    }
}

impl Attributes for Bare {
    fn corners(&self, _: u32) -> Option<[Vec4; 3]> {
        None
    }
}

impl Point<'static> {
    /// A point that nobody looks at, facing +Z at the origin.
    pub fn nowhere() -> Self {
        const OBJECT: ObjectInfo = ObjectInfo {
            color: Vec4::ONE,
            index: 0.0,
            random: 0.0,
            particle: None,
        };
        const RAY: RayInfo<'static> = RayInfo {
            kind: RayKind::Camera,
            is_singular: false,
            depth: 0,
            diffuse_depth: 0,
            glossy_depth: 0,
            transmission_depth: 0,
            transparent_depth: 0,
            around: None,
        };
        Self {
            position: Vec3A::ZERO,
            normal: Vec3A::Z,
            geometric_normal: Vec3A::Z,
            normal_object: Vec3A::Z,
            incoming: Vec3A::Z,
            barycentric: Vec2::ZERO,
            edges: [Vec3A::X, Vec3A::Y],
            is_back: false,
            ray_length: 1.0,
            filter_width: FILTER_WIDTH,
            world_from_object: &Affine3A::IDENTITY,
            object_from_world: &Affine3A::IDENTITY,
            object: &OBJECT,
            instance: None,
            attributes: &Bare,
            view: &Bare,
            ray: &RAY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Orthonormal and right-handed, also across the diagonals; above the ground those of Cycles.
    #[test]
    fn steps_lie_across_the_normal() {
        let diagonal = Vec3A::ONE.normalize();
        let normals = [diagonal, -diagonal, Vec3A::X, Vec3A::Z, -Vec3A::Y];
        for normal in normals {
            let [x, y] = across(normal);
            assert!(x.dot(normal).abs() < 1e-6 && x.is_normalized());
            assert!((x.cross(y) - normal).length() < 1e-6);
        }
        let half = 0.5f32.sqrt();
        assert!((across(Vec3A::Z)[0] - Vec3A::new(half, -half, 0.0)).length() < 1e-6);
    }
}
