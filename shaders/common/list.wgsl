// The splats of one tile in global surfel order: a walk that merges two rising lists of slots, the tile's own list and
// the list of wide splats. Twin: the lists of src/backend/cpu/bin.rs, which need no merging.
// A program that uses this file declares `list`, `wide` and `starts`, the output of `bin`.

// The entries of both lists that are still to come.
struct Walk {
    next: u32,
    end: u32,
    next_wide: u32,
    end_wide: u32,
}

// The walk over the splats of tile `index`.
fn walk_of(index: u32) -> Walk {
    return Walk(starts[index], starts[index + 1u], 0u, starts[view.tiles.x * view.tiles.y + 1u]);
}

fn has_next(walk: Walk) -> bool {
    return walk.next < walk.end || walk.next_wide < walk.end_wide;
}

// The next slot. There must be one.
fn next_slot(walk: ptr<function, Walk>) -> u32 {
    var slot = 0xffffffffu;
    if (*walk).next < (*walk).end {
        slot = list[(*walk).next];
    }
    var wide_slot = 0xffffffffu;
    if (*walk).next_wide < (*walk).end_wide {
        wide_slot = wide[(*walk).next_wide];
    }
    if slot < wide_slot {
        (*walk).next += 1u;
        return slot;
    }
    (*walk).next_wide += 1u;
    return wide_slot;
}
