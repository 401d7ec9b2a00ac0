//! Arrays as they arrive, checked against their table.

use super::arrays::{ArraySpec, Dtype};
use crate::error::{Error, Result};

/// Numbers of a boundary array, borrowed from the caller.
#[derive(Debug, Clone, Copy)]
pub enum Numbers<'a> {
    /// 32-bit floats.
    F32(&'a [f32]),
    /// Unsigned 32-bit integers.
    U32(&'a [u32]),
    /// Signed 32-bit integers.
    I32(&'a [i32]),
    /// Unsigned 64-bit integers.
    U64(&'a [u64]),
}

impl Numbers<'_> {
    /// Element type.
    pub fn dtype(&self) -> Dtype {
        match self {
            Numbers::F32(_) => Dtype::F32,
            Numbers::U32(_) => Dtype::U32,
            Numbers::I32(_) => Dtype::I32,
            Numbers::U64(_) => Dtype::U64,
        }
    }
}

/// A boundary array as received.
#[derive(Debug, Clone)]
pub struct Given<'a> {
    /// Name in the contract.
    pub name: String,
    /// Lengths of its axes.
    pub shape: Vec<usize>,
    /// Its numbers, C-contiguous.
    pub numbers: Numbers<'a>,
}

/// Boundary arrays that keep to their table: every name is there, with its type, its shape and
/// finite numbers. Letters mean one length each throughout the table.
#[derive(Debug)]
pub struct Arrays<'a> {
    given: Vec<Given<'a>>,
    lengths: Vec<(&'static str, usize)>,
}

impl<'a> Arrays<'a> {
    /// Holds what was given to the table `specs`.
    ///
    /// # Errors
    /// The first array that is missing, unknown, of another type or shape, or not finite.
    pub fn checked(specs: &'static [ArraySpec], given: Vec<Given<'a>>) -> Result<Self> {
        if let Some(stranger) = given
            .iter()
            .find(|g| !specs.iter().any(|s| s.name == g.name))
        {
            return Err(Error::Unknown {
                name: stranger.name.clone(),
            });
        }
        let mut arrays = Self {
            given,
            lengths: Vec::new(),
        };
        for spec in specs {
            let found = arrays.given.iter().position(|g| g.name == spec.name);
            let index = found.ok_or(Error::Missing { field: spec.name })?;
            arrays.check(spec, index)?;
        }
        Ok(arrays)
    }

    fn check(&mut self, spec: &'static ArraySpec, index: usize) -> Result<()> {
        let given = &self.given[index];
        let dtype = given.numbers.dtype();
        if dtype != spec.dtype {
            return Err(Error::Dtype {
                field: spec.name,
                expected: spec.dtype.name(),
                got: dtype.name().to_owned(),
            });
        }
        let shape = given.shape.clone();
        let fits = shape.len() == spec.shape.len()
            && shape
                .iter()
                .zip(spec.shape)
                .all(|(&got, &want)| match want.parse::<usize>() {
                    Ok(fixed) => got == fixed,
                    Err(_) => self.length_fits(want, got),
                });
        if !fits {
            return Err(Error::Shape {
                field: spec.name,
                expected: print_shape(spec.shape),
                got: print_shape(&shape),
            });
        }
        let row_length = shape.iter().skip(1).product::<usize>().max(1);
        match self.given[index].numbers {
            Numbers::F32(values) if !spec.may_hold_nan() => {
                match values.iter().position(|v| !v.is_finite()) {
                    Some(at) => Err(Error::NotFinite {
                        field: spec.name,
                        row: at / row_length,
                    }),
                    None => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }

    /// Whether a letter has this length everywhere; the first use sets it.
    fn length_fits(&mut self, letter: &'static str, length: usize) -> bool {
        match self.lengths.iter().find(|(known, _)| *known == letter) {
            Some((_, known)) => *known == length,
            None => {
                self.lengths.push((letter, length));
                true
            }
        }
    }

    fn numbers(&self, name: &str) -> Numbers<'a> {
        let found = self.given.iter().find(|g| g.name == name);
        found.map_or(Numbers::F32(&[]), |g| g.numbers)
    }

    /// Length of a letter of the table.
    pub fn length(&self, letter: &str) -> usize {
        let found = self.lengths.iter().find(|(known, _)| *known == letter);
        found.map_or(0, |(_, length)| *length)
    }

    /// The numbers of a float array in the table.
    pub fn f32s(&self, name: &str) -> &'a [f32] {
        if let Numbers::F32(v) = self.numbers(name) {
            v
        } else {
            &[]
        }
    }

    /// The numbers of an unsigned array in the table.
    pub fn u32s(&self, name: &str) -> &'a [u32] {
        if let Numbers::U32(v) = self.numbers(name) {
            v
        } else {
            &[]
        }
    }

    /// The numbers of a signed array in the table.
    pub fn i32s(&self, name: &str) -> &'a [i32] {
        if let Numbers::I32(v) = self.numbers(name) {
            v
        } else {
            &[]
        }
    }

    /// The numbers of a 64-bit array in the table.
    pub fn u64s(&self, name: &str) -> &'a [u64] {
        if let Numbers::U64(v) = self.numbers(name) {
            v
        } else {
            &[]
        }
    }
}

fn print_shape<T: std::fmt::Display>(shape: &[T]) -> String {
    let lengths: Vec<String> = shape.iter().map(T::to_string).collect();
    format!("({})", lengths.join(", "))
}

#[cfg(test)]
mod tests {
    use super::super::arrays::array;
    use super::Dtype::{F32, U32};
    use super::*;

    fn given<'a>(name: &str, shape: &[usize], numbers: Numbers<'a>) -> Given<'a> {
        Given {
            name: name.into(),
            shape: shape.into(),
            numbers,
        }
    }

    const TABLE: &[ArraySpec] = &[
        array("points", F32, &["V", "3"], "m", ""),
        array("names", U32, &["V"], "", ""),
    ];

    fn check<'a>(points: Given<'a>, names: Given<'a>) -> Result<()> {
        Arrays::checked(TABLE, vec![points, names]).map(|_| ())
    }

    #[test]
    fn each_fault_is_named_with_its_field_and_row() {
        let names = given("names", &[1], Numbers::U32(&[7]));
        let good = given("points", &[1, 3], Numbers::F32(&[0.0; 3]));
        assert_eq!(check(good.clone(), names.clone()), Ok(()));
        let message = |e: Result<()>| e.err().map(|e| e.to_string()).unwrap_or_default();
        assert_eq!(
            message(check(
                given("points", &[2, 2], Numbers::F32(&[0.0; 4])),
                names.clone()
            )),
            "points: expected shape (V, 3), got (2, 2)"
        );
        let two = [0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0];
        let two_names = given("names", &[2], Numbers::U32(&[1, 2]));
        assert_eq!(
            message(check(
                given("points", &[2, 3], Numbers::F32(&two)),
                two_names.clone()
            )),
            "points[1] is not finite"
        );
        assert_eq!(
            message(check(good.clone(), two_names)),
            "names: expected shape (V), got (2)"
        );
        assert_eq!(
            message(check(
                good.clone(),
                given("names", &[1], Numbers::I32(&[7]))
            )),
            "names: expected dtype uint32, got int32"
        );
        assert_eq!(message(check(good.clone(), good)), "names is missing");
    }
}
