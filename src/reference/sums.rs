//! Sums of what the samples see: for each pixel one sum for each of the sixteen scramblings. The spread of the sixteen
//! gives the standard error.

use rayon::prelude::*;

use super::error::ReferenceError;
use super::sampler::SCRAMBLINGS;
use crate::film::{Aov, Backdrop, Film, FilmPlanes, Layer, Picture, develop};

/// Sums of r, g, b and coverage, one for each scrambling.
pub(super) type PixelSums = [[f64; 4]; SCRAMBLINGS];

/// Least and greatest value of any sample of a pixel that was recorded: r, g, b over the background, and coverage.
/// Every sample that hit something is. Where anything see-through is in the scene all are.
pub(super) type Range = [[f32; 4]; 2];

/// The sums of an image. They are all that a later run needs to continue, with the same result as a run without a
/// break.
#[derive(Clone, Debug, PartialEq)]
pub struct Sums {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Samples of a pixel so far, a multiple of [`SCRAMBLINGS`].
    pub(super) samples: u64,
    /// Sums of each pixel, row-major.
    pub(super) colour: Vec<PixelSums>,
    /// Range of each pixel, row-major. Pixels without a recorded sample have the least above the greatest.
    pub(super) range: Vec<Range>,
    /// Sums of the AOV planes beyond the first four, `planes` for each pixel, row-major.
    pub(super) extra: Vec<f64>,
    pub(super) planes: usize,
}

/// Least variance of a mean, in squares of the change that one sample makes to it. It is the expected variance where
/// all sixteen scramblings agree.
///
/// At a step in the image, each scrambling counts k or k + 1 samples, the latter with probability p, and k + p is
/// right. Sixteen equal counts then say little, and their spread alone would claim an error of 0. p is uniform over
/// pixels. So where 0 of 16 have the greater count, p has the density 17 (1 - p)^16, and the squared error p^2 of that
/// count is 2 / (18 19) on average. One sample of a scrambling changes the scrambling's mean by 16 times as much as the
/// whole mean.
const RARE: f64 = 256.0 * 2.0 / (18.0 * 19.0);

/// The range of a pixel without samples.
pub(super) const NO_RANGE: Range = [[f32::INFINITY; 4], [f32::NEG_INFINITY; 4]];

/// Takes one sample into a range.
pub(super) fn widen([low, high]: &mut Range, value: [f32; 4]) {
    for c in 0..4 {
        low[c] = low[c].min(value[c]);
        high[c] = high[c].max(value[c]);
    }
}

