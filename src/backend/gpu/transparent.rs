//! Step `Composite`: its programs, and the passes that it records. Twin: `src/backend/cpu/transparent/mod.rs`.
//!
//! The Gaussians of all captures and volumes are projected and sorted together. Then slabs of depth go through `bin`,
//! which begins with program `gather`, and `composite`, the nearest first; a slab has as many splats as a batch may
//! have slots.
//!
//! All Gaussians of a sample are on the device, 68 bytes each; a binding must hold their splats, else the frame is
//! refused. Static captures are projected and sorted anew at each sample.

use std::f32::consts::{LOG2_E, TAU};

#[cfg(test)]
use super::DeviceState;
use super::bind::{Binder, BoundProgram, FilmPart, TransparentPrograms};
use super::captures::{Run, runs};
use super::constants::{composite_constants, transparent_resolve_constants};
use super::job::{Job, JobPlace};
use super::layout::{
    CaptureSegment, DIGIT_BITS, DeviceBackground, DeviceGaussian, FLAG_ANTIALIAS, FLAG_ENCODE, FLAG_KEEP_LAYER,
    FLAG_LIT, FLAG_VOLUME, LAST_SLAB, View, WORKGROUP_ITEMS, coefficients, rows,
};
use super::prepared::Prepared;
use super::programs::{Constants, Program, Slot};
use super::recorder::{Recorder, dispatch};
#[cfg(test)]
use super::timestamps::Marks;
use super::timestamps::Stage;
use super::upload::{Placed, Upload};
use crate::backend::BackendError;
use crate::film::{Aov, Blending};
use crate::frame::{Frame, PosedGroup};
use crate::math::srgb;
use crate::plan::{CompositePass, SlabPass};
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

/// Variance by which the filter widens a Gaussian, pixels^2 of the image (Kerbl et al. 2023, their program).
const DILATION: f32 = 0.3;
/// The derivative of the projection is taken no farther from the axis than this many half fields of view.
const FIELD: f32 = 1.3;
/// Bytes of the totals of a sort.
const TOTALS_BYTES: u64 = size_of::<[u32; 4]>() as u64;
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

/// What a run's Gaussians are posed by at a sample. `keeps_layers`: their layers stay those of the last projection;
/// `light`: the group's first light.
fn segment(
    place: &JobPlace<'_>,
    group: &PosedGroup,
    sample: usize,
    run: &Run<'_>,
    (keeps_layers, light): (bool, u32),
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
        first_light: light + (sample * lights) as u32,
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

/// Step `Composite` of one group, whose samples are uploaded.
#[derive(Debug)]
pub(in crate::backend) struct TransparentStep<'a> {
    runs: Vec<Run<'a>>,
    samples: Vec<PlacedSample>,
    tiles: [u32; 2],
}

/// A sample of a group, as it was uploaded. Places are those of uniforms.
#[derive(Debug)]
struct PlacedSample {
    /// The view of all Gaussians.
    view: u32,
    /// Slabs of depth, the nearest first.
    slabs: Vec<Placed>,
    backdrop: u32,
    /// The segments of runs: at the group's middle, and at the sample.
    middle: Vec<u32>,
    own: Vec<u32>,
    /// The totals of the sort of depths.
    totals: u32,
}

impl<'a> TransparentStep<'a> {
    /// Uploads a group. `surfels`: which surfels there are, in bits of [`View::flags`].
    pub(in crate::backend) fn new(
        place: JobPlace<'a>,
        group: usize,
        surfels: u32,
        entries: u64,
        upload: &mut Upload,
    ) -> Self {
        let job = Job { flags: surfels, ..place.job(group) };
        let (runs, slots) = runs(place.prepared, job.group);
        let light = upload.add_lights(&job.group.samples);
        let of = Uploaded { job, runs: &runs, slots, light, entries };
        let middle = job.group.samples.len() / 2;
        let samples = (0..job.group.samples.len()).map(|sample| of.sample([middle, sample], upload)).collect();
        Self { samples, tiles: place.area().tiles, runs }
    }

    /// Records all passes of all samples. A group has the order of its middle.
    pub(in crate::backend) fn run(&self, recorder: &mut Recorder<'_>, programs: &TransparentPrograms, film: &FilmPart) {
        for (number, sample) in self.samples.iter().enumerate() {
            for pass in CompositePass::order(number == 0, self.samples.len() > 1) {
                match pass {
                    CompositePass::ProjectMiddle => self.project(recorder, programs, sample.view, &sample.middle),
                    CompositePass::Sort => self.sort(recorder, programs, sample),
                    CompositePass::Project => self.project(recorder, programs, sample.view, &sample.own),
                    CompositePass::Composite => {
                        // Lists of a slab are composited before those of the next are made.
                        for (number, slab) in (1..).zip(&sample.slabs) {
                            list(recorder, programs, slab);
                            for pass in SlabPass::order(number == sample.slabs.len()) {
                                match pass {
                                    SlabPass::Composite => {
                                        let mut pass = recorder.pass(Stage::Composite);
                                        dispatch(&mut pass, &programs.composite, slab.tiles, slab.view);
                                    }
                                    SlabPass::Resolve => self.resolve(recorder, film, sample),
                                }
                            }
                        }
                    }
                }
            }
            recorder.flush_if_long();
        }
    }

    /// Records pass `project` of the runs whose segments are at these places.
    fn project(&self, recorder: &mut Recorder<'_>, programs: &TransparentPrograms, view: u32, segments: &[u32]) {
        let mut pass = recorder.pass(Stage::Project);
        for (run, &segment) in self.runs.iter().zip(segments) {
            let program = &programs.project[run.object][run.buffer];
            program.dispatch(&mut pass, &[view, segment], [run.count.div_ceil(256), 1, 1]);
        }
    }

