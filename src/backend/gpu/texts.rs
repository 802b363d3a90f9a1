//! The texts of programs: files of WGSL, one after the other.

/// WGSL files, one after the other.
macro_rules! wgsl {
    ($($file:literal),+ $(,)?) => { concat!($(include_str!(concat!("../../../shaders/", $file)), "\n"),+) };
}

pub(super) const QUAD: &str = wgsl!("common/quad.wgsl");
pub(super) const PIXEL: &str = wgsl!("common/pixel.wgsl");
pub(super) const DISC: &str = wgsl!("paint/unfiltered.wgsl", "paint/disc.wgsl");
pub(super) const LOW_PASS: &str = wgsl!("paint/unfiltered.wgsl", "published/low_pass.wgsl");
pub(super) const FILTERED: &str = wgsl!("paint/filtered.wgsl");
pub(super) const PROJECT: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/work.wgsl",
    "common/segment.wgsl",
    "common/fast.wgsl",
    "common/wanted.wgsl",
    "common/bounds.wgsl",
    "common/paths.wgsl",
    "common/land.wgsl",
    "common/posed.wgsl",
    "common/hit.wgsl",
    "common/depths.wgsl",
    "paint/kernel.wgsl",
    "paint/project.wgsl",
);
pub(super) const BIN: &str =
    wgsl!("common/types.wgsl", "common/views.wgsl", "common/wanted.wgsl", "common/scan.wgsl", "bin.wgsl");
pub(super) const VISIBILITY: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/wanted.wgsl",
    "common/hit.wgsl",
    "common/list.wgsl",
    "paint/walk.wgsl",
    "paint/both_walks.wgsl",
    "common/depths.wgsl",
    "paint/kernel.wgsl",
    "paint/visibility.wgsl",
);
pub(super) const VISIBILITY_BY_QUADS: &str = wgsl!("paint/visibility_quads.wgsl");
pub(super) const VISIBILITY_BY_PIXELS: &str =
    wgsl!("common/at_once.wgsl", "paint/discs_at_once.wgsl", "paint/visibility_pixels.wgsl");
pub(super) const SECOND_BY_QUADS: &str = wgsl!("paint/second.wgsl", "paint/second_quads.wgsl");
pub(super) const SECOND_BY_PIXELS: &str =
    wgsl!("common/at_once.wgsl", "paint/discs_at_once.wgsl", "paint/second.wgsl", "paint/second_pixels.wgsl");
pub(super) const VALUES: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/work.wgsl",
    "common/segment.wgsl",
    "common/fast.wgsl",
    "common/channels.wgsl",
    "common/shading.wgsl",
    "common/environment.wgsl",
    "common/paths.wgsl",
    "values.wgsl",
);
pub(super) const ATTRIBUTE: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/channels.wgsl",
    "common/hit.wgsl",
    "common/list.wgsl",
    "paint/walk.wgsl",
    "paint/both_walks.wgsl",
    "common/depths.wgsl",
    "paint/kernel.wgsl",
    "paint/sums.wgsl",
    "paint/attribute.wgsl",
);
pub(super) const ATTRIBUTE_BY_QUADS: &str = wgsl!("paint/attribute_quads.wgsl");
pub(super) const ATTRIBUTE_BY_PIXELS: &str = wgsl!("common/at_once.wgsl", "paint/attribute_pixels.wgsl");
pub(super) const RESOLVE: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/channels.wgsl",
    "common/shading.wgsl",
    "common/environment.wgsl",
    "common/depths.wgsl",
    "resolve.wgsl",
    "paint/walk.wgsl",
    "paint/resolve.wgsl",
);
pub(super) const SWEEP: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/work.wgsl",
    "common/segment.wgsl",
    "common/wanted.wgsl",
    "common/bounds.wgsl",
    "common/swept.wgsl",
    "common/swept_filter.wgsl",
    "common/paths.wgsl",
    "common/moving.wgsl",
    "swept/project.wgsl",
);
pub(super) const SWEPT_VISIBILITY: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/swept.wgsl",
    "common/swept_filter.wgsl",
    "common/sweep.wgsl",
    "common/ray.wgsl",
    "common/list.wgsl",
    "swept/visibility.wgsl",
);
pub(super) const SWEPT_ATTRIBUTE: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/swept.wgsl",
    "common/swept_filter.wgsl",
    "common/sweep.wgsl",
    "common/ray.wgsl",
    "common/list.wgsl",
    "common/channels.wgsl",
    "swept/sums.wgsl",
    "swept/attribute.wgsl",
);
pub(super) const MAP: &str = wgsl!("common/types.wgsl", "common/views.wgsl", "published/map.wgsl");
pub(super) const PUBLISHED_SWEEP: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/work.wgsl",
    "common/segment.wgsl",
    "common/wanted.wgsl",
    "common/bounds.wgsl",
    "common/swept.wgsl",
    "common/swept_splat.wgsl",
    "common/paths.wgsl",
    "common/moving.wgsl",
    "published/project.wgsl",
);
pub(super) const PUBLISHED_ATTRIBUTE: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/swept.wgsl",
    "common/swept_splat.wgsl",
    "common/sweep.wgsl",
    "common/ray.wgsl",
    "common/list.wgsl",
    "common/channels.wgsl",
    "swept/sums.wgsl",
    "published/attribute.wgsl",
);
pub(super) const SWEPT_RESOLVE: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/shading.wgsl",
    "common/environment.wgsl",
    "common/channels.wgsl",
    "resolve.wgsl",
    "swept/coverage.wgsl",
    "swept/resolve.wgsl",
);
pub(super) const PUBLISHED_RESOLVE: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/shading.wgsl",
    "common/environment.wgsl",
    "common/channels.wgsl",
    "resolve.wgsl",
    "published/coverage.wgsl",
    "swept/resolve.wgsl",
);
pub(super) const GAUSSIAN_PROJECT: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/work.wgsl",
    "common/fast.wgsl",
    "common/shading.wgsl",
    "common/srgb.wgsl",
    "common/wanted.wgsl",
    "common/bounds.wgsl",
    "common/gaussian.wgsl",
    "common/land.wgsl",
    "transparent/project.wgsl",
);
pub(super) const GATHER: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/wanted.wgsl",
    "common/bounds.wgsl",
    "common/gaussian.wgsl",
    "transparent/gather.wgsl",
);
pub(super) const COMPOSITE: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/wanted.wgsl",
    "common/hit.wgsl",
    "common/list.wgsl",
    "common/depths.wgsl",
    "common/gaussian.wgsl",
    "common/srgb.wgsl",
    "transparent/composite.wgsl",
);
pub(super) const TRANSPARENT_RESOLVE: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/srgb.wgsl",
    "common/wanted.wgsl",
    "transparent/resolve.wgsl",
);

pub(super) const PEEL: &str = wgsl!(
    "common/types.wgsl",
    "common/views.wgsl",
    "common/fast.wgsl",
    "common/shading.wgsl",
    "common/environment.wgsl",
    "common/channels.wgsl",
    "common/depths.wgsl",
    "common/wanted.wgsl",
    "resolve.wgsl",
    "transparent/peel.wgsl",
);
