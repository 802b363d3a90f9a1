// Includes: common/types common/views
// Where the shadow maps of a round are, and how lights see: onto a plane across parallel rays, or onto the faces of a
// cube. Twins: src/backend/cpu/shadows/view.rs, fit.rs.  Math: docs/math.md, section 17.
// A program that uses this file declares `lights`. The views of a group's lights come behind its lights. The first two
// elements of each have three rows that turn the world's axes into those of the view, with where the grid begins (two
// numbers, texels), and whether rays start at a point; then that point, and the rows of the raster. There follows one
// element for each slice: the bounds on the plane of all that is in it, least x and y first; then the greatest distance
// along the axis of the view, and the depth at which the slice begins; and in those of the first slices the chances of
// layers of see-through surfels, and the seed of Gaussians. Behind all views there are two elements, whose first twelve
// numbers are the map that takes a place at which the camera shows a held object to where that is in the world; then
// come the margin of the image in pixels, and whether all blocks are wanted. The light of a whole sky comes last,
// which shadow catchers need (`sky_at`).

// Lights with shadows, and views of each: six where any is a point, else one.
override SHADOW_LIGHTS: u32 = 1u;
override FACES: u32 = 1u;
// Texels that all maps of a light are to have together. There is room for some more.
override TEXELS: u32 = 1u;
// Words of a texel; those of all texels of a light follow each other. The first is the number, from 1, of the surfel
// that stops the light there, or 0. Where there are see-through surfels, the next ones are that of the last layer
// before it, with the number of layers from bit LAYERS_SHIFT on; and that of the layer that is being found.
override TEXEL_WORDS: u32 = 1u;
// The word with the Gaussian of a capture that stops light there first, whatever else does; 0 where no capture casts.
// Captures stop no light on captures.
override CAPTURE_WORD: u32 = 0u;
const LAYERS_SHIFT: u32 = 28u;

// Slices of the depth before the camera. Two end at twice the depth at which they begin.
const DEPTH_SLICES: u32 = 80u;
// Words of what is known of a map. Six are about the receivers that it shows: greatest x and y on the plane of the
// view, least ones, least depth, greatest distance from the light. They are as `key_of` makes them, upside down for
// what is least, so that the greatest word wins; 0 where there are none. Then come the map's corner, its texel's edge,
// its columns and rows, and its first texel. The first map of a view has the view's first slice that shows anything,
// too, and the end of such slices; that of a light, whether any surfel covers very many texels, and how many texels the
// light's maps have.
const MAP_WORDS: u32 = 16u;
const CORNER: u32 = 6u;
const TEXEL: u32 = 8u;
const SIZE: u32 = 9u;
const FIRST_TEXEL: u32 = 11u;
const FIRST_SLICE: u32 = 12u;
const END_SLICE: u32 = 13u;
const WIDE_CASTERS: u32 = 14u;
const TEXELS_IN_USE: u32 = 15u;

struct LightView {
    x: vec3<f32>,
    y: vec3<f32>,
    along: vec3<f32>,
    // Where rays start, relative to the eye, world axes.
    origin: vec3<f32>,
    // Where the grids of maps begin, texels.
    jitter: vec2<f32>,
    is_point: bool,
}

// The first element of view `face` of light `light`. They come after the lights of the group's middle sample.
fn view_at(light: u32, face: u32) -> u32 {
    return view.first_light + view.lights + (2u + DEPTH_SLICES) * (light * FACES + face);
}

// The element of a slice in a view.
fn slice_at(light: u32, face: u32, slice: u32) -> u32 {
    return view_at(light, face) + 2u + slice;
}

// Rows of the raster.
fn height_of_raster() -> f32 {
    return lights[view_at(0u, 0u) + 1u].colour.w;
}

// View `face` of light `light`.
fn light_view(light: u32, face: u32) -> LightView {
    let at = view_at(light, face);
    let first = lights[at];
    let second = lights[at + 1u];
    return LightView(
        first.vector.xyz, first.colour.xyz, second.vector.xyz, second.colour.xyz,
        vec2<f32>(first.vector.w, first.colour.w), second.vector.w != 0.0,
    );
}

fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// A direction in the axes of a view.
fn turned(of_light: LightView, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot3(of_light.x, v), dot3(of_light.y, v), dot3(of_light.along, v));
}

// A place on the plane of a view, and its distance along the axis of the view.
fn on_plane(of_light: LightView, place: vec3<f32>) -> vec3<f32> {
    let p = turned(of_light, place - of_light.origin);
    if !of_light.is_point { return p; }
    let inverse = 1.0 / p.z;
    return vec3<f32>(p.x * inverse, p.y * inverse, p.z);
}

// The view of a light that `place` is in.
fn facing(light: u32, place: vec3<f32>) -> u32 {
    if FACES == 1u { return 0u; }
    let of_light = light_view(light, 0u);
    if !of_light.is_point { return 0u; }
    let p = place - of_light.origin;
    let size = abs(p);
    if size.x >= size.y && size.x >= size.z { return select(0u, 1u, p.x < 0.0); }
    if size.y >= size.z { return select(2u, 3u, p.y < 0.0); }
    return select(4u, 5u, p.z < 0.0);
}

// The depth of a place before the camera.
fn depth_of(place: vec3<f32>) -> f32 {
    return -dot3(view.camera[2].xyz, place);
}

// The slice of a depth.
fn slice_of(depth: f32) -> u32 {
    let times = depth / view.near;
    // All nearer depths are in the first.
    if !(times > 1.0) { return 0u; }
    // The exponent of two, and whether the rest is above its root.
    let bits = bitcast<u32>(times);
    let half = select(0u, 1u, (bits & 0x007fffffu) > 0x003504f3u);
    return min(2u * ((bits >> 23u) - 127u) + half, DEPTH_SLICES - 1u);
}

// The first word of a light's maps, of the view's group. Its texels come behind what is known of the maps.
fn maps_of(light: u32) -> u32 {
    return (view.number * SHADOW_LIGHTS + light) * (FACES * DEPTH_SLICES * MAP_WORDS + TEXEL_WORDS * room());
}

// Texels of a light that there is room for. Twin: ShadowSizes::room of src/backend/gpu/shadow_sizes.rs.
fn room() -> u32 {
    return TEXELS + TEXELS / 32u + 4096u;
}

// The first word of a map.
fn map_of(light: u32, face: u32, slice: u32) -> u32 {
    return maps_of(light) + (face * DEPTH_SLICES + slice) * MAP_WORDS;
}

// The word of the first texel of a light.
fn texels_of(light: u32) -> u32 {
    return maps_of(light) + FACES * DEPTH_SLICES * MAP_WORDS;
}
