//! Error of an image, estimated from the difference of its half buffers (docs/math.md, section 9).
//!
//! E and O are the means of both halves of the samples, and g the slope of the display's curve. In a block, the
//! *half difference* is the mean of |g (E - O) / 2|^2. Were the samples random, it would be the variance of the image.
//! Strata make the image better than that, by a factor that was measured (docs/measurements/auto.md).

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::half_buffers::HalfBuffers;
use crate::film::{Backdrop, Background, Picture, over};
use crate::frame::Panorama;
use crate::math::{fast, srgb};
use crate::options::{Interleave, PixelFilter};

/// Error of the image over the root of the half difference, which no more than one scene in twenty exceeds.
const GAIN: f64 = 0.92;
/// The same with a lattice, whose classes sample their strata off the middles.
const GAIN_OF_LATTICE: f64 = 1.08;
/// The same where strata are long.
const GAIN_OF_LONG_STRATA: f64 = 1.02;
/// The same where strata are so short that sub-pixel positions decide, whose error is more like that of random ones.
const GAIN_OF_SHORT_STRATA: f64 = 0.98;
/// The same where nothing moves, and each sample is seen from a position of its own.
const GAIN_OF_REST: f64 = 1.05;
/// The same at pixel centres, where there are no such positions.
const GAIN_OF_CENTRES: f64 = 0.62;
/// Factor on these for each round that refined a block: what made it need more samples makes its error fall more slowly
/// too.
const REFINED: f64 = 1.08;
/// Longest path of a surfel within a stratum where nothing moves, pixels.
const REST: f64 = 0.03;
/// The same within a short stratum.
const SHORT_STRATA: f64 = 2.0;
/// The same within a stratum that is not long.
const FINE_STRATA: f64 = 4.5;
/// FLIP of the image over that of the half difference, in the median of scenes: .74 where only rows and columns were
/// looked at, and less by what eight directions find more in noise (docs/measurements/scenes.md).
const SEEN_GAIN: f64 = 0.65;
/// The same with a lattice, which the eye blurs, and where something moves and strata are so short that the mean is far
/// better than either half.
const SEEN_GAIN_OF_FINE_STRATA: f64 = 0.37;
/// Exponent by which a person judges a difference of colours (`compare::flip`: Andersson et al. 2020).
const SEEN: f32 = 0.7;
/// FLIP of a grey difference d of display values is about this times d^0.7, where d is small: 0.95 (100 d)^0.7 over
/// 16.5, the distance 100 d of lightness beside 0.4 of the greatest distance, both to the power 0.7.
const SEEN_SCALE: f64 = 1.45;
/// Weight of the worst part of a block beside the whole block, for what is seen.
const WORST_PART: f64 = 0.25;
/// Pixels from the border of a block within which what differs may go on beyond it.
const BORDER: usize = 3;
/// Width of the part of a block, pixels, that is a sliver.
const SLIVER: usize = 8;
/// Parts of a block along each axis. The eye sees a small place.
const PARTS: usize = 2;

/// The sums that are measured in one block of the image.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BlockError {
    /// Half difference: mean over pixels and channels.
    half: f64,
    /// What differs more where each half is over its own part of what is behind. No finer round changes that.
    behind: f64,
    /// What shows of g (E - O) / 2 ([`stripes`]), after what the eye blurs: the mean over the parts, and a share of the
    /// worst of them; times the gain.
    seen: f64,
    pixels: u32,
    /// Error of the image over the root of the half difference.
    gain: f64,
    /// Does anything differ near the left, right, upper, lower border?
    reaches: [bool; 4],
    /// Does nothing differ but near that border?
    sliver: [bool; 4],
}

