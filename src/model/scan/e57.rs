//! E57 (ASTM E2807): one file with several scans, each with the place where its scanner stood.
//!
//! The crate `e57` reads it. It takes memory for as long a text as the header claims, so the header is looked at first.

use std::io::Cursor;
use std::sync::atomic::{AtomicU64, Ordering};

use ::e57::{CartesianCoordinate, E57Reader, Header, PointCloud, RecordDataType, RecordName};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::common::{Thinning, check_count, grey, guarded};
use super::refuse_classes;
use crate::model::cloud::{Cloud, ColourStorage};
use crate::model::error::ParseError;
use crate::model::options::PointOptions;

/// The one column of numbers that points are coloured by.
const INTENSITY: &str = "intensity";
/// Bytes of the header.
pub(super) const HEADER: usize = 48;
/// Byte at which the header says how long its text is.
const LENGTH_AT: usize = 32;
/// Points between two reports of progress.
const REPORT: u64 = 1 << 16;

/// One error for all that the crate finds: it does not say where.
pub(super) fn fault(why: &::e57::Error) -> ParseError {
    ParseError::byte(0, why.to_string(), "a valid E57 file")
}

/// The error for numbers on which the crate panics.
pub(super) fn odd() -> ParseError {
    ParseError::byte(0, "numbers that no scan has", "a valid E57 file")
}

/// Checks that the header's text fits into a file of `size` bytes.
pub(super) fn check_header(head: &[u8], size: u64) -> Result<(), ParseError> {
    let header = Header::read(&mut Cursor::new(head)).map_err(|why| fault(&why))?;
    if header.xml_length > size {
        let found = format!("a text of {} bytes", header.xml_length);
        return Err(ParseError::byte(LENGTH_AT, found, format!("at most {size}, the size of the file")));
    }
    Ok(())
}

/// Checks that points of a scan have places, and that a column has values that differ: where none takes a bit, the
/// crate finds no end of points.
fn check_columns(scan: &PointCloud) -> Result<(), ParseError> {
    let takes_bits = |record: &::e57::Record| match record.data_type {
        RecordDataType::Single { .. } | RecordDataType::Double { .. } => true,
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => min < max,
    };
    let has = |names: [RecordName; 3]| names.iter().all(|name| scan.prototype.iter().any(|r| r.name == *name));
    let placed = has([RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ])
        || has([RecordName::SphericalRange, RecordName::SphericalAzimuth, RecordName::SphericalElevation]);
    if !placed {
        let expected = "x, y and z, or a range and two angles";
        return Err(ParseError::byte(0, "a scan whose points have no place", expected));
    }
    if scan.records == 0 || scan.prototype.iter().any(takes_bits) {
        return Ok(());
    }
    let found = format!("a scan of {} points without a column whose values differ", scan.records);
    Err(ParseError::byte(0, found, "one at least"))
}

/// The place of a scan's scanner; `None` where the file has none, or the origin, which many programs write who know
/// none.
pub(super) fn station(scan: &PointCloud) -> Option<DVec3> {
    let at = &scan.transform.as_ref()?.translation;
    Some(DVec3::new(at.x, at.y, at.z)).filter(|at| at.is_finite() && *at != DVec3::ZERO)
}

/// The points of one scan that are taken.
#[derive(Default)]
struct Gathered {
    position: Vec<DVec3>,
    colour: Vec<Vec3>,
    intensity: Vec<f32>,
    invalid: u64,
}

