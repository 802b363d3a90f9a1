//! Unit names of `.anim` files, including those of newer Maya versions.

use std::f64::consts::PI;

/// Frames per second that Maya offers as `Nfps`.
const FPS: std::ops::RangeInclusive<u32> = 2..=48_000;

/// The known time units, for messages.
pub(super) const TIME_UNITS: &str = "game, film, pal, ntsc, show, palf, ntscf, sec, millisec, min, hour, \
                                     2fps to 48000fps, 23.976fps, 29.97fps, 29.97df, 47.952fps, 59.94fps";
/// The known length units, for messages.
pub(super) const LINEAR_UNITS: &str = "mm, cm, m, km, in, ft, yd, mi and their long names";
/// The known angle units, for messages.
pub(super) const ANGULAR_UNITS: &str = "deg, rad, min, sec and their long names";

/// Units a second of a time unit. `ntsc` is exactly 30.
pub(super) fn time(name: &str) -> Option<f64> {
    Some(match name {
        "game" => 15.0,
        "film" => 24.0,
        "pal" => 25.0,
        "ntsc" => 30.0,
        "show" => 48.0,
        "palf" => 50.0,
        "ntscf" => 60.0,
        "sec" => 1.0,
        "millisec" => 1000.0,
        "min" => 1.0 / 60.0,
        "hour" => 1.0 / 3600.0,
        "23.976fps" => 24_000.0 / 1001.0,
        "29.97fps" | "29.97df" => 30_000.0 / 1001.0,
        "47.952fps" => 48_000.0 / 1001.0,
        "59.94fps" => 60_000.0 / 1001.0,
        _ => f64::from(name.strip_suffix("fps")?.parse::<u32>().ok().filter(|n| FPS.contains(n))?),
    })
}

/// Size of a length unit, cm.
pub(super) fn linear(name: &str) -> Option<f64> {
    Some(match name {
        "mm" | "millimeter" => 0.1,
        "cm" | "centimeter" => 1.0,
        "m" | "meter" => 100.0,
        "km" | "kilometer" => 100_000.0,
        "in" | "inch" => 2.54,
        "ft" | "foot" => 30.48,
        "yd" | "yard" => 91.44,
        "mi" | "mile" => 160_934.4,
        _ => return None,
    })
}

/// Size of an angle unit, degrees.
pub(super) fn angular(name: &str) -> Option<f64> {
    Some(match name {
        "deg" | "degree" => 1.0,
        "rad" | "radian" => 180.0 / PI,
        "min" | "minute" => 1.0 / 60.0,
        "sec" | "second" => 1.0 / 3600.0,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_units_a_second() {
        let known = [
            ("game", 15.0),
            ("film", 24.0),
            ("pal", 25.0),
            ("ntsc", 30.0),
            ("show", 48.0),
            ("palf", 50.0),
            ("ntscf", 60.0),
            ("sec", 1.0),
            ("millisec", 1000.0),
            ("2fps", 2.0),
            ("120fps", 120.0),
            ("48000fps", 48_000.0),
        ];
        for (name, rate) in known {
            assert_eq!(time(name), Some(rate), "{name}");
        }
        let close = [
            ("min", 1.0 / 60.0),
            ("hour", 1.0 / 3600.0),
            ("23.976fps", 23.976_024),
            ("29.97fps", 29.970_03),
            ("29.97df", 29.970_03),
            ("47.952fps", 47.952_048),
            ("59.94fps", 59.940_06),
        ];
        for (name, rate) in close {
            assert!((time(name).expect("known") - rate).abs() < 1e-6, "{name}");
        }
        for name in ["", "fps", "1fps", "48001fps", "-5fps", "12.5fps", "24", "Film", "cm"] {
            assert_eq!(time(name), None, "{name}");
        }
    }

    #[test]
    fn lengths_and_angles() {
        let lengths = [("mm", 0.1), ("cm", 1.0), ("m", 100.0), ("km", 1e5), ("in", 2.54), ("ft", 30.48), ("yd", 91.44)];
        for (name, cm) in lengths {
            assert_eq!(linear(name), Some(cm), "{name}");
        }
        assert_eq!(linear("mi"), Some(160_934.4));
        for (short, long) in [("mm", "millimeter"), ("m", "meter"), ("km", "kilometer"), ("in", "inch"), ("ft", "foot")]
        {
            assert_eq!(linear(short), linear(long));
        }
        assert_eq!((linear("yard"), linear("mile"), linear("centimeter")), (linear("yd"), linear("mi"), Some(1.0)));
        assert_eq!((angular("deg"), angular("degree")), (Some(1.0), Some(1.0)));
        assert!((angular("rad").expect("known") - 57.295_779_513).abs() < 1e-9);
        assert_eq!(angular("radian"), angular("rad"));
        assert_eq!((angular("min"), angular("minute")), (Some(1.0 / 60.0), Some(1.0 / 60.0)));
        assert_eq!((angular("sec"), angular("second")), (Some(1.0 / 3600.0), Some(1.0 / 3600.0)));
        assert_eq!((linear("deg"), angular("cm"), linear("")), (None, None, None));
    }
}
