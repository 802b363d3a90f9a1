//! Kernels in motion, published ones and all others, with a filter and without: parity with the CPU, pass by pass and
//! slot by slot. Each pass is fed the CPU's results of the passes before it. Also: broken programs and whole pictures.

use super::cases::{self, Case};
use super::compare::{Tally, compare, flat};
use super::gpu_or_skip;
use super::harness::{Harness, NONE, PIXELS, Pass, tiles};
use super::mutants::{Mutant, all_are_noticed, named};
use super::pictures::{are_the_cpus, render, values};
use super::posed::{Context, Posed, whole};
use super::slots::{Slots, Slotted};
use super::sweep_twins::{MapTwins, PublishedTwins, SweepTwins, SweptSums};
use crate::backend::Rendered;
use crate::backend::cpu::Cpu;
use crate::backend::cpu::published::{Map, MapGroup, PublishedSweepGroup};
use crate::backend::cpu::swept::SweepGroup;
use crate::backend::gpu::Gpu;
use crate::backend::gpu::layout::TILE;
use crate::backend::gpu::slots::Slot;
use crate::layout::{SweptFilter, SweptSplat};
use crate::options::Prefilter;
use crate::plan::{MapPass, Published, PublishedSweepPass, Step, SweepPass};

/// The cases of kernels in motion, with a filter and without one.
pub(super) fn own() -> Vec<Case> {
    let all = || cases::swept().into_iter().filter(|case| !case.kernel().is_published());
    let with_filter = all().map(|mut case| {
        case.options.prefilter = Prefilter::Ewa;
        case
    });
    let some = ["plain", "hard ellipsoid", "near"];
    let mut without = all().filter(|case| some.contains(&case.name)).collect::<Vec<_>>();
    without[0].name = "without filter";
    with_filter.chain(without).collect()
}

/// The cases of published kernels.
fn published() -> Vec<Case> {
    let is_published = |case: &Case| case.kernel().is_published();
    cases::swept().into_iter().filter(is_published).collect()
}

/// All passes of the first group of a case of published kernels; the first that differs.
#[allow(clippy::too_many_lines, reason = "one pass after the other, each fed by the one before")]
fn check_published(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let frame = case.frame();
    let context = Context::of(&frame);
    let Some(mut harness) = Harness::new(gpu, &frame) else { return Ok(()) };
    let (interval, kernel) = frame
        .steps()
        .find_map(|step| match *step {
            Step::Published { part: Published::Sweep { interval, kernel }, .. } => Some((interval, kernel)),
            _ => None,
        })
        .unwrap();
    let position = &frame.rasters[0].positions[0];
    let (edge, band) = (TILE as usize, whole(position));
    let scope = |band| context.scope(&frame, position, &position.groups[0], band);
    let map_twins = MapTwins { group: MapGroup { scope: scope(band.guarded(interval.guard)) }, edge };
    let raster = harness.prepared.schedule.rasters[0];
    let around = raster.area(harness.prepared.schedule.bands(0).next().unwrap()).guarded(interval.guard);
    let (on_map, on_band) = (tiles(around.tiles), tiles(raster.tiles));
    let failed = |pass: Pass| move |what: String| format!("{}: {pass:?}: {what}", case.name);

    let splats = map_twins.project();
    let slots = Slots::new(&harness, &on_map, &splats);
    harness.spoil();
    harness.run(Pass::Project);
    slots.compare_splats(&harness).map_err(failed(Pass::Project))?;
    slots.feed_splats(&harness);
    slots.feed_lists(&harness);
    harness.run(Pass::Bin);
    slots.compare_lists(&harness).map_err(failed(Pass::Bin))?;

    let thresholds: Vec<_> = on_map.iter().map(|&tile| map_twins.visibility(&splats, tile)).collect();
    let count = on_map.len() * PIXELS;
    slots.feed_splats(&harness);
    slots.feed_lists(&harness);
    let pass = Pass::Map(MapPass::Visibility);
    harness.run(pass);
    let got: Vec<f32> = harness.read(&harness.gpu.state.buffers[Slot::Thresholds], count);
    compare(Slot::Thresholds, &got, &flat(&thresholds), |_| 1.0).map_err(failed(pass))?;

    let finite: Vec<f32> = thresholds.iter().flatten().map(|t| t.min(NONE)).collect();
    harness.write(&harness.gpu.state.buffers[Slot::Thresholds], &finite);
    let stored: Vec<_> = on_map.iter().zip(&thresholds).map(|(&tile, t)| map_twins.store(tile, t)).collect();
    let pass = Pass::Map(MapPass::Store);
    harness.run(pass);
    let got: Vec<f32> = harness.read(&harness.gpu.state.buffers[Slot::Map], count);
    // Beyond the guard band the CPU stores nothing; no sources are there.
    let [width, height] = around.pixels.size();
    let inside = |i: usize| {
        let (tile, pixel) = (on_map[i / PIXELS], i % PIXELS);
        tile[0] * edge + pixel % edge < width as usize && tile[1] * edge + pixel / edge < height as usize
    };
    let some = |values: &[f32]| -> Vec<f32> {
        values.iter().enumerate().filter(|(i, _)| inside(*i)).map(|(_, value)| *value).collect()
    };
    compare(Slot::Map, &some(&got), &some(&flat(&stored)), |_| 1.0).map_err(failed(pass))?;

    let map: Map = map_twins.map(&stored, around.tiles[0] as usize);
    let group = PublishedSweepGroup { scope: scope(band), interval: &interval, kernel, map: &map };
    let twins = PublishedTwins { group, edge };
    let kernels = twins.sweep();
    let slots = Slots::new(&harness, &on_band, &kernels);
    compare_kernels(&mut harness, &slots).map_err(failed(Pass::MakeKernels))?;

    slots.feed_splats(&harness);
    slots.feed_lists(&harness);
    let fed: Vec<f32> = stored.iter().flatten().map(|v| v.min(NONE)).collect();
    harness.write(&harness.gpu.state.buffers[Slot::Map], &fed);
    let sums: Vec<_> = on_band.iter().map(|&tile| twins.attribute(&kernels, tile)).collect();
    let pass = Pass::PublishedSweep(PublishedSweepPass::Attribute);
    harness.run(pass);
    compare_sums(&harness, &sums).map_err(failed(pass))?;

    let pass = Pass::PublishedSweep(PublishedSweepPass::Resolve);
    let film: Vec<_> = on_band.iter().zip(&sums).flat_map(|(&tile, sums)| twins.resolve(tile, sums)).collect();
    compare_film(&mut harness, &sums, &film, pass).map_err(failed(pass))
}

