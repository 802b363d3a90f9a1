// Includes: common/views common/entries paint/rest paint/meet
// What programs of step `Paint` know that take entries of lists.

@group(1) @binding(2) var<storage, read> segments: array<Segment>;
@group(1) @binding(4) var<storage, read> splats: array<Kernel>;
@group(1) @binding(17) var<storage, read_write> thresholds: array<atomic<u32>>;

// The place of a pixel of a plane of the tile with its apron, counted from the plane's first pixel.
fn place_around(column: i32, row: i32) -> u32 {
    return 4u * row_quads() * u32(row + i32(apron())) + u32(column + i32(4u * apron_quads()));
}

fn depth_at(place: u32) -> f32 {
    return bitcast<f32>(atomicLoad(&thresholds[place]));
}

// Lowers a depth. It must be positive.
fn lower(place: u32, depth: f32) {
    if depth < depth_at(place) { atomicMin(&thresholds[place], bitcast<u32>(depth)); }
}
