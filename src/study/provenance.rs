//! What made a picture. The header of each file carries it as JSON: enough to know whether another run would make the
//! same picture.
//!
//! Everything that changes pixels is here: the program's version, the resolved scene, the bytes of the files that it
//! names, all options, the frame. Everything else is left out: threads, memory, directories, times, names of devices.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::files::{self, Changed, InputError, Stamp};
use crate::image::{Display, Format, ViewTransform};
use crate::model;
use crate::options::{Prefilter, RenderOptions};
use crate::reference::{ReferenceOptions, Sampler};
use crate::scene::{Object, Scene, SequenceSpec, Shape};
use crate::scene_file;
use crate::time::FrameNumber;

/// Name and version of this program.
pub const PROGRAM: &str = concat!("splatblur ", env!("CARGO_PKG_VERSION"));

/// Why the provenance of a scene cannot be told.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProvenanceError {
    /// A file of the scene cannot be read again.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file of the scene changes while it is read again.
    #[error(transparent)]
    Changed(#[from] Changed),
    /// A file of the scene is another than when the scene was loaded: pictures would not be of what they tell.
    #[error("{} has changed since the scene was loaded", path.display())]
    Other {
        /// The file.
        path: PathBuf,
    },
    /// JSON cannot be made.
    #[error("cannot write the settings as JSON")]
    Json(#[from] serde_json::Error),
}

impl ProvenanceError {
    fn of_input(path: &Path, why: InputError) -> Self {
        match why {
            InputError::Changed(changed) => changed.into(),
            other => Self::Read { path: path.to_owned(), source: other.into() },
        }
    }
}

/// A scene as far as it decides pictures: its values, and the bytes of the files that it names.
#[derive(Clone, Debug)]
pub struct Provenance {
    /// The settings as far as the scene says them.
    of_scene: Settings,
    /// The scene as XML, without its range of frames: a longer sequence has the same frames.
    canonical: String,
}

/// Everything that decides a picture.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    program: &'static str,
    scene: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<FrameNumber>,
    rate: f64,
    backend: String,
    mode: String,
    /// Samples of a reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    samples: Option<u64>,
    /// Sampler of a reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    sampler: Option<String>,
    /// What of meshes a reference traces.
    #[serde(skip_serializing_if = "Option::is_none")]
    meshes: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reconstruct: Option<&'static str>,
    width: u32,
    height: u32,
    shutter: [f64; 2],
    /// Read-out of a rolling shutter.
    #[serde(skip_serializing_if = "Option::is_none")]
    readout: Option<String>,
    weight: String,
    filter: String,
    prefilter: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    detail: Option<&'static str>,
    shading: String,
    two_sided: bool,
    /// Shadows of the scene's lights, where they are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    shadows: Option<bool>,
    epsilon: Option<f64>,
    seed: u64,
    background: [f64; 3],
    transparent: bool,
    aovs: Vec<&'static str>,
    format: &'static str,
    bits: u32,
    /// Exposure of a PNG file.
    #[serde(skip_serializing_if = "Option::is_none")]
    stops: Option<f64>,
    /// View transform of a PNG file, where it is not the light itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    view_transform: Option<&'static str>,
    /// Dither of a PNG file.
    #[serde(skip_serializing_if = "Option::is_none")]
    dither: Option<bool>,
    /// Is the legend of its colours drawn into it?
    #[serde(skip_serializing_if = "Option::is_none")]
    legend: Option<bool>,
    /// Compression of an EXR file.
    #[serde(skip_serializing_if = "Option::is_none")]
    compression: Option<&'static str>,
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

impl Provenance {
    /// The provenance of a scene that was loaded from `path`. Reads the files that it names again, for their checksums.
    ///
    /// # Errors
    /// One of these files cannot be read.
    pub fn of(scene: &Scene, path: &Path) -> Result<Self, ProvenanceError> {
        let of_scene = Settings {
            program: PROGRAM,
            scene: scene.name.clone(),
            frame: None,
            rate: scene.frames.rate,
            backend: String::new(),
            mode: String::new(),
            samples: None,
            meshes: None,
            sampler: None,
            reconstruct: None,
            width: scene.image.width,
            height: scene.image.height,
            shutter: [scene.shutter.open, scene.shutter.close],
            readout: scene.shutter.readout.rolls().then(|| scene.shutter.readout.to_string()),
            weight: scene.shutter.weight.to_string(),
            filter: String::new(),
            prefilter: String::new(),
            detail: None,
            shading: String::new(),
            two_sided: false,
            shadows: None,
            epsilon: None,
            seed: 0,
            background: scene.image.background.to_array(),
            transparent: scene.image.transparent,
            aovs: Vec::new(),
            format: "",
            bits: 0,
            stops: None,
            view_transform: None,
            dither: None,
            legend: None,
            compression: None,
            inputs: inputs(scene, path)?,
            hash: String::new(),
        };
        let mut alone = scene.clone();
        (alone.frames.first, alone.frames.last) = (0, 0);
        let canonical = scene_file::to_xml(&alone, path.parent().unwrap_or(Path::new("")));
        Ok(Self { of_scene, canonical })
    }

    /// The same where PNG files are shown in this way.
    #[must_use]
    pub fn shown(mut self, display: Display) -> Self {
        let Display { stops, view, dither } = display;
        self.of_scene.stops = (stops != 0.0).then_some(stops);
        self.of_scene.view_transform = (view != ViewTransform::Standard).then(|| view.word());
        self.of_scene.dither = dither.then_some(true);
        self
    }

    /// The same where the legend of colours is drawn into pictures, or is not.
    #[must_use]
    pub fn with_legend(mut self, legend: bool) -> Self {
        self.of_scene.legend = legend.then_some(true);
        self
    }

    /// The settings of pictures that are splatted on a backend, `cpu` or `gpu`.
    ///
    /// # Errors
    /// JSON cannot be made.
    pub fn splatted(
        &self,
        options: &RenderOptions,
        format: Format,
        backend: &str,
    ) -> Result<Settings, ProvenanceError> {
        self.sealed(Settings {
            backend: backend.to_owned(),
            mode: options.quality.to_string(),
            reconstruct: options.reconstruct.then_some("along"),
            filter: options.look.filter.to_string(),
            prefilter: options.prefilter.to_string(),
            detail: Some(options.detail.word()),
            shading: options.look.shading.to_string(),
            two_sided: options.look.two_sided,
            shadows: (!options.look.shadows).then_some(false),
            epsilon: options.look.epsilon,
            seed: options.look.seed,
            aovs: options.look.aovs.iter().map(|aov| aov.name()).collect(),
            ..self.in_format(format)
        })
    }

    /// The settings of references of so many samples of a pixel, which may be fewer than `options` allows.
    ///
    /// # Errors
    /// JSON cannot be made.
    pub fn traced(
        &self,
        options: &ReferenceOptions,
        samples: u64,
        format: Format,
    ) -> Result<Settings, ProvenanceError> {
        self.sealed(Settings {
            backend: "reference".to_owned(),
            mode: format!("reference:{samples}"),
            samples: Some(samples),
            sampler: Some(match options.sampler {
                Sampler::Sobol => "sobol".to_owned(),
                Sampler::Jittered { density } => format!("jittered:{density}"),
                Sampler::Random => "random".to_owned(),
            }),
            meshes: Some(options.meshes.word()),
            filter: options.look.filter.to_string(),
            prefilter: Prefilter::None.to_string(),
            shading: options.look.shading.to_string(),
            two_sided: options.look.two_sided,
            shadows: (!options.look.shadows).then_some(false),
            epsilon: options.look.epsilon,
            seed: options.look.seed,
            aovs: options.look.aovs.iter().map(|aov| aov.name()).collect(),
            ..self.in_format(format)
        })
    }

    fn in_format(&self, format: Format) -> Settings {
        let settings = Settings { format: format.extension(), bits: format.bits(), ..self.of_scene.clone() };
        match format {
            Format::Png { .. } => settings,
            // Their light is that of the film.
            Format::Exr(options) => {
                let compression = Some(options.compression.name());
                Settings { stops: None, view_transform: None, dither: None, compression, ..settings }
            }
        }
    }

    /// With the hash of all.
    fn sealed(&self, mut settings: Settings) -> Result<Settings, ProvenanceError> {
        let text = serde_json::to_string(&settings)? + &self.canonical;
        settings.hash = format!("{:032x}", fnv1a(text.as_bytes()));
        Ok(settings)
    }
}

impl Settings {
    /// A hash of everything that decides pictures, but for the frame.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// The text that the file of a frame carries: equal texts, equal pictures.
    ///
    /// # Errors
    /// JSON cannot be made.
    pub fn of_frame(&self, frame: impl Into<FrameNumber>) -> Result<String, ProvenanceError> {
        Ok(serde_json::to_string(&self.with_frame(frame))?)
    }

    /// The settings of one frame.
    #[must_use]
    pub fn with_frame(&self, frame: impl Into<FrameNumber>) -> Self {
        Self { frame: Some(frame.into()), ..self.clone() }
    }

    /// Names and values for people, of all that the frames and modes of a study share.
    pub(super) fn in_words(&self) -> Vec<(&'static str, String)> {
        let [open, close] = self.shutter;
        let [r, g, b] = self.background;
        let file = |input: &Input| format!("{} ({} bytes, CRC-32 {})", input.file, input.bytes, input.crc32);
        let readout = self.readout.iter().map(|readout| ("read-out", readout.clone()));
        let mut words = vec![
            ("background", format!("{r:?}, {g:?}, {b:?}")),
            ("filter", self.filter.clone()),
            ("hash", self.hash.clone()),
            ("inputs", self.inputs.iter().map(file).collect::<Vec<_>>().join(", ")),
            ("rate", format!("{:?}", self.rate)),
            ("scene", self.scene.clone()),
            ("seed", self.seed.to_string()),
            ("shading", self.shading.clone()),
            ("shutter", format!("{open:?} to {close:?} frames")),
            ("transparent", self.transparent.to_string()),
            ("two sided", self.two_sided.to_string()),
            ("weight", self.weight.clone()),
        ];
        words.extend(readout);
        words
    }
}

/// The files that a scene names, each once, without those of sequences. They have no stamp.
fn named(scene: &Scene) -> BTreeMap<&PathBuf, Option<Stamp>> {
    let is_model = |object: &&Object| match object.shape {
        Shape::Surfels { .. } | Shape::Gaussians { .. } | Shape::Volume { .. } => true,
        Shape::Sequence { .. } | Shape::Sphere { .. } => false,
    };
    // A model that was made in code has no file. A name with stars is none: the list of what was read has its files.
    let has_file = |object: &&Object| {
        let path = &object.source.path;
        !path.as_os_str().is_empty() && !matches!(model::matching(path), Ok(Some(_)))
    };
    let models = scene.objects.iter().filter(is_model).filter(has_file).map(|object| &object.source.path);
    let animations = scene.objects.iter().filter_map(|object| object.animation.as_ref()).map(|a| &a.path);
    let environment = scene.environment.as_ref().map(|environment| &environment.path);
    // Keys of a camera stand in the scene.
    let camera = scene.camera.animation.as_ref().map(|a| &a.path).filter(|path| !path.as_os_str().is_empty());
    models.chain(animations).chain(environment).chain(camera).map(|path| (path, None)).collect()
}

/// All files of a scene that was loaded from `path`, each once, in a fixed order: what it names, and what that names,
/// as textures. The scene file counts by what it says.
fn inputs(scene: &Scene, path: &Path) -> Result<Vec<Input>, ProvenanceError> {
    let mut files = named(scene);
    let sequences = || scene.objects.iter().filter_map(|object| object.shape.sequence()).map(|files| files.spec());
    let firsts: Vec<PathBuf> = sequences().map(|spec| spec.pattern.path(spec.first)).collect();
    // Files that are missing, and pipes, had no say in the scene.
    let others = scene.files.iter().filter(|(file, stamp)| *file != path && !firsts.contains(file) && stamp.is_some());
    files.extend(others.map(|(file, stamp)| (file, *stamp)));
    let mut inputs = files.into_iter().map(|(path, stamp)| input(path, stamp)).collect::<Result<Vec<_>, _>>()?;
    for spec in sequences() {
        inputs.push(of_sequence(spec)?);
    }
    // By name: the order of the paths would depend on the scene's folder.
    inputs.sort_by(|a, b| (&a.file, &a.crc32).cmp(&(&b.file, &b.crc32)));
    Ok(inputs)
}

/// The files of a sequence as one input. They may be far larger than what is rendered of them, so each counts by its
/// size, its beginning and its end.
fn of_sequence(spec: &SequenceSpec) -> Result<Input, ProvenanceError> {
    /// Bytes that are read at each end of a file.
    const ENDS: u64 = 1 << 16;
    let mut crc = crc32fast::Hasher::new();
    let mut bytes = 0;
    for number in spec.first..=spec.last {
        let path = spec.pattern.path(number);
        let failed = |source| ProvenanceError::Read { path: path.clone(), source };
        let (size, ends) = files::steady(|| {
            let mut file = files::open(&path).map_err(|why| ProvenanceError::of_input(&path, why))?;
            let size = file.size();
            let mut ends = Vec::new();
            for start in [0, size.saturating_sub(ENDS)] {
                file.seek(SeekFrom::Start(start)).map_err(failed)?;
                file.by_ref().take(ENDS).read_to_end(&mut ends).map_err(failed)?;
            }
            Ok::<_, ProvenanceError>((size, ends))
        })?;
        crc.update(&size.to_le_bytes());
        crc.update(&ends);
        bytes += size;
    }
    let pattern = PathBuf::from(spec.pattern.to_string());
    let file = format!("{} {}..{}", pattern.file_name().unwrap_or_default().display(), spec.first, spec.last);
    Ok(Input { file, bytes, crc32: format!("{:08x}", crc.finalize()) })
}

/// A file that had this stamp when the scene was loaded, if the scene knows.
fn input(path: &Path, loaded: Option<Stamp>) -> Result<Input, ProvenanceError> {
    let failed = |source| ProvenanceError::Read { path: path.to_owned(), source };
    let (bytes, crc32) = files::steady(|| {
        let mut file = files::open(path).map_err(|why| ProvenanceError::of_input(path, why))?;
        if loaded.is_some_and(|stamp| stamp != file.stamp()) {
            return Err(ProvenanceError::Other { path: path.to_owned() });
        }
        let mut crc = crc32fast::Hasher::new();
        let mut buffer = vec![0; 1 << 20];
        let mut bytes = 0;
        loop {
            let n = file.read(&mut buffer).map_err(failed)?;
            if n == 0 {
                return Ok((bytes, crc.finalize()));
            }
            crc.update(&buffer[..n]);
            bytes += n as u64;
        }
    })?;
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Input { file, bytes, crc32: format!("{crc32:08x}") })
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
        let a = input(&path, None).unwrap();
        // The check value of CRC-32.
        assert_eq!((a.file.as_str(), a.bytes, a.crc32.as_str()), ("a.ply", 9, "cbf43926"));
        assert!(input(&dir.path().join("none"), None).is_err());
        // Another file since then: its checksum would be that of bytes that the scene does not have.
        let before = Stamp::of(&path);
        assert_eq!(input(&path, before).unwrap().crc32, "cbf43926");
        std::fs::write(&path, "987654321").unwrap();
        let why = input(&path, before).unwrap_err().to_string();
        assert!(why.ends_with("a.ply has changed since the scene was loaded"), "{why}");
    }
}
