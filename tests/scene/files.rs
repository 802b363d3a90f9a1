//! Scene files: what loads, to which values, and what is refused with which words.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use splatblur::anim::Interpolation;
use splatblur::film::Picture;
use splatblur::model::VelocityUnit;
use splatblur::options::Detail;
use splatblur::scene::{Light, Motion, Object, PointMotion, Scene, Shape, Surface};
use splatblur::scene_file::{LoadedScene, SceneError, SceneLoadOptions, load, to_xml, validate};
use splatblur::time::Weight;

const MODEL: &str = include_str!("../data/scenes/m.ply");
const ANIM: &str = include_str!("../data/scenes/a.anim");
const TRIANGLE: &str = include_str!("../data/scenes/t.gltf");
const EVERYTHING: &str = include_str!("../data/scenes/everything.xml");
const ENVIRONMENT: &[u8] = include_bytes!("../data/scenes/e.png");
const FIGURE: &str = include_str!("../data/scenes/figure_4_11.xml");

/// A directory with `scene.xml`, a model `m.ply`, an animation `a.anim`, an environment `e.png`, and a triangle that
/// moves, `t.gltf`.
struct Dir(tempfile::TempDir);

impl Dir {
    fn new(scene: impl AsRef<[u8]>) -> Self {
        let dir = Self(tempfile::tempdir().unwrap());
        dir.add("scene.xml", scene);
        dir.add("m.ply", MODEL);
        dir.add("a.anim", ANIM);
        dir.add("e.png", ENVIRONMENT);
        dir.add("t.gltf", TRIANGLE);
        dir
    }

