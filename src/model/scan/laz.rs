//! Packed points: the chunks of LAZ, each of which unpacks by itself.
//!
//! The crate `laz` unpacks. It takes memory for as many chunks, and for as large layers, as a file claims to have, so
//! both are held against the bytes that are there first.

use std::io::Cursor;

use laz::las::selective::DecompressionSelection;
use laz::laszip::ChunkTable;
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{LazItem, LazItemType, LazVlr};

use super::common::guarded;
use super::las_header::{Header, PointBlock};
use crate::model::error::ParseError;

/// Points that are unpacked at a time.
const BLOCK: u64 = 1 << 16;
/// First version of items whose fields are packed in layers.
const LAYERED: u16 = 3;

/// The chunks of a file, in order.
pub(super) struct Chunks<'a> {
    pub(super) list: Vec<Chunk<'a>>,
    items: Vec<LazItem>,
}

/// Points that unpack by themselves.
pub(super) struct Chunk<'a> {
    bytes: &'a [u8],
    /// Byte of the file at which it begins.
    at: usize,
    pub(super) points: u64,
}

impl<'a> Chunks<'a> {
    /// Finds the chunks of a file.
    ///
    /// # Errors
    /// What the file says of its packing is not valid, or the chunks are not those of all points.
    pub(super) fn of(header: &Header, bytes: &'a [u8]) -> Result<Self, ParseError> {
        let begin = header.begin();
        let wrong = |at, found: String, expected: &str| Err(ParseError::byte(at, found, expected));
        let records = header.records(bytes);
        let is_ours = |user: &str, number| user == LazVlr::USER_ID && number == LazVlr::RECORD_ID;
        let Some((_, _, record)) = records.into_iter().find(|(user, number, _)| is_ours(user, *number)) else {
            let found = "packed points without a record that says how they are packed";
            return wrong(begin, found.to_owned(), "a record 22204 of `laszip encoded`");
        };
        let vlr = LazVlr::from_buffer(record)
            .map_err(|e| ParseError::byte(begin, e.to_string(), "a valid record 22204 of `laszip encoded`"))?;
        let items = vlr.items().clone();
        let size: u64 = items.iter().map(|item| u64::from(item.size())).sum();
        if size != header.size_of_point() as u64 {
            let expected = format!("{}, as in the header", header.size_of_point());
            return wrong(begin, format!("packed points of {size} bytes"), &expected);
        }
        let has = |is: fn(&LazItemType) -> bool| items.iter().any(|item| is(&item.item_type()));
        let extended = has(|item| matches!(item, LazItemType::Point14));
        let coloured = has(|item| matches!(item, LazItemType::RGB12 | LazItemType::RGB14 | LazItemType::RGBNIR14));
        if extended != header.format.is_extended || coloured != header.format.has_color {
            return wrong(begin, "packed points of another format".to_owned(), "the format that the header names");
        }
        let list = match record.first_chunk() {
            // All points after one another.
            Some([1, 0]) => {
                vec![Chunk { bytes: bytes.get(begin..).unwrap_or_default(), at: begin, points: header.points }]
            }
            Some([2 | 3, 0]) => listed(header, bytes, &vlr)?,
            _ => return wrong(begin, "an unknown way to pack points".to_owned(), "one of the numbers 1 to 3"),
        };
        Ok(Self { list, items })
    }

    /// Unpacks a chunk, and hands on its points in blocks.
    ///
    /// # Errors
    /// The chunk is damaged.
    pub(super) fn unpack(
        &self,
        chunk: &Chunk<'_>,
        header: &Header,
        take: &mut dyn FnMut(&PointBlock),
    ) -> Result<(), ParseError> {
        let damaged = |why: String| ParseError::byte(chunk.at, format!("a damaged chunk ({why})"), "packed points");
        let layered = self.items.iter().any(|item| item.version() >= LAYERED);
        if layered {
            self.check_layers(chunk, header)?;
        }
        let input = Cursor::new(chunk.bytes);
        let mut unpacker: Box<dyn RecordDecompressor<_>> = if layered {
            Box::new(LayeredPointRecordDecompressor::new(input))
        } else {
            Box::new(SequentialPointRecordDecompressor::new(input))
        };
        unpacker.set_fields_from(&self.items).map_err(|e| damaged(e.to_string()))?;
        if unpacker.record_size() != header.size_of_point() {
            return Err(damaged(format!("fields of {} bytes", unpacker.record_size())));
        }
        unpacker.set_selection(
            DecompressionSelection::xy_returns_channel()
                .decompress_z()
                .decompress_classification()
                .decompress_flags()
                .decompress_intensity()
                .decompress_rgb(),
        );
        let mut left = chunk.points;
        while left > 0 {
            let points = left.min(BLOCK);
            let mut block = header.room(points as usize)?;
            let unpacked =
                guarded(|| unpacker.decompress_many(block.resize_for(points as usize)).map_err(|why| why.to_string()));
            unpacked
                .unwrap_or_else(|| Err("numbers beyond all tables".to_owned()))
                .map_err(|why| damaged(format!("after {} points: {why}", chunk.points - left)))?;
            take(&block);
            left -= points;
        }
        Ok(())
    }

