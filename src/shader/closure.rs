//! What a program ends in: the ways in which a surface scatters and shines, with their values.

use glam::Vec3A;

/// One way in which a surface scatters or shines. Weights are those of the Mix and Add Shaders
/// above it. A normal or tangent of zero is the surface's own.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's nodes")]
pub enum Closure {
    /// Blender's Principled BSDF. Its emission and alpha are closures of their own.
    Principled(Principled),
    /// Lambert, or Oren-Nayar where it is rough.
    Diffuse {
        weight: f32,
        color: Vec3A,
        roughness: f32,
        normal: Vec3A,
    },
    /// GGX reflection.
    Glossy(Glossy),
    /// Reflection by a metal.
    Metallic(Metallic),
    /// GGX reflection and refraction by Fresnel.
    Glass(Glass),
    /// GGX refraction alone.
    Refraction(Glass),
    /// Lambert to the other side.
    Translucent {
        weight: f32,
        color: Vec3A,
        normal: Vec3A,
    },
    /// Sheen of microscopic fibres; Ashikhmin's velvet, or else Zeltner's.
    Sheen {
        weight: f32,
        color: Vec3A,
        roughness: f32,
        normal: Vec3A,
        is_velvet: bool,
    },
    /// Even light within a cone.
    Toon(Toon),
    /// A strand of tinted glass.
    Hair(Hair),
    /// The gleam of a thread.
    Streak(Streak),
    /// Light that leaves elsewhere than it enters.
    Subsurface(Subsurface),
    /// Light: radiance, weight included [W / (sr m^2)].
    Emission(Vec3A),
    /// Share of the light that passes straight on, weight included.
    Transparent(Vec3A),
    /// What fills the body.
    Volume(Volume),
    /// Share of the surface that is a hole in the picture.
    Holdout(f32),
    /// The surface's own normal from here on: closures that have it count as not bent.
    Normal(Vec3A),
    /// Where the surface goes, world space [m]: evaluated at vertices before anything is rendered.
    Displacement { offset: Vec3A, keeps_normals: bool },
    /// Neither: what the passes of a name show, as a colour or as a number.
    Output { name: u32, color: Vec3A, value: f32 },
}

/// Inputs of Blender's Glossy BSDF.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's node")]
pub struct Glossy {
    pub weight: f32,
    pub color: Vec3A,
    pub roughness: f32,
    pub anisotropy: f32,
    pub rotation: f32,
    pub normal: Vec3A,
    pub tangent: Vec3A,
    pub distribution: Distribution,
}

/// Inputs of Blender's Glass and Refraction BSDFs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's nodes")]
pub struct Glass {
    pub weight: f32,
    pub color: Vec3A,
    pub roughness: f32,
    pub ior: f32,
    pub normal: Vec3A,
    pub thin_film_thickness: f32,
    pub thin_film_ior: f32,
    pub distribution: Distribution,
}

/// Inputs of Blender's Metallic BSDF.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's node")]
pub struct Metallic {
    pub weight: f32,
    pub metal: Metal,
    pub roughness: f32,
    pub anisotropy: f32,
    pub rotation: f32,
    pub normal: Vec3A,
    pub tangent: Vec3A,
    pub thin_film_thickness: f32,
    pub thin_film_ior: f32,
    pub distribution: Distribution,
}

/// What a metal is known by, in the order of [`METALS`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's node")]
pub enum Metal {
    /// Its complex index of refraction.
    Conductor { index: Vec3A, extinction: Vec3A },
    /// Its colours.
    Colors { base: Vec3A, edge_tint: Vec3A },
}

/// What Blender calls them.
pub const METALS: &[&str] = &["PHYSICAL_CONDUCTOR", "F82"];

/// How microfacets lie, in the order of [`DISTRIBUTIONS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Distribution {
    /// GGX; light that bounces between microfacets is lost.
    Ggx,
    /// GGX, with that light.
    MultiGgx,
    /// Beckmann, without it.
    Beckmann,
}

/// What Blender calls them.
pub const DISTRIBUTIONS: &[&str] = &["GGX", "MULTI_GGX", "BECKMANN"];

/// What the film of Principled BSDF lies on: before Blender 5.0 on metal there was none.
pub const FILMED: &[&str] = &["METALS", "DIELECTRICS"];

