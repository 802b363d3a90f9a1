//! Metrics as JSON.

use serde_json::{Map, Number, Value};

use super::{Comparison, Metric};

/// A number for JSON, which has none that are not finite: those become "NaN", "inf", "-inf".
pub fn number(value: f64) -> Value {
    Number::from_f64(value).map_or_else(|| Value::from(value.to_string()), Value::Number)
}

/// Metrics by their names; null where one was not made.
pub fn values(errors: &Comparison, metrics: &[Metric]) -> Value {
    let value = |metric: &Metric| errors.value(*metric).map_or(Value::Null, number);
    metrics.iter().map(|metric| (metric.name().to_owned(), value(metric))).collect::<Map<_, _>>().into()
}
