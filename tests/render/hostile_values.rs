//! Absurd values of scenes and options, set in code: each is an error that names its field, or a finite picture.

#![allow(clippy::unwrap_used, reason = "tests may stop")]

use std::panic::{AssertUnwindSafe, catch_unwind};

use glam::{DVec2, DVec3, Vec3};
use splatblur::film::Aov;
use splatblur::model::{Gaussians, Material, Optics, Surfels, SurfelsBuilder, VelocityUnit};
use splatblur::options::{
    BlurMode, ErrorTarget, Interleave, KernelWeight, Look, Overlap, PixelFilter, Quality, RenderOptions, SourceSamples,
    SweptKernel, Times,
};
use splatblur::reference::{self, ReferenceError, ReferenceOptions};
use splatblur::scene::{Capture, GaussianModel, Light, Motion, Object, Scene, Shape, Sphere};
use splatblur::time::Weight;
use splatblur::{BackendError, Device, Environment, LatLong, Renderer};

/// Two discs before the camera.
fn discs() -> Surfels {
    Surfels {
        position: vec![Vec3::ZERO, Vec3::X],
        axis_u: vec![Vec3::X; 2],
        axis_v: vec![Vec3::Y; 2],
        normal: vec![Vec3::Z; 2],
        colour: vec![Vec3::ONE; 2],
        ..Surfels::default()
    }
}

fn scene() -> Scene {
    let mut object = Object::new(discs());
    object.motions.push(Motion::Linear { velocity: DVec3::X });
    let mut scene = Scene::new([object]);
    (scene.image.width, scene.image.height) = (12, 9);
    (scene.camera.eye, scene.camera.at) = (DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO);
    scene.environment = Some(Environment::new(LatLong::new(4, vec![[0.5; 3]; 8]).unwrap()));
    scene
}

fn options() -> RenderOptions {
    RenderOptions { quality: BlurMode::supersample(2).into(), ..RenderOptions::default() }
}

/// The error of a renderer, or whether all of its picture is finite.
fn rendered(scene: &Scene, options: &RenderOptions) -> Result<bool, BackendError> {
    let mut renderer = Renderer::open(Device::Cpu).unwrap();
    let picture = renderer.render(scene, 1, options)?.picture;
    Ok(picture.rgba.iter().flatten().all(|value| value.is_finite()))
}

type Change = fn(&mut Scene, &mut RenderOptions);

