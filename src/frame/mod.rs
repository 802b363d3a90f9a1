//! One frame, posed: all that a backend needs to execute a plan, as plain values.
//!
//! Transforms are composed in `f64` and only then rounded, so that far-away world coordinates cost no precision. A
//! frame owns all that it names: a backend may render it later, or a second time.

mod blocks;
mod panorama;
mod pixel_rect;
mod poser;
mod raster;
mod static_objects;
mod strips;

use std::ops::Range;
use std::sync::Arc;

use crate::environment::{Environment, Surroundings};
use crate::film::{Aov, Backdrop, Background, Blending, FilmPlanes};
use crate::math::focal_length;
use crate::model::paths::{OwnPaths, Paths};
use crate::model::{Gaussians, Material, Optics, Surfels};
use crate::options::{BlurMode, Normalise, PixelFilter, Prefilter, RenderOptions, Shading, SweptKernel};
use crate::plan::{Exposure, Group, PosedInterval, PositionExposure, Published, Scenery, Step, TimeSample};
use crate::scene::pose::{jumps, seams};
use crate::scene::{Capture, Light, Object, Scene};
use crate::stop::Stop;
use crate::time::FrameNumber;

pub use self::blocks::Blocks;
pub use self::panorama::Panorama;
pub(crate) use self::pixel_rect::PixelRect;
pub use self::poser::{PosedObject, PosedSample};
use self::poser::{Poser, Span};
use self::raster::low_pass_radius;
pub use self::raster::{Raster, RasterArea};
pub use self::static_objects::STATIC_PATH;
use self::static_objects::find_static;
use self::strips::Strips;

/// Longest path over the raster within a slice of an interval, pixels.
const SLICE_PATH: u32 = 4;

/// One frame, posed.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Pixels of the image from one pixel of a raster to the next, along both axes.
    pub stride: u32,
    /// Nearest visible depth, scene units.
    pub near: f32,
    /// Screen-space prefilter.
    pub prefilter: Prefilter,
    /// Where shading happens.
    pub shading: Shading,
    /// Extra channels.
    pub aovs: Vec<Aov>,
    /// What surfaces mirror; `None` where no surface does.
    pub surroundings: Option<Surroundings>,
    /// The background behind the film. What is transparent is composited over it, instant by instant.
    pub background: Background,
    /// What replaces the background's colour.
    pub panorama: Option<Panorama>,
    /// The picture is the film as it is, for a caller that lays several over the background.
    pub leaves_background: bool,
    /// How transparent things are composited; `None` where there are none.
    pub blending: Option<Blending>,
    /// Bytes that the frame and its models may take.
    pub memory: u64,
    /// Bytes that the models and what surrounds them take; a model shared by several objects counts once.
    pub model_bytes: u64,
    /// Bytes of pictures that the caller holds beside the frame's own.
    pub picture_bytes: u64,
    /// The kernel that the frame's steps sweep; `None` where its samples are instants.
    pub swept: Option<SweptKernel>,
    /// Objects that can be seen at some sample, in document order.
    pub objects: Vec<FrameObject>,
    /// One for each class of pixels of each strip that is read out by itself: those of the first strip first.
    pub rasters: Vec<PosedRaster>,
    /// The blocks of the image that are rendered; the others stay empty. `None`: all.
    pub wanted: Option<Blocks>,
}

/// A raster and its sample positions.
#[derive(Clone, Debug)]
pub struct PosedRaster {
    /// Its pixels; none where the image is smaller than the phase.
    pub area: RasterArea,
    /// In the order in which they are rendered.
    pub positions: Vec<Position>,
}

/// A sample position of a raster: its posed samples, and the steps that render them.
#[derive(Clone, Debug)]
pub struct Position {
    /// The raster, with the position's offset.
    pub raster: Raster,
    /// Rising in time; [`Self::steps`] name them by index.
    pub groups: Vec<PosedGroup>,
    /// In order.
    pub steps: Vec<Step>,
}

/// Posed samples that share one visibility test and one resolve.
#[derive(Clone, Debug)]
pub struct PosedGroup {
    /// At least one, rising in time.
    pub samples: Vec<PosedSample>,
}

