//! Programs: checked, folded, and run.

use std::ops::Range;
use std::sync::Arc;

use glam::{Vec3A, Vec4};

use super::closure::Closure;
use super::operation::{
    AROUND, Args, FIRST_CONSTANT, MODE_LISTS, OPERATIONS, Operation, Parameter, Run,
};
use super::ops::TABLE_SIZE;
use super::point::{FILTER_WIDTH, Point};
use crate::error::{Error, Result};
use crate::image::Image;

/// The boundary arrays of all programs of a frame. Instruction `i` of a program computes its value
/// number `i`; an operand names a value before it, or from 2^31 on a constant.
pub struct Instructions<'a> {
    /// Operation, first operand, parameter, and at which of the three points it reads.
    pub instructions: &'a [[u32; 4]],
    /// Operands of all instructions, concatenated.
    pub operands: &'a [u32],
    /// Constants.
    pub constants: &'a [[f32; 3]],
    /// Rows of all tables, concatenated.
    pub tables: Arc<[Vec4]>,
    /// How many images the frame has.
    pub images: usize,
}

/// What a program is run for; it keeps only the instructions that this needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// Whatever scatters or shines, given that the ray did not pass straight on.
    Surface,
    /// Which share of the light passes straight on.
    Transparency,
    /// Which light leaves on its own.
    Emission,
    /// What fills the body.
    Volume,
    /// Where vertices go.
    Displacement,
    /// What passes of the user's own show.
    Output,
}

impl Use {
    fn wants(self, name: &str) -> bool {
        match self {
            Use::Surface => !matches!(name, "transparent" | "volume" | "displaced" | "output"),
            Use::Transparency => name == "transparent",
            Use::Emission => name == "emission",
            Use::Volume => name == "volume",
            Use::Displacement => name == "displaced",
            Use::Output => name == "output",
        }
    }
}

/// What a step does.
#[derive(Clone)]
enum Act {
    Run(Run),
    /// Hands over a closure that is the same everywhere.
    Known(Box<Closure>),
}

/// One instruction of a program that is ready to run.
#[derive(Clone)]
struct Step {
    act: Act,
    first_operand: u32,
    register: u32,
    parameter: u32,
    inputs: u8,
    variation: u8,
    modes: [u8; MODE_LISTS],
}

/// A program that is ready to run.
#[derive(Clone, Default)]
pub struct Program {
    steps: Vec<Step>,
    operands: Vec<u32>,
    constants: Arc<[Vec3A]>,
    tables: Arc<[Vec4]>,
    registers: usize,
    has_variations: bool,
    /// How far away the neighbours are at which bumps look, in pixels.
    filter_width: f32,
    asks_around: bool,
    asks_place: bool,
    asks_ray: bool,
    /// The layers that it reads.
    attributes: Vec<u32>,
}

/// Programs that need no more registers than this find them on the stack, cleared at once.
const FEW_REGISTERS: usize = 8;
/// Beyond this they are allocated at each run, which programs of hundreds of nodes do not notice.
const MANY_REGISTERS: usize = 64;

impl Program {
    /// Whether it does nothing.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Whether it does the same everywhere.
    pub fn is_uniform(&self) -> bool {
        self.registers == 0
    }

    /// Whether what it does depends on the things around.
    pub fn asks_around(&self) -> bool {
        self.asks_around
    }

    /// Whether what it does may differ between two points of a body that has some layers.
    pub fn differs_in(&self, has_layer: impl Fn(u32) -> bool) -> bool {
        self.asks_place || self.attributes.iter().any(|&key| has_layer(key))
    }

    /// Whether what it does depends on the ray that arrives.
    pub fn asks_ray(&self) -> bool {
        self.asks_ray
    }

