//! Properties of rendered pictures that follow from the method, each with a closed form or an equality.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::support::{UNLIT, default_lights, object, render, round_surfels, scene, sphere_scene};
use glam::{DVec3, Vec3};
use splatblur::film::{Aov, Picture};
use splatblur::model::{Material, Surfels};
use splatblur::options::{BlurMode, Detail, Look, PixelFilter, Prefilter, RenderOptions, Shading};
use splatblur::scene::{Light, Motion, Object, Scene};
use splatblur::time::Weight;

fn still() -> RenderOptions {
    RenderOptions {
        quality: BlurMode::Still { pixel_samples: 1 }.into(),
        prefilter: Prefilter::Approx,
        look: Look { filter: PixelFilter::Point, ..Look::default() },
        ..RenderOptions::default()
    }
}

/// Pixel centres and object-space kernels alone: what closed forms of coverage speak of.
fn exact(samples: u32) -> RenderOptions {
    RenderOptions {
        prefilter: Prefilter::None,
        look: Look { filter: PixelFilter::Point, ..supersample(samples).look },
        ..supersample(samples)
    }
}

fn supersample(samples: u32) -> RenderOptions {
    RenderOptions {
        quality: BlurMode::supersample(samples).into(),
        prefilter: Prefilter::Approx,
        ..RenderOptions::default()
    }
}

/// A square of surfels about the origin, facing +z.
fn patch(half: f64, spacing: f64, colour: Vec3) -> Surfels {
    let n = (half / spacing) as i32;
    round_surfels(
        (-n..=n)
            .flat_map(|j| (-n..=n).map(move |i| (i, j)))
            .map(|(i, j)| (DVec3::new(f64::from(i) * spacing, f64::from(j) * spacing, 0.0), DVec3::Z, spacing, colour)),
    )
}

fn unlit(model: Surfels) -> Object {
    let mut object = object(model);
    object.shape.surface_mut().unwrap().material = Some(UNLIT);
    object
}

fn plane(picture: &Picture, aov: Aov, channel: usize) -> &[f32] {
    let layer = picture.layers.iter().find(|layer| layer.aov == aov).expect("the AOV was asked for");
    &layer.planes[channel]
}

fn pixel(picture: &Picture, x: u32, y: u32) -> [f32; 4] {
    picture.rgba[(y * picture.width + x) as usize]
}

fn bits(picture: &Picture) -> Vec<u32> {
    let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(layers).map(|v| v.to_bits()).collect()
}

/// Two moving objects, mixed materials, all AOVs: everything that a frame can hold.
fn busy_scene() -> Scene {
    let mut scene = sphere_scene(30_000, 130, true);
    let mut wall = object(patch(2.0, 0.02, Vec3::new(0.2, 0.5, 0.3)));
    wall.transform.translate = DVec3::new(0.3, 0.0, -0.9);
    wall.transform.rotate = DVec3::new(0.3, -0.5, 0.1);
    wall.shape.surface_mut().unwrap().material =
        Some(Material { ambient: 0.5, diffuse: 0.8, specular: 0.4, shininess: 12.0 });
    wall.motions = vec![Motion::Linear { velocity: DVec3::new(-0.3, 0.2, 0.1) }];
    scene.objects.push(wall);
    scene.lights.push(Light::point(DVec3::new(1.0, 1.5, 2.0), DVec3::new(2.0, 1.5, 1.0)).without_shadows());
    scene
}

#[test]
fn bytes_depend_on_neither_threads_nor_memory_nor_the_run() {
    let scene = busy_scene();
    for shading in [Shading::Phong, Shading::Gouraud] {
        let look = Look { shading, aovs: Aov::ALL.to_vec(), ..supersample(5).look };
        // With levels of detail the models would take more memory than their surfels.
        let options = RenderOptions { detail: Detail::Full, look, ..supersample(5) };
        let with = |threads: usize, memory: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
            let options = RenderOptions { memory, ..options.clone() };
            pool.install(|| bits(&render(&scene, &options)))
        };
        let plenty = with(1, 1 << 30);
        assert!(plenty == with(1, 1 << 30), "second run");
        assert!(plenty == with(2, 1 << 30), "2 threads");
        let models = scene.objects.iter().map(|object| object.shape.surfels().unwrap().surfels().bytes()).sum::<u64>();
        assert!(plenty == with(3, models + 12_000_000), "3 threads, waves");
        assert!(plenty == with(2, models + 7_650_000), "2 threads, waves and bands");
    }
}

