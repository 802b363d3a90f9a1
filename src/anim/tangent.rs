//! Tangent vectors from tangent types, by Maya's rules.
//!
//! A tangent is a vector (X, Y) in time and value units. Its control point is key +/- (X, Y)/3, its slope Y/X.
//! Everything here is in the units of the file, because one rule (clamped) compares with an absolute length.

use glam::DVec2;

/// Type of a key's in or out tangent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Tangent {
    /// Set by hand: 3 w (cos a, sin a).
    Fixed(DVec2),
    /// Towards the neighbour.
    Linear,
    /// Horizontal.
    Flat,
    /// Parallel to the line between the neighbours.
    Spline,
    /// The value holds until the next key (as an out tangent).
    Step,
    /// The next key's value holds from just after this key on (as an out tangent).
    StepNext,
    /// Spline, but flat where a neighbour has nearly the same value.
    Clamped,
    /// Spline, but flat where it would overshoot.
    Plateau,
    /// Spline slope, limited so that it does not overshoot.
    Auto,
    /// Auto, with a slope mixed from both sides by distance.
    AutoMix,
    /// Auto, with a slope mixed from both sides by eased distance.
    AutoEase,
}

/// A key whose tangents are not yet vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RawKey {
    /// Time and value.
    pub(super) point: DVec2,
    /// Type of the tangent on the side of earlier times.
    pub(super) inward: Tangent,
    /// Type of the tangent on the side of later times.
    pub(super) outward: Tangent,
}

/// Steepest slope, value units per time unit: Maya's value for a vertical tangent.
const MAX_SLOPE: f64 = 5_729_577.948;

/// Greatest difference that makes a clamped tangent flat, file value units.
const CLAMPED_DIFFERENCE: f64 = 0.05;

/// In and out tangent of `key` between its neighbours (none at the ends of the curve).
///
/// For a weighted curve they are the vectors themselves, with X >= 0. For a non-weighted curve they are (1, slope), as
/// only the slope counts.
pub(super) fn vectors(previous: Option<DVec2>, key: &RawKey, next: Option<DVec2>, weighted: bool) -> (DVec2, DVec2) {
    let near = Neighbours { before: previous.map(|p| key.point - p), after: next.map(|n| n - key.point) };
    (finish(near.vector(key.inward, Side::In), weighted), finish(near.vector(key.outward, Side::Out), weighted))
}

fn finish(tangent: DVec2, weighted: bool) -> DVec2 {
    if weighted {
        return DVec2::new(tangent.x.max(0.0), tangent.y);
    }
    // A vertical tangent divides by zero. The infinity is limited like any other steep slope.
    let slope = if tangent.y == 0.0 { 0.0 } else { limited(tangent.y / tangent.x) };
    DVec2::new(1.0, slope)
}

fn limited(slope: f64) -> f64 {
    slope.clamp(-MAX_SLOPE, MAX_SLOPE)
}

#[derive(Clone, Copy, PartialEq)]
enum Side {
    In,
    Out,
}

/// Differences from the previous key to this one and from this one to the next; both have x > 0.
struct Neighbours {
    before: Option<DVec2>,
    after: Option<DVec2>,
}

impl Neighbours {
    fn vector(&self, tangent: Tangent, side: Side) -> DVec2 {
        let own = if side == Side::In { self.before } else { self.after };
        // At an end of the curve the length comes from the other side.
        let length = own.or(self.before).or(self.after).map_or(1.0, |step| step.x);
        let sloped = |slope: f64| length * DVec2::new(1.0, slope);
        match tangent {
            Tangent::Fixed(vector) => vector,
            Tangent::Linear => own.unwrap_or(DVec2::X),
            Tangent::Flat => sloped(0.0),
            Tangent::Spline => sloped(self.spline()),
            Tangent::Step | Tangent::StepNext => DVec2::ZERO,
            Tangent::Clamped => sloped(if self.has_near_neighbour() { 0.0 } else { self.spline() }),
            Tangent::Plateau => sloped(if self.plateau_is_flat(side) { 0.0 } else { self.spline() }),
            Tangent::Auto | Tangent::AutoMix | Tangent::AutoEase => sloped(self.auto(tangent)),
        }
    }

    /// Slope between the two neighbours; at an end of the curve, slope to the only neighbour.
    fn spline(&self) -> f64 {
        let step = match (self.before, self.after) {
            (Some(before), Some(after)) => before + after,
            (Some(only), None) | (None, Some(only)) => only,
            (None, None) => return 0.0,
        };
        limited(step.y / step.x)
    }

    fn has_near_neighbour(&self) -> bool {
        [self.before, self.after].into_iter().flatten().any(|step| step.y.abs() <= CLAMPED_DIFFERENCE)
    }

