//! Materials: the programs of their nodes.

use std::sync::Arc;

use glam::{Vec2, Vec4};

use crate::image::Image;
use crate::shader::{Attributes, Draft, Point, Program, Use};

/// A triangle whose layers all hold one texture coordinate.
struct Uniform(Vec2);

impl Attributes for Uniform {
    fn corners(&self, _: u32) -> Option<[Vec4; 3]> {
        Some([self.0.extend(0.0).extend(1.0); 3])
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
    /// Its pass index.
    pub pass_index: f32,
}

impl Material {
    /// The programs that a draft serves.
    pub fn new(draft: &Draft) -> Self {
        Self {
            surface: draft.program(Use::Surface),
            transparency: draft.program(Use::Transparency),
            emission: draft.program(Use::Emission),
            pass_index: 0.0,
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
