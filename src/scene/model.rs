//! Surfels and Gaussians as an object shows them, with what is derived from them once.

use std::sync::{Arc, LazyLock, Mutex, OnceLock, PoisonError};

use glam::{DVec3, Vec3};

use crate::limits::Invalid;
use crate::math::Bounds;
use crate::model::levels::Levels;
use crate::model::mesh::Mesh;
use crate::model::paths::{Elapsed, OwnPaths, Paths};
use crate::model::{Gaussians, Material, Optics, Surfels, VolumeLevels};

/// The surfels of a shape without any.
pub(super) static NO_SURFELS: LazyLock<Arc<Surfels>> = LazyLock::new(Arc::default);

/// Surfels, with what is derived from them once: median radius, boxes. Copies share the surfels: a clone costs nothing.
/// To change a model, make a new one.
#[derive(Clone, Debug)]
pub struct SurfelModel {
    pub(super) surfels: Arc<Surfels>,
    /// The part of a sequence that they are.
    piece: Option<Piece>,
    pub(super) median_radius: f32,
    pub(super) tolerance: f32,
    least_opacity: f32,
    pub(super) bounds: Bounds,
    /// Boxes around the columns of the paths.
    rates: [Bounds; 3],
    mesh: Option<Arc<Mesh>>,
    levels: Arc<LevelsOnce>,
    /// All surfels, where these are a cut through their levels.
    whole: Option<Whole>,
    /// A fault in the columns that a program made: the model cannot be rendered.
    pub(super) flaw: Option<Arc<Invalid>>,
}

/// The levels of detail of a model, once they are asked for.
#[derive(Debug, Default)]
struct LevelsOnce {
    tree: OnceLock<Option<Arc<Levels>>>,
    /// The last cut: what does not move has the same in each frame, and is uploaded once.
    last: Mutex<Option<LastCut>>,
}

/// The model that a cut is of.
#[derive(Clone, Debug)]
pub(crate) struct Whole {
    pub(crate) surfels: Arc<Surfels>,
    /// Memory of its levels beside it, bytes.
    levels_bytes: u64,
}

impl Whole {
    /// Memory, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.surfels.bytes() + self.levels_bytes
    }
}

/// The cut of the picture before, and the material of the whole object that it was for.
#[derive(Debug)]
struct LastCut {
    nodes: Vec<u32>,
    material: Option<Material>,
    surfels: Arc<Surfels>,
}

impl LevelsOnce {
    /// For a model that has none.
    fn none() -> Self {
        Self { tree: OnceLock::from(None), last: Mutex::default() }
    }
}

/// The part of a sequence that surfels are.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// Paths in place of the surfels' own.
    pub(crate) paths: Arc<OwnPaths>,
    /// Frames from the first of which on, and before the second of which, they are there.
    pub(crate) window: [f64; 2],
    /// The first one that a frame shows of its object. The others follow it.
    pub(crate) is_first: bool,
}

impl Default for SurfelModel {
    fn default() -> Self {
        Self::bare(Arc::clone(&NO_SURFELS), None)
    }
}

impl SurfelModel {
    /// Surfels from which nothing is derived.
    fn bare(surfels: Arc<Surfels>, flaw: Option<Arc<Invalid>>) -> Self {
        Self {
            surfels,
            piece: None,
            median_radius: 0.0,
            tolerance: 0.0,
            least_opacity: 0.0,
            bounds: Bounds::default(),
            rates: Default::default(),
            mesh: None,
            levels: Arc::default(),
            whole: None,
            flaw,
        }
    }

    /// A model of surfels that are known to be right.
    pub(crate) fn checked(surfels: Arc<Surfels>) -> Self {
        let (median_radius, bounds) = (surfels.median_radius(), surfels.bounds());
        let (least_opacity, rates) = (surfels.least_opacity(), surfels.paths().bounds());
        let tolerance = surfels.tolerance();
        Self { median_radius, tolerance, least_opacity, bounds, rates, ..Self::bare(surfels, None) }
    }

