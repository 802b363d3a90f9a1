// Includes: shadows/maps
// The planes of surfels that light meets, as the shadow maps of a round keep them.
// Twin: Caster of src/backend/cpu/shadows/caster.rs, whose planes are in texels.

// Two vectors for each surfel and light. With parallel rays: m, tolerance; centre, opacity. A place p on a ray is at
// the plane where m (centre - p) is 0, and that is also the distance to the plane along the ray. With rays from a point
// o: m, factor; 0, opacity, where -1 / distance along the axis of a view is m r for a ray o + r t with r 1 along the
// axis. The tolerance is part of m, and the surfel itself is at m times the factor. Their last number is negative where
// there is no plane. Behind them, a Gaussian has its disc: centre, u and v, and nothing.
fn caster_of(light: u32, number: u32) -> u32 {
    return 2u * ((view.number * SHADOW_LIGHTS + light) * view.casters + number);
}
