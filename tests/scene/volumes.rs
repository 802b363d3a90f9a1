//! Volumes from file to scene: grids, samples, transfer functions, and what scenes say about them.

#![allow(clippy::unwrap_used, reason = "clippy knows #[test] functions, not their helpers")]

use std::fs;
use std::path::PathBuf;

use glam::{DVec3, Vec3};
use splatblur::model::{self, Gaussians, Kind, LoadOptions, LoadedShape, ModelError, Optics, VolumeOptions};
use splatblur::scene::{Object, Scene, Shape};
use splatblur::scene_file::{self, SceneError, to_xml};

use crate::support;

/// A directory with `grid.nrrd`, 4 x 3 x 2 values from 0 to 23, and `samples.ply`.
struct Dir(tempfile::TempDir);

const HEADER: &str = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 3 2\nspacings: 0.5 1 2\nencoding: raw\n\n";

const SAMPLES: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    property float density\nproperty float radius\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
    end_header\n1 0 0 2 0.5 255 0 0\n0 1 0 4 0.25 255 255 255\n0 0 1 0 1 0 0 0\n";

impl Dir {
    fn new() -> Self {
        let dir = Self(tempfile::tempdir().unwrap());
        fs::write(dir.path("grid.nrrd"), [HEADER.as_bytes(), &(0..24).collect::<Vec<u8>>()].concat()).unwrap();
        fs::write(dir.path("samples.ply"), SAMPLES).unwrap();
        dir
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn load(&self, name: &str, options: &LoadOptions) -> Result<model::LoadedModel, ModelError> {
        model::load(&self.path(name), options, &|_, _| {})
    }

    fn kernels(&self, name: &str, options: &LoadOptions) -> Gaussians {
        support::gaussians(self.load(name, options).unwrap())
    }

    fn scene(&self, text: &str) -> Result<scene_file::LoadedScene, SceneError> {
        fs::write(self.path("scene.xml"), text).unwrap();
        scene_file::load(&self.path("scene.xml"), &scene_file::SceneLoadOptions::default())
    }

    fn object(&self, attributes: &str, inside: &str) -> Result<scene_file::LoadedScene, SceneError> {
        self.scene(&format!("<scene><object><pointModel {attributes}>grid.nrrd</pointModel>{inside}</object></scene>"))
    }
}

const RAMP: &str = "<transferFunction><stop value='0' opacity='0' colour='1 0 0'/><stop value='20' opacity='10' \
    colour='0 0.5 1'/></transferFunction>";

#[test]
fn a_grid_is_a_model() {
    let dir = Dir::new();
    let loaded = dir.load("grid.nrrd", &LoadOptions::default()).unwrap();
    let LoadedShape::Volume(g, facts) = loaded.shape else { panic!("{:?}", loaded.notes) };
    assert_eq!((facts.sizes, facts.spacings, facts.storage), (Some([4, 3, 2]), [0.5, 1.0, 2.0], "uint8"));
    assert_eq!((facts.samples, facts.range), (24, [0.0, 23.0]));
    // The least value shows nothing.
    assert_eq!((g.len(), g.position[0], g.position[22]), (23, Vec3::new(0.5, 0.0, 0.0), Vec3::new(1.5, 2.0, 2.0)));
    assert_eq!(g.sigma[0], Vec3::new(0.3, 0.6, 1.2));
    assert!((g.colour(3) - Vec3::ONE).abs().max_element() < 1e-6);
    // The largest extent is 4; a cell has the volume 1.
    assert!((g.opacity[22] - 2.5).abs() < 1e-6, "{}", g.opacity[22]);
    assert_eq!(g.optics, Optics::Extinction { layer: 1.25 });
    let note = &loaded.notes[0];
    assert!(note.contains("no transfer function") && note.contains("from 0 at 0 to 2.5 at 23"), "{note}");

    let object = Object::load(dir.path("grid.nrrd")).unwrap();
    assert!(matches!(object.shape, Shape::Volume { .. }) && !object.is_see_through());
    // All of it counts, and +y is up.
    assert_eq!(object.shape.core(), object.shape.bounds());
    assert_eq!(object.shape.bounds().max, DVec3::new(1.5, 2.0, 2.0));
    assert_eq!(Scene::new([object]).camera.up, DVec3::Y);
}

#[test]
fn what_the_options_say_is_done() {
    let dir = Dir::new();
    let plain = dir.kernels("grid.nrrd", &LoadOptions::default());
    let volume = VolumeOptions { kernel: 1.0, ..VolumeOptions::default() };
    let wide = dir.kernels("grid.nrrd", &LoadOptions { radius_scale: 2.0, volume, ..LoadOptions::default() });
    // The mass stays.
    assert_eq!((wide.sigma[0], &wide.opacity), (Vec3::new(1.0, 2.0, 4.0), &plain.opacity));
    let volume = VolumeOptions { lit: true, flatten: f64::INFINITY, ..VolumeOptions::default() };
    let flat = dir.kernels("grid.nrrd", &LoadOptions { volume, ..LoadOptions::default() });
    // Values rise by 1, 4 and 12 a sample: by 2, 4 and 6 a unit.
    let down = -Vec3::new(2.0, 4.0, 6.0).normalize();
    assert!(flat.normal.iter().all(|n| (*n - down).length() < 1e-6), "{:?}", flat.normal);
    assert!(flat.sigma.iter().all(|sigma| sigma.z == 0.0 && sigma.x > 0.3), "{:?}", flat.sigma[0]);
    assert!((flat.rotation[5] * Vec3::Z - down).length() < 1e-6);
    assert!(plain.normal.is_empty());
}

#[test]
fn a_scene_says_how_a_volume_is_drawn() {
    let dir = Dir::new();
    let scene = dir.object("", "").unwrap().scene;
    let source = &scene.objects[0].source;
    assert_eq!((source.options.kind, &source.options.volume), (None, &VolumeOptions::default()));
    let given = "kind='volume' kernel='0.8' flatten='infinite' lit='true' opacity='0.5' cropMin='0 0 1'";
    let inside = format!("{RAMP}<material diffuse='0.5'/>");
    let loaded = dir.object(given, &inside).unwrap();
    assert!(!loaded.notes.iter().any(|note| note.contains("mean nothing")), "{:?}", loaded.notes);
    let object = &loaded.scene.objects[0];
    let VolumeOptions { transfer, kernel, flatten, lit } = &object.source.options.volume;
    assert_eq!((object.source.options.kind, *kernel, *flatten, *lit), (Some(Kind::Volume), 0.8, f64::INFINITY, true));
    let (colour, extinction) = transfer.as_ref().unwrap().at(10.0);
    assert_eq!((colour, extinction), (Vec3::new(0.5, 0.25, 0.5), 5.0));
    assert_eq!((object.opacity, object.shape.bounds().min.z), (0.5, 1.0));
    assert!(!object.shape.gaussians().unwrap().gaussians().normal.is_empty());

    for (given, inside) in [(given, inside.as_str()), ("flatten='2.5'", ""), ("", RAMP), ("radiusScale='1.5'", "")] {
        let first = dir.object(given, inside).unwrap().scene;
        let xml = to_xml(&first, dir.0.path());
        let second = dir.scene(&xml).unwrap().scene;
        assert_eq!(
            (&first.objects[0].source.options.volume, first.objects[0].source.options.kind),
            (&second.objects[0].source.options.volume, second.objects[0].source.options.kind)
        );
        let gaussians = |scene: &Scene| scene.objects[0].shape.gaussians().unwrap().gaussians().clone();
        assert_eq!(gaussians(&first), gaussians(&second));
        assert_eq!(to_xml(&second, dir.0.path()), xml);
    }
}

/// Copies of one file differ in every option of volumes, and are shared where all are alike.
#[test]
fn volumes_named_alike_are_loaded_once() {
    let dir = Dir::new();
    let object = |attributes: &str, inside: &str| {
        format!("<object><pointModel {attributes}>grid.nrrd</pointModel>{inside}</object>")
    };
    let steeper = RAMP.replace("20", "21");
    let all = [
        ("", ""),
        ("opacity='0.5'", ""),
        ("kernel='0.7'", ""),
        ("flatten='2'", ""),
        ("lit='true'", ""),
        ("", RAMP),
        ("", RAMP),
        ("", &steeper),
    ];
    let text: String = all.iter().map(|(attributes, inside)| object(attributes, inside)).collect();
    let objects = dir.scene(&format!("<scene>{text}</scene>")).unwrap().scene.objects;
    let same = |a: usize, b: usize| {
        let [a, b] = [a, b].map(|i: usize| objects[i].shape.gaussians().unwrap().gaussians());
        std::sync::Arc::ptr_eq(a, b)
    };
    let shared: Vec<(usize, usize)> =
        (0..8).flat_map(|a| (0..a).map(move |b| (b, a))).filter(|(a, b)| same(*a, *b)).collect();
    assert_eq!(shared, [(0, 1), (5, 6)]);
}

#[test]
fn what_means_nothing_is_noted() {
    let dir = Dir::new();
    let noted = |loaded: Result<scene_file::LoadedScene, SceneError>, part: &str| {
        let notes = loaded.unwrap().notes;
        assert!(notes.iter().any(|n| n.contains(part) && n.ends_with(" nothing here")), "{part}: {notes:?}");
    };
    noted(dir.object("shDegree='1'", ""), "`shDegree` and `antialias`");
    noted(dir.object("", "<material opacity='0.5'/>"), " of <material> are for surfels");
    fs::write(dir.path("grid.nrrd"), SAMPLES).unwrap();
    noted(dir.object("kind='surfels' lit='true'", ""), "`kernel`, `flatten`, `lit` and <transferFunction>");
    noted(dir.object("kind='surfels'", RAMP), "`kernel`, `flatten`, `lit` and <transferFunction>");
}

#[test]
fn bad_words_are_refused() {
    let dir = Dir::new();
    let refused = |attributes: &str, inside: &str, part: &str| {
        let error = format!("{:#}", anyhow::Error::from(dir.object(attributes, inside).map(|_| ()).unwrap_err()));
        assert!(error.contains(part) && error.lines().count() == 1, "{error}\n  expected {part}");
    };
    refused("kernel='0'", "", "`kernel` is `0`, expected a number from 0.01 to 100");
    refused("flatten='0.5'", "", "`flatten` is `0.5`, expected a number from 1 to 1000000000, or infinite");
    refused("flatten='inf'", "", "`flatten` is `inf`");
    refused("kind='gaussians'", "", "holds no 3D Gaussians");
    refused("kind='surfels'", "", "is a grid of a volume, which has no surfels");
    refused("", "<transferFunction/>", "has no <stop>");
    let function = |stops: &str| format!("<transferFunction>{stops}</transferFunction>");
    refused("", &function("<stop value='1'/>"), "<stop> needs the attribute `opacity`");
    let falling = function("<stop value='1' opacity='1'/><stop value='1' opacity='2'/>");
    refused("", &falling, "`value` is 1, expected more than that of the stop before, 1");
    refused("", &function("<stop value='1' opacity='-1'/>"), "`opacity` is `-1`");
    refused("", &function("<stop value='100' opacity='0'/>"), "no sample has an extinction above 0");
    fs::write(dir.path("grid.nrrd"), SAMPLES.replace("density", "dense")).unwrap();
    refused("kind='volume'", "", "holds no volume, which kind `volume` needs");
}

#[test]
fn points_with_densities_and_radii_are_a_volume() {
    let dir = Dir::new();
    let loaded = dir.load("samples.ply", &LoadOptions::default()).unwrap();
    let LoadedShape::Volume(g, facts) = loaded.shape else { panic!("{:?}", loaded.notes) };
    assert_eq!(facts.sizes, None);
    assert_eq!((g.len(), &g.opacity[..]), (2, &[2.0 * 0.125, 4.0 / 64.0][..]));
    assert_eq!(g.sigma, [Vec3::splat(0.3), Vec3::splat(0.15)]);
    assert!((g.colour(0) - Vec3::X).abs().max_element() < 1e-6);
    assert_eq!(g.optics, Optics::Extinction { layer: 0.625 });
    // Or surfels, where the scene says so, and by themselves where they have normals or lack radii.
    let surfels = dir.load("samples.ply", &LoadOptions { kind: Some(Kind::Surfels), ..LoadOptions::default() });
    let surfels = surfels.unwrap();
    assert!(surfels.notes.iter().any(|note| note.contains("`density` ignored")), "{:?}", surfels.notes);
    assert_eq!(support::surfels(surfels).len(), 3);
    fs::write(dir.path("samples.ply"), SAMPLES.replace("radius", "range")).unwrap();
    assert_eq!(support::surfels(dir.load("samples.ply", &LoadOptions::default()).unwrap()).len(), 3);
    fs::write(dir.path("samples.ply"), SAMPLES.replace("red", "nx").replace("green", "ny").replace("blue", "nz"))
        .unwrap();
    assert_eq!(support::surfels(dir.load("samples.ply", &LoadOptions::default()).unwrap()).len(), 3);
    let as_volume = LoadOptions { kind: Some(Kind::Volume), ..LoadOptions::default() };
    assert_eq!(dir.kernels("samples.ply", &as_volume).len(), 2);
    // Parts of space in place of the cubes of radii.
    let own = SAMPLES.replace("property uchar red", "property float volume\nproperty uchar red");
    let own = own.replace("0.5 255", "0.5 3 255").replace("0.25 255", "0.25 0 255").replace("0 1 0 0 0", "0 1 9 0 0 0");
    fs::write(dir.path("samples.ply"), own).unwrap();
    let loaded = dir.load("samples.ply", &LoadOptions::default()).unwrap();
    assert!(loaded.notes.iter().any(|note| note.contains("1 of 3 samples dropped")), "{:?}", loaded.notes);
    assert_eq!(support::gaussians(loaded).opacity, [6.0]);
}

#[test]
fn defaults_of_captures_are_kept_out_of_volumes() {
    let dir = Dir::new();
    let object = dir.object("", "").unwrap().scene.objects[0].clone();
    let Shape::Volume { model, .. } = &object.shape else { panic!("no volume") };
    assert_eq!((model.crop, object.opacity, object.shape.material()), (None, 1.0, None));
}
