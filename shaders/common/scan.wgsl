// Exclusive prefix sums over a workgroup of 256 invocations.

var<workgroup> scanned: array<vec2<u32>, 256>;

struct Scan {
    before: vec2<u32>,
    total: vec2<u32>,
}

fn scan(value: vec2<u32>, lane: u32) -> Scan {
    scanned[lane] = value;
    workgroupBarrier();
    for (var distance = 1u; distance < 256u; distance *= 2u) {
        var sum = scanned[lane];
        if lane >= distance {
            sum += scanned[lane - distance];
        }
        workgroupBarrier();
        scanned[lane] = sum;
        workgroupBarrier();
    }
    let result = Scan(scanned[lane] - value, scanned[255]);
    workgroupBarrier();
    return result;
}
