//! The columns of our own binary format: their names and types, and what may stand in them.

use std::ops::Range;

use glam::Vec3;

use super::error::ParseError;
use super::surfels::{Material, Surfels};
use super::tidy::{MAX_COORDINATE, usable};

/// Bytes of the header.
pub(super) const HEADER: usize = 64;
/// The types of 32-bit floats, and of 64-bit whole numbers with a sign.
const F32: u32 = 1;
const I64: u32 = 2;

/// A column that this version knows.
pub(super) struct Known {
    pub(super) name: &'static str,
    pub(super) kind: u32,
    /// Numbers of a row.
    pub(super) components: usize,
    pub(super) required: bool,
    pub(super) rows: Rows,
    /// The column of surfels without which there is no such column of levels, and with which there is.
    with: Option<&'static str>,
}

/// What a column has rows for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Rows {
    /// Each surfel of the model.
    Surfels,
    /// The whole tree of levels of detail: there is one row.
    Tree,
    /// Each node of the tree.
    Nodes,
    /// Each merged surfel of the tree.
    Merged,
}

const fn known(name: &'static str, components: usize, required: bool) -> Known {
    Known { name, kind: F32, components, required, rows: Rows::Surfels, with: None }
}

const fn optional(name: &'static str, kind: u32, components: usize, rows: Rows) -> Known {
    Known { name, kind, components, required: false, rows, with: None }
}

/// A column of floats of levels where surfels have the column `with`.
const fn of_levels_with(with: &'static str, name: &'static str, components: usize, rows: Rows) -> Known {
    Known { with: Some(with), ..optional(name, F32, components, rows) }
}

/// The columns in the order in which they are written. The first version has the first seven.
pub(super) const COLUMNS: [Known; 30] = [
    known("position", 3, true),
    known("axis_u", 3, true),
    known("axis_v", 3, true),
    known("normal", 3, true),
    known("colour", 3, true),
    known("material", 4, false),
    known("velocity", 3, false),
    known("normalisation", 1, false),
    known("opacity", 1, false),
    known("acceleration", 3, false),
    optional("id", I64, 1, Rows::Surfels),
    optional("level_of", I64, 2, Rows::Tree),
    optional("level_node", I64, 4, Rows::Nodes),
    optional("level_box", F32, 6, Rows::Nodes),
    optional("level_axis", F32, 3, Rows::Nodes),
    optional("level_errors", F32, 4, Rows::Nodes),
    optional("level_along", F32, 6, Rows::Nodes),
    optional("level_position", F32, 3, Rows::Merged),
    optional("level_axis_u", F32, 3, Rows::Merged),
    optional("level_axis_v", F32, 3, Rows::Merged),
    optional("level_normal", F32, 3, Rows::Merged),
    optional("level_colour", F32, 3, Rows::Merged),
    optional("level_share", F32, 1, Rows::Merged),
    optional("level_alike", F32, 1, Rows::Merged),
    of_levels_with("material", "level_material", 4, Rows::Merged),
    of_levels_with("opacity", "level_opacity", 1, Rows::Merged),
    of_levels_with("velocity", "level_velocity", 3, Rows::Merged),
    of_levels_with("acceleration", "level_acceleration", 3, Rows::Merged),
    of_levels_with("velocity", "level_velocities", 10, Rows::Nodes),
    of_levels_with("acceleration", "level_accelerations", 10, Rows::Nodes),
];

/// Where each column of [`COLUMNS`] lies in the file.
pub(super) type Places = [Option<Range<usize>>; COLUMNS.len()];

impl Known {
    /// Bytes of a row.
    pub(super) const fn row(&self) -> usize {
        let each = if self.kind == I64 { 8 } else { 4 };
        each * self.components
    }

    /// Bytes of a column; `None` if they need more than 64 bits.
    pub(super) fn length(&self, count: u64) -> Option<u64> {
        count.checked_mul(self.row() as u64)
    }
}

