//! Captures: projected Gaussians, and whole frames, against the CPU's.

use super::captures::{captures, many};
use super::cases::Case;
use super::compare::{Tally, largest};
use super::gpu_or_skip;
use super::harness::read;
use super::mutants::{Mutant, all_are_noticed, named};
use super::pictures::{BUDGET, look_the_same};
use super::rounds::same_one_by_one;
use crate::backend::cpu::Cpu;
use crate::backend::cpu::transparent::project::{Projected, project};
use crate::backend::cpu::transparent::view::GaussianView;
use crate::backend::gpu::Gpu;
use crate::backend::gpu::form::Lanes;
use crate::backend::gpu::layout::DeviceGaussian;
use crate::backend::gpu::slots::Slot;
use crate::backend::{Backend, BackendError};
use crate::film::{Aov, Blending, Picture};
use crate::frame::{Frame, PixelRect};
use crate::options::{ErrorTarget, Quality};
use crate::renderer::render_checked;
use crate::time::FrameNumber;

/// All projected Gaussians of the first sample of a case.
fn check_project(gpu: &mut Gpu, name: &str, frame: &Frame) -> Result<usize, String> {
    let (device, keys) = gpu.projected(frame);
    let mut by_key: Vec<usize> = (0..keys.len()).collect();
    by_key.sort_by_key(|&slot| keys[slot]);
    if !by_key.is_sorted_by(|&a, &b| device[a].depth.total_cmp(&device[b].depth).is_le()) {
        return Err(format!("{name}: keys are not in the order of depths"));
    }
    let position = &frame.rasters[0].positions[0];
    let sample = &position.groups[0].samples[0];
    let of_volumes = sample.objects.iter().zip(&frame.objects).filter(|(_, object)| object.is_volume());
    let layer = of_volumes.map(|(posed, _)| posed.epsilon).fold(f32::MAX, f32::min);
    let (mut first, mut tally) = (0_usize, Tally::of(Slot::Gaussians));
    for (object, posed) in frame.objects.iter().zip(&sample.objects) {
        let Some((gaussians, drawing)) = object.drawn() else { continue };
        let view = GaussianView {
            shaded: None,
            object,
            drawing,
            sample,
            posed,
            near: posed.near,
            raster: position.raster,
            size: frame.size,
            stride: frame.stride as f32,
            pixels: PixelRect::of_image(position.raster.size),
            wanted: None,
            offsets: [position.raster.offset; 2],
            layer: layer.max(f32::MIN_POSITIVE),
            variance: position.raster.variance(frame.prefilter),
            blending: frame.blending.unwrap_or(Blending::Linear),
            velocity: frame.aovs.contains(&Aov::Velocity),
            first: first as u32,
            all: true,
        };
        let mut host = Projected::default();
        project(&view, gaussians, 0..gaussians.len(), &mut host);
        for (i, want) in host.splats.iter().enumerate() {
            let got = &device[first + i];
            let at = || format!("{name}: Gaussian {}", want.index);
            assert_eq!(got.index, want.index, "{name}");
            tally.floats(&[got.depth], &[want.depth], want.depth.abs(), at);
            if got.layer != want.layer {
                tally.otherwise(|| format!("{}: layer {}, not {}", at(), got.layer, want.layer));
            }
            let seen = host.bounds[i][0] <= host.bounds[i][1];
            if (got.bounds[0] <= got.bounds[1]) != seen || (seen && got.bounds != want.bounds) {
                tally.otherwise(|| format!("{}: bounds {:?}, not {:?}", at(), got.bounds, want.bounds));
            }
            if !seen {
                continue;
            }
            let forms = |along, slope, across, peak| [along, slope, across, peak];
            let of_device = forms(got.along, got.slope, got.across, got.peak);
            let of_host = forms(want.along, want.slope, want.across, want.peak);
            tally.floats(&of_device, &of_host, largest(&of_host), at);
            tally.floats(&got.reference, &want.reference, largest(&want.reference), at);
            tally.floats(&got.colour, &want.colour, largest(&want.colour), at);
            if let Some(velocity) = host.velocities.get(i) {
                tally.floats(&got.velocity, velocity, largest(velocity), at);
            }
        }
        first += gaussians.len();
    }
    let count = tally.count;
    tally.check("Gaussians").map(|()| count)
}