    /// Runs it at a point and hands over the closures in their order.
    pub fn run(&self, point: &Point, images: &[Arc<Image>], emit: &mut dyn FnMut(&Closure)) {
        let variations;
        let points = if self.has_variations {
            variations = point.variations(self.filter_width);
            [&variations[0], &variations[1], &variations[2]]
        } else {
            [point; 3]
        };
        if self.registers <= FEW_REGISTERS {
            self.run_in(&mut [Vec3A::ZERO; FEW_REGISTERS], points, images, emit);
        } else if self.registers <= MANY_REGISTERS {
            self.run_in(&mut [Vec3A::ZERO; MANY_REGISTERS], points, images, emit);
        } else {
            let mut values = vec![Vec3A::ZERO; self.registers];
            self.run_in(&mut values, points, images, emit);
        }
    }

    fn run_in(
        &self,
        values: &mut [Vec3A],
        points: [&Point; 3],
        images: &[Arc<Image>],
        emit: &mut dyn FnMut(&Closure),
    ) {
        for step in &self.steps {
            let run = match &step.act {
                Act::Known(closure) => {
                    emit(closure);
                    continue;
                }
                Act::Run(run) => run,
            };
            let first = step.first_operand as usize;
            let args = Args {
                point: points[usize::from(step.variation)],
                images,
                tables: &self.tables,
                operands: &self.operands[first..first + usize::from(step.inputs)],
                constants: &self.constants,
                values,
                modes: step.modes,
                parameter: step.parameter,
            };
            match run {
                Run::Value(run) => values[step.register as usize] = run(&args),
                Run::Closure(run) => emit(&run(&args)),
            }
        }
    }
}

/// One instruction, checked.
struct Checked {
    operation: &'static Operation,
    operands: Vec<u32>,
    parameter: u32,
    modes: [u8; MODE_LISTS],
    variation: u8,
}

impl Checked {
    fn has_constants_only(&self) -> bool {
        self.operands.iter().all(|&o| o >= FIRST_CONSTANT)
    }
}

/// A program between its check and its use.
pub struct Draft {
    instructions: Vec<Checked>,
    constants: Vec<Vec3A>,
    tables: Arc<[Vec4]>,
}

impl Instructions<'_> {
    /// Checks and folds the program in these rows.
    ///
    /// # Errors
    /// The field and row of a number that names nothing.
    pub fn draft(&self, rows: Range<usize>) -> Result<Draft> {
        let mut draft = Draft {
            instructions: Vec::with_capacity(rows.len()),
            constants: Vec::new(),
            tables: self.tables.clone(),
        };
        for row in rows {
            let checked = self.checked(row, &mut draft)?;
            draft.instructions.push(checked);
        }
        draft.fold();
        Ok(draft)
    }

    fn checked(&self, row: usize, draft: &mut Draft) -> Result<Checked> {
        let [number, first, parameter, variation] = self.instructions[row];
        let wrong = |index: u32, len: usize, of| Error::Index {
            field: "program_instructions",
            row,
            index: i64::from(index),
            len,
            of,
        };
        let operation = OPERATIONS
            .get(number as usize)
            .ok_or_else(|| wrong(number, OPERATIONS.len(), "operations"))?;
        let first_operand = first as usize;
        let operands = first_operand
            .checked_add(operation.inputs.len())
            .and_then(|end| self.operands.get(first_operand..end))
            .ok_or_else(|| wrong(first, self.operands.len(), "operands"))?;
        if variation > 2 {
            return Err(wrong(variation, 3, "points"));
        }
        let (limit, of) = match operation.parameter {
            Parameter::None => (1, "parameters"),
            Parameter::Modes(lists) => (lists.iter().map(|l| l.len()).product(), "modes"),
            Parameter::Image => (self.images, "images"),
            Parameter::Table => ((self.tables.len() + 1).saturating_sub(TABLE_SIZE), "tables"),
            Parameter::Attribute => (usize::MAX, "layers"),
        };
        if parameter as usize >= limit {
            return Err(wrong(parameter, limit, of));
        }
        let numbered = (first_operand..).zip(operands);
        let operands = numbered.map(|(at, &operand)| self.operand(at, operand, draft));
        Ok(Checked {
            operation,
            operands: operands.collect::<Result<_>>()?,
            parameter,
            modes: modes(operation, parameter),
            variation: variation as u8,
        })
    }

    /// The operand with its constant moved to the draft.
    fn operand(&self, row: usize, operand: u32, draft: &mut Draft) -> Result<u32> {
        let wrong = |index: u32, len: usize, of| Error::Index {
            field: "program_operands",
            row,
            index: i64::from(index),
            len,
            of,
        };
        if operand < FIRST_CONSTANT {
            let earlier = &draft.instructions;
            let value = earlier.get(operand as usize);
            return match value.filter(|i| !i.operation.is_closure()) {
                Some(_) => Ok(operand),
                None => Err(wrong(operand, earlier.len(), "values before it")),
            };
        }
        let index = operand - FIRST_CONSTANT;
        let constant = self
            .constants
            .get(index as usize)
            .ok_or_else(|| wrong(index, self.constants.len(), "constants"))?;
        Ok(draft.constant(Vec3A::from_array(*constant)))
    }
}

