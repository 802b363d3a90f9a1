//! Neighbouring surfels of an object, with a box around them: what is culled and drawn together.

use std::sync::Arc;

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::view::LightView;
use crate::backend::clusters::{CLUSTER_SURFELS, Cluster, Clusters};
use crate::frame::{Frame, FrameObject, PosedObject, PosedSample};
use crate::model::Surfels;
use crate::model::paths::Paths;

/// Most surfels of a run.
pub(super) const RUN: usize = CLUSTER_SURFELS;

/// Cosine between a closed model's outer side and the light below which a surfel casts nothing that fronts do not.
/// Those that are nearer to its outline reach beyond it.
const BACK: f32 = -0.25;

/// Some surfels of an opaque object at a time sample.
pub(super) struct Run<'a> {
    pub object: &'a PosedObject,
    surfels: &'a Surfels,
    paths: Paths<'a>,
    /// Number of the first one, and how many there are.
    first: usize,
    pub len: usize,
    /// Middle and half the size of a box around all kernels, relative to the eye in world axes; not numbers where no
    /// kernel is finite.
    pub middle: Vec3,
    pub half: Vec3,
    /// Radius of a ball around the box.
    pub reach: f32,
    /// Factor on radii, at the most.
    stretch: f32,
    /// About their mean normal, world axes; 0 where they are not flat.
    pub normal: Vec3,
    /// Does it hide its backs, and are they behind its fronts from everywhere?
    is_closed: bool,
}

impl<'a> Run<'a> {
    /// All that are visible, as far as their objects are. `clusters`: one for each object.
    pub(super) fn all(frame: &'a Frame, sample: &'a PosedSample, clusters: &[Arc<Clusters>]) -> Vec<Self> {
        let of = |is_static| frame.visible_surfels(sample, is_static, false);
        let runs = of(true).chain(of(false)).flat_map(|(index, model)| {
            let object = &frame.objects[index];
            let (posed, paths, clusters) = (&sample.objects[index], model.paths(), clusters.get(index));
            (0..model.surfels().len()).step_by(RUN).map(move |first| {
                let known = clusters.filter(|_| paths.is_empty()).and_then(|clusters| clusters.get(first / RUN));
                (object, posed, model.surfels(), paths, first, known)
            })
        });
        let runs: Vec<_> = runs.collect();
        let of = |run| {
            let (object, posed, surfels, paths, first, known): (&FrameObject, _, &'a Arc<Surfels>, _, _, _) = run;
            Self::of(object, posed, surfels, paths, first, known)
        };
        runs.into_par_iter().map(of).collect()
    }

    fn of(
        object: &FrameObject,
        posed: &'a PosedObject,
        surfels: &'a Surfels,
        paths: Paths<'a>,
        first: usize,
        known: Option<Cluster>,
    ) -> Self {
        let range = first..(first + RUN).min(surfels.len());
        let cluster = known.unwrap_or_else(|| {
            let centres = range.clone().map(|i| paths.place(surfels.position[i], i, posed.elapsed));
            Cluster::of(centres, &surfels.axis_u[range.clone()], &surfels.axis_v[range.clone()])
        });
        let linear = posed.world_from_model;
        let [low, high] = cluster.corners;
        let half = linear.abs() * (0.5 * (high - low));
        // A map stretches by no more than the root of the sum of the squares of its columns.
        let stretch = linear.x_axis.length_squared() + linear.y_axis.length_squared() + linear.z_axis.length_squared();
        let normal = if cluster.spread < FLAT { posed.normal_matrix * cluster.axis } else { Vec3::ZERO };
        Self {
            object: posed,
            surfels,
            paths,
            first,
            len: range.len(),
            middle: linear * (0.5 * (low + high)) + posed.world_origin,
            half,
            reach: half.length(),
            stretch: stretch.sqrt(),
            normal: normal.normalize_or_zero(),
            is_closed: !object.two_sided && !surfels.two_sided,
        }
    }

    /// Centre `i` in the model.
    fn in_model(&self, i: usize) -> Vec3 {
        let i = self.first + i;
        self.paths.place(self.surfels.position[i], i, self.object.elapsed)
    }

    /// Centre `i`, relative to the eye, world axes.
    pub(super) fn centre(&self, i: usize) -> Vec3 {
        self.object.world_from_model * self.in_model(i) + self.object.world_origin
    }

    /// Axes of surfel `i` in the model.
    fn axes(&self, i: usize) -> [Vec3; 2] {
        [self.surfels.axis_u[self.first + i], self.surfels.axis_v[self.first + i]]
    }

    /// A radius within which surfel `i` lies around its centre.
    pub(super) fn radius(&self, i: usize) -> f32 {
        let [u, v] = self.axes(i).map(Vec3::length_squared);
        (u + v).sqrt() * self.stretch
    }

    /// The surfels as `view` shows them.
    pub(super) fn seen_by<'b>(&'b self, view: &LightView) -> SeenRun<'b> {
        let object = self.object;
        let light = view.light();
        let from_world = object.world_from_model.inverse();
        // Where light comes from: a place in the model, or a direction.
        let light = from_world * if view.is_point { light - object.world_origin } else { light };
        SeenRun {
            run: self,
            from_model: view.turn(object.world_from_model),
            origin: view.place(object.world_origin),
            light: (self.is_closed && light.is_finite()).then_some(light),
            is_point: view.is_point,
        }
    }
}

/// A run as a view of a light shows it.
pub(super) struct SeenRun<'a> {
    pub run: &'a Run<'a>,
    from_model: Mat3,
    origin: Vec3,
    /// Where light comes from, in the model; `None` where both sides cast.
    light: Option<Vec3>,
    is_point: bool,
}

impl SeenRun<'_> {
    /// Centre of surfel `i`, in the view's axes; `None` if the surfel casts nothing that others do not.
    pub(super) fn caster(&self, i: usize) -> Option<Vec3> {
        let place = self.run.in_model(i);
        if let Some(light) = self.light {
            let [u, v] = self.run.axes(i);
            let towards = if self.is_point { light - place } else { light };
            let normal = u.cross(v);
            let along = normal.dot(towards);
            if along < 0.0 && along * along > BACK * BACK * normal.length_squared() * towards.length_squared() {
                return None;
            }
        }
        Some(self.from_model * place + self.origin)
    }

    /// Axes of surfel `i`, in those of the view.
    pub(super) fn axes(&self, i: usize) -> [Vec3; 2] {
        self.run.axes(i).map(|axis| self.from_model * axis)
    }
}

/// Angle between normals below which a run is flat, radians.
const FLAT: f32 = 0.02;
