//! What the shadow maps of a group take, and what the host says of it: how lights see, and what casts shadows.
//! Twin: `src/backend/cpu/shadows/`.

use glam::Vec3;

use super::job::Job;
use super::layout::{Light, Segment};
use super::memory::Limits;
use crate::backend::BackendError;
use crate::backend::cpu::shadows::fit::{SLICES, Slice};
use crate::backend::cpu::shadows::view::LightView;
use crate::backend::cpu::shadows::{jitter, most_texels};
use crate::frame::{Frame, PosedSample};
use crate::shading::ShadingLight;

/// Words of what is known of a map (`shaders/shadows/maps.wgsl`).
pub(in crate::backend) const MAP_WORDS: u64 = 15;
/// Bytes of a plane of a surfel for a light (`shaders/shadows/casters.wgsl`).
const CASTER_BYTES: u64 = 32;
/// Invocations that draw a surfel together (`shaders/shadows/stamp.wgsl`).
pub(in crate::backend) const DRAWING: u32 = 64;
/// Turns of loops that a texel takes, most of the time.
pub(in crate::backend) const TURNS_OF_TEXEL: u64 = 3;
/// Texels that there is room for beside those that maps are to have (`shaders/shadows/maps.wgsl`): one for so many, and
/// so many.
const SHARE_OF_MORE: u64 = 32;
const MORE_TEXELS: u64 = 4096;
/// Lights of a mask (`shaders/shadows/light.wgsl`), of which the values of a splat have room for three.
pub(in crate::backend) const LIGHTS_OF_MASK: u64 = 24;
/// Most lights with shadows.
const MOST_LIGHTS: u64 = 3 * LIGHTS_OF_MASK;
/// Faces of the cube around a point.
const FACES: u64 = 6;

/// What the shadows of a group take; nothing where no light has any.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::backend) struct ShadowSizes {
    /// Lights with shadows, and views of each.
    pub lights: u64,
    pub faces: u64,
    /// Texels that all maps of a light are to have together.
    pub texels: u64,
    /// Opaque surfels.
    pub casters: u64,
}

impl ShadowSizes {
    /// Those of a frame.
    pub(in crate::backend) fn of(frame: &Frame, limits: Limits) -> Result<Self, BackendError> {
        let Some(sample) = frame.all_samples().next().filter(|_| frame.has_shadows()) else {
            return Ok(Self::default());
        };
        if frame.swept.is_some() {
            let what = "the GPU backend has, in mode `volumetric`,";
            return Err(BackendError::Shadows { what, instead: "the CPU (`--backend cpu`)" });
        }
        let shadows = || sample.lights.iter().filter(|light| light.has_shadows());
        let lights = shadows().count() as u64;
        if lights > MOST_LIGHTS {
            let what = "the GPU backend has, of more than 72 lights with shadows,";
            return Err(BackendError::Shadows { what, instead: "the CPU (`--backend cpu`)" });
        }
        let faces = if shadows().any(|light| matches!(light, ShadingLight::Point { .. })) { FACES } else { 1 };
        let models = frame.objects.iter().filter(|object| !object.see_through).filter_map(|o| o.shape.surfels());
        let casters = models.map(|model| model.surfels().len() as u64).sum();
        let room = (limits.bytes / 4 / lights).saturating_sub(faces * SLICES as u64 * MAP_WORDS);
        let room = room.saturating_sub(MORE_TEXELS) / (SHARE_OF_MORE + 1) * SHARE_OF_MORE;
        let texels = most_texels(frame).min(limits.shadow_texels).min(room);
        let sizes = Self { lights, faces, texels, casters };
        if sizes.caster_bytes() > limits.bytes || texels == 0 {
            let what = "the GPU backend has, of so many surfels and lights,";
            return Err(BackendError::Shadows { what, instead: "the CPU (`--backend cpu`)" });
        }
        Ok(sizes)
    }

    /// Bytes of the maps of a group.
    pub(in crate::backend) const fn map_bytes(&self) -> u64 {
        4 * self.lights * (self.faces * SLICES as u64 * MAP_WORDS + self.room())
    }

    /// Texels of a light that there is room for: maps have borders, and not every number of them can be had.
    const fn room(&self) -> u64 {
        if self.lights == 0 { 0 } else { self.texels + self.texels / SHARE_OF_MORE + MORE_TEXELS }
    }

    /// Bytes of the planes of a group.
    pub(in crate::backend) const fn caster_bytes(&self) -> u64 {
        self.lights * self.casters * CASTER_BYTES
    }
}

/// How far the surfels of objects reach from the origins of their models.
#[derive(Debug, Default)]
pub(in crate::backend) struct Extents(Vec<Extent>);

/// Largest lengths of a model's positions and axes, and of the columns of its paths.
#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    length: f32,
    columns: [f32; 3],
}

