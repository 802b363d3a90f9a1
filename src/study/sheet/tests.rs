use super::*;
use crate::film::Picture;

fn solid(width: u32, height: u32, value: f32) -> Picture {
    Picture { width, height, rgba: vec![[value, value, value, 1.0]; (width * height) as usize], layers: Vec::new() }
}

fn decode(bytes: &[u8]) -> (u32, u32, Vec<Vec<u8>>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let frames = reader.info().animation_control().map_or(1, |control| control.num_frames);
    let (width, height) = (reader.info().width, reader.info().height);
    let mut images = Vec::new();
    for _ in 0..frames {
        let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut buffer).unwrap();
        images.push(buffer);
    }
    (width, height, images)
}

#[test]
fn light_is_averaged_where_pictures_shrink() {
    let mut checker = solid(4, 4, 0.0);
    for i in (0..16).filter(|i| (i % 4 + i / 4) % 2 == 0) {
        checker.rgba[i] = [1.0; 4];
    }
    // Half of the light is 188, not 128.
    assert_eq!(Canvas::shrunk(&checker, 2).unwrap().pixels(), [[188; 3]; 4]);
    let third = Canvas::shrunk(&solid(90, 50, 1.0), 31).unwrap();
    assert_eq!((third.width(), third.height()), (31, 17));
    assert!(third.pixels().iter().all(|&p| p == [255; 3]));
    assert_eq!(Canvas::shrunk(&solid(4, 4, 0.5), 9).unwrap().width(), 4);
}

#[test]
fn what_is_not_finite_is_seen() {
    let mut bad = solid(2, 1, 0.0);
    bad.rgba[1][2] = f32::NAN;
    assert_eq!(Canvas::of(&bad).unwrap().pixels(), [[0, 0, 0], [255, 0, 255]]);
}

#[test]
fn the_crop_goes_where_pictures_differ() {
    let (a, mut b) = (solid(40, 30, 0.5), solid(40, 30, 0.5));
    assert_eq!(most_different(&[&a, &b], 8, 6).unwrap(), Crop { x: 0, y: 0, width: 8, height: 6 });
    for (x, y) in [(20, 10), (27, 15)] {
        b.rgba[y * 40 + x] = [1.0; 4];
    }
    // Only this crop has both.
    assert_eq!(most_different(&[&a, &b], 8, 6).unwrap(), Crop { x: 20, y: 10, width: 8, height: 6 });
    assert_eq!(most_different(&[&a, &b, &a], 99, 99).unwrap(), Crop { x: 0, y: 0, width: 40, height: 30 });
    // One that is wrong nearly everywhere does not hide where the others differ.
    let mut wrong = solid(40, 30, 5.0);
    wrong.rgba[10 * 40 + 20] = [0.5; 4];
    assert_eq!(most_different(&[&a, &b, &wrong], 8, 6).unwrap(), Crop { x: 20, y: 10, width: 8, height: 6 });
    assert!(most_different(&[], 8, 6).is_err());
    assert!(most_different(&[&a, &solid(3, 3, 0.0)], 8, 6).is_err());
}

#[test]
fn crops_reach_nothing_outside() {
    let a = solid(10, 10, 0.5);
    for (x, y, width, height) in [(9, 0, 2, 1), (0, 9, 1, 2), (0, 0, 0, 1), (u32::MAX, 0, 2, 2)] {
        assert!(Canvas::of(&a).unwrap().enlarged(Crop { x, y, width, height }, 3).is_err());
    }
    let part = Canvas::of(&a).unwrap().enlarged(Crop { x: 8, y: 8, width: 2, height: 2 }, 3).unwrap();
    assert_eq!((part.width(), part.height(), part.pixels()[0]), (6, 6, [188; 3]));
}

#[test]
fn a_sheet_shows_each_panel_and_its_crop() {
    let pictures = [0.0, 0.25, 1.0].map(|v| solid(300, 200, v));
    let panels: Vec<_> = pictures
        .iter()
        .map(|picture| Panel { title: "mode:8".into(), lines: vec!["8 samples".into(); 2], picture })
        .collect();
    let crop = Crop { x: 100, y: 50, width: 60, height: 40 };
    let layout = Layout { panel: 480, columns: 2 };
    let canvas = sheet("scene", &panels, crop, layout).unwrap();
    // Three panels in rows of two. Their pictures are black, 137, white.
    let colours = |colour: [u8; 3]| canvas.pixels().iter().filter(|&&p| p == colour).count();
    let (picture, outline, enlarged) = (300 * 200, 2 * (62 + 42) - 4, 60 * 40 * 5 * 5);
    assert_eq!(colours([137; 3]), picture - outline + enlarged);
    assert_eq!(colours([0; 3]), picture - outline + enlarged);
    assert_eq!(colours([255, 196, 0]), 3 * outline);
    let (width, height, images) = decode(&canvas.png().unwrap());
    assert_eq!((width, height), (canvas.width(), canvas.height()));
    assert_eq!(images[0], canvas.pixels().as_flattened());
    assert!(matches!(sheet("scene", &[], crop, layout), Err(SheetError::Nothing)));
    let odd = solid(30, 20, 0.0);
    let mixed = [panels[0].clone(), Panel { title: String::new(), lines: Vec::new(), picture: &odd }];
    assert!(matches!(sheet("scene", &mixed, crop, layout), Err(SheetError::Sizes)));
    let outside = Crop { x: 290, ..crop };
    assert!(matches!(sheet("scene", &panels, outside, layout), Err(SheetError::Crop { .. })));
}

