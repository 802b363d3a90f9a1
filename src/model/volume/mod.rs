//! Volumes: samples of a medium that light passes through, drawn as Gaussian kernels (Zwicker et al. 2002, section 5).
//!
//! Data flow: `nrrd` (bytes to a [`Grid`]), or a cloud with densities ([`Samples`]) → `transfer` (values to colour
//! and extinction) → `kernels` (one Gaussian a sample, the flattened ones along `gradient`). docs/volumes.md is the
//! guide.

mod gradient;
mod grid;
mod kernels;
mod levels;
mod nrrd;
mod nrrd_fields;
mod nrrd_header;
mod samples;
mod transfer;

use std::sync::Arc;

pub use grid::Grid;
pub use kernels::KERNEL;
pub(super) use kernels::{Made, of_grid, of_samples};
pub(crate) use levels::{NodeError, VolumeLevels, VolumeNode};
pub(super) use nrrd::parse as parse_nrrd;
pub use samples::Samples;
pub use transfer::{TransferFunction, TransferFunctionError, TransferStop};

/// Largest extinction, per scene unit: with the largest cell its product still fits an `f32`.
pub const MOST_EXTINCTION: f64 = 1e9;

/// Least and largest distance of neighbours in a grid, and radius of a sample, model units. The volume of the largest
/// cell still fits an `f32`.
pub(super) const SPACINGS: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

/// How a volume becomes kernels.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeOptions {
    /// Colour and extinction of each value. `None`: of a grid, white, with an extinction that rises with the value; of
    /// samples, their own colours, and their densities as extinction.
    pub transfer: Option<Arc<TransferFunction>>,
    /// Standard deviation of a kernel, in distances of neighbours (grids) or radii (samples), > 0.
    pub kernel: f64,
    /// What the standard deviation along the gradient is divided by, >= 1, also infinite (Zwicker et al. 2002, eq. 37).
    pub flatten: f64,
    /// True: lights shade the kernels, with gradients as normals. False: kernels emit their colours.
    pub lit: bool,
}

impl Default for VolumeOptions {
    fn default() -> Self {
        Self { transfer: None, kernel: KERNEL, flatten: 1.0, lit: false }
    }
}

/// What a volume held before it became kernels.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeFacts {
    /// Samples along each axis of a grid; `None`: samples in no order.
    pub sizes: Option<[usize; 3]>,
    /// Number of samples.
    pub samples: usize,
    /// Distances of neighbours along the axes of a grid, or the median radius of samples three times; model units.
    pub spacings: [f64; 3],
    /// Type of the numbers in the file.
    pub storage: &'static str,
    /// Least and greatest value.
    pub range: [f32; 2],
}
