//! Runs one pass on the device, with the CPU's results of the passes before it as input.

use bytemuck::Pod;
use wgpu::{Buffer, BufferUsages, MapMode};

use crate::backend::gpu::Gpu;
use crate::backend::gpu::batches::Batch;
use crate::backend::gpu::job::{Job, JobPlace};
use crate::backend::gpu::layout::TILE;
use crate::backend::gpu::memory::Band;
use crate::backend::gpu::prepared::Prepared;
use crate::backend::gpu::recorder::Recorder;
use crate::backend::gpu::slots::Slot;
use crate::backend::gpu::steps::Kind;
use crate::backend::gpu::upload::{Placed, Upload};
use crate::frame::{Blocks, Frame};
use crate::options::SweptKernel;
use crate::plan::{BatchPass, MapPass, PaintPass, PosedInterval, Published, PublishedSweepPass, Step, SweepPass};

/// A pass of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pass {
    /// Splats; those of published kernels, on their map.
    Project,
    Bin,
    Paint(PaintPass),
    Map(MapPass),
    /// `Project` and `Bin` of kernels in motion.
    MakeKernels,
    Sweep(SweepPass),
    PublishedSweep(PublishedSweepPass),
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
    pub prepared: Prepared<'a>,
    band: Band,
    /// The interval of the group, if it has one.
    swept: Option<PosedInterval>,
    pub batch: Batch,
}

impl<'a> Harness<'a> {
    /// `None`: the group has no surfels.
    pub(super) fn new(gpu: &'a mut Gpu, frame: &'a Frame) -> Option<Self> {
        let prepared = gpu.prepare(frame).unwrap();
        let band = prepared.schedule.bands(0).next()?;
        assert_eq!(band.rows, prepared.schedule.rasters[0].tiles[1], "one band");
        let swept = frame.steps().find_map(|step| match *step {
            Step::Sweep { interval, .. } | Step::Published { part: Published::Sweep { interval, .. }, .. } => {
                Some(interval)
            }
            _ => None,
        });
        let (batch, upload) = {
            let job = job_of(&prepared, band, swept.as_ref(), false);
            let mut batches = job.place.batches(&job);
            assert!(batches.len() <= 1, "one batch");
            let mut upload = Upload::default();
            upload.place(&job, &batches, 0);
            (batches.pop()?, upload)
        };
        gpu.fit(&prepared, &upload).unwrap_or_else(|e| panic!("{e}"));
        Some(Self { gpu, frame, prepared, band, swept, batch })
    }

    /// Uploads the group, on the band or on the map around it.
    fn place(&self, on_map: bool) -> Placed {
        let job = job_of(&self.prepared, self.band, self.swept.as_ref(), on_map);
        let mut upload = Upload::default();
        let mut placed = upload.place(&job, std::slice::from_ref(&self.batch), self.gpu.state.buffers.entries);
        upload.write(&self.gpu.state);
        placed.remove(0)
    }

    /// The tiles of the raster.
    pub(super) fn tiles(&self) -> Vec<[usize; 2]> {
        tiles(self.prepared.schedule.rasters[0].tiles)
    }

    /// Is the tile of the raster rendered?
    pub(super) fn wants(&self, tile: [usize; 2]) -> bool {
        let [x, y] = tile.map(|i| i * TILE as usize / Blocks::EDGE);
        self.frame.wanted.as_ref().is_none_or(|blocks| blocks.at(x, y))
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
            Pass::MakeKernels => {
                recorder.record_batch(kind, project, &placed)?;
                recorder.record_batch(kind, bin, &placed)
            }
            Pass::Paint(pass) => recorder.record((kind, 0), pass, &placed, 1),
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
