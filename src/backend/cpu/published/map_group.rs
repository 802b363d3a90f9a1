//! Step `Published`, a map: one group at the middle of its interval, over the band and a guard band.

use std::time::Instant;

use super::map::{self, MapTile};
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::paint::{Kernel, visibility};
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_runner::TileWork;
use crate::layout::Splat;
use crate::plan::MapPass;

/// One group on the map; the band of its scope has the guard band around it.
pub(in crate::backend) struct MapGroup<'a> {
    pub scope: Scope<'a>,
}

impl TileWork for MapGroup<'_> {
    type Pass = MapPass;
    type Splat = Splat;
    type Out = MapTile;

    fn scope(&self) -> &Scope<'_> {
        &self.scope
    }

    fn project(&self, chunk: &Chunk<'_>, binned: &mut Binned) {
        self.scope.timed(binned, |binned| {
            binned.splats.clear();
            Splat::project(&self.scope.view(chunk), chunk.model.surfels(), chunk.surfels.clone(), &mut binned.splats);
        });
    }

    fn run(&self, pass: MapPass, job: Job<'_, Splat, MapTile>) {
        let start = Instant::now();
        let buffers = &mut job.buffers.paint;
        match pass {
            MapPass::Visibility => {
                if job.first {
                    buffers.clear_depths(false, false);
                    buffers.floor.clear();
                }
                for (chunk, binned) in job.chunks.iter().zip(job.binned) {
                    let list = binned.list(&job.tile, job.scratch);
                    visibility(&binned.splats, list, self.scope.depths(chunk), &job.tile, buffers);
                }
            }
            MapPass::Store => map::store(&job.tile, &buffers.threshold, job.out),
        }
        self.scope.clocks.visibility.add(start);
    }
}
