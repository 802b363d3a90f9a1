//! The map of a group at mid-interval, over the image and a guard band around it. Swept kernels look up in it whether
//! their source is visible (Wolf 2008, fig. 4.5).

use crate::backend::cpu::paint::APRON_STRIDE;
use crate::backend::cpu::tiles::{Band, TILE, TileRect};

/// Depth threshold of each sample position, tile by tile.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Map {
    /// First pixel column and row.
    corner: [i32; 2],
    /// Tiles in a row, and rows of tiles.
    tiles: [i32; 2],
    values: Vec<f32>,
}

/// Values of one tile: `TILE` rows of `TILE`.
pub(in crate::backend) type MapTile = [f32; TILE * TILE];

/// Beyond the map everything is visible. `store` makes the same of a pixel without kernels, so that it
/// does not matter which tiles had kernels.
const UNKNOWN: f32 = f32::INFINITY;

impl Map {
    /// Bytes of a map of `tiles` tiles.
    pub(in crate::backend) const fn bytes(tiles: u64) -> u64 {
        tiles * size_of::<MapTile>() as u64
    }

    /// Clears the map and lays it over `band`; returns its tiles, row by row.
    pub(in crate::backend) fn lay(&mut self, band: &Band) -> &mut [MapTile] {
        self.corner = band.corner;
        self.tiles = [band.tiles_x as i32, (band.len() / band.tiles_x.max(1)) as i32];
        self.values.clear();
        self.values.resize(band.len() * TILE * TILE, UNKNOWN);
        self.values.as_chunks_mut().0
    }

    /// Threshold at pixel (`x`, `y`).
    #[inline(always)]
    pub(super) fn at(&self, x: i32, y: i32) -> f32 {
        const BITS: u32 = TILE.trailing_zeros();
        const MASK: i32 = TILE as i32 - 1;
        let (x, y) = (x.wrapping_sub(self.corner[0]), y.wrapping_sub(self.corner[1]));
        let (tile_x, tile_y) = (x >> BITS, y >> BITS);
        if (tile_x as u32) < self.tiles[0] as u32 && (tile_y as u32) < self.tiles[1] as u32 {
            let tile = (tile_y * self.tiles[0] + tile_x) as usize;
            let place = ((y & MASK) << BITS | (x & MASK)) as usize;
            self.values.get(tile * (TILE * TILE) + place).copied().unwrap_or(UNKNOWN)
        } else {
            UNKNOWN
        }
    }
}

/// Pass `store`: a tile's thresholds into its part of the map.
pub(in crate::backend) fn store(tile: &TileRect, threshold: &[f32], out: &mut MapTile) {
    for y in 0..tile.height {
        out[y * TILE..][..tile.width].copy_from_slice(&threshold[y * APRON_STRIDE..][..tile.width]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tile whose list is empty has the values that `lay` wrote. They must be those that `store` makes of pixels
    /// without kernels: the size of tiles must not show.
    #[test]
    fn a_tile_without_kernels_is_like_pixels_without() {
        let band = Band::new([TILE as u32; 2], [0, 1]);
        let mut map = Map::default();
        let laid = map.lay(&band)[0];
        let mut stored = [0.0; TILE * TILE];
        store(&band.tile(0), &[f32::INFINITY; TILE * APRON_STRIDE], &mut stored);
        assert_eq!(laid, stored);
    }
}
