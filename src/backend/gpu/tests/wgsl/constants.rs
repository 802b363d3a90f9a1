//! Constants have the same value on both sides.

use std::collections::{BTreeMap, BTreeSet};
use std::f32::consts::SQRT_2;
use std::mem::offset_of;

use naga::{Expression, Handle, Literal, Module};

use super::{defined, module};
use crate::backend::cpu::bounds::{HALF_SIDE, OCTAGON, ROUNDING, SLACK, SLACK_SHARE};
use crate::backend::cpu::depths::LEAST_EPSILON;
use crate::backend::cpu::land::LEAST_SPEED;
use crate::backend::cpu::paint::buffers::DepthLayer;
use crate::backend::cpu::project::{CROSSING, CULLED, ORDINARY};
use crate::backend::cpu::published::ray::FAR;
use crate::backend::cpu::resolve::ALL_CAUGHT;
use crate::backend::cpu::shadows::GRAZING;
use crate::backend::cpu::shadows::centres::REACH_OF_CENTRE;
use crate::backend::cpu::shadows::fit::{GROWTH, MOST_SIDE, MOST_TRIES, SLICES};
use crate::backend::cpu::shadows::splats::{LEAST_ALPHA, LEAST_TAIL};
use crate::backend::cpu::shadows::view::BEYOND_FACE;
use crate::backend::cpu::swept::attribute::HIDDEN;
use crate::backend::cpu::swept::hull::HULL_SLACK;
use crate::backend::cpu::swept::project::REACH;
use crate::backend::cpu::swept::resolve::NOISE;
use crate::backend::cpu::tiles::LANES;
use crate::backend::cpu::transparent::accumulators::OPAQUE;
use crate::backend::cpu::transparent::composite::MOST_ALPHA;
use crate::backend::cpu::transparent::project::{
    FAINTEST, FAINTEST_DEPTH, HALF_LOG2_E, LEAST_REACH, MOST_BEND, MOST_DEPTH,
};
use crate::backend::gpu::layout::{
    AMBIENT, DIGIT_BITS, DIRECTIONAL, FLAG_ANTIALIAS, FLAG_ENCODE, FLAG_KEEP_LAYER, FLAG_LIT, FLAG_RECEIVES,
    FLAG_VOLUME, HARMONIC_RECORDS, HARMONICS, IN_STRETCHES, IS_REST, LARGE_GPU, LAST_SLAB, LISTS_ALONE, OPAQUE_SURFELS,
    SEE_THROUGH_SURFELS, SHARES_TILES, Status, TILE, VIEWS, WIDEST, WORKGROUP_ITEMS, WORKGROUPS,
};
use crate::backend::gpu::memory::MASKS;
use crate::backend::gpu::passes::Variant;
use crate::backend::gpu::shadow_sizes::{DRAWING, LAYERS_SHIFT, LIGHTS_OF_MASK, MAP_WORDS};
use crate::backend::gpu::shadows::{
    ARE_SPLATS, CASTS, HAS_MATERIALS, HAS_OPACITIES, IS_RECEIVER, IS_VOLUME, SEE_THROUGH,
};
use crate::environment::cube::{DEVIATION, LAST_FACE};
use crate::film::{Aov, FilmPlanes};
use crate::frame::Blocks;
use crate::layout::{FLAG_BACK, FLAG_CROSSING, FLAG_LOW_PASS};
use crate::math::fast::ROUND;
use crate::math::sweep::{ELLIPSOID_PEAK, HALF_SQRT_PI, LINE_PEAK, SQRT_HALF_PI, UNMOVED};

/// The bits of a constant, number by number.
type Bits = Vec<u32>;

fn float(value: f32) -> Bits {
    vec![value.to_bits()]
}

fn whole(value: impl TryInto<u32>) -> Bits {
    vec![value.try_into().ok().unwrap()]
}

