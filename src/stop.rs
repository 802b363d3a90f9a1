//! Words to work under way, that nobody waits for it any more, and from it, how far it is.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A word to work under way: set by one thread, heeded by others. Work that heeds it ends soon, without a result.
///
/// ```
/// use std::sync::Arc;
/// use splatblur::{BackendError, Device, RenderOptions, Renderer, Scene, Stop};
///
/// let scene = Scene::open("scenes/swarm.xml").size(64, 48).load()?;
/// let mut renderer = Renderer::open(Device::Cpu)?;
/// let stop = Arc::new(Stop::default());
/// renderer.heed(Arc::clone(&stop));
/// stop.set(); // here; else in another thread
/// let ended = renderer.render(&scene, 3, &RenderOptions::default());
/// assert!(matches!(ended, Err(BackendError::Stopped)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Default)]
pub struct Stop(AtomicBool);

impl Stop {
    /// Stops the work.
    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Lets work begin again.
    pub fn clear(&self) {
        self.0.store(false, Ordering::Relaxed);
    }

    /// Is the work to end?
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// How much of a picture is done.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Done {
    /// Rounds that were begun, from 1; 0 while a reference builds what it traces. A frame of mode auto, and a reference
    /// that stops at an error, take several rounds, and it is not known before how many; all others take one.
    pub round: u64,
    /// Finished share of this round, 0 to 1.
    pub share: f64,
}

/// A function that is told how far work is: often, and from several threads. It should return soon.
///
/// ```
/// use splatblur::{Device, Progress, RenderOptions, Renderer, Scene};
///
/// let scene = Scene::open("scenes/swarm.xml").size(64, 48).load()?;
/// let mut renderer = Renderer::open(Device::Cpu)?;
/// renderer.tell(Progress::new(|done| println!("round {}: {:.0} %", done.round, 100.0 * done.share)));
/// renderer.render(&scene, 3, &RenderOptions::default())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Progress(Arc<dyn Fn(Done) + Send + Sync>);

impl Progress {
    /// Calls `told` with what is done.
    pub fn new(told: impl Fn(Done) + Send + Sync + 'static) -> Self {
        Self(Arc::new(told))
    }

    /// Tells it.
    pub fn tell(&self, done: Done) {
        (self.0)(done);
    }
}

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Progress")
    }
}
