//! Tiles: the squares of the image that are worked on one at a time.

use crate::frame::PixelRect;

/// Edge of a tile, pixels.
pub(in crate::backend) const TILE: usize = 32;
/// Pixels that inner loops work on at once.
pub(in crate::backend) const LANES: usize = 8;
/// A number for each of so many neighbours.
pub(in crate::backend) type Lanes = [f32; LANES];
/// Floats from one row of a tile buffer to the next: loops may start at any pixel and write `LANES` of them.
pub(in crate::backend) const STRIDE: usize = TILE + LANES;
/// Rows of a tile buffer: loops may start at any row and write two.
pub(in crate::backend) const ROWS: usize = TILE + 1;

/// The first `LANES` pixels of `plane`.
#[inline(always)]
pub(in crate::backend) fn lanes(plane: &[f32]) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    out.copy_from_slice(&plane[..LANES]);
    out
}

/// A rectangle of tiles that is rendered together: whole rows of tiles.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Band {
    /// First and one past the last row of tiles.
    pub tile_rows: [usize; 2],
    /// Tiles in a row.
    pub tiles_x: usize,
    pub pixels: PixelRect,
    /// Pixel from which tiles and their pixels are counted: 0, except with a guard band.
    pub corner: [i32; 2],
}

impl Band {
    pub(in crate::backend) fn new(size: [u32; 2], tile_rows: [usize; 2]) -> Self {
        let bottom = (tile_rows[1] * TILE).min(size[1] as usize);
        Self {
            tile_rows,
            tiles_x: (size[0] as usize).div_ceil(TILE),
            pixels: PixelRect {
                first_row: (tile_rows[0] * TILE) as i32,
                last_row: bottom as i32 - 1,
                ..PixelRect::of_image(size)
            },
            corner: [0; 2],
        }
    }

    /// The band and `guard` pixels around it, as [`PixelRect::guarded`], in tiles of its own.
    pub(in crate::backend) fn guarded(&self, guard: u32) -> Self {
        let pixels = self.pixels.guarded(guard);
        let [tiles_x, tiles_y] = pixels.tiles(TILE as u32).map(|tiles| tiles as usize);
        Self { tile_rows: [0, tiles_y], tiles_x, pixels, corner: pixels.corner() }
    }

    /// Tiles in the band.
    pub(in crate::backend) fn len(&self) -> usize {
        self.tiles_x * (self.tile_rows[1] - self.tile_rows[0])
    }

    /// Tile `index` of the band, row by row.
    pub(in crate::backend) fn tile(&self, index: usize) -> TileRect {
        let (x, y) = (index % self.tiles_x, index / self.tiles_x + self.tile_rows[0]);
        let (x0, y0) = (x * TILE, y * TILE);
        TileRect {
            tile: [x, y],
            origin: [x0, y0],
            corner: [self.corner[0] + x0 as i32, self.corner[1] + y0 as i32],
            width: ((self.pixels.last_column + 1 - self.corner[0]) as usize - x0).min(TILE),
            height: ((self.pixels.last_row + 1 - self.corner[1]) as usize - y0).min(TILE),
        }
    }
}

/// A tile of the image.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct TileRect {
    /// Column and row among the tiles.
    pub tile: [usize; 2],
    /// First pixel column and row, counted from the band's corner.
    pub origin: [usize; 2],
    /// First pixel column and row of the raster.
    pub corner: [i32; 2],
    /// Pixels of the image in a row of the tile.
    pub width: usize,
    /// Pixel rows of the image in the tile.
    pub height: usize,
}

impl TileRect {
    /// First and last column, first and last row, counted from the band's corner.
    pub(in crate::backend) const fn bounds(&self) -> [usize; 4] {
        let [x, y] = self.origin;
        [x, x + self.width - 1, y, y + self.height - 1]
    }
}