/// Pass `project` and the whole frame.
fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let frame = case.frame();
    check_project(gpu, case.name, &frame)?;
    let got = gpu.render(frame.clone()).unwrap_or_else(|e| panic!("{}: {e}", case.name));
    let want = Cpu::default().render(frame).unwrap_or_else(|e| panic!("{}: {e}", case.name));
    let left_out = [got.stats.left_out, want.stats.left_out];
    assert!(case.name != "glass, nested" || want.stats.left_out > 50, "{}: {left_out:?} left out", case.name);
    if left_out[0].abs_diff(left_out[1]) as f64 > BUDGET * want.picture.rgba.len() as f64 {
        return Err(format!("{}: {left_out:?} pixels left out", case.name));
    }
    look_the_same(case.name, &got.picture, &want.picture)
}

#[test]
#[ignore = "deep: whole pictures"]
fn captures_look_the_same() {
    let Some(mut gpu) = gpu_or_skip("captures_look_the_same") else { return };
    for lanes in Lanes::ALL {
        gpu.state.device.form.lanes = lanes;
        // Passes of opaque surfels alone know lanes, and have tests of their own.
        let some = ["supersample", "bucket", "ewa", "glass", "in part"];
        for case in captures().iter().filter(|case| lanes == Lanes::Quads || some.contains(&case.name)) {
            check(&mut gpu, case).unwrap_or_else(|what| panic!("by {lanes:?}: {what}"));
        }
    }
}

/// Mode auto wants some blocks, several times.
#[test]
#[ignore = "deep: whole pictures"]
fn captures_look_the_same_in_mode_auto() {
    let Some(mut gpu) = gpu_or_skip("captures_look_the_same_in_mode_auto") else { return };
    let mut refined = false;
    for case in captures().iter().filter(|case| ["supersample", "linear", "large"].contains(&case.name)) {
        let mut options = case.options.clone();
        options.quality = Quality::Error(ErrorTarget { error: 0.01, samples_max: 48, ..ErrorTarget::default() });
        let rendered =
            |backend: &mut dyn Backend| render_checked(backend, &case.scene, FrameNumber::from(0), &options).unwrap();
        let (got, want) = (rendered(&mut gpu), rendered(&mut Cpu::default()));
        assert_eq!(got.stats.achieved.map(|a| a.refined), want.stats.achieved.map(|a| a.refined));
        refined |= want.stats.achieved.is_some_and(|achieved| achieved.refined > 0);
        look_the_same(case.name, &got.picture, &want.picture).unwrap_or_else(|what| panic!("{what}"));
    }
    assert!(refined, "no block is wanted");
}

/// Slabs of depth, bands of the image, and lists that grow change nothing.
#[test]
#[ignore = "deep: small buffers"]
fn small_buffers_change_no_capture() {
    let Some(mut roomy) = gpu_or_skip("small_buffers_change_no_capture") else { return };
    // See-through surfels go through all batches for each of their layers, which takes long.
    let glasses = ["glass, fog"];
    let mut cases = captures();
    cases.retain(|case| !case.name.starts_with("glass") || glasses.contains(&case.name));
    let picture = |gpu: &mut Gpu, case: &Case| gpu.render(case.frame()).unwrap_or_else(|e| panic!("{e}")).picture;
    let wanted: Vec<Picture> = cases.iter().map(|case| picture(&mut roomy, case)).collect();
    let (mut slabs, mut bands) = (roomy.beside(), roomy.beside());
    (slabs.most_slots, bands.most_bytes) = (100, 160 << 10);
    for (number, (case, want)) in cases.iter().zip(wanted).enumerate() {
        // A case takes up to ten seconds in each kind of small buffers, so the cases take turns.
        match number % 3 {
            0 => assert_eq!(picture(&mut slabs, case), want, "{}: slabs of 100", case.name),
            1 => assert_eq!(picture(&mut bands, case), want, "{}: bindings of 160 KiB", case.name),
            _ => {
                let mut small = roomy.beside();
                (small.first_entries, small.most_entries) = (1, 900);
                let before = small.most_slots;
                assert_eq!(picture(&mut small, case), want, "{}: lists of 900 entries", case.name);
                let few = ["one pixel", "aside", "wide volume", "volume, in part"].contains(&case.name);
                assert!(small.most_slots < before || few, "{}: no slab was split", case.name);
            }
        }
    }
}

