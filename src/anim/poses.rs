//! A motion that a program has as poses at times.

use glam::{DMat4, DQuat, DVec3, DVec4};

use super::chain::{Chain, Joint};
use super::track::{Between, Property, Track};
use crate::limits::{self, Invalid};

/// Greatest part of a matrix that is neither translation, rotation nor scale, as a share of its largest axis.
const SHEAR: f64 = 1e-6;

/// A pose in parts.
#[derive(Clone, Copy)]
struct Parts {
    scale: DVec3,
    rotation: DQuat,
    translation: DVec3,
}

impl Chain {
    /// A motion through poses at times, in frames, of a scene with `rate` frames per second.
    ///
    /// # Errors
    /// There is no pose, or not one for each time; times do not rise; a value is out of its bounds; a matrix is
    /// singular or has a shear or a perspective; some mirror and some do not.
    pub(crate) fn through(rate: f64, frames: &[f64], poses: &[DMat4]) -> Result<Self, Invalid> {
        limits::RATE.check("rate", rate)?;
        if frames.is_empty() || frames.len() != poses.len() {
            let found = format!("{} for {} times", poses.len(), frames.len());
            return Err(Invalid::new("poses", found, "one or more, as many as times"));
        }
        for (i, &frame) in frames.iter().enumerate() {
            limits::FRAME.check(&format!("frames[{i}]"), frame)?;
        }
        if let Some(i) = frames.windows(2).position(|pair| pair[1] <= pair[0]) {
            let expected = format!("more than {}, the time before", frames[i]);
            return Err(Invalid::new(&format!("frames[{}]", i + 1), frames[i + 1], expected));
        }
        let parts: Vec<Parts> = poses
            .iter()
            .enumerate()
            .map(|(i, pose)| {
                parts(pose).map_err(|(found, expected)| Invalid::new(&format!("poses[{i}]"), found, expected))
            })
            .collect::<Result<_, _>>()?;
        // Between a pose that mirrors and one that does not, the node would be flat.
        if let Some(i) = parts.iter().position(|pose| pose.mirrors() != parts[0].mirrors()) {
            let (found, expected) = if parts[i].mirrors() {
                ("a matrix that mirrors, where the first does not", "one that does not mirror")
            } else {
                ("a matrix that does not mirror, where the first does", "one that mirrors")
            };
            return Err(Invalid::new(&format!("poses[{i}]"), found, expected));
        }
        let times: Vec<f64> = frames.iter().map(|frame| frame / rate).collect();
        let track = |property, value: &dyn Fn(&Parts) -> DVec4| {
            let values: Vec<DVec4> = parts.iter().map(value).collect();
            Track { property, between: Between::Linear, times: times.clone().into(), values: values.into() }
        };
        let mut tracks = vec![
            track(Property::Translation, &|pose| pose.translation.extend(0.0)),
            track(Property::Rotation, &|pose| DVec4::from(pose.rotation)),
        ];
        let first = parts[0];
        // Rounding alone is no change of scale: it would cost the bounds of cameras and objects their tightness.
        if parts.iter().any(|pose| !pose.scale.abs_diff_eq(first.scale, 1e-12 * first.scale.abs().max_element())) {
            tracks.push(track(Property::Scale, &|pose| pose.scale.extend(0.0)));
        }
        let Parts { scale, rotation, translation } = first;
        Ok(Self {
            label: String::new(),
            fps: rate,
            looped: false,
            unused: Vec::new(),
            period: times.last().map_or(0.0, |last| last.max(0.0)),
            joints: vec![Joint::Moving { scale, rotation, translation, tracks }],
        })
    }
}

impl Parts {
    /// Does it turn left hands into right ones?
    fn mirrors(&self) -> bool {
        self.scale.x * self.scale.y * self.scale.z < 0.0
    }
}

/// The parts of a matrix, or what it is and what it should be.
fn parts(matrix: &DMat4) -> Result<Parts, (String, String)> {
    let text = |found: &str| found.to_owned();
    if !matrix.to_cols_array().iter().all(|x| x.abs() <= limits::FAR) {
        return Err((
            text("a matrix with numbers that are not finite or too large"),
            text("numbers from -1e30 to 1e30"),
        ));
    }
    if matrix.row(3) != DVec4::W {
        return Err((format!("a matrix with the last row {}", matrix.row(3)), text("0, 0, 0, 1")));
    }
    let lengths = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec4::length);
    let largest = lengths.into_iter().fold(0.0, f64::max);
    let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
    if !(limits::is_scale(scale) && rotation.is_finite()) {
        let limits::Range(least, most) = limits::SCALE;
        return Err((format!("a matrix with axes {lengths:?} long"), format!("lengths from {least:e} to {most:e}")));
    }
    let rotation = rotation.normalize();
    let again = DMat4::from_scale_rotation_translation(scale, rotation, translation);
    let off = (again - *matrix).to_cols_array().into_iter().take(12).fold(0.0_f64, |most, x| most.max(x.abs()));
    if off > SHEAR * largest {
        return Err((
            text("a matrix with a shear, or without a volume"),
            text("translation, rotation and scale alone"),
        ));
    }
    Ok(Parts { scale, rotation, translation })
}
