//! The mode grammar of `sheet` and `report`: `NAME[:COUNTS][+OPTION=VALUE]...[@BACKEND]`, as in `bucket:8x4+interleave=2@cpu`.
//!
//! A mode of the plan is one arm of [`blur`]; its [`Display`](fmt::Display) in `plan.rs` is the other direction.

use std::fmt;
use std::str::FromStr;

use splatblur::options::{
    BlurMode, ErrorTarget, KernelShape, KernelWeight, Normalise, Quality, SourceSamples, SweptKernel, TemporalAlpha,
};
use splatblur::reference::SCRAMBLINGS;

use super::grammar;

/// For the long help of commands that take modes.
pub(super) const HELP: &str = "\
Modes, several with commas: NAME[:COUNTS][+OPTION=VALUE]...[@BACKEND]
  still:16                       no motion, P sub-pixel positions
  supersample:10                 N time samples; +pixel-samples=P: at P sub-pixel positions (here and below; N without it), at each
                                 of which what lies still is splatted once
  supersample:8+interleave=2     neighbouring pixels of a 2 x 2 (or 4 x 4) lattice see different times
  bucket:8x4                     B buckets of N time samples; +interleave=S, +pixel-samples=P
  volumetric:10                  N intervals of swept kernels; +kernel=ellipsoid (or +ellipsoid), +kernel-weight=chord (+chord),
                                 +alpha=sum, +normalise=once (+once), +source-samples=K, +pixel-samples=P; +published: all as
                                 in the thesis
  auto:0.025                     as many time samples as the error takes (or auto:draft, auto:good, auto:final); +samples-max=N,
                                 +pixel-samples=P
  reference:1024                 ray-traced, SPP samples of a pixel (a multiple of 16), with another seed than --reference
Counts may be left out; then they are those of `render`. @cpu and @gpu name the machine.";

/// A mode and the machine that renders it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Mode {
    pub(super) method: Method,
    /// `None`: not said.
    pub(super) machine: Option<Machine>,
}

/// How an image is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Method {
    /// By splatting.
    Splat(Quality),
    /// By ray tracing, with so many samples of a pixel.
    Reference(u64),
}

impl Method {
    /// The mode without its counts: `bucket+interleave=2` of `bucket:8x4+interleave=2`.
    pub(super) fn family(self) -> String {
        let text = self.to_string();
        let (name, rest) = text.split_once(':').unwrap_or((&text, ""));
        let options = rest.find('+').map_or("", |at| &rest[at..]);
        format!("{name}{options}")
    }

    /// Samples of a pixel; 0 in mode auto, whose pictures say it themselves.
    pub(super) fn samples(self) -> u64 {
        match self {
            Self::Splat(Quality::Mode(BlurMode::Still { pixel_samples })) => pixel_samples.into(),
            Self::Splat(Quality::Mode(BlurMode::Supersample { samples, .. })) => samples.into(),
            Self::Splat(Quality::Mode(BlurMode::Bucket { buckets, samples, .. })) => {
                u64::from(buckets) * u64::from(samples)
            }
            Self::Splat(Quality::Mode(BlurMode::Volumetric { intervals, .. })) => intervals.into(),
            Self::Splat(Quality::Error(_)) => 0,
            Self::Reference(samples) => samples,
        }
    }
}

/// What renders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Machine {
    Cpu,
    Gpu,
}

impl Machine {
    const ALL: [Self; 2] = [Self::Cpu, Self::Gpu];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Machine {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|machine| machine.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("`{text}` is no backend of this program (there are: {names})")
        })
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Splat(mode) => mode.fmt(f),
            Self::Reference(samples) => write!(f, "reference:{samples}"),
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.method.fmt(f)?;
        self.machine.map_or(Ok(()), |machine| write!(f, "@{machine}"))
    }
}

impl FromStr for Mode {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let (text, machine) = match text.rsplit_once('@') {
            Some((rest, machine)) => (rest, Some(machine.parse()?)),
            None => (text, None),
        };
        let mut parts = text.split('+');
        let head = parts.next().unwrap_or_default();
        let (name, counts) = head.split_once(':').map_or((head, None), |(name, counts)| (name, Some(counts)));
        let mut options = Options::parse(name, parts)?;
        let method = match name {
            "reference" => Method::Reference(reference(counts)?),
            _ => Method::Splat(blur(name, counts, &mut options)?),
        };
        options.finish()?;
        if matches!(method, Method::Reference(_)) && machine.is_some_and(|machine| machine != Machine::Cpu) {
            return Err("the reference is always made on the CPU".to_owned());
        }
        Ok(Self { method, machine })
    }
}

