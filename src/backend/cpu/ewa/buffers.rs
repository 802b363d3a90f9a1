//! What full EWA stores of one tile.

use crate::backend::cpu::tiles::{LANES, ROWS, STRIDE, TILE, TileRect};

/// Widest apron: pixels around a tile whose depths are known, too.
pub(in crate::backend) const MOST_APRON: usize = 8;
/// Floats from one row of a plane with an apron to the next.
pub(in crate::backend) const APRON_STRIDE: usize = TILE + 2 * MOST_APRON + LANES;
/// Rows of a plane with an apron: loops may write one more.
pub(in crate::backend) const APRON_ROWS: usize = TILE + 2 * MOST_APRON + 1;

/// Groups of splats at a pixel, by depth, in the order in which they are composited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend) enum Layer {
    /// Before the nearest disc that covers the pixel, by more than the tolerance.
    Front,
    /// At the nearest disc.
    Band,
    /// At the next disc behind the band.
    Second,
    /// Behind that.
    Rest,
}

impl Layer {
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

/// Depths and sums of one tile.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct EwaBuffers {
    /// T(x, t), +inf where no disc covers, and the tolerance of the disc that it is of: with an apron.
    pub threshold: Vec<f32>,
    pub epsilon: Vec<f32>,
    /// Depths up to which all was peeled off: only what lies behind counts. With an apron; empty where nothing was.
    pub floor: Vec<f32>,
    /// The same minimum over the discs behind T: `ROWS` rows of `STRIDE`.
    pub second: Vec<f32>,
    /// For each row a bit for each pixel that is not solid.
    pub open: Vec<u32>,
    /// For each row a bit for each pixel near which there is one that no disc covers.
    pub rim: Vec<u32>,
    /// Weighted sums of each layer: for each of `ROWS` rows, for each channel and then the extra ones, `STRIDE` floats.
    pub sums: [Vec<f32>; 4],
}

impl EwaBuffers {
    /// Bytes of one tile's buffers.
    pub(in crate::backend) const fn bytes(channels: usize) -> u64 {
        let planes = 4 * (channels + EXTRA) + 1;
        ((planes * ROWS * STRIDE + 3 * APRON_ROWS * APRON_STRIDE + 2 * TILE) * size_of::<f32>()) as u64
    }

    pub(in crate::backend) fn clear_depths(&mut self) {
        for (plane, value) in [(&mut self.threshold, f32::INFINITY), (&mut self.epsilon, 0.0)] {
            plane.clear();
            plane.resize(APRON_ROWS * APRON_STRIDE, value);
        }
        self.second.clear();
        self.second.resize(ROWS * STRIDE, f32::INFINITY);
        for rows in [&mut self.open, &mut self.rim] {
            rows.clear();
            rows.resize(TILE, 0);
        }
    }

    pub(in crate::backend) fn clear_sums(&mut self, channels: usize) {
        let open = self.any_open();
        for (layer, sums) in Layer::ALL.into_iter().zip(&mut self.sums) {
            sums.clear();
            if open || layer == Layer::Band {
                sums.resize(ROWS * (channels + EXTRA) * STRIDE, 0.0);
            }
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
