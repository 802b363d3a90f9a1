//! One shadow map: surfels are drawn onto it, and places ask it.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::ROUNDING;
use super::caster::{Caster, Casters, Onto, Plane};
use super::discs::Discs;
use super::fit::MapArea;
use super::layers::{Layers, Veil};
use super::run::Run;
use super::splats::Splats;
use crate::backend::cpu::columns::{Columns, RUN, lengths};
use crate::backend::cpu::tiles::LANES;
use crate::math::simd::dispatch;

/// Rows of a map that are drawn together.
const ROWS: usize = 32;

/// A map.
#[derive(Debug, Default)]
pub(super) struct ShadowMap {
    area: MapArea,
    /// Texels to a unit of length.
    scale: f32,
    /// Run by run.
    casters: Vec<Vec<Caster>>,
    /// Their planes: that of a caster has its number.
    planes: Vec<Plane>,
    /// More of those of see-through surfels, whose runs are the last.
    veils: Vec<Vec<Veil>>,
    ends: Ends,
    /// Those by captures; empty without any. They stop no light on captures, whose colours were photographed in their
    /// own shadows.
    by_captures: Ends,
    /// Texels from one row to the next.
    stride: usize,
}

/// Where light ends, row by row.
#[derive(Debug, Default)]
struct Ends {
    /// The least distance, tolerance included, at which it does; infinite where nothing stops it.
    end: Vec<f32>,
    /// The caster that stops it, if one does: the number of its run times [`RUN`], and its place in it.
    caster: Vec<u32>,
}

impl Ends {
    /// Nothing stops light in so many texels.
    fn clear(&mut self, texels: usize) {
        self.end.clear();
        self.end.resize(texels, f32::INFINITY);
        self.caster.clear();
        self.caster.resize(texels, u32::MAX);
    }

    /// Bands of so many texels, in order.
    fn bands(&mut self, texels: usize) -> impl IndexedParallelIterator<Item = (&mut [f32], &mut [u32])> {
        self.end.par_chunks_mut(texels).zip(self.caster.par_chunks_mut(texels))
    }
}

impl ShadowMap {
    pub(super) const BYTES_OF_TEXEL: u64 = 8;

    pub(super) const fn is_empty(&self) -> bool {
        self.area.size[0] == 0
    }

    /// Surfels that are drawn on it.
    #[cfg(test)]
    pub(super) fn casters(&self) -> usize {
        self.casters.iter().map(Vec::len).sum()
    }

