//! Binds the programs of a frame to their buffers and pipelines.

use std::sync::Arc;

use wgpu::{
    BindGroup, BindGroupEntry, BindingResource, Buffer, BufferBinding, BufferSize, ComputePass, ComputePipeline,
};

use super::bind_groups::{BindGroups, Bound};
use super::buffers::{Buffers, TABLE_BYTES};
use super::calls::Calls;
use super::constants::{
    paint_resolve_constants, swept_constants, swept_resolve_constants, swept_visibility_constants, value_constants,
};
use super::device::Device;
use super::layout::{DIGIT_BITS, VIEW_BYTES};
use super::models::ModelBuffer;
use super::prepared::Prepared;
use super::programs::{Constants, KernelKind, Pipelines, Program, Slot};
use super::upload::Upload;
use super::{DeviceState, Gpu};
use crate::backend::BackendError;
use crate::layout::{FilteredSplat, Splat, SweptSplat};
use crate::options::{KernelShape, Normalise, SweptKernel};

/// A pipeline and the buffers that it is bound to.
#[derive(Clone, Debug)]
pub(in crate::backend) struct BoundProgram {
    pipeline: ComputePipeline,
    uniforms: BindGroup,
    buffers: BindGroup,
    calls: Arc<Calls>,
}

impl BoundProgram {
    /// Records `groups` workgroups, in columns, rows and layers. `offsets` are those of the view and, where the program
    /// has one, of its second uniform.
    pub(in crate::backend) fn dispatch(&self, pass: &mut ComputePass<'_>, offsets: &[u32], groups: [u32; 3]) {
        self.calls.dispatch();
        self.set(pass, offsets);
        pass.dispatch_workgroups(groups[0], groups[1], groups[2]);
    }

    /// Records as many workgroups as the first numbers of a buffer say.
    pub(in crate::backend) fn dispatch_indirect(&self, pass: &mut ComputePass<'_>, offsets: &[u32], groups: &Buffer) {
        self.calls.dispatch();
        self.set(pass, offsets);
        pass.dispatch_workgroups_indirect(groups, 0);
    }

    fn set(&self, pass: &mut ComputePass<'_>, offsets: &[u32]) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.uniforms, offsets);
        pass.set_bind_group(1, &self.buffers, &[]);
    }
}

/// One round of the sort.
#[derive(Clone, Debug)]
pub(in crate::backend) struct Round {
    pub count: BoundProgram,
    pub scan: BoundProgram,
    pub scatter: BoundProgram,
}

/// The programs of a frame.
#[derive(Debug)]
pub(in crate::backend) struct BoundPrograms {
    pub bin: BinPrograms,
    /// One for each band of each raster.
    pub film: Vec<FilmPart>,
    /// What opaque surfels are drawn by.
    pub surfels: SurfelPrograms,
    /// `None` without see-through surfels.
    pub see_through: Option<SeeThroughPrograms>,
    /// `None` where nothing is transparent.
    pub transparent: Option<TransparentPrograms>,
}

/// The programs of opaque surfels: a frame has one kind of step for them.
#[derive(Debug)]
pub(in crate::backend) enum SurfelPrograms {
    /// Steps `Paint`, or instants of step `Published`.
    Paint(PaintPrograms),
    /// Steps `Sweep`.
    Sweep(SweptPrograms),
    /// Maps and intervals of step `Published`.
    Published(MapPrograms, PublishedPrograms),
}

/// The programs that make splats, or kernels in motion, and their lists.
#[derive(Debug)]
pub(in crate::backend) struct ListPrograms {
    /// For each object, for each of its surfel buffers.
    pub project: Vec<Vec<BoundProgram>>,
    pub emit: BoundProgram,
}

/// The programs of pass `bin`, except the one that emits entries.
#[derive(Debug)]
pub(in crate::backend) struct BinPrograms {
    pub reduce: BoundProgram,
    pub scan: BoundProgram,
    pub sort: Vec<Round>,
    pub starts: BoundProgram,
}

