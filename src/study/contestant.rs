//! Who takes part in a study: modes, the reference among them, each with its choices and on a backend. As text:
//! `MODE[+filter=FILTER][+prefilter=PREFILTER][+detail=DETAIL][@BACKEND]`.
//!
//! The modes of splatting are those of [`crate::options`]; `reference:SPP` is a mode of studies only.

use std::fmt;
use std::str::FromStr;

use crate::options::{BlurMode, Detail, ModeName, OptionError, PixelFilter, Prefilter, Quality, words};
use crate::reference::SCRAMBLINGS;

/// Samples of a pixel of a reference of which the text says nothing more.
const REFERENCE_SAMPLES: u64 = 1024;

/// Most samples of a pixel of a reference in a study.
const MOST_REFERENCE_SAMPLES: u64 = 1 << 20;

/// Why a text names no contestant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ContestantError {
    /// It is neither a mode of splatting nor a reference, or names no backend.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Not a number of samples of a reference.
    #[error("expected a multiple of {SCRAMBLINGS}, up to {MOST_REFERENCE_SAMPLES}, found `{found}`")]
    ReferenceSamples {
        /// The text.
        found: String,
    },
    /// References are traced on the CPU.
    #[error("the reference is always made on the CPU")]
    ReferenceBackend,
    /// References have no prefilter, and show all detail.
    #[error("the reference has no {choice} (it takes: filter)")]
    ReferenceChoice {
        /// What it has not.
        choice: &'static str,
    },
    /// Something is wrong in one of a list.
    #[error("mode `{mode}`: {what}")]
    InList {
        /// The text of the one.
        mode: String,
        /// The fault.
        what: Box<Self>,
    },
    /// One is there twice.
    #[error("{what} `{name}` is there twice")]
    Twice {
        /// A mode or a backend.
        what: &'static str,
        /// Its name.
        name: String,
    },
}

/// What renders: the two kinds of backends, whose pictures differ by rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BackendKind {
    /// The processor.
    Cpu,
    /// A graphics adapter.
    Gpu,
}

words!(BackendKind, "backend of this program", [Cpu = "cpu", Gpu = "gpu"]);

/// How a picture is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// By splatting.
    Splat(Quality),
    /// By ray tracing, with so many samples of a pixel: a multiple of 16, up to 2^20.
    Reference(u64),
}

impl Method {
    /// The mode without its counts: `bucket+interleave=2` of `bucket:8x4+interleave=2`.
    pub fn family(self) -> String {
        let text = self.to_string();
        let (name, rest) = text.split_once(':').unwrap_or((&text, ""));
        let options = rest.find('+').map_or("", |at| &rest[at..]);
        format!("{name}{options}")
    }

    /// Samples of a pixel; 0 in mode auto, whose pictures say it themselves.
    pub fn samples(self) -> u64 {
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

    /// True of references.
    pub fn is_traced(self) -> bool {
        matches!(self, Self::Reference(_))
    }
}

/// As [`Quality`] is written; references as `reference:1024`.
impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Splat(quality) => quality.fmt(f),
            Self::Reference(samples) => write!(f, "reference:{samples}"),
        }
    }
}

impl FromStr for Method {
    type Err = ContestantError;

    fn from_str(text: &str) -> Result<Self, ContestantError> {
        let (name, rest) = text.split_at(text.find([':', '+']).unwrap_or(text.len()));
        if name == "reference" {
            return match (rest.split_once('+'), rest.strip_prefix(':')) {
                (Some((_, option)), _) => {
                    let option = option.split(['=', '+']).next().unwrap_or_default().to_owned();
                    let known = "nothing".to_owned();
                    Err(OptionError::Unknown { mode: "reference", option, known }.into())
                }
                (None, Some(counts)) => reference_samples(counts).map(Self::Reference),
                (None, None) => Ok(Self::Reference(REFERENCE_SAMPLES)),
            };
        }
        match text.parse() {
            Ok(quality) => Ok(Self::Splat(quality)),
            Err(OptionError::Mode { found, .. }) => {
                let known = format!("{}, reference", ModeName::WORDS.join(", "));
                Err(OptionError::Mode { found, known }.into())
            }
            Err(other) => Err(other.into()),
        }
    }
}

