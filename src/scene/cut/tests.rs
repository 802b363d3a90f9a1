//! Tests of the cut: what motion saves and what it does not, and that it depends on nothing but scene and frame.

use crate::backend::cpu::Cpu;
use crate::compare::gamma_rmse;
use crate::film::{Aov, Picture};
use crate::options::{BlurMode, Detail, Interleave, Look, RenderOptions, Times};
use crate::renderer::{Renderer, render_frame};

use super::*;
use crate::model::{Surfels, VelocityUnit};
use crate::scene::{Light, Motion};
use crate::time::Shutter;

/// Surfels of a plane along each axis, one apart.
const SIDE: usize = 256;
const NUMBER: f64 = 3.0;

/// A plane that faces the camera, with half a surfel in a pixel along each axis; it moves by `path` pixels in the
/// exposure.
fn plane(colour: fn(usize, usize) -> f32, path: DVec3) -> Scene {
    let mut surfels = Surfels::default();
    for i in 0..SIDE * SIDE {
        let (x, y) = (i % SIDE, i / SIDE);
        surfels.position.push(Vec3::new(x as f32 - 0.5 * SIDE as f32, y as f32 - 0.5 * SIDE as f32, 0.0));
        surfels.axis_u.push(Vec3::X * 1.2);
        surfels.axis_v.push(Vec3::Y * 1.2);
        surfels.normal.push(Vec3::Z);
        surfels.colour.push(Vec3::splat(colour(x, y)));
    }
    let mut object = Object::new(surfels.spatially_ordered());
    // Two units are a pixel.
    object.motions = vec![Motion::Linear { velocity: 2.0 * path }];
    let mut scene = Scene::new([object]);
    (scene.image.width, scene.image.height) = (128, 128);
    scene.camera.fovy = 2.0 * libm::atan(0.5);
    (scene.camera.eye, scene.camera.at, scene.camera.up) = (DVec3::Z * 256.0, DVec3::ZERO, DVec3::Y);
    scene.shutter = Shutter { open: -0.5, close: 0.5, ..Shutter::default() };
    scene.lights = vec![Light::Ambient { colour: DVec3::ONE }];
    // The object is where it is built at this frame.
    scene.objects[0].transform.translate = -2.0 * path * NUMBER;
    scene
}

fn noise(x: usize, y: usize) -> f32 {
    let mixed = (x as u32).wrapping_mul(2_654_435_761) ^ (y as u32).wrapping_mul(2_246_822_519);
    0.2 + 0.6 * ((mixed ^ mixed >> 13).wrapping_mul(3_266_489_917) >> 8) as f32 / f32::from(1_u16 << 12).powi(2)
}

fn faint(x: usize, y: usize) -> f32 {
    0.5 + 0.04 * (noise(x, y) - 0.5)
}

/// Stripes of two surfels in height.
fn stripes(_: usize, y: usize) -> f32 {
    if (y / 2).is_multiple_of(2) { 0.2 } else { 0.8 }
}

fn surfels(scene: &Scene, tolerance: CutTolerance) -> usize {
    scene.cut(NUMBER, tolerance, false).scene.objects[0].shape.elements()
}

const TIGHT: CutTolerance = CutTolerance { rest: 0.02, deviation: 10.0 };

#[test]
fn blur_saves_what_it_washes_out() {
    let still = surfels(&plane(noise, DVec3::ZERO), TIGHT);
    let moving = [4.0, 16.0, 64.0].map(|path| surfels(&plane(noise, path * DVec3::X), TIGHT));
    assert!(moving[0] <= still && moving[1] * 3 <= still && moving[2] <= moving[1], "{still} {moving:?}");
    // A row that is read out sees a part of the path.
    let mut rolling = plane(noise, 16.0 * DVec3::X);
    rolling.shutter.readout.duration = 1.0;
    assert!(surfels(&rolling, TIGHT) >= still);
    // A plane of one colour needs next to nothing.
    assert!(surfels(&plane(|_, _| 0.5, DVec3::ZERO), TIGHT) * 50 < SIDE * SIDE);
}

#[test]
fn stripes_along_the_motion_stay() {
    let of = |path: DVec3| surfels(&plane(stripes, path), TIGHT);
    let (still, along, across) = (of(DVec3::ZERO), of(16.0 * DVec3::X), of(16.0 * DVec3::Y));
    assert!(along * 10 > still * 9 && across * 3 <= still, "{still} {along} {across}");
}

