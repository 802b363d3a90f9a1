//! Two pictures of one size in one: the first to the left of a border, the second to the right of it.

use crate::film::Picture;
use crate::limits::Invalid;

/// Width of the border, pixels.
const BORDER: f64 = 2.0;

/// Where the border is in frame `frame` of a loop of `frames`, as a share of the width: it begins at the left, goes to
/// the right and comes back, slowly at both ends.
pub fn border(frame: u64, frames: u64) -> f64 {
    let turn = frame as f64 / frames.max(1) as f64;
    0.5 - 0.5 * libm::cos(std::f64::consts::TAU * turn)
}

/// The left part of one picture and the right part of another, with a white line of two pixels between them. `share`:
/// of the width that shows the first. A pixel that the line covers in part is mixed. Layers are left out.
///
/// # Errors
/// The pictures differ in size.
pub fn wiped(left: &Picture, right: &Picture, share: f64) -> Result<Picture, Invalid> {
    let [mine, others] = [left, right].map(|picture| (picture.width, picture.height));
    if mine != others || left.rgba.len() != right.rgba.len() {
        let found = format!("of {} x {} pixels", others.0, others.1);
        return Err(Invalid::new("right", found, format!("{} x {} pixels, as the left picture has", mine.0, mine.1)));
    }
    let columns = left.width.max(1) as usize;
    let middle = share * f64::from(left.width);
    // The parts of each column that show the first picture and the line; the second has the rest.
    let parts: Vec<[f32; 2]> = (0..columns)
        .map(|column| {
            let before = |edge: f64| (edge - column as f64).clamp(0.0, 1.0);
            let of_first = before(middle - 0.5 * BORDER);
            [of_first as f32, (before(middle + 0.5 * BORDER) - of_first) as f32]
        })
        .collect();
    let mix = |(i, (a, b)): (usize, (&[f32; 4], &[f32; 4]))| {
        let [first, line] = parts[i % columns];
        std::array::from_fn(|c| first * a[c] + line + (1.0 - first - line) * b[c])
    };
    let rgba = left.rgba.iter().zip(&right.rgba).enumerate().map(mix).collect();
    Ok(Picture { width: left.width, height: left.height, rgba, layers: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(width: u32, value: f32) -> Picture {
        Picture { width, height: 2, rgba: vec![[value, value, value, 1.0]; 2 * width as usize], layers: Vec::new() }
    }

    #[test]
    fn the_border_goes_and_comes_back() {
        let places: Vec<f64> = (0..8).map(|frame| border(frame, 8)).collect();
        assert_eq!((places[0], places[4]), (0.0, 1.0));
        assert!(places[..5].windows(2).all(|pair| pair[0] < pair[1]), "{places:?}");
        assert!((1..4).all(|i| (places[i] - places[8 - i]).abs() < 1e-12), "{places:?}");
        assert_eq!(border(0, 0), 0.0);
    }

    #[test]
    fn each_side_shows_its_picture() {
        let row = |share: f64| -> Vec<f32> {
            let picture = wiped(&solid(8, 0.25), &solid(8, 0.75), share).unwrap();
            assert_eq!(picture.rgba[..8], picture.rgba[8..]);
            assert!(picture.rgba.iter().all(|pixel| pixel[3] == 1.0));
            picture.rgba[..8].iter().map(|pixel| pixel[0]).collect()
        };
        assert_eq!(row(0.5), [0.25, 0.25, 0.25, 1.0, 1.0, 0.75, 0.75, 0.75]);
        // At 4.4 the line reaches from 3.4 to 5.4: of column 3, .4 shows the first picture.
        let mixed = row(0.55);
        for (found, wanted) in mixed.iter().zip([0.25, 0.25, 0.25, 0.7, 1.0, 0.85, 0.75, 0.75]) {
            assert!((found - wanted).abs() < 1e-6, "{mixed:?}");
        }
        assert_eq!(row(0.0), [1.0, 0.75, 0.75, 0.75, 0.75, 0.75, 0.75, 0.75]);
        assert_eq!(row(1.0), [0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 1.0]);
    }

    #[test]
    fn sizes_must_agree() {
        let why = wiped(&solid(8, 0.0), &solid(7, 0.0), 0.5).unwrap_err().to_string();
        assert_eq!(why, "`right` is of 7 x 2 pixels, expected 8 x 2 pixels, as the left picture has");
    }
}
