//! PLY: every layout that is met in the wild.

use glam::{DVec3, Vec3};
use splatblur::model::{ColourStorage, Material, ModelFormat};

use super::support::{ENCODINGS, Encoding, Ply, cloud, refused};

const XYZ: [(&str, &str); 3] = [("float", "x"), ("float", "y"), ("float", "z")];

fn points(properties: &[(&str, &str)], rows: &[&[f64]]) -> splatblur::model::Cloud {
    let rows: Vec<Vec<f64>> = rows.iter().map(|r| r.to_vec()).collect();
    let mut all = Vec::new();
    for encoding in ENCODINGS {
        all.push(cloud(&Ply::new(encoding).element("vertex", properties, &rows).bytes(), ModelFormat::Ply));
    }
    for other in &all[1..] {
        assert_eq!(format!("{:?}", all[0]), format!("{other:?}"));
    }
    all.swap_remove(0)
}

fn with_xyz<'a>(more: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
    XYZ.into_iter().chain(more.iter().copied()).collect()
}

#[test]
fn every_number_type_in_every_encoding() {
    for kind in ["char", "int8", "short", "int16", "int", "int32", "float", "float32", "double", "float64"] {
        let c = points(&[(kind, "x"), (kind, "y"), (kind, "z")], &[&[1.0, -2.0, 3.0], &[100.0, 0.0, -128.0]]);
        assert_eq!(c.position, [DVec3::new(1.0, -2.0, 3.0), DVec3::new(100.0, 0.0, -128.0)], "{kind}");
    }
    for (kind, most) in [("uchar", 255.0), ("uint8", 255.0), ("ushort", 65535.0), ("uint", 4_294_967_295.0)] {
        let c = points(&[(kind, "x"), (kind, "y"), (kind, "z")], &[&[0.0, 1.0, most]]);
        assert_eq!(c.position, [DVec3::new(0.0, 1.0, most)], "{kind}");
    }
    let c = points(&[("double", "x"), ("double", "y"), ("double", "z")], &[&[1e7 + 0.125, 1e-9, 4.5e6]]);
    assert_eq!(c.position, [DVec3::new(1e7 + 0.125, 1e-9, 4.5e6)]);
}

#[test]
fn any_order_and_letter_case() {
    let c = points(
        &[("uchar", "Blue"), ("float", "Z"), ("uchar", "RED"), ("float", "x"), ("uchar", "green"), ("double", "Y")],
        &[&[51.0, 3.0, 255.0, 1.0, 0.0, 2.0]],
    );
    assert_eq!(c.position, [DVec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(c.colour, [Vec3::new(1.0, 0.0, 0.2)]);
}

#[test]
fn line_ends_and_a_body_that_begins_like_one() {
    // A first x byte of 0x0a or 0x0d must not be taken for a line end.
    for first in [0x0a, 0x0d] {
        for line_end in ["\n", "\r\n", "\r"] {
            for encoding in ENCODINGS {
                let rows = [vec![f64::from(first), 13.0, 10.0], vec![10.0, 10.0, 13.0]];
                let properties = [("uchar", "x"), ("uchar", "y"), ("uchar", "z")];
                let mut ply = Ply::new(encoding).line("comment a").element("vertex", &properties, &rows);
                ply.line_end = line_end;
                let c = cloud(&ply.bytes(), ModelFormat::Ply);
                let expected = [DVec3::new(f64::from(first), 13.0, 10.0), DVec3::new(10.0, 10.0, 13.0)];
                assert_eq!(c.position, expected, "{line_end:?} {encoding:?}");
                assert!(c.notes.is_empty(), "{:?}", c.notes);
            }
        }
    }
}

#[test]
fn comments_blanks_and_latin_1() {
    let text =
        b"ply \n  format ascii 1.0\t\ncomment caf\xe9\n\nobj_info num_cols 3\nelement vertex 2 \n property float x\n\
        comment between\nproperty float y\nproperty float z\nend_header  \n1 2\n3\n 4\t5 6";
    let c = cloud(text, ModelFormat::Ply);
    assert_eq!(c.position, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)]);
}

