//! Models on the device: surfels and the Gaussians of captures. They are uploaded when a frame first names them, and
//! stay while the scene holds them. A cut of detail is another model in each frame, of about the same size: it takes
//! the room of one that is gone, so that bind groups stay.

use std::ops::Range;
use std::sync::{Arc, Weak};

use glam::{Quat, Vec3};
use wgpu::{Buffer, BufferBinding, BufferSize, BufferUsages};

use super::device::Device;
use super::layout::stepped;
use crate::backend::BackendError;
use crate::model::paths::OwnPaths;
use crate::model::{Gaussians, Surfels};
use crate::scene::SurfelModel;

/// Most surfels of a surfel buffer.
const MOST_SURFELS: u64 = 1 << 22;

/// Bytes of uploads that may be under way together: they take memory beside the buffers.
const UNDER_WAY: u64 = 64 << 20;

/// Renderings for which the room of a model that is gone is kept. A few of them are under way, each with cuts of its
/// own.
const KEPT: u64 = 16;
/// Most bytes of a room that another model takes over, and of all rooms that wait for one.
const MOST_KEPT: u64 = 64 << 20;
/// A model does not take a room of more than so many times its bytes.
const MOST_WASTE: u64 = 2;
/// Parts of a room are multiples of this, bytes.
const STEP: u64 = 256;

/// The models that were uploaded.
#[derive(Debug, Default)]
pub(in crate::backend) struct Models {
    surfels: Vec<Model>,
    captures: Vec<CaptureBuffers>,
    rooms: Rooms,
}

/// Where models go.
#[derive(Debug, Default)]
struct Rooms {
    /// Those that no model has any more, and the rendering that found them so; the latest last.
    spare: Vec<(Room, u64)>,
    /// Renderings so far.
    renderings: u64,
    under_way: UnderWay,
}

/// A buffer of two parts.
#[derive(Clone, Debug)]
struct Room {
    buffer: Buffer,
    /// Bytes for geometry, which comes first, and for looks.
    bytes: [u64; 2],
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
    room: Room,
}

impl ModelBuffer {
    /// Columns of surfels: positions, axes u, axes v, those of the paths; then the normalisation of kernels and its
    /// mean, where a frame needed them. Columns of Gaussians: positions, standard deviations, rotations, opacities.
    pub(in crate::backend) fn geometry(&self) -> BufferBinding<'_> {
        BufferBinding { buffer: &self.room.buffer, offset: 0, size: BufferSize::new(self.room.bytes[0]) }
    }

    /// Columns of surfels: normals, colours, then materials and opacities where the model has them. Columns of
    /// Gaussians: colours, harmonics, then normals where they have them.
    pub(in crate::backend) fn looks(&self) -> BufferBinding<'_> {
        let [geometry, looks] = self.room.bytes;
        BufferBinding { buffer: &self.room.buffer, offset: geometry, size: BufferSize::new(looks) }
    }
}

impl UnderWay {
    /// Takes note of a buffer that was uploaded, and waits for the device where too much is under way.
    fn add(&mut self, device: &Device, uploaded: u64) -> Result<(), BackendError> {
        self.0 += uploaded;
        if self.0 > UNDER_WAY {
            device.submit([]);
            device.wait()?;
            self.0 = 0;
        }
        Ok(())
    }
}

impl Rooms {
    /// Begins a rendering. Rooms that none of the last ones took are freed.
    fn begin(&mut self) {
        self.renderings += 1;
        self.free();
    }

    /// Takes back the rooms of a model that is gone.
    fn take_back(&mut self, buffers: Vec<ModelBuffer>) {
        let now = self.renderings;
        self.spare.extend(buffers.into_iter().map(|buffer| (buffer.room, now)));
        self.free();
    }

    /// Frees spare rooms that are old, and the older ones where all are too large together.
    fn free(&mut self) {
        let now = self.renderings;
        let mut bytes = 0;
        let mut keeps: Vec<bool> = (self.spare.iter().rev())
            .map(|(room, since)| {
                let keeps = since + KEPT >= now && bytes + room.buffer.size() <= MOST_KEPT;
                bytes += if keeps { room.buffer.size() } else { 0 };
                keeps
            })
            .collect();
        self.spare.retain(|(room, _)| {
            let keeps = keeps.pop().unwrap_or(false);
            if !keeps {
                // Bind groups may still name it.
                room.buffer.destroy();
            }
            keeps
        });
    }

