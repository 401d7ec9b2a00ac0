//! The boundary, written once: every array and every setting that crosses from the add-on into the
//! renderer. Rust checks against these tables, the add-on builds its properties from them, and a
//! test renders them to `docs/contract.md`.
//!
//! Shapes use letters for lengths that a caller chooses: V vertices, T triangles, I instances,
//! S material slots, C closures, M materials, L lights, H x W pixels.

/// Element type of a boundary array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dtype {
    /// 32-bit float.
    F32,
    /// Unsigned 32-bit integer.
    U32,
    /// Signed 32-bit integer; -1 means "none" where an index is optional.
    I32,
    /// Unsigned 64-bit integer.
    U64,
}

impl Dtype {
    /// numpy's name of the type.
    pub const fn name(self) -> &'static str {
        match self {
            Dtype::F32 => "float32",
            Dtype::U32 => "uint32",
            Dtype::I32 => "int32",
            Dtype::U64 => "uint64",
        }
    }
}

/// One boundary array.
#[derive(Debug, Clone, Copy)]
pub struct ArraySpec {
    /// Name, also the key in the dictionary that Python hands over.
    pub name: &'static str,
    /// Element type.
    pub dtype: Dtype,
    /// Shape with letters for free lengths, for example `["T", "3"]`.
    pub shape: &'static [&'static str],
    /// Unit and, for geometry, the space.
    pub unit: &'static str,
    /// What it is.
    pub doc: &'static str,
}

const fn array(
    name: &'static str,
    dtype: Dtype,
    shape: &'static [&'static str],
    unit: &'static str,
    doc: &'static str,
) -> ArraySpec {
    ArraySpec {
        name,
        dtype,
        shape,
        unit,
        doc,
    }
}

use Dtype::{F32, I32, U32, U64};

/// Arrays of one mesh: `dualcone.Mesh(**arrays)`.
pub const MESH: &[ArraySpec] = &[
    array("vertices", F32, &["V", "3"], "m, object", "Positions."),
    array(
        "triangles",
        U32,
        &["T", "3"],
        "vertex",
        "Vertices of each triangle, counter-clockwise seen from the front.",
    ),
    array(
        "corner_normals",
        F32,
        &["T", "3", "3"],
        "unit, object",
        "Shading normal of each triangle corner; zero means the triangle's own.",
    ),
    array(
        "corner_uvs",
        F32,
        &["T", "3", "2"],
        "uv",
        "Texture coordinate of each triangle corner in the active render layer; zeros without one.",
    ),
    array(
        "material_slots",
        U32,
        &["T"],
        "slot",
        "Material slot of each triangle.",
    ),
];

/// The one array of an image: `dualcone.Image(pixels)`.
pub const IMAGE: &[ArraySpec] = &[array(
    "pixels",
    F32,
    &["H", "W", "4"],
    "scene linear RGBA",
    "Rows from the bottom up, as Blender stores them. Alpha is straight.",
)];

