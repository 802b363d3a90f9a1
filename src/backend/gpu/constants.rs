//! Values of the `override` constants of programs: what the frame needs, where channels and planes are.

use super::layout::DIGIT_BITS;
use super::memory::DeviceChannels;
use super::prepared::Prepared;
use super::steps::Kind;
use crate::film::{Aov, Blending};
use crate::layout::{EwaSplat, FilteredSplat, Splat, SweptSplat};
use crate::options::{KernelShape, KernelWeight, Shading, TemporalAlpha};
use crate::plan::LAYERS;

/// What a round of a sort goes by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum Digit {
    /// This digit of the keys, the last one first.
    OfKey(u32),
    /// The view.
    OfView,
}

/// The value of a constant of programs that work on `kind`; a round of a sort goes by `digit`. `None`: it has no such
/// constant.
pub(in crate::backend) fn constant(
    prepared: &Prepared<'_>,
    kind: Kind,
    digit: Option<Digit>,
    name: &str,
) -> Option<u32> {
    let Prepared { frame, planes, .. } = prepared;
    let at = |place: Option<usize>| place.unwrap_or(0) as u32;
    let parts = splat_parts(prepared, kind);
    let swept = frame.swept.unwrap_or_default();
    // The films of layers have a plane more, their depth.
    let planes_of_layers = planes.count as u32 + 1;
    Some(match name {
        "SHIFT" => match digit {
            Some(Digit::OfKey(number)) => number * DIGIT_BITS,
            Some(Digit::OfView) | None => 0,
        },
        "BY_VIEW" => u32::from(digit == Some(Digit::OfView)),
        "DEPTH_PLANE" => at(planes.depth),
        "NORMAL_PLANE" => at(planes.normal),
        "VELOCITY_PLANE" => at(planes.velocity),
        // The weights are the coverage, plane 3, where they have no plane of their own.
        "WEIGHT_PLANE" => planes.weight.unwrap_or(3) as u32,
        "PLANES" if kind != Kind::Peel => planes.count as u32,
        "PLANES" | "LAYER_PLANES" => planes_of_layers,
        "MOST_LAYERS" => u32::from(LAYERS),
        "APRONS" => u32::from(frame.has_filtered_kernels()),
        "SPLATS" => parts,
        // Bounds of lists are in the last part of filtered kernels, and behind the first one of kernels in motion.
        "BOUNDS_PART" => {
            if kind == Kind::Sweep {
                1
            } else {
                parts - 1
            }
        }
        "FLAGS_PART" => u32::from(matches!(kind, Kind::Sweep | Kind::Published)),
        // How the depths of a tile lie (`shaders/common/depths.wgsl`).
        "FILTERED" => match kind {
            Kind::Sorted => u32::from(frame.has_filtered_kernels()),
            _ => u32::from(kind.is_filtered(frame)),
        },
        // Layers that are peeled off have one limit for all objects.
        "NEAREST" => u32::from(frame.keeps_nearest && matches!(kind, Kind::Paint | Kind::Sweep)),
        "PEEL" => u32::from(kind == Kind::Peel),
        "STRETCH" => match kind {
            Kind::Sweep | Kind::Published | Kind::Sorted => u32::try_from(prepared.stretch).unwrap_or(u32::MAX),
            Kind::Paint | Kind::Peel | Kind::Map => u32::MAX,
        },
        "GOURAUD" => u32::from(frame.shading == Shading::Gouraud),
        "PHONG" => u32::from(frame.shading == Shading::Phong),
        // Pixels along an edge of the environment; 0 where nothing mirrors it.
        "FACE" => frame.surroundings.as_ref().map_or(0, |surroundings| surroundings.cube.face() as u32),
        "SLICES" => {
            if kind == Kind::Sweep {
                frame.slices().max(1)
            } else {
                1
            }
        }
        "SUM" => u32::from(frame.swept.is_some() && swept.alpha == TemporalAlpha::Sum),
        "LINE" => u32::from(swept.weight == KernelWeight::Line),
        "SOURCE_SAMPLES" => swept.source_samples.0,
        "ELLIPSOID" => u32::from(kind == Kind::Published || swept.shape == KernelShape::Ellipsoid),
        "BY_ELLIPSOID" => u32::from(swept.shape == KernelShape::Ellipsoid),
        "SHADOW_LIGHTS" => prepared.schedule.shadows.lights as u32,
        "FACES" => prepared.schedule.shadows.faces as u32,
        "SKY" => u32::from(frame.all_samples().next().is_some_and(|sample| sample.sky.is_some())),
        "TEXELS" => prepared.schedule.shadows.texels as u32,
        "TEXEL_WORDS" => prepared.schedule.shadows.texel_words as u32,
        "CAPTURE_WORD" => prepared.schedule.shadows.capture_word as u32,
        "CODED" => u32::from(frame.blending == Some(Blending::Coded)),
        _ if kind == Kind::Sorted => return of_composite(prepared, name),
        _ => return of_sums(kind.channels(prepared), name),
    })
}

/// The channels of sums (`shaders/common/channels.wgsl`).
fn of_sums(channels: &DeviceChannels, name: &str) -> Option<u32> {
    let at = |channel: Option<usize>| channel.unwrap_or(0) as u32;
    let shared = &channels.shared;
    Some(match name {
        "NORMAL" => at(shared.normal),
        "DEPTH" => at(shared.depth),
        "VELOCITY" => at(shared.velocity),
        "MATERIAL" => at(shared.material),
        "REFLECTION" => at(shared.reflection),
        "RECEIVES" => at(shared.receives),
        "CATCHER" => at(shared.catcher),
        "HELD" => at(shared.held),
        "MOVED" => at(shared.moved),
        "ALL_HELD" => u32::from(shared.all_held),
        "OPACITY" => at(channels.opacity),
        "SAMPLE_COVERAGE" => at(channels.sample_coverage),
        "PEAK" => at(channels.peak),
        "TOLERANCE" => at(channels.tolerance),
        "CHANNELS" => channels.count as u32,
        "LAYERS" => channels.layers as u32,
        "VALUES" => channels.values,
        _ => return None,
    })
}

/// The channels of the composite of what is transparent, and whether Gaussians have a velocity.
fn of_composite(prepared: &Prepared<'_>, name: &str) -> Option<u32> {
    let at = |channel: Option<usize>| channel.unwrap_or(0) as u32;
    let composite = &prepared.channels.composite;
    Some(match name {
        "CHANNELS" => composite.count as u32,
        "OWN" => composite.own as u32,
        "NORMAL" => at(composite.normal),
        "OPEN" => at(composite.open),
        "NEXT" => at(composite.next),
        "VELOCITY" => u32::from(prepared.frame.aovs.contains(&Aov::Velocity)),
        _ => return None,
    })
}

/// Splats that fit into one of a kind of kernels.
fn splat_parts(prepared: &Prepared<'_>, kind: Kind) -> u32 {
    let bytes = match kind {
        Kind::Sweep => size_of::<FilteredSplat>(),
        Kind::Published => size_of::<SweptSplat>(),
        Kind::Paint | Kind::Peel if kind.is_filtered(prepared.frame) => size_of::<EwaSplat>(),
        Kind::Paint | Kind::Peel | Kind::Map | Kind::Sorted => size_of::<Splat>(),
    };
    (bytes / size_of::<Splat>()) as u32
}
