//! Tests of the reader: units, addresses, dialects, errors, hostile input.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use proptest::prelude::*;

use super::*;
use crate::anim::{Interpolation, load};

const MAYA: Interpolation = Interpolation::Maya;

fn read(text: &str) -> Animation {
    parse(text.as_bytes(), Path::new("t.anim")).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn refusal(bytes: &[u8]) -> AnimError {
    parse(bytes, Path::new("t.anim")).expect_err("must be refused")
}

#[track_caller]
fn refused(text: &str, message: &str) {
    assert_eq!(refusal(text.as_bytes()).to_string(), message);
}

/// A file with `header` after the version and one curve of `attribute` of node `n`.
fn with(header: &str, attribute: &str, data: &str) -> String {
    format!("animVersion 1.1;\n{header}\nanim {attribute} {attribute} n 0 1 0;\nanimData {{\n{data}\n}}\n")
}

/// One translateX curve with the given words in `keys`.
fn keyed(keys: &str) -> String {
    with("", "translateX", &format!("keys {{\n{keys}\n}}"))
}

#[track_caller]
fn value(animation: &Animation, time: f64) -> f64 {
    animation.nodes[0].values(time, MAYA).next().expect("a curve")
}

#[track_caller]
fn close(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "{a} {b}");
}

/// Compares slopes that were found by a small step.
#[track_caller]
fn slope_close(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-5 * b.abs().max(1.0), "{a} {b}");
}

#[test]
fn time_units_set_the_rate() {
    let a =
        read(&with("timeUnit pal;", "translateX", "keys { 0 0 linear linear 1 1 0;\n 25 1 linear linear 1 1 0;\n }"));
    assert_eq!(a.rate, 25.0);
    close(a.nodes[0].at(0.5, MAYA).transform.translate.x, 0.5);
    assert_eq!(a.range(), (0.0, 1.0));
    assert_eq!(a.key_range(), (0.0, 25.0));
    // Without a unit the rate is that of film, and a note says so.
    let b = read(&keyed("24 3 flat flat 1 1 0;"));
    assert_eq!((b.rate, b.range()), (24.0, (1.0, 1.0)));
    assert!(b.notes.iter().any(|n| n.contains("film")), "{:?}", b.notes);
}

#[test]
fn linear_and_angular_units_are_converted_with_their_tangents() {
    for (unit, cm) in [("mm", 0.1), ("m", 100.0), ("inch", 2.54)] {
        let data = "output linear; keys { 0 0 fixed fixed 1 1 0 45 1 45 1;\n 10 4 fixed fixed 1 1 0 -30 1 -30 1;\n }";
        let own = read(&with(&format!("linearUnit {unit};"), "translateX", data));
        let plain = read(&with("", "translateX", data));
        for t in [0.0, 2.5, 6.0, 10.0] {
            close(value(&own, t), cm * value(&plain, t));
        }
        // At the start the slope is 1 unit per frame.
        slope_close(value(&own, 1e-6) / 1e-6, cm);
    }
    // The tangent angle is written in the angular unit as well.
    let data = "output angular; keys { 0 0 fixed fixed 1 1 0 0.5 1 0.5 1;\n 10 3 flat flat 1 1 0;\n }";
    let radians = read(&with("angularUnit rad;", "rotateY", data));
    close(value(&radians, 10.0), 3f64.to_degrees());
    slope_close(value(&radians, 1e-6) / 1e-6, libm::tan(0.5).to_degrees());
    close(radians.nodes[0].at(10.0 / 24.0, MAYA).transform.rotate.y, 3.0);
    // Plain numbers have no unit.
    let scale = "output unitless; keys { 0 7 flat flat 1 1 0; }";
    close(value(&read(&with("linearUnit m; angularUnit rad;", "scaleX", scale)), 0.0), 7.0);
    // Without `output`, a rotation is an angle and everything else a length.
    let bare = "keys { 0 2 flat flat 1 1 0; }";
    close(value(&read(&with("linearUnit m; angularUnit min;", "rotateX", bare)), 0.0), 2.0 / 60.0);
    close(value(&read(&with("linearUnit m; angularUnit min;", "translateX", bare)), 0.0), 200.0);
}

