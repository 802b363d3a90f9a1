// Includes: shadows/posed
// How a surfel is drawn onto the shadow maps of a light. A texel keeps the number, from 1, of the surfel that comes
// first there, tolerance included; of two at the same distance that of the lower number. So the order of invocations
// does not matter. See-through surfels are drawn layer by layer: the first one behind the last layer of a texel.
// Twins: ShadowMap::draw, Layers::draw and Caster::of of src/backend/cpu/shadows/.

@group(1) @binding(0) var<storage, read> geometry: array<f32>;
@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(39) var<storage, read_write> maps: array<atomic<u32>>;
@group(1) @binding(40) var<storage, read> casters: array<vec4<f32>>;

// Is a layer of see-through surfels drawn, or what is opaque?
override PEEL: bool = false;

// Invocations of a workgroup.
const DRAWING: u32 = 64u;
// Most texels of a map that an invocation takes alone, and that those of a workgroup take of each of their surfels.
const FEW: u32 = 16u;
const MANY: u32 = 2048u;
// Places on a face reach to 1 from its middle, and a texel or two farther.
const BEYOND_FACE: f32 = 0.99;

// Where a plane stops the light of a ray: the ray's place on the plane of the view with parallel rays, else its
// direction.
fn end_of(at: u32, ray: vec3<f32>, is_point: bool) -> f32 {
    let first = casters[at];
    // The centre is 0 for a point light, and its m is turned.
    return dot3(first.xyz, casters[at + 1u].xyz - ray) + select(first.w, 0.0, is_point);
}

// The ends of a disc along both axes of the plane of a view: least, then greatest x and y; all of a face where the disc
// reaches to the light.
fn ends_of(c: vec3<f32>, u: vec3<f32>, v: vec3<f32>, is_point: bool) -> vec4<f32> {
    if !is_point {
        let extent = sqrt(u.xy * u.xy + v.xy * v.xy);
        return vec4<f32>(c.xy - extent, c.xy + extent);
    }
    let least = c.z - abs(u.z) - abs(v.z);
    if !(least > 1e-3 * abs(c.z)) { return vec4<f32>(-2.0, -2.0, 2.0, 2.0); }
    let a = c + u + v;
    let b = c + u - v;
    let d = c - u + v;
    let e = c - u - v;
    let pa = a.xy / a.z;
    let pb = b.xy / b.z;
    let pd = d.xy / d.z;
    let pe = e.xy / e.z;
    return vec4<f32>(min(min(pa, pb), min(pd, pe)), max(max(pa, pb), max(pd, pe)));
}

