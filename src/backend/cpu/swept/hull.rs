//! Which pixels of a row a swept kernel may touch, so that an elongated kernel does not cost its bounding square.

use crate::layout::{FLAG_CROSSING, SweptSplat};

/// Slack against rounding, pixels.
pub(in crate::backend) const HULL_SLACK: f32 = 1e-2;

/// The boxes around a kernel at times between its ends: box(t) = (1 - t) box(0) + t box(1), t in [0, 1]. Their union is
/// the convex hull of the boxes at the ends, and holds the kernel.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Hull {
    from: [f32; 4],
    change: [f32; 4],
    /// 1 over the change of the first and of the last row.
    inverse: [f32; 2],
    /// First and last pixel column.
    columns: [i32; 2],
    whole: bool,
}

impl Hull {
    #[inline(always)]
    pub(in crate::backend) fn of(splat: &SweptSplat) -> Self {
        let [from, to] = splat.ends;
        let change = [0, 1, 2, 3].map(|i| to[i] - from[i]);
        Self {
            from,
            change,
            inverse: [1.0 / change[2], 1.0 / change[3]],
            columns: [i32::from(splat.bounds[0]), i32::from(splat.bounds[1])],
            whole: splat.flags & FLAG_CROSSING != 0,
        }
    }

    /// First and last pixel column in the pixel rows `first..=last`; none if the first is not at most the last.
    #[inline(always)]
    pub(in crate::backend) fn columns(&self, first: f32, last: f32) -> [i32; 2] {
        if self.whole {
            return self.columns;
        }
        // Times at which the box's first row is at most `last`, and its last row at least `first`.
        let mut start = 0.0_f32;
        let mut end = 1.0_f32;
        let mut meets = true;
        let mut cut = |room: f32, change: f32, inverse: f32| {
            // room - t change >= 0
            if change == 0.0 {
                meets &= room >= 0.0;
            } else {
                let at = room * inverse;
                if change > 0.0 {
                    end = end.min(at);
                } else {
                    start = start.max(at);
                }
            }
        };
        cut(last + HULL_SLACK - self.from[2], self.change[2], self.inverse[0]);
        cut(self.from[3] - (first - HULL_SLACK), -self.change[3], -self.inverse[1]);
        if !(meets && start <= end) {
            return [1, 0];
        }
        let at = |side: usize, time: f32| self.from[side] + time * self.change[side];
        let low = at(0, start).min(at(0, end)) - HULL_SLACK;
        let high = at(1, start).max(at(1, end)) + HULL_SLACK;
        let [x0, x1] = self.columns;
        [(low.ceil() as i32).max(x0), (high.floor() as i32).min(x1)]
    }
}