#[test]
fn units_of_a_verbose_curve_override_the_header() {
    let data = "output linear; inputUnit sec; outputUnit m; tangentAngleUnit rad;\n\
                keys { 0 0 fixed fixed 1 1 0 0.5 1 0.5 1;\n 2 3 flat flat 1 1 0;\n }";
    let a = read(&with("timeUnit film; linearUnit mm;", "translateX", data));
    assert_eq!((a.rate, a.key_range()), (24.0, (0.0, 48.0)));
    close(value(&a, 48.0), 300.0);
    slope_close(value(&a, 1e-6) / 1e-6, libm::tan(0.5) * 100.0 / 24.0);
    // Also behind the keys.
    let late = "output angular; keys { 0 0 fixed fixed 1 1 0 0.5 1 0.5 1;\n 9 1 flat flat 1 1 0;\n }\n\
                outputUnit rad; tangentAngleUnit rad;";
    let b = read(&with("", "rotateX", late));
    close(value(&b, 9.0), 1f64.to_degrees());
    slope_close(value(&b, 1e-6) / 1e-6, libm::tan(0.5).to_degrees());
}

#[test]
fn unknown_units_are_refused() {
    refused(
        &with("timeUnit frames;", "translateX", ""),
        &format!("t.anim:2: unknown timeUnit `frames` (known: {})", units::TIME_UNITS),
    );
    for (word, unit) in [("linearUnit", "parsec"), ("angularUnit", "turn")] {
        let error = refusal(with(&format!("{word} {unit};"), "translateX", "").as_bytes()).to_string();
        assert!(error.contains(&format!("unknown {word} `{unit}`")), "{error}");
    }
    let error = refusal(with("", "translateX", "inputUnit cm; keys { }").as_bytes()).to_string();
    assert!(error.starts_with("t.anim:5: unknown inputUnit `cm`"), "{error}");
}

#[test]
fn the_four_forms_of_an_address() {
    let data = "animData { keys { 1 2 flat flat 1 1 0; } }\n";
    let text = format!(
        "animVersion 1.1;\n\
         anim placeholder 0 0 0;\n\
         anim translate.translateX translateX |grp|ns:ball 0 1 0; {data}\
         anim \"a b\" visibility \"my node\" 0 1 0;\n{data}\
         anim scale.scaleX 0 1 0;\n{data}\
         anim 0 1 0;\n{data}\
         anim translate.translateY translateY |grp|ns:ball 0 1 0;\n\
         animData\n{{\nkeys\n{{\n1 9 flat flat 1 1 0\n}}\n}}\n\
         anim last 3 0 0;"
    );
    let a = read(&text);
    let nodes: Vec<(&str, Vec<&str>)> = a.nodes.iter().map(|n| (n.name.as_str(), n.attributes().collect())).collect();
    assert_eq!(
        nodes,
        [("|grp|ns:ball", vec!["translateX", "translateY"]), ("my node", vec!["visibility"]), ("", vec!["scaleX"]),]
    );
    assert!(a.notes.iter().any(|n| n.contains("drives no attribute")), "{:?}", a.notes);
    let header = a.csv([1.0], MAYA);
    assert_eq!(
        header,
        "frame,|grp|ns:ball.translateX,|grp|ns:ball.translateY,my node.visibility,scaleX\n\
         1,2.000000,9.000000,2.000000,2.000000\n"
    );
    refused(
        "animVersion 1.1;\nanim a b 0 1 0;",
        "t.anim:2: found address `a b 0 1 0`, expected FULLATTR LEAFATTR NODE, one name or none, then three integers",
    );
    assert!(refusal(b"animVersion 1.1;\nanim a b c;").to_string().starts_with("t.anim:2: found address `a b c`"));
    assert!(refusal(b"animVersion 1.1;\nanim;").to_string().contains("address ``"));
}

