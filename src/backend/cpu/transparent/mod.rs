//! Step `Transparent`: the Gaussians of captures, sorted by depth, composited front to back over the opaque picture of
//! an instant, and added to the film (docs/math.md, section 9; docs/architecture.md, "What is transparent").
//!
//! What is static is projected, sorted and listed once for all sample positions of a band. A tile merges it with what
//! moves. Where splats do not fit into memory, they pass in slabs of depth, the nearest first.

pub(in crate::backend) mod composite;
mod harmonics;
pub(in crate::backend) mod project;
mod resolve;
mod slabs;
mod sorted;

use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;

use self::composite::{Batch, Composite, Place, composite};
use self::project::{Projected, View, project};
use self::resolve::{Over, resolve};
use self::slabs::{Slab, retain, slabs};
use self::sorted::{CHUNK, Listed, Order, Walk};
use super::resolve::TileFilm;
use super::scope::Scope;
use crate::film::{Aov, Blending};
use crate::frame::PosedRaster;
use crate::layout::GaussianSplat;

/// What later steps and later frames use again.
#[derive(Debug, Default)]
pub(in crate::backend) struct TransparentMemory {
    /// The opaque picture of a group, tile by tile.
    pub opaque: Vec<TileFilm>,
    moving: Vec<Projected>,
    of_middle: Vec<Projected>,
    composites: Vec<Composite>,
    fixed: Vec<Projected>,
}

/// Splats of static objects in one band, in order: the same for all sample positions of a raster.
#[derive(Debug, Default)]
pub(in crate::backend) struct Fixed {
    order: Option<Order>,
    /// The slab of depth that it holds.
    slab: Slab,
}

/// One group in one band.
pub(in crate::backend) struct TransparentGroup<'a> {
    pub scope: Scope<'a>,
    /// Least and greatest offset of the raster's sample positions, raster pixels.
    pub offsets: [[f32; 2]; 2],
    /// Bytes for splats and their lists.
    pub splat_bytes: u64,
}

/// Least and greatest offset of a raster's sample positions, raster pixels.
pub(in crate::backend) fn offsets(raster: &PosedRaster) -> [[f32; 2]; 2] {
    let each = || raster.positions.iter().map(|position| position.raster.offset);
    let by = |pick: fn(f32, f32) -> f32| each().reduce(|a, b| [pick(a[0], b[0]), pick(a[1], b[1])]).unwrap_or_default();
    [by(f32::min), by(f32::max)]
}

/// Bytes of one Gaussian at most: as a splat, in its order, and in lists.
pub(in crate::backend) const BYTES: u64 = (Projected::BYTES + Order::BYTES + Listed::BYTES) as u64;

/// Bytes of one tile: what it accumulates, and the opaque picture.
pub(in crate::backend) const fn bytes_of_tile(planes: usize) -> u64 {
    Composite::BYTES + TileFilm::bytes_with_threshold(planes)
}

/// Some Gaussians of one object.
#[derive(Clone, Debug)]
struct Run {
    object: usize,
    gaussians: Range<usize>,
    /// Index of the object's first Gaussian among all of the frame.
    first: u32,
}

/// The Gaussians of the objects that are static, or are not, and visible at some sample, in document order.
fn runs(scope: &Scope<'_>, fixed: bool) -> Vec<Run> {
    let mut runs = Vec::new();
    let mut first = 0_u32;
    for (object, of_frame) in scope.frame.objects.iter().enumerate() {
        let Some(gaussians) = &of_frame.gaussians else { continue };
        let len = gaussians.len();
        let visible = scope.group.samples.iter().any(|sample| sample.objects[object].visible);
        if visible && of_frame.is_static == fixed {
            let ranges = (0..len).step_by(CHUNK).map(|from| from..(from + CHUNK).min(len));
            runs.extend(ranges.map(|gaussians| Run { object, gaussians, first }));
        }
        first = first.wrapping_add(len as u32);
    }
    runs
}

