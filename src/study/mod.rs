//! Modes held against a reference: what `sheet` and `report` show.

pub mod report;
pub mod sheet;
