//! Binds programs to their buffers and pipelines, when they are needed for the first time.

use std::collections::HashMap;
use std::sync::Arc;

use wgpu::{
    BindGroup, BindGroupEntry, BindingResource, Buffer, BufferBinding, BufferSize, ComputePass, ComputePipeline,
};

use super::bind_groups::Bound;
use super::calls::Calls;
use super::constants::{Digit, constant};
use super::layout::{DIGIT_BITS, VIEW_BYTES};
use super::passes::Program;
use super::pipelines::Constants;
use super::prepared::Prepared;
use super::slots::{Slot, TABLE_BYTES};
use super::steps::Kind;
use super::upload::Upload;
use super::{DeviceState, Gpu};
use crate::backend::BackendError;

/// A program that is ready to run.
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

    /// Records as many workgroups as three numbers of a buffer say, from byte `at` on.
    pub(in crate::backend) fn dispatch_indirect(
        &self,
        pass: &mut ComputePass<'_>,
        offsets: &[u32],
        (groups, at): (&Buffer, u64),
    ) {
        self.calls.dispatch();
        self.set(pass, offsets);
        pass.dispatch_workgroups_indirect(groups, at);
    }

    fn set(&self, pass: &mut ComputePass<'_>, offsets: &[u32]) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.uniforms, offsets);
        pass.set_bind_group(1, &self.buffers, &[]);
    }
}

/// What a program is bound for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) struct Use {
    pub kind: Kind,
    /// The part of the film that it may write.
    pub film: usize,
    pub own: Own,
}

/// What it is bound for beside its step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum Own {
    Nothing,
    /// An object, and one of the buffers of its model.
    Model(usize, usize),
    /// A round of a sort, which reads the first buffers of entries and writes the others, or the other way round.
    Sort {
        by: Digit,
        reads_first: bool,
    },
}

/// The programs that were bound since the frame began, or since buffers grew.
#[derive(Debug, Default)]
pub(in crate::backend) struct BoundPrograms(HashMap<(Program, Use), BoundProgram>);

/// The device and buffers that the programs of a frame are bound to.
pub(in crate::backend) struct Binder<'a> {
    pub prepared: &'a Prepared<'a>,
    pub state: &'a mut DeviceState,
    pub bound: &'a mut BoundPrograms,
}

impl Gpu {
    /// Makes room for what is uploaded, uploads the environment, and begins a round of bind groups.
    pub(in crate::backend) fn fit(&mut self, prepared: &Prepared<'_>, upload: &Upload) -> Result<(), BackendError> {
        let DeviceState { device, buffers, groups, .. } = &mut self.state;
        upload.fit(device, buffers)?;
        buffers.fit_environment(device, prepared.frame.surroundings.as_ref())?;
        groups.begin();
        Ok(())
    }
}

/// Rounds of the sort of entries by their tiles. After an even number of rounds, entries are back where they began.
pub(super) fn rounds_of_tiles(prepared: &Prepared<'_>) -> u32 {
    let tiles = prepared.schedule.round_tiles.max(prepared.schedule.map_tiles).max(1);
    tiles.next_power_of_two().trailing_zeros().div_ceil(DIGIT_BITS)
}

impl Binder<'_> {
    /// The program, bound.
    pub(in crate::backend) fn program(&mut self, program: Program, of: Use) -> Result<BoundProgram, BackendError> {
        if let Some(bound) = self.bound.0.get(&(program, of)) {
            return Ok(bound.clone());
        }
        let bound = self.bind(program, of)?;
        Ok(self.bound.0.entry((program, of)).or_insert(bound).clone())
    }

    fn bind(&mut self, program: Program, of: Use) -> Result<BoundProgram, BackendError> {
        let (prepared, row) = (self.prepared, program.row());
        let frame = prepared.frame;
        let DeviceState { device, pipelines, groups, buffers, .. } = &mut *self.state;
        let variant = program.variant(of.kind.kernel(frame), device.form);
        let mut constants = Constants::new();
        let digit = match of.own {
            Own::Sort { by, .. } => Some(by),
            _ => None,
        };
        for &name in pipelines.overrides(variant) {
            match constant(prepared, of.kind, digit, name) {
                Some(value) => constants.push((name, value)),
                None => return Err(device.error(format!("program `{}`: {name} has no value", row.entry))),
            }
        }
        let pipeline = pipelines.get(device, variant, constants)?;
        let layouts = pipelines.layouts(device, program).clone();
        // Lists are emitted into the buffers from which the sort ends in the first ones.
        let in_first = |slot: Slot| match of.own {
            Own::Sort { reads_first, .. } => reads_first == matches!(slot, Slot::SortedKeys | Slot::SortedList),
            _ => program != Program::BinEmit || rounds_of_tiles(prepared).is_multiple_of(2),
        };
        let buffer = |slot: Slot| {
            if let Own::Model(object, buffer) = of.own
                && matches!(slot, Slot::Geometry | Slot::Looks)
            {
                let of_captures = frame.objects[object].shape.gaussians().is_some();
                let models = if of_captures { &prepared.gaussian_buffers } else { &prepared.surfel_buffers };
                let model = &models[object][buffer];
                return if slot == Slot::Geometry { model.geometry() } else { model.looks() };
            }
            let slot = match of.kind.other_slot(program, slot, frame) {
                Slot::WrittenTotals => Slot::Totals,
                Slot::Keys | Slot::SortedKeys if in_first(slot) => Slot::Keys,
                Slot::Keys | Slot::SortedKeys => Slot::SortedKeys,
                Slot::List | Slot::SortedList if in_first(slot) => Slot::List,
                Slot::List | Slot::SortedList => Slot::SortedList,
                other => other,
            };
            match slot {
                Slot::Film => prepared.film_part(of.film, &buffers[slot]),
                _ => buffers[slot].as_entire_buffer_binding(),
            }
        };
        let parts: Vec<(Slot, BufferBinding<'_>)> = row.slots().map(|slot| (slot, buffer(slot))).collect();
        let both = [&buffers[Slot::Views], &buffers[Slot::Tables]];
        let bind = |layout, entries: &[BindGroupEntry<'_>]| {
            device.bind(&wgpu::BindGroupDescriptor { label: Some(row.entry), layout, entries })
        };
        let entry = |binding: u32, part| BindGroupEntry { binding, resource: BindingResource::Buffer(part) };
        let make = || {
            let part = |buffer, bytes: u64| BufferBinding { buffer, offset: 0, size: BufferSize::new(bytes) };
            let uniforms = [entry(0, part(both[0], VIEW_BYTES)), entry(1, part(both[1], TABLE_BYTES))];
            let buffers: Vec<_> = parts.iter().map(|(slot, part)| entry(*slot as u32, part.clone())).collect();
            [bind(&layouts.uniforms, &uniforms[..row.uniforms()]), bind(&layouts.buffers, &buffers)]
        };
        let [uniforms, buffers] = groups.of(Bound::new(program, both, &parts), make);
        Ok(BoundProgram { pipeline, uniforms, buffers, calls: Arc::clone(&device.calls) })
    }
}
