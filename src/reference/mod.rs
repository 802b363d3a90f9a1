//! The reference: the same scene by quasi-Monte-Carlo ray tracing (thesis 3.6.4, 4.5), with a standard error for each pixel.
//!
//! Every sample has a place in the pixel's square and a time of its own; the scene is posed at just that time, a ray is cast
//! through a hierarchy over each model's surfels, and the visibility rule and the kernel of design section 2 are evaluated in
//! `f64`. Nothing is shared with the passes that this is to judge. There is no screen-space prefilter: rays have no footprint, so
//! the reference is what a splatter without prefilter converges to. See docs/reference.md.

mod bvh;
mod posed;
mod probe;
mod reach;
mod sampler;
mod store;
mod sums;
mod trace;
mod traverse;
mod warp;

use std::time::{Duration, Instant};

use rayon::prelude::*;

use self::posed::World;
use self::reach::{Reach, Sights};
use self::sampler::Points;
use self::sums::PixelSums;
use self::trace::{Place, Seen, Tracer};
use self::traverse::PACKET;
use self::warp::TimeWarp;
use crate::film::{Aov, Background, FilmPlanes, Picture};
use crate::options::{PixelFilter, Shading};
use crate::scene::Scene;

pub use self::probe::{Probe, ProbedHit, Sample, probe};
pub use self::sampler::{SCRAMBLINGS, Sampler};
pub use self::sums::Sums;

/// Samples of a pixel in one round of a run that stops at an error.
pub const ROUND: u64 = 256;

/// Most samples of a pixel: each scrambling has 2^32 points.
pub const MOST_SAMPLES: u64 = 1 << 36;

/// How a reference is made.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// Samples of a pixel, a multiple of [`SCRAMBLINGS`]; with `error`, the most.
    pub samples: u64,
    /// Stop after the round ([`ROUND`] samples) in which the mean standard error falls below this.
    pub error: Option<f64>,
    /// How positions and times are chosen.
    pub sampler: Sampler,
    /// Positions over the pixel's square, or at its centre.
    pub filter: PixelFilter,
    /// Where shading happens.
    pub shading: Shading,
    /// Show back faces, with their normals turned to the viewer.
    pub two_sided: bool,
    /// Depth tolerance for all objects, world units, >= 0; overrides the scene's.
    pub epsilon: Option<f64>,
    /// Seed of positions and times.
    pub seed: u64,
    /// Extra channels, in the order of [`Aov::ALL`], each at most once.
    pub aovs: Vec<Aov>,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self {
            samples: 1024,
            error: None,
            sampler: Sampler::Sobol,
            filter: PixelFilter::Box,
            shading: Shading::Phong,
            two_sided: false,
            epsilon: None,
            seed: 1,
            aovs: Vec::new(),
        }
    }
}

impl ReferenceOptions {
    /// Whether there can be a reference with these options.
    ///
    /// # Errors
    /// The number of samples does not suit the scramblings, or the sampler cannot stop at an error.
    pub const fn check(&self) -> Result<(), ReferenceError> {
        let samples = self.samples;
        if samples == 0 || !samples.is_multiple_of(SCRAMBLINGS as u64) || samples > MOST_SAMPLES {
            return Err(ReferenceError::Samples { samples });
        }
        if self.error.is_some() && !self.sampler.is_progressive() {
            return Err(ReferenceError::Fixed);
        }
        Ok(())
    }
}

/// A finished reference.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The picture; its last layer is the standard error.
    pub picture: Picture,
    /// Partial sums, to go on from.
    pub sums: Sums,
    /// What it took.
    pub stats: Stats,
}

/// What a reference took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Samples of a pixel, those of earlier runs included.
    pub samples: u64,
    /// Samples of this run, over all pixels.
    pub traced: u64,
    /// Mean standard error over all pixels and r, g, b (of the picture) and coverage.
    pub mean_error: f64,
    /// Surfels of the distinct models.
    pub surfels: u64,
    /// Bytes of their hierarchies.
    pub hierarchy_bytes: u64,
    /// Bytes of the partial sums.
    pub sums_bytes: u64,
    /// Wall time of building the hierarchies.
    pub build: Duration,
    /// Wall time of tracing.
    pub trace: Duration,
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Samples of a pixel before this round.
    pub samples: u64,
    /// Samples of a pixel after it.
    pub end: u64,
    /// Finished share of the round, 0..=1.
    pub share: f64,
    /// Mean standard error before this round, where it is looked at.
    pub error: Option<f64>,
}

