//! Splats and tiles at rest are made once for all groups of a sample position, on both backends.

use glam::DVec3;

use super::cases::{Case, ball, object, scene};
use super::gpu_or_skip;
use super::mutants::{Mutant, all_are_noticed};
use super::pictures::{pixels_agree, render};
use crate::backend::cpu::Cpu;
use crate::backend::gpu::Gpu;
use crate::film::Aov;
use crate::options::{BlurMode, Interleave, Look, Prefilter, RenderOptions, Times};
use crate::scene::{Motion, Scene};

/// A ball at rest that fills tiles of its own, and a small one that crosses a part of it.
fn ball_before_ball() -> Scene {
    let mut still = object(ball(1500, 1, true), DVec3::new(-0.2, 0.0, -1.0));
    still.transform.scale = DVec3::splat(1.4);
    let mut moving = object(ball(200, 2, false), DVec3::new(0.3, 0.3, 0.4));
    moving.transform.scale = DVec3::splat(0.2);
    moving.motions = vec![Motion::Linear { velocity: DVec3::new(0.8, 0.0, 0.0) }];
    scene(vec![moving, still], [150, 100])
}

/// Time samples at two positions: groups of one sample with and without a filter, and groups of several.
pub(super) fn cases() -> Vec<Case> {
    let bucket = BlurMode::Bucket {
        buckets: 6,
        samples: 2,
        pixel_samples: Some(2),
        interleave: Interleave::None,
        times: Times::Even,
    };
    let shared =
        BlurMode::Supersample { samples: 8, pixel_samples: Some(2), interleave: Interleave::None, times: Times::Even };
    let case = |name, mode: BlurMode, prefilter| {
        let options = RenderOptions {
            quality: mode.into(),
            prefilter,
            look: Look { aovs: Aov::ALL.to_vec(), ..Look::default() },
            ..RenderOptions::default()
        };
        Case { name, scene: ball_before_ball(), options, in_part: false }
    };
    vec![
        case("plain", shared, Prefilter::None),
        case("filtered", shared, Prefilter::Ewa),
        case("bucket", bucket, Prefilter::None),
        case("bucket, filtered", bucket, Prefilter::Ewa),
    ]
}

/// Compares pictures, and the number of splats that were made: what is at rest counts once a position.
fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let (want, got) = (render(&mut Cpu::default(), case), render(gpu, case));
    if got.stats.splats.abs_diff(want.stats.splats) > 3 {
        return Err(format!("{}: {} splats, not {}", case.name, got.stats.splats, want.stats.splats));
    }
    pixels_agree(case.name, &got.picture, &want.picture, 2e-5)
}

#[test]
fn what_rests_is_made_once_a_position() {
    let Some(mut gpu) = gpu_or_skip("what_rests_is_made_once_a_position") else { return };
    for case in cases() {
        check(&mut gpu, &case).unwrap_or_else(|what| panic!("{what}"));
        let want = render(&mut gpu, &case);
        // Surfels in many batches, and bands of few tiles.
        let (mut batches, mut bands) = (gpu.beside(), gpu.beside());
        batches.most_slots = 100;
        bands.most_bytes = 160 << 10;
        assert_eq!(render(&mut batches, &case).picture, want.picture, "{}: batches of 100", case.name);
        assert_eq!(render(&mut bands, &case).picture, want.picture, "{}: bindings of 160 KiB", case.name);
    }
}

static MUTANTS: [Mutant; 9] = [
    ([("walk.later = walk.next", "walk.later = walk.end")], "plain"),
    ([("return views[view.rest].first_tile", "return view.first_tile")], "plain"),
    ([("min(thresholds[at], thresholds[depths_of(rest) + i])", "thresholds[at]")], "plain"),
    ([("if views[other].rest != own { continue; }", "if true { continue; }")], "filtered"),
    ([("known != view.rest + 1u", "false")], "filtered"),
    ([("+= weight * shown[plane]", "+= shown[plane]")], "filtered"),
    ([("!= 0u && starts[index] == starts[index + 1u]", "!= 0u && true")], "plain"),
    ([("if SAMPLE_COVERAGE != 0u { weight = 1.0; }", "")], "bucket"),
    ([("|| (view.flags & IS_REST) != 0u", "")], "plain"),
];

#[test]
#[ignore = "deep: broken programs"]
fn broken_shares_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_shares_are_noticed") else { return };
    let cases = cases();
    all_are_noticed(&mut gpu, &MUTANTS, |gpu, name| check(gpu, super::mutants::named(&cases, name)));
}
