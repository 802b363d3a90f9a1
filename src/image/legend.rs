//! The legend of colours that stand for numbers: a bar of the map with values beside it, in the lower left corner of a
//! picture.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use crate::film::Picture;
use crate::math::srgb;
use crate::model::ColourBy;

/// Height of the bar, pixels, if the picture is not lower.
const BAR: u32 = 256;
/// Width of the bar.
const WIDE: u32 = 16;
/// Room around and between what is drawn.
const GAP: u32 = 8;
/// Values beside the bar, its ends included.
const TICKS: u32 = 5;
/// Most characters of a name.
const NAME: usize = 24;
/// Share of the picture that the legend's ground hides.
const HIDES: f32 = 0.6;
/// Heights of pictures, pixels, for each step by which a legend grows.
const STEP: u32 = 1080;

const FACE: (FontWeight, RasterHeight) = (FontWeight::Regular, RasterHeight::Size16);

fn advance() -> u32 {
    get_raster_width(FACE.0, FACE.1) as u32
}

fn line() -> u32 {
    FACE.1.val() as u32
}

/// Where a legend is in a picture, pixels.
struct Place {
    /// Factor on all lengths.
    scale: u32,
    /// Left edge and upper edge.
    at: [u32; 2],
    size: [u32; 2],
    /// Height of the bar.
    bar: u32,
}

impl Place {
    /// `None` where there is no room.
    fn of(by: &ColourBy, labels: &[String], left: u32, [width, height]: [u32; 2]) -> Option<Self> {
        let scale = (height / STEP).max(1);
        let (wide, high) = (width / scale, height / scale);
        let bar = BAR.min((high / 2).saturating_sub(line() + 4 * GAP)).max(TICKS * line());
        let label = labels.iter().map(String::len).max().unwrap_or(0) as u32;
        let name = by.column.trim().chars().count().min(NAME) as u32;
        let inner = (WIDE + GAP + label * advance()).max(name * advance());
        let size = [inner + 2 * GAP, bar + line() + 4 * GAP];
        let fits = left / scale + GAP + size[0] <= wide && size[1] + GAP <= high;
        fits.then(|| Self { scale, at: [left / scale + GAP, high - size[1] - GAP], size, bar })
    }
}

/// Draws the legends of some colours side by side, and says whether there was room for all of them. Ranges must be
/// known.
///
/// They are light of the picture: only a display that shows it as it is ([`Display::default`](super::Display)) keeps
/// their colours.
pub fn draw_legends(picture: &mut Picture, legends: &[ColourBy]) -> bool {
    let mut left = 0;
    for by in legends {
        let Some(range) = by.range else { continue };
        let labels: Vec<String> = ticks(range);
        let Some(place) = Place::of(by, &labels, left, [picture.width, picture.height]) else { return false };
        left = (place.at[0] + place.size[0]) * place.scale;
        draw(picture, by, &labels, &place);
    }
    true
}

fn draw(picture: &mut Picture, by: &ColourBy, labels: &[String], place: &Place) {
    let mut set = |x: u32, y: u32, paint: &dyn Fn([f32; 4]) -> [f32; 4]| {
        for dy in 0..place.scale {
            for dx in 0..place.scale {
                let (x, y) = ((place.at[0] + x) * place.scale + dx, (place.at[1] + y) * place.scale + dy);
                if let Some(pixel) = picture.rgba.get_mut((y * picture.width + x) as usize) {
                    *pixel = paint(*pixel);
                }
            }
        }
    };
    for y in 0..place.size[1] {
        for x in 0..place.size[0] {
            set(x, y, &|[r, g, b, a]| {
                let [r, g, b] = [r, g, b].map(|c| (1.0 - HIDES) * c);
                [r, g, b, a + (1.0 - a) * HIDES]
            });
        }
    }
    let mut text = |words: &str, x: u32, y: u32| {
        for (i, letter) in words.chars().enumerate() {
            let Some(raster) = get_raster(letter, FACE.0, FACE.1).or_else(|| get_raster('?', FACE.0, FACE.1)) else {
                continue;
            };
            for (row, values) in raster.rows().enumerate() {
                for (column, &value) in values.iter().enumerate().filter(|(_, value)| **value > 0) {
                    let share = srgb::to_linear(f32::from(value) / 255.0);
                    set(x + i as u32 * advance() + column as u32, y + row as u32, &|[r, g, b, a]| {
                        [r, g, b, a].map(|c| c + (1.0 - c) * share)
                    });
                }
            }
        }
    };
    let name: String = by.column.trim().chars().take(NAME).collect();
    text(&name, GAP, GAP);
    let top = line() + 3 * GAP;
    for (label, tick) in labels.iter().zip(0..) {
        let middle = top + (place.bar - 1) * (TICKS - 1 - tick) / (TICKS - 1);
        text(label, GAP + WIDE + GAP, middle.saturating_sub(line() / 2));
    }
    for y in 0..place.bar {
        let along = 1.0 - f64::from(y) / f64::from(place.bar - 1);
        let Some(colour) = by.map.linear(along) else { continue };
        for x in 0..WIDE {
            set(GAP + x, top + y, &|_| [colour.x, colour.y, colour.z, 1.0]);
        }
    }
}

