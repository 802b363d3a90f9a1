//! Runs the passes of a step over the tiles of a band.
//!
//! If the splats fit into the memory allowed, each tile goes through all passes at once. Else passes follow each other,
//! with the splats in batches.

use std::time::Instant;

use rayon::prelude::*;

use super::bin::{Binned, Tiled};
use super::chunk::{CHUNK, Chunk};
use super::job::Job;
use super::scope::Scope;
use super::tile_buffers::TileBuffers;
use super::tiles::TileRect;
use crate::plan::{BatchPass, TilePass};

/// What a step does, tile by tile.
pub(in crate::backend) trait TileWork: Sync {
    /// Its passes.
    type Pass: TilePass + Sync;
    /// What its passes read.
    type Splat: Tiled + Send + Sync;
    /// What it writes, one for each tile.
    type Out: Send;

    /// The group, and the band whose tiles are worked on.
    fn scope(&self) -> &Scope<'_>;

    /// Pass `project`: makes the splats of a chunk, and what they show.
    fn project(&self, chunk: &Chunk<'_>, binned: &mut Binned<Self::Splat>);

    /// Runs a pass on a tile, with the splats of one batch.
    fn run(&self, pass: Self::Pass, job: Job<'_, Self::Splat, Self::Out>);

    /// Deals with a tile that has no splats but those at rest, if that can be done without its passes; says whether it
    /// was. `is_empty`: the tile has none at all.
    fn skip(&self, is_empty: bool, _out: &mut Self::Out) -> bool {
        is_empty
    }
}

/// The passes of a step over the tiles of its band.
pub(in crate::backend) struct TileRunner<'a, W: TileWork> {
    pub work: &'a W,
    pub chunks: &'a [Chunk<'a>],
    /// In order.
    pub passes: &'a [W::Pass],
    /// Bytes for splats and their lists.
    pub splat_bytes: u64,
    /// Chunks of what is at rest: they come first.
    pub at_rest: usize,
    /// Chunks whose splats an earlier group made: they come first.
    pub made: usize,
}

impl<W: TileWork> TileRunner<'_, W> {
    /// Runs all passes; one output a tile. Says how many chunks have their splats at hand then.
    pub(in crate::backend) fn run(
        &self,
        binned: &mut Vec<Binned<W::Splat>>,
        buffers: &mut Vec<TileBuffers>,
        outputs: &mut [W::Out],
    ) -> usize {
        let taken = self.batch(self.chunks, self.made, binned);
        if taken == self.chunks.len() {
            self.run_at_once(&binned[..taken], outputs);
            taken
        } else {
            self.run_in_batches(taken, binned, buffers, outputs);
            0
        }
    }

    /// Runs all passes with all splats at hand. Each tile goes through its passes at once, in buffers that stay in the
    /// cache.
    pub(in crate::backend) fn run_at_once(&self, binned: &[Binned<W::Splat>], outputs: &mut [W::Out]) {
        let &Self { work, chunks, passes, .. } = self;
        outputs.par_iter_mut().enumerate().with_max_len(16).for_each_init(
            || (TileBuffers::default(), Vec::new()),
            |(buffers, scratch), (index, out)| {
                let tile = work.scope().band.tile(index);
                if !self.wants(&tile) {
                    return;
                }
                let mut any =
                    |binned: &[Binned<W::Splat>]| binned.iter().any(|binned| !binned.list(&tile, scratch).is_empty());
                if !any(&binned[self.at_rest..]) {
                    let is_empty = !any(&binned[..self.at_rest]);
                    if work.skip(is_empty, out) {
                        return;
                    }
                }
                for &pass in passes {
                    work.run(pass, Job { chunks, binned, tile, index, buffers, scratch, out, first: true });
                }
            },
        );
    }

    /// Runs one pass after the other, over all batches of splats; `done` chunks are in the first one, which is at hand.
    fn run_in_batches(
        &self,
        mut done: usize,
        binned: &mut Vec<Binned<W::Splat>>,
        buffers: &mut Vec<TileBuffers>,
        outputs: &mut [W::Out],
    ) {
        let &Self { work, chunks, passes, .. } = self;
        buffers.resize_with(outputs.len().max(buffers.len()), TileBuffers::default);
        let mut start = 0;
        for &pass in passes {
            let mut first = true;
            loop {
                let batch = &chunks[start..done];
                let splats = &binned[..batch.len()];
                buffers.par_iter_mut().zip(outputs.par_iter_mut()).enumerate().for_each_init(
                    Vec::new,
                    |scratch, (index, (buffers, out))| {
                        let tile = work.scope().band.tile(index);
                        if !self.wants(&tile) {
                            return;
                        }
                        work.run(
                            pass,
                            Job { chunks: batch, binned: splats, tile, index, buffers, scratch, out, first },
                        );
                    },
                );
                first = false;
                if !pass.reads_splats() {
                    break;
                }
                // On to the next batch; after the last, back to the first for the next pass.
                start = if done == chunks.len() { 0 } else { done };
                done = start + self.batch(&chunks[start..], 0, binned);
                if start == 0 {
                    break;
                }
            }
        }
    }

    /// Is the tile rendered? All tiles of a map are.
    fn wants(&self, tile: &TileRect) -> bool {
        let &Scope { frame, raster, .. } = self.work.scope();
        frame.swept.is_some() || frame.wanted.as_ref().is_none_or(|blocks| blocks.touch(raster.first, tile.bounds()))
    }

    /// Projects and bins as many of `chunks` as fit into the memory for splats, at least one; returns how many. The
    /// first `made` were before.
    pub(in crate::backend) fn batch(
        &self,
        chunks: &[Chunk<'_>],
        made: usize,
        binned: &mut Vec<Binned<W::Splat>>,
    ) -> usize {
        let scope = self.work.scope();
        let most = Binned::<W::Splat>::most_bytes(CHUNK, scope.channels.count, &scope.band);
        let least = rayon::current_num_threads();
        let mut used = binned[..made].iter().map(Binned::bytes).sum::<u64>();
        let mut done = made;
        while done < chunks.len() {
            let fit = (self.splat_bytes.saturating_sub(used) / most) as usize;
            if fit < least && done > 0 {
                break;
            }
            let end = (done + fit.max(least)).min(chunks.len());
            binned.resize_with(binned.len().max(end), Binned::default);
            let slots = &mut binned[done..end];
            slots.par_iter_mut().zip(&chunks[done..end]).for_each(|(binned, chunk)| self.list(chunk, binned));
            used += slots.iter().map(Binned::bytes).sum::<u64>();
            done = end;
        }
        done
    }

    /// Makes the splats of a chunk, and their lists.
    fn list(&self, chunk: &Chunk, binned: &mut Binned<W::Splat>) {
        for pass in BatchPass::ORDER {
            match pass {
                BatchPass::Project => self.work.project(chunk, binned),
                BatchPass::Bin => {
                    let start = Instant::now();
                    binned.bin();
                    self.work.scope().clocks.bin.add(start);
                }
            }
        }
    }
}
