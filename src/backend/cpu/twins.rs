//! The passes one at a time, for tests that compare another backend's with them.

use super::attribute::{self, Attributes, Tally};
use super::layer::LayerTile;
use super::project::{self, View};
use super::resolve::{self, Resolve, TileFilm};
use super::tiles::{ROWS, STRIDE, TILE, TileBuffers, TileRect};
use super::values::{self, Shown};
use super::visibility::{self, Depths};
use crate::film::FilmPlanes;
use crate::frame::{Frame, PosedGroup};
use crate::layout::{Channels, Splat};
use crate::options::Prefilter;

/// Splats of one object at one sample, in surfel order; those of one that lies still are of the first.
#[derive(Clone, Debug)]
pub(in crate::backend) struct Posed {
    pub sample: usize,
    pub object: usize,
    pub splats: Vec<Splat>,
}

/// Sums of a tile: channel by channel, `edge` x `edge`; what follows the channels only for groups of several samples.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Sums {
    pub channels: Vec<Vec<f32>>,
    pub reach: Vec<f32>,
    pub coverage: Vec<f32>,
    /// Reach of what lies still.
    pub still: Vec<f32>,
}

/// What lies still in a tile, `edge` x `edge`, and what a group that starts from it has before what moves is added.
pub(in crate::backend) struct Recalled {
    pub layer_thresholds: Vec<f32>,
    pub layer: Sums,
    pub nearest: Vec<f32>,
    pub sums: Sums,
    /// Thresholds where sums must be added up anew, else negative.
    pub limits: Vec<f32>,
}

/// One group, and tiles of another size than the backend's own.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Twins<'a> {
    pub frame: &'a Frame<'a>,
    pub group: &'a PosedGroup,
    /// Edge of a tile, at most 32 pixels.
    pub edge: usize,
}