/// The machines of a list with commas, each once.
pub(super) fn machines(text: &str) -> Result<Vec<Machine>, String> {
    let mut machines = Vec::new();
    for part in text.split(',') {
        let machine = part.trim().parse()?;
        if machines.contains(&machine) {
            return Err(format!("backend `{machine}` is there twice"));
        }
        machines.push(machine);
    }
    Ok(machines)
}

/// The modes of a list with commas, each once.
pub(super) fn list(text: &str) -> Result<Vec<Mode>, String> {
    let mut modes: Vec<Mode> = Vec::new();
    for part in text.split(',') {
        let mode: Mode = part.parse().map_err(|what| format!("mode `{}`: {what}", part.trim()))?;
        if modes.contains(&mode) {
            return Err(format!("mode `{mode}` is there twice"));
        }
        modes.push(mode);
    }
    Ok(modes)
}

/// A mode of the plan.
fn blur(name: &str, counts: Option<&str>, options: &mut Options<'_>) -> Result<Quality, String> {
    let samples = |default| counts.map_or(Ok(default), grammar::samples);
    match name {
        "still" => Ok(Quality::Mode(BlurMode::Still { pixel_samples: samples(16)? })),
        "supersample" => {
            let interleave = options.take("interleave", grammar::interleave)?.unwrap_or_default();
            let samples = samples(32)?;
            let pixel_samples = options.pixel_samples(samples)?;
            Ok(Quality::Mode(BlurMode::Supersample { samples, pixel_samples, interleave }))
        }
        "bucket" => {
            let (buckets, samples) = counts.map_or(Ok((8, 4)), grid)?;
            let interleave = options.take("interleave", grammar::interleave)?.unwrap_or_default();
            let pixel_samples = options.pixel_samples(buckets)?;
            Ok(Quality::Mode(BlurMode::Bucket { buckets, samples, pixel_samples, interleave }))
        }
        "volumetric" => {
            let intervals = samples(10)?;
            Ok(Quality::Mode(BlurMode::Volumetric {
                intervals,
                pixel_samples: options.pixel_samples(intervals)?,
                swept: swept(options)?,
            }))
        }
        "auto" => {
            let default = ErrorTarget::default();
            Ok(Quality::Error(ErrorTarget {
                error: counts.map_or(Ok(default.error), grammar::error)?,
                samples_max: options.take("samples-max", grammar::samples_max)?.unwrap_or(default.samples_max),
                pixel_samples: options.take("pixel-samples", grammar::samples)?.unwrap_or(default.pixel_samples),
            }))
        }
        _ => Err(format!(
            "there is no mode `{name}` (there are: auto, still, supersample, bucket, volumetric, reference)"
        )),
    }
}

/// The options of mode volumetric.
fn swept(options: &mut Options<'_>) -> Result<SweptKernel, String> {
    let source_samples = SourceSamples(options.take("source-samples", grammar::samples)?.unwrap_or(1));
    if options.switch("published")? {
        return Ok(SweptKernel { source_samples, ..SweptKernel::PUBLISHED });
    }
    let shapes = [("tube", KernelShape::Tube), ("ellipsoid", KernelShape::Ellipsoid)];
    let weights = [("integral", KernelWeight::Integral), ("chord", KernelWeight::Chord)];
    let alphas = [("union", TemporalAlpha::Union), ("sum", TemporalAlpha::Sum)];
    let divisions = [("interval", Normalise::Interval), ("once", Normalise::Once)];
    let swept = SweptKernel {
        shape: options.choice("kernel", &shapes)?,
        weight: options.choice("kernel-weight", &weights)?,
        source_samples,
        alpha: options.choice("alpha", &alphas)?,
        normalise: options.choice("normalise", &divisions)?,
    };
    if swept.weight == KernelWeight::Chord && swept.shape == KernelShape::Tube {
        return Err("kernel-weight=chord is the length within an ellipsoid: it needs kernel=ellipsoid".to_owned());
    }
    Ok(swept)
}