/// The properties of an object that do not change during the frame.
#[derive(Clone, Debug)]
pub struct FrameObject {
    /// The surfels. They are shared, so that a backend can recognise a model that it has already uploaded.
    pub surfels: Arc<Surfels>,
    /// Paths of the surfels that are not their own.
    pub own_paths: Option<Arc<OwnPaths>>,
    /// The Gaussians of a capture; such an object has no surfels.
    pub gaussians: Option<Arc<Gaussians>>,
    /// How they are drawn, as the scene says.
    pub capture: Capture,
    /// Does light pass through its surfels?
    pub see_through: bool,
    /// Factor on the opacities of its surfels.
    pub opacity: f32,
    /// Share of the surroundings that its surfels mirror.
    pub reflection: f32,
    /// Material of the whole object; `None`: one per surfel, `surfels.material`.
    pub material: Option<Material>,
    /// Show back faces, with normals turned to the viewer.
    pub two_sided: bool,
    /// Has the same pose in all samples. Its splats come first in the order of sums, and count once in a group.
    pub is_static: bool,
}

impl FrameObject {
    /// Is it a volume?
    pub fn is_volume(&self) -> bool {
        self.gaussians.as_ref().is_some_and(|gaussians| gaussians.optics != Optics::Alpha)
    }

    /// How its surfels move by themselves.
    pub fn paths(&self) -> Paths<'_> {
        self.own_paths.as_ref().map_or_else(|| self.surfels.paths(), |own| own.paths())
    }

    /// Number of surfels or Gaussians.
    pub fn elements(&self) -> usize {
        self.gaussians.as_ref().map_or(self.surfels.len(), |gaussians| gaussians.len())
    }
}

impl Position {
    /// Interval and kernel of each group; `None` where samples are instants.
    fn sweeps(&self) -> Vec<Option<(PosedInterval, SweptKernel)>> {
        let of_group = |wanted: usize| {
            self.steps.iter().find_map(|step| match *step {
                Step::Sweep { group, interval, kernel } if group == wanted => Some((interval, kernel)),
                Step::Published { group, part: Published::Sweep { interval, kernel } } if group == wanted => {
                    Some((interval, kernel))
                }
                _ => None,
            })
        };
        (0..self.groups.len()).map(of_group).collect()
    }
}

impl Frame {
    /// Poses `scene` at every time sample that `mode` takes of frame `number`; `options` without their quality.
    pub fn new(scene: &Scene, number: impl Into<FrameNumber>, mode: BlurMode, options: &RenderOptions) -> Self {
        Self::until(scene, number.into(), mode, options, &Stop::default())
    }

    /// As [`new`](Self::new), but it ends soon after `stop` is set: then the frame lacks samples, and is of no use.
    pub fn until(scene: &Scene, number: FrameNumber, mode: BlurMode, options: &RenderOptions, stop: &Stop) -> Self {
        let jumps = mode.swept().map_or_else(Vec::new, |_| {
            let at = |t: f64| scene.shutter.frame_time(number.get(), t);
            let mut times = jumps(scene, at(0.0), at(1.0));
            times.extend(seams(scene, at(0.0), at(1.0)));
            times.sort_by(f64::total_cmp);
            times.dedup();
            times
        });
        let exposure = Exposure::new(mode, options.filter, options.seed, &scene.shutter, number.get(), &jumps);
        Self::posed(scene, number, &exposure, options, stop)
    }

    /// Poses `scene` at every time sample of `exposure`, which is one of frame `number`.
    pub fn exposed(scene: &Scene, number: FrameNumber, exposure: &Exposure, options: &RenderOptions) -> Self {
        Self::posed(scene, number, exposure, options, &Stop::default())
    }

