//! `splatblur dataset` for programs that are trained: what their readers find. The readers here are written from the
//! formats' own documents, and share nothing with the writers.

#![allow(clippy::unwrap_used, reason = "tests may stop and report")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use glam::{DMat3, DMat4, DVec2, DVec3};
use splatblur::image;
use splatblur::math::srgb;

use crate::run;

/// Three small balls of one colour each, of which the red one moves, before a camera that moves and is not level.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let ball = |name: &str, colour: &str, at: DVec3, rest: &str| {
        format!(
            "<object name='{name}'><sphere radius='0.06' colour='{colour}'/>\
             <transform translate='{} {} {}'/>{rest}</object>",
            at.x, at.y, at.z
        )
    };
    let text = format!(
        "<scene><image width='160' height='120'/><frames first='1' last='3' rate='24'/>\
         <shutter open='0' close='0.5'/><light type='ambient'/>\
         <camera eye='0.5 0.9 4' at='0.1 0.2 0' up='0.3 1 0.1'>\
         <motion type='linear' velocity='0.1 0.02 -0.1'/>\
         <motion type='rotation' axis='0.2 1 0.1' degreesPerFrame='2'/></camera>{}{}{}</scene>",
        ball("red", "1 0 0", RED, "<motion type='linear' velocity='0.2 0.1 0'/>"),
        ball("green", "0 1 0", GREEN, ""),
        ball("blue", "0 0 1", BLUE, ""),
    );
    fs::write(dir.path().join("balls.xml"), text).unwrap();
    dir
}

const RED: DVec3 = DVec3::new(-0.5, 0.1, 0.2);
const GREEN: DVec3 = DVec3::new(0.6, 0.7, -0.4);
const BLUE: DVec3 = DVec3::new(0.2, -0.4, 0.5);

/// Where the balls are in the middle of the exposure of a frame.
fn places(frame: f64) -> [DVec3; 3] {
    [RED + DVec3::new(0.2, 0.1, 0.0) * (frame + 0.25), GREEN, BLUE]
}

fn done(dir: &Path, line: &str) -> String {
    let (status, said, errors) = run(dir, line);
    assert_eq!(status, Some(0), "{line}: {errors}");
    said
}

/// The middle of all that a picture shows in one of its channels, pixels from the left upper corner.
fn seen(path: &Path, channel: usize) -> DVec2 {
    let picture = image::read(path).unwrap();
    let (mut sum, mut light) = (DVec2::ZERO, 0.0);
    for (i, pixel) in picture.rgba.iter().enumerate() {
        let place = DVec2::new((i % picture.width as usize) as f64 + 0.5, (i / picture.width as usize) as f64 + 0.5);
        sum += place * f64::from(pixel[channel]);
        light += f64::from(pixel[channel]);
    }
    assert!(light > 3.0, "{}: {light} of channel {channel}", path.display());
    sum / light
}

/// A view of a reconstruction.
struct View {
    name: String,
    /// From the world to the camera: x right, y down, z forward.
    turn: DMat3,
    shift: DVec3,
    /// fx, fy, cx, cy.
    lens: [f64; 4],
}

impl View {
    fn pixel(&self, place: DVec3) -> DVec2 {
        let p = self.turn * place + self.shift;
        let [fx, fy, cx, cy] = self.lens;
        assert!(p.z > 0.0);
        DVec2::new(fx * p.x / p.z + cx, fy * p.y / p.z + cy)
    }
}

fn lines(path: &Path) -> Vec<String> {
    fs::read_to_string(path).unwrap().lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
}