/// The same of all others.
fn check_own(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
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
    compare_kernels(&mut harness, &slots).map_err(failed(Pass::MakeKernels))?;

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
    compare(Slot::Map, &got, &thresholds, |_| 1.0).map_err(failed(pass))?;

    let of_tile = |(&tile, slices): (_, &Vec<Vec<f32>>)| twins.attribute(&kernels, &filters, tile, slices);
    let sums: Vec<_> = on_band.iter().zip(&slices).map(of_tile).collect();
    harness.write(&buffers[Slot::Map], &thresholds.iter().map(|v| v.min(NONE)).collect::<Vec<_>>());
    let pass = Pass::Sweep(SweepPass::Attribute);
    harness.run(pass);
    compare_sums(&harness, &sums).map_err(failed(pass))?;

    let film: Vec<_> = on_band.iter().zip(&sums).flat_map(|(&tile, sums)| twins.resolve(tile, sums)).collect();
    let pass = Pass::Sweep(SweepPass::Resolve);
    compare_film(&mut harness, &sums, &film, pass).map_err(failed(pass))
}

/// Pass `resolve` of these sums.
fn compare_film(harness: &mut Harness<'_>, sums: &[SweptSums], want: &[Vec<f32>], pass: Pass) -> Result<(), String> {
    let buffers = &harness.gpu.state.buffers;
    harness.write(&buffers[Slot::Sums], &sums.iter().flat_map(|sums| flat(&sums.channels)).collect::<Vec<_>>());
    harness.write(&buffers[Slot::CoverageMask], &sums.iter().flat_map(mask_planes).flatten().collect::<Vec<u32>>());
    harness.run(pass);
    let got: Vec<f32> = harness.read(&harness.gpu.state.buffers[Slot::Film], want.len() * PIXELS);
    compare(Slot::Film, &got, &flat(want), |_| 1.0)
}

/// `Project` and `Bin` of kernels in motion.
fn compare_kernels<S: Slotted>(harness: &mut Harness<'_>, slots: &Slots<S>) -> Result<(), String> {
    harness.run(Pass::MakeKernels);
    slots.compare_splats(harness)?;
    slots.compare_lists(harness)
}

