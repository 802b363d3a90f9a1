// What an invocation works on: a quad, four neighbouring pixels of a row. Software devices are fast with it.
// Its other form: common/pixel.wgsl. The table of passes says what programs with one form work on.

alias Floats = vec4<f32>;
alias Bools = vec4<bool>;

// Number of pixels of an invocation.
fn width() -> u32 {
    return 4u;
}

// Places of its pixels relative to the first.
fn steps() -> Floats {
    return vec4<f32>(0.0, 1.0, 2.0, 3.0);
}

fn any_of(flags: Bools) -> bool {
    return any(flags);
}

fn first_of(values: Floats) -> f32 {
    return values.x;
}

// Place in an array of `Floats` of the pixels from column `column`, which lie in quad `quad` of a plane of quads.
fn place_in(quad: u32, column: u32) -> u32 {
    return quad;
}

// The pixels of the quad that begins at column `column` and lie in the splat's columns.
fn in_columns(bounds: vec4<u32>, column: u32) -> Bools {
    let columns = vec4<u32>(column, column + 1u, column + 2u, column + 3u);
    return (columns >= vec4<u32>(bounds.x)) & (columns <= vec4<u32>(bounds.y));
}