/// `cameras.txt` and `images.txt`, after COLMAP's page on its formats.
fn colmap(sparse: &Path) -> Vec<View> {
    let mut lenses = BTreeMap::new();
    for line in lines(&sparse.join("cameras.txt")) {
        let words: Vec<&str> = line.split(' ').collect();
        assert_eq!((words[1], words[2], words[3], words.len()), ("PINHOLE", "160", "120", 8), "{line}");
        lenses.insert(words[0].to_owned(), [4, 5, 6, 7].map(|i| words[i].parse::<f64>().unwrap()));
    }
    let of_images = lines(&sparse.join("images.txt"));
    let pairs = of_images.chunks(2).zip(1..).map(|(pair, id)| {
        assert_eq!(pair.get(1).map(String::as_str), Some(""), "the points that {} shows", pair[0]);
        let words: Vec<&str> = pair[0].split(' ').collect();
        assert_eq!((words.len(), words[0]), (10, id.to_string().as_str()), "{}", pair[0]);
        let [w, x, y, z, tx, ty, tz] = [1, 2, 3, 4, 5, 6, 7].map(|i| words[i].parse::<f64>().unwrap());
        assert!((w * w + x * x + y * y + z * z - 1.0).abs() < 1e-12);
        // Rows of the rotation of a unit quaternion.
        let turn = DMat3::from_cols(
            DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            DVec3::new(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            DVec3::new(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
        .transpose();
        View { name: words[9].to_owned(), turn, shift: DVec3::new(tx, ty, tz), lens: lenses[words[8]] }
    });
    pairs.collect()
}

// Not deep: 6 seconds, and nothing else shows that the poses of such files are those of the pictures.
#[test]
fn a_reader_of_colmap_meets_the_pixels() {
    let dir = folder();
    let line = "dataset balls.xml --out train --layout colmap --sharp 1 --no-flow --format exr --reference 64 --frames";
    done(dir.path(), &format!("{line} 3,1,2"));
    let root = dir.path().join("train");
    let views = colmap(&root.join("sparse/0"));
    // In the order of their names, whatever the order of the frames.
    assert_eq!(views.iter().map(|view| &*view.name).collect::<Vec<_>>(), ["0001.exr", "0002.exr", "0003.exr"]);
    for (view, frame) in views.iter().zip(1..) {
        assert!(root.join("images").join(&view.name).is_file());
        for (channel, place) in places(f64::from(frame)).into_iter().enumerate() {
            let [there, told] =
                [seen(&root.join("sharp").join(format!("000{frame}-0.exr")), channel), view.pixel(place)];
            // Measured: at most 0.032 pixels, by noise; a ball is 5 wide.
            assert!(there.distance(told) < 0.05, "{} {channel}: {there} {told}", view.name);
        }
    }
    // Points: on the balls, in the middle of the first frame's exposure, with their colours.
    let mut counts = [0; 3];
    for (line, id) in lines(&root.join("sparse/0/points3D.txt")).iter().zip(1..) {
        let words: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        assert_eq!((words.len(), words[0], words[7]), (8, f64::from(id), 0.0), "{line}");
        let ball = [4, 5, 6].iter().position(|&i| words[i] == 255.0).unwrap();
        assert_eq!(words[4] + words[5] + words[6], 255.0, "{line}");
        let place = DVec3::new(words[1], words[2], words[3]);
        // The first frame that was named.
        assert!((place.distance(places(3.0)[ball]) - 0.06).abs() < 1e-9, "{line}");
        counts[ball] += 1;
    }
    assert_eq!(counts, [1000; 3]);

    // It is made again, and it is a camera track of this program.
    done(dir.path(), "dataset --replay train/transforms.json --out again --quiet");
    for name in ["cameras.txt", "images.txt", "points3D.txt"] {
        let [made, again] =
            ["train", "again"].map(|folder| fs::read(dir.path().join(folder).join("sparse/0").join(name)));
        assert!(made.unwrap() == again.unwrap(), "{name}");
    }
}

/// A file of `NumPy`, version 1.0, of 64-bit floats by rows: its shape and its values.
fn npy(path: &Path) -> (Vec<usize>, Vec<f64>) {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let data = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!(data % 64, 0);
    let header = std::str::from_utf8(&bytes[10..data]).unwrap();
    assert!(header.ends_with(" \n") && header.contains("'descr': '<f8'"), "{header}");
    assert!(header.contains("'fortran_order': False"), "{header}");
    let shape = header.split(['(', ')']).nth(1).unwrap();
    let shape = shape.split(',').map(|word| word.trim().parse().unwrap()).collect();
    let values = bytes[data..].chunks(8).map(|chunk| f64::from_le_bytes(chunk.try_into().unwrap())).collect();
    (shape, values)
}

// Not deep: 6 seconds, and nothing else shows that the poses of such files are those of the pictures.
#[test]
fn a_reader_of_llff_meets_the_pixels() {
    let dir = folder();
    let line = "dataset balls.xml --out train --layout deblur-nerf --hold 2 --sharp 1 --no-flow --reference 64";
    done(dir.path(), line);
    let root = dir.path().join("train");
    let names = |folder: &str| {
        let entries = fs::read_dir(root.join(folder)).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    let pictures = names("images");
    assert_eq!(pictures, ["0001.png", "0002.png", "0003.png"]);
    // The first of two, by name.
    assert_eq!((names("images_test"), names("images_test_blurred")), (held(), held()));
    assert_eq!(fs::read(root.join("hold=2")).unwrap(), b"");

    let (shape, values) = npy(&root.join("poses_bounds.npy"));
    assert_eq!(shape, [3, 17]);
    for ((row, name), frame) in values.chunks(17).zip(&pictures).zip(1..) {
        // As the loader of NeRF (Mildenhall et al. 2020): columns right, up, back, place, and height, width, focal.
        let column = |at: usize| DVec3::new(row[at], row[5 + at], row[10 + at]);
        let (right, up, back, eye) = (column(1), -column(0), column(2), column(3));
        let (height, width, focal) = (row[4], row[9], row[14]);
        assert_eq!((height, width), (120.0, 160.0));
        assert!((right.cross(up) - back).length() < 1e-12 && (right.length() - 1.0).abs() < 1e-12);
        let of_colmap = &colmap(&root.join("sparse/0"))[frame - 1];
        assert_eq!((&of_colmap.name, of_colmap.lens[0]), (name, focal));
        let mut depths = [0.0; 3];
        for (channel, place) in places(frame as f64).into_iter().enumerate() {
            let p = place - eye;
            depths[channel] = -p.dot(back);
            let told = DVec2::new(p.dot(right), -p.dot(up)) * focal / depths[channel] + 0.5 * DVec2::new(width, height);
            let there = seen(&root.join("sharp").join(format!("000{frame}-0.png")), channel);
            // Measured: at most 0.033 pixels.
            assert!(there.distance(told) < 0.05, "{name} {channel}: {there} {told}");
            assert!(of_colmap.pixel(place).distance(told) < 1e-9);
        }
        // The nearest ball's front, and the farthest one's outline: 0.06 before, and at its middle.
        let (near, far) = depths.iter().fold((f64::INFINITY, 0.0_f64), |(near, far), &z| (near.min(z), far.max(z)));
        assert!((row[15] - near + 0.06).abs() < 0.01, "{} {near}", row[15]);
        assert!((-0.06..0.01).contains(&(row[16] - far)), "{} {far}", row[16]);
    }

    // Held-out views are sharp, also where they are blurred elsewhere.
    let bytes = |name: &str| image::read(&root.join(name)).unwrap();
    for name in held() {
        let sharp = bytes(&format!("images/{name}"));
        assert!(sharp == bytes(&format!("images_test/{name}")));
        assert!(sharp == bytes(&format!("sharp/{}-0.png", &name[..4])));
        assert!(sharp != bytes(&format!("images_test_blurred/{name}")));
    }
    assert!(bytes("images/0002.png") != bytes("sharp/0002-0.png"));
    let said: serde_json::Value = serde_json::from_slice(&fs::read(root.join("transforms.json")).unwrap()).unwrap();
    assert_eq!(said["frames"][2]["blurred"], "images_test_blurred/0003.png");

    // Another choice makes others anew, and the reader finds one `hold=n`.
    done(dir.path(), &line.replace("--hold 2", "--hold 3 --resume"));
    assert!(!root.join("hold=2").exists() && root.join("hold=3").exists());
    assert!(bytes("images/0003.png") != bytes("sharp/0003-0.png"));
}

fn held() -> Vec<String> {
    ["0001.png", "0003.png"].map(str::to_owned).into()
}

/// A rolling shutter is in the blurred picture alone: a test view has all rows at once.
#[test]
fn a_test_view_has_no_rolling_shutter() {
    let dir = folder();
    let line = "dataset balls.xml --layout deblur-nerf --sharp 1 --no-flow --reference 16";
    done(dir.path(), &format!("{line} --out global"));
    done(dir.path(), &format!("{line} --out rolling --readout 0.5"));
    let picture = |name: &str| image::read(&dir.path().join(name)).unwrap();
    assert!(picture("rolling/images_test/0001.png") == picture("global/images_test/0001.png"));
    assert!(picture("rolling/images_test/0001.png") != picture("rolling/sharp/0001-0.png"));
}

#[test]
fn wrong_choices_for_training_are_one_line() {
    let dir = folder();
    for (line, expected) in [
        ("--layout deblur-nerf --hold 1", "1 is not in 2..="),
        ("--shake degrees=90", "`degrees=90` is no shake"),
        ("--shake 1", "`1` is no shake"),
        ("--shake degrees=0", "`degrees=0` is no shake"),
        ("--shake units=1,units=2", "`units=1,units=2` is no shake"),
        ("--exact --sharp 1", "take --sharp 2 or more"),
        ("--hold many", "invalid value 'many'"),
        ("--layout gopro --hold 8", "--hold is not for --layout gopro"),
        ("--layout deblur-nerf --frames 2", "--hold 8 leaves no view for training: there is only one frame"),
    ] {
        let (status, said, errors) = run(dir.path(), &format!("dataset balls.xml --quiet {line}"));
        assert_eq!((status, said.as_str(), errors.lines().count()), (Some(2), "", 1), "{line}: {errors}");
        assert!(errors.contains(expected), "{line}: {errors}");
    }
}

#[test]
fn a_reader_of_nerfstudio_finds_depth_points_and_views_for_a_test() {
    let dir = folder();
    let common = "dataset balls.xml --sharp 1 --no-flow --reference 16";
    let said = |name: &str, rest: &str| -> serde_json::Value {
        done(dir.path(), &format!("{common} --out {name}{rest}"));
        serde_json::from_slice(&fs::read(dir.path().join(name).join("transforms.json")).unwrap()).unwrap()
    };
    let plain = said("plain", "");
    // It splits them itself.
    assert!(
        ["train_filenames", "val_filenames", "test_filenames"].iter().all(|key| plain.get(key).is_none()),
        "{plain}"
    );
    // No masks are written.
    assert!(plain["frames"][0].get("mask_path").is_none());
    let held = said("held", " --hold 2 --frames 3,1,2");
    assert_eq!(held["train_filenames"], serde_json::json!(["images/0002.png"]));
    assert_eq!(held["test_filenames"], serde_json::json!(["images/0003.png", "images/0001.png"]));
    assert_eq!(held["val_filenames"], held["test_filenames"]);
    for frame in held["frames"].as_array().unwrap() {
        for key in ["file_path", "depth_file_path"] {
            assert!(dir.path().join("held").join(frame[key].as_str().unwrap()).is_file(), "{key}");
        }
    }
    let [file, sharp] =
        ["images/0001.png", "sharp/0001-0.png"].map(|name| image::read(&dir.path().join("held").join(name)));
    assert!(file.unwrap() == sharp.unwrap());

    let path = dir.path().join("plain").join(plain["ply_file_path"].as_str().unwrap());
    let text = fs::read_to_string(path).unwrap();
    let (header, body) = text.split_once("end_header\n").unwrap();
    let properties: Vec<&str> = header.lines().filter_map(|line| line.strip_prefix("property ")).collect();
    assert_eq!(properties, ["float x", "float y", "float z", "uchar red", "uchar green", "uchar blue"]);
    assert!(header.starts_with("ply\nformat ascii 1.0\nelement vertex 3000\n"), "{header}");
    assert_eq!(body.lines().count(), 3000);
    for line in body.lines() {
        let words: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        let ball = [3, 4, 5].iter().position(|&i| words[i] == 255.0).unwrap();
        let place = DVec3::new(words[0], words[1], words[2]);
        assert!((place.distance(places(1.0)[ball]) - 0.06).abs() < 1e-9, "{line}");
    }
}

/// The largest difference between a blurred picture and the mean of its sharp ones: in linear light, as a share of the
/// value, and in codes of sRGB.
fn off(root: &Path, ending: &str, sharp: usize) -> (f64, f64) {
    let picture = |name: String| image::read(&root.join(name)).unwrap();
    let blurred = picture(format!("images/0001.{ending}"));
    let sharps: Vec<_> = (0..sharp).map(|i| picture(format!("sharp/0001-{i}.{ending}"))).collect();
    let code = |light: f64| 255.0 * f64::from(srgb::from_linear(light as f32));
    let (mut share, mut codes) = (0.0_f64, 0.0_f64);
    for (i, pixel) in blurred.rgba.iter().enumerate() {
        for (c, &value) in pixel.iter().enumerate() {
            let value = f64::from(value);
            let mean = sharps.iter().map(|picture| f64::from(picture.rgba[i][c])).sum::<f64>() / sharp as f64;
            share = share.max((value - mean).abs() / mean.max(1e-9));
            codes = codes.max((code(value) - code(mean)).abs());
        }
    }
    (share, codes)
}

#[test]
fn an_exact_blur_is_the_mean_of_the_sharp_pictures() {
    let dir = folder();
    let line = "dataset balls.xml --frames 1 --no-flow --sharp 4 --reference 16";
    for (name, options) in [("exact", " --exact"), ("other", "")] {
        done(dir.path(), &format!("{line} --format exr --out {name}.exr{options}"));
        done(dir.path(), &format!("{line} --out {name}.png{options}"));
    }
    let off = |name: &str| off(&dir.path().join(name), &name[6..], 4);
    let [exr, png, other] = ["exact.exr", "exact.png", "other.exr"].map(off);
    // Measured: 0, and 0.52 codes; a blur of its own is 99 codes away.
    assert!(exr.0 <= 6e-8 && png.1 < 1.0 && other.1 > 10.0, "{exr:?} {png:?} {other:?}");
    // All weigh the same; nothing states an error.
    let said = fs::read(dir.path().join("exact.exr/transforms.json")).unwrap();
    let said: serde_json::Value = serde_json::from_slice(&said).unwrap();
    let weights = said["frames"][0]["sharp"].as_array().unwrap().iter().map(|sharp| sharp["weight"].as_f64().unwrap());
    assert!(weights.eq([0.25; 4]) && said["frames"][0].get("error").is_none(), "{said}");
    assert!(!dir.path().join("exact.exr/error").exists());
    // It is another picture: nothing of the one before is kept.
    let report = done(dir.path(), &format!("{line} --out other.png --exact --resume --json"));
    assert!(report.contains("\"skipped\": false"), "{report}");
}

#[test]
fn progress_can_be_a_line_a_frame() {
    let dir = folder();
    let line = "dataset balls.xml --out train --sharp 1 --no-flow --reference 16 --frames 3,1";
    let said = |line: &str| run(dir.path(), line).2;
    // As before: nothing in a pipe but what is made.
    assert_eq!(said(line).lines().count(), 1);
    let of_frames =
        |text: &str| text.lines().filter(|line| line.starts_with("frame ")).map(str::to_owned).collect::<Vec<_>>();
    let lines = of_frames(&said(&format!("{line} --progress lines")));
    let is_line = |line: &str, begin: &str, end: &str| {
        let seconds = line.strip_prefix(begin).and_then(|rest| rest.strip_suffix(end));
        seconds.and_then(|seconds| seconds.parse::<f64>().ok()).is_some_and(|seconds| seconds < 60.0)
    };
    assert!(
        is_line(&lines[0], "frame 3: ", " s, 1 of 2") && is_line(&lines[1], "frame 1: ", " s, 2 of 2"),
        "{lines:?}"
    );
    let lines = of_frames(&said(&format!("{line} --progress lines --resume")));
    assert_eq!(lines, ["frame 3: there already, 1 of 2", "frame 1: there already, 2 of 2"]);
    // It is no choice that a dataset records.
    let recorded = fs::read_to_string(dir.path().join("train/transforms.json")).unwrap();
    assert!(!recorded.contains("--progress"), "{recorded}");

    let render = "render balls.xml --size 16x12 --error draft --progress";
    assert_eq!(of_frames(&said(&format!("{render} lines"))).len(), 3);
    for (line, expected) in
        [(format!("{render} dots"), "invalid value 'dots'"), (format!("{render} lines --quiet"), "cannot be used with")]
    {
        let (status, _, errors) = run(dir.path(), &line);
        assert!(status == Some(2) && errors.lines().count() == 1 && errors.contains(expected), "{line}: {errors}");
    }
}

/// The camera of each sharp picture of a frame, to the world.
fn cameras(root: &Path, frame: usize) -> Vec<DMat4> {
    let said: serde_json::Value = serde_json::from_slice(&fs::read(root.join("transforms.json")).unwrap()).unwrap();
    let sharp = said["frames"][frame]["sharp"].as_array().unwrap();
    let matrix = |sharp: &serde_json::Value| {
        let rows: Vec<Vec<f64>> = serde_json::from_value(sharp["transform_matrix"].clone()).unwrap();
        DMat4::from_cols_array(&std::array::from_fn(|i| rows[i / 4][i % 4])).transpose()
    };
    sharp.iter().map(matrix).collect()
}

#[test]
fn a_shaken_camera_goes_as_far_as_it_is_told() {
    let dir = folder();
    // As many pictures as the path has poses.
    let line = "dataset balls.xml --size 16x12 --frames 1,2 --sharp 126 --no-flow --reference 16 --quiet";
    let shake = "--shake degrees=1.5,units=0.02";
    for (name, options) in
        [("rest", ""), ("a", shake), ("again", shake), ("b", "--shake degrees=1.5,units=0.02 --seed 2")]
    {
        done(dir.path(), format!("{line} --out {name} {options}").trim_end());
    }
    let of = |name: &str, frame: usize| cameras(&dir.path().join(name), frame);
    for frame in 0..2 {
        let (mut most, mut mean, mut way) = ([0.0_f64; 2], DVec3::ZERO, 0.0);
        let mut before = None;
        for (camera, rest) in of("a", frame).into_iter().zip(of("rest", frame)) {
            let moved = rest.inverse() * camera;
            let cosine = (moved.x_axis.x + moved.y_axis.y + moved.z_axis.z - 1.0) / 2.0;
            let shift = moved.w_axis.truncate();
            most = [most[0].max(libm::acos(cosine).to_degrees()), most[1].max(shift.length())];
            mean += shift / 126.0;
            way += before.map_or(0.0, |before: DVec3| before.distance(shift));
            before = Some(shift);
        }
        assert!((most[0] - 1.5).abs() < 1e-6 && (most[1] - 0.02).abs() < 1e-12, "{most:?}");
        // It goes to and fro about the camera at rest, and has a path.
        assert!(mean.length() < 1e-12 && way > 0.02, "{mean} {way}");
    }
    // Each frame and each seed has a path of its own, and it is the same every time.
    let moved = |name: &str, frame: usize| of("rest", frame)[0].inverse() * of(name, frame)[0];
    assert!(!moved("a", 0).abs_diff_eq(moved("a", 1), 1e-3) && !moved("a", 0).abs_diff_eq(moved("b", 0), 1e-3));
    let bytes = |name: &str| fs::read(dir.path().join(name)).unwrap();
    for name in ["images/0001.png", "transforms.json"] {
        assert!(bytes(&format!("a/{name}")) == bytes(&format!("again/{name}")), "{name}");
    }
    assert!(bytes("a/images/0001.png") != bytes("rest/images/0001.png"));
    // A run goes on only with the same shake.
    let report = done(dir.path(), &format!("{line} --out rest {shake} --resume --json"));
    assert!(!report.contains("\"skipped\": true"), "{report}");
}

/// Pictures and poses are those of the shaken camera.
// Not deep: 6 seconds, and nothing else shows that the poses of such files are those of the pictures.
#[test]
fn a_shaken_camera_is_where_it_is_told() {
    let dir = folder();
    let line = "dataset balls.xml --out train --layout colmap --sharp 1 --no-flow --reference 64 --shake";
    done(dir.path(), &format!("{line} degrees=2,units=0.1"));
    let root = dir.path().join("train");
    let mut most = 0.0_f64;
    for (view, frame) in colmap(&root.join("sparse/0")).iter().zip(1..) {
        for (channel, place) in places(f64::from(frame)).into_iter().enumerate() {
            let there = seen(&root.join("sharp").join(format!("000{frame}-0.png")), channel);
            most = most.max(there.distance(view.pixel(place)));
        }
    }
    // Measured: 0.038 pixels, by noise.
    assert!(most < 0.05, "{most}");
}
