//! Pass `resolve`: normalise, shade, add to the film with the time weight (Wolf 2008, 4.1.1, eq. 4.14).
//!
//! In: a tile's sums and coverage. Out: the tile's film. One sample position at a time, order-free.

use glam::Vec3;

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
use crate::shading::{ShadingLight, agreement, luminance, smooth_light, towards_point};

/// Share of a pixel beside shadow catchers below which rounding is all that there is.
pub(in crate::backend) const ALL_CAUGHT: f32 = 1e-5;

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
    let mut own_share = *share;
    let mean_normal = channels.normal.map(|at| [mean(at), mean(at + 1), mean(at + 2)]);
    let normal = mean_normal.map(unit);
    if let (Shading::Phong, Some(first), Some(mean_normal), Some(normal)) =
        (resolve.shading, channels.normal, &mean_normal, &normal)
    {
        let shading = &shortened(mean_normal, normal);
        let depth = channels.depth.map(&mean);
        let material = channels.material.map(|at| [mean(at), mean(at + 1), mean(at + 2), mean(at + 3)]);
        let held = channels.held.map(&mean);
        let moved = channels.moved.map(|at| [mean(at), mean(at + 1), mean(at + 2)]);
        let pixel = [(tile.origin[0] + x) as f32, (tile.origin[1] + y) as f32];
        let receives = channels.receives.map(&mean);
        let caught = channels.catcher.map(&mean);
        if let Some(caught) = &caught {
            without_white(&mut colour, caught);
        }
        let (depth, receives, held) = (depth.as_ref(), receives.as_ref(), held.as_ref());
        let seen = SeenSurface { pixel, normal: shading, depth, receives, held, moved: moved.as_ref() };
        colour = shade_lanes(resolve, &seen, &colour, material.as_ref());
        if let Some(surroundings) = resolve.surroundings {
            let reflection = channels.reflection.map_or([channels.mirror; LANES], &mean);
            let (camera, raster) = (&resolve.sample.world_from_camera, resolve.raster);
            let at = [x, y];
            let mirror = Mirror { surroundings, camera, raster, tile, rows, channel: first, at, inverse, normal };
            mirror.add(&reflection, &mut colour);
        }
        if let Some(caught) = &caught {
            own_share = catch(resolve, &seen, material.as_ref(), caught, &mut colour, share);
        }
    }
    let mut add = |plane: usize, value: &Lanes| {
        let Some(out) = film.values[(plane * TILE + y) * TILE + x..].first_chunk_mut::<LANES>() else { return };
        let old = *out;
        for l in 0..LANES {
            out[l] = old[l] + weight * (own_share[l] * value[l]);
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

/// The surface that `LANES` neighbouring pixels show.
struct SeenSurface<'a> {
    /// Column and row of the first of them.
    pixel: [f32; 2],
    /// Normals that shade.
    normal: &'a [Lanes; 3],
    depth: Option<&'a Lanes>,
    /// On which share of it shadows fall; `None`: on all.
    receives: Option<&'a Lanes>,
    /// The shares of held objects, where there are others, too.
    held: Option<&'a Lanes>,
    /// From where it is read out to where it is in the middle of the strip, world axes.
    moved: Option<&'a [Lanes; 3]>,
}

impl SeenSurface<'_> {
    /// The shares of a light with shadows that reach it. `ray`: of depth 1.
    #[inline(always)]
    fn seen(&self, resolve: &Resolve<'_>, number: usize, light: &ShadingLight, ray: &[Lanes; 3]) -> Lanes {
        let (Some(shadows), Some(depth), true) = (resolve.shadows, self.depth, light.has_shadows()) else {
            return [1.0; LANES];
        };
        let mut place = [[0.0; LANES]; 3];
        for c in 0..3 {
            for l in 0..LANES {
                place[c][l] = ray[c][l] * depth[l];
            }
        }
        let asked = self.asked(resolve, &place);
        let (asked, depth) = match &asked {
            Some(asked) => (asked, shadows.depth(asked)),
            None => (&place, *depth),
        };
        let mut seen = shadows.seen(number, light, [self.normal, &place], asked, &depth);
        if let Some(receives) = self.receives {
            for l in 0..LANES {
                seen[l] = 1.0 - receives[l] * (1.0 - seen[l]);
            }
        }
        seen
    }

    /// Where shadows are asked for what is at `place`, as the camera shows it: maps are those of the middle of a strip,
    /// and held objects are elsewhere in the world. The object that most of a pixel shows decides.
    #[inline(always)]
    fn asked(&self, resolve: &Resolve<'_>, place: &[Lanes; 3]) -> Option<[Lanes; 3]> {
        let holds = self.held.is_some() || resolve.channels.all_held;
        if !holds && self.moved.is_none() {
            return None;
        }
        let held = &resolve.sample.held;
        let mut out = *place;
        if let Some(moved) = self.moved {
            for c in 0..3 {
                for l in 0..LANES {
                    out[c][l] += moved[c][l];
                }
            }
        }
        for l in (0..LANES).filter(|_| holds) {
            if self.held.is_none_or(|shares| shares[l] > 0.5) {
                let shown = Vec3::new(out[0][l], out[1][l], out[2][l]);
                (out[0][l], out[1][l], out[2][l]) = (held.turn * shown + held.shift).into();
            }
        }
        Some(out)
    }
}

