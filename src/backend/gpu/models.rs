//! Models on the device: surfels and the Gaussians of captures. They are uploaded when a frame first names them, and
//! stay while the scene holds them.

use std::ops::Range;
use std::sync::{Arc, Weak};

use glam::{Quat, Vec3};
use wgpu::{Buffer, BufferUsages};

use super::device::Device;
use crate::backend::BackendError;
use crate::model::paths::OwnPaths;
use crate::model::{Gaussians, Surfels};
use crate::scene::SurfelModel;

/// Most surfels of a surfel buffer.
const MOST_SURFELS: u64 = 1 << 22;

/// Bytes of uploads that may be under way together: they take memory beside the buffers.
const UNDER_WAY: u64 = 64 << 20;

/// The models that were uploaded.
#[derive(Debug, Default)]
pub(in crate::backend) struct Models {
    surfels: Vec<Model>,
    captures: Vec<CaptureBuffers>,
    under_way: UnderWay,
}

/// Bytes that were uploaded since the host last waited for the device.
#[derive(Debug, Default)]
struct UnderWay(u64);

#[derive(Debug)]
struct CaptureBuffers {
    /// As in [`Model`].
    gaussians: Weak<Gaussians>,
    buffers: Vec<ModelBuffer>,
}

#[derive(Debug)]
struct Model {
    /// Holds the address, so that no other model can get it, but not the surfels.
    surfels: Weak<Surfels>,
    /// The same of paths that are not the surfels' own.
    own_paths: Option<Weak<OwnPaths>>,
    /// Whether the buffers have the normalisation of kernels.
    normalised: bool,
    buffers: Vec<ModelBuffer>,
}

/// Some surfels or Gaussians of a model, in buffers that a program can bind as a whole.
#[derive(Clone, Debug)]
pub(in crate::backend) struct ModelBuffer {
    /// Which of the model.
    pub surfels: Range<usize>,
    /// Columns of surfels: positions, axes u, axes v, those of the paths; then the normalisation of kernels and its
    /// mean, where a frame needed them. Columns of Gaussians: positions, standard deviations, rotations, opacities.
    pub geometry: Buffer,
    /// Columns of surfels: normals, colours, then materials and opacities where the model has them. Columns of
    /// Gaussians: colours, harmonics, then normals where they have them.
    pub looks: Buffer,
}

impl UnderWay {
    /// Takes note of a buffer that was uploaded, and waits for the device where too much is under way.
    fn add(&mut self, device: &Device, uploaded: Option<&ModelBuffer>) -> Result<(), BackendError> {
        self.0 += uploaded.map_or(0, |buffer| buffer.geometry.size() + buffer.looks.size());
        if self.0 > UNDER_WAY {
            device.submit([]);
            device.wait()?;
            self.0 = 0;
        }
        Ok(())
    }
}

impl Models {
    /// Lets go of the buffers of models that nobody holds any more. True if there were some.
    pub(in crate::backend) fn free(&mut self) -> bool {
        let before = self.surfels.len() + self.captures.len();
        let holds_paths = |model: &Model| model.own_paths.as_ref().is_none_or(|own| own.strong_count() > 0);
        self.surfels.retain(|model| holds_paths(model) && model.surfels.strong_count() > 0);
        self.captures.retain(|capture| capture.gaussians.strong_count() > 0);
        self.surfels.len() + self.captures.len() < before
    }

    /// The buffers of surfels and their paths, with the normalisation of kernels if `normalised`. They are uploaded if
    /// they are not on the device yet.
    pub(in crate::backend) fn surfel_buffers(
        &mut self,
        device: &Device,
        of: &SurfelModel,
        normalised: bool,
    ) -> Result<Vec<ModelBuffer>, BackendError> {
        let is_of = |model: &Model| {
            let own = model.own_paths.as_ref().map(Weak::as_ptr);
            model.surfels.as_ptr() == Arc::as_ptr(of.surfels()) && own == of.own_paths().map(Arc::as_ptr)
        };
        self.surfels.retain(|model| !(normalised && !model.normalised && is_of(model)));
        if let Some(model) = self.surfels.iter().find(|model| is_of(model)) {
            return Ok(model.buffers.clone());
        }
        let buffers = upload(device, &mut self.under_way, of, normalised)?;
        self.surfels.push(Model {
            surfels: Arc::downgrade(of.surfels()),
            own_paths: of.own_paths().map(Arc::downgrade),
            normalised,
            buffers: buffers.clone(),
        });
        Ok(buffers)
    }