/// Where the column `name` lies, if there is one.
pub(super) fn place_of<'a>(places: &'a Places, name: &str) -> Option<&'a Range<usize>> {
    let column = COLUMNS.iter().position(|known| known.name == name)?;
    places[column].as_ref()
}

/// Checks that there are all columns of levels or none, and that they have as many rows as they should.
pub(super) fn check_levels(places: &Places) -> Result<(), ParseError> {
    if place_of(places, "level_of").is_none() {
        return Ok(());
    }
    let rows = |kind: Rows| {
        let first = COLUMNS.iter().position(|known| known.rows == kind);
        first.map_or(0, |column| places[column].as_ref().map_or(0, |place| place.len() / COLUMNS[column].row()))
    };
    for (column, own) in COLUMNS.iter().zip(places).filter(|(column, _)| column.name.starts_with("level_")) {
        let is_missing = column.with.is_some_and(|name| place_of(places, name).is_none());
        let Some(own) = own else {
            if is_missing {
                continue;
            }
            let found = format!("no column `{}`", column.name);
            return Err(ParseError::byte(HEADER, found, "all columns of levels, or no `level_of`"));
        };
        if is_missing {
            let found = format!("a column `{}`", column.name);
            return Err(ParseError::byte(own.start, found, "none, where the model has none"));
        }
        let expected = rows(column.rows);
        if own.len() != expected * column.row() {
            let found = format!("{} rows of `{}`", own.len() / column.row(), column.name);
            return Err(ParseError::byte(own.start, found, format!("{expected}, as others have")));
        }
    }
    Ok(())
}

/// The byte at which row `i` of a column begins.
pub(super) fn byte_of(places: &Places, column: usize, i: usize) -> usize {
    let start = places[column].as_ref().map_or(HEADER, |place| place.start);
    start + COLUMNS[column].row() * i
}

/// Checks what every other part relies on, in columns whose names begin with `prefix`. A checksum guards against
/// accidents, not against programs that write nonsense.
pub(super) fn check_columns(prefix: &str, s: &Surfels, places: &Places) -> Result<(), ParseError> {
    let finite = |v: &Vec3| f64::from(v.abs().max_element()) <= MAX_COORDINATE && v.is_finite();
    let unit = |n: &Vec3| (n.length_squared() - 1.0).abs() < 1e-4;
    let sane =
        |m: &Material| [m.ambient, m.diffuse, m.specular, m.shininess].iter().all(|x| x.is_finite() && *x >= 0.0);
    let axes = s.axis_u.iter().zip(&s.axis_v);
    let faults = [
        ("position", "position", s.position.iter().position(|v| !finite(v))),
        ("axis_u", "pair of axes", axes.into_iter().position(|(u, v)| !usable(*u, *v))),
        ("normal", "normal", s.normal.iter().position(|n| !unit(n))),
        ("colour", "colour", s.colour.iter().position(|c| !c.is_finite())),
        ("material", "material", s.material.iter().position(|m| !sane(m))),
        ("velocity", "velocity", s.velocity.iter().position(|v| !finite(v))),
        ("opacity", "opacity", s.opacity.iter().position(|opacity| !(0.0..=1.0).contains(opacity))),
        ("acceleration", "acceleration", s.acceleration.iter().position(|v| !finite(v))),
    ];
    let Some((column, what, i)) = faults.into_iter().find_map(|(column, what, fault)| Some((column, what, fault?)))
    else {
        return Ok(());
    };
    let expected = "finite numbers, axes that span a plane, unit normals, coefficients of at least 0, \
                    opacities from 0 to 1";
    let name = format!("{prefix}{column}");
    let found = if prefix.is_empty() {
        format!("an unusable {what} at surfel {i}")
    } else {
        format!("an unusable {what} at row {i} of `{name}`")
    };
    let column = COLUMNS.iter().position(|known| known.name == name).unwrap_or_default();
    Err(ParseError::byte(byte_of(places, column, i), found, expected))
}
