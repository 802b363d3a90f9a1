//! A camera with keys, on both backends, beside the reference.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use splatblur::backend::Backend;
use splatblur::compare::{self, Metric};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;

use crate::shadows::{on_both, samples};

on_both!(a_flight_blurs_as_in_the_reference);

fn scene() -> Scene {
    let text = r#"<scene>
        <image width="96" height="72"/><frames first="0" last="20" rate="24"/><shutter open="-0.5" close="0.5"/>
        <camera at="0 0 0" speed="constant" easeIn="3">
          <key frame="0" eye="-2 0.5 3" fovy="50"/><key frame="8" eye="0 1.5 3.5"/>
          <key frame="20" eye="3 0.2 1" fovy="35"/>
        </camera>
        <light type="ambient" intensity="0.4"/><light type="directional" direction="-1 -2 -1" shadows="false"/>
        <object><sphere radius="0.6" colour="0.9 0.3 0.1"/></object>
        <object><sphere radius="0.4" colour="0.1 0.7 0.3"/><transform translate="0.8 0.2 -0.5"/></object>
        <object><sphere radius="0.3" colour="0.2 0.3 0.9"/><transform translate="-0.7 -0.2 0.4"/></object>
        </scene>"#;
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("flight.xml");
    std::fs::write(&path, text).unwrap();
    Scene::load(&path).unwrap()
}

fn a_flight_blurs_as_in_the_reference(on: &mut dyn Backend) {
    let scene = scene();
    let traced = |frame: i64| {
        let options = ReferenceOptions { samples: 512, ..ReferenceOptions::default() };
        reference::render(&scene, frame, &options, None, &|_| ()).unwrap().picture
    };
    for frame in [1, 11] {
        let shown = render_frame(on, &scene, frame, &samples(128)).unwrap().picture;
        let flip = |picture| compare::compare(&shown, picture, &[Metric::Flip]).unwrap()[0];
        let (same, other) = (flip(&traced(frame)), flip(&traced(frame + 1)));
        println!("frame {frame}: FLIP {same:.4}, of the next frame {other:.4}");
        // Measured on both backends: .0010 and .0026, of the next frame .043 and .16.
        assert!(same < 0.006 && other > 0.03, "frame {frame}: {same}, {other}");
    }
}
