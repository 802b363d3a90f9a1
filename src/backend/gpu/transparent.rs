//! Step `Composite`: what it uploads, and the passes that it records. Twin: `src/backend/cpu/transparent/mod.rs`.
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
use super::bind::BoundPrograms;
use super::captures::{Run, runs};
use super::job::{Job, JobPlace};
use super::layout::{
    CaptureSegment, DeviceBackground, DeviceGaussian, FLAG_ANTIALIAS, FLAG_ENCODE, FLAG_KEEP_LAYER, FLAG_LIT,
    FLAG_RECEIVES, FLAG_VOLUME, LAST_SLAB, View, WORKGROUP_ITEMS, coefficients, records, rows,
};
use super::passes::Program;
#[cfg(test)]
use super::prepared::Prepared;
use super::recorder::Recorder;
use super::shadows::shades_gaussians;
use super::slots::Slot;
use super::steps::Kind;
#[cfg(test)]
use super::timestamps::Marks;
use super::upload::{Placed, Tables, Upload, join_films};
use crate::backend::BackendError;
use crate::film::Blending;
use crate::frame::{Frame, PosedGroup};
use crate::math::srgb;
use crate::plan::{BatchPass, CompositePass, SlabPass};
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

/// Variance by which the filter widens a Gaussian, pixels^2 of the image (Kerbl et al. 2023, their program).
const DILATION: f32 = 0.3;
/// The derivative of the projection is taken no farther from the axis than this many half fields of view.
const FIELD: f32 = 1.3;
/// Bytes of the totals of a sort.
const TOTALS_BYTES: u64 = size_of::<[u32; 4]>() as u64;

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
    // All samples have the shadows of the middle, and a volume on which shadows fall is lit as there.
    let receives = object.receives && shades_gaussians(place.prepared);
    let middle = group.samples.len() / 2;
    let shaded = if receives { &group.samples[middle].objects[run.object] } else { posed };
    let lit_at = if receives { middle } else { sample };
    let flags = [
        (antialias, FLAG_ANTIALIAS),
        (encode, FLAG_ENCODE),
        (volume, FLAG_VOLUME),
        (lit, FLAG_LIT),
        (keeps_layers, FLAG_KEEP_LAYER),
        (receives && drawing.flat.is_none(), FLAG_RECEIVES),
    ];
    let flags = flags.into_iter().filter(|(is_set, _)| *is_set).map(|(_, flag)| flag).sum();
    let lights = records(&group.samples[sample].lights);
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
        normal: rows(&shaded.normal_matrix, Vec3::ZERO),
        world: rows(&shaded.world_from_model, shaded.world_origin),
        material: coefficients(object.material.unwrap_or_default()),
        first_light: light + (lit_at * lights) as u32,
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
    middle: Placed,
    own: Placed,
    /// Gaussians of all groups.
    slots: u32,
    /// Where the totals of the sort of depths are, bytes.
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
    /// The lights whose shadows fall on captures, before the views of those that have some.
    shadowed: Option<u32>,
}

