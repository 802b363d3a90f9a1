//! The scene, read again whenever one of its files changes.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use crate::renderer::Device;
use crate::scene::{Object, Scene};
use crate::scene_file::Loaded;
use crate::study::provenance;

/// Time between two looks at the files.
const LOOK: Duration = Duration::from_millis(250);
/// Time after which a scene that cannot be read is tried again, though its file is the same: a model may be missing.
const AGAIN: Duration = Duration::from_secs(3);

/// What the program decides, and pages cannot.
pub struct Setup {
    /// The scene file, or a model file.
    pub path: PathBuf,
    /// Where pages save files; made when the first is saved. `None`: `out/` and the name of the scene.
    pub out: Option<PathBuf>,
    /// What `backend auto` of a page is.
    pub device: Device,
    /// Bytes that a frame and the models may take together, on the CPU and on a GPU.
    pub memory: [u64; 2],
    /// The threads that render.
    pub pool: rayon::ThreadPool,
    /// Messages of the library in the words of the command line.
    pub words: fn(&str) -> String,
    /// The grammar of modes, for the help of the page.
    pub modes: &'static str,
}

/// A scene that was read.
pub(super) struct Known {
    pub(super) loaded: Loaded,
    /// It was made of a model file.
    pub(super) of_model: bool,
}

impl Known {
    pub(super) const fn scene(&self) -> &Scene {
        &self.loaded.scene
    }
}

/// What there is to be seen.
#[derive(Clone, Default)]
pub(super) struct State {
    /// Counts the changes.
    pub(super) version: u64,
    /// The last that could be read.
    pub(super) scene: Option<Arc<Known>>,
    /// Why the files cannot be read as they are now.
    pub(super) broken: Option<String>,
    pub(super) loading: bool,
}

/// A page that is told when the scene is another, or cannot be read.
pub(super) trait Listener: Send + Sync {
    fn scene_changed(&self);
}

/// What all pages share.
pub(super) struct Shared {
    pub(super) setup: Setup,
    state: Mutex<State>,
    pages: Mutex<Vec<Weak<dyn Listener>>>,
    /// Held while a file is written.
    pub(super) saving: Arc<Mutex<()>>,
}

impl Shared {
    pub(super) fn new(setup: Setup) -> Self {
        let state = Mutex::new(State { loading: true, version: 1, ..State::default() });
        Self { setup, state, pages: Mutex::default(), saving: Arc::default() }
    }

    pub(super) fn state(&self) -> State {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Tells a page of changes from now on.
    pub(super) fn tell(&self, page: &Arc<impl Listener + 'static>) {
        let mut pages = self.pages.lock().unwrap_or_else(PoisonError::into_inner);
        pages.retain(|page| page.strong_count() > 0);
        let page = Arc::clone(page) as Arc<dyn Listener>;
        pages.push(Arc::downgrade(&page));
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            change(&mut state);
            state.version += 1;
        }
        let pages = self.pages.lock().unwrap_or_else(PoisonError::into_inner);
        pages.iter().filter_map(Weak::upgrade).for_each(|page| page.scene_changed());
    }

    /// Reads the scene with `load`, and again whenever a file changes. Does not return.
    pub(super) fn watch(&self, load: &mut dyn FnMut() -> Result<Loaded, String>) -> ! {
        let mut files = vec![self.setup.path.clone()];
        loop {
            // Before reading: what changes meanwhile is read again.
            let mut seen = marks(&files);
            let tried = Instant::now();
            let end = match load() {
                Ok(loaded) => {
                    let named = named(&self.setup.path, &loaded.scene);
                    if named != files {
                        files = named;
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

/// The scene file and all that it names.
fn named(path: &Path, scene: &Scene) -> Vec<PathBuf> {
    let mut files = vec![path.to_owned()];
    files.extend(provenance::files(scene).into_iter().filter(|file| *file != path).cloned());
    for sequence in scene.objects.iter().filter_map(|object| object.sequence.as_ref()) {
        let spec = sequence.spec();
        files.extend((spec.first..=spec.last).map(|number| spec.pattern.path(number)));
    }
    files
}
