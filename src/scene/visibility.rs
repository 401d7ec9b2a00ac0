//! Which rays see a thing: Blender's Ray Visibility.

use crate::shader::RayKind;

/// A set of kinds of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Visibility(u32);

impl Visibility {
    /// Seen by every ray.
    pub const ALL: Self = Self(0b1_1111);

    /// From the contract's bits: [`RayKind`] in the order of its variants.
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits & Self::ALL.0)
    }

    /// Whether rays of this kind see it.
    pub const fn includes(self, kind: RayKind) -> bool {
        self.0 & (1 << kind as u32) != 0
    }

    /// Not seen by rays of this kind.
    pub const fn without(self, kind: RayKind) -> Self {
        Self(self.0 & !(1 << kind as u32))
    }

    /// Seen by rays of this kind as well.
    pub const fn with(self, kind: RayKind) -> Self {
        Self(self.0 | 1 << kind as u32)
    }
}

/// The things that a light lights and those that stop its light, as numbers of sets; 0 is the set of
/// all things. Blender's light linking and shadow linking, and its light group.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Links {
    /// What is lit.
    pub receivers: u8,
    /// What stops the light.
    pub blockers: u8,
    /// The light group whose pass shows it; 0 for none.
    pub group: u8,
}

/// The sets that a thing is in: a bit for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Membership {
    /// Sets of things that are lit.
    pub receivers: u64,
    /// Sets of things that stop light.
    pub blockers: u64,
}

impl Membership {
    /// In every set.
    pub const ALL: Self = Self {
        receivers: u64::MAX,
        blockers: u64::MAX,
    };

    /// Whether a light of these links lights the thing.
    pub const fn is_lit_by(self, links: Links) -> bool {
        self.receivers >> links.receivers & 1 != 0
    }

    /// Whether the thing stops light of these links.
    pub const fn stops(self, links: Links) -> bool {
        self.blockers >> links.blockers & 1 != 0
    }
}

/// How far the light of a lamp, of a glowing surface or of the surroundings reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reach {
    /// The rays that find it. Without shadow rays nothing stops its light.
    pub visibility: Visibility,
    /// Number of the last vertex of a path that it lights, counted from 0 at the camera's surface.
    pub max_bounces: u32,
    /// The things that it lights and that stop it.
    pub links: Links,
}

impl Reach {
    /// Every ray, every vertex.
    pub const ALL: Self = Self {
        visibility: Visibility::ALL,
        max_bounces: u32::MAX,
        links: Links {
            receivers: 0,
            blockers: 0,
            group: 0,
        },
    };

    /// Whether a vertex of a path is lit by what a ray of this kind finds.
    pub const fn includes(self, kind: RayKind, vertex: u32) -> bool {
        self.visibility.includes(kind) && vertex <= self.max_bounces
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use RayKind::{Camera, Diffuse, Glossy, Shadow, Transmission};

    #[test]
    fn bits_name_the_kinds_in_their_order() {
        for (bit, kind) in [Camera, Diffuse, Glossy, Transmission, Shadow]
            .iter()
            .enumerate()
        {
            let only = Visibility::from_bits(1 << bit);
            assert!(only.includes(*kind) && Visibility::ALL.includes(*kind));
            assert_eq!(Visibility::from_bits(0).with(*kind), only);
            assert!(!Visibility::from_bits(!(1 << bit)).includes(*kind));
        }
    }

    #[test]
    fn things_are_lit_by_the_sets_that_they_are_in() {
        let thing = Membership {
            receivers: 0b101,
            blockers: 0b011,
        };
        let links = |receivers, blockers| Links {
            receivers,
            blockers,
            group: 0,
        };
        assert!(thing.is_lit_by(links(0, 1)) && thing.is_lit_by(links(2, 1)));
        assert!(!thing.is_lit_by(links(1, 1)));
        assert!(thing.stops(links(1, 1)) && !thing.stops(links(1, 2)));
        assert!(Membership::ALL.is_lit_by(links(63, 63)));
    }

    #[test]
    fn light_ends_after_its_last_bounce() {
        let reach = Reach {
            max_bounces: 1,
            ..Reach::ALL
        };
        assert!(reach.includes(Diffuse, 1) && !reach.includes(Diffuse, 2));
    }
}
