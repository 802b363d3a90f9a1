//! Groups that go through the passes together give the pictures of the CPU, and of groups one by one.

use glam::DVec3;

use super::cases::{self, Case};
use super::gpu_or_skip;
use super::mutants::{Mutant, all_are_noticed, named};
use super::pictures::{pixels_agree, render};
use super::shared_rest;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::Gpu;
use crate::backend::{Backend, GpuCalls, Rendered};
use crate::options::BlurMode;
use crate::scene::Motion;

/// Three instants of splats that touch most tiles, and of a ball before a ball at rest.
fn cases() -> Vec<Case> {
    let mut wide = cases::large_splats();
    wide.name = "wide";
    wide.scene.objects[0].motions.push(Motion::Linear { velocity: DVec3::new(1.5, 0.2, 0.0) });
    wide.options.quality = BlurMode::supersample(3).into();
    let mut few = shared_rest::cases().remove(0);
    few.name = "few";
    few.options.quality = BlurMode::supersample(3).into();
    vec![wide, few]
}

/// Compares pictures with the CPU's.
fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let (want, got) = (render(&mut Cpu::default(), case), render(gpu, case));
    pixels_agree(case.name, &got.picture, &want.picture, 2e-5)
}

#[test]
fn groups_together_are_groups_one_by_one() {
    let Some(mut gpu) = gpu_or_skip("groups_together_are_groups_one_by_one") else { return };
    for case in cases() {
        check(&mut gpu, &case).unwrap_or_else(|what| panic!("{what}"));
        let together = render(&mut gpu, &case);
        for (groups, rounds) in [(1, 3), (2, 2)] {
            let mut fewer = gpu.beside();
            fewer.most_groups = groups;
            let got = render(&mut fewer, &case);
            assert_eq!(got.picture, together.picture, "{}: {groups} at once", case.name);
            let walks = |rendered: &Rendered| rendered.stats.gpu.unwrap().walks;
            assert_eq!((walks(&together), walks(&got)), (1, rounds), "{}: {groups} at once", case.name);
        }
    }
}

/// Cases of kernels in motion; one with other sample positions, too.
fn swept() -> Vec<Case> {
    let mut cases = cases::swept();
    let mut positions = Case { name: "positions", ..named(&cases, "fast").clone() };
    let swept = positions.kernel();
    positions.options.quality = BlurMode::Volumetric { intervals: 2, pixel_samples: Some(2), swept }.into();
    cases.push(positions);
    cases
}

/// Intervals of kernels in motion that go through the passes together give the pictures of intervals one by one.
fn check_swept(together: &mut Gpu, alone: &mut Gpu, case: &Case) -> Result<(), String> {
    let [got, _] = same_one_by_one(together, alone, case)?;
    assert_eq!(got.walks, 1, "{}", case.name);
    Ok(())
}

/// The calls for a picture, which must take fewer walks than groups one by one, and for theirs, which must be the same.
pub(super) fn same_one_by_one(together: &mut Gpu, alone: &mut Gpu, case: &Case) -> Result<[GpuCalls; 2], String> {
    let [got, want] =
        [together, alone].map(|gpu| gpu.render(case.frame()).unwrap_or_else(|e| panic!("{}: {e}", case.name)));
    let calls = [&got, &want].map(|rendered| rendered.stats.gpu.unwrap());
    let walks = calls.map(|calls| calls.walks);
    eprintln!("{}: {walks:?} walks", case.name);
    assert!(walks[0] < walks[1], "{}: {walks:?} walks", case.name);
    if got.picture == want.picture { Ok(calls) } else { Err(format!("{}: another picture", case.name)) }
}

/// Loops that end early: the lists of all intervals of a round are walked over in stretches.
#[test]
fn rounds_of_intervals_go_on_in_stretches() {
    let Some(mut roomy) = gpu_or_skip("rounds_of_intervals_go_on_in_stretches") else { return };
    let mut short = roomy.beside();
    short.most_turns = 2_100;
    for case in swept().iter().filter(|case| ["fast", "positions", "once"].contains(&case.name)) {
        let (got, want) = (render(&mut short, case), render(&mut roomy, case));
        let [got_calls, want_calls] = [&got, &want].map(|rendered| rendered.stats.gpu.unwrap());
        assert!(got_calls.dispatches > want_calls.dispatches, "{}: no list was cut", case.name);
        assert_eq!((got_calls.walks, want_calls.walks), (1, 1), "{}: not one round", case.name);
        assert_eq!(got.picture, want.picture, "{}", case.name);
    }
}

#[test]
fn intervals_together_are_intervals_one_by_one() {
    let Some(mut together) = gpu_or_skip("intervals_together_are_intervals_one_by_one") else { return };
    let mut alone = together.beside();
    alone.most_groups = 1;
    let cases = swept();
    for name in ["fast", "positions", "hard ellipsoid", "sum", "once", "tolerances"] {
        check_swept(&mut together, &mut alone, named(&cases, name)).unwrap_or_else(|what| panic!("{what}"));
    }
}

#[test]
#[ignore = "deep: broken programs"]
fn broken_rounds_of_intervals_are_noticed() {
    let Some(mut together) = gpu_or_skip("broken_rounds_of_intervals_are_noticed") else { return };
    let mut alone = together.beside();
    alone.most_groups = 1;
    let cases = swept();
    all_are_noticed(&mut together, &SWEPT, |gpu, name| check_swept(gpu, &mut alone, named(&cases, name)));
}

static SWEPT: [Mutant; 8] = [
    ([("view = views[segment.view];\n    let slot", "view = views[0];\n    let slot")], "positions"),
    ([("slices_of(view.round_tiles + index, at)", "slices_of(view.tiles.x * view.tiles.y + index, at)")], "tolerances"),
    ([("let mask_at = MASKS * index", "let mask_at = 0u * MASKS * index")], "fast"),
    ([("view = views[number];\n        if !has_tile", "view = views[tile.z];\n        if !has_tile")], "fast"),
    ([("view = views[number];\n        if has_tile", "view = views[tile.z];\n        if has_tile")], "once"),
    ([("add_pixel(film_tile_of(tile.xy), tile.xy", "add_pixel(tile_of(tile.xy), tile.xy")], "fast"),
    ([("let at = film_tile_of(tile) *", "let at = tile_of(tile) *")], "once"),
    ([("moments[view.first_moment + i], ((surface", "moments[i], ((surface")], "fast"),
];

static MUTANTS: [Mutant; 5] = [
    ([("views[middle].first_slot <= slot", "views[middle].first_slot < slot")], "few"),
    ([("return view.first_tile + ", "return 0u * view.first_tile + ")], "few"),
    ([("let wide_at = view.round_tiles + 1u + view.number", "let wide_at = view.round_tiles + 1u")], "wide"),
    ([("if wide[middle] < slot", "if wide[middle] < 0u * slot")], "wide"),
    ([("tile.z + views[tile.z].same_film", "tile.z + min(views[tile.z].same_film, 1u)")], "few"),
];

#[test]
#[ignore = "deep: broken programs"]
fn broken_rounds_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_rounds_are_noticed") else { return };
    let cases = cases();
    all_are_noticed(&mut gpu, &MUTANTS, |gpu, name| check(gpu, named(&cases, name)));
}
