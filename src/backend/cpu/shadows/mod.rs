//! Shadow maps: what each light with shadows sees at a time sample, and whether it sees a place.
//!
//! In: the posed surfels of all objects that cast, seen by the camera or not. Out: for each light, maps of the depth at
//! which its light ends. Order-free. Math: docs/math.md, section 17.
//!
//! A map keeps the surfel whose plane, moved away from the light by the depth tolerance of its object, comes first in a
//! texel. A place is lit if it is not behind that plane on the ray of its own. So a surface casts no shadow on itself,
//! however oblique the light is. Each time sample has other points on lights, and grids of maps that begin elsewhere:
//! edges of shadows converge with the samples, without a filter.

mod caster;
mod cells;
pub(in crate::backend) mod centres;
mod discs;
pub(in crate::backend) mod fit;
mod layers;
pub(in crate::backend) mod map;
mod moved;
mod run;
pub(in crate::backend) mod splats;
pub(in crate::backend) mod view;

use std::sync::Arc;

use glam::Vec3;

use self::caster::{Caster, Onto, Plane};
use self::centres::Centres;
use self::fit::{Fit, SLICES, slice_of, with_borders};
use self::layers::Layers;
use self::map::ShadowMap;
pub(in crate::backend) use self::moved::Moved;
use self::run::Run;
use self::splats::{Disc, Splats};
use self::view::LightView;
use super::columns::point;
use super::tiles::{LANES, Lanes};
use crate::backend::clusters::Clusters;
use crate::frame::{Frame, PosedSample, Raster};
use crate::plan::LAYERS;
use crate::sampling::{self, hash};
use crate::shading::ShadingLight;

/// Most texels of all maps of a light for each pixel of the image; and the least such number.
const TEXELS_OF_PIXEL: u64 = 8;
const LEAST_TEXELS: u64 = 1 << 18;

/// Maps of a light that a surfel is on, in the mean.
const CASTER_MAPS: usize = 6;
/// Units in the last place of all that is added to find a distance.
const ROUNDING: f32 = 8.0 * f32::EPSILON;
/// Least cosine between a surface and the light for which the tolerance along the ray grows.
pub(in crate::backend) const GRAZING: f32 = 0.1;

