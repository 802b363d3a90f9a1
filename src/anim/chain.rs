//! The motion of one node of a glTF file: that of all nodes from the root down to it.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};

use super::track::{Clock, Property, Track, rotation};
use crate::math::norm;

/// Most jumps that one call finds.
const MOST_JUMPS: usize = 1 << 16;

/// A node and those that it hangs below, with what moves them.
#[derive(Clone, Debug)]
pub struct Chain {
    /// The text that finds the node in its file.
    pub label: String,
    /// Frames per second of the file: what a scene takes for its own where it says none.
    pub fps: f64,
    /// Repeats for ever, before the first key too.
    pub looped: bool,
    /// Names of other animations that move the node; at most 8.
    pub unused: Vec<String>,
    /// Seconds of the whole animation, from 0 to its last key.
    pub(super) period: f64,
    /// From the root to the node.
    pub(super) joints: Vec<Joint>,
}

/// A part of a chain.
#[derive(Clone, Debug)]
pub(super) enum Joint {
    /// Nodes that do not move by themselves.
    Fixed(DAffine3),
    /// A node with tracks: its rest, and what replaces parts of it.
    Moving { scale: DVec3, rotation: DQuat, translation: DVec3, tracks: Vec<Track> },
}

impl Chain {
    /// From the node's space to the world of the file, at a time in seconds.
    pub fn at(&self, seconds: f64) -> DMat4 {
        let time = self.local(seconds);
        let clock = self.clock();
        let place = self.joints.iter().fold(DAffine3::IDENTITY, |place, joint| place * joint.at(time, clock));
        DMat4::from(place)
    }

    /// As [`Self::at`], without scale: the axes at right angles, z first.
    pub fn rigid_at(&self, seconds: f64) -> DMat4 {
        let m = self.at(seconds);
        let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(glam::DVec4::truncate);
        let z = z.try_normalize().unwrap_or(DVec3::Z);
        let x = (x - z * x.dot(z)).try_normalize().or_else(|| y.cross(z).try_normalize());
        let x = x.unwrap_or_else(|| z.any_orthonormal_vector());
        // A mirror would turn the picture round, and no camera does.
        DMat4::from_mat3_translation(DMat3::from_cols(x, z.cross(x), z), m.w_axis.truncate())
    }

