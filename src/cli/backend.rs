//! `--backend` and `--adapter`: the device that renders.

use clap::{Args, ValueEnum};
use splatblur::renderer::{Device, Renderer};

/// Where pictures are rendered.
#[derive(Debug, Args)]
pub(super) struct BackendArgs {
    /// Backend to render on.
    #[arg(long, value_enum, default_value_t, help_heading = "Running")]
    pub(super) backend: Wanted,
    /// Part of the name of the adapter to render on (`splatblur info --adapters` lists them).
    #[arg(long, value_name = "NAME", help_heading = "Running")]
    adapter: Option<String>,
}

impl BackendArgs {
    /// The library's device.
    pub(super) fn device(&self) -> anyhow::Result<Device> {
        self.device_of(self.backend)
    }

    /// The same with another backend.
    pub(super) fn device_of(&self, backend: Wanted) -> anyhow::Result<Device> {
        match (backend, &self.adapter) {
            (Wanted::Cpu, Some(_)) => anyhow::bail!("--adapter is for --backend gpu"),
            (Wanted::Cpu, None) => Ok(Device::Cpu),
            (Wanted::Auto, None) => Ok(Device::Auto),
            (Wanted::Gpu, adapter) | (Wanted::Auto, adapter @ Some(_)) => Ok(Device::Gpu { adapter: adapter.clone() }),
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Wanted {
    /// A hardware GPU if there is one, else the processor.
    #[default]
    Auto,
    /// A GPU; where there is none, a software device.
    Gpu,
    /// The processor, all cores.
    Cpu,
}

/// What a renderer renders on, with the processor's name or the adapter's kind and driver, where the system tells.
/// `threads`: of the CPU.
pub(super) fn in_full(renderer: &Renderer, threads: usize) -> String {
    let place = renderer.describe_with(threads);
    renderer.details().map_or_else(|| place.clone(), |more| format!("{place}: {more}"))
}
