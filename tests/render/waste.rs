//! What bounds of splats waste, in every scene that ships: the pixels that passes look at, over those that splats
//! cover. Counts are exact where times are not.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::collections::BTreeSet;

use splatblur::backend::{Stats, Waste};
use splatblur::options::{BlurMode, Detail, RenderOptions};
use splatblur::{Device, Renderer, Scene};

type Row = (&'static str, i64, [f64; 3]);

/// Scene, frame, and the waste of passes `visibility`, `attribute` and `composite` as it was seen, rounded up; 0 where
/// a pass has nothing. A splat that is tight in its bounds has 4 / pi, a needle across them far more.
///
/// `propeller` is above 4: it turns with the read-out of its shutter, so that rows see its kernels sheared to needles
/// across their bounds. Without the read-out it has 1.36. `static` shows a capture as surfels, many of them needles.
#[rustfmt::skip]
const SEEN: [Row; 21] = [
    ("blinker",                    3,  [1.32, 1.31, 0.0]),
    ("blinker_fence",              0,  [1.32, 1.31, 0.0]),
    ("bottle",                     6,  [1.42, 1.30, 0.0]),
    ("bounce",                     13, [1.35, 1.34, 0.0]),
    ("checkerboard",               12, [1.34, 1.36, 0.0]),
    ("crossing",                   12, [1.44, 1.36, 0.0]),
    ("diagonal",                   13, [1.48, 1.36, 0.0]),
    ("glass",                      5,  [1.52, 1.44, 0.0]),
    ("guitar_ball",                4,  [1.53, 1.31, 1.99]),
    ("guitar_flight",              6,  [0.0, 0.0, 2.11]),
    ("guitars",                    4,  [0.0, 0.0, 1.86]),
    ("mirror_ball",                13, [1.52, 1.43, 0.0]),
    ("propeller",                  2,  [5.23, 3.41, 0.0]),
    ("smoke",                      5,  [1.53, 1.33, 1.28]),
    ("spin",                       5,  [1.44, 1.38, 0.0]),
    ("splash",                     9,  [1.38, 1.38, 0.0]),
    ("static",                     0,  [2.50, 2.11, 0.0]),
    ("swarm",                      2,  [1.54, 1.52, 0.0]),
    ("three_objects",              20, [1.37, 1.34, 0.0]),
    ("toward_camera_and_sideways", 20, [1.46, 1.35, 0.0]),
    ("truck",                      8,  [1.39, 1.35, 0.0]),
];

#[test]
fn every_shipped_scene_has_a_row() {
    let shipped: BTreeSet<String> = std::fs::read_dir("scenes")
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "xml"))
        .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    let known: BTreeSet<String> = SEEN.iter().map(|(name, ..)| (*name).to_owned()).collect();
    assert_eq!(shipped, known, "a scene has no row");
}

fn are_tight(rows: impl Iterator<Item = Row>) {
    let quality = BlurMode::Still { pixel_samples: 1 }.into();
    let options = RenderOptions { quality, detail: Detail::Full, ..RenderOptions::default() };
    for (name, frame, seen) in rows {
        let scene = Scene::load(format!("scenes/{name}.xml")).unwrap();
        let mut renderer = Renderer::open(Device::Cpu).unwrap();
        renderer.count_waste();
        let Stats { waste, .. } = renderer.render(&scene, frame, &options).unwrap().stats;
        let Waste { visibility, attribute, composite } = waste;
        let found = [visibility, attribute, composite].map(|pixels| pixels.waste().unwrap_or_default());
        println!("{name} {found:.2?}");
        for (found, seen) in found.into_iter().zip(seen) {
            assert!(found <= seen && (found > 0.0) == (seen > 0.0), "{name}: {found:.3} where {seen} was seen");
        }
    }
}

/// Some that take little: surfels, those that turn with a read-out, points of a sequence, and a capture.
#[test]
fn bounds_of_some_shipped_scenes_are_tight() {
    are_tight(SEEN.into_iter().filter(|(name, ..)| ["crossing", "propeller", "swarm", "guitar_ball"].contains(name)));
}

#[test]
#[ignore = "deep: whole pictures"]
fn bounds_of_shipped_scenes_are_tight() {
    are_tight(SEEN.into_iter());
}

/// Nobody pays for counts that nobody asks for.
#[test]
fn waste_is_counted_where_it_is_asked_for() {
    let scene = Scene::load("scenes/blinker_fence.xml").unwrap();
    let options = RenderOptions { quality: BlurMode::Still { pixel_samples: 1 }.into(), ..RenderOptions::default() };
    let rendered = Renderer::open(Device::Cpu).unwrap().render(&scene, 0, &options).unwrap();
    assert_eq!(rendered.stats.waste, Waste::default());
}
