//! Values of the `override` constants of programs: what the frame needs, where channels and planes are.

use super::memory::DeviceChannels;
use super::prepared::Prepared;
use super::programs::{Constants, KernelKind};
use crate::film::{Blending, FilmPlanes};
use crate::frame::Frame;
use crate::options::{KernelShape, KernelWeight, Shading, SweptKernel, TemporalAlpha};
use crate::plan::LAYERS;

/// The channels of sums (`shaders/common/channels.wgsl`).
pub(super) fn sum_constants(channels: &DeviceChannels) -> Constants {
    let at = |channel: Option<usize>| channel.unwrap_or(0) as u32;
    let shared = &channels.shared;
    vec![
        ("NORMAL", at(shared.normal)),
        ("DEPTH", at(shared.depth)),
        ("VELOCITY", at(shared.velocity)),
        ("MATERIAL", at(shared.material)),
        ("REFLECTION", at(shared.reflection)),
        ("OPACITY", at(channels.opacity)),
        ("SAMPLE_COVERAGE", at(channels.sample_coverage)),
        ("PEAK", at(channels.peak)),
        ("TOLERANCE", at(channels.tolerance)),
        ("CHANNELS", channels.count as u32),
        ("LAYERS", channels.layers as u32),
        ("VALUES", channels.values),
    ]
}

/// For `splat_values`.
pub(super) fn value_constants(frame: &Frame, channels: &DeviceChannels) -> Constants {
    let mut constants = sum_constants(channels);
    constants.push(("GOURAUD", u32::from(frame.shading == Shading::Gouraud)));
    constants.push(face(frame));
    constants
}

/// Pixels along an edge of the environment; 0 where nothing mirrors it.
fn face(frame: &Frame) -> (&'static str, u32) {
    ("FACE", frame.surroundings.as_ref().map_or(0, |surroundings| surroundings.cube.face() as u32))
}

/// How the depths of a tile lie (`shaders/common/depths.wgsl`). `peels`: layers are peeled off, which have one limit
/// for all objects.
pub(super) fn depth_constants(frame: &Frame, kernel: KernelKind, peels: bool) -> Constants {
    let keeps_nearest = frame.keeps_nearest && !peels;
    vec![
        ("FILTERED", u32::from(kernel.is_filtered())),
        ("NEAREST", u32::from(keeps_nearest)),
        ("PEEL", u32::from(peels)),
    ]
}

/// For pass `resolve` of kernels at instants.
pub(super) fn paint_resolve_constants(frame: &Frame, channels: &DeviceChannels, planes: &FilmPlanes) -> Constants {
    let mut constants = resolve_constants(frame, channels, planes);
    constants.extend(depth_constants(frame, KernelKind::of(frame.prefilter), false));
    constants
}

/// For the programs that make layers of what is peeled off. The films of layers have a plane more.
pub(super) fn peel_constants(frame: &Frame, channels: &DeviceChannels, planes: &FilmPlanes) -> Constants {
    let mut constants = resolve_constants(frame, channels, &FilmPlanes { count: planes.count + 1, ..*planes });
    constants.extend(depth_constants(frame, KernelKind::Filtered, true));
    constants.extend([("APRONS", u32::from(frame.has_filtered_kernels())), ("MOST_LAYERS", u32::from(LAYERS))]);
    constants
}

/// For pass `attribute` of kernels in motion.
pub(super) fn swept_constants(prepared: &Prepared<'_>, swept: SweptKernel) -> Constants {
    let mut constants = sum_constants(&prepared.channels);
    constants.push(("SUM", u32::from(swept.alpha == TemporalAlpha::Sum)));
    constants.push(stretch(prepared));
    if swept.is_published() {
        constants.push(("LINE", u32::from(swept.weight == KernelWeight::Line)));
        constants.push(("SOURCE_SAMPLES", swept.source_samples.0));
    } else {
        constants.push(("BY_ELLIPSOID", u32::from(swept.shape == KernelShape::Ellipsoid)));
        constants.extend(slice_constants(prepared.frame));
    }
    constants
}