    /// The same surfels, which were sampled from a mesh. They are a surface for all its edges and thin parts.
    pub(super) fn of_mesh(self, mesh: Arc<Mesh>) -> Self {
        Self { tolerance: self.median_radius, mesh: Some(mesh), ..self }
    }

    /// The mesh that they were sampled from when it was loaded.
    pub(crate) fn mesh(&self) -> Option<&Arc<Mesh>> {
        self.mesh.as_ref()
    }

    /// The surfels of some nodes of the levels of detail, which `choose` names, in place of all. `None` where there are
    /// no levels, or the nodes have all surfels. Levels are built when they are first asked for. The surfels have
    /// materials where the model does, and where merged ones change the highlights of `material`, the whole object's.
    pub(super) fn cut(&self, material: Option<Material>, choose: impl FnOnce(&Levels) -> Vec<u32>) -> Option<Self> {
        // Loose discs are no surface, and merge to none. A file of a sequence shows in a frame or two, which a tree is
        // not worth.
        if self.tolerance < self.median_radius || self.piece.is_some() {
            return None;
        }
        // No lock is held while they are built: a thread that waits for its parallel parts may take up a task that asks
        // for the same levels.
        if self.levels.tree.get().is_none() {
            let built = self.surfels.tree();
            // An error says that another thread was first.
            let _ = self.levels.tree.set(built);
        }
        let levels = self.levels.tree.get()?.as_ref()?;
        let cut = choose(levels);
        if cut.iter().all(|&node| levels.nodes()[node as usize].is_leaf()) {
            return None;
        }
        let mut last = self.levels.last.lock().unwrap_or_else(PoisonError::into_inner);
        let surfels = match &*last {
            Some(last) if last.nodes == cut && last.material == material => Arc::clone(&last.surfels),
            _ => {
                let surfels = Arc::new(levels.gather(&self.surfels, &cut, material));
                *last = Some(LastCut { nodes: cut, material, surfels: Arc::clone(&surfels) });
                surfels
            }
        };
        // A tree that a file brought along counts with the surfels.
        let levels_bytes = if self.surfels.keeps(levels) { 0 } else { levels.bytes() };
        let whole = Some(Whole { surfels: Arc::clone(&self.surfels), levels_bytes });
        Some(Self { surfels, whole, levels: Arc::new(LevelsOnce::none()), ..self.clone() })
    }

    /// All surfels, where these are a cut through their levels.
    pub(crate) fn whole(&self) -> Option<&Whole> {
        self.whole.as_ref()
    }

    /// The shared surfels.
    pub fn surfels(&self) -> &Arc<Surfels> {
        &self.surfels
    }

    /// How the surfels move by themselves.
    #[doc(hidden)]
    pub fn paths(&self) -> Paths<'_> {
        self.piece.as_ref().map_or_else(|| self.surfels.paths(), |piece| piece.paths.paths())
    }

    /// The same surfels as a part of a sequence.
    pub(crate) fn with_piece(&self, piece: Piece) -> Self {
        Self { rates: piece.paths.paths().bounds(), piece: Some(piece), ..self.clone() }
    }

    /// The part of a sequence that they are.
    pub(crate) fn piece(&self) -> Option<&Piece> {
        self.piece.as_ref()
    }

    /// Paths that are not the surfels' own.
    pub(crate) fn own_paths(&self) -> Option<&Arc<OwnPaths>> {
        self.piece.as_ref().map(|piece| &piece.paths)
    }

    /// Box around the centres after the points moved by themselves; it may be larger than needed. Model space.
    pub(crate) fn bounds_after(&self, elapsed: Elapsed<f64>) -> Bounds {
        let rates = self.rates.iter().zip(elapsed).filter(|(rate, _)| !rate.is_empty());
        rates.fold(self.bounds, |Bounds { min, max }, (rate, factor)| {
            let (a, b) = (rate.min * factor, rate.max * factor);
            Bounds { min: min + a.min(b), max: max + a.max(b) }
        })
    }

    /// True for surfels that were sampled from a mesh when it was loaded.
    pub fn is_mesh(&self) -> bool {
        self.mesh.is_some()
    }

    /// Median of the cut-off radii, model space; 0 for a model without surfels.
    pub fn median_radius(&self) -> f32 {
        self.median_radius
    }

    /// The least opacity of surfels; 1 for a model without any opacities.
    pub fn least_opacity(&self) -> f32 {
        self.least_opacity
    }

    /// Box around the centres, model space; empty for a model without any.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }
}

