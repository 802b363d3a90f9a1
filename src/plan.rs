//! The plan that a backend executes.

use crate::options::{BlurMode, Interleave, KernelWeight, PixelFilter, SweptKernel};
use crate::sampling::pixel_offsets;
use crate::time::Shutter;

/// A stage of rendering a group of time samples; see docs/architecture.md for what each reads and writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// Surfels to splats: posed, projected, bounded, culled.
    Project,
    /// Splats to per-tile lists, in global surfel order.
    Bin,
    /// T(x, t) per pixel, from the splats of the group.
    Visibility,
    /// Weighted sums of the attributes of the splats that pass the depth test.
    Attribute,
    /// Normalise, shade, add to the film with the time weight.
    Resolve,
    /// Sum of the weights of the splats that pass the depth test, per pixel.
    Density,
    /// What was found so far goes into a map of all pixels and a guard band around them.
    Keep,
    /// Surfels to kernels in motion over the group's interval, and those to per-tile lists, in global surfel order.
    Sweep,
    /// Weighted sums of the attributes of the kernels whose source on the map is visible, and when they cover.
    SweptAttribute,
    /// When they cover becomes coverage; then as `Resolve`, or pooled with the other intervals.
    SweptResolve,
}

impl Pass {
    /// Passes of what is not swept, in order.
    pub const UNSWEPT: [Self; 5] = [Self::Project, Self::Bin, Self::Visibility, Self::Attribute, Self::Resolve];
}

impl BlurMode {
    /// Passes of one group, in order.
    pub const fn passes(self) -> &'static [Pass] {
        use Pass::{Bin, Density, Keep, Project, Sweep, SweptAttribute, SweptResolve, Visibility};
        match self {
            Self::Still { .. } | Self::Supersample { .. } | Self::Bucket { .. } => &Pass::UNSWEPT,
            Self::Volumetric { swept: SweptKernel { weight: KernelWeight::Integral, .. }, .. } => {
                &[Project, Bin, Visibility, Density, Keep, Sweep, SweptAttribute, SweptResolve]
            }
            Self::Volumetric { swept: SweptKernel { weight: KernelWeight::Chord, .. }, .. } => {
                &[Project, Bin, Visibility, Keep, Sweep, SweptAttribute, SweptResolve]
            }
        }
    }
}

/// A moment of the exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeSample {
    /// Scene time, frames.
    pub time: f64,
    /// Share of the exposure; all samples of a pixel sum to 1.
    pub weight: f64,
}

/// Time samples that share one visibility test and one resolve.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// At least one, rising in time.
    pub samples: Vec<TimeSample>,
    /// Offset of the sample position from the pixel's centre, pixels, each in [-1/2, 1/2).
    pub offset: [f32; 2],
    /// First pixel that the group is rendered for; the others are whole strides away.
    pub phase: [u32; 2],
    /// The interval whose motion the one sample, at its middle, stands for.
    pub interval: Option<Interval>,
}

/// A part of the exposure during which things move steadily.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Scene times of both ends, frames; just inside where something jumps at an end.
    pub ends: [f64; 2],
    /// Share of the exposure of each 32nd of the interval.
    pub moments: [f64; 32],
}

/// What a backend executes for one frame: `passes` for each group, in order. Backends know nothing about blur modes.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Stages of each group.
    pub passes: &'static [Pass],
    /// Pixels from one that a group is rendered for to the next, along both axes.
    pub stride: u32,
    /// Groups, in the order in which they are added to the film; those of one phase stand together.
    pub groups: Vec<Group>,
}

impl Plan {
    /// The plan of frame `frame` with this shutter.
    ///
    /// `jumps` are the scene times within the shutter at which something jumps, rising, frames: intervals are split there.
    pub fn new(mode: BlurMode, filter: PixelFilter, seed: u64, shutter: &Shutter, frame: f64, jumps: &[f64]) -> Self {
        let still = |weight| vec![TimeSample { time: frame, weight }];
        let (groups, interleave) = match mode {
            BlurMode::Still { pixel_samples } => {
                let moments = vec![(still(1.0 / f64::from(pixel_samples)), None); pixel_samples as usize];
                (with_offsets(moments, None, filter, seed, [0, 0]), Interleave::None)
            }
            BlurMode::Supersample { samples, pixel_samples, interleave } => {
                (exposure(Strata::new(samples, 1, pixel_samples), interleave, filter, seed, shutter, frame), interleave)
            }
            BlurMode::Bucket { buckets, samples, pixel_samples, interleave } => (
                exposure(Strata::new(buckets, samples, pixel_samples), interleave, filter, seed, shutter, frame),
                interleave,
            ),
            BlurMode::Volumetric { intervals, pixel_samples, swept: _ } => (
                swept_exposure(Strata::new(intervals, 1, pixel_samples), filter, seed, shutter, frame, jumps),
                Interleave::None,
            ),
        };
        Self { passes: mode.passes(), stride: interleave.stride(), groups }
    }
}

/// How many groups tile the shutter.
#[derive(Clone, Copy)]
struct Strata {
    groups: u32,
    /// Of each group.
    samples: u32,
    /// How often each group is there.
    repeats: u32,
    /// Sub-pixel positions that all groups share out; `None`: each has its own.
    positions: Option<u32>,
}

