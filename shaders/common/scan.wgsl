// Exclusive prefix sums over a workgroup of 256 invocations.

var<workgroup> scanned: array<vec2<u32>, 256>;

struct Scan {
    before: vec2<u32>,
    total: vec2<u32>,
}

fn scan(value: vec2<u32>, lane: u32) -> Scan {
    scanned[lane] = value;
    workgroupBarrier();
    for (var reach = 1u; reach < 256u; reach *= 2u) {
        var sum = scanned[lane];
        if lane >= reach {
            sum += scanned[lane - reach];
        }
        workgroupBarrier();
        scanned[lane] = sum;
        workgroupBarrier();
    }
    let result = Scan(scanned[lane] - value, scanned[255]);
    workgroupBarrier();
    return result;
}