    /// Draws `splats`, those of volumes first, and the surfels of `runs`, opaque ones first, that may cast a shadow on
    /// what receives one in an area that is not empty. The memory of an earlier map is used again.
    pub(super) fn draw(&mut self, on: &Onto<'_>, runs: &[Run<'_>], splats: &[Splats]) {
        self.area = *on.area;
        self.scale = 1.0 / self.area.texel;
        let [columns, rows] = self.area.size;
        let casts = |run: &&Run<'_>| run.casts && on.may_show(run.middle, run.half, run.object.epsilon);
        let runs: Vec<_> = runs.par_iter().filter(casts).collect();
        let splats: Vec<_> = splats.par_iter().filter(|of| on.may_show(of.middle, of.half, 0.0)).collect();
        let (opaque, veiled) = runs.split_at(runs.partition_point(|run| run.opacity.is_none()));
        // Opaque surfels, Gaussians of volumes and of captures, and see-through surfels.
        let first_of_capture = opaque.len() + splats.partition_point(|of| !of.of_capture);
        let (first_veil, count) = (opaque.len() + splats.len(), runs.len() + splats.len());
        self.casters.resize_with(count.max(self.casters.len()), Vec::new);
        self.casters.par_iter_mut().skip(count).for_each(Vec::clear);
        self.planes.resize((count * RUN).max(self.planes.len()), Plane::default());
        self.veils.resize_with(veiled.len().max(self.veils.len()), Vec::new);
        let (of_opaque, others) = self.casters.split_at_mut(opaque.len());
        let (of_splats, of_veils) = others.split_at_mut(splats.len());
        let (planes, others) = self.planes.split_at_mut(opaque.len() * RUN);
        let (planes_of_splats, planes_of_veils) = others.split_at_mut(splats.len() * RUN);
        of_opaque.par_iter_mut().zip(planes.par_chunks_mut(RUN)).zip(opaque).for_each(|(out, run)| {
            casters_of_run(run, on, out, None);
        });
        of_splats.par_iter_mut().zip(planes_of_splats.par_chunks_mut(RUN)).zip(&splats).for_each(|(out, splats)| {
            casters_of_splats(splats, on, out);
        });
        let of_veils = of_veils.par_iter_mut().zip(planes_of_veils.par_chunks_mut(RUN));
        of_veils.zip(&mut self.veils).zip(veiled).for_each(|((out, veils), run)| {
            casters_of_run(run, on, out, Some(veils));
        });
        // A row has room for the lanes that begin at its last texel.
        self.stride = columns + LANES;
        self.ends.clear(self.stride * rows);
        self.by_captures.clear(if first_of_capture < first_veil { self.stride * rows } else { 0 });
        let bands = rows.div_ceil(ROWS);
        let of_opaque = lists(&self.casters, 0..first_of_capture, bands);
        let of_captures = lists(&self.casters, first_of_capture..first_veil, bands);
        let of_veils = lists(&self.casters, first_veil..count, bands);
        let (casters, veils, stride) =
            (Casters { of_runs: &self.casters, planes: &self.planes }, &self.veils[..], self.stride);
        self.by_captures.bands(stride * ROWS).zip(&of_captures).enumerate().for_each(
            |(band, ((end, caster), list))| {
                draw_band(&casters, list, band * ROWS, stride, end, caster);
            },
        );
        self.ends.bands(stride * ROWS).zip(of_opaque.par_iter().zip(&of_veils)).enumerate().for_each(
            |(band, ((end, caster), (list, veiled)))| {
                draw_band(&casters, list, band * ROWS, stride, end, caster);
                if !veiled.is_empty() {
                    let layers = Layers {
                        casters: &casters,
                        veils,
                        first_run: first_veil,
                        list: veiled,
                        chances: on.chances,
                        first: band * ROWS,
                        stride,
                    };
                    layers.draw(end, caster);
                }
            },
        );
    }

    /// The shares of light, 0 or 1, that reach places relative to the eye in world axes, which lie there on the plane
    /// of the view: all of it outside the map.
    #[inline(always)]
    pub(super) fn lights<const N: usize>(
        &self,
        on_plane: &[[f32; N]; 3],
        places: &[[f32; N]; 3],
        is_point: bool,
    ) -> [f32; N] {
        let mut lit = self.are_before(&self.ends, on_plane, places, is_point);
        if !self.by_captures.end.is_empty() {
            let of_captures = self.are_before(&self.by_captures, on_plane, places, is_point);
            for l in 0..N {
                lit[l] &= of_captures[l];
            }
        }
        lit.map(|lit| if lit == 0 { 0.0 } else { 1.0 })
    }

    /// Does light reach a place of a capture?
    #[inline(always)]
    pub(super) fn lights_capture(&self, on_plane: [f32; 3], place: Vec3, is_point: bool) -> bool {
        self.are_before(&self.ends, &on_plane.map(|x| [x]), &place.to_array().map(|x| [x]), is_point) != [0]
    }

    /// 1 for each place that is before these ends of light, else 0.
    #[inline(always)]
    fn are_before<const N: usize>(
        &self,
        ends: &Ends,
        [x, y, distance]: &[[f32; N]; 3],
        places: &[[f32; N]; 3],
        is_point: bool,
    ) -> [u32; N] {
        let MapArea { first, size, .. } = self.area;
        let size = size.map(|size| size as u32);
        // Planes (x, y, 1), and tolerances.
        let mut planes = [[0.0; N]; 4];
        let (mut x, mut y, mut texel, mut is_on_map) = (*x, *y, [[0; N]; 2], [0; N]);
        for l in 0..N {
            (x[l], y[l]) = ((x[l] - first[0]) * self.scale, (y[l] - first[1]) * self.scale);
            (texel[0][l], texel[1][l]) = (x[l] as u32, y[l] as u32);
            let is_beyond = (texel[0][l] >= size[0]) | (texel[1][l] >= size[1]);
            is_on_map[l] = u32::from((x[l] >= 0.0) & (y[l] >= 0.0) & !is_beyond);
        }
        for l in 0..N {
            if is_on_map[l] == 0 {
                continue;
            }
            let at = texel[1][l] as usize * self.stride + texel[0][l] as usize;
            // Nothing stops light where no number of a caster stands.
            match self.planes.get(ends.caster[at] as usize) {
                Some(&Plane { distance: [a, b, c], tolerance }) => {
                    (planes[0][l], planes[1][l], planes[2][l], planes[3][l]) = (a, b, c, tolerance);
                }
                None => is_on_map[l] = 0,
            }
        }
        let sizes = lengths(places);
        let mut before = [0; N];
        for l in 0..N {
            let on_plane = planes[0][l] * (x[l] - 0.5) + planes[1][l] * (y[l] - 0.5) + planes[2][l];
            // Of -1 / distance that of the distance, over its square.
            let (size, scale) = (sizes[l], distance[l].abs());
            let rounding = ROUNDING * if is_point { scale * (1.0 + size * scale) } else { size + scale };
            before[l] = u32::from((is_on_map[l] == 0) | (distance[l] <= on_plane + planes[3][l] + rounding));
        }
        before
    }
}

