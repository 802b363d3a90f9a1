//! Turns attributes into values by the schema: parses numbers, checks ranges, fills in defaults.

use glam::DVec3;

use super::check::selected;
use super::dom::{Element, FileRef, Source};
use super::error::{SceneError, quoted};
use super::schema::{Absent, AttributeSchema, ElementSchema, ValueKind, element as schema_of};
use crate::limits::{self, Range};
use crate::model::Spacing;

/// An element, present or not, with its schema. It gives values by name.
pub(super) struct Part<'a> {
    pub(super) source: &'a Source,
    pub(super) element: &'a Element,
    schema: &'static ElementSchema,
    selected: &'a str,
}

/// Stands for a row that the schema lacks.
static NO_ROW: AttributeSchema =
    AttributeSchema { name: "?", kind: ValueKind::Text, default: Absent::Required, only: &[], meaning: "" };

impl<'a> Part<'a> {
    pub(super) fn new(source: &'a Source, element: &'a Element, name: &'static str) -> Self {
        let schema = schema_of(name).unwrap_or_else(super::schema::root);
        Self { source, element, schema, selected: selected(element, schema) }
    }

    /// The value of an attribute, or its default; `None` where the default is found later.
    fn value(&self, name: &str) -> Result<(Option<&'a str>, &'static AttributeSchema), SceneError> {
        let row = self.schema.row(name, self.selected).unwrap_or(&NO_ROW);
        let value = match (self.element.attribute(name), row.default) {
            (Some(given), _) => Some(given.value.trim()),
            (None, Absent::Value(default)) => Some(default),
            (None, Absent::Auto(_)) => None,
            (None, Absent::Required) => {
                return Err(SceneError::MissingAttribute {
                    at: self.source.locate(self.element.at),
                    element: self.schema.name,
                    attribute: row.name,
                    expected: format!("{}, {}", row.meaning, row.kind),
                });
            }
        };
        Ok((value, row))
    }

    /// Reads a value with `f`, which gives `None` for one that is not right.
    fn parse<T>(&self, name: &str, f: impl FnOnce(&str, ValueKind) -> Option<T>) -> Result<Option<T>, SceneError> {
        let (value, row) = self.value(name)?;
        let Some(value) = value else { return Ok(None) };
        f(value, row.kind).map(Some).ok_or_else(|| self.bad(name, &quoted(value), row.kind.to_string()))
    }

    pub(super) fn given(&self, name: &str) -> bool {
        self.element.attribute(name).is_some()
    }

    pub(super) fn optional_number(&self, name: &str) -> Result<Option<f64>, SceneError> {
        self.parse(name, |value, kind| match kind {
            ValueKind::Number(range) => number(value, range),
            _ => None,
        })
    }

    pub(super) fn number(&self, name: &str) -> Result<f64, SceneError> {
        self.optional_number(name).map(Option::unwrap_or_default)
    }

    /// A number, infinite where the word says so.
    pub(super) fn divisor(&self, name: &str) -> Result<f64, SceneError> {
        let divisor = self.parse(name, |value, kind| match kind {
            ValueKind::Divisor(_) if value == "infinite" => Some(f64::INFINITY),
            ValueKind::Divisor(range) => number(value, range),
            _ => None,
        })?;
        Ok(divisor.unwrap_or(1.0))
    }

    /// The spacing of a mesh's surfels.
    pub(super) fn spacing(&self, name: &str) -> Result<Spacing, SceneError> {
        let spacing = self.parse(name, |value, kind| match kind {
            ValueKind::Spacing(_) if value == "none" => Some(Spacing::None),
            ValueKind::Spacing(range) => number(value, range).map(Spacing::Of),
            _ => None,
        })?;
        Ok(spacing.unwrap_or(Spacing::Auto))
    }

    pub(super) fn optional_vector(&self, name: &str) -> Result<Option<DVec3>, SceneError> {
        self.parse(name, vector)
    }

    pub(super) fn vector(&self, name: &str) -> Result<DVec3, SceneError> {
        self.optional_vector(name).map(Option::unwrap_or_default)
    }

    pub(super) fn integer(&self, name: &str) -> Result<Option<i64>, SceneError> {
        self.parse(name, |value, kind| match kind {
            ValueKind::Integer(lo, hi) => value.parse().ok().filter(|i| (lo..=hi).contains(i)),
            _ => None,
        })
    }

    pub(super) fn boolean(&self, name: &str) -> Result<bool, SceneError> {
        self.optional_boolean(name).map(Option::unwrap_or_default)
    }

    pub(super) fn optional_boolean(&self, name: &str) -> Result<Option<bool>, SceneError> {
        self.parse(name, |value, _| value.parse().ok())
    }

    pub(super) fn choice(&self, name: &str) -> Result<Option<String>, SceneError> {
        self.parse(name, |value, kind| match kind {
            ValueKind::Choice(words) => words.contains(&value).then(|| value.to_owned()),
            _ => None,
        })
    }

    pub(super) fn text(&self, name: &str) -> Result<Option<String>, SceneError> {
        self.parse(name, |value, _| (!value.is_empty() && !value.contains(char::is_control)).then(|| value.to_owned()))
    }

    /// The file that the element's text names.
    pub(super) fn file(&self) -> FileRef {
        FileRef { text: self.element.text.clone(), at: self.element.text_at }
    }

    /// The error for a value that is not right.
    pub(super) fn bad(&self, name: &str, found: &dyn std::fmt::Display, expected: String) -> SceneError {
        let at = self.element.attribute(name).map_or(self.element.at, |a| a.at);
        let default = if self.given(name) { "" } else { " by default" };
        SceneError::BadValue {
            at: self.source.locate(at),
            what: format!("`{name}`"),
            found: format!("{found}{default}"),
            expected,
        }
    }
}

fn number(text: &str, range: Range) -> Option<f64> {
    text.parse().ok().filter(|&x| range.holds(x))
}

/// Three numbers between blanks, or one that stands for all where the kind is a scale.
fn vector(text: &str, kind: ValueKind) -> Option<DVec3> {
    let range = match kind {
        ValueKind::Vector(range) => range,
        ValueKind::Direction => limits::COORDINATE,
        ValueKind::Scale => Range(-limits::SCALE.1, limits::SCALE.1),
        _ => return None,
    };
    let mut numbers = text.split_ascii_whitespace().map(|word| number(word, range));
    let x = numbers.next()??;
    let v = match (numbers.next(), numbers.next(), numbers.next()) {
        (None, None, None) if matches!(kind, ValueKind::Scale) => DVec3::splat(x),
        (Some(y), Some(z), None) => DVec3::new(x, y?, z?),
        _ => return None,
    };
    let right = match kind {
        ValueKind::Direction => limits::is_direction(v),
        ValueKind::Scale => limits::is_scale(v),
        _ => true,
    };
    right.then_some(v)
}
