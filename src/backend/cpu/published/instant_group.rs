//! Step `Published`, instants: the passes of one group with low-pass discs, added to the film.

use std::time::Instant;

use super::low_pass::LowPassSplat;
use super::resolve::resolve;
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::paint::PaintGroup;
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tile_runner::TileWork;
use crate::plan::InstantPass;

/// One group in one band.
pub(in crate::backend) struct InstantGroup<'a> {
    pub paint: PaintGroup<'a, LowPassSplat>,
}

impl TileWork for InstantGroup<'_> {
    type Pass = InstantPass;
    type Splat = LowPassSplat;
    type Out = TileFilm;

    fn scope(&self) -> &Scope<'_> {
        &self.paint.scope
    }

    fn project(&self, chunk: &Chunk, binned: &mut Binned<LowPassSplat>) {
        self.paint.project(chunk, binned);
    }

    fn reads_splats(pass: InstantPass) -> bool {
        pass != InstantPass::Resolve
    }

    fn run(&self, pass: InstantPass, mut job: Job<'_, LowPassSplat, TileFilm>) {
        match pass {
            InstantPass::Visibility => self.paint.lower(&mut job),
            InstantPass::Attribute => self.paint.add(&mut job),
            InstantPass::Resolve => {
                let (scope, start) = (&self.paint.scope, Instant::now());
                scope.end_turns(job.buffers);
                let TileBuffers { paint, group_coverage, .. } = job.buffers;
                resolve(&scope.resolve(), &job.tile, paint, &group_coverage.coverage, job.out);
                if scope.frame.blending.is_some() {
                    paint.copy_threshold(0, &job.tile, &mut job.out.threshold);
                }
                scope.clocks.resolve.add(start);
            }
        }
    }
}
