//! What lies above a surface and dims its light.

use glam::Vec3A;

use super::super::operation::Args;
use super::normal::unit_normal;
use crate::optics::{Coat, Layers, Sheen};

/// Share of a surface's own light that leaves it through sheen and coat of a Principled BSDF.
pub fn below_layers(a: &Args) -> Vec3A {
    let layers = Layers {
        normal: unit_normal(a.point, a.vector(0)),
        coat: Coat {
            weight: a.float(1).max(0.0),
            roughness: a.float(2),
            ior: a.float(3),
            tint: a.vector(4),
        },
        coat_normal: unit_normal(a.point, a.vector(5)),
        sheen: Sheen {
            weight: a.float(6).max(0.0),
            roughness: a.float(7),
            tint: a.vector(8),
        },
    };
    layers.left(a.point.incoming, a.point.geometric_normal)
}
