//! `OpenEXR`: linear Rec.709, premultiplied, 32-bit float or half, without loss by compression.
//!
//! One part. Colour is `R G B A`; an AOV is a layer of extra channels named `layer.channel` (`depth.Z`, `normal.X`,
//! `velocity.Y`, `alpha.A`). That is the `OpenEXR` project's own convention for layers in one part: Nuke, Blender, tev,
//! ffmpeg and every reader of plain RGBA understand it, while several of them open only the first part of a file with
//! many. The header's attribute `layers` says what each layer holds, in which unit, as JSON. Its entry `objects` names
//! what the indices of the layer `object` stand for.

use std::io::{BufRead, Cursor, Read, Seek, SeekFrom};

use ::exr::compression::Compression as Method;
use ::exr::image::read::image::ReadLayers as _;
use ::exr::image::read::layers::ReadChannels as _;
use ::exr::image::read::read;
use ::exr::image::write::WritableImage;
use ::exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image, Layer as Part};
use ::exr::math::Vec2;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, Chromaticities, LineOrder, Text};
use ::exr::meta::header::LayerAttributes;
use ::exr::prelude::f16;

use super::{Compression, DEFLATE_LIMIT, Exr, ImageError, Precision, SETTINGS, plausible};
use crate::film::{Aov, Layer, Picture};

pub(super) const SIGNATURE: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

const COLOUR: [&str; 4] = ["R", "G", "B", "A"];

/// Name of the attribute that says what the layers hold.
const LAYERS: &str = "layers";

/// Its entry that names objects: `{"1": "floor", "2": "ball"}`.
const OBJECTS: &str = "objects";

pub(super) fn encode(
    picture: &Picture,
    options: Exr,
    settings: &str,
    comment: Option<&str>,
) -> Result<Vec<u8>, ImageError> {
    let columns = picture.width as usize;
    let channel = |name: &str, values: Vec<f32>, half: bool| {
        let samples = if half { halves(name, &values, columns)? } else { FlatSamples::F32(values) };
        Ok::<_, ImageError>(AnyChannel::new(name, samples))
    };
    let half = options.precision == Precision::Half;
    let mut channels = Vec::new();
    for (c, name) in COLOUR.iter().enumerate() {
        channels.push(channel(name, picture.rgba.iter().map(|pixel| pixel[c]).collect(), half)?);
    }
    for layer in &picture.layers {
        for (name, plane) in layer.aov.channels().iter().zip(&layer.planes) {
            let name = format!("{}.{name}", layer.aov.name());
            channels.push(channel(&name, plane.clone(), half && !layer.aov.needs_float())?);
        }
    }
    let meanings = (!picture.layers.is_empty()).then(|| meanings(picture));
    let size = Vec2(columns, picture.height as usize);
    file(size, channels, options.compression, meanings.as_deref(), settings, comment)
}

/// The bytes of a file with these channels of floats, each row-major, and nothing else.
pub(super) fn encode_planes(
    width: u32,
    channels: &[(&str, &[f32])],
    meanings: &str,
    settings: &str,
) -> Result<Vec<u8>, ImageError> {
    let pixels = channels.first().map_or(0, |(_, plane)| plane.len());
    let size = Vec2(width as usize, pixels / width.max(1) as usize);
    let channels =
        channels.iter().map(|(name, plane)| AnyChannel::new(*name, FlatSamples::F32(plane.to_vec()))).collect();
    file(size, channels, Compression::default(), Some(meanings), settings, None)
}

