//! Structs shared with WGSL (`shaders/common/types.wgsl`); a test compares the layouts.

use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Vec3};

use crate::backend::GpuCalls;
use crate::frame::{Blocks, Frame, FrameObject, PosedGroup, PosedObject, PosedSample, Raster};
use crate::layout::Channels;
use crate::model::{Material, Surfels};
use crate::options::Prefilter;
use crate::shading::ShadingLight;

/// Edge of a tile, pixels.
pub(in crate::backend) const TILE: u32 = 16;
/// Slots, or entries of lists, that one workgroup of pass `bin` works on.
pub(in crate::backend) const WORKGROUP_ITEMS: u32 = 1024;
/// Most entries that the lists hold of one splat.
pub(in crate::backend) const WIDEST: u32 = 64;
/// Bits of a key that one round of the sort goes by.
pub(in crate::backend) const DIGIT_BITS: u32 = 6;
/// Offsets of uniforms in their buffers are multiples of this, bytes; no device asks for more.
pub(in crate::backend) const UNIFORM_STRIDE: u64 = 256;
/// Views that a program binds: most groups of a round.
pub(in crate::backend) const VIEWS: u32 = 128;
/// Bytes of those views.
pub(in crate::backend) const VIEW_BYTES: u64 = VIEWS as u64 * size_of::<View>() as u64;
/// Workgroups of a table of surfels, each with its segment and its place in the segment.
pub(in crate::backend) const WORKGROUPS: usize = 2048;
/// Surfels of a workgroup.
pub(in crate::backend) const WORKGROUP_SURFELS: u32 = 256;

/// A multiple of 256 that is at least `n`, and a quarter more at most where that is large: so about the same number is
/// the same, and a buffer of about the same size stays.
pub(in crate::backend) fn stepped(n: u64) -> u64 {
    n.max(1).next_multiple_of((n / 8).next_power_of_two().max(256))
}

/// The work of a dispatch: one group, one band of the image, one batch of surfels.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::backend) struct View {
    pub axis: [f32; 2],
    pub offset: [f32; 2],
    pub pixels: [i32; 4],
    pub tiles: [u32; 2],
    pub first_tile_row: u32,
    pub slots: u32,
    pub near: f32,
    pub most_inverse_depth: f32,
    pub low_pass: f32,
    pub low_pass_scale: f32,
    pub focal: f32,
    pub stride: f32,
    pub weight: f32,
    pub entry_capacity: u32,
    pub camera: [[f32; 4]; 3],
    pub material: [f32; 4],
    pub first_light: u32,
    pub lights: u32,
    pub resumes: u32,
    pub first_turn: u32,
    pub last_turn: u32,
    pub slope: f32,
    pub blocks: [u32; 2],
    pub corner: [i32; 2],
    pub map_corner: [i32; 2],
    pub map_tiles: [u32; 2],
    pub sigma: f32,
    pub round_tiles: u32,
    pub first_place: u32,
    pub opaque_scale: f32,
    pub flags: u32,
    pub rest: u32,
    pub environment: [f32; 4],
    pub pixel: f32,
    pub strip: f32,
    pub first: [u32; 2],
    pub views: u32,
    pub number: u32,
    pub first_tile: u32,
    pub first_slot: u32,
    pub same_film: u32,
    pub film_tile: u32,
    pub first_segment: u32,
    pub first_moment: u32,
    pub walks: u32,
    pub stretch: u32,
    pub epsilon: f32,
    pub casters: u32,
}

/// Numbers of entries, and of workgroups for them. Programs of pass `bin` write it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::backend) struct Totals {
    pub groups: [u32; 3],
    pub entries: u32,
    pub wide: u32,
    pub columns: u32,
    pub rows: u32,
    pub layers: u32,
}

/// Bits of [`View::flags`]. Thresholds hold opaque surfels.
pub(in crate::backend) const OPAQUE_SURFELS: u32 = 1;
/// There are layers of see-through surfels.
pub(in crate::backend) const SEE_THROUGH_SURFELS: u32 = 2;
/// The slab of depth is the last one.
pub(in crate::backend) const LAST_SLAB: u32 = 4;
/// The view is of what is at rest for several groups, and adds nothing to the film by itself.
pub(in crate::backend) const IS_REST: u32 = 8;
/// Tiles into which nothing of the view's own moves are those of the view at rest.
pub(in crate::backend) const SHARES_TILES: u32 = 16;
/// Nobody asks for more of the view than its lists.
pub(in crate::backend) const LISTS_ALONE: u32 = 32;
/// Its lists are walked over in stretches.
pub(in crate::backend) const IN_STRETCHES: u32 = 64;

