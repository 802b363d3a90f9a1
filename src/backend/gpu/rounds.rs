//! Cuts a frame into tasks, each a step of one group or a round of several groups, and tasks into chunks, each with
//! what it uploads.

use std::iter::Peekable;

use super::batches::Batch;
use super::captures::runs;
use super::job::{Job, JobPlace};
use super::layout::{
    CaptureSegment, IS_REST, LISTS_ALONE, OPAQUE_SURFELS, SEE_THROUGH_SURFELS, SHARES_TILES, Segment, VIEWS, View,
};
use super::memory::makes_rounds;
use super::prepared::Prepared;
use super::shadows::shades_transparent;
use super::transparent::TransparentStep;
use super::upload::{Placed, Upload};
use crate::plan::{Published, Step};

/// Bytes that a chunk uploads, about: one with less takes another task.
const CHUNK_BYTES: usize = 1 << 25;

/// Passes that are recorded together. Films are indices of parts of the film.
#[derive(Debug)]
pub(in crate::backend) enum Task {
    /// Steps `Paint`, or instants of step `Published`.
    Paint {
        film: usize,
        placed: Vec<Placed>,
    },
    Peel(Vec<Placed>),
    Composite {
        film: usize,
        step: TransparentStep,
    },
    Sweep {
        film: usize,
        placed: Vec<Placed>,
    },
    Map(Vec<Placed>),
    PublishedSweep {
        film: usize,
        placed: Vec<Placed>,
    },
    Finish {
        film: usize,
        placed: Placed,
    },
}

/// Tasks that are uploaded and submitted together.
#[derive(Debug, Default)]
pub(in crate::backend) struct Chunk {
    pub tasks: Vec<Task>,
    pub upload: Upload,
}

/// A step of a sample position in one band.
struct PlacedStep<'a> {
    place: JobPlace<'a>,
    step: &'a Step,
    /// Is it the first one of the position?
    begins: bool,
}

/// All steps of a frame that are wanted, in order.
fn steps<'a>(prepared: &'a Prepared<'a>) -> impl Iterator<Item = PlacedStep<'a>> {
    let whole = prepared.binds_whole_film();
    let tile_bytes = prepared.tile_bytes_of_film();
    let parts = prepared.film_parts();
    let bands = prepared
        .frame
        .rasters
        .iter()
        .enumerate()
        .flat_map(|(raster, of_raster)| prepared.schedule.bands(raster).map(move |band| (raster, band, of_raster)));
    bands.enumerate().flat_map(move |(film, (raster, band, of_raster))| {
        let film_tile = if whole { (parts[film].0 / tile_bytes) as u32 } else { 0 };
        let wanted = of_raster.positions.first().is_some_and(|position| prepared.wants(&position.raster, band));
        let positions = if wanted { &of_raster.positions[..] } else { &[] };
        positions.iter().flat_map(move |position| {
            let place = JobPlace { prepared, position, raster, band, film, film_tile };
            position.steps.iter().enumerate().map(move |(n, step)| PlacedStep { place, step, begins: n == 0 })
        })
    })
}

/// A walk over the steps of a frame, chunk by chunk.
pub(in crate::backend) struct Walk<'a, I: Iterator> {
    prepared: &'a Prepared<'a>,
    steps: Peekable<I>,
    /// Entries of lists that there is room for.
    entries: u64,
    /// The surfels of the last group, where something transparent is laid over it.
    surfels: GroupSurfels<'a>,
}

/// The surfels of a group, each kind with its job and cut into batches; `None` where a frame has none of a kind.
#[derive(Default)]
struct GroupSurfels<'a> {
    opaque: Option<(Job<'a>, Vec<Batch>)>,
    see_through: Option<(Job<'a>, Vec<Batch>)>,
}

/// The walk over a frame.
pub(in crate::backend) fn walk<'a>(prepared: &'a Prepared<'a>, entries: u64) -> impl Iterator<Item = Chunk> {
    let steps = steps(prepared).peekable();
    Walk { prepared, steps, entries, surfels: GroupSurfels::default() }
}

impl<'a, I: Iterator<Item = PlacedStep<'a>>> Iterator for Walk<'a, I> {
    type Item = Chunk;

    fn next(&mut self) -> Option<Chunk> {
        self.steps.peek()?;
        let mut chunk = Chunk::default();
        let mut round = Round::default();
        while chunk.upload.bytes() + round.bytes < CHUNK_BYTES {
            let Some(next) = self.steps.next() else { break };
            if next.begins {
                round.rest = None;
            }
            self.add(&mut chunk, &mut round, &next);
        }
        round.close(&mut chunk, self.entries);
        Some(chunk)
    }
}

