//! The curve between two neighbouring keys: a cubic Hermite for non-weighted curves, a 2D Bezier for weighted ones.

use glam::DVec2;

/// Two neighbouring keys and the tangents that face each other. The control point of a tangent (X, Y) is key +/- (X,
/// Y)/3.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// First key (time, value).
    pub(super) start: DVec2,
    /// Out tangent of the first key.
    pub(super) out: DVec2,
    /// Second key (time, value), later than `start`.
    pub(super) end: DVec2,
    /// In tangent of the second key.
    pub(super) inward: DVec2,
}

/// Slope of a tangent; 0 for a tangent without length in time.
pub(super) fn slope(tangent: DVec2) -> f64 {
    if tangent.x == 0.0 { 0.0 } else { tangent.y / tangent.x }
}

/// Upper bound of |slope| of a cubic with these slopes at its ends and this chord. It is the greatest control point of
/// the derivative.
pub(super) fn steepness(first: f64, last: f64, chord: f64) -> f64 {
    first.abs().max(last.abs()).max((3.0 * chord - first - last).abs())
}

impl Segment {
    /// Cubic Hermite at `time` in [start, end]. With D = x3 - x0, s = (t - x0)/D, h = slope D and d = y3 - y0:
    /// y = y0 + s (h0 + s (3d - 2 h0 - h1 + s (h0 + h1 - 2d))).
    ///
    /// No power of D appears with the normalised s, so very short segments cannot overflow.
    pub(super) fn hermite(&self, time: f64) -> f64 {
        let span = self.end - self.start;
        let s = (time - self.start.x) / span.x;
        let (h0, h1) = (slope(self.out) * span.x, slope(self.inward) * span.x);
        let rise = span.y;
        self.start.y + s * (h0 + s * (3.0 * rise - 2.0 * h0 - h1 + s * (h0 + h1 - 2.0 * rise)))
    }

    /// Upper bound of |dy/dt| of [`Self::hermite`].
    pub(super) fn hermite_steepness(&self) -> f64 {
        let span = self.end - self.start;
        steepness(slope(self.out), slope(self.inward), span.y / span.x)
    }

    /// Upper bound of |dy/dt| of [`Self::bezier`]: the greatest |dy/ds| over the least dx/ds, each taken from the
    /// control points of the derivative. It is infinite where a handle has no length in time.
    pub(super) fn bezier_steepness(&self) -> f64 {
        let ([a, b], [y1, y2]) = self.handles();
        let span = self.end.x - self.start.x;
        let rises = [y1 - self.start.y, y2 - y1, self.end.y - y2].map(f64::abs);
        let least = a.min(b - a).min(1.0 - b);
        if least > 0.0 { rises.into_iter().fold(0.0, f64::max) / (least * span) } else { f64::INFINITY }
    }

    /// Control points of the Bezier curve: times as fractions of the segment, and values.
    fn handles(&self) -> ([f64; 2], [f64; 2]) {
        let span = self.end - self.start;
        let a = (self.out.x / 3.0 / span.x).max(0.0);
        let q = (self.inward.x / 3.0 / span.x).max(0.0);
        let (a1, q1) = monotonic(a, q);
        // A control point that moves stays on its tangent.
        let y1 = self.start.y + self.out.y / 3.0 * ratio(a1, a);
        let y2 = self.end.y - self.inward.y / 3.0 * ratio(q1, q);
        ([a1, 1.0 - q1], [y1, y2])
    }

    /// 2D Bezier at `time` in [start, end]: solves x(s) = t for s and returns y(s).
    pub(super) fn bezier(&self, time: f64) -> f64 {
        let ([a, b], [y1, y2]) = self.handles();
        let s = solve(a, b, (time - self.start.x) / (self.end.x - self.start.x));
        let r = 1.0 - s;
        r * r * r * self.start.y + 3.0 * s * r * (r * y1 + s * y2) + s * s * s * self.end.y
    }
}

/// Handle lengths (fractions of the segment's duration) for which x(s) does not run backwards.
///
/// x(s) is monotonic inside the unit square and inside the ellipse a^2 + q^2 + aq - 2(a + q) + 1 = 0. Outside both, `q`
/// moves to the ellipse for this `a`; beyond the ellipse's rightmost point both move to that point, (4/3, 1/3).
fn monotonic(a: f64, q: f64) -> (f64, f64) {
    if a <= 1.0 && q <= 1.0 {
        return (a, q);
    }
    if a >= 4.0 / 3.0 {
        return (4.0 / 3.0, 1.0 / 3.0);
    }
    if a * a + q * q + a * q - 2.0 * (a + q) + 1.0 <= 0.0 {
        return (a, q);
    }
    let (centre, half) = (1.0 - 0.5 * a, 0.5 * libm::sqrt((a * (4.0 - 3.0 * a)).max(0.0)));
    (a, q.clamp(centre - half, centre + half))
}

/// Factor by which a handle grew. A handle without length has no direction to move along.
fn ratio(new: f64, old: f64) -> f64 {
    if old == 0.0 || new == old { 1.0 } else { new / old }
}

