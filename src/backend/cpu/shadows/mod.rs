//! Shadow maps: what each light with shadows sees at a time sample, and whether it sees a place.
//!
//! In: the posed surfels of all opaque objects, seen by the camera or not. Out: for each light, maps of the depth at
//! which its light ends. Order-free. Math: docs/math.md, section 17.
//!
//! A map keeps the surfel whose plane, moved away from the light by the depth tolerance of its object, comes first in a
//! texel. A place is lit if it is not behind that plane on the ray of its own. So a surface casts no shadow on itself,
//! however oblique the light is. Each time sample has other points on lights, and grids of maps that begin elsewhere:
//! edges of shadows converge with the samples, without a filter.

mod fit;
mod map;
mod view;

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use self::fit::{Fit, SLICES, slice_of};
use self::map::{Caster, ShadowMap};
use self::view::LightView;
use super::chunk::CHUNK;
use crate::frame::{Frame, PosedObject, PosedSample, Raster};
use crate::model::Surfels;
use crate::sampling::hash;
use crate::scene::SurfelModel;
use crate::shading::ShadingLight;

/// Most texels of all maps of a light for each pixel of the image; and the least such number.
const TEXELS_OF_PIXEL: u64 = 8;
const LEAST_TEXELS: u64 = 1 << 20;

/// Maps of a light that a surfel is on, in the mean.
const CASTER_MAPS: usize = 6;
/// Distance of a point light, in those of the farthest surfel, beyond which its rays count as parallel.
const PARALLEL: f32 = 3000.0;
/// Units in the last place of all that is added to find a distance.
const ROUNDING: f32 = 8.0 * f32::EPSILON;
/// Least cosine between a surface and the light for which the tolerance along the ray grows.
const GRAZING: f32 = 0.1;

/// The shadow maps of all lights of a time sample.
#[derive(Debug, Default)]
pub(in crate::backend) struct Shadows {
    /// One for each light; `None` without shadows.
    lights: Vec<Option<LightMaps>>,
    near: f32,
    /// Memory of maps that are gone.
    spare: Vec<ShadowMap>,
}

/// The maps of one light: of each of its views, for each slice of depths before the camera.
#[derive(Debug)]
struct LightMaps {
    views: Vec<LightView>,
    /// View by view; empty where the slice has nothing that the light could reach.
    maps: Vec<ShadowMap>,
}

impl Shadows {
    /// Bytes of the maps and of what is drawn on them, at the most.
    pub(in crate::backend) fn most_bytes(frame: &Frame) -> u64 {
        let Some(sample) = frame.all_samples().next() else { return 0 };
        let lights = sample.lights.iter().filter(|light| light.has_shadows()).count() as u64;
        if lights == 0 {
            return 0;
        }
        let surfels: usize = frame.objects.iter().filter_map(|o| o.shape.surfels()).map(|m| m.surfels().len()).sum();
        // A surfel is on the maps of a few slices, and in a few lists of each.
        let of_surfel = (CASTER_MAPS * (size_of::<Caster>() + 2 * size_of::<u32>())) as u64;
        let maps = most_texels(frame) * ShadowMap::BYTES_OF_TEXEL + surfels as u64 * of_surfel;
        surfels as u64 * size_of::<Vec3>() as u64 + lights * maps
    }

    /// Draws the maps of all lights at `sample`, for receivers that a camera with this raster sees.
    pub(in crate::backend) fn draw(&mut self, frame: &Frame, sample: &PosedSample, raster: &Raster) {
        self.clear();
        self.near = frame.near;
        let runs = Run::all(frame, sample);
        let right = sample.world_from_camera.x_axis;
        let extent = runs.iter().map(|run| run.middle.length() + run.reach);
        let extent = extent.filter(|length| length.is_finite()).fold(frame.near, f32::max);
        for (number, light) in (0..).zip(&sample.lights) {
            let views = match *light {
                ShadingLight::Directional { towards, shadows: true, .. } => {
                    vec![LightView::directional(towards, right)]
                }
                // So far away rays are as good as parallel, and rounding would hide what they meet.
                ShadingLight::Point { position, shadows: true, .. } if position.length() > PARALLEL * extent => {
                    vec![LightView::directional(position.normalize_or(Vec3::Y), right)]
                }
                ShadingLight::Point { position, shadows: true, .. } => LightView::faces(position).to_vec(),
                _ => {
                    self.lights.push(None);
                    continue;
                }
            };
            let fit = Fit::of(&runs, &views, sample, raster, frame);
            let jitter = jitter(sample, number);
            let areas = fit.areas(raster.focal * frame.stride as f32, most_texels(frame) as f64, jitter);
            let mut maps = Vec::with_capacity(areas.len());
            for (at, area) in areas.iter().enumerate() {
                let mut map = ShadowMap::default();
                if area.size[0] > 0 {
                    map = self.spare.pop().unwrap_or_default();
                    map.draw(*area, &views[at / SLICES], &runs);
                }
                maps.push(map);
            }
            self.lights.push(Some(LightMaps { views, maps }));
        }
    }

