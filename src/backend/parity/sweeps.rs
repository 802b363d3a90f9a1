//! Kernels in motion: parity with the CPU, pass by pass and slot by slot. Each pass is fed the CPU's results of the
//! passes before it. Also: broken programs, small buffers and whole images.

use super::cases::{self, Case};
use super::compare::{Tally, compare, flat};
use super::gpu_or_skip;
use super::harness::{Harness, NONE, PIXELS, Pass, tiles};
use super::mutants::{Mutant, all_are_noticed, named};
use super::slots::Slots;
use super::splat_twins::{Context, Posed, SplatTwins, project, whole};
use super::sweep_twins::{MapTwins, SweepTwins, SweptSums};
use crate::backend::cpu::Cpu;
use crate::backend::cpu::swept::map::Map;
use crate::backend::cpu::swept::{MapGroup, SweepGroup};
use crate::backend::gpu::Gpu;
use crate::backend::gpu::layout::TILE;
use crate::film::Picture;
use crate::layout::{Splat, SweptSplat};
use crate::plan::{MapPass, Objects, Step, SweepPass};
use crate::renderer::render_checked;
use crate::time::FrameNumber;

/// Spoils what passes write.
pub(super) fn spoil(harness: &Harness<'_>) {
    let buffers = &harness.gpu.state.buffers;
    let mut encoder = harness.gpu.state.encoder();
    let spoilt = [&buffers.splats, &buffers.touched, &buffers.starts, &buffers.thresholds, &buffers.sums, &buffers.map];
    for buffer in spoilt.into_iter().chain([&buffers.coverage_mask, &buffers.film]) {
        encoder.clear_buffer(buffer, 0, None);
    }
    harness.gpu.state.device.queue.submit([encoder.finish()]);
}

/// The static objects of a tile: their thresholds, and their film plane by plane.
type StaticPicture = (Vec<f32>, Vec<Vec<f32>>);

/// The picture of static objects, on both backends: tile by tile as the CPU has it.
fn check_static(
    harness: &mut Harness<'_>,
    context: &Context,
    tiles: &[[usize; 2]],
    map_tiles: usize,
) -> Result<Vec<StaticPicture>, String> {
    let frame = harness.frame;
    if !frame.has_static_picture() {
        return Ok(vec![(vec![f32::INFINITY; PIXELS], Vec::new()); tiles.len()]);
    }
    let position = &frame.rasters[0].positions[0];
    let mut group = position.groups[0].clone();
    group.samples[0].weight = 1.0;
    let scope = context.scope(frame, position, &group, whole(position));
    let twins = SplatTwins { scope, ..harness.twins };
    let posed = project(&scope, Objects::Static);
    let of_tile = |&tile: &[usize; 2]| {
        let thresholds = twins.visibility(&posed, tile);
        let mut film = twins.resolve(tile, &thresholds, &twins.attribute(&posed, tile, &thresholds));
        film.resize(harness.prepared.planes.count, vec![0.0; PIXELS]);
        (thresholds, film)
    };
    let want: Vec<StaticPicture> = tiles.iter().map(of_tile).collect();
    harness.static_picture();
    let buffers = &harness.gpu.state.buffers;
    let map: Vec<f32> = harness.read(&buffers.map, (2 * map_tiles + tiles.len()) * PIXELS);
    let thresholds: Vec<f32> = want.iter().flat_map(|(thresholds, _)| thresholds.clone()).collect();
    compare("thresholds of static objects", &map[2 * map_tiles * PIXELS..], &thresholds, |_| 1.0)?;
    let planes: Vec<f32> = want.iter().flat_map(|(_, planes)| flat(planes)).collect();
    let film: Vec<f32> = harness.read(&buffers.static_film, planes.len());
    compare("picture of static objects", &film, &planes, |_| 1.0)?;
    // Both backends go on from the same.
    harness.write(&buffers.static_film, &planes);
    Ok(want)
}

/// The splats of an object. An interval has one sample.
fn splats_of_object<S>(all: &[Posed<S>], object: usize) -> &[S] {
    &all.iter().find(|posed| posed.chunk.object == object).unwrap().splats
}

