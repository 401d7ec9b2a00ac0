//! What layers leave of that which lies below them: in Blender's Principled BSDF a sheen above a coat
//! above all else, its light included.

use std::f32::consts::TAU;

use glam::Vec3A;

use super::energy;
use super::fresnel::{Curve, Fresnel, f0_from_ior};
use crate::math::reflecting_normal;

/// The weight that is left below a layer of this albedo, which includes the weight.
pub fn below(weight: Vec3A, albedo: Vec3A) -> Vec3A {
    let share = Vec3A::select(weight.cmpgt(Vec3A::ZERO), albedo / weight, Vec3A::ZERO);
    weight * (1.0 - share.max_element()).clamp(0.0, 1.0)
}

/// Fibres above a surface.
#[derive(Debug, Clone, Copy)]
pub struct Sheen {
    /// Its weight, from zero on.
    pub weight: f32,
    /// Roughness in [0, 1].
    pub roughness: f32,
    /// What the fibres reflect.
    pub tint: Vec3A,
}

impl Sheen {
    /// Its weight as a colour.
    pub fn color(&self) -> Vec3A {
        self.weight * self.tint.max(Vec3A::ZERO)
    }

    /// Share of white light that white fibres reflect, seen under this cosine: a rational fit by
    /// Stephen Hill that MaterialX uses, off by 0.003 on average.
    pub fn albedo(roughness: f32, cos: f32) -> f32 {
        let (x, y) = (cos.min(1.0), roughness.clamp(0.01, 1.0));
        let width = y * (0.020_660_7 + 1.58491 * y) / (0.037_942_4 + y * (1.32227 + y));
        let middle =
            y * (-0.193_854 + y * (-1.14885 + y * (1.7932 - 0.95943 * y * y))) / (0.046_391 + y);
        let floor = y * (0.000_654_023 + (-0.020_781_8 + 0.119_681 * y) * y)
            / (1.26264 + y * (-1.92021 + y));
        let z = (x - middle) / width;
        ((-0.5 * z * z).exp() / (width * TAU.sqrt()) + floor).clamp(0.0, 1.0)
    }
}

/// Clear varnish above a surface.
#[derive(Debug, Clone, Copy)]
pub struct Coat {
    /// Its weight, from zero on.
    pub weight: f32,
    /// Roughness in [0, 1], the square root of the GGX alpha.
    pub roughness: f32,
    /// Index of refraction.
    pub ior: f32,
    /// What light keeps that passes it straight.
    pub tint: Vec3A,
}

impl Coat {
    fn index(&self) -> f32 {
        self.ior.max(1.0)
    }

    /// How its microfacets reflect.
    pub fn fresnel(&self) -> Fresnel {
        let ior = self.index();
        let f0 = Vec3A::splat(f0_from_ior(ior));
        Fresnel::new(Curve::Dielectric { ior }, f0, Vec3A::ONE)
    }

    /// What light keeps of its colour, seen under this cosine: on a slant the tint acts along the
    /// longer way of the refracted ray (Beer's law).
    pub fn passed(&self, cos: f32) -> Vec3A {
        let tint = self.tint.max(Vec3A::ZERO);
        if tint == Vec3A::ONE {
            return Vec3A::ONE;
        }
        let (cos, ior) = (cos.min(1.0), self.index());
        let cos_refracted = (1.0 - (1.0 - cos * cos) / (ior * ior)).max(0.0).sqrt();
        Vec3A::ONE.lerp(tint.powf(1.0 / cos_refracted), self.weight)
    }
}

/// Sheen and coat, with their unit shading normals.
#[derive(Debug, Clone, Copy)]
pub struct Layers {
    /// On top.
    pub sheen: Sheen,
    /// Below it.
    pub coat: Coat,
    /// Normal of what lies below.
    pub normal: Vec3A,
    /// Normal of the coat.
    pub coat_normal: Vec3A,
}

impl Layers {
    /// The normal of the sheen: it lies on the coat as far as there is one.
    pub fn sheen_normal(&self) -> Vec3A {
        let between = self
            .normal
            .lerp(self.coat_normal, self.coat.weight.min(1.0));
        between.normalize_or(self.normal)
    }

    /// Share of the light from below that leaves in direction `wo` of a surface whose geometric
    /// normal is `up`, both unit.
    pub fn left(&self, wo: Vec3A, up: Vec3A) -> Vec3A {
        let cos = |normal: Vec3A| wo.dot(normal).max(1e-6);
        let mut left = Vec3A::ONE;
        if self.sheen.weight > 0.0 {
            let albedo = Sheen::albedo(self.sheen.roughness, cos(self.sheen_normal()));
            left = below(left, self.sheen.color() * albedo);
        }
        if self.coat.weight > 0.0 {
            let cos = cos(reflecting_normal(self.coat_normal, wo, up));
            let roughness = self.coat.roughness.clamp(0.0, 1.0);
            let (_, albedo) = energy::multiscatter(&self.coat.fresnel(), roughness, cos);
            left = below(left, left * self.coat.weight * albedo) * self.coat.passed(cos);
        }
        left
    }
}