/// Two objects whose motion is mirrored in time have the same cut.
#[test]
fn time_has_no_direction() {
    let [there, back] = [16.0, -16.0].map(|path| plane(noise, DVec3::new(path, 0.3 * path, 0.2 * path)));
    assert_eq!(surfels(&there, TIGHT), surfels(&back, TIGHT));
}

#[test]
fn what_rests_for_a_part_of_the_time_keeps_that_part() {
    let moving = [2.0; 8];
    let stops = [2.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0, 0.0];
    let turns = [4.0, 3.0, 2.0, 1.0, 1.0, 2.0, 3.0, 4.0];
    assert!((longest_rest(&moving, 1.0) - 1.0 / 16.0).abs() < 1e-12);
    assert!((longest_rest(&moving, 16.0) - 1.0).abs() < 1e-12 && longest_rest(&moving, 99.0) <= 1.0);
    assert!((longest_rest(&stops, 1.0) - 4.5 / 8.0).abs() < 1e-12, "{}", longest_rest(&stops, 1.0));
    assert!((longest_rest(&turns, 2.0) - 2.0 / 8.0).abs() < 1e-12);
}

#[test]
fn the_cut_follows_distance_and_tolerance() {
    let at = |distance: f64, error: f64| {
        let mut scene = plane(noise, DVec3::ZERO);
        scene.camera.eye = DVec3::Z * 256.0 * distance;
        surfels(&scene, CutTolerance::of(error))
    };
    let good = [0.25, 1.0, 4.0, 16.0].map(|distance| at(distance, 0.025));
    assert!(good[0] == SIDE * SIDE && good.is_sorted_by(|near, far| near >= far), "{good:?}");
    assert!(good[3] * 16 <= good[0], "{good:?}");
    let by_error = [0.4, 0.1, 0.025, 0.0125].map(|error| at(2.0, error));
    assert!(by_error.is_sorted() && by_error[0] < by_error[3], "{by_error:?}");
}

/// An object's own detail holds in place of that of the picture.
#[test]
fn an_object_has_its_own_detail() {
    let of = |detail: Detail| {
        let mut scene = plane(noise, DVec3::ZERO);
        scene.camera.eye = DVec3::Z * 256.0 * 8.0;
        scene.objects[0].detail = detail;
        surfels(&scene, CutTolerance::of(0.025))
    };
    let [draft, good, full] = [Detail::Draft, Detail::Good, Detail::Full].map(of);
    assert!(draft < good && good < full && full == SIDE * SIDE, "{draft} {good} {full}");
    assert_eq!(good, of(Detail::Auto));
}

/// A node around the eye, or partly behind it, is taken apart.
#[test]
fn what_is_at_the_eye_stays_fine() {
    let mut scene = plane(noise, 8.0 * DVec3::X);
    scene.camera.eye = DVec3::new(3.0, 2.0, 0.5);
    scene.camera.at = DVec3::new(3.0, 40.0, 0.0);
    scene.camera.up = DVec3::Z;
    (scene.image.width, scene.image.height) = (16, 16);
    let cut = scene.cut(NUMBER, CutTolerance::of(0.025), false).scene;
    let near = |place: &Vec3| place.truncate().distance(glam::Vec2::new(3.0, 2.0)) < 6.0;
    let count = |scene: &Scene| scene.objects[0].shape.positions().iter().filter(|place| near(place)).count();
    assert_eq!(count(&cut), count(&scene));
    assert!(cut.objects[0].shape.elements() < SIDE * SIDE);
}

/// A thing that is far from the eye may cast a shadow near to it, and is then finer; not where no shadow shows.
#[test]
fn shadows_may_need_more_than_the_eye() {
    let elements = |direction: DVec3, shadows: bool| {
        let mut scene = plane(|_, _| 0.5, DVec3::ZERO);
        // Rough: places do not lie on those of coarser surfels.
        let rough = |i: usize| 3.0 * (noise(i % SIDE, i / SIDE) - 0.5);
        let mut surfels = Surfels::clone(scene.objects[0].shape.surfels().unwrap().surfels());
        (0..).zip(&mut surfels.position).for_each(|(i, place)| place.z = rough(i));
        let far = Object { transform: scene.objects[0].transform, ..Object::new(surfels) };
        let near = Object::new(round(DVec3::new(0.0, 0.0, 3000.0)));
        scene.objects = vec![far, near];
        (scene.camera.eye, scene.camera.at) = (DVec3::Z * 3100.0, DVec3::ZERO);
        scene.lights = vec![Light::directional(direction, DVec3::ONE)];
        scene.cut(NUMBER, CutTolerance::of(0.025), shadows).scene.objects[0].shape.elements()
    };
    let [without, towards, away] = [(DVec3::Z, false), (DVec3::Z, true), (DVec3::NEG_Z, true)]
        .map(|(direction, shadows)| elements(direction, shadows));
    assert!(without * 4 < SIDE * SIDE && towards > 3 * without, "{without} {towards}");
    assert_eq!(away, without);
}

