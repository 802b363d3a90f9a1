//! Patches: the pixels that inner loops work on at once. A patch has eight in a row, or, for narrow splats, four in
//! each of two rows.

use super::tiles::{LANES, TileRect};
use crate::layout::Splat;
use crate::math::sphere;

/// Splats of no more columns are worked on in patches of two rows.
pub(in crate::backend) const NARROW: usize = LANES / 2;

/// Pixels of a tile that a splat may touch: first and last column and row, counted from the tile's corner.
pub(in crate::backend) struct Touched {
    pub x0: usize,
    pub x1: usize,
    pub y0: usize,
    pub y1: usize,
}

impl Touched {
    /// The pixels within `bounds`; `None` where those miss the tile.
    #[inline(always)]
    pub(in crate::backend) fn within(bounds: [u16; 4], tile: &TileRect) -> Option<Self> {
        let [x0, x1, y0, y1] = bounds.map(usize::from);
        let last = [tile.origin[0] + tile.width, tile.origin[1] + tile.height];
        let (x1, y1) = (x1.min(last[0] - 1), y1.min(last[1] - 1));
        let (x0, y0) = (x0.max(tile.origin[0]), y0.max(tile.origin[1]));
        let [x, y] = tile.origin;
        (x0 <= x1 && y0 <= y1).then(|| Self { x0: x0 - x, x1: x1 - x, y0: y0 - y, y1: y1 - y })
    }

    /// At most `NARROW` columns?
    #[inline(always)]
    pub(in crate::backend) fn is_narrow(&self) -> bool {
        self.x1 - self.x0 < NARROW
    }

    /// More than one row?
    #[inline(always)]
    pub(in crate::backend) fn is_high(&self) -> bool {
        self.y0 < self.y1
    }
}

/// `W` columns of as many rows as there are lanes for.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Patch<const W: usize> {
    /// First pixel column and row of the raster.
    first: [f32; 2],
    /// Last pixel column and row that the splat may touch.
    last: [f32; 2],
}

/// A splat's plane on the ray through one sample position.
pub(in crate::backend) struct Hit {
    /// Distance from the splat's reference, pixels.
    pub x: f32,
    pub y: f32,
    /// Coordinates on its plane times the inverse depth of the plane.
    pub uv: [f32; 2],
    pub inverse_depth: f32,
    /// (u^2 + v^2) times the squared inverse depth.
    pub scaled_r2: f32,
    /// In front of the camera and within the cut-off radius.
    pub inside: bool,
    /// A pixel that the splat may touch.
    pub wanted: bool,
}

impl<const W: usize> Patch<W> {
    /// The patch that starts in column `x` and row `y` of the tile.
    #[inline(always)]
    pub(in crate::backend) fn new(touched: &Touched, tile: &TileRect, x: usize, y: usize) -> Self {
        let pixel = |x: usize, y: usize| [(tile.corner[0] + x as i32) as f32, (tile.corner[1] + y as i32) as f32];
        Self { first: pixel(x, y), last: pixel(touched.x1, touched.y1) }
    }

    /// Lane `l` of the patch, of a disc.
    #[inline(always)]
    pub(in crate::backend) fn at(&self, splat: &Splat, l: usize) -> Hit {
        self.met::<false>(splat, l)
    }

    /// Lane `l` of the patch. `SPHERE`: the splat may be a sphere.
    #[inline(always)]
    pub(in crate::backend) fn met<const SPHERE: bool>(&self, splat: &Splat, l: usize) -> Hit {
        let (column, row) = (self.first[0] + (l % W) as f32, self.first[1] + (l / W) as f32);
        let x = column + 0.5 - splat.reference[0];
        let y = row + 0.5 - splat.reference[1];
        let form = |c: [f32; 3]| c[0] * x + (c[1] * y + c[2]);
        let (inverse_depth, u, v) = (form(splat.inverse_depth), form(splat.u), form(splat.v));
        let scaled_r2 = u * u + v * v;
        let inside = (inverse_depth > 0.0) & (scaled_r2 <= inverse_depth * inverse_depth);
        let (mut inverse_depth, mut scaled_r2) = (inverse_depth, scaled_r2);
        if SPHERE {
            let depth = 1.0 / inverse_depth;
            let bulge = sphere::bulge(splat.sine(), scaled_r2 * (depth * depth));
            inverse_depth *= bulge;
            // The place on the plane stays: it is r2 times the squared depth.
            scaled_r2 *= bulge * bulge;
        }
        let wanted = (column <= self.last[0]) & (row <= self.last[1]);
        Hit { x, y, uv: [u, v], inverse_depth, scaled_r2, inside, wanted }
    }
}

/// The patch that starts where `plane` does, of rows `stride` apart.
#[inline(always)]
pub(in crate::backend) fn load<const W: usize>(plane: &[f32], stride: usize) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    if W == NARROW {
        // Halves that are written to memory one by one are slow to read back as a whole.
        let (a, b) = (&plane[..NARROW], &plane[stride..][..NARROW]);
        return [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]];
    }
    for row in 0..LANES / W {
        out[row * W..][..W].copy_from_slice(&plane[row * stride..][..W]);
    }
    out
}

/// What `load` read, put back.
#[inline(always)]
pub(in crate::backend) fn store<const W: usize>(plane: &mut [f32], stride: usize, patch: &[f32; LANES]) {
    for row in 0..LANES / W {
        plane[row * stride..][..W].copy_from_slice(&patch[row * W..][..W]);
    }
}
