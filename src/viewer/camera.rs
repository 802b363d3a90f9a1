//! The camera between the page, which turns it, and the scene.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::anim::PathKey;
use crate::scene::pose::{camera_from_world, fovy};
use crate::scene::{Camera, Scene};

/// A camera at rest, in the words of a scene file. Lengths are scene units, the field of view is in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraAt {
    eye: [f64; 3],
    at: [f64; 3],
    up: [f64; 3],
    fovy: f64,
}

impl CameraAt {
    /// Fields of view, degrees.
    const FOVY: std::ops::RangeInclusive<f64> = 0.1..=170.0;
    /// Largest coordinate, scene units.
    const FAR: f64 = 1e12;

    /// The scene's camera at frame `frame`. A camera in motion looks at a point as deep as the middle of the objects.
    pub(super) fn of(scene: &Scene, frame: f64) -> Self {
        let Camera { eye, at, up, .. } = scene.camera;
        let fovy = fovy(scene, frame).to_degrees();
        if scene.camera.rests() {
            return Self { eye: eye.into(), at: at.into(), up: up.into(), fovy };
        }
        let world_from_camera = camera_from_world(scene, frame).inverse();
        let [eye, ahead] = [DVec3::ZERO, DVec3::NEG_Z].map(|point| world_from_camera.transform_point3(point));
        let ahead = (ahead - eye).normalize_or(DVec3::NEG_Z);
        let depth = (middle(scene) - eye).dot(ahead);
        let depth = if depth > scene.camera.near { depth } else { 1.0 };
        let up = world_from_camera.transform_vector3(DVec3::Y);
        Self { eye: eye.into(), at: (eye + ahead * depth).into(), up: up.into(), fovy }
    }

    /// The fault of this camera; `None`: it can look.
    pub(super) fn fault(&self) -> Option<String> {
        let [eye, at, up] = self.vectors();
        let ahead = at - eye;
        if [eye, at, up].iter().any(|v| !v.is_finite() || v.abs().max_element() > Self::FAR) {
            Some(format!("the camera's coordinates must be finite numbers up to {:e}", Self::FAR))
        } else if ahead.length() < 1e-9 {
            Some("the camera looks at its own eye".to_owned())
        } else if up.cross(ahead).length() <= 1e-9 * up.length() * ahead.length() {
            Some("the camera's up is along its view".to_owned())
        } else if !Self::FOVY.contains(&self.fovy) {
            Some(format!("fovy is {}, must be from {} to {}", self.fovy, Self::FOVY.start(), Self::FOVY.end()))
        } else {
            None
        }
    }

    fn vectors(&self) -> [DVec3; 3] {
        [self.eye, self.at, self.up].map(DVec3::from)
    }

    /// This view as a key of a path.
    pub(super) fn key(&self, frame: f64) -> PathKey {
        let [eye, at, up] = self.vectors();
        PathKey { frame, eye, at, up, fovy: self.fovy.to_radians() }
    }

    /// The scene's camera, put here and at rest.
    pub(super) fn place(&self, camera: &mut Camera) {
        [camera.eye, camera.at, camera.up] = self.vectors();
        camera.fovy = self.fovy.to_radians();
        camera.animation = None;
        camera.motions.clear();
        camera.automatic = false;
    }
}

/// The middle of the box around all objects before they move; the origin of a scene without any.
pub(super) fn middle(scene: &Scene) -> DVec3 {
    let mut sum = DVec3::ZERO;
    let mut count = 0.0;
    for object in &scene.objects {
        let bounds = object.shape.core();
        let centre = 0.5 * (bounds.min + bounds.max);
        if centre.is_finite() {
            let matrix = object.place.matrix() * object.transform.matrix();
            sum += matrix.transform_point3(centre);
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { sum }
}
