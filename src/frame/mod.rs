//! One frame, posed: all that a backend needs to execute a plan, as plain values.
//!
//! Transforms are composed in `f64` and only then rounded, so that far-away world coordinates cost no precision. A
//! frame owns all that it names: a backend may render it later, or a second time.

mod blocks;
mod filters;
mod minified;
mod panorama;
mod pixel_rect;
mod poser;
mod posing;
mod raster;
mod static_objects;
mod strips;

use std::sync::Arc;

use glam::Vec3;

use crate::environment::{Environment, Surroundings};
use crate::film::{Aov, Backdrop, Background, Blending, FilmPlanes};
use crate::model::{Gaussians, Material};
use crate::options::{Normalise, Prefilter, RenderOptions, Shading, SweptKernel};
use crate::plan::{Group, PosedInterval, PositionExposure, Published, Scenery, Step, TimeSample};
use crate::scene::{Drawing, GaussianModel, Object, Scene, Shape, SurfelModel};
use crate::shading::ShadingLight;

pub use self::blocks::Blocks;
pub use self::panorama::Panorama;
pub(crate) use self::pixel_rect::PixelRect;
pub use self::poser::{Held, PosedObject, PosedSample};
pub use self::raster::{Raster, RasterArea};
pub use self::static_objects::{STATIC_PATH, all_rests, shared_positions, shows_much_rest};

/// One frame, posed.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Pixels of the image from one pixel of a raster to the next, along both axes.
    pub stride: u32,
    /// Nearest visible depth, scene units.
    pub near: f32,
    /// Screen-space prefilter; never [`Prefilter::Auto`].
    pub prefilter: Prefilter,
    /// Where shading happens.
    pub shading: Shading,
    /// Extra channels.
    pub aovs: Vec<Aov>,
    /// What surfaces mirror; `None` where no surface does.
    pub surroundings: Option<Surroundings>,
    /// The background behind the film. Captures, volumes and see-through surfels are composited over it, instant by
    /// instant.
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
    /// Do opaque objects have different depth tolerances? Then each has a limit of its own, for which the depth of the
    /// nearest disc is kept, too (docs/math.md, eq. 5). Published kernels have one limit all the same.
    pub keeps_nearest: bool,
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
    /// The interval that the group's one sample represents, and the kernels that sweep it. `None`: samples are
    /// instants.
    pub sweep: Option<(PosedInterval, SweptKernel)>,
}

/// The properties of an object that do not change during the frame.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "each is a property by itself")]
pub struct FrameObject {
    /// What it is made of. Models are shared, so that a backend can recognise one that it has already uploaded.
    pub shape: Shape,
    /// Does light pass through its surfels?
    pub see_through: bool,
    /// Factor on the opacities of its surfels or Gaussians.
    pub opacity: f32,
    /// Share of the surroundings that its surfels mirror.
    pub reflection: f32,
    /// Material of the whole object; `None`: one per surfel, as the model has them.
    pub material: Option<Material>,
    /// Show back faces, with normals turned to the viewer.
    pub two_sided: bool,
    /// Do shadows fall on it?
    pub receives: bool,
    /// Does it show nothing but the shadows on it?
    pub catcher: bool,
    /// Does it keep light from anything?
    pub cast_shadows: bool,
    /// Has the same pose in all samples. Its splats come first in the order of sums, and count once in a group.
    pub is_static: bool,
    /// Is it shown as at the frame's number, before the camera of that time, though the camera moves? In the world it
    /// is where it is then: there it casts shadows, and receives them.
    pub is_held: bool,
}

impl FrameObject {
    /// The Gaussians of a capture or kernels of a volume, and how they are drawn; `None` for other shapes.
    pub fn drawn(&self) -> Option<(&Arc<Gaussians>, Drawing)> {
        self.shape.gaussians().map(GaussianModel::gaussians).zip(self.shape.drawing(self.opacity.into()))
    }

    /// Has it any surfels?
    pub fn has_surfels(&self) -> bool {
        self.shape.surfels().is_some_and(|model| !model.surfels().is_empty())
    }

