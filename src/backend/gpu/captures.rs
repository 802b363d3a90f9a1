//! How the Gaussians of a group are cut up: a run for each buffer that holds some.

use super::prepared::Prepared;
use crate::frame::PosedGroup;
use crate::model::Gaussians;
use crate::scene::Drawing;

/// The Gaussians of one buffer, in a group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run<'a> {
    pub object: usize,
    pub gaussians: &'a Gaussians,
    pub drawing: Drawing,
    pub buffer: usize,
    pub count: u32,
    pub first_slot: u32,
    pub first_index: u32,
}

/// The Gaussians of the objects that are visible at some sample, in document order, and their number.
pub(super) fn runs<'a>(prepared: &Prepared<'a>, group: &PosedGroup) -> (Vec<Run<'a>>, u32) {
    let mut runs = Vec::new();
    let (mut slots, mut all) = (0_u32, 0_u32);
    for (object, buffers) in prepared.gaussian_buffers.iter().enumerate() {
        let Some((gaussians, drawing)) = prepared.frame.objects[object].drawn() else { continue };
        let visible = group.samples.iter().any(|sample| sample.objects[object].visible);
        for (buffer, of_buffer) in buffers.iter().enumerate() {
            let count = of_buffer.surfels.len() as u32;
            if visible {
                runs.push(Run { object, gaussians, drawing, buffer, count, first_slot: slots, first_index: all });
                slots += count;
            }
            all += count;
        }
    }
    (runs, slots)
}