impl<'a, I: Iterator> Walk<'a, I> {
    /// Adds a step to a chunk, or to the round that goes into it next.
    fn add(&mut self, chunk: &mut Chunk, round: &mut Round<'a>, next: &PlacedStep<'a>) {
        let (place, film, entries) = (next.place, next.place.film, self.entries);
        match *next.step {
            Step::Paint { group, .. } | Step::Published { group, part: Published::Instant } => {
                let job = place.paint_job(group, false);
                let batches = place.batches(&job);
                if self.prepared.frame.blending.is_some() {
                    self.surfels = GroupSurfels { opaque: Some((job, batches)), see_through: None };
                } else {
                    let shares_rest = matches!(*next.step, Step::Paint { shares_rest: true, .. });
                    round.add_surfels(chunk, (job, batches), shares_rest, entries);
                }
            }
            Step::Sweep { group, ref interval, .. } => {
                let job = place.sweep_job(group, interval);
                round.add_surfels(chunk, (job, place.batches(&job)), false, entries);
            }
            Step::Peel { group } => {
                let job = place.paint_job(group, true);
                self.surfels.see_through = Some((job, place.batches(&job)));
            }
            Step::Composite { group } => {
                let over = OverGroup::new(place.job(group), std::mem::take(&mut self.surfels));
                if over.fits_rounds() {
                    round.add_over(chunk, over, entries);
                } else {
                    round.close(chunk, entries);
                    over.add_alone(chunk, entries);
                }
            }
            Step::Published { group, part: Published::Map { guard } } => {
                let job = place.map_job(group, guard);
                round.close(chunk, entries);
                let placed = chunk.upload.place(&job, &place.batches(&job), entries);
                chunk.tasks.push(Task::Map(placed));
            }
            Step::Published { group, part: Published::Sweep { ref interval, .. } } => {
                let job = place.sweep_job(group, interval);
                let placed = chunk.upload.place(&job, &place.batches(&job), entries);
                chunk.tasks.push(Task::PublishedSweep { film, placed });
            }
            Step::Finish => {
                round.close(chunk, entries);
                let view = chunk.upload.add_views(&[place.job(0).view(entries)]);
                let placed = Placed { view, views: 1, tiles: place.area().tiles, ..Placed::default() };
                chunk.tasks.push(Task::Finish { film, placed });
            }
        }
    }
}

/// The task of surfels that nothing is laid over: step `Sweep` where the job has an interval, else `Paint`.
fn surfel_task(job: &Job<'_>, placed: Vec<Placed>) -> Task {
    let film = job.place.film;
    if job.interval.is_some() { Task::Sweep { film, placed } } else { Task::Paint { film, placed } }
}

/// Groups of one batch each, which go through the passes together.
#[derive(Default)]
struct Round<'a> {
    /// Each with the number of the view of what is at rest.
    groups: Vec<(Job<'a>, Batch, u32)>,
    /// The view of what is at rest at the sample position, and a batch of it.
    rest: Option<(u32, Batch)>,
    /// The same groups with all that is transparent; empty where nothing is.
    over: Vec<OverGroup<'a>>,
    /// Slots and tiles of all groups, and bytes that they upload, about.
    slots: u64,
    tiles: u64,
    bytes: usize,
}

