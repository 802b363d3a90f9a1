//! Full EWA: parity with the CPU, pass by pass and slot by slot. Each pass is fed the CPU's results of the passes
//! before it. Also: broken programs, small buffers and whole images.

use super::cases::{self, Case};
use super::compare::{Tally, flat};
use super::ewa_twins::{EwaTile, EwaTwins};
use super::gpu_or_skip;
use super::harness::{Harness, NONE, PIXELS, Pass, UNWANTED, tiles};
use super::mutants::{Mutant, all_are_noticed, named};
use super::slots::Slots;
use super::splat_twins::{Context, whole};
use super::sweeps::{same_with_small_buffers, values};
use crate::backend::cpu::Cpu;
use crate::backend::cpu::paint::PaintGroup;
use crate::backend::cpu::paint::buffers::DepthLayer;
use crate::backend::gpu::Gpu;
use crate::backend::gpu::lanes::Lanes;
use crate::backend::gpu::layout::{Segment, TILE};
use crate::backend::gpu::slots::Slot;
use crate::frame::Frame;
use crate::layout::{EwaSplat, Splat};
use crate::options::{PixelFilter, Prefilter};
use crate::plan::PaintPass;
use crate::renderer::render_checked;
use crate::scene::Object;
use crate::time::FrameNumber;

/// The cases of splats, with filtered kernels; and a surface of kernels below a pixel whose every pixel bends.
fn all() -> Vec<Case> {
    let mut all = cases::all();
    let mut fine = cases::all().swap_remove(0);
    fine.name = "fine";
    fine.scene.objects = vec![Object::new(cases::ball(6000, 5, false))];
    (fine.options.look.filter, fine.options.look.epsilon) = (PixelFilter::Point, Some(0.0));
    all.push(fine);
    for case in &mut all {
        case.options.prefilter = Prefilter::Ewa;
    }
    all
}

/// The frame of a case. `sigma`: that of a wider filter than options give.
fn frame_of(case: &Case, sigma: Option<f32>) -> Frame {
    let mut frame = case.frame();
    for position in frame.rasters.iter_mut().flat_map(|raster| &mut raster.positions) {
        position.raster.sigma = sigma.unwrap_or(position.raster.sigma);
    }
    frame
}

/// The group on both backends.
struct Both<'a> {
    harness: Harness<'a>,
    twins: EwaTwins<'a>,
    tiles: Vec<[usize; 2]>,
    /// What the CPU has of the tiles; `None` where one is not wanted.
    host: Vec<Option<EwaTile>>,
    apron: usize,
}

