//! A model that can be rendered.

use std::any::Any;
use std::fmt;
use std::panic::{RefUnwindSafe, UnwindSafe};
use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};

use super::flaw::{self, Columns};
use crate::limits::Invalid;
use crate::math::Bounds;

/// Reflection coefficients of the shading equation (docs/math.md, eq. 7; Wolf 2008, 4.1.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Ambient coefficient ka, >= 0.
    pub ambient: f32,
    /// Diffuse coefficient kd, >= 0.
    pub diffuse: f32,
    /// Specular coefficient ks, >= 0.
    pub specular: f32,
    /// Specular exponent, >= 0.
    pub shininess: f32,
}

impl Material {
    /// Is each coefficient a number of at least 0?
    pub(super) fn is_valid(self) -> bool {
        [self.ambient, self.diffuse, self.specular, self.shininess].iter().all(|c| c.is_finite() && *c >= 0.0)
    }
}

impl Default for Material {
    fn default() -> Self {
        Self { ambient: 1.0, diffuse: 1.0, specular: 0.1, shininess: 30.0 }
    }
}

/// The normalisation of a model's kernels, once it is known: from a file, or from [`Surfels::normalisation`].
///
/// It belongs to the positions and axes beside it. Whoever changes them replaces it by the default, which is "not
/// known". A clone knows nothing, because clones are made to be changed.
#[derive(Debug, Default)]
pub struct Normalisation {
    factors: OnceLock<Vec<f32>>,
    mean: OnceLock<f32>,
    later: Option<Later>,
}

/// Where factors come from that another model has, once somebody asks.
struct Later(Box<dyn Fn() -> Vec<f32> + Send + Sync + UnwindSafe + RefUnwindSafe>);

impl fmt::Debug for Later {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Later")
    }
}

impl Normalisation {
    /// The factors, one for each surfel, if they are known.
    pub fn known(&self) -> Option<&[f32]> {
        self.factors.get().map(Vec::as_slice)
    }

    /// Factors that `make` makes when they are first asked for, one for each surfel.
    pub(super) fn later(make: impl Fn() -> Vec<f32> + Send + Sync + UnwindSafe + RefUnwindSafe + 'static) -> Self {
        Self { later: Some(Later(Box::new(make))), ..Self::default() }
    }

    /// The factors, made or computed unless they are known.
    ///
    /// Two threads that ask at the same time both compute, and get the same. No lock is held meanwhile: a thread that
    /// waits for its parallel parts may take up a task that asks again, and would wait for itself.
    pub(super) fn known_or(&self, compute: impl FnOnce() -> Vec<f32>) -> &[f32] {
        if self.factors.get().is_none() {
            let factors = self.later.as_ref().map_or_else(compute, |Later(make)| make());
            // An error says that the other thread was first.
            let _ = self.factors.set(factors);
        }
        self.known().unwrap_or_default()
    }

    /// The mean of the factors, computed unless it is known.
    pub(super) fn mean_or(&self, compute: impl FnOnce() -> f32) -> f32 {
        *self.mean.get_or_init(compute)
    }
}

impl Clone for Normalisation {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl From<Vec<f32>> for Normalisation {
    fn from(factors: Vec<f32>) -> Self {
        Self { factors: factors.into(), ..Self::default() }
    }
}

/// The levels of detail of a model, if a file brought them along ([`write_bin`](super::write_bin)).
///
/// They are used as long as the columns that they were made of are what they were; else a renderer makes others.
#[derive(Clone, Debug, Default)]
pub struct KeptLevels(Option<Arc<dyn Tree>>);

/// The tree of a model as its columns keep it. Levels are made of surfels, so that these cannot know more of them.
pub(super) trait Tree: Any + fmt::Debug + Send + Sync + UnwindSafe + RefUnwindSafe {
    /// Memory of the tree, bytes.
    fn bytes(&self) -> u64;
}

impl KeptLevels {
    /// Keeps a tree.
    pub(super) fn new(tree: impl Tree) -> Self {
        Self(Some(Arc::new(tree)))
    }

    /// The tree, if there is one of this kind.
    pub(super) fn tree<T: Tree>(&self) -> Option<&T> {
        let tree: &dyn Any = &**self.0.as_ref()?;
        tree.downcast_ref()
    }

    /// Is there one?
    pub fn is_some(&self) -> bool {
        self.0.is_some()
    }

    /// Memory of the tree, bytes.
    fn bytes(&self) -> u64 {
        self.0.as_ref().map_or(0, |tree| tree.bytes())
    }
}

/// The unit of time of velocities and accelerations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VelocityUnit {
    /// Model units per second, and per second squared.
    #[default]
    Second,
    /// Model units per frame, and per frame squared.
    Frame,
}

