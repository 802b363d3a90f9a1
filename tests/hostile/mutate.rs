//! Damage: what a seed becomes. Everything follows from the random numbers of the run.

use std::io::{Read as _, Write as _};

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// Random numbers of a run.
pub(crate) struct Dice(Pcg64Mcg);

impl Dice {
    /// The random numbers of run `number` under a seed.
    pub(crate) fn new(seed: u64, number: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ number))
    }

    /// Less than `count`, which is above 0.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        self.0.random_range(0..count.max(1))
    }

    pub(crate) fn pick<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[self.below(of.len())]
    }

    /// True once in `of` times.
    pub(crate) fn once_in(&mut self, of: usize) -> bool {
        self.below(of) == 0
    }

    /// A place in bytes, one of two times in what is likely to be a header.
    fn place(&mut self, length: usize) -> usize {
        if self.once_in(2) { self.below(length.min(256)) } else { self.below(length) }
    }
}

/// Words that numbers and names become.
const WORDS: [&[u8]; 34] = [
    b"nan",
    b"-nan",
    b"inf",
    b"-inf",
    b"1e999",
    b"-1e999",
    b"-0",
    b"0",
    b"1",
    b"-1",
    b"2",
    b"3",
    b"1e-320",
    b"1e-40",
    b"1e30",
    b"-1e30",
    b"1e18",
    b"3.4e38",
    b"255",
    b"256",
    b"65535",
    b"65536",
    b"2147483647",
    b"2147483648",
    b"4294967295",
    b"4294967296",
    b"-2147483648",
    b"9223372036854775807",
    b"18446744073709551615",
    b"99999999999999999999999",
    b"",
    b"x",
    b"\xff\xfe",
    b"0x10",
];

/// Integers of all widths that counts, sizes and offsets become.
const INTEGERS: [u64; 20] = [
    0,
    1,
    2,
    3,
    7,
    8,
    255,
    256,
    0x7fff,
    0x8000,
    0xffff,
    0x1_0000,
    0xff_ffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    0xffff_ffff_ffff_ffff,
];

const FLOATS: [f32; 14] =
    [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, 0.0, 1.0, -1.0, 1e-45, 1e-38, 3.4e38, -3.4e38, 1e18, 1e9, -1e-9];

/// Damages bytes, in one to four places, most often in one. `others`: files to splice with.
pub(crate) fn damage(bytes: Vec<u8>, others: &[&[u8]], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = bytes;
    for _ in 0..=dice.below(4).min(dice.below(4)).min(dice.below(4)) {
        bytes = once(bytes, others, dice);
    }
    bytes
}

fn once(bytes: Vec<u8>, others: &[&[u8]], dice: &mut Dice) -> Vec<u8> {
    if bytes.is_empty() {
        return b"0".to_vec();
    }
    // Inside what is packed or checked, two times of three.
    if !dice.once_in(3)
        && let Some(damaged) = inside(&bytes, others, dice)
    {
        return damaged;
    }
    let text = bytes.iter().take(400).filter(|b| b.is_ascii_graphic() || b.is_ascii_whitespace()).count();
    if text * 10 > bytes.len().min(400) * 9 && !dice.once_in(4) { words(bytes, dice) } else { raw(bytes, others, dice) }
}

/// Damage within a layer: packed data, chunks with checksums, the text of a container.
fn inside(bytes: &[u8], others: &[&[u8]], dice: &mut Dice) -> Option<Vec<u8>> {
    if bytes.starts_with(&[0x1f, 0x8b]) {
        return Some(gzip(&once(gunzip(bytes), others, dice)));
    }
    if bytes.starts_with(b"NRRD") {
        let body = bytes.windows(2).position(|pair| pair == b"\n\n")? + 2;
        let (header, data) = bytes.split_at(body);
        return Some(if dice.once_in(2) {
            [words(header.to_vec(), dice), data.to_vec()].concat()
        } else if data.starts_with(&[0x1f, 0x8b]) {
            [header.to_vec(), gzip(&raw(gunzip(data), others, dice))].concat()
        } else {
            return None;
        });
    }
    if bytes.starts_with(b"ply") {
        let body = bytes.windows(11).position(|word| word == b"end_header\n")? + 11;
        let (header, data) = bytes.split_at(body);
        return Some(if dice.once_in(2) {
            [words(header.to_vec(), dice), data.to_vec()].concat()
        } else {
            [header.to_vec(), once_plain(data.to_vec(), others, dice)].concat()
        });
    }
    if bytes.starts_with(b"\x89PNG") {
        return Some(png(bytes, others, dice));
    }
    if bytes.starts_with(b"glTF") {
        return glb(bytes, others, dice);
    }
    if bytes.starts_with(b"PK") {
        return zip(bytes, others, dice);
    }
    if bytes.len() > 52 && bytes.starts_with(b"\x89SPLAT\r\n") {
        return Some(sealed(raw(bytes.to_vec(), others, dice)));
    }
    None
}

