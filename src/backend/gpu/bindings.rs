//! Which buffers the programs of a frame reach, and their pipelines: made once a frame.

use wgpu::{BindGroup, BindGroupEntry, BindingResource, BufferBinding, BufferSize, ComputePass, ComputePipeline};

use super::buffers::Buffers;
use super::device::Device;
use super::execute::Execution;
use super::layout::{DIGIT_BITS, UNIFORM_STRIDE};
use super::models::Block;
use super::programs::{Constants, Pipelines, Program, Slot};
use super::schedule::DeviceChannels;
use crate::backend::BackendError;
use crate::film::FilmPlanes;
use crate::frame::Frame;
use crate::layout::{Channels, Splat, SweptSplat};
use crate::options::{KernelShape, KernelWeight, Normalise, Shading, SweptKernel, TemporalAlpha};
use crate::plan::Pass;

/// A pipeline and what it is bound to.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pipeline: ComputePipeline,
    uniforms: BindGroup,
    buffers: BindGroup,
}

impl Step {
    /// Sets everything for a dispatch; `offsets`: of the view and, where the program has one, the segment.
    pub(super) fn set(&self, pass: &mut ComputePass<'_>, offsets: &[u32]) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.uniforms, offsets);
        pass.set_bind_group(1, &self.buffers, &[]);
    }
}

/// One round of the sort.
#[derive(Clone, Debug)]
pub(super) struct Round {
    pub count: Step,
    pub scan: Step,
    pub scatter: Step,
}

/// The steps of a frame.
#[derive(Debug)]
pub(super) struct Steps {
    /// For each object, for each block.
    pub project: Vec<Vec<Step>>,
    pub bin_reduce: Step,
    pub bin_scan: Step,
    pub bin_emit: Step,
    pub sort: Vec<Round>,
    pub bin_starts: Step,
    pub visibility: Step,
    /// For each object, for each block.
    pub splat_values: Vec<Vec<Step>>,
    pub sum_attributes: Step,
    /// One for each part of the film.
    pub resolve: Vec<Step>,
    /// Likewise, where the film is not finished when all groups are added.
    pub finish: Vec<Step>,
    pub layer: Option<LayerSteps>,
    pub swept: Option<SweptSteps>,
}

/// What comes for groups that share a sample position.
#[derive(Debug)]
pub(super) struct LayerSteps {
    /// Sums of what lies still.
    pub sum: Step,
    pub recall: Step,
    /// Sums of what must be added anew: for each wave of what lies still.
    pub anew: Vec<Step>,
}

/// What is other for kernels in motion.
#[derive(Debug)]
pub(super) struct SweptSteps {
    pub density: Step,
    pub keep: Step,
    /// For each object, for each block.
    pub project: Vec<Vec<Step>>,
    pub bin_emit: Step,
    /// For each object, for each block.
    pub splat_values: Vec<Vec<Step>>,
    pub attribute: Step,
    /// The picture of what lies still, where it has one.
    pub still: Option<Step>,
}

/// Everything that steps are made from.
pub(super) struct Bench<'a> {
    pub device: &'a Device,
    pub pipelines: &'a mut Pipelines,
    pub buffers: &'a Buffers,
}

