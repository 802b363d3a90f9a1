//! Checks the structure of a scene's tree against the schema: finds words that are unknown, missing, repeated or out of
//! place.

use super::dom::{Element, Source};
use super::error::{SceneError, quoted};
use super::schema::{Absent, ElementSchema, Occurs, ValueKind, element as schema_of, list};
use super::xml::{DASHES, is_dashes};

/// Most notes about unknown words; a count stands for the rest.
const MOST_NOTES: usize = 50;

/// Checks the tree. With `lenient`, unknown words become notes; they stay in the tree, and nothing reads them.
pub(super) fn check(source: &Source, root: &Element, lenient: bool) -> Result<Vec<String>, SceneError> {
    let schema = super::schema::root();
    if root.name != schema.name {
        let found = format!("the root element {}", quoted(&root.name));
        // Simulations have these, and nobody means them as scenes.
        let more = if root.name == "VTKFile" { "; VTK is not read: write PLY, or text with named columns" } else { "" };
        let expected = format!("<{}>{more}", schema.name);
        return Err(SceneError::Syntax { at: source.locate(root.at), found, expected });
    }
    let mut checker = Checker { source, lenient, notes: Vec::new(), more: 0 };
    checker.element(root, schema)?;
    let Checker { mut notes, more, .. } = checker;
    if more > 0 {
        notes.push(format!("{}: {more} more unknown elements or attributes", source.path().display()));
    }
    Ok(notes)
}

/// Checks a tree whose root is a `<camera>`, which names no files.
pub(super) fn check_camera(source: &Source, root: &Element) -> Result<(), SceneError> {
    let schema = schema_of("camera").unwrap_or_else(super::schema::root);
    if root.name != schema.name {
        let found = format!("the root element {}", quoted(&root.name));
        let expected = "<camera>: a camera path has one, and nothing else".to_owned();
        return Err(SceneError::Syntax { at: source.locate(root.at), found, expected });
    }
    if let Some(child) = root.children.iter().find(|child| matches!(child.name.as_str(), "animation" | "track")) {
        return Err(SceneError::BadValue {
            at: source.locate(child.at),
            what: format!("<{}>", child.name),
            found: "in a camera path".to_owned(),
            expected: "<key>; files are named in scenes alone".to_owned(),
        });
    }
    Checker { source, lenient: false, notes: Vec::new(), more: 0 }.element(root, schema)
}

/// Stands for the selector's value where the weight is drawn: no attribute shapes it.
const CURVE: &str = "a <curve>";

/// The value of the selector, which decides the attributes that apply.
pub(super) fn selected<'a>(element: &'a Element, schema: &ElementSchema) -> &'a str {
    let Some(selector) = schema.selector else { return "" };
    if draws(element, schema) {
        return CURVE;
    }
    if let Some(given) = element.attribute(selector) {
        return given.value.trim();
    }
    match schema.row(selector, "").map(|row| row.default) {
        Some(Absent::Value(value)) => value,
        _ => "",
    }
}

/// True where a `<curve>` takes the place of the selector.
fn draws(element: &Element, schema: &ElementSchema) -> bool {
    schema.children.iter().any(|c| c.name == "curve") && element.child("curve").is_some()
}

struct Checker<'a> {
    source: &'a Source,
    lenient: bool,
    notes: Vec<String>,
    more: usize,
}

