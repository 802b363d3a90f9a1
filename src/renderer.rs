//! The renderer: opens a device, and renders frames and sequences of scenes on it.

mod queue;
mod work;

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use crate::backend::cpu::Cpu;
use crate::backend::{Backend, BackendError, Meter};
use crate::files;
use crate::film::{Aov, Layer, Picture};
use crate::frame::Frame;
use crate::objects;
use crate::options::{BlurMode, KernelWeight, Prefilter, Quality, RenderOptions, Shading};
use crate::plan::Exposure;
use crate::reconstruct;
use crate::scene::{BlockErrors, Cut, CutTolerance, Object, Scene};
use crate::stop::{Done, Progress, Stop};
use crate::time::FrameNumber;

use self::queue::RenderedFrames;
pub use self::queue::{FinishedFrame, FrameError, FrameQueue};
use self::work::FrameWork;
#[cfg(feature = "gpu")]
pub use crate::backend::gpu::{AdapterReport, adapters};
pub use crate::backend::{Rendered, Stats};

/// The device that renders. CPU and GPU give the same pictures up to rounding.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Device {
    /// A hardware GPU if there is one that can be used, else the CPU.
    #[default]
    Auto,
    /// The CPU, with all threads of the current rayon pool.
    Cpu,
    /// A GPU: discrete before integrated before virtual ones. Where there is none, a software device.
    Gpu {
        /// Part of the name of the adapter that is wanted, whatever the case; `None`: any.
        adapter: Option<String>,
    },
}

/// Renders scenes on one device.
///
/// ```
/// use splatblur::{Device, RenderOptions, Renderer, Scene};
///
/// let scene = Scene::open("scenes/swarm.xml").size(64, 48).load()?;
/// let mut renderer = Renderer::open(Device::Cpu)?;
/// for rendered in renderer.render_sequence(&scene, 1..=2, &RenderOptions::default()) {
///     let (frame, rendered) = rendered?;
///     println!("frame {frame}: {} splats", rendered.stats.splats);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Renderer {
    backend: Box<dyn Backend>,
    kind: DeviceKind,
    /// Whom it tells how far a frame is, and what counts it.
    listener: Option<(Progress, Arc<Meter>)>,
}

/// What a renderer renders on.
enum DeviceKind {
    Cpu {
        /// Why it is not a GPU, where one was looked for, with a semicolon in front.
        why: String,
    },
    #[cfg(feature = "gpu")]
    Gpu {
        /// Name of the adapter.
        adapter: String,
    },
}

impl Renderer {
    /// Opens a device. [`Device::Auto`] and [`Device::Cpu`] always succeed.
    ///
    /// # Errors
    /// There is no such adapter, it lacks what is needed, or the crate was built without its feature `gpu`.
    pub fn open(device: Device) -> Result<Self, BackendError> {
        match device {
            Device::Auto => Ok(Self::best()),
            Device::Cpu => Ok(Self::cpu(String::new())),
            Device::Gpu { adapter } => Self::gpu(adapter),
        }
    }

    /// Renders frame `frame` of a scene; any finite number, also one between two frames or outside the scene's own.
    ///
    /// # Errors
    /// The number is not finite, the frame does not fit into [`RenderOptions::memory`], the device fails, or the scene
    /// has what the mode or the shading cannot show.
    pub fn render(
        &mut self,
        scene: &Scene,
        frame: impl Into<FrameNumber>,
        options: &RenderOptions,
    ) -> Result<Rendered, BackendError> {
        let Some((progress, meter)) = &self.listener else {
            return render_frame(&mut *self.backend, scene, frame, options);
        };
        meter.reset();
        let rendered = render_frame(&mut *self.backend, scene, frame, options)?;
        progress.tell(Done { round: meter.read().renderings.max(1), share: 1.0 });
        Ok(rendered)
    }

