//! Captures against an exact picture of one: the reader and the definition, without the renderer.

use std::fs;
use std::path::Path;

use glam::{DVec3, Vec3};
use splatblur::image;
use splatblur::model::{self, Kind, ModelFormat, parse_capture};
use splatblur::scene::{Capture, Object, Scene, Shape};
use splatblur::scene_file;

use crate::support::gaussians::{CaptureCamera, picture, psnr};

/// Positions, sizes, turns, opacities and colours of the plain PLY are what the picture was made of. The code that made
/// it is not ours, and neither splatter nor reference has a part in this test.
#[test]
fn the_guitar_makes_the_exact_picture() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let bytes = fs::read(root.join("tests/data/models/guitar_3dgs.ply")).unwrap();
    let guitar = parse_capture(&bytes, ModelFormat::Ply).unwrap().unwrap();
    assert_eq!((guitar.len(), guitar.degree, guitar.dropped), (90_854, 0, 0));

    let truth = image::read(&root.join("tests/data/truth/captures/guitar_0.exr")).unwrap();
    let want: Vec<[f64; 4]> = truth.rgba.iter().map(|pixel| pixel.map(f64::from)).collect();
    let size = [truth.width as usize, truth.height as usize];
    let view = CaptureCamera { eye: DVec3::new(0.0, -2.0, 6.0), at: DVec3::new(0.0, -2.0, 0.0), size };
    let found = psnr(&picture(&guitar, &view), &want);
    println!("{found:.1} dB");
    assert!(found >= 80.0, "{found:.1} dB");
}

/// A capture alone is looked at upright, from the front, whole but for its strays.
#[test]
fn a_capture_alone_is_seen_upright() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = root.join("tests/data/models/guitar_3dgs.ply");
    let scene = scene_file::load_model(&path, &scene_file::SceneLoadOptions::default()).unwrap().scene;
    assert!(matches!(scene.objects[0].shape, Shape::Gaussians { .. }));
    assert_eq!(scene.camera.up, DVec3::NEG_Y);
    let away = scene.camera.eye - scene.camera.at;
    assert!(away.z > 0.0 && away.truncate().length() < 1e-9, "{away}");
    // The guitar is 4.4 high; the core leaves out its outermost 2 %.
    let size = scene.objects[0].shape.core().size();
    assert!((4.0..4.3).contains(&size.y), "{size}");
    // What stands the other way up is seen as all else is.
    let mut turned = scene.objects[0].clone();
    turned.transform.rotate = DVec3::new(std::f64::consts::PI, 0.0, 0.0);
    assert_eq!(Scene::new([turned]).camera.up, DVec3::Y);
    let ball = Object::load(root.join("scenes/models/ball.ply")).unwrap();
    assert_eq!(Scene::new([scene.objects[0].clone(), ball]).camera.up, DVec3::Y);
}

/// What a scene says about a capture is loaded, written and loaded again.
#[test]
fn a_scene_says_how_a_capture_is_drawn() {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/models/guitar_3dgs.ply");
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scene.xml");
    let load = |attributes: &str| {
        let text = format!("<scene><object><pointModel {attributes}>{}</pointModel></object></scene>", model.display());
        fs::write(&path, text).unwrap();
        scene_file::load(&path, &scene_file::SceneLoadOptions::default())
    };
    let plain = load("").unwrap().scene;
    let drawn = |scene: &Scene| {
        let Shape::Gaussians { model, capture } = &scene.objects[0].shape else { panic!("no capture") };
        (scene.objects[0].source.options.kind, scene.objects[0].opacity, *capture, model.crop)
    };
    assert_eq!(drawn(&plain), (None, 1.0, Capture::default(), None));
    let given = "kind='gaussians' opacity='0.25' shDegree='2' cropMin='-1 -3 -1' antialias='true' colourSpace='linear'";
    let scene = load(given).unwrap().scene;
    let crop = [DVec3::new(-1.0, -3.0, -1.0), DVec3::splat(1e30)];
    let capture = Capture { harmonics: 2, antialias: Some(true) };
    assert_eq!(drawn(&scene), (Some(Kind::Gaussians), 0.25, capture, Some(crop)));
    assert!(scene.objects[0].shape.gaussians().unwrap().gaussians().linear);
    assert_eq!(scene.objects[0].shape.bounds().min.y, -3.0);
    fs::write(&path, scene_file::to_xml(&scene, directory.path())).unwrap();
    let again = scene_file::load(&path, &scene_file::SceneLoadOptions::default()).unwrap().scene;
    assert_eq!(drawn(&again), drawn(&scene));

    let surfels = load("kind='surfels' opacity='0.5'").unwrap();
    assert!(surfels.scene.objects[0].shape.surfels().unwrap().surfels().len() > 10_000);
    assert!(surfels.notes.iter().any(|note| note.contains("mean nothing here")), "{:?}", surfels.notes);
    let refused = load("cropMin='0 0 0' cropMax='1 -1 1'").map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("`cropMax`") && refused.contains("at least `cropMin`"), "{refused}");
}

