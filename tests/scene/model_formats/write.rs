//! Surfels for the writers' tests, and what comes back from a written PLY.

use glam::{DVec3, Vec3};
use splatblur::math::srgb;
use splatblur::model::{LoadOptions, Material, Surfels, VelocityUnit, load, write_ply};

use crate::support::surfels;

/// `n` surfels that differ in everything; `far`: with an origin, materials, velocities and colours above 1.
pub(crate) fn sample(n: usize, far: bool) -> Surfels {
    let mut s = Surfels::default();
    for i in 0..n {
        let k = i as f32;
        let normal = Vec3::new(k.sin(), k.cos(), 0.3).normalize();
        let (u, v) = normal.any_orthonormal_pair();
        // Symmetric about the origin, so that the reader chooses the same one.
        let side = if i % 2 == 0 { 1.0 } else { -1.0 };
        s.position.push(Vec3::new(1.0 + (i / 2) as f32, 0.37 * k, -k) * side);
        s.axis_u.push(u * (0.1 + k));
        s.axis_v.push(v * 0.05);
        s.normal.push(normal);
        let grey = if far { 1.5 } else { srgb::to_linear((f64::from(i as u8) / 255.0) as f32) };
        s.colour.push(Vec3::new(grey, 0.0, 1.0));
        if far {
            s.material.push(Material { ambient: 0.1 * k, diffuse: 0.7, specular: 0.3, shininess: k });
            s.velocity.push(Vec3::new(k, -k, 0.1));
        }
    }
    if far {
        s.origin = DVec3::new(4.5e6, -1e7, 0.25);
        s.two_sided = true;
        s.velocity_unit = VelocityUnit::Frame;
    }
    s
}

fn round_trip(s: &Surfels) -> (Surfels, String) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.ply");
    write_ply(&path, s).unwrap();
    let header = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).split("end_header").next().unwrap().to_owned();
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "a temporary file was left");
    (surfels(load(&path, &LoadOptions::default(), &|_, _| {}).unwrap()), header)
}

#[test]
fn ply_round_trip() {
    for far in [false, true] {
        let s = sample(40, far);
        let (back, header) = round_trip(&s);
        assert_eq!(header.contains("double x"), far);
        assert_eq!(header.contains("uchar red"), !far);
        assert_eq!((&back.normal, &back.colour), (&s.normal, &s.colour));
        assert_eq!((&back.axis_u, &back.axis_v), (&s.axis_u, &s.axis_v));
        assert_eq!(back.two_sided, s.two_sided);
        assert_eq!((&back.material, &back.velocity), (&s.material, &s.velocity));
        assert_eq!((&back.acceleration, back.velocity_unit), (&s.acceleration, s.velocity_unit));
        assert_eq!(header.contains("comment splatblur velocities are per frame"), far);
        for i in 0..s.len() {
            let position = |s: &Surfels| s.origin + s.position[i].as_dvec3();
            // Recentred on the middle of the box: half a unit in the last place of the largest coordinate.
            assert!((position(&s) - position(&back)).abs().max_element() < 4e-6, "{i}");
        }
    }
}

#[test]
fn ply_keeps_opacities() {
    let mut s = sample(4, false);
    s.opacity = vec![0.0, 0.1, 0.5, 1.0];
    let (back, header) = round_trip(&s);
    assert!(header.contains("property float alpha\n"), "{header}");
    assert_eq!(back.opacity, s.opacity);
    // All as good as 1: opaque.
    s.opacity = vec![1.0, 0.997, 1.0, 1.0];
    assert!(round_trip(&s).0.opacity.is_empty());
    s.opacity = vec![1.0, 0.995, 1.0, 1.0];
    assert_eq!(round_trip(&s).0.opacity, s.opacity);
    s.opacity.pop();
    let e = write_ply(std::path::Path::new("a.ply"), &s).unwrap_err().to_string();
    assert_eq!(e, "surfels to be written have 3 of `opacity`, expected 4");
}

#[test]
fn ply_keeps_accelerations() {
    let mut s = sample(4, false);
    s.acceleration = (0..4).map(|i| Vec3::new(0.5, -1.0, i as f32)).collect();
    s.id = vec![5, -3, 1 << 53, 0];
    for velocity in [Vec::new(), vec![Vec3::X; 4]] {
        s.velocity = velocity;
        let (back, header) = round_trip(&s);
        assert!(header.contains("property float ax\n") && !header.contains("per frame"), "{header}");
        assert_eq!((&back.velocity, &back.acceleration, &back.id), (&s.velocity, &s.acceleration, &s.id));
        assert_eq!(back.velocity_unit, VelocityUnit::Second);
    }
    // Points that all rest need no column.
    s.velocity = vec![Vec3::ZERO; 4];
    s.acceleration.fill(Vec3::ZERO);
    assert!(round_trip(&s).0.paths().is_empty());
}

#[test]
fn unequal_columns_and_bad_paths_are_refused() {
    let mut s = sample(3, true);
    s.velocity.pop();
    let dir = tempfile::tempdir().unwrap();
    let e = write_ply(&dir.path().join("a.ply"), &s).unwrap_err().to_string();
    assert_eq!(e, "surfels to be written have 2 of `velocity`, expected 3");
    s.velocity.clear();
    assert!(
        write_ply(&dir.path().join("missing/a.ply"), &s).unwrap_err().to_string().starts_with("cannot write model")
    );
    // A directory in the way: the rename fails and the temporary file goes.
    std::fs::create_dir(dir.path().join("b.ply")).unwrap();
    assert!(write_ply(&dir.path().join("b.ply"), &s).is_err());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}
