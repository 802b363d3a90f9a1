//! `splatblur view`: a scene in the browser.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::PoisonError;

use anyhow::{Context as _, bail};
use clap::Args;
use splatblur::movie;
use splatblur::viewer::{Setup, Viewer};

use super::backend::BackendArgs;
use super::common::{Limit, MODES, Overrides, Running};
use super::info;
use super::output::{print, say};
use super::studio::StudioArgs;
use super::values;
use super::words::with_flags;

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
pub(super) struct ViewCommand {
    /// Scene file (XML), or a model file, as for `render`.
    scene: PathBuf,
    /// Port [default: any free one].
    #[arg(long, value_name = "PORT", default_value_t = 0, hide_default_value = true, help_heading = "Serving")]
    port: u16,
    /// Address of this computer to listen on, as in 192.168.1.5; 0.0.0.0 is all of them [default: 127.0.0.1, which this
    /// computer alone reaches].
    ///
    /// Beyond the loopback address, everyone on the network reaches the program, and the secret of the link alone keeps
    /// them out. Nothing is encrypted: who can listen to the network reads the secret and the pictures, and can then
    /// look, save files into DIR, and keep this computer busy. An SSH tunnel (see the examples) has none of these
    /// risks.
    #[arg(
        long,
        value_name = "ADDRESS",
        default_value_t = Ipv4Addr::LOCALHOST.into(),
        hide_default_value = true,
        help_heading = "Serving"
    )]
    listen: IpAddr,
    /// File of the secret in the link: read, or made for this user alone where it is missing [default: a new secret].
    #[arg(long, value_name = "FILE", help_heading = "Serving")]
    token_file: Option<PathBuf>,
    /// Directory of saved files; made if missing. No file is ever replaced [default: out/<scene>].
    #[arg(long, value_name = "DIR", value_parser = values::directory(), help_heading = "Output")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    alone: StudioArgs,
    #[command(flatten)]
    place: BackendArgs,
    #[command(flatten)]
    limit: Limit,
    #[command(flatten)]
    running: Running,
}

impl ViewCommand {
    pub(super) fn run(&self) -> anyhow::Result<ExitCode> {
        // A file that is not there is a mistake of the line; what is wrong inside a file is shown in the page.
        info::head(&self.scene).with_context(|| format!("cannot read {}", self.scene.display()))?;
        if let Some(path) = &self.overrides.camera_path {
            info::head(path).with_context(|| format!("cannot read {}", path.display()))?;
        }
        self.running.restrict()?;
        if let Some(out) = self.out.as_deref().filter(|out| out.exists() && !out.is_dir()) {
            bail!("cannot save into {}: it is a file; name a directory, which is made if missing", out.display());
        }
        let pool = self.running.pool()?;
        let setup = Setup {
            path: self.scene.clone(),
            out: self.out.clone(),
            device: self.place.device()?,
            // Said once.
            memory: [("cpu", self.running.quiet), ("gpu", true)].map(|(name, quiet)| self.limit.memory(name, quiet)),
            pool: self.running.pool()?,
            words: with_flags,
            modes: MODES,
        };
        let viewer = Viewer::open(setup, SocketAddr::new(self.listen, self.port), self.token_file.as_deref())?;
        let gate = viewer.gate();
        let stop = move || {
            let _held = gate.lock().unwrap_or_else(PoisonError::into_inner);
            movie::abandon();
            // Without exit handlers, as in `render`.
            signal_hook::low_level::exit(i32::from(super::INTERRUPTED));
        };
        ctrlc::set_handler(stop).context("cannot watch for Ctrl-C")?;
        print(&format!("{}\n", viewer.link()))?;
        if !self.running.quiet {
            say("open this link in a browser; Ctrl-C ends it");
            if !self.listen.is_loopback() {
                say("note: others on the network reach it too, and nothing is encrypted: see --listen in the help");
            }
        }
        let alone = self.alone.of(self.overrides.background, false)?;
        let load = || self.running.load(&self.scene, &self.overrides, &alone, &pool);
        viewer.run(|| load().map_err(|why| format!("{why:#}")))
    }
}
