//! Several files as one model: a name with stars, as `scan/*.laz`.

use std::path::{Path, PathBuf};

use super::cloud::{Cloud, ColourStorage, each_column};
use super::error::ModelError;
use crate::math::srgb;

/// The files that a path with stars in its name stands for, by name; `None` for the path of one file. A star stands
/// for any text, in the name of the file alone. A file that is really called so is one file.
///
/// # Errors
/// There is no such file, or the folder cannot be read.
pub fn matching(path: &Path) -> Result<Option<Vec<PathBuf>>, ModelError> {
    let Some(pattern) = path.file_name().and_then(|name| name.to_str()).filter(|name| name.contains('*')) else {
        return Ok(None);
    };
    if path.is_file() {
        return Ok(None);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let failed = |source| ModelError::Read { path: path.to_owned(), source };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name();
        // What a link leads to is found out when it is opened.
        if name.to_str().is_some_and(|name| fits(pattern, name)) && !entry.path().is_dir() {
            files.push(path.with_file_name(name));
        }
    }
    if files.is_empty() {
        return Err(ModelError::NoMatch { path: path.to_owned() });
    }
    files.sort();
    Ok(Some(files))
}

/// Does a name fit a pattern with at least one star?
fn fits(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let (first, last) = (parts.next().unwrap_or_default(), parts.next_back().unwrap_or_default());
    let inner = name.strip_prefix(first).and_then(|name| name.strip_suffix(last));
    let Some(mut rest) = inner else { return false };
    parts.all(|part| {
        let found = rest.find(part);
        rest = &rest[found.map_or(0, |at| at + part.len())..];
        found.is_some()
    })
}

/// Joins the clouds of several files, in order. Columns that one file lacks are left out, and the notes say so.
pub(super) fn joined(clouds: Vec<Cloud>) -> Cloud {
    let mut clouds = clouds.into_iter();
    let Some(mut all) = clouds.next() else { return Cloud::default() };
    for cloud in clouds {
        add(&mut all, cloud);
    }
    all
}

fn add(all: &mut Cloud, mut cloud: Cloud) {
    fn column<T>(all: &mut Vec<T>, other: Vec<T>, name: &str, notes: &mut Vec<String>) {
        if all.is_empty() == other.is_empty() {
            all.extend(other);
            return;
        }
        all.clear();
        let note = format!("{name} left out: not all files have them");
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    let mut notes = std::mem::take(&mut all.notes);
    notes.append(&mut cloud.notes);
    // Empty columns of an empty cloud lack nothing.
    if all.position.is_empty() || cloud.position.is_empty() {
        let full = if all.position.is_empty() { cloud } else { std::mem::take(all) };
        *all = Cloud { notes, ..full };
        return;
    }
    if all.colour_storage != cloud.colour_storage && !all.colour.is_empty() && !cloud.colour.is_empty() {
        // One meaning for all: that of floats.
        for (part, storage) in [(&mut all.colour, all.colour_storage), (&mut cloud.colour, cloud.colour_storage)] {
            if storage == ColourStorage::Integer {
                for c in part.iter_mut() {
                    *c = c.to_array().map(srgb::to_linear).into();
                }
            }
        }
        all.colour_storage = ColourStorage::Float;
    }
    let base = all.stations.len();
    let shifted: Option<Vec<u16>> =
        cloud.station.iter().map(|station| u16::try_from(base + usize::from(*station)).ok()).collect();
    all.position.append(&mut cloud.position);
    cloud.station = shifted.unwrap_or_default();
    macro_rules! join {
        ($column:ident, $name:expr) => {
            column(&mut all.$column, std::mem::take(&mut cloud.$column), $name, &mut notes);
        };
    }
    each_column!(join);
    all.stations.append(&mut cloud.stations);
    all.two_sided |= cloud.two_sided;
    all.notes = notes;
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;

    #[test]
    fn stars_stand_for_any_text() {
        assert!(fits("*.laz", "a.laz") && fits("*.laz", ".laz") && fits("a*b*c", "axxbyyc") && fits("a*b", "ab"));
        assert!(!fits("*.laz", "a.las") && !fits("a*a", "a") && !fits("a*b*c", "acb") && !fits("a*x*b", "ab"));
    }

    #[test]
    fn columns_that_one_file_lacks_are_left_out() {
        let cloud = |x: f64| Cloud {
            position: vec![DVec3::splat(x)],
            stations: vec![DVec3::X],
            station: vec![0],
            ..Cloud::default()
        };
        let coloured = Cloud { colour: vec![Vec3::ONE], ..cloud(1.0) };
        let all = joined(vec![cloud(0.0), Cloud::default(), coloured.clone(), coloured]);
        assert_eq!((all.position.len(), all.colour.len()), (3, 0));
        assert_eq!((all.stations.len(), all.station), (3, vec![0, 1, 2]));
        assert_eq!(all.notes, ["colours left out: not all files have them"]);
    }

    #[test]
    fn files_come_by_name() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.xyz", "a.xyz", "c.ply"] {
            std::fs::write(folder.path().join(name), "0 0 0\n").unwrap();
        }
        let found = matching(&folder.path().join("*.xyz")).unwrap().unwrap();
        assert_eq!(found, ["a.xyz", "b.xyz"].map(|name| folder.path().join(name)));
        assert_eq!(matching(&folder.path().join("a.xyz")).unwrap(), None);
        assert!(matching(&folder.path().join("*.las")).is_err() && matching(&folder.path().join("no/*.las")).is_err());
    }
}