/// What a scene or an option may not be, and the field that its error names.
const REFUSED: &[(&str, Change)] = &[
    ("image.width", |s, _| s.image.width = 0),
    ("image.width", |s, _| s.image.width = u32::MAX),
    ("image.height", |s, _| s.image.height = 0),
    ("image.height", |s, _| s.image.height = 65_536),
    ("image.background", |s, _| s.image.background.y = f64::NAN),
    ("frames.rate", |s, _| s.frames.rate = 0.0),
    ("frames.last", |s, _| (s.frames.first, s.frames.last) = (3, 2)),
    ("frames.first", |s, _| s.frames.first = i64::MIN),
    ("shutter.open", |s, _| s.shutter.open = f64::NEG_INFINITY),
    ("shutter.close", |s, _| s.shutter.close = -1.0),
    ("shutter.readout.duration", |s, _| s.shutter.readout.duration = f64::NAN),
    ("shutter.weight.curve", |s, _| s.shutter.weight = Weight::Curve(vec![(0.0, 0.0), (1.0, 0.0)])),
    ("shutter.weight.curve", |s, _| s.shutter.weight = Weight::Curve(Vec::new())),
    ("shutter.weight.curve[1].time", |s, _| s.shutter.weight = Weight::Curve(vec![(0.5, 1.0), (0.5, 1.0)])),
    ("shutter.weight.curve[0].weight", |s, _| s.shutter.weight = Weight::Curve(vec![(0.5, f64::NAN)])),
    ("shutter.weight.width", |s, _| s.shutter.weight = Weight::Gaussian { centre: 0.5, width: 0.0 }),
    ("shutter.weight.rate", |s, _| s.shutter.weight = Weight::Exponential { rate: 0.0, centre: 0.5 }),
    ("shutter.weight.centre", |s, _| s.shutter.weight = Weight::Ramp { centre: f64::NAN }),
    ("camera.eye", |s, _| s.camera.eye.x = f64::NAN),
    ("camera.at", |s, _| s.camera.at.z = f64::INFINITY),
    ("camera.at", |s, _| s.camera.at = s.camera.eye),
    ("camera.up", |s, _| s.camera.up = DVec3::ZERO),
    ("camera.at", |s, _| s.camera.up = DVec3::Z),
    ("camera.fovy", |s, _| s.camera.fovy = f64::NAN),
    ("camera.fovy", |s, _| s.camera.fovy = 4.0),
    ("camera.near", |s, _| s.camera.near = f64::NAN),
    ("camera.near", |s, _| s.camera.near = 0.0),
    ("camera.shift", |s, _| s.camera.shift = DVec2::NAN),
    ("camera.motions[0].velocity", |s, _| s.camera.motions = vec![Motion::Linear { velocity: DVec3::NAN }]),
    ("lights[0].colour", |s, _| s.lights = vec![Light::Ambient { colour: DVec3::INFINITY }]),
    ("lights[0].position", |s, _| s.lights = vec![Light::point(DVec3::NAN, DVec3::ONE)]),
    ("lights[0].angle", |s, _| s.lights = vec![directional(f64::NAN)]),
    ("lights[0].angle", |s, _| s.lights = vec![directional(-0.1)]),
    ("lights[0].angle", |s, _| s.lights = vec![directional(3.2)]),
    ("lights[0].radius", |s, _| s.lights = vec![ball_of_light(-1.0)]),
    ("lights[0].radius", |s, _| s.lights = vec![ball_of_light(f64::INFINITY)]),
    ("lights[0].direction", |s, _| s.lights = vec![Light::directional(DVec3::ZERO, DVec3::ONE)]),
    ("environment.intensity", |s, _| s.environment.as_mut().unwrap().intensity = f64::NAN),
    ("environment.rotation", |s, _| s.environment.as_mut().unwrap().rotation = f64::INFINITY),
    ("objects", |s, _| s.objects.clear()),
    ("objects[0].transform.scale", |s, _| s.objects[0].transform.scale.x = f64::NAN),
    ("objects[0].transform.scale", |s, _| s.objects[0].transform.scale.y = 0.0),
    ("objects[0].place.translate", |s, _| s.objects[0].place.translate.x = f64::NAN),
    ("objects[0].place.rotate", |s, _| s.objects[0].place.rotate.x = f64::NAN),
    ("objects[0].motions[0].velocity", |s, _| s.objects[0].motions = vec![Motion::Linear { velocity: DVec3::NAN }]),
    ("objects[0].motions[1].axis", |s, _| {
        s.objects[0].motions.push(Motion::Rotation { axis: DVec3::ZERO, per_frame: 1.0, centre: DVec3::ZERO });
    }),
    ("objects[0].shape.points.at", |s, _| s.objects[0].shape.points_mut().unwrap().at = Some(f64::NAN)),
    ("objects[0].shape.surface.material.shininess", |s, _| {
        s.objects[0].shape.surface_mut().unwrap().material =
            Some(Material { shininess: f32::NAN, ..Material::default() });
    }),
    ("objects[0].opacity", |s, _| s.objects[0].opacity = f64::NAN),
    ("objects[0].shape.surface.reflection", |s, _| s.objects[0].shape.surface_mut().unwrap().reflection = 2.0),
    ("objects[0].epsilon", |s, _| s.objects[0].epsilon = Some(f64::NAN)),
    ("objects[0].shape.sphere.radius", |s, _| s.objects[0].shape = Sphere { radius: 0.0, colour: Vec3::ONE }.into()),
    ("objects[0].shape.capture.harmonics", |s, _| {
        let capture = Capture { harmonics: 4, ..Capture::default() };
        s.objects[0].shape = Shape::Gaussians { model: Gaussians::default().into(), capture };
    }),
    ("objects[0].shape.model.optics", |s, _| {
        s.objects[0].shape = Shape::Volume { model: Gaussians::default().into(), material: None };
    }),
    ("objects[0].shape.model.optics", |s, _| {
        let gaussians = Gaussians { optics: Optics::Extinction { layer: 1.0 }, ..Gaussians::default() };
        s.objects[0].shape = Shape::Gaussians { model: gaussians.into(), capture: Capture::default() };
    }),
    ("objects[0].shape.model.crop[1]", |s, _| {
        let mut model = GaussianModel::from(Gaussians::default());
        model.crop = Some([DVec3::ONE, DVec3::ZERO]);
        s.objects[0].shape = model.into();
    }),
];

