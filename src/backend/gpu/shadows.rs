//! What the host says of the shadows of a group: how lights see, and what casts shadows.
//! Twin: `src/backend/cpu/shadows/`.

use bytemuck::Zeroable;

use super::job::Job;
use super::layout::{CaptureSegment, Light, Segment, harmonics, lights, rows};
use super::prepared::Prepared;
use crate::backend::cpu::shadows::fit::{Slice, margin, wanted};
use crate::backend::cpu::shadows::jitter;
use crate::backend::cpu::shadows::view::LightView;
use crate::frame::FrameObject;

/// The lights of the middle sample of a group, and then how those with shadows see, as `shaders/shadows/maps.wgsl` has
/// it: as many views of each. Then where held objects are, and the light of a whole sky for
/// shadow catchers. Nothing where no light has shadows.
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
        for face in 0..faces {
            let view = &views[face.min(views.len() - 1)];
            let (axes, origin) = view.pose();
            let is_point = f32::from(u8::from(view.is_point));
            let row = |i: usize, last: f32| axes.row(i).extend(last).to_array();
            out.push(Light { vector: row(0, x), colour: row(1, y) });
            out.push(Light { vector: row(2, is_point), colour: origin.extend(raster.size[1] as f32).to_array() });
            let slices = Slice::all(view, (&raster, margin), prepared.frame.near, sample.world_from_camera);
            out.extend(slices.iter().map(|slice| {
                // WGSL promises no infinity.
                let [x, y] = slice.bounds.map(|ends| ends.map(|end: f32| end.clamp(f32::MIN, f32::MAX)));
                Light { vector: [x[0], y[0], x[1], y[1]], colour: [slice.farthest, slice.start, margin, wants_all] }
            }));
        }
    }
    let [a, b, c] = [0, 1, 2].map(|i| sample.held.turn.row(i).extend(sample.held.shift[i]).to_array());
    out.extend([Light { vector: a, colour: b }, Light { vector: c, colour: [0.0; 4] }]);
    if let Some(terms) = sample.sky {
        out.extend(harmonics(&terms));
    }
    out
}

/// May shadows fall on captures?
pub(in crate::backend) fn shades_captures(prepared: &Prepared<'_>) -> bool {
    let receives = |object: &FrameObject| object.receives && object.drawn().is_some();
    let shadows = &prepared.schedule.shadows;
    shadows.lights > 0 && shadows.casters > 0 && prepared.frame.objects.iter().any(receives)
}

/// The captures on which shadows fall at the sample of a group, with the object and Gaussian buffer of each segment.
pub(in crate::backend) fn receiver_segments(job: &Job<'_>) -> Vec<(CaptureSegment, usize, usize)> {
    let prepared = job.place.prepared;
    let mut out = Vec::new();
    if job.see_through || !shades_captures(prepared) {
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

/// What casts shadows at the sample of a group: all opaque surfels, with the object and surfel buffer of each segment.
/// Their slots are numbers of casters.
pub(in crate::backend) fn caster_segments(job: &Job<'_>) -> Vec<(Segment, usize, usize)> {
    let prepared = job.place.prepared;
    let mut out = Vec::new();
    if !job.is_shadowed() {
        return out;
    }
    let sample = &job.group.samples[job.group.samples.len() / 2];
    let visible = |is_static| prepared.frame.visible_surfels(sample, is_static, false);
    let mut casters = 0;
    for (object, model) in visible(true).chain(visible(false)) {
        let (posed, of_frame) = (&sample.objects[object], &prepared.frame.objects[object]);
        let template = Segment::posed(posed, of_frame, model.surfels(), 1, 1.0);
        let template = template.placed(posed, prepared.frame.place_of(object, sample));
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
