//! A frame of mode auto under way: its rounds, one after the other.

use std::borrow::Cow;
use std::collections::VecDeque;

use super::estimate::{Behind, BlockError, Errors};
use super::half_buffers::{HalfBuffers, Round};
use super::strata::Strata;
use super::{
    FLIP, LOOSE, SLACK, STILL, WIDE_STEP, factors, first_samples, more, path, positions, shared, sharing, turn,
};
use crate::backend::{Achieved, Backend, BackendError, Rendered, Stats};
use crate::film::{Aov, Background, Layer};
use crate::frame::{Blocks, Panorama, STATIC_PATH, shows_much_rest};
use crate::options::{ErrorTarget, Interleave, Lattice, PixelFilter, RenderOptions};
use crate::scene::Scene;
use crate::time::FrameNumber;

/// A frame that mode auto renders, with an error of at most `target.error` as far as `target.samples_max` allows.
///
/// [`begin`](Self::begin) begins a pair of renderings on a backend; [`land`](Self::land) waits for it. This goes on, in
/// turn with other frames, until the frame [is done](Self::is_done).
pub(crate) struct AutoFrame<'a> {
    scene: Cow<'a, Scene>,
    number: FrameNumber,
    options: Cow<'a, RenderOptions>,
    target: ErrorTarget,
    /// Longest path of a surfel during the exposure, pixels.
    path_length: f64,
    interleave: Interleave,
    /// Sub-pixel positions and strata of the first round.
    positions: u32,
    strata: Strata,
    stats: Stats,
    /// Pairs that are left to begin, and the one that is under way.
    next: VecDeque<Pair>,
    under_way: Option<Pair>,
    /// What the first pair left.
    found: Option<Found>,
}

/// Two renderings, one for each half of the samples: the new samples of a round in some blocks.
struct Pair {
    /// By what the rounds before divided the strata of the first.
    coarse: u32,
    factor: u32,
    /// `None`: all.
    blocks: Option<Blocks>,
}

/// All that is known of a frame after its first round.
struct Found {
    half_buffers: HalfBuffers,
    errors: Errors,
    /// By which factors the samples of each block have grown since the first round, and in the last one.
    factors: Vec<u32>,
    finer: Vec<u32>,
}

impl<'a> AutoFrame<'a> {
    /// Renderings of a pair.
    pub(crate) const RENDERINGS: usize = 2;