/// `BxN`: buckets of time samples.
fn grid(text: &str) -> Result<(u32, u32), String> {
    let (buckets, samples) = text.split_once('x').ok_or("expected BUCKETSxSAMPLES, as in 8x4")?;
    let (buckets, samples) = (grammar::samples(buckets)?, grammar::samples(samples)?);
    if u64::from(buckets) * u64::from(samples) > u64::from(grammar::MAX_SAMPLES) {
        return Err(format!("{buckets} buckets of {samples} samples: at most {} in all", grammar::MAX_SAMPLES));
    }
    Ok((buckets, samples))
}

/// Samples of a reference.
pub(super) fn reference_samples(text: &str) -> Result<u64, String> {
    let step = SCRAMBLINGS as u64;
    let expected = || format!("expected a multiple of {step}, up to 1048576");
    let samples = text.trim().parse().map_err(|_| expected())?;
    if samples > 0 && samples <= 1 << 20 && u64::is_multiple_of(samples, step) { Ok(samples) } else { Err(expected()) }
}

fn reference(counts: Option<&str>) -> Result<u64, String> {
    counts.map_or(Ok(1024), reference_samples)
}

/// What follows the counts: `+NAME=VALUE`, or `+NAME` for switches.
struct Options<'a> {
    mode: &'a str,
    given: Vec<(&'a str, Option<&'a str>)>,
    known: Vec<&'static str>,
}

impl<'a> Options<'a> {
    fn parse(mode: &'a str, parts: impl Iterator<Item = &'a str>) -> Result<Self, String> {
        let mut given: Vec<(&str, Option<&str>)> = Vec::new();
        for part in parts {
            let (name, value) = part.split_once('=').map_or((part, None), |(name, value)| (name, Some(value)));
            if given.iter().any(|(other, _)| *other == name) {
                return Err(format!("option `{name}` is there twice"));
            }
            given.push((name, value));
        }
        Ok(Self { mode, given, known: Vec::new() })
    }

    /// The value of option `name`, where it is given.
    fn take<T>(&mut self, name: &'static str, parse: fn(&str) -> Result<T, String>) -> Result<Option<T>, String> {
        self.known.push(name);
        let Some(at) = self.given.iter().position(|(given, _)| *given == name) else { return Ok(None) };
        let (_, value) = self.given.remove(at);
        let value = value.ok_or_else(|| format!("option `{name}` needs a value: +{name}=..."))?;
        parse(value).map(Some).map_err(|what| format!("option `{name}`: {what}"))
    }

    /// Whether the switch `name` is given.
    fn switch(&mut self, name: &'static str) -> Result<bool, String> {
        self.known.push(name);
        let Some(at) = self.given.iter().position(|(given, _)| *given == name) else { return Ok(false) };
        match self.given.remove(at).1 {
            None => Ok(true),
            Some(value) => Err(format!("option `{name}` takes no value, found `{value}`")),
        }
    }

