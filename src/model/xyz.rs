//! Points as lines of numbers: `.xyz`, and `.pts` with a line that counts them.
//!
//! There is no standard. Words stand between blanks, commas, semicolons, tabs or `|`; `#` and `//` begin a comment;
//! blank lines do not count. Where columns of an `.xyz` have names, these decide (`xyz_names`), and the mark between
//! them stands between words, which may be empty. Else all points of a file have the same columns:
//!
//! | numbers of a line | `.xyz` | `.pts` |
//! |---|---|---|
//! | 3 | x y z | x y z |
//! | 4 | x y z intensity | x y z intensity |
//! | 6 | x y z and a normal, or r g b | x y z r g b |
//! | 7 | x y z intensity r g b | x y z intensity r g b |
//! | 9 | x y z, a normal and r g b in either order | |
//!
//! Three numbers are a colour if one of the file exceeds 1 (they are then 0..=255), or if none is negative and some
//! have not about length 1; else they are a normal. Intensity shows as grey where there is no colour. A `.pts` file may
//! hold several scans, each with its count.

use glam::{DVec3, Vec3};

use super::cloud::{Cloud, ColourStorage};
use super::colour_by::ColourBy;
use super::error::{ParseError, line_of, quote};
use super::ply_body::number;
use super::xyz_names::{self, Names, ONE, grey};

/// Most numbers of a line.
const WIDEST: usize = 9;
/// Bytes that [`looks_like`] reads.
const SNIFFED: usize = 4096;
/// Lines between two reports of progress.
const REPORT: u64 = 1 << 16;

/// What a text of points begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TextKind {
    /// Points.
    Xyz,
    /// The number of points.
    Pts,
}

/// Tells by its first lines whether a file is a text of points, and which.
pub(super) fn looks_like(bytes: &[u8]) -> Option<TextKind> {
    let head = bytes.get(..SNIFFED).unwrap_or(bytes);
    // A line that is cut off here may be cut in a word.
    let whole = if head.len() < bytes.len() { head.iter().rposition(|&b| b == b'\n').unwrap_or(0) } else { head.len() };
    let head = &head[..whole];
    if let Some((names, mark, rest)) = names(head).ok().flatten() {
        let points = rows(head.get(rest..)?, 1, mark).next();
        return points.filter(|(_, words)| names.fit(words)).map(|_| TextKind::Xyz);
    }
    let mut lines = lines(head, 1, WIDEST).map(|(_, words)| words);
    let is_point = |words: &[&[u8]]| (3..=WIDEST).contains(&words.len()) && words.iter().all(|w| number(w).is_some());
    let first = lines.next()?;
    if is_point(&first) {
        return Some(TextKind::Xyz);
    }
    let counts = matches!(*first, [word] if count(word).is_some());
    (counts && lines.next().is_some_and(|words| is_point(&words))).then_some(TextKind::Pts)
}

/// Reads a file of either kind. `progress` now and then gets the share of the bytes read.
///
/// # Errors
/// The error names the line. A word is no number, lines differ in their columns, there are no such columns, a colour is
/// outside 0..=255, or the points are not as many as counted.
pub(super) fn parse(
    bytes: &[u8],
    kind: TextKind,
    by: Option<&ColourBy>,
    progress: &dyn Fn(f32),
) -> Result<Cloud, ParseError> {
    if kind == TextKind::Xyz
        && let Some((names, mark, rest)) = names(bytes)?
    {
        let body = bytes.get(rest..).unwrap_or_default();
        let first = line_of(bytes, rest);
        let told = |line: u64, words: &[&[u8]]| {
            if line.is_multiple_of(REPORT) {
                progress(words.first().map_or(0.0, |w| offset(bytes, w) as f32 / bytes.len() as f32));
            }
        };
        return xyz_names::parse(&names, rows(body, first, mark), by, &told);
    }
    let mut table = Table::default();
    let mut cloud = Cloud::default();
    // Points that the count still announces, and the line of the count.
    let mut left: Option<(u64, u64)> = None;
    for (line, words) in lines(bytes, 1, WIDEST) {
        if line % REPORT == 0 {
            progress(words.first().map_or(0.0, |w| offset(bytes, w) as f32 / bytes.len() as f32));
        }
        if kind == TextKind::Pts && left.is_none_or(|(left, _)| left == 0) {
            left = Some((announced(&words, line)?, line));
            continue;
        }
        table.push(kind, line, &words)?;
        if let Some((left, _)) = &mut left {
            *left -= 1;
        }
    }
    if let Some((missing @ 1.., line)) = left {
        let found = format!("{missing} points less than this line counts");
        return Err(ParseError::line(line, found, "as many lines as it counts: is the file cut short?"));
    }
    if table.columns == 0 {
        return Err(ParseError::line(1, "no point in the whole file", "lines `x y z ...`"));
    }
    table.fill(kind, &mut cloud)?;
    Ok(cloud)
}

