//! Half buffers: the even and the odd time samples of a frame, as two pictures.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::reuses_samples;
use crate::backend::{Backend, BackendError, Stats};
use crate::film::{Aov, Picture, over};
use crate::frame::{Blocks, Frame};
use crate::options::{Interleave, PixelFilter, RenderOptions};
use crate::plan::{Exposure, Group, PositionExposure, RasterExposure, TimeSample, share_out};
use crate::sampling::pixel_offsets;
use crate::scene::Scene;
use crate::time::FrameNumber;

/// The time samples that one round of a frame adds. There are `samples * factor` strata; the round samples those that
/// the first round, of `samples` strata, has not sampled. With `factor` 1 it samples all.
#[derive(Clone, Copy)]
pub(super) struct Round<'a> {
    pub scene: &'a Scene,
    pub number: FrameNumber,
    pub options: &'a RenderOptions,
    pub interleave: Interleave,
    /// Even.
    pub samples: u32,
    /// Odd.
    pub factor: u32,
    /// Sub-pixel positions that share the samples, even; or 1: the pixel's centre.
    pub positions: u32,
}

/// Where the time samples of one class of pixels lie within their strata.
struct Place {
    /// Place within a fine stratum, in [0, 1).
    fine: f64,
    /// The sample of coarse stratum i lies in fine stratum i * factor + `shift`.
    shift: u32,
}

impl Round<'_> {
    /// Class c of a lattice with stride S samples its strata at (2c + 1) / 2S^2. With an odd factor, each coarse sample
    /// lies at such a place of a fine stratum.
    fn place(&self, phase: [u32; 2]) -> Place {
        let classes = f64::from(self.interleave.stride().pow(2));
        let scaled = f64::from(self.factor) * (f64::from(self.interleave.order(phase)) + 0.5) / classes;
        Place { fine: scaled.fract(), shift: scaled as u32 }
    }

    /// Does stratum `index` belong to half buffer `half`, and has no coarser round sampled it?
    fn is_fresh(&self, place: &Place, index: u32, half: u32) -> bool {
        let reused = self.factor > 1 && reuses_samples(self.scene) && index % self.factor == place.shift;
        index % 2 == half && !reused
    }

    /// Share of the exposure that all even samples have, those of the coarser round included.
    pub(super) fn even_share(&self, phase: [u32; 2]) -> f32 {
        let strata = self.scene.shutter.strata(self.samples * self.factor, self.place(phase).fine);
        let even: f64 = strata.iter().step_by(2).map(|(_, weight)| weight).sum();
        let all: f64 = strata.iter().map(|(_, weight)| weight).sum();
        if all > 0.0 { (even / all) as f32 } else { 0.5 }
    }

    /// The new samples of half buffer `half`; their weights sum to 1.
    fn exposure(&self, half: u32) -> Exposure {
        let raster = |phase| RasterExposure { phase, positions: self.positions(phase, half) };
        Exposure { stride: self.interleave.stride(), rasters: self.interleave.phases().map(raster).collect() }
    }

    fn positions(&self, phase: [u32; 2], half: u32) -> Vec<PositionExposure> {
        let Self { scene, number, options, interleave, .. } = *self;
        let place = self.place(phase);
        let strata = scene.shutter.strata(self.samples * self.factor, place.fine);
        let fresh = (0..).zip(strata).filter(|(index, _)| self.is_fresh(&place, *index, half));
        let fresh: Vec<(f64, f64)> = fresh.map(|(_, stratum)| stratum).collect();
        let total: f64 = fresh.iter().map(|(_, weight)| weight).sum();
        let offsets = match options.filter {
            // The first and the last half of the positions each cover the pixel evenly.
            PixelFilter::Box => {
                let all = pixel_offsets(self.positions * self.factor, interleave.seed_of(phase, options.seed));
                all.chunks(all.len() / 2).nth(half as usize).unwrap_or_default().to_vec()
            }
            PixelFilter::Point => vec![[0.0; 2]],
        };
        let groups = fresh.iter().map(|&(t, weight)| {
            let weight = if total > 0.0 { weight / total } else { 0.0 };
            let sample = TimeSample { time: scene.shutter.frame_time(number.get(), t), weight };
            Group { samples: vec![sample], sweep: None }
        });
        share_out(groups.collect(), &offsets)
    }
}

