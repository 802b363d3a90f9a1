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

    /// Is any pixel wanted of those with these bounds (first and last column, first and last row), counted from pixel
    /// `first` of a raster? Whole blocks are.
    pub fn touch(&self, first: [u32; 2], bounds: [usize; 4]) -> bool {
        let [left, top] = first.map(|pixel| pixel as usize);
        let [x0, x1, y0, y1] = bounds;
        let of = |from: usize, to: usize| from / Self::EDGE..=to / Self::EDGE;
        of(y0 + top, y1 + top).any(|y| of(x0 + left, x1 + left).any(|x| self.at(x, y)))
    }

    /// Is the block in column `x` and row `y` wanted? Those beyond the image are not.
    pub fn at(&self, x: usize, y: usize) -> bool {
        x < self.width && self.wanted.get(y * self.width + x).is_some_and(|&wanted| wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_those_of_wanted_blocks() {
        // Three blocks in a row, the last one cut; two rows.
        let blocks = Blocks { width: 3, wanted: vec![true, false, true, true, true, false] };
        let found = |y: usize| Blocks::columns(Some(&blocks), y, 140, 2);
        assert_eq!(found(63), [0..64, 128..140]);
        assert_eq!(found(64), [0..64, 64..128]);
        assert_eq!(Blocks::columns(None, 64, 140, 2).first(), Some(&(0..140)));
        // A block right of the image is none of the next row.
        assert!(blocks.at(0, 1) && !blocks.at(3, 0) && !blocks.at(0, 2));
        assert_eq!(Blocks::count([140, 70], 2), [3, 2]);
    }
}
