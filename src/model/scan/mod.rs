//! Points of laser scanners: LAS, LAZ and COPC (`las`; `laz` unpacks), and E57 (`e57`).
//!
//! Readers make the choices that a scene has among points ([`PointOptions`]) while they read. Here is what becomes of
//! these choices in all other formats.

#[cfg(feature = "formats")]
mod common;
#[cfg(feature = "formats")]
mod e57;
#[cfg(feature = "formats")]
mod facts;
#[cfg(feature = "formats")]
mod las;
#[cfg(feature = "formats")]
mod las_header;
#[cfg(feature = "formats")]
mod laz;

use super::cloud::Cloud;
use super::error::ParseError;
use super::options::PointOptions;
use super::tidy;

#[cfg(not(feature = "formats"))]
use super::capture::needs_formats;

#[cfg(feature = "formats")]
pub(super) use self::e57::parse as parse_e57;
#[cfg(feature = "formats")]
pub use self::facts::{Scan, ScanFacts, scan_facts};
#[cfg(feature = "formats")]
pub(super) use self::las::parse as parse_las;

/// Makes the choices among points of other formats: all that this module does not read.
///
/// # Errors
/// Classes are asked for, which no other format has.
pub(super) fn choose(cloud: &mut Cloud, options: &PointOptions) -> Result<(), ParseError> {
    refuse_classes(options)?;
    let every = options.every.max(1) as usize;
    if every > 1 {
        let keep: Vec<bool> = (0..cloud.position.len()).map(|i| i % every == 0).collect();
        tidy::retain(cloud, &keep);
    }
    Ok(())
}

/// Refuses a choice of classes where points have none.
fn refuse_classes(options: &PointOptions) -> Result<(), ParseError> {
    if options.classes.is_empty() {
        return Ok(());
    }
    Err(ParseError::byte(0, "points without classes", "LAS or LAZ, as `classes` are named"))
}

/// Refuses choices among points where a file has none.
///
/// # Errors
/// There are such choices.
pub(super) fn refuse(options: &PointOptions) -> Result<(), ParseError> {
    if *options == PointOptions::default() {
        return Ok(());
    }
    let expected =
        "a cloud of points, as `every`, `classes`, `clean`, `radius`, `scannerPosition` or `colourBy` is given";
    Err(ParseError::byte(0, "a mesh, a capture, a volume or surfels", expected))
}

/// Refuses a file of scanners: what reads it is not part of this program.
#[cfg(not(feature = "formats"))]
pub(super) fn parse_las(_: &[u8], _: &PointOptions, _: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    Err(needs_formats("a LAS file"))
}

/// Refuses a file of scanners: what reads it is not part of this program.
#[cfg(not(feature = "formats"))]
pub(super) fn parse_e57(_: &[u8], _: &PointOptions, _: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    Err(needs_formats("an E57 file"))
}

/// Says where the scanner stood, unless the file does.
pub(super) fn stand(cloud: &mut Cloud, options: &PointOptions) {
    if let Some(place) = options.scanner {
        cloud.stations = vec![place];
        cloud.station = vec![0; cloud.position.len()];
    }
}
