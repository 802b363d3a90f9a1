//! What the shadow maps of a group take, and how far its surfels reach. Twin: `src/backend/cpu/shadows/`.

use glam::Vec3;

use crate::backend::BackendError;
use crate::backend::cpu::shadows::fit::{MORE_TEXELS, SHARE_OF_MORE, SLICES, with_borders};
use crate::backend::cpu::shadows::most_texels;
use crate::backend::cpu::shadows::splats::reaches;
use crate::frame::{Frame, FrameObject, PosedSample};
use crate::shading::ShadingLight;

/// Words of what is known of a map (`shaders/shadows/maps.wgsl`).
pub(in crate::backend) const MAP_WORDS: u64 = 16;
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

/// Casters whose room a Gaussian takes, with its disc.
pub(in crate::backend) const CASTERS_OF_GAUSSIAN: u64 = 3;
/// Bits of a number of a caster, above which layers are counted (`shaders/shadows/maps.wgsl`).
pub(in crate::backend) const LAYERS_SHIFT: u32 = 28;
/// Most surfels that receive or cast: their numbers begin at 1.
const MOST_CASTERS: u64 = (1 << LAYERS_SHIFT) - 1;

/// Do the surfels of an object let a part of the light through, and cast?
pub(in crate::backend) fn casts_in_layers(object: &FrameObject) -> bool {
    object.see_through && object.cast_shadows && object.has_surfels()
}

/// Do the surfels of an object receive or cast shadows?
pub(in crate::backend) const fn takes_part(object: &FrameObject) -> bool {
    !object.see_through || object.cast_shadows || object.receives
}

/// What the shadows of a group take; nothing where no light has any.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::backend) struct ShadowSizes {
    /// Lights with shadows, and views of each.
    pub lights: u64,
    pub faces: u64,
    /// Texels that all maps of a light are to have together.
    pub texels: u64,
    /// Words of a texel: three where any see-through surfels cast, else one; and the number of one more, for captures,
    /// where any casts (`shaders/shadows/maps.wgsl`).
    pub texel_words: u64,
    pub capture_word: u64,
    /// Surfels that receive or cast, and [`CASTERS_OF_GAUSSIAN`] for each Gaussian.
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
        let models = frame.objects.iter().filter(|object| takes_part(object)).filter_map(|o| o.shape.surfels());
        let surfels: u64 = models.map(|model| model.surfels().len() as u64).sum();
        let captures =
            frame.objects.iter().filter(|object| frame.casts_splats(object)).filter_map(|o| o.shape.gaussians());
        let gaussians: u64 = captures.map(|model| model.gaussians().len() as u64).sum();
        let casters = surfels + CASTERS_OF_GAUSSIAN * gaussians;
        if casters >= MOST_CASTERS {
            let what = "the GPU backend has, of so many surfels,";
            return Err(BackendError::Shadows { what, instead: "the CPU (`--backend cpu`)" });
        }
        let has_layers = frame.objects.iter().any(casts_in_layers);
        let of_layers = if has_layers { 3 } else { 1 };
        let has_captures = frame.objects.iter().any(|object| frame.casts_splats(object) && !object.is_volume());
        let (texel_words, capture_word) = if has_captures { (of_layers + 1, of_layers) } else { (of_layers, 0) };
        let room = (most_bytes / 4 / lights).saturating_sub(faces * SLICES as u64 * MAP_WORDS) / texel_words;
        let room = room.saturating_sub(MORE_TEXELS) / (SHARE_OF_MORE + 1) * SHARE_OF_MORE;
        let texels = most_texels(frame).min(most_texels_of_light).min(room);
        let sizes = Self { lights, faces, texels, texel_words, capture_word, casters };
        if sizes.caster_bytes() > most_bytes || texels == 0 {
            let what = "the GPU backend has, of so many surfels and lights,";
            return Err(BackendError::Shadows { what, instead: "the CPU (`--backend cpu`)" });
        }
        Ok(sizes)
    }

    /// Bytes of the maps of a group.
    pub(in crate::backend) const fn map_bytes(&self) -> u64 {
        4 * self.lights * (self.faces * SLICES as u64 * MAP_WORDS + self.texel_words * self.room())
    }

    /// Texels of a light that there is room for.
    pub(in crate::backend) const fn room(&self) -> u64 {
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
            let Some(model) = object.shape.surfels() else { return Extent::default() };
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
        lengths.chain(reaches(frame, sample)).filter(|length| length.is_finite()).fold(frame.near, f32::max)
    }
}
