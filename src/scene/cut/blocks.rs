//! The estimated error of a cut, by blocks of the image.

use glam::DVec2;

/// Edge of a block, pixels.
const EDGE: f64 = 32.0;

/// What a cut leaves out, over an image.
#[derive(Clone, Debug, Default)]
pub(crate) struct BlockErrors {
    size: DVec2,
    columns: usize,
    /// Squares of what is missing in each block, as display values, times pixels; row by row from the top. Empty where
    /// nothing is.
    sums: Vec<f64>,
}

impl BlockErrors {
    /// An image of `size` pixels of which nothing is missing.
    pub(super) fn of_size(size: DVec2) -> Self {
        let [columns, rows] = (size / EDGE).ceil().to_array().map(|count| count as usize);
        Self { size, columns, sums: vec![0.0; columns * rows] }
    }

    /// Adds `square` (times pixels), spread evenly over a square about `place` with the half edge `radius`. What lies
    /// beside the image does not count. Pixels, from the upper left corner, y down.
    pub(super) fn add(&mut self, place: DVec2, radius: f64, square: f64) {
        let radius = radius.max(f64::MIN_POSITIVE);
        let [low, high] = [(place - radius).max(DVec2::ZERO), (place + radius).min(self.size)];
        if !(square > 0.0 && place.is_finite() && low.cmplt(high).all()) {
            return;
        }
        let density = square / (4.0 * radius * radius);
        let block = |of: f64| (of / EDGE) as usize;
        for row in block(low.y)..self.sums.len() / self.columns {
            let top = row as f64 * EDGE;
            let height = (top + EDGE).min(high.y) - top.max(low.y);
            if height <= 0.0 {
                break;
            }
            for column in block(low.x)..self.columns {
                let left = column as f64 * EDGE;
                let width = (left + EDGE).min(high.x) - left.max(low.x);
                if width <= 0.0 {
                    break;
                }
                self.sums[row * self.columns + column] += density * width * height;
            }
        }
    }

    /// Root mean square over the image, display values.
    pub(crate) fn whole(&self) -> f64 {
        let sum: f64 = self.sums.iter().sum();
        if sum > 0.0 { (sum / self.size.element_product()).sqrt() } else { 0.0 }
    }

    /// Root mean square over the block around each pixel of an image with this width and height, row by row.
    pub(crate) fn plane(&self, [width, height]: [u32; 2]) -> Vec<f32> {
        if self.sums.is_empty() {
            return vec![0.0; width as usize * height as usize];
        }
        let blocks: Vec<f32> = (0..).zip(&self.sums).map(|(i, sum)| (sum / self.pixels(i)).sqrt() as f32).collect();
        let block = |pixel: u32| (f64::from(pixel) / EDGE) as usize;
        let row = |y: u32| (0..width).map(move |x| (x, y));
        (0..height).flat_map(row).map(|(x, y)| blocks[block(y) * self.columns + block(x)]).collect()
    }

    /// Pixels of a block. Those at the right and lower edges may be smaller.
    fn pixels(&self, block: usize) -> f64 {
        let corner = DVec2::new((block % self.columns) as f64, (block / self.columns) as f64) * EDGE;
        (self.size - corner).min(DVec2::splat(EDGE)).element_product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums are all that was added, where it was added. Parts beside the image do not count.
    #[test]
    fn sums_stay_where_they_are_added() {
        let size = DVec2::new(100.0, 50.0);
        let mut errors = BlockErrors::of_size(size);
        assert_eq!(errors.plane([100, 50]), vec![0.0; 5000]);
        errors.add(DVec2::new(32.0, 20.0), 2.0, 16.0);
        assert!((errors.whole() - (16.0 / 5000.0_f64).sqrt()).abs() < 1e-12);
        let plane = errors.plane([100, 50]);
        let at = |x: usize, y: usize| plane[y * 100 + x];
        let half = (8.0_f32 / 1024.0).sqrt();
        assert!((at(31, 0) - half).abs() < 1e-6 && (at(32, 31) - half).abs() < 1e-6);
        assert!(at(64, 0) == 0.0 && at(31, 32) == 0.0);
        // Half of it is beside the image, in a block of 4 by 18 pixels.
        let mut errors = BlockErrors::of_size(size);
        errors.add(DVec2::new(100.0, 40.0), 2.0, 16.0);
        assert!((errors.plane([100, 50])[49 * 100 + 99] - (8.0_f32 / 72.0).sqrt()).abs() < 1e-6);
        errors.add(DVec2::new(-3.0, 40.0), 2.0, 16.0);
        errors.add(DVec2::new(f64::NAN, 40.0), 2.0, 16.0);
        assert!((errors.whole() - (8.0 / 5000.0_f64).sqrt()).abs() < 1e-12);
        // A large one reaches over all of the image.
        let mut errors = BlockErrors::of_size(size);
        errors.add(DVec2::new(50.0, 25.0), 100.0, 4e4);
        assert!(errors.plane([100, 50]).iter().all(|error| (error - 1.0).abs() < 1e-6));
    }
}
