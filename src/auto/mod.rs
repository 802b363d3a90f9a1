//! Mode auto: finds the cheapest image with a stated error (measurements: docs/measurements/auto.md).
//!
//! A frame is rendered into two half buffers: each has half of the time samples. Their mean is the image, and
//! half their difference estimates its error. Blocks whose error is above the target, or whose FLIP would be seen, are
//! rendered once more, with an odd multiple of the samples, and again while their error is more than a tenth above it.
//! Earlier samples are reused.

mod estimate;
mod frame;
mod half_buffers;
mod path;
mod strata;
mod turn;

use self::estimate::{BlockError, Errors};
pub(crate) use self::frame::AutoFrame;
use crate::frame::shared_positions;
use crate::options::ErrorTarget;

/// Time samples of a pixel in the first round: multiples of four, so that each half buffer is its own mirror image.
const FIRST: [u32; 13] = [4, 8, 12, 16, 20, 24, 28, 32, 40, 48, 64, 80, 96];
/// Fewest of them at the target `good`.
const LEAST: f64 = 8.0;
/// Odd multiples of them for a finer round.
const FACTORS: [u32; 5] = [3, 5, 9, 15, 45];
/// Samples of the first round at the target `good`: this times the path length, pixels, to the power [`BY_PATH`].
const SAMPLES: f64 = 1.0;
/// See [`SAMPLES`].
const BY_PATH: f64 = 0.7;
/// Where nothing moves, samples of the first round for each sub-pixel position of a picture in motion.
const STILL: u32 = 2;
/// A target of 1 / k of the error takes k to this power as many.
const BY_ERROR: f64 = 1.7;
/// Smallest target for which samples are interleaved. There a lattice halves FLIP at the same cost. A tighter target
/// has the smaller error without a lattice, because the classes of a lattice sample off the middles of their strata.
const LOOSE: f64 = 0.02;
/// Shortest path between two time samples, pixels, for which samples are interleaved. On shorter paths steps hardly
/// show, but the lattice would.
const WIDE_STEP: f64 = 11.0;
/// Error of a block over the target, up to which a round that refined it was enough. More than the factor by which a
/// round raises the gain (`estimate`), so that a round which does what it should is enough.
const SLACK: f64 = 1.1;
/// Share of its need from which a block takes part in the refinement of its neighbours.
const NEARLY: f64 = 0.75;
/// FLIP of stripes and ghosts that a block may have at the target `good`.
const FLIP: f64 = 0.021;

/// By which factors samples grow once more in the blocks that were refined and are still above the target. `factors`:
/// by which they have grown. `fits`: is there memory for so many samples?
fn more(errors: &Errors, target: &ErrorTarget, factors: &[u32], samples: u32, fits: impl Fn(u32) -> bool) -> Vec<u32> {
    let of_block = |(block, &factor): (&BlockError, &u32)| {
        let over = block.error() / target.error;
        if factor == 1 || over <= SLACK {
            return 1;
        }
        let allowed = |finer: &u32| {
            let all = samples.saturating_mul(factor).saturating_mul(*finer);
            all <= target.samples_max && fits(all)
        };
        enough(over, allowed)
    };
    errors.blocks.iter().zip(factors).map(of_block).collect()
}

/// The least factor of at least `needed`, or else the largest that is allowed; 1 where none is.
fn enough(needed: f64, allowed: impl Fn(&u32) -> bool) -> u32 {
    let enough = FACTORS.into_iter().find(|&factor| f64::from(factor) >= needed);
    enough.filter(&allowed).or_else(|| FACTORS.into_iter().rfind(&allowed)).unwrap_or(1)
}

/// For each block, by which factor its samples grow, as far as `samples_max` allows.
fn factors(errors: &Errors, target: &ErrorTarget, flip: f64, samples: u32) -> Vec<u32> {
    let needed: Vec<f64> = errors.blocks.iter().map(|block| block.needed(target.error, flip)).collect();
    let allowed = |factor: &u32| samples.saturating_mul(*factor) <= target.samples_max;
    let enough = |needed: f64| enough(needed, allowed);
    let mut factors: Vec<u32> = needed.iter().map(|&needed| if needed > 1.0 { enough(needed) } else { 1 }).collect();
    // What reaches a border may go on in a block that no sample touched.
    let own = factors.clone();
    for (i, factor) in factors.iter_mut().enumerate() {
        let beside = errors.reaching(i).map(|j| own[j]).max();
        *factor = beside.unwrap_or(1).max(*factor);
    }
    // Regions grow over blocks that nearly need more samples, so that no border stands out.
    loop {
        let grown: Vec<u32> = (0..factors.len())
            .map(|i| {
                let nearby = errors.around(i).map(|j| factors[j]).max().unwrap_or(1);
                if needed[i] > NEARLY && nearby > 2 {
                    factors[i].max(enough(f64::from(nearby) / 2.0))
                } else {
                    factors[i]
                }
            })
            .collect();
        if grown == factors {
            return factors;
        }
        factors = grown;
    }
}

/// Sub-pixel positions of the first round, a multiple of four. Static objects are splatted once at each.
fn positions(target: &ErrorTarget) -> u32 {
    let finer = (ErrorTarget::GOOD / target.error).clamp(0.5, 4.0);
    ((f64::from(target.pixel_samples) * finer).round() as u32).next_multiple_of(4)
}

/// Sub-pixel positions, and samples that share them: at least `samples`, and equally many at each position. A sample
/// more costs only what moves, while a position more costs what rests.
fn sharing(samples: u32, target: &ErrorTarget) -> (u32, u32) {
    let positions = positions(target);
    let even = samples.next_multiple_of(positions);
    (positions, if fits(even, target) { even } else { samples })
}

/// Is there room for a finer round after a first one of `samples`?
fn fits(samples: u32, target: &ErrorTarget) -> bool {
    samples.saturating_mul(FACTORS[0]) <= target.samples_max
}

/// Sub-pixel positions that the `samples` of the first round share, at least `least`. Position 1 is the pixel's centre.
fn shared(least: u32, samples: u32) -> u32 {
    if least == 1 { 1 } else { shared_positions(least, samples, 4).unwrap_or(samples) }
}

/// Samples of the first round for a longest path of `path_length` pixels.
fn first_samples(path_length: f64, target: &ErrorTarget) -> u32 {
    let at_good = (SAMPLES * path_length.powf(BY_PATH)).max(LEAST);
    let needed = at_good * (ErrorTarget::GOOD / target.error).powf(BY_ERROR);
    let enough = FIRST.into_iter().find(|&samples| f64::from(samples) >= needed);
    let most = FIRST.into_iter().rfind(|&samples| fits(samples, target)).unwrap_or(FIRST[0]);
    enough.unwrap_or(FIRST[FIRST.len() - 1]).min(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_have_equally_many_samples() {
        for (least, samples, wanted) in
            [(8, 8, 8), (8, 12, 12), (8, 16, 8), (8, 20, 20), (8, 24, 8), (8, 48, 8), (16, 40, 20), (16, 96, 16)]
        {
            assert_eq!(shared(least, samples), wanted, "{least}, {samples}");
        }
        // The pixel's centre, and parts of an exposure that left no choice.
        assert_eq!([shared(1, 24), shared(8, 6), shared(24, 24)], [1, 6, 24]);
    }
}
