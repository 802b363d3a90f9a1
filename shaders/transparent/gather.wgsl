// Includes: common/types common/views common/wanted common/bounds common/gaussian
// Pass `list` of Gaussians, its first part (program `gather`): the Gaussians of a slab of depth in their order, as
// splats for pass `bin`, which makes lists of them.
// Twin: src/backend/cpu/transparent/sorted.rs, whose lists hold places in the order.
//   in   gaussians   output of `gaussian_project`
//        order       their slots, the nearest first
//   out  splats      those from place `first_place` on
//        touched     as `bin` reads it
// One workgroup for as many splats as one of `bin` works on.

@group(1) @binding(4) var<storage, read_write> splats: array<DeviceGaussian>;
@group(1) @binding(5) var<storage, read_write> touched: array<u32>;
@group(1) @binding(32) var<storage, read> gaussians: array<DeviceGaussian>;
@group(1) @binding(33) var<storage, read> order: array<u32>;

// Entries of one workgroup.
const WORKGROUP_ITEMS: u32 = 1024u;

@compute @workgroup_size(256)
fn gather(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * WORKGROUP_ITEMS;
    let end = min(first + WORKGROUP_ITEMS, views[0].slots);
    for (var i = first + lane; i < end; i += 256u) {
        load_view_of(i);
        let splat = gaussians[order[view.first_place + i]];
        let bounds = unpack(splat.bounds);
        var count = 0u;
        if bounds.x <= bounds.y { count = tiles_in(bounds); }
        touched[i] = count;
        splats[i] = splat;
    }
}
