//! Shadow maps: whole frames against the CPU's, in rounds, batches and bands.

use glam::{DVec3, Quat, Vec3};

use super::captures::{cloud, volume};
use super::cases::{Case, ball, object, scene, surroundings};
use super::gpu_or_skip;
use super::mutants::{Mutant, all_are_noticed, named};
use super::pictures::{look_the_same, render};
use crate::backend::BackendError;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::Gpu;
use crate::model::{Gaussians, Surfels};
use crate::options::{Look, Prefilter, RenderOptions, Shading};
use crate::renderer::render_checked;
use crate::scene::{Light, Motion, Object, Scene, Shape};
use crate::time::FrameNumber;

/// A disc that faces up.
fn disc(radius: f32) -> Surfels {
    let mut disc = Surfels::default();
    disc.position.push(Vec3::ZERO);
    disc.axis_u.push(radius * Vec3::Z);
    disc.axis_v.push(radius * Vec3::X);
    disc.normal.push(Vec3::Y);
    disc.colour.push(Vec3::ONE);
    disc
}

/// A disc as the floor, and two balls, one of which moves.
fn balls() -> Scene {
    let mut moving = object(ball(900, 1, true), DVec3::new(-0.6, 0.0, -1.5));
    moving.transform.scale = DVec3::splat(0.6);
    moving.motions = vec![Motion::Linear { velocity: DVec3::new(0.3, 0.1, 0.2) }];
    let mut still = object(ball(2000, 2, false), DVec3::new(0.6, 0.1, -2.0));
    still.transform.scale = DVec3::splat(0.7);
    let mut scene = scene(vec![object(disc(6.0), DVec3::new(0.0, -0.8, -2.0)), moving, still], [96, 72]);
    scene.camera.eye = DVec3::new(0.0, 1.5, 2.0);
    scene.camera.at = DVec3::new(0.0, -0.3, -1.8);
    scene
}

/// Flat Gaussians in the place of the floor: 24 in a row, in colours of a display.
fn capture() -> Gaussians {
    let mut floor = Gaussians::default();
    for i in 0..24 * 24 {
        let [x, z] = [i % 24, i / 24].map(|k| (k as f32 - 11.5) * 0.15);
        floor.position.push(Vec3::new(x, 0.02 * ((i * 7) % 5) as f32, z));
        floor.sigma.push(Vec3::new(0.1, 0.005, 0.12));
        floor.rotation.push(Quat::from_rotation_y(0.1 * i as f32));
        floor.opacity.push(0.9);
        floor.base.push(Vec3::new(0.8, 0.3, -0.2));
    }
    floor
}

/// The case of a name.
fn case_of<'a>(cases: &'a mut [Case], name: &str) -> &'a mut Case {
    cases.iter_mut().find(|case| case.name == name).unwrap()
}

