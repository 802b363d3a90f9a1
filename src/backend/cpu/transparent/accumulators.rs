//! What the pixels of a tile accumulate while splats are composited, front to back.
//!
//! Beside the colour and the transmittance of what is in front, a pixel has an open layer of a volume: kernels that
//! overlap in depth, whose optical depths add up before they count as one (Zwicker et al. 2002, section 7.1: sheets).
//! Layers of see-through surfels wait until what is composited has come to their depth.

use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::tiles::{LANES, STRIDE, TILE, TileRect, lanes};
use crate::film::FilmPlanes;
use crate::math::{fast, srgb};

/// A pixel whose transmittance is below this takes no more.
pub(in crate::backend) const OPAQUE: f32 = 1e-4;

/// Runs of `LANES` pixels in a row of a tile.
pub(super) const RUNS: usize = TILE / LANES;

/// What the pixels of a tile accumulate: for each of `TILE` rows, for each channel, `STRIDE` floats.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Composite {
    pub(super) values: Vec<f32>,
    /// The open layers of volumes: optical depth in powers of 1/2, and the other channels times that. Empty where a
    /// frame has no volumes.
    pub(super) open: Vec<f32>,
    /// Which layer is open in each run of `LANES` pixels: `TILE` rows of `RUNS`.
    pub(super) opened: Vec<u32>,
    pub(super) channels: usize,
    /// Depth of the next layer of see-through surfels, +inf where none is left; empty where no surfel is in the tile.
    pub(super) next_depth: Vec<f32>,
    /// Number of that layer.
    next: Vec<u8>,
    /// T(x) of opaque surfels, +inf where there are none; empty where no surfel is in the tile.
    pub(super) limit: Vec<f32>,
    /// A bit for each block of `BLOCK` pixels, row by row, in which no pixel can take more.
    pub(super) closed: u32,
    normal: Option<usize>,
}

/// Columns and rows of pixels that are closed together. A tile has 4 x 8 of them, as many as a mask has bits.
const BLOCK: [usize; 2] = [8, 4];
const BLOCKS_X: usize = TILE / BLOCK[0];
const _: () = assert!(BLOCKS_X == 4 && TILE / BLOCK[1] == 8);

/// Channels: transmittance, red, green, blue, and where they are wanted the depth, then the velocity, then the normal.
pub(super) const COLOUR: usize = 1;
pub(super) const DEPTH: usize = 4;
const VELOCITY: usize = DEPTH + 1;

/// All that is composited into a tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileContent<'a> {
    pub depth: bool,
    pub velocity: bool,
    pub volumes: bool,
    pub surfels: SurfelLayers<'a>,
}

/// The surfels of a tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfelLayers<'a> {
    /// The layers of see-through surfels, front to back, each as a film: premultiplied, linear.
    pub layers: &'a [TileFilm],
    /// T(x) of opaque surfels; empty where there are none.
    pub threshold: &'a [f32],
    pub planes: &'a FilmPlanes,
    /// Is the image composited in coded values?
    pub coded: bool,
}

impl SurfelLayers<'_> {
    fn any(&self) -> bool {
        !self.layers.is_empty() || !self.threshold.is_empty()
    }
}

impl Composite {
    /// Floats of one pixel of a tile, at most: both sets of channels, three of surfels, the number of the open layer.
    const MOST_FLOATS: usize = 10 + 10 + 3 + 1;

    /// Bytes of one tile at most.
    pub(super) const BYTES: u64 = (TILE * STRIDE * Self::MOST_FLOATS * size_of::<f32>()) as u64;

    /// Empties it for `content`.
    pub(super) fn start(&mut self, content: &TileContent<'_>, tile: &TileRect) {
        let own = match (content.depth, content.velocity) {
            (_, true) => VELOCITY + 2,
            (true, false) => VELOCITY,
            (false, false) => DEPTH,
        };
        let surfels = &content.surfels;
        self.normal = surfels.planes.normal.filter(|_| !surfels.layers.is_empty()).map(|_| own);
        self.channels = own + if self.normal.is_some() { 3 } else { 0 };
        self.closed = 0;
        let floats = TILE * STRIDE * self.channels;
        fill(&mut self.values, floats, 0.0);
        for row in self.values.chunks_exact_mut(STRIDE * self.channels) {
            row[..STRIDE].fill(1.0);
        }
        fill(&mut self.open, if content.volumes { floats } else { 0 }, 0.0);
        self.opened.clear();
        self.opened.resize(if content.volumes { TILE * RUNS } else { 0 }, 0);
        let floats = if surfels.any() { TILE * STRIDE } else { 0 };
        fill(&mut self.limit, floats, f32::INFINITY);
        for (limit, threshold) in self.limit.iter_mut().zip(surfels.threshold) {
            *limit = *threshold;
        }
        fill(&mut self.next_depth, floats, f32::INFINITY);
        self.next.clear();
        self.next.resize(floats, 0);
        if !surfels.layers.is_empty() {
            for y in 0..tile.height {
                (0..tile.width).for_each(|x| self.find_next(surfels, [x, y], 0));
            }
        }
    }

