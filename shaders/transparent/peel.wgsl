// Includes: common/types common/views common/fast common/shading common/environment common/channels
// Includes: common/depths common/wanted resolve
// See-through surfels: what makes layers of the passes of full EWA, which peel them off front to back.
// Twins: src/backend/cpu/transparent/see_through/, whose `cover.rs` says what a cover is.  Math: docs/math.md,
// section 12.
//   peel_start      before all layers: nothing is covered, and no layer shows anything
//   peel_resolve    pass `resolve` of a layer: its groups of splats, normalised and shaded, become a film of their own
//   peel_left_out   counts the pixels in which one more layer would show
//   in   thresholds    T of opaque surfels, where the view has any
//        sums, lights  as in paint/resolve.wgsl, with two layers: before the nearest disc, and at it
//   in and out  peeled   depths of each tile, as common/depths.wgsl has them
//   out  film          for each tile, for each layer, its planes; the last is the depth up to which the layer reaches
//        status
// `peel_start` has an invocation for each quad of pixels, the others for each pixel.

@group(1) @binding(8) var<storage, read_write> status: array<atomic<u32>>;
@group(1) @binding(17) var<storage, read> thresholds: array<f32>;
@group(1) @binding(35) var<storage, read_write> peeled: array<f32>;

// Have tiles of opaque surfels an apron?
override APRONS: bool = false;
// Most layers of a pixel.
override MOST_LAYERS: u32 = 8u;

// A pixel whose transmittance is below this takes no more.
const OPAQUE: f32 = 1e-4;
// Places in `status` of the number of pixels that were left out, 64 bits.
const LEFT_OUT_LOW: u32 = 3u;
const LEFT_OUT_HIGH: u32 = 4u;

// How much of a pixel the current sheet fills, in [0, 1), and the light that gets through that share and the rest.
struct Cover {
    filled: f32,
    through_filled: f32,
    through_rest: f32,
}

var<workgroup> is_live: u32;
var<workgroup> counted: atomic<u32>;

@compute @workgroup_size(4, 16)
fn peel_start(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) quad: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let depths_at = depths_of(index);
    let wants = is_wanted(vec2<u32>(tile.x, view.first_tile_row + tile.y));
    if lane == 0u { peeled[4u * (depths_at + state_place())] = select(0.0, 1.0, wants); }
    if lane == 1u { peeled[4u * (depths_at + state_place()) + 1u] = 0.0; }
    if !wants { return; }
    // The first layer begins at depth 0.
    for (var i = lane; i < 4u * guarded_quads(); i += TILE_QUADS) {
        peeled[4u * depths_at + i] = 0.0;
    }
    for (var i = 0u; i < 4u; i += 1u) {
        var ceiling = NONE;
        if (view.flags & OPAQUE_SURFELS) != 0u {
            if APRONS {
                // The same tiles with the same apron, without what is behind their depths.
                let before = index * opaque_depth_quads() + threshold_place(quad.xy);
                ceiling = thresholds[4u * before + i];
            } else {
                ceiling = thresholds[index * TILE_PIXELS + 4u * lane + i];
            }
        }
        let pixel = 4u * lane + i;
        peeled[4u * (depths_at + ceiling_place()) + pixel] = ceiling;
        put_cover(depths_at, pixel, Cover(0.0, 0.0, 1.0));
        for (var layer = 0u; layer < MOST_LAYERS; layer += 1u) {
            film[((index * MOST_LAYERS + layer) * PLANES + 3u) * TILE_PIXELS + pixel] = 0.0;
        }
    }
}

