//! Our own format.

use glam::Vec3;
use splatblur::model::{ColourSpace, LoadOptions, Surfels, VelocityUnit, load, write_bin};

use super::support::surfels;
use super::write::sample;

pub(crate) fn encode(s: &Surfels) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.bin");
    write_bin(&path, s).unwrap();
    std::fs::read(path).unwrap()
}

/// Puts the right checksum into changed bytes.
pub(crate) fn seal(bytes: &mut [u8]) {
    bytes[48..52].fill(0);
    let crc = crc32fast::hash(bytes);
    bytes[48..52].copy_from_slice(&crc.to_le_bytes());
}

/// Byte at which the columns of `encode` begin, where there are this many.
const fn body(columns: usize) -> usize {
    64 + 48 * columns
}

/// A file of the first version, by its description: no directory, no normalisation.
pub(crate) fn encode_first_version(s: &Surfels) -> Vec<u8> {
    let mask = u32::from(!s.material.is_empty())
        | u32::from(!s.velocity.is_empty()) << 1
        | u32::from(s.two_sided) << 2
        | u32::from(s.signs_estimated) << 3;
    let mut out = b"\x89SPLAT\r\n\x01\0\0\0".to_vec();
    out.extend(mask.to_le_bytes());
    out.extend((s.len() as u64).to_le_bytes());
    s.origin.to_array().iter().for_each(|x| out.extend(x.to_le_bytes()));
    out.resize(64, 0);
    let materials: Vec<f32> = s.material.iter().flat_map(|m| [m.ambient, m.diffuse, m.specular, m.shininess]).collect();
    let floats = |column: &[Vec3]| column.iter().flat_map(Vec3::to_array).collect::<Vec<f32>>();
    for column in [&s.position, &s.axis_u, &s.axis_v, &s.normal, &s.colour]
        .map(|column| floats(column))
        .into_iter()
        .chain([materials, floats(&s.velocity)])
    {
        out.extend(column.iter().flat_map(|x| x.to_le_bytes()));
        out.resize(out.len().next_multiple_of(8), 0);
    }
    seal(&mut out);
    out
}

#[test]
fn round_trip_is_exact() {
    for (n, far) in [(1, false), (2, true), (7, true), (40, false)] {
        let s = sample(n, far);
        let back = surfels(&encode(&s)).unwrap();
        assert_eq!(back.normalisation.known(), Some(s.normalisation()));
        assert_eq!(format!("{s:?}"), format!("{back:?}"));
    }
}

/// Velocities and accelerations come back with their unit, which is a bit of the header.
#[test]
fn the_unit_of_velocities_is_in_the_file() {
    let mut s = sample(5, true);
    for (velocity, acceleration) in [(true, false), (false, true), (true, true), (false, false)] {
        for unit in [VelocityUnit::Frame, VelocityUnit::Second] {
            let column = |wanted: bool, x: f32| vec![Vec3::new(x, 2.0, 3.0); if wanted { 5 } else { 0 }];
            (s.velocity, s.acceleration, s.velocity_unit) = (column(velocity, 1.0), column(acceleration, -1.0), unit);
            s.id = if velocity { vec![1, -2, i64::MAX, i64::MIN, 0] } else { Vec::new() };
            let bytes = encode(&s);
            let moves = velocity || acceleration;
            assert_eq!(bytes[12], 4 + if moves && unit == VelocityUnit::Second { 16 } else { 0 });
            let back = surfels(&bytes).unwrap();
            assert_eq!((&back.velocity, &back.acceleration, &back.id), (&s.velocity, &s.acceleration, &s.id));
            assert_eq!(back.velocity_unit, if moves { unit } else { VelocityUnit::Second });
        }
    }
    (s.velocity_unit, s.acceleration) = (VelocityUnit::Second, vec![Vec3::new(0.0, f32::NAN, 0.0); 5]);
    let e = surfels(&encode(&s)).unwrap_err().to_string();
    assert!(e.contains("an unusable acceleration at surfel 0"), "{e}");
}

#[test]
fn the_first_version_is_still_read() {
    for (n, far) in [(1, false), (2, true), (7, true), (40, false)] {
        let s = sample(n, far);
        let back = surfels(&encode_first_version(&s)).unwrap();
        assert!(back.normalisation.known().is_none());
        assert_eq!(format!("{s:?}"), format!("{back:?}"));
        assert_eq!(encode(&back), encode(&s));
    }
    // The oldest file that there is, written by the first version of the program.
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/corpus/bin/ok-three.bin");
    let old = std::fs::read(path).unwrap();
    assert_eq!((old[8], surfels(&old).unwrap().len()), (1, 3));
}