    /// A room for so many bytes of geometry and of looks: a spare one that is large enough and not too large, or a new
    /// one.
    fn room(&mut self, device: &Device, label: &str, bytes: [u64; 2]) -> Result<Room, BackendError> {
        let fits = |room: &Room| {
            let most = (MOST_WASTE * bytes.iter().sum::<u64>()).max(4 * STEP);
            room.buffer.size() <= most && room.bytes[0] >= bytes[0] && room.bytes[1] >= bytes[1]
        };
        let spare = self.spare.iter().enumerate().filter(|(_, (room, _))| fits(room));
        if let Some((at, _)) = spare.min_by_key(|(_, (room, _))| room.buffer.size()) {
            return Ok(self.spare.remove(at).0);
        }
        let [exact, wide] = [|bytes: u64| bytes.max(1).next_multiple_of(STEP), stepped].map(|of| bytes.map(of));
        let bytes = if wide.iter().sum::<u64>() <= MOST_KEPT { wide } else { exact };
        let buffer = device.buffer(label, bytes.iter().sum(), BufferUsages::STORAGE | BufferUsages::COPY_DST)?;
        Ok(Room { buffer, bytes })
    }

    /// Uploads the elements `range` of a model: columns of geometry, and of looks.
    fn upload(
        &mut self,
        device: &Device,
        label: &str,
        range: Range<usize>,
        [geometry, looks]: [&[&[u8]]; 2],
    ) -> Result<ModelBuffer, BackendError> {
        let bytes = [geometry, looks].map(|columns| columns.iter().map(|column| column.len() as u64).sum());
        let room = self.room(device, label, bytes)?;
        if room.buffer.size() > UNDER_WAY {
            // A copy of all would take much memory.
            for (columns, mut at) in [(geometry, 0), (looks, room.bytes[0])] {
                for column in columns {
                    device.write(&room.buffer, at, column);
                    at += column.len() as u64;
                }
            }
        } else {
            let mut all = Vec::with_capacity((room.bytes[0] + bytes[1]) as usize);
            for column in geometry {
                all.extend_from_slice(column);
            }
            all.resize(room.bytes[0] as usize, 0);
            for column in looks {
                all.extend_from_slice(column);
            }
            device.write(&room.buffer, 0, &all);
        }
        self.under_way.add(device, room.buffer.size())?;
        Ok(ModelBuffer { surfels: range, room })
    }
}

impl Models {
    /// Begins a rendering: models that nobody holds any more leave their rooms to others.
    pub(in crate::backend) fn begin(&mut self) {
        self.rooms.begin();
        let is_gone = |model: &mut Model| {
            let has_no_paths = model.own_paths.as_ref().is_some_and(|own| own.strong_count() == 0);
            has_no_paths || model.surfels.strong_count() == 0
        };
        for model in self.surfels.extract_if(.., is_gone) {
            self.rooms.take_back(model.buffers);
        }
        for capture in self.captures.extract_if(.., |capture| capture.gaussians.strong_count() == 0) {
            self.rooms.take_back(capture.buffers);
        }
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
        for model in self.surfels.extract_if(.., |model| normalised && !model.normalised && is_of(model)) {
            self.rooms.take_back(model.buffers);
        }
        if let Some(model) = self.surfels.iter().find(|model| is_of(model)) {
            return Ok(model.buffers.clone());
        }
        let buffers = upload(device, &mut self.rooms, of, normalised)?;
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
        let buffers = upload_gaussians(device, &mut self.rooms, gaussians)?;
        self.captures.push(CaptureBuffers { gaussians: Arc::downgrade(gaussians), buffers: buffers.clone() });
        Ok(buffers)
    }
}

fn upload(
    device: &Device,
    rooms: &mut Rooms,
    model: &SurfelModel,
    normalised: bool,
) -> Result<Vec<ModelBuffer>, BackendError> {
    let (surfels, paths) = (model.surfels(), model.paths());
    let factors = if normalised { surfels.normalisation() } else { &[] };
    let mean: Vec<f32> = normalised.then(|| surfels.mean_normalisation()).into_iter().collect();
    // At most 76 bytes of geometry, at most 44 of looks, and what a room has above that.
    let most = (device.most_bytes() / 150).clamp(1, MOST_SURFELS) as usize;
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
        buffers.push(rooms.upload(device, "surfels", range, [&columns_of_geometry, &looks])?);
    }
    Ok(buffers)
}

fn upload_gaussians(
    device: &Device,
    rooms: &mut Rooms,
    gaussians: &Gaussians,
) -> Result<Vec<ModelBuffer>, BackendError> {
    let each = gaussians.harmonics_each();
    // 44 bytes of geometry; colour, harmonics and normal of looks; a quarter more in a room.
    let widest = (44 + 24 + 12 * each as u64) * 5 / 4;
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
        buffers.push(rooms.upload(device, "captures", range, [&geometry, &looks])?);
    }
    Ok(buffers)
}
