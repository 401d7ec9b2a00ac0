//! Closures from their operands. What a program computes may be no number; a closure's values
//! always are.

use glam::Vec3A;

use super::super::closure::{
    Closure, Distribution, Glass, Glossy, Hair, Metal, Metallic, Pigment, Principled, Streak,
    Subsurface, SubsurfaceMethod, Toon, Volume,
};
use super::super::operation::Args;

fn vector(a: &Args, input: usize) -> Vec3A {
    let value = a.vector(input);
    if value.is_finite() {
        value
    } else {
        Vec3A::ZERO
    }
}

fn float(a: &Args, input: usize) -> f32 {
    vector(a, input).x
}

fn weight(a: &Args) -> f32 {
    float(a, 0).max(0.0)
}

pub fn principled(a: &Args) -> Closure {
    Closure::Principled(Principled {
        weight: weight(a),
        base_color: vector(a, 1),
        metallic: float(a, 2),
        roughness: float(a, 3),
        ior: float(a, 4),
        normal: vector(a, 5),
        diffuse_roughness: float(a, 6),
        subsurface_weight: float(a, 7),
        subsurface_radius: vector(a, 8),
        subsurface_scale: float(a, 9),
        specular_ior_level: float(a, 10),
        specular_tint: vector(a, 11),
        anisotropic: float(a, 12),
        anisotropic_rotation: float(a, 13),
        tangent: vector(a, 14),
        transmission_weight: float(a, 15),
        coat_weight: float(a, 16),
        coat_roughness: float(a, 17),
        coat_ior: float(a, 18),
        coat_tint: vector(a, 19),
        coat_normal: vector(a, 20),
        sheen_weight: float(a, 21),
        sheen_roughness: float(a, 22),
        sheen_tint: vector(a, 23),
        thin_film_thickness: float(a, 24),
        thin_film_ior: float(a, 25),
        subsurface_ior: float(a, 26),
        subsurface_anisotropy: float(a, 27),
        subsurface_method: subsurface_method(a, 1),
        has_filmed_metal: !a.is_on(2),
        is_multiscatter: a.is_on(0),
    })
}

pub fn diffuse(a: &Args) -> Closure {
    Closure::Diffuse {
        weight: weight(a),
        color: vector(a, 1),
        roughness: float(a, 2),
        normal: vector(a, 3),
    }
}

fn distribution(a: &Args) -> Distribution {
    [
        Distribution::Ggx,
        Distribution::MultiGgx,
        Distribution::Beckmann,
    ][a.mode(0)]
}

pub fn glossy(a: &Args) -> Closure {
    Closure::Glossy(Glossy {
        weight: weight(a),
        color: vector(a, 1),
        roughness: float(a, 2),
        anisotropy: float(a, 3),
        rotation: float(a, 4),
        normal: vector(a, 5),
        tangent: vector(a, 6),
        distribution: distribution(a),
    })
}

pub fn metallic(a: &Args) -> Closure {
    let metal = match a.mode(1) {
        0 => Metal::Conductor {
            index: vector(a, 3).max(Vec3A::ZERO),
            extinction: vector(a, 4).max(Vec3A::ZERO),
        },
        _ => Metal::Colors {
            base: vector(a, 1).clamp(Vec3A::ZERO, Vec3A::ONE),
            edge_tint: vector(a, 2).clamp(Vec3A::ZERO, Vec3A::ONE),
        },
    };
    Closure::Metallic(Metallic {
        weight: weight(a),
        metal,
        roughness: float(a, 5),
        anisotropy: float(a, 6),
        rotation: float(a, 7),
        normal: vector(a, 8),
        tangent: vector(a, 9),
        thin_film_thickness: float(a, 10),
        thin_film_ior: float(a, 11),
        distribution: distribution(a),
    })
}

fn interface(a: &Args) -> Glass {
    Glass {
        weight: weight(a),
        color: vector(a, 1),
        roughness: float(a, 2),
        ior: float(a, 3),
        normal: vector(a, 4),
        thin_film_thickness: 0.0,
        thin_film_ior: 1.0,
        distribution: distribution(a),
    }
}

