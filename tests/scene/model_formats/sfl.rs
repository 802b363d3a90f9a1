//! `Pointshop3D` files.

use glam::{DVec3, Vec3};
use splatblur::model::{ColourStorage, ModelFormat};

use super::support::{Entry, be, cloud, read, refused, sfl_f32, sfl_file, sfl_set, sfl_u32};

#[test]
fn tiny_full_to_its_known_values() {
    let c = cloud(&read("tiny_full.sfl"), ModelFormat::Sfl);
    assert_eq!(c.position.len(), 3);
    let normals = [Vec3::X, Vec3::Z, Vec3::new(0.6, -0.8, 0.0)];
    for (i, normal) in normals.into_iter().enumerate() {
        let k = i as f64 + 1.0;
        // Set transform: scale 2, translate (10, 20, 30).
        assert_eq!(c.position[i], DVec3::new(10.0 + 2.0 * k, 20.0 + k, 30.0 - 2.0 * k));
        assert!((c.normal[i] - normal).length() < 1e-7);
        assert_eq!(c.radius[i], 0.5 * k as f32);
        let colour = Vec3::new(10.0, 20.0, 30.0) + i as f32;
        assert!((c.colour[i] * 255.0 - colour).length() < 1e-5);
        let m = c.material[i];
        assert_eq!(
            [m.ambient, m.diffuse, m.specular, m.shininess],
            [51.0 / 255.0, 153.0 / 255.0, 1.0, 20.0 + i as f32]
        );
    }
    assert!(c.axes.is_empty() && c.velocity.is_empty());
    assert_eq!(c.colour_storage, ColourStorage::Integer);
    assert!(c.notes.is_empty(), "{:?}", c.notes);
}

/// Mask bits of a plain normal.
const PLAIN: u32 = 0;

fn version(v: u32) -> Entry {
    sfl_u32(0x0150, &[v])
}