impl<'a> Round<'a> {
    /// Adds the surfels of a group, or where they do not go with others puts them into the chunk.
    fn add_surfels(
        &mut self,
        chunk: &mut Chunk,
        (job, mut batches): (Job<'a>, Vec<Batch>),
        shares_rest: bool,
        entries: u64,
    ) {
        if batches.len() == 1 && makes_rounds(job.place.prepared.frame) {
            self.add(chunk, (job, batches.remove(0)), shares_rest, entries);
        } else {
            self.close(chunk, entries);
            let placed = chunk.upload.place(&job, &batches, entries);
            chunk.tasks.push(surfel_task(&job, placed));
        }
    }

    /// Adds a group. Where it does not fit, the round goes into the chunk before, and another begins.
    fn add(&mut self, chunk: &mut Chunk, (job, batch): (Job<'a>, Batch), shares_rest: bool, entries: u64) {
        if !shares_rest || batch.at_rest.1 == 0 || !self.add_sharing(chunk, job, &batch, entries) {
            self.make_room(chunk, &job, [u64::from(batch.slots), 1], entries);
            let number = self.groups.len() as u32;
            self.push(job, batch, number);
        }
    }

    /// Adds a group that shares what is at rest with others of the sample position. False where rounds have no room for
    /// both.
    fn add_sharing(&mut self, chunk: &mut Chunk, job: Job<'a>, batch: &Batch, entries: u64) -> bool {
        let schedule = &job.place.prepared.schedule;
        // With one other group nothing would be shared.
        if schedule.round_groups < 3 {
            return false;
        }
        let slots = u64::from(batch.slots);
        let known =
            |round: &Self| round.rest.as_ref().filter(|(_, of_rest)| of_rest.rests_as(batch)).map(|known| known.0);
        let more = match known(self) {
            Some(_) => [slots - u64::from(batch.at_rest.0), 1],
            None => [slots, 2],
        };
        self.make_room(chunk, &job, more, entries);
        // The coverage of several samples holds their weights.
        let shares_tiles = job.group.samples.len() == 1;
        let [of_rest, moving] = batch.parted(job.group.samples.len() as u32);
        let number = known(self).unwrap_or_else(|| {
            let number = self.groups.len() as u32;
            let alone = if shares_tiles { 0 } else { LISTS_ALONE };
            self.push(Job { flags: job.flags | IS_REST | alone, ..job }, of_rest.clone(), number);
            self.rest = Some((number, of_rest));
            number
        });
        let flags = if shares_tiles { SHARES_TILES } else { 0 };
        self.push(Job { flags: job.flags | flags, ..job }, moving, number);
        true
    }

    /// Adds a group that something transparent is laid over.
    fn add_over(&mut self, chunk: &mut Chunk, mut over: OverGroup<'a>, entries: u64) {
        let (job, batch) = match over.surfels.opaque.as_mut() {
            Some((job, batches)) => (*job, batches.pop().unwrap_or_default()),
            None => (over.job, Batch::default()),
        };
        let most = over.most_slots(u64::from(batch.slots));
        self.make_room(chunk, &job, [most, 1], entries);
        let number = self.groups.len() as u32;
        // Those of its surfels come with them.
        self.slots += most - u64::from(batch.slots);
        self.bytes += over.bytes();
        self.push(job, batch, number);
        self.over.push(over);
    }

    fn push(&mut self, job: Job<'a>, batch: Batch, rest: u32) {
        self.slots += u64::from(batch.slots);
        self.tiles += job.area.len();
        self.bytes += size_of::<View>() + size_of_val(&batch.segments[..]);
        self.groups.push((job, batch, rest));
    }

    /// Closes the round unless there is room for so many slots and views more, of a group.
    fn make_room(&mut self, chunk: &mut Chunk, job: &Job<'_>, [slots, views]: [u64; 2], entries: u64) {
        let Some((first, ..)) = self.groups.first() else { return };
        let schedule = &job.place.prepared.schedule;
        // Programs bind one part of the film, and all tiles have the same apron.
        let same_film = job.place.prepared.binds_whole_film() || first.place.film == job.place.film;
        let fits = same_film
            && [false, true]
                .into_iter()
                .all(|see_through| first.place.raster(see_through).apron() == job.place.raster(see_through).apron())
            && self.groups.len() as u64 + views <= schedule.round_groups.min(u64::from(VIEWS))
            && self.slots + slots <= schedule.round_slots
            && self.tiles + views * job.area.len() <= schedule.round_tiles;
        if !fits {
            self.close(chunk, entries);
        }
    }

    /// Adds it to a chunk, and begins another.
    fn close(&mut self, chunk: &mut Chunk, entries: u64) {
        let Self { groups, over, .. } = std::mem::take(self);
        let Some((job, ..)) = groups.first() else { return };
        if over.is_empty() {
            let placed = vec![chunk.upload.place_round(&groups, entries)];
            chunk.tasks.push(surfel_task(job, placed));
        } else {
            OverGroup::add_round(over, &groups, chunk, entries);
        }
    }
}

/// A group that something transparent is laid over.
struct OverGroup<'a> {
    /// The job of step `Composite`.
    job: Job<'a>,
    /// Without opaque surfels where a round has them.
    surfels: GroupSurfels<'a>,
    gaussians: u64,
}

impl<'a> OverGroup<'a> {
    fn new(job: Job<'a>, mut surfels: GroupSurfels<'a>) -> Self {
        let some = |kind: &Option<(Job<'a>, Vec<Batch>)>, flag| {
            kind.iter().filter(|(_, batches)| !batches.is_empty()).map(|_| flag).sum::<u32>()
        };
        let opaque = some(&surfels.opaque, OPAQUE_SURFELS);
        let flags = opaque | some(&surfels.see_through, SEE_THROUGH_SURFELS);
        if let Some((job, _)) = &mut surfels.see_through {
            job.flags = opaque;
        }
        let (_, gaussians) = runs(job.place.prepared, job.group);
        let stretch = job.place.prepared.stretch;
        Self { job: Job { flags, stretch, ..job }, surfels, gaussians: u64::from(gaussians) }
    }

