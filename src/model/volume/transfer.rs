//! Transfer functions: what a value of a volume looks like.

use glam::Vec3;

use super::MOST_EXTINCTION;

/// A stop of a [`TransferFunction`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransferStop {
    /// The value.
    pub value: f64,
    /// Colour there, linear Rec.709, >= 0.
    pub colour: Vec3,
    /// Extinction there, per scene unit, from 0 to [`MOST_EXTINCTION`].
    pub opacity: f64,
}

impl TransferStop {
    /// Is nothing there?
    fn clear(&self) -> bool {
        self.opacity == 0.0
    }
}

/// Colour and extinction as functions of a value: straight lines between stops, constant beyond the first and the last.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    stops: Vec<TransferStop>,
}

/// Why stops make no transfer function.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TransferFunctionError {
    /// There is no stop.
    #[error("a transfer function has no stop, expected at least one")]
    Empty,
    /// A value does not rise.
    #[error("stop {index} (from 0) has the value {value}, expected more than that of the stop before, {before}")]
    Order {
        /// Which stop, from 0.
        index: usize,
        /// Its value.
        value: f64,
        /// The value before.
        before: f64,
    },
    /// A number is out of its range.
    #[error(
        "stop {index} (from 0) has numbers out of range, expected a finite value, a colour from 0 up, and an opacity \
         from 0 to {MOST_EXTINCTION:e}"
    )]
    Range {
        /// Which stop, from 0.
        index: usize,
    },
}

impl TransferFunction {
    /// A function through `stops`.
    ///
    /// # Errors
    /// There is none, their values do not rise strictly, or a number is out of its range.
    pub fn new(stops: Vec<TransferStop>) -> Result<Self, TransferFunctionError> {
        if stops.is_empty() {
            return Err(TransferFunctionError::Empty);
        }
        for (index, stop) in stops.iter().enumerate() {
            let colour = stop.colour.is_finite() && stop.colour.min_element() >= 0.0;
            if !(stop.value.is_finite() && colour && (0.0..=MOST_EXTINCTION).contains(&stop.opacity)) {
                return Err(TransferFunctionError::Range { index });
            }
            let before = index.checked_sub(1).and_then(|before| stops.get(before)).map(|before| before.value);
            if let Some(before) = before.filter(|before| stop.value <= *before) {
                return Err(TransferFunctionError::Order { index, value: stop.value, before });
            }
        }
        Ok(Self { stops })
    }

    /// White, with an extinction that rises from 0 at `from` to `most` at `to`.
    pub(super) fn ramp(from: f32, to: f32, most: f64) -> Self {
        let stop = |value: f32, opacity| TransferStop { value: value.into(), colour: Vec3::ONE, opacity };
        Self { stops: vec![stop(from, 0.0), stop(to, most)] }
    }

    /// The stops, by rising value.
    pub fn stops(&self) -> &[TransferStop] {
        &self.stops
    }

    /// What to say where the values of a volume lie off the stops, so that nearly all of them look alike; `None` where
    /// they do not.
    ///
    /// Stops are off if a twentieth of them, or less, is within the values, or the other way round: 0 to 1 for bytes,
    /// or 0 to 255 for floats. But what is clear beyond the stops is a choice: a shell, or all that is above a
    /// threshold.
    pub(super) fn off(&self, [least, greatest]: [f32; 2]) -> Option<String> {
        const SHARE: f64 = 0.05;
        let (first, last) = (self.stops.first()?, self.stops.last()?);
        let (least, greatest) = (f64::from(least), f64::from(greatest));
        if first.value >= last.value || least >= greatest {
            return None;
        }
        let (stops, values) = (last.value - first.value, greatest - least);
        // Values among the first stops alone, or beyond them; then the same for the last stops.
        let below = greatest - first.value < SHARE * stops || greatest - first.value < SHARE * values && !first.clear();
        let above = last.value - least < SHARE * stops || last.value - least < SHARE * values && !last.clear();
        (below || above).then(|| {
            format!(
                "transfer function: its stops go from {} to {}, the values from {least} to {greatest}",
                first.value, last.value
            )
        })
    }