impl TransparentGroup<'_> {
    /// Runs all passes, and adds to `film`.
    pub(in crate::backend) fn run(&self, fixed: &mut Fixed, memory: &mut TransparentMemory, film: &mut [TileFilm]) {
        let scope = &self.scope;
        let samples = scope.group.samples.len();
        let middle = samples / 2;
        let TransparentMemory { opaque, moving, of_middle, composites, fixed: of_fixed } = memory;
        let (still, moves) = (runs(scope, true), runs(scope, false));
        let slabs = slabs(self, &still, &moves, middle);
        let mut shared = None;
        for sample in 0..samples {
            for (number, slab) in slabs.iter().enumerate() {
                if fixed.order.is_none() || fixed.slab != *slab {
                    self.project(&still, sample, false, slab, of_fixed);
                    fixed.order = Some(self.sort(of_fixed));
                    fixed.slab = *slab;
                }
                // A bucket has the order of its middle; then nothing may be left out of it.
                if self.several() && (shared.is_none() || slabs.len() > 1) {
                    self.project(&moves, middle, self.several(), slab, of_middle);
                    shared = Some(self.sort(of_middle));
                }
                self.project(&moves, sample, self.several(), slab, moving);
                let own;
                let order = match &shared {
                    Some(order) => order,
                    None => {
                        own = self.sort(moving);
                        &own
                    }
                };
                let start = Instant::now();
                let none = Order::default();
                let of_fixed = match &fixed.order {
                    Some(order) => Listed::new(of_fixed, order, &scope.band),
                    None => Listed::none(&none),
                };
                let of_moving = Listed::new(moving, order, &scope.band);
                scope.clocks.bin.add(start);
                let pass = Pass { first: number == 0, last: number + 1 == slabs.len(), sample };
                self.tiles([&of_fixed, &of_moving], pass, opaque, composites, film);
            }
        }
    }

    /// Has the group several samples?
    fn several(&self) -> bool {
        self.scope.group.samples.len() > 1
    }

    fn velocity(&self) -> bool {
        self.scope.frame.aovs.contains(&Aov::Velocity)
    }

    /// Pass `project` of all `runs`.
    fn project(&self, runs: &[Run], sample: usize, all: bool, slab: &Slab, out: &mut Vec<Projected>) {
        let scope = &self.scope;
        out.resize_with(runs.len(), Projected::default);
        out.par_iter_mut().zip(runs).for_each(|(out, run)| {
            let start = Instant::now();
            self.project_run(run, sample, all, out);
            if !slab.is_whole() {
                let kept = if all {
                    // A bucket has the depths of its middle.
                    let mut of_middle = Projected::default();
                    self.project_run(run, scope.group.samples.len() / 2, all, &mut of_middle);
                    slab.holds(&of_middle)
                } else {
                    slab.holds(out)
                };
                retain(&kept, out);
            }
            scope.clocks.splats.fetch_add(out.splats.len() as u64, std::sync::atomic::Ordering::Relaxed);
            scope.clocks.project.add(start);
        });
    }

    fn project_run(&self, run: &Run, sample: usize, all: bool, out: &mut Projected) {
        let scope = &self.scope;
        let frame = scope.frame;
        let object = &frame.objects[run.object];
        let Some(gaussians) = &object.gaussians else { return };
        let offsets = if object.is_static { self.offsets } else { [scope.raster.offset; 2] };
        let posed = &scope.group.samples[sample].objects[run.object];
        let view = View {
            object,
            posed,
            near: if posed.visible { posed.near } else { f32::INFINITY },
            raster: *scope.raster,
            size: frame.size,
            stride: frame.stride as f32,
            pixels: scope.band.pixels,
            wanted: frame.wanted.as_ref(),
            offsets,
            blending: frame.blending.unwrap_or(Blending::Linear),
            velocity: self.velocity(),
            first: run.first,
            all,
        };
        project(&view, gaussians, run.gaussians.clone(), out);
    }

    /// Pass `sort`.
    fn sort(&self, projected: &[Projected]) -> Order {
        let start = Instant::now();
        let order = Order::of(projected);
        self.scope.clocks.sort.add(start);
        order
    }

    /// Passes `composite` and `resolve` of all tiles, in buffers of their own or in those that go from slab to slab.
    fn tiles(
        &self,
        sets: [&Listed<'_>; 2],
        pass: Pass,
        opaque: &[TileFilm],
        composites: &mut Vec<Composite>,
        film: &mut [TileFilm],
    ) {
        if pass.first && pass.last {
            film.par_iter_mut().enumerate().for_each_init(Composite::default, |composite, (index, film)| {
                self.tile(sets, pass, index, &opaque[index], composite, film);
            });
            return;
        }
        composites.resize_with(film.len().max(composites.len()), Composite::default);
        film.par_iter_mut().zip(composites).enumerate().for_each(|(index, (film, composite))| {
            self.tile(sets, pass, index, &opaque[index], composite, film);
        });
    }

    fn tile(
        &self,
        sets: [&Listed<'_>; 2],
        pass: Pass,
        index: usize,
        opaque: &TileFilm,
        out: &mut Composite,
        film: &mut TileFilm,
    ) {
        let scope = &self.scope;
        let tile = scope.band.tile(index);
        let frame = scope.frame;
        if frame.wanted.as_ref().is_some_and(|blocks| !blocks.at(tile.tile[0], tile.tile[1])) {
            return;
        }
        let start = Instant::now();
        if pass.first {
            out.clear(scope.planes.depth.is_some(), self.velocity());
        }
        let place = Place { tile: &tile, offset: scope.raster.offset, threshold: &opaque.threshold };
        let mut front = sets.map(|set| set.walk(&tile, index).peekable());
        let mut batch = Batch::default();
        let mut any = false;
        while let Some((splat, velocity)) = nearest(&mut front) {
            batch.push(splat, velocity);
            if batch.is_full() {
                any = true;
                let open = composite(&batch, &place, out);
                batch.clear();
                if !open {
                    break;
                }
            }
        }
        if !batch.is_empty() {
            any = true;
            composite(&batch, &place, out);
        }
        scope.clocks.composite.add(start);
        let seen = any || !opaque.values.is_empty() || !pass.first;
        if pass.last && seen {
            let start = Instant::now();
            let samples = &scope.group.samples;
            let total: f32 = samples.iter().map(|sample| sample.weight).sum();
            let over = Over {
                opaque,
                scale: if samples.len() > 1 && total > 0.0 { 1.0 / total } else { 1.0 },
                weight: samples[pass.sample].weight,
                blending: frame.blending.unwrap_or(Blending::Linear),
                background: frame.background,
                planes: scope.planes,
            };
            resolve(&over, out, &tile, film);
            scope.clocks.resolve.add(start);
        }
    }
}

/// Where a walk over the tiles stands.
#[derive(Clone, Copy)]
struct Pass {
    /// Is it the first slab of depth?
    first: bool,
    /// Is it the last?
    last: bool,
    sample: usize,
}

/// The nearest of what both walks come to next.
#[inline]
fn nearest<'a>(
    walks: &mut [std::iter::Peekable<Walk<'a>>; 2],
) -> Option<(&'a GaussianSplat, Option<&'a [f32; 2]>)> {
    let [fixed, moving] = walks;
    let first = match (fixed.peek(), moving.peek()) {
        (Some(a), Some(b)) => a.rank < b.rank,
        (a, _) => a.is_some(),
    };
    let step = if first { fixed.next() } else { moving.next() };
    step.map(|step| (step.splat, step.velocity))
}

