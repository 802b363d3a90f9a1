//! `--frames`: lists of frames, whole or between two whole ones.

use std::collections::HashSet;

use splatblur::FrameNumber;

/// Help of `--frames`.
pub(super) const HELP: &str = "\
Frames, several with commas: A..B (both inclusive, or A-B), A..BxSTEP, or one, as in 1..48, 1..100x10, 1,5,9 or \
1..2x0.25. They are made in this order; one that is named twice is made once. Fractions have at most four decimals. \
Negative frames with `..` only, as in -5..-2 [default: the scene's].";

/// Frames of a run, each once, in the order in which they are made; at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FrameList(Vec<FrameNumber>);

/// Parts of a frame that a number may name: the unit in which lists are counted, so that steps add up exactly.
const TICKS: i64 = 10_i64.pow(FrameNumber::DECIMALS as u32);

/// Greatest distance of a frame from 0: times beside it are still exact to 1e-6 frames.
pub(super) const MAX_FRAME: i64 = 1_000_000_000;

/// Most frames of one run.
const MAX_FRAMES: u64 = 1_000_000;

impl FrameList {
    /// The whole frames from `first` to `last`.
    pub(super) fn range(first: i64, last: i64) -> Result<Self, String> {
        Self::of(&[Item::new(first.saturating_mul(TICKS), last.saturating_mul(TICKS), TICKS)?])
    }

    /// Counts before it makes room.
    fn of(items: &[Item]) -> Result<Self, String> {
        let count = items.iter().map(Item::count).fold(0, u64::saturating_add);
        if count > MAX_FRAMES {
            return Err(format!("{count} frames are too many for one run (at most {MAX_FRAMES})"));
        }
        let mut seen = HashSet::with_capacity(count as usize);
        let ticks = items.iter().flat_map(Item::ticks).filter(|&tick| seen.insert(tick));
        Ok(Self(ticks.map(|tick| FrameNumber::from(tick as f64 / TICKS as f64)).collect()))
    }

    /// The frames.
    pub(super) fn all(&self) -> &[FrameNumber] {
        &self.0
    }

    /// Their number.
    pub(super) fn count(&self) -> u64 {
        self.0.len() as u64
    }

    /// The one that is made first.
    pub(super) fn first(&self) -> FrameNumber {
        self.0.first().copied().unwrap_or_default()
    }

    /// The one that is made last.
    pub(super) fn last(&self) -> FrameNumber {
        self.0.last().copied().unwrap_or_default()
    }

    /// True where each is whole and follows the one before.
    pub(super) fn follow_each_other(&self) -> bool {
        self.0.iter().all(|frame| frame.is_whole()) && self.0.windows(2).all(|p| p[1].get() - p[0].get() == 1.0)
    }

    /// True where each is later than the one before.
    pub(super) fn ascend(&self) -> bool {
        self.0.is_sorted()
    }

    /// As in `frame 3`, `frames 1..48`, `10 frames from 1 to 91`.
    pub(super) fn in_words(&self) -> String {
        match (self.first(), self.last()) {
            (first, _) if self.0.len() == 1 => format!("frame {first}"),
            (first, last) if self.follow_each_other() => format!("frames {first}..{last}"),
            (first, last) => format!("{} frames from {first} to {last}", self.0.len()),
        }
    }
}

/// Frames at equal distances, in ticks.
struct Item {
    first: i64,
    last: i64,
    step: i64,
}

impl Item {
    /// Refuses ranges that run backwards.
    fn new(first: i64, last: i64, step: i64) -> Result<Self, String> {
        if last < first {
            let [first, last] = [first, last].map(|ticks| FrameNumber::from(ticks as f64 / TICKS as f64));
            return Err(format!("the range {first}..{last} is empty; did you mean {last}..{first}?"));
        }
        Ok(Self { first, last, step })
    }