// Draws surfel `index` of the segment onto the maps on which more texels lie in its bounds than `texels.x`, and at most
// `texels.y`: from texel `lane`, every `stride`-th. Are there more of them on any other map?
fn stamp(index: u32, light: u32, texels: vec2<u32>, lane: u32, stride: u32) -> bool {
    let number = number_of(index);
    let caster = caster_of(light, number);
    let is_drawn = (segment.flags & CASTS) != 0u && PEEL == ((segment.flags & SEE_THROUGH) != 0u);
    if !is_drawn || casters[caster + 1u].w < 0.0 { return false; }
    var disc: Disc;
    if (segment.flags & ARE_SPLATS) != 0u {
        disc = Disc(casters[caster + 2u].xyz, casters[caster + 3u].xyz, casters[caster + 4u].xyz);
    } else {
        disc = disc_of(index, light_view(light, 0u));
    }
    var has_more = false;
    for (var face = 0u; face < FACES; face += 1u) {
        let of_light = light_view(light, face);
        // Parallel rays have one view.
        if face > 0u && !of_light.is_point { break; }
        let c = turned(of_light, disc.centre - of_light.origin);
        let u = turned(of_light, disc.u);
        let v = turned(of_light, disc.v);
        if of_light.is_point {
            // A disc beside a face of the cube is on another.
            let radius = sqrt(dot3(u, u) + dot3(v, v));
            let beside = max(abs(c.x), abs(c.y)) * BEYOND_FACE - c.z;
            if beside > 1.4142135 * radius || c.z <= -radius { continue; }
        }
        let ends = ends_of(c, u, v, of_light.is_point);
        let of_view = map_of(light, face, 0u);
        let end = atomicLoad(&maps[of_view + END_SLICE]);
        for (var slice = atomicLoad(&maps[of_view + FIRST_SLICE]); slice < end; slice += 1u) {
            let map = map_of(light, face, slice);
            let size = vec2<u32>(atomicLoad(&maps[map + SIZE]), atomicLoad(&maps[map + SIZE + 1u]));
            if size.x == 0u { continue; }
            let corner = bitcast<vec2<f32>>(vec2<u32>(
                atomicLoad(&maps[map + CORNER]), atomicLoad(&maps[map + CORNER + 1u]),
            ));
            let texel = bitcast<f32>(atomicLoad(&maps[map + TEXEL]));
            let low = (ends.xy - corner) / texel - 0.5;
            let high = (ends.zw - corner) / texel - 0.5;
            let last = vec2<f32>(size - 1u);
            let least = ceil(max(low, vec2<f32>(0.0)));
            let most = floor(min(high, last));
            if !(all(least <= most)) { continue; }
            let first = vec2<u32>(least);
            let columns = u32(most.x) + 1u - first.x;
            let count = columns * (u32(most.y) + 1u - first.y);
            if count > texels.y { has_more = true; }
            if count <= texels.x || count > texels.y { continue; }
            let first_texel = texels_of(light) + atomicLoad(&maps[map + FIRST_TEXEL]);
            for (var i = lane; i < count; i += stride) {
                let at = first + vec2<u32>(i % columns, i / columns);
                let place = corner + (vec2<f32>(at) + 0.5) * texel;
                if covers(c, u, v, place, of_light.is_point) {
                    var ray = of_light.x * place.x + of_light.y * place.y;
                    // The value for a ray from a point is that of the ray turned round.
                    if of_light.is_point { ray = -(ray + of_light.along); }
                    offer(first_texel + at.y * size.x + at.x, light, number, ray, of_light.is_point);
                }
            }
        }
    }
    return has_more;
}

// Does a disc cover a place on the plane of a view?
fn covers(c: vec3<f32>, u: vec3<f32>, v: vec3<f32>, place: vec2<f32>, is_point: bool) -> bool {
    if !is_point {
        let p = place - c.xy;
        let over = 1.0 / (u.x * v.y - v.x * u.y);
        let a = (p.x * v.y - p.y * v.x) * over;
        let b = (p.y * u.x - p.x * u.y) * over;
        return a * a + b * b <= 1.0;
    }
    let ray = vec3<f32>(place, 1.0);
    let normal = cross(u, v);
    let over = 1.0 / dot3(c, normal);
    let a = dot3(cross(v, c), ray) * over;
    let b = dot3(cross(c, u), ray) * over;
    let w = dot3(normal, ray) * over;
    return w > 0.0 && a * a + b * b <= w * w;
}

// Puts a surfel into a texel if it comes before what is there.
fn offer(texel: u32, light: u32, number: u32, ray: vec3<f32>, is_point: bool) {
    let caster = caster_of(light, number);
    let end = end_of(caster, ray, is_point);
    // An end that is no number, or infinite, stops nothing.
    if (bitcast<u32>(end) & 0x7f800000u) == 0x7f800000u { return; }
    var at = texel;
    if (segment.flags & (ARE_SPLATS | IS_VOLUME)) == ARE_SPLATS { at = texel + CAPTURE_WORD * room(); }
    if PEEL {
        let opaque = atomicLoad(&maps[texel]);
        if opaque != 0u && !(end < end_of(caster_of(light, opaque - 1u), ray, is_point)) { return; }
        let last = atomicLoad(&maps[texel + room()]) & ((1u << LAYERS_SHIFT) - 1u);
        let moved = casters[caster].w;
        let distance = select(end - moved, end * moved, is_point);
        if last != 0u && !(distance > end_of(caster_of(light, last - 1u), ray, is_point)) { return; }
        at = texel + 2u * room();
    }
    var there = atomicLoad(&maps[at]);
    loop {
        if there != 0u {
            let others = end_of(caster_of(light, there - 1u), ray, is_point);
            if !(end < others || (end == others && number < there - 1u)) { return; }
        }
        let done = atomicCompareExchangeWeak(&maps[at], there, number + 1u);
        if done.exchanged { return; }
        there = done.old_value;
    }
}
