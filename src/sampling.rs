//! Low-discrepancy sequences and random numbers: pure functions of (index, dimension, seed).
//!
//! Sobol' points in base 2 with Owen scrambling by hashing (Laine and Karras 2011; Burley 2020). Random numbers come
//! from PCG64 (O'Neill 2014), whose bytes are the same on every computer.

use rand::RngExt as _;
use rand_pcg::Pcg64;

/// Point `index` of the first two Sobol' dimensions, as 32-bit fractions.
///
/// Dimension 0 is the van der Corput sequence, dimension 1 the Pascal-matrix Sobol' sequence; together a (0,
/// 2)-sequence.
pub fn sobol2(index: u32) -> [u32; 2] {
    let mut second = 0;
    let mut direction = 1_u32 << 31;
    let mut bits = index;
    while bits != 0 {
        if bits & 1 == 1 {
            second ^= direction;
        }
        direction ^= direction >> 1;
        bits >>= 1;
    }
    [index.reverse_bits(), second]
}

/// Point `index` of the first three Sobol' dimensions, as 32-bit fractions: a (1, 3)-sequence, whose first two
/// dimensions are those of [`sobol2`].
pub fn sobol3(index: u32) -> [u32; 3] {
    let [first, second] = sobol2(index);
    [first, second, sobol(&THIRD, index)]
}

/// Point `index` of the dimension with these direction numbers.
fn sobol(directions: &[u32; 32], index: u32) -> u32 {
    let mut point = 0;
    let mut bits = index;
    while bits != 0 {
        point ^= directions[bits.trailing_zeros() as usize];
        bits &= bits - 1;
    }
    point
}

/// Direction numbers of the third dimension and of the two after it, from primitive polynomials (Bratley and Fox 1988)
/// and starts (Joe and Kuo 2008).
const THIRD: [u32; 32] = directions(1, [1, 3]);
const FOURTH: [u32; 32] = directions(1, [1, 3, 1]);
const FIFTH: [u32; 32] = directions(2, [1, 1, 1]);

/// Direction numbers for a polynomial of degree D, whose inner coefficients are the bits of `inner`.
const fn directions<const D: usize>(inner: u32, start: [u32; D]) -> [u32; 32] {
    let mut v = [0; 32];
    let mut i = 0;
    while i < 32 {
        if D == 0 {
            // The van der Corput sequence.
            v[i] = 1 << (31 - i);
        } else if i < D {
            v[i] = start[i] << (31 - i);
        } else {
            v[i] = v[i - D] ^ (v[i - D] >> D);
            let mut k = 1;
            while k < D {
                if inner >> (D - 1 - k) & 1 == 1 {
                    v[i] ^= v[i - k];
                }
                k += 1;
            }
        }
        i += 1;
    }
    v
}

