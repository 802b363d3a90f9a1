//! The approximate EWA filter: a pixel counts as near a splat as the nearer of its kernel and a disc on the screen
//! (Botsch et al. 2005; Wolf 2008, 4.2.3; docs/math.md, eq. 10).

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::resolve::resolve;
use crate::backend::Waste;
use crate::backend::cpu::bin::{Binned, Tiled};
use crate::backend::cpu::paint::{self, Kernel, PaintBuffers, RasterRays, Seen};
use crate::backend::cpu::patch::Patch;
use crate::backend::cpu::project::{self, Projected, Sink, SurfelView};
use crate::backend::cpu::resolve::{Resolve, TileFilm};
use crate::backend::cpu::tiles::TileRect;
use crate::backend::cpu::values::Faced;
use crate::backend::cpu::waste::{self, Wasteful};
use crate::layout::Splat;
use crate::math::fast;
use crate::math::simd::dispatch;
use crate::model::Surfels;

/// A splat with its low-pass disc. Its bounds hold both.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::backend) struct LowPassSplat(pub Splat);

impl Tiled for LowPassSplat {
    fn bounds(&self) -> [u16; 4] {
        self.0.bounds
    }
}

impl Faced for LowPassSplat {
    fn face(&self) -> (u32, u32) {
        self.0.face()
    }

    fn place(&self) -> Option<[f32; 2]> {
        self.0.place()
    }
}

impl Sink for Vec<LowPassSplat> {
    type Lanes = ();

    #[inline(always)]
    fn lane(&self, _projected: &Projected, _l: usize, _out: &mut ()) {}

    #[inline(always)]
    fn push(&mut self, splat: Splat, _lanes: &(), _l: usize) {
        self.push(LowPassSplat(splat));
    }

    fn push_crossing(&mut self, splat: Splat) {
        self.push(LowPassSplat(splat));
    }
}

dispatch! {
    fn project(
        view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<LowPassSplat>,
    ) = project::project_body
}

impl Kernel for LowPassSplat {
    /// The disc on the screen weighs where the kernel does not cover, but makes no layers.
    const FILTERED: bool = false;

    fn project(view: &SurfelView<'_>, surfels: &Surfels, range: Range<usize>, out: &mut Vec<Self>) {
        project(&SurfelView { centre_disc: view.raster.low_pass, ..*view }, surfels, range, out);
    }

    #[inline(always)]
    fn disc(&self) -> &Splat {
        &self.0
    }

    #[inline(always)]
    fn weight_bounds(&self) -> [u16; 4] {
        self.0.bounds
    }

    #[inline(always)]
    fn is_crossing(&self) -> bool {
        self.0.is_sphere()
    }

    #[inline(always)]
    fn see<const W: usize, const CROSSING: bool>(&self, patch: &Patch<W>, l: usize, sight: &RasterRays) -> Seen {
        let centre_depth = self.0.centre_depth;
        let hit = patch.met::<true>(&self.0, l);
        let plane_depth = 1.0 / hit.inverse_depth;
        let covers = sight.covers(&hit);
        let r3d = if covers { hit.scaled_r2 * (plane_depth * plane_depth) } else { f32::INFINITY };
        let r2d = (hit.x * hit.x + hit.y * hit.y) * sight.low_pass_scale;
        let r2d = if centre_depth > 0.0 { r2d } else { f32::INFINITY };
        let r2 = if r2d < r3d { r2d } else { r3d };
        let hits = (covers | (r2 <= 1.0)) & hit.wanted;
        let r2 = if r2 < 1.0 { r2 } else { 1.0 };
        Seen {
            weight: if hits { fast::kernel(r2) } else { 0.0 },
            depth: if covers { plane_depth } else { centre_depth },
            disc: if covers { 1.0 } else { 0.0 },
        }
    }

    fn resolve(
        with: &Resolve<'_>,
        tile: &TileRect,
        _start: usize,
        buffers: &PaintBuffers,
        coverage: &[f32],
        film: &mut TileFilm,
    ) {
        resolve(with, tile, buffers, coverage, film);
    }
}

impl Wasteful for LowPassSplat {
    fn waste(binned: &Binned<Self>, sight: &waste::WasteView<'_>) -> Waste {
        paint::waste_of(&binned.splats, &waste::whole(&sight.band), &sight.rays())
    }
}
