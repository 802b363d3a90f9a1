//! What step `Paint` stores of one tile.

use crate::backend::cpu::tiles::{LANES, ROWS, STRIDE, TILE, TileRect};

/// Widest apron: pixels around a tile whose depths are known, too.
pub(in crate::backend) const MOST_APRON: usize = 8;
/// Floats from one row of a plane with an apron to the next.
pub(in crate::backend) const APRON_STRIDE: usize = TILE + 2 * MOST_APRON + LANES;
/// Rows of a plane with an apron: loops may write one more.
pub(in crate::backend) const APRON_ROWS: usize = TILE + 2 * MOST_APRON + 1;

/// Groups of splats at a pixel, by depth, in the order in which they are composited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend) enum DepthLayer {
    /// Before the nearest disc that covers the pixel, by more than the tolerance.
    Front,
    /// At the nearest disc.
    Band,
    /// At the next disc behind the band.
    Second,
    /// Behind that.
    Rest,
}

impl DepthLayer {
    pub(in crate::backend) const ALL: [Self; 4] = [Self::Front, Self::Band, Self::Second, Self::Rest];
}

/// Channels of a layer that follow those of the frame.
pub(in crate::backend) const EXTRA: usize = 3;
/// Sum of weight times peak.
pub(in crate::backend) const PEAK: usize = 0;
/// Sum of weights, negative for splats that show their backs.
pub(in crate::backend) const SIDE: usize = 1;
/// Number of discs of the layer that cover the pixel.
pub(in crate::backend) const DISC: usize = 2;

/// Depths and sums of one tile. Those that only a filter needs are empty without it.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct PaintBuffers {
    /// T(x, t), +inf where no disc covers: with an apron.
    pub threshold: Vec<f32>,
    /// Depth of the nearest disc, +inf where no disc covers: with an apron; empty where all objects have one tolerance.
    pub nearest: Vec<f32>,
    /// Depths up to which all was peeled off: only what lies behind counts. With an apron; empty where nothing was.
    pub floor: Vec<f32>,
    /// The same minimum over the discs behind T: `ROWS` rows of `STRIDE`.
    pub second: Vec<f32>,
    /// For each row a bit for each pixel that is not solid.
    pub open: Vec<u32>,
    /// For each row a bit for each pixel near which there is one that no disc covers.
    pub rim: Vec<u32>,
    /// Weighted sums of each layer: for each of `ROWS` rows, for each channel and then the extra ones, `STRIDE` floats.
    /// Without a filter there is the band alone, and no channel is extra.
    pub sums: [Vec<f32>; 4],
    /// Floats of a row of sums, all channels.
    pub row: usize,
    /// Does anything that moves touch the tile?
    pub moves: bool,
}

impl PaintBuffers {
    /// Bytes of one tile's buffers, with a filter or without. `nearest`: with the depth of the nearest disc.
    pub(in crate::backend) const fn bytes(channels: usize, filtered: bool, nearest: bool) -> u64 {
        let (planes, depths) = if filtered { (4 * (channels + EXTRA) + 1, 2) } else { (channels, 1) };
        let depths = depths + nearest as usize;
        ((planes * ROWS * STRIDE + depths * APRON_ROWS * APRON_STRIDE + 2 * TILE) * size_of::<f32>()) as u64
    }

    pub(in crate::backend) fn clear_depths(&mut self, filtered: bool, nearest: bool) {
        let with_apron = APRON_ROWS * APRON_STRIDE;
        for (plane, floats, value) in [
            (&mut self.threshold, with_apron, f32::INFINITY),
            (&mut self.nearest, if nearest { with_apron } else { 0 }, f32::INFINITY),
            (&mut self.second, if filtered { ROWS * STRIDE } else { 0 }, f32::INFINITY),
        ] {
            plane.clear();
            plane.resize(floats, value);
        }
        for rows in [&mut self.open, &mut self.rim] {
            rows.clear();
            rows.resize(TILE, 0);
        }
    }

    pub(in crate::backend) fn clear_sums(&mut self, channels: usize, filtered: bool) {
        let open = self.any_open();
        self.row = (channels + if filtered { EXTRA } else { 0 }) * STRIDE;
        for (layer, sums) in DepthLayer::ALL.into_iter().zip(&mut self.sums) {
            sums.clear();
            if open || layer == DepthLayer::Band {
                sums.resize(ROWS * self.row, 0.0);
            }
        }
    }

    /// Copies T(x, t) of a tile that begins at `first` in planes with an apron: `ROWS` rows of `STRIDE`.
    pub(in crate::backend) fn copy_threshold(&self, first: usize, tile: &TileRect, out: &mut Vec<f32>) {
        out.clear();
        out.resize(ROWS * STRIDE, f32::INFINITY);
        for y in 0..tile.height {
            let row = &self.threshold[first + y * APRON_STRIDE..][..tile.width];
            out[y * STRIDE..][..tile.width].copy_from_slice(row);
        }
    }

    pub(in crate::backend) fn any_open(&self) -> bool {
        self.open.iter().any(|&row| row != 0)
    }
}

/// The tile with its apron, as far as it lies in an image of `size` pixels, and where the tile begins in it.
pub(in crate::backend) fn with_apron(tile: &TileRect, apron: usize, size: [u32; 2]) -> (TileRect, [usize; 2]) {
    let [x, y] = tile.origin;
    let (left, top) = (x.min(apron), y.min(apron));
    let right = (size[0] as usize - x - tile.width).min(apron);
    let bottom = (size[1] as usize - y - tile.height).min(apron);
    let rect = TileRect {
        tile: tile.tile,
        origin: [x - left, y - top],
        corner: [tile.corner[0] - left as i32, tile.corner[1] - top as i32],
        width: left + tile.width + right,
        height: top + tile.height + bottom,
    };
    (rect, [left, top])
}
