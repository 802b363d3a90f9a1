//! Runs passes over the tiles of a band: all at once on each tile where its splats fit into the memory allowed, else pass by pass, the
//! splats in waves.

use rayon::prelude::*;

use super::bin::{Binned, Tiled};
use super::tiles::{TileBuffers, TileRect};
use super::work::{CHUNK, Chunk, Work};
use crate::plan::Pass;

/// Passes of a group over the tiles of its band.
pub(super) struct Tiles<'a> {
    pub work: &'a Work<'a>,
    pub chunks: &'a [Chunk],
    pub passes: &'a [Pass],
    /// Bytes for splats and their lists.
    pub splat_bytes: u64,
}

/// One tile in one pass.
pub(super) struct Job<'a, S, O> {
    pub chunks: &'a [Chunk],
    /// The splats of `chunks`.
    pub binned: &'a [Binned<S>],
    pub tile: TileRect,
    /// Of the tile in its band.
    pub index: usize,
    pub buffers: &'a mut TileBuffers,
    pub scratch: &'a mut Vec<u32>,
    pub out: &'a mut O,
}

impl Tiles<'_> {
    /// Runs all passes; `project` makes the splats of a chunk, `tile` runs a pass on a tile. One output a tile. `unmoved` is asked for
    /// tiles without splats: true if it has dealt with the tile, or nothing lies still there; else the tile goes through its passes.
    pub(super) fn run<S: Tiled + Send + Sync, O: Send>(
        &self,
        binned: &mut Vec<Binned<S>>,
        buffers: &mut Vec<TileBuffers>,
        outputs: &mut [O],
        project: impl Fn(&Chunk, &mut Binned<S>) + Sync,
        unmoved: impl Fn(usize, &mut O) -> bool + Sync,
        tile: impl Fn(Pass, Job<'_, S, O>) + Sync,
    ) {
        let &Self { work, chunks, .. } = self;
        let passes = || self.passes.iter().copied().filter(|pass| !pass.makes_splats());
        let taken = self.wave(chunks, binned, &project);
        if taken == chunks.len() {
            // All splats at hand: each tile goes through its passes at once, in buffers that stay in the cache.
            let binned = &binned[..taken];
            outputs.par_iter_mut().enumerate().for_each_init(
                || (TileBuffers::default(), Vec::new()),
                |(buffers, scratch), (index, out)| {
                    let rect = work.band.tile(index);
                    if !self.wants(&rect) {
                        return;
                    }
                    let empty = binned.iter().all(|binned| binned.list(&rect, scratch).is_empty());
                    if empty && unmoved(index, out) {
                        return;
                    }
                    for pass in passes() {
                        work.prepare(pass, index, buffers, scratch);
                        tile(pass, Job { chunks, binned, tile: rect, index, buffers, scratch, out });
                    }
                },
            );
            return;
        }
        buffers.resize_with(outputs.len().max(buffers.len()), TileBuffers::default);
        let mut done = taken;
        let mut start = 0;
        for pass in passes() {
            let prepare = |scratch: &mut _, (index, buffers)| work.prepare(pass, index, buffers, scratch);
            buffers[..outputs.len()].par_iter_mut().enumerate().for_each_init(Vec::new, prepare);
            loop {
                let wave = &chunks[start..done];
                let splats = &binned[..wave.len()];
                buffers.par_iter_mut().zip(outputs.par_iter_mut()).enumerate().for_each_init(
                    Vec::new,
                    |scratch, (index, (buffers, out))| {
                        let rect = work.band.tile(index);
                        if !self.wants(&rect) {
                            return;
                        }
                        tile(pass, Job { chunks: wave, binned: splats, tile: rect, index, buffers, scratch, out });
                    },
                );
                if !pass.reads_splats() {
                    break;
                }
                // On to the next wave; after the last, back to the first for the next pass.
                start = if done == chunks.len() { 0 } else { done };
                done = start + self.wave(&chunks[start..], binned, &project);
                if start == 0 {
                    break;
                }
            }
        }
    }

    /// Is the tile rendered? All tiles of a map are.
    pub(super) fn wants(&self, tile: &TileRect) -> bool {
        let [x, y] = tile.tile;
        self.work.frame.swept.is_some() || self.work.frame.wanted.as_ref().is_none_or(|blocks| blocks.at(x, y))
    }

    /// Projects and bins as many of `chunks` as fit into the memory for splats, at least one; returns how many.
    pub(super) fn wave<S: Tiled + Send>(
        &self,
        chunks: &[Chunk],
        binned: &mut Vec<Binned<S>>,
        project: &(impl Fn(&Chunk, &mut Binned<S>) + Sync),
    ) -> usize {
        let most = Binned::<S>::most_bytes(CHUNK, self.work.channels.count, &self.work.band);
        let least = rayon::current_num_threads();
        let mut used = 0;
        let mut done = 0;
        while done < chunks.len() {
            let fit = (self.splat_bytes.saturating_sub(used) / most) as usize;
            if fit < least && done > 0 {
                break;
            }
            let end = (done + fit.max(least)).min(chunks.len());
            binned.resize_with(binned.len().max(end), Binned::default);
            let slots = &mut binned[done..end];
            slots.par_iter_mut().zip(&chunks[done..end]).for_each(|(binned, chunk)| project(chunk, binned));
            used += slots.iter().map(Binned::bytes).sum::<u64>();
            done = end;
        }
        done
    }
}

impl Pass {
    /// Splats are made of surfels, not tile by tile.
    pub(super) const fn makes_splats(self) -> bool {
        matches!(self, Self::Project | Self::Bin | Self::Sweep)
    }

    /// Reads the splats of a tile's list, and not only what was made of them.
    pub(super) const fn reads_splats(self) -> bool {
        !matches!(self, Self::Resolve | Self::Keep | Self::SweptResolve)
    }
}
