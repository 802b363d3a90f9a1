//! Steps `StaticLayer` and `StaticPicture`: static objects, splatted once for several groups.

use std::time::Instant;

use super::bin::Binned;
use super::chunk::Chunk;
use super::job::Job;
use super::resolve::{self, Resolve};
use super::scope::Scope;
use super::static_tile::StaticTile;
use super::tile_buffers::TileBuffers;
use super::tile_runner::TileWork;
use super::tiles::{ROWS, STRIDE};
use crate::layout::Splat;
use crate::plan::StaticPass;

/// What is stored of static objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend) enum Stored {
    /// Sums, for groups that add to them; with a film where every group resolves them alike.
    Sums {
        /// Whether it does.
        with_film: bool,
    },
    /// The film alone.
    Film,
}

/// The static objects of a group in one band.
pub(in crate::backend) struct StaticGroup<'a> {
    pub scope: Scope<'a>,
    pub stored: Stored,
}

impl TileWork for StaticGroup<'_> {
    type Pass = StaticPass;
    type Splat = Splat;
    type Out = StaticTile;

    fn scope(&self) -> &Scope<'_> {
        &self.scope
    }

    fn project(&self, chunk: &Chunk, binned: &mut Binned) {
        self.scope.project_with_values(chunk, binned);
    }

    fn reads_splats(pass: StaticPass) -> bool {
        match pass {
            StaticPass::Visibility | StaticPass::Attribute => true,
            StaticPass::Store => false,
        }
    }

    fn prepare(&self, pass: StaticPass, _index: usize, buffers: &mut TileBuffers, _scratch: &mut Vec<u32>) {
        match pass {
            StaticPass::Visibility => buffers.clear_threshold(),
            StaticPass::Attribute => {
                buffers.clear_sums(self.scope.channels.count, self.scope.group.samples.len());
            }
            // The tile is written whole.
            StaticPass::Store => {}
        }
    }

    fn run(&self, pass: StaticPass, mut job: Job<'_, Splat, StaticTile>) {
        let scope = &self.scope;
        match pass {
            StaticPass::Visibility => scope.visibility(&mut job),
            StaticPass::Attribute => {
                let start = Instant::now();
                let mut nearest = std::mem::take(&mut job.out.nearest);
                if nearest.is_empty() && self.stored != Stored::Film {
                    nearest = vec![f32::INFINITY; ROWS * STRIDE];
                }
                scope.add_splats(&mut job, &mut nearest);
                job.out.nearest = nearest;
                scope.clocks.attribute.add(start);
            }
            StaticPass::Store => {
                let start = Instant::now();
                let TileBuffers { threshold, sums, .. } = &*job.buffers;
                *job.out = match self.stored {
                    Stored::Sums { .. } => StaticTile::with_sums(job.buffers, std::mem::take(&mut job.out.nearest)),
                    Stored::Film => StaticTile::with_threshold(threshold),
                };
                if self.stored != (Stored::Sums { with_film: false }) {
                    let whole = Resolve { weight: 1.0, ..scope.resolve() };
                    resolve::resolve(&whole, &job.tile, threshold, sums, &[], &mut job.out.film);
                }
                scope.clocks.resolve.add(start);
            }
        }
    }
}