    /// `A..B`, `A-B` (neither negative), or `A`; a range may end in `xSTEP`.
    fn parse(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let (range, step) = match text.split_once('x') {
            Some((range, step)) if !range.is_empty() => (range, Some(step)),
            _ => (text, None),
        };
        let (first, last) = if let Some((a, b)) = range.split_once("..") {
            let b = b.strip_prefix('=').unwrap_or(b);
            if a.trim().is_empty() || b.trim().is_empty() {
                return Err(format!(
                    "`{range}` lacks an end: write both, as in 3..48 (without this option all frames of the scene are \
                     made)"
                ));
            }
            (ticks(a)?, ticks(b)?)
        } else if range.starts_with('-') {
            return Err(format!(
                "negative frames need `..`, as in `{0}..{0}` for one or `-5..-2` for several",
                lead(range)
            ));
        } else if let Some((a, b)) = range.split_once('-') {
            (ticks(a)?, ticks(b)?)
        } else if step.is_some() {
            return Err(format!("`{text}` is a step without a range: write A..BxSTEP, as in 1..100x10"));
        } else {
            let one = ticks(range)?;
            (one, one)
        };
        let step = match step {
            None => TICKS,
            Some(step) => match decimal(step) {
                Some(ticks) if ticks > 0 => ticks,
                _ => return Err(format!("the step `{step}` is not a number above 0 with at most four decimals")),
            },
        };
        Self::new(first, last, step)
    }

    fn count(&self) -> u64 {
        self.last.abs_diff(self.first) / self.step.unsigned_abs() + 1
    }

    fn ticks(&self) -> impl Iterator<Item = i64> {
        let (first, step) = (self.first, self.step);
        (0..self.count()).map(move |i| first + i as i64 * step)
    }
}

/// A frame number in ticks.
fn ticks(text: &str) -> Result<i64, String> {
    let text = text.trim();
    let number = decimal(text).ok_or_else(|| match text.parse::<f64>() {
        Ok(value) if value.is_finite() && text.contains('.') => {
            format!("frame {text} has more than four decimals")
        }
        _ => format!("`{text}` is not a frame number (write A..B, A-B or one frame, as in 1..48)"),
    })?;
    if number.abs() > MAX_FRAME * TICKS {
        return Err(format!("frame {text} is beyond {MAX_FRAME}"));
    }
    Ok(number)
}

/// A decimal number with at most four decimals, in ticks; without exponents.
fn decimal(text: &str) -> Option<i64> {
    let (sign, size) = text.strip_prefix('-').map_or((1, text), |size| (-1, size));
    let (whole, decimals) = size.split_once('.').unwrap_or((size, "0"));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    if !digits(whole) || !digits(decimals) || decimals.len() > FrameNumber::DECIMALS {
        return None;
    }
    let part: i64 = format!("{decimals:0<width$}", width = FrameNumber::DECIMALS).parse().ok()?;
    whole.parse::<i64>().ok()?.checked_mul(TICKS)?.checked_add(part)?.checked_mul(sign)
}

/// The first negative number of a mistaken range, for the hint.
fn lead(text: &str) -> &str {
    let end = text.char_indices().skip(1).find(|(_, c)| !c.is_ascii_digit()).map_or(text.len(), |(i, _)| i);
    if end > 1 { &text[..end] } else { "-5" }
}

/// A list of frames: see [`HELP`].
pub(super) fn frames(text: &str) -> Result<FrameList, String> {
    let items: Vec<Item> = text.split(',').map(Item::parse).collect::<Result<_, _>>()?;
    FrameList::of(&items)
}

