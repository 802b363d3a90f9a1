//! SOG, version 2: a zip archive of `meta.json` and lossless WebP pictures whose pixels are the Gaussians.
//!
//! Pictures of one colour take a few bytes whatever their size, so every size is held against the number of Gaussians
//! before anything is inflated, and that number against the size of the file.

use std::io::Cursor;

use glam::Vec3;
use image::codecs::webp::WebPDecoder;
use image::{ImageDecoder as _, ImageError};
use serde::Deserialize;
use serde_json::Value;

use super::smallest_three;
use super::{Gaussian, Gaussians, MOST_HARMONICS, harmonics_of};
use crate::files;
use crate::model::archive::Archive;
use crate::model::error::{ParseError, quote};

/// Largest `meta.json` that is read, bytes. Real ones have a few tens of thousands.
const MOST_META: usize = 1 << 20;

/// Entries of a codebook.
const CODES: usize = 256;

/// Most sets of harmonics: their number has 16 bits.
const MOST_PALETTE: usize = 1 << 16;

/// Sets of harmonics in a row of the picture of sets.
const PALETTE_ROW: usize = 64;

/// Pixels that a picture may have beyond twice the Gaussians: writers round its sides up.
const SPARE_PIXELS: usize = 1 << 16;

/// What `meta.json` says.
#[derive(Deserialize)]
struct Meta {
    count: usize,
    means: Means,
    scales: Coded,
    quats: Files,
    sh0: Coded,
    #[serde(rename = "shN")]
    harmonics: Option<Palette>,
    #[serde(default)]
    antialias: bool,
}

#[derive(Deserialize)]
struct Means {
    mins: [f64; 3],
    maxs: [f64; 3],
    files: [String; 2],
}

#[derive(Deserialize)]
struct Files {
    files: [String; 1],
}

#[derive(Deserialize)]
struct Coded {
    codebook: Vec<f64>,
    files: [String; 1],
}

#[derive(Deserialize)]
struct Palette {
    count: usize,
    bands: u8,
    codebook: Vec<f64>,
    files: [String; 2],
}

/// Reads the bytes of a file. `progress` now and then gets the share of Gaussians read.
///
/// # Errors
/// The archive is damaged, `meta.json` is of another version or lacks something, or a picture is missing, is not
/// lossless WebP, or has another size than the number of Gaussians asks for.
pub(in crate::model) fn parse(bytes: &[u8], progress: &dyn Fn(f32)) -> Result<Gaussians, ParseError> {
    const REPORT: usize = 1 << 16;
    let mut archive = Pictures(Archive::open(bytes, "a SOG capture")?);
    let (at, meta) = read_meta(&mut archive.0)?;
    let Meta { count, means, .. } = &meta;
    let count = *count;
    if count > bytes.len() {
        let found = format!("{count} Gaussians in {} bytes", bytes.len());
        return Err(ParseError::byte(at, found, "at most one for each byte (count in meta.json)"));
    }
    let scale_codes = codebook(at, "scales", &meta.scales.codebook)?;
    let base_codes = codebook(at, "sh0", &meta.sh0.codebook)?;
    let [low, high] = [archive.of_gaussians(&means.files[0], count)?, archive.of_gaussians(&means.files[1], count)?];
    let scales = archive.of_gaussians(&meta.scales.files[0], count)?;
    let quats = archive.of_gaussians(&meta.quats.files[0], count)?;
    let base = archive.of_gaussians(&meta.sh0.files[0], count)?;
    let harmonics = meta.harmonics.as_ref().map(|palette| Harmonics::read(&mut archive, at, palette, count));
    let harmonics = harmonics.transpose()?;

    let mut gaussians = Gaussians::of_degree(harmonics.as_ref().map_or(0, |harmonics| harmonics.degree));
    let mut strays = 0_usize;
    for index in 0..count {
        if index % REPORT == 0 {
            progress(index as f32 / count as f32);
        }
        let [low, high] = [low.pixel(index), high.pixel(index)];
        let [r, g, b, opacity] = base.pixel(index);
        let scale = scales.pixel(index);
        let set = harmonics.as_ref().map(|harmonics| harmonics.of(index));
        strays += usize::from(set == Some(None));
        gaussians.push(&Gaussian {
            position: [0, 1, 2].map(|axis| {
                let share = f64::from(u16::from_le_bytes([low[axis], high[axis]])) / 65535.0;
                let v = means.mins[axis] + (means.maxs[axis] - means.mins[axis]) * share;
                v.abs().exp_m1().copysign(v)
            }),
            sigma: [0, 1, 2].map(|axis| scale_codes[usize::from(scale[axis])].exp()),
            rotation: rotation(quats.pixel(index)),
            opacity: f64::from(opacity) / 255.0,
            base: [r, g, b].map(|code| base_codes[usize::from(code)]),
            harmonics: set.flatten().unwrap_or_default(),
        });
    }
    if strays > 0 {
        gaussians.notes.push(format!("{strays} Gaussians name harmonics that the file does not have (taken as none)"));
    }
    gaussians.antialiased = meta.antialias;
    Ok(gaussians)
}

