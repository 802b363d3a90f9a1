//! Boxes around pieces of a model: a piece that lies apart from the blocks that are wanted need not be projected.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::project::View;
use crate::model::Surfels;

/// Surfels of a piece; neighbours in memory are neighbours in space.
const PIECE: usize = 256;

/// Slack of a box on the screen, pixels, against rounding.
const SLACK: f32 = 1.0;

/// Least and greatest corner of the kernels of each piece, model space.
#[derive(Clone, Debug)]
pub(super) struct Pieces(Vec<[Vec3; 2]>);

impl Pieces {
    pub(super) fn of(surfels: &Surfels) -> Self {
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

    /// The parts of `surfels`, which begins with a piece, that may touch a wanted block.
    pub(super) fn wanted(&self, view: &View<'_>, surfels: Range<usize>) -> Vec<Range<usize>> {
        let mut parts: Vec<Range<usize>> = Vec::new();
        for first in surfels.clone().step_by(PIECE) {
            if self.0.get(first / PIECE).is_some_and(|corners| !touches(view, corners)) {
                continue;
            }
            let end = (first + PIECE).min(surfels.end);
            match parts.last_mut() {
                Some(part) if part.end == first => part.end = end,
                _ => parts.push(first..end),
            }
        }
        parts
    }
}

/// May what lies in the box touch a wanted block? True where it comes near the camera plane.
fn touches(view: &View<'_>, [low, high]: &[Vec3; 2]) -> bool {
    let mut bounds = [f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY, f32::NEG_INFINITY];
    for corner in 0..8 {
        let pick = |c: usize| if corner >> c & 1 == 0 { low[c] } else { high[c] };
        let point = Vec3::new(pick(0), pick(1), pick(2));
        let p = view.object.screen_from_model * point + view.object.screen_origin;
        if p.z.is_nan() || p.z <= view.near {
            return true;
        }
        for c in 0..2 {
            let pixel = view.raster.axis[c] + p[c] / p.z - view.raster.offset[c];
            bounds[2 * c] = bounds[2 * c].min(pixel);
            bounds[2 * c + 1] = bounds[2 * c + 1].max(pixel);
        }
    }
    let reach = SLACK + view.raster.low_pass;
    let [x0, x1, y0, y1] = view.pixels.map(|pixel| pixel as f32);
    let [left, right] = [(bounds[0] - reach).max(x0), (bounds[1] + reach).min(x1)];
    let [top, bottom] = [(bounds[2] - reach).max(y0), (bounds[3] + reach).min(y1)];
    left <= right && top <= bottom && view.wants([left, right, top, bottom].map(|pixel| pixel as u16))
}