#[test]
fn other_elements_before_and_after() {
    for encoding in ENCODINGS {
        for (count, item) in [("uchar", "int"), ("uint", "short"), ("int", "uchar"), ("ushort", "double")] {
            let ply = Ply::new(encoding)
                .element("camera", &[("double", "view"), ("uchar", "x")], &[vec![0.5, 1.0]])
                .lists("edges", "ids", count, item, &[vec![], vec![1.0, 2.0, 3.0]])
                .element("vertex", &XYZ, &[vec![1.0, 2.0, 3.0]])
                .lists("material", "ids", count, item, &[vec![9.0; 4]]);
            let c = cloud(&ply.bytes(), ModelFormat::Ply);
            assert_eq!(c.position, [DVec3::new(1.0, 2.0, 3.0)], "{encoding:?} {count} {item}");
            assert!(c.notes.is_empty(), "{:?}", c.notes);
        }
    }
}

#[test]
fn a_list_among_the_vertex_properties() {
    for encoding in ENCODINGS {
        let text = "comment a list";
        let mut ply =
            Ply::new(encoding).line(text).lists("vertex", "ids", "uchar", "int", &[vec![1.0], vec![2.0, 3.0]]);
        ply.encoding = encoding;
        // A vertex without x, y, z but with a list: refused, with the line of the element.
        let e = refused(&ply.bytes(), ModelFormat::Ply).to_string();
        assert!(e.starts_with("line 4: found an element `vertex` without x, y and z"), "{e}");
    }
    let text = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty list uchar int ids\nproperty float \
                y\nproperty float z\nend_header\n1 2 7 7 3 4\n5 0 6 7\n";
    assert_eq!(
        cloud(text.as_bytes(), ModelFormat::Ply).position,
        [DVec3::new(1.0, 3.0, 4.0), DVec3::new(5.0, 6.0, 7.0)]
    );
}

#[test]
fn names_of_attributes() {
    for [x, y, z] in [["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]] {
        let c = points(&with_xyz(&[("float", x), ("float", y), ("float", z)]), &[&[0.0, 0.0, 0.0, 0.0, -2.0, 0.0]]);
        assert_eq!(c.normal, [Vec3::NEG_Y]);
    }
    for name in ["radius", "psz", "point_size", "size", "value", "scale"] {
        let c = points(&with_xyz(&[("float", name)]), &[&[0.0, 0.0, 0.0, 0.25], &[1.0, 0.0, 0.0, -1.0]]);
        assert_eq!(c.radius, [0.25, 0.0], "{name}");
    }
    for [x, y, z] in [["vx", "vy", "vz"], ["velocity_x", "velocity_y", "velocity_z"]] {
        let c = points(&with_xyz(&[("float", x), ("float", y), ("float", z)]), &[&[0.0, 0.0, 0.0, 1.0, 2.0, 3.0]]);
        assert_eq!(c.velocity, [Vec3::new(1.0, 2.0, 3.0)]);
    }
    for [x, y, z] in [["ax", "ay", "az"], ["acceleration_x", "acceleration_y", "acceleration_z"]] {
        let c = points(&with_xyz(&[("float", x), ("float", y), ("float", z)]), &[&[0.0, 0.0, 0.0, 1.0, 2.0, 3.0]]);
        assert_eq!(c.acceleration, [Vec3::new(1.0, 2.0, 3.0)]);
    }
    for name in ["id", "particle_id", "point_id"] {
        assert_eq!(points(&with_xyz(&[("int", name)]), &[&[0.0, 0.0, 0.0, -7.0]]).id, [-7]);
    }
    let axes = ["tux", "tuy", "tuz", "tvx", "tvy", "tvz"].map(|n| ("float", n));
    let c = points(&with_xyz(&axes), &[&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.5, 0.0]]);
    assert_eq!(c.axes, [[Vec3::X * 2.0, Vec3::Y * 0.5]]);
    let material = ["ambient", "diffuse", "specular", "shininess"].map(|n| ("float", n));
    let c = points(&with_xyz(&material), &[&[0.0, 0.0, 0.0, 0.25, 0.5, 0.75, 20.0]]);
    assert_eq!(c.material, [Material { ambient: 0.25, diffuse: 0.5, specular: 0.75, shininess: 20.0 }]);
}

