//! How a picture is shown: exposure, a view transform and dither, before its light becomes codes.

use super::Bits;
use crate::film::Picture;
use crate::math::{fast, srgb};
use crate::options::words;

/// How the light of a picture becomes what a screen shows. By default it stays as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// Exposure: light is multiplied by two to this power ([`STOPS`](crate::limits::STOPS)).
    pub stops: f64,
    /// The curve.
    pub view: ViewTransform,
    /// Noise of half a code, which keeps slow gradients from showing steps. It depends on the place in the picture
    /// alone.
    pub dither: bool,
}

/// A curve from light to what a screen shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ViewTransform {
    /// The light itself; from 1 on it is white.
    #[default]
    Standard,
    /// `AgX` (Troy Sobotka, 2022; <https://github.com/sobotka/AgX>), without a further look: light of 16.5 stops, and
    /// bright colours turn pale, not flat.
    Agx,
}

words! { ViewTransform, "view transform", [Standard = "standard", Agx = "agx"] }

impl Display {
    /// Does it leave pictures as they are?
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// The picture with the light that a screen shows: what is read back from a PNG file of these bits. With `alpha`,
    /// colours are taken as they are without their coverage. Values that are not finite stay.
    #[must_use]
    pub fn shown(&self, mut picture: Picture, bits: Bits, alpha: bool) -> Picture {
        if self.is_plain() {
            return picture;
        }
        let gain = libm::exp2(self.stops) as f32;
        let top = match bits {
            Bits::Eight => 255.0,
            Bits::Sixteen => 65_535.0,
        };
        let columns = picture.width.max(1) as usize;
        for (y, row) in picture.rgba.chunks_mut(columns).enumerate() {
            for (x, pixel) in row.iter_mut().enumerate() {
                let [r, g, b, a] = *pixel;
                let divisor = if alpha && a > 0.0 { a } else { 1.0 };
                let light = [r, g, b].map(|value| value / divisor * gain);
                if light.iter().any(|value| !value.is_finite()) {
                    continue;
                }
                let mut shown = match self.view {
                    ViewTransform::Standard => light,
                    ViewTransform::Agx => agx(light),
                };
                if self.dither {
                    for (channel, value) in shown.iter_mut().enumerate() {
                        *value = dithered(*value, noise(x, y, channel), top);
                    }
                }
                let [r, g, b] = shown.map(|value| value * divisor);
                *pixel = [r, g, b, a];
            }
        }
        picture
    }
}

/// The light of one of the two codes 0..=`top` beside this light, the more often of the upper one the nearer that is:
/// over all values of `noise` in [0, 1) the mean is the light's own place between codes.
fn dithered(light: f32, noise: f32, top: f32) -> f32 {
    // A light that is a code but for the error of the quick curve stays that code.
    const SLACK: f32 = 1e-3;
    let clipped = if light > 0.0 { light.min(1.0) } else { 0.0 };
    let place = srgb::from_linear_nearly(clipped) * top;
    let nearest = place.round();
    let code = if (place - nearest).abs() < SLACK { nearest } else { (place + noise).floor() };
    srgb::to_linear(code.min(top) / top)
}

/// Interleaved gradient noise (Jimenez 2014, "Next Generation Post Processing in Call of Duty: Advanced Warfare"): in
/// each 3 x 3 pixels the values are spread evenly over [0, 1). Channels have others.
fn noise(x: usize, y: usize, channel: usize) -> f32 {
    let fraction = |value: f64| value - value.floor();
    // Large enough that channels are not alike, and smaller than a picture.
    let x = x as f64 + 47.0 * channel as f64;
    let y = y as f64 + 17.0 * channel as f64;
    // The last value below 1 that an f32 has.
    (fraction(52.982_918_9 * fraction(0.067_110_56 * x + 0.005_837_15 * y)) as f32).min(1.0 - f32::EPSILON)
}

/// X + Y + Z of red, green and blue of Rec.709 as shares of that of white.
const SHARES: [f32; 3] = [0.212_005_35, 0.392_182_5, 0.395_812_15];
/// By how much `AgX` moves its primaries to white.
const INSET: f32 = 0.2;
/// Middle grey, and the stops below and above it that `AgX` shows.
const MIDDLE: f32 = 0.18;
const BELOW: f32 = 10.0;
const ABOVE: f32 = 6.5;
/// Where middle grey lies on the axis of stops; there the curve is 1/2 and has the slope 2.
const PIVOT: f32 = BELOW / (BELOW + ABOVE);

