//! Mode auto: finds the cheapest image with a stated error (measurements: docs/measurements/auto.md).
//!
//! A frame is rendered into two half buffers: each has half of the time samples. Their mean is the image, and
//! half their difference estimates its error. Blocks whose error is above the target, or whose FLIP would be seen, are
//! rendered once more, with an odd multiple of the samples, and again while their error is more than a tenth above it.
//! Earlier samples are reused.

mod estimate;
mod half_buffers;
mod path;
mod strata;
mod turn;

use self::estimate::{Behind, BlockError, Errors};
use self::half_buffers::{HalfBuffers, Round};
use self::strata::Strata;
use crate::backend::{Achieved, Backend, BackendError, Rendered, Stats};
use crate::film::{Aov, Background, Layer};
use crate::frame::{Blocks, Panorama, STATIC_PATH, shared_positions, shows_much_rest};
use crate::options::{ErrorTarget, Interleave, Lattice, PixelFilter, RenderOptions};
use crate::scene::Scene;
use crate::time::FrameNumber;

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
    let interleave = match target.interleave {
        Lattice::Fixed(interleave) => interleave,
        Lattice::Auto if target.error >= LOOSE && step >= WIDE_STEP => Interleave::Two,
        Lattice::Auto => Interleave::None,
    };
    let (positions, samples) = match options.look.filter {
        PixelFilter::Point => (1, if moves { moving_samples } else { 2 }),
        // Each sample sees a position of its own.
        _ if !moves => (STILL * positions(&target), STILL * positions(&target)),
        _ if shows_much_rest(scene) => sharing(moving_samples, &target),
        _ => (moving_samples, moving_samples),
    };
    let strata = Strata::new(scene, number, samples, target.samples_max);
    let samples = strata.count();
    // Samples of unequal shares would give the positions unequal shares.
    let positions = if positions > 1 && strata.has_jumps() { samples } else { shared(positions, samples) };
    let first = Round { scene, number, options, interleave, strata: &strata, coarse: 1, factor: 1, positions };
    let edge = Blocks::EDGE * interleave.stride() as usize;
    let background = Background { colour: scene.image.background, transparent: scene.image.transparent };
    let panorama = Panorama::of(scene, number, None, options.look.filter).filter(|_| !scene.image.transparent);
    let behind = Behind::new(background, panorama.as_ref());
    let mut stats = Stats::default();
    let mut half_buffers = HalfBuffers::render(backend, &first, None, &mut stats)?;
    let size = [scene.image.width, scene.image.height];
    let step = path_length / f64::from(samples);
    let mut errors = Errors::new(size, edge, &behind, interleave, step, options.look.filter, target.white);
    let looser = target.error / ErrorTarget::GOOD;
    let flip = FLIP * if looser > 1.0 { looser.powi(2) } else { looser.powf(1.5) };
    errors.measure(&half_buffers);
    let mut factors = factors(&errors, &target, flip, samples);
    let mut finer = factors.clone();
    // What a round leaves above the target goes on, as far as it may.
    while finer.iter().any(|&factor| factor > 1) {
        refine(backend, &first, &finer, &factors, &mut half_buffers, &mut stats, errors.width)?;
        errors.measure_again(&half_buffers, &finer);
        let fits = |samples: u32| {
            let all = u64::from(samples) * u64::from(interleave.stride().pow(2));
            BackendError::check_samples(scene, all, options.memory).is_ok()
        };
        finer = more(&errors, &target, &factors, samples, fits);
        factors.iter_mut().zip(&finer).for_each(|(factor, more)| *factor *= more);
    }
    // All other blocks went on until they were good enough.
    let is_capped = |(block, &factor): (&BlockError, &u32)| {
        let slack = if factor > 1 { SLACK } else { 1.0 };
        block.error() > slack * target.error
    };
    let capped = errors.blocks.iter().zip(&factors).filter(|&block| is_capped(block)).count() as u32;
    let error = errors.root_mean();
    let refined = factors.iter().filter(|&&factor| factor > 1).count() as u32;
    stats.achieved = Some(Achieved {
        error,
        path_length,
        turn: turn::largest(scene, number).to_degrees() / f64::from(samples),
        samples,
        most_samples: samples * factors.iter().copied().max().unwrap_or(1),
        interleave: interleave.stride(),
        blocks: factors.len() as u32,
        refined,
        capped,
    });
    let backdrop = (!scene.image.transparent).then_some(&behind.all);
    let mut picture = half_buffers.mean(backdrop, backend);
    let per_block = |value: &dyn Fn(usize) -> f32| spread(&errors, edge, [picture.width, picture.height], value);
    let mut layers = Vec::new();
    if options.look.aovs.contains(&Aov::Samples) {
        layers.push(Layer {
            aov: Aov::Samples,
            planes: vec![per_block(&|i| (samples * factors[i]) as f32)],
            names: Vec::new(),
        });
    }
    if options.look.aovs.contains(&Aov::Error) {
        let plane = per_block(&|i| errors.blocks[i].stated() as f32);
        layers.push(Layer {
            aov: Aov::Error,
            planes: vec![plane.clone(), plane.clone(), plane.clone(), plane],
            names: Vec::new(),
        });
    }
    picture.layers.extend(layers);
    Ok(Rendered { picture, stats })
}