/// Text or bytes, whatever it looks like.
fn once_plain(bytes: Vec<u8>, others: &[&[u8]], dice: &mut Dice) -> Vec<u8> {
    if bytes.is_ascii() { words(bytes, dice) } else { raw(bytes, others, dice) }
}

/// Damage that knows nothing of what the bytes mean.
fn raw(mut bytes: Vec<u8>, others: &[&[u8]], dice: &mut Dice) -> Vec<u8> {
    if bytes.is_empty() {
        return vec![dice.below(256) as u8];
    }
    let at = dice.place(bytes.len());
    let longest = 1 << dice.below(10);
    let to = (at + 1 + dice.below(longest)).min(bytes.len());
    match dice.below(12) {
        0 => bytes[at] ^= 1 << dice.below(8),
        1 => bytes[at] = *dice.pick(&[0, 1, 0x7f, 0x80, 0xff]),
        2..=4 => {
            let width = *dice.pick(&[2, 4, 4, 8]);
            let value = *dice.pick(&INTEGERS);
            let value = if dice.once_in(4) { value ^ 1 } else { value };
            let mut raw = value.to_le_bytes()[..width].to_vec();
            if dice.once_in(3) {
                raw.reverse();
            }
            // Fields are aligned, more often than not.
            let at = if dice.once_in(4) { at } else { at / width * width };
            put(&mut bytes, at, &raw);
        }
        5 | 6 => {
            let value = *dice.pick(&FLOATS);
            let raw = match dice.below(8) {
                0 | 1 => f64::from(value).to_le_bytes().to_vec(),
                2 => value.to_be_bytes().to_vec(),
                _ => value.to_le_bytes().to_vec(),
            };
            put(&mut bytes, at / 4 * 4, &raw);
        }
        7 => bytes.truncate(at),
        8 => drop(bytes.drain(at..to)),
        9 => {
            let part = bytes[at..to].to_vec();
            let times = 1 + dice.below(3);
            bytes.splice(at..at, part.repeat(times));
        }
        10 => {
            let noise: Vec<u8> = (0..to - at).map(|_| dice.below(256) as u8).collect();
            put(&mut bytes, at, &noise);
        }
        _ => {
            let other = dice.pick(others);
            let from = dice.below(other.len());
            bytes.truncate(at);
            bytes.extend(&other[from.min(other.len())..]);
        }
    }
    bytes
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    for (byte, new) in bytes.iter_mut().skip(at).zip(value) {
        *byte = *new;
    }
}

/// Damage of text: words that become others, lines that go, come twice or change places.
fn words(bytes: Vec<u8>, dice: &mut Dice) -> Vec<u8> {
    let is_word = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'-' | b'+' | b'_');
    let mut spans = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let end = at + bytes[at..].iter().take_while(|b| is_word(**b)).count();
        if end > at {
            spans.push(at..end);
        }
        at = end.max(at + 1);
    }
    if spans.is_empty() || dice.once_in(5) {
        return lines(&bytes, dice);
    }
    let span = dice.pick(&spans).clone();
    let new = match dice.below(8) {
        // A digit more, or one less.
        0 => [&bytes[span.clone()], b"0"].concat(),
        1 => bytes[span.start..span.end - 1].to_vec(),
        2 => bytes[dice.pick(&spans).clone()].to_vec(),
        3 => [b"-", &bytes[span.clone()]].concat(),
        _ => dice.pick(&WORDS).to_vec(),
    };
    let mut bytes = bytes;
    bytes.splice(span, new);
    bytes
}

