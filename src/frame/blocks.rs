//! Which blocks of the image are rendered.

use std::ops::Range;

/// Blocks of [`Blocks::EDGE`] x [`Blocks::EDGE`] raster pixels, the same of every raster: true where wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blocks {
    /// Blocks in a row.
    pub width: usize,
    /// Row by row.
    pub wanted: Vec<bool>,
}

impl Blocks {
    /// Raster pixels along the edge of a block.
    pub const EDGE: usize = 32;

    /// Blocks in a row and number of rows, for an image of `size` pixels whose rasters take every `stride`-th.
    pub fn count(size: [u32; 2], stride: u32) -> [usize; 2] {
        size.map(|pixels| (pixels.div_ceil(stride) as usize).div_ceil(Self::EDGE))
    }

    /// The columns of row `y` that lie in `wanted` blocks. The image has `width` columns, and its rasters take every
    /// `stride`-th.
    pub fn columns(wanted: Option<&Self>, y: usize, width: usize, stride: usize) -> Vec<Range<usize>> {
        let Some(blocks) = wanted else { return std::iter::once(0..width).collect() };
        let edge = Self::EDGE * stride;
        let columns = |x: usize| (x * edge).min(width)..((x + 1) * edge).min(width);
        (0..blocks.width).filter(|&x| blocks.at(x, y / edge)).map(columns).collect()
    }

    /// Is the block in column `x` and row `y` wanted? Those beyond the image are not.
    pub fn at(&self, x: usize, y: usize) -> bool {
        x < self.width && self.wanted.get(y * self.width + x).is_some_and(|&wanted| wanted)
    }
}