#[test]
fn titles_are_drawn_and_cut_to_their_room() {
    let text = |words: &str, width: u32| {
        let mut canvas = Canvas::new(200, 24, [255; 3]).unwrap();
        canvas.text(words, canvas::Text::Small, 0, 0, width, [0; 3]);
        canvas
    };
    let right_end = |canvas: &Canvas| {
        (0..canvas.pixels().len()).filter(|&i| canvas.pixels()[i] != [255; 3]).map(|i| i % 200).max().unwrap_or(0)
    };
    let full = text("supersample:10", 200);
    assert!(full.pixels().contains(&[0; 3]) || full.pixels().iter().any(|p| p[0] < 40), "dark ink");
    assert!(right_end(&full) > 90);
    let cut = text("supersample:10", 60);
    assert!(right_end(&cut) < 60);
    // What just fits is not cut.
    assert_eq!(text("abc", 3 * canvas::Text::Small.advance()), text("abc", 200));
    // Beyond ASCII: a question mark, no gap and no panic.
    assert_eq!(text("\u{4e16}", 200), text("?", 200));
    assert_eq!(right_end(&text("abc", 0)), 0);
}

#[test]
fn flip_through_keeps_pictures_in_place() {
    let pictures = [0.0, 1.0].map(|v| solid(400, 20, v));
    let panels: Vec<_> =
        pictures.iter().map(|picture| Panel { title: "m".into(), lines: vec!["l".into()], picture }).collect();
    let frames = flip_through(&panels).unwrap();
    assert!(frames[0].pixels()[..400 * 20].iter().all(|&p| p == [0; 3]));
    assert!(frames[1].pixels()[..400 * 20].iter().all(|&p| p == [255; 3]));
    let (_, _, images) = decode(&animation(&frames, 700).unwrap());
    assert_eq!(images.len(), 2);
    assert_eq!(images[1], frames[1].pixels().as_flattened());
    assert!(animation(&[], 1).is_err());
    assert!(animation(&[frames[0].clone(), Canvas::new(3, 3, [0; 3]).unwrap()], 1).is_err());
}

#[test]
fn too_large_is_an_error() {
    for (width, height) in [(0, 1), (1 << 20, 1 << 20), (u64::MAX, u64::MAX)] {
        assert!(matches!(Canvas::new(width, height, [0; 3]), Err(SheetError::Large { .. })));
    }
}

/// The runs of rows that are not all paper.
fn bands(canvas: &Canvas) -> Vec<std::ops::Range<usize>> {
    let mut bands: Vec<std::ops::Range<usize>> = Vec::new();
    for (y, row) in canvas.pixels().chunks(canvas.width() as usize).enumerate() {
        match bands.last_mut() {
            _ if row.iter().all(|&pixel| pixel == [250, 250, 248]) => {}
            Some(band) if band.end == y => band.end = y + 1,
            _ => bands.push(y..y + 1),
        }
    }
    bands
}

/// Each band lies in the line that is meant for it; letters need not fill it.
#[track_caller]
fn assert_lines(canvas: &Canvas, lines: &[std::ops::Range<usize>]) {
    let bands = bands(canvas);
    let fits = bands.iter().zip(lines).all(|(band, line)| line.start <= band.start && band.end <= line.end);
    assert!(bands.len() == lines.len() && fits, "{bands:?}, expected {lines:?}");
}

#[test]
fn labels_pictures_and_crops_have_their_places() {
    let picture = solid(400, 100, 0.25);
    let panel = Panel { title: "mode:8".into(), lines: vec!["8 samples".into(); 2], picture: &picture };
    let crop = Crop { x: 100, y: 50, width: 80, height: 20 };
    let canvas = sheet("scene", std::slice::from_ref(&panel), crop, Layout::default()).unwrap();
    assert_lines(&canvas, &[12..32, 44..64, 68..84, 88..104, 108..208, 214..314]);
    assert_eq!((canvas.width(), canvas.height()), (424, 338));
    assert_lines(&flip_through(&[panel]).unwrap()[0], &[0..100, 106..126, 130..146, 150..166]);
}