impl Both<'_> {
    /// Pixels before a tile's first in a row and in a column, and pixels of both, as the device has them.
    fn guarded(&self) -> ([usize; 2], [usize; 2]) {
        let before = [self.apron.next_multiple_of(4), self.apron];
        (before, before.map(|pixels| TILE as usize + 2 * pixels))
    }

    /// Floats of a tile's depths.
    fn depth_floats(&self) -> usize {
        let (_, [width, height]) = self.guarded();
        width * height + 2 * PIXELS
    }

    /// Depths of all tiles as the device has them; NaN where nobody may read them.
    fn depths(&self) -> Vec<f32> {
        let of_tile = |(&tile, host): (&[usize; 2], &Option<EwaTile>)| {
            let Some(host) = host else { return vec![UNWANTED; self.depth_floats()] };
            let (before, size) = self.guarded();
            let thresholds = self.twins.thresholds(host, tile, before, size).into_iter();
            let mut depths: Vec<f32> = thresholds.map(|t| t.map_or(f32::NAN, |t| t.min(NONE))).collect();
            let inside = self.twins.inside(tile);
            let in_image = |(value, inside): (f32, &bool)| if *inside { value } else { f32::NAN };
            let second = self.twins.second(host).into_iter().map(|t| t.map_or(UNWANTED, |t| t.min(NONE)));
            depths.extend(second.zip(&inside).map(in_image));
            let rim = self.twins.rim(host).into_iter().map(|rim| f32::from(u8::from(rim)));
            depths.extend(rim.zip(&inside).map(in_image));
            depths
        };
        let nearest = |(&tile, host): (&[usize; 2], &Option<EwaTile>)| match host {
            Some(host) => self.twins.nearest(host, tile).into_iter().map(|t| t.min(NONE)).collect(),
            None => vec![f32::NAN; PIXELS],
        };
        let mut depths: Vec<f32> = self.tiles.iter().zip(&self.host).flat_map(of_tile).collect();
        if self.harness.frame.keeps_nearest {
            depths.extend(self.tiles.iter().zip(&self.host).flat_map(nearest));
        }
        depths
    }

    /// Against the depths on the device; `seconds`: those behind T and the rim, else all others.
    fn compare_depths(&self, seconds: bool) -> Result<(), String> {
        let want = self.depths();
        let got: Vec<f32> = self.harness.read(&self.harness.gpu.state.buffers[Slot::Thresholds], want.len());
        let floats = self.depth_floats();
        let mut tally = Tally::default();
        for (i, (got, want)) in got.iter().zip(&want).enumerate() {
            // The nearest depths are behind those of all tiles.
            let is_second = i < self.tiles.len() * floats && i % floats >= floats - 2 * PIXELS;
            if want.is_nan() || is_second != seconds {
                continue;
            }
            // Which pixels are solid is decided, and not rounded.
            let far = |t: f32| t.abs() == NONE;
            if far(*got) || far(*want) {
                tally.count += 1;
                if got != want {
                    tally.otherwise(|| format!("depth {i}: {got}, not {want}"));
                }
            } else {
                tally.floats(&[*got], &[*want], want.abs(), || format!("depth {i}"));
            }
        }
        tally.check("depths")
    }

    fn compare_sums(&self) -> Result<(), String> {
        let channels = self.harness.prepared.channels;
        let (layers, count) = (channels.layers, channels.count);
        let floats = layers * count * PIXELS;
        let got: Vec<f32> = self.harness.read(&self.harness.gpu.state.buffers[Slot::Sums], self.tiles.len() * floats);
        let mut tally = Tally::default();
        for ((got, host), tile) in got.chunks(floats).zip(&self.host).zip(&self.tiles) {
            let Some(host) = host else { continue };
            let second = self.twins.second(host);
            let inside = self.twins.inside(*tile);
            for (layer, planes) in self.twins.sums(host).iter().enumerate() {
                for (channel, plane) in planes.iter().enumerate() {
                    for pixel in 0..PIXELS {
                        // A solid pixel knows only its band, without what makes a coverage.
                        let is_band =
                            layer == DepthLayer::Band as usize && channels.peak.is_none_or(|peak| channel < peak);
                        if !inside[pixel] || layers > 1 && second[pixel].is_none() && !is_band {
                            continue;
                        }
                        // A sum's rounding goes with the sum of the weights.
                        let scale = planes[0][pixel].max(plane[pixel].abs());
                        let at = || format!("tile {tile:?}, pixel {pixel}, layer {layer}, channel {channel}");
                        let got = got[(layer * count + channel) * PIXELS + pixel];
                        tally.floats(&[got], &[plane[pixel]], scale, at);
                    }
                }
            }
        }
        tally.check("sums")
    }

    fn feed_sums(&self) {
        let none = EwaTile::default();
        let of_tile = |host: &Option<EwaTile>| match host {
            Some(host) => self.twins.sums(host),
            None => self.twins.sums(&none),
        };
        let sums: Vec<f32> = self.host.iter().flat_map(of_tile).flatten().flatten().collect();
        self.harness.write(&self.harness.gpu.state.buffers[Slot::Sums], &sums);
    }

    fn compare_film(&self) -> Result<(), String> {
        let none = EwaTile::default();
        let film = |host: &Option<EwaTile>| flat(&self.twins.film(host.as_ref().unwrap_or(&none)));
        let want: Vec<f32> = self.host.iter().flat_map(film).collect();
        super::compare::compare(
            "film",
            &self.harness.read(&self.harness.gpu.state.buffers[Slot::Film], want.len()),
            &want,
            |_| 1.0,
        )
    }
}