/// The s in [0, 1] with 3 a s (1-s)^2 + 3 b s^2 (1-s) + s^3 = x, for x in [0, 1] and a monotonic curve.
///
/// Newton's method works inside a shrinking bracket. A step that leaves the bracket, or starts at a flat spot, is
/// replaced by a bisection.
fn solve(a: f64, b: f64, x: f64) -> f64 {
    let (c1, c2, c3) = (3.0 * a, 3.0 * b - 6.0 * a, 1.0 + 3.0 * a - 3.0 * b);
    let (mut low, mut high) = (0.0, 1.0);
    let mut s = x;
    for _ in 0..100 {
        let error = s * (c1 + s * (c2 + s * c3)) - x;
        if error == 0.0 {
            break;
        }
        if error < 0.0 {
            low = s;
        } else {
            high = s;
        }
        let derivative = c1 + s * (2.0 * c2 + s * 3.0 * c3);
        let newton = s - error / derivative;
        // NaN and infinity (from a derivative of 0) fail the test too.
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - s).abs() <= f64::EPSILON * 0.25 {
            s = next;
            break;
        }
        s = next;
    }
    s
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(out: (f64, f64), inward: (f64, f64)) -> Segment {
        Segment { start: DVec2::new(10.0, 1.0), out: out.into(), end: DVec2::new(16.0, 4.0), inward: inward.into() }
    }

    #[test]
    fn tangents_along_the_chord_give_the_straight_line() {
        let line = segment((6.0, 3.0), (6.0, 3.0));
        for i in 0..=24 {
            let t = 10.0 + f64::from(i) / 4.0;
            let y = 1.0 + (t - 10.0) / 2.0;
            assert!((line.hermite(t) - y).abs() < 1e-14);
            assert!((line.bezier(t) - y).abs() < 1e-14);
        }
    }

    #[test]
    fn hermite_meets_values_and_slopes_at_its_ends() {
        let s = segment((2.0, 5.0), (1.0, -3.0));
        let h = 1e-6;
        assert_eq!(s.hermite(10.0), 1.0);
        assert!((s.hermite(16.0) - 4.0).abs() < 1e-14);
        assert!(((s.hermite(10.0 + h) - 1.0) / h - 2.5).abs() < 1e-4);
        assert!(((4.0 - s.hermite(16.0 - h)) / h + 3.0).abs() < 1e-4);
    }

    #[test]
    fn a_third_of_the_span_makes_bezier_and_hermite_equal() {
        // The handles are a third of the span long, so x(s) = s and both are the same cubic.
        let s = segment((6.0, 9.0), (6.0, -4.0));
        for i in 0..=60 {
            let t = 10.0 + f64::from(i) / 10.0;
            assert!((s.bezier(t) - s.hermite(t)).abs() < 1e-13, "{t}");
        }
    }

    #[test]
    fn bezier_against_its_parametric_form() {
        // The handles are uneven. Points are computed from s and then looked up by time.
        let s = segment((12.0, 9.0), (3.0, -4.0));
        let (p0, p3) = (s.start, s.end);
        let (p1, p2) = (p0 + s.out / 3.0, p3 - s.inward / 3.0);
        for i in 0..=50 {
            let k = f64::from(i) / 50.0;
            let r = 1.0 - k;
            let p = p0 * (r * r * r) + p1 * (3.0 * r * r * k) + p2 * (3.0 * r * k * k) + p3 * (k * k * k);
            assert!((s.bezier(p.x) - p.y).abs() < 1e-9, "{k}");
        }
    }

    #[test]
    fn a_vertical_start_is_solved() {
        // Both handles have no length: x(s) = 3s^2 - 2s^3 has derivative 0 at the ends.
        let s = segment((0.0, 0.0), (0.0, 0.0));
        assert_eq!(s.bezier(10.0), 1.0);
        assert!((s.bezier(13.0) - 2.5).abs() < 1e-14);
        assert!((s.bezier(16.0) - 4.0).abs() < 1e-14);
        assert!(s.bezier(10.0 + 1e-12) < 1.0 + 1e-6);
    }

    #[test]
    fn long_handles_are_shortened_until_time_runs_forward() {
        let inside_the_ellipse = (1.2, 0.4);
        assert_eq!(monotonic(inside_the_ellipse.0, inside_the_ellipse.1), inside_the_ellipse);
        assert_eq!(monotonic(1.0, 1.0), (1.0, 1.0));
        assert_eq!(monotonic(5.0, 0.0), (4.0 / 3.0, 1.0 / 3.0));
        let bad = [(1.2, 0.0), (1.2, 0.9), (0.5, 1.4), (0.0, 3.0), (1.01, 1.0), (1.333, 0.0), (1.3, 50.0), (9.0, 9.0)];
        for (a, q) in bad {
            let (a, q) = monotonic(a, q);
            let x = |s: f64| 3.0 * a * s * (1.0 - s) * (1.0 - s) + 3.0 * (1.0 - q) * s * s * (1.0 - s) + s * s * s;
            for i in 0..1000 {
                let (s, next) = (f64::from(i) / 1000.0, f64::from(i + 1) / 1000.0);
                assert!(x(next) >= x(s) - 1e-12, "{a} {q} {s}");
            }
        }
    }

    #[test]
    fn a_shortened_handle_keeps_its_direction() {
        // a = 2 becomes 4/3 and q = 0.1 becomes 1/3; the y offsets are scaled by the same factors.
        let long = segment((36.0, 9.0), (1.8, 0.6));
        let short = segment((24.0, 6.0), (6.0, 2.0));
        for i in 0..=60 {
            let t = 10.0 + f64::from(i) / 10.0;
            assert!((long.bezier(t) - short.bezier(t)).abs() < 1e-12, "{t}");
        }
    }
}