    /// Is it a volume?
    pub fn is_volume(&self) -> bool {
        matches!(self.shape, Shape::Volume { .. })
    }
}

impl Frame {
    /// Bytes of a frame of `scene` with so many time samples before it is rendered, and of its models: what
    /// [`Self::new`] makes, at the least.
    pub fn posed_bytes(scene: &Scene, samples: u64) -> u64 {
        let of_objects = size_of::<PosedObject>() * scene.objects.len();
        let of_sky = usize::from(scene.sky().is_some());
        let of_lights = size_of::<ShadingLight>() * (scene.lights.len() + of_sky);
        let of_sample =
            size_of::<Group>() + size_of::<TimeSample>() + size_of::<PosedGroup>() + size_of::<PosedSample>();
        let of_position = size_of::<PositionExposure>() + size_of::<Position>() + size_of::<Step>();
        samples.saturating_mul((of_objects + of_lights + of_sample + of_position) as u64) + model_bytes(scene)
    }

    /// Bytes of the models of `scene`.
    pub fn model_bytes(scene: &Scene) -> u64 {
        model_bytes(scene)
    }

    /// Gives each position its steps, and finds what they keep; again after objects or samples were changed.
    pub fn plan_steps(&mut self) {
        let samples = self.samples_of_a_group();
        debug_assert!(self.groups().all(|group| group.samples.len() == samples), "groups of one size");
        let scenery = Scenery {
            // Shadows move over what rests.
            has_rest: self.has_static() && self.has_one_view() && !self.has_shadows(),
            low_pass: self.prefilter == Prefilter::Approx,
            see_through: self.has_see_through(),
            transparent: self.blending.is_some(),
        };
        let completes = self.swept.is_some_and(SweptKernel::needs_finish);
        for raster in &mut self.rasters {
            for position in &mut raster.positions {
                let sweeps: Vec<_> = position.groups.iter().map(|group| group.sweep).collect();
                position.steps = Step::of_position(&sweeps, scenery);
            }
            if let Some(last) = raster.positions.last_mut().filter(|_| completes) {
                last.steps.push(Step::Finish);
            }
        }
        let has_own_limits = self.steps().any(|step| matches!(step, Step::Paint { .. } | Step::Sweep { .. }));
        self.keeps_nearest = has_own_limits && self.groups().any(|group| self.has_several_tolerances(group));
    }

    /// Whether the opaque surfels that a group shows have several tolerances. Those that differ by rounding are one:
    /// an object that turns has not the same to the bit at all times.
    fn has_several_tolerances(&self, group: &PosedGroup) -> bool {
        let most = self.tolerances(group, false).fold(0.0, f32::max);
        most > self.least_tolerance(group, false) * (1.0 + 4.0 * f32::EPSILON)
    }

    /// The least depth tolerance of the objects whose surfels a group shows.
    pub(crate) fn least_tolerance(&self, group: &PosedGroup, see_through: bool) -> f32 {
        self.tolerances(group, see_through).fold(f32::MAX, f32::min)
    }