impl Bench<'_> {
    /// Where the sort's buffers are reached from `from` to the other one.
    fn buffer(&self, slot: Slot, from: usize) -> &wgpu::Buffer {
        let b = self.buffers;
        match slot {
            Slot::Segments => &b.segments,
            Slot::Lights => &b.lights,
            Slot::Travels => &b.travels,
            Slot::Map => &b.map,
            Slot::Presence => &b.presence,
            Slot::Moments => &b.moments,
            Slot::Splats => &b.splats,
            Slot::Touched => &b.touched,
            Slot::Partials => &b.partials,
            Slot::WrittenTotals | Slot::Totals => &b.totals,
            Slot::Status => &b.status,
            Slot::Keys => &b.keys[1 - from],
            Slot::List => &b.lists[1 - from],
            Slot::SortedKeys => &b.keys[from],
            Slot::SortedList => &b.lists[from],
            Slot::Wide => &b.wide,
            Slot::Starts => &b.starts,
            Slot::Histogram => &b.histogram,
            Slot::DigitTotals => &b.digit_totals,
            Slot::Thresholds => &b.thresholds,
            Slot::WrittenValues | Slot::Values => &b.values,
            Slot::Sums => &b.sums,
            // These are bound block by block and band by band.
            Slot::Film | Slot::Geometry | Slot::Looks => &b.film,
            Slot::StillFilm => &b.still_film,
            Slot::Wanted => &b.wanted,
            Slot::LayerThresholds => &b.layer_thresholds,
            Slot::LayerSums => &b.layer_sums,
            Slot::Limits => &b.limits,
        }
    }

    /// A step whose lists lie in the buffers other than `from`.
    fn step(
        &mut self,
        program: Program,
        constants: &Constants,
        from: usize,
        special: &[(Slot, BufferBinding<'_>)],
    ) -> Result<Step, BackendError> {
        let pipeline = self.pipelines.get(self.device, program, constants)?;
        let layouts = self.pipelines.layouts(self.device, program).clone();
        let uniform = |buffer| {
            BindingResource::Buffer(BufferBinding { buffer, offset: 0, size: BufferSize::new(UNIFORM_STRIDE) })
        };
        let uniforms = [
            BindGroupEntry { binding: 0, resource: uniform(&self.buffers.views) },
            BindGroupEntry { binding: 1, resource: uniform(&self.buffers.segments) },
        ];
        let uniforms = &uniforms[..if program.has_segment() { 2 } else { 1 }];
        let (read, written) = program.buffers();
        let entries: Vec<_> = read
            .iter()
            .chain(written)
            .map(|&slot| {
                let own = special.iter().find(|(special, _)| *special == slot).map(|(_, binding)| binding.clone());
                let binding = own.unwrap_or_else(|| self.buffer(slot, from).as_entire_buffer_binding());
                BindGroupEntry { binding: slot as u32, resource: BindingResource::Buffer(binding) }
            })
            .collect();
        let bind = |layout, entries| {
            let descriptor = wgpu::BindGroupDescriptor { label: Some(program.entry()), layout, entries };
            self.device.handle.create_bind_group(&descriptor)
        };
        let uniforms = bind(&layouts.uniforms, uniforms);
        let buffers = bind(&layouts.buffers, &entries);
        Ok(Step { pipeline, uniforms, buffers })
    }

    /// `program` for each block of each object.
    fn of_blocks(
        &mut self,
        program: Program,
        constants: &Constants,
        blocks: &[Vec<Block>],
    ) -> Result<Vec<Vec<Step>>, BackendError> {
        let mut one = |block: &Block| {
            let special = [
                (Slot::Geometry, block.geometry.as_entire_buffer_binding()),
                (Slot::Looks, block.looks.as_entire_buffer_binding()),
            ];
            self.step(program, constants, 0, &special)
        };
        blocks.iter().map(|blocks| blocks.iter().map(&mut one).collect()).collect()
    }

    /// All steps of a frame.
    pub(super) fn steps(&mut self, execution: &Execution<'_>) -> Result<Steps, BackendError> {
        let Execution { frame, channels, planes, blocks, schedule, .. } = execution;
        let parts = &execution.parts();
        let none = Constants::new();
        let rounds = schedule
            .band_tiles
            .max(schedule.map_tiles)
            .max(1)
            .next_power_of_two()
            .trailing_zeros()
            .div_ceil(DIGIT_BITS) as usize;
        let sums = sum_constants(channels);
        let values = value_constants(frame, channels);
        // After an even number of rounds entries are back where they began.
        let begin = rounds % 2;
        let mut sort = Vec::new();
        for round in 0..rounds {
            let from = (begin + round) % 2;
            let shift = vec![("SHIFT", round as u32 * DIGIT_BITS)];
            sort.push(Round {
                count: self.step(Program::SortCount, &shift, from, &[])?,
                scan: self.step(Program::SortScan, &none, from, &[])?,
                scatter: self.step(Program::SortScatter, &shift, from, &[])?,
            });
        }
        let resolve = match frame.swept {
            Some(swept) => swept_resolve_constants(frame, swept, channels, planes),
            None => resolve_constants(frame, channels, planes),
        };
        let program = match frame.swept.map(|swept| swept.normalise) {
            None => Program::Resolve,
            Some(Normalise::Interval) => Program::SweptResolve,
            Some(Normalise::Once) => Program::Pool,
        };
        let resolve_parts = self.of_parts(program, &resolve, parts)?;
        let unfinished = |swept: SweptKernel| swept.normalise == Normalise::Once || swept.alpha == TemporalAlpha::Sum;
        let finish = if frame.swept.is_some_and(unfinished) {
            self.of_parts(Program::Finish, &resolve, parts)?
        } else {
            Vec::new()
        };
        let swept = match frame.swept {
            Some(swept) => Some(self.swept_steps(execution, swept, 1 - begin)?),
            None => None,
        };
        Ok(Steps {
            project: self.of_blocks(Program::Project, &none, blocks)?,
            bin_reduce: self.step(Program::BinReduce, &none, 0, &[])?,
            bin_scan: self.step(Program::BinScan, &none, 0, &[])?,
            bin_emit: self.step(Program::BinEmit, &none, 1 - begin, &[])?,
            sort,
            bin_starts: self.step(Program::BinStarts, &none, 0, &[])?,
            // The sorted lists lie in the first buffers.
            visibility: self.step(Program::Visibility, &none, 1, &[])?,
            splat_values: self.of_blocks(Program::SplatValues, &values, blocks)?,
            sum_attributes: self.step(Program::SumAttributes, &sums, 1, &[])?,
            resolve: resolve_parts,
            finish,
            layer: self.layer_steps(channels, schedule.kept_waves() as usize)?,
            swept,
        })
    }

    /// `kept_waves`: of what lies still.
    fn layer_steps(
        &mut self,
        channels: &DeviceChannels,
        kept_waves: usize,
    ) -> Result<Option<LayerSteps>, BackendError> {
        if kept_waves == 0 {
            return Ok(None);
        }
        let buffers = self.buffers;
        let least_depth = DeviceChannels { count: channels.count + 1, ..*channels };
        let mut with_nearest = sum_constants(&least_depth);
        with_nearest.push(("NEAREST", channels.count as u32));
        let to_layer = [(Slot::Sums, buffers.layer_sums.as_entire_buffer_binding())];
        let sums = sum_constants(channels);
        let recalled = vec![("CHANNELS", channels.count as u32), ("REACH", channels.reach.unwrap_or(0) as u32)];
        let anew = buffers.kept[..kept_waves].iter().map(|kept| {
            let special = [
                (Slot::Splats, &kept.splats),
                (Slot::List, &kept.list),
                (Slot::Wide, &kept.wide),
                (Slot::Starts, &kept.starts),
                (Slot::Values, &kept.values),
                (Slot::Thresholds, &buffers.limits),
            ];
            let special = special.map(|(slot, buffer)| (slot, buffer.as_entire_buffer_binding()));
            self.step(Program::SumAttributes, &sums, 1, &special)
        });
        let anew = anew.collect::<Result<_, _>>()?;
        Ok(Some(LayerSteps {
            sum: self.step(Program::SumAttributes, &with_nearest, 1, &to_layer)?,
            recall: self.step(Program::Recall, &recalled, 0, &[])?,
            anew,
        }))
    }

    /// `program` for each part of the film.
    fn of_parts(
        &mut self,
        program: Program,
        constants: &Constants,
        parts: &[(u64, u64)],
    ) -> Result<Vec<Step>, BackendError> {
        let film = self.buffers.film.clone();
        parts
            .iter()
            .map(|&(offset, bytes)| {
                let part = BufferBinding { buffer: &film, offset, size: BufferSize::new(bytes) };
                self.step(program, constants, 0, &[(Slot::Film, part)])
            })
            .collect()
    }

    /// `emitted`: which of the sort's buffers new lists do not go to.
    fn swept_steps(
        &mut self,
        execution: &Execution<'_>,
        swept: SweptKernel,
        emitted: usize,
    ) -> Result<SweptSteps, BackendError> {
        let Execution { frame, channels, planes, blocks, .. } = execution;
        let double = ("SPLATS", (size_of::<SweptSplat>() / size_of::<Splat>()) as u32);
        let mut values = value_constants(frame, channels);
        values.push(double);
        let weights = DeviceChannels { shared: Channels::weights(), values: channels.values, reach: None, count: 1 };
        let mut density = sum_constants(&weights);
        density.push(("COLOUR", 0));
        let volume =
            vec![("ELLIPSOID", u32::from(swept.shape == KernelShape::Ellipsoid)), ("STRETCH", swept.stretch() as u32)];
        let still = if frame.has_still_picture() {
            let film = [(Slot::Film, self.buffers.still_film.as_entire_buffer_binding())];
            Some(self.step(Program::Resolve, &resolve_constants(frame, channels, planes), 0, &film)?)
        } else {
            None
        };
        let counted = frame.passes.contains(&Pass::Density);
        Ok(SweptSteps {
            density: self.step(Program::SumAttributes, &density, 1, &[])?,
            keep: self.step(Program::Keep, &vec![("DENSITY", u32::from(counted))], 0, &[])?,
            project: self.of_blocks(Program::Sweep, &volume, blocks)?,
            bin_emit: self.step(Program::BinEmit, &vec![double], emitted, &[])?,
            splat_values: self.of_blocks(Program::SplatValues, &values, blocks)?,
            attribute: self.step(Program::SweptAttribute, &swept_constants(frame, swept, channels), 1, &[])?,
            still,
        })
    }
}

fn sum_constants(channels: &DeviceChannels) -> Constants {
    let at = |channel: Option<usize>| channel.unwrap_or(0) as u32;
    let shared = &channels.shared;
    vec![
        ("NORMAL", at(shared.normal)),
        ("DEPTH", at(shared.depth)),
        ("VELOCITY", at(shared.velocity)),
        ("MATERIAL", at(shared.material)),
        ("REACH", at(channels.reach)),
        ("CHANNELS", channels.count as u32),
        ("VALUES", channels.values),
    ]
}

fn value_constants(frame: &Frame<'_>, channels: &DeviceChannels) -> Constants {
    let mut constants = sum_constants(channels);
    constants.push(("GOURAUD", u32::from(frame.shading == Shading::Gouraud)));
    constants
}

fn swept_constants(frame: &Frame<'_>, swept: SweptKernel, channels: &DeviceChannels) -> Constants {
    let mut constants = sum_constants(channels);
    constants.retain(|(name, _)| !["MATERIAL", "REACH"].contains(name));
    let footprint = match (swept.weight, swept.shape) {
        (KernelWeight::Integral, KernelShape::Tube) => 0,
        (KernelWeight::Integral, KernelShape::Ellipsoid) => 1,
        (KernelWeight::Chord, _) => 2,
    };
    constants.extend([
        ("FOOTPRINT", footprint),
        ("SOURCE_SAMPLES", swept.source_samples.0),
        ("SUM", u32::from(swept.alpha == TemporalAlpha::Sum)),
        ("STILL", u32::from(frame.has_still_picture())),
    ]);
    constants
}

fn resolve_constants(frame: &Frame<'_>, channels: &DeviceChannels, planes: &FilmPlanes) -> Constants {
    let at = |plane: Option<usize>| plane.unwrap_or(0) as u32;
    let mut constants = sum_constants(channels);
    constants.retain(|(name, _)| *name != "VALUES");
    constants.extend([
        ("PHONG", u32::from(frame.shading == Shading::Phong)),
        ("DEPTH_PLANE", at(planes.depth)),
        ("NORMAL_PLANE", at(planes.normal)),
        ("VELOCITY_PLANE", at(planes.velocity)),
        ("PLANES", planes.count as u32),
    ]);
    constants
}

fn swept_resolve_constants(
    frame: &Frame<'_>,
    swept: SweptKernel,
    channels: &DeviceChannels,
    planes: &FilmPlanes,
) -> Constants {
    let mut constants = resolve_constants(frame, channels, planes);
    constants.extend([
        ("SUM", u32::from(swept.alpha == TemporalAlpha::Sum)),
        // Without a plane for them, weights are the coverage, plane 3.
        ("WEIGHT_PLANE", planes.weight.unwrap_or(3) as u32),
        ("STILL", u32::from(frame.has_still_picture())),
    ]);
    constants
}