/// The planes of a tile's coverage mask.
fn mask_planes(sums: &SweptSums) -> Vec<Vec<u32>> {
    let bits = |plane: &Vec<f32>| plane.iter().map(|v| v.to_bits()).collect();
    sums.times.iter().cloned().chain(sums.weights.iter().map(bits)).collect()
}

fn compare_sums(harness: &Harness<'_>, want: &[SweptSums]) -> Result<(), String> {
    let buffers = &harness.gpu.state.buffers;
    let channels = harness.prepared.channels.count;
    let got: Vec<f32> = harness.read(&buffers[Slot::Sums], want.len() * channels * PIXELS);
    let values: Vec<f32> = want.iter().flat_map(|sums| flat(&sums.channels)).collect();
    // A sum's rounding goes with the sum of the weights.
    let weight = |i: usize| want[i / (channels * PIXELS)].channels[0][i % PIXELS];
    compare(Slot::Sums, &got, &values, weight)?;
    let bits: Vec<u32> = want.iter().flat_map(mask_planes).flatten().collect();
    let masks = bits.len() / (want.len() * PIXELS);
    let got: Vec<u32> = harness.read(&buffers[Slot::CoverageMask], bits.len());
    let (mut times, mut loose) = (Tally::of(Slot::Sums), Tally::of(Slot::Sums));
    for (i, (&got, &want)) in got.iter().zip(&bits).enumerate() {
        if i / PIXELS % masks >= 2 {
            let [got, want] = [got, want].map(f32::from_bits);
            loose.floats(&[got], &[want], want.abs(), || format!("{i}"));
        } else {
            times.count += 1;
            if got != want {
                times.otherwise(|| format!("{i}: {got:032b}, not {want:032b}"));
            }
        }
    }
    times.check("coverage mask")?;
    loose.check("loose weights")
}

/// All passes of the first group of a case; the first that differs.
fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    if case.kernel().is_published() { check_published(gpu, case) } else { check_own(gpu, case) }
}

#[test]
fn swept_passes_agree() {
    let Some(mut gpu) = gpu_or_skip("swept_passes_agree") else { return };
    for case in own().iter().chain(&published()) {
        eprintln!("{}:", case.name);
        check(&mut gpu, case).unwrap_or_else(|what| panic!("{what}"));
    }
}

#[test]
#[ignore = "deep: broken programs"]
fn broken_swept_programs_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_swept_programs_are_noticed") else { return };
    for (mutants, cases) in [(&OF_PUBLISHED[..], published()), (&OF_OWN, own())] {
        all_are_noticed(&mut gpu, mutants, |gpu, name| check(gpu, named(&cases, name)));
    }
}

#[test]
#[ignore = "deep: whole pictures"]
fn swept_images_look_the_same() {
    let Some(mut gpu) = gpu_or_skip("swept_images_look_the_same") else { return };
    are_the_cpus(&mut gpu, &[own(), cases::swept()].concat());
}

/// Loops that end early: lists are walked over in stretches.
#[test]
fn lists_in_stretches_change_no_swept_image() {
    let Some(mut roomy) = gpu_or_skip("lists_in_stretches_change_no_swept_image") else { return };
    let dispatches = |rendered: &Rendered| rendered.stats.gpu.unwrap().dispatches;
    let mut short = roomy.beside();
    // Walls are a few wide kernels, for which tiles have a list of their own.
    let some = ["tube", "fast", "hard", "near", "walls"];
    let own = cases::swept().into_iter().filter(|case| some.contains(&case.name));
    for case in &own.chain(published().into_iter().take(2)).collect::<Vec<_>>() {
        short.most_turns = if case.name == "walls" { 20 } else { 150 };
        let (got, want) = (render(&mut short, case), render(&mut roomy, case));
        assert!(dispatches(&got) > dispatches(&want), "{}: no list was cut", case.name);
        assert_eq!(got.picture, want.picture, "{}", case.name);
    }
}

