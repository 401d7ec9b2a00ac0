//! The one table of what instructions do.

use std::sync::Arc;

use glam::{Vec3A, Vec4};

use super::closure::{Closure, DISTRIBUTIONS, FILMED, METALS, PIGMENTS, SUBSURFACE_METHODS};
use super::ops::{
    closures, color, convert, input, layers, noise, normal, pattern, texture, vector, voronoi,
};
use super::point::Point;
use crate::image::Image;

/// What the parameter of an instruction means.
#[derive(Debug, Clone, Copy)]
pub enum Parameter {
    /// Nothing: it is zero.
    None,
    /// One choice of each list, the first list counting fastest.
    Modes(&'static [&'static [&'static str]]),
    /// An image of the frame.
    Image,
    /// First row of a table of [`super::TABLE_SIZE`] rows.
    Table,
    /// A layer of the mesh, or a pass of the user's own, by the hash of its name.
    Attribute,
}

/// What an instruction computes.
#[derive(Clone, Copy)]
pub(super) enum Run {
    /// A value.
    Value(fn(&Args) -> Vec3A),
    /// A closure.
    Closure(fn(&Args) -> Closure),
}

/// One kind of instruction.
pub struct Operation {
    /// Its name.
    pub name: &'static str,
    /// Its operands, called as Blender calls the inputs (or properties) of the node.
    pub inputs: &'static [&'static str],
    /// What its parameter means.
    pub parameter: Parameter,
    /// Whether it reads nothing but its operands, so that constants fold.
    pub(super) is_pure: bool,
    pub(super) run: Run,
}

impl Operation {
    /// Whether it adds a closure instead of computing a value.
    pub fn is_closure(&self) -> bool {
        matches!(self.run, Run::Closure(_))
    }

    /// Whether it reads a layer.
    pub(super) fn asks_layer(&self) -> bool {
        !self.is_closure() && matches!(self.parameter, Attribute)
    }

    /// Whether it reads where it is, beside its operands and layers.
    pub(super) fn asks_place(&self) -> bool {
        let is_still = self.is_closure() || self.is_pure || self.asks_layer();
        !is_still && !UNPLACED.contains(&self.name)
    }
}

/// Most lists of modes that an operation has.
pub(super) const MODE_LISTS: usize = 6;

/// What a function of the table reads.
pub struct Args<'a> {
    pub(super) point: &'a Point<'a>,
    pub(super) images: &'a [Arc<Image>],
    pub(super) tables: &'a [Vec4],
    pub(super) operands: &'a [u32],
    pub(super) constants: &'a [Vec3A],
    pub(super) values: &'a [Vec3A],
    pub(super) modes: [u8; MODE_LISTS],
    pub(super) parameter: u32,
}

/// Operands from here on are constants, those below are values.
pub(super) const FIRST_CONSTANT: u32 = 1 << 31;

impl Args<'_> {
    pub(super) fn vector(&self, input: usize) -> Vec3A {
        let operand = self.operands[input];
        if operand < FIRST_CONSTANT {
            self.values[operand as usize]
        } else {
            self.constants[(operand - FIRST_CONSTANT) as usize]
        }
    }

    pub(super) fn float(&self, input: usize) -> f32 {
        self.vector(input).x
    }

    pub(super) fn floats<const N: usize>(&self) -> [f32; N] {
        std::array::from_fn(|input| self.float(input))
    }

    pub(super) fn mode(&self, list: usize) -> usize {
        usize::from(self.modes[list])
    }

    pub(super) fn is_on(&self, list: usize) -> bool {
        self.modes[list] != 0
    }
}

const fn pure(
    name: &'static str,
    inputs: &'static [&'static str],
    parameter: Parameter,
    run: fn(&Args) -> Vec3A,
) -> Operation {
    Operation {
        name,
        inputs,
        parameter,
        is_pure: true,
        run: Run::Value(run),
    }
}

/// An operation that reads the point, or images.
const fn here(
    name: &'static str,
    inputs: &'static [&'static str],
    parameter: Parameter,
    run: fn(&Args) -> Vec3A,
) -> Operation {
    Operation {
        is_pure: false,
        ..pure(name, inputs, parameter, run)
    }
}

const fn closure(
    name: &'static str,
    inputs: &'static [&'static str],
    parameter: Parameter,
    run: fn(&Args) -> Closure,
) -> Operation {
    Operation {
        name,
        inputs,
        parameter,
        is_pure: false,
        run: Run::Closure(run),
    }
}