dispatch! {
    /// The surfels of a run that are drawn, and their planes; and more of them, if light passes through.
    fn casters_of_run(
        run: &Run<'_>, on: &Onto<'_>, out: (&mut Vec<Caster>, &mut [Plane]), veils: Option<&mut Vec<Veil>>,
    ) = casters_of_run_body
}

#[inline(always)]
fn casters_of_run_body(
    run: &Run<'_>,
    on: &Onto<'_>,
    (casters, planes): (&mut Vec<Caster>, &mut [Plane]),
    mut veils: Option<&mut Vec<Veil>>,
) {
    casters.clear();
    if let Some(veils) = &mut veils {
        veils.clear();
    }
    let seen = run.seen_by(on.view);
    let mut columns = Columns::default();
    run.load(&mut columns);
    for first in (0..run.len).step_by(LANES) {
        let discs = seen.discs(&columns.lanes(first));
        Caster::of(&discs, LANES.min(run.len - first), run.object.epsilon, on, |l, caster, plane, moved| {
            planes[casters.len()] = plane;
            casters.push(caster);
            if let Some(veils) = &mut veils {
                veils.push(Veil { opacity: run.opacity_of(first + l), moved });
            }
        });
    }
}

dispatch! {
    /// The discs of Gaussians that are drawn, and their planes. Nothing but rounding moves them away.
    fn casters_of_splats(splats: &Splats, on: &Onto<'_>, out: (&mut Vec<Caster>, &mut [Plane])) = casters_of_splats_body
}

#[inline(always)]
fn casters_of_splats_body(splats: &Splats, on: &Onto<'_>, (casters, planes): (&mut Vec<Caster>, &mut [Plane])) {
    casters.clear();
    for discs in splats.discs.chunks(LANES) {
        Caster::of(&Discs::of(discs, on.view), discs.len(), 0.0, on, |_, caster, plane, _| {
            planes[casters.len()] = plane;
            casters.push(caster);
        });
    }
}

/// The numbers of the casters of some runs that reach into each band of rows, rising.
fn lists(casters: &[Vec<Caster>], runs: Range<usize>, bands: usize) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); bands];
    for (run, casters) in runs.clone().zip(&casters[runs]) {
        for (number, caster) in (run * RUN..).zip(casters) {
            let [first, last] = caster.bounds[1].map(|row| usize::from(row) / ROWS);
            lists[first..=last].iter_mut().for_each(|list| list.push(number as u32));
        }
    }
    lists
}

dispatch! {
    /// Draws the casters of a list onto a band that begins at row `first`.
    fn draw_band(
        casters: &Casters<'_>, list: &[u32], first: usize, stride: usize, end: &mut [f32], caster: &mut [u32],
    ) = draw_band_body
}

#[inline(always)]
fn draw_band_body(
    casters: &Casters<'_>,
    list: &[u32],
    first: usize,
    stride: usize,
    end: &mut [f32],
    caster: &mut [u32],
) {
    let rows = end.len() / stride;
    for &number in list {
        let (of, plane) = casters.of(number);
        let [[left, right], [top, bottom]] = of.bounds.map(|ends| ends.map(usize::from));
        for y in top.max(first)..=bottom.min(first + rows - 1) {
            let row = of.on_row(plane, y);
            for x in (left..=right).step_by(LANES) {
                let begin = (y - first) * stride + x;
                let Some(end) = end[begin..].first_chunk_mut::<LANES>() else { continue };
                let Some(caster) = caster[begin..].first_chunk_mut::<LANES>() else { continue };
                let distance = of.ends(plane, row, x);
                // What it does not cover is not a number here.
                let before = *end;
                for l in 0..LANES {
                    let stops = 0_u32.wrapping_sub(u32::from(distance[l] < before[l]));
                    caster[l] = number & stops | caster[l] & !stops;
                }
                // In this form it is a minimum, and stored whole. What is stored under a mask is slow to read again.
                for l in 0..LANES {
                    end[l] = if distance[l] < before[l] { distance[l] } else { before[l] };
                }
            }
        }
    }
}
