//! The map of a group at mid-interval, over the image and a guard band around it. Swept kernels look up in it whether
//! their source is visible (Wolf 2008, fig. 4.5), and how dense kernels are there.

use crate::backend::cpu::tiles::{Band, STRIDE, TILE, TileRect};

/// Depth threshold and inverse density of each sample position, tile by tile.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Map {
    /// First pixel column and row.
    corner: [i32; 2],
    /// Tiles in a row, and rows of tiles.
    tiles: [i32; 2],
    values: Vec<[f32; 2]>,
}

/// Values of one tile: `TILE` rows of `TILE`.
pub(in crate::backend) type MapTile = [[f32; 2]; TILE * TILE];

/// Beyond the map everything is visible, however sparse. `store` makes the same of a pixel without kernels, so that it
/// does not matter which tiles had kernels.
const UNKNOWN: [f32; 2] = [f32::INFINITY; 2];

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

    /// Threshold and inverse density at pixel (`x`, `y`).
    #[inline(always)]
    pub(super) fn at(&self, x: i32, y: i32) -> [f32; 2] {
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

/// Pass `store`: a tile's thresholds and, where there are any, sums of weights into its part of the map.
pub(in crate::backend) fn store(tile: &TileRect, threshold: &[f32], sums: &[f32], out: &mut MapTile) {
    for y in 0..tile.height {
        for x in 0..tile.width {
            let at = y * STRIDE + x;
            let density = sums.get(at).copied().unwrap_or(1.0);
            // Where there is no kernel the inverse is infinite: a share is the most that it can be.
            out[y * TILE + x] = [threshold[at], 1.0 / density];
        }
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
        let mut stored = [[0.0; 2]; TILE * TILE];
        store(&band.tile(0), &[f32::INFINITY; TILE * STRIDE], &[0.0; TILE * STRIDE], &mut stored);
        assert_eq!(laid, stored);
    }
}
