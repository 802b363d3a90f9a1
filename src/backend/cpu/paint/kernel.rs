//! The kernels of opaque surfels on the screen, as the passes of step `Paint` see them.
//!
//! A filter is a constant of compilation: where it is zero, the passes look at discs alone.

use std::ops::Range;

use super::buffers::PaintBuffers;
use super::project::{Filtered, project};
use super::resolve;
use super::share::Shares;
use crate::backend::cpu::bin::Tiled;
use crate::backend::cpu::patch::{Hit, Patch};
use crate::backend::cpu::project::{self, SurfelView};
use crate::backend::cpu::resolve::{Resolve, TileFilm};
use crate::backend::cpu::tiles::TileRect;
use crate::backend::cpu::values::Faced;
use crate::backend::cpu::waste::Wasteful;
use crate::frame::{PixelRect, Raster};
use crate::layout::{EwaSplat, Splat};
use crate::math::fast;
use crate::model::Surfels;

/// A splat whose kernel weighs attributes.
pub(in crate::backend) trait Kernel: Tiled + Faced + Wasteful + Copy + Send + Sync {
    /// Does a filter widen it? Then it weighs where its disc does not cover: pixels have layers, and tiles an apron.
    const FILTERED: bool;

    /// Appends the splats of `surfels[range]` that may touch `view.pixels` or the apron around them, in surfel order.
    fn project(view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<Self>);

    /// The disc, which alone covers and hides.
    fn disc(&self) -> &Splat;

    /// The pixels in which the kernel may have weight, as `PixelRect::bounds` has them.
    fn weight_bounds(&self) -> [u16; 4];

    /// Is it a sphere, or a filtered kernel that reaches the camera plane? These are not filtered.
    #[inline(always)]
    fn is_crossing(&self) -> bool {
        false
    }

    /// Weight at the centre before normalisation, in (0, 1].
    #[inline(always)]
    fn peak(&self) -> f32 {
        1.0
    }

    /// Lane `l` of a patch. `CROSSING`: as [`Self::is_crossing`] says.
    fn see<const W: usize, const CROSSING: bool>(&self, patch: &Patch<W>, l: usize, sight: &RasterRays) -> Seen;

    /// Pass `resolve` of one tile, as [`resolve::resolve`].
    fn resolve(
        with: &Resolve<'_>,
        tile: &TileRect,
        start: usize,
        buffers: &PaintBuffers,
        coverage: &[f32],
        film: &mut TileFilm,
    ) {
        resolve::resolve(with, tile, start, buffers, coverage, film);
    }
}

/// The numbers that all rays of a raster share.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct RasterRays {
    /// 1 / near.
    pub most_inverse_depth: f32,
    /// A quarter of the variance of the filter, raster pixels^2.
    pub quarter_variance: f32,
    /// 1 / the squared radius of the low-pass disc of the approximate filter, raster pixels^-2.
    pub low_pass_scale: f32,
}

impl RasterRays {
    pub(in crate::backend) fn new(near: f32, raster: &Raster) -> Self {
        Self {
            most_inverse_depth: 1.0 / near,
            quarter_variance: 0.25 * raster.sigma * raster.sigma,
            low_pass_scale: 1.0 / (raster.low_pass * raster.low_pass),
        }
    }

    /// Is the disc met before the camera, on a pixel that it may touch?
    #[inline(always)]
    pub(in crate::backend) fn covers(&self, hit: &Hit) -> bool {
        hit.inside & (hit.inverse_depth <= self.most_inverse_depth) & hit.wanted
    }
}

/// A kernel on the ray through one sample position.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Seen {
    pub weight: f32,
    /// Depth of its plane; of its centre where the ray misses the plane.
    pub depth: f32,
    /// 1 where the disc covers the position, else 0.
    pub disc: f32,
}

/// The kernel in perspective, without a filter: its disc.
impl Kernel for Splat {
    const FILTERED: bool = false;

    fn project(view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<Self>) {
        project::project(view, surfels, range, out);
    }

    #[inline(always)]
    fn disc(&self) -> &Splat {
        self
    }

    #[inline(always)]
    fn weight_bounds(&self) -> [u16; 4] {
        self.bounds
    }

    #[inline(always)]
    fn is_crossing(&self) -> bool {
        self.is_sphere()
    }

    #[inline(always)]
    fn see<const W: usize, const CROSSING: bool>(&self, patch: &Patch<W>, l: usize, sight: &RasterRays) -> Seen {
        let hit = patch.met::<CROSSING>(self, l);
        let depth = 1.0 / hit.inverse_depth;
        let covers = sight.covers(&hit);
        let r2 = hit.scaled_r2 * (depth * depth);
        let r2 = if r2 < 1.0 { r2 } else { 1.0 };
        Seen {
            weight: if covers { fast::kernel(r2) } else { 0.0 },
            depth: if covers { depth } else { 0.0 },
            disc: if covers { 1.0 } else { 0.0 },
        }
    }
}

/// The kernel under full EWA.
impl Kernel for EwaSplat {
    const FILTERED: bool = true;

    fn project(view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<Self>) {
        let (pixels, apron) = (view.pixels, view.raster.apron());
        let guarded: PixelRect = pixels.widened(apron as i32, view.raster.size);
        let view = SurfelView { margin: apron as f32, pixels: guarded, ..*view };
        let shares = Shares::of(surfels);
        project(&view, surfels, range, &mut Filtered { sigma: view.raster.sigma, pixels, guarded, shares, out });
    }

    #[inline(always)]
    fn disc(&self) -> &Splat {
        &self.disc
    }

    #[inline(always)]
    fn weight_bounds(&self) -> [u16; 4] {
        self.filtered_bounds
    }

    #[inline(always)]
    fn is_crossing(&self) -> bool {
        self.crossing != 0
    }

    #[inline(always)]
    fn peak(&self) -> f32 {
        self.peak
    }

    #[inline(always)]
    fn see<const W: usize, const CROSSING: bool>(&self, patch: &Patch<W>, l: usize, sight: &RasterRays) -> Seen {
        let hit = patch.met::<CROSSING>(&self.disc, l);
        let in_view = (hit.inverse_depth > 0.0) & (hit.inverse_depth <= sight.most_inverse_depth);
        let plane_depth = 1.0 / hit.inverse_depth;
        let form = |c: [f32; 2]| c[0] * hit.x + c[1] * hit.y;
        let (u, v) = (form(self.u), form(self.v));
        let (px, py) = (form([self.p[0], self.p[1]]), form([self.p[1], self.p[2]]));
        let nearer = 1.0 - form(self.shrink);
        let over = 1.0 / nearer;
        let filtered = (u * u + v * v) * (over * over) + sight.quarter_variance * (px * px + py * py);
        let r2 = if CROSSING { hit.scaled_r2 * (plane_depth * plane_depth) } else { filtered };
        let shown = if CROSSING { hit.inside & in_view } else { nearer > 0.0 };
        let hits = shown & (r2 <= 1.0) & hit.wanted;
        let r2 = if r2 < 1.0 { r2 } else { 1.0 };
        let weight = self.weight * fast::kernel(r2);
        Seen {
            weight: if hits { weight } else { 0.0 },
            depth: if in_view { plane_depth } else { self.disc.centre_depth },
            disc: if hit.inside & in_view & hit.wanted { 1.0 } else { 0.0 },
        }
    }
}
