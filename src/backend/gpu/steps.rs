//! What the passes of a plan are on the device: the kernels that a step works on, and the programs of each pass. Twins:
//! `paint/group.rs`, `swept/sweep_group.rs`, `published/map_group.rs`, `published/sweep_group.rs` and
//! `transparent/see_through/mod.rs` of `src/backend/cpu/`. Captures and volumes: [`transparent`](super::transparent).

use super::memory::DeviceChannels;
use super::passes::{KernelKind, Program};
use super::prepared::Prepared;
use super::slots::Slot;
use super::upload::Placed;
use crate::frame::Frame;
use crate::options::{Normalise, Shading};
use crate::plan::{LayerPass, MapPass, PaintPass, PublishedSweepPass, SweepPass, TilePass};

/// What the programs of a step work on. It decides their constants, and which buffers they bind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum Kind {
    /// Opaque surfels at instants: step `Paint`, and instants of step `Published`.
    Paint,
    /// See-through surfels. Their passes are those of full EWA, with depths and films of their own. A tile of which
    /// nothing is left does nothing.
    Peel,
    /// Kernels in motion: step `Sweep`.
    Sweep,
    /// The map of step `Published`.
    Map,
    /// An interval of step `Published`.
    Published,
    /// Captures and volumes, in the order of depth: step `Composite`.
    Sorted,
}

impl Kind {
    /// Are the shadow maps of its groups drawn before it?
    pub(super) const fn draws_shadows(self) -> bool {
        matches!(self, Self::Paint | Self::Sweep | Self::Published)
    }

    /// The kernels of surfels at instants.
    pub(super) fn kernel(self, frame: &Frame) -> KernelKind {
        match self {
            Self::Peel => KernelKind::Filtered,
            Self::Paint => KernelKind::of(frame.prefilter),
            Self::Sweep | Self::Map | Self::Published | Self::Sorted => KernelKind::Disc,
        }
    }

    /// Does a filter widen them? Then tiles have an apron.
    pub(super) fn is_filtered(self, frame: &Frame) -> bool {
        self.kernel(frame) == KernelKind::Filtered
    }

    /// The channels of their sums.
    pub(super) fn channels<'a>(self, prepared: &'a Prepared<'_>) -> &'a DeviceChannels {
        match &prepared.see_through {
            Some(channels) if self == Self::Peel => channels,
            _ => &prepared.channels,
        }
    }

    /// What makes its splats.
    pub(super) const fn project(self) -> Program {
        match self {
            Self::Paint | Self::Peel | Self::Map => Program::Project,
            Self::Sweep => Program::Sweep,
            Self::Published => Program::PublishedSweep,
            Self::Sorted => Program::GaussianProject,
        }
    }

    /// The buffer that a program binds for `slot`, where it is not the slot's own.
    pub(super) fn other_slot(self, program: Program, slot: Slot, frame: &Frame) -> Slot {
        match (self, slot) {
            (Self::Peel, Slot::Film) => Slot::Layers,
            // What names both asks opaque surfels.
            (Self::Peel, Slot::Thresholds) if !program.row().slots().any(|slot| slot == Slot::Peeled) => Slot::Peeled,
            // Something transparent is laid over it.
            (Self::Paint, Slot::Film) if frame.blending.is_some() => Slot::Opaque,
            _ => slot,
        }
    }
}

/// What draws the shadow maps of groups, before their other passes.
pub(super) const SHADOWS: [Program; 6] = [
    Program::ShadowFit,
    Program::ShadowCentres,
    Program::ShadowPlanes,
    Program::ShadowLayout,
    Program::ShadowDraw,
    Program::ShadowDrawWide,
];

/// The programs that find the values of splats: whoever shades asks the shadow maps.
fn splat_values(frame: &Frame) -> Vec<Program> {
    if frame.shading == Shading::Gouraud && frame.has_shadows() {
        vec![Program::ShadowSurfels, Program::ShadowedValues]
    } else {
        vec![Program::SplatValues]
    }
}

/// What draws a layer of see-through surfels onto them.
pub(super) const SHADOW_LAYER: [Program; 3] = [Program::ShadowDraw, Program::ShadowDrawWide, Program::ShadowLayer];

/// A pass of a step that works on batches of surfels.
pub(in crate::backend) trait DevicePass: TilePass {
    /// Its programs for a batch of several, in order.
    fn programs(self, frame: &Frame, batch: &Placed, batches: usize) -> Vec<Program>;
}

impl DevicePass for PaintPass {
    fn programs(self, frame: &Frame, batch: &Placed, _batches: usize) -> Vec<Program> {
        match self {
            Self::Visibility if batch.shares_rest => {
                vec![Program::Visibility, Program::VisibilityEntries, Program::JoinRest]
            }
            Self::Visibility => vec![Program::Visibility, Program::VisibilityEntries],
            Self::Second => vec![Program::Second, Program::SecondEntries],
            Self::Attribute => [splat_values(frame), vec![Program::Attribute]].concat(),
            Self::Resolve if frame.shading == Shading::Phong && frame.has_shadows() => vec![Program::ShadowedResolve],
            Self::Resolve => vec![Program::Resolve],
        }
    }
}

impl DevicePass for LayerPass {
    fn programs(self, frame: &Frame, _batch: &Placed, batches: usize) -> Vec<Program> {
        match self {
            Self::Start => vec![Program::PeelStart],
            Self::Visibility(_) => vec![Program::Visibility, Program::VisibilityEntries],
            Self::Second(_) => vec![Program::Second],
            // The values of one batch stay from layer to layer.
            Self::Attribute(1..) if batches == 1 => vec![Program::Attribute],
            Self::Attribute(_) => [splat_values(frame), vec![Program::Attribute]].concat(),
            Self::Resolve(_) if frame.shading == Shading::Phong && frame.has_shadows() => {
                vec![Program::ShadowedPeelResolve]
            }
            Self::Resolve(_) => vec![Program::PeelResolve],
            Self::LeftOut => vec![Program::PeelLeftOut],
        }
    }
}

impl DevicePass for SweepPass {
    fn programs(self, frame: &Frame, _batch: &Placed, _batches: usize) -> Vec<Program> {
        match self {
            Self::Visibility => vec![Program::SweptVisibility, Program::SweptEntries],
            Self::Attribute => [splat_values(frame), vec![Program::SweptAttribute]].concat(),
            Self::Resolve if pools(frame) => vec![Program::Pool],
            Self::Resolve => vec![Program::SweptResolve],
        }
    }
}

impl DevicePass for MapPass {
    fn programs(self, _frame: &Frame, _batch: &Placed, _batches: usize) -> Vec<Program> {
        match self {
            Self::Visibility => vec![Program::Visibility, Program::VisibilityEntries],
            Self::Store => vec![Program::StoreMap],
        }
    }
}

impl DevicePass for PublishedSweepPass {
    fn programs(self, frame: &Frame, _batch: &Placed, _batches: usize) -> Vec<Program> {
        match self {
            Self::Attribute => [splat_values(frame), vec![Program::PublishedAttribute]].concat(),
            Self::Resolve if pools(frame) => vec![Program::PublishedPool],
            Self::Resolve => vec![Program::PublishedResolve],
        }
    }
}

/// Are intervals pooled, and divided once?
fn pools(frame: &Frame) -> bool {
    frame.swept.is_some_and(|kernel| kernel.normalise == Normalise::Once)
}
