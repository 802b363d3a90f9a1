//! Half buffers: the time samples of a frame in two halves, as two pictures.

use std::collections::BTreeMap;
use std::ops::Range;

use rayon::prelude::*;

use super::strata::Strata;
use crate::backend::{Backend, BackendError, Rendered, Stats};
use crate::film::{Aov, Backdrop, Picture, over};
use crate::frame::{Blocks, Frame};
use crate::options::{Interleave, RenderOptions};
use crate::plan::{Exposure, Group, PositionExposure, RasterExposure, TimeSample};
use crate::scene::Scene;
use crate::time::FrameNumber;

/// The time samples that one round of a frame adds. Each stratum of the rounds before it is divided by `factor`; the
/// round samples those that they have not sampled. The first round has `factor` 1 and samples all.
#[derive(Clone, Copy)]
pub(super) struct Round<'a> {
    pub scene: &'a Scene,
    pub number: FrameNumber,
    pub options: &'a RenderOptions,
    pub interleave: Interleave,
    /// Strata of the rounds before; the first round's own.
    pub strata: &'a Strata,
    /// By what the rounds before divided the strata of the first; odd.
    pub coarse: u32,
    /// Odd.
    pub factor: u32,
    /// Sub-pixel positions that share the samples of the rounds before, each with equally many; 1: the pixel's centre.
    pub positions: u32,
}

/// Where the time samples of one class of pixels lie within their strata.
struct StratumPlace {
    /// Place within a fine stratum, in [0, 1).
    fine: f64,
    /// The sample of coarse stratum i lies in fine stratum i * factor + `shift`.
    shift: u32,
}