fn modes(operation: &Operation, parameter: u32) -> [u8; MODE_LISTS] {
    let mut modes = [0; MODE_LISTS];
    if let Parameter::Modes(lists) = operation.parameter {
        let mut rest = parameter as usize;
        for (mode, list) in modes.iter_mut().zip(lists) {
            *mode = (rest % list.len()) as u8;
            rest /= list.len();
        }
    }
    modes
}

impl Draft {
    /// The operand that stands for a constant.
    fn constant(&mut self, value: Vec3A) -> u32 {
        let value = if value.is_finite() {
            value
        } else {
            Vec3A::ZERO
        };
        let same = |known: &Vec3A| {
            known.to_array().map(f32::to_bits) == value.to_array().map(f32::to_bits)
        };
        let index = self.constants.iter().position(same).unwrap_or_else(|| {
            self.constants.push(value);
            self.constants.len() - 1
        });
        FIRST_CONSTANT + index as u32
    }

    /// Computes what depends on constants only and lets operands name the result.
    fn fold(&mut self) {
        let mut folded: Vec<Option<u32>> = Vec::with_capacity(self.instructions.len());
        for index in 0..self.instructions.len() {
            let instruction = &mut self.instructions[index];
            for operand in &mut instruction.operands {
                if *operand < FIRST_CONSTANT {
                    *operand = folded[*operand as usize].unwrap_or(*operand);
                }
            }
            let value = self.value_of(index);
            folded.push(value.map(|value| self.constant(value)));
        }
    }

    /// The value of an instruction if it is the same everywhere.
    fn value_of(&self, index: usize) -> Option<Vec3A> {
        let instruction = &self.instructions[index];
        let Run::Value(run) = instruction.operation.run else {
            return None;
        };
        let is_known = instruction.has_constants_only() && instruction.operation.is_pure;
        is_known.then(|| self.run_nowhere(instruction, run))
    }

    /// What a step does for an instruction: closures of constants only are made here, once.
    fn act_of(&self, instruction: &Checked) -> Act {
        match instruction.operation.run {
            Run::Closure(run) if instruction.has_constants_only() => {
                Act::Known(Box::new(self.run_nowhere(instruction, run)))
            }
            run => Act::Run(run),
        }
    }

    /// Runs an instruction that reads nothing but constants.
    fn run_nowhere<T>(&self, instruction: &Checked, run: fn(&Args) -> T) -> T {
        run(&Args {
            point: &Point::nowhere(),
            images: &[],
            tables: &self.tables,
            operands: &instruction.operands,
            constants: &self.constants,
            values: &[],
            modes: instruction.modes,
            parameter: instruction.parameter,
        })
    }

