//! Which objects are static during the exposure, so that a backend can splat them once for the time samples of a
//! position.

use glam::{DVec2, DVec3, Vec3};

use super::{PosedObject, PosedRaster, PosedSample};
use crate::math::focal_length;
use crate::options::{BlurMode, KernelShape};
use crate::scene::pose::{camera_from_world, object_pose};
use crate::scene::{Object, Scene};

/// Longest path over the screen during the exposure of an object that counts as static, pixels.
pub const STATIC_PATH: f32 = 0.25;

/// Fewest sub-pixel positions that time samples share. What moves may want more (docs/measurements/prefilter.md).
const SHARED_POSITIONS: u32 = 8;

/// Most time samples that share a position.
const MOST_SHARING: u32 = 4;

/// The least share of the image with static objects that makes sharing worth while.
const SHARED_PART: f64 = 1.0 / 3.0;

/// The same mode with sub-pixel positions, where nobody chose them.
///
/// Where much of the image is static, time samples share positions, so that a backend may splat what is static once
/// for each. All positions have equally many samples. Intervals of tubes see the pixel's middle, so that no part of a
/// streak is shifted; where much of the image is static there are several positions, as edges at rest need them
/// (docs/measurements/prefilter.md). Buckets have a position each: the pixel's middle with its filter was behind that
/// in each scene that was tried (docs/measurements/modes.md).
pub(super) fn with_positions(scene: &Scene, mode: BlurMode) -> BlurMode {
    match mode {
        BlurMode::Volumetric { intervals, pixel_samples: None, swept } if swept.shape == KernelShape::Tube => {
            let several = all_rests(scene) || shows_much_rest(scene);
            BlurMode::Volumetric {
                intervals,
                pixel_samples: Some(if several { SHARED_POSITIONS.max(intervals) } else { 1 }),
                swept,
            }
        }
        BlurMode::Supersample { samples, pixel_samples: None, interleave, times } if shows_much_rest(scene) => {
            // As more samples are asked for, what is static converges, too.
            let least = SHARED_POSITIONS.max(samples.div_ceil(MOST_SHARING));
            let pixel_samples = shared_positions(least, samples, 1);
            BlurMode::Supersample { samples, pixel_samples, interleave, times }
        }
        _ => mode,
    }
}

/// The fewest sub-pixel positions that `samples` share: `least` or a multiple of `step` more, fewer than the samples,
/// and all with equally many of them. A position with more samples than others would count for more.
pub fn shared_positions(least: u32, samples: u32, step: usize) -> Option<u32> {
    (least..samples).step_by(step).find(|positions| samples.is_multiple_of(*positions))
}

/// Does something move while much of the image is static, so that time samples should share sub-pixel positions?
/// Objects at rest count by the rectangles around them.
pub fn shows_much_rest(scene: &Scene) -> bool {
    let fixed = |object: &&Object| rests(object) && !object.is_see_through() && object.shape.surfels().is_some();
    let area: f64 = scene.objects.iter().filter(fixed).map(|object| area(scene, object)).sum();
    scene.camera.rests() && area >= SHARED_PART && !all_rests(scene)
}

/// Does nothing move?
pub fn all_rests(scene: &Scene) -> bool {
    scene.camera.rests() && scene.objects.iter().all(rests)
}

/// Does the object rest, and do its points not move by themselves?
fn rests(object: &Object) -> bool {
    object.is_fixed() && object.shape.surfels().is_none_or(|model| model.paths().is_empty())
}

/// Share of the image within the rectangle around a fixed object's box; all of it where the box reaches the camera.
fn area(scene: &Scene, object: &Object) -> f64 {
    let time = scene.frames.first as f64;
    let view_from_model = camera_from_world(scene, time) * object_pose(scene, object, time).world_from_model;
    let size = DVec2::new(scene.image.width.into(), scene.image.height.into());
    let focal = focal_length(size.y, scene.camera.fovy);
    let shift = scene.camera.shift * DVec2::new(1.0, -1.0);
    let mut ends = [DVec2::INFINITY, DVec2::NEG_INFINITY];
    for corner in object.shape.bounds().corners() {
        let place = view_from_model.transform_point3(corner);
        if -place.z < scene.camera.near {
            return 1.0;
        }
        let at = (place.truncate() * (focal / -place.z) / size + shift).clamp(DVec2::splat(-0.5), DVec2::splat(0.5));
        ends = [ends[0].min(at), ends[1].max(at)];
    }
    let [width, height] = (ends[1] - ends[0]).max(DVec2::ZERO).to_array();
    width * height
}

/// How far an object moves over the screen during the exposure.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Movement {
    /// All its poses are the same, or it is never seen.
    Rests,
    /// Its path is shorter than [`STATIC_PATH`].
    Short,
    /// All else.
    Moves,
}

