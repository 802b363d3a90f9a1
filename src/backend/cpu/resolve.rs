//! Pass `resolve`: normalise, shade, add to the film with the time weight (Wolf 2008, 4.1.1, eq. 4.14).
//!
//! In: a tile's sums and coverage. Out: the tile's film. One sample position at a time, order-free.

use super::mirror::{Mirror, Rows, rays};
use super::shadows::Shadows;
use super::tiles::{LANES, Lanes, ROWS, STRIDE, TILE, TileRect, lanes};
use super::values::{add_lobes, add_smooth_light, unit};
use crate::environment::Surroundings;
use crate::film::{Film, FilmPlanes};
use crate::frame::{PosedSample, Raster, RasterArea};
use crate::layout::Channels;
use crate::math::simd::dispatch;
use crate::options::Shading;
use crate::shading::{ShadingLight, agreement, towards_point};

/// Film of one tile: plane by plane, `TILE` x `TILE`; empty until something is added.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct TileFilm {
    pub values: Vec<f32>,
    /// T(x) of the picture's surfels, as in `TileBuffers`, where something transparent is laid over it. Empty where no
    /// surfel shows, and in all other pictures.
    pub threshold: Vec<f32>,
}

impl TileFilm {
    /// Bytes of one tile's film and its thresholds.
    pub(in crate::backend) const fn bytes_with_threshold(planes: usize) -> u64 {
        Self::bytes(planes) + (ROWS * STRIDE * size_of::<f32>()) as u64
    }

    /// Empties it; its memory stays.
    pub(in crate::backend) fn clear(&mut self) {
        self.values.clear();
        self.threshold.clear();
    }

    /// Bytes of one tile's film.
    pub(in crate::backend) const fn bytes(planes: usize) -> u64 {
        (planes * TILE * TILE * size_of::<f32>()) as u64
    }
}

/// All tiles of a raster, row by row.
#[derive(Debug, Default)]
pub(in crate::backend) struct TiledFilm {
    pub tiles: Vec<TileFilm>,
    pub tiles_x: usize,
}

impl TiledFilm {
    /// Makes it an empty film of `size` pixels. Its memory is used again: to clear it is faster
    /// than to allocate.
    pub(in crate::backend) fn empty(&mut self, size: [u32; 2]) {
        let [tiles_x, tiles_y] = size.map(|pixels| (pixels as usize).div_ceil(TILE));
        self.tiles.iter_mut().for_each(TileFilm::clear);
        self.tiles.resize_with(tiles_x * tiles_y, TileFilm::default);
        self.tiles_x = tiles_x;
    }

    /// Writes row `y` of plane `plane` to every `stride`-th place of `out`, from the first.
    fn row(&self, plane: usize, y: usize, stride: usize, out: &mut [f32]) {
        let tiles = &self.tiles[y / TILE * self.tiles_x..];
        for (out, tile) in out.chunks_mut(TILE * stride).zip(tiles) {
            let first = (plane * TILE + y % TILE) * TILE;
            let pixels = out.len().div_ceil(stride);
            match tile.values.get(first..first + pixels) {
                Some(row) if stride == 1 => out.copy_from_slice(row),
                Some(row) => out.iter_mut().step_by(stride).zip(row).for_each(|(out, value)| *out = *value),
                None => out.iter_mut().step_by(stride).for_each(|out| *out = 0.0),
            }
        }
    }
}

/// The films of all rasters of a frame.
#[derive(Debug)]
pub(in crate::backend) struct RasterFilms {
    pub films: Vec<TiledFilm>,
    /// The pixels of each.
    pub areas: Vec<RasterArea>,
    pub stride: usize,
    /// Time samples of a pixel.
    pub samples: u32,
}

impl Film for RasterFilms {
    fn row(&self, plane: usize, y: u32, out: &mut [f32]) {
        for (area, film) in self.areas.iter().zip(&self.films) {
            let write = |row: usize, out: &mut [f32]| film.row(plane, row, self.stride, out);
            area.fill(y as usize, self.stride, out, write);
        }
    }

