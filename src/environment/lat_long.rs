//! A picture of all directions: longitude across, latitude down.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

/// A picture of the whole sphere, in linear light.
///
/// Its middle lies towards -z, where a camera that is not turned looks, its top towards +y, and its right half towards
/// +x. A pixel is a rectangle of angles; the first one begins at the left edge.
#[derive(Clone, Debug, PartialEq)]
pub struct LatLong {
    width: usize,
    height: usize,
    /// Linear Rec.709, row 0 at the top.
    pixels: Vec<[f32; 3]>,
}

/// Why a picture cannot be an environment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotLatLong {
    /// It has not twice as many columns as rows, or too many.
    #[error(
        "{width} x {height} pixels, expected a picture of all directions: twice as wide as high, at most {} x {}",
        LatLong::WIDEST,
        LatLong::WIDEST / 2
    )]
    Size {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A value is negative, or is no number.
    #[error("{value} at pixel ({x}, {y}), expected a radiance from 0 to 1e30")]
    Value {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The value that was found.
        value: f32,
    },
}

impl LatLong {
    /// Most columns.
    pub const WIDEST: usize = 8192;

    /// A picture of `width` x `width / 2` pixels, linear Rec.709, row 0 at the top.
    ///
    /// # Errors
    /// It is not twice as wide as high, has more than [`Self::WIDEST`] columns, or a value is not finite or below 0.
    pub fn new(width: usize, pixels: Vec<[f32; 3]>) -> Result<Self, NotLatLong> {
        let height = pixels.len() / width.max(1);
        if width == 0 || width > Self::WIDEST || width != 2 * height || width * height != pixels.len() {
            return Err(NotLatLong::Size { width, height });
        }
        for (i, pixel) in pixels.iter().enumerate() {
            if let Some(&value) = pixel.iter().find(|value| !(0.0..=1e30).contains(*value)) {
                return Err(NotLatLong::Value { x: i % width, y: i / width, value });
            }
        }
        Ok(Self { width, height, pixels })
    }

    /// A picture that a formula made: twice as wide as high, and without wrong values.
    pub(super) const fn of_formula(width: usize, pixels: Vec<[f32; 3]>) -> Self {
        Self { width, height: width / 2, pixels }
    }

    /// Columns.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Linear Rec.709, row 0 at the top.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// Memory of the picture.
    pub fn bytes(&self) -> u64 {
        size_of_val(self.pixels.as_slice()) as u64
    }

    /// The radiance from the unit direction `towards`, linear between the middles of pixels.
    pub fn radiance(&self, towards: DVec3) -> DVec3 {
        let (w, h) = (self.width, self.height);
        let x = (0.5 + libm::atan2(towards.x, -towards.z) / TAU) * w as f64 - 0.5;
        let y = libm::acos(towards.y.clamp(-1.0, 1.0)) / PI * h as f64 - 0.5;
        let (left, upper) = (x.floor(), y.floor());
        let (right_share, lower_share) = (x - left, y - upper);
        let pixel = |dx: f64, dy: f64| {
            let column = (left + dx).rem_euclid(w as f64) as usize % w;
            let row = (upper + dy).clamp(0.0, (h - 1) as f64) as usize;
            Vec3::from(self.pixels[row * w + column]).as_dvec3()
        };
        let upper = pixel(0.0, 0.0).lerp(pixel(1.0, 0.0), right_share);
        let lower = pixel(0.0, 1.0).lerp(pixel(1.0, 1.0), right_share);
        upper.lerp(lower, lower_share)
    }

    /// The same in single precision: places are wrong by some thousandths of a pixel of the largest map.
    pub(super) fn radiance_nearly(&self, towards: Vec3) -> Vec3 {
        use std::f32::consts::{PI, TAU};
        let (w, h) = (self.width, self.height);
        let polar = libm::atan2f(libm::sqrtf(towards.x * towards.x + towards.z * towards.z), towards.y);
        let x = (0.5 + libm::atan2f(towards.x, -towards.z) / TAU) * w as f32 - 0.5;
        let y = polar / PI * h as f32 - 0.5;
        let (left, upper) = (x.floor(), y.floor());
        let (right_share, lower_share) = (x - left, y - upper);
        // The picture goes on at its other side, and ends at the poles.
        let column = if left < 0.0 { w - 1 } else { (left as usize).min(w - 1) };
        let next = if column + 1 == w { 0 } else { column + 1 };
        let row = |y: f32| (y.max(0.0) as usize).min(h - 1) * w;
        let of_row = |row: usize| {
            let [left, right] = [column, next].map(|column| Vec3::from(self.pixels[row + column]));
            left + (right - left) * right_share
        };
        let [above, below] = [row(upper), row(upper + 1.0)].map(of_row);
        above + (below - above) * lower_share
    }

