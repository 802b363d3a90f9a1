//! Makes a reference, in one run or as the continuation of an earlier one.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::error::ReferenceError;
use super::integrator::{Integrator, RoundListener, RoundProgress};
use super::options::{ROUND, ReferenceOptions};
use super::posed::World;
use super::sums::Sums;
use crate::film::Picture;
use crate::scene::Scene;
use crate::stop::{Done, Progress, Stop};
use crate::time::FrameNumber;

/// A finished reference.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The picture. Its last layer is the standard error.
    pub picture: Picture,
    /// Partial sums, from which a later run can continue.
    pub sums: Sums,
    /// Numbers about the run.
    pub stats: ReferenceStats,
}

/// Samples, memory and time of a reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceStats {
    /// Samples of a pixel, including those of earlier runs.
    pub samples: u64,
    /// Samples of this run in all pixels.
    pub traced: u64,
    /// Mean standard error over all pixels and over r, g, b (of the picture) and coverage.
    pub mean_error: f64,
    /// Samples of this run with more than eight layers of see-through surfels, of which the farther ones were left out.
    pub cut: u64,
    /// Surfels of the distinct models whose surfels were traced.
    pub surfels: u64,
    /// Triangles of the distinct models whose triangles were traced.
    pub triangles: u64,
    /// Gaussians of the distinct captures and volumes that can be seen.
    pub gaussians: u64,
    /// Memory of the hierarchies of all, bytes.
    pub hierarchy_bytes: u64,
    /// Memory of the partial sums, bytes.
    pub sums_bytes: u64,
    /// Wall time of building the hierarchies.
    pub build: Duration,
    /// Wall time of tracing.
    pub trace: Duration,
}

/// Makes the reference picture of one frame.
///
/// ```
/// use splatblur::reference::{self, ReferenceOptions};
/// use splatblur::{RenderOptions, Scene};
///
/// let scene = Scene::open("scenes/swarm.xml").size(16, 12).load()?;
/// let options = RenderOptions::default();
/// let truth = reference::picture(&scene, 3, &ReferenceOptions::like(&options, 16))?;
/// assert_eq!(truth.width, 16);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The scene or the options are not valid, or do not go together.
pub fn picture(
    scene: &Scene,
    frame: impl Into<FrameNumber>,
    options: &ReferenceOptions,
) -> Result<Picture, ReferenceError> {
    Ok(render(scene, frame, options, None, &|_| ())?.picture)
}

/// As [`picture`], but tells `progress` how far it is, and ends with [`ReferenceError::Stopped`] soon after `stop` is
/// set.
///
/// # Errors
/// As [`picture`], or it was stopped.
pub fn picture_until(
    scene: &Scene,
    frame: impl Into<FrameNumber>,
    options: &ReferenceOptions,
    progress: &Progress,
    stop: &Stop,
) -> Result<Picture, ReferenceError> {
    let tell = |step: RoundProgress| {
        let rounds = if options.error.is_some() { step.samples / ROUND } else { 0 };
        progress.tell(Done { round: if step.is_building() { 0 } else { rounds + 1 }, share: step.share });
    };
    Ok(render_until(scene, frame, options, None, (&tell, Some(stop)))?.picture)
}

/// Makes the reference of one frame. It starts from the beginning, or from the sums of an `earlier` run with the same
/// scene and options (except `samples` and `error`). If that run has as many samples as this one needs, none are added.
///
/// # Errors
/// The options contradict each other or the earlier run.
pub fn render(
    scene: &Scene,
    frame: impl Into<FrameNumber>,
    options: &ReferenceOptions,
    earlier: Option<Sums>,
    progress: RoundListener<'_>,
) -> Result<Reference, ReferenceError> {
    render_until(scene, frame, options, earlier, (progress, None))
}

/// As [`render`], but ends with [`ReferenceError::Stopped`] soon after `stop` is set.
///
/// # Errors
/// As [`render`], or it was stopped.
pub fn render_until(
    scene: &Scene,
    frame: impl Into<FrameNumber>,
    options: &ReferenceOptions,
    earlier: Option<Sums>,
    (progress, stop): (RoundListener<'_>, Option<&Stop>),
) -> Result<Reference, ReferenceError> {
    options.check()?;
    let (frame, scene) = options.enter(scene, frame.into())?;
    let scene = &*scene;
    if !options.sampler.is_progressive() && earlier.is_some() {
        return Err(ReferenceError::Fixed);
    }
    let samples = options.samples;
    let size = [scene.image.width, scene.image.height];
    let mut sums = match earlier {
        Some(sums) => sums.like(size, &options.look.aovs)?,
        None => Sums::new(size, &options.look.aovs)?,
    };
    let start = Instant::now();
    let before = sums.samples;
    let tell = |share: f64| progress(RoundProgress { samples: before, end: before, share, error: None });
    let world = World::new(scene, frame, options, (&tell, stop))?;
    let build = start.elapsed();
    let start = Instant::now();
    let backdrop = world.backdrop(frame.get(), [0, 0], size);
    let integrator = Integrator::new(&world, frame, [0, 0], &backdrop);
    let stopped = || if world.is_stopped() { Err(ReferenceError::Stopped) } else { Ok(()) };
    stopped()?;
    if let Some(limit) = options.error {
        let mut error = None;
        while sums.samples < samples {
            if sums.samples > 0 {
                let now = sums.mean_error_of_even(&backdrop);
                error = Some(now);
                if now < limit {
                    break;
                }
            }
            let end = (sums.samples / ROUND * ROUND + ROUND).min(samples);
            integrator.add(&mut sums, end, error, progress);
            stopped()?;
        }
    } else if sums.samples < samples {
        integrator.add(&mut sums, samples, None, progress);
        stopped()?;
    }
    let stats = ReferenceStats {
        samples: sums.samples,
        traced: (sums.samples - before) * u64::from(size[0]) * u64::from(size[1]),
        mean_error: sums.mean_error(&backdrop),
        cut: integrator.cut.load(Ordering::Relaxed),
        surfels: world.surfels(),
        triangles: world.triangles(),
        gaussians: world.gaussians(),
        hierarchy_bytes: world.bytes(),
        sums_bytes: sums.bytes(),
        build,
        trace: start.elapsed(),
    };
    Ok(Reference { picture: sums.develop(&options.look.aovs, &backdrop), sums, stats })
}