/// What concerns a renderer alone.
const REFUSED_OPTIONS: &[(&str, Change)] = &[
    ("options.quality.samples", |_, o| o.quality = BlurMode::supersample(0).into()),
    ("options.quality.samples", |_, o| o.quality = BlurMode::supersample(u32::MAX).into()),
    ("options.quality.pixel_samples", |_, o| o.quality = BlurMode::Still { pixel_samples: 0 }.into()),
    ("options.quality.intervals", |_, o| o.quality = volumetric(0, SweptKernel::default())),
    ("options.quality.swept.overlap", |_, o| {
        o.quality = volumetric(2, SweptKernel { overlap: Overlap(f64::NAN), ..SweptKernel::default() });
    }),
    ("options.quality.swept.source_samples", |_, o| {
        o.quality = volumetric(2, SweptKernel { source_samples: SourceSamples(0), ..SweptKernel::default() });
    }),
    ("options.quality.swept.weight", |_, o| {
        o.quality = volumetric(2, SweptKernel { weight: KernelWeight::Chord, ..SweptKernel::default() });
    }),
    ("options.quality.buckets", |_, o| o.quality = bucket(65_536, 65_536)),
    ("options.quality.samples", |_, o| o.quality = bucket(1, 0)),
    ("options.quality.error", |_, o| o.quality = ErrorTarget { error: f64::NAN, ..ErrorTarget::default() }.into()),
    ("options.quality.pixel_samples", |_, o| {
        o.quality = ErrorTarget { pixel_samples: 0, ..ErrorTarget::default() }.into();
    }),
    ("options.quality.pixel_samples", |_, o| {
        o.quality = ErrorTarget { pixel_samples: u32::MAX, ..ErrorTarget::default() }.into();
    }),
    ("options.quality.samples_max", |_, o| {
        o.quality = ErrorTarget { samples_max: 0, ..ErrorTarget::default() }.into();
    }),
    ("options.look.filter.sigma", |_, o| o.look.filter = PixelFilter::Gaussian { sigma: 1e9 }),
    ("options.look.filter.sigma", |_, o| o.look.filter = PixelFilter::Gaussian { sigma: f64::NAN }),
    ("options.look.epsilon", |_, o| o.look.epsilon = Some(f64::NAN)),
    ("options.look.aovs", |_, o| o.look.aovs = vec![Aov::Depth, Aov::Depth]),
    ("options.look.aovs", |_, o| o.look.aovs = vec![Aov::Velocity, Aov::Depth]),
];

const fn volumetric(intervals: u32, swept: SweptKernel) -> Quality {
    Quality::Mode(BlurMode::Volumetric { intervals, pixel_samples: None, swept })
}

const fn bucket(buckets: u32, samples: u32) -> Quality {
    let (interleave, times) = (Interleave::None, Times::Even);
    Quality::Mode(BlurMode::Bucket { buckets, samples, pixel_samples: None, interleave, times })
}

/// A light with shadows and a diameter of `angle` radians.
fn directional(angle: f64) -> Light {
    Light::Directional { direction: DVec3::NEG_Y, colour: DVec3::ONE, angle, shadows: true }
}

/// A light with shadows and a radius.
fn ball_of_light(radius: f64) -> Light {
    Light::Point { position: DVec3::ONE, colour: DVec3::ONE, radius, shadows: true }
}