    /// Records pass `sort`, by the depths that were projected last.
    fn sort(&self, recorder: &mut Recorder<'_>, programs: &TransparentPrograms, sample: &PlacedSample) {
        let slots: u32 = self.runs.iter().map(|run| run.count).sum();
        if slots == 0 {
            return;
        }
        let state = recorder.state;
        let b = &state.buffers;
        // Pass `bin` writes its own.
        recorder.encoder.copy_buffer_to_buffer(&b.uniforms, u64::from(sample.totals), &b.totals, 0, TOTALS_BYTES);
        state.sort(&mut recorder.pass(Stage::Sort), &programs.sort, sample.view);
        recorder.encoder.copy_buffer_to_buffer(&b.lists[0], 0, &b.order, 0, 4 * u64::from(slots));
    }

    /// Records pass `resolve`.
    fn resolve(&self, recorder: &mut Recorder<'_>, film: &FilmPart, sample: &PlacedSample) {
        let mut pass = recorder.pass(Stage::Resolve);
        if let Some(over) = &film.over {
            over.dispatch(&mut pass, &[sample.view, sample.backdrop], [self.tiles[0], self.tiles[1], 1]);
        }
    }
}

/// Records pass `bin` of a slab: gathers its splats in the order of depth, and lists them.
fn list(recorder: &mut Recorder<'_>, programs: &TransparentPrograms, slab: &Placed) {
    let groups = [slab.slots.div_ceil(WORKGROUP_ITEMS), 1];
    dispatch(&mut recorder.pass(Stage::Bin), &programs.gather, groups, slab.view);
    recorder.bin(&programs.emit, slab);
}

/// A group that is uploaded, sample by sample.
#[derive(Clone, Copy)]
struct Uploaded<'a> {
    job: Job<'a>,
    runs: &'a [Run<'a>],
    /// Gaussians of all runs.
    slots: u32,
    /// Its first light.
    light: u32,
    /// Entries that there is room for.
    entries: u64,
}

impl Uploaded<'_> {
    /// Uploads a sample, in the order of depth of sample `middle`.
    fn sample(&self, [middle, sample]: [usize; 2], upload: &mut Upload) -> PlacedSample {
        let Job { place, group, .. } = self.job;
        let of_group = self.job.view(self.entries);
        let all = View {
            slots: self.slots,
            weight: group.samples[sample].weight,
            first_light: self.light + of_group.first_light,
            ..of_group
        };
        let most = place.prepared.schedule.slots.min(u64::from(u32::MAX)) as u32;
        let mut slab = |first: u32| {
            let view = View {
                first_place: first,
                slots: most.min(self.slots - first),
                resumes: u32::from(first > 0),
                flags: all.flags | (u32::from(first.saturating_add(most) >= self.slots) * LAST_SLAB),
                ..all
            };
            Placed {
                view: upload.add_views(&[view]),
                views: 1,
                later: Vec::new(),
                slots: view.slots,
                tiles: view.tiles,
                round_tiles: view.round_tiles,
                surfels: Vec::new(),
            }
        };
        // A group without Gaussians has a slab, too: its opaque picture goes to the film.
        let slabs = (0..self.slots.max(1)).step_by(most as usize).map(&mut slab).collect();
        let totals: [u32; 4] = [self.slots.div_ceil(WORKGROUP_ITEMS), 1, 1, self.slots];
        let mut segments = |sample, keeps_layers| {
            let segment = |run| segment(&place, group, sample, run, (keeps_layers, self.light));
            self.runs.iter().map(|run| upload.add_uniform(bytemuck::bytes_of(&segment(run)))).collect()
        };
        PlacedSample {
            slabs,
            middle: segments(middle, false),
            own: segments(sample, true),
            view: upload.add_views(&[all]),
            backdrop: upload.add_uniform(bytemuck::bytes_of(&backdrop(place.prepared.frame))),
            totals: upload.add_uniform(bytemuck::cast_slice(&totals)),
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
        let position = &frame.rasters[0].positions[0];
        let band = prepared.schedule.bands(0).next().unwrap();
        let place = JobPlace { prepared: &prepared, position, raster: 0, band, film: 0, film_tile: 0 };
        let (mut upload, job) = (Upload::default(), place.job(0));
        let (runs, slots) = runs(&prepared, job.group);
        let light = upload.add_lights(&job.group.samples);
        let entries = self.state.buffers.entries;
        let of = Uploaded { job, runs: &runs, slots, light, entries };
        let sample = of.sample([0, 0], &mut upload);
        let programs = self.bind(&prepared, &upload).unwrap();
        upload.write(&self.state);
        let mut marks = Marks::new(&self.state.device).unwrap();
        let (state, encoder) = (&self.state, self.state.encoder());
        let mut recorder = Recorder::new(state, &programs, &mut marks, encoder);
        let step = TransparentStep { samples: Vec::new(), tiles: place.area().tiles, runs };
        step.project(&mut recorder, programs.transparent.as_ref().unwrap(), sample.view, &sample.middle);
        recorder.flush();
        self.state.device.check().unwrap();
        slots as usize
    }

    /// Makes room for a sort of `entries` entries.
    pub(in crate::backend) fn make_room_to_sort(&mut self, entries: u64) {
        let DeviceState { device, buffers, .. } = &mut self.state;
        buffers.fit_entries(device, entries).unwrap();
    }

    /// The sort of depths.
    pub(in crate::backend) fn rounds_of_depths(&mut self) -> Vec<super::bind::Round> {
        let DeviceState { device, buffers, pipelines, groups, .. } = &mut self.state;
        let mut binder = Binder { device, pipelines, groups, buffers };
        (0..ROUNDS).map(|round| binder.round(round, round % 2).unwrap()).collect()
    }
}
