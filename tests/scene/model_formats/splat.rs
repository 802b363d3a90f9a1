//! `.splat`: every field against values computed by hand.

use glam::{Quat, Vec3};
use splatblur::model::{Gaussians, ModelFormat, parse_capture};

use super::support::{cloud, load_as, refused};
use crate::support::gaussians;

fn record(floats: [f32; 6], bytes: [u8; 8]) -> Vec<u8> {
    let mut record: Vec<u8> = floats.iter().flat_map(|v| v.to_le_bytes()).collect();
    record.extend(bytes);
    record
}

fn capture(bytes: &[u8]) -> Gaussians {
    parse_capture(bytes, ModelFormat::Splat).unwrap().unwrap()
}

#[test]
fn each_field() {
    let first = record([1.5, -2.25, 1e6, 0.5, 0.25, 0.125], [255, 51, 0, 204, 192, 64, 192, 192]);
    let second = record([0.0, 0.0, 0.0, 1.0, 2.0, 3.0], [0, 0, 255, 255, 128, 128, 128, 0]);
    let c = capture(&[first, second].concat());
    assert_eq!((c.len(), c.degree, c.dropped, c.harmonics.len()), (2, 0, 0, 0));
    assert_eq!(c.position, [Vec3::new(1.5, -2.25, 1e6), Vec3::ZERO]);
    assert_eq!(c.sigma, [Vec3::new(0.5, 0.25, 0.125), Vec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(c.opacity, [0.8, 1.0]);
    assert!((c.colour(0) - Vec3::new(1.0, 0.2, 0.0)).length() < 1e-6, "{}", c.colour(0));
    assert!((c.colour(1) - Vec3::Z).length() < 1e-6, "{}", c.colour(1));
    // w x y z = 1/2, -1/2, 1/2, 1/2, and 0, 0, 0, -1.
    assert_eq!(c.rotation, [Quat::from_xyzw(-0.5, 0.5, 0.5, 0.5), Quat::from_xyzw(0.0, 0.0, -1.0, 0.0)]);
}

#[test]
fn rotations_are_made_of_length_one() {
    let c = capture(&record([0.0; 6], [0, 0, 0, 0, 128 + 60, 128, 128 - 80, 128]));
    assert!(c.rotation[0].abs_diff_eq(Quat::from_xyzw(0.0, -0.8, 0.0, 0.6), 1e-6), "{}", c.rotation[0]);
}

#[test]
fn a_part_of_a_record_is_refused() {
    let bytes = [record([1.0; 6], [200; 8]), record([2.0; 6], [200; 8])].concat();
    for length in (0..64).filter(|length| length % 32 != 0) {
        let e = refused(&bytes[..length], ModelFormat::Splat).to_string();
        let (at, rest) = (length / 32 * 32, length % 32);
        assert_eq!(e, format!("byte {at}: found {rest} bytes of a record, expected 32: is the file cut short?"));
    }
    assert_eq!(capture(&bytes[..32]).len(), 1);
    assert!(capture(&[]).is_empty());
}

#[test]
fn what_cannot_be_drawn_is_dropped_and_counted() {
    let good = record([1.0; 6], [200; 8]);
    let mut bytes = good.clone();
    for value in [f32::NAN, f32::INFINITY, -1e30] {
        for place in 0..6 {
            let mut floats = [1.0; 6];
            floats[place] = value;
            bytes.extend(record(floats, [200; 8]));
        }
    }
    // A negative sigma, and no rotation.
    bytes.extend(record([1.0, 1.0, 1.0, 1.0, -1.0, 1.0], [200; 8]));
    bytes.extend(record([1.0; 6], [200, 200, 200, 200, 128, 128, 128, 128]));
    let c = capture(&bytes);
    assert_eq!((c.len(), c.dropped), (1, 20));
    assert!(cloud(&bytes, ModelFormat::Splat).notes[0].contains("1 of 21 kept"));
}

#[test]
fn the_extension_shows_the_format() {
    let bytes = record([1.0, 2.0, 3.0, 1.0, 1.0, 0.5], [255, 255, 255, 255, 255, 128, 128, 128]);
    for name in ["a.splat", "a.SPLAT"] {
        let loaded = load_as(name, &bytes).unwrap();
        assert_eq!(gaussians(loaded).position, [Vec3::new(1.0, 2.0, 3.0)]);
    }
    load_as("a.dat", &bytes).unwrap_err();
    let e = load_as("short.splat", &bytes[..31]).unwrap_err().to_string();
    assert!(e.contains("short.splat: byte 0: found 31 bytes of a record"), "{e}");
}

#[test]
fn other_formats_are_no_captures() {
    let text = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                 end_header\n1 2 3\n";
    assert!(parse_capture(text, ModelFormat::Ply).unwrap().is_none());
    assert!(parse_capture(b"1 2 3\n", ModelFormat::Xyz).unwrap().is_none());
}