/// Samples of a reference: a multiple of 16, up to 2^20.
///
/// # Errors
/// The text is no such number.
pub fn reference_samples(text: &str) -> Result<u64, ContestantError> {
    let fits =
        |samples: &u64| (1..=MOST_REFERENCE_SAMPLES).contains(samples) && samples.is_multiple_of(SCRAMBLINGS as u64);
    let samples = text.trim().parse().ok().filter(fits);
    samples.ok_or_else(|| ContestantError::ReferenceSamples { found: text.to_owned() })
}

/// What a mode asks for beside its own parts; `None`: as it is for all modes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choices {
    /// What a pixel is a mean of. The mode is compared with the reference that has the same.
    pub filter: Option<PixelFilter>,
    /// Screen-space prefilter; of splatting only.
    pub prefilter: Option<Prefilter>,
    /// How fine the surfels are that show; of splatting only.
    pub detail: Option<Detail>,
}

impl Choices {
    /// Those that `text` asks for, and the text without them.
    ///
    /// # Errors
    /// One has no such value, or is there twice.
    pub fn split(text: &str) -> Result<(Self, String), ContestantError> {
        let mut choices = Self::default();
        let mut rest: Vec<&str> = Vec::new();
        let mut seen: Vec<&str> = Vec::new();
        for part in text.split('+') {
            match part.split_once('=') {
                Some((name @ "filter", value)) => {
                    seen.push(name);
                    choices.filter = Some(value.parse()?);
                }
                Some((name @ "prefilter", value)) => {
                    seen.push(name);
                    choices.prefilter = Some(value.parse()?);
                }
                Some((name @ "detail", value)) => {
                    seen.push(name);
                    choices.detail = Some(value.parse()?);
                }
                _ => rest.push(part),
            }
        }
        match seen.iter().find(|&name| seen.iter().filter(|&other| other == name).count() > 1) {
            Some(name) => Err(OptionError::Twice { option: (*name).to_owned() }.into()),
            None => Ok((choices, rest.join("+"))),
        }
    }
}

/// As in `+filter=gaussian:1+prefilter=ewa+detail=full`; nothing where nothing is asked for.
impl fmt::Display for Choices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.filter.map_or(Ok(()), |filter| write!(f, "+filter={filter}"))?;
        self.prefilter.map_or(Ok(()), |prefilter| write!(f, "+prefilter={prefilter}"))?;
        self.detail.map_or(Ok(()), |detail| write!(f, "+detail={detail}"))
    }
}

/// One of a list of modes: a method and, perhaps, the choices and the backend that it asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// How the picture is made.
    pub method: Method,
    /// With which choices.
    pub choices: Choices,
    /// `None`: not said.
    pub backend: Option<BackendKind>,
}

/// As in `bucket:8x4+interleave=2+prefilter=ewa@cpu`.
impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.method.fmt(f)?;
        self.choices.fmt(f)?;
        self.backend.map_or(Ok(()), |backend| write!(f, "@{backend}"))
    }
}

impl FromStr for Entry {
    type Err = ContestantError;

    fn from_str(text: &str) -> Result<Self, ContestantError> {
        let text = text.trim();
        let (text, backend) = match text.rsplit_once('@') {
            Some((rest, backend)) => (rest, Some(backend.parse()?)),
            None => (text, None),
        };
        let (choices, text) = Choices::split(text)?;
        let method: Method = text.parse()?;
        if method.is_traced() && backend.is_some_and(|backend| backend != BackendKind::Cpu) {
            return Err(ContestantError::ReferenceBackend);
        }
        let has_not = match choices {
            Choices { prefilter: Some(_), .. } => Some("prefilter"),
            Choices { detail: Some(_), .. } => Some("detail"),
            _ => None,
        };
        if let (true, Some(choice)) = (method.is_traced(), has_not) {
            return Err(ContestantError::ReferenceChoice { choice });
        }
        Ok(Self { method, choices, backend })
    }
}

/// The entries of a list with commas, each once.
///
/// # Errors
/// One cannot be read, or is there twice.
pub fn entries(text: &str) -> Result<Vec<Entry>, ContestantError> {
    let mut entries: Vec<Entry> = Vec::new();
    for part in text.split(',') {
        let in_list = |what| ContestantError::InList { mode: part.trim().to_owned(), what: Box::new(what) };
        let entry: Entry = part.parse().map_err(in_list)?;
        if entries.contains(&entry) {
            return Err(ContestantError::Twice { what: "mode", name: entry.to_string() });
        }
        entries.push(entry);
    }
    Ok(entries)
}