impl BlockError {
    /// The same block at another exposure: what is worse counts.
    fn worse(self, other: Self) -> Self {
        Self {
            half: self.half.max(other.half),
            behind: self.behind.max(other.behind),
            seen: self.seen.max(other.seen),
            reaches: [0, 1, 2, 3].map(|side: usize| self.reaches[side] || other.reaches[side]),
            sliver: [0, 1, 2, 3].map(|side: usize| self.sliver[side] && other.sliver[side]),
            ..self
        }
    }

    /// Estimated error: root mean square of display values. It leaves out the error of what is behind.
    pub(super) fn error(&self) -> f64 {
        self.gain * self.half.sqrt()
    }

    /// The same with what is behind.
    pub(super) fn stated(&self) -> f64 {
        self.gain * (self.half + self.behind).sqrt()
    }

    /// Estimated FLIP.
    fn flip(&self) -> f64 {
        SEEN_SCALE * self.seen
    }

    /// How many times the samples bring the error to `error` and FLIP to `flip`: the error of edges falls with their
    /// number.
    pub(super) fn needed(&self, error: f64, flip: f64) -> f64 {
        let by_flip = (self.flip() / flip).powf(1.0 / f64::from(SEEN));
        (self.error() / error).max(by_flip)
    }
}

/// The light behind the film.
pub(super) struct Behind {
    /// Over the whole exposure.
    pub all: Backdrop,
    /// Over each half of the times at which a camera in motion sees it; `None` where it stays the same.
    pub halves: Option<[Backdrop; 2]>,
}

impl Behind {
    pub(super) fn new(background: Background, panorama: Option<&Panorama>) -> Self {
        let over = |picture: Vec<[f32; 3]>| Backdrop { background, picture: Some(picture) };
        let Some(panorama) = panorama else { return Self { all: Backdrop::plain(background), halves: None } };
        let Some([even, odd]) = panorama.halves() else {
            return Self { all: over(panorama.picture()), halves: None };
        };
        let mean = even.iter().zip(&odd).map(|(a, b)| [0, 1, 2].map(|c| 0.5 * (a[c] + b[c]))).collect();
        Self { all: over(mean), halves: Some([over(even), over(odd)]) }
    }
}

/// Errors of an image, by blocks.
pub(super) struct Errors {
    /// Blocks in a row.
    pub width: usize,
    /// Row by row.
    pub blocks: Vec<BlockError>,
    /// Pixels along the edge of a block.
    pub edge: usize,
    pub behind: Behind,
    /// Gain of blocks that were not refined.
    gain: f64,
    seen_gain: f64,
    /// Exposures, as factors on light, at which the halves are compared.
    exposures: Vec<f32>,
}

impl Errors {
    /// Nothing measured yet. `edge`: pixels along the edge of a block. `step`: longest path of a surfel between two
    /// time samples, pixels. `white`: the brightest light that is compared.
    pub(super) fn new(
        [width, height]: [u32; 2],
        edge: usize,
        behind: Behind,
        interleave: Interleave,
        step: f64,
        filter: PixelFilter,
        white: f64,
    ) -> Self {
        let is_fine = interleave != Interleave::None || (REST..FINE_STRATA).contains(&step);
        let seen_gain = if is_fine { SEEN_GAIN_OF_FINE_STRATA } else { SEEN_GAIN };
        let [width, height] = [width, height].map(|pixels| (pixels as usize).div_ceil(edge));
        let gain = match (interleave, step, filter) {
            (Interleave::None, ..SHORT_STRATA, PixelFilter::Point) => GAIN_OF_CENTRES,
            (Interleave::None, ..REST, _) => GAIN_OF_REST,
            (Interleave::None, ..SHORT_STRATA, _) => GAIN_OF_SHORT_STRATA,
            (Interleave::None, ..FINE_STRATA, _) => GAIN,
            (Interleave::None, ..) => GAIN_OF_LONG_STRATA,
            _ => GAIN_OF_LATTICE,
        };
        let blocks = vec![BlockError::default(); width * height];
        let mut exposures = vec![1.0, (1.0 / white) as f32];
        exposures.dedup();
        Self { width, blocks, edge, behind, gain, seen_gain, exposures }
    }

