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

/// Angle between normals below which a run is flat, radians.
const SPREAD_OF_FLAT: f32 = 0.02;

/// Some surfels of an object at a time sample.
pub(super) struct Run<'a> {
    pub object: &'a PosedObject,
    /// The origin of its model relative to the eye, world axes.
    origin: Vec3,
    /// Do they keep light from anything?
    pub casts: bool,
    /// Factor on their opacities; `None`: they are opaque. These alone receive shadows.
    pub opacity: Option<f32>,
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
}

impl<'a> Run<'a> {
    /// All that are visible, as far as their objects are: opaque ones before those that are see-through. `clusters`:
    /// one for each object.
    pub(super) fn all(frame: &'a Frame, sample: &'a PosedSample, clusters: &[Arc<Clusters>]) -> Vec<Self> {
        let of = |is_static, see_through| frame.visible_surfels(sample, is_static, see_through);
        let all = of(true, false).chain(of(false, false)).chain(of(true, true)).chain(of(false, true));
        let runs = all.flat_map(|(index, model)| {
            let posed = (&frame.objects[index], &sample.objects[index], frame.place_of(index, sample));
            let (paths, clusters) = (model.paths(), clusters.get(index));
            (0..model.surfels().len()).step_by(RUN).map(move |first| {
                let known = clusters.filter(|_| paths.is_empty()).and_then(|clusters| clusters.get(first / RUN));
                (posed, model.surfels(), paths, first, known)
            })
        });
        let runs: Vec<_> = runs.collect();
        let of = |run| {
            let (object, surfels, paths, first, known): (_, &'a Arc<Surfels>, _, _, _) = run;
            Self::of(object, surfels, paths, first, known)
        };
        runs.into_par_iter().map(of).collect()
    }

    fn of(
        (object, posed, origin): (&FrameObject, &'a PosedObject, Vec3),
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
        let normal = if cluster.spread < SPREAD_OF_FLAT { posed.normal_matrix * cluster.axis } else { Vec3::ZERO };
        Self {
            object: posed,
            origin,
            casts: object.cast_shadows,
            opacity: object.see_through.then_some(object.opacity),
            surfels,
            paths,
            first,
            len: range.len(),
            middle: linear * (0.5 * (low + high)) + origin,
            half,
            reach: half.length(),
            stretch: stretch.sqrt(),
            normal: normal.normalize_or_zero(),
        }
    }

    /// Centre `i` in the model.
    fn in_model(&self, i: usize) -> Vec3 {
        let i = self.first + i;
        self.paths.place(self.surfels.position[i], i, self.object.elapsed)
    }

    /// Centre `i`, relative to the eye, world axes.
    pub(super) fn centre(&self, i: usize) -> Vec3 {
        self.object.world_from_model * self.in_model(i) + self.origin
    }

    /// Axes of surfel `i` in the model.
    fn axes(&self, i: usize) -> [Vec3; 2] {
        [self.surfels.axis_u[self.first + i], self.surfels.axis_v[self.first + i]]
    }

    /// Opacity of surfel `i`, in [0, 1].
    pub(super) fn opacity_of(&self, i: usize) -> f32 {
        let own = self.surfels.opacity.get(self.first + i).copied().unwrap_or(1.0);
        self.opacity.map_or(1.0, |opacity| opacity * own)
    }

    /// A radius within which surfel `i` lies around its centre.
    pub(super) fn radius(&self, i: usize) -> f32 {
        let [u, v] = self.axes(i).map(Vec3::length_squared);
        (u + v).sqrt() * self.stretch
    }

    /// The surfels as `view` shows them.
    pub(super) fn seen_by<'b>(&'b self, view: &LightView) -> SeenRun<'b> {
        let from_model = view.turn(self.object.world_from_model);
        SeenRun { run: self, from_model, origin: view.place(self.origin) }
    }
}

/// A run as a view of a light shows it.
pub(super) struct SeenRun<'a> {
    pub run: &'a Run<'a>,
    from_model: Mat3,
    origin: Vec3,
}

impl SeenRun<'_> {
    /// Centre of surfel `i`, in the view's axes.
    pub(super) fn centre(&self, i: usize) -> Vec3 {
        self.from_model * self.run.in_model(i) + self.origin
    }

    /// Axes of surfel `i`, in those of the view.
    pub(super) fn axes(&self, i: usize) -> [Vec3; 2] {
        self.run.axes(i).map(|axis| self.from_model * axis)
    }
}
