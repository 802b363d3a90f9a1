//! What an object shows, with what is derived from it once.

use std::ops::Deref;
use std::sync::Arc;

use glam::DVec3;

use crate::limits::Invalid;
use crate::math::Bounds;
use crate::model::paths::{Elapsed, OwnPaths, Paths};
use crate::model::{Gaussians, Loaded, Optics, Surfels};

/// The surfels that an object shows, or the Gaussians of a capture or a volume. Copies share them: a clone costs
/// nothing.
///
/// It gives access to everything of its [`Surfels`], which are none for a capture; what is derived from both (median
/// radius, boxes) is computed once. To change a model, make a new one.
#[derive(Clone, Debug, Default)]
pub struct Model {
    surfels: Arc<Surfels>,
    own_paths: Option<Arc<OwnPaths>>,
    gaussians: Option<Arc<Gaussians>>,
    median_radius: f32,
    least_opacity: f32,
    bounds: Bounds,
    core: Bounds,
    /// Boxes around the columns of the paths.
    rates: [Bounds; 3],
    mesh: bool,
    /// What is wrong with the columns of a program, so that it cannot be rendered.
    flaw: Option<Arc<Invalid>>,
}

impl Model {
    /// The shared surfels.
    pub fn surfels(&self) -> &Arc<Surfels> {
        &self.surfels
    }

    /// The shared Gaussians of a capture or a volume; `None` for surfels.
    pub fn gaussians(&self) -> Option<&Arc<Gaussians>> {
        self.gaussians.as_ref()
    }

    /// How its surfels move by themselves.
    pub fn paths(&self) -> Paths<'_> {
        self.own_paths.as_ref().map_or_else(|| self.surfels.paths(), |own| own.paths())
    }

    /// The same surfels on other paths.
    pub(crate) fn with_paths(&self, paths: Arc<OwnPaths>) -> Self {
        Self { rates: paths.paths().bounds(), own_paths: Some(paths), ..self.clone() }
    }

    /// Paths that are not the surfels' own.
    pub(crate) fn own_paths(&self) -> Option<&Arc<OwnPaths>> {
        self.own_paths.as_ref()
    }

    /// Box around the centres after the points moved by themselves; it may be larger than needed. Model space.
    pub(crate) fn bounds_after(&self, elapsed: Elapsed<f64>) -> Bounds {
        let rates = self.rates.iter().zip(elapsed).filter(|(rate, _)| !rate.is_empty());
        rates.fold(self.bounds, |Bounds { min, max }, (rate, factor)| {
            let (a, b) = (rate.min * factor, rate.max * factor);
            Bounds { min: min + a.min(b), max: max + a.max(b) }
        })
    }

    /// Why it cannot be rendered; `None` if it can.
    pub(crate) fn flaw(&self) -> Option<&Invalid> {
        self.flaw.as_deref()
    }

    /// A model of surfels that are known to be right.
    pub(crate) fn of_surfels(surfels: Arc<Surfels>) -> Self {
        let (median_radius, bounds) = (surfels.median_radius(), surfels.bounds());
        let (least_opacity, rates) = (surfels.least_opacity(), surfels.paths().bounds());
        Self { surfels, median_radius, least_opacity, bounds, core: bounds, rates, ..Self::default() }
    }

    /// A model of Gaussians that are known to be right.
    fn of_gaussians(gaussians: Arc<Gaussians>) -> Self {
        let bounds: Bounds = gaussians.position.iter().map(|p| p.as_dvec3()).collect();
        let mut radii: Vec<f32> = gaussians.sigma.iter().map(|sigma| 2.0 * sigma.max_element()).collect();
        let middle = radii.len() / 2;
        let median_radius =
            if radii.is_empty() { 0.0 } else { *radii.select_nth_unstable_by(middle, f32::total_cmp).1 };
        let core = core(&gaussians, bounds);
        Self { gaussians: Some(gaussians), median_radius, least_opacity: 1.0, bounds, core, ..Self::default() }
    }

    /// True for the kernels of a volume.
    pub fn is_volume(&self) -> bool {
        self.gaussians.as_ref().is_some_and(|gaussians| gaussians.optics != Optics::Alpha)
    }

    /// True for surfels that were sampled from a mesh when it was loaded.
    pub fn is_mesh(&self) -> bool {
        self.mesh
    }

    /// Number of surfels or Gaussians.
    pub fn elements(&self) -> usize {
        self.gaussians.as_ref().map_or(self.surfels.len(), |gaussians| gaussians.len())
    }

    /// Median of the cut-off radii, or of twice the largest standard deviations of Gaussians, model space; 0 for a
    /// model that has none.
    pub fn median_radius(&self) -> f32 {
        self.median_radius
    }

    /// The least opacity of surfels; 1 for a model without any.
    pub fn least_opacity(&self) -> f32 {
        self.least_opacity
    }

    /// Box around the centres, model space; empty for a model without any.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Box around what a viewer looks at, model space: for surfels that of [`Self::bounds`]. Captures have stray
    /// Gaussians far away, so the outermost 2 % on each side do not count.
    pub fn core(&self) -> Bounds {
        self.core
    }
}

impl From<Surfels> for Model {
    fn from(surfels: Surfels) -> Self {
        Arc::new(surfels).into()
    }
}

impl From<Arc<Surfels>> for Model {
    /// Columns that do not go together, or hold what cannot be drawn, are an error when the model is rendered.
    fn from(surfels: Arc<Surfels>) -> Self {
        match surfels.check() {
            Ok(()) => Self::of_surfels(surfels),
            // Nothing can be derived from them.
            Err(flaw) => Self { surfels, flaw: Some(Arc::new(flaw)), ..Self::default() },
        }
    }
}

impl From<Gaussians> for Model {
    fn from(gaussians: Gaussians) -> Self {
        Arc::new(gaussians).into()
    }
}

impl From<Arc<Gaussians>> for Model {
    /// As from surfels.
    fn from(gaussians: Arc<Gaussians>) -> Self {
        match gaussians.check() {
            Ok(()) => Self::of_gaussians(gaussians),
            Err(flaw) => Self { gaussians: Some(gaussians), flaw: Some(Arc::new(flaw)), ..Self::default() },
        }
    }
}

impl From<Loaded> for Model {
    /// Surfels are sorted along a curve through space.
    fn from(loaded: Loaded) -> Self {
        if let Some(gaussians) = loaded.gaussians {
            return Self::of_gaussians(Arc::new(gaussians));
        }
        let mesh = loaded.mesh.is_some();
        Self { mesh, ..Self::of_surfels(Arc::new(loaded.surfels.spatially_ordered())) }
    }
}

/// [`Model::core`] of Gaussians with `bounds`. Volumes have no strays.
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

impl Deref for Model {
    type Target = Surfels;

    fn deref(&self) -> &Surfels {
        &self.surfels
    }
}