/// The scramblings that a standard error is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Half {
    /// All sixteen.
    All,
    /// The eight with even numbers.
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
    /// The sums before the first sample.
    ///
    /// # Errors
    /// The sums do not fit into memory.
    pub(super) fn new([width, height]: [u32; 2], aovs: &[Aov]) -> Result<Self, ReferenceError> {
        let planes = FilmPlanes::of(aovs).count - 4;
        Self::empty(width, height, planes).ok_or(ReferenceError::Memory { width, height })
    }

    /// The sums of an image without samples; `None` if they do not fit into memory.
    pub(super) fn empty(width: u32, height: u32, planes: usize) -> Option<Self> {
        let pixels = (width as usize).checked_mul(height as usize)?;
        let each = size_of::<PixelSums>() + size_of::<Range>() + size_of::<f64>() * planes;
        // The memory is tried first: `vec!` would end the program.
        Vec::<u8>::new().try_reserve_exact(pixels.checked_mul(each)?).ok()?;
        Some(Self {
            width,
            height,
            samples: 0,
            colour: vec![[[0.0; 4]; SCRAMBLINGS]; pixels],
            range: vec![NO_RANGE; pixels],
            extra: vec![0.0; pixels * planes],
            planes,
        })
    }

    /// Returns the sums if they are of an image of this size with these AOVs.
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

    /// Memory of the sums, bytes.
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

    /// Coverage of all samples of pixel `i`: where nothing is see-through the number of those that hit something.
    pub(super) fn hits(&self, i: usize) -> f64 {
        self.colour[i].iter().map(|sums| sums[3]).sum()
    }

    /// Mean coverage of all samples.
    pub fn mean_coverage(&self) -> f64 {
        let hits: f64 = (0..self.colour.len()).map(|i| self.hits(i)).sum();
        hits / (self.samples as f64 * self.colour.len() as f64)
    }

    /// Means of r, g, b (over the background) and coverage of pixel `i`, one for each scrambling.
    pub(super) fn seen(&self, i: usize, backdrop: &Backdrop) -> PixelSums {
        let each = self.samples as f64 / SCRAMBLINGS as f64;
        let behind = backdrop.at(i);
        self.colour[i].map(|sums| {
            let [r, g, b, a] = sums.map(|s| s / each);
            let through = 1.0 - a;
            [r + through * behind[0], g + through * behind[1], b + through * behind[2], a]
        })
    }

    /// Standard error of the picture's r, g, b (over the background) and of the coverage of pixel `i`.
    pub(super) fn error(&self, i: usize, backdrop: &Backdrop) -> [f64; 4] {
        self.error_of(i, backdrop, Half::All)
    }

    /// Standard error of the mean over all samples, from the spread of the means of the scramblings in `half`.
    ///
    /// Its square is at least [`RARE`] times the square of (greatest - least sample value in the pixel and its
    /// neighbours) / samples, which is the change that one sample more or less makes. See docs/reference.md.
    fn error_of(&self, i: usize, backdrop: &Backdrop, half: Half) -> [f64; 4] {
        let means: Vec<[f64; 4]> = self.seen(i, backdrop).into_iter().step_by(half.step()).collect();
        let (n, mean) = (means.len() as f64, mean(&means));
        let quantum = self.spread(i, backdrop.at(i).to_array()).map(|d| d / self.samples as f64);
        std::array::from_fn(|c| {
            let squares: f64 = means.iter().map(|m| (m[c] - mean[c]) * (m[c] - mean[c])).sum();
            // The variance of one scrambling's mean, divided by the number of scramblings.
            (squares / (n - 1.0) / SCRAMBLINGS as f64).max(RARE * quantum[c] * quantum[c]).sqrt()
        })
    }

    /// Greatest minus least value of any sample in pixel `i` and its eight neighbours: r, g, b over the background, and
    /// coverage.
    fn spread(&self, i: usize, behind: [f64; 3]) -> [f64; 4] {
        let width = self.width as usize;
        let (x, y) = (i % width, i / width);
        // Rounded as recorded samples are.
        let [r, g, b] = behind.map(|value| f64::from(value as f32));
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
                let range = &self.range[at];
                if *range != NO_RANGE {
                    for value in range {
                        add(value.map(f64::from));
                    }
                }
                // Samples that are not recorded saw nothing. If any is not, all that are have the coverage 1.
                if range[0][3] >= 1.0 && self.hits(at) < self.samples as f64 {
                    add([r, g, b, 0.0]);
                }
            }
        }
        std::array::from_fn(|c| high[c] - low[c])
    }

    /// Mean standard error over all pixels and over r, g, b and coverage.
    #[doc(hidden)]
    pub fn mean_error(&self, backdrop: &Backdrop) -> f64 {
        self.mean_error_of(backdrop, Half::All)
    }

    /// [`Self::mean_error`] of the even scramblings alone, to decide when to stop. The odd scramblings then know
    /// nothing of the decision.
    #[doc(hidden)]
    pub fn mean_error_of_even(&self, backdrop: &Backdrop) -> f64 {
        self.mean_error_of(backdrop, Half::Even)
    }

    fn mean_error_of(&self, backdrop: &Backdrop, half: Half) -> f64 {
        let width = self.width.max(1) as usize;
        // The sum is taken row by row, so that it does not depend on the number of threads.
        let rows: Vec<f64> = (0..self.height as usize)
            .into_par_iter()
            .map(|y| (y * width..(y + 1) * width).map(|i| self.error_of(i, backdrop, half).iter().sum::<f64>()).sum())
            .collect();
        rows.iter().sum::<f64>() / (4.0 * self.colour.len() as f64)
    }

    /// The picture, with a layer of standard errors.
    pub(super) fn develop(&self, aovs: &[Aov], backdrop: &Backdrop) -> Picture {
        let whole = |_| std::iter::once(0..self.width as usize).collect();
        let mut picture = develop(self, [self.width, self.height], aovs, backdrop, whole, None);
        let errors: Vec<[f32; 4]> =
            (0..self.colour.len()).into_par_iter().map(|i| self.error(i, backdrop).map(|e| e as f32)).collect();
        let planes = (0..4).map(|c| errors.iter().map(|e| e[c]).collect()).collect();
        picture.layers.push(Layer { aov: Aov::Error, planes, names: Vec::new() });
        picture
    }
}

