//! Strata of the exposure: where time samples lie.
//!
//! Each stratum has the same share of its part of the exposure, whatever the weight, so that a finer sampling can reuse
//! the samples of a coarser one. Parts end where a pose jumps (a step key, a change of visibility), and where points of
//! a sequence are born or die: the program knows these times, and no sample has to find them.

use crate::scene::Scene;
use crate::scene::pose::cuts;
use crate::time::{FrameNumber, Shutter};

/// A part with a smaller share of the exposure is joined to its neighbour.
const LEAST_SHARE: f64 = 1e-6;

/// A part of the exposure without jumps.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Part {
    /// Shares of the exposure before the part, and before its end.
    ends: [f64; 2],
    /// Strata; an even number, so that both half buffers see the part.
    strata: u32,
}

/// The strata of the first round of a frame; a finer round divides each by an odd number.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Strata(Vec<Part>);

impl Strata {
    /// About `samples` strata for frame `number`: parts take them by their share of the exposure, and each has at least
    /// two. No more than `most` (at least 4) are made: where parts are too many, the shortest are joined to a
    /// neighbour.
    pub(super) fn new(scene: &Scene, number: FrameNumber, samples: u32, most: u32) -> Self {
        let shutter = &scene.shutter;
        let at = |t: f64| shutter.frame_time(number.get(), t);
        let [open, close] = [at(0.0), at(1.0)];
        let share = |time: f64| shutter.weight.integral(0.0, ((time - open) / (close - open)).clamp(0.0, 1.0));
        // Rows that are read out one after the other see a jump at other times of their exposures.
        let times = if shutter.readout.rolls() { Vec::new() } else { cuts(scene, open, close) };
        let mut cuts: Vec<f64> = times.into_iter().map(share).collect();
        cuts.insert(0, 0.0);
        cuts.push(1.0);
        Self::of_parts(&mut cuts, samples, most)
    }

    /// The same, for parts between `cuts`: rising shares from 0 to 1.
    fn of_parts(cuts: &mut Vec<f64>, samples: u32, most: u32) -> Self {
        join_short(cuts, LEAST_SHARE, usize::MAX);
        let pairs = (most / 2).max(2);
        join_short(cuts, 0.0, (pairs / 2) as usize);
        // Rounding may give each of several parts up to a pair more than its share.
        let parts = cuts.len() as u32 - 1;
        let room = if parts > 1 { pairs - parts } else { pairs };
        let samples = f64::from((samples / 2).min(room));
        let parts = cuts.windows(2).map(|ends| Part {
            ends: [ends[0], ends[1]],
            strata: 2 * ((samples * (ends[1] - ends[0])).round() as u32).max(1),
        });
        Self(parts.collect())
    }

    /// Are there several parts?
    pub(super) const fn has_jumps(&self) -> bool {
        self.0.len() > 1
    }

    /// The same, each divided by `factor`.
    pub(super) fn divided(&self, factor: u32) -> Self {
        Self(self.0.iter().map(|part| Part { strata: part.strata * factor, ..*part }).collect())
    }

    /// Number of strata.
    pub(super) fn count(&self) -> u32 {
        self.0.iter().map(|part| part.strata).sum()
    }

    /// A sample of each stratum, each divided by `factor`, at `place` in [0, 1]: shutter time in [0, 1], rising, and
    /// share of the exposure. The shares sum to 1.
    pub(super) fn samples(&self, shutter: &Shutter, factor: u32, place: f64) -> Vec<(f64, f64)> {
        let of_part = |part: &Part| {
            let [from, to] = part.ends;
            let n = part.strata * factor;
            let share = (to - from) / f64::from(n);
            (0..n).map(move |i| (shutter.weight.time_of(from + share * (f64::from(i) + place)), share))
        };
        self.0.iter().flat_map(of_part).collect()
    }
}

/// Removes inner cuts, the one at the end of the shortest part first, until no part is shorter than `least` and there
/// are at most `most` parts.
fn join_short(cuts: &mut Vec<f64>, least: f64, most: usize) {
    while cuts.len() > 2 {
        let length = |i: &usize| cuts[i + 1] - cuts[*i];
        let shortest = (0..cuts.len() - 1).min_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or(0);
        if length(&shortest) >= least && cuts.len() - 1 <= most {
            return;
        }
        // The shorter of its two neighbours takes it.
        let left = shortest > 0 && (shortest + 2 == cuts.len() || length(&(shortest - 1)) <= length(&(shortest + 1)));
        cuts.remove(if left { shortest } else { shortest + 1 });
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may stop")]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_parts_are_joined_first() {
        let mut cuts = vec![0.0, 0.3, 0.31, 0.9, 1.0];
        join_short(&mut cuts, 0.0, 3);
        assert_eq!(cuts, [0.0, 0.31, 0.9, 1.0]);
        join_short(&mut cuts, 0.0, 2);
        assert_eq!(cuts, [0.0, 0.31, 1.0]);
        let mut cuts = vec![0.0, 1e-9, 0.5, 1.0 - 1e-9, 1.0];
        join_short(&mut cuts, LEAST_SHARE, usize::MAX);
        assert_eq!(cuts, [0.0, 0.5, 1.0]);
    }

    /// Points of a sequence are born and die midway between its files: here in the middle of the exposure.
    #[test]
    fn births_and_deaths_part_the_exposure() {
        let mut scene = Scene::load("scenes/swarm.xml").unwrap();
        (scene.shutter.open, scene.shutter.close) = (0.0, 1.0);
        let strata = Strata::new(&scene.at_frame(2.0).unwrap(), 2.into(), 8, 256);
        let part = |from: f64, to: f64| Part { ends: [from, to], strata: 4 };
        assert_eq!(strata, Strata(vec![part(0.0, 0.5), part(0.5, 1.0)]));
    }

    /// However many jumps there are, there are no more strata than are allowed, and their shares sum to 1.
    #[test]
    fn strata_keep_to_their_number() {
        for (most, parts) in [(4, 1), (6, 1), (8, 2), (10, 2), (14, 3), (16, 4), (30, 7), (256, 40)] {
            // Parts of unequal length.
            let mut cuts: Vec<f64> = (0..=40).map(|i| (f64::from(i) / 40.0).powi(2)).collect();
            let made = Strata::of_parts(&mut cuts, 256, most);
            assert!(made.count() <= most, "{most}: {made:?}");
            assert_eq!(made.0.len(), parts, "{most}");
            let shares: f64 = made.samples(&Shutter::default(), 3, 0.5).iter().map(|(_, share)| share).sum();
            assert!((shares - 1.0).abs() < 1e-12, "{most}: {shares}");
        }
    }
}
