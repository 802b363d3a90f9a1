//! Floats of the device against the CPU's, with tolerances.

use std::sync::LazyLock;

use super::harness::NONE;
use crate::backend::gpu::adapters;
use crate::backend::gpu::slots::Slot;

/// Share of slots or pixels that may differ more: those for which a rounded value decides (a bound next to a pixel's
/// centre, a pixel next to a rim). On the software device there are none.
const BUDGET: f64 = 1e-3;
/// A factor on both. Hardware has twice as much: on an NVIDIA H200 44 of 38,400 sums of published kernels differed by
/// up to 6.7e-6, and 4 of 3,840 loose weights by 4e-5. Tests run on hardware where there is any.
static LEEWAY: LazyLock<u8> =
    LazyLock::new(|| if adapters().iter().any(|adapter| adapter.kind != "software") { 2 } else { 1 });

/// What two backends have of one slot.
pub(super) struct Tally {
    tolerance: f32,
    worst: f32,
    decided_otherwise: usize,
    pub count: usize,
    first: Option<String>,
}

impl Tally {
    pub(super) fn of(slot: Slot) -> Self {
        Self { tolerance: slot.tolerance(), worst: 0.0, decided_otherwise: 0, count: 0, first: None }
    }

    /// Compares values whose size is that of `scale`.
    pub(super) fn floats(&mut self, got: &[f32], want: &[f32], scale: f32, at: impl Fn() -> String) {
        assert_eq!(got.len(), want.len(), "{}", at());
        let difference =
            got.iter().zip(want).map(|(g, w)| (g - w).abs()).fold(0.0, |a: f32, b| if b <= a { a } else { b });
        let relative = difference / scale.max(1.0);
        self.count += 1;
        if relative <= self.tolerance * f32::from(*LEEWAY) {
            self.worst = self.worst.max(relative);
        } else {
            self.otherwise(|| format!("{}: {got:?}, not {want:?}", at()));
        }
    }

    pub(super) fn otherwise(&mut self, at: impl Fn() -> String) {
        self.decided_otherwise += 1;
        self.first.get_or_insert_with(at);
    }

    pub(super) fn check(self, what: &str) -> Result<(), String> {
        let Self { worst, decided_otherwise, count, first, .. } = self;
        eprintln!("{what}: worst {worst:.1e}, {decided_otherwise} of {count} decided otherwise");
        if decided_otherwise as f64 > BUDGET * f64::from(*LEEWAY) * count as f64 {
            return Err(format!("{what}: {decided_otherwise} of {count} differ; first {}", first.unwrap_or_default()));
        }
        Ok(())
    }
}

/// Largest magnitude.
pub(super) fn largest(values: &[f32]) -> f32 {
    values.iter().fold(0.0, |a, b| a.max(b.abs()))
}

/// The values of all tiles, one tile after the other.
pub(super) fn flat<T: Copy>(tiles: &[Vec<T>]) -> Vec<T> {
    tiles.iter().flatten().copied().collect()
}

/// Single values in the order in which the device has them.
pub(super) fn compare(slot: Slot, got: &[f32], want: &[f32], scale: impl Fn(usize) -> f32) -> Result<(), String> {
    let what = slot.name();
    assert_eq!(got.len(), want.len(), "{what}");
    let mut tally = Tally::of(slot);
    for (i, (got, want)) in got.iter().zip(want).enumerate() {
        let want = want.min(NONE);
        tally.floats(&[*got], &[want], scale(i).max(want.abs()), || format!("{i}"));
    }
    tally.check(what)
}
