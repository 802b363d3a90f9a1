//! `--backend` and `--adapter`: which machine renders.

use clap::ValueEnum;
use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;

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

/// The machine that renders.
pub(super) struct Machine {
    pub(super) backend: Box<dyn Backend>,
    /// `cpu` or `gpu`. Files carry it: the two differ by rounding. They do not carry the device's name, so that machines that
    /// share a sequence need not be the same.
    pub(super) name: &'static str,
    /// What it is, for people.
    pub(super) place: String,
}

impl Machine {
    /// The one that is to render. `adapter`: part of the name of the one that is wanted. `threads`: of the CPU.
    pub(super) fn open(wanted: Wanted, adapter: Option<&str>, threads: usize) -> anyhow::Result<Self> {
        match (wanted, adapter) {
            (Wanted::Cpu, Some(_)) => anyhow::bail!("--adapter is for --backend gpu"),
            (Wanted::Cpu, None) => Ok(Self::cpu(threads, "")),
            (Wanted::Auto, None) => Ok(Self::best(threads)),
            (Wanted::Gpu, _) | (Wanted::Auto, Some(_)) => Self::gpu(adapter),
        }
    }

    /// What it is, with the processor's name or the adapter's kind and driver, where the system tells.
    pub(super) fn in_full(&self) -> String {
        let more = if self.name == "cpu" { processor() } else { driver(&self.place) };
        more.map_or_else(|| self.place.clone(), |more| format!("{}: {more}", self.place))
    }

    fn cpu(threads: usize, why: &str) -> Self {
        let end = if threads == 1 { "" } else { "s" };
        let place = format!("the CPU ({threads} thread{end}{why})");
        Self { backend: Box::new(Cpu::default()), name: "cpu", place }
    }

    #[cfg(feature = "gpu")]
    fn gpu(adapter: Option<&str>) -> anyhow::Result<Self> {
        use splatblur::backend::gpu::{Choice, Gpu};
        let gpu = Gpu::open(&Choice { name: adapter.map(str::to_owned), hardware_only: false })?;
        Ok(Self::on(gpu))
    }

    #[cfg(feature = "gpu")]
    fn best(threads: usize) -> Self {
        use splatblur::backend::BackendError;
        use splatblur::backend::gpu::{Choice, Gpu};
        match Gpu::open(&Choice { name: None, hardware_only: true }) {
            Ok(gpu) => Self::on(gpu),
            Err(BackendError::NoAdapter { .. }) => Self::cpu(threads, "; there is no hardware GPU"),
            Err(why) => Self::cpu(threads, &format!("; the GPU cannot be used: {why}")),
        }
    }

    #[cfg(feature = "gpu")]
    fn on(gpu: splatblur::backend::gpu::Gpu) -> Self {
        let place = format!("the GPU {}", gpu.adapter());
        Self { backend: Box::new(gpu), name: "gpu", place }
    }

    #[cfg(not(feature = "gpu"))]
    fn gpu(_adapter: Option<&str>) -> anyhow::Result<Self> {
        anyhow::bail!("this program was built without its GPU backend (cargo feature `gpu`); use --backend cpu")
    }

    #[cfg(not(feature = "gpu"))]
    fn best(threads: usize) -> Self {
        Self::cpu(threads, "")
    }
}

/// The processor's name, where Linux tells.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Kind, interface and driver of the adapter that `place` ends in.
#[cfg(feature = "gpu")]
fn driver(place: &str) -> Option<String> {
    let adapter = splatblur::backend::gpu::adapters().into_iter().find(|a| place.ends_with(&a.name))?;
    Some(format!("{}, {}, driver {}", adapter.kind, adapter.interface, adapter.driver))
}

#[cfg(not(feature = "gpu"))]
fn driver(_place: &str) -> Option<String> {
    None
}