fn cases() -> Vec<Case> {
    let sun = Light::directional(DVec3::new(-0.5, -1.0, -0.3).normalize(), DVec3::splat(0.6));
    let lamp = Light::point(DVec3::new(0.3, 1.2, -1.0), DVec3::splat(0.8));
    let fill = Light::Ambient { colour: DVec3::splat(0.2) };
    let in_mode = |name, mode: &str, lights: &[Light], shading, prefilter| {
        let mut scene = balls();
        scene.lights = lights.to_vec();
        let quality = mode.parse().unwrap();
        let options =
            RenderOptions { quality, prefilter, look: Look { shading, ..Look::default() }, ..RenderOptions::default() };
        Case { name, scene, options, in_part: false }
    };
    let case = |name, lights: &[Light], shading, prefilter| in_mode(name, "supersample:3", lights, shading, prefilter);
    let swept = |name, mode, shading, prefilter| in_mode(name, mode, &[fill, sun, lamp], shading, prefilter);
    let mut cases = vec![
        case("sun", &[sun], Shading::Phong, Prefilter::None),
        case("lamp", &[lamp], Shading::Phong, Prefilter::None),
        case("both", &[fill, sun, lamp], Shading::Phong, Prefilter::Approx),
        case("surfels", &[fill, sun, lamp], Shading::Gouraud, Prefilter::None),
        case("filtered", &[lamp, fill, sun], Shading::Phong, Prefilter::Ewa),
        case("glass", &[sun, lamp], Shading::Phong, Prefilter::None),
        case("wide", &[sun], Shading::Phong, Prefilter::None),
        case("capture", &[fill, sun, lamp], Shading::Phong, Prefilter::None),
        case("capture, bucket", &[fill, lamp], Shading::Phong, Prefilter::Ewa),
        case("catcher", &[fill, sun, lamp], Shading::Phong, Prefilter::None),
        case("deaf", &[sun, lamp], Shading::Phong, Prefilter::Ewa),
        case("deaf surfels", &[sun, lamp], Shading::Gouraud, Prefilter::None),
        case("sky", &[], Shading::Phong, Prefilter::None),
        case("layers", &[lamp, sun], Shading::Phong, Prefilter::None),
        case("casting capture", &[lamp, sun], Shading::Phong, Prefilter::None),
        case("casting volume", &[sun, lamp], Shading::Phong, Prefilter::None),
        case("both captures", &[fill, sun, lamp], Shading::Phong, Prefilter::None),
        in_mode("lit volume", "bucket:2x3", &[fill, lamp, sun], Shading::Phong, Prefilter::None),
        in_mode("layers, surfels", "bucket:2x3", &[fill, sun, lamp], Shading::Gouraud, Prefilter::None),
        case("deaf glass", &[sun, lamp], Shading::Phong, Prefilter::None),
    ];
    for (name, motion) in [("capture", DVec3::ZERO), ("capture, bucket", DVec3::new(0.1, 0.0, 0.3))] {
        let case = case_of(&mut cases, name);
        case.scene.objects[0] = object(capture(), DVec3::new(0.0, -0.8, -1.6));
        case.scene.objects[0].motions = vec![Motion::Linear { velocity: motion }];
    }
    let in_bucket = case_of(&mut cases, "capture, bucket");
    in_bucket.options.quality = "bucket:2x3".parse().unwrap();
    // Light without shadows from all around is a part of all light.
    in_bucket.scene.environment = Some(surroundings());
    case_of(&mut cases, "catcher").scene.objects[0].shadow_catcher = true;
    for name in ["deaf", "deaf surfels"] {
        case_of(&mut cases, name).scene.objects[0].receive_shadows = false;
    }
    // Of a sky a catcher needs the light of all directions.
    let sky = case_of(&mut cases, "sky");
    sky.scene.objects[0].shadow_catcher = true;
    sky.scene.environment = Some(surroundings().lighting());
    // Some of so many directions come from above.
    sky.options.quality = "supersample:12".parse().unwrap();
    cases.extend([
        swept("swept", "volumetric:3", Shading::Phong, Prefilter::None),
        swept("swept, filtered", "volumetric:2+kernel=ellipsoid", Shading::Gouraud, Prefilter::Ewa),
        swept("swept, once", "volumetric:2+normalise=once", Shading::Phong, Prefilter::None),
        swept("published", "volumetric:3+published", Shading::Phong, Prefilter::Approx),
        swept("line", "volumetric:2+kernel=ellipsoid+kernel-weight=line", Shading::Gouraud, Prefilter::None),
    ]);
    let held = |name, mode, shading, blurs: [bool; 3]| {
        let mut case = in_mode(name, mode, &[fill, sun, lamp], shading, Prefilter::None);
        case.scene.camera.motions = vec![
            Motion::Rotation { axis: DVec3::new(0.2, 1.0, 0.1).normalize(), per_frame: 0.1, centre: DVec3::ZERO },
            Motion::Linear { velocity: DVec3::new(0.2, 0.1, -0.1) },
        ];
        case.scene.objects.iter_mut().zip(blurs).for_each(|(object, blurs)| object.blur = blurs);
        case
    };
    cases.extend([
        held("bucket", "bucket:2x3", Shading::Phong, [true; 3]),
        held("surfels, bucket", "bucket:2x4", Shading::Gouraud, [true; 3]),
        held("held", "supersample:2", Shading::Phong, [false, true, true]),
        held("held, all", "supersample:2", Shading::Phong, [false; 3]),
        held("held glass", "supersample:2", Shading::Phong, [false, true, true]),
        held("held, surfels", "bucket:2x3", Shading::Gouraud, [false, true, false]),
        held("held, swept", "volumetric:2", Shading::Gouraud, [true, false, true]),
    ]);
    let mut rolling = in_mode("rolling", "supersample:2", &[fill, sun, lamp], Shading::Phong, Prefilter::None);
    rolling.scene.shutter.readout = "0.9".parse().unwrap();
    for (object, velocity) in [(1, DVec3::new(1.2, 0.5, 0.0)), (2, DVec3::new(-0.8, 1.2, 0.0))] {
        rolling.scene.objects[object].motions = vec![Motion::Linear { velocity }];
    }
    cases.push(rolling);
    // Turns by much within a bucket.
    case_of(&mut cases, "surfels, bucket").scene.objects[1].motions.insert(
        0,
        Motion::Rotation { axis: DVec3::new(0.3, 1.0, 0.5).normalize(), per_frame: 2.0, centre: DVec3::ZERO },
    );
    add_casters(&mut cases);
    // A disc alone, whose rim no other covers.
    let wide = &mut case_of(&mut cases, "wide").scene;
    wide.objects[1] = object(disc(0.9), DVec3::new(0.3, 0.1, -1.8));
    (wide.image.width, wide.image.height) = (240, 180);
    cases
}

