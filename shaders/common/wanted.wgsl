// The blocks of the image that are wanted. Twin: Blocks of src/frame.rs.

// One a block, row by row: not 0 where it is wanted.
@group(1) @binding(27) var<storage, read> wanted: array<u32>;

// Tiles along the edge of a block.
const BLOCK_TILES: u32 = 2u;

fn is_wanted_block(block: vec2<u32>) -> bool {
    return all(block < view.blocks) && wanted[block.y * view.blocks.x + block.x] != 0u;
}

// Of the tile in this column and row of the raster.
fn is_wanted(tile: vec2<u32>) -> bool {
    return view.blocks.x == 0u || is_wanted_block(tile / BLOCK_TILES);
}