/// The content of `meta.json`, and where it begins.
fn read_meta(archive: &mut Archive<'_>) -> Result<(usize, Meta), ParseError> {
    #[derive(Deserialize)]
    struct Version {
        version: Option<Value>,
    }
    if !archive.has("meta.json") {
        let streamed = archive.has("lod-meta.json");
        let found = if streamed { "a streamed SOG (lod-meta.json)" } else { "a zip archive without meta.json" };
        return Err(ParseError::byte(0, found, "a SOG capture with meta.json"));
    }
    let (at, text) = archive.entry("meta.json", MOST_META)?;
    let fault = |e: &serde_json::Error| ParseError::byte(at, format!("meta.json: {e}"), "the content of a SOG capture");
    let Version { version } = serde_json::from_slice(&text).map_err(|e| fault(&e))?;
    match version {
        Some(version) if version.as_f64() == Some(2.0) => {}
        Some(other) => {
            let found = format!("SOG version {}", quote(other.to_string().as_bytes()));
            return Err(ParseError::byte(at, found, "2 (in meta.json)"));
        }
        None => {
            let found = "an older SOG, whose meta.json has no version";
            return Err(ParseError::byte(at, found, "version 2: convert it first"));
        }
    }
    Ok((at, serde_json::from_slice(&text).map_err(|e| fault(&e))?))
}

fn codebook(at: usize, what: &str, codes: &[f64]) -> Result<[f64; CODES], ParseError> {
    codes.try_into().map_err(|_| {
        let found = format!("a codebook of {} in {what} of meta.json", codes.len());
        ParseError::byte(at, found, format!("{CODES}"))
    })
}

/// The rotation of a pixel; one without direction, so that it is dropped, where alpha names no component.
fn rotation([r, g, b, alpha]: [u8; 4]) -> [f64; 4] {
    let others = [r, g, b].map(|v| (f64::from(v) / 255.0 * 2.0 - 1.0) * std::f64::consts::FRAC_1_SQRT_2);
    alpha.checked_sub(252).map_or([0.0; 4], |left_out| smallest_three::restore(usize::from(left_out), others))
}

/// The harmonics above degree 0: a palette of sets, and the set of each Gaussian.
struct Harmonics {
    degree: u8,
    sets: usize,
    codes: [f64; CODES],
    labels: BytePixels,
    centroids: BytePixels,
}

impl Harmonics {
    fn read(archive: &mut Pictures<'_>, at: usize, palette: &Palette, count: usize) -> Result<Self, ParseError> {
        let Palette { count: sets, bands: degree, ref codebook, ref files } = *palette;
        if !(1..=3).contains(&degree) {
            return Err(ParseError::byte(at, format!("{degree} bands of harmonics in meta.json"), "1, 2 or 3"));
        }
        if sets > MOST_PALETTE {
            let found = format!("{sets} sets of harmonics in meta.json");
            return Err(ParseError::byte(at, found, format!("at most {MOST_PALETTE}")));
        }
        let codes = self::codebook(at, "shN", codebook)?;
        let [centroids, labels] = files;
        let width = PALETTE_ROW * harmonics_of(degree);
        let rows = sets.div_ceil(PALETTE_ROW);
        let most = width * (MOST_PALETTE / PALETTE_ROW);
        let centroids = archive.picture(centroids, most, |size| {
            let right = size[0] == width && size[1] >= rows;
            if right { Ok(()) } else { Err(format!("{width} x {rows} for the harmonics")) }
        })?;
        let labels = archive.of_gaussians(labels, count)?;
        Ok(Self { degree, sets, codes, labels, centroids })
    }

