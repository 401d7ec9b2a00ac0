//! For tests: small scenes made in code, and their mean radiance.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Affine3A, Mat3, Mat3A, Mat4, Vec3, Vec3A};

use crate::contract::{Given, Numbers, Settings, always_kept};
use crate::film::Region;
use crate::progress::Progress;
use crate::render::{Job, Rendered, render};
use crate::scene::{
    Camera, Filling, ForPasses, Image, Instance, Lens, Light, Links, Lookup, Material, Membership,
    Mesh, Placement, Projection, Reach, SceneFrame, Shutter, Visibility, World,
};
use crate::shader::ObjectInfo;

/// Standard scores beyond which a mean counts as wrong: with Student's distribution of 15 degrees
/// of freedom (16 seeds) that happens to a right one once in 1700 times, two-sided. Seeds are fixed.
pub(crate) const MAX_SCORE: f64 = 4.35;
/// Renders of each scene that are judged.
pub(crate) const SEEDS: u32 = 16;

/// A scene under construction; see [`Scene::frame`].
pub(crate) struct Scene {
    meshes: Vec<Arc<Mesh>>,
    pub(crate) instances: Vec<Instance>,
    materials: Vec<Material>,
    pub(crate) lights: Vec<Light>,
    pub(crate) world: World,
    /// What fills the world.
    pub(crate) medium: Option<Filling>,
    pub(crate) camera: Camera,
    pub(crate) shutter: Shutter,
}

impl Scene {
    /// Nothing but a camera at the origin that looks along +Y, in a white world.
    pub(crate) fn new() -> Self {
        Self {
            meshes: Vec::new(),
            instances: Vec::new(),
            materials: Vec::new(),
            lights: Vec::new(),
            world: plain_world(1.0),
            medium: None,
            camera: camera(Vec3::ZERO, Vec3::Y, 0.7),
            shutter: Shutter::default(),
        }
    }

    /// Places a mesh with a material of its own; returns the instance's number.
    pub(crate) fn add(&mut self, mesh: Mesh, placement: Affine3A, material: Material) -> usize {
        self.instances.push(Instance {
            mesh: self.meshes.len() as u32,
            key: self.instances.len() as u64,
            placement: Placement::new(placement),
            motion: None,
            info: ObjectInfo::default(),
            materials: vec![self.materials.len() as u32],
            visibility: Visibility::ALL,
            lift_cosine: 0.0,
            is_holdout: false,
            is_catcher: false,
            membership: Membership::ALL,
            links: Links::default(),
        });
        self.meshes.push(Arc::new(mesh));
        self.materials.push(material);
        self.instances.len() - 1
    }

    /// The scene as frame `number`.
    pub(crate) fn frame(&self, number: i32) -> Arc<SceneFrame> {
        Arc::new(SceneFrame {
            frame: number,
            meshes: self.meshes.clone(),
            instances: self.instances.clone(),
            materials: self.materials.clone(),
            images: Vec::new(),
            lights: self.lights.clone(),
            camera: self.camera,
            shutter: self.shutter.clone(),
            world: self.world.clone(),
            medium: self.medium.clone(),
            passes: ForPasses::default(),
        })
    }
}

/// A world of one grey.
pub(crate) fn plain_world(radiance: f32) -> World {
    World {
        radiance: Vec3A::splat(radiance),
        image: None,
        camera_image: None,
        environment_from_world: Mat3A::IDENTITY,
        reach: Reach::ALL,
    }
}

/// A world with an equirectangular image of the radiance at each (column, row), rows from below.
pub(crate) fn image_world(
    [width, height]: [usize; 2],
    radiance: impl Fn(usize, usize) -> Vec3,
) -> World {
    let texels = (0..width * height).map(|i| radiance(i % width, i / width).extend(1.0));
    let pixels: Vec<f32> = texels.flat_map(|texel| texel.to_array()).collect();
    let given = given("pixels", &[height, width, 4], Numbers::F32(&pixels));
    let image = Image::new(vec![given], Lookup::default()).unwrap();
    World {
        image: Some(Arc::new(image)),
        ..plain_world(1.0)
    }
}

/// A camera with a square view of `angle` [rad].
pub(crate) fn camera(position: Vec3, target: Vec3, angle: f32) -> Camera {
    let scale = 1.0 / (0.5 * angle).tan();
    let projection = Mat4::from_cols_array_2d(&[
        [scale, 0.0, 0.0, 0.0],
        [0.0, scale, 0.0, 0.0],
        [0.0, 0.0, -1.0, -1.0],
        [0.0, 0.0, -0.02, 0.0],
    ]);
    let projection = Projection::from_matrix(projection).unwrap();
    any_camera(position, target, projection, Lens::PINHOLE)
}

