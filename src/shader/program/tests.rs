//! Programs that fail their check, and programs that keep only what is needed.

use super::*;
use crate::error::Error;

fn draft(rows: &[Row], constants: &[[f32; 3]]) -> Result<Draft> {
    Draft::of(rows, constants)
}

fn closures(program: &Program) -> Vec<Closure> {
    let mut found = vec![];
    program.run(&Point::nowhere(), &[], &mut |closure| found.push(*closure));
    found
}

const ONES: [f32; 3] = [1.0; 3];

#[test]
fn numbers_that_name_nothing_are_refused_with_field_and_row() {
    let message = |rows: &[Row]| draft(rows, &[ONES]).err().map(|e| e.to_string()).unwrap();
    assert_eq!(
        message(&[("add", &[0, -1], 0)]),
        "program_operands[0] = 0 is out of range, there are 0 values before it"
    );
    assert_eq!(
        message(&[("saturate", &[-1], 0), ("saturate", &[-3], 0)]),
        "program_operands[1] = 2 is out of range, there are 1 constants"
    );
    assert_eq!(
        message(&[("emission", &[-1, -1], 0), ("saturate", &[0], 0)]),
        "program_operands[2] = 0 is out of range, there are 1 values before it"
    );
    assert_eq!(
        message(&[("math", &[-1, -1, -1], 82)]),
        "program_instructions[0] = 82 is out of range, there are 82 modes"
    );
    assert_eq!(
        message(&[("image_color", &[-1], 1)]),
        "program_instructions[0] = 1 is out of range, there are 1 images"
    );
    assert_eq!(
        message(&[("ramp_color", &[-1], 0)]),
        "program_instructions[0] = 0 is out of range, there are 0 tables"
    );
    assert_eq!(
        message(&[("add", &[-1], 0)]),
        "program_instructions[0] = 0 is out of range, there are 1 operands"
    );
    let unknown = Instructions {
        instructions: &[[9999, 0, 0, 0]],
        operands: &[],
        constants: &[],
        tables: [].into(),
        images: 0,
    };
    let error = unknown.draft(0..1).err().unwrap();
    assert!(
        matches!(
            error,
            Error::Index {
                field: "program_instructions",
                row: 0,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn constants_fold_and_what_nobody_reads_is_left_out() {
    let rows: &[Row] = &[
        ("add", &[-1, -2], 0),
        ("multiply", &[0, 0], 0),
        ("attribute", &[], 0),
        ("emission", &[-1, 1], 0),
        ("transparent", &[-3, 2], 0),
    ];
    let draft = draft(rows, &[ONES, [2.0; 3], [0.0; 3]]).unwrap();
    let emission = draft.program(Use::Emission);
    assert!(emission.is_uniform());
    assert_eq!(emission.steps.len(), 1);
    assert_eq!(closures(&emission), [Closure::Emission(Vec3A::splat(9.0))]);
    assert!(
        draft.program(Use::Transparency).is_empty(),
        "its weight is zero"
    );
}

#[test]
fn registers_are_used_again_once_their_value_is_read() {
    let mut rows: Vec<Row> = vec![("geometry", &[], 0)];
    let chain: Vec<[i64; 2]> = (0..100).map(|i| [i, -1]).collect();
    rows.extend(chain.iter().map(|operands| ("add", &operands[..], 0)));
    rows.push(("emission", &[-1, 100], 0));
    let program = draft(&rows, &[ONES]).unwrap().program(Use::Surface);
    assert_eq!(program.registers, 1);
    assert_eq!(closures(&program), [Closure::Emission(Vec3A::splat(100.0))]);
}

#[test]
fn a_program_of_many_values_at_once_runs() {
    const COUNT: i64 = 200;
    let mut rows: Vec<Row> = vec![("geometry", &[], 0); COUNT as usize];
    let sums: Vec<[i64; 2]> = (0..COUNT).map(|i| [i, COUNT + i - 1]).collect();
    rows.push(("add", &[0, -1], 0));
    rows.extend(sums[1..].iter().map(|operands| ("add", &operands[..], 0)));
    rows.push(("emission", &[-1, 2 * COUNT - 1], 0));
    let program = draft(&rows, &[ONES]).unwrap().program(Use::Surface);
    assert!(program.registers > MANY_REGISTERS, "{}", program.registers);
    assert_eq!(closures(&program), [Closure::Emission(Vec3A::ONE)]);
}

#[test]
fn closures_hold_numbers_whatever_is_computed() {
    let huge = [f32::MAX; 3];
    let rows: &[Row] = &[
        ("geometry", &[], 0),
        ("add", &[0, -1], 0),
        ("multiply", &[1, -1], 0),
        ("diffuse", &[-2, 2, -2, -2], 0),
    ];
    let program = draft(rows, &[huge, ONES]).unwrap().program(Use::Surface);
    let [Closure::Diffuse { color, .. }] = closures(&program)[..] else {
        panic!("not one diffuse closure");
    };
    assert_eq!(color, Vec3A::ZERO);
}
