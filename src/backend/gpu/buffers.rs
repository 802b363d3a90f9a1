//! The buffers that passes exchange. They grow when a frame needs more, and stay between frames.

use std::collections::HashMap;
use std::ops::Index;
use std::sync::{Arc, Weak};

use wgpu::Buffer;

use super::device::Device;
use super::layout::{DIGIT_BITS, WORKGROUP_ITEMS};
use super::memory::Schedule;
use super::slots::{SLOTS, Slot};
use crate::backend::BackendError;
use crate::environment::{Cube, Surroundings};

/// A buffer for each slot of [`SLOTS`].
#[derive(Debug)]
pub(in crate::backend) struct Buffers {
    all: HashMap<Slot, Buffer>,
    /// The map that the environment was made of.
    environment_of: Weak<Cube>,
    /// Number of entries that there is room for.
    pub entries: u64,
}

impl Index<Slot> for Buffers {
    type Output = Buffer;

    fn index(&self, slot: Slot) -> &Buffer {
        &self.all[&slot]
    }
}

impl Buffers {
    pub(in crate::backend) fn new(device: &Device) -> Result<Self, BackendError> {
        let new =
            |(slot, label, least): (Slot, &str, u64)| device.buffer(label, least, slot.usage()).map(|new| (slot, new));
        let all = SLOTS.into_iter().map(new).collect::<Result<_, _>>()?;
        Ok(Self { all, environment_of: Weak::new(), entries: 0 })
    }

    /// Makes room for `bytes` bytes in a slot. If it had less, its content is lost.
    pub(in crate::backend) fn grow(&mut self, device: &Device, slot: Slot, bytes: u64) -> Result<(), BackendError> {
        let label = SLOTS.iter().find(|row| row.0 == slot).map_or("", |row| row.1);
        self.all.get_mut(&slot).map_or(Ok(()), |buffer| grow(device, buffer, label, bytes))
    }

    /// Makes room for a frame.
    pub(in crate::backend) fn fit(&mut self, device: &Device, schedule: &Schedule) -> Result<(), BackendError> {
        SLOTS.iter().try_for_each(|&(slot, ..)| self.grow(device, slot, schedule.bytes(slot)))
    }

    /// Uploads what surfaces mirror, unless it is there.
    pub(in crate::backend) fn fit_environment(
        &mut self,
        device: &Device,
        surroundings: Option<&Surroundings>,
    ) -> Result<(), BackendError> {
        let Some(Surroundings { cube, .. }) = surroundings else { return Ok(()) };
        // The weak pointer keeps the address from being used again.
        if self.environment_of.as_ptr() != Arc::as_ptr(cube) {
            let bytes: &[u8] = bytemuck::cast_slice(cube.texels());
            self.grow(device, Slot::Environment, bytes.len() as u64)?;
            device.write(&self[Slot::Environment], 0, bytes);
            self.environment_of = Arc::downgrade(cube);
        }
        Ok(())
    }

    /// Bytes of all buffers that grow with a frame's pixels, slots and entries.
    #[cfg(test)]
    pub(in crate::backend) fn bytes(&self) -> u64 {
        use Slot::{
            CaptureSegments, DigitTotals, Environment, Lights, Moments, Segments, Status, Tables, Totals, Views, Wanted,
        };
        let uploads = [Views, Tables, Segments, CaptureSegments, Lights, Moments, Environment, Wanted];
        let grows = |slot: &Slot| !uploads.contains(slot) && ![Totals, Status, DigitTotals].contains(slot);
        self.all.iter().filter(|(slot, _)| grows(slot)).map(|(_, buffer)| buffer.size()).sum()
    }

    /// Makes room for `entries` entries.
    pub(in crate::backend) fn fit_entries(&mut self, device: &Device, entries: u64) -> Result<(), BackendError> {
        if entries <= self.entries {
            return Ok(());
        }
        for slot in [Slot::Keys, Slot::List, Slot::SortedKeys, Slot::SortedList] {
            self.grow(device, slot, 4 * entries)?;
        }
        let groups = entries.div_ceil(u64::from(WORKGROUP_ITEMS));
        self.grow(device, Slot::Histogram, 4 * (groups << DIGIT_BITS))?;
        self.entries = entries;
        Ok(())
    }
}

/// Replaces `buffer` by a larger one, if it has less than `bytes` bytes. Its content is lost.
pub(in crate::backend) fn grow(
    device: &Device,
    buffer: &mut Buffer,
    label: &str,
    bytes: u64,
) -> Result<(), BackendError> {
    if buffer.size() < bytes {
        let usage = buffer.usage();
        // The old memory must be free before the new memory is taken.
        buffer.destroy();
        *buffer = device.buffer(label, bytes, usage)?;
    }
    Ok(())
}
