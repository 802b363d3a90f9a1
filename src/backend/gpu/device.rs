//! The device: how it is chosen, and its limits.

use std::fmt;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use wgpu::{
    Adapter, AdapterInfo, Backends, CommandEncoder, DeviceType, Instance, InstanceDescriptor, InstanceFlags, Limits,
    SubmissionIndex,
};

use super::calls::Calls;
use super::form::{Form, Lanes};
use super::layout::VIEW_BYTES;
use crate::backend::BackendError;

/// Which adapters are wanted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Choice {
    /// Part of the adapter's name. Upper and lower case are the same.
    pub name: Option<String>,
    /// Leave out adapters that run on the processor.
    pub hardware_only: bool,
}

/// A description of an adapter, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterReport {
    /// Its name.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub kind: &'static str,
    /// Programming interface, as in `vulkan`.
    pub interface: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Largest buffer, bytes.
    pub buffer_bytes: u64,
    /// Largest part of a buffer that a program can bind, bytes.
    pub binding_bytes: u64,
    /// Number of storage buffers that a program can bind.
    pub storage_buffers: u32,
    /// Number of workgroups of a dispatch along one axis.
    pub workgroups: u32,
    /// True if it measures the time of passes.
    pub timestamps: bool,
}

/// Most storage buffers that a program binds.
const STORAGE_BUFFERS: u32 = 8;

/// A device and its queue, as the passes use it.
#[derive(Clone)]
pub(in crate::backend) struct Device {
    pub adapter: AdapterInfo,
    pub limits: Limits,
    pub timestamps: bool,
    /// What some programs are written for.
    pub form: Form,
    pub handle: wgpu::Device,
    queue: wgpu::Queue,
    pub calls: Arc<Calls>,
    /// The first error that no scope caught.
    failure: Arc<Mutex<Option<String>>>,
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Device").field("adapter", &self.adapter.name).finish_non_exhaustive()
    }
}

/// All adapters of this computer.
pub fn adapters() -> Vec<AdapterReport> {
    all().iter().map(report).collect()
}

/// Numbers of indirect dispatches are not checked: another dispatch and two barriers would do it, before each of them.
/// Pass `bin` keeps them within the limits of all devices (`bin_scan` in bin.wgsl, and `Schedule::most_entries`), and
/// so does the host for captures: their Gaussians are in one buffer that a program binds.
pub(in crate::backend) const UNCHECKED: InstanceFlags = InstanceFlags::VALIDATION_INDIRECT_CALL;

fn all() -> Vec<Adapter> {
    /// One for the whole program, and never dropped: NVIDIA's driver crashes where several threads make one, or drop
    /// one (<https://github.com/gfx-rs/wgpu/issues/5930>).
    static INSTANCE: OnceLock<Instance> = OnceLock::new();
    let instance = INSTANCE.get_or_init(|| {
        let mut descriptor = InstanceDescriptor::new_without_display_handle_from_env();
        descriptor.flags -= UNCHECKED;
        Instance::new(descriptor)
    });
    // The one that does nothing is for tests.
    pollster::block_on(instance.enumerate_adapters(Backends::all() - Backends::NOOP))
}

fn report(adapter: &Adapter) -> AdapterReport {
    let (info, limits) = (adapter.get_info(), adapter.limits());
    AdapterReport {
        name: info.name,
        kind: match info.device_type {
            DeviceType::DiscreteGpu => "discrete",
            DeviceType::IntegratedGpu => "integrated",
            DeviceType::VirtualGpu => "virtual",
            DeviceType::Cpu => "software",
            DeviceType::Other => "other",
        },
        interface: info.backend.to_string(),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        buffer_bytes: limits.max_buffer_size,
        binding_bytes: limits.max_storage_buffer_binding_size,
        storage_buffers: limits.max_storage_buffers_per_shader_stage,
        workgroups: limits.max_compute_workgroups_per_dimension,
        timestamps: adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY),
    }
}

