//! Points of laser scanners: LAS, LAZ and COPC (`las`; `laz` unpacks), and E57 (`e57`).
//!
//! Both formats hold more than surfels use. Here are the choices that a scene has among the points ([`Taken`]), and
//! what becomes of intensities.

#[cfg(feature = "formats")]
mod e57;
#[cfg(feature = "formats")]
mod facts;
#[cfg(feature = "formats")]
mod las;
#[cfg(feature = "formats")]
mod laz;

use glam::Vec3;

use super::cloud::{Cloud, ColourStorage};
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

/// Points that every file may hold, however small it is.
#[cfg(feature = "formats")]
const FREE_POINTS: u64 = 1 << 20;

/// Most points above [`FREE_POINTS`] for each byte of a file. Packed scans have 2 to 10 bytes a point; a scan without
/// noise, as tests make them, has a few points a byte.
#[cfg(feature = "formats")]
const MOST_POINTS_A_BYTE: u64 = 64;

/// One intensity in so many is brighter than white: a few mirrors would leave all others black.
#[cfg(feature = "formats")]
const WHITE: usize = 200;

/// Checks what a file says about its number of points: some bytes that unpack to billions of equal points are an
/// attempt to fill memory.
///
/// # Errors
/// There are too many for a file of `size` bytes.
#[cfg(feature = "formats")]
fn check_count(points: u64, size: usize, at: usize) -> Result<(), ParseError> {
    let most = FREE_POINTS.saturating_add(MOST_POINTS_A_BYTE.saturating_mul(size as u64));
    if points <= most {
        return Ok(());
    }
    Err(ParseError::byte(at, format!("{points} points in {size} bytes"), format!("at most {most}")))
}

/// Takes every n-th point of those that a file offers one after another.
#[cfg(feature = "formats")]
#[derive(Debug)]
struct Thinning {
    every: u64,
    offered: u64,
}

#[cfg(feature = "formats")]
impl Thinning {
    fn new(options: &PointOptions) -> Self {
        Self { every: u64::from(options.every.max(1)), offered: 0 }
    }

    /// Is the next point taken?
    fn takes(&mut self) -> bool {
        let takes = self.offered.is_multiple_of(self.every);
        self.offered += 1;
        takes
    }
}

/// Greys of intensities, which have no common scale: black is 0, white what one in [`WHITE`] exceeds. The note says it.
#[cfg(feature = "formats")]
fn grey(intensity: &[f32], cloud: &mut Cloud) {
    let mut sorted: Vec<f32> = intensity.iter().copied().filter(|x| x.is_finite() && *x > 0.0).collect();
    if sorted.is_empty() {
        return;
    }
    let nth = sorted.len() - 1 - sorted.len() / WHITE;
    let white = *sorted.select_nth_unstable_by(nth, f32::total_cmp).1;
    let channel = |x: f32| if x.is_finite() { (x / white).clamp(0.0, 1.0) } else { 0.0 };
    cloud.colour = intensity.iter().map(|x| Vec3::splat(channel(*x))).collect();
    cloud.colour_storage = ColourStorage::Integer;
    cloud.notes.push(format!("no colours: intensity from 0 to {white} is shown as grey"));
}

/// Makes the choices among points of other formats: all that this module does not read.
///
/// # Errors
/// Classes are asked for, which no other format has.
pub(super) fn choose(cloud: &mut Cloud, options: &PointOptions) -> Result<(), ParseError> {
    if !options.classes.is_empty() {
        return Err(ParseError::byte(0, "points without classes", "LAS or LAZ, as `classes` are named"));
    }
    let every = options.every.max(1) as usize;
    if every > 1 {
        let keep: Vec<bool> = (0..cloud.position.len()).map(|i| i % every == 0).collect();
        tidy::retain(cloud, &keep);
    }
    Ok(())
}

/// Refuses choices among points where a file has none.
///
/// # Errors
/// There are such choices.
pub(super) fn refuse(options: &PointOptions) -> Result<(), ParseError> {
    if *options == PointOptions::default() {
        return Ok(());
    }
    let expected = "a cloud of points, as `every`, `classes` or `scannerPosition` is given";
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