impl Checker<'_> {
    fn element(&mut self, element: &Element, schema: &'static ElementSchema) -> Result<(), SceneError> {
        self.attributes(element, schema)?;
        if schema.text.is_none() && !element.text.is_empty() {
            let at = self.source.locate(element.text_at);
            if is_dashes(&element.text) {
                return Err(SceneError::Syntax {
                    at,
                    found: "a dash before a tag".to_owned(),
                    expected: DASHES.to_owned(),
                });
            }
            let expected = if schema.children.is_empty() {
                "nothing inside".to_owned()
            } else {
                format!("only {}", schema.holds())
            };
            return Err(SceneError::UnexpectedText {
                at,
                element: schema.name,
                found: quoted(&element.text),
                expected,
            });
        }
        let instead = super::schema::instead_of_text(schema).and_then(|name| element.attribute(name));
        if let Some(given) = instead
            && !element.text.is_empty()
        {
            return Err(SceneError::BadValue {
                at: self.source.locate(element.text_at),
                what: format!("<{}>", schema.name),
                found: format!("{} beside `{}`", quoted(&element.text), given.name),
                expected: "one of the two".to_owned(),
            });
        }
        if let Some(what) = schema.text
            && element.text.is_empty()
            && instead.is_none()
        {
            return Err(SceneError::BadValue {
                at: self.source.locate(element.at),
                what: format!("<{}>", schema.name),
                found: "empty".to_owned(),
                expected: what.to_owned(),
            });
        }
        self.children(element, schema)
    }

    fn attributes(&mut self, element: &Element, schema: &'static ElementSchema) -> Result<(), SceneError> {
        let selected = selected(element, schema);
        if let Some(selector) = schema.selector
            && let Some(given) = element.attribute(selector)
        {
            if selected == CURVE {
                return Err(self.inapplicable(given.at, schema, selector, selected));
            }
            if let Some(row) = schema.row(selector, "")
                && let ValueKind::Choice(words) = row.kind
                && !words.contains(&selected)
            {
                return Err(SceneError::BadValue {
                    at: self.source.locate(given.at),
                    what: format!("`{selector}`"),
                    found: quoted(&given.value),
                    expected: row.kind.to_string(),
                });
            }
        }
        let is_root = std::ptr::eq(schema, super::schema::root());
        for attribute in &element.attributes {
            // A namespace says nothing that the root's name does not say.
            if is_root && (attribute.name == "xmlns" || attribute.name.starts_with("xmlns:")) {
                continue;
            }
            if schema.row(&attribute.name, selected).is_some() {
                continue;
            }
            if let Some(row) = schema.attributes.iter().find(|a| a.name == attribute.name) {
                // A missing selector is refused when the element is read.
                if selected.is_empty() {
                    continue;
                }
                return Err(self.inapplicable(attribute.at, schema, row.name, selected));
            }
            self.unknown(|source| SceneError::UnknownAttribute {
                at: source.locate(attribute.at),
                element: schema.name,
                found: quoted(source.word(attribute.at)),
                closest: closest(&attribute.name, schema.attributes.iter().map(|a| a.name)),
                known: schema.takes(),
            })?;
        }
        Ok(())
    }

    fn children(&mut self, element: &Element, schema: &'static ElementSchema) -> Result<(), SceneError> {
        let mut counts = vec![0_usize; schema.children.len()];
        for child in &element.children {
            let Some(i) = schema.children.iter().position(|c| c.name == child.name) else {
                self.unknown(|source| SceneError::UnknownElement {
                    at: source.locate(child.at),
                    parent: schema.name,
                    found: quoted(&child.name),
                    closest: closest(&child.name, schema.children.iter().map(|c| c.name)),
                    known: schema.holds(),
                })?;
                continue;
            };
            let known = &schema.children[i];
            counts[i] += 1;
            let shapes = || schema.children.iter().zip(&counts).filter(|(c, _)| c.occurs == Occurs::OneShape);
            let again = match known.occurs {
                Occurs::OneShape => shapes().map(|(_, count)| count).sum::<usize>() > 1,
                Occurs::AtMostOne => counts[i] > 1,
                Occurs::AtLeastOne | Occurs::Any => false,
            };
            if again {
                return Err(SceneError::RepeatedElement {
                    at: self.source.locate(child.at),
                    parent: schema.name,
                    element: known.name,
                    expected: known.occurs.describe(),
                });
            }
            if let Some(schema) = schema_of(known.name) {
                self.element(child, schema)?;
            }
        }
        let mut shaped = schema.children.iter().zip(&counts).any(|(c, &n)| c.occurs == Occurs::OneShape && n > 0);
        for (known, count) in schema.children.iter().zip(counts) {
            let missing = match known.occurs {
                // Reported at the first kind of shape, unless there is another.
                Occurs::OneShape => !std::mem::replace(&mut shaped, true),
                Occurs::AtLeastOne => count == 0,
                Occurs::AtMostOne | Occurs::Any => false,
            };
            if missing {
                return Err(SceneError::MissingElement {
                    at: self.source.locate(element.at),
                    parent: schema.name,
                    element: known.name,
                    expected: known.occurs.describe(),
                });
            }
        }
        Ok(())
    }

    /// The error is made only where it is reported: locating costs the length of a line.
    fn unknown(&mut self, error: impl FnOnce(&Source) -> SceneError) -> Result<(), SceneError> {
        if !self.lenient {
            return Err(error(self.source));
        }
        if self.notes.len() < MOST_NOTES {
            self.notes.push(format!("{}; ignored", error(self.source)));
        } else {
            self.more += 1;
        }
        Ok(())
    }

    fn inapplicable(&self, at: usize, schema: &ElementSchema, attribute: &'static str, selected: &str) -> SceneError {
        let selector = schema.selector.unwrap_or_default();
        let applying = schema.attributes.iter().filter(|a| a.applies(selected));
        let (found, known) = if selected == CURVE {
            (CURVE.to_owned(), list(applying.map(|a| a.name).filter(|&name| name != selector)))
        } else {
            (format!("{selector}=\"{selected}\""), list(applying.map(|a| a.name)))
        };
        SceneError::Inapplicable { at: self.source.locate(at), element: schema.name, attribute, found, known }
    }
}

/// The known name nearest to `name`, if it looks like a slip.
fn closest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    if name.len() > 40 {
        return None;
    }
    let name: Vec<char> = name.to_lowercase().chars().collect();
    let (distance, best) = known
        .map(|k| (edits(&name, &k.to_lowercase().chars().collect::<Vec<_>>()), k))
        .min_by_key(|&(distance, _)| distance)?;
    (distance <= (best.len() / 3).max(1)).then(|| best.to_owned())
}

/// Levenshtein distance with neighbour swaps as one edit.
fn edits(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = Vec::new();
    let mut above: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let change = above[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut best = change.min(above[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(before[j - 2] + 1);
            }
            row.push(best);
        }
        before = std::mem::replace(&mut above, row);
    }
    above[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_find_their_word_and_strangers_do_not() {
        let known = ["name", "blur", "epsilon", "colourSpace", "centre"];
        for (slip, word) in [("nmae", "name"), ("Blur", "blur"), ("colorspace", "colourSpace"), ("center", "centre")] {
            assert_eq!(closest(slip, known.into_iter()).as_deref(), Some(word));
        }
        assert_eq!(closest("velocity", known.into_iter()), None);
        // A swap is one edit wherever it stands.
        for slip in ["pesilon", "espilon", "epislon", "epslion", "epsioln", "epsilno"] {
            let letters = |word: &str| word.chars().collect::<Vec<_>>();
            assert_eq!(edits(&letters(slip), &letters("epsilon")), 1, "{slip}");
        }
    }
}
