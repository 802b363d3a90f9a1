//! The curves of one node, and the transform that they give.

use glam::DVec3;

use super::curve::{Curve, Interpolation, same_time};
use crate::math::{RotateOrder, Trs};

/// An attribute and its curve: cm, degrees or plain numbers over file time units.
#[derive(Clone, Debug)]
pub(super) struct Attribute {
    pub(super) name: String,
    pub(super) curve: Curve,
}

/// The curves of one node.
#[derive(Clone, Debug)]
pub struct NodeAnimation {
    /// Name in the file; empty if it has none.
    pub name: String,
    /// File time units a second.
    rate: f64,
    /// Attributes in file order, with distinct names; each has at least one key.
    attributes: Vec<Attribute>,
    /// For each name in [`CHANNELS`], its index in `attributes`.
    channels: [Option<usize>; CHANNELS.len()],
}

/// A node's transform at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeState {
    /// Translation (cm), rotation (radians), scale.
    pub transform: Trs,
    /// Visibility.
    pub visible: bool,
}

/// Upper bound of the difference between two transforms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Distance of the translations, cm.
    pub translate: f64,
    /// Sum of the differences of the three angles, radians.
    pub rotate: f64,
    /// The greatest difference of the three scales.
    pub scale: f64,
}

/// The attributes that move or hide a model: nine of the transform, then visibility and rotation order.
const CHANNELS: [&str; 11] = [
    "translateX",
    "translateY",
    "translateZ",
    "rotateX",
    "rotateY",
    "rotateZ",
    "scaleX",
    "scaleY",
    "scaleZ",
    "visibility",
    "rotateOrder",
];
const ROTATE: usize = 3;
const SCALE: usize = 6;
const VISIBILITY: usize = 9;
const ROTATE_ORDER: usize = 10;

impl NodeAnimation {
    pub(super) fn new(name: String, rate: f64) -> Self {
        Self { name, rate, attributes: Vec::new(), channels: [None; CHANNELS.len()] }
    }

    /// Puts an attribute at `index`, at most one past the last. Returns false if it replaces one, which must have the
    /// same name.
    pub(super) fn set(&mut self, index: usize, attribute: Attribute) -> bool {
        if let Some(channel) = CHANNELS.iter().position(|name| *name == attribute.name) {
            self.channels[channel] = Some(index);
        }
        let new = index == self.attributes.len();
        if new {
            self.attributes.push(attribute);
        } else {
            self.attributes[index] = attribute;
        }
        new
    }

    /// Transform and visibility at `seconds`.
    ///
    /// Attributes without a curve have Maya's defaults: no translation, no rotation, scale 1, order xyz, visible. Each
    /// angle is interpolated by itself, so 0 to 720 degrees turns twice. At a key the value is the key's own. The
    /// result is finite for finite times, unless the file's values are near the limits of f64.
    pub fn at(&self, seconds: f64, interpolation: Interpolation) -> NodeState {
        let time = self.file_time(seconds);
        let value = |channel: usize| self.curve(channel).map(|curve| curve.at(time, interpolation));
        let vector = |first: usize, default: f64| {
            let [x, y, z] = [first, first + 1, first + 2].map(|i| value(i).unwrap_or(default));
            DVec3::new(x, y, z)
        };
        let degrees = vector(ROTATE, 0.0);
        NodeState {
            transform: Trs {
                translate: vector(0, 0.0),
                rotate: DVec3::new(degrees.x.to_radians(), degrees.y.to_radians(), degrees.z.to_radians()),
                scale: vector(SCALE, 1.0),
                order: value(ROTATE_ORDER).map_or(RotateOrder::Xyz, order),
            },
            visible: value(VISIBILITY).is_none_or(visible),
        }
    }

