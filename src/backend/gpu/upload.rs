//! What the passes of a chunk of a frame read from the host: views, tables of workgroups, segments, lights and moments.
//! It is uploaded once, before the chunk is submitted.

use std::collections::{BTreeMap, HashMap};

use bytemuck::Zeroable;

use super::DeviceState;
use super::batches::Batch;
use super::buffers::Buffers;
use super::device::Device;
use super::job::Job;
use super::layout::{
    CaptureSegment, Light, Segment, UNIFORM_STRIDE, VIEW_BYTES, View, WORKGROUP_SURFELS, WORKGROUPS, lights,
};
use super::shadows::{caster_segments, layers, light_views, receiver_segments};
use super::slots::{Slot, TABLE_BYTES};
use crate::backend::BackendError;
use crate::frame::PosedSample;
use crate::plan::PosedInterval;

/// A round on the device: the batches of several groups, one of each, or a batch of one group.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Placed {
    /// Where its views begin, bytes, and their number.
    pub view: u32,
    pub views: u32,
    /// Where the views for later stretches of its lists are, where dispatches walk over so many entries alone.
    pub later: Vec<u32>,
    /// Slots of all views.
    pub slots: u32,
    /// Most tiles in a row, and most rows of tiles, of any view.
    pub tiles: [u32; 2],
    /// Tiles of all views.
    pub round_tiles: u32,
    /// Do groups share what is at rest?
    pub shares_rest: bool,
    /// What makes its splats.
    pub surfels: Vec<SurfelDispatch>,
    /// What receives or casts shadows: of the first batch of a group. What of it is see-through, and its layers.
    pub casters: Vec<SurfelDispatch>,
    pub veils: Vec<SurfelDispatch>,
    pub shadow_layers: usize,
    /// The captures and volumes that receive shadows: of the first batch of a group.
    pub receivers: Vec<SurfelDispatch>,
    /// Where the background behind what is transparent is, bytes.
    pub backdrop: u32,
}

/// A dispatch over segments of one buffer of a model.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct SurfelDispatch {
    pub object: usize,
    pub buffer: usize,
    /// Where its table of workgroups begins, bytes.
    pub table: u32,
    pub workgroups: u32,
}

/// Bytes that are uploaded together, buffer by buffer.
#[derive(Debug, Default)]
pub(in crate::backend) struct Upload {
    views: Vec<u8>,
    uniforms: Vec<u8>,
    segments: Vec<Segment>,
    captures: Vec<CaptureSegment>,
    lights: Vec<Light>,
    moments: Vec<f32>,
}

/// Where what belongs to a group begins.
#[derive(Clone, Debug)]
struct OfGroup {
    segment: u32,
    light: u32,
    /// The lights that shadows are asked for, before the views of those that have some.
    shadowed: Option<u32>,
    moment: u32,
    /// The segments of what casts shadows, by object and surfel buffer: their indices, and numbers of surfels.
    casters: BTreeMap<[usize; 2], (u32, u32)>,
}

/// A batch of a group in a round, with what is known before it.
struct Part<'a> {
    job: &'a Job<'a>,
    batch: &'a Batch,
    of_group: &'a OfGroup,
    /// Is it all of the group?
    is_whole: bool,
    /// Has the group batches before it? The turn of the last of them.
    resumes: bool,
    first_turn: u32,
    /// The view of what is at rest.
    rest: u32,
}

/// For each buffer of each object, the workgroups of its segments.
#[derive(Default)]
pub(in crate::backend) struct Tables {
    tables: Vec<([usize; 2], Vec<[u32; 2]>)>,
    places: HashMap<[usize; 2], usize>,
}

impl Tables {
    /// Adds segment `index`, of so many surfels or Gaussians of a buffer of an object.
    pub(in crate::backend) fn add(&mut self, buffer: [usize; 2], index: u32, count: u32) {
        let at = *self.places.entry(buffer).or_insert_with(|| {
            self.tables.push((buffer, Vec::new()));
            self.tables.len() - 1
        });
        self.tables[at].1.extend((0..count.div_ceil(WORKGROUP_SURFELS)).map(|place| [index, place]));
    }
}