/// A camera of any kind.
pub(crate) fn any_camera(
    position: Vec3,
    target: Vec3,
    projection: Projection,
    lens: Lens,
) -> Camera {
    let forward = (target - position).normalize();
    let up = if forward.z.abs() > 0.99 {
        Vec3::Y
    } else {
        Vec3::Z
    };
    let right = forward.cross(up).normalize();
    let axes = Mat3::from_cols(right, right.cross(forward), -forward);
    let placement = Affine3A::from_mat3_translation(axes, position);
    Camera::new(placement, projection, lens, [0.01, 1000.0], 1000).unwrap()
}

/// A Lambertian material.
pub(crate) fn diffuse(reflectance: f32) -> Material {
    Material::of(&[("diffuse", &[("Weight", 1.0), ("Color", reflectance)])])
}

/// A rough mirror.
pub(crate) fn glossy(reflectance: f32, roughness: f32) -> Material {
    let inputs = [
        ("Weight", 1.0),
        ("Color", reflectance),
        ("Roughness", roughness),
    ];
    Material::of(&[("glossy", &inputs)])
}

/// A Principled BSDF of this base colour.
pub(crate) fn lacquer(base: f32, roughness: f32) -> Material {
    let inputs = [
        ("Weight", 1.0),
        ("Base Color", base),
        ("Roughness", roughness),
        ("IOR", 1.5),
        ("Specular IOR Level", 0.5),
        ("Specular Tint", 1.0),
    ];
    Material::of(&[("principled", &inputs)])
}

/// White glass.
pub(crate) fn glass(roughness: f32) -> Material {
    let inputs = [
        ("Weight", 1.0),
        ("Color", 1.0),
        ("Roughness", roughness),
        ("IOR", 1.45),
    ];
    Material::of(&[("glass", &inputs)])
}

/// A sheet that reflects and lets through half of the light each.
pub(crate) fn paper() -> Material {
    let half = [("Weight", 0.5), ("Color", 1.0)];
    Material::of(&[("diffuse", &half), ("translucent", &half)])
}

/// A surface that only shines.
pub(crate) fn glowing(radiance: f32) -> Material {
    Material::of(&[("emission", &[("Weight", 1.0), ("Color", radiance)])])
}

/// A mesh with flat normals.
pub(crate) fn mesh(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Mesh {
    let positions: Vec<f32> = vertices.iter().flat_map(Vec3::to_array).collect();
    let count = triangles.len();
    let zeros = vec![0.0; count * 9];
    Mesh::new(vec![
        given("vertices", &[vertices.len(), 3], Numbers::F32(&positions)),
        given(
            "triangles",
            &[count, 3],
            Numbers::U32(triangles.as_flattened()),
        ),
        given("corner_normals", &[count, 3, 3], Numbers::F32(&zeros)),
        given(
            "corner_uvs",
            &[count, 3, 2],
            Numbers::F32(&zeros[..count * 6]),
        ),
        given("layer_keys", &[0], Numbers::U32(&[])),
        given("layer_values", &[0, count, 3, 4], Numbers::F32(&[])),
        given("material_slots", &[count], Numbers::U32(&vec![0; count])),
    ])
    .unwrap()
}

/// A mesh around the origin, shaded as if it were a ball.
pub(crate) fn smooth(mesh: Mesh) -> Mesh {
    let normals = |triangle: &[u32; 3]| triangle.map(|i| mesh.vertices[i as usize].normalize());
    let normals: Vec<_> = mesh.triangles.iter().map(normals).collect();
    mesh.with_normals(&normals)
}

/// The square from -1 to 1 in x and y, facing +Z.
pub(crate) fn square() -> Mesh {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let vertices = corners.map(|[x, y]| Vec3::new(x, y, 0.0));
    mesh(&vertices, &[[0, 1, 2], [0, 2, 3]])
}

/// The cube from -1 to 1.
pub(crate) fn cube() -> Mesh {
    let vertices: Vec<Vec3> = (0..8)
        .map(|i| Vec3::from([1, 2, 4].map(|bit| if i & bit == 0 { -1.0 } else { 1.0 })))
        .collect();
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = faces.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    mesh(&vertices, triangles.as_flattened())
}

/// A sphere of radius 1 with `rings` rings; its facets are convex and flat.
pub(crate) fn sphere(rings: u32) -> Mesh {
    let columns = 2 * rings;
    let point = |ring: u32, column: u32| {
        let (sin, cos) = (PI * ring as f32 / rings as f32).sin_cos();
        let (y, x) = (TAU * column as f32 / columns as f32).sin_cos();
        Vec3::new(sin * x, sin * y, -cos)
    };
    let mut vertices = vec![Vec3::NEG_Z, Vec3::Z];
    let inner = (1..rings).flat_map(|ring| (0..columns).map(move |column| (ring, column)));
    vertices.extend(inner.map(|(ring, column)| point(ring, column)));
    let index = |ring: u32, column: u32| match ring {
        0 => 0,
        _ if ring == rings => 1,
        _ => 2 + (ring - 1) * columns + column % columns,
    };
    let mut triangles = Vec::new();
    for (ring, column) in (0..rings).flat_map(|r| (0..columns).map(move |c| (r, c))) {
        let low = [index(ring, column), index(ring, column + 1)];
        let high = [index(ring + 1, column), index(ring + 1, column + 1)];
        if ring > 0 {
            triangles.push([low[0], low[1], high[1]]);
        }
        if ring + 1 < rings {
            triangles.push([low[0], high[1], high[0]]);
        }
    }
    mesh(&vertices, &triangles)
}

fn given<'a>(name: &str, shape: &[usize], numbers: Numbers<'a>) -> Given<'a> {
    Given {
        name: name.into(),
        shape: shape.to_vec(),
        numbers,
    }
}

