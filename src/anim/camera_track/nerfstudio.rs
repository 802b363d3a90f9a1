//! `transforms.json`: camera to world, axes of OpenGL, which are ours. Numbers of a frame win over those at the top.

use glam::DVec3;
use serde::Deserialize;

use super::{Fault, Lens, Pose, fault, rotation};

#[derive(Deserialize)]
struct File {
    frames: Vec<Frame>,
    #[serde(flatten)]
    lens: Numbers,
}

#[derive(Deserialize)]
struct Frame {
    #[serde(default)]
    file_path: String,
    transform_matrix: Vec<Vec<f64>>,
    #[serde(flatten)]
    lens: Numbers,
}

#[derive(Clone, Default, Deserialize)]
#[serde(default)]
struct Numbers {
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    camera_angle_x: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    camera_model: Option<String>,
}

pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Pose>, Fault> {
    let file: File = serde_json::from_slice(bytes).map_err(|e| fault("", e.to_string(), "a transforms.json"))?;
    let pose = |(i, frame): (usize, &Frame)| {
        let place = if frame.file_path.is_empty() { format!("frame {i}") } else { frame.file_path.clone() };
        let m = &frame.transform_matrix;
        let is_matrix = matches!(m.len(), 3 | 4) && m.iter().all(|row| row.len() == 4);
        if !is_matrix {
            return Err(fault(&place, "another `transform_matrix`", "4 rows of 4 numbers"));
        }
        let rows = [0, 1, 2].map(|row| [m[row][0], m[row][1], m[row][2]]);
        let turn = rotation(rows)
            .ok_or_else(|| fault(&place, "a `transform_matrix` that scales or mirrors", "a rotation and a place"))?;
        let position = DVec3::new(m[0][3], m[1][3], m[2][3]);
        let lens = frame.lens.over(&file.lens);
        Ok(Pose { name: place, time: None, position, rotation: turn, lens })
    };
    file.frames.iter().enumerate().map(pose).collect()
}

impl Numbers {
    /// The lens, by the numbers of `other` where its own are missing; `None` without a size or a focal length.
    fn over(&self, other: &Self) -> Option<Lens> {
        let of = |get: fn(&Self) -> Option<f64>| get(self).or_else(|| get(other));
        let size = [of(|n| n.w)?, of(|n| n.h)?];
        let by_angle = of(|n| n.camera_angle_x).map(|angle| 0.5 * size[0] / libm::tan(0.5 * angle));
        let fx = of(|n| n.fl_x).or(by_angle)?;
        let fy = of(|n| n.fl_y).unwrap_or(fx);
        let principal = [of(|n| n.cx).unwrap_or(0.5 * size[0]), of(|n| n.cy).unwrap_or(0.5 * size[1])];
        let coefficients: [(&'static str, Option<f64>); 6] = [
            ("k1", of(|n| n.k1)),
            ("k2", of(|n| n.k2)),
            ("k3", of(|n| n.k3)),
            ("k4", of(|n| n.k4)),
            ("p1", of(|n| n.p1)),
            ("p2", of(|n| n.p2)),
        ];
        let set = |(name, k): (&'static str, Option<f64>)| Some((name, k.filter(|&k| k != 0.0)?));
        let mut distortion: Vec<_> = coefficients.into_iter().filter_map(set).collect();
        // Its projection is another one, whatever the coefficients.
        let model = self.camera_model.as_ref().or(other.camera_model.as_ref());
        if model.is_some_and(|model| model.contains("FISHEYE") || model.contains("EQUIRECTANGULAR")) {
            distortion.push(("fisheye", 1.0));
        }
        Some(Lens { size, focal: [fx, fy], principal, distortion })
    }
}
