//! A triangle mesh in object space, shared by every instance and frame that shows it unchanged.

use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use glam::{Mat3A, Vec2, Vec3, Vec3A, Vec4};
use rayon::prelude::*;

use super::motion::step_at;
use super::{Content, Grid};
use crate::contract::{Arrays, CONTENT, Given, MESH, MESH_MOTION};
use crate::error::{Error, Result};
use crate::kernel::{Positions, TriangleBvh, pages};
use crate::shader::{FLAT, UNDISPLACED};

/// A triangle mesh and, once something has been traced against it, its trees.
pub struct Mesh {
    /// Positions [m], object space, at the frame's own time.
    pub vertices: Arc<Vec<Vec3>>,
    /// Vertices of each triangle, counter-clockwise from the front.
    pub triangles: Arc<Vec<[u32; 3]>>,
    /// What else each triangle has.
    pub faces: Arc<Vec<Face>>,
    /// Further values of each triangle's corners, by the hash of their name.
    pub layers: Arc<Vec<Layer>>,
    /// What it encloses.
    pub content: Content,
    /// Positions at equal steps of the shutter's time; none where it keeps its form.
    motion: Vec<Vec<Vec3>>,
    /// One for each step of the motion; one where there is none.
    bvhs: OnceLock<Vec<TriangleBvh>>,
    /// The same mesh as materials have displaced it, while some frame shows it so.
    displaced: Mutex<Vec<Weak<Mesh>>>,
}

/// What a hit asks of a triangle beside its vertices, in one line of the cache: apart, normals, texture
/// coordinates and slot would be four.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct Face {
    /// Unit shading normals of the corners, object space.
    pub normals: [Vec3; 3],
    /// Texture coordinates of the corners.
    pub uvs: [Vec2; 3],
    /// Material slot.
    pub slot: u32,
}

/// A name's hash, and values at each triangle's corners.
type Layer = (u32, Vec<[Vec4; 3]>);

impl Mesh {
    /// A mesh from the arrays of [`MESH`].
    ///
    /// # Errors
    /// An array that breaks the contract, or a triangle that names a vertex that is not there.
    pub fn new(given: Vec<Given>) -> Result<Self> {
        let arrays = Arrays::checked(MESH, given)?;
        let vertices: Vec<Vec3> = vec3s(arrays.f32s("vertices"));
        let mut triangles = pages::with_capacity(arrays.u32s("triangles").len() / 3);
        triangles.extend_from_slice(arrays.u32s("triangles").as_chunks::<3>().0);
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
        let faces = faces(&arrays, &triangles, &vertices);
        Ok(Self {
            faces: Arc::new(faces),
            layers: Arc::new(layers(&arrays, triangles.len())),
            vertices: Arc::new(vertices),
            triangles: Arc::new(triangles),
            content: Content::default(),
            motion: Vec::new(),
            bvhs: OnceLock::new(),
            displaced: Mutex::default(),
        })
    }

    /// The same mesh, which changes its form while the shutter is open, from the array of
    /// [`MESH_MOTION`]. It shares all but the positions.
    ///
    /// # Errors
    /// An array that breaks the contract, another number of vertices, fewer than two times.
    pub fn moving(&self, given: Vec<Given>) -> Result<Self> {
        let arrays = Arrays::checked(MESH_MOTION, given)?;
        let positions = vec3s(arrays.f32s("motion_vertices"));
        let count = self.vertices.len().max(1);
        if !positions.len().is_multiple_of(count) || positions.len() / count < 2 {
            return Err(Error::Range {
                field: "motion_vertices",
                value: format!("{} positions", positions.len()),
                range: format!("two times {} at least", self.vertices.len()),
            });
        }
        Ok(Self {
            vertices: self.vertices.clone(),
            triangles: self.triangles.clone(),
            faces: self.faces.clone(),
            layers: self.layers.clone(),
            content: self.content.clone(),
            motion: positions
                .chunks_exact(count)
                .map(<[Vec3]>::to_vec)
                .collect(),
            bvhs: OnceLock::new(),
            displaced: Mutex::default(),
        })
    }

