//! The CPU's passes of step `Paint`, for comparison with another backend's.
//!
//! What they read is made by the constructors that rendering uses ([`PaintGroup`]). Only tiles have another size.

use super::posed::{self, Posed};
use super::tiles_of_edge::{rect, take_rows, touches};
use crate::backend::cpu::paint::attribute::{self, Filter};
use crate::backend::cpu::paint::buffers::{APRON_STRIDE, DepthLayer, EXTRA, with_apron};
use crate::backend::cpu::paint::{Kernel, PaintGroup, RasterRays, visibility};
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tiles::{STRIDE, TILE};
use crate::backend::cpu::values;

/// One group, in tiles of another size than the CPU's own.
pub(super) struct PaintTwins<'a, K> {
    pub group: PaintGroup<'a, K>,
    /// Edge of a tile, at most 32 pixels.
    pub edge: usize,
}

/// What all passes make of a tile.
#[derive(Default)]
pub(super) struct PaintedTile {
    buffers: TileBuffers,
    film: TileFilm,
}

impl<'a, K: Kernel> PaintTwins<'a, K> {
    pub(super) fn scope(&self) -> &Scope<'a> {
        &self.group.scope
    }

    pub(super) fn project(&self) -> Vec<Posed<'a, K>> {
        posed::project(self.scope())
    }

    /// Pixels around a tile of which depths are known.
    pub(super) fn apron(&self) -> usize {
        if K::FILTERED { self.scope().raster.apron() } else { 0 }
    }

    /// All passes of a tile, one after the other.
    pub(super) fn run(&self, posed: &[Posed<'_, K>], tile: [usize; 2]) -> PaintedTile {
        let scope = self.scope();
        let (apron, size) = (self.apron(), scope.raster.size);
        let tile = rect(&scope.band, tile, self.edge);
        let (guarded, [left, top]) = with_apron(&tile, apron, size);
        let start = top * APRON_STRIDE + left;
        let lists: Vec<Vec<u32>> =
            posed.iter().map(|posed| touches(posed.splats.iter().map(K::bounds), tile.tile, self.edge)).collect();
        let mut buffers = TileBuffers::default();
        buffers.paint.clear_depths(K::FILTERED, scope.frame.keeps_nearest);
        for (Posed { chunk, splats }, list) in posed.iter().zip(&lists) {
            visibility::visibility(splats, list, scope.depths(chunk), &guarded, &mut buffers.paint);
        }
        if scope.frame.has_layers(K::FILTERED) {
            visibility::find_open(&tile, apron, size, self.group.least_tolerance(false), &mut buffers.paint);
            for (Posed { chunk, splats }, list) in posed.iter().zip(&lists) {
                visibility::second(splats, list, scope.depths(chunk), &tile, start, &mut buffers.paint);
            }
        }
        buffers.paint.clear_sums(scope.channels.count, K::FILTERED);
        buffers.clear_coverage(scope.group.samples.len());
        for (Posed { chunk, splats }, list) in posed.iter().zip(&lists) {
            scope.turn(chunk, &mut buffers);
            let mut of_splats = Vec::new();
            values::values(splats, &scope.shown(chunk), &mut of_splats);
            let attributes = scope.attributes(chunk, &of_splats);
            let sight = RasterRays::new(scope.frame.near, scope.raster);
            let filter = Filter { attributes, depths: scope.depths(chunk), sight, start, ceiling: &[] };
            let TileBuffers { paint, group_coverage, .. } = &mut buffers;
            attribute::attribute(splats, list, &filter, &tile, paint, &mut group_coverage.sample_coverage);
        }
        scope.end_turns(&mut buffers);
        let mut film = TileFilm::default();
        K::resolve(&scope.resolve(), &tile, start, &buffers.paint, &buffers.group_coverage.coverage, &mut film);
        PaintedTile { buffers, film }
    }

    /// T where the CPU knows it, in rows of `columns` from pixel `-before` of the tile: `None` elsewhere.
    pub(super) fn thresholds(
        &self,
        of: &PaintedTile,
        tile: [usize; 2],
        before: [usize; 2],
        size: [usize; 2],
    ) -> Vec<Option<f32>> {
        let tile = rect(&self.scope().band, tile, self.edge);
        let (guarded, [left, top]) = with_apron(&tile, self.apron(), self.scope().raster.size);
        let at = |x: usize, y: usize| {
            let (x, y) = ((x + left).checked_sub(before[0])?, (y + top).checked_sub(before[1])?);
            (x < guarded.width && y < guarded.height).then(|| of.buffers.paint.threshold[y * APRON_STRIDE + x])
        };
        (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).map(|(x, y)| at(x, y)).collect()
    }

    /// Depths of the nearest discs, `edge` x `edge`.
    pub(super) fn nearest(&self, of: &PaintedTile, tile: [usize; 2]) -> Vec<f32> {
        let tile = rect(&self.scope().band, tile, self.edge);
        let (_, [left, top]) = with_apron(&tile, self.apron(), self.scope().raster.size);
        take_rows(&of.buffers.paint.nearest[top * APRON_STRIDE + left..], APRON_STRIDE, self.edge)
    }

    /// The threshold behind T, `edge` x `edge`: `None` where a pixel is solid.
    pub(super) fn second(&self, of: &PaintedTile) -> Vec<Option<f32>> {
        let second = take_rows(&of.buffers.paint.second, STRIDE, self.edge).into_iter();
        second.zip(self.bits(&of.buffers.paint.open)).map(|(second, open)| open.then_some(second)).collect()
    }

    /// Whether there is a pixel nearby that no disc covers, `edge` x `edge`.
    pub(super) fn rim(&self, of: &PaintedTile) -> Vec<bool> {
        self.bits(&of.buffers.paint.rim)
    }

    /// Whether a pixel lies in the image, `edge` x `edge`.
    pub(super) fn inside(&self, tile: [usize; 2]) -> Vec<bool> {
        let tile = rect(&self.scope().band, tile, self.edge);
        (0..self.edge * self.edge).map(|i| i % self.edge < tile.width && i / self.edge < tile.height).collect()
    }

    fn bits(&self, rows: &[u32]) -> Vec<bool> {
        (0..self.edge * self.edge).map(|i| rows[i / self.edge] >> (i % self.edge) & 1 != 0).collect()
    }

    /// Sums of a tile, layer by layer and channel by channel. Groups of several samples have one layer, and their
    /// coverage at its end.
    pub(super) fn sums(&self, of: &PaintedTile) -> Vec<Vec<Vec<f32>>> {
        let TileBuffers { paint, group_coverage, .. } = &of.buffers;
        let channels = self.scope().channels.count;
        let row = paint.row;
        let none = vec![0.0; self.edge * self.edge];
        let planes = |layer: DepthLayer, count: usize| -> Vec<Vec<f32>> {
            let sums = &paint.sums[layer as usize];
            let plane = |c: usize| match sums[..] {
                [] => none.clone(),
                _ => take_rows(&sums[c * STRIDE..], row, self.edge),
            };
            (0..count).map(plane).collect()
        };
        if self.scope().group.samples.len() == 1 {
            if K::FILTERED {
                return DepthLayer::ALL.map(|layer| planes(layer, channels + EXTRA)).into();
            }
            return vec![planes(DepthLayer::Band, channels)];
        }
        let coverage = [&group_coverage.sample_coverage, &group_coverage.coverage, &group_coverage.of_static];
        let coverage = coverage.map(|plane| match plane[..] {
            [] => none.clone(),
            _ => take_rows(plane, STRIDE, self.edge),
        });
        vec![[planes(DepthLayer::Band, channels), coverage.into()].concat()]
    }

    /// Film of a tile after the group alone: plane by plane.
    pub(super) fn film(&self, of: &PaintedTile) -> Vec<Vec<f32>> {
        let plane = |p: usize| match of.film.values[..] {
            [] => vec![0.0; self.edge * self.edge],
            _ => take_rows(&of.film.values[p * TILE * TILE..], TILE, self.edge),
        };
        (0..self.scope().planes.count).map(plane).collect()
    }
}