#[test]
fn too_little_memory_is_an_error_that_says_what_is_needed() {
    let scene = busy_scene();
    let options = RenderOptions { memory: 100_000, ..supersample(2) };
    let error = splatblur::renderer::render_frame(&mut splatblur::backend::cpu::Cpu::default(), &scene, 0, &options)
        .expect_err("100 kB");
    let text = error.to_string();
    assert!(text.contains("130 x 130") && text.contains("100000") && text.contains("RenderOptions::memory"), "{text}");
}

#[test]
fn without_motion_supersampling_equals_still() {
    let scene = sphere_scene(20_000, 96, false);
    let once = render(&scene, &still());
    let many = render(
        &scene,
        &RenderOptions { look: Look { filter: PixelFilter::Point, ..supersample(7).look }, ..supersample(7) },
    );
    for (a, b) in once.rgba.iter().flatten().zip(many.rgba.iter().flatten()) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
}

#[test]
fn one_supersample_at_mid_shutter_equals_still_there() {
    let mut scene = sphere_scene(20_000, 96, true);
    scene.shutter.open = -0.5;
    scene.shutter.close = 0.5;
    assert!(bits(&render(&scene, &still())) == bits(&render(&scene, &supersample(1))));
}

#[test]
fn alpha_is_the_share_of_the_exposure_that_covers() {
    let mut object = unlit(patch(1.0, 0.02, Vec3::ONE));
    object.motions = vec![Motion::Linear { velocity: DVec3::new(1.3, 0.0, 0.0) }];
    let mut scene = scene(vec![object], [33, 33], DVec3::new(0.0, 0.0, 5.0), 40.0);
    scene.image.transparent = true;
    let at = |start: f64, weight: Weight| {
        let mut scene = scene.clone();
        scene.objects[0].transform.translate.x = start;
        scene.shutter.weight = weight;
        pixel(&render(&scene, &exact(500)), 16, 16)[3]
    };
    // front edge at x = start + 1.02 + 1.3 t: passes 0 at t = (-1.02 - start) / 1.3
    for arrival in [0.25, 0.6] {
        let start = -1.02 - 1.3 * arrival;
        let t = arrival as f32;
        assert!((at(start, Weight::Box) - (1.0 - t)).abs() < 0.003);
        assert!((at(start, Weight::Ramp { centre: 1.0 }) - (1.0 - t * t)).abs() < 0.005);
    }
}

#[test]
fn near_hides_far_and_epsilon_blends() {
    let at = |z: f64, colour: Vec3| {
        let mut object = unlit(patch(1.0, 0.05, colour));
        object.transform.translate.z = z;
        object
    };
    let (red, blue) = (Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 1.0));
    for objects in [vec![at(0.0, red), at(-0.5, blue)], vec![at(-0.5, blue), at(0.0, red)]] {
        let scene = scene(objects, [9, 9], DVec3::new(0.0, 0.0, 4.0), 20.0);
        assert_eq!(pixel(&render(&scene, &still()), 4, 4), [1.0, 0.0, 0.0, 1.0]);
        let blended = pixel(
            &render(&scene, &RenderOptions { look: Look { epsilon: Some(1.0), ..still().look }, ..still() }),
            4,
            4,
        );
        assert!(blended[0] > 0.3 && blended[2] > 0.3, "{blended:?}");
    }
}

