//! The scene, read again whenever one of its files changes.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use super::shared::{Known, Shared};
use crate::scene::Object;
use crate::scene_file::Loaded;

/// Time between two looks at the files.
const LOOK: Duration = Duration::from_millis(250);
/// Time after which a scene that cannot be read is tried again, though its file is the same: a model may be missing.
const AGAIN: Duration = Duration::from_secs(3);

impl Shared {
    /// Reads the scene with `load`, and again whenever a file changes. Does not return.
    pub(super) fn watch(&self, load: &mut dyn FnMut() -> Result<Loaded, String>) -> ! {
        let mut files = vec![self.setup.path.clone()];
        loop {
            // Before reading: what changes meanwhile is read again.
            let mut seen = marks(&files);
            let tried = Instant::now();
            let end = match load() {
                Ok(loaded) => {
                    let read = files_of(&loaded, &files);
                    if read != files {
                        files = read;
                        seen = marks(&files);
                    }
                    let only = |object: &Object| object.model_path == self.setup.path;
                    let of_model = matches!(&loaded.scene.objects[..], [object] if only(object));
                    let known = Arc::new(Known { loaded, of_model });
                    self.change(|state| (state.scene, state.broken, state.loading) = (Some(known), None, false));
                    None
                }
                Err(why) => {
                    // A message that stays is no news.
                    if self.state().broken.as_ref() != Some(&why) {
                        self.change(|state| (state.broken, state.loading) = (Some(why), false));
                    }
                    Some(tried + AGAIN)
                }
            };
            wait(&files, &seen, end);
        }
    }
}

/// Waits until the files are other than `seen` and have come to rest, or until `end`.
fn wait(files: &[PathBuf], seen: &[Mark], end: Option<Instant>) {
    let mut last = marks(files);
    loop {
        thread::sleep(LOOK);
        let now = marks(files);
        if now == last && now != seen || end.is_some_and(|end| Instant::now() >= end) {
            return;
        }
        last = now;
    }
}

/// By what a change of a file is seen; `None` where it is missing.
type Mark = Option<(SystemTime, u64)>;

fn marks(files: &[PathBuf]) -> Vec<Mark> {
    let mark = |file: &PathBuf| {
        let meta = std::fs::metadata(file).ok()?;
        Some((meta.modified().ok()?, meta.len()))
    };
    files.iter().map(mark).collect()
}

/// The files of a scene: those that were read, those of its sequences, and those of `before` that are missing now. An
/// editor may put a file aside and write it anew.
fn files_of(loaded: &Loaded, before: &[PathBuf]) -> Vec<PathBuf> {
    let mut files = loaded.scene.files.clone();
    for sequence in loaded.scene.objects.iter().filter_map(|object| object.sequence.as_ref()) {
        let spec = sequence.spec();
        files.extend((spec.first..=spec.last).map(|number| spec.pattern.path(number)));
    }
    files.extend(before.iter().filter(|file| !file.exists()).cloned());
    files.into_iter().collect()
}