@compute @workgroup_size(16, 16)
fn peel_resolve(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) pixel: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let index = tile_of(tile.xy);
    let depths_at = depths_of(index);
    let state_at = 4u * (depths_at + state_place());
    if lane == 0u { is_live = u32(peeled[state_at]); }
    if workgroupUniformLoad(&is_live) == 0u { return; }
    let layer = index * MOST_LAYERS + u32(peeled[state_at + 1u]);
    let film_at = layer * PLANES * TILE_PIXELS + lane;
    for (var plane = 0u; plane < PLANES - 1u; plane += 1u) {
        film[film_at + plane * TILE_PIXELS] = 0.0;
    }
    let depth = depth_at(depths_at, pixel.xy);
    film[film_at + (PLANES - 1u) * TILE_PIXELS] = depth;
    let solid = LAYERS == 1u || peeled[4u * (depths_at + second_place()) + lane] == UNWANTED;
    var cover = cover_at(depths_at, lane);
    let before = cover.through_filled + cover.through_rest;
    for (var group = 0u; group < LAYERS; group += 1u) {
        let is_band = LAYERS == 1u || group == BAND;
        if solid && !is_band { continue; }
        let sum_at = (index * LAYERS + group) * CHANNELS * TILE_PIXELS + lane;
        let weight = sums[sum_at];
        if !(weight > 0.0 && before >= OPAQUE) { continue; }
        var coverage = 1.0;
        if SAMPLE_COVERAGE != 0u {
            coverage = sums[sum_at + (SAMPLE_COVERAGE + 1u) * TILE_PIXELS] * view.opaque_scale;
        } else if !solid {
            coverage = coverage_of_layer(sum_at, is_band && depth < NONE);
        }
        let opacity = sums[sum_at + OPACITY * TILE_PIXELS] * (1.0 / weight);
        let share = opacity * put(&cover, coverage, opacity) / before;
        if share > 0.0 { add_pixel(layer, tile.xy, pixel.xy, sum_at, Share(share, 1.0, is_band)); }
    }
    put_cover(depths_at, lane, cover);
    if shows_at(depths_at, lane, depth, cover) { atomicAdd(&counted, 1u); }
    storageBarrier();
    workgroupBarrier();
    if lane == 0u {
        peeled[state_at] = select(0.0, 1.0, atomicLoad(&counted) > 0u);
        peeled[state_at + 1u] += 1.0;
    }
}

@compute @workgroup_size(16, 16)
fn peel_left_out(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) pixel: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    view = views[tile.z];
    if !has_tile(tile.xy) { return; }
    let depths_at = depths_of(tile_of(tile.xy));
    let live = peeled[4u * (depths_at + state_place())] > 0.0;
    if live && shows_at(depths_at, lane, depth_at(depths_at, pixel.xy), cover_at(depths_at, lane)) {
        atomicAdd(&counted, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        let more = atomicLoad(&counted);
        let low = atomicAdd(&status[LEFT_OUT_LOW], more);
        if low + more < low { atomicAdd(&status[LEFT_OUT_HIGH], 1u); }
    }
}

// T of a pixel of the tile.
fn depth_at(depths_at: u32, pixel: vec2<u32>) -> f32 {
    return peeled[4u * (depths_at + threshold_place(vec2<u32>(pixel.x / 4u, pixel.y))) + pixel.x % 4u];
}

// May anything show behind a layer that reaches to `depth`, or in it?
fn shows_at(depths_at: u32, pixel: u32, depth: f32, cover: Cover) -> bool {
    let is_hidden = depth > peeled[4u * (depths_at + ceiling_place()) + pixel];
    return depth < NONE && !is_hidden && cover.through_filled + cover.through_rest >= OPAQUE;
}

fn cover_at(depths_at: u32, pixel: u32) -> Cover {
    let at = 4u * (depths_at + cover_place()) + pixel;
    return Cover(peeled[at], peeled[at + TILE_PIXELS], peeled[at + 2u * TILE_PIXELS]);
}

fn put_cover(depths_at: u32, pixel: u32, cover: Cover) {
    let at = 4u * (depths_at + cover_place()) + pixel;
    peeled[at] = cover.filled;
    peeled[at + TILE_PIXELS] = cover.through_filled;
    peeled[at + 2u * TILE_PIXELS] = cover.through_rest;
}

// Puts a group that covers the share `coverage` behind what is there, and says what light reaches it.
fn put(cover: ptr<function, Cover>, coverage: f32, opacity: f32) -> f32 {
    let filled = (*cover).filled;
    let of_filled = (*cover).through_filled;
    let of_rest = (*cover).through_rest;
    let room = 1.0 - filled;
    let beside = min(coverage, room);
    let behind = min(coverage - beside, filled);
    let light_beside = of_rest * (beside / room);
    var light_behind = 0.0;
    if behind > 0.0 { light_behind = of_filled * (behind / filled); }
    let kept = 1.0 - opacity;
    let stays = of_filled - light_behind + light_beside * kept;
    // A full pixel starts the next sheet with what did not fit.
    var next = Cover(filled + beside, stays, of_rest - light_beside);
    if beside >= room { next = Cover(behind, light_behind * kept, stays); }
    if next.filled >= 1.0 { next = Cover(0.0, 0.0, next.through_filled); }
    *cover = next;
    return light_beside + light_behind;
}

fn deposit(at: u32, value: f32) {
    film[at] += value;
}
