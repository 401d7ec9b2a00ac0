//! The Python module `dualcone.dualcone`: checks, lets go of the interpreter, calls, wraps.

mod arrays;
mod contract;
mod render;
mod scene;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::error::Error;

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        PyValueError::new_err(error.to_string())
    }
}

#[pymodule]
mod dualcone {
    #[pymodule_export]
    use super::contract::{contract, operations, window_frames};
    #[pymodule_export]
    use super::render::Render;
    #[pymodule_export]
    use super::scene::{Grid, Image, Mesh, SceneFrame};

    /// Version of the renderer, equal to the add-on's.
    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "the name that Python expects")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
