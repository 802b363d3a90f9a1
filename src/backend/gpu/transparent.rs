//! Step `Composite`: its programs, and the passes that it records. Twin: `src/backend/cpu/transparent/mod.rs`.
//!
//! The Gaussians of all captures and volumes are projected and sorted together. Then slabs of depth go through `bin`,
//! which begins with program `gather`, and `composite`, the nearest first; a slab has as many splats as a batch may
//! have slots.
//!
//! All Gaussians of a sample are on the device, 68 bytes each; a binding must hold their splats, else the frame is
//! refused. Static captures are projected and sorted anew at each sample.

use std::f32::consts::{LOG2_E, TAU};

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use wgpu::{CommandEncoder, ComputePassDescriptor};

use super::DeviceState;
use super::bind::{Binder, BoundProgram, TransparentPrograms};
use super::captures::{Run, runs, segment_at};
use super::constants::{composite_constants, transparent_resolve_constants};
use super::job::{JobPlace, dispatch, group_scale, view_offset};
use super::layout::{
    CaptureSegment, DIGIT_BITS, DeviceBackground, DeviceGaussian, FLAG_ANTIALIAS, FLAG_ENCODE, FLAG_KEEP_LAYER,
    FLAG_LIT, FLAG_VOLUME, LAST_SLAB, UNIFORM_STRIDE, View, WORKGROUP_ITEMS, coefficients, lights, rows,
};
use super::prepared::Prepared;
use super::programs::{Constants, Program, Slot};
use super::timestamps::{Marks, Stage};
use crate::backend::BackendError;
use crate::film::{Aov, Blending};
use crate::frame::{Frame, PosedGroup};
use crate::math::srgb;
use crate::plan::{CompositePass, SlabPass};

/// Variance by which the filter widens a Gaussian, pixels^2 of the image (Kerbl et al. 2023, their program).
const DILATION: f32 = 0.3;
/// The derivative of the projection is taken no farther from the axis than this many half fields of view.
const FIELD: f32 = 1.3;
/// Bits of a depth.
const DEPTH_BITS: u32 = 32;
/// The sort of depths begins and ends in the first buffers.
const ROUNDS: usize = DEPTH_BITS.div_ceil(DIGIT_BITS) as usize;
const _: () = assert!(ROUNDS.is_multiple_of(2));

impl Binder<'_> {
    /// Binds the programs of captures and volumes. New lists go to the sort's buffers other than `emitted`.
    pub(super) fn transparent_programs(
        &mut self,
        prepared: &Prepared<'_>,
        emitted: usize,
    ) -> Result<TransparentPrograms, BackendError> {
        let Prepared { frame, channels, planes, gaussian_buffers, .. } = prepared;
        let none = Constants::new();
        let velocity = vec![("VELOCITY", u32::from(frame.aovs.contains(&Aov::Velocity)))];
        Ok(TransparentPrograms {
            project: self.of_models(Program::GaussianProject, &velocity, 1, gaussian_buffers)?,
            emit: self.program(Program::BinEmit, &none, emitted, &[])?,
            sort: (0..ROUNDS).map(|round| self.round(round, round % 2)).collect::<Result<_, _>>()?,
            gather: self.program(Program::Gather, &none, 0, &[])?,
            // Sorted lists are in the first buffers.
            composite: self.program(Program::Composite, &composite_constants(frame, channels, planes), 1, &[])?,
        })
    }

    /// Binds the program that adds what is transparent to a part of the film.
    pub(super) fn over(
        &mut self,
        prepared: &Prepared<'_>,
        part: wgpu::BufferBinding<'_>,
    ) -> Result<BoundProgram, BackendError> {
        let Prepared { frame, channels, planes, .. } = prepared;
        let constants = transparent_resolve_constants(frame, channels, planes);
        self.program(Program::TransparentResolve, &constants, 0, &[(Slot::Film, part)])
    }
}

