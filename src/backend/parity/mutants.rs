//! A comparison is worth something only if it rejects a broken program.

use std::collections::BTreeSet;
use std::mem::take;

use super::cases::{self, Case};
use super::gpu_or_skip;
use super::paint;
use crate::backend::gpu::Gpu;
use crate::backend::gpu::form::Lanes;
use crate::backend::gpu::passes::Variant;

/// Text of a program, what replaces it, and a case that must notice.
pub(super) type Mutant = ([(&'static str, &'static str); 1], &'static str);

/// Fails unless `check` refuses each mutant, by the case of its name. It must pass with the programs as they are. Their
/// pipelines are compiled once; a mutant compiles the programs that hold its text.
pub(super) fn all_are_noticed(
    gpu: &mut Gpu,
    mutants: &'static [Mutant],
    mut check: impl FnMut(&mut Gpu, &'static str) -> Result<(), String>,
) {
    for name in mutants.iter().map(|(_, name)| *name).collect::<BTreeSet<_>>() {
        check(gpu, name).unwrap_or_else(|what| panic!("nothing is broken, but {what}"));
    }
    let intact = take(&mut gpu.state.pipelines);
    let mut unnoticed = Vec::new();
    for (pair, name) in mutants {
        let [(from, to)] = pair;
        assert!(Variant::all().iter().any(|variant| variant.wgsl().contains(from)), "no program holds `{from}`");
        gpu.state.pipelines = intact.with(pair);
        match check(gpu, name) {
            Ok(()) => unnoticed.push(format!("`{from}` became `{to}`")),
            Err(what) => eprintln!("`{to}`: {}", what.chars().take(150).collect::<String>()),
        }
    }
    gpu.state.pipelines = intact;
    assert!(unnoticed.is_empty(), "nothing was noticed: {unnoticed:#?}");
}

/// The case of a name.
pub(super) fn named<'a>(cases: &'a [Case], name: &str) -> &'a Case {
    cases.iter().find(|case| case.name == name).unwrap_or_else(|| panic!("there is no case {name}"))
}

