//! Kernels in motion, filtered or not: parity with the CPU, pass by pass and slot by slot. Each pass is fed the
//! CPU's results of the passes before it. Also: broken programs, small buffers and whole images.

use super::cases::{self, Case};
use super::compare::{compare, flat};
use super::gpu_or_skip;
use super::harness::{Harness, NONE, PIXELS, Pass, tiles};
use super::mutants::{Mutant, all_are_noticed, named};
use super::posed::{Context, Posed, whole};
use super::slots::Slots;
use super::sweep_twins::SweepTwins;
use super::sweeps::{compare_sums, mask_planes, same_with_small_buffers, values};
use crate::backend::cpu::Cpu;
use crate::backend::cpu::swept::SweepGroup;
use crate::backend::gpu::Gpu;
use crate::backend::gpu::layout::TILE;
use crate::backend::gpu::slots::Slot;
use crate::layout::{SweptFilter, SweptSplat};
use crate::options::Prefilter;
use crate::plan::{Step, SweepPass};
use crate::renderer::render_checked;
use crate::time::FrameNumber;

/// The cases of kernels in motion, with a filter and without one.
pub(super) fn filtered() -> Vec<Case> {
    let own = || cases::swept().into_iter().filter(|case| !case.kernel().is_published());
    let with_filter = own().map(|mut case| {
        case.options.prefilter = Prefilter::Ewa;
        case
    });
    with_filter.chain(own().filter(|case| ["plain", "hard ellipsoid", "near"].contains(&case.name))).collect()
}

/// All passes of the first group of a case; the first that differs.
fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let frame = case.frame();
    let context = Context::of(&frame);
    let Some(mut harness) = Harness::new(gpu, &frame) else { return Ok(()) };
    let (interval, kernel) = frame
        .steps()
        .find_map(|step| match *step {
            Step::Sweep { interval, kernel, .. } => Some((interval, kernel)),
            _ => None,
        })
        .unwrap();
    let position = &frame.rasters[0].positions[0];
    let scope = context.scope(&frame, position, &position.groups[0], whole(position));
    let group = SweepGroup { scope, interval: &interval, kernel };
    let twins = SweepTwins { group, edge: TILE as usize };
    let failed = |pass: Pass| move |what: String| format!("{}: {pass:?}: {what}", case.name);
    let on_band = tiles(harness.prepared.schedule.rasters[0].tiles);

    let both = twins.sweep();
    let slots = Slots::new(&harness, &on_band, &both);
    harness.spoil();
    harness.run(Pass::MakeKernels);
    slots.compare_splats(&harness).map_err(failed(Pass::MakeKernels))?;
    slots.compare_lists(&harness).map_err(failed(Pass::MakeKernels))?;

    let kernels: Vec<Posed<'_, SweptSplat>> = both
        .iter()
        .map(|posed| Posed { chunk: posed.chunk.clone(), splats: posed.splats.iter().map(|both| both.splat).collect() })
        .collect();
    let filters: Vec<Vec<SweptFilter>> =
        both.iter().map(|posed| posed.splats.iter().map(|both| both.filtered).collect()).collect();
    let slices: Vec<_> = on_band.iter().map(|&tile| twins.visibility(&kernels, tile)).collect();
    // The nearest depths are behind the thresholds of all tiles.
    let count = interval.slices as usize;
    let part = |part: usize| slices.iter().flat_map(move |slices| slices.chunks(count).nth(part).map_or(vec![], flat));
    let thresholds: Vec<f32> = part(0).chain(part(1)).collect();
    slots.feed_splats(&harness);
    slots.feed_lists(&harness);
    let pass = Pass::Sweep(SweepPass::Visibility);
    harness.run(pass);
    let buffers = &harness.gpu.state.buffers;
    let got: Vec<f32> = harness.read(&buffers[Slot::Map], thresholds.len());
    compare("thresholds of slices", &got, &thresholds, |_| 1.0).map_err(failed(pass))?;

    let of_tile = |(&tile, slices): (_, &Vec<Vec<f32>>)| twins.attribute(&kernels, &filters, tile, slices);
    let sums: Vec<_> = on_band.iter().zip(&slices).map(of_tile).collect();
    harness.write(&buffers[Slot::Map], &thresholds.iter().map(|v| v.min(NONE)).collect::<Vec<_>>());
    let pass = Pass::Sweep(SweepPass::Attribute);
    harness.run(pass);
    compare_sums(&harness, &sums).map_err(failed(pass))?;

    let buffers = &harness.gpu.state.buffers;
    harness.write(&buffers[Slot::Sums], &sums.iter().flat_map(|sums| flat(&sums.channels)).collect::<Vec<_>>());
    harness.write(&buffers[Slot::CoverageMask], &sums.iter().flat_map(mask_planes).flatten().collect::<Vec<u32>>());
    let pass = Pass::Sweep(SweepPass::Resolve);
    harness.run(pass);
    let want: Vec<_> = on_band.iter().zip(&sums).flat_map(|(&tile, sums)| twins.resolve(tile, sums)).collect();
    let got: Vec<f32> = harness.read(&harness.gpu.state.buffers[Slot::Film], want.len() * PIXELS);
    compare("film", &got, &flat(&want), |_| 1.0).map_err(failed(pass))
}

#[test]
fn filtered_sweeps_agree() {
    let Some(mut gpu) = gpu_or_skip("filtered_sweeps_agree") else { return };
    for case in filtered() {
        eprintln!("{}:", case.name);
        check(&mut gpu, &case).unwrap_or_else(|what| panic!("{what}"));
    }
}

