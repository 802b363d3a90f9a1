//! Small scenes that take every branch of the passes.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::environment::{Environment, LatLong};
use crate::film::Aov;
use crate::frame::{Blocks, Frame};
use crate::math::random::Random;
use crate::model::{Material, Surfels};
use crate::options::{
    BlurMode, Interleave, KernelShape, KernelWeight, Look, Normalise, Overlap, PixelFilter, Prefilter, Quality,
    RenderOptions, Shading, SourceSamples, SweptKernel, TemporalAlpha, Times,
};
use crate::scene::{Camera, FrameRange, ImageSettings, Light, Motion, Object, Scene, Shape, SurfelModel};
use crate::time::{Shutter, Weight};

/// A scene and how it is rendered.
#[derive(Clone)]
pub(super) struct Case {
    pub name: &'static str,
    pub scene: Scene,
    pub options: RenderOptions,
    /// Only every other block of the image.
    pub in_part: bool,
}

impl Case {
    /// Its frame.
    pub(super) fn frame(&self) -> Frame {
        let Quality::Mode(mode) = self.options.quality else { unreachable!("cases have modes") };
        let mut frame = Frame::new(&self.scene, 0, mode, &self.options);
        let [width, height] = Blocks::count(frame.size, frame.stride);
        let wanted = (0..width * height).map(|block| block % 2 == 1).collect();
        frame.wanted = self.in_part.then_some(Blocks { width, wanted });
        frame
    }
}

impl Case {
    /// What its kernels in motion are.
    pub(super) fn kernel(&self) -> SweptKernel {
        let Quality::Mode(mode) = self.options.quality else { unreachable!("cases have modes") };
        mode.swept().unwrap_or_default()
    }
}

/// Elliptical surfels scattered over a ball of radius 1, as dense as a surface of `n` surfels.
pub(in crate::backend) fn ball(n: usize, seed: u64, materials: bool) -> Surfels {
    let mut random = Random(seed);
    let mut surfels = Surfels::default();
    while surfels.len() < n {
        let position = random.vector();
        if !(0.1..1.0).contains(&position.length()) {
            continue;
        }
        let normal = position.normalize();
        let u = normal.any_orthonormal_vector();
        let size = 4.0 / (n as f32).sqrt();
        surfels.position.push(normal);
        surfels.axis_u.push(u * size);
        surfels.axis_v.push(normal.cross(u) * size * (0.5 + random.next()));
        surfels.normal.push((normal + 0.2 * random.vector()).normalize());
        surfels.colour.push(Vec3::new(random.next(), random.next(), random.next()));
        if materials {
            let [ambient, diffuse, specular] = [random.next(), random.next(), random.next()];
            surfels.material.push(Material { ambient, diffuse, specular, shininess: 40.0 * random.next() });
        }
    }
    surfels
}

