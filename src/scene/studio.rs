//! A studio for models alone: a camera that frames them, three lights, and a ground that catches their shadow before a
//! quiet background. Scenes of a file have none of it.

use glam::{DMat4, DVec3, Vec3};

use super::automatic::{Grid, upwards};
use super::model::SurfelModel;
use super::pose::object_pose;
use super::shape::Shape;
use super::values::{Camera, Light, Object, Scene};
use crate::math::Bounds;
use crate::model::paths::elapsed;
use crate::model::{Material, Surfels};

/// What a person may say about a studio.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StudioOptions {
    /// Show colours as they are, without the light of lamps. `None`: of points with colours that differ, without
    /// materials and velocities, as scans have them.
    pub unlit: Option<bool>,
    /// Background, linear Rec.709; the ground fades into it. `None`: a grey.
    pub background: Option<DVec3>,
    /// Leave the background out, and the ground with it.
    pub transparent: bool,
}

/// The studio that a scene stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Studio {
    /// How its light falls on the model.
    pub light: StudioLight,
    /// Is there a ground?
    pub ground: bool,
}

/// How the light of a studio falls on a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StudioLight {
    /// Three lamps shade it.
    Lit,
    /// Its colours show as they are; the lamps shade the ground alone.
    Unlit,
    /// It has light of its own, as captures have, or is a volume. There is no ground for its shadow.
    Own,
}

/// Share of the shorter side of the image that the longer side of the model's outline has.
const FILL: f64 = 0.75;
/// Vertical field of view, degrees: that of a lens a little longer than one that sees as the eye does.
const FOVY: f64 = 30.0;
/// Where the eye is, degrees around the upright axis from +z to +x, and above the ground.
const AROUND: f64 = 30.0;
const ABOVE: f64 = 16.0;
/// Background, linear: a light grey.
const GREY: f64 = 0.6;
/// Light from everywhere. A power of two, so that a material can undo it without rounding.
const AMBIENT: f64 = 0.25;
/// Diameter of the key light as it is seen from the model, degrees: a large soft box.
const SOFT: f64 = 14.0;
/// Lamps: degrees around the upright axis from the camera to its right, degrees above the ground, radiance. The key
/// light has the shadow; the fill light opens it; the rim light draws the outline. With `AMBIENT` they add up to less
/// than 1 on a white surface of any direction, its highlights included.
const LAMPS: [[f64; 3]; 3] = [[-42.0, 48.0, 0.5], [55.0, 20.0, 0.14], [150.0, 42.0, 0.24]];
/// Radius of the ground, radii of what stands on it: shadows end well within.
const GROUND: f64 = 5.0;
/// Surfels of the ground from its middle to its edge.
const RINGS: i32 = 48;
/// Share of stray points at each end that neither framing nor the ground heeds, of points at rest that are not the
/// corners of triangles. Captures are cut to their core.
const STRAY: f64 = 0.002;

impl Scene {
    /// Puts a scene of models alone into a studio: camera, lights, background and ground. An object is unlit by its
    /// material.
    ///
    /// The camera sees all objects at all times of the scene's frames, shutter included, from the front, right and
    /// above; captures and volumes from where they are seen without a studio. The ground lies below the lowest point of
    /// all these times.
    #[doc(hidden)]
    pub fn enter_studio(&mut self, options: &StudioOptions) -> Studio {
        let light = self.light_of_studio(options.unlit);
        self.camera = self.studio_camera();
        self.image.background = options.background.unwrap_or(DVec3::splat(GREY));
        self.image.transparent |= options.transparent;
        let up = upwards(self);
        self.lights = lamps(&self.camera, up, light != StudioLight::Own);
        if light == StudioLight::Unlit {
            for object in &mut self.objects {
                object.shape.set_material(Material {
                    ambient: (1.0 / AMBIENT) as f32,
                    diffuse: 0.0,
                    specular: 0.0,
                    ..Material::default()
                });
            }
        }
        let ground = (light != StudioLight::Own && !self.image.transparent).then(|| self.ground(up)).flatten();
        let has_ground = ground.is_some();
        self.objects.extend(ground);
        Studio { light, ground: has_ground }
    }

