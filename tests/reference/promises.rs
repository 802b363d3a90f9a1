//! What the reference promises beside the right values: the same bytes on any number of threads, progressive samples,
//! runs in parts, a stop that respects the error; and its agreement with brute force, with the splatter, and with an
//! ideal sphere.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use splatblur::film::Aov;
use splatblur::model::{Material, Surfels};
use splatblur::options::{BlurMode, Look, PixelFilter, Prefilter, RenderOptions, Shading};
use splatblur::reference::{
    ROUND, Reference, ReferenceError, ReferenceOptions, Sampler, Sums, probe, render as reference_of,
};
use splatblur::scene::{Light, Motion, Scene};

use crate::parts::bits;
use crate::support::ideal_sphere::approaches_the_ideal_sphere;
use crate::support::{UNLIT, object, render, rms, round_surfels, scene, sphere, sphere_scene};

fn reference(scene: &Scene, options: &ReferenceOptions) -> Reference {
    reference_of(scene, 0, options, None, &|_| ()).expect("valid options")
}

fn with(samples: u64) -> ReferenceOptions {
    ReferenceOptions { samples, ..ReferenceOptions::default() }
}

/// A turning sphere before a tilted wall, one that does not blur, different materials, all kinds of light.
fn busy_scene(size: u32) -> Scene {
    let mut scene = sphere_scene(4000, size, true);
    let patch = |colour: Vec3| {
        round_surfels(
            (-20..=20)
                .flat_map(|j| (-20..=20).map(move |i| (i, j)))
                .map(|(i, j)| (DVec3::new(f64::from(i) * 0.1, f64::from(j) * 0.1, 0.0), DVec3::Z, 0.1, colour)),
        )
    };
    let mut wall = object(patch(Vec3::new(0.2, 0.5, 0.3)));
    wall.transform.translate = DVec3::new(0.3, 0.0, -0.9);
    wall.transform.rotate = DVec3::new(0.3, -0.5, 0.1);
    wall.transform.scale = DVec3::new(1.2, -0.8, 1.0);
    wall.shape.surface_mut().unwrap().two_sided = true;
    wall.shape.surface_mut().unwrap().material =
        Some(Material { ambient: 0.5, diffuse: 0.8, specular: 0.4, shininess: 12.0 });
    wall.motions = vec![Motion::Linear { velocity: DVec3::new(-0.3, 0.2, 0.1) }];
    let mut still = object(sphere(1000));
    still.transform.translate = DVec3::new(-0.9, 0.8, 0.4);
    still.transform.scale = DVec3::splat(0.3);
    still.motions = vec![Motion::Linear { velocity: DVec3::new(5.0, 0.0, 0.0) }];
    still.blur = false;
    scene.objects.extend([wall, still]);
    scene.lights.push(Light::point(DVec3::new(1.0, 1.5, 2.0), DVec3::new(2.0, 1.5, 1.0)).without_shadows());
    scene
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let scene = busy_scene(48);
    for sampler in [Sampler::Sobol, Sampler::Random, Sampler::Jittered { density: 4 }] {
        let options = ReferenceOptions { sampler, look: Look { aovs: Aov::ALL.to_vec(), ..with(32).look }, ..with(32) };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
            pool.install(|| reference(&scene, &options))
        };
        let (one, three) = (run(1), run(3));
        assert!(bits(&one.picture) == bits(&three.picture), "{sampler:?}");
        assert!(one.sums == three.sums, "{sampler:?}");
        assert_eq!(one.stats.mean_error.to_bits(), three.stats.mean_error.to_bits());
    }
}

/// One long run, a short one and the rest, and one that goes over the disk give the same bytes.
#[test]
fn runs_in_parts_are_the_same() {
    let scene = busy_scene(40);
    for sampler in [Sampler::Sobol, Sampler::Random] {
        let options = |samples| ReferenceOptions {
            sampler,
            look: Look { aovs: Aov::ALL.to_vec(), ..with(samples).look },
            ..with(samples)
        };
        let whole = reference(&scene, &options(80));
        let mut sums: Option<Sums> = None;
        for samples in [16, 48, 80] {
            let part = reference_of(&scene, 0, &options(samples), sums, &|_| ()).expect("valid options");
            assert_eq!(part.stats.samples, samples);
            sums = Some(Sums::from_bytes(&part.sums.to_bytes("s")).expect("what was written").0);
        }
        let last = reference_of(&scene, 0, &options(80), sums, &|_| ()).expect("valid options");
        assert_eq!(last.stats.traced, 0);
        assert!(bits(&whole.picture) == bits(&last.picture) && whole.sums == last.sums, "{sampler:?}");
    }
}

