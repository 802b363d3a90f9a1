//! The scene, read again whenever one of its files changes.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use super::shared::{Known, Shared};
use crate::files::{Seen, Stamp};
use crate::scene::Object;
use crate::scene_file::LoadedScene;

/// Time between two looks at the files.
const LOOK: Duration = Duration::from_millis(250);
/// Time after which a scene that cannot be read is tried again, though its file is the same: a model may be missing.
const AGAIN: Duration = Duration::from_secs(3);

impl Shared {
    /// Reads the scene with `load`, and again whenever a file changes. Does not return.
    pub(super) fn watch(&self, load: &mut dyn FnMut() -> Result<LoadedScene, String>) -> ! {
        let mut seen = now([&self.setup.path]);
        loop {
            // Before reading: what changes meanwhile is read again.
            seen = now(seen.keys());
            let tried = Instant::now();
            let end = match load() {
                Ok(loaded) => {
                    seen = files_of(&loaded, &seen);
                    let only = |object: &Object| object.source.path == self.setup.path;
                    let of_model =
                        loaded.studio.is_some() || matches!(&loaded.scene.objects[..], [object] if only(object));
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
            wait(&seen, end);
        }
    }
}

/// Waits until the files are other than `seen` and have come to rest, or until `end`.
fn wait(seen: &Seen, end: Option<Instant>) {
    let mut last = now(seen.keys());
    loop {
        thread::sleep(LOOK);
        let now = now(seen.keys());
        if now == last && now != *seen || end.is_some_and(|end| Instant::now() >= end) {
            return;
        }
        last = now;
    }
}

/// Files as they are now.
fn now<'a>(files: impl IntoIterator<Item = &'a PathBuf>) -> Seen {
    files.into_iter().map(|file| (file.clone(), Stamp::of(file))).collect()
}

/// The files of a scene: those that were read, as they were then, those of its sequences, and those of `before` that
/// are missing now. An editor may put a file aside and write it anew.
fn files_of(loaded: &LoadedScene, before: &Seen) -> Seen {
    let mut files = loaded.scene.files.clone();
    for sequence in loaded.scene.objects.iter().filter_map(|object| object.shape.sequence()) {
        let spec = sequence.spec();
        for path in (spec.first..=spec.last).map(|number| spec.pattern.path(number)) {
            // What was read counts as it was then.
            let stamp = before.get(&path).copied().unwrap_or_else(|| Stamp::of(&path));
            files.entry(path).or_insert(stamp);
        }
    }
    for file in before.keys().filter(|file| !file.exists()) {
        files.entry(file.clone()).or_insert(None);
    }
    files
}
