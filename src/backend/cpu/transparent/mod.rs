//! Step `Composite`: the Gaussians of captures, sorted by depth, composited front to back over the opaque picture of
//! an instant, and added to the film (docs/math.md, section 11; docs/captures.md).
//!
//! What is static is projected, sorted and listed once for all sample positions of a band. A tile merges it with what
//! moves. Where splats do not fit into memory, they pass in slabs of depth, the nearest first.

pub(in crate::backend) mod accumulators;
pub(in crate::backend) mod composite;
mod emission;
mod harmonics;
pub(in crate::backend) mod project;
mod resolve;
pub(in crate::backend) mod see_through;
mod slabs;
mod sorted;
pub(in crate::backend) mod view;

use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;

use self::accumulators::{Composite, SurfelLayers, TileContent};
use self::composite::{SampledTile, SplatBatch, composite, waste};
use self::project::{Projected, project};
use self::resolve::{Over, resolve};
pub(in crate::backend) use self::see_through::SeeThroughGroup;
use self::see_through::cover::PeelBuffers;
use self::slabs::{Slab, retain, slabs};
use self::sorted::{CHUNK, Listed, Lists, Order, Walk, lists};
use self::view::{GaussianView, Shaded};
use super::resolve::TileFilm;
use super::scope::Scope;
use super::tiles::TileRect;
use crate::film::{Aov, Blending};
use crate::frame::PosedRaster;
use crate::model::Gaussians;
use crate::plan::{CompositePass, LAYERS, SlabPass};
use crate::scene::Drawing;

/// What later steps and later frames use again.
#[derive(Debug, Default)]
pub(in crate::backend) struct TransparentMemory {
    /// The opaque picture of a group, tile by tile.
    pub opaque: Vec<TileFilm>,
    /// The layers of see-through surfels of a group, tile by tile, each front to back.
    pub layers: Vec<Vec<TileFilm>>,
    moving: Vec<Projected>,
    /// What moves, at the middle of a bucket.
    of_middle: Vec<Projected>,
    composites: Vec<Composite>,
}

/// Splats of static objects in one band, in order: the same for all sample positions of a raster.
#[derive(Debug, Default)]
pub(in crate::backend) struct Fixed {
    /// The slab of depth that it holds; `None`: nothing yet.
    slab: Option<Slab>,
    chunks: Vec<Projected>,
    order: Order,
    lists: Vec<Lists>,
    /// Tiles that show nothing else, with weight 1. They are the same at all positions, where those have one offset.
    films: Vec<TileFilm>,
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

/// Bytes of one Gaussian as a splat and in its order.
const BYTES_UNLISTED: usize = Projected::BYTES + Order::BYTES;
/// With its place in lists, at most.
pub(in crate::backend) const BYTES: u64 = (BYTES_UNLISTED + Listed::BYTES) as u64;
/// Bytes of one Gaussian while slabs are looked for.
pub(in crate::backend) const BYTES_OF_RANK: u64 = size_of::<u64>() as u64;

/// Bytes of one tile: what it accumulates, the opaque picture, and what is static alone.
pub(in crate::backend) const fn bytes_of_tile(planes: usize) -> u64 {
    Composite::BYTES + TileFilm::bytes_with_threshold(planes) + TileFilm::bytes(planes)
}

/// Bytes of one tile of see-through surfels: what is peeled off, and all layers.
pub(in crate::backend) const fn bytes_of_layers(planes: usize) -> u64 {
    PeelBuffers::BYTES + LAYERS as u64 * TileFilm::bytes_with_threshold(planes)
}

/// Some Gaussians of one object.
#[derive(Clone, Debug)]
struct Run<'a> {
    object: usize,
    model: &'a Gaussians,
    drawing: Drawing,
    gaussians: Range<usize>,
    /// Index of the object's first Gaussian among all of the frame.
    first: u32,
}