    /// The blocks that touch block `i`, and itself.
    pub(super) fn around(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let (x, y, width) = (i % self.width, i / self.width, self.width);
        let rows = y.saturating_sub(1)..(y + 2).min(self.blocks.len() / width);
        rows.flat_map(move |v| (x.saturating_sub(1)..(x + 2).min(width)).map(move |u| v * width + u))
    }

    /// The blocks beside block `i` in which something differs near their common border, where nothing else differs in
    /// block `i`: the mean over a block dilutes a sliver, which would stay as it is beside what is refined.
    pub(super) fn reaching(&self, i: usize) -> impl Iterator<Item = usize> {
        let (x, y, width) = (i % self.width, i / self.width, self.width);
        let height = self.blocks.len() / width;
        let beside = [
            (x + 1 < width, i + 1),
            (x > 0, i.wrapping_sub(1)),
            (y + 1 < height, i + width),
            (y > 0, i.wrapping_sub(width)),
        ];
        // The right border of one block is the left one of the next.
        let sliver = self.blocks[i].sliver;
        let reaching = beside
            .into_iter()
            .zip(0..)
            .filter(move |((is_there, j), side)| *is_there && sliver[side ^ 1] && self.blocks[*j].reaches[*side]);
        reaching.map(|((_, j), _)| j)
    }

    /// Root of the estimated mean square error over the image.
    pub(super) fn root_mean(&self) -> f64 {
        let pixels: f64 = self.blocks.iter().map(|block| f64::from(block.pixels)).sum();
        let sum: f64 = self.blocks.iter().map(|block| block.stated().powi(2) * f64::from(block.pixels)).sum();
        if pixels > 0.0 { (sum / pixels).sqrt() } else { 0.0 }
    }

    /// Measures half buffers after the first round. Of several exposures the worst counts.
    pub(super) fn measure(&mut self, buffers: &HalfBuffers) {
        let [even, odd] = buffers.pictures();
        let width = even.width as usize;
        for (n, exposure) in self.exposures.clone().into_iter().enumerate() {
            let difference = differences([even, odd], [&self.behind.all; 2], self.edge, exposure, |_| true);
            let halves = block_sums(width, self.edge, &difference, |d| f64::from(d.length_squared()));
            let seen = self.seen(&difference, width);
            let borders: Vec<[[bool; 4]; 2]> = (0..self.blocks.len())
                .into_par_iter()
                .map(|i| borders(&difference, width, self.edge, i, self.width))
                .collect();
            let over_own = self.behind.halves.as_ref().map(|[a, b]| {
                let difference = differences([even, odd], [a, b], self.edge, exposure, |_| true);
                block_sums(width, self.edge, &difference, |d| f64::from(d.length_squared()))
            });
            let of_block = halves.into_iter().zip(seen).zip(borders).enumerate();
            for (i, (((sum, pixels), seen), [reaches, sliver])) in of_block {
                let half = sum / divisor(pixels);
                let behind = over_own.as_ref().map_or(0.0, |own| (own[i].0 - sum).max(0.0) / divisor(pixels));
                let measured = BlockError { half, behind, seen, pixels, gain: self.gain, reaches, sliver };
                self.blocks[i] = if n == 0 { measured } else { self.blocks[i].worse(measured) };
            }
        }
    }

