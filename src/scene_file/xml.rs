//! XML to [`Element`]s: the only file that knows XML.
//!
//! Scenes come from strangers. Everything costs time and memory linear in the file, which is capped; there is no
//! document type, nothing is fetched and no entity beyond the five of XML is expanded.

use std::path::Path;

use encoding_rs::{DecoderResult, Encoding, UTF_8};
use quick_xml::errors::IllFormedError;
use quick_xml::escape::EscapeError;
use quick_xml::events::attributes::AttrError;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Error, Reader, XmlVersion};

use super::dom::{Attribute, Element, Source};
use super::error::{SceneError, quoted};
use crate::files::{self, InputError};

/// Most bytes of a scene file.
const MOST_BYTES: u64 = 64_000_000;
/// Most elements inside each other; a scene has four.
const MOST_DEPTH: usize = 16;
/// Most attributes of one element; scenes use at most seven.
const MOST_ATTRIBUTES: usize = 64;
/// Most elements and attributes of a file, which bounds the memory of the tree to a small multiple of the file's.
/// An ordinary object has about ten, so that objects fill a file first.
const MOST_PARTS: usize = 4_000_000;

/// Reads a scene file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, SceneError> {
    let path_of = || path.to_owned();
    files::read(path, MOST_BYTES).map_err(|why| match why {
        InputError::NotAFile { found } => SceneError::NotAFile { path: path_of(), found },
        InputError::TooLarge { most, .. } => SceneError::TooLarge { path: path_of(), limit: most },
        InputError::Changed(changed) => changed.into(),
        other => SceneError::Read { path: path_of(), source: other.into() },
    })
}

/// Bytes to text: a byte order mark wins, then the XML declaration, then UTF-8.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<Source, SceneError> {
    let refuse = |text: String, found: String, expected| {
        let source = Source::new(path, text);
        SceneError::Encoding { at: source.locate(source.text().len()), found, expected }
    };
    let (encoding, bytes) = if let Some((encoding, mark)) = Encoding::for_bom(bytes) {
        (encoding, &bytes[mark..])
    } else if matches!(bytes, [b'<', 0, ..] | [0, b'<', ..]) {
        let found = "UTF-16 without a byte order mark".to_owned();
        return Err(refuse(String::new(), found, "UTF-8, or UTF-16 with a byte order mark"));
    } else {
        let encoding = match declared(bytes) {
            None => UTF_8,
            Some(label) => match Encoding::for_label_no_replacement(label.as_bytes()) {
                Some(e) if e.is_ascii_compatible() => e,
                _ => {
                    let found = format!("encoding {}", quoted(&label));
                    return Err(refuse(String::new(), found, "one like UTF-8 or ISO-8859-1"));
                }
            },
        };
        (encoding, bytes)
    };
    let mut decoder = encoding.new_decoder_without_bom_handling();
    let room = decoder.max_utf8_buffer_length_without_replacement(bytes.len()).unwrap_or(0);
    let mut text = String::with_capacity(room);
    if let (DecoderResult::Malformed(..), _) = decoder.decode_to_string_without_replacement(bytes, &mut text, true) {
        let found = format!("bytes that are not {}", encoding.name());
        return Err(refuse(text, found, "text in the encoding that the XML declaration names (default: UTF-8)"));
    }
    text.shrink_to_fit();
    if let Some(i) = text.find(|c: char| !is_xml(c)) {
        text.truncate(i);
        return Err(refuse(text, "a control character".to_owned(), "an XML text file"));
    }
    Ok(Source::new(path, text))
}

/// The encoding that the XML declaration names, if any.
fn declared(bytes: &[u8]) -> Option<String> {
    let head = encoding_rs::mem::decode_latin1(&bytes[..bytes.len().min(1024)]);
    match Reader::from_str(&head).read_event() {
        Ok(Event::Decl(decl)) => decl.encoding()?.ok().map(std::borrow::Cow::into_owned),
        _ => None,
    }
}

/// Characters that XML 1.0 allows.
pub(super) fn is_xml(c: char) -> bool {
    matches!(c, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..)
}

/// The root element of a document.
pub(super) fn parse(source: &Source) -> Result<Element, SceneError> {
    let mut tree = Tree { source, open: Vec::new(), root: None, parts: 0 };
    let mut reader = Reader::from_str(source.text());
    reader.config_mut().check_comments = false;
    loop {
        let at = reader.buffer_position() as usize;
        match reader.read_event() {
            Ok(Event::Eof) => return tree.finish(),
            Ok(event) => tree.event(at, &event)?,
            Err(e) => return Err(tree.broken(reader.error_position() as usize, &e)),
        }
    }
}

