//! Where surfels land on a strip that a rolling shutter reads out row by row (docs/math.md, section 15).
//!
//! In: centres and axes in screen space at the middle of the strip, and their motion to its last row. Out: the same
//! when the row on which the centre lands is read out, and how the rows beside it see it displaced. Order-free.

use crate::frame::Raster;

/// A strip, as pixels count from the camera's axis.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Strip {
    /// 0: columns are read out one after the other, 1: rows are.
    pub axis: usize,
    /// From its middle to its last row, raster pixels.
    pub half: f32,
    /// Place of its middle.
    pub middle: f32,
}

impl Strip {
    /// The strip of a raster; `None` without a rolling shutter.
    pub(in crate::backend) fn of(raster: &Raster) -> Option<Self> {
        let axis = raster.readout?;
        let half = 0.5 * raster.size[axis] as f32;
        Some(Self { axis, half, middle: half - raster.axis[axis] + raster.offset[axis] })
    }

    /// When what lands at this place of the raster does: -1 at the first row, 1 at the last one.
    #[inline(always)]
    pub(in crate::backend) fn time(&self, place: [f32; 2]) -> f32 {
        let time = (place[self.axis] - self.half) / self.half;
        let time = if time > -1.0 { time } else { -1.0 };
        if time < 1.0 { time } else { 1.0 }
    }
}

/// What rows beside the one on which a centre lands see of it.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Landing {
    /// When it lands: -1 at the first row of the strip, 1 at its last one; what lands beside the strip is posed at the
    /// nearer of both.
    pub time: f32,
    /// From its place at that time to where it lands, pixels, x and y.
    pub shift: [f32; 2],
    /// Factor on distances along the read-out.
    pub along: f32,
    /// Displacement across the read-out, over that along it.
    pub across: f32,
    /// Motion away from the eye from one row to the next, scene units.
    pub recede: f32,
}

/// Least speed of rows over a centre, as a share of the read-out's. What keeps pace with the read-out would be seen by
/// all rows.
pub(in crate::backend) const LEAST_SPEED: f32 = 1.0 / 256.0;

impl Landing {
    /// Where a centre (x, y, depth, homogeneous pixel coordinates) lands with this motion from the middle to the last
    /// row. `AXIS` is the strip's, which the compiler knows, so that loops over surfels become vectors.
    #[inline(always)]
    pub(in crate::backend) fn new<const AXIS: usize>(strip: &Strip, centre: [f32; 3], motion: [f32; 3]) -> Self {
        let (k, o) = (AXIS, 1 - AXIS);
        let (depth, recede) = (centre[2], motion[2]);
        // The row of time t is read out where the centre is then: a quadratic equation in t.
        let quadratic = -strip.half * recede;
        let slowest = LEAST_SPEED * strip.half * depth;
        let linear = motion[k] - strip.middle * recede - strip.half * depth;
        let size = if linear < 0.0 { -linear } else { linear };
        let sign = if linear > 0.0 { 1.0 } else { -1.0 };
        let linear = if size > slowest { linear } else { sign * slowest };
        let constant = centre[k] - strip.middle * depth;
        let square = linear * linear - 4.0 * quadratic * constant;
        let root = (if square > 0.0 { square } else { 0.0 }).sqrt();
        let time = -2.0 * constant / (linear + sign * root);
        // Before the camera plane nothing lands.
        let nearest = depth - if recede < 0.0 { -recede } else { recede };
        let lands = nearest > 0.0;
        let time = if lands { time } else { 0.0 };
        let time = if time > -1.0 { time } else { -1.0 };
        let time = if time < 1.0 { time } else { 1.0 };
        let inverse = 1.0 / (depth + time * recede);
        let place = |i: usize| (centre[i] + time * motion[i]) * inverse;
        let velocity = |i: usize| (motion[i] - place(i) * recede) * inverse / strip.half;
        let speed = 1.0 - velocity(k);
        let size = if speed < 0.0 { -speed } else { speed };
        let slowest = if speed < 0.0 { -LEAST_SPEED } else { LEAST_SPEED };
        let speed = if size > LEAST_SPEED { speed } else { slowest };
        let along = if lands { 1.0 / speed } else { 1.0 };
        let across = if lands { velocity(o) } else { 0.0 };
        let beside = place(k) - (strip.middle + time * strip.half);
        let to_row = if lands { beside * along } else { 0.0 };
        let mut shift = [0.0; 2];
        shift[k] = if lands { to_row - beside } else { 0.0 };
        shift[o] = across * to_row;
        Self { time, shift, along, across, recede: if lands { recede / strip.half } else { 0.0 } }
    }

    /// Displaces a vector on the screen as the rows beside see it.
    #[inline(always)]
    pub(in crate::backend) fn displaced<const AXIS: usize>(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        if AXIS == 1 {
            let y = self.along * y;
            [x + self.across * y, y]
        } else {
            let x = self.along * x;
            [x, y + self.across * x]
        }
    }

    /// The covariance (xx, xy, yy) of what is displaced so.
    #[inline(always)]
    pub(in crate::backend) fn spread<const AXIS: usize>(&self, [xx, xy, yy]: [f32; 3]) -> [f32; 3] {
        let (along, across) = (self.along, self.across);
        if AXIS == 1 {
            let (xy, yy) = (along * xy, along * along * yy);
            [xx + across * (2.0 * xy + across * yy), xy + across * yy, yy]
        } else {
            let (xy, xx) = (along * xy, along * along * xx);
            [xx, xy + across * xx, yy + across * (2.0 * xy + across * xx)]
        }
    }
}