    /// True at an end and at an extremum. True also where the spline's control point would pass the neighbour's value
    /// or leave the band that the neighbour on the other side sets.
    fn plateau_is_flat(&self, side: Side) -> bool {
        let (Some(before), Some(after)) = (self.before, self.after) else { return true };
        let (to_previous, to_next) = (-before.y, after.y);
        if to_previous * to_next >= 0.0 {
            return true;
        }
        let (own, other, own_length, other_length) = match side {
            Side::In => (to_previous, to_next, before.x, after.x),
            Side::Out => (to_next, to_previous, after.x, before.x),
        };
        let control = (own - other) * own_length / (3.0 * (own_length + other_length));
        let mirrored = -other / own < other_length / own_length;
        let limit = if mirrored { -other * own_length / other_length } else { own };
        control.abs() > limit.abs()
    }

    /// Slope that overshoots neither neighbour; it is flat at the ends and at extrema.
    fn auto(&self, tangent: Tangent) -> f64 {
        let (Some(before), Some(after)) = (self.before, self.after) else { return 0.0 };
        let (p, n) = (limited(before.y / before.x), limited(after.y / after.x));
        let mixed = |f: f64| (1.0 - f) * p + f * n;
        let part = before.x / (before.x + after.x);
        let wanted = match tangent {
            Tangent::AutoMix => mixed(part),
            Tangent::AutoEase => {
                let centred = part - 0.5;
                mixed(0.5 + centred * (1.5 - 2.0 * centred * centred))
            }
            _ => self.spline(),
        };
        let falls = |slope: f64| slope < 0.0;
        if falls(p) != falls(n) || falls(wanted) != falls(n) {
            return 0.0;
        }
        let most = 3.0 * p.abs().min(n.abs());
        wanted.clamp(-most, most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anim::segment::slope;

    const PREVIOUS: Option<DVec2> = Some(DVec2::new(0.0, 0.0));

    /// Slopes of the tangents of (2, `value`) between (0, 0) and (6, `next`).
    fn slopes(tangent: Tangent, value: f64, next: f64) -> (f64, f64) {
        let key = RawKey { point: DVec2::new(2.0, value), inward: tangent, outward: tangent };
        let (i, o) = vectors(PREVIOUS, &key, Some(DVec2::new(6.0, next)), false);
        (slope(i), slope(o))
    }

    fn weighted(tangent: Tangent, previous: bool, next: bool) -> (DVec2, DVec2) {
        let key = RawKey { point: DVec2::new(2.0, 1.0), inward: tangent, outward: tangent };
        vectors(PREVIOUS.filter(|_| previous), &key, Some(DVec2::new(6.0, 9.0)).filter(|_| next), true)
    }

    #[test]
    fn plain_types() {
        assert_eq!(slopes(Tangent::Linear, 1.0, 9.0), (0.5, 2.0));
        assert_eq!(slopes(Tangent::Flat, 1.0, 9.0), (0.0, 0.0));
        assert_eq!(slopes(Tangent::Spline, 1.0, 9.0), (1.5, 1.5));
        assert_eq!(slopes(Tangent::Step, 1.0, 9.0), (0.0, 0.0));
        assert_eq!(slopes(Tangent::Fixed(DVec2::new(2.0, 3.0)), 1.0, 9.0), (1.5, 1.5));
    }

    #[test]
    fn lengths_of_weighted_tangents() {
        let (v, h) = (DVec2::new, |x| DVec2::new(x, 0.0));
        assert_eq!(weighted(Tangent::Linear, true, true), (v(2.0, 1.0), v(4.0, 8.0)));
        assert_eq!(weighted(Tangent::Flat, true, true), (h(2.0), h(4.0)));
        assert_eq!(weighted(Tangent::Spline, true, true), (v(2.0, 3.0), v(4.0, 6.0)));
        assert_eq!(weighted(Tangent::Step, true, true), (h(0.0), h(0.0)));
        // At an end a linear tangent has no direction. The others take the length of the other side.
        assert_eq!(weighted(Tangent::Linear, false, true), (h(1.0), v(4.0, 8.0)));
        assert_eq!(weighted(Tangent::Linear, true, false), (v(2.0, 1.0), h(1.0)));
        assert_eq!(weighted(Tangent::Flat, false, true), (h(4.0), h(4.0)));
        assert_eq!(weighted(Tangent::Flat, true, false), (h(2.0), h(2.0)));
        assert_eq!(weighted(Tangent::Spline, false, true), (v(4.0, 8.0), v(4.0, 8.0)));
        assert_eq!(weighted(Tangent::Auto, false, true), (h(4.0), h(4.0)));
        assert_eq!(weighted(Tangent::Plateau, true, false), (h(2.0), h(2.0)));
        // A tangent cannot point backwards in time.
        let backwards = Tangent::Fixed(v(-3.0, 5.0));
        assert_eq!(weighted(backwards, true, true).1, v(0.0, 5.0));
    }

    #[test]
    fn a_vertical_fixed_tangent_has_a_finite_slope() {
        assert_eq!(slopes(Tangent::Fixed(DVec2::new(0.0, 3.0)), 1.0, 9.0).0, MAX_SLOPE);
        assert_eq!(slopes(Tangent::Fixed(DVec2::new(0.0, -3.0)), 1.0, 9.0).1, -MAX_SLOPE);
        assert_eq!(slopes(Tangent::Fixed(DVec2::ZERO), 1.0, 9.0).0, 0.0);
        assert_eq!(slopes(Tangent::Fixed(DVec2::new(1e-9, 1.0)), 1.0, 9.0).0, MAX_SLOPE);
    }

    #[test]
    fn clamped_is_flat_next_to_an_equal_value() {
        assert_eq!(slopes(Tangent::Clamped, 0.05, 9.0), (0.0, 0.0));
        assert_eq!(slopes(Tangent::Clamped, 0.051, 9.0), (1.5, 1.5));
        assert_eq!(slopes(Tangent::Clamped, 9.04, 9.0), (0.0, 0.0));
        // An end copies the only difference. A steep one follows the spline rule.
        assert_eq!(weighted(Tangent::Clamped, false, true).1, DVec2::new(4.0, 8.0));
    }

    #[test]
    fn auto_is_limited_by_the_flatter_side() {
        // The slopes are 0.5 and 2. The spline's slope 1.5 just meets the limit 3 * 0.5.
        assert_eq!(slopes(Tangent::Auto, 1.0, 9.0), (1.5, 1.5));
        // The slopes are 0.05 and 2.225, so the limit is 0.15.
        let (i, o) = slopes(Tangent::Auto, 0.1, 9.0);
        assert!((i - 0.15).abs() < 1e-15 && i == o);
        assert_eq!(slopes(Tangent::Auto, -1.0, -9.0), (-1.5, -1.5));
        // First an extremum, then a plateau on either side.
        assert_eq!(slopes(Tangent::Auto, 5.0, 1.0), (0.0, 0.0));
        assert_eq!(slopes(Tangent::Auto, 0.0, 9.0), (0.0, 0.0));
        assert_eq!(slopes(Tangent::Auto, 9.0, 9.0), (0.0, 0.0));
        assert_eq!(slopes(Tangent::Auto, 0.0, -9.0), (0.0, 0.0));
    }

    #[test]
    fn auto_mix_and_ease_weigh_the_sides() {
        // The slopes are 1 and 1.5, and the part is 2/6: mix = 1 + 0.5/3.
        assert!((slopes(Tangent::AutoMix, 2.0, 8.0).0 - (1.0 + 0.5 / 3.0)).abs() < 1e-15);
        // The eased part is 0.5 - (1/6)(1.5 - 2/36) = 0.259259...
        assert!((slopes(Tangent::AutoEase, 2.0, 8.0).1 - (1.0 + 0.5 * 7.0 / 27.0)).abs() < 1e-15);
        // The limit is that of auto; the slopes are 0.01 and 100.
        assert!((slopes(Tangent::AutoMix, 0.02, 400.02).0 - 0.03).abs() < 1e-14);
        assert_eq!(slopes(Tangent::AutoEase, 5.0, 1.0), (0.0, 0.0));
    }

    #[test]
    fn plateau_is_flat_where_the_spline_overshoots() {
        // The slopes are 0.5 and 2, so the spline's is 1.5. On the in side the control point is 1 below the key, as is
        // the neighbour: just allowed.
        assert_eq!(slopes(Tangent::Plateau, 1.0, 9.0), (1.5, 1.5));
        // With the slope 0.25 on the left, the spline's control point would pass the previous value.
        assert_eq!(slopes(Tangent::Plateau, 0.5, 9.0).0, 0.0);
        assert_eq!(slopes(Tangent::Plateau, -0.5, -9.0).0, 0.0);
        // The key is nearly at the next value: the out side overshoots, and so does the mirrored in side.
        assert_eq!(slopes(Tangent::Plateau, 8.9, 9.0), (0.0, 0.0));
        assert_eq!(slopes(Tangent::Plateau, 10.0, 9.0), (0.0, 0.0));
        assert_eq!(slopes(Tangent::Plateau, 0.0, 9.0), (0.0, 0.0));
    }
}
