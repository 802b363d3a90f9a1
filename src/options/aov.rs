//! Extra channels by their names.

use std::str::FromStr;

use super::OptionError;
use crate::film::Aov;

/// A channel by the name of its layer ([`Aov::name`]).
impl FromStr for Aov {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        Self::LAYERS.into_iter().find(|aov| aov.name() == text).ok_or_else(|| OptionError::Word {
            what: "channel",
            found: text.to_owned(),
            known: Self::LAYERS.map(Self::name).join(", "),
        })
    }
}

/// Puts channels in the order of their layers.
///
/// # Errors
/// One is there twice.
pub fn in_order(aovs: &[Aov]) -> Result<Vec<Aov>, OptionError> {
    let mut sorted = aovs.to_vec();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(OptionError::Twice { option: pair[0].name().to_owned() }),
        None => Ok(sorted),
    }
}