#[test]
fn layout_as_documented() {
    let s = sample(3, true);
    let bytes = encode(&s);
    assert_eq!(&bytes[..8], b"\x89SPLAT\r\n");
    assert_eq!((bytes[8], bytes[12], bytes[16], bytes[52]), (2, 4, 3, 8));
    assert_eq!(bytes[24..32], s.origin.x.to_le_bytes());
    let names = ["position", "axis_u", "axis_v", "normal", "colour", "material", "velocity", "normalisation"];
    let mut start = body(8);
    for (entry, name) in bytes[64..start].as_chunks::<48>().0.iter().zip(names) {
        let components = match name {
            "material" => 4_u32,
            "normalisation" => 1,
            _ => 3,
        };
        let length = 3 * 4 * components as usize;
        let padded = format!("{name:\0<24}");
        let expected = [
            padded.as_bytes(),
            &1_u32.to_le_bytes(),
            &components.to_le_bytes(),
            &(start as u64).to_le_bytes(),
            &(length as u64).to_le_bytes(),
        ];
        assert_eq!(*entry, *expected.concat(), "{name}");
        start += length.next_multiple_of(8);
    }
    // Three rows of 12 bytes and 4 of padding.
    let at = body(8);
    assert_eq!(bytes.len(), at + 6 * 40 + 3 * 16 + 16);
    assert_eq!(bytes[at + 40..at + 44], s.axis_u[0].x.to_le_bytes());
    assert_eq!(bytes[at + 5 * 40 + 12..at + 5 * 40 + 16], s.material[0].shininess.to_le_bytes());
    assert_eq!(bytes[at + 5 * 40 + 48..at + 5 * 40 + 52], s.velocity[0].x.to_le_bytes());
    assert_eq!(bytes[at + 6 * 40 + 52..at + 6 * 40 + 56], s.normalisation()[1].to_le_bytes());
    let mut sealed = bytes.clone();
    seal(&mut sealed);
    assert_eq!(sealed, bytes);
}

#[test]
fn columns_of_later_versions_are_skipped() {
    let s = sample(3, true);
    let good = encode(&s);
    // Another column in front, whose type and length mean nothing here, and none of normalisation.
    let shift = 48 + 8 - 48;
    let mut bytes = good[..64].to_vec();
    bytes.extend(b"of_a_later_version_\0\0\0\0\0");
    bytes.extend([77_u32, 9].map(u32::to_le_bytes).as_flattened());
    bytes.extend([body(8) as u64, 5].map(u64::to_le_bytes).as_flattened());
    for entry in good[64..body(7)].as_chunks::<48>().0 {
        bytes.extend(&entry[..32]);
        let start = u64::from_le_bytes(entry[32..40].try_into().unwrap());
        bytes.extend((start + shift).to_le_bytes());
        bytes.extend(&entry[40..]);
    }
    bytes.extend(b"later\0\0\0");
    bytes.extend(&good[body(8)..good.len() - 16]);
    seal(&mut bytes);
    let back = surfels(&bytes).unwrap();
    assert!(back.normalisation.known().is_none());
    assert_eq!(encode(&back), good);
}

/// A column of opacities is written after the normalisation, where there is one.
#[test]
fn opacities_come_back() {
    let mut s = sample(3, true);
    s.opacity = vec![0.0, 0.25, 1.0];
    let bytes = encode(&s);
    assert_eq!(bytes[52], 9);
    assert!(bytes[64 + 8 * 48..].starts_with(b"opacity\0"));
    let back = surfels(&bytes).unwrap();
    assert_eq!((&back.opacity, back.least_opacity()), (&s.opacity, 0.0));
    assert_eq!(format!("{s:?}"), format!("{back:?}"));
    assert_eq!(encode(&back), bytes);
    // The last column: three floats and 4 bytes of padding.
    let at = bytes.len() - 16 + 4;
    assert_eq!(bytes[at..at + 4], 0.25_f32.to_le_bytes());
    for opacity in [-0.001_f32, 1.001, f32::NAN, f32::INFINITY] {
        let e = message(&bytes, at, &opacity.to_le_bytes());
        assert!(e.starts_with(&format!("byte {at}: found an unusable opacity at surfel 1")), "{e}");
        assert!(e.contains("opacities from 0 to 1"), "{e}");
    }
    let e = message(&bytes, 64 + 8 * 48 + 40, &[8]);
    assert!(e.contains("column `opacity` of 8 bytes for 3 surfels, expected 4 bytes"), "{e}");
}

#[test]
fn options_of_a_scene() {
    let dir = tempfile::tempdir().unwrap();
    // The content decides, not the extension.
    let path = dir.path().join("a.ply");
    let mut s = sample(3, false);
    s.colour[0] = Vec3::splat(188.0 / 255.0);
    write_bin(&path, &s).unwrap();
    let options = LoadOptions { radius_scale: 2.0, colour_space: Some(ColourSpace::Srgb), ..LoadOptions::default() };
    let back = crate::support::surfels(load(&path, &options, &|_, _| {}).unwrap());
    assert_eq!(back.axis_u[1], s.axis_u[1] * 2.0);
    // Larger discs overlap more.
    assert!(back.normalisation.known().is_none());
    assert!((back.colour[0].x - 0.502_886).abs() < 1e-6);
}

#[test]
fn damage_is_found() {
    let good = encode(&sample(5, true));
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        assert!(surfels(&bad).is_err(), "byte {at}");
    }
    for length in 0..good.len() {
        assert!(surfels(&good[..length]).is_err(), "length {length}");
    }
    assert!(surfels(&[good.as_slice(), &[0]].concat()).is_err());
}

