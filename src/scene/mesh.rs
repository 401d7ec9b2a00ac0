//! A triangle mesh in object space, shared by every instance and frame that shows it unchanged.

use std::sync::OnceLock;

use glam::{Vec2, Vec3, Vec3A, Vec4};

use crate::contract::{Arrays, Given, MESH};
use crate::error::{Error, Result};
use crate::kernel::TriangleBvh;

/// A triangle mesh and, once something has been traced against it, its tree.
pub struct Mesh {
    /// Positions [m], object space.
    pub vertices: Vec<Vec3>,
    /// Vertices of each triangle, counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Unit shading normals of each triangle's corners, object space.
    pub corner_normals: Vec<[Vec3; 3]>,
    /// Texture coordinates of each triangle's corners.
    pub corner_uvs: Vec<[Vec2; 3]>,
    /// Further values of each triangle's corners, by the hash of their name.
    pub layers: Vec<(u32, Vec<[Vec4; 3]>)>,
    /// Material slot of each triangle.
    pub material_slots: Vec<u32>,
    bvh: OnceLock<TriangleBvh>,
}

impl Mesh {
    /// A mesh from the arrays of [`MESH`].
    ///
    /// # Errors
    /// An array that breaks the contract, or a triangle that names a vertex that is not there.
    pub fn new(given: Vec<Given>) -> Result<Self> {
        let arrays = Arrays::checked(MESH, given)?;
        let vertices: Vec<Vec3> = vec3s(arrays.f32s("vertices"));
        let triangles: Vec<[u32; 3]> = arrays.u32s("triangles").as_chunks::<3>().0.to_vec();
        for (row, triangle) in triangles.iter().enumerate() {
            if let Some(&index) = triangle.iter().find(|&&v| v as usize >= vertices.len()) {
                return Err(Error::Index {
                    field: "triangles",
                    row,
                    index: i64::from(index),
                    len: vertices.len(),
                    of: "vertices",
                });
            }
        }
        let corner_normals = corner_normals(arrays.f32s("corner_normals"), &triangles, &vertices);
        let uvs = arrays.f32s("corner_uvs").as_chunks::<6>().0;
        Ok(Self {
            corner_uvs: uvs
                .iter()
                .map(|c| [0, 2, 4].map(|i| Vec2::new(c[i], c[i + 1])))
                .collect(),
            layers: layers(&arrays, triangles.len()),
            material_slots: arrays.u32s("material_slots").to_vec(),
            vertices,
            triangles,
            corner_normals,
            bvh: OnceLock::new(),
        })
    }

    /// The tree over the triangles, built at the first call.
    pub fn bvh(&self) -> &TriangleBvh {
        self.bvh_after(None)
    }

    /// The same, fitted to this mesh from the tree of `earlier` if the vertices have only moved
    /// since: that takes a thirtieth of the time, and no hit depends on the shape of the tree.
    pub fn bvh_after(&self, earlier: Option<&Self>) -> &TriangleBvh {
        self.bvh.get().unwrap_or_else(|| {
            let fits = |earlier: &&Self| earlier.triangles == self.triangles;
            let tree = earlier.filter(fits).and_then(|earlier| earlier.bvh.get());
            // Outside the lock: while it builds, a thread of rayon's may take up other work that
            // asks for this same tree, and would then wait for itself.
            let built = tree.map_or_else(
                || TriangleBvh::build(&self.vertices, &self.triangles),
                |tree| tree.refitted(&self.vertices, &self.triangles),
            );
            self.bvh.get_or_init(|| built)
        })
    }

    /// Positions of a triangle's corners, object space.
    pub fn corners(&self, triangle: u32) -> [Vec3A; 3] {
        self.triangles[triangle as usize].map(|v| self.vertices[v as usize].into())
    }

    /// Bytes held, the tree included once it is built.
    pub fn memory_bytes(&self) -> usize {
        let per_triangle =
            size_of::<[u32; 3]>() + size_of::<[Vec3; 3]>() + size_of::<[Vec2; 3]>() + 4;
        let layers = self.layers.len() * self.triangles.len() * size_of::<[Vec4; 3]>();
        layers
            + self.vertices.len() * size_of::<Vec3>()
            + self.triangles.len() * per_triangle
            + self.bvh.get().map_or(0, TriangleBvh::memory_bytes)
    }
}

fn layers(arrays: &Arrays, triangles: usize) -> Vec<(u32, Vec<[Vec4; 3]>)> {
    let corners = arrays.f32s("layer_values").as_chunks::<12>().0;
    let keys = arrays.u32s("layer_keys").iter().enumerate();
    let values = |layer: usize| corners[layer * triangles..(layer + 1) * triangles].iter();
    keys.map(|(layer, &key)| {
        let corner = |c: &[f32; 12]| [0, 4, 8].map(|i| Vec4::from_slice(&c[i..]));
        (key, values(layer).map(corner).collect())
    })
    .collect()
}

fn vec3s(numbers: &[f32]) -> Vec<Vec3> {
    let rows = numbers.as_chunks::<3>().0.iter();
    rows.map(|&v| Vec3::from(v)).collect()
}

/// Unit corner normals; a zero one is replaced by the triangle's own.
fn corner_normals(numbers: &[f32], triangles: &[[u32; 3]], vertices: &[Vec3]) -> Vec<[Vec3; 3]> {
    let given = vec3s(numbers);
    let corners = given.as_chunks::<3>().0.iter().zip(triangles);
    corners
        .map(|(normals, triangle)| {
            let [a, b, c] = triangle.map(|v| vertices[v as usize]);
            let own = (b - a).cross(c - a).normalize_or(Vec3::Z);
            normals.map(|normal| normal.normalize_or(own))
        })
        .collect()
}