#[test]
fn nodes_are_chosen_by_name_or_by_being_first() {
    let curve = |attribute: &str, node: &str| {
        format!("anim {attribute} {attribute} {node} 0 0 0; animData {{ keys {{ 1 2 flat flat 1 1 0;\n }} }}\n")
    };
    let text = ["animVersion 1.1;\n".to_owned(), curve("intensity", "lamp"), curve("visibility", "ghost")].concat();
    let a = read(&text);
    assert_eq!(a.node(None).expect("visibility will do").name, "ghost");
    let b =
        read(&[text, curve("rotateX", "|g|a:ball"), curve("scaleX", "|h|ball"), curve("scaleX", "c:cube")].concat());
    assert_eq!(b.node(None).expect("first with a transform").name, "|g|a:ball");
    assert_eq!(b.node(Some("lamp")).expect("exact").name, "lamp");
    assert_eq!(b.node(Some("|h|ball")).expect("exact").name, "|h|ball");
    assert_eq!(b.node(Some("cube")).expect("short").name, "c:cube");
    let known = "lamp, ghost, |g|a:ball, |h|ball, c:cube";
    let error = b.node(Some("ball")).expect_err("two of them").to_string();
    assert_eq!(error, format!("t.anim has several nodes named `ball`; give the full path (it has: {known})"));
    let error = b.node(Some("nobody")).expect_err("unknown").to_string();
    assert_eq!(error, format!("t.anim has no node `nobody` (it has: {known})"));
    assert!(b.notes.iter().any(|n| n.contains("|g|a:ball, |h|ball, c:cube; where none is named")), "{:?}", b.notes);
    assert!(b.notes.iter().any(|n| n.ends_with("ignored: intensity")), "{:?}", b.notes);
    let only_lamp = read(&["animVersion 1.1;\n".to_owned(), curve("intensity", "lamp")].concat());
    assert!(only_lamp.node(None).expect_err("nothing moves").to_string().contains("nodes: lamp"));
}

#[test]
fn versions_differ_in_the_breakdown_column_and_in_weighting() {
    // Only the out tangent has a pair. Its angle is 45 degrees.
    let body = |keys: &str, data: &str| {
        format!("anim tx translateX n 0 1 0; animData {{ {data} keys {{ {keys}\n 10 0 flat flat 1 1 0;\n }} }}")
    };
    let old = |data: &str| read(&format!("animVersion 1.0;{}", body("0 0 flat fixed 1 1 45 9", data)));
    let new = |data: &str| read(&format!("animVersion 1.1;{}", body("0 0 flat fixed 1 1 0 45 9", data)));
    for t in [1.0, 3.0, 7.0] {
        close(value(&old("weighted 1;"), t), value(&new("weighted 1;"), t));
        close(value(&old("weighted 0;"), t), value(&new("weighted 0;"), t));
        // The default.
        assert_eq!(value(&old(""), t), value(&old("weighted 1;"), t));
        assert_eq!(value(&new(""), t), value(&new("weighted 0;"), t));
        assert!((value(&old(""), t) - value(&new(""), t)).abs() > 0.1);
    }
    let future = read(&keyed("0 1 flat flat 1 1 0;").replace("1.1", "2.7"));
    assert_eq!(future.notes[0], "animVersion 2.7 is read as 1.1");
    close(value(&future, 0.0), 1.0);
}

