//! Tiles: the squares of the image that are worked on one at a time, and the buffers of one.

/// Edge of a tile, pixels.
pub(in crate::backend) const TILE: usize = 32;
/// Pixels that inner loops work on at once.
pub(in crate::backend) const LANES: usize = 8;
/// Floats from one row of a tile buffer to the next: loops may start at any pixel and write `LANES` of them.
pub(in crate::backend) const STRIDE: usize = TILE + LANES;
/// Rows of a tile buffer: loops may start at any row and write two.
pub(in crate::backend) const ROWS: usize = TILE + 1;

/// A rectangle of tiles that is rendered together: whole rows of tiles.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Band {
    /// First and one past the last row of tiles.
    pub tile_rows: [usize; 2],
    /// Tiles in a row.
    pub tiles_x: usize,
    /// First and last pixel column, first and last pixel row.
    pub pixels: [i32; 4],
    /// Pixel at which the tiles and their pixels are counted from: 0, but in a guard band.
    pub corner: [i32; 2],
}

impl Band {
    pub(in crate::backend) fn new(size: [u32; 2], tile_rows: [usize; 2]) -> Self {
        let bottom = (tile_rows[1] * TILE).min(size[1] as usize);
        Self {
            tile_rows,
            tiles_x: (size[0] as usize).div_ceil(TILE),
            pixels: [0, size[0] as i32 - 1, (tile_rows[0] * TILE) as i32, bottom as i32 - 1],
            corner: [0; 2],
        }
    }

    /// The band and `guard` pixels around it, in tiles of its own; as much of them as pixels can be numbered.
    pub(in crate::backend) fn guarded(&self, guard: u32) -> Self {
        let [x0, x1, y0, y1] = self.pixels;
        let room =
            |first: i32, last: i32| guard.min((u32::from(u16::MAX) + 1).saturating_sub((last + 1 - first) as u32) / 2);
        let guard = room(x0, x1).min(room(y0, y1)) as i32;
        let pixels = [x0 - guard, x1 + guard, y0 - guard, y1 + guard];
        let tiles = |first: i32, last: i32| ((last + 1 - first) as usize).div_ceil(TILE);
        Self {
            tile_rows: [0, tiles(pixels[2], pixels[3])],
            tiles_x: tiles(pixels[0], pixels[1]),
            pixels,
            corner: [pixels[0], pixels[2]],
        }
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
            width: ((self.pixels[1] + 1 - self.corner[0]) as usize - x0).min(TILE),
            height: ((self.pixels[3] + 1 - self.corner[1]) as usize - y0).min(TILE),
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

/// What one group accumulates in one tile.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct TileBuffers {
    /// T(x, t) of the visibility rule, +inf where no splat covers: `ROWS` rows of `STRIDE`.
    pub threshold: Vec<f32>,
    /// Weighted sums: for each of `ROWS` rows, for each channel, `STRIDE` floats.
    pub sums: Vec<f32>,
    /// Coverage by the samples of a group that has several; empty where there is one.
    pub union: Union,
    /// Coverage by kernels in motion; empty where there are none.
    pub presence: Presence,
}

/// When kernels in motion cover, one bit each 32nd of the interval: `TILE` rows of `STRIDE`.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Presence {
    /// Object-space kernels.
    pub surface: Vec<u32>,
    /// Low-pass discs.
    pub low_pass: Vec<u32>,
    /// Sum of the weights of low-pass discs beyond those of their kernels; or of all weights, where the sum is the coverage.
    pub loose: Vec<f32>,
}

/// Coverage by the samples of a group, one after the other: `ROWS` rows of `STRIDE`.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Union {
    /// Sample whose splats are being added; `None` while it is those of all samples.
    pub sample: Option<usize>,
    /// Of that sample: at least 1 where a splat covers, else the weights of the low-pass discs.
    pub reach: Vec<f32>,
    /// What all samples have of `reach`.
    pub still: Vec<f32>,
    /// Of the samples before: sum of weight times coverage.
    pub coverage: Vec<f32>,
}

impl Union {
    /// Ends all samples before `next`; `weights` are those of all samples.
    pub(in crate::backend) fn turn(&mut self, weights: impl Fn(usize) -> f32, next: usize) {
        let first = self.sample.unwrap_or_else(|| {
            self.still.copy_from_slice(&self.reach);
            0
        });
        for sample in first..next {
            let weight = weights(sample);
            for ((coverage, reach), still) in self.coverage.iter_mut().zip(&mut self.reach).zip(&self.still) {
                *coverage += weight * if *reach < 1.0 { *reach } else { 1.0 };
                *reach = *still;
            }
        }
        self.sample = Some(next);
    }
}

impl TileBuffers {
    pub(in crate::backend) fn clear_threshold(&mut self) {
        self.threshold.clear();
        self.threshold.resize(ROWS * STRIDE, f32::INFINITY);
    }

    /// For a group of `samples` samples.
    pub(in crate::backend) fn clear_sums(&mut self, channels: usize, samples: usize) {
        self.sums.clear();
        self.sums.resize(ROWS * channels * STRIDE, 0.0);
        let union = if samples > 1 { ROWS * STRIDE } else { 0 };
        self.union.sample = None;
        for plane in [&mut self.union.reach, &mut self.union.still, &mut self.union.coverage] {
            plane.clear();
            plane.resize(union, 0.0);
        }
    }

    /// For kernels in motion.
    pub(in crate::backend) fn clear_presence(&mut self) {
        for plane in [&mut self.presence.surface, &mut self.presence.low_pass] {
            plane.clear();
            plane.resize(TILE * STRIDE, 0);
        }
        self.presence.loose.clear();
        self.presence.loose.resize(TILE * STRIDE, 0.0);
    }

    /// Bytes of one tile's buffers, for groups of `samples` samples, with kernels in motion or without.
    pub(in crate::backend) const fn bytes(channels: usize, samples: usize, swept: bool) -> u64 {
        let union = if samples > 1 { 3 } else { 0 };
        let presence = if swept { 4 } else { 0 };
        ((1 + channels + union + presence) * ROWS * STRIDE * size_of::<f32>()) as u64
    }
}