    /// Holds the sizes of a chunk's layers against the bytes of the chunk.
    fn check_layers(&self, chunk: &Chunk<'_>, header: &Header) -> Result<(), ParseError> {
        let of_item = |item: &LazItem| match item.item_type() {
            LazItemType::Point14 => 9,
            LazItemType::RGBNIR14 => 2,
            LazItemType::Byte14(count) => usize::from(count),
            _ => 1,
        };
        let layers: usize = self.items.iter().map(of_item).sum();
        // The first point, as it is, then the number of points, then the sizes.
        let begin = header.size_of_point() + 4;
        let sizes = chunk.bytes.get(begin..begin + 4 * layers);
        let fits = |sizes: &[u8]| {
            let number = |size: &[u8]| size.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte));
            let all: u64 = sizes.chunks_exact(4).map(number).sum();
            all <= (chunk.bytes.len() - begin - 4 * layers) as u64
        };
        if sizes.is_some_and(fits) {
            return Ok(());
        }
        let found = format!("layers that are larger than their chunk of {} bytes", chunk.bytes.len());
        Err(ParseError::byte(chunk.at, found, "layers within it"))
    }
}

/// The chunks that the table at the end of the points lists.
fn listed<'a>(header: &Header, bytes: &'a [u8], vlr: &LazVlr) -> Result<Vec<Chunk<'a>>, ParseError> {
    let begin = header.begin();
    let number = |at: usize| Some(i64::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    let no_table = |at, found: String| ParseError::byte(at, found, "a table of chunks behind the points");
    // A writer that cannot go back puts the place of the table at the end of the file.
    let first = begin + 8;
    let place = |at| number(at).and_then(|at| usize::try_from(at).ok()).filter(|at| *at >= first);
    let Some(table) = place(begin).or_else(|| place(bytes.len().saturating_sub(8))) else {
        return Err(no_table(begin, "no place of the table of chunks".to_owned()));
    };
    let Some([_, _, _, _, count @ ..]) = bytes.get(table..).and_then(|table| table.first_chunk::<8>()) else {
        return Err(no_table(begin, format!("its place at byte {table} of {}", bytes.len())));
    };
    let count = u32::from_le_bytes(*count) as usize;
    // The first point of a chunk is not packed.
    let most = (table - first) / header.size_of_point();
    if count > most {
        let found = format!("{count} chunks in {} bytes", table - first);
        return Err(ParseError::byte(table + 4, found, format!("at most {most}")));
    }
    let mut cursor = Cursor::new(bytes);
    cursor.set_position(begin as u64);
    let entries = ChunkTable::read_from(cursor, vlr).map_err(|e| no_table(table, e.to_string()))?;
    let (mut at, mut left) = (first, header.points);
    let mut list = Vec::with_capacity(entries.len());
    for entry in &entries {
        let end = usize::try_from(entry.byte_count).ok().and_then(|bytes| at.checked_add(bytes));
        let Some(end) = end.filter(|end| *end <= table) else {
            return Err(no_table(table, format!("a chunk of {} bytes from byte {at}", entry.byte_count)));
        };
        // Where all have as many points, the last one has fewer.
        let points = entry.point_count.min(left);
        if points > 0 {
            list.push(Chunk { bytes: &bytes[at..end], at, points });
        }
        left -= points;
        at = end;
    }
    if left > 0 {
        let found = format!("chunks of {} points", header.points - left);
        return Err(ParseError::byte(table, found, format!("{}, as the header says", header.points)));
    }
    Ok(list)
}
