//! Arrays of pictures as numpy's, without a copy on the way out.

use ao4d::volume::{Array, Values};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyAny;

/// An array with its name.
pub type Named<'py> = (String, Bound<'py, PyAny>);

/// Numbers as an array of `components` columns, or flat if there is one; numpy takes over the memory.
pub fn to_numpy(py: Python<'_>, values: Values, components: usize) -> PyResult<Bound<'_, PyAny>> {
    macro_rules! give {
        ($($kind:ident)+) => {
            match values {
                $(Values::$kind(numbers) => {
                    let rows = numbers.len() / components.max(1);
                    let flat = PyArray1::from_vec(py, numbers);
                    if components == 1 { Ok(flat.into_any()) } else { Ok(flat.reshape([rows, components])?.into_any()) }
                })+
            }
        };
    }
    give!(I8 U8 I16 U16 I32 U32 I64 U64 F32 F64)
}

/// A picture's array as numpy's.
pub fn named(py: Python<'_>, array: Array) -> PyResult<Named<'_>> {
    Ok((array.name, to_numpy(py, array.values, array.components)?))
}

/// The numbers of an array, of one dimension or of two.
pub fn values_of(name: &str, array: &Bound<'_, PyAny>) -> PyResult<Array> {
    macro_rules! take {
        ($($number:ty)+) => {
            $(
                if let Ok(flat) = array.extract::<PyReadonlyArray1<'_, $number>>() {
                    return Ok(Array::new(name, 1, flat.as_slice()?.to_vec()));
                }
                if let Ok(table) = array.extract::<PyReadonlyArray2<'_, $number>>() {
                    return Ok(Array::new(name, table.shape()[1].max(1), table.as_slice()?.to_vec()));
                }
            )+
        };
    }
    take!(f32 f64 u8 i8 u16 i16 u32 i32 u64 i64);
    Err(PyTypeError::new_err(format!("{name}: expected an array of numbers with one dimension or two")))
}