/// All passes of the first group of a case; the first that differs. Counts pixels: open, solid, with
/// each layer, open and not near a rim.
fn check(gpu: &mut Gpu, case: &Case, sigma: Option<f32>, counts: &mut [usize; 7]) -> Result<(), String> {
    let frame = frame_of(case, sigma);
    let context = Context::of(&frame);
    let Some(harness) = Harness::new(gpu, &frame, &context) else { return Ok(()) };
    let position = &frame.rasters[0].positions[0];
    let scope = context.scope(&frame, position, &position.groups[0], whole(position));
    let twins = EwaTwins { group: PaintGroup::new(scope), edge: TILE as usize };
    let tiles = tiles(harness.prepared.schedule.rasters[0].tiles);
    let posed = twins.project();
    let host = tiles.iter().map(|&tile| harness.wants(tile).then(|| twins.run(&posed, tile))).collect();
    let mut both = Both { harness, twins, tiles, host, apron: position.raster.apron() };
    let splats_of = |segment: &Segment, object: usize| {
        let sample = (segment.flags >> 3).saturating_sub(1) as usize;
        &posed.iter().find(|p| p.chunk.sample == sample && p.chunk.object == object).unwrap().splats[..]
    };
    let with_segment = |splat: &EwaSplat, segment| {
        let disc = Splat { flags: splat.disc.flags | segment << 1, ..splat.disc };
        EwaSplat { disc, ..*splat }
    };
    let slots = Slots::new(&both.harness.batch, &both.tiles, splats_of, with_segment, |tile| both.harness.wants(tile));
    let failed = |pass: Pass| move |what: String| format!("{}: {pass:?}: {what}", case.name);

    both.harness.spoil();
    both.harness.run(Pass::Filter);
    slots.compare_splats(&both.harness).map_err(failed(Pass::Filter))?;
    slots.compare_lists(&both.harness).map_err(failed(Pass::Filter))?;
    for &pass in PaintPass::order(both.harness.prepared.channels.is_layered()) {
        both.harness.spoil();
        slots.feed_splats(&both.harness);
        slots.feed_lists(&both.harness);
        if pass != PaintPass::Visibility {
            let depths: Vec<f32> = both.depths().iter().map(|t| if t.is_nan() { NONE } else { *t }).collect();
            both.harness.write(&both.harness.gpu.state.buffers[Slot::Thresholds], &depths);
        }
        if pass == PaintPass::Resolve {
            both.feed_sums();
        }
        both.harness.run(Pass::Ewa(pass));
        let compared = match pass {
            PaintPass::Visibility => both.compare_depths(false),
            PaintPass::Second => both.compare_depths(true),
            PaintPass::Attribute => both.compare_sums(),
            PaintPass::Resolve => both.compare_film(),
        };
        compared.map_err(failed(Pass::Ewa(pass)))?;
    }
    for host in both.host.iter().flatten() {
        let open = both.twins.second(host);
        counts[0] += open.iter().flatten().count();
        let closed = both.twins.rim(host).iter().zip(&open).filter(|(rim, second)| !**rim && second.is_some()).count();
        counts[6] += closed;
        counts[1] += open.iter().filter(|second| second.is_none()).count();
        for (layer, planes) in both.twins.sums(host).iter().enumerate() {
            counts[2 + layer] += planes[0].iter().filter(|&&weight| weight > 0.0).count();
        }
    }
    Ok(())
}

#[test]
fn ewa_passes_agree() {
    let Some(mut gpu) = gpu_or_skip("ewa_passes_agree") else { return };
    for lanes in Lanes::ALL {
        gpu.state.device.lanes = lanes;
        let mut counts = [0; 7];
        for case in all() {
            eprintln!("{}, by {lanes:?}:", case.name);
            check(&mut gpu, &case, None, &mut counts).unwrap_or_else(|what| panic!("by {lanes:?}: {what}"));
        }
        // An apron that takes more than one quad, and the tile more than one round.
        for case in all().iter().filter(|case| ["supersample", "in part"].contains(&case.name)) {
            eprintln!("{}, by {lanes:?}, wide filter:", case.name);
            check(&mut gpu, case, Some(3.3), &mut counts).unwrap_or_else(|what| panic!("by {lanes:?}: {what}"));
        }
        // The comparison is worth something only where there is something to compare.
        eprintln!("open, solid, front, band, second, rest, open and not near a rim: {counts:?}");
        assert!(counts.iter().all(|&count| count > 100), "{counts:?}");
    }
}