/// Kinds of [`Light`], the w of its vector. All others are point lights. Harmonics take [`HARMONIC_RECORDS`] of them.
pub(in crate::backend) const AMBIENT: f32 = 0.0;
pub(in crate::backend) const DIRECTIONAL: f32 = 1.0;
pub(in crate::backend) const HARMONICS: f32 = 3.0;
/// Records of nine terms: two in each, that with the even number first, in `colour`.
pub(in crate::backend) const HARMONIC_RECORDS: usize = 5;

/// Bits of [`CaptureSegment::flags`]: the capture is drawn as it was trained with antialiasing.
pub(in crate::backend) const FLAG_ANTIALIAS: u32 = 1;
/// Linear colours are encoded.
pub(in crate::backend) const FLAG_ENCODE: u32 = 2;
/// The Gaussians are those of a volume.
pub(in crate::backend) const FLAG_VOLUME: u32 = 4;
/// The volume has normals, and is lit.
pub(in crate::backend) const FLAG_LIT: u32 = 8;
/// The layers of a volume stay those of the last projection.
pub(in crate::backend) const FLAG_KEEP_LAYER: u32 = 16;
/// Shadows fall on the capture.
pub(in crate::backend) const FLAG_RECEIVES: u32 = 32;

/// Some surfels of one surfel buffer, posed at one time sample; or only the weight of a sample. The pose of centres,
/// and their motion, are over an interval the mean place by Simpson's rule, and half the difference of the ends
/// (docs/math.md, section 7).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::backend) struct Segment {
    pub screen: [[f32; 4]; 3],
    pub rate: [[f32; 4]; 3],
    pub normal: [[f32; 4]; 3],
    pub world: [[f32; 4]; 3],
    pub material: [f32; 4],
    pub epsilon: f32,
    pub handedness: f32,
    pub weight: f32,
    pub share: f32,
    pub first_slot: u32,
    pub first_surfel: u32,
    pub surfels: u32,
    pub buffer_surfels: u32,
    pub buffer_start: u32,
    pub index: u32,
    pub first_light: u32,
    pub flags: u32,
    pub centre: [[f32; 4]; 3],
    pub motion: [[f32; 4]; 3],
    pub elapsed: [f32; 4],
    pub advance: [f32; 4],
    pub turn: [[f32; 4]; 3],
    pub pace: f32,
    pub columns: u32,
    pub view: u32,
    pub middle: u32,
    pub axes: [[f32; 4]; 3],
}

/// A light of one sample, or two terms of one from all around.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::backend) struct Light {
    pub vector: [f32; 4],
    pub colour: [f32; 4],
}

/// The Gaussians of one buffer of a capture or volume, posed at one time sample (`shaders/transparent/project.wgsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::backend) struct CaptureSegment {
    pub screen: [[f32; 4]; 3],
    pub rate: [[f32; 4]; 3],
    pub centre: [[f32; 4]; 3],
    pub motion: [[f32; 4]; 3],
    pub eye: [f32; 3],
    pub near: f32,
    pub field: [f32; 2],
    pub dilation: f32,
    pub opacity: f32,
    pub low: [f32; 4],
    pub high: [f32; 4],
    pub tint: [f32; 4],
    pub first_slot: u32,
    pub count: u32,
    pub first_index: u32,
    pub flags: u32,
    pub harmonics_each: u32,
    pub harmonics_used: u32,
    pub area: f32,
    pub layer: f32,
    pub normal: [[f32; 4]; 3],
    pub world: [[f32; 4]; 3],
    pub material: [f32; 4],
    pub first_light: u32,
    pub lights: u32,
    pub view: u32,
    pub unused: u32,
}

/// A projected Gaussian ([`crate::layout::GaussianSplat`]) as the device has it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::backend) struct DeviceGaussian {
    pub reference: [f32; 2],
    pub along: f32,
    pub slope: f32,
    pub across: f32,
    pub peak: f32,
    pub colour: [f32; 3],
    pub depth: f32,
    pub velocity: [f32; 2],
    pub bounds: [u16; 4],
    pub index: u32,
    pub layer: u32,
}

/// The background behind what is transparent (`shaders/transparent/resolve.wgsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::backend) struct DeviceBackground {
    pub colour: [f32; 4],
    pub shown: [f32; 4],
}

