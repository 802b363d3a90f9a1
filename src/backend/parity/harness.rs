//! Runs one pass on the device, with the CPU's results of the passes before it as input.

use bytemuck::Pod;
use wgpu::{Buffer, BufferUsages, MapMode};

use super::slots::Slots;
use super::splat_twins::{Context, Posed, SplatTwins, Sums, whole};
use crate::backend::gpu::Gpu;
use crate::backend::gpu::batches::Batch;
use crate::backend::gpu::job::{Job, JobPlace};
use crate::backend::gpu::layout::{Segment, TILE};
use crate::backend::gpu::memory::Band;
use crate::backend::gpu::prepared::Prepared;
use crate::backend::gpu::recorder::Recorder;
use crate::backend::gpu::slots::Slot;
use crate::backend::gpu::steps::Kind;
use crate::backend::gpu::upload::{Placed, Upload};
use crate::frame::{Blocks, Frame};
use crate::layout::Splat;
use crate::options::SweptKernel;
use crate::plan::{BatchPass, MapPass, PaintPass, PosedInterval, Published, PublishedSweepPass, Step, SweepPass};

/// A pass of the device: of splats, of the map, of kernels in motion, or of filtered kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pass {
    Project,
    Bin,
    /// Without a filter, with low-pass discs or without.
    Splat(PaintPass),
    Map(MapPass),
    /// `Project` and `Bin` of kernels in motion.
    MakeKernels,
    Sweep(SweepPass),
    PublishedSweep(PublishedSweepPass),
    /// `Project` and `Bin` of filtered kernels.
    Filter,
    Ewa(PaintPass),
}

/// Stands for +infinity on the device.
pub(super) const NONE: f32 = 3.402_823_4e38;
/// Stands for the threshold of what is not wanted.
pub(super) const UNWANTED: f32 = -NONE;
/// Marks splats that are in the list of wide splats.
pub(super) const WIDE: u32 = 1 << 31;
pub(super) const PIXELS: usize = (TILE * TILE) as usize;

/// The first group of a frame on the device.
pub(super) struct Harness<'a> {
    pub gpu: &'a mut Gpu,
    pub frame: &'a Frame,
    pub twins: SplatTwins<'a>,
    pub prepared: Prepared<'a>,
    band: Band,
    /// The interval of the group, if it has one.
    swept: Option<PosedInterval>,
    pub batch: Batch,
}

/// What the CPU has of a group.
pub(super) struct Host<'a> {
    pub posed: Vec<Posed<'a>>,
    /// Flags hold the segment.
    pub slots: Slots<Splat>,
    /// By tile, `TILE` x `TILE` each.
    pub thresholds: Vec<Vec<f32>>,
    /// Depths of the nearest discs, likewise; empty where they are not kept.
    pub nearest: Vec<Vec<f32>>,
    pub sums: Vec<Sums>,
    /// By tile, by plane.
    pub film: Vec<Vec<Vec<f32>>>,
}

impl Host<'_> {
    /// The depths of all tiles as the device has them: thresholds, then the depths of the nearest discs.
    pub(super) fn depths(&self) -> impl Iterator<Item = f32> {
        self.thresholds.iter().chain(&self.nearest).flatten().copied()
    }
}

impl<'a> Harness<'a> {
    /// `None`: the group has no surfels.
    pub(super) fn new(gpu: &'a mut Gpu, frame: &'a Frame, context: &'a Context) -> Option<Self> {
        let prepared = gpu.prepare(frame).unwrap();
        let band = prepared.schedule.bands(0).next()?;
        assert_eq!(band.rows, prepared.schedule.rasters[0].tiles[1], "one band");
        let position = &frame.rasters[0].positions[0];
        let group = &position.groups[0];
        let swept = frame.steps().find_map(|step| match *step {
            Step::Sweep { interval, .. } | Step::Published { part: Published::Sweep { interval, .. }, .. } => {
                Some(interval)
            }
            _ => None,
        });
        let scope = context.scope(frame, position, group, whole(position));
        let twins = SplatTwins { scope, edge: TILE as usize };
        let (batch, upload) = {
            let job = job_of(&prepared, band, swept.as_ref(), false);
            let mut batches = job.place.batches(&job);
            assert!(batches.len() <= 1, "one batch");
            let mut upload = Upload::default();
            upload.place(&job, &batches, 0);
            (batches.pop()?, upload)
        };
        gpu.fit(&prepared, &upload).unwrap_or_else(|e| panic!("{e}"));
        Some(Self { gpu, frame, twins, prepared, band, swept, batch })
    }