    /// The buffers of `gaussians`. They are uploaded if they are not on the device yet.
    pub(in crate::backend) fn gaussian_buffers(
        &mut self,
        device: &Device,
        gaussians: &Arc<Gaussians>,
    ) -> Result<Vec<ModelBuffer>, BackendError> {
        let same = |capture: &&CaptureBuffers| capture.gaussians.as_ptr() == Arc::as_ptr(gaussians);
        if let Some(capture) = self.captures.iter().find(same) {
            return Ok(capture.buffers.clone());
        }
        let buffers = upload_gaussians(device, &mut self.under_way, gaussians)?;
        self.captures.push(CaptureBuffers { gaussians: Arc::downgrade(gaussians), buffers: buffers.clone() });
        Ok(buffers)
    }
}

fn upload(
    device: &Device,
    under_way: &mut UnderWay,
    model: &SurfelModel,
    normalised: bool,
) -> Result<Vec<ModelBuffer>, BackendError> {
    let (surfels, paths) = (model.surfels(), model.paths());
    let factors = if normalised { surfels.normalisation() } else { &[] };
    let mean: Vec<f32> = normalised.then(|| surfels.mean_normalisation()).into_iter().collect();
    // At most 76 bytes of geometry, at most 44 of looks.
    let most = (device.most_bytes() / 76).clamp(1, MOST_SURFELS) as usize;
    let mut buffers = Vec::new();
    for start in (0..surfels.len()).step_by(most) {
        let range = start..(start + most).min(surfels.len());
        let zeros = vec![Vec3::ZERO; if paths.is_empty() { 0 } else { range.len() }];
        let rates = paths.columns[..paths.order()].iter().map(|column| column.get(range.clone()).unwrap_or(&zeros));
        let columns_of_geometry: Vec<&[u8]> =
            [&surfels.position[range.clone()], &surfels.axis_u[range.clone()], &surfels.axis_v[range.clone()]]
                .into_iter()
                .chain(rates)
                .map(bytemuck::cast_slice)
                .chain([factors.get(range.clone()).unwrap_or_default(), &mean].map(bytemuck::cast_slice))
                .collect();
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
            bytemuck::cast_slice(surfels.opacity.get(range.clone()).unwrap_or_default()),
        ];
        buffers.push(ModelBuffer {
            surfels: range,
            geometry: columns(device, "surfels", &columns_of_geometry)?,
            looks: columns(device, "surfels", &looks)?,
        });
        under_way.add(device, buffers.last())?;
    }
    Ok(buffers)
}

fn upload_gaussians(
    device: &Device,
    under_way: &mut UnderWay,
    gaussians: &Gaussians,
) -> Result<Vec<ModelBuffer>, BackendError> {
    let each = gaussians.harmonics_each();
    // 44 bytes of geometry; colour, harmonics and normal of looks.
    let widest = (24 + 12 * each as u64).max(44);
    let most = (device.most_bytes() / widest).clamp(1, MOST_SURFELS) as usize;
    let mut buffers = Vec::new();
    for start in (0..gaussians.len()).step_by(most) {
        let range = start..(start + most).min(gaussians.len());
        let turns: Vec<[f32; 4]> = gaussians.rotation[range.clone()].iter().map(Quat::to_array).collect();
        let colours: Vec<_> = range.clone().map(|index| gaussians.colour(index)).collect();
        let geometry = [
            bytemuck::cast_slice(&gaussians.position[range.clone()]),
            bytemuck::cast_slice(&gaussians.sigma[range.clone()]),
            bytemuck::cast_slice(&turns),
            bytemuck::cast_slice(&gaussians.opacity[range.clone()]),
        ];
        let harmonics = &gaussians.harmonics[range.start * each..range.end * each];
        let normals = gaussians.normal.get(range.clone()).unwrap_or_default();
        let looks = [bytemuck::cast_slice(&colours), bytemuck::cast_slice(harmonics), bytemuck::cast_slice(normals)];
        buffers.push(ModelBuffer {
            surfels: range,
            geometry: columns(device, "captures", &geometry)?,
            looks: columns(device, "captures", &looks)?,
        });
        under_way.add(device, buffers.last())?;
    }
    Ok(buffers)
}

/// A buffer of columns, one after the other.
fn columns(device: &Device, label: &str, columns: &[&[u8]]) -> Result<Buffer, BackendError> {
    let bytes = columns.iter().map(|column| column.len() as u64).sum();
    let buffer = device.buffer(label, bytes, BufferUsages::STORAGE | BufferUsages::COPY_DST)?;
    if bytes > UNDER_WAY {
        // A copy of all would take much memory.
        let mut at = 0;
        for column in columns {
            device.write(&buffer, at, column);
            at += column.len() as u64;
        }
    } else {
        device.write(&buffer, 0, &columns.concat());
    }
    Ok(buffer)
}
