//! Limits of metrics, and whether a comparison is within them.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::{Comparison, Metric, Sense, number};

/// Why a text is no metric or no limit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitError {
    /// No metric has this name.
    #[error("`{found}` is no metric (there are: {})", Metric::ALL.map(Metric::name).join(", "))]
    Metric {
        /// The name.
        found: String,
    },
    /// Not a metric and a value.
    #[error("expected METRIC=VALUE, as in flip=0.02, found `{found}`")]
    Form {
        /// The text.
        found: String,
    },
    /// A value that is no number.
    #[error("`{found}` is not a number")]
    Number {
        /// The value.
        found: String,
    },
    /// A value that no metric can be held against.
    #[error("`{found}` is not a finite number")]
    Finite {
        /// The value.
        found: String,
    },
    /// Two limits of one metric.
    #[error("{} has two limits", .0.name())]
    Twice(Metric),
}

impl FromStr for Metric {
    type Err = LimitError;

    fn from_str(text: &str) -> Result<Self, LimitError> {
        Self::from_name(text.trim()).ok_or_else(|| LimitError::Metric { found: text.trim().to_owned() })
    }
}

/// The greatest error, or the least similarity, that passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// The metric.
    pub metric: Metric,
    /// The greatest or least value ([`Metric::sense`]), finite.
    pub value: f64,
}

/// `METRIC=VALUE`, as in `flip=0.02`.
impl FromStr for Limit {
    type Err = LimitError;

    fn from_str(text: &str) -> Result<Self, LimitError> {
        let (name, value) = text.split_once('=').ok_or_else(|| LimitError::Form { found: text.to_owned() })?;
        let metric = name.parse()?;
        let found = || value.to_owned();
        let number: f64 = value.trim().parse().map_err(|_| LimitError::Number { found: found() })?;
        if number.is_finite() { Ok(Self { metric, value: number }) } else { Err(LimitError::Finite { found: found() }) }
    }
}

impl Limit {
    /// Refuses several limits of one metric.
    ///
    /// # Errors
    /// A metric has two limits.
    pub fn check_unique(limits: &[Self]) -> Result<(), LimitError> {
        let metrics: Vec<Metric> = limits.iter().map(|limit| limit.metric).collect();
        let twice = (1..metrics.len()).find(|&i| metrics[..i].contains(&metrics[i]));
        twice.map_or(Ok(()), |i| Err(LimitError::Twice(metrics[i])))
    }

    /// The value over the limit, if it is over. `of` names the pictures. A metric that was not made cannot be within.
    pub fn check(self, errors: &Comparison, of: String) -> Option<Over> {
        let value = errors.value(self.metric).unwrap_or(f64::NAN);
        (!self.metric.within(value, self.value)).then_some(Over { limit: self, value, of })
    }
}

/// A limit that was exceeded.
#[derive(Clone, Debug, PartialEq)]
pub struct Over {
    limit: Limit,
    value: f64,
    of: String,
}

impl fmt::Display for Over {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Limit { metric, value } = self.limit;
        let side = match metric.sense() {
            Sense::Low => "at most",
            Sense::High => "at least",
        };
        write!(f, "{}: {} is {}, limit: {side} {value}", self.of, metric.name(), Shown(self.value))
    }
}

impl Serialize for Over {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let fields = serde_json::json!({
            "of": self.of, "metric": self.limit.metric.name(), "value": number(self.value), "limit": self.limit.value,
        });
        fields.serialize(serializer)
    }
}

/// Six significant digits; what is not finite in words.
pub struct Shown(pub f64);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let v = self.0;
        let text = if !v.is_finite() || v == 0.0 {
            format!("{v}")
        } else if (1e-4..1e7).contains(&v.abs()) {
            let digits = (5 - v.abs().log10().floor() as i32).max(0) as usize;
            format!("{v:.digits$}")
        } else {
            format!("{v:.5e}")
        };
        f.pad(&text)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use crate::film::Picture;

    fn limit(text: &str) -> Result<Limit, LimitError> {
        text.parse()
    }

    #[test]
    fn limits_are_read() {
        assert_eq!(limit("flip=0.02"), Ok(Limit { metric: Metric::Flip, value: 0.02 }));
        assert_eq!(limit(" psnr = 30"), Ok(Limit { metric: Metric::Psnr, value: 30.0 }));
        for (text, hint) in [
            ("flip", "METRIC=VALUE"),
            ("flop=1", "there are: mse, rmse"),
            ("flip=x", "not a number"),
            ("flip=nan", "not a finite"),
            ("flip=inf", "not a finite"),
            ("flip=", "not a number"),
            ("=1", "is no metric"),
        ] {
            let error = limit(text).unwrap_err().to_string();
            assert!(error.contains(hint), "{text}: {error}");
        }
    }

    #[test]
    fn what_is_over_a_limit() {
        let grey = |value| Picture { width: 1, height: 1, rgba: vec![[value, value, value, 1.0]], layers: Vec::new() };
        let errors = Comparison::new(&grey(0.5), &grey(0.25), &[]).unwrap();
        let over = |text| limit(text).unwrap().check(&errors, "a.png".to_owned()).map(|over| over.to_string());
        assert_eq!(over("mae=0.25"), None);
        assert_eq!(over("mae=0.125").unwrap(), "a.png: mae is 0.250000, limit: at most 0.125");
        assert!(over("psnr=90").unwrap().ends_with("limit: at least 90"));
        // A metric that was not made is within no limit.
        assert!(over("flip=1").is_some());
    }

    #[test]
    fn six_digits() {
        for (value, text) in [
            (0.0, "0"),
            (0.015_575_599, "0.0155756"),
            (-1.5, "-1.50000"),
            (123_456.789, "123457"),
            (1.5e-7, "1.50000e-7"),
            (2e9, "2.00000e9"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(Shown(value).to_string(), text);
        }
        assert_eq!(number(f64::INFINITY), Value::from("inf"));
        assert_eq!(number(f64::NAN), Value::from("NaN"));
        assert_eq!(number(0.5), Value::from(0.5));
    }
}
