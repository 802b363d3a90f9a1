//! LAS, versions 1.0 to 1.4 (ASPRS), and its packed form LAZ, of which COPC is an order of chunks.
//!
//! What the header (`las_header`) claims is held against the size of the file before anything is made of it.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::common::{Thinning, check_count, grey};
use super::las_header::{Header, PointBlock};
use super::laz::{Chunk, Chunks};
use crate::model::cloud::{Cloud, ColourStorage};
use crate::model::error::ParseError;
use crate::model::options::PointOptions;

/// Points that are decoded at a time.
const BLOCK: usize = 1 << 16;
/// Blocks or chunks that wait to be put in order.
const WAITING: usize = 32;
/// Byte at which a header says where points begin.
const DATA_AT: usize = 96;
/// Classes that a note names.
const SHOWN: usize = 12;
/// One point in so many may be brighter than a colour of 8 bits where all others have 8: a slip of a program.
const BRIGHT: usize = 1000;
/// The classes of ASPRS LAS 1.4 that people filter by; the others are numbers.
const CLASS_NAMES: [(u8, &str); 10] = [
    (1, "unclassified"),
    (2, "ground"),
    (3, "low vegetation"),
    (4, "medium vegetation"),
    (5, "high vegetation"),
    (6, "building"),
    (7, "noise"),
    (9, "water"),
    (17, "bridge"),
    (18, "high noise"),
];

/// Names of the columns of numbers, as laspy has them.
const COLUMNS: [&str; 12] = [
    "intensity",
    "classification",
    "return_number",
    "number_of_returns",
    "scan_angle",
    "user_data",
    "point_source_id",
    "gps_time",
    "red",
    "green",
    "blue",
    "nir",
];

/// A column of numbers by its name; `None` where points have none.
fn column<'a>(data: &'a PointBlock, name: &str) -> Option<Box<dyn Iterator<Item = f64> + 'a>> {
    Some(match name {
        "intensity" => Box::new(data.intensity().map(f64::from)),
        "classification" => Box::new(data.classification().map(f64::from)),
        "return_number" => Box::new(data.return_number().map(f64::from)),
        "number_of_returns" => Box::new(data.number_of_returns().map(f64::from)),
        "scan_angle" => Box::new(data.scan_angle_degrees().map(f64::from)),
        "user_data" => Box::new(data.user_data().map(f64::from)),
        "point_source_id" => Box::new(data.point_source_id().map(f64::from)),
        "gps_time" => Box::new(data.gps_time()?),
        "red" => Box::new(data.rgb()?.map(|(red, _, _)| f64::from(red))),
        "green" => Box::new(data.rgb()?.map(|(_, green, _)| f64::from(green))),
        "blue" => Box::new(data.rgb()?.map(|(_, _, blue)| f64::from(blue))),
        "nir" => Box::new(data.nir()?.map(f64::from)),
        _ => return None,
    })
}

/// Points as the file has them, without those that are not wanted.
#[derive(Default)]
struct Gathered {
    position: Vec<DVec3>,
    /// Empty where the format has none.
    colour: Vec<[u16; 3]>,
    intensity: Vec<u16>,
    /// Values of the column that colours them; empty where there is none.
    value: Vec<f64>,
    /// Points of each class of the file, the unwanted included.
    classes: BTreeMap<u8, u64>,
    withheld: u64,
}

impl Gathered {
    /// The points of some records that are of a wanted class, and not withheld.
    fn of(data: &PointBlock, options: &PointOptions) -> Self {
        let mut gathered = Self::default();
        let mut classes = [0; 256];
        let extended = data.format().is_extended;
        let places = data.x().zip(data.y()).zip(data.z());
        let mut colours = data.rgb();
        let mut values = options.colour_by.as_ref().and_then(|by| column(data, &by.name()));
        let flags = data.raw_bytes().chunks_exact(data.record_len().max(1));
        for ((((x, y), z), (class, intensity)), record) in
            places.zip(data.classification().zip(data.intensity())).zip(flags)
        {
            let colour = colours.as_mut().and_then(Iterator::next);
            let value = values.as_mut().and_then(Iterator::next);
            // Bit 2 of the flags, which older formats have above the class.
            let withheld = if extended { record[15] & 0b100 != 0 } else { record[15] & 0b1000_0000 != 0 };
            gathered.withheld += u64::from(withheld);
            classes[usize::from(class)] += 1;
            let wanted = options.classes.is_empty() || options.classes.contains(&class);
            if withheld || !wanted {
                continue;
            }
            gathered.position.push(DVec3::new(x, y, z));
            gathered.colour.extend(colour.map(|(r, g, b)| [r, g, b]));
            gathered.intensity.push(intensity);
            gathered.value.extend(value);
        }
        gathered.classes = (0..=u8::MAX).zip(classes).filter(|(_, count)| *count > 0).collect();
        gathered
    }