/// What light passes through throws shadows in some cases.
fn add_casters(cases: &mut [Case]) {
    for (name, opacities) in [
        ("glass", [1.0, 0.5, 1.0]),
        ("layers, surfels", [1.0, 0.4, 0.7]),
        ("deaf glass", [1.0, 0.5, 0.6]),
        ("held glass", [0.9, 0.5, 0.6]),
    ] {
        let objects = &mut case_of(cases, name).scene.objects;
        objects.iter_mut().zip(opacities).for_each(|(object, opacity)| object.opacity = opacity);
    }
    case_of(cases, "deaf glass").scene.objects[1].receive_shadows = false;
    // A volume on which a ball and a capture throw shadows, and each of its Gaussians.
    let objects = &mut case_of(cases, "lit volume").scene.objects;
    objects[1].shape = volume(200, 5, 0.1, true).into();
    objects[2].transform.translate = DVec3::new(-0.4, 1.0, -1.2);
    objects[2].transform.scale = DVec3::splat(0.3);
    let mut above = Object::new(Shape::from(cloud(200, 4, 0, true)));
    above.transform.translate = DVec3::new(-0.7, 0.7, -1.5);
    above.transform.scale = DVec3::splat(0.4);
    objects.push(above);
    // A ball of surfels that have their own opacities, in the light of a point, and two objects that cast nothing.
    let layers = &mut case_of(cases, "layers").scene.objects;
    let mut own = ball(300, 1, true);
    own.opacity = (0..300).map(|i| 0.1 + 0.09 * (7 * i % 10) as f32).collect();
    layers[1] = Object { opacity: 0.9, motions: layers[1].motions.clone(), ..object(own, DVec3::new(-0.6, 0.2, -1.5)) };
    layers[0].cast_shadows = false;
    layers[2].cast_shadows = false;
    // A capture and a volume in motion beside a ball, above the floor.
    for (name, lit) in [("casting capture", false), ("casting volume", true)] {
        let objects = &mut case_of(cases, name).scene.objects;
        objects[1].shape = if lit { volume(200, 5, 0.1, true) } else { cloud(200, 4, 0, true) }.into();
        objects[1].transform.translate.y = 0.4;
        objects[1].opacity = 0.8;
        let (Shape::Gaussians { model, .. } | Shape::Volume { model, .. }) = &mut objects[1].shape else { panic!() };
        model.crop = Some([DVec3::new(-0.9, -0.9, -0.9), DVec3::new(0.9, 0.8, 0.9)]);
    }
    // A capture on which a ball, see-through, and a volume throw shadows, but no capture; all of them before a floor.
    let objects = &mut case_of(cases, "both captures").scene.objects;
    objects[2].opacity = 0.6;
    objects.push(object(capture(), DVec3::new(0.0, -0.7, -1.6)));
    for (x, shape) in [(-0.7, Shape::from(cloud(200, 4, 0, true))), (0.2, volume(100, 5, 0.1, true).into())] {
        let mut above = Object::new(shape);
        above.transform.translate = DVec3::new(x, 0.3, -1.2);
        above.transform.scale = DVec3::splat(0.6);
        objects.push(above);
    }
}

