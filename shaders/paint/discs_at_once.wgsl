// Discs that the invocations of a tile read together, with the epsilons of their objects.

var<workgroup> discs_read: array<Splat, AT_ONCE>;
var<workgroup> epsilons_read: array<f32, AT_ONCE>;

// Reads the entries of a walk from entry `before` on. The last arguments are those of `mark`.
fn read_discs(
    lane: u32, walk: Walk, before: u32, entries: u32, first: vec2<i32>, in_row: u32, panels_before: u32,
) {
    workgroupBarrier();
    clear_masks(lane);
    workgroupBarrier();
    if lane < AT_ONCE && before + lane < entries {
        let disc = disc_of(splats[entry_of(walk, before + lane)]);
        discs_read[lane] = disc;
        epsilons_read[lane] = segments[disc.flags >> 1u].epsilon;
        mark(lane, unpack(disc.bounds), first, in_row, panels_before);
    }
    workgroupBarrier();
}
