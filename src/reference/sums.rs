//! What the samples add up to: per pixel one sum for each of the sixteen scramblings, and from their spread the standard error.

use rayon::prelude::*;

use super::ReferenceError;
use super::sampler::SCRAMBLINGS;
use crate::film::{Aov, Background, Film, FilmPlanes, Layer, Picture, develop};

/// Sums of r, g, b and coverage, one a scrambling.
pub(super) type PixelSums = [[f64; 4]; SCRAMBLINGS];

/// The sums of an image: all that is needed to go on sampling later, with the same result as without the break.
#[derive(Clone, Debug, PartialEq)]
pub struct Sums {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Samples of a pixel so far, a multiple of [`SCRAMBLINGS`].
    pub(super) samples: u64,
    /// Row-major.
    pub(super) colour: Vec<PixelSums>,
    /// Least and greatest shaded colour of the samples that hit something, row-major; inverted where none did.
    pub(super) range: Vec<[[f32; 3]; 2]>,
    /// Sums of the planes of AOVs beyond the first four, `planes` a pixel, row-major.
    pub(super) extra: Vec<f64>,
    pub(super) planes: usize,
}

/// Variance, in squares of the change that one sample makes to the mean, that is left when all sixteen scramblings agree.
///
/// Stratified samples of a step differ by at most one from scrambling to scrambling, and of something that covers a thousandth of
/// a pixel there may be none: sixteen equal means then say little, and their spread alone would claim an error of 0. By
/// Laplace's rule of succession the probability of one sample more has, after 0 of 16, the variance 17 / (18^2 19); one sample
/// of a scrambling changes its mean by 16 times as much as the whole mean.
const RARE: f64 = 256.0 * 17.0 / (18.0 * 18.0 * 19.0);

/// The range of no samples.
pub(super) const NO_RANGE: [[f32; 3]; 2] = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// Which scramblings a standard error is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Half {
    /// All sixteen.
    All,
    /// Those with even numbers.
    Even,
}

impl Half {
    const fn step(self) -> usize {
        match self {
            Self::All => 1,
            Self::Even => 2,
        }
    }
}

impl Sums {
    /// Before the first sample.
    pub(super) fn new(size: [u32; 2], aovs: &[Aov]) -> Self {
        let pixels = size[0] as usize * size[1] as usize;
        let planes = FilmPlanes::of(aovs).count - 4;
        Self {
            width: size[0],
            height: size[1],
            samples: 0,
            colour: vec![[[0.0; 4]; SCRAMBLINGS]; pixels],
            range: vec![NO_RANGE; pixels],
            extra: vec![0.0; pixels * planes],
            planes,
        }
    }

    /// Itself, if it is of an image of this size with these AOVs.
    pub(super) fn like(self, size: [u32; 2], aovs: &[Aov]) -> Result<Self, ReferenceError> {
        let say = |[w, h]: [u32; 2], planes: usize| format!("{w} x {h} pixels and {planes} planes of AOVs");
        let (found, expected) =
            (say([self.width, self.height], self.planes), say(size, FilmPlanes::of(aovs).count - 4));
        if found == expected { Ok(self) } else { Err(ReferenceError::Unlike { found, expected }) }
    }

    /// Samples of a pixel so far.
    pub const fn samples(&self) -> u64 {
        self.samples
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> u64 {
        let bytes = [
            size_of_val(self.colour.as_slice()),
            size_of_val(self.range.as_slice()),
            size_of_val(self.extra.as_slice()),
        ];
        bytes.into_iter().sum::<usize>() as u64
    }

    /// Mean of premultiplied r, g, b and coverage of pixel `i`.
    fn mean(&self, i: usize) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for scrambling in &self.colour[i] {
            for c in 0..4 {
                sum[c] += scrambling[c];
            }
        }
        sum.map(|s| s / self.samples as f64)
    }

    /// Share of all samples that hit something.
    pub fn mean_coverage(&self) -> f64 {
        let hits: f64 = self.colour.iter().flatten().map(|sums| sums[3]).sum();
        hits / (self.samples as f64 * self.colour.len() as f64)
    }