/// Arrays of one frame: `dualcone.SceneFrame(frame, meshes, images, arrays)`.
pub const FRAME: &[ArraySpec] = &[
    array("instance_mesh", U32, &["I"], "mesh", "Mesh of each instance."),
    array(
        "instance_key",
        U64,
        &["I"],
        "hash",
        "Names the same thing in every frame, so that samples can follow it.",
    ),
    array(
        "world_from_object",
        F32,
        &["I", "3", "4"],
        "m, world from object",
        "Placement of each instance.",
    ),
    array(
        "instance_slots",
        U32,
        &["I", "2"],
        "slot",
        "First entry in `slot_materials` and number of entries of each instance.",
    ),
    array(
        "slot_materials",
        U32,
        &["S"],
        "material",
        "Material of each slot of each instance, concatenated.",
    ),
    array(
        "material_closures",
        U32,
        &["M", "2"],
        "closure",
        "First closure and number of closures of each material.",
    ),
    array(
        "closure_kind",
        U32,
        &["C"],
        "enum",
        "0 Principled, 1 Diffuse, 2 Glossy, 3 Emission, 4 Transparent.",
    ),
    array(
        "closure_weight",
        F32,
        &["C"],
        "1",
        "Factor from the Mix and Add Shaders above the closure.",
    ),
    array(
        "closure_color",
        F32,
        &["C", "3"],
        "scene linear",
        "Base colour, or colour of a Diffuse, Glossy or Transparent closure.",
    ),
    array(
        "closure_color_image",
        I32,
        &["C"],
        "image or -1",
        "Image that replaces the colour.",
    ),
    array("closure_roughness", F32, &["C"], "1", "Roughness as in Blender; GGX alpha is its square."),
    array(
        "closure_roughness_image",
        I32,
        &["C"],
        "image or -1",
        "Image whose red, green and blue mean replaces the roughness.",
    ),
    array("closure_metallic", F32, &["C"], "1", "Principled: metallic."),
    array("closure_ior", F32, &["C"], "1", "Principled: index of refraction."),
    array(
        "closure_specular",
        F32,
        &["C"],
        "1",
        "Principled: Specular IOR Level; 0.5 leaves the index of refraction as it is.",
    ),
    array("closure_alpha", F32, &["C"], "1", "Principled: alpha."),
    array(
        "closure_alpha_image",
        I32,
        &["C"],
        "image or -1",
        "Image whose alpha channel replaces the alpha.",
    ),
    array(
        "closure_emission",
        F32,
        &["C", "3"],
        "W / (sr m^2)",
        "Radiance emitted by Principled and Emission closures, colour times strength.",
    ),
    array("light_kind", U32, &["L"], "enum", "0 Sun, 1 Point, 2 Spot, 3 Area rectangle, 4 Area ellipse."),
    array(
        "light_key",
        U64,
        &["L"],
        "hash",
        "Names the same light in every frame.",
    ),
    array(
        "world_from_light",
        F32,
        &["L", "3", "4"],
        "m, world from light",
        "Placement without scale; a light shines along its own -Z.",
    ),
    array(
        "light_power",
        F32,
        &["L", "3"],
        "W, or W / m^2 for a sun",
        "Colour times Blender's energy times 2^exposure.",
    ),
    array(
        "light_size",
        F32,
        &["L", "2"],
        "m, or rad",
        "Sun: angular diameter. Point and spot: radius. Area: side lengths or diameters. In the first column, the second only for areas.",
    ),
    array(
        "light_spot",
        F32,
        &["L", "2"],
        "rad, 1",
        "Spot: full cone angle and blend.",
    ),
    array(
        "light_soft_falloff",
        U32,
        &["L"],
        "0 or 1",
        "Point and spot: Blender's Soft Falloff.",
    ),
    array(
        "light_camera_visible",
        U32,
        &["L"],
        "0 or 1",
        "Whether camera rays see the light.",
    ),
    array(
        "world_from_camera",
        F32,
        &["3", "4"],
        "m, world from camera",
        "Placement of the camera without scale; it looks along its own -Z.",
    ),
    array(
        "clip_from_camera",
        F32,
        &["4", "4"],
        "clip from camera",
        "Blender's projection of the whole frame: sensor fit, shift and pixel aspect are in it.",
    ),
    array(
        "camera_clip",
        F32,
        &["2"],
        "m",
        "Clip start and clip end, along the viewing axis.",
    ),
    array(
        "world_radiance",
        F32,
        &["3"],
        "W / (sr m^2)",
        "Background colour times strength; with an image, the factor on it.",
    ),
    array(
        "world_image",
        I32,
        &[],
        "image or -1",
        "Equirectangular environment.",
    ),
    array(
        "environment_from_world",
        F32,
        &["3", "3"],
        "environment from world",
        "Linear part of the environment's mapping; directions are normalised after it.",
    ),
];

/// What a setting holds.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// A whole number with its default and inclusive bounds.
    Int(u32, u32, u32),
    /// A number with its default and inclusive bounds.
    Float(f32, f32, f32),
    /// A switch with its default.
    Bool(bool),
    /// One of several words: the default, then (identifier, label, description).
    Enum(
        &'static str,
        &'static [(&'static str, &'static str, &'static str)],
    ),
}

/// One setting.
#[derive(Debug, Clone, Copy)]
pub struct SettingSpec {
    /// Name at `scene.dualcone` and in the settings dictionary.
    pub name: &'static str,
    /// Label in the panel.
    pub label: &'static str,
    /// Type, default and range.
    pub kind: Kind,
    /// Tooltip.
    pub doc: &'static str,
}