#[test]
fn fixed_pairs_stand_only_where_they_belong() {
    let slopes = |key: &str| {
        let a = read(&keyed(&format!("-10 0 flat flat 1 1 0;\n{key}\n10 0 flat flat 1 1 0;")));
        let h = 1e-7;
        let round = |slope: f64| (slope * 1e3).round() / 1e3;
        (round((value(&a, 0.0) - value(&a, -h)) / h), round((value(&a, h) - value(&a, 0.0)) / h))
    };
    assert_eq!(slopes("0 5 fixed flat 1 1 0 45 1;"), (1.0, 0.0));
    assert_eq!(slopes("0 5 flat fixed 1 1 0 45 1;"), (0.0, 1.0));
    assert_eq!(slopes("0 5 fixed fixed 0 1 0 -45 1 45 0;"), (-1.0, 1.0));
    // A non-weighted curve takes only the slope: a weight of 0 or of a third changes nothing.
    assert_eq!(slopes("0 5 fixed fixed 1 1 0 45 0 45 0.3333;"), (1.0, 1.0));
    // Locks and breakdown do nothing, and a breakdown may be missing where nothing follows it.
    assert_eq!(slopes("0 5 linear linear 0 0 1;"), (0.5, -0.5));
    assert_eq!(slopes("0 5 linear linear 0 0;"), (0.5, -0.5));
    let layout = "TIME VALUE INTANGENT OUTTANGENT LOCK LOCK, and an angle and a weight for each fixed tangent";
    for (key, words) in [
        ("0 5 linear", 3),
        ("0 5 linear linear 1", 5),
        ("0 5 fixed fixed 1 1 0 45 1 45", 10),
        ("0 5 flat fixed 1 1 0", 7),
    ] {
        refused(&keyed(key), &format!("t.anim:6: found a key of {words} words, expected {layout}"));
    }
}

#[test]
fn every_tangent_word_is_understood() {
    // The slope is 0.5 before the middle key and 2 after it; the times are uneven.
    let slope = |name: &str| {
        let a = read(&keyed(&format!("0 0 flat flat 1 1 0;\n2 1 {name} {name} 1 1 0;\n6 9 flat flat 1 1 0;")));
        assert_eq!(a.notes.iter().filter(|n| n.contains("tangent")).count(), usize::from(name == "wobbly"), "{name}");
        ((value(&a, 2.0 + 1e-7) - value(&a, 2.0)) / 1e-7 * 1e3).round() / 1e3
    };
    for name in ["linear", "slow", "fast"] {
        assert_eq!(slope(name), 2.0, "{name}");
    }
    for name in ["spline", "clamped", "plateau", "auto", "global", "autocustom", "AutoCustom", "wobbly"] {
        assert_eq!(slope(name), 1.5, "{name}");
    }
    for name in ["flat", "step"] {
        assert_eq!(slope(name), 0.0, "{name}");
    }
    assert_eq!(slope("automix"), 1.0);
    assert_eq!(slope("autoMix"), 1.0);
    // Ease: part 1/3 becomes 7/27, so the slope is 0.5 + 1.5 * 7/27.
    assert_eq!(slope("AutoEase"), 0.889);
    let next = read(&keyed("0 0 flat stepnext 1 1 0;\n2 1 flat flat 1 1 0;"));
    assert_eq!((value(&next, 0.0), value(&next, 0.1)), (0.0, 1.0));
}

#[test]
fn tangents_of_maya_2_are_in_internal_units() {
    // 48 cm a second are 2 cm, or 0.02 m, a frame; one radian a second is 1/24 radian a frame.
    let slope = |header: &str, attribute: &str, output: &str, tangent: f64| {
        let angle = libm::atan(tangent).to_degrees();
        let keys = format!(
            "output {output}; keys {{ 0 0 fixed fixed 1 1 0 {angle} 1 {angle} 1;\n 900 0 flat flat 1 1 0;\n }}"
        );
        let header = format!("{header} mayaVersion 2.5 IRIX; timeUnit film;");
        value(&read(&with(&header, attribute, &keys)), 1e-6) / 1e-6
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} {b}");
    near(slope("", "translateX", "linear", 48.0), 2.0);
    near(slope("linearUnit m;", "translateX", "linear", 48.0), 2.0);
    near(slope("", "rotateX", "angular", 1.0), 1f64.to_degrees() / 24.0);
    near(slope("", "scaleX", "unitless", 24.0), 1.0);
    // "2014" and free text do not mean version 2.
    for version in ["2014 x64", "Maya Unlimited 8.5", "20.5"] {
        let keys = "keys { 0 0 fixed fixed 1 1 0 45 1 45 1;\n 900 0 flat flat 1 1 0;\n }";
        near(value(&read(&with(&format!("mayaVersion {version};"), "translateX", keys)), 1e-6) / 1e-6, 1.0);
    }
}