    /// Half as many columns and rows: means over the sphere of four pixels each. `None` where they do not go by two.
    pub(super) fn halved(&self) -> Option<Self> {
        let (width, height) = (self.width / 2, self.height / 2);
        if self.height % 2 == 1 || height == 0 {
            return None;
        }
        let solid = |y: usize| {
            libm::cos(PI * y as f64 / self.height as f64) - libm::cos(PI * (y + 1) as f64 / self.height as f64)
        };
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            let share = (solid(2 * y) / (solid(2 * y) + solid(2 * y + 1))) as f32;
            for x in 0..width {
                let row = |y: usize| {
                    let at = y * self.width + 2 * x;
                    (Vec3::from(self.pixels[at]) + Vec3::from(self.pixels[at + 1])) * 0.5
                };
                pixels.push((row(2 * y) * share + row(2 * y + 1) * (1.0 - share)).to_array());
            }
        }
        Some(Self { width, height, pixels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Red grows to the right, green downwards.
    fn ramp(width: usize) -> LatLong {
        let height = width / 2;
        let pixel = |i: usize| [(i % width) as f32, (i / width) as f32, 1.0];
        LatLong::new(width, (0..width * height).map(pixel).collect()).unwrap()
    }

    #[test]
    fn the_middle_lies_ahead_and_the_right_half_to_the_right() {
        let map = ramp(16);
        let seen = |x: f64, y: f64, z: f64| map.radiance(DVec3::new(x, y, z).normalize());
        assert!(seen(0.0, 0.0, -1.0).abs_diff_eq(DVec3::new(7.5, 3.5, 1.0), 1e-9));
        assert!(seen(1.0, 0.0, 0.0).abs_diff_eq(DVec3::new(11.5, 3.5, 1.0), 1e-9));
        assert!(seen(-1.0, 0.0, 0.0).abs_diff_eq(DVec3::new(3.5, 3.5, 1.0), 1e-9));
        // Behind, the last column meets the first.
        assert!(seen(0.0, 0.0, 1.0).abs_diff_eq(DVec3::new(7.5, 3.5, 1.0), 1e-9));
        assert!(seen(1e-3, 1.0, 0.0).y < 0.1 && seen(1e-3, -1.0, 0.0).y > 6.9);
    }

    #[test]
    fn halving_keeps_the_mean_over_the_sphere() {
        let mean = |map: &LatLong| {
            let rows = map.pixels().chunks(map.width()).enumerate();
            let (mut sum, mut weight) = (0.0, 0.0);
            for (y, row) in rows {
                let at = |y: usize| libm::cos(PI * y as f64 / map.height() as f64);
                let solid = at(y) - at(y + 1);
                sum += row.iter().map(|p| f64::from(p[1]) * solid).sum::<f64>();
                weight += solid * row.len() as f64;
            }
            sum / weight
        };
        let map = ramp(16);
        let half = map.halved().unwrap();
        assert_eq!([half.width(), half.height()], [8, 4]);
        assert!((mean(&map) - mean(&half)).abs() < 1e-6);
        assert!(LatLong::new(6, vec![[0.0; 3]; 18]).unwrap().halved().is_none());
    }

    #[test]
    fn only_pictures_of_all_directions_are_taken() {
        let refused = |width, pixels| LatLong::new(width, pixels).unwrap_err().to_string();
        assert!(refused(3, vec![[0.0; 3]; 3]).starts_with("3 x 1 pixels, expected"));
        assert!(refused(0, Vec::new()).starts_with("0 x 0 pixels"));
        let mut pixels = vec![[0.0; 3]; 8];
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            pixels[5][1] = bad;
            assert!(refused(4, pixels.clone()).starts_with(&format!("{bad} at pixel (1, 1)")), "{bad}");
        }
    }
}
