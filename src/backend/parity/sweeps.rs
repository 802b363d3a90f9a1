//! Published kernels in motion: parity with the CPU, pass by pass and slot by slot. Each pass is fed the CPU's results
//! of the passes before it. Also: broken programs, small buffers and whole images.

use super::cases::{self, Case};
use super::compare::{Tally, compare, flat};
use super::gpu_or_skip;
use super::harness::{Harness, NONE, PIXELS, Pass, tiles};
use super::mutants::{Mutant, all_are_noticed, named};
use super::posed::{Context, whole};
use super::slots::Slots;
use super::sweep_twins::{MapTwins, PublishedTwins, SweptSums};
use crate::backend::Backend;
use crate::backend::cpu::Cpu;
use crate::backend::cpu::published::{Map, MapGroup, PublishedSweepGroup};
use crate::backend::gpu::Gpu;
use crate::backend::gpu::layout::TILE;
use crate::backend::gpu::slots::Slot;
use crate::film::Picture;
use crate::plan::{MapPass, Published, PublishedSweepPass, Step};
use crate::renderer::{Rendered, render_checked};
use crate::time::FrameNumber;

/// All passes of the first group of a case; the first that differs.
#[allow(clippy::too_many_lines, reason = "one pass after the other, each fed by the one before")]
fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
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
    compare("thresholds", &got, &flat(&thresholds), |_| 1.0).map_err(failed(pass))?;

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
    compare("map", &some(&got), &some(&flat(&stored)), |_| 1.0).map_err(failed(pass))?;

    let map: Map = map_twins.map(&stored, around.tiles[0] as usize);
    let group = PublishedSweepGroup { scope: scope(band), interval: &interval, kernel, map: &map };
    let twins = PublishedTwins { group, edge };
    let kernels = twins.sweep();
    let slots = Slots::new(&harness, &on_band, &kernels);
    harness.run(Pass::MakeKernels);
    slots.compare_splats(&harness).map_err(failed(Pass::MakeKernels))?;
    slots.compare_lists(&harness).map_err(failed(Pass::MakeKernels))?;

    slots.feed_splats(&harness);
    slots.feed_lists(&harness);
    let fed: Vec<f32> = stored.iter().flatten().map(|v| v.min(NONE)).collect();
    harness.write(&harness.gpu.state.buffers[Slot::Map], &fed);
    let sums: Vec<_> = on_band.iter().map(|&tile| twins.attribute(&kernels, tile)).collect();
    let pass = Pass::PublishedSweep(PublishedSweepPass::Attribute);
    harness.run(pass);
    compare_sums(&harness, &sums).map_err(failed(pass))?;

    let buffers = &harness.gpu.state.buffers;
    harness.write(&buffers[Slot::Sums], &sums.iter().flat_map(|sums| flat(&sums.channels)).collect::<Vec<_>>());
    harness.write(&buffers[Slot::CoverageMask], &sums.iter().flat_map(mask_planes).flatten().collect::<Vec<u32>>());
    let pass = Pass::PublishedSweep(PublishedSweepPass::Resolve);
    harness.run(pass);
    let want: Vec<_> = on_band.iter().zip(&sums).flat_map(|(&tile, sums)| twins.resolve(tile, sums)).collect();
    let got: Vec<f32> = harness.read(&harness.gpu.state.buffers[Slot::Film], want.len() * PIXELS);
    compare("film", &got, &flat(&want), |_| 1.0).map_err(failed(pass))
}

/// The cases of published kernels.
fn published() -> Vec<Case> {
    let is_published = |case: &Case| case.kernel().is_published();
    cases::swept().into_iter().filter(is_published).collect()
}

/// The planes of a tile's coverage mask.
pub(super) fn mask_planes(sums: &SweptSums) -> Vec<Vec<u32>> {
    let bits = |plane: &Vec<f32>| plane.iter().map(|v| v.to_bits()).collect();
    sums.times.iter().cloned().chain(sums.weights.iter().map(bits)).collect()
}