    fn posed(scene: &Scene, number: FrameNumber, exposure: &Exposure, options: &RenderOptions, stop: &Stop) -> Self {
        let swept = exposure.groups().find_map(|group| group.sweep).map(|(_, kernel)| kernel);
        let size = [scene.image.width, scene.image.height];
        let focal = focal_length(f64::from(size[1]), scene.camera.fovy);
        let poser = Poser { scene, number: number.get(), focal: focal / f64::from(exposure.stride), options };
        let mut sweeps: Vec<Option<(PosedInterval, SweptKernel)>> = Vec::new();
        let mut times: Vec<f64> = Vec::new();
        let samples = exposure.groups().map(|group| group.samples.len()).sum();
        let strips = Strips::of(scene, number, ends_of(exposure), samples, exposure.stride);
        let see_through = scene.objects.iter().any(Object::is_see_through);
        let ranges: Vec<Option<Range<u32>>> =
            strips.as_ref().map_or_else(|| vec![None], |strips| strips.ranges().map(Some).collect());
        let mut rasters: Vec<PosedRaster> = ranges
            .iter()
            .flat_map(|range| exposure.rasters.iter().map(move |of_raster| (range.as_ref(), of_raster)))
            .map(|(range, of_raster)| {
                let (sigma, spread) = filter_of(options, swept, of_raster.positions_of_picture, exposure.stride);
                let footprint = footprint(options, swept, of_raster.positions_of_picture, exposure.stride);
                let square = 1.0 / 12.0 / of_raster.positions_of_picture as f64;
                let of_square = (square.sqrt() / f64::from(exposure.stride)) as f32;
                let pixel = if sigma > 0.0 { sigma } else { of_square };
                let lens = (focal, scene.camera.shift);
                let whole = Raster::new(size, lens, exposure.stride, of_raster.phase, [0.0; 2], None);
                let whole = Raster { sigma, ..whole };
                let peeled = if see_through { whole.for_see_through(options.prefilter).apron() } else { 0 };
                let strip = strips.as_ref().zip(range).map(|(strips, range)| {
                    let apron = whole.apron().max(peeled) as u32;
                    (strips, range, Strips::with_apron(range, apron, whole.size[strips.axis()]))
                });
                let delay = strip.as_ref().map(|(strips, range, around)| strips.delay(range, around, of_raster.phase));
                let strip = strip.map(|(strips, _, around)| (strips.axis(), around));
                let strip = strip.as_ref().map(|(axis, around)| (*axis, around));
                let raster = |offset| Raster::new(size, lens, exposure.stride, of_raster.phase, offset, strip);
                let positions = of_raster.positions.iter().take_while(|_| !stop.is_set()).map(|position| {
                    let raster = raster(position.offset.map(|v| v * spread));
                    let groups = position.groups.iter().map(|group| {
                        let interval = group.sweep.map(|(interval, _)| interval);
                        let pose = |sample: &TimeSample| {
                            let time = sample.time + delay.map_or(0.0, |delay| delay.middle);
                            times.push(time);
                            let span = interval.as_ref().map(Span::swept);
                            let span = span.or_else(|| delay.and_then(|delay| Span::read_out(time, delay)));
                            poser.sample(time, sample.weight, span.as_ref())
                        };
                        let samples: Vec<PosedSample> = group.samples.iter().map(pose).collect();
                        let posed = |(interval, kernel)| (poser.interval(&interval, &samples, raster.size), kernel);
                        sweeps.push(group.sweep.map(posed));
                        PosedGroup { samples }
                    });
                    Position {
                        raster: Raster { sigma, footprint, pixel, ..raster },
                        groups: groups.collect(),
                        steps: Vec::new(),
                    }
                });
                PosedRaster { positions: positions.collect(), area: raster([0.0; 2]).area(range) }
            })
            .collect();
        // One size of map for all intervals: on the GPU the thresholds of static objects are stored behind it.
        let guard = sweeps.iter().flatten().map(|(interval, _)| interval.guard).max().unwrap_or(0);
        let slices = slices_of(guard);
        sweeps.iter_mut().flatten().for_each(|(interval, _)| (interval.guard, interval.slices) = (guard, slices));
        let near = scene.camera.near as f32;
        let [first, last] = ends_of(exposure);
        let instant = (first == last).then_some(first);
        let is_static = find_static(scene, &times, &mut rasters, exposure.stride, near);
        let objects: Vec<FrameObject> =
            scene.objects.iter().zip(is_static).map(|(object, fixed)| frame_object(object, options, fixed)).collect();
        let mirrors = objects.iter().any(|object| object.reflection > 0.0 && !object.surfels.is_empty());
        let mut frame = Self {
            size,
            stride: exposure.stride,
            near,
            prefilter: options.prefilter,
            blending: blending(scene),
            // Normals are not averaged over time (Wolf 2008, fig. 4.4).
            shading: if swept.is_some() { Shading::Gouraud } else { options.shading },
            aovs: options.aovs.clone(),
            surroundings: scene.environment.as_ref().filter(|_| mirrors).map(Environment::surroundings),
            background: Background { colour: scene.image.background, transparent: scene.image.transparent },
            panorama: Panorama::of(scene, number, instant, options.filter),
            leaves_background: false,
            memory: options.memory,
            model_bytes: model_bytes(scene),
            picture_bytes: 0,
            swept,
            objects,
            rasters,
            wanted: None,
        };
        frame.plan_steps(&sweeps);
        frame
    }

