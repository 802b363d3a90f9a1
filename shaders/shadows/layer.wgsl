// Includes: shadows/maps shadows/casters
// Ends a layer of see-through surfels on shadow maps: it stops the light if its opacity is above its chance.
// Twin: Layers::draw of src/backend/cpu/shadows/layers.rs.
//   in   lights, casters
//   out  maps   their texels, which go on from what is there
// An invocation takes every so many texels of a light of a group.

@group(1) @binding(3) var<storage, read> lights: array<Light>;
@group(1) @binding(39) var<storage, read_write> maps: array<u32>;
@group(1) @binding(40) var<storage, read> casters: array<vec4<f32>>;

@compute @workgroup_size(256)
fn shadow_layer(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    view = views[id.z];
    let light = id.y;
    let first = texels_of(light);
    let in_use = maps[map_of(light, 0u, 0u) + TEXELS_IN_USE];
    for (var texel = id.x; texel < in_use; texel += 256u * groups.x) {
        let found = maps[first + 2u * room() + texel];
        if found == 0u { continue; }
        let before = maps[first + room() + texel] >> LAYERS_SHIFT;
        let chance = lights[slice_at(light, 0u, before)].colour.z;
        if chance < casters[caster_of(light, found - 1u) + 1u].w { maps[first + texel] = found; }
        maps[first + room() + texel] = found | ((before + 1u) << LAYERS_SHIFT);
        maps[first + 2u * room() + texel] = 0u;
    }
}
