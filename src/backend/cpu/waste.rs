//! Counts the pixels within the bounds of splats, and those that splats cover: what passes look at in vain. It is done
//! where someone asks for it: it looks at all those pixels once more.
//!
//! A pixel is covered where a pass would find the splat on it, whatever hides it. Both counts are sums over splats.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use super::bin::Binned;
use super::paint;
use super::patch::{Patch, Touched};
use super::tiles::{Band, LANES, TileRect};
use crate::backend::{Pixels, Waste};
use crate::frame::Raster;
use crate::options::SweptKernel;

/// The counts of a frame, from all threads.
#[derive(Debug, Default)]
pub(in crate::backend) struct Wasted {
    visibility: Count,
    attribute: Count,
    composite: Count,
}

#[derive(Debug, Default)]
struct Count {
    bounded: AtomicU64,
    covered: AtomicU64,
}

impl Count {
    fn add(&self, pixels: Pixels) {
        self.bounded.fetch_add(pixels.bounded, Relaxed);
        self.covered.fetch_add(pixels.covered, Relaxed);
    }

    fn total(&self) -> Pixels {
        Pixels { bounded: self.bounded.load(Relaxed), covered: self.covered.load(Relaxed) }
    }
}

impl Wasted {
    pub(in crate::backend) fn add(&self, waste: Waste) {
        self.visibility.add(waste.visibility);
        self.attribute.add(waste.attribute);
        self.composite.add(waste.composite);
    }

    pub(in crate::backend) fn total(&self) -> Waste {
        let Self { visibility, attribute, composite } = self;
        Waste { visibility: visibility.total(), attribute: attribute.total(), composite: composite.total() }
    }
}

/// How splats are seen.
#[derive(Clone, Copy)]
pub(in crate::backend) struct WasteView<'a> {
    pub band: Band,
    pub raster: &'a Raster,
    pub near: f32,
    /// Kernels in motion.
    pub swept: Option<SweptKernel>,
    /// Radius of the low-pass discs of published kernels in motion, raster pixels; +0 without them.
    pub low_pass: f32,
}

impl WasteView<'_> {
    /// What kernels at instants are seen with.
    pub(in crate::backend) fn rays(&self) -> paint::RasterRays {
        paint::RasterRays::new(self.near, self.raster)
    }
}

/// Splats whose waste can be counted.
pub(in crate::backend) trait Wasteful: Sized {
    /// The counts of the splats of a chunk.
    fn waste(binned: &Binned<Self>, sight: &WasteView<'_>) -> Waste;
}

/// All pixels of a band as one tile, for patches that know no tiles.
pub(in crate::backend) fn whole(band: &Band) -> TileRect {
    let [left, top] = band.corner;
    let (width, height) = (band.pixels.last_column + 1 - left, band.pixels.last_row + 1 - top);
    TileRect { tile: [0; 2], origin: [0; 2], corner: band.corner, width: width as usize, height: height as usize }
}

/// Pixels within `bounds`, and of them those that `covers` counts in runs of `LANES` columns, from a patch on.
#[inline(always)]
pub(in crate::backend) fn count(
    bounds: [u16; 4],
    rect: &TileRect,
    covers: impl Fn(&Patch<LANES>, usize) -> bool,
) -> Pixels {
    let Some(touched) = Touched::within(bounds, rect) else { return Pixels::default() };
    let mut covered = [0_u32; LANES];
    for y in touched.y0..=touched.y1 {
        let mut x = touched.x0;
        while x <= touched.x1 {
            let patch = Patch::new(&touched, rect, x, y);
            for l in 0..LANES {
                covered[l] += u32::from(covers(&patch, l));
            }
            x += LANES;
        }
    }
    let bounded = (touched.x1 + 1 - touched.x0) * (touched.y1 + 1 - touched.y0);
    Pixels { bounded: bounded as u64, covered: covered.iter().map(|&lane| u64::from(lane)).sum() }
}
