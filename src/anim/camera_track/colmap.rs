//! COLMAP's images and cameras, as text and binary: world to camera, w first, axes of `OpenCV`.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;

use super::text::{is_comment, lines, numbers};
use super::{Fault, Lens, Pose, fault, of_open_cv, quaternion};
use crate::anim::error::AnimError;
use crate::anim::load;

/// Models of lenses by number: their names, and those of their parameters.
const MODELS: [(&str, &[&str]); 11] = [
    ("SIMPLE_PINHOLE", &["f", "cx", "cy"]),
    ("PINHOLE", &["fx", "fy", "cx", "cy"]),
    ("SIMPLE_RADIAL", &["f", "cx", "cy", "k1"]),
    ("RADIAL", &["f", "cx", "cy", "k1", "k2"]),
    ("OPENCV", &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"]),
    ("OPENCV_FISHEYE", &["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"]),
    ("FULL_OPENCV", &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]),
    ("FOV", &["fx", "fy", "cx", "cy", "omega"]),
    ("SIMPLE_RADIAL_FISHEYE", &["f", "cx", "cy", "k1"]),
    ("RADIAL_FISHEYE", &["f", "cx", "cy", "k1", "k2"]),
    ("THIN_PRISM_FISHEYE", &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"]),
];

/// Reads `images.txt` or `images.bin` at `path`; the cameras lie beside it.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Result<Vec<Pose>, Fault>, AnimError> {
    let binary = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("bin"));
    let beside = path.with_file_name(if binary { "cameras.bin" } else { "cameras.txt" });
    let cameras = load::bytes(&beside)?;
    let of_cameras = |fault: Fault| Fault { place: format!("{}: {}", beside.display(), fault.place), ..fault };
    let read = if binary {
        binary_cameras(&cameras).map_err(of_cameras).and_then(|lenses| binary_images(bytes, &lenses))
    } else {
        text_cameras(&cameras).map_err(of_cameras).and_then(|lenses| text_images(bytes, &lenses))
    };
    Ok(read)
}

fn text_cameras(bytes: &[u8]) -> Result<BTreeMap<i64, Lens>, Fault> {
    let mut lenses = BTreeMap::new();
    for (line, words) in lines(bytes).filter(|(_, words)| !words.is_empty() && !is_comment(words)) {
        let place = format!("line {line}");
        let id = whole(&place, words.first())?;
        let name = words.get(1).copied().unwrap_or_default();
        let model = MODELS.iter().find(|(known, _)| *known == name);
        let (name, parameters) = *model.ok_or_else(|| unknown(&place, name))?;
        let size: [f64; 2] = numbers(line, &words, 2)?;
        let mut values = Vec::new();
        for i in 0..parameters.len() {
            values.push(numbers::<1>(line, &words, 4 + i)?[0]);
        }
        lenses.insert(id, lens(name, parameters, size, &values));
    }
    Ok(lenses)
}

fn text_images(bytes: &[u8], lenses: &BTreeMap<i64, Lens>) -> Result<Vec<Pose>, Fault> {
    let mut poses = Vec::new();
    let mut lines = lines(bytes).filter(|(_, words)| !is_comment(words));
    while let Some((line, words)) = lines.next() {
        // Empty lines are those of points that follow each image.
        if words.is_empty() {
            continue;
        }
        let [w, x, y, z, tx, ty, tz] = numbers(line, &words, 1)?;
        let place = format!("line {line}");
        let camera = whole(&place, words.get(8))?;
        let name = words.get(9..).unwrap_or_default().join(" ");
        poses.push(pose(&place, name, [w, x, y, z], [tx, ty, tz], lenses.get(&camera), camera)?);
        lines.next();
    }
    Ok(poses)
}

fn whole(place: &str, word: Option<&&str>) -> Result<i64, Fault> {
    let word = word.copied().unwrap_or_default();
    let short: String = word.chars().take(40).collect();
    word.parse().map_err(|_| fault(place, format!("`{short}`"), "a whole number"))
}

fn unknown(place: &str, name: &str) -> Fault {
    let known: Vec<&str> = MODELS.iter().map(|(known, _)| *known).collect();
    let short: String = name.chars().take(40).collect();
    fault(place, format!("the camera model `{short}`"), format!("one of {}", known.join(", ")))
}