    /// Bytes of a frame of `scene` with so many time samples before it is rendered, and of its models: what
    /// [`Self::new`] makes, at the least.
    pub fn posed_bytes(scene: &Scene, samples: u64) -> u64 {
        let of_objects = size_of::<PosedObject>() * scene.objects.len();
        let of_lights = size_of::<Light>() * scene.lights.len();
        let of_sample =
            size_of::<Group>() + size_of::<TimeSample>() + size_of::<PosedGroup>() + size_of::<PosedSample>();
        let of_position = size_of::<PositionExposure>() + size_of::<Position>() + size_of::<Step>();
        samples.saturating_mul((of_objects + of_lights + of_sample + of_position) as u64) + model_bytes(scene)
    }

    /// Bytes of the models of `scene`.
    pub fn model_bytes(scene: &Scene) -> u64 {
        model_bytes(scene)
    }

    /// Plans the steps a second time, after objects or samples were changed.
    pub fn plan_again(&mut self) {
        let sweeps: Vec<_> = self.positions().flat_map(Position::sweeps).collect();
        self.plan_steps(&sweeps);
    }

    /// Gives each position its steps; `sweeps` has an entry for each group of the frame.
    fn plan_steps(&mut self, sweeps: &[Option<(PosedInterval, SweptKernel)>]) {
        let scenery = Scenery {
            has_rest: self.has_static() && self.has_one_view(),
            low_pass: self.prefilter == Prefilter::Approx,
            see_through: self.has_see_through(),
            transparent: self.blending.is_some(),
        };
        let completes = self.swept.is_some_and(SweptKernel::needs_finish);
        let mut rest = sweeps;
        for raster in &mut self.rasters {
            for position in &mut raster.positions {
                let (of_position, others) = rest.split_at(position.groups.len());
                position.steps = Step::of_position(of_position, scenery);
                rest = others;
            }
            if let Some(last) = raster.positions.last_mut().filter(|_| completes) {
                last.steps.push(Step::Finish);
            }
        }
    }

    /// What the film is developed over.
    pub fn behind_film(&self) -> Backdrop {
        let transparent = self.background.transparent || self.leaves_background;
        let picture = self.panorama.as_ref().filter(|_| !transparent).map(Panorama::picture);
        Backdrop { background: Background { transparent, ..self.background }, picture }
    }

    /// The planes of the frame's film.
    pub fn film_planes(&self) -> FilmPlanes {
        let planes = FilmPlanes::of(&self.aovs);
        let pools = self.swept.is_some_and(|kernel| kernel.normalise == Normalise::Once);
        if pools { planes.pooled() } else { planes }
    }

    /// The sample positions of all rasters, in the order in which they are rendered.
    pub fn positions(&self) -> impl Iterator<Item = &Position> {
        self.rasters.iter().flat_map(|raster| &raster.positions)
    }

    /// All groups, in the order in which they are added to the film.
    pub fn groups(&self) -> impl Iterator<Item = &PosedGroup> {
        self.positions().flat_map(|position| &position.groups)
    }

    /// All samples, in the order of their groups.
    pub fn all_samples(&self) -> impl Iterator<Item = &PosedSample> {
        self.groups().flat_map(|group| &group.samples)
    }

    /// The steps of all positions, in order.
    pub fn steps(&self) -> impl Iterator<Item = &Step> {
        self.positions().flat_map(|position| &position.steps)
    }

