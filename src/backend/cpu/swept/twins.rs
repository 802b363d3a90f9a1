//! The passes of an interval one at a time, for tests that compare another backend's with them.

use super::{Exposure, Footprint, Map, MapTile, StillTile, Swept, Volume, coverage, keep, pool};
use crate::backend::cpu::attribute::{self, Attributes, Tally};
use crate::backend::cpu::project::{self, View};
use crate::backend::cpu::resolve::{self, Resolve, TileFilm};
use crate::backend::cpu::tiles::{Band, STRIDE, TILE, TileBuffers, TileRect};
use crate::backend::cpu::values::{self, Shown};
use crate::backend::cpu::visibility::{self, Depths};
use crate::film::FilmPlanes;
use crate::frame::{Frame, PosedGroup};
use crate::layout::{Channels, Splat, SweptSplat};
use crate::options::{KernelShape, Normalise, Prefilter, SweptKernel, TemporalAlpha};

/// Splats of one object, in surfel order.
#[derive(Clone, Debug)]
pub(in crate::backend) struct Of<S> {
    pub object: usize,
    pub splats: Vec<S>,
}

/// The map of a group.
pub(in crate::backend) struct Kept(Map);

/// Sums of a tile: channel by channel, `edge` x `edge`; and when kernels cover.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct SweptSums {
    pub channels: Vec<Vec<f32>>,
    pub surface: Vec<u32>,
    pub low_pass: Vec<u32>,
    pub loose: Vec<f32>,
}

/// One group of an interval, in tiles of another size than the backend's own.
#[derive(Clone, Copy)]
pub(in crate::backend) struct SweptTwins<'a> {
    pub frame: &'a Frame<'a>,
    pub group: &'a PosedGroup,
    pub kernel: SweptKernel,
    /// Edge of a tile, at most 32 pixels.
    pub edge: usize,
}