/// The programs that write to a band's part of the film.
#[derive(Debug)]
pub(in crate::backend) struct FilmPart {
    pub resolve: BoundProgram,
    /// `None` where the film is complete when all groups are added.
    pub finish: Option<BoundProgram>,
    /// `None` where nothing is transparent. Else `resolve` makes the opaque picture, and this adds to the film.
    pub over: Option<BoundProgram>,
}

/// The programs of kernels in motion.
#[derive(Debug)]
pub(in crate::backend) struct SweptPrograms {
    pub lists: ListPrograms,
    pub visibility: BoundProgram,
    /// For each object, for each of its surfel buffers.
    pub splat_values: Vec<Vec<BoundProgram>>,
    pub attribute: BoundProgram,
}

/// The programs of the map of published kernels.
#[derive(Debug)]
pub(in crate::backend) struct MapPrograms {
    pub lists: ListPrograms,
    pub visibility: BoundProgram,
    pub store: BoundProgram,
}

/// The programs of published kernels in motion.
#[derive(Debug)]
pub(in crate::backend) struct PublishedPrograms {
    pub lists: ListPrograms,
    /// For each object, for each of its surfel buffers.
    pub splat_values: Vec<Vec<BoundProgram>>,
    pub attribute: BoundProgram,
}

/// The programs of kernels at instants.
#[derive(Debug)]
pub(in crate::backend) struct PaintPrograms {
    pub lists: ListPrograms,
    pub visibility: BoundProgram,
    /// `None` where pixels have one layer.
    pub second: Option<BoundProgram>,
    /// For each object, for each of its surfel buffers.
    pub splat_values: Vec<Vec<BoundProgram>>,
    pub attribute: BoundProgram,
}

/// The programs of see-through surfels. Depths are in a buffer of their own.
#[derive(Debug)]
pub(in crate::backend) struct SeeThroughPrograms {
    pub start: BoundProgram,
    /// Without what is behind T.
    pub paint: PaintPrograms,
    pub resolve: BoundProgram,
    pub left_out: BoundProgram,
}

/// The programs of captures and volumes.
#[derive(Debug)]
pub(in crate::backend) struct TransparentPrograms {
    /// For each object, for each of its buffers.
    pub project: Vec<Vec<BoundProgram>>,
    /// Emits the entries of lists.
    pub emit: BoundProgram,
    /// By depth.
    pub sort: Vec<Round>,
    /// The last round of the sort where there are several views.
    pub sort_by_view: [Round; 1],
    pub gather: BoundProgram,
    pub composite: BoundProgram,
}

impl Gpu {
    /// Makes room for what is uploaded, and binds the programs.
    pub(in crate::backend) fn bind(
        &mut self,
        prepared: &Prepared<'_>,
        upload: &Upload,
    ) -> Result<BoundPrograms, BackendError> {
        let DeviceState { device, buffers, pipelines, groups, .. } = &mut self.state;
        upload.fit(device, buffers)?;
        buffers.fit_environment(device, prepared.frame.surroundings.as_ref())?;
        groups.begin();
        Binder { device, pipelines, groups, buffers }.bind(prepared)
    }
}

/// The device and buffers that programs are bound to.
pub(in crate::backend) struct Binder<'a> {
    pub device: &'a Device,
    pub pipelines: &'a mut Pipelines,
    pub groups: &'a mut BindGroups,
    pub buffers: &'a Buffers,
}