/// One frame, also a negative one.
pub(super) fn frame(text: &str) -> Result<FrameNumber, String> {
    ticks(text).map(|ticks| FrameNumber::from(ticks as f64 / TICKS as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(text: &str) -> Result<Vec<f64>, String> {
        frames(text).map(|frames| frames.all().iter().map(|frame| frame.get()).collect())
    }

    #[test]
    fn ranges() {
        for (text, first, last, count) in [
            ("1..48", 1.0, 48.0, 48),
            ("3-7", 3.0, 7.0, 5),
            ("3..=7", 3.0, 7.0, 5),
            ("5", 5.0, 5.0, 1),
            ("0", 0.0, 0.0, 1),
            ("-5..-2", -5.0, -2.0, 4),
            ("-5..-5", -5.0, -5.0, 1),
            ("-3..4", -3.0, 4.0, 8),
            ("100000000..100000001", 100_000_000.0, 100_000_001.0, 2),
            ("0..999999", 0.0, 999_999.0, 1_000_000),
        ] {
            let frames = frames(text).unwrap();
            assert_eq!((frames.first().get(), frames.last().get(), frames.count()), (first, last, count), "{text}");
            assert!(frames.follow_each_other(), "{text}");
        }
    }

    #[test]
    fn steps_lists_and_fractions() {
        for (text, want) in [
            ("1..100x10", &[1.0, 11.0, 21.0, 31.0, 41.0, 51.0, 61.0, 71.0, 81.0, 91.0][..]),
            ("1,5,9", &[1.0, 5.0, 9.0]),
            ("1.5", &[1.5]),
            ("1..2x0.25", &[1.0, 1.25, 1.5, 1.75, 2.0]),
            ("0..1x0.1", &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]),
            ("-1..-0.5x.5", &[]),
            ("-1..-0.5x0.5", &[-1.0, -0.5]),
            ("1..5x3, 2..3, 9", &[1.0, 4.0, 2.0, 3.0, 9.0]),
            // Coarse first; what is named twice is made once.
            ("1..5x2,1..5", &[1.0, 3.0, 5.0, 2.0, 4.0]),
            ("1..2x0.3333", &[1.0, 1.3333, 1.6666, 1.9999]),
            ("3..4x5", &[3.0]),
        ] {
            if want.is_empty() {
                assert!(list(text).is_err(), "{text}");
            } else {
                assert_eq!(list(text).unwrap(), want, "{text}");
            }
        }
        for (text, words) in [("3", "frame 3"), ("1..3", "frames 1..3"), ("1,3..4", "3 frames from 1 to 4")] {
            assert_eq!(frames(text).unwrap().in_words(), words);
        }
    }

    #[test]
    fn mistakes_are_explained() {
        for (text, hint) in [
            ("-5", "-5..-5"),
            ("-5-3", "-5..-5"),
            ("-", "`..`"),
            ("7..3", "did you mean 3..7?"),
            ("7-3", "did you mean 3..7?"),
            ("1.5..1", "did you mean 1..1.5?"),
            ("", "not a frame number"),
            ("1,,2", "not a frame number"),
            ("..", "lacks an end"),
            ("3..", "lacks an end: write both, as in 3..48"),
            ("..3", "lacks an end"),
            ("a..b", "`a` is not a frame number"),
            ("1e3", "not a frame number"),
            ("x", "not a frame number"),
            ("nan", "not a frame number"),
            ("1.23456", "more than four decimals"),
            ("3--7", "empty"),
            ("3x2", "a step without a range"),
            ("1..5x0", "step `0`"),
            ("1..5x-1", "step `-1`"),
            ("1..5x", "step ``"),
            ("99999999999999999999", "not a frame number"),
            ("9223372036854775807", "not a frame number"),
            ("1000000001", "beyond"),
            ("0..1000000", "too many"),
            ("0..1000000000x0.0001", "too many"),
            ("0..999999,5..6", "too many"),
        ] {
            let error = list(text).unwrap_err();
            assert!(error.contains(hint), "{text}: {error}");
        }
        assert_eq!(frame("-5").unwrap(), FrameNumber::from(-5));
        assert!(frame("1..2").is_err());
        assert!(FrameList::range(7, 3).is_err() && FrameList::range(i64::MIN, i64::MAX).is_err());
    }
}
