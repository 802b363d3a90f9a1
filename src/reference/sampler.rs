//! Where in a pixel's square, and when in the shutter, the samples of a pixel lie. All functions are pure functions of
//! (seed, pixel, number).
//!
//! Sample i belongs to scrambling i mod 16. The scramblings are independent of each other, so the spread of their
//! sixteen means gives the standard error. Each scrambling is a stratified sequence of its own, and sample i is its
//! point i / 16.

use crate::sampling::{hash, owen_scramble, sobol3};

/// Number of independent scramblings.
pub const SCRAMBLINGS: usize = 16;

/// Most samples of a pixel. Each scrambling has 2^32 points.
pub const MOST_SAMPLES: u64 = 1 << 36;

/// The way positions and times are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampler {
    /// A three-dimensional Sobol' sequence for x, y and t together, Owen-scrambled for each pixel. Progressive.
    #[default]
    Sobol,
    /// The strategy of Wolf 2008, 4.5. Positions are a jittered grid. Times are a jittered grid with `density` times as
    /// many cells as a position takes; each position takes a random subset of them. With a density of 1 all positions
    /// take the same cells, which bands; with many the image is noisy. The number of samples is fixed beforehand.
    Jittered {
        /// Cells of the grid of times for each sample of a position, >= 1.
        density: u32,
    },
    /// Independent random numbers. Progressive.
    Random,
}

impl Sampler {
    /// True if the first k samples of a longer run are the shorter run.
    pub const fn is_progressive(self) -> bool {
        !matches!(self, Self::Jittered { .. })
    }
}

/// The points of a range of samples, as far as they do not depend on the pixel.
#[derive(Debug)]
pub(super) struct Points {
    sampler: Sampler,
    seed: u64,
    /// All samples that one scrambling will have.
    total: u64,
    /// Side of the jittered grid of positions.
    side: u64,
    /// Number of the first point of `sobol`, which holds the Sobol' points from there on. It is empty for the other
    /// samplers.
    first: u64,
    sobol: Vec<[u32; 3]>,
}

/// The samples of one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelPoints<'a> {
    points: &'a Points,
    seed: u64,
}

/// The samples of one scrambling of one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scrambled<'a> {
    points: &'a Points,
    seed: u64,
    scrambles: [u32; 3],
}

/// What the points of one sample on lights follow from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LightNumbers {
    /// Seed of its scrambling.
    seed: u64,
    /// Number of the sample in the scrambling.
    k: u32,
    /// The numbers are random ones.
    random: bool,
}

impl Points {
    /// Makes the points `first`..`end` of each scrambling, of `total` that there will be.
    pub(super) fn new(sampler: Sampler, seed: u64, first: u64, end: u64, total: u64) -> Self {
        let sobol = match sampler {
            Sampler::Sobol => (first..end).map(|k| sobol3(k as u32)).collect(),
            Sampler::Jittered { .. } | Sampler::Random => Vec::new(),
        };
        Self { sampler, seed, total, side: grid_side(total), first, sobol }
    }

    /// The points of pixel number `pixel`.
    pub(super) fn pixel(&self, pixel: u64) -> PixelPoints<'_> {
        PixelPoints { points: self, seed: pair(self.seed, pixel) }
    }
}

impl<'a> PixelPoints<'a> {
    /// The points of scrambling `r`.
    pub(super) fn scrambling(&self, r: usize) -> Scrambled<'a> {
        let seed = pair(self.seed, r as u64);
        Scrambled { points: self.points, seed, scrambles: [0, 1, 2].map(|d| hash(seed, d)) }
    }
}

impl Scrambled<'_> {
    /// Point `k`: x and y in the pixel's square, and the share of the exposure that has passed, each in (0, 1).
    #[inline]
    pub(super) fn at(&self, k: u64) -> [f64; 3] {
        match self.points.sampler {
            Sampler::Sobol => {
                let [x, y, t] = self.points.sobol[(k - self.points.first) as usize];
                let [a, b, c] = self.scrambles;
                [fraction(owen_scramble(x, a)), fraction(owen_scramble(y, b)), fraction(owen_scramble(t, c))]
            }
            Sampler::Random => [0, 1, 2].map(|d| fraction(hash(self.seed, 3 * k + d))),
            Sampler::Jittered { density } => self.jittered(k, u64::from(density)),
        }
    }

    /// What gives point `k` its points on lights.
    pub(super) fn lights(&self, k: u64) -> LightNumbers {
        LightNumbers { seed: self.seed, k: k as u32, random: self.points.sampler == Sampler::Random }
    }

    fn jittered(&self, k: u64, density: u64) -> [f64; 3] {
        let side = self.points.side;
        let times = self.points.total / (side * side);
        let (position, time) = (k / times, k % times);
        let jitter = |stream: u64, n: u64| fraction(hash(self.seed, stream << 34 | n));
        let cells = times * density;
        let key = pair(self.seed, 1 << 40 | position);
        let cell = permute(time, cells, key);
        [
            ((position % side) as f64 + jitter(1, position)) / side as f64,
            ((position / side) as f64 + jitter(2, position)) / side as f64,
            (cell as f64 + jitter(3, cell)) / cells as f64,
        ]
    }
}