    /// The same mesh with grids in it, by the hashes of their names, and the array of [`CONTENT`]. It
    /// shares all else.
    ///
    /// # Errors
    /// An array that breaks the contract, one corner of a texture space without the other.
    pub fn filled(
        &self,
        grids: Vec<(u32, Arc<Grid>)>,
        given: Vec<Given>,
        is_scaled: bool,
    ) -> Result<Self> {
        let arrays = Arrays::checked(CONTENT, given)?;
        let texture_space = match *vec3s(arrays.f32s("texture_space")) {
            [] => None,
            [low, size] => Some([low.into(), size.into()]),
            ref others => {
                return Err(Error::Range {
                    field: "texture_space",
                    value: format!("{} rows", others.len()),
                    range: "0 or 2".into(),
                });
            }
        };
        Ok(Self {
            vertices: self.vertices.clone(),
            triangles: self.triangles.clone(),
            faces: self.faces.clone(),
            layers: self.layers.clone(),
            content: Content {
                grids,
                texture_space,
                is_scaled,
            },
            motion: self.motion.clone(),
            bvhs: OnceLock::new(),
            displaced: Mutex::default(),
        })
    }

    /// The same mesh, all flat or all smooth.
    #[cfg(test)]
    pub(crate) fn all_flat(self, is_flat: bool) -> Self {
        let value = if is_flat { Vec4::ONE } else { Vec4::ZERO };
        let values = vec![[value; 3]; self.triangles.len()];
        Self {
            layers: Arc::new(vec![(FLAT, values)]),
            ..self
        }
    }

    /// The same mesh with other normals at its corners.
    #[cfg(test)]
    pub(crate) fn with_normals(self, normals: &[[Vec3; 3]]) -> Self {
        let faces = self.faces.iter().zip(normals);
        let faces = faces.map(|(&face, &normals)| Face { normals, ..face });
        Self {
            faces: Arc::new(faces.collect()),
            ..self
        }
    }