#[test]
fn root_axes_then_the_transform() {
    // Right = +y, up = +z, back = +x: p becomes (p.y, p.z, p.x).
    let root =
        vec![sfl_f32(0x0110, &[0.0, 1.0, 0.0]), sfl_f32(0x0111, &[0.0, 0.0, 1.0]), sfl_f32(0x0112, &[1.0, 0.0, 0.0])];
    // Row-major: scale (2, 1, 1), translate (100, 0, 0).
    let transform =
        sfl_f32(0x0161, &[2.0, 0.0, 0.0, 100.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let h = 0.5_f32.sqrt();
    let record = be(&[1.0, 2.0, 3.0, 0.0, h, h, 0.5]);
    let [set, resolution] = sfl_set(PLAIN, &[(0, 0), (1, 12), (4, 24)], 28, &record, &[transform, version(1)]);
    let c = cloud(&sfl_file(&[root, set, resolution]), ModelFormat::Sfl);
    assert_eq!(c.position, [DVec3::new(104.0, 3.0, 1.0)]);
    // The normal (h, h, 0) by the inverse transpose: (h/2, h, 0).
    let n = Vec3::new(0.5, 1.0, 0.0).normalize();
    assert!((c.normal[0] - n).length() < 1e-6, "{}", c.normal[0]);
    // A disc of radius 0.5 with that normal, stretched by 2 along x: an ellipse in the plane across n.
    let [u, v] = c.axes[0];
    assert!(u.dot(n).abs() < 1e-6 && v.dot(n).abs() < 1e-6);
    // Its area: pi |u x v| = pi r^2 |cofactor(M) n|.
    assert!((u.cross(v).length() - 0.25 * Vec3::new(h, 2.0 * h, 0.0).length()).abs() < 1e-6);
}

#[test]
fn elliptical_surfels_without_normals() {
    let record = be(&[1.0, 2.0, 3.0, 2.0, 0.0, 0.0, 0.0, 0.0, -0.5]);
    let [set, resolution] = sfl_set(1 << 24, &[(0, 0), (24, 12)], 36, &record, &[version(1)]);
    let c = cloud(&sfl_file(&[vec![], set, resolution]), ModelFormat::Sfl);
    assert_eq!(c.axes, [[Vec3::X * 2.0, Vec3::Z * -0.5]]);
    assert_eq!((c.normal[0], c.radius[0], c.colour[0]), (Vec3::Y, 2.0, Vec3::ONE));
}

#[test]
fn format_version_0_announces_what_it_does_not_store() {
    let record = be(&[1.0, 2.0, 3.0, 2.0, 0.0, 0.0, 0.0, 0.5, 0.0]);
    let properties = [(0, 0), (1, 400), (4, 500), (24, 12)];
    let [set, resolution] = sfl_set(1 << 24, &properties, 36, &record, &[version(0)]);
    let c = cloud(&sfl_file(&[vec![], set, resolution]), ModelFormat::Sfl);
    assert_eq!((c.normal[0], c.radius[0]), (Vec3::Z, 2.0));
    let [set, resolution] = sfl_set(1 << 24, &properties, 36, &record, &[version(1)]);
    let e = refused(&sfl_file(&[vec![], set, resolution]), ModelFormat::Sfl).to_string();
    assert!(e.contains("property 1 of 12 bytes at 400, expected inside a surfel of 36 bytes"), "{e}");
}

#[test]
fn coded_normals_flags_and_colour_models() {
    for (mask, code, expected) in [
        (0b1000, vec![0b0100_0000, 0b0001_1111], Vec3::new(-1.0, 63.0, -63.0)),
        (0b1100, vec![0x00, 0x00, 0x3f, 0xff], Vec3::new(1.0, -1.0, 1.0)),
    ] {
        let record: Vec<u8> = be(&[0.0, 0.0, 0.0])
            .into_iter()
            .chain(0x0300_u32.to_be_bytes())
            .chain([255, 51])
            .chain(code.iter().copied())
            .collect();
        let invisible: Vec<u8> =
            be(&[9.0, 0.0, 0.0]).into_iter().chain(0x0400_u32.to_be_bytes()).chain([0, 0]).chain(code).collect();
        let size = record.len() as u32;
        let properties = [(0, 0), (27, 12), (10, 16), (1, 18)];
        let [set, resolution] =
            sfl_set(mask | 0x09 << 16, &properties, size, &[invisible, record].concat(), &[version(1)]);
        let c = cloud(&sfl_file(&[vec![], set, resolution]), ModelFormat::Sfl);
        assert_eq!((c.position.as_slice(), c.colour[0]), ([DVec3::ZERO].as_slice(), Vec3::ONE));
        assert!((c.normal[0] - expected.normalize()).length() < 1e-6, "{}", c.normal[0]);
        assert_eq!(c.notes, ["1 surfels dropped: flagged invisible"]);
    }
}

#[test]
fn several_sets_are_merged_at_their_finest() {
    let position = |x: f32| be(&[x, 0.0, 0.0]);
    let [mut first, coarse] = sfl_set(0, &[(0, 0)], 12, &position(1.0), &[]);
    first[0] = sfl_u32(0x0140, &[2]);
    let [_, fine] = sfl_set(0, &[(0, 0)], 12, &[position(2.0), position(3.0)].concat(), &[]);
    let [second, only] = sfl_set(0, &[(0, 0), (9, 12)], 13, &[position(4.0), vec![102]].concat(), &[]);
    let c = cloud(&sfl_file(&[vec![], first.clone(), coarse.clone(), fine.clone(), second, only]), ModelFormat::Sfl);
    let x: Vec<f64> = c.position.iter().map(|p| p.x).collect();
    assert_eq!(x, [2.0, 3.0, 4.0]);
    assert_eq!(c.material.iter().map(|m| m.ambient).collect::<Vec<_>>(), [1.0, 1.0, 0.4]);
    // Tag 0141 names another resolution, or none.
    let finest = |i| {
        let mut set = first.clone();
        set.push(sfl_u32(0x0141, &[i]));
        sfl_file(&[vec![], set, coarse.clone(), fine.clone()])
    };
    assert_eq!(cloud(&finest(0), ModelFormat::Sfl).position, [DVec3::X]);
    assert!(refused(&finest(2), ModelFormat::Sfl).to_string().contains("found finest resolution 2, expected below 2"));
    // Tags 0140 and 0130 count resolutions and sets.
    first[0] = sfl_u32(0x0140, &[3]);
    let e = refused(&sfl_file(&[vec![], first.clone(), coarse.clone(), fine.clone()]), ModelFormat::Sfl).to_string();
    assert!(e.contains("found 2 resolutions where the set announces 3, expected as many as it announces"), "{e}");
    first[0] = sfl_u32(0x0140, &[2]);
    let list = vec![sfl_u32(0x0130, &[2])];
    let e = refused(&sfl_file(&[vec![], list, first, coarse, fine]), ModelFormat::Sfl).to_string();
    assert!(e.contains("found 1 surfel sets where the list announces 2, expected as many as it announces"), "{e}");
}

#[test]
fn other_units_are_scaled() {
    let root = vec![sfl_f32(0x0113, &[0.01])];
    let [set, resolution] = sfl_set(0, &[(0, 0), (4, 12)], 16, &be(&[1.0, 2.0, 3.0, 0.5]), &[sfl_f32(0x0160, &[0.02])]);
    let c = cloud(&sfl_file(&[root, set, resolution]), ModelFormat::Sfl);
    assert!((c.position[0] - DVec3::new(2.0, 4.0, 6.0)).length() < 1e-6);
    assert!((c.radius[0] - 1.0).abs() < 1e-6);
}

#[test]
fn what_is_refused() {
    let record = be(&[1.0, 2.0, 3.0]);
    let message = |mask: u32, properties: &[(u16, u32)], size: u32, more: &[Entry]| {
        let [set, resolution] = sfl_set(mask, properties, size, &record, more);
        refused(&sfl_file(&[vec![], set, resolution]), ModelFormat::Sfl).to_string()
    };
    let has = |message: String, part: &str| assert!(message.contains(part), "{message}");
    has(message(0b0100, &[(0, 0)], 12, &[]), "normal code 1 (ico8)");
    has(message(0x02 << 16, &[(0, 0), (10, 0)], 12, &[]), "colour model 02");
    has(message(0, &[(1, 0)], 12, &[]), "surfels without positions");
    has(message(0, &[(0, 0), (0, 0)], 12, &[]), "property 0 a second time");
    has(message(0, &[(0, 1)], 12, &[]), "property 0 of 12 bytes at 1");
    has(message(0, &[(0, 0)], 0, &[]), "0151");
    let singular = sfl_f32(0x0161, &[0.0; 16]);
    has(message(0, &[(0, 0)], 12, &[singular]), "singular");
    has(message(0, &[(0, 0)], 12, &[sfl_f32(0x0161, &[1.0; 15])]), "15 numbers, expected 16 (tag 0161)");
    has(message(0, &[(0, 0)], 12, &[sfl_f32(0x0160, &[0.0])]), "units 0, expected more than 0");
    has(refused(&sfl_file(&[vec![]]), ModelFormat::Sfl).to_string(), "no surfel set");
}
