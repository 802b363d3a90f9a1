//! Small scenes with captures, volumes and see-through surfels, which take every branch of their passes.

use glam::{DVec3, Quat, Vec3};

use super::cases::{Case, ball, object, scene, surroundings};
use crate::film::Aov;
use crate::math::random::Random;
use crate::model::{Gaussians, Material, Optics};
use crate::options::{BlurMode, Interleave, Look, PixelFilter, Prefilter, RenderOptions, Shading, Times};
use crate::scene::{Capture, Light, Motion, Object, Scene, Shape};

/// `n` Gaussians of all sizes in a cube; some are as wide as an image, and some too faint to show.
pub(in crate::backend) fn cloud(n: usize, seed: u64, degree: u8, linear: bool) -> Gaussians {
    let mut random = Random(seed);
    let mut out = Gaussians { degree, linear, ..Gaussians::default() };
    for i in 0..n {
        out.position.push(random.vector());
        let size = if i % 40 == 0 { 1.5 } else { 0.25 };
        out.sigma.push(Vec3::new(random.next(), random.next(), random.next()) * size);
        let axis = random.vector().normalize();
        out.rotation.push(Quat::from_axis_angle(axis, 6.0 * random.next()));
        // Some are as opaque as can be.
        let opacity = random.next();
        out.opacity.push(if i % 40 == 0 { 0.2 } else { (1.3 * opacity).min(1.0) });
        out.base.push(1.5 * random.vector());
        out.harmonics.extend((0..out.harmonics_each()).map(|_| 0.4 * random.vector()));
    }
    out
}

/// Gaussians whose centres all have one depth, in front of the camera.
fn layer(n: usize, seed: u64) -> Gaussians {
    let mut out = cloud(n, seed, 0, false);
    out.position.iter_mut().for_each(|position| position.z = 0.25);
    out
}

/// `n` kernels of a volume in a cube, of all sizes, with `normals` for lights or without. Layers are `layer` deep.
pub(super) fn volume(n: usize, seed: u64, layer: f32, normals: bool) -> Gaussians {
    let mut random = Random(seed);
    let mut out = cloud(n, seed, 0, true);
    out.optics = Optics::Extinction { layer };
    for i in 0..n {
        let sigma = &mut out.sigma[i];
        *sigma = 0.4 * *sigma + 0.03;
        // The integral of a kernel that takes half of the light on the mean; some are very thin.
        let thin = if i % 7 == 0 { 2e-3 } else { 1.0 };
        out.opacity[i] *= 8.0 * sigma.x * sigma.y.max(sigma.z) * thin;
        // Some have none.
        let normal = if i % 9 == 0 { Vec3::ZERO } else { random.vector().normalize() };
        out.normal.extend(normals.then_some(normal));
    }
    out
}

/// A ball of see-through surfels, seen from both sides. Each surfel has an opacity.
fn glass(n: usize, seed: u64, materials: bool) -> Object {
    let mut random = Random(seed);
    let mut surfels = ball(n, seed, materials);
    surfels.opacity = (0..n).map(|_| 0.2 + 0.7 * random.next()).collect();
    let mut glass = object(surfels, DVec3::new(0.1, -0.1, -0.3));
    (glass.shape.surface_mut().unwrap().two_sided, glass.opacity) = (true, 0.9);
    glass
}

/// `scene` and two balls of see-through surfels: one in motion around what is in the middle, and a still one aside.
fn with_glass(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    let mut around = glass(900, 21, true);
    around.motions = vec![
        Motion::Rotation { axis: DVec3::X, per_frame: 0.5, centre: DVec3::ZERO },
        Motion::Linear { velocity: DVec3::new(-0.2, 0.3, 0.2) },
    ];
    let mut aside = glass(300, 22, false);
    aside.transform.scale = DVec3::new(0.5, 0.4, -0.5);
    aside.transform.translate = DVec3::new(-0.6, 0.3, 0.4);
    around.shape.surface_mut().unwrap().reflection = 0.5;
    scene.environment = Some(surroundings());
    scene.objects.insert(1, around);
    scene.objects.push(aside);
    scene
}

/// Balls of see-through surfels one in the other, with more layers than are shown.
fn nested() -> Scene {
    let each = (1..=6_u8).map(|i| {
        let mut glass = glass(500, 30 + u64::from(i), false);
        glass.transform.scale = DVec3::splat(0.15 * f64::from(i));
        glass.opacity = 0.25;
        glass
    });
    // An opaque one hides some.
    let mut before = object(ball(400, 2, false), DVec3::new(0.2, 0.1, 1.2));
    before.transform.scale = DVec3::splat(0.25);
    scene(each.chain([before]).collect(), [70, 45])
}

fn moving(model: Gaussians) -> Object {
    let mut object = object(model, DVec3::new(0.1, 0.0, -0.5));
    object.motions = vec![
        Motion::Rotation { axis: DVec3::Y, per_frame: 0.6, centre: DVec3::ZERO },
        Motion::Linear { velocity: DVec3::new(0.3, -0.2, 0.4) },
    ];
    object
}