/// The device's picture of a case against the CPU's.
fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let want = render(&mut Cpu::default(), case).picture;
    look_the_same(case.name, &render(gpu, case).picture, &want)
}

/// Shadows are the CPU's, and the same bytes in rounds of one group, in batches, and, in cases of each kind, in as
/// little memory as will do, which takes several times as long.
#[test]
fn shadows_are_the_cpus() {
    let Some(mut gpu) = gpu_or_skip("shadows_are_the_cpus") else { return };
    let (mut alone, mut batches) = (gpu.beside(), gpu.beside());
    (alone.most_groups, batches.most_slots) = (1, 1000);
    for case in cases() {
        check(&mut gpu, &case).unwrap_or_else(|what| panic!("{what}"));
        let whole = render(&mut gpu, &case).picture;
        assert_eq!(render(&mut alone, &case).picture, whole, "{}: rounds of one group", case.name);
        assert_eq!(render(&mut batches, &case).picture, whole, "{}: batches", case.name);
        if !["lamp", "filtered", "capture, bucket", "layers", "casting volume", "held, surfels"].contains(&case.name) {
            continue;
        }
        let mut least = case.clone();
        least.options.memory = 1;
        let refused = render_checked(&mut gpu, &least.scene, FrameNumber::from(0), &least.options);
        let Err(BackendError::Memory { needed, .. }) = refused else { panic!("one byte is enough") };
        least.options.memory = needed;
        assert_eq!(render(&mut gpu, &least).picture, whole, "{}: {needed} bytes", case.name);
    }
}

