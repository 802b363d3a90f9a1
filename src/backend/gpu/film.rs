//! The film as it comes from the device.

use super::layout::TILE;
use super::memory::RasterFilm;
use crate::film::Film;

/// The films of all rasters of a frame. Each has its tiles one after the other; a tile has its planes one after the
/// other, `TILE` x `TILE` pixels each.
#[derive(Debug)]
pub(in crate::backend) struct DeviceFilm<'a> {
    pub rasters: &'a [RasterFilm],
    pub stride: usize,
    pub planes: usize,
    /// Number of time samples of a pixel.
    pub samples: u32,
    pub values: &'a [f32],
}

impl Film for DeviceFilm<'_> {
    fn row(&self, plane: usize, y: u32, out: &mut [f32]) {
        let (stride, tile) = (self.stride, TILE as usize);
        for raster in self.rasters {
            let write = |y: usize, out: &mut [f32]| {
                let tiles_x = raster.tiles[0] as usize;
                let tile_floats = self.planes * tile * tile;
                let tiles = &self.values[raster.start as usize + y / tile * tiles_x * tile_floats..];
                for (out, values) in out.chunks_mut(tile * stride).zip(tiles.chunks_exact(tile_floats)) {
                    let row = &values[(plane * tile + y % tile) * tile..][..tile];
                    out.iter_mut().step_by(stride).zip(row).for_each(|(out, value)| *out = *value);
                }
            };
            raster.place.fill(y as usize, stride, out, write);
        }
    }

    fn samples(&self, _y: u32, out: &mut [f32]) {
        out.fill(self.samples as f32);
    }
}
