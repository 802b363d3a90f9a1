//! The box tests of a packet of rays, with plain code and with AVX. Boxes may move.

use super::bvh::{Sides, WIDTH};

/// Most rays of a packet.
pub(super) const PACKET: usize = 8;

/// The rays of a packet for the box tests. Each starts where it enters the model's sphere; parameters count from there.
#[repr(align(32))]
pub(super) struct BoxRays {
    pub origin: [[f32; PACKET]; 3],
    pub inverse: [[f32; PACKET]; 3],
    pub near: [f32; PACKET],
    pub limit: [f32; PACKET],
}

/// A beam: intervals that hold all rays of a packet.
///
/// The box test computes (side - origin) inverse. The bounds of origin and inverse give bounds of the result. Rounding
/// is monotonic, so they also bound the rounded results of the single rays: the beam enters every box that a ray
/// enters.
pub(super) struct Beam {
    /// Index of the side that the rays meet first: 1 where all directions are negative.
    pub first: [usize; 3],
    /// Bound of the origins that gives the earliest entry.
    pub early: [f32; 3],
    pub late: [f32; 3],
    /// Bounds of the inverse directions.
    pub inverse: [[f32; 2]; 3],
    pub near: f32,
    pub limit: f32,
}

/// The least f32 that is not below x.
#[inline(always)]
pub(super) fn above(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) < x { rounded.next_up() } else { rounded }
}

/// The greatest f32 that is not above x.
#[inline(always)]
pub(super) fn below(x: f64) -> f32 {
    -above(-x)
}

/// The greater number; the second one if either is NaN.
#[inline(always)]
fn later(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The lesser number; the second one if either is NaN.
#[inline(always)]
fn sooner(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// What holds boxes that move, at all times between two shares of the span.
#[inline(always)]
pub(super) fn moved(Sides(start): &Sides, Sides(drift): &Sides, [from, to]: [f32; 2]) -> Sides {
    let mut sides = [[[0.0; WIDTH]; 3]; 2];
    for axis in 0..3 {
        for l in 0..WIDTH {
            let at = |side: usize, share: f32| start[side][axis][l] + share * drift[side][axis][l];
            sides[0][axis][l] = sooner(at(0, from), at(0, to));
            sides[1][axis][l] = later(at(1, from), at(1, to));
        }
    }
    Sides(sides)
}

/// The corners of one box of a node.
// Loops, because compilers call `map` of arrays where they inline these.
#[inline(always)]
pub(super) fn corners(Sides(sides): &Sides, slot: usize) -> [[f32; 3]; 2] {
    let mut corners = [[0.0; 3]; 2];
    for axis in 0..3 {
        corners[0][axis] = sides[0][axis][slot];
        corners[1][axis] = sides[1][axis][slot];
    }
    corners
}

/// As [`moved`], of one box of a node.
#[inline(always)]
pub(super) fn moved_corners(
    Sides(start): &Sides,
    Sides(drift): &Sides,
    slot: usize,
    [from, to]: [f32; 2],
) -> [[f32; 3]; 2] {
    let mut corners = [[0.0; 3]; 2];
    for axis in 0..3 {
        let at = |side: usize, share: f32| start[side][axis][slot] + share * drift[side][axis][slot];
        corners[0][axis] = sooner(at(0, from), at(0, to));
        corners[1][axis] = later(at(1, from), at(1, to));
    }
    corners
}

/// The parameters before which no ray enters the boxes, and a bit mask of the boxes that rays may enter between `near`
/// and `limit`.
#[inline(always)]
pub(super) fn enter_beam(Sides(sides): &Sides, beam: &Beam) -> ([f32; WIDTH], u32) {
    let mut entry = [beam.near; WIDTH];
    let mut mask = 0;
    for l in 0..WIDTH {
        let mut exit = beam.limit;
        for axis in 0..3 {
            let first = sides[beam.first[axis]][axis][l] - beam.early[axis];
            let last = sides[1 - beam.first[axis]][axis][l] - beam.late[axis];
            let [a, b] = beam.inverse[axis];
            entry[l] = later(sooner(first * a, first * b), entry[l]);
            exit = sooner(later(last * a, last * b), exit);
        }
        mask |= u32::from(entry[l] <= exit) << l;
    }
    (entry, mask)
}

/// Bit mask of the rays that enter one box between their `near` and `limit`.
#[inline(always)]
pub(super) fn enter_rays([low_side, high_side]: [[f32; 3]; 2], rays: &BoxRays) -> u32 {
    let mut mask = 0;
    for l in 0..PACKET {
        let (mut entry, mut exit) = (rays.near[l], rays.limit[l]);
        for axis in 0..3 {
            let low = (low_side[axis] - rays.origin[axis][l]) * rays.inverse[axis][l];
            let high = (high_side[axis] - rays.origin[axis][l]) * rays.inverse[axis][l];
            entry = later(sooner(low, high), entry);
            exit = sooner(later(low, high), exit);
        }
        mask |= u32::from(entry <= exit) << l;
    }
    mask
}

/// The box tests with AVX.
#[cfg(target_arch = "x86_64")]
pub(super) mod avx {
    use std::arch::x86_64::{
        __m256, _CMP_LE_OQ, _mm256_cmp_ps, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_ps,
        _mm256_set1_ps, _mm256_sub_ps,
    };

    use super::{Beam, BoxRays, Sides, WIDTH};

    #[target_feature(enable = "avx")]
    #[inline]
    pub(in super::super) fn enter_beam(Sides(sides): &Sides, beam: &Beam) -> ([f32; WIDTH], u32) {
        let mut entry = _mm256_set1_ps(beam.near);
        let mut exit = _mm256_set1_ps(beam.limit);
        for axis in 0..3 {
            let first: __m256 = bytemuck::cast(sides[beam.first[axis]][axis]);
            let last: __m256 = bytemuck::cast(sides[1 - beam.first[axis]][axis]);
            let first = _mm256_sub_ps(first, _mm256_set1_ps(beam.early[axis]));
            let last = _mm256_sub_ps(last, _mm256_set1_ps(beam.late[axis]));
            let (a, b) = (_mm256_set1_ps(beam.inverse[axis][0]), _mm256_set1_ps(beam.inverse[axis][1]));
            entry = _mm256_max_ps(_mm256_min_ps(_mm256_mul_ps(first, a), _mm256_mul_ps(first, b)), entry);
            exit = _mm256_min_ps(_mm256_max_ps(_mm256_mul_ps(last, a), _mm256_mul_ps(last, b)), exit);
        }
        let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(entry, exit));
        (bytemuck::cast(entry), mask as u32)
    }

    #[target_feature(enable = "avx")]
    #[inline]
    pub(in super::super) fn enter_rays([low_side, high_side]: [[f32; 3]; 2], rays: &BoxRays) -> u32 {
        let mut entry: __m256 = bytemuck::cast(rays.near);
        let mut exit: __m256 = bytemuck::cast(rays.limit);
        for axis in 0..3 {
            let (origin, inverse) = (bytemuck::cast(rays.origin[axis]), bytemuck::cast(rays.inverse[axis]));
            let low = _mm256_mul_ps(_mm256_sub_ps(_mm256_set1_ps(low_side[axis]), origin), inverse);
            let high = _mm256_mul_ps(_mm256_sub_ps(_mm256_set1_ps(high_side[axis]), origin), inverse);
            entry = _mm256_max_ps(_mm256_min_ps(low, high), entry);
            exit = _mm256_min_ps(_mm256_max_ps(low, high), exit);
        }
        _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(entry, exit)) as u32
    }
}