/// A surfel.
fn round(place: DVec3) -> Surfels {
    Surfels {
        position: vec![place.as_vec3()],
        axis_u: vec![Vec3::X],
        axis_v: vec![Vec3::Y],
        normal: vec![Vec3::Z],
        colour: vec![Vec3::ONE],
        ..Surfels::default()
    }
}

#[test]
fn what_has_no_cut_is_as_it_was() {
    let kept = |change: fn(&mut Scene)| {
        let mut scene = plane(noise, DVec3::ZERO);
        scene.camera.eye = DVec3::Z * 1e5;
        change(&mut scene);
        surfels(&scene, CutTolerance::of(0.025)) == SIDE * SIDE
    };
    assert!(!kept(|_| ()));
    let turned = |scene: &mut Scene| {
        // An object that is never seen.
        scene.objects[0].transform.scale = DVec3::ZERO;
    };
    assert!(kept(turned));
}

/// A cut of a cut is the same scene, and two frames with the same nodes share their surfels.
#[test]
fn cuts_are_made_once() {
    let scene = plane(noise, DVec3::ZERO);
    let far = |number: f64| scene.cut(number, CutTolerance::of(0.2), false).scene.into_owned();
    let (one, two) = (far(0.0), far(7.0));
    let surfels = |scene: &Scene| std::sync::Arc::clone(scene.objects[0].shape.surfels().unwrap().surfels());
    assert!(surfels(&one).len() < SIDE * SIDE && std::sync::Arc::ptr_eq(&surfels(&one), &surfels(&two)));
    assert!(matches!(one.cut(0.0, CutTolerance::of(1.0), false).scene, Cow::Borrowed(_)));
}

/// What a cut says of its error is what pictures differ by, within a factor of two: in rest, and where motion leaves
/// little of it. All surfels have none.
#[test]
fn a_cut_knows_its_error() {
    let scenes = [plane(faint, DVec3::ZERO), plane(noise, 64.0 * DVec3::X), plane(faint, 8.0 * DVec3::X)];
    let mut stated = Vec::new();
    for scene in scenes {
        let picture = |detail: Detail| {
            let samples = BlurMode::Supersample {
                samples: 64,
                pixel_samples: None,
                interleave: Interleave::None,
                times: Times::Even,
            };
            let options = RenderOptions { quality: samples.into(), detail, ..RenderOptions::default() };
            render_frame(&mut Cpu::default(), &scene, NUMBER, &options).unwrap()
        };
        let [coarse, full] = [Detail::Draft, Detail::Full].map(picture);
        let error = gamma_rmse(&coarse.picture, &full.picture).unwrap();
        assert_eq!(full.stats.detail, 0.0);
        println!("stated {}, true {error}", coarse.stats.detail);
        assert!((0.5..2.0).contains(&(coarse.stats.detail / error)), "stated {}, true {error}", coarse.stats.detail);
        stated.push(coarse.stats.detail);
    }
    assert!(stated[2] < stated[0], "{stated:?}");
    // What is beside the image, or behind the camera, is not missed.
    let mut scene = plane(faint, DVec3::ZERO);
    let error = |scene: &Scene| scene.cut(NUMBER, CutTolerance::of(0.05), false).errors.whole();
    let whole = error(&scene);
    scene.camera.shift.x = 0.5;
    let half = error(&scene);
    assert!((0.6..0.8).contains(&(half / whole)), "{half} of {whole}");
    scene.camera.shift.x = 1.5;
    assert_eq!(error(&scene), 0.0);
    scene.camera.shift.x = 0.0;
    scene.camera.at = scene.camera.eye + DVec3::Z;
    assert_eq!(error(&scene), 0.0);
}

