//! Levels of detail in our own format.

use glam::Vec3;
use splatblur::model::{ColourSpace, LoadOptions, Surfels, load};

use super::bin::{encode, seal};
use super::support::surfels;

/// A plate of so many discs along each side, in the order in which a file has levels.
fn plate(side: usize) -> Surfels {
    let places = (0..side * side).map(|i| Vec3::new((i % side) as f32, (i / side) as f32, 0.0));
    let position: Vec<Vec3> = places.collect();
    let all = |v: Vec3| vec![v; position.len()];
    let (axis_u, axis_v, normal) = (all(Vec3::X * 0.8), all(Vec3::Y * 0.8), all(Vec3::Z));
    let colour = position.iter().map(|place| Vec3::new(place.x % 2.0, 0.5, 0.1)).collect();
    let velocity = position.iter().map(|place| Vec3::Z * place.x).collect();
    Surfels { position, axis_u, axis_v, normal, colour, velocity, ..Surfels::default() }.spatially_ordered()
}

/// First byte and bytes of the column `name`, by the directory of a file.
fn column(bytes: &[u8], name: &str) -> (usize, usize) {
    let number = |at: usize| usize::try_from(u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())).unwrap();
    let padded = format!("{name:\0<24}");
    let entries = (64..).step_by(48).take(usize::from(bytes[52]));
    let entry = entries.into_iter().find(|&at| &bytes[at..at + 24] == padded.as_bytes()).unwrap();
    (number(entry + 32), number(entry + 40))
}

#[test]
fn what_is_no_tree_is_refused() {
    let good = encode(&plate(40));
    let refused = |name: &str, at: usize, with: &[u8]| {
        let mut bad = good.clone();
        let start = column(&good, name).0 + at;
        bad[start..start + with.len()].copy_from_slice(with);
        seal(&mut bad);
        surfels(&bad).map_or_else(|why| why.to_string(), |_| format!("nothing: {name}, {at}, {with:?}"))
    };
    let has = |found: String, expected: &str| assert!(found.contains(expected), "{found}\n  expected {expected}");
    let nodes = column(&good, "level_node").1 / 32;
    assert!(nodes > 4, "{nodes}");
    let (root, last) = (0, 32 * (nodes - 1));
    let long = |number: i64| number.to_le_bytes();
    has(refused("level_node", root, &long(-1)), "row 0 of `level_node`, expected numbers from 0 to");
    has(refused("level_node", root, &long(1 << 40)), "expected numbers from 0 to 4294967295");
    has(refused("level_node", root + 8, &long(4_000_000_000)), "expected merged surfels of its own");
    has(refused("level_node", root, &long(4_000_000_000)), "expected one surfel at least");
    // A child that is its own parent, more children than there are nodes, a node without a parent.
    has(refused("level_node", root + 16, &long(0)), "expected children that follow those of the nodes before");
    has(refused("level_node", root + 24, &long(4_000_000_000)), "expected children that follow");
    has(refused("level_node", root + 24, &long(2)), "expected");
    has(refused("level_node", last + 16, &[long(1), long(1)].concat()), "expected zeros where there are no children");
    // A leaf that leaves out a surfel, and one that reaches beyond the model.
    has(refused("level_node", last + 8, &long(1599)), "expected leaves that hold all surfels");
    has(refused("level_node", last + 8, &long(1601)), "expected leaves that hold all surfels");
    has(refused("level_node", last, &long(1499)), "expected the surfels that follow those of the leaf before");
    let nan = f32::NAN.to_le_bytes();
    for (name, expected) in [
        ("level_box", "corners of a box"),
        ("level_axis", "a length of at most 1"),
        ("level_errors", "numbers of at least 0"),
        ("level_along", "numbers from -2 to 2"),
        ("level_velocities", "corners of a box, a mean, a number of at least 0"),
        ("level_share", "a number of at least 0"),
        ("level_alike", "a number from 0 to 1"),
    ] {
        let at = column(&good, name).0;
        has(refused(name, 0, &nan), &format!("byte {at}: found row 0 of `{name}`, expected {expected}"));
    }
    has(refused("level_box", 0, &1e6_f32.to_le_bytes()), "corners of a box");
    has(refused("level_velocities", 36, &f32::INFINITY.to_le_bytes()), "corners of a box, a mean, a number");
    for (name, what) in [
        ("level_position", "position"),
        ("level_axis_u", "pair of axes"),
        ("level_normal", "normal"),
        ("level_colour", "colour"),
        ("level_velocity", "velocity"),
    ] {
        let at = column(&good, name).0;
        has(refused(name, 0, &nan), &format!("byte {at}: found an unusable {what} at row 0 of `{name}`"));
    }
    // Columns that are missing, or have other numbers of rows than their like.
    let entry = |name: &str| good.windows(name.len()).position(|of| of == name.as_bytes()).unwrap();
    for (name, renamed) in [("level_share", "level_shore"), ("level_node", "level_nods")] {
        let mut bad = good.clone();
        bad[entry(name)..][..name.len()].copy_from_slice(renamed.as_bytes());
        seal(&mut bad);
        has(surfels(&bad).map(|_| ()).unwrap_err().to_string(), &format!("found no column `{name}`"));
    }
}

/// The levels of a file are left out where they are of another version, or of other surfels, or have no version.
#[test]
fn levels_of_others_are_left_out() {
    let good = encode(&plate(40));
    let of_file = |bytes: &[u8]| format!("{:?}", surfels(bytes).unwrap().levels);
    assert_ne!(of_file(&good), "KeptLevels(None)");
    let (of, _) = column(&good, "level_of");
    let mut newer = good.clone();
    newer[of] += 1;
    seal(&mut newer);
    assert_eq!(of_file(&newer), "KeptLevels(None)");
    assert_eq!(surfels(&newer).unwrap().position, plate(40).position);
    let mut none = good;
    let entry = none.windows(8).position(|name| name == b"level_of").unwrap();
    none[entry..entry + 8].copy_from_slice(b"level_on");
    seal(&mut none);
    assert_eq!(of_file(&none), "KeptLevels(None)");
}

/// What a scene says of a model reaches a model with levels, too.
#[test]
fn options_of_a_scene_reach_a_model_with_levels() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.bin");
    std::fs::write(&path, encode(&plate(40))).unwrap();
    let options = LoadOptions { radius_scale: 2.0, colour_space: Some(ColourSpace::Srgb), ..LoadOptions::default() };
    let back = crate::support::surfels(load(&path, &options, &|_, _| {}).unwrap());
    assert_eq!(back.axis_u[0], Vec3::X * 1.6);
    assert!((back.colour[0].y - 0.214_041).abs() < 1e-6);
}
