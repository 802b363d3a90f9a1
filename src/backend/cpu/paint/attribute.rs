//! Pass `attribute`: weighted sums of the attributes of the kernels that pass the depth test (Wolf 2008, 4.1.1;
//! docs/math.md, section 5). Filtered kernels have four layers by depth (docs/math.md, section 3); solid pixels, and
//! kernels without a filter, have the band alone.
//!
//! In: splats of a tile's list, the tile's depths, the surfels' attributes. Out: the tile's sums. In list order.

use glam::Vec3;

use super::buffers::{APRON_STRIDE, DISC, DepthLayer, PEAK, PaintBuffers, SIDE};
use super::kernel::{Kernel, RasterRays};
use crate::backend::cpu::attribute::{Attributes, add_patch};
use crate::backend::cpu::depths::Depths;
use crate::backend::cpu::patch::{self, NARROW, Patch, Touched};
use crate::backend::cpu::tiles::{LANES, Lanes, STRIDE, TileRect};
use crate::layout::{FLAG_BACK, Splat};
use crate::math::simd::dispatch;
use crate::math::sphere;

/// What the pass needs beside splats and depths.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Filter<'a> {
    pub attributes: Attributes<'a>,
    pub depths: Depths,
    pub sight: RasterRays,
    /// Where the tile begins in planes with an apron.
    pub start: usize,
    /// T(x) of what hides the layer that is being peeled off; empty where nothing does.
    pub ceiling: &'a [f32],
}

impl Filter<'_> {
    /// The layer of a splat at `depth`, where its object shows up to `limit` and the threshold behind is `second`;
    /// `None` where it is hidden. `covers`: whether its disc covers the pixel.
    #[inline(always)]
    fn layer(&self, depth: f32, limit: f32, second: f32, open: bool, covers: bool) -> Option<DepthLayer> {
        let before = depth < limit - 2.0 * self.depths.tolerance(depth);
        if open && before && !covers {
            Some(DepthLayer::Front)
        } else if depth <= limit {
            Some(DepthLayer::Band)
        } else if !open {
            None
        } else if depth <= second {
            Some(DepthLayer::Second)
        } else {
            Some(DepthLayer::Rest)
        }
    }
}

dispatch! {
    /// Adds the splats that `list` names to the sums. `sample_coverage`: coverage by the current sample of a group that
    /// has several, else empty.
    pub(in crate::backend) fn attribute<K: Kernel>(
        splats: &[K], list: &[u32], filter: &Filter<'_>, tile: &TileRect, buffers: &mut PaintBuffers,
        sample_coverage: &mut [f32],
    ) = attribute_body
}

#[inline(always)]
fn attribute_body<K: Kernel>(
    splats: &[K],
    list: &[u32],
    filter: &Filter<'_>,
    tile: &TileRect,
    buffers: &mut PaintBuffers,
    sample_coverage: &mut [f32],
) {
    let (peels, nearest) = (!buffers.floor.is_empty(), !buffers.nearest.is_empty());
    for &index in list {
        let splat = &splats[index as usize];
        let Some(touched) = Touched::within(splat.weight_bounds(), tile) else { continue };
        let values = filter.attributes.of(index);
        let narrow = touched.is_narrow() && touched.is_high();
        // By constant, since a choice in the loop over lanes would keep it from becoming vectors.
        macro_rules! add {
            ($w:expr, $crossing:expr, $nearest:expr, $peels:expr) => {
                add_splat::<K, $w, $crossing, $nearest, $peels>(
                    splat,
                    &touched,
                    values,
                    filter,
                    tile,
                    buffers,
                    sample_coverage,
                )
            };
        }
        match (narrow, splat.is_crossing(), nearest, K::FILTERED && peels) {
            (true, false, false, false) => add!(NARROW, false, false, false),
            (false, false, false, false) => add!(LANES, false, false, false),
            (_, true, false, false) => add!(LANES, true, false, false),
            (true, false, true, false) => add!(NARROW, false, true, false),
            (false, false, true, false) => add!(LANES, false, true, false),
            (_, true, true, false) => add!(LANES, true, true, false),
            (true, false, _, true) => add!(NARROW, false, false, true),
            (false, false, _, true) => add!(LANES, false, false, true),
            (_, true, _, true) => add!(LANES, true, false, true),
        }
    }
}

