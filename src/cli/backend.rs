//! `--backend` and `--adapter`: the device that renders.

use clap::ValueEnum;
use splatblur::renderer::{Device, Renderer};

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

impl Wanted {
    /// The library's device. `adapter`: part of the name of the one that is wanted.
    pub(super) fn device(self, adapter: Option<&str>) -> anyhow::Result<Device> {
        match (self, adapter) {
            (Self::Cpu, Some(_)) => anyhow::bail!("--adapter is for --backend gpu"),
            (Self::Cpu, None) => Ok(Device::Cpu),
            (Self::Auto, None) => Ok(Device::Auto),
            (Self::Gpu, _) | (Self::Auto, Some(_)) => Ok(Device::Gpu { adapter: adapter.map(str::to_owned) }),
        }
    }
}

/// What a renderer renders on, with the processor's name or the adapter's kind and driver, where the system tells.
/// `threads`: of the CPU.
pub(super) fn in_full(renderer: &Renderer, threads: usize) -> String {
    let place = renderer.describe_with(threads);
    renderer.details().map_or_else(|| place.clone(), |more| format!("{place}: {more}"))
}