    fn samples(&self, _y: u32, out: &mut [f32]) {
        out.fill(self.samples as f32);
    }
}

/// What the pass needs beside sums.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Resolve<'a> {
    /// The sample whose camera and lights shade.
    pub sample: &'a PosedSample,
    /// Share of the exposure of a group of one sample.
    pub weight: f32,
    pub channels: &'a Channels,
    pub planes: &'a FilmPlanes,
    pub shading: Shading,
    /// What surfaces mirror.
    pub surroundings: Option<&'a Surroundings>,
    /// What turns a pixel into a ray.
    pub raster: &'a Raster,
    /// `None`: no light has any.
    pub shadows: Option<&'a Shadows>,
}

dispatch! {
    /// Adds the sums of one group or interval to `film`, where they cover each pixel for the share `coverage` of the
    /// exposure.
    pub(in crate::backend) fn resolve(
        resolve: &Resolve<'_>, tile: &TileRect, sums: &[f32], coverage: &[f32], film: &mut TileFilm,
    ) = resolve_body
}

#[inline(always)]
fn resolve_body(resolve: &Resolve<'_>, tile: &TileRect, sums: &[f32], coverage: &[f32], film: &mut TileFilm) {
    let row = resolve.channels.count * STRIDE;
    film.values.resize(resolve.planes.count * TILE * TILE, 0.0);
    for y in 0..tile.height {
        for x in (0..tile.width).step_by(LANES) {
            let rows = Rows::new(sums, row, y, tile);
            let weights: Lanes = lanes(&rows.own[x..]);
            if weights.iter().all(|&weight| weight == 0.0) {
                continue;
            }
            let inverse = weights.map(|weight| if weight > 0.0 { 1.0 / weight } else { 0.0 });
            add_lanes(resolve, tile, [x, y], rows, &inverse, &lanes(&coverage[y * STRIDE + x..]), 1.0, film);
        }
    }
}

/// Adds what `LANES` pixels from pixel `[x, y]` of the tile on show, with `share` of each covered. `inverse`: 1 / sum
/// of weights.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "an inner loop, called in two places")]
pub(in crate::backend::cpu) fn add_lanes(
    resolve: &Resolve<'_>,
    tile: &TileRect,
    [x, y]: [usize; 2],
    rows: Rows<'_>,
    inverse: &Lanes,
    share: &Lanes,
    weight: f32,
    film: &mut TileFilm,
) {
    let channels = resolve.channels;
    let mean = |channel: usize| rows.mean(channel, x, inverse);
    let mut colour = [mean(1), mean(2), mean(3)];
    let mean_normal = channels.normal.map(|at| [mean(at), mean(at + 1), mean(at + 2)]);
    let normal = mean_normal.map(unit);
    if let (Shading::Phong, Some(first), Some(mean_normal), Some(normal)) =
        (resolve.shading, channels.normal, &mean_normal, &normal)
    {
        let shading = &shortened(mean_normal, normal);
        let depth = channels.depth.map(&mean);
        let material = channels.material.map(|at| [mean(at), mean(at + 1), mean(at + 2), mean(at + 3)]);
        let pixel = [(tile.origin[0] + x) as f32, (tile.origin[1] + y) as f32];
        colour = shade_lanes(resolve, pixel, &colour, shading, depth.as_ref(), material.as_ref());
        if let Some(surroundings) = resolve.surroundings {
            let reflection = channels.reflection.map_or([channels.mirror; LANES], &mean);
            let (camera, raster) = (&resolve.sample.world_from_camera, resolve.raster);
            let at = [x, y];
            let mirror = Mirror { surroundings, camera, raster, tile, rows, channel: first, at, inverse, normal };
            mirror.add(&reflection, &mut colour);
        }
    }
    let mut add = |plane: usize, value: &Lanes| {
        let Some(out) = film.values[(plane * TILE + y) * TILE + x..].first_chunk_mut::<LANES>() else { return };
        let old = *out;
        for l in 0..LANES {
            out[l] = old[l] + weight * (share[l] * value[l]);
        }
    };
    add(0, &colour[0]);
    add(1, &colour[1]);
    add(2, &colour[2]);
    add(3, &[1.0; LANES]);
    if let (Some(plane), Some(channel)) = (resolve.planes.depth, channels.depth) {
        add(plane, &mean(channel));
    }
    if let (Some(plane), Some(normal)) = (resolve.planes.normal, &normal) {
        (0..3).for_each(|c| add(plane + c, &normal[c]));
    }
    if let (Some(plane), Some(channel)) = (resolve.planes.velocity, channels.velocity) {
        (0..2).for_each(|c| add(plane + c, &mean(channel + c)));
    }
}

