//! A file of our own format as a stream: its bytes in their order, their checksum, and columns of numbers made of them.

use std::io::{self, BufReader, Read};
use std::ops::Range;

use glam::Vec3;

use super::error::ParseError;

/// Bytes of a file that are in memory at a time, besides the columns. They fit into the cache of a core.
const CHUNK: usize = 1 << 18;

/// Why a file was not read.
pub(super) enum Fault {
    /// It breaks the rules of the format.
    Format(ParseError),
    /// Its bytes cannot be read, or there is no memory for its columns.
    Io(io::Error),
}

impl From<ParseError> for Fault {
    fn from(why: ParseError) -> Self {
        Self::Format(why)
    }
}

impl From<io::Error> for Fault {
    fn from(why: io::Error) -> Self {
        Self::Io(why)
    }
}

/// The bytes of a file from its first to its last.
pub(super) struct Stream<R> {
    from: BufReader<R>,
    /// Size of the file, bytes.
    pub(super) size: u64,
    /// Offset of the next byte.
    at: u64,
    sum: crc32fast::Hasher,
    /// Where the checksum of the file lies; its bytes count as 0.
    own: Range<u64>,
    chunk: Vec<u8>,
}

impl<R: Read> Stream<R> {
    pub(super) fn new(from: R, size: u64, own: Range<u64>) -> Self {
        let (from, sum, chunk) = (BufReader::with_capacity(CHUNK, from), crc32fast::Hasher::new(), Vec::new());
        Self { from, size, at: 0, sum, own, chunk }
    }

    /// The next bytes.
    pub(super) fn fill(&mut self, to: &mut [u8]) -> io::Result<()> {
        self.from.read_exact(to)?;
        let place = |offset: u64| usize::try_from(offset.saturating_sub(self.at)).unwrap_or(usize::MAX).min(to.len());
        let (start, end) = (place(self.own.start), place(self.own.end));
        self.sum.update(&to[..start]);
        self.sum.update(&[0; 8][..(end - start).min(8)]);
        self.sum.update(&to[end..]);
        self.at += to.len() as u64;
        Ok(())
    }

    /// Passes over the bytes before `offset`.
    pub(super) fn skip_to(&mut self, offset: u64) -> io::Result<()> {
        let mut chunk = std::mem::take(&mut self.chunk);
        while self.at < offset {
            chunk.resize((offset - self.at).min(CHUNK as u64) as usize, 0);
            self.fill(&mut chunk)?;
        }
        self.chunk = chunk;
        Ok(())
    }

    /// The rows of a column, which begins here.
    pub(super) fn rows<const BYTES: usize, T>(
        &mut self,
        place: &Range<usize>,
        to: &mut Vec<T>,
        make: impl Fn(&[u8; BYTES]) -> T,
    ) -> io::Result<()> {
        let rows = place.len() / BYTES;
        // The column lies within the file, so memory stays within a small multiple of the file's size.
        to.try_reserve_exact(rows).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
        let mut chunk = std::mem::take(&mut self.chunk);
        while to.len() < rows {
            chunk.resize(BYTES * (rows - to.len()).min(CHUNK / BYTES), 0);
            self.fill(&mut chunk)?;
            to.extend(chunk.as_chunks::<BYTES>().0.iter().map(&make));
        }
        self.chunk = chunk;
        Ok(())
    }

    /// A column of floats, `N` a row.
    pub(super) fn floats<const N: usize, const BYTES: usize, T>(
        &mut self,
        place: &Range<usize>,
        to: &mut Vec<T>,
        make: impl Fn([f32; N]) -> T,
    ) -> io::Result<()> {
        const { assert!(BYTES == 4 * N, "a float has four bytes") };
        self.rows(place, to, |row: &[u8; BYTES]| {
            let mut floats = [0.0; N];
            for (float, bytes) in floats.iter_mut().zip(row.as_chunks::<4>().0) {
                *float = f32::from_le_bytes(*bytes);
            }
            make(floats)
        })
    }

    /// A column of vectors.
    pub(super) fn vectors(&mut self, place: &Range<usize>, to: &mut Vec<Vec3>) -> io::Result<()> {
        self.floats::<3, 12, _>(place, to, Vec3::from_array)
    }

    /// CRC-32 (IEEE) of the whole file, with its own bytes taken as 0. Passes over what is left.
    pub(super) fn checksum(mut self) -> io::Result<u32> {
        self.skip_to(self.size)?;
        Ok(self.sum.finalize())
    }
}
