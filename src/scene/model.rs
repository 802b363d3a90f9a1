//! The surfels of an object, with what is derived from them once.

use std::ops::Deref;
use std::sync::Arc;

use crate::math::Bounds;
use crate::model::Surfels;

/// The surfels that an object shows. Copies share them: a clone costs nothing.
///
/// It gives access to everything of its [`Surfels`]; what is derived from them (median radius, box) is computed once.
/// To change a model, make a new one of changed surfels.
#[derive(Clone, Debug, Default)]
pub struct Model {
    surfels: Arc<Surfels>,
    median_radius: f32,
    bounds: Bounds,
}

impl Model {
    /// The shared surfels.
    pub fn surfels(&self) -> &Arc<Surfels> {
        &self.surfels
    }

    /// Median of the cut-off radii, model space; 0 for a model without surfels.
    pub fn median_radius(&self) -> f32 {
        self.median_radius
    }

    /// Box around the surfel centres, model space; empty for a model without surfels.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }
}

impl From<Surfels> for Model {
    fn from(surfels: Surfels) -> Self {
        Arc::new(surfels).into()
    }
}

impl From<Arc<Surfels>> for Model {
    fn from(surfels: Arc<Surfels>) -> Self {
        let (median_radius, bounds) = (surfels.median_radius(), surfels.bounds());
        Self { surfels, median_radius, bounds }
    }
}

impl Deref for Model {
    type Target = Surfels;

    fn deref(&self) -> &Surfels {
        &self.surfels
    }
}
