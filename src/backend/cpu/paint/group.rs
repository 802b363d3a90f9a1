//! Step `Paint`, and instants of step `Published`: the passes of one group of time samples, added to the film.
//!
//! What is at rest is painted once a position: its splats stay from group to group, and so does the film of tiles into
//! which nothing moves.

use std::marker::PhantomData;
use std::time::Instant;

use super::attribute::{Filter, attribute};
use super::buffers::{APRON_STRIDE, with_apron};
use super::kernel::{Kernel, RasterRays};
use super::visibility::{find_open, second, visibility};
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::depths::Depths;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::resolve::{Resolve, TileFilm};
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tile_runner::TileWork;
use crate::plan::PaintPass;

/// One group in one band.
pub(in crate::backend) struct PaintGroup<'a, K> {
    pub scope: Scope<'a>,
    kernel: PhantomData<K>,
}

/// What the step writes of one tile.
#[derive(Debug)]
pub(in crate::backend) struct Painted<'a> {
    pub film: &'a mut TileFilm,
    /// The film of what is at rest, with weight 1, where it is the same for all groups of the position. It is empty
    /// until a group needs it.
    pub at_rest: Option<&'a mut TileFilm>,
}

impl Painted<'_> {
    /// Adds the film of what is at rest. False if it is not known.
    fn add_rest(&mut self, weight: f32) -> bool {
        let Some(rest) = self.at_rest.as_ref().filter(|rest| !rest.values.is_empty()) else { return false };
        self.film.values.resize(rest.values.len(), 0.0);
        self.film.values.iter_mut().zip(&rest.values).for_each(|(out, value)| *out += weight * value);
        self.film.threshold.clone_from(&rest.threshold);
        true
    }
}

impl<'a, K: Kernel> PaintGroup<'a, K> {
    pub(in crate::backend) fn new(scope: Scope<'a>) -> Self {
        Self { scope, kernel: PhantomData }
    }

    fn apron(&self) -> usize {
        if K::FILTERED { self.scope.raster.apron() } else { 0 }
    }

    /// The least depth tolerance of the objects whose surfels it shows.
    pub(in crate::backend) fn least_tolerance(&self, see_through: bool) -> Depths {
        let Scope { frame, group, .. } = &self.scope;
        Depths { near: frame.near, epsilon: frame.least_tolerance(group, see_through) }
    }

    fn samples(&self) -> usize {
        self.scope.group.samples.len()
    }

    /// Pass `project` of one chunk, and the values of its splats.
    pub(in crate::backend) fn project(&self, chunk: &Chunk<'_>, binned: &mut Binned<K>) {
        let scope = &self.scope;
        scope.timed(binned, |binned| {
            binned.splats.clear();
            K::project(&scope.view(chunk), chunk.model.surfels(), chunk.surfels.clone(), &mut binned.splats);
            scope.add_values(chunk, binned);
        });
    }

    /// Pass `visibility` of one tile.
    fn lower(&self, job: &mut Job<'_, K, Painted<'_>>) {
        let start = Instant::now();
        if job.first {
            job.buffers.paint.clear_depths(K::FILTERED, self.scope.frame.keeps_nearest);
            job.buffers.paint.floor.clear();
            job.buffers.paint.moves = false;
        }
        let (rect, _) = with_apron(&job.tile, self.apron(), self.scope.raster.size);
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if !list.is_empty() {
                let buffers = &mut job.buffers.paint;
                buffers.moves |= !self.scope.frame.objects[chunk.object].is_static;
                visibility(&binned.splats, list, self.scope.depths(chunk), &rect, buffers);
            }
        }
        self.scope.clocks.visibility.add(start);
    }

    /// Pass `second` of one tile.
    fn find_second(&self, job: &mut Job<'_, K, Painted<'_>>) {
        let start = Instant::now();
        let size = self.scope.raster.size;
        if job.first {
            find_open(&job.tile, self.apron(), size, self.least_tolerance(false), &mut job.buffers.paint);
        }
        let first = self.first(job);
        if job.buffers.paint.any_open() {
            for (chunk, binned) in job.chunks.iter().zip(job.binned) {
                let list = binned.list(&job.tile, job.scratch);
                second(&binned.splats, list, self.scope.depths(chunk), &job.tile, first, &mut job.buffers.paint);
            }
        }
        self.scope.clocks.visibility.add(start);
    }

    /// Pass `attribute` of one tile.
    fn add(&self, job: &mut Job<'_, K, Painted<'_>>) {
        let scope = &self.scope;
        let start = Instant::now();
        if job.first {
            job.buffers.paint.clear_sums(scope.channels.count, K::FILTERED);
            job.buffers.clear_coverage(self.samples());
        }
        let first = self.first(job);
        let sight = RasterRays::new(scope.frame.near, scope.raster);
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            scope.turn(chunk, job.buffers);
            let attributes = scope.attributes(chunk, &binned.values);
            let filter = Filter { attributes, depths: scope.depths(chunk), sight, start: first, ceiling: &[] };
            let TileBuffers { paint, group_coverage, .. } = &mut *job.buffers;
            attribute(&binned.splats, list, &filter, &job.tile, paint, &mut group_coverage.sample_coverage);
        }
        scope.clocks.attribute.add(start);
    }

    /// Where the tile begins in planes with an apron.
    fn first(&self, job: &Job<'_, K, Painted<'_>>) -> usize {
        let (_, [left, top]) = with_apron(&job.tile, self.apron(), self.scope.raster.size);
        top * APRON_STRIDE + left
    }

    /// Pass `resolve` of one tile.
    fn resolve(&self, job: Job<'_, K, Painted<'_>>) {
        let scope = &self.scope;
        let start = Instant::now();
        let first = self.first(&job);
        let Job { tile, buffers, out, .. } = job;
        scope.end_turns(buffers);
        let TileBuffers { paint, group_coverage, .. } = buffers;
        let add = |weight: f32, film: &mut TileFilm| {
            let whole = Resolve { weight, ..scope.resolve() };
            K::resolve(&whole, &tile, first, paint, &group_coverage.coverage, film);
            if scope.frame.blending.is_some() {
                paint.copy_threshold(first, &tile, &mut film.threshold);
            }
        };
        match &mut out.at_rest {
            Some(rest) if !paint.moves => {
                if rest.values.is_empty() {
                    add(1.0, rest);
                }
                out.add_rest(scope.weight());
            }
            _ => add(scope.weight(), out.film),
        }
        scope.clocks.resolve.add(start);
    }
}

impl<'a, K: Kernel> TileWork for PaintGroup<'a, K> {
    type Pass = PaintPass;
    type Splat = K;
    type Out = Painted<'a>;

    fn scope(&self) -> &Scope<'_> {
        &self.scope
    }

    fn project(&self, chunk: &Chunk<'_>, binned: &mut Binned<K>) {
        self.project(chunk, binned);
    }

    fn run(&self, pass: PaintPass, mut job: Job<'_, K, Painted<'a>>) {
        match pass {
            PaintPass::Visibility => self.lower(&mut job),
            PaintPass::Second => self.find_second(&mut job),
            PaintPass::Attribute => self.add(&mut job),
            PaintPass::Resolve => self.resolve(job),
        }
    }

    fn skip(&self, is_empty: bool, out: &mut Painted<'a>) -> bool {
        is_empty || out.add_rest(self.scope.weight())
    }
}