    /// Uploads the group, on the band or on the map around it.
    fn place(&self, on_map: bool) -> Placed {
        let job = job_of(&self.prepared, self.band, self.swept.as_ref(), on_map);
        let mut upload = Upload::default();
        let mut placed = upload.place(&job, std::slice::from_ref(&self.batch), self.gpu.state.buffers.entries);
        upload.write(&self.gpu.state);
        placed.remove(0)
    }

    fn tiles(&self) -> Vec<[usize; 2]> {
        tiles(self.prepared.schedule.rasters[0].tiles)
    }

    /// Is the tile of the raster rendered?
    pub(super) fn wants(&self, tile: [usize; 2]) -> bool {
        let [x, y] = tile.map(|i| i * TILE as usize / Blocks::EDGE);
        self.frame.wanted.as_ref().is_none_or(|blocks| blocks.at(x, y))
    }

    /// All passes on the CPU.
    pub(super) fn host(&self) -> Host<'a> {
        let twins = self.twins;
        let posed = twins.project();
        let tiles = self.tiles();
        let splats_of = |segment: &Segment, object: usize| {
            let sample = (segment.flags >> 3).saturating_sub(1) as usize;
            &posed.iter().find(|p| p.chunk.sample == sample && p.chunk.object == object).unwrap().splats[..]
        };
        let with_segment = |splat: &Splat, segment| Splat { flags: splat.flags | segment << 1, ..*splat };
        let slots = Slots::new(&self.batch, &tiles, splats_of, with_segment, |tile| self.wants(tile));
        let kept = if self.frame.keeps_nearest { PIXELS } else { 0 };
        let depths = |&tile: &[usize; 2]| {
            let unwanted = || (vec![UNWANTED; PIXELS], vec![UNWANTED; kept]);
            if self.wants(tile) { twins.visibility(&posed, tile) } else { unwanted() }
        };
        let (thresholds, nearest): (Vec<_>, Vec<_>) = self.tiles().iter().map(depths).unzip();
        // Hidden splats cover too: none in a tile that is not wanted.
        let of_tile = |tile| if self.wants(tile) { &posed[..] } else { &[] };
        let tiles_and_depths = self.tiles().into_iter().zip(thresholds.iter().zip(&nearest));
        let sums: Vec<_> = tiles_and_depths.map(|(tile, (t, n))| twins.attribute(of_tile(tile), tile, t, n)).collect();
        let film =
            self.tiles().into_iter().zip(thresholds.iter().zip(&sums)).map(|(tile, (t, s))| twins.resolve(tile, t, s));
        let film = film.collect();
        Host { posed, slots, thresholds, nearest, sums, film }
    }

    /// Spoils what passes write.
    pub(super) fn spoil(&self) {
        use Slot::{CoverageMask, Film, Map, Splats, Starts, Sums, Thresholds, Touched};
        let mut encoder = self.gpu.state.encoder();
        for slot in [Splats, Touched, Starts, Thresholds, Sums, Map, CoverageMask, Film] {
            encoder.clear_buffer(&self.gpu.state.buffers[slot], 0, None);
        }
        self.gpu.state.device.submit([encoder]);
    }

    /// Writes what the passes before `pass` make, and spoils what it will write.
    pub(super) fn feed(&mut self, host: &Host<'_>, pass: Pass) {
        let buffers = &self.gpu.state.buffers;
        self.spoil();
        if pass == Pass::Project {
            return;
        }
        host.slots.feed_splats(self);
        if pass == Pass::Bin {
            return;
        }
        host.slots.feed_lists(self);
        if pass == Pass::Splat(PaintPass::Visibility) {
            return;
        }
        let depths: Vec<f32> = host.depths().map(|t| t.min(NONE)).collect();
        self.write(&buffers[Slot::Thresholds], &depths);
        if pass == Pass::Splat(PaintPass::Attribute) {
            return;
        }
        let sums: Vec<f32> = host.sums.iter().flat_map(planes_of).flatten().collect();
        self.write(&buffers[Slot::Sums], &sums);
    }

    /// Runs one pass; what belongs to the map, on the map around the band.
    pub(super) fn run(&mut self, pass: Pass) {
        let on_map = self.swept.is_some() && matches!(pass, Pass::Project | Pass::Bin | Pass::Map(_));
        let placed = self.place(on_map);
        let published = self.frame.swept.is_some_and(SweptKernel::is_published);
        let kind = match pass {
            Pass::Project | Pass::Bin | Pass::Map(_) if on_map => Kind::Map,
            Pass::MakeKernels if published => Kind::Published,
            Pass::MakeKernels | Pass::Sweep(_) => Kind::Sweep,
            Pass::PublishedSweep(_) => Kind::Published,
            _ => {
                assert!(!on_map && self.swept.is_none(), "not a pass of instants");
                Kind::Paint
            }
        };
        let [project, bin] = BatchPass::ORDER;
        let record = |recorder: &mut Recorder<'_>| match pass {
            Pass::Project => recorder.record_batch(kind, project, &placed),
            Pass::Bin => recorder.record_batch(kind, bin, &placed),
            Pass::MakeKernels | Pass::Filter => {
                recorder.record_batch(kind, project, &placed)?;
                recorder.record_batch(kind, bin, &placed)
            }
            Pass::Splat(pass) | Pass::Ewa(pass) => recorder.record((kind, 0), pass, &placed, 1),
            Pass::Map(pass) => recorder.record((kind, 0), pass, &placed, 1),
            Pass::Sweep(pass) => recorder.record((kind, 0), pass, &placed, 1),
            Pass::PublishedSweep(pass) => recorder.record((kind, 0), pass, &placed, 1),
        };
        self.gpu.recorded(&self.prepared, record).unwrap();
    }

    pub(super) fn write<T: Pod>(&self, buffer: &Buffer, values: &[T]) {
        self.gpu.state.device.write(buffer, 0, bytemuck::cast_slice(values));
    }

    pub(super) fn read<T: Pod>(&self, buffer: &Buffer, count: usize) -> Vec<T> {
        read(self.gpu, buffer, count)
    }
}

