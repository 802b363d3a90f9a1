//! Arrays of the Python layer as vectors of the library, and back.
//!
//! The Python layer hands over arrays that are C-contiguous, aligned, in the machine's byte order, and of the shape and
//! type that it promised. What it did not promise is refused here too.

use numpy::{Element, PyArray1, PyArrayDyn, PyArrayMethods as _, PyReadonlyArrayDyn, PyUntypedArrayMethods as _};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use splatblur::glam::{DMat4, DVec3, Vec3};

/// A contiguous array as a slice.
fn slice<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| PyValueError::new_err("an array is not contiguous"))
}

/// Rows of `N` numbers, of 32 or of 64 bits each, made into vectors.
fn rows<const N: usize, V>(
    array: &Bound<'_, PyAny>,
    of_single: impl Fn([f32; N]) -> V,
    of_double: impl Fn([f64; N]) -> V,
) -> PyResult<Vec<V>> {
    if let Ok(single) = array.extract::<PyReadonlyArrayDyn<'_, f32>>() {
        check_columns(single.shape(), N)?;
        return Ok(slice(&single)?.as_chunks::<N>().0.iter().map(|&row| of_single(row)).collect());
    }
    if let Ok(double) = array.extract::<PyReadonlyArrayDyn<'_, f64>>() {
        check_columns(double.shape(), N)?;
        return Ok(slice(&double)?.as_chunks::<N>().0.iter().map(|&row| of_double(row)).collect());
    }
    Err(PyTypeError::new_err("expected an array of float32 or float64"))
}

fn check_columns(shape: &[usize], columns: usize) -> PyResult<()> {
    let fits = if columns == 1 { shape.len() == 1 } else { shape.last() == Some(&columns) };
    if fits { Ok(()) } else { Err(PyValueError::new_err(format!("shape {shape:?}, expected {columns} columns"))) }
}

/// Places: (N, 3).
pub(crate) fn places(array: &Bound<'_, PyAny>) -> PyResult<Vec<DVec3>> {
    rows(array, |row: [f32; 3]| DVec3::from_array(row.map(f64::from)), DVec3::from_array)
}

/// Vectors: (N, 3).
pub(crate) fn vectors(array: &Bound<'_, PyAny>) -> PyResult<Vec<Vec3>> {
    rows(array, Vec3::from_array, |row: [f64; 3]| Vec3::from_array(row.map(|x| x as f32)))
}

/// Rows of four: (N, 4).
pub(crate) fn fours(array: &Bound<'_, PyAny>) -> PyResult<Vec<[f32; 4]>> {
    rows(array, |row| row, |row: [f64; 4]| row.map(|x| x as f32))
}

/// Numbers: (N,).
pub(crate) fn numbers(array: &Bound<'_, PyAny>) -> PyResult<Vec<f32>> {
    rows(array, |[x]: [f32; 1]| x, |[x]: [f64; 1]| x as f32)
}

/// Precise numbers: (N,).
pub(crate) fn doubles(array: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    rows(array, |[x]: [f32; 1]| f64::from(x), |[x]: [f64; 1]| x)
}

/// Whole numbers: (N,).
pub(crate) fn identities(array: &Bound<'_, PyAny>) -> PyResult<Vec<i64>> {
    let array = array.extract::<PyReadonlyArrayDyn<'_, i64>>()?;
    check_columns(array.shape(), 1)?;
    Ok(slice(&array)?.to_vec())
}

/// Matrices: (N, 4, 4), row by row as numpy has them.
pub(crate) fn matrices(array: &Bound<'_, PyAny>) -> PyResult<Vec<DMat4>> {
    let array = array.extract::<PyReadonlyArrayDyn<'_, f64>>()?;
    let [_, 4, 4] = array.shape() else { return Err(PyValueError::new_err("expected matrices of shape (N, 4, 4)")) };
    let (matrices, _) = slice(&array)?.as_chunks::<16>();
    Ok(matrices.iter().map(|matrix| DMat4::from_cols_array(matrix).transpose()).collect())
}

/// An array that takes over a vector, in this shape.
pub(crate) fn array<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    PyArray1::from_vec(py, values).reshape(shape.to_vec())
}

/// Vectors as an array (N, 3).
pub(crate) fn of_vectors<'py>(py: Python<'py>, vectors: Vec<Vec3>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let rows = vectors.len();
    array(py, vectors.into_iter().map(|v| v.to_array()).collect::<Vec<_>>().into_flattened(), &[rows, 3])
}

/// A matrix as an array (4, 4).
pub(crate) fn of_matrix<'py>(py: Python<'py>, matrix: &DMat4) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    array(py, matrix.transpose().to_cols_array().to_vec(), &[4, 4])
}