    /// The camera of a studio for an image of this size. The ground plays no part.
    #[doc(hidden)]
    pub fn studio_camera(&self) -> Camera {
        framed(self).unwrap_or_else(|| Camera::automatic(self))
    }

    fn light_of_studio(&self, unlit: Option<bool>) -> StudioLight {
        if self.objects.iter().any(|object| object.shape.is_composited()) {
            return StudioLight::Own;
        }
        let is_scan = |object: &Object| object.shape.surfels().is_some_and(is_scan);
        let unlit = unlit.unwrap_or_else(|| !self.objects.is_empty() && self.objects.iter().all(is_scan));
        if unlit { StudioLight::Unlit } else { StudioLight::Lit }
    }

    /// A disc below all objects, of the colour that the lamps make the background. `None` where it has no place.
    fn ground(&self, up: DVec3) -> Option<Object> {
        let points = Points::of(self);
        let [x, y, z] = [points.along(DVec3::X)?, points.along(DVec3::Y)?, points.along(DVec3::Z)?];
        let bounds = Bounds { min: DVec3::new(x[0], y[0], z[0]), max: DVec3::new(x[1], y[1], z[1]) };
        let radius = 0.5 * bounds.size().length();
        let mut heights: Vec<f64> = points.all.iter().map(|(point, _)| point.dot(up)).collect();
        let [low, _] = ends(&mut heights, points.strays)?;
        // A gap that is not seen, so that a flat bottom is not in the ground.
        let low = low - 1e-3 * radius;
        let centre = bounds.centre();
        let middle = centre + up * (low - centre.dot(up));
        let usable = (1e-9..1e15).contains(&radius) && middle.is_finite() && middle.abs().max_element() < 1e15;
        if !usable {
            return None;
        }
        let irradiance: DVec3 = self.lights.iter().map(|light| falling(light, up)).sum();
        let colour = (self.image.background / irradiance).as_vec3();
        let mut ground = Object::new(disc(middle, up, GROUND * radius, colour));
        GROUND_NAME.clone_into(&mut ground.name);
        // The ground is flat: nothing but itself is as near to it as this.
        ground.epsilon = Some(1e-4 * radius);
        ground.shape.set_material(Material { ambient: 1.0, diffuse: 1.0, specular: 0.0, ..Material::default() });
        Some(ground)
    }
}

const GROUND_NAME: &str = "ground";

/// The ground of a studio is in no file.
fn is_ground(object: &Object) -> bool {
    object.name == GROUND_NAME && object.source.path.as_os_str().is_empty()
}

/// Are these points of a scan: with colours that differ, of one material or none, not in motion, and not of a mesh?
/// Files that must name a material for each point give those of a scan the same.
fn is_scan(model: &SurfelModel) -> bool {
    let surfels = model.surfels();
    let is_one = surfels.material.iter().all(|material| *material == surfels.material[0]);
    let plain = is_one && model.paths().is_empty() && !model.is_mesh() && !surfels.spheres;
    plain && surfels.colour.iter().any(|colour| *colour != surfels.colour[0])
}

/// The radiance that a light adds to a white surface with this normal; of a point of light none, for there is no
/// distance.
fn falling(light: &Light, normal: DVec3) -> DVec3 {
    match *light {
        Light::Ambient { colour } => colour,
        Light::Directional { direction, colour, .. } => colour * normal.dot(-direction).max(0.0),
        Light::Point { .. } => DVec3::ZERO,
    }
}

