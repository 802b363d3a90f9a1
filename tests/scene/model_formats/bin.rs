//! Our own format.

use glam::Vec3;
use splatblur::model::{ColourSpace, LoadOptions, Surfels, load, write_bin};

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

#[test]
fn round_trip_is_exact() {
    for (n, far) in [(1, false), (2, true), (7, true), (40, false)] {
        let s = sample(n, far);
        let back = surfels(&encode(&s)).unwrap();
        assert_eq!(format!("{s:?}"), format!("{back:?}"));
    }
}

#[test]
fn layout_as_documented() {
    let s = sample(3, true);
    let bytes = encode(&s);
    assert_eq!(&bytes[..8], b"\x89SPLAT\r\n");
    assert_eq!((bytes[8], bytes[12], bytes[16]), (1, 7, 3));
    assert_eq!(bytes[24..32], s.origin.x.to_le_bytes());
    // Three rows of 12 bytes and 4 of padding.
    assert_eq!(bytes.len(), 64 + 6 * 40 + 3 * 16);
    assert_eq!(bytes[64 + 40..64 + 44], s.axis_u[0].x.to_le_bytes());
    assert_eq!(bytes[64 + 5 * 40 + 12..64 + 5 * 40 + 16], s.material[0].shininess.to_le_bytes());
    assert_eq!(bytes[64 + 5 * 40 + 48..64 + 5 * 40 + 52], s.velocity[0].x.to_le_bytes());
    let mut sealed = bytes.clone();
    seal(&mut sealed);
    assert_eq!(sealed, bytes);
}

#[test]
fn options_of_a_scene() {
    let dir = tempfile::tempdir().unwrap();
    // The content decides, not the extension.
    let path = dir.path().join("a.ply");
    let mut s = sample(3, false);
    s.colour[0] = Vec3::splat(188.0 / 255.0);
    write_bin(&path, &s).unwrap();
    let options = LoadOptions { radius_scale: 2.0, colour_space: Some(ColourSpace::Srgb) };
    let back = load(&path, &options, &|_, _| {}).unwrap().surfels;
    assert_eq!(back.axis_u[1], s.axis_u[1] * 2.0);
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

#[test]
fn nonsense_with_a_right_checksum_is_refused() {
    let good = encode(&sample(3, true));
    let message = |at: usize, with: &[u8]| {
        let mut bad = good.clone();
        bad[at..at + with.len()].copy_from_slice(with);
        seal(&mut bad);
        surfels(&bad).unwrap_err().to_string()
    };
    let nan = f32::NAN.to_le_bytes();
    for (at, what) in [
        (64, "position"),
        (104, "pair of axes"),
        (184, "normal"),
        (224, "colour"),
        (264, "material"),
        (312, "velocity"),
    ] {
        assert!(message(at, &nan).contains(&format!("an unusable {what} at surfel 0")), "{}", message(at, &nan));
    }
    assert!(message(184, &2_f32.to_le_bytes()).contains("an unusable normal"));
    assert!(message(104, &[0; 12]).contains("an unusable pair of axes"));
    assert!(message(24, &f64::INFINITY.to_le_bytes()).contains("origin"));
    assert!(message(8, &[2]).contains("found version 2, expected 1"));
    assert!(message(12, &[31]).contains("column mask 0x1f"));
    assert!(message(60, &[1]).contains("reserved"));
    // Counts whose product overflows, or would fill the memory.
    for count in [u64::MAX, u64::MAX / 12, 1 << 40, 4, 2] {
        let e = message(16, &count.to_le_bytes());
        assert!(e.contains(&format!("found {count} surfels in a file of 352 bytes")), "{e}");
    }
}