/// Told how far a run is; called from several threads.
pub type Progress<'a> = &'a (dyn Fn(Step) + Sync);

/// Why there is no reference.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The number of samples does not suit the scramblings.
    #[error(
        "{samples} samples cannot be shared by {SCRAMBLINGS} scramblings: a multiple of {SCRAMBLINGS} is needed, at most {MOST_SAMPLES}"
    )]
    Samples {
        /// What was asked for.
        samples: u64,
    },
    /// Jittered grids have a fixed size.
    #[error(
        "the jittered sampler has a fixed number of samples: it can neither stop at an error nor go on from an earlier run"
    )]
    Fixed,
    /// The image is too large.
    #[error("the sums of {width} x {height} pixels do not fit into memory")]
    Memory {
        /// Width of the image.
        width: u32,
        /// Height of the image.
        height: u32,
    },
    /// Bytes that should be partial sums are not.
    #[error("these are no partial sums of a reference, or they are damaged")]
    Damaged,
    /// The pixel is outside the image.
    #[error("pixel {x},{y} is outside the image of {width} x {height}")]
    NoPixel {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// Width of the image.
        width: u32,
        /// Height of the image.
        height: u32,
    },
    /// The sample is beyond the last one.
    #[error("sample {sample} is beyond the last of {samples} samples, {}", samples - 1)]
    NoSample {
        /// The sample.
        sample: u64,
        /// How many there are.
        samples: u64,
    },
    /// The earlier run was of another kind.
    #[error("the earlier run has {found}, this one {expected}")]
    Unlike {
        /// What the earlier run has.
        found: String,
        /// What is needed.
        expected: String,
    },
}

/// Makes the reference of one frame, from the beginning or from the sums of an earlier run with the same scene and options
/// (beside `samples` and `error`). If that run has as many samples as this one needs, none are added.
///
/// # Errors
/// The options contradict each other or the earlier run.
pub fn render(
    scene: &Scene,
    frame: i64,
    options: &ReferenceOptions,
    earlier: Option<Sums>,
    progress: Progress<'_>,
) -> Result<Reference, ReferenceError> {
    options.check()?;
    if !options.sampler.is_progressive() && earlier.is_some() {
        return Err(ReferenceError::Fixed);
    }
    let samples = options.samples;
    let size = [scene.image.width, scene.image.height];
    let mut sums = match earlier {
        Some(sums) => sums.like(size, &options.aovs)?,
        None => Sums::new(size, &options.aovs)?,
    };
    let start = Instant::now();
    let world = World::new(scene, frame, options);
    let build = start.elapsed();
    let start = Instant::now();
    let before = sums.samples;
    let background = background(scene);
    let integrator = Integrator::new(&world, frame, [0, 0]);
    if let Some(limit) = options.error {
        let mut error = None;
        while sums.samples < samples {
            if sums.samples > 0 {
                let now = sums.mean_error_of_even(background);
                error = Some(now);
                if now < limit {
                    break;
                }
            }
            let end = (sums.samples / ROUND * ROUND + ROUND).min(samples);
            integrator.add(&mut sums, end, error, progress);
        }
    } else if sums.samples < samples {
        integrator.add(&mut sums, samples, None, progress);
    }
    let stats = Stats {
        samples: sums.samples,
        traced: (sums.samples - before) * u64::from(size[0]) * u64::from(size[1]),
        mean_error: sums.mean_error(background),
        surfels: world.surfels(),
        hierarchy_bytes: world.models.iter().map(bvh::Bvh::bytes).sum(),
        sums_bytes: sums.bytes(),
        build,
        trace: start.elapsed(),
    };
    Ok(Reference { picture: sums.develop(&options.aovs, background), sums, stats })
}