    /// Width of the visibility maps' guard band, raster pixels; `None` where there is no map.
    pub fn guard(&self) -> Option<u32> {
        self.steps().find_map(|step| match step {
            Step::Published { part: Published::Map { guard }, .. } => Some(*guard),
            _ => None,
        })
    }

    /// Slices of an interval of kernels in motion; 0 where there are none, or kernels are published.
    pub fn slices(&self) -> u32 {
        let swept = self.steps().find_map(|step| match step {
            Step::Sweep { interval, .. } => Some(interval.slices),
            _ => None,
        });
        swept.unwrap_or(0)
    }

    /// Whether what is at rest is painted once for several groups.
    pub fn shares_rest(&self) -> bool {
        self.steps().any(|step| matches!(step, Step::Paint { shares_rest: true, .. }))
    }

    /// Whether any step paints kernels that a filter widens.
    pub fn has_filtered_kernels(&self) -> bool {
        self.prefilter == Prefilter::Ewa && self.steps().any(|step| matches!(step, Step::Paint { .. }))
    }

    /// Whether any step of opaque surfels needs the factors that normalise the kernels of a model.
    pub fn normalises(&self) -> bool {
        self.has_filtered_kernels() || self.steps().any(|step| matches!(step, Step::Sweep { .. }))
    }

    /// Whether light passes through the surfels of any object.
    pub fn has_see_through(&self) -> bool {
        self.objects.iter().any(|object| object.see_through)
    }

    /// Whether any object is a volume.
    pub fn has_volumes(&self) -> bool {
        self.objects.iter().any(FrameObject::is_volume)
    }

    /// Whether any static object with surfels is visible. Static objects have the same pose in all samples.
    fn has_static(&self) -> bool {
        let first = self.all_samples().next();
        let seen = |object: usize| first.is_some_and(|sample| sample.objects[object].visible);
        let fixed = |object: &FrameObject| object.is_static && !object.surfels.is_empty() && !object.see_through;
        self.objects.iter().enumerate().any(|(index, object)| fixed(object) && seen(index))
    }

    /// Are camera and lights the same in all samples?
    pub fn has_one_view(&self) -> bool {
        let mut samples = self.all_samples();
        let Some(first) = samples.next() else { return true };
        samples.all(|s| s.world_from_camera == first.world_from_camera && s.lights == first.lights)
    }

    /// Time samples of a pixel.
    pub fn samples(&self) -> u32 {
        let groups = self.rasters.iter().take(1).flat_map(|raster| &raster.positions).flat_map(|p| &p.groups);
        groups.map(|group| group.samples.len() as u32).sum()
    }

    /// Time samples of the group that has most.
    pub fn most_samples_of_a_group(&self) -> usize {
        self.groups().map(|group| group.samples.len()).max().unwrap_or(1)
    }
}

/// First and last time of the samples of `exposure`, frames.
fn ends_of(exposure: &Exposure) -> [f64; 2] {
    let times = || exposure.groups().flat_map(|group| &group.samples).map(|sample| sample.time);
    [times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max)]
}

/// Is the approximate filter a Gaussian as wide as its disc? Only instants and published kernels have the disc.
fn widens_by_gaussian(options: &RenderOptions, swept: Option<SweptKernel>) -> bool {
    options.prefilter == Prefilter::Approx && swept.is_some_and(|kernel| !kernel.is_published())
}

/// What full EWA has of the pixel filter, and what is left to `positions` sub-pixel positions. First the standard
/// deviation of its low-pass filter, pixels of a raster with this stride (0 without full EWA); then a factor on the
/// offsets.
///
/// All positions together make one filter of the sample grid, so each has a share of its variance. For a pixel's square
/// that is 1/12 a pixel^2, over what the cut at two standard deviations leaves of it. Of a Gaussian the splats have
/// 1 / P, and the positions the rest: at one position all is the splats', as in classical EWA (Zwicker et al. 2002,
/// section 6.2). At pixel centres the filter is that of `gaussian:1`.
fn filter_of(options: &RenderOptions, swept: Option<SweptKernel>, positions: usize, stride: u32) -> (f32, f32) {
    const OF_SQUARE: f64 = 0.121;
    if widens_by_gaussian(options, swept) {
        return (0.5 * low_pass_radius(stride), 1.0);
    }
    if options.prefilter != Prefilter::Ewa {
        return (0.0, 1.0);
    }
    let share = 1.0 / positions as f64;
    let (variance, spread) = match options.filter {
        PixelFilter::Box => (OF_SQUARE * share, 1.0),
        PixelFilter::Point => (1.0, 1.0),
        PixelFilter::Gaussian { sigma } => (sigma * sigma * share, (1.0 - share).sqrt()),
    };
    ((variance.sqrt() / f64::from(stride)) as f32, spread as f32)
}