static MUTANTS: [Mutant; 34] = [
    ([("let area = 0.25 * (jux * jvy - juy * jvx)", "let area = 0.25 * (jux * jvy + juy * jvx)")], "tube"),
    ([("let l1 = 4.0 * xy * over0", "let l1 = 0.0")], "tube"),
    ([("let xy = 0.25 * (jux * juy + jvx * jvy)", "let xy = 0.25 * (jux * juy)")], "tube"),
    ([("variance * (xx + yy - variance)", "variance * (xx + yy)")], "tube"),
    ([("(sy - l1 * uz) / l2", "sy / l2")], "tube"),
    ([("geometry[columns * segment.buffer_surfels", "geometry[0u * segment.buffer_surfels")], "tube"),
    ([("wide.peak * (factor", "(factor")], "tube"),
    ([("about(own.begin, filtered.begin)", "own.begin")], "fast"),
    ([("max(own.across.y, filtered.across.y)", "own.across.y")], "fast"),
    ([("factor + wide.peak * (mean - factor)", "factor")], "tube"),
    ([("out.coverage = wide.peak * factor", "out.coverage = wide.peak * mean")], "tube"),
    ([("filtered.coverage = 0.0", "filtered.coverage = 1.0")], "hard"),
    ([("if f.coverage != 0.0", "if f.coverage != 9.0")], "hard"),
    ([("(*mask).surface |= moments_in(disc_span)", "(*mask).surface |= moments_in(disc_span) & 0xffffu")], "fast"),
    ([("own_k = f.k", "own_k = 2.0 * f.k")], "near"),
    ([("let time = 1.0 + view.slope * tau;\n    let in_tube", "let time = 1.0;\n    let in_tube")], "fast"),
    ([("select(HIDDEN, part, part > 0.0)", "1.0")], "fast"),
    ([("* part; }", "; }")], "sum"),
    ([("min(weight, most) *", "most *")], "hard"),
    ([("vec2<f32>(over, k * over), on_plane", "vec2<f32>(over, k * over), false")], "fast"),
    ([("loose * vec2<f32>(f.peak, side)", "loose * vec2<f32>(f.peak, 1.0)")], "tube"),
    ([("0.5 * (sum + abs(side))", "0.5 * (sum + side)")], "tube"),
    ([("weight / noise", "weight")], "fast"),
    ([("if view.sigma == 0.0", "if view.sigma < 0.0")], "without filter"),
    ([("return max(epsilon, LEAST_EPSILON * depth)", "return LEAST_EPSILON * depth")], "tube"),
    ([("values[slot * VALUES + TOLERANCE])", "0.0)")], "tolerances"),
    ([("min(limit, map[slices.nearest", "max(limit, map[slices.nearest")], "tolerances"),
    ([("in_tile) + slice * TILE_PIXELS, depth);", "in_tile) + slice * TILE_PIXELS, 2.0 * depth);")], "tolerances"),
    ([("covered_at(next_slot(&walk), pixel)", "covered_at(next_slot(&walk), pixel + 1u)")], "hard"),
    ([("kernel.span.x < middle && middle < kernel.span.y", "kernel.span.x < middle")], "fast"),
    ([("begin + 0.5 * step", "begin")], "fast"),
    ([("kernel.plane.x + middle * kernel.plane.y", "kernel.plane.x")], "fast"),
    ([("map[slices.thresholds + slice * TILE_PIXELS]", "map[slices.thresholds]")], "fast"),
    ([("1.0 - (1.0 - large) * (1.0 - large)", "large")], "fast"),
];

#[test]
#[ignore = "deep: broken programs"]
fn broken_filtered_sweeps_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_filtered_sweeps_are_noticed") else { return };
    let cases = filtered();
    let unfiltered = cases.iter().find(|case| case.options.prefilter == Prefilter::None).unwrap();
    let case = |name| if name == "without filter" { unfiltered } else { named(&cases, name) };
    all_are_noticed(&mut gpu, &MUTANTS, |gpu, name| check(gpu, case(name)));
}

/// Whole images, and the same with small buffers.
#[test]
#[ignore = "deep: whole pictures"]
fn filtered_images_look_the_same() {
    let Some(mut gpu) = gpu_or_skip("filtered_images_look_the_same") else { return };
    let cases = filtered();
    for (case, whole) in cases.iter().zip(same_with_small_buffers(&mut gpu, &cases)) {
        let want =
            render_checked(&mut Cpu::default(), &case.scene, FrameNumber::from(0), &case.options).unwrap().picture;
        let (got, want) = (values(&whole), values(&want));
        let scale = want.iter().copied().filter(|v| v.is_finite()).fold(1.0_f32, |a, b| a.max(b.abs()));
        let difference = |(g, w): (&f32, &f32)| if g == w { 0.0 } else { (g - w).abs() / scale };
        let differing = got.iter().zip(&want).map(difference).filter(|&d| d >= 1e-4 || d.is_nan()).count();
        let covered = want.iter().filter(|&&v| v != 0.0 && v.is_finite()).count();
        eprintln!("{}: {differing} of {} values differ, {covered} not 0", case.name, want.len());
        assert!(differing as f64 <= 1e-3 * want.len() as f64, "{}: {differing} values differ", case.name);
        assert!(covered > 0, "{}: nothing to compare", case.name);
    }
}
