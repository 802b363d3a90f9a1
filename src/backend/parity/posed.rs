//! The splats of a group on the CPU, made by the constructors that rendering uses ([`Scope`]).

use crate::backend::cpu::chunk::{Chunk, chunks};
use crate::backend::cpu::clocks::Clocks;
use crate::backend::cpu::paint::Kernel;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tiles::{Band, TILE};
use crate::film::FilmPlanes;
use crate::frame::{Frame, PosedGroup, Position};
use crate::layout::{Channels, Splat};

/// Splats, or kernels in motion, of one object at one sample, in surfel order. A static object has those of the first
/// sample.
#[derive(Clone, Debug)]
pub(super) struct Posed<'a, S = Splat> {
    pub chunk: Chunk<'a>,
    pub splats: Vec<S>,
}

/// What the CPU makes of a frame, whatever the group.
pub(super) struct Context {
    pub channels: Channels,
    pub planes: FilmPlanes,
    clocks: Clocks,
}

impl Context {
    pub(super) fn of(frame: &Frame) -> Self {
        Self { channels: Channels::of(frame), planes: frame.film_planes(), clocks: Clocks::default() }
    }

    /// A group in `band`, as rendering has it.
    pub(super) fn scope<'a>(
        &'a self,
        frame: &'a Frame,
        position: &'a Position,
        group: &'a PosedGroup,
        band: Band,
    ) -> Scope<'a> {
        let Self { channels, planes, clocks } = self;
        Scope { frame, raster: &position.raster, group, band, planes, channels, clusters: &[], clocks, shadows: None }
    }
}

/// The whole raster of `position`.
pub(super) fn whole(position: &Position) -> Band {
    let size = position.raster.size;
    Band::new(size, [0, (size[1] as usize).div_ceil(TILE)])
}

/// The chunks of rendering, those of one object and sample together.
pub(super) fn whole_chunks<'a>(scope: &Scope<'a>) -> Vec<Chunk<'a>> {
    let mut whole: Vec<Chunk<'_>> = Vec::new();
    for chunk in chunks(scope.frame, scope.group, false).0 {
        match whole.last_mut() {
            Some(last) if (last.sample, last.object) == (chunk.sample, chunk.object) => {
                last.surfels.end = chunk.surfels.end;
            }
            _ => whole.push(chunk),
        }
    }
    whole
}

/// The splats of all opaque objects, as `K` projects them.
pub(super) fn project<'a, K: Kernel>(scope: &Scope<'a>) -> Vec<Posed<'a, K>> {
    let splats_of = |chunk: Chunk<'a>| {
        let mut splats = Vec::new();
        K::project(&scope.view(&chunk), chunk.model.surfels(), chunk.surfels.clone(), &mut splats);
        Posed { chunk, splats }
    };
    whole_chunks(scope).into_iter().map(splats_of).collect()
}