/// Adds one splat, a patch of `W` columns at a time. `NEAREST`: its object has its own limit. `PEELS`: one layer is
/// peeled off, from the floor to T. What lies behind has other layers.
#[inline(always)]
fn add_splat<K: Kernel, const W: usize, const CROSSING: bool, const NEAREST: bool, const PEELS: bool>(
    splat: &K,
    touched: &Touched,
    values: &[f32],
    filter: &Filter<'_>,
    tile: &TileRect,
    buffers: &mut PaintBuffers,
    sample_coverage: &mut [f32],
) {
    let (sight, channels) = (filter.sight, filter.attributes.channels.count);
    let row = buffers.row;
    let ball = if CROSSING { Ball::of(splat.disc(), values, filter) } else { None };
    let mut y = touched.y0;
    while y <= touched.y1 {
        let mut x = touched.x0;
        while x <= touched.x1 {
            let patch = Patch::<W>::new(touched, tile, x, y);
            let apron_at = filter.start + y * APRON_STRIDE + x;
            let first = patch::load::<W>(&buffers.threshold[apron_at..], APRON_STRIDE);
            let mut nearest = [0.0; LANES];
            if NEAREST {
                nearest = patch::load::<W>(&buffers.nearest[apron_at..], APRON_STRIDE);
            }
            let limit_of = |depth: f32, l: usize| {
                if NEAREST { filter.depths.limit(depth, first[l], nearest[l]) } else { first[l] }
            };
            let at = y * row + x;
            let bend = ball.as_ref().map(|ball| ball.bend(&patch));
            let bend = bend.as_ref();
            let open = if K::FILTERED { open_pixels::<W>(&buffers.open, x, y) } else { 0 };
            let mut weights = [0.0_f32; LANES];
            let mut depths = [0.0_f32; LANES];
            let mut discs = [0.0_f32; LANES];
            let (floor, ceiling) = peeled::<W, PEELS>(buffers, filter, apron_at, y * STRIDE + x);
            let in_layer =
                |depth: f32, l: usize| !PEELS || (depth > floor[l]) & (depth <= first[l]) & (depth <= ceiling[l]);
            let has_coverage = !sample_coverage.is_empty();
            if open == 0 && !has_coverage {
                // Most pixels are solid, and all without a filter. Nobody asks for discs there.
                for l in 0..LANES {
                    let seen = splat.see::<W, CROSSING>(&patch, l, &sight);
                    let shows = (seen.depth <= limit_of(seen.depth, l)) & in_layer(seen.depth, l);
                    weights[l] = if shows { seen.weight } else { 0.0 };
                    depths[l] = seen.depth;
                }
                let out = &mut buffers.sums[DepthLayer::Band as usize][at..];
                add_layer::<K, W>(out, row, splat, values, filter, (&weights, &depths, bend), false);
                x += W;
                continue;
            }
            for l in 0..LANES {
                let seen = splat.see::<W, CROSSING>(&patch, l, &sight);
                (weights[l], depths[l], discs[l]) = (seen.weight, seen.depth, seen.disc);
                if !in_layer(seen.depth, l) {
                    (weights[l], discs[l]) = (0.0, 0.0);
                }
            }
            if PEELS {
                // Most splats are of other layers.
                let mut any = false;
                (0..LANES).for_each(|l| any |= (weights[l] > 0.0) | (discs[l] > 0.0));
                if !any {
                    x += W;
                    continue;
                }
            }
            if has_coverage {
                cover::<W>(&mut sample_coverage[y * STRIDE + x..], &weights, &discs);
                (0..LANES).for_each(|l| weights[l] *= filter.attributes.share);
            }
            if open == 0 {
                (0..LANES)
                    .for_each(|l| weights[l] = if depths[l] <= limit_of(depths[l], l) { weights[l] } else { 0.0 });
                let out = &mut buffers.sums[DepthLayer::Band as usize][at..];
                add_layer::<K, W>(out, row, splat, values, filter, (&weights, &depths, bend), false);
            } else {
                let next = patch::load::<W>(&buffers.second[y * STRIDE + x..], STRIDE);
                let mut of_layer = [[0.0_f32; LANES]; 4];
                let mut any = [false; 4];
                for l in 0..LANES {
                    let limit = limit_of(depths[l], l);
                    let layer = filter.layer(depths[l], limit, next[l], open >> l & 1 != 0, discs[l] != 0.0);
                    if let Some(layer) = layer {
                        of_layer[layer as usize][l] = weights[l];
                        any[layer as usize] |= weights[l] > 0.0;
                    }
                    discs[l] = if layer == Some(DepthLayer::Rest) { discs[l] } else { 0.0 };
                }
                for layer in DepthLayer::ALL {
                    if any[layer as usize] {
                        let out = &mut buffers.sums[layer as usize][at..];
                        add_layer::<K, W>(
                            out,
                            row,
                            splat,
                            values,
                            filter,
                            (&of_layer[layer as usize], &depths, bend),
                            true,
                        );
                    }
                }
                if discs.iter().any(|&disc| disc > 0.0) {
                    let out = &mut buffers.sums[DepthLayer::Rest as usize][at + (channels + DISC) * STRIDE..];
                    add_patch::<W>(out, row, &discs, 1.0);
                }
            }
            x += W;
        }
        y += LANES / W;
    }
}