    /// Can it go through the passes with others?
    fn fits_rounds(&self) -> bool {
        let prepared = self.job.place.prepared;
        let GroupSurfels { opaque, see_through } = &self.surfels;
        let one_batch = opaque.iter().chain(see_through).all(|(_, batches)| batches.len() <= 1);
        makes_rounds(prepared.frame) && one_batch && self.gaussians <= prepared.schedule.slots
    }

    /// Most slots of any of its steps, where opaque surfels take `opaque`.
    fn most_slots(&self, opaque: u64) -> u64 {
        let of_layers = self.surfels.see_through.iter().flat_map(|(_, batches)| batches);
        of_layers.map(|batch| u64::from(batch.slots)).fold(opaque.max(self.gaussians), u64::max)
    }

    /// Bytes that it uploads beside those of its opaque surfels, about.
    fn bytes(&self) -> usize {
        let objects = self.job.place.prepared.frame.objects.len();
        2 * size_of::<View>() + objects * size_of::<CaptureSegment>().max(size_of::<Segment>())
    }

    /// Adds its steps to a chunk, in as many batches and slabs as it takes.
    fn add_alone(self, chunk: &mut Chunk, entries: u64) {
        let film = self.job.place.film;
        let mut place = |kind: Option<(Job<'a>, Vec<Batch>)>| {
            kind.map(|(job, batches)| chunk.upload.place(&job, &batches, entries)).unwrap_or_default()
        };
        let GroupSurfels { opaque, see_through } = self.surfels;
        // Shadows of what is out of view are drawn with surfels, though there are none to paint.
        let or_none = |(job, batches): (Job<'a>, Vec<Batch>)| {
            let none = batches.is_empty() && shades_transparent(job.place.prepared);
            (job, if none { vec![Batch::default()] } else { batches })
        };
        let placed = [place(opaque.map(or_none)), place(see_through)];
        add_steps(film, placed, &[self.job], chunk, entries);
    }

    /// Adds the steps of a round to a chunk. `opaque`: the opaque surfels of its groups. All steps number views and
    /// tiles alike.
    fn add_round(all: Vec<Self>, opaque: &[(Job<'a>, Batch, u32)], chunk: &mut Chunk, entries: u64) {
        let film = all[0].job.place.film;
        let mut place = |groups: &[(Job<'a>, Batch, u32)], shades: bool| {
            let some = shades || groups.iter().any(|(_, batch, _)| batch.slots > 0);
            some.then(|| chunk.upload.place_round(groups, entries)).into_iter().collect()
        };
        let placed = place(opaque, shades_transparent(all[0].job.place.prepared));
        let jobs: Vec<_> = all.iter().map(|over| over.job).collect();
        let layers: Vec<_> = (0..)
            .zip(all)
            .map(|(number, over)| {
                let (job, batches) = over.surfels.see_through.unwrap_or((over.job, Vec::new()));
                (job, batches.into_iter().next().unwrap_or_default(), number)
            })
            .collect();
        let placed = [placed, place(&layers, false)];
        add_steps(film, placed, &jobs, chunk, entries);
    }
}

/// Adds the steps of groups to a chunk: their opaque surfels, their layers, and what `jobs` composite.
fn add_steps(film: usize, [placed, layers]: [Vec<Placed>; 2], jobs: &[Job<'_>], chunk: &mut Chunk, entries: u64) {
    chunk.tasks.push(Task::Paint { film, placed });
    if !layers.is_empty() {
        chunk.tasks.push(Task::Peel(layers));
    }
    let step = TransparentStep::new(jobs, entries, &mut chunk.upload);
    chunk.tasks.push(Task::Composite { film, step });
}

const _: () = assert!(size_of::<Segment>() < CHUNK_BYTES);