impl Extents {
    /// Those of the objects of a frame, if any point has shadows.
    pub(in crate::backend) fn of(frame: &Frame) -> Self {
        let is_point = |light: &ShadingLight| matches!(light, ShadingLight::Point { shadows: true, .. });
        if !frame.all_samples().next().is_some_and(|sample| sample.lights.iter().any(is_point)) {
            return Self::default();
        }
        let most = |all: &[Vec3]| {
            let squares = all.iter().map(|v| v.length_squared()).filter(|square| square.is_finite());
            squares.fold(0.0, f32::max).sqrt()
        };
        let extent = |object: &crate::frame::FrameObject| {
            let Some(model) = object.shape.surfels().filter(|_| !object.see_through) else { return Extent::default() };
            let surfels = model.surfels();
            let axes = most(&surfels.axis_u) + most(&surfels.axis_v);
            Extent { length: most(&surfels.position) + axes, columns: model.paths().columns.map(most) }
        };
        Self(frame.objects.iter().map(extent).collect())
    }

    /// The distance from the eye of the farthest surfel at a sample, or more.
    fn at(&self, frame: &Frame, sample: &PosedSample) -> f32 {
        let all = self.0.iter().zip(&sample.objects).filter(|(_, posed)| posed.visible);
        let lengths = all.map(|(extent, posed)| {
            let moved: f32 = extent.columns.iter().zip(posed.elapsed).map(|(rate, factor)| rate * factor.abs()).sum();
            let linear = posed.world_from_model;
            let stretch =
                linear.x_axis.length_squared() + linear.y_axis.length_squared() + linear.z_axis.length_squared();
            posed.world_origin.length() + stretch.sqrt() * (extent.length + moved)
        });
        lengths.filter(|length| length.is_finite()).fold(frame.near, f32::max)
    }
}

/// How lights with shadows see at the sample of a group, as `shaders/shadows/maps.wgsl` has it: as many views of each.
pub(in crate::backend) fn light_views(job: &Job<'_>) -> Vec<Light> {
    let prepared = job.place.prepared;
    let faces = prepared.schedule.shadows.faces as usize;
    let sample = &job.group.samples[job.group.samples.len() / 2];
    // See-through surfels receive no shadows.
    if prepared.schedule.shadows.lights == 0 || job.see_through {
        return Vec::new();
    }
    let extent = prepared.extents.at(prepared.frame, sample);
    let mut out = Vec::new();
    for (number, light) in (0..).zip(&sample.lights) {
        let Some(views) = LightView::of(light, sample.world_from_camera.x_axis, extent) else { continue };
        let [x, y] = jitter(sample, number);
        for face in 0..faces {
            let view = &views[face.min(views.len() - 1)];
            let (axes, origin) = view.pose();
            let raster = job.place.raster(false);
            let is_point = f32::from(u8::from(view.is_point));
            let row = |i: usize, last: f32| axes.row(i).extend(last).to_array();
            out.push(Light { vector: row(0, x), colour: row(1, y) });
            out.push(Light { vector: row(2, is_point), colour: origin.extend(raster.size[1] as f32).to_array() });
            let slices = Slice::all(view, &raster, prepared.frame.near, sample.world_from_camera);
            out.extend(slices.iter().map(|slice| {
                // WGSL promises no infinity.
                let [x, y] = slice.bounds.map(|ends| ends.map(|end: f32| end.clamp(f32::MIN, f32::MAX)));
                Light { vector: [x[0], y[0], x[1], y[1]], colour: [slice.farthest, slice.start, 0.0, 0.0] }
            }));
        }
    }
    out
}

/// What casts shadows at the sample of a group: all opaque surfels, with the object and surfel buffer of each segment.
/// Their slots are numbers of casters.
pub(in crate::backend) fn caster_segments(job: &Job<'_>) -> Vec<(Segment, usize, usize)> {
    let prepared = job.place.prepared;
    let mut out = Vec::new();
    if prepared.schedule.shadows.lights == 0 || job.see_through {
        return out;
    }
    let sample = &job.group.samples[job.group.samples.len() / 2];
    let visible = |is_static| prepared.frame.visible_surfels(sample, is_static, false);
    let mut casters = 0;
    for (object, model) in visible(true).chain(visible(false)) {
        let (posed, of_frame) = (&sample.objects[object], &prepared.frame.objects[object]);
        let template = Segment::posed(posed, of_frame, model.surfels(), 1, 1.0);
        for (number, buffer) in prepared.surfel_buffers[object].iter().enumerate() {
            let surfels = buffer.surfels.len() as u32;
            out.push((
                Segment {
                    first_slot: casters,
                    surfels,
                    buffer_surfels: surfels,
                    buffer_start: buffer.surfels.start as u32,
                    ..template
                },
                object,
                number,
            ));
            casters += surfels;
        }
    }
    out
}
