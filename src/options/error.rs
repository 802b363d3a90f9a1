//! Why a text is no option.

use super::MAX_SAMPLES;

/// Why a text does not say a mode or an option: what was found, and what would be right.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionError {
    /// A word that is none of the known ones.
    #[error("`{found}` is no {what} (there are: {known})")]
    Word {
        /// What the word should name.
        what: &'static str,
        /// The word.
        found: String,
        /// The words that there are.
        known: String,
    },
    /// A mode that does not exist.
    #[error("there is no mode `{found}` (there are: {known})")]
    Mode {
        /// Its name.
        found: String,
        /// The names that there are.
        known: String,
    },
    /// A value that cannot be read, or is out of its range.
    #[error("expected {expected}, found `{found}`")]
    Value {
        /// The text that would be right.
        expected: String,
        /// The text.
        found: String,
    },
    /// The value of an option of a mode.
    #[error("option `{option}`: {what}")]
    OfOption {
        /// The option.
        option: String,
        /// The fault of its value.
        what: Box<Self>,
    },
    /// An option that the mode does not have.
    #[error("mode {mode} has no option `{option}` (it takes: {known})")]
    Unknown {
        /// The mode.
        mode: &'static str,
        /// The option.
        option: String,
        /// The options that the mode has.
        known: String,
    },
    /// An option, a parameter or a channel that is given twice.
    #[error("`{option}` is there twice")]
    Twice {
        /// The option.
        option: String,
    },
    /// An option without its value.
    #[error("option `{option}` needs a value: +{option}=...")]
    NoValue {
        /// The option.
        option: String,
    },
    /// A switch with a value.
    #[error("option `{option}` takes no value, found `{found}`")]
    NeedlessValue {
        /// The switch.
        option: String,
        /// Its value.
        found: String,
    },
    /// Buckets times samples are too many.
    #[error("{buckets} buckets of {samples} samples: at most {MAX_SAMPLES} in all")]
    Buckets {
        /// Buckets.
        buckets: u32,
        /// Time samples of each.
        samples: u32,
    },
    /// The published kernels are complete: nothing else can be chosen.
    #[error(
        "`published` says all of kernel, kernel-weight, overlap, alpha and normalise: it cannot stand beside `{option}`"
    )]
    Published {
        /// The option that stands beside it.
        option: &'static str,
    },
    /// A weight of ellipsoids, for a tube.
    #[error("kernel-weight={weight} is of ellipsoids: it needs kernel=ellipsoid")]
    OfEllipsoids {
        /// The weight.
        weight: &'static str,
    },
    /// A parameter that a time weight does not have.
    #[error("the weight `{weight}` has no parameter `{parameter}` (it takes: {known})")]
    Parameter {
        /// The weight.
        weight: String,
        /// The parameter.
        parameter: String,
        /// Those that it has.
        known: String,
    },
}

impl OptionError {
    pub(super) fn value(expected: impl Into<String>, found: &str) -> Self {
        Self::Value { expected: expected.into(), found: found.to_owned() }
    }
}

/// Names with commas; `nothing` where there are none.
pub(super) fn list(names: &[&str]) -> String {
    if names.is_empty() { "nothing".to_owned() } else { names.join(", ") }
}