    fn add(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    fn load_with(&self, options: &SceneLoadOptions<'_>) -> Result<LoadedScene, SceneError> {
        load(&self.path("scene.xml"), options)
    }

    fn load(&self) -> Result<LoadedScene, SceneError> {
        self.load_with(&SceneLoadOptions::default())
    }

    /// What a user sees of an error, without the temporary directory.
    fn words(&self, error: SceneError) -> String {
        let text = format!("{:#}", anyhow::Error::from(error));
        text.replace(&format!("{}/", self.0.path().display()), "")
    }
}

fn loaded(scene: impl AsRef<[u8]>) -> LoadedScene {
    let dir = Dir::new(scene);
    dir.load().unwrap_or_else(|e| panic!("{}", dir.words(e)))
}

/// A scene with one object; `inside` stands in it, `beside` before it.
fn scene(beside: &str, inside: &str) -> String {
    format!("<scene>\n{beside}\n<object>\n<pointModel>m.ply</pointModel>\n{inside}\n</object>\n</scene>\n")
}

/// Asserts that the scene is refused within the time that bad input may take, and with which words.
#[track_caller]
fn refused(scene: impl AsRef<[u8]>, words: &str) {
    let dir = Dir::new(scene);
    let start = Instant::now();
    let error = dir.load().map(|l| l.scene.name).expect_err("refused");
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
    assert_eq!(dir.words(error), words);
}

fn surface(object: &Object) -> &Surface {
    object.shape.surface().expect("a surface")
}

/// How the surfels of an object move by themselves.
fn shown_points(object: &Object) -> PointMotion {
    let Shape::Surfels { points, .. } = object.shape else { panic!("no surfels") };
    points
}

/// The unit and the frame of points that move by themselves are kept, and said to mean nothing for others.
#[test]
fn the_motion_of_points_is_read_and_written() {
    let of = |attributes: &str| {
        let dir = Dir::new(format!("<scene><object {attributes}><pointModel>v.ply</pointModel></object></scene>"));
        let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
        let rates = "property float vx\nproperty float vy\nproperty float vz\nend_header\n";
        dir.add("v.ply", format!("{header}{rates}0 0 0 1 0 0\n1 1 0 0 1 0\n"));
        dir
    };
    let dir = of("velocityUnit='frame' at='-2.5'");
    let scene = dir.load().unwrap().scene;
    let points = PointMotion { unit: Some(VelocityUnit::Frame), at: Some(-2.5) };
    assert_eq!(shown_points(&scene.objects[0]), points);
    assert_eq!(scene.objects[0].shape.surfels().unwrap().surfels().velocity, [Vec3::X, Vec3::Y]);
    dir.add("scene.xml", to_xml(&scene, dir.0.path()));
    assert_eq!(shown_points(&dir.load().unwrap().scene.objects[0]), points);
    let default = of("").load().unwrap();
    assert_eq!(shown_points(&default.scene.objects[0]), PointMotion::default());
    assert!(default.notes.iter().all(|note| !note.contains("velocit")), "{:?}", default.notes);
    let idle = loaded("<scene><object at='1'><pointModel>m.ply</pointModel></object></scene>").notes;
    let note = "object `object1`: `velocityUnit` and `at` are for surfels with velocities, and mean nothing here";
    assert!(idle.iter().any(|found| found == note), "{idle:?}");
    refused(
        "<scene><object velocityUnit='hour'><pointModel>m.ply</pointModel></object></scene>",
        "scene.xml:1:16: `velocityUnit` is `hour`, expected second, frame",
    );
}

/// An environment is a picture of all directions with sound values, and what mirrors it needs one.
#[test]
fn environments_are_checked() {
    let environment = |name: &str| scene(&format!("<environment>{name}</environment>"), "");
    let dir = |name: &str, width: u32, height: u32, value: f32| {
        let dir = Dir::new(environment(name));
        let rgba = vec![[value, 0.5, 0.5, 1.0]; (width * height) as usize];
        Picture { width, height, rgba, layers: Vec::new() }.write(dir.path(name)).unwrap();
        dir
    };
    let words = |dir: &Dir| dir.words(dir.load().map(|l| l.scene.name).expect_err("refused"));
    assert_eq!(
        words(&dir("square.png", 4, 4, 0.5)),
        "scene.xml:2:14: <environment> was refused: square.png: 4 x 4 pixels, expected a picture of all directions: \
         twice as wide as high, at most 8192 x 4096"
    );
    assert_eq!(
        words(&dir("dark.exr", 4, 2, -0.5)),
        "scene.xml:2:14: <environment> was refused: dark.exr: -0.5 at pixel (0, 0), expected a radiance from 0 to 1e30"
    );
    let text = Dir::new(environment("m.ply"));
    assert_eq!(
        words(&text),
        "scene.xml:2:14: <environment> was refused: m.ply: neither a PNG, an EXR nor a Radiance HDR file"
    );
    let missing = Dir::new(environment("none.exr"));
    assert!(words(&missing).starts_with("scene.xml:2:14: no file `none.exr`, expected"));
    let cut = dir("cut.png", 64, 32, 0.5);
    let bytes = fs::read(cut.path("cut.png")).unwrap();
    cut.add("cut.png", &bytes[..bytes.len() / 2]);
    assert!(words(&cut).starts_with("scene.xml:2:14: <environment> was refused: cut.png: "), "{}", words(&cut));
    let notes = loaded(scene("", "<material reflection='0.5'/>")).notes;
    let wanted = "`reflection` of <material> mirrors the <environment>, and means nothing without";
    assert!(notes.iter().any(|note| note == wanted), "{notes:?}");
    let with = loaded(scene("<environment>e.png</environment>", "<material reflection='0.5'/>"));
    assert!(*surface(&with.scene.objects[0]) == Surface { reflection: 0.5, ..Surface::default() });
    assert!(!with.notes.iter().any(|note| note.contains("reflection")), "{:?}", with.notes);
}

/// Where there is no other light the environment is one; what it says goes first. All of that is written.
#[test]
fn an_environment_lights_what_nothing_else_lights() {
    let one = "<light type='ambient'/>";
    for (beside, lights, light, shadows) in [
        ("<environment>e.png</environment>".to_owned(), 0, true, true),
        ("<environment shadows='false'>e.png</environment>".to_owned(), 0, true, false),
        ("<environment light='false'>e.png</environment>".to_owned(), 2, false, true),
        (format!("{one}<environment>e.png</environment>"), 1, false, true),
        (format!("{one}<environment light='true'>e.png</environment>"), 1, true, true),
    ] {
        let dir = Dir::new(scene(&beside, ""));
        for round in 0..2 {
            let scene = dir.load().unwrap().scene;
            let environment = scene.environment.as_ref().unwrap();
            let found = (scene.lights.len(), environment.light, environment.shadows);
            assert_eq!(found, (lights, light, shadows), "{beside}, round {round}");
            dir.add("scene.xml", to_xml(&scene, dir.0.path()));
        }
    }
    // Neither light nor environment: black, in a file too.
    let dir = Dir::new(scene("<environment light='false'>e.png</environment>", ""));
    let mut dark = dir.load().unwrap().scene;
    dark.lights.clear();
    dir.add("scene.xml", to_xml(&dark, dir.0.path()));
    assert_eq!(dir.load().unwrap().scene.lights, [Light::Ambient { colour: DVec3::ZERO }]);
    refused(
        scene("<environment light='maybe'>e.png</environment>", ""),
        "scene.xml:2:14: `light` is `maybe`, expected true or false",
    );
}

/// Radiance pictures are environments, too; a broken one is one line.
#[test]
fn environments_may_be_radiance_pictures() {
    let dir = Dir::new(scene("<environment>sky.hdr</environment>", ""));
    let header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n";
    let pixels = [128, 64, 0, 131].repeat(8);
    dir.add("sky.hdr", [header, &pixels[..]].concat());
    let scene = dir.load().unwrap().scene;
    assert_eq!(scene.environment.unwrap().map().pixels(), [[4.0, 2.0, 0.0]; 8]);
    dir.add("sky.hdr", [header, &pixels[..20]].concat());
    assert_eq!(
        dir.words(dir.load().map(|l| l.scene.name).expect_err("refused")),
        "scene.xml:2:14: <environment> was refused: sky.hdr: row 1 of the pixels is broken or cut short"
    );
}

// What loads.

#[test]
fn the_figure_of_wolf_2008_loads_unchanged() {
    let dir = Dir::new(FIGURE);
    for name in ["sphere.bin", "santa.sfl", "igea.sfl"] {
        dir.add(&format!("scenes/models/{name}"), MODEL);
    }
    for name in ["thrown", "bouncing", "rolling"] {
        dir.add(&format!("scenes/animations/{name}.anim"), ANIM);
    }
    let scene = dir.load().unwrap().scene;
    assert_eq!(scene.name, "scene");
    assert_eq!(scene.objects.len(), 3);
    let santa = &scene.objects[1];
    assert_eq!(santa.name, "object2");
    assert_eq!(santa.source.path, dir.path("scenes/models/santa.sfl"));
    let animation = santa.animation.as_ref().unwrap();
    assert_eq!(animation.path, dir.path("scenes/animations/bouncing.anim"));
    assert_eq!(animation.interpolation, Interpolation::Maya);
    assert!(scene.camera.automatic);
}

#[test]
fn latin_1_is_read_in_paths_and_comments() {
    let text = FIGURE.replace("<scene>", "<!-- caf\u{e9} -->\n<scene>").replace("igea", "ig\u{e9}a \u{e0}");
    let bytes: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let dir = Dir::new(bytes);
    for name in ["sphere.bin", "santa.sfl", "igéa à.sfl"] {
        dir.add(&format!("scenes/models/{name}"), MODEL);
    }
    for name in ["thrown", "bouncing", "rolling"] {
        dir.add(&format!("scenes/animations/{name}.anim"), ANIM);
    }
    assert_eq!(dir.load().unwrap().scene.objects[2].source.path, dir.path("scenes/models/igéa à.sfl"));
}

#[test]
fn byte_order_marks_win() {
    let text = scene("<!-- é -->", "<place translate='1 2 3'/>");
    let utf16 = |to: fn(u16) -> [u8; 2]| "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(to).collect();
    let mut files: Vec<Vec<u8>> = vec![utf16(u16::to_le_bytes), utf16(u16::to_be_bytes)];
    files.push(format!("\u{feff}<?xml version='1.0' encoding='ISO-8859-1'?>{text}").into_bytes());
    for file in files {
        assert_eq!(loaded(file).scene.objects[0].place.translate, DVec3::new(1.0, 2.0, 3.0));
    }
}

#[test]
fn defaults_are_those_of_the_document() {
    let LoadedScene { scene: s, notes, .. } = loaded(scene("", ""));
    assert_eq!((s.image.width, s.image.height, s.image.transparent), (1024, 768, false));
    assert_eq!((s.frames.first, s.frames.last, s.frames.rate), (0, 0, 24.0));
    assert_eq!((s.shutter.open, s.shutter.close, &s.shutter.weight), (-0.25, 0.25, &Weight::Box));
    let direction = DVec3::new(-0.5, -1.0, -0.8).normalize();
    let Light::Directional { direction: d, colour, .. } = s.lights[0] else { panic!("{:?}", s.lights) };
    assert!((d - direction).length() < 1e-15 && colour == DVec3::splat(0.9));
    assert_eq!(s.lights[1..], [Light::Ambient { colour: DVec3::splat(0.3) }]);
    let o = &s.objects[0];
    assert!(o.blur && *surface(o) == Surface::default() && o.epsilon.is_none() && o.source.options.radius_scale == 1.0);
    assert_eq!(notes.iter().filter(|n| n.contains("<camera eye=")).count(), 1, "{notes:?}");
    // Motion by formula: a second of film.
    let s = loaded(scene("", "<motion type='linear' velocity='1 0 0'/>")).scene;
    assert_eq!((s.frames.first, s.frames.last), (0, 24));
}

/// Size and shadows of lights arrive, and come back from a file that is written.
#[test]
fn lights_with_shadows_are_read_and_written() {
    let lights = "<light type='directional' shadows='true' angle='2.5'/>
        <light type='point' position='1 2 3' radius='0.25' shadows='false'/><light type='point' position='1 2 3'/>";
    let dir = Dir::new(scene(lights, ""));
    let s = dir.load().unwrap().scene;
    let shadows: Vec<bool> = s.lights.iter().map(Light::has_shadows).collect();
    assert_eq!(shadows, [true, false, true]);
    let Light::Directional { angle, .. } = s.lights[0] else { panic!("{:?}", s.lights) };
    assert!((angle.to_degrees() - 2.5).abs() < 1e-12);
    assert!(matches!(s.lights[1], Light::Point { radius: 0.25, .. }), "{:?}", s.lights);
    dir.add("scene.xml", to_xml(&s, dir.0.path()));
    assert_eq!(dir.load().unwrap().scene.lights, s.lights);
    for (wrong, what) in [
        ("<light type='ambient' shadows='true'/>", "shadows"),
        ("<light type='point' position='1 2 3' angle='1'/>", "angle"),
        ("<light type='directional' angle='181'/>", "angle"),
        ("<light type='directional' radius='1'/>", "radius"),
    ] {
        let dir = Dir::new(scene(wrong, ""));
        let error = dir.words(dir.load().map(|l| l.scene.name).expect_err("refused"));
        assert!(error.contains(what), "{wrong}: {error}");
    }
}

/// Who receives shadows, and what catches them, arrive and come back from a file that is written.
#[test]
fn receivers_of_shadows_are_read_and_written() {
    let object = |attributes: &str| format!("<object {attributes}><pointModel>m.ply</pointModel></object>");
    let all = [object(""), object("receiveShadows='false'"), object("shadowCatcher='true'")].concat();
    let dir = Dir::new(format!("<scene>{all}</scene>"));
    for round in 0..2 {
        let scene = dir.load().unwrap().scene;
        let found: Vec<_> = scene.objects.iter().map(|o| (o.receive_shadows, o.shadow_catcher)).collect();
        assert_eq!(found, [(true, false), (false, false), (true, true)], "round {round}");
        dir.add("scene.xml", to_xml(&scene, dir.0.path()));
    }
    for (name, value) in [("receiveShadows", "yes"), ("shadowCatcher", "1e30")] {
        refused(
            format!("<scene>\n{}</scene>", object(&format!("{name}='{value}'"))),
            &format!("scene.xml:2:9: `{name}` is `{value}`, expected true or false"),
        );
    }
}

#[test]
fn every_value_arrives() {
    let s = loaded(EVERYTHING).scene;
    assert_eq!((s.image.width, s.image.height, s.image.transparent), (640, 360, true));
    assert_eq!(s.image.background, DVec3::new(0.03, 0.035, 0.05));
    assert_eq!((s.frames.first, s.frames.last, s.frames.rate), (-2, 30, 29.97));
    assert_eq!(s.shutter.weight, Weight::Curve(vec![(0.1, 0.0), (1.0 / 3.0, 2.5), (1.0, 0.001)]));
    assert_eq!(s.camera.eye, DVec3::new(0.6, 2.3, 9.6));
    assert!((s.camera.fovy.to_degrees() - 34.7).abs() < 1e-12 && !s.camera.automatic);
    assert_eq!(s.camera.animation.as_ref().unwrap().interpolation, Interpolation::Linear);
    assert_eq!(s.lights[1], Light::point(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1e6, 0.3, 0.0) * 1_048_576.0));
    let [_, _, triangle] = s.objects.as_slice() else { panic!("{} objects", s.objects.len()) };
    assert_eq!(triangle.source.options.node.as_deref(), Some("a \"b\" & c"));
    // A quarter of a unit in half a second, over and over. The scene's own frame rate goes before `fps`.
    let moved = splatblur::scene::pose::object_pose(&s, triangle, 20.0).world_from_model.w_axis.x;
    assert!((moved - 0.5 * (20.0 / 29.97 - 0.5)).abs() < 1e-6, "{moved}");
    let chain = format!("{:?}", triangle.animation);
    assert!(chain.contains("fps: 12.5") && chain.contains("looped: true"), "{chain}");
    let o = &s.objects[0];
    assert_eq!(o.name, "a <b> & \"c\" é");
    assert_eq!(
        (o.blur, surface(o).two_sided, o.epsilon, o.detail, o.source.options.radius_scale),
        (false, true, Some(0.0125), Detail::Final, 2.25)
    );
    assert_eq!(o.transform.scale, DVec3::splat(1.7));
    assert_eq!(o.transform.rotate.y, -std::f64::consts::FRAC_PI_2);
    assert_eq!(o.motions[1], Motion::Linear { velocity: DVec3::new(0.0, 0.0, 0.1) });
    let Motion::Rotation { axis, per_frame, centre } = o.motions[0] else { panic!("{:?}", o.motions) };
    assert!((axis.length() - 1.0).abs() < 1e-15 && (per_frame.to_degrees() + 12.345).abs() < 1e-12);
    assert_eq!(centre, DVec3::new(0.1, 0.2, 0.3));
    assert_eq!(o.place.scale, DVec3::new(-1.0, 2.0, 0.3));
    let e = s.environment.as_ref().unwrap();
    assert_eq!((e.map().width(), e.map().height(), e.intensity, e.background), (8, 4, 1.5, true));
    assert!((e.rotation.to_degrees() + 33.3).abs() < 1e-12 && surface(o).reflection == 0.3);
    // PNG holds coded values.
    assert!((e.map().pixels()[1][0] - 0.002_428).abs() < 1e-5, "{:?}", e.map().pixels()[1]);
    let volume = &o.source.options.volume;
    assert_eq!((o.opacity, volume.kernel, volume.flatten, volume.lit), (0.75, 0.7, 2.5, true));
    let stops = volume.transfer.as_ref().unwrap().stops().to_vec();
    assert_eq!(stops.len(), 2);
    assert_eq!((stops[0].value, stops[0].colour, stops[0].opacity), (-1e-3, glam::Vec3::ONE, 0.0));
    assert_eq!(stops[1].colour, glam::Vec3::new(1.0, 0.3, 0.007));
    let m = surface(o).material.unwrap();
    assert_eq!((m.ambient, m.diffuse, m.specular, m.shininess), (0.2, 0.6, 0.4, 20.5));
}

