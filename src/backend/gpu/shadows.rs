//! What the host says of the shadows of a group: how lights see, and what casts shadows.
//! Twin: `src/backend/cpu/shadows/`.

use bytemuck::Zeroable;
use glam::{DVec3, Mat3, Vec3};

use super::job::Job;
use super::layout::{CaptureSegment, Light, Segment, harmonics, lights, rows};
use super::prepared::Prepared;
use super::shadow_sizes::{CASTERS_OF_GAUSSIAN, casts_in_layers, takes_part};
use crate::backend::cpu::shadows::fit::{Slice, margin, wanted};
use crate::backend::cpu::shadows::splats::seed_of_light;
use crate::backend::cpu::shadows::view::LightView;
use crate::backend::cpu::shadows::{chances, jitter};
use crate::frame::{FrameObject, PosedObject};
use crate::model::{Gaussians, Optics};
use crate::scene::{Drawing, SurfelModel};

/// Flags of segments that are about shadows: what their surfels do, and what the model has
/// (`shaders/shadows/posed.wgsl`).
pub(in crate::backend) const IS_RECEIVER: u32 = 1;
pub(in crate::backend) const HAS_MATERIALS: u32 = 2;
pub(in crate::backend) const HAS_OPACITIES: u32 = 4;
pub(in crate::backend) const CASTS: u32 = 8;
pub(in crate::backend) const SEE_THROUGH: u32 = 16;
/// What they are not surfels but Gaussians, of a capture or of a volume.
pub(in crate::backend) const ARE_SPLATS: u32 = 32;
pub(in crate::backend) const IS_VOLUME: u32 = 64;

/// The lights of the middle sample of a group, and then how those with shadows see, as `shaders/shadows/maps.wgsl` has
/// it: as many views of each. Then where held objects are, what is seen, and the light of a whole sky for shadow
/// catchers. Nothing where no light has shadows.
pub(in crate::backend) fn light_views(job: &Job<'_>) -> Vec<Light> {
    let prepared = job.place.prepared;
    let faces = prepared.schedule.shadows.faces as usize;
    let sample = &job.group.samples[job.group.samples.len() / 2];
    if !job.is_shadowed() {
        return Vec::new();
    }
    let extent = prepared.extents.at(prepared.frame, sample);
    let raster = job.place.raster(false);
    let margin = margin(prepared.frame, &raster);
    let wants_all = f32::from(u8::from(wanted(prepared.frame).is_none()));
    let mut out = lights(std::slice::from_ref(sample));
    for (number, light) in (0..).zip(&sample.lights) {
        let Some(views) = LightView::of(light, sample.world_from_camera.x_axis, extent) else { continue };
        let [x, y] = jitter(sample, number);
        let chances = chances(prepared.frame, sample, number);
        for face in 0..faces {
            let view = &views[face.min(views.len() - 1)];
            let (axes, origin) = view.pose();
            let is_point = f32::from(u8::from(view.is_point));
            let row = |i: usize, last: f32| axes.row(i).extend(last).to_array();
            out.push(Light { vector: row(0, x), colour: row(1, y) });
            out.push(Light { vector: row(2, is_point), colour: origin.extend(raster.size[1] as f32).to_array() });
            let slices = Slice::all(view, (&raster, margin), prepared.frame.near, sample.world_from_camera);
            // The first slices have the chances of layers, and the very first one the seed of Gaussians.
            let chances = chances.iter().copied().chain(std::iter::repeat(0.0));
            let seeds = [seed_of_light(sample, number) as f32].into_iter().chain(std::iter::repeat(0.0));
            out.extend(slices.iter().zip(chances.zip(seeds)).map(|(slice, (chance, seed))| {
                // WGSL promises no infinity.
                let [x, y] = slice.bounds.map(|ends| ends.map(|end: f32| end.clamp(f32::MIN, f32::MAX)));
                Light { vector: [x[0], y[0], x[1], y[1]], colour: [slice.farthest, slice.start, chance, seed] }
            }));
        }
    }
    let [a, b, c] = [0, 1, 2].map(|i| sample.held.turn.row(i).extend(sample.held.shift[i]).to_array());
    out.extend([Light { vector: a, colour: b }, Light { vector: c, colour: [margin, wants_all, 0.0, 0.0] }]);
    if let Some(terms) = sample.sky {
        out.extend(harmonics(&terms));
    }
    out
}

/// May shadows fall on captures or volumes?
pub(in crate::backend) fn shades_gaussians(prepared: &Prepared<'_>) -> bool {
    shades(prepared, |object| object.drawn().is_some())
}

/// May shadows fall on anything that is laid over opaque surfels?
pub(in crate::backend) fn shades_transparent(prepared: &Prepared<'_>) -> bool {
    shades(prepared, |object| object.drawn().is_some() || object.see_through)
}

/// May shadows fall on any object of these?
fn shades(prepared: &Prepared<'_>, is_one: fn(&FrameObject) -> bool) -> bool {
    let shadows = &prepared.schedule.shadows;
    let receives = |object: &FrameObject| object.receives && is_one(object);
    shadows.lights > 0 && shadows.casters > 0 && prepared.frame.objects.iter().any(receives)
}

