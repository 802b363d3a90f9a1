//! Samples an image tile by tile and adds what the samples see to the sums.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::boxes::PACKET;
use super::cull::{Candidates, ObjectCones};
use super::gaussians::veil::Veil;
use super::layers::Surfaces;
use super::posed::World;
use super::sampler::{LightNumbers, Points, SCRAMBLINGS};
use super::sums::{NO_RANGE, PixelSums, Range, Sums, widen};
use super::trace::{SamplePoint, Seen, Tracer};
use super::warp::TimeWarp;
use crate::film::{Backdrop, FilmPlanes};
use crate::options::PixelFilter;
use crate::sampling::gaussian_offset;
use crate::time::FrameNumber;

/// Progress of a run. First the hierarchies are built: `end` is `samples` then, and no round was begun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundProgress {
    /// Samples of a pixel before this round.
    pub samples: u64,
    /// Samples of a pixel after this round.
    pub end: u64,
    /// Finished share of the round or of the hierarchies, 0..=1.
    pub share: f64,
    /// Mean standard error before this round, if the run looks at it.
    pub error: Option<f64>,
}

impl RoundProgress {
    /// Are the hierarchies being built?
    pub const fn is_building(&self) -> bool {
        self.end == self.samples
    }
}

/// Receives the progress of a run. It is called from several threads.
pub type RoundListener<'a> = &'a (dyn Fn(RoundProgress) + Sync);

/// Edge of a tile, pixels. The samples of a tile are traced together.
const TILE: usize = 4;

/// Points of each scrambling that are traced together.
const POINTS: u64 = 4;

/// Samples the pixels of an image, or of a window of it.
pub(super) struct Integrator<'w, 'a> {
    world: &'w World<'a>,
    warp: TimeWarp,
    pub cones: ObjectCones,
    frame: f64,
    /// First pixel of the window.
    origin: [u32; 2],
    /// The picture behind the window.
    backdrop: &'w Backdrop,
    /// Samples so far with more layers of see-through surfels than are taken.
    pub cut: AtomicU64,
}

impl<'w, 'a> Integrator<'w, 'a> {
    pub(super) fn new(world: &'w World<'a>, frame: FrameNumber, origin: [u32; 2], backdrop: &'w Backdrop) -> Self {
        let frame = frame.get();
        Self {
            world,
            warp: TimeWarp::new(&world.scene.shutter.weight),
            cones: ObjectCones::new(world, frame),
            frame,
            origin,
            backdrop,
            cut: AtomicU64::new(0),
        }
    }

    /// Brings every pixel of the window to `end` samples.
    pub(super) fn add(&self, sums: &mut Sums, end: u64, error: Option<f64>, progress: RoundListener<'_>) {
        let options = self.world.options;
        let each = SCRAMBLINGS as u64;
        let (first, last) = (sums.samples / each, end / each);
        let points = Points::new(options.sampler, options.look.seed, first, last, options.samples / each);
        let planes = FilmPlanes::of(&options.look.aovs);
        let strip = TILE * sums.width as usize;
        let strips = (sums.height as usize).div_ceil(TILE);
        let mut extras: Vec<&mut [f64]> = if sums.planes == 0 {
            (0..strips).map(|_| Default::default()).collect()
        } else {
            sums.extra.chunks_mut(strip * sums.planes).collect()
        };
        let finished = AtomicUsize::new(0);
        let (samples, width) = (sums.samples, sums.width as usize);
        let strips_of_sums = sums.colour.par_chunks_mut(strip).zip(sums.range.par_chunks_mut(strip)).zip(&mut extras);
        strips_of_sums.enumerate().for_each_init(
            || (Tracer::new(self.world), self.veil(), TileSamples::default()),
            |(tracer, veil, tile), (number, ((colour, range), extra))| {
                let before = number * strip;
                let mut strip = Strip { planes: &planes, backdrop: self.backdrop, first: before, colour, range, extra };
                if samples > 0 && veil.is_some() {
                    strip.restore_misses();
                }
                let rows = strip.colour.len() / width;
                for left in (0..width).step_by(TILE) {
                    let (first_pixel, size) = ([left, number * TILE], [TILE.min(width - left), rows]);
                    let corner = [0, 1].map(|axis| self.origin[axis] as usize + first_pixel[axis]);
                    self.cones.candidates(self.world, corner, size, &mut tile.candidates);
                    if tile.candidates.any == 0 {
                        continue;
                    }
                    for k in (first..last).step_by(POINTS as usize) {
                        // Here, because a strip of many samples takes minutes.
                        if self.world.is_stopped() {
                            return;
                        }
                        self.place_tile(tile, &points, (corner, size), width, k..(k + POINTS).min(last));
                        tile.trace(tracer, &self.cones, veil.as_mut());
                        tile.samples.iter().zip(&tile.seen).for_each(|(sample, seen)| {
                            if let Some(seen) = seen {
                                let own = self.own_background(seen, &sample.point, before + sample.pixel as usize);
                                strip.add(sample.pixel as usize, sample.scrambling as usize, seen, own);
                            }
                        });
                    }
                }
                self.cut.fetch_add(std::mem::take(&mut tile.surfaces.cut), Ordering::Relaxed);
                let done = finished.fetch_add(1, Ordering::Relaxed) + 1;
                progress(RoundProgress { samples, end, share: done as f64 / strips as f64, error });
            },
        );
        sums.samples = end;
    }

