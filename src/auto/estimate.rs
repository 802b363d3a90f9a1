//! Error of an image, estimated from the difference of its half buffers.
//!
//! A is the alternating sum of the samples over their number: half the difference of the two half buffers. The error of
//! a block is half the root of the mean of |g A|^2 / 3, with g the slope of the display's curve. In code, g A is half
//! the difference of the two displayed values.

use glam::Vec3;
use rayon::prelude::*;

use super::half_buffers::HalfBuffers;
use crate::film::{Picture, over};
use crate::frame::Blocks;
use crate::math::srgb;

/// Squared errors of an image, by blocks.
pub(super) struct Errors {
    /// Blocks in a row.
    pub width: usize,
    /// Mean over the pixels and channels of each block, of display values.
    pub squares: Vec<f64>,
    /// Pixels of each block; 0 where the block was not measured.
    pixels: Vec<u32>,
}

impl Errors {
    /// Root of the mean square over the image.
    pub(super) fn root_mean(&self) -> f64 {
        let pixels: f64 = self.pixels.iter().copied().map(f64::from).sum();
        let sum: f64 = self.squares.iter().zip(&self.pixels).map(|(square, &n)| square * f64::from(n)).sum();
        if pixels > 0.0 { (sum / pixels).sqrt() } else { 0.0 }
    }

    /// Replaces the blocks that `newer` has measured.
    pub(super) fn replace(&mut self, newer: Self) {
        for (old, (square, pixels)) in self.squares.iter_mut().zip(newer.squares.into_iter().zip(newer.pixels)) {
            if pixels > 0 {
                *old = square;
            }
        }
    }
}

/// Errors of the mean of both half buffers in the wanted blocks. `edge`: pixels along the edge of a block.
pub(super) fn block_errors(buffers: &HalfBuffers, background: Vec3, edge: usize, wanted: Option<&Blocks>) -> Errors {
    let [even, odd] = buffers.pictures();
    let columns = even.width as usize;
    let width = columns.div_ceil(edge);
    let of_row = |y: usize| {
        let mut sums = vec![(0.0_f64, 0_u32); width];
        for (block, (sum, pixels)) in sums.iter_mut().enumerate() {
            if wanted.is_some_and(|blocks| !blocks.at(block, y / edge)) {
                continue;
            }
            for x in block * edge..((block + 1) * edge).min(columns) {
                let at = y * columns + x;
                *pixels += 1;
                // Most pixels of a static background are equal.
                if even.rgba[at] != odd.rgba[at] {
                    let difference = shown(even, at, background) - shown(odd, at, background);
                    // A quarter of the mean of (g A)^2, where g A is half of the difference.
                    *sum += f64::from(difference.length_squared()) / (3.0 * 16.0);
                }
            }
        }
        sums
    };
    let rows: Vec<_> = (0..even.height as usize).into_par_iter().map(of_row).collect();
    let mut errors = Errors { width, squares: Vec::new(), pixels: Vec::new() };
    for rows in rows.chunks(edge) {
        for block in 0..width {
            let of_block = rows.iter().map(|row| row[block]);
            let (sum, pixels) = of_block.fold((0.0, 0), |(sum, pixels), (s, n)| (sum + s, pixels + n));
            errors.squares.push(if pixels > 0 { sum / f64::from(pixels) } else { 0.0 });
            errors.pixels.push(pixels);
        }
    }
    errors
}

/// Display value of a pixel over the background.
fn shown(picture: &Picture, at: usize, background: Vec3) -> Vec3 {
    let [r, g, b, alpha] = picture.rgba[at];
    let colour = over([r, g, b], 1.0 - alpha, background.to_array());
    Vec3::from_array(colour.map(|value| srgb::from_linear_nearly(value.clamp(0.0, 1.0))))
}
