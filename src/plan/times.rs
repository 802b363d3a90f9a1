//! Where time samples lie within the shutter.

use crate::options::Times;
use crate::sampling::uniform;
use crate::time::Shutter;

/// `n` times t in [0, 1], rising, and their weights, which sum to 1 (docs/math.md, section 6).
///
/// `place`: where a class of pixels has its part of a stratum, from [0, 1) to [0, 1). Random times are the same for
/// equal `seed` and `frame`.
pub(super) fn moments(
    times: Times,
    n: u32,
    place: impl Fn(f64) -> f64,
    shutter: &Shutter,
    seed: u64,
    frame: f64,
) -> Vec<(f64, f64)> {
    let mut shares = match times {
        Times::Even => return shutter.strata(n, place(0.5)),
        Times::Stratified | Times::Random => uniform(n, seed, frame),
    };
    if times == Times::Stratified {
        shares.iter_mut().zip(0..n).for_each(|(share, i)| *share = (f64::from(i) + place(*share)) / f64::from(n));
    } else {
        shares.sort_unstable_by(f64::total_cmp);
    }
    shutter.times_of(&shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Weight;

    fn ramp() -> Shutter {
        Shutter { weight: Weight::Ramp { centre: 1.0 }, ..Shutter::default() }
    }

    #[test]
    fn stratified_times_have_a_share_each() {
        for (phase, stride2) in [(0.0, 1.0), (3.0, 4.0)] {
            let times = moments(Times::Stratified, 50, |within| (phase + within) / stride2, &ramp(), 9, 3.0);
            let (mut mean, mut square) = (0.0, 0.0);
            for (i, (t, weight)) in times.into_iter().enumerate() {
                assert_eq!(weight, 1.0 / 50.0);
                // a(t) = 2 t: the share before t is t^2.
                let within = (50.0 * t * t - i as f64) * stride2 - phase;
                assert!((-1e-9..1.0 + 1e-9).contains(&within), "{i}: {within}");
                mean += within / 50.0;
                square += within * within / 50.0;
            }
            // The standard errors are sqrt(1/12/50) = .041 and sqrt(4/45/50) = .042.
            assert!((mean - 0.5).abs() < 0.17 && (square - 1.0 / 3.0).abs() < 0.17, "{mean} {square}");
            assert!((square - mean * mean - 1.0 / 12.0).abs() < 0.05, "{mean} {square}");
        }
    }

    #[test]
    fn random_times_follow_the_weight() {
        let n = 10_000;
        let times = moments(Times::Random, n, |_| 0.0, &ramp(), 1, 0.0);
        assert!(times.is_sorted_by_key(|time| time.0) && times.iter().all(|time| (0.0..=1.0).contains(&time.0)));
        assert!((times.iter().map(|time| time.1).sum::<f64>() - 1.0).abs() < 1e-9);
        // E t = 2/3, E t^2 = 1/2; four standard errors.
        let mean = |power: i32| times.iter().map(|(t, weight)| weight * t.powi(power)).sum::<f64>();
        assert!((mean(1) - 2.0 / 3.0).abs() < 4.0 * 0.236 / f64::from(n).sqrt(), "{}", mean(1));
        assert!((mean(2) - 0.5).abs() < 4.0 * 0.289 / f64::from(n).sqrt(), "{}", mean(2));
    }

    #[test]
    fn frames_and_seeds_have_times_of_their_own() {
        for times in [Times::Stratified, Times::Random] {
            let of = |seed, frame| moments(times, 8, |within| within, &Shutter::default(), seed, frame);
            assert_eq!(of(1, 2.0), of(1, 2.0));
            assert_ne!(of(1, 2.0), of(1, 3.0));
            assert_ne!(of(1, 2.0), of(2, 2.0));
        }
        let even = |seed| moments(Times::Even, 8, |within| within, &Shutter::default(), seed, 0.0);
        assert_eq!(even(1), even(2));
    }
}