/// Points of rows of numbers whose columns have no names. `value`: the number of a row and a column, both from 0.
///
/// # Errors
/// There are no such columns, or a colour is outside 0..=255. It names the row as a line, from 1.
pub(super) fn of_numbers(
    [rows, columns]: [usize; 2],
    value: impl Fn(usize, usize) -> f64,
    progress: &dyn Fn(f32),
) -> Result<Cloud, ParseError> {
    let mut table = Table::default();
    table.begin(TextKind::Xyz, 1, columns)?;
    for row in 0..rows {
        if (row as u64).is_multiple_of(REPORT) {
            progress(row as f32 / rows as f32);
        }
        let mut values = [0.0; WIDEST];
        values.iter_mut().take(columns).enumerate().for_each(|(column, place)| *place = value(row, column));
        table.add(row as u64 + 1, &values);
    }
    let mut cloud = Cloud::default();
    table.fill(TextKind::Xyz, &mut cloud)?;
    Ok(cloud)
}

/// The count that stands in a line of its own.
fn announced(words: &[&[u8]], line: u64) -> Result<u64, ParseError> {
    match *words {
        [word] => count(word).ok_or_else(|| ParseError::line(line, quote(word), "the number of points")),
        _ => Err(ParseError::line(line, format!("{} words", words.len()), "the number of points, alone in its line")),
    }
}

/// A whole number of points.
fn count(word: &[u8]) -> Option<u64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Where a word of the file begins.
fn offset(bytes: &[u8], word: &[u8]) -> usize {
    (word.as_ptr() as usize).saturating_sub(bytes.as_ptr() as usize)
}

/// The names of the columns, the mark between them if it is no blank, and the byte at which the points below them
/// begin; `None` for a text without names.
///
/// Names stand in the first line with words, if none of these is a number. Else they stand in the last comment before
/// it that fits it, x, y and z among them.
///
/// # Errors
/// The first line has three words or more, none is a number, and x, y or z is not among them.
fn names(bytes: &[u8]) -> Result<Option<(Names, Option<u8>, usize)>, ParseError> {
    let mut in_comment = None;
    for Line { number: line, begin, end, text, comment } in Lines::new(bytes, 1) {
        let found = words(text, xyz_names::MOST);
        if found.is_empty() {
            let named = Names::of_comment(&words(comment, xyz_names::MOST), line);
            in_comment = named.map(|names| (names, mark(comment))).or(in_comment);
            continue;
        }
        if found.len() >= 3 && found.iter().all(|word| number(word).is_none()) {
            let mark = mark(text);
            return Ok(Some((Names::of_line(&cells(text, mark), line)?, mark, end)));
        }
        let fitting = in_comment.filter(|(names, mark)| names.fit(&cells(text, *mark)));
        return Ok(fitting.map(|(names, mark)| (names, mark, begin)));
    }
    Ok(None)
}

/// Lines with words, as (line number, words), from line `first` on. A line has at most `most` + 1 words: one more than
/// `most` is enough to refuse it.
fn lines(bytes: &[u8], first: u64, most: usize) -> impl Iterator<Item = (u64, Vec<&[u8]>)> {
    Lines::new(bytes, first)
        .map(move |line| (line.number, words(line.text, most)))
        .filter(|(_, words)| !words.is_empty())
}

/// Rows of a table whose columns have names: lines with words, as (line number, words).
fn rows(bytes: &[u8], first: u64, mark: Option<u8>) -> impl Iterator<Item = (u64, Vec<&[u8]>)> {
    Lines::new(bytes, first)
        .filter(|line| !line.text.trim_ascii().is_empty())
        .map(move |line| (line.number, cells(line.text, mark)))
        .filter(|(_, words)| !words.is_empty())
}

