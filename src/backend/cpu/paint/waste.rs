//! What bounds of kernels waste, filtered or not.

use super::kernel::{Kernel, RasterRays};
use crate::backend::Waste;
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::tiles::TileRect;
use crate::backend::cpu::waste::{self, Wasteful, count, whole};
use crate::layout::{EwaSplat, Splat};
use crate::math::simd::dispatch;

impl Wasteful for Splat {
    fn waste(binned: &Binned<Self>, sight: &waste::WasteView<'_>) -> Waste {
        of_splats(&binned.splats, &whole(&sight.band), &sight.rays())
    }
}

impl Wasteful for EwaSplat {
    fn waste(binned: &Binned<Self>, sight: &waste::WasteView<'_>) -> Waste {
        let mut band = sight.band;
        band.pixels = band.pixels.widened(sight.raster.apron() as i32, sight.raster.size);
        of_splats(&binned.splats, &whole(&band), &sight.rays())
    }
}

dispatch! {
    /// The counts of `splats` within `rect`.
    pub(in crate::backend) fn of_splats<K: Kernel>(splats: &[K], rect: &TileRect, sight: &RasterRays) -> Waste =
        of_splats_body
}

#[inline(always)]
fn of_splats_body<K: Kernel>(splats: &[K], rect: &TileRect, sight: &RasterRays) -> Waste {
    let mut waste = Waste::default();
    for splat in splats {
        waste.visibility +=
            count(splat.disc().bounds, rect, |patch, l| sight.covers(&patch.met::<true>(splat.disc(), l)));
        let bounds = splat.weight_bounds();
        waste.attribute += if splat.is_crossing() {
            count(bounds, rect, |patch, l| splat.see::<_, true>(patch, l, sight).weight > 0.0)
        } else {
            count(bounds, rect, |patch, l| splat.see::<_, false>(patch, l, sight).weight > 0.0)
        };
    }
    waste
}
