// What passes `resolve` share: a pixel is normalised, shaded and added to the film, by the `deposit` of the pass.
// Twin: src/backend/cpu/resolve.rs.  Math: docs/math.md, eq. 6 to 8.

@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(20) var<storage, read> sums: array<f32>;
@group(1) @binding(21) var<storage, read_write> film: array<f32>;

override PHONG: bool = false;
// First plane of each quantity; 0 if it is not wanted.
override DEPTH_PLANE: u32 = 0u;
override NORMAL_PLANE: u32 = 0u;
override VELOCITY_PLANE: u32 = 0u;
override PLANES: u32 = 4u;
// Are all objects held?
override ALL_HELD: bool = false;

// Is the surface that is shaded that of a held object?
var<private> is_held: bool;

// From where the surface is read out to where it is in the middle of the strip, world axes.
var<private> moved: vec3<f32>;

// Is the last light one direction of a sky, of which terms come behind the views of lights?
override SKY: bool = false;

// Share of the surface of the invocation's pixel on which shadows fall.
var<private> receives: f32 = 1.0;

// Share of a pixel beside shadow catchers below which rounding is all that there is.
const ALL_CAUGHT: f32 = 1e-5;

// The weight of a pixel's mean: the covered share of the pixel, times a weight. And whether the sums of the pixels
// around it are there, too.
struct Share {
    covered: f32,
    weight: f32,
    has_neighbours: bool,
}

// Adds one pixel to tile `index` of the film. `sum_at`: its sum of weights, which must be > 0; other channels follow.
fn add_pixel(index: u32, tile: vec2<u32>, pixel: vec2<u32>, sum_at: u32, of_layer: Share) {
    var share = of_layer;
    let in_tile = pixel.y * TILE + pixel.x;
    let inverse = 1.0 / sums[sum_at];
    var colour = mean(sum_at, 1u, inverse);
    var mean_normal = vec3<f32>(0.0);
    if NORMAL != 0u {
        mean_normal = mean(sum_at, NORMAL, inverse);
    }
    let normal = unit(mean_normal);
    var depth = 0.0;
    if DEPTH != 0u {
        depth = sums[sum_at + DEPTH * TILE_PIXELS] * inverse;
    }
    if PHONG {
        var material = view.material;
        if MATERIAL != 0u {
            let shininess = sums[sum_at + (MATERIAL + 3u) * TILE_PIXELS] * inverse;
            material = vec4<f32>(mean(sum_at, MATERIAL, inverse), shininess);
        }
        let ray = ray_of(tile, pixel);
        let eye = towards_eye(ray);
        let m = mean_normal;
        let shaded = normal * agreement(m.x * m.x + m.y * m.y + m.z * m.z);
        if RECEIVES != 0u { receives = sums[sum_at + RECEIVES * TILE_PIXELS] * inverse; }
        var caught = 0.0;
        if CATCHER != 0u {
            caught = sums[sum_at + CATCHER * TILE_PIXELS] * inverse;
            colour = without_white(colour, caught);
        }
        if MOVED != 0u { moved = mean(sum_at, MOVED, inverse); }
        is_held = ALL_HELD;
        // The object that most of a pixel shows decides.
        if HELD != 0u { is_held = sums[sum_at + HELD * TILE_PIXELS] * inverse > 0.5; }
        colour = shade(view.first_light, view.lights, material, colour, shaded, ray * depth, eye);
        if FACE != 0u {
            var reflection = view.environment.w;
            if REFLECTION != 0u { reflection = sums[sum_at + REFLECTION * TILE_PIXELS] * inverse; }
            let towards = mirrored(normal, eye);
            let beside = mirrored_at(tile, pixel ^ vec2<u32>(1u, 0u), sum_at - in_tile, normal, share.has_neighbours);
            let below = mirrored_at(tile, pixel ^ vec2<u32>(0u, 1u), sum_at - in_tile, normal, share.has_neighbours);
            let x = beside - towards;
            let y = below - towards;
            let steps = (x.x * x.x + x.y * x.y + x.z * x.z) + (y.x * y.x + y.y * y.y + y.z * y.z);
            colour += surroundings(towards, 0.5 * (view.pixel * view.pixel) * steps) * reflection;
        }
        if CATCHER != 0u {
            let rest = select(0.0, 1.0 - caught, 1.0 - caught > ALL_CAUGHT);
            let seen = rest + caught * taken_share(material, shaded, ray * depth);
            share.covered *= seen;
            colour *= select(0.0, rest / seen, seen > 0.0);
        }
    }
    let at = index * PLANES * TILE_PIXELS + in_tile;
    add(at, colour, share);
    deposit(at + 3u * TILE_PIXELS, share.weight * share.covered);
    if DEPTH_PLANE != 0u {
        deposit(at + DEPTH_PLANE * TILE_PIXELS, share.weight * (share.covered * depth));
    }
    if NORMAL_PLANE != 0u {
        add(at + NORMAL_PLANE * TILE_PIXELS, normal, share);
    }
    if VELOCITY_PLANE != 0u {
        let x = at + VELOCITY_PLANE * TILE_PIXELS;
        let velocity_x = sums[sum_at + VELOCITY * TILE_PIXELS] * inverse;
        let velocity_y = sums[sum_at + (VELOCITY + 1u) * TILE_PIXELS] * inverse;
        deposit(x, share.weight * (share.covered * velocity_x));
        deposit(x + TILE_PIXELS, share.weight * (share.covered * velocity_y));
    }
}

