//! Pass `visibility`: T(x, t) = min over discs covering x of (depth + epsilon), per pixel (Wolf 2008, 4.1.1;
//! docs/math.md, section 4); and the least depth alone, where objects have several tolerances. Pass `second`, of
//! filtered kernels: the same minimum over the discs behind the limits of their objects, and which pixels are solid
//! (docs/math.md, section 3).
//!
//! In: splats of a tile's list. Out: the tile's depths. Order-free (minima).

use super::buffers::{APRON_STRIDE, PaintBuffers, with_apron};
use super::kernel::Kernel;
use crate::backend::cpu::depths::Depths;
use crate::backend::cpu::patch::{self, NARROW, Patch, Touched};
use crate::backend::cpu::tiles::{LANES, STRIDE, TILE, TileRect};
use crate::layout::Splat;
use crate::math::simd::dispatch;

dispatch! {
    /// Lowers the thresholds of a tile and its apron by the splats that `list` names.
    pub(in crate::backend) fn visibility<K: Kernel>(
        splats: &[K], list: &[u32], depths: Depths, rect: &TileRect, buffers: &mut PaintBuffers,
    ) = visibility_body
}

#[inline(always)]
fn visibility_body<K: Kernel>(splats: &[K], list: &[u32], depths: Depths, rect: &TileRect, buffers: &mut PaintBuffers) {
    let (behind, nearest) = (!buffers.floor.is_empty(), !buffers.nearest.is_empty());
    for &index in list {
        let splat = splats[index as usize].disc();
        let Some(touched) = Touched::within(splat.bounds, rect) else { continue };
        macro_rules! lower {
            ($w:expr, $nearest:expr, $behind:expr) => {
                if splat.is_sphere() {
                    lower::<$w, $nearest, $behind, true>(splat, &touched, depths, rect, buffers)
                } else {
                    lower::<$w, $nearest, $behind, false>(splat, &touched, depths, rect, buffers)
                }
            };
        }
        // Only see-through surfels lie behind a floor: there nothing has a limit of its own.
        match (touched.is_narrow(), nearest, K::FILTERED && behind) {
            (true, false, false) => lower!(NARROW, false, false),
            (false, false, false) => lower!(LANES, false, false),
            (true, true, false) => lower!(NARROW, true, false),
            (false, true, false) => lower!(LANES, true, false),
            (true, _, true) => lower!(NARROW, false, true),
            (false, _, true) => lower!(LANES, false, true),
        }
    }
}

/// `NEAREST`: lowers the least depths, too. `BEHIND`: only discs behind the floor count. `SPHERE`: it is one.
#[inline(always)]
fn lower<const W: usize, const NEAREST: bool, const BEHIND: bool, const SPHERE: bool>(
    splat: &Splat,
    touched: &Touched,
    depths: Depths,
    rect: &TileRect,
    buffers: &mut PaintBuffers,
) {
    let most_inverse_depth = 1.0 / depths.near;
    let mut y = touched.y0;
    while y <= touched.y1 {
        let mut x = touched.x0;
        while x <= touched.x1 {
            let patch = Patch::<W>::new(touched, rect, x, y);
            let at = y * APRON_STRIDE + x;
            let mut threshold = patch::load::<W>(&buffers.threshold[at..], APRON_STRIDE);
            let mut nearest = [0.0; LANES];
            if NEAREST {
                nearest = patch::load::<W>(&buffers.nearest[at..], APRON_STRIDE);
            }
            let mut floor = [0.0; LANES];
            if BEHIND {
                floor = patch::load::<W>(&buffers.floor[at..], APRON_STRIDE);
            }
            for l in 0..LANES {
                let hit = patch.met::<SPHERE>(splat, l);
                let depth = 1.0 / hit.inverse_depth;
                let covers = hit.inside & (hit.inverse_depth <= most_inverse_depth) & hit.wanted;
                let covers = covers & (!BEHIND | (depth > floor[l]));
                // Not a number where nothing covers. Of two choices by `covers` the compiler made a branch, and went
                // through the lanes one by one.
                let depth = f32::from_bits(depth.to_bits() | u32::from(covers).wrapping_sub(1));
                let candidate = depth + depths.tolerance(depth);
                threshold[l] = if candidate < threshold[l] { candidate } else { threshold[l] };
                if NEAREST {
                    nearest[l] = if depth < nearest[l] { depth } else { nearest[l] };
                }
            }
            patch::store::<W>(&mut buffers.threshold[at..], APRON_STRIDE, &threshold);
            if NEAREST {
                patch::store::<W>(&mut buffers.nearest[at..], APRON_STRIDE, &nearest);
            }
            x += W;
        }
        y += LANES / W;
    }
}

dispatch! {
    /// Lowers the second thresholds of the pixels that are not solid.
    pub(in crate::backend) fn second<K: Kernel>(
        splats: &[K], list: &[u32], depths: Depths, tile: &TileRect, start: usize, buffers: &mut PaintBuffers,
    ) = second_body
}

#[inline(always)]
fn second_body<K: Kernel>(
    splats: &[K],
    list: &[u32],
    depths: Depths,
    tile: &TileRect,
    start: usize,
    buffers: &mut PaintBuffers,
) {
    if buffers.nearest.is_empty() {
        lower_second::<K, false>(splats, list, depths, tile, start, buffers);
    } else {
        lower_second::<K, true>(splats, list, depths, tile, start, buffers);
    }
}