impl Strata {
    /// `groups` of `samples` samples, at `pixel_samples` sub-pixel positions or one for each.
    fn new(groups: u32, samples: u32, pixel_samples: Option<u32>) -> Self {
        let repeats = pixel_samples.map_or(1, |positions| positions.div_ceil(groups));
        Self { groups, samples, repeats, positions: pixel_samples.filter(|&positions| positions < groups) }
    }
}

/// The groups of each class of pixels, which tile the shutter.
fn exposure(
    strata: Strata,
    interleave: Interleave,
    filter: PixelFilter,
    seed: u64,
    shutter: &Shutter,
    frame: f64,
) -> Vec<Group> {
    let Strata { groups, samples, repeats, positions } = strata;
    let stride = interleave.stride();
    let classes = (0..stride * stride).map(|class| [class % stride, class / stride]);
    let groups = classes.flat_map(|phase| {
        let order = interleave.order(phase);
        let place = (f64::from(order) + 0.5) / f64::from(stride * stride);
        let moments: Vec<TimeSample> = shutter
            .strata(groups * samples, place)
            .into_iter()
            .map(|(t, weight)| TimeSample { time: shutter.frame_time(frame, t), weight: weight / f64::from(repeats) })
            .collect();
        let moments = moments
            .chunks(samples as usize)
            .flat_map(|group| std::iter::repeat_n((group.to_vec(), None), repeats as usize))
            .collect();
        // Each class has offsets of its own.
        with_offsets(moments, positions, filter, seed.wrapping_add(u64::from(order) << 32), phase)
    });
    groups.collect()
}

/// The groups of an interval each, which tile the shutter, and more where something jumps.
fn swept_exposure(
    strata: Strata,
    filter: PixelFilter,
    seed: u64,
    shutter: &Shutter,
    frame: f64,
    jumps: &[f64],
) -> Vec<Group> {
    let Strata { groups: count, repeats, positions, .. } = strata;
    let span = shutter.close - shutter.open;
    let mut cuts: Vec<(f64, bool)> = (0..=count).map(|i| (f64::from(i) / f64::from(count), false)).collect();
    cuts.extend(jumps.iter().map(|&time| ((time - frame - shutter.open) / span, true)));
    cuts.retain(|(t, _)| (0.0..=1.0).contains(t));
    cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A jump at a cut, or two at once, make no interval of their own.
    cuts.dedup_by(|b, a| {
        let same = b.0 - a.0 < 1e-9;
        a.1 |= same && b.1;
        same
    });
    let mut moments: Vec<Moment> = Vec::new();
    for (&(from, from_jump), &(to, to_jump)) in cuts.iter().zip(cuts.iter().skip(1)) {
        let share = |a: f64, b: f64| shutter.weight.integral(a, b) / f64::from(repeats);
        let at = |i: u32| from + (to - from) * f64::from(i) / 32.0;
        let time = |t: f64| shutter.frame_time(frame, t);
        let inside = (1e-6 * (to - from) * span).max(8.0 * f64::EPSILON * time(to).abs());
        let nudge = |jump: bool| if jump { inside } else { 0.0 };
        let ends = [time(from) + nudge(from_jump), time(to) - nudge(to_jump)];
        let sample = TimeSample { time: 0.5 * (ends[0] + ends[1]), weight: share(from, to) };
        let interval = Interval { ends, moments: std::array::from_fn(|i| share(at(i as u32), at(i as u32 + 1))) };
        moments.push((vec![sample], Some(interval)));
    }
    let moments = moments.into_iter().flat_map(|moment| std::iter::repeat_n(moment, repeats as usize)).collect();
    with_offsets(moments, positions, filter, seed, [0, 0])
}

/// The time samples of a group, and the interval that they stand for.
type Moment = (Vec<TimeSample>, Option<Interval>);

/// Groups of `moments`, in order of time, that share out `positions` sub-pixel positions, or have one each.
fn with_offsets(
    moments: Vec<Moment>,
    positions: Option<u32>,
    filter: PixelFilter,
    seed: u64,
    phase: [u32; 2],
) -> Vec<Group> {
    let offsets = match filter {
        PixelFilter::Box => pixel_offsets(positions.unwrap_or(moments.len() as u32), seed),
        PixelFilter::Point => vec![[0.0; 2]],
    };
    share_out(moments, &offsets, phase)
}

/// Groups of `moments`, in order of time: each takes the next of `offsets`, over and over, so that each offset sees the whole exposure.
/// Those of one offset stand together, as they share what lies still.
pub(crate) fn share_out(moments: Vec<Moment>, offsets: &[[f32; 2]], phase: [u32; 2]) -> Vec<Group> {
    let mut groups: Vec<(usize, Group)> = (0..)
        .zip(moments)
        .map(|(i, (samples, interval)): (usize, _)| {
            let position = i % offsets.len().max(1);
            let offset = offsets.get(position).copied().unwrap_or_default();
            (position, Group { samples, offset, phase, interval })
        })
        .collect();
    groups.sort_by_key(|(position, _)| *position);
    groups.into_iter().map(|(_, group)| group).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may stop")]
mod tests;