impl Binder<'_> {
    /// The buffer of a name. The sort reads its buffers `from` and writes the others.
    fn buffer(b: &Buffers, slot: Slot, from: usize) -> &Buffer {
        match slot {
            Slot::Segments => &b.segments,
            Slot::Lights => &b.lights,
            Slot::Environment => &b.environment,
            Slot::Map => &b.map,
            Slot::CoverageMask => &b.coverage_mask,
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
            Slot::Values => &b.values,
            Slot::Sums => &b.sums,
            // These are bound surfel buffer by surfel buffer and band by band.
            Slot::Film | Slot::Geometry | Slot::Looks => &b.film,
            Slot::Wanted => &b.wanted,
            Slot::Gaussians => &b.gaussians,
            Slot::Order => &b.order,
            Slot::Opaque => &b.opaque,
            Slot::Peeled => &b.peeled,
            Slot::Layers => &b.layers,
            Slot::CaptureSegments => &b.capture_segments,
        }
    }

    /// Binds a program whose lists are in the buffers other than `from`. `special` buffers replace the usual ones.
    pub(super) fn program(
        &mut self,
        program: Program,
        constants: &Constants,
        from: usize,
        special: &[(Slot, BufferBinding<'_>)],
    ) -> Result<BoundProgram, BackendError> {
        let pipeline = self.pipelines.get(self.device, program, constants)?;
        let (read, written) = program.buffers();
        let all = self.buffers;
        let buffers: Vec<(Slot, BufferBinding<'_>)> = read
            .iter()
            .chain(written)
            .map(|&slot| {
                let own = special.iter().find(|(special, _)| *special == slot).map(|(_, binding)| binding.clone());
                (slot, own.unwrap_or_else(|| Self::buffer(all, slot, from).as_entire_buffer_binding()))
            })
            .collect();
        let bound = Bound::new(program, [&self.buffers.views, &self.buffers.uniforms], &buffers);
        let layouts = self.pipelines.layouts(self.device, program).clone();
        let uniform = |buffer, bytes: u64| {
            BindingResource::Buffer(BufferBinding { buffer, offset: 0, size: BufferSize::new(bytes) })
        };
        let uniforms = [
            BindGroupEntry { binding: 0, resource: uniform(&self.buffers.views, VIEW_BYTES) },
            BindGroupEntry { binding: 1, resource: uniform(&self.buffers.uniforms, TABLE_BYTES) },
        ];
        let uniforms = &uniforms[..if program.has_second_uniform() { 2 } else { 1 }];
        let mut entries = Vec::new();
        for (slot, part) in &buffers {
            entries.push(BindGroupEntry { binding: *slot as u32, resource: BindingResource::Buffer(part.clone()) });
        }
        let bind = |layout, entries| {
            let descriptor = wgpu::BindGroupDescriptor { label: Some(program.entry()), layout, entries };
            self.device.bind(&descriptor)
        };
        let make = || [bind(&layouts.uniforms, uniforms), bind(&layouts.buffers, &entries)];
        let [uniforms, buffers] = self.groups.of(bound, make);
        Ok(BoundProgram { pipeline, uniforms, buffers, calls: Arc::clone(&self.device.calls) })
    }

    /// Binds `program` for each surfel buffer of each object.
    pub(super) fn of_surfels(
        &mut self,
        program: Program,
        constants: &Constants,
        surfel_buffers: &[Vec<ModelBuffer>],
    ) -> Result<Vec<Vec<BoundProgram>>, BackendError> {
        self.of_models(program, constants, 0, surfel_buffers)
    }

    /// Binds `program` for each buffer of each object. Its lists are in the buffers other than `from`.
    pub(super) fn of_models(
        &mut self,
        program: Program,
        constants: &Constants,
        from: usize,
        buffers: &[Vec<ModelBuffer>],
    ) -> Result<Vec<Vec<BoundProgram>>, BackendError> {
        let mut one = |buffer: &ModelBuffer| {
            let special = [(Slot::Geometry, buffer.geometry()), (Slot::Looks, buffer.looks())];
            self.program(program, constants, from, &special)
        };
        buffers.iter().map(|buffers| buffers.iter().map(&mut one).collect()).collect()
    }

    /// Binds a round of a sort, which reads the buffers `from`.
    pub(super) fn round(&mut self, round: usize, from: usize) -> Result<Round, BackendError> {
        self.round_by(&vec![("SHIFT", round as u32 * DIGIT_BITS)], from)
    }

    /// The same by the digit that `constants` tell of.
    pub(super) fn round_by(&mut self, constants: &Constants, from: usize) -> Result<Round, BackendError> {
        Ok(Round {
            count: self.program(Program::SortCount, constants, from, &[])?,
            scan: self.program(Program::SortScan, &Constants::new(), from, &[])?,
            scatter: self.program(Program::SortScatter, constants, from, &[])?,
        })
    }

    /// Binds all programs of a frame.
    pub(in crate::backend) fn bind(&mut self, prepared: &Prepared<'_>) -> Result<BoundPrograms, BackendError> {
        let Prepared { frame, schedule, .. } = prepared;
        let none = Constants::new();
        let rounds = schedule
            .round_tiles
            .max(schedule.map_tiles)
            .max(1)
            .next_power_of_two()
            .trailing_zeros()
            .div_ceil(DIGIT_BITS) as usize;
        // After an even number of rounds, entries are back where they began.
        let begin = rounds % 2;
        let mut sort = Vec::new();
        for round in 0..rounds {
            sort.push(self.round(round, (begin + round) % 2)?);
        }
        let emitted = 1 - begin;
        let surfels = match frame.swept {
            Some(kernel) if kernel.is_published() => {
                let map = self.map_programs(prepared, emitted)?;
                SurfelPrograms::Published(map, self.published_programs(prepared, kernel, emitted)?)
            }
            Some(kernel) => SurfelPrograms::Sweep(self.swept_programs(prepared, kernel, emitted)?),
            None => {
                let kernel = (KernelKind::of(frame.prefilter), &prepared.channels);
                SurfelPrograms::Paint(self.paint_programs(prepared, kernel, false, emitted)?)
            }
        };
        let see_through = match prepared.see_through {
            Some(ref channels) => Some(self.see_through_programs(prepared, channels, emitted)?),
            None => None,
        };
        let captures = frame.blending.is_some();
        let transparent = if captures { Some(self.transparent_programs(prepared, emitted)?) } else { None };
        Ok(BoundPrograms {
            bin: BinPrograms {
                reduce: self.program(Program::BinReduce, &none, 0, &[])?,
                scan: self.program(Program::BinScan, &none, 0, &[])?,
                sort,
                starts: self.program(Program::BinStarts, &none, 0, &[])?,
            },
            film: self.film_parts(prepared, &prepared.film_parts())?,
            surfels,
            see_through,
            transparent,
        })
    }

    /// Binds the programs that write to the parts of the film. A part is its first byte and its length.
    fn film_parts(&mut self, prepared: &Prepared<'_>, parts: &[(u64, u64)]) -> Result<Vec<FilmPart>, BackendError> {
        let Prepared { frame, channels, planes, schedule, .. } = prepared;
        let constants = match frame.swept {
            Some(kernel) => swept_resolve_constants(frame, kernel, channels, planes),
            None => paint_resolve_constants(frame, channels, planes),
        };
        let program = match frame.swept.map(|kernel| (kernel.normalise, kernel.is_published())) {
            None => Program::Resolve,
            Some((Normalise::Interval, false)) => Program::SweptResolve,
            Some((Normalise::Once, false)) => Program::Pool,
            Some((Normalise::Interval, true)) => Program::PublishedResolve,
            Some((Normalise::Once, true)) => Program::PublishedPool,
        };
        let needs_finish = frame.swept.is_some_and(SweptKernel::needs_finish);
        let (film, opaque) = (self.buffers.film.clone(), self.buffers.opaque.clone());
        let captures = frame.blending.is_some();
        let whole = prepared.binds_whole_film();
        let part = |&(offset, bytes): &(u64, u64)| {
            // The buffer may be larger than a binding.
            let (offset, bytes) = if whole { (0, schedule.film_bytes) } else { (offset, bytes) };
            let part = BufferBinding { buffer: &film, offset, size: BufferSize::new(bytes) };
            let over = if captures { Some(self.over(prepared, part.clone())?) } else { None };
            let special = [(Slot::Film, if captures { opaque.as_entire_buffer_binding() } else { part })];
            let resolve = self.program(program, &constants, 0, &special)?;
            let finish =
                if needs_finish { Some(self.program(Program::Finish, &constants, 0, &special)?) } else { None };
            Ok(FilmPart { resolve, finish, over })
        };
        parts.iter().map(part).collect()
    }

    /// Binds the programs of kernels in motion. New lists go to the sort's buffers other than `emitted`.
    fn swept_programs(
        &mut self,
        prepared: &Prepared<'_>,
        swept: SweptKernel,
        emitted: usize,
    ) -> Result<SweptPrograms, BackendError> {
        let Prepared { frame, channels, surfel_buffers, .. } = prepared;
        // Bounds and flags are in the second part, with a filtered kernel behind them.
        let parts = [("SPLATS", (size_of::<FilteredSplat>() / size_of::<Splat>()) as u32), ("PART", 1)];
        let mut values = value_constants(frame, channels);
        values.extend(parts);
        let volume = vec![("ELLIPSOID", u32::from(swept.shape == KernelShape::Ellipsoid))];
        Ok(SweptPrograms {
            lists: ListPrograms {
                project: self.of_surfels(Program::Sweep, &volume, surfel_buffers)?,
                emit: self.program(Program::BinEmit, &parts.to_vec(), emitted, &[])?,
            },
            visibility: self.program(Program::SweptVisibility, &swept_visibility_constants(prepared), 1, &[])?,
            splat_values: self.of_surfels(Program::SplatValues, &values, surfel_buffers)?,
            attribute: self.program(Program::SweptAttribute, &swept_constants(prepared, swept), 1, &[])?,
        })
    }

    /// Binds the programs of the map of published kernels. New lists go to the sort's buffers other than `emitted`.
    fn map_programs(&mut self, prepared: &Prepared<'_>, emitted: usize) -> Result<MapPrograms, BackendError> {
        let none = Constants::new();
        Ok(MapPrograms {
            lists: ListPrograms {
                project: self.of_surfels(Program::Project(KernelKind::Disc), &none, &prepared.surfel_buffers)?,
                emit: self.program(Program::BinEmit, &none, emitted, &[])?,
            },
            visibility: self.program(Program::Visibility(KernelKind::Disc, self.device.lanes), &none, 1, &[])?,
            store: self.program(Program::StoreMap, &none, 0, &[])?,
        })
    }

    /// Binds the programs of published kernels in motion. New lists go to the sort's buffers other than `emitted`.
    fn published_programs(
        &mut self,
        prepared: &Prepared<'_>,
        swept: SweptKernel,
        emitted: usize,
    ) -> Result<PublishedPrograms, BackendError> {
        let Prepared { frame, channels, surfel_buffers, .. } = prepared;
        // Bounds and flags are in the second part.
        let parts = [("SPLATS", (size_of::<SweptSplat>() / size_of::<Splat>()) as u32), ("PART", 1)];
        let mut values = value_constants(frame, channels);
        values.extend(parts);
        Ok(PublishedPrograms {
            lists: ListPrograms {
                project: self.of_surfels(Program::PublishedSweep, &vec![("ELLIPSOID", 1)], surfel_buffers)?,
                emit: self.program(Program::BinEmit, &parts.to_vec(), emitted, &[])?,
            },
            splat_values: self.of_surfels(Program::SplatValues, &values, surfel_buffers)?,
            attribute: self.program(Program::PublishedAttribute, &swept_constants(prepared, swept), 1, &[])?,
        })
    }
}