/// Bytes `with` put at `at` of a file, with a right checksum, are refused with this message.
fn message(good: &[u8], at: usize, with: &[u8]) -> String {
    let mut bad = good.to_vec();
    bad[at..at + with.len()].copy_from_slice(with);
    seal(&mut bad);
    surfels(&bad).unwrap_err().to_string()
}

#[test]
fn nonsense_with_a_right_checksum_is_refused() {
    let s = sample(3, true);
    let nan = f32::NAN.to_le_bytes();
    for (good, body, size) in [(encode_first_version(&s), 64, 352), (encode(&s), body(8), 752)] {
        let refused = |at: usize, with: &[u8]| message(&good, at, with);
        for (at, what) in [
            (0, "position"),
            (40, "pair of axes"),
            (120, "normal"),
            (160, "colour"),
            (200, "material"),
            (248, "velocity"),
        ] {
            let e = refused(body + at, &nan);
            assert!(e.starts_with(&format!("byte {}: found an unusable {what} at surfel 0", body + at)), "{e}");
        }
        assert!(refused(body + 120 + 24, &2_f32.to_le_bytes()).contains("an unusable normal at surfel 2"));
        assert!(refused(body + 40, &[0; 12]).contains("an unusable pair of axes"));
        assert!(refused(24, &f64::INFINITY.to_le_bytes()).contains("origin"));
        for version in [0, 3] {
            assert!(refused(8, &[version]).contains(&format!("found version {version}, expected 1 to 2")));
        }
        assert!(refused(12, &[31]).contains("column mask 0x1f"));
        assert!(refused(60, &[1]).contains("reserved"));
        // Counts whose product overflows, or would fill the memory.
        for count in [u64::MAX, u64::MAX / 12, 1 << 40, 4, 2] {
            let e = refused(16, &count.to_le_bytes());
            let (first, second) = (
                format!("found {count} surfels in a file of {size} bytes"),
                format!("column `position` of 36 bytes for {count} surfels, expected 12 bytes for each surfel"),
            );
            assert!(e.contains(if body == 64 { &first } else { &second }), "{e}");
        }
    }
}

#[test]
fn directories_that_lie_are_refused() {
    let good = encode(&sample(3, true));
    let refused = |at: usize, with: &[u8]| message(&good, at, with);
    let has = |found: String, expected: &str| assert!(found.contains(expected), "{found}\n  expected {expected}");
    // Bits of the first version's columns.
    has(refused(12, &[1]), "byte 12: found column mask 0x1, expected bits 2");
    has(refused(52, &[0xff; 4]), "byte 52: found 4294967295 columns, expected at most 14: 688 bytes are left");
    has(refused(52, &[15]), "byte 52: found 15 columns");
    has(refused(52, &[7]), "found column `position` at byte 448, expected byte 400");
    has(refused(52, &[9]), "found column `position` at byte 448, expected byte 496");
    // Names.
    has(refused(64, &[0]), "byte 64: found column name `\\0osition");
    has(refused(64, b"P"), "expected a name of a to z, 0 to 9 and _");
    has(refused(64 + 20, b"x"), "found column name");
    has(refused(112, b"position"), "byte 112: found a second column `position`, expected different names");
    has(refused(64, b"q"), "byte 64: found no column `position`");
    // Type, components, start, length of axis_u.
    has(refused(112 + 24, &[2]), "byte 136: found column `axis_u` of type 2 with 3 components, expected type 1 with 3");
    has(refused(112 + 28, &[0xff; 4]), "byte 136: found column `axis_u` of type 1 with 4294967295 components");
    for start in [0, 64, 448, 480, 496, u64::MAX] {
        let expected = format!("byte 144: found column `axis_u` at byte {start}, expected byte 488");
        has(refused(112 + 32, &start.to_le_bytes()), &expected);
    }
    for length in [265, u64::MAX, u64::MAX - 7] {
        let expected = format!("byte 152: found column `axis_u` of {length} bytes, expected at most 264");
        has(refused(112 + 40, &length.to_le_bytes()), &expected);
    }
    has(refused(112 + 40, &[37]), "byte 152: found column `axis_u` of 37 bytes for 3 surfels, expected 12 bytes");
    has(refused(64 + 7 * 48 + 40, &[4]), "column `normalisation` of 4 bytes for 3 surfels, expected 4 bytes");
    // A file that goes on.
    let mut longer = [good.as_slice(), &[0; 8]].concat();
    seal(&mut longer);
    let e = surfels(&longer).unwrap_err().to_string();
    has(e, "byte 52: found columns up to byte 752 in a file of 760 bytes, expected a file that ends");
    // Factors.
    let at = body(8) + 6 * 40 + 48 + 4;
    for factor in [0.0, -1.0, 2.3131, f32::NAN, f32::INFINITY] {
        let e = refused(at, &factor.to_le_bytes());
        has(e, &format!("byte {at}: found the normalisation {factor} at surfel 1, expected a factor above 0"));
    }
}