/// Light to the light that a screen shows, in [0, 1].
///
/// Primaries are moved a fifth of the way to white in x, y; stops from ten below middle grey to 6.5 above become 0 to
/// 1; a curve with slope 2 at middle grey and powers of 3 and 3.25 ([`curve`]); the primaries are moved back. The
/// result is coded by a power of 2.2.
fn agx(light: [f32; 3]) -> [f32; 3] {
    let least = MIDDLE * fast::exp2(-BELOW);
    let coded = towards_white(light, INSET).map(|value| {
        let stops = fast::log2(if value > least { value } else { least } / MIDDLE);
        let place = (stops + BELOW) / (BELOW + ABOVE);
        curve(if place < 1.0 { place } else { 1.0 })
    });
    towards_white(coded, -INSET / (1.0 - INSET)).map(|value| {
        // Without its own bound a power of 0 would be the least that there is.
        let clipped = value.clamp(0.0, 1.0);
        if clipped > 0.0 { fast::pow(clipped, 2.2) } else { 0.0 }
    })
}

/// Colours where the chromaticity of each primary lies a part of the way to white. What is white stays.
fn towards_white(colour: [f32; 3], part: f32) -> [f32; 3] {
    let white = SHARES[0] * colour[0] + SHARES[1] * colour[1] + SHARES[2] * colour[2];
    colour.map(|value| value + part * (white - value))
}

