//! The tables of the contract, for the add-on.

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString};

use crate::contract::{
    ArraySpec, CONTENT, FRAME, GRID, IMAGE, Kind, MESH, MESH_MOTION, PASSES, SETTINGS, SettingSpec,
    Settings, Value,
};
use crate::reuse;
use crate::shader::{OPERATIONS, Parameter};

/// The boundary: arrays, settings and passes, as lists of dictionaries.
#[pyfunction]
pub fn contract(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let table = PyDict::new(py);
    let tables = [
        ("mesh", MESH),
        ("mesh_motion", MESH_MOTION),
        ("content", CONTENT),
        ("grid", GRID),
        ("image", IMAGE),
        ("frame", FRAME),
    ];
    for (name, specs) in tables {
        let rows = specs.iter().map(|spec| array_row(py, spec));
        table.set_item(name, PyList::new(py, rows.collect::<PyResult<Vec<_>>>()?)?)?;
    }
    let settings = SETTINGS.iter().map(|spec| setting_row(py, spec));
    table.set_item(
        "settings",
        PyList::new(py, settings.collect::<PyResult<Vec<_>>>()?)?,
    )?;
    let passes = PASSES.iter().map(|pass| {
        let row = PyDict::new(py);
        row.set_item("name", pass.name)?;
        row.set_item("channels", pass.channels)?;
        row.set_item("type", pass.kind)?;
        row.set_item("is_light", pass.is_light())?;
        row.set_item("extra_bytes", pass.extra_bytes())?;
        row.set_item("doc", pass.doc)?;
        Ok(row)
    });
    table.set_item(
        "passes",
        PyList::new(py, passes.collect::<PyResult<Vec<_>>>()?)?,
    )?;
    Ok(table)
}

/// What instructions of materials may do, in the order of their numbers: name, inputs, parameter
/// ("none", "modes", "image", "table" or "attribute"), lists of modes, and whether it is a closure.
#[pyfunction]
pub fn operations(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let rows = OPERATIONS.iter().map(|operation| {
        let row = PyDict::new(py);
        row.set_item("name", operation.name)?;
        row.set_item("inputs", operation.inputs.to_vec())?;
        row.set_item("is_closure", operation.is_closure())?;
        let (parameter, modes) = match operation.parameter {
            Parameter::None => ("none", Vec::new()),
            Parameter::Modes(lists) => ("modes", lists.iter().map(|list| list.to_vec()).collect()),
            Parameter::Image => ("image", Vec::new()),
            Parameter::Table => ("table", Vec::new()),
            Parameter::Attribute => ("attribute", Vec::new()),
        };
        row.set_item("parameter", parameter)?;
        row.set_item("modes", modes)?;
        Ok(row)
    });
    PyList::new(py, rows.collect::<PyResult<Vec<_>>>()?)
}

fn array_row<'py>(py: Python<'py>, spec: &ArraySpec) -> PyResult<Bound<'py, PyDict>> {
    let row = PyDict::new(py);
    row.set_item("name", spec.name)?;
    row.set_item("dtype", spec.dtype.name())?;
    row.set_item("shape", spec.shape.to_vec())?;
    row.set_item("unit", spec.unit)?;
    row.set_item("doc", spec.doc)?;
    Ok(row)
}

fn setting_row<'py>(py: Python<'py>, spec: &SettingSpec) -> PyResult<Bound<'py, PyDict>> {
    let row = PyDict::new(py);
    row.set_item("name", spec.name)?;
    row.set_item("label", spec.label)?;
    row.set_item("doc", spec.doc)?;
    match spec.kind {
        Kind::Int(default, min, max) => {
            row.set_item("kind", "int")?;
            set_range(&row, default, min, max)?;
        }
        Kind::Float(default, min, max) => {
            row.set_item("kind", "float")?;
            set_range(&row, default, min, max)?;
        }
        Kind::Bool(default) => {
            row.set_item("kind", "bool")?;
            row.set_item("default", default)?;
        }
        Kind::Enum(default, items) => {
            row.set_item("kind", "enum")?;
            row.set_item("default", default)?;
            row.set_item("items", items.to_vec())?;
        }
    }
    Ok(row)
}

fn set_range<'py, T: IntoPyObject<'py>>(
    row: &Bound<'py, PyDict>,
    default: T,
    min: T,
    max: T,
) -> PyResult<()> {
    row.set_item("default", default)?;
    row.set_item("min", min)?;
    row.set_item("max", max)
}

/// Settings from a dictionary.
pub fn settings(dict: &Bound<'_, PyDict>) -> PyResult<Settings> {
    let values = dict.iter().map(|(name, value)| {
        let name: String = name.extract()?;
        // A bool is an int to Python, so it comes first.
        let value = if value.is_instance_of::<PyBool>() {
            Value::Bool(value.extract()?)
        } else if value.is_instance_of::<PyInt>() {
            Value::Int(value.extract()?)
        } else if value.is_instance_of::<PyFloat>() {
            Value::Float(value.extract()?)
        } else {
            Value::Word(value.cast::<PyString>()?.to_string())
        };
        Ok((name, value))
    });
    let values = values.collect::<PyResult<Vec<_>>>()?;
    Ok(Settings::from_values(&values)?)
}

/// Every frame whose scene is needed to render `targets`, in ascending order.
#[pyfunction]
#[pyo3(name = "window_frames")]
pub fn window_frames(dict: &Bound<'_, PyDict>, targets: Vec<i32>, step: i32) -> PyResult<Vec<i32>> {
    Ok(reuse::window_frames(&settings(dict)?, &targets, step))
}