    /// One of some words, the first by default; `+word` is short for `+name=word` of all but the first.
    fn choice<T: Copy>(&mut self, name: &'static str, words: &[(&'static str, T)]) -> Result<T, String> {
        let given = self.take(name, |word| Ok(word.to_owned()))?;
        let mut found = None;
        for (i, &(word, value)) in words.iter().enumerate() {
            let short = i > 0 && self.switch(word)?;
            if short && given.is_some() {
                return Err(format!("option `{name}` is there twice"));
            }
            if short || given.as_deref().map_or(i == 0, |given| given == word) {
                found = Some(value);
            }
        }
        let list = || words.iter().map(|(word, _)| *word).collect::<Vec<_>>().join(", ");
        found.ok_or_else(|| format!("option `{name}`: expected one of {}", list()))
    }

    /// `pixel-samples`; as many as groups of time samples is what there is without.
    fn pixel_samples(&mut self, groups: u32) -> Result<Option<u32>, String> {
        Ok(self.take("pixel-samples", grammar::samples)?.filter(|&positions| positions != groups))
    }

    /// Refuses what no one took.
    fn finish(&self) -> Result<(), String> {
        let Some((name, _)) = self.given.first() else { return Ok(()) };
        let known = if self.known.is_empty() { "nothing".to_owned() } else { self.known.join(", ") };
        Err(format!("mode {} has no option `{name}` (it takes: {known})", self.mode))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use splatblur::options::Interleave;

    use super::*;

    fn mode(text: &str) -> Mode {
        text.parse().unwrap()
    }

    #[test]
    fn modes_are_read() {
        fn splat(mode: impl Into<Quality>) -> Mode {
            Mode { method: Method::Splat(mode.into()), machine: None }
        }
        assert_eq!(mode("still"), splat(BlurMode::Still { pixel_samples: 16 }));
        let interleave = Interleave::None;
        assert_eq!(mode("supersample"), splat(BlurMode::supersample(32)));
        let two = BlurMode::interleaved(8, Interleave::Two);
        assert_eq!(mode(" supersample:8+interleave=2 "), splat(two));
        assert_eq!(
            mode("supersample:8+interleave=2@cpu"),
            Mode { method: Method::Splat(two.into()), machine: Some(Machine::Cpu) }
        );
        let bucket = |pixel_samples| BlurMode::Bucket { buckets: 8, samples: 4, pixel_samples, interleave };
        assert_eq!(mode("bucket"), splat(bucket(None)));
        assert_eq!(mode("bucket:8x4"), splat(bucket(None)));
        assert_eq!(mode("bucket:8x4+pixel-samples=12"), splat(bucket(Some(12))));
        let volumetric = |swept| splat(BlurMode::Volumetric { intervals: 3, pixel_samples: None, swept });
        assert_eq!(mode("volumetric:3"), volumetric(SweptKernel::default()));
        assert_eq!(mode("volumetric:3+published"), volumetric(SweptKernel::PUBLISHED));
        let kernel = SweptKernel {
            shape: KernelShape::Ellipsoid,
            alpha: TemporalAlpha::Sum,
            normalise: Normalise::Once,
            ..SweptKernel::default()
        };
        assert_eq!(mode("volumetric:3+ellipsoid+once+alpha=sum"), volumetric(kernel));
        assert_eq!(mode("volumetric:3+kernel=ellipsoid+normalise=once+sum"), volumetric(kernel));
        assert_eq!(mode("auto"), splat(Quality::Error(ErrorTarget::default())));
        let target = ErrorTarget { error: ErrorTarget::DRAFT, samples_max: 64, pixel_samples: 4 };
        assert_eq!(mode("auto:draft+samples-max=64+pixel-samples=4"), splat(Quality::Error(target)));
        assert_eq!(
            mode(&mode("auto:draft+samples-max=64+pixel-samples=4").to_string()).method,
            Method::Splat(Quality::Error(target))
        );
        assert_eq!(mode("reference:64").method, Method::Reference(64));
        assert_eq!(mode("bucket:8x4").method.samples(), 32);
        assert_eq!(mode("bucket:8x4+interleave=2@cpu").method.family(), "bucket+interleave=2");
        assert_eq!(mode("still").method.family(), "still");
        assert_eq!(machines("cpu"), Ok(vec![Machine::Cpu]));
        assert_eq!(machines("cpu, gpu"), Ok(vec![Machine::Cpu, Machine::Gpu]));
        assert!(machines("cpu,cpu").is_err() && machines("").is_err());
    }

    #[test]
    fn equal_modes_are_written_alike() {
        assert_eq!(mode("supersample").to_string(), "supersample:32");
        assert_eq!(mode("supersample:8+interleave=1").to_string(), "supersample:8");
        assert_eq!(mode("supersample:8+pixel-samples=8").to_string(), "supersample:8");
        assert_eq!(mode("volumetric:3+sum+pixel-samples=2").to_string(), "volumetric:3+pixel-samples=2+alpha=sum");
        assert_eq!(
            mode("supersample:8+interleave=2+pixel-samples=4").to_string(),
            "supersample:8+pixel-samples=4+interleave=2"
        );
        assert_eq!(mode("bucket:8x4+pixel-samples=8").to_string(), "bucket:8x4");
        assert_eq!(mode("reference@cpu").to_string(), "reference:1024@cpu");
    }

    #[test]
    fn mistakes_are_explained() {
        for (text, hint) in [
            ("", "there are: auto, still, supersample, bucket, volumetric, reference"),
            ("super:8", "there is no mode `super`"),
            ("supersample:0", "1 to 65536"),
            ("supersample:", "1 to 65536"),
            ("supersample:8x4", "1 to 65536"),
            ("supersample:8+interleave", "needs a value"),
            ("supersample:8+interleave=3", "expected 1, 2 or 4"),
            ("supersample:8+interleave=2+interleave=2", "twice"),
            ("supersample:8+once", "it takes: interleave, pixel-samples"),
            ("supersample:8+pixel-samples=0", "1 to 65536"),
            ("still:4+interleave=2", "it takes: nothing"),
            ("bucket:8", "BUCKETSxSAMPLES"),
            ("bucket:8x4x2", "1 to 65536"),
            ("bucket:65536x65536", "at most 65536 in all"),
            ("volumetric:3+published+once", "has no option `once`"),
            ("volumetric:3+published=1", "takes no value"),
            ("volumetric:3+kernel=ball", "one of tube, ellipsoid"),
            ("volumetric:3+kernel=tube+ellipsoid", "twice"),
            ("volumetric:3+chord", "needs kernel=ellipsoid"),
            ("volumetric:3+tube", "it takes: "),
            ("volumetric:3+alpha", "needs a value"),
            ("volumetric:3+interleave=2", "has no option"),
            ("auto:0", "draft, good, final"),
            ("auto:best", "draft, good, final"),
            ("auto:0.1+samples-max=3", "4 to 65536"),
            ("auto:0.1+interleave=2", "it takes: samples-max, pixel-samples"),
            ("reference:100", "a multiple of 16"),
            ("reference:0", "a multiple of 16"),
            ("reference:99999999999999999999", "a multiple of 16"),
            ("still@tpu", "`tpu` is no backend"),
            ("still@", "is no backend"),
            ("reference:16@gpu", "always made on the CPU"),
        ] {
            let error = text.parse::<Mode>().unwrap_err();
            assert!(error.contains(hint), "{text}: {error}");
        }
        assert!(list("still,supersample:4").is_ok());
        assert!(list("supersample,supersample:32").unwrap_err().contains("twice"));
        assert!(list("still,,bucket").unwrap_err().starts_with("mode ``"));
    }

    fn any_mode() -> impl Strategy<Value = Mode> {
        let interleave = prop::sample::select(vec![Interleave::None, Interleave::Two, Interleave::Four]);
        let count = 1_u32..=256;
        let method = prop_oneof![
            count.clone().prop_map(|pixel_samples| Method::Splat(BlurMode::Still { pixel_samples }.into())),
            (count.clone(), count.clone(), interleave.clone()).prop_map(|(samples, pixel, interleave)| {
                let pixel_samples = Some(pixel).filter(|&pixel| pixel != samples);
                Method::Splat(BlurMode::Supersample { samples, pixel_samples, interleave }.into())
            }),
            (count.clone(), count.clone(), count, interleave).prop_map(|(buckets, samples, pixel, interleave)| {
                let pixel_samples = Some(pixel).filter(|&pixel| pixel != buckets);
                Method::Splat(BlurMode::Bucket { buckets, samples, pixel_samples, interleave }.into())
            }),
            (1_u32..=256, 1_u32..=256, 0_u32..32, 1_u32..9).prop_map(|(intervals, pixel, bits, source)| {
                let pixel_samples = Some(pixel).filter(|&pixel| pixel != intervals);
                let bit = |i: u32| bits >> i & 1 == 1;
                let shape = if bit(0) { KernelShape::Ellipsoid } else { KernelShape::Tube };
                let chord = bit(0) && bit(1);
                let swept = SweptKernel {
                    shape,
                    weight: if chord { KernelWeight::Chord } else { KernelWeight::Integral },
                    source_samples: SourceSamples(source),
                    alpha: if bit(2) { TemporalAlpha::Sum } else { TemporalAlpha::Union },
                    normalise: if bit(3) { Normalise::Once } else { Normalise::Interval },
                };
                Method::Splat(BlurMode::Volumetric { intervals, pixel_samples, swept }.into())
            }),
            (1_u64..=65_536).prop_map(|n| Method::Reference(16 * n)),
        ];
        (method, prop::sample::select(vec![None, Some(Machine::Cpu)]))
            .prop_map(|(method, machine)| Mode { method, machine })
    }

    proptest! {
        /// What is written is read as the same.
        #[test]
        fn modes_read_back(modes in prop::collection::vec(any_mode(), 1..4)) {
            let text = modes.iter().map(Mode::to_string).collect::<Vec<_>>();
            for (mode, text) in modes.iter().zip(&text) {
                let read = text.parse::<Mode>();
                prop_assert_eq!(read.as_ref(), Ok(mode));
            }
        }

        /// Any text is a mode or a sentence.
        #[test]
        fn any_text(text in "[a-z:+=@x0-9,.-]{0,24}|(still|supersample|bucket|volumetric|reference)[:+=@x0-9a-z,-]{0,16}") {
            if let Ok(modes) = list(&text) {
                let written = modes.iter().map(Mode::to_string).collect::<Vec<_>>().join(",");
                prop_assert_eq!(list(&written), Ok(modes));
            }
        }
    }
}