/// All passes of the first group of a case; the first that differs.
#[allow(clippy::too_many_lines, reason = "one pass after the other, each fed by the one before")]
fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let frame = case.frame();
    let context = Context::of(&frame);
    let Some(mut harness) = Harness::new(gpu, &frame, &context) else { return Ok(()) };
    let (interval, kernel, objects) = frame
        .steps()
        .find_map(|step| match *step {
            Step::Sweep { interval, kernel, objects, .. } => Some((interval, kernel, objects)),
            _ => None,
        })
        .unwrap();
    let density = frame.steps().any(|step| matches!(step, Step::VisibilityMap { density: true, .. }));
    let position = &frame.rasters[0].positions[0];
    let (edge, band) = (TILE as usize, whole(position));
    let scope = |band| context.scope(&frame, position, &position.groups[0], band);
    let map_twins = MapTwins { group: MapGroup { scope: scope(band.guarded(interval.guard)) }, edge };
    let raster = harness.prepared.schedule.rasters[0];
    let around = raster.area(harness.prepared.schedule.bands(0).next().unwrap()).guarded(interval.guard);
    let (on_map, on_band) = (tiles(around.tiles), tiles(raster.tiles));
    let failed = |pass: Pass| move |what: String| format!("{}: {pass:?}: {what}", case.name);

    let splats = map_twins.project(objects);
    let splats_of = |_: &_, object| splats_of_object(&splats, object);
    let with_segment = |splat: &Splat, segment| Splat { flags: splat.flags | segment << 1, ..*splat };
    let slots = Slots::new(&harness.batch, &on_map, splats_of, with_segment, |_| true);
    spoil(&harness);
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
    let got: Vec<f32> = harness.read(&harness.gpu.state.buffers.thresholds, count);
    compare("thresholds", &got, &flat(&thresholds), |_| 1.0).map_err(failed(pass))?;

    let finite: Vec<f32> = thresholds.iter().flatten().map(|t| t.min(NONE)).collect();
    harness.write(&harness.gpu.state.buffers.thresholds, &finite);
    let mut densities = vec![Vec::new(); on_map.len()];
    if density {
        densities = on_map.iter().zip(&thresholds).map(|(&tile, t)| map_twins.density(&splats, tile, t)).collect();
        let pass = Pass::Map(MapPass::Density);
        harness.run(pass);
        let got: Vec<f32> = harness.read(&harness.gpu.state.buffers.sums, count);
        compare("density", &got, &flat(&densities), |_| 1.0).map_err(failed(pass))?;
        harness.write(&harness.gpu.state.buffers.sums, &flat(&densities));
    }
    let stored: Vec<_> = on_map
        .iter()
        .zip(thresholds.iter().zip(&densities))
        .map(|(&tile, (t, d))| map_twins.store(tile, t, d))
        .collect();
    let pass = Pass::Map(MapPass::Store);
    harness.run(pass);
    let got: Vec<[f32; 2]> = harness.read(&harness.gpu.state.buffers.map, count);
    // Beyond the guard band the CPU stores nothing; no sources are there.
    let [width, height] = around.pixels.size();
    let inside = |i: usize| {
        let (tile, pixel) = (on_map[i / PIXELS], i % PIXELS);
        tile[0] * edge + pixel % edge < width as usize && tile[1] * edge + pixel / edge < height as usize
    };
    let some = |values: &[[f32; 2]]| -> Vec<f32> {
        values.iter().enumerate().filter(|(i, _)| inside(*i)).flat_map(|(_, value)| *value).collect()
    };
    compare("map", &some(&got), &some(&flat(&stored)), |_| 1.0).map_err(failed(pass))?;

    let map: Map = map_twins.map(&stored, around.tiles[0] as usize);
    let group = SweepGroup { scope: scope(band), interval: &interval, kernel, map: &map, picture: &[] };
    let twins = SweepTwins { group, edge };
    let kernels = twins.sweep(objects);
    let kernels_of = |_: &_, object| splats_of_object(&kernels, object);
    let with_segment = |kernel: &SweptSplat, segment| SweptSplat { flags: kernel.flags | segment << 3, ..*kernel };
    let slots = Slots::new(&harness.batch, &on_band, kernels_of, with_segment, |_| true);
    harness.run(Pass::MakeKernels);
    slots.compare_splats(&harness).map_err(failed(Pass::MakeKernels))?;
    slots.compare_lists(&harness).map_err(failed(Pass::MakeKernels))?;

    let picture = check_static(&mut harness, &context, &on_band, on_map.len())
        .map_err(|what| format!("{}: {what}", case.name))?;
    slots.feed_splats(&harness);
    slots.feed_lists(&harness);
    let behind = picture.iter().filter(|(_, film)| !film.is_empty()).flat_map(|(before, _)| before);
    let mut fed: Vec<f32> = flat(&stored).as_flattened().iter().chain(behind).map(|v| v.min(NONE)).collect();
    harness.write(&harness.gpu.state.buffers.map, &fed);
    let of_tile = |(&tile, (before, _)): (_, &StaticPicture)| twins.visibility(&kernels, tile, before);
    let slices: Vec<_> = on_band.iter().zip(&picture).map(of_tile).collect();
    if kernel.has_slices() {
        let pass = Pass::Sweep(SweepPass::Visibility);
        harness.run(pass);
        let want: Vec<f32> = slices.iter().flat_map(|slices| flat(slices)).collect();
        let got: Vec<f32> = harness.read(&harness.gpu.state.buffers.map, fed.len() + want.len());
        compare("thresholds of slices", &got[fed.len()..], &want, |_| 1.0).map_err(failed(pass))?;
        fed.extend(want.iter().map(|v| v.min(NONE)));
    }
    let of_tile = |((&tile, (before, _)), slices): ((_, &StaticPicture), &Vec<Vec<f32>>)| {
        twins.attribute(&kernels, &[], tile, before, slices)
    };
    let sums: Vec<_> = on_band.iter().zip(&picture).zip(&slices).map(of_tile).collect();
    harness.write(&harness.gpu.state.buffers.map, &fed);
    harness.run(Pass::Sweep(SweepPass::Attribute));
    compare_sums(&harness, &sums).map_err(failed(Pass::Sweep(SweepPass::Attribute)))?;

    let buffers = &harness.gpu.state.buffers;
    harness.write(&buffers.sums, &sums.iter().flat_map(|sums| flat(&sums.channels)).collect::<Vec<_>>());
    harness.write(&buffers.coverage_mask, &sums.iter().flat_map(mask_planes).flatten().collect::<Vec<u32>>());
    harness.run(Pass::Sweep(SweepPass::Resolve));
    let of_tile = |((&tile, sums), (_, film)): ((_, _), &StaticPicture)| twins.resolve(tile, sums, film);
    let want: Vec<_> = on_band.iter().zip(&sums).zip(&picture).flat_map(of_tile).collect();
    let got: Vec<f32> = harness.read(&harness.gpu.state.buffers.film, want.len() * PIXELS);
    compare("film", &got, &flat(&want), |_| 1.0).map_err(failed(Pass::Sweep(SweepPass::Resolve)))
}

