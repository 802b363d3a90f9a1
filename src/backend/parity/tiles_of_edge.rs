//! Tiles of another size than the CPU's own: `edge` x `edge` pixels, at most 32.

use crate::backend::cpu::tiles::{Band, TileRect};

/// Tile (column, row) of `band`.
pub(super) fn rect(band: &Band, tile: [usize; 2], edge: usize) -> TileRect {
    let origin = tile.map(|i| i * edge);
    let size = band.pixels.size().map(|pixels| pixels as usize);
    let [width, height] = [0, 1].map(|i| (size[i] - origin[i]).min(edge));
    TileRect { tile, origin, corner: [0, 1].map(|i| band.corner[i] + origin[i] as i32), width, height }
}

/// Which of `bounds` may touch the tile.
pub(super) fn touches(bounds: impl Iterator<Item = [u16; 4]>, tile: [usize; 2], edge: usize) -> Vec<u32> {
    let touches = |bounds: [u16; 4]| {
        let [x0, x1, y0, y1] = bounds.map(|pixel| usize::from(pixel) / edge);
        (x0..=x1).contains(&tile[0]) && (y0..=y1).contains(&tile[1])
    };
    bounds.enumerate().filter(|(_, bounds)| touches(*bounds)).map(|(i, _)| i as u32).collect()
}

/// The first `edge` values of each of `edge` rows that are `stride` apart.
pub(super) fn take_rows<T: Copy>(values: &[T], stride: usize, edge: usize) -> Vec<T> {
    (0..edge).flat_map(|y| values[y * stride..][..edge].iter().copied()).collect()
}

/// Writes rows of `edge` values to rows that are `stride` apart.
pub(super) fn put_rows<T: Copy>(values: &[T], out: &mut [T], stride: usize, edge: usize) {
    for (y, row) in values.chunks(edge).enumerate() {
        out[y * stride..][..edge].copy_from_slice(row);
    }
}