static MUTANTS: [Mutant; 56] = [
    ([("vec2<f32>(x, y) - view.offset", "vec2<f32>(x, y) + view.offset")], "supersample"),
    ([("uy * v.z - u.z * vy", "uy * v.z + u.z * vy")], "supersample"),
    ([("area * depth * segment.handedness", "area * depth")], "plain"),
    ([("return select(0.0, view.low_pass", "return select(0.0, 0.0 * view.low_pass")], "supersample"),
    ([("area * segment.handedness < 0.0", "area * segment.handedness > 0.0")], "supersample"),
    ([("view.axis - view.offset", "view.axis")], "hard"),
    ([("sorted_keys[middle] < tile", "sorted_keys[middle] <= tile")], "supersample"),
    ([("(sorted_keys[i] >> SHIFT)", "(sorted_keys[i] >> 1u)")], "hard"),
    ([("at.y += 1u", "at.y += 0u")], "hard"),
    ([("column), depth, depth + tolerance", "column), depth, depth")], "supersample"),
    ([("max(Floats(epsilon)", "min(Floats(epsilon)")], "supersample"),
    ([("PIECES_OF_ROW + group.x) * PIECE + lane", "PIECES_OF_ROW + group.x) * PIECE + 2u * lane")], "supersample"),
    ([("entry < starts[views[0].round_tiles]", "entry + 9u < starts[views[0].round_tiles]")], "supersample"),
    ([("nearest = min(nearest, select(Floats(NONE), met.depth, counts));", "")], "walls"),
    ([("k = first_wide; k < end_wide", "k = first_wide + 1u; k < end_wide")], "hard"),
    ([("before = i / RUN * RUN", "before = i / RUN * RUN + 1u")], "supersample"),
    ([("place += entries", "place += 0u * entries")], "supersample"),
    ([("column + (width() - 1u) >= bounds.x", "column >= bounds.x")], "supersample"),
    ([("(seen.depth <= limit)", "(seen.depth <= limit + 1.0)")], "supersample"),
    ([("min(first, nearest + tolerance)", "first")], "tolerances"),
    ([("min(first, nearest + tolerance)", "min(first, nearest + 2.0 * tolerance)")], "tolerances, bucket"),
    ([("u32(y) + u32(x), met.depth", "u32(y) + u32(x), met.threshold")], "tolerances"),
    ([("0.0005294794", "0.0005394794")], "supersample"),
    ([("seen.weight * segments[segment_index].share", "seen.weight")], "bucket"),
    ([("normal = -normal", "normal = normal")], "supersample"),
    ([("(rate.x - p.x * over * rate.z)", "(rate.x - p.x * over)")], "supersample"),
    ([("2.0 * nl * nv - lv", "2.0 * nl * nv + lv")], "supersample"),
    ([("2.0 * (length - 0.72)", "1.5 * (length - 0.72)")], "supersample"),
    ([("* (xx - zz)", "* (xx + zz)")], "supersample"),
    ([("first < NONE), 1.0", "first <= NONE), 1.0")], "supersample"),
    ([("* min((*sum).sample_coverage, Floats(1.0))", "* (*sum).sample_coverage")], "bucket"),
    ([("Share(sums[sum_at + (SAMPLE_COVERAGE + 1u)", "Share(sums[sum_at + (SAMPLE_COVERAGE + 0u)")], "bucket"),
    (
        [("(*sum).static_coverage = (*sum).sample_coverage", "(*sum).static_coverage = 0.0 * (*sum).sample_coverage")],
        "bucket",
    ),
    (
        [("(*sum).sample_coverage = (*sum).static_coverage", "(*sum).sample_coverage = 0.0 * (*sum).static_coverage")],
        "bucket",
    ),
    ([("min(r2d, r3d)", "r3d")], "supersample"),
    ([("at.scaled_r2 * (depth * depth), Floats", "at.scaled_r2 * depth, Floats")], "plain"),
    // What surfaces mirror.
    ([("twice * n - eye", "twice * n + eye")], "supersample"),
    ([("0.5 * (view.pixel * view.pixel)", "0.05 * (view.pixel * view.pixel)")], "supersample"),
    ([("f32(1u << (2u * doublings))", "f32(1u << doublings)")], "supersample"),
    ([("before += 6u * its_side", "before += 5u * its_side")], "supersample"),
    ([("select(0u, 1u, towards[axis] < 0.0)", "0u")], "supersample"),
    ([("towards.x * turn.x - towards.z * turn.y", "towards.x * turn.x + towards.z * turn.y")], "supersample"),
    ([("pixel ^ vec2<u32>(0u, 1u)", "pixel")], "supersample"),
    ([("has_sums && sums[at] > 0.0", "has_sums")], "supersample"),
    ([("var reflection = view.environment.w", "var reflection = 0.0")], "plain"),
    ([("pixel * pixel) * segment.normal[1].w", "pixel * pixel)")], "gouraud"),
    (
        [("thresholds[depths_of(index) + i] = Floats(UNWANTED)", "thresholds[depths_of(index) + i] = Floats(NONE)")],
        "in part",
    ),
    ([("!is_wide && is_wanted(vec2<u32>(x, y))", "!is_wide")], "in part"),
    ([("if is_wide && is_wanted_block", "if !is_wide && is_wanted_block")], "in part, hard"),
    // Strips that are read out.
    ([("c += lands.time * motion;", "c += 0.9 * lands.time * motion;")], "rolling"),
    ([("u += lands.time *", "u -= lands.time *")], "rolling"),
    ([("own.y + landing.across * along", "own.y")], "rolling"),
    ([("- recede.y;", ";")], "rolling"),
    ([("turned_normal += time *", "turned_normal -= time *")], "rolling"),
    ([("1.0 - velocity.x", "1.0 + velocity.x")], "rolling"),
    ([("reference += lands.shift", "reference -= lands.shift")], "rolling"),
];

