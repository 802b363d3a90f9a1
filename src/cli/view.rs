//! `splatblur view`: a scene in the browser.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::PoisonError;

use anyhow::Context as _;
use clap::Args;
use splatblur::viewer::{Setup, Viewer};

use super::backend::Wanted;
use super::common::{MODES, Overrides, Running};
use super::output::{print, say};
use super::words::with_flags;
use super::{info, memory, values};

/// Look at a scene in the browser: orbit, play, change modes, look at buffers, save.
///
/// Serves a page on this computer's loopback address, and prints its link. The link holds a secret: whoever knows it
/// may look at the scene, and save pictures of it into DIR. The scene is read again whenever one of its files changes.
/// Ctrl-C ends it.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  splatblur view scenes/three_objects.xml
  splatblur view bunny.ply --backend cpu
  On another computer, with the browser here (or: ssh -L 8000:localhost:8000 HOST):
    ssh HOST splatblur view scene.xml --port 8000
  The same link after each start, so that an open page goes on by itself:
    splatblur view scene.xml --port 8000 --token-file ~/.splatblur-token

The page has its keys and the grammar of modes under `?`. Saved pictures have the bytes of `splatblur render` with the
same settings.")]
pub(super) struct View {
    /// Scene file (XML), or a model file, as for `render`.
    scene: PathBuf,
    /// Port of the loopback address [default: any free one].
    #[arg(long, value_name = "PORT", default_value_t = 0, hide_default_value = true, help_heading = "Serving")]
    port: u16,
    /// File of the secret in the link: read, or made for this user alone where it is missing [default: a new secret].
    #[arg(long, value_name = "FILE", help_heading = "Serving")]
    token_file: Option<PathBuf>,
    /// Directory of saved files; made if missing. No file is ever replaced [default: out/<scene>].
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overrides: Overrides,
    /// Backend to render on, until the page chooses another.
    #[arg(long, value_enum, default_value_t, help_heading = "Running")]
    backend: Wanted,
    /// Part of the name of the adapter to render on (`splatblur info --adapters` lists them).
    #[arg(long, value_name = "NAME", help_heading = "Running")]
    adapter: Option<String>,
    /// Memory that a frame and the models may take together, as in 64M, 1G [default: as for `render`].
    #[arg(
        long,
        value_name = "SIZE",
        allow_hyphen_values = true,
        value_parser = values::memory,
        help_heading = "Running"
    )]
    memory: Option<u64>,
    #[command(flatten)]
    running: Running,
}

impl View {
    pub(super) fn run(&self) -> anyhow::Result<ExitCode> {
        // A file that is not there is a mistake of the line; what is wrong inside a file is shown in the page.
        info::head(&self.scene).with_context(|| format!("cannot read {}", self.scene.display()))?;
        let pool = self.running.pool()?;
        let setup = Setup {
            path: self.scene.clone(),
            out: self.out.clone(),
            device: self.backend.device(self.adapter.as_deref())?,
            memory: [false, true].map(|on_device| memory::budget(self.memory, on_device, self.running.quiet)),
            pool: self.running.pool()?,
            words: with_flags,
            modes: MODES,
        };
        let viewer = Viewer::open(setup, self.port, self.token_file.as_deref())?;
        let gate = viewer.gate();
        let stop = move || {
            let _held = gate.lock().unwrap_or_else(PoisonError::into_inner);
            // Without exit handlers, as in `render`.
            signal_hook::low_level::exit(i32::from(super::INTERRUPTED));
        };
        ctrlc::set_handler(stop).context("cannot watch for Ctrl-C")?;
        print(&format!("{}\n", viewer.link()))?;
        if !self.running.quiet {
            say("open this link in a browser; Ctrl-C ends it");
        }
        viewer.run(|| self.running.load(&self.scene, &self.overrides, &pool).map_err(|why| format!("{why:#}")))
    }
}
