// Includes: common/types common/views common/work shadows/stamp
// Draws surfels onto shadow maps, but for what is left to `shadow_draw_wide`.
// Twin: ShadowMap::draw of src/backend/cpu/shadows/map.rs, or a layer of Layers::draw.
//   in   segments, geometry   of all surfels
//        lights, casters
//   out  maps                 their texels; 0 before, or those of the layers before
// One invocation for each surfel and light. The invocations of a workgroup take together what covers many texels.

// Surfels of the workgroup that cover many texels of a map, and their number.
var<workgroup> many: array<u32, DRAWING>;
var<workgroup> count: atomic<u32>;

@compute @workgroup_size(64)
fn shadow_draw(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = surfel_of(group.x, group.y * DRAWING + lane);
    view = views[segment.view];
    let light = group.z;
    if index < segment.surfels && stamp(index, light, vec2<u32>(0u, FEW), 0u, 1u) {
        many[atomicAdd(&count, 1u)] = index;
    }
    workgroupBarrier();
    let end = atomicLoad(&count);
    for (var k = 0u; k < end; k += 1u) {
        if stamp(many[k], light, vec2<u32>(FEW, MANY), lane, DRAWING) && lane == 0u {
            atomicMax(&maps[map_of(light, 0u, 0u) + WIDE_CASTERS], 1u);
        }
    }
}