/// What the host reads after a frame (`shaders/bin.wgsl`): of pass `bin`, and the pixels that lack layers of
/// see-through surfels.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(in crate::backend) struct Status {
    pub most_entries: u32,
    pub splats_low: u32,
    pub splats_high: u32,
    pub left_out_low: u32,
    pub left_out_high: u32,
    pub longest: u32,
    pub chain_low: u32,
    pub chain_high: u32,
    pub walks: u32,
    pub filled: f32,
    pub last_walks: u32,
    pub last_longest: u32,
    pub last_tiles: u32,
}

/// Invocations that keep the machine busy that the counters speak of: an H100.
pub(in crate::backend) const LARGE_GPU: f32 = 270_336.0;

impl Status {
    /// Counts the passes that walked over lists.
    pub(in crate::backend) fn count(&self) -> GpuCalls {
        let mut calls = GpuCalls::default();
        let before = u64::from(self.chain_high) << 32 | u64::from(self.chain_low);
        let share = (self.last_tiles as f32 * TILE as f32 * TILE as f32 / LARGE_GPU).min(1.0);
        calls.chain = before + u64::from(self.last_walks) * u64::from(self.last_longest);
        calls.walks = u64::from(self.walks) + u64::from(self.last_walks);
        let filled = f64::from(self.filled) + f64::from(self.last_walks) * f64::from(share);
        calls.fill = if calls.walks > 0 { filled / calls.walks as f64 } else { 0.0 };
        calls
    }
}

impl Segment {
    /// An entry that holds only the weight of a sample.
    pub(in crate::backend) fn weighing(weight: f32) -> Self {
        Self { weight, ..Self::zeroed() }
    }

    /// The pose of an object, without its surfels. `turn` is 0 for static objects, else 1 + the sample.
    pub(in crate::backend) fn posed(
        posed: &PosedObject,
        object: &FrameObject,
        surfels: &Surfels,
        turn: u32,
        share: f32,
    ) -> Self {
        let has_materials = !surfels.material.is_empty();
        let materials = object.material.is_none() && has_materials;
        let has_opacity = !surfels.opacity.is_empty();
        let shadows = u8::from(object.receives) + 2 * u8::from(object.catcher) + 4 * u8::from(object.is_held);
        let columns = Vec3::new(object.opacity, object.reflection, f32::from(shadows));
        let factors = |[a, b, c]: [f32; 3]| [a, b, c, 0.0];
        Self {
            screen: rows(&posed.screen_from_model, posed.screen_origin),
            rate: rows(&posed.screen_rate, posed.screen_origin_rate),
            normal: rows(&posed.normal_matrix, columns),
            world: rows(&posed.world_from_model, posed.world_origin),
            material: coefficients(object.material.unwrap_or_default()),
            epsilon: posed.epsilon,
            handedness: posed.handedness,
            share,
            flags: u32::from(object.two_sided) | u32::from(materials) << 1 | u32::from(has_opacity) << 2 | turn << 3,
            centre: rows(&posed.centre_from_model, posed.centre_origin),
            motion: rows(&posed.motion_from_model, posed.motion_origin),
            elapsed: factors(posed.elapsed),
            advance: factors(posed.advance),
            turn: rows(&posed.normal_motion, Vec3::ZERO),
            pace: posed.pace,
            axes: rows(&posed.world_from_view, Vec3::new(posed.spheres, 0.0, 0.0)),
            columns: 9 + 3 * object.shape.paths().order() as u32,
            ..Self::zeroed()
        }
    }

    /// The same where the origin of the model is at `origin` relative to the eye, world axes.
    pub(in crate::backend) fn placed(self, posed: &PosedObject, origin: Vec3) -> Self {
        Self { world: rows(&posed.world_from_model, origin), ..self }
    }
}

