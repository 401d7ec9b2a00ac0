//! The arrays.
//!
//! Shapes use letters for lengths that a caller chooses: V vertices, T triangles, I instances,
//! S material slots, M materials, N instructions, P operands, K constants, Q rows of tables,
//! A layers, L lights, H x W pixels, J moving instances, R placements of them, Y times while the
//! shutter is open, U parts of its time, E frames around, F instances that differ there, with W
//! vertices.

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

pub(super) const fn array(
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
        "material_bump_correction",
        U32,
        &["M"],
        "0 or 1",
        "Whether normals that bumps bend too far are bent back, and bumps shadow each other softly.",
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

impl ArraySpec {
    /// Pixels may hold NaN and infinities: files do, and one bad texel must not cost the picture.
    /// They are counted and read as black.
    pub(super) fn may_hold_nan(&self) -> bool {
        self.name == "pixels"
    }
}