#[test]
fn weights_take_their_own_attributes_and_defaults() {
    let weight = |attributes: &str| loaded(scene(&format!("<shutter {attributes}/>"), "")).scene.shutter.weight;
    assert_eq!(weight("weight='tent'"), Weight::Tent);
    assert_eq!(weight("weight='ramp'"), Weight::Ramp { centre: 1.0 });
    assert_eq!(weight("weight='ramp' centre='0.25'"), Weight::Ramp { centre: 0.25 });
    assert_eq!(weight("weight='one-minus-exponential'"), Weight::OneMinusExponential { centre: 1.0 });
    assert_eq!(weight("weight='exponential'"), Weight::Exponential { rate: 3.0, centre: 1.0 });
    assert_eq!(weight("weight='gaussian'"), Weight::Gaussian { centre: 0.5, width: 0.2 });
}

#[test]
fn models_named_alike_are_loaded_once() {
    let object =
        |attributes: &str, path: &str| format!("<object><pointModel {attributes}>{path}</pointModel></object>");
    let all = [object("", "m.ply"), object("", "./m.ply"), object("radiusScale='2'", "m.ply")].concat();
    let objects = loaded(format!("<scene>{all}</scene>")).scene.objects;
    let surfels = |i: usize| objects[i].shape.surfels().unwrap().surfels();
    assert!(Arc::ptr_eq(surfels(0), surfels(1)));
    assert!(!Arc::ptr_eq(surfels(0), surfels(2)));
}