    /// First and last key, seconds.
    pub fn range(&self) -> (f64, f64) {
        let keys = self.tracks().flat_map(|track| [0, track.last()].map(|k| self.clock().key(track.times[k])));
        let range = keys.map(|time| (time, time)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        match range {
            // All parts of a file repeat together.
            Some((first, _)) if self.looped => (first.min(0.0), self.period),
            other => other.unwrap_or((0.0, 0.0)),
        }
    }

    /// True if the scale of a node in the chain has keys.
    pub fn has_scale(&self) -> bool {
        self.tracks().any(|track| track.property == Property::Scale)
    }

    /// True if any node in the chain has keys.
    pub fn moves(&self) -> bool {
        self.tracks().next().is_some()
    }

    /// Times in (from, to), seconds, rising, at which the node jumps: at step keys, and where a repetition begins at
    /// another place than the one before ended. At most 65,536 of each track are found.
    pub fn breaks(&self, from: f64, to: f64) -> Vec<f64> {
        if from.is_nan() || to.is_nan() || from >= to {
            return Vec::new();
        }
        let mut found = Vec::new();
        let rounds = self.rounds(from, to);
        for track in self.tracks() {
            let jumps: Vec<f64> = (0..track.times.len())
                .filter(|&k| track.jumps_at(k, self.clock()))
                .map(|k| self.clock().key(track.times[k]))
                .collect();
            let seam = self.looped && track.has_seam();
            let mut left = MOST_JUMPS;
            let mut round = rounds.0;
            while round <= rounds.1 && left > 0 {
                let shift = round * self.period;
                let times = jumps.iter().map(|time| time + shift).chain(seam.then_some(shift));
                let before = found.len();
                found.extend(times.filter(|time| *time > from && *time < to).take(left));
                // An empty round costs a little too, so that the loop always ends.
                left = left.saturating_sub(1 + found.len() - before);
                round += 1.0;
            }
        }
        found.sort_by(f64::total_cmp);
        found.dedup_by(|b, a| (*b - *a).abs() <= 8.0 * f64::EPSILON * b.abs());
        found
    }

    /// A sphere that holds the sphere about `centre` (in the node's space) at all times from `from` to `to`: its centre
    /// is that of mid-time. Also the most that the centre moves away from there. `None` where the node jumps, or
    /// nothing is known.
    ///
    /// For x(t) = T R S y(t), |x(t) - x(m)| <= |dT| + (|dR| s + |dS|) |y(t)| + |S(m)| |y(t) - y(m)|, where s is the
    /// largest scale at any time; this is applied node by node, upwards.
    pub(super) fn sweep(&self, centre: DVec3, radius: f64, from: f64, to: f64) -> Option<(DVec3, f64, f64)> {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let clock = self.clock();
        if !self.breaks(from.next_down(), to.next_up()).is_empty() {
            return None;
        }
        // Where the interval passes a seam, any key may be in it.
        let (start, end) = (self.local(from), self.local(to));
        let (start, end) = if self.looped && (end < start || to - from >= self.period) {
            (f64::NEG_INFINITY, f64::INFINITY)
        } else {
            (start, end)
        };
        let time = self.local(middle);
        let (mut x, mut radius, mut drift) = (centre, radius, 0.0);
        for joint in self.joints.iter().rev() {
            match joint {
                Joint::Fixed(place) => {
                    let size = norm(&place.matrix3);
                    (x, radius, drift) = (place.transform_point3(x), radius * size, drift * size);
                }
                Joint::Moving { tracks, .. } => {
                    let speed = |property: Property| {
                        let mut of = tracks.iter().filter(|track| track.property == property);
                        of.try_fold(0.0_f64, |most, track| Some(most.max(track.speed(start, end, clock)?)))
                    };
                    let moved = speed(Property::Translation)? * half;
                    let turned = speed(Property::Rotation)? * half;
                    let grown = speed(Property::Scale)? * half;
                    let place = joint.at(time, clock);
                    let scale = norm(&place.matrix3);
                    let far = x.length() + drift;
                    drift = moved + (turned * (scale + grown) + grown) * far + scale * drift;
                    (x, radius) = (place.transform_point3(x), radius * (scale + grown));
                }
            }
        }
        (x.is_finite() && (radius + drift).is_finite()).then_some((x, radius, drift))
    }

    fn clock(&self) -> Clock {
        Clock { fps: self.fps }
    }

    fn tracks(&self) -> impl Iterator<Item = &Track> {
        self.joints.iter().flat_map(|joint| match joint {
            Joint::Fixed(_) => &[][..],
            Joint::Moving { tracks, .. } => tracks,
        })
    }

    /// The numbers of the first and the last repetition that touch an interval.
    fn rounds(&self, from: f64, to: f64) -> (f64, f64) {
        if self.looped && self.period > 0.0 {
            (libm::floor(from / self.period), libm::floor(to / self.period))
        } else {
            (0.0, 0.0)
        }
    }

    /// The time within the animation.
    fn local(&self, seconds: f64) -> f64 {
        if !self.looped || self.period <= 0.0 {
            return seconds;
        }
        let rest = seconds - self.period * libm::floor(seconds / self.period);
        // What a rounding took from a frame or from the end of a round is given back.
        let slack = 8.0 * f64::EPSILON * seconds.abs().max(self.period);
        let whole = libm::rint(rest * self.fps) / self.fps;
        let rest = if (rest - whole).abs() <= slack { whole } else { rest };
        if rest < 0.0 || self.period - rest <= slack { 0.0 } else { rest }
    }
}

impl Joint {
    fn at(&self, time: f64, clock: Clock) -> DAffine3 {
        match self {
            Self::Fixed(place) => *place,
            Self::Moving { scale, rotation: rest, translation, tracks } => {
                let (mut scale, mut turn, mut translation) = (*scale, *rest, *translation);
                for track in tracks {
                    let value = track.at(time, clock);
                    match track.property {
                        Property::Translation => translation = value.truncate(),
                        Property::Rotation => turn = rotation(value),
                        Property::Scale => scale = value.truncate(),
                    }
                }
                DAffine3::from_scale_rotation_translation(scale, turn, translation)
            }
        }
    }
}
