//! Points of files as spheres: radii, files that hold spheres, meshes, and clouds that fill a volume.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use splatblur::model::{
    Kind, LoadOptions, LoadedModel, LoadedShape, ModelError, PointOptions, Surfels, load, write_bin,
};

fn loaded(path: &Path, kind: Option<Kind>, radius: Option<f64>) -> Result<(Surfels, Vec<String>), ModelError> {
    let points = PointOptions { radius, ..PointOptions::default() };
    let options = LoadOptions { kind, points, ..LoadOptions::default() };
    load(path, &options, &|_, _| {}).map(|LoadedModel { shape, notes, .. }| match shape {
        LoadedShape::Surfels(surfels, None) => (surfels, notes),
        other => panic!("{other:?}"),
    })
}

fn radii(surfels: &Surfels) -> Vec<f32> {
    (0..surfels.len()).map(|i| surfels.radius(i)).collect()
}

/// A radius of a file counts, then that of all; what has none has the one of its neighbourhood.
#[test]
fn radii_are_those_of_the_file_or_of_all() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.xyz");
    fs::write(&path, "x y z radius\n0 0 0 0.5\n1 0 0 -2\n2 0 0 nan\n3 0 0 0.25\n").unwrap();
    let (spheres, notes) = loaded(&path, Some(Kind::Spheres), None).unwrap();
    assert!(spheres.spheres && spheres.two_sided && !spheres.signs_estimated);
    // The middles of the distances to the others are 2, 1, 1 and 2.
    assert_eq!([radii(&spheres)[0], radii(&spheres)[3]], [0.5, 0.25]);
    assert_eq!(radii(&spheres)[1], radii(&spheres)[2]);
    assert_eq!(radii(&spheres)[1], 0.65);
    assert!(notes.iter().any(|note| note.contains("spheres without a radius")), "{notes:?}");
    assert!(!notes.iter().any(|note| note.contains("normals")), "{notes:?}");
    assert_eq!(radii(&loaded(&path, Some(Kind::Spheres), Some(0.125)).unwrap().0), [0.125; 4]);
    assert_eq!(radii(&loaded(&path, Some(Kind::Surfels), Some(0.125)).unwrap().0), [0.125; 4]);
}

#[test]
fn our_own_format_keeps_them() {
    let dir = tempfile::tempdir().unwrap();
    let [text, own] = ["a.xyz", "a.bin"].map(|name| dir.path().join(name));
    fs::write(&text, "x y z radius\n0 0 0 0.5\n1 0 0 2\n").unwrap();
    let (spheres, _) = loaded(&text, Some(Kind::Spheres), None).unwrap();
    write_bin(&own, &spheres).unwrap();
    let (again, notes) = loaded(&own, None, None).unwrap();
    assert!(again.spheres && notes.is_empty());
    assert_eq!(radii(&again), [0.5, 2.0]);
    let why = loaded(&own, Some(Kind::Surfels), None).unwrap_err().to_string();
    assert!(why.ends_with("a.bin holds spheres, which are no surfels (kind `surfels`)"), "{why}");
    // Discs become spheres of their longer radius.
    let (discs, _) = loaded(&text, Some(Kind::Surfels), None).unwrap();
    write_bin(&own, &discs).unwrap();
    let (turned, _) = loaded(&own, Some(Kind::Spheres), None).unwrap();
    assert!(turned.spheres && radii(&turned).iter().zip([0.5, 2.0]).all(|(a, b)| (a - b).abs() < 1e-6));
}

/// A mesh has a sphere about each vertex.
#[test]
fn vertices_of_meshes_are_points() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.obj");
    fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let (spheres, _) = loaded(&path, Some(Kind::Spheres), Some(0.1)).unwrap();
    assert_eq!(radii(&spheres), [0.1; 3]);
    let glb = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/models/BoxTextured.glb");
    assert_eq!(loaded(&glb, Some(Kind::Spheres), None).unwrap().0.len(), 24);
}

/// Clouds without normals that fill a volume are told; surfaces are not.
#[test]
fn what_fills_a_volume_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let told = |name: &str, place: &dyn Fn(f64, f64, f64) -> [f64; 3]| {
        let path = dir.path().join(name);
        let mut text = String::new();
        for i in 0..4000_u32 {
            let [a, b, c] = [2_u32, 3, 5].map(|base| radical_inverse(i, base));
            let [x, y, z] = place(a, b, c);
            writeln!(text, "{x} {y} {z}").unwrap();
        }
        fs::write(&path, text).unwrap();
        loaded(&path, None, None).unwrap().1.iter().any(|note| note.contains("fill a volume"))
    };
    assert!(told("box.xyz", &|a, b, c| [a, b, c]));
    assert!(told("slab.xyz", &|a, b, c| [a, b, 0.2 * c]));
    assert!(!told("plane.xyz", &|a, b, c| [a, b, 1e-3 * c]));
    assert!(!told("cylinder.xyz", &|a, b, _| [(6.0 * a).cos(), (6.0 * a).sin(), b]));
}

/// A point of the sequence of Halton in one dimension.
fn radical_inverse(mut i: u32, base: u32) -> f64 {
    let (mut share, mut sum) = (1.0, 0.0);
    while i > 0 {
        share /= f64::from(base);
        sum += share * f64::from(i % base);
        i /= base;
    }
    sum
}