#[test]
fn back_faces_are_culled_unless_two_sided() {
    let mut lit = object(patch(1.0, 0.05, Vec3::ONE));
    lit.transform.rotate.y = std::f64::consts::PI;
    lit.shape.surface_mut().unwrap().material =
        Some(Material { ambient: 0.0, diffuse: 1.0, specular: 0.0, shininess: 1.0 });
    let mut scene = scene(vec![lit], [9, 9], DVec3::new(0.0, 0.0, 4.0), 20.0);
    scene.lights = vec![Light::directional(-DVec3::Z, DVec3::ONE).without_shadows()];
    assert_eq!(pixel(&render(&scene, &still()), 4, 4)[0], 0.0);
    for shading in [Shading::Phong, Shading::Gouraud] {
        let shown = pixel(
            &render(&scene, &RenderOptions { look: Look { two_sided: true, shading, ..still().look }, ..still() }),
            4,
            4,
        );
        assert!((shown[0] - 1.0).abs() < 1e-5, "the normal turns to the viewer: {shown:?}");
    }
}

#[test]
fn mirrored_objects_show_the_same_side() {
    let mut mirrored = object(patch(1.0, 0.05, Vec3::ONE));
    mirrored.place.scale = DVec3::new(-1.0, 1.0, 1.0);
    mirrored.shape.surface_mut().unwrap().material =
        Some(Material { ambient: 0.0, diffuse: 1.0, specular: 0.0, shininess: 1.0 });
    let mut scene = scene(vec![mirrored], [9, 9], DVec3::new(0.0, 0.0, 4.0), 20.0);
    scene.lights = vec![Light::directional(-DVec3::Z, DVec3::ONE).without_shadows()];
    assert!((pixel(&render(&scene, &still()), 4, 4)[0] - 1.0).abs() < 1e-5);
}

#[test]
fn light_comes_from_where_the_scene_says() {
    let mut scene = sphere_scene(40_000, 128, false);
    scene.lights = vec![Light::directional(DVec3::new(-1.0, -1.0, -1.0).normalize(), DVec3::ONE).without_shadows()];
    scene.objects[0].shape.surface_mut().unwrap().material =
        Some(Material { ambient: 0.0, diffuse: 1.0, specular: 0.0, shininess: 1.0 });
    for shading in [Shading::Phong, Shading::Gouraud] {
        let picture = render(&scene, &RenderOptions { look: Look { shading, ..still().look }, ..still() });
        let light = |x, y| pixel(&picture, x, y)[0];
        // Light travels to -x, -y, -z: it comes from the upper right.
        assert!(light(84, 44) > 4.0 * light(44, 84).max(0.02), "{} {}", light(84, 44), light(44, 84));
    }
}

#[test]
fn phong_and_gouraud_agree_on_flat_surfaces() {
    let mut flat = object(patch(1.0, 0.02, Vec3::new(0.3, 0.6, 0.9)));
    flat.transform.rotate = DVec3::new(0.4, 0.2, 0.0);
    flat.shape.surface_mut().unwrap().material =
        Some(Material { ambient: 0.7, diffuse: 0.9, specular: 0.3, shininess: 8.0 });
    let mut scene = scene(vec![flat], [32, 32], DVec3::new(0.0, 0.0, 4.0), 20.0);
    scene.lights = default_lights();
    scene.lights.push(Light::point(DVec3::new(0.5, 0.5, 1.5), DVec3::splat(1.5)).without_shadows());
    let phong = render(&scene, &still());
    let gouraud =
        render(&scene, &RenderOptions { look: Look { shading: Shading::Gouraud, ..still().look }, ..still() });
    for (a, b) in phong.rgba.iter().flatten().zip(gouraud.rgba.iter().flatten()) {
        assert!((a - b).abs() < 2e-3, "{a} {b}");
    }
}