impl Gathered {
    fn of(
        reader: &mut E57Reader<Cursor<&[u8]>>,
        scan: &PointCloud,
        options: &PointOptions,
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<Self, ParseError> {
        let mut points = reader.pointcloud_simple(scan).map_err(|why| fault(&why))?;
        // Greys of our own have the same scale in all scans.
        points.intensity_to_color(false);
        points.normalize_intensity(false);
        let mut gathered = Self::default();
        let mut thinning = Thinning::new(options);
        for (number, point) in (1..).zip(points) {
            let point = point.map_err(|why| fault(&why))?;
            if number % REPORT == 0 {
                done(REPORT);
            }
            let CartesianCoordinate::Valid { x, y, z } = point.cartesian else {
                gathered.invalid += 1;
                continue;
            };
            if thinning.takes() {
                gathered.position.push(DVec3::new(x, y, z));
                gathered.colour.extend(point.color.map(|c| Vec3::new(c.red, c.green, c.blue)));
                gathered.intensity.push(point.intensity.unwrap_or(0.0));
            }
        }
        done(scan.records % REPORT);
        Ok(gathered)
    }
}

/// Reads all scans of an E57 file, in its own coordinates.
///
/// Points that the scanner did not hit anything with are left out. Every n-th point is taken in each scan.
///
/// # Errors
/// The bytes are not a valid file, or it claims more points than it can hold.
pub(in crate::model) fn parse(
    bytes: &[u8],
    options: &PointOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Cloud, ParseError> {
    check_header(bytes, bytes.len() as u64)?;
    refuse_classes(options)?;
    let open = || E57Reader::new(Cursor::new(bytes)).map_err(|why| fault(&why));
    let scans = guarded(|| open().map(|reader| reader.pointclouds())).unwrap_or_else(|| Err(odd()))?;
    scans.iter().try_for_each(check_columns)?;
    let claimed = scans.iter().fold(0_u64, |sum, scan| sum.saturating_add(scan.records));
    check_count(claimed, bytes.len(), 0)?;
    let read = AtomicU64::new(0);
    let done = |points: u64| {
        let read = read.fetch_add(points, Ordering::Relaxed) + points;
        progress(read as f32 / claimed.max(1) as f32);
    };
    // To open the file takes as long as its text is: once for each thread.
    let share = scans.len().div_ceil(rayon::current_num_threads()).max(1);
    let of_some = |some: &[PointCloud]| {
        let all = guarded(|| {
            let mut reader = open()?;
            some.iter().map(|scan| Gathered::of(&mut reader, scan, options, &done)).collect::<Result<Vec<_>, _>>()
        });
        all.unwrap_or_else(|| Err(odd()))
    };
    let gathered: Result<Vec<_>, ParseError> = scans.par_chunks(share).map(of_some).collect();
    let gathered: Vec<Gathered> = gathered?.into_iter().flatten().collect();
    let mut cloud = Cloud { colour_storage: ColourStorage::Integer, ..Cloud::default() };
    let mut intensity = Vec::new();
    let stations: Vec<Option<DVec3>> = scans.iter().map(station).collect();
    // One scan without a place of its scanner leaves the sides of all to their shape.
    let placed = stations.iter().all(Option::is_some) && u16::try_from(scans.len()).is_ok();
    let coloured = gathered.iter().all(|scan| scan.colour.len() == scan.position.len());
    let mut invalid = 0;
    for (number, scan) in (0..=u16::MAX).zip(gathered) {
        if placed {
            cloud.station.extend(std::iter::repeat_n(number, scan.position.len()));
        }
        cloud.position.extend(scan.position);
        if coloured {
            cloud.colour.extend(scan.colour);
        }
        intensity.extend(scan.intensity);
        invalid += scan.invalid;
    }
    if placed {
        cloud.stations = stations.into_iter().flatten().collect();
    }
    let measured = scans.iter().any(|scan| scan.prototype.iter().any(|r| r.name == RecordName::Intensity));
    if measured {
        cloud.columns = vec![INTENSITY.to_owned()];
    }
    if measured && options.colour_by.as_ref().is_some_and(|by| by.name() == INTENSITY) {
        cloud.value = intensity.iter().copied().map(f64::from).collect();
    } else if cloud.colour.is_empty() {
        grey(&intensity, &mut cloud);
    }
    if invalid > 0 {
        cloud.notes.push(format!("{invalid} points dropped: the file says that they are not valid"));
    }
    Ok(cloud)
}