/// The unit normals that shade, shortened where normals differ much: a pixel of two surfaces is no brighter than the
/// mean of both. `mean`: the mean of unit normals (docs/math.md, section 5).
#[inline(always)]
fn shortened(mean: &[Lanes; 3], unit: &[Lanes; 3]) -> [Lanes; 3] {
    let mut out = *unit;
    for l in 0..LANES {
        let agreement = agreement(mean[0][l] * mean[0][l] + mean[1][l] * mean[1][l] + mean[2][l] * mean[2][l]);
        out[0][l] *= agreement;
        out[1][l] *= agreement;
        out[2][l] *= agreement;
    }
    out
}

/// Deferred shading (Wolf 2008, 4.1.1): the equation of `shading::shade`, for `LANES` neighbouring pixels.
#[inline(always)]
fn shade_lanes(
    resolve: &Resolve<'_>,
    pixel: [f32; 2],
    colour: &[Lanes; 3],
    normal: &[Lanes; 3],
    depth: Option<&Lanes>,
    material: Option<&[Lanes; 4]>,
) -> [Lanes; 3] {
    let uniform = resolve.channels.uniform.unwrap_or_default();
    let flat = [uniform.ambient, uniform.diffuse, uniform.specular, uniform.shininess];
    let material = material.copied().unwrap_or(flat.map(|v| [v; LANES]));
    let [ray, view] = rays(&resolve.sample.world_from_camera, resolve.raster, pixel);
    let mut out = [[0.0; LANES]; 3];
    for (number, light) in resolve.sample.lights.iter().enumerate() {
        let mut seen = [1.0; LANES];
        if let (Some(shadows), Some(depth), true) = (resolve.shadows, depth, light.has_shadows()) {
            let mut place = [[0.0; LANES]; 3];
            for c in 0..3 {
                for l in 0..LANES {
                    place[c][l] = ray[c][l] * depth[l];
                }
            }
            seen = shadows.seen(number, light, normal, &place, depth);
        }
        match *light {
            ShadingLight::Ambient { colour: la } => {
                for c in 0..3 {
                    for l in 0..LANES {
                        out[c][l] += material[0][l] * colour[c][l] * la[c];
                    }
                }
            }
            ShadingLight::Harmonics { terms } => {
                for l in 0..LANES {
                    add_smooth_light(&mut out, l, &material[1], colour, normal, &terms);
                }
            }
            ShadingLight::Directional { towards, colour: light, .. } => {
                let towards = towards.to_array();
                for l in 0..LANES {
                    add_lobes(&mut out, l, &material, colour, normal, &view, towards, light, seen[l]);
                }
            }
            ShadingLight::Point { position, colour: light, .. } => {
                let position = position.to_array();
                for l in 0..LANES {
                    let depth = depth.map_or(0.0, |depth| depth[l]);
                    let surface = [ray[0][l] * depth, ray[1][l] * depth, ray[2][l] * depth];
                    let (towards, falloff) = towards_point(position, surface);
                    add_lobes(&mut out, l, &material, colour, normal, &view, towards, light, falloff * seen[l]);
                }
            }
        }
    }
    out
}