/// A material that says its opacity alone leaves the coefficients of the file, and comes back so.
#[test]
fn opacities_of_materials() {
    let object = |inside: &str| loaded(scene("", inside)).scene.objects[0].clone();
    let opaque = object("<material/>");
    assert!(opaque.shape.material().is_some() && opaque.opacity == 1.0 && !opaque.is_see_through());
    let thin = object("<material opacity='0.5'/>");
    assert!(thin.shape.material().is_none() && thin.opacity == 0.5 && thin.is_see_through());
    let both = object("<material opacity='0.5' diffuse='0.25'/>");
    assert_eq!(
        (both.shape.material().unwrap().diffuse, both.shape.material().unwrap().ambient, both.opacity),
        (0.25, 1.0, 0.5)
    );
    // As good as opaque.
    assert!(!object("<material opacity='0.999'/>").is_see_through());
    for inside in ["<material opacity='0.5'/>", "<material opacity='0' specular='0'/>", "<material/>"] {
        comes_back(&Dir::new(scene("", inside)));
    }
    refused(
        scene("", "<material opacity='1.5'/>"),
        "scene.xml:5:11: `opacity` is `1.5`, expected a number from 0 to 1",
    );
}

#[test]
fn default_names_avoid_given_ones() {
    let object = |attributes: &str| format!("<object {attributes}><pointModel>m.ply</pointModel></object>");
    let objects = loaded(format!("<scene>{}{}</scene>", object(""), object("name='object1'"))).scene.objects;
    assert_eq!((objects[0].name.as_str(), objects[1].name.as_str()), ("object1_", "object1"));
}

// Round trips.

/// Everything but whether the camera was automatic, and when files were written; `Debug` prints floats so that no two
/// look alike.
fn fields(scene: &Scene) -> String {
    let mut scene = scene.clone();
    scene.camera.automatic = false;
    for stamp in scene.files.values_mut() {
        *stamp = None;
    }
    format!("{scene:?}")
}

/// A file without lights has those of the default, so a scene without any is written with a black one.
#[test]
fn a_scene_without_lights_stays_dark() {
    let dir = Dir::new("<scene><object><pointModel>m.ply</pointModel></object></scene>");
    let mut scene = dir.load().unwrap().scene;
    assert!(scene.lights.len() > 1, "the default");
    scene.lights.clear();
    dir.add("scene.xml", to_xml(&scene, dir.0.path()));
    let again = dir.load().unwrap().scene;
    assert_eq!(again.lights, [Light::Ambient { colour: DVec3::ZERO }]);
}

#[track_caller]
fn comes_back(dir: &Dir) {
    all_come_back(std::slice::from_ref(dir));
}

/// All are written before one is read: a file is opened when it has been at rest for a while.
fn all_come_back(dirs: &[Dir]) {
    let scenes: Vec<Scene> = dirs.iter().map(|dir| dir.load().unwrap().scene).collect();
    for (dir, first) in dirs.iter().zip(&scenes) {
        dir.add("scene.xml", to_xml(first, dir.0.path()));
    }
    for (dir, first) in dirs.iter().zip(&scenes) {
        let second = dir.load().unwrap_or_else(|e| panic!("{}", dir.words(e))).scene;
        assert_eq!(fields(first), fields(&second));
        assert_eq!(to_xml(first, dir.0.path()), to_xml(&second, dir.0.path()));
    }
}

#[test]
fn what_is_written_loads_to_the_same_scene() {
    let turning = scene("<shutter weight='gaussian' width='0.31'/>", "<animation>a.anim</animation>");
    for text in [EVERYTHING, &scene("", ""), &turning] {
        comes_back(&Dir::new(text));
    }
    for weight in ["tent", "ramp", "exponential", "one-minus-exponential", "gaussian"] {
        comes_back(&Dir::new(scene(&format!("<shutter weight='{weight}'/>"), "")));
    }
}

#[test]
fn paths_are_written_for_the_new_place() {
    let dir = Dir::new(scene("", ""));
    fs::create_dir(dir.path("sub")).unwrap();
    let first = dir.load().unwrap().scene;
    let text = to_xml(&first, &dir.path("sub"));
    assert!(text.contains(">../m.ply</pointModel>"), "{text}");
    dir.add("sub/scene.xml", text);
    load(&dir.path("sub/scene.xml"), &SceneLoadOptions::default()).unwrap();
}

#[test]
fn the_automatic_camera_can_be_pasted() {
    let dir = Dir::new(scene("", "<motion type='linear' velocity='0.37 0 0'/>"));
    let LoadedScene { scene: first, notes, .. } = dir.load().unwrap();
    let note = notes.iter().find(|n| n.contains("<camera")).unwrap();
    let line = &note[note.find("<camera").unwrap()..];
    dir.add("scene.xml", scene(line, "<motion type='linear' velocity='0.37 0 0'/>"));
    let second = dir.load().unwrap().scene;
    assert!(first.camera.automatic && !second.camera.automatic);
    assert_eq!(fields(&first), fields(&second));
}

#[test]
fn the_automatic_camera_sees_everything() {
    for (size, inside) in [
        ("width='1000' height='100'", "<motion type='linear' velocity='0.5 0.25 -1'/>"),
        ("width='100' height='900'", "<place translate='5e6 0 3' rotate='10 20 30' scale='3'/>"),
        ("", "<transform scale='1e-4'/>"),
        ("", "<transform scale='1e5'/><motion type='rotation' axis='0 0 1' degreesPerFrame='15' centre='3 0 0'/>"),
    ] {
        let s = loaded(scene(&format!("<image {size}/>"), inside)).scene;
        let (camera, object) = (&s.camera, &s.objects[0]);
        assert!(camera.eye.z > camera.at.z && camera.eye.x == camera.at.x && camera.eye.y == camera.at.y);
        let tan = (0.5 * camera.fovy).tan();
        let aspect = f64::from(s.image.width) / f64::from(s.image.height);
        for frame in s.frames.first..=s.frames.last {
            let pose = splatblur::scene::pose::object_pose(&s, object, frame as f64);
            let view = splatblur::scene::pose::camera_from_world(&s, frame as f64) * pose.world_from_model;
            for corner in object.shape.bounds().corners().into_iter().filter(|c| c.is_finite()) {
                let p = view.transform_point3(corner);
                let depth = -p.z;
                assert!(depth > camera.near && p.y.abs() < depth * tan && p.x.abs() < depth * tan * aspect, "{p}");
            }
        }
    }
}

// Paths.

#[test]
fn paths_are_found_in_any_case_with_a_note() {
    let dir = Dir::new("<scene><object><pointModel>\n Models\\M.PLY </pointModel></object></scene>");
    dir.add("models/m.ply", MODEL);
    let LoadedScene { scene, notes, .. } = dir.load().unwrap();
    assert_eq!(scene.objects[0].source.path, dir.path("models/m.ply"));
    assert!(notes[0].contains("scene.xml:2:2: no file `Models\\M.PLY`, took "), "{notes:?}");
}

