//! Where things are at a time: scene and frame time to transforms.

use glam::{DAffine3, DMat3, DMat4, DVec3};

use crate::anim::{CameraPath, NodeMotion};
use crate::math::{norm, rotation};
use crate::scene::{AnimationBinding, Camera, Motion, Object, Scene};

/// An object at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectPose {
    /// Model space to world space.
    pub world_from_model: DMat4,
    /// False where the animation hides the object.
    pub visible: bool,
}

/// World-space pose of an object at scene time `frame_time` (frames).
pub fn object_pose(scene: &Scene, object: &Object, frame_time: f64) -> ObjectPose {
    let mut m = object.transform.matrix();
    let mut visible = true;
    if let Some(binding) = &object.animation {
        let pose = binding.node.at(seconds(scene, frame_time), binding.interpolation);
        visible = pose.visible;
        m = pose.matrix * m;
    }
    for motion in &object.motions {
        m = motion_matrix(motion, frame_time) * m;
    }
    ObjectPose { world_from_model: object.place.matrix() * m, visible: visible && object.exists(frame_time) }
}

/// [`object_pose`] for many times: the constant parts are computed once.
#[derive(Clone, Debug)]
pub struct ObjectPoser<'a> {
    scene: &'a Scene,
    object: &'a Object,
    transform: DAffine3,
    /// `None` where it changes nothing.
    place: Option<DAffine3>,
}

impl<'a> ObjectPoser<'a> {
    /// For an object of `scene`.
    pub fn new(scene: &'a Scene, object: &'a Object) -> Self {
        let place = DAffine3::from_mat4(object.place.matrix());
        let place = (place != DAffine3::IDENTITY).then_some(place);
        Self { scene, object, transform: DAffine3::from_mat4(object.transform.matrix()), place }
    }

    /// `world_from_model` at scene time `frame_time` (frames), as far as rounding the same as [`object_pose`]'s; `None`
    /// where the animation hides the object.
    pub fn at(&self, frame_time: f64) -> Option<DAffine3> {
        if !self.object.exists(frame_time) {
            return None;
        }
        let mut m = self.transform;
        if let Some(binding) = &self.object.animation {
            let pose = binding.node.at(seconds(self.scene, frame_time), binding.interpolation);
            if !pose.visible {
                return None;
            }
            m = DAffine3::from_mat4(pose.matrix) * m;
        }
        for motion in &self.object.motions {
            match *motion {
                Motion::Linear { velocity } => m.translation += velocity * frame_time,
                Motion::Rotation { .. } => m = DAffine3::from_mat4(motion_matrix(motion, frame_time)) * m,
            }
        }
        Some(self.place.map_or(m, |place| place * m))
    }

    /// A sphere in the world that holds the model's sphere at all scene times from `from` to `to` (frames) at which the
    /// object is visible; `None` if none is known.
    ///
    /// The distance |x(t) - x(m)| of the centre x from its place at mid-time m is bounded motion by motion. For a fixed
    /// x, an animation T R S gives at most |T(t) - T(m)| + |R(t) - R(m)| |S(t) x| + |S(t) - S(m)| |x|. A linear motion
    /// adds |v (t - m)|, and a rotation by w per frame about q adds |w (t - m)| |x(m) - q|.
    pub fn swept_sphere(&self, centre: DVec3, radius: f64, from: f64, to: f64) -> Option<(DVec3, f64)> {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let mut x = self.transform.transform_point3(centre);
        let mut radius = radius * norm(&self.transform.matrix3);
        let mut drift = 0.0;
        if let Some(binding) = &self.object.animation {
            let times = [from, middle, to].map(|time| seconds(self.scene, time));
            (x, radius, drift) = binding.node.sweep(x, radius, times, binding.interpolation)?;
        }
        for motion in &self.object.motions {
            match *motion {
                Motion::Linear { velocity } => drift += velocity.length() * half,
                Motion::Rotation { per_frame, centre, .. } => drift += (per_frame * half).abs() * (x - centre).length(),
            }
            x = motion_matrix(motion, middle).transform_point3(x);
        }
        if let Some(place) = &self.place {
            x = place.transform_point3(x);
            let norm = norm(&place.matrix3);
            (radius, drift) = (radius * norm, drift * norm);
        }
        Some((x, radius + drift))
    }

