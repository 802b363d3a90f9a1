//! Where a model is as one ray sees it.

use glam::{DMat4, DVec2, DVec3};

use crate::reference::posed::{BodyPose, CameraPose};

/// A model before the camera, and a ray in the model.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct ModelPlace {
    /// Rows of the transform from the model to the camera: right, down, forward.
    pub rows: [DVec3; 3],
    /// Place of the model's origin: right, down, forward.
    pub offset: DVec3,
    /// The eye in the model.
    pub eye: DVec3,
    /// Direction of camera depth 1 in the model.
    pub direction: DVec3,
}

impl ModelPlace {
    /// `direction` is that of the ray in camera space, of depth 1.
    pub(in crate::reference) fn new(pose: &BodyPose, camera: &CameraPose, direction: DVec3) -> Self {
        let axes = camera.world_from_camera;
        let rows = [axes.x_axis, -axes.y_axis, -axes.z_axis];
        let place = pose.world_from_model.translation - camera.eye;
        let turned = pose.world_from_model.matrix3.transpose();
        Self {
            rows: rows.map(|row| turned * row),
            offset: DVec3::from_array(rows.map(|row| row.dot(place))),
            eye: pose.model_from_world * -place,
            direction: pose.model_from_world * (axes * direction),
        }
    }

    /// Velocity of a point of the model on the film, tangents per shutter, x right, y down; `rate` is the change of
    /// `camera_from_model` per shutter.
    pub(in crate::reference) fn velocity(&self, p: DVec3, rate: &DMat4) -> DVec2 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.rows[axis].dot(p) + self.offset[axis]);
        let v = rate.transform_vector3(p) + rate.w_axis.truncate();
        let (dx, dy, dz) = (v.x, -v.y, -v.z);
        DVec2::new(dx - x / z * dz, dy - y / z * dz) / z
    }
}
