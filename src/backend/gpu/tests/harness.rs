//! Runs one pass on the device, with the CPU's results of the passes before it as input.

use bytemuck::{Pod, Zeroable};
use wgpu::{Buffer, BufferUsages, MapMode};

use crate::backend::cpu::twins::{Posed, Recalled, Sums, Twins};
use crate::backend::gpu::Gpu;
use crate::backend::gpu::bindings::Steps;
use crate::backend::gpu::clock::Marks;
use crate::backend::gpu::execute::{Execution, Work};
use crate::backend::gpu::layer::KEEPING;
use crate::backend::gpu::layout::{TILE, WIDEST};
use crate::backend::gpu::schedule::Band;
use crate::backend::gpu::waves::{Part, Wave};
use crate::frame::{Blocks, Frame};
use crate::layout::Splat;
use crate::plan::Pass;

/// Stands for +infinity on the device.
pub(super) const NONE: f32 = 3.402_823_4e38;
/// Stands for the threshold of what is not wanted.
pub(super) const UNWANTED: f32 = -NONE;
/// Marks splats that are listed apart.
pub(super) const WIDE: u32 = 1 << 31;
pub(super) const PIXELS: usize = (TILE * TILE) as usize;

/// The first group of a frame on the device.
pub(super) struct Harness<'a> {
    pub gpu: &'a mut Gpu,
    pub twins: Twins<'a>,
    pub execution: Execution<'a>,
    steps: Steps,
    band: Band,
    pub wave: Wave,
}

/// What the CPU has of a group.
pub(super) struct Host {
    pub posed: Vec<Posed>,
    /// By slot; flags hold the segment.
    pub splats: Vec<Option<Splat>>,
    /// By slot.
    pub touched: Vec<u32>,
    pub starts: Vec<u32>,
    pub list: Vec<u32>,
    pub wide: Vec<u32>,
    /// By tile, `TILE` x `TILE` each.
    pub thresholds: Vec<Vec<f32>>,
    pub sums: Vec<Sums>,
    /// By tile, by plane.
    pub film: Vec<Vec<Vec<f32>>>,
}

impl<'a> Harness<'a> {
    /// `None`: the group has no surfels.
    pub(super) fn new(gpu: &'a mut Gpu, frame: &'a Frame<'a>) -> Option<Self> {
        let execution = gpu.prepare(frame).unwrap();
        let mut marks = Marks::new(&gpu.machine.device).unwrap();
        let steps = gpu.steps(&execution, &mut marks).unwrap_or_else(|e| panic!("{e}"));
        let band = execution.schedule.bands(0).next()?;
        assert_eq!(band.rows, execution.schedule.rasters[0].tiles[1], "one band");
        let group = &frame.groups[0];
        let resolve = &steps.resolve[0];
        let work = Work {
            execution: &execution,
            group,
            raster: 0,
            band,
            part: part_of(frame),
            on_map: false,
            steps: &steps,
            resolve,
        };
        let mut waves = gpu.machine.upload(&work).waves;
        assert!(waves.len() <= 1, "one wave");
        let wave = waves.pop()?;
        let twins = Twins { frame, group, edge: TILE as usize };
        Some(Self { gpu, twins, execution, steps, band, wave })
    }

    fn tiles(&self) -> Vec<[usize; 2]> {
        let [x, y] = self.execution.schedule.rasters[0].tiles.map(|n| n as usize);
        (0..x * y).map(|i| [i % x, i / x]).collect()
    }

    /// Is the tile of the raster rendered?
    fn wants(&self, tile: [usize; 2]) -> bool {
        let [x, y] = tile.map(|i| i * TILE as usize / Blocks::EDGE);
        self.twins.frame.wanted.as_ref().is_none_or(|blocks| blocks.at(x, y))
    }