    /// Standard error of the picture's r, g, b (composited) and of the coverage of pixel `i`.
    ///
    /// Two terms, added in squares. First the standard error of the mean over all samples as judged by the spread of the means
    /// of the scramblings in `half`. Second [`RARE`] times the square of (greatest - least sample value in the pixel and its
    /// neighbours) / samples: what one sample more or less would change. See docs/reference.md.
    fn pixel_error(&self, i: usize, background: Background, half: Half) -> [f64; 4] {
        let each = self.samples as f64 / SCRAMBLINGS as f64;
        let behind = behind(background);
        let seen = |sums: &[f64; 4]| {
            let [r, g, b, a] = sums.map(|s| s / each);
            let through = 1.0 - a;
            [r + through * behind[0], g + through * behind[1], b + through * behind[2], a]
        };
        let means = || self.colour[i].iter().step_by(half.step()).map(seen);
        let n = (SCRAMBLINGS / half.step()) as f64;
        let mut mean = [0.0; 4];
        for m in means() {
            (0..4).for_each(|c| mean[c] += m[c] / n);
        }
        let mut square = [0.0; 4];
        for m in means() {
            (0..4).for_each(|c| square[c] += (m[c] - mean[c]) * (m[c] - mean[c]));
        }
        let quantum = self.spread(i, behind).map(|d| d / self.samples as f64);
        // Variance of one scrambling's mean, shared by all of them.
        std::array::from_fn(|c| (square[c] / (n - 1.0) / SCRAMBLINGS as f64 + RARE * quantum[c] * quantum[c]).sqrt())
    }

    /// Greatest minus least value of any sample in pixel `i` and its eight neighbours: r, g, b as seen, coverage.
    fn spread(&self, i: usize, behind: [f64; 3]) -> [f64; 4] {
        let width = self.width as usize;
        let (x, y) = (i % width, i / width);
        let (mut low, mut high) = ([f64::INFINITY; 4], [f64::NEG_INFINITY; 4]);
        let mut add = |values: [f64; 4]| {
            for c in 0..4 {
                low[c] = low[c].min(values[c]);
                high[c] = high[c].max(values[c]);
            }
        };
        for y in y.saturating_sub(1)..(y + 2).min(self.height as usize) {
            for x in x.saturating_sub(1)..(x + 2).min(width) {
                let at = y * width + x;
                let hits = self.colour[at].iter().map(|sums| sums[3]).sum::<f64>();
                if hits > 0.0 {
                    for [r, g, b] in self.range[at] {
                        add([f64::from(r), f64::from(g), f64::from(b), 1.0]);
                    }
                }
                if hits < self.samples as f64 {
                    add([behind[0], behind[1], behind[2], 0.0]);
                }
            }
        }
        std::array::from_fn(|c| high[c] - low[c])
    }

    /// Mean standard error over all pixels and r, g, b and coverage.
    pub fn mean_error(&self, background: Background) -> f64 {
        self.mean_error_of(background, Half::All)
    }

    /// The same, judged by the even scramblings alone: to decide when to stop. The odd ones then know nothing of the decision.
    pub fn mean_error_of_even(&self, background: Background) -> f64 {
        self.mean_error_of(background, Half::Even)
    }

    fn mean_error_of(&self, background: Background, half: Half) -> f64 {
        let width = self.width.max(1) as usize;
        // Row by row, so that the sum does not depend on the number of threads.
        let rows: Vec<f64> = (0..self.height as usize)
            .into_par_iter()
            .map(|y| {
                (y * width..(y + 1) * width).map(|i| self.pixel_error(i, background, half).iter().sum::<f64>()).sum()
            })
            .collect();
        rows.iter().sum::<f64>() / (4.0 * self.colour.len() as f64)
    }

    /// The picture, with a layer of standard errors.
    pub(super) fn develop(&self, aovs: &[Aov], background: Background) -> Picture {
        let mut picture = develop(self, [self.width, self.height], aovs, background);
        let errors: Vec<[f32; 4]> = (0..self.colour.len())
            .into_par_iter()
            .map(|i| self.pixel_error(i, background, Half::All).map(|e| e as f32))
            .collect();
        let planes = (0..4).map(|c| errors.iter().map(|e| e[c]).collect()).collect();
        picture.layers.push(Layer { aov: Aov::Error, planes });
        picture
    }
}

/// What is seen through the film's gaps.
fn behind(background: Background) -> [f64; 3] {
    if background.transparent { [0.0; 3] } else { background.colour.to_array() }
}

impl Film for Sums {
    fn row(&self, plane: usize, y: u32, out: &mut [f32]) {
        let first = y as usize * self.width as usize;
        for (x, value) in out.iter_mut().enumerate() {
            let i = first + x;
            *value = if plane < 4 {
                self.mean(i)[plane] as f32
            } else {
                (self.extra[i * self.planes + plane - 4] / self.samples as f64) as f32
            };
        }
    }

    fn samples(&self, _y: u32, out: &mut [f32]) {
        out.fill(self.samples as f32);
    }
}