impl Round<'_> {
    /// Class c of a lattice with stride S samples the first strata at (2c + 1) / 2S^2. With an odd factor, each coarse
    /// sample lies at such a place of a fine stratum.
    fn place(&self, phase: [u32; 2]) -> StratumPlace {
        let classes = f64::from(self.interleave.stride().pow(2));
        let first = (f64::from(self.interleave.order(phase)) + 0.5) / classes;
        let coarse = (f64::from(self.coarse) * first).fract();
        let scaled = f64::from(self.factor) * coarse;
        StratumPlace { fine: scaled.fract(), shift: scaled as u32 }
    }

    /// Has a coarser round sampled stratum `index`?
    fn is_reused(&self, place: &StratumPlace, index: u32) -> bool {
        self.factor > 1 && index % self.factor == place.shift
    }

    /// The half buffer of stratum `index`. The outer two of four strata belong to one, so that each half buffer is its
    /// own mirror image in time, and motion that turns at mid-exposure shows them different poses. The classes of a
    /// lattice sample their strata off the middle, so that mirrored strata differ: there the half buffers take turns,
    /// and samples of a coarser round stay in theirs wherever they lie within a stratum.
    fn half_of(&self, index: u32) -> u32 {
        if self.interleave == Interleave::None { index.div_ceil(2) % 2 } else { index % 2 }
    }

    /// The new samples of half buffer `half`; their weights sum to 1.
    fn exposure(&self, half: u32) -> Exposure {
        let raster = |phase| {
            let (positions, positions_of_picture) = self.positions(phase, half);
            RasterExposure { phase, positions, positions_of_picture }
        };
        Exposure { stride: self.interleave.stride(), rasters: self.interleave.phases().map(raster).collect() }
    }

    /// The sample positions of half buffer `half`, and how many the picture has.
    ///
    /// The new samples of both halves, in order of time, take positions in turn, as plain samples do. So the positions
    /// of each round cover the pixel and the exposure evenly (docs/measurements/scenes.md).
    fn positions(&self, phase: [u32; 2], half: u32) -> (Vec<PositionExposure>, usize) {
        let Self { scene, number, options, interleave, .. } = *self;
        let place = self.place(phase);
        let strata = self.strata.samples(&scene.shutter, self.factor, place.fine);
        let fresh = (0..).zip(strata).filter(|(index, _)| !self.is_reused(&place, *index)).enumerate();
        let of_half = fresh.filter(|(_, (index, _))| self.half_of(*index) == half);
        let of_half: Vec<(usize, (f64, f64))> = of_half.map(|(rank, (_, sample))| (rank, sample)).collect();
        let total: f64 = of_half.iter().map(|(_, (_, weight))| weight).sum();
        let seed = interleave.seed_of(phase, options.look.seed);
        let fresh_positions = self.positions * (self.factor - 1).max(1);
        let offsets = options.look.filter.offsets(fresh_positions, seed);
        // Points on lights go on where the rounds before ended.
        let before = if self.factor > 1 { self.coarse * self.strata.count() } else { 0 };
        let mut positions: BTreeMap<usize, PositionExposure> = BTreeMap::new();
        // The halves of a lattice take turns: each must have a run of points for itself.
        let (of_lattice, first) = (interleave != Interleave::None, half * of_half.len() as u32);
        for (n, (rank, (t, weight))) in (first..).zip(of_half) {
            let place = rank % offsets.len();
            let weight = if total > 0.0 { weight / total } else { 0.0 };
            let sample = TimeSample { time: scene.shutter.frame_time(number.get(), t), weight };
            let position = || PositionExposure { offset: offsets[place], groups: Vec::new() };
            positions.entry(place).or_insert_with(position).groups.push(Group {
                samples: vec![sample],
                sweep: None,
                number: before + if of_lattice { n } else { rank as u32 },
            });
        }
        let of_picture = if offsets.len() > 1 { self.positions * self.factor } else { 1 };
        (positions.into_values().collect(), of_picture as usize)
    }

    /// Begins to render both half buffers in the wanted blocks. `held`: pictures that are kept meanwhile, beside the
    /// one that is rendered.
    pub(super) fn begin(
        &self,
        backend: &mut dyn Backend,
        wanted: Option<&Blocks>,
        held: u64,
    ) -> Result<(), BackendError> {
        for half in 0..2 {
            let begun = self.frame(half, wanted, held).and_then(|frame| backend.begin(frame));
            if begun.is_err() && half > 0 {
                backend.abandon();
            }
            begun?;
        }
        Ok(())
    }

    /// The new samples of half buffer `half` in the wanted blocks.
    fn frame(&self, half: usize, wanted: Option<&Blocks>, held: u64) -> Result<Frame, BackendError> {
        let exposure = self.exposure(half as u32);
        let samples: usize = exposure.groups().map(|group| group.samples.len()).sum();
        BackendError::check_samples(self.scene, samples as u64, self.options.memory)?;
        let mut frame = Frame::exposed(self.scene, self.number, &exposure, self.options);
        frame.leaves_background = true;
        frame.wanted = wanted.cloned();
        frame.picture_bytes = held * picture_bytes(&frame);
        Ok(frame)
    }
}

/// Means over each half of the samples, without a background.
pub(super) struct HalfBuffers([Picture; 2]);

impl HalfBuffers {
    /// Waits for the two that were begun first.
    pub(super) fn land(backend: &mut dyn Backend, stats: &mut Stats) -> Result<Self, BackendError> {
        let mut half = || -> Result<Picture, BackendError> {
            let Some(Rendered { mut picture, stats: of_half }) = backend.finish()? else {
                unreachable!("both halves were begun")
            };
            stats.add(&of_half);
            picture.layers.retain(|layer| layer.aov != Aov::Samples);
            Ok(picture)
        };
        // Both leave the backend, even if one has failed.
        let [even, odd] = [half(), half()];
        Ok(Self([even?, odd?]))
    }

    /// Both half buffers.
    pub(super) const fn pictures(&self) -> &[Picture; 2] {
        &self.0
    }