fn lens(model: &str, parameters: &[&'static str], size: [f64; 2], values: &[f64]) -> Lens {
    let of = |name: &str| parameters.iter().position(|known| *known == name).and_then(|i| values.get(i).copied());
    let single = of("f");
    let focal = ["fx", "fy"].map(|name| of(name).or(single).unwrap_or_default());
    let principal = ["cx", "cy"].map(|name| of(name).unwrap_or_default());
    let others =
        parameters.iter().zip(values).filter(|(name, k)| !["f", "fx", "fy", "cx", "cy"].contains(name) && **k != 0.0);
    let mut distortion: Vec<(&'static str, f64)> = others.map(|(name, k)| (*name, *k)).collect();
    // Its projection is another one, whatever the coefficients.
    if model.contains("FISHEYE") || model == "FOV" {
        distortion.push(("fisheye", 1.0));
    }
    Lens { size, focal, principal, distortion }
}

fn pose(
    place: &str,
    name: String,
    [w, x, y, z]: [f64; 4],
    t: [f64; 3],
    lens: Option<&Lens>,
    camera: i64,
) -> Result<Pose, Fault> {
    let camera_from_world =
        quaternion(x, y, z, w).ok_or_else(|| fault(place, "a quaternion of length 0", "a rotation"))?;
    let lens = lens.ok_or_else(|| fault(place, format!("camera {camera}"), "a camera of the file of cameras"))?;
    let rotation = camera_from_world.conjugate();
    let position = -(rotation * DVec3::from_array(t));
    Ok(Pose { name, time: None, position, rotation: of_open_cv(rotation), lens: Some(lens.clone()) })
}

/// A cursor over a binary file.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let found = self.bytes.get(self.at..).and_then(<[u8]>::first_chunk::<N>).copied();
        let place = format!("byte {}", self.at);
        self.at += N;
        found.ok_or_else(|| fault(&place, "the end of the file", format!("{N} bytes")))
    }

    fn float(&mut self) -> Result<f64, Fault> {
        let place = format!("byte {}", self.at);
        let value = f64::from_le_bytes(self.take()?);
        if value.is_finite() { Ok(value) } else { Err(fault(&place, value.to_string(), "a finite number")) }
    }

    /// A count of records that take `least` bytes each.
    fn count(&mut self, least: usize) -> Result<u64, Fault> {
        let place = format!("byte {}", self.at);
        let count = u64::from_le_bytes(self.take()?);
        let left = self.bytes.len().saturating_sub(self.at) / least;
        if count > left as u64 {
            return Err(fault(&place, format!("{count} records"), format!("at most {left}: is the file cut short?")));
        }
        Ok(count)
    }
}

fn binary_cameras(bytes: &[u8]) -> Result<BTreeMap<i64, Lens>, Fault> {
    let mut cursor = Cursor { bytes, at: 0 };
    let mut lenses = BTreeMap::new();
    for _ in 0..cursor.count(48)? {
        let id = i32::from_le_bytes(cursor.take()?);
        let place = format!("byte {}", cursor.at);
        let model = i32::from_le_bytes(cursor.take()?);
        let known = usize::try_from(model).ok().and_then(|model| MODELS.get(model));
        let (name, parameters) = *known.ok_or_else(|| unknown(&place, &model.to_string()))?;
        let size = [u64::from_le_bytes(cursor.take()?), u64::from_le_bytes(cursor.take()?)].map(|size| size as f64);
        let values = parameters.iter().map(|_| cursor.float()).collect::<Result<Vec<f64>, _>>()?;
        lenses.insert(i64::from(id), lens(name, parameters, size, &values));
    }
    Ok(lenses)
}

fn binary_images(bytes: &[u8], lenses: &BTreeMap<i64, Lens>) -> Result<Vec<Pose>, Fault> {
    /// Bytes of a point of an image.
    const POINT: usize = 24;
    let mut cursor = Cursor { bytes, at: 0 };
    let mut poses = Vec::new();
    for _ in 0..cursor.count(73)? {
        let place = format!("byte {}", cursor.at);
        let _id: [u8; 4] = cursor.take()?;
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = cursor.float()?;
        }
        let [w, x, y, z, tx, ty, tz] = numbers;
        let camera = i64::from(i32::from_le_bytes(cursor.take()?));
        let rest = bytes.get(cursor.at..).unwrap_or_default();
        let end =
            rest.iter().position(|&b| b == 0).ok_or_else(|| fault(&place, "a name without end", "a 0 behind it"))?;
        let name = String::from_utf8_lossy(&rest[..end]).into_owned();
        cursor.at += end + 1;
        let points = cursor.count(POINT)? as usize;
        cursor.at += points * POINT;
        poses.push(pose(&place, name, [w, x, y, z], [tx, ty, tz], lenses.get(&camera), camera)?);
    }
    Ok(poses)
}
