//! The plan of a frame, as data: an exposure has rasters, a raster has sample positions, and a position has steps.
//!
//! [`Exposure`] says at which times each pixel is sampled. Once the scene is posed there (`frame`),
//! [`Step::of_position`] says what a backend does about it, and in which order. No other place knows that order: a
//! backend walks over the rasters of a frame, their positions and their steps, and has one `match` over [`Step`].
//! Within a step the passes run in the order that stands here, of both backends. A backend may do a pass with several
//! programs: `gather` and a sort are parts of the GPU's `bin`, and `splat_values` is a part of its `attribute`.

mod times;

use self::times::moments;
use crate::options::{BlurMode, Interleave, PixelFilter, SweptKernel, Times};
use crate::time::Shutter;

/// When a frame is sampled: rasters, their sample positions, and the times of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Exposure {
    /// Pixels from one pixel of a raster to the next, along both axes, >= 1.
    pub stride: u32,
    /// One for each class of pixels, in the order of their phases: `stride`^2 of them.
    pub rasters: Vec<RasterExposure>,
}

/// The pixels that see the same times: every `stride`-th pixel of the image, as an image of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct RasterExposure {
    /// First pixel of the raster, column and row, each below the stride.
    pub phase: [u32; 2],
    /// Positions within the pixel, in the order in which they are rendered.
    pub positions: Vec<PositionExposure>,
    /// Number of positions that share the pixel's filter, >= 1. It is the number of [`Self::positions`], or more where
    /// these are one half of a picture that is rendered in two.
    pub positions_of_picture: usize,
}

impl RasterExposure {
    /// The exposure of a whole picture.
    fn whole(phase: [u32; 2], positions: Vec<PositionExposure>) -> Self {
        Self { phase, positions_of_picture: positions.len(), positions }
    }
}

/// A place within the pixel, and what is sampled there.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionExposure {
    /// Offset from the pixel's centre, pixels, as the pixel filter draws it.
    pub offset: [f32; 2],
    /// Rising in time; at least one.
    pub groups: Vec<Group>,
}

/// Time samples that share one visibility test and one resolve.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// At least one, rising in time.
    pub samples: Vec<TimeSample>,
    /// The interval that the group's one sample represents, and the kernels that sweep it. The sample lies at its
    /// middle. `None`: samples are instants.
    pub sweep: Option<(Interval, SweptKernel)>,
    /// Number of its points on lights ([`light_point`](crate::sampling::light_point)).
    pub number: u32,
}

/// A moment of the exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeSample {
    /// Scene time, frames.
    pub time: f64,
    /// Share of the exposure; all samples of a pixel sum to 1.
    pub weight: f64,
}

/// A part of the exposure during which all motion is steady.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Scene times of both ends, frames; just inside the interval where a pose jumps at an end.
    pub ends: [f64; 2],
    /// Share of the exposure of each 32nd of the interval.
    pub moments: [f64; 32],
    /// Motion of a kernel divided by the motion of its surfel, > 0.
    pub stretch: f64,
}

/// An interval of the exposure, for kernels in motion on a raster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosedInterval {
    /// Share of the exposure of each 32nd of the interval.
    pub moments: [f32; 32],
    /// Change of the time weight from the middle of the interval to its end, over its mean; in [-1, 1].
    pub slope: f32,
    /// Width of the visibility map's guard band, raster pixels. It is the largest distance by which anything moves from
    /// the middle of an interval to its end, for all intervals of the frame; at most half the raster's longer side.
    pub guard: u32,
    /// Number of slices, of equal length, in each of which kernels have a visibility of their own. A power of two, at
    /// most 32; the same for all intervals of the frame.
    pub slices: u32,
}

/// What a backend does for one sample position of one raster. `group` is an index into the groups of the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Splats opaque surfels and adds to the film what one group shows ([`PaintPass::order`]).
    Paint {
        /// The group.
        group: usize,
        /// Is what is at rest the same for all groups of the position? A backend may paint it once for all.
        shares_rest: bool,
    },
    /// Peels off the layers of see-through surfels ([`LayerPass::order`]). Opaque surfels hide them.
    Peel {
        /// The group.
        group: usize,
    },
    /// Composites captures, volumes and layers over the opaque picture of the group, front to back, and adds it to the
    /// film ([`CompositePass::order`]). The step that painted that picture added nothing to the film.
    Composite {
        /// The group.
        group: usize,
    },
    /// Sweeps kernels over an interval and adds them to the film ([`SweepPass::ORDER`]).
    Sweep {
        /// The group.
        group: usize,
        /// Its interval.
        interval: PosedInterval,
        /// What kernels sweep; the same in all sweeps of a frame.
        kernel: SweptKernel,
    },
    /// Does what Wolf (2008) prints, as printed.
    Published {
        /// The group.
        group: usize,
        /// The part of the work.
        part: Published,
    },
    /// Completes the film of a raster: clamps coverage, and divides what was pooled over all intervals. The last step
    /// of the last position.
    Finish,
}

