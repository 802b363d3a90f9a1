//! The parts of a picture in which blur goes wrong for different reasons.
//!
//! They are told apart by what is nearest at the middle of each of [`STRATA`] parts of the shutter, found by splatting
//! pixel centres without blur.

use crate::film::{Aov, Picture};
use crate::study::sheet::Colour;

/// Moments of the shutter that are looked at.
pub const STRATA: u32 = 9;

/// Motion over the shutter from which a pixel counts as swept, pixels.
const MOVES: f64 = 0.25;

/// Step in depth, as a share of the depth, from which neighbouring pixels or moments count as different surfaces.
const STEP: f32 = 0.02;

/// What happens at a pixel while the shutter is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Region {
    /// One surface, hardly moving.
    Static,
    /// One surface that moves by 0.25 pixels or more.
    Swept,
    /// Something comes in front or goes: coverage or depth jumps.
    Occlusion,
    /// Hardly moving, and at the edge of a surface.
    Silhouette,
    /// Nothing.
    Background,
}

impl Region {
    /// All, in the order in which they are shown.
    pub const ALL: [Self; 5] = [Self::Static, Self::Swept, Self::Occlusion, Self::Silhouette, Self::Background];

    /// The name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Static => "static",
            Self::Swept => "swept",
            Self::Occlusion => "occlusion change",
            Self::Silhouette => "silhouette",
            Self::Background => "background",
        }
    }

    /// Its colour in maps.
    pub const fn colour(self) -> Colour {
        match self {
            Self::Static => [120, 160, 120],
            Self::Swept => [70, 130, 200],
            Self::Occlusion => [235, 140, 50],
            Self::Silhouette => [140, 80, 160],
            Self::Background => [232, 232, 228],
        }
    }
}

/// The region of each pixel, from pictures of short moments with depth and velocity layers. `span` is how many times
/// longer the shutter is than a moment. `None` where a layer is missing or sizes differ.
pub fn classify(moments: &[Picture], span: f64) -> Option<Vec<Region>> {
    let first = moments.first()?;
    let (w, h) = (first.width as usize, first.height as usize);
    let plane = |picture: &'_ Picture, aov: Aov, c: usize| {
        let layer = picture.layers.iter().find(|layer| layer.aov == aov)?;
        layer.planes.get(c).filter(|plane| plane.len() == w * h).cloned()
    };
    let depths = moments.iter().map(|m| plane(m, Aov::Depth, 0)).collect::<Option<Vec<_>>>()?;
    let velocity = |c: usize| moments.iter().map(|m| plane(m, Aov::Velocity, c)).collect::<Option<Vec<_>>>();
    let (vx, vy) = (velocity(0)?, velocity(1)?);
    let middle = &depths[depths.len() / 2];
    let region = |i: usize| {
        let (x, y) = (i % w, i / w);
        if depths.iter().all(|depth| depth[i].is_infinite()) {
            return Region::Background;
        }
        if depths.windows(2).any(|pair| jumps(pair[0][i], pair[1][i])) {
            return Region::Occlusion;
        }
        let moves = |k: usize| f64::from(vx[k][i]).hypot(f64::from(vy[k][i])) * span;
        if (0..depths.len()).any(|k| moves(k) >= MOVES) {
            return Region::Swept;
        }
        let beside =
            [(x > 0).then(|| i - 1), (x + 1 < w).then(|| i + 1), (y > 0).then(|| i - w), (y + 1 < h).then(|| i + w)];
        if beside.into_iter().flatten().any(|j| jumps(middle[i], middle[j])) {
            Region::Silhouette
        } else {
            Region::Static
        }
    };
    Some((0..w * h).map(region).collect())
}

/// Whether two depths are of different surfaces. Nothing is infinitely far.
fn jumps(a: f32, b: f32) -> bool {
    a.is_infinite() != b.is_infinite() || (a.is_finite() && (a - b).abs() > STEP * a.min(b))
}

/// The errors of one region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionErrors {
    /// Which.
    pub region: Region,
    /// Share of the picture's pixels, 0..=1.
    pub pixels: f64,
    /// Root mean squared error of the region, linear.
    pub rmse: f64,
    /// Mean FLIP of the region.
    pub flip: f64,
    /// Share of the picture's squared error, 0..=1; 0 where there is no error at all.
    pub error: f64,
}

/// Splits the errors of a picture by region; regions without pixels are left out. `flip` is the map of the pair; all
/// slices have one element a pixel.
pub fn split(picture: &Picture, reference: &Picture, flip: &[f32], regions: &[Region]) -> Vec<RegionErrors> {
    let mut sums = [(0_u64, 0.0_f64, 0.0_f64); 5];
    for (((a, b), &flip), &region) in picture.rgba.iter().zip(&reference.rgba).zip(flip).zip(regions) {
        let (count, squares, flips) = &mut sums[region as usize];
        *count += 1;
        *squares += (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum::<f64>();
        *flips += f64::from(flip);
    }
    let total: f64 = sums.iter().map(|sum| sum.1).sum();
    Region::ALL
        .into_iter()
        .zip(sums)
        .filter(|(_, (count, ..))| *count > 0)
        .map(|(region, (count, squares, flips))| RegionErrors {
            region,
            pixels: count as f64 / regions.len() as f64,
            rmse: (squares / (3.0 * count as f64)).sqrt(),
            flip: flips / count as f64,
            error: if total == 0.0 { 0.0 } else { squares / total },
        })
        .collect()
}
