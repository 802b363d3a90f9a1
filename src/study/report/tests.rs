use super::page::page;
use super::*;
use crate::compare::{Comparison, Metric};
use crate::film::{Aov, Layer, Picture};
use crate::study::sheet::{Canvas, Crop};

fn solid(width: u32, height: u32, value: f32) -> Picture {
    Picture { width, height, rgba: vec![[value, value, value, 1.0]; (width * height) as usize], layers: Vec::new() }
}

fn with_error(mut picture: Picture, error: f32) -> Picture {
    let planes = vec![vec![error; picture.rgba.len()]; 4];
    picture.layers.push(Layer { aov: Aov::Error, planes, names: Vec::new() });
    picture
}

#[test]
fn the_z_test_passes_noise_and_rejects_bias() {
    let reference = with_error(solid(100, 100, 0.5), 1e-3);
    // 30 000 values: p = 1 - 0.99^(1/30000) = 3.35e-7, which a normal variable leaves at 5.10 standard errors (tables).
    let mut picture = solid(100, 100, 0.5);
    picture.rgba[7][0] += 5.0e-3;
    assert_eq!(pass_rate(&picture, &reference), Some(1.0));
    picture.rgba[7][0] = 0.5 + 5.2e-3;
    assert_eq!(pass_rate(&picture, &reference), Some(1.0 - 1.0 / 30_000.0));
    picture.rgba[8] = [f32::NAN, f32::INFINITY, 0.5, 1.0];
    assert_eq!(pass_rate(&picture, &reference), Some(1.0 - 3.0 / 30_000.0));
    assert_eq!(pass_rate(&solid(100, 100, 0.52), &reference), Some(0.0));
    // Where the reference has found no error, 1e-4 is allowed for.
    let sure = with_error(solid(100, 100, 0.5), 0.0);
    assert_eq!(pass_rate(&solid(100, 100, 0.5 + 4e-4), &sure), Some(1.0));
    assert_eq!(pass_rate(&solid(100, 100, 0.5 + 6e-4), &sure), Some(0.0));
    assert_eq!(pass_rate(&picture, &solid(100, 100, 0.5)), None);
    assert_eq!(pass_rate(&solid(9, 9, 0.5), &reference), None);
}

/// Nine moments of a picture of one row: depth and velocity of each pixel at each moment.
fn moments(pixel: impl Fn(usize, usize) -> (f32, f32)) -> Vec<Picture> {
    (0..STRATA as usize)
        .map(|k| {
            let mut picture = solid(6, 1, 0.0);
            let values: Vec<_> = (0..6).map(|x| pixel(x, k)).collect();
            let depth = values.iter().map(|v| v.0).collect();
            let velocity = vec![values.iter().map(|v| v.1).collect(), vec![0.0; 6]];
            picture.layers = vec![
                Layer { aov: Aov::Depth, planes: vec![depth], names: Vec::new() },
                Layer { aov: Aov::Velocity, planes: velocity, names: Vec::new() },
            ];
            picture
        })
        .collect()
}

#[test]
fn pixels_fall_into_regions() {
    use Region::{Background, Occlusion, Silhouette, Static, Swept};
    let far = f32::INFINITY;
    let scene = moments(|x, k| match x {
        0 => (far, 0.0),
        1 | 2 => (4.0, 0.0),
        // 0.05 pixels in a ninth of the shutter.
        3 => (4.0, 0.05),
        4 => (if k < 4 { 4.0 } else { 2.0 }, 0.0),
        _ => (if k == 8 { 4.0 } else { far }, 0.0),
    });
    assert_eq!(classify(&scene, 9.0).unwrap(), [Background, Silhouette, Static, Swept, Occlusion, Occlusion]);
    // Less than 0.25 pixels over the shutter is static; the neighbour of what is nearer at mid-shutter is a silhouette.
    assert_eq!(classify(&scene, 4.0).unwrap()[3], Silhouette);
    assert_eq!(classify(&[], 9.0), None);
    assert_eq!(classify(&[solid(6, 1, 0.0)], 9.0), None);
}

#[test]
fn errors_are_split_by_region() {
    let (reference, mut picture) = (solid(4, 1, 0.5), solid(4, 1, 0.5));
    picture.rgba[0] = [0.6, 0.5, 0.5, 1.0];
    picture.rgba[3] = [0.5, 0.2, 0.5, 1.0];
    let regions = [Region::Static, Region::Static, Region::Swept, Region::Swept];
    let parts = split(&picture, &reference, &[0.1, 0.0, 0.0, 0.4], &regions);
    assert_eq!(parts.iter().map(|p| p.region).collect::<Vec<_>>(), [Region::Static, Region::Swept]);
    assert!((parts[0].rmse - (0.01_f64 / 6.0).sqrt()).abs() < 1e-6 && (parts[1].error - 0.9).abs() < 1e-6);
    assert!((parts[1].flip - 0.2).abs() < 1e-7 && parts[0].pixels == 0.5);
    let none = split(&reference, &reference, &[0.0; 4], &regions);
    assert!(none.iter().all(|part| part.error == 0.0));
}

