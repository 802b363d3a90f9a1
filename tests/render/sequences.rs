//! Sequences of point files against one model on the same paths, and against closed forms.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::fs;
use std::path::Path;

use glam::{DVec3, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::film::{Aov, Picture};
use splatblur::model::{Surfels, VelocityUnit, write_bin, write_ply};
use splatblur::options::{BlurMode, Look, PixelFilter, Prefilter, RenderOptions, Shading};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::{Device, Renderer, render_frame};
use splatblur::scene::{Scene, Unseen, why_unseen};
use tempfile::TempDir;

use crate::support::{Random, object, rms, round_surfels, sphere};

const HEAD: &str = "<image width='120' height='90'/><frames rate='2'/><shutter open='-0.5' close='0.5'/>\n\
     <camera eye='0 0 5' at='0 0 0'/>";

/// The points of a ball that flies apart, at frame 0.
fn ball() -> Surfels {
    let mut random = Random(11);
    let mut model = sphere(5000);
    model.velocity_unit = VelocityUnit::Frame;
    for i in 0..model.len() {
        let out = model.position[i].as_dvec3();
        model.velocity.push((out * random.within(0.0, 0.1) + DVec3::new(0.1, 0.0, 0.0)).as_vec3());
        model.acceleration.push((DVec3::NEG_Y * random.within(0.0, 0.08)).as_vec3());
    }
    model
}

/// The model at frame `t`: p + v t + a t^2/2, with the velocity v + a t.
fn at(model: &Surfels, t: f32) -> Surfels {
    let mut model = model.clone();
    for i in 0..model.len() {
        let (v, a) = (model.velocity[i], model.acceleration[i]);
        model.position[i] += v * t + a * (0.5 * t * t);
        model.velocity[i] = v + a * t;
    }
    model
}

/// Some points of a model, in this order.
fn picked(model: &Surfels, order: &[usize]) -> Surfels {
    fn pick<T: Copy>(column: &[T], order: &[usize]) -> Vec<T> {
        order.iter().filter_map(|&i| column.get(i).copied()).collect()
    }
    Surfels {
        position: pick(&model.position, order),
        axis_u: pick(&model.axis_u, order),
        axis_v: pick(&model.axis_v, order),
        normal: pick(&model.normal, order),
        colour: pick(&model.colour, order),
        velocity: pick(&model.velocity, order),
        acceleration: pick(&model.acceleration, order),
        id: pick(&model.id, order),
        ..model.clone()
    }
}

/// All points of a model in another order.
fn shuffled(model: &Surfels, seed: u64) -> Surfels {
    let mut random = Random(seed);
    let mut order: Vec<usize> = (0..model.len()).collect();
    (1..order.len()).rev().for_each(|i| order.swap(i, (random.next() * (i + 1) as f64) as usize));
    picked(model, &order)
}

/// A scene of the files `f.1.ply` on, in a directory of its own.
fn scene_of(files: &[Surfels], attributes: &str) -> (TempDir, Scene) {
    let dir = tempfile::tempdir().unwrap();
    for (number, file) in (1..).zip(files) {
        write_ply(&dir.path().join(format!("f.{number}.ply")), file).unwrap();
    }
    let last = files.len();
    let object = format!("<object><pointModel sequence='f.%d.ply' first='1' last='{last}' {attributes}/></object>");
    // What is told here is motion, to the last bits: the default lights, without shadows.
    let lights = "<light type='directional' intensity='0.9' shadows='false'/><light type='ambient' intensity='0.3'/>";
    fs::write(dir.path().join("s.xml"), format!("<scene>{HEAD}{lights}{object}</scene>")).unwrap();
    let scene = Scene::load(dir.path().join("s.xml")).unwrap();
    (dir, scene)
}

fn options(mode: &str, prefilter: Prefilter) -> RenderOptions {
    RenderOptions { quality: mode.parse::<BlurMode>().unwrap().into(), prefilter, ..RenderOptions::default() }
}

fn render(scene: &Scene, frame: i64, options: &RenderOptions) -> Picture {
    render_frame(&mut Cpu::default(), scene, frame, options).unwrap().picture
}

/// The same motion by identity in shuffled files, by row, and by velocity alone: cubic curves between the files are
/// exact for accelerations that stay the same, and velocities alone err by a quarter of a frame.
// Not deep: the only test of all that sequences may say of motion.
#[test]
fn one_motion_in_three_ways_is_one_picture() {
    let model = ball();
    let mut truth = scene_of(std::slice::from_ref(&model), "").1;
    truth.objects[0] = object(model.clone());
    truth.objects[0].shape.points_mut().unwrap().at = Some(0.0);
    let with_ids = Surfels { id: (0..model.len() as i64).map(|i| 3 * i - 100).collect(), ..model.clone() };
    let times = [1.0, 2.0, 3.0, 4.0];
    let by_id: Vec<_> = times.iter().map(|&t| shuffled(&at(&with_ids, t), 5 + t as u64)).collect();
    let by_row: Vec<_> = times.iter().map(|&t| at(&model, t)).collect();
    let by_velocity: Vec<_> = times.iter().map(|&t| shuffled(&at(&model, t), 50 + t as u64)).collect();
    let still = |files: &[Surfels]| {
        files
            .iter()
            .map(|f| Surfels { velocity: Vec::new(), acceleration: Vec::new(), ..f.clone() })
            .collect::<Vec<_>>()
    };
    for (mode, prefilter) in [
        ("supersample:16", Prefilter::None),
        ("volumetric:6+pixel-samples=6", Prefilter::Ewa),
        ("auto", Prefilter::Ewa),
    ] {
        let options = match mode {
            "auto" => RenderOptions::default(),
            mode => options(mode, prefilter),
        };
        // Kernels in motion, and the samples of mode auto, are cut where one file takes over from another. Filtered
        // kernels are normalised by how dense a file's own points lie, which shows most at one position (.009).
        let exact = if mode.starts_with("super") { 1e-5 } else { 5e-3 };
        for frame in [1, 2, 3] {
            let want = render(&truth, frame, &options);
            let blank = rms(&want, &Picture { rgba: vec![[0.0; 4]; want.rgba.len()], ..want.clone() });
            for (name, files, limit) in [
                ("id", &by_id, exact),
                ("row", &by_row, exact),
                ("velocity", &by_velocity, exact),
                ("row without velocities", &still(&by_row), 0.02),
                ("id without velocities", &still(&by_id), 0.02),
            ] {
                let (_dir, scene) = scene_of(files, "");
                let error = rms(&render(&scene, frame, &options), &want);
                println!("{mode} frame {frame} {name}: {error:.5} of {blank:.3}");
                assert!(error < limit, "{mode} frame {frame} {name}: {error}");
            }
        }
    }
}

/// A plate that fills the picture.
fn plate(colour: Vec3, id: i64) -> Surfels {
    let mut plate = round_surfels([(DVec3::ZERO, DVec3::Z, 40.0, colour)]);
    plate.id = vec![id];
    plate
}

fn middle(picture: &Picture) -> [f32; 4] {
    picture.rgba[(picture.height / 2 * picture.width + picture.width / 2) as usize]
}

/// A point that only one of two files has is born or dies in the middle between them, so alpha is its share of the
/// time.
#[test]
fn births_and_deaths_are_in_the_middle_between_files() {
    let empty = Surfels::default();
    // Alone in file 2 of 4; the shutter of frame 2 is 1.2 to 2.8, that of frame 3 is 2.2 to 3.8.
    let files = [empty.clone(), plate(Vec3::ONE, 7), empty.clone(), plate(Vec3::ONE, 8)];
    let (dir, mut scene) = scene_of(&files, "");
    (scene.shutter.open, scene.shutter.close) = (-0.8, 0.8);
    scene.image.transparent = true;
    for (mode, prefilter) in [("supersample:64", Prefilter::Ewa), ("volumetric:8", Prefilter::None)] {
        let options = options(mode, prefilter);
        for (frame, share) in [(2, 1.0 / 1.6), (3, 0.6 / 1.6), (1, 0.3 / 1.6)] {
            let alpha = f64::from(middle(&render(&scene, frame, &options))[3]);
            assert!((alpha - share).abs() < 0.02, "{mode} frame {frame}: {alpha} for {share}");
            let traced = ReferenceOptions { samples: 256, ..ReferenceOptions::default() };
            let traced = reference::render(&scene, frame, &traced, None, &|_| ()).unwrap().picture;
            let alpha = f64::from(middle(&traced)[3]);
            assert!((alpha - share).abs() < 0.01, "reference, frame {frame}: {alpha} for {share}");
        }
    }
    // A file without any byte is a failed write.
    fs::write(dir.path().join("f.3.ply"), "").unwrap();
    let e = anyhow::Error::from(Scene::load(dir.path().join("s.xml")).map(|_| ()).unwrap_err());
    assert!(format!("{e:#}").contains("f.3.ply is empty (0 bytes)"), "{e:#}");
}

/// `offset` and `rate` say when a file is shown; the scene's frames are those of its files.
#[test]
fn files_are_shown_at_their_frames() {
    let files: Vec<Surfels> = (0..5).map(|i| plate(Vec3::splat(0.1 + 0.2 * i as f32), i)).collect();
    let still = options("still:1", Prefilter::None);
    for (attributes, frames) in
        [("", [1, 5]), ("offset='10'", [11, 15]), ("rate='0.5'", [2, 10]), ("rate='2' offset='-1'", [0, 1])]
    {
        let scene = scene_of(&files, attributes).1;
        assert_eq!([scene.frames.first, scene.frames.last], frames, "{attributes}");
        let unseen = why_unseen(&scene, &scene.objects[0], (frames[1] + 9).into(), false);
        assert_eq!(unseen, Unseen::NoFile, "{attributes}");
        assert_ne!(why_unseen(&scene, &scene.objects[0], frames[1].into(), false), Unseen::NoFile, "{attributes}");
    }
    for (attributes, frame, want) in [
        ("", 3, 0.5),
        ("offset='10'", 14, 0.7),
        ("offset='10'", 17, 0.0),
        ("rate='0.5'", 8, 0.7),
        ("rate='2' offset='-1'", 1, 0.7),
        ("rate='2' offset='-1'", 0, 0.3),
    ] {
        let (_dir, scene) = scene_of(&files, attributes);
        let shown = middle(&render(&scene, frame, &still))[0];
        let lit = middle(&render(&scene_of(&[plate(Vec3::ONE, 1)], "").1, 1, &still))[0];
        assert!((shown - want * lit).abs() < 1e-5, "{attributes} frame {frame}: {shown} for {want}");
    }
}

/// Frames in any order, one by one or as a sequence, from PLY or `.bin`, on both backends: one picture.
#[test]
fn order_and_format_change_nothing() {
    let model = ball();
    let files: Vec<Surfels> = [1.0, 2.0, 3.0, 4.0].iter().map(|&t| at(&model, t)).collect();
    let (dir, scene) = scene_of(&files, "");
    let options = RenderOptions {
        look: Look { aovs: vec![Aov::Alpha, Aov::Object], ..options("supersample:6", Prefilter::Ewa).look },
        ..options("supersample:6", Prefilter::Ewa)
    };
    let up: Vec<Picture> = [1, 2, 3, 4].map(|frame| render(&scene, frame, &options)).into();
    let down: Vec<Picture> = [4, 3, 2, 1].map(|frame| render(&scene, frame, &options)).into();
    assert!(up.iter().eq(down.iter().rev()));
    let mut renderer = Renderer::open(Device::Cpu).unwrap();
    let plain = RenderOptions { look: Look { aovs: Vec::new(), ..options.look.clone() }, ..options.clone() };
    let all: Vec<_> = renderer.render_sequence(&scene, 1..=4, &plain).map(|r| r.unwrap().1.picture).collect();
    assert!(all.iter().zip(&up).all(|(a, b)| a.rgba == b.rgba));
    // One object, however many parts it has in a frame.
    let layer = up[1].layers.iter().find(|layer| layer.aov == Aov::Object).unwrap();
    assert_eq!(layer.names, ["object1"]);
    assert!(layer.planes[0].iter().all(|&index| index == 0.0 || index == 1.0));
    assert!(layer.planes[0].contains(&1.0));
    for (number, file) in (1..).zip(&files) {
        write_bin(&dir.path().join(format!("f.{number}.bin")), file).unwrap();
    }
    let text = fs::read_to_string(dir.path().join("s.xml")).unwrap().replace(".ply", ".bin");
    fs::write(dir.path().join("b.xml"), text).unwrap();
    let of_bin = render(&Scene::load(dir.path().join("b.xml")).unwrap(), 2, &plain);
    assert!(rms(&of_bin, &up[1]) < 1e-3);
    #[cfg(feature = "gpu")]
    if let Some(mut gpu) = crate::support::gpu::gpu_or_skip("order_and_format_change_nothing") {
        let on_gpu = |frame| render_frame(&mut gpu, &scene, frame, &plain).unwrap().picture;
        let pictures: Vec<Picture> = [1, 2, 4, 3].map(on_gpu).into();
        for (picture, frame) in pictures.iter().zip([1_usize, 2, 4, 3]) {
            assert!(rms(picture, &up[frame - 1]) < 1e-4);
        }
    }
}

/// Splats and rays agree, with points that are born, die and bounce.
#[test]
fn the_reference_shows_the_same_sequence() {
    let model = ball();
    let mut files: Vec<Surfels> = [1.0, 2.0, 3.0].iter().map(|&t| at(&model, t)).collect();
    for (file, from) in files.iter_mut().zip([0_usize, 300, 900]) {
        file.id = (0..file.len() as i64).collect();
        let order: Vec<usize> = (from..file.len()).collect();
        *file = shuffled(&picked(file, &order), 3);
    }
    let (_dir, mut scene) = scene_of(&files, "");
    scene.objects[0].shape.surface_mut().unwrap().two_sided = true;
    let traced = ReferenceOptions {
        samples: 512,
        look: Look { filter: PixelFilter::Box, ..Look::default() },
        ..ReferenceOptions::default()
    };
    let truth = reference::render(&scene, 2, &traced, None, &|_| ()).unwrap().picture;
    let splatted = RenderOptions {
        look: Look { shading: Shading::Phong, ..options("supersample:64", Prefilter::None).look },
        ..options("supersample:64", Prefilter::None)
    };
    let error = rms(&render(&scene, 2, &splatted), &truth);
    println!("{error:.4}");
    assert!(error < 0.012, "{error}");
}

#[test]
fn what_is_wrong_with_a_sequence_is_said() {
    let words = |dir: &Path, e: String| e.replace(&format!("{}/", dir.display()), "");
    let model = Surfels { velocity: Vec::new(), acceleration: Vec::new(), ..ball() };
    let load = |dir: &TempDir| match Scene::load(dir.path().join("s.xml")) {
        Err(e) => words(dir.path(), format!("{:#}", anyhow::Error::from(e))),
        Ok(_) => "loaded".to_owned(),
    };
    let rendered = |dir: &TempDir, scene: &Scene, frame: i64| match render_frame(
        &mut Cpu::default(),
        scene,
        frame,
        &options("supersample:2", Prefilter::None),
    ) {
        Err(e) => words(dir.path(), format!("{:#}", anyhow::Error::from(e))),
        Ok(_) => "rendered".to_owned(),
    };
    let files = || vec![model.clone(); 4];
    // A gap, and a first file that is not there.
    let (dir, _) = scene_of(&files(), "");
    fs::remove_file(dir.path().join("f.3.ply")).unwrap();
    let e = load(&dir);
    assert!(e.ends_with("no file f.3.ply, expected the numbers 1 to 4 of the sequence without a gap"), "{e}");
    fs::remove_file(dir.path().join("f.1.ply")).unwrap();
    assert!(load(&dir).contains("no file `f.1.ply`"), "{}", load(&dir));
    // Other numbers of points.
    let mut unlike = files();
    unlike[2] = picked(&model, &(0..4999).collect::<Vec<_>>());
    let (dir, scene) = scene_of(&unlike, "");
    assert_eq!(
        rendered(&dir, &scene, 2),
        "model f.2.ply has 5000 points and f.3.ply beside it 4999, expected as many, or velocities, or an `id` for \
         each point"
    );
    // Identities. The first two files are read when the scene is loaded, the third when it is shown.
    let mut twice = files();
    twice[2].id = (0..5000).map(|i| i / 2 * 2).collect();
    let (dir, scene) = scene_of(&twice, "");
    assert!(rendered(&dir, &scene, 3).starts_with("model f.3.ply has two points with the `id` "));
    // A file that is cut short, and one with a velocity that is none.
    let (dir, scene) = scene_of(&files(), "");
    let bytes = fs::read(dir.path().join("f.3.ply")).unwrap();
    fs::write(dir.path().join("f.3.ply"), &bytes[..bytes.len() / 2]).unwrap();
    let e = rendered(&dir, &scene, 3);
    assert!(e.starts_with("model f.3.ply: ") && e.contains("is the file cut short?"), "{e}");
    let mut odd = ball();
    odd.velocity[17].y = f32::NAN;
    write_ply(&dir.path().join("f.3.ply"), &odd).unwrap();
    let e = rendered(&dir, &scene, 3);
    assert!(e.contains("found NaN, expected a finite number up to 1e18 (`vy` of vertex 17 of 5000)"), "{e}");
    // A shutter that would read everything.
    let (dir, mut scene) = scene_of(&files(), "rate='1000'");
    scene.shutter.close = 1e3;
    assert_eq!(rendered(&dir, &scene, 0), "rendered", "there are 4 files");
    // What the scene file says.
    let said = |attributes: &str, text: &str| {
        let object = format!("<object><pointModel {attributes}>{text}</pointModel></object>");
        fs::write(dir.path().join("s.xml"), format!("<scene>{object}</scene>")).unwrap();
        load(&dir)
    };
    for (attributes, text, want) in [
        (
            "sequence='f.ply' first='1' last='2'",
            "",
            "is \"f.ply\", expected one number such as %d or %04d in the names of files",
        ),
        ("sequence='f.%d.%d.ply' first='1' last='2'", "", "expected one number such as %d or %04d"),
        ("sequence='f.%99999999999d' first='1' last='2'", "", "expected one number such as %d or %04d"),
        ("sequence='f.%d.ply' first='1'", "", "without `last`, expected `first` and `last`"),
        ("sequence='f.%d.ply' first='3' last='2'", "", "`last` is 2, expected from `first`, 3, to 100002"),
        ("sequence='f.%d.ply' first='0' last='100000'", "", "`last` is 100000, expected from `first`, 0, to 99999"),
        ("sequence='f.%d.ply' first='1' last='4' rate='0'", "", "`rate`"),
        ("sequence='f.%d.ply' first='1' last='4'", "f.1.ply", "beside `sequence`, expected one of the two"),
        ("first='1'", "f.1.ply", "`first` is without `sequence`, expected `sequence` and no text, or neither"),
        ("", "", "<pointModel> is empty"),
    ] {
        let e = said(attributes, text);
        assert!(e.contains(want), "{attributes}: {e}");
    }
}

/// Points without identities, of which each file lacks others, are matched by their places: the picture is that of
/// identities.
#[test]
fn nearest_points_are_the_same() {
    let mut random = Random(5);
    let discs = (0..64).map(|i| {
        let place = DVec3::new(f64::from(i % 8) - 3.5, f64::from(i / 8) - 3.5, 0.0) * 0.4;
        (place, DVec3::Z, 0.15, Vec3::new(random.next() as f32, random.next() as f32, 1.0))
    });
    let mut model = round_surfels(discs.collect::<Vec<_>>());
    model.velocity_unit = VelocityUnit::Frame;
    model.id = (0..64).collect();
    // Three eighths of the distance between them in a frame, and a little of its own for each.
    for _ in 0..64 {
        model.velocity.push(Vec3::new(0.15, 0.0, 0.01 * random.next() as f32));
        model.acceleration.push(Vec3::ZERO);
    }
    let lacking = |t: i64| -> Surfels {
        let kept: Vec<usize> = (0..64).filter(|i| i % (6 + t as usize) != t as usize).collect();
        Surfels {
            velocity: Vec::new(),
            acceleration: Vec::new(),
            ..shuffled(&picked(&at(&model, t as f32), &kept), 9 + t as u64)
        }
    };
    let by_id: Vec<Surfels> = [1, 2, 3].map(lacking).into();
    let without: Vec<Surfels> = by_id.iter().map(|file| Surfels { id: Vec::new(), ..file.clone() }).collect();
    let options = options("supersample:8", Prefilter::None);
    let (_a, truth) = scene_of(&by_id, "");
    let (_b, matched) = scene_of(&without, "match='0.19'");
    for frame in [1, 2, 3] {
        assert_eq!(render(&matched, frame, &options).rgba, render(&truth, frame, &options).rgba, "frame {frame}");
    }
    let (of_ids, _) = scene_of(&by_id, "match='0.19'");
    let notes =
        splatblur::scene_file::load(&of_ids.path().join("s.xml"), &splatblur::scene_file::SceneLoadOptions::default())
            .unwrap()
            .notes;
    assert!(notes.iter().any(|note| note.ends_with("points are matched by their `id`")), "{notes:?}");
    // What is farther apart is not the same: all are born and die at rest.
    let (_c, apart) = scene_of(&without, "match='0.1'");
    let moves = rms(&render(&truth, 2, &options), &render(&apart, 2, &options));
    assert!(moves > 0.01, "{moves}");
    // Without it nothing says how they move.
    let (_d, refused) = scene_of(&without, "");
    assert!(render_frame(&mut Cpu::default(), &refused, 2, &options).is_err());
}