/// The first k samples of a longer run are those of the shorter run.
#[test]
fn samples_are_progressive() {
    let scene = busy_scene(16);
    for (sampler, same) in [(Sampler::Sobol, true), (Sampler::Random, true), (Sampler::Jittered { density: 4 }, false)]
    {
        let options = |samples| ReferenceOptions { sampler, ..with(samples) };
        let all_same = (0..32).all(|i| {
            let at = |samples| {
                let sample = probe(&scene, 0, &options(samples), [7, 9], Some(i)).expect("a sample").sample;
                let sample = sample.expect("asked for");
                (sample.film, sample.time)
            };
            at(32) == at(1024)
        });
        assert_eq!(all_same, same, "{sampler:?}");
        assert_eq!(sampler.is_progressive(), same);
    }
}

#[test]
fn stops_below_the_error() {
    let scene = sphere_scene(2000, 32, true);
    let options = ReferenceOptions { error: Some(1.5e-3), ..with(16 * ROUND) };
    let made = reference(&scene, &options);
    assert!(made.stats.samples > ROUND && made.stats.samples < 16 * ROUND, "{}", made.stats.samples);
    // Half of the scramblings decided; all of them report.
    assert!(made.stats.mean_error < 1.8e-3, "{}", made.stats.mean_error);
    let fewer = reference(&scene, &with(made.stats.samples - ROUND));
    assert!(fewer.stats.mean_error > 1.3e-3, "{}", fewer.stats.mean_error);
    // The same samples as without the stop.
    assert!(bits(&reference(&scene, &with(made.stats.samples)).picture) == bits(&made.picture));
}

/// The layer of errors is there once, and the same, whether it is asked for or not.
#[test]
fn has_one_layer_of_errors() {
    let scene = sphere_scene(100, 8, false);
    let asked = ReferenceOptions { look: Look { aovs: vec![Aov::Error], ..Look::default() }, ..with(16) };
    assert_eq!(reference(&scene, &asked).picture, reference(&scene, &with(16)).picture);
}

#[test]
fn refuses_what_cannot_be() {
    let scene = sphere_scene(100, 8, false);
    let fails = |options: &ReferenceOptions, sums| reference_of(&scene, 0, options, sums, &|_| ()).unwrap_err();
    for samples in [0, 1, 17] {
        assert!(matches!(fails(&with(samples), None), ReferenceError::Samples { .. }), "{samples}");
    }
    for samples in [u64::MAX / 16 * 16, u64::MAX] {
        let refused = fails(&with(samples), None);
        assert!(matches!(refused, ReferenceError::TooMany { .. }), "{samples}: {refused}");
    }
    let jittered = ReferenceOptions { sampler: Sampler::Jittered { density: 1 }, ..with(16) };
    let sums = || Some(reference(&scene, &with(16)).sums);
    assert!(matches!(fails(&jittered, sums()), ReferenceError::Fixed));
    assert!(matches!(fails(&ReferenceOptions { error: Some(0.1), ..jittered }, None), ReferenceError::Fixed));
    let other = ReferenceOptions { look: Look { aovs: vec![Aov::Depth], ..with(32).look }, ..with(32) };
    assert!(matches!(fails(&other, sums()), ReferenceError::Unlike { .. }));
    for aovs in [vec![Aov::Object], vec![Aov::Velocity, Aov::Depth]] {
        let refused = fails(&ReferenceOptions { look: Look { aovs, ..Look::default() }, ..with(16) }, None);
        assert!(refused.to_string().contains("options.look.aovs"), "{refused}");
    }
    assert!(matches!(probe(&scene, 0, &with(16), [8, 0], None), Err(ReferenceError::NoPixel { .. })));
    assert!(matches!(probe(&scene, 0, &with(16), [0, 0], Some(16)), Err(ReferenceError::NoSample { .. })));
}

