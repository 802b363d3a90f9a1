//! How large and how finely sampled pictures may be while something moves.

use std::time::Duration;

/// Time from the begin of a picture to its display that feels immediate: 25 pictures a second. A picture shows a
/// movement after one and a half such times on average, since the movement waits for the picture before.
const FLUENT: Duration = Duration::from_millis(40);
/// The longest time that still is motion: 10 pictures a second.
const LONGEST: Duration = Duration::from_millis(100);
/// Shares of the width and height of the window.
const SCALES: [f64; 5] = [1.0, 0.75, 0.5, 0.375, 0.25];
/// Most samples of a quick picture.
const MOST_SAMPLES: u32 = 64;
/// Where no size is fast enough, a smaller one must save at least this share of the time.
const SAVES: f64 = 0.25;
/// Pictures after which a time is too old to be believed.
const BELIEVED: u32 = 40;
/// Share of the old estimate in the new one.
const OLD: f64 = 0.5;
/// How much of the time of a picture does not depend on its size, where nothing is known.
const FIXED: f64 = 0.2;

/// What a quick picture is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// Number of the scale, 0 for the window's size.
    scale: usize,
    /// How many times the work of the least picture, a power of two: time samples, or twice as many where something
    /// moves.
    pub(super) samples: u32,
}

impl Level {
    /// Share of the window's width and height, in (0, 1].
    pub(super) fn scale(self) -> f64 {
        SCALES[self.scale]
    }

    /// Is it as large as the window?
    pub(super) const fn is_whole(self) -> bool {
        self.scale == 0
    }

    /// Pixels of its picture for a window of `size`.
    pub(super) fn size(self, size: [u32; 2]) -> [u32; 2] {
        size.map(|side| ((f64::from(side) * self.scale()).round() as u32).max(1))
    }
}

/// Learns from the times of pictures which level is fluent.
///
/// It takes the largest picture that is shown within 40 ms, with as many samples as fit. Where no size is so fast it
/// takes the largest that is shown within 100 ms, else the largest than which no smaller one is much faster. Small
/// pictures of scenes with many surfels take hardly less time.
#[derive(Clone, Debug, Default)]
pub(super) struct Pace {
    known: [Option<Known>; SCALES.len()],
    pictures: u32,
}

/// The seconds that are known of a scale.
#[derive(Clone, Copy, Debug)]
struct Known {
    /// Seconds to encode, send and show a picture.
    rest: f64,
    /// Seconds to render a sample.
    sample: f64,
    /// Number of the last picture that it was learnt from.
    at: u32,
}

impl Pace {
    /// The level of the next picture.
    pub(super) fn level(&self) -> Level {
        let fluent = FLUENT.as_secs_f64();
        let within = |limit: f64| (0..SCALES.len()).find(|&scale| self.seconds(scale, 1) <= limit);
        let Some(scale) = within(fluent) else {
            let fastest = (0..SCALES.len()).map(|scale| self.seconds(scale, 1)).fold(f64::INFINITY, f64::min);
            let limit = LONGEST.as_secs_f64().max(fastest / (1.0 - SAVES));
            return Level { scale: within(limit).unwrap_or(SCALES.len() - 1), samples: 1 };
        };
        let mut samples = 1;
        while scale == 0 && samples < MOST_SAMPLES && self.known[0].is_some() {
            if self.seconds(0, 2 * samples) > fluent {
                break;
            }
            samples *= 2;
        }
        Level { scale, samples }
    }

    /// A picture of `level` took `rendering`, and `rest` to be encoded, sent and shown.
    pub(super) fn learn(&mut self, level: Level, rendering: Duration, rest: Duration) {
        self.pictures += 1;
        let [rest, sample] = [rest.as_secs_f64(), rendering.as_secs_f64() / f64::from(level.samples)];
        let known = &mut self.known[level.scale];
        let old = known.map_or([rest, sample], |old| [old.rest, old.sample]);
        let [rest, sample] = [(old[0], rest), (old[1], sample)].map(|(old, new)| OLD * old + (1.0 - OLD) * new);
        *known = Some(Known { rest, sample, at: self.pictures });
        // The machine or the link may be another by now.
        for known in &mut self.known {
            *known = known.filter(|known| self.pictures - known.at < BELIEVED);
        }
    }

