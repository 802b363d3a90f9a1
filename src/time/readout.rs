//! The read-out of a sensor that is exposed row by row: a rolling shutter.

use std::fmt;
use std::str::FromStr;

use crate::limits::READOUT;

/// Where the read-out goes: from the edge that is exposed first to the one that is exposed last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// The top row is the first.
    #[default]
    Down,
    /// The bottom row is the first.
    Up,
    /// The left column is the first.
    Right,
    /// The right column is the first.
    Left,
}

impl Direction {
    /// All, in the order of the documents.
    pub const ALL: [Self; 4] = [Self::Down, Self::Up, Self::Right, Self::Left];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Down => "down",
            Self::Up => "up",
            Self::Right => "right",
            Self::Left => "left",
        }
    }

    /// The axis of the image along which times change: 0 for columns, 1 for rows.
    pub const fn axis(self) -> usize {
        match self {
            Self::Down | Self::Up => 1,
            Self::Right | Self::Left => 0,
        }
    }

    /// Do times rise with the pixel's number?
    pub const fn rises(self) -> bool {
        matches!(self, Self::Down | Self::Right)
    }
}

/// The row that is exposed at the shutter's own times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Anchor {
    /// The middle of the image.
    #[default]
    Middle,
    /// The edge at which the read-out begins.
    First,
}

impl Anchor {
    /// All, in the order of the documents.
    pub const ALL: [Self; 2] = [Self::Middle, Self::First];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Middle => "middle",
            Self::First => "first",
        }
    }
}

/// A rolling shutter. Each row (or column) is exposed as long as the shutter says, but later than the one before.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readout {
    /// Frames from the exposure of the first edge of the image to that of the last one, >= 0; 0: all pixels are exposed
    /// at once.
    pub duration: f64,
    /// Where the read-out goes.
    pub direction: Direction,
    /// The row that is exposed at the shutter's own times.
    pub anchor: Anchor,
}

impl Readout {
    /// Is every row exposed at a time of its own?
    pub fn rolls(&self) -> bool {
        self.duration > 0.0
    }

    /// By how much later than the shutter says a place of the image is exposed, frames. `place` is counted along
    /// [`Direction::axis`] from the top or left edge, 0, to the other one, 1: (y + 1/2) / height for row y.
    pub fn delay(&self, place: f64) -> f64 {
        let passed = if self.direction.rises() { place } else { 1.0 - place };
        let origin = match self.anchor {
            Anchor::Middle => 0.5,
            Anchor::First => 0.0,
        };
        self.duration * (passed - origin)
    }

    /// Delays from one edge of the image to the other, for those who look at a few of them, frames; 0 alone where all
    /// pixels are exposed at once.
    pub fn some_delays(&self) -> Vec<f64> {
        if self.rolls() { [0.0, 0.25, 0.5, 0.75, 1.0].map(|place| self.delay(place)).into() } else { vec![0.0] }
    }

    /// Least and greatest delay of the image, frames.
    pub fn delays(&self) -> [f64; 2] {
        let [a, b] = [0.0, 1.0].map(|place| self.delay(place));
        [a.min(b), a.max(b)]
    }
}

impl fmt::Display for Readout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{}", self.duration, self.direction.name(), self.anchor.name())
    }
}

impl FromStr for Readout {
    type Err = String;

    /// `DURATION[,DIRECTION[,ANCHOR]]`: frames, then words in any order.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(',');
        let number = parts.next().unwrap_or_default();
        let wrong = || format!("`{number}`, expected frames {READOUT}");
        let duration = number.trim().parse::<f64>().map_err(|_| wrong())?;
        if !READOUT.holds(duration) {
            return Err(wrong());
        }
        let mut readout = Self { duration, ..Self::default() };
        for word in parts.map(str::trim) {
            if let Some(direction) = Direction::ALL.into_iter().find(|direction| direction.name() == word) {
                readout.direction = direction;
            } else if let Some(anchor) = Anchor::ALL.into_iter().find(|anchor| anchor.name() == word) {
                readout.anchor = anchor;
            } else {
                return Err(format!("`{word}`, expected down, up, right or left, or middle or first"));
            }
        }
        Ok(readout)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_go_where_the_readout_goes() {
        let of = |text: &str| Readout::from_str(text);
        assert_eq!(of("0.5").map(|r| [0.0, 0.5, 1.0].map(|y| r.delay(y))), Ok([-0.25, 0.0, 0.25]));
        assert_eq!(of("0.5,up").map(|r| [0.0, 1.0].map(|y| r.delay(y))), Ok([0.25, -0.25]));
        assert_eq!(of("0.5,left,first").map(|r| [0.0, 1.0].map(|x| r.delay(x))), Ok([0.5, 0.0]));
        assert_eq!(of("0.5,first").map(|r| r.delays()), Ok([0.0, 0.5]));
        assert_eq!(of("2,right").map(|r| r.direction.axis()), Ok(0));
    }

    #[test]
    fn the_text_form_is_read_again() {
        for text in ["0.4,down,middle", "1,left,first"] {
            assert_eq!(Readout::from_str(text).map(|readout| readout.to_string()), Ok(text.to_owned()));
        }
        for text in ["", "-1", "nan", "1e9", "0.5,sideways", "0.5,"] {
            assert!(Readout::from_str(text).is_err(), "{text}");
        }
    }
}
