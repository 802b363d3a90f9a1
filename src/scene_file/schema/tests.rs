//! The table against the documentation of scene files.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::*;

/// The table as docs/scene-format.md prints it.
fn as_markdown() -> BTreeSet<String> {
    let mut lines = BTreeSet::new();
    for e in ELEMENTS {
        lines.insert(format!("### `<{}>`", e.name));
        if let Some(text) = e.text {
            lines.insert(format!("Text of `<{}>`: {text}.", e.name));
        }
        for c in e.children {
            lines.insert(format!("Inside `<{}>`: {} `<{}>`.", e.name, c.occurs.describe(), c.name));
        }
        for a in e.attributes {
            let mut line = format!("| `{}.{}`", e.name, a.name);
            if !a.only.is_empty() {
                write!(line, " ({})", a.only.join(", ")).unwrap();
            }
            let default = match a.default {
                Absent::Required => "required".to_owned(),
                Absent::Value(v) => format!("`{v}`"),
                Absent::Auto(how) => how.to_owned(),
            };
            lines.insert(format!("{line} | {} | {} | {default} |", a.meaning, a.kind));
        }
    }
    lines
}

#[test]
fn the_document_says_what_the_table_says() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/scene-format.md");
    let doc = std::fs::read_to_string(path).unwrap();
    let heads = ["### ", "Text of ", "Inside ", "| `"];
    let found: BTreeSet<String> =
        doc.lines().filter(|l| heads.iter().any(|h| l.starts_with(h))).map(str::to_owned).collect();
    let wanted = as_markdown();
    let missing: Vec<_> = wanted.difference(&found).collect();
    let wrong: Vec<_> = found.difference(&wanted).collect();
    assert!(missing.is_empty() && wrong.is_empty(), "missing: {missing:#?}\nnot in the table: {wrong:#?}");
}

#[test]
fn every_child_has_a_schema_and_every_schema_a_place() {
    let placed: BTreeSet<&str> = ELEMENTS.iter().flat_map(|e| e.children).map(|c| c.name).collect();
    let known: BTreeSet<&str> = ELEMENTS[1..].iter().map(|e| e.name).collect();
    assert_eq!(placed, known);
    for e in ELEMENTS {
        assert!(e.selector.is_none_or(|s| e.attributes.iter().any(|a| a.name == s)), "{}", e.name);
    }
}

#[test]
fn the_kernel_of_volumes_has_one_default() {
    let row = element("pointModel").and_then(|schema| schema.row("kernel", "")).unwrap();
    let Absent::Value(kernel) = row.default else { panic!("{:?}", row.default) };
    assert_eq!(kernel.parse::<f64>().unwrap(), crate::model::KERNEL);
}
