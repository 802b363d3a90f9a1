//! `--backend` and `--adapter`: the device that renders.

use clap::ValueEnum;
use splatblur::backend::Backend;
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

/// The device that renders, open.
pub(super) struct Machine {
    renderer: Renderer,
    /// `cpu` or `gpu`. Files carry it: the two differ by rounding. They do not carry the device's name, so that
    /// computers that share a sequence need not be the same.
    pub(super) name: &'static str,
    /// What it is, for people.
    pub(super) place: String,
}

impl Machine {
    /// Opens the device. `threads`: of the CPU.
    pub(super) fn open(wanted: Wanted, adapter: Option<&str>, threads: usize) -> anyhow::Result<Self> {
        let renderer = Renderer::open(wanted.device(adapter)?)?;
        Ok(Self { name: renderer.backend_name(), place: renderer.describe_with(threads), renderer })
    }

    pub(super) fn backend(&mut self) -> &mut dyn Backend {
        self.renderer.backend()
    }

    /// What it is, with the processor's name or the adapter's kind and driver, where the system tells.
    pub(super) fn in_full(&self) -> String {
        self.renderer.details().map_or_else(|| self.place.clone(), |more| format!("{}: {more}", self.place))
    }
}
