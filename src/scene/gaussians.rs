//! Captures that a program has in memory.

use super::values::Object;
use crate::model::{Gaussians, ModelError};

impl Object {
    /// An object of transparent 3D Gaussians, as a capture has them.
    ///
    /// ```
    /// use splatblur::glam::{Quat, Vec3};
    /// use splatblur::{Gaussians, Object};
    ///
    /// let fog = Gaussians {
    ///     position: vec![Vec3::ZERO, Vec3::X],
    ///     sigma: vec![Vec3::splat(0.2); 2],
    ///     rotation: vec![Quat::IDENTITY; 2],
    ///     opacity: vec![0.8; 2],
    ///     base: vec![Gaussians::base_of(Vec3::new(0.9, 0.4, 0.1)); 2],
    ///     linear: true,
    ///     ..Gaussians::default()
    /// };
    /// let object = Object::from_gaussians(fog)?;
    /// # Ok::<(), splatblur::ModelError>(())
    /// ```
    ///
    /// # Errors
    /// There are none, a column has another length than `position`, or a value is out of its bounds.
    pub fn from_gaussians(gaussians: Gaussians) -> Result<Self, ModelError> {
        if gaussians.is_empty() {
            return Err(ModelError::NoPoints);
        }
        gaussians.check()?;
        Ok(Self::new(gaussians))
    }
}
