//! Samples to kernels: one Gaussian for each sample that has an extinction.
//!
//! The opacity of a kernel is the integral of its extinction over space: extinction times the volume of a cell. Its
//! shape does not matter to that, so a wider or a flatter kernel takes away as much light in all.

use glam::{DMat2, DMat3, DQuat, DVec3, Quat, Vec3};
use rayon::prelude::*;

use super::grid::Grid;
use super::samples::Samples;
use super::transfer::TransferFunction;
use super::{VolumeFacts, VolumeOptions, gradient};
use crate::model::capture::{Gaussians, Optics};
use crate::model::error::ParseError;
use crate::model::options::LoadProgress;

/// Standard deviation of a kernel by default, in distances of neighbours.
pub const KERNEL: f64 = 0.6;

/// Depth of a layer of kernels that are composited as one, in distances of neighbours. Not a whole number: slices of a
/// grid across the view would fall on the ends of layers.
const LAYER: f64 = 1.25;

/// Extinction of the greatest value where nothing is said: light along the largest extent of the grid is reduced by
/// e^-10 if all of it had this value.
const DEFAULT_DEPTH: f64 = 10.0;

/// Layers of a grid that are made at a time: enough for all threads, and a small part of the memory.
const LAYERS_AT_ONCE: usize = 16;

/// Kernels, and what they were made of.
pub(in crate::model) struct Made {
    pub(in crate::model) gaussians: Gaussians,
    pub(in crate::model) facts: VolumeFacts,
    pub(in crate::model) notes: Vec<String>,
}

/// The kernels of a grid; `scale` is a factor on their standard deviations.
///
/// # Errors
/// There would be more than `most`.
pub(in crate::model) fn of_grid(
    grid: &Grid,
    options: &VolumeOptions,
    scale: f64,
    most: u64,
    progress: LoadProgress<'_>,
) -> Result<Made, ParseError> {
    let mut notes = grid.notes.clone();
    let spacings = grid.spacings();
    let cell = spacings.x * spacings.y * spacings.z;
    let [least, greatest] = grid.range();
    let default;
    let transfer = if let Some(transfer) = options.transfer.as_deref() {
        notes.extend(transfer.off([least, greatest]));
        transfer
    } else {
        let rises = least < greatest;
        let top = if rises { DEFAULT_DEPTH / grid.extent().max_element() } else { 0.0 };
        notes.push(if rises {
            format!(
                "no transfer function: white, with an extinction that rises from 0 at {least} to {top} at {greatest}"
            )
        } else {
            format!("no transfer function, and all values are equal ({least}): nothing shows")
        });
        default = TransferFunction::ramp(least, greatest, top);
        &default
    };
    let mass = |value: f32| (transfer.at(value.into()).1 * cell) as f32;
    let shown = grid.values.par_chunks(1 << 16).map(|values| values.iter().filter(|v| mass(**v) > 0.0).count()).sum();
    check(shown, most)?;

    let shape = KernelAxes::of_grid(grid, options.kernel * scale);
    let plain = shape.plain();
    let columns = |k: usize| {
        let mut made = Columns::default();
        for (at, value) in grid.layer(k).iter().enumerate() {
            let opacity = mass(*value);
            if opacity > 0.0 {
                let index = [at % grid.sizes[0], at / grid.sizes[0], k];
                let normal = if options.needs_gradient() { normal(grid.gradient(index)) } else { DVec3::ZERO };
                let (sigma, rotation) = shape.flattened(normal, options.flatten).unwrap_or(plain);
                made.push(grid.place(index), sigma, rotation, opacity, transfer.at((*value).into()).0);
                made.normal.extend(options.lit.then(|| normal.as_vec3()));
            }
        }
        made
    };
    let mut gaussians = empty(LAYER * libm::cbrt(cell), shown, options.lit);
    for first in (0..grid.sizes[2]).step_by(LAYERS_AT_ONCE) {
        let last = grid.sizes[2].min(first + LAYERS_AT_ONCE);
        let layers: Vec<Columns> = (first..last).into_par_iter().map(columns).collect();
        for layer in layers {
            layer.append_to(&mut gaussians);
        }
        progress("making kernels", last as f32 / grid.sizes[2] as f32);
    }
    let facts = VolumeFacts {
        sizes: Some(grid.sizes),
        samples: grid.values.len(),
        spacings: spacings.to_array(),
        storage: grid.storage,
        range: [least, greatest],
    };
    Ok(Made { gaussians, facts, notes })
}