/// What the picture of a scene is put over.
const fn background(scene: &Scene) -> Background {
    Background { colour: scene.image.background, transparent: scene.image.transparent }
}

/// Rows and columns of pixels whose samples are traced together.
const TILE: usize = 4;

/// Points of each scrambling that are traced together.
const POINTS: u64 = 4;

/// Samples the pixels of an image, or of a window in it.
struct Integrator<'w, 'a> {
    world: &'w World<'a>,
    warp: TimeWarp,
    reach: Reach,
    frame: f64,
    /// First pixel of the window.
    origin: [u32; 2],
}

impl<'w, 'a> Integrator<'w, 'a> {
    fn new(world: &'w World<'a>, frame: i64, origin: [u32; 2]) -> Self {
        let frame = frame as f64;
        Self { world, warp: TimeWarp::new(&world.scene.shutter.weight), reach: Reach::new(world, frame), frame, origin }
    }

    /// Brings every pixel of the window to `end` samples.
    fn add(&self, sums: &mut Sums, end: u64, error: Option<f64>, progress: Progress<'_>) {
        let options = self.world.options;
        let each = SCRAMBLINGS as u64;
        let (first, last) = (sums.samples / each, end / each);
        let points = Points::new(options.sampler, options.seed, first, last, options.samples / each);
        let planes = FilmPlanes::of(&options.aovs);
        let strip = TILE * sums.width as usize;
        let strips = (sums.height as usize).div_ceil(TILE);
        let mut extras: Vec<&mut [f64]> = if sums.planes == 0 {
            (0..strips).map(|_| Default::default()).collect()
        } else {
            sums.extra.chunks_mut(strip * sums.planes).collect()
        };
        let finished = std::sync::atomic::AtomicUsize::new(0);
        let (samples, width) = (sums.samples, sums.width as usize);
        let places = sums.colour.par_chunks_mut(strip).zip(sums.range.par_chunks_mut(strip)).zip(&mut extras);
        places.enumerate().for_each_init(
            || (Tracer::new(self.world), Batch::default()),
            |(tracer, batch), (number, ((colour, range), extra))| {
                let mut strip = Strip { planes: &planes, colour, range, extra };
                let rows = strip.colour.len() / width;
                for left in (0..width).step_by(TILE) {
                    let (first_pixel, size) = ([left, number * TILE], [TILE.min(width - left), rows]);
                    let corner = [0, 1].map(|axis| self.origin[axis] as usize + first_pixel[axis]);
                    self.reach.sights(self.world, corner, size, &mut batch.sights);
                    if batch.sights.any == 0 {
                        continue;
                    }
                    for k in (first..last).step_by(POINTS as usize) {
                        self.place_tile(batch, &points, (corner, size), width, k..(k + POINTS).min(last));
                        batch.trace(tracer, &self.reach);
                        batch.samples.iter().zip(&batch.seen).for_each(|(sample, seen)| {
                            if let Some(seen) = seen {
                                strip.add(sample.pixel as usize, sample.scrambling as usize, seen);
                            }
                        });
                    }
                }
                let done = finished.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
                progress(Step { samples, end, share: done as f64 / strips as f64, error });
            },
        );
        sums.samples = end;
    }

    /// The samples of a tile (corner in the image, size) that may hit something: of each of its pixels the points `range` of each
    /// scrambling. The window is `width` pixels wide.
    fn place_tile(
        &self,
        batch: &mut Batch,
        points: &Points,
        (corner, [columns, rows]): ([usize; 2], [usize; 2]),
        width: usize,
        range: std::ops::Range<u64>,
    ) {
        let left = corner[0] - self.origin[0] as usize;
        batch.samples.clear();
        for y in 0..rows {
            for x in 0..columns {
                let at = [(corner[0] + x) as u32, (corner[1] + y) as u32];
                let of_pixel = points.pixel(self.number(at));
                let scrambled: [_; SCRAMBLINGS] = std::array::from_fn(|r| of_pixel.scrambling(r));
                for k in range.clone() {
                    for (r, scrambling) in scrambled.iter().enumerate() {
                        let point = scrambling.at(k);
                        let place = self.place(at, point);
                        if batch.sights.any >> self.reach.slot(place.1) & 1 == 1 {
                            let pixel = (y * width + left + x) as u32;
                            batch.samples.push(Placed { place, share: point[2] as f32, pixel, scrambling: r as u32 });
                        }
                    }
                }
            }
        }
    }