    /// All passes on the CPU.
    pub(super) fn host(&self) -> Host {
        let twins = self.twins;
        let posed = twins.project();
        let slots = self.wave.slots as usize;
        let mut splats = vec![None; slots];
        for (segment, object, _) in &self.wave.segments {
            let sample = (segment.flags >> 2).saturating_sub(1) as usize;
            let of = posed.iter().find(|p| p.sample == sample && p.object == *object).unwrap();
            let first = segment.block_start + segment.first_surfel;
            for splat in of.splats.iter().filter(|s| (first..first + segment.surfels).contains(&s.surfel)) {
                let slot = segment.first_slot + splat.surfel - first;
                splats[slot as usize] = Some(Splat { flags: splat.flags | segment.index << 1, ..*splat });
            }
        }
        let tiles_of = |splat: &Splat| splat.bounds.map(|pixel| u32::from(pixel) / TILE);
        let touched: Vec<u32> = splats
            .iter()
            .map(|splat| {
                let Some(splat) = splat else { return 0 };
                let [x0, x1, y0, y1] = tiles_of(splat).map(|i| i as usize);
                let wanted = (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| [x, y])).filter(|&tile| self.wants(tile));
                let count = wanted.count() as u32;
                if (x1 + 1 - x0) * (y1 + 1 - y0) > WIDEST as usize && count > 0 { WIDE } else { count }
            })
            .collect();
        let wide: Vec<u32> = (0..slots as u32).filter(|&slot| touched[slot as usize] == WIDE).collect();
        let (mut starts, mut list) = (Vec::new(), Vec::new());
        for [x, y] in self.tiles() {
            starts.push(list.len() as u32);
            list.extend((0..slots as u32).filter(|&slot| {
                touched[slot as usize] != WIDE
                    && self.wants([x, y])
                    && splats[slot as usize].as_ref().is_some_and(|splat| {
                        let [x0, x1, y0, y1] = tiles_of(splat).map(|i| i as usize);
                        (x0..=x1).contains(&x) && (y0..=y1).contains(&y)
                    })
            }));
        }
        starts.extend([list.len() as u32, wide.len() as u32]);
        let threshold = |&tile: &[usize; 2]| {
            if self.wants(tile) { twins.visibility(&posed, tile) } else { vec![UNWANTED; PIXELS] }
        };
        let thresholds: Vec<_> = self.tiles().iter().map(threshold).collect();
        // Hidden splats cover too: none in a tile that is not wanted.
        let of_tile = |tile| if self.wants(tile) { &posed[..] } else { &[] };
        let sums: Vec<_> =
            self.tiles().iter().zip(&thresholds).map(|(&tile, t)| twins.attribute(of_tile(tile), tile, t)).collect();
        let film =
            self.tiles().into_iter().zip(thresholds.iter().zip(&sums)).map(|(tile, (t, s))| twins.resolve(tile, t, s));
        let film = film.collect();
        Host { posed, splats, touched, starts, list, wide, thresholds, sums, film }
    }

    /// By tile: what lies still, and what of it is recalled.
    pub(super) fn recalled(&self, host: &Host) -> Vec<Recalled> {
        let one = |(tile, thresholds): ([usize; 2], &Vec<f32>)| {
            let mut recalled = self.twins.recall(&host.posed, tile, thresholds);
            if !self.wants(tile) {
                recalled.layer_thresholds = vec![UNWANTED; PIXELS];
                recalled.limits = vec![UNWANTED; PIXELS];
            }
            recalled
        };
        self.tiles().into_iter().zip(&host.thresholds).map(one).collect()
    }

    /// Writes what the passes before `pass` make, and spoils what it will write.
    pub(super) fn feed(&mut self, host: &Host, pass: Pass) {
        let buffers = &self.gpu.machine.buffers;
        let spoilt = [&buffers.splats, &buffers.touched, &buffers.starts, &buffers.thresholds, &buffers.sums];
        let mut encoder = self.gpu.machine.encoder();
        encoder.clear_buffer(&buffers.film, 0, None);
        for buffer in spoilt {
            encoder.clear_buffer(buffer, 0, None);
        }
        self.gpu.machine.device.queue.submit([encoder.finish()]);
        if pass == Pass::Project {
            return;
        }
        let blank = Splat::zeroed();
        self.write(&buffers.splats, &host.splats.iter().map(|s| s.unwrap_or(blank)).collect::<Vec<_>>());
        self.write(&buffers.touched, &host.touched);
        if pass == Pass::Bin {
            return;
        }
        self.write(&buffers.starts, &host.starts);
        self.write(&buffers.lists[0], &host.list);
        self.write(&buffers.wide, &host.wide);
        if pass == Pass::Visibility {
            return;
        }
        let thresholds: Vec<f32> = host.thresholds.iter().flatten().map(|&t| t.min(NONE)).collect();
        self.write(&buffers.thresholds, &thresholds);
        if pass == Pass::Attribute {
            return;
        }
        let sums: Vec<f32> = host.sums.iter().flat_map(planes_of).flatten().collect();
        self.write(&buffers.sums, &sums);
    }

    pub(super) fn run(&mut self, pass: Pass) {
        self.run_on(pass, false);
    }

    /// Splats what lies still, and keeps it.
    pub(super) fn keep(&mut self) {
        let work = self.work(Part::Still, false);
        let mut marks = Marks::new(&self.gpu.machine.device).unwrap();
        self.gpu.machine.passes(&work, &KEEPING, &mut marks);
        self.gpu.machine.device.check().unwrap();
    }

    /// Starts pass `attribute` from what lies still, without what must be added anew.
    pub(super) fn recall(&mut self) {
        let work = self.work(Part::Moving, false);
        let mut encoder = self.gpu.machine.encoder();
        let mut marks = Marks::new(&self.gpu.machine.device).unwrap();
        self.gpu.machine.upload(&work);
        self.gpu.machine.recall(&mut encoder, Pass::Attribute, &work, 0, &mut marks);
        self.gpu.machine.device.queue.submit([encoder.finish()]);
        self.gpu.machine.device.check().unwrap();
    }

    /// Makes the picture of what lies still.
    pub(super) fn picture_still(&mut self) {
        let work = self.work(Part::Still, false);
        let mut marks = Marks::new(&self.gpu.machine.device).unwrap();
        self.gpu.machine.picture_still(&work, &mut marks);
        self.gpu.machine.device.check().unwrap();
    }

    fn work(&self, part: Part, on_map: bool) -> Work<'_> {
        Work {
            execution: &self.execution,
            group: self.twins.group,
            raster: 0,
            band: self.band,
            part,
            on_map,
            steps: &self.steps,
            resolve: &self.steps.resolve[0],
        }
    }

    /// On the band, or on the map around it.
    pub(super) fn run_on(&mut self, pass: Pass, on_map: bool) {
        let mut marks = Marks::new(&self.gpu.machine.device).unwrap();
        let work = self.work(part_of(self.twins.frame), on_map);
        self.gpu.machine.upload(&work);
        let mut encoder = self.gpu.machine.encoder();
        self.gpu.machine.record(&mut encoder, pass, &work, &self.wave, 0, &mut marks);
        self.gpu.machine.device.queue.submit([encoder.finish()]);
        self.gpu.machine.device.check().unwrap();
    }

    pub(super) fn write<T: Pod>(&self, buffer: &Buffer, values: &[T]) {
        self.gpu.machine.device.queue.write_buffer(buffer, 0, bytemuck::cast_slice(values));
    }

    pub(super) fn read<T: Pod>(&self, buffer: &Buffer, count: usize) -> Vec<T> {
        read(self.gpu, buffer, count)
    }
}

/// What goes through the passes of a group.
fn part_of(frame: &Frame<'_>) -> Part {
    if frame.has_still_picture() { Part::Beside } else { Part::Whole }
}

/// A tile's channels as the device has them.
pub(super) fn planes_of(sums: &Sums) -> Vec<Vec<f32>> {
    let mut planes = sums.channels.clone();
    if !sums.reach.is_empty() {
        planes.extend([sums.reach.clone(), sums.coverage.clone(), sums.still.clone()]);
    }
    planes
}

/// The first `count` values of a buffer.
pub(super) fn read<T: Pod>(gpu: &Gpu, buffer: &Buffer, count: usize) -> Vec<T> {
    let device = &gpu.machine.device;
    let bytes = (count * size_of::<T>()) as u64;
    if bytes == 0 {
        return Vec::new();
    }
    let copy = device.buffer("test", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST).unwrap();
    let mut encoder = gpu.machine.encoder();
    encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, bytes);
    device.queue.submit([encoder.finish()]);
    copy.map_async(MapMode::Read, .., |_| ());
    device.handle.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    device.check().unwrap();
    let view = copy.get_mapped_range(..).unwrap();
    bytemuck::pod_collect_to_vec(&view[..bytes as usize])
}
