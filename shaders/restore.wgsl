// Before pass `attribute` of a group that starts from static objects: restores their sums where they stay visible.
// Twin: `StaticTile::restore` of src/backend/cpu/static_tile.rs.
//   in   layer_thresholds, layer_sums   thresholds and sums of static objects alone; the last channel is the least
//                                       depth of the splats that were added
//        thresholds                     thresholds of all splats
//   out  sums      those of the static objects where no moving splat hides any of them. Elsewhere 0, but for the sample
//                  coverage: a hidden splat covers all the same
//        limits    the threshold where moving splats hide only some of the static splats, whose sums are to be
//                  recomputed; else UNWANTED
// One invocation per quad of pixels.

@group(1) @binding(17) var<storage, read> thresholds: array<vec4<f32>>;
@group(1) @binding(20) var<storage, read_write> sums: array<vec4<f32>>;
@group(1) @binding(28) var<storage, read> layer_thresholds: array<vec4<f32>>;
@group(1) @binding(29) var<storage, read> layer_sums: array<vec4<f32>>;
@group(1) @binding(30) var<storage, read_write> limits: array<vec4<f32>>;

// As in attribute.wgsl, without the channel of the least depth.
override CHANNELS: u32 = 4u;
override SAMPLE_COVERAGE: u32 = 0u;

@compute @workgroup_size(4, 16)
fn restore(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) quad: vec3<u32>) {
    let index = tile.y * view.tiles.x + tile.x;
    let in_tile = quad.y * 4u + quad.x;
    let pixels = index * TILE_QUADS + in_tile;
    let threshold = thresholds[pixels];
    let unwanted = vec4<f32>(UNWANTED);
    if all(threshold == unwanted) {
        limits[pixels] = unwanted;
        return;
    }
    let zero = vec4<f32>(0.0);
    let layer_threshold = layer_thresholds[pixels];
    let lowered = threshold < layer_threshold;
    let covers = select(zero, vec4<f32>(1.0), layer_threshold < vec4<f32>(NONE));
    let at = index * CHANNELS * TILE_QUADS + in_tile;
    let layer_at = index * (CHANNELS + 1u) * TILE_QUADS + in_tile;
    for (var channel = 0u; channel < CHANNELS; channel += 1u) {
        let plane = channel * TILE_QUADS;
        let of_hidden = select(zero, covers, SAMPLE_COVERAGE != 0u && channel == SAMPLE_COVERAGE);
        sums[at + plane] = select(layer_sums[layer_at + plane], of_hidden, lowered);
    }
    let nearest = layer_sums[layer_at + CHANNELS * TILE_QUADS];
    limits[pixels] = select(unwanted, threshold, lowered & (threshold >= nearest));
}
