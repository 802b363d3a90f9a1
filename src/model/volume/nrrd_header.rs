//! What the headers of NRRD files say (<https://teem.sourceforge.net/nrrd/format.html>): the type of the values, and
//! where they stand. Their grammar is in `nrrd_fields`.

use glam::{DMat3, DVec3};

use super::SPACINGS;
use super::nrrd_fields::{Field, Fields};
use crate::model::error::{ParseError, quote};
use crate::model::tidy::MAX_COORDINATE;

/// Most axes of a file (`NRRD_DIM_MAX` of Teem).
const MOST_AXES: usize = 16;

/// Largest cosine of the angle of two axes that count as at right angles: directions are often written with six digits.
const OBLIQUE: f64 = 1e-4;

/// Type of the values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// How the values are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Raw,
    Text,
    Gzip,
}

/// What a header says.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) kind: Type,
    pub(super) encoding: Encoding,
    /// True where the least byte of a number is the first.
    pub(super) little: bool,
    /// Samples along the three axes of space, >= 1.
    pub(super) sizes: [usize; 3],
    /// Number of samples.
    pub(super) count: usize,
    /// Line of the sizes, for messages.
    pub(super) sizes_line: u64,
    /// Place of the first sample, model units.
    pub(super) origin: DVec3,
    /// Ways from a sample to the next, model units.
    pub(super) steps: DMat3,
    /// Lines before the data.
    pub(super) line_skip: u64,
    /// Bytes before the data, inflated ones for gzip; `None`: the data end with the file.
    pub(super) byte_skip: Option<u64>,
    /// Offset of the first byte after the empty line.
    pub(super) body: usize,
    /// Line of that byte.
    pub(super) body_line: u64,
    pub(super) notes: Vec<String>,
}

impl Type {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "signed char" | "int8" | "int8_t" => Self::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => Self::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Self::I16,
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Self::U16,
            "int" | "signed int" | "int32" | "int32_t" => Self::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => Self::U32,
            "longlong"
            | "long long"
            | "long long int"
            | "signed long long"
            | "signed long long int"
            | "int64"
            | "int64_t" => Self::I64,
            "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Self::U64,
            "float" => Self::F32,
            "double" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of a number.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// A short name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::I8 => "int8",
            Self::U8 => "uint8",
            Self::I16 => "int16",
            Self::U16 => "uint16",
            Self::I32 => "int32",
            Self::U32 => "uint32",
            Self::I64 => "int64",
            Self::U64 => "uint64",
            Self::F32 => "float",
            Self::F64 => "double",
        }
    }
}

/// Reads a header.
///
/// # Errors
/// The error names the line. A field is missing or outside the grammar, the file has not one value for each place of a
/// space of three axes, or axes are not at right angles.
pub(super) fn parse(bytes: &[u8]) -> Result<Header, ParseError> {
    let fields = Fields::read(bytes)?;
    let mut notes = Vec::new();
    let kind = kind(&fields)?;
    let encoding = encoding(&fields)?;
    let little = endian(&fields, kind, encoding)?;
    let dimension = fields.required("dimension")?;
    let axes = dimension.text.parse().ok().filter(|axes| (1..=MOST_AXES).contains(axes));
    let axes = axes.ok_or_else(|| dimension.fault("dimension", format!("3 (from 1 to {MOST_AXES})")))?;
    let (field, all) = sizes(&fields, axes)?;
    let directions = fields.get("space directions").map(|f| f.vectors("space directions", axes)).transpose()?;
    let spatial = spatial(&fields, &all, directions.as_deref())?;
    let sizes = spatial.map(|axis| all[axis]);
    let count = sizes.iter().try_fold(1_usize, |count, size| count.checked_mul(*size));
    let Some(count) = count.filter(|count| count.checked_mul(kind.size()).is_some()) else {
        return Err(field.fault("sizes", "fewer than 2^64 bytes of values"));
    };
    let (origin, steps) = match &directions {
        Some(directions) => {
            let steps = spatial.map(|axis| directions[axis].unwrap_or(DVec3::ZERO));
            (DVec3::ZERO, DMat3::from_cols(steps[0], steps[1], steps[2]))
        }
        None => straight(&fields, axes, spatial, sizes)?,
    };
    let origin = match fields.get("space origin") {
        Some(field) => field.vectors("space origin", 1)?.first().copied().flatten().unwrap_or(origin),
        None => origin,
    };
    check_places(&fields, sizes, origin, steps)?;
    if let Some(space) = fields.get("space").filter(|space| space.text.contains(['-', 'l', 'r', 'L', 'R'])) {
        notes.push(format!("space {}: its axes are taken as x, y, z in their order", quote(space.text.as_bytes())));
    }
    Ok(Header {
        kind,
        encoding,
        little,
        sizes,
        count,
        sizes_line: field.line,
        origin,
        steps,
        line_skip: fields.whole("line skip")?.unwrap_or(0) as u64,
        byte_skip: fields.whole("byte skip")?.map(|skip| skip as u64),
        body: fields.body,
        body_line: fields.lines + 1,
        notes,
    })
}