/// What a run's Gaussians are posed by at a sample. `keeps_layers`: their layers stay those of the last projection.
fn segment(
    place: &JobPlace<'_>,
    group: &PosedGroup,
    sample: usize,
    run: &Run<'_>,
    keeps_layers: bool,
) -> CaptureSegment {
    let (frame, raster) = (place.prepared.frame, &place.position.raster);
    let object = &frame.objects[run.object];
    let posed = &group.samples[sample].objects[run.object];
    let &Run { gaussians, drawing, .. } = run;
    let degree = usize::from(drawing.harmonics.min(gaussians.degree));
    let [low, high] = drawing.crop.map_or([Vec3::MIN, Vec3::MAX], |crop| crop.map(DVec3::as_vec3));
    let stride = frame.stride as f32;
    let antialias = drawing.antialias.unwrap_or(gaussians.antialiased);
    let encode = gaussians.linear && frame.blending == Some(Blending::Coded);
    let (volume, lit) = (object.is_volume(), !gaussians.normal.is_empty());
    let flags = [
        (antialias, FLAG_ANTIALIAS),
        (encode, FLAG_ENCODE),
        (volume, FLAG_VOLUME),
        (lit, FLAG_LIT),
        (keeps_layers, FLAG_KEEP_LAYER),
    ];
    let flags = flags.into_iter().filter(|(is_set, _)| *is_set).map(|(_, flag)| flag).sum();
    let lights = group.samples[sample].lights.len();
    CaptureSegment {
        screen: rows(&posed.screen_from_model, posed.screen_origin),
        rate: rows(&posed.screen_rate, posed.screen_origin_rate),
        centre: rows(&posed.centre_from_model, posed.centre_origin),
        motion: rows(&posed.motion_from_model, posed.motion_origin),
        eye: posed.eye.to_array(),
        // Its depths count in the order of a group even where it is hidden.
        near: if posed.visible { posed.near } else { f32::MAX },
        field: [0, 1].map(|i| FIELD * 0.5 * frame.size[i] as f32 / stride),
        dilation: if volume { raster.variance(frame.prefilter) } else { DILATION / (stride * stride) },
        opacity: drawing.opacity as f32,
        low: low.extend(0.0).to_array(),
        high: high.extend(0.0).to_array(),
        tint: drawing.flat.map_or([0.0; 4], |flat| flat.extend(1.0).to_array()),
        first_slot: run.first_slot,
        count: run.count,
        first_index: run.first_index,
        flags,
        harmonics_each: gaussians.harmonics_each() as u32,
        harmonics_used: ((degree + 1).pow(2) - 1) as u32,
        area: posed.screen_from_model.determinant().abs() * (LOG2_E / TAU),
        layer: layer(frame, group),
        normal: rows(&posed.normal_matrix, Vec3::ZERO),
        world: rows(&posed.world_from_model, posed.world_origin),
        material: coefficients(object.material.unwrap_or_default()),
        first_light: (sample * lights) as u32,
        lights: lights as u32,
        ..CaptureSegment::zeroed()
    }
}

/// Depth of a layer of volumes, scene units: the least of all volumes, at the group's middle.
fn layer(frame: &Frame, group: &PosedGroup) -> f32 {
    let posed = group.samples[group.samples.len() / 2].objects.iter().zip(&frame.objects);
    let volumes = posed.filter(|(_, object)| object.is_volume()).map(|(posed, _)| posed.epsilon);
    volumes.fold(f32::MAX, f32::min).max(f32::MIN_POSITIVE)
}

fn backdrop(frame: &Frame) -> DeviceBackground {
    let colour = frame.background.colour.as_vec3().to_array();
    let coded = frame.blending == Some(Blending::Coded);
    let shown = if coded { colour.map(srgb::from_linear) } else { colour };
    let with = |[r, g, b]: [f32; 3], w| [r, g, b, w];
    DeviceBackground {
        colour: with(colour, f32::from(u8::from(frame.background.transparent))),
        shown: with(shown, 0.0),
    }
}

/// Step `Composite` of one group.
pub(in crate::backend) struct TransparentStep<'a> {
    place: JobPlace<'a>,
    group: &'a PosedGroup,
    programs: &'a TransparentPrograms,
    /// Which surfels there are, in bits of [`View::flags`].
    surfels: u32,
    runs: Vec<Run<'a>>,
    /// Gaussians of all runs.
    slots: u32,
}