/// Means over the even and over the odd samples, without a background.
pub(super) struct HalfBuffers([Picture; 2]);

impl HalfBuffers {
    /// Renders a round in the wanted blocks.
    pub(super) fn render(
        backend: &mut dyn Backend,
        round: &Round<'_>,
        wanted: Option<&Blocks>,
        stats: &mut Stats,
    ) -> Result<Self, BackendError> {
        let mut half = |half: u32| {
            let mut frame = Frame::exposed(round.scene, round.number, &round.exposure(half), round.options);
            frame.background.transparent = true;
            frame.wanted = wanted.cloned();
            // Room for the two older half buffers, and for the other one of this round.
            frame.picture_bytes = 3 * picture_bytes(&frame);
            let mut rendered = backend.render(frame)?;
            stats.add(&rendered.stats);
            rendered.picture.layers.retain(|layer| layer.aov != Aov::Samples);
            Ok(rendered.picture)
        };
        Ok(Self([half(0)?, half(1)?]))
    }

    /// The even and the odd half buffer.
    pub(super) const fn pictures(&self) -> &[Picture; 2] {
        &self.0
    }

    /// Adds the samples of `round`, whose half buffers are `fresh`, in the wanted blocks.
    pub(super) fn refine(&mut self, fresh: &Self, round: &Round<'_>, blocks: &Blocks) {
        let stride = round.interleave.stride() as usize;
        let old = if reuses_samples(round.scene) { 1.0 / round.factor as f32 } else { 0.0 };
        let width = self.0[0].width as usize;
        // Even strata that lie in odd finer strata move to the other half buffer.
        let swaps: Vec<bool> = (0..stride * stride)
            .map(|class| round.place([class % stride, class / stride].map(|p| p as u32)).shift % 2 == 1)
            .collect();
        let columns = |y: usize| Blocks::columns(Some(blocks), y, width, stride);
        let [even, odd] = &mut self.0;
        swap_pixels(even, odd, &columns, &|x, y| swaps[y % stride * stride + x % stride]);
        let mixed = Mixed { columns: &columns, shares: &|_, shares| shares.fill(old), behind: None };
        mixed.mix(even, &fresh.0[0]);
        mixed.mix(odd, &fresh.0[1]);
    }

    /// Returns the memory of the pictures to the backend.
    pub(super) fn recycle(self, backend: &mut dyn Backend) {
        self.0.into_iter().for_each(|picture| backend.recycle(picture));
    }

    /// The mean of both half buffers, over the colour `behind` if there is one. `even` writes the share of the even
    /// half buffer for each pixel of a row.
    pub(super) fn mean(self, even: Shares<'_>, behind: Option<Vec3>, backend: &mut dyn Backend) -> Picture {
        let [mut mean, odd] = self.0;
        let width = mean.width as usize;
        let columns = |y: usize| Blocks::columns(None, y, width, 1);
        Mixed { columns: &columns, shares: even, behind }.mix(&mut mean, &odd);
        backend.recycle(odd);
        mean
    }
}

/// Bytes of a picture of `frame`.
fn picture_bytes(frame: &Frame) -> u64 {
    let planes = 4 + frame.aovs.iter().map(|aov| aov.channels().len() as u64).sum::<u64>();
    u64::from(frame.size[0]) * u64::from(frame.size[1]) * planes * size_of::<f32>() as u64
}

/// Columns of a row.
type Columns<'a> = &'a (dyn Fn(usize) -> Vec<Range<usize>> + Sync);

/// Writes a number for each pixel of a row.
pub(super) type Shares<'a> = &'a (dyn Fn(usize, &mut [f32]) + Sync);

