//! A beam: intervals that hold the rays of a group in the space of one model, each ray at its own time. It tells which
//! Gaussians no ray of the group can meet.
//!
//! The rays are finite in number and their poses exact, so nothing is assumed about motion in between.

use glam::DVec3;

/// Margin against rounding, far larger than rounding itself, as a share of the coordinates.
const MARGIN: f64 = 1e-9;

/// One ray in model space, with what bounds Gaussians on it.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct BeamRay {
    /// The eye.
    pub origin: DVec3,
    /// Direction of camera depth 1.
    pub direction: DVec3,
    /// Camera depth of a point p is `forward` . p + `offset`.
    pub forward: DVec3,
    pub offset: f64,
    /// Nearest depth of a centre that is seen.
    pub near: f64,
    /// A Gaussian with the radius r that the ray meets has its centre within `growth` r + `slope` z of the ray's point
    /// at the centre's depth z, model units.
    pub growth: f64,
    pub slope: f64,
}

/// Intervals that hold the rays of a group.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct Beam {
    origin: [DVec3; 2],
    direction: [DVec3; 2],
    forward: [DVec3; 2],
    offset: [f64; 2],
    near: f64,
    /// Greatest depth of interest.
    far: f64,
    growth: f64,
    slope: f64,
    margin: f64,
}

impl Beam {
    /// The beam of all `rays`, up to the depth `far`, in a model whose coordinates are up to `extent`; `None` if there
    /// are no rays.
    pub(in crate::reference) fn around(mut rays: impl Iterator<Item = BeamRay>, far: f64, extent: f64) -> Option<Self> {
        let first = rays.next()?;
        let mut beam = Self {
            origin: [first.origin; 2],
            direction: [first.direction; 2],
            forward: [first.forward; 2],
            offset: [first.offset; 2],
            near: first.near,
            far,
            growth: first.growth,
            slope: first.slope,
            margin: 0.0,
        };
        for ray in rays {
            widen(&mut beam.origin, ray.origin);
            widen(&mut beam.direction, ray.direction);
            widen(&mut beam.forward, ray.forward);
            beam.offset = [beam.offset[0].min(ray.offset), beam.offset[1].max(ray.offset)];
            beam.near = beam.near.min(ray.near);
            beam.growth = beam.growth.max(ray.growth);
            beam.slope = beam.slope.max(ray.slope);
        }
        let farthest = beam.origin[0].abs().max(beam.origin[1].abs()).max_element();
        beam.margin = MARGIN * (farthest + extent);
        beam.growth *= 1.0 + MARGIN;
        beam.slope *= 1.0 + MARGIN;
        Some(beam)
    }

    /// False if no ray meets a Gaussian that has its centre in the box and a radius of at most `radius`.
    pub(in crate::reference) fn meets(&self, [low, high]: [DVec3; 2], radius: f64) -> bool {
        self.meets_between([low, high], radius, [self.near, self.far])
    }

    /// A lower bound of the depth at which the rays see the point, if they may meet a Gaussian with this centre and
    /// radius.
    pub(in crate::reference) fn nearest(&self, centre: DVec3, radius: f64) -> Option<f64> {
        let [a, b] = self.forward.map(|forward| forward * centre);
        let rounding = MARGIN * (a.abs().max(b.abs()).element_sum() + self.offset[0].abs().max(self.offset[1].abs()));
        let nearest = a.min(b).element_sum() + self.offset[0] - rounding;
        let farthest = a.max(b).element_sum() + self.offset[1] + rounding;
        let depths = [nearest.max(self.near), farthest.min(self.far)];
        self.meets_between([centre, centre], radius, depths).then_some(nearest)
    }

    /// At a depth z > 0 the rays' points lie in `origin` + z `direction`, axis by axis. The Gaussian is met where that
    /// overlaps the box, grown by growth radius + slope z: two conditions for each axis, each linear in z.
    fn meets_between(&self, [low, high]: [DVec3; 2], radius: f64, [mut near, mut far]: [f64; 2]) -> bool {
        let grown = self.growth * radius + self.margin;
        for axis in 0..3 {
            let conditions = [
                (self.direction[0][axis] - self.slope, high[axis] + grown - self.origin[0][axis]),
                (-self.direction[1][axis] - self.slope, self.origin[1][axis] + grown - low[axis]),
            ];
            // a z <= b. Where a number is NaN nothing is excluded.
            for (a, b) in conditions {
                if a > 0.0 {
                    far = far.min(b / a);
                } else if a < 0.0 {
                    near = near.max(b / a);
                } else if b < 0.0 {
                    return false;
                }
            }
        }
        // The quotients are rounded.
        near * (1.0 - MARGIN) <= far * (1.0 + MARGIN) || near.is_nan() || far.is_nan()
    }
}

fn widen(interval: &mut [DVec3; 2], value: DVec3) {
    *interval = [interval[0].min(value), interval[1].max(value)];
}