#[test]
fn shares_are_not_rounded_to_none_or_all() {
    let found = [0.0, 1e-6, 0.5, 0.999_999, 1.0].map(text::percent);
    assert_eq!(found, ["0.00 %", "< 0.01 %", "50.00 %", "99.99 %", "100.00 %"]);
}

#[test]
fn signed_errors_have_their_colours() {
    let reference = solid(12, 1, 0.25);
    let at = |value: f32| signed_error(&solid(12, 1, value), &reference, 0.25).unwrap().pixels()[0];
    assert_eq!(at(0.25), [255; 3]);
    assert_eq!((at(1.0), at(0.0)), ([178, 24, 43], [33, 102, 172]));
    assert_eq!(at(f32::NAN), [255, 0, 255]);
    let slightly = at(0.26);
    assert!(slightly[0] > slightly[2] && slightly[2] > 200, "{slightly:?}");
    assert_eq!(flip_map(&[0.0, 0.5, 9.0, f32::NAN], 4, 1, 0.5).unwrap().pixels()[1], flip_scale(1.0));
    // Both ends, and a stop between.
    assert_eq!([0.0, 0.2, 1.0].map(flip_scale), [[0, 0, 4], [59, 15, 112], [252, 253, 191]]);
    // Lightness rises.
    let light = |v: f32| flip_scale(v).iter().map(|&c| u32::from(c)).sum::<u32>();
    assert!((0..20).all(|i| light(i as f32 / 20.0) <= light((i + 1) as f32 / 20.0)));
}

#[test]
fn noise_makes_a_floor() {
    let of = |error: f32| Floor::of(&with_error(solid(64, 48, 0.5), error)).unwrap().unwrap();
    assert!((of(1e-3).rmse - 1e-3).abs() < 1e-9);
    assert_eq!(of(0.0), Floor::default());
    assert!(of(1e-3).flip > 0.0 && of(1e-2).flip > of(1e-3).flip);
    assert_eq!(of(1e-3), of(1e-3));
    assert_eq!(Floor::of(&solid(64, 48, 0.5)).unwrap(), None);
    let both = Floor::pooled([Floor { rmse: 3.0, flip: 1.0 }, Floor { rmse: 4.0, flip: 2.0 }].into_iter());
    assert_eq!(both, Floor { rmse: 12.5_f64.sqrt(), flip: 1.5 });
}

#[test]
fn times_have_a_median() {
    assert_eq!(WallTimes::of(&[3.0, 1.0, 2.0]), WallTimes { median: 2.0, least: 1.0, most: 3.0 });
    assert_eq!(WallTimes::of(&[4.0, 1.0]).median, 2.5);
    assert_eq!(WallTimes::of(&[]), WallTimes::default());
}

#[test]
fn curves_lie_where_their_logarithms_are() {
    let series = |points: &[(f64, f64)]| chart::Series {
        name: "s".into(),
        points: points.iter().map(|&(x, y)| (x, y, "p<&\"".into())).collect(),
    };
    let svg =
        chart::log_log("x", "y & z", &[series(&[(100.0, 0.01), (1.0, 1.0), (10.0, 0.1)])], Some((0.001, "floor")));
    let line = svg.split("<polyline points=\"").nth(1).unwrap().split('"').next().unwrap();
    let points: Vec<(f64, f64)> = line
        .split(' ')
        .map(|p| p.split_once(',').unwrap())
        .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
        .collect();
    // Sorted, and in equal steps.
    assert!((points[1].0 - points[0].0 - (points[2].0 - points[1].0)).abs() < 0.11 && points[1].0 > points[0].0);
    assert!((points[1].1 - points[0].1 - (points[2].1 - points[1].1)).abs() < 0.11 && points[1].1 > points[0].1);
    // The middle of three decades is the middle of the axis, which goes from 70 to 546.
    assert!((points[1].0 - 308.0).abs() < 0.11, "{points:?}");
    assert!(svg.contains("class=\"floor\"") && svg.contains("y &amp; z") && svg.contains("p&lt;&amp;&quot;"));
    // What a logarithm cannot take is left out.
    let svg = chart::log_log("x", "y", &[series(&[(0.0, 1.0), (1.0, f64::NAN), (-1.0, 1.0)])], Some((0.0, "floor")));
    assert!(svg.contains("no positive values") && !svg.contains("NaN"));
    let one = chart::log_log("x", "y", &[series(&[(5.0, 5.0)])], None);
    assert!(one.contains("<circle") && !one.contains("NaN") && !one.contains("inf"));
}