/// False if there can be no hardware GPU. On Linux each GPU has a device node. Looking for nodes does not wake the
/// Vulkan loader and its software drivers, which take time, and print lines on a computer without a display.
fn has_device_node() -> bool {
    const NODES: [&str; 6] =
        ["/dev/dri", "/dev/nvidiactl", "/dev/dxg", "/dev/kgsl-3d0", "/dev/mali0", "/dev/nvhost-ctrl"];
    !cfg!(target_os = "linux") || NODES.iter().any(|node| std::path::Path::new(node).exists())
}

/// The best of the adapters that are wanted: discrete before integrated before virtual before software; Vulkan before
/// Metal and Direct3D.
fn choose(choice: &Choice) -> Result<Adapter, BackendError> {
    let mut found = if choice.hardware_only && !has_device_node() { Vec::new() } else { all() };
    let names = found.iter().map(|adapter| adapter.get_info().name).collect::<Vec<_>>();
    if let Some(name) = &choice.name {
        found.retain(|adapter| adapter.get_info().name.to_lowercase().contains(&name.to_lowercase()));
    }
    if choice.hardware_only {
        found.retain(|adapter| adapter.get_info().device_type != DeviceType::Cpu);
    }
    let rank = |adapter: &Adapter| {
        let info = adapter.get_info();
        let kind = match info.device_type {
            DeviceType::DiscreteGpu => 0,
            DeviceType::IntegratedGpu => 1,
            DeviceType::VirtualGpu => 2,
            DeviceType::Other => 3,
            DeviceType::Cpu => 4,
        };
        // A computer may offer the same GPU by several interfaces.
        (kind, info.backend != wgpu::Backend::Vulkan)
    };
    found.into_iter().min_by_key(rank).ok_or_else(|| {
        let found = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        let wanted = choice.name.as_ref().map_or_else(String::new, |name| format!(" whose name holds `{name}`"));
        BackendError::NoAdapter { wanted, found }
    })
}

impl Device {
    pub(in crate::backend) fn open(choice: &Choice) -> Result<Self, BackendError> {
        let adapter = choose(choice)?;
        let info = adapter.get_info();
        Self::of(&adapter, info)
    }