/// What the programs that work by pixels have for themselves.
static BY_PIXELS: [Mutant; 8] = [
    ([("before + lane < entries", "before + lane + 1u < entries")], "supersample"),
    ([("before += AT_ONCE", "before += 2u * AT_ONCE")], "supersample"),
    ([("1u << (k % 32u)", "1u << (k % 16u)")], "supersample"),
    ([("WORDS + k / 32u", "WORDS")], "supersample"),
    ([("let k = 32u * word + firstTrailingBit(left)", "let k = firstTrailingBit(left)")], "supersample"),
    ([("least = middle + 1u", "least = middle + 2u")], "hard"),
    ([("slot = min(slot, wide", "slot = max(slot, wide")], "hard"),
    ([("lane % PANEL_COLUMNS, ", "lane % PANEL_ROWS, ")], "supersample"),
];

#[test]
#[ignore = "deep: broken programs"]
fn broken_programs_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_programs_are_noticed") else { return };
    let cases = cases::all();
    gpu.state.device.form.lanes = Lanes::Quads;
    all_are_noticed(&mut gpu, &MUTANTS, |gpu, name| paint::check(gpu, named(&cases, name)));
    gpu.state.device.form.lanes = Lanes::Pixels;
    all_are_noticed(&mut gpu, &BY_PIXELS, |gpu, name| paint::check(gpu, named(&cases, name)));
}

/// Other roundings, such as a driver may choose: one unit in the last place more, where sums may cancel.
static ROUNDED: [(&str, &str); 15] = [
    ("m[0].y * p.y", "1.0000001 * m[0].y * p.y"),
    ("u.x - x * u.z", "u.x - 1.0000001 * x * u.z"),
    ("u.y - y * u.z", "u.y - 1.0000001 * y * u.z"),
    ("v.x - x * v.z", "v.x - 1.0000001 * x * v.z"),
    ("v.y - y * v.z", "v.y - 1.0000001 * y * v.z"),
    ("ux * vy - uy * vx", "1.0000001 * ux * vy - uy * vx"),
    ("(uy * v.z - u.z * vy)", "(1.0000001 * uy * v.z - u.z * vy)"),
    ("splat.inverse_depth[0] * out.x", "1.0000001 * splat.inverse_depth[0] * out.x"),
    ("splat.u[0] * out.x", "1.0000001 * splat.u[0] * out.x"),
    ("splat.v[1] * out.y", "1.0000001 * splat.v[1] * out.y"),
    ("out.u * out.u + out.v * out.v;", "1.0000001 * out.u * out.u + out.v * out.v;"),
    ("plane_depth = 1.0 / at", "plane_depth = 1.0000001 / at"),
    ("p = p * y + 0.18394206", "p = 1.0000001 * p * y + 0.18394206"),
    ("(*sum).red += weight * values[next]", "(*sum).red += 1.0000001 * weight * values[next]"),
    ("2.0 * nl * nv - lv", "2.0000002 * nl * nv - lv"),
];

/// The other side of the tolerance: what a device may do passes.
#[test]
#[ignore = "deep: other programs"]
fn programs_that_round_otherwise_pass() {
    let Some(mut gpu) = gpu_or_skip("programs_that_round_otherwise_pass") else { return };
    gpu.state.pipelines = gpu.state.pipelines.with(&ROUNDED);
    for (from, _) in ROUNDED {
        assert!(Variant::all().iter().any(|variant| variant.wgsl().contains(from)), "no program holds `{from}`");
    }
    for case in cases::all() {
        eprintln!("{}:", case.name);
        paint::check(&mut gpu, &case).unwrap_or_else(|what| panic!("{what}"));
    }
}
