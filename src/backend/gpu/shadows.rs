//! What the host says of the shadows of a group: how lights see, and what casts shadows.
//! Twin: `src/backend/cpu/shadows/`.

use super::job::Job;
use super::layout::{Light, Segment, lights};
use crate::backend::cpu::shadows::fit::Slice;
use crate::backend::cpu::shadows::jitter;
use crate::backend::cpu::shadows::view::LightView;

/// The lights of the middle sample of a group, and then how those with shadows see, as `shaders/shadows/maps.wgsl` has
/// it: as many views of each. Nothing where none has shadows.
pub(in crate::backend) fn light_views(job: &Job<'_>) -> Vec<Light> {
    let prepared = job.place.prepared;
    let faces = prepared.schedule.shadows.faces as usize;
    let sample = &job.group.samples[job.group.samples.len() / 2];
    // See-through surfels receive no shadows.
    if prepared.schedule.shadows.lights == 0 || job.see_through {
        return Vec::new();
    }
    let extent = prepared.extents.at(prepared.frame, sample);
    let mut out = lights(std::slice::from_ref(sample));
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