static MUTANTS: [Mutant; 57] = [
    ([("select(t - below, below - t", "select(t - below, t - below")], "casting volume"),
    ([("(dot3(seen, x) / root)", "(-dot3(seen, x) / root)")], "lit volume"),
    ([("w) - 1u, place, false)", "w) - 1u, place, true)")], "lit volume"),
    ([("light.colour.w == 0.0 { return 1.0; }", "light.colour.w >= 0.0 { return 1.0; }")], "glass"),
    ([("if is_lit(light, place, false) { mask |=", "if !is_lit(light, place, false) { mask |=")], "layers, surfels"),
    ([("sums[sum_at + HELD * TILE_PIXELS] * inverse > 0.5", "false")], "held glass"),
    ([("raise(map + 4u, ~key_of(depth))", "raise(map + 4u, ~key_of(9.0 * depth))")], "capture"),
    ([("taken += radiance", "taken += 0.5 * radiance")], "capture"),
    ([("from_linear(left * to_linear(shown))", "left * shown")], "capture"),
    ([("4.0 * light.colour.xyz", "light.colour.xyz")], "capture, bucket"),
    ([("return 1.0 - receives * (1.0 - seen)", "return seen")], "deaf"),
    ([("(shadows >> 1u)", "(shadows >> 2u)")], "catcher"),
    ([("- 1u, place, true)", "- 1u, place, false)")], "both captures"),
    ([("CAPTURE_WORD == 0u || of_capture", "true")], "casting capture"),
    ([("at = texel + CAPTURE_WORD * room(); }", "at = texel; }")], "both captures"),
    ([("end < others", "end > others")], "sun"),
    ([("there, number + 1u)", "there, number)")], "sun"),
    ([("max(segment.epsilon, rounding) / cosine", "0.0 / cosine")], "sun"),
    ([("a * a + b * b <= 1.0", "a * a + b * b <= 0.5")], "wide"),
    ([("a * a + b * b <= w * w", "a * a + b * b <= 0.8 * w * w")], "lamp"),
    ([("select(4u, 5u, p.z < 0.0)", "select(5u, 4u, p.z < 0.0)")], "lamp"),
    ([("plane.w + rounding >= 0.0", "rounding >= 0.0")], "sun"),
    ([("1.0 + tolerance / distance", "1.0 - tolerance / distance")], "lamp"),
    ([("it.low - of_light.jitter * texel", "it.low - 9.0 * of_light.jitter * texel")], "sun"),
    ([("vec2<u32>(FEW, MANY), lane", "vec2<u32>(FEW, FEW), lane")], "both"),
    ([("lights[slice_at(light, face, slice)]", "lights[slice_at(light, face, 0u)]")], "sun"),
    ([("opacity / least", "2.0 * opacity / least")], "casting capture"),
    ([("depth / least", "2.0 * depth / least")], "casting volume"),
    ([("segment.rate[1].xyz", "-segment.rate[0].xyz")], "casting capture"),
    ([("mixed(segment.buffer_start + index)", "mixed(index + 1u)")], "casting capture"),
    ([("segment.normal[1].w / (TAU", "1.0 / (TAU")], "casting volume"),
    ([("up * (xy / root)", "up * (-xy / root)")], "casting capture"),
    ([("chance < casters", "chance < 0.9 * casters")], "layers"),
    ([("before + 1u", "before + 0u")], "layers"),
    ([("end - moved, end * moved", "end, end")], "layers"),
    ([("!(distance > end_of", "(distance > end_of")], "layers"),
    ([("looks[before + segment", "looks[before + 1u + segment")], "layers"),
    ([("segment.normal[0].w * own", "own")], "glass"),
    ([("segment.flags & CASTS", "segment.flags | CASTS")], "layers"),
    ([("(segment.flags & IS_RECEIVER) == 0u", "(segment.flags & IS_RECEIVER) != 0u")], "layers"),
    ([("(view.number * SHADOW_LIGHTS + light) * view.casters", "light * view.casters")], "sun"),
    ([("(view.number * SHADOW_LIGHTS + light) * (FACES", "light * (FACES")], "sun"),
    ([("u32(light.colour.w) - 1u, in_world", "0u, in_world")], "both"),
    ([("(number % LIGHTS_OF_MASK)) & 1u", "((number + 1u) % LIGHTS_OF_MASK)) & 1u")], "surfels"),
    ([("if is_lit(light, place, false) { mask |=", "if !is_lit(light, place, false) { mask |=")], "surfels"),
    ([("at - high * depth > radius", "at - high * depth > -9.0 * radius")], "sun"),
    ([("normal.z * towards.z > 0.0", "normal.z * towards.z > 0.3")], "both"),
    ([("(2u + DEPTH_SLICES) * (light * FACES + face)", "(2u + DEPTH_SLICES) * (light * FACES)")], "lamp"),
    ([("if is_lit(light, place, false) { mask |=", "if !is_lit(light, place, false) { mask |=")], "swept"),
    ([("if is_lit(light, place, false) { mask |=", "if !is_lit(light, place, false) { mask |=")], "published"),
    ([("segment = segments[segment.middle]", "segment = segments[segment.index]")], "surfels, bucket"),
    ([("apply_linear(now, centre) + origin", "apply(now, centre)")], "surfels, bucket"),
    ([("sums[sum_at + HELD * TILE_PIXELS] * inverse > 0.5", "false")], "held"),
    ([("if !is_held { return place; }", "if is_held { return place; }")], "held, all"),
    ([("f32(shadows >> 2u)", "0.0")], "held"),
    ([("let place = shown + moved;", "let place = shown;")], "rolling"),
    ([("let m = -time * (", "let m = time * (")], "rolling"),
];

#[test]
#[ignore = "deep: broken programs"]
fn broken_shadows_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("broken_shadows_are_noticed") else { return };
    let cases = cases();
    all_are_noticed(&mut gpu, &MUTANTS, |gpu, name| check(gpu, named(&cases, name)));
}
