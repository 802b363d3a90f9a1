//! How a frame is rendered: options, and the plan that a backend executes.

use std::fmt;

use crate::film::Aov;
use crate::sampling::pixel_offsets;
use crate::time::Shutter;

/// How motion becomes blur.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BlurMode {
    /// No motion: everything at the frame number, averaged over sub-pixel offsets.
    Still {
        /// Sub-pixel positions, >= 1.
        pixel_samples: u32,
    },
    /// Temporal supersampling (thesis 3.6.1, 4.3): one visibility test, one normalisation and one shading per time sample.
    Supersample {
        /// Time samples of a pixel, >= 1.
        samples: u32,
        /// Sub-pixel positions, >= 1: fewer than samples are shared out, more are several for each; `None`: one for each.
        pixel_samples: Option<u32>,
        /// Which pixels share their times.
        interleave: Interleave,
    },
    /// Time bucketing (thesis 3.6.2, 4.4): one visibility test, one normalisation and one shading per bucket, whose samples
    /// contribute their attributes.
    Bucket {
        /// Buckets of a pixel, >= 1.
        buckets: u32,
        /// Time samples of a bucket, >= 1.
        samples: u32,
        /// Sub-pixel positions, >= 1: fewer than buckets are shared out, more are several for each; `None`: one for each.
        pixel_samples: Option<u32>,
        /// Which pixels share their times.
        interleave: Interleave,
    },
    /// Volumetric kernels (thesis 3.6.3, 4.1.2): one visibility test, one normalisation and one shading per interval, over which
    /// each kernel sweeps a volume.
    Volumetric {
        /// Intervals of the shutter, >= 1.
        intervals: u32,
        /// Sub-pixel positions, >= 1: fewer than intervals are shared out, more are several for each; `None`: one for each.
        pixel_samples: Option<u32>,
        /// What kernels sweep, and how they add up.
        swept: SweptKernel,
    },
    /// As many time samples as an error takes, by [`crate::auto`]; a plan of its own has the fewest.
    Auto(Target),
}

/// What mode auto aims at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Largest error of a block of the image: root mean square of the display values, > 0.
    pub error: f64,
    /// Most time samples of a pixel, >= 4.
    pub samples_max: u32,
    /// Sub-pixel positions of the first samples, >= 1; an even number is used.
    pub pixel_samples: u32,
}

impl Target {
    /// For quick looks: FLIP .006 to .008 on fast balls (docs/modes.md).
    pub const DRAFT: f64 = 0.05;
    /// FLIP .004 to .006 there.
    pub const GOOD: f64 = 0.025;
    /// FLIP .004 to .007 there, with half the RMSE of `GOOD`.
    pub const FINAL: f64 = 0.0125;
}

impl Default for Target {
    fn default() -> Self {
        Self { error: Self::GOOD, samples_max: 256, pixel_samples: 8 }
    }
}

/// How volumetric kernels weigh and add up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SweptKernel {
    /// The volume that a kernel sweeps.
    pub shape: KernelShape,
    /// Its weight on a ray.
    pub weight: KernelWeight,
    /// Places on the ray within a kernel whose sources are tested for visibility, >= 1 (thesis eq. C.41).
    pub source_samples: SourceSamples,
    /// Where temporal alpha comes from.
    pub alpha: TemporalAlpha,
    /// When colours are divided by weights.
    pub normalise: Normalise,
}

/// Places on the ray within a kernel whose sources are tested for visibility, >= 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SourceSamples(pub u32);

impl Default for SourceSamples {
    fn default() -> Self {
        Self(1)
    }
}

impl SweptKernel {
    /// As published in the thesis; kernels of neighbouring intervals overlap (fig. 5.2 and 6.1 show what it takes).
    pub const PUBLISHED: Self = Self {
        shape: KernelShape::Ellipsoid,
        weight: KernelWeight::Chord,
        source_samples: SourceSamples(1),
        alpha: TemporalAlpha::Sum,
        normalise: Normalise::Once,
    };

