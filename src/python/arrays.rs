//! numpy arrays as the contract's arrays, without a copy.

use numpy::{
    Element, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::contract::{ArraySpec, Given, Numbers};
use crate::error::Error;

/// A numpy array that nobody writes to while it is borrowed.
enum Numpy<'py> {
    F32(PyReadonlyArrayDyn<'py, f32>),
    U32(PyReadonlyArrayDyn<'py, u32>),
    I32(PyReadonlyArrayDyn<'py, i32>),
    U64(PyReadonlyArrayDyn<'py, u64>),
}

/// Named numpy arrays.
pub struct Held<'py> {
    arrays: Vec<(String, Vec<usize>, Numpy<'py>)>,
}

impl<'py> Held<'py> {
    /// Holds the arrays of a dictionary.
    pub fn of_dict(specs: &'static [ArraySpec], dict: &Bound<'py, PyDict>) -> PyResult<Self> {
        let arrays = dict
            .iter()
            .map(|(name, array)| held(specs, name.extract()?, &array));
        Ok(Self {
            arrays: arrays.collect::<PyResult<_>>()?,
        })
    }

    /// Holds one array for each entry of a table, in its order.
    pub fn of_list(specs: &'static [ArraySpec], arrays: &[Bound<'py, PyAny>]) -> PyResult<Self> {
        let named = specs.iter().zip(arrays);
        let arrays = named.map(|(spec, array)| held(specs, spec.name.to_owned(), array));
        Ok(Self {
            arrays: arrays.collect::<PyResult<_>>()?,
        })
    }

    /// The arrays as the contract takes them.
    pub fn given(&self) -> PyResult<Vec<Given<'_>>> {
        let given = self.arrays.iter().map(|(name, shape, array)| {
            let numbers = match array {
                Numpy::F32(a) => a.as_slice().map(Numbers::F32),
                Numpy::U32(a) => a.as_slice().map(Numbers::U32),
                Numpy::I32(a) => a.as_slice().map(Numbers::I32),
                Numpy::U64(a) => a.as_slice().map(Numbers::U64),
            };
            let numbers = numbers.map_err(|_| not_contiguous(name))?;
            Ok(Given {
                name: name.clone(),
                shape: shape.clone(),
                numbers,
            })
        });
        given.collect()
    }
}

fn held<'py>(
    specs: &'static [ArraySpec],
    name: String,
    array: &Bound<'py, PyAny>,
) -> PyResult<(String, Vec<usize>, Numpy<'py>)> {
    let Some(spec) = specs.iter().find(|spec| spec.name == name) else {
        return Err(Error::Unknown { name }.into());
    };
    let untyped = array.cast::<PyUntypedArray>().map_err(|_| {
        PyValueError::new_err(format!(
            "{name}: expected a numpy array, got {}",
            array.get_type()
        ))
    })?;
    // `as_slice` below would also take a transposed array, in its own order.
    if !untyped.is_c_contiguous() {
        return Err(not_contiguous(&name));
    }
    let shape = untyped.shape().to_vec();
    let numpy = readonly(array)
        .map(Numpy::F32)
        .or_else(|| readonly(array).map(Numpy::U32))
        .or_else(|| readonly(array).map(Numpy::I32))
        .or_else(|| readonly(array).map(Numpy::U64));
    match numpy {
        Some(numpy) => Ok((name, shape, numpy)),
        None => Err(Error::Dtype {
            field: spec.name,
            expected: spec.dtype.name(),
            got: untyped.dtype().to_string(),
        }
        .into()),
    }
}

fn not_contiguous(name: &str) -> PyErr {
    PyValueError::new_err(format!("{name}: expected a C-contiguous array"))
}

fn readonly<'py, T: Element>(array: &Bound<'py, PyAny>) -> Option<PyReadonlyArrayDyn<'py, T>> {
    let array = array.cast::<PyArrayDyn<T>>().ok()?;
    array.try_readonly().ok()
}