/// The mean of each channel.
pub(super) fn mean(values: &[[f64; 4]]) -> [f64; 4] {
    std::array::from_fn(|c| values.iter().map(|v| v[c]).sum::<f64>() / values.len() as f64)
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::film::Background;

    const BLACK: Backdrop = Backdrop::plain(Background { colour: DVec3::ZERO, transparent: false });

    /// An image of three columns and rows. Pixel 4, in the middle, has `hits` of 10 samples in each scrambling, all
    /// white.
    fn sums(hits: [f64; SCRAMBLINGS]) -> Sums {
        let mut sums = Sums::new([3, 3], &[]).unwrap();
        sums.samples = 160;
        sums.colour[4] = hits.map(|n| [n, n, n, n]);
        if hits.iter().any(|&n| n > 0.0) {
            sums.range[4] = [[1.0; 4]; 2];
        }
        sums
    }

    /// Eight means of 0.2 and eight of 0.6, by the textbook formula.
    #[test]
    fn the_error_is_that_of_the_mean_of_sixteen() {
        let hits = std::array::from_fn(|r| if r % 4 < 2 { 2.0 } else { 6.0 });
        let want = (16.0_f64 * 0.2 * 0.2 / 15.0 / 16.0).sqrt();
        for error in sums(hits).error(4, &BLACK) {
            assert!((error - want).abs() < 1e-12, "{error}, not {want}");
        }
        // The even scramblings alone: the variance of eight, divided by sixteen.
        let want = (8.0_f64 * 0.2 * 0.2 / 7.0 / 16.0).sqrt();
        let got = sums(hits).error_of(4, &BLACK, Half::Even);
        assert!(got.iter().all(|error| (error - want).abs() < 1e-12), "{got:?}, not {want}");
        // The background counts in colours, not in coverage. White before white has no error.
        let white = Backdrop::plain(Background { colour: DVec3::ONE, transparent: false });
        let [r, _, _, a] = sums(hits).error(4, &white);
        assert!(r < 1e-12 && a > 0.04, "{r} {a}");
    }

    /// Where all scramblings agree, the error is what one sample changes, in the pixel and in all its neighbours and
    /// nowhere else.
    #[test]
    fn where_all_agree_a_part_of_a_sample_is_left() {
        let want = (256.0_f64 * 2.0 / (18.0 * 19.0)).sqrt() / 160.0;
        let agreed = sums([3.0; SCRAMBLINGS]);
        for i in 0..9 {
            let errors = agreed.error(i, &BLACK);
            assert!(errors.iter().all(|error| (error - want).abs() < 1e-12), "pixel {i}: {errors:?}, not {want}");
        }
        for full in [0.0, 10.0] {
            let mut sums = sums([full; SCRAMBLINGS]);
            let (colour, range) = (sums.colour[4], sums.range[4]);
            sums.colour.fill(colour);
            sums.range.fill(range);
            assert!(sums.error(4, &BLACK).iter().all(|error| *error < 1e-12), "one value only");
        }
    }
}
