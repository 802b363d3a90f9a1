//! The filters of a sample position: of kernels, and of what surfaces mirror.

use super::minified::is_minified;
use super::raster::{Raster, low_pass_radius};
use crate::options::{KernelWeight, PixelFilter, Prefilter, RenderOptions, SweptKernel};
use crate::plan::Exposure;
use crate::scene::Scene;
use crate::time::FrameNumber;

/// Variance of a pixel's square, pixels^2.
const SQUARE: f64 = 1.0 / 12.0;
/// Variance of a Gaussian that has the variance of a pixel's square after its cut at two standard deviations.
const CUT_SQUARE: f64 = 0.121;

/// The filters of each sample position of a raster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Filters {
    /// As `Raster::sigma`.
    pub sigma: f32,
    /// As `Raster::pixel`.
    pub pixel: f32,
    /// Factor on the offsets that the pixel filter draws.
    pub spread: f32,
}

impl Filters {
    /// The filters of one of `positions` sub-pixel positions, on a raster with this stride. `swept`: the kernel that
    /// the frame's steps sweep, if any.
    pub(super) fn new(options: &RenderOptions, swept: Option<SweptKernel>, positions: usize, stride: u32) -> Self {
        let (sigma, spread) = kernel_filter(options, swept, positions, stride);
        let share_of_square = ((SQUARE / positions as f64).sqrt() / f64::from(stride)) as f32;
        Self { sigma, pixel: if sigma > 0.0 { sigma } else { share_of_square }, spread }
    }
}

/// Fewest sub-pixel positions that need no prefilter (docs/measurements/prefilter.md).
const ENOUGH_POSITIONS: usize = 4;

/// The prefilter of a frame that `exposure` samples: the one that is asked for, or the one that [`Prefilter::Auto`]
/// stands for.
pub(super) fn prefilter(
    scene: &Scene,
    number: FrameNumber,
    exposure: &Exposure,
    swept: Option<SweptKernel>,
    options: &RenderOptions,
) -> Prefilter {
    // Spheres are not filtered: where there is nothing else, the passes of filtered kernels would cost for nothing.
    let surfels = scene.objects.iter().map(|object| object.shape.surfels_or_none());
    let mut surfels = surfels.filter(|surfels| !surfels.is_empty()).peekable();
    if surfels.peek().is_some() && surfels.all(|surfels| surfels.spheres) {
        return Prefilter::None;
    }
    if options.prefilter != Prefilter::Auto {
        return options.prefilter;
    }
    if swept.is_some_and(|kernel| kernel.weight != KernelWeight::Integral) {
        return Prefilter::Approx;
    }
    let positions = exposure.rasters.iter().map(|raster| raster.positions_of_picture).min().unwrap_or(1);
    // Pixel centres are no positions within the pixel.
    let enough = positions >= ENOUGH_POSITIONS && options.look.filter != PixelFilter::Point;
    if enough && !is_minified(scene, number, positions) { Prefilter::None } else { Prefilter::Ewa }
}

/// Is the approximate filter a Gaussian as wide as its disc? Only instants and published kernels have the disc.
fn widens_by_gaussian(options: &RenderOptions, swept: Option<SweptKernel>) -> bool {
    options.prefilter == Prefilter::Approx && swept.is_some_and(|kernel| !kernel.is_published())
}

/// The filter of kernels at one of `positions` sub-pixel positions: its standard deviation, raster pixels (0 without
/// full EWA), and the factor on the offsets of the positions.
///
/// The pixel filter has two parts, one in the kernels and one in the offsets, whose variances add up. All positions
/// together make one filter of the sample grid, so the kernels of each have 1 / `positions` of its variance. The
/// variance of a pixel's square is 1/12 pixel^2; the cut of kernels at two standard deviations takes a part of it, for
/// which [`CUT_SQUARE`] makes up. With a Gaussian the offsets have the other 1 - 1 / `positions`: at one position the
/// kernels have the whole filter, as in classical EWA (Zwicker et al. 2002, section 6.2). With `point` all positions
/// are pixel centres, and the kernels have the filter of `gaussian:1`.
fn kernel_filter(options: &RenderOptions, swept: Option<SweptKernel>, positions: usize, stride: u32) -> (f32, f32) {
    if widens_by_gaussian(options, swept) {
        return (0.5 * low_pass_radius(stride), 1.0);
    }
    if options.prefilter != Prefilter::Ewa {
        return (0.0, 1.0);
    }
    let share = 1.0 / positions as f64;
    let (variance, spread) = match options.look.filter {
        PixelFilter::Box => (CUT_SQUARE * share, 1.0),
        PixelFilter::Point => (1.0, 1.0),
        PixelFilter::Gaussian { sigma } => (sigma * sigma * share, (1.0 - share).sqrt()),
    };
    ((variance.sqrt() / f64::from(stride)) as f32, spread as f32)
}

impl Raster {
    /// The same raster with these filters.
    pub(super) fn with_filters(self, filters: &Filters) -> Self {
        Self { sigma: filters.sigma, pixel: filters.pixel, ..self }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may stop")]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::frame::Frame;
    use crate::model::{Cloud, generate};
    use crate::options::{BlurMode, Look};
    use crate::scene::{Camera, Object};

    /// A model about (0, 0, -7), twice as large, before a camera that looks along y = 0 from above.
    fn scene(model: Cloud) -> Scene {
        let mut object = Object::from_cloud(model).unwrap();
        object.transform.translate = DVec3::new(0.0, 0.0, -7.0);
        object.transform.scale = DVec3::splat(2.0);
        let mut scene = Scene::new([object]);
        scene.camera = Camera::new(DVec3::new(0.0, 0.6, 1.0), DVec3::new(0.0, 0.15, -3.0));
        scene.camera.fovy = 35_f64.to_radians();
        (scene.image.width, scene.image.height) = (480, 270);
        scene
    }

    #[test]
    fn the_prefilter_is_chosen_by_positions_and_by_splats() {
        // The far splats of the plane are minified for eight positions, and not for 64.
        let [ball, plane] = [generate::ball(), generate::checker_plane()].map(scene);
        for (scene, mode, filter, wanted) in [
            (&ball, "supersample:3", PixelFilter::Box, Prefilter::Ewa),
            (&ball, "supersample:8", PixelFilter::Box, Prefilter::None),
            (&ball, "supersample:8", PixelFilter::Point, Prefilter::Ewa),
            (&plane, "supersample:8", PixelFilter::Box, Prefilter::Ewa),
            (&plane, "supersample:64", PixelFilter::Box, Prefilter::None),
            (&ball, "volumetric:3+published", PixelFilter::Box, Prefilter::Approx),
        ] {
            let mode: BlurMode = mode.parse().unwrap();
            let asked = |prefilter| {
                let look = Look { filter, ..Look::default() };
                let options = RenderOptions { prefilter, look, ..RenderOptions::default() };
                Frame::new(scene, scene.frames.first, mode, &options).prefilter
            };
            let surfels = scene.objects[0].shape.elements();
            assert_eq!(asked(Prefilter::Auto), wanted, "{surfels} surfels, {mode}, {filter}");
            assert_eq!(asked(Prefilter::None), Prefilter::None);
        }
    }
}