#[test]
fn what_cannot_be_rendered_names_its_field() {
    assert!(rendered(&scene(), &options()).unwrap());
    for (number, (field, change)) in REFUSED.iter().chain(REFUSED_OPTIONS).enumerate() {
        let (mut scene, mut options) = (scene(), options());
        change(&mut scene, &mut options);
        let told = catch_unwind(AssertUnwindSafe(|| rendered(&scene, &options)));
        let error = told.unwrap_or_else(|_| panic!("{number}, {field}: panic")).unwrap_err();
        let BackendError::Invalid(invalid) = error else { panic!("{number}, {field}: {error}") };
        assert_eq!(invalid.field, *field, "{number}: {invalid}");
        let sequence = Renderer::open(Device::Cpu).unwrap().render_sequence(&scene, [0], &options).next();
        assert!(matches!(sequence, Some(Err(BackendError::Invalid(_)))), "{number}, {field}");
    }
}

#[test]
fn the_reference_refuses_the_same_scenes() {
    let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
    for (number, (field, change)) in REFUSED.iter().enumerate() {
        let mut scene = scene();
        change(&mut scene, &mut RenderOptions::default());
        let traced = || reference::render(&scene, 1, &options, None, &|_| ()).map(|_| ());
        let probed = || reference::probe(&scene, 1, &options, [0, 0], None).map(|_| ());
        let followed = || reference::flows(&scene, 1, &[[0.0, 1.0]], &options).map(|_| ());
        for made in [&traced as &dyn Fn() -> Result<(), ReferenceError>, &probed, &followed] {
            let told = catch_unwind(AssertUnwindSafe(made)).unwrap_or_else(|_| panic!("{number}, {field}: panic"));
            let Err(ReferenceError::Invalid(invalid)) = told else { panic!("{number}, {field}: {told:?}") };
            assert_eq!(invalid.field, *field, "{number}: {invalid}");
        }
    }
    let wide =
        ReferenceOptions { look: Look { filter: PixelFilter::Gaussian { sigma: 1e9 }, ..options.look }, ..options };
    assert!(matches!(reference::render(&scene(), 1, &wide, None, &|_| ()), Err(ReferenceError::Invalid(_))));
}

/// Breaks a model.
type Flaw<T> = fn(&mut T);

/// Gives a builder a column.
type Extend = fn(SurfelsBuilder) -> SurfelsBuilder;

/// A column that is too short, too long, or holds what cannot be drawn.
#[test]
fn columns_of_models_are_checked() {
    let flaws: [(&str, Flaw<Surfels>); 15] = [
        ("axis_u", |s| s.axis_u.truncate(1)),
        ("axis_v", |s| s.axis_v.clear()),
        ("normal", |s| s.normal.push(Vec3::Z)),
        ("colour", |s| s.colour.truncate(1)),
        ("opacity", |s| s.opacity = vec![1.0]),
        ("material", |s| s.material = vec![Material::default(); 3]),
        ("velocity", |s| s.velocity = vec![Vec3::X]),
        ("acceleration", |s| s.acceleration = vec![Vec3::X; 5]),
        ("id", |s| s.id = vec![1]),
        ("origin", |s| s.origin.x = f64::NAN),
        ("position[1]", |s| s.position[1].x = f32::NAN),
        ("axis_u[0]", |s| s.axis_u[0] = Vec3::INFINITY),
        ("normal[1]", |s| s.normal[1] = Vec3::splat(1e30)),
        ("colour[1]", |s| s.colour[1].z = f32::INFINITY),
        ("opacity[0]", |s| s.opacity = vec![f32::NAN, 1.0]),
    ];
    for (field, flaw) in flaws {
        let mut surfels = discs();
        flaw(&mut surfels);
        let made = catch_unwind(|| Scene::new([Object::new(surfels)])).unwrap_or_else(|_| panic!("{field}: panic"));
        let error = rendered(&Scene { objects: made.objects, ..scene() }, &options()).unwrap_err().to_string();
        assert!(error.starts_with(&format!("`objects[0].shape.model.{field}` is ")), "{field}: {error}");
    }
    let columns: [(&str, Extend); 9] = [
        ("normal", |s| s.normals([Vec3::Z])),
        ("radius", |s| s.radii([1.0])),
        ("axes", |s| s.axes([[Vec3::X, Vec3::Y]])),
        ("colour", |s| s.colours([Vec3::ONE])),
        ("opacity", |s| s.opacities([1.0])),
        ("material", |s| s.materials([Material::default()])),
        ("velocity", |s| s.velocities([Vec3::X], VelocityUnit::Frame)),
        ("acceleration", |s| s.accelerations([Vec3::X])),
        ("id", |s| s.identities([1])),
    ];
    for (field, with) in columns {
        let error = with(Surfels::builder([DVec3::ZERO, DVec3::X, DVec3::Y])).build().unwrap_err().to_string();
        assert_eq!(error, format!("`{field}` is 1 entries long, expected 3 entries, as many as `position`"));
    }
    let gaussians = Gaussians { position: vec![Vec3::ZERO], ..Gaussians::default() };
    let made = Scene { objects: vec![Object::new(gaussians)], ..scene() };
    let error = rendered(&made, &options()).unwrap_err().to_string();
    assert!(error.starts_with("`objects[0].shape.model.sigma` is 0 entries long"), "{error}");
}

