//! What may be opened at all, and what a user is told.

use splatblur::model::{LoadOptions, MeshOptions, ModelError, Spacing, load};

use super::support::{data, load_as};
use crate::support::surfels;

fn message(path: &std::path::Path) -> String {
    load(path, &LoadOptions::default(), &|_, _| {}).unwrap_err().to_string()
}

#[test]
fn only_regular_files_are_opened() {
    let dir = tempfile::tempdir().unwrap();
    assert!(message(dir.path()).ends_with("is a directory, expected a regular file"));
    assert!(message(&dir.path().join("missing")).starts_with("cannot read model"));
    let empty = dir.path().join("empty.ply");
    std::fs::write(&empty, b"").unwrap();
    assert!(message(&empty).ends_with("is empty (0 bytes)"));
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_are_refused_without_waiting() {
    assert!(message(std::path::Path::new("/dev/zero")).ends_with("is a device, expected a regular file"));
    let dir = tempfile::tempdir().unwrap();
    let pipe = dir.path().join("pipe.ply");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    assert!(message(&pipe).ends_with("is a pipe, expected a regular file"));
}

#[test]
fn errors_name_the_file() {
    for (name, bytes, expected) in [
        (
            "a.ply",
            b"plywood".as_slice(),
            "a.ply is of no known format (known: PLY, Pointshop3D .sfl, Wavefront .obj, points as text .xyz, \
             .csv, .txt and .pts, arrays .npy and .npz, splatblur .bin, glTF .glb and .gltf, Gaussian splats .splat, \
             .spz, .sog and .glb, volumes .nrrd, scans .las, .laz and .e57)",
        ),
        ("a.dat", b"%YAML", "a.dat is of no known format"),
        ("b.ply", b"ply\nformat ascii 2.0\n", "b.ply: line 2: found PLY version `2.0`, expected 1.0"),
        ("c", b"GFLF\0\0\0\x07", "c: byte 8: found the end of the file, expected 4 bytes"),
    ] {
        let e = load_as(name, bytes).unwrap_err().to_string();
        assert!(e.contains(expected), "{e}");
    }
}

#[test]
fn a_model_of_unusable_points() {
    let header = "property float x\nproperty float y\nproperty float z\nend_header\n";
    let e =
        load_as("a.ply", format!("ply\nformat ascii 1.0\nelement vertex 1\n{header}nan 0 0\n").as_bytes()).unwrap_err();
    assert!(matches!(e, ModelError::NoPointsIn { .. }));
    assert!(
        e.to_string()
            .ends_with("a.ply has no usable points: 1 points dropped: a coordinate is not finite or beyond 1e18")
    );
    let e = load_as("a.ply", format!("ply\nformat ascii 1.0\nelement vertex 0\n{header}").as_bytes()).unwrap_err();
    assert!(e.to_string().ends_with("a.ply has no usable points"), "{e}");
}

#[test]
fn files_of_the_test_set() {
    for (name, count) in [("tiny_full.sfl", 3), ("spot_1500_ascii.ply", 1500), ("spot_mesh_be.ply", 2930)] {
        let mesh = MeshOptions { spacing: Spacing::None, ..MeshOptions::default() };
        let loaded = load(&data(name), &LoadOptions { mesh, ..LoadOptions::default() }, &|_, _| {}).unwrap();
        assert_eq!(surfels(loaded).len(), count, "{name}");
    }
}

#[cfg(not(feature = "formats"))]
#[test]
fn readers_left_out_of_the_build_name_their_feature() {
    for (name, bytes, found) in
        [("a.sog", b"PK\x03\x04".as_slice(), "a SOG capture"), ("a.spz", b"NGSP\x04\0\0\0", "an SPZ capture")]
    {
        let e = load_as(name, bytes).unwrap_err().to_string();
        let says = format!("{name}: byte 0: found {found}, expected a program built with the Cargo feature `formats`");
        assert!(e.contains(&says), "{e}");
    }
}
