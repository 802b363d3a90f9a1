//! Cameras that fly along keys: against a camera that moves by formula, and against the reference.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::fs;

use splatblur::backend::cpu::Cpu;
use splatblur::film::Picture;
use splatblur::options::{BlurMode, Look, PixelFilter, Prefilter, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;
use splatblur::scene_file::{SceneLoadOptions, load};

use crate::support::rms;

/// A still ball and one that moves, seen by this camera through a shutter that is open for a whole frame.
fn scene(camera: &str) -> Scene {
    let dir = tempfile::tempdir().unwrap();
    let text = format!(
        "<scene><image width=\"96\" height=\"72\" background=\"0.1 0.1 0.2\"/><shutter open=\"-0.5\" close=\"0.5\"/>\
         {camera}<light type=\"directional\" direction=\"-1 -1 -1\" shadows=\"false\"/>\
         <light type=\"ambient\" intensity=\"0.3\"/>\
         <object name=\"still\"><sphere radius=\"1\" colour=\"0.8 0.3 0.2\"/></object>\
         <object name=\"ball\"><sphere radius=\"0.5\" colour=\"0.2 0.7 0.3\"/><transform translate=\"1.5 0.4 1\"/>\
         <motion type=\"linear\" velocity=\"-0.3 0.1 0\"/></object></scene>"
    );
    let path = dir.path().join("s.xml");
    fs::write(&path, text).unwrap();
    load(&path, &SceneLoadOptions::default()).unwrap_or_else(|e| panic!("{e}")).scene
}

fn rendered(scene: &Scene, frame: i64) -> Picture {
    let options = RenderOptions {
        quality: "supersample:16".parse::<BlurMode>().unwrap().into(),
        prefilter: Prefilter::None,
        ..RenderOptions::default()
    };
    render_frame(&mut Cpu::default(), scene, frame, &options).unwrap().picture
}

fn traced(scene: &Scene, frame: i64) -> Picture {
    let look = Look { filter: PixelFilter::Box, ..Look::default() };
    let options = ReferenceOptions { samples: 64, look, ..ReferenceOptions::default() };
    reference::render(scene, frame, &options, None, &|_| ()).unwrap().picture
}

/// Two keys whose eye and aim move alike are a linear motion, also within the exposure.
#[test]
fn a_straight_flight_is_a_linear_motion() {
    let keys =
        "<key frame=\"0\" eye=\"-1 0.5 7\" at=\"-1 0.2 0\"/><key frame=\"8\" eye=\"1.4 0.9 6.2\" at=\"1.4 0.6 -0.8\"/>";
    let keyed = scene(&format!("<camera>{keys}</camera>"));
    let moved =
        scene("<camera eye=\"-1 0.5 7\" at=\"-1 0.2 0\"><motion type=\"linear\" velocity=\"0.3 0.05 -0.1\"/></camera>");
    let error = rms(&rendered(&keyed, 3), &rendered(&moved, 3));
    let other = rms(&rendered(&keyed, 3), &rendered(&moved, 4));
    println!("{error:e}, the next frame {other:e}");
    // Found: 0; the next frame .11.
    assert!(error < 1e-4 && other > 0.02, "{error} {other}");
    let error = rms(&traced(&keyed, 3), &traced(&moved, 3));
    println!("reference: {error:e}");
    assert!(error < 1e-4, "{error}");
}

/// A frame of a flight with zoom, target and easing: splatted and traced alike, and blurred.
#[test]
fn a_flight_is_splatted_as_it_is_traced() {
    let keys = "<key frame=\"0\" eye=\"-3 0.5 7\" fovy=\"40\"/><key frame=\"5\" eye=\"0 2 6\" fovy=\"30\"/>\
         <key frame=\"10\" eye=\"4 1 4\" fovy=\"50\"/>";
    let scene = scene(&format!("<camera atObject=\"ball\" speed=\"constant\" easeIn=\"3\">{keys}</camera>"));
    let (splatted, traced) = (rendered(&scene, 7), traced(&scene, 7));
    let error = rms(&splatted, &traced);
    let still = render_frame(
        &mut Cpu::default(),
        &scene,
        7,
        &RenderOptions { quality: "still:4".parse::<BlurMode>().unwrap().into(), ..RenderOptions::default() },
    );
    let blur = rms(&splatted, &still.unwrap().picture);
    println!("{error:e} against the reference, {blur:e} against no blur");
    // Found: see below.
    assert!(error < 0.03 && blur > 2.0 * error, "{error} {blur}");
}
