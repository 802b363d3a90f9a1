//! The `.anim` file format of Maya's `animImportExport` plug-in. No other file knows it.
//!
//! A file has a header with units, then curves: `anim ADDRESS;` and an `animData` block with keys. Two dialects are
//! refused, because guessing would go unnoticed: Unity's YAML clips, and numbers with commas.
//!
//! This file is longer than most: it holds the whole grammar, one method for each production, so that it can be read
//! beside Maya's documentation.

mod units;
mod words;

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::DVec2;

use super::animation::Animation;
use super::curve::{Curve, Infinity, Options};
use super::error::AnimError;
use super::node::{Attribute, NodeAnimation};
use super::tangent::{RawKey, Tangent};
use words::{Token, Word, Words, shortened};

/// Most notes kept. A hostile file could cause one for each word.
const MAX_NOTES: usize = 32;

/// Reads the text of a `.anim` file; `path` is for messages.
///
/// Bytes that are not UTF-8 are taken as Latin-1. Memory stays below about ten times the text.
///
/// # Errors
/// The text is not a `.anim` file, breaks its grammar, has numbers that are not finite or are written with commas,
/// names unknown units, or has no curve over time.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Animation, AnimError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_or_else(|_| encoding_rs::mem::decode_latin1(bytes), Cow::Borrowed);
    let start = text.trim_start();
    if ["%YAML", "%TAG !u!", "--- !u!"].iter().any(|mark| start.starts_with(mark)) {
        return Err(AnimError::Unity { path: path.to_owned() });
    }
    let mut words = Words::new(&text, path);
    if bytes.contains(&0) {
        return Err(AnimError::NotAnim { at: words.at(), found: "binary data or UTF-16 text".to_owned() });
    }
    match words.take_solid()? {
        Token::Word(word) if word.text == "animVersion" => {}
        token => {
            let found = match token {
                Token::Word(word) => format!("`{}`", shortened(word.text)),
                Token::Eof => "an empty file".to_owned(),
                _ => "a brace".to_owned(),
            };
            return Err(AnimError::NotAnim { at: words.at(), found });
        }
    }
    Reader { words, header: Header::default(), notes: Notes::default(), nodes: Nodes::default() }.read(path)
}

/// The values of the header; `None` where it states none.
#[derive(Default)]
struct Header {
    /// The file has version 1.0: keys have no breakdown column, and curves are weighted unless they say otherwise.
    old: bool,
    /// Maya 2.x wrote the file: its tangents are in Maya's internal units.
    internal_tangents: bool,
    rate: Option<f64>,
    /// Length unit, cm.
    linear: Option<f64>,
    /// Angle unit, degrees.
    angular: Option<f64>,
}

/// The node and attribute that the next curve drives.
struct Address<'a> {
    /// Name of the node; empty if the file names none.
    node: &'a str,
    /// `None` where the curve drives nothing.
    attribute: Option<&'a str>,
}

/// The kind of quantity that a value measures.
#[derive(Clone, Copy, PartialEq)]
enum Quantity {
    Linear,
    Angular,
    Time,
    Unitless,
}

/// The part of an `animData` block read so far. A unit of `None` is the header's.
#[derive(Default)]
struct Block {
    driven: bool,
    output: Option<Quantity>,
    weighted: Option<bool>,
    input_unit: Option<f64>,
    output_unit: Option<f64>,
    angle_unit: Option<f64>,
    pre: Infinity,
    post: Infinity,
    /// Keys as written. The vectors of fixed tangents still hold (angle, weight), because a unit may follow the keys.
    keys: Vec<RawKey>,
}

#[derive(Default)]
struct Notes {
    list: Vec<String>,
    seen: HashSet<String>,
}

impl Notes {
    fn add(&mut self, note: String) {
        if self.seen.len() < MAX_NOTES && self.seen.insert(note.clone()) {
            self.list.push(note);
        } else if self.list.len() == MAX_NOTES && !self.seen.contains(&note) {
            self.list.push("further notes are left out".to_owned());
        }
    }
}