    /// Colour and extinction of a value, which is not NaN.
    pub fn at(&self, value: f64) -> (Vec3, f64) {
        let above = self.stops.partition_point(|stop| stop.value <= value);
        match (above.checked_sub(1).and_then(|below| self.stops.get(below)), self.stops.get(above)) {
            (Some(a), Some(b)) => {
                // The quotient of halves: a difference of stops may overflow.
                let share = (0.5 * value - 0.5 * a.value) / (0.5 * b.value - 0.5 * a.value);
                let colour = a.colour + (b.colour - a.colour) * share as f32;
                (colour.max(Vec3::ZERO), (a.opacity + (b.opacity - a.opacity) * share).max(0.0))
            }
            (Some(end), None) | (None, Some(end)) => (end.colour, end.opacity),
            (None, None) => (Vec3::ONE, 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stop(value: f64, grey: f32, opacity: f64) -> TransferStop {
        TransferStop { value, colour: Vec3::new(grey, 1.0, 0.0), opacity }
    }

    #[test]
    fn lines_between_stops_and_constants_beyond() {
        let function = TransferFunction::new(vec![stop(-1.0, 0.0, 0.0), stop(1.0, 1.0, 8.0), stop(2.0, 0.5, 4.0)]);
        let at = |value: f64| {
            let (colour, opacity) = function.as_ref().unwrap().at(value);
            assert_eq!((colour.y, colour.z), (1.0, 0.0));
            (colour.x, opacity)
        };
        for (value, expected) in [
            (-1e300, (0.0, 0.0)),
            (-1.0, (0.0, 0.0)),
            (0.0, (0.5, 4.0)),
            (0.5, (0.75, 6.0)),
            (1.0, (1.0, 8.0)),
            (1.5, (0.75, 6.0)),
            (2.0, (0.5, 4.0)),
            (f64::INFINITY, (0.5, 4.0)),
        ] {
            assert_eq!(at(value), expected, "at {value}");
        }
        let one = TransferFunction::new(vec![stop(7.0, 0.25, 3.0)]).unwrap();
        assert_eq!([one.at(0.0), one.at(7.0), one.at(9.0)], [(Vec3::new(0.25, 1.0, 0.0), 3.0); 3]);
        let wide = TransferFunction::new(vec![stop(-f64::MAX, 0.0, 0.0), stop(f64::MAX, 0.0, 1.0)]).unwrap();
        assert_eq!(wide.at(0.0).1, 0.5);
    }

    #[test]
    fn values_off_the_stops() {
        let off = |stops: Vec<TransferStop>, values: [f32; 2]| TransferFunction::new(stops).unwrap().off(values);
        let ramp = |from: f64, to: f64| vec![stop(from, 1.0, 0.0), stop(to, 1.0, 8.0)];
        for (stops, values) in [
            // Made for other units.
            (ramp(0.0, 1.0), [0.0, 200.0]),
            (ramp(0.0, 255.0), [0.0, 1.0]),
            // Beside each other.
            (ramp(0.0, 1.0), [3.0, 4.0]),
            (ramp(0.0, 1.0), [-4.0, -3.0]),
            (ramp(1e300, f64::MAX), [0.0, 1.0]),
            // All but the end of the values is solid.
            (vec![stop(199.0, 1.0, 8.0), stop(200.0, 1.0, 0.0)], [0.0, 200.0]),
        ] {
            let said = off(stops.clone(), values).unwrap();
            let expected = format!("stops go from {} to {}, the values from", stops[0].value, stops[1].value);
            assert!(said.contains(&expected), "{said}");
        }
        for (stops, values) in [
            (ramp(0.0, 255.0), [0.0, 255.0]),
            (ramp(0.0, 255.0), [0.0, 200.0]),
            (ramp(0.0, 1.0), [0.0, 10.0]),
            // A threshold, and a shell.
            (ramp(100.0, 101.0), [0.0, 200.0]),
            (vec![stop(1.0, 1.0, 0.0), stop(1.5, 1.0, 8.0), stop(2.0, 1.0, 0.0)], [0.0, 200.0]),
            (ramp(199.0, 200.0), [0.0, 200.0]),
            // One stop, or one value, has no range.
            (vec![stop(7.0, 1.0, 3.0)], [0.0, 200.0]),
            (ramp(0.0, 1.0), [5.0, 5.0]),
            (ramp(0.0, 1.0), [f32::INFINITY, f32::NEG_INFINITY]),
        ] {
            assert_eq!(off(stops.clone(), values), None, "{stops:?} {values:?}");
        }
    }

    #[test]
    fn stops_that_make_no_function() {
        let refused = |stops: Vec<TransferStop>| TransferFunction::new(stops).unwrap_err();
        assert_eq!(refused(vec![]), TransferFunctionError::Empty);
        let order = TransferFunctionError::Order { index: 1, value: 2.0, before: 2.0 };
        assert_eq!(refused(vec![stop(2.0, 0.0, 0.0), stop(2.0, 0.0, 0.0)]), order);
        for bad in [
            stop(f64::NAN, 0.0, 0.0),
            stop(f64::INFINITY, 0.0, 0.0),
            stop(0.0, -0.1, 0.0),
            stop(0.0, f32::NAN, 0.0),
            stop(0.0, 0.0, -1e-9),
            stop(0.0, 0.0, 1.1e9),
            stop(0.0, 0.0, f64::NAN),
        ] {
            assert_eq!(refused(vec![stop(-1.0, 0.0, 0.0), bad]), TransferFunctionError::Range { index: 1 }, "{bad:?}");
        }
    }
}