/// A part of [`Step::Published`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Published {
    /// As [`Step::Paint`], of surfels with their low-pass discs, which make no layers ([`PaintPass::order`]).
    Instant,
    /// Makes a map of depth thresholds at the middle of an interval, over the raster and a guard band
    /// ([`MapPass::ORDER`]). Kernels in motion look up there whether their source is visible. So it must be complete
    /// before they are added.
    Map {
        /// Width of the guard band, raster pixels.
        guard: u32,
    },
    /// Sweeps kernels over an interval and adds them to the film ([`PublishedSweepPass::ORDER`]). It reads the map.
    Sweep {
        /// The interval.
        interval: PosedInterval,
        /// What kernels sweep; the same in all sweeps of a frame.
        kernel: SweptKernel,
    },
}

/// What the steps of a frame depend on, apart from its times.
#[allow(clippy::struct_excessive_bools, reason = "independent facts, each with a name")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scenery {
    /// Whether any visible opaque object with surfels is static, before a camera and under lights that are the same in
    /// all samples.
    pub has_rest: bool,
    /// Whether kernels at instants have low-pass discs, as published.
    pub low_pass: bool,
    /// Whether light passes through the surfels of any object.
    pub see_through: bool,
    /// Whether the scene holds what is transparent.
    pub transparent: bool,
}

impl Step {
    /// The steps of a sample position, in order, without [`Step::Finish`]. `sweeps` has an entry for each group: its
    /// interval and kernel, or `None` where samples are instants.
    pub fn of_position(sweeps: &[Option<(PosedInterval, SweptKernel)>], scenery: Scenery) -> Vec<Self> {
        let mut steps = Vec::new();
        let shares_rest = scenery.has_rest && sweeps.iter().filter(|sweep| sweep.is_none()).count() > 1;
        for (group, sweep) in sweeps.iter().enumerate() {
            match *sweep {
                None => {
                    let published = Self::Published { group, part: Published::Instant };
                    steps.push(if scenery.low_pass { published } else { Self::Paint { group, shares_rest } });
                    if scenery.see_through {
                        steps.push(Self::Peel { group });
                    }
                    if scenery.transparent {
                        steps.push(Self::Composite { group });
                    }
                }
                Some((interval, kernel)) if kernel.is_published() => {
                    steps.push(Self::Published { group, part: Published::Map { guard: interval.guard } });
                    steps.push(Self::Published { group, part: Published::Sweep { interval, kernel } });
                }
                Some((interval, kernel)) => steps.push(Self::Sweep { group, interval, kernel }),
            }
        }
        steps
    }
}

/// A pass that makes what a [`TilePass`] reads: splats, or kernels in motion, and their lists by tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BatchPass {
    /// Surfels to splats: posed, projected, bounded and culled.
    Project,
    /// Splats to a list for each tile that they may touch.
    Bin,
}

impl BatchPass {
    /// The passes in order. They run before the first pass that reads splats. Where splats come in batches, they run
    /// for each batch, and again for each pass that reads it.
    pub const ORDER: [Self; 2] = [Self::Project, Self::Bin];
}

/// A pass of a step that works on tiles.
pub trait TilePass: Copy {
    /// Whether it reads the splats of a tile's list, and not only what passes before it made of them.
    fn reads_splats(self) -> bool;
}

/// A pass of [`Step::Paint`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PaintPass {
    /// T(x, t) of each pixel: the least depth of the discs that cover it, plus their tolerance. With a filter also
    /// around the pixels that are wanted. Where objects have several tolerances, the least depth alone, too.
    Visibility,
    /// The same least depth over the discs behind the limits of their objects; and which pixels are solid.
    Second,
    /// Weighted sums of the attributes of the splats that pass the depth test: of one layer, or of four by depth.
    Attribute,
    /// Normalises, shades, composites the layers, and adds to the film with the time weight.
    Resolve,
}

impl PaintPass {
    /// The passes in order. `layered`: pixels have several layers (`Frame::has_layers`).
    pub const fn order(layered: bool) -> &'static [Self] {
        if layered {
            &[Self::Visibility, Self::Second, Self::Attribute, Self::Resolve]
        } else {
            &[Self::Visibility, Self::Attribute, Self::Resolve]
        }
    }
}

