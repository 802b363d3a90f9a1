//! What the readers of scans share: how many points a file may hold, which are taken, greys of intensities, and a guard
//! against panics of the libraries.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use glam::Vec3;

use crate::model::cloud::{Cloud, ColourStorage};
use crate::model::error::ParseError;
use crate::model::options::PointOptions;

/// Points that every file may hold, however small it is.
const FREE_POINTS: u64 = 1 << 20;

/// Most points above [`FREE_POINTS`] for each byte of a file. Packed scans have 2 to 10 bytes a point; a scan without
/// noise, as tests make them, has a few points a byte.
const MOST_POINTS_A_BYTE: u64 = 64;

/// One intensity in so many is brighter than white: a few mirrors would leave all others black.
const WHITE: usize = 200;

/// Checks what a file says about its number of points: some bytes that unpack to billions of equal points are an
/// attempt to fill memory.
///
/// # Errors
/// There are too many for a file of `size` bytes.
pub(super) fn check_count(points: u64, size: usize, at: usize) -> Result<(), ParseError> {
    let most = FREE_POINTS.saturating_add(MOST_POINTS_A_BYTE.saturating_mul(size as u64));
    if points <= most {
        return Ok(());
    }
    Err(ParseError::byte(at, format!("{points} points in {size} bytes"), format!("at most {most}")))
}

/// Takes every n-th point of those that a file offers one after another.
#[derive(Debug)]
pub(super) struct Thinning {
    every: u64,
    offered: u64,
}

impl Thinning {
    pub(super) fn new(options: &PointOptions) -> Self {
        Self { every: u64::from(options.every.max(1)), offered: 0 }
    }

    /// Is the next point taken?
    pub(super) fn takes(&mut self) -> bool {
        let takes = self.offered.is_multiple_of(self.every);
        self.offered += 1;
        takes
    }
}

/// Greys of intensities, which have no common scale: black is 0, white what one in [`WHITE`] exceeds. The note says it.
pub(super) fn grey(intensity: &[f32], cloud: &mut Cloud) {
    let mut sorted: Vec<f32> = intensity.iter().copied().filter(|x| x.is_finite() && *x > 0.0).collect();
    if sorted.is_empty() {
        return;
    }
    let nth = sorted.len() - 1 - sorted.len() / WHITE;
    let white = *sorted.select_nth_unstable_by(nth, f32::total_cmp).1;
    let channel = |x: f32| if x.is_finite() { (x / white).clamp(0.0, 1.0) } else { 0.0 };
    cloud.colour = intensity.iter().map(|x| Vec3::splat(channel(*x))).collect();
    cloud.colour_storage = ColourStorage::Integer;
    cloud.notes.push(format!("no colours: intensity from 0 to {white} is shown as grey"));
}

thread_local! {
    /// True while this thread is within [`guarded`].
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Does what a library does with bytes of a file; `None` if it panics, because it trusts that numbers of the file are
/// within its tables. Such a panic says nothing; all others are reported as before.
pub(super) fn guarded<T>(work: impl FnOnce() -> T) -> Option<T> {
    static QUIET: Once = Once::new();
    QUIET.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !GUARDED.get() {
                report(info);
            }
        }));
    });
    let before = GUARDED.replace(true);
    let done = panic::catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(before);
    done.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_within_is_no_result() {
        assert_eq!(guarded(|| 3), Some(3));
        assert_eq!(guarded(|| guarded(|| panic!("within")).map_or(4, |()| 5)), Some(4));
        assert_eq!(guarded(|| [1, 2][std::hint::black_box(7)]), None);
        assert!(!GUARDED.get());
    }
}
