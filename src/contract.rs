//! The boundary, written once: every array and every setting that crosses from the add-on into the
//! renderer. Rust checks against these tables, the add-on builds its properties from them, and a
//! test renders them to `docs/contract.md`.
//!
//! Shapes use letters for lengths that a caller chooses: V vertices, T triangles, I instances,
//! S material slots, M materials, N instructions, P operands, K constants, Q rows of tables,
//! A layers, L lights, H x W pixels, J moving instances, R placements of them, Y times while the
//! shutter is open, U parts of its time, E frames around, F instances that differ there, with W
//! vertices.

use crate::error::{Error, Result};

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
        "layer_keys",
        U32,
        &["A"],
        "hash",
        "Names of the layers below; programs ask for a layer by its name's hash. Zero is `corner_uvs`. 4 makes the mesh tubes of strands: along the strand, as long as its radius [m], and how many sides the tube has; 5 is the share of the strand's length up to here, that length [m], and the strand's number.",
    ),
    array(
        "layer_values",
        F32,
        &["A", "T", "3", "4"],
        "as the layer",
        "Values at each triangle corner: other UV maps, colours, generated coordinates, tangents with their sign.",
    ),
    array(
        "material_slots",
        U32,
        &["T"],
        "slot",
        "Material slot of each triangle.",
    ),
];

/// The one array of a mesh that moves: `mesh.moving(motion_vertices)`.
pub const MESH_MOTION: &[ArraySpec] = &[array(
    "motion_vertices",
    F32,
    &["Y", "V", "3"],
    "m, object",
    "Positions at equal steps of the shutter's time, its two ends included.",
)];

/// Arrays of one grid of voxels: `dualcone.Grid(**arrays)`.
pub const GRID: &[ArraySpec] = &[
    array(
        "voxels",
        F32,
        &["X", "Y", "Z", "N"],
        "1",
        "Values at the points of a grid: a number, a colour, or a colour and alpha each.",
    ),
    array(
        "index_from_object",
        F32,
        &["3", "4"],
        "point, index from object",
        "Where in the grid a point of the object lies; the grid's first point has the index 0.",
    ),
];

/// The one array of a mesh that holds more than its material says:
/// `mesh.filled(grids, texture_space, is_scaled)`.
pub const CONTENT: &[ArraySpec] = &[array(
    "texture_space",
    F32,
    &["B", "3"],
    "m, object",
    "Lower corner and size of what Generated coordinates of volumes count from 0 to 1; none for the mesh's own bounds.",
)];

/// The one array of an image: `dualcone.Image(pixels)`.
pub const IMAGE: &[ArraySpec] = &[array(
    "pixels",
    F32,
    &["H", "W", "4"],
    "RGBA",
    "Rows from the bottom up, as Blender stores them, in the encoding that the image is made with: LINEAR is scene linear, BYTE the same in 8 bits, SRGB in 8 bits that are decoded behind the filter.",
)];