    /// The number of a pixel of the image: what its samples depend on.
    fn number(&self, [x, y]: [u32; 2]) -> u64 {
        u64::from(y) * u64::from(self.world.size[0]) + u64::from(x)
    }

    /// Film point (pixels) and scene time (frames) of a point of the unit cube.
    fn place(&self, pixel: [u32; 2], [u, v, share]: [f64; 3]) -> ([f64; 2], f64) {
        let (u, v) = match self.world.options.filter {
            PixelFilter::Box => (u, v),
            PixelFilter::Point => (0.5, 0.5),
        };
        let time = self.world.scene.shutter.frame_time(self.frame, self.warp.time(share));
        ([f64::from(pixel[0]) + u, f64::from(pixel[1]) + v], time)
    }
}

/// A sample, and where it is added.
#[derive(Clone, Copy, Debug)]
struct Placed {
    place: Place,
    /// Share of the exposure that is over.
    share: f32,
    /// Pixel of the strip.
    pixel: u32,
    scrambling: u32,
}

/// Samples that are traced in the order of their times, so that those which go together meet the objects at nearly the same places.
#[derive(Debug, Default)]
struct Batch {
    /// What they may hit.
    sights: Sights,
    samples: Vec<Placed>,
    /// What they see, in their own order.
    seen: Vec<Option<Seen>>,
    /// Their numbers in the order of times.
    order: Vec<u32>,
    /// End of each interval of times in that order.
    ends: Vec<u32>,
}

/// Samples of one interval of times.
const INTERVAL: usize = 8;

impl Batch {
    fn trace(&mut self, tracer: &mut Tracer<'_, '_>, reach: &Reach) {
        let n = self.samples.len();
        self.seen.resize(n, None);
        if n == 0 {
            return;
        }
        // Sorted by counting: within an interval of times the order stays.
        let intervals = n.div_ceil(INTERVAL);
        let interval = |sample: &Placed| ((sample.share * intervals as f32) as usize).min(intervals - 1);
        self.ends.clear();
        self.ends.resize(intervals + 1, 0);
        self.samples.iter().for_each(|sample| self.ends[interval(sample) + 1] += 1);
        for i in 0..intervals {
            self.ends[i + 1] += self.ends[i];
        }
        self.order.resize(n, 0);
        for (number, sample) in self.samples.iter().enumerate() {
            let end = &mut self.ends[interval(sample)];
            self.order[*end as usize] = number as u32;
            *end += 1;
        }
        let mut places = [Place::default(); PACKET];
        for packet in self.order.chunks(PACKET) {
            for (place, &number) in places.iter_mut().zip(packet) {
                *place = self.samples[number as usize].place;
            }
            tracer.hits(&places[..packet.len()], &self.sights, reach);
            for (lane, &number) in packet.iter().enumerate() {
                self.seen[number as usize] = tracer.seen(lane);
            }
        }
    }
}

/// The sums of a strip of pixels.
struct Strip<'a> {
    planes: &'a FilmPlanes,
    colour: &'a mut [PixelSums],
    range: &'a mut [[[f32; 3]; 2]],
    extra: &'a mut [f64],
}

impl Strip<'_> {
    fn add(&mut self, pixel: usize, scrambling: usize, seen: &Seen) {
        let sums = &mut self.colour[pixel][scrambling];
        sums[0] += seen.colour.x;
        sums[1] += seen.colour.y;
        sums[2] += seen.colour.z;
        sums[3] += 1.0;
        let colour = seen.colour.as_vec3().to_array();
        let [low, high] = &mut self.range[pixel];
        for c in 0..3 {
            low[c] = low[c].min(colour[c]);
            high[c] = high[c].max(colour[c]);
        }
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
