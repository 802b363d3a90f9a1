//! The passes one at a time, for tests that compare another backend's with them.

use super::attribute::{self, Attributes, Tally};
use super::lit;
use super::project::{self, View};
use super::resolve::{self, Resolve, TileFilm};
use super::tiles::{STRIDE, TILE, TileBuffers, TileRect};
use super::visibility::{self, Depths};
use crate::film::FilmPlanes;
use crate::frame::{Frame, PosedGroup};
use crate::layout::{Channels, Splat};
use crate::plan::{Prefilter, Shading};

/// Splats of one object at one sample, in surfel order.
#[derive(Clone, Debug)]
pub(in crate::backend) struct Posed {
    pub sample: usize,
    pub object: usize,
    pub splats: Vec<Splat>,
}

/// Sums of a tile: channel by channel, `edge` x `edge`; reach and coverage only for groups of several samples.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Sums {
    pub channels: Vec<Vec<f32>>,
    pub reach: Vec<f32>,
    pub coverage: Vec<f32>,
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
        for (sample, posed) in group.samples.iter().enumerate() {
            for (object, pose) in posed.objects.iter().enumerate().filter(|(_, pose)| pose.visible) {
                let view = View {
                    object: pose,
                    raster: group.raster,
                    pixels: [0, group.raster.size[0] as i32 - 1, 0, group.raster.size[1] as i32 - 1],
                    corner: [0; 2],
                    wanted: None,
                    near: frame.near,
                    low_pass: frame.prefilter == Prefilter::Approx,
                    two_sided: frame.objects[object].two_sided,
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
        let Self { frame, group, .. } = *self;
        let channels = Channels::of(frame);
        let mut buffers = TileBuffers::default();
        self.put(thresholds, &mut buffers);
        buffers.clear_sums(channels.count, group.samples.len());
        let total: f32 = group.samples.iter().map(|sample| sample.weight).sum();
        let union = &mut buffers.union;
        for posed in posed {
            let sample = &group.samples[posed.sample];
            if group.samples.len() > 1 {
                union.turn(|sample| group.samples[sample].weight, posed.sample);
            }
            let mut attributes = Attributes {
                sample,
                posed: &sample.objects[posed.object],
                object: &frame.objects[posed.object],
                channels: &channels,
                near: frame.near,
                low_pass: if frame.prefilter == Prefilter::Approx { group.raster.low_pass } else { 0.0 },
                stride: frame.stride as f32,
                share: if total > 0.0 { sample.weight / total } else { 1.0 },
                lit: &[],
            };
            let mut lit = Vec::new();
            if frame.shading == Shading::Gouraud {
                lit::light(&posed.splats, &attributes, &mut lit);
                attributes.lit = &lit;
            }
            let list = self.list(posed, tile);
            let mut tally = Tally { sums: &mut buffers.sums, reach: &mut union.reach, nearest: &mut [] };
            attribute::attribute(&posed.splats, &list, &attributes, &self.rect(tile), &buffers.threshold, &mut tally);
        }
        if group.samples.len() > 1 {
            union.turn(|sample| group.samples[sample].weight, group.samples.len() - 1);
        }
        let plane = |values: &[f32]| match values {
            [] => Vec::new(),
            _ => self.take(|y| &values[y * STRIDE..]),
        };
        Sums {
            channels: (0..channels.count)
                .map(|c| self.take(|y| &buffers.sums[(y * channels.count + c) * STRIDE..]))
                .collect(),
            reach: plane(&union.reach),
            coverage: plane(&union.coverage),
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
        for (plane, values) in [(&mut buffers.union.reach, &sums.reach), (&mut buffers.union.coverage, &sums.coverage)]
        {
            for (y, row) in values.chunks(self.edge).enumerate() {
                plane[y * STRIDE..][..self.edge].copy_from_slice(row);
            }
        }
        let samples = &group.samples;
        if samples.len() > 1 {
            buffers.union.sample = Some(samples.len() - 1);
            buffers.union.turn(|sample| samples[sample].weight, samples.len());
        }
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