    /// Can pixels within `bounds` take more? `bounds` are those of a splat that touches the tile.
    #[inline(always)]
    pub(super) fn is_open(&self, bounds: [u16; 4], tile: &TileRect) -> bool {
        blocks(within(bounds, tile)) & !self.closed != 0
    }

    /// `LANES` pixels of a channel, from pixel `[x, y]` of the tile on.
    #[inline(always)]
    pub(super) fn lanes(&self, channel: usize, [x, y]: [usize; 2]) -> [f32; LANES] {
        lanes(&self.values[(y * self.channels + channel) * STRIDE + x..])
    }

    /// First of three channels.
    pub(super) const fn colour() -> usize {
        COLOUR
    }

    /// The channel of depth, if it has one.
    pub(super) fn depth(&self) -> Option<usize> {
        (self.own_channels() > DEPTH).then_some(DEPTH)
    }

    /// First of two channels, if it has them.
    pub(super) fn velocity(&self) -> Option<usize> {
        (self.own_channels() > VELOCITY).then_some(VELOCITY)
    }

    /// First of three channels, if it has them.
    pub(super) fn normal(&self) -> Option<usize> {
        self.normal
    }

    /// Number of channels that splats have.
    pub(super) fn own_channels(&self) -> usize {
        self.normal.unwrap_or(self.channels)
    }

    /// Finds the blocks that take nothing from depth `furthest` on.
    #[inline(always)]
    pub(super) fn close(&mut self, tile: &TileRect, furthest: f32) {
        for block in 0..u32::BITS as usize {
            if self.closed >> block & 1 == 1 {
                continue;
            }
            let [x, y] = [block % BLOCKS_X * BLOCK[0], block / BLOCKS_X * BLOCK[1]];
            let mut open = false;
            for y in y..(y + BLOCK[1]).min(tile.height) {
                let through = &self.values[y * self.channels * STRIDE + x..][..BLOCK[0]];
                let mut least = [f32::INFINITY; BLOCK[0]];
                if let Some(limits) = self.limit.get(y * STRIDE + x..y * STRIDE + x + BLOCK[0]) {
                    least.copy_from_slice(limits);
                }
                for l in 0..BLOCK[0] {
                    open |= (through[l] >= OPAQUE) & (least[l] >= furthest) & (x + l < tile.width);
                }
            }
            self.closed |= u32::from(!open) << block;
        }
    }

    /// Composites the open layers of those of `LANES` pixels, from pixel `[x, y]` on, that are `wanted`.
    #[inline(always)]
    pub(super) fn close_layers(&mut self, [x, y]: [usize; 2], wanted: [bool; LANES]) {
        let first = y * self.channels * STRIDE + x;
        let open = &mut self.open[first..];
        let values = &mut self.values[first..];
        // Copies, as the compiler cannot know that the planes lie apart.
        let (mut depths, mut throughs) = (lanes(open), lanes(values));
        let mut factor = [0.0; LANES];
        for l in 0..LANES {
            let depth = if wanted[l] & (throughs[l] >= OPAQUE) { depths[l] } else { 0.0 };
            let through = fast::exp2(-depth);
            let share = if depth > 0.0 { (1.0 - through) / depth } else { 0.0 };
            factor[l] = throughs[l] * share;
            throughs[l] *= through;
            depths[l] = if wanted[l] { 0.0 } else { depths[l] };
        }
        open[..LANES].copy_from_slice(&depths);
        values[..LANES].copy_from_slice(&throughs);
        for channel in COLOUR..self.normal.unwrap_or(self.channels) {
            let open = &mut open[channel * STRIDE..][..LANES];
            let values = &mut values[channel * STRIDE..][..LANES];
            let (mut of_layer, mut of_pixel) = (lanes(open), lanes(values));
            for l in 0..LANES {
                of_pixel[l] += factor[l] * of_layer[l];
                of_layer[l] = if wanted[l] { 0.0 } else { of_layer[l] };
            }
            open.copy_from_slice(&of_layer);
            values.copy_from_slice(&of_pixel);
        }
    }