/// Facts that programs and the host share: the name in WGSL, and the value of the host.
fn shared() -> Vec<(&'static str, Bits)> {
    let of_status = |offset: usize| whole(offset / size_of::<u32>());
    vec![
        ("ALL_CAUGHT", float(ALL_CAUGHT)),
        ("AMBIENT", float(AMBIENT)),
        ("BAND", whole(DepthLayer::Band as u32)),
        ("BEYOND_FACE", float(BEYOND_FACE)),
        ("BLOCK", whole(Blocks::EDGE)),
        ("CROSSING", whole(CROSSING)),
        ("CULLED", whole(CULLED)),
        ("DEPTH_SLICES", whole(SLICES)),
        ("DEVIATION", float(DEVIATION)),
        ("DIGITS", whole(1_u32 << DIGIT_BITS)),
        ("DIRECTIONAL", float(DIRECTIONAL)),
        ("DRAWING", whole(DRAWING)),
        ("ELLIPSOID_PEAK", float(ELLIPSOID_PEAK)),
        ("EPSILON", float(f32::EPSILON)),
        ("FAINTEST_DEPTH", float(FAINTEST_DEPTH)),
        ("FAR", float(FAR)),
        ("FLAG_ANTIALIAS", whole(FLAG_ANTIALIAS)),
        ("FLAG_BACK", whole(FLAG_BACK)),
        ("FLAG_CROSSING", whole(FLAG_CROSSING)),
        ("FLAG_ENCODE", whole(FLAG_ENCODE)),
        ("FLAG_KEEP_LAYER", whole(FLAG_KEEP_LAYER)),
        ("FLAG_LIT", whole(FLAG_LIT)),
        ("FLAG_LOW_PASS", whole(FLAG_LOW_PASS)),
        ("FLAG_RECEIVES", whole(FLAG_RECEIVES)),
        ("FLAG_VOLUME", whole(FLAG_VOLUME)),
        ("FRONT", whole(DepthLayer::Front as u32)),
        ("GRAZING", float(GRAZING)),
        ("HALF_LOG2_E", float(HALF_LOG2_E)),
        ("HARMONICS", float(HARMONICS)),
        ("HARMONIC_RECORDS", whole(HARMONIC_RECORDS)),
        ("HALF_SIDE", float(HALF_SIDE)),
        ("HALF_SQRT_PI", float(HALF_SQRT_PI)),
        ("HIDDEN", float(HIDDEN)),
        ("HULL_SLACK", float(HULL_SLACK)),
        ("LARGE_GPU", float(LARGE_GPU)),
        ("LAST_FACE", whole(LAST_FACE)),
        ("LEAST_EPSILON", float(LEAST_EPSILON)),
        ("LEAST_NORMAL", float(f32::MIN_POSITIVE)),
        ("LEAST_REACH", float(LEAST_REACH)),
        ("LEAST_SPEED", float(LEAST_SPEED)),
        ("LEFT_OUT_HIGH", of_status(offset_of!(Status, left_out_high))),
        ("LEFT_OUT_LOW", of_status(offset_of!(Status, left_out_low))),
        ("IS_RECEIVER", whole(IS_RECEIVER)),
        ("HAS_MATERIALS", whole(HAS_MATERIALS)),
        ("HAS_OPACITIES", whole(HAS_OPACITIES)),
        ("CASTS", whole(CASTS)),
        ("SEE_THROUGH", whole(SEE_THROUGH)),
        ("ARE_SPLATS", whole(ARE_SPLATS)),
        ("IS_VOLUME", whole(IS_VOLUME)),
        ("LAYERS_SHIFT", whole(LAYERS_SHIFT)),
        ("LEAST_ALPHA", float(LEAST_ALPHA)),
        ("LEAST_TAIL", float(LEAST_TAIL)),
        ("LOG2_E", float(std::f32::consts::LOG2_E)),
        ("TAU", float(std::f32::consts::TAU)),
        ("LIGHTS_OF_MASK", whole(LIGHTS_OF_MASK)),
        ("LINE_PEAK", float(LINE_PEAK)),
        ("LOG2_FAINTEST", float(FAINTEST.log2())),
        ("MAP_WORDS", whole(MAP_WORDS)),
        ("MASKS", whole(MASKS)),
        ("MOST_ALPHA", float(MOST_ALPHA)),
        ("MOST_BEND", float(MOST_BEND)),
        ("MOST_DEPTH", float(MOST_DEPTH)),
        ("NOISE", float(NOISE)),
        ("OCTAGON", OCTAGON.as_flattened().iter().map(|number| number.to_bits()).collect()),
        ("OPAQUE", float(OPAQUE)),
        ("OPAQUE_SURFELS", whole(OPAQUE_SURFELS)),
        ("ORDINARY", whole(ORDINARY)),
        ("REACH", float(REACH)),
        ("REACH_OF_CENTRE", float(REACH_OF_CENTRE)),
        ("REST", whole(DepthLayer::Rest as u32)),
        ("ROUND", float(ROUND)),
        ("ROW_END", float(LANES as f32)),
        ("ROUNDING", float(ROUNDING)),
        ("SECOND", whole(DepthLayer::Second as u32)),
        ("SEE_THROUGH_SURFELS", whole(SEE_THROUGH_SURFELS)),
        ("LAST_SLAB", whole(LAST_SLAB)),
        ("IS_REST", whole(IS_REST)),
        ("IN_STRETCHES", whole(IN_STRETCHES)),
        ("LISTS_ALONE", whole(LISTS_ALONE)),
        ("GROWTH", float(GROWTH as f32)),
        ("MOST_SIDE", float(MOST_SIDE as f32)),
        ("MOST_TRIES", whole(MOST_TRIES)),
        ("MOST_PLANES", whole(FilmPlanes::of(&Aov::ALL).pooled().count)),
        ("SHARES_TILES", whole(SHARES_TILES)),
        // The bits of flags above all that kernels in motion have.
        ("SEGMENT_SHIFT", whole((FLAG_BACK | FLAG_LOW_PASS | FLAG_CROSSING).trailing_ones())),
        ("SLACK", float(SLACK)),
        ("SLACK_SHARE", float(SLACK_SHARE)),
        ("SQRT_2", float(SQRT_2)),
        ("SQRT_HALF_PI", float(SQRT_HALF_PI)),
        ("TILE", whole(TILE)),
        ("TILE_PIXELS", whole(TILE * TILE)),
        ("TILE_QUADS", whole(TILE * TILE / 4)),
        ("UNMOVED", float(UNMOVED)),
        ("VIEWS", whole(VIEWS)),
        ("WIDEST", whole(WIDEST)),
        ("WORKGROUPS", whole(WORKGROUPS)),
        ("WORKGROUP_ITEMS", whole(WORKGROUP_ITEMS)),
    ]
}

