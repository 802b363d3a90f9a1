//! Models on the device. They are uploaded when a frame first names them, and stay while the scene holds them.

use std::ops::Range;
use std::sync::{Arc, Weak};

use wgpu::{Buffer, BufferUsages};

use super::device::Device;
use crate::backend::BackendError;
use crate::model::Surfels;

/// Most surfels of a surfel buffer. One dispatch covers them along one axis.
const MOST_SURFELS: u64 = 1 << 22;

/// The models that were uploaded.
#[derive(Debug, Default)]
pub(in crate::backend) struct Models {
    models: Vec<Model>,
}

#[derive(Debug)]
struct Model {
    /// Holds the address, so that no other model can get it, but not the surfels.
    surfels: Weak<Surfels>,
    /// Whether the buffers have the normalisation of kernels.
    normalised: bool,
    buffers: Vec<SurfelBuffer>,
}

/// Some surfels of a model, in buffers that a program can bind as a whole.
#[derive(Clone, Debug)]
pub(in crate::backend) struct SurfelBuffer {
    /// Which surfels of the model.
    pub surfels: Range<usize>,
    /// Columns: positions, axes u, axes v; then the normalisation of kernels and its mean, where a frame needed them.
    pub geometry: Buffer,
    /// Columns: normals, colours, then materials where the model has them.
    pub looks: Buffer,
}

impl Models {
    /// The buffers of `surfels`, with the normalisation of kernels if `normalised`. They are uploaded if they are not
    /// on the device yet.
    pub(in crate::backend) fn surfel_buffers(
        &mut self,
        device: &Device,
        surfels: &Arc<Surfels>,
        normalised: bool,
    ) -> Result<Vec<SurfelBuffer>, BackendError> {
        let lacks = |model: &Model| normalised && !model.normalised && model.surfels.as_ptr() == Arc::as_ptr(surfels);
        self.models.retain(|model| model.surfels.strong_count() > 0 && !lacks(model));
        if let Some(model) = self.models.iter().find(|model| model.surfels.as_ptr() == Arc::as_ptr(surfels)) {
            return Ok(model.buffers.clone());
        }
        let buffers = upload(device, surfels, normalised)?;
        self.models.push(Model { surfels: Arc::downgrade(surfels), normalised, buffers: buffers.clone() });
        Ok(buffers)
    }
}

fn upload(device: &Device, surfels: &Surfels, normalised: bool) -> Result<Vec<SurfelBuffer>, BackendError> {
    let factors = if normalised { surfels.normalisation() } else { &[] };
    let mean: Vec<f32> = normalised.then(|| surfels.mean_normalisation()).into_iter().collect();
    // At most 40 bytes of geometry, at most 40 of looks.
    let most = (device.most_bytes() / 40).clamp(1, MOST_SURFELS) as usize;
    let mut buffers = Vec::new();
    for start in (0..surfels.len()).step_by(most) {
        let range = start..(start + most).min(surfels.len());
        let geometry = [
            bytemuck::cast_slice(&surfels.position[range.clone()]),
            bytemuck::cast_slice(&surfels.axis_u[range.clone()]),
            bytemuck::cast_slice(&surfels.axis_v[range.clone()]),
            bytemuck::cast_slice(factors.get(range.clone()).unwrap_or_default()),
            bytemuck::cast_slice(&mean),
        ];
        let materials: Vec<[f32; 4]> = surfels
            .material
            .get(range.clone())
            .unwrap_or_default()
            .iter()
            .map(|m| [m.ambient, m.diffuse, m.specular, m.shininess])
            .collect();
        let looks = [
            bytemuck::cast_slice(&surfels.normal[range.clone()]),
            bytemuck::cast_slice(&surfels.colour[range.clone()]),
            bytemuck::cast_slice(&materials),
        ];
        buffers.push(SurfelBuffer {
            surfels: range,
            geometry: columns(device, "surfels", &geometry)?,
            looks: columns(device, "surfels", &looks)?,
        });
        // Uploads under way take memory too, so surfel buffers go one at a time.
        device.queue.submit([]);
        device.wait()?;
    }
    Ok(buffers)
}

/// A buffer of columns, one after the other.
fn columns(device: &Device, label: &str, columns: &[&[u8]]) -> Result<Buffer, BackendError> {
    let bytes: usize = columns.iter().map(|column| column.len()).sum();
    let buffer = device.buffer(label, bytes as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST)?;
    let mut at = 0;
    for column in columns {
        device.queue.write_buffer(&buffer, at, column);
        at += column.len() as u64;
    }
    Ok(buffer)
}