    /// Renders frames of a scene, each when it is asked for, and gives them with their numbers, in the order of
    /// `frames`.
    ///
    /// On a GPU the next frame is prepared while the device renders, so that a sequence takes less time than its frames
    /// one by one. It ends after the first error, which comes after all frames that were begun before it.
    pub fn render_sequence<'a>(
        &'a mut self,
        scene: &'a Scene,
        frames: impl IntoIterator<Item: Into<FrameNumber>, IntoIter: 'a>,
        options: &'a RenderOptions,
    ) -> impl Iterator<Item = Result<(FrameNumber, Rendered), BackendError>> + 'a {
        RenderedFrames::new(FrameQueue::new(&mut *self.backend, scene, options), frames.into_iter())
    }

    /// Takes a picture back that is no longer needed, so that a later one can have its memory.
    pub fn recycle(&mut self, picture: Picture) {
        self.backend.recycle(picture);
    }

    /// Counts steps of frames on `meter` from now on. The CPU does; a GPU gives no sign before a frame is done.
    #[doc(hidden)]
    pub fn watch(&mut self, meter: Arc<Meter>) {
        self.backend.watch(meter);
    }

    /// Counts from now on what bounds of splats waste ([`Stats`]). The CPU does, and takes longer.
    #[doc(hidden)]
    pub fn count_waste(&mut self) {
        self.backend.count_waste();
    }

    /// Tells `progress` from now on how far each frame is that [`Self::render`] makes. The CPU tells each step; a GPU
    /// gives no sign before a frame is done. At the end of a frame, both tell a share of 1.
    pub fn tell(&mut self, progress: Progress) {
        let meter = Arc::new(Meter::telling(progress.clone()));
        self.watch(Arc::clone(&meter));
        self.listener = Some((progress, meter));
    }

    /// Ends frames with [`BackendError::Stopped`] from now on, soon after `stop` is set. The CPU ends between two steps
    /// of a frame, a GPU between two renderings.
    pub fn heed(&mut self, stop: Arc<Stop>) {
        self.backend.heed(stop);
    }

    /// `cpu` or `gpu`.
    pub fn backend_name(&self) -> &'static str {
        match self.kind {
            DeviceKind::Cpu { .. } => "cpu",
            #[cfg(feature = "gpu")]
            DeviceKind::Gpu { .. } => "gpu",
        }
    }

    /// What renders, for people, as in `the CPU (8 threads; there is no hardware GPU)`.
    pub fn describe(&self) -> String {
        self.describe_with(rayon::current_num_threads())
    }

    /// As [`describe`](Self::describe), where the CPU renders with `threads` threads.
    #[doc(hidden)]
    pub fn describe_with(&self, threads: usize) -> String {
        match &self.kind {
            DeviceKind::Cpu { why } => {
                format!("the CPU ({threads} thread{}{why})", if threads == 1 { "" } else { "s" })
            }
            #[cfg(feature = "gpu")]
            DeviceKind::Gpu { adapter } => format!("the GPU {adapter}"),
        }
    }

    /// The processor's name, or the adapter's kind, interface and driver, where the system tells.
    #[doc(hidden)]
    pub fn details(&self) -> Option<String> {
        match &self.kind {
            DeviceKind::Cpu { .. } => processor(),
            #[cfg(feature = "gpu")]
            DeviceKind::Gpu { adapter } => {
                let report = adapters().into_iter().find(|report| report.name == *adapter)?;
                Some(format!("{}, {}, driver {}", report.kind, report.interface, report.driver))
            }
        }
    }

    /// What renders, for [`FrameQueue`] and [`render_frame`].
    #[doc(hidden)]
    pub fn backend(&mut self) -> &mut dyn Backend {
        &mut *self.backend
    }

    fn cpu(why: String) -> Self {
        Self { backend: Box::new(Cpu::default()), kind: DeviceKind::Cpu { why }, listener: None }
    }

    #[cfg(feature = "gpu")]
    fn gpu(adapter: Option<String>) -> Result<Self, BackendError> {
        Self::chosen(&crate::backend::gpu::Choice { name: adapter, hardware_only: false })
    }

    #[cfg(feature = "gpu")]
    fn best() -> Self {
        match Self::chosen(&crate::backend::gpu::Choice { name: None, hardware_only: true }) {
            Ok(renderer) => renderer,
            Err(BackendError::NoAdapter { .. }) => Self::cpu("; there is no hardware GPU".to_owned()),
            Err(why) => Self::cpu(format!("; the GPU cannot be used: {why}")),
        }
    }

    #[cfg(feature = "gpu")]
    fn chosen(choice: &crate::backend::gpu::Choice) -> Result<Self, BackendError> {
        let gpu = crate::backend::gpu::Gpu::open(choice)?;
        let kind = DeviceKind::Gpu { adapter: gpu.adapter().to_owned() };
        Ok(Self { backend: Box::new(gpu), kind, listener: None })
    }

    #[cfg(not(feature = "gpu"))]
    fn gpu(_adapter: Option<String>) -> Result<Self, BackendError> {
        Err(BackendError::NotBuilt)
    }

    #[cfg(not(feature = "gpu"))]
    fn best() -> Self {
        Self::cpu(String::new())
    }
}

