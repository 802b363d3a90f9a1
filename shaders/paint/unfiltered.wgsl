// A kernel of which nothing but the disc is stored.
// Twin: src/backend/cpu/paint/kernel.rs.

alias Kernel = Splat;

fn kernel_of(all: EwaSplat) -> Kernel {
    return all.disc;
}

fn disc_of(splat: Kernel) -> Splat {
    return splat;
}

// The pixels in which it may have weight.
fn weight_bounds(splat: Kernel) -> vec4<u32> {
    return unpack(splat.bounds);
}

fn peak_of(splat: Kernel) -> f32 {
    return 1.0;
}