impl Upload {
    /// Bytes so far.
    pub(in crate::backend) fn bytes(&self) -> usize {
        let Self { views, uniforms, segments, captures, lights, moments } = self;
        let poses = size_of_val(&segments[..]) + size_of_val(&captures[..]);
        views.len() + uniforms.len() + poses + size_of_val(&lights[..]) + size_of_val(&moments[..])
    }

    /// Adds views that are bound together. Returns where they begin, bytes.
    pub(in crate::backend) fn add_views(&mut self, views: &[View]) -> u32 {
        append(&mut self.views, bytemuck::cast_slice(views))
    }

    /// Adds a uniform other than a view. Returns where it begins, bytes.
    pub(in crate::backend) fn add_uniform(&mut self, bytes: &[u8]) -> u32 {
        append(&mut self.uniforms, bytes)
    }

    /// Adds the lights of samples. Returns the index of the first.
    pub(in crate::backend) fn add_lights(&mut self, samples: &[PosedSample]) -> u32 {
        let first = self.lights.len() as u32;
        self.lights.extend(lights(samples));
        first
    }

    /// Adds the lights of a group that shadows are asked for, and how they see. Returns the index of the first; `None`
    /// where none has shadows.
    pub(in crate::backend) fn add_light_views(&mut self, job: &Job<'_>) -> Option<u32> {
        let views = light_views(job);
        let first = (!views.is_empty()).then_some(self.lights.len() as u32);
        self.lights.extend(views);
        first
    }

    /// Adds the segment of a capture or volume. Returns its index.
    pub(in crate::backend) fn add_capture(&mut self, segment: &CaptureSegment) -> u32 {
        self.captures.push(*segment);
        self.captures.len() as u32 - 1
    }

    /// Adds what belongs to a group, for view `view`, and makes room for the segments of its batches.
    fn add_group(&mut self, job: &Job<'_>, batches: &[Batch], view: u32) -> OfGroup {
        let (segment, moment) = (self.segments.len() as u32, self.moments.len() as u32);
        self.segments.extend(job.group.samples.iter().map(|sample| Segment::weighing(sample.weight)));
        let posed: usize = batches.iter().map(|batch| batch.segments.len()).sum();
        self.segments.resize(self.segments.len() + posed, Segment::zeroed());
        let light = self.add_lights(&job.group.samples);
        let shadowed = self.add_light_views(job);
        self.moments.extend(job.interval.iter().flat_map(|interval: &&PosedInterval| interval.moments));
        let mut casters = BTreeMap::new();
        for (segment, object, buffer) in caster_segments(job) {
            let index = self.segments.len() as u32;
            casters.insert([object, buffer], (index, segment.surfels));
            self.segments.push(Segment { view, index, middle: index, ..segment });
        }
        OfGroup { segment, light, shadowed, moment, casters }
    }

    /// Places a group that is cut into batches, which come one after the other.
    pub(in crate::backend) fn place(&mut self, job: &Job<'_>, batches: &[Batch], entries: u64) -> Vec<Placed> {
        let of_group = &self.add_group(job, batches, 0);
        let mut first_turn = 0;
        let mut placed = Vec::new();
        for (number, batch) in batches.iter().enumerate() {
            let (is_whole, resumes) = (batches.len() == 1, number > 0);
            placed.push(
                self.place_parts(&[Part { job, batch, of_group, is_whole, resumes, first_turn, rest: 0 }], entries),
            );
            first_turn = batch.last_turn;
        }
        placed
    }