/// The planes of a tile's coverage mask.
pub(super) fn mask_planes(sums: &SweptSums) -> Vec<Vec<u32>> {
    let bits = |plane: &Vec<f32>| plane.iter().map(|v| v.to_bits()).collect();
    let floats = [&sums.loose, &sums.peak, &sums.side].into_iter().filter(|plane| !plane.is_empty()).map(bits);
    [sums.surface.clone(), sums.low_pass.clone()].into_iter().chain(floats).collect()
}

pub(super) fn compare_sums(harness: &Harness<'_>, want: &[SweptSums]) -> Result<(), String> {
    let buffers = &harness.gpu.state.buffers;
    let channels = harness.prepared.channels.count;
    let got: Vec<f32> = harness.read(&buffers.sums, want.len() * channels * PIXELS);
    let values: Vec<f32> = want.iter().flat_map(|sums| flat(&sums.channels)).collect();
    // A sum's rounding goes with the sum of the weights.
    let weight = |i: usize| want[i / (channels * PIXELS)].channels[0][i % PIXELS];
    compare("sums", &got, &values, weight)?;
    let bits: Vec<u32> = want.iter().flat_map(mask_planes).flatten().collect();
    let masks = bits.len() / (want.len() * PIXELS);
    let got: Vec<u32> = harness.read(&buffers.coverage_mask, bits.len());
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
    for case in cases::swept() {
        eprintln!("{}:", case.name);
        check(&mut gpu, &case).unwrap_or_else(|what| panic!("{what}"));
    }
}