/// The levels of detail of a volume, once they are asked for.
#[derive(Debug, Default)]
struct VolumeLevelsOnce {
    tree: OnceLock<Option<Arc<VolumeLevels>>>,
    /// The last cut, and the kernels of its nodes: what does not move is uploaded once.
    last: Mutex<Option<(Vec<u32>, Arc<Gaussians>)>>,
}

impl VolumeLevelsOnce {
    /// For a model that has none.
    fn none() -> Self {
        Self { tree: OnceLock::from(None), last: Mutex::default() }
    }
}

/// The volume that a cut is of.
#[derive(Clone, Debug)]
pub(crate) struct WholeVolume {
    pub(crate) kernels: Arc<Gaussians>,
    levels: Arc<VolumeLevels>,
}

impl WholeVolume {
    /// Memory, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.kernels.bytes() + self.levels.bytes()
    }
}

/// Gaussians of a capture or kernels of a volume, which of them show, and what is derived from them once. Copies share
/// the Gaussians: a clone costs nothing.
#[derive(Clone, Debug)]
pub struct GaussianModel {
    pub(super) gaussians: Arc<Gaussians>,
    /// Gaussians with centres outside this box are left out, model space; both corners belong to it.
    pub crop: Option<[DVec3; 2]>,
    /// The colour of all, linear Rec.709, in place of their own.
    #[doc(hidden)]
    pub flat: Option<Vec3>,
    pub(super) median_radius: f32,
    pub(super) bounds: Bounds,
    core: Bounds,
    levels: Arc<VolumeLevelsOnce>,
    /// All kernels, where these are a cut through their levels.
    whole: Option<WholeVolume>,
    /// A fault in the columns that a program made: the model cannot be rendered.
    pub(super) flaw: Option<Arc<Invalid>>,
}

impl GaussianModel {
    /// Gaussians from which nothing is derived.
    fn bare(gaussians: Arc<Gaussians>, flaw: Option<Arc<Invalid>>) -> Self {
        let (bounds, core, levels) = Default::default();
        Self { gaussians, crop: None, flat: None, median_radius: 0.0, bounds, core, levels, whole: None, flaw }
    }

    /// A model of Gaussians that are known to be right.
    pub(super) fn checked(gaussians: Arc<Gaussians>) -> Self {
        let bounds: Bounds = gaussians.position.iter().map(|p| p.as_dvec3()).collect();
        let mut radii: Vec<f32> = gaussians.sigma.iter().map(|sigma| 2.0 * sigma.max_element()).collect();
        let middle = radii.len() / 2;
        let median_radius =
            if radii.is_empty() { 0.0 } else { *radii.select_nth_unstable_by(middle, f32::total_cmp).1 };
        let core = core(&gaussians, bounds);
        Self { median_radius, bounds, core, ..Self::bare(gaussians, None) }
    }

