//! The bounds of all numbers that a person or a program chooses: each stands here once.
//!
//! Parsers of scene files and of options ask them, and so do [`Scene::check`](crate::scene::Scene::check) and
//! [`RenderOptions::check`](crate::options::RenderOptions::check) before anything is rendered. What a parser takes, a
//! renderer takes.

use std::fmt;
use std::ops::RangeInclusive;

use glam::DVec3;

/// A value that nothing can be rendered with: which it is, what it is and what would be right.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{field}` is {found}, expected {expected}")]
pub struct Invalid {
    /// The field, from the scene or the options inwards, as in `camera.fovy` or `objects[2].opacity`.
    pub field: String,
    /// What it is.
    pub found: String,
    /// What would be right.
    pub expected: String,
}

impl Invalid {
    /// About the field `field`.
    pub(crate) fn new(field: &str, found: impl fmt::Display, expected: impl Into<String>) -> Self {
        Self { field: field.to_owned(), found: found.to_string(), expected: expected.into() }
    }

    /// The same, where the field stands inside `outer`.
    #[must_use]
    pub(crate) fn within(self, outer: impl fmt::Display) -> Self {
        Self { field: format!("{outer}.{}", self.field), ..self }
    }
}

/// Bounds of a number, both included. NaN is never within.
#[derive(Clone, Copy, Debug)]
pub struct Range(pub f64, pub f64);

impl Range {
    /// Is `x` within?
    pub fn holds(self, x: f64) -> bool {
        (self.0..=self.1).contains(&x)
    }

    /// Checks the field `field`.
    pub(crate) fn check(self, field: &str, x: f64) -> Result<(), Invalid> {
        if self.holds(x) { Ok(()) } else { Err(Invalid::new(field, x, format!("a number {self}"))) }
    }

    /// Checks the three numbers of the field `field`.
    pub(crate) fn check_all(self, field: &str, v: DVec3) -> Result<(), Invalid> {
        let right = v.to_array().into_iter().all(|x| self.holds(x));
        if right { Ok(()) } else { Err(Invalid::new(field, v, format!("three numbers {self}"))) }
    }

    /// Checks the field `field`, an angle in radians, where these are degrees.
    pub(crate) fn check_angle(self, field: &str, radians: f64) -> Result<(), Invalid> {
        // The bounds become radians, as a parser's degrees do, so that both round alike.
        if Self(self.0.to_radians(), self.1.to_radians()).holds(radians) {
            return Ok(());
        }
        Err(Invalid::new(field, format!("{} degrees", radians.to_degrees()), format!("a number {self} degrees")))
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // `Debug` writes large and small numbers as powers of ten.
        let text = |x: f64| format!("{x:?}").trim_end_matches(".0").to_owned();
        write!(f, "from {} to {}", text(self.0), text(self.1))
    }
}

/// Checks the field `field`, a whole number.
pub(crate) fn check_count(field: &str, count: u32, range: &RangeInclusive<u32>) -> Result<(), Invalid> {
    let expected = || format!("a whole number from {} to {}", range.start(), range.end());
    if range.contains(&count) { Ok(()) } else { Err(Invalid::new(field, count, expected())) }
}

/// Width and height of a picture, pixels.
pub const SIDE: RangeInclusive<u32> = 1..=65_535;
/// Most time samples, and most sub-pixel positions, of a pixel.
pub const MAX_SAMPLES: u32 = 65_536;
/// A number of time samples, buckets, intervals or sub-pixel positions.
pub const COUNT: RangeInclusive<u32> = 1..=MAX_SAMPLES;
/// Most time samples of mode auto, which begins with 4 at the least.
pub const SAMPLES_MAX: RangeInclusive<u32> = 4..=MAX_SAMPLES;
/// Places within a kernel whose visibility is tested.
pub const SOURCE_SAMPLES: RangeInclusive<u32> = 1..=64;
/// Half-axis of a kernel along its motion, spacings of the intervals.
pub const OVERLAP: Range = Range(0.1, 4.0);
/// Error of a block of the image, display values.
pub const ERROR: Range = Range(1e-4, 1.0);
/// Brightest light that mode auto compares, white is 1: up to the largest half.
pub const WHITE: Range = Range(1.0, 65504.0);
/// Exposure, powers of two.
pub const STOPS: Range = Range(-32.0, 32.0);
/// Standard deviation of a Gaussian pixel filter, pixels. Wider ones would reach beyond what tiles know of their
/// neighbours.
pub const SIGMA: Range = Range(0.25, 4.0);

