//! Texts of points: what the columns of `.xyz` and `.pts` mean, how they are known, and what is refused.

use glam::{DVec3, Vec3};
use splatblur::model::{Cloud, ColourStorage, ModelFormat, Parsed, parse};

use super::support::refused;

fn cloud(text: &str, format: ModelFormat) -> Cloud {
    match parse(text.as_bytes(), format).unwrap() {
        Parsed::Cloud(cloud) => cloud,
        Parsed::Surfels(_) | Parsed::Grid(_) => panic!("no cloud"),
    }
}

fn xyz(text: &str) -> Cloud {
    cloud(text, ModelFormat::Xyz)
}

fn pts(text: &str) -> Cloud {
    cloud(text, ModelFormat::Pts)
}

#[test]
fn separators_comments_and_line_ends() {
    let plain = xyz("1 2 3\n4 5 6\n").position;
    assert_eq!(plain, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)]);
    for text in [
        "1,2,3\r\n4, 5, 6",
        "1;2;3\r4\t5\t6\r",
        "\u{feff}# a comment\n\n  1 2 3 // the first\n4 5 6 # the last\n",
        "//X Y Z\n1 2 3\n4 5 6\n",
        "x y z\n1e0 +2. 3.0\n4 5 .6e1\n",
    ] {
        assert_eq!(xyz(text).position, plain, "{text:?}");
    }
    assert_eq!(xyz("x y z\n1 2 3\n").notes, ["line 1 names the columns: x, y, z"]);
}

#[test]
fn six_numbers_are_a_colour_or_a_normal() {
    let red = xyz("0 0 0 255 0 0\n1 0 0 0 51 0\n");
    assert_eq!((red.colour[0], red.colour[1].y, red.colour_storage), (Vec3::X, 0.2, ColourStorage::Integer));
    assert_eq!(red.notes, ["columns 4 to 6 are colours from 0 to 255"]);
    let normal = xyz("0 0 0 0 0.6 -0.8\n1 0 0 0 0 1\n");
    assert_eq!((normal.normal[1], normal.colour.len()), (Vec3::Z, 0));
    assert!((normal.normal[0] - Vec3::new(0.0, 0.6, -0.8)).length() < 1e-6);
    assert_eq!(normal.notes, ["columns 4 to 6 are normals"]);
    // Of length 1, though none is negative.
    assert_eq!(xyz("0 0 0 0 0 1\n1 0 0 1 0 0\n").normal, [Vec3::Z, Vec3::X]);
    // No number is negative and the lengths differ: light, not directions.
    let float = xyz("0 0 0 0.2 0.2 0.2\n1 0 0 1 1 1\n");
    assert_eq!((float.colour[1], float.colour_storage), (Vec3::ONE, ColourStorage::Float));
    // In a .pts file there are no normals.
    assert_eq!(pts("1\n0 0 0 0 0 1\n").colour, [Vec3::Z]);
}

#[test]
fn seven_and_nine_numbers() {
    let seven = xyz("0 0 0 0.5 255 0 0\n0 0 1 0.5 0 255 0\n");
    assert_eq!(seven.colour, [Vec3::X, Vec3::Y]);
    for text in ["1 2 3 0 0 1 255 0 0\n1 2 4 0 -1 0 0 0 255\n", "1 2 3 255 0 0 0 0 1\n1 2 4 0 0 255 0 -1 0\n"] {
        let nine = xyz(text);
        assert_eq!((nine.colour, nine.normal), (vec![Vec3::X, Vec3::Z], vec![Vec3::Z, -Vec3::Y]), "{text}");
    }
}

#[test]
fn intensity_is_grey_where_there_is_no_colour() {
    let grey = |text: &str| xyz(text).colour.iter().map(|c| c.x).collect::<Vec<_>>();
    assert_eq!(grey("0 0 0 0.25\n0 0 1 1\n"), [0.25, 1.0]);
    assert_eq!(grey("0 0 0 51\n0 0 1 255\n"), [0.2, 1.0]);
    assert_eq!(grey("0 0 0 1000\n0 0 1 250\n"), [1.0, 0.25]);
    assert_eq!(grey("0 0 0 -2048\n0 0 1 2047\n"), [0.0, 1.0]);
    assert_eq!(xyz("0 0 0 -2048\n").notes, ["no colours: intensity from -2048 to 2047 is shown as grey"]);
}

