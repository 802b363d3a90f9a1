//! The grammar of modes: `NAME[:COUNTS][+OPTION=VALUE]...`.
//!
//! A text is read in two steps. [`ModeParts`] is what the text says, with everything left open that it does not say.
//! [`ModeParts::quality`] fills in the defaults and checks what only the whole can tell. A program may set further
//! parts between the two steps; the options of the command line are such parts.

use std::str::FromStr;

use super::counts::{count, samples_max};
use super::error::list;
use super::words::words;
use super::{
    BlurMode, ErrorTarget, Interleave, KernelShape, KernelWeight, Lattice, Normalise, OptionError, Overlap, Quality,
    SourceSamples, SweptKernel, TemporalAlpha, Times,
};

/// The name of a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModeName {
    /// As many time samples as an error takes.
    Auto,
    /// No motion.
    Still,
    /// Time samples with a visibility test each.
    Supersample,
    /// Buckets of time samples with a visibility test for each bucket.
    Bucket,
    /// Intervals of swept kernels.
    Volumetric,
}

words!(
    ModeName,
    "mode",
    [Auto = "auto", Still = "still", Supersample = "supersample", Bucket = "bucket", Volumetric = "volumetric"]
);

impl ModeName {
    /// The parts that the mode has, by the names of their options; the parts of COUNTS come first.
    pub const fn parts(self) -> &'static [&'static str] {
        match self {
            Self::Auto => &["error", "samples-max", "pixel-samples", "interleave", "white"],
            Self::Still => &["pixel-samples"],
            Self::Supersample => &["samples", "interleave", "times", "pixel-samples"],
            Self::Bucket => &["buckets", "samples", "interleave", "times", "pixel-samples"],
            Self::Volumetric => &[
                "samples",
                "pixel-samples",
                "source-samples",
                "published",
                "kernel",
                "kernel-weight",
                "overlap",
                "alpha",
                "normalise",
            ],
        }
    }

    /// The parts that are written after a `+`.
    fn options(self) -> &'static [&'static str] {
        let counts = if self == Self::Bucket { 2 } else { 1 };
        &self.parts()[counts..]
    }
}

/// What a text says about a mode. `None` and `false`: nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeParts {
    /// The mode.
    pub name: ModeName,
    /// Mode auto: the error ([`ErrorTarget::error`]).
    pub error: Option<f64>,
    /// Mode auto: most time samples.
    pub samples_max: Option<u32>,
    /// Mode auto: the brightest light that is compared ([`ErrorTarget::white`]).
    pub white: Option<f64>,
    /// Mode bucket: number of buckets.
    pub buckets: Option<u32>,
    /// Time samples of supersample, or of each bucket; intervals of volumetric.
    pub samples: Option<u32>,
    /// Modes auto, supersample, bucket: which pixels share their times. The last two choose none by themselves.
    pub interleave: Option<Lattice>,
    /// Modes supersample and bucket: where times lie within the shutter.
    pub times: Option<Times>,
    /// Sub-pixel positions.
    pub pixel_samples: Option<u32>,
    /// Mode volumetric: the volume that a kernel sweeps.
    pub kernel: Option<KernelShape>,
    /// Mode volumetric: the kernel's weight on a ray.
    pub kernel_weight: Option<KernelWeight>,
    /// Mode volumetric: places within a kernel whose visibility is tested.
    pub source_samples: Option<SourceSamples>,
    /// Mode volumetric: how far kernels of neighbouring intervals overlap.
    pub overlap: Option<Overlap>,
    /// Mode volumetric: where temporal alpha comes from.
    pub alpha: Option<TemporalAlpha>,
    /// Mode volumetric: when colours are divided by weights.
    pub normalise: Option<Normalise>,
    /// Mode volumetric: all as published.
    pub published: bool,
}

impl ModeParts {
    /// A mode of which nothing but the name is said.
    pub const fn new(name: ModeName) -> Self {
        Self {
            name,
            error: None,
            samples_max: None,
            white: None,
            buckets: None,
            samples: None,
            interleave: None,
            times: None,
            pixel_samples: None,
            kernel: None,
            kernel_weight: None,
            source_samples: None,
            overlap: None,
            alpha: None,
            normalise: None,
            published: false,
        }
    }