/// Standard deviation of the filter of textures of one of `positions` sub-pixel positions, pixels of a raster with this
/// stride. At one position it is that of a pixel's square. The error of more positions falls faster than the part of
/// the square that each has, and so does this: its variance by `positions`^-1.5. The disc of the approximate filter
/// leaves a third of it. Full EWA filters textures together with kernels (docs/measurements/meshes.md).
fn footprint(options: &RenderOptions, swept: Option<SweptKernel>, positions: usize, stride: u32) -> f32 {
    let variance = match options.prefilter {
        _ if widens_by_gaussian(options, swept) => 0.0,
        Prefilter::None => 1.0 / 12.0,
        Prefilter::Approx => 1.0 / 36.0,
        Prefilter::Ewa => 0.0,
    };
    let positions = positions as f64;
    ((variance / (positions * positions.sqrt())).sqrt() / f64::from(stride)) as f32
}

/// Slices of an interval in which nothing moves farther than `guard` raster pixels from its middle. In a slice nothing
/// moves by more than [`SLICE_PATH`] pixels, as long as 32 slices suffice for that.
fn slices_of(guard: u32) -> u32 {
    (2 * guard).div_ceil(SLICE_PATH).next_power_of_two().min(32)
}

fn model_bytes(scene: &Scene) -> u64 {
    let mut models: Vec<_> = scene.objects.iter().map(|object| object.model.surfels()).collect();
    models.sort_by_key(|model| Arc::as_ptr(model));
    models.dedup_by_key(|model| Arc::as_ptr(model));
    let mut captures: Vec<_> = scene.objects.iter().filter_map(|object| object.model.gaussians()).collect();
    captures.sort_by_key(|capture| Arc::as_ptr(capture));
    captures.dedup_by_key(|capture| Arc::as_ptr(capture));
    let surroundings = scene.environment.as_ref().map_or(0, Environment::bytes);
    // The picture of what is behind.
    let pixels = u64::from(scene.image.width) * u64::from(scene.image.height);
    let behind = scene.panorama().map_or(0, |_| pixels * size_of::<[f32; 3]>() as u64);
    let captures = captures.iter().map(|capture| capture.bytes()).sum::<u64>();
    let paths: u64 = scene.objects.iter().filter_map(|object| object.model.own_paths()).map(|own| own.bytes()).sum();
    models.iter().map(|model| model.bytes()).sum::<u64>() + paths + captures + surroundings + behind
}

/// The numbers in which the image is composited: coded values as soon as one capture has them. Flat colours are linear,
/// and so are see-through surfels and volumes.
fn blending(scene: &Scene) -> Option<Blending> {
    let blending = |object: &Object| {
        if object.is_see_through() {
            return Some(Blending::Linear);
        }
        let linear = object.model.gaussians()?.linear || object.capture.flat.is_some();
        Some(if linear { Blending::Linear } else { Blending::Coded })
    };
    scene.objects.iter().filter_map(blending).reduce(|a, b| if a == Blending::Coded { a } else { b })
}

/// Material of the object: the scene's, else the file's, else the default.
fn frame_object(object: &Object, options: &RenderOptions, is_static: bool) -> FrameObject {
    let material = match object.material {
        Some(material) => Some(material),
        None if object.model.material.is_empty() => Some(Material::default()),
        None => None,
    };
    let two_sided = options.two_sided || object.two_sided;
    FrameObject {
        surfels: Arc::clone(object.model.surfels()),
        own_paths: object.model.own_paths().cloned(),
        gaussians: object.model.gaussians().cloned(),
        capture: object.capture,
        see_through: object.is_see_through(),
        opacity: object.opacity as f32,
        reflection: object.reflection as f32,
        material,
        two_sided,
        is_static,
    }
}