impl std::fmt::Debug for Renderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Renderer").field(&self.describe()).finish()
    }
}

/// The processor's name, where Linux tells.
fn processor() -> Option<String> {
    let text = files::of_system(Path::new("/proc/cpuinfo"))?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Renders one frame of a scene.
///
/// # Errors
/// The backend cannot render the frame within its limits, or the scene holds what only the reference can show.
pub fn render_frame(
    backend: &mut dyn Backend,
    scene: &Scene,
    frame: impl Into<FrameNumber>,
    options: &RenderOptions,
) -> Result<Rendered, BackendError> {
    let frame = finite(frame.into())?;
    check_values(scene, options)?;
    render_checked(backend, scene, frame, options)
}

/// The same, of values that were checked. Tests of the passes have surfels that are not finite.
pub(crate) fn render_checked(
    backend: &mut dyn Backend,
    scene: &Scene,
    frame: FrameNumber,
    options: &RenderOptions,
) -> Result<Rendered, BackendError> {
    if options.look.aovs.contains(&Aov::Object) {
        // Once, so that the files of a sequence are not looked at again.
        let scene = &*scene.at_frame(finite(frame)?.get())?;
        let rendered = render_checked(backend, scene, frame, &without(options, Aov::Object))?;
        return objects::add_layer(backend, &as_fine(scene, frame, options).scene, frame, options, rendered);
    }
    let mut work = FrameWork::begin(backend, scene, frame, options)?;
    while work.land(backend)? {}
    let Some(rendered) = work.finish(backend) else { unreachable!("no leg is left") };
    Ok(rendered)
}

/// The scene with the surfels that a frame needs. Of a scene with these it is the same.
fn as_fine<'a>(scene: &'a Scene, frame: FrameNumber, options: &RenderOptions) -> Cut<'a> {
    // Where surfels are shaded, and not pixels, coarse ones would show coarse shadows on themselves.
    let shades_surfels = options.look.shading == Shading::Gouraud
        || matches!(options.quality, Quality::Mode(BlurMode::Volumetric { .. }));
    let shadows = has_shadows(scene, options);
    match options.detail.error(options.quality).filter(|_| !(shadows && shades_surfels)) {
        Some(error) => scene.cut(frame.get(), CutTolerance::of(error), shadows),
        None => Cut::whole(scene),
    }
}

/// The options without the layer that [`with_detail`] makes.
fn of_backend(options: &RenderOptions) -> Cow<'_, RenderOptions> {
    if options.look.aovs.contains(&Aov::LodError) {
        Cow::Owned(without(options, Aov::LodError))
    } else {
        Cow::Borrowed(options)
    }
}

/// Adds the error of a cut to what is stated of a picture of it.
fn with_detail(mut rendered: Rendered, errors: &BlockErrors, options: &RenderOptions) -> Rendered {
    rendered.stats.add_detail(errors.whole());
    let picture = &mut rendered.picture;
    let stated = picture.layers.iter_mut().find(|layer| layer.aov == Aov::Error);
    let wanted = options.look.aovs.contains(&Aov::LodError);
    if stated.is_none() && !wanted {
        return rendered;
    }
    let plane = errors.plane([picture.width, picture.height]);
    for own in stated.into_iter().flat_map(|layer| &mut layer.planes) {
        for (stated, detail) in own.iter_mut().zip(&plane) {
            *stated = stated.hypot(*detail);
        }
    }
    if wanted {
        picture.layers.push(Layer { aov: Aov::LodError, planes: vec![plane], names: Vec::new() });
        picture.layers.sort_by_key(|layer| layer.aov);
    }
    rendered
}

/// A frame that `backend` can begin, unless it is stopped meanwhile.
fn posed(
    backend: &dyn Backend,
    scene: &Scene,
    number: FrameNumber,
    mode: BlurMode,
    options: &RenderOptions,
) -> Result<Frame, BackendError> {
    BackendError::check_samples(scene, Exposure::samples_of(mode), options.memory)?;
    let stop = backend.stop();
    let frame = Frame::until(scene, number, mode, options, &stop);
    if stop.is_set() { Err(BackendError::Stopped) } else { Ok(frame) }
}

