// Includes: common/types common/views common/work shadows/stamp
// Draws onto shadow maps what covers very many texels.
// Twin: ShadowMap::draw of src/backend/cpu/shadows/map.rs, or a layer of Layers::draw.
//   in   segments, geometry, lights, casters   as `shadow_draw` has them
//   out  maps                                  their texels, which go on from what is there
// One workgroup for each surfel and light, where there are any such surfels.

@compute @workgroup_size(64)
fn shadow_draw_wide(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, group.y);
    if index >= segment.surfels { return; }
    view = views[segment.view];
    let light = group.z;
    if atomicLoad(&maps[map_of(light, 0u, 0u) + WIDE_CASTERS]) == 0u { return; }
    let left = stamp(index, light, vec2<u32>(MANY, room()), lane, DRAWING);
}