#[test]
fn a_missing_file_names_all_places() {
    refused(
        "<scene>\n <object>\n  <pointModel>no\\such.ply</pointModel></object></scene>",
        "scene.xml:3:15: no file `no\\such.ply`, expected a readable regular file at one of: no/such.ply, no/such.ply",
    );
    refused(
        "<scene><object><pointModel>/dev/null</pointModel></object></scene>",
        "scene.xml:1:28: no file `/dev/null`, expected a readable regular file at one of: /dev/null (a device)",
    );
}

#[cfg(unix)]
#[test]
fn pipes_and_directories_are_not_opened() {
    let dir = Dir::new("");
    fs::remove_file(dir.path("scene.xml")).unwrap();
    let error = dir.load().map(|_| ()).unwrap_err();
    assert_eq!(dir.words(error), "cannot read scene scene.xml: No such file or directory (os error 2)");
    assert!(std::process::Command::new("mkfifo").arg(dir.path("scene.xml")).status().unwrap().success());
    let error = dir.load().map(|_| ()).unwrap_err();
    assert_eq!(dir.words(error), "scene scene.xml is a pipe, expected a regular file");
    fs::rename(dir.path("scene.xml"), dir.path("pipe")).unwrap();
    dir.add("scene.xml", "<scene><object><pointModel>pipe</pointModel></object></scene>");
    let words = dir.words(dir.load().map(|_| ()).unwrap_err());
    assert!(words.contains("pipe (a pipe)"), "{words}");
    fs::remove_file(dir.path("scene.xml")).unwrap();
    fs::create_dir(dir.path("scene.xml")).unwrap();
    let error = dir.load().map(|_| ()).unwrap_err();
    assert_eq!(dir.words(error), "scene scene.xml is a directory, expected a regular file");
}

#[cfg(unix)]
#[test]
fn restricted_paths_stay_inside() {
    let outside = Dir::new("");
    let far = outside.path("m.ply");
    let dir = Dir::new(scene("", ""));
    let options = SceneLoadOptions { restrict: Some(dir.0.path()), ..SceneLoadOptions::default() };
    dir.load_with(&options).unwrap();
    std::os::unix::fs::symlink(&far, dir.path("link.ply")).unwrap();
    std::os::unix::fs::symlink(outside.0.path(), dir.path("linked")).unwrap();
    let up = format!("../{}/m.ply", outside.0.path().file_name().unwrap().to_str().unwrap());
    for path in [far.to_str().unwrap(), "link.ply", "linked/m.ply", "LINKED/m.ply", &up] {
        dir.add("scene.xml", format!("<scene><object><pointModel>{path}</pointModel></object></scene>"));
        dir.load().unwrap();
        let error = dir.load_with(&options).map(|_| ()).unwrap_err();
        assert!(matches!(error, SceneError::Restricted { .. }), "{path}: {error}");
        let words = error.to_string();
        assert!(words.contains("is the file") && words.contains("expected one in"), "{words}");
    }
    let nowhere = SceneLoadOptions { restrict: Some(Path::new("/no/such/dir")), ..SceneLoadOptions::default() };
    let words = dir.words(dir.load_with(&nowhere).map(|_| ()).unwrap_err());
    assert_eq!(words, "cannot restrict paths to /no/such/dir: No such file or directory (os error 2)");
}

// What is unknown.

#[test]
fn a_namespace_is_accepted_on_the_root_alone() {
    let text = |root: &str, object: &str| {
        format!("<scene {root}><object {object}><pointModel>m.ply</pointModel></object></scene>")
    };
    let names = "xmlns='https://example.org/scene' xmlns:xsi='http://www.w3.org/2001/XMLSchema-instance'";
    assert_eq!(loaded(text(names, "")).scene.objects.len(), 1);
    refused(
        text("", "xmlns='a'"),
        "scene.xml:1:17: <object> has no attribute `xmlns` (it takes: name, blur, castShadows, receiveShadows, \
         shadowCatcher, twoSided, epsilon, detail, \
         velocityUnit, at)",
    );
    refused(text("xmln='a'", ""), "scene.xml:1:8: <scene> has no attribute `xmln` (it takes: none)");
}

#[test]
fn the_unknown_is_refused_with_what_is_known() {
    refused(
        scene("", "<transfrom/>"),
        "scene.xml:5:1: <object> has no element `transfrom`, did you mean `transform`? (it takes: <pointModel>, \
         <sphere>, <transform>, <animation>, <motion>, <place>, <material>, <transferFunction>)",
    );
    refused(
        scene("<camera\n  fov='40'/>", ""),
        "scene.xml:3:3: <camera> has no attribute `fov`, did you mean `fovy`? (it takes: eye, at, up, atObject, fovy, \
         near, speed, easeIn, easeOut)",
    );
    refused("<scene version='1'/>", "scene.xml:1:8: <scene> has no attribute `version` (it takes: none)");
    refused("<szene/>", "scene.xml:1:1: the root element `szene`, expected <scene>");
    let vtk = "scene.xml:1:1: the root element `VTKFile`, expected <scene>; VTK is not read: write PLY, or text with \
               named columns";
    refused("<VTKFile/>", vtk);
}

#[test]
fn lenient_turns_exactly_the_unknown_into_notes() {
    let lenient = SceneLoadOptions { lenient: true, ..SceneLoadOptions::default() };
    let text = scene("<sky><cloud/>rain</sky>", "<place translat='1 2 3' scale='2'/>");
    let dir = Dir::new(&text);
    let LoadedScene { scene: s, notes, .. } = dir.load_with(&lenient).unwrap();
    assert_eq!(s.objects[0].place.scale, DVec3::splat(2.0));
    let notes: Vec<_> = notes.iter().filter(|n| n.ends_with("; ignored")).collect();
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(notes[0].contains("scene.xml:2:1: <scene> has no element `sky` (it takes: <image>"), "{notes:?}");
    assert!(notes[1].contains("has no attribute `translat`, did you mean `translate`?"), "{notes:?}");
    for bad in
        ["<place scale='0'/>", "<place/><place/>", "words", "<motion type='linear' velocity='1 2 3' axis='0 0 1'/>"]
    {
        let dir = Dir::new(scene("", bad));
        assert!(dir.load_with(&lenient).is_err(), "{bad}");
    }
}

#[test]
fn notes_about_the_unknown_are_few_and_quick() {
    let dir = Dir::new(scene(&"<a/>".repeat(100_000), ""));
    let start = Instant::now();
    let notes = dir.load_with(&SceneLoadOptions { lenient: true, ..SceneLoadOptions::default() }).unwrap().notes;
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
    assert!(notes[50].ends_with("scene.xml: 99950 more unknown elements or attributes"), "{}", notes[50]);
}

// What is malformed.