/// Renders the blocks whose samples grow once more, by the factors `finer`. `factors`: those since the first round,
/// `finer` included.
fn refine(
    backend: &mut dyn Backend,
    first: &Round<'_>,
    finer: &[u32],
    factors: &[u32],
    half_buffers: &mut HalfBuffers,
    stats: &mut Stats,
    width: usize,
) -> Result<(), BackendError> {
    // Blocks of one round have the same factors, before it and in it.
    let steps: Vec<[u32; 2]> = factors.iter().zip(finer).map(|(&all, &factor)| [all / factor, factor]).collect();
    let mut rounds: Vec<[u32; 2]> = steps.iter().copied().filter(|[_, factor]| *factor > 1).collect();
    rounds.sort_unstable();
    rounds.dedup();
    for [coarse, factor] in rounds {
        let blocks = Blocks { width, wanted: steps.iter().map(|&step| step == [coarse, factor]).collect() };
        let strata = first.strata.divided(coarse);
        let positions = if first.positions > 1 { first.positions * coarse } else { 1 };
        let round = Round { strata: &strata, coarse, factor, positions, ..*first };
        let fresh = HalfBuffers::render(backend, &round, Some(&blocks), stats)?;
        half_buffers.refine(&fresh, &round, &blocks);
        fresh.recycle(backend);
    }
    Ok(())
}

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

/// A value of each block as a plane of pixels.
fn spread(errors: &Errors, edge: usize, [width, height]: [u32; 2], value: &dyn Fn(usize) -> f32) -> Vec<f32> {
    let (columns, rows) = (width as usize, height as usize);
    let pixels = (0..rows).flat_map(|y| (0..columns).map(move |x| [x, y]));
    pixels.map(|[x, y]| value(y / edge * errors.width + x / edge)).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may stop")]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;
    use crate::backend::cpu::Cpu;
    use crate::environment::{Environment, studio};
    use crate::math::{focal_length, srgb};
    use crate::sampling::pixel_offsets;
    use crate::scene::Motion;
    use crate::scene::pose::camera_from_world;

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

    /// Nothing but an environment behind a camera that turns by 30 degrees a frame: the stated error is that of the
    /// background, beside 4096 times in double precision. No block is refined, since that would not change it.
    #[test]
    fn the_background_is_in_the_stated_error() {
        let mut scene = Scene::new([]);
        let mut environment = Environment::new(studio());
        environment.background = true;
        scene.environment = Some(environment.clone());
        scene.camera.motions.push(Motion::Rotation { axis: DVec3::Y, per_frame: 0.52, centre: DVec3::ZERO });
        (scene.image.width, scene.image.height) = (96, 64);
        let rendered =
            render(&mut Cpu::default(), &scene, 0.into(), &RenderOptions::default(), ErrorTarget::default()).unwrap();
        let focal = focal_length(64.0, scene.camera.fovy);
        let cameras: Vec<DMat3> = (0..4096)
            .map(|i| scene.shutter.frame_time(0.0, (f64::from(i) + 0.5) / 4096.0))
            .map(|time| DMat3::from_mat4(camera_from_world(&scene, time)).transpose())
            .collect();
        let offsets = pixel_offsets(4096, 3);
        let mut sum = 0.0;
        for (at, pixel) in rendered.picture.rgba.iter().enumerate() {
            let [x, y] = [(at % 96) as f64 + 0.5 - 48.0, (at / 96) as f64 + 0.5 - 32.0];
            let radiance = |(camera, offset): (&DMat3, &[f32; 2])| {
                let [dx, dy] = offset.map(f64::from);
                environment.radiance((*camera * DVec3::new(x + dx, -(y + dy), -focal)).normalize())
            };
            let truth = cameras.iter().zip(&offsets).map(radiance).sum::<DVec3>() / 4096.0;
            let truth = truth.to_array();
            for c in 0..3 {
                sum += (srgb::from_linear(pixel[c]) - srgb::from_linear(truth[c] as f32)).powi(2);
            }
        }
        let error = f64::from(sum / (96.0 * 64.0 * 3.0)).sqrt();
        let achieved = rendered.stats.achieved.unwrap();
        assert!(error > 1e-4 && achieved.error >= error, "stated {}, true {error}", achieved.error);
        assert!(achieved.error < 3.0 * error, "stated {}, true {error}", achieved.error);
        assert_eq!((achieved.refined, achieved.capped), (0, 0));
    }
}
