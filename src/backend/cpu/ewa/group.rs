//! Step `Ewa`: the passes of one group of time samples with filtered kernels, added to the film.

use std::time::Instant;

use super::attribute::{Filter, attribute};
use super::buffers::{APRON_STRIDE, with_apron};
use super::project::{Filtered, project};
use super::resolve::resolve;
use super::share::Shares;
use super::visibility::{find_open, second, visibility};
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::project::View;
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tile_runner::TileWork;
use crate::backend::cpu::tiles::{ROWS, STRIDE};
use crate::backend::cpu::visibility::Depths;
use crate::layout::EwaSplat;
use crate::plan::EwaPass;

/// One group in one band.
pub(in crate::backend) struct EwaGroup<'a> {
    pub scope: Scope<'a>,
}

impl EwaGroup<'_> {
    fn apron(&self) -> usize {
        self.scope.raster.apron()
    }

    /// The depth tolerance of all objects; `None` where they have several.
    pub(in crate::backend::cpu) fn tolerance_of_all(&self) -> Option<Depths> {
        let mut all = self.scope.group.samples.iter().flat_map(|sample| &sample.objects).map(|object| object.epsilon);
        let epsilon = all.next()?;
        all.all(|other| other == epsilon).then_some(Depths { near: self.scope.frame.near, epsilon })
    }

    fn samples(&self) -> usize {
        self.scope.group.samples.len()
    }
}

impl TileWork for EwaGroup<'_> {
    type Pass = EwaPass;
    type Splat = EwaSplat;
    type Out = TileFilm;

    fn scope(&self) -> &Scope<'_> {
        &self.scope
    }

    fn project(&self, chunk: &Chunk, binned: &mut Binned<EwaSplat>) {
        let scope = &self.scope;
        let surfels = &scope.frame.objects[chunk.object].surfels;
        scope.timed(binned, |binned| {
            binned.splats.clear();
            let apron = self.apron();
            let pixels = scope.band.pixels;
            let guarded = pixels.widened(apron as i32, scope.raster.size);
            let view = View { margin: apron as f32, low_pass: false, pixels: guarded, ..scope.view(chunk) };
            let sigma = scope.raster.sigma;
            let shares = Shares::of(surfels);
            let mut out = Filtered { sigma, pixels, guarded, shares, out: &mut binned.splats };
            project(&view, surfels, chunk.surfels.clone(), &mut out);
            binned.bin();
            scope.add_values(chunk, binned);
        });
    }

    fn reads_splats(pass: EwaPass) -> bool {
        match pass {
            EwaPass::Visibility | EwaPass::Second | EwaPass::Attribute => true,
            EwaPass::Resolve => false,
        }
    }

    fn prepare(&self, pass: EwaPass, index: usize, buffers: &mut TileBuffers, _scratch: &mut Vec<u32>) {
        match pass {
            EwaPass::Visibility => {
                buffers.ewa.clear_depths();
                buffers.ewa.floor.clear();
            }
            // Several samples have one coverage, at all depths together.
            EwaPass::Second if self.samples() > 1 => {}
            EwaPass::Second => {
                let tile = self.scope.band.tile(index);
                find_open(&tile, self.apron(), self.scope.raster.size, self.tolerance_of_all(), &mut buffers.ewa);
            }
            EwaPass::Attribute => {
                buffers.ewa.clear_sums(self.scope.channels.count);
                buffers.clear_coverage(self.samples());
            }
            // The film goes on from the groups before.
            EwaPass::Resolve => {}
        }
    }

    fn run(&self, pass: EwaPass, job: Job<'_, EwaSplat, TileFilm>) {
        let scope = &self.scope;
        let start = Instant::now();
        let (rect, [left, top]) = with_apron(&job.tile, self.apron(), scope.raster.size);
        let first = top * APRON_STRIDE + left;
        if pass == EwaPass::Resolve {
            scope.end_turns(job.buffers);
            let TileBuffers { ewa, group_coverage, .. } = job.buffers;
            resolve(&scope.resolve(), &job.tile, first, ewa, &group_coverage.coverage, job.out);
            if scope.frame.blending.is_some() {
                let out = &mut job.out.threshold;
                out.clear();
                out.resize(ROWS * STRIDE, f32::INFINITY);
                for y in 0..job.tile.height {
                    let row = &ewa.threshold[first + y * APRON_STRIDE..][..job.tile.width];
                    out[y * STRIDE..][..job.tile.width].copy_from_slice(row);
                }
            }
            return scope.clocks.resolve.add(start);
        }
        if pass == EwaPass::Second && !job.buffers.ewa.any_open() {
            return;
        }
        // Nobody asks for them where a group has several samples.
        let tolerances = self.samples() == 1 && self.tolerance_of_all().is_none();
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            let depths = scope.depths(chunk);
            if pass == EwaPass::Attribute {
                scope.turn(chunk, job.buffers);
            }
            let TileBuffers { ewa: buffers, group_coverage, .. } = &mut *job.buffers;
            match pass {
                EwaPass::Visibility => visibility(&binned.splats, list, depths, &rect, tolerances, buffers),
                EwaPass::Second => second(&binned.splats, list, depths, &job.tile, first, buffers),
                EwaPass::Attribute => {
                    let attributes = scope.attributes(chunk, &binned.values);
                    let filter = Filter { attributes, depths, sigma: scope.raster.sigma, start: first, ceiling: &[] };
                    let coverage = &mut group_coverage.sample_coverage;
                    attribute(&binned.splats, list, &filter, &job.tile, buffers, coverage);
                }
                EwaPass::Resolve => {}
            }
        }
        let clock = if pass == EwaPass::Attribute { &scope.clocks.attribute } else { &scope.clocks.visibility };
        clock.add(start);
    }
}
