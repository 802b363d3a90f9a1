//! See-through surfels on a shadow map: which layer of a texel stops the light of a time sample.
//!
//! Layers are those of docs/math.md, section 12, as the light meets them: they end at the least end of light of the
//! surfels that no layer before them has. Each layer of a map has a chance, the same for all texels. Light ends at the
//! first layer whose opacity is above its own chance. Chances are even over the samples, so the mean of these is the
//! product of transmittances (stochastic transparency: Enderton et al. 2010, with a random number for each layer, not
//! for each fragment).

use super::caster::{Casters, Moved};
use crate::backend::cpu::columns::RUN;
use crate::backend::cpu::tiles::LANES;
use crate::math::simd::dispatch;

/// More of a caster that light passes through.
#[derive(Clone, Copy, Debug)]
pub(super) struct Veil {
    /// In [0, 1].
    pub opacity: f32,
    pub moved: Moved,
}

/// The layers of a band of a map.
pub(super) struct Layers<'a> {
    pub casters: &'a Casters<'a>,
    /// More of the casters of the last runs.
    pub veils: &'a [Vec<Veil>],
    /// Number of the first run that has any.
    pub first_run: usize,
    /// Numbers of the casters, rising.
    pub list: &'a [u32],
    pub chances: &'a [f32],
    /// The band's first row, and texels from one row to the next.
    pub first: usize,
    pub stride: usize,
}

impl Layers<'_> {
    /// Bytes that a band takes, a texel.
    pub(super) const BYTES_OF_TEXEL: u64 = 12;

    /// Lets the layers before the opaque casters of a band stop light.
    pub(super) fn draw(&self, end: &mut [f32], caster: &mut [u32]) {
        // Where the last layer ends, and the end of light and the caster of the one that is drawn.
        let mut last = vec![f32::NEG_INFINITY; end.len()];
        let (mut next, mut by) = (vec![f32::INFINITY; end.len()], vec![0; end.len()]);
        for &chance in self.chances {
            next.fill(f32::INFINITY);
            draw_layer(self, end, &last, &mut next, &mut by);
            let mut is_any = false;
            for at in (0..end.len()).filter(|&at| next[at] < f32::INFINITY) {
                is_any = true;
                last[at] = next[at];
                if chance < self.veil(by[at]).opacity {
                    (end[at], caster[at]) = (next[at], by[at]);
                }
            }
            if !is_any {
                break;
            }
        }
    }

    fn veil(&self, number: u32) -> &Veil {
        &self.veils[number as usize / RUN - self.first_run][number as usize % RUN]
    }
}

dispatch! {
    /// Finds the first casters behind the layers so far, and before what stops light: their ends of light, and numbers.
    fn draw_layer(layers: &Layers<'_>, end: &[f32], last: &[f32], next: &mut [f32], by: &mut [u32]) = draw_layer_body
}

#[inline(always)]
fn draw_layer_body(layers: &Layers<'_>, end: &[f32], last: &[f32], next: &mut [f32], by: &mut [u32]) {
    let &Layers { casters, list, first, stride, .. } = layers;
    let rows = end.len() / stride;
    for &number in list {
        let ((of, plane), Moved { factor, by: length }) = (casters.of(number), layers.veil(number).moved);
        let [[left, right], [top, bottom]] = of.bounds.map(|ends| ends.map(usize::from));
        for y in top.max(first)..=bottom.min(first + rows - 1) {
            let row = of.on_row(plane, y);
            for x in (left..=right).step_by(LANES) {
                let begin = (y - first) * stride + x;
                let distance = of.ends(plane, row, x);
                for l in 0..LANES {
                    let (at, distance) = (begin + l, distance[l]);
                    // What it does not cover is not a number here.
                    let is_next =
                        (distance * factor - length > last[at]) & (distance < end[at]) & (distance < next[at]);
                    if is_next {
                        (next[at], by[at]) = (distance, number);
                    }
                }
            }
        }
    }
}