    /// Adds the samples of `round`, whose half buffers are `fresh`, in the wanted blocks.
    pub(super) fn refine(&mut self, fresh: &Self, round: &Round<'_>, blocks: &Blocks) {
        let stride = round.interleave.stride() as usize;
        let width = self.0[0].width as usize;
        // Strata move to the other half buffer where the finer ones that they lie in belong to it.
        let swaps: Vec<bool> = (0..stride * stride)
            .map(|class| round.half_of(round.place([class % stride, class / stride].map(|p| p as u32)).shift) == 1)
            .collect();
        let columns = |y: usize| Blocks::columns(Some(blocks), y, width, stride);
        let [even, odd] = &mut self.0;
        swap_pixels(even, odd, &columns, &|x, y| swaps[y % stride * stride + x % stride]);
        let mixed = Mixed { columns: &columns, share: 1.0 / round.factor as f32, behind: None };
        mixed.mix(even, &fresh.0[0]);
        mixed.mix(odd, &fresh.0[1]);
    }

    /// Returns the memory of the pictures to the backend.
    pub(super) fn recycle(self, backend: &mut dyn Backend) {
        self.0.into_iter().for_each(|picture| backend.recycle(picture));
    }

    /// The mean of both half buffers, over what is `behind` if there is anything.
    pub(super) fn mean(self, behind: Option<&Backdrop>, backend: &mut dyn Backend) -> Picture {
        let [mut mean, odd] = self.0;
        let width = mean.width as usize;
        let columns = |y: usize| Blocks::columns(None, y, width, 1);
        Mixed { columns: &columns, share: 0.5, behind }.mix(&mut mean, &odd);
        backend.recycle(odd);
        mean
    }
}

/// Bytes of a picture of `frame`.
fn picture_bytes(frame: &Frame) -> u64 {
    let planes = 4 + frame.aovs.iter().map(|aov| aov.channels().len() as u64).sum::<u64>();
    u64::from(frame.size[0]) * u64::from(frame.size[1]) * planes * size_of::<f32>() as u64
}

/// Columns of a row.
type Columns<'a> = &'a (dyn Fn(usize) -> Vec<Range<usize>> + Sync);

/// Swaps the pixels of `columns` for which `which` is true. Arguments of `which`: column and row.
fn swap_pixels(a: &mut Picture, b: &mut Picture, columns: Columns<'_>, which: &(dyn Fn(usize, usize) -> bool + Sync)) {
    let width = a.width as usize;
    let swap_row = |y: usize, swap: &mut dyn FnMut(usize)| {
        columns(y).into_iter().flatten().filter(|&x| which(x, y)).for_each(swap);
    };
    let rows = a.rgba.par_chunks_mut(width).zip(b.rgba.par_chunks_mut(width)).enumerate();
    rows.for_each(|(y, (a, b))| swap_row(y, &mut |x| std::mem::swap(&mut a[x], &mut b[x])));
    let layers = a.layers.iter_mut().zip(&mut b.layers);
    for (a, b) in layers.flat_map(|(a, b)| a.planes.iter_mut().zip(&mut b.planes)) {
        let rows = a.par_chunks_mut(width).zip(b.par_chunks_mut(width)).enumerate();
        rows.for_each(|(y, (a, b))| swap_row(y, &mut |x| std::mem::swap(&mut a[x], &mut b[x])));
    }
}

/// Weights and place of the mean of two pictures.
struct Mixed<'a> {
    /// Columns of a row that are mixed.
    columns: Columns<'a>,
    /// Share of the first picture.
    share: f32,
    /// The picture behind; `None`: the result stays transparent.
    behind: Option<&'a Backdrop>,
}

