//! Shading per surfel (Gouraud): what the splats of a chunk show under the lights of their sample.
//!
//! In: the surfels of the splats and the sides that they show. Out: a colour for each. Order-free.

use glam::Vec3;

use super::attribute::{Attributes, material};
use super::tiles::LANES;
use crate::layout::{FLAG_BACK, Splat, SweptSplat};
use crate::math::simd::dispatch;
use crate::shading::{ShadingLight, lobes, towards_point};

/// Whose colour it is.
pub(super) trait Faced {
    /// Surfel and flags.
    fn face(&self) -> (u32, u32);
}

impl Faced for Splat {
    fn face(&self) -> (u32, u32) {
        (self.surfel, self.flags)
    }
}

impl Faced for SweptSplat {
    fn face(&self) -> (u32, u32) {
        (self.surfel, self.flags)
    }
}

/// Colours of `splats`, into `out`.
pub(super) fn light<S: Faced>(splats: &[S], attributes: &Attributes<'_>, out: &mut Vec<Vec3>) {
    out.clear();
    out.reserve(splats.len());
    for splats in splats.chunks(LANES) {
        let mut faces = [(0, 0); LANES];
        faces.iter_mut().zip(splats).for_each(|(face, splat)| *face = splat.face());
        // The last ones repeat a surfel that there is.
        let first = faces[0];
        faces[splats.len()..].fill(first);
        let colours = light_lanes(&faces, attributes);
        out.extend_from_slice(&colours[..splats.len()]);
    }
}

type Lanes = [f32; LANES];

dispatch! {
    fn light_lanes(faces: &[(u32, u32); LANES], attributes: &Attributes<'_>) -> [Vec3; LANES] = light_lanes_body
}

/// The equation of `shading::shade`, for `LANES` surfels.
#[inline(always)]
fn light_lanes_body(faces: &[(u32, u32); LANES], attributes: &Attributes<'_>) -> [Vec3; LANES] {
    let surfels = attributes.object.surfels;
    let mut normal = [[0.0; LANES]; 3];
    let mut position = [[0.0; LANES]; 3];
    let mut colour = [[0.0; LANES]; 3];
    let mut of_material = [[0.0; LANES]; 4];
    for l in 0..LANES {
        let (surfel, flags) = faces[l];
        let i = surfel as usize;
        let side = if flags & FLAG_BACK == 0 { 1.0 } else { -1.0 };
        let m = material(attributes, i);
        for c in 0..3 {
            normal[c][l] = side * surfels.normal[i][c];
            position[c][l] = surfels.position[i][c];
            colour[c][l] = surfels.colour[i][c];
        }
        [of_material[0][l], of_material[1][l], of_material[2][l], of_material[3][l]] =
            [m.ambient, m.diffuse, m.specular, m.shininess];
    }
    let normal = unit(transform(attributes.posed.normal_matrix.to_cols_array_2d(), [0.0; 3], &normal));
    let world = attributes.posed.world_from_model.to_cols_array_2d();
    let position = transform(world, attributes.posed.world_origin.to_array(), &position);
    let view = unit(position.map(|p| p.map(|p| -p)));
    let mut out = [[0.0; LANES]; 3];
    for light in &attributes.sample.lights {
        match *light {
            ShadingLight::Ambient { colour: of_light } => {
                for c in 0..3 {
                    for l in 0..LANES {
                        out[c][l] += of_material[0][l] * colour[c][l] * of_light[c];
                    }
                }
            }
            ShadingLight::Directional { towards, colour: of_light } => {
                let towards = towards.to_array();
                for l in 0..LANES {
                    add_lobes(&mut out, l, &of_material, &colour, &normal, &view, towards, of_light, 1.0);
                }
            }
            ShadingLight::Point { position: of_light, colour: radiance } => {
                for l in 0..LANES {
                    let at = [position[0][l], position[1][l], position[2][l]];
                    let (towards, falloff) = towards_point(of_light.to_array(), at);
                    add_lobes(&mut out, l, &of_material, &colour, &normal, &view, towards, radiance, falloff);
                }
            }
        }
    }
    std::array::from_fn(|l| Vec3::new(out[0][l], out[1][l], out[2][l]))
}

/// Adds what one light contributes to lane `l`: the diffuse and the specular term.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one loop body, shared by pixels and surfels")]
pub(super) fn add_lobes(
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

#[inline(always)]
fn transform(m: [[f32; 3]; 3], origin: [f32; 3], v: &[Lanes; 3]) -> [Lanes; 3] {
    let mut out = [[0.0; LANES]; 3];
    for row in 0..3 {
        for l in 0..LANES {
            out[row][l] = m[0][row] * v[0][l] + m[1][row] * v[1][l] + m[2][row] * v[2][l] + origin[row];
        }
    }
    out
}

/// Vectors of length 1; a zero vector stays zero.
#[inline(always)]
pub(super) fn unit(mut v: [Lanes; 3]) -> [Lanes; 3] {
    for l in 0..LANES {
        let d2 = v[0][l] * v[0][l] + v[1][l] * v[1][l] + v[2][l] * v[2][l];
        let s = 1.0 / (if d2 > 1e-30 { d2 } else { 1e-30 }).sqrt();
        v[0][l] *= s;
        v[1][l] *= s;
        v[2][l] *= s;
    }
    v
}