/// The depths between which a layer is peeled off, of the patch that begins at these places of planes with an apron and
/// without one.
#[inline(always)]
fn peeled<const W: usize, const PEELS: bool>(
    buffers: &PaintBuffers,
    filter: &Filter<'_>,
    apron_at: usize,
    at: usize,
) -> (Lanes, Lanes) {
    let (mut floor, mut ceiling) = ([0.0; LANES], [f32::INFINITY; LANES]);
    if PEELS {
        floor = patch::load::<W>(&buffers.floor[apron_at..], APRON_STRIDE);
        if !filter.ceiling.is_empty() {
            ceiling = patch::load::<W>(&filter.ceiling[at..], STRIDE);
        }
    }
    (floor, ceiling)
}

/// Adds to the coverage by a sample. A hidden splat covers a pixel, too: what hides it covers it.
#[inline(always)]
fn cover<const W: usize>(coverage: &mut [f32], weights: &Lanes, discs: &Lanes) {
    let mut covered = [0.0; LANES];
    (0..LANES).for_each(|l| covered[l] = if discs[l] > 0.0 { 1.0 } else { weights[l] });
    add_patch::<W>(coverage, STRIDE, &covered, 1.0);
}

/// A sphere, as its normals are told from its disc.
struct Ball<'a> {
    disc: &'a Splat,
    /// From the eye to the sphere, and across that: world axes.
    n: Vec3,
    across: [Vec3; 2],
}

impl<'a> Ball<'a> {
    /// `None` of a disc, and where nobody asks for normals.
    fn of(disc: &'a Splat, values: &[f32], filter: &Filter<'_>) -> Option<Self> {
        let at = filter.attributes.channels.normal.filter(|_| disc.is_sphere())?;
        let n = -Vec3::new(values[at], values[at + 1], values[at + 2]);
        let world_from_view = filter.attributes.world_from_view;
        let across = sphere::across((world_from_view.transpose() * n).to_array());
        Some(Self { disc, n, across: across.map(|axis| world_from_view * Vec3::from(axis)) })
    }

