//! Surfels of points that a program has in memory.

use glam::{DVec3, Vec3};

use super::cloud::{Cloud, ColourStorage};
use super::complete::complete;
use super::error::ModelError;
use super::options::LoadOptions;
use super::surfels::{Material, Surfels, VelocityUnit};

/// Points on the way to [`Surfels`]. Positions must be given. Each other column is left out, or as long as they are.
///
/// ```
/// use splatblur::glam::{DVec3, Vec3};
/// use splatblur::{Object, Surfels, VelocityUnit};
///
/// let (surfels, notes) = Surfels::builder([DVec3::ZERO, DVec3::X, DVec3::Y])
///     .colours([Vec3::new(0.8, 0.1, 0.1); 3])
///     .velocities([Vec3::Z * 0.5; 3], VelocityUnit::Frame)
///     .build()?;
/// assert_eq!(surfels.colour[0], Vec3::new(0.8, 0.1, 0.1));
/// assert!(notes.iter().any(|note| note.starts_with("normals of all 3 points estimated")));
/// let object = Object::new(surfels);
/// # Ok::<(), splatblur::ModelError>(())
/// ```
#[derive(Clone, Debug)]
#[must_use = "nothing is made before `build`"]
pub struct SurfelsBuilder {
    cloud: Cloud,
}

impl Surfels {
    /// Begins surfels at these positions, model units.
    pub fn builder(positions: impl IntoIterator<Item = DVec3>) -> SurfelsBuilder {
        let position = positions.into_iter().collect();
        SurfelsBuilder { cloud: Cloud { position, colour_storage: ColourStorage::Float, ..Cloud::default() } }
    }
}

impl SurfelsBuilder {
    /// Outward normals of any length. Those that are 0 or not finite are estimated; without this call all are.
    pub fn normals(mut self, normals: impl IntoIterator<Item = Vec3>) -> Self {
        self.cloud.normal = normals.into_iter().collect();
        self
    }

    /// Cut-off radii of discs, model units, > 0. Those that are not are estimated; without this call all are.
    pub fn radii(mut self, radii: impl IntoIterator<Item = f32>) -> Self {
        self.cloud.radius = radii.into_iter().collect();
        self
    }

    /// Semi-axes u and v of ellipses, model units, as long as their cut-off radii. They go before radii.
    pub fn axes(mut self, axes: impl IntoIterator<Item = [Vec3; 2]>) -> Self {
        self.cloud.axes = axes.into_iter().collect();
        self
    }

    /// Colours in **linear** Rec.709. Without this call all are white.
    pub fn colours(mut self, colours: impl IntoIterator<Item = Vec3>) -> Self {
        self.cloud.colour = colours.into_iter().collect();
        self
    }

    /// Opacities, 0 to 1. Without this call all are 1.
    pub fn opacities(mut self, opacities: impl IntoIterator<Item = f32>) -> Self {
        self.cloud.opacity = opacities.into_iter().collect();
        self
    }

    /// Reflection coefficients. Without this call all have the default.
    pub fn materials(mut self, materials: impl IntoIterator<Item = Material>) -> Self {
        self.cloud.material = materials.into_iter().collect();
        self
    }

    /// Velocities, model units per `unit`. Without this call points rest in their model.
    pub fn velocities(mut self, velocities: impl IntoIterator<Item = Vec3>, unit: VelocityUnit) -> Self {
        self.cloud.velocity = velocities.into_iter().collect();
        self.cloud.velocity_unit = unit;
        self
    }

    /// Accelerations, model units per square of the unit of velocities, which is a second where there are none.
    pub fn accelerations(mut self, accelerations: impl IntoIterator<Item = Vec3>) -> Self {
        self.cloud.acceleration = accelerations.into_iter().collect();
        self
    }

    /// Identities: points of two models of a sequence with the same one are the same point.
    pub fn identities(mut self, identities: impl IntoIterator<Item = i64>) -> Self {
        self.cloud.id = identities.into_iter().collect();
        self
    }

    /// Shows both sides, for normals whose signs mean nothing.
    pub fn two_sided(mut self) -> Self {
        self.cloud.two_sided = true;
        self
    }

    /// Makes the surfels, sorted along a curve through space, and notes of what was estimated, replaced or dropped, one
    /// line each. Points that are not finite or farther than 1e18 from the origin are dropped.
    ///
    /// # Errors
    /// A column is not as long as the positions, or no point is left.
    pub fn build(self) -> Result<(Surfels, Vec<String>), ModelError> {
        self.cloud.check()?;
        let (surfels, notes) = complete(self.cloud, &LoadOptions::default(), &|_, _| {})?;
        Ok((surfels.spatially_ordered(), notes))
    }
}