impl<'a> TransparentStep<'a> {
    pub(in crate::backend) fn new(
        place: JobPlace<'a>,
        group: usize,
        programs: &'a TransparentPrograms,
        surfels: u32,
    ) -> Self {
        let group = &place.position.groups[group];
        let (runs, slots) = runs(place.prepared, group);
        Self { place, group, programs, surfels, runs, slots }
    }

    /// Records and submits all passes of all samples. A group has the order of its middle.
    pub(in crate::backend) fn run(&self, state: &DeviceState, marks: &mut Marks) {
        let samples = self.group.samples.len();
        let middle = samples / 2;
        for sample in 0..samples {
            let slabs = self.upload(state, sample, middle);
            let mut encoder = state.encoder();
            for pass in CompositePass::order(sample == 0, samples > 1) {
                match pass {
                    CompositePass::ProjectMiddle => self.project(&mut encoder, 0, marks),
                    CompositePass::Sort => self.sort(state, &mut encoder, marks),
                    CompositePass::Project => self.project(&mut encoder, 1, marks),
                    CompositePass::Composite => {
                        // Lists of a slab are composited before those of the next are made.
                        for (number, slab) in (1..).zip(&slabs) {
                            self.list(state, &mut encoder, slab, number, marks);
                            for pass in SlabPass::order(number == slabs.len()) {
                                match pass {
                                    SlabPass::Composite => self.composite(&mut encoder, number, marks),
                                    SlabPass::Resolve => self.resolve(&mut encoder, marks),
                                }
                            }
                        }
                    }
                }
            }
            state.flush(&mut encoder, marks);
        }
    }

    /// Uploads views and segments. Returns the views of slabs; they come after the one of all.
    pub(in crate::backend) fn upload(&self, state: &DeviceState, sample: usize, middle: usize) -> Vec<View> {
        let (prepared, raster) = (self.place.prepared, &self.place.position.raster);
        let (frame, area) = (prepared.frame, self.place.area());
        let all = View {
            pixels: area.pixels.to_array(),
            corner: area.corner,
            tiles: area.tiles,
            first_tile_row: area.first_tile_row,
            entry_capacity: state.buffers.entries.min(u64::from(u32::MAX)) as u32,
            slots: self.slots,
            weight: self.group.samples[sample].weight,
            flags: self.surfels,
            opaque_scale: group_scale(self.group),
            ..View::of(frame, raster, self.group, &prepared.channels.shared)
        };
        let most = prepared.schedule.slots.min(u64::from(u32::MAX)) as u32;
        let slab = |first: u32| View {
            first_place: first,
            slots: most.min(self.slots - first),
            resumes: u32::from(first > 0),
            flags: all.flags | (u32::from(first.saturating_add(most) >= self.slots) * LAST_SLAB),
            ..all
        };
        // A group without Gaussians has a slab, too: its opaque picture goes to the film.
        let slabs: Vec<View> = (0..self.slots.max(1)).step_by(most as usize).map(slab).collect();
        let (mut views, mut segments) = (Vec::new(), Vec::new());
        let pad = |bytes: &mut Vec<u8>| bytes.resize(bytes.len().next_multiple_of(UNIFORM_STRIDE as usize), 0);
        for view in [all].iter().chain(&slabs) {
            views.extend_from_slice(bytemuck::bytes_of(view));
            pad(&mut views);
        }
        segments.extend_from_slice(bytemuck::bytes_of(&backdrop(frame)));
        pad(&mut segments);
        for (sample, keeps_layers) in [(middle, false), (sample, true)] {
            for run in &self.runs {
                let segment = segment(&self.place, self.group, sample, run, keeps_layers);
                segments.extend_from_slice(bytemuck::bytes_of(&segment));
                pad(&mut segments);
            }
        }
        // Totals for the sort of depths; pass `bin` writes its own.
        let totals = [self.slots.div_ceil(WORKGROUP_ITEMS), 1, 1, self.slots];
        let device = &state.device;
        device.write(&state.buffers.views, 0, &views);
        device.write(&state.buffers.segments, 0, &segments);
        device.write(&state.buffers.totals, 0, bytemuck::cast_slice(&totals));
        device.write(&state.buffers.lights, 0, bytemuck::cast_slice(&lights(&self.group.samples)));
        slabs
    }