impl TilePass for PaintPass {
    fn reads_splats(self) -> bool {
        self != Self::Resolve
    }
}

/// A pass of [`Step::Composite`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CompositePass {
    /// Kernels to splats at the middle sample of the group, and the depths of their centres.
    ProjectMiddle,
    /// The order of those depths, which all samples of the group have.
    Sort,
    /// Kernels to splats at one sample of several.
    Project,
    /// Slab of depth by slab, the nearest first: [`BatchPass::Bin`], then on each tile [`SlabPass::order`].
    Composite,
}

impl CompositePass {
    /// The passes of one sample, in order. `sorts`: no order of the group is at hand. `several`: the group has several
    /// samples.
    pub const fn order(sorts: bool, several: bool) -> &'static [Self] {
        match (sorts, several) {
            (true, false) => &[Self::ProjectMiddle, Self::Sort, Self::Composite],
            (true, true) => &[Self::ProjectMiddle, Self::Sort, Self::Project, Self::Composite],
            (false, true) => &[Self::Project, Self::Composite],
            (false, false) => &[Self::Composite],
        }
    }
}

/// A pass of [`CompositePass::Composite`] on a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlabPass {
    /// Composites the splats of the slab, front to back, behind those of the slabs before it.
    Composite,
    /// Lays the composite over the opaque picture of the sample, and adds it to the film with the sample's weight.
    Resolve,
}

impl SlabPass {
    /// The passes of one slab, in order. `last`: no slab is behind it.
    pub const fn order(last: bool) -> &'static [Self] {
        if last { &[Self::Composite, Self::Resolve] } else { &[Self::Composite] }
    }
}

/// Most layers of see-through surfels at a pixel.
pub const LAYERS: u8 = 8;

/// A pass of [`Step::Peel`]. Passes of a layer have its number, 0 for the nearest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerPass {
    /// Nothing is covered yet.
    Start,
    /// As [`PaintPass::Visibility`], of discs behind all layers before this one. The pass with number [`LAYERS`] finds
    /// what [`LayerPass::LeftOut`] counts.
    Visibility(u8),
    /// Finds the pixels that are solid.
    Second(u8),
    /// As [`PaintPass::Attribute`], of what lies in the layer.
    Attribute(u8),
    /// Normalises and shades the layer.
    Resolve(u8),
    /// Counts the pixels that have more layers.
    LeftOut,
}

impl LayerPass {
    /// The passes in order, for all layers; `layered` as in [`PaintPass::order`].
    pub fn order(layered: bool) -> Vec<Self> {
        let mut order = vec![Self::Start];
        for layer in 0..LAYERS {
            order.push(Self::Visibility(layer));
            order.extend(layered.then_some(Self::Second(layer)));
            order.extend([Self::Attribute(layer), Self::Resolve(layer)]);
        }
        order.extend([Self::Visibility(LAYERS), Self::LeftOut]);
        order
    }
}

impl TilePass for LayerPass {
    fn reads_splats(self) -> bool {
        matches!(self, Self::Visibility(_) | Self::Attribute(_))
    }
}

/// A pass of [`Step::Sweep`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SweepPass {
    /// Depth thresholds of each slice of the interval, at each pixel.
    Visibility,
    /// Weighted sums of the attributes of the kernels that are visible, and the times at which they cover.
    Attribute,
    /// Turns the times at which kernels cover into coverage; then normalises and shades, or pools with the other
    /// intervals.
    Resolve,
}

impl SweepPass {
    /// The passes in order.
    pub const ORDER: [Self; 3] = [Self::Visibility, Self::Attribute, Self::Resolve];
}

impl TilePass for SweepPass {
    fn reads_splats(self) -> bool {
        self != Self::Resolve
    }
}

/// A pass of [`Published::Map`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapPass {
    /// As [`PaintPass::Visibility`], at the middle of the interval.
    Visibility,
    /// Writes thresholds to the map.
    Store,
}

impl MapPass {
    /// The passes in order.
    pub const ORDER: [Self; 2] = [Self::Visibility, Self::Store];
}

impl TilePass for MapPass {
    fn reads_splats(self) -> bool {
        self != Self::Store
    }
}

/// A pass of [`Published::Sweep`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PublishedSweepPass {
    /// Weighted sums of the attributes of the kernels whose source is visible, and the times at which they cover.
    Attribute,
    /// As [`SweepPass::Resolve`].
    Resolve,
}

impl PublishedSweepPass {
    /// The passes in order.
    pub const ORDER: [Self; 2] = [Self::Attribute, Self::Resolve];
}