    /// Upper bound of the difference between the transform at times from `from` to `to` (seconds) and that at mid-time;
    /// `None` where the transform may jump.
    pub fn drift(&self, from: f64, to: f64, interpolation: Interpolation) -> Option<Drift> {
        if self.curve(ROTATE_ORDER).is_some() {
            return None;
        }
        let (from, to) = (from * self.rate, to * self.rate);
        // Times are rounded on their way to the curves, so the range grows by that much.
        let half = 0.5 * (to - from) + 8.0 * f64::EPSILON * from.abs().max(to.abs());
        let vector = |first: usize| {
            let steepness = |i: usize| self.curve(i).map_or(0.0, |curve| curve.steepness(from, to, interpolation));
            half * DVec3::new(steepness(first), steepness(first + 1), steepness(first + 2))
        };
        let (translate, rotate, scale) =
            (vector(0).length(), vector(ROTATE).element_sum(), vector(SCALE).max_element());
        let drift = Drift { translate, rotate: rotate.to_radians(), scale };
        (translate + rotate + scale).is_finite().then_some(drift)
    }

    /// True if a scale attribute has a curve.
    pub fn has_scale(&self) -> bool {
        self.channels[SCALE..VISIBILITY].iter().any(Option::is_some)
    }

    /// First and last key of the transform and visibility curves, in seconds. If there are none, the keys of all curves
    /// count.
    pub fn range(&self) -> (f64, f64) {
        let (first, last) = self.key_range();
        (first / self.rate, last / self.rate)
    }

    /// [`Self::range`] in time units of the file.
    pub fn key_range(&self) -> (f64, f64) {
        let mut curves: Vec<&Curve> = (0..CHANNELS.len()).filter_map(|channel| self.curve(channel)).collect();
        if curves.is_empty() {
            curves = self.attributes.iter().map(|a| &a.curve).collect();
        }
        let ends = curves.into_iter().map(|curve| (curve.first(), curve.last()));
        ends.map(|(first, last)| (first.point.x, last.point.x))
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .unwrap_or((0.0, 0.0))
    }

    /// Times in (from, to), seconds, rising, at which the transform or the visibility jumps: at step keys, at the seams
    /// of cycles, and where visibility passes 0.5.
    ///
    /// The state at such a time belongs to one of its sides: a step has happened, a step to the next value has not. To
    /// pose both sides, stay away from the time by more than one rounding, such as a billionth of the interval. At most
    /// 65,536 jumps of each curve are found.
    pub fn breaks(&self, from: f64, to: f64, interpolation: Interpolation) -> Vec<f64> {
        if from.is_nan() || to.is_nan() || from >= to {
            return Vec::new();
        }
        let (start, end) = (from * self.rate, to * self.rate);
        let mut times = Vec::new();
        for channel in 0..CHANNELS.len() {
            let Some(curve) = self.curve(channel) else { continue };
            times.append(&mut curve.jumps(start, end));
            match channel {
                VISIBILITY => times.extend(curve.changes(start, end, interpolation, |v| u32::from(visible(v)))),
                ROTATE_ORDER => times.extend(curve.changes(start, end, interpolation, |v| order(v) as u32)),
                _ => {}
            }
        }
        times.sort_by(f64::total_cmp);
        // Two curves may have the same jump, and the end of one cycle is the start of the next. Such times may differ
        // by rounding.
        times.dedup_by(|b, a| same_time(*b, *a));
        times.into_iter().map(|t| t / self.rate).filter(|t| *t > from && *t < to).collect()
    }

    /// Names of the animated attributes in file order, including those that do not change the transform.
    pub fn attributes(&self) -> impl ExactSizeIterator<Item = &str> {
        self.attributes.iter().map(|a| a.name.as_str())
    }

    /// Number of keys of all curves.
    pub fn key_count(&self) -> usize {
        self.attributes.iter().map(|a| a.curve.keys().len()).sum()
    }

    /// Values of [`Self::attributes`] at `time` (file time units): cm, degrees or plain numbers.
    pub fn values(&self, time: f64, interpolation: Interpolation) -> impl ExactSizeIterator<Item = f64> {
        self.attributes.iter().map(move |a| a.curve.at(time, interpolation))
    }