    /// Does no pixel of the block of pixel `[x, y]` take more?
    #[inline(always)]
    pub(super) fn is_closed(&self, [x, y]: [usize; 2]) -> bool {
        self.closed >> (y / BLOCK[1] * BLOCKS_X + x / BLOCK[0]) & 1 == 1
    }

    /// Composites the layers of surfels of pixel `[x, y]` that are nearer than `depth`.
    #[cold]
    pub(super) fn pass_surfels(&mut self, surfels: &SurfelLayers<'_>, [x, y]: [usize; 2], depth: f32) {
        while self.next_depth[y * STRIDE + x] < depth {
            if !self.open.is_empty() {
                let mut wanted = [false; LANES];
                wanted[0] = true;
                self.close_layers([x, y], wanted);
            }
            let number = self.next[y * STRIDE + x];
            self.add_surfels(surfels, &surfels.layers[usize::from(number)], [x, y]);
            self.find_next(surfels, [x, y], number + 1);
        }
    }

    /// Finds the next layer of surfels at a pixel, from number `from` on.
    fn find_next(&mut self, surfels: &SurfelLayers<'_>, [x, y]: [usize; 2], from: u8) {
        let at = y * STRIDE + x;
        let shows = |film: &TileFilm| film.values.get((3 * TILE + y) * TILE + x).is_some_and(|&alpha| alpha > 0.0);
        let next = (usize::from(from)..surfels.layers.len()).find(|&number| shows(&surfels.layers[number]));
        // What only filters reach has no depth of its own; it lies behind all that has.
        let depth = next.map_or(f32::INFINITY, |number| surfels.layers[number].threshold[at].min(f32::MAX));
        (self.next[at], self.next_depth[at]) = (next.unwrap_or(surfels.layers.len()) as u8, depth);
    }

    fn add_surfels(&mut self, surfels: &SurfelLayers<'_>, film: &TileFilm, [x, y]: [usize; 2]) {
        let of_film = |plane: usize| film.values[(plane * TILE + y) * TILE + x];
        let first = y * self.channels * STRIDE + x;
        let (depth, velocity, normal) = (self.depth(), self.velocity(), self.normal);
        let through = self.values[first];
        let alpha = of_film(3);
        for c in 0..3 {
            let linear = of_film(c);
            let shown = if surfels.coded { alpha * srgb::from_linear_nearly(linear / alpha) } else { linear };
            self.values[first + (COLOUR + c) * STRIDE] += through * shown;
        }
        let planes = surfels.planes;
        let of_planes = [(depth, planes.depth, 1), (velocity, planes.velocity, 2), (normal, planes.normal, 3)];
        for (channel, plane, count) in of_planes {
            if let (Some(channel), Some(plane)) = (channel, plane) {
                for c in 0..count {
                    self.values[first + (channel + c) * STRIDE] += through * of_film(plane + c);
                }
            }
        }
        self.values[first] = through * (1.0 - alpha);
    }

    /// Composites all that is still open or still to come.
    pub(super) fn finish(&mut self, surfels: &SurfelLayers<'_>, tile: &TileRect) {
        for y in 0..tile.height {
            if !surfels.layers.is_empty() {
                (0..tile.width).for_each(|x| self.pass_surfels(surfels, [x, y], f32::INFINITY));
            }
            if !self.open.is_empty() {
                (0..tile.width).step_by(LANES).for_each(|x| self.close_layers([x, y], [true; LANES]));
            }
        }
    }
}

fn fill(values: &mut Vec<f32>, floats: usize, value: f32) {
    values.clear();
    values.resize(floats, value);
}

/// Columns and rows of `bounds` within a tile, counted from its corner.
#[inline(always)]
pub(super) fn within(bounds: [u16; 4], tile: &TileRect) -> [usize; 4] {
    let [left, top] = tile.origin;
    let [x0, x1, y0, y1] = bounds.map(usize::from);
    let (right, bottom) = (left + tile.width - 1, top + tile.height - 1);
    [x0.max(left) - left, x1.min(right) - left, y0.max(top) - top, y1.min(bottom) - top]
}

/// The blocks of the pixels between columns `x0` and `x1` and rows `y0` and `y1`.
#[inline(always)]
pub(super) const fn blocks([x0, x1, y0, y1]: [usize; 4]) -> u32 {
    let columns = (2 << (x1 / BLOCK[0])) - (1 << (x0 / BLOCK[0]));
    let below = u32::MAX << (y0 / BLOCK[1] * BLOCKS_X);
    let above = u32::MAX >> ((TILE / BLOCK[1] - 1 - y1 / BLOCK[1]) * BLOCKS_X);
    (columns * 0x1111_1111) & below & above
}
