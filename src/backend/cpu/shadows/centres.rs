//! The Gaussians of captures and lit volumes, as what receives shadows: each at its centre.

use std::ops::Range;

use glam::Vec3;

use crate::frame::{Frame, PosedObject, PosedSample};
use crate::model::Gaussians;

/// Gaussians that are looked at together.
const RUN: usize = 4096;
/// Standard deviations beyond which nothing is seen of a Gaussian: alpha is below 1/255 there, and its affine image
/// beside the picture is up to 1.3 times as large as itself.
pub(in crate::backend) const REACH_OF_CENTRE: f32 = 4.5;

/// Some Gaussians of a capture at a time sample.
pub(super) struct Centres<'a> {
    posed: &'a PosedObject,
    gaussians: &'a Gaussians,
    range: Range<usize>,
    /// Factor on standard deviations, at the most.
    stretch: f32,
    /// Distance of the farthest corner of the capture's box from the eye.
    farthest: f32,
}

impl<'a> Centres<'a> {
    /// The centres of all captures and volumes on which shadows fall, as far as they are visible.
    pub(super) fn all(frame: &'a Frame, sample: &'a PosedSample) -> Vec<Self> {
        let mut all = Vec::new();
        for (object, posed) in frame.objects.iter().zip(&sample.objects) {
            let Some((gaussians, _)) = object.drawn().filter(|_| object.receives && posed.visible) else { continue };
            let linear = posed.world_from_model;
            let columns = [linear.x_axis, linear.y_axis, linear.z_axis].map(Vec3::length_squared);
            let corners = object.shape.bounds().corners();
            let lengths = corners.map(|corner| (linear * corner.as_vec3() + posed.world_origin).length());
            let (stretch, farthest) = (columns.iter().sum::<f32>().sqrt(), lengths.into_iter().fold(0.0, f32::max));
            let ranges = (0..gaussians.len()).step_by(RUN).map(|from| from..(from + RUN).min(gaussians.len()));
            all.extend(ranges.map(|range| Self { posed, gaussians, range, stretch, farthest }));
        }
        all
    }

    /// How far from the eye the capture reaches.
    pub(super) const fn extent(&self) -> f32 {
        self.farthest
    }

    /// Each centre, relative to the eye in world axes, with a radius within which the Gaussian is seen.
    pub(super) fn each(&self) -> impl Iterator<Item = (Vec3, f32)> {
        let posed = self.posed;
        self.range.clone().map(move |i| {
            let place = posed.world_from_model * self.gaussians.position[i] + posed.world_origin;
            (place, REACH_OF_CENTRE * self.stretch * self.gaussians.sigma[i].max_element())
        })
    }
}