    /// True if a translate, rotate or scale attribute has a curve.
    pub fn has_transform(&self) -> bool {
        self.channels[..VISIBILITY].iter().any(Option::is_some)
    }

    /// True if visibility has a curve.
    pub fn has_visibility(&self) -> bool {
        self.curve(VISIBILITY).is_some()
    }

    /// Attributes with curves that [`Self::at`] does not use.
    pub(super) fn ignored(&self) -> impl Iterator<Item = &str> {
        self.attributes().filter(|name| !CHANNELS.contains(name))
    }

    /// The curve of one of [`CHANNELS`].
    fn curve(&self, channel: usize) -> Option<&Curve> {
        self.channels[channel].map(|index| &self.attributes[index].curve)
    }

    /// Converts seconds to file time units. Frame f arrives as f / rate and after two roundings is not quite f, so it
    /// is snapped to whole units: steps and seams on whole frames then happen on them.
    fn file_time(&self, seconds: f64) -> f64 {
        let time = seconds * self.rate;
        let whole = libm::rint(time);
        if same_time(time, whole) { whole } else { time }
    }
}

fn visible(value: f64) -> bool {
    value > 0.5
}

/// The order of Maya's number. Numbers outside Maya's enumeration count as xyz.
fn order(value: f64) -> RotateOrder {
    let index = libm::rint(value);
    // The cast saturates. A number above 5 is no valid index; one below 0 becomes 0, which is xyz too.
    RotateOrder::from_index(index as u32).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;
    use std::path::Path;

    use super::*;
    use crate::anim::{Animation, maya};

    const MAYA: Interpolation = Interpolation::Maya;

    type Channel<'a> = (&'a str, &'a str, &'a str, &'a [(f64, f64)]);

    /// An animation with the given (attribute, tangent type, post infinity, keys) of node `n` at 24 frames a second.
    fn animation(curves: &[Channel<'_>]) -> Animation {
        let mut text = "animVersion 1.1;\n".to_owned();
        for (name, tangent, post, keys) in curves {
            let plain = name.starts_with("rotateOrder") || name.starts_with("visibility");
            let output = if plain { "output unitless;" } else { "" };
            let head =
                format!("anim {name} {name} n 0 0 0;\nanimData {{\n  {output} postInfinity {post};\n  keys {{\n");
            text.push_str(&head);
            for (t, v) in *keys {
                let key = format!("    {t} {v} {tangent} {tangent} 1 1 0;\n");
                text.push_str(&key);
            }
            text += "  }\n}\n";
        }
        maya::parse(text.as_bytes(), Path::new("n.anim")).expect("valid")
    }

    #[test]
    fn defaults_fill_what_has_no_curve() {
        let a = animation(&[("intensity", "linear", "constant", &[(1.0, 5.0)])]);
        let n = &a.nodes[0];
        assert_eq!(n.at(0.5, MAYA), NodeState { transform: Trs::default(), visible: true });
        assert!(!n.has_transform() && !n.has_visibility());
        assert_eq!(n.range(), (1.0 / 24.0, 1.0 / 24.0));
        assert!(n.breaks(-1.0, 1.0, MAYA).is_empty());
    }

    #[test]
    fn channels_reach_their_places() {
        let names = &CHANNELS[..VISIBILITY];
        let keys: Vec<[(f64, f64); 1]> = (1..=9).map(|i| [(0.0, f64::from(i) * 10.0)]).collect();
        let mut curves: Vec<Channel<'_>> =
            names.iter().zip(&keys).map(|(n, k)| (*n, "auto", "constant", k.as_slice())).collect();
        curves.push(("rotateOrder", "step", "constant", &[(0.0, 5.0)]));
        curves.push(("visibility", "step", "constant", &[(0.0, 0.5)]));
        let state = animation(&curves).nodes[0].at(3.0, MAYA);
        assert_eq!(state.transform.translate, DVec3::new(10.0, 20.0, 30.0));
        assert!((state.transform.rotate - DVec3::new(40.0, 50.0, 60.0) * (PI / 180.0)).length() < 1e-15);
        assert_eq!(state.transform.scale, DVec3::new(70.0, 80.0, 90.0));
        assert_eq!(state.transform.order, RotateOrder::Zyx);
        assert!(!state.visible, "0.5 is not visible");
    }

    #[test]
    fn orders_outside_the_enumeration_are_xyz() {
        for (value, expected) in [
            (0.0, RotateOrder::Xyz),
            (1.4, RotateOrder::Yzx),
            (4.6, RotateOrder::Zyx),
            (6.0, RotateOrder::Xyz),
            (-3.0, RotateOrder::Xyz),
            (1e20, RotateOrder::Xyz),
        ] {
            assert_eq!(order(value), expected, "{value}");
        }
    }

    /// Steps at `keys`, `rate` a second. For 24 a second, (f / 24) 24 happens to be f for every whole f, which would
    /// prove nothing.
    fn steps(rate: &str, keys: &[(u32, u32)]) -> Animation {
        let keys: Vec<String> = keys.iter().map(|(t, v)| format!("{t} {v} step step 1 1 0;\n")).collect();
        let keys = keys.concat();
        let data = format!("animData {{ postInfinity cycle; keys {{\n{keys}}} }}");
        let text = format!("animVersion 1.1; timeUnit {rate}; anim t translateX n 0 0 0; {data}");
        maya::parse(text.as_bytes(), Path::new("n.anim")).expect("valid")
    }

    #[test]
    fn steps_happen_on_their_frame_at_every_rate() {
        let every: Vec<(u32, u32)> = (0..5000).map(|i| (i, i)).collect();
        for rate in ["pal", "ntsc", "29.97fps", "23.976fps", "ntscf"] {
            let a = steps(rate, &every);
            // Beyond the keys there is no key to round to, so the time itself must come back whole.
            let cycle = steps(rate, &[(0, 0), (1, 1), (2, 2), (3, 0)]);
            for i in 0..5000 {
                let x = |a: &Animation| a.nodes[0].at(f64::from(i) / a.rate, MAYA).transform.translate.x;
                assert_eq!(x(&a), f64::from(i), "{rate}");
                assert_eq!(x(&cycle), f64::from(i % 3), "{rate} frame {i}");
            }
        }
    }

    #[test]
    fn breaks_are_in_seconds_and_of_all_curves() {
        let a = animation(&[
            ("translateX", "step", "constant", &[(0.0, 0.0), (24.0, 1.0), (48.0, 1.0)]),
            ("rotateY", "linear", "cycle", &[(0.0, 0.0), (12.0, 90.0)]),
            ("visibility", "linear", "constant", &[(0.0, 0.0), (12.0, 1.0)]),
            ("intensity", "step", "constant", &[(0.0, 0.0), (3.0, 9.0)]),
        ]);
        let n = &a.nodes[0];
        let found = n.breaks(0.0, 1.6, MAYA);
        assert_eq!(found.len(), 4, "{found:?}");
        for (a, b) in found.iter().zip([0.25, 0.5, 1.0, 1.5]) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        assert_eq!(n.range(), (0.0, 2.0));
        assert!(n.breaks(1.0, 0.0, MAYA).is_empty());
        assert!(n.breaks(f64::NAN, 1.0, MAYA).is_empty());
        let turned = animation(&[("rotateOrder", "linear", "constant", &[(0.0, 0.0), (24.0, 1.0)])]);
        let found = turned.nodes[0].breaks(0.0, 1.0, MAYA);
        assert!(found.len() == 1 && (found[0] - 0.5).abs() < 1e-9, "{found:?}");
    }
}
