//! `--colour-by` and `--legend`: colours of points by a column of numbers.
#![allow(clippy::unwrap_used, reason = "tests may stop")]

use std::fs;
use std::path::Path;

use splatblur::image;
use splatblur::model::ColourMap;

use super::run;

const SMALL: &str = "--size 320x240 --backend cpu --mode supersample:4";
const TINY: &str = "--size 60x40 --backend cpu --mode supersample:4";

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let rows: Vec<String> = (0..100).map(|i| format!("{},{},0,{i}", i % 10, i / 10)).collect();
    fs::write(dir.path().join("a.csv"), format!("x,y,z,heat\n{}\n", rows.join("\n"))).unwrap();
    fs::write(dir.path().join("map.txt"), "# two colours\n0 0 255\n255 255 0\n").unwrap();
    fs::write(dir.path().join("bad.txt"), "0 0 255\n255 255\n").unwrap();
    dir
}

/// Runs a line that must work; what it says on stderr.
fn fine(dir: &Path, line: &str) -> String {
    let (status, _, errors) = run(dir, line);
    assert_eq!(status, Some(0), "{line}: {errors}");
    errors
}

/// Runs a line that must be refused; its last line.
fn refused(dir: &Path, line: &str) -> String {
    let (status, _, errors) = run(dir, line);
    assert_eq!(status, Some(2), "{line}: {errors}");
    errors.lines().last().unwrap_or_default().to_owned()
}

#[test]
fn the_legend_has_the_colours_and_the_range() {
    let dir = folder();
    let line = format!("render a.csv --colour-by heat --range 0..200 --colour-map map.txt --legend --out o {SMALL}");
    let said = fine(dir.path(), &line);
    assert!(said.contains("coloured by `heat`: map.txt from 0 to 200"), "{said}");
    let picture = image::read(&dir.path().join("o/a.0000.png")).unwrap();
    // The bar is 16 pixels from the left and from below, and as high as five lines of text at least.
    let (height, left) = (80, 16 + 4);
    let top = 240 - 16 - height;
    let map = ColourMap::open(dir.path().join("map.txt").to_str().unwrap()).unwrap();
    for y in 0..height {
        let want = map.linear(1.0 - f64::from(y) / f64::from(height - 1)).unwrap();
        let got = picture.rgba[((top + y) * 320 + left) as usize];
        let far = (glam::Vec3::from_slice(&got[..3]) - want).abs().max_element();
        // Half a code of 8 bits where the curve is steepest: .0045.
        assert!(far < 0.005, "row {y}: {got:?} for {want}");
    }
    // Other settings are another picture.
    fine(dir.path(), &format!("{line} --resume"));
    let plain = line.replace(" --legend", "");
    fine(dir.path(), &format!("{plain} --resume"));
    let without = image::read(&dir.path().join("o/a.0000.png")).unwrap();
    assert_ne!(picture.rgba, without.rgba);
    assert_eq!(picture.rgba[60 * 320 + 160], without.rgba[60 * 320 + 160]);
    assert!(image::read_settings(&dir.path().join("o/a.0000.png")).unwrap().find("legend").is_none());
}

#[test]
fn what_would_make_the_legend_untrue_is_refused() {
    let dir = folder();
    let of = |options: &str| refused(dir.path(), &format!("render a.csv --out o {SMALL} {options}"));
    assert!(of("--colour-by heat --view-transform agx").contains("--view-transform would change the colours"));
    assert!(of("--colour-by heat --stops 1").contains("--stops would change the colours"));
    assert!(of("--colour-by heat --unlit=off").contains("no light changes the colours"));
    assert!(of("--legend").contains("--legend is for colours that stand for numbers"));
    let tiny = refused(dir.path(), &format!("render a.csv --out o {TINY} --colour-by heat --legend"));
    assert!(tiny.contains("--legend has no room in an image of 60 x 40"), "{tiny}");
    assert!(of("--range 0..1").contains("--colour-by"));
    assert!(of("--colour-by heat --range 1..1").contains("two numbers that differ"));
    assert!(of("--colour-by heat --colour-map bad.txt").contains("bad.txt: line 2: found 2 words"));
    assert!(of("--colour-by heat --colour-map viridi").contains("viridi"));
    assert!(of("--colour-by cold").contains("found no column \"cold\" to colour by, expected x, y, z, heat, speed"));
    assert!(!dir.path().join("o").exists());
}

#[test]
fn scenes_name_columns_maps_and_ranges() {
    let dir = folder();
    let scene = |lights: &str, model: &str| {
        let text = format!("<scene><image width=\"320\" height=\"240\"/>{lights}<object>{model}</object></scene>");
        fs::write(dir.path().join("s.xml"), text).unwrap();
    };
    let model = |attributes: &str| format!("<pointModel {attributes}>a.csv</pointModel>");
    scene("", &model("colourBy=\"heat\" colourMap=\"map.txt\" range=\"0..99\""));
    fine(dir.path(), "render s.xml --legend --out o --backend cpu --mode still:1");
    let of = || refused(dir.path(), "render s.xml --out p --backend cpu --mode still:1");
    scene("<light type=\"ambient\" colour=\"1 0.5 0.5\"/>", &model("colourBy=\"heat\""));
    assert!(of().contains("the ambient light is 1 0.5 0.5, expected three equal numbers"), "{}", of());
    scene("", &model("range=\"0..1\""));
    assert!(of().contains("`range` is without `colourBy`"), "{}", of());
    scene("", &model("colourBy=\"heat\" range=\"0-1\""));
    assert!(of().contains("`range` is `0-1`, expected two numbers that differ, as -1..2.5"), "{}", of());
    scene("", &model("colourBy=\"heat\" colourMap=\"bad.txt\""));
    assert!(of().contains("bad.txt: line 2"), "{}", of());
    scene("", &model("colourBy=\"heat\" colourMap=\"none.txt\""));
    assert!(of().contains("none.txt"), "{}", of());
}