    /// The names of the parts that are said.
    pub fn said(&self) -> Vec<&'static str> {
        let parts = [
            ("error", self.error.is_some()),
            ("samples-max", self.samples_max.is_some()),
            ("white", self.white.is_some()),
            ("buckets", self.buckets.is_some()),
            ("samples", self.samples.is_some()),
            ("interleave", self.interleave.is_some()),
            ("times", self.times.is_some()),
            ("pixel-samples", self.pixel_samples.is_some()),
            ("source-samples", self.source_samples.is_some()),
            ("published", self.published),
            ("kernel", self.kernel.is_some()),
            ("kernel-weight", self.kernel_weight.is_some()),
            ("overlap", self.overlap.is_some()),
            ("alpha", self.alpha.is_some()),
            ("normalise", self.normalise.is_some()),
        ];
        parts.into_iter().filter(|(_, said)| *said).map(|(name, _)| name).collect()
    }

    /// The mode, with defaults for all that is not said: 16 positions of still, 32 samples of supersample, 8 buckets of
    /// 4 samples, 10 intervals of volumetric, and those of [`ErrorTarget`] and [`SweptKernel`].
    ///
    /// # Errors
    /// The mode does not have a part that is said, or two parts do not go together.
    pub fn quality(&self) -> Result<Quality, OptionError> {
        if let Some(part) = self.said().into_iter().find(|part| !self.name.parts().contains(part)) {
            return Err(self.unknown(part, self.name.parts()));
        }
        let times = self.times.unwrap_or_default();
        let mode = match self.name {
            ModeName::Auto => {
                let default = ErrorTarget::default();
                return Ok(Quality::Error(ErrorTarget {
                    error: self.error.unwrap_or(default.error),
                    samples_max: self.samples_max.unwrap_or(default.samples_max),
                    pixel_samples: self.pixel_samples.unwrap_or(default.pixel_samples),
                    interleave: self.interleave.unwrap_or(default.interleave),
                    white: self.white.unwrap_or(default.white),
                }));
            }
            ModeName::Still => BlurMode::Still { pixel_samples: self.pixel_samples.unwrap_or(16) },
            ModeName::Supersample => {
                let (samples, interleave) = (self.samples.unwrap_or(32), self.fixed_interleave()?);
                BlurMode::Supersample { samples, pixel_samples: self.pixel_samples, interleave, times }
            }
            ModeName::Bucket => {
                let (buckets, samples) = (self.buckets.unwrap_or(8), self.samples.unwrap_or(4));
                let interleave = self.fixed_interleave()?;
                if !BlurMode::fits(buckets, samples) {
                    return Err(OptionError::Buckets { buckets, samples });
                }
                BlurMode::Bucket { buckets, samples, pixel_samples: self.pixel_samples, interleave, times }
            }
            ModeName::Volumetric => {
                let intervals = self.samples.unwrap_or(10);
                let swept = self.swept()?;
                BlurMode::Volumetric { intervals, pixel_samples: self.pixel_samples, swept }
            }
        };
        Ok(Quality::Mode(mode))
    }

    /// The lattice of modes that choose none by themselves.
    fn fixed_interleave(&self) -> Result<Interleave, OptionError> {
        match self.interleave {
            None => Ok(Interleave::None),
            Some(Lattice::Fixed(interleave)) => Ok(interleave),
            // In the words of the lattices that there are.
            Some(Lattice::Auto) => Lattice::Auto.to_string().parse().map_err(|what| of_option("interleave", what)),
        }
    }

    fn swept(&self) -> Result<SweptKernel, OptionError> {
        let source_samples = self.source_samples.unwrap_or_default();
        if self.published {
            let complete = ["kernel", "kernel-weight", "overlap", "alpha", "normalise"];
            return match self.said().into_iter().find(|part| complete.contains(part)) {
                Some(option) => Err(OptionError::Published { option }),
                None => Ok(SweptKernel { source_samples, ..SweptKernel::PUBLISHED }),
            };
        }
        let swept = SweptKernel {
            shape: self.kernel.unwrap_or_default(),
            weight: self.kernel_weight.unwrap_or_default(),
            source_samples,
            overlap: self.overlap.unwrap_or_default(),
            alpha: self.alpha.unwrap_or_default(),
            normalise: self.normalise.unwrap_or_default(),
        };
        if swept.weighs_as_its_shape() {
            Ok(swept)
        } else {
            Err(OptionError::OfEllipsoids { weight: swept.weight.word() })
        }
    }

    /// Reads what stands after the colon.
    fn read_counts(&mut self, text: &str) -> Result<(), OptionError> {
        match self.name {
            ModeName::Auto => self.error = Some(ErrorTarget::parse_error(text)?),
            ModeName::Still => self.pixel_samples = Some(count(text)?),
            ModeName::Supersample | ModeName::Volumetric => self.samples = Some(count(text)?),
            ModeName::Bucket => {
                let expected = || OptionError::value("BUCKETSxSAMPLES, as in 8x4", text);
                let (buckets, samples) = text.split_once('x').ok_or_else(expected)?;
                (self.buckets, self.samples) = (Some(count(buckets)?), Some(count(samples)?));
            }
        }
        Ok(())
    }

    /// Reads what stands after a plus: `OPTION=VALUE`, a switch, or a value that alone says its option.
    fn read_option(&mut self, text: &str) -> Result<(), OptionError> {
        let (option, value) = text.split_once('=').map_or((text, None), |(option, value)| (option, Some(value)));
        let (option, value) = match (self.name, option, value) {
            (ModeName::Volumetric, "ellipsoid", None) => ("kernel", Some(option)),
            (ModeName::Volumetric, "chord" | "line", None) => ("kernel-weight", Some(option)),
            (ModeName::Volumetric, "sum", None) => ("alpha", Some(option)),
            (ModeName::Volumetric, "once", None) => ("normalise", Some(option)),
            _ => (option, value),
        };
        if !self.name.options().contains(&option) {
            return Err(self.unknown(option, self.name.options()));
        }
        if self.said().contains(&option) {
            return Err(OptionError::Twice { option: option.to_owned() });
        }
        if option == "published" {
            self.published = true;
            return match value {
                None => Ok(()),
                Some(found) => Err(OptionError::NeedlessValue { option: option.to_owned(), found: found.to_owned() }),
            };
        }
        let value = value.ok_or_else(|| OptionError::NoValue { option: option.to_owned() })?;
        self.read_value(option, value).map_err(|what| of_option(option, what))
    }

    fn read_value(&mut self, option: &str, value: &str) -> Result<(), OptionError> {
        match option {
            "samples-max" => self.samples_max = Some(samples_max(value)?),
            "white" => self.white = Some(ErrorTarget::parse_white(value)?),
            "pixel-samples" => self.pixel_samples = Some(count(value)?),
            "interleave" if self.name == ModeName::Auto => self.interleave = Some(value.parse()?),
            "interleave" => self.interleave = Some(Lattice::Fixed(value.parse()?)),
            "times" => self.times = Some(value.parse()?),
            "source-samples" => self.source_samples = Some(value.parse()?),
            "kernel" => self.kernel = Some(value.parse()?),
            "kernel-weight" => self.kernel_weight = Some(value.parse()?),
            "overlap" => self.overlap = Some(value.parse()?),
            "alpha" => self.alpha = Some(value.parse()?),
            "normalise" => self.normalise = Some(value.parse()?),
            _ => return Err(self.unknown(option, self.name.options())),
        }
        Ok(())
    }

    fn unknown(&self, option: &str, known: &[&str]) -> OptionError {
        OptionError::Unknown { mode: self.name.word(), option: option.to_owned(), known: list(known) }
    }
}

