//! Step `Composite`: its programs, and the passes that it records. Twin: `src/backend/cpu/transparent/mod.rs`.
//!
//! The Gaussians of all captures and volumes are projected and sorted together. Then slabs of depth go through `bin`,
//! which begins with program `gather`, and `composite`, the nearest first; a slab has as many splats as a batch may
//! have slots.
//!
//! All Gaussians of a sample are on the device, 68 bytes each; a binding must hold their splats, else the frame is
//! refused. Static captures are projected and sorted anew at each sample. Groups of one sample each go through the
//! passes together as far as there is room: their Gaussians are sorted by depth, and then by group.

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
use super::recorder::{Recorder, dispatch, in_stretches, of_buffers};
#[cfg(test)]
use super::timestamps::Marks;
use super::timestamps::Stage;
use super::upload::{Placed, SurfelDispatch, Tables, Upload, join_films};
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
        let Prepared { frame, gaussian_buffers, .. } = prepared;
        let none = Constants::new();
        let velocity = vec![("VELOCITY", u32::from(frame.aovs.contains(&Aov::Velocity)))];
        Ok(TransparentPrograms {
            project: self.of_models(Program::GaussianProject, &velocity, 1, gaussian_buffers)?,
            emit: self.program(Program::BinEmit, &none, emitted, &[])?,
            sort: (0..ROUNDS).map(|round| self.round(round, round % 2)).collect::<Result<_, _>>()?,
            sort_by_view: [self.round_by(&vec![("BY_VIEW", 1)], 0)?],
            gather: self.program(Program::Gather, &none, 0, &[])?,
            // Sorted lists are in the first buffers.
            composite: self.program(Program::Composite, &composite_constants(prepared), 1, &[])?,
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

/// Step `Composite`, of one group sample by sample, or of a round of groups that have one sample each.
#[derive(Debug)]
pub(in crate::backend) struct TransparentStep {
    samples: Vec<PlacedSample>,
}

/// A sample of each group of a round, as they were uploaded.
#[derive(Debug)]
struct PlacedSample {
    /// Slabs of depth, the nearest first. Each has the views of all groups; a round of several groups has one slab.
    slabs: Vec<Placed>,
    /// What projects Gaussians at the middles of groups, and at the samples themselves.
    middle: Vec<SurfelDispatch>,
    own: Vec<SurfelDispatch>,
    /// Gaussians of all groups.
    slots: u32,
    /// Where the background and the totals of the sort of depths are, bytes.
    backdrop: u32,
    totals: u32,
}

/// A group whose Gaussians are uploaded.
struct Part<'a> {
    job: Job<'a>,
    runs: Vec<Run<'a>>,
    /// Gaussians of all runs.
    slots: u32,
    /// Its first light.
    light: u32,
}

impl<'a> Part<'a> {
    fn new(job: Job<'a>, upload: &mut Upload) -> Self {
        let (runs, slots) = runs(job.place.prepared, job.group);
        Self { job, runs, slots, light: upload.add_lights(&job.group.samples) }
    }

    /// Adds its segments at a sample, as view `number`, to `tables`.
    fn add_segments(
        &self,
        (sample, keeps_layers): (usize, bool),
        (number, first_slot): (usize, u32),
        tables: &mut Tables,
        upload: &mut Upload,
    ) {
        for run in &self.runs {
            let own = segment(&self.job.place, self.job.group, sample, run, (keeps_layers, self.light));
            let own = CaptureSegment { view: number as u32, first_slot: first_slot + run.first_slot, ..own };
            tables.add([run.object, run.buffer], upload.add_capture(&own), run.count);
        }
    }
}

impl TransparentStep {
    /// Uploads a round of groups of one sample each, or one group of several. Flags of jobs say which surfels there
    /// are. `entries`: those that there is room for.
    pub(in crate::backend) fn new(jobs: &[Job<'_>], entries: u64, upload: &mut Upload) -> Self {
        let parts: Vec<_> = jobs.iter().map(|&job| Part::new(job, upload)).collect();
        let samples = jobs.iter().map(|job| job.group.samples.len()).max().unwrap_or(0);
        Self { samples: (0..samples).map(|sample| PlacedSample::new(&parts, sample, entries, upload)).collect() }
    }

    /// Records all passes of all samples. A group has the order of its middle.
    pub(in crate::backend) fn run(&self, recorder: &mut Recorder<'_>, programs: &TransparentPrograms, film: &FilmPart) {
        for (number, sample) in self.samples.iter().enumerate() {
            for pass in CompositePass::order(number == 0, self.samples.len() > 1) {
                match pass {
                    CompositePass::ProjectMiddle => sample.project(recorder, programs, &sample.middle),
                    CompositePass::Sort => sample.sort(recorder, programs),
                    CompositePass::Project => sample.project(recorder, programs, &sample.own),
                    CompositePass::Composite => {
                        // Lists of a slab are composited before those of the next are made.
                        for (number, slab) in (1..).zip(&sample.slabs) {
                            list(recorder, programs, slab);
                            for pass in SlabPass::order(number == sample.slabs.len()) {
                                match pass {
                                    SlabPass::Composite => {
                                        in_stretches(&mut recorder.pass(Stage::Composite), &programs.composite, slab);
                                    }
                                    SlabPass::Resolve => sample.resolve(recorder, film, slab),
                                }
                            }
                        }
                    }
                }
            }
            recorder.flush_if_long();
        }
    }
}

impl PlacedSample {
    /// Uploads sample `sample` of each group, in the order of depth of the group's middle.
    fn new(parts: &[Part<'_>], sample: usize, entries: u64, upload: &mut Upload) -> Self {
        let mut views = Vec::new();
        let [mut middles, mut own] = [Tables::default(), Tables::default()];
        let mut placed = Placed { views: parts.len() as u32, ..Placed::default() };
        for (number, part) in parts.iter().enumerate() {
            let (job, samples) = (&part.job, &part.job.group.samples);
            let of_group = job.view(entries);
            views.push(View {
                weight: samples[sample].weight,
                first_light: part.light + of_group.first_light,
                views: placed.views,
                number: number as u32,
                rest: number as u32,
                first_tile: placed.round_tiles,
                first_slot: placed.slots,
                ..of_group
            });
            let as_view = (number, placed.slots);
            // All samples have the order of the first one's.
            if sample == 0 {
                part.add_segments((samples.len() / 2, false), as_view, &mut middles, upload);
            }
            if samples.len() > 1 {
                part.add_segments((sample, true), as_view, &mut own, upload);
            }
            placed.slots += part.slots;
            placed.round_tiles += of_group.round_tiles;
            placed.tiles = [0, 1].map(|i| placed.tiles[i].max(of_group.tiles[i]));
        }
        join_films(&mut views);
        let (slots, prepared) = (placed.slots, parts[0].job.place.prepared);
        // A round of several groups has room for all.
        let most = match parts {
            [_] => prepared.schedule.slots.min(u64::from(u32::MAX)) as u32,
            _ => u32::MAX,
        };
        let longest = parts.iter().map(|part| part.slots.min(most)).max().unwrap_or(0);
        let stretches = u64::from(longest).div_ceil(parts[0].job.stretch).max(1) as u32;
        let mut slab = |first: u32| {
            let slots = most.min(slots - first);
            let is_last = first.saturating_add(most) >= placed.slots;
            let mut of_stretch = |stretch: u32| {
                let of_view = |view: &View| View {
                    first_place: first,
                    slots,
                    round_tiles: placed.round_tiles,
                    resumes: u32::from(first > 0 || stretch > 0),
                    stretch,
                    flags: view.flags | (u32::from(is_last && stretch + 1 == stretches) * LAST_SLAB),
                    ..*view
                };
                upload.add_views(&views.iter().map(of_view).collect::<Vec<_>>())
            };
            let view = of_stretch(0);
            Placed { view, later: (1..stretches).map(of_stretch).collect(), slots, ..placed.clone() }
        };
        // Groups without Gaussians have a slab, too: their opaque pictures go to the film.
        let slabs = (0..slots.max(1)).step_by(most as usize).map(&mut slab).collect();
        let totals: [u32; 4] = [slots.div_ceil(WORKGROUP_ITEMS), 1, 1, slots];
        Self {
            slabs,
            middle: upload.add_tables(&middles),
            own: upload.add_tables(&own),
            slots,
            backdrop: upload.add_uniform(bytemuck::bytes_of(&backdrop(prepared.frame))),
            totals: upload.add_uniform(bytemuck::cast_slice(&totals)),
        }
    }

    /// Records pass `project`.
    fn project(&self, recorder: &mut Recorder<'_>, programs: &TransparentPrograms, dispatches: &[SurfelDispatch]) {
        of_buffers(&mut recorder.pass(Stage::Project), &programs.project, self.slabs[0].view, dispatches);
    }

    /// Records pass `sort`, by the depths that were projected last.
    fn sort(&self, recorder: &mut Recorder<'_>, programs: &TransparentPrograms) {
        if self.slots == 0 {
            return;
        }
        let state = recorder.state;
        let (b, &Placed { view, views, .. }) = (&state.buffers, &self.slabs[0]);
        // Pass `bin` writes its own.
        recorder.encoder.copy_buffer_to_buffer(&b.uniforms, u64::from(self.totals), &b.totals, 0, TOTALS_BYTES);
        let several = usize::from(views > 1);
        {
            let pass = &mut recorder.pass(Stage::Sort);
            state.sort(pass, &programs.sort, view);
            state.sort(pass, &programs.sort_by_view[..several], view);
        }
        // A round more ends in the other buffers.
        recorder.encoder.copy_buffer_to_buffer(&b.lists[several], 0, &b.order, 0, 4 * u64::from(self.slots));
    }

    /// Records pass `resolve`.
    fn resolve(&self, recorder: &mut Recorder<'_>, film: &FilmPart, slab: &Placed) {
        let mut pass = recorder.pass(Stage::Resolve);
        if let Some(over) = &film.over {
            over.dispatch(&mut pass, &[slab.view, self.backdrop], [slab.tiles[0], slab.tiles[1], slab.views]);
        }
    }
}

/// Records pass `bin` of a slab: gathers its splats in the order of depth, and lists them.
fn list(recorder: &mut Recorder<'_>, programs: &TransparentPrograms, slab: &Placed) {
    let groups = [slab.slots.div_ceil(WORKGROUP_ITEMS), 1];
    dispatch(&mut recorder.pass(Stage::Bin), &programs.gather, groups, slab.view);
    recorder.bin(&programs.emit, slab);
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
        let mut upload = Upload::default();
        let part = Part::new(place.job(0), &mut upload);
        let mut tables = Tables::default();
        part.add_segments((0, false), (0, 0), &mut tables, &mut upload);
        let dispatches = upload.add_tables(&tables);
        let sample = PlacedSample::new(&[part], 0, self.state.buffers.entries, &mut upload);
        let programs = self.bind(&prepared, &upload).unwrap();
        upload.write(&self.state);
        let mut marks = Marks::new(&self.state.device).unwrap();
        let (state, encoder) = (&self.state, self.state.encoder());
        let mut recorder = Recorder::new(state, &programs, &mut marks, encoder);
        sample.project(&mut recorder, programs.transparent.as_ref().unwrap(), &dispatches);
        recorder.flush();
        self.state.device.check().unwrap();
        sample.slots as usize
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
