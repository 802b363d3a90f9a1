// Includes: common/types common/views common/fast common/hit common/depths paint/kernel
// What passes `visibility` and `second` know of a disc.
// A program that uses this file declares `splats` and `segments`.

// A disc on the rays through the pixels.
struct Met {
    covers: Bools,
    depth: Floats,
    // T would be this, if the disc were the only one.
    threshold: Floats,
    tolerance: Floats,
}

fn meet(disc: Splat, column: u32, row: u32) -> Met {
    let at = hit(disc, column, row);
    let depth = 1.0 / at.inverse_depth;
    let tolerance = tolerance_at(depth, segments[disc.flags >> 1u].epsilon);
    return Met(covers(disc, at, column), depth, depth + tolerance, tolerance);
}