use Parameter::{Attribute, Modes, None, Table};

const OFF_ON: &[&str] = &["False", "True"];
const DIMENSIONS: &[&str] = &["1D", "2D", "3D", "4D"];

/// The operations that ask what is around the point.
pub(super) const AROUND: [&str; 2] = ["ambient_occlusion", "bevel"];

/// The operations that are not pure, but compute the same from the same operands all over a body.
pub(super) const UNPLACED: [&str; 9] = [
    "ramp_color",
    "ramp_alpha",
    "ramp_color_stepped",
    "ramp_alpha_stepped",
    "curves",
    "image_color",
    "image_alpha",
    "ies",
    "object_info",
];

/// Everything an instruction may do; its number is the row.
#[rustfmt::skip]
pub static OPERATIONS: &[Operation] = &[
    pure("luminance", &["Color"], None, convert::luminance),
    pure("average", &["Vector"], None, convert::average),
    pure("add", &["A", "B"], None, convert::add),
    pure("multiply", &["A", "B"], None, convert::multiply),
    pure("saturate", &["Value"], None, convert::saturate),
    pure("one_minus", &["Value"], None, convert::one_minus),
    pure("math", &["Value", "Value_001", "Value_002"], Modes(&[&convert::MATH_NAMES, OFF_ON]), convert::math),
    pure("clamp", &["Value", "Min", "Max"], Modes(&[&["MINMAX", "RANGE"]]), convert::clamp),
    pure("map_range", &["Value", "From Min", "From Max", "To Min", "To Max", "Steps"], Modes(&[&["LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"], OFF_ON, &["FLOAT", "FLOAT_VECTOR"]]), convert::map_range),
    pure("mix", &["Factor", "A", "B"], Modes(&[OFF_ON]), convert::mix),
    pure("vector_math", &["Vector", "Vector_001", "Vector_002", "Scale"], Modes(&[&vector::VECTOR_MATH_NAMES]), vector::math),
    pure("mapping", &["Vector", "Location", "Rotation", "Scale"], Modes(&[&["POINT", "TEXTURE", "VECTOR", "NORMAL"]]), vector::mapping),
    pure("vector_rotate", &["Vector", "Center", "Axis", "Angle", "Rotation"], Modes(&[&["AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"], OFF_ON]), vector::rotate),
    pure("transform", &["Vector", "X", "Y", "Z", "Location"], None, vector::transform),
    pure("combine", &["Red", "Green", "Blue"], Modes(&[&["RGB", "HSV", "HSL"]]), color::combine),
    pure("separate", &["Color"], Modes(&[&["RGB", "HSV", "HSL"], &["Red", "Green", "Blue"]]), color::separate),
    pure("mix_color", &["Factor_Float", "A_Color", "B_Color"], Modes(&[&color::BLEND_NAMES, OFF_ON, OFF_ON]), color::mix),
    pure("hue_saturation", &["Hue", "Saturation", "Value", "Fac", "Color"], None, color::hue_saturation),
    pure("bright_contrast", &["Color", "Bright", "Contrast"], None, color::bright_contrast),
    pure("gamma", &["Color", "Gamma"], None, color::gamma),
    pure("invert", &["Fac", "Color"], None, color::invert),
    pure("blackbody", &["Temperature"], None, color::blackbody),
    pure("wavelength", &["Wavelength"], None, color::wavelength),
    here("ramp_color", &["Fac"], Table, texture::ramp_color),
    here("ramp_alpha", &["Fac"], Table, texture::ramp_alpha),
    here("ramp_color_stepped", &["Fac"], Table, texture::ramp_color_stepped),
    here("ramp_alpha_stepped", &["Fac"], Table, texture::ramp_alpha_stepped),
    here("curves", &["Fac", "Value", "Range"], Table, texture::curves),
    here("image_color", &["Vector"], Parameter::Image, texture::image_color),
    here("image_alpha", &["Vector"], Parameter::Image, texture::image_alpha),
    here("image_box_color", &["Vector", "projection_blend"], Parameter::Image, texture::image_box_color),
    here("image_box_alpha", &["Vector", "projection_blend"], Parameter::Image, texture::image_box_alpha),
    here("ies", &["Vector"], Parameter::Image, texture::ies),
    pure("sphere_uv", &["Vector"], None, texture::sphere_uv),
    pure("tube_uv", &["Vector"], None, texture::tube_uv),
    pure("noise", &["Vector", "W", "Scale", "Detail", "Roughness", "Lacunarity", "Offset", "Gain", "Distortion"], Modes(&[DIMENSIONS, &["MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "FBM", "HETERO_TERRAIN"], OFF_ON, &["Fac", "Color"]]), noise::noise),
    pure("voronoi", &["Vector", "W", "Scale", "Detail", "Roughness", "Lacunarity", "Smoothness", "Exponent", "Randomness"], Modes(&[DIMENSIONS, &["EUCLIDEAN", "MANHATTAN", "CHEBYCHEV", "MINKOWSKI"], &["F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS"], OFF_ON, &["Distance", "Color", "Position", "W", "Radius"], &["LOOKUP3", "PCG"]]), voronoi::voronoi),
    pure("white_noise", &["Vector", "W"], Modes(&[DIMENSIONS, &["Value", "Color"]]), noise::white_noise),
    pure("wave", &["Vector", "Scale", "Distortion", "Detail", "Detail Scale", "Detail Roughness", "Phase Offset"], Modes(&[&["BANDS", "RINGS"], &["X", "Y", "Z", "DIAGONAL"], &["X", "Y", "Z", "SPHERICAL"], &["SIN", "SAW", "TRI"]]), pattern::wave),
    pure("magic", &["Vector", "Scale", "Distortion", "turbulence_depth"], Modes(&[&["Color", "Fac"]]), pattern::magic),
    pure("checker", &["Vector", "Color1", "Color2", "Scale"], Modes(&[&["Color", "Fac"]]), pattern::checker),
    pure("brick", &["Vector", "Color1", "Color2", "Mortar", "Scale", "Mortar Size", "Mortar Smooth", "Bias", "Brick Width", "Row Height", "offset", "offset_frequency", "squash", "squash_frequency"], Modes(&[&["Color", "Fac"]]), pattern::brick),
    pure("gradient", &["Vector"], Modes(&[&["LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "SPHERICAL", "QUADRATIC_SPHERE", "RADIAL"]]), pattern::gradient),
    here("attribute", &[], Attribute, input::attribute),
    here("attribute_or_one", &[], Attribute, input::attribute_or_one),
    here("attribute_alpha", &[], Attribute, input::attribute_alpha),
    here("geometry", &[], Modes(&[&["Position", "Normal", "True Normal", "Incoming", "Parametric", "Backfacing"]]), input::geometry),
    here("coordinate", &[], Modes(&[&["Normal", "Object", "Camera", "Window", "Reflection"]]), input::coordinate),
    here("object_info", &[], Modes(&[&["Location", "Color", "Alpha", "Object Index", "Random"]]), input::object_info),
    here("particle_info", &[], Modes(&[&["Index", "Random", "Age", "Lifetime", "Location", "Size", "Velocity", "Angular Velocity"]]), input::particle_info),
    here("hair_info", &[], Modes(&[&["Is Strand", "Intercept", "Length", "Thickness", "Tangent Normal", "Random"]]), input::hair_info),
    here("camera_data", &[], Modes(&[&["View Vector", "View Z Depth", "View Distance"]]), input::camera_data),
    here("light_path", &[], Modes(&[&input::LIGHT_PATH_NAMES]), input::light_path),
    here("light_falloff", &["Strength", "Smooth"], Modes(&[&["Quadratic", "Linear", "Constant"]]), input::light_falloff),
    here("vector_transform", &["Vector"], Modes(&[&["POINT", "VECTOR", "NORMAL"], &["WORLD", "OBJECT", "CAMERA"], &["WORLD", "OBJECT", "CAMERA"]]), input::vector_transform),
    here("wireframe", &["Size"], Modes(&[OFF_ON]), input::wireframe),
    here("ambient_occlusion", &["Distance", "Normal", "samples"], Modes(&[OFF_ON, OFF_ON]), input::ambient_occlusion),
    here("fresnel", &["IOR", "Normal"], None, normal::fresnel),
    here("layer_weight", &["Blend", "Normal"], Modes(&[&["Fresnel", "Facing"]]), normal::layer_weight),
    here("below_layers", &["Normal", "Coat Weight", "Coat Roughness", "Coat IOR", "Coat Tint", "Coat Normal", "Sheen Weight", "Sheen Roughness", "Sheen Tint"], None, layers::below_layers),
    here("normal_map", &["Strength", "Color", "Tangent", "Sign"], Modes(&[&["TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD"]]), normal::normal_map),
    here("bevel", &["Radius", "Normal", "samples"], None, input::bevel),
    here("bump", &["Strength", "Distance", "Normal", "Height", "Height X", "Height Y", "Filter Width"], Modes(&[OFF_ON, OFF_ON]), normal::bump),
    here("displacement", &["Height", "Midlevel", "Scale", "Normal"], Modes(&[&["OBJECT", "WORLD"]]), normal::displacement),
    here("vector_displacement", &["Vector", "Midlevel", "Scale", "Tangent", "Sign"], Modes(&[&["TANGENT", "OBJECT", "WORLD"]]), normal::vector_displacement),
    here("height", &["Displacement"], None, normal::height),
    here("uv_tangent", &[], Attribute, normal::uv_tangent),
    here("radial_tangent", &["Generated"], Modes(&[&["X", "Y", "Z"]]), normal::radial_tangent),
    closure("principled", &["Weight", "Base Color", "Metallic", "Roughness", "IOR", "Normal", "Diffuse Roughness", "Subsurface Weight", "Subsurface Radius", "Subsurface Scale", "Specular IOR Level", "Specular Tint", "Anisotropic", "Anisotropic Rotation", "Tangent", "Transmission Weight", "Coat Weight", "Coat Roughness", "Coat IOR", "Coat Tint", "Coat Normal", "Sheen Weight", "Sheen Roughness", "Sheen Tint", "Thin Film Thickness", "Thin Film IOR", "Subsurface IOR", "Subsurface Anisotropy"], Modes(&[OFF_ON, SUBSURFACE_METHODS, FILMED]), closures::principled),
    closure("diffuse", &["Weight", "Color", "Roughness", "Normal"], None, closures::diffuse),
    closure("glossy", &["Weight", "Color", "Roughness", "Anisotropy", "Rotation", "Normal", "Tangent"], Modes(&[DISTRIBUTIONS]), closures::glossy),
    closure("metallic", &["Weight", "Base Color", "Edge Tint", "IOR", "Extinction", "Roughness", "Anisotropy", "Rotation", "Normal", "Tangent", "Thin Film Thickness", "Thin Film IOR"], Modes(&[DISTRIBUTIONS, METALS]), closures::metallic),
    closure("glass", &["Weight", "Color", "Roughness", "IOR", "Normal", "Thin Film Thickness", "Thin Film IOR"], Modes(&[DISTRIBUTIONS]), closures::glass),
    closure("refraction", &["Weight", "Color", "Roughness", "IOR", "Normal"], Modes(&[DISTRIBUTIONS]), closures::refraction),
    closure("translucent", &["Weight", "Color", "Normal"], None, closures::translucent),
    closure("sheen", &["Weight", "Color", "Roughness", "Normal"], Modes(&[&["MICROFIBER", "ASHIKHMIN"]]), closures::sheen),
    closure("toon", &["Weight", "Color", "Size", "Smooth", "Normal"], Modes(&[&["DIFFUSE", "GLOSSY"]]), closures::toon),
    closure("hair", &["Weight", "Color", "Melanin", "Melanin Redness", "Tint", "Absorption Coefficient", "Roughness", "Radial Roughness", "Coat", "IOR", "Offset", "Random Color", "Random Roughness", "Random"], Modes(&[PIGMENTS]), closures::hair),
    closure("streak", &["Weight", "Color", "Offset", "RoughnessU", "RoughnessV", "Tangent"], Modes(&[&["Reflection", "Transmission"]]), closures::streak),
    closure("subsurface", &["Weight", "Color", "Scale", "Radius", "IOR", "Roughness", "Anisotropy", "Normal"], Modes(&[SUBSURFACE_METHODS]), closures::subsurface),
    closure("emission", &["Weight", "Color"], None, closures::emission),
    closure("transparent", &["Weight", "Color"], None, closures::transparent),
    closure("volume", &["Weight", "Scatter", "Absorption", "Emission", "Anisotropy"], None, closures::volume),
    closure("holdout", &["Weight"], None, closures::holdout),
    closure("bent", &["Normal"], None, closures::normal),
    closure("displaced", &["Displacement"], Modes(&[OFF_ON]), closures::displacement),
    closure("output", &["Color", "Value"], Attribute, closures::output),
];