    /// What a covered sample takes off the mean background, and would not take off its own: the difference, times the
    /// coverage. Without it a camera that turns would show the mean beside what covers only a part of the exposure.
    fn own_background(&self, seen: &Seen, &SamplePoint { film, time, .. }: &SamplePoint, pixel: usize) -> DVec3 {
        let Some(environment) = self.world.scene.panorama() else { return DVec3::ZERO };
        (self.backdrop.at(pixel) - self.world.behind(environment, film, time)) * seen.coverage
    }

    /// What composites all that is see-through; `None` where nothing is.
    fn veil(&self) -> Option<Veil<'w, 'a>> {
        self.world.is_see_through().then(|| Veil::new(self.world))
    }

    /// Fills `tile` with the samples that may hit something. Each pixel of the tile (corner in the image, size) gets
    /// the points `range` of each scrambling. The window is `width` pixels wide.
    fn place_tile(
        &self,
        tile: &mut TileSamples,
        points: &Points,
        (corner, [columns, rows]): ([usize; 2], [usize; 2]),
        width: usize,
        range: std::ops::Range<u64>,
    ) {
        let left = corner[0] - self.origin[0] as usize;
        tile.samples.clear();
        for y in 0..rows {
            for x in 0..columns {
                let at = [(corner[0] + x) as u32, (corner[1] + y) as u32];
                let of_pixel = points.pixel(self.number(at));
                let scrambled: [_; SCRAMBLINGS] = std::array::from_fn(|r| of_pixel.scrambling(r));
                for k in range.clone() {
                    for (r, scrambling) in scrambled.iter().enumerate() {
                        let in_cube = scrambling.at(k);
                        let point = self.sample_point(at, in_cube, scrambling.lights(k));
                        if tile.candidates.any >> self.cones.subinterval(point.time) & 1 == 1 {
                            let pixel = (y * width + left + x) as u32;
                            tile.samples.push(PlacedSample {
                                point,
                                share: in_cube[2] as f32,
                                pixel,
                                scrambling: r as u32,
                            });
                        }
                    }
                }
            }
        }
    }

    /// Number of a pixel of the image, which its samples depend on.
    pub(super) fn number(&self, [x, y]: [u32; 2]) -> u64 {
        u64::from(y) * u64::from(self.world.size[0]) + u64::from(x)
    }

    /// Where and when the sample looks that has a point of the unit cube, and these points on lights.
    pub(super) fn sample_point(&self, pixel: [u32; 2], [u, v, share]: [f64; 3], lights: LightNumbers) -> SamplePoint {
        let [u, v] = match self.world.options.look.filter {
            PixelFilter::Box => [u, v],
            PixelFilter::Point => [0.5, 0.5],
            PixelFilter::Gaussian { sigma } => gaussian_offset([u, v]).map(|offset| 0.5 + sigma * offset),
        };
        let time = self.world.time(self.frame, pixel, self.warp.time(share));
        SamplePoint { film: [f64::from(pixel[0]) + u, f64::from(pixel[1]) + v], time, lights }
    }
}

/// A sample, and the sum that it is added to.
#[derive(Clone, Copy, Debug)]
struct PlacedSample {
    point: SamplePoint,
    /// Share of the exposure that has passed.
    share: f32,
    /// Number of its pixel in the strip.
    pixel: u32,
    scrambling: u32,
}

