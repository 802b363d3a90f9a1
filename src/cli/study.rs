//! What `sheet` and `report` share: options that hold for all modes, and the trial that they make of a scene.

use std::path::Path;
use std::sync::LazyLock;

use clap::Args;
use splatblur::image::Display;
use splatblur::options::RenderOptions;
use splatblur::renderer::{Device, Renderer};
use splatblur::scene_file::LoadedScene;
use splatblur::study::{BackendKind, Opened, Trial};

use super::backend::in_full;
use super::common::{self, Overrides, Running, Sampling, Splatting, Surfaces};
use super::studio::ModelAlone;

/// The grammar of modes in studies, for long helps.
pub(super) static MODES: LazyLock<String> = LazyLock::new(|| {
    format!(
        "{}\n\
Here there is also, with another seed than --reference:
  reference:1024              ray-traced, SPP samples of a pixel (a multiple of 16)
A mode with a filter of its own is compared with the reference of that filter. It may end in @cpu or @gpu, the backend
that renders it. The reference keeps the scene's depth tolerance, has no prefilter, and shows all detail.",
        common::MODES
    )
});

/// Options that hold for all modes.
#[derive(Debug, Args)]
pub(super) struct Common {
    #[command(flatten)]
    pub(super) overrides: Overrides,
    #[command(flatten)]
    sampling: Sampling,
    #[command(flatten)]
    surfaces: Surfaces,
    #[command(flatten)]
    splatting: Splatting,
    #[command(flatten)]
    running: Running,
}

/// A scene that is ready for a study.
pub(super) struct ReadyScene {
    pub(super) trial: Trial<'static>,
    /// What loading has noted.
    pub(super) notes: Vec<String>,
    /// How its pictures are shown where nobody chooses another way.
    pub(super) display: Display,
    /// The threads that everything runs on.
    pub(super) pool: rayon::ThreadPool,
}

impl Common {
    /// Say nothing but errors?
    pub(super) fn quiet(&self) -> bool {
        self.running.quiet
    }

    /// Reads the scene, and puts the options into it. `alone`: how a model file is shown.
    pub(super) fn load(&self, path: &Path, alone: &ModelAlone) -> anyhow::Result<ReadyScene> {
        let pool = self.running.pool()?;
        let loaded = self.running.load(path, &self.overrides, alone, &pool)?;
        let display = loaded.display();
        let LoadedScene { scene, notes, .. } = loaded;
        let threads = pool.current_num_threads();
        let open = move |kind| {
            let device = match kind {
                BackendKind::Cpu => Device::Cpu,
                BackendKind::Gpu => Device::Gpu { adapter: None },
            };
            let renderer = Renderer::open(device)?;
            let description = in_full(&renderer, threads);
            Ok(Opened { renderer, description })
        };
        let options = RenderOptions {
            // A study may render on both.
            memory: self.splatting.limit.memory("gpu", self.running.quiet),
            detail: self.splatting.detail.unwrap_or_default(),
            look: self.surfaces.look(&self.sampling, Vec::new()),
            ..RenderOptions::default()
        };
        Ok(ReadyScene {
            display,
            trial: Trial::new(scene, path, options, self.splatting.prefilter, Box::new(open)),
            notes,
            pool,
        })
    }
}
