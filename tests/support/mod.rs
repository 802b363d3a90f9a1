//! Scenes and models made in code, for tests and benches. Shares no mathematics with the renderer.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its own part")]
#![allow(clippy::expect_used, clippy::print_stdout, reason = "tests and benches may stop and report")]

pub mod closed_forms;
pub mod gaussians;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod ideal_sphere;
pub mod pairs;
pub mod triangles;
pub mod volumes;

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

use glam::{DVec3, Vec3};
use splatblur::anim::{self, Interpolation};
use splatblur::backend::cpu::Cpu;
#[cfg(feature = "gpu")]
use splatblur::backend::gpu::{Choice, Gpu};
use splatblur::film::Picture;
use splatblur::frame::Frame;
use splatblur::model::{Cloud, Gaussians, LoadedModel, LoadedShape, Material, Surfels, generate};
use splatblur::options::{Quality, RenderOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{AnimationBinding, Camera, FrameRange, ImageSettings, Light, Motion, Object, Scene};
use splatblur::time::{Shutter, Weight};

/// Frame `number`, posed; `options` must name a blur mode.
pub fn posed<'a>(scene: &'a Scene, number: i64, options: &'a RenderOptions) -> Frame {
    let Quality::Mode(mode) = options.quality else { panic!("{} names no blur mode", options.quality) };
    Frame::new(scene, number, mode, options)
}

/// The surfels of a model that was read.
pub fn surfels(loaded: LoadedModel) -> Surfels {
    let LoadedShape::Surfels(surfels, _) = loaded.shape else { panic!("no surfels: {:?}", loaded.notes) };
    surfels
}

/// The Gaussians of a capture, or the kernels of a volume, that was read.
pub fn gaussians(loaded: LoadedModel) -> Gaussians {
    match loaded.shape {
        LoadedShape::Capture(gaussians) | LoadedShape::Volume(gaussians, _) => gaussians,
        LoadedShape::Surfels(..) => panic!("no Gaussians: {:?}", loaded.notes),
    }
}

/// Numbers in [0, 1) that repeat on every run.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// From `low` to `high`.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    /// Evenly over all directions.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let p = DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            if p.length_squared() <= 1.0 && p.length_squared() > 1e-3 {
                return p.normalize();
            }
        }
    }
}

/// Surfels facing `normal` with circular kernels.
pub fn round_surfels(points: impl IntoIterator<Item = (DVec3, DVec3, f64, Vec3)>) -> Surfels {
    let mut surfels = Surfels::default();
    for (position, normal, radius, colour) in points {
        let helper = if normal.x.abs() < 0.5 { DVec3::X } else { DVec3::Y };
        let u = normal.cross(helper).normalize();
        surfels.position.push(position.as_vec3());
        surfels.axis_u.push((u * radius).as_vec3());
        surfels.axis_v.push((normal.cross(u) * radius).as_vec3());
        surfels.normal.push(normal.as_vec3());
        surfels.colour.push(colour);
    }
    surfels
}

/// The speed-test model: unit sphere, Fibonacci lattice, `n` surfels of radius 4/sqrt(n), in a 16 x 8 checker.
pub fn sphere(n: usize) -> Surfels {
    let golden = PI * (3.0 - 5_f64.sqrt());
    round_surfels((0..n).map(|i| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
        let phi = (i as f64 + 0.5) * golden;
        let q = (1.0 - z * z).sqrt();
        let p = DVec3::new(q * phi.cos(), q * phi.sin(), z);
        let cell = (p.y.asin() / PI * 8.0).floor() + (p.x.atan2(p.z) / PI * 8.0).floor();
        let colour = if cell.rem_euclid(2.0) < 0.5 { Vec3::new(0.9, 0.85, 0.8) } else { Vec3::new(0.7, 0.15, 0.1) };
        (p, p, 4.0 / (n as f64).sqrt(), colour)
    }))
}

/// An object with nothing but a model.
pub fn object(model: Surfels) -> Object {
    let mut object = Object::new(model);
    object.name = "object".into();
    object
}

/// Colours show unchanged under one ambient light of intensity 1.
pub const UNLIT: Material = Material { ambient: 1.0, diffuse: 0.0, specular: 0.0, shininess: 1.0 };