// The part of a mean colour that shadow catchers have none of: those are white, with the share `caught`.
fn without_white(colour: vec3<f32>, caught: f32) -> vec3<f32> {
    let rest = 1.0 - caught;
    let own = max((colour - caught) / rest, vec3<f32>(0.0));
    return select(vec3<f32>(0.0), own, rest > ALL_CAUGHT);
}

fn luminance(colour: vec3<f32>) -> f32 {
    return 0.2126 * colour.x + 0.7152 * colour.y + 0.0722 * colour.z;
}

// The share of the light on white that shadows take away: the alpha of a shadow catcher. Twin: catch of
// src/backend/cpu/resolve.rs.  Math: docs/math.md, eq. 55.
fn taken_share(material: vec4<f32>, normal: vec3<f32>, place: vec3<f32>) -> f32 {
    var all_light = 0.0;
    var taken = 0.0;
    let end = view.first_light + view.lights;
    for (var i = view.first_light; i < end; i += 1u) {
        let light = lights[i];
        if light.vector.w == AMBIENT {
            all_light += material.x * luminance(light.colour.xyz);
            continue;
        }
        if light.vector.w == HARMONICS {
            all_light += material.y * luminance(smooth_light(i, normal));
            i += HARMONIC_RECORDS - 1u;
            continue;
        }
        var towards = light.vector.xyz;
        var falloff = 1.0;
        if light.vector.w != DIRECTIONAL {
            let d = light.vector.xyz - place;
            falloff = 1.0 / max(d.x * d.x + d.y * d.y + d.z * d.z, 1e-30);
            towards = d * sqrt(falloff);
        }
        let cosine = normal.x * towards.x + normal.y * towards.y + normal.z * towards.z;
        let falls = material.y * max(cosine, 0.0) * falloff * luminance(light.colour.xyz);
        taken += falls * (1.0 - reaching(light, normal, place));
        if SKY && i + 1u == end {
            all_light += material.y * luminance(smooth_light(sky_at(), normal));
        } else {
            all_light += falls;
        }
    }
    return select(0.0, taken / all_light, all_light > 0.0);
}

// Share of a pixel that a layer covers whose sum of weights, > 0, is at `sum_at`. `covered`: whether a disc covers the
// pixel.
fn coverage_of_layer(sum_at: u32, covered: bool) -> f32 {
    let weight = sums[sum_at];
    let peak_at = sum_at + PEAK * TILE_PIXELS;
    // A thin sheet has both sides, which cover once.
    let sum = 0.5 * (weight + abs(sums[peak_at + TILE_PIXELS]));
    // Discs tell outlines better than sums, which miss what kernels lose towards their rims. Where filtering leaves a
    // share p of the peaks, discs count p + p (1 - p).
    let lost = 1.0 - sums[peak_at] * (1.0 / weight);
    let hard = 1.0 - lost * lost;
    return hard * select(0.0, 1.0, covered) + (1.0 - hard) * min(sum, 1.0);
}

// The ray through the sample position of a pixel, in world axes, with depth 1.
fn ray_of(tile: vec2<u32>, pixel: vec2<u32>) -> vec3<f32> {
    let over = 1.0 / view.focal;
    let column = f32(tile.x * TILE + pixel.x);
    let row = f32((view.first_tile_row + tile.y) * TILE + pixel.y);
    let ray_y = (view.axis.y - (row + 0.5 + view.offset.y)) * over;
    let ray_x = (column + 0.5 + view.offset.x - view.axis.x) * over;
    return (view.camera[1].xyz * ray_y - view.camera[2].xyz) + view.camera[0].xyz * ray_x;
}

// The unit direction to the eye on a ray.
fn towards_eye(ray: vec3<f32>) -> vec3<f32> {
    return ray * (-1.0 / sqrt(ray.x * ray.x + ray.y * ray.y + ray.z * ray.z));
}

// What pixel `pixel` of the tile mirrors, whose sums begin at `sum_at`: with its own normal where it has one, else with
// `normal`.
fn mirrored_at(tile: vec2<u32>, pixel: vec2<u32>, sum_at: u32, normal: vec3<f32>, has_sums: bool) -> vec3<f32> {
    let at = sum_at + pixel.y * TILE + pixel.x;
    var its_normal = normal;
    if has_sums && sums[at] > 0.0 { its_normal = unit(mean(at, NORMAL, 1.0 / sums[at])); }
    return mirrored(its_normal, towards_eye(ray_of(tile, pixel)));
}

// The mean of three neighbouring channels.
fn mean(sum_at: u32, channel: u32, inverse: f32) -> vec3<f32> {
    let x = sum_at + channel * TILE_PIXELS;
    return vec3<f32>(sums[x], sums[x + TILE_PIXELS], sums[x + 2u * TILE_PIXELS]) * inverse;
}

// Adds a value to three neighbouring planes.
fn add(at: u32, value: vec3<f32>, share: Share) {
    let added = share.weight * (share.covered * value);
    deposit(at, added.x);
    deposit(at + TILE_PIXELS, added.y);
    deposit(at + 2u * TILE_PIXELS, added.z);
}