/// A capture has colours as they were seen, and no sides.
#[test]
fn what_means_nothing_for_a_capture_is_noted() {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/models/guitar_3dgs.ply");
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scene.xml");
    let notes = |attributes: &str, inside: &str| {
        let object = format!("<object {attributes}><pointModel>{}</pointModel>{inside}</object>", model.display());
        fs::write(&path, format!("<scene>{object}</scene>")).unwrap();
        scene_file::load(&path, &scene_file::SceneLoadOptions::default()).unwrap().notes
    };
    let silent = notes("twoSided='false'", "");
    assert!(!silent.iter().any(|note| note.ends_with(" nothing here")), "{silent:?}");
    for (attributes, inside, part) in [
        ("", "<material ambient='0.5'/>", "`shininess` of <material> are for what lights shade"),
        ("", "<material reflection='0.5'/>", "`opacity` and `reflection` of <material> are for surfels"),
        ("twoSided='true'", "", "`twoSided` is for surfels"),
        ("detail='full'", "", "`detail` is for models of surfels"),
    ] {
        let notes = notes(attributes, inside);
        assert!(notes.iter().any(|note| note.contains(part) && note.ends_with(" nothing here")), "{part}: {notes:?}");
    }
}

#[test]
fn foreign_captures_are_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    for (name, word) in [("a.ksplat", ".ksplat"), ("lod-meta.json", "streamed SOG")] {
        let path = directory.path().join(name);
        fs::write(&path, "0 0 0\n").unwrap();
        let refused = model::load(&path, &model::LoadOptions::default(), &|_, _| {}).unwrap_err().to_string();
        assert!(refused.contains(word) && !refused.contains('\n'), "{refused}");
    }
}

/// Columns of harmonics: those of degree 4 are read as degree 3 and a note, odd numbers of them as none and a note.
#[test]
fn a_plain_ply_says_what_it_leaves_out() {
    let file = |rest: usize| {
        let own = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"].map(str::to_owned).into_iter();
        let names = own
            .chain((0..rest).map(|k| format!("f_rest_{k}")))
            .chain(["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"].map(str::to_owned));
        let properties: String = names.flat_map(|name| ["property float ".to_owned(), name, "\n".to_owned()]).collect();
        let rest = (0..rest).map(|k| k.to_string()).collect::<Vec<_>>().join(" ");
        format!(
            "ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n1 2 3 0 0 0 {rest} 0 -1 -1 -1 1 0 0 0\n"
        )
    };
    let capture = |rest: usize| parse_capture(file(rest).as_bytes(), ModelFormat::Ply).unwrap().unwrap();
    for (rest, degree, word) in
        [(0, 0, ""), (9, 1, ""), (24, 2, ""), (45, 3, ""), (72, 3, "degree 4"), (10, 0, "10 columns")]
    {
        let found = capture(rest);
        assert_eq!(found.degree, degree, "{rest} columns");
        assert_eq!(found.notes.iter().any(|note| note.contains(word)), !word.is_empty(), "{rest}: {:?}", found.notes);
    }
    // Channel by channel: red has the first 24 of 72.
    let of_degree_4 = capture(72).harmonics;
    assert_eq!(
        (of_degree_4.len(), of_degree_4[0], of_degree_4[14]),
        (15, Vec3::new(0.0, 24.0, 48.0), Vec3::new(14.0, 38.0, 62.0))
    );
}