impl Twins<'_> {
    pub(in crate::backend) fn project(&self) -> Vec<Posed> {
        let Self { frame, group, .. } = *self;
        let mut out = Vec::new();
        let all = (0..group.samples.len()).map(|sample| (sample, false));
        for (sample, still) in std::iter::once((0, true)).chain(all) {
            let of_sample = group.samples[sample].objects.iter().enumerate();
            for (object, pose) in of_sample.filter(|(i, pose)| pose.visible && frame.objects[*i].still == still) {
                let view = View {
                    object: pose,
                    raster: group.raster,
                    pixels: [0, group.raster.size[0] as i32 - 1, 0, group.raster.size[1] as i32 - 1],
                    corner: [0; 2],
                    wanted: None,
                    near: frame.near,
                    low_pass: frame.prefilter == Prefilter::Approx,
                    two_sided: frame.objects[object].two_sided,
                    clusters: None,
                };
                let surfels = frame.objects[object].surfels;
                let mut splats = Vec::new();
                project::project(&view, surfels, 0..surfels.len(), &mut splats);
                out.push(Posed { sample, object, splats });
            }
        }
        out
    }

    fn rect(&self, tile: [usize; 2]) -> TileRect {
        let origin = tile.map(|i| i * self.edge);
        let [width, height] = [0, 1].map(|i| (self.group.raster.size[i] as usize - origin[i]).min(self.edge));
        TileRect { tile, origin, corner: origin.map(|i| i as i32), width, height }
    }

    /// Splats of `posed` that may touch the tile.
    pub(in crate::backend) fn list(&self, posed: &Posed, tile: [usize; 2]) -> Vec<u32> {
        let touches = |splat: &Splat| {
            let [x0, x1, y0, y1] = splat.bounds.map(|pixel| usize::from(pixel) / self.edge);
            (x0..=x1).contains(&tile[0]) && (y0..=y1).contains(&tile[1])
        };
        (0..posed.splats.len() as u32).filter(|&i| touches(&posed.splats[i as usize])).collect()
    }

    /// Thresholds of a tile, `edge` x `edge`.
    pub(in crate::backend) fn visibility(&self, posed: &[Posed], tile: [usize; 2]) -> Vec<f32> {
        let mut buffers = TileBuffers::default();
        buffers.clear_threshold();
        for posed in posed {
            let epsilon = self.group.samples[posed.sample].objects[posed.object].epsilon;
            let depths = Depths { near: self.frame.near, epsilon };
            let list = self.list(posed, tile);
            visibility::visibility(&posed.splats, &list, depths, &self.rect(tile), &mut buffers.threshold);
        }
        self.take(|y| &buffers.threshold[y * STRIDE..])
    }

    pub(in crate::backend) fn attribute(&self, posed: &[Posed], tile: [usize; 2], thresholds: &[f32]) -> Sums {
        let group = self.group;
        let mut buffers = TileBuffers::default();
        self.put(thresholds, &mut buffers);
        buffers.clear_sums(Channels::of(self.frame).count, group.samples.len());
        self.add(posed, tile, &mut buffers, &mut []);
        if group.samples.len() > 1 {
            buffers.union.turn(|sample| group.samples[sample].weight, group.samples.len());
        }
        self.sums(&buffers)
    }

    /// Starts pass `attribute` from what lies still in a tile.
    pub(in crate::backend) fn recall(&self, posed: &[Posed], tile: [usize; 2], thresholds: &[f32]) -> Recalled {
        let (channels, samples) = (Channels::of(self.frame).count, self.group.samples.len());
        let still: Vec<Posed> = posed.iter().filter(|posed| self.frame.objects[posed.object].still).cloned().collect();
        let layer_thresholds = self.visibility(&still, tile);
        let mut buffers = TileBuffers::default();
        self.put(&layer_thresholds, &mut buffers);
        buffers.clear_sums(channels, samples);
        let mut nearest = vec![f32::INFINITY; ROWS * STRIDE];
        self.add(&still, tile, &mut buffers, &mut nearest);
        let layer = LayerTile::of(&buffers, &nearest, TileFilm::default());
        let of_layer = self.sums(&buffers);
        self.put(thresholds, &mut buffers);
        buffers.clear_sums(channels, samples);
        let limits = layer.recall(channels, &mut buffers).unwrap_or_else(|| vec![f32::NEG_INFINITY; ROWS * STRIDE]);
        Recalled {
            layer_thresholds,
            layer: of_layer,
            nearest: self.take(|y| &nearest[y * STRIDE..]),
            sums: self.sums(&buffers),
            limits: self.take(|y| &limits[y * STRIDE..]),
        }
    }

    /// Adds the splats of `posed` to the buffers' sums.
    fn add(&self, posed: &[Posed], tile: [usize; 2], buffers: &mut TileBuffers, nearest: &mut [f32]) {
        let Self { frame, group, .. } = *self;
        let channels = Channels::of(frame);
        let total: f32 = group.samples.iter().map(|sample| sample.weight).sum();
        let TileBuffers { threshold, sums, union, .. } = buffers;
        for posed in posed {
            let sample = &group.samples[posed.sample];
            let still = frame.objects[posed.object].still;
            if group.samples.len() > 1 && !still {
                union.turn(|sample| group.samples[sample].weight, posed.sample);
            }
            let shown = Shown {
                sample,
                posed: &sample.objects[posed.object],
                object: &frame.objects[posed.object],
                channels: &channels,
                shading: frame.shading,
                near: frame.near,
                stride: frame.stride as f32,
            };
            let mut values = Vec::new();
            values::values(&posed.splats, &shown, &mut values);
            let attributes = Attributes {
                channels: &channels,
                near: frame.near,
                low_pass: if frame.prefilter == Prefilter::Approx { group.raster.low_pass } else { 0.0 },
                share: if total > 0.0 && !still { sample.weight / total } else { 1.0 },
                values: &values,
            };
            let list = self.list(posed, tile);
            let mut tally = Tally { sums, reach: &mut union.reach, nearest };
            attribute::attribute(&posed.splats, &list, &attributes, &self.rect(tile), threshold, &mut tally);
        }
    }

    fn sums(&self, buffers: &TileBuffers) -> Sums {
        let channels = Channels::of(self.frame).count;
        let plane = |values: &[f32]| match values {
            [] => Vec::new(),
            _ => self.take(|y| &values[y * STRIDE..]),
        };
        Sums {
            channels: (0..channels).map(|c| self.take(|y| &buffers.sums[(y * channels + c) * STRIDE..])).collect(),
            reach: plane(&buffers.union.reach),
            coverage: plane(&buffers.union.coverage),
            still: plane(&buffers.union.still),
        }
    }

    /// Film of a tile after the group alone: plane by plane, `edge` x `edge`.
    pub(in crate::backend) fn resolve(&self, tile: [usize; 2], thresholds: &[f32], sums: &Sums) -> Vec<Vec<f32>> {
        let Self { frame, group, .. } = *self;
        let (channels, planes) = (Channels::of(frame), FilmPlanes::of(frame.aovs));
        let mut buffers = TileBuffers::default();
        self.put(thresholds, &mut buffers);
        buffers.clear_sums(channels.count, group.samples.len());
        for (c, channel) in sums.channels.iter().enumerate() {
            for (y, row) in channel.chunks(self.edge).enumerate() {
                buffers.sums[(y * channels.count + c) * STRIDE..][..self.edge].copy_from_slice(row);
            }
        }
        for (y, row) in sums.coverage.chunks(self.edge).enumerate() {
            buffers.union.coverage[y * STRIDE..][..self.edge].copy_from_slice(row);
        }
        let samples = &group.samples;
        let resolve = Resolve {
            sample: &samples[samples.len() / 2],
            weight: samples[0].weight,
            channels: &channels,
            planes: &planes,
            shading: frame.shading,
            raster: &group.raster,
        };
        let mut film = TileFilm::default();
        let TileBuffers { threshold, sums, union, .. } = &buffers;
        resolve::resolve(&resolve, &self.rect(tile), threshold, sums, &union.coverage, &mut film);
        (0..planes.count).map(|p| self.take(|y| &film.values()[(p * TILE + y) * TILE..])).collect()
    }

    /// The first `edge` of each row.
    fn take<'b>(&self, row: impl Fn(usize) -> &'b [f32]) -> Vec<f32> {
        (0..self.edge).flat_map(|y| row(y)[..self.edge].to_vec()).collect()
    }

    fn put(&self, thresholds: &[f32], buffers: &mut TileBuffers) {
        buffers.clear_threshold();
        for (y, row) in thresholds.chunks(self.edge).enumerate() {
            buffers.threshold[y * STRIDE..][..self.edge].copy_from_slice(row);
        }
    }
}