    /// The harmonics of a Gaussian, or `None` if it names a set that there is not.
    fn of(&self, index: usize) -> Option<[Vec3; MOST_HARMONICS]> {
        let [low, high, ..] = self.labels.pixel(index);
        let set = usize::from(u16::from_le_bytes([low, high]));
        if set >= self.sets {
            return None;
        }
        let each = harmonics_of(self.degree);
        // The picture is as wide as a row of sets, so the sets follow each other.
        let mut harmonics = [Vec3::ZERO; MOST_HARMONICS];
        for (k, harmonic) in harmonics[..each].iter_mut().enumerate() {
            let [r, g, b, _] = self.centroids.pixel(set * each + k);
            *harmonic = Vec3::from_array([r, g, b].map(|code| self.codes[usize::from(code)] as f32));
        }
        Some(harmonics)
    }
}

/// Has a WebP file lossy colours, a chunk `VP8 ` among its chunks? `image` does not say.
fn is_lossy(webp: &[u8]) -> bool {
    /// Bytes before the first chunk.
    const HEAD: usize = 12;
    let mut rest = webp.get(HEAD..).unwrap_or_default();
    while let Some((&[a, b, c, d, length @ ..], after)) = rest.split_first_chunk::<8>() {
        if &[a, b, c, d] == b"VP8 " {
            return true;
        }
        // Chunks begin at even places.
        let length = (u32::from_le_bytes(length) as usize).saturating_add(1) & !1;
        rest = after.get(length..).unwrap_or_default();
    }
    false
}

/// Pixels of 8 bits, row by row.
struct BytePixels {
    channels: usize,
    values: Vec<u8>,
}

impl BytePixels {
    /// Red, green, blue, alpha.
    fn pixel(&self, index: usize) -> [u8; 4] {
        let pixel = &self.values[index * self.channels..];
        [pixel[0], pixel[1], pixel[2], if self.channels == 4 { pixel[3] } else { u8::MAX }]
    }
}

/// The pictures of an archive.
struct Pictures<'a>(Archive<'a>);

impl Pictures<'_> {
    /// A picture with a pixel for each Gaussian.
    fn of_gaussians(&mut self, name: &str, count: usize) -> Result<BytePixels, ParseError> {
        let most = 2 * count + SPARE_PIXELS;
        self.picture(name, most, |[width, height]| {
            let wanted = || format!("at least {count} and at most {most} pixels for {count} Gaussians");
            if width * height < count { Err(wanted()) } else { Ok(()) }
        })
    }

    /// A picture of at most `most` pixels. `check` says what is expected of its sides, if they are wrong.
    fn picture(
        &mut self,
        name: &str,
        most: usize,
        check: impl Fn([usize; 2]) -> Result<(), String>,
    ) -> Result<BytePixels, ParseError> {
        let shown = quote(name.as_bytes());
        if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\', ':', '\0']) {
            return Err(ParseError::byte(0, format!("a file name {shown} in meta.json"), "a plain name"));
        }
        // Compressed pixels are hardly larger than plain ones; the rest is for what else the container may hold.
        let (at, content) = self.0.entry(name, 8 * most + SPARE_PIXELS)?;
        let fault = |found: String, expected: String| ParseError::byte(at, format!("{found} in {shown}"), expected);
        let damaged =
            |e: ImageError| fault(format!("damaged WebP ({})", files::cause(&e)), "a lossless WebP picture".to_owned());
        let decoder = WebPDecoder::new(Cursor::new(&content)).map_err(damaged)?;
        let (width, height) = decoder.dimensions();
        let size = [width as usize, height as usize];
        let found = || format!("{width} x {height} pixels");
        if size[0] * size[1] > most {
            return Err(fault(found(), format!("at most {most} pixels")));
        }
        check(size).map_err(|expected| fault(found(), expected))?;
        if decoder.has_animation() || is_lossy(&content) {
            return Err(fault("lossy or animated WebP".to_owned(), "a lossless WebP picture".to_owned()));
        }
        let channels = usize::from(decoder.color_type().channel_count());
        let mut values = vec![0; size[0] * size[1] * channels];
        decoder.read_image(&mut values).map_err(damaged)?;
        Ok(BytePixels { channels, values })
    }
}
