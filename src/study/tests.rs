use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec3;

use super::provenance::Provenance;
use super::report::page::page;
use super::*;
use crate::compare::{Comparison, Metric};
use crate::film::{Aov, Picture};
use crate::image::Format;
use crate::model::{LoadOptions, load};
use crate::options::{BlurMode, Look, PixelFilter, Prefilter, RenderOptions};
use crate::reference::ReferenceOptions;
use crate::renderer::{Device, Renderer};
use crate::scene::{Motion, Object, Scene};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/swarm.xml");

/// A shipped scene as a small picture.
fn scene() -> Scene {
    let mut scene = Scene::load(SCENE).unwrap();
    (scene.image.width, scene.image.height) = (24, 18);
    scene
}

/// `opened` counts the backends that were opened.
fn trial(opened: &AtomicU32) -> Trial<'_> {
    trial_of(scene(), opened)
}

fn trial_of(scene: Scene, opened: &AtomicU32) -> Trial<'_> {
    let open = |kind| match kind {
        BackendKind::Cpu => {
            opened.fetch_add(1, Ordering::Relaxed);
            Ok(Opened { renderer: Renderer::open(Device::Cpu)?, description: "the CPU".to_owned() })
        }
        BackendKind::Gpu => Err("no GPU here".into()),
    };
    Trial::new(scene, Path::new(SCENE), RenderOptions::default(), None, Box::new(open))
}

fn contestants(text: &str) -> Vec<Contestant> {
    Contestant::of(&entries(text).unwrap(), &[BackendKind::Cpu]).unwrap()
}

#[test]
fn an_experiment_runs_without_the_command_line() {
    let (directory, gate) = (tempfile::tempdir().unwrap(), Mutex::new(()));
    let store = Store { directory: directory.path(), gate: &gate, fresh: false };
    let mut experiment = Experiment {
        contestants: contestants("supersample:2,reference:16"),
        frames: vec![3.into()],
        reference: 32,
        repeats: 2,
        limits: vec!["flip=0".parse().unwrap()],
    };
    let steps = Mutex::new(Vec::new());
    let tell = |progress: StudyProgress<'_>| {
        if let StudyProgress::At { step, .. } = progress {
            steps.lock().unwrap().push(step);
        }
    };
    let opened = AtomicU32::new(0);
    let (study, pictures) = experiment.run(&mut trial(&opened), &store, &tell).unwrap();
    assert_eq!(experiment.steps(&trial(&opened)), 1 + 3 + 2);
    assert!(steps.lock().unwrap().iter().all(|&step| step < 6));
    let names: Vec<_> = study.sequence.iter().map(report::ModeStudy::name).collect();
    assert_eq!(names, ["supersample:2@cpu", "reference:16@cpu"]);
    assert_eq!((study.frames.len(), pictures.len(), study.over.len()), (1, 1, 2));
    assert_eq!(study.backends, ["the CPU"]);
    assert!(study.over[0].starts_with("frame 3, supersample:2@cpu: flip is "), "{:?}", study.over);
    assert!(page(&study, &pictures).unwrap().contains("supersample:2@cpu"));
    assert_eq!(store.publish(&study, &pictures).unwrap(), directory.path().join("index.html"));

    // A second run takes everything from the store, to the last digit of its times.
    steps.lock().unwrap().clear();
    let (again, _) = experiment.run(&mut trial(&opened), &store, &tell).unwrap();
    assert_eq!(again.json(), study.json());
    assert!(steps.lock().unwrap().is_empty());
    // Another option makes other pictures; a mode that cannot be rendered is named.
    experiment.contestants = contestants("supersample:2@gpu");
    let error = experiment.run(&mut trial(&opened), &store, &tell).unwrap_err();
    assert_eq!(error.to_string(), "frame 3");
    let source = std::error::Error::source(&error).unwrap();
    assert_eq!(source.to_string(), "mode supersample:2@gpu");
    assert_eq!(source.source().unwrap().to_string(), "no GPU here");
}

