//! Materials: the programs of their nodes.

use std::sync::Arc;

use glam::{Vec2, Vec3A, Vec4};

use crate::image::Image;
use crate::shader::{Attributes, Closure, Draft, Point, Program, Use};

/// A triangle whose layers all hold one texture coordinate.
struct Uniform(Vec2);

impl Attributes for Uniform {
    fn corners(&self, _: u32) -> Option<[Vec4; 3]> {
        Some([self.0.extend(0.0).extend(1.0); 3])
    }
}

/// What a place is filled with: coefficients per metre.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Medium {
    /// Scattering coefficient [1/m].
    pub scattering: Vec3A,
    /// Absorption coefficient [1/m].
    pub absorption: Vec3A,
    /// Light given off [W / (sr m^3)].
    pub emission: Vec3A,
    /// Mean cosine of scattering (Henyey and Greenstein).
    pub anisotropy: f32,
}

impl Medium {
    /// Share of the light that is lost [1/m].
    pub fn extinction(&self) -> Vec3A {
        self.scattering + self.absorption
    }

    /// Both at the same place.
    pub fn and(self, other: Self) -> Self {
        let [own, added] = [&self, &other].map(|m| m.scattering.element_sum());
        let share = added / (own + added).max(f32::MIN_POSITIVE);
        Self {
            scattering: self.scattering + other.scattering,
            absorption: self.absorption + other.absorption,
            emission: self.emission + other.emission,
            anisotropy: self.anisotropy + share * (other.anisotropy - self.anisotropy),
        }
    }

    /// The same, thicker.
    pub fn times(self, factor: f32) -> Self {
        Self {
            scattering: self.scattering * factor,
            absorption: self.absorption * factor,
            emission: self.emission * factor,
            ..self
        }
    }

    /// What a program says of a point; `None` for nothing.
    pub fn at(program: &Program, point: &Point, images: &[Arc<Image>]) -> Option<Self> {
        let mut found: Option<Self> = None;
        program.run(point, images, &mut |closure| {
            if let Closure::Volume(volume) = closure {
                let medium = Self {
                    scattering: volume.weight * volume.scatter,
                    absorption: volume.weight * volume.absorption,
                    emission: volume.weight * volume.emission,
                    anisotropy: volume.anisotropy,
                };
                found = Some(found.map_or(medium, |other| other.and(medium)));
            }
        });
        found.filter(|m| m.extinction() != Vec3A::ZERO || m.emission != Vec3A::ZERO)
    }
}

/// What fills a body of a material.
#[derive(Clone)]
pub enum Filling {
    /// The same everywhere.
    Even(Medium),
    /// What a program says of each body, or of each place.
    Uneven(Program),
}

impl Filling {
    /// What a program fills a body with; `None` for nothing.
    fn of(program: Program) -> Option<Self> {
        if program.is_empty() {
            return None;
        }
        if !program.is_uniform() {
            return Some(Self::Uneven(program));
        }
        Medium::at(&program, &Point::nowhere(), &[]).map(Self::Even)
    }
}

/// Where vertices of a material go.
#[derive(Clone)]
pub struct Displacement {
    /// The program that tells.
    program: Program,
    /// Whether smooth normals stay what they were, because the surface bends them by itself.
    pub keeps_normals: bool,
}

impl Displacement {
    /// What a program says; `None` where vertices stay.
    fn of(program: Program) -> Option<Self> {
        let mut keeps_normals = None;
        program.run(&Point::nowhere(), &[], &mut |closure| {
            if let Closure::Displacement {
                keeps_normals: keeps,
                ..
            } = *closure
            {
                keeps_normals = Some(keeps);
            }
        });
        Some(Self {
            program,
            keeps_normals: keeps_normals?,
        })
    }

    /// Where a point goes, world space [m].
    pub fn offset(&self, point: &Point, images: &[Arc<Image>]) -> Vec3A {
        let mut sum = Vec3A::ZERO;
        self.program.run(point, images, &mut |closure| {
            if let Closure::Displacement { offset, .. } = *closure {
                sum += offset;
            }
        });
        sum
    }
}

/// A material, as programs for each use. All of them come from one program of the add-on.
#[derive(Clone, Default)]
pub struct Material {
    /// What scatters and shines, given that the ray did not pass straight on.
    pub surface: Program,
    /// Which share of the light passes straight on.
    pub transparency: Program,
    /// Which light leaves on its own, given that the ray did not pass straight on.
    pub emission: Program,
    /// What fills a body of it.
    pub medium: Option<Filling>,
    /// Where vertices of it go.
    pub displacement: Option<Displacement>,
    /// What passes of the user's own show of it.
    pub output: Program,
    /// Its pass index.
    pub pass_index: f32,
    /// Whether rays that look for a light pass it where others do.
    pub has_transparent_shadow: bool,
    /// Whether bumps are bent and shadowed so that the picture of its closures hangs together.
    pub has_bump_correction: bool,
}

impl Material {
    /// The programs that a draft serves.
    pub fn new(draft: &Draft) -> Self {
        Self {
            surface: draft.program(Use::Surface),
            transparency: draft.program(Use::Transparency),
            emission: draft.program(Use::Emission),
            medium: Filling::of(draft.program(Use::Volume)),
            displacement: Displacement::of(draft.program(Use::Displacement)),
            output: draft.program(Use::Output),
            pass_index: 0.0,
            has_transparent_shadow: true,
            has_bump_correction: true,
        }
    }

    /// What it does at a point with this texture coordinate, printed.
    pub fn closures(&self, images: &[Arc<Image>], uv: Vec2) -> Vec<String> {
        let square = Uniform(uv);
        let point = Point {
            attributes: &square,
            ..Point::nowhere()
        };
        let mut found = Vec::new();
        for program in [&self.surface, &self.transparency] {
            program.run(&point, images, &mut |closure| {
                found.push(format!("{closure:?}"))
            });
        }
        found
    }

    /// Whether a surface of it may give off light.
    pub fn is_emissive(&self) -> bool {
        !self.emission.is_empty()
    }

    /// Whether some of the light may pass straight through.
    pub fn is_see_through(&self) -> bool {
        !self.transparency.is_empty()
    }
}

#[cfg(test)]
impl Material {
    /// A material of closures with constant inputs, by name; inputs left out are zero.
    pub(crate) fn of(closures: &[(&str, &[(&str, f32)])]) -> Self {
        use crate::shader::{Instructions, OPERATIONS};
        let (mut instructions, mut operands, mut constants) = (vec![], vec![], vec![]);
        for (name, given) in closures {
            let number = OPERATIONS.iter().position(|o| o.name == *name).unwrap();
            instructions.push([number as u32, operands.len() as u32, 0, 0]);
            for input in OPERATIONS[number].inputs {
                let value = given.iter().find(|(known, _)| known == input);
                operands.push((1 << 31) + constants.len() as u32);
                constants.push([value.map_or(0.0, |(_, value)| *value); 3]);
            }
        }
        let instructions = Instructions {
            instructions: &instructions,
            operands: &operands,
            constants: &constants,
            tables: [].into(),
            images: 0,
        };
        let rows = 0..instructions.instructions.len();
        Self::new(&instructions.draft(rows).unwrap())
    }
}