/// Inputs of Blender's Toon BSDF.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's node")]
pub struct Toon {
    pub weight: f32,
    pub color: Vec3A,
    pub size: f32,
    pub smooth: f32,
    pub normal: Vec3A,
    pub is_glossy: bool,
}

/// Inputs of Blender's Principled Hair BSDF.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's node")]
pub struct Hair {
    pub weight: f32,
    pub pigment: Pigment,
    pub roughness: f32,
    pub radial_roughness: f32,
    pub coat: f32,
    pub ior: f32,
    pub offset: f32,
    pub random: f32,
    pub random_color: f32,
    pub random_roughness: f32,
}

/// What colours a hair, in the order of [`PIGMENTS`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pigment {
    /// Absorption per radius of the hair.
    Absorption(Vec3A),
    /// Melanin, 0 to 1, the share of it that is red, and a dye.
    Melanin {
        /// How much there is, as the eye judges it.
        amount: f32,
        /// Share of pheomelanin.
        redness: f32,
        /// Colour that many hairs have by the dye.
        tint: Vec3A,
    },
    /// The colour that many hairs have.
    Color(Vec3A),
}

/// What Blender calls them.
pub const PIGMENTS: &[&str] = &["ABSORPTION", "MELANIN", "COLOR"];

/// Inputs of Blender's Hair BSDF.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's node")]
pub struct Streak {
    pub weight: f32,
    pub color: Vec3A,
    pub offset: f32,
    /// RoughnessU and RoughnessV.
    pub widths: [f32; 2],
    pub tangent: Vec3A,
    pub passes: bool,
}

/// Inputs of Blender's Subsurface Scattering.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's node")]
pub struct Subsurface {
    pub weight: f32,
    pub color: Vec3A,
    pub scale: f32,
    pub radius: Vec3A,
    pub ior: f32,
    pub roughness: f32,
    pub anisotropy: f32,
    pub normal: Vec3A,
    pub method: SubsurfaceMethod,
}

/// How light scatters below a surface, in the order of [`SUBSURFACE_METHODS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SubsurfaceMethod {
    /// A walk; the radius is about the distance over which light spreads.
    Plain,
    /// A walk; the radius is the mean free path of a body of this colour.
    Skin,
    /// Christensen and Burley's profile of distances.
    Burley,
}

/// What Blender calls them.
pub const SUBSURFACE_METHODS: &[&str] = &["RANDOM_WALK", "RANDOM_WALK_SKIN", "BURLEY"];

/// An even medium. Blender's volume nodes are such ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    /// What mixing leaves of it.
    pub weight: f32,
    /// Scattering coefficient [1/m].
    pub scatter: Vec3A,
    /// Absorption coefficient [1/m].
    pub absorption: Vec3A,
    /// Light given off [W / (sr m^3)].
    pub emission: Vec3A,
    /// Mean cosine of scattering.
    pub anisotropy: f32,
}

/// Inputs of Blender's Principled BSDF.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the fields are the inputs of Blender's node")]
pub struct Principled {
    pub weight: f32,
    pub base_color: Vec3A,
    pub metallic: f32,
    pub roughness: f32,
    pub ior: f32,
    pub normal: Vec3A,
    pub diffuse_roughness: f32,
    pub subsurface_weight: f32,
    pub subsurface_radius: Vec3A,
    pub subsurface_scale: f32,
    pub subsurface_ior: f32,
    pub subsurface_anisotropy: f32,
    pub subsurface_method: SubsurfaceMethod,
    pub specular_ior_level: f32,
    pub specular_tint: Vec3A,
    pub anisotropic: f32,
    pub anisotropic_rotation: f32,
    pub tangent: Vec3A,
    pub transmission_weight: f32,
    pub coat_weight: f32,
    pub coat_roughness: f32,
    pub coat_ior: f32,
    pub coat_tint: Vec3A,
    pub coat_normal: Vec3A,
    pub sheen_weight: f32,
    pub sheen_roughness: f32,
    pub sheen_tint: Vec3A,
    pub thin_film_thickness: f32,
    pub thin_film_ior: f32,
    pub has_filmed_metal: bool,
    pub is_multiscatter: bool,
}