impl TilePass for PublishedSweepPass {
    fn reads_splats(self) -> bool {
        self != Self::Resolve
    }
}

impl Exposure {
    /// The exposure of frame `frame` with this shutter.
    ///
    /// `jumps`: scene times within the shutter at which a pose jumps, rising, frames. Intervals are split there.
    pub fn new(mode: BlurMode, filter: PixelFilter, seed: u64, shutter: &Shutter, frame: f64, jumps: &[f64]) -> Self {
        match mode {
            BlurMode::Still { pixel_samples } => {
                let sample = TimeSample { time: frame, weight: 1.0 / f64::from(pixel_samples) };
                let groups = vec![Group { samples: vec![sample], sweep: None, number: 0 }; pixel_samples as usize];
                Self::uniform(with_offsets(groups, None, filter, seed))
            }
            BlurMode::Supersample { samples, pixel_samples, interleave, times } => {
                let strata = Strata::new(samples, 1, pixel_samples);
                Self::sampled(strata, interleave, times, filter, seed, shutter, frame)
            }
            BlurMode::Bucket { buckets, samples, pixel_samples, interleave, times } => {
                let strata = Strata::new(buckets, samples, pixel_samples);
                Self::sampled(strata, interleave, times, filter, seed, shutter, frame)
            }
            BlurMode::Volumetric { intervals, pixel_samples, swept } => {
                let strata = Strata::new(intervals, 1, pixel_samples);
                let groups = intervals_of(strata, swept, shutter, frame, jumps);
                let mut positions = with_offsets(groups, strata.positions, filter, seed);
                if strata.repeats > 1 {
                    positions.chunks_mut(strata.repeats as usize).for_each(centre);
                }
                Self::uniform(positions)
            }
        }
    }

    /// Time samples of all rasters in this mode, without those that intervals are split into at jumps.
    pub fn samples_of(mode: BlurMode) -> u64 {
        let of = |Strata { groups, samples, repeats, .. }: Strata| {
            u64::from(groups) * u64::from(samples) * u64::from(repeats)
        };
        match mode {
            BlurMode::Still { pixel_samples } => pixel_samples.into(),
            BlurMode::Supersample { samples, pixel_samples, interleave, .. } => {
                u64::from(interleave.stride().pow(2)) * of(Strata::new(samples, 1, pixel_samples))
            }
            BlurMode::Bucket { buckets, samples, pixel_samples, interleave, .. } => {
                u64::from(interleave.stride().pow(2)) * of(Strata::new(buckets, samples, pixel_samples))
            }
            BlurMode::Volumetric { intervals, pixel_samples, .. } => of(Strata::new(intervals, 1, pixel_samples)),
        }
    }

    /// One raster: all pixels see the same times.
    fn uniform(positions: Vec<PositionExposure>) -> Self {
        Self { stride: 1, rasters: vec![RasterExposure::whole([0, 0], positions)] }
    }

    /// One raster for each class of pixels; the groups of each tile the shutter.
    fn sampled(
        strata: Strata,
        interleave: Interleave,
        times: Times,
        filter: PixelFilter,
        seed: u64,
        shutter: &Shutter,
        frame: f64,
    ) -> Self {
        let Strata { groups, samples, repeats, positions } = strata;
        let stride = interleave.stride();
        let raster = |phase| {
            let seed = interleave.seed_of(phase, seed);
            let place = |within: f64| (f64::from(interleave.order(phase)) + within) / f64::from(stride * stride);
            let weighted = |(t, weight): (f64, f64)| TimeSample {
                time: shutter.frame_time(frame, t),
                weight: weight / f64::from(repeats),
            };
            let moments = moments(times, groups * samples, place, shutter, seed, frame);
            let moments: Vec<TimeSample> = moments.into_iter().map(weighted).collect();
            let groups = moments.chunks(samples as usize).flat_map(|samples| {
                let group = Group { samples: samples.to_vec(), sweep: None, number: 0 };
                std::iter::repeat_n(group, repeats as usize)
            });
            RasterExposure::whole(phase, with_offsets(groups.collect(), positions, filter, seed))
        };
        Self { stride, rasters: interleave.phases().map(raster).collect() }
    }

    /// All groups, in the order in which they are added to the film.
    pub fn groups(&self) -> impl Iterator<Item = &Group> {
        self.rasters.iter().flat_map(|raster| &raster.positions).flat_map(|position| &position.groups)
    }