pub(super) fn compare_sums(harness: &Harness<'_>, want: &[SweptSums]) -> Result<(), String> {
    let buffers = &harness.gpu.state.buffers;
    let channels = harness.prepared.channels.count;
    let got: Vec<f32> = harness.read(&buffers[Slot::Sums], want.len() * channels * PIXELS);
    let values: Vec<f32> = want.iter().flat_map(|sums| flat(&sums.channels)).collect();
    // A sum's rounding goes with the sum of the weights.
    let weight = |i: usize| want[i / (channels * PIXELS)].channels[0][i % PIXELS];
    compare("sums", &got, &values, weight)?;
    let bits: Vec<u32> = want.iter().flat_map(mask_planes).flatten().collect();
    let masks = bits.len() / (want.len() * PIXELS);
    let got: Vec<u32> = harness.read(&buffers[Slot::CoverageMask], bits.len());
    let (mut times, mut loose) = (Tally::default(), Tally::default());
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

#[test]
fn swept_passes_agree() {
    let Some(mut gpu) = gpu_or_skip("swept_passes_agree") else { return };
    for case in published() {
        eprintln!("{}:", case.name);
        check(&mut gpu, &case).unwrap_or_else(|what| panic!("{what}"));
    }
}

static MUTANTS: [Mutant; 25] = [
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

#[test]
#[ignore = "deep: broken programs"]
fn broken_swept_programs_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_swept_programs_are_noticed") else { return };
    let cases = published();
    all_are_noticed(&mut gpu, &MUTANTS, |gpu, name| check(gpu, named(&cases, name)));
}

pub(super) fn values(picture: &Picture) -> Vec<f32> {
    let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(layers).copied().collect()
}

/// Whole images. On the software device pixels differ by rounding alone, except where a rounded value decides.
#[test]
#[ignore = "deep: whole pictures"]
fn swept_images_look_the_same() {
    let Some(mut gpu) = gpu_or_skip("swept_images_look_the_same") else { return };
    for case in cases::swept() {
        let render = |gpu: bool, device: &mut Gpu| {
            let mut cpu = Cpu::default();
            let rendered = if gpu {
                render_checked(device, &case.scene, FrameNumber::from(0), &case.options)
            } else {
                render_checked(&mut cpu, &case.scene, FrameNumber::from(0), &case.options)
            };
            rendered.unwrap_or_else(|e| panic!("{e}")).picture
        };
        let (got, want) = (render(true, &mut gpu), render(false, &mut gpu));
        let (got, want) = (values(&got), values(&want));
        let scale = want.iter().copied().filter(|v| v.is_finite()).fold(1.0_f32, |a, b| a.max(b.abs()));
        let difference = |(g, w): (&f32, &f32)| if g == w { 0.0 } else { (g - w).abs() / scale };
        let differences: Vec<f32> = got.iter().zip(&want).map(difference).collect();
        let worst = differences.iter().copied().fold(0.0, f32::max);
        let differing = differences.iter().filter(|&&d| d >= 1e-4 || d.is_nan()).count();
        let covered = want.iter().filter(|&&v| v != 0.0 && v.is_finite()).count();
        eprintln!("{}: worst {worst:.1e}, {differing} of {} values differ, {covered} not 0", case.name, want.len());
        assert!(differing as f64 <= 1e-3 * want.len() as f64, "{}: {differing} values differ", case.name);
        assert!(covered > 0, "{}: nothing to compare", case.name);
    }
}

#[test]
#[ignore = "deep: small buffers"]
fn small_buffers_change_no_swept_image() {
    let Some(mut roomy) = gpu_or_skip("small_buffers_change_no_swept_image") else { return };
    same_with_small_buffers(&mut roomy, &cases::swept());
}

fn rendered(backend: &mut dyn Backend, case: &Case) -> Rendered {
    let rendered = render_checked(backend, &case.scene, FrameNumber::from(0), &case.options);
    rendered.unwrap_or_else(|e| panic!("{}: {e}", case.name))
}

/// Loops that end early: lists are walked over in stretches.
#[test]
fn lists_in_stretches_change_no_swept_image() {
    let Some(mut roomy) = gpu_or_skip("lists_in_stretches_change_no_swept_image") else { return };
    let dispatches = |rendered: &Rendered| rendered.stats.gpu.unwrap().dispatches;
    let mut short = roomy.beside();
    short.most_turns = 150;
    let own = cases::swept().into_iter().filter(|case| !case.kernel().is_published());
    for case in &own.take(4).chain(published().into_iter().take(2)).collect::<Vec<_>>() {
        let (got, want) = (rendered(&mut short, case), rendered(&mut roomy, case));
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
    let (got, want) = (rendered(&mut gpu, &case), rendered(&mut Cpu::default(), &case));
    let (got, want) = (values(&got.picture), values(&want.picture));
    let worst = got.iter().zip(&want).filter(|(g, w)| g != w).map(|(g, w)| (g - w).abs()).fold(0.0, f32::max);
    eprintln!("worst {worst:.1e}");
    let covered = want.iter().filter(|&&value| value > 0.0 && value < 1.0).count();
    assert!(worst < 1e-5 && covered > 100, "worst {worst}, {covered} values in between");
}

/// The pictures of cases, which buffers that are too small do not change.
pub(super) fn same_with_small_buffers(roomy: &mut Gpu, cases: &[Case]) -> Vec<Picture> {
    let picture = |gpu: &mut Gpu, case: &Case| {
        render_checked(gpu, &case.scene, FrameNumber::from(0), &case.options).unwrap_or_else(|e| panic!("{e}")).picture
    };
    let pictures: Vec<Picture> = cases.iter().map(|case| picture(roomy, case)).collect();
    let (mut batches, mut bands) = (roomy.beside(), roomy.beside());
    (batches.most_slots, bands.most_bytes) = (100, 256 << 10);
    // Each takes seconds, so the two kinds of small buffers take turns.
    for (number, (case, want)) in cases.iter().zip(&pictures).enumerate() {
        if number % 2 == 0 {
            assert_eq!(&picture(&mut batches, case), want, "{}: batches of 100", case.name);
        } else {
            assert_eq!(&picture(&mut bands, case), want, "{}: small bindings", case.name);
        }
    }
    pictures
}
