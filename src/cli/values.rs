//! Reads words of the command line as plain values: ranges of times, sizes, shutters, colours, amounts of memory. The
//! library reads modes and options of rendering (`splatblur::options`).
//!
//! Every parser returns one sentence that says what was expected; clap puts the option's name before it.

use std::error::Error;
use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PathBufValueParser, PossibleValuesParser, TypedValueParser};
use glam::DVec3;
use splatblur::image::Compression;
use splatblur::limits::{COORDINATE, EPSILON, LENGTH, LIGHT, RADIUS_SCALE, RATE, SHUTTER, STOPS};
use splatblur::model::{ColourBy, ColourSpace, Kind};
use splatblur::movie::MovieKind;

use super::frames::{self, MAX_FRAME};

/// An option of the library that is one of a few words.
pub(super) fn one_of<T>(words: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err: Error + Send + Sync + 'static> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(words.iter().copied()).try_map(|word| word.parse::<T>())
}

/// `on` or `off`.
pub(super) fn switch() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["on", "off"]).map(|word| word == "on")
}

/// An exposure in stops.
pub(super) fn stops(text: &str) -> Result<f64, String> {
    let value = real(text)?;
    if STOPS.holds(value) { Ok(value) } else { Err(format!("{value} is not from -32 to 32")) }
}

/// The radius of all points.
pub(super) fn radius(text: &str) -> Result<f64, String> {
    let value = real(text)?;
    if LENGTH.holds(value) { Ok(value) } else { Err(format!("{value} is not {LENGTH}")) }
}

/// The values of the first and of the last colour.
pub(super) fn range_of_colours(text: &str) -> Result<[f64; 2], String> {
    ColourBy::parse_range(text).ok_or_else(|| "expected two numbers that differ, as -1..2.5".to_owned())
}

/// `surfels` or `spheres`.
pub(super) fn point_kind() -> impl TypedValueParser<Value = Kind> {
    let kind = |word: String| if word == "spheres" { Kind::Spheres } else { Kind::Surfels };
    PossibleValuesParser::new(["surfels", "spheres"]).map(kind)
}

/// `srgb` or `linear`.
pub(super) fn colour_space() -> impl TypedValueParser<Value = ColourSpace> {
    let space = |word: String| if word == "srgb" { ColourSpace::Srgb } else { ColourSpace::Linear };
    PossibleValuesParser::new(["srgb", "linear"]).map(space)
}

/// A compression of EXR files.
pub(super) fn compression() -> impl TypedValueParser<Value = Compression> {
    PossibleValuesParser::new(Compression::ALL.map(|(name, _)| name)).map(|word| {
        Compression::ALL.into_iter().find(|(name, _)| *name == word).map_or_else(Compression::default, |(_, of)| of)
    })
}

/// `A..B` in frames that need not be whole.
pub(super) fn times(text: &str) -> Result<(f64, f64), String> {
    if let Some((a, b)) = text.split_once("..") {
        let (first, last) = (real(a)?, real(b)?);
        if last < first {
            return Err(format!("the range {first}..{last} is empty; did you mean {last}..{first}?"));
        }
        if first.abs().max(last.abs()) > MAX_FRAME as f64 {
            return Err(format!("frames end at {MAX_FRAME}"));
        }
        return Ok((first, last));
    }
    real(text)
        .map(|one| (one, one))
        .or_else(|_| frames::frames(text).map(|frames| (frames.first().get(), frames.last().get())))
}

/// A finite number.
fn real(text: &str) -> Result<f64, String> {
    let value: f64 = text.trim().parse().map_err(|_| format!("`{text}` is not a number"))?;
    if value.is_finite() { Ok(value) } else { Err(format!("`{text}` is not a finite number")) }
}

/// A factor on splat radii, in the range of a scene's `radiusScale`.
pub(super) fn radius_scale(text: &str) -> Result<f64, String> {
    let value = real(text)?;
    if RADIUS_SCALE.holds(value) { Ok(value) } else { Err(format!("{value} is not from 1e-6 to 1e6")) }
}

/// A depth tolerance, in the range of a scene's `epsilon`.
pub(super) fn epsilon(text: &str) -> Result<f64, String> {
    let value = real(text)?;
    if EPSILON.holds(value) { Ok(value) } else { Err(format!("{value} is not from 0 to 1e30")) }
}

/// Frames a second.
pub(super) fn rate(text: &str) -> Result<f64, String> {
    let value = real(text)?;
    if RATE.holds(value) { Ok(value) } else { Err(format!("{value} is not from 0.001 to 1e6")) }
}

/// A finite number > 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    let value = real(text)?;
    if value > 0.0 { Ok(value) } else { Err(format!("{value} is not greater than 0")) }
}