    /// Adds those of `other` that are taken.
    fn add(&mut self, other: Self, thinning: &mut Thinning) {
        self.withheld += other.withheld;
        for (class, count) in other.classes {
            *self.classes.entry(class).or_default() += count;
        }
        for (i, position) in other.position.into_iter().enumerate() {
            if thinning.takes() {
                self.position.push(position);
                self.colour.extend(other.colour.get(i));
                self.intensity.push(other.intensity[i]);
                self.value.extend(other.value.get(i));
            }
        }
    }

    fn into_cloud(self, options: &PointOptions) -> Cloud {
        let columns = COLUMNS.map(str::to_owned).into();
        let mut cloud = Cloud { position: self.position, value: self.value, columns, ..Cloud::default() };
        let brightest = self.colour.iter().flatten().copied().max().unwrap_or(0);
        if brightest > 0 {
            // Colours have 16 bits; many programs write 8 of them, and then all are small.
            let bright = self.colour.iter().filter(|c| c.iter().any(|c| *c > 255)).count();
            let white: u16 = if bright > self.colour.len() / BRIGHT { u16::MAX } else { 255 };
            let channel = |c: u16| f32::from(c.min(white)) / f32::from(white);
            cloud.colour = self.colour.iter().map(|c| Vec3::from(c.map(channel))).collect();
            cloud.colour_storage = ColourStorage::Integer;
            cloud.notes.push(format!("colours from 0 to {white}"));
        } else {
            let intensity: Vec<f32> = self.intensity.iter().copied().map(f32::from).collect();
            grey(&intensity, &mut cloud);
        }
        if self.withheld > 0 {
            cloud.notes.push(format!("{} points dropped: the file withholds them", self.withheld));
        }
        let counts = &self.classes;
        if counts.keys().any(|class| *class > 1) || !options.classes.is_empty() {
            let shown = counts.iter().take(SHOWN).map(|(class, count)| format!("{} {count}", named(*class)));
            let shown = shown.collect::<Vec<_>>().join(", ");
            let more = counts.len().saturating_sub(SHOWN);
            let tail = if more > 0 { format!(" and {more} more classes") } else { String::new() };
            cloud.notes.push(format!("points of each class of the file: {shown}{tail}"));
        }
        cloud
    }
}

/// A class with its name.
fn named(class: u8) -> String {
    match CLASS_NAMES.iter().find(|(number, _)| *number == class) {
        Some((_, name)) => format!("{class} ({name})"),
        None => class.to_string(),
    }
}

/// Reads the points of LAS, LAZ and COPC, without those that the file withholds.
///
/// # Errors
/// The bytes are not a valid file, or the header claims points that are not there.
pub(in crate::model) fn parse(
    bytes: &[u8],
    options: &PointOptions,
    progress: &dyn Fn(f32),
) -> Result<Cloud, ParseError> {
    let header = Header::read(bytes)?;
    check_count(header.points, bytes.len(), header.count_at)?;
    let begin = header.begin();
    let least = header.end(bytes);
    let Some(data) = bytes.get(begin..).filter(|_| begin >= least) else {
        let expected = format!("a place from byte {least}, behind the header and its records, to {}", bytes.len());
        return Err(ParseError::byte(DATA_AT, format!("points from byte {begin}"), expected));
    };
    let mut gathered = Gathered::default();
    let mut thinning = Thinning::new(options);
    let mut done = 0;
    let mut add = |blocks: Vec<Gathered>, points: u64| {
        for block in blocks {
            gathered.add(block, &mut thinning);
        }
        done += points;
        progress(done as f32 / header.points.max(1) as f32);
    };
    if header.format.is_compressed {
        let chunks = Chunks::of(&header, bytes)?;
        for some in chunks.list.chunks(WAITING) {
            let of = |chunk: &Chunk<'_>| {
                let mut blocks = Vec::new();
                chunks.unpack(chunk, &header, &mut |block| blocks.push(Gathered::of(block, options)))?;
                Ok(blocks)
            };
            let blocks: Result<Vec<_>, ParseError> = some.par_iter().map(of).collect();
            add(blocks?.into_iter().flatten().collect(), some.iter().map(|chunk| chunk.points).sum());
        }
    } else {
        let record = header.size_of_point();
        let there = data.len() / record;
        let claimed = usize::try_from(header.points).ok().filter(|points| *points <= there).ok_or_else(|| {
            let found = format!("{} points of {record} bytes from byte {begin}", header.points);
            ParseError::byte(header.count_at, found, format!("at most {there}, which the file has room for"))
        })?;
        for some in data[..claimed * record].chunks(WAITING * BLOCK * record) {
            let of = |block: &[u8]| Ok(Gathered::of(&header.data(block.to_vec())?, options));
            let blocks: Result<Vec<_>, ParseError> = some.par_chunks(BLOCK * record).map(of).collect();
            add(blocks?, (some.len() / record) as u64);
        }
    }
    Ok(gathered.into_cloud(options))
}
