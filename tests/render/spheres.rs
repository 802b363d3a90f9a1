//! Points that are drawn as spheres, on both backends and in the reference, beside rays that meet spheres.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DVec2, DVec3, Vec3};
use splatblur::backend::{Backend, BackendError};
use splatblur::compare::{self, Metric};
use splatblur::film::{Aov, Picture};
use splatblur::model::{Cloud, Kind, LoadOptions, Surfels, complete};
use splatblur::options::{BlurMode, Look, PixelFilter, Prefilter, RenderOptions, Shading};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Light, Motion, Object, Scene, Sphere};

use crate::shadows::{many, on_both, samples};
use crate::support::{self, Random, UNLIT, object};

on_both!(
    pixels_show_what_rays_meet,
    filters_and_groups_leave_spheres_alone,
    moving_spheres_are_those_of_the_reference,
    spheres_have_the_shadows_of_the_reference,
    what_cannot_show_spheres_says_so,
    an_ideal_sphere_is_one_of_them,
);

/// Centre, radius and colour.
type Ball = (DVec3, f64, Vec3);

fn spheres(balls: &[Ball]) -> Surfels {
    let cloud = Cloud {
        position: balls.iter().map(|ball| ball.0).collect(),
        radius: balls.iter().map(|ball| ball.1 as f32).collect(),
        colour: balls.iter().map(|ball| ball.2).collect(),
        colour_storage: splatblur::model::ColourStorage::Float,
        ..Cloud::default()
    };
    complete(cloud, &LoadOptions { kind: Some(Kind::Spheres), ..LoadOptions::default() }, &|_, _| {}).unwrap().0
}

fn unlit(model: Surfels) -> Object {
    let mut object = object(model);
    object.shape.surface_mut().unwrap().material = Some(UNLIT);
    object
}

const EYE: DVec3 = DVec3::new(0.3, 0.2, 3.0);

fn view(objects: Vec<Object>) -> Scene {
    let mut scene = support::scene(objects, [96, 72], EYE, 70.0);
    scene.image.transparent = true;
    scene
}

/// Two that meet in a circle, one at the edge of the picture, one that reaches behind the camera plane, one around the
/// eye, which sees nothing of it, and one of a tenth of a pixel.
fn balls() -> Vec<Ball> {
    vec![
        (DVec3::new(0.0, 0.0, 0.0), 0.7, Vec3::new(0.9, 0.1, 0.1)),
        (DVec3::new(0.6, 0.3, 0.2), 0.5, Vec3::new(0.1, 0.9, 0.1)),
        (DVec3::new(-1.6, -0.9, 0.9), 0.6, Vec3::new(0.1, 0.1, 0.9)),
        (DVec3::new(1.3, -0.2, 2.9), 0.9, Vec3::new(0.8, 0.8, 0.1)),
        (DVec3::new(0.3, 0.2, 3.2), 0.4, Vec3::new(0.8, 0.1, 0.8)),
        (DVec3::new(-0.4, 0.9, 0.0), 0.004, Vec3::ONE),
    ]
}

/// What the ray through a pixel's middle meets: depth, normal and colour. Its own quadratic equation.
fn met(balls: &[Ball], pixel: [usize; 2]) -> Option<(f64, DVec3, Vec3)> {
    let half = 35_f64.to_radians().tan();
    let at = DVec2::new((pixel[0] as f64 + 0.5) / 48.0 - 1.0, 1.0 - (pixel[1] as f64 + 0.5) / 36.0);
    let along = DVec3::new(at.x * half * 96.0 / 72.0, at.y * half, -1.0);
    let hits = balls.iter().filter_map(|&(centre, radius, colour)| {
        let from = EYE - centre;
        let (a, b, c) = (along.length_squared(), from.dot(along), from.length_squared() - radius * radius);
        let root = (b * b - a * c).sqrt();
        let depth = (-b - root) / a;
        (depth > 0.01).then(|| (depth, (from + along * depth) / radius, colour))
    });
    hits.min_by(|a, b| a.0.total_cmp(&b.0))
}

fn look() -> Look {
    Look { aovs: vec![Aov::Depth, Aov::Normal], filter: PixelFilter::Point, ..Look::default() }
}