impl SweptTwins<'_> {
    fn band(&self) -> Band {
        let size = self.group.raster.size;
        Band::new(size, [0, (size[1] as usize).div_ceil(TILE)])
    }

    fn around(&self) -> Band {
        self.band().guarded(self.group.interval.map_or(0, |interval| interval.guard))
    }

    fn view(&self, object: usize, band: &Band) -> View<'_> {
        View {
            object: &self.group.samples[0].objects[object],
            raster: self.group.raster,
            pixels: band.pixels,
            corner: band.corner,
            wanted: None,
            near: self.frame.near,
            low_pass: self.frame.prefilter == Prefilter::Approx,
            two_sided: self.frame.objects[object].two_sided,
            clusters: None,
        }
    }

    /// What lies still comes first, or not at all where it has a picture of its own.
    fn visible(&self) -> impl Iterator<Item = usize> {
        let objects = &self.group.samples[0].objects;
        let of = move |still| {
            (0..objects.len()).filter(move |&i| objects[i].visible && self.frame.objects[i].still == still)
        };
        let still = of(true).filter(|_| !self.frame.has_still_picture());
        still.chain(of(false))
    }

    /// Splats at mid-interval, on the map.
    pub(in crate::backend) fn project(&self) -> Vec<Of<Splat>> {
        let band = self.around();
        let of = |object: usize| {
            let (mut splats, surfels) = (Vec::new(), self.frame.objects[object].surfels);
            project::project(&self.view(object, &band), surfels, 0..surfels.len(), &mut splats);
            Of { object, splats }
        };
        self.visible().map(of).collect()
    }

    /// Kernels in motion.
    pub(in crate::backend) fn sweep(&self) -> Vec<Of<SweptSplat>> {
        let band = self.band();
        let volume =
            Volume { ellipsoid: self.kernel.shape == KernelShape::Ellipsoid, stretch: self.kernel.stretch() as f32 };
        let of = |object: usize| {
            let (mut splats, surfels) = (Vec::new(), self.frame.objects[object].surfels);
            super::project(&self.view(object, &band), volume, surfels, 0..surfels.len(), &mut splats);
            Of { object, splats }
        };
        self.visible().map(of).collect()
    }

    fn rect(&self, band: &Band, tile: [usize; 2]) -> TileRect {
        let origin = tile.map(|i| i * self.edge);
        let [x0, x1, y0, y1] = band.pixels;
        let size = [x1 + 1 - x0, y1 + 1 - y0].map(|pixels| pixels as usize);
        let [width, height] = [0, 1].map(|i| (size[i] - origin[i]).min(self.edge));
        TileRect { tile, origin, corner: [0, 1].map(|i| band.corner[i] + origin[i] as i32), width, height }
    }

    fn list(&self, bounds: impl Iterator<Item = [u16; 4]>, tile: [usize; 2]) -> Vec<u32> {
        let touches = |bounds: [u16; 4]| {
            let [x0, x1, y0, y1] = bounds.map(|pixel| usize::from(pixel) / self.edge);
            (x0..=x1).contains(&tile[0]) && (y0..=y1).contains(&tile[1])
        };
        bounds.enumerate().filter(|(_, bounds)| touches(*bounds)).map(|(i, _)| i as u32).collect()
    }

    /// Thresholds of a tile of the map.
    pub(in crate::backend) fn visibility(&self, still: &[Of<Splat>], tile: [usize; 2]) -> Vec<f32> {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        for Of { object, splats } in still {
            let depths = Depths { near: self.frame.near, epsilon: self.group.samples[0].objects[*object].epsilon };
            let list = self.list(splats.iter().map(|splat| splat.bounds), tile);
            visibility::visibility(splats, &list, depths, &self.rect(&self.around(), tile), &mut buffers.threshold);
        }
        self.take(&buffers.threshold, STRIDE)
    }

    fn attributes<'b>(&'b self, values: &'b [f32], channels: &'b Channels) -> Attributes<'b> {
        Attributes {
            channels,
            near: self.frame.near,
            low_pass: if self.frame.prefilter == Prefilter::Approx { self.group.raster.low_pass } else { 0.0 },
            share: 1.0,
            values,
        }
    }

    /// Sums of weights of a tile of the map.
    pub(in crate::backend) fn density(&self, still: &[Of<Splat>], tile: [usize; 2], thresholds: &[f32]) -> Vec<f32> {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        buffers.clear_sums(1, 1);
        self.put(thresholds, &mut buffers.threshold, STRIDE);
        let channels = Channels::weights();
        for Of { splats, .. } in still {
            let list = self.list(splats.iter().map(|splat| splat.bounds), tile);
            let (rect, TileBuffers { threshold, sums, .. }) = (self.rect(&self.around(), tile), &mut buffers);
            let attributes = self.attributes(&[], &channels);
            let mut tally = Tally { sums, reach: &mut [], nearest: &mut [] };
            attribute::attribute(splats, &list, &attributes, &rect, threshold, &mut tally);
        }
        self.take(&buffers.sums, STRIDE)
    }

    /// A tile of the map; without `density` weights were not summed.
    pub(in crate::backend) fn keep(&self, tile: [usize; 2], thresholds: &[f32], density: &[f32]) -> Vec<[f32; 2]> {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        self.put(thresholds, &mut buffers.threshold, STRIDE);
        if !density.is_empty() {
            buffers.clear_sums(1, 1);
            self.put(density, &mut buffers.sums, STRIDE);
        }
        let mut out: MapTile = [[f32::INFINITY; 2]; TILE * TILE];
        keep(&self.rect(&self.around(), tile), &buffers.threshold, &buffers.sums, &mut out);
        self.take(&out, TILE)
    }

    /// The map, from its tiles in rows of `tiles_x`.
    pub(in crate::backend) fn map(&self, tiles: &[Vec<[f32; 2]>], tiles_x: usize) -> Kept {
        let mut map = Map::default();
        let around = self.around();
        let (edge, rows) = (self.edge, tiles.len() / tiles_x.max(1));
        for (index, out) in map.lay(&around).iter_mut().enumerate() {
            let [x0, y0] = around.tile(index).origin;
            for (i, out) in out.iter_mut().enumerate() {
                let (x, y) = (x0 + i % TILE, y0 + i / TILE);
                if x / edge < tiles_x && y / edge < rows {
                    *out = tiles[y / edge * tiles_x + x / edge][y % edge * edge + x % edge];
                }
            }
        }
        Kept(map)
    }

    /// Sums of a tile of the image, of which `thresholds` are those of what lies still.
    pub(in crate::backend) fn attribute(
        &self,
        moving: &[Of<SweptSplat>],
        tile: [usize; 2],
        map: &Kept,
        thresholds: &[f32],
    ) -> SweptSums {
        let channels = Channels::of(self.frame);
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        self.put(thresholds, &mut buffers.threshold, STRIDE);
        buffers.clear_sums(channels.count, 1);
        buffers.clear_presence();
        let Some(interval) = &self.group.interval else { return SweptSums::default() };
        for Of { object, splats } in moving {
            let list = self.list(splats.iter().map(|splat| splat.bounds), tile);
            let sample = &self.group.samples[0];
            let shown = Shown {
                sample,
                posed: &sample.objects[*object],
                object: &self.frame.objects[*object],
                channels: &channels,
                shading: self.frame.shading,
                near: self.frame.near,
                stride: self.frame.stride as f32,
            };
            let mut values = Vec::new();
            values::values(splats, &shown, &mut values);
            let swept = Swept {
                attributes: self.attributes(&values, &channels),
                footprint: Footprint::of(self.kernel),
                source_samples: self.kernel.source_samples.0,
                slope: interval.slope,
                sum: self.kernel.alpha == TemporalAlpha::Sum,
                map: &map.0,
            };
            let (rect, TileBuffers { threshold, sums, presence, .. }) = (self.rect(&self.band(), tile), &mut buffers);
            super::attribute(splats, &list, &swept, &rect, threshold, sums, presence);
        }
        let channel = |c: usize| self.take(&buffers.sums[c * STRIDE..], channels.count * STRIDE);
        SweptSums {
            channels: (0..channels.count).map(channel).collect(),
            surface: self.take(&buffers.presence.surface, STRIDE),
            low_pass: self.take(&buffers.presence.low_pass, STRIDE),
            loose: self.take(&buffers.presence.loose, STRIDE),
        }
    }

    /// Film of a tile after the group alone: plane by plane, `edge` x `edge`; not finished. `still`: that of what lies still.
    pub(in crate::backend) fn resolve(&self, tile: [usize; 2], sums: &SweptSums, still: &[Vec<f32>]) -> Vec<Vec<f32>> {
        let Self { frame, group, .. } = *self;
        let (channels, planes) = (Channels::of(frame), FilmPlanes::of(frame.aovs));
        let once = self.kernel.normalise == Normalise::Once;
        let planes = if once { planes.pooled() } else { planes };
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        buffers.clear_sums(channels.count, 1);
        buffers.clear_presence();
        for (c, channel) in sums.channels.iter().enumerate() {
            self.put(channel, &mut buffers.sums[c * STRIDE..], channels.count * STRIDE);
        }
        self.put(&sums.surface, &mut buffers.presence.surface, STRIDE);
        self.put(&sums.low_pass, &mut buffers.presence.low_pass, STRIDE);
        self.put(&sums.loose, &mut buffers.presence.loose, STRIDE);
        let Some(interval) = &group.interval else { return Vec::new() };
        let weight = group.samples[0].weight;
        let exposure = Exposure { interval, weight, sum: self.kernel.alpha == TemporalAlpha::Sum };
        let (mut covered, mut film) = (Vec::new(), TileFilm::default());
        coverage(&exposure, &buffers.presence, &mut covered);
        let rect = self.rect(&self.band(), tile);
        if once {
            pool(weight, &channels, &planes, &rect, &buffers.sums, &covered, &mut film.values);
        } else {
            let resolve = Resolve {
                sample: &group.samples[0],
                weight,
                channels: &channels,
                planes: &planes,
                shading: frame.shading,
                raster: &group.raster,
            };
            resolve::resolve(&resolve, &rect, &buffers.threshold, &buffers.sums, &covered, &mut film);
        }
        if frame.has_still_picture() {
            let mut tile =
                StillTile { film: TileFilm { values: vec![0.0; planes.count * TILE * TILE] }, ..StillTile::default() };
            for (p, plane) in still.iter().enumerate() {
                self.put(plane, &mut tile.film.values[p * TILE * TILE..], TILE);
            }
            tile.show(weight, &covered, planes.weight, &rect, &mut film);
        }
        (0..planes.count).map(|p| self.take(&film.values[p * TILE * TILE..], TILE)).collect()
    }

    /// The first `edge` of each of `edge` rows that are `stride` apart.
    fn take<T: Copy>(&self, values: &[T], stride: usize) -> Vec<T> {
        (0..self.edge).flat_map(|y| values[y * stride..][..self.edge].iter().copied()).collect()
    }

    fn put<T: Copy>(&self, values: &[T], out: &mut [T], stride: usize) {
        for (y, row) in values.chunks(self.edge).enumerate() {
            out[y * stride..][..self.edge].copy_from_slice(row);
        }
    }
}