/// Objects before a camera at `eye` that looks along -z, lit by one ambient light; shutter 0..1, black background.
pub fn scene(objects: Vec<Object>, size: [u32; 2], eye: DVec3, fovy_degrees: f64) -> Scene {
    Scene {
        name: "test".into(),
        image: ImageSettings { width: size[0], height: size[1], ..Default::default() },
        frames: FrameRange { first: 0, last: 0, rate: 24.0 },
        shutter: Shutter { open: 0.0, close: 1.0, weight: Weight::Box, ..Shutter::default() },
        camera: Camera { fovy: fovy_degrees.to_radians(), ..Camera::new(eye, eye - DVec3::Z) },
        lights: vec![Light::Ambient { colour: DVec3::ONE }],
        environment: None,
        objects,
        files: splatblur::files::Seen::new(),
    }
}

/// Key light and ambient light of the speed-test scene.
pub fn default_lights() -> Vec<Light> {
    vec![
        Light::directional(DVec3::new(-0.5, -1.0, -0.8).normalize(), DVec3::splat(0.9)).without_shadows(),
        Light::Ambient { colour: DVec3::splat(0.3) },
    ]
}

/// The speed-test scene: the sphere before an eye at (0, 0, 4), fovy 40.
pub fn sphere_scene(n: usize, size: u32, moving: bool) -> Scene {
    let mut sphere = object(sphere(n).spatially_ordered());
    if moving {
        sphere.motions = vec![
            Motion::Rotation { axis: DVec3::Y, per_frame: 30_f64.to_radians(), centre: DVec3::ZERO },
            Motion::Linear { velocity: DVec3::new(0.4, 0.1, 0.0) },
        ];
    }
    let mut scene = scene(vec![sphere], [size, size], DVec3::new(0.0, 0.0, 4.0), 40.0);
    scene.lights = default_lights();
    scene
}

/// A hall seen from within, by an eye 1.7 above its floor: surfels reach the camera plane on all sides.
pub fn hall_scene(n: u32, size: [u32; 2]) -> Scene {
    let Cloud { position, normal, radius, colour, .. } = generate::hall(n);
    let points = position.into_iter().zip(normal).zip(radius.into_iter().zip(colour));
    let points = points.map(|((at, n), (radius, colour))| (at, n.as_dvec3(), f64::from(radius), colour));
    let mut scene =
        scene(vec![object(round_surfels(points).spatially_ordered())], size, DVec3::new(0.0, 1.7, 0.0), 60.0);
    scene.camera.at = DVec3::new(1.0, 1.5, -4.0);
    scene.lights = default_lights();
    scene
}

/// Frame 0 on the CPU.
pub fn render(scene: &Scene, options: &RenderOptions) -> Picture {
    render_frame(&mut Cpu::default(), scene, 0, options).expect("the frame fits").picture
}

/// Root mean square difference of all four channels.
pub fn rms(a: &Picture, b: &Picture) -> f64 {
    let squares = a.rgba.iter().flatten().zip(b.rgba.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2));
    (squares.sum::<f64>() / (4.0 * a.rgba.len() as f64)).sqrt()
}

/// An attribute, its keys (frames; degrees or units), and the kind of its tangents.
pub type Curve<'a> = (&'a str, &'a [(f64, f64)], &'a str);

/// An animation of one node, with these curves.
pub fn animation(curves: &[Curve<'_>]) -> AnimationBinding {
    let mut text = String::from("animVersion 1.1;\ntimeUnit film;\nlinearUnit cm;\nangularUnit deg;\n");
    for (attribute, keys, tangent) in curves {
        let short = attribute.rsplit('.').next().unwrap_or(attribute);
        text += "anim ";
        text += &[*attribute, short].join(" ");
        text += " node 0 1 0;\nanimData {\n input time;\n output linear;\n weighted 0;\n";
        text += " preInfinity constant;\n postInfinity constant;\n keys {\n";
        for (time, value) in *keys {
            writeln!(text, "  {time} {value} {tangent} {tangent} 1 1 0;").expect("a text takes all");
        }
        text += " }\n}\n";
    }
    let path = Path::new("made in code");
    let parsed = anim::parse(text.as_bytes(), path).expect("a valid animation");
    let node = parsed.node(None).expect("one node").clone().into();
    AnimationBinding { path: path.into(), node, interpolation: Interpolation::Maya }
}
