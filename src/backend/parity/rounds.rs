//! Groups that go through the passes together give the pictures of the CPU, and of groups one by one.

use glam::DVec3;

use super::cases::{self, Case};
use super::gpu_or_skip;
use super::mutants::{Mutant, all_are_noticed, named};
use super::shared_rest;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::Gpu;
use crate::backend::{Backend, Rendered};
use crate::options::BlurMode;
use crate::renderer::render_checked;
use crate::scene::Motion;
use crate::time::FrameNumber;

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

fn frame(backend: &mut dyn Backend, case: &Case) -> Rendered {
    render_checked(backend, &case.scene, FrameNumber::from(0), &case.options).unwrap_or_else(|e| panic!("{e}"))
}

/// Compares pictures with the CPU's.
fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let (want, got) = (frame(&mut Cpu::default(), case), frame(gpu, case));
    let pairs = got.picture.rgba.iter().flatten().zip(want.picture.rgba.iter().flatten());
    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let walks = got.stats.gpu.map(|calls| calls.walks);
    eprintln!("{}: worst {worst:.1e}, {walks:?} walks", case.name);
    if worst > 2e-5 { Err(format!("{}: pixels differ by {worst}", case.name)) } else { Ok(()) }
}

#[test]
fn groups_together_are_groups_one_by_one() {
    let Some(mut gpu) = gpu_or_skip("groups_together_are_groups_one_by_one") else { return };
    for case in cases() {
        check(&mut gpu, &case).unwrap_or_else(|what| panic!("{what}"));
        let together = frame(&mut gpu, &case);
        for (groups, rounds) in [(1, 3), (2, 2)] {
            let mut fewer = gpu.beside();
            fewer.most_groups = groups;
            let got = frame(&mut fewer, &case);
            assert_eq!(got.picture, together.picture, "{}: {groups} at once", case.name);
            let walks = |rendered: &Rendered| rendered.stats.gpu.unwrap().walks;
            assert_eq!((walks(&together), walks(&got)), (2, 2 * rounds), "{}: {groups} at once", case.name);
        }
    }
}

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
