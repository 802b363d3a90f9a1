// Includes: common/types common/views common/work common/segment common/fast common/channels common/shading
// Includes: common/environment common/paths
// The first program of passes `attribute`: the values of the splats that `project` made.
// Twin: src/backend/cpu/values.rs.  Math: docs/math.md, section 5.
//   in   segments, geometry, looks, lights, environment
//        splats    in which their flags are
//        touched
//   out  values    for each slot: colour, then normal, velocity, material, reflection, receiving, catching, being held,
//                  the way to the middle of the strip, opacity and tolerance where wanted
// One invocation per surfel of a segment.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(1) var<storage, read> looks: array<f32>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(4) var<storage, read> splats: array<Splat>;
@group(1) @binding(5) var<storage, read> touched: array<u32>;
@group(1) @binding(19) var<storage, read_write> values: array<f32>;

override GOURAUD: bool = false;
// Size of a slot's content in splats, and the part of it that has the flags.
override SPLATS: u32 = 1u;
override FLAGS_PART: u32 = 0u;

// Where the values of the invocation are.
var<private> values_at: u32;

@compute @workgroup_size(256)
fn splat_values(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, lane);
    if index >= segment.surfels { return; }
    view = views[segment.view];
    let slot = segment.first_slot + index;
    if touched[slot] == 0u { return; }
    let surfel = segment.first_surfel + index;
    let at = 3u * surfel;
    let column = 3u * segment.buffer_surfels;
    var normal = vec3<f32>(looks[at], looks[at + 1u], looks[at + 2u]);
    var turned_normal = apply_linear(segment.normal, normal);
    let place = splats[SPLATS * slot + FLAGS_PART].reference;
    var time = 0.0;
    if view.strip != 0.0 && splats[SPLATS * slot + FLAGS_PART].centre_depth > 0.0 {
        // When the row is read out on which the centre lands.
        let half = abs(view.strip);
        time = clamp((select(place.x, place.y, view.strip > 0.0) - half) / half, -1.0, 1.0);
        turned_normal += time * apply_linear(segment.turn, normal);
    }
    normal = unit(turned_normal);
    if segment.axes[0].w != 0.0 {
        // The disc of a sphere faces the eye. Pixels bend it (paint/bend.wgsl).
        normal = unit(-apply(segment.world, placed(at)));
    }
    if (splats[SPLATS * slot + FLAGS_PART].flags & FLAG_BACK) != 0u {
        normal = -normal;
    }
    var colour = vec3<f32>(looks[column + at], looks[column + at + 1u], looks[column + at + 2u]);
    let shadows = u32(segment.normal[2].w);
    // A shadow catcher shows how much light falls on white.
    if (shadows & 2u) != 0u { colour = vec3<f32>(1.0); }
    var material = segment.material;
    if (segment.flags & 2u) != 0u {
        let m = 2u * column + 4u * surfel;
        material = vec4<f32>(looks[m], looks[m + 1u], looks[m + 2u], looks[m + 3u]);
    }
    let position = placed(at);
    values_at = slot * VALUES;
    if GOURAUD {
        let world = apply(segment.world, position);
        let eye = unit(-world);
        colour = shade(segment.first_light, view.lights, material, colour, normal, world, eye);
        if FACE != 0u && segment.normal[1].w > 0.0 {
            let pixel = view.pixel / view.focal;
            colour += surroundings(mirrored(normal, eye), pixel * pixel) * segment.normal[1].w;
        }
    }
    var next = values_at;
    values[next] = colour.x;
    values[next + 1u] = colour.y;
    values[next + 2u] = colour.z;
    next += 3u;
    if NORMAL != 0u {
        values[next] = normal.x;
        values[next + 1u] = normal.y;
        values[next + 2u] = normal.z;
        next += 3u;
    }
    if VELOCITY != 0u {
        // The derivative of (x, y) = (X, Y) / depth, in pixels of the image. It is 0 where the centre has no image.
        let p = apply(segment.screen, position);
        let own = apply_linear(segment.screen, own_velocity(at) * segment.pace);
        let rate = apply(segment.rate, position) + own;
        var velocity = vec2<f32>(0.0);
        if p.z >= view.near {
            let over = 1.0 / p.z;
            velocity = vec2<f32>((rate.x - p.x * over * rate.z) * over, (rate.y - p.y * over * rate.z) * over);
        }
        values[next] = velocity.x * view.stride;
        values[next + 1u] = velocity.y * view.stride;
        next += 2u;
    }
    if MATERIAL != 0u {
        values[next] = material.x;
        values[next + 1u] = material.y;
        values[next + 2u] = material.z;
        values[next + 3u] = material.w;
        next += 4u;
    }
    if REFLECTION != 0u {
        values[next] = segment.normal[1].w;
        next += 1u;
    }
    if RECEIVES != 0u {
        values[next] = f32(shadows & 1u);
        next += 1u;
    }
    if CATCHER != 0u {
        values[next] = f32((shadows >> 1u) & 1u);
        next += 1u;
    }
    if HELD != 0u {
        values[next] = f32(shadows >> 2u);
        next += 1u;
    }
    if MOVED != 0u {
        let by_itself = apply_linear(segment.centre, rates(at, segment.advance));
        // Screen space is (f X, -f Y, -Z) of the camera's.
        let m = -time * (apply(segment.motion, position) + by_itself);
        let across = view.camera[0].xyz * (m.x / view.focal) - view.camera[1].xyz * (m.y / view.focal);
        let moved = across - view.camera[2].xyz * m.z;
        values[next] = moved.x;
        values[next + 1u] = moved.y;
        values[next + 2u] = moved.z;
        next += 3u;
    }
    if OPACITY != 0u {
        let before = select(6u, 10u, (segment.flags & 2u) != 0u) * segment.buffer_surfels;
        var own = 1.0;
        if (segment.flags & 4u) != 0u { own = looks[before + surfel]; }
        values[next] = segment.normal[0].w * own;
    }
    if TOLERANCE != 0u { values[slot * VALUES + TOLERANCE] = segment.epsilon; }
}