    /// Records pass `project`: of the middle for `set` 0, of the sample for 1.
    pub(in crate::backend) fn project(&self, encoder: &mut CommandEncoder, set: usize, marks: &mut Marks) {
        let timestamp_writes = marks.mark(Stage::Project);
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        for (number, run) in self.runs.iter().enumerate() {
            let segment = segment_at(set * self.runs.len() + number);
            let program = &self.programs.project[run.object][run.buffer];
            program.dispatch(&mut recorder, &[0, view_offset(segment)], [run.count.div_ceil(256), 1]);
        }
    }

    /// Records pass `sort`, by the depths that were projected last.
    pub(in crate::backend) fn sort(&self, state: &DeviceState, encoder: &mut CommandEncoder, marks: &mut Marks) {
        if self.slots == 0 {
            return;
        }
        let timestamp_writes = marks.mark(Stage::Sort);
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        state.sort(&mut recorder, &self.programs.sort, 0);
        drop(recorder);
        let b = &state.buffers;
        encoder.copy_buffer_to_buffer(&b.lists[0], 0, &b.order, 0, 4 * u64::from(self.slots));
    }

    /// Records pass `bin` of a slab, whose view is `number`: gathers its splats in the order of depth, and lists them.
    pub(in crate::backend) fn list(
        &self,
        state: &DeviceState,
        encoder: &mut CommandEncoder,
        slab: &View,
        number: usize,
        marks: &mut Marks,
    ) {
        let timestamp_writes = marks.mark(Stage::Bin);
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        let groups = [slab.slots.div_ceil(WORKGROUP_ITEMS), 1];
        dispatch(&mut recorder, &self.programs.gather, groups, view_offset(number));
        let programs = self.place.programs;
        state.lists(&mut recorder, programs, &self.programs.emit, slab.slots, slab.tiles, view_offset(number));
    }

    /// Records pass `composite` of a slab, whose view is `number`.
    pub(in crate::backend) fn composite(&self, encoder: &mut CommandEncoder, number: usize, marks: &mut Marks) {
        let timestamp_writes = marks.mark(Stage::Composite);
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        dispatch(&mut recorder, &self.programs.composite, self.place.area().tiles, view_offset(number));
    }

    /// Records pass `resolve`.
    fn resolve(&self, encoder: &mut CommandEncoder, marks: &mut Marks) {
        let timestamp_writes = marks.mark(Stage::Resolve);
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        if let Some(over) = &self.place.film.over {
            over.dispatch(&mut recorder, &[0, 0], self.place.area().tiles);
        }
    }
}

const _: () = assert!(size_of::<DeviceGaussian>() == size_of::<crate::layout::Splat>());

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may stop")]
impl super::Gpu {
    /// Projects the Gaussians of the first sample of a frame. Returns their number.
    pub(in crate::backend) fn project_first(&mut self, frame: &Frame) -> usize {
        let prepared = self.prepare(frame).unwrap();
        let mut marks = Marks::new(&self.state.device).unwrap();
        let programs = self.bind(&prepared, &mut marks).unwrap();
        let band = prepared.schedule.bands(0).next().unwrap();
        let position = &frame.rasters[0].positions[0];
        let place =
            JobPlace { prepared: &prepared, programs: &programs, position, raster: 0, band, film: &programs.film[0] };
        let step = TransparentStep::new(place, 0, programs.transparent.as_ref().unwrap(), 0);
        step.upload(&self.state, 0, 0);
        let mut encoder = self.state.encoder();
        step.project(&mut encoder, 0, &mut marks);
        self.state.device.submit([encoder]);
        self.state.device.check().unwrap();
        step.slots as usize
    }

    /// Makes room for a sort of `entries` entries.
    pub(in crate::backend) fn make_room_to_sort(&mut self, entries: u64) {
        let DeviceState { device, buffers, .. } = &mut self.state;
        buffers.fit_entries(device, entries).unwrap();
        buffers.fit_group(device, 1, 1, 1).unwrap();
    }

    /// The sort of depths.
    pub(in crate::backend) fn rounds_of_depths(&mut self) -> Vec<super::bind::Round> {
        let DeviceState { device, buffers, pipelines, groups, .. } = &mut self.state;
        let mut binder = Binder { device, pipelines, groups, buffers };
        (0..ROUNDS).map(|round| binder.round(round, round % 2).unwrap()).collect()
    }
}