/// The values beside the bar, from below: as many digits as tell them apart.
fn ticks([first, last]: [f64; 2]) -> Vec<String> {
    let values = (0..TICKS).map(|i| first + (last - first) * f64::from(i) / f64::from(TICKS - 1));
    let step = ((last - first) / f64::from(TICKS - 1)).abs();
    let largest = first.abs().max(last.abs());
    let decimals = (1.0 - step.log10().floor()).max(0.0);
    let plain = largest < 1e7 && decimals <= 6.0;
    values.map(|value| if plain { format!("{value:.0$}", decimals as usize) } else { format!("{value:.3e}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ColourMap;

    fn by(range: [f64; 2]) -> ColourBy {
        ColourBy { column: "speed".to_owned(), map: ColourMap::parse("turbo").unwrap(), range: Some(range) }
    }

    fn grey(width: u32, height: u32) -> Picture {
        Picture { width, height, rgba: vec![[0.2, 0.2, 0.2, 1.0]; (width * height) as usize], layers: Vec::new() }
    }

    #[test]
    fn values_have_the_digits_that_tell_them_apart() {
        assert_eq!(ticks([0.0, 1.0]), ["0.00", "0.25", "0.50", "0.75", "1.00"]);
        assert_eq!(ticks([-100.0, 100.0]), ["-100", "-50", "0", "50", "100"]);
        assert_eq!(ticks([3.0, 1.0]), ["3.00", "2.50", "2.00", "1.50", "1.00"]);
        assert_eq!(ticks([0.0, 1e-9])[4], "1.000e-9");
        assert_eq!(ticks([0.0, 4e9])[1], "1.000e9");
    }

    #[test]
    fn the_bar_has_the_colours_of_the_map() {
        let mut picture = grey(640, 480);
        assert!(draw_legends(&mut picture, &[by([0.0, 2.0]), by([-1.0, 1.0])]));
        let map = ColourMap::parse("turbo").unwrap();
        let height = 240 - 16 - 32;
        let [top, left] = [480 - 8 - 8 - height, 8 + 8 + 3];
        for y in 0..height {
            let got = picture.rgba[((top + y) * 640 + left) as usize];
            let want = map.linear(1.0 - f64::from(y) / f64::from(height - 1)).unwrap();
            assert_eq!(got, [want.x, want.y, want.z, 1.0], "row {y}");
        }
        // What is beside it stays.
        assert_eq!(picture.rgba[640 * 100 + 600], [0.2, 0.2, 0.2, 1.0]);
    }

    #[test]
    fn where_there_is_no_room_nothing_is_drawn() {
        let mut picture = grey(60, 480);
        assert!(!draw_legends(&mut picture, &[by([0.0, 1.0])]));
        assert_eq!(picture, grey(60, 480));
        assert!(!draw_legends(&mut grey(640, 100), &[by([0.0, 1.0])]));
        assert!(draw_legends(&mut grey(3840, 2160), &[by([0.0, 1.0])]));
    }
}