static MUTANTS: [Mutant; 38] = [
    ([("apply(travels[segment.index].motion, position)", "-apply(travels[segment.index].motion, position)")], "tube"),
    ([("(v.x * m.y - v.y * m.x) * over_both", "(v.x * m.y + v.y * m.x) * over_both")], "tube"),
    ([("max(begin.y, end.y)", "begin.y")], "fast"),
    ([("min(across.y, columns.y)", "across.y")], "ellipsoid"),
    ([("form(cross(motion, u) * over)", "form(cross(u, motion) * over)")], "hard"),
    ([("SPLATS * slot + PART", "SPLATS * slot")], "tube"),
    ([("vec2<u32>(column, row)) + view.corner", "vec2<u32>(column, row))")], "tube"),
    ([("1.0 / sums[at], sums[at] > 0.0", "1.0, sums[at] > 0.0")], "tube"),
    ([("pixel - view.map_corner", "pixel")], "fast"),
    ([("let y = a * a - 1.0", "let y = a * b - 1.0")], "tube"),
    ([("0.00005102865", "0.00006102865")], "fast"),
    ([("cross * cross + e", "e")], "tube"),
    ([("below(span.y) & ~below(span.x)", "below(span.y)")], "fast"),
    ([("depth - m[2] * tau", "depth")], "chord"),
    ([("1.0 + view.slope * tau", "1.0")], "fast"),
    ([("min(weight * known.y, met.most)", "weight * known.y")], "fast"),
    ([("f32(part + 1u) * step", "f32(part) * step")], "parts"),
    ([("coverage_mask[at + TILE_PIXELS] & ~surface", "coverage_mask[at + TILE_PIXELS]")], "fast"),
    ([("max(span.x, limits.x), min(span.y, limits.y)", "span.x, span.y")], "near"),
    ([("covers + min(loose, reached)", "covers + reached")], "fast"),
    ([("met.depth > before", "met.depth < before")], "tube"),
    ([("return 2u * view.map_tiles.x", "return 2u * view.map_tiles.y")], "tube"),
    ([("depth + max(epsilon,", "depth + max(0.0,")], "tube"),
    ([("span.x < middle && middle < span.y", "span.x < middle")], "fast"),
    ([("begin + 0.5 * step", "begin")], "fast"),
    ([("plane.x + middle * plane.y", "plane.x")], "fast"),
    ([("depth <= behind(slices + slice * TILE_PIXELS)", "depth <= behind(slices)")], "fast"),
    ([("weight *= shown.part", "weight *= 1.0")], "fast"),
    ([("of_slice << (slice * bits)", "of_slice")], "fast"),
    ([("(view.near - p.z) / (q.z - p.z)", "(view.near - q.z) / (q.z - p.z)")], "hard"),
    ([("let normal = sqrt(normal_x * normal_x", "let normal = sqrt(0.0 * normal_x")], "line"),
    ([("i[2] - i[0] * offset.x", "i[2] + i[0] * offset.x")], "line"),
    ([("let ray_x = (x + offset.x)", "let ray_x = (x - offset.x)")], "line"),
    ([("(LINE_PEAK * (span.y - span.x)) * slant", "(ELLIPSOID_PEAK * (span.y - span.x)) * slant")], "near line"),
    ([("slant = slant_of(splat, x, y, w)", "slant = 1.0")], "hard line"),
    ([("&& FOOTPRINT != LINE", "")], "line"),
    ([("view.weight - covered", "view.weight")], "tube"),
    ([("left * static_film[at + 3u * TILE_PIXELS]", "left")], "once"),
];

#[test]
fn broken_swept_programs_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_swept_programs_are_noticed") else { return };
    let cases = cases::swept();
    all_are_noticed(&mut gpu, &MUTANTS, |gpu, name| check(gpu, named(&cases, name)));
}

pub(super) fn values(picture: &Picture) -> Vec<f32> {
    let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(layers).copied().collect()
}

/// Whole images. On the software device pixels differ by rounding alone, except where a rounded value decides.
#[test]
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
fn small_buffers_change_no_swept_image() {
    let Some(mut roomy) = gpu_or_skip("small_buffers_change_no_swept_image") else { return };
    same_with_small_buffers(&mut roomy, &cases::swept());
}

/// The pictures of cases, which buffers that are too small do not change.
pub(super) fn same_with_small_buffers(roomy: &mut Gpu, cases: &[Case]) -> Vec<Picture> {
    let picture = |gpu: &mut Gpu, case: &Case| {
        render_checked(gpu, &case.scene, FrameNumber::from(0), &case.options).unwrap_or_else(|e| panic!("{e}")).picture
    };
    let pictures: Vec<Picture> = cases.iter().map(|case| picture(roomy, case)).collect();
    let (mut batches, mut bands) = (roomy.beside(), roomy.beside());
    (batches.most_slots, bands.most_bytes) = (100, 256 << 10);
    for (case, want) in cases.iter().zip(&pictures) {
        assert_eq!(&picture(&mut batches, case), want, "{}: batches of 100", case.name);
        assert_eq!(&picture(&mut bands, case), want, "{}: small bindings", case.name);
    }
    pictures
}
