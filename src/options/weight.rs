//! Time weights as text: `box`, `tent`, `ramp:centre=1`, `exponential:rate=3,centre=1`,
//! `one-minus-exponential:centre=1`, `gaussian:centre=.5,width=.2`.

use std::fmt;
use std::str::FromStr;

use super::OptionError;
use super::error::list;
use crate::limits::{STEEPNESS, UNIT};
use crate::time::Weight;

/// The weight with all its parameters. A drawn curve has no text that reads back: it is named with its number of
/// points.
impl fmt::Display for Weight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Box => f.write_str("box"),
            Self::Tent => f.write_str("tent"),
            Self::Ramp { centre } => write!(f, "ramp:centre={centre}"),
            Self::Exponential { rate, centre } => write!(f, "exponential:rate={rate},centre={centre}"),
            Self::OneMinusExponential { centre } => write!(f, "one-minus-exponential:centre={centre}"),
            Self::Gaussian { centre, width } => write!(f, "gaussian:centre={centre},width={width}"),
            Self::Curve(points) => write!(f, "curve of {} points", points.len()),
        }
    }
}

/// A weight by its name, with parameters that differ from its defaults: `centre` 0 to 1 (of the shutter), `rate` (per
/// shutter) and `width` (shutters) 0.001 to 1000.
impl FromStr for Weight {
    type Err = OptionError;

    fn from_str(text: &str) -> Result<Self, OptionError> {
        let (name, parameters) = text.split_once(':').unwrap_or((text, ""));
        let known: &[&str] = match name {
            "box" | "tent" => &[],
            "ramp" | "one-minus-exponential" => &["centre"],
            "exponential" => &["rate", "centre"],
            "gaussian" => &["centre", "width"],
            _ => {
                let known = "box, tent, ramp, exponential, one-minus-exponential, gaussian".to_owned();
                return Err(OptionError::Word { what: "weight", found: name.to_owned(), known });
            }
        };
        let mut values: Vec<(&str, f64)> = Vec::new();
        for part in parameters.split(',').filter(|part| !part.is_empty()) {
            let (key, value) = part.split_once('=').ok_or_else(|| OptionError::value("name=value", part))?;
            if !known.contains(&key) {
                let (weight, parameter) = (name.to_owned(), key.to_owned());
                return Err(OptionError::Parameter { weight, parameter, known: list(known) });
            }
            if values.iter().any(|(k, _)| *k == key) {
                return Err(OptionError::Twice { option: key.to_owned() });
            }
            values.push((key, parameter(key, value)?));
        }
        let get = |key: &str, default: f64| values.iter().find(|(k, _)| *k == key).map_or(default, |(_, v)| *v);
        Ok(match name {
            "box" => Self::Box,
            "tent" => Self::Tent,
            "ramp" => Self::Ramp { centre: get("centre", 1.0) },
            "exponential" => Self::Exponential { rate: get("rate", 3.0), centre: get("centre", 1.0) },
            "one-minus-exponential" => Self::OneMinusExponential { centre: get("centre", 1.0) },
            _ => Self::Gaussian { centre: get("centre", 0.5), width: get("width", 0.2) },
        })
    }
}

/// The value of parameter `key`, in its range.
fn parameter(key: &str, text: &str) -> Result<f64, OptionError> {
    let (range, of) = if key == "centre" { (UNIT, " (the shutter)") } else { (STEEPNESS, "") };
    let value = text.trim().parse().ok().filter(|&value| range.holds(value));
    value.ok_or_else(|| OptionError::OfOption {
        option: key.to_owned(),
        what: Box::new(OptionError::value(format!("a number {range}{of}"), text)),
    })
}