/// The shadow maps of all lights of a time sample.
#[derive(Debug, Default)]
pub(in crate::backend) struct Shadows {
    /// One for each light; `None` without shadows.
    lights: Vec<Option<LightMaps>>,
    near: f32,
    /// Towards the camera from what it sees.
    back: Vec3,
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
        let of_surfel = (CASTER_MAPS * (size_of::<Caster>() + size_of::<Plane>() + 2 * size_of::<u32>())) as u64;
        let of_layers = if frame.has_see_through() { Layers::BYTES_OF_TEXEL } else { 0 };
        let of_captures = frame.objects.iter().any(|object| frame.casts_splats(object) && !object.is_volume());
        let of_texel = ShadowMap::BYTES_OF_TEXEL * (1 + u64::from(of_captures)) + of_layers;
        let gaussians: usize =
            frame.objects.iter().filter_map(|o| o.shape.gaussians()).map(|m| m.gaussians().len()).sum();
        let of_gaussian = of_surfel + size_of::<Disc>() as u64;
        let maps = with_borders(most_texels(frame)) * of_texel
            + surfels as u64 * of_surfel
            // Half of them are drawn, if so many.
            + gaussians as u64 / 2 * of_gaussian;
        lights * maps
    }

    /// Draws the maps of all lights at `sample`, for receivers that a camera with this raster sees. `clusters`: one for
    /// each object, or none.
    pub(in crate::backend) fn draw(
        &mut self,
        frame: &Frame,
        sample: &PosedSample,
        raster: &Raster,
        clusters: &[Arc<Clusters>],
    ) {
        self.clear();
        self.near = frame.near;
        self.back = sample.world_from_camera.z_axis;
        let runs = Run::all(frame, sample, clusters);
        let casts_any = splats::reaches(frame, sample).next().is_some();
        if runs.is_empty() && !casts_any {
            self.lights.extend(sample.lights.iter().map(|_| None));
            return;
        }
        let centres = Centres::all(frame, sample);
        let right = sample.world_from_camera.x_axis;
        let lengths = runs.iter().map(|run| run.middle.length() + run.reach);
        let lengths = lengths.chain(centres.iter().map(Centres::extent)).chain(splats::reaches(frame, sample));
        let extent = lengths.filter(|length| length.is_finite()).fold(frame.near, f32::max);
        for (number, light) in (0..).zip(&sample.lights) {
            let Some(views) = LightView::of(light, right, extent) else {
                self.lights.push(None);
                continue;
            };
            let splats = Splats::all(frame, sample, &views[0], number);
            let fit = Fit::of(&runs, &centres, &views, sample, raster, frame);
            let (jitter, chances) = (jitter(sample, number), chances(frame, sample, number));
            let areas = fit.areas(raster.focal * frame.stride as f32, most_texels(frame), jitter);
            let mut maps = Vec::with_capacity(areas.len());
            for (at, area) in areas.iter().enumerate() {
                let mut map = ShadowMap::default();
                if area.size[0] > 0 {
                    map = self.spare.pop().unwrap_or_default();
                    let (view, ground) = (&views[at / SLICES], &fit.grounds[at / SLICES]);
                    let onto = Onto { area, view, cells: &fit.cells[at], ground, chances: &chances };
                    map.draw(&onto, &runs, &splats);
                }
                maps.push(map);
            }
            self.lights.push(Some(LightMaps { views, maps }));
        }
    }

    /// Does the light with this number reach `place`, relative to the eye in world axes, which lies at `depth` before
    /// the camera? No capture keeps it away from captures.
    pub(in crate::backend) fn reaches(&self, number: usize, place: Vec3, depth: f32, of_capture: bool) -> bool {
        let Some(Some(LightMaps { views, maps })) = self.lights.get(number) else { return true };
        let view = LightView::facing(views, place);
        let map = &maps[view * SLICES + slice_of(depth, self.near)];
        let (on_plane, is_point) = (views[view].on_plane(place), views[0].is_point);
        if of_capture {
            return map.lights_capture(on_plane, place, is_point);
        }
        map.lights(&on_plane.map(|x| [x]), &place.to_array().map(|x| [x]), is_point) != [0.0]
    }

    /// Empties it; its memory stays.
    fn clear(&mut self) {
        let maps = self.lights.drain(..).flatten().flat_map(|light| light.maps);
        self.spare = maps.filter(|map| !map.is_empty()).collect();
        // The next maps take them from the end: each that of the one before it.
        self.spare.reverse();
    }

    /// The depths before the camera of `LANES` places.
    #[inline(always)]
    pub(in crate::backend) fn depth(&self, place: &[Lanes; 3]) -> Lanes {
        let axis = self.back;
        let mut depth = [0.0; LANES];
        for l in 0..LANES {
            depth[l] = -(axis.x * place[0][l] + axis.y * place[1][l] + axis.z * place[2][l]);
        }
        depth
    }

    /// Where the shadows of light `number` are asked for what moves within the group.
    #[inline(always)]
    pub(in crate::backend) fn asked(&self, number: usize, moved: &Moved) -> [Lanes; 3] {
        let Some(Some(LightMaps { views, .. })) = self.lights.get(number) else { return moved.place };
        moved.asked(&views[0])
    }

    /// The shares of light `light`, which has this number, that reach `LANES` surfaces with these normals and places: 0
    /// or 1 each. Places are relative to the eye, world axes. What faces away from the light needs no map: it is dark.
    /// `asked`: where the map is asked, at these depths before the camera.
    #[inline(always)]
    pub(in crate::backend) fn seen(
        &self,
        number: usize,
        light: &ShadingLight,
        [normal, place]: [&[Lanes; 3]; 2],
        asked: &[Lanes; 3],
        depth: &Lanes,
    ) -> Lanes {
        let Some(Some(LightMaps { views, maps })) = self.lights.get(number) else { return [1.0; LANES] };
        let mut towards = [[0.0; LANES]; 3];
        match *light {
            ShadingLight::Directional { towards: of_all, .. } => towards = of_all.to_array().map(|x| [x; LANES]),
            ShadingLight::Point { position, .. } => {
                for (c, towards) in towards.iter_mut().enumerate() {
                    for l in 0..LANES {
                        towards[l] = position[c] - place[c][l];
                    }
                }
            }
            ShadingLight::Ambient { .. } | ShadingLight::Harmonics { .. } => return [1.0; LANES],
        }
        let mut cosine = [0.0; LANES];
        for l in 0..LANES {
            cosine[l] = normal[0][l] * towards[0][l] + normal[1][l] * towards[1][l] + normal[2][l] * towards[2][l];
        }
        let slices = depth.map(|depth| slice_of(depth, self.near));
        let is_point = views[0].is_point;
        let mut seen = [0.0; LANES];
        let Some(first) = (0..LANES).find(|&l| cosine[l] > 0.0) else { return seen };
        // Rays that are parallel have one view. Neighbours are seldom in several slices.
        if !is_point && (0..LANES).all(|l| slices[l] == slices[first] || cosine[l] <= 0.0) {
            seen = maps[slices[first]].lights(&views[0].lanes_on_plane(asked), asked, false);
            for l in 0..LANES {
                seen[l] = if cosine[l] <= 0.0 { 0.0 } else { seen[l] };
            }
            return seen;
        }
        for l in (0..LANES).filter(|&l| cosine[l] > 0.0) {
            let at = point(asked, l);
            let view = LightView::facing(views, at);
            let on_plane = views[view].on_plane(at).map(|x| [x]);
            [seen[l]] = maps[view * SLICES + slices[l]].lights(&on_plane, &at.to_array().map(|x| [x]), is_point);
        }
        seen
    }
}

/// Most texels of all maps of a light.
pub(in crate::backend) fn most_texels(frame: &Frame) -> u64 {
    (u64::from(frame.size[0]) * u64::from(frame.size[1]) * TEXELS_OF_PIXEL).max(LEAST_TEXELS)
}

/// Where the grid of a light's maps begins, texels in [0, 1): another place for each point on the light and each time.
pub(in crate::backend) fn jitter(sample: &PosedSample, light: u64) -> [f32; 2] {
    let seed = sample.time.to_bits() ^ sample.number.rotate_left(40);
    [0, 1].map(|d| hash(seed, 2 * light + d) as f32 / 4_294_967_296.0)
}

/// Numbers in [0, 1), one for each layer of see-through surfels on the maps of a light: a layer stops the light of the
/// sample if its opacity is above that. A picture of one sample has no mean: 1/2.
pub(in crate::backend) fn chances(frame: &Frame, sample: &PosedSample, light: u64) -> [f32; LAYERS as usize] {
    if frame.groups().nth(1).is_none() {
        return [0.5; LAYERS as usize];
    }
    // Classes of pixels differ in the upper half.
    let seed = hash(sample.number >> 32, light);
    sampling::chances(sample.number as u32, seed)
}

#[cfg(test)]
mod tests;
