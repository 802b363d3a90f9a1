//! The grammar of NRRD headers: lines `field: text` up to an empty line.
//!
//! Fields count in any letter case and order. Comments, pairs `key:=value` and fields that say nothing about places and
//! bytes are passed over.

use glam::DVec3;

use crate::model::error::{ParseError, quote};

/// Longest header that is read, bytes. Real headers have a few hundred.
const MAX_HEADER: usize = 1 << 20;

/// Fields that are read, in the form that [`field_name`] gives.
const FIELDS: [&str; 16] = [
    "dimension",
    "type",
    "encoding",
    "endian",
    "sizes",
    "spacings",
    "axis mins",
    "axis maxs",
    "centerings",
    "kinds",
    "space",
    "space dimension",
    "space directions",
    "space origin",
    "line skip",
    "byte skip",
];

/// Name of a field: lower case, and of several spellings the first.
fn field_name(name: &str) -> String {
    let name = name.trim().to_ascii_lowercase();
    match name.as_str() {
        "axismins" => "axis mins".to_owned(),
        "axismaxs" => "axis maxs".to_owned(),
        "centers" => "centerings".to_owned(),
        "lineskip" => "line skip".to_owned(),
        "byteskip" => "byte skip".to_owned(),
        "datafile" => "data file".to_owned(),
        _ => name,
    }
}

/// A field of the file.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) line: u64,
    pub(super) text: String,
}

impl Field {
    pub(super) fn fault(&self, what: &str, expected: impl Into<String>) -> ParseError {
        ParseError::line(self.line, format!("{what} {}", quote(self.text.as_bytes())), expected)
    }

    pub(super) fn words(&self) -> Vec<&str> {
        self.text.split_ascii_whitespace().collect()
    }

    /// One number for each axis; NaN for those that are not known.
    pub(super) fn numbers(&self, what: &str, axes: usize) -> Result<Vec<f64>, ParseError> {
        let numbers: Option<Vec<f64>> = self.words().into_iter().map(|word| word.parse().ok()).collect();
        let numbers = numbers.filter(|numbers| numbers.len() == axes && !numbers.iter().any(|x| x.is_infinite()));
        numbers.ok_or_else(|| self.fault(what, format!("{axes} numbers, one for each axis")))
    }

    /// Vectors `(x,y,z)`, or `none`.
    pub(super) fn vectors(&self, what: &str, count: usize) -> Result<Vec<Option<DVec3>>, ParseError> {
        let refuse = || self.fault(what, format!("{count} times `(x,y,z)` or `none`, of finite numbers"));
        let mut vectors = Vec::new();
        let mut rest = self.text.trim();
        while !rest.is_empty() {
            if let Some(after) = rest.strip_prefix("none") {
                vectors.push(None);
                rest = after.trim_start();
                continue;
            }
            let inside = rest.strip_prefix('(').and_then(|rest| rest.split_once(')'));
            let (inside, after) = inside.ok_or_else(refuse)?;
            let numbers: Option<Vec<f64>> = inside.split(',').map(|word| word.trim().parse().ok()).collect();
            let [x, y, z] = numbers.as_deref().unwrap_or_default() else { return Err(refuse()) };
            vectors.push(Some(DVec3::new(*x, *y, *z)).filter(|v| v.is_finite()));
            if vectors.last() == Some(&None) {
                return Err(refuse());
            }
            rest = after.trim_start();
        }
        if vectors.len() == count { Ok(vectors) } else { Err(refuse()) }
    }
}

/// The fields of a header, each at the index of [`FIELDS`].
pub(super) struct Fields {
    found: [Option<Field>; FIELDS.len()],
    /// Offset of the first byte after the empty line.
    pub(super) body: usize,
    /// Lines of the header, the empty one included.
    pub(super) lines: u64,
}

impl Fields {
    pub(super) fn read(bytes: &[u8]) -> Result<Self, ParseError> {
        let window = bytes.get(..MAX_HEADER).unwrap_or(bytes);
        let mut fields = Self { found: std::array::from_fn(|_| None), body: 0, lines: 0 };
        loop {
            fields.lines += 1;
            let rest = window.get(fields.body..).unwrap_or_default();
            let Some(length) = rest.iter().position(|b| *b == b'\n') else {
                let capped = bytes.len() > MAX_HEADER;
                let found = if capped { "a header longer than 1 MiB" } else { "the end of the file" };
                return Err(ParseError::line(fields.lines, found, "an empty line, and the values after it"));
            };
            fields.body += length + 1;
            let line = rest.get(..length).unwrap_or_default();
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            if fields.lines == 1 {
                check_magic(line)?;
            } else if line.is_empty() {
                return Ok(fields);
            } else {
                fields.add(&String::from_utf8_lossy(line))?;
            }
        }
    }

    fn add(&mut self, line: &str) -> Result<(), ParseError> {
        if line.starts_with('#') {
            return Ok(());
        }
        let Some((name, text)) = line.split_once(':') else {
            let expected = "`field: text`, `key:=value`, `# comment` or an empty line";
            return Err(ParseError::line(self.lines, quote(line.as_bytes()), expected));
        };
        // A pair of a key and a value.
        if text.starts_with('=') {
            return Ok(());
        }
        let name = field_name(name);
        let field = Field { line: self.lines, text: text.trim().to_owned() };
        if name == "data file" {
            let found = format!("a detached header (`data file: {}`)", field.text.escape_debug());
            let found: String = found.chars().take(100).collect();
            return Err(ParseError::line(self.lines, found, "the data in the same file (attached)"));
        }
        if let Some(index) = FIELDS.iter().position(|known| *known == name) {
            if self.found[index].is_some() {
                return Err(ParseError::line(self.lines, format!("a second field `{name}`"), "each field once"));
            }
            self.found[index] = Some(field);
        }
        Ok(())
    }

    pub(super) fn get(&self, name: &str) -> Option<&Field> {
        let index = FIELDS.iter().position(|known| *known == name)?;
        self.found[index].as_ref()
    }

    pub(super) fn required(&self, name: &str) -> Result<&Field, ParseError> {
        let expected = "fields `type`, `dimension`, `sizes` and `encoding`";
        self.get(name).ok_or_else(|| ParseError::line(self.lines, format!("no field `{name}`"), expected))
    }

    /// A whole number; 0 if it is not there.
    pub(super) fn whole(&self, name: &str) -> Result<Option<i64>, ParseError> {
        let Some(field) = self.get(name) else { return Ok(Some(0)) };
        match field.text.parse::<i64>() {
            Ok(n) if n >= 0 => Ok(Some(n)),
            Ok(-1) if name == "byte skip" => Ok(None),
            _ => Err(field.fault(&format!("{name} of"), "a whole number from 0")),
        }
    }
}

fn check_magic(line: &[u8]) -> Result<(), ParseError> {
    let version = line.strip_prefix(b"NRRD000");
    match version {
        Some([b'1'..=b'5']) => Ok(()),
        _ => Err(ParseError::line(1, quote(line), "`NRRD0001` to `NRRD0005`")),
    }
}