/// The layer says where detail is missing, in every mode and for every frame of a sequence; mode auto has it in its own
/// estimate, too.
#[test]
fn a_layer_shows_where_detail_is_missing() {
    let half = |x: usize, y: usize| if x < SIDE / 2 { 0.5 + 0.04 * (noise(x, y) - 0.5) } else { 0.5 };
    let scene = plane(half, DVec3::ZERO);
    let options = |quality: &str, aovs: &[Aov]| RenderOptions {
        quality: quality.parse().unwrap(),
        detail: Detail::Draft,
        look: Look { aovs: aovs.to_vec(), ..Look::default() },
        ..RenderOptions::default()
    };
    let plane = |picture: &Picture, aov: Aov| {
        picture.layers.iter().find(|layer| layer.aov == aov).map(|layer| layer.planes[0].clone()).unwrap()
    };
    let mut own = Vec::new();
    for quality in ["supersample:2", "auto:draft"] {
        let options = options(quality, &[Aov::Alpha, Aov::LodError]);
        let made = render_frame(&mut Cpu::default(), &scene, NUMBER, &options).unwrap();
        assert_eq!(made.picture.layers.iter().map(|layer| layer.aov).collect::<Vec<_>>(), options.look.aovs);
        let errors = plane(&made.picture, Aov::LodError);
        let square: f64 = errors.iter().map(|&error| f64::from(error).powi(2)).sum();
        let whole = (square / errors.len() as f64).sqrt();
        assert!(whole > 1e-4 && (whole / made.stats.detail - 1.0).abs() < 1e-5, "{whole} {}", made.stats.detail);
        // Blocks of 32 pixels; the middle runs between the second and the third.
        let [left, right] = [40 * 128 + 40, 40 * 128 + 110].map(|pixel| errors[pixel]);
        assert!(left > 10.0 * right, "{left} {right}");
        own.push(errors);
        let mut renderer = Renderer::open(crate::renderer::Device::Cpu).unwrap();
        let (_, rendered) = renderer.render_sequence(&scene, [NUMBER], &options).next().unwrap().unwrap();
        assert_eq!(plane(&rendered.picture, Aov::LodError), *own.last().unwrap());
    }
    assert_eq!(own[0], own[1]);
    let stated = |detail: Detail| {
        let options = RenderOptions { detail, ..options("auto:draft", &[Aov::Error]) };
        plane(&render_frame(&mut Cpu::default(), &scene, NUMBER, &options).unwrap().picture, Aov::Error)
    };
    let [full, draft] = [Detail::Full, Detail::Draft].map(stated);
    let middle = 40 * 128 + 40;
    assert!(draft[middle] > 0.8 * own[0][middle] && draft[middle] > full[middle], "{} {}", draft[middle], full[middle]);
}

/// The plane with points that move by themselves, in units of a frame, from the frame on.
fn with_velocities(
    colour: fn(usize, usize) -> f32,
    velocity: impl Fn(Vec3) -> Vec3,
    acceleration: impl Fn(Vec3) -> Vec3,
) -> Scene {
    let mut scene = plane(colour, DVec3::ZERO);
    let Shape::Surfels { model, points, .. } = &mut scene.objects[0].shape else { panic!("no surfels") };
    points.at = Some(NUMBER);
    let mut surfels = Surfels::clone(model.surfels());
    surfels.velocity = surfels.position.iter().map(|&place| velocity(place)).collect();
    surfels.acceleration = surfels.position.iter().map(|&place| acceleration(place)).collect();
    surfels.velocity_unit = VelocityUnit::Frame;
    *model = surfels.into();
    scene
}