/// Surfels that are hard on a projection: edge-on, near and around the camera, huge, tiny, far away, not numbers.
fn hard() -> SurfelModel {
    let mut surfels = Surfels::default();
    let mut add = |position: Vec3, u: Vec3, v: Vec3| {
        surfels.position.push(position);
        surfels.axis_u.push(u);
        surfels.axis_v.push(v);
        surfels.normal.push(u.cross(v).try_normalize().unwrap_or(Vec3::Z));
        surfels.colour.push(Vec3::new(0.2, 0.5, 0.8));
    };
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    add(Vec3::ZERO, 0.1 * x, 0.1 * z); // edge-on
    add(Vec3::ZERO, 0.1 * x, 0.1 * (z + 1e-4 * y)); // nearly
    add(Vec3::new(0.1, 0.0, 2.98), 0.1 * x, 0.1 * y); // at the near plane
    add(Vec3::new(0.0, -0.1, 2.9), 0.5 * z, 0.3 * x); // through the camera's plane
    add(Vec3::new(0.0, 0.2, 3.5), 0.5 * z, 0.3 * x); // behind, but reaching
    add(Vec3::new(0.1, -0.2, 3.0), 0.5 * z, 0.3 * x); // its centre on the camera's plane
    add(Vec3::new(0.0, 0.0, 9.0), 0.1 * x, 0.1 * y); // behind
    add(Vec3::new(0.0, 0.0, -4.0), 9.0 * x, 9.0 * y); // the whole image
    add(Vec3::new(0.0, 0.0, -5.0), 1e6 * x, 1e6 * y);
    add(Vec3::new(0.0, -2.0, -1e3), 1e4 * x, 1e4 * (y + z));
    add(Vec3::new(1e6, 0.0, -1.0), 0.1 * x, 0.1 * y); // off the image
    add(Vec3::new(0.3, 0.3, 0.0), 1e-4 * x, 1e-4 * y); // below a pixel
    add(Vec3::new(0.4, 0.3, 0.0), 1e-20 * x, 1e-20 * y);
    add(Vec3::new(f32::NAN, 0.0, 0.0), 0.1 * x, 0.1 * y);
    add(Vec3::ZERO, Vec3::new(f32::INFINITY, 0.0, 0.0), 0.1 * y);
    add(Vec3::new(0.0, f32::INFINITY, 0.0), 0.1 * x, 0.1 * y);
    add(Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    add(Vec3::new(-0.4, 0.1, 0.0), 0.2 * x, -0.2 * y); // from behind
    // Programs that make such a model are told so; passes must stand it.
    SurfelModel::checked(Arc::new(surfels))
}

pub(in crate::backend) fn object(model: impl Into<Shape>, at: DVec3) -> Object {
    let mut object = Object::new(model);
    object.transform.translate = at;
    object
}

pub(in crate::backend) fn scene(objects: Vec<Object>, size: [u32; 2]) -> Scene {
    let eye = DVec3::new(0.0, 0.0, 3.0);
    Scene {
        name: "test".into(),
        image: ImageSettings { width: size[0], height: size[1], ..Default::default() },
        frames: FrameRange { first: 0, last: 0, rate: 24.0 },
        shutter: Shutter { open: 0.0, close: 1.0, weight: Weight::Ramp { centre: 1.0 }, ..Shutter::default() },
        camera: Camera::new(eye, eye - DVec3::Z),
        lights: vec![
            Light::directional(DVec3::new(-0.5, -1.0, -0.8).normalize(), DVec3::splat(0.9)).without_shadows(),
            Light::Ambient { colour: DVec3::new(0.3, 0.2, 0.4) },
            Light::point(DVec3::new(1.0, 0.5, 2.0), DVec3::new(0.1, 0.4, 0.2)).without_shadows(),
        ],
        environment: None,
        objects,
        files: crate::files::Seen::new(),
    }
}

/// Two moving balls, one mirrored and seen from both sides, with materials of their own.
fn two_balls(size: [u32; 2]) -> Scene {
    let mut first = object(ball(900, 1, true), DVec3::new(-0.3, 0.0, -1.0));
    first.motions = vec![
        Motion::Rotation { axis: DVec3::Y, per_frame: 0.7, centre: DVec3::ZERO },
        Motion::Linear { velocity: DVec3::new(0.3, 0.1, 0.2) },
    ];
    let mut second = object(ball(300, 2, false), DVec3::new(0.5, 0.2, -0.6));
    second.transform.scale = DVec3::new(-0.5, 0.7, 0.4);
    second.shape.surface_mut().unwrap().two_sided = true;
    second.epsilon = Some(0.0);
    (first.shape.surface_mut().unwrap().reflection, second.shape.surface_mut().unwrap().reflection) = (0.6, 0.2);
    let mut scene = scene(vec![first, second], size);
    scene.environment = Some(surroundings());
    scene
}

/// Three moving balls, one in the other, nearer to each other than the tolerance of the outer one alone.
fn nested(size: [u32; 2]) -> Scene {
    let shell = |n: usize, radius: f64, epsilon: f64, turns: f64| {
        let mut shell = object(ball(n, n as u64, false), DVec3::new(0.0, 0.0, -1.0));
        shell.transform.scale = DVec3::splat(radius);
        shell.motions = vec![
            Motion::Rotation { axis: DVec3::Y, per_frame: turns, centre: DVec3::ZERO },
            Motion::Linear { velocity: DVec3::new(0.2, 0.1, 0.1) },
        ];
        shell.epsilon = Some(epsilon);
        shell
    };
    // The outer one has holes.
    scene(vec![shell(200, 1.0, 0.3, 0.2), shell(900, 0.94, 0.02, -0.3), shell(600, 0.88, 0.1, 0.1)], size)
}

/// A noisy environment, which lights the scene.
pub(super) fn surroundings() -> Environment {
    let mut random = Random(40);
    let pixels = (0..64 * 32).map(|_| [random.next(), random.next(), 2.0 * random.next()]).collect();
    let mut environment = Environment::new(LatLong::new(64, pixels).unwrap());
    (environment.rotation, environment.intensity) = (0.7, 0.8);
    (environment.light, environment.shadows) = (true, false);
    environment
}

/// All cases.
pub(super) fn all() -> Vec<Case> {
    let options = |mode: BlurMode| RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::Approx,
        look: Look { aovs: Aov::ALL.to_vec(), ..Look::default() },
        ..RenderOptions::default()
    };
    let bucket = |interleave| BlurMode::Bucket {
        buckets: 2,
        samples: 3,
        pixel_samples: Some(2),
        interleave,
        times: Times::Even,
    };
    let mut mirrored = two_balls([70, 45]);
    mirrored.objects[1].shape.surface_mut().unwrap().two_sided = false;
    // All objects have one coefficient.
    mirrored.objects.iter_mut().for_each(|object| object.shape.surface_mut().unwrap().reflection = 0.4);
    let mut matt = two_balls([70, 45]);
    matt.environment = None;
    let mut seen_twice = scene(vec![object(hard(), DVec3::ZERO)], [150, 140]);
    seen_twice.objects[0].shape.surface_mut().unwrap().two_sided = true;
    let rolling = |text: &str| {
        let mut scene = two_balls([70, 45]);
        scene.objects[0].motions = vec![
            Motion::Rotation { axis: DVec3::Y, per_frame: 0.3, centre: DVec3::ZERO },
            Motion::Linear { velocity: DVec3::new(1.1, -0.7, 0.5) },
        ];
        scene.shutter.readout = text.parse().unwrap();
        scene
    };
    // With a tolerance that lets splats hide some static splats of a pixel, and not all.
    let point = |mode| RenderOptions {
        look: Look { filter: PixelFilter::Point, epsilon: Some(0.4), ..options(mode).look },
        ..options(mode)
    };
    let unfiltered = |mode| RenderOptions { prefilter: Prefilter::None, ..options(mode) };
    let case = |name, scene, options| Case { name, scene, options, in_part: false };
    let in_part = |name, scene, options| Case { in_part: true, ..case(name, scene, options) };
    vec![
        case("supersample", two_balls([70, 45]), options(BlurMode::supersample(2))),
        case("bucket", two_balls([70, 45]), options(bucket(Interleave::None))),
        case("interleaved", mirrored.clone(), options(bucket(Interleave::Two))),
        case(
            "gouraud",
            two_balls([70, 45]),
            RenderOptions {
                look: Look { shading: Shading::Gouraud, aovs: Vec::new(), ..options(BlurMode::supersample(2)).look },
                ..options(BlurMode::supersample(2))
            },
        ),
        case(
            "plain",
            mirrored,
            RenderOptions {
                prefilter: Prefilter::None,
                look: Look { aovs: Vec::new(), ..options(BlurMode::supersample(2)).look },
                ..options(BlurMode::supersample(2))
            },
        ),
        case("hard", scene(vec![object(hard(), DVec3::ZERO)], [150, 140]), options(BlurMode::supersample(2))),
        case("hard, two-sided", seen_twice.clone(), options(bucket(Interleave::None))),
        case("layer", matt, point(BlurMode::supersample(3))),
        case("layer, bucket", two_balls([70, 45]), point(bucket(Interleave::None))),
        in_part("in part", two_balls([70, 45]), point(BlurMode::supersample(2))),
        in_part("in part, hard", seen_twice, options(bucket(Interleave::None))),
        case("one pixel", two_balls([1, 1]), options(BlurMode::supersample(1))),
        case("rolling", rolling("0.8"), options(BlurMode::supersample(2))),
        in_part("rolling, in part", rolling("0.8,left"), point(BlurMode::supersample(2))),
        case("tolerances", nested([70, 45]), unfiltered(BlurMode::supersample(2))),
        case("tolerances, bucket", nested([70, 45]), unfiltered(bucket(Interleave::None))),
        case("walls", walls(), unfiltered(BlurMode::supersample(2))),
        case("spheres", spheres([150, 140]), options(BlurMode::supersample(2))),
        case("spheres, bucket", spheres([70, 45]), unfiltered(bucket(Interleave::None))),
        // Surfels are much smaller than pixels: all levels of their texture.
        case(
            "far",
            two_balls([18, 12]),
            RenderOptions { prefilter: Prefilter::None, ..options(BlurMode::supersample(1)) },
        ),
    ]
}