#[test]
fn infinities_are_read() {
    let at = |pre: &str, post: &str, t: f64| {
        let keys = "keys { 0 0 linear linear 1 1 0;\n 10 5 linear linear 1 1 0;\n }";
        value(&read(&with("", "translateX", &format!("preInfinity {pre}; postInfinity {post};{keys}"))), t)
    };
    for (rule, before, after) in [
        ("constant", 0.0, 5.0),
        ("linear", 0.0, 5.0),
        ("cycle", 4.0, 1.0),
        ("cycleRelative", -1.0, 6.0),
        ("oscillate", 1.0, 4.0),
        ("bounce", 0.0, 5.0),
    ] {
        close(at(rule, "constant", -2.0), before);
        close(at("constant", rule, 12.0), after);
    }
    let a = read(&with("", "translateX", "preInfinity bounce; keys { 0 0 linear linear 1 1 0; }"));
    assert!(a.notes[0].contains("infinity `bounce`"), "{:?}", a.notes);
}

#[test]
fn curves_not_over_time_are_skipped() {
    let driven = "input unitless; inputUnit cm; keys { 0 0 flat flat 1 1 0; }";
    refused(
        &with("", "translateX", driven),
        "t.anim holds no usable curve: expected at least one curve over time that has keys \
         (n.translateX is driven by another value, not by time, and was skipped)",
    );
    let both = with("", "translateX", driven)
        + "anim s scaleX n 0 1 1; animData { input time; keys { 0 3 flat flat 1 1 0; } }";
    let a = read(&both);
    assert_eq!(a.nodes[0].attributes().collect::<Vec<_>>(), ["scaleX"]);
    assert!(a.notes[0].starts_with("n.translateX is driven"));
    refused("animVersion 1.1;", "t.anim holds no usable curve: expected at least one curve over time that has keys");
    for data in ["keys { }", ""] {
        let error = refusal(with("", "translateX", data).as_bytes()).to_string();
        assert!(error.contains("n.translateX has no keys"), "{error}");
    }
}

#[test]
fn unknown_words_are_noted_and_skipped() {
    let text = "animVersion 1.1;\nsceneName a b c;\ntimeUnit pal;\nfoo { bar { 1 2; } }\n{ x }\n\
                anim t translateX n 0 1 0;\n\
                animData {\n movData 3;\n extra { keys { 9 9; } }\n keys { 0 3 flat flat 1 1 0; }\n}";
    let a = read(text);
    // The header ended at the first unknown word.
    assert_eq!(a.rate, 24.0);
    close(value(&a, 0.0), 3.0);
    for word in ["sceneName", "timeUnit", "foo", "movData", "extra"] {
        assert!(a.notes.iter().any(|n| n.starts_with(&format!("`{word}`"))), "{word}: {:?}", a.notes);
    }
    assert!(a.notes.iter().any(|n| n.starts_with("a block without a name")));
    let mut many = keyed("0 3 flat flat 1 1 0;");
    (0..100_000).for_each(|i| write!(many, "w{i};").expect("a string"));
    let notes = read(&many).notes;
    assert!(notes.len() < MAX_NOTES + 3 && notes.contains(&"further notes are left out".to_owned()), "{notes:?}");
}

#[test]
fn a_second_curve_of_an_attribute_replaces_the_first() {
    let one = "anim t translateX n 0 1 0; animData { keys { 0 3 flat flat 1 1 0; } }";
    let a = read(&format!("animVersion 1.1;{one}{}", one.replace("0 3", "0 4")));
    assert_eq!(value(&a, 0.0), 4.0);
    assert_eq!(a.notes[0], "n.translateX has several curves; the last one counts");
}