/// Curves by node and attribute, both in file order.
#[derive(Default)]
struct Nodes {
    list: Vec<NodeAnimation>,
    by_name: HashMap<String, usize>,
    by_attribute: HashMap<(usize, String), usize>,
}

impl Nodes {
    /// Adds a curve. Returns false if the attribute already had one, which is replaced.
    fn add(&mut self, node: &str, rate: f64, attribute: Attribute) -> bool {
        let list = &mut self.list;
        let index = *self.by_name.entry(node.to_owned()).or_insert_with(|| {
            list.push(NodeAnimation::new(node.to_owned(), rate));
            list.len() - 1
        });
        let node = &mut list[index];
        let known = *self.by_attribute.entry((index, attribute.name.clone())).or_insert(node.attributes().len());
        node.set(known, attribute)
    }
}

struct Reader<'a> {
    words: Words<'a>,
    header: Header,
    notes: Notes,
    nodes: Nodes,
}

impl<'a> Reader<'a> {
    fn read(mut self, path: &Path) -> Result<Animation, AnimError> {
        self.version()?;
        let mut in_header = true;
        let mut pending: Option<Address<'a>> = None;
        loop {
            match self.words.take_solid()? {
                Token::Eof => break,
                Token::Open => {
                    self.notes.add("a block without a name was skipped".to_owned());
                    self.words.skip_block()?;
                }
                Token::Word(word) if word.text == "anim" => {
                    in_header = false;
                    pending = Some(self.address()?);
                }
                Token::Word(word) if word.text == "animData" => {
                    in_header = false;
                    let Some(address) = pending.take() else {
                        return Err(self
                            .words
                            .expected(Token::Word(word), "`anim` with the address of the curve first"));
                    };
                    self.data(&address)?;
                }
                Token::Word(word) if in_header && self.header_word(word.text)? => {}
                Token::Word(word) => {
                    in_header = false;
                    self.skip(word)?;
                }
                token => return Err(self.words.expected(token, "`anim` or the end of the file")),
            }
        }
        self.finish(path)
    }

    fn version(&mut self) -> Result<(), AnimError> {
        let version = self.words.value("a version such as 1.1")?;
        match version.parse::<f64>() {
            Ok(1.0) => self.header.old = true,
            Ok(1.1) => {}
            _ => self.notes.add(format!("animVersion {} is read as 1.1", shortened(version))),
        }
        Ok(())
    }

