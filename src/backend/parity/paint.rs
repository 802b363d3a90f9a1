//! Step `Paint`, with a filter and without: parity with the CPU, pass by pass and slot by slot. Each pass is fed the
//! CPU's results of the passes before it. Also: broken programs, small buffers and whole images.

use super::cases::{self, Case};
use super::compare::{Tally, flat};
use super::gpu_or_skip;
use super::harness::{Harness, NONE, PIXELS, Pass, UNWANTED};
use super::mutants::{Mutant, all_are_noticed, named};
use super::paint_twins::{PaintTwins, PaintedTile};
use super::pictures::are_the_cpus;
use super::posed::{Context, whole};
use super::slots::{Slots, Slotted};
use crate::backend::cpu::paint::buffers::DepthLayer;
use crate::backend::cpu::paint::{Kernel, PaintGroup};
use crate::backend::cpu::published::LowPassSplat;
use crate::backend::gpu::Gpu;
use crate::backend::gpu::form::{Form, Lanes};
use crate::backend::gpu::layout::TILE;
use crate::backend::gpu::passes::KernelKind;
use crate::backend::gpu::slots::Slot;
use crate::frame::Frame;
use crate::layout::{EwaSplat, Splat};
use crate::options::{PixelFilter, Prefilter};
use crate::plan::PaintPass;
use crate::scene::Object;

/// The cases, with filtered kernels; and a surface of kernels below a pixel whose every pixel bends.
fn filtered() -> Vec<Case> {
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
struct Both<'a, K> {
    harness: Harness<'a>,
    twins: PaintTwins<'a, K>,
    tiles: Vec<[usize; 2]>,
    /// What the CPU has of the tiles; `None` where one is not wanted.
    host: Vec<Option<PaintedTile>>,
}