/// The captures and volumes on which shadows fall at the sample of a group, with the object and Gaussian buffer of each
/// segment.
pub(in crate::backend) fn receiver_segments(job: &Job<'_>) -> Vec<(CaptureSegment, usize, usize)> {
    let prepared = job.place.prepared;
    let mut out = Vec::new();
    if job.see_through || !shades_gaussians(prepared) {
        return out;
    }
    let sample = &job.group.samples[job.group.samples.len() / 2];
    for (object, buffers) in prepared.gaussian_buffers.iter().enumerate() {
        let posed = &sample.objects[object];
        if !prepared.frame.objects[object].receives || !posed.visible {
            continue;
        }
        for (number, buffer) in buffers.iter().enumerate() {
            let segment = CaptureSegment {
                world: rows(&posed.world_from_model, posed.world_origin),
                count: buffer.surfels.len() as u32,
                ..CaptureSegment::zeroed()
            };
            out.push((segment, object, number));
        }
    }
    out
}

/// Layers of see-through surfels that may let light through at the sample of a group, and one more: that with a chance
/// which no opacity is below stops all light that meets it.
pub(in crate::backend) fn layers(job: &Job<'_>) -> usize {
    let frame = job.place.prepared.frame;
    let casts = frame.objects.iter().filter(|object| casts_in_layers(object));
    let opacity =
        |object: &FrameObject| object.shape.surfels().map_or(1.0, SurfelModel::least_opacity) * object.opacity;
    let Some(least) = casts.map(opacity).reduce(f32::min) else { return 0 };
    let sample = &job.group.samples[job.group.samples.len() / 2];
    let of_light = |(number, _)| {
        let chances = chances(frame, sample, number);
        chances.iter().position(|&chance| chance < least).map_or(chances.len(), |last| last + 1)
    };
    let lights = (0..).zip(&sample.lights).filter(|(_, light)| light.has_shadows());
    lights.map(of_light).max().unwrap_or(0)
}

/// What receives or casts shadows at the sample of a group, with the object and buffer of each segment: opaque surfels,
/// Gaussians, and see-through surfels; of a job of see-through surfels, which draws no maps, those alone. Their slots
/// are numbers of casters.
pub(in crate::backend) fn caster_segments(job: &Job<'_>) -> Vec<(Segment, usize, usize)> {
    let prepared = job.place.prepared;
    let mut out = Vec::new();
    if !job.is_shadowed() {
        return out;
    }
    let sample = &job.group.samples[job.group.samples.len() / 2];
    let frame = prepared.frame;
    let visible = |is_static, see_through| frame.visible_surfels(sample, is_static, see_through);
    let takes_part = |(object, _): &(usize, &SurfelModel)| takes_part(&frame.objects[*object]);
    let others = !job.see_through;
    let opaque = visible(true, false).chain(visible(false, false)).filter(|_| others).map(|(object, _)| object);
    let veils = visible(true, true).chain(visible(false, true)).filter(takes_part).map(|(object, _)| object);
    let casts = |&at: &usize| others && sample.objects[at].visible && frame.casts_splats(&frame.objects[at]);
    let splats = (0..frame.objects.len()).filter(casts);
    let mut casters = 0;
    for object in opaque.chain(splats).chain(veils) {
        let (posed, of_frame) = (&sample.objects[object], &frame.objects[object]);
        let (template, buffers, slots) = match of_frame.drawn() {
            Some((gaussians, drawing)) => {
                let template = of_gaussians(posed, gaussians, drawing, sample.number as u32);
                let template = Segment { first_surfel: object as u32, ..template };
                (template, &prepared.gaussian_buffers[object], CASTERS_OF_GAUSSIAN)
            }
            None => (of_surfels(posed, of_frame), &prepared.surfel_buffers[object], 1),
        };
        let template = template.placed(posed, frame.place_of(object, sample));
        for (number, buffer) in buffers.iter().enumerate() {
            let surfels = buffer.surfels.len() as u32;
            let (buffer_surfels, buffer_start) = (surfels, buffer.surfels.start as u32);
            out.push((
                Segment { first_slot: casters, surfels, buffer_surfels, buffer_start, ..template },
                object,
                number,
            ));
            casters += slots as u32 * surfels;
        }
    }
    out
}

/// The flags that are set.
fn flags(all: &[(bool, u32)]) -> u32 {
    all.iter().filter(|(is_set, _)| *is_set).map(|(_, flag)| flag).sum()
}

/// The pose of surfels.
fn of_surfels(posed: &PosedObject, object: &FrameObject) -> Segment {
    let surfels = object.shape.surfels_or_none();
    let flags = flags(&[
        (object.receives, IS_RECEIVER),
        (object.material.is_none() && !surfels.material.is_empty(), HAS_MATERIALS),
        (!surfels.opacity.is_empty(), HAS_OPACITIES),
        (object.cast_shadows, CASTS),
        (object.see_through, SEE_THROUGH),
    ]);
    Segment { flags, ..Segment::posed(posed, object, surfels, 1, 1.0) }
}

/// The pose of Gaussians. What they do not share with surfels takes the places of what surfels alone have: the corners
/// of the crop box those of the rate, the number of the sample that of a light, and the object's that of a surfel.
fn of_gaussians(posed: &PosedObject, gaussians: &Gaussians, drawing: Drawing, number: u32) -> Segment {
    let [low, high] = drawing.crop.map_or([Vec3::MIN, Vec3::MAX], |crop| crop.map(DVec3::as_vec3));
    let volume = posed.world_from_model.determinant().abs();
    Segment {
        normal: rows(&Mat3::ZERO, Vec3::new(drawing.opacity as f32, volume, 0.0)),
        rate: [low, high, Vec3::ZERO].map(|corner| corner.extend(0.0).to_array()),
        flags: flags(&[(true, CASTS), (true, ARE_SPLATS), (gaussians.optics != Optics::Alpha, IS_VOLUME)]),
        first_light: number,
        ..Segment::zeroed()
    }
}