/// The first group of a frame, on the band or on the map around it.
fn job_of<'a>(prepared: &'a Prepared<'a>, band: Band, swept: Option<&'a PosedInterval>, on_map: bool) -> Job<'a> {
    let position = &prepared.frame.rasters[0].positions[0];
    let place = JobPlace { prepared, position, raster: 0, band, film: 0, film_tile: 0 };
    let Some(interval) = swept else { return place.paint_job(0, false) };
    let job = place.sweep_job(0, interval);
    if on_map { Job { area: job.map, ..job } } else { job }
}

/// Columns and rows of tiles, row by row.
pub(super) fn tiles(size: [u32; 2]) -> Vec<[usize; 2]> {
    let [x, y] = size.map(|n| n as usize);
    (0..x * y).map(|i| [i % x, i / x]).collect()
}

/// A tile's channels as the device has them.
pub(super) fn planes_of(sums: &Sums) -> Vec<Vec<f32>> {
    let mut planes = sums.channels.clone();
    if !sums.sample_coverage.is_empty() {
        planes.extend([sums.sample_coverage.clone(), sums.coverage.clone(), sums.of_static.clone()]);
    }
    planes
}

/// The first `count` values of a buffer.
pub(super) fn read<T: Pod>(gpu: &Gpu, buffer: &Buffer, count: usize) -> Vec<T> {
    let device = &gpu.state.device;
    let bytes = (count * size_of::<T>()) as u64;
    if bytes == 0 {
        return Vec::new();
    }
    let copy = device.buffer("test", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST).unwrap();
    let mut encoder = gpu.state.encoder();
    encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, bytes);
    device.submit([encoder]);
    copy.map_async(MapMode::Read, .., |_| ());
    device.handle.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    device.check().unwrap();
    let view = copy.get_mapped_range(..).unwrap();
    bytemuck::pod_collect_to_vec(&view[..bytes as usize])
}
