//! Meshes, images and frames: handles that Python keeps while it exports.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::arrays::Held;
use crate::contract::{CONTENT, FRAME, GRID, IMAGE, MESH, MESH_MOTION};
use crate::scene::{self, Encoding, Extension, Interpolation, Lookup};

/// A triangle mesh in object space; hand the same one to every frame that shows it unchanged.
#[pyclass(frozen)]
pub struct Mesh(pub Arc<scene::Mesh>);

#[pymethods]
impl Mesh {
    #[new]
    fn new(
        vertices: Bound<'_, PyAny>,
        triangles: Bound<'_, PyAny>,
        corner_normals: Bound<'_, PyAny>,
        corner_uvs: Bound<'_, PyAny>,
        layer_keys: Bound<'_, PyAny>,
        layer_values: Bound<'_, PyAny>,
        material_slots: Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let arrays = [
            vertices,
            triangles,
            corner_normals,
            corner_uvs,
            layer_keys,
            layer_values,
            material_slots,
        ];
        let held = Held::of_list(MESH, &arrays)?;
        Ok(Self(Arc::new(scene::Mesh::new(held.given()?)?)))
    }

    /// The same mesh, which changes its form while the shutter is open.
    fn moving(&self, motion_vertices: Bound<'_, PyAny>) -> PyResult<Self> {
        let held = Held::of_list(MESH_MOTION, &[motion_vertices])?;
        Ok(Self(Arc::new(self.0.moving(held.given()?)?)))
    }

    /// The same mesh with grids in it, by the hashes of their names.
    fn filled(
        &self,
        grids: Vec<(u32, PyRef<'_, Grid>)>,
        texture_space: Bound<'_, PyAny>,
        is_scaled: bool,
    ) -> PyResult<Self> {
        let held = Held::of_list(CONTENT, &[texture_space])?;
        let grids = grids.iter().map(|(key, grid)| (*key, grid.0.clone()));
        let filled = self.0.filled(grids.collect(), held.given()?, is_scaled)?;
        Ok(Self(Arc::new(filled)))
    }

    /// Number of vertices.
    #[getter]
    fn vertex_count(&self) -> usize {
        self.0.vertices.len()
    }

    /// Number of triangles.
    #[getter]
    fn triangle_count(&self) -> usize {
        self.0.triangles.len()
    }

    /// A copy of the positions (V, 3) [m], object space.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let numbers = self.0.vertices.iter().flat_map(|v| v.to_array());
        PyArray1::from_iter(py, numbers).reshape([self.0.vertices.len(), 3])
    }
}

/// Voxels in the space of an object; values that are not finite become zero.
#[pyclass(frozen)]
pub struct Grid(pub Arc<scene::Grid>);

#[pymethods]
impl Grid {
    #[new]
    fn new(voxels: Bound<'_, PyAny>, index_from_object: Bound<'_, PyAny>) -> PyResult<Self> {
        let held = Held::of_list(GRID, &[voxels, index_from_object])?;
        Ok(Self(Arc::new(scene::Grid::new(held.given()?)?)))
    }
}

/// An image; texels that are not finite become black.
#[pyclass(frozen)]
pub struct Image(pub Arc<scene::Image>);

#[pymethods]
impl Image {
    #[new]
    #[pyo3(signature = (pixels, extension = "REPEAT", interpolation = "Linear", encoding = "LINEAR", divides_alpha = false))]
    fn new(
        pixels: Bound<'_, PyAny>,
        extension: &str,
        interpolation: &str,
        encoding: &str,
        divides_alpha: bool,
    ) -> PyResult<Self> {
        let lookup = Lookup {
            extension: chosen("extension", extension, &EXTENSIONS)?,
            interpolation: chosen("interpolation", interpolation, &INTERPOLATIONS)?,
            encoding: chosen("encoding", encoding, &ENCODINGS)?,
            divides_alpha,
        };
        let held = Held::of_list(IMAGE, &[pixels])?;
        let image = scene::Image::new(held.given()?, lookup)?;
        Ok(Self(Arc::new(image)))
    }

    /// An image of UDIM tiles: (number, image) pairs.
    #[staticmethod]
    fn tiled(tiles: Vec<(u32, PyRef<'_, Image>)>) -> Self {
        let tiles = tiles.iter().map(|(number, tile)| (*number, tile.0.clone()));
        Self(Arc::new(scene::Image::tiled(tiles.collect())))
    }

    /// Texels that were not finite.
    #[getter]
    fn replaced_texels(&self) -> usize {
        self.0.replaced_texels()
    }
}

const EXTENSIONS: [(&str, Extension); 4] = [
    ("REPEAT", Extension::Repeat),
    ("EXTEND", Extension::Extend),
    ("CLIP", Extension::Clip),
    ("MIRROR", Extension::Mirror),
];
const INTERPOLATIONS: [(&str, Interpolation); 3] = [
    ("Linear", Interpolation::Linear),
    ("Closest", Interpolation::Closest),
    ("Cubic", Interpolation::Cubic),
];
const ENCODINGS: [(&str, Encoding); 3] = [
    ("LINEAR", Encoding::Linear),
    ("BYTE", Encoding::Byte),
    ("SRGB", Encoding::Srgb),
];

/// What a word of a list stands for.
fn chosen<T: Copy>(field: &str, word: &str, list: &[(&str, T)]) -> PyResult<T> {
    let found = list.iter().find(|(known, _)| *known == word);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let words: Vec<&str> = list.iter().map(|(known, _)| *known).collect();
        let words = words.join(", ");
        PyValueError::new_err(format!("{field}: {word} is not one of {words}"))
    })
}

/// Everything one frame shows.
#[pyclass(frozen)]
pub struct SceneFrame(pub Arc<scene::SceneFrame>);

#[pymethods]
impl SceneFrame {
    #[new]
    fn new(
        frame: i32,
        meshes: Vec<PyRef<'_, Mesh>>,
        images: Vec<PyRef<'_, Image>>,
        arrays: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let held = Held::of_dict(FRAME, arrays)?;
        let meshes = meshes.iter().map(|mesh| mesh.0.clone()).collect();
        let images = images.iter().map(|image| image.0.clone()).collect();
        let frame = scene::SceneFrame::new(frame, meshes, images, held.given()?)?;
        Ok(Self(Arc::new(frame)))
    }

    /// The frame's number.
    #[getter]
    fn frame(&self) -> i32 {
        self.0.frame
    }

    /// The closures of a material as its program computes them at a texture coordinate of a square
    /// that is seen from above: (kind, values) pairs, printed.
    fn closures(&self, material: usize, uv: (f32, f32)) -> PyResult<Vec<String>> {
        let material = self.0.materials.get(material);
        let material =
            material.ok_or_else(|| PyValueError::new_err("there is no such material"))?;
        Ok(material.closures(&self.0.images, uv.into()))
    }

    /// Bytes held by its meshes and images.
    #[getter]
    fn memory_bytes(&self) -> usize {
        scene::SceneFrame::memory_bytes(std::iter::once(&*self.0))
    }
}