#[test]
fn structure_is_checked() {
    refused("<scene/>", "scene.xml:1:1: <scene> has no <object>, expected at least one");
    refused(
        "<scene>\n<object/></scene>",
        "scene.xml:2:1: <object> has no <pointModel>, expected exactly one shape (pointModel or sphere)",
    );
    refused(
        scene("", "<pointModel>m.ply</pointModel>"),
        "scene.xml:5:1: a second <pointModel> in <object>, expected exactly one shape (pointModel or sphere)",
    );
    refused(
        scene("", "<sphere/>"),
        "scene.xml:5:1: a second <sphere> in <object>, expected exactly one shape (pointModel or sphere)",
    );
    refused(scene("<image/> <image/>", ""), "scene.xml:2:10: a second <image> in <scene>, expected at most one");
    refused(scene("<shutter><curve/></shutter>", ""), "scene.xml:2:10: <curve> has no <point>, expected at least one");
    refused(
        scene("", "fast"),
        "scene.xml:5:1: text `fast` in <object>, expected only <pointModel>, <sphere>, <transform>, <animation>, \
         <motion>, <place>, <material>, <transferFunction>",
    );
    refused(scene("<image>big</image>", ""), "scene.xml:2:8: text `big` in <image>, expected nothing inside");
    refused(
        scene("", "<animation> </animation>"),
        "scene.xml:5:1: <animation> is empty, expected the path of an animation file",
    );
    refused(
        scene("", "<motion type='linear'/>"),
        "scene.xml:5:1: <motion> needs the attribute `velocity`: scene units per frame, three numbers from -1e30 to \
         1e30",
    );
    refused(
        scene("", "<motion axis='1 0 0'/>"),
        "scene.xml:5:1: <motion> needs the attribute `type`: kind of motion, linear, rotation",
    );
}

#[test]
fn what_does_not_apply_is_refused() {
    refused(
        scene("", "<motion type='rotation' axis='0 1 0' degreesPerFrame='1' velocity='1 0 0'/>"),
        "scene.xml:5:58: `velocity` does not apply to <motion> with type=\"rotation\" (it takes: type, axis, \
         degreesPerFrame, centre)",
    );
    refused(
        scene("<shutter centre='0.5'/>", ""),
        "scene.xml:2:10: `centre` does not apply to <shutter> with weight=\"box\" (it takes: open, close, weight, \
         readout, direction, anchor)",
    );
    refused(
        scene("<shutter weight='box'><curve><point time='0' weight='1'/></curve></shutter>", ""),
        "scene.xml:2:10: `weight` does not apply to <shutter> with a <curve> (it takes: open, close, \
         readout, direction, anchor)",
    );
    refused(
        scene("<light type='ambient' direction='0 0 1'/>", ""),
        "scene.xml:2:23: `direction` does not apply to <light> with type=\"ambient\" (it takes: type, colour, \
         intensity)",
    );
}

#[test]
fn values_are_checked() {
    let image = |value: &str| scene(&format!("<image width='{value}'/>"), "");
    for bad in ["0", "65536", "-1", "1.5", "", "9999999999999999999999", "1e3"] {
        let words = format!("scene.xml:2:8: `width` is `{bad}`, expected a whole number from 1 to 65535");
        refused(image(bad), &words);
    }
    for bad in ["0", "180", "NaN", "inf", "1e999", "-40", "40deg"] {
        let words = format!("scene.xml:2:9: `fovy` is `{bad}`, expected a number from 1e-6 to 179.999");
        refused(scene(&format!("<camera fovy='{bad}'/>"), ""), &words);
    }
    for bad in ["1 2", "1 2 3 4", "1,2,3", "a b c", "1 2 nan", "1e31 0 0"] {
        let words = format!("scene.xml:2:9: `eye` is `{bad}`, expected three numbers from -1e30 to 1e30");
        refused(scene(&format!("<camera eye='{bad}'/>"), ""), &words);
    }
    for bad in ["0", "1 0 1", "1 2", "1 2 3 4", "inf"] {
        let words = format!(
            "scene.xml:5:12: `scale` is `{bad}`, expected one number or three, each from 1e-9 to 1e9 or the negative \
             of that"
        );
        refused(scene("", &format!("<transform scale='{bad}'/>")), &words);
    }
    refused(
        scene("<camera up='0 0 0'/>", ""),
        "scene.xml:2:9: `up` is `0 0 0`, expected three numbers, length from 1e-9 to 1e30",
    );
    refused(scene("<image transparent='yes'/>", ""), "scene.xml:2:8: `transparent` is `yes`, expected true or false");
    refused(
        scene("<shutter weight='hat'/>", ""),
        "scene.xml:2:10: `weight` is `hat`, expected box, tent, ramp, exponential, one-minus-exponential, gaussian",
    );
    refused(
        scene("<shutter open='0.5'/>", ""),
        "scene.xml:2:1: `close` is 0.25 by default, expected more than `open`, 0.5",
    );
    refused(scene("<frames first='3' last='2'/>", ""), "scene.xml:2:19: `last` is 2, expected at least `first`, 3");
    refused(scene("<frames rate='0'/>", ""), "scene.xml:2:9: `rate` is `0`, expected a number from 0.001 to 1000000");
    refused(
        scene("<shutter><curve>\n<point time='0.5' weight='1'/><point time='0.5' weight='1'/></curve></shutter>", ""),
        "scene.xml:3:38: `time` is 0.5, expected more than that of the point before, 0.5",
    );
    refused(
        scene("<shutter><curve><point time='0.5' weight='0'/></curve></shutter>", ""),
        "scene.xml:2:10: the area under <curve> is 0, expected some weight above 0",
    );
    refused(
        scene("<camera eye='1 2 3' at='1 2 3'/>", ""),
        "scene.xml:2:1: the view from `eye` to `at` of <camera> is 0 long, expected two different points",
    );
    refused(
        scene("<camera eye='0 5 0' at='0 0 0'/>", ""),
        "scene.xml:2:1: the view from `eye` to `at` of <camera> is along `up`, expected another direction than `up`",
    );
    refused(
        "<scene><object name='a'><pointModel>m.ply</pointModel></object>\n<object name='a'>\
         <pointModel>m.ply</pointModel></object></scene>",
        "scene.xml:2:9: `name` is `a`, expected a name that no other object has",
    );
    refused(
        "<scene><object name='a&#10;b'><pointModel>m.ply</pointModel></object></scene>",
        "scene.xml:1:16: `name` is `a\\nb`, expected text without control characters",
    );
    for kind in ["gaussians", "volume"] {
        refused(
            format!("<scene><object><pointModel sequence='%d.ply' first='1' last='2' kind='{kind}'/></object></scene>"),
            &format!("scene.xml:1:65: `kind` is `{kind}`, expected surfels or spheres: a sequence shows nothing else"),
        );
    }
}

