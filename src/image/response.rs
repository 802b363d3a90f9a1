//! Responses of cameras: how light becomes the codes of a file.

use std::fmt;
use std::str::FromStr;

use crate::math::srgb;

/// The code of a PNG file, as a share of the greatest one, for light from 0 to 1. Brighter light is clipped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Response {
    /// The curve of sRGB.
    #[default]
    Srgb,
    /// The light to the power of 1/gamma, gamma from 0.1 to 10.
    Gamma(f64),
    /// The light itself.
    Linear,
}

/// A text that is no response.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{found}` is no response (there are: srgb, linear, gamma:G with G from 0.1 to 10)")]
pub struct ResponseError {
    /// The text.
    found: String,
}

impl Response {
    /// Its gamma; `None` for sRGB, which has none.
    pub fn gamma(self) -> Option<f64> {
        match self {
            Self::Srgb => None,
            Self::Gamma(gamma) => Some(gamma),
            Self::Linear => Some(1.0),
        }
    }

    /// Replaces linear light by the nearest of the codes 0..=`top`.
    pub(crate) fn encode(self, values: &mut [f32], top: f32) {
        let Some(gamma) = self.gamma() else { return srgb::encode(values, top) };
        for value in values {
            let share = libm::pow(f64::from(*value).clamp(0.0, 1.0), 1.0 / gamma);
            *value = srgb::nearest_code(share as f32, top) as f32;
        }
    }
}

impl fmt::Display for Response {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Srgb => f.write_str("srgb"),
            Self::Gamma(gamma) => write!(f, "gamma:{gamma}"),
            Self::Linear => f.write_str("linear"),
        }
    }
}

impl FromStr for Response {
    type Err = ResponseError;

    fn from_str(text: &str) -> Result<Self, ResponseError> {
        let refused = || ResponseError { found: text.to_owned() };
        match text {
            "srgb" => Ok(Self::Srgb),
            "linear" => Ok(Self::Linear),
            _ => {
                let gamma = text.strip_prefix("gamma:").and_then(|gamma| gamma.parse().ok()).ok_or_else(refused)?;
                if (0.1..=10.0).contains(&gamma) { Ok(Self::Gamma(gamma)) } else { Err(refused()) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_follow_the_curve() {
        let codes = |response: Response| {
            let mut values = [-1.0, 0.0, 0.25, 0.5, 1.0, 7.0, f32::NAN];
            response.encode(&mut values, 255.0);
            values
        };
        assert_eq!(codes(Response::Linear), [0.0, 0.0, 64.0, 128.0, 255.0, 255.0, 0.0]);
        // 255 sqrt(1/4) = 127.5, 255 sqrt(1/2) = 180.3.
        assert_eq!(codes(Response::Gamma(2.0)), [0.0, 0.0, 128.0, 180.0, 255.0, 255.0, 0.0]);
        // 0.5 encodes to 0.735357 of 255.
        assert_eq!(codes(Response::Srgb), [0.0, 0.0, 137.0, 188.0, 255.0, 255.0, 0.0]);
    }

    #[test]
    fn texts() {
        for text in ["srgb", "gamma:2.2", "linear"] {
            assert_eq!(text.parse::<Response>().unwrap().to_string(), text);
        }
        for text in ["", "sRGB", "gamma", "gamma:", "gamma:0", "gamma:nan", "gamma:11", "2.2"] {
            assert!(text.parse::<Response>().unwrap_err().to_string().contains("there are: srgb"), "{text}");
        }
    }
}