#[test]
fn bytes_of_other_systems() {
    let text = keyed("1 2 linear linear 1 1 0; # done\n// more\n3 4 linear linear 1 1 0;");
    let expected = value(&read(&text), 2.0);
    close(expected, 3.0);
    for variant in
        [text.replace('\n', "\r\n"), text.replace('\n', "\r"), format!("\u{feff}{text}"), text.replace(' ', "\t")]
    {
        assert_eq!(value(&read(&variant), 2.0), expected);
    }
    let latin = text.replace(" n 0", " b\u{e4}ll 0");
    let bytes: Vec<u8> = latin.chars().map(|c| c as u8).collect();
    assert_eq!(parse(&bytes, Path::new("t.anim")).expect("Latin-1").nodes[0].name, "b\u{e4}ll");
    assert_eq!(read(&latin).nodes[0].name, "b\u{e4}ll");
}

#[test]
fn other_formats_are_refused_by_name() {
    let unity = "%YAML 1.1\n%TAG !u! tag:unity3d.com,2011:\n--- !u!74 &7400000\nAnimationClip:\n";
    refused(
        unity,
        "t.anim is a Unity animation clip (YAML); expected Maya's .anim format, which begins with `animVersion`",
    );
    assert!(matches!(refusal(format!("\u{feff}\n{unity}").as_bytes()), AnimError::Unity { .. }));
    refused("\n\natomVersion 1.0;", "t.anim:3: not a Maya .anim file: found `atomVersion`, expected `animVersion`");
    refused("", "t.anim:1: not a Maya .anim file: found an empty file, expected `animVersion`");
    refused("{", "t.anim:1: not a Maya .anim file: found a brace, expected `animVersion`");
    let utf16: Vec<u8> = "\u{feff}animVersion 1.1;".encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(refusal(&utf16).to_string().contains("binary data or UTF-16 text"));
}

#[test]
fn numbers_are_never_guessed() {
    for (key, found) in
        [("0 1,234.567000 linear linear 1 1 0;", "1,234.567000"), ("0,5 1 linear linear 1 1 0;", "0,5"), ("1,", "1,")]
    {
        let error = refusal(keyed(key).as_bytes()).to_string();
        let start = format!("t.anim:6: found `{found}`, expected a number with a decimal point and no comma");
        assert!(error.starts_with(&start), "{error}");
    }
    let error = refusal(keyed("0 1 fixed flat 1 1 0 45,5 1;").as_bytes());
    assert!(matches!(error, AnimError::Comma { .. }));
    for number in ["nan", "inf", "-1e31", "1.#INF"] {
        for key in [
            format!("{number} 1 flat flat 1 1 0;"),
            format!("1 {number} flat flat 1 1 0;"),
            format!("1 1 flat fixed 1 1 0 {number} 1;"),
            format!("1 1 fixed flat 1 1 0 1 {number};"),
        ] {
            let error = refusal(keyed(&key).as_bytes());
            assert!(matches!(error, AnimError::NotFinite { .. }), "{key}: {error}");
        }
    }
    refused(&with("startTime soon;", "translateX", ""), "t.anim:2: found `soon`, expected a number");
}