impl<K: Kernel> Both<'_, K> {
    /// Floats of a tile's second thresholds and of its rim, which come last.
    const BEHIND: usize = if K::FILTERED { 2 * PIXELS } else { 0 };

    /// Pixels before a tile's first in a row and in a column, and pixels of both, as the device has them.
    fn guarded(&self) -> ([usize; 2], [usize; 2]) {
        let apron = self.twins.apron();
        let before = [apron.next_multiple_of(4), apron];
        (before, before.map(|pixels| TILE as usize + 2 * pixels))
    }

    /// Floats of a tile's depths.
    fn depth_floats(&self) -> usize {
        let (_, [width, height]) = self.guarded();
        width * height + Self::BEHIND
    }

    /// Depths of all tiles as the device has them; NaN where nobody may read them.
    fn depths(&self) -> Vec<f32> {
        let of_tile = |(&tile, host): (&[usize; 2], &Option<PaintedTile>)| {
            let Some(host) = host else { return vec![UNWANTED; self.depth_floats()] };
            let (before, size) = self.guarded();
            // The apron may be none of the CPU's.
            let outside = if K::FILTERED { f32::NAN } else { NONE };
            let thresholds = self.twins.thresholds(host, tile, before, size).into_iter();
            let mut depths: Vec<f32> = thresholds.map(|t| t.map_or(outside, |t| t.min(NONE))).collect();
            if !K::FILTERED {
                return depths;
            }
            let inside = self.twins.inside(tile);
            let in_image = |(value, inside): (f32, &bool)| if *inside { value } else { f32::NAN };
            let second = self.twins.second(host).into_iter().map(|t| t.map_or(UNWANTED, |t| t.min(NONE)));
            depths.extend(second.zip(&inside).map(in_image));
            let rim = self.twins.rim(host).into_iter().map(|rim| f32::from(u8::from(rim)));
            depths.extend(rim.zip(&inside).map(in_image));
            depths
        };
        let nearest = |(&tile, host): (&[usize; 2], &Option<PaintedTile>)| match host {
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
        let mut tally = Tally::of(Slot::Thresholds);
        for (i, (got, want)) in got.iter().zip(&want).enumerate() {
            // The nearest depths are behind those of all tiles.
            let is_second = i < self.tiles.len() * floats && i % floats >= floats - Self::BEHIND;
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
        let mut tally = Tally::of(Slot::Sums);
        for ((got, host), tile) in got.chunks(floats).zip(&self.host).zip(&self.tiles) {
            let Some(host) = host else {
                // Nothing is added to a tile that is not wanted.
                tally.count += 1;
                if got.iter().any(|sum| *sum != 0.0) {
                    tally.otherwise(|| format!("tile {tile:?}"));
                }
                continue;
            };
            let second = if layers > 1 { self.twins.second(host) } else { Vec::new() };
            let inside = self.twins.inside(*tile);
            for (layer, planes) in self.twins.sums(host).iter().enumerate() {
                for (channel, plane) in planes.iter().enumerate() {
                    for pixel in 0..PIXELS {
                        // A solid pixel knows only its band, without what makes a coverage.
                        let is_band =
                            layer == DepthLayer::Band as usize && channels.peak.is_none_or(|peak| channel < peak);
                        if K::FILTERED && !inside[pixel] || layers > 1 && second[pixel].is_none() && !is_band {
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

    /// Writes what the passes before `pass` make.
    fn feed(&self, pass: PaintPass) {
        if pass != PaintPass::Visibility {
            let depths: Vec<f32> = self.depths().iter().map(|t| if t.is_nan() { NONE } else { *t }).collect();
            self.harness.write(&self.harness.gpu.state.buffers[Slot::Thresholds], &depths);
        }
        if pass == PaintPass::Resolve {
            self.feed_sums();
        }
    }

    fn feed_sums(&self) {
        let none = PaintedTile::default();
        let of_tile = |host: &Option<PaintedTile>| match host {
            Some(host) => self.twins.sums(host),
            None => self.twins.sums(&none),
        };
        let sums: Vec<f32> = self.host.iter().flat_map(of_tile).flatten().flatten().collect();
        self.harness.write(&self.harness.gpu.state.buffers[Slot::Sums], &sums);
    }

    fn compare_film(&self) -> Result<(), String> {
        let none = PaintedTile::default();
        let film = |host: &Option<PaintedTile>| flat(&self.twins.film(host.as_ref().unwrap_or(&none)));
        let want: Vec<f32> = self.host.iter().flat_map(film).collect();
        super::compare::compare(
            Slot::Film,
            &self.harness.read(&self.harness.gpu.state.buffers[Slot::Film], want.len()),
            &want,
            |_| 1.0,
        )
    }

    fn count(&self, counts: &mut Counts) {
        counts.unwanted += PIXELS * self.host.iter().filter(|host| host.is_none()).count();
        for (host, &tile) in self.host.iter().zip(&self.tiles) {
            let Some(host) = host else { continue };
            let sums = self.twins.sums(host);
            for (layer, planes) in sums.iter().enumerate() {
                counts.layers[layer] += planes[0].iter().filter(|&&weight| weight > 0.0).count();
            }
            let thresholds = self.twins.thresholds(host, tile, [0; 2], [TILE as usize; 2]);
            let covers = |threshold: &Option<f32>| threshold.is_some_and(f32::is_finite);
            let bare = thresholds.iter().zip(&sums[0][0]).filter(|(threshold, _)| !covers(threshold));
            counts.uncovered += bare.clone().count();
            counts.partly += bare.filter(|(_, weight)| **weight > 0.0).count();
            if K::FILTERED {
                let second = self.twins.second(host);
                let open = || second.iter().zip(self.twins.rim(host)).filter(|(second, _)| second.is_some());
                counts.open += open().count();
                counts.off_rim += open().filter(|(_, rim)| !rim).count();
                counts.solid += second.iter().filter(|second| second.is_none()).count();
            }
        }
    }
}

/// What there is to compare: pixels that are open, that are solid, with each layer, that are open and not near a rim;
/// splats, and wide ones; pixels that no disc covers, those of them with weight, and those of tiles that are not
/// wanted.
#[derive(Debug, Default)]
struct Counts {
    open: usize,
    solid: usize,
    layers: [usize; 4],
    off_rim: usize,
    splats: usize,
    wide: usize,
    uncovered: usize,
    partly: usize,
    unwanted: usize,
}

/// All passes of the first group of a case; the first that differs. `sigma`: that of a wider filter.
fn check_and_count(gpu: &mut Gpu, case: &Case, sigma: Option<f32>, counts: &mut Counts) -> Result<(), String> {
    let frame = frame_of(case, sigma);
    let compared = match KernelKind::of(frame.prefilter) {
        KernelKind::Disc => check_of::<Splat>(gpu, &frame, counts),
        KernelKind::LowPass => check_of::<LowPassSplat>(gpu, &frame, counts),
        KernelKind::Filtered => check_of::<EwaSplat>(gpu, &frame, counts),
    };
    compared.map_err(|what| format!("{}: {what}", case.name))
}

pub(super) fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    check_and_count(gpu, case, None, &mut Counts::default())
}

fn check_of<K: Kernel + Slotted>(gpu: &mut Gpu, frame: &Frame, counts: &mut Counts) -> Result<(), String> {
    let context = Context::of(frame);
    let Some(harness) = Harness::new(gpu, frame) else { return Ok(()) };
    let position = &frame.rasters[0].positions[0];
    let scope = context.scope(frame, position, &position.groups[0], whole(position));
    let twins = PaintTwins { group: PaintGroup::<K>::new(scope), edge: TILE as usize };
    let tiles = harness.tiles();
    let posed = twins.project();
    let host = tiles.iter().map(|&tile| harness.wants(tile).then(|| twins.run(&posed, tile))).collect();
    let slots = Slots::new(&harness, &tiles, &posed);
    let mut both = Both { harness, twins, tiles, host };
    counts.splats += posed.iter().map(|posed| posed.splats.len()).sum::<usize>();
    counts.wide += slots.wide.len();
    both.count(counts);
    let order = PaintPass::order(both.harness.prepared.channels.is_layered());
    for pass in [Pass::Project, Pass::Bin].into_iter().chain(order.iter().map(|&pass| Pass::Paint(pass))) {
        both.harness.spoil();
        if pass != Pass::Project {
            slots.feed_splats(&both.harness);
        }
        if let Pass::Paint(pass) = pass {
            slots.feed_lists(&both.harness);
            both.feed(pass);
        }
        both.harness.run(pass);
        let compared = match pass {
            Pass::Project => slots.compare_splats(&both.harness),
            Pass::Bin => slots.compare_lists(&both.harness),
            Pass::Paint(PaintPass::Visibility) => both.compare_depths(false),
            Pass::Paint(PaintPass::Second) => both.compare_depths(true),
            Pass::Paint(PaintPass::Attribute) => both.compare_sums(),
            Pass::Paint(PaintPass::Resolve) => both.compare_film(),
            _ => unreachable!("not a pass of the step"),
        };
        compared.map_err(|what| format!("{pass:?}: {what}"))?;
    }
    Ok(())
}

#[test]
fn passes_agree() {
    let Some(mut gpu) = gpu_or_skip("passes_agree") else { return };
    // Programs have two forms of both kinds; none has both.
    let has_subgroups = gpu.state.device.form.subgroups;
    for (lanes, subgroups) in Lanes::ALL.into_iter().zip([false, has_subgroups]) {
        gpu.state.device.form = Form { lanes, subgroups };
        let mut counts = Counts::default();
        for case in cases::all() {
            eprintln!("{}, by {lanes:?}:", case.name);
            check_and_count(&mut gpu, &case, None, &mut counts).unwrap_or_else(|what| panic!("by {lanes:?}: {what}"));
        }
        // The comparison is worth something only where there is something to compare.
        let Counts { splats, wide, uncovered, partly, unwanted, .. } = counts;
        assert!(splats > 3000 && wide > 5 && uncovered > 5000 && partly > 100 && unwanted > 1000, "{counts:?}");
    }
}

#[test]
fn filtered_passes_agree() {
    let Some(mut gpu) = gpu_or_skip("filtered_passes_agree") else { return };
    for lanes in Lanes::ALL {
        gpu.state.device.form.lanes = lanes;
        let mut counts = Counts::default();
        let wide_filter = |case: &Case| ["supersample", "in part"].contains(&case.name).then_some(3.3);
        for case in filtered() {
            // An apron that takes more than one quad, and the tile more than one round.
            for sigma in [None].into_iter().chain(wide_filter(&case).map(Some)) {
                eprintln!("{}, by {lanes:?}, sigma {sigma:?}:", case.name);
                let compared = check_and_count(&mut gpu, &case, sigma, &mut counts);
                compared.unwrap_or_else(|what| panic!("by {lanes:?}: {what}"));
            }
        }
        let Counts { open, solid, layers, off_rim, .. } = counts;
        assert!([open, solid, off_rim].iter().chain(&layers).all(|&count| count > 100), "{counts:?}");
    }
}

static MUTANTS: [Mutant; 58] = [
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
    ([("u = disc.u * vec3<f32>(view.focal, view.focal, 1.0)", "u = disc.u * view.focal")], "spheres"),
    ([("        c *= disc.nearer;\n", "")], "spheres"),
    (
        [("return Outline(cosine * cosine, axes.u * (radius * cosine)", "return Outline(cosine, axes.u * radius")],
        "spheres",
    ),
    ([("        sine = disc.sine;\n", "")], "spheres"),
    // Pass `visibility`.
    ([("return 1.0 - splat.centre_depth * height(r2)", "return Floats(1.0)")], "spheres"),
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
    ([("slot, splat, seen, place.before, pixels)", "slot, splat, seen, next, pixels)")], "supersample"),
    ([("last & seen.disc)", "seen.disc)")], "supersample"),
    ([("seen.weight, Floats(1.0), seen.disc", "seen.weight, Floats(2.0), seen.disc")], "bucket"),
    ([("normal = unit(-apply(segment.world, placed(at)))", "normal = unit(turned_normal)")], "spheres"),
    ([("(1.0 - sine) * (1.0 - high) * over", "(1.0 - high) * over")], "spheres"),
    ([("along_u * across_u.x + along_v * across_v.x", "along_u * across_u.x")], "spheres"),
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
    let cases = filtered();
    let notices = |gpu: &mut Gpu, name: &'static str| {
        let sigma = (name == "wide").then_some(3.3);
        let case = named(&cases, if sigma.is_some() { "supersample" } else { name });
        check_and_count(gpu, case, sigma, &mut Counts::default())
    };
    gpu.state.device.form.lanes = Lanes::Quads;
    all_are_noticed(&mut gpu, &MUTANTS, notices);
    gpu.state.device.form.lanes = Lanes::Pixels;
    all_are_noticed(&mut gpu, &BY_PIXELS, notices);
}

#[test]
#[ignore = "deep: whole pictures"]
fn ewa_images_look_the_same() {
    let Some(mut gpu) = gpu_or_skip("ewa_images_look_the_same") else { return };
    are_the_cpus(&mut gpu, &filtered());
}
