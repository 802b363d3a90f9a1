// Includes: common/segment common/paths common/numbers common/sphere shadows/casters
// Surfels of shadow maps, posed.

// Flags of segments that are about shadows: what their surfels do, and what the model has.
// Twin: src/backend/gpu/shadows.rs.
const IS_RECEIVER: u32 = 1u;
const HAS_MATERIALS: u32 = 2u;
const HAS_OPACITIES: u32 = 4u;
const CASTS: u32 = 8u;
const SEE_THROUGH: u32 = 16u;
// What they are not surfels but Gaussians, of a capture or of a volume.
const ARE_SPLATS: u32 = 32u;
const IS_VOLUME: u32 = 64u;

struct Disc {
    centre: vec3<f32>,
    u: vec3<f32>,
    v: vec3<f32>,
}

// Surfel `index` of the segment, relative to the eye, in world axes. A sphere has the disc that faces the light: behind
// it is what the sphere hides.
fn disc_of(index: u32, of_light: LightView) -> Disc {
    let at = 3u * (segment.first_surfel + index);
    if segment.axes[0].w != 0.0 {
        let axis = column_of(at, 3u);
        let radius = sqrt(dot3(axis, axis)) * segment.axes[0].w;
        let centre = apply(segment.world, placed(at));
        if !of_light.is_point { return Disc(centre, of_light.x * radius, of_light.y * radius); }
        let facing = outline(centre - of_light.origin, radius);
        return Disc(of_light.origin + (centre - of_light.origin) * facing.nearer, facing.u, facing.v);
    }
    let u = apply_linear(segment.world, column_of(at, 3u));
    return Disc(apply(segment.world, placed(at)), u, apply_linear(segment.world, column_of(at, 6u)));
}

// The number of surfel `index` of the segment among all that cast. A Gaussian has three, of which the first counts.
fn number_of(index: u32) -> u32 {
    return segment.first_slot + select(1u, 3u, (segment.flags & ARE_SPLATS) != 0u) * index;
}