/// Ellipses before, around and behind the camera, tiny to huge, facing anywhere.
fn random_surfels(n: u32) -> Surfels {
    let mut surfels = Surfels::default();
    for i in 0..n {
        let h = |k: u64| f64::from(splatblur::sampling::hash(u64::from(i), k)) / 2_f64.powi(31) - 1.0;
        let v = |k: u64| DVec3::new(h(k), h(k + 1), h(k + 2));
        let radius = (h(20) * 3.0 - 4.0).exp2();
        let u = v(0).normalize() * radius;
        let w = u.cross(v(3)).normalize() * radius * (0.6 + 0.4 * h(21)) + u * (0.3 * h(22));
        surfels.position.push((v(6) * DVec3::new(1.5, 1.2, 2.0)).as_vec3());
        surfels.axis_u.push(u.as_vec3());
        surfels.axis_v.push(w.as_vec3());
        surfels.normal.push(u.cross(w).normalize().as_vec3());
        surfels.colour.push((v(10) * 0.5 + 0.5).as_vec3());
    }
    surfels
}

/// Each sample of some pixels against all surfels, one by one, with other mathematics (a 3 x 3 solve in world space).
#[test]
fn samples_match_brute_force() {
    const EPSILON: f64 = 0.05;
    let mut cloud = object(random_surfels(3000));
    cloud.shape.surface_mut().unwrap().material = Some(UNLIT);
    cloud.epsilon = Some(EPSILON);
    cloud.transform.scale = DVec3::new(1.0, -1.3, 0.7);
    cloud.transform.rotate = DVec3::new(0.4, 0.2, -1.0);
    cloud.motions = vec![
        Motion::Rotation { axis: DVec3::new(0.6, 0.0, 0.8), per_frame: 1.3, centre: DVec3::new(0.2, 0.1, 0.0) },
        Motion::Linear { velocity: DVec3::new(0.2, -0.3, 0.5) },
    ];
    let mut scene = scene(vec![cloud], [24, 16], DVec3::new(0.1, 0.2, 1.4), 60.0);
    scene.camera.near = 0.1;
    let brute = |sample: &splatblur::reference::Sample, two_sided: bool| {
        let object = &scene.objects[0];
        let m = splatblur::scene::pose::object_pose(&scene, object, sample.time).world_from_model;
        let [eye, direction] = sample.ray;
        let mut hits = Vec::new();
        let model = object.shape.surfels().unwrap().surfels();
        for i in 0..model.len() {
            let c = m.transform_point3(model.position[i].as_dvec3()) - eye;
            let [u, v] = [&model.axis_u, &model.axis_v].map(|a| m.transform_vector3(a[i].as_dvec3()));
            let system = glam::DMat3::from_cols(direction, -u, -v);
            if system.determinant() == 0.0 {
                continue;
            }
            let [depth, a, b] = (system.inverse() * c).to_array();
            // Mirrored by the scale: the front is where u x v points in model space.
            let front = system.determinant() * m.determinant() < 0.0;
            if depth >= 0.1 && a * a + b * b <= 1.0 && (front || two_sided) {
                hits.push((depth, (-2.0 * (a * a + b * b)).exp(), model.colour[i].as_dvec3()));
            }
        }
        let limit = hits.iter().map(|h| h.0 + EPSILON).fold(f64::INFINITY, f64::min);
        hits.retain(|h| h.0 <= limit);
        let weight: f64 = hits.iter().map(|h| h.1).sum();
        let colour = hits.iter().map(|h| h.1 * h.2).sum::<DVec3>();
        (weight > 0.0).then(|| (colour / weight, hits.len()))
    };
    let pixels: Vec<(u32, u32)> = (0..16).flat_map(|y| (0..24).map(move |x| (x, y))).collect();
    for two_sided in [false, true] {
        let options = ReferenceOptions { look: Look { two_sided, ..with(16).look }, ..with(16) };
        let hits: usize = pixels
            .par_iter()
            .map(|&(x, y)| {
                let mut count = 0;
                for i in 0..4 {
                    let sample = probe(&scene, 0, &options, [x, y], Some(i)).expect("a sample").sample;
                    let sample = sample.expect("asked for");
                    let expected = brute(&sample, two_sided);
                    assert_eq!(sample.colour.is_some(), expected.is_some(), "pixel {x},{y} sample {i}");
                    if let (Some(got), Some((want, hits))) = (sample.colour, expected) {
                        assert!((got - want).length() < 1e-6, "pixel {x},{y} sample {i}: {got}, brute force {want}");
                        assert_eq!(sample.hits.iter().filter(|hit| hit.admitted).count(), hits);
                        count += hits;
                    }
                }
                count
            })
            .sum();
        assert!(hits > 1000, "{hits} hits compared");
    }
}