/// Slabs that forget those before them are noticed.
#[test]
#[ignore = "deep: broken programs"]
fn captures_notice_broken_slabs() {
    static SLABS: [Mutant; 7] = [
        (
            [(
                "if view.resumes != 0u {\n        if !has_next(walk) && !has_rest { return; }\n        load(&sum, at);",
                "if false {",
            )],
            "supersample",
        ),
        ([("order[view.first_place + i]", "order[i]")], "supersample"),
        (
            [(
                "for (var i = first + lane; i < end; i += 256u) {\n        load_view_of(i)",
                "for (var i = first + lane; i + 1u < end; i += 256u) {\n        load_view_of(i)",
            )],
            "supersample",
        ),
        ([("load(&open, at + OPEN * TILE_QUADS);", "")], "volume"),
        (
            [(
                "layer) * PLANES + 3u) * TILE_PIXELS + pixel] = 0.0",
                "layer) * PLANES + 3u) * TILE_PIXELS + pixel] += 0.0",
            )],
            "glass",
        ),
        ([("quad.layer = number_at(at);", "")], "volume"),
        ([("first = vec4<u32>(sums[at + NEXT * TILE_QUADS])", "first = vec4<u32>(0u)")], "glass, fog"),
    ];
    let Some(mut roomy) = gpu_or_skip("captures_notice_broken_slabs") else { return };
    let mut slabs = roomy.beside();
    slabs.most_slots = 100;
    let cases = captures();
    all_are_noticed(&mut slabs, &SLABS, |slabs, name| {
        let picture = |gpu: &mut Gpu| gpu.render(named(&cases, name).frame()).unwrap().picture;
        if picture(slabs) == picture(&mut roomy) { Ok(()) } else { Err(format!("{name}: another picture")) }
    });
}

/// Groups that go through the passes together give the pictures of groups one by one.
fn check_rounds(together: &mut Gpu, alone: &mut Gpu, case: &Case) -> Result<(), String> {
    let chain = same_one_by_one(together, alone, case)?.map(|calls| calls.chain);
    // Of two groups alike, the lists of one count.
    if 10 * chain[0] < 9 * chain[1] { Ok(()) } else { Err(format!("{}: chains of {chain:?}", case.name)) }
}

#[test]
fn captures_together_are_captures_one_by_one() {
    let Some(mut together) = gpu_or_skip("captures_together_are_captures_one_by_one") else { return };
    let mut alone = together.beside();
    alone.most_groups = 1;
    let of_several =
        ["alone", "layer", "lit volume, interleaved", "glass, interleaved", "glass, fog", "rolling, in part"];
    let cases = captures();
    for case in of_several.map(|name| named(&cases, name)) {
        check_rounds(&mut together, &mut alone, case).unwrap_or_else(|what| panic!("{what}"));
    }
}