/// Whether each object is static. Surfels whose path is shorter than [`STATIC_PATH`] are held at their pose of
/// mid-exposure, in all samples of `rasters`; a capture is static where its pose never changes.
///
/// `stride` and `near` are the frame's.
pub(super) fn hold_static(scene: &Scene, rasters: &mut [PosedRaster], stride: u32, near: f32) -> Vec<bool> {
    let positions = rasters.iter().flat_map(|raster| &raster.positions);
    let mut samples: Vec<&PosedSample> =
        positions.flat_map(|position| &position.groups).flat_map(|group| &group.samples).collect();
    samples.sort_by(|a, b| a.time.total_cmp(&b.time));
    let motion = |(index, object): (usize, &Object)| {
        let poses: Vec<&PosedObject> = samples.iter().map(|sample| &sample.objects[index]).collect();
        motion(object, &poses, stride, near)
    };
    let motions: Vec<Movement> = scene.objects.iter().enumerate().map(motion).collect();
    let middle = samples.get(samples.len() / 2).map_or_else(Vec::new, |sample| sample.objects.clone());
    let positions = rasters.iter_mut().flat_map(|raster| &mut raster.positions);
    for sample in positions.flat_map(|position| &mut position.groups).flat_map(|group| &mut group.samples) {
        for ((pose, held), motion) in sample.objects.iter_mut().zip(&middle).zip(&motions) {
            if *motion == Movement::Short {
                *pose = *held;
            }
        }
    }
    motions.into_iter().map(|motion| motion != Movement::Moves).collect()
}

/// How far `object` moves; `poses` are those of all samples, rising in time.
fn motion(object: &Object, poses: &[&PosedObject], stride: u32, near: f32) -> Movement {
    let Some(first) = poses.first() else { return Movement::Rests };
    let differs = |pose: &PosedObject| pose.visible != first.visible || pose.elapsed != first.elapsed;
    if poses.iter().any(|pose| pose.moves || differs(pose)) {
        return Movement::Moves;
    }
    if !first.visible || poses.iter().all(|pose| pose == first) {
        return Movement::Rests;
    }
    // Gaussians may be far larger than the box of their centres, and a short path may change their order.
    if object.shape.is_composited() || object.shape.bounds().is_empty() {
        return Movement::Moves;
    }
    let origin = object.shape.origin();
    let is_short = |corner: DVec3| path(poses, (corner - origin).as_vec3(), near) * (stride as f32) < STATIC_PATH;
    if object.shape.bounds().corners().into_iter().all(is_short) { Movement::Short } else { Movement::Moves }
}

/// Length of the path of a point of the model over the raster, raster pixels; infinite where it comes nearer than
/// `near`.
fn path(poses: &[&PosedObject], point: Vec3, near: f32) -> f32 {
    let mut length = 0.0;
    let mut last = None;
    for pose in poses {
        let p = pose.screen_from_model * point + pose.screen_origin;
        if p.z.is_nan() || p.z < near {
            return f32::INFINITY;
        }
        let here = p.truncate() / p.z;
        length += last.map_or(0.0, |last| here.distance(last));
        last = Some(here);
    }
    length
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may stop")]
mod tests {
    use glam::DVec3;

    use crate::Scene;
    use crate::frame::Frame;
    use crate::model::generate;
    use crate::options::{BlurMode, RenderOptions};
    use crate::scene::{Camera, Motion, Object};

    /// A floor, whose rectangle fills half of the image, and a ball that fills little. `moving`: which of them moves.
    fn scene((name, moving): (&str, [bool; 2])) -> Scene {
        let objects = [generate::floor(), generate::ball()].map(|cloud| Object::from_cloud(cloud).unwrap());
        let mut scene = Scene { name: name.to_owned(), ..Scene::new(objects) };
        scene.camera = Camera::new(DVec3::new(0.0, 2.0, 9.0), DVec3::new(0.0, 1.0, 0.0));
        (scene.image.width, scene.image.height) = (480, 270);
        for (object, moves) in scene.objects.iter_mut().zip(moving) {
            object.motions.extend(moves.then_some(Motion::Linear { velocity: DVec3::new(0.3, 0.0, 0.0) }));
        }
        scene
    }

    #[test]
    fn positions_are_shared_where_much_rests_and_something_moves() {
        let [much_rests, little_rests, nothing_rests, all_rests] = [
            ("much rests", [false, true]),
            ("little rests", [true, false]),
            ("nothing rests", [true, true]),
            ("all rests", [false, false]),
        ]
        .map(scene);
        for (scene, mode, wanted) in [
            (&much_rests, "supersample:24", 8),
            (&much_rests, "supersample:72", 18),
            // No divisor, and what is asked for.
            (&much_rests, "supersample:11", 11),
            (&much_rests, "supersample:24+pixel-samples=24", 24),
            (&much_rests, "supersample:24+pixel-samples=6", 6),
            (&little_rests, "supersample:24", 24),
            (&nothing_rests, "supersample:24", 24),
            (&all_rests, "supersample:24", 24),
            // Edges at rest need eight positions. Intervals have equally many.
            (&much_rests, "volumetric:3", 9),
            (&much_rests, "volumetric:10", 10),
            (&all_rests, "volumetric:3", 9),
            (&little_rests, "volumetric:3", 1),
            (&nothing_rests, "volumetric:3", 1),
            (&nothing_rests, "volumetric:10", 1),
            (&nothing_rests, "volumetric:3+kernel=ellipsoid", 3),
            (&nothing_rests, "volumetric:3+published", 3),
            (&nothing_rests, "volumetric:3+pixel-samples=3", 3),
        ] {
            let mode: BlurMode = mode.parse().unwrap();
            let frame = Frame::new(scene, 0, mode, &RenderOptions::default());
            assert_eq!(frame.rasters[0].positions.len(), wanted, "{}, {mode}", scene.name);
        }
    }
}
