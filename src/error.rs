//! The one error of the crate. Every variant names the field, and the row where there is one, so
//! that the add-on can print it as it is.

use thiserror::Error;

/// What can be wrong with what a caller handed over.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// An array does not have the shape of the contract.
    #[error("{field}: expected shape {expected}, got {got}")]
    Shape {
        /// Name in the contract.
        field: &'static str,
        /// Shape in the contract's letters, such as `(V, 3)`.
        expected: String,
        /// Shape received.
        got: String,
    },
    /// An array has another element type than the contract says.
    #[error("{field}: expected dtype {expected}, got {got}")]
    Dtype {
        /// Name in the contract.
        field: &'static str,
        /// Element type of the contract.
        expected: &'static str,
        /// Element type received.
        got: String,
    },
    /// An array or setting that the contract demands is absent.
    #[error("{field} is missing")]
    Missing {
        /// Name in the contract.
        field: &'static str,
    },
    /// A name that the contract does not know.
    #[error("{name:?} is not in the contract")]
    Unknown {
        /// The name received.
        name: String,
    },
    /// A NaN or an infinity.
    #[error("{field}[{row}] is not finite")]
    NotFinite {
        /// Name in the contract.
        field: &'static str,
        /// First row that is not finite.
        row: usize,
    },
    /// An index points outside what it indexes.
    #[error("{field}[{row}] = {index} is out of range, there are {len} {of}")]
    Index {
        /// Name in the contract.
        field: &'static str,
        /// First offending row.
        row: usize,
        /// The index received.
        index: i64,
        /// How many there are.
        len: usize,
        /// What is indexed.
        of: &'static str,
    },
    /// A matrix that cannot be inverted.
    #[error("{field}[{row}] is singular: an object with a scale of zero has no inverse")]
    Singular {
        /// Name in the contract.
        field: &'static str,
        /// Offending row.
        row: usize,
    },
    /// A value outside its range.
    #[error("{field}: {value} is outside {range}")]
    Range {
        /// Name in the contract.
        field: &'static str,
        /// The value received, printed.
        value: String,
        /// The range allowed, printed.
        range: String,
    },
    /// A window of frames that cannot be rendered together.
    #[error("frame {frame}: {reason}")]
    Frame {
        /// The frame's number.
        frame: i32,
        /// What is wrong with it.
        reason: String,
    },
    /// The operating system gave no threads.
    #[error("no threads to render with: {reason}")]
    Threads {
        /// What the system said.
        reason: String,
    },
    /// The render was cancelled before it finished.
    #[error("cancelled")]
    Cancelled,
}

/// The crate's result.
pub type Result<T> = std::result::Result<T, Error>;