#[test]
#[ignore = "deep: broken programs"]
fn captures_notice_broken_rounds() {
    static ROUNDS: [Mutant; 10] = [
        ([("if rest == low {", "if rest == low + 1u {")], "alone"),
        (
            [("    view = views[segment.view];\n    let slot", "    view = views[0];\n    let slot")],
            "glass, interleaved",
        ),
        ([("        return view.number;", "        return 0u;")], "layer"),
        ([("        load_view_of(i);", "        view = views[0];")], "rolling, in part"),
        (
            [(
                "    let index = tile_of(tile.xy);\n    let in_tile",
                "    let index = tile_of(tile.xy) % 15u;\n    let in_tile",
            )],
            "layer",
        ),
        ([("    let opaque_at = index *", "    let opaque_at = 0u * index *")], "layer"),
        ([("let at = film_tile_of(tile) *", "let at = tile_of(tile) *")], "glass, interleaved"),
        (
            [(
                "    if !has_tile(tile.xy) { return; }\n    let index = tile_of(tile.xy);",
                "    view = views[0];\n    let index = tile_of(tile.xy);",
            )],
            "glass, fog",
        ),
        ([("view = views[number];\n        let has_it", "view = views[tile.z];\n        let has_it")], "layer"),
        ([("let has_it = has_tile(tile.xy)", "let has_it = true")], "lit volume, interleaved"),
    ];
    let Some(mut together) = gpu_or_skip("captures_notice_broken_rounds") else { return };
    let mut alone = together.beside();
    alone.most_groups = 1;
    let cases = captures();
    all_are_noticed(&mut together, &ROUNDS, |gpu, name| check_rounds(gpu, &mut alone, named(&cases, name)));
}

/// Loops that end early: lists are walked over in stretches, and no batch is split for them.
#[test]
fn lists_in_stretches_change_no_capture() {
    let Some(mut roomy) = gpu_or_skip("lists_in_stretches_change_no_capture") else { return };
    let cases = captures();
    for name in ["alone", "volume", "volume, bucket", "glass, fog"] {
        let mut case = named(&cases, name).clone();
        // Lists of surfels would split batches.
        case.scene.objects.retain(|object| object.shape.gaussians().is_some() || object.opacity < 1.0);
        let mut short = roomy.beside();
        short.most_turns = 300;
        let rendered = |gpu: &mut Gpu| gpu.render(case.frame()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let (got, want) = (rendered(&mut short), rendered(&mut roomy));
        let dispatches = [&got, &want].map(|rendered| rendered.stats.gpu.unwrap().dispatches);
        assert!(dispatches[0] > dispatches[1], "{name}: no list was cut");
        assert_eq!(got.picture, want.picture, "{name}");
        assert!(name == "glass, fog" || short.most_surfel_slots == u64::MAX, "{name}: a batch was split");
    }
}

/// The least memory with which a frame can be rendered holds all that it takes. What does not fit is refused in words.
#[test]
fn captures_keep_to_their_memory() {
    let Some(mut counting) = gpu_or_skip("captures_keep_to_their_memory") else { return };
    let mut rounds = 0;
    for mut case in captures().into_iter().chain([many()]) {
        (case.scene.image.width, case.scene.image.height) = (1600, 400);
        let mut frame = case.frame();
        let mut take = |memory: u64| {
            let mut gpu = gpu_or_skip("captures_keep_to_their_memory")?;
            gpu.most_slots = u64::MAX;
            frame.memory = memory;
            Some(gpu.fill(&frame))
        };
        let Some(refused) = take(0) else { return };
        let Err(BackendError::Memory { needed, .. }) = refused else { panic!("{}: {refused:?}", case.name) };
        for memory in [needed, needed + needed / 2] {
            let Some(taken) = take(memory) else { return };
            let taken = taken.unwrap_or_else(|e| panic!("{}: {e}", case.name));
            assert!(taken <= memory && taken > memory / 10 * 9, "{}: {taken} bytes of {memory}", case.name);
        }
        // There is room for rounds.
        let Some(taken) = take(8 * needed) else { return };
        let taken = taken.unwrap_or_else(|e| panic!("{}: {e}", case.name));
        assert!(taken <= 8 * needed, "{}: {taken} bytes of {}", case.name, 8 * needed);
        (frame.memory, rounds) = (8 * needed, rounds + usize::from(counting.groups_of_a_round(&frame) > 1));
    }
    assert!(rounds > 5, "{rounds} cases have rounds");
    let Some(mut gpu) = gpu_or_skip("captures_keep_to_their_memory") else { return };
    gpu.most_bytes = 32 << 10;
    let refused = gpu.render(captures()[0].frame()).map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("600 Gaussians") && refused.contains("`--backend cpu`"), "{refused}");
}

