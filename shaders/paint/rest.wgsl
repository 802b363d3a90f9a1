// Finds the tiles into which nothing moves, where the groups of a sample position share what is at rest. Their film is
// made once, with weight 1, and each group adds it with its own weight. Twin: `Painted` of
// src/backend/cpu/paint/group.rs.
//   in          list, starts, wide   output of `bin`; slots at rest come first
//   in and out  rest                 for each tile, bits KNOWN and RESTS
// One invocation per tile. Where a group has several batches, each takes away RESTS where it moves.

@group(1) @binding(10) var<storage, read> list: array<u32>;
@group(1) @binding(11) var<storage, read> wide: array<u32>;
@group(1) @binding(12) var<storage, read> starts: array<u32>;
@group(1) @binding(38) var<storage, read_write> rest: array<u32>;

@compute @workgroup_size(256)
fn find_rest(@builtin(global_invocation_id) id: vec3<u32>) {
    let tiles = view.tiles.x * view.tiles.y;
    if id.x >= tiles { return; }
    let end = starts[id.x + 1u];
    let end_wide = starts[tiles + 1u];
    // Lists rise: what moves comes last.
    var moves = starts[id.x] < end && list[max(end, 1u) - 1u] >= view.slots_at_rest;
    moves = moves || (end_wide > 0u && wide[max(end_wide, 1u) - 1u] >= view.slots_at_rest);
    var known = rest[id.x];
    if view.resumes == 0u {
        // The group before made the film of each tile into which nothing moved.
        known = select(KNOWN, 0u, (view.flags & FIRST_OF_POSITION) != 0u || known == 0u) | RESTS;
    }
    rest[id.x] = select(known, known & KNOWN, moves);
}
