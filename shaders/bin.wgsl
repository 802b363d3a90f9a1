// Includes: common/types common/views common/wanted
// Scans: common/scan.wgsl, or common/scan_by_subgroups.wgsl where the device has subgroups.
// Pass `bin`: sorts splats into one list per tile, in global surfel order.
// Twin: src/backend/cpu/bin.rs, whose lists are per chunk; the order is the same.
//   in   touched   number of wanted tiles of each slot's splat; WIDE for splats that are listed separately
//        splats    bounds of the splats
//   out  list      slots, tile after tile, rising within each tile; the tiles of all views of the round
//        starts    start of each tile's list, then the end of the last list; then for each view the place of its first
//                  wide splat, and the number of all
//        wide      slots of splats that touch more than WIDEST tiles, rising
// The pass counts, scans, emits (tile, slot) pairs in slot order, and then sorts them by tile. The sort is a radix
// sort, which keeps the order of equal keys. Scans are reduce-then-scan over several dispatches; no workgroup ever
// waits for another. All values are integers.

@group(1) @binding(4) var<storage, read> splats: array<Splat>;
@group(1) @binding(5) var<storage, read> touched: array<u32>;
// For each workgroup the number of entries and of wide splats; after the scan, the numbers in the workgroups before it.
@group(1) @binding(6) var<storage, read_write> partials: array<vec2<u32>>;
@group(1) @binding(7) var<storage, read_write> written_totals: Totals;
@group(1) @binding(22) var<storage, read> totals: Totals;
@group(1) @binding(8) var<storage, read_write> status: Status;
@group(1) @binding(9) var<storage, read_write> keys: array<u32>;
@group(1) @binding(10) var<storage, read_write> list: array<u32>;
@group(1) @binding(11) var<storage, read_write> wide: array<u32>;
@group(1) @binding(12) var<storage, read_write> starts: array<u32>;
// For each digit, for each workgroup, the number of entries with that digit; after the scan, the number of entries that
// come before them.
@group(1) @binding(13) var<storage, read_write> histogram: array<u32>;
@group(1) @binding(14) var<storage, read_write> digit_totals: array<u32>;
@group(1) @binding(15) var<storage, read> sorted_keys: array<u32>;
@group(1) @binding(16) var<storage, read> sorted_list: array<u32>;

struct Totals {
    // Workgroups of an indirect dispatch over the entries.
    groups: vec3<u32>,
    entries: u32,
    wide: u32,
    // Columns, rows and layers of workgroups of an indirect dispatch with one invocation for each entry.
    columns: u32,
    rows: u32,
    layers: u32,
}

// Dispatches write this one after the other. The host reads it after the frame.
struct Status {
    // Greatest number of entries that a round needed.
    most_entries: u32,
    // Number of splats that were made so far, 64 bits.
    splats_low: u32,
    splats_high: u32,
    // Pixels with more layers than are peeled, as `peel_left_out` counts them, 64 bits.
    left_out_low: u32,
    left_out_high: u32,
    // Entries of the longest list that is walked over at once.
    longest: atomic<u32>,
    // Sum over passes of the longest list that they walked over, 64 bits; number of those passes, and the sum of the
    // shares of a large machine that the tiles with entries kept busy.
    chain_low: u32,
    chain_high: u32,
    walks: u32,
    filled: f32,
    // The same of the lists that were made last, which are not in these sums yet.
    last_walks: u32,
    last_longest: atomic<u32>,
    last_tiles: atomic<u32>,
}

// Invocations that keep the machine busy.
const LARGE_GPU: f32 = 270336.0;

// Takes note of the lists that were made last.
fn count_walks() {
    let longest = atomicLoad(&status.last_longest);
    let chain = status.last_walks * longest;
    let low = status.chain_low + chain;
    status.chain_high += select(0u, 1u, low < chain);
    status.chain_low = low;
    status.walks += status.last_walks;
    let share = min(f32(atomicLoad(&status.last_tiles)) * f32(TILE_PIXELS) / LARGE_GPU, 1.0);
    status.filled += f32(status.last_walks) * share;
    status.last_walks = view.walks;
    atomicStore(&status.last_longest, 0u);
    atomicStore(&status.last_tiles, 0u);
}

// Slots, or entries of lists, of one workgroup.
const WORKGROUP_ITEMS: u32 = 1024u;
const DIGITS: u32 = 64u;
// Lowest bit of the digit of this round.
override SHIFT: u32 = 0u;
// Is the digit the number of the view that an entry's slot belongs to?
override BY_VIEW: bool = false;
// Size of a slot's content in splats, and the part of it that has the bounds where a splat has them. Kernels in motion
// and filtered kernels have two parts.
override SPLATS: u32 = 1u;
override BOUNDS_PART: u32 = 0u;

