//! What the shadow maps of a group take, and how far its surfels reach. Twin: `src/backend/cpu/shadows/`.

use glam::Vec3;

use crate::backend::BackendError;
use crate::backend::cpu::shadows::fit::{MORE_TEXELS, SHARE_OF_MORE, SLICES, with_borders};
use crate::backend::cpu::shadows::most_texels;
use crate::frame::{Frame, FrameObject, PosedSample};
use crate::shading::ShadingLight;

/// Words of what is known of a map (`shaders/shadows/maps.wgsl`).
pub(in crate::backend) const MAP_WORDS: u64 = 15;
/// Bytes of a plane of a surfel for a light (`shaders/shadows/casters.wgsl`).
const CASTER_BYTES: u64 = 32;
/// Invocations that draw a surfel together (`shaders/shadows/stamp.wgsl`).
pub(in crate::backend) const DRAWING: u32 = 64;
/// Turns of loops that a texel takes, most of the time.
pub(in crate::backend) const TURNS_OF_TEXEL: u64 = 3;
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
    /// Sizes of a frame, where a program binds `most_bytes`, and a light has at most `most_texels_of_light`.
    pub(in crate::backend) fn of(
        frame: &Frame,
        most_bytes: u64,
        most_texels_of_light: u64,
    ) -> Result<Self, BackendError> {
        let Some(sample) = frame.all_samples().next().filter(|_| frame.has_shadows()) else {
            return Ok(Self::default());
        };
        let shadows = || sample.lights.iter().filter(|light| light.has_shadows());
        let lights = shadows().count() as u64;
        if lights > MOST_LIGHTS {
            let what = "the GPU backend has, of more than 72 lights with shadows,";
            return Err(BackendError::Shadows { what, instead: "the CPU (`--backend cpu`)" });
        }
        let faces = if shadows().any(|light| matches!(light, ShadingLight::Point { .. })) { FACES } else { 1 };
        let models = frame.objects.iter().filter(|object| !object.see_through).filter_map(|o| o.shape.surfels());
        let casters = models.map(|model| model.surfels().len() as u64).sum();
        let room = (most_bytes / 4 / lights).saturating_sub(faces * SLICES as u64 * MAP_WORDS);
        let room = room.saturating_sub(MORE_TEXELS) / (SHARE_OF_MORE + 1) * SHARE_OF_MORE;
        let texels = most_texels(frame).min(most_texels_of_light).min(room);
        let sizes = Self { lights, faces, texels, casters };
        if sizes.caster_bytes() > most_bytes || texels == 0 {
            let what = "the GPU backend has, of so many surfels and lights,";
            return Err(BackendError::Shadows { what, instead: "the CPU (`--backend cpu`)" });
        }
        Ok(sizes)
    }

    /// Bytes of the maps of a group.
    pub(in crate::backend) const fn map_bytes(&self) -> u64 {
        4 * self.lights * (self.faces * SLICES as u64 * MAP_WORDS + self.room())
    }

    /// Texels of a light that there is room for.
    const fn room(&self) -> u64 {
        if self.lights == 0 { 0 } else { with_borders(self.texels) }
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
    /// Extents of the objects of a frame, if any point has shadows.
    pub(in crate::backend) fn of(frame: &Frame) -> Self {
        let is_point = |light: &ShadingLight| matches!(light, ShadingLight::Point { shadows: true, .. });
        if !frame.all_samples().next().is_some_and(|sample| sample.lights.iter().any(is_point)) {
            return Self::default();
        }
        let most = |all: &[Vec3]| {
            let squares = all.iter().map(|v| v.length_squared()).filter(|square| square.is_finite());
            squares.fold(0.0, f32::max).sqrt()
        };
        let extent = |object: &FrameObject| {
            if let Some((gaussians, _)) = object.drawn().filter(|_| object.receives) {
                return Extent { length: most(&gaussians.position), ..Extent::default() };
            }
            let Some(model) = object.shape.surfels().filter(|_| !object.see_through) else { return Extent::default() };
            let surfels = model.surfels();
            let axes = most(&surfels.axis_u) + most(&surfels.axis_v);
            Extent { length: most(&surfels.position) + axes, columns: model.paths().columns.map(most) }
        };
        Self(frame.objects.iter().map(extent).collect())
    }

    /// The distance from the eye of the farthest surfel at a sample, or more.
    pub(in crate::backend) fn at(&self, frame: &Frame, sample: &PosedSample) -> f32 {
        let all = self.0.iter().zip(&sample.objects).enumerate().filter(|(_, (_, posed))| posed.visible);
        let lengths = all.map(|(object, (extent, posed))| {
            let moved: f32 = extent.columns.iter().zip(posed.elapsed).map(|(rate, factor)| rate * factor.abs()).sum();
            let linear = posed.world_from_model;
            let stretch =
                linear.x_axis.length_squared() + linear.y_axis.length_squared() + linear.z_axis.length_squared();
            frame.place_of(object, sample).length() + stretch.sqrt() * (extent.length + moved)
        });
        lengths.filter(|length| length.is_finite()).fold(frame.near, f32::max)
    }
}
