//! The settings that a frame's file carries: enough to know whether another run would make the same picture.
//!
//! Everything that changes pixels is in here: the program's version, the resolved scene, the bytes of the files that it names,
//! all options, the frame. What does not is left out: threads, memory, directories, times, names of machines.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::Serialize;
use splatblur::image::{Bits, Format};
use splatblur::options::RenderOptions;
use splatblur::scene::Scene;
use splatblur::time::Weight;

/// The settings of all frames of one run.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Settings {
    program: &'static str,
    scene: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<i64>,
    rate: f64,
    backend: &'static str,
    mode: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    reconstruct: Option<&'static str>,
    width: u32,
    height: u32,
    shutter: [f64; 2],
    weight: String,
    filter: String,
    prefilter: String,
    shading: String,
    two_sided: bool,
    epsilon: Option<f64>,
    seed: u64,
    background: [f64; 3],
    transparent: bool,
    aovs: Vec<&'static str>,
    format: &'static str,
    bits: u32,
    inputs: Vec<Input>,
    /// FNV-1a, 128 bits, of the canonical scene and all fields above except `frame`.
    hash: String,
}

/// A file that the scene names.
#[derive(Clone, Debug, Serialize)]
struct Input {
    file: String,
    bytes: u64,
    crc32: String,
}

impl Settings {
    /// Reads the scene's files again for their checksums.
    pub(super) fn new(
        scene: &Scene,
        scene_path: &Path,
        options: &RenderOptions,
        format: Format,
        backend: &'static str,
    ) -> anyhow::Result<Self> {
        let mut settings = Self {
            program: concat!("splatblur ", env!("CARGO_PKG_VERSION")),
            scene: scene.name.clone(),
            frame: None,
            rate: scene.frames.rate,
            backend,
            mode: options.quality.to_string(),
            reconstruct: options.reconstruct.then_some("along"),
            width: scene.image.width,
            height: scene.image.height,
            shutter: [scene.shutter.open, scene.shutter.close],
            weight: weight(&scene.shutter.weight),
            filter: lower(options.filter),
            prefilter: lower(options.prefilter),
            shading: lower(options.shading),
            two_sided: options.two_sided,
            epsilon: options.epsilon,
            seed: options.seed,
            background: scene.image.background.to_array(),
            transparent: scene.image.transparent,
            aovs: options.aovs.iter().map(|aov| aov.name()).collect(),
            format: format.extension(),
            bits: match format {
                Format::Png { bits: Bits::Eight, .. } => 8,
                Format::Png { bits: Bits::Sixteen, .. } => 16,
                Format::Exr => 32,
            },
            inputs: inputs(scene)?,
            hash: String::new(),
        };
        // A longer sequence has the same frames.
        let mut alone = scene.clone();
        (alone.frames.first, alone.frames.last) = (0, 0);
        let canonical = splatblur::scene_file::to_xml(&alone, scene_path.parent().unwrap_or(Path::new("")));
        let text = serde_json::to_string(&settings)? + &canonical;
        settings.hash = format!("{:032x}", fnv1a(text.as_bytes()));
        Ok(settings)
    }

    /// The text that the file of a frame carries: equal texts, equal pictures.
    pub(super) fn of_frame(&self, frame: i64) -> anyhow::Result<String> {
        Ok(serde_json::to_string(&Self { frame: Some(frame), ..self.clone() })?)
    }
}

/// A weight as `--weight` takes it; a drawn curve by its name only.
pub(super) fn weight(weight: &Weight) -> String {
    match weight {
        Weight::Box => "box".to_owned(),
        Weight::Tent => "tent".to_owned(),
        Weight::Ramp { centre } => format!("ramp:centre={centre}"),
        Weight::Exponential { rate, centre } => format!("exponential:rate={rate},centre={centre}"),
        Weight::Gaussian { centre, width } => format!("gaussian:centre={centre},width={width}"),
        Weight::Curve(points) => format!("curve of {} points", points.len()),
    }
}

/// The command-line word of an option's variant.
fn lower(variant: impl std::fmt::Debug) -> String {
    format!("{variant:?}").to_lowercase()
}

/// All model and animation files of a scene, each once, in a fixed order.
fn inputs(scene: &Scene) -> anyhow::Result<Vec<Input>> {
    let mut paths: BTreeSet<&PathBuf> =
        scene.objects.iter().filter(|object| object.sphere.is_none()).map(|object| &object.model_path).collect();
    paths.extend(scene.objects.iter().filter_map(|object| object.animation.as_ref()).map(|a| &a.path));
    paths.extend(scene.camera.animation.as_ref().map(|a| &a.path));
    let mut inputs = paths.into_iter().map(|path| input(path)).collect::<anyhow::Result<Vec<_>>>()?;
    // By name: the order of the paths would depend on where the scene lies.
    inputs.sort_by(|a, b| (&a.file, &a.crc32).cmp(&(&b.file, &b.crc32)));
    Ok(inputs)
}

fn input(path: &Path) -> anyhow::Result<Input> {
    let context = || format!("cannot read {}", path.display());
    let mut file = File::open(path).with_context(context)?;
    let mut crc = crc32fast::Hasher::new();
    let mut buffer = vec![0; 1 << 20];
    let mut bytes = 0;
    loop {
        let n = file.read(&mut buffer).with_context(context)?;
        if n == 0 {
            break;
        }
        crc.update(&buffer[..n]);
        bytes += n as u64;
    }
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Input { file, bytes, crc32: format!("{:08x}", crc.finalize()) })
}

/// Fowler, Noll, Vo: FNV-1a with 128 bits.
fn fnv1a(bytes: &[u8]) -> u128 {
    const BASIS: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    bytes.iter().fold(BASIS, |hash, &byte| (hash ^ u128::from(byte)).wrapping_mul(PRIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hash_of_known_texts() {
        // Published test vectors of FNV-1a 128.
        assert_eq!(fnv1a(b""), 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d);
        assert_eq!(fnv1a(b"a"), 0xd228_cb69_6f1a_8caf_7891_2b70_4e4a_8964);
    }

    #[test]
    fn checksums_follow_the_bytes() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        std::fs::write(&path, "123456789").unwrap();
        let a = input(&path).unwrap();
        // The check value of CRC-32.
        assert_eq!((a.file.as_str(), a.bytes, a.crc32.as_str()), ("a.ply", 9, "cbf43926"));
        assert!(input(&dir.path().join("none")).is_err());
    }

    #[test]
    fn weights_read_back() {
        for text in ["box", "tent", "ramp:centre=0.25", "exponential:rate=5,centre=0", "gaussian:centre=0.5,width=0.1"]
        {
            assert_eq!(weight(&super::super::grammar::weight(text).unwrap()), text);
        }
    }
}