fn kind(fields: &Fields) -> Result<Type, ParseError> {
    let field = fields.required("type")?;
    let name = field.words().join(" ").to_ascii_lowercase();
    Type::from_name(&name).ok_or_else(|| {
        field.fault("type", "whole numbers of 8 to 64 bits (int8, uint8, int16, ...), `float` or `double`")
    })
}

fn encoding(fields: &Fields) -> Result<Encoding, ParseError> {
    let field = fields.required("encoding")?;
    match field.text.to_ascii_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "txt" | "text" | "ascii" => Ok(Encoding::Text),
        "gz" | "gzip" => Ok(Encoding::Gzip),
        _ => Err(field.fault("encoding", "`raw`, `gzip` or `text`")),
    }
}

fn endian(fields: &Fields, kind: Type, encoding: Encoding) -> Result<bool, ParseError> {
    match fields.get("endian") {
        Some(field) => match field.text.to_ascii_lowercase().as_str() {
            "little" => Ok(true),
            "big" => Ok(false),
            _ => Err(field.fault("endian", "`little` or `big`")),
        },
        None if kind.size() > 1 && encoding != Encoding::Text => {
            let found = format!("no field `endian` for values of type {}", kind.name());
            Err(ParseError::line(fields.lines, found, "`endian: little` or `endian: big`"))
        }
        None => Ok(true),
    }
}

/// The field of the sizes, and the sizes.
fn sizes(fields: &Fields, axes: usize) -> Result<(&Field, Vec<usize>), ParseError> {
    let field = fields.required("sizes")?;
    let sizes: Option<Vec<usize>> = field.words().into_iter().map(|word| word.parse().ok()).collect();
    match sizes.filter(|sizes| sizes.len() == axes && !sizes.contains(&0)) {
        Some(sizes) => Ok((field, sizes)),
        None => Err(field.fault("sizes", format!("{axes} whole numbers from 1, one for each axis"))),
    }
}

/// The three axes of space: those with a direction, else those that are left without axes of one sample.
fn spatial(fields: &Fields, sizes: &[usize], directions: Option<&[Option<DVec3>]>) -> Result<[usize; 3], ParseError> {
    let mut axes: Vec<usize> = (0..sizes.len()).collect();
    let line = fields.get("sizes").map_or(1, |field| field.line);
    let refuse = |found: String| Err(ParseError::line(line, found, "three axes of space and one value at each place"));
    let kinds = fields.get("kinds").map(|field| field.text.to_ascii_lowercase()).unwrap_or_default();
    let kinds: Vec<&str> = kinds.split_ascii_whitespace().collect();
    let is_component = |axis: &usize| {
        let of_space = directions.is_none_or(|directions| directions[*axis].is_some());
        let domain = kinds.get(*axis).is_none_or(|kind| matches!(*kind, "domain" | "space" | "none" | "???"));
        !(of_space && domain) && sizes[*axis] > 1
    };
    if let Some(axis) = axes.iter().copied().find(is_component) {
        let what = kinds.get(axis).map_or_else(String::new, |kind| format!(" ({})", quote(kind.as_bytes())));
        return refuse(format!("{} values at each place, along axis {axis}{what}", sizes[axis]));
    }
    if let Some(directions) = directions {
        axes.retain(|axis| directions[*axis].is_some());
    }
    while axes.len() > 3 {
        let Some(lone) = axes.iter().position(|axis| sizes[*axis] == 1) else {
            return refuse(format!("{} axes of more than one sample", axes.len()));
        };
        axes.remove(lone);
    }
    match axes[..] {
        [x, y, z] => Ok([x, y, z]),
        _ => refuse(format!("{} axes of space", axes.len())),
    }
}