/// Each mode is compared with the reference of its own pixel filter. A reference that takes part, with that filter, is
/// as near it as its noise is small, and far from the other.
#[test]
fn each_mode_is_judged_by_its_own_pixel_filter() {
    let opened = AtomicU32::new(0);
    let mut trial = trial(&opened);
    let directory = tempfile::tempdir().unwrap();
    let store = Store { directory: directory.path(), gate: &Mutex::new(()), fresh: false };
    let modes = "reference:1024,reference:1024+filter=gaussian:2,still:1+filter=gaussian:2";
    let experiment = Experiment {
        contestants: contestants(modes),
        frames: vec![3.into()],
        reference: 1024,
        repeats: 1,
        limits: Vec::new(),
    };
    assert_eq!(experiment.steps(&trial), 2 + 2 + 2 + 2);
    let (study, pictures) = experiment.run(&mut trial, &store, &|_| ()).unwrap();
    let names: Vec<_> = pictures[0].references.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["reference", "reference+filter=gaussian:2"]);
    let rmse = |i: usize| study.sequence[i].errors.value(Metric::Rmse).unwrap();
    let of = |filter: PixelFilter| trial.judge(1024, filter, 3.into(), &|_| ()).unwrap().picture;
    let apart = Comparison::new(&of(PixelFilter::Box), &of(PixelFilter::Gaussian { sigma: 2.0 }), &[]).unwrap();
    let apart = apart.value(Metric::Rmse).unwrap();
    assert!(rmse(0) < 0.1 * apart && rmse(1) < 0.1 * apart && apart > 0.01, "{} {} {apart}", rmse(0), rmse(1));
    let names: Vec<_> = study.sequence.iter().map(report::ModeStudy::name).collect();
    assert_eq!(names[2], "still:1+filter=gaussian:2@cpu");
}

#[test]
fn a_line_up_has_a_panel_for_each_mode() {
    let opened = AtomicU32::new(0);
    let mut trial = trial(&opened);
    let part = Part::MostDifferent(8, 6);
    let mut line_up =
        LineUp { frame: 3.into(), entries: entries("still:1,auto:0.05").unwrap(), reference: Some(16), part };
    let shots = line_up.run(&mut trial, &|_| ()).unwrap();
    assert_eq!((shots.crop.width, shots.crop.height), (8, 6));
    let panels = line_up.panels(&shots).unwrap();
    let titles: Vec<_> = panels.iter().map(|panel| panel.title.as_str()).collect();
    assert_eq!(titles, ["reference", "still:1", "auto:0.05"]);
    assert!(panels[1].lines[0].starts_with("1 sample, ") && panels[1].lines[1].starts_with("FLIP 0."));
    assert_eq!(opened.load(Ordering::Relaxed), 1);
    line_up.part = Part::Here(sheet::Crop { x: 20, y: 0, width: 8, height: 6 });
    assert!(line_up.run(&mut trial, &|_| ()).unwrap_err().to_string().contains("24 x 18"));
}

/// The same pictures have the same settings; what changes a picture changes them.
#[test]
fn settings_tell_pictures_apart() {
    let opened = AtomicU32::new(0);
    let mut trial = trial(&opened);
    let of = |trial: &mut Trial<'_>, name: &str| trial.settings(contestants(name)[0], 3.into()).unwrap();
    let first = of(&mut trial, "supersample:2");
    assert_eq!(first, of(&mut trial, "supersample:2+interleave=1"));
    let others = ["supersample:3", "supersample:2+interleave=2", "reference:16", "reference:32"];
    for name in others {
        assert_ne!(first, of(&mut trial, name));
    }
    let judge = trial.settings_of_judge(16, PixelFilter::Box).unwrap().of_frame(3).unwrap();
    assert_ne!(judge, of(&mut trial, "reference:16"), "they have other seeds");
    let provenance = Provenance::of(&scene(), Path::new(SCENE)).unwrap();
    let with = |aovs: Vec<Aov>| {
        let options = ReferenceOptions { look: Look { aovs, ..Look::default() }, ..ReferenceOptions::default() };
        provenance.traced(&options, 16, Format::EXR).unwrap().of_frame(3).unwrap()
    };
    assert_ne!(with(Vec::new()), with(vec![Aov::Depth]));
}

/// A ninth of the shutter has a ninth of its motion.
#[test]
fn moments_divide_the_shutter() {
    let opened = AtomicU32::new(0);
    let mut scene = scene();
    let points = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/models/swarm.1.ply");
    let mut object = Object::new(load(Path::new(points), &LoadOptions::default(), &|_, _| {}).unwrap());
    object.motions.push(Motion::Linear { velocity: DVec3::new(0.3, 0.1, 0.0) });
    scene.objects = vec![object];
    let moments = trial_of(scene.clone(), &opened).moments(3.into()).unwrap();
    let options = RenderOptions {
        quality: BlurMode::supersample(1).into(),
        prefilter: Prefilter::Approx,
        look: Look { filter: PixelFilter::Point, aovs: vec![Aov::Velocity], ..Look::default() },
        ..RenderOptions::default()
    };
    let whole = Renderer::open(Device::Cpu).unwrap().render(&scene, 3, &options).unwrap().picture;
    let fastest = |picture: &Picture| {
        let velocity = picture.layers.iter().find(|layer| layer.aov == Aov::Velocity).unwrap();
        velocity.planes.iter().flatten().fold(0.0_f32, |most, v| most.max(v.abs()))
    };
    let (one, all) = (fastest(&moments[moments.len() / 2]), fastest(&whole));
    assert!(moments.len() == 9 && (all / one - 9.0).abs() < 0.1, "{one} pixels of {all}");
}
