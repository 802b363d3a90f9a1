//! Frame numbers.

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};

use serde::{Serialize, Serializer};

/// The number of a frame: whole, or between two whole frames, as in 1.5. Frames are the unit of time.
///
/// Made of any `i32`, `i64` or `f64`. A number that is not finite has no frame, and renderers refuse it.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameNumber(f64);

impl FrameNumber {
    /// Decimals that names of files show.
    pub const DECIMALS: usize = 4;

    /// The number, frames.
    pub const fn get(self) -> f64 {
        self.0
    }

    /// Has it no fraction?
    pub fn is_whole(self) -> bool {
        self.0.fract() == 0.0
    }

    /// As names of files show it: `0012`, `-0005`; with four decimals after `_` where it is not whole, `0001_5000`.
    ///
    /// So the names of rising frames from 0 to 9999 are in order: `_` comes after the dot that ends whole numbers.
    pub fn padded(self) -> String {
        let (sign, size) = (if self.0 < 0.0 { "-" } else { "" }, self.0.abs());
        if self.is_whole() {
            return format!("{sign}{size:04}");
        }
        let text = format!("{sign}{size:0width$.decimals$}", width = 5 + Self::DECIMALS, decimals = Self::DECIMALS);
        text.replace('.', "_")
    }

    /// Reads what [`padded`](Self::padded) writes, with any number of leading zeros and decimals. `None` for anything
    /// else, and for whole numbers that an `f64` cannot hold.
    pub fn from_padded(text: &str) -> Option<Self> {
        let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        let (whole, decimals) = text.split_once('_').unwrap_or((text, "0"));
        if !digits(whole.strip_prefix('-').unwrap_or(whole)) || !digits(decimals) {
            return None;
        }
        let exact: i64 = whole.parse().ok()?;
        if (exact as f64) as i64 != exact {
            return None;
        }
        format!("{whole}.{decimals}").parse::<f64>().ok().map(Self::from)
    }
}

impl From<f64> for FrameNumber {
    fn from(number: f64) -> Self {
        // -0 and 0 are one frame.
        Self(number + 0.0)
    }
}

impl From<i64> for FrameNumber {
    fn from(number: i64) -> Self {
        Self(number as f64)
    }
}

impl From<i32> for FrameNumber {
    fn from(number: i32) -> Self {
        Self(f64::from(number))
    }
}

impl fmt::Display for FrameNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Whole numbers as integers, others as floats.
impl Serialize for FrameNumber {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let whole = self.0 as i64;
        if whole as f64 == self.0 { serializer.serialize_i64(whole) } else { serializer.serialize_f64(self.0) }
    }
}

impl Ord for FrameNumber {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for FrameNumber {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for FrameNumber {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for FrameNumber {}

impl Hash for FrameNumber {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.to_bits().hash(state);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(value: f64) -> FrameNumber {
        value.into()
    }

    #[test]
    fn names_are_read_back_and_rise_with_the_frames() {
        for (value, name) in [
            (0.0, "0000"),
            (-0.0, "0000"),
            (7.0, "0007"),
            (12_345.0, "12345"),
            (-5.0, "-0005"),
            (-12_345.0, "-12345"),
            (1.5, "0001_5000"),
            (0.0001, "0000_0001"),
            (-0.25, "-0000_2500"),
            (12_345.125, "12345_1250"),
            (1e9, "1000000000"),
        ] {
            assert_eq!(number(value).padded(), name);
            assert_eq!(FrameNumber::from_padded(name), Some(number(value)), "{name}");
        }
        for text in ["", "-", "x", "+3", "1.5", "1_", "_5", "1_-5", "1_5_0", "99999999999999999999", "9007199254740993"]
        {
            assert_eq!(FrameNumber::from_padded(text), None, "{text}");
        }
        let names: Vec<_> = (0..100).map(|i| format!("a.{}.png", number(f64::from(i) / 8.0).padded())).collect();
        assert!(names.is_sorted(), "{names:?}");
    }

    #[test]
    fn numbers_are_shown_as_they_are_written() {
        let texts = [1.0, -5.0, 1.5, 0.25].map(|value| number(value).to_string());
        assert_eq!(texts, ["1", "-5", "1.5", "0.25"]);
        let json = [1.0, -5.0, 1.5].map(|value| serde_json::to_string(&number(value)).unwrap());
        assert_eq!(json, ["1", "-5", "1.5"]);
        assert_eq!(number(-0.0), FrameNumber::from(0));
        assert!(FrameNumber::from(-1) < number(-0.5) && number(1.0) < number(1.5));
    }
}
