//! The GPU backend: the passes as compute programs (`shaders/`), on any device that wgpu supports.
//!
//! Surfels of a group are cut into batches, and the image into bands, so that every buffer fits. Nothing is read back
//! before the frame is done. Lists are in global surfel order, and one invocation sums the floats of a pixel. So the
//! same frame gives the same bytes on the same device. docs/gpu-passes.md says what is on the device, and who
//! writes it.

pub(super) mod batches;
pub(super) mod bind;
mod bind_groups;
mod buffers;
mod calls;
mod captures;
mod constants;
mod device;
pub(super) mod film;
mod flight;
pub(super) mod form;
pub(super) mod job;
pub(super) mod layout;
pub(super) mod memory;
pub(super) mod models;
pub(super) mod passes;
pub(super) mod pipelines;
pub(super) mod prepared;
pub(super) mod record;
pub(super) mod recorder;
pub(super) mod rounds;
pub(super) mod shadow_sizes;
pub(super) mod shadows;
pub(super) mod slots;
pub(super) mod steps;
#[cfg(test)]
pub(super) mod tests;
mod texts;
pub(super) mod timestamps;
pub(super) mod transparent;
pub(super) mod upload;

use std::collections::VecDeque;
use std::sync::Arc;

use self::bind_groups::BindGroups;
use self::buffers::Buffers;
use self::device::Device;
pub use self::device::{AdapterReport, Choice, adapters};
use self::flight::{Flight, Landing};
use self::layout::VIEWS;
use self::models::Models;
use self::pipelines::Pipelines;
use super::clusters::ClusterStore;
use super::{Backend, BackendError, Rendered};
use crate::frame::Frame;
use crate::stop::Stop;

/// Executes plans on a GPU, or on a software device.
#[derive(Debug)]
pub struct Gpu {
    pub(super) state: DeviceState,
    clusters: ClusterStore,
    /// Submissions that are not read back: the frames that were begun and not finished, in order. `FrameQueue` holds
    /// their numbers and tags, and the frames that need no submission.
    flights: VecDeque<Flight>,
    landings: Vec<Landing>,
    /// Most bytes of a buffer that a program can bind.
    pub(super) most_bytes: u64,
    /// Most slots of a batch. It shrinks when the lists of larger batches do not fit.
    pub(super) most_slots: u64,
    /// The same of surfels at instants. It shrinks when lists are longer than loops.
    pub(super) most_surfel_slots: u64,
    /// Most turns of the loops of an invocation that walks over a list.
    pub(super) most_turns: u64,
    /// Most groups of a round.
    pub(super) most_groups: u64,
    /// Most entries to make room for, even if a program could bind more.
    pub(super) most_entries: u64,
    /// Most entries to make room for before it is known how many there are.
    pub(super) first_entries: u64,
    /// Entries that earlier frames needed.
    wanted_entries: u64,
    /// Ends frames before a rendering.
    stop: Arc<Stop>,
}

/// The device and everything that stays on it between frames.
#[derive(Debug)]
pub(in crate::backend) struct DeviceState {
    pub(super) device: Device,
    pub(super) pipelines: Pipelines,
    groups: BindGroups,
    models: Models,
    pub(super) buffers: Buffers,
}

/// Most turns of the loops of an invocation on a software device. Mesa's llvmpipe silently ends a shader's loops after
/// 65,535 in all. Frames whose lists of surfels at instants take more are rendered again in smaller batches.
const SOFTWARE_TURNS: u64 = 60_000;

impl Gpu {
    /// Opens the best of the adapters that are wanted.
    ///
    /// # Errors
    /// There is none, or it lacks what the passes need.
    pub fn open(choice: &Choice) -> Result<Self, BackendError> {
        Self::on(Device::open(choice)?, Pipelines::default())
    }

    fn on(device: Device, pipelines: Pipelines) -> Result<Self, BackendError> {
        let buffers = Buffers::new(&device)?;
        device.check()?;
        let software = device.adapter.device_type == wgpu::DeviceType::Cpu;
        Ok(Self {
            most_bytes: device.most_bytes(),
            clusters: ClusterStore::default(),
            state: DeviceState { device, pipelines, groups: BindGroups::default(), models: Models::default(), buffers },
            flights: VecDeque::new(),
            landings: Vec::new(),
            most_slots: u64::MAX,
            most_surfel_slots: u64::MAX,
            most_turns: if software { SOFTWARE_TURNS } else { u64::MAX },
            most_groups: u64::from(VIEWS),
            most_entries: u64::MAX,
            first_entries: u64::MAX,
            wanted_entries: 0,
            stop: Arc::default(),
        })
    }

    /// Name of the adapter.
    pub fn adapter(&self) -> &str {
        &self.state.device.adapter.name
    }
}

impl Backend for Gpu {
    fn describe(&self) -> String {
        format!("gpu ({})", self.adapter())
    }

    fn in_flight(&self) -> usize {
        2
    }

    fn begin(&mut self, frame: Frame) -> Result<(), BackendError> {
        if self.stop.is_set() {
            return Err(BackendError::Stopped);
        }
        let flight = self.depart(frame)?;
        self.flights.push_back(flight);
        Ok(())
    }

    fn finish(&mut self) -> Result<Option<Rendered>, BackendError> {
        self.flights.pop_front().map(|flight| self.land(flight)).transpose()
    }

    fn heed(&mut self, stop: Arc<Stop>) {
        self.stop = stop;
    }

    fn stop(&self) -> Arc<Stop> {
        Arc::clone(&self.stop)
    }

    fn abandon(&mut self) {
        self.flights.pop_back();
    }
}