/// So many kernels at each pixel that a software device would end a loop over all of them.
#[test]
#[ignore = "deep: many samples"]
fn no_kernel_of_a_long_list_is_lost() {
    let Some(mut gpu) = gpu_or_skip("no_kernel_of_a_long_list_is_lost") else { return };
    let mut case = cases::swept().into_iter().find(|case| !case.kernel().is_published()).unwrap();
    let mut pile = cases::ball(30_000, 7, false);
    for (i, position) in pile.position.iter_mut().enumerate() {
        *position *= 0.02;
        pile.colour[i] = glam::Vec3::splat(i as f32 / 30_000.0);
    }
    pile.axis_u.iter_mut().for_each(|axis| *axis *= 16.0);
    pile.axis_v.iter_mut().for_each(|axis| *axis *= 16.0);
    let mut object = cases::object(pile, glam::DVec3::new(0.0, 0.0, -4.0));
    object.motions = vec![crate::scene::Motion::Linear { velocity: 0.3 * glam::DVec3::X }];
    object.shape.surface_mut().unwrap().two_sided = true;
    case.scene = cases::scene(vec![object], [24, 24]);
    let (got, want) = (render(&mut gpu, &case), render(&mut Cpu::default(), &case));
    let (got, want) = (values(&got.picture), values(&want.picture));
    let worst = got.iter().zip(&want).filter(|(g, w)| g != w).map(|(g, w)| (g - w).abs()).fold(0.0, f32::max);
    eprintln!("worst {worst:.1e}");
    let covered = want.iter().filter(|&&value| value > 0.0 && value < 1.0).count();
    assert!(worst < 1e-5 && covered > 100, "worst {worst}, {covered} values in between");
}

static OF_PUBLISHED: [Mutant; 25] = [
    ([("apply(segment.motion, position)", "-apply(segment.motion, position)")], "chord"),
    ([("(v.x * m.y - v.y * m.x) * over_both", "(v.x * m.y + v.y * m.x) * over_both")], "chord"),
    ([("max(begin.y, end.y)", "begin.y")], "chord"),
    ([("min(across.y, columns.y)", "across.y")], "chord"),
    ([("form(cross(motion, u) * over)", "form(cross(u, motion) * over)")], "hard line"),
    ([("SPLATS * slot + BOUNDS_PART", "SPLATS * slot")], "chord"),
    ([("vec2<u32>(column, row)) + view.corner", "vec2<u32>(column, row))")], "chord"),
    ([("pixel - view.map_corner", "pixel")], "chord"),
    ([("let y = a * a - 1.0", "let y = a * b - 1.0")], "line"),
    ([("0.00005102865", "0.00006102865")], "line"),
    ([("cross * cross + e", "e")], "chord"),
    ([("below(span.y) & ~below(span.x)", "below(span.y)")], "chord"),
    ([("depth - m[2] * tau", "depth")], "chord"),
    ([("1.0 + view.slope * tau", "1.0")], "chord"),
    ([("f32(part + 1u) * step", "f32(part) * step")], "near line"),
    ([("coverage_mask[at + TILE_PIXELS] & ~surface", "coverage_mask[at + TILE_PIXELS]")], "chord"),
    ([("max(span.x, limits.x), min(span.y, limits.y)", "span.x, span.y")], "near line"),
    ([("covers + min(loose, reached)", "covers + reached")], "chord"),
    ([("select(HIDDEN, 1.0, shown)", "1.0")], "chord"),
    ([("(view.near - p.z) / (q.z - p.z)", "(view.near - q.z) / (q.z - p.z)")], "hard line"),
    ([("let normal = sqrt(normal_x * normal_x", "let normal = sqrt(0.0 * normal_x")], "line"),
    ([("i[2] - i[0] * offset.x", "i[2] + i[0] * offset.x")], "line"),
    ([("let ray_x = (x + offset.x)", "let ray_x = (x - offset.x)")], "line"),
    ([("(LINE_PEAK * (span.y - span.x)) * slant", "(ELLIPSOID_PEAK * (span.y - span.x)) * slant")], "near line"),
    ([("slant = slant_of(splat, x, y, w)", "slant = 1.0")], "hard line"),
];

static OF_OWN: [Mutant; 35] = [
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
    ([("min(map[nearest_place], depth)", "map[nearest_place]")], "walls"),
    ([("kernel.span.x < middle && middle < kernel.span.y", "kernel.span.x < middle")], "fast"),
    ([("begin + 0.5 * step", "begin")], "fast"),
    ([("kernel.plane.x + middle * kernel.plane.y", "kernel.plane.x")], "fast"),
    ([("map[slices.thresholds + slice * TILE_PIXELS]", "map[slices.thresholds]")], "fast"),
    ([("1.0 - (1.0 - large) * (1.0 - large)", "large")], "fast"),
];
