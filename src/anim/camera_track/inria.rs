//! `cameras.json` beside 3D Gaussian captures: camera to world, rotations by rows, axes of `OpenCV`, principal point in
//! the middle.

use glam::DVec3;
use serde::Deserialize;

use super::{Fault, Lens, Pose, fault, of_open_cv, rotation};

#[derive(Deserialize)]
struct Camera {
    #[serde(default)]
    img_name: String,
    width: f64,
    height: f64,
    position: [f64; 3],
    rotation: [[f64; 3]; 3],
    fx: f64,
    fy: f64,
}

pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Pose>, Fault> {
    let cameras: Vec<Camera> = serde_json::from_slice(bytes).map_err(|e| fault("", e.to_string(), "a cameras.json"))?;
    let pose = |(i, camera): (usize, Camera)| {
        let name = if camera.img_name.is_empty() { format!("camera {i}") } else { camera.img_name };
        let turn = rotation(camera.rotation)
            .ok_or_else(|| fault(&name, "a `rotation` that scales or mirrors", "a rotation"))?;
        let size = [camera.width, camera.height];
        let principal = size.map(|x| 0.5 * x);
        let lens = Lens { size, focal: [camera.fx, camera.fy], principal, distortion: Vec::new() };
        let position = DVec3::from_array(camera.position);
        Ok(Pose { name, time: None, position, rotation: of_open_cv(turn), lens: Some(lens) })
    };
    cameras.into_iter().enumerate().map(pose).collect()
}