    /// For each triangle whether it is flat, or else smooth; `None` where the mesh does not tell, as
    /// strands do not.
    pub fn flat(&self) -> Option<impl Fn(usize) -> bool + '_> {
        let layer = self.layers.iter().find(|(key, _)| *key == FLAT)?;
        Some(|triangle: usize| layer.1[triangle][0].x > 0.5)
    }

    /// The same mesh with its vertices moved; `normals` gives those of the triangles' corners for the
    /// new positions, and where materials ask for it a layer keeps the old ones. One that is there
    /// already is shared, with its trees.
    pub fn displaced(
        &self,
        offsets: &[Vec3],
        keeps_positions: bool,
        normals: impl FnOnce(&[Vec3]) -> Vec<[Vec3; 3]>,
    ) -> Arc<Self> {
        let moved = |vertices: &Vec<Vec3>| {
            let pairs = vertices.iter().zip(offsets);
            pairs.map(|(&v, &offset)| v + offset).collect::<Vec<_>>()
        };
        let vertices = moved(&self.vertices);
        let faces = self.faces.iter().zip(normals(&vertices));
        let faces = faces.map(|(&face, normals)| Face { normals, ..face });
        let made = Self {
            faces: Arc::new(faces.collect()),
            vertices: Arc::new(vertices),
            triangles: self.triangles.clone(),
            layers: match keeps_positions {
                true => Arc::new(self.layers_and_positions()),
                false => self.layers.clone(),
            },
            content: self.content.clone(),
            motion: self.motion.iter().map(moved).collect(),
            bvhs: OnceLock::new(),
            displaced: Mutex::default(),
        };
        let mut known = self
            .displaced
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        known.retain(|mesh| mesh.strong_count() > 0);
        if let Some(same) = known
            .iter()
            .filter_map(Weak::upgrade)
            .find(|m| m.has_form_of(&made))
        {
            return same;
        }
        let made = Arc::new(made);
        known.push(Arc::downgrade(&made));
        made
    }

    fn layers_and_positions(&self) -> Vec<Layer> {
        let corner = |v: u32| self.vertices[v as usize].extend(1.0);
        let positions = self.triangles.iter().map(|triangle| triangle.map(corner));
        let mut layers = self.layers.to_vec();
        layers.push((UNDISPLACED, positions.collect()));
        layers
    }

    /// Whether positions and normals are the same.
    fn has_form_of(&self, other: &Self) -> bool {
        let mut faces = self.faces.iter().zip(other.faces.iter());
        self.vertices == other.vertices
            && self.motion == other.motion
            && faces.all(|(a, b)| a.normals == b.normals)
    }

    /// Whether it changes its form while the shutter is open.
    pub fn is_moving(&self) -> bool {
        !self.motion.is_empty()
    }

    /// The tree over the triangles at a share of the shutter's time, and what that time is for the
    /// tree. Trees are built at the first call.
    pub fn bvh_at(&self, time: f32) -> (&TriangleBvh, f32) {
        let bvhs = self.bvhs_after(None);
        match bvhs.len() {
            1 => (&bvhs[0], time),
            steps => {
                let (step, s) = step_at(time, steps);
                (&bvhs[step], s)
            }
        }
    }

    /// The trees, fitted to this mesh from those of `earlier` if the vertices have only moved since:
    /// that takes less than half of the time, and no hit depends on the shape of a tree.
    pub fn bvhs_after(&self, earlier: Option<&Self>) -> &[TriangleBvh] {
        self.bvhs.get().unwrap_or_else(|| {
            let fits = |earlier: &&Self| earlier.triangles == self.triangles;
            let trees = earlier.filter(fits).and_then(|earlier| earlier.bvhs.get());
            // Outside the lock: while it builds, a thread of rayon's may take up other work that
            // asks for this same tree, and would then wait for itself.
            let built = self.built_after(trees.and_then(|trees| trees.first()));
            self.bvhs.get_or_init(|| built)
        })
    }

    fn built_after(&self, earlier: Option<&TriangleBvh>) -> Vec<TriangleBvh> {
        let mut steps: Vec<Positions> = self
            .motion
            .windows(2)
            .map(|pair| Positions::moving(&pair[0], &pair[1]))
            .collect();
        if steps.is_empty() {
            steps.push(Positions::still(&self.vertices));
        }
        let mut built: Vec<TriangleBvh> = Vec::with_capacity(steps.len());
        for positions in steps {
            let tree = match built.last().or(earlier) {
                None => TriangleBvh::build(positions, &self.triangles),
                Some(tree) => tree.refitted(positions, &self.triangles),
            };
            built.push(tree);
        }
        built
    }

    /// Corners of the box around all triangles, wherever they are while the shutter is open; `None`
    /// where there are none.
    pub fn bounds(&self) -> Option<(Vec3A, Vec3A)> {
        let trees = self.bvhs_after(None).iter();
        trees
            .filter_map(TriangleBvh::bounds)
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Positions of a triangle's corners, object space, at the frame's own time.
    pub fn corners(&self, triangle: u32) -> [Vec3A; 3] {
        self.triangles[triangle as usize].map(|v| self.vertices[v as usize].into())
    }

    /// The same at a share of the shutter's time. What the kernel computes, to the last bit.
    pub fn corners_at(&self, triangle: u32, time: f32) -> [Vec3A; 3] {
        if !self.is_moving() {
            return self.corners(triangle);
        }
        let (step, s) = step_at(time, self.motion.len() - 1);
        let [start, end] = [&self.motion[step], &self.motion[step + 1]];
        self.triangles[triangle as usize].map(|v| {
            let v = v as usize;
            Vec3A::from(start[v] * (1.0 - s) + end[v] * s)
        })
    }

    /// Shading normals of a triangle's corners when these are at `corners`, object space: they follow
    /// the triangle as it turns and stretches. That is exact where the form changes evenly, and needs
    /// no normals for each time.
    pub fn corner_normals_at(&self, triangle: u32, corners: &[Vec3A; 3]) -> [Vec3A; 3] {
        let normals = self.faces[triangle as usize].normals.map(Vec3A::from);
        if !self.is_moving() {
            return normals;
        }
        let (before, after) = (frame_of(&self.corners(triangle)), frame_of(corners));
        let follow = after.inverse().transpose() * before.transpose();
        let own = after.z_axis.normalize_or(Vec3A::Z);
        normals.map(|normal| (follow * normal).normalize_or(own))
    }

    /// Bytes held, the tree included once it is built.
    pub fn memory_bytes(&self) -> usize {
        let per_triangle = size_of::<[u32; 3]>() + size_of::<Face>();
        let layers = self.layers.len() * self.triangles.len() * size_of::<[Vec4; 3]>();
        layers
            + self.content.memory_bytes()
            + self.vertices.len() * size_of::<Vec3>()
            + self.triangles.len() * per_triangle
            + self.motion.len() * self.vertices.len() * size_of::<Vec3>()
            + self
                .bvhs
                .get()
                .into_iter()
                .flatten()
                .map(TriangleBvh::memory_bytes)
                .sum::<usize>()
    }
}

