//! Points that are coloured by a column of numbers: the colours are those of the map, whatever the light is.

#![allow(clippy::unwrap_used, reason = "tests may stop")]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use glam::Vec3;
use splatblur::Scene;
use splatblur::backend::Backend;
use splatblur::options::{BlurMode, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;

use crate::shadows::on_both;

on_both!(light_does_not_change_the_colours, one_range_serves_a_sequence);

/// Colours of turbo at 0, .2, .4, .6, .8 and 1, as Matplotlib has them.
const TURBO: [[u8; 3]; 6] = [[48, 18, 59], [62, 155, 254], [70, 248, 132], [225, 221, 55], [240, 91, 18], [122, 4, 3]];

/// sRGB by its definition (IEC 61966-2-1).
fn linear(code: u8) -> f32 {
    let code = f64::from(code) / 255.0;
    if code <= 0.04045 { (code / 12.92) as f32 } else { ((code + 0.055) / 1.055).powf(2.4) as f32 }
}

/// Six points side by side, 1 apart, with `heat` from 10 to 20, and discs or balls of radius .4.
fn table(path: &Path, moved: f64) {
    let mut text = "x,y,z,nx,ny,nz,vx,vy,vz,radius,heat,id\n".to_owned();
    for i in 0..6 {
        let x = f64::from(i) - 2.5;
        writeln!(text, "{x},{moved},0,0,0,1,0,0,{},0.4,{},{i}", 2 * i, 10 + 2 * i).unwrap();
    }
    fs::write(path, text).unwrap();
}

/// A pixel has the size of .0625 on the plane of the points.
fn scene(dir: &Path, lights: &str, model: &str) -> Scene {
    let text = format!(
        "<scene><image width=\"96\" height=\"32\"/><camera eye=\"0 0 100\" at=\"0 0 0\" fovy=\"1.145877\"/>\
         {lights}<object>{model}</object></scene>"
    );
    let path = dir.join("s.xml");
    fs::write(&path, text).unwrap();
    Scene::load(path).unwrap()
}

fn middles(pixels: &[[f32; 4]]) -> [Vec3; 6] {
    [0, 1, 2, 3, 4, 5].map(|i| Vec3::from_slice(&pixels[16 * 96 + 8 + 16 * i][..3]))
}

fn are_turbo(found: [Vec3; 6], what: &str) {
    for (i, (got, want)) in found.iter().zip(TURBO).enumerate() {
        let want = Vec3::from(want.map(linear));
        // Matplotlib's colours are rounded to codes, ours are not: half a code of .004 at most.
        assert!((*got - want).abs().max_element() < 0.005, "{what}, point {i}: {got} for {want}");
    }
}

fn light_does_not_change_the_colours(on: &mut dyn Backend) {
    let dir = tempfile::tempdir().unwrap();
    table(&dir.path().join("a.csv"), 0.0);
    let sun = "<light type=\"directional\" direction=\"-1 -1 -1\" intensity=\"3\"/>";
    let ambient = "<light type=\"ambient\" intensity=\"0.3\"/>";
    let dim = "<light type=\"ambient\" intensity=\"0.01\" colour=\"0.5 0.5 0.5\"/>";
    for lights in ["", sun, ambient, &format!("{dim}{sun}{ambient}")] {
        for kind in ["surfels", "spheres"] {
            let model = |by: &str| {
                format!("<pointModel kind=\"{kind}\" colourBy=\"{by}\" colourMap=\"turbo\">a.csv</pointModel>")
            };
            for by in ["heat", "Speed", "x", "id"] {
                let scene = scene(dir.path(), lights, &model(by));
                let options = RenderOptions { quality: BlurMode::supersample(4).into(), ..RenderOptions::default() };
                let picture = render_frame(on, &scene, 0, &options).unwrap().picture;
                are_turbo(middles(&picture.rgba), &format!("{kind} by {by} under {lights:?}"));
            }
            let scene = scene(dir.path(), lights, &model("heat"));
            let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
            let traced = reference::render(&scene, 0, &options, None, &|_| ()).unwrap();
            are_turbo(middles(&traced.picture.rgba), &format!("reference of {kind} under {lights:?}"));
        }
    }
}

/// Three files of one point each, of values 0, 5 and 10: their colours are those of one range.
fn one_range_serves_a_sequence(on: &mut dyn Backend) {
    let dir = tempfile::tempdir().unwrap();
    for i in 0..3 {
        let text = format!("x;y;z;nx;ny;nz;radius;heat;id\n0;0;0;0;0;1;0.4;{};7\n", 5 * i);
        fs::write(dir.path().join(format!("f.{i}.csv")), text).unwrap();
    }
    let model = "<pointModel sequence=\"f.%d.csv\" first=\"0\" last=\"2\" colourBy=\"heat\" colourMap=\"grey\"/>";
    let scene = scene(dir.path(), "", model);
    let range = scene.objects[0].source.options.points.colour_by.as_ref().unwrap().range;
    assert_eq!(range, Some([0.0, 10.0]));
    let options = RenderOptions { quality: BlurMode::supersample(4).into(), ..RenderOptions::default() };
    for (frame, want) in [(0, 0.0), (1, linear(128)), (2, 1.0)] {
        let picture = render_frame(on, &scene, frame, &options).unwrap().picture;
        let got = picture.rgba[16 * 96 + 48][0];
        // The middle of codes is 127.5.
        assert!((got - want).abs() < 0.004, "frame {frame}: {got} for {want}");
    }
    // The scene that is written back says the range.
    let text = splatblur::scene_file::to_xml(&scene, dir.path());
    assert!(text.contains("colourBy=\"heat\" colourMap=\"grey\" range=\"0..10\""), "{text}");
    fs::write(dir.path().join("again.xml"), &text).unwrap();
    let again = Scene::load(dir.path().join("again.xml")).unwrap();
    assert_eq!(splatblur::scene_file::to_xml(&again, dir.path()), text);
}