static MUTANTS: [Mutant; 50] = [
    // Pass `project`.
    (
        [("let wider = vec2<f32>(-margin, margin);\n    let columns", "let wider = vec2<f32>(0.0);\n    let columns")],
        "hard",
    ),
    ([("0.25 * (jux * juy + jvx * jvy)", "0.25 * (jux * juy - jvx * jvy)")], "supersample"),
    ([("variance * (xx + yy - variance)", "variance * (xx + yy)")], "supersample"),
    ([("vec3<f32>(yy * over, -xy * over", "vec3<f32>(yy * over, xy * over")], "supersample"),
    ([("(u.z * form_u + v.z * form_v) * inverse", "(u.z * form_u - v.z * form_v) * inverse")], "supersample"),
    ([("sqrt(area * area * over)", "sqrt(area * over)")], "supersample"),
    ([("(*splat).weight = peak * (factor", "(*splat).weight = (factor")], "supersample"),
    ([("factor + peak * (mean - factor)", "factor")], "supersample"),
    ([("let mean = geometry[(columns + 1u)", "let mean = geometry[columns")], "supersample"),
    ([("let reach = 2.0 * view.sigma", "let reach = view.sigma")], "supersample"),
    ([("(max(disc * disc + reach * reach, vec2<f32>(affine)))", "(disc * disc + reach * reach)")], "supersample"),
    ([("4.0 * yy)", "4.0 * xx)")], "supersample"),
    ([("let factor = geometry[columns", "let factor = geometry[6u")], "supersample"),
    ([("surfel.splat.centre_depth > 0.0 &&", "true &&")], "hard"),
    // Pass `visibility`.
    ([("vec2<i32>(-i32(reach))", "vec2<i32>(0)")], "supersample"),
    ([("column), depth, depth + tolerance", "column), depth, depth")], "supersample"),
    ([("i < guarded_quads(); i += INVOCATIONS", "i < guarded_quads(); i += 2u * INVOCATIONS")], "wide"),
    ([("k = first_wide; k < end_wide", "k = first_wide + 1u; k < end_wide")], "hard"),
    (
        [("thresholds[depths_of(index) + i] = Floats(UNWANTED)", "thresholds[depths_of(index) + i] = Floats(NONE)")],
        "in part",
    ),
    // Pass `second`.
    ([("threshold >= NONE", "threshold < NONE")], "supersample"),
    ([("select(inverse, OUTSIDE, outside)", "inverse")], "hard"),
    ([("inverse_depths[y * EDGE + x] == 0.0", "inverse_depths[y * EDGE + x] == 7.0")], "supersample"),
    ([("4.0 * reach * (middle * middle)", "0.4 * reach * (middle * middle)")], "supersample"),
    ([("bends(middle_at, down - distance, most)", "false")], "wide"),
    ([("reach = first - nearest", "reach = 2.0 * first")], "supersample"),
    ([("tolerance_at(first, view.epsilon)", "tolerance_at(first, 9.0)")], "hard"),
    ([("met.covers && met.depth > limit_of", "met.covers && met.depth < limit_of")], "supersample"),
    ([("k < starts[wide_at + 1u]; k", "k < starts[wide_at]; k")], "hard"),
    // Pass `attribute`.
    ([("splat.weight * kernel(", "kernel(")], "supersample"),
    ([("(over * over) + quarter", "over + quarter")], "supersample"),
    ([("splat.p[1], splat.p[2]", "splat.p[0], splat.p[2]")], "supersample"),
    ([("limit - 2.0 * tolerance", "limit - tolerance")], "supersample"),
    ([("min(first, nearest + tolerance)", "first")], "tolerances"),
    ([("u32(y) + u32(x), met.depth", "u32(y) + u32(x), met.depth + 0.1")], "tolerances"),
    ([("depth_quads() + index * TILE_QUADS", "depth_quads()")], "tolerances"),
    ([("limit_of(met.tolerance, least, nearest)", "least")], "tolerances"),
    ([("next = behind & (seen.depth <= pixels.second)", "next = behind")], "supersample"),
    ([("weight * peak_of(splat)", "weight")], "supersample"),
    (
        [("add_to_layer(front, slot, splat, seen, place.before)", "add_to_layer(front, slot, splat, seen, next)")],
        "supersample",
    ),
    ([("last & seen.disc)", "seen.disc)")], "supersample"),
    ([("seen.weight, Floats(1.0), seen.disc", "seen.weight, Floats(2.0), seen.disc")], "bucket"),
    // Pass `resolve`.
    ([("0.5 * (weight + abs(", "0.5 * (weight + (")], "supersample"),
    ([("min(coverage, left)", "coverage * left")], "supersample"),
    ([("if solid || layer == closing", "if layer == closing")], "supersample"),
    ([("if solid || layer == closing", "if solid")], "fine"),
    ([("> 0.0 { closing = layer; }", "> 0.0 { closing = 0u; }")], "supersample"),
    ([("1.0 - lost * lost", "1.0 - lost")], "supersample"),
    ([("rim[i] = select(0.0, 1.0, uncovered)", "rim[i] = 0.0")], "supersample"),
    ([("covered = second < NONE", "covered = true")], "supersample"),
    ([("Share(share, 1.0, layer == BAND)", "Share(share, 1.0, true)")], "supersample"),
];