    /// Motion of a kernel over that of its surfel during the interval: 2 in the published variant, whose half-axis is the whole
    /// spacing of the time samples.
    pub fn stretch(self) -> f64 {
        if (Self { source_samples: SourceSamples(1), ..self }) == Self::PUBLISHED { 2.0 } else { 1.0 }
    }
}

/// The volume that a kernel sweeps over an interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KernelShape {
    /// The 2D kernel moved along: equal weight at all times (Heinzle et al. 2010).
    #[default]
    Tube,
    /// 2D Gaussian times a 1D Gaussian along the motion (thesis appendix C).
    Ellipsoid,
}

/// The weight of a kernel on a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KernelWeight {
    /// The integral over time.
    #[default]
    Integral,
    /// By the length of the ray's chord (thesis eq. 4.12); of the ellipsoid only.
    Chord,
}

/// Where temporal alpha comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TemporalAlpha {
    /// The times at which any kernel covers.
    #[default]
    Union,
    /// The sum of all weights, clamped (thesis 4.1.2, fig. 5.3).
    Sum,
}

/// When colours are divided by weights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normalise {
    /// For each interval, before they are added up.
    #[default]
    Interval,
    /// Once, at the end (thesis 4.1.2).
    Once,
}

/// The mode as the command line's mode grammar names it: `still:16`, `supersample:8+interleave=2`, `bucket:8x4`.
impl fmt::Display for BlurMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (interleaved, groups, pixel_samples, swept) = match *self {
            Self::Still { pixel_samples } => return write!(f, "still:{pixel_samples}"),
            Self::Supersample { samples, pixel_samples, interleave } => {
                write!(f, "supersample:{samples}")?;
                (interleave, samples, pixel_samples, None)
            }
            Self::Bucket { buckets, samples, pixel_samples, interleave } => {
                write!(f, "bucket:{buckets}x{samples}")?;
                (interleave, buckets, pixel_samples, None)
            }
            Self::Volumetric { intervals, pixel_samples, swept } => {
                write!(f, "volumetric:{intervals}")?;
                (Interleave::None, intervals, pixel_samples, Some(swept))
            }
            Self::Auto(target) => return write!(f, "auto:{target}"),
        };
        if let Some(positions) = pixel_samples.filter(|&positions| positions != groups) {
            write!(f, "+pixel-samples={positions}")?;
        }
        if interleaved != Interleave::None {
            write!(f, "+interleave={}", interleaved.stride())?;
        }
        swept.map_or(Ok(()), |swept| write!(f, "{swept}"))
    }
}

/// The error, and what differs from the defaults, as in `0.015+samples-max=64`.
impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let default = Self::default();
        write!(f, "{}", self.error)?;
        if self.samples_max != default.samples_max {
            write!(f, "+samples-max={}", self.samples_max)?;
        }
        if self.pixel_samples != default.pixel_samples {
            write!(f, "+pixel-samples={}", self.pixel_samples)?;
        }
        Ok(())
    }
}

/// What differs from the defaults, as in `+kernel=ellipsoid+source-samples=4`; nothing for the defaults.
impl fmt::Display for SweptKernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SourceSamples(source_samples) = self.source_samples;
        if self.stretch() > 1.0 {
            write!(f, "+published")?;
        } else {
            if self.shape == KernelShape::Ellipsoid {
                write!(f, "+kernel=ellipsoid")?;
            }
            if self.weight == KernelWeight::Chord {
                write!(f, "+kernel-weight=chord")?;
            }
            if self.alpha == TemporalAlpha::Sum {
                write!(f, "+alpha=sum")?;
            }
            if self.normalise == Normalise::Once {
                write!(f, "+normalise=once")?;
            }
        }
        if source_samples == 1 { Ok(()) } else { write!(f, "+source-samples={source_samples}") }
    }
}

/// Interleaved time sampling: the pixels of an S x S lattice fall into S^2 classes, each with times of its own, so that
/// neighbouring pixels see different times (design section 5; Keller and Heidrich 2001, for rays).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interleave {
    /// All pixels see the same times.
    #[default]
    None,
    /// A 2 x 2 lattice.
    Two,
    /// A 4 x 4 lattice.
    Four,
}