/// The Gaussians of the objects that are static, or are not, and visible at some sample, in document order.
fn runs<'a>(scope: &Scope<'a>, fixed: bool) -> Vec<Run<'a>> {
    let mut runs = Vec::new();
    let mut first = 0_u32;
    let has_shadows = scope.frame.has_shadows();
    for (object, of_frame) in scope.frame.objects.iter().enumerate() {
        let Some((model, drawing)) = of_frame.drawn() else { continue };
        let len = model.len();
        let visible = scope.group.samples.iter().any(|sample| sample.objects[object].visible);
        // Each sample has points of its own on lights with shadows, and shadows of its own.
        let is_shaded = of_frame.receives || !model.normal.is_empty();
        let rests = of_frame.is_static && !(has_shadows && is_shaded);
        if visible && rests == fixed {
            let ranges = (0..len).step_by(CHUNK).map(|from| from..(from + CHUNK).min(len));
            runs.extend(ranges.map(|gaussians| Run { object, model, drawing, gaussians, first }));
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
        let (still, moves) = (runs(scope, true), runs(scope, false));
        let slabs = slabs(self, &still, &moves, middle);
        let several = self.several();
        // The order at the middle of the group, for all its samples.
        let mut order = Order::default();
        for sample in 0..samples {
            for (number, slab) in slabs.iter().enumerate() {
                self.fix(&still, slab, fixed);
                let sorts = sample == 0 || slabs.len() > 1;
                for pass in CompositePass::order(sorts, several) {
                    let TransparentMemory { moving, of_middle, .. } = &mut *memory;
                    let at_middle = if several { of_middle } else { &mut *moving };
                    match pass {
                        // Nothing is left out where the order has all.
                        CompositePass::ProjectMiddle => self.project(&moves, middle, several, slab, at_middle),
                        CompositePass::Sort => order = self.sort(at_middle),
                        CompositePass::Project => {
                            self.project(&moves, sample, several, slab, &mut memory.moving);
                            let pairs = memory.moving.iter_mut().zip(&memory.of_middle);
                            pairs.for_each(|(own, middle)| own.layers_of(middle));
                        }
                        CompositePass::Composite => {
                            let at = SlabAt { first: number == 0, last: number + 1 == slabs.len(), sample };
                            self.composite(at, &order, fixed, memory, film);
                        }
                    }
                }
            }
        }
    }

    /// Pass `composite` of one slab: its lists, then its tiles.
    fn composite(
        &self,
        at: SlabAt,
        order_of_moving: &Order,
        fixed: &mut Fixed,
        memory: &mut TransparentMemory,
        film: &mut [TileFilm],
    ) {
        let lists_of_moving = self.list(&memory.moving, order_of_moving);
        let moving = Listed { chunks: &memory.moving, order: order_of_moving, lists: &lists_of_moving };
        let Fixed { chunks, order, lists, films, .. } = fixed;
        let sets = [Listed { chunks, order, lists }, moving];
        let surfels = OfSurfels { opaque: &memory.opaque, layers: &memory.layers };
        if at.first && at.last {
            self.tiles_at_once(sets, at, surfels, films, film);
        } else {
            self.tiles_of_slab(sets, at, surfels, &mut memory.composites, film);
        }
    }

    /// Projects, sorts and lists what is static, if that was not done before.
    fn fix(&self, still: &[Run<'_>], slab: &Slab, fixed: &mut Fixed) {
        if fixed.slab == Some(*slab) {
            return;
        }
        self.project(still, 0, false, slab, &mut fixed.chunks);
        fixed.order = self.sort(&fixed.chunks);
        fixed.lists = self.list(&fixed.chunks, &fixed.order);
        fixed.slab = Some(*slab);
    }

    /// Depth of a layer of volumes, scene units: the least of all volumes, at the group's middle.
    fn layer(&self) -> f32 {
        let samples = &self.scope.group.samples;
        let posed = samples[samples.len() / 2].objects.iter().zip(&self.scope.frame.objects);
        let volumes = posed.filter(|(_, object)| object.is_volume()).map(|(posed, _)| posed.epsilon);
        volumes.fold(f32::MAX, f32::min).max(f32::MIN_POSITIVE)
    }

    /// Has the group several samples?
    fn several(&self) -> bool {
        self.scope.group.samples.len() > 1
    }

    fn velocity(&self) -> bool {
        self.scope.frame.aovs.contains(&Aov::Velocity)
    }

    /// Pass `project` of all `runs`.
    fn project(&self, runs: &[Run<'_>], sample: usize, all: bool, slab: &Slab, out: &mut Vec<Projected>) {
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
            if let Some(wasted) = &scope.clocks.wasted {
                wasted.add(waste(out, scope.raster.offset));
            }
        });
    }

    fn project_run(&self, run: &Run<'_>, sample: usize, all: bool, out: &mut Projected) {
        let scope = &self.scope;
        let frame = scope.frame;
        let object = &frame.objects[run.object];
        let offsets = if object.is_static { self.offsets } else { [scope.raster.offset; 2] };
        let posed = &scope.group.samples[sample].objects[run.object];
        let middle = &scope.group.samples[scope.group.samples.len() / 2];
        let shaded = scope.shadows.filter(|_| object.receives);
        let view = GaussianView {
            object,
            shaded: shaded.map(|shadows| Shaded { shadows, sample: middle, posed: &middle.objects[run.object] }),
            drawing: run.drawing,
            sample: &scope.group.samples[sample],
            posed,
            near: if posed.visible { posed.near } else { f32::INFINITY },
            raster: *scope.raster,
            size: frame.size,
            stride: frame.stride as f32,
            pixels: scope.band.pixels,
            wanted: frame.wanted.as_ref(),
            offsets,
            layer: self.layer(),
            variance: scope.raster.variance(frame.prefilter),
            blending: frame.blending.unwrap_or(Blending::Linear),
            velocity: self.velocity(),
            first: run.first,
            all,
        };
        project(&view, run.model, run.gaussians.clone(), out);
    }

    /// Pass `sort`.
    fn sort(&self, projected: &[Projected]) -> Order {
        let start = Instant::now();
        let order = Order::of(projected);
        self.scope.clocks.sort.add(start);
        order
    }

    /// Pass `bin`.
    fn list(&self, projected: &[Projected], order: &Order) -> Vec<Lists> {
        let start = Instant::now();
        let lists = lists(projected, order, &self.scope.band);
        self.scope.clocks.bin.add(start);
        lists
    }

    /// Passes `composite` and `resolve` of all tiles, with all splats at hand.
    fn tiles_at_once(
        &self,
        sets: [Listed<'_>; 2],
        at: SlabAt,
        surfels: OfSurfels<'_>,
        films: &mut Vec<TileFilm>,
        out: &mut [TileFilm],
    ) {
        let weight = self.scope.group.samples[at.sample].weight;
        // A film of a tile is worth keeping where it will be shown again.
        let shared = self.offsets[0] == self.offsets[1];
        films.resize_with(out.len(), TileFilm::default);
        let tiles = out.par_iter_mut().zip(films).enumerate();
        tiles.for_each_init(Composite::default, |composite, (index, (out, film))| {
            let surfels = surfels.tile(index);
            let alone = !sets[1].reaches(index) && surfels.is_empty();
            if !(shared && alone) {
                return self.tile(sets, at, weight, index, surfels, composite, out);
            }
            if film.values.is_empty() {
                self.tile(sets, at, 1.0, index, surfels, composite, film);
            }
            out.values.resize(film.values.len().max(out.values.len()), 0.0);
            out.values.iter_mut().zip(&film.values).for_each(|(out, value)| *out += weight * value);
        });
    }

    /// The same of one slab of depth, in buffers that go from slab to slab.
    fn tiles_of_slab(
        &self,
        sets: [Listed<'_>; 2],
        at: SlabAt,
        surfels: OfSurfels<'_>,
        composites: &mut Vec<Composite>,
        out: &mut [TileFilm],
    ) {
        let weight = self.scope.group.samples[at.sample].weight;
        composites.resize_with(out.len().max(composites.len()), Composite::default);
        out.par_iter_mut().zip(composites).enumerate().for_each(|(index, (out, composite))| {
            self.tile(sets, at, weight, index, surfels.tile(index), composite, out);
        });
    }

    /// One tile, added to `film` with `weight`.
    #[allow(clippy::too_many_arguments, reason = "called in three places of this file")]
    fn tile(
        &self,
        sets: [Listed<'_>; 2],
        at: SlabAt,
        weight: f32,
        index: usize,
        TileSurfels { opaque, layers }: TileSurfels<'_>,
        out: &mut Composite,
        film: &mut TileFilm,
    ) {
        let scope = &self.scope;
        let tile = scope.band.tile(index);
        let frame = scope.frame;
        if frame.wanted.as_ref().is_some_and(|blocks| !blocks.touch(scope.raster.first, tile.bounds())) {
            return;
        }
        let any = sets.map(|set| set.reaches(index));
        let seen = any.contains(&true) || !opaque.values.is_empty() || !layers.is_empty() || !at.first;
        if at.last && !seen {
            return;
        }
        let coded = frame.blending == Some(Blending::Coded);
        let surfels = SurfelLayers { layers, threshold: &opaque.threshold, planes: scope.planes, coded };
        for pass in SlabPass::order(at.last) {
            let start = Instant::now();
            match pass {
                SlabPass::Composite => {
                    self.composite_tile(sets, any, at, &tile, index, surfels, out);
                    scope.clocks.composite.add(start);
                }
                SlabPass::Resolve => {
                    let over = Over {
                        opaque,
                        scale: scope.scale(),
                        weight,
                        blending: frame.blending.unwrap_or(Blending::Linear),
                        background: frame.background,
                        planes: scope.planes,
                    };
                    resolve(&over, out, &tile, film);
                    scope.clocks.resolve.add(start);
                }
            }
        }
    }

    /// Pass `composite` of one tile. `any`: the sets that reach it.
    #[allow(clippy::too_many_arguments, reason = "called in one place of this file")]
    fn composite_tile(
        &self,
        sets: [Listed<'_>; 2],
        any: [bool; 2],
        at: SlabAt,
        tile: &TileRect,
        index: usize,
        surfels: SurfelLayers<'_>,
        out: &mut Composite,
    ) {
        let scope = &self.scope;
        if at.first {
            let (depth, velocity) = (scope.planes.depth.is_some(), self.velocity());
            out.start(&TileContent { depth, velocity, volumes: scope.frame.has_volumes(), surfels }, tile);
        }
        let place = SampledTile { tile, offset: scope.raster.offset, rising: !self.several(), surfels };
        let mut walks = sets.map(|set| set.walk(tile, index));
        let mut batch = SplatBatch::default();
        loop {
            let wants = |bounds| out.is_open(bounds, tile);
            let more = match any {
                [true, false] => walks[0].take(&mut batch, out.closed == 0, wants),
                [false, true] => walks[1].take(&mut batch, out.closed == 0, wants),
                _ => take_nearest(&mut walks, &mut batch, wants),
            };
            if !batch.is_empty() && (!more || batch.room() == 0) {
                let open = composite(&batch, &place, out);
                batch.clear();
                if !open {
                    break;
                }
            }
            if !more {
                break;
            }
        }
        if at.last {
            out.finish(&surfels, tile);
        }
    }
}

/// What surfels show in the tiles of a band.
#[derive(Clone, Copy)]
struct OfSurfels<'a> {
    opaque: &'a [TileFilm],
    layers: &'a [Vec<TileFilm>],
}

/// The same of one tile.
#[derive(Clone, Copy)]
struct TileSurfels<'a> {
    opaque: &'a TileFilm,
    layers: &'a [TileFilm],
}

impl<'a> OfSurfels<'a> {
    fn tile(self, index: usize) -> TileSurfels<'a> {
        TileSurfels { opaque: &self.opaque[index], layers: self.layers.get(index).map_or(&[], Vec::as_slice) }
    }
}

impl TileSurfels<'_> {
    fn is_empty(&self) -> bool {
        self.opaque.values.is_empty() && self.layers.is_empty()
    }
}

/// A slab of depth at a sample.
#[derive(Clone, Copy)]
struct SlabAt {
    /// Is it the first slab of depth?
    first: bool,
    /// Is it the last?
    last: bool,
    sample: usize,
}

/// Fills `batch` with the nearest of what both walks come to next. False at the end of both.
fn take_nearest(walks: &mut [Walk<'_>; 2], batch: &mut SplatBatch, wants: impl Fn([u16; 4]) -> bool) -> bool {
    let [fixed, moving] = walks;
    let mut next = [fixed.peek(), moving.peek()];
    while batch.room() > 0 {
        let first = match next {
            [None, None] => return false,
            [Some(of_fixed), Some(of_moving)] => of_fixed < of_moving,
            [of_fixed, None] => of_fixed.is_some(),
            [None, Some(_)] => false,
        };
        if first {
            fixed.take_one(batch, &wants);
            next[0] = fixed.peek();
        } else {
            moving.take_one(batch, &wants);
            next[1] = moving.peek();
        }
    }
    true
}