impl<'a> Part<'a> {
    fn new(job: Job<'a>, upload: &mut Upload) -> Self {
        let (runs, slots) = runs(job.place.prepared, job.group);
        let light = upload.add_lights(&job.group.samples);
        let shadowed = if shades_gaussians(job.place.prepared) { upload.add_light_views(&job) } else { None };
        Self { job, runs, slots, light, shadowed }
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

    /// Records all passes of all samples, for a part of the film. A group has the order of its middle.
    pub(in crate::backend) fn run(&self, recorder: &mut Recorder<'_>, film: usize) -> Result<(), BackendError> {
        for (number, sample) in self.samples.iter().enumerate() {
            for pass in CompositePass::order(number == 0, self.samples.len() > 1) {
                match pass {
                    CompositePass::ProjectMiddle => project(recorder, &sample.middle)?,
                    CompositePass::Sort => sample.sort(recorder)?,
                    CompositePass::Project => project(recorder, &sample.own)?,
                    CompositePass::Composite => {
                        // Lists of a slab are composited before those of the next are made.
                        for (number, slab) in (1..).zip(&sample.slabs) {
                            recorder.programs((Kind::Sorted, 0), &[Program::Gather], slab)?;
                            recorder.bin(Kind::Sorted, slab)?;
                            for pass in SlabPass::order(number == sample.slabs.len()) {
                                let program = match pass {
                                    SlabPass::Composite => Program::Composite,
                                    SlabPass::Resolve => Program::TransparentResolve,
                                };
                                recorder.programs((Kind::Sorted, film), &[program], slab)?;
                            }
                        }
                    }
                }
            }
            recorder.flush_if_long();
        }
        Ok(())
    }
}

/// Records pass `project`.
fn project(recorder: &mut Recorder<'_>, placed: &Placed) -> Result<(), BackendError> {
    recorder.record_batch(Kind::Sorted, BatchPass::Project, placed)?;
    if recorder.shades_gaussians() {
        recorder.programs((Kind::Sorted, 0), &[Program::ShadowGaussians], placed)?;
    }
    Ok(())
}

impl PlacedSample {
    /// Uploads sample `sample` of each group, in the order of depth of the group's middle.
    fn new(parts: &[Part<'_>], sample: usize, entries: u64, upload: &mut Upload) -> Self {
        let mut views = Vec::new();
        let [mut middles, mut own] = [Tables::default(), Tables::default()];
        let backdrop = upload.add_uniform(bytemuck::bytes_of(&backdrop(parts[0].job.place.prepared.frame)));
        let mut placed = Placed { views: parts.len() as u32, backdrop, ..Placed::default() };
        for (number, part) in parts.iter().enumerate() {
            let (job, samples) = (&part.job, &part.job.group.samples);
            let of_group = job.view(entries);
            views.push(View {
                weight: samples[sample].weight,
                first_light: part.shadowed.unwrap_or(part.light + of_group.first_light),
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
        let slabs: Vec<_> = (0..slots.max(1)).step_by(most as usize).map(&mut slab).collect();
        let totals: [u32; 4] = [slots.div_ceil(WORKGROUP_ITEMS), 1, 1, slots];
        let totals = upload.add_uniform(bytemuck::cast_slice(&totals));
        let [middle, own] =
            [middles, own].map(|tables| Placed { surfels: upload.add_tables(&tables), ..slabs[0].clone() });
        Self { slabs, middle, own, slots, totals }
    }

    /// Records pass `sort`, by the depths that were projected last.
    fn sort(&self, recorder: &mut Recorder<'_>) -> Result<(), BackendError> {
        if self.slots == 0 {
            return Ok(());
        }
        let slab = &self.slabs[0];
        // Pass `bin` writes its own.
        recorder.copy((Slot::Tables, u64::from(self.totals)), Slot::Totals, TOTALS_BYTES);
        let by_view = slab.views > 1;
        recorder.sort(by_view, slab)?;
        // One round more ends in the other buffers.
        let ends_in = if by_view { Slot::SortedList } else { Slot::List };
        recorder.copy((ends_in, 0), Slot::Order, 4 * u64::from(self.slots));
        Ok(())
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
        let mut upload = Upload::default();
        let part = Part::new(place.job(0), &mut upload);
        let mut tables = Tables::default();
        part.add_segments((0, false), (0, 0), &mut tables, &mut upload);
        let dispatches = upload.add_tables(&tables);
        let sample = PlacedSample::new(&[part], 0, self.state.buffers.entries, &mut upload);
        self.fit(&prepared, &upload).unwrap();
        upload.write(&self.state);
        let placed = Placed { surfels: dispatches, ..sample.slabs[0].clone() };
        self.recorded(&prepared, |recorder| project(recorder, &placed)).unwrap();
        sample.slots as usize
    }

    /// Makes room for a sort of `entries` entries.
    pub(in crate::backend) fn make_room_to_sort(&mut self, entries: u64) {
        let super::DeviceState { device, buffers, .. } = &mut self.state;
        buffers.fit_entries(device, entries).unwrap();
    }

    /// Records what is to be recorded, and submits it.
    pub(in crate::backend) fn recorded(
        &mut self,
        prepared: &Prepared<'_>,
        record: impl FnOnce(&mut Recorder<'_>) -> Result<(), BackendError>,
    ) -> Result<(), BackendError> {
        let mut marks = Marks::new(&self.state.device)?;
        let (mut bound, encoder) = (BoundPrograms::default(), self.state.encoder());
        let mut recorder = Recorder::new(prepared, &mut self.state, &mut bound, &mut marks, encoder);
        record(&mut recorder)?;
        recorder.flush();
        self.state.device.check()
    }
}