    /// Forgets everything: another scene or another backend.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Expected time of a picture. From the next scale that is known, in proportion to pixels; nothing is known: fast.
    fn seconds(&self, scale: usize, samples: u32) -> f64 {
        let known = self.known.iter().enumerate().filter_map(|(other, known)| Some((other, (*known)?)));
        let Some((near, known)) = known.min_by_key(|(other, _)| other.abs_diff(scale)) else { return 0.0 };
        let area = (SCALES[scale] / SCALES[near]).powi(2);
        // A smaller picture is tried before it is known that it is no faster.
        let fixed = if area > 1.0 { FIXED } else { 0.0 };
        (known.rest + known.sample * f64::from(samples)) * (fixed + (1.0 - fixed) * area)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shows `count` pictures of a scene that takes `fixed` and `area` seconds a sample, the latter times the share of
    /// pixels, and `link` seconds of transport at full size. Returns the last level and its time.
    fn settle(fixed: f64, area: f64, link: f64, count: usize) -> (Level, f64) {
        let mut pace = Pace::default();
        let mut time = 0.0;
        let mut level = pace.level();
        for _ in 0..count {
            level = pace.level();
            let share = level.scale().powi(2);
            let rendering = (fixed + area * share) * f64::from(level.samples);
            let rest = link * share;
            time = rendering + rest;
            pace.learn(level, Duration::from_secs_f64(rendering), Duration::from_secs_f64(rest));
        }
        (level, time)
    }

    #[test]
    fn a_fast_scene_gets_samples_at_full_size() {
        let (level, time) = settle(0.001, 0.004, 0.01, 10);
        assert_eq!((level.scale(), level.samples), (1.0, 4));
        assert!(time <= FLUENT.as_secs_f64(), "{time}");
    }

    #[test]
    fn a_slow_picture_gets_smaller() {
        let (level, time) = settle(0.004, 0.16, 0.02, 10);
        assert!(level.scale() < 0.5 && level.samples == 1, "{level:?}");
        assert!(time <= FLUENT.as_secs_f64(), "{time}");
    }

    #[test]
    fn a_slow_link_makes_pictures_smaller_too() {
        let (level, time) = settle(0.001, 0.004, 0.3, 10);
        assert!(level.scale() < 0.5, "{level:?}");
        assert!(time <= FLUENT.as_secs_f64(), "{time}");
    }

    #[test]
    fn where_size_does_not_help_the_largest_with_ten_pictures_a_second_is_taken() {
        let (level, time) = settle(0.07, 0.02, 0.005, 12);
        assert_eq!((level.scale(), level.samples), (1.0, 1), "{time}");
        // Hopeless: small only where that helps.
        assert_eq!(settle(0.5, 0.1, 0.01, 12).0.scale(), 1.0);
        assert_eq!(settle(0.2, 2.0, 0.01, 12).0.scale(), 0.25);
    }

    #[test]
    fn pictures_grow_again_when_the_machine_is_free() {
        let mut pace = Pace::default();
        let mut scales = Vec::new();
        for picture in 0..200 {
            let level = pace.level();
            let busy = if picture < 100 { 8.0 } else { 1.0 };
            let time = busy * 0.012 * level.scale().powi(2) * f64::from(level.samples);
            pace.learn(level, Duration::from_secs_f64(time), Duration::ZERO);
            scales.push(level.scale());
        }
        assert!(scales[90] < 1.0 && scales[199] == 1.0, "{scales:?}");
    }

    #[test]
    fn larger_pictures_are_tried_as_if_a_part_of_the_time_were_fixed() {
        // In proportion to pixels the whole would take 46 ms.
        let mut pace = Pace::default();
        pace.learn(Level { scale: 2, samples: 1 }, Duration::from_micros(11_500), Duration::ZERO);
        assert!(pace.level().is_whole(), "{:?}", pace.level());
    }

    #[test]
    fn sizes_are_whole_and_never_empty() {
        let level = Level { scale: 4, samples: 1 };
        assert_eq!(level.size([1280, 721]), [320, 180]);
        assert_eq!(level.size([1, 2]), [1, 1]);
    }
}