    /// Measures again the blocks that a finer round added samples to: those with `finer` above 1. From now on the
    /// error alone decides, and not what is seen.
    pub(super) fn measure_again(&mut self, buffers: &HalfBuffers, finer: &[u32]) {
        let [even, odd] = buffers.pictures();
        let is_fresh = |block: usize| finer[block] > 1;
        for (n, exposure) in self.exposures.clone().into_iter().enumerate() {
            let difference = differences([even, odd], [&self.behind.all; 2], self.edge, exposure, is_fresh);
            let halves = block_sums(even.width as usize, self.edge, &difference, |d| f64::from(d.length_squared()));
            for (i, (half, pixels)) in halves.into_iter().enumerate().filter(|(i, _)| is_fresh(*i)) {
                let before = if n == 0 { 0.0 } else { self.blocks[i].half };
                self.blocks[i].half = before.max(half / divisor(pixels));
            }
        }
        self.blocks.iter_mut().zip(finer).filter(|(_, finer)| **finer > 1).for_each(|(block, _)| block.gain *= REFINED);
    }

    /// [`BlockError::seen`] of each block, from the difference of the half buffers.
    fn seen(&self, difference: &[Vec3], width: usize) -> Vec<f64> {
        let edge = self.edge / PARTS;
        let columns = width.div_ceil(edge);
        let mut means = vec![0.0_f64; self.blocks.len()];
        let mut worst = vec![0.0_f64; self.blocks.len()];
        for (i, of_part) in stripes(&blurred(difference, width), width, edge).into_iter().enumerate() {
            let block = i / columns / PARTS * self.width + i % columns / PARTS;
            means[block] += of_part / (PARTS * PARTS) as f64;
            worst[block] = worst[block].max(of_part);
        }
        means.iter().zip(&worst).map(|(mean, worst)| self.seen_gain * (mean + WORST_PART * worst)).collect()
    }
}

/// Does anything differ within [`BORDER`] pixels of the left, right, upper, lower border of block `i` of `edge` pixels?
/// And does nothing differ beyond [`SLIVER`] pixels of it?
fn borders(difference: &[Vec3], width: usize, edge: usize, i: usize, columns: usize) -> [[bool; 4]; 2] {
    let height = difference.len() / width.max(1);
    let [left, top] = [i % columns * edge, i / columns * edge];
    let [right, bottom] = [(left + edge).min(width), (top + edge).min(height)];
    let any = |xs: Range<usize>, ys: Range<usize>| {
        !xs.is_empty() && ys.into_iter().any(|y| difference[y * width..][xs.clone()].iter().any(|d| *d != Vec3::ZERO))
    };
    let near = [
        any(left..(left + BORDER).min(right), top..bottom),
        any(right.saturating_sub(BORDER).max(left)..right, top..bottom),
        any(left..right, top..(top + BORDER).min(bottom)),
        any(left..right, bottom.saturating_sub(BORDER).max(top)..bottom),
    ];
    let beyond = [
        any(left + SLIVER..right, top..bottom),
        any(left..right.saturating_sub(SLIVER), top..bottom),
        any(left..right, top + SLIVER..bottom),
        any(left..right, top..bottom.saturating_sub(SLIVER)),
    ];
    [near, beyond.map(|differs| !differs)]
}

/// What shows of the half difference in each part of `edge` pixels, row by row: |d|^0.7, d the mean over a line of the
/// part, and the mean of that over its pixels, for the lines of the direction in which that is most. Stripes, ghosts
/// and steps stay; noise cancels.
fn stripes(difference: &[Vec3], width: usize, edge: usize) -> Vec<f64> {
    let of_band = |band: &[Vec3]| -> Vec<f64> {
        let mut lines = vec![(Vec3::ZERO, 0); 2 * edge];
        let mut of_part = |left: usize| {
            let rows = band.chunks(width).map(|row| &row[left..(left + edge).min(width)]);
            if rows.clone().flatten().all(|d| *d == Vec3::ZERO) {
                return 0.0;
            }
            let along = |&([p, q], from_below): &([usize; 2], bool)| {
                lines.fill((Vec3::ZERO, 0));
                for (y, row) in rows.clone().enumerate() {
                    let first = q * if from_below { edge - 1 - y } else { y };
                    for (x, d) in row.iter().enumerate() {
                        let (sum, pixels) = &mut lines[usize::midpoint(first, p * x)];
                        (*sum, *pixels) = (*sum + *d, *pixels + 1);
                    }
                }
                let shown = |&(sum, pixels): &(Vec3, i32)| match pixels {
                    0 => 0.0,
                    _ => f64::from(pixels) * seen_of(sum * (0.5 / pixels as f32)),
                };
                lines.iter().map(shown).sum::<f64>()
            };
            // A sliver at the image's border counts by its share of a part.
            DIRECTIONS.iter().map(along).fold(0.0, f64::max) / edge.pow(2) as f64
        };
        (0..width).step_by(edge).map(&mut of_part).collect()
    };
    difference.par_chunks(width * edge).map(of_band).collect::<Vec<_>>().concat()
}

