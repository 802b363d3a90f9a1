//! What stands for 1 in the colours, normals and opacities of a PLY file.
//!
//! A type says what a number means: a byte goes to 255, a whole number of 16 bits to 65535, a float to 1. Many programs
//! write numbers that mean something else. All numbers of a column are looked at, and where they contradict the type
//! they decide, and a note says so. docs/what-is-taken.md is the list.

use glam::Vec3;

use super::cloud::{Cloud, ColourStorage};
use super::columns::Columns;
use super::ply_header::Scalar;

/// Greatest float colour that still counts as 1: rounding.
const ONE: f32 = 1.001;
/// What the numbers of a wider type are taken for that are not above this.
const BYTE: f32 = 255.0;

/// Brings the colours, opacities and normals of a cloud, which are as its file has them, to their ranges.
/// `linear_colours`: the file says that its float colours are linear and may exceed 1.
pub(super) fn scale(cloud: &mut Cloud, columns: &Columns, linear_colours: bool) {
    if let Some(kind) = columns.colour_type {
        colours(cloud, kind, columns.is_grey(), linear_colours);
    }
    if let Some(kind) = columns.normal_type.filter(|kind| kind.is_unsigned()) {
        normals(cloud, kind);
    }
    if let Some(kind) = columns.opacity_type.filter(|kind| !kind.is_float()) {
        opacities(cloud, kind);
    }
}

/// Brings colours to 0..=1. Bytes are divided by 255, 16-bit numbers by 65535, and by 255 where none is above it, as
/// are whole numbers of 32 bits. Floats are in 0..=1, or in 0..=255 where one exceeds 1 by more than rounding.
fn colours(cloud: &mut Cloud, kind: Scalar, grey: bool, declared_linear: bool) {
    let largest = cloud.colour.iter().filter(|c| c.is_finite()).fold(0.0_f32, |m, c| m.max(c.max_element()));
    let divisor = match kind {
        _ if declared_linear && kind.is_float() => 1.0,
        Scalar::I8 | Scalar::U8 => 255.0,
        Scalar::F32 | Scalar::F64 if largest <= ONE => 1.0,
        _ if largest <= BYTE => 255.0,
        Scalar::U16 => 65535.0,
        _ if grey => f64::from(largest),
        _ if kind.is_float() => 255.0,
        _ => 65535.0,
    };
    let is_byte = matches!(kind, Scalar::I8 | Scalar::U8);
    if kind.is_float() && divisor == 1.0 {
        cloud.colour_storage = ColourStorage::Float;
    } else if kind.is_float() {
        cloud.notes.push(format!("float colours up to {largest}: divided by {divisor}, taken as sRGB"));
    } else if !is_byte && largest > 0.0 && divisor == 255.0 {
        let name = kind.name();
        cloud.notes.push(format!("colours of type {name} are not above {largest}: taken as 0 to 255, as bytes are"));
    }
    let scale = |x: f32| (f64::from(unsigned(kind, x)) / divisor) as f32;
    cloud.colour.iter_mut().for_each(|c| *c = Vec3::new(scale(c.x), scale(c.y), scale(c.z)));
}

/// Maps normals of an unsigned type to -1..=1, about the middle of the type. A signed type needs nothing: the length of
/// a normal does not count.
fn normals(cloud: &mut Cloud, kind: Scalar) {
    let largest = cloud.normal.iter().fold(0.0_f32, |m, n| m.max(n.max_element()));
    let name = kind.name();
    if largest <= 1.0 {
        if largest > 0.0 {
            cloud.notes.push(format!("normals of type {name} are 0 or 1: taken as they are"));
        }
        return;
    }
    let most = if largest <= BYTE { 255.0 } else { kind.largest_of_whole() };
    cloud.notes.push(format!("normals of type {name}: 0 to {most} taken as -1 to 1"));
    // The numbers beside the middle stand for 0: a normal of them alone is none.
    let nothing = 1.5 / most;
    for normal in &mut cloud.normal {
        let wide = normal.as_dvec3() * (2.0 / most) - 1.0;
        *normal = if wide.abs().max_element() < nothing { Vec3::ZERO } else { wide.as_vec3() };
    }
}

/// Brings opacities of whole numbers to 0..=1.
fn opacities(cloud: &mut Cloud, kind: Scalar) {
    let (type_most, name) = (kind.largest_of_whole(), kind.name());
    let largest = cloud.opacity.iter().fold(0.0_f32, |m, o| m.max(unsigned(kind, *o)));
    let one = if largest == 1.0 {
        cloud.notes.push(format!("opacities of type {name} are 0 or 1: 1 is taken as opaque"));
        1.0
    } else if largest > 0.0 && largest <= BYTE && type_most > 255.0 {
        let expected = "taken as 0 to 255, as bytes are";
        cloud.notes.push(format!("opacities of type {name} are not above {largest}: {expected}"));
        255.0
    } else {
        type_most
    };
    cloud.opacity.iter_mut().for_each(|o| *o = (f64::from(unsigned(kind, *o)) / one) as f32);
}

/// A share as it was meant: the sign of a signed byte is an accident.
fn unsigned(kind: Scalar, x: f32) -> f32 {
    if kind == Scalar::I8 && x < 0.0 { x + 256.0 } else { x }
}
