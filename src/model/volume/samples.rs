//! Samples of a volume in no order.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{MOST_EXTINCTION, SPACINGS};
use crate::math::srgb;
use crate::model::cloud::{Cloud, ColourStorage};

/// Samples of a volume, as structure of arrays.
///
/// A sample of radius r counts like a cell of a grid with the spacing r.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Places, model units.
    pub position: Vec<DVec3>,
    /// Radii, model units, > 0.
    pub radius: Vec<f32>,
    /// Values; extinction per scene unit where no transfer function says otherwise.
    pub density: Vec<f32>,
    /// Parts of space that the samples stand for, model units^3, > 0; empty: the cubes of the radii.
    pub volume: Vec<f32>,
    /// Colours, linear Rec.709; empty: white.
    pub colour: Vec<Vec3>,
    /// What a user should know.
    pub notes: Vec<String>,
}

impl Samples {
    /// The points of a cloud with densities and radii; `None` if it lacks one of them. Points without a finite density,
    /// a radius or a volume are left out. `linear` is the space of the colours, where the scene says it.
    pub(in crate::model) fn from_cloud(cloud: Cloud, linear: Option<bool>) -> Option<Self> {
        let points = cloud.position.len();
        if cloud.density.len() != points || cloud.radius.len() != points {
            return None;
        }
        let column = |column: &[f32], i: usize| column.get(i).copied();
        let in_range = |radius: f32| SPACINGS.contains(&f64::from(radius));
        let kept: Vec<usize> = (0..points)
            .filter(|&i| {
                let volume = column(&cloud.volume, i).is_none_or(|v| v > 0.0 && in_range(libm::cbrtf(v)));
                cloud.density[i].is_finite() && in_range(cloud.radius[i]) && volume
            })
            .collect();
        let mut notes = cloud.notes;
        if kept.len() < points {
            notes.push(format!(
                "volume: {} of {points} samples dropped, without a finite density or with a radius or volume out of \
                 range",
                points - kept.len()
            ));
        }
        let linear = linear.unwrap_or(cloud.colour_storage == ColourStorage::Float);
        let light = |colour: Vec3| {
            let colour = if linear { colour } else { Vec3::from_array(colour.to_array().map(srgb::to_linear)) };
            colour.clamp(Vec3::ZERO, Vec3::splat(1e6))
        };
        let some = |column: &[f32]| kept.iter().filter_map(|&i| column.get(i).copied()).collect();
        Some(Self {
            position: kept.iter().map(|&i| cloud.position[i]).collect(),
            radius: some(&cloud.radius),
            density: some(&cloud.density),
            volume: some(&cloud.volume),
            colour: kept.par_iter().filter_map(|&i| cloud.colour.get(i).copied()).map(light).collect(),
            notes,
        })
    }

    /// The part of space that a sample stands for, model units^3.
    pub(super) fn volume(&self, i: usize) -> f64 {
        let radius = f64::from(self.radius[i]);
        self.volume.get(i).map_or(radius * radius * radius, |volume| f64::from(*volume))
    }

    /// Extinction of a sample by its density alone, per scene unit.
    pub(super) fn extinction(&self, i: usize) -> f64 {
        f64::from(self.density[i]).clamp(0.0, MOST_EXTINCTION)
    }

    /// Median of the radii, model units; 0 for none.
    pub fn median_radius(&self) -> f32 {
        let mut radii = self.radius.clone();
        let middle = radii.len() / 2;
        if radii.is_empty() { 0.0 } else { *radii.select_nth_unstable_by(middle, f32::total_cmp).1 }
    }
}
