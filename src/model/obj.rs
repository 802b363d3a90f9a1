//! Wavefront OBJ: vertices as points, faces for their normals.
//!
//! The reader is our own, as it needs little: `v x y z [w] [r g b]`, `vn`, and `f` with `v`, `v/vt`, `v//vn`, `v/vt/vn`
//! and negative (relative) indices. All other statements are skipped. Normals of a file are used only where it has as
//! many as vertices and no face (a point cloud). With faces, normals belong to corners, not to vertices, so the
//! area-weighted normal is taken instead. Vertex colours (an extension of `MeshLab`) are 8-bit colours divided by 255,
//! hence sRGB.

use glam::{DVec3, Vec3};

use super::area_normals::{self, AreaNormals};
use super::cloud::{Cloud, ColourStorage};
use super::error::{ParseError, quote};
use super::ply_body::number;

/// Reads an OBJ file.
///
/// # Errors
/// The error names the line. A `v`, `vn` or `f` statement has missing or bad numbers, or an index names no vertex above
/// it.
pub(super) fn parse(bytes: &[u8], progress: &dyn Fn(f32)) -> Result<Cloud, ParseError> {
    let mut cloud = Cloud { colour_storage: ColourStorage::Integer, ..Cloud::default() };
    let mut normals = Vec::new();
    let mut coloured = 0_usize;
    let mut has_faces = false;
    for (line, words) in statements(bytes) {
        if line % 65536 == 0 {
            progress(line as f32 / bytes.len() as f32);
        }
        match words.split_first() {
            Some((&b"v", rest)) => {
                let values = numbers(rest, line)?;
                let colour = match values.as_slice() {
                    [_, _, _] | [_, _, _, _] => None,
                    [_, _, _, r, g, b] | [_, _, _, _, r, g, b] => Some(Vec3::new(*r as f32, *g as f32, *b as f32)),
                    _ => {
                        return Err(ParseError::line(
                            line,
                            format!("{} numbers", values.len()),
                            "`v x y z [w] [r g b]`",
                        ));
                    }
                };
                coloured += usize::from(colour.is_some());
                if let [x, y, z, ..] = *values.as_slice() {
                    cloud.position.push(DVec3::new(x, y, z));
                }
                cloud.colour.push(colour.unwrap_or(Vec3::ONE));
            }
            Some((&b"vn", rest)) => match *numbers(rest, line)?.as_slice() {
                [x, y, z] => normals.push(DVec3::new(x, y, z).try_normalize().unwrap_or(DVec3::ZERO).as_vec3()),
                ref other => return Err(ParseError::line(line, format!("{} numbers", other.len()), "`vn x y z`")),
            },
            Some((&b"f", _)) => has_faces = true,
            _ => {}
        }
    }
    if cloud.position.is_empty() {
        return Err(ParseError::line(1, "no vertex in the whole file", "statements `v x y z` (is this an OBJ file?)"));
    }
    if coloured == 0 {
        cloud.colour = Vec::new();
    }
    if has_faces {
        let (from_faces, faces) = face_normals(bytes, &cloud.position)?;
        cloud.normal = from_faces;
        cloud.notes.push(format!("normals from {faces} faces, weighted by area"));
        cloud.notes.extend(area_normals::too_few(cloud.position.len(), faces));
    } else if normals.len() == cloud.position.len() {
        cloud.normal = normals;
    }
    Ok(cloud)
}

/// Reads the faces in a second pass over the file, so that they need not be kept in memory.
fn face_normals(bytes: &[u8], positions: &[DVec3]) -> Result<(Vec<Vec3>, usize), ParseError> {
    let mut normals = AreaNormals::new(positions);
    let mut polygon = Vec::new();
    let (mut vertices, mut faces) = (0_i64, 0_usize);
    for (line, words) in statements(bytes) {
        match words.split_first() {
            Some((&b"v", _)) => vertices += 1,
            Some((&b"f", corners)) => {
                polygon.clear();
                for corner in corners {
                    let index = corner.split(|&b| b == b'/').next().unwrap_or_default();
                    let index = std::str::from_utf8(index).ok().and_then(|t| t.parse::<i64>().ok());
                    polygon.push(match index {
                        Some(i) if (1..=vertices).contains(&i) => i - 1,
                        Some(i) if (-vertices..0).contains(&i) => vertices + i,
                        _ => {
                            let expected = format!("a vertex index from 1 to {vertices}, or from -{vertices} to -1");
                            return Err(ParseError::line(line, format!("face corner {}", quote(corner)), expected));
                        }
                    });
                }
                if polygon.len() < 3 {
                    return Err(ParseError::line(line, format!("a face of {} corners", polygon.len()), "3 or more"));
                }
                normals.add(&polygon).map_err(|i| ParseError::line(line, format!("vertex {i}"), "a known vertex"))?;
                faces += 1;
            }
            _ => {}
        }
    }
    Ok((normals.finish(), faces))
}

pub(super) fn numbers(words: &[&[u8]], line: u64) -> Result<Vec<f64>, ParseError> {
    let parse = |word: &&[u8]| number(word).ok_or_else(|| ParseError::line(line, quote(word), "a number"));
    words.iter().map(parse).collect()
}

/// Statements as (line number from 1, words). Comments are removed, and a line that ends in a backslash is joined with
/// the next.
pub(super) fn statements(bytes: &[u8]) -> impl Iterator<Item = (u64, Vec<&[u8]>)> {
    let mut lines = bytes.split(|&b| b == b'\n').zip(1_u64..);
    std::iter::from_fn(move || {
        let (line, number) = lines.next()?;
        let mut words = Vec::new();
        let mut line = line;
        loop {
            let code = line.split(|&b| b == b'#').next().unwrap_or_default().trim_ascii_end();
            let (code, goes_on) = match code.strip_suffix(b"\\") {
                Some(code) => (code, true),
                None => (code, false),
            };
            words.extend(code.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()));
            let next = if goes_on { lines.next() } else { None };
            match next {
                Some((next, _)) => line = next,
                None => return Some((number, words)),
            }
        }
    })
}