/// Spheres beside discs: one of them about the eye, some through the camera's plane, and some within each other.
fn spheres(size: [u32; 2]) -> Scene {
    let as_spheres = |surfels: &Surfels| {
        let mut surfels = surfels.clone();
        (surfels.spheres, surfels.two_sided) = (true, true);
        SurfelModel::checked(Arc::new(surfels))
    };
    let mut scene = two_balls(size);
    scene.objects[1].shape = as_spheres(&ball(300, 2, false)).into();
    scene.objects[1].transform.scale = DVec3::new(-0.5, 0.5, 0.5);
    scene.objects.push(object(as_spheres(hard().surfels()), DVec3::ZERO));
    scene
}

/// Two objects of other tolerances, each of some discs behind each other that are larger than the image, and move.
fn walls() -> Scene {
    let wall = |first: f32, epsilon: f64| {
        let mut surfels = Surfels::default();
        for i in 0..8 {
            let tilt = Vec3::new(0.0, 0.1 * i as f32 - 0.3, 1.0).normalize();
            let u = 7.0 * Vec3::X;
            surfels.position.push(Vec3::new(0.0, 0.0, first - 0.13 * i as f32));
            surfels.axis_u.push(u);
            surfels.axis_v.push(tilt.cross(u));
            surfels.normal.push(tilt);
            surfels.colour.push(Vec3::new(0.1 * i as f32, 0.5, 0.9 - 0.1 * i as f32));
        }
        let mut object = object(surfels, DVec3::ZERO);
        object.motions = vec![Motion::Linear { velocity: DVec3::new(0.3, 0.2, 0.1) }];
        object.epsilon = Some(epsilon);
        object
    };
    scene(vec![wall(-1.0, 0.3), wall(-1.07, 0.02)], [150, 140])
}