/// For pass `visibility` of kernels in motion.
pub(super) fn swept_visibility_constants(prepared: &Prepared<'_>) -> Constants {
    let mut constants = slice_constants(prepared.frame);
    constants.push(stretch(prepared));
    constants
}

fn slice_constants(frame: &Frame) -> Constants {
    vec![("SLICES", frame.slices().max(1)), ("NEAREST", u32::from(frame.keeps_nearest))]
}

/// Entries of a stretch.
fn stretch(prepared: &Prepared<'_>) -> (&'static str, u32) {
    ("STRETCH", u32::try_from(prepared.stretch).unwrap_or(u32::MAX))
}

/// For passes `resolve`: channels, and where the planes of films are.
fn resolve_constants(frame: &Frame, channels: &DeviceChannels, planes: &FilmPlanes) -> Constants {
    let at = |plane: Option<usize>| plane.unwrap_or(0) as u32;
    let mut constants = sum_constants(channels);
    constants.extend([
        ("PHONG", u32::from(frame.shading == Shading::Phong)),
        ("DEPTH_PLANE", at(planes.depth)),
        ("NORMAL_PLANE", at(planes.normal)),
        ("VELOCITY_PLANE", at(planes.velocity)),
        ("PLANES", planes.count as u32),
        face(frame),
    ]);
    constants
}

/// What both passes after the sort need: channels, and where the planes of films are.
fn channels_of_composite(frame: &Frame, channels: &DeviceChannels, planes: &FilmPlanes) -> Constants {
    let at = |plane: Option<usize>| plane.unwrap_or(0) as u32;
    vec![
        ("CHANNELS", channels.composite.count as u32),
        ("NORMAL", at(channels.composite.normal)),
        ("DEPTH_PLANE", at(planes.depth)),
        ("NORMAL_PLANE", at(planes.normal)),
        ("VELOCITY_PLANE", at(planes.velocity)),
        ("CODED", u32::from(frame.blending == Some(Blending::Coded))),
    ]
}

/// For pass `composite`.
pub(super) fn composite_constants(prepared: &Prepared<'_>) -> Constants {
    let Prepared { frame, channels, planes, .. } = prepared;
    let at = |channel: Option<usize>| channel.unwrap_or(0) as u32;
    let mut constants = channels_of_composite(frame, channels, planes);
    constants.extend([
        ("OWN", channels.composite.own as u32),
        ("FILTERED", u32::from(frame.has_filtered_kernels())),
        ("OPEN", at(channels.composite.open)),
        ("NEXT", at(channels.composite.next)),
        ("MOST_LAYERS", u32::from(LAYERS)),
        // The films of layers have a plane more.
        ("PLANES", planes.count as u32 + 1),
        stretch(prepared),
    ]);
    constants
}

/// For pass `resolve` of what is transparent.
pub(super) fn transparent_resolve_constants(
    frame: &Frame,
    channels: &DeviceChannels,
    planes: &FilmPlanes,
) -> Constants {
    let mut constants = channels_of_composite(frame, channels, planes);
    constants.push(("PLANES", planes.count as u32));
    constants
}

/// For pass `resolve` of kernels in motion.
pub(super) fn swept_resolve_constants(
    frame: &Frame,
    swept: SweptKernel,
    channels: &DeviceChannels,
    planes: &FilmPlanes,
) -> Constants {
    let mut constants = resolve_constants(frame, channels, planes);
    constants.extend([
        ("SUM", u32::from(swept.alpha == TemporalAlpha::Sum)),
        // The weights are the coverage, plane 3, where they have no plane of their own.
        ("WEIGHT_PLANE", planes.weight.unwrap_or(3) as u32),
    ]);
    constants
}
