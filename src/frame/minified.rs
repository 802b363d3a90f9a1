//! Whether a part of the image shows splats that lie closer than the sample positions of a pixel.

use glam::DVec2;

use crate::math::focal_length;
use crate::scene::pose::{camera_from_world, object_pose};
use crate::scene::{Object, Scene};
use crate::time::FrameNumber;

/// Most surfels of an object that are looked at.
const MEASURED: usize = 4096;
/// Splats are minified whose shorter radius, in distances of sample positions, is below this. On a curved surface few
/// are: those at its outline.
const RADIUS: f64 = 0.45;
/// Share of the image from which minified splats count. It was set on the shipped scenes: `checkerboard`, which needs a
/// filter, has .036 at eight positions, and of eleven others none has more than .007 (docs/measurements/prefilter.md).
const PART: f64 = 0.015;

/// Sub-pixel positions from which minified surfels of meshes do not count. They are that small at grazing angles alone,
/// where a filter doubles the price and takes away at most 12 % of FLIP (docs/measurements/meshes.md).
const ENOUGH_FOR_MESHES: usize = 8;

/// Are splats minified in a part of the image that counts, for so many sub-pixel positions, at the middle of the
/// exposure of frame `number`? There a position sees few of the splats in its share of the pixel, and detail would
/// show as noise without a filter.
pub(super) fn is_minified(scene: &Scene, number: FrameNumber, positions: usize) -> bool {
    let pixels = f64::from(scene.image.width) * f64::from(scene.image.height);
    let radius = RADIUS / (positions as f64).sqrt();
    let counts = |object: &&Object| {
        positions < ENOUGH_FOR_MESHES || object.shape.surfels().is_none_or(|model| model.mesh().is_none())
    };
    let objects = scene.objects.iter().filter(counts);
    let minified: f64 = objects.map(|object| minified_pixels(scene, number, object, radius)).sum();
    minified > PART * pixels
}

/// Pixels of the image that `object` covers with splats whose shorter radius is below `radius` pixels. What hides what
/// is not looked at.
fn minified_pixels(scene: &Scene, number: FrameNumber, object: &Object, radius: f64) -> f64 {
    let Some(model) = object.shape.surfels() else { return 0.0 };
    let surfels = model.surfels();
    // A filter widens no spheres.
    if surfels.spheres {
        return 0.0;
    }
    let time = scene.shutter.frame_time(number.get(), 0.5);
    let pose = object_pose(scene, object, time);
    if !pose.visible {
        return 0.0;
    }
    let view_from_model = camera_from_world(scene, time) * pose.world_from_model;
    let size = DVec2::new(scene.image.width.into(), scene.image.height.into());
    let focal = focal_length(size.y, scene.camera.fovy);
    let shift = scene.camera.shift * size * DVec2::new(1.0, -1.0);
    let of_surfel = |surfel: usize| {
        let place = view_from_model.transform_point3(surfels.position[surfel].as_dvec3() + surfels.origin);
        let scale = focal / -place.z;
        let inside = (place.truncate() * scale + shift).abs().cmple(0.5 * size).all();
        if -place.z < scene.camera.near || !inside {
            return 0.0;
        }
        let on_image = |axis: glam::Vec3| {
            let axis = view_from_model.transform_vector3(axis.as_dvec3());
            (axis.truncate() - place.truncate() * (axis.z / place.z)) * scale
        };
        let [u, v] = [on_image(surfels.axis_u[surfel]), on_image(surfels.axis_v[surfel])];
        // Seen from its front, u turns to v as in the model; half of a closed surface shows its back.
        let area = u.perp_dot(v) * view_from_model.determinant().signum();
        if area > 0.0 && shorter_radius(u, v) < radius { area } else { 0.0 }
    };
    let step = surfels.len().div_ceil(MEASURED).max(1);
    // Discs are about as wide as their distance, so that each owns a square of half its diameter: |u x v|.
    step as f64 * (0..surfels.len()).step_by(step).map(of_surfel).sum::<f64>()
}

/// The shorter semi-axis of the ellipse with the conjugate semi-axes u and v.
fn shorter_radius(u: DVec2, v: DVec2) -> f64 {
    let squares = u.length_squared() + v.length_squared();
    let area = u.perp_dot(v);
    (0.5 * (squares - (squares * squares - 4.0 * area * area).max(0.0).sqrt())).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shorter_radius_is_that_of_the_ellipse() {
        let (sin, cos) = 0.7_f64.sin_cos();
        let turned = |p: DVec2| DVec2::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y);
        let (a, b) = (turned(DVec2::new(3.0, 0.0)), turned(DVec2::new(0.0, 0.5)));
        // Any pair of conjugate semi-axes gives the same ellipse.
        let (sin, cos) = 1.1_f64.sin_cos();
        assert!((shorter_radius(a, b) - 0.5).abs() < 1e-12);
        assert!((shorter_radius(a * cos + b * sin, b * cos - a * sin) - 0.5).abs() < 1e-9);
    }
}
