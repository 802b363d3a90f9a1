//! What bounds of filtered splats waste.

use crate::backend::Waste;
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::tiles::TileRect;
use crate::backend::cpu::waste::{Sight, Wasteful, count, whole};
use crate::layout::EwaSplat;
use crate::math::simd::dispatch;

impl Wasteful for EwaSplat {
    fn waste(binned: &Binned<Self>, sight: &Sight<'_>) -> Waste {
        let apron = sight.raster.apron() as i32;
        let mut band = sight.band;
        band.pixels = band.pixels.widened(apron, sight.raster.size);
        of_splats(&binned.splats, &whole(&band), sight.near, sight.raster.sigma)
    }
}

dispatch! {
    fn of_splats(splats: &[EwaSplat], rect: &TileRect, near: f32, sigma: f32) -> Waste = of_splats_body
}

#[inline(always)]
fn of_splats_body(splats: &[EwaSplat], rect: &TileRect, near: f32, sigma: f32) -> Waste {
    let (most_inverse_depth, quarter_variance) = (1.0 / near, 0.25 * sigma * sigma);
    let mut waste = Waste::default();
    for splat in splats {
        waste.visibility += count(splat.disc.bounds, rect, |patch, l| {
            let hit = patch.at(&splat.disc, l);
            hit.inside & (hit.inverse_depth <= most_inverse_depth) & hit.wanted
        });
        waste.attribute += if splat.crossing == 0 {
            count(splat.filtered_bounds, rect, |patch, l| {
                patch.filtered::<false>(splat, l, most_inverse_depth, quarter_variance).weight > 0.0
            })
        } else {
            count(splat.filtered_bounds, rect, |patch, l| {
                patch.filtered::<true>(splat, l, most_inverse_depth, quarter_variance).weight > 0.0
            })
        };
    }
    waste
}