fn lines(bytes: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut lines: Vec<&[u8]> = bytes.split_inclusive(|b| matches!(b, b'\n' | b'>' | b',' | b';')).collect();
    if lines.is_empty() {
        return b"0".to_vec();
    }
    let (at, to) = (dice.below(lines.len()), dice.below(lines.len()));
    match dice.below(4) {
        0 => drop(lines.remove(at)),
        1 => lines.swap(at, to),
        2 => lines.truncate(at),
        _ => {
            let times = *dice.pick(&[1, 2, 100]);
            lines.splice(at..at, std::iter::repeat_n(lines[at], times).collect::<Vec<_>>());
        }
    }
    lines.concat()
}

/// Damage of a chunk of a PNG file, with its checksum, or of the order of chunks.
fn png(bytes: &[u8], others: &[&[u8]], dice: &mut Dice) -> Vec<u8> {
    let mut chunks: Vec<(Vec<u8>, Vec<u8>)> = Vec::new();
    let mut rest = bytes.get(8..).unwrap_or_default();
    while let Some(head) = rest.first_chunk::<8>() {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(data) = rest.get(8..8 + length) else { break };
        chunks.push((head[4..].to_vec(), data.to_vec()));
        rest = rest.get(12 + length..).unwrap_or_default();
    }
    if chunks.is_empty() {
        return raw(bytes.to_vec(), others, dice);
    }
    let (at, to) = (dice.below(chunks.len()), dice.below(chunks.len()));
    match dice.below(8) {
        0 => drop(chunks.remove(at)),
        1 => chunks.swap(at, to),
        2 => chunks.insert(to, chunks[at].clone()),
        _ => chunks[at].1 = raw(std::mem::take(&mut chunks[at].1), others, dice),
    }
    let mut file = bytes[..8].to_vec();
    for (kind, data) in chunks {
        file.extend((data.len() as u32).to_be_bytes());
        file.extend(&kind);
        file.extend(&data);
        file.extend(crc32fast::hash(&[kind, data].concat()).to_be_bytes());
    }
    file
}

/// Damage of the text or of the buffer of a GLB file, whose lengths are right again afterwards.
fn glb(bytes: &[u8], others: &[&[u8]], dice: &mut Dice) -> Option<Vec<u8>> {
    let length = u32::from_le_bytes(*bytes.get(12..)?.first_chunk()?) as usize;
    let (text, rest) = (bytes.get(20..20 + length)?, bytes.get(20 + length..)?);
    let (text, rest) = if dice.once_in(3) {
        (text.to_vec(), [rest.get(..8)?, &raw(rest.get(8..)?.to_vec(), others, dice)].concat())
    } else {
        (words(text.to_vec(), dice), rest.to_vec())
    };
    let mut text = text;
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = bytes[..8].to_vec();
    file.extend((20 + text.len() as u32 + rest.len() as u32).to_le_bytes());
    file.extend((text.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(text);
    file.extend(rest);
    Some(file)
}

/// Damage of one file of an archive, which is packed again.
fn zip(bytes: &[u8], others: &[&[u8]], dice: &mut Dice) -> Option<Vec<u8>> {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).ok()?;
    let damaged = dice.below(archive.len());
    let mut packed = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).ok()?;
        let (name, mut data) = (entry.name().ok()?.into_owned(), Vec::new());
        entry.read_to_end(&mut data).ok()?;
        if index == damaged {
            if dice.once_in(8) {
                continue;
            }
            data = once_plain(data, others, dice);
        }
        packed.start_file(name, zip::write::SimpleFileOptions::default()).ok()?;
        packed.write_all(&data).ok()?;
    }
    Some(packed.finish().ok()?.into_inner())
}

/// Puts the right checksum into a file of our own format.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    if bytes.len() >= 52 {
        bytes[48..52].fill(0);
        let crc = crc32fast::hash(&bytes);
        bytes[48..52].copy_from_slice(&crc.to_le_bytes());
    }
    bytes
}

pub(crate) fn gzip(plain: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    let written = encoder.write_all(plain);
    written.and_then(|()| encoder.finish()).unwrap_or_default()
}

/// At most a megabyte: seeds hold less.
fn gunzip(packed: &[u8]) -> Vec<u8> {
    let mut plain = Vec::new();
    // A damaged stream gives what comes before the damage.
    let _ = flate2::bufread::GzDecoder::new(packed).take(1 << 20).read_to_end(&mut plain);
    plain
}