    /// A frame of which nothing is begun.
    pub(crate) fn new(
        scene: Cow<'a, Scene>,
        number: FrameNumber,
        options: Cow<'a, RenderOptions>,
        target: ErrorTarget,
    ) -> Self {
        let path_length = path::longest(&scene, number);
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
            _ if shows_much_rest(&scene) => sharing(moving_samples, &target),
            _ => (moving_samples, moving_samples),
        };
        let strata = Strata::new(&scene, number, samples, target.samples_max);
        let samples = strata.count();
        // Samples of unequal shares would give the positions unequal shares.
        let positions = if positions > 1 && strata.has_jumps() { samples } else { shared(positions, samples) };
        Self {
            scene,
            number,
            options,
            target,
            path_length,
            interleave,
            positions,
            strata,
            stats: Stats::default(),
            next: [Pair { coarse: 1, factor: 1, blocks: None }].into(),
            under_way: None,
            found: None,
        }
    }

    /// Begins the next pair, if one is left. Returns whether it did.
    ///
    /// # Errors
    /// As [`Backend::begin`]. Then nothing was begun.
    pub(crate) fn begin(&mut self, backend: &mut dyn Backend) -> Result<bool, BackendError> {
        let Some(pair) = self.next.pop_front() else { return Ok(false) };
        // Each frame has two older half buffers, and two that are under way, one of which is counted by itself.
        let held = 4 * backend.in_flight() as u64 - 1;
        let strata = self.strata.divided(pair.coarse);
        self.round(&pair, &strata).begin(backend, pair.blocks.as_ref(), held)?;
        self.under_way = Some(pair);
        Ok(true)
    }

    /// Waits for the pair that is under way, and mixes it with those before. After the last pair of a round it
    /// decides whether another round follows.
    ///
    /// # Errors
    /// As [`Backend::finish`].
    pub(crate) fn land(&mut self, backend: &mut dyn Backend) -> Result<(), BackendError> {
        let Some(pair) = self.under_way.take() else { return Ok(()) };
        let Some(mut found) = self.found.take() else {
            // The host looks behind the film while the device renders.
            let mut errors = self.errors();
            let half_buffers = HalfBuffers::land(backend, &mut self.stats)?;
            errors.measure(&half_buffers);
            let looser = self.target.error / ErrorTarget::GOOD;
            let flip = FLIP * if looser > 1.0 { looser.powi(2) } else { looser.powf(1.5) };
            let factors = factors(&errors, &self.target, flip, self.strata.count());
            let finer = factors.clone();
            self.refine(Found { half_buffers, errors, factors, finer });
            return Ok(());
        };
        let fresh = HalfBuffers::land(backend, &mut self.stats)?;
        if let Some(blocks) = &pair.blocks {
            let strata = self.strata.divided(pair.coarse);
            found.half_buffers.refine(&fresh, &self.round(&pair, &strata), blocks);
        }
        fresh.recycle(backend);
        if !self.is_round_done() {
            self.found = Some(found);
            return Ok(());
        }
        found.errors.measure_again(&found.half_buffers, &found.finer);
        let samples = self.strata.count();
        let fits = |samples: u32| {
            let all = u64::from(samples) * u64::from(self.interleave.stride().pow(2));
            BackendError::check_samples(&self.scene, all, self.options.memory).is_ok()
        };
        // What a round leaves above the target goes on, as far as it may.
        found.finer = more(&found.errors, &self.target, &found.factors, samples, fits);
        found.factors.iter_mut().zip(&found.finer).for_each(|(factor, more)| *factor *= more);
        self.refine(found);
        Ok(())
    }

    /// Is nothing left to begin or to wait for?
    pub(crate) fn is_done(&self) -> bool {
        self.found.is_some() && self.is_round_done()
    }

    /// The picture. `None`: the frame is not done.
    pub(crate) fn finish(self, backend: &mut dyn Backend) -> Option<Rendered> {
        let Found { half_buffers, errors, factors, .. } = self.found?;
        let Self { scene, number, target, path_length, mut stats, .. } = self;
        let samples = self.strata.count();
        // All other blocks went on until they were good enough.
        let is_capped = |(block, &factor): (&BlockError, &u32)| {
            let slack = if factor > 1 { SLACK } else { 1.0 };
            block.error() > slack * target.error
        };
        let capped = errors.blocks.iter().zip(&factors).filter(|&block| is_capped(block)).count() as u32;
        stats.achieved = Some(Achieved {
            error: errors.root_mean(),
            path_length,
            turn: turn::largest(&scene, number).to_degrees() / f64::from(samples),
            samples,
            most_samples: samples * factors.iter().copied().max().unwrap_or(1),
            interleave: self.interleave.stride(),
            blocks: factors.len() as u32,
            refined: factors.iter().filter(|&&factor| factor > 1).count() as u32,
            capped,
        });
        let backdrop = (!scene.image.transparent).then_some(&errors.behind.all);
        let mut picture = half_buffers.mean(backdrop, backend);
        let per_block = |value: &dyn Fn(usize) -> f32| spread(&errors, [picture.width, picture.height], value);
        let mut layers = Vec::new();
        if self.options.look.aovs.contains(&Aov::Samples) {
            let planes = vec![per_block(&|i| (samples * factors[i]) as f32)];
            layers.push(Layer { aov: Aov::Samples, planes, names: Vec::new() });
        }
        if self.options.look.aovs.contains(&Aov::Error) {
            let plane = per_block(&|i| errors.blocks[i].stated() as f32);
            let planes = vec![plane.clone(), plane.clone(), plane.clone(), plane];
            layers.push(Layer { aov: Aov::Error, planes, names: Vec::new() });
        }
        picture.layers.extend(layers);
        Some(Rendered { picture, stats })
    }

    /// Nothing measured yet.
    fn errors(&self) -> Errors {
        let Self { scene, number, interleave, .. } = self;
        let filter = self.options.look.filter;
        let background = Background { colour: scene.image.background, transparent: scene.image.transparent };
        let panorama = Panorama::of(scene, *number, None, filter).filter(|_| !scene.image.transparent);
        let behind = Behind::new(background, panorama.as_ref());
        let size = [scene.image.width, scene.image.height];
        let edge = Blocks::EDGE * interleave.stride() as usize;
        let step = self.path_length / f64::from(self.strata.count());
        Errors::new(size, edge, behind, *interleave, step, filter, self.target.white)
    }

    /// The round of a pair. `strata`: those of the rounds before.
    fn round<'r>(&'r self, pair: &Pair, strata: &'r Strata) -> Round<'r> {
        Round {
            scene: &self.scene,
            number: self.number,
            options: &self.options,
            interleave: self.interleave,
            strata,
            coarse: pair.coarse,
            factor: pair.factor,
            positions: if self.positions > 1 { self.positions * pair.coarse } else { 1 },
        }
    }

    fn is_round_done(&self) -> bool {
        self.next.is_empty() && self.under_way.is_none()
    }

    /// Plans the pairs for the blocks whose samples grow once more, by the factors `finer`. Blocks of one pair have the
    /// same factors, before it and in it.
    fn refine(&mut self, found: Found) {
        let Found { errors, factors, finer, .. } = &found;
        let steps: Vec<[u32; 2]> = factors.iter().zip(finer).map(|(&all, &factor)| [all / factor, factor]).collect();
        let mut pairs: Vec<[u32; 2]> = steps.iter().copied().filter(|[_, factor]| *factor > 1).collect();
        pairs.sort_unstable();
        pairs.dedup();
        self.next.extend(pairs.into_iter().map(|step @ [coarse, factor]| {
            let wanted = steps.iter().map(|&other| other == step).collect();
            Pair { coarse, factor, blocks: Some(Blocks { width: errors.width, wanted }) }
        }));
        self.found = Some(found);
    }
}

/// A value of each block as a plane of pixels.
fn spread(errors: &Errors, [width, height]: [u32; 2], value: &dyn Fn(usize) -> f32) -> Vec<f32> {
    let (columns, rows) = (width as usize, height as usize);
    let pixels = (0..rows).flat_map(|y| (0..columns).map(move |x| [x, y]));
    pixels.map(|[x, y]| value(y / errors.edge * errors.width + x / errors.edge)).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may stop")]
mod tests {
    use glam::{DMat3, DVec3};

    use crate::backend::cpu::Cpu;
    use crate::environment::{Environment, studio};
    use crate::math::{focal_length, srgb};
    use crate::options::RenderOptions;
    use crate::renderer::render_checked;
    use crate::sampling::pixel_offsets;
    use crate::scene::pose::camera_from_world;
    use crate::scene::{Motion, Scene};

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
        let rendered = render_checked(&mut Cpu::default(), &scene, 0.into(), &RenderOptions::default()).unwrap();
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