/// Two edges of a triangle and its normal, as long as the triangle is wide.
fn frame_of([a, b, c]: &[Vec3A; 3]) -> Mat3A {
    let (one, other) = (*b - *a, *c - *a);
    let normal = one.cross(other);
    let width = normal.length().sqrt();
    Mat3A::from_cols(one, other, normal.normalize_or(Vec3A::Z) * width)
}

fn layers(arrays: &Arrays, triangles: usize) -> Vec<Layer> {
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
    let mut vectors = pages::with_capacity(numbers.len() / 3);
    vectors.extend(numbers.as_chunks::<3>().0.iter().map(|&v| Vec3::from(v)));
    vectors
}

/// What triangles have beside their vertices; a normal of zero is replaced by the triangle's own.
fn faces(arrays: &Arrays, triangles: &[[u32; 3]], vertices: &[Vec3]) -> Vec<Face> {
    let normals = arrays.f32s("corner_normals").as_chunks::<9>().0;
    let uvs = arrays.f32s("corner_uvs").as_chunks::<6>().0;
    let slots = arrays.u32s("material_slots");
    let face = |row: usize| {
        let [a, b, c] = triangles[row].map(|v| vertices[v as usize]);
        let own = (b - a).cross(c - a).normalize_or(Vec3::Z);
        let normal = |i: usize| Vec3::from_slice(&normals[row][i..]).normalize_or(own);
        Face {
            normals: [0, 3, 6].map(normal),
            uvs: [0, 2, 4].map(|i| Vec2::new(uvs[row][i], uvs[row][i + 1])),
            slot: slots[row],
        }
    };
    let mut faces = pages::with_capacity(triangles.len());
    let rows = (0..triangles.len()).into_par_iter();
    faces.par_extend(rows.with_min_len(4096).map(face));
    faces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::Numbers;
    use crate::testing::mesh;
    use glam::{Affine3A, Quat};

    /// A triangle with three normals, and the same with its vertices placed by a matrix, and back.
    fn moved_by(matrix: Affine3A) -> Mesh {
        let vertices = [
            Vec3::ZERO,
            Vec3::new(2.0, 0.0, 0.0),
            Vec3::new(0.3, 1.0, 0.0),
        ];
        let mut still = mesh(&vertices, &[[0, 1, 2]]);
        let bent = [
            Vec3::Z,
            Vec3::new(0.6, 0.0, 0.8),
            Vec3::new(0.0, -0.28, 0.96),
        ];
        still = still.with_normals(&[bent]);
        let at_end = vertices.map(|v| matrix.transform_point3(v));
        let times = [vertices, at_end, vertices];
        let numbers: Vec<f32> = times.iter().flatten().flat_map(Vec3::to_array).collect();
        let given = Given {
            name: "motion_vertices".into(),
            shape: vec![3, 3, 3],
            numbers: Numbers::F32(&numbers),
        };
        still.moving(vec![given]).unwrap()
    }

    #[test]
    fn normals_turn_and_stretch_with_their_triangle() {
        let turn = Affine3A::from_quat(Quat::from_scaled_axis(Vec3::new(0.4, -0.9, 1.3)));
        let shrink = Affine3A::from_scale(Vec3::splat(0.3));
        let stretch = Affine3A::from_scale(Vec3::new(3.0, 1.0, 3f32.sqrt()));
        for matrix in [turn, turn * shrink, stretch] {
            let mesh = moved_by(matrix);
            let follow = matrix.matrix3.inverse().transpose();
            let normals = mesh.corner_normals_at(0, &mesh.corners_at(0, 0.5));
            for (normal, before) in normals.iter().zip(&mesh.faces[0].normals) {
                let expected = (follow * Vec3A::from(*before)).normalize();
                assert!(normal.distance(expected) < 1e-5, "{normal} {expected}");
            }
            let back = mesh.corner_normals_at(0, &mesh.corners_at(0, 1.0));
            assert!(back[1].distance(mesh.faces[0].normals[1].into()) < 1e-6);
        }
    }

    #[test]
    fn what_moves_must_keep_its_vertices() {
        let still = mesh(&[Vec3::ZERO, Vec3::X, Vec3::Y], &[[0, 1, 2]]);
        for (times, vertices) in [(1, 3), (2, 4), (0, 3)] {
            let numbers = vec![0.0; times * vertices * 3];
            let given = Given {
                name: "motion_vertices".into(),
                shape: vec![times, vertices, 3],
                numbers: Numbers::F32(&numbers),
            };
            assert!(still.moving(vec![given]).is_err(), "{times} {vertices}");
        }
    }
}
