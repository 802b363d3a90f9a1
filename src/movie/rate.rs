//! Frames a second, as the fraction that movies state.

use std::fmt;

/// Denominators of fractions up to this one are tried.
const MOST: u32 = 1000;
/// Distance, in parts of the rate, at which a fraction is what was meant: 29.97 is 30000/1001, and so is 29.970030.
const NEAR: f64 = 2e-4;

/// Frames a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate {
    /// Frames.
    pub frames: u32,
    /// In so many seconds.
    pub seconds: u32,
}

impl Rate {
    /// The fraction that a rate from 0.001 to 1e6 means. What television writes as 23.976, 29.97 or 59.94 is a multiple
    /// of 1000/1001. Others are the fraction with the least denominator that is the rate to nine digits, else
    /// thousandths.
    pub fn of(rate: f64) -> Self {
        let whole = rate.round().max(1.0);
        let ntsc = whole * 1000.0 / 1001.0;
        if [24.0, 30.0, 48.0, 60.0, 120.0].contains(&whole) && rate != whole && (rate / ntsc - 1.0).abs() < NEAR {
            return Self { frames: whole as u32 * 1000, seconds: 1001 };
        }
        let fits = |seconds: &u32| {
            let frames = rate * f64::from(*seconds);
            frames.round() >= 1.0 && (frames / frames.round() - 1.0).abs() < 1e-9
        };
        let seconds = (1..=MOST).find(fits).unwrap_or(MOST);
        Self { frames: (rate * f64::from(seconds)).round().max(1.0) as u32, seconds }
    }

    /// The time from the begin of the movie to the begin of a frame, in `parts` of a second, rounded.
    pub(super) fn begin(self, frame: u64, parts: u64) -> u64 {
        let frames = u128::from(self.frames);
        let sum = u128::from(frame) * u128::from(self.seconds) * u128::from(parts);
        u64::try_from((2 * sum + frames) / (2 * frames)).unwrap_or(u64::MAX)
    }
}

impl fmt::Display for Rate {
    /// As ffmpeg reads it: `24`, `30000/1001`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.seconds {
            1 => write!(f, "{}", self.frames),
            seconds => write!(f, "{}/{seconds}", self.frames),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_fractions() {
        for (rate, text) in [
            (24.0, "24"),
            (25.0, "25"),
            (12.5, "25/2"),
            (1.0 / 3.0, "1/3"),
            (23.976, "24000/1001"),
            (23.98, "24000/1001"),
            (24_000.0 / 1001.0, "24000/1001"),
            (29.97, "30000/1001"),
            (59.94, "60000/1001"),
            (23.9, "239/10"),
            (29.9, "299/10"),
            (0.001, "1/1000"),
            (1e6, "1000000"),
            (std::f64::consts::PI, "3142/1000"),
        ] {
            assert_eq!(Rate::of(rate).to_string(), text, "{rate}");
        }
    }

    #[test]
    fn frames_begin_at_their_times() {
        let begins = |rate| (0..4).map(|frame| Rate::of(rate).begin(frame, 100)).collect::<Vec<_>>();
        assert_eq!(begins(24.0), [0, 4, 8, 13]);
        assert_eq!(begins(50.0), [0, 2, 4, 6]);
        assert_eq!(Rate::of(24.0).begin(24_000_000, 100), 100_000_000);
    }
}
