//! Writes surfels as a binary PLY file that other programs can read.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use glam::Vec3;

use super::columns::MATERIAL;
use super::error::ModelError;
use super::ply::{LINEAR_COLOURS, PER_FRAME, SIGNS_ESTIMATED, TWO_SIDED};
use super::store;
use super::surfels::{Surfels, VelocityUnit};
use crate::math::srgb;

/// Writes surfels as little-endian PLY: position, normal, axes (tux..tvz), radius and colour, and where there are any,
/// opacity (alpha), material (ambient, diffuse, specular, shininess), velocity (vx, vy, vz), acceleration (ax, ay,
/// az) and id.
///
/// [`super::load()`] gives back the same normals, axes, colours, materials, velocities, accelerations and ids up to
/// 2^53, and opacities unless they are all 0 or all as good as 1. A comment says where velocities are per frame; else
/// they are per second. Positions are floats, exact where the origin is zero. Otherwise they are doubles, which are
/// exact in model space to 2^-53 of their size; the reader chooses an origin of its own. Colours are bytes (sRGB)
/// where that is exact for every surfel. Otherwise they are linear floats, which other programs may show too dark; a
/// comment in the file says so.
///
/// # Errors
/// The file cannot be written (then nothing is left behind), or the arrays differ in length.
pub fn write_ply(path: &Path, surfels: &Surfels) -> Result<(), ModelError> {
    store::check_columns(surfels)?;
    let s = surfels;
    let wide = s.origin != glam::DVec3::ZERO;
    let bytes: Option<Vec<[u8; 3]>> = s.colour.iter().map(|c| as_bytes(*c)).collect();
    let header = header(s, wide, bytes.is_some());
    store::write(path, |out| {
        out.write_all(header.as_bytes())?;
        for i in 0..s.len() {
            if wide {
                let p = s.origin + s.position[i].as_dvec3();
                out.write_all(p.to_array().map(f64::to_le_bytes).as_flattened())?;
            } else {
                out.write_all(s.position[i].to_array().map(f32::to_le_bytes).as_flattened())?;
            }
            for v in [s.normal[i], s.axis_u[i], s.axis_v[i]] {
                out.write_all(v.to_array().map(f32::to_le_bytes).as_flattened())?;
            }
            out.write_all(&s.radius(i).to_le_bytes())?;
            match bytes.as_ref().and_then(|b| b.get(i)) {
                Some(rgb) => out.write_all(rgb)?,
                None => out.write_all(s.colour[i].to_array().map(f32::to_le_bytes).as_flattened())?,
            }
            if let Some(opacity) = s.opacity.get(i) {
                out.write_all(&opacity.to_le_bytes())?;
            }
            if let Some(m) = s.material.get(i) {
                let values = [m.ambient, m.diffuse, m.specular, m.shininess];
                out.write_all(values.map(f32::to_le_bytes).as_flattened())?;
            }
            for v in [s.velocity.get(i), s.acceleration.get(i)].into_iter().flatten() {
                out.write_all(v.to_array().map(f32::to_le_bytes).as_flattened())?;
            }
            if let Some(&id) = s.id.get(i) {
                out.write_all(&(id as f64).to_le_bytes())?;
            }
        }
        Ok(())
    })
}

fn header(s: &Surfels, wide: bool, byte_colours: bool) -> String {
    // Writing to a string cannot fail.
    let mut text = "ply\nformat binary_little_endian 1.0\n".to_owned();
    if !byte_colours {
        let _ = writeln!(text, "comment {LINEAR_COLOURS}");
    }
    if s.two_sided {
        let _ = writeln!(text, "comment {TWO_SIDED}");
    }
    if s.signs_estimated {
        let _ = writeln!(text, "comment {SIGNS_ESTIMATED}");
    }
    if !(s.velocity.is_empty() && s.acceleration.is_empty()) && s.velocity_unit == VelocityUnit::Frame {
        let _ = writeln!(text, "comment {PER_FRAME}");
    }
    let _ = writeln!(text, "element vertex {}", s.len());
    let mut properties = |kind: &str, names: &[&str]| {
        for name in names {
            let _ = writeln!(text, "property {kind} {name}");
        }
    };
    properties(if wide { "double" } else { "float" }, &["x", "y", "z"]);
    properties("float", &["nx", "ny", "nz", "tux", "tuy", "tuz", "tvx", "tvy", "tvz", "radius"]);
    properties(if byte_colours { "uchar" } else { "float" }, &["red", "green", "blue"]);
    if !s.opacity.is_empty() {
        properties("float", &["alpha"]);
    }
    if !s.material.is_empty() {
        properties("float", &MATERIAL);
    }
    if !s.velocity.is_empty() {
        properties("float", &["vx", "vy", "vz"]);
    }
    if !s.acceleration.is_empty() {
        properties("float", &["ax", "ay", "az"]);
    }
    if !s.id.is_empty() {
        properties("double", &["id"]);
    }
    text + "end_header\n"
}

/// The sRGB bytes from which a reader computes exactly this colour; `None` if there are none.
fn as_bytes(linear: Vec3) -> Option<[u8; 3]> {
    let channel = |x: f32| {
        let encoded = srgb::from_linear(x) * 255.0;
        let byte = encoded.round().clamp(0.0, 255.0) as u8;
        let read_back = srgb::to_linear((f64::from(byte) / 255.0) as f32);
        (read_back.to_bits() == x.to_bits()).then_some(byte)
    };
    Some([channel(linear.x)?, channel(linear.y)?, channel(linear.z)?])
}