    /// Empties it; its memory stays.
    fn clear(&mut self) {
        let maps = self.lights.drain(..).flatten().flat_map(|light| light.maps);
        self.spare = maps.filter(|map| !map.is_empty()).collect();
        // The next maps take them from the end: each that of the one before it.
        self.spare.reverse();
    }

    /// The share of light `light`, which has this number, that reaches a place: 0 or 1. `place`: relative to the eye,
    /// world axes. `depth`: that before the camera. What faces away from the light needs no map: it is dark.
    pub(in crate::backend) fn lit(
        &self,
        number: usize,
        light: &ShadingLight,
        normal: [f32; 3],
        place: [f32; 3],
        depth: f32,
    ) -> f32 {
        let Some(Some(LightMaps { views, maps })) = self.lights.get(number) else { return 1.0 };
        let place = Vec3::from(place);
        let towards = match *light {
            ShadingLight::Directional { towards, .. } => towards,
            ShadingLight::Point { position, .. } => position - place,
            ShadingLight::Ambient { .. } => return 1.0,
        };
        if Vec3::from(normal).dot(towards) <= 0.0 {
            return 0.0;
        }
        let view = LightView::facing(views, place);
        let map = &maps[view * SLICES + slice_of(depth, self.near)];
        if map.is_empty() || map.lights(&views[view], place) { 1.0 } else { 0.0 }
    }
}

/// Most texels of all maps of a light.
fn most_texels(frame: &Frame) -> u64 {
    (u64::from(frame.size[0]) * u64::from(frame.size[1]) * TEXELS_OF_PIXEL).max(LEAST_TEXELS)
}

/// Where the grid of a light's maps begins, texels in [0, 1): another place for each point on the light and each time.
fn jitter(sample: &PosedSample, light: u64) -> [f32; 2] {
    let seed = sample.time.to_bits() ^ sample.number.rotate_left(40);
    [0, 1].map(|d| hash(seed, 2 * light + d) as f32 / 4_294_967_296.0)
}

/// Some surfels of an opaque object at a time sample.
pub(super) struct Run<'a> {
    object: &'a PosedObject,
    surfels: &'a Surfels,
    /// Number of the first one.
    first: usize,
    /// Relative to the eye, world axes.
    centres: Vec<Vec3>,
    /// Middle and radius of a ball around all; not numbers where no centre is finite.
    middle: Vec3,
    reach: f32,
    /// Factor on radii, at the most.
    stretch: f32,
    /// No radius is larger.
    most_radius: f32,
}

impl<'a> Run<'a> {
    /// All that are visible, as far as their objects are.
    fn all(frame: &'a Frame, sample: &'a PosedSample) -> Vec<Self> {
        let of = |is_static| frame.visible_surfels(sample, is_static, false);
        let runs = of(true).chain(of(false)).flat_map(|(index, model)| {
            let len = model.surfels().len();
            let runs = (0..len).step_by(CHUNK).map(move |first| first..(first + CHUNK).min(len));
            runs.map(move |run| (&sample.objects[index], model, run))
        });
        let runs: Vec<_> = runs.collect();
        runs.into_par_iter().map(|(object, model, run)| Self::of(object, model, run)).collect()
    }

    fn of(object: &'a PosedObject, model: &'a SurfelModel, run: Range<usize>) -> Self {
        let (surfels, paths) = (model.surfels(), model.paths());
        let centre = |i: usize| {
            let place = paths.place(surfels.position[i], i, object.elapsed);
            object.world_from_model * place + object.world_origin
        };
        let axes = surfels.axis_u[run.clone()].iter().zip(&surfels.axis_v[run.clone()]);
        let most = axes.map(|(u, v)| u.length_squared() + v.length_squared()).fold(0.0, f32::max);
        // A map stretches by no more than the root of the sum of the squares of its columns.
        let linear = object.world_from_model;
        let stretch = linear.x_axis.length_squared() + linear.y_axis.length_squared() + linear.z_axis.length_squared();
        let (first, stretch) = (run.start, stretch.sqrt());
        let centres: Vec<Vec3> = run.map(centre).collect();
        let most_radius = most.sqrt() * stretch;
        let finite = centres.iter().filter(|centre| centre.is_finite());
        let bounds = finite.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[a, b], c| [a.min(*c), b.max(*c)]);
        let middle = 0.5 * (bounds[0] + bounds[1]);
        let reach = 0.5 * (bounds[1] - bounds[0]).length() + most_radius;
        Self { object, surfels, first, centres, middle, reach, stretch, most_radius }
    }

    /// A radius within which the surfel lies whose centre is `centres[i]`.
    fn radius(&self, i: usize) -> f32 {
        let [u, v] = [&self.surfels.axis_u, &self.surfels.axis_v].map(|axes| axes[self.first + i].length_squared());
        (u + v).sqrt() * self.stretch
    }

    /// The axes of the surfel whose centre is `centres[i]`.
    fn axes(&self, i: usize) -> [Vec3; 2] {
        let linear = self.object.world_from_model;
        [linear * self.surfels.axis_u[self.first + i], linear * self.surfels.axis_v[self.first + i]]
    }
}
