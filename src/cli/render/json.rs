//! What `render --json` prints. The long help of `render` lists the fields.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;
use splatblur::FrameNumber;
use splatblur::backend::{Achieved, GpuCalls, Pixels, Waste};
use splatblur::renderer::Stats;
use splatblur::study::provenance::Settings;

use super::sequence::Finished;

/// `--json`.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    pub(super) program: &'static str,
    pub(super) scene: &'a str,
    pub(super) directory: &'a Path,
    pub(super) backend: &'static str,
    pub(super) frames: Vec<FrameReport<'a>>,
    pub(super) load_seconds: f64,
    pub(super) seconds: f64,
    pub(super) notes: &'a [String],
    /// Names of the layer `object`, by index.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) objects: Option<BTreeMap<usize, &'a str>>,
    pub(super) movie: Option<&'a Path>,
    pub(super) ffmpeg: Option<String>,
    pub(super) settings: &'a Settings,
}

#[derive(Serialize)]
pub(super) struct FrameReport<'a> {
    frame: FrameNumber,
    /// `None`: in the movie alone.
    path: Option<&'a Path>,
    skipped: bool,
    seconds: f64,
    samples: u64,
    surfels: u64,
    splats: u64,
    /// Pixels, over all instants, with more layers of see-through surfels than are drawn.
    left_out: u64,
    /// As `Stats::detail`.
    detail: f64,
    /// What mode auto reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    auto: Option<Achieved>,
    /// CPU seconds of all threads; on the CPU alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    cpu_seconds: Option<PassSeconds>,
    /// On a GPU, as far as it measures them.
    #[serde(skip_serializing_if = "Option::is_none")]
    device_seconds: Option<PassSeconds>,
    /// Calls to a GPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    gpu: Option<GpuCalls>,
    /// On the CPU: pixels that passes looked at in vain.
    #[serde(skip_serializing_if = "Option::is_none")]
    waste: Option<PassWaste>,
}

/// Passes that ran, each with its counts.
#[derive(Serialize)]
struct PassWaste {
    #[serde(skip_serializing_if = "Option::is_none")]
    visibility: Option<PixelCounts>,
    #[serde(skip_serializing_if = "Option::is_none")]
    attribute: Option<PixelCounts>,
    #[serde(skip_serializing_if = "Option::is_none")]
    composite: Option<PixelCounts>,
}

#[derive(Serialize)]
struct PixelCounts {
    bounded: u64,
    covered: u64,
    waste: Option<f64>,
}

impl PixelCounts {
    fn of(pixels: Pixels) -> Option<Self> {
        let Pixels { bounded, covered } = pixels;
        (bounded > 0).then(|| Self { bounded, covered, waste: pixels.waste() })
    }
}

#[derive(Serialize)]
struct PassSeconds {
    project: f64,
    /// Seconds for captures.
    sort: f64,
    /// On the CPU a part of `project`, but for captures.
    bin: f64,
    visibility: f64,
    attribute: f64,
    /// Seconds for captures.
    composite: f64,
    resolve: f64,
    total: f64,
}

impl<'a> FrameReport<'a> {
    pub(super) fn new(finished: &'a Finished, backend: &str) -> Self {
        let (seconds, stats) = finished.rendered.unwrap_or((0.0, Stats::default()));
        let Stats { project, sort, bin, visibility, attribute, composite, resolve, .. } = stats;
        let seconds_of = |pass: std::time::Duration| pass.as_secs_f64();
        let passes = Some(PassSeconds {
            project: seconds_of(project),
            sort: seconds_of(sort),
            bin: seconds_of(bin),
            visibility: seconds_of(visibility),
            attribute: seconds_of(attribute),
            composite: seconds_of(composite),
            resolve: seconds_of(resolve),
            total: seconds_of(project + sort + bin + visibility + attribute + composite + resolve),
        });
        let (cpu_seconds, device_seconds) = if backend == "cpu" { (passes, None) } else { (None, passes) };
        let Waste { visibility, attribute, composite } = stats.waste;
        let [visibility, attribute, composite] = [visibility, attribute, composite].map(PixelCounts::of);
        let waste = (backend == "cpu").then_some(PassWaste { visibility, attribute, composite });
        Self {
            frame: finished.frame,
            path: finished.path.as_deref(),
            skipped: finished.rendered.is_none(),
            seconds,
            samples: stats.samples,
            surfels: stats.surfels,
            splats: stats.splats,
            left_out: stats.left_out,
            detail: stats.detail,
            auto: stats.achieved,
            cpu_seconds,
            device_seconds,
            gpu: stats.gpu,
            waste,
        }
    }
}