/// Do colours, depths and normals of pixel centres agree with those of rays? A pixel is left out that shows another
/// sphere, or none: there is none at all.
fn agrees(picture: &Picture, what: &str) {
    let balls = balls();
    let (mut seen, mut left_out, mut worst) = (0, 0, [0.0_f64; 3]);
    for (row, column) in (0..72).flat_map(|row| (0..96).map(move |column| (row, column))) {
        let i = row * 96 + column;
        let alpha = picture.rgba[i][3];
        match met(&balls, [column, row]) {
            Some((depth, normal, colour)) if alpha == 1.0 => {
                let shown = Vec3::from_slice(&picture.rgba[i][..3]);
                let of_depth = f64::from(picture.layers[0].planes[0][i]);
                let of_normal = DVec3::from([0, 1, 2].map(|c: usize| f64::from(picture.layers[1].planes[c][i])));
                if (shown - colour).length() > 1e-3 {
                    left_out += 1;
                    continue;
                }
                seen += 1;
                worst[0] = worst[0].max((of_depth - depth).abs());
                worst[1] = worst[1].max((of_normal - normal).length());
                worst[2] = worst[2].max(f64::from((shown - colour).abs().max_element()));
            }
            Some(_) => left_out += 1,
            None => left_out += usize::from(alpha != 0.0),
        }
    }
    println!(
        "{what}: {seen} pixels, {left_out} left out, depth {:.1e}, normal {:.1e}, colour {:.1e}",
        worst[0], worst[1], worst[2]
    );
    // Measured without the sphere beside the camera: depth 4.3e-6, normal 7.5e-6, colour 6e-8.
    assert!(seen > 1000 && left_out == 0, "{what}: {seen}, {left_out}");
    assert!(worst[0] < 3e-5 && worst[1] < 1e-4 && worst[2] < 1e-6, "{what}: {worst:?}");
}

fn pixels_show_what_rays_meet(on: &mut dyn Backend) {
    let scene = view(vec![unlit(spheres(&balls()))]);
    let options = RenderOptions { quality: BlurMode::supersample(1).into(), look: look(), ..RenderOptions::default() };
    agrees(&render_frame(on, &scene, 0, &options).unwrap().picture, "splats");
    let options = ReferenceOptions { look: look(), samples: 16, ..ReferenceOptions::default() };
    let traced = reference::render(&scene, 0, &options, None, &|_| ()).unwrap();
    agrees(&traced.picture, "reference");
}

/// The picture of spheres alone is the same under all prefilters. Beside a disc, which is filtered, they stay what they
/// are.
fn filters_and_groups_leave_spheres_alone(on: &mut dyn Backend) {
    let alone = view(vec![unlit(spheres(&balls()))]);
    let far = unlit(support::round_surfels([(DVec3::new(0.0, 0.0, -40.0), DVec3::Z, 1.0, Vec3::ONE)]));
    let beside = view(vec![unlit(spheres(&balls())), far]);
    for prefilter in [Prefilter::None, Prefilter::Ewa, Prefilter::Approx] {
        for mode in [BlurMode::supersample(1), "bucket:1x2".parse().unwrap()] {
            let options = RenderOptions { quality: mode.into(), prefilter, look: look(), ..RenderOptions::default() };
            for (scene, name) in [(&alone, "alone"), (&beside, "beside a disc")] {
                agrees(&render_frame(on, scene, 0, &options).unwrap().picture, &format!("{name}, {mode}, {prefilter}"));
            }
        }
    }
}

/// A small cloud of spheres that overlap, some of which move by themselves.
fn cloud(count: usize) -> Surfels {
    let mut random = Random(11);
    let balls: Vec<Ball> = (0..count)
        .map(|_| {
            let at = DVec3::from([0, 1, 2].map(|_| random.within(-0.7, 0.7)));
            let colour = Vec3::from([0, 1, 2].map(|_| random.within(0.1, 0.9) as f32));
            (at, random.within(0.05, 0.2), colour)
        })
        .collect();
    let mut surfels = spheres(&balls);
    surfels.velocity = (0..count).map(|_| random.direction().as_vec3() * 4.0).collect();
    surfels
}

fn difference(a: &Picture, b: &Picture) -> [f64; 2] {
    compare::compare(a, b, &[Metric::Bias, Metric::Flip]).unwrap()
}

fn traced(scene: &Scene, count: u64) -> Picture {
    let options = ReferenceOptions { samples: count, ..ReferenceOptions::default() };
    reference::render(scene, 0, &options, None, &|_| ()).unwrap().picture
}

