//! Points of a scene for a start: what programs that fit Gaussians begin with, in place of those of a reconstruction.

use glam::{DVec3, Vec3};

use super::MIDDLE;
use crate::image::Response;
use crate::math::srgb;
use crate::model::ModelError;
use crate::model::paths::elapsed;
use crate::scene::pose::object_pose;
use crate::scene::{Object, Scene, Shape};
use crate::time::FrameNumber;

/// Most points, about as many as a reconstruction of a few hundred photographs has.
const MOST: usize = 100_000;

/// Points of an ideal sphere, which has none of its own.
const OF_SPHERE: usize = 1000;

/// A point for a start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StartPoint {
    /// Where it is in the world, scene units.
    pub(super) position: DVec3,
    /// Its colour as codes of pictures, 0 to 255.
    pub(super) colour: [u8; 3],
}

/// Every n-th of all points that frame `frame` may show, at most [`MOST`], where they are in the middle of the shutter.
/// Their colours are their own, without light and shadow, as `response` makes codes of them. Points behind others are
/// among them.
///
/// # Errors
/// A file of a sequence cannot be read.
pub(super) fn start_points(
    scene: &Scene,
    frame: FrameNumber,
    response: Response,
) -> Result<Vec<StartPoint>, ModelError> {
    let number = frame.get();
    let scene = scene.at_frame(number)?;
    let time = scene.shutter.frame_time(number, MIDDLE);
    let shown = |object: &&Object| !object.shadow_catcher && object.opacity > 0.0 && object.exists(time);
    let objects: Vec<&Object> = scene.objects.iter().filter(shown).collect();
    let every = objects.iter().map(|object| count(&object.shape)).sum::<usize>().div_ceil(MOST).max(1);
    let mut points = Vec::new();
    let mut next = 0;
    for object in objects {
        let at = if object.blur { time } else { number };
        let pose = object_pose(&scene, object, at);
        let travelled = object.travelled(scene.frames.rate, number, time);
        let count = count(&object.shape);
        for i in (next..count).step_by(every) {
            if let Some((place, light)) = point(&object.shape, i, travelled).filter(|_| pose.visible) {
                let mut codes = light.to_array();
                response.encode(&mut codes, 255.0);
                let position = pose.world_from_model.transform_point3(place);
                points.push(StartPoint { position, colour: codes.map(|code| code as u8) });
            }
        }
        // The row of all points goes on in the next object.
        next = (next + count.saturating_sub(next).div_ceil(every) * every).saturating_sub(count);
    }
    Ok(points)
}

/// Points of a shape.
fn count(shape: &Shape) -> usize {
    if matches!(shape, Shape::Sphere { .. }) { OF_SPHERE } else { shape.elements() }
}

/// Place in the model and linear colour of point `i`, which travelled so long; `None` for one that does not show.
fn point(shape: &Shape, i: usize, travelled: f64) -> Option<(DVec3, Vec3)> {
    match shape {
        Shape::Surfels { model, .. } => {
            let surfels = model.surfels();
            let shows = surfels.opacity.get(i).is_none_or(|&opacity| opacity > 0.0);
            let place = surfels.origin + model.paths().exact_place(surfels.position[i], i, elapsed(travelled));
            shows.then(|| (place, surfels.colour[i]))
        }
        Shape::Gaussians { model, .. } | Shape::Volume { model, .. } => {
            let gaussians = model.gaussians();
            let place = gaussians.position[i].as_dvec3();
            let in_crop = model.crop.is_none_or(|[min, max]| place.cmpge(min).all() && place.cmple(max).all());
            let own = || {
                let colour = gaussians.colour(i).max(Vec3::ZERO);
                if gaussians.linear { colour } else { Vec3::from_array(colour.to_array().map(srgb::to_linear)) }
            };
            (in_crop && gaussians.opacity[i] > 0.0).then(|| (place, model.flat.unwrap_or_else(own)))
        }
        Shape::Sphere { sphere, .. } => Some((sphere.radius * direction(i), sphere.colour)),
        Shape::Sequence { .. } => None,
    }
}

/// Direction `i` of [`OF_SPHERE`] that lie evenly: slices of one height, each turned by the golden angle.
fn direction(i: usize) -> DVec3 {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let z = 1.0 - (2 * i + 1) as f64 / OF_SPHERE as f64;
    let (sine, cosine) = libm::sincos(golden * i as f64);
    let across = (1.0 - z * z).sqrt();
    DVec3::new(across * cosine, across * sine, z)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::model::Surfels;
    use crate::scene::{Motion, Sphere};

    fn row(count: usize) -> Object {
        let flat = |i: usize| Vec3::new(i as f32, 0.0, 0.0);
        let column = |value: Vec3| vec![value; count];
        Object::new(Surfels {
            position: (0..count).map(flat).collect(),
            axis_u: column(Vec3::X),
            axis_v: column(Vec3::Y),
            normal: column(Vec3::Z),
            colour: column(Vec3::new(0.0, 0.5, 1.0)),
            ..Surfels::default()
        })
    }

    #[test]
    fn every_nth_of_all_points_is_taken_across_objects() {
        let mut scene = Scene::new([row(100_007), row(3), row(149_992)]);
        for (i, object) in scene.objects.iter_mut().enumerate() {
            object.transform.translate.y = i as f64;
        }
        let points = start_points(&scene, 0.into(), Response::Srgb).unwrap();
        // Every third of 250 002.
        assert_eq!(points.len(), 83_334);
        let of_object = |y: f64| points.iter().filter(|point| point.position.y == y).count();
        assert_eq!([0.0, 1.0, 2.0].map(of_object), [33_336, 1, 49_997]);
        // 0.5 encodes to 0.735357 of 255.
        assert!(points.iter().all(|point| point.colour == [0, 188, 255]));
        // What hides nothing is not seen: the catcher of shadows, and what is clear.
        scene.objects[0].shadow_catcher = true;
        scene.objects[1].opacity = 0.0;
        assert!(start_points(&scene, 0.into(), Response::Srgb).unwrap().iter().all(|point| point.position.y == 2.0));
    }

    #[test]
    fn points_are_where_the_middle_of_the_shutter_has_them() {
        let mut ball = Object::new(Sphere { radius: 2.0, colour: Vec3::ONE });
        ball.motions = vec![Motion::Linear { velocity: DVec3::new(0.0, 0.0, 8.0) }];
        let mut scene = Scene::new([ball]);
        (scene.shutter.open, scene.shutter.close) = (0.0, 0.5);
        let points = start_points(&scene, 3.into(), Response::Linear).unwrap();
        assert_eq!(points.len(), OF_SPHERE);
        // 8 a frame for 3.25 frames.
        let off = |point: &StartPoint| ((point.position - DVec3::new(0.0, 0.0, 26.0)).length() - 2.0).abs();
        assert!(points.iter().all(|point| off(point) < 1e-12 && point.colour == [255; 3]));
        let middle = points.iter().map(|point| point.position).sum::<DVec3>() / OF_SPHERE as f64;
        assert!((middle.z - 26.0).abs() < 1e-3 && middle.truncate().length() < 1e-2, "{middle}");
    }
}
