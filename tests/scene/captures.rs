//! Captures against an exact picture of one: the reader and the definition, without the renderer.

use std::fs;
use std::path::Path;

use glam::DVec3;
use splatblur::image;
use splatblur::model::{Format, parse_capture};

use crate::support::gaussians::{View, picture, psnr};

/// Positions, sizes, turns, opacities and colours of the plain PLY are what the picture was made of. The code that made
/// it is not ours, and neither splatter nor reference has a part in this test.
#[test]
fn the_guitar_makes_the_exact_picture() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let bytes = fs::read(root.join("scenes/models/guitar_3dgs.ply")).unwrap();
    let guitar = parse_capture(&bytes, Format::Ply).unwrap().unwrap();
    assert_eq!((guitar.len(), guitar.degree, guitar.dropped), (90_854, 0, 0));

    let truth = image::read(&root.join("tests/data/truth/captures/guitar_0.exr")).unwrap();
    let want: Vec<[f64; 4]> = truth.rgba.iter().map(|pixel| pixel.map(f64::from)).collect();
    let size = [truth.width as usize, truth.height as usize];
    let view = View { eye: DVec3::new(0.0, -2.0, 6.0), at: DVec3::new(0.0, -2.0, 0.0), size };
    let found = psnr(&picture(&guitar, &view), &want);
    println!("{found:.1} dB");
    assert!(found >= 80.0, "{found:.1} dB");
}