fn moving_spheres_are_those_of_the_reference(on: &mut dyn Backend) {
    let mut object = object(cloud(60));
    object.motions = vec![Motion::Rotation { axis: DVec3::Y, per_frame: 0.4, centre: DVec3::ZERO }];
    object.transform.scale = DVec3::splat(1.3);
    let mut scene = view(vec![object]);
    scene.lights = support::default_lights();
    let shown = render_frame(on, &scene, 0, &samples(256)).unwrap().picture;
    let [bias, flip] = difference(&shown, &traced(&scene, 1024));
    println!("moving: bias {bias:.1e}, FLIP {flip:.4}");
    // Measured on both backends: bias 5e-6, FLIP .0032, which is the noise of 256 samples.
    assert!(bias < 5e-4 && flip < 0.004, "bias {bias}, FLIP {flip}");
}

fn spheres_have_the_shadows_of_the_reference(on: &mut dyn Backend) {
    let mut floor = object(support::round_surfels((0..1600).map(|i| {
        let [x, z] = [i % 40, i / 40].map(|k| f64::from(k) * 0.1 - 2.0);
        (DVec3::new(x, -0.8, z), DVec3::Y, 0.12, Vec3::splat(0.7))
    })));
    floor.shape.surface_mut().unwrap().two_sided = true;
    let sun = Light::Directional {
        direction: DVec3::new(-0.4, -1.0, -0.5).normalize(),
        colour: DVec3::ONE,
        angle: 0.05,
        shadows: true,
    };
    let lamp =
        Light::Point { position: DVec3::new(0.8, 1.6, 1.2), colour: DVec3::splat(3.0), radius: 0.05, shadows: true };
    for (name, light) in [("sun", sun), ("lamp", lamp)] {
        let mut scene = view(vec![object(cloud(40)), floor.clone()]);
        scene.lights = vec![Light::Ambient { colour: DVec3::splat(0.2) }, light];
        let options = samples(many(on));
        let shown = render_frame(on, &scene, 0, &options).unwrap().picture;
        let truth = traced(&scene, 512);
        let lit = RenderOptions { look: Look { shadows: false, ..Look::default() }, ..samples(16) };
        let [_, without] = difference(&render_frame(on, &scene, 0, &lit).unwrap().picture, &truth);
        let [bias, flip] = difference(&shown, &truth);
        println!("{name}: bias {bias:.1e}, FLIP {flip:.4}, without shadows {without:.4}");
        // Measured: bias 9e-5 and FLIP .0046 at most, without shadows .036 at least.
        assert!(bias < 2e-3 && flip < 0.015 && flip < 0.3 * without, "{name}: bias {bias}, FLIP {flip}");
    }
}

fn what_cannot_show_spheres_says_so(on: &mut dyn Backend) {
    let scene = view(vec![object(spheres(&balls()))]);
    let volumetric: BlurMode = "volumetric:2".parse().unwrap();
    let gouraud = RenderOptions { look: Look { shading: Shading::Gouraud, ..Look::default() }, ..samples(1) };
    for options in [RenderOptions { quality: volumetric.into(), ..samples(1) }, gouraud] {
        let refused = render_frame(on, &scene, 0, &options).unwrap_err();
        assert!(matches!(refused, BackendError::Spheres { .. }), "{refused}");
    }
    let mut squashed = scene.clone();
    squashed.objects[0].transform.scale = DVec3::new(1.0, 2.0, 1.0);
    let refused = render_frame(on, &squashed, 0, &samples(1)).unwrap_err();
    assert!(matches!(refused, BackendError::Invalid(_)), "{refused}");
}

/// The element `<sphere>` is a model of one.
fn an_ideal_sphere_is_one_of_them(on: &mut dyn Backend) {
    let colour = Vec3::new(0.2, 0.6, 0.9);
    let pictures = [Object::new(Sphere { radius: 0.8, colour }), Object::new(spheres(&[(DVec3::ZERO, 0.8, colour)]))]
        .map(|object| {
            let mut scene = view(vec![object]);
            scene.lights = support::default_lights();
            render_frame(on, &scene, 0, &samples(4)).unwrap().picture
        });
    assert_eq!(pictures[0].rgba, pictures[1].rgba);
    assert!(pictures[0].rgba.iter().filter(|pixel| pixel[3] > 0.5).count() > 300);
}
