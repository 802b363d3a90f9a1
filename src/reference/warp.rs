//! Shutter times in proportion to the time weight a(t): the inverse of the integral of a.
//!
//! A sample that is uniform in [0, 1) becomes a time whose density is a(t). So every sample has the same weight 1/N,
//! whatever N will be: the weights of the first k samples sum to 1 for any k, strata of the sequence are strata of
//! equal shares of the exposure, and no sample falls where a(t) is 0.

use crate::time::Weight;

/// Cells of the table that narrows the search.
const CELLS: usize = 1024;

/// Error of the integral at which the search ends.
const TOLERANCE: f64 = 1e-14;

/// The inverse of A(t) = integral of a from 0 to t.
#[derive(Clone, Debug)]
pub(super) struct TimeWarp {
    weight: Weight,
    /// A at the ends of the cells. It is empty for the box weight, whose inverse is the identity.
    table: Vec<f64>,
}

impl TimeWarp {
    pub(super) fn new(weight: &Weight) -> Self {
        let end = |k: usize| k as f64 / CELLS as f64;
        let table = match weight {
            Weight::Box => Vec::new(),
            _ => (0..=CELLS).map(|k| weight.integral(0.0, end(k))).collect(),
        };
        Self { weight: weight.clone(), table }
    }

    /// The time t in [0, 1] with A(t) = `share`, for a share in (0, 1).
    pub(super) fn time(&self, share: f64) -> f64 {
        if self.table.is_empty() {
            return share;
        }
        // The last cell that does not start beyond the share. It is never a cell where a is 0 throughout.
        let cell = self.table.partition_point(|&a| a <= share).clamp(1, CELLS) - 1;
        let mut low = (cell as f64 / CELLS as f64, self.table[cell] - share);
        let mut high = ((cell + 1) as f64 / CELLS as f64, self.table[cell + 1] - share);
        // Regula falsi with the Illinois rule: the value at an end that stays is halved, so that both ends move.
        let mut last = 0;
        for _ in 0..100 {
            let t = low.0 - low.1 * (high.0 - low.0) / (high.1 - low.1);
            let t = if t > low.0 && t < high.0 { t } else { 0.5 * (low.0 + high.0) };
            let a = self.weight.integral(0.0, t) - share;
            if a.abs() <= TOLERANCE || high.0 - low.0 <= f64::EPSILON * high.0 {
                return t;
            }
            if a < 0.0 {
                low = (t, a);
                high.1 *= if last < 0 { 0.5 } else { 1.0 };
                last = -1;
            } else {
                high = (t, a);
                low.1 *= if last > 0 { 0.5 } else { 1.0 };
                last = 1;
            }
        }
        0.5 * (low.0 + high.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverts_the_integral() {
        for weight in [
            Weight::Box,
            Weight::Tent,
            Weight::Ramp { centre: 1.0 },
            Weight::Ramp { centre: 0.3 },
            Weight::Exponential { rate: 3.0, centre: 1.0 },
            Weight::Exponential { rate: 900.0, centre: 0.0 },
            Weight::OneMinusExponential { centre: 1.0 },
            Weight::OneMinusExponential { centre: 0.4 },
            Weight::Gaussian { centre: 0.5, width: 0.2 },
            Weight::Gaussian { centre: 0.1, width: 0.003 },
            Weight::Curve(vec![(0.2, 0.0), (0.25, 3.0), (0.3, 0.0), (0.7, 0.0), (0.700_1, 1.0), (0.8, 0.0)]),
        ] {
            let warp = TimeWarp::new(&weight);
            let mut before = 0.0;
            for i in 0..4001_u32 {
                let share = (f64::from(i) + 0.3) / 4001.0;
                let t = warp.time(share);
                assert!((weight.integral(0.0, t) - share).abs() < 1e-12, "{weight:?} at {share}: {t}");
                assert!(t >= before && t <= 1.0, "{weight:?} at {share}: {t} after {before}");
                before = t;
            }
        }
    }

    #[test]
    fn times_without_weight_are_never_sampled() {
        let warp =
            TimeWarp::new(&Weight::Curve(vec![(0.2, 0.0), (0.3, 1.0), (0.4, 0.0), (0.6, 0.0), (0.7, 1.0), (0.8, 0.0)]));
        for i in 0..100_000_u32 {
            let t = warp.time((f64::from(i) + 0.5) / 1e5);
            assert!((0.2..=0.4).contains(&t) || (0.6..=0.8).contains(&t), "{t}");
        }
    }
}
