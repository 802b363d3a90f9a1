//! Metrics and limits on the command line, and whether a comparison is within them.

use std::fmt;

use serde::Serialize;
use splatblur::compare::{Comparison, Metric, Sense, number};

/// A metric by its name.
pub(super) fn metric(text: &str) -> Result<Metric, String> {
    Metric::from_name(text.trim()).ok_or_else(|| {
        let names = Metric::ALL.map(Metric::name).join(", ");
        format!("`{}` is no metric (there are: {names})", text.trim())
    })
}

/// `METRIC=VALUE`.
pub(super) fn limit(text: &str) -> Result<Limit, String> {
    let (name, value) = text.split_once('=').ok_or("expected METRIC=VALUE, as in flip=0.02")?;
    let metric = metric(name)?;
    let value: f64 = value.trim().parse().map_err(|_| format!("`{value}` is not a number"))?;
    if value.is_finite() { Ok(Limit { metric, value }) } else { Err(format!("`{value}` is not a finite number")) }
}

/// The greatest error, or the least similarity, that passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limit {
    pub(super) metric: Metric,
    pub(super) value: f64,
}

impl Limit {
    /// What is over the limit, if anything. A metric that was not made cannot be within.
    pub(super) fn check(self, errors: &Comparison, of: String) -> Option<Over> {
        let value = errors.value(self.metric).unwrap_or(f64::NAN);
        (!self.metric.within(value, self.value)).then_some(Over { limit: self, value, of })
    }
}

/// A limit that was not held.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Over {
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
pub(super) struct Shown(pub(super) f64);

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
            let error = limit(text).unwrap_err();
            assert!(error.contains(hint), "{text}: {error}");
        }
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