#[test]
fn broken_grammar_names_the_place() {
    let whole = keyed("1 2 flat flat 1 1 0;");
    let end = "the end of the file";
    for (text, line, found, expected) in [
        ("animVersion;".to_owned(), 1, "the end of the statement", "a version such as 1.1"),
        (whole.replace("\n}\n}", "\n"), 8, end, "a key or `}`"),
        (whole.replace("\n}\n}", "\n}\n"), 9, end, "a word of animData or `}`"),
        (whole.clone() + "}", 9, "`}`", "`anim` or the end of the file"),
        (whole.replace("animData {", "animData"), 5, "`keys`", "`{` after animData"),
        (whole.replace("keys {", "keys"), 6, "`1`", "`{` after keys"),
        (whole.replace("keys {", "keys { {"), 5, "`{`", "a key or `}`"),
        (whole.replace("keys {", "weighted 2; keys {"), 5, "`2`", "0 or 1"),
        (whole.replace("keys {", "input; keys {"), 5, "the end of the statement", "time or unitless"),
        (whole.replace("keys {", "output cubic; keys {"), 5, "`cubic`", "linear, angular, unitless or time"),
        ("animVersion 1.1;\nanimData { }".to_owned(), 2, "`animData`", "`anim` with the address of the curve first"),
        ("animVersion 1.1;\nfoo { {\n }".to_owned(), 3, end, "`}`"),
    ] {
        refused(&text, &format!("t.anim:{line}: found {found}, expected {expected}"));
    }
}

#[test]
fn many_keys_are_read_and_evaluated_quickly() {
    let mut keys = String::new();
    // Falling times are the worst order for a reader that inserts.
    for i in (0..60_000).rev() {
        writeln!(keys, "{i} {} auto auto 1 1 0;", i % 7).expect("a string");
    }
    let start = Instant::now();
    let a = read(&keyed(&keys));
    assert_eq!(a.nodes[0].key_count(), 60_000);
    for i in 0..100_000 {
        let v = value(&a, f64::from(i) * 0.6);
        assert!((0.0..=6.0).contains(&v));
    }
    assert!(a.nodes[0].breaks(0.0, 2500.0, MAYA).is_empty());
    // It takes 20 ms on a slow computer; a quadratic reader takes minutes.
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
}

#[test]
fn load_refuses_what_is_not_a_plain_file_of_sane_size() {
    let folder = tempfile::tempdir().expect("a folder");
    assert!(matches!(load(folder.path()), Err(AnimError::NotAFile { .. })));
    assert!(matches!(load(&folder.path().join("none.anim")), Err(AnimError::Read { .. })));
    let large = folder.path().join("large.anim");
    // The file is sparse, so it takes no room on the disk.
    std::fs::File::create(&large).and_then(|f| f.set_len((256 << 20) + 1)).expect("a sparse file");
    assert!(matches!(load(&large), Err(AnimError::TooLarge { .. })));
    let good = folder.path().join("good.anim");
    std::fs::write(&good, keyed("1 2 flat flat 1 1 0;")).expect("written");
    assert_eq!(load(&good).expect("valid").path, good);
    #[cfg(unix)]
    assert!(matches!(load(Path::new("/dev/zero")), Err(AnimError::NotAFile { .. })));
}

const REAL: [&str; 5] = [
    include_str!("../../../tests/data/anim/extrapolate_cube.anim"),
    include_str!("../../../tests/data/anim/interpolation_modes.anim"),
    include_str!("../../../animations/bouncing.anim"),
    include_str!("../../../animations/drift_linear_infinity.anim"),
    include_str!("../../../animations/oscillate_swing.anim"),
];

/// Calls everything that a reader of the file would call.
fn exercise(bytes: &[u8]) {
    let Ok(a) = parse(bytes, Path::new("p.anim")) else { return };
    for mode in [MAYA, Interpolation::Linear, Interpolation::Spline] {
        for node in &a.nodes {
            let (first, last) = node.key_range();
            assert!(first.is_finite() && last >= first && a.range().0.is_finite());
            for t in [first, last, 0.5 * (first + last), first - 1.3, last + 7.7, -1e8, 1e8, 0.0, 1.25, 33.4] {
                assert!(node.values(t, mode).all(f64::is_finite), "{t} {mode:?}");
                let state = node.at(t / a.rate, mode).transform;
                assert!(state.translate.is_finite() && state.rotate.is_finite() && state.scale.is_finite());
            }
            let breaks = node.breaks(-1.0, 3.0, mode);
            assert!(breaks.is_sorted() && breaks.iter().all(|t| *t > -1.0 && *t < 3.0));
        }
    }
    assert_eq!(a.csv([0.0, 1e8], MAYA).lines().count(), 3);
}