fn file(
    size: Vec2<usize>,
    channels: Vec<AnyChannel<FlatSamples>>,
    compression: Compression,
    meanings: Option<&str>,
    settings: &str,
    comment: Option<&str>,
) -> Result<Vec<u8>, ImageError> {
    let software_name = Text::new_or_none(concat!("splatblur ", env!("CARGO_PKG_VERSION")));
    let comments = comment.map(utf8);
    let mut attributes = LayerAttributes { software_name, comments, ..LayerAttributes::default() };
    // The only entry of this map, as below: the library writes entries in an order that changes from run to run.
    attributes.other.insert(Text::from(SETTINGS), AttributeValue::Text(utf8(settings)));
    let encoding =
        Encoding { compression: method(compression), blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let mut image = Image::from_layer(Part::new(size, attributes, encoding, AnyChannels::sort(channels.into())));
    image.attributes.chromaticities = Some(Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    });
    if let Some(meanings) = meanings {
        image.attributes.other.insert(Text::from(LAYERS), AttributeValue::Text(utf8(meanings)));
    }
    let mut bytes = Cursor::new(Vec::new());
    // One thread: a frame is written while the next one renders.
    image.write().non_parallel().to_buffered(&mut bytes).map_err(|e| ImageError::Encode { what: e.to_string() })?;
    Ok(bytes.into_inner())
}

/// What the layers hold, as a JSON object with an entry for each: `{"depth": "distance ..."}`, and the names of
/// objects.
///
/// All in one attribute: the library writes several in an order that changes from run to run.
fn meanings(picture: &Picture) -> String {
    let of_layer = |layer: &Layer| (layer.aov.name().to_owned(), layer.aov.meaning().into());
    let mut all: serde_json::Map<_, _> = picture.layers.iter().map(of_layer).collect();
    if let Some(layer) = picture.layers.iter().find(|layer| layer.aov == Aov::Object) {
        let names = (1..).zip(&layer.names).map(|(index, name): (usize, _)| (index.to_string(), name.clone().into()));
        all.insert(OBJECTS.to_owned(), serde_json::Value::Object(names.collect()));
    }
    serde_json::Value::Object(all).to_string()
}

/// The names of objects that an attribute `layers` holds, that of index 1 first; those before the first that is
/// missing.
fn names_of_objects(attribute: Option<&AttributeValue>) -> Vec<String> {
    let Some(AttributeValue::Text(text)) = attribute else { return Vec::new() };
    let Ok(all) = serde_json::from_slice::<serde_json::Value>(text.as_slice()) else { return Vec::new() };
    let name = |index: usize| Some(all.get(OBJECTS)?.get(index.to_string())?.as_str()?.to_owned());
    (1..).map_while(name).collect()
}

/// The nearest half-precision numbers; a finite number that would become infinite is refused.
fn halves(channel: &str, values: &[f32], columns: usize) -> Result<FlatSamples, ImageError> {
    let halves: Vec<f16> = values.iter().map(|&value| f16::from_f32(value)).collect();
    match halves.iter().zip(values).position(|(half, value)| half.is_infinite() && value.is_finite()) {
        Some(at) => Err(ImageError::BeyondHalf {
            channel: channel.to_owned(),
            x: at % columns,
            y: at / columns,
            value: values[at],
        }),
        None => Ok(FlatSamples::F16(halves)),
    }
}

fn method(compression: Compression) -> Method {
    match compression {
        Compression::None => Method::Uncompressed,
        Compression::Rle => Method::RLE,
        Compression::Zips => Method::ZIP1,
        Compression::Zip => Method::ZIP16,
        Compression::Piz => Method::PIZ,
    }
}

/// Attribute text is bytes; by `OpenEXR`'s convention they are UTF-8.
fn utf8(text: &str) -> Text {
    Text::from_bytes_unchecked(text.as_bytes().into())
}

pub(super) fn settings(file: &mut (impl BufRead + Seek)) -> Option<String> {
    file.seek(SeekFrom::Start(0)).ok()?;
    // A length in a damaged header must not become memory: 64 MiB is more than any header.
    let meta = MetaData::read_from_buffered(file.take(1 << 26), false).ok()?;
    let value = meta.headers.first()?.own_attributes.other.get(&Text::from(SETTINGS))?;
    match value {
        AttributeValue::Text(text) => String::from_utf8(text.as_slice().to_vec()).ok(),
        _ => None,
    }
}