#[test]
fn xml_is_checked() {
    refused("", "scene.xml:1:1: no element, expected <scene>");
    refused(
        "ply\nformat ascii 1.0\n",
        "scene.xml:1:1: text `ply\\nformat ascii 1.0`, expected an XML document: <scene> ...",
    );
    refused(
        FIGURE.replace("<scene>", "- <scene>"),
        "scene.xml:2:1: a dash before a tag, expected XML as it is in the file: this looks copied from a browser, \
         which draws dashes; remove the dashes",
    );
    refused(
        FIGURE.replace("  <object>", "-   <object>"),
        "scene.xml:3:1: a dash before a tag, expected XML as it is in the file: this looks copied from a browser, \
         which draws dashes; remove the dashes",
    );
    refused(
        "<scene>\n<object>\n",
        "scene.xml:2:9: the end of the file inside <object>, expected </object> (opened in line 2)",
    );
    refused("<scene>\n<object></scene>", "scene.xml:2:9: </scene>, expected </object> to close <object>");
    refused("<scene></scene></scene>", "scene.xml:1:16: </scene>, expected well-formed XML");
    refused("<scene/>\n<scene/>", "scene.xml:2:1: a second root element <scene>, expected only <scene>");
    refused("<scene/> x", "scene.xml:1:10: text `x`, expected the end of the file");
    refused(
        "<scene><image width='1' width='2'/></scene>",
        "scene.xml:1:25: a second attribute `width`, expected each at most once",
    );
    refused(
        "<scene><light type='ambient' colour='1 1 1' color='1 1 1'/></scene>",
        "scene.xml:1:45: a second attribute `color`, expected each at most once",
    );
    refused(
        "<scene><camera color='1'/></scene>",
        "scene.xml:1:16: <camera> has no attribute `color` (it takes: eye, at, up, atObject, fovy, near, speed, \
         easeIn, easeOut)",
    );
    refused(
        "<scene><image width=1/></scene>",
        "scene.xml:1:21: an attribute value without quotes, expected name=\"value\"",
    );
    refused("<scene><image width/></scene>", "scene.xml:1:20: an attribute without a value, expected name=\"value\"");
    refused("<scene><image width='<'/></scene>", "scene.xml:1:15: `<` in the value of `width`, expected `&lt;`");
    refused("<scene><></></scene>", "scene.xml:1:8: a tag without a name, expected a name after `<`");
    refused(
        "<scene><image",
        "scene.xml:1:8: syntax error: tag not closed: `>` not found before end of input, expected well-formed XML",
    );
    refused(
        "<scene/>\n<?xml version='1.0'?>",
        "scene.xml:2:1: an XML declaration, expected it only at the very start of the file",
    );
}

#[test]
fn encodings_are_checked() {
    refused(
        "<?xml version='1.0' encoding='EBCDIC'?><scene/>",
        "scene.xml:1:1: encoding `EBCDIC`, expected one like UTF-8 or ISO-8859-1",
    );
    refused(
        b"<scene>\n<!-- caf\xe9 --></scene>",
        "scene.xml:2:9: bytes that are not UTF-8, expected text in the encoding that the XML declaration names \
         (default: UTF-8)",
    );
    refused(b"<scene>\0</scene>", "scene.xml:1:8: a control character, expected an XML text file");
    refused(
        b"<\0s\0/\0>\0",
        "scene.xml:1:1: UTF-16 without a byte order mark, expected UTF-8, or UTF-16 with a byte order mark",
    );
    refused(vec![b' '; 64_000_001], "scene scene.xml has more than 64000000 bytes, the most that a scene may have");
}

#[test]
fn entities_are_not_expanded() {
    let bomb = "<!DOCTYPE scene [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;&a;&a;&a;'>]>\n<scene>&b;</scene>";
    refused(bomb, "scene.xml:1:1: a document type (<!DOCTYPE>), expected none: scenes define no entities");
    let expected = "expected one of &amp; &lt; &gt; &quot; &apos; or a character like &#233;";
    refused("<scene>&b;</scene>", &format!("scene.xml:1:8: `&b;`, {expected}"));
    refused("<scene><image width='&b;'/></scene>", &format!("scene.xml:1:15: `&b;`, {expected}"));
    refused("<scene>&#0;</scene>", &format!("scene.xml:1:8: `&#0;`, {expected}"));
    refused("<scene>a & b</scene>", &format!("scene.xml:1:10: `&`, {expected}"));
    let many = format!("<scene>{}</scene>", "&b;".repeat(300_000));
    refused(many, &format!("scene.xml:1:8: `&b;`, {expected}"));
    // What is allowed arrives.
    let s =
        loaded("<scene><object name='&#233;&amp;'><pointModel>&#x6d;.p<![CDATA[ly]]></pointModel></object></scene>")
            .scene;
    assert_eq!(s.objects[0].name, "é&");
}

#[test]
fn hostile_sizes_are_cheap() {
    refused("<a>".repeat(300_000), "scene.xml:1:49: deeper nesting, expected at most 16 elements inside each other");
    let attributes: String = (0..100_000).map(|i| format!(" a{i}=''")).collect::<Vec<_>>().concat();
    refused(format!("<scene{attributes}/>"), "scene.xml:1:446: more attributes, expected at most 64 on one element");
    // 0.6 s, of which a busy computer makes more.
    let many = Dir::new(format!("<scene>{}", "<a/>".repeat(4_000_000)));
    assert_eq!(
        many.words(many.load().map(|l| l.scene.name).unwrap_err()),
        "scene.xml:1:16000004: more elements, expected at most 4000000 elements and attributes"
    );
    let long = "x".repeat(900_000);
    refused(
        format!("<{long}/>"),
        &format!("scene.xml:1:1: the root element `{}...`, expected <scene>", "x".repeat(60)),
    );
    refused(
        scene(&format!("<image width='{long}'/>"), ""),
        &format!("scene.xml:2:8: `width` is `{}...`, expected a whole number from 1 to 65535", "x".repeat(60)),
    );
}

#[test]
fn crowds_are_quick() {
    // One line, so that positions are as costly as they get.
    let object = "<object><pointModel>M.ply</pointModel><animation>a.anim</animation></object>";
    let dir = Dir::new(format!("<scene>{}</scene>", object.repeat(13_000)));
    let start = Instant::now();
    let LoadedScene { scene, notes, .. } = dir.load().unwrap();
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
    assert_eq!(scene.objects.len(), 13_000);
    assert!(notes.len() < 10, "{}", notes.len());
    // One object a line, each with a name, a place and a motion of its own: 3.3 MB, 0.4 s.
    let object = |i: usize| {
        format!(
            "<object name='tree {i}'><pointModel>m.ply</pointModel><transform translate='{i} 0 1' scale='0.5'/>\
             <motion type='linear' velocity='0 {i} 0'/></object>\n"
        )
    };
    let dir = Dir::new(format!("<scene>{}</scene>", (0..20_000).map(object).collect::<String>()));
    let start = Instant::now();
    assert_eq!(dir.load().unwrap().scene.objects.len(), 20_000);
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
    let object = |i| format!("<object><pointModel radiusScale='1.{i}'>m.ply</pointModel></object>");
    refused(
        format!("<scene>{}</scene>", (10..43).map(object).collect::<String>()),
        "scene.xml:1:2159: <pointModel> is variant 33 of the file m.ply, expected at most 32 sets of `radiusScale`, \
         `colourSpace`, `kind`, `spacing`, `reduce`, what clouds of points and what volumes take for one \
         file",
    );
}

/// Loads files as scenes; panics and slowness are what is tested. All are written before one is read.
fn survive(files: &[Vec<u8>]) -> Result<(), TestCaseError> {
    let dirs: Vec<Dir> = files.iter().map(Dir::new).collect();
    dirs.iter().zip(files).try_for_each(|(dir, bytes)| survives(dir, bytes))
}

fn survives(dir: &Dir, bytes: &[u8]) -> Result<(), TestCaseError> {
    let start = Instant::now();
    let valid = validate(&dir.path("scene.xml"), bytes, false).is_ok();
    for lenient in [false, true] {
        // Most are refused, some load: neither may panic. What loads must also come back.
        if let Ok(first) = dir.load_with(&SceneLoadOptions { lenient, ..SceneLoadOptions::default() }) {
            let again = Dir::new(to_xml(&first.scene, dir.0.path()));
            prop_assert!(again.load().is_ok());
            prop_assert!(valid || lenient);
        }
    }
    prop_assert!(start.elapsed() < Duration::from_secs(2));
    Ok(())
}

