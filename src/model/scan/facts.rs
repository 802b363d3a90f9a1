//! What the header of a scan says, without its points: a scan may have hundreds of millions.

use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use ::e57::E57Reader;
use glam::DVec3;

use super::common::guarded;
use super::e57;
use super::las_header::Header;
use crate::files;
use crate::math::Bounds;
use crate::model::error::{ModelError, ParseError};
use crate::model::format::ModelFormat;

/// Most bytes before the points of LAS that are read: records say much of which nothing is used here.
const MOST_HEAD: u64 = 1 << 24;
/// Most columns of a scan that are named.
const MOST_COLUMNS: usize = 64;
/// Most characters of a text of a file that are shown.
const MOST_TEXT: usize = 2000;
/// Records of LAS that name the coordinate system, by the OGC as text.
const WKT: (&str, u16) = ("LASF_Projection", 2112);

/// What the header of a file of laser scanners says.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanFacts {
    /// The format and its version.
    pub format: String,
    /// Number of points, those included that are not valid.
    pub points: u64,
    /// Box of the points as the header has it, in the coordinates of the file; `None` where it says nothing.
    pub bounds: Option<Bounds>,
    /// What each point has.
    pub columns: Vec<String>,
    /// The coordinate system, in the words of the file.
    pub system: Option<String>,
    /// The program that wrote it.
    pub writer: String,
    /// The scans of an E57 file.
    pub scans: Vec<Scan>,
}

/// A scan of an E57 file.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Its name.
    pub name: String,
    /// Its number of points.
    pub points: u64,
    /// Where the scanner stood, in the coordinates of the file.
    pub station: Option<DVec3>,
}

/// Reads the header of LAS, LAZ, COPC and E57; `None` for all other files.
///
/// # Errors
/// The file cannot be read, or its header is not valid.
pub fn scan_facts(path: &Path) -> Result<Option<ScanFacts>, ModelError> {
    files::steady(|| {
        let of_input = |why| ModelError::of_input(path, why);
        let mut input = files::open(path).map_err(of_input)?;
        let size = input.size();
        let read = |why: std::io::Error| of_input(why.into());
        let mut head = Vec::new();
        input.by_ref().take(e57::HEADER as u64).read_to_end(&mut head).map_err(read)?;
        let invalid = |why| ModelError::Invalid { path: path.to_owned(), why };
        let facts = match ModelFormat::detect(&head, path) {
            Some(ModelFormat::Las) => {
                input.by_ref().take(MOST_HEAD).read_to_end(&mut head).map_err(read)?;
                of_las(&head)
            }
            Some(ModelFormat::E57) => {
                input.seek(SeekFrom::Start(0)).map_err(read)?;
                e57::check_header(&head, size).and_then(|()| of_e57(input))
            }
            _ => return Ok(None),
        };
        facts.map(Some).map_err(invalid)
    })
}

/// A text of a file, to its first zero, without what would change a terminal.
fn text(bytes: &[u8]) -> String {
    let bytes = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    let text = String::from_utf8_lossy(bytes);
    text.trim().chars().take(MOST_TEXT).map(|c| if c.is_control() { ' ' } else { c }).collect()
}

fn of_las(head: &[u8]) -> Result<ScanFacts, ParseError> {
    let header = Header::read(head)?;
    let (raw, format) = (&header.raw, &header.format);
    let records = header.records(head);
    let is_copc = records.first().is_some_and(|(user, number, _)| user == "copc" && *number == 1);
    let kind = match (format.is_compressed, is_copc) {
        (_, true) => "COPC",
        (true, false) => "LAZ",
        (false, false) => "LAS",
    };
    let number = raw.point_data_record_format & 0b0011_1111;
    let mut columns = vec!["x", "y", "z", "intensity", "classification", "return number"];
    columns.extend(format.has_gps_time.then_some("time"));
    columns.extend(format.has_color.then_some("colour"));
    columns.extend(format.has_nir.then_some("near infrared"));
    columns.extend(format.has_waveform.then_some("waveform"));
    let mut columns: Vec<String> = columns.into_iter().map(str::to_owned).collect();
    if format.extra_bytes > 0 {
        columns.push(format!("{} more bytes", format.extra_bytes));
    }
    let bounds =
        Bounds { min: DVec3::new(raw.min_x, raw.min_y, raw.min_z), max: DVec3::new(raw.max_x, raw.max_y, raw.max_z) };
    let system = records.iter().find(|(user, number, _)| user == WKT.0 && *number == WKT.1);
    Ok(ScanFacts {
        format: format!("{kind} {}.{}, points of format {number}", raw.version.major, raw.version.minor),
        points: header.points,
        bounds: Some(bounds).filter(|bounds| !bounds.is_empty() && bounds.min.is_finite() && bounds.max.is_finite()),
        columns,
        system: system.map(|(_, _, data)| text(data)).filter(|system| !system.is_empty()),
        writer: text(&raw.generating_software),
        scans: Vec::new(),
    })
}

fn of_e57(input: files::Input) -> Result<ScanFacts, ParseError> {
    let opened = guarded(|| E57Reader::new(input).map_err(|why| e57::fault(&why)));
    let reader = opened.unwrap_or_else(|| Err(e57::odd()))?;
    let clouds = reader.pointclouds();
    let mut columns: Vec<String> = Vec::new();
    for record in clouds.iter().flat_map(|cloud| cloud.prototype.iter().take(MOST_COLUMNS)) {
        let name = text(format!("{:?}", record.name).as_bytes());
        if columns.len() < MOST_COLUMNS && !columns.contains(&name) {
            columns.push(name);
        }
    }
    let scan = |cloud: &::e57::PointCloud| Scan {
        name: text(cloud.name.as_deref().unwrap_or_default().as_bytes()),
        points: cloud.records,
        station: e57::station(cloud),
    };
    Ok(ScanFacts {
        format: "E57 1.0".to_owned(),
        points: clouds.iter().fold(0, |sum, cloud| sum.saturating_add(cloud.records)),
        bounds: None,
        columns,
        system: reader.coordinate_metadata().map(|system| text(system.as_bytes())).filter(|system| !system.is_empty()),
        writer: text(reader.library_version().unwrap_or_default().as_bytes()),
        scans: clouds.iter().map(scan).collect(),
    })
}