/// Counts that are within their bounds, and whose time samples alone need more than the memory that they may take.
#[test]
fn time_samples_keep_to_the_memory() {
    let (scene, most) = (scene(), 65_536);
    let auto = ErrorTarget { samples_max: most, pixel_samples: most, ..ErrorTarget::default() };
    for quality in [
        BlurMode::interleaved(most, Interleave::Four).into(),
        BlurMode::Still { pixel_samples: most }.into(),
        volumetric(most, SweptKernel::default()),
        bucket(256, 256),
        Quality::Error(auto),
    ] {
        // Posed before anything is asked, they would take more than 12 GB.
        let mut still = Scene { objects: vec![scene.objects[0].clone(); 1000], ..scene.clone() };
        if matches!(quality, Quality::Error(_)) {
            still.objects.iter_mut().for_each(|object| object.motions.clear());
        }
        let options = RenderOptions { quality, memory: 8 << 20, ..options() };
        let error = rendered(&still, &options).unwrap_err();
        assert!(matches!(error, BackendError::Memory { allowed: 8_388_608, .. }), "{quality}: {error}");
    }
}

/// Numbers that come from a seed.
struct Seeded(u64);

impl Seeded {
    fn next(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % below as u64) as usize
    }

    fn number(&mut self) -> f64 {
        const NUMBERS: [f64; 22] = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            0.0,
            -0.0,
            1.0,
            -1.0,
            0.5,
            1e-9,
            -1e-9,
            1e-30,
            5e-324,
            1e6,
            1e9,
            -1e9,
            1e12,
            1e20,
            1e30,
            -1e30,
            3.5e38,
            f64::MAX,
            f64::MIN,
        ];
        NUMBERS[self.next(NUMBERS.len())]
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.number(), self.number(), self.number())
    }

    fn count(&mut self) -> u32 {
        // No count that is right and takes long.
        const COUNTS: [u32; 7] = [0, 1, 2, 5, 65_537, 1 << 31, u32::MAX];
        COUNTS[self.next(COUNTS.len())]
    }

    fn quality(&mut self) -> Quality {
        let (interleave, times) =
            ([Interleave::None, Interleave::Two][self.next(2)], [Times::Even, Times::Random][self.next(2)]);
        let pixel_samples = [None, Some(self.count())][self.next(2)];
        match self.next(5) {
            0 => BlurMode::Still { pixel_samples: self.count() }.into(),
            1 => BlurMode::Supersample { samples: self.count(), pixel_samples, interleave, times }.into(),
            2 => {
                let (buckets, samples) = (self.count(), self.count());
                BlurMode::Bucket { buckets, samples, pixel_samples, interleave, times }.into()
            }
            3 => {
                let swept = SweptKernel { overlap: Overlap(self.number()), ..SweptKernel::default() };
                BlurMode::Volumetric { intervals: self.count(), pixel_samples, swept }.into()
            }
            _ => {
                let (error, samples_max) = (self.number(), self.count());
                let pixel_samples = self.count();
                ErrorTarget { error, samples_max, pixel_samples, ..ErrorTarget::default() }.into()
            }
        }
    }

    fn weight(&mut self) -> Weight {
        let (centre, other) = (self.number(), self.number());
        match self.next(5) {
            0 => Weight::Ramp { centre },
            1 => Weight::Exponential { rate: other, centre },
            2 => Weight::OneMinusExponential { centre },
            3 => Weight::Gaussian { centre, width: other },
            _ => Weight::Curve((0..self.next(4)).map(|_| (self.number(), self.number())).collect()),
        }
    }

    /// Changes one field.
    fn change(&mut self, scene: &mut Scene, options: &mut RenderOptions) {
        let object = &mut scene.objects[0];
        match self.next(36) {
            0 => scene.image.width = self.count(),
            1 => scene.image.height = self.count(),
            2 => scene.image.background = self.vector(),
            3 => scene.frames.rate = self.number(),
            4 => scene.frames.first = [i64::MIN, i64::MAX, 0][self.next(3)],
            5 => scene.frames.last = [i64::MIN, i64::MAX, 0][self.next(3)],
            6 => scene.shutter.open = self.number(),
            7 => scene.shutter.close = self.number(),
            8 => scene.shutter.close = scene.shutter.open,
            9 => scene.shutter.weight = self.weight(),
            10 => scene.shutter.readout.duration = self.number(),
            11 => scene.camera.eye = self.vector(),
            12 => scene.camera.at = self.vector(),
            13 => scene.camera.up = self.vector(),
            14 => scene.camera.fovy = self.number(),
            15 => scene.camera.near = self.number(),
            16 => scene.camera.shift = DVec2::new(self.number(), self.number()),
            17 => scene.camera.motions.push(Motion::Linear { velocity: self.vector() }),
            18 => scene.lights.push(Light::directional(self.vector(), self.vector())),
            19 => scene.lights.push(Light::point(self.vector(), self.vector())),
            20 => scene.lights.push(Light::Ambient { colour: self.vector() }),
            21 => scene.environment.as_mut().unwrap().intensity = self.number(),
            22 => scene.environment.as_mut().unwrap().rotation = self.number(),
            23 => object.transform.translate = self.vector(),
            24 => object.transform.scale = self.vector(),
            25 => object.place.rotate = self.vector(),
            26 => object.motions.push(Motion::Linear { velocity: self.vector() }),
            27 => {
                let (axis, per_frame) = ([DVec3::Y, self.vector()][self.next(2)], self.number());
                object.motions.push(Motion::Rotation { axis, per_frame, centre: self.vector() });
            }
            28 => {
                let [ambient, diffuse, specular, shininess] = [0; 4].map(|_| self.number() as f32);
                object.shape.surface_mut().unwrap().material = Some(Material { ambient, diffuse, specular, shininess });
            }
            29 => object.opacity = self.number(),
            30 => object.shape.surface_mut().unwrap().reflection = self.number(),
            31 => object.epsilon = Some(self.number()),
            32 => object.shape.points_mut().unwrap().at = Some(self.number()),
            33 => options.quality = self.quality(),
            34 => options.look.filter = PixelFilter::Gaussian { sigma: self.number() },
            _ => options.look.epsilon = Some(self.number()),
        }
    }
}

/// One to three absurd values at once: an error or a finite picture, and never a panic. `HOSTILE_VALUES` says how many
/// scenes are tried.
#[test]
fn absurd_values_are_errors_or_finite_pictures() {
    let runs = std::env::var("HOSTILE_VALUES").map_or(400, |runs| runs.parse().unwrap());
    let mut bad = Vec::new();
    let mut drawn = 0;
    for run in 0..runs {
        let mut seeded = Seeded(run);
        let (mut scene, mut options) = (scene(), options());
        for _ in 0..=seeded.next(3) {
            seeded.change(&mut scene, &mut options);
        }
        match catch_unwind(AssertUnwindSafe(|| rendered(&scene, &options))) {
            Ok(Ok(true)) => drawn += 1,
            Ok(Err(_)) => {}
            Ok(Ok(false)) => bad.push(format!("{run}: not finite")),
            Err(_) => bad.push(format!("{run}: panic")),
        }
    }
    println!("{drawn} of {runs} were drawn");
    assert!(bad.is_empty(), "{bad:#?}");
    assert!(drawn > runs / 20, "{drawn} of {runs} were drawn");
}
