//! One animated property of a glTF node: its keys, and its value between them (glTF 2.0, section 3.11 and appendix C).

use std::sync::Arc;

use glam::{DQuat, DVec4};

/// How values between keys are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Between {
    /// The value of the key before.
    Step,
    /// On a straight line; rotations along the shorter arc.
    Linear,
    /// A cubic Hermite spline with the tangents of the file.
    Cubic,
}

/// What a track moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Property {
    Translation,
    Rotation,
    Scale,
}

/// Keys of one property. Times do not fall, and there is at least one.
#[derive(Clone, Debug)]
pub(super) struct Track {
    pub(super) property: Property,
    pub(super) between: Between,
    /// Seconds.
    pub(super) times: Arc<[f64]>,
    /// One for each time, or three for a spline: tangent before, value, tangent after. Rotations are x, y, z, w, and
    /// unit but for tangents; vectors have 0 at the end.
    pub(super) values: Arc<[DVec4]>,
}

/// The clock of a file: key times that miss a frame by the rounding of `f32` are on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Clock {
    /// Frames per second.
    pub(super) fps: f64,
}

impl Clock {
    /// The time of a key, seconds.
    pub(super) fn key(self, seconds: f64) -> f64 {
        let frame = seconds * self.fps;
        let whole = libm::rint(frame);
        if (frame - whole).abs() <= 1e-6 * whole.abs().max(1.0) { whole / self.fps } else { seconds }
    }
}

impl Track {
    /// The value of key `k`.
    pub(super) fn value(&self, k: usize) -> DVec4 {
        let index = if self.between == Between::Cubic { 3 * k + 1 } else { k };
        self.values.get(index).copied().unwrap_or_default()
    }

    pub(super) fn last(&self) -> usize {
        self.times.len().saturating_sub(1)
    }

    /// The value at a time. It holds before the first key and after the last.
    pub(super) fn at(&self, seconds: f64, clock: Clock) -> DVec4 {
        let after = self.times.partition_point(|&time| clock.key(time) <= seconds);
        let Some(k) = after.checked_sub(1) else { return self.value(0) };
        if k >= self.last() || self.between == Between::Step {
            return self.value(k.min(self.last()));
        }
        let (from, to) = (clock.key(self.times[k]), clock.key(self.times[k + 1]));
        let (length, u) = (to - from, (seconds - from) / (to - from));
        let (a, b) = (self.value(k), self.value(k + 1));
        match (self.between, self.property) {
            (Between::Cubic, property) => {
                let (leaving, arriving) = (self.values[3 * k + 2] * length, self.values[3 * k + 3] * length);
                let (u2, u3) = (u * u, u * u * u);
                let value = a * (2.0 * u3 - 3.0 * u2 + 1.0)
                    + leaving * (u3 - 2.0 * u2 + u)
                    + b * (3.0 * u2 - 2.0 * u3)
                    + arriving * (u3 - u2);
                if property == Property::Rotation { value.try_normalize().unwrap_or(a) } else { value }
            }
            (_, Property::Rotation) => slerp(a, b, u),
            _ => a + (b - a) * u,
        }
    }

    /// Upper bound of the speed between two times, per second: of the length of a vector, or the angle of a rotation in
    /// radians; `None` where it is not known, or the value jumps.
    pub(super) fn speed(&self, from: f64, to: f64, clock: Clock) -> Option<f64> {
        let start = self.times.partition_point(|&time| clock.key(time) < from).saturating_sub(1);
        let mut most = 0.0_f64;
        for k in start..self.last() {
            let (early, late) = (clock.key(self.times[k]), clock.key(self.times[k + 1]));
            if early > to {
                break;
            }
            let (a, b, length) = (self.value(k), self.value(k + 1), late - early);
            let turns = self.property == Property::Rotation;
            let same = if turns { a.dot(b).abs() >= 1.0 } else { a == b };
            let speed = match self.between {
                Between::Step if same => 0.0,
                Between::Linear if turns => 2.0 * libm::acos(a.dot(b).abs().min(1.0)) / length,
                Between::Linear => (b - a).length() / length,
                // The derivatives of the Hermite basis are at most 3/2, 1 and 1.
                Between::Cubic if !turns => {
                    1.5 * (b - a).length() / length + self.values[3 * k + 2].length() + self.values[3 * k + 3].length()
                }
                Between::Step | Between::Cubic => return None,
            };
            // Two keys at one time with two values are a jump.
            if length <= 0.0 && !same {
                return None;
            }
            most = most.max(if length > 0.0 { speed } else { 0.0 });
        }
        most.is_finite().then_some(most)
    }

    /// True if the value jumps at key `k`.
    pub(super) fn jumps_at(&self, k: usize, clock: Clock) -> bool {
        let Some(before) = k.checked_sub(1) else { return false };
        let sudden = self.between == Between::Step || clock.key(self.times[before]) == clock.key(self.times[k]);
        sudden && self.differ(self.value(before), self.value(k))
    }

    /// True if a cycle ends at another value than it begins with, but for rounding.
    pub(super) fn has_seam(&self) -> bool {
        self.differ(self.value(0), self.value(self.last()))
    }

    fn differ(&self, a: DVec4, b: DVec4) -> bool {
        let b = if self.property == Property::Rotation && a.dot(b) < 0.0 { -b } else { b };
        (a - b).length() > 1e-5 * a.length().max(b.length())
    }
}

/// Spherical linear interpolation along the shorter arc, of unit quaternions (glTF 2.0, appendix C.4).
fn slerp(a: DVec4, b: DVec4, t: f64) -> DVec4 {
    let d = a.dot(b);
    let (b, d) = if d < 0.0 { (-b, -d) } else { (b, d) };
    let angle = libm::acos(d.min(1.0));
    let sine = libm::sin(angle);
    let mixed = if sine < 1e-9 {
        a + (b - a) * t
    } else {
        (a * libm::sin(angle * (1.0 - t)) + b * libm::sin(angle * t)) / sine
    };
    mixed.try_normalize().unwrap_or(a)
}

/// A rotation of x, y, z, w.
pub(super) fn rotation(value: DVec4) -> DQuat {
    DQuat::from_vec4(value)
}