    /// Opens an adapter, which is taken for what `info` says.
    pub(in crate::backend) fn of(adapter: &Adapter, info: AdapterInfo) -> Result<Self, BackendError> {
        let limits = adapter.limits();
        let (buffers, bytes) = (limits.max_storage_buffers_per_shader_stage, limits.max_uniform_buffer_binding_size);
        let lacks = if buffers < STORAGE_BUFFERS {
            Some(format!("a program needs {STORAGE_BUFFERS} storage buffers, but the device has {buffers}"))
        } else if bytes < VIEW_BYTES {
            Some(format!("a program needs uniforms of {VIEW_BYTES} bytes, but the device binds {bytes}"))
        } else {
            None
        };
        if let Some(what) = lacks {
            return Err(BackendError::Device { adapter: info.name, what });
        }
        let has = |feature| adapter.features() & feature;
        let (timestamps, subgroups) = (has(wgpu::Features::TIMESTAMP_QUERY), has(wgpu::Features::SUBGROUP));
        let description = wgpu::DeviceDescriptor {
            label: Some("splatblur"),
            required_features: timestamps | subgroups,
            required_limits: limits.clone(),
            ..Default::default()
        };
        let opened = pollster::block_on(adapter.request_device(&description));
        let (handle, queue) =
            opened.map_err(|e| BackendError::Device { adapter: info.name.clone(), what: e.to_string() })?;
        let failure = Arc::new(Mutex::new(None));
        let seen = Arc::clone(&failure);
        handle.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            seen.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| error.to_string());
        }));
        let lanes = if info.device_type == DeviceType::Cpu { Lanes::Quads } else { Lanes::Pixels };
        Ok(Self {
            adapter: info,
            limits,
            timestamps: !timestamps.is_empty(),
            form: Form { lanes, subgroups: !subgroups.is_empty() },
            handle,
            queue,
            calls: Arc::default(),
            failure,
        })
    }

    /// An error of this device.
    pub(in crate::backend) fn error(&self, what: impl Into<String>) -> BackendError {
        BackendError::Device { adapter: self.adapter.name.clone(), what: what.into() }
    }

    /// The first error since the last call, if there was one.
    pub(in crate::backend) fn check(&self) -> Result<(), BackendError> {
        match self.failure.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(what) => Err(self.error(what)),
            None => Ok(()),
        }
    }

    /// Bytes of the largest buffer that a program can bind as a whole, a multiple of 1024. Metal may allow more than
    /// programs can count.
    pub(in crate::backend) fn most_bytes(&self) -> u64 {
        let limits = &self.limits;
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(i32::MAX as u64) & !1023
    }

    /// A buffer of at least `bytes` bytes. It is an error if the device has no room for it.
    pub(in crate::backend) fn buffer(
        &self,
        label: &str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, BackendError> {
        let size = bytes.next_multiple_of(16).max(16);
        if size > self.limits.max_buffer_size {
            return Err(self.error(format!(
                "{label} need a buffer of {size} bytes, but the device's largest is {}",
                self.limits.max_buffer_size
            )));
        }
        let memory = self.handle.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        let buffer = self.handle.create_buffer(&descriptor);
        match pollster::block_on(memory.pop()) {
            None => Ok(buffer),
            Some(_) => Err(self.error(format!("{label} need {size} bytes, which the device's memory has not left"))),
        }
    }

    /// Submits what was recorded, after all writes so far.
    pub(in crate::backend) fn submit(&self, recorded: impl IntoIterator<Item = CommandEncoder>) -> SubmissionIndex {
        self.calls.submit();
        self.queue.submit(recorded.into_iter().map(CommandEncoder::finish))
    }

    /// Writes to a buffer, before what is submitted next.
    pub(in crate::backend) fn write(&self, buffer: &wgpu::Buffer, at: u64, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        self.calls.write(bytes.len() as u64);
        self.queue.write_buffer(buffer, at, bytes);
    }

    /// Makes a bind group.
    pub(in crate::backend) fn bind(&self, descriptor: &wgpu::BindGroupDescriptor<'_>) -> wgpu::BindGroup {
        self.calls.bind();
        self.handle.create_bind_group(descriptor)
    }

    /// Asks for the content of a buffer, which is there after a wait. `copied`: bytes that were copied to it.
    pub(in crate::backend) fn map(&self, buffer: &wgpu::Buffer, copied: u64) {
        self.calls.map(copied);
        buffer.map_async(wgpu::MapMode::Read, .., |_| ());
    }

    /// Nanoseconds of a tick of its clock.
    pub(in crate::backend) fn tick(&self) -> f64 {
        f64::from(self.queue.get_timestamp_period())
    }

    /// Waits until a submission is done. `others_follow`: the device has other work meanwhile, so that nothing is lost.
    pub(in crate::backend) fn wait_until(
        &self,
        done: SubmissionIndex,
        others_follow: bool,
    ) -> Result<(), BackendError> {
        if !others_follow {
            self.calls.wait();
        }
        self.wait_for(Some(done))
    }

    /// Waits until everything that was submitted is done.
    pub(in crate::backend) fn wait(&self) -> Result<(), BackendError> {
        self.calls.wait();
        self.wait_for(None)
    }

    /// Waits until a submission is done; `None`: until all are.
    fn wait_for(&self, submission_index: Option<SubmissionIndex>) -> Result<(), BackendError> {
        let wait = wgpu::PollType::Wait { submission_index, timeout: None };
        self.handle.poll(wait).map_err(|e| self.error(e.to_string()))?;
        self.check()
    }
}
