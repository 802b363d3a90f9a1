// Numbers that samples draw. Twin: src/sampling.rs.

// A number in [0, 1) for sample `number`, in steps of 2^-24; those of two seeds are independent.
fn chance(number: u32, seed: u32) -> f32 {
    let index = owen_scramble(number, mixed(seed));
    let fraction = owen_scramble(reverseBits(index), mixed(~seed));
    return f32(fraction >> 8u) / 16777216.0;
}

fn owen_scramble(fraction: u32, seed: u32) -> u32 {
    var x = reverseBits(fraction);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverseBits(x);
}

// A well-mixed hash of a number. Twin: mix.
fn mixed(number: u32) -> u32 {
    var x = (number ^ (number >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    return x ^ (x >> 16u);
}
