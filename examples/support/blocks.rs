//! Maps of errors by blocks of pixels, where artefacts stand together.

use splatblur::compare::encode;
use splatblur::film::Picture;

/// Edge of a block, pixels.
pub const EDGE: usize = 32;

/// Mean of a map in each block, row by row.
pub fn means(map: &[f32], width: usize) -> Vec<f64> {
    let rows: Vec<&[f32]> = map.chunks(width).collect();
    let mut means = Vec::new();
    for band in rows.chunks(EDGE) {
        for left in (0..width).step_by(EDGE) {
            let values = band.iter().flat_map(|row| &row[left..(left + EDGE).min(width)]);
            let (sum, n) = values.fold((0.0, 0), |(sum, n), &value| (sum + f64::from(value), n + 1));
            means.push(sum / f64::from(n));
        }
    }
    means
}

/// Mean of the worst twentieth of the blocks.
pub fn worst_twentieth(mut means: Vec<f64>) -> f64 {
    means.sort_by(|a, b| b.total_cmp(a));
    let worst = means.len().div_ceil(20);
    means[..worst].iter().sum::<f64>() / worst.max(1) as f64
}

/// Root mean square of the differences of display values in the worst block of `edge` pixels.
pub fn worst_block(a: &Picture, b: &Picture, edge: usize) -> f64 {
    let (width, height) = (a.width as usize, a.height as usize);
    let (a, b) = (encode(a), encode(b));
    let mut worst = 0.0_f64;
    for top in (0..height).step_by(edge) {
        for left in (0..width).step_by(edge) {
            let rows = top..(top + edge).min(height);
            let (mut sum, mut n) = (0.0, 0_u32);
            for at in rows.flat_map(|y| (left..(left + edge).min(width)).map(move |x| y * width + x)) {
                for (a, b) in a.iter().zip(&b) {
                    sum += f64::from(a[at] - b[at]).powi(2);
                    n += 1;
                }
            }
            worst = worst.max((sum / f64::from(n)).sqrt());
        }
    }
    worst
}
