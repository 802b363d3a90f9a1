// What an invocation works on: one pixel. Hardware is fast with it, since splats are a few pixels large.
// Its other form: common/quad.wgsl. Planes of buffers are the same: quads, whose floats are pixels of a row.

alias Floats = f32;
alias Bools = bool;

// Number of pixels of an invocation.
fn width() -> u32 {
    return 1u;
}

// Places of its pixels relative to the first.
fn steps() -> Floats {
    return 0.0;
}

fn any_of(flag: Bools) -> bool {
    return flag;
}

fn first_of(value: Floats) -> f32 {
    return value;
}

// Place in an array of `Floats` of the pixel in column `column`, which lies in quad `quad` of a plane of quads.
fn place_in(quad: u32, column: u32) -> u32 {
    return 4u * quad + column % 4u;
}

// Is column `column` one of the splat's?
fn in_columns(bounds: vec4<u32>, column: u32) -> Bools {
    return column >= bounds.x && column <= bounds.y;
}