/// One render of a few small frames.
pub(crate) struct Shoot<'a> {
    /// Frames of the window.
    pub frames: &'a [Arc<SceneFrame>],
    /// Settings.
    pub settings: Settings,
    /// Pixels a side.
    pub size: usize,
    /// Threads.
    pub threads: usize,
}

impl Shoot<'_> {
    /// The job of rendering the frames `targets`.
    pub(crate) fn job(&self, targets: &[i32]) -> Job {
        let (width, height) = (self.size, self.size);
        Job {
            frames: self.frames.to_vec(),
            targets: targets.to_vec(),
            step: 1,
            region: Region {
                frame_width: width,
                frame_height: height,
                x: 0,
                y: 0,
                width,
                height,
            },
            settings: self.settings.clone(),
            passes: always_kept(),
            threads: self.threads,
        }
    }

    /// The Combined pass of the frames `targets`.
    pub(crate) fn pictures(&self, targets: &[i32]) -> Vec<Vec<f32>> {
        let job = self.job(targets);
        let rendered = render(&job, &Progress::default()).unwrap();
        let combined = |r: Rendered| {
            let passes = r.passes.into_iter();
            passes
                .filter(|p| p.0 == "Combined")
                .map(|p| p.1)
                .next()
                .unwrap()
        };
        rendered.into_iter().map(combined).collect()
    }

    /// Mean over `seeds` seeds of the first frame's mean radiance, and its standard error.
    ///
    /// Pixels share samples, so only whole pictures are independent.
    pub(crate) fn mean(&mut self, seeds: u32) -> Estimate {
        self.mean_of(self.frames[0].frame, seeds)
    }

    /// The same of the frame `target`.
    pub(crate) fn mean_of(&mut self, target: i32, seeds: u32) -> Estimate {
        let means: Vec<f64> = (0..seeds)
            .map(|seed| {
                self.settings.seed = seed;
                mean_radiance(&self.pictures(&[target])[0])
            })
            .collect();
        let count = f64::from(seeds);
        let mean = means.iter().sum::<f64>() / count;
        let squares: f64 = means.iter().map(|m| (m - mean) * (m - mean)).sum();
        Estimate {
            mean,
            error: (squares / (count * (count - 1.0))).sqrt(),
        }
    }
}

/// Mean of the red, green and blue of RGBA pixels.
pub(crate) fn mean_radiance(pixels: &[f32]) -> f64 {
    let colors = pixels.as_chunks::<4>().0.iter();
    let sum: f64 = colors.flat_map(|p| &p[..3]).map(|&v| f64::from(v)).sum();
    sum / (pixels.len() / 4 * 3) as f64
}

/// A mean and its standard error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Estimate {
    pub mean: f64,
    pub error: f64,
}

impl Estimate {
    /// Relative difference from another estimate, and its standard error.
    pub(crate) fn against(self, other: Self) -> Self {
        Self {
            mean: self.mean / other.mean - 1.0,
            error: self.error.hypot(other.error) / other.mean,
        }
    }
}
