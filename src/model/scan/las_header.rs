//! The header of LAS, versions 1.0 to 1.4 (ASPRS), and the layout of points that it names.
//!
//! The crate `las` knows the layouts. What a header claims is checked here, before anything is made of it.

use std::io::Cursor;

pub(super) use las::PointData as PointBlock;
use las::raw;
use las::{PointDataBuilder, Transform, Vector};

use crate::model::error::ParseError;

/// Byte at which a header says how many points there are: in all versions, and in version 1.4 and later.
const COUNT_AT: [usize; 2] = [107, 247];
/// Byte at which a header names the format of its points.
const FORMAT_AT: usize = 104;
/// Byte at which the three scales are.
const SCALE_AT: usize = 131;
/// Bytes of a record of variable length without its data.
const RECORD_HEAD: usize = 54;

/// What a header says, checked.
pub(super) struct Header {
    pub(super) raw: raw::Header,
    pub(super) format: las::point::Format,
    /// Number of points.
    pub(super) points: u64,
    /// Byte at which that number stands.
    pub(super) count_at: usize,
}

impl Header {
    /// Reads the header at the beginning of `bytes`, which may be more.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, ParseError> {
        let cut = |_| ParseError::byte(bytes.len(), "the end of the file", "the rest of the header of LAS");
        let raw = raw::Header::read_from(Cursor::new(bytes)).map_err(cut)?;
        let wrong = |at, found: String, expected: &str| Err(ParseError::byte(at, found, expected));
        if (raw.version.major, raw.version.minor) > (1, 4) || raw.version.major == 0 {
            let found = format!("LAS {}.{}", raw.version.major, raw.version.minor);
            return wrong(24, found, "a version from 1.0 to 1.4");
        }
        let number = raw.point_data_record_format & 0b0011_1111;
        if number > 10 {
            return wrong(FORMAT_AT, format!("points of format {number}"), "a format from 0 to 10");
        }
        let wide = |e: las::Error| ParseError::byte(FORMAT_AT, e.to_string(), "a format of points from 0 to 10");
        let mut format = las::point::Format::new(raw.point_data_record_format).map_err(wide)?;
        let (length, least) = (raw.point_data_record_length, format.len());
        if length < least {
            let found = format!("points of {length} bytes");
            return wrong(FORMAT_AT + 1, found, &format!("{least} bytes or more in format {number}"));
        }
        format.extra_bytes = length - least;
        for (axis, scale) in [raw.x_scale_factor, raw.y_scale_factor, raw.z_scale_factor].into_iter().enumerate() {
            if !scale.is_normal() {
                return wrong(SCALE_AT + 8 * axis, format!("a scale of {scale}"), "a number other than 0");
            }
        }
        let large = raw.large_file.map_or(0, |large| large.number_of_point_records);
        let old = u64::from(raw.number_of_point_records);
        let (points, count_at) = if large > 0 { (large, COUNT_AT[1]) } else { (old, COUNT_AT[0]) };
        Ok(Self { raw, format, points, count_at })
    }

    /// Places of points from the whole numbers that stand for them.
    fn transforms(&self) -> Vector<Transform> {
        let raw = &self.raw;
        let of = |scale, offset| Transform { scale, offset };
        Vector {
            x: of(raw.x_scale_factor, raw.x_offset),
            y: of(raw.y_scale_factor, raw.y_offset),
            z: of(raw.z_scale_factor, raw.z_offset),
        }
    }

    /// The points of `bytes`, as records of the file.
    pub(super) fn data(&self, bytes: Vec<u8>) -> Result<PointBlock, ParseError> {
        let builder = PointDataBuilder::new().with_format(self.format).with_transforms(self.transforms());
        let odd = |e: las::Error| ParseError::byte(FORMAT_AT, e.to_string(), "whole points");
        builder.build_from_bytes(bytes).map_err(odd)
    }

    /// Room for `points` points that are unpacked; their bytes are 0.
    pub(super) fn room(&self, points: usize) -> Result<PointBlock, ParseError> {
        let mut data = self.data(Vec::new())?;
        data.resize_for(points);
        Ok(data)
    }

    /// Byte behind the header and its records.
    pub(super) fn end(&self, bytes: &[u8]) -> usize {
        let records = self.records(bytes).iter().map(|(_, _, data)| RECORD_HEAD + data.len()).sum::<usize>();
        usize::from(self.raw.header_size) + records
    }

    /// Byte at which the points begin.
    pub(super) fn begin(&self) -> usize {
        self.raw.offset_to_point_data as usize
    }

    /// Size of a point that is not packed, bytes.
    pub(super) fn size_of_point(&self) -> usize {
        usize::from(self.format.len())
    }

    /// The records of variable length between the header and the points: who made each, its number and its data.
    /// They end where the file does.
    pub(super) fn records<'a>(&self, bytes: &'a [u8]) -> Vec<(String, u16, &'a [u8])> {
        let mut records = Vec::new();
        let mut at = usize::from(self.raw.header_size);
        for _ in 0..self.raw.number_of_variable_length_records {
            let Some((head, rest)) = bytes.get(at..).and_then(|rest| rest.split_at_checked(RECORD_HEAD)) else { break };
            let number = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
            let length = usize::from(number(20));
            let Some(data) = rest.get(..length) else { break };
            let user = String::from_utf8_lossy(&head[2..18]).trim_end_matches('\0').to_owned();
            records.push((user, number(18), data));
            at += RECORD_HEAD + length;
        }
        records
    }
}