/// What the programs that work by pixels have for themselves.
static BY_PIXELS: [Mutant; 3] = [
    ([("lane / PANEL_LANES;", "lane / PANEL_LANES + 1u;")], "supersample"),
    ([("any_lane(lane, has_others)", "has_others && false")], "supersample"),
    ([("return 4u * quad + column % 4u", "return 4u * quad + column % 2u")], "supersample"),
];

#[test]
#[ignore = "deep: broken programs"]
fn broken_ewa_programs_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_ewa_programs_are_noticed") else { return };
    let cases = all();
    let notices = |gpu: &mut Gpu, name: &'static str| {
        let sigma = (name == "wide").then_some(3.3);
        let case = named(&cases, if sigma.is_some() { "supersample" } else { name });
        check(gpu, case, sigma, &mut [0; 7])
    };
    gpu.state.device.lanes = Lanes::Quads;
    all_are_noticed(&mut gpu, &MUTANTS, notices);
    gpu.state.device.lanes = Lanes::Pixels;
    all_are_noticed(&mut gpu, &BY_PIXELS, notices);
}

/// Whole images against the CPU's, and against those of buffers that are too small. On the software device pixels equal
/// the CPU's.
#[test]
#[ignore = "deep: whole pictures"]
fn ewa_images_look_the_same() {
    let Some(mut gpu) = gpu_or_skip("ewa_images_look_the_same") else { return };
    let cases = all();
    for (case, got) in cases.iter().zip(same_with_small_buffers(&mut gpu, &cases)) {
        let want = render_checked(&mut Cpu::default(), &case.scene, FrameNumber::from(0), &case.options)
            .unwrap_or_else(|e| panic!("{e}"));
        let (got, want) = (values(&got), values(&want.picture));
        let difference = |(g, w): (&f32, &f32)| if g == w { 0.0 } else { (g - w).abs() / w.abs().max(1.0) };
        let differences: Vec<f32> = got.iter().zip(&want).map(difference).collect();
        let worst = differences.iter().copied().fold(0.0, f32::max);
        let differing = differences.iter().filter(|&&d| d >= 1e-4 || d.is_nan()).count();
        let covered = want.iter().filter(|&&v| v != 0.0 && v.is_finite()).count();
        eprintln!("{}: worst {worst:.1e}, {differing} of {} values differ, {covered} not 0", case.name, want.len());
        assert!(differing as f64 <= 1e-3 * want.len() as f64, "{}: {differing} values differ", case.name);
        assert!(covered > 0, "{}: nothing to compare", case.name);
    }
}