    /// The depth tolerances of the objects whose surfels a group shows.
    fn tolerances(&self, group: &PosedGroup, see_through: bool) -> impl Iterator<Item = f32> {
        let posed = group.samples.iter().flat_map(|sample| self.objects.iter().zip(&sample.objects));
        let shows = move |object: &FrameObject| object.has_surfels() && object.see_through == see_through;
        posed.filter(move |(object, posed)| shows(object) && posed.visible).map(|(_, posed)| posed.epsilon)
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

    /// Are there shadows in any light?
    pub fn has_shadows(&self) -> bool {
        self.all_samples().next().is_some_and(|sample| sample.lights.iter().any(ShadingLight::has_shadows))
    }

    /// Whether light passes through the surfels of any object.
    pub fn has_see_through(&self) -> bool {
        self.objects.iter().any(|object| object.see_through)
    }

    /// Do the Gaussians of an object keep light from anything that shadows fall on? Those of captures do from all but
    /// captures, whose colours were photographed in their own shadows.
    pub fn casts_splats(&self, object: &FrameObject) -> bool {
        let is_capture = |other: &FrameObject| other.drawn().is_some() && !other.is_volume();
        let receives = |other: &FrameObject| other.receives && (object.is_volume() || !is_capture(other));
        object.cast_shadows && object.drawn().is_some() && self.objects.iter().any(receives)
    }

    /// Whether any object is a volume.
    pub fn has_volumes(&self) -> bool {
        self.objects.iter().any(FrameObject::is_volume)
    }

    /// Whether any static object with surfels is visible. Static objects have the same pose in all samples.
    fn has_static(&self) -> bool {
        let first = self.all_samples().next();
        let seen = |object: usize| first.is_some_and(|sample| sample.objects[object].visible);
        let fixed = |object: &FrameObject| object.is_static && object.has_surfels() && !object.see_through;
        self.objects.iter().enumerate().any(|(index, object)| fixed(object) && seen(index))
    }

    /// The surfels that are visible at a sample, of static objects or others, opaque or see-through, with the index of
    /// their object: in document order.
    pub(crate) fn visible_surfels<'a>(
        &'a self,
        sample: &PosedSample,
        is_static: bool,
        see_through: bool,
    ) -> impl Iterator<Item = (usize, &'a SurfelModel)> {
        let wanted = move |object: &FrameObject| object.is_static == is_static && object.see_through == see_through;
        let posed = self.objects.iter().zip(&sample.objects).enumerate();
        let visible = posed.filter(move |(_, (object, posed))| posed.visible && wanted(object));
        visible.filter_map(|(index, (object, _))| Some((index, object.shape.surfels()?)))
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

    /// Time samples of a group: all groups have as many.
    pub fn samples_of_a_group(&self) -> usize {
        self.groups().next().map_or(1, |group| group.samples.len())
    }

    /// Do the samples of a group shade their own surfels, as they are at their times, though they share its shadows?
    pub fn shades_samples(&self) -> bool {
        self.shading == Shading::Gouraud && self.samples_of_a_group() > 1
    }

    /// Does anything move while a rolling shutter reads a strip?
    pub fn moves_while_read(&self) -> bool {
        let rolls = self.rasters.iter().flat_map(|r| &r.positions).any(|p| p.raster.readout.is_some());
        rolls && self.all_samples().any(|sample| sample.objects.iter().any(|object| object.moves))
    }

    /// Are there surfels of held objects, and others' or none? `None`: both are there.
    pub fn holds(&self) -> Option<bool> {
        let mut held = self.objects.iter().filter(|object| object.has_surfels()).map(|object| object.is_held);
        let first = held.next().unwrap_or(false);
        held.all(|is_held| is_held == first).then_some(first)
    }

    /// The origin of an object's model relative to the eye of a sample, world axes, where it is in the world.
    pub fn place_of(&self, object: usize, sample: &PosedSample) -> Vec3 {
        let origin = sample.objects[object].world_origin;
        if self.objects[object].is_held { origin + sample.held.shift } else { origin }
    }

    /// Whether pixels have several layers of kernels. `filtered`: a filter widens these. A group of several samples has
    /// one coverage, at all depths together.
    pub fn has_layers(&self, filtered: bool) -> bool {
        filtered && self.samples_of_a_group() == 1
    }
}

fn model_bytes(scene: &Scene) -> u64 {
    let surfels = || scene.objects.iter().filter_map(|object| object.shape.surfels());
    let mut models: Vec<_> = surfels().map(SurfelModel::surfels).collect();
    models.sort_by_key(|model| Arc::as_ptr(model));
    models.dedup_by_key(|model| Arc::as_ptr(model));
    let gaussians = || scene.objects.iter().filter_map(|object| object.shape.gaussians());
    let mut captures: Vec<_> = gaussians().collect();
    captures.sort_by_key(|capture| Arc::as_ptr(capture.gaussians()));
    captures.dedup_by_key(|capture| Arc::as_ptr(capture.gaussians()));
    let surroundings = scene.environment.as_ref().map_or(0, Environment::bytes);
    // The picture of what is behind; where the camera moves, mode auto has two more.
    let pixels = u64::from(scene.image.width) * u64::from(scene.image.height);
    let pictures = if scene.camera.rests() { 1 } else { 3 };
    let behind = scene.panorama().map_or(0, |_| pictures * pixels * size_of::<[f32; 3]>() as u64);
    let captures = captures.iter().map(|capture| capture.gaussians().bytes() + capture.levels_bytes()).sum::<u64>();
    let paths: u64 = surfels().filter_map(SurfelModel::own_paths).map(|own| own.bytes()).sum();
    // Objects share them, too.
    let mut wholes: Vec<_> = surfels().filter_map(SurfelModel::whole).collect();
    wholes.sort_by_key(|whole| Arc::as_ptr(&whole.surfels));
    wholes.dedup_by_key(|whole| Arc::as_ptr(&whole.surfels));
    let wholes: u64 = wholes.iter().map(|whole| whole.bytes()).sum();
    let mut volumes: Vec<_> = gaussians().filter_map(GaussianModel::whole).collect();
    volumes.sort_by_key(|whole| Arc::as_ptr(&whole.kernels));
    volumes.dedup_by_key(|whole| Arc::as_ptr(&whole.kernels));
    let wholes = wholes + volumes.iter().map(|whole| whole.bytes()).sum::<u64>();
    models.iter().map(|model| model.bytes()).sum::<u64>() + wholes + paths + captures + surroundings + behind
}

/// The numbers in which the image is composited: coded values as soon as one capture has them. Flat colours are linear,
/// and so are see-through surfels and volumes.
fn blending(scene: &Scene) -> Option<Blending> {
    let blending = |object: &Object| match &object.shape {
        Shape::Gaussians { model, .. } | Shape::Volume { model, .. } => {
            let linear = model.gaussians().linear || model.flat.is_some();
            Some(if linear { Blending::Linear } else { Blending::Coded })
        }
        Shape::Surfels { .. } => object.is_see_through().then_some(Blending::Linear),
        Shape::Sequence { .. } | Shape::Sphere { .. } => None,
    };
    scene.objects.iter().filter_map(blending).reduce(|a, b| if a == Blending::Coded { a } else { b })
}

/// Material of the object: the scene's, else the file's, else the default.
fn frame_object(object: &Object, options: &RenderOptions, is_static: bool, camera_rests: bool) -> FrameObject {
    let has_materials = object.shape.surfels().is_some_and(|model| !model.surfels().material.is_empty());
    let surface = object.shape.surface().copied().unwrap_or_default();
    let material = object.shape.material().or_else(|| (!has_materials).then(Material::default));
    // The discs of spheres face the eye, and those of the model mean nothing.
    let two_sided = options.look.two_sided || surface.two_sided || object.shape.surfels_or_none().spheres;
    let catcher = object.shadow_catcher && object.has_opaque_surfels();
    let is_held = !object.blur && !camera_rests;
    // A held capture or volume is elsewhere than its splats are shown. A volume without normals shows light of its own.
    let has_none = match &object.shape {
        Shape::Volume { model, .. } => is_held || model.gaussians().normal.is_empty(),
        Shape::Gaussians { .. } => is_held,
        Shape::Surfels { .. } | Shape::Sequence { .. } | Shape::Sphere { .. } => false,
    };
    FrameObject {
        shape: object.shape.clone(),
        see_through: object.is_see_through(),
        opacity: object.opacity as f32,
        // A catcher is not seen, and mirrors nothing.
        reflection: if catcher { 0.0 } else { surface.reflection as f32 },
        material,
        two_sided,
        receives: object.receive_shadows && !has_none,
        catcher,
        cast_shadows: object.cast_shadows,
        is_static,
        is_held,
    }
}