/// Origin and steps along x, y and z by spacings and by the ends of axes.
///
/// A cell of a `cell` axis reaches half a step beyond its sample on both sides, and ends are those of cells. The first
/// and the last sample of a `node` axis stand at the ends. An axis that says neither is a `cell` axis. An axis without
/// any end has its first sample at 0.
fn straight(
    fields: &Fields,
    axes: usize,
    spatial: [usize; 3],
    sizes: [usize; 3],
) -> Result<(DVec3, DMat3), ParseError> {
    let column = |name: &str| fields.get(name).map(|field| field.numbers(name, axes)).transpose();
    let (spacings, mins, maxs) = (column("spacings")?, column("axis mins")?, column("axis maxs")?);
    let centerings = fields.get("centerings").map(|field| field.text.to_ascii_lowercase()).unwrap_or_default();
    let centerings: Vec<&str> = centerings.split_ascii_whitespace().collect();
    let (mut origin, mut steps) = (DVec3::ZERO, DVec3::ONE);
    for (to, (axis, size)) in spatial.into_iter().zip(sizes).enumerate() {
        let known = |column: &Option<Vec<f64>>| column.as_ref().map(|column| column[axis]).filter(|x| !x.is_nan());
        let (spacing, min, max) = (known(&spacings), known(&mins), known(&maxs));
        let node = centerings.get(axis) == Some(&"node");
        // Steps from the first end to the last.
        let steps_in_all = if node { (size as f64 - 1.0).max(1.0) } else { size as f64 };
        let step = spacing.or(min.zip(max).map(|(min, max)| (max - min) / steps_in_all)).unwrap_or(1.0);
        let inside = if node { 0.0 } else { 0.5 * step };
        let last = step * (size as f64 - 1.0);
        steps[to] = step;
        origin[to] = min.map(|min| min + inside).or(max.map(|max| max - inside - last)).unwrap_or(0.0);
    }
    Ok((origin, DMat3::from_diagonal(steps)))
}

/// Refuses grids that cannot be drawn.
fn check_places(fields: &Fields, sizes: [usize; 3], origin: DVec3, steps: DMat3) -> Result<(), ParseError> {
    let named = ["space directions", "spacings", "axis mins", "axis maxs", "sizes"];
    let line = named.iter().find_map(|name| fields.get(name)).map_or(1, |field| field.line);
    let columns = [steps.x_axis, steps.y_axis, steps.z_axis];
    if let Some(length) = columns.iter().map(|column| column.length()).find(|length| !SPACINGS.contains(length)) {
        let expected = format!("from {:e} to {:e}", SPACINGS.start(), SPACINGS.end());
        return Err(ParseError::line(line, format!("neighbours at a distance of {length}"), expected));
    }
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let cosine = columns[a].normalize().dot(columns[b].normalize());
        if cosine.abs() > OBLIQUE {
            let degrees = libm::acos(cosine.clamp(-1.0, 1.0)).to_degrees();
            let found = format!("space directions {a} and {b} at an angle of {degrees:.3} degrees (a shear)");
            return Err(ParseError::line(line, found, "right angles"));
        }
    }
    let far = origin + steps * DVec3::from_array(sizes.map(|size| size as f64));
    let finite = origin.is_finite() && far.is_finite();
    if !finite || origin.abs().max(far.abs()).max_element() > MAX_COORDINATE {
        let found = format!("samples at {origin} to {far}");
        return Err(ParseError::line(line, found, format!("coordinates up to {MAX_COORDINATE:e}")));
    }
    Ok(())
}