/// Files of a case: 300 in all.
const TOGETHER: usize = 20;

proptest! {
    #![proptest_config(ProptestConfig { cases: 15, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_are_survived(
        files in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..400), TOGETHER),
    ) {
        survive(&files)?;
    }

    #[test]
    fn mutated_scenes_are_survived(
        files in prop::collection::vec(prop::collection::vec((0..EVERYTHING.len(), 0..12_usize, prop_oneof![
            prop::collection::vec(any::<u8>(), 0..4),
            prop::sample::select(vec!["<", ">", "\"", "/", "&", "</object>", "<scene>", "1e308", "-0", "NaN", " "])
                .prop_map(|s| s.as_bytes().to_vec()),
        ]), 1..4), TOGETHER)
    ) {
        let mutated = |edits: Vec<(usize, usize, Vec<u8>)>| {
            let mut bytes = EVERYTHING.as_bytes().to_vec();
            for (at, cut, insert) in edits {
                let at = at.min(bytes.len());
                bytes.splice(at..(at + cut).min(bytes.len()), insert);
            }
            bytes
        };
        survive(&files.into_iter().map(mutated).collect::<Vec<_>>())?;
    }

    #[test]
    fn numbers_come_back_exactly(
        all in prop::collection::vec((
            prop::array::uniform3(-1e3..1e3_f64),
            prop::array::uniform3(-400.0..400.0_f64),
            0.01..179.0_f64,
            prop::array::uniform3(0.0..1e3_f64),
        ), TOGETHER),
    ) {
        let written = |([x, y, z], [a, b, c], fovy, [r, g, l]): ([f64; 3], [f64; 3], f64, [f64; 3])| {
            let beside = format!(
                "<camera eye='{x} {y} 1e4' at='{y} {z} 0' fovy='{fovy}'/><light type='directional' \
                 direction='{x} {y} 1' colour='{r} {g} 1' intensity='{l}'/><light type='point' \
                 position='{z} {x} {y}' colour='{l} {r} {g}'/>"
            );
            let inside = format!(
                "<transform rotate='{a} {b} {c}' translate='{x} {y} {z}'/><motion type='rotation' axis='{a} {b} {c}' \
                 degreesPerFrame='{a}'/><material diffuse='{r}' specular='{g}'/>"
            );
            Dir::new(scene(&beside, &inside))
        };
        all_come_back(&all.into_iter().map(written).collect::<Vec<_>>());
    }
}

/// A camera's animation replaces eye, at and up: it sits at the node, looks along its -z, and a scale changes nothing.
/// The first in the scene file, also where it is the camera's, which is read last.
#[test]
fn the_first_animation_gives_the_frame_rate() {
    let camera = "<camera><animation>pal.anim</animation></camera>";
    let object = "<object><pointModel>m.ply</pointModel><animation>a.anim</animation></object>";
    for (parts, rate) in [([camera, object], 25.0), ([object, camera], 24.0)] {
        let dir = Dir::new(format!("<scene>{}</scene>", parts.concat()));
        dir.add("pal.anim", ANIM.replace("timeUnit film", "timeUnit pal"));
        assert_eq!(dir.load().unwrap_or_else(|e| panic!("{}", dir.words(e))).scene.frames.rate, rate);
    }
}

#[test]
fn an_animated_camera_is_rigid() {
    let curve = |attribute: &str, output: &str, value: f64| {
        format!(
            "anim {0}.{0}{1} {0}{1} cam 0 1 0;\nanimData {{\n input time;\n output {output};\n weighted 0;\n keys \
             {{\n  1 {value} linear linear 1 1 0;\n  9 {value} linear linear 1 1 0;\n }}\n}}\n",
            &attribute[..attribute.len() - 1],
            &attribute[attribute.len() - 1..],
        )
    };
    let anim = format!(
        "animVersion 1.1;\ntimeUnit film;\nlinearUnit cm;\nangularUnit deg;\n{}{}{}",
        curve("translateX", "linear", 5.0),
        curve("rotateY", "angular", 90.0),
        curve("scaleZ", "unitless", 3.0),
    );
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("m.ply"), MODEL).unwrap();
    fs::write(dir.path().join("cam.anim"), anim).unwrap();
    let path = dir.path().join("s.xml");
    let scene = "<scene><camera><animation>cam.anim</animation></camera><object><pointModel>m.ply</pointModel></object>\
                 </scene>";
    fs::write(&path, scene).unwrap();
    let scene = load(&path, &SceneLoadOptions::default()).unwrap().scene;
    let camera_from_world = splatblur::scene::pose::camera_from_world(&scene, 4.0);
    // Turned by 90 degrees about y, -z looks along -x; a point 2 ahead and 1 above the eye at (5, 0, 0).
    let p = camera_from_world.transform_point3(DVec3::new(3.0, 1.0, 0.0));
    assert!((p - DVec3::new(0.0, 1.0, -2.0)).length() < 1e-12, "{p}");
}

#[test]
fn american_spellings_are_taken() {
    let british = "<scene><light type='ambient' colour='0.1 0.2 0.3'/><object><sphere radius='1' colour='1 0 0'/>\
                   <motion type='rotation' axis='0 1 0' degreesPerFrame='3' centre='1 2 3'/></object></scene>";
    let american = british.replace("colour", "color").replace("centre", "center");
    assert_eq!(to_xml(&loaded(american).scene, Path::new("")), to_xml(&loaded(british).scene, Path::new("")));
}

#[test]
fn an_ideal_sphere_takes_the_place_of_a_model() {
    let text =
        "<scene><object><sphere radius='2.5' colour='0.1 0.2 0.3'/><transform translate='1 2 3'/></object></scene>";
    let LoadedScene { scene, .. } = loaded(text);
    let object = &scene.objects[0];
    let Shape::Sphere { sphere, .. } = object.shape else { panic!("no sphere") };
    assert_eq!((sphere.radius, sphere.colour.to_array()), (2.5, [0.1, 0.2, 0.3]));
    assert_eq!(object.shape.elements(), 1);
    assert_eq!(object.shape.bounds().size(), DVec3::splat(5.0));
    let again = loaded(to_xml(&scene, Path::new(""))).scene;
    let Shape::Sphere { sphere: same, .. } = again.objects[0].shape else { panic!("no sphere") };
    assert_eq!(same, sphere);
    assert_eq!(to_xml(&again, Path::new("")), to_xml(&scene, Path::new("")));
    let mut cpu = splatblur::backend::cpu::Cpu::default();
    let mode: splatblur::options::BlurMode = "volumetric:2".parse().unwrap();
    let options = splatblur::options::RenderOptions { quality: mode.into(), ..Default::default() };
    let error = splatblur::renderer::render_frame(&mut cpu, &scene, 0, &options).unwrap_err();
    assert_eq!(
        error.to_string(),
        "object `object1` has spheres, which mode `volumetric` cannot show: take `supersample`, `bucket` or `auto`"
    );
}
