//! Mode auto: finds the cheapest image with a stated error (measurements: docs/measurements/auto.md).
//!
//! A frame is rendered into two half buffers: one has the even time samples, one the odd. Their mean is the image, and
//! half their difference estimates its error. Blocks whose error is above the target are rendered a second time with an
//! odd multiple of the samples. The samples of the first round are reused.

mod estimate;
mod half_buffers;
mod path;

use std::collections::BTreeMap;

use glam::DVec3;

use self::estimate::{Errors, block_errors};
use self::half_buffers::{HalfBuffers, Round};
use crate::backend::{Achieved, Backend, BackendError, Rendered, Stats};
use crate::film::{Aov, Layer};
use crate::frame::{Blocks, STATIC_PATH};
use crate::options::{ErrorTarget, Interleave, PixelFilter, RenderOptions};
use crate::scene::Scene;
use crate::time::{FrameNumber, Weight};

/// Time samples of a pixel in the first round. They are even, so that both half buffers have equally many.
const FIRST: [u32; 6] = [4, 6, 8, 12, 16, 24];
/// Odd multiples of them for the second round.
const FACTORS: [u32; 7] = [3, 5, 7, 9, 15, 25, 45];
/// Samples in the first round = `SAMPLES` / error * sqrt(path length in pixels). The error is an RMSE of display
/// values. At error 0.05 that is 0.5 samples per square root of a pixel and FLIP is about 0.01; at 0.025 it is 1, and
/// FLIP is 0.006.
const SAMPLES: f64 = 0.025;
/// Smallest target for which samples are interleaved. There a lattice halves FLIP at the same cost. A tighter target
/// has the smaller error without a lattice, because the classes of a lattice sample off the middles of their strata.
const LOOSE: f64 = 0.02;
/// Shortest path between two time samples, pixels, for which samples are interleaved. On shorter paths steps hardly
/// show, but the lattice would.
const WIDE_STEP: f64 = 11.0;
/// Path between two time samples, pixels, below which kernels of both overlap. Then the error falls faster with more
/// samples.
const NARROW_STEP: f64 = 8.0;

/// Factor on the estimated error, from measurements (docs/measurements/auto.md). `step`: path between two time samples,
/// pixels.
///
/// The difference of the half buffers misses part of the error. Classes of a lattice sample off the middles of their
/// strata, and that error is the same in both half buffers. Sub-pixel positions are spread less evenly than times.
fn safety(interleave: Interleave, filter: PixelFilter, step: f64) -> f64 {
    match (interleave, filter) {
        (Interleave::None, PixelFilter::Point) if step < NARROW_STEP => 1.05,
        (Interleave::None, PixelFilter::Point) => 1.3,
        _ => 1.5,
    }
}

/// Renders a frame with an error of at most `target.error`, as far as `target.samples_max` allows.
///
/// # Errors
/// As `Backend::render`.
pub fn render(
    backend: &mut dyn Backend,
    scene: &Scene,
    number: FrameNumber,
    options: &RenderOptions,
    target: ErrorTarget,
) -> Result<Rendered, BackendError> {
    let path_length = path::longest(scene, number);
    let moves = path_length >= f64::from(STATIC_PATH);
    let moving_samples = first_samples(path_length, &target);
    let step = path_length / f64::from(moving_samples);
    let interleave = if target.error >= LOOSE && step >= WIDE_STEP { Interleave::Two } else { Interleave::None };
    // Both half buffers have the same number of samples and of positions.
    let most = target.samples_max & !1;
    let positions = match options.filter {
        // A lattice has four times as many positions: each class has its own.
        PixelFilter::Box if moves && interleave == Interleave::None => 2 * target.pixel_samples,
        PixelFilter::Box => target.pixel_samples.next_multiple_of(2),
        PixelFilter::Point => 1,
    };
    let samples = if moves { moving_samples } else { positions.clamp(2, most) };
    let positions = positions.min(samples);
    let first = Round { scene, number, options, interleave, samples, factor: 1, positions };
    let mut stats = Stats::default();
    let mut half_buffers = HalfBuffers::render(backend, &first, None, &mut stats)?;
    let edge = Blocks::EDGE * interleave.stride() as usize;
    let background = if scene.image.transparent { DVec3::ZERO } else { scene.image.background };
    let mut errors = block_errors(&half_buffers, background.as_vec3(), edge, None);

    let safety = safety(interleave, options.filter, step);
    let (factors, capped) = needed_factors(&errors, target.error / safety, samples, target.samples_max);
    for factor in FACTORS {
        let of_factor: Vec<bool> = factors.iter().map(|&of_block| of_block == factor).collect();
        if of_factor.contains(&true) {
            let blocks = Blocks { width: errors.width, wanted: of_factor };
            let round = Round { factor, ..first };
            let fresh = HalfBuffers::render(backend, &round, Some(&blocks), &mut stats)?;
            half_buffers.refine(&fresh, &round, &blocks);
            fresh.recycle(backend);
            errors.replace(block_errors(&half_buffers, background.as_vec3(), edge, Some(&blocks)));
        }
    }
    let error = safety * errors.root_mean();
    let refined = factors.iter().filter(|&&factor| factor > 1).count() as u32;
    stats.achieved = Some(Achieved {
        error,
        path_length,
        samples,
        most_samples: samples * factors.iter().copied().max().unwrap_or(1),
        interleave: interleave.stride(),
        blocks: factors.len() as u32,
        refined,
        capped,
    });
    let behind = (!scene.image.transparent).then_some(background.as_vec3());
    let mut picture = half_buffers.mean(&even_shares(&first, &factors, errors.width, edge), behind, backend);
    let per_block = |value: &dyn Fn(usize) -> f32| spread(&errors, edge, [picture.width, picture.height], value);
    let mut layers = Vec::new();
    if options.aovs.contains(&Aov::Samples) {
        layers.push(Layer { aov: Aov::Samples, planes: vec![per_block(&|i| (samples * factors[i]) as f32)] });
    }
    if options.aovs.contains(&Aov::Error) {
        let plane = per_block(&|i| (safety * errors.squares[i].sqrt()) as f32);
        layers.push(Layer { aov: Aov::Error, planes: vec![plane.clone(), plane.clone(), plane.clone(), plane] });
    }
    picture.layers.extend(layers);
    Ok(Rendered { picture, stats })
}

