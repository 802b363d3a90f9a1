//! Files that a page saves: pictures as `splatblur render` writes them, scenes, and movies' names. No file is ever
//! replaced.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError};

use super::message::SavedKind;
use super::shared::{Known, Shared};
use super::view::PageLook;
use crate::files;
use crate::film::Picture;
use crate::image::{self, Bits, Format};
use crate::options::RenderOptions;
use crate::scene::Scene;
use crate::scene_file;
use crate::study::provenance::Provenance;

/// A finished picture, with what made it.
pub(super) struct Finished {
    pub(super) picture: Arc<Picture>,
    pub(super) scene: Scene,
    pub(super) options: RenderOptions,
    /// `cpu` or `gpu`.
    pub(super) backend: &'static str,
    /// What mode auto reached.
    pub(super) comment: Option<String>,
}

/// Names with these numbers are tried.
const NUMBERS: std::ops::RangeInclusive<u32> = 1..=9999;

/// Writes a picture, the scene or the camera path; returns the path. The error is one line.
pub(super) fn save(
    shared: &Shared,
    known: &Known,
    look: &PageLook,
    finished: &Finished,
    what: SavedKind,
) -> Result<PathBuf, String> {
    let scene = known.scene();
    let out = folder(shared, scene)?;
    let cannot = |why: &dyn std::fmt::Display| cannot(&out, why);
    let create = |stem: &str, extension: &str, bytes: &[u8]| {
        let write = |temporary: &Path| std::fs::write(temporary, bytes);
        told(&out, shared, || files::create_with(paths(&out, stem, extension), write))
    };
    let format = match what {
        SavedKind::Path => {
            let camera = look.flown(scene).ok_or_else(|| "the camera path has no keys yet".to_owned())?;
            return create(&format!("{}.path", scene.name), "xml", scene_file::camera_path(&camera).as_bytes());
        }
        SavedKind::Scene => {
            let mut changed = look.changed(scene);
            // The ground of a studio is in no file.
            changed
                .objects
                .retain(|object| known.loaded.studio.is_none() || !object.source.path.as_os_str().is_empty());
            let text = scene_file::to_xml(&changed, &out);
            return create(&scene.name, "xml", text.as_bytes());
        }
        SavedKind::Png if look.buffer.is_some() => {
            return Err("PNG holds colour and alpha only: save layers as EXR".to_owned());
        }
        SavedKind::Png => Format::Png { bits: Bits::Eight, alpha: finished.scene.image.transparent },
        SavedKind::Exr => Format::EXR,
    };
    let Finished { picture, scene, options, backend, comment } = finished;
    let display = known.loaded.display();
    let settings = Provenance::of(scene, &shared.setup.path).and_then(|provenance| {
        let provenance = provenance.shown(display);
        provenance.splatted(options, format, backend).and_then(|settings| settings.of_frame(look.frame))
    });
    let settings = settings.map_err(|why| cannot(&why))?;
    let shown = match format {
        Format::Png { bits, alpha } if !display.is_plain() => Arc::new(display.shown((**picture).clone(), bits, alpha)),
        _ => Arc::clone(picture),
    };
    let bytes =
        image::encode_with_comment(&shown, format, &settings, comment.as_deref()).map_err(|why| cannot(&why))?;
    create(&format!("{}.{}", scene.name, look.frame.padded()), format.extension(), &bytes)
}

fn cannot(out: &Path, why: &dyn std::fmt::Display) -> String {
    format!("cannot save into {}: {why}", out.display())
}

/// The folder of saved files, made where it is missing.
pub(super) fn folder(shared: &Shared, scene: &Scene) -> Result<PathBuf, String> {
    let out = shared.setup.out.clone().unwrap_or_else(|| Path::new("out").join(&scene.name));
    std::fs::create_dir_all(&out).map_err(|why| cannot(&out, &why))?;
    Ok(out)
}

/// Names for a file, of which it gets the first that nothing has.
pub(super) fn paths(out: &Path, stem: &str, extension: &str) -> impl Iterator<Item = PathBuf> {
    NUMBERS.map(move |number| out.join(format!("{stem}.view-{number}.{extension}")))
}

/// Makes a file, which gets one of these names; returns its path, or why there is none in one line.
pub(super) fn told(
    out: &Path,
    shared: &Shared,
    make: impl FnOnce() -> io::Result<Option<PathBuf>>,
) -> Result<PathBuf, String> {
    // Nobody ends the program meanwhile.
    let _held = shared.saving.lock().unwrap_or_else(PoisonError::into_inner);
    make().map_err(|why| cannot(out, &why))?.ok_or_else(|| cannot(out, &"9999 files are there already"))
}