#[test]
fn counts_are_held_to() {
    assert_eq!(pts("2\n0 0 0\n1 1 1\n").position.len(), 2);
    assert_eq!(pts("1\n0 0 0\n 0 \n2\n1 1 1\n2 2 2\n").position.len(), 3);
    for (text, expected) in [
        ("3\n0 0 0\n", "line 1: found 2 points less than this line counts, expected as many lines as it counts"),
        ("1\n0 0 0\n1 1 1\n", "line 3: found 3 words, expected the number of points, alone in its line"),
        ("-1\n0 0 0\n", "line 1: found `-1`, expected the number of points"),
        ("18446744073709551616\n0 0 0\n", "line 1: found `18446744073709551616`"),
        ("18446744073709551615\n0 0 0\n", "line 1: found 18446744073709551614 points less"),
        ("0 0 0\n", "line 1: found 3 words, expected the number of points"),
        ("", "line 1: found no point in the whole file"),
    ] {
        let e = refused(text.as_bytes(), ModelFormat::Pts).to_string();
        assert!(e.contains(expected), "{e}\n  expected {expected}");
    }
}

#[test]
fn lines_that_are_refused() {
    for (text, expected) in [
        ("1 2\n", "line 1: found 2 numbers, expected x y z and then"),
        ("1\n", "line 1: found one number, expected x y z"),
        ("1 2 3\n\n1 2 3 4\n", "line 3: found 4 numbers, expected 3 numbers, as in line 1"),
        ("1 2 3\n1 2 three\n", "line 2: found `three`, expected a number"),
        ("x y z\nd e f\n", "line 2: found `d`, expected a number"),
        ("a b c\n1 2 3\n", "line 1: found names of columns without x (a, b, c), expected x, y and z among them"),
        ("1 2 3 4 5\n", "line 1: found 5 numbers"),
        ("0 0 0 10 20 30\n0 0 0 10 20 256\n", "line 2: found a colour from 10 to 256, expected numbers from 0 to 255"),
        ("0 0 0 10 20 -30\n", "line 1: found a colour from -30 to 20"),
        ("# nothing\n", "line 1: found no point in the whole file"),
        (&"1 ".repeat(1 << 20), "line 1: found more than 9 numbers"),
    ] {
        let e = refused(text.as_bytes(), ModelFormat::Xyz).to_string();
        assert!(e.contains(expected), "{e}\n  expected {expected}");
        assert!(e.len() < 300, "{e}");
    }
}

#[test]
fn content_shows_the_format_before_the_name() {
    let detect = |text: &str, name: &str| ModelFormat::detect(text.as_bytes(), name.as_ref());
    assert_eq!(detect("1 2 3\n", "a.txt"), Some(ModelFormat::Xyz));
    assert_eq!(detect("1\n1 2 3\n", "a.asc"), Some(ModelFormat::Pts));
    assert_eq!(detect("1\n1 2 3\n", "a.xyz"), Some(ModelFormat::Pts));
    assert_eq!(detect("# no count\n1 2 3 4\n", "a.PTS"), Some(ModelFormat::Xyz));
    assert_eq!(detect("x y z\n1 2 3\n", "a.XYZ"), Some(ModelFormat::Xyz));
    // Names of columns show it, too, where the next line is a point of as many words.
    assert_eq!(detect("name,x,y,z\nfirst,1,2,3\n", "a.csv"), Some(ModelFormat::Xyz));
    assert_eq!(detect("// X Y Z\n1 2 3\n", "a.csv"), Some(ModelFormat::Xyz));
    assert_eq!(detect("x y z\none two three\n", "a.dat"), None);
    assert_eq!(detect("x y z\n1 2 3 4\n", "a.dat"), None);
    assert_eq!(detect("# x y z w\nv 1 2 3\n", "a.dat"), None);
    // A file that is called a table is read as one, so that its error says what is wrong.
    assert_eq!(detect("x y z\none two three\n", "a.csv"), Some(ModelFormat::Xyz));
    assert_eq!(detect("", "a.pts"), Some(ModelFormat::Pts));
    assert_eq!(detect("v 1 2 3\n", "a.obj"), Some(ModelFormat::Obj));
    assert_eq!(detect("ply\n", "a.xyz"), Some(ModelFormat::Ply));
    for (text, name) in [("", "a.txt"), ("one two three\n", "a.txt"), ("1 2\n", "a"), ("3\nwater\nH 0 0 0\n", "a.txt")]
    {
        assert_eq!(detect(text, name), None, "{text:?}");
    }
    // The head that is looked at ends within a word.
    assert_eq!(detect(&"1 2 3\n".repeat(4000), "a"), Some(ModelFormat::Xyz));
}