/// The lights, turned as the camera is around `up`; with `key_has_shadows` things cast shadows.
fn lamps(camera: &Camera, up: DVec3, key_has_shadows: bool) -> Vec<Light> {
    let out = camera.eye - camera.at;
    let front = (out - up * out.dot(up)).normalize_or(up.any_orthonormal_vector());
    let right = up.cross(front);
    let mut lights: Vec<Light> = LAMPS
        .iter()
        .map(|&[around, above, radiance]| {
            let (sin, cos) = libm::sincos(around.to_radians());
            let (height, flat) = libm::sincos(above.to_radians());
            let towards = (front * cos + right * sin) * flat + up * height;
            Light::directional(-towards.normalize(), DVec3::splat(radiance)).without_shadows()
        })
        .collect();
    if let Some(Light::Directional { angle, shadows, .. }) = lights.first_mut() {
        (*angle, *shadows) = (SOFT.to_radians(), key_has_shadows);
    }
    lights.push(Light::Ambient { colour: DVec3::splat(AMBIENT) });
    lights
}

/// A disc of surfels on a square lattice.
fn disc(middle: DVec3, up: DVec3, radius: f64, colour: Vec3) -> Surfels {
    let spacing = radius / f64::from(RINGS);
    let (u, v) = up.any_orthonormal_pair();
    // (u x v) . normal >= 0, as any such pair has it or its mirror image.
    let v = if u.cross(v).dot(up) < 0.0 { -v } else { v };
    let cells = (-RINGS..=RINGS).flat_map(|i| (-RINGS..=RINGS).map(move |j| [i, j]));
    let position: Vec<Vec3> = cells
        .filter(|[i, j]| i * i + j * j <= RINGS * RINGS)
        .map(|[i, j]| ((u * f64::from(i) + v * f64::from(j)) * spacing).as_vec3())
        .collect();
    let n = position.len();
    let axis = |axis: DVec3| vec![(axis * 1.5 * spacing).as_vec3(); n];
    Surfels {
        origin: middle,
        position,
        axis_u: axis(u),
        axis_v: axis(v),
        normal: vec![up.as_vec3(); n],
        colour: vec![colour; n],
        ..Surfels::default()
    }
}

/// Share of points at each end that are strays.
fn stray(object: &Object) -> f64 {
    match &object.shape {
        Shape::Surfels { model, .. } if !model.is_mesh() && model.paths().is_empty() => STRAY,
        _ => 0.0,
    }
}

/// The least and the greatest of some numbers but for a share of them at each end; `None` where there are none.
fn ends(values: &mut [f64], strays: f64) -> Option<[f64; 2]> {
    let last = values.len().checked_sub(1)?;
    let skipped = (last as f64 * strays) as usize;
    let low = *values.select_nth_unstable_by(skipped, f64::total_cmp).1;
    let high = *values.select_nth_unstable_by(last - skipped, f64::total_cmp).1;
    Some([low, high])
}

/// What a studio goes by.
struct Points {
    /// The points of all objects but the ground, in the world, at all times that count, and their radii.
    all: Vec<(DVec3, f64)>,
    /// Share of them at each end that are strays.
    strays: f64,
}

impl Points {
    fn of(scene: &Scene) -> Self {
        let (mut all, mut strays) = (Vec::new(), 0.0);
        for object in scene.objects.iter().filter(|object| !is_ground(object)) {
            strays = f64::max(strays, stray(object));
            for_each_point(scene, object, |point, radius| all.push((point, radius)));
        }
        Self { all, strays }
    }

    /// Where they begin and end along an axis, strays left out.
    fn along(&self, axis: DVec3) -> Option<[f64; 2]> {
        let mut values: Vec<f64> = self.all.iter().flat_map(|&(p, radius)| span(p.dot(axis), radius)).collect();
        ends(&mut values, self.strays)
    }
}

fn span(middle: f64, radius: f64) -> [f64; 2] {
    [middle - radius, middle + radius]
}

