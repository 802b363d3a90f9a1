//! Neighbouring surfels of an object, with a box around them: what is culled and drawn together.

use std::sync::Arc;

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::discs::Discs;
use super::view::LightView;
use crate::backend::clusters::{Cluster, Clusters};
use crate::backend::cpu::columns::{Columns, RUN, add_rates, transform, turn};
use crate::backend::cpu::tiles::{LANES, Lanes};
use crate::frame::{Frame, FrameObject, PosedObject, PosedSample};
use crate::model::Surfels;
use crate::model::paths::Paths;

/// Angle between normals below which a run is flat, radians.
const SPREAD_OF_FLAT: f32 = 0.02;

/// Some surfels of an object at a time sample.
pub(super) struct Run<'a> {
    pub object: &'a PosedObject,
    /// The origin of its model relative to the eye, world axes.
    origin: Vec3,
    /// Do they keep light from anything?
    pub casts: bool,
    /// Do shadows fall on them?
    pub receives: bool,
    /// Factor on their opacities; `None`: they are opaque.
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
            Cluster::of(surfels, range.clone(), centres)
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
            receives: object.receives,
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

    /// Its surfels in the model.
    #[inline(always)]
    pub(super) fn load(&self, columns: &mut Columns) {
        let range = self.first..self.first + self.len;
        columns.load(self.surfels, range.clone());
        add_rates(&mut columns.position, &self.paths, range, self.object.elapsed);
    }

    /// Centres relative to the eye, world axes, from those in the model.
    #[inline(always)]
    pub(super) fn centres(&self, in_model: &[Lanes; 3]) -> [Lanes; 3] {
        transform(&self.object.world_from_model, self.origin, in_model)
    }

    /// Opacity of surfel `i`, in [0, 1].
    pub(super) fn opacity_of(&self, i: usize) -> f32 {
        let own = self.surfels.opacity.get(self.first + i).copied().unwrap_or(1.0);
        self.opacity.map_or(1.0, |opacity| opacity * own)
    }

    /// Radii within which surfels with these axes in the model lie around their centres.
    #[inline(always)]
    pub(super) fn radii(&self, u: &[Lanes; 3], v: &[Lanes; 3]) -> Lanes {
        let mut radii = [0.0; LANES];
        for l in 0..LANES {
            let [u, v] = [u, v].map(|axis| axis[0][l] * axis[0][l] + axis[1][l] * axis[1][l] + axis[2][l] * axis[2][l]);
            radii[l] = (u + v).sqrt() * self.stretch;
        }
        radii
    }

    /// Radii of spheres with these axes in the model, world units; 0 of discs.
    #[inline(always)]
    pub(super) fn balls(&self, u: &[Lanes; 3]) -> Lanes {
        let mut radii = [0.0; LANES];
        for l in 0..LANES {
            radii[l] = (u[0][l] * u[0][l] + u[1][l] * u[1][l] + u[2][l] * u[2][l]).sqrt() * self.object.spheres;
        }
        radii
    }

    /// Are they spheres?
    pub(super) fn are_balls(&self) -> bool {
        self.object.spheres != 0.0
    }

    /// The surfels as `view` shows them.
    pub(super) fn seen_by<'b>(&'b self, view: &LightView) -> SeenRun<'b> {
        let from_model = view.turn(self.object.world_from_model);
        SeenRun { run: self, from_model, origin: view.place(self.origin), is_point: view.is_point }
    }
}

/// A run as a view of a light shows it.
pub(super) struct SeenRun<'a> {
    pub run: &'a Run<'a>,
    from_model: Mat3,
    origin: Vec3,
    is_point: bool,
}

impl SeenRun<'_> {
    /// Surfels of the model, as the view sees them.
    #[inline(always)]
    pub(super) fn discs(&self, [position, u, v]: &[[Lanes; 3]; 3]) -> Discs {
        let mut discs = Discs {
            centre: self.run.centres(position),
            seen: transform(&self.from_model, self.origin, position),
            axes: self.axes([u, v]),
        };
        if self.run.are_balls() {
            let radii = self.run.balls(u);
            (0..LANES).for_each(|l| discs.face_light(l, radii[l], self.is_point));
        }
        discs
    }

    /// Axes of surfels of the model, in those of the view.
    #[inline(always)]
    pub(super) fn axes(&self, of_model: [&[Lanes; 3]; 2]) -> [[Lanes; 3]; 2] {
        of_model.map(|axis| turn(&self.from_model, axis))
    }
}