/// The options of a picture before a layer is added to it.
fn without(options: &RenderOptions, layer: Aov) -> RenderOptions {
    let mut options = options.clone();
    options.look.aovs.retain(|&aov| aov != layer);
    options
}

/// What [`reconstruct::along`] needs to be rendered.
fn with_velocity(options: &RenderOptions) -> RenderOptions {
    let mut options = RenderOptions { reconstruct: false, ..options.clone() };
    if !options.look.aovs.contains(&Aov::Velocity) {
        options.look.aovs.push(Aov::Velocity);
        options.look.aovs.sort_unstable();
    }
    options
}

fn reconstructed(mut rendered: Rendered, options: &RenderOptions) -> Rendered {
    reconstruct::along(&mut rendered.picture);
    rendered.picture.layers.retain(|layer| options.look.aovs.contains(&layer.aov));
    rendered
}

fn finite(frame: FrameNumber) -> Result<FrameNumber, BackendError> {
    if frame.get().is_finite() { Ok(frame) } else { Err(BackendError::Frame { frame }) }
}

/// Refuses values that are out of their bounds, before anything is made of them.
fn check_values(scene: &Scene, options: &RenderOptions) -> Result<(), BackendError> {
    scene.check()?;
    options.check().map_err(|e| e.within("options"))?;
    Ok(())
}

/// Does a picture have shadows?
fn has_shadows(scene: &Scene, options: &RenderOptions) -> bool {
    options.look.shadows && scene.has_shadows()
}

/// Refuses shadow catchers that are none.
fn check_catchers(scene: &Scene, options: &RenderOptions) -> Result<(), BackendError> {
    let Some(object) = scene.objects.iter().find(|object| object.shadow_catcher) else { return Ok(()) };
    let catcher = |why: &'static str, instead: &'static str| {
        Err(BackendError::Catcher { object: object.name.clone(), why, instead })
    };
    let is_other = |object: &&Object| object.shape.is_composited() || object.is_see_through();
    if let Some(object) = scene.objects.iter().filter(|object| object.shadow_catcher).find(is_other) {
        let (why, instead) = ("which light passes through", "opaque surfels");
        return Err(BackendError::Catcher { object: object.name.clone(), why, instead });
    }
    if options.look.shading == Shading::Gouraud {
        return catcher("which shading `gouraud` cannot show", "shading `phong`");
    }
    match options.quality {
        Quality::Mode(BlurMode::Volumetric { .. }) => {
            catcher("which mode `volumetric` cannot show", "`supersample`, `bucket` or `auto`")
        }
        _ => Ok(()),
    }
}

/// Refuses what does not go together.
fn check(scene: &Scene, options: &RenderOptions) -> Result<(), BackendError> {
    if let (Prefilter::Ewa, Quality::Mode(BlurMode::Volumetric { swept, .. })) = (options.prefilter, options.quality)
        && swept.weight != KernelWeight::Integral
    {
        return Err(BackendError::Filter { weight: swept.weight });
    }
    if let (true, Quality::Mode(BlurMode::Volumetric { .. })) = (scene.shutter.readout.rolls(), options.quality) {
        return Err(BackendError::RollingShutter);
    }
    check_catchers(scene, options)?;
    let transparent = |object: &&Object| object.shape.is_composited() || object.is_see_through();
    let transparent = scene.objects.iter().find(transparent);
    if let (Some(object), Quality::Mode(BlurMode::Volumetric { .. })) = (transparent, options.quality) {
        return Err(BackendError::Volumetric { object: object.name.clone() });
    }
    if let Some(object) = scene.capture_before_panorama() {
        return Err(BackendError::Panorama { object: object.name.clone() });
    }
    check_spheres(scene, options)
}

/// Refuses spheres where they cannot be shown.
fn check_spheres(scene: &Scene, options: &RenderOptions) -> Result<(), BackendError> {
    let Some(object) = scene.objects.iter().find(|object| object.shape.surfels_or_none().spheres) else {
        return Ok(());
    };
    scene.objects.iter().try_for_each(Object::check_equal_scale)?;
    let spheres = |what, instead| Err(BackendError::Spheres { object: object.name.clone(), what, instead });
    if let Quality::Mode(BlurMode::Volumetric { .. }) = options.quality {
        return spheres("mode `volumetric`", "`supersample`, `bucket` or `auto`");
    }
    if options.look.shading == Shading::Gouraud {
        return spheres("shading `gouraud`", "`phong`");
    }
    Ok(())
}

#[cfg(test)]
mod tests;
