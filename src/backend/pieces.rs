//! Boxes around pieces of a model: a piece that lies apart from the blocks that are wanted need not be projected.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use crate::frame::{Blocks, Frame, PosedObject, Raster};
use crate::model::Surfels;

/// Surfels of a piece; neighbours in memory are neighbours in space.
const PIECE: usize = 256;

/// Slack of a box on the screen, pixels, against rounding.
const SLACK: f32 = 1.0;

/// Least and greatest corner of the kernels of each piece, model space.
#[derive(Clone, Debug)]
pub(super) struct Pieces(Vec<[Vec3; 2]>);

impl Pieces {
    fn of(surfels: &Surfels) -> Self {
        let axes = surfels.axis_u.par_chunks(PIECE).zip(surfels.axis_v.par_chunks(PIECE));
        let boxes = surfels.position.par_chunks(PIECE).zip(axes).map(|(position, (u, v))| {
            let mut corners = [Vec3::INFINITY, Vec3::NEG_INFINITY];
            for (p, (u, v)) in position.iter().zip(u.iter().zip(v)) {
                let reach = u.abs() + v.abs();
                corners = [corners[0].min(p - reach), corners[1].max(p + reach)];
            }
            corners
        });
        Self(boxes.collect())
    }

    /// Those of each object of `frame`, where only some blocks are wanted; else none.
    pub(super) fn of_frame(frame: &Frame<'_>) -> Vec<Self> {
        match frame.wanted {
            Some(_) if frame.swept.is_none() => frame.objects.iter().map(|object| Self::of(object.surfels)).collect(),
            _ => Vec::new(),
        }
    }

    /// The parts of `surfels` that may touch a wanted block; what lies between two of them is longer than `gap`.
    pub(super) fn wanted(&self, window: &Window<'_>, surfels: Range<usize>, gap: usize) -> Vec<Range<usize>> {
        let mut parts: Vec<Range<usize>> = Vec::new();
        for piece in surfels.start / PIECE..surfels.end.div_ceil(PIECE) {
            if self.0.get(piece).is_some_and(|corners| !window.touches(corners)) {
                continue;
            }
            let (first, end) = ((piece * PIECE).max(surfels.start), ((piece + 1) * PIECE).min(surfels.end));
            match parts.last_mut() {
                Some(part) if first - part.end <= gap => part.end = end,
                _ => parts.push(first..end),
            }
        }
        parts
    }
}

/// An object before the blocks that are wanted.
pub(super) struct Window<'a> {
    pub object: &'a PosedObject,
    pub raster: &'a Raster,
    /// First and last pixel column, first and last pixel row.
    pub pixels: [i32; 4],
    pub near: f32,
    pub blocks: &'a Blocks,
}

impl Window<'_> {
    /// May what lies in the box touch a wanted block? True where it comes near the camera plane.
    fn touches(&self, [low, high]: &[Vec3; 2]) -> bool {
        let mut bounds = [f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY, f32::NEG_INFINITY];
        for corner in 0..8 {
            let pick = |c: usize| if corner >> c & 1 == 0 { low[c] } else { high[c] };
            let point = Vec3::new(pick(0), pick(1), pick(2));
            let p = self.object.screen_from_model * point + self.object.screen_origin;
            if p.z.is_nan() || p.z <= self.near {
                return true;
            }
            for c in 0..2 {
                let pixel = self.raster.axis[c] + p[c] / p.z - self.raster.offset[c];
                bounds[2 * c] = bounds[2 * c].min(pixel);
                bounds[2 * c + 1] = bounds[2 * c + 1].max(pixel);
            }
        }
        let reach = SLACK + self.raster.low_pass;
        let [x0, x1, y0, y1] = self.pixels.map(|pixel| pixel as f32);
        let [left, right] = [(bounds[0] - reach).max(x0), (bounds[1] + reach).min(x1)];
        let [top, bottom] = [(bounds[2] - reach).max(y0), (bounds[3] + reach).min(y1)];
        let of = |first: f32, last: f32| first as usize / Blocks::EDGE..=last as usize / Blocks::EDGE;
        let wanted = || of(top, bottom).any(|y| of(left, right).any(|x| self.blocks.at(x, y)));
        left <= right && top <= bottom && wanted()
    }
}
