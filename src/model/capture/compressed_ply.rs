//! Compressed Gaussian-splat PLY: 16 bytes for each Gaussian, in chunks of 256.
//!
//! The element `chunk` has the ranges of its Gaussians, `vertex` has four whole numbers for each Gaussian that say
//! where in these ranges it lies, and `sh` may have its harmonics. The elements come in this order.

use glam::Vec3;

use super::smallest_three;
use super::{Gaussian, Gaussians, MOST_HARMONICS, SH_C0, harmonics_of};
use crate::model::error::ParseError;
use crate::model::ply_body::{Body, within};
use crate::model::ply_header::{Element, Header, PropertyKind, Scalar};

/// Gaussians of a chunk.
const CHUNK: usize = 256;

/// Columns of a chunk: least and largest position, ln sigma and, if given, colour.
const RANGES: [&str; 18] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];

/// The ranges that every chunk has. Older files have no others: their colours lie in 0 to 1.
const NEEDED_RANGES: usize = 12;

/// Columns of a Gaussian.
const PACKED: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];

/// True if the vertices of a PLY file are packed Gaussians.
pub(in crate::model) fn is_compressed(header: &Header) -> bool {
    let vertex = header.elements.iter().find(|element| element.name == "vertex");
    vertex.is_some_and(|vertex| place(vertex, "packed_position").is_some() && place(vertex, "x").is_none())
}

/// Reads the body. `progress` now and then gets the share of Gaussians read.
///
/// # Errors
/// The error names the line or the byte. An element or column is missing, out of order or of another type, the counts
/// of the elements disagree, or the body is cut short.
pub(in crate::model) fn parse(
    header: &Header,
    body: &mut Body<'_>,
    progress: &dyn Fn(f32),
) -> Result<Gaussians, ParseError> {
    let mut chunks = None;
    let mut vertex: Option<(&Element, Vec<[u32; 4]>)> = None;
    let mut gaussians = None;
    let mut notes = Vec::new();
    for element in &header.elements {
        match (element.name.as_str(), &vertex) {
            ("chunk", None) => chunks = Some((element, read_chunks(body, element)?)),
            ("vertex", _) => vertex = Some((element, read_packed(body, element, progress)?)),
            ("sh", Some((vertex, packed))) => {
                let (_, ranges) = covering(chunks.as_ref(), vertex, packed.len())?;
                gaussians = Some(read_harmonics(body, element, ranges, packed)?);
            }
            ("chunk" | "sh", _) => {
                let found = format!("element `{}` in another place", element.name);
                return Err(ParseError::line(element.line, found, "the elements in the order chunk, vertex, sh"));
            }
            _ => body.skip_element(element)?,
        }
    }
    let Some((element, packed)) = vertex else {
        return Err(ParseError::line(1, "no element `vertex`", "`element vertex COUNT` in the header"));
    };
    let (surplus, ranges) = covering(chunks.as_ref(), element, packed.len())?;
    if surplus > 0 {
        notes.push(format!("{surplus} chunks without Gaussians ignored"));
    }
    let gaussians = gaussians.unwrap_or_else(|| {
        let mut gaussians = Gaussians::of_degree(0);
        for (range, four) in each_in(ranges).zip(&packed) {
            gaussians.push(&unpack(range, *four));
        }
        gaussians
    });
    Ok(Gaussians { notes, ..gaussians })
}

/// Index of a property.
fn place(element: &Element, name: &str) -> Option<usize> {
    element.properties.iter().position(|property| property.name == name)
}

/// Index of a property that must have this type.
fn place_of(element: &Element, name: &str, scalar: Scalar) -> Result<usize, ParseError> {
    let wanted = format!("`property {} {name}`", scalar.name());
    let fault = |found: String| ParseError::line(element.line, found, wanted.clone());
    let place = place(element, name).ok_or_else(|| fault(format!("element `{}` without {name}", element.name)))?;
    match element.properties.get(place).map(|property| property.kind) {
        Some(PropertyKind::Scalar(found)) if found == scalar => Ok(place),
        Some(PropertyKind::Scalar(found)) => Err(fault(format!("{name} of type {}", found.name()))),
        _ => Err(fault(format!("a list {name}"))),
    }
}

/// Reads the numbers of a record into `values`, in the order of its properties. Lists are skipped.
fn read_record(body: &mut Body<'_>, element: &Element, row: usize, values: &mut Vec<f64>) -> Result<(), ParseError> {
    values.clear();
    for property in &element.properties {
        let value = match property.kind {
            PropertyKind::Scalar(scalar) => body.scalar(scalar),
            list @ PropertyKind::List { .. } => body.skip(list).map(|()| 0.0),
        };
        values.push(value.map_err(|e| within(e, element, row, &property.name))?);
    }
    Ok(())
}

/// The ranges of a chunk, in the order of [`RANGES`]. Single precision is what files have.
type Ranges = [f32; RANGES.len()];

fn read_chunks(body: &mut Body<'_>, element: &Element) -> Result<Vec<Ranges>, ParseError> {
    let mut places = Vec::with_capacity(RANGES.len());
    for (k, name) in RANGES.iter().enumerate() {
        if k == NEEDED_RANGES && RANGES[k..].iter().all(|name| place(element, name).is_none()) {
            break;
        }
        places.push(place_of(element, name, Scalar::F32)?);
    }
    let count = body.count(element)?;
    let mut chunks = Vec::with_capacity(count);
    let mut values = Vec::new();
    for row in 0..count {
        read_record(body, element, row, &mut values)?;
        let mut ranges: Ranges = [0.0; RANGES.len()];
        ranges[RANGES.len() - 3..].fill(1.0);
        for (range, place) in ranges.iter_mut().zip(&places) {
            *range = values[*place] as f32;
        }
        chunks.push(ranges);
    }
    Ok(chunks)
}