#[test]
fn aovs_hold_depth_normal_velocity_and_alpha() {
    let mut object = unlit(patch(3.0, 0.05, Vec3::ONE));
    object.transform.rotate.y = 0.5;
    object.motions = vec![Motion::Linear { velocity: DVec3::new(0.2, -0.1, 0.0) }];
    let mut scene = scene(vec![object], [65, 65], DVec3::new(0.0, 0.0, 4.0), 40.0);
    scene.shutter.open = -0.5;
    scene.shutter.close = 0.5;
    scene.image.background = DVec3::ONE;
    let options =
        RenderOptions { prefilter: Prefilter::None, look: Look { aovs: Aov::ALL.to_vec(), ..still().look }, ..still() };
    let picture = render(&scene, &options);
    let f = 32.5 / 20_f64.to_radians().tan();
    for (x, y) in [(32_u32, 32_u32), (20, 40), (45, 10)] {
        let i = (y * 65 + x) as usize;
        // The plane turned by 0.5 about y: z = -tan(0.5) x; on the ray x = s dx, z = 4 - s.
        let dx = (f64::from(x) + 0.5 - 32.5) / f;
        let depth = 4.0 / (1.0 - 0.5_f64.tan() * dx);
        let got = f64::from(plane(&picture, Aov::Depth, 0)[i]);
        assert!((got / depth - 1.0).abs() < 1e-5, "depth {got}, closed form {depth}");
        let normal = [0.5_f64.sin(), 0.0, 0.5_f64.cos()];
        for c in 0..3 {
            assert!((f64::from(plane(&picture, Aov::Normal, c)[i]) - normal[c]).abs() < 1e-5);
        }
        // x right, y down, pixels per shutter; the surfels' own depths vary within the kernel
        let velocity = [0.2 * f / depth, 0.1 * f / depth];
        for c in 0..2 {
            let got = f64::from(plane(&picture, Aov::Velocity, c)[i]);
            assert!((got / velocity[c] - 1.0).abs() < 0.01, "velocity {got}, closed form {}", velocity[c]);
        }
        assert_eq!(plane(&picture, Aov::Alpha, 0)[i], 1.0);
        assert_eq!(picture.rgba[i][3], 1.0);
    }
}

#[test]
fn aovs_of_the_background_are_infinity_and_zero() {
    let scene = scene(vec![unlit(patch(0.1, 0.05, Vec3::ONE))], [65, 65], DVec3::new(0.0, 0.0, 4.0), 40.0);
    let picture = render(&scene, &RenderOptions { look: Look { aovs: Aov::ALL.to_vec(), ..still().look }, ..still() });
    assert_eq!(plane(&picture, Aov::Depth, 0)[0], f32::INFINITY);
    assert_eq!(plane(&picture, Aov::Normal, 2)[0], 0.0);
    assert_eq!(plane(&picture, Aov::Velocity, 0)[0], 0.0);
    assert_eq!(plane(&picture, Aov::Alpha, 0)[0], 0.0);
}

#[test]
fn the_background_is_composited_once() {
    let mut object = unlit(patch(1.0, 0.02, Vec3::new(0.8, 0.0, 0.0)));
    object.transform.translate.x = -1.02 - 0.65;
    object.motions = vec![Motion::Linear { velocity: DVec3::new(1.3, 0.0, 0.0) }];
    let mut scene = scene(vec![object], [9, 9], DVec3::new(0.0, 0.0, 4.0), 20.0);
    scene.image.background = DVec3::new(0.1, 0.2, 0.4);
    let options = exact(200);
    let [r, g, b, a] = pixel(&render(&scene, &options), 4, 4);
    assert!((r - (0.4 + 0.05)).abs() < 0.005 && (g - 0.1).abs() < 0.003 && (b - 0.2).abs() < 0.005 && a == 1.0);
    scene.image.transparent = true;
    let [r, g, b, a] = pixel(&render(&scene, &options), 4, 4);
    assert!((r - 0.4).abs() < 0.005 && g == 0.0 && b == 0.0 && (a - 0.5).abs() < 0.005);
}

#[test]
fn objects_without_blur_stay_sharp() {
    let mut scene = sphere_scene(20_000, 96, true);
    scene.objects[0].blur = false;
    let sharp = render(
        &scene,
        &RenderOptions { look: Look { filter: PixelFilter::Point, ..supersample(6).look }, ..supersample(6) },
    );
    let frozen = render(&scene, &still());
    for (a, b) in sharp.rgba.iter().flatten().zip(frozen.rgba.iter().flatten()) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
}

