//! The even and the odd time samples of a frame, as two pictures.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::keeps;
use crate::backend::{Backend, BackendError, Stats};
use crate::film::{Aov, Picture};
use crate::frame::{Blocks, Frame};
use crate::options::{Interleave, PixelFilter, RenderOptions};
use crate::plan::{Exposure, Group, PositionExposure, RasterExposure, TimeSample, share_out};
use crate::sampling::pixel_offsets;
use crate::scene::Scene;

/// Some time samples of a frame: of `samples * factor` those that `samples` alone do not have, all if `factor` is 1.
#[derive(Clone, Copy)]
pub(super) struct Round<'a> {
    pub scene: &'a Scene,
    pub number: i64,
    pub options: &'a RenderOptions,
    pub interleave: Interleave,
    /// Even.
    pub samples: u32,
    /// Odd.
    pub factor: u32,
    /// Sub-pixel positions that `samples` share out, even; or 1: the pixel's centre.
    pub positions: u32,
}

/// Time samples of one class within their strata.
struct Place {
    /// Of the fine strata, in [0, 1).
    fine: f64,
    /// Stratum i of the coarse ones has its sample in fine stratum i * factor + `shift`.
    shift: u32,
}

impl Round<'_> {
    /// With places (2c + 1) / 2S^2 in the strata, c the class, an odd factor puts each coarse sample at such a place of a fine stratum.
    fn place(&self, phase: [u32; 2]) -> Place {
        let classes = f64::from(self.interleave.stride().pow(2));
        let scaled = f64::from(self.factor) * (f64::from(self.interleave.order(phase)) + 0.5) / classes;
        Place { fine: scaled.fract(), shift: scaled as u32 }
    }

    /// Is stratum `index` one of half `half`, and not one that the coarser samples have?
    fn is_fresh(&self, place: &Place, index: u32, half: u32) -> bool {
        let kept = self.factor > 1 && keeps(self.scene) && index % self.factor == place.shift;
        index % 2 == half && !kept
    }

    /// Share of the exposure that the even samples have, the coarser ones among them.
    pub(super) fn even_share(&self, phase: [u32; 2]) -> f32 {
        let strata = self.scene.shutter.strata(self.samples * self.factor, self.place(phase).fine);
        let even: f64 = strata.iter().step_by(2).map(|(_, weight)| weight).sum();
        let all: f64 = strata.iter().map(|(_, weight)| weight).sum();
        if all > 0.0 { (even / all) as f32 } else { 0.5 }
    }

    /// The new samples of half `half`; their weights sum to 1.
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
            // The first and the last half of the positions are each spread over the pixel.
            PixelFilter::Box => {
                let all = pixel_offsets(self.positions * self.factor, interleave.seed_of(phase, options.seed));
                all.chunks(all.len() / 2).nth(half as usize).unwrap_or_default().to_vec()
            }
            PixelFilter::Point => vec![[0.0; 2]],
        };
        let groups = fresh.iter().map(|&(t, weight)| {
            let weight = if total > 0.0 { weight / total } else { 0.0 };
            let sample = TimeSample { time: scene.shutter.frame_time(number as f64, t), weight };
            Group { samples: vec![sample], sweep: None }
        });
        share_out(groups.collect(), &offsets)
    }
}

/// Means over the even and the odd samples, without a background.
pub(super) struct Halves([Picture; 2]);

impl Halves {
    /// Renders a round, in the blocks that are wanted.
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
            // The halves that there are, and the other one of this round.
            frame.picture_bytes = 3 * picture_bytes(&frame);
            let mut rendered = backend.render(frame)?;
            stats.add(&rendered.stats);
            rendered.picture.layers.retain(|layer| layer.aov != Aov::Samples);
            Ok(rendered.picture)
        };
        Ok(Self([half(0)?, half(1)?]))
    }

    /// The even and the odd half.
    pub(super) const fn pictures(&self) -> &[Picture; 2] {
        &self.0
    }

    /// Adds the samples of `round`, which are `fresh`, where `blocks` wants them.
    pub(super) fn refine(&mut self, fresh: &Self, round: &Round<'_>, blocks: &Blocks) {
        let stride = round.interleave.stride() as usize;
        let old = if keeps(round.scene) { 1.0 / round.factor as f32 } else { 0.0 };
        let width = self.0[0].width as usize;
        // Even strata that lie in odd finer ones change halves.
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

    /// Gives the pictures' memory back.
    pub(super) fn recycle(self, backend: &mut dyn Backend) {
        self.0.into_iter().for_each(|picture| backend.recycle(picture));
    }

    /// The mean of both, before `behind` if there is anything; `even` writes the share of the even one for each pixel of a row.
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

/// Exchanges the pixels of some columns for which `which` is true, of column and row.
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

/// How two pictures become one.
struct Mixed<'a> {
    /// Of each row, where they do.
    columns: Columns<'a>,
    /// What the first has of each pixel.
    shares: Shares<'a>,
    /// What is then seen through it; `None`: it stays transparent.
    behind: Option<Vec3>,
}

impl Mixed<'_> {
    /// `a` becomes its share of itself and the rest of `b`. What is a mean over what is covered goes by coverage.
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
                            // Where one of them has nothing, its value may be infinite.
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
        let mixed = [0, 1, 2, 3].map(|c| share * a[c] + (1.0 - share) * b[c]);
        let Some(behind) = self.behind else { return mixed };
        let through = 1.0 - mixed[3];
        let seen = |c: usize| mixed[c] + through * behind[c];
        [seen(0), seen(1), seen(2), 1.0]
    }
}