fn read_packed(body: &mut Body<'_>, element: &Element, progress: &dyn Fn(f32)) -> Result<Vec<[u32; 4]>, ParseError> {
    const REPORT: usize = 1 << 16;
    let mut places = [0; PACKED.len()];
    for (place, name) in places.iter_mut().zip(PACKED) {
        *place = place_of(element, name, Scalar::U32)?;
    }
    let count = body.count(element)?;
    let mut packed = Vec::with_capacity(count);
    let mut values = Vec::new();
    for row in 0..count {
        if row % REPORT == 0 {
            progress(row as f32 / count as f32);
        }
        read_record(body, element, row, &mut values)?;
        packed.push(places.map(|place| values[place] as u32));
    }
    Ok(packed)
}

/// The chunks of `count` Gaussians, after the number of chunks that are too many.
fn covering<'a>(
    chunks: Option<&'a (&Element, Vec<Ranges>)>,
    vertex: &Element,
    count: usize,
) -> Result<(usize, &'a [Ranges]), ParseError> {
    let needed = count.div_ceil(CHUNK);
    let expected = format!("{needed}: one for {CHUNK} Gaussians each");
    match chunks {
        None if needed > 0 => {
            Err(ParseError::line(vertex.line, "packed Gaussians without an element `chunk`", expected))
        }
        None => Ok((0, &[])),
        Some((_, ranges)) if ranges.len() >= needed => Ok((ranges.len() - needed, ranges)),
        Some((element, ranges)) => {
            let found = format!("{} chunks for {count} Gaussians", ranges.len());
            Err(ParseError::line(element.line, found, expected))
        }
    }
}

/// The ranges of each Gaussian in turn.
fn each_in(ranges: &[Ranges]) -> impl Iterator<Item = &Ranges> {
    ranges.iter().flat_map(|ranges| std::iter::repeat_n(ranges, CHUNK))
}

/// Reads the harmonics, and so completes the Gaussians.
fn read_harmonics(
    body: &mut Body<'_>,
    element: &Element,
    ranges: &[Ranges],
    packed: &[[u32; 4]],
) -> Result<Gaussians, ParseError> {
    // One more than there may be: names are not searched for without end.
    let given = (0..=3 * MOST_HARMONICS).take_while(|k| place(element, &format!("f_rest_{k}")).is_some()).count();
    let Some(degree) = (1..=3_u8).find(|&degree| 3 * harmonics_of(degree) == given) else {
        let found = format!("element `sh` with {given} columns f_rest_0, f_rest_1, ..");
        return Err(ParseError::line(element.line, found, "9, 24 or 45 of them"));
    };
    let mut places = Vec::with_capacity(given);
    for k in 0..given {
        places.push(place_of(element, &format!("f_rest_{k}"), Scalar::U8)?);
    }
    let count = body.count(element)?;
    if count != packed.len() {
        let found = format!("{count} of element `sh`");
        return Err(ParseError::line(element.line, found, format!("{}, as many as of `vertex`", packed.len())));
    }
    let mut gaussians = Gaussians::of_degree(degree);
    let each = gaussians.harmonics_each();
    let mut values = Vec::new();
    for (row, (range, four)) in each_in(ranges).zip(packed).enumerate() {
        read_record(body, element, row, &mut values)?;
        let mut harmonics = [Vec3::ZERO; MOST_HARMONICS];
        for (k, harmonic) in harmonics[..each].iter_mut().enumerate() {
            *harmonic = Vec3::from_array([0, 1, 2].map(|channel| coefficient(values[places[channel * each + k]])));
        }
        gaussians.push(&Gaussian { harmonics, ..unpack(range, *four) });
    }
    Ok(gaussians)
}

/// The harmonic of a byte: -4 to 4, with both ends and zero met closely.
fn coefficient(byte: f64) -> f32 {
    let share = match byte {
        0.0 => 0.0,
        255.0 => 1.0,
        _ => (byte + 0.5) / 256.0,
    };
    (8.0 * (share - 0.5)) as f32
}

/// The Gaussian of four packed numbers, without harmonics.
fn unpack(ranges: &Ranges, [position, rotation, scale, colour]: [u32; 4]) -> Gaussian {
    // The share of a field of `bits` bits that ends at bit `low`.
    let share = |packed: u32, low: u32, bits: u32| {
        let most = (1_u32 << bits) - 1;
        f64::from((packed >> low) & most) / f64::from(most)
    };
    // The three values of a group of `RANGES`, from its least to its largest.
    let within = |first: usize, shares: [f64; 3]| {
        [0, 1, 2].map(|axis| {
            let [low, high] = [ranges[first + axis], ranges[first + 3 + axis]].map(f64::from);
            low * (1.0 - shares[axis]) + high * shares[axis]
        })
    };
    let three = |packed| [share(packed, 21, 11), share(packed, 11, 10), share(packed, 0, 11)];
    let others = [20, 10, 0].map(|low| (share(rotation, low, 10) - 0.5) * std::f64::consts::SQRT_2);
    let rgb = within(12, [24, 16, 8].map(|low| share(colour, low, 8)));
    Gaussian {
        position: within(0, three(position)),
        sigma: within(6, three(scale)).map(f64::exp),
        rotation: smallest_three::restore((rotation >> 30) as usize, others),
        opacity: share(colour, 0, 8),
        base: rgb.map(|c| (c - 0.5) / f64::from(SH_C0)),
        harmonics: [Vec3::ZERO; MOST_HARMONICS],
    }
}
