// The splats of one tile in global surfel order: a walk that merges two rising lists of slots, the tile's own list and
// the list of wide splats. Twin: the lists of src/backend/cpu/bin.rs, which need no merging.
// A program that uses this file declares `list`, `wide` and `starts`, the output of `bin`.

// The entries of both lists that are still to come; then the same of lists that come after them.
struct Walk {
    next: u32,
    end: u32,
    next_wide: u32,
    end_wide: u32,
    later: u32,
    later_end: u32,
    later_wide: u32,
    later_end_wide: u32,
}

// The walk over the splats of tile `index` of the round.
fn walk_of(index: u32) -> Walk {
    let wide_at = view.round_tiles + 1u + view.number;
    return Walk(starts[index], starts[index + 1u], starts[wide_at], starts[wide_at + 1u], 0u, 0u, 0u, 0u);
}

fn has_next(walk: Walk) -> bool {
    return walk.next < walk.end || walk.next_wide < walk.end_wide || walk.later < walk.later_end
        || walk.later_wide < walk.later_end_wide;
}

// The next slot. There must be one.
fn next_slot(walk: ptr<function, Walk>) -> u32 {
    if !((*walk).next < (*walk).end || (*walk).next_wide < (*walk).end_wide) {
        *walk = later_of(*walk);
    }
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

// The walk over the lists that come after the first ones.
fn later_of(walk: Walk) -> Walk {
    return Walk(walk.later, walk.later_end, walk.later_wide, walk.later_end_wide, 0u, 0u, 0u, 0u);
}
