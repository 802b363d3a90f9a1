//! Pictures: rendered ones as arrays, arrays as files, and how far one is from another.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArrayDyn, PyReadonlyArrayDyn, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use splatblur::compare::{Comparison, Metric};
use splatblur::fields::{Bits, Compression, Exr, Format, Precision};
use splatblur::image::{encode, encode_with_comment, srgb_codes};
use splatblur::reference::ReferenceOptions;
use splatblur::study::provenance::{Provenance, ProvenanceError};
use splatblur::{Aov, FrameNumber, Layer, Picture, RenderOptions, files};

use crate::arrays;
use crate::errors::{OrRaise as _, chain, invalid};

/// How a picture was made.
pub(crate) enum How {
    /// Splatted, on this backend.
    Splatted(RenderOptions, &'static str),
    /// Traced, with this many samples of a pixel.
    Traced(ReferenceOptions, u64),
}

/// What made a picture: files of it say so in their headers, as those of the program do.
#[pyclass(frozen, module = "splatblur._native")]
pub(crate) struct Origin {
    pub(crate) scene: Arc<splatblur::Scene>,
    /// The file of the scene; `None` where it, or a part of it, was made in code, which no header can tell.
    pub(crate) path: Option<PathBuf>,
    pub(crate) how: How,
    pub(crate) frame: FrameNumber,
    /// What mode auto reached, in words.
    pub(crate) comment: Option<String>,
}

impl Origin {
    fn settings(&self, format: Format) -> Result<String, ProvenanceError> {
        let Some(path) = &self.path else { return Ok(String::new()) };
        let provenance = Provenance::of(&self.scene, path)?;
        let settings = match &self.how {
            How::Splatted(options, backend) => provenance.splatted(options, format, backend)?,
            How::Traced(options, samples) => provenance.traced(options, *samples, format)?,
        };
        settings.of_frame(self.frame)
    }
}

/// A picture as a dict of arrays: `rgba` and a layer for each of its own. Colours and layers of one channel are not
/// copied. `address` is where the renderer had the colours.
pub(crate) fn to_arrays<'py>(py: Python<'py>, picture: Picture) -> PyResult<Bound<'py, PyDict>> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let arrays = PyDict::new(py);
    arrays.set_item("address", picture.rgba.as_ptr().addr())?;
    arrays.set_item("rgba", arrays::array(py, picture.rgba.into_flattened(), &[height, width, 4])?)?;
    for Layer { aov, planes, names } in picture.layers {
        arrays.set_item(aov.name(), of_planes(py, planes, width, height)?)?;
        if aov == Aov::Object {
            arrays.set_item("object_names", names)?;
        }
    }
    Ok(arrays)
}

/// Planes as one array: (H, W), or (H, W, C) where there are several.
pub(crate) fn of_planes<'py>(
    py: Python<'py>,
    mut planes: Vec<Vec<f32>>,
    width: usize,
    height: usize,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    if planes.len() == 1
        && let Some(plane) = planes.pop()
    {
        return arrays::array(py, plane, &[height, width]);
    }
    let channels = planes.len();
    let mut values = vec![0.0; width * height * channels];
    for (channel, plane) in planes.iter().enumerate() {
        values.iter_mut().skip(channel).step_by(channels.max(1)).zip(plane).for_each(|(to, &from)| *to = from);
    }
    arrays::array(py, values, &[height, width, channels])
}

/// A picture of an array (H, W, 4): float32, linear, premultiplied.
fn of_array(rgba: &PyReadonlyArrayDyn<'_, f32>) -> PyResult<Picture> {
    let py = rgba.py();
    let &[height, width, 4] = rgba.shape() else {
        return Err(invalid(py, "rgba", &format!("of shape {:?}", rgba.shape()), "(H, W, 4)"));
    };
    let most = Picture::MAX_SIZE as usize;
    if !(1..=most).contains(&width) || !(1..=most).contains(&height) {
        return Err(invalid(py, "rgba", &format!("{width} x {height} pixels"), &format!("1 to {most} each way")));
    }
    let Ok(values) = rgba.as_slice() else { return Err(invalid(py, "rgba", "strided", "a contiguous array")) };
    let rgba = values.as_chunks::<4>().0.to_vec();
    Ok(Picture { width: width as u32, height: height as u32, rgba, layers: Vec::new() })
}

/// The codes of a PNG file, (H, W, 4) of uint8, with straight alpha.
#[pyfunction]
pub(crate) fn srgb8<'py>(py: Python<'py>, rgba: PyReadonlyArrayDyn<'py, f32>) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let picture = of_array(&rgba)?;
    let codes = py.detach(|| srgb_codes(&picture, true)).or_raise(py)?;
    arrays::array(py, codes, &[picture.height as usize, picture.width as usize, 4])
}

/// The bytes of a PNG file.
#[pyfunction]
pub(crate) fn png<'py>(py: Python<'py>, rgba: PyReadonlyArrayDyn<'py, f32>) -> PyResult<Bound<'py, PyBytes>> {
    let picture = of_array(&rgba)?;
    let alpha = picture.rgba.iter().any(|pixel| pixel[3] < 1.0);
    let bytes = py.detach(|| encode(&picture, Format::Png { bits: Bits::Eight, alpha }, "")).or_raise(py)?;
    Ok(PyBytes::new(py, &bytes))
}

