// The blocks of the image that are wanted. Twin: Blocks of src/frame/mod.rs.

// One number for each block, row by row. It is not 0 where the block is wanted.
@group(1) @binding(27) var<storage, read> wanted: array<u32>;

// Tiles along the edge of a block.
const BLOCK_TILES: u32 = 2u;

fn is_wanted_block(block: vec2<u32>) -> bool {
    return all(block < view.blocks) && wanted[block.y * view.blocks.x + block.x] != 0u;
}

// True if the block of the tile in this column and row of the raster is wanted.
fn is_wanted(tile: vec2<u32>) -> bool {
    return view.blocks.x == 0u || is_wanted_block(tile / BLOCK_TILES);
}
