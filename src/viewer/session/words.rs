//! What a page is told about a scene, and about each picture.

use std::time::Duration;

use super::super::camera::CameraAt;
use super::super::message::{AboutScene, Header};
use super::super::shared::Known;
use super::super::view::PageView;
use crate::film::Aov;
use crate::scene::Scene;
use crate::scene_file;
use crate::study::provenance::PROGRAM;

/// Parts of the shutter in the drawn time weight.
const CURVE: u32 = 64;

/// What a page has to know of a scene. `modes`: the grammar of modes.
pub(super) fn about(known: &Known, modes: &'static str) -> AboutScene {
    let scene = known.scene();
    AboutScene {
        name: scene.name.clone(),
        width: scene.image.width,
        height: scene.image.height,
        first: scene.frames.first,
        last: scene.frames.last,
        rate: scene.frames.rate,
        open: scene.shutter.open,
        close: scene.shutter.close,
        weight: scene.shutter.weight.to_string(),
        readout: scene.shutter.readout.to_string(),
        surfels: scene.objects.iter().map(|object| object.shape.elements() as u64).sum(),
        objects: scene.objects.len(),
        notes: known.loaded.notes.clone(),
        modes,
        program: PROGRAM,
    }
}

/// The header of a picture of `scene` that took `time` on `backend`. Its maker fills in the rest.
pub(super) fn header(view: &PageView, scene: &Scene, side: &'static str, backend: String, time: Duration) -> Header {
    let camera = CameraAt::of(scene, view.look.frame.get());
    let mut alone = scene.camera.clone();
    camera.place(&mut alone);
    let strata = scene.shutter.strata(CURVE, 0.5);
    Header {
        picture: 0,
        serial: view.serial,
        side,
        finished: false,
        width: 0,
        height: 0,
        mode: String::new(),
        backend,
        seconds: time.as_secs_f64(),
        error: None,
        note: None,
        buffer: view.look.buffer.map_or("colour", Aov::name),
        range: None,
        camera,
        line: scene_file::camera_line(&alone),
        curve: strata.into_iter().map(|(_, weight)| weight * f64::from(CURVE)).collect(),
    }
}