/// The kernels of samples in no order; `scale` is a factor on their standard deviations.
///
/// # Errors
/// There would be more than `most`.
pub(in crate::model) fn of_samples(
    samples: &Samples,
    options: &VolumeOptions,
    scale: f64,
    most: u64,
    progress: LoadProgress<'_>,
) -> Result<Made, ParseError> {
    let look = |i: usize| match options.transfer.as_deref() {
        Some(transfer) => transfer.at(samples.density[i].into()),
        None => (samples.colour.get(i).copied().unwrap_or(Vec3::ONE), samples.extinction(i)),
    };
    let mass = |i: usize| (look(i).1 * samples.volume(i)) as f32;
    let shown: Vec<usize> = (0..samples.position.len()).filter(|i| mass(*i) > 0.0).collect();
    check(shown.len(), most)?;
    let gradients = if options.needs_gradient() { gradient::of_samples(samples, progress) } else { Vec::new() };
    let median = f64::from(samples.median_radius());
    let mut gaussians = empty(LAYER * median, shown.len(), options.lit);
    let mut columns = Columns::default();
    for i in shown {
        let sigma = options.kernel * scale * f64::from(samples.radius[i]);
        let shape = KernelAxes { axes: DMat3::from_diagonal(DVec3::splat(sigma)) };
        let normal = gradients.get(i).map_or(DVec3::ZERO, |gradient| normal(*gradient));
        let (sigma, rotation) = shape.flattened(normal, options.flatten).unwrap_or_else(|| shape.plain());
        columns.push(samples.position[i], sigma, rotation, mass(i), look(i).0);
        columns.normal.extend(options.lit.then(|| normal.as_vec3()));
    }
    columns.append_to(&mut gaussians);
    let join = |[least, greatest]: [f32; 2], value: &f32| [least.min(*value), greatest.max(*value)];
    let facts = VolumeFacts {
        sizes: None,
        samples: samples.position.len(),
        spacings: [median; 3],
        storage: "densities of points",
        range: samples.density.iter().fold([f32::INFINITY, f32::NEG_INFINITY], join),
    };
    let mut notes = samples.notes.clone();
    notes.extend(options.transfer.as_deref().and_then(|transfer| transfer.off(facts.range)));
    Ok(Made { gaussians, facts, notes })
}

impl VolumeOptions {
    fn needs_gradient(&self) -> bool {
        self.lit || self.flatten > 1.0
    }
}

fn check(kernels: usize, most: u64) -> Result<(), ParseError> {
    if kernels as u64 <= most {
        return Ok(());
    }
    Err(ParseError::byte(0, format!("a volume of {kernels} kernels"), format!("at most {most} for its size")))
}

/// No kernels yet, with room for `count`.
fn empty(layer: f64, count: usize, lit: bool) -> Gaussians {
    let mut gaussians =
        Gaussians { optics: Optics::Extinction { layer: layer as f32 }, linear: true, ..Gaussians::default() };
    gaussians.position.reserve_exact(count);
    gaussians.sigma.reserve_exact(count);
    gaussians.rotation.reserve_exact(count);
    gaussians.opacity.reserve_exact(count);
    gaussians.base.reserve_exact(count);
    gaussians.normal.reserve_exact(if lit { count } else { 0 });
    gaussians
}

/// The unit vector against a gradient; 0 for a gradient without a direction.
fn normal(gradient: DVec3) -> DVec3 {
    -gradient.normalize_or_zero()
}

