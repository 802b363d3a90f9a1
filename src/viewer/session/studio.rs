//! The device that renders for a page.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::super::shared::Shared;
use super::super::view::PageLook;
use crate::backend::{BackendError, Rendered};
use crate::film::Picture;
use crate::options::RenderOptions;
use crate::reference::{self, Reference, ReferenceError, ReferenceOptions, Sums};
use crate::renderer::{Device, Renderer};
use crate::scene::Scene;
use crate::stop::Stop;

/// Why there is no picture.
pub(super) enum Ended {
    /// A newer view came, or the page has gone.
    Stopped,
    Failed(String),
}

impl From<BackendError> for Ended {
    fn from(error: BackendError) -> Self {
        if matches!(error, BackendError::Stopped) { Self::Stopped } else { Self::Failed(error.to_string()) }
    }
}

impl From<ReferenceError> for Ended {
    fn from(error: ReferenceError) -> Self {
        if matches!(error, ReferenceError::Stopped) { Self::Stopped } else { Self::Failed(error.to_string()) }
    }
}

/// Renders on the device that a page asks for.
pub(super) struct Studio<'a> {
    shared: &'a Shared,
    stop: Arc<Stop>,
    renderer: Option<(Device, Renderer)>,
    /// Pages that there were when the renderer was opened.
    pages: usize,
}

impl<'a> Studio<'a> {
    pub(super) fn new(shared: &'a Shared, stop: Arc<Stop>) -> Self {
        Self { shared, stop, renderer: None, pages: 0 }
    }

    /// Opens the device of a look, unless it is open; true: it is another one than before.
    pub(super) fn open(&mut self, device: &Device) -> Result<bool, Ended> {
        if self.renderer.as_ref().is_some_and(|(of, _)| of == device) {
            return Ok(false);
        }
        let chosen = if *device == Device::Auto { &self.shared.setup.device } else { device };
        self.pages = self.shared.pages();
        let mut renderer = Renderer::open(chosen.clone())?;
        renderer.heed(Arc::clone(&self.stop));
        self.renderer = Some((device.clone(), renderer));
        Ok(true)
    }

    /// Gives memory back where more pages share it by now.
    pub(super) fn make_room(&mut self) {
        if self.shared.pages() > self.pages {
            self.renderer = None;
        }
    }

    /// Bytes that a frame and the models may take: all pages have equal shares.
    pub(super) fn memory(&self) -> u64 {
        self.shared.setup.memory[usize::from(self.name() == "gpu")] / self.shared.pages().max(1) as u64
    }

    /// Renders on the open device; the picture, its statistics and the time.
    pub(super) fn render(
        &mut self,
        scene: &Scene,
        look: &PageLook,
        options: &RenderOptions,
    ) -> Result<(Rendered, Duration), Ended> {
        let Some((_, renderer)) = &mut self.renderer else { return Err(Ended::Stopped) };
        let begin = Instant::now();
        let rendered = self.shared.setup.pool.install(|| renderer.render(scene, look.frame, options))?;
        Ok((rendered, begin.elapsed()))
    }

    /// Gives the sums of a reference more samples; its picture and the time.
    pub(super) fn trace(
        &self,
        scene: &Scene,
        look: &PageLook,
        options: &ReferenceOptions,
        earlier: Option<Sums>,
    ) -> Result<(Reference, Duration), Ended> {
        let begin = Instant::now();
        let stop = Some(&*self.stop);
        let trace = || reference::render_until(scene, look.frame, options, earlier, (&|_| (), stop));
        Ok((self.shared.setup.pool.install(trace)?, begin.elapsed()))
    }

    /// Takes a picture back that is no longer needed.
    pub(super) fn recycle(&mut self, picture: Picture) {
        if let Some((_, renderer)) = &mut self.renderer {
            renderer.recycle(picture);
        }
    }

    /// `cpu` or `gpu`.
    pub(super) fn name(&self) -> &'static str {
        self.renderer.as_ref().map_or("cpu", |(_, renderer)| renderer.backend_name())
    }

    /// What renders, for people.
    pub(super) fn describe(&self) -> String {
        let threads = self.shared.setup.pool.current_num_threads();
        self.renderer.as_ref().map_or_else(String::new, |(_, renderer)| renderer.describe_with(threads))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::super::super::shared::{Listener, Setup};
    use super::*;

    /// Counts the news.
    #[derive(Default)]
    struct Counter(AtomicUsize);

    impl Listener for Counter {
        fn news(&self) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn a_page_that_comes_gets_its_share_of_the_memory() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let (path, words) = ("scene.xml".into(), str::to_owned as fn(&str) -> String);
        let setup = Setup { path, out: None, device: Device::Cpu, memory: [960, 0], pool, words, modes: "" };
        let shared = Shared::new(setup);
        let first = Arc::new(Counter::default());
        let _seat = shared.seat(Arc::clone(&first) as Arc<dyn Listener>).unwrap();
        let mut studio = Studio::new(&shared, Arc::default());
        assert!(studio.open(&Device::Cpu).is_ok_and(|is_new| is_new));
        studio.make_room();
        assert!(studio.renderer.is_some() && studio.memory() == 960);
        let other = shared.seat(Arc::new(Counter::default())).unwrap();
        // Its own coming, and that of the other.
        assert_eq!(first.0.load(Ordering::Relaxed), 2);
        studio.make_room();
        assert!(studio.renderer.is_none() && studio.memory() == 480);
        drop(other);
        assert_eq!(studio.memory(), 960);
    }
}