    /// What normals are more than that of the disc, at the pixels of a patch.
    #[inline(always)]
    fn bend<const W: usize>(&self, patch: &Patch<W>) -> [Lanes; 3] {
        let mut out = [[0.0; LANES]; 3];
        for l in 0..LANES {
            let hit = patch.at(self.disc, l);
            let depth = 1.0 / hit.inverse_depth;
            let parts = sphere::bend(self.disc.sine(), hit.uv[0] * depth, hit.uv[1] * depth);
            let bend = sphere::along(parts, self.across, self.n);
            (out[0][l], out[1][l], out[2][l]) = bend.into();
        }
        out
    }
}

/// A bit for each lane of the patch at (x, y) whose pixel is not solid; `open` has them row by row.
#[inline(always)]
fn open_pixels<const W: usize>(open: &[u32], x: usize, y: usize) -> u32 {
    let mut pixels = 0;
    for line in 0..LANES / W {
        let bits = open.get(y + line).map_or(0, |bits| bits >> x) & ((1 << W) - 1);
        pixels |= bits << (line * W);
    }
    pixels
}

/// Adds the values of one splat to the sums of a layer that start at `out`, in rows `row` apart. `shown`: weights and
/// depths, and of a sphere what its normals are more than those of its disc. `extra`: the extra channels, too.
#[inline(always)]
fn add_layer<K: Kernel, const W: usize>(
    out: &mut [f32],
    row: usize,
    splat: &K,
    values: &[f32],
    filter: &Filter<'_>,
    shown: (&Lanes, &Lanes, Option<&[Lanes; 3]>),
    extra: bool,
) {
    let (weights, depths, bend) = shown;
    // Loops of a known length are unrolled: these are the channels of most pictures.
    match values.len() {
        7 => add_channels::<W, 7>(out, row, weights, values),
        8 => add_channels::<W, 8>(out, row, weights, values),
        11 => add_channels::<W, 11>(out, row, weights, values),
        12 => add_channels::<W, 12>(out, row, weights, values),
        _ => {
            for (channel, value) in values.iter().enumerate() {
                add_patch::<W>(&mut out[channel * STRIDE..], row, weights, *value);
            }
        }
    }
    if let (Some(bend), Some(normal)) = (bend, filter.attributes.channels.normal) {
        for (c, bend) in bend.iter().enumerate() {
            let mut moments = [0.0; LANES];
            (0..LANES).for_each(|l| moments[l] = if weights[l] > 0.0 { weights[l] * bend[l] } else { 0.0 });
            add_patch::<W>(&mut out[(normal + c) * STRIDE..], row, &moments, 1.0);
        }
    }
    if let Some(depth) = filter.attributes.channels.depth {
        let mut moments = [0.0; LANES];
        (0..LANES).for_each(|l| moments[l] = weights[l] * depths[l]);
        add_patch::<W>(&mut out[depth * STRIDE..], row, &moments, 1.0);
    }
    if extra {
        let out = &mut out[filter.attributes.channels.count * STRIDE..];
        let side = if splat.disc().flags & FLAG_BACK == 0 { 1.0 } else { -1.0 };
        add_patch::<W>(&mut out[PEAK * STRIDE..], row, weights, splat.peak());
        add_patch::<W>(&mut out[SIDE * STRIDE..], row, weights, side);
    }
}

/// Adds the values of `N` channels.
#[inline(always)]
fn add_channels<const W: usize, const N: usize>(out: &mut [f32], row: usize, weights: &Lanes, values: &[f32]) {
    let Some(values) = values.first_chunk::<N>() else { return };
    let out = &mut out[..(LANES / W - 1) * row + (N - 1) * STRIDE + W];
    for (channel, value) in values.iter().enumerate() {
        add_patch::<W>(&mut out[channel * STRIDE..], row, weights, *value);
    }
}