/// The tree under construction.
struct Tree<'a> {
    source: &'a Source,
    open: Vec<Element>,
    root: Option<Element>,
    /// Elements and attributes.
    parts: usize,
}

impl Tree<'_> {
    fn event(&mut self, at: usize, event: &Event<'_>) -> Result<(), SceneError> {
        match event {
            Event::Start(tag) => {
                let element = self.element(at, tag)?;
                self.open.push(element);
            }
            Event::Empty(tag) => {
                let element = self.element(at, tag)?;
                self.close(element);
            }
            Event::End(_) => {
                if let Some(element) = self.open.pop() {
                    self.close(element);
                }
            }
            Event::Text(text) => self.text(at, &text.xml10_content())?,
            Event::CData(text) => self.text(at, &text.xml10_content())?,
            Event::GeneralRef(name) => {
                let c = reference(name).ok_or_else(|| self.entity(at, &format!("&{};", &**name)))?;
                self.text(at, c.encode_utf8(&mut [0; 4]))?;
            }
            Event::DocType(_) => {
                return Err(self.syntax(at, "a document type (<!DOCTYPE>)", "none: scenes define no entities"));
            }
            Event::Decl(_) if at > 0 => {
                return Err(self.syntax(at, "an XML declaration", "it only at the very start of the file"));
            }
            Event::Decl(_) | Event::Comment(_) | Event::PI(_) | Event::Eof => {}
        }
        Ok(())
    }

    fn element(&mut self, at: usize, tag: &BytesStart<'_>) -> Result<Element, SceneError> {
        if let Some(root) = &self.root {
            let found = format!("a second root element <{}>", short(tag.name().0));
            return Err(self.syntax(at, found, format!("only <{}>", short(&root.name))));
        }
        if self.open.len() >= MOST_DEPTH {
            return Err(self.syntax(at, "deeper nesting", format!("at most {MOST_DEPTH} elements inside each other")));
        }
        if tag.name().0.is_empty() {
            return Err(self.syntax(at, "a tag without a name", "a name after `<`"));
        }
        let mut attributes: Vec<Attribute> = Vec::new();
        let mut iter = tag.attributes();
        for attribute in iter.with_checks(false) {
            let attribute = attribute.map_err(|e| self.bad_attribute(at, &e))?;
            // The name is a slice of the tag, so its address tells where it stands.
            let name = attribute.key.0;
            let at = at + 1 + (name.as_ptr() as usize).saturating_sub(tag.as_ptr() as usize);
            if attributes.len() == MOST_ATTRIBUTES {
                return Err(self.syntax(at, "more attributes", format!("at most {MOST_ATTRIBUTES} on one element")));
            }
            let own = spelled(name);
            if attributes.iter().any(|a| a.name == own) {
                return Err(self.syntax(at, format!("a second attribute {}", quoted(name)), "each at most once"));
            }
            if attribute.value.contains('<') {
                return Err(self.syntax(at, format!("`<` in the value of {}", quoted(name)), "`&lt;`"));
            }
            let value = match attribute.normalized_value(XmlVersion::Explicit1_0) {
                Ok(value) if value.chars().all(is_xml) => value.into_owned(),
                Ok(_) => return Err(self.entity(at, "a reference to a control character")),
                Err(Error::Escape(EscapeError::UnrecognizedEntity(_, name))) => {
                    return Err(self.entity(at, &format!("&{name};")));
                }
                Err(_) => return Err(self.entity(at, &attribute.value)),
            };
            attributes.push(Attribute { name: own, value, at });
        }
        self.parts += 1 + attributes.len();
        if self.parts > MOST_PARTS {
            let expected = format!("at most {MOST_PARTS} elements and attributes");
            return Err(self.syntax(at, "more elements", expected));
        }
        Ok(Element { name: tag.name().0.to_owned(), at, attributes, text_at: at, ..Element::default() })
    }

    fn close(&mut self, mut element: Element) {
        element.text.truncate(element.text.trim_end().len());
        match self.open.last_mut() {
            Some(parent) => parent.children.push(element),
            None => self.root = Some(element),
        }
    }

    fn text(&mut self, at: usize, text: &str) -> Result<(), SceneError> {
        let Some(element) = self.open.last_mut() else {
            let trimmed = text.trim_start();
            if trimmed.is_empty() {
                return Ok(());
            }
            let at = at + text.len() - trimmed.len();
            let expected = if self.root.is_some() { "the end of the file" } else { "an XML document: <scene> ..." };
            return Err(self.stray(at, trimmed.trim_end(), expected));
        };
        if element.text.is_empty() {
            let trimmed = text.trim_start();
            element.text_at = at + text.len() - trimmed.len();
            element.text.push_str(trimmed);
        } else {
            element.text.push_str(text);
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Element, SceneError> {
        if let Some(element) = self.open.pop() {
            let found = format!("the end of the file inside <{}>", short(&element.name));
            let end = self.source.text().trim_end().len();
            let start = self.source.locate(element.at);
            let expected = format!("</{}> (opened in line {})", short(&element.name), start.line);
            return Err(self.syntax(end, found, expected));
        }
        let end = self.source.text().len();
        self.root.take().ok_or_else(|| self.syntax(end, "no element", "<scene>"))
    }

    fn syntax(&self, at: usize, found: impl Into<String>, expected: impl Into<String>) -> SceneError {
        SceneError::Syntax { at: self.source.locate(at), found: found.into(), expected: expected.into() }
    }

    fn stray(&self, at: usize, text: &str, expected: &str) -> SceneError {
        if is_dashes(text) {
            return self.syntax(at, "a dash before a tag", DASHES);
        }
        self.syntax(at, format!("text {}", quoted(text)), expected)
    }

    fn entity(&self, at: usize, found: &str) -> SceneError {
        let expected = "one of &amp; &lt; &gt; &quot; &apos; or a character like &#233;";
        self.syntax(at, quoted(found), expected)
    }

    /// An attribute that quick-xml refuses; its positions count from behind the `<`.
    fn bad_attribute(&self, tag: usize, error: &AttrError) -> SceneError {
        let (at, found) = match *error {
            AttrError::ExpectedEq(at) | AttrError::ExpectedValue(at) => (at, "an attribute without a value"),
            AttrError::UnquotedValue(at) => (at, "an attribute value without quotes"),
            AttrError::ExpectedQuote(at, _) => (at, "an attribute value without its closing quote"),
            AttrError::Duplicated(at, _) => (at, "an attribute that was there before"),
        };
        self.syntax(tag + 1 + at, found, "name=\"value\"")
    }

    /// What quick-xml refuses.
    fn broken(&self, at: usize, error: &Error) -> SceneError {
        let name = self.open.last().map(|e| short(&e.name));
        let expected = match (error, name) {
            (Error::IllFormed(_), Some(name)) => format!("</{name}> to close <{name}>"),
            _ => "well-formed XML".to_owned(),
        };
        let found = match error {
            Error::IllFormed(
                IllFormedError::MismatchedEndTag { found, .. } | IllFormedError::UnmatchedEndTag(found),
            ) => format!("</{}>", short(found)),
            Error::IllFormed(IllFormedError::UnclosedReference) => return self.entity(at, "&"),
            other => other.to_string(),
        };
        self.syntax(at, found, expected)
    }
}

/// What to do about a scene that was copied from a browser's window.
pub(super) const DASHES: &str =
    "XML as it is in the file: this looks copied from a browser, which draws dashes; remove the dashes";

/// True for the dashes that browsers draw before elements that can be folded.
pub(super) fn is_dashes(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_whitespace() || matches!(c, '-' | '+' | '\u{2212}' | '\u{2013}'))
}

/// A name for messages: quoted without the quotes.
fn short(name: &str) -> String {
    quoted(name).trim_matches('`').to_owned()
}

fn reference(name: &quick_xml::events::BytesRef<'_>) -> Option<char> {
    match &**name {
        "amp" => Some('&'),
        "lt" => Some('<'),
        "gt" => Some('>'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => name.resolve_char_ref().ok().flatten().filter(|&c| is_xml(c)),
    }
}

/// The name of an attribute in the spelling of the schema. American spellings are taken, too.
fn spelled(name: &str) -> String {
    let words = [("color", "colour"), ("Color", "Colour"), ("center", "centre"), ("gray", "grey")];
    // A file has millions of names, and few of them have such a word.
    let there = words.into_iter().filter(|(american, _)| name.contains(american));
    there.fold(name.to_owned(), |name, (american, british)| name.replace(american, british))
}