/// For each block, the factor of samples that brings its error down to `wanted`, as far as `samples_max` allows.
/// Second: the number of blocks for which `samples_max` is too small.
fn needed_factors(errors: &Errors, wanted: f64, samples: u32, samples_max: u32) -> (Vec<u32>, u32) {
    let allowed = |factor: &u32| samples.saturating_mul(*factor) <= samples_max;
    let mut capped = 0;
    let of_block = |square: &f64| {
        let needed = square.sqrt() / wanted;
        if needed <= 1.0 {
            return 1;
        }
        let enough = FACTORS.into_iter().find(|&factor| f64::from(factor) >= needed);
        let best = enough.filter(allowed).or_else(|| FACTORS.into_iter().rfind(allowed)).unwrap_or(1);
        capped += u32::from(enough != Some(best));
        best
    };
    (errors.squares.iter().map(of_block).collect(), capped)
}

/// Writes the share of the even samples for each pixel of a row. `factors`: of the blocks, `width` in a row, `edge`
/// pixels each.
fn even_shares(first: &Round<'_>, factors: &[u32], width: usize, edge: usize) -> impl Fn(usize, &mut [f32]) + Sync {
    let stride = first.interleave.stride();
    let of_factor = |&factor: &u32| {
        let round = Round { factor, ..*first };
        let classes = (0..stride * stride).map(move |class| round.even_share([class % stride, class / stride]));
        (factor, classes.collect::<Vec<f32>>())
    };
    let of_factors: BTreeMap<u32, Vec<f32>> = factors.iter().map(of_factor).collect();
    let of_blocks: Vec<Vec<f32>> = factors.iter().map(|factor| of_factors[factor].clone()).collect();
    let stride = stride as usize;
    move |y, shares| {
        for (block, shares) in shares.chunks_mut(edge).enumerate() {
            let classes = &of_blocks[y / edge * width + block][y % stride * stride..][..stride];
            shares.iter_mut().zip(classes.iter().cycle()).for_each(|(share, of_class)| *share = *of_class);
        }
    }
}

/// Samples of the first round for a longest path of `path_length` pixels.
fn first_samples(path_length: f64, target: &ErrorTarget) -> u32 {
    let needed = SAMPLES / target.error * path_length.sqrt();
    let enough = FIRST.into_iter().find(|&samples| f64::from(samples) >= needed);
    let most = FIRST.into_iter().rfind(|&samples| samples <= target.samples_max).unwrap_or(FIRST[0]);
    enough.unwrap_or(FIRST[FIRST.len() - 1]).min(most)
}

/// A value of each block as a plane of pixels.
fn spread(errors: &Errors, edge: usize, [width, height]: [u32; 2], value: &dyn Fn(usize) -> f32) -> Vec<f32> {
    let (columns, rows) = (width as usize, height as usize);
    let pixels = (0..rows).flat_map(|y| (0..columns).map(move |x| [x, y]));
    pixels.map(|[x, y]| value(y / edge * errors.width + x / edge)).collect()
}

/// Can a finer exposure reuse the samples of a coarser one? Only where all have the same weight.
fn reuses_samples(scene: &Scene) -> bool {
    scene.shutter.weight == Weight::Box
}