#[test]
fn colours_by_their_type() {
    for [r, g, b] in [["red", "green", "blue"], ["r", "g", "b"], ["diffuse_red", "diffuse_green", "diffuse_blue"]] {
        let c = points(&with_xyz(&[("uchar", r), ("uchar", g), ("uchar", b)]), &[&[0.0, 0.0, 0.0, 255.0, 51.0, 0.0]]);
        assert_eq!((c.colour[0], c.colour_storage), (Vec3::new(1.0, 0.2, 0.0), ColourStorage::Integer));
    }
    let rgb = |kind, values: [f64; 3]| {
        let [r, g, b] = values;
        points(&with_xyz(&[(kind, "red"), (kind, "green"), (kind, "blue")]), &[&[0.0, 0.0, 0.0, r, g, b]])
    };
    assert_eq!(rgb("ushort", [65535.0, 13107.0, 0.0]).colour, [Vec3::new(1.0, 0.2, 0.0)]);
    assert_eq!(rgb("int", [255.0, 51.0, 0.0]).colour, [Vec3::new(1.0, 0.2, 0.0)]);
    let c = rgb("float", [1.0, 0.5, 0.0]);
    assert_eq!((c.colour[0], c.colour_storage), (Vec3::new(1.0, 0.5, 0.0), ColourStorage::Float));
    let c = rgb("double", [255.0, 51.0, 0.0]);
    assert_eq!((c.colour[0], c.colour_storage), (Vec3::new(1.0, 0.2, 0.0), ColourStorage::Integer));
    assert!(c.notes[0].contains("divided by 255"), "{:?}", c.notes);
    let c = points(&with_xyz(&[("float", "scalar_Density")]), &[&[0.0, 0.0, 0.0, 0.5], &[1.0, 0.0, 0.0, 1000.0]]);
    assert_eq!(c.colour[1], Vec3::ONE);
    assert!(c.notes[0].contains("`scalar_density` is shown as grey"), "{:?}", c.notes);
    let mixed = with_xyz(&[("uchar", "red"), ("float", "green"), ("uchar", "blue")]);
    let ply = Ply::new(Encoding::Little).element("vertex", &mixed, &[vec![0.0; 6]]);
    assert!(refused(&ply.bytes(), ModelFormat::Ply).to_string().contains("colour channels of types uchar and float"));
}

#[test]
fn opacities_by_their_type() {
    let of = |kind: &'static str, name: &'static str, values: [f64; 3]| {
        let rows = values.map(|value| vec![0.0, 0.0, 0.0, value]);
        let properties = with_xyz(&[(kind, name)]);
        let all: Vec<_> = ENCODINGS
            .map(|encoding| cloud(&Ply::new(encoding).element("vertex", &properties, &rows).bytes(), ModelFormat::Ply))
            .into_iter()
            .map(|cloud| (cloud.opacity, cloud.notes))
            .collect();
        assert!(all.iter().all(|one| *one == all[0]), "{all:?}");
        all[0].clone()
    };
    for (kind, one) in [
        ("uchar", 255.0),
        ("short", 32767.0),
        ("ushort", 65535.0),
        ("int", 2_147_483_647.0),
        ("uint", 4_294_967_295.0),
        ("float", 1.0),
        ("double", 1.0),
    ] {
        for name in ["alpha", "opacity"] {
            let (opacity, notes) = of(kind, name, [0.0, one, if one > 1.0 { 51.0 } else { 0.25 }]);
            let third = if one > 1.0 { 51.0 / one } else { 0.25 };
            assert_eq!((opacity, notes), (vec![0.0, 1.0, third as f32], vec![]), "{kind} {name}");
        }
    }
    // The sign of a signed byte is an accident.
    assert_eq!(of("char", "alpha", [-1.0, 51.0, 0.0]).0, [1.0, 0.2, 0.0]);
    // Opaque ones say nothing. Zeros alone are those of a program that knows no opacity.
    assert_eq!(of("uchar", "alpha", [254.0, 255.0, 254.0]), (vec![], vec![]));
    assert_eq!(of("uchar", "alpha", [255.0, 253.0, 255.0]).0.len(), 3);
    let note = "the opacities of all points are 0: taken as opaque".to_owned();
    assert_eq!(of("uchar", "alpha", [0.0; 3]), (vec![], vec![note]));
    let (opacity, notes) = of("float", "alpha", [-0.5, 2.0, 0.5]);
    assert_eq!((opacity, notes.len()), (vec![1.0, 1.0, 0.5], 1), "{notes:?}");
    // Beside columns of a capture it is a logit, even where the rest of the capture is missing.
    let broken = with_xyz(&[("float", "f_dc_0"), ("float", "scale_0"), ("float", "opacity")]);
    let c = cloud(&Ply::new(Encoding::Little).element("vertex", &broken, &[vec![0.5; 6]]).bytes(), ModelFormat::Ply);
    assert!(c.opacity.is_empty());
    assert_eq!(c.notes, ["vertex properties ignored: f_dc_0, scale_0, opacity"]);
}

