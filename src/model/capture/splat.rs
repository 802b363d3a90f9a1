//! `.splat` files: records of 32 bytes without a header.
//!
//! A record has the position and the standard deviations as floats, then the colour with the opacity and the rotation
//! as bytes. Nothing marks the file, so the only thing that can be wrong is its size.

use super::{Gaussian, Gaussians, SH_C0};
use crate::model::error::ParseError;

/// Bytes of a Gaussian.
const RECORD: usize = 32;

/// Reads the bytes of a file. `progress` now and then gets the share read.
///
/// # Errors
/// The last record is cut short.
pub(in crate::model) fn parse(bytes: &[u8], progress: &dyn Fn(f32)) -> Result<Gaussians, ParseError> {
    const REPORT: usize = 1 << 16;
    let (records, rest) = bytes.as_chunks::<RECORD>();
    if !rest.is_empty() {
        let found = format!("{} bytes of a record", rest.len());
        return Err(ParseError::byte(bytes.len() - rest.len(), found, format!("{RECORD}: is the file cut short?")));
    }
    let mut gaussians = Gaussians::of_degree(0);
    for (row, record) in records.iter().enumerate() {
        if row % REPORT == 0 {
            progress(row as f32 / records.len() as f32);
        }
        gaussians.push(&decode(record));
    }
    Ok(gaussians)
}

fn decode(record: &[u8; RECORD]) -> Gaussian {
    let float = |at: usize| f64::from(f32::from_le_bytes([0, 1, 2, 3].map(|k| record[at + k])));
    let byte = |at: usize| f64::from(record[at]);
    Gaussian {
        position: [0, 4, 8].map(float),
        sigma: [12, 16, 20].map(float),
        // Programs that write these files put zero at 128. Others read it as the middle of 0 to 255, which turns
        // Gaussians by half a degree.
        rotation: [28, 29, 30, 31].map(|at| (byte(at) - 128.0) / 128.0),
        opacity: byte(27) / 255.0,
        base: [24, 25, 26].map(|at| (byte(at) / 255.0 - 0.5) / f64::from(SH_C0)),
        ..Gaussian::default()
    }
}