/// Supersampling without prefilter converges to the reference, with all AOVs.
fn supersampling_converges(shading: Shading, filter: PixelFilter) {
    let mut scene = busy_scene(64);
    scene.image.transparent = true;
    let aovs = Aov::ALL.to_vec();
    let made = reference(
        &scene,
        &ReferenceOptions { look: Look { shading, filter, aovs: aovs.clone(), ..with(1024).look }, ..with(1024) },
    );
    let splatted = |samples| {
        let mode = BlurMode::supersample(samples);
        let aovs = aovs.clone();
        let options = RenderOptions {
            quality: mode.into(),
            prefilter: Prefilter::None,
            look: Look { shading, filter, aovs, ..Look::default() },
            ..Default::default()
        };
        render(&scene, &options)
    };
    let few = rms(&splatted(16), &made.picture);
    let many = splatted(1024);
    let error = rms(&many, &made.picture);
    println!(
        "{shading:?} {filter:?}: rms difference {few:.2e} at 16, {error:.2e} at 1024; SE {:.2e}",
        made.stats.mean_error
    );
    assert!(error < 2.5e-3 && error < 0.2 * few, "{shading:?} {filter:?}: {few:.2e} at 16, {error:.2e} at 1024");
    for (ours, theirs) in made.picture.layers.iter().zip(&many.layers) {
        assert_eq!(ours.aov, theirs.aov);
        let scale = if ours.aov == Aov::Velocity { 30.0 } else { 1.0 };
        let mut worst = 0.0_f32;
        for (ours, theirs) in ours.planes.iter().zip(&theirs.planes) {
            for (i, (a, b)) in ours.iter().zip(theirs).enumerate() {
                // Pixels that are hardly covered have few samples that say what is there.
                if made.picture.rgba[i][3] > 0.2 && many.rgba[i][3] > 0.2 {
                    worst = worst.max((a - b).abs());
                }
            }
        }
        println!("  {}: largest difference {worst:.3}", ours.aov.name());
        assert!(worst < 0.06 * scale, "{}: {worst}", ours.aov.name());
    }
}

// Not deep: it alone holds all layers against the reference.
#[test]
fn supersampling_converges_to_it() {
    supersampling_converges(Shading::Phong, PixelFilter::Box);
}

#[test]
#[ignore = "deep: many samples"]
fn supersampling_with_gouraud_shading_converges_to_it() {
    supersampling_converges(Shading::Gouraud, PixelFilter::Point);
}

#[test]
fn dense_surfels_approach_the_ideal_sphere() {
    let [.., last] = approaches_the_ideal_sphere([1000, 10_000, 100_000], 64);
    assert!(last < 2e-3, "{last:.2e}");
}

/// The table of slopes in small (`examples/table_reference.rs`): Sobol' points are nearest to many samples of another
/// seed, independent random numbers are furthest.
#[test]
fn samplers_rank_as_they_should() {
    let mut scene = busy_scene(40);
    scene.image.transparent = true;
    let traced = |sampler, samples, seed| {
        reference(
            &scene,
            &ReferenceOptions {
                sampler,
                samples,
                look: Look { seed, ..Look::default() },
                ..ReferenceOptions::default()
            },
        )
        .picture
    };
    let truth = traced(Sampler::Sobol, 4096, 99);
    let error = |sampler, samples| rms(&traced(sampler, samples, 1), &truth);
    let [sobol, jittered, random] =
        [Sampler::Sobol, Sampler::Jittered { density: 4 }, Sampler::Random].map(|sampler| error(sampler, 256));
    println!("{sobol:.2e} {jittered:.2e} {random:.2e}");
    assert!(sobol < jittered && jittered < random, "{sobol:.2e} {jittered:.2e} {random:.2e}");
    // Four times the samples: half the error of random numbers, clearly less of Sobol' points.
    let (fewer_sobol, fewer_random) = (error(Sampler::Sobol, 64), error(Sampler::Random, 64));
    println!("with a quarter of the samples {fewer_sobol:.2e} {fewer_random:.2e}");
    assert!(sobol < 0.42 * fewer_sobol, "{sobol:.2e} after {fewer_sobol:.2e}");
    assert!((random / fewer_random - 0.5).abs() < 0.08, "{random:.2e} after {fewer_random:.2e}");
}
