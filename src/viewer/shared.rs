//! What all pages share: the program's choices, the scene as it is now, and who is there.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::renderer::Device;
use crate::scene::Scene;
use crate::scene_file::LoadedScene;

/// Pages at a time.
const MOST_PAGES: usize = 8;

/// What the program decides, and pages cannot.
pub struct Setup {
    /// The scene file, or a model file.
    pub path: PathBuf,
    /// Where pages save files; made when the first is saved. `None`: `out/` and the name of the scene.
    pub out: Option<PathBuf>,
    /// What `backend auto` of a page is.
    pub device: Device,
    /// Bytes that frames and models may take together, on the CPU and on a GPU. Pages share them.
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
    pub(super) loaded: LoadedScene,
    /// It was made of a model file.
    pub(super) of_model: bool,
}

impl Known {
    pub(super) const fn scene(&self) -> &Scene {
        &self.loaded.scene
    }

    /// Is its camera that of a model alone, and not one of a file?
    pub(super) fn rests_alone(&self) -> bool {
        self.scene().camera.rests()
    }
}

/// What there is to be seen.
#[derive(Clone, Default)]
pub(super) struct State {
    /// The last that could be read.
    pub(super) scene: Option<Arc<Known>>,
    /// Why the files cannot be read as they are now.
    pub(super) broken: Option<String>,
    pub(super) loading: bool,
}

/// A page that is told when the scene is another, or cannot be read, or when another page comes.
pub(super) trait Listener: Send + Sync {
    fn news(&self);
}

/// What all pages share.
pub(super) struct Shared {
    pub(super) setup: Setup,
    state: Mutex<State>,
    pages: Mutex<Vec<Arc<dyn Listener>>>,
    /// Held while a file is written.
    pub(super) saving: Arc<Mutex<()>>,
}

/// A page's place among the others, until it is dropped.
pub(super) struct Seat<'a> {
    shared: &'a Shared,
    page: Arc<dyn Listener>,
}

impl Drop for Seat<'_> {
    fn drop(&mut self) {
        self.shared.hold_pages().retain(|page| !Arc::ptr_eq(page, &self.page));
    }
}

impl Shared {
    pub(super) fn new(setup: Setup) -> Self {
        let state = Mutex::new(State { loading: true, ..State::default() });
        Self { setup, state, pages: Mutex::default(), saving: Arc::default() }
    }

    pub(super) fn state(&self) -> State {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn hold_pages(&self) -> MutexGuard<'_, Vec<Arc<dyn Listener>>> {
        self.pages.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Number of pages that are open.
    pub(super) fn pages(&self) -> usize {
        self.hold_pages().len()
    }

    /// Takes a page in, and tells it and the others; `None`: there are too many.
    pub(super) fn seat(&self, page: Arc<dyn Listener>) -> Option<Seat<'_>> {
        let mut pages = self.hold_pages();
        if pages.len() >= MOST_PAGES {
            return None;
        }
        pages.push(Arc::clone(&page));
        pages.iter().for_each(|page| page.news());
        drop(pages);
        Some(Seat { shared: self, page })
    }

    /// Changes the state, and tells all pages.
    pub(super) fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner));
        self.hold_pages().iter().for_each(|page| page.news());
    }
}
