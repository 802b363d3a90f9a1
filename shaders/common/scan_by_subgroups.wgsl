// Exclusive prefix sums over a workgroup of 256 invocations, by subgroups: three barriers in place of eighteen.
// The other form, for devices without subgroups: scan.wgsl.

var<workgroup> scanned: array<vec2<u32>, 256>;
// Values of 256 that a subgroup sums are a run. Their sums, and how many runs subgroups have taken.
var<workgroup> sums_of_runs: array<vec2<u32>, 256>;
var<workgroup> runs_taken: atomic<u32>;

struct Scan {
    before: vec2<u32>,
    total: vec2<u32>,
}

// WGSL promises no order of the invocations in a subgroup, nor of subgroups. So each subgroup takes a run, and each
// of its invocations a value of it. Subgroups have equal sizes, which divide 256.
fn scan(value: vec2<u32>, lane: u32) -> Scan {
    scanned[lane] = value;
    if lane == 0u { atomicStore(&runs_taken, 0u); }
    workgroupBarrier();
    let place = subgroupExclusiveAdd(1u);
    let size = subgroupAdd(1u);
    var run = 0u;
    if place == 0u { run = atomicAdd(&runs_taken, 1u); }
    run = subgroupAdd(run);
    let own = scanned[run * size + place];
    let before_in_run = subgroupExclusiveAdd(own);
    scanned[run * size + place] = before_in_run;
    if place == size - 1u { sums_of_runs[run] = before_in_run + own; }
    workgroupBarrier();
    var before = scanned[lane];
    var total = vec2<u32>(0u);
    for (var other = 0u; other < 256u / size; other += 1u) {
        if other == lane / size { before += total; }
        total += sums_of_runs[other];
    }
    workgroupBarrier();
    return Scan(before, total);
}