/// Largest coordinate: its square is far from the largest `f64`.
pub const FAR: f64 = 1e30;
/// Largest coordinate and length of a model that is drawn, model units: its square still fits a 32-bit float.
pub const MAX_COORDINATE: f64 = 1e18;
/// A coordinate, scene units.
pub const COORDINATE: Range = Range(-FAR, FAR);
/// Length of a direction that is made a unit vector.
pub const DIRECTION: Range = Range(1e-9, FAR);
/// Length of a unit vector, up to rounding.
const UNIT_LENGTH: Range = Range(1.0 - 1e-6, 1.0 + 1e-6);
/// Magnitude of a factor along an axis.
pub const SCALE: Range = Range(1e-9, 1e9);
/// An angle, degrees.
pub const DEGREES: Range = Range(-1e9, 1e9);
/// A share of a whole.
pub const UNIT: Range = Range(0.0, 1.0);
/// Light, a coefficient of reflection or a weight of a curve.
pub const LIGHT: Range = Range(0.0, 1e6);
/// Diameter of a light that is infinitely far, degrees.
pub const ANGLE: Range = Range(0.0, 180.0);
/// Radius of a ball of light, scene units.
pub const RADIUS_OF_LIGHT: Range = Range(0.0, FAR);
/// Largest factor on light: a power of two, so that `scene_file` can split any allowed radiance into colour and
/// intensity without rounding.
pub const MOST_INTENSITY: f64 = 1_048_576.0;
/// A factor on light.
pub const INTENSITY: Range = Range(0.0, MOST_INTENSITY);
/// Light times a factor on it.
pub const RADIANCE: Range = Range(0.0, LIGHT.1 * MOST_INTENSITY);
/// Number of a frame that a scene names.
pub const MOST_FRAME: i64 = 1_000_000_000;
/// Time at which something happens, frames.
pub const FRAME: Range = Range(-1e9, 1e9);
/// Frames per second.
pub const RATE: Range = Range(0.001, 1e6);
/// Opening and closing of the shutter, frames around the frame's number.
pub const SHUTTER: Range = Range(-1e6, 1e6);
/// Frames that a rolling shutter takes from the first edge of the image to the last one.
pub const READOUT: Range = Range(0.0, 1e4);
/// Decay (per shutter) or width (shutters) of a time weight.
pub const STEEPNESS: Range = Range(0.001, 1000.0);
/// Vertical field of view, degrees.
pub const FOVY: Range = Range(1e-6, 179.999);
/// Nearest visible depth, or a radius, scene units.
pub const LENGTH: Range = Range(1e-9, FAR);
/// Factor on all radii of a model.
pub const RADIUS_SCALE: Range = Range(1e-6, 1e6);
/// Depth tolerance, scene units.
pub const EPSILON: Range = Range(0.0, FAR);
/// Place of a camera's axis in its image, widths or heights of it: a principal point of 1e9 pixels in the least image.
pub const SHIFT: Range = Range(-1.1e9, 1.1e9);

/// Can `v` be made a unit vector?
pub fn is_direction(v: DVec3) -> bool {
    DIRECTION.holds(v.length())
}

/// Is each number of `v` a factor along an axis?
pub fn is_scale(v: DVec3) -> bool {
    v.abs().to_array().into_iter().all(|x| SCALE.holds(x))
}

/// Checks the field `field`, a direction of any length.
pub(crate) fn check_direction(field: &str, v: DVec3) -> Result<(), Invalid> {
    let expected = || format!("three numbers, length {DIRECTION}");
    if is_direction(v) { Ok(()) } else { Err(Invalid::new(field, v, expected())) }
}

/// Checks the field `field`, a unit vector.
pub(crate) fn check_unit(field: &str, v: DVec3) -> Result<(), Invalid> {
    if UNIT_LENGTH.holds(v.length()) { Ok(()) } else { Err(Invalid::new(field, v, "a direction of length 1")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_refuse_what_is_not_finite() {
        assert!(COORDINATE.holds(1.0) && COORDINATE.holds(-FAR));
        assert!(!COORDINATE.holds(f64::NAN) && !COORDINATE.holds(f64::INFINITY));
        assert_eq!(COORDINATE.to_string(), "from -1e30 to 1e30");
        assert_eq!(UNIT.to_string(), "from 0 to 1");
        for v in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
            assert!(!is_direction(v) && !is_scale(v));
        }
    }

    /// Degrees of a scene file are within the bounds of radians, also where they are the bounds.
    #[test]
    fn angles_round_alike() {
        for degrees in [FOVY.0, 40.0, FOVY.1] {
            assert_eq!(FOVY.check_angle("fovy", degrees.to_radians()), Ok(()));
        }
        let wide = FOVY.check_angle("fovy", std::f64::consts::PI).unwrap_err().within("camera");
        assert_eq!(wide.to_string(), "`camera.fovy` is 180 degrees, expected a number from 1e-6 to 179.999 degrees");
    }
}