#[test]
fn unused_properties_are_named() {
    let c = points(&with_xyz(&[("float", "curvature"), ("float", "confidence"), ("uchar", "alpha")]), &[&[255.0; 6]]);
    assert_eq!(c.notes, ["vertex properties ignored: curvature"]);
}

/// A rate that is no number would put a point anywhere, and an identity must be a whole number.
#[test]
fn odd_rates_and_identities_are_refused_with_their_place() {
    let error = |names: &[&str], row: &[f64]| {
        let properties: Vec<(&str, &str)> = names.iter().map(|&name| ("double", name)).collect();
        let rows = [vec![0.0; 3 + row.len()], [&[0.0; 3], row].concat()];
        let file = Ply::new(ENCODINGS[0]).element("vertex", &with_xyz(&properties), &rows).bytes();
        refused(&file, ModelFormat::Ply).to_string()
    };
    let expected = "expected a finite number up to 1e18 (`vy` of vertex 1 of 2)";
    for value in [f64::NAN, f64::NEG_INFINITY, 2e18] {
        let e = error(&["vx", "vy", "vz"], &[0.0, value, 0.0]);
        assert!(e.ends_with(expected) && e.contains(&format!("found {value}")), "{e}");
    }
    assert!(error(&["ax", "ay", "az"], &[0.0, 0.0, f64::NAN]).contains("`az` of vertex 1 of 2"));
    for value in [0.5, 1e17, f64::NAN] {
        let e = error(&["id"], &[value]);
        assert!(e.contains("expected a whole number up to 2^53"), "{e}");
    }
}

#[test]
fn points_that_are_not_numbers_are_dropped_with_their_attributes() {
    let properties = with_xyz(&[("uchar", "red"), ("uchar", "green"), ("uchar", "blue")]);
    let c = points(
        &properties,
        &[
            &[f64::NAN, 0.0, 0.0, 1.0, 1.0, 1.0],
            &[1.0, 2.0, 3.0, 255.0, 0.0, 0.0],
            &[0.0, f64::INFINITY, 0.0, 1.0, 1.0, 1.0],
        ],
    );
    assert_eq!((c.position.len(), c.colour[0]), (1, Vec3::X));
    assert_eq!(c.notes, ["2 points dropped: a coordinate is not finite or beyond 1e18"]);
    // Doubles beyond 32-bit floats would become infinite.
    let c = points(&[("double", "x"), ("double", "y"), ("double", "z")], &[&[1e300, 0.0, 0.0], &[1.0, 0.0, 0.0]]);
    assert_eq!(c.position, [DVec3::X]);
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                end_header\n-nan(ind) 0 0\n1.#QNAN 0 0\n+1.5e+01 -.5 6.\n";
    assert_eq!(cloud(text.as_bytes(), ModelFormat::Ply).position, [DVec3::new(15.0, -0.5, 6.0)]);
}

#[test]
fn odd_attributes_become_missing() {
    let properties: Vec<_> = with_xyz(
        &["nx", "ny", "nz", "tux", "tuy", "tuz", "tvx", "tvy", "tvz", "radius", "r", "g", "b"].map(|n| ("double", n)),
    );
    let mut row = vec![0.0; 16];
    row[3] = f64::NAN;
    row[6] = 1.0;
    row[9] = 2.0;
    row[12] = 1e300;
    row[13] = f64::INFINITY;
    let c = points(&properties, &[&row]);
    assert_eq!((c.normal[0], c.axes[0], c.radius[0], c.colour[0]), (Vec3::ZERO, [Vec3::ZERO; 2], 0.0, Vec3::ONE));
    // An overflow of f32 keeps its direction.
    row[3..6].copy_from_slice(&[1e300, 0.0, 1e300]);
    let c = points(&properties, &[&row]);
    assert!((c.normal[0] - Vec3::new(1.0, 0.0, 1.0).normalize()).length() < 1e-6);
}

