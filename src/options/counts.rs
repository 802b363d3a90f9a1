//! Counts as text: whole numbers within their ranges.

use std::ops::RangeInclusive;

use super::OptionError;
use crate::limits;

/// A whole number in a range.
pub(super) fn number(text: &str, range: RangeInclusive<u32>) -> Result<u32, OptionError> {
    let value = text.parse().ok().filter(|value| range.contains(value));
    value.ok_or_else(|| OptionError::value(format!("a whole number from {} to {}", range.start(), range.end()), text))
}

/// A count of time samples, buckets, intervals or sub-pixel positions: 1 to [`limits::MAX_SAMPLES`].
///
/// # Errors
/// The text is no such number.
pub fn count(text: &str) -> Result<u32, OptionError> {
    number(text, limits::COUNT)
}

/// Most time samples of mode auto, which begins with 4 at the least: 4 to [`limits::MAX_SAMPLES`].
///
/// # Errors
/// The text is no such number.
pub fn samples_max(text: &str) -> Result<u32, OptionError> {
    number(text, limits::SAMPLES_MAX)
}
