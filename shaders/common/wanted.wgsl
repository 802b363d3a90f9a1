// The blocks of the image that are wanted. Twin: Blocks of src/frame/mod.rs.

// One number for each block, row by row. It is not 0 where the block is wanted.
@group(1) @binding(27) var<storage, read> wanted: array<u32>;

// Pixels along the edge of a block.
const BLOCK: u32 = 32u;

fn is_wanted_block(block: vec2<u32>) -> bool {
    return all(block < view.blocks) && wanted[block.y * view.blocks.x + block.x] != 0u;
}

// True if any block is wanted that holds pixels of the tile in this column and row of the raster.
fn is_wanted(tile: vec2<u32>) -> bool {
    if view.blocks.x == 0u { return true; }
    let first = (TILE * tile + view.first) / BLOCK;
    let last = (TILE * tile + view.first + TILE - 1u) / BLOCK;
    return is_wanted_block(first) || is_wanted_block(last) || is_wanted_block(vec2<u32>(first.x, last.y))
        || is_wanted_block(vec2<u32>(last.x, first.y));
}
