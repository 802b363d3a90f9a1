//! The pinhole projection.

/// Focal length f = (H / 2) / tan(fovy / 2), pixels (docs/math.md, eq. 1).
///
/// `height` is the height H of the image in pixels, `fovy` the vertical field of view in radians, in (0, pi).
/// The tangent is that of `libm`, so the bits are the same on every computer.
pub(crate) fn focal_length(height: f64, fovy: f64) -> f64 {
    0.5 * height / libm::tan(0.5 * fovy)
}
