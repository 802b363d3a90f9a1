//! The scene of one frame: sequences of point files become ordinary objects, and the camera has one field of view.

use std::borrow::Cow;

use super::pose::fovy;
use super::shape::{PointMotion, Shape};
use super::values::{Object, Scene};
use crate::model::{ModelError, VelocityUnit};

impl Scene {
    /// The scene as ordinary objects show it in frame `number`: sequences become the points of their files that the
    /// shutter touches. The field of view is that of the frame.
    ///
    /// # Errors
    /// A file cannot be read, or does not go with the one beside it.
    pub(crate) fn at_frame(&self, number: f64) -> Result<Cow<'_, Self>, ModelError> {
        if !self.objects.iter().any(|object| matches!(object.shape, Shape::Sequence { .. })) {
            return Ok(self.zoomed(number));
        }
        let mut objects = Vec::new();
        for object in &self.objects {
            objects.extend(self.parts(object, number)?);
        }
        Ok(Cow::Owned(Self { objects, ..self.zoomed(number).into_owned() }))
    }

    /// The scene with the field of view that keys of the camera give frame `number`.
    pub(super) fn zoomed(&self, number: f64) -> Cow<'_, Self> {
        let fovy = fovy(self, number);
        if fovy == self.camera.fovy {
            return Cow::Borrowed(self);
        }
        let mut scene = self.clone();
        scene.camera.fovy = fovy;
        Cow::Owned(scene)
    }

    /// The ordinary objects that show `object` in frame `number`: itself, or the parts of its sequence, one at least.
    ///
    /// # Errors
    /// A file cannot be read, or does not go with the one beside it.
    pub(super) fn parts(&self, object: &Object, number: f64) -> Result<Vec<Object>, ModelError> {
        let Shape::Sequence { files, unit, surface } = &object.shape else { return Ok(vec![object.clone()]) };
        // The picture of mode `still` is that of the frame's number.
        let [first, last] = self.shutter.whole_exposure(number);
        let [early, late] = self.shutter.readout.delays().map(|delay| number + delay);
        let exposure = [first.min(early).min(number), last.max(late).max(number)];
        let range = if object.blur { exposure } else { [number; 2] };
        let pieces = files.pieces(*unit, self.frames.rate, range)?;
        let shaped = |shape: Shape| Object { shape, ..object.clone() };
        if pieces.is_empty() {
            return Ok(vec![shaped(Shape::default())]);
        }
        let points = |at: f64| PointMotion { unit: Some(VelocityUnit::Frame), at: Some(at) };
        let surfels = |model, at| Shape::Surfels { model, points: points(at), surface: *surface };
        Ok(pieces.into_iter().map(|(model, at)| shaped(surfels(model, at))).collect())
    }
}