/// Calls `each` with the points of an object in the world and their radii, at all times that count: corners of
/// triangles, else centres of surfels, Gaussians or kernels.
fn for_each_point(scene: &Scene, object: &Object, mut each: impl FnMut(DVec3, f64)) {
    /// Most points at all times together.
    const MOST: usize = 1 << 22;
    let [from, _] = scene.shutter.whole_exposure(scene.frames.first as f64);
    let [_, to] = scene.shutter.whole_exposure(scene.frames.last as f64);
    // Points with velocities move in each exposure, even where all frames are alike.
    let rests = object.is_fixed() && object.shape.surfels().is_none_or(|model| model.paths().is_empty());
    let count = points_of(object).max(1);
    let steps = ((2.0 * (to - from)).ceil() as usize).clamp(1, (MOST / count).clamp(1, 200));
    for step in 0..=if rests { 0 } else { steps } {
        let time = if rests { scene.frames.first as f64 } else { from + (to - from) * step as f64 / steps as f64 };
        let pose = object_pose(scene, object, time);
        if pose.visible {
            points_at(scene, object, time, &pose.world_from_model, &mut each);
        }
    }
}

fn points_of(object: &Object) -> usize {
    object.shape.surfels().and_then(SurfelModel::mesh).map_or(object.shape.elements(), |mesh| mesh.position.len())
}

fn points_at(scene: &Scene, object: &Object, time: f64, m: &DMat4, each: &mut impl FnMut(DVec3, f64)) {
    let scale = libm::cbrt(m.determinant().abs());
    let mut place = |point: DVec3, radius: f64| {
        let point = m.transform_point3(point);
        if point.is_finite() {
            each(point, radius * scale);
        }
    };
    match &object.shape {
        Shape::Surfels { model, .. } => {
            if let Some(mesh) = model.mesh() {
                let mut used = vec![false; mesh.position.len()];
                mesh.triangles.iter().flat_map(|triangle| triangle.corners).for_each(|i| used[i as usize] = true);
                let corners = mesh.position.iter().zip(used).filter(|(_, used)| *used);
                return corners.for_each(|(&corner, _)| place(corner, 0.0));
            }
            let (surfels, paths) = (model.surfels(), model.paths());
            // From the place in the file to where the point is at that time.
            let number = time.round().min(scene.frames.last as f64).max(scene.frames.first as f64);
            let travelled = elapsed(object.travelled(scene.frames.rate, number, time));
            for (i, &position) in surfels.position.iter().enumerate() {
                let at = surfels.origin + paths.exact_place(position, i, travelled);
                // About where a kernel ceases to be seen.
                place(at, 0.5 * f64::from(surfels.radius(i)));
            }
        }
        Shape::Gaussians { model, .. } | Shape::Volume { model, .. } => {
            let gaussians = model.gaussians();
            let bounds = model.core();
            for (&position, sigma) in gaussians.position.iter().zip(&gaussians.sigma) {
                let at = position.as_dvec3();
                if at.cmpge(bounds.min).all() && at.cmple(bounds.max).all() {
                    place(at, f64::from(sigma.max_element()));
                }
            }
        }
        Shape::Sequence { .. } | Shape::Sphere { .. } => {
            object.shape.bounds().corners().into_iter().for_each(|corner| place(corner, 0.0));
        }
    }
}