/// Arrays of one frame: `dualcone.SceneFrame(frame, meshes, images, arrays)`.
pub const FRAME: &[ArraySpec] = &[
    array(
        "instance_mesh",
        U32,
        &["I"],
        "mesh",
        "Mesh of each instance.",
    ),
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
        "motion_instances",
        U32,
        &["J"],
        "instance",
        "The instances that move while the shutter is open, in rising order.",
    ),
    array(
        "motion_spans",
        U32,
        &["J", "2"],
        "placement",
        "First entry in `motion_placements` and number of entries of each of them, two at least.",
    ),
    array(
        "motion_placements",
        F32,
        &["R", "3", "4"],
        "m, world from object",
        "Placements at equal steps of the shutter's time, its two ends included, concatenated.",
    ),
    array(
        "instance_color",
        F32,
        &["I", "4"],
        "scene linear RGBA",
        "Colour of the object, for the Object Info node.",
    ),
    array(
        "instance_info",
        F32,
        &["I", "2"],
        "1",
        "Pass index of the object, and the instance's own random number from 0 to 1.",
    ),
    array(
        "particle_instances",
        U32,
        &["B"],
        "instance",
        "The instances that show particles whose data materials ask for.",
    ),
    array(
        "particles",
        F32,
        &["B", "13"],
        "1, frames, m, m/s, rad/s",
        "Of each: number in its system, frames since birth, lifetime, size, location, velocity, angular velocity.",
    ),
    array(
        "instance_lift_cosine",
        F32,
        &["I"],
        "1",
        "Where light meets a smooth surface at a lower cosine, shadows are those of its smooth form and \
         not of its flat faces; 0 for never.",
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
        "instance_visibility",
        U32,
        &["I"],
        "bits",
        "Rays that meet it: 1 camera, 2 diffuse, 4 glossy, 8 transmission, 16 shadow.",
    ),
    array(
        "instance_holdout",
        U32,
        &["I"],
        "0 or 1",
        "Whether camera rays meet a hole in the picture in its place.",
    ),
    array(
        "instance_shadow_catcher",
        U32,
        &["I"],
        "0 or 1",
        "Whether only the shadows on it are seen.",
    ),
    array(
        "instance_receiver_sets",
        U64,
        &["I"],
        "bits",
        "The sets of things that lights are linked to which it is in, bit 0 always: it is lit by the lights of these sets.",
    ),
    array(
        "instance_blocker_sets",
        U64,
        &["I"],
        "bits",
        "The same for shadows: it stops the light of the lights of these sets.",
    ),
    array(
        "instance_links",
        U32,
        &["I", "3"],
        "set, group",
        "As of lights, for the light that it gives off.",
    ),
    array(
        "material_programs",
        U32,
        &["M", "2"],
        "instruction",
        "First instruction and number of instructions of each material's program.",
    ),
    array(
        "material_index",
        F32,
        &["M"],
        "1",
        "Pass index of each material.",
    ),
    array(
        "material_transparent_shadow",
        U32,
        &["M"],
        "0 or 1",
        "Whether rays that look for a light pass the material where others do.",
    ),
    array(
        "program_instructions",
        U32,
        &["N", "4"],
        "operation, operand, parameter, point",
        "Number of the operation in `operations()`, first of its operands, its parameter, and whether it reads at the point itself (0) or at one of its neighbours (1, 2). The parameter chooses modes (mixed radix, the first list counting fastest), or names an image, a first row of `program_tables` or a layer of the mesh. Instruction i computes value i of its program.",
    ),
    array(
        "program_operands",
        U32,
        &["P"],
        "value or 2^31 + constant",
        "Operands of all instructions, concatenated: an earlier value of the same program, or a constant.",
    ),
    array(
        "program_constants",
        F32,
        &["K", "3"],
        "1",
        "Colours and vectors; a number stands in all three columns.",
    ),
    array(
        "program_tables",
        F32,
        &["Q", "4"],
        "scene linear RGBA",
        "Ramps and curves, 256 rows each from 0 to 1.",
    ),
    array(
        "light_kind",
        U32,
        &["L"],
        "enum",
        "0 Sun, 1 Point, 2 Spot, 3 Area rectangle, 4 Area ellipse.",
    ),
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
        "light_scale",
        F32,
        &["L", "3"],
        "1",
        "Scale of the object's axes, for a spot's cone and for coordinates that nodes read.",
    ),
    array(
        "light_material",
        I32,
        &["L"],
        "material or -1",
        "Material whose emission is a factor on the light.",
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
        "light_spread",
        F32,
        &["L"],
        "rad",
        "Area: full angle of the cone that each point of it shines into; pi does not narrow it.",
    ),
    array(
        "light_soft_falloff",
        U32,
        &["L"],
        "0 or 1",
        "Point and spot: Blender's Soft Falloff.",
    ),
    array(
        "light_visibility",
        U32,
        &["L"],
        "bits",
        "As `instance_visibility`; without the bit of shadow rays nothing stops the light.",
    ),
    array(
        "light_max_bounces",
        U32,
        &["L"],
        "1",
        "Number of the last bounce that it lights, counted from 0.",
    ),
    array(
        "light_links",
        U32,
        &["L", "3"],
        "set, group",
        "Numbers of the sets of things that it lights and that stop its light, 0 for all; and of its light group, 0 for none.",
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
        "Blender's projection of the whole frame, perspective or orthographic: sensor fit, shift and pixel aspect are in it.",
    ),
    array(
        "camera_clip",
        F32,
        &["2"],
        "m",
        "Clip start and clip end, along the viewing axis; along each ray of a panorama.",
    ),
    array(
        "camera_frame_width",
        U32,
        &[],
        "pixels",
        "Width of the whole frame, before any border: bump mapping looks a share of a pixel around.",
    ),
    array(
        "camera_kind",
        U32,
        &[],
        "enum",
        "0 as `clip_from_camera` says, or a panorama: 1 Equirectangular, 2 Fisheye Equidistant, 3 Fisheye Equisolid, 4 Fisheye Lens Polynomial, 5 Mirror Ball, 6 Equiangular Cubemap Face, 7 Central Cylindrical.",
    ),
    array(
        "camera_panorama",
        F32,
        &["10"],
        "rad, mm, 1",
        "Shift in shares of width and height, then by kind. 1: longitude from, to, latitude from, to. 2: field of view. 3: field of view, focal length, sensor width, height. 4: field of view, sensor width, height, five coefficients. 7: longitude from, to, height from, to. The rest is not read.",
    ),
    array(
        "camera_lens",
        F32,
        &["5"],
        "m, m, 1, rad, 1",
        "Aperture radius (0 for no depth of field), focus distance, blades, their rotation, height of the aperture over its width.",
    ),
    array(
        "camera_motion",
        F32,
        &["Y", "3", "4"],
        "m, world from camera",
        "Placements of the camera at equal steps of the shutter's time, its two ends included; none where it stands still.",
    ),
    array(
        "camera_motion_clip",
        F32,
        &["Y", "4", "4"],
        "clip from camera",
        "Projections at the same times.",
    ),
    array(
        "instance_mattes",
        F32,
        &["G", "2"],
        "name",
        "For Cryptomatte: numbers that name the object and the asset of each instance; none without these passes.",
    ),
    array(
        "material_mattes",
        F32,
        &["H"],
        "name",
        "The same for each material.",
    ),
    array(
        "flow_camera",
        F32,
        &["E", "3", "4"],
        "m, world from camera",
        "For the pass Vector, like all that begins with `flow_`: placements of the camera in the frame before and the one after; none without the pass.",
    ),
    array(
        "flow_camera_clip",
        F32,
        &["E", "4", "4"],
        "clip from camera",
        "Projections in the same frames.",
    ),
    array(
        "flow_instances",
        U32,
        &["F"],
        "instance",
        "The instances that are elsewhere in those frames, or have another form.",
    ),
    array(
        "flow_placements",
        F32,
        &["F", "2", "3", "4"],
        "m, world from object",
        "Their placements before and after.",
    ),
    array(
        "flow_first_vertex",
        I32,
        &["F"],
        "vertex or -1",
        "Where in `flow_vertices` those of their mesh begin, if it has another form in those frames.",
    ),
    array(
        "flow_vertices",
        F32,
        &["W", "2", "3"],
        "m, object",
        "Vertices before and after, mesh by mesh.",
    ),
    array(
        "shutter_curve",
        F32,
        &["U"],
        "1",
        "Share of the light that the shutter lets in, in equal parts of its time; none where it is the same throughout.",
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
        "world_camera_image",
        I32,
        &[],
        "image or -1",
        "What camera rays see in place of `world_image`, where that differs.",
    ),
    array(
        "world_material",
        I32,
        &[],
        "material or -1",
        "Material whose volume fills the world.",
    ),
    array(
        "world_visibility",
        U32,
        &[],
        "bits",
        "As `light_visibility`.",
    ),
    array(
        "world_group",
        U32,
        &[],
        "group",
        "Number of its light group, 0 for none.",
    ),
    array(
        "world_max_bounces",
        U32,
        &[],
        "1",
        "Number of the last bounce that it lights, counted from 0.",
    ),
    array(
        "mist",
        F32,
        &["3"],
        "m, m, 1",
        "Distance at which the world's mist begins, how far from there it hides everything, and the power of the share of the way.",
    ),
    array(
        "alpha_threshold",
        F32,
        &[],
        "share",
        "Passes of what is seen show the nearest surface of at least this opacity.",
    ),
    array(
        "ambient_distance",
        F32,
        &[],
        "m",
        "How far away what is near may be, for the pass Ambient Occlusion.",
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

/// What a film keeps of a pass, and how its numbers come of that.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// What every film keeps.
    Always,
    /// The numbers of the first sample: they do not average.
    First,
    /// The sum over the samples, for their mean.
    Mean,
    /// The same and the number of samples that have any, for the mean over those.
    MeanSeen,
    /// The sum over the samples, to divide by that of another pass, which is then kept too.
    Over(&'static str),
    /// The sums over the samples of several passes, for their means.
    Means,
    /// Numbers that name things, and the sums of their weights over the samples: two things for each
    /// of several passes, the heaviest first.
    Ranked,
}

/// One render pass.
#[derive(Debug, Clone, Copy)]
pub struct PassSpec {
    /// Name as Blender's render layer shows it.
    pub name: &'static str,
    /// Channel letters.
    pub channels: &'static str,
    /// Blender's pass type: COLOR, VECTOR or VALUE.
    pub kind: &'static str,
    /// What a film keeps of it.
    pub keep: Keep,
    /// What it is.
    pub doc: &'static str,
}

impl PassSpec {
    /// Whether it shows light, which the film's exposure scales.
    pub fn is_light(&self) -> bool {
        LIGHT.contains(&self.name) || matches!(self.keep, Keep::Over(_))
    }

    /// Bytes that a pixel takes for it beside what it takes in any case: a sum and a result for each
    /// channel.
    pub fn extra_bytes(&self) -> usize {
        match self.keep {
            Keep::Always => 0,
            _ => 2 * size_of::<f32>() * self.channels.len(),
        }
    }

    /// The row of a pass, and its key: what stands behind the first dot of its name, where several
    /// passes share a row.
    ///
    /// # Errors
    /// A name that the table does not have.
    pub fn named(name: &str) -> Result<(&'static Self, &str)> {
        let (row, key) = name.split_once('.').unwrap_or((name, ""));
        let found = PASSES
            .iter()
            .find(|spec| spec.name == row && spec.is_keyed() != key.is_empty());
        let found = found.ok_or_else(|| Error::Unknown { name: name.into() });
        Ok((found?, key))
    }

    /// Whether there may be several passes of this row, told apart by a key behind its name.
    pub fn is_keyed(&self) -> bool {
        matches!(self.keep, Keep::Means | Keep::Ranked)
    }
}

const fn pass(
    name: &'static str,
    channels: &'static str,
    kind: &'static str,
    keep: Keep,
    doc: &'static str,
) -> PassSpec {
    PassSpec {
        name,
        channels,
        kind,
        keep,
        doc,
    }
}

use Keep::{Always, First, Mean, MeanSeen, Means, Over, Ranked};

/// Every pass that can be rendered, called as Blender 5 calls it.
#[rustfmt::skip] // One line each.
pub const PASSES: &[PassSpec] = &[
    pass("Combined", "RGBA", "COLOR", Always, "Radiance and coverage; colour is premultiplied by alpha."),
    pass("Depth", "Z", "VALUE", Always, "Distance along the viewing axis in the first sample [m]; 1e10 for the background."),
    pass("Mist", "Z", "VALUE", Mean, "From 0 near the camera to 1 in the distance, by the world's mist settings; 1 for the background."),
    pass("Position", "XYZ", "VECTOR", First, "World space, in the first sample [m]; 0 for the background."),
    pass("Normal", "XYZ", "VECTOR", Always, "Mean shading normal in world space."),
    pass("Vector", "XYZW", "VECTOR", MeanSeen, "How the surface moves in the picture: from the frame before to this one in X and Y, from this one to the next in Z and W [pixel]."),
    pass("UV", "UVA", "VECTOR", Mean, "Mean texture coordinate of the map that is active for rendering, and the share of surfaces that have one."),
    pass("Object Index", "X", "VALUE", First, "Pass index of the object in the first sample; 0 for the background."),
    pass("Material Index", "X", "VALUE", First, "Pass index of the material in the first sample; 0 for the background."),
    pass("Diffuse Direct", "RGB", "COLOR", Over("Diffuse Color"), "Light that comes straight from its source and is scattered by diffuse and translucent closures, over their colour."),
    pass("Diffuse Indirect", "RGB", "COLOR", Over("Diffuse Color"), "The same of light that comes by way of other surfaces."),
    pass("Diffuse Color", "RGB", "COLOR", Mean, "Share of light that those closures scatter."),
    pass("Glossy Direct", "RGB", "COLOR", Over("Glossy Color"), "Light that comes straight from its source and is mirrored, over the colour."),
    pass("Glossy Indirect", "RGB", "COLOR", Over("Glossy Color"), "The same of light that comes by way of other surfaces."),
    pass("Glossy Color", "RGB", "COLOR", Mean, "Share of light that is mirrored."),
    pass("Transmission Direct", "RGB", "COLOR", Over("Transmission Color"), "Light that comes straight from its source and is refracted, over the colour."),
    pass("Transmission Indirect", "RGB", "COLOR", Over("Transmission Color"), "The same of light that comes by way of other surfaces."),
    pass("Transmission Color", "RGB", "COLOR", Mean, "Share of light that is refracted."),
    pass("Emission", "RGB", "COLOR", Mean, "Light of glowing surfaces and lamps that the camera sees."),
    pass("Environment", "RGB", "COLOR", Mean, "Light of the world that the camera sees."),
    pass("Light Group", "RGB", "COLOR", Means, "What Combined has of the lamps, glowing surfaces and world of a light group, `Light Group.` and its number; by paths of its own."),
    pass("Volume Direct", "RGB", "COLOR", Mean, "Light that comes straight from its source and is scattered by media."),
    pass("Volume Indirect", "RGB", "COLOR", Mean, "The same of light that comes by way of other places."),
    pass("Ambient Occlusion", "RGB", "COLOR", Mean, "Share of directions above the surface in which nothing is near, weighted by their cosine."),
    pass("Shadow Catcher", "RGB", "COLOR", Always, "Share of its light that things leave to shadow catchers; 1 where there are none."),
    pass("CryptoObject", "rgba", "COLOR", Ranked, "Cryptomatte: names of two objects and the shares of the pixel that they cover; `CryptoObject.00` has the two that cover most."),
    pass("CryptoMaterial", "rgba", "COLOR", Ranked, "The same of materials."),
    pass("CryptoAsset", "rgba", "COLOR", Ranked, "The same of assets: objects with all their children."),
    pass("AOV Color", "RGBA", "COLOR", Means, "Colour that AOV Output nodes send to a pass of the user's own, `AOV Color.` and the hash of its name; alpha is the share of surfaces that send any."),
    pass("AOV Value", "X", "VALUE", Means, "The same of a number."),
    pass("Denoising Normal", "XYZ", "VECTOR", Mean, "Mean shading normal in the camera's space, with Z to the front; of what mirrors and clear glass show, not their own."),
    pass("Denoising Albedo", "RGB", "COLOR", Mean, "Mean share of light that the surface reflects, or what shines; of what mirrors and clear glass show, times their colour."),
    pass("Denoising Depth", "Z", "VALUE", Mean, "Mean length of the way to what those show, from the near clipping plane [m]; 0 for the background."),
    pass("Albedo", "RGB", "COLOR", Always, "Mean share of light that the surface reflects."),
    pass("Noisy Image", "RGBA", "COLOR", Always, "Combined before denoising."),
    pass("Sample Count", "X", "VALUE", Always, "Camera rays of the pixel."),
    pass("Borrowing", "X", "VALUE", Always, "From where the pixel borrows samples: 1 from all frames, 0.5 from its own frame only, 0 from nowhere, where it was found to be better off so."),
    pass("Effective Samples", "X", "VALUE", Always, "Gather samples that the pixel's indirect light is worth, borrowed ones included."),
];

/// Names of the passes that cost nothing: every film keeps them.
pub fn always_kept() -> Vec<String> {
    let kept = PASSES.iter().filter(|spec| spec.keep == Keep::Always);
    kept.map(|spec| spec.name.to_owned()).collect()
}

/// Passes of light, beside those that are divided by a colour.
const LIGHT: &[&str] = &[
    "Combined",
    "Noisy Image",
    "Emission",
    "Environment",
    "Light Group",
    "Volume Direct",
    "Volume Indirect",
];

macro_rules! settings {
    ($($(#[doc = $doc:literal])+ $name:ident: $type:ty = $kind:expr, $label:literal;)+) => {
        /// The settings of a render. The same table makes the add-on's properties.
        #[derive(Debug, Clone, PartialEq)]
        pub struct Settings {
            $($(#[doc = $doc])+ pub $name: $type,)+
        }

        /// The settings, in the order of the panels.
        pub const SETTINGS: &[SettingSpec] = &[
            $(SettingSpec {
                name: stringify!($name),
                label: $label,
                kind: $kind,
                doc: concat!($($doc),+).trim_ascii(),
            },)+
        ];

        impl Settings {
            /// Settings from named values; what is not named keeps its default.
            ///
            /// # Errors
            /// An unknown name, a value of another type or outside its range.
            pub fn from_values(values: &[(String, Value)]) -> Result<Self> {
                for (name, _) in values {
                    if !SETTINGS.iter().any(|s| s.name == name) {
                        return Err(Error::Unknown { name: name.clone() });
                    }
                }
                let value = |spec: &SettingSpec| -> Result<Value> {
                    match values.iter().find(|(name, _)| name == spec.name) {
                        Some((_, value)) => value.clone().checked(spec),
                        None => Ok(spec.default()),
                    }
                };
                let mut specs = SETTINGS.iter();
                let mut next = || specs.next().map_or_else(
                    || Err(Error::Missing { field: "settings" }), value);
                Ok(Self { $($name: next()?.into(),)+ })
            }
        }

        impl Default for Settings {
            fn default() -> Self {
                let mut specs = SETTINGS.iter().map(SettingSpec::default);
                // Both lists come from one macro, so they have one length.
                let mut next = || specs.next().unwrap_or(Value::Bool(false));
                Self { $($name: next().into(),)+ }
            }
        }
    };
}

settings! {
    /// How frames are rendered.
    method: Method = Kind::Enum("DUAL_CONE", &[
        ("DUAL_CONE", "Dual Cone", "Borrow samples from neighbouring pixels and frames, weighted per class of light"),
        ("PAPER", "Paper", "The method of Zhou and Chen (2015) as printed, for comparison"),
        ("PATH", "Path Tracing", "Every pixel on its own: the unbiased reference"),
        ("BILATERAL", "Bilateral Filter", "For comparison: a filter guided by normal, albedo and depth"),
        ("IRRADIANCE_CACHE", "Irradiance Cache", "For comparison: diffuse light at few points, interpolated"),
    ]), "Method";
    /// Camera rays per pixel and frame.
    samples: u32 = Kind::Int(64, 1, 65535), "Samples";
    /// Changes the noise pattern, nothing else.
    seed: u32 = Kind::Int(0, 0, 0x7fff_ffff), "Seed";
    /// Path Tracing only: paths that go on from the surface that a camera ray finds.
    gathers: u32 = Kind::Int(1, 1, 64), "Gathers";
    /// Side of the block of pixels that lend samples.
    block: u32 = Kind::Int(7, 1, 15), "Block";
    /// Frames that share samples, counting the frame itself.
    window: u32 = Kind::Int(3, 1, 15), "Frames";
    /// Dual Cone only: from whom a pixel borrows.
    share: Share = Kind::Enum("AUTO", &[
        ("AUTO", "Automatic", "From frames alone where the picture is denoised, else from pixels and frames"),
        ("ALL", "Pixels and Frames", "From the block of pixels, in each frame: the least noise"),
        ("FRAMES", "Frames", "From the same place in other frames: more noise, but none that neighbours have in common, so that a denoiser removes it"),
    ]), "Share";
    /// Paper only: which borrowed samples are tested again for visibility.
    recheck: Recheck = Kind::Enum("LIT", &[
        ("NONE", "None", "Trust the recorded visibility: fast, shadows leak"),
        ("LIT", "Lit", "Test samples that found light"),
        ("ALL", "All", "Test every sample: slow"),
    ]), "Recheck";
    /// Also for a still image, look at the frames around it.
    still_window: bool = Kind::Bool(true), "Stills Look Around";
    /// Frames of an animation that are rendered at once; more share more work and need more memory.
    frames_together: u32 = Kind::Int(16, 1, 64), "Frames Together";
    /// Bounces of light in all.
    max_bounces: u32 = Kind::Int(12, 0, 1024), "Total";
    /// Bounces off diffuse surfaces.
    diffuse_bounces: u32 = Kind::Int(4, 0, 1024), "Diffuse";
    /// Bounces off glossy surfaces.
    glossy_bounces: u32 = Kind::Int(4, 0, 1024), "Glossy";
    /// Bounces through surfaces: refraction and translucency.
    transmission_bounces: u32 = Kind::Int(12, 0, 1024), "Transmission";
    /// Bounces in volumes.
    volume_bounces: u32 = Kind::Int(0, 0, 1024), "Volume";
    /// Transparent surfaces that a ray passes before it ends.
    transparent_max_bounces: u32 = Kind::Int(8, 0, 1024), "Transparent";
    /// Light that a diffuse surface gets by glossy reflection: bright and noisy.
    caustics_reflective: bool = Kind::Bool(true), "Reflective Caustics";
    /// Light that a diffuse surface gets through glass: bright and noisy.
    caustics_refractive: bool = Kind::Bool(true), "Refractive Caustics";
    /// Widens glossy reflection after wide bounces, against noise from caustics; 0 leaves it right. Cycles has 1 by default.
    blur_glossy: f32 = Kind::Float(0.0, 0.0, 10.0), "Filter Glossy";
    /// Limit on each sample of light that comes straight from a light, against fireflies; it makes pictures darker. 0 for none.
    clamp_direct: f32 = Kind::Float(0.0, 0.0, 1e8), "Clamp Direct";
    /// Limit on each sample of light that comes by way of other surfaces, against fireflies; it makes pictures darker. 0 for none; Cycles has 10 by default.
    clamp_indirect: f32 = Kind::Float(0.0, 0.0, 1e8), "Clamp Indirect";
    /// A frame ends early once its noise is this share of its brightness; 0 for never.
    noise_threshold: f32 = Kind::Float(0.0, 0.0, 1.0), "Noise Threshold";
    /// Remove what noise is left with OpenImageDenoise, guided by albedo and normal.
    denoise: bool = Kind::Bool(false), "Denoise";
    /// Seconds a frame may take; 0 for no limit.
    time_limit: f32 = Kind::Float(0.0, 0.0, 1e6), "Time Limit";
    /// Shape of the pixel filter.
    filter: Filter = Kind::Enum("BLACKMAN_HARRIS", &[
        ("BOX", "Box", "Sharpest"),
        ("GAUSSIAN", "Gaussian", "Softest"),
        ("BLACKMAN_HARRIS", "Blackman-Harris", "As Cycles by default"),
    ]), "Pixel Filter";
    /// Width of the pixel filter in pixels; a box is one pixel wide.
    filter_width: f32 = Kind::Float(1.5, 0.01, 10.0), "Width";
    /// The world is not seen by the camera.
    film_transparent: bool = Kind::Bool(false), "Transparent";
    /// Where the film is transparent, clear glass is, too.
    film_transparent_glass: bool = Kind::Bool(false), "Transparent Glass";
    /// Roughness up to which glass counts as clear.
    film_transparent_roughness: f32 = Kind::Float(0.1, 0.0, 1.0), "Roughness Threshold";
}

/// A value handed over for a setting.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A whole number.
    Int(i64),
    /// A number.
    Float(f32),
    /// A switch.
    Bool(bool),
    /// A word.
    Word(String),
}

impl Value {
    fn checked(self, spec: &SettingSpec) -> Result<Self> {
        let range = |value: &dyn std::fmt::Display, range: String| Error::Range {
            field: spec.name,
            value: value.to_string(),
            range,
        };
        match (spec.kind, self) {
            (Kind::Int(_, min, max), Value::Int(v)) => {
                if (i64::from(min)..=i64::from(max)).contains(&v) {
                    Ok(Value::Int(v))
                } else {
                    Err(range(&v, format!("{min} to {max}")))
                }
            }
            (Kind::Float(_, min, max), Value::Float(v)) if (min..=max).contains(&v) => {
                Ok(Value::Float(v))
            }
            (Kind::Float(_, min, max), Value::Float(v)) => {
                Err(range(&v, format!("{min} to {max}")))
            }
            (Kind::Float(..), Value::Int(v)) => Value::Float(v as f32).checked(spec),
            (Kind::Bool(_), Value::Bool(v)) => Ok(Value::Bool(v)),
            (Kind::Enum(_, items), Value::Word(v)) => {
                if items.iter().any(|item| item.0 == v) {
                    Ok(Value::Word(v))
                } else {
                    let words: Vec<_> = items.iter().map(|item| item.0).collect();
                    Err(range(&v, words.join(", ")))
                }
            }
            (kind, v) => Err(range(&format!("{v:?}"), format!("{kind:?}"))),
        }
    }
}

impl SettingSpec {
    /// The default of the setting.
    pub fn default(&self) -> Value {
        match self.kind {
            Kind::Int(default, ..) => Value::Int(i64::from(default)),
            Kind::Float(default, ..) => Value::Float(default),
            Kind::Bool(default) => Value::Bool(default),
            Kind::Enum(default, _) => Value::Word(default.to_owned()),
        }
    }
}

// A value that passed `checked` has the type of its setting, so the other arms are never taken.
impl From<Value> for u32 {
    fn from(value: Value) -> Self {
        if let Value::Int(v) = value {
            v as u32
        } else {
            0
        }
    }
}

impl From<Value> for f32 {
    fn from(value: Value) -> Self {
        if let Value::Float(v) = value { v } else { 0.0 }
    }
}

impl From<Value> for bool {
    fn from(value: Value) -> Self {
        value == Value::Bool(true)
    }
}

macro_rules! word {
    ($(#[doc = $doc:literal])+ $name:ident { $($variant:ident = $word:literal),+ }) => {
        $(#[doc = $doc])+
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the settings table describes each word")]
        pub enum $name { $($variant),+ }

        impl From<Value> for $name {
            fn from(value: Value) -> Self {
                let words = [$(($word, Self::$variant)),+];
                let found = words.iter().find(|(word, _)| value == Value::Word((*word).to_owned()));
                found.unwrap_or(&words[0]).1
            }
        }
    };
}

word! {
    /// How frames are rendered.
    Method { DualCone = "DUAL_CONE", Paper = "PAPER", Path = "PATH", Bilateral = "BILATERAL", IrradianceCache = "IRRADIANCE_CACHE" }
}
word! {
    /// From whom a pixel borrows.
    Share { Automatic = "AUTO", All = "ALL", Frames = "FRAMES" }
}
word! {
    /// Which borrowed samples of the paper's method are tested again for visibility.
    Recheck { None = "NONE", Lit = "LIT", All = "ALL" }
}
word! {
    /// Shape of the pixel filter.
    Filter { Box = "BOX", Gaussian = "GAUSSIAN", BlackmanHarris = "BLACKMAN_HARRIS" }
}

/// Numbers of a boundary array, borrowed from the caller.
#[derive(Debug, Clone, Copy)]
pub enum Numbers<'a> {
    /// 32-bit floats.
    F32(&'a [f32]),
    /// Unsigned 32-bit integers.
    U32(&'a [u32]),
    /// Signed 32-bit integers.
    I32(&'a [i32]),
    /// Unsigned 64-bit integers.
    U64(&'a [u64]),
}

impl Numbers<'_> {
    /// Element type.
    pub fn dtype(&self) -> Dtype {
        match self {
            Numbers::F32(_) => Dtype::F32,
            Numbers::U32(_) => Dtype::U32,
            Numbers::I32(_) => Dtype::I32,
            Numbers::U64(_) => Dtype::U64,
        }
    }
}

/// A boundary array as received.
#[derive(Debug, Clone)]
pub struct Given<'a> {
    /// Name in the contract.
    pub name: String,
    /// Lengths of its axes.
    pub shape: Vec<usize>,
    /// Its numbers, C-contiguous.
    pub numbers: Numbers<'a>,
}

/// Boundary arrays that keep to their table: every name is there, with its type, its shape and
/// finite numbers. Letters mean one length each throughout the table.
#[derive(Debug)]
pub struct Arrays<'a> {
    given: Vec<Given<'a>>,
    lengths: Vec<(&'static str, usize)>,
}

impl<'a> Arrays<'a> {
    /// Holds what was given to the table `specs`.
    ///
    /// # Errors
    /// The first array that is missing, unknown, of another type or shape, or not finite.
    pub fn checked(specs: &'static [ArraySpec], given: Vec<Given<'a>>) -> Result<Self> {
        if let Some(stranger) = given
            .iter()
            .find(|g| !specs.iter().any(|s| s.name == g.name))
        {
            return Err(Error::Unknown {
                name: stranger.name.clone(),
            });
        }
        let mut arrays = Self {
            given,
            lengths: Vec::new(),
        };
        for spec in specs {
            let found = arrays.given.iter().position(|g| g.name == spec.name);
            let index = found.ok_or(Error::Missing { field: spec.name })?;
            arrays.check(spec, index)?;
        }
        Ok(arrays)
    }

    fn check(&mut self, spec: &'static ArraySpec, index: usize) -> Result<()> {
        let given = &self.given[index];
        let dtype = given.numbers.dtype();
        if dtype != spec.dtype {
            return Err(Error::Dtype {
                field: spec.name,
                expected: spec.dtype.name(),
                got: dtype.name().to_owned(),
            });
        }
        let shape = given.shape.clone();
        let fits = shape.len() == spec.shape.len()
            && shape
                .iter()
                .zip(spec.shape)
                .all(|(&got, &want)| match want.parse::<usize>() {
                    Ok(fixed) => got == fixed,
                    Err(_) => self.length_fits(want, got),
                });
        if !fits {
            return Err(Error::Shape {
                field: spec.name,
                expected: print_shape(spec.shape),
                got: print_shape(&shape),
            });
        }
        let row_length = shape.iter().skip(1).product::<usize>().max(1);
        match self.given[index].numbers {
            Numbers::F32(values) if !spec.may_hold_nan() => {
                match values.iter().position(|v| !v.is_finite()) {
                    Some(at) => Err(Error::NotFinite {
                        field: spec.name,
                        row: at / row_length,
                    }),
                    None => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }

    /// Whether a letter has this length everywhere; the first use sets it.
    fn length_fits(&mut self, letter: &'static str, length: usize) -> bool {
        match self.lengths.iter().find(|(known, _)| *known == letter) {
            Some((_, known)) => *known == length,
            None => {
                self.lengths.push((letter, length));
                true
            }
        }
    }

    fn numbers(&self, name: &str) -> Numbers<'a> {
        let found = self.given.iter().find(|g| g.name == name);
        found.map_or(Numbers::F32(&[]), |g| g.numbers)
    }

    /// Length of a letter of the table.
    pub fn length(&self, letter: &str) -> usize {
        let found = self.lengths.iter().find(|(known, _)| *known == letter);
        found.map_or(0, |(_, length)| *length)
    }

    /// The numbers of a float array in the table.
    pub fn f32s(&self, name: &str) -> &'a [f32] {
        if let Numbers::F32(v) = self.numbers(name) {
            v
        } else {
            &[]
        }
    }

    /// The numbers of an unsigned array in the table.
    pub fn u32s(&self, name: &str) -> &'a [u32] {
        if let Numbers::U32(v) = self.numbers(name) {
            v
        } else {
            &[]
        }
    }

    /// The numbers of a signed array in the table.
    pub fn i32s(&self, name: &str) -> &'a [i32] {
        if let Numbers::I32(v) = self.numbers(name) {
            v
        } else {
            &[]
        }
    }

    /// The numbers of a 64-bit array in the table.
    pub fn u64s(&self, name: &str) -> &'a [u64] {
        if let Numbers::U64(v) = self.numbers(name) {
            v
        } else {
            &[]
        }
    }
}

impl ArraySpec {
    /// Pixels may hold NaN and infinities: files do, and one bad texel must not cost the picture.
    /// They are counted and read as black.
    fn may_hold_nan(&self) -> bool {
        self.name == "pixels"
    }
}

fn print_shape<T: std::fmt::Display>(shape: &[T]) -> String {
    let lengths: Vec<String> = shape.iter().map(T::to_string).collect();
    format!("({})", lengths.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given<'a>(name: &str, shape: &[usize], numbers: Numbers<'a>) -> Given<'a> {
        Given {
            name: name.into(),
            shape: shape.into(),
            numbers,
        }
    }

    const TABLE: &[ArraySpec] = &[
        array("points", F32, &["V", "3"], "m", ""),
        array("names", U32, &["V"], "", ""),
    ];

    fn check<'a>(points: Given<'a>, names: Given<'a>) -> Result<()> {
        Arrays::checked(TABLE, vec![points, names]).map(|_| ())
    }

    #[test]
    fn each_fault_is_named_with_its_field_and_row() {
        let names = given("names", &[1], Numbers::U32(&[7]));
        let good = given("points", &[1, 3], Numbers::F32(&[0.0; 3]));
        assert_eq!(check(good.clone(), names.clone()), Ok(()));
        let message = |e: Result<()>| e.err().map(|e| e.to_string()).unwrap_or_default();
        assert_eq!(
            message(check(
                given("points", &[2, 2], Numbers::F32(&[0.0; 4])),
                names.clone()
            )),
            "points: expected shape (V, 3), got (2, 2)"
        );
        let two = [0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0];
        let two_names = given("names", &[2], Numbers::U32(&[1, 2]));
        assert_eq!(
            message(check(
                given("points", &[2, 3], Numbers::F32(&two)),
                two_names.clone()
            )),
            "points[1] is not finite"
        );
        assert_eq!(
            message(check(good.clone(), two_names)),
            "names: expected shape (V), got (2)"
        );
        assert_eq!(
            message(check(
                good.clone(),
                given("names", &[1], Numbers::I32(&[7]))
            )),
            "names: expected dtype uint32, got int32"
        );
        assert_eq!(message(check(good.clone(), good)), "names is missing");
    }

    #[test]
    fn settings_have_defaults_and_refuse_what_is_out_of_range() {
        let settings = Settings::from_values(&[("samples".into(), Value::Int(7))]).unwrap();
        assert_eq!(
            settings,
            Settings {
                samples: 7,
                ..Settings::default()
            }
        );
        assert_eq!(Settings::default().method, Method::DualCone);
        assert_eq!(Settings::default().filter, Filter::BlackmanHarris);
        for (name, value) in [
            ("samples", Value::Int(0)),
            ("method", Value::Word("MAGIC".into())),
            ("time_limit", Value::Float(f32::NAN)),
            ("still_window", Value::Int(1)),
            ("colour", Value::Int(1)),
        ] {
            assert!(
                Settings::from_values(&[(name.into(), value)]).is_err(),
                "{name}"
            );
        }
    }
}