/// `NEAREST`: each object has a limit of its own.
#[inline(always)]
fn lower_second<K: Kernel, const NEAREST: bool>(
    splats: &[K],
    list: &[u32],
    depths: Depths,
    tile: &TileRect,
    start: usize,
    buffers: &mut PaintBuffers,
) {
    let most_inverse_depth = 1.0 / depths.near;
    for &index in list {
        let splat = splats[index as usize].disc();
        let Some(touched) = Touched::within(splat.bounds, tile) else { continue };
        let columns = ((2_u64 << touched.x1) - (1 << touched.x0)) as u32;
        for y in touched.y0..=touched.y1 {
            if buffers.open[y] & columns == 0 {
                continue;
            }
            let mut x = touched.x0;
            while x <= touched.x1 {
                if (buffers.open[y] >> x) as u8 == 0 {
                    x += LANES;
                    continue;
                }
                let patch = Patch::<LANES>::new(&touched, tile, x, y);
                let at = start + y * APRON_STRIDE + x;
                let first = patch::load::<LANES>(&buffers.threshold[at..], APRON_STRIDE);
                let mut nearest = [0.0; LANES];
                if NEAREST {
                    nearest = patch::load::<LANES>(&buffers.nearest[at..], APRON_STRIDE);
                }
                let mut out = patch::load::<LANES>(&buffers.second[y * STRIDE + x..], STRIDE);
                for l in 0..LANES {
                    let hit = patch.met::<true>(splat, l);
                    let depth = 1.0 / hit.inverse_depth;
                    let covers = hit.inside & (hit.inverse_depth <= most_inverse_depth) & hit.wanted;
                    let candidate = depth + depths.tolerance(depth);
                    let limit = if NEAREST { depths.limit(depth, first[l], nearest[l]) } else { first[l] };
                    let lower = covers & (depth > limit) & (candidate < out[l]);
                    out[l] = if lower { candidate } else { out[l] };
                }
                patch::store::<LANES>(&mut buffers.second[y * STRIDE + x..], STRIDE, &out);
                x += LANES;
            }
        }
    }
}

dispatch! {
    /// Finds the pixels that are not solid, and those near which there is one that no disc covers.
    ///
    /// A pixel is solid if discs cover it and all pixels within `apron`, and inverse depths around it change as those
    /// of a plane do, up to four times the depths that show: opposite neighbours agree with their middle. Pixels
    /// outside the image of `size` pixels do not count. The depths that show reach from the nearest disc to T where the
    /// former is known, else as far as the `least` tolerance of objects.
    pub(in crate::backend) fn find_open(
        tile: &TileRect, apron: usize, size: [u32; 2], least: Depths, buffers: &mut PaintBuffers,
    ) = find_open_body
}

#[inline(always)]
fn find_open_body(tile: &TileRect, apron: usize, size: [u32; 2], least: Depths, buffers: &mut PaintBuffers) {
    const EDGE: usize = TILE + 2 * super::buffers::MOST_APRON;
    let (rect, [left, top]) = with_apron(tile, apron, size);
    // Inverse depths with the whole apron; NaN outside the image, 0 where nothing covers.
    let mut inverse = [[f32::NAN; EDGE]; EDGE];
    for y in 0..rect.height {
        let from = &buffers.threshold[y * APRON_STRIDE..][..rect.width];
        let to = &mut inverse[y + apron - top][apron - left..][..rect.width];
        to.iter_mut().zip(from).for_each(|(to, from)| *to = 1.0 / from);
    }
    for y in 0..tile.height {
        let mut rim = [0_u32; TILE];
        for row in &inverse[y..=y + 2 * apron] {
            for dx in 0..=2 * apron {
                let row = &row[dx..][..TILE];
                rim.iter_mut().zip(row).for_each(|(rim, z)| *rim |= u32::from(*z == 0.0));
            }
        }
        let mut open = rim;
        let middle = &inverse[y + apron][apron..][..TILE];
        let first = (y + top) * APRON_STRIDE + left;
        let thresholds = &buffers.threshold[first..][..TILE];
        let mut reach = [0.0; TILE];
        if buffers.nearest.is_empty() {
            reach.iter_mut().zip(thresholds).for_each(|(reach, depth)| *reach = least.tolerance(*depth));
        } else {
            let nearest = &buffers.nearest[first..][..TILE];
            let both = thresholds.iter().zip(nearest);
            reach.iter_mut().zip(both).for_each(|(reach, (depth, nearest))| *reach = depth - nearest);
        }
        for distance in 1..=apron {
            for (dx, dy) in [(1, 0), (0, 1), (1, 1), (-1_isize, 1_isize)] {
                let pick = |sign: isize| {
                    let shift = |d: isize| (apron as isize + sign * d * distance as isize) as usize;
                    &inverse[y + shift(dy)][shift(dx)..][..TILE]
                };
                let (before, behind) = (pick(-1), pick(1));
                for x in 0..TILE {
                    let bend = (before[x] + behind[x] - 2.0 * middle[x]).abs();
                    open[x] |= u32::from(bend > 4.0 * reach[x] * (middle[x] * middle[x]));
                }
            }
        }
        let bits = |row: &[u32; TILE]| row[..tile.width].iter().enumerate().fold(0, |bits, (x, bit)| bits | bit << x);
        (buffers.open[y], buffers.rim[y]) = (bits(&open), bits(&rim));
    }
}
