//! The scenes on which blur modes are measured: three generated ones and those that ship, and their references.
//!
//! The generated ones: two checkered spheres of 50,000 surfels, 512 x 512 pixels, focal length 512 pixels, eye at the
//! origin, epsilon 0.03, shutter 0..1.

use std::path::Path;

use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::film::Picture;
use splatblur::image::{self, Format};
use splatblur::model::{Material, Surfels};
use splatblur::options::{BlurMode, Detail, Interleave, Look, PixelFilter, RenderOptions, Shading, Times};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Motion, Object, Scene};

use super::four_meshes::four_meshes;
use super::{default_lights, object, scene, sphere};

/// Surfels of one sphere.
pub const SURFELS: usize = 50_000;

/// A checkered ball. Radii of the lattice's kernels: sqrt(4 pi / n), one disc's share of the sphere.
fn ball([light, dark]: [Vec3; 2]) -> Surfels {
    let mut surfels = sphere(SURFELS);
    let scale = (4.0 * std::f32::consts::PI).sqrt() / 4.0;
    surfels.axis_u.iter_mut().chain(&mut surfels.axis_v).for_each(|axis| *axis *= scale);
    surfels.colour.iter_mut().for_each(|colour| *colour = if colour.y > 0.5 { light } else { dark });
    surfels.spatially_ordered()
}

fn placed(model: Surfels, from: DVec3, motions: Vec<Motion>) -> Object {
    let mut object = object(model);
    object.transform.translate = from;
    object.motions = motions;
    object.shape.surface_mut().expect("a surface").material =
        Some(Material { ambient: 1.0, diffuse: 1.0, specular: 0.1, shininess: 30.0 });
    object.epsilon = Some(0.03);
    object
}

fn linear(from: [f64; 3], to: [f64; 3]) -> Motion {
    Motion::Linear { velocity: DVec3::from(to) - DVec3::from(from) }
}

fn pair(a: Object, b: Object, name: &str) -> Scene {
    let mut scene = scene(vec![a, b], [512, 512], DVec3::ZERO, 2.0 * 0.5_f64.atan().to_degrees());
    scene.name = name.into();
    scene.lights = default_lights();
    scene
}

// The contrast decides how large FLIP is. With these colours, plain supersampling has the error of the prototype that
// the project was planned with, to 12 % (docs/measurements/).

fn red() -> Surfels {
    ball([Vec3::new(0.85, 0.35, 0.25), Vec3::new(0.3, 0.1, 0.07)])
}

fn blue() -> Surfels {
    ball([Vec3::new(0.25, 0.45, 0.85), Vec3::new(0.07, 0.14, 0.3)])
}

/// A moves across, before B, which stands still.
pub fn lin() -> Scene {
    let (from, to) = ([-0.8, 0.6, -6.0], [0.9, -0.6, -6.0]);
    let a = placed(red(), from.into(), vec![linear(from, to)]);
    pair(a, placed(blue(), DVec3::new(0.3, 0.0, -7.5), Vec::new()), "lin")
}

/// A turns by 1 rad while it moves a little, B moves up before it.
pub fn rot() -> Scene {
    let (from, to) = ([-0.5, 0.0, -5.0], [-0.3, 0.0, -5.0]);
    let axis = DVec3::new(0.3, 1.0, 0.2).normalize();
    let turn = Motion::Rotation { axis, per_frame: 1.0, centre: from.into() };
    let a = placed(red(), from.into(), vec![turn, linear(from, to)]);
    let (from, to) = ([0.3, -1.2, -5.5], [0.3, 1.2, -5.5]);
    pair(a, placed(blue(), from.into(), vec![linear(from, to)]), "rot")
}

/// A and B cross in depth: while A moves to the right, B comes nearer, from behind it to before it.
pub fn cross() -> Scene {
    let (from, to) = ([-1.2, 0.0, -6.0], [1.2, 0.0, -6.0]);
    let a = placed(red(), from.into(), vec![linear(from, to)]);
    let (from, to) = ([0.0, -1.2, -7.0], [0.0, 1.2, -5.0]);
    pair(a, placed(blue(), from.into(), vec![linear(from, to)]), "cross")
}

/// A shipped scene at 480 x 270, or `four_meshes`.
pub fn shipped(name: &str) -> Scene {
    if name == "four_meshes" {
        return four_meshes();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("xml");
    Scene::open(path).size(480, 270).load().expect("a shipped scene")
}

/// A quarter and three quarters into the frames of a scene.
pub fn two_frames(scene: &Scene) -> Vec<i64> {
    let [first, last] = [scene.frames.first, scene.frames.last];
    let mut frames = vec![first + (last - first) / 4, first + 3 * (last - first) / 4];
    frames.dedup();
    frames
}

/// The names of all shipped scenes, in order.
pub fn names_of_shipped() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let entries = std::fs::read_dir(folder).expect("the folder of scenes");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let scenes = paths.filter(|path| path.extension().is_some_and(|extension| extension == "xml"));
    let mut names: Vec<String> =
        scenes.filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned())).collect();
    names.sort();
    names
}

/// Samples of [`converged`].
pub const CONVERGED: u32 = 768;

/// A picture from an earlier run, from a file of this name in `target/tables`; else it is made, and kept there. Remove
/// these files when the renderer's pixels change: nothing else notices.
pub fn kept(name: &str, make: impl FnOnce() -> Picture) -> Picture {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/tables");
    std::fs::create_dir_all(&directory).expect("a folder for pictures");
    let path = directory.join(name).with_extension("exr");
    if let Ok(picture) = image::read(&path) {
        return picture;
    }
    let picture = make();
    image::write(&path, &picture, Format::EXR, "").expect("room for a picture");
    picture
}

/// A frame by supersampling with many samples and another seed than `options` have by default, [`kept`] with `kind` in
/// its name.
pub fn converged(scene: &Scene, frame: i64, options: &RenderOptions, kind: &str) -> Picture {
    kept(&format!("{}_{frame}_{kind}_{CONVERGED}", scene.name), || {
        let quality = BlurMode::Supersample {
            samples: CONVERGED,
            // One for each sample, whatever is static.
            pixel_samples: Some(CONVERGED),
            interleave: Interleave::None,
            times: Times::Even,
        };
        let quality = quality.into();
        let look = Look { seed: 77, ..options.look.clone() };
        let options = RenderOptions { quality, look, detail: Detail::Full, ..options.clone() };
        render_frame(&mut Cpu::default(), scene, frame, &options).expect("the frame fits").picture
    })
}

/// A scene's reference of 1024 samples a pixel, [`kept`].
pub fn reference(scene: &Scene, frame: i64, filter: PixelFilter) -> Picture {
    const SAMPLES: u64 = 1024;
    let kind = if filter == PixelFilter::Box { "box_" } else { "" };
    kept(&format!("{}_{frame}_{kind}{SAMPLES}", scene.name), || {
        let options = ReferenceOptions {
            samples: SAMPLES,
            look: Look { filter, shading: Shading::Gouraud, ..Look::default() },
            ..ReferenceOptions::default()
        };
        reference::picture(scene, frame, &options).expect("a reference")
    })
}