#[test]
fn normals_from_faces_wherever_they_stand() {
    let corners = [vec![0.0, 0.0, 0.0], vec![1.0, 0.0, 0.0], vec![1.0, 1.0, 0.0], vec![0.0, 1.0, 0.0]];
    for encoding in ENCODINGS {
        for list in ["vertex_indices", "vertex_index"] {
            for item in ["uchar", "int", "uint", "float"] {
                let ply = Ply::new(encoding);
                let before =
                    ply.lists("face", list, "int", item, &[vec![0.0, 1.0, 2.0, 3.0]]).element("vertex", &XYZ, &corners);
                let after = Ply::new(encoding).element("vertex", &XYZ, &corners).lists(
                    "face",
                    list,
                    "uchar",
                    item,
                    &[vec![0.0, 1.0, 2.0], vec![0.0, 2.0, 3.0]],
                );
                for ply in [before, after] {
                    let c = cloud(&ply.bytes(), ModelFormat::Ply);
                    assert_eq!(c.normal, [Vec3::Z; 4], "{encoding:?} {list} {item}");
                }
            }
        }
        let strip = [vec![0.0, 1.0, 3.0, 2.0, -1.0, 3.0]];
        let ply = Ply::new(encoding).element("vertex", &XYZ, &corners).lists(
            "tristrips",
            "vertex_indices",
            "int",
            "int",
            &strip,
        );
        assert_eq!(cloud(&ply.bytes(), ModelFormat::Ply).normal, [Vec3::Z; 4]);
    }
}

#[test]
fn normals_of_the_file_win_over_faces() {
    let properties = with_xyz(&[("float", "nx"), ("float", "ny"), ("float", "nz")]);
    let rows: Vec<Vec<f64>> = (0..3).map(|i| vec![f64::from(i), f64::from(i * i), 0.0, 1.0, 0.0, 0.0]).collect();
    let ply = Ply::new(Encoding::Little).element("vertex", &properties, &rows).lists(
        "face",
        "vertex_indices",
        "uchar",
        "int",
        &[vec![0.0, 1.0, 2.0]],
    );
    assert_eq!(cloud(&ply.bytes(), ModelFormat::Ply).normal, [Vec3::X; 3]);
}

#[test]
fn gaussian_splats() {
    let names = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
        "rot_2", "rot_3",
    ];
    let properties: Vec<_> = names.iter().map(|n| ("float", *n)).collect();
    let (half, c0) = (0.5_f64.sqrt(), 0.282_094_791_773_878_14);
    // sigma (3, 1, 2) turned by 90 degrees about z: the largest axis (x) becomes y, the smallest (y) becomes -x.
    let solid =
        vec![5.0, 0.0, 0.0, 0.5 / c0, -9.0, 0.0, 2.0, 3_f64.ln(), 0.0, 2_f64.ln(), 2.0 * half, 0.0, 0.0, 2.0 * half];
    let mut faint = solid.clone();
    faint[6] = -1.0;
    let mut broken = solid.clone();
    broken[10..].fill(0.0);
    for encoding in ENCODINGS {
        let rows = [faint.clone(), solid.clone(), broken.clone()];
        let c = cloud(&Ply::new(encoding).element("vertex", &properties, &rows).bytes(), ModelFormat::Ply);
        assert_eq!(c.position, [DVec3::X * 5.0]);
        assert!((c.colour[0] - Vec3::new(1.0, 0.0, 0.5)).length() < 1e-5, "{}", c.colour[0]);
        assert_eq!(c.colour_storage, ColourStorage::Integer);
        assert!((c.axes[0][0].abs() - Vec3::Y * 6.0).length() < 1e-5, "{:?}", c.axes);
        assert!((c.axes[0][1].abs() - Vec3::Z * 4.0).length() < 1e-5, "{:?}", c.axes);
        assert!((c.normal[0].abs() - Vec3::X).length() < 1e-6);
        assert!(c.two_sided, "the smallest axis has no sign");
        assert!(c.notes[0].contains("1 of 3 kept; dropped 1 with opacity"), "{:?}", c.notes);
        assert!(c.notes[0].contains("1 with a bad scale or rotation"), "{:?}", c.notes);
    }
}

#[test]
fn gaussian_blobs_are_dropped() {
    let names = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
        "rot_2", "rot_3",
    ];
    let properties: Vec<_> = names.iter().map(|n| ("float", *n)).collect();
    // 200 on a diagonal of length 1000 sqrt 3, less 2 % at each end; the limit on sigma is a 40th of it: about 41.6.
    let rows: Vec<Vec<f64>> = (0..200)
        .map(|i| {
            let x = 1000.0 * f64::from(i) / 199.0;
            let sigma: f64 = if i == 7 { 45.0 } else { 40.0 };
            vec![x, x, x, 0.0, 0.0, 0.0, 9.0, sigma.ln(), 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        })
        .collect();
    let c = cloud(&Ply::new(Encoding::Big).element("vertex", &properties, &rows).bytes(), ModelFormat::Ply);
    assert_eq!(c.position.len(), 199);
    assert!(c.notes[0].contains("1 with a sigma above 2.5%"), "{:?}", c.notes);
}