/// Words that make a mutated file meet more of the grammar.
const WORDS: [&str; 24] = [
    "step",
    "stepnext",
    "fixed",
    "auto",
    "plateau",
    "cycle",
    "oscillate",
    "linear",
    "cycleRelative",
    "weighted 1;",
    "1e30",
    "-1e30",
    "1e-300",
    "90",
    "0",
    "{",
    "}",
    ";",
    "\"",
    "#",
    "inputUnit hour;",
    "unitless",
    "timeUnit 48000fps;",
    "\u{e9}",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn arbitrary_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        exercise(&bytes);
        exercise(&[b"animVersion 1.1;\n", bytes.as_slice()].concat());
    }

    #[test]
    fn arbitrary_words_are_survived(picks in prop::collection::vec(0..WORDS.len() + 6, 0..80)) {
        let more = ["anim a b c 0 1 0;", "animData {", "keys {", "1 2 fixed fixed 1 1 0 30 1 30 1;", "3 4", "\n"];
        let words: Vec<&str> = picks.iter().map(|&i| *WORDS.get(i).unwrap_or_else(|| &more[i - WORDS.len()])).collect();
        exercise(format!("animVersion 1.1;\n{}", words.join(" ")).as_bytes());
    }

    #[test]
    fn mutated_files_are_survived(
        file in 0..REAL.len(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0_u8..4, any::<u8>(), 0..WORDS.len()), 1..12),
    ) {
        let mut bytes = REAL[file].as_bytes().to_vec();
        for (place, kind, byte, word) in edits {
            if bytes.is_empty() {
                break;
            }
            let at = place.index(bytes.len());
            match kind {
                0 => bytes[at] = byte,
                1 => bytes.truncate(at),
                2 => { bytes.remove(at); }
                _ => {
                    // A whole word is replaced, so that the file often stays valid.
                    let is_end = |b: &u8| b.is_ascii_whitespace() || *b == b';';
                    let start = bytes[..at].iter().rposition(is_end).map_or(0, |i| i + 1);
                    let end = at + bytes[at..].iter().position(is_end).unwrap_or(bytes.len() - at);
                    bytes.splice(start..end, WORDS[word].bytes());
                }
            }
        }
        exercise(&bytes);
    }

    #[test]
    fn random_curves_give_finite_values(
        keys in prop::collection::vec(
            (-1e30..1e30_f64, -1e30..1e30_f64, 0..11_usize, 0..11_usize, -400.0..400.0_f64, -1e30..1e30_f64),
            1..8,
        ),
        rule in 0..5_usize,
        weighted in any::<bool>(),
        exponent in -30..1_i32,
    ) {
        const TANGENTS: [&str; 11] = [
            "fixed", "linear", "flat", "spline", "step", "stepnext", "clamped", "plateau", "auto", "automix",
            "autoease",
        ];
        let rule = ["constant", "linear", "cycle", "cycleRelative", "oscillate"][rule];
        let small = 10f64.powi(exponent);
        let mut text = format!("weighted {}; preInfinity {rule}; postInfinity {rule}; keys {{\n", u8::from(weighted));
        for (time, value, inward, outward, angle, weight) in keys {
            let pair = |i: usize| if i == 0 { format!(" {angle} {weight}") } else { String::new() };
            let [before, after] = [inward, outward].map(|i| TANGENTS[i]);
            let pairs = pair(inward) + &pair(outward);
            writeln!(text, "{} {value} {before} {after} 1 1 0{pairs};", time * small).expect("a string");
        }
        let text = with("timeUnit 48000fps; linearUnit mi;", "translateX", &(text + "}"));
        prop_assert!(parse(text.as_bytes(), Path::new("p.anim")).is_ok());
        exercise(text.as_bytes());
    }
}