/// `WxH` in pixels.
pub(super) fn size(text: &str) -> Result<(u32, u32), String> {
    let limit = splatblur::image::MAX_SIZE;
    let expected = || format!("expected WIDTHxHEIGHT with sides of 1 to {limit} pixels, as in 1920x1080");
    let (w, h) = text.split_once(['x', 'X']).ok_or_else(expected)?;
    let side = |part: &str| part.parse().ok().filter(|n| (1..=limit).contains(n)).ok_or_else(expected);
    Ok((side(w)?, side(h)?))
}

/// `--shutter`: when it opens and closes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ShutterTimes {
    /// Frames around the frame number.
    Frames(f64, f64),
    /// Seconds that it is open, half of them before the frame number.
    Seconds(f64),
}

impl ShutterTimes {
    /// Opening and closing in frames around the frame number, at `rate` frames a second.
    pub(super) fn at(self, rate: f64) -> Result<(f64, f64), String> {
        match self {
            Self::Frames(open, close) => Ok((open, close)),
            Self::Seconds(time) => within_reason(-0.5 * time * rate, 0.5 * time * rate),
        }
    }
}

/// `OPEN,CLOSE` in frames relative to the frame number; `180deg`, of which 360 are a frame; `1/48s` or `0.02s`.
pub(super) fn shutter(text: &str) -> Result<ShutterTimes, String> {
    let duration = |value: f64| {
        if value > 0.0 { Ok(value) } else { Err(format!("a shutter of {text} does not open; as in 180deg or 1/48s")) }
    };
    if let Some((open, close)) = text.split_once(',') {
        let (open, close) = within_reason(real(open)?, real(close)?)?;
        return Ok(ShutterTimes::Frames(open, close));
    }
    if let Some(angle) = text.strip_suffix("deg") {
        // The scene's own shutter, of half a frame, lies about the frame number too.
        let half = duration(real(angle)?)? / 720.0;
        let (open, close) = within_reason(-half, half)?;
        return Ok(ShutterTimes::Frames(open, close));
    }
    if let Some(time) = text.strip_suffix('s') {
        let (over, under) = time.split_once('/').unwrap_or((time, "1"));
        let seconds = real(over)? / duration(real(under)?)?;
        return if seconds.is_finite() {
            duration(seconds).map(ShutterTimes::Seconds)
        } else {
            Err(format!("`{text}` is not a finite time"))
        };
    }
    Err(match real(text) {
        Ok(_) => format!("`{text}` lacks a unit: {text}deg, {text}s, or OPEN,CLOSE in frames around the frame number"),
        Err(_) => {
            "expected OPEN,CLOSE in frames around the frame number, as in -0.25,0.25, an angle, as in 180deg, or \
                   a time, as in 1/48s"
                .to_owned()
        }
    })
}

/// A shutter in frames around the frame number.
fn within_reason(open: f64, close: f64) -> Result<(f64, f64), String> {
    if open >= close {
        return Err(format!("the shutter closes at {close}, not after it opens at {open}"));
    }
    if !(SHUTTER.holds(open) && SHUTTER.holds(close)) {
        return Err("the shutter must stay within a million frames".to_owned());
    }
    Ok((open, close))
}

/// A file for a movie, in a format that its extension names.
pub(super) fn movie() -> impl TypedValueParser<Value = (PathBuf, MovieKind)> {
    PathBufValueParser::new().try_map(|path| {
        let expected = "expected a file .mp4 or .mov (they need ffmpeg), .y4m or .gif";
        MovieKind::of(&path).map(|kind| (path, kind)).ok_or(expected)
    })
}

/// A directory for pictures, and no file for a movie.
pub(super) fn directory() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        if MovieKind::of(&path).is_none() || path.is_dir() {
            return Ok(path);
        }
        let name = path.display();
        Err(format!("a directory is expected, and {name} names a movie: use `splatblur render --movie {name}`"))
    })
}

/// `R,G,B`, linear, >= 0.
pub(super) fn colour(text: &str) -> Result<DVec3, String> {
    let parts: Vec<f64> = text.split(',').map(real).collect::<Result<_, _>>()?;
    match parts[..] {
        [r, g, b] if parts.iter().all(|&v| LIGHT.holds(v)) => Ok(DVec3::new(r, g, b)),
        [_, _, _] => Err("a colour's numbers must be 0 to 1e6 (linear light, 1 is white)".to_owned()),
        _ => Err("expected R,G,B in linear light, as in 0.2,0.2,0.25".to_owned()),
    }
}

/// `X,Y,Z`, a place.
pub(super) fn place(text: &str) -> Result<DVec3, String> {
    let parts: Vec<f64> = text.split(',').map(real).collect::<Result<_, _>>()?;
    match parts[..] {
        [x, y, z] if parts.iter().all(|&v| COORDINATE.holds(v)) => Ok(DVec3::new(x, y, z)),
        _ => Err("expected X,Y,Z, as in 1.5,0,-2".to_owned()),
    }
}