/// Lines in eight directions, 18 to 27 degrees apart, so that a stripe runs along one of them, or nearly: pixel x, y
/// lies on line (p x + q y) / 2. `true`: y counts from below.
const DIRECTIONS: [([usize; 2], bool); 8] = [
    ([2, 0], false),
    ([0, 2], false),
    ([2, 2], false),
    ([2, 2], true),
    ([2, 1], false),
    ([1, 2], false),
    ([2, 1], true),
    ([1, 2], true),
];

/// Mean over the channels of |d|^0.7.
fn seen_of(d: Vec3) -> f64 {
    let [r, g, b] = d.to_array().map(|v| if v == 0.0 { 0.0 } else { fast::pow(v.abs(), SEEN) });
    f64::from(r + g + b) / 3.0
}

/// The sum of `value` over each block of `edge` pixels, and its pixels, row by row.
fn block_sums(width: usize, edge: usize, of: &[Vec3], value: impl Fn(Vec3) -> f64 + Sync) -> Vec<(f64, u32)> {
    let of_row =
        |row: &[Vec3]| -> Vec<f64> { row.chunks(edge).map(|block| block.iter().map(|&d| value(d)).sum()).collect() };
    let rows: Vec<Vec<f64>> = of.par_chunks(width).map(of_row).collect();
    let bands = rows.chunks(edge).flat_map(|band| {
        (0..width.div_ceil(edge)).map(|block| {
            let columns = (width - block * edge).min(edge);
            (band.iter().map(|row| row[block]).sum(), (columns * band.len()) as u32)
        })
    });
    bands.collect()
}

/// Divisor of a sum of squared differences: three channels a pixel, and four, since half the difference counts.
fn divisor(pixels: u32) -> f64 {
    4.0 * 3.0 * f64::from(pixels.max(1))
}

/// Difference of the display values of each pixel in the wanted blocks of `edge` pixels; 0 in the others. `exposure`: a
/// factor on light.
fn differences(
    [a, b]: [&Picture; 2],
    backdrops: [&Backdrop; 2],
    edge: usize,
    exposure: f32,
    wanted: impl Fn(usize) -> bool + Sync,
) -> Vec<Vec3> {
    let width = a.width as usize;
    let mut out = zeros(a.rgba.len());
    let same = std::ptr::eq(backdrops[0], backdrops[1]);
    let rows = out.par_chunks_mut(width).zip(a.rgba.par_chunks(width)).zip(b.rgba.par_chunks(width)).enumerate();
    rows.for_each(|(y, ((out, a), b))| {
        let parts = out.chunks_mut(edge).zip(a.chunks(edge)).zip(b.chunks(edge)).enumerate();
        for (column, ((out, a), b)) in parts {
            // Most of a static background is equal.
            if !wanted(y / edge * width.div_ceil(edge) + column) || same && a == b {
                continue;
            }
            let first = y * width + column * edge;
            let [a, b] =
                [(a, backdrops[0]), (b, backdrops[1])].map(|(part, behind)| shown(part, first, behind, exposure));
            for ((out, a), b) in out.iter_mut().zip(a.chunks_exact(3)).zip(b.chunks_exact(3)) {
                *out = Vec3::from_slice(a) - Vec3::from_slice(b);
            }
        }
    });
    out
}

