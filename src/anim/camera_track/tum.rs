//! Trajectories of the RGB-D benchmark of TUM: `timestamp tx ty tz qx qy qz qw` a line, camera to world, w last, axes
//! of `OpenCV`, seconds.

use glam::DVec3;

use super::text::{is_comment, lines, numbers};
use super::{Fault, Pose, fault, of_open_cv, quaternion};

pub(super) fn parse(bytes: &[u8]) -> Result<Vec<Pose>, Fault> {
    let mut poses = Vec::new();
    for (line, words) in lines(bytes) {
        if words.is_empty() || is_comment(&words) {
            continue;
        }
        let [time, tx, ty, tz, qx, qy, qz, qw] = numbers(line, &words, 0)?;
        let name = format!("line {line}");
        let rotation =
            quaternion(qx, qy, qz, qw).ok_or_else(|| fault(&name, "a quaternion of length 0", "a rotation"))?;
        let position = DVec3::new(tx, ty, tz);
        poses.push(Pose { name, time: Some(time), position, rotation: of_open_cv(rotation), lens: None });
    }
    Ok(poses)
}