impl LightNumbers {
    /// A point of the unit cube for light number `light`, each coordinate in (0, 1).
    ///
    /// They are Sobol' points, and each light has an Owen scramble of its own and an order of its own. The order is a
    /// nested uniform shuffle (Burley 2020): the first 2^m samples have some 2^m points in a row, which are a net. So
    /// the points of a light are even, and know nothing of positions, times and other lights.
    pub(super) fn at(self, light: u64) -> [f64; 3] {
        // Positions and times use lower streams.
        let seed = pair(self.seed, 1 << 45 | light);
        if self.random {
            return [0, 1, 2].map(|d| fraction(hash(seed, 3 * u64::from(self.k) + d)));
        }
        let [a, b, c] = sobol3(owen_scramble(self.k, hash(seed, 3)));
        [(a, 0), (b, 1), (c, 2)].map(|(x, d)| fraction(owen_scramble(x, hash(seed, d))))
    }

    /// A random number in (0, 1) for kernel `kernel` of volume `volume`.
    pub(super) fn of_kernel(self, volume: usize, kernel: u32) -> f64 {
        let seed = pair(self.seed, 1 << 46 | volume as u64);
        fraction(hash(pair(seed, u64::from(kernel)), u64::from(self.k)))
    }
}

/// Side of the grid of positions: among all sides whose square divides `n`, the one nearest to the cube root of `n`, by
/// ratio.
fn grid_side(n: u64) -> u64 {
    let root = libm::cbrt(n as f64);
    let off = |side: u64| (side as f64 / root).max(root / side as f64);
    // The side 1 is off by a factor of `root` at most. Sides above `root`^2 are off by more.
    let most = (root * root) as u64 + 1;
    (1..=most).filter(|p| n.is_multiple_of(p * p)).min_by(|&a, &b| off(a).total_cmp(&off(b))).unwrap_or(1)
}

/// Place of `i` in a random order of 0..n.
///
/// A Feistel network permutes the next power of 4; it is repeated until the result lies in the range. By itself this
/// prefers some places, by a tenth where n is small, so a random rotation follows.
fn permute(i: u64, n: u64, key: u64) -> u64 {
    let half = (64 - n.saturating_sub(1).leading_zeros()).div_ceil(2).max(1);
    let mask = (1_u64 << half) - 1;
    let mut x = i;
    loop {
        let (mut left, mut right) = (x >> half, x & mask);
        for round in 0..4 {
            (left, right) = (right, left ^ (u64::from(hash(key, round << 32 | right)) & mask));
        }
        x = left << half | right;
        if x < n {
            return (x + u64::from(hash(key, u64::MAX))) % n;
        }
    }
}

/// The middle of the interval of width 2^-32 that a 32-bit fraction stands for.
fn fraction(x: u32) -> f64 {
    (f64::from(x) + 0.5) / 4_294_967_296.0
}