    /// True if the pose does not depend on time.
    pub fn is_fixed(&self) -> bool {
        self.object.is_fixed()
    }
}

/// Rigid transform from world space to camera space (-z forward, +y up) at scene time `frame_time` (frames).
pub fn camera_from_world(scene: &Scene, frame_time: f64) -> DMat4 {
    let camera = &scene.camera;
    let at_rest = camera.animation.as_ref().map_or_else(
        || look_at(camera),
        |binding| {
            let seconds = seconds(scene, frame_time);
            // Scale on a camera node means nothing: only its axes and position count.
            rigid_inverse(&match path(scene) {
                Some(path) => path.at(seconds, target(scene, path, frame_time)),
                None => binding.node.rigid_at(seconds, binding.interpolation),
            })
        },
    );
    camera.motions.iter().fold(at_rest, |view, motion| view * rigid_inverse(&motion_matrix(motion, frame_time)))
}

/// The path that the camera flies.
fn path(scene: &Scene) -> Option<&CameraPath> {
    match &scene.camera.animation.as_ref()?.node {
        NodeMotion::Path(path) => Some(path),
        NodeMotion::Curves(_) | NodeMotion::Chain(_) | NodeMotion::Track(_) => None,
    }
}

/// The object that the camera's path looks at.
fn target_object<'a>(scene: &'a Scene, path: &CameraPath) -> Option<&'a Object> {
    let name = &path.target.as_ref()?.object;
    scene.objects.iter().find(|object| object.name == *name)
}

/// Where that object's middle is at scene time `frame_time` (frames).
fn target(scene: &Scene, path: &CameraPath, frame_time: f64) -> Option<DVec3> {
    let centre = path.target.as_ref()?.centre;
    let pose = object_pose(scene, target_object(scene, path)?, frame_time);
    Some(pose.world_from_model.transform_point3(centre)).filter(|place| place.is_finite())
}

/// Vertical field of view of frame `number`, radians. It is that of the frame's number for the whole exposure.
pub fn fovy(scene: &Scene, number: f64) -> f64 {
    path(scene).map_or(scene.camera.fovy, |path| path.fovy(seconds(scene, number)))
}

/// What moves the camera: its animation, and that of the object that its path looks at.
fn of_camera(scene: &Scene) -> impl Iterator<Item = &AnimationBinding> {
    let target = path(scene).and_then(|path| target_object(scene, path));
    scene.camera.animation.as_ref().into_iter().chain(target.and_then(|object| object.animation.as_ref()))
}

fn seconds(scene: &Scene, frame_time: f64) -> f64 {
    frame_time / scene.frames.rate
}

fn motion_matrix(motion: &Motion, frame_time: f64) -> DMat4 {
    match *motion {
        Motion::Linear { velocity } => DMat4::from_translation(velocity * frame_time),
        Motion::Rotation { axis, per_frame, centre } => {
            let r = rotation(axis, per_frame * frame_time);
            DMat4::from_mat3_translation(r, centre - r * centre)
        }
    }
}

fn look_at(camera: &Camera) -> DMat4 {
    let back = (camera.eye - camera.at).normalize();
    let right = camera.up.cross(back).normalize();
    let up = back.cross(right);
    rigid_inverse(&DMat4::from_mat3_translation(DMat3::from_cols(right, up, back), camera.eye))
}

/// Inverse of a rotation and translation.
fn rigid_inverse(m: &DMat4) -> DMat4 {
    let r = DMat3::from_mat4(*m).transpose();
    DMat4::from_mat3_translation(r, -(r * m.w_axis.truncate()))
}