impl View {
    /// The fields that all bands and batches of a group share.
    pub(in crate::backend) fn of(frame: &Frame, raster: &Raster, group: &PosedGroup, channels: &Channels) -> Self {
        let low_pass = if frame.prefilter == Prefilter::Approx { raster.low_pass } else { 0.0 };
        let middle = &group.samples[group.samples.len() / 2];
        let column = |v: Vec3| v.extend(0.0).to_array();
        let camera = middle.world_from_camera;
        Self {
            axis: raster.axis,
            offset: raster.offset,
            near: frame.near,
            most_inverse_depth: 1.0 / frame.near,
            low_pass,
            low_pass_scale: if low_pass > 0.0 { 1.0 / (low_pass * low_pass) } else { 0.0 },
            focal: raster.focal,
            stride: frame.stride as f32,
            // The picture of a group that something transparent is laid over is not yet added to the film.
            weight: if frame.blending.is_some() { 1.0 } else { middle.weight },
            camera: [column(camera.x_axis), column(camera.y_axis), column(camera.z_axis)],
            material: coefficients(channels.uniform.unwrap_or_default()),
            first_light: (group.samples.len() / 2 * records(&middle.lights)) as u32,
            lights: records(&middle.lights) as u32,
            blocks: blocks(frame),
            sigma: raster.sigma,
            pixel: raster.pixel,
            strip: match raster.readout {
                None => 0.0,
                Some(0) => -0.5 * raster.size[0] as f32,
                Some(axis) => 0.5 * raster.size[axis] as f32,
            },
            first: raster.first,
            environment: frame.surroundings.as_ref().map_or([0.0; 4], |surroundings| {
                let [cos, sin] = surroundings.turn;
                [cos, sin, surroundings.intensity, channels.mirror]
            }),
            ..Self::zeroed()
        }
    }
}

/// Number of blocks in a row, and of rows of blocks, where only some are wanted; else 0. Maps want all.
fn blocks(frame: &Frame) -> [u32; 2] {
    if frame.wanted.is_none() || frame.swept.is_some() {
        return [0; 2];
    }
    Blocks::count(frame.size, frame.stride).map(|blocks| blocks as u32)
}

/// One number for each block, row by row. It is not 0 where the block is wanted.
pub(in crate::backend) fn wanted(frame: &Frame) -> Vec<u32> {
    let [width, height] = blocks(frame).map(|blocks| blocks as usize);
    let wanted = |index: usize| frame.wanted.as_ref().is_some_and(|blocks| blocks.at(index % width, index / width));
    (0..width * height).map(|index| u32::from(wanted(index))).collect()
}

/// The lights of a group's samples, one sample after the other; every sample has the same number.
pub(in crate::backend) fn lights(samples: &[PosedSample]) -> Vec<Light> {
    let of_sample = |sample: &PosedSample| {
        let shadows = sample.lights.iter().scan(0, |shadows, light| {
            *shadows += u32::from(light.has_shadows());
            Some(if light.has_shadows() { *shadows } else { 0 })
        });
        sample.lights.iter().zip(shadows).flat_map(|(of, shadow)| light(of, shadow)).collect::<Vec<_>>()
    };
    samples.iter().flat_map(of_sample).collect()
}

/// The records of light from all around.
pub(super) fn harmonics(terms: &[Vec3; 9]) -> Vec<Light> {
    light(&ShadingLight::Harmonics { terms: *terms }, 0)
}

/// Number of the records of the lights of a sample.
pub(super) fn records(lights: &[ShadingLight]) -> usize {
    let of_light = |light: &ShadingLight| match light {
        ShadingLight::Harmonics { .. } => HARMONIC_RECORDS,
        ShadingLight::Ambient { .. } | ShadingLight::Directional { .. } | ShadingLight::Point { .. } => 1,
    };
    lights.iter().map(of_light).sum()
}

/// `shadow`: 0 without shadows, else 1 + the number of lights with shadows before it.
fn light(light: &ShadingLight, shadow: u32) -> Vec<Light> {
    let record = |vector: Vec3, kind: f32, colour: Vec3| Light {
        vector: vector.extend(kind).to_array(),
        colour: colour.extend(shadow as f32).to_array(),
    };
    let (vector, kind, colour) = match *light {
        ShadingLight::Harmonics { terms } => {
            let term = |k: usize| terms.get(k).copied().unwrap_or_default();
            return (0..HARMONIC_RECORDS).map(|k| record(term(2 * k + 1), HARMONICS, term(2 * k))).collect();
        }
        ShadingLight::Ambient { colour } => (Vec3::ZERO, AMBIENT, colour),
        ShadingLight::Directional { towards, colour, .. } => (towards, DIRECTIONAL, colour),
        ShadingLight::Point { position, colour, .. } => (position, 2.0, colour),
    };
    vec![record(vector, kind, colour)]
}

pub(super) fn rows(m: &Mat3, origin: Vec3) -> [[f32; 4]; 3] {
    [0, 1, 2].map(|i| m.row(i).extend(origin[i]).to_array())
}

pub(super) fn coefficients(material: Material) -> [f32; 4] {
    [material.ambient, material.diffuse, material.specular, material.shininess]
}
