//! The values of the splats of a chunk: a number for each channel. With Gouraud shading, colours are lit by the lights
//! of their sample.
//!
//! In: the surfels of the splats and the sides that they show. Out: `Channels::count` numbers for each splat, weight 1
//! first; 0 for depth, which differs from pixel to pixel. Order-free.

use glam::Vec3;

use super::columns::transform;
use super::land::Strip;
use super::shadows::{Moved, Shadows};
use super::tiles::{LANES, Lanes};
use crate::environment::Surroundings;
use crate::frame::{FrameObject, PosedObject, PosedSample};
use crate::layout::{Channels, EwaSplat, FLAG_BACK, Splat, SweptSplat};
use crate::math::simd::dispatch;
use crate::model::Surfels;
use crate::model::paths::Paths;
use crate::options::Shading;
use crate::scene::SurfelModel;
use crate::shading::{ShadingLight, lobes, mirrored, smooth_light, towards_point};

/// Where values come from: an object at a time sample.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Shown<'a> {
    pub sample: &'a PosedSample,
    pub posed: &'a PosedObject,
    pub object: &'a FrameObject,
    pub model: &'a SurfelModel,
    pub channels: &'a Channels,
    pub shading: Shading,
    pub near: f32,
    /// Pixels of the image to one of the raster.
    pub stride: f32,
    /// Focal length, raster pixels.
    pub focal: f32,
    /// What surfels mirror.
    pub surroundings: Option<&'a Surroundings>,
    /// Standard deviation of what a pixel sees, radians in the middle of the image.
    pub pixel: f32,
    /// The strip that is read out while the object moves; else `None`.
    pub strip: Option<Strip>,
    /// `None`: no light has any.
    pub shadows: Option<&'a Shadows>,
    /// The object in the world in the middle of the group, of which the shadows are: its pose, and the origin of its
    /// model relative to the eye. `None`: it is posed so, or not there then.
    pub middle: Option<(&'a PosedObject, Vec3)>,
}

/// What it shows the side of.
pub(in crate::backend) trait Faced {
    /// Surfel and flags.
    fn face(&self) -> (u32, u32);

    /// Where its centre lands; `None` where the centre is not before the camera.
    fn place(&self) -> Option<[f32; 2]> {
        None
    }
}

impl Faced for Splat {
    fn face(&self) -> (u32, u32) {
        (self.surfel, self.flags)
    }

    fn place(&self) -> Option<[f32; 2]> {
        (self.centre_depth > 0.0).then_some(self.reference)
    }
}

impl Faced for EwaSplat {
    fn face(&self) -> (u32, u32) {
        self.disc.face()
    }

    fn place(&self) -> Option<[f32; 2]> {
        self.disc.place()
    }
}

impl Faced for SweptSplat {
    fn face(&self) -> (u32, u32) {
        (self.surfel, self.flags)
    }
}

/// Values of `splats`, one splat after the other, into `out`.
pub(in crate::backend) fn values<S: Faced>(splats: &[S], shown: &Shown<'_>, out: &mut Vec<f32>) {
    let count = shown.channels.count;
    out.clear();
    out.resize(splats.len() * count, 0.0);
    for (splats, out) in splats.chunks(LANES).zip(out.chunks_mut(LANES * count)) {
        let mut faces = [(0, 0); LANES];
        faces.iter_mut().zip(splats).for_each(|(face, splat)| *face = splat.face());
        // The last ones repeat a surfel that there is.
        let first = faces[0];
        faces[splats.len()..].fill(first);
        let mut times = [0.0; LANES];
        if let Some(strip) = shown.strip {
            times.iter_mut().zip(splats).for_each(|(time, splat)| *time = splat.place().map_or(0.0, |p| strip.time(p)));
        }
        values_of_lanes(&faces, &times, shown, out);
    }
}