impl Mixed<'_> {
    /// Replaces `a` by the mean of `a` and `b`. Channels that are means over the covered part of a pixel are weighted
    /// by coverage.
    fn mix(&self, a: &mut Picture, b: &Picture) {
        let width = a.width as usize;
        let share = self.share;
        for (layer, of_b) in a.layers.iter_mut().zip(&b.layers) {
            for (plane, of_b) in layer.planes.iter_mut().zip(&of_b.planes) {
                let linear = layer.aov == Aov::Alpha;
                let colours = a.rgba.par_chunks(width).zip(b.rgba.par_chunks(width));
                let rows = plane.par_chunks_mut(width).zip(of_b.par_chunks(width)).zip(colours).enumerate();
                rows.for_each(|(y, ((values, others), (a, b)))| {
                    for x in (self.columns)(y).into_iter().flatten() {
                        let by = if linear { [share, 1.0 - share] } else { [share * a[x][3], (1.0 - share) * b[x][3]] };
                        // Where a picture covers nothing, its value may be infinite.
                        values[x] = match by {
                            [_, 0.0] => values[x],
                            [0.0, _] => others[x],
                            [of_a, of_b] => (of_a * values[x] + of_b * others[x]) / (of_a + of_b),
                        };
                    }
                });
            }
        }
        let rows = a.rgba.par_chunks_mut(width).zip(b.rgba.par_chunks(width)).enumerate();
        rows.for_each(|(y, (a, b))| {
            for span in (self.columns)(y) {
                let first = y * width + span.start;
                let pixels = a[span.clone()].iter_mut().zip(&b[span]).enumerate();
                pixels.for_each(|(x, (a, b))| *a = self.pixel(first + x, a, b));
            }
        });
    }

    fn pixel(&self, at: usize, a: &[f32; 4], b: &[f32; 4]) -> [f32; 4] {
        let share = self.share;
        let mixed @ [r, g, b, alpha] = [0, 1, 2, 3].map(|c| share * a[c] + (1.0 - share) * b[c]);
        let Some(behind) = self.behind else { return mixed };
        let [r, g, b] = over([r, g, b], 1.0 - alpha, behind.at(at).as_vec3().to_array());
        [r, g, b, 1.0]
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::model::generate;
    use crate::sampling::pixel_offsets;
    use crate::scene::{Camera, Motion, Object};
    use crate::time::{Shutter, Weight};

    fn scene(weight: Weight) -> Scene {
        let mut scene = Scene::new([]);
        scene.shutter = Shutter { open: 0.0, close: 1.0, weight, ..Shutter::default() };
        scene
    }

    /// A round of frame 0 in which `strata` share `positions`.
    fn round<'a>(
        scene: &'a Scene,
        options: &'a RenderOptions,
        interleave: Interleave,
        strata: &'a Strata,
        (positions, factor): (u32, u32),
    ) -> Round<'a> {
        Round { scene, number: 0.into(), options, interleave, strata, coarse: 1, factor, positions }
    }

    /// The first samples and those of a finer round are those of so many times as many: none is lost, none comes twice,
    /// and both half buffers have as many.
    #[test]
    fn both_rounds_together_sample_each_stratum_once() {
        let options = RenderOptions::default();
        for (interleave, weight) in [
            (Interleave::None, Weight::Box),
            (Interleave::Two, Weight::Box),
            (Interleave::Two, Weight::Exponential { rate: 3.0, centre: 0.2 }),
        ] {
            let scene = scene(weight);
            let strata = Strata::new(&scene, 0.into(), 12, 256);
            let round = |factor| round(&scene, &options, interleave, &strata, (12, factor));
            let times = |round: Round<'_>, half: u32, class: usize| -> Vec<f64> {
                let exposure = round.exposure(half);
                let positions = exposure.rasters[class].positions.iter();
                positions.flat_map(|p| &p.groups).flat_map(|group| &group.samples).map(|sample| sample.time).collect()
            };
            for (class, factor) in (0..interleave.stride().pow(2) as usize).flat_map(|c| [3, 7, 45].map(|f| (c, f))) {
                let [even, odd] = [0, 1].map(|half| -> Vec<f64> {
                    [round(1), round(factor)].iter().flat_map(|&of_round| times(of_round, half, class)).collect()
                });
                assert_eq!((even.len(), odd.len()), (6 * factor as usize, 6 * factor as usize));
                let mut all = [even, odd].concat();
                all.sort_by(f64::total_cmp);
                let phase = interleave.phases().nth(class).unwrap_or_default();
                let direct = strata.samples(&scene.shutter, factor, round(factor).place(phase).fine);
                for (time, (wanted, _)) in all.iter().zip(direct) {
                    assert!((time - wanted).abs() < 1e-12, "{interleave:?}, class {class}: {time} for {wanted}");
                }
            }
        }
    }

    /// A third round adds to two the samples that they lack of so many times as many.
    #[test]
    fn a_third_round_samples_what_two_have_left() {
        let options = RenderOptions::default();
        let scene = scene(Weight::Ramp { centre: 1.0 });
        for interleave in [Interleave::None, Interleave::Two] {
            let strata = Strata::new(&scene, 0.into(), 8, 1 << 12);
            let first = round(&scene, &options, interleave, &strata, (8, 1));
            let divided = strata.divided(3);
            let rounds = [
                first,
                Round { factor: 3, ..first },
                Round { strata: &divided, coarse: 3, factor: 5, positions: 24, ..first },
            ];
            for (class, phase) in interleave.phases().enumerate() {
                let of_round = |round: &Round<'_>| -> Vec<(f64, [u32; 2])> {
                    let halves = [0, 1].map(|half| round.exposure(half).rasters.swap_remove(class).positions);
                    assert_eq!(halves[0].len(), halves[1].len());
                    let positions = halves.into_iter().flatten();
                    let times = positions.flat_map(|position| {
                        let offset = position.offset.map(f32::to_bits);
                        position.groups.into_iter().map(move |group| (group.samples[0].time, offset))
                    });
                    times.collect()
                };
                let mut all: Vec<(f64, [u32; 2])> = rounds.iter().flat_map(of_round).collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0));
                let place = Round { factor: 15, ..first }.place(phase).fine;
                let direct = strata.samples(&scene.shutter, 15, place);
                assert_eq!(all.len(), direct.len());
                for ((time, _), (wanted, _)) in all.iter().zip(direct) {
                    assert!((time - wanted).abs() < 1e-12, "{interleave:?}, class {class}: {time} for {wanted}");
                }
                // Of 120 samples no more than a few see the same place.
                all.sort_by_key(|(_, offset)| *offset);
                all.dedup_by_key(|(_, offset)| *offset);
                assert!(all.len() >= 110, "{} places", all.len());
            }
        }
    }

    /// A chequered ball beside the axis that it turns about: its outline sweeps over the background, and its cells over
    /// each other.
    fn turning_ball() -> Scene {
        let mut ball = Object::from_cloud(generate::sphere(3000)).unwrap();
        ball.transform.scale = DVec3::splat(0.5);
        ball.transform.translate = DVec3::new(0.2, 0.0, 0.0);
        ball.motions.push(Motion::Rotation { axis: DVec3::Z, per_frame: 0.6, centre: DVec3::ZERO });
        let mut scene = Scene::new([ball]);
        scene.camera = Camera::new(DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO);
        (scene.image.width, scene.image.height) = (64, 36);
        scene
    }

    /// Half buffers that were refined by 3 and then by 5 are those of 15 times the strata, each sample in its half.
    fn refined_twice_as_rendered_at_once(interleave: Interleave) {
        let scene = turning_ball();
        let mut options = RenderOptions::default();
        options.look.filter = crate::options::PixelFilter::Point;
        // Points on a light belong to the number of a sample, which is another one in each round.
        options.look.shadows = false;
        let mut cpu = crate::backend::cpu::Cpu::default();
        let strata = Strata::new(&scene, 8.into(), 4, 1 << 12);
        let first = Round { number: 8.into(), ..round(&scene, &options, interleave, &strata, (1, 1)) };
        let mut render = |round: &Round<'_>| {
            round.begin(&mut cpu, None, 3).unwrap();
            HalfBuffers::land(&mut cpu, &mut Stats::default()).unwrap()
        };
        let all = Blocks { width: 2, wanted: vec![true; 4] };
        let mut refined = render(&first);
        let mut coarse = 1;
        for factor in [3, 5] {
            let strata = strata.divided(coarse);
            let round = Round { strata: &strata, coarse, factor, ..first };
            let fresh = render(&round);
            refined.refine(&fresh, &round, &all);
            coarse *= factor;
        }
        let strata = strata.divided(15);
        let direct = render(&Round { strata: &strata, coarse: 15, ..first });
        for (refined, direct) in refined.pictures().iter().zip(direct.pictures()) {
            for (a, b) in refined.rgba.iter().flatten().zip(direct.rgba.iter().flatten()) {
                assert!((a - b).abs() < 1e-5, "{interleave:?}: {a} for {b}");
            }
        }
        let [even, odd] = direct.pictures();
        let differ = even.rgba.iter().zip(&odd.rgba).filter(|(a, b)| a != b).count();
        assert!(differ > 100, "{differ} pixels differ between the halves");
    }

    #[test]
    fn refined_twice_is_rendered_at_once() {
        refined_twice_as_rendered_at_once(Interleave::None);
    }

    #[test]
    #[ignore = "deep: whole pictures"]
    fn refined_twice_is_rendered_at_once_on_a_lattice() {
        refined_twice_as_rendered_at_once(Interleave::Two);
    }

    /// Each half buffer is its own mirror image in time, and the other one's times are none of it: motion that turns at
    /// mid-exposure shows them different poses.
    #[test]
    fn half_buffers_are_their_own_mirror_images() {
        let options = RenderOptions::default();
        let scene = scene(Weight::Box);
        for (samples, factor) in [(4, 1), (8, 1), (20, 1), (12, 3), (8, 45)] {
            let strata = Strata::new(&scene, 0.into(), samples, 1 << 12);
            let round = round(&scene, &options, Interleave::None, &strata, (samples, factor));
            let times = |half: u32| -> Vec<f64> {
                let exposure = round.exposure(half);
                let mut times: Vec<f64> = exposure.groups().map(|group| group.samples[0].time).collect();
                times.sort_by(f64::total_cmp);
                times
            };
            let halves = [times(0), times(1)];
            for half in &halves {
                let mirrored = half.iter().rev().map(|time| 1.0 - time);
                assert!(half.iter().zip(mirrored).all(|(a, b)| (a - b).abs() < 1e-9), "{samples} x {factor}: {half:?}");
            }
            assert_eq!(halves[0].len(), halves[1].len());
            assert!(halves[0].iter().all(|a| halves[1].iter().all(|b| (a - b).abs() > 1e-9)));
        }
    }

    /// Both half buffers together have the positions of plain samples, in the same order of time, in each round.
    #[test]
    fn positions_are_those_of_plain_samples() {
        let options = RenderOptions::default();
        let scene = scene(Weight::Box);
        for (samples, shared, factor) in [(8, 8, 1), (16, 8, 1), (12, 12, 3), (16, 8, 3), (8, 8, 45)] {
            let strata = Strata::new(&scene, 0.into(), samples, 256);
            let round = round(&scene, &options, Interleave::None, &strata, (shared, factor));
            let mut taken: Vec<(f64, [f32; 2])> = Vec::new();
            for exposure in [0, 1].map(|half| round.exposure(half)) {
                assert_eq!(exposure.rasters[0].positions_of_picture, (shared * factor) as usize);
                for position in &exposure.rasters[0].positions {
                    taken.extend(position.groups.iter().map(|group| (group.samples[0].time, position.offset)));
                }
            }
            taken.sort_by(|a, b| a.0.total_cmp(&b.0));
            let wanted = pixel_offsets(shared * (factor - 1).max(1), options.look.seed);
            assert_eq!(taken.len(), (samples * (factor - 1).max(1)) as usize);
            let offsets = taken.iter().map(|(_, offset)| offset);
            assert!(offsets.zip(wanted.iter().cycle()).all(|(a, b)| a == b), "{samples} at {shared} x {factor}");
        }
    }
}