/// The backends of a list with commas, each once.
///
/// # Errors
/// One is unknown, or is there twice.
pub fn backends(text: &str) -> Result<Vec<BackendKind>, ContestantError> {
    let mut backends: Vec<BackendKind> = Vec::new();
    for part in text.split(',') {
        let backend = part.trim().parse()?;
        if backends.contains(&backend) {
            return Err(ContestantError::Twice { what: "backend", name: backend.to_string() });
        }
        backends.push(backend);
    }
    Ok(backends)
}

/// A method with its choices on a backend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contestant {
    /// How the picture is made.
    pub method: Method,
    /// With which choices.
    pub choices: Choices,
    /// What makes it.
    pub backend: BackendKind,
}

impl Contestant {
    /// The contestants of a list: entries without a backend take part on each of `backends`, references on the CPU.
    ///
    /// # Errors
    /// One is there twice.
    pub fn of(entries: &[Entry], backends: &[BackendKind]) -> Result<Vec<Self>, ContestantError> {
        let mut contestants: Vec<Self> = Vec::new();
        for entry in entries {
            let of_entry = match (entry.backend, entry.method) {
                (Some(backend), _) => vec![backend],
                (None, Method::Reference(_)) => vec![BackendKind::Cpu],
                (None, Method::Splat(_)) => backends.to_vec(),
            };
            for backend in of_entry {
                let contestant = Self { method: entry.method, choices: entry.choices, backend };
                if contestants.contains(&contestant) {
                    return Err(ContestantError::Twice { what: "mode", name: contestant.to_string() });
                }
                contestants.push(contestant);
            }
        }
        Ok(contestants)
    }

    /// The contestant without its backend.
    pub fn mode(&self) -> String {
        format!("{}{}", self.method, self.choices)
    }

    /// The mode without its counts, as [`Method::family`] has it.
    pub fn family(&self) -> String {
        format!("{}{}", self.method.family(), self.choices)
    }
}

