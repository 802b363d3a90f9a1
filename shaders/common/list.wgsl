// The splats of one tile in global surfel order: a walk that merges two rising lists of slots, the tile's own list and
// the list of wide splats. Twin: the lists of src/backend/cpu/bin.rs, which need no merging.
// A program that uses this file declares `list`, `wide` and `starts`, the output of `bin`.

// Most entries that an invocation walks over. Some software devices end its loops early (View.stretch).
override STRETCH: u32 = 0xffffffffu;

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

// How many of the first i entries of a walk are in the tile's own list. Later lists do not count.
fn own_before(walk: Walk, i: u32) -> u32 {
    let all_wide = walk.end_wide - walk.next_wide;
    var least = max(i, all_wide) - all_wide;
    var most = min(i, walk.end - walk.next);
    while least < most {
        let middle = (least + most) / 2u;
        // Here middle is less than the own entries, and i - 1 - middle less than the wide ones.
        if list[walk.next + middle] < wide[walk.next_wide + (i - 1u - middle)] {
            least = middle + 1u;
        } else {
            most = middle;
        }
    }
    return least;
}

// The part of a walk that a view is for. Later lists do not count.
fn stretch_of(walk: Walk) -> Walk {
    if STRETCH == 0xffffffffu { return walk; }
    let entries = walk.end - walk.next + walk.end_wide - walk.next_wide;
    let first = view.stretch * STRETCH;
    if first >= entries { return Walk(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u); }
    let last = min(first + STRETCH, entries);
    let own = vec2<u32>(own_before(walk, first), own_before(walk, last));
    let of_wide = vec2<u32>(first, last) - own;
    let next = walk.next + own;
    let next_wide = walk.next_wide + of_wide;
    return Walk(next.x, next.y, next_wide.x, next_wide.y, 0u, 0u, 0u, 0u);
}

// The walk over the lists that come after the first ones.
fn later_of(walk: Walk) -> Walk {
    return Walk(walk.later, walk.later_end, walk.later_wide, walk.later_end_wide, 0u, 0u, 0u, 0u);
}