    /// The instructions that `purpose` needs, with registers.
    pub fn program(&self, purpose: Use) -> Program {
        let last_reader = self.last_readers(purpose);
        let mut program = Program {
            constants: self.constants.as_slice().into(),
            tables: self.tables.clone(),
            ..Program::default()
        };
        let mut register_of = vec![0; self.instructions.len()];
        let mut free: Vec<u32> = Vec::new();
        for (index, instruction) in self.instructions.iter().enumerate() {
            let Some(last) = last_reader[index] else {
                continue;
            };
            let first_operand = program.operands.len() as u32;
            for &operand in &instruction.operands {
                let is_value = operand < FIRST_CONSTANT;
                program.operands.push(if is_value {
                    register_of[operand as usize]
                } else {
                    operand
                });
            }
            let mut done: Vec<u32> = instruction.operands.clone();
            done.retain(|&o| o < FIRST_CONSTANT && last_reader[o as usize] == Some(index));
            done.sort_unstable();
            done.dedup();
            free.extend(done.iter().map(|&o| register_of[o as usize]));
            if last > index {
                register_of[index] = free.pop().unwrap_or_else(|| {
                    program.registers += 1;
                    program.registers as u32 - 1
                });
            }
            program.has_variations |= instruction.variation != 0;
            if instruction.operation.name == "bump" {
                program.has_variations = true;
                program.filter_width = self.filter_width_of(instruction);
            }
            program.asks_around |= AROUND.contains(&instruction.operation.name);
            program.asks_place |= instruction.operation.asks_place();
            if instruction.operation.asks_layer() {
                program.attributes.push(instruction.parameter);
            }
            program.asks_ray |= instruction.operation.name == "light_path";
            program.steps.push(Step {
                act: self.act_of(instruction),
                first_operand,
                register: register_of[index],
                parameter: instruction.parameter,
                inputs: instruction.operands.len() as u8,
                variation: instruction.variation,
                modes: instruction.modes,
            });
        }
        program
    }

    /// What a bump's operand of that name holds: the renderer's default where it is no constant.
    fn filter_width_of(&self, bump: &Checked) -> f32 {
        let operand = bump.operands.last().copied().unwrap_or_default();
        let constant = operand.checked_sub(FIRST_CONSTANT);
        constant.map_or(FILTER_WIDTH, |index| self.constants[index as usize].x)
    }

    /// The last instruction that reads each value, itself for closures; `None` if nobody does.
    fn last_readers(&self, purpose: Use) -> Vec<Option<usize>> {
        let mut last = vec![None; self.instructions.len()];
        for (index, instruction) in self.instructions.iter().enumerate().rev() {
            let operation = instruction.operation;
            if operation.is_closure()
                && purpose.wants(operation.name)
                && !self.is_black(instruction)
            {
                last[index] = Some(index);
            }
            if last[index].is_some() {
                for &operand in instruction.operands.iter().filter(|&&o| o < FIRST_CONSTANT) {
                    let reader = &mut last[operand as usize];
                    *reader = reader.or(Some(index));
                }
            }
        }
        last
    }

    /// Whether a closure's weight is zero everywhere, or all that it shines or lets through.
    fn is_black(&self, closure: &Checked) -> bool {
        let is_zero = |operand: u32| {
            let index = operand.checked_sub(FIRST_CONSTANT);
            index.is_some_and(|index| self.constants[index as usize] == Vec3A::ZERO)
        };
        let factors = match closure.operation.name {
            "output" => 0,
            "emission" | "transparent" => 2,
            _ => 1,
        };
        closure.operands.iter().take(factors).any(|&o| is_zero(o))
    }
}

/// For tests: operation, operands (negative ones name constants, -1 the first), parameter.
#[cfg(test)]
pub(crate) type Row<'a> = (&'a str, &'a [i64], u32);

#[cfg(test)]
impl Draft {
    /// A program in short.
    pub(crate) fn of(rows: &[Row], constants: &[[f32; 3]]) -> Result<Self> {
        let (mut instructions, mut operands) = (vec![], vec![]);
        for (name, given, parameter) in rows {
            let number = OPERATIONS.iter().position(|o| o.name == *name);
            let number = number.unwrap_or(OPERATIONS.len()) as u32;
            instructions.push([number, operands.len() as u32, *parameter, 0]);
            operands.extend(given.iter().map(|&operand| match operand {
                0.. => operand as u32,
                _ => FIRST_CONSTANT + (-operand - 1) as u32,
            }));
        }
        let instructions = Instructions {
            instructions: &instructions,
            operands: &operands,
            constants,
            tables: [].into(),
            images: 1,
        };
        instructions.draft(0..rows.len())
    }
}

#[cfg(test)]
mod tests;