/// `512k`, `64M`, `1G`, `1GiB`, or bytes; units are powers of 1024.
pub(super) fn memory(text: &str) -> Result<u64, String> {
    let expected = || format!("`{text}` is no amount of memory: a number with k, M, G or T, as in 64M, 1.5G, 1GiB");
    let digits = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let shift = match unit.to_ascii_lowercase().as_str() {
        "" | "b" => 0,
        "k" | "kb" | "kib" => 10,
        "m" | "mb" | "mib" => 20,
        "g" | "gb" | "gib" => 30,
        "t" | "tb" | "tib" => 40,
        _ => return Err(expected()),
    };
    let bytes = real(number).map_err(|_| expected())? * (1_u64 << shift) as f64;
    if bytes < 1_048_576.0 {
        return Err(format!("{text} is too little: at least 1M, as in 64M, 1.5G, 1GiB"));
    }
    if bytes > 1e18 {
        return Err(format!("{text} is more than any computer has: at most 900000T"));
    }
    Ok(bytes as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_times() {
        assert_eq!(times("-20..20.5"), Ok((-20.0, 20.5)));
        assert_eq!(times("0.25"), Ok((0.25, 0.25)));
        assert_eq!(times("3-7"), Ok((3.0, 7.0)));
        assert_eq!(times("-5"), Ok((-5.0, -5.0)));
        assert!(times("2..1").is_err());
        assert!(times("nan..1").is_err());
        assert!(times("0..1e300").is_err());
    }

    #[test]
    fn amounts_of_memory() {
        assert_eq!(memory("64M"), Ok(64 << 20));
        assert_eq!(memory("1G"), Ok(1 << 30));
        assert_eq!(memory("1GiB"), Ok(1 << 30));
        assert_eq!(memory("1.5g"), Ok(3 << 29));
        assert_eq!(memory("2048k"), Ok(2 << 20));
        assert_eq!(memory("1048576"), Ok(1 << 20));
        for text in ["", "M", "1", "64X", "-1G", "nanG", "infG", "1e30G", "0", "64 Q"] {
            assert!(memory(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes_shutters_colours() {
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert_eq!(size("1X65535"), Ok((1, 65_535)));
        for text in ["640", "0x5", "5x0", "65536x1", "-5x5", "5x5x5", "axb", "x"] {
            assert!(size(text).is_err(), "{text}");
        }
        let frames = |text| shutter(text).and_then(|times| times.at(25.0));
        for (text, open, close) in [
            ("-0.25,.25", -0.25, 0.25),
            ("180deg", -0.25, 0.25),
            ("360deg", -0.5, 0.5),
            ("72.5deg", -72.5 / 720.0, 72.5 / 720.0),
            ("1/50s", -0.25, 0.25),
            ("0.04s", -0.5, 0.5),
            ("2s", -25.0, 25.0),
        ] {
            assert_eq!(frames(text), Ok((open, close)), "{text}");
        }
        for (text, why) in [
            ("0,0", "closes at 0, not after it opens at 0"),
            ("1,0", "closes at 0, not after"),
            ("nan,1", "not a finite number"),
            ("0,inf", "not a finite number"),
            ("0,1,2", "`1,2` is not a number"),
            ("0,1e9", "within a million frames"),
            ("180", "`180` lacks a unit: 180deg, 180s, or OPEN,CLOSE"),
            ("half", "expected OPEN,CLOSE"),
            ("0deg", "does not open"),
            ("-180deg", "does not open"),
            ("1e12deg", "within a million frames"),
            ("deg", "`` is not a number"),
            ("180,deg", "`deg` is not a number"),
            ("0s", "does not open"),
            ("1/0s", "does not open"),
            ("1/-48s", "does not open"),
            ("-1/48s", "does not open"),
            ("1/48/2s", "`48/2` is not a number"),
            ("1e300/1e-300s", "not a finite time"),
            ("1e6s", "within a million frames"),
        ] {
            let found = frames(text).unwrap_err();
            assert!(found.contains(why), "{text}: {found}");
        }
        assert_eq!(place("-1,2.5,1e3"), Ok(DVec3::new(-1.0, 2.5, 1e3)));
        assert!(place("1,2").is_err() && place("1,2,inf").is_err());
        assert_eq!(colour("0,0.5,2"), Ok(DVec3::new(0.0, 0.5, 2.0)));
        for text in ["0", "0,0", "0,0,-1", "0,0,nan", "0,0,0,0", "red"] {
            assert!(colour(text).is_err(), "{text}");
        }
    }
}