#[test]
fn far_from_the_origin_nothing_changes() {
    let near = sphere_scene(20_000, 96, true);
    let mut far = near.clone();
    let offset = DVec3::new(1e8, -2e8, 5e7);
    far.objects[0].place.translate = offset;
    far.camera.eye += offset;
    far.camera.at += offset;
    let (a, b) = (render(&near, &supersample(3)), render(&far, &supersample(3)));
    let mut worst = 0.0_f32;
    let mut different = 0;
    for (a, b) in a.rgba.iter().flatten().zip(b.rgba.iter().flatten()) {
        worst = worst.max((a - b).abs());
        different += u32::from((a - b).abs() > 1e-3);
    }
    // f64 positions at 2e8 have a grain of 3e-8: a few decisions at rims may turn.
    assert!(different < 20, "{different} channels differ, worst {worst}");
}

#[test]
fn empty_models_and_hidden_objects_render_as_background() {
    let scene = scene(vec![object(Surfels::default())], [7, 5], DVec3::ZERO, 40.0);
    let picture = render(&scene, &supersample(2));
    assert!(picture.rgba.iter().all(|p| *p == [0.0, 0.0, 0.0, 1.0]));
}

#[test]
fn the_low_pass_disc_shows_what_falls_between_pixels() {
    // One surfel far smaller than a pixel, between four pixel centres.
    let dot = round_surfels([(DVec3::ZERO, DVec3::Z, 1e-4, Vec3::ONE)]);
    let mut scene = scene(vec![unlit(dot)], [8, 8], DVec3::new(0.0, 0.0, 4.0), 40.0);
    scene.image.transparent = true;
    let nothing = render(&scene, &RenderOptions { prefilter: Prefilter::None, ..still() });
    assert!(nothing.rgba.iter().all(|p| p[3] == 0.0));
    let dim = render(&scene, &still());
    // Distance sqrt(1/2) px: r^2 = (1/2)/2, weight exp(-1/2).
    for (x, y) in [(3, 3), (4, 3), (3, 4), (4, 4)] {
        assert!((pixel(&dim, x, y)[3] - (-0.5_f32).exp()).abs() < 1e-3, "{:?}", pixel(&dim, x, y));
    }
    assert_eq!(pixel(&dim, 2, 2)[3], 0.0);
}

#[test]
fn the_default_epsilon_is_the_median_radius_times_the_scale() {
    // Two sheets 0.3 apart, of surfels of radius 0.1: hidden as they are, blended once both grow four times.
    let sheets = |scale: f64| {
        let sheet = |z: f64, colour: Vec3| {
            let mut object = unlit(patch(1.0, 0.1, colour));
            object.transform.scale = DVec3::splat(scale);
            object.place.translate.z = z;
            object
        };
        let objects = vec![sheet(0.0, Vec3::X), sheet(-0.3, Vec3::Z)];
        pixel(&render(&scene(objects, [9, 9], DVec3::new(0.0, 0.0, 4.0), 10.0), &still()), 4, 4)
    };
    assert_eq!(sheets(1.0), [1.0, 0.0, 0.0, 1.0]);
    assert!(sheets(4.0)[2] > 0.3, "{:?}", sheets(4.0));
}

#[test]
fn recentred_models_stay_in_place() {
    let plain = sphere_scene(5_000, 64, true);
    let mut recentred = plain.clone();
    let shift = Vec3::new(0.5, -0.25, 2.0);
    let mut model = Surfels::clone(recentred.objects[0].shape.surfels().unwrap().surfels());
    model.position.iter_mut().for_each(|p| *p -= shift);
    model.origin = shift.as_dvec3();
    recentred.objects[0].shape = model.into();
    let (a, b) = (render(&plain, &supersample(3)), render(&recentred, &supersample(3)));
    let off = a.rgba.iter().flatten().zip(b.rgba.iter().flatten()).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
    assert!(off < 20, "{off} channels differ by more than rounding at rims");
}
