//! Values of the `override` constants of programs: what the frame needs, where channels and planes are.

use super::memory::DeviceChannels;
use super::programs::Constants;
use crate::film::{Blending, FilmPlanes};
use crate::frame::Frame;
use crate::options::{KernelShape, KernelWeight, Shading, SweptKernel, TemporalAlpha};

/// The channels of sums.
pub(super) fn sum_constants(channels: &DeviceChannels) -> Constants {
    let at = |channel: Option<usize>| channel.unwrap_or(0) as u32;
    let shared = &channels.shared;
    vec![
        ("NORMAL", at(shared.normal)),
        ("DEPTH", at(shared.depth)),
        ("VELOCITY", at(shared.velocity)),
        ("MATERIAL", at(shared.material)),
        ("SAMPLE_COVERAGE", at(channels.sample_coverage)),
        ("CHANNELS", channels.count as u32),
        ("VALUES", channels.values),
    ]
}

/// For `splat_values`.
pub(super) fn value_constants(frame: &Frame, channels: &DeviceChannels) -> Constants {
    let mut constants = sum_constants(channels);
    constants.push(("GOURAUD", u32::from(frame.shading == Shading::Gouraud)));
    constants
}

/// For `restore`, whose sums lack the channel of the least depth.
pub(super) fn restore_constants(channels: &DeviceChannels) -> Constants {
    let sample_coverage = channels.sample_coverage.unwrap_or(0) as u32;
    vec![("CHANNELS", channels.count as u32), ("SAMPLE_COVERAGE", sample_coverage)]
}

/// The layers of full EWA.
fn layers(channels: &DeviceChannels) -> [(&'static str, u32); 2] {
    [("LAYERS", channels.layers as u32), ("PEAK", channels.peak.unwrap_or(0) as u32)]
}

/// For pass `attribute` of full EWA.
pub(super) fn ewa_constants(channels: &DeviceChannels) -> Constants {
    let mut constants = sum_constants(channels);
    constants.extend(layers(channels));
    constants
}

/// For pass `resolve` of full EWA.
pub(super) fn ewa_resolve_constants(frame: &Frame, channels: &DeviceChannels, planes: &FilmPlanes) -> Constants {
    let mut constants = resolve_constants(frame, channels, planes);
    constants.extend(layers(channels));
    constants
}

/// For pass `attribute` of kernels in motion.
pub(super) fn swept_constants(frame: &Frame, swept: SweptKernel, channels: &DeviceChannels) -> Constants {
    let mut constants = sum_constants(channels);
    constants.retain(|(name, _)| !["MATERIAL", "SAMPLE_COVERAGE"].contains(name));
    let footprint = match (swept.weight, swept.shape) {
        (KernelWeight::Integral, KernelShape::Tube) => 0,
        (KernelWeight::Integral, KernelShape::Ellipsoid) => 1,
        (KernelWeight::Chord, _) => 2,
        (KernelWeight::Line, _) => 3,
    };
    constants.extend([
        ("FOOTPRINT", footprint),
        ("SOURCE_SAMPLES", swept.source_samples.0),
        ("SUM", u32::from(swept.alpha == TemporalAlpha::Sum)),
    ]);
    constants.extend(slice_constants(frame));
    constants
}

/// For pass `visibility` of kernels in motion.
pub(super) fn slice_constants(frame: &Frame) -> Constants {
    vec![("SLICES", frame.slices().max(1)), ("HAS_STATIC", u32::from(frame.has_static_picture()))]
}

/// For pass `resolve`.
pub(super) fn resolve_constants(frame: &Frame, channels: &DeviceChannels, planes: &FilmPlanes) -> Constants {
    let at = |plane: Option<usize>| plane.unwrap_or(0) as u32;
    let mut constants = sum_constants(channels);
    constants.retain(|(name, _)| *name != "VALUES");
    constants.extend([
        ("PHONG", u32::from(frame.shading == Shading::Phong)),
        ("DEPTH_PLANE", at(planes.depth)),
        ("NORMAL_PLANE", at(planes.normal)),
        ("VELOCITY_PLANE", at(planes.velocity)),
        ("PLANES", planes.count as u32),
    ]);
    constants
}

fn channels_of_composite(channels: &DeviceChannels) -> Constants {
    let composite = &channels.composite;
    vec![("CHANNELS", composite.count as u32), ("OWN", composite.own as u32)]
}

/// For pass `composite`.
pub(super) fn composite_constants(frame: &Frame, channels: &DeviceChannels) -> Constants {
    let mut constants = channels_of_composite(channels);
    constants.push(("APRONS", u32::from(frame.has_ewa())));
    constants.push(("OPEN", channels.composite.open.unwrap_or(0) as u32));
    constants
}

/// For pass `resolve` of what is transparent.
pub(super) fn transparent_resolve_constants(
    frame: &Frame,
    channels: &DeviceChannels,
    planes: &FilmPlanes,
) -> Constants {
    let at = |plane: Option<usize>| plane.unwrap_or(0) as u32;
    let mut constants = channels_of_composite(channels);
    constants.retain(|(name, _)| *name != "OWN");
    constants.extend([
        ("DEPTH_PLANE", at(planes.depth)),
        ("NORMAL_PLANE", at(planes.normal)),
        ("VELOCITY_PLANE", at(planes.velocity)),
        ("PLANES", planes.count as u32),
        ("CODED", u32::from(frame.blending == Some(Blending::Coded))),
    ]);
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
        ("HAS_STATIC", u32::from(frame.has_static_picture())),
        ("FILTERED", u32::from(frame.has_filtered_sweeps())),
    ]);
    constants
}