    /// Reads a header statement. Returns false if the word does not belong to the header.
    fn header_word(&mut self, word: &str) -> Result<bool, AnimError> {
        match word {
            "mayaVersion" => {
                let mut rest = Vec::new();
                self.words.statement(&mut rest)?;
                self.header.internal_tangents = rest.first().is_some_and(|first| first.text.starts_with("2."));
            }
            "timeUnit" => self.header.rate = Some(self.unit("timeUnit", Quantity::Time)?),
            "linearUnit" => self.header.linear = Some(self.unit("linearUnit", Quantity::Linear)?),
            "angularUnit" => self.header.angular = Some(self.unit("angularUnit", Quantity::Angular)?),
            // This is a clip range for the importer; the curves continue beyond it.
            "startTime" | "endTime" | "startUnitless" | "endUnitless" => {
                let number = self.words.value("a number")?;
                self.words.number(number)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Takes a unit name and returns its size in cm or degrees, or its rate per second.
    fn unit(&mut self, what: &'static str, quantity: Quantity) -> Result<f64, AnimError> {
        let name = self.words.value("a unit")?;
        let (value, known) = match quantity {
            Quantity::Time => (units::time(name), units::TIME_UNITS),
            Quantity::Angular => (units::angular(name), units::ANGULAR_UNITS),
            Quantity::Linear => (units::linear(name), units::LINEAR_UNITS),
            Quantity::Unitless => (Some(1.0), ""),
        };
        value.ok_or_else(|| AnimError::UnknownUnit { at: self.words.at(), what, found: shortened(name), known })
    }

    /// Skips a statement that has no meaning here, and the block that may follow it.
    fn skip(&mut self, word: Word<'_>) -> Result<(), AnimError> {
        self.notes.add(format!(
            "`{}` is not known and was skipped (line {})",
            shortened(word.text),
            self.words.at().line
        ));
        self.words.statement(&mut Vec::new())?;
        if self.words.peek()? == Token::Open {
            self.words.take()?;
            self.words.skip_block()?;
        }
        Ok(())
    }

    /// Reads names, then three integers. A single name is an attribute or, if no curve follows, a node without curves.
    fn address(&mut self) -> Result<Address<'a>, AnimError> {
        let mut words = Vec::new();
        self.words.statement(&mut words)?;
        let begins_with_digit = |w: &Word<'_>| !w.quoted && w.text.starts_with(|c: char| c.is_ascii_digit());
        let names = words.iter().position(begins_with_digit).unwrap_or(words.len());
        if names < words.len() {
            let leaf = |full: &'a str| full.rsplit('.').next().unwrap_or(full);
            match words[..names] {
                [] => return Ok(Address { node: "", attribute: None }),
                [full] => return Ok(Address { node: "", attribute: Some(leaf(full.text)) }),
                [_, attribute, node] => return Ok(Address { node: node.text, attribute: Some(attribute.text) }),
                _ => {}
            }
        }
        let found = words.iter().map(|w| w.text).collect::<Vec<_>>().join(" ");
        Err(AnimError::Expected {
            at: self.words.at(),
            found: format!("address `{}`", shortened(&found)),
            expected: "FULLATTR LEAFATTR NODE, one name or none, then three integers",
        })
    }

    fn data(&mut self, address: &Address<'a>) -> Result<(), AnimError> {
        self.open("`{` after animData")?;
        let mut block = Block::default();
        loop {
            let token = self.words.take_solid()?;
            let Token::Word(word) = token else {
                if token == Token::Close {
                    break;
                }
                return Err(self.words.expected(token, "a word of animData or `}`"));
            };
            match word.text {
                "input" => block.driven = self.choice("time or unitless", &[("time", false), ("unitless", true)])?,
                "output" => block.output = Some(self.choice("linear, angular, unitless or time", OUTPUTS)?),
                "weighted" => block.weighted = Some(self.choice("0 or 1", &[("0", false), ("1", true)])?),
                // The input unit of a driven curve may be anything: the curve is skipped.
                "inputUnit" if block.driven => {
                    self.words.value("a unit")?;
                }
                "inputUnit" => block.input_unit = Some(self.unit("inputUnit", Quantity::Time)?),
                "outputUnit" => {
                    let quantity = quantity(block.output, address);
                    block.output_unit = Some(self.unit("outputUnit", quantity)?);
                }
                "tangentAngleUnit" => block.angle_unit = Some(self.unit("tangentAngleUnit", Quantity::Angular)?),
                "preInfinity" => block.pre = self.infinity()?,
                "postInfinity" => block.post = self.infinity()?,
                "keys" => self.keys(&mut block.keys)?,
                _ => self.skip(word)?,
            }
        }
        self.curve(address, block);
        Ok(())
    }

    fn open(&mut self, expected: &'static str) -> Result<(), AnimError> {
        match self.words.take_solid()? {
            Token::Open => Ok(()),
            token => Err(self.words.expected(token, expected)),
        }
    }

    fn choice<T: Copy>(&mut self, expected: &'static str, choices: &[(&str, T)]) -> Result<T, AnimError> {
        let text = self.words.value(expected)?;
        let found = choices.iter().find(|(name, _)| *name == text).map(|&(_, value)| value);
        found.ok_or_else(|| self.words.expected(Token::Word(Word { text, quoted: false }), expected))
    }

    fn infinity(&mut self) -> Result<Infinity, AnimError> {
        let name = self.words.value("an infinity such as constant")?;
        Ok(match name {
            "constant" => Infinity::Constant,
            "linear" => Infinity::Linear,
            "cycle" => Infinity::Cycle,
            "cycleRelative" => Infinity::CycleRelative,
            "oscillate" => Infinity::Oscillate,
            _ => {
                self.notes.add(format!("infinity `{}` is not known and counts as constant", shortened(name)));
                Infinity::Constant
            }
        })
    }

    fn keys(&mut self, keys: &mut Vec<RawKey>) -> Result<(), AnimError> {
        self.open("`{` after keys")?;
        let mut words = Vec::new();
        loop {
            match self.words.take_solid()? {
                Token::Close => return Ok(()),
                Token::Word(word) => {
                    words.clear();
                    words.push(word);
                    self.words.statement(&mut words)?;
                    keys.push(self.key(&words)?);
                }
                token => return Err(self.words.expected(token, "a key or `}`")),
            }
        }
    }

    fn key(&mut self, words: &[Word<'_>]) -> Result<RawKey, AnimError> {
        const LAYOUT: &str =
            "TIME VALUE INTANGENT OUTTANGENT LOCK LOCK, and an angle and a weight for each fixed tangent";
        let short = |reader: &Self| AnimError::Expected {
            at: reader.words.at(),
            found: format!("a key of {} words", words.len()),
            expected: LAYOUT,
        };
        let [time, value, inward, outward, _, _, rest @ ..] = words else {
            // A comma inside a number explains a short key better than its length does.
            for word in words.iter().take(2) {
                self.words.number(word.text)?;
            }
            return Err(short(self));
        };
        let point = DVec2::new(self.words.number(time.text)?, self.words.number(value.text)?);
        // In version 1.1 a breakdown flag precedes the pairs.
        let mut rest = rest.iter().skip(usize::from(!self.header.old));
        let mut tangent = |reader: &mut Self, name: &str| -> Result<Tangent, AnimError> {
            if name != "fixed" {
                return Ok(reader.tangent(name));
            }
            let (Some(angle), Some(weight)) = (rest.next(), rest.next()) else { return Err(short(reader)) };
            Ok(Tangent::Fixed(DVec2::new(reader.words.number(angle.text)?, reader.words.number(weight.text)?)))
        };
        let inward = tangent(self, inward.text)?;
        Ok(RawKey { point, inward, outward: tangent(self, outward.text)? })
    }

    fn tangent(&mut self, name: &str) -> Tangent {
        // Maya 2023 writes its new names in several cases; the old names are all lower-case.
        let lower = name.to_ascii_lowercase();
        match lower.as_str() {
            // Maya evaluates slow and fast as linear since it dropped them from the user interface.
            "linear" | "slow" | "fast" => Tangent::Linear,
            "flat" => Tangent::Flat,
            "spline" => Tangent::Spline,
            "step" => Tangent::Step,
            "stepnext" => Tangent::StepNext,
            "clamped" => Tangent::Clamped,
            "plateau" => Tangent::Plateau,
            "auto" | "global" | "autocustom" => Tangent::Auto,
            "automix" => Tangent::AutoMix,
            "autoease" => Tangent::AutoEase,
            _ => {
                self.notes.add(format!("tangent type `{}` is not known and counts as auto", shortened(name)));
                Tangent::Auto
            }
        }
    }

    /// Turns a finished block into a curve, or into a note that says why not.
    fn curve(&mut self, address: &Address<'_>, mut block: Block) {
        let line = self.words.at().line;
        let Some(attribute) = address.attribute else {
            return self.notes.add(format!("a curve that drives no attribute was skipped (before line {line})"));
        };
        let name = |node: &str| {
            let dot = if node.is_empty() { "" } else { "." };
            shortened(&format!("{node}{dot}{attribute}"))
        };
        if block.driven {
            let name = name(address.node);
            return self.notes.add(format!("{name} is driven by another value, not by time, and was skipped"));
        }
        let file_rate = self.header.rate.unwrap_or(24.0);
        let rate = block.input_unit.unwrap_or(file_rate);
        let quantity = quantity(block.output, address);
        let value = match quantity {
            Quantity::Linear => block.output_unit.or(self.header.linear).unwrap_or(1.0),
            Quantity::Angular => block.output_unit.or(self.header.angular).unwrap_or(1.0),
            Quantity::Time => block.output_unit.map_or(1.0, |unit| file_rate / unit),
            Quantity::Unitless => 1.0,
        };
        // Tangents are in cm or radians a second: tan(new) = y tan(old) / x.
        let internal = if self.header.internal_tangents {
            let units = match quantity {
                Quantity::Linear => 1.0 / value,
                Quantity::Angular => 1f64.to_degrees() / value,
                Quantity::Time => rate,
                Quantity::Unitless => 1.0,
            };
            units / rate
        } else {
            1.0
        };
        let weighted = block.weighted.unwrap_or(self.header.old);
        let degrees = block.angle_unit.or(self.header.angular).unwrap_or(1.0);
        for key in &mut block.keys {
            for tangent in [&mut key.inward, &mut key.outward] {
                if let Tangent::Fixed(written) = tangent {
                    let weight = if weighted { written.y } else { 1.0 };
                    *written = 3.0 * weight * direction((written.x * degrees).to_radians(), internal);
                }
            }
        }
        let options =
            Options { weighted, pre: block.pre, post: block.post, factor: DVec2::new(file_rate / rate, value) };
        match Curve::new(block.keys, &options) {
            None => self.notes.add(format!("{} has no keys and was skipped", name(address.node))),
            Some(curve) => {
                let added = Attribute { name: attribute.to_owned(), curve };
                if !self.nodes.add(address.node, file_rate, added) {
                    self.notes.add(format!("{} has several curves; the last one counts", name(address.node)));
                }
            }
        }
    }

    fn finish(mut self, path: &Path) -> Result<Animation, AnimError> {
        if self.nodes.list.is_empty() {
            return Err(AnimError::NoCurves { path: path.to_owned(), notes: self.notes.list });
        }
        let defaults = [
            (self.header.rate.is_none(), "no timeUnit: film, 24 frames a second, is assumed"),
            (self.header.linear.is_none(), "no linearUnit: cm is assumed"),
            (self.header.angular.is_none(), "no angularUnit: deg is assumed"),
        ];
        for (missing, note) in defaults {
            if missing {
                self.notes.add(note.to_owned());
            }
        }
        Ok(Animation::assemble(path, self.header.rate.unwrap_or(24.0), self.nodes.list, self.notes.list))
    }
}

const OUTPUTS: &[(&str, Quantity)] = &[
    ("linear", Quantity::Linear),
    ("angular", Quantity::Angular),
    ("unitless", Quantity::Unitless),
    ("time", Quantity::Time),
];

/// The quantity of a curve's values. The format's default is linear; a rotation can only have angles.
fn quantity(output: Option<Quantity>, address: &Address<'_>) -> Quantity {
    let rotation = address.attribute.is_some_and(|a| matches!(a, "rotateX" | "rotateY" | "rotateZ"));
    output.unwrap_or(if rotation { Quantity::Angular } else { Quantity::Linear })
}

/// Unit vector at `angle` (radians) after its slope is multiplied by `factor`.
fn direction(angle: f64, factor: f64) -> DVec2 {
    let (sin, cos) = libm::sincos(angle);
    if factor == 1.0 {
        return DVec2::new(cos, sin);
    }
    let scaled = DVec2::new(cos, sin * factor);
    scaled / libm::hypot(scaled.x, scaled.y)
}

#[cfg(test)]
mod tests;