/// The first part of a file, whatever its channels.
fn part(bytes: &[u8]) -> Result<Part<AnyChannels<FlatSamples>>, String> {
    let refused = |e: ::exr::error::Error| format!("not a readable EXR file: {e}");
    let meta = MetaData::read_from_buffered(bytes, false).map_err(refused)?;
    for header in &meta.headers {
        let Vec2(w, h) = header.layer_size;
        // A picture of one colour takes PIZ a few bytes for 32 rows, however long they are.
        let ratio = if header.compression == Method::PIZ { u64::MAX } else { DEFLATE_LIMIT };
        plausible(w as u64, h as u64, header.channels.bytes_per_pixel as u64, ratio, bytes.len())?;
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(refused)?;
    Ok(image.layer_data)
}

/// True if all blocks of a file of one part can be read, and nothing follows the last of them.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    end(bytes) == Some(bytes.len()) && part(bytes).is_ok()
}

/// Where the last block of a file ends; `None` where there is none, and for tiles and several parts.
fn end(bytes: &[u8]) -> Option<usize> {
    // Bits of the version that say: tiles, deep data, several parts.
    const OTHERS: u32 = 1 << 9 | 1 << 11 | 1 << 12;
    let number = |at: usize| bytes.get(at..)?.first_chunk().map(|raw| u32::from_le_bytes(*raw));
    if number(4)? & OTHERS != 0 {
        return None;
    }
    let blocks = MetaData::read_from_buffered(bytes, false).ok()?.headers.first()?.chunk_count;
    let word = |at: usize| bytes.get(at..)?.iter().position(|byte| *byte == 0).map(|length| at + length + 1);
    // Attributes: name, type, length, value. An empty name ends them.
    let mut at = 8;
    while *bytes.get(at)? != 0 {
        let length = word(word(at)?)?;
        at = (length + 4).checked_add(number(length)? as usize)?;
    }
    let table = bytes.get(at + 1..)?.get(..blocks.checked_mul(8)?)?;
    // A block: row, length, data.
    let end_of = |offset: &[u8; 8]| {
        let block = usize::try_from(u64::from_le_bytes(*offset)).ok()?;
        block.checked_add(8)?.checked_add(number(block.checked_add(4)?)? as usize)
    };
    table.as_chunks::<8>().0.iter().map(end_of).try_fold(0, |last, end| Some(last.max(end?)))
}

/// Planes of channels; `None` for one that is not there.
type Planes = Vec<Option<Vec<f32>>>;

/// The plane of each channel that is named, and the width; `None` for a channel that the file has not.
pub(super) fn decode_planes(bytes: &[u8], channels: &[&str]) -> Result<(u32, Planes), String> {
    let part = part(bytes)?;
    let plane = |name: &&str| {
        let channel = part.channel_data.list.iter().find(|channel| channel.name.eq(name))?;
        Some(channel.sample_data.values_as_f32().collect())
    };
    Ok((part.size.0 as u32, channels.iter().map(plane).collect()))
}

pub(super) fn decode(bytes: &[u8]) -> Result<Picture, String> {
    let part = part(bytes)?;
    // The library gives all attributes that it does not know to the part.
    let names = names_of_objects(part.attributes.other.get(&Text::from(LAYERS)));
    let Vec2(w, h) = part.size;
    let plane = |name: &str| {
        let channel = part.channel_data.list.iter().find(|c| c.name.eq(name))?;
        Some(channel.sample_data.values_as_f32().collect::<Vec<_>>())
    };
    let mut rgba = vec![[0.0, 0.0, 0.0, 1.0]; w * h];
    for (c, name) in COLOUR.iter().enumerate() {
        match plane(name) {
            Some(values) if values.len() == rgba.len() => {
                rgba.iter_mut().zip(values).for_each(|(pixel, v)| pixel[c] = v);
            }
            // Alpha is 1 where a file has none.
            None if *name == "A" => {}
            _ => return Err(format!("no whole channel `{name}` in the first part of the EXR file")),
        }
    }
    let mut layers = Vec::new();
    for aov in Aov::LAYERS {
        let planes: Option<Vec<_>> =
            aov.channels().iter().map(|channel| plane(&format!("{}.{channel}", aov.name()))).collect();
        let names = if aov == Aov::Object { names.clone() } else { Vec::new() };
        layers.extend(planes.map(|planes| Layer { aov, planes, names }));
    }
    Ok(Picture { width: w as u32, height: h as u32, rgba, layers })
}