/// Time derivative, per shutter, of `camera_from_model` at scene time `frame_time` (frames).
///
/// A central difference over 1/256 of the shutter, one-sided where an animation jumps inside that span, so that nothing
/// streaks through a teleport; zero between two jumps.
pub fn object_velocity(scene: &Scene, object: &Object, frame_time: f64) -> DMat4 {
    let span = scene.shutter.close - scene.shutter.open;
    let step = span / 512.0;
    let jumps = |from: f64, to: f64| {
        object.animation.iter().chain(of_camera(scene)).any(|binding| {
            !binding.node.breaks(seconds(scene, from), seconds(scene, to), binding.interpolation).is_empty()
        })
    };
    let from = if jumps(frame_time - step, frame_time) { frame_time } else { frame_time - step };
    let to = if jumps(frame_time, frame_time + step) { frame_time } else { frame_time + step };
    if to <= from {
        return DMat4::ZERO;
    }
    let at = |time: f64| camera_from_world(scene, time) * object_pose(scene, object, time).world_from_model;
    (at(to) - at(from)) * (span / (to - from))
}

/// Most jumps that an exposure is split at. No shutter needs more, and a hostile animation must not make any number of
/// intervals.
const MOST_JUMPS: usize = 1024;

/// Scene times within (`from`, `to`), rising, frames, at which something that blurs jumps: a step key, the seam of a
/// cycle, a change of visibility. Those beyond the first 1024 are left out.
pub fn jumps(scene: &Scene, from: f64, to: f64) -> Vec<f64> {
    let objects = scene.objects.iter().filter(|object| object.blur).filter_map(|object| object.animation.as_ref());
    let mut times: Vec<f64> = objects
        .chain(of_camera(scene))
        .flat_map(|binding| binding.node.breaks(seconds(scene, from), seconds(scene, to), binding.interpolation))
        .map(|time| time * scene.frames.rate)
        .collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    times.truncate(MOST_JUMPS);
    times
}

/// Scene times within (`from`, `to`), frames, at which a pose jumps or an object that blurs begins or ceases to be
/// there, rising.
pub fn cuts(scene: &Scene, from: f64, to: f64) -> Vec<f64> {
    let mut times = jumps(scene, from, to);
    times.extend(seams(scene, from, to));
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// Scene times within (`from`, `to`), frames, at which objects that blur begin or cease to be there.
fn seams(scene: &Scene, from: f64, to: f64) -> Vec<f64> {
    let windows = scene
        .objects
        .iter()
        .filter(|object| object.blur)
        .filter_map(|object| object.piece())
        .flat_map(|piece| piece.window);
    windows.filter(|&time| from < time && time < to).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_looks_along_minus_z_with_y_up() {
        let camera = Camera::new(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, -7.0));
        let m = look_at(&camera);
        let p = m.transform_point3(DVec3::new(1.5, 2.25, -1.0));
        assert!((p - DVec3::new(0.5, 0.25, -4.0)).length() < 1e-12, "{p}");
    }

    #[test]
    fn motions_turn_about_their_centre_and_start_at_frame_0() {
        let turn = Motion::Rotation {
            axis: DVec3::Y,
            per_frame: std::f64::consts::FRAC_PI_2,
            centre: DVec3::new(1.0, 0.0, 0.0),
        };
        assert_eq!(motion_matrix(&turn, 0.0), DMat4::IDENTITY);
        let p = motion_matrix(&turn, 1.0).transform_point3(DVec3::new(2.0, 5.0, 0.0));
        assert!((p - DVec3::new(1.0, 5.0, -1.0)).length() < 1e-12, "{p}");
        let go = Motion::Linear { velocity: DVec3::new(0.5, 0.0, -1.0) };
        assert_eq!(motion_matrix(&go, 4.0).transform_point3(DVec3::ZERO), DVec3::new(2.0, 0.0, -4.0));
    }
}
