// Includes: common/types common/views common/fast common/srgb common/wanted
// Pass `resolve` of what is transparent (program `transparent_resolve`): lays the composite over the opaque picture of
// the instant, decodes it, and adds it to the film with the time weight.
// Twin: src/backend/cpu/transparent/resolve.rs.  Math: docs/math.md, section 11.
//   in   sums       output of `composite`
//        opaque     the picture of the group's surfels, premultiplied, as the film has it
//        backdrop
//   out  film
// One invocation per pixel. The film holds what the picture has more than the background that shows through:
// developing adds that. The groups of a round that add to the same part of the film are added in their order.

@group(0) @binding(1) var<uniform> backdrop: DeviceBackground;
@group(1) @binding(20) var<storage, read> sums: array<f32>;
@group(1) @binding(21) var<storage, read_write> film: array<f32>;
@group(1) @binding(34) var<storage, read> opaque_film: array<f32>;

// As in composite.wgsl.
override CHANNELS: u32 = 4u;
override NORMAL: u32 = 0u;
// As in resolve.wgsl.
override DEPTH_PLANE: u32 = 0u;
override NORMAL_PLANE: u32 = 0u;
override VELOCITY_PLANE: u32 = 0u;
override PLANES: u32 = 4u;
// Is the image composited in coded values?
override CODED: bool = false;

// The background: its linear colour, and the same in the numbers that the image is composited in. The first w is 1
// where the picture has no background.
struct DeviceBackground {
    colour: vec4<f32>,
    shown: vec4<f32>,
}

@compute @workgroup_size(16, 16)
fn transparent_resolve(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) pixel: vec3<u32>) {
    let end = tile.z + views[tile.z].same_film;
    for (var number = tile.z; number < end; number += 1u) {
        view = views[number];
        let has_it = has_tile(tile.xy) && is_wanted(vec2<u32>(tile.x, view.first_tile_row + tile.y));
        if has_it { lay_over(tile.xy, pixel.y * TILE + pixel.x); }
    }
}

// Adds pixel `in_tile` of a tile of the view to the film.
fn lay_over(tile: vec2<u32>, in_tile: u32) {
    let index = tile_of(tile);
    let sum_at = index * CHANNELS * TILE_PIXELS + in_tile;
    let opaque_at = index * PLANES * TILE_PIXELS + in_tile;
    let at = film_tile_of(tile) * PLANES * TILE_PIXELS + in_tile;
    let through = sums[sum_at];
    let solid = of_opaque(opaque_at, 3u);
    if through == 1.0 && solid == 0.0 { return; }
    let alpha = 1.0 - through * (1.0 - solid);
    var inverse = 0.0;
    if solid > 0.0 { inverse = 1.0 / solid; }
    for (var c = 0u; c < 3u; c += 1u) {
        let own = sums[sum_at + (1u + c) * TILE_PIXELS];
        let linear = of_opaque(opaque_at, c) * inverse;
        var shown = linear;
        if CODED { shown = from_linear(linear); }
        let front = own + through * (shown * solid);
        var seen = front;
        if CODED { seen = decoded(front, alpha, backdrop.shown[c], backdrop.colour[c]); }
        film[at + c * TILE_PIXELS] += view.weight * seen;
    }
    film[at + 3u * TILE_PIXELS] += view.weight * alpha;
    // Opaque surfels show through what is before them.
    if DEPTH_PLANE != 0u {
        add(at, opaque_at, DEPTH_PLANE, sums[sum_at + 4u * TILE_PIXELS], through);
    }
    if NORMAL_PLANE != 0u {
        for (var c = 0u; c < 3u; c += 1u) {
            var own = 0.0;
            if NORMAL != 0u { own = sums[sum_at + (NORMAL + c) * TILE_PIXELS]; }
            add(at, opaque_at, NORMAL_PLANE + c, own, through);
        }
    }
    if VELOCITY_PLANE != 0u {
        add(at, opaque_at, VELOCITY_PLANE, sums[sum_at + 5u * TILE_PIXELS], through);
        add(at, opaque_at, VELOCITY_PLANE + 1u, sums[sum_at + 6u * TILE_PIXELS], through);
    }
}

// The linear light of coded values that cover `alpha` of the background.
fn decoded(front: f32, alpha: f32, behind_coded: f32, behind: f32) -> f32 {
    if backdrop.colour.w != 0.0 {
        var inverse = 0.0;
        if alpha > 0.0 { inverse = 1.0 / alpha; }
        return alpha * to_linear(front * inverse);
    }
    let behind_through = 1.0 - alpha;
    return to_linear(front + behind_through * behind_coded) - behind_through * behind;
}

// A plane of the opaque picture, as a mean over the group.
fn of_opaque(at: u32, plane: u32) -> f32 {
    return opaque_film[at + plane * TILE_PIXELS] * view.opaque_scale;
}

fn add(at: u32, opaque_at: u32, plane: u32, own: f32, through: f32) {
    film[at + plane * TILE_PIXELS] += view.weight * (own + through * of_opaque(opaque_at, plane));
}