/// Constants that stand in WGSL alone, each with the reason.
const OF_DEVICE: [(&str, &str); 27] = [
    ("LANES", "invocations of a workgroup by pixels"),
    ("PANEL_LANES", "how a workgroup by pixels parts its tile"),
    ("PANEL_COLUMNS", "how a workgroup by pixels parts its tile"),
    ("PANEL_ROWS", "how a workgroup by pixels parts its tile"),
    ("PANELS", "how a workgroup by pixels parts its tile"),
    ("PANELS_OF_ROW", "how a workgroup by pixels parts its tile"),
    ("CORNER", "word of a map; the CPU has fields"),
    ("END_SLICE", "likewise"),
    ("FEW", "how workgroups part the texels of a surfel"),
    ("FIRST_SLICE", "word of a map; the CPU has fields"),
    ("FIRST_TEXEL", "likewise"),
    ("EDGE", "stride of a tile and its apron in workgroup memory; the CPU's tiles are larger"),
    ("MOST_LAYER", "the last float that a cast holds; casts saturate on the CPU"),
    ("MANY", "how workgroups part the texels of a surfel"),
    ("NONE", "stands for infinity, which WGSL does not promise; the host has infinity"),
    ("NO_LANDING", "the CPU has no branch that would need it: it lands all surfels of a vector"),
    ("OUTSIDE", "mark in workgroup memory"),
    ("PIECE", "how the device parts lists among workgroups"),
    ("PIECES_OF_ROW", "likewise"),
    ("RUN", "how a workgroup counts entries of a list; the CPU sorts them"),
    ("RUNS", "likewise"),
    ("SIZE", "word of a map; the CPU has fields"),
    ("TEXEL", "word of a map; the CPU has fields"),
    ("UNWANTED", "mark in thresholds; the CPU skips pixels that are not wanted"),
    ("TEXELS_IN_USE", "likewise"),
    ("WIDE_CASTERS", "word of a map"),
    ("WIDE", "mark of pass `bin` for its own programs"),
];

/// The constants of a program, by name.
fn constants(module: &Module) -> BTreeMap<String, Bits> {
    let named = module.constants.iter().filter_map(|(_, constant)| Some((constant.name.clone()?, constant.init)));
    named.map(|(name, init)| (name, bits(module, init))).collect()
}

fn bits(module: &Module, expression: Handle<Expression>) -> Bits {
    match &module.global_expressions[expression] {
        Expression::Literal(Literal::F32(value)) => float(*value),
        Expression::Literal(Literal::U32(value)) => vec![*value],
        Expression::Compose { components, .. } => components.iter().flat_map(|&part| bits(module, part)).collect(),
        // As many as the vector has.
        Expression::Splat { size, value } => (0..*size as u32).flat_map(|_| bits(module, *value)).collect(),
        Expression::Constant(constant) => bits(module, module.constants[*constant].init),
        other => panic!("a constant of a kind that this test does not know: {other:?}"),
    }
}

#[test]
fn constants_are_the_hosts() {
    let mut rest: BTreeMap<&str, Bits> = shared().into_iter().collect();
    assert_eq!(rest.len(), shared().len(), "a name stands twice");
    let mut found: BTreeMap<String, Bits> = BTreeMap::new();
    for program in Variant::all() {
        for (name, bits) in constants(&module(program)) {
            let before = found.insert(name.clone(), bits.clone());
            assert!(before.is_none_or(|before| before == bits), "{name} has two values in WGSL");
        }
    }
    let names: BTreeSet<String> = found.keys().cloned().collect();
    assert_eq!(names, defined("const"), "constants of programs, and those of all files");
    for (name, bits) in &found {
        let of_device = OF_DEVICE.iter().any(|(of_device, _)| of_device == name);
        match rest.remove(name.as_str()) {
            Some(hosts) => assert_eq!((*bits == hosts, of_device), (true, false), "{name}: {bits:x?}, {hosts:x?}"),
            None => assert!(of_device, "{name}: pair it with the host's value, or say why it has none"),
        }
    }
    assert!(rest.is_empty(), "no program has {:?}", rest.keys());
    assert!(OF_DEVICE.iter().all(|(name, _)| found.contains_key(*name)), "a constant is listed that is gone");
}
