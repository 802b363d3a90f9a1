// Before pass `attribute` of a group that starts from what lies still: the sums of what of that is still visible.
// Twin: LayerTile::recall of src/backend/cpu/layer.rs.
//   in   layer_thresholds, layer_sums   of what lies still alone; the last channel is the least depth of what was added
//        thresholds                     of all splats
//   out  sums      those of the layer where no splat that moves hides any of it; 0 where splats hide all of it, or some, but
//                  for the reach: what is hidden covers all the same
//        limits    the threshold where they hide some and its splats are to be added anew, else UNWANTED
// One invocation per quad of pixels.

@group(1) @binding(17) var<storage, read> thresholds: array<vec4<f32>>;
@group(1) @binding(20) var<storage, read_write> sums: array<vec4<f32>>;
@group(1) @binding(28) var<storage, read> layer_thresholds: array<vec4<f32>>;
@group(1) @binding(29) var<storage, read> layer_sums: array<vec4<f32>>;
@group(1) @binding(30) var<storage, read_write> limits: array<vec4<f32>>;

// As in attribute.wgsl, without the least depth.
override CHANNELS: u32 = 4u;
override REACH: u32 = 0u;

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
        let of_hidden = select(zero, covers, REACH != 0u && channel == REACH);
        sums[at + plane] = select(layer_sums[layer_at + plane], of_hidden, lowered);
    }
    let nearest = layer_sums[layer_at + CHANNELS * TILE_QUADS];
    limits[pixels] = select(unwanted, threshold, lowered & (threshold >= nearest));
}