/// The mark between the names of columns; `None` for blanks.
fn mark(names: &[u8]) -> Option<u8> {
    [b',', b';', b'\t', b'|'].into_iter().find(|mark| names.contains(mark))
}

/// Words of a row of a table. Where a mark stands between its names, what is between two marks is one word, without
/// blanks at its ends and without quotes, and may be empty.
fn cells(text: &[u8], mark: Option<u8>) -> Vec<&[u8]> {
    let Some(mark) = mark.filter(|mark| text.contains(mark)) else { return words(text, xyz_names::MOST) };
    let mut quoted = false;
    let apart = |b: &u8| {
        quoted ^= *b == b'"';
        *b == mark && !quoted
    };
    text.split(apart)
        .take(xyz_names::MOST + 1)
        .map(|word| {
            let word = word.trim_ascii();
            word.strip_prefix(b"\"").and_then(|word| word.strip_suffix(b"\"")).unwrap_or(word)
        })
        .collect()
}

/// Words of a line.
fn words(text: &[u8], most: usize) -> Vec<&[u8]> {
    let apart = |b: &u8| b.is_ascii_whitespace() || matches!(b, b',' | b';' | b'|');
    text.split(apart).filter(|word| !word.is_empty()).take(most + 1).collect()
}

/// A line of a text.
struct Line<'a> {
    number: u64,
    /// Bytes from its first one, and to the first one of the next line.
    begin: usize,
    end: usize,
    /// The text without comments.
    text: &'a [u8],
    /// What follows `#` or `//`.
    comment: &'a [u8],
}

/// All lines. LF, CRLF and CR each end a line.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    number: u64,
}

impl<'a> Lines<'a> {
    /// `first`: number of the first line.
    fn new(bytes: &'a [u8], first: u64) -> Self {
        let mark = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { bytes, at: mark, number: first }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        let (begin, number) = (self.at, self.number);
        let rest = self.bytes.get(begin..).filter(|rest| !rest.is_empty())?;
        let length = rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(rest.len());
        let (line, after) = rest.split_at(length);
        self.at += length + if after.starts_with(b"\r\n") { 2 } else { 1 };
        self.number += 1;
        let hash = line.iter().position(|&b| b == b'#').map(|at| (at, at + 1));
        let slashes = line.windows(2).position(|pair| pair == b"//").map(|at| (at, at + 2));
        let (text, comment) = match hash.into_iter().chain(slashes).min() {
            Some((at, after)) => (&line[..at], &line[after..]),
            None => (line, &line[..0]),
        };
        Some(Line { number, begin, end: self.at.min(self.bytes.len()), text, comment })
    }
}

/// The numbers of all points.
#[derive(Default)]
struct Table {
    /// Numbers of a line; 0 before the first.
    columns: usize,
    /// The line that decided it.
    decided: u64,
    position: Vec<DVec3>,
    /// The numbers after the position, point by point.
    rest: Vec<f32>,
    /// The triples after the position and the intensity.
    triples: [Triple; 2],
}

/// Facts about three columns.
#[derive(Clone, Copy)]
struct Triple {
    least: f32,
    greatest: f32,
    /// First line with a number outside 0..=255.
    outside: Option<u64>,
    /// True while all lengths are about 1, or 0.
    is_unit: bool,
}

impl Default for Triple {
    fn default() -> Self {
        Self { least: f32::INFINITY, greatest: f32::NEG_INFINITY, outside: None, is_unit: true }
    }
}

impl Triple {
    fn add(&mut self, v: &[f32], line: u64) {
        for &x in v {
            self.least = self.least.min(x);
            self.greatest = self.greatest.max(x);
            if !(0.0..=255.0).contains(&x) && self.outside.is_none() {
                self.outside = Some(line);
            }
        }
        let square: f32 = v.iter().map(|x| x * x).sum();
        self.is_unit &= square == 0.0 || (0.81..=1.21).contains(&square);
    }

    fn exceeds_one(&self) -> bool {
        f64::from(self.greatest) > ONE
    }

    /// True for a colour, false for a normal.
    fn is_colour(&self) -> bool {
        self.exceeds_one() || (self.least >= 0.0 && !self.is_unit)
    }
}

impl Table {
    fn push(&mut self, kind: TextKind, line: u64, words: &[&[u8]]) -> Result<(), ParseError> {
        let mut values = [0.0; WIDEST];
        for (value, word) in values.iter_mut().zip(words) {
            *value = number(word).ok_or_else(|| ParseError::line(line, quote(word), "a number"))?;
        }
        self.begin(kind, line, words.len())?;
        self.add(line, &values);
        Ok(())
    }