/// Layers of a picture, from arrays by their names.
fn layers(arrays: &Bound<'_, PyDict>, names: Vec<String>, pixels: usize) -> PyResult<Vec<Layer>> {
    let py = arrays.py();
    let mut layers = Vec::new();
    for aov in Aov::LAYERS {
        let Some(array) = arrays.get_item(aov.name())? else { continue };
        let array = array.extract::<PyReadonlyArrayDyn<'_, f32>>()?;
        let (channels, values) = (aov.channels().len(), array.as_slice());
        let Ok(values) = values else { return Err(invalid(py, aov.name(), "strided", "a contiguous array")) };
        if values.len() != pixels * channels {
            let found = format!("of shape {:?}", array.shape());
            return Err(invalid(py, aov.name(), &found, &format!("{channels} channels of the picture's size")));
        }
        let plane = |channel: usize| values.iter().skip(channel).step_by(channels).copied().collect();
        let names = if aov == Aov::Object { names.clone() } else { Vec::new() };
        layers.push(Layer { aov, planes: (0..channels).map(plane).collect(), names });
    }
    Ok(layers)
}

/// The format of a file, by its name and by what was asked for.
fn format_of(py: Python<'_>, path: &std::path::Path, alpha: bool, bits: Option<u32>, zip: &str) -> PyResult<Format> {
    let compression = Compression::ALL.into_iter().find(|(name, _)| *name == zip).map(|(_, compression)| compression);
    let format = match (Format::of(path, alpha), bits) {
        (Some(Format::Png { alpha, .. }), None | Some(8)) => Some(Format::Png { bits: Bits::Eight, alpha }),
        (Some(Format::Png { alpha, .. }), Some(16)) => Some(Format::Png { bits: Bits::Sixteen, alpha }),
        (Some(Format::Exr(_)), bits @ (None | Some(16 | 32))) => compression.map(|compression| {
            let precision = if bits == Some(16) { Precision::Half } else { Precision::Float };
            Format::Exr(Exr { precision, compression })
        }),
        _ => None,
    };
    format.ok_or_else(|| {
        let found = format!("{} with bits={bits:?}, compression={zip:?}", path.display());
        let expected = ".png with 8 or 16 bits, or .exr with 16 or 32 bits and a compression that EXR has";
        invalid(py, "path", &found, expected)
    })
}

/// Writes a picture, which appears whole or not at all.
#[pyfunction]
#[pyo3(signature = (path, rgba, planes, names, alpha, origin = None, bits = None, compression = "zip"))]
#[allow(clippy::too_many_arguments, reason = "keywords of one call of the Python layer")]
pub(crate) fn save<'py>(
    py: Python<'py>,
    path: PathBuf,
    rgba: PyReadonlyArrayDyn<'py, f32>,
    planes: &Bound<'py, PyDict>,
    names: Vec<String>,
    alpha: bool,
    origin: Option<&Bound<'py, Origin>>,
    bits: Option<u32>,
    compression: &str,
) -> PyResult<()> {
    let format = format_of(py, &path, alpha, bits, compression)?;
    let mut picture = of_array(&rgba)?;
    picture.layers = layers(planes, names, picture.rgba.len())?;
    let origin = origin.map(|origin| origin.get());
    let settings = origin.map_or(Ok(String::new()), |origin| py.detach(|| origin.settings(format)));
    let settings = settings.map_err(|error| pyo3::exceptions::PyOSError::new_err(chain(&error)))?;
    let comment = origin.and_then(|origin| origin.comment.as_deref());
    let bytes = py.detach(|| encode_with_comment(&picture, format, &settings, comment)).or_raise(py)?;
    let written = py.detach(|| files::replace(&path, &bytes));
    written.map_err(|error| pyo3::exceptions::PyOSError::new_err(format!("cannot write {}: {error}", path.display())))
}

/// A PNG or EXR file as arrays, linear and premultiplied.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let picture = py.detach(|| Picture::read(&path)).or_raise(py)?;
    to_arrays(py, picture)
}

/// Errors of `a` against the reference `b`, by the names of the metrics.
#[pyfunction]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    a: PyReadonlyArrayDyn<'py, f32>,
    b: PyReadonlyArrayDyn<'py, f32>,
    metrics: Vec<String>,
) -> PyResult<Vec<f64>> {
    crate::errors::guard(py)?;
    let known = || Metric::ALL.map(Metric::name).join(", ");
    let metrics = metrics
        .iter()
        .map(|name| Metric::from_name(name).ok_or_else(|| invalid(py, "metrics", &format!("`{name}`"), &known())));
    let metrics = metrics.collect::<PyResult<Vec<_>>>()?;
    let (a, b) = (of_array(&a)?, of_array(&b)?);
    let compared = py.detach(|| Comparison::new(&a, &b, &metrics)).or_raise(py)?;
    Ok(metrics.into_iter().map(|metric| compared.value(metric).unwrap_or(f64::NAN)).collect())
}