/// Few splats, each on dozens of tiles.
pub(super) fn large_splats() -> Case {
    let mut scene = scene(vec![object(ball(100, 3, false), DVec3::ZERO)], [256, 256]);
    scene.objects[0].shape.surface_mut().unwrap().two_sided = true;
    let options = RenderOptions {
        quality: BlurMode::supersample(1).into(),
        prefilter: Prefilter::Approx,
        ..RenderOptions::default()
    };
    Case { name: "large splats", scene, options, in_part: false }
}

/// Kernels in motion: each that there is.
pub(super) fn swept() -> Vec<Case> {
    let mut moving = scene(vec![object(hard(), DVec3::ZERO)], [150, 140]);
    moving.objects[0].motions = vec![Motion::Linear { velocity: DVec3::new(0.3, 0.1, 0.4) }];
    moving.objects[0].shape.surface_mut().unwrap().two_sided = true;
    let mut fast = two_balls([70, 45]);
    fast.objects[0].motions.push(Motion::Linear { velocity: DVec3::new(0.9, -0.4, 1.2) });
    // In the first of two intervals the first ball's front comes nearer than that.
    let mut near = fast.clone();
    near.camera.near = 2.7;
    let options = |swept: SweptKernel| RenderOptions {
        quality: BlurMode::Volumetric { intervals: 2, pixel_samples: None, swept }.into(),
        prefilter: if swept.is_published() { Prefilter::Approx } else { Prefilter::None },
        look: Look { aovs: Aov::ALL.to_vec(), ..Look::default() },
        ..RenderOptions::default()
    };
    let tube = SweptKernel::default();
    let ellipsoid = SweptKernel { shape: KernelShape::Ellipsoid, ..tube };
    let chord = SweptKernel { weight: KernelWeight::Chord, ..ellipsoid };
    let line = SweptKernel { weight: KernelWeight::Line, alpha: TemporalAlpha::Sum, ..ellipsoid };
    let case = |name, scene: &Scene, options| Case { name, scene: scene.clone(), options, in_part: false };
    vec![
        case("tube", &two_balls([70, 45]), options(tube)),
        case("fast", &fast, options(tube)),
        case("hard", &moving, options(tube)),
        case("near", &near, options(tube)),
        case("near ellipsoid", &near, options(ellipsoid)),
        case("plain", &fast, RenderOptions { look: Look { aovs: Vec::new(), ..options(tube).look }, ..options(tube) }),
        case("sum", &fast, options(SweptKernel { alpha: TemporalAlpha::Sum, ..tube })),
        case("once", &fast, options(SweptKernel { normalise: Normalise::Once, ..tube })),
        case("ellipsoid", &fast, options(ellipsoid)),
        case("hard ellipsoid", &moving, options(ellipsoid)),
        case("chord", &fast, options(chord)),
        case("line", &fast, options(line)),
        case("hard line", &moving, options(line)),
        case("near line", &near, options(SweptKernel { source_samples: SourceSamples(3), ..line })),
        case("overlap", &fast, options(SweptKernel { overlap: Overlap(0.8), ..tube })),
        case("published", &fast, options(SweptKernel::PUBLISHED)),
        case("one pixel", &two_balls([1, 1]), options(tube)),
        case("tolerances", &nested([70, 45]), options(tube)),
        case("walls", &walls(), options(tube)),
    ]
}