/// A 64-bit seed for the numbers of `stream`.
fn pair(seed: u64, stream: u64) -> u64 {
    u64::from(hash(seed, 2 * stream)) << 32 | u64::from(hash(seed, 2 * stream + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(sampler: Sampler, seed: u64, pixel: u64, n: u64) -> Vec<Vec<[f64; 3]>> {
        let points = Points::new(sampler, seed, 0, n, n);
        (0..SCRAMBLINGS).map(|r| (0..n).map(|k| points.pixel(pixel).scrambling(r).at(k)).collect()).collect()
    }

    #[test]
    fn seeds_pixels_and_scramblings_differ() {
        for sampler in [Sampler::Sobol, Sampler::Random, Sampler::Jittered { density: 4 }] {
            let a = all(sampler, 1, 7, 8);
            assert_eq!(a, all(sampler, 1, 7, 8));
            assert_ne!(a, all(sampler, 2, 7, 8));
            assert_ne!(a, all(sampler, 1, 8, 8));
            assert_ne!(a[0], a[1]);
            assert!(a.iter().flatten().flatten().all(|x| *x > 0.0 && *x < 1.0));
        }
    }

    /// For each single point, take the means over many pixels of each coordinate, of its square, and of products of
    /// coordinates. They are those of independent uniform numbers.
    #[test]
    fn every_point_is_uniform_by_itself() {
        for sampler in [Sampler::Sobol, Sampler::Random, Sampler::Jittered { density: 3 }] {
            let n = 8;
            let points = Points::new(sampler, 3, 0, n, n);
            for k in 0..n {
                let mut sums = [0.0; 9];
                let pixels = 20_000;
                for pixel in 0..pixels {
                    // Jittered points are uniform over all points of a pixel, but not each by itself.
                    let k = if sampler.is_progressive() { k } else { (k + pixel) % n };
                    let [x, y, t] = points.pixel(pixel).scrambling(5).at(k);
                    for (sum, value) in sums.iter_mut().zip([x, y, t, x * x, y * y, t * t, x * y, y * t, t * x]) {
                        *sum += value / pixels as f64;
                    }
                }
                for (i, sum) in sums.into_iter().enumerate() {
                    let want = [0.5, 1.0 / 3.0, 0.25][i / 3];
                    assert!((sum - want).abs() < 0.01, "{sampler:?} point {k} moment {i}: {sum}, not {want}");
                }
            }
        }
    }

    #[test]
    fn a_range_is_a_part_of_the_whole() {
        let whole = Points::new(Sampler::Sobol, 1, 0, 64, 64);
        let part = Points::new(Sampler::Sobol, 1, 40, 64, 64);
        assert_eq!(whole.pixel(3).scrambling(2).at(50), part.pixel(3).scrambling(2).at(50));
    }

    #[test]
    fn jittered_grids_have_one_sample_in_each_cell() {
        for (n, side) in [
            (1, 1),
            (2, 1),
            (4, 2),
            (8, 2),
            (16, 2),
            (32, 4),
            (64, 4),
            (128, 4),
            (256, 8),
            (1024, 8),
            (7, 1),
            (1009, 1),
        ] {
            assert_eq!(grid_side(n), side, "{n}");
        }
        let points = &all(Sampler::Jittered { density: 1 }, 1, 0, 64)[0];
        let mut seen = [0; 64];
        for [x, y, t] in points {
            let cell = |v: f64| (v * 4.0) as usize;
            seen[(cell(*x) * 4 + cell(*y)) * 4 + cell(*t)] += 1;
        }
        assert_eq!(seen, [1; 64]);
    }

    /// Positions share the cells of the grid of times, but not the choice among them. A density of 1 leaves no choice.
    #[test]
    fn jittered_positions_choose_their_own_times() {
        let (n, density) = (64, 4);
        for (density, most) in [(1, 4), (density, 16)] {
            let points = &all(Sampler::Jittered { density }, 1, 0, n)[3];
            let times = |position: usize| -> Vec<u64> {
                let mut times: Vec<u64> = points[4 * position..][..4].iter().map(|p| p[2].to_bits()).collect();
                times.sort_unstable();
                times
            };
            let mut all: Vec<u64> = (0..16).flat_map(times).collect();
            all.sort_unstable();
            all.dedup();
            assert!(all.len() <= most && all.len() > most / 2, "{} times for density {density}", all.len());
            assert_eq!((1..16).all(|position| times(position) == times(0)), density == 1);
        }
    }

    #[test]
    fn permutations_are_permutations() {
        for n in [1, 2, 3, 16, 17, 100] {
            let mut order: Vec<u64> = (0..n).map(|i| permute(i, n, 5)).collect();
            order.sort_unstable();
            assert_eq!(order, (0..n).collect::<Vec<_>>());
        }
    }

    /// Each run of 2^m samples has one point on a light in each elementary box of the first two coordinates. Lights,
    /// pixels and scramblings have points of their own.
    #[test]
    fn points_on_lights_are_nets() {
        let points = |sampler, pixel, r, light| -> Vec<[f64; 3]> {
            let points = Points::new(sampler, 1, 0, 64, 64);
            let scrambling = points.pixel(pixel).scrambling(r);
            (0..64).map(|k| scrambling.lights(k).at(light)).collect()
        };
        for light in [0, 1, 7] {
            let of_light = points(Sampler::Sobol, 5, 3, light);
            for run in of_light.chunks(16) {
                for a in 0..=4 {
                    let mut seen = [0; 16];
                    for [x, y, _] in run {
                        let cell = |v: f64, bits: u32| (v * f64::from(1_u32 << bits)) as usize;
                        seen[cell(*x, a) << (4 - a) | cell(*y, 4 - a)] += 1;
                    }
                    assert_eq!(seen, [1; 16], "light {light}, {a}");
                }
            }
            for (pixel, r, other) in [(6, 3, light), (5, 4, light), (5, 3, light + 1)] {
                assert_ne!(of_light, points(Sampler::Sobol, pixel, r, other));
            }
            let random = points(Sampler::Random, 5, 3, light);
            assert!(random.iter().flatten().all(|v| *v > 0.0 && *v < 1.0));
            assert_ne!(of_light, random);
        }
    }
}
