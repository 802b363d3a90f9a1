//! The content of a model file, before anything is estimated.

use glam::{DVec3, Vec3};

use super::flaw::Columns;
use super::surfels::{Material, VelocityUnit};
use crate::limits::Invalid;

/// Every channel of a surface whose file has no colours, linear: the grey .58 of a display. White would leave no room
/// for light.
pub(super) const PLAIN: f32 = 0.3;

/// Calls the macro `$with` with every optional column of a [`Cloud`], and with its name in notes: the one list of them.
macro_rules! each_column {
    ($with:ident) => {
        $with!(normal, "normals");
        $with!(radius, "radii");
        $with!(axes, "axes");
        $with!(colour, "colours");
        $with!(opacity, "opacities");
        $with!(density, "densities");
        $with!(volume, "volumes");
        $with!(material, "reflection coefficients");
        $with!(velocity, "velocities");
        $with!(acceleration, "accelerations");
        $with!(id, "identities");
        $with!(station, "places of scanners");
        $with!(value, "values to colour by");
    };
}
pub(super) use each_column;

/// How a file stored its colours. This decides the default colour space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourStorage {
    /// 8- or 16-bit integers, which are sRGB unless the scene says otherwise.
    #[default]
    Integer,
    /// Floats, which are linear unless the scene says otherwise.
    Float,
}

/// The content of a model file, before anything is estimated.
///
/// It is a structure of arrays. `position` has one entry for each point. Every other array has the same length, or is
/// empty where the file has no such property.
#[derive(Clone, Debug, Default)]
pub struct Cloud {
    /// Positions in model space.
    pub position: Vec<DVec3>,
    /// Unit normals. A zero vector means that this point lacks a normal, which is then estimated.
    pub normal: Vec<Vec3>,
    /// Cut-off radii, > 0. A value that is not positive or not finite means that this point lacks a radius, which is
    /// then estimated.
    pub radius: Vec<f32>,
    /// Semi-axes u and v of elliptical splats. Their lengths are cut-off radii; they override `radius`.
    pub axes: Vec<[Vec3; 2]>,
    /// Colours, nominally 0..=1, in the colour space of the file.
    pub colour: Vec<Vec3>,
    /// How the file stored the colours.
    pub colour_storage: ColourStorage,
    /// Opacities, in [0, 1].
    pub opacity: Vec<f32>,
    /// Values of the samples of a volume; nothing for surfels.
    pub density: Vec<f32>,
    /// Parts of space that the samples of a volume stand for, model units^3, > 0; nothing for surfels.
    pub volume: Vec<f32>,
    /// Reflection coefficients of each point.
    pub material: Vec<Material>,
    /// Velocities, model units per `velocity_unit`.
    pub velocity: Vec<Vec3>,
    /// Accelerations, model units per `velocity_unit` squared.
    pub acceleration: Vec<Vec3>,
    /// The unit of time of both. A scene may say another one.
    pub velocity_unit: VelocityUnit,
    /// Identities: a point of another file of a sequence with the same one is the same point.
    pub id: Vec<i64>,
    /// Places of scanners, model space.
    pub stations: Vec<DVec3>,
    /// Index in `stations` of the scanner that saw each point: estimated normals face it.
    pub station: Vec<u16>,
    /// Numbers that colours are made of ([`ColourBy`](super::ColourBy)); NaN where a point has none.
    pub value: Vec<f64>,
    /// Names of the columns of numbers that the file has, where its format names them.
    pub columns: Vec<String>,
    /// True if the signs of the normals mean nothing (Gaussian splats), so both sides are to be shown.
    pub two_sided: bool,
    /// True if the signs of the normals were estimated: outward on a closed surface. Completion sets it; see
    /// [`Surfels::signs_estimated`](super::Surfels::signs_estimated).
    pub signs_estimated: bool,
    /// What a user should know: points that were dropped, properties that were ignored, conventions that were assumed.
    pub notes: Vec<String>,
}

impl Cloud {
    /// Checks whether the columns go together.
    ///
    /// # Errors
    /// The first that is neither empty nor as long as `position`.
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        let columns = Columns(self.position.len());
        macro_rules! check {
            ($column:ident, $name:expr) => {
                columns.check_optional(stringify!($column), self.$column.len())?;
            };
        }
        each_column!(check);
        Ok(())
    }
}