/// Points that all have one velocity, or one acceleration, are cut as an object that moves so.
#[test]
fn velocities_of_points_are_motion() {
    let still = surfels(&plane(noise, DVec3::ZERO), TIGHT);
    for path in [DVec3::X, DVec3::new(0.3, 0.8, 0.0)].map(|path| 16.0 * path) {
        let by_object = surfels(&plane(noise, path), TIGHT);
        let by_points = surfels(&with_velocities(noise, |_| 2.0 * path.as_vec3(), |_| Vec3::ZERO), TIGHT);
        assert!(by_points == by_object && by_points * 3 <= still, "{by_points} {by_object} {still}");
    }
    // From -.5 to .5 frames they go there and back by an eighth of it.
    let fallen = surfels(&with_velocities(noise, |_| Vec3::ZERO, |_| 2.0 * 128.0 * Vec3::X), TIGHT);
    assert!(fallen * 2 <= still, "{fallen} {still}");
    // Each its own way, by a pixel: no tolerance of .05 pixels holds that.
    let scattered = |place: Vec3| {
        100.0 * Vec3::new(noise((place.x + 128.0) as usize, 3) - 0.5, noise(7, (place.y + 128.0) as usize), 0.0)
    };
    let good = CutTolerance::of(0.025);
    let far = |scene: Scene| {
        let mut scene = scene;
        scene.camera.eye.z *= 8.0;
        surfels(&scene, good)
    };
    assert_eq!(far(with_velocities(faint, scattered, |_| Vec3::ZERO)), SIDE * SIDE);
    assert_eq!(far(with_velocities(faint, |_| Vec3::ZERO, scattered)), SIDE * SIDE);
    assert!(far(with_velocities(faint, |_| Vec3::X, |_| Vec3::Y)) * 8 < SIDE * SIDE);
}

/// Where points come toward the camera by themselves, their nodes are as near as they are.
#[test]
fn points_that_come_near_are_fine() {
    let near = |toward: f32| {
        let mut scene = with_velocities(faint, |_| toward * Vec3::Z, |_| Vec3::ZERO);
        scene.camera.eye.z = 2048.0;
        surfels(&scene, CutTolerance::of(0.1))
    };
    let (rests, comes) = (near(0.0), near(4000.0));
    assert!(rests * 8 < comes, "{rests} {comes}");
}

/// A cut of points that fly apart looks as all of them do.
#[test]
fn a_cut_moves_as_all_points_do() {
    let mut scene = with_velocities(faint, |place| 0.2 * place + Vec3::new(20.0, 0.0, 0.0), |_| Vec3::Y * 30.0);
    scene.camera.eye.z = 512.0;
    let picture = |detail: Detail| {
        let quality = "supersample:16".parse().unwrap();
        let options = RenderOptions { quality, detail, ..RenderOptions::default() };
        render_frame(&mut Cpu::default(), &scene, NUMBER, &options).unwrap()
    };
    let [good, full] = [Detail::Good, Detail::Full].map(picture);
    assert!(surfels(&scene, CutTolerance::of(0.025)) * 2 < SIDE * SIDE);
    let error = gamma_rmse(&good.picture, &full.picture).unwrap();
    assert!(error < 0.005, "{error}");
}

/// See-through surfels are cut as others are; where opacities differ, what is behind them is detail, too.
#[test]
fn what_is_seen_through_is_cut() {
    let with = |opacity: fn(usize) -> f32| {
        let mut scene = plane(|_, _| 0.5, DVec3::ZERO);
        let Shape::Surfels { model, .. } = &mut scene.objects[0].shape else { panic!("no surfels") };
        let mut own = Surfels::clone(model.surfels());
        own.opacity = own.position.iter().map(|place| opacity((place.x + 0.5 * SIDE as f32) as usize)).collect();
        *model = own.into();
        // What is behind is white.
        scene.image.background = DVec3::ONE;
        scene
    };
    let even = with(|_| 0.5);
    assert_eq!(surfels(&even, TIGHT), surfels(&plane(|_, _| 0.5, DVec3::ZERO), TIGHT));
    let mut faded = plane(noise, DVec3::ZERO);
    faded.objects[0].opacity = 0.5;
    assert_eq!(surfels(&faded, TIGHT), surfels(&plane(noise, DVec3::ZERO), TIGHT));
    let striped = with(|x| if x / 2 % 2 == 0 { 0.2 } else { 0.9 });
    assert!(surfels(&striped, TIGHT) > 4 * surfels(&even, TIGHT), "{}", surfels(&striped, TIGHT));
    for mut scene in [even, striped, with(|x| 0.4 + 0.02 * (x % 2) as f32)] {
        scene.camera.eye.z = 1024.0;
        let picture = |detail: Detail| {
            let options =
                RenderOptions { quality: "supersample:16".parse().unwrap(), detail, ..RenderOptions::default() };
            render_frame(&mut Cpu::default(), &scene, NUMBER, &options).unwrap()
        };
        let [good, full] = [Detail::Good, Detail::Full].map(picture);
        let error = gamma_rmse(&good.picture, &full.picture).unwrap();
        println!("{error}, stated {}", good.stats.detail);
        assert!(error < 0.004 && error <= good.stats.detail.max(1e-3), "{error}, stated {}", good.stats.detail);
    }
}