dispatch! {
    fn values_of_lanes(faces: &[(u32, u32); LANES], times: &Lanes, shown: &Shown<'_>, out: &mut [f32]) =
        values_of_lanes_body
}

#[inline(always)]
fn values_of_lanes_body(faces: &[(u32, u32); LANES], times: &Lanes, shown: &Shown<'_>, out: &mut [f32]) {
    let Shown { posed, channels, .. } = *shown;
    let (surfels, paths) = (&**shown.model.surfels(), shown.model.paths());
    let gouraud = shown.shading == Shading::Gouraud;
    let mut normal = [[0.0; LANES]; 3];
    let mut position = [[0.0; LANES]; 3];
    let mut colour = [[0.0; LANES]; 3];
    let mut of_material = [[0.0; LANES]; 4];
    for l in 0..LANES {
        let i = faces[l].0 as usize;
        (colour[0][l], colour[1][l], colour[2][l]) = surfels.colour[i].into();
    }
    // A shadow catcher shows how much light falls on white.
    if shown.object.catcher {
        colour = [[1.0; LANES]; 3];
    }
    let places = |position: &mut [Lanes; 3]| {
        for l in 0..LANES {
            let i = faces[l].0 as usize;
            (position[0][l], position[1][l], position[2][l]) =
                paths.place(surfels.position[i], i, posed.elapsed).into();
        }
        *position = transform(&posed.world_from_model, posed.world_origin, position);
    };
    if posed.spheres != 0.0 {
        // Its disc faces the eye. Pixels bend it (paint/attribute.rs).
        places(&mut position);
        normal = unit(position.map(|axis| axis.map(|v| -v)));
    } else if gouraud || channels.normal.is_some() {
        for l in 0..LANES {
            let (surfel, flags) = faces[l];
            let side = if flags & FLAG_BACK == 0 { 1.0 } else { -1.0 };
            (normal[0][l], normal[1][l], normal[2][l]) = (side * surfels.normal[surfel as usize]).into();
        }
        let mut turned = transform(&posed.normal_matrix, Vec3::ZERO, &normal);
        if shown.strip.is_some() {
            let motion = transform(&posed.normal_motion, Vec3::ZERO, &normal);
            for c in 0..3 {
                for l in 0..LANES {
                    turned[c][l] += times[l] * motion[c][l];
                }
            }
        }
        normal = unit(turned);
    }
    if let Some(m) = shown.object.material {
        of_material = [[m.ambient; LANES], [m.diffuse; LANES], [m.specular; LANES], [m.shininess; LANES]];
    } else if gouraud || channels.material.is_some() {
        for l in 0..LANES {
            let m = surfels.material.get(faces[l].0 as usize).copied().unwrap_or_default();
            [of_material[0][l], of_material[1][l], of_material[2][l], of_material[3][l]] =
                [m.ambient, m.diffuse, m.specular, m.shininess];
        }
    }
    if gouraud {
        places(&mut position);
        let view = unit(position.map(|axis| axis.map(|v| -v)));
        let moved = shown.middle.map(|middle| Moved::of(posed, middle, surfels, &paths, &faces.map(|face| face.0)));
        colour = lit(shown, &colour, &normal, &position, moved.as_ref(), &view, &of_material);
        mirror(shown, &mut colour, &normal, &view);
    }
    let to_middle = channels.moved.map(|_| to_middle(shown, faces, times));
    for (l, out) in out.chunks_exact_mut(channels.count).enumerate() {
        out[0] = 1.0;
        out[1..4].copy_from_slice(&[colour[0][l], colour[1][l], colour[2][l]]);
        if let Some(at) = channels.normal {
            out[at..at + 3].copy_from_slice(&[normal[0][l], normal[1][l], normal[2][l]]);
        }
        if let Some(at) = channels.reflection {
            out[at] = shown.object.reflection;
        }
        if let Some(at) = channels.receives {
            out[at] = f32::from(shown.object.receives);
        }
        if let Some(at) = channels.catcher {
            out[at] = f32::from(shown.object.catcher);
        }
        if let Some(at) = channels.held {
            out[at] = f32::from(u8::from(shown.object.is_held));
        }
        if let (Some(at), Some(moved)) = (channels.moved, &to_middle) {
            out[at..at + 3].copy_from_slice(&[moved[0][l], moved[1][l], moved[2][l]]);
        }
        if let Some(at) = channels.opacity {
            let own = surfels.opacity.get(faces[l].0 as usize).copied().unwrap_or(1.0);
            out[at] = shown.object.opacity * own;
        }
        if let Some(at) = channels.velocity {
            let velocity = velocity(surfels, &paths, faces[l].0 as usize, shown);
            out[at..at + 2].copy_from_slice(&velocity.map(|v| v * shown.stride));
        }
        if let Some(at) = channels.material {
            for (out, lanes) in out[at..at + 4].iter_mut().zip(&of_material) {
                *out = lanes[l];
            }
        }
    }
}

/// The ways from where surfels are when they are read out, at these times of a strip, to where they are in its middle:
/// world axes.
#[inline(always)]
fn to_middle(shown: &Shown<'_>, faces: &[(u32, u32); LANES], times: &Lanes) -> [Lanes; 3] {
    let posed = shown.posed;
    if shown.strip.is_none() {
        return [[0.0; LANES]; 3];
    }
    let (surfels, paths) = (&**shown.model.surfels(), shown.model.paths());
    let (mut place, mut advance) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
    for l in 0..LANES {
        let i = faces[l].0 as usize;
        (place[0][l], place[1][l], place[2][l]) = paths.place(surfels.position[i], i, posed.elapsed).into();
        (advance[0][l], advance[1][l], advance[2][l]) = paths.sum(i, posed.advance).into();
    }
    let motion = transform(&posed.motion_from_model, posed.motion_origin, &place);
    let by_itself = transform(&posed.centre_from_model, Vec3::ZERO, &advance);
    // Screen space is (f X, -f Y, -Z) of the camera's.
    let focal = shown.focal;
    let mut moved = [[0.0; LANES]; 3];
    for l in 0..LANES {
        let [x, y, depth] = [0, 1, 2].map(|c: usize| -times[l] * (motion[c][l] + by_itself[c][l]));
        (moved[0][l], moved[1][l], moved[2][l]) = (x / focal, -(y / focal), -depth);
    }
    transform(&shown.sample.world_from_camera, Vec3::ZERO, &moved)
}

/// The equation of `shading::shade`, for `LANES` surfels.
#[inline(always)]
fn lit(
    shown: &Shown<'_>,
    colour: &[Lanes; 3],
    normal: &[Lanes; 3],
    position: &[Lanes; 3],
    moved: Option<&Moved>,
    view: &[Lanes; 3],
    material: &[Lanes; 4],
) -> [Lanes; 3] {
    let mut out = [[0.0; LANES]; 3];
    for (number, light) in shown.sample.lights.iter().enumerate() {
        let mut seen = [1.0; LANES];
        if let (Some(shadows), true) = (shown.shadows, light.has_shadows()) {
            let asked = moved.map_or(*position, |moved| shadows.asked(number, moved));
            seen = shadows.seen(number, light, [normal, position], &asked, &shadows.depth(&asked));
        }
        match *light {
            ShadingLight::Ambient { colour: of_light } => {
                for c in 0..3 {
                    for l in 0..LANES {
                        out[c][l] += material[0][l] * colour[c][l] * of_light[c];
                    }
                }
            }
            ShadingLight::Harmonics { terms } => {
                for l in 0..LANES {
                    add_smooth_light(&mut out, l, &material[1], colour, normal, &terms);
                }
            }
            ShadingLight::Directional { towards, colour: of_light, .. } => {
                let towards = towards.to_array();
                for l in 0..LANES {
                    add_lobes(&mut out, l, material, colour, normal, view, towards, of_light, seen[l]);
                }
            }
            ShadingLight::Point { position: of_light, colour: radiance, .. } => {
                for l in 0..LANES {
                    let at = [position[0][l], position[1][l], position[2][l]];
                    let (towards, falloff) = towards_point(of_light.to_array(), at);
                    add_lobes(&mut out, l, material, colour, normal, view, towards, radiance, falloff * seen[l]);
                }
            }
        }
    }
    out
}

/// Adds what surfels mirror. The width of the image in a curved surface is not known: it shows the direction of each
/// surfel's centre.
#[inline(always)]
fn mirror(shown: &Shown<'_>, colour: &mut [Lanes; 3], normal: &[Lanes; 3], view: &[Lanes; 3]) {
    let reflection = shown.object.reflection;
    let Some(surroundings) = shown.surroundings.filter(|_| reflection > 0.0) else { return };
    for l in 0..LANES {
        let towards = mirrored([normal[0][l], normal[1][l], normal[2][l]], [view[0][l], view[1][l], view[2][l]]);
        let seen = surroundings.radiance(towards, shown.pixel * shown.pixel);
        for c in 0..3 {
            colour[c][l] += seen[c] * reflection;
        }
    }
}

/// Screen velocity of a surfel's centre, raster pixels per shutter: the derivative of (x, y) = (X, Y) / depth. 0 where
/// the centre has no image, being nearer than `near`.
fn velocity(surfels: &Surfels, paths: &Paths<'_>, i: usize, shown: &Shown<'_>) -> [f32; 2] {
    let posed = shown.posed;
    let place = paths.place(surfels.position[i], i, posed.elapsed);
    let p = posed.screen_from_model * place + posed.screen_origin;
    let own = posed.screen_from_model * (paths.velocity(i, posed.elapsed) * posed.pace);
    let rate = posed.screen_rate * place + posed.screen_origin_rate + own;
    if p.z < shown.near {
        return [0.0; 2];
    }
    let over = 1.0 / p.z;
    [(rate.x - p.x * over * rate.z) * over, (rate.y - p.y * over * rate.z) * over]
}

/// Adds what one light contributes to lane `l`: the diffuse and the specular term.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one loop body, shared by pixels and surfels")]
pub(in crate::backend) fn add_lobes(
    out: &mut [Lanes; 3],
    l: usize,
    material: &[Lanes; 4],
    colour: &[Lanes; 3],
    normal: &[Lanes; 3],
    view: &[Lanes; 3],
    towards: [f32; 3],
    light: Vec3,
    falloff: f32,
) {
    let n = [normal[0][l], normal[1][l], normal[2][l]];
    let v = [view[0][l], view[1][l], view[2][l]];
    let (diffuse, specular) = lobes(n, towards, v, material[3][l]);
    let light = light.to_array();
    for c in 0..3 {
        out[c][l] += light[c] * falloff * (material[1][l] * diffuse * colour[c][l] + material[2][l] * specular);
    }
}

/// Adds what light from all around contributes to lane `l`.
#[inline(always)]
pub(in crate::backend) fn add_smooth_light(
    out: &mut [Lanes; 3],
    l: usize,
    diffuse: &Lanes,
    colour: &[Lanes; 3],
    normal: &[Lanes; 3],
    terms: &[Vec3; 9],
) {
    let light = smooth_light(terms, [normal[0][l], normal[1][l], normal[2][l]]);
    for c in 0..3 {
        out[c][l] += diffuse[l] * colour[c][l] * light[c];
    }
}

/// Vectors of length 1; a zero vector stays zero.
#[inline(always)]
pub(in crate::backend) fn unit(mut v: [Lanes; 3]) -> [Lanes; 3] {
    for l in 0..LANES {
        let d2 = v[0][l] * v[0][l] + v[1][l] * v[1][l] + v[2][l] * v[2][l];
        let s = 1.0 / (if d2 > 1e-30 { d2 } else { 1e-30 }).sqrt();
        v[0][l] *= s;
        v[1][l] *= s;
        v[2][l] *= s;
    }
    v
}