/// Some samples of a tile. They are traced in the order of their times, so that those of one packet meet the objects at
/// nearly the same places.
#[derive(Debug, Default)]
struct TileSamples {
    /// The objects that the samples may hit.
    candidates: Candidates,
    samples: Vec<PlacedSample>,
    /// What the samples see, in the order of `samples`.
    seen: Vec<Option<Seen>>,
    /// Numbers of the samples in the order of times.
    order: Vec<u32>,
    /// End of each stratum of times in `order`.
    ends: Vec<u32>,
    /// A group of samples: points, and what is seen of surfaces and then of all.
    points: Vec<SamplePoint>,
    surfaces: Surfaces,
}

/// Samples that captures are gathered for at once.
const GROUP: usize = 4 * PACKET;

/// Mean number of samples in one stratum of times.
const PER_STRATUM: usize = 8;

impl TileSamples {
    fn trace(&mut self, tracer: &mut Tracer<'_, '_>, cones: &ObjectCones, mut veil: Option<&mut Veil<'_, '_>>) {
        let n = self.samples.len();
        self.seen.resize(n, None);
        if n == 0 {
            return;
        }
        // A counting sort: within a stratum the order of samples stays.
        let strata = n.div_ceil(PER_STRATUM);
        let stratum = |sample: &PlacedSample| ((sample.share * strata as f32) as usize).min(strata - 1);
        self.ends.clear();
        self.ends.resize(strata + 1, 0);
        self.samples.iter().for_each(|sample| self.ends[stratum(sample) + 1] += 1);
        for i in 0..strata {
            self.ends[i + 1] += self.ends[i];
        }
        self.order.resize(n, 0);
        for (number, sample) in self.samples.iter().enumerate() {
            let end = &mut self.ends[stratum(sample)];
            self.order[*end as usize] = number as u32;
            *end += 1;
        }
        for group in self.order.chunks(GROUP) {
            self.points.clear();
            self.points.extend(group.iter().map(|&number| self.samples[number as usize].point));
            self.surfaces.clear();
            for points in self.points.chunks(PACKET) {
                tracer.hits(points, &self.candidates, cones);
                (0..points.len()).for_each(|lane| self.surfaces.add(tracer, lane));
            }
            if let Some(veil) = &mut veil {
                veil.composite(&self.points, &mut self.surfaces);
            }
            for (&number, seen) in group.iter().zip(&self.surfaces.opaque) {
                self.seen[number as usize] = *seen;
            }
        }
    }
}

/// The sums of a strip of pixels.
struct Strip<'a> {
    planes: &'a FilmPlanes,
    backdrop: &'a Backdrop,
    /// Number of its first pixel.
    first: usize,
    colour: &'a mut [PixelSums],
    range: &'a mut [Range],
    extra: &'a mut [f64],
}

impl Strip<'_> {
    /// Where anything see-through is in the scene every sample has a place in the range of its pixel, but the range of
    /// a pixel whose samples all saw nothing is not kept in files. It is that of one such sample.
    fn restore_misses(&mut self) {
        let missed = self.range.iter_mut().enumerate().filter(|(_, range)| **range == NO_RANGE);
        for (pixel, range) in missed {
            widen(range, self.backdrop.at(self.first + pixel).extend(0.0).as_vec4().to_array());
        }
    }

    fn add(&mut self, pixel: usize, scrambling: usize, seen: &Seen, own_background: DVec3) {
        let seen_colour = seen.colour + own_background;
        let sums = &mut self.colour[pixel][scrambling];
        sums[0] += seen_colour.x;
        sums[1] += seen_colour.y;
        sums[2] += seen_colour.z;
        sums[3] += seen.coverage;
        let colour = seen_colour + (1.0 - seen.coverage) * self.backdrop.at(self.first + pixel);
        widen(&mut self.range[pixel], colour.extend(seen.coverage).as_vec4().to_array());
        let planes = self.planes.count - 4;
        let extra = &mut self.extra[pixel * planes..][..planes];
        let mut add = |plane: Option<usize>, values: &[f64]| {
            if let Some(first) = plane {
                extra[first - 4..].iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            }
        };
        add(self.planes.depth, &[seen.depth]);
        add(self.planes.normal, &seen.normal.to_array());
        add(self.planes.velocity, &seen.velocity.to_array());
    }
}