    /// Checks the number of columns of a line: the first decides.
    fn begin(&mut self, kind: TextKind, line: u64, count: usize) -> Result<(), ParseError> {
        if self.columns == 0 {
            let known = match kind {
                TextKind::Xyz => matches!(count, 3 | 4 | 6 | 7 | 9),
                TextKind::Pts => matches!(count, 3 | 4 | 6 | 7),
            };
            if !known {
                let expected = match kind {
                    TextKind::Xyz => "x y z and then an intensity, a normal, a colour (3, 4, 6, 7 or 9 numbers)",
                    TextKind::Pts => "x y z [intensity] [r g b] (3, 4, 6 or 7 numbers)",
                };
                return Err(ParseError::line(line, shown(count), expected));
            }
            (self.columns, self.decided) = (count, line);
        } else if count != self.columns {
            let expected = format!("{} numbers, as in line {}", self.columns, self.decided);
            return Err(ParseError::line(line, shown(count), expected));
        }
        Ok(())
    }

    fn add(&mut self, line: u64, values: &[f64; WIDEST]) {
        self.position.push(DVec3::new(values[0], values[1], values[2]));
        let narrow = values.map(|x| x as f32);
        let rest = &narrow[3..self.columns];
        let triples = if matches!(self.columns, 4 | 7) { &rest[1..] } else { rest };
        for (triple, v) in self.triples.iter_mut().zip(triples.chunks_exact(3)) {
            triple.add(v, line);
        }
        self.rest.extend_from_slice(rest);
    }

    /// Gives the columns their meaning.
    fn fill(self, kind: TextKind, cloud: &mut Cloud) -> Result<(), ParseError> {
        let Self { columns, position, rest, triples, .. } = self;
        cloud.position = position;
        let extra = columns - 3;
        if extra == 0 {
            return Ok(());
        }
        let intensity = matches!(columns, 4 | 7);
        let begin = usize::from(intensity);
        // The column at which each triple begins, and whether it is a colour.
        let (mut normal, mut colour) = (None, None);
        match columns {
            7 => colour = Some(0),
            6 if kind == TextKind::Pts || triples[0].is_colour() => colour = Some(0),
            6 => normal = Some(0),
            9 if triples[0].is_colour() && !triples[1].exceeds_one() => (colour, normal) = (Some(0), Some(1)),
            9 => (normal, colour) = (Some(0), Some(1)),
            _ => {}
        }
        let vector = |row: &[f32], at: usize| Vec3::new(row[at], row[at + 1], row[at + 2]);
        if let Some(triple) = normal {
            cloud.normal = rest.chunks_exact(extra).map(|row| vector(row, begin + 3 * triple)).collect();
            cloud.notes.push(format!("columns {} to {} are normals", 4 + begin + 3 * triple, 6 + begin + 3 * triple));
        }
        if let Some(triple) = colour {
            let known = &triples[triple];
            let divisor = if known.exceeds_one() { 255.0 } else { 1.0 };
            if let Some(line) = known.outside {
                let found = format!("a colour from {} to {}", known.least, known.greatest);
                return Err(ParseError::line(line, found, "numbers from 0 to 255"));
            }
            cloud.colour = rest.chunks_exact(extra).map(|row| vector(row, begin + 3 * triple) / divisor).collect();
            let range = if divisor == 1.0 { "1, taken as linear" } else { "255" };
            cloud.colour_storage = if divisor == 1.0 { ColourStorage::Float } else { ColourStorage::Integer };
            let first = 4 + begin + 3 * triple;
            cloud.notes.push(format!("columns {first} to {} are colours from 0 to {range}", first + 2));
        } else if intensity {
            cloud.colour = rest.iter().map(|&x| Vec3::splat(x)).collect();
            let [low, high] = grey(cloud);
            cloud.notes.push(format!("no colours: intensity from {low} to {high} is shown as grey"));
        }
        Ok(())
    }
}

/// A line for a message.
fn shown(count: usize) -> String {
    match count {
        1 => "one number".to_owned(),
        _ if count > WIDEST => format!("more than {WIDEST} numbers"),
        _ => format!("{count} numbers"),
    }
}