fn study(frames: usize) -> Study {
    let reference = with_error(solid(12, 12, 0.5), 1e-3);
    let mode = |name: &str, value: f32, seconds: f64| {
        let picture = solid(12, 12, value);
        ModeStudy {
            mode: name.to_owned(),
            family: name.split(':').next().unwrap_or_default().to_owned(),
            backend: "cpu".into(),
            samples: 8,
            times: WallTimes::of(&[seconds, 2.0 * seconds, 3.0 * seconds]),
            errors: Comparison::new(&picture, &reference, &Metric::ALL).unwrap(),
            z_pass: pass_rate(&picture, &reference).unwrap(),
            regions: split(&picture, &reference, &[0.25; 144], &[Region::Swept; 144]),
        }
    };
    let modes = || vec![mode("fast:8", 0.6, 0.1), mode("good:8", 0.51, 1.0), mode("neither:8", 0.55, 2.0)];
    let frames: Vec<_> = (0..frames as i64)
        .map(|frame| FrameStudy {
            frame: frame.into(),
            reference_seconds: 9.0,
            floor: Floor { rmse: 1e-3, flip: 2e-3 },
            modes: modes(),
        })
        .collect();
    let sequence =
        (0..3).map(|i| ModeStudy::pooled(&frames.iter().map(|f| &f.modes[i]).collect::<Vec<_>>()).unwrap()).collect();
    let settings = vec![("hash".to_owned(), "0123".to_owned()), ("seed".to_owned(), "1".to_owned())];
    let scene = SceneStudy { name: "<b>&\"scene".into(), size: [12, 12], reference: 64, repeats: 3, settings };
    let (backends, over) = (vec!["cpu (2 threads)".into()], vec!["frame 0, fast:8: flip is too much".into()]);
    Study { program: "splatblur".into(), scene, backends, frames, sequence, over, notes: vec!["a note".into()] }
}

#[test]
fn the_page_needs_nothing_else_and_says_all() {
    let study = study(2);
    let canvas = || Canvas::of(&solid(12, 12, 0.5)).unwrap();
    let worst = || [canvas(), canvas(), canvas()];
    let crop = Crop { x: 1, y: 2, width: 3, height: 4 };
    let mode = || ModePictures { picture: canvas(), signed: canvas(), flip: canvas(), crop, worst: worst() };
    let pictures = FramePictures {
        frame: 1.into(),
        references: vec![("reference".into(), canvas())],
        regions: region_map(&[Region::Swept; 144], 12).unwrap(),
        modes: vec![mode(), mode(), mode()],
        signed_range: 0.25,
        flip_range: 0.5,
    };
    let html = page(&study, &[pictures]).unwrap();
    // Nothing is fetched: neither links, scripts nor addresses but for pictures that are inside.
    assert!(!html.contains("http") && !html.contains("<script") && !html.contains("<link"), "outside references");
    assert_eq!(html.matches("src=\"").count(), html.matches("src=\"data:image/png;base64,").count());
    assert_eq!(html.matches("<img").count(), 2 + 3 * 6);
    assert_eq!(html.matches("<svg").count(), 4);
    // What was written by others is text.
    assert!(!html.contains("<b>&\"scene") && html.contains("&lt;b&gt;&amp;"));
    for words in [
        "fast:8@cpu",
        "0123",
        "cpu (2 threads)",
        "flip is too much",
        "a note",
        "67.02",
        "prefers-color-scheme:dark",
        "@media print",
        "Šidák",
        "1,2,3x4",
        "noise of the reference",
        "0.00200",
    ] {
        assert!(html.contains(words), "{words}");
    }
    for metric in Metric::ALL {
        assert!(html.contains(metric.name()), "{}", metric.name());
    }
    // Two modes lead in each table; the third is slower and worse than one of them.
    assert_eq!(html.matches("class=\"leads\"").count(), 2 * 3);
    // The same study, the same bytes.
    assert_eq!(page(&study, &[]).unwrap(), page(&study, &[]).unwrap());
}

#[test]
fn json_and_csv_have_every_figure() {
    let study = study(2);
    let json = study.json();
    assert_eq!(json["frames"].as_array().unwrap().len(), 2);
    let mode = &json["frames"][1]["modes"][0];
    let rmse = mode["metrics"]["rmse"].as_f64().unwrap();
    assert!((rmse - 0.1).abs() < 1e-6);
    assert_eq!((mode["seconds"]["median"].as_f64(), mode["z_pass"].as_f64()), (Some(0.2), Some(0.0)));
    assert_eq!(json["settings"]["hash"], "0123");
    let csv = csv(&study);
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 1 + 3 * 2 + 3);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()), "{csv}");
    let column = |name: &str| rows[0].iter().position(|&c| c == name).unwrap();
    assert_eq!(rows[7][column("frame")], "all");
    assert!((rows[7][column("rmse")].parse::<f64>().unwrap() - 0.1).abs() < 1e-6);
    assert_eq!(rows[7][column("swept_pixels")], "1");
    assert_eq!(rows[7][column("static_rmse")], "");
}
