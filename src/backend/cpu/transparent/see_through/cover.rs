//! How much of a pixel is covered, and what light gets through, while layers are peeled off.
//!
//! Groups of splats fill a pixel side by side until it is full, as the parts of one surface do at a crease or at an
//! outline. What does not fit lies behind what was there before (docs/math.md, section 12).

use super::super::accumulators::OPAQUE;
use crate::backend::cpu::paint::buffers::APRON_STRIDE;
use crate::backend::cpu::tiles::{LANES, STRIDE, TILE, TileRect, lanes};

/// The layers that are peeled off one tile.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct PeelBuffers {
    pub(super) cover: Cover,
    /// Is there more to peel off?
    pub(super) live: bool,
}

impl PeelBuffers {
    /// Bytes of one tile.
    pub(in crate::backend) const BYTES: u64 = Cover::BYTES;
}

/// For each pixel, `TILE` rows of `STRIDE`.
#[derive(Clone, Debug, Default)]
pub(super) struct Cover {
    /// Share of the pixel that the current sheet fills, in [0, 1).
    filled: Vec<f32>,
    /// Light that gets through that share, and through the rest: both together are the transmittance.
    through_filled: Vec<f32>,
    through_rest: Vec<f32>,
}

type Lanes = [f32; LANES];

/// `LANES` pixels of it.
#[derive(Clone, Copy)]
pub(super) struct CoverLanes {
    filled: Lanes,
    through_filled: Lanes,
    through_rest: Lanes,
}

impl Cover {
    /// Bytes of one tile.
    pub(super) const BYTES: u64 = (3 * TILE * STRIDE * size_of::<f32>()) as u64;

    /// Nothing is covered.
    pub(super) fn start(&mut self) {
        let planes = [&mut self.filled, &mut self.through_filled, &mut self.through_rest];
        for (plane, value) in planes.into_iter().zip([0.0, 0.0, 1.0]) {
            plane.clear();
            plane.resize(TILE * STRIDE, value);
        }
    }

    /// `LANES` pixels from `at` on.
    #[inline(always)]
    pub(super) fn load(&self, at: usize) -> CoverLanes {
        CoverLanes {
            filled: lanes(&self.filled[at..]),
            through_filled: lanes(&self.through_filled[at..]),
            through_rest: lanes(&self.through_rest[at..]),
        }
    }

    #[inline(always)]
    pub(super) fn store(&mut self, at: usize, lanes: &CoverLanes) {
        self.filled[at..at + LANES].copy_from_slice(&lanes.filled);
        self.through_filled[at..at + LANES].copy_from_slice(&lanes.through_filled);
        self.through_rest[at..at + LANES].copy_from_slice(&lanes.through_rest);
    }

    /// Pixels of a tile that another layer would still show in: `threshold` is that layer's, in rows with an apron.
    pub(super) fn left_out(&self, tile: &TileRect, threshold: &[f32], ceiling: &[f32]) -> u64 {
        let pixels = (0..tile.height).flat_map(|y| (0..tile.width).map(move |x| (y, x)));
        let shows = |&(y, x): &(usize, usize)| {
            let at = y * STRIDE + x;
            let depth = threshold[y * APRON_STRIDE + x];
            depth < f32::INFINITY
                && ceiling.get(at).is_none_or(|&ceiling| depth <= ceiling)
                && self.through_filled[at] + self.through_rest[at] >= OPAQUE
        };
        pixels.filter(shows).count() as u64
    }
}

impl CoverLanes {
    /// Light that gets through lane `l`.
    #[inline(always)]
    pub(super) fn through(&self, l: usize) -> f32 {
        self.through_filled[l] + self.through_rest[l]
    }

    /// Puts a group that covers the share `coverage` of lane `l` behind what is there, and says what light reaches it.
    #[inline(always)]
    pub(super) fn put(&mut self, l: usize, coverage: f32, opacity: f32) -> f32 {
        let (filled, of_filled, of_rest) = (self.filled[l], self.through_filled[l], self.through_rest[l]);
        let room = 1.0 - filled;
        let beside = if coverage < room { coverage } else { room };
        let behind = coverage - beside;
        let behind = if behind < filled { behind } else { filled };
        let light_beside = of_rest * (beside / room);
        let light_behind = if behind > 0.0 { of_filled * (behind / filled) } else { 0.0 };
        let kept = 1.0 - opacity;
        let full = beside >= room;
        // A full pixel starts the next sheet with what did not fit.
        let next_filled = if full { behind } else { filled + beside };
        let stays = of_filled - light_behind + light_beside * kept;
        let next_of_filled = if full { light_behind * kept } else { stays };
        let next_of_rest = if full { stays } else { of_rest - light_beside };
        let all = next_filled >= 1.0;
        self.filled[l] = if all { 0.0 } else { next_filled };
        self.through_filled[l] = if all { 0.0 } else { next_of_filled };
        self.through_rest[l] = if all { next_of_filled } else { next_of_rest };
        light_beside + light_behind
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Puts groups of (coverage, opacity) one behind the other: the light that each keeps, and what gets through.
    fn put(groups: &[(f32, f32)]) -> (Vec<f32>, f32) {
        let mut cover = Cover::default();
        cover.start();
        let mut lanes = cover.load(0);
        let kept = groups.iter().map(|&(coverage, opacity)| opacity * lanes.put(0, coverage, opacity)).collect();
        (kept, lanes.through(0))
    }

    fn assert_near(found: &(Vec<f32>, f32), want: &[f32], through: f32) {
        let worst = found.0.iter().zip(want).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-6 && (found.1 - through).abs() < 1e-6, "{found:?} for {want:?}, {through}");
    }

    #[test]
    fn full_layers_are_composited() {
        assert_near(&put(&[(1.0, 0.5), (1.0, 0.25)]), &[0.5, 0.125], 0.375);
    }

    #[test]
    fn parts_of_a_surface_lie_side_by_side() {
        assert_near(&put(&[(0.3, 0.5), (0.7, 0.5)]), &[0.15, 0.35], 0.5);
        // An opaque surface of two parts hides all that is behind it.
        assert_near(&put(&[(0.3, 1.0), (0.7, 1.0), (1.0, 0.5)]), &[0.3, 0.7, 0.0], 0.0);
    }

    #[test]
    fn what_does_not_fit_lies_behind() {
        // .3 of the pixel shows both, .7 the second alone.
        let (a, b) = (0.5, 0.8);
        assert_near(&put(&[(0.3, a), (1.0, b)]), &[0.3 * a, 0.7 * b + 0.3 * (1.0 - a) * b], 0.3 * 0.1 + 0.7 * 0.2);
        assert_near(&put(&[(0.3, 1.0), (1.0, 1.0)]), &[0.3, 0.7], 0.0);
    }

    #[test]
    fn light_is_neither_made_nor_lost() {
        let groups = [(0.3, 0.5), (0.9, 0.2), (0.05, 1.0), (1.0, 0.7), (0.6, 0.1), (0.999_999_9, 0.3)];
        let (kept, through) = put(&groups);
        assert!((kept.iter().sum::<f32>() + through - 1.0).abs() < 1e-6);
        assert!(kept.iter().all(|kept| *kept >= 0.0) && through >= 0.0);
    }
}
