//! The buffers that passes exchange: the names under which programs bind them. `Schedule::bytes` has their lengths.

use wgpu::BufferUsages;

use super::layout::{
    CaptureSegment, DIGIT_BITS, DeviceGaussian, Light, Segment, Status, Totals, VIEW_BYTES, WORKGROUPS,
};
use crate::layout::FilteredSplat;

/// A buffer. The number is its binding in group 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum Slot {
    Geometry = 0,
    Looks = 1,
    /// Poses of surfels.
    Segments = 2,
    Lights = 3,
    Splats = 4,
    Touched = 5,
    Partials = 6,
    /// [`Slot::Totals`], by what writes them.
    WrittenTotals = 7,
    Status = 8,
    /// Tiles and slots of entries. A program of the sort writes these and reads [`Slot::SortedKeys`] and
    /// [`Slot::SortedList`]. There are two buffers of each, which take turns. In the end, entries are in the first
    /// ones, which are `Keys` and `List` among the buffers.
    Keys = 9,
    List = 10,
    Wide = 11,
    Starts = 12,
    Histogram = 13,
    DigitTotals = 14,
    SortedKeys = 15,
    SortedList = 16,
    Thresholds = 17,
    Values = 19,
    Sums = 20,
    Film = 21,
    Totals = 22,
    /// The visibility map of published kernels in motion; or the thresholds of slices of all others, and behind them,
    /// where they are kept, the nearest depths.
    Map = 24,
    CoverageMask = 25,
    Moments = 26,
    /// The blocks of the image that are wanted.
    Wanted = 27,
    /// The Gaussians of all captures and volumes, at a time sample of each group of a round, and their slots in the
    /// order of depth.
    Gaussians = 32,
    Order = 33,
    /// The picture of a group's surfels, which what is transparent is laid over.
    Opaque = 34,
    /// Depths and covers of see-through surfels, while layers are peeled off; the films of those layers.
    Peeled = 35,
    Layers = 36,
    /// What surfaces mirror.
    Environment = 37,
    /// Poses of Gaussians.
    CaptureSegments = 38,
    /// The shadow maps of a round, and the planes of what is drawn onto them.
    ShadowMaps = 39,
    Casters = 40,
    /// Views of a round, in group 0.
    Views = 64,
    /// Tables of workgroups; the background, and the totals of sorts. In group 0.
    Tables = 65,
}

/// Bytes of the table of workgroups that a program binds.
pub(in crate::backend) const TABLE_BYTES: u64 = 8 * WORKGROUPS as u64;
/// Bytes of the moments of an interval.
const MOMENT_BYTES: u64 = size_of::<[f32; 32]>() as u64;

/// All buffers that are there at any time, each with its name in messages, and bytes to begin with: a buffer must hold
/// one element of the largest type that it is bound as. Models have buffers of their own.
pub(in crate::backend) const SLOTS: [(Slot, &str, u64); 34] = [
    (Slot::Views, "views", VIEW_BYTES),
    (Slot::Tables, "tables", TABLE_BYTES),
    (Slot::Segments, "segments", size_of::<Segment>() as u64),
    (Slot::CaptureSegments, "segments of captures", size_of::<CaptureSegment>() as u64),
    (Slot::Lights, "lights", size_of::<Light>() as u64),
    (Slot::Environment, "the environment", 0),
    (Slot::Splats, "splats", size_of::<FilteredSplat>() as u64),
    (Slot::Touched, "tile counts", 0),
    (Slot::Partials, "tile counts", 0),
    (Slot::Totals, "totals", size_of::<Totals>() as u64),
    (Slot::Status, "status", size_of::<Status>() as u64),
    (Slot::Wide, "lists", 0),
    (Slot::Values, "attributes", 0),
    (Slot::Keys, "lists", 0),
    (Slot::List, "lists", 0),
    (Slot::SortedKeys, "lists", 0),
    (Slot::SortedList, "lists", 0),
    (Slot::Histogram, "lists", 0),
    (Slot::DigitTotals, "totals", 4 << DIGIT_BITS),
    (Slot::Starts, "lists", 0),
    (Slot::Thresholds, "thresholds", 0),
    (Slot::Sums, "sums", 0),
    (Slot::Map, "the map", 0),
    (Slot::CoverageMask, "coverage masks", 0),
    (Slot::Moments, "moments", MOMENT_BYTES),
    (Slot::Film, "the film's planes", 0),
    (Slot::Gaussians, "splats of captures", size_of::<DeviceGaussian>() as u64),
    (Slot::Order, "splats of captures", 0),
    (Slot::Opaque, "the opaque picture", 0),
    (Slot::Peeled, "see-through surfels", 0),
    (Slot::Layers, "see-through surfels", 0),
    (Slot::Wanted, "blocks", 0),
    (Slot::ShadowMaps, "shadow maps", 0),
    (Slot::Casters, "shadow maps", 0),
];

#[cfg(test)]
impl Slot {
    /// Its name in messages.
    pub(in crate::backend) fn name(self) -> &'static str {
        SLOTS.iter().find(|(slot, ..)| *slot == self).map_or("of a model", |(_, name, _)| name)
    }

    /// Largest difference of its values from the CPU's; 0 where they are whole numbers.
    ///
    /// That of floats is relative to the larger of 1 and the values that are added or multiplied (and for a splat's
    /// forms its `skew`). On the software device it is 0, measured: that device neither contracts nor approximates. One
    /// unit in the last place more in each of the sums that may cancel makes 1.9e-6
    /// (`programs_that_round_otherwise_pass`). A device may divide with an error of 2.5 units.
    pub(in crate::backend) const fn tolerance(self) -> f32 {
        use Slot::{CoverageMask, DigitTotals, Histogram, Keys, List, Order, Partials, SortedKeys, SortedList};
        use Slot::{Starts, Status, Totals, Touched, Wide, WrittenTotals};
        match self {
            CoverageMask | DigitTotals | Histogram | Keys | List | Order | Partials | SortedKeys | SortedList
            | Starts | Status | Totals | Touched | Wide | WrittenTotals => 0.0,
            _ => 5e-6,
        }
    }
}

impl Slot {
    /// What its buffer is for.
    pub(in crate::backend) const fn usage(self) -> BufferUsages {
        let storage = BufferUsages::STORAGE.union(BufferUsages::COPY_SRC).union(BufferUsages::COPY_DST);
        match self {
            Self::Views => BufferUsages::UNIFORM.union(BufferUsages::COPY_DST),
            Self::Tables => BufferUsages::UNIFORM.union(BufferUsages::COPY_DST).union(BufferUsages::COPY_SRC),
            Self::Totals => storage.union(BufferUsages::INDIRECT),
            _ => storage,
        }
    }
}