    /// The kernels of some nodes of the levels of detail, which `choose` names, in place of all. `None` where there are
    /// no levels, or the nodes have all kernels. Levels are built when they are first asked for.
    pub(super) fn cut(&self, choose: impl FnOnce(&VolumeLevels) -> Vec<u32>) -> Option<Self> {
        // No lock is held while they are built: see `SurfelModel::cut`.
        if self.levels.tree.get().is_none() {
            let built = VolumeLevels::of(&self.gaussians).map(Arc::new);
            // An error says that another thread was first.
            let _ = self.levels.tree.set(built);
        }
        let levels = self.levels.tree.get()?.as_ref()?;
        let cut = choose(levels);
        if cut.iter().all(|&node| levels.nodes()[node as usize].is_leaf()) {
            return None;
        }
        let mut last = self.levels.last.lock().unwrap_or_else(PoisonError::into_inner);
        let gaussians = match &*last {
            Some((nodes, gaussians)) if *nodes == cut => Arc::clone(gaussians),
            _ => {
                let gaussians = Arc::new(levels.gather(&self.gaussians, &cut));
                *last = Some((cut, Arc::clone(&gaussians)));
                gaussians
            }
        };
        let whole = Some(WholeVolume { kernels: Arc::clone(&self.gaussians), levels: Arc::clone(levels) });
        Some(Self { gaussians, whole, levels: Arc::new(VolumeLevelsOnce::none()), ..self.clone() })
    }

    /// Memory of the levels that were built, bytes. Those of a cut are counted with the whole.
    pub(crate) fn levels_bytes(&self) -> u64 {
        self.levels.tree.get().and_then(Option::as_ref).map_or(0, |levels| levels.bytes())
    }

    /// All kernels, where these are a cut through their levels.
    pub(crate) fn whole(&self) -> Option<&WholeVolume> {
        self.whole.as_ref()
    }

    /// The shared Gaussians.
    pub fn gaussians(&self) -> &Arc<Gaussians> {
        &self.gaussians
    }

    /// Median of twice the largest standard deviations, model space; 0 for a model without Gaussians.
    pub fn median_radius(&self) -> f32 {
        self.median_radius
    }

    /// Box around the centres that show, model space; empty for a model without any.
    pub fn bounds(&self) -> Bounds {
        self.cropped(self.bounds)
    }

    /// Box around what a viewer looks at, model space. Captures have stray Gaussians far away, so the outermost 2 % on
    /// each side do not count.
    pub fn core(&self) -> Bounds {
        self.cropped(self.core)
    }

    fn cropped(&self, bounds: Bounds) -> Bounds {
        self.crop.map_or(bounds, |[min, max]| Bounds { min: bounds.min.max(min), max: bounds.max.min(max) })
    }
}

/// [`GaussianModel::core`] of Gaussians with `bounds`. Volumes have no strays.
fn core(gaussians: &Gaussians, bounds: Bounds) -> Bounds {
    let last = gaussians.len().saturating_sub(1);
    if last / 50 == 0 || gaussians.optics != Optics::Alpha {
        return bounds;
    }
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let mut line: Vec<f32> = gaussians.position.iter().map(|p| p[axis]).collect();
        let low = *line.select_nth_unstable_by(last / 50, f32::total_cmp).1;
        let high = *line.select_nth_unstable_by(last - last / 50, f32::total_cmp).1;
        [f64::from(low), f64::from(high)]
    });
    Bounds { min: DVec3::new(x[0], y[0], z[0]), max: DVec3::new(x[1], y[1], z[1]) }
}

impl From<Arc<Surfels>> for SurfelModel {
    /// Columns that do not go together, or hold what cannot be drawn, are an error when the model is rendered.
    fn from(surfels: Arc<Surfels>) -> Self {
        match surfels.check() {
            Ok(()) => Self::checked(surfels),
            // Nothing can be derived from them.
            Err(flaw) => Self::bare(surfels, Some(Arc::new(flaw))),
        }
    }
}

impl From<Surfels> for SurfelModel {
    fn from(surfels: Surfels) -> Self {
        Arc::new(surfels).into()
    }
}

impl From<Arc<Gaussians>> for GaussianModel {
    /// Columns that do not go together, or hold what cannot be drawn, are an error when the model is rendered.
    fn from(gaussians: Arc<Gaussians>) -> Self {
        match gaussians.check() {
            Ok(()) => Self::checked(gaussians),
            Err(flaw) => Self::bare(gaussians, Some(Arc::new(flaw))),
        }
    }
}

impl From<Gaussians> for GaussianModel {
    fn from(gaussians: Gaussians) -> Self {
        Arc::new(gaussians).into()
    }
}