impl Interleave {
    /// Pixels from one pixel of a class to the next, along both axes: 1, 2 or 4.
    pub const fn stride(self) -> u32 {
        match self {
            Self::None => 1,
            Self::Two => 2,
            Self::Four => 4,
        }
    }

    /// The one with this stride.
    pub const fn with_stride(stride: u32) -> Option<Self> {
        match stride {
            1 => Some(Self::None),
            2 => Some(Self::Two),
            4 => Some(Self::Four),
            _ => None,
        }
    }

    /// Place of the class of pixel `phase` in Bayer order, 0..stride^2: consecutive classes lie far apart.
    pub(crate) fn order(self, phase: [u32; 2]) -> u32 {
        let [x, y] = phase;
        let bits = self.stride().trailing_zeros();
        (0..bits).fold(0, |order, bit| order << 2 | ((x ^ y) >> bit & 1) << 1 | y >> bit & 1)
    }
}

/// How sub-pixel positions are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PixelFilter {
    /// Mean over the pixel's square: each time sample has its own sub-pixel offset.
    #[default]
    Box,
    /// Pixel centres.
    Point,
}

/// Screen-space prefilter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prefilter {
    /// Botsch et al. 2005 (thesis 4.2.3): the smaller of the object-space and the screen-space radius.
    #[default]
    Approx,
    /// Object-space kernels alone.
    None,
}

/// Where shading happens.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// Per pixel, with the averaged normal (deferred; thesis 4.1.1).
    #[default]
    Phong,
    /// Per surfel.
    Gouraud,
}

/// How frames are splatted. Defaults: design section 2.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Blur mode.
    pub mode: BlurMode,
    /// Sub-pixel positions.
    pub filter: PixelFilter,
    /// Screen-space prefilter.
    pub prefilter: Prefilter,
    /// Where shading happens.
    pub shading: Shading,
    /// Show the back faces of all objects, with their normals turned to the viewer.
    pub two_sided: bool,
    /// Depth tolerance for all objects, world units, >= 0; overrides the scene's.
    pub epsilon: Option<f64>,
    /// Seed of the sub-pixel offsets.
    pub seed: u64,
    /// Bytes that a frame and the models may take together.
    pub memory: u64,
    /// Smooth along the motion afterwards?
    pub reconstruct: bool,
    /// Extra channels, in the order of [`Aov::LAYERS`], each at most once.
    pub aovs: Vec<Aov>,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            mode: BlurMode::supersample(32),
            filter: PixelFilter::Box,
            prefilter: Prefilter::Approx,
            shading: Shading::Phong,
            two_sided: false,
            epsilon: None,
            seed: 1,
            memory: 1 << 30,
            reconstruct: false,
            aovs: Vec::new(),
        }
    }
}

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
    /// Plain supersampling with `samples` time samples, >= 1.
    pub const fn supersample(samples: u32) -> Self {
        Self::interleaved(samples, Interleave::None)
    }

    /// Supersampling with `samples` time samples, >= 1, each at its own sub-pixel position.
    pub const fn interleaved(samples: u32, interleave: Interleave) -> Self {
        Self::Supersample { samples, pixel_samples: None, interleave }
    }

    /// What kernels sweep, where they do.
    pub const fn swept(self) -> Option<SweptKernel> {
        match self {
            Self::Volumetric { swept, .. } => Some(swept),
            Self::Still { .. } | Self::Supersample { .. } | Self::Bucket { .. } | Self::Auto(_) => None,
        }
    }

    /// Passes of one group, in order.
    pub const fn passes(self) -> &'static [Pass] {
        use Pass::{Bin, Density, Keep, Project, Sweep, SweptAttribute, SweptResolve, Visibility};
        match self {
            Self::Still { .. } | Self::Supersample { .. } | Self::Bucket { .. } | Self::Auto(_) => &Pass::UNSWEPT,
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
            BlurMode::Auto(_) => return Self::new(BlurMode::supersample(4), filter, seed, shutter, frame, jumps),
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
