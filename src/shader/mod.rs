//! A material's nodes as a flat program.
//!
//! The add-on walks the node graph once and writes instructions; [`Program::decode`] checks them,
//! folds what is constant, leaves out what nothing reads and assigns registers. Running a program
//! then cannot fail. It computes values at a [`Point`] of a surface and ends in [`Closure`]s.
//!
//! Every value is three numbers; a scalar stands in all three, so that a number linked to a colour
//! needs no conversion. One table, [`OPERATIONS`], says what an instruction may do: the add-on
//! takes numbers and inputs from it, so a new node is a function and a line here, and a line there.
//!
//! Bump mapping evaluates the same nodes at neighbouring points: an instruction says at which of
//! the three points of [`Point::variations`] it reads.

mod closure;
mod operation;
mod ops;
mod point;
mod program;
mod strand;

pub use closure::{
    Closure, Distribution, Glass, Glossy, Hair, Metal, Metallic, Pigment, Principled, Streak,
    Subsurface, SubsurfaceMethod, Volume,
};
pub use operation::{OPERATIONS, Operation, Parameter};
pub use ops::TABLE_SIZE;
pub use point::{
    Around, Attributes, FILTER_WIDTH, FLAT, GENERATED, ObjectInfo, Particle, Point, RayInfo,
    RayKind, Search, UNDISPLACED, View,
};
#[cfg(test)]
pub(crate) use program::Row;
pub use program::{Draft, Instructions, Program, Use};
pub use strand::Strand;
