// Includes: common/types common/views common/wanted common/numbers shadows/maps
// What receives shadows, as programs find it that fit maps: what the camera sees raises bounds.

@group(1) @binding(39) var<storage, read_write> maps: array<atomic<u32>>;

// A word that is the greater, the greater the value; never 0.
fn key_of(value: f32) -> u32 {
    let bits = bitcast<u32>(value);
    return select(bits | 0x80000000u, ~bits, bits >= 0x80000000u);
}

// Raises a word. Most surfels lie within what others have raised: reading is faster.
fn raise(at: u32, key: u32) {
    if atomicLoad(&maps[at]) < key { atomicMax(&maps[at], key); }
}

// Columns and rows of the raster.
fn size_of_raster() -> vec2<f32> {
    return vec2<f32>(f32(view.pixels.y) + 1.0, height_of_raster());
}

// Pixels around the image in which surfels receive shadows, too.
fn margin() -> f32 {
    return lights[view_at(SHADOW_LIGHTS, 0u) + 1u].colour.x;
}

// Does a ball show in the image, or within its margin? `at`: to the right and down, at `depth` before the
// camera.
fn sees(at: vec2<f32>, depth: f32, radius: f32) -> bool {
    if !finite(depth + radius) || !(depth + radius >= view.near) { return false; }
    // Slopes of the sides of the image.
    let low = (vec2<f32>(-margin()) - view.axis) / view.focal;
    let high = (size_of_raster() + margin() - view.axis) / view.focal;
    let before = at - low * depth < -radius * sqrt(1.0 + low * low);
    let beyond = at - high * depth > radius * sqrt(1.0 + high * high);
    return !any(before) && !any(beyond);
}

// Does any block show the ball that is wanted?
fn wants(at: vec2<f32>, depth: f32, radius: f32) -> bool {
    let wants_all = lights[view_at(SHADOW_LIGHTS, 0u) + 1u].colour.y != 0.0;
    if wants_all || depth - radius < view.near { return true; }
    let low = view.focal * (at - radius);
    let high = view.focal * (at + radius);
    // An end is farthest out at the nearer of the depths.
    let nearer = depth - radius;
    let farther = depth + radius;
    let least = view.axis + min(low / nearer, low / farther) - 3.0;
    let most = view.axis + max(high / nearer, high / farther) + 3.0;
    let end = max(size_of_raster() - 1.0, vec2<f32>(0.0));
    let first = (vec2<u32>(clamp(least, vec2<f32>(0.0), end)) + view.first) / BLOCK;
    let last = (vec2<u32>(clamp(most, vec2<f32>(0.0), end)) + view.first) / BLOCK;
    for (var y = first.y; y <= last.y; y += 1u) {
        for (var x = first.x; x <= last.x; x += 1u) {
            if is_wanted_block(vec2<u32>(x, y)) { return true; }
        }
    }
    return false;
}