fn of_option(option: &str, what: OptionError) -> OptionError {
    OptionError::OfOption { option: option.to_owned(), what: Box::new(what) }
}

impl FromStr for ModeParts {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        let mut words = text.trim().split('+');
        let head = words.next().unwrap_or_default();
        let (name, counts) = head.split_once(':').map_or((head, None), |(name, counts)| (name, Some(counts)));
        let unknown = |_| OptionError::Mode { found: name.to_owned(), known: ModeName::WORDS.join(", ") };
        let mut parts = Self::new(name.parse().map_err(unknown)?);
        if let Some(counts) = counts {
            parts.read_counts(counts)?;
        }
        for word in words {
            parts.read_option(word)?;
        }
        Ok(parts)
    }
}

impl FromStr for Quality {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        text.parse::<ModeParts>()?.quality()
    }
}

impl FromStr for BlurMode {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        match text.parse()? {
            Quality::Mode(mode) => Ok(mode),
            Quality::Error(_) => {
                let known = ModeName::WORDS.iter().filter(|&&name| name != ModeName::Auto.word());
                let known = known.copied().collect::<Vec<_>>().join(", ");
                Err(OptionError::Mode { found: ModeName::Auto.to_string(), known })
            }
        }
    }
}

impl FromStr for ErrorTarget {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        match format!("{}:{text}", ModeName::Auto).parse()? {
            Quality::Error(target) => Ok(target),
            Quality::Mode(mode) => Err(OptionError::value("an error target", &mode.to_string())),
        }
    }
}

impl FromStr for SweptKernel {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        if !(text.is_empty() || text.starts_with('+')) {
            return Err(OptionError::value("options of swept kernels, as in +kernel=ellipsoid+alpha=sum", text));
        }
        match format!("{}{text}", ModeName::Volumetric).parse::<ModeParts>()?.quality()? {
            Quality::Mode(BlurMode::Volumetric { swept, .. }) => Ok(swept),
            other => Err(OptionError::value("options of swept kernels", &other.to_string())),
        }
    }
}