/// Swaps the pixels of `columns` for which `which` is true. Arguments of `which`: column and row.
fn swap_pixels(a: &mut Picture, b: &mut Picture, columns: Columns<'_>, which: &(dyn Fn(usize, usize) -> bool + Sync)) {
    let width = a.width as usize;
    let swap_row = |y: usize, swap: &mut dyn FnMut(usize)| {
        columns(y).into_iter().flatten().filter(|&x| which(x, y)).for_each(swap);
    };
    let rows = a.rgba.par_chunks_mut(width).zip(b.rgba.par_chunks_mut(width)).enumerate();
    rows.for_each(|(y, (a, b))| swap_row(y, &mut |x| std::mem::swap(&mut a[x], &mut b[x])));
    let layers = a.layers.iter_mut().zip(&mut b.layers);
    for (a, b) in layers.flat_map(|(a, b)| a.planes.iter_mut().zip(&mut b.planes)) {
        let rows = a.par_chunks_mut(width).zip(b.par_chunks_mut(width)).enumerate();
        rows.for_each(|(y, (a, b))| swap_row(y, &mut |x| std::mem::swap(&mut a[x], &mut b[x])));
    }
}

/// Weights and place of the mean of two pictures.
struct Mixed<'a> {
    /// Columns of a row that are mixed.
    columns: Columns<'a>,
    /// Share of the first picture in each pixel.
    shares: Shares<'a>,
    /// Colour of the background; `None`: the result stays transparent.
    behind: Option<Vec3>,
}

impl Mixed<'_> {
    /// Replaces `a` by the mean of `a` and `b`. Channels that are means over the covered part of a pixel are weighted
    /// by coverage.
    fn mix(&self, a: &mut Picture, b: &Picture) {
        let width = a.width as usize;
        for (layer, of_b) in a.layers.iter_mut().zip(&b.layers) {
            for (plane, of_b) in layer.planes.iter_mut().zip(&of_b.planes) {
                let linear = layer.aov == Aov::Alpha;
                let colours = a.rgba.par_chunks(width).zip(b.rgba.par_chunks(width));
                let rows = plane.par_chunks_mut(width).zip(of_b.par_chunks(width)).zip(colours).enumerate();
                rows.for_each_init(
                    || vec![0.0; width],
                    |shares, (y, ((values, others), (a, b)))| {
                        (self.shares)(y, shares);
                        for x in (self.columns)(y).into_iter().flatten() {
                            let share = shares[x];
                            let by =
                                if linear { [share, 1.0 - share] } else { [share * a[x][3], (1.0 - share) * b[x][3]] };
                            // Where a picture covers nothing, its value may be infinite.
                            values[x] = match by {
                                [_, 0.0] => values[x],
                                [0.0, _] => others[x],
                                [of_a, of_b] => (of_a * values[x] + of_b * others[x]) / (of_a + of_b),
                            };
                        }
                    },
                );
            }
        }
        let rows = a.rgba.par_chunks_mut(width).zip(b.rgba.par_chunks(width)).enumerate();
        rows.for_each_init(
            || vec![0.0; width],
            |shares, (y, (a, b))| {
                (self.shares)(y, shares);
                for span in (self.columns)(y) {
                    let pixels = a[span.clone()].iter_mut().zip(&b[span.clone()]).zip(&shares[span]);
                    pixels.for_each(|((a, b), &share)| *a = self.pixel(a, b, share));
                }
            },
        );
    }

    fn pixel(&self, a: &[f32; 4], b: &[f32; 4], share: f32) -> [f32; 4] {
        let mixed @ [r, g, b, alpha] = [0, 1, 2, 3].map(|c| share * a[c] + (1.0 - share) * b[c]);
        let Some(behind) = self.behind else { return mixed };
        let [r, g, b] = over([r, g, b], 1.0 - alpha, behind.to_array());
        [r, g, b, 1.0]
    }
}