/// A model that can be rendered: every surfel has axes, a normal and a colour.
///
/// It is a structure of arrays of one length. Only `opacity`, `material`, `velocity`, `acceleration` and `id` may be
/// empty, where the file has none, and `normalisation` until somebody asks for it.
#[derive(Clone, Debug, Default)]
pub struct Surfels {
    /// Point of model space that the positions are relative to (models are recentred in `f64`).
    pub origin: DVec3,
    /// Positions relative to `origin`.
    pub position: Vec<Vec3>,
    /// First semi-axis; its length is a cut-off radius, > 0.
    pub axis_u: Vec<Vec3>,
    /// Second semi-axis, not parallel to the first; (u x v) . normal >= 0.
    pub axis_v: Vec<Vec3>,
    /// Unit shading normals, outward.
    pub normal: Vec<Vec3>,
    /// Colours, linear Rec.709.
    pub colour: Vec<Vec3>,
    /// Opacities, in [0, 1]; empty where all are 1.
    pub opacity: Vec<f32>,
    /// Reflection coefficients, or empty.
    pub material: Vec<Material>,
    /// Velocities, model units per [`velocity_unit`](Self::velocity_unit), or empty.
    pub velocity: Vec<Vec3>,
    /// Accelerations, model units per [`velocity_unit`](Self::velocity_unit) squared, or empty.
    pub acceleration: Vec<Vec3>,
    /// The unit of time of both.
    pub velocity_unit: VelocityUnit,
    /// Identities, or empty: a point of another file of a sequence with the same one is the same point.
    pub id: Vec<i64>,
    /// Factors of the kernels, if they are known; [`Surfels::normalisation`] gives them in any case.
    pub normalisation: Normalisation,
    /// The levels of detail, if a file brought them along.
    pub levels: KeptLevels,
    /// True if the signs of the normals mean nothing. Both sides are then shown unless the scene says otherwise.
    pub two_sided: bool,
    /// True if the signs of normals were estimated from the shape of the cloud. They point out of a closed surface, so
    /// a viewer inside it sees only backs. Scene files then show both sides to a camera within the model's box.
    pub signs_estimated: bool,
    /// True if they are no discs but spheres: the length of an axis is the radius, and normals mean nothing
    /// (docs/math.md, section 19).
    pub spheres: bool,
}

impl Surfels {
    /// Number of surfels.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// True for a model without surfels.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Checks whether the columns go together and hold what can be drawn. It looks at each entry once.
    ///
    /// # Errors
    /// The first column that does not.
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        let columns = Columns(self.len());
        for (name, column) in
            [("axis_u", &self.axis_u), ("axis_v", &self.axis_v), ("normal", &self.normal), ("colour", &self.colour)]
        {
            columns.check(name, column.len())?;
        }
        columns.check_optional("opacity", self.opacity.len())?;
        columns.check_optional("material", self.material.len())?;
        columns.check_optional("velocity", self.velocity.len())?;
        columns.check_optional("acceleration", self.acceleration.len())?;
        columns.check_optional("id", self.id.len())?;
        columns.check_optional("normalisation", self.normalisation.known().map_or(0, <[f32]>::len))?;
        if !self.origin.is_finite() {
            return Err(Invalid::new("origin", self.origin, "finite numbers"));
        }
        flaw::each("position", &self.position, flaw::is_place, flaw::PLACE)?;
        flaw::each("axis_u", &self.axis_u, flaw::is_place, flaw::PLACE)?;
        flaw::each("axis_v", &self.axis_v, flaw::is_place, flaw::PLACE)?;
        flaw::each("normal", &self.normal, flaw::is_normal, "a vector of length at most 1")?;
        flaw::each("colour", &self.colour, flaw::is_colour, flaw::COLOUR)?;
        flaw::each("opacity", &self.opacity, |opacity| (0.0..=1.0).contains(&opacity), "a number from 0 to 1")?;
        flaw::each("material", &self.material, Material::is_valid, "coefficients of at least 0")?;
        flaw::each("velocity", &self.velocity, flaw::is_place, flaw::PLACE)?;
        flaw::each("acceleration", &self.acceleration, flaw::is_place, flaw::PLACE)
    }

    /// Memory of the columns and of levels that a file brought along, bytes.
    pub fn bytes(&self) -> u64 {
        let vectors = [&self.position, &self.axis_u, &self.axis_v, &self.normal, &self.colour];
        let vectors = vectors.into_iter().chain([&self.velocity, &self.acceleration]);
        let vectors: usize = vectors.map(|column| size_of_val(column.as_slice())).sum();
        let factors = self.normalisation.known().unwrap_or_default();
        let of_opacity = size_of_val(self.opacity.as_slice());
        let of_id = size_of_val(self.id.as_slice());
        let columns = vectors + of_id + of_opacity + size_of_val(self.material.as_slice()) + size_of_val(factors);
        columns as u64 + self.levels.bytes()
    }

    /// Velocities and accelerations: how each point moves by itself.
    pub(super) fn rates(&self) -> [&Vec<Vec3>; 2] {
        [&self.velocity, &self.acceleration]
    }

    /// Cut-off radius of surfel `i`: the length of the longer axis.
    pub fn radius(&self, i: usize) -> f32 {
        self.axis_u[i].length().max(self.axis_v[i].length())
    }

    /// Median of the cut-off radii; 0 for an empty model.
    pub fn median_radius(&self) -> f32 {
        let mut radii: Vec<f32> = (0..self.len()).map(|i| self.radius(i)).collect();
        if radii.is_empty() {
            return 0.0;
        }
        let middle = radii.len() / 2;
        *radii.select_nth_unstable_by(middle, f32::total_cmp).1
    }

    /// The least opacity; 1 for a model without opacities.
    pub fn least_opacity(&self) -> f32 {
        self.opacity.iter().copied().fold(1.0, f32::min)
    }

    /// Box around the surfel centres, in model space.
    pub fn bounds(&self) -> Bounds {
        self.position.iter().map(|p| self.origin + p.as_dvec3()).collect()
    }
}