/// A static capture and a moving one between two balls of surfels; the nearer one is small.
fn mixed(first: Gaussians, second: Gaussians, size: [u32; 2]) -> Scene {
    let mut behind = object(ball(900, 1, true), DVec3::new(-0.3, 0.0, -1.2));
    behind.motions = vec![Motion::Linear { velocity: DVec3::new(0.4, 0.1, 0.2) }];
    let mut before = object(ball(400, 2, false), DVec3::new(0.5, 0.2, 1.2));
    before.transform.scale = DVec3::splat(0.25);
    let fixed = object(first, DVec3::new(-0.2, 0.1, -0.4));
    let mut scene = scene(vec![behind, fixed, moving(second), before], size);
    scene.image.background = DVec3::new(0.1, 0.3, 0.6);
    scene
}

/// More Gaussians than rounding of a budget would hide.
pub(super) fn many() -> Case {
    let scene = mixed(cloud(600_000, 3, 0, false), cloud(30, 4, 0, false), [70, 45]);
    let quality = BlurMode::supersample(2).into();
    Case { name: "many", scene, options: RenderOptions { quality, ..RenderOptions::default() }, in_part: false }
}

/// All cases.
#[allow(clippy::too_many_lines, reason = "a list of cases")]
pub(super) fn captures() -> Vec<Case> {
    let options = |mode: BlurMode| RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::Approx,
        look: Look { aovs: Aov::ALL.to_vec(), ..Look::default() },
        ..RenderOptions::default()
    };
    let point =
        |mode| RenderOptions { look: Look { filter: PixelFilter::Point, ..options(mode).look }, ..options(mode) };
    let plain = |mode| RenderOptions { look: Look { aovs: Vec::new(), ..options(mode).look }, ..options(mode) };
    let still = BlurMode::Still { pixel_samples: 2 };
    let bucket = BlurMode::Bucket {
        buckets: 2,
        samples: 3,
        pixel_samples: Some(2),
        interleave: Interleave::None,
        times: Times::Even,
    };
    let both = |linear| mixed(cloud(300, 3, 3, linear), cloud(300, 4, 2, linear), [70, 45]);
    let coded = both(false);
    let linear = both(true);
    let encoded = mixed(cloud(300, 3, 3, false), cloud(300, 4, 2, true), [70, 45]);
    let large = mixed(cloud(300, 5, 1, false), cloud(300, 6, 0, false), [150, 140]);
    let mut behind_nothing = coded.clone();
    behind_nothing.image.transparent = true;
    let mut linear_behind_nothing = linear.clone();
    linear_behind_nothing.image.transparent = true;
    let mut alone = coded.clone();
    alone.objects.retain(|object| object.shape.gaussians().is_some());
    let mut drawn = coded.clone();
    drawn.objects[1].opacity = 0.6;
    let Shape::Gaussians { model, capture } = &mut drawn.objects[1].shape else { panic!("no capture") };
    *capture = Capture { harmonics: 1, antialias: Some(true) };
    model.crop = Some([DVec3::new(-0.5, -0.8, -0.9), DVec3::new(0.9, 0.7, 0.6)]);
    drawn.objects[2].shape.gaussians_mut().unwrap().flat = Some(Vec3::new(0.9, 0.2, 0.4));
    let mut ties = mixed(layer(200, 7), layer(200, 8), [70, 45]);
    ties.objects[2].motions = vec![Motion::Linear { velocity: DVec3::new(0.2, 0.1, 0.0) }];
    ties.objects[2].transform.translate.z = -0.4;
    // Beside the field of view and behind the eye, and so wide that they reach into the picture.
    let mut around = cloud(300, 9, 0, false);
    around.position.iter_mut().for_each(|position| *position *= 6.0);
    around.sigma.iter_mut().for_each(|sigma| *sigma *= 4.0);
    let aside = mixed(around, cloud(30, 4, 0, false), [70, 45]);
    let mut near = coded.clone();
    near.camera.near = 2.9;
    // A volume and a capture in motion between the balls, and a second volume among the capture's Gaussians.
    let fog = |seed, normals| mixed(volume(300, seed, 0.15, normals), cloud(60, 4, 1, false), [70, 45]);
    let mut foggy = fog(11, false);
    foggy.objects.insert(2, moving(volume(200, 12, 0.1, true)));
    let mut lit = foggy.clone();
    (lit.objects[1], lit.objects[2]) = (fog(13, true).objects.swap_remove(1), moving(volume(200, 14, 0.2, false)));
    // A light from behind, which what has no normal must not reflect.
    lit.lights.push(Light::directional(DVec3::Z, DVec3::splat(0.8)).without_shadows());
    lit.objects[1].shape.set_material(Material { specular: 0.6, shininess: 2.0, ..Material::default() });
    let linear_lit = mixed(volume(300, 13, 0.1, true), volume(300, 14, 0.2, true), [65, 45]);
    let mut rolling = with_glass(&foggy);
    rolling.shutter.readout = "0.8,left".parse().unwrap();
    let mut dense = foggy.clone();
    dense.objects[1].opacity = 1e16;
    // Kernels around the eye, as wide as they are far.
    let mut near_eye = volume(60, 15, 0.3, false);
    near_eye.sigma.iter_mut().for_each(|sigma| *sigma *= 8.0);
    let wide = mixed(near_eye, cloud(30, 4, 0, false), [70, 45]);
    let case = |name, scene: &Scene, options| Case { name, scene: scene.clone(), options, in_part: false };
    let in_part = |name, scene: &Scene, options| Case { in_part: true, ..case(name, scene, options) };
    vec![
        case("still", &coded, options(still)),
        case("supersample", &coded, options(BlurMode::supersample(2))),
        case("linear", &linear, options(BlurMode::supersample(2))),
        case("encoded", &encoded, options(BlurMode::supersample(2))),
        case("transparent", &behind_nothing, options(BlurMode::supersample(2))),
        case("linear, transparent", &linear_behind_nothing, options(still)),
        case("bucket", &coded, options(bucket)),
        case("interleaved", &coded, options(BlurMode::interleaved(2, Interleave::Two))),
        case("alone", &alone, options(BlurMode::supersample(2))),
        case("plain", &coded, plain(BlurMode::supersample(2))),
        case(
            "depth",
            &coded,
            RenderOptions { look: Look { aovs: vec![Aov::Depth], ..options(still).look }, ..options(still) },
        ),
        case("drawn", &drawn, options(still)),
        case("ties", &ties, point(BlurMode::supersample(2))),
        case("near", &near, options(still)),
        case("aside", &aside, options(still)),
        case("large", &large, options(bucket)),
        case("layer", &coded, point(BlurMode::supersample(3))),
        case("layer, bucket", &coded, point(bucket)),
        case("ewa", &coded, RenderOptions { prefilter: Prefilter::Ewa, ..options(BlurMode::supersample(2)) }),
        case("ewa, bucket", &coded, RenderOptions { prefilter: Prefilter::Ewa, ..options(bucket) }),
        case("volume", &foggy, options(BlurMode::supersample(2))),
        case("volume, bucket", &foggy, options(bucket)),
        case("volume, point", &foggy, RenderOptions { prefilter: Prefilter::None, ..point(still) }),
        case("volume, ewa", &foggy, RenderOptions { prefilter: Prefilter::Ewa, ..options(still) }),
        case("lit volume", &lit, options(BlurMode::supersample(2))),
        case("lit volume, interleaved", &linear_lit, plain(BlurMode::interleaved(2, Interleave::Two))),
        case(
            "lit volume, depth",
            &linear_lit,
            RenderOptions { look: Look { aovs: vec![Aov::Depth], ..options(bucket).look }, ..options(bucket) },
        ),
        case("dense", &dense, options(still)),
        case("wide volume", &wide, options(still)),
        case("glass", &with_glass(&coded), options(BlurMode::supersample(2))),
        case("glass, ewa", &with_glass(&linear), RenderOptions { prefilter: Prefilter::Ewa, ..options(still) }),
        case("glass, point", &with_glass(&coded), RenderOptions { prefilter: Prefilter::None, ..point(still) }),
        case("glass, bucket", &with_glass(&coded), options(bucket)),
        case("glass, ewa, bucket", &with_glass(&coded), RenderOptions { prefilter: Prefilter::Ewa, ..options(bucket) }),
        case("glass, interleaved", &with_glass(&coded), plain(BlurMode::interleaved(2, Interleave::Two))),
        case(
            "glass, gouraud",
            &with_glass(&linear),
            RenderOptions { look: Look { shading: Shading::Gouraud, ..plain(still).look }, ..plain(still) },
        ),
        case(
            "glass, depth",
            &with_glass(&linear),
            RenderOptions { look: Look { aovs: vec![Aov::Depth], ..options(still).look }, ..options(still) },
        ),
        case(
            "glass, normal",
            &with_glass(&linear),
            RenderOptions { look: Look { aovs: vec![Aov::Normal], ..options(still).look }, ..options(still) },
        ),
        case("glass, fog", &with_glass(&foggy), options(BlurMode::supersample(2))),
        case("glass, fog, bucket", &with_glass(&lit), point(bucket)),
        case("glass, large", &with_glass(&large), options(bucket)),
        case("glass, nested", &nested(), RenderOptions { prefilter: Prefilter::Ewa, ..options(still) }),
        in_part("glass, in part", &with_glass(&foggy), point(BlurMode::supersample(2))),
        in_part("rolling, in part", &rolling, point(BlurMode::supersample(2))),
        in_part("volume, in part", &foggy, point(bucket)),
        in_part("in part", &coded, point(BlurMode::supersample(2))),
        in_part("in part, large", &large, point(still)),
        case("one pixel", &mixed(cloud(30, 3, 1, false), cloud(30, 4, 0, false), [1, 1]), options(still)),
    ]
}