fn touched_at(slot: u32) -> u32 {
    if slot < view.slots { return touched[slot]; }
    return 0u;
}

fn entries_of(count: u32) -> vec2<u32> {
    return select(vec2<u32>(count, 0u), vec2<u32>(0u, 1u), count == WIDE);
}

var<workgroup> seen: atomic<u32>;

@compute @workgroup_size(256)
fn bin_reduce(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    view = views[0];
    var sum = vec2<u32>(0u);
    var visible = 0u;
    for (var i = 0u; i < 4u; i += 1u) {
        let slot = group.x * WORKGROUP_ITEMS + i * 256u + lane;
        let count = touched_at(slot);
        sum += entries_of(count);
        visible += select(0u, 1u, count != 0u);
    }
    atomicAdd(&seen, visible);
    let result = scan(sum, lane);
    if lane == 0u {
        // Until the scan the high half holds the number of splats. This is safe: a workgroup has at
        // most WORKGROUP_ITEMS wide splats.
        partials[group.x] = vec2<u32>(result.total.x, result.total.y | (atomicLoad(&seen) << 16u));
    }
}

@compute @workgroup_size(256)
fn bin_scan(@builtin(local_invocation_index) lane: u32) {
    view = views[0];
    let workgroups = (view.slots + WORKGROUP_ITEMS - 1u) / WORKGROUP_ITEMS;
    var before = vec2<u32>(0u);
    var visible = 0u;
    for (var first = 0u; first < workgroups; first += 256u) {
        var value = vec2<u32>(0u);
        if first + lane < workgroups {
            let partial = partials[first + lane];
            value = vec2<u32>(partial.x, partial.y & 0xffffu);
            visible += partial.y >> 16u;
        }
        let result = scan(value, lane);
        if first + lane < workgroups {
            partials[first + lane] = before + result.before;
        }
        before += result.total;
    }
    let splats_seen = scan(vec2<u32>(visible, 0u), lane).total.x;
    if lane == 0u {
        count_walks();
        // A list that does not fit stays empty. The host then enlarges the buffer and repeats the frame.
        let fits = before.x <= view.entry_capacity;
        written_totals.entries = select(0u, before.x, fits);
        written_totals.wide = before.y;
        written_totals.groups = vec3<u32>((written_totals.entries + WORKGROUP_ITEMS - 1u) / WORKGROUP_ITEMS, 1u, 1u);
        let pieces = (written_totals.entries + PIECE - 1u) / PIECE;
        written_totals.columns = min(pieces, PIECES_OF_ROW);
        written_totals.rows = (pieces + PIECES_OF_ROW - 1u) / PIECES_OF_ROW;
        written_totals.layers = 1u;
        status.most_entries = max(status.most_entries, before.x);
        let low = status.splats_low + splats_seen;
        status.splats_high += select(0u, 1u, low < splats_seen);
        status.splats_low = low;
    }
}

@compute @workgroup_size(256)
fn bin_emit(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    view = views[0];
    // Each invocation has four consecutive slots.
    let first = group.x * WORKGROUP_ITEMS + lane * 4u;
    var sum = vec2<u32>(0u);
    for (var i = 0u; i < 4u; i += 1u) {
        sum += entries_of(touched_at(first + i));
    }
    var at = partials[group.x] + scan(sum, lane).before;
    for (var i = 0u; i < 4u; i += 1u) {
        let slot = first + i;
        let count = touched_at(slot);
        if count == WIDE {
            wide[at.y] = slot;
            at.y += 1u;
        } else if count > 0u && totals.entries > 0u {
            load_view_of(slot);
            let tiles = unpack(splats[SPLATS * slot + BOUNDS_PART].bounds) / TILE;
            for (var y = tiles.z; y <= tiles.w; y += 1u) {
                for (var x = tiles.x; x <= tiles.y; x += 1u) {
                    if !is_wanted(vec2<u32>(x, y)) { continue; }
                    keys[at.x] = tile_of(vec2<u32>(x, y - view.first_tile_row));
                    list[at.x] = slot;
                    at.x += 1u;
                }
            }
        }
    }
}

// The digit of entry `i` by which this round sorts.
fn digit_of(i: u32) -> u32 {
    if BY_VIEW {
        load_view_of(sorted_list[i]);
        return view.number;
    }
    return (sorted_keys[i] >> SHIFT) % DIGITS;
}

var<workgroup> counts: array<atomic<u32>, DIGITS>;

@compute @workgroup_size(256)
fn sort_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * WORKGROUP_ITEMS;
    let end = min(first + WORKGROUP_ITEMS, totals.entries);
    for (var i = first + lane; i < end; i += 256u) {
        atomicAdd(&counts[digit_of(i)], 1u);
    }
    workgroupBarrier();
    if lane < DIGITS {
        histogram[lane * totals.groups.x + group.x] = atomicLoad(&counts[lane]);
    }
}