/// Columns of Gaussians that are made together.
#[derive(Default)]
struct Columns {
    position: Vec<Vec3>,
    sigma: Vec<Vec3>,
    rotation: Vec<Quat>,
    opacity: Vec<f32>,
    base: Vec<Vec3>,
    normal: Vec<Vec3>,
}

impl Columns {
    fn push(&mut self, position: DVec3, sigma: Vec3, rotation: Quat, opacity: f32, colour: Vec3) {
        self.position.push(position.as_vec3());
        self.sigma.push(sigma);
        self.rotation.push(rotation);
        self.opacity.push(opacity);
        self.base.push(Gaussians::base_of(colour));
    }

    fn append_to(mut self, gaussians: &mut Gaussians) {
        gaussians.position.append(&mut self.position);
        gaussians.sigma.append(&mut self.sigma);
        gaussians.rotation.append(&mut self.rotation);
        gaussians.opacity.append(&mut self.opacity);
        gaussians.base.append(&mut self.base);
        gaussians.normal.append(&mut self.normal);
    }
}

/// The shape of a kernel: its covariance is `axes` times its transpose.
#[derive(Clone, Copy)]
struct KernelAxes {
    /// Columns: standard deviations along directions at right angles, model units.
    axes: DMat3,
}

impl KernelAxes {
    fn of_grid(grid: &Grid, kernel: f64) -> Self {
        Self { axes: grid.steps * kernel }
    }

    /// Standard deviations and rotation as they are.
    fn plain(self) -> (Vec3, Quat) {
        let [x, y, z] = [self.axes.x_axis, self.axes.y_axis, self.axes.z_axis];
        let sigma = DVec3::new(x.length(), y.length(), z.length());
        (sigma.as_vec3(), rotation(x / sigma.x, y / sigma.y))
    }

    /// Standard deviations and rotation where the one along `normal` is divided by `factor` (Zwicker et al. 2002, eq.
    /// 37); `None` where nothing is to be done: the normal is 0, or the factor 1.
    ///
    /// Across the normal the kernel keeps the covariance that it has there, along its principal axes.
    fn flattened(self, normal: DVec3, factor: f64) -> Option<(Vec3, Quat)> {
        if normal == DVec3::ZERO || factor <= 1.0 {
            return None;
        }
        let (s, t) = normal.any_orthonormal_pair();
        // The covariance in the frame of s, t and the normal.
        let [of_s, of_t, of_n] = [s, t, normal].map(|direction| self.axes.transpose() * direction);
        let across = DMat2::from_cols_array(&[of_s.dot(of_s), of_s.dot(of_t), of_s.dot(of_t), of_t.dot(of_t)]);
        let (variances, turn) = principal(across);
        let u = s * turn.x + t * turn.y;
        let sigma = DVec3::new(variances[0].sqrt(), variances[1].sqrt(), of_n.length() / factor);
        Some((sigma.as_vec3(), rotation(u, normal.cross(u))))
    }
}

/// Principal variances of a symmetric matrix, and the unit vector of the first.
fn principal(matrix: DMat2) -> ([f64; 2], glam::DVec2) {
    let [a, b, _, c] = matrix.to_cols_array();
    let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
    let radius = (half * half + b * b).sqrt();
    // Axes of a circle, up to rounding, are any.
    if radius <= 1e-12 * mean {
        return ([mean; 2], glam::DVec2::X);
    }
    let (sin, cos) = libm::sincos(0.5 * libm::atan2(b, half));
    ([mean + radius, (mean - radius).max(0.0)], glam::DVec2::new(cos, sin))
}

/// The rotation to the directions u, v and u x v, which are unit vectors at right angles.
fn rotation(u: DVec3, v: DVec3) -> Quat {
    DQuat::from_mat3(&DMat3::from_cols(u, v, u.cross(v))).normalize().as_quat().normalize()
}

#[cfg(test)]
mod tests;
