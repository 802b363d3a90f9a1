//! What a person chooses: how frames are splatted.

use std::fmt;

use crate::film::Aov;

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
}

/// How good a frame is to be: a blur mode with its samples, or an error for which samples are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quality {
    /// This mode.
    Mode(BlurMode),
    /// As many time samples as this error takes ([`crate::auto`]).
    Error(ErrorTarget),
}

impl Default for Quality {
    fn default() -> Self {
        Self::Error(ErrorTarget::default())
    }
}

impl From<BlurMode> for Quality {
    fn from(mode: BlurMode) -> Self {
        Self::Mode(mode)
    }
}

impl From<ErrorTarget> for Quality {
    fn from(target: ErrorTarget) -> Self {
        Self::Error(target)
    }
}

/// As [`BlurMode`] and [`ErrorTarget`] are written, the latter after `auto:`.
impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mode(mode) => mode.fmt(f),
            Self::Error(target) => write!(f, "auto:{target}"),
        }
    }
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
            Self::Still { .. } | Self::Supersample { .. } | Self::Bucket { .. } => None,
        }
    }
}

/// What mode auto aims at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorTarget {
    /// Largest error of a block of the image: root mean square of the display values, > 0.
    pub error: f64,
    /// Most time samples of a pixel, >= 4.
    pub samples_max: u32,
    /// Sub-pixel positions of the first samples, >= 1; an even number is used.
    pub pixel_samples: u32,
}

impl ErrorTarget {
    /// For quick looks: FLIP .006 to .008 on fast balls (docs/modes.md).
    pub const DRAFT: f64 = 0.05;
    /// FLIP .004 to .006 there.
    pub const GOOD: f64 = 0.025;
    /// FLIP .004 to .007 there, with half the RMSE of `GOOD`.
    pub const FINAL: f64 = 0.0125;
}

impl Default for ErrorTarget {
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

    /// Whether a film is complete only after all intervals: where colours are divided once, or coverage is a sum.
    pub(crate) fn needs_finish(self) -> bool {
        self.normalise == Normalise::Once || self.alpha == TemporalAlpha::Sum
    }

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
impl fmt::Display for ErrorTarget {
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

    /// The first pixel of each class, column and row, row by row.
    pub(crate) fn phases(self) -> impl Iterator<Item = [u32; 2]> {
        let stride = self.stride();
        (0..stride * stride).map(move |class| [class % stride, class / stride])
    }

    /// The seed of the sub-pixel offsets of the class of pixel `phase`: each class has offsets of its own.
    pub(crate) fn seed_of(self, phase: [u32; 2], seed: u64) -> u64 {
        seed.wrapping_add(u64::from(self.order(phase)) << 32)
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
    /// Blur mode, or the error that a mode is to be found for.
    pub quality: Quality,
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
            quality: Quality::default(),
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