/// 1/2 + 2 d / (1 + (4^p - a^-p) |d|^p)^(1/p) at the distance d from the pivot: 0 at 0, 1 at 1. a is the distance from
/// the pivot to that end, and p the power of its side.
fn curve(place: f32) -> f32 {
    // (4^3 - PIVOT^-3, 3) and (4^3.25 - (1 - PIVOT)^-3.25, 3.25).
    let d = place - PIVOT;
    let (bend, power) = if d < 0.0 { (59.507_875, 3.0) } else { (69.862_79, 3.25) };
    if d == 0.0 {
        return 0.5;
    }
    0.5 + 2.0 * d / fast::pow(1.0 + bend * fast::pow(d.abs(), power), 1.0 / power)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(values: &[[f32; 4]]) -> Picture {
        Picture { width: values.len() as u32, height: 1, rgba: values.to_vec(), layers: Vec::new() }
    }

    #[test]
    fn the_default_changes_nothing() {
        let picture = row(&[[0.1, f32::NAN, -3.0, 0.5], [7.0, 0.0, 1e-9, 0.0]]);
        let shown = Display::default().shown(picture.clone(), Bits::Eight, true);
        assert_eq!(format!("{shown:?}"), format!("{picture:?}"));
    }

    #[test]
    fn a_stop_doubles_light() {
        let display = Display { stops: 1.0, ..Display::default() };
        let picture = row(&[[0.1, 0.2, 0.3, 0.5], [f32::INFINITY, 0.0, 0.0, 1.0]]);
        let shown = display.shown(picture, Bits::Eight, true);
        assert_eq!(shown.rgba, [[0.2, 0.4, 0.6, 0.5], [f32::INFINITY, 0.0, 0.0, 1.0]]);
    }

    /// The constants, from the formulas that they stand for.
    #[test]
    fn constants_of_agx() {
        // X + Y + Z of the primaries of Rec.709 with the white D65 (IEC 61966-2-1, annex): columns of its matrix.
        let sums = [0.4124 + 0.2126 + 0.0193, 0.3576 + 0.7152 + 0.1192, 0.1805 + 0.0722 + 0.9505_f64];
        let white: f64 = sums.iter().sum();
        for (share, sum) in SHARES.iter().zip(sums) {
            assert!((f64::from(*share) - sum / white).abs() < 1e-4, "{share}");
        }
        assert!((SHARES.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        let bend = |a: f64, p: f64| 4.0_f64.powf(p) - a.powf(-p);
        let pivot = f64::from(PIVOT);
        assert!((bend(pivot, 3.0) - 59.507_875).abs() < 1e-4);
        assert!((bend(1.0 - pivot, 3.25) - 69.862_79).abs() < 1e-4);
        for (place, want) in [(0.0, 0.0), (PIVOT, 0.5), (1.0, 1.0)] {
            assert!((curve(place) - want).abs() < 1e-5, "{place}: {}", curve(place));
        }
    }

    /// The same by Benjamin Wrensch ("Minimal `AgX` Implementation", 2023): matrices, and a polynomial that he fitted
    /// to Sobotka's table, with a mean squared error of 3.7e-6 between codes of 0 and 1.
    #[test]
    fn agx_is_that_of_others() {
        let times = |m: [[f64; 3]; 3], v: [f64; 3]| m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
        let inset = [
            [0.842_479_062, 0.078_433_6, 0.079_223_745],
            [0.042_328_242, 0.878_468_636, 0.079_166_127],
            [0.042_375_655, 0.078_433_6, 0.879_142_974],
        ];
        let outset = [
            [1.196_879_005, -0.098_020_881, -0.099_029_744],
            [-0.052_896_852, 1.151_903_13, -0.098_961_177],
            [-0.052_971_636, -0.098_043_45, 1.151_073_673],
        ];
        let other = |light: [f32; 3]| {
            let coded = times(inset, light.map(f64::from)).map(|v| {
                let x = ((v.max(1e-10).log2() + 12.473_93) / 16.5).clamp(0.0, 1.0);
                [0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5].iter().rev().fold(0.0, |sum, c| (sum + c) * x) - 0.002_32
            });
            times(outset, coded).map(|v| v.clamp(0.0, 1.0))
        };
        let steps = [0.0, 0.003, 0.02, 0.18, 0.5, 1.0, 4.0, 16.0, 60.0];
        let mut worst = 0.0_f64;
        for (r, g) in steps.iter().flat_map(|r| steps.iter().map(move |g| (*r, *g))) {
            for b in steps {
                let light = [r, g, b];
                for (own, other) in agx(light).iter().zip(other(light)) {
                    worst = worst.max((f64::from(*own).powf(1.0 / 2.2) - other).abs());
                }
            }
        }
        assert!(worst < 0.012, "{worst}");
    }

    #[test]
    fn agx_keeps_greys_and_their_order() {
        let mut last = -1.0;
        for i in 0..=4000 {
            let light = 0.18 * ((f64::from(i) / 4000.0 * 17.5 - 10.5).exp2()) as f32;
            let [r, g, b] = agx([light; 3]);
            assert!((r - g).abs() < 1e-5 && (g - b).abs() < 1e-5, "{light}: {r} {g} {b}");
            assert!(r >= last && r <= 1.0, "{light}: {r} after {last}");
            last = r;
        }
        let middle = agx([0.18; 3])[0];
        assert!((middle - 0.5_f32.powf(2.2)).abs() < 1e-5, "{middle}");
        assert_eq!(agx([0.0; 3])[1].max(1e-5), 1e-5);
        assert!(agx([200.0; 3])[2] > 0.999);
    }

    /// In the mean, dither shows what no code can; and a code stays itself.
    #[test]
    fn dither_has_the_mean_of_the_light() {
        let display = Display { dither: true, ..Display::default() };
        for code in [0.0, 17.3, 128.5, 200.75, 255.0_f32] {
            let light = srgb::to_linear(code / 255.0);
            let picture =
                Picture { width: 90, height: 90, rgba: vec![[light, light, light, 1.0]; 8100], layers: vec![] };
            let shown = display.shown(picture, Bits::Eight, false);
            for channel in 0..3 {
                let codes = shown.rgba.iter().map(|pixel| srgb::from_linear(pixel[channel]) * 255.0);
                let (least, greatest) = codes.clone().fold((255.0_f32, 0.0_f32), |(a, b), v| (a.min(v), b.max(v)));
                assert!(greatest - least < 1.001, "{least} to {greatest}");
                let mean = codes.sum::<f32>() / 8100.0;
                assert!((mean - code).abs() < 0.01, "{mean}, not {code}");
            }
        }
    }

    #[test]
    fn dithered_light_is_that_of_codes() {
        let display = Display { dither: true, view: ViewTransform::Agx, stops: 0.5 };
        let rgba: Vec<[f32; 4]> =
            (0..4096).map(|i| [i as f32 / 1000.0, 0.3, i as f32 / 5000.0, (i % 6) as f32 / 5.0]).collect();
        let picture = Picture { width: 64, height: 64, rgba, layers: Vec::new() };
        for (bits, alpha) in [(Bits::Eight, false), (Bits::Eight, true), (Bits::Sixteen, true)] {
            let shown = display.shown(picture.clone(), bits, alpha);
            let format = super::super::Format::Png { bits, alpha };
            let bytes = super::super::encode(&shown, format, "").unwrap();
            let back = super::super::png::decode(&bytes).unwrap();
            for (a, b) in shown.rgba.iter().zip(&back.rgba).filter(|(a, _)| !alpha || a[3] > 0.0) {
                let near = |a: f32, b: f32| (a - b).abs() < 4e-3 * b.max(1e-2) && (alpha || a == b);
                assert!((0..3).all(|c| near(a[c], b[c])), "{a:?}, read back {b:?}");
            }
        }
    }
}
