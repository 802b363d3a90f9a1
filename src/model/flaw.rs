//! Faults in the columns of a model that a program made. Readers of files make none.

use std::fmt::Debug;

use glam::Vec3;

use crate::limits::{Invalid, MAX_COORDINATE};

/// Columns beside one of so many entries.
#[derive(Clone, Copy)]
pub(super) struct Columns(pub(super) usize);

impl Columns {
    /// Checks the length of a column that must be there.
    pub(super) fn check(self, name: &str, length: usize) -> Result<(), Invalid> {
        let Self(points) = self;
        let expected = || format!("{points} entries, as many as `position`");
        if length == points {
            Ok(())
        } else {
            Err(Invalid::new(name, format_args!("{length} entries long"), expected()))
        }
    }

    /// Checks the length of a column that may be empty.
    pub(super) fn check_optional(self, name: &str, length: usize) -> Result<(), Invalid> {
        if length == 0 { Ok(()) } else { self.check(name, length) }
    }
}

/// Checks each entry of a column.
pub(super) fn each<T: Copy + Debug>(
    name: &str,
    column: &[T],
    is_right: impl Fn(T) -> bool,
    expected: &str,
) -> Result<(), Invalid> {
    match column.iter().position(|&entry| !is_right(entry)) {
        None => Ok(()),
        Some(at) => Err(Invalid::new(&format!("{name}[{at}]"), format_args!("{:?}", column[at]), expected)),
    }
}

/// What [`is_place`] holds for.
pub(super) const PLACE: &str = "numbers from -1e18 to 1e18";
/// What [`is_colour`] holds for.
pub(super) const COLOUR: &str = "numbers from -65504 to 65504";

/// Can it be a position, an axis or a velocity? Its square fits a 32-bit float.
pub(super) fn is_place(v: Vec3) -> bool {
    // NaN fails the comparison too.
    v.abs().cmple(Vec3::splat(MAX_COORDINATE as f32)).all()
}

/// Can it be a shading normal? Its length is 1 up to rounding, or 0.
pub(super) fn is_normal(v: Vec3) -> bool {
    v.length_squared() <= 1.01
}

/// Can it be a colour? A 16-bit float holds it.
pub(super) fn is_colour(v: Vec3) -> bool {
    v.abs().cmple(Vec3::splat(65_504.0)).all()
}