/// As in `supersample:8+prefilter=ewa@cpu`.
impl fmt::Display for Contestant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{}", self.mode(), self.backend)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::options::{Interleave, tests::any_quality};

    fn entry(text: &str) -> Entry {
        text.parse().unwrap()
    }

    #[test]
    fn entries_are_read() {
        let two = Method::Splat(BlurMode::interleaved(8, Interleave::Two).into());
        let choices = Choices::default();
        assert_eq!(entry(" supersample:8+interleave=2 "), Entry { method: two, choices, backend: None });
        let cpu = Some(BackendKind::Cpu);
        assert_eq!(entry("supersample:8+interleave=2@cpu"), Entry { method: two, choices, backend: cpu });
        let choices = Choices {
            filter: Some(PixelFilter::Gaussian { sigma: 0.5 }),
            prefilter: Some(Prefilter::Ewa),
            detail: Some(Detail::Full),
        };
        let text = "supersample:8+interleave=2+filter=gaussian:0.5+prefilter=ewa+detail=full@cpu";
        assert_eq!(entry(text), Entry { method: two, choices, backend: cpu });
        assert_eq!(entry(text).to_string(), text);
        assert_eq!(entry("supersample:8+prefilter=ewa+interleave=2+detail=full+filter=gaussian:0.5@cpu"), entry(text));
        assert_eq!(entry("reference:64+filter=gaussian").to_string(), "reference:64+filter=gaussian:1");
        assert_eq!(entry("reference:64").method, Method::Reference(64));
        assert_eq!(entry("reference@cpu").to_string(), "reference:1024@cpu");
        assert_eq!(entry("bucket:8x4").method.samples(), 32);
        assert_eq!(entry("bucket:8x4+interleave=2@cpu").method.family(), "bucket+interleave=2");
        assert_eq!(entry("still").method.family(), "still");
        assert_eq!(backends("cpu"), Ok(vec![BackendKind::Cpu]));
        assert_eq!(backends("cpu, gpu"), Ok(vec![BackendKind::Cpu, BackendKind::Gpu]));
        assert!(backends("cpu,cpu").is_err() && backends("").is_err());
    }

    #[test]
    fn mistakes_are_explained() {
        for (text, hint) in [
            ("", "there are: auto, still, supersample, bucket, volumetric, reference"),
            ("super:8", "there is no mode `super`"),
            ("supersample:0", "1 to 65536"),
            ("reference:100", "a multiple of 16"),
            ("reference:0", "a multiple of 16"),
            ("reference:", "a multiple of 16"),
            ("reference:99999999999999999999", "a multiple of 16"),
            ("reference:16+interleave=2", "reference has no option `interleave` (it takes: nothing)"),
            ("still@tpu", "`tpu` is no backend"),
            ("still@", "is no backend"),
            ("reference:16@gpu", "always made on the CPU"),
            ("reference:16+prefilter=ewa", "has no prefilter"),
            ("reference:16+detail=good", "has no detail"),
            ("still+detail=fine", "`fine` is no detail"),
            ("still+detail=good+detail=full", "`detail`"),
            ("still+filter=tent", "`tent` is no pixel filter (there are: box, point, gaussian[:SIGMA])"),
            ("still+filter=gaussian:9", "0.25 to 4 pixels"),
            ("still+filter=box+filter=point", "`filter`"),
        ] {
            let error = text.parse::<Entry>().unwrap_err().to_string();
            assert!(error.contains(hint), "{text}: {error}");
        }
        assert!(entries("still,supersample:4").is_ok());
        let said = |text: &str| entries(text).unwrap_err().to_string();
        assert!(said("supersample,supersample:32").contains("mode `supersample:32` is there twice"));
        assert!(said("still,,bucket").starts_with("mode ``: there is no mode ``"));
    }

    #[test]
    fn entries_meet_backends() {
        let both = [BackendKind::Cpu, BackendKind::Gpu];
        let names = |text: &str| -> Result<Vec<String>, ContestantError> {
            Ok(Contestant::of(&entries(text)?, &both)?.iter().map(Contestant::to_string).collect())
        };
        assert_eq!(names("still:1,reference:16").unwrap(), ["still:1@cpu", "still:1@gpu", "reference:16@cpu"]);
        assert_eq!(names("still:1@gpu").unwrap(), ["still:1@gpu"]);
        assert!(names("still:1,still:1@cpu").unwrap_err().to_string().contains("`still:1@cpu` is there twice"));
    }

    fn any_entry() -> impl Strategy<Value = Entry> {
        let method = prop_oneof![
            any_quality().prop_map(Method::Splat),
            (1_u64..=65_536).prop_map(|n| Method::Reference(16 * n)),
        ];
        let filter = prop_oneof![
            Just(None),
            Just(Some(PixelFilter::Point)),
            (0.25..4.0).prop_map(|sigma| Some(PixelFilter::Gaussian { sigma })),
        ];
        let prefilter = prop::sample::select(vec![None, Some(Prefilter::Approx), Some(Prefilter::Ewa)]);
        let backend = prop::sample::select(vec![None, Some(BackendKind::Cpu)]);
        let detail = prop::sample::select(vec![None, Some(Detail::Auto), Some(Detail::Full)]);
        (method, filter, prefilter, detail, backend).prop_map(|(method, filter, prefilter, detail, backend)| {
            let (prefilter, detail) = if method.is_traced() { (None, None) } else { (prefilter, detail) };
            Entry { method, choices: Choices { filter, prefilter, detail }, backend }
        })
    }

    proptest! {
        /// A written entry is read as the same.
        #[test]
        fn entries_read_back(entry in any_entry()) {
            prop_assert_eq!(entry.to_string().parse::<Entry>(), Ok(entry));
        }

        /// Any text is a list of entries or a sentence.
        #[test]
        fn any_text(
            text in "[a-z:+=@x0-9,.-]{0,24}|(still|supersample|bucket|volumetric|reference)[:+=@x0-9a-z,-]{0,16}",
        ) {
            if let Ok(list) = entries(&text) {
                let written = list.iter().map(Entry::to_string).collect::<Vec<_>>().join(",");
                prop_assert_eq!(entries(&written), Ok(list));
            }
        }
    }
}
