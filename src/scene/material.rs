//! Materials: short lists of weighted closures, flattened from a shader tree.

/// What a closure does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClosureKind {
    /// Diffuse under a dielectric GGX coat, blended towards metal.
    Principled,
    /// Lambert.
    Diffuse,
    /// GGX with the closure's colour.
    Glossy,
    /// Light.
    Emission,
    /// Lets light pass straight on.
    Transparent,
}

impl ClosureKind {
    /// The kind with the contract's number.
    pub fn from_number(number: u32) -> Option<Self> {
        use ClosureKind::{Diffuse, Emission, Glossy, Principled, Transparent};
        let kinds = [Principled, Diffuse, Glossy, Emission, Transparent];
        kinds.get(number as usize).copied()
    }
}

/// One closure; which fields matter depends on its kind, see the contract.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs, reason = "the contract describes the fields")]
pub struct Closure {
    pub kind: ClosureKind,
    pub weight: f32,
    pub color: glam::Vec3A,
    pub color_image: Option<u32>,
    pub roughness: f32,
    pub roughness_image: Option<u32>,
    pub metallic: f32,
    pub ior: f32,
    pub specular: f32,
    pub alpha: f32,
    pub alpha_image: Option<u32>,
    pub emission: glam::Vec3A,
}

/// The closures of one material.
#[derive(Debug, Clone, Default)]
pub struct Material {
    /// The closures; their contributions add up.
    pub closures: Vec<Closure>,
}

impl Material {
    /// Whether a surface of it gives off light.
    pub fn is_emissive(&self) -> bool {
        let glows = |c: &Closure| c.weight > 0.0 && c.emission.max_element() > 0.0;
        self.closures.iter().any(glows)
    }

    /// Whether some of the light may pass straight through.
    pub fn is_see_through(&self) -> bool {
        self.closures.iter().any(|c| match c.kind {
            ClosureKind::Transparent => c.weight > 0.0,
            ClosureKind::Principled => c.alpha < 1.0 || c.alpha_image.is_some(),
            _ => false,
        })
    }
}
