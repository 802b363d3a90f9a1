// Includes: shadows/maps
// What of a light's plane each of its maps covers, and how finely.
// Twin: Fit::areas of src/backend/cpu/shadows/fit.rs.
//   in   lights   their views
//        maps     bounds of receivers
//   out  maps     corner, edge of a texel, columns and rows, and first texel, of each map
// One invocation for each light of each group.

@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(39) var<storage, read_write> maps: array<atomic<u32>>;

// Most texels of a side of a map.
const MOST_SIDE: f32 = 65000.0;
// What rows have beyond their last texel on the CPU. It counts, so that maps are as fine.
const ROW_END: f32 = 8.0;
// Times that texels grow until all fit, and the factor.
const MOST_TRIES: u32 = 100u;
const GROWTH: f32 = 1.02;

// The value of which `key_of` made a word.
fn value_of(key: u32) -> f32 {
    return bitcast<f32>(select(~key, key & 0x7fffffffu, key >= 0x80000000u));
}

struct Seen {
    low: vec2<f32>,
    extent: vec2<f32>,
    // Edge of a texel that is no larger than a pixel of what it shows.
    texel: f32,
}

fn seen(at: u32, is_point: bool) -> Seen {
    let high = vec2<f32>(value_of(atomicLoad(&maps[at])), value_of(atomicLoad(&maps[at + 1u])));
    let low = vec2<f32>(value_of(~atomicLoad(&maps[at + 2u])), value_of(~atomicLoad(&maps[at + 3u])));
    var texel = value_of(~atomicLoad(&maps[at + 4u])) / (view.focal * view.stride);
    if is_point { texel = texel / value_of(atomicLoad(&maps[at + 5u])); }
    return Seen(low, max(high - low, vec2<f32>(0.0)), texel);
}

// Edge of the texels of a map, `coarser` times as large as need be.
fn texel_of(it: Seen, coarser: f32) -> f32 {
    return max(it.texel * coarser, max(it.extent.x, it.extent.y) / MOST_SIDE);
}

// Columns and rows of so many texels: one more than the extent has, because of where the grid begins, and one for what
// is left of it.
fn size_of(it: Seen, texel: f32) -> vec2<u32> {
    return vec2<u32>(it.extent / texel) + 2u;
}

@compute @workgroup_size(1)
fn shadow_layout(@builtin(workgroup_id) group: vec3<u32>) {
    view = views[group.y];
    let light = group.x;
    let of_light = light_view(light, 0u);
    let first = map_of(light, 0u, 0u);
    let maps_of_light = FACES * DEPTH_SLICES;
    var total = 0.0;
    for (var map = 0u; map < maps_of_light; map += 1u) {
        let at = first + map * MAP_WORDS;
        if atomicLoad(&maps[at]) == 0u { continue; }
        let it = seen(at, of_light.is_point);
        let size = it.extent / it.texel + 2.0;
        total += (size.x + ROW_END) * size.y;
    }
    var coarser = max(sqrt(total / f32(TEXELS)), 1.0);
    // What each map has beside its extent may be too much.
    for (var tries = 0u; tries < MOST_TRIES; tries += 1u) {
        var texels = 0.0;
        for (var map = 0u; map < maps_of_light; map += 1u) {
            let at = first + map * MAP_WORDS;
            if atomicLoad(&maps[at]) == 0u { continue; }
            let it = seen(at, of_light.is_point);
            let size = vec2<f32>(size_of(it, texel_of(it, coarser)));
            texels += size.x * size.y;
        }
        // A sum of floats is rounded.
        if texels * (1.0 + 1e-4) <= f32(room()) { break; }
        coarser *= GROWTH;
    }
    var next = 0u;
    for (var map = 0u; map < maps_of_light; map += 1u) {
        let at = first + map * MAP_WORDS;
        if atomicLoad(&maps[at]) == 0u { continue; }
        let it = seen(at, of_light.is_point);
        let texel = texel_of(it, coarser);
        let size = size_of(it, texel);
        // What does not fit even so shows nothing.
        if !(f32(size.x) * f32(size.y) <= f32(room() - next)) { continue; }
        let corner = it.low - of_light.jitter * texel;
        atomicStore(&maps[at + CORNER], bitcast<u32>(corner.x));
        atomicStore(&maps[at + CORNER + 1u], bitcast<u32>(corner.y));
        atomicStore(&maps[at + TEXEL], bitcast<u32>(texel));
        atomicStore(&maps[at + SIZE], size.x);
        atomicStore(&maps[at + SIZE + 1u], size.y);
        atomicStore(&maps[at + FIRST_TEXEL], next);
        next += size.x * size.y;
        let of_view = map_of(light, map / DEPTH_SLICES, 0u);
        let slice = map % DEPTH_SLICES;
        if atomicLoad(&maps[of_view + END_SLICE]) == 0u { atomicStore(&maps[of_view + FIRST_SLICE], slice); }
        atomicStore(&maps[of_view + END_SLICE], slice + 1u);
    }
    atomicStore(&maps[first + TEXELS_IN_USE], next);
}