    /// First and last scene time of its samples, frames.
    pub fn ends(&self) -> [f64; 2] {
        let times = || self.groups().flat_map(|group| &group.samples).map(|sample| sample.time);
        [times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max)]
    }

    /// The scene time of all samples, where it is the same.
    pub fn instant(&self) -> Option<f64> {
        let [first, last] = self.ends();
        (first == last).then_some(first)
    }
}

/// How the shutter is divided into groups.
#[derive(Clone, Copy)]
struct Strata {
    groups: u32,
    /// Time samples of each group.
    samples: u32,
    /// How many times each group is rendered.
    repeats: u32,
    /// Sub-pixel positions that are dealt out to all groups; `None`: each group has its own.
    positions: Option<u32>,
}

impl Strata {
    /// `groups` of `samples` samples, at `pixel_samples` sub-pixel positions or one for each.
    fn new(groups: u32, samples: u32, pixel_samples: Option<u32>) -> Self {
        let repeats = pixel_samples.map_or(1, |positions| positions.div_ceil(groups));
        Self { groups, samples, repeats, positions: pixel_samples.filter(|&positions| positions < groups) }
    }
}

/// Groups of one interval each, which tile the shutter. Where a pose jumps there are more than the number that was
/// asked for.
fn intervals_of(strata: Strata, kernel: SweptKernel, shutter: &Shutter, frame: f64, jumps: &[f64]) -> Vec<Group> {
    let Strata { groups: count, repeats, .. } = strata;
    let span = shutter.close - shutter.open;
    let mut cuts: Vec<(f64, bool)> = (0..=count).map(|i| (f64::from(i) / f64::from(count), false)).collect();
    cuts.extend(jumps.iter().map(|&time| ((time - frame - shutter.open) / span, true)));
    cuts.retain(|(t, _)| (0.0..=1.0).contains(t));
    cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A jump at a cut, or two jumps at once, add no interval.
    cuts.dedup_by(|b, a| {
        let same = b.0 - a.0 < 1e-9;
        a.1 |= same && b.1;
        same
    });
    let mut groups: Vec<Group> = Vec::new();
    for (&(from, from_jump), &(to, to_jump)) in cuts.iter().zip(cuts.iter().skip(1)) {
        let share = |a: f64, b: f64| shutter.weight.integral(a, b) / f64::from(repeats);
        let at = |i: u32| from + (to - from) * f64::from(i) / 32.0;
        let time = |t: f64| shutter.frame_time(frame, t);
        let inside = (1e-6 * (to - from) * span).max(8.0 * f64::EPSILON * time(to).abs());
        let nudge = |jump: bool| if jump { inside } else { 0.0 };
        let ends = [time(from) + nudge(from_jump), time(to) - nudge(to_jump)];
        let sample = TimeSample { time: 0.5 * (ends[0] + ends[1]), weight: share(from, to) };
        let moments = std::array::from_fn(|i| share(at(i as u32), at(i as u32 + 1)));
        let interval = Interval { ends, moments, stretch: kernel.overlap.stretch() };
        groups.push(Group { samples: vec![sample], sweep: Some((interval, kernel)), number: 0 });
    }
    groups.into_iter().flat_map(|group| std::iter::repeat_n(group, repeats as usize)).collect()
}

/// Deals `groups`, in order of time, out to `positions` sub-pixel positions. `None`: one position for each group.
fn with_offsets(groups: Vec<Group>, positions: Option<u32>, filter: PixelFilter, seed: u64) -> Vec<PositionExposure> {
    let offsets = filter.offsets(positions.unwrap_or(groups.len() as u32), seed);
    share_out(groups, &offsets)
}

/// Moves the positions of one interval so that their mean is the pixel's centre: no part of a streak is shifted.
fn centre(positions: &mut [PositionExposure]) {
    for axis in 0..2 {
        let mean = positions.iter().map(|position| position.offset[axis]).sum::<f32>() / positions.len() as f32;
        for position in &mut *positions {
            position.offset[axis] -= mean;
        }
    }
}

/// Deals `groups`, in order of time, out to positions at `offsets` in turn, so that each position sees the whole
/// exposure. Positions without a group are left out.
fn share_out(groups: Vec<Group>, offsets: &[[f32; 2]]) -> Vec<PositionExposure> {
    let mut positions: Vec<PositionExposure> =
        offsets.iter().take(groups.len()).map(|&offset| PositionExposure { offset, groups: Vec::new() }).collect();
    let count = positions.len().max(1);
    for (i, group) in groups.into_iter().enumerate() {
        if let Some(position) = positions.get_mut(i % count) {
            position.groups.push(Group { number: i as u32, ..group });
        }
    }
    positions
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic, reason = "tests may stop")]
mod tests;