/// A camera whose picture of all objects is centred, and as large as [`FILL`] says. `None` where there is nothing to
/// frame.
fn framed(scene: &Scene) -> Option<Camera> {
    let up = upwards(scene);
    let composited = scene.objects.iter().any(|object| object.shape.is_composited());
    let (around, above) = if composited { (0.0, 0.0) } else { (AROUND, ABOVE) };
    let (sin, cos) = libm::sincos(f64::to_radians(around));
    let (height, flat) = libm::sincos(f64::to_radians(above));
    let out = DVec3::new(sin * flat, 0.0, cos * flat) + up * height;
    let right = up.cross(out).normalize();
    let above = out.cross(right);

    let mut points = Points::of(scene);
    let [x, y, z] = [points.along(right)?, points.along(above)?, points.along(out)?];
    // A stray before or behind the others would be near the middle of the picture: no share of its ends.
    points.all.retain(|&(point, radius)| point.dot(out) + radius >= z[0] && point.dot(out) - radius <= z[1]);
    let size = 0.5 * DVec3::new(x[1] - x[0], y[1] - y[0], z[1] - z[0]).length();
    let centre = 0.5 * (right * (x[0] + x[1]) + above * (y[0] + y[1]) + out * (z[0] + z[1]));
    if !(size > 0.0 && size < 1e20) {
        return None;
    }
    let tan = libm::tan(0.5 * f64::to_radians(FOVY));
    let aspect = f64::from(scene.image.width) / f64::from(scene.image.height);
    // Half of the shorter side at distance 1, as far as it is filled.
    let wanted = FILL * tan * aspect.min(1.0);
    let (mut at, mut distance) = (centre, 2.0 * size / wanted);
    let [mut xs, mut ys] = [Vec::with_capacity(2 * points.all.len()), Vec::with_capacity(2 * points.all.len())];
    // Each round is exact but for the depth of the outline, which the distance changes little.
    for _ in 0..12 {
        xs.clear();
        ys.clear();
        for &(point, radius) in &points.all {
            let p = point - at;
            let depth = distance - p.dot(out);
            // What comes too near while the camera is sought.
            let depth = depth.max(1e-3 * distance);
            for (values, axis) in [(&mut xs, right), (&mut ys, above)] {
                values.extend(span(p.dot(axis), radius).map(|end| end / depth));
            }
        }
        let [left, right_end] = ends(&mut xs, points.strays)?;
        let [bottom, top] = ends(&mut ys, points.strays)?;
        at += (right * (left + right_end) + above * (bottom + top)) * (0.5 * distance);
        let half = 0.5 * (right_end - left).max(top - bottom);
        if half <= 0.0 || half.is_nan() {
            return None;
        }
        // The outline is nearer than the middle by less than the size.
        let factor = half / wanted;
        distance *= factor;
        if (factor - 1.0).abs() < 1e-4 {
            break;
        }
    }
    let grid = Grid::new(distance);
    let (eye, at) = (grid.vector(at + out * distance), grid.vector(at));
    let near = Camera::NEAR.min(grid.number(distance * 1e-3)).max(1e-9);
    let camera = Camera { up, fovy: FOVY.to_radians(), near, automatic: true, ..Camera::new(eye, at) };
    camera.bad_view().is_none().then_some(camera)
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::model::Gaussians;
    use crate::scene::pose::camera_from_world;
    use crate::shading::{ShadingLight, shade};

    /// Points on a box from (-1, 0, -1) to (1, 3, 1), with the size `scale`, about `middle`.
    fn boxed(scale: f64, middle: DVec3, coloured: bool) -> Scene {
        let mut surfels = Surfels { origin: middle, ..Surfels::default() };
        for i in 0..1000 {
            let part = |k: i32| f64::from(i / 10_i32.pow(k as u32) % 10) / 9.0;
            let at = DVec3::new(2.0 * part(0) - 1.0, 3.0 * part(1), 2.0 * part(2) - 1.0) * scale;
            surfels.position.push(at.as_vec3());
            surfels.axis_u.push(Vec3::X * (1e-4 * scale) as f32);
            surfels.axis_v.push(Vec3::Y * (1e-4 * scale) as f32);
            surfels.normal.push(Vec3::Z);
            surfels.colour.push(Vec3::splat(if coloured { part(1) as f32 } else { 0.5 }));
        }
        Scene::new([Object::new(surfels)])
    }

    /// Width and height of the outline in shares of the image, and its middle from that of the image.
    fn outline(scene: &Scene) -> ([f64; 2], [f64; 2]) {
        let camera = &scene.camera;
        let tan = libm::tan(0.5 * camera.fovy);
        let aspect = f64::from(scene.image.width) / f64::from(scene.image.height);
        let view = camera_from_world(scene, 0.0);
        let surfels = scene.objects[0].shape.surfels().unwrap().surfels();
        let points: Bounds = surfels
            .position
            .iter()
            .map(|p| {
                let p = view.transform_point3(surfels.origin + p.as_dvec3());
                assert!(-p.z > camera.near);
                DVec3::new(p.x / (-p.z * tan * aspect), p.y / (-p.z * tan), 0.0)
            })
            .collect();
        let (size, centre) = (0.5 * points.size(), points.centre());
        ([size.x, size.y], [centre.x, centre.y])
    }

    #[test]
    fn the_outline_fills_three_quarters_of_the_shorter_side() {
        for (size, scale, middle) in [
            ([1024, 768], 1.0, DVec3::ZERO),
            ([300, 900], 1.0, DVec3::ZERO),
            ([1600, 400], 1e-4, DVec3::ZERO),
            ([640, 480], 1e6, DVec3::new(5e7, -2e7, 1e7)),
        ] {
            let mut scene = boxed(scale, middle, false);
            [scene.image.width, scene.image.height] = size;
            scene.enter_studio(&StudioOptions::default());
            let (shares, centre) = outline(&scene);
            let pixels = [shares[0] * f64::from(size[0]), shares[1] * f64::from(size[1])];
            let filled = pixels[0].max(pixels[1]) / f64::from(size[0].min(size[1]));
            assert!((0.7..=0.8).contains(&filled), "{size:?}: {filled}");
            assert!(centre.iter().all(|c| c.abs() < 0.03), "{centre:?}");
        }
    }

    /// One point far before the others, behind them, or beside them.
    #[test]
    fn strays_change_neither_the_framing_nor_the_ground() {
        let mut without = boxed(1.0, DVec3::ZERO, false);
        without.enter_studio(&StudioOptions::default());
        let out = without.camera.eye - without.camera.at;
        let ground = |scene: &Scene| {
            let surfels = scene.objects[1].shape.surfels().unwrap().surfels();
            (surfels.origin, surfels.axis_u[0].length())
        };
        for stray in [out * 20.0, -out * 20.0, DVec3::X * 100.0, DVec3::Y * -100.0] {
            let mut surfels =
                Surfels::clone(boxed(1.0, DVec3::ZERO, false).objects[0].shape.surfels().unwrap().surfels());
            surfels.position.push(stray.as_vec3());
            surfels.axis_u.push(Vec3::X * 1e-4);
            surfels.axis_v.push(Vec3::Y * 1e-4);
            surfels.normal.push(Vec3::Z);
            surfels.colour.push(Vec3::splat(0.5));
            let mut scene = Scene::new([Object::new(surfels)]);
            scene.enter_studio(&StudioOptions::default());
            let ((place, size), (place_without, size_without)) = (ground(&scene), ground(&without));
            assert!(place.distance(place_without) < 1e-6, "{stray}: {place}, not {place_without}");
            assert!((size / size_without - 1.0).abs() < 1e-6, "{stray}: {size}, not {size_without}");
            // The others alone are looked at.
            scene.objects[0] = without.objects[0].clone();
            let (shares, centre) = outline(&scene);
            let filled = (shares[0] * 4.0 / 3.0).max(shares[1]);
            assert!((0.7..=0.8).contains(&filled), "{stray}: {filled}");
            assert!(centre.iter().all(|c| c.abs() < 0.03), "{stray}: {centre:?}");
        }
    }

    #[test]
    fn nothing_white_is_brighter_than_white() {
        let mut scene = boxed(1.0, DVec3::ZERO, false);
        scene.enter_studio(&StudioOptions::default());
        let lights: Vec<ShadingLight> = scene
            .lights
            .iter()
            .map(|light| match *light {
                Light::Ambient { colour } => ShadingLight::Ambient { colour: colour.as_vec3() },
                Light::Directional { direction, colour, .. } => ShadingLight::Directional {
                    towards: -direction.as_vec3(),
                    colour: colour.as_vec3(),
                    shadows: false,
                },
                Light::Point { .. } => panic!("no lamp of a studio is a point"),
            })
            .collect();
        let view = (scene.camera.eye - scene.camera.at).normalize().as_vec3();
        let direction = |i: u32| {
            // A lattice on the sphere.
            let height = 1.0 - 2.0 * (f64::from(i) + 0.5) / 20_000.0;
            let (sin, cos) = libm::sincos(2.399_963_229_728_653 * f64::from(i));
            let flat = (1.0 - height * height).sqrt();
            DVec3::new(flat * cos, height, flat * sin).as_vec3()
        };
        let brightest = (0..20_000)
            .map(|i| shade(&lights, &Material::default(), Vec3::ONE, direction(i), -view).max_element())
            .fold(0.0, f32::max);
        assert!((0.8..=1.0).contains(&brightest), "{brightest}");
    }

    #[test]
    fn the_ground_lies_below_and_is_the_background_in_full_light() {
        let mut scene = boxed(2.0, DVec3::new(3.0, -7.0, 1.0), false);
        let background = DVec3::new(0.2, 0.4, 0.6);
        let studio = scene.enter_studio(&StudioOptions { background: Some(background), ..StudioOptions::default() });
        assert_eq!(studio, Studio { light: StudioLight::Lit, ground: true });
        let ground = scene.objects[1].shape.surfels().unwrap().surfels();
        assert!(ground.origin.y < -7.0 && ground.origin.y > -7.02, "{}", ground.origin);
        assert!(ground.position.iter().all(|p| p.y == 0.0));
        let lit: DVec3 = scene.lights.iter().map(|light| falling(light, DVec3::Y)).sum();
        assert!((ground.colour[0].as_dvec3() * lit - background).abs().max_element() < 1e-6);
        assert_eq!(scene.lights.iter().filter(|light| light.has_shadows()).count(), 1);
        scene.check().unwrap();
        let mut scene = boxed(1.0, DVec3::ZERO, false);
        let studio = scene.enter_studio(&StudioOptions { transparent: true, ..StudioOptions::default() });
        assert!(!studio.ground && scene.image.transparent && scene.objects.len() == 1);
    }

    #[test]
    fn points_with_colours_show_them() {
        let unlit = |coloured: bool, unlit: Option<bool>| {
            let mut scene = boxed(1.0, DVec3::ZERO, coloured);
            let studio = scene.enter_studio(&StudioOptions { unlit, ..StudioOptions::default() });
            let ambient = scene.objects[0].shape.material().map_or(1.0, |material| material.ambient);
            (studio.light == StudioLight::Unlit, f64::from(ambient) * AMBIENT == 1.0)
        };
        assert_eq!(unlit(true, None), (true, true));
        assert_eq!(unlit(false, None), (false, false));
        assert_eq!(unlit(true, Some(false)), (false, false));
        assert_eq!(unlit(false, Some(true)), (true, true));
    }

    #[test]
    fn points_of_one_material_are_a_scan() {
        let light = |others: usize| {
            let mut surfels =
                Surfels::clone(boxed(1.0, DVec3::ZERO, true).objects[0].shape.surfels().unwrap().surfels());
            surfels.material = vec![Material::default(); surfels.len()];
            surfels.material.iter_mut().take(others).for_each(|material| material.specular += 0.1);
            Scene::new([Object::new(surfels)]).enter_studio(&StudioOptions::default()).light
        };
        assert_eq!([0, 1].map(light), [StudioLight::Unlit, StudioLight::Lit]);
    }

    #[test]
    fn captures_have_no_shadows() {
        let fog = Gaussians {
            position: vec![Vec3::ZERO, Vec3::X],
            sigma: vec![Vec3::splat(0.2); 2],
            rotation: vec![Quat::IDENTITY; 2],
            opacity: vec![0.8; 2],
            base: vec![Gaussians::base_of(Vec3::splat(0.5)); 2],
            linear: true,
            ..Gaussians::default()
        };
        let mut scene = Scene::new([Object::from_gaussians(fog).unwrap()]);
        assert_eq!(scene.enter_studio(&StudioOptions::default()), Studio { light: StudioLight::Own, ground: false });
        assert!(!scene.lights.iter().any(Light::has_shadows));
    }

    #[test]
    fn what_cannot_be_framed_is_seen_as_without_a_studio() {
        let mut scene = Scene::new([Object::new(Surfels::default())]);
        let before = scene.camera.clone();
        let studio = scene.enter_studio(&StudioOptions::default());
        assert_eq!((scene.camera.eye, scene.camera.at, studio.ground), (before.eye, before.at, false));
    }
}