pub fn glass(a: &Args) -> Closure {
    Closure::Glass(Glass {
        thin_film_thickness: float(a, 5),
        thin_film_ior: float(a, 6),
        ..interface(a)
    })
}

pub fn refraction(a: &Args) -> Closure {
    Closure::Refraction(interface(a))
}

pub fn translucent(a: &Args) -> Closure {
    Closure::Translucent {
        weight: weight(a),
        color: vector(a, 1),
        normal: vector(a, 2),
    }
}

pub fn sheen(a: &Args) -> Closure {
    Closure::Sheen {
        weight: weight(a),
        color: vector(a, 1),
        roughness: float(a, 2),
        normal: vector(a, 3),
        is_velvet: a.is_on(0),
    }
}

pub fn toon(a: &Args) -> Closure {
    Closure::Toon(Toon {
        weight: weight(a),
        color: vector(a, 1),
        size: float(a, 2),
        smooth: float(a, 3),
        normal: vector(a, 4),
        is_glossy: a.is_on(0),
    })
}

pub fn hair(a: &Args) -> Closure {
    Closure::Hair(Hair {
        weight: weight(a),
        pigment: match a.mode(0) {
            0 => Pigment::Absorption(vector(a, 5)),
            1 => Pigment::Melanin {
                amount: float(a, 2),
                redness: float(a, 3),
                tint: vector(a, 4),
            },
            _ => Pigment::Color(vector(a, 1)),
        },
        roughness: float(a, 6),
        radial_roughness: float(a, 7),
        coat: float(a, 8),
        ior: float(a, 9),
        offset: float(a, 10),
        random_color: float(a, 11),
        random_roughness: float(a, 12),
        random: float(a, 13),
    })
}

pub fn streak(a: &Args) -> Closure {
    Closure::Streak(Streak {
        weight: weight(a),
        color: vector(a, 1),
        offset: float(a, 2),
        widths: [float(a, 3), float(a, 4)],
        tangent: vector(a, 5),
        passes: a.is_on(0),
    })
}

fn subsurface_method(a: &Args, list: usize) -> SubsurfaceMethod {
    [
        SubsurfaceMethod::Plain,
        SubsurfaceMethod::Skin,
        SubsurfaceMethod::Burley,
    ][a.mode(list)]
}

pub fn subsurface(a: &Args) -> Closure {
    Closure::Subsurface(Subsurface {
        weight: weight(a),
        color: vector(a, 1),
        scale: float(a, 2),
        radius: vector(a, 3),
        ior: float(a, 4),
        roughness: float(a, 5),
        anisotropy: float(a, 6),
        normal: vector(a, 7),
        method: subsurface_method(a, 0),
    })
}

pub fn volume(a: &Args) -> Closure {
    Closure::Volume(Volume {
        weight: weight(a),
        scatter: vector(a, 1).max(Vec3A::ZERO),
        absorption: vector(a, 2).max(Vec3A::ZERO),
        emission: vector(a, 3).max(Vec3A::ZERO),
        anisotropy: float(a, 4).clamp(-0.999, 0.999),
    })
}

/// May be below zero: users take light away with it, as in Cycles.
pub fn emission(a: &Args) -> Closure {
    Closure::Emission(weight(a) * vector(a, 1))
}

pub fn transparent(a: &Args) -> Closure {
    Closure::Transparent((weight(a) * vector(a, 1)).max(Vec3A::ZERO))
}

pub fn output(a: &Args) -> Closure {
    Closure::Output {
        name: a.parameter,
        color: vector(a, 0),
        value: float(a, 1),
    }
}

pub fn normal(a: &Args) -> Closure {
    Closure::Normal(vector(a, 0))
}

pub fn displacement(a: &Args) -> Closure {
    Closure::Displacement {
        offset: vector(a, 0),
        keeps_normals: a.is_on(0),
    }
}

pub fn holdout(a: &Args) -> Closure {
    Closure::Holdout(weight(a))
}