static MUTANTS: [Mutant; 137] = [
    // Pass `project`.
    ([("axis + vec2<f32>(x, y)", "axis + vec2<f32>(x, x)")], "supersample"),
    ([("jx = clamp(x, -segment.field.x, segment.field.x)", "jx = x")], "aside"),
    ([("jy = clamp(y, -segment.field.y, segment.field.y)", "jy = y")], "aside"),
    ([("qy = geometry[turn_at + 1u]", "qy = geometry[turn_at]")], "supersample"),
    ([("1.0 - 2.0 * (qy * qy + qz * qz)", "1.0 - 2.0 * (qy * qy - qz * qz)")], "supersample"),
    ([("2.0 * (qx * qy + qw * qz)", "2.0 * (qx * qy - qw * qz)")], "supersample"),
    ([("2.0 * (qx * qz - qw * qy)", "2.0 * (qx * qz + qw * qy)")], "supersample"),
    ([("2.0 * (qx * qy - qw * qz)", "2.0 * (qx * qy + qw * qz)")], "supersample"),
    ([("1.0 - 2.0 * (qx * qx + qz * qz)", "1.0 + 2.0 * (qx * qx + qz * qz)")], "supersample"),
    ([("2.0 * (qy * qz + qw * qx)", "2.0 * (qy * qz - qw * qx)")], "supersample"),
    ([("(qx * qz + qw * qy), 2.0", "(qx * qz - qw * qy), 2.0")], "supersample"),
    ([("2.0 * (qy * qz - qw * qx)", "2.0 * (qy * qz + qw * qx)")], "supersample"),
    ([("1.0 - 2.0 * (qx * qx + qy * qy)", "1.0 - 2.0 * (qx * qx - qy * qy)")], "supersample"),
    ([("geometry[sigma_at + 1u] * over", "geometry[sigma_at] * over")], "supersample"),
    ([("posed.x - jx * posed.z", "posed.x")], "supersample"),
    ([("posed.y - jy * posed.z", "posed.y")], "supersample"),
    ([("c.x * c.x + c.y * c.y + c.z * c.z", "c.x * c.x + c.y * c.y")], "supersample"),
    ([("u.z * v.x - u.x * v.z", "u.z * v.x + u.x * v.z")], "supersample"),
    ([("dilation * (xx + yy) + dilation * dilation", "dilation * (xx + yy)")], "supersample"),
    ([("wide_xx = xx + dilation", "wide_xx = xx")], "supersample"),
    ([("wide_yy = yy + dilation", "wide_yy = yy + 9.0 * dilation")], "supersample"),
    ([("lost = sqrt(unfiltered / determinant)", "lost = unfiltered / determinant")], "drawn"),
    ([("segment.opacity * select(", "select(")], "drawn"),
    ([("opacity * 255.0 > 1.0", "opacity * 25.0 > 1.0")], "drawn"),
    ([("(peak + faintest)", "faintest")], "supersample"),
    ([("slope = xy * over_xx", "slope = -xy * over_xx")], "supersample"),
    ([("HALF_LOG2_E * wide_xx / area", "HALF_LOG2_E / wide_yy")], "supersample"),
    ([("all(position >= segment.low.xyz)", "true")], "drawn"),
    ([("all(position <= segment.high.xyz)", "true")], "drawn"),
    ([("&& depth >= segment.near", "")], "near"),
    ([("reach_x) - view.offset.x", "reach_x) + view.offset.x")], "supersample"),
    ([("reach_y) - view.offset.y", "reach_y) + view.offset.y")], "supersample"),
    ([("if segment.tint.w != 0.0", "if false")], "drawn"),
    ([("(position - segment.eye)", "(segment.eye - position)")], "supersample"),
    ([("max(own, vec3<f32>(0.0))", "own")], "supersample"),
    ([("(segment.flags & FLAG_ENCODE) == 0u", "true")], "encoded"),
    ([("own += harmonics(i", "own -= harmonics(i")], "supersample"),
    ([("k < segment.harmonics_used", "k < segment.harmonics_each")], "drawn"),
    ([("-0.48860251 * d.x", "0.48860251 * d.x")], "supersample"),
    ([("-1.0925484 * d.y * d.z", "1.0925484 * d.y * d.z")], "supersample"),
    ([("2.0 * zz - xx - yy)", "2.0 * zz - xx + yy)")], "supersample"),
    ([("0.5462742 * (xx - yy)", "0.5462742 * (xx + yy)")], "supersample"),
    ([("-0.5900436 * d.y", "0.5900436 * d.y")], "supersample"),
    ([("2.8906114 * d.x", "-2.8906114 * d.x")], "supersample"),
    ([("-0.4570458 * d.y", "0.4570458 * d.y")], "supersample"),
    ([("2.0 * zz - 3.0 * xx", "2.0 * zz + 3.0 * xx")], "supersample"),
    ([("-0.4570458 * d.x", "0.4570458 * d.x")], "supersample"),
    ([("1.4453057 * d.z", "-1.4453057 * d.z")], "supersample"),
    ([("(xx - 3.0 * yy)", "(xx + 3.0 * yy)")], "supersample"),
    ([("centre.x * over * rate.z", "centre.x * over")], "supersample"),
    ([("rate.y - centre.y", "rate.y + centre.y")], "supersample"),
    // Volumes.
    ([("inverse_focal2 = 1.0 / (view.focal * view.focal)", "inverse_focal2 = 1.0 / view.focal")], "volume"),
    ([("segment.area * sqrt(longer2) * (over * over)", "segment.area * sqrt(longer2) * over")], "volume"),
    ([("opacity >= LEAST_NORMAL, is_volume", "opacity * 255.0 > 1.0, is_volume")], "volume"),
    ([("min(peak - log_of_two(kept), MOST_DEPTH)", "min(peak, MOST_DEPTH)")], "volume"),
    ([("min(peak - log_of_two(kept), MOST_DEPTH)", "peak - log_of_two(kept)")], "dense"),
    ([("faintest = -least_power(peak)", "faintest = LOG2_FAINTEST")], "volume"),
    ([("shift = bend.shift;", "")], "volume"),
    ([("vec2<f32>(x, y) + shift", "vec2<f32>(x, y)")], "volume"),
    ([("- 6.0 * along * e[k] + 12.0", "+ 6.0 * along * e[k] + 12.0")], "volume"),
    ([("px * px + py * py) * over +", "px * px + py * py) +")], "volume"),
    ([("select(1.0, MOST_BEND / size, size > MOST_BEND)", "1.0")], "wide volume"),
    ([("own = lit(i, own, position)", "own = vec3<f32>(0.1)")], "lit volume"),
    ([("> 0.0 { normal = -normal; }", "< 0.0 { normal = -normal; }")], "lit volume"),
    ([("vec4<f32>(material.x, 0.0, 0.0, material.w)", "material")], "lit volume"),
    ([("min(peak - LEAST_REACH, FAINTEST_DEPTH)", "FAINTEST_DEPTH")], "volume"),
    ([("splat.layer = gaussians[slot].layer;", "")], "volume, bucket"),
    ([("1u + u32(clamp(centre.z / segment.layer", "1u + u32(clamp(centre.z / 0.7")], "volume"),
    ([("if (*quad).layer != splat.layer {", "if false {")], "volume"),
    ([("if OPEN != 0u { close_layer(sum, open, reaches); }", "")], "volume"),
    ([("if OPEN != 0u { close_layer(&sum, &open, vec4<bool>(true)); }", "")], "volume"),
    ([("(1.0 - through) / select", "1.0 / select")], "volume"),
    // See-through surfels.
    ([("thresholds[floor_at] = thresholds[threshold_at]", "thresholds[floor_at] = Floats(0.0)")], "glass"),
    ([("met.depth <= depth_at(depths_at + 4u * floor_place() + place)", "met.depth <= 0.0")], "glass"),
    ([("(seen.depth > pixels.floor) & ", "")], "glass"),
    ([("min(pixels.first, ceiling)", "pixels.first")], "glass"),
    ([("seen.disc = seen.disc & in_layer;", "")], "glass, bucket"),
    ([("segment.normal[0].w * own", "own")], "glass"),
    ([("if (segment.flags & 4u) != 0u { own = looks[before + surfel]; }", "")], "glass"),
    ([("select(6u, 10u, (segment", "select(6u, 6u, (segment")], "glass"),
    ([("if all(pixels.first == Floats(UNWANTED)) { return; }", "if true { return; }")], "glass, ewa"),
    ([("peeled[4u * depths_at + i] = 0.0", "peeled[4u * depths_at + i] = 2.5")], "glass"),
    ([("ceiling = thresholds[index * TILE_PIXELS + 4u * lane + i]", "ceiling = NONE")], "glass"),
    ([("ceiling = thresholds[4u * before + i]", "ceiling = NONE")], "glass, ewa"),
    (
        [("put_cover(depths_at, pixel, Cover(0.0, 0.0, 1.0))", "put_cover(depths_at, pixel, Cover(0.5, 0.5, 0.5))")],
        "glass",
    ),
    ([("film[film_at + plane * TILE_PIXELS] = 0.0", "film[film_at + plane * TILE_PIXELS] += 0.0")], "glass"),
    ([("var coverage = 1.0;", "var coverage = 0.9;")], "glass, ewa"),
    ([("TILE_PIXELS] * view.opaque_scale;\n        } else", "TILE_PIXELS];\n        } else")], "glass, bucket"),
    ([("is_band && depth < NONE", "false")], "glass, ewa"),
    ([("(weight + abs(sums[peak_at + TILE_PIXELS]))", "(weight + sums[peak_at + TILE_PIXELS])")], "glass, ewa"),
    ([("put(&cover, coverage, opacity) / before", "coverage")], "glass"),
    ([("peeled[state_at + 1u] += 1.0", "peeled[state_at + 1u] += 0.0")], "glass"),
    ([("select(0.0, 1.0, atomicLoad(&counted) > 0u)", "0.0")], "glass"),
    ([("depth > peeled[4u * (depths_at + ceiling_place()) + pixel]", "false")], "glass, nested"),
    ([("min(coverage, room)", "coverage")], "glass, ewa"),
    ([("if beside >= room {", "if false {")], "glass, bucket"),
    ([("of_filled - light_behind + light_beside", "of_filled + light_beside")], "glass, ewa"),
    ([("atomicAdd(&status[LEFT_OUT_LOW], more)", "atomicAdd(&status[LEFT_OUT_LOW], 1u)")], "glass, nested"),
    ([("pass_surfels(sum, open, quad, reaches, splat.depth, false)", "")], "glass, fog"),
    ([("pass_surfels(&sum, &open, &quad, vec4<bool>(true), NONE, true)", "")], "glass"),
    ([("if OPEN != 0u { close_layer(sum, open, due); }", "")], "glass, fog"),
    ([("find_next(quad, i, number + 1u)", "find_next(quad, i, number + 2u)")], "glass"),
    ([("if layers[at + 3u * TILE_PIXELS] > 0.0 {", "if layers[at + 3u * TILE_PIXELS] > 0.5 {")], "glass"),
    ([("layers[at + (LAYER_PLANES - 1u) * TILE_PIXELS]", "NONE")], "glass"),
    ([("colour = alpha\n            * vec3", "colour = vec3")], "glass"),
    ([("(*sum).depth[i] += through * ", "(*sum).depth[i] += ")], "glass, depth"),
    (
        [(
            "(VELOCITY_PLANE + 1u) * TILE_PIXELS];\n    }\n    if NORMAL",
            "VELOCITY_PLANE * TILE_PIXELS];\n    }\n    if NORMAL",
        )],
        "glass",
    ),
    ([("(*sum).normal_z[i] += through * ", "(*sum).normal_z[i] += ")], "glass, normal"),
    ([("(*sum).through[i] = through * (1.0 - alpha)", "(*sum).through[i] = through")], "glass"),
    ([("own = sums[sum_at + (NORMAL + c) * TILE_PIXELS]", "own = 0.0")], "glass, normal"),
    // Passes `sort` and `list`.
    ([("bits | 0x80000000u", "bits & 0xffff0000u")], "supersample"),
    ([("select(~bits, bits |", "select(bits, bits |")], "aside"),
    ([("if bounds.x <= bounds.y { count", "if bounds.x + 8u <= bounds.y { count")], "supersample"),
    ([("order[view.first_place + i]", "view.first_place + i")], "supersample"),
    ([("place += select(0u, 1u, digits[before] == digit)", "place += select(0u, 1u, digits[before] > 99u)")], "ties"),
    // Pass `composite`.
    ([("splat.reference.x + view.offset.x", "splat.reference.x")], "supersample"),
    ([("y - splat.slope * x", "y")], "supersample"),
    ([("min(value, vec4<f32>(MOST_ALPHA))", "value")], "still"),
    ([("select(-LOG2_FAINTEST, least_power", "select(-6.0, least_power")], "still"),
    ([("reaches & (through >= vec4<f32>(OPAQUE))", "reaches & (through >= vec4<f32>(0.2))")], "still"),
    ([("vec4<f32>(splat.depth) <= (*quad).limit", "(*quad).limit > vec4<f32>(0.0)")], "still"),
    (
        [("limit = thresholds[depths_of(index) + threshold_place(place.xy)]", "limit = thresholds[depths_of(index)]")],
        "ewa",
    ),
    ([("share * splat.velocity.y", "share * splat.velocity.x")], "still"),
    ([("(*sum).depth += share * splat.depth", "(*sum).depth += splat.depth")], "depth"),
    // Pass `resolve`.
    ([("through * (1.0 - solid)", "through")], "still"),
    ([("if CODED { shown = from_linear(linear); }", "")], "still"),
    ([("behind_through * behind_coded) -", "behind_through * behind) -")], "still"),
    ([("- behind_through * behind;", ";")], "still"),
    ([("return alpha * to_linear", "return to_linear")], "transparent"),
    ([("if CODED { seen = decoded", "if false { seen = decoded")], "transparent"),
    ([("(front * inverse)", "(front)")], "transparent"),
    ([("own + through * (shown * solid)", "own + through * shown")], "linear"),
    ([("view.weight * seen", "seen")], "linear"),
    ([("view.weight * alpha", "alpha")], "linear"),
    ([("(own + through * of_opaque(opaque_at, plane))", "(own + of_opaque(opaque_at, plane))")], "still"),
    ([("sums[sum_at + 6u * TILE_PIXELS]", "sums[sum_at + 5u * TILE_PIXELS]")], "still"),
    ([("[at + plane * TILE_PIXELS] * view.opaque_scale", "[at + plane * TILE_PIXELS]")], "bucket"),
];

#[test]
#[ignore = "deep: broken programs"]
fn captures_notice_broken_programs() {
    let Some(mut gpu) = gpu_or_skip("captures_notice_broken_programs") else { return };
    let cases = captures();
    all_are_noticed(&mut gpu, &MUTANTS, |gpu, name| check(gpu, named(&cases, name)));
}

impl Gpu {
    /// The Gaussians of the first sample of a frame, and the keys by which they are sorted.
    fn projected(&mut self, frame: &Frame) -> (Vec<DeviceGaussian>, Vec<u32>) {
        let count = self.project_first(frame);
        let buffers = &self.state.buffers;
        (read(self, &buffers[Slot::Gaussians], count), read(self, &buffers[Slot::Keys], count))
    }
}
