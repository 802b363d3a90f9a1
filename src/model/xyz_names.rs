//! Texts of points whose columns have names: by a line of words before the first point, or by a comment there that
//! names x, y and z, as other programs write it (`//X Y Z R G B`, `# x y z vx vy vz`).
//!
//! Names decide, whatever the numbers look like: the list is that of `columns`. Columns of other names are left out,
//! and need not be numbers.

use std::collections::HashSet;

use glam::Vec3;

use super::cloud::{Cloud, ColourStorage};
use super::colour_by::ColourBy;
use super::columns::{Columns, Finder, has_places, is_place, list};
use super::error::{ParseError, quote};
use super::ply_body::number;
use super::ply_header::{Element, Property, PropertyKind, Scalar};

/// Greatest number that still counts as 1: rounding in text.
pub(super) const ONE: f64 = 1.001;
/// Most columns of a named table. More are no table of points.
pub(super) const MOST: usize = 256;

/// The names of the columns of a text.
pub(super) struct Names {
    element: Element,
}

impl Names {
    /// The names of a line of words.
    ///
    /// # Errors
    /// There is no x, y or z, a name stands there twice, or there are too many.
    pub(super) fn of_line(words: &[&[u8]], line: u64) -> Result<Self, ParseError> {
        let names: Vec<String> = words.iter().map(|word| name(word)).collect();
        let fault = |found: String, expected: &str| Err(ParseError::line(line, found, expected));
        if names.len() > MOST {
            return fault(format!("more than {MOST} names of columns"), "at most as many");
        }
        if !has_places(&names) {
            let axis = ["x", "y", "z"].into_iter().find(|axis| !names.iter().any(|name| name == axis)).unwrap_or("z");
            let shown = list(&names.iter().map(String::as_str).collect::<Vec<_>>());
            return fault(format!("names of columns without {axis} ({shown})"), "x, y and z among them");
        }
        let mut known = HashSet::new();
        // The first column of a table of pandas has none: the numbers of rows.
        if let Some(name) = names.iter().find(|name| !name.is_empty() && !known.insert(name.as_str())) {
            return fault(format!("two columns {}", quote(name.as_bytes())), "different names");
        }
        let property = |name: String| Property { name, kind: PropertyKind::Scalar(Scalar::F64) };
        let properties = names.into_iter().map(property).collect();
        Ok(Self { element: Element { name: "point".to_owned(), count: 0, properties, line } })
    }

    /// The names of a comment, if x, y and z are among them and nothing else is wrong.
    pub(super) fn of_comment(words: &[&[u8]], line: u64) -> Option<Self> {
        Self::of_line(words, line).ok()
    }

    /// True for a line of a point: as many words as there are names, and numbers for x, y and z.
    pub(super) fn fit(&self, words: &[&[u8]]) -> bool {
        let properties = &self.element.properties;
        words.len() == properties.len()
            && properties
                .iter()
                .zip(words)
                .all(|(p, word)| !is_place(&p.name) || word.is_empty() || number(word).is_some())
    }
}

/// A name as the list of names has it: in lower case, without quotes.
fn name(word: &[u8]) -> String {
    String::from_utf8_lossy(word).trim_matches(['"', '\'']).trim().to_lowercase()
}

