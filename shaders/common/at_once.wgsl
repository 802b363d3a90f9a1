// Lists that the invocations of a tile read together. A workgroup of 256 invocations reads AT_ONCE entries, one each.
// Its pixels lie in panels of 8 x 4, one for each 32 invocations, and a mask of each panel tells which entries touch
// it. So the invocations of a panel see their own entries alone, in the order of the list.
// A program that uses this file has common/list.wgsl, and declares what it keeps of an entry.

// Entries that are read at once: kernels of 8 KiB.
override AT_ONCE: u32 = select(128u, 64u, FILTERED);
const LANES: u32 = 256u;
const PANEL_LANES: u32 = 32u;
const PANEL_COLUMNS: u32 = 8u;
const PANEL_ROWS: u32 = 4u;
// Panels of a tile, and of a row of it.
const PANELS: u32 = LANES / PANEL_LANES;
const PANELS_OF_ROW: u32 = TILE / PANEL_COLUMNS;
// Words of a panel's mask.
override WORDS: u32 = AT_ONCE / 32u;
var<workgroup> masks: array<atomic<u32>, PANELS * WORDS>;
// A flag that is true if it is so in any invocation.
var<workgroup> votes: atomic<u32>;
var<workgroup> vote: u32;

// Is `flag` true in any invocation? All must ask.
fn any_lane(lane: u32, flag: bool) -> bool {
    if lane == 0u { atomicStore(&votes, 0u); }
    workgroupBarrier();
    if flag { atomicOr(&votes, 1u); }
    workgroupBarrier();
    if lane == 0u { vote = atomicLoad(&votes); }
    return workgroupUniformLoad(&vote) != 0u;
}

// The pixel of an invocation, counted from the tile's first.
fn in_panels(lane: u32) -> vec2<u32> {
    let panel = lane / PANEL_LANES;
    let in_panel = vec2<u32>(lane % PANEL_COLUMNS, (lane % PANEL_LANES) / PANEL_COLUMNS);
    let first = vec2<u32>(panel % PANELS_OF_ROW, panel / PANELS_OF_ROW) * vec2<u32>(PANEL_COLUMNS, PANEL_ROWS);
    return first + in_panel;
}

// Number of entries of a walk.
fn entries_of(walk: Walk) -> u32 {
    return walk.end - walk.next + walk.end_wide - walk.next_wide + walk.later_end - walk.later + walk.later_end_wide
        - walk.later_wide;
}

// Entry `i` of a walk.
fn entry_of(walk: Walk, i: u32) -> u32 {
    let first = walk.end - walk.next + walk.end_wide - walk.next_wide;
    if i < first { return entry_of_part(walk, i); }
    return entry_of_part(later_of(walk), i - first);
}

// Entry `i` of the lists that come first.
fn entry_of_part(walk: Walk, i: u32) -> u32 {
    if walk.end_wide == walk.next_wide { return list[walk.next + i]; }
    // Entry i is the one before which i others are: some of the tile's own, the rest of them wide.
    let at = walk.next + own_before(walk, i);
    let at_wide = walk.next_wide + (i - (at - walk.next));
    var slot = 0xffffffffu;
    if at < walk.end { slot = list[at]; }
    if at_wide < walk.end_wide { slot = min(slot, wide[at_wide]); }
    return slot;
}

// Begins to read entries: no panel has any. A barrier must come before and after it.
fn clear_masks(lane: u32) {
    if lane < PANELS * WORDS { atomicStore(&masks[lane], 0u); }
}

// Notes that entry `k` of those that are read may touch the pixels in `bounds`. The tile begins at pixel `first`.
fn mark(k: u32, bounds: vec4<u32>, first: vec2<i32>) {
    let from_first = vec4<i32>(bounds) - first.xxyy;
    if from_first.y < 0 || from_first.w < 0 { return; }
    let low = vec2<u32>(max(from_first.xz, vec2<i32>(0))) / vec2<u32>(PANEL_COLUMNS, PANEL_ROWS);
    let high = vec2<u32>(from_first.yw) / vec2<u32>(PANEL_COLUMNS, PANEL_ROWS);
    for (var y = low.y; y <= min(high.y, PANELS / PANELS_OF_ROW - 1u); y += 1u) {
        for (var x = low.x; x <= min(high.x, PANELS_OF_ROW - 1u); x += 1u) {
            atomicOr(&masks[(y * PANELS_OF_ROW + x) * WORDS + k / 32u], 1u << (k % 32u));
        }
    }
}

// Word `word` of the mask of an invocation's panel.
fn mask_of(lane: u32, word: u32) -> u32 {
    return atomicLoad(&masks[(lane / PANEL_LANES) * WORDS + word]);
}