/// Memory that the system cleared: what stays as it is costs nothing.
fn zeros(count: usize) -> Vec<Vec3> {
    bytemuck::cast_vec(vec![[0.0_f32; 3]; count])
}

/// What the eye blurs: a binomial of five taps, near the contrast sensitivity of luminance at 67 pixels a degree.
fn blurred(values: &[Vec3], width: usize) -> Vec<Vec3> {
    const TAPS: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
    // Rows without a difference stay as they are made: 0.
    let mut along = zeros(values.len());
    let rows = along.par_chunks_mut(width).zip(values.par_chunks(width));
    let differs: Vec<bool> = rows
        .map(|(out, row)| {
            let differs = row.iter().any(|&value| value != Vec3::ZERO);
            if differs {
                // Pixels beyond the border are those at the border.
                let padded: Vec<Vec3> = [&[row[0]; 2], row, &[row[width - 1]; 2]].concat();
                for (out, taps) in out.iter_mut().zip(padded.windows(5)) {
                    *out = taps.iter().zip(TAPS).map(|(&value, tap)| tap * value).sum();
                }
            }
            differs
        })
        .collect();
    let mut across = zeros(values.len());
    across.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let rows = [0, 1, 2, 3, 4].map(|i| (y + i).saturating_sub(2).min(differs.len() - 1));
        if rows.iter().any(|&row| differs[row]) {
            let [a, b, c, d, e] = rows.map(|row| &along[row * width..][..width]);
            let [p, q, r, ..] = TAPS;
            for (x, out) in out.iter_mut().enumerate() {
                *out = p * (a[x] + e[x]) + q * (b[x] + d[x]) + r * c[x];
            }
        }
    });
    across
}