/// Reads the points below the names of their columns.
///
/// # Errors
/// The error names the line. A wanted word is no number, a line has more or fewer words than there are names, a colour
/// is above 65535, or there is no point.
pub(super) fn parse<'a>(
    names: &Names,
    lines: impl Iterator<Item = (u64, Vec<&'a [u8]>)>,
    by: Option<&ColourBy>,
    progress: &dyn Fn(u64, &[&[u8]]),
) -> Result<Cloud, ParseError> {
    let mut cloud = Cloud::default();
    let element = &names.element;
    let shown: Vec<&str> = element.properties.iter().map(|property| property.name.as_str()).collect();
    cloud.notes.push(format!("line {} names the columns: {}", element.line, list(&shown)));
    let mut finder = Finder::new(element);
    let columns = Columns::find(&mut finder, element, by, &mut cloud.notes)?;
    cloud.notes.extend(finder.ignored().map(|names| format!("columns ignored: {names}")));
    cloud.columns = finder.numbers();
    let mut values = vec![0.0; finder.wanted()];
    for (line, words) in lines {
        progress(line, &words);
        // Some programs end each row with a mark.
        let words =
            words.strip_suffix(&[&b""[..]]).filter(|fewer| fewer.len() == element.properties.len()).unwrap_or(&words);
        if words.len() != element.properties.len() {
            let expected = format!("{}, as line {} names them", element.properties.len(), element.line);
            return Err(ParseError::line(line, format!("{} words", words.len()), expected));
        }
        for ((word, index), property) in words.iter().zip(finder.indices()).zip(&element.properties) {
            let Some(index) = *index else { continue };
            let of = |e: ParseError| e.of(&format!("`{}`", property.name));
            // What a table leaves empty is no number.
            let value = if word.is_empty() { Some(f64::NAN) } else { number(word) };
            let value = value.ok_or_else(|| of(ParseError::line(line, quote(word), "a number")))?;
            if let Some(expected) = columns.fault(index, value) {
                return Err(of(ParseError::line(line, value.to_string(), expected)));
            }
            values[index] = value;
        }
        columns.push(&values, &mut cloud);
    }
    if cloud.position.is_empty() {
        return Err(ParseError::line(element.line, "no point after the names of the columns", "lines of numbers"));
    }
    if columns.is_grey() {
        let [low, high] = grey(&mut cloud);
        cloud.notes.push(format!("grey from {low} to {high}"));
    } else if columns.colour_type.is_some() {
        colours(&mut cloud, element.line)?;
    }
    opacities(&mut cloud);
    Ok(cloud)
}

/// Brings colours to 0..=1: they are in 0..=1, 0..=255, or whole numbers of 16 bits.
fn colours(cloud: &mut Cloud, line: u64) -> Result<(), ParseError> {
    let finite = || cloud.colour.iter().filter(|c| c.is_finite()).flat_map(Vec3::to_array);
    let largest = finite().fold(0.0_f32, f32::max);
    let (divisor, range) = if f64::from(largest) <= ONE {
        cloud.colour_storage = ColourStorage::Float;
        (1.0, "1, taken as linear")
    } else if largest <= 255.0 {
        (255.0, "255")
    } else if largest <= 65535.0 && finite().all(|c| c.fract() == 0.0) {
        (65535.0, "65535")
    } else {
        let expected = "numbers from 0 to 255, or whole ones up to 65535";
        return Err(ParseError::line(line, format!("a colour of {largest} below these names"), expected));
    };
    cloud.notes.push(format!("colours from 0 to {range}"));
    cloud.colour.iter_mut().for_each(|c| *c /= divisor);
    Ok(())
}

/// Opacities are in 0..=1, or in 0..=255 where one is above 1.
fn opacities(cloud: &mut Cloud) {
    let largest = cloud.opacity.iter().copied().filter(|o| o.is_finite()).fold(0.0_f32, f32::max);
    if f64::from(largest) > ONE && largest <= 255.0 {
        cloud.notes.push(format!("opacities up to {largest}: taken as 0 to 255"));
        cloud.opacity.iter_mut().for_each(|o| *o /= 255.0);
    }
}

/// Brings intensities to 0..=1: those of laser scanners are -2048..=2047. Returns what became 0 and 1.
pub(super) fn grey(cloud: &mut Cloud) -> [f32; 2] {
    let finite = || cloud.colour.iter().map(|c| c.x).filter(|x| x.is_finite());
    let (least, greatest) = (finite().fold(0.0, f32::min), finite().fold(0.0, f32::max));
    let (low, high) = if least < 0.0 {
        (least.min(-2048.0), greatest.max(2047.0))
    } else if f64::from(greatest) <= ONE {
        (0.0, 1.0)
    } else {
        (0.0, greatest.max(255.0))
    };
    cloud.colour.iter_mut().for_each(|c| *c = (*c - low) / (high - low));
    [low, high]
}