/// The part of mean colours that shadow catchers have none of: those are white in the mean, with shares `caught`.
#[inline(never)]
fn without_white(colour: &mut [Lanes; 3], caught: &Lanes) {
    for colour in colour {
        for l in 0..LANES {
            let rest = 1.0 - caught[l];
            let own = (colour[l] - caught[l]) / rest;
            colour[l] = if rest > ALL_CAUGHT && own > 0.0 { own } else { 0.0 };
        }
    }
}

/// Shows of shadow catchers, which have the share `caught` of a pixel, nothing of their white but the light that
/// shadows take away, as alpha (docs/math.md, eq. 55). `colour`, lit, is that of the rest; it is changed to the mean
/// over what is counted. Returns the share of the pixel that counts, given that it is covered for `share`.
#[inline(never)]
fn catch(
    resolve: &Resolve<'_>,
    surface: &SeenSurface<'_>,
    material: Option<&[Lanes; 4]>,
    caught: &Lanes,
    colour: &mut [Lanes; 3],
    share: &Lanes,
) -> Lanes {
    let uniform = resolve.channels.uniform.unwrap_or_default();
    let [ambient, diffuse] =
        material.map_or([uniform.ambient, uniform.diffuse].map(|v| [v; LANES]), |material| [material[0], material[1]]);
    let [ray, _] = rays(&resolve.sample.world_from_camera, resolve.raster, surface.pixel);
    let (mut all, mut taken) = ([0.0_f32; LANES], [0.0_f32; LANES]);
    for (number, light) in resolve.sample.lights.iter().enumerate() {
        let seen = surface.seen(resolve, number, light, &ray);
        for l in 0..LANES {
            let n = surface.normal.map(|axis| axis[l]);
            let cosine = |towards: [f32; 3]| {
                let cosine = n[0] * towards[0] + n[1] * towards[1] + n[2] * towards[2];
                diffuse[l] * if cosine > 0.0 { cosine } else { 0.0 }
            };
            let (factor, of_light) = match *light {
                ShadingLight::Ambient { colour } => (ambient[l], luminance(colour.to_array())),
                ShadingLight::Harmonics { terms } => (diffuse[l], luminance(smooth_light(&terms, n))),
                ShadingLight::Directional { towards, colour, .. } => {
                    (cosine(towards.to_array()), luminance(colour.to_array()))
                }
                ShadingLight::Point { position, colour, .. } => {
                    let depth = surface.depth.map_or(0.0, |depth| depth[l]);
                    let at = [ray[0][l] * depth, ray[1][l] * depth, ray[2][l] * depth];
                    let (towards, falloff) = towards_point(position.to_array(), at);
                    (cosine(towards) * falloff, luminance(colour.to_array()))
                }
            };
            taken[l] += factor * of_light * (1.0 - seen[l]);
            // One direction of the sky says nothing about how much light comes from all.
            all[l] += match &resolve.sample.sky {
                Some(terms) if number + 1 == resolve.sample.lights.len() => {
                    diffuse[l] * luminance(smooth_light(terms, n))
                }
                _ => factor * of_light,
            };
        }
    }
    let mut counted = [0.0; LANES];
    for l in 0..LANES {
        let alpha = if all[l] > 0.0 { taken[l] / all[l] } else { 0.0 };
        let rest = 1.0 - caught[l];
        let rest = if rest > ALL_CAUGHT { rest } else { 0.0 };
        let seen = rest + caught[l] * alpha;
        counted[l] = share[l] * seen;
        let factor = if seen > 0.0 { rest / seen } else { 0.0 };
        for colour in &mut *colour {
            colour[l] *= factor;
        }
    }
    counted
}

/// Deferred shading (Wolf 2008, 4.1.1): the equation of `shading::shade`, for `LANES` neighbouring pixels.
#[inline(always)]
fn shade_lanes(
    resolve: &Resolve<'_>,
    surface: &SeenSurface<'_>,
    colour: &[Lanes; 3],
    material: Option<&[Lanes; 4]>,
) -> [Lanes; 3] {
    let &SeenSurface { pixel, normal, depth, .. } = surface;
    let uniform = resolve.channels.uniform.unwrap_or_default();
    let flat = [uniform.ambient, uniform.diffuse, uniform.specular, uniform.shininess];
    let material = material.copied().unwrap_or(flat.map(|v| [v; LANES]));
    let [ray, view] = rays(&resolve.sample.world_from_camera, resolve.raster, pixel);
    let mut out = [[0.0; LANES]; 3];
    for (number, light) in resolve.sample.lights.iter().enumerate() {
        let seen = surface.seen(resolve, number, light, &ray);
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
