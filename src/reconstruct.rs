//! A filter along the motion, after rendering: it smooths what neighbouring pixels saw at different times.

use glam::Vec2;
use rayon::prelude::*;

use crate::film::{Aov, Picture};

/// Shortest motion over the exposure that is filtered, pixels.
const SHORTEST: f32 = 4.0;

/// Replaces the colour of each pixel whose mean motion is longer than 4 pixels by (a + 2 b + c) / 4, b the pixel, a and
/// c the picture a pixel before and behind it along its motion. The picture must have a velocity layer; else it is left
/// as it is.
pub fn along(picture: &mut Picture) {
    let Some(layer) = picture.layers.iter().find(|layer| layer.aov == Aov::Velocity) else { return };
    let [vx, vy] = &layer.planes[..] else { return };
    let columns = picture.width as usize;
    let old = picture.rgba.clone();
    let sample = |p: Vec2| bilinear(&old, [picture.width, picture.height], p);
    let pixels = picture.rgba.par_iter_mut().zip(vx.par_iter().zip(vy)).with_min_len(1024).enumerate();
    pixels.for_each(|(at, (pixel, (&x, &y)))| {
        let motion = Vec2::new(x, y);
        let length = motion.length();
        if !(length > SHORTEST && length.is_finite()) {
            return;
        }
        let here = Vec2::new((at % columns) as f32, (at / columns) as f32);
        let step = motion / length;
        let (before, behind) = (sample(here - step), sample(here + step));
        for (value, (a, c)) in pixel.iter_mut().zip(before.into_iter().zip(behind)) {
            *value = 0.25 * (a + 2.0 * *value + c);
        }
    });
}

/// The value at pixel (x, y), not rounded; pixels beyond the edge repeat it.
fn bilinear(rgba: &[[f32; 4]], [width, height]: [u32; 2], p: Vec2) -> [f32; 4] {
    let p = p.clamp(Vec2::ZERO, Vec2::new((width - 1) as f32, (height - 1) as f32));
    let (low, share) = (p.floor(), p - p.floor());
    let (x, y) = (low.x as usize, low.y as usize);
    let at = |x: usize, y: usize| rgba[y.min(height as usize - 1) * width as usize + x.min(width as usize - 1)];
    let corners = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
    std::array::from_fn(|c| {
        let mix = |a: f32, b: f32, share: f32| a + share * (b - a);
        mix(mix(corners[0][c], corners[1][c], share.x), mix(corners[2][c], corners[3][c], share.x), share.y)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Layer;

    fn picture(velocity: [f32; 2]) -> Picture {
        let (width, height) = (9_u32, 7_u32);
        let value = |x: u32, y: u32| if (x, y) == (4, 3) { [1.0, 0.5, 0.0, 1.0] } else { [0.0; 4] };
        let rgba = (0..height).flat_map(|y| (0..width).map(move |x| value(x, y))).collect();
        let planes = velocity.map(|v| vec![v; 63]).to_vec();
        Picture { width, height, rgba, layers: vec![Layer { aov: Aov::Velocity, planes, names: Vec::new() }] }
    }

    #[test]
    fn motion_smears_a_point_along_it() {
        let mut smeared = picture([-9.0, 0.0]);
        along(&mut smeared);
        let red: Vec<f32> = (0..9).map(|x| smeared.rgba[3 * 9 + x][0]).collect();
        assert_eq!(red, [0.0, 0.0, 0.0, 0.25, 0.5, 0.25, 0.0, 0.0, 0.0]);
        let total: f32 = smeared.rgba.iter().map(|pixel| pixel[0]).sum();
        assert_eq!(total, 1.0);
        let mut down = picture([0.0, 5.0]);
        along(&mut down);
        assert_eq!([2, 3, 4].map(|y| down.rgba[y * 9 + 4][3]), [0.25, 0.5, 0.25]);
    }

    #[test]
    fn short_motion_and_no_motion_change_nothing() {
        for velocity in [[0.0, 0.0], [3.0, -2.6], [f32::NAN, 9.0], [f32::INFINITY, 0.0]] {
            let mut same = picture(velocity);
            along(&mut same);
            assert_eq!(same.rgba, picture(velocity).rgba);
        }
    }
}