    /// Places a round: groups of one batch each, which go through the passes together. Each has the number of the view
    /// of what is at rest.
    pub(in crate::backend) fn place_round(&mut self, groups: &[(Job<'_>, Batch, u32)], entries: u64) -> Placed {
        let add = |(view, (job, batch, _)): (u32, &(Job<'_>, Batch, u32))| {
            self.add_group(job, std::slice::from_ref(batch), view)
        };
        let of_groups: Vec<_> = (0..).zip(groups).map(add).collect();
        let of_group = of_groups.iter();
        let parts: Vec<_> = groups
            .iter()
            .zip(of_group)
            .map(|((job, batch, rest), of_group)| Part {
                job,
                batch,
                of_group,
                is_whole: true,
                resumes: false,
                first_turn: 0,
                rest: *rest,
            })
            .collect();
        self.place_parts(&parts, entries)
    }

    fn place_parts(&mut self, parts: &[Part<'_>], entries: u64) -> Placed {
        let mut placed = Placed { views: parts.len() as u32, ..Placed::default() };
        let mut views = Vec::new();
        let [mut tables, mut casters, mut veils, mut receivers] = [0; 4].map(|_| Tables::default());
        for (number, part) in parts.iter().enumerate() {
            let &Part { job, batch, of_group, is_whole, resumes, first_turn, rest } = part;
            // What is alone in its group is posed as in the middle.
            let frame = job.place.prepared.frame;
            let is_elsewhere = |object: usize| frame.shades_samples() || frame.objects[object].is_held;
            let middle = |object, buffer| of_group.casters.get(&[object, buffer]).filter(|_| is_elsewhere(object));
            let own = job.view(entries);
            views.push(View {
                resumes: u32::from(resumes),
                rest,
                first_turn,
                last_turn: batch.last_turn,
                first_light: of_group.shadowed.unwrap_or(of_group.light + own.first_light),
                views: placed.views,
                number: number as u32,
                // What something transparent is laid over has a picture of its own.
                film_tile: if job.place.prepared.frame.blending.is_some() { placed.round_tiles } else { own.film_tile },
                first_tile: placed.round_tiles,
                first_slot: placed.slots,
                first_segment: of_group.segment,
                first_moment: of_group.moment,
                // Lists of several batches are made again for each pass, and count as one walk each time.
                walks: if is_whole { own.walks } else { own.walks.min(1) },
                ..own
            });
            for (segment, object, buffer) in &batch.segments {
                let index = of_group.segment + segment.index;
                self.segments[index as usize] = Segment {
                    first_slot: placed.slots + segment.first_slot,
                    first_light: of_group.light + segment.first_light,
                    index,
                    view: number as u32,
                    middle: middle(*object, *buffer).map_or(index, |(caster, _)| *caster),
                    ..*segment
                };
                tables.add([*object, *buffer], index, segment.surfels);
            }
            // All batches of a group have the same shadows.
            for (&buffer, &(index, surfels)) in of_group.casters.iter().filter(|_| !resumes) {
                casters.add(buffer, index, surfels);
                if frame.objects[buffer[0]].see_through {
                    veils.add(buffer, index, surfels);
                    placed.shadow_layers = placed.shadow_layers.max(layers(job));
                }
            }
            for (segment, object, buffer) in if resumes { Vec::new() } else { receiver_segments(job) } {
                let index = self.add_capture(&CaptureSegment { view: number as u32, ..segment });
                receivers.add([object, buffer], index, segment.count);
            }
            placed.shares_rest |= rest != number as u32;
            placed.slots += batch.slots;
            placed.round_tiles += own.tiles[0] * own.tiles[1];
            placed.tiles = [0, 1].map(|i| placed.tiles[i].max(own.tiles[i]));
        }
        join_films(&mut views);
        for view in &mut views {
            (view.slots, view.round_tiles) = (placed.slots, placed.round_tiles);
        }
        placed.view = self.add_views(&views);
        let longest = parts.iter().map(|part| part.batch.slots).max().unwrap_or(0);
        let stretches = u64::from(longest).div_ceil(parts[0].job.stretch) as u32;
        let of_stretch = |stretch| views.iter().map(|view| View { resumes: 1, stretch, ..*view }).collect::<Vec<_>>();
        placed.later = (1..stretches).map(|stretch| self.add_views(&of_stretch(stretch))).collect();
        placed.surfels = self.add_tables(&tables);
        placed.casters = self.add_tables(&casters);
        placed.veils = self.add_tables(&veils);
        placed.receivers = self.add_tables(&receivers);
        placed
    }

    /// Adds tables of workgroups. Returns their dispatches.
    pub(in crate::backend) fn add_tables(&mut self, tables: &Tables) -> Vec<SurfelDispatch> {
        let mut dispatches = Vec::new();
        for ([object, buffer], workgroups) in &tables.tables {
            for table in workgroups.chunks(WORKGROUPS) {
                dispatches.push(SurfelDispatch {
                    object: *object,
                    buffer: *buffer,
                    table: self.add_uniform(bytemuck::cast_slice(table)),
                    workgroups: table.len() as u32,
                });
            }
        }
        dispatches
    }

    /// Is there room for it?
    pub(in crate::backend) fn fits(&self, buffers: &Buffers) -> bool {
        buffers[Slot::Views].size() >= self.views.len() as u64 + VIEW_BYTES
            && buffers[Slot::Tables].size() >= self.uniforms.len() as u64 + TABLE_BYTES
            && buffers[Slot::Segments].size() >= size_of_val(&self.segments[..]) as u64
            && buffers[Slot::CaptureSegments].size() >= size_of_val(&self.captures[..]) as u64
            && buffers[Slot::Lights].size() >= size_of_val(&self.lights[..]) as u64
            && buffers[Slot::Moments].size() >= size_of_val(&self.moments[..]) as u64
    }

    /// Makes room for it. Buffers that grow lose their content.
    pub(in crate::backend) fn fit(&self, device: &Device, buffers: &mut Buffers) -> Result<(), BackendError> {
        let poses = [size_of_val(&self.segments[..]) as u64, size_of_val(&self.captures[..]) as u64];
        for (count, bytes) in [self.segments.len(), self.captures.len()].into_iter().zip(poses) {
            if bytes > device.most_bytes() {
                return Err(device.error(format!(
                    "the poses of {count} objects and parts of them take {bytes} bytes, but a program can bind {}: \
                     take `--backend cpu`",
                    device.most_bytes()
                )));
            }
        }
        // The last offset is followed by all that a program binds.
        buffers.grow(device, Slot::Views, self.views.len() as u64 + VIEW_BYTES)?;
        buffers.grow(device, Slot::Tables, self.uniforms.len() as u64 + TABLE_BYTES)?;
        buffers.grow(device, Slot::Segments, poses[0])?;
        buffers.grow(device, Slot::CaptureSegments, poses[1])?;
        buffers.grow(device, Slot::Lights, size_of_val(&self.lights[..]) as u64)?;
        buffers.grow(device, Slot::Moments, size_of_val(&self.moments[..]) as u64)
    }

    /// Writes it, before what is submitted next.
    pub(in crate::backend) fn write(&self, state: &DeviceState) {
        let (device, buffers) = (&state.device, &state.buffers);
        let parts: [(&wgpu::Buffer, &[u8]); 6] = [
            (&buffers[Slot::Views], &self.views),
            (&buffers[Slot::Tables], &self.uniforms),
            (&buffers[Slot::Segments], bytemuck::cast_slice(&self.segments)),
            (&buffers[Slot::CaptureSegments], bytemuck::cast_slice(&self.captures)),
            (&buffers[Slot::Lights], bytemuck::cast_slice(&self.lights)),
            (&buffers[Slot::Moments], bytemuck::cast_slice(&self.moments)),
        ];
        for (buffer, bytes) in parts.into_iter().filter(|(_, bytes)| !bytes.is_empty()) {
            device.write(buffer, 0, bytes);
        }
    }
}

/// Appends a uniform, where one may begin. Returns that place.
fn append(to: &mut Vec<u8>, bytes: &[u8]) -> u32 {
    let at = to.len().next_multiple_of(UNIFORM_STRIDE as usize);
    to.resize(at, 0);
    to.extend_from_slice(bytes);
    at as u32
}

/// Finds the views that add to the same part of the film. They follow each other.
pub(in crate::backend) fn join_films(views: &mut [View]) {
    let mut first = 0;
    for number in 0..views.len() {
        if views[number].film_tile != views[first].film_tile {
            first = number;
        }
        views[number].same_film = 0;
        views[first].same_film += 1;
    }
}

const _: () = assert!(size_of::<View>().is_multiple_of(16) && VIEW_BYTES <= 1 << 16);