// One workgroup for each digit.
@compute @workgroup_size(256)
fn sort_scan(@builtin(workgroup_id) digit: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let groups = totals.groups.x;
    var before = 0u;
    for (var first = 0u; first < groups; first += 256u) {
        let i = first + lane;
        let at = digit.x * groups + i;
        var value = 0u;
        if i < groups {
            value = histogram[at];
        }
        let result = scan(vec2<u32>(value, 0u), lane);
        if i < groups {
            histogram[at] = before + result.before.x;
        }
        before += result.total.x;
    }
    if lane == 0u {
        digit_totals[digit.x] = before;
    }
}

// Entries that follow each other. An entry counts those before it in its own run only.
const RUN: u32 = 32u;
const RUNS: u32 = WORKGROUP_ITEMS / RUN;

var<workgroup> digits: array<u32, WORKGROUP_ITEMS>;
// For each run, for each digit: the number of its entries, and then the place of the first of them.
var<workgroup> places: array<atomic<u32>, RUNS * DIGITS>;

// Entries of equal digits keep their order.
@compute @workgroup_size(256)
fn sort_scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * WORKGROUP_ITEMS;
    let count = min(WORKGROUP_ITEMS, totals.entries - first);
    for (var i = lane; i < count; i += 256u) {
        let digit = digit_of(first + i);
        digits[i] = digit;
        atomicAdd(&places[i / RUN * DIGITS + digit], 1u);
    }
    workgroupBarrier();
    if lane < DIGITS {
        var place = histogram[lane * totals.groups.x + group.x];
        for (var digit = 0u; digit < lane; digit += 1u) {
            place += digit_totals[digit];
        }
        for (var run = 0u; run < RUNS; run += 1u) {
            let entries = atomicLoad(&places[run * DIGITS + lane]);
            atomicStore(&places[run * DIGITS + lane], place);
            place += entries;
        }
    }
    workgroupBarrier();
    for (var i = lane; i < count; i += 256u) {
        let digit = digits[i];
        var place = atomicLoad(&places[i / RUN * DIGITS + digit]);
        for (var before = i / RUN * RUN; before < i; before += 1u) {
            place += select(0u, 1u, digits[before] == digit);
        }
        keys[place] = sorted_keys[first + i];
        list[place] = sorted_list[first + i];
    }
}

// First entry of each tile, by bisection. After the last tile come the end of the list and the first wide splats of
// views.
@compute @workgroup_size(256)
fn bin_starts(@builtin(global_invocation_id) id: vec3<u32>) {
    let tiles = views[0].round_tiles;
    if id.x > tiles {
        let number = id.x - tiles - 1u;
        if number > views[0].views { return; }
        starts[id.x] = totals.wide;
        if number < views[0].views { starts[id.x] = wide_before(views[number].first_slot); }
        return;
    }
    let first = entries_before(id.x, 0u);
    starts[id.x] = first;
    if id.x == tiles { return; }
    let own = entries_before(id.x + 1u, first) - first;
    let all = own + other_entries(id.x);
    atomicMax(&status.last_longest, all);
    if (views[0].flags & IN_STRETCHES) == 0u { atomicMax(&status.longest, all); }
    if own > 0u { atomicAdd(&status.last_tiles, 1u); }
}

// Number of entries of tile `tile` that are not in its own list: the wide splats of its view, and the tile at rest that
// it shares with others.
fn other_entries(tile: u32) -> u32 {
    var low = 0u;
    var high = views[0].views;
    while low + 1u < high {
        let middle = (low + high) / 2u;
        if views[middle].first_tile <= tile { low = middle; } else { high = middle; }
    }
    let rest = views[low].rest;
    if rest == low { return wide_of(low); }
    let tile_at_rest = views[rest].first_tile + (tile - views[low].first_tile);
    let first = entries_before(tile_at_rest, 0u);
    return wide_of(low) + wide_of(rest) + entries_before(tile_at_rest + 1u, first) - first;
}

// Number of wide splats of view `number`.
fn wide_of(number: u32) -> u32 {
    if totals.wide == 0u { return 0u; }
    var end = totals.wide;
    if number + 1u < views[0].views { end = wide_before(views[number + 1u].first_slot); }
    return end - wide_before(views[number].first_slot);
}

// Number of entries of tiles before `tile`, at least `least`.
fn entries_before(tile: u32, least: u32) -> u32 {
    var low = least;
    var high = totals.entries;
    while low < high {
        let middle = low + (high - low) / 2u;
        if sorted_keys[middle] < tile {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// Number of wide splats in the slots before `slot`.
fn wide_before(slot: u32) -> u32 {
    var low = 0u;
    var high = totals.wide;
    while low < high {
        let middle = low + (high - low) / 2u;
        if wide[middle] < slot {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}