/// Display values, three a pixel, of a part of a row over the background. `first`: number of its first pixel.
fn shown(row: &[[f32; 4]], first: usize, backdrop: &Backdrop, exposure: f32) -> Vec<f32> {
    let colours = row
        .iter()
        .zip(first..)
        .flat_map(|(&[r, g, b, alpha], at)| over([r, g, b], 1.0 - alpha, backdrop.at(at).as_vec3().to_array()));
    let mut values: Vec<f32> = colours.map(|light| exposure * light).collect();
    srgb::encode_nearly(&mut values);
    values
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::film::Background;

    /// What stripes are worth in the one part of a picture of 16 x 16 pixels.
    fn of(difference: impl Fn(usize, usize) -> f32) -> f64 {
        let pixels: Vec<Vec3> = (0..256).map(|at| Vec3::splat(difference(at % 16, at / 16))).collect();
        let parts = stripes(&pixels, 16, 16);
        assert_eq!(parts.len(), 1);
        parts[0]
    }

    #[test]
    fn stripes_count_in_full_and_noise_cancels() {
        let sign = |odd: usize| if odd.is_multiple_of(2) { 0.2 } else { -0.2 };
        let seen = 0.1_f64.powf(f64::from(SEEN));
        for striped in [of(|x, _| sign(x)), of(|_, y| sign(y)), of(|x, _| sign(x / 4)), of(|x, y| sign(x + y))] {
            assert!((striped / seen - 1.0).abs() < 1e-4, "{striped}, not {seen}");
        }
        assert!((of(|_, _| 0.2) / seen - 1.0).abs() < 1e-4);
        // A stripe through half the columns is worth half.
        let half = of(|x, _| if x < 8 { sign(x) } else { 0.0 });
        assert!((half / seen - 0.5).abs() < 1e-4, "{half}");
    }

    /// Waves of any direction and of several lengths, with their mean over pixels: rows and columns alone would leave
    /// .14 of some.
    #[test]
    fn oblique_stripes_count() {
        for length in [6.0_f32, 8.0, 12.0] {
            for step in 0..24 {
                let (sin, cos) = (step as f32 * 7.5_f32).to_radians().sin_cos();
                let wave = |x: usize, y: usize| {
                    0.2 * (std::f32::consts::TAU * (x as f32 * cos + y as f32 * sin) / length + 0.3).sin()
                };
                let pixels = (0..256).map(|at| seen_of(Vec3::splat(0.5 * wave(at % 16, at / 16))));
                let share = of(wave) / (pixels.sum::<f64>() / 256.0);
                assert!(share > 0.68, "length {length}, {} degrees: {share}", step as f32 * 7.5);
            }
        }
        // Noise without a direction cancels.
        let noise = crate::sampling::uniform(256, 7, 0.0);
        let noise: Vec<f32> = noise.into_iter().map(|v| if v < 0.5 { 0.2 } else { -0.2 }).collect();
        let left = of(|x, y| noise[16 * y + x]) / 0.1_f64.powf(f64::from(SEEN));
        assert!(left < 0.42, "{left}");
    }

    /// A block of 16 pixels is reached at the borders near which something differs, and what is farther from a border
    /// is no sliver there.
    #[test]
    fn what_differs_near_a_border_reaches_it() {
        let of = |x: usize, y: usize, i: usize| {
            let mut pixels = vec![Vec3::ZERO; 40 * 32];
            pixels[y * 40 + x] = Vec3::splat(0.1);
            borders(&pixels, 40, 16, i, 3)
        };
        let reached = |x: usize, y: usize, i: usize| of(x, y, i)[0];
        assert_eq!(of(16, 7, 1)[1], [true, false, true, false]);
        assert_eq!(of(31, 8, 1)[1], [false, true, false, true]);
        assert_eq!(of(0, 0, 1)[1], [true; 4], "nothing differs");
        assert_eq!(of(39, 24, 5)[1], [true, true, false, true], "a narrow block");
        assert_eq!(reached(16, 8, 1), [true, false, false, false]);
        assert_eq!(reached(29, 8, 1), [false, true, false, false]);
        assert_eq!(reached(24, 2, 1), [false, false, true, false]);
        assert_eq!(reached(31, 31, 4), [false, true, false, true]);
        assert_eq!(reached(24, 8, 1), [false; 4]);
        // The last block of a row is narrower.
        assert_eq!(reached(38, 8, 2), [false, true, false, false]);
        assert_eq!(reached(16, 8, 0), [false; 4]);
    }

    /// A sliver takes part in what is done to the block beyond the border that it lies at, and in nothing else.
    #[test]
    fn slivers_go_with_the_block_beside_them() {
        let background = Background { colour: DVec3::ZERO, transparent: false };
        let behind = Behind::new(background, None);
        let size = [96, 32];
        let mut errors = Errors::new(size, 32, behind, Interleave::None, 3.0, PixelFilter::Box, 1.0);
        errors.blocks[0].reaches = [true; 4];
        errors.blocks[2].reaches = [true; 4];
        for (sliver, wanted) in [
            ([true, false, false, false], vec![0]),
            ([false, true, false, false], vec![2]),
            ([true; 4], vec![2, 0]),
            ([false, false, true, true], Vec::new()),
        ] {
            errors.blocks[1].sliver = sliver;
            assert_eq!(errors.reaching(1).collect::<Vec<_>>(), wanted, "{sliver:?}");
        }
    }

    /// Parts are in rows, and a sliver at the border counts by its share of a part.
    #[test]
    fn parts_at_the_border_are_worth_their_share() {
        let pixels = vec![Vec3::splat(0.2); 24 * 20];
        let parts = stripes(&pixels, 24, 16);
        let seen = 0.1_f64.powf(f64::from(SEEN));
        for (part, share) in parts.iter().zip([1.0, 0.5, 0.25, 0.125]) {
            assert!((part / seen - share).abs() < 1e-4, "{parts:?}");
        }
        assert_eq!(parts.len(), 4);
    }
}