/// Owen-scrambles a 32-bit fraction: a random permutation at every node of the binary tree, chosen by `seed`.
pub fn owen_scramble(fraction: u32, seed: u32) -> u32 {
    // Laine-Karras: each step lets a bit depend on lower bits alone, that is, on higher digits once reversed.
    let mut x = fraction.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// As many numbers in [0, 1) for sample `number`, in steps of 2^-24. Those of five neighbours are Sobol' points of one
/// sequence, shuffled and scrambled (Burley 2020): each is even over aligned blocks of samples, and so are pairs of the
/// first two. Those of two seeds are independent.
pub fn chances<const N: usize>(number: u32, seed: u32) -> [f32; N] {
    const DIMENSIONS: [[u32; 32]; 5] = [directions(0, []), directions(0, [1]), THIRD, FOURTH, FIFTH];
    std::array::from_fn(|at| {
        let (of_sequence, dimension) = (mix(seed).wrapping_add((at / 5) as u32), at % 5);
        let index = owen_scramble(number, mix(of_sequence));
        let scramble = mix(mix(!of_sequence).wrapping_add(dimension as u32));
        (owen_scramble(sobol(&DIMENSIONS[dimension], index), scramble) >> 8) as f32 / 16_777_216.0
    })
}

/// A well-mixed 32-bit hash of a seed and a stream number (the finaliser of `SplitMix64`).
pub fn hash(seed: u64, stream: u64) -> u32 {
    let mut z = seed.wrapping_add(stream.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 32) as u32
}

/// `n` random numbers, independent and uniform in [0, 1), in steps of 2^-53. `frame` gives each frame its own.
pub fn uniform(n: u32, seed: u64, frame: f64) -> Vec<f64> {
    /// The stream that the generator's authors suggest.
    const STREAM: u128 = 0x0a02_bdbf_7bb3_c0a7_ac28_fa16_a64a_bf96;
    let frame = frame.to_bits();
    // Offsets have the streams 0 and 1.
    let words = [hash(seed, 2), hash(seed, 3), hash(frame, 4), hash(frame, 5)];
    let state = words.into_iter().fold(0, |state, word| state << 32 | u128::from(word));
    Pcg64::new(state, STREAM).random_iter().take(n as usize).collect()
}

/// `n` sub-pixel offsets in [-1/2, 1/2)^2, in pixels, that go with the time samples 0..n in order.
///
/// With the time samples they form a (0, m, 3)-net for n = 2^m, so that x, y and t are stratified together. Each
/// coordinate takes each of the values (k + 1/2)/n - 1/2 once: the mean is 0, and one sample sits at the pixel's
/// centre.
pub fn pixel_offsets(n: u32, seed: u64) -> Vec<[f32; 2]> {
    let scrambled: Vec<[u32; 2]> = (0..n)
        .map(|i| {
            let p = sobol2(i);
            [owen_scramble(p[0], hash(seed, 0)), owen_scramble(p[1], hash(seed, 1))]
        })
        .collect();
    let mut offsets = vec![[0.0; 2]; n as usize];
    for dimension in 0..2 {
        let mut order: Vec<usize> = (0..n as usize).collect();
        order.sort_unstable_by_key(|&i| (scrambled[i][dimension], i));
        for (rank, &i) in order.iter().enumerate() {
            offsets[i][dimension] = ((rank as f64 + 0.5) / f64::from(n) - 0.5) as f32;
        }
    }
    offsets
}

/// Point `number` of a sequence in the unit cube, for a point on light `light`: Sobol' dimensions that places in the
/// pixel do not take, scrambled for each light. Numbers rise with time, so each pair of a time and a coordinate is
/// even, and so are those of rounds that follow each other.
pub fn light_point(number: u32, seed: u64, light: u64) -> [f64; 3] {
    let scrambled = |d: u64, directions| owen_scramble(sobol(directions, number), hash(seed, (light + 1) << 8 | d));
    [scrambled(0, &THIRD), scrambled(1, &FOURTH), scrambled(2, &FIFTH)].map(|x| (f64::from(x) + 0.5) / 4_294_967_296.0)
}

/// A number in [0, 1) for sample `number`, in steps of 2^-24: the van der Corput sequence, shuffled and scrambled
/// (Burley 2020). Those of aligned blocks of 2^m samples are even. Those of two seeds are independent.
pub fn chance(number: u32, seed: u32) -> f32 {
    let index = owen_scramble(number, mix(seed));
    let fraction = owen_scramble(index.reverse_bits(), mix(!seed));
    (fraction >> 8) as f32 / 16_777_216.0
}

/// A well-mixed 32-bit hash of a number (Wellons 2018, `lowbias32`).
pub const fn mix(number: u32) -> u32 {
    let x = (number ^ (number >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// exp(-2): what a Gaussian in two dimensions loses where it is cut at 2 standard deviations.
const CUT_OFF: f64 = 0.135_335_283_236_612_7;

/// Variance along each axis of a Gaussian of variance 1 that is cut at a distance of 2.
const CUT_VARIANCE: f64 = (1.0 - 3.0 * CUT_OFF) / (1.0 - CUT_OFF);

/// A point of a Gaussian of variance 1 about 0, cut at a distance of 2, for a point of the unit square: areas become
/// probabilities, and what is near stays near. The square's middle becomes 0.
///
/// The square becomes a disc in rings (Shirley and Chiu 1997), and a ring of the disc that of the Gaussian which has
/// the same mass within it.
pub fn gaussian_offset(point: [f64; 2]) -> [f64; 2] {
    let [a, b] = point.map(|v| 2.0 * v - 1.0);
    let (radius, angle) = match (a.abs() > b.abs(), b == 0.0) {
        (true, _) => (a, std::f64::consts::FRAC_PI_4 * (b / a)),
        (false, true) => return [0.0; 2],
        (false, false) => (b, std::f64::consts::FRAC_PI_2 - std::f64::consts::FRAC_PI_4 * (a / b)),
    };
    let distance = (-2.0 * libm::log1p(-radius * radius * (1.0 - CUT_OFF))).sqrt().copysign(radius);
    [distance * libm::cos(angle), distance * libm::sin(angle)]
}

/// `n` offsets, in pixels, of a Gaussian with standard deviation `sigma` that is cut at 2 `sigma`. They go with the
/// time samples 0..n as those of [`pixel_offsets`]. Their mean is 0, and their mean square that of the Gaussian, but
/// for n = 1: that sample sits at the pixel's centre.
pub fn gaussian_offsets(n: u32, seed: u64, sigma: f64) -> Vec<[f32; 2]> {
    let in_square = |offset: [f32; 2]| offset.map(|v| f64::from(v) + 0.5);
    let mut offsets: Vec<[f64; 2]> =
        pixel_offsets(n, seed).into_iter().map(|offset| gaussian_offset(in_square(offset))).collect();
    let count = f64::from(n.max(1));
    for axis in 0..2 {
        let mean = offsets.iter().map(|offset| offset[axis]).sum::<f64>() / count;
        for offset in &mut offsets {
            offset[axis] -= mean;
        }
    }
    let square = offsets.iter().flatten().map(|v| v * v).sum::<f64>() / count;
    let scale = if n > 1 { sigma * (2.0 * CUT_VARIANCE / square).sqrt() } else { 0.0 };
    offsets.into_iter().map(|offset| offset.map(|v| (scale * v) as f32)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every elementary box of 2^a x 2^b x 2^c cells holds exactly one of the 2^(a+b+c) points (t, x, y).
    #[test]
    fn offsets_and_times_form_a_net() {
        let m = 6;
        let n = 1_u32 << m;
        for seed in [1, 2, 77] {
            let offsets = pixel_offsets(n, seed);
            for a in 0..=m {
                for b in 0..=m - a {
                    let c = m - a - b;
                    let mut seen = vec![false; n as usize];
                    for (i, [x, y]) in offsets.iter().enumerate() {
                        let cell =
                            |v: f32, bits: u32| (((v + 0.5) * (1_u32 << bits) as f32) as usize).min((1 << bits) - 1);
                        let t = i >> (m - a);
                        let index = (((t << b) + cell(*x, b)) << c) + cell(*y, c);
                        assert!(!seen[index], "seed {seed}, box {a} {b} {c}");
                        seen[index] = true;
                    }
                }
            }
        }
    }

    /// Every aligned block of 2^m points has at most 2 in each elementary box of volume 2^-(m - 1) that a (1,
    /// 3)-sequence promises exactly 2 in, scrambled or not.
    #[test]
    fn three_dimensions_form_a_sequence() {
        for (block, seed) in [(0, None), (5, None), (3, Some(9_u64))] {
            let m = 7;
            let n = 1_u32 << m;
            let points: Vec<[u32; 3]> = (block * n..(block + 1) * n)
                .map(|i| {
                    let p = sobol3(i);
                    std::array::from_fn(|d| seed.map_or(p[d], |s| owen_scramble(p[d], hash(s, d as u64))))
                })
                .collect();
            for a in 0..m {
                for b in 0..m - a {
                    let c = m - 1 - a - b;
                    let mut seen = vec![0; n as usize / 2];
                    for p in &points {
                        let cell = |v: u32, bits: u32| (u64::from(v) >> (32 - bits)) as usize;
                        seen[(cell(p[0], a) << b | cell(p[1], b)) << c | cell(p[2], c)] += 1;
                    }
                    assert!(seen.iter().all(|&count| count == 2), "block {block}, box {a} {b} {c}");
                }
            }
        }
    }

    #[test]
    fn offsets_are_centred() {
        assert_eq!(pixel_offsets(1, 5), [[0.0, 0.0]]);
        for n in [2, 3, 7, 16, 100, 1024] {
            let offsets = pixel_offsets(n, 1);
            for d in 0..2 {
                let mean = offsets.iter().map(|o| f64::from(o[d])).sum::<f64>() / f64::from(n);
                assert!(mean.abs() < 1e-7, "n {n}: mean {mean}");
                assert!(offsets.iter().all(|o| (-0.5..0.5).contains(&o[d])));
            }
        }
    }

    /// The bits that every computer and every version must make; from PCG64 written out in another language.
    #[test]
    fn random_numbers_stay_the_same() {
        let bits = |seed, frame| uniform(2, seed, frame).into_iter().map(f64::to_bits).collect::<Vec<_>>();
        assert_eq!(bits(1, 0.0), [0x3fce_bdba_23e9_f3b4, 0x3fe8_e0e9_b184_9bc5]);
        assert_eq!(bits(77, 1.5), [0x3fe7_1416_35e4_da5d, 0x3fec_fcf2_a727_f503]);
        assert_ne!(bits(1, 0.0), bits(2, 0.0));
        assert_ne!(bits(1, 0.0), bits(1, 1.0));
    }

    /// 2^16 numbers in 256 cells, alone and in pairs of neighbours: chi^2 within 6 standard deviations of its mean.
    #[test]
    fn random_numbers_are_uniform_and_independent() {
        for (seed, frame) in [(1, 0.0), (2, 0.0), (1, 1.0), (1, 2.0), (u64::MAX, -1.5)] {
            let numbers = uniform(1 << 16, seed, frame);
            assert!(numbers.iter().all(|v| (0.0..1.0).contains(v)));
            let cell = |v: f64, cells: f64| (v * cells) as usize;
            let (mut single, mut pairs) = ([0.0_f64; 256], [0.0_f64; 256]);
            for pair in numbers.chunks(2) {
                single[cell(pair[0], 256.0)] += 1.0;
                single[cell(pair[1], 256.0)] += 1.0;
                pairs[16 * cell(pair[0], 16.0) + cell(pair[1], 16.0)] += 1.0;
            }
            for (counts, mean) in [(single, 256.0), (pairs, 128.0)] {
                let chi2: f64 = counts.iter().map(|count| (count - mean) * (count - mean) / mean).sum();
                assert!((chi2 - 255.0).abs() < 6.0 * 510.0_f64.sqrt(), "seed {seed}, frame {frame}: {chi2}");
            }
        }
    }

    #[test]
    fn seeds_matter() {
        assert_ne!(pixel_offsets(16, 1), pixel_offsets(16, 2));
        assert_eq!(pixel_offsets(16, 1), pixel_offsets(16, 1));
    }

    /// Blocks of 2^m numbers of a seed are even, and those of two seeds are independent: the share of both below their
    /// limits is the product, within four standard errors of as many random numbers.
    #[test]
    fn chances_are_even_and_independent() {
        for seed in 0..50 {
            for (first, count) in [(0, 16), (32, 32), (256, 256)] {
                let mut seen = vec![false; count];
                for number in first..first + count as u32 {
                    let cell = (chance(number, seed) * count as f32) as usize;
                    assert!(!seen[cell], "seed {seed}, number {number}");
                    seen[cell] = true;
                }
            }
        }
        let mut squares = 0.0;
        for seed in 0..400 {
            let below = |number: &u32| chance(*number, 2 * seed) < 0.7 && chance(*number, 2 * seed + 1) < 0.3;
            let share = (0..256).filter(below).count() as f64 / 256.0;
            let deviation = (share - 0.21) / (0.21 * 0.79 / 256.0_f64).sqrt();
            assert!(deviation.abs() < 4.0, "seed {seed}: {share}");
            squares += deviation * deviation;
        }
        // Evenness makes them vary less than random numbers.
        assert!(squares < 400.0, "{squares}");
    }

    /// Each of several chances is even, and the share of samples with two of them below limits is the product: nearer
    /// than a twentieth of a standard error of random numbers for the first two, and within four for all.
    #[test]
    fn several_chances_are_even_together() {
        for seed in 0..100 {
            let all: Vec<[f32; 8]> = (0..256).map(|number| chances(number, seed)).collect();
            for at in 0..8 {
                let mut seen = [false; 256];
                for chances in &all {
                    seen[(chances[at] * 256.0) as usize] = true;
                }
                assert!(seen.iter().all(|&seen| seen), "seed {seed}, {at}");
            }
            for [first, second] in [[0, 1], [0, 2], [1, 4], [2, 6], [5, 6]] {
                let below = |chances: &&[f32; 8]| chances[first] < 0.5 && chances[second] < 0.5;
                let share = all.iter().filter(below).count() as f64 / 256.0;
                let error = (0.25 * 0.75 / 256.0_f64).sqrt();
                let limit = if first == 0 && second == 1 { 0.05 * error } else { 4.0 * error };
                assert!((share - 0.25).abs() < limit, "seed {seed}, {first} and {second}: {share}");
            }
        }
    }

    /// Areas of the unit square become masses of the Gaussian: its density times the map's determinant is 1. The
    /// square's border becomes the circle at 2.
    #[test]
    fn the_square_becomes_a_gaussian() {
        for i in 0..1000 {
            let [u, v] = sobol2(2 * i + 1).map(|x| 0.01 + 0.98 * (f64::from(x) / 4_294_967_296.0));
            // The map has edges along the diagonals.
            if ((u - 0.5).abs() - (v - 0.5).abs()).abs() < 1e-3 {
                continue;
            }
            let step = 1e-6;
            let across = |du: f64, dv: f64| {
                let [a, b] = [gaussian_offset([u + du, v + dv]), gaussian_offset([u - du, v - dv])];
                [0, 1].map(|axis| (a[axis] - b[axis]) / (2.0 * step))
            };
            let (by_u, by_v) = (across(step, 0.0), across(0.0, step));
            let area = (by_u[0] * by_v[1] - by_u[1] * by_v[0]).abs();
            let [x, y] = gaussian_offset([u, v]);
            let density = (-0.5 * (x * x + y * y)).exp() / (std::f64::consts::TAU * (1.0 - (-2.0_f64).exp()));
            assert!((density * area - 1.0).abs() < 1e-5, "({u}, {v}): {}", density * area);
        }
        for border in [[0.0, 0.3], [1.0, 0.9], [0.2, 0.0], [0.6, 1.0], [0.0, 0.0]] {
            let [x, y] = gaussian_offset(border);
            assert!((x.hypot(y) - 2.0).abs() < 1e-9, "{border:?}");
        }
        assert_eq!(gaussian_offset([0.5, 0.5]), [0.0; 2]);
    }

    /// Means and mean squares are those of the Gaussian with few offsets, too; variances of both axes agree with many.
    #[test]
    fn few_gaussian_offsets_have_its_moments() {
        assert_eq!(gaussian_offsets(1, 7, 2.0), [[0.0; 2]]);
        for (n, sigma) in [(2_u32, 1.0), (3, 0.25), (4, 1.0), (16, 0.5), (17, 4.0), (256, 1.0)] {
            let offsets = gaussian_offsets(n, 3, sigma);
            let mean = |f: &dyn Fn(&[f32; 2]) -> f64| offsets.iter().map(f).sum::<f64>() / f64::from(n) / sigma;
            // The integral of r^3 exp(-r^2 / 2) over that of r exp(-r^2 / 2), from 0 to 2.
            let square = (2.0 - 6.0 * (-2.0_f64).exp()) / (1.0 - (-2.0_f64).exp());
            assert!(mean(&|o| o[0].into()).abs() < 1e-6 && mean(&|o| o[1].into()).abs() < 1e-6, "{n}");
            let [x, y] = [0, 1].map(|axis| mean(&|o| f64::from(o[axis]).powi(2)) / sigma);
            assert!((x + y - square).abs() < 1e-5, "{n}: {}", x + y);
            assert!(n < 16 || (x - y).abs() < 0.1, "{n}: {x}, {y}");
        }
    }
}
