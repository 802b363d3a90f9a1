//! Models and motions that a program has in memory.

use splatblur::fields::Interpolation;
use splatblur::glam::{DMat4, DQuat, DVec3, Quat, Vec3};
use splatblur::{AnimationBinding, Gaussians, Object, Optics, Surfels, VelocityUnit};

/// Colours in code are linear light: nothing decodes them.
#[test]
fn colours_of_points_are_linear() {
    let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];
    let colour = Vec3::new(0.5, 0.25, 0.125);
    let (surfels, notes) = Surfels::builder(positions).colours([colour; 4]).normals([Vec3::Z; 4]).build().unwrap();
    assert_eq!(surfels.colour, [colour; 4]);
    assert!(surfels.axis_u.iter().all(|axis| axis.length() > 0.1), "radii are estimated");
    assert!(notes.iter().any(|note| note.starts_with("radii of all 4 points estimated")), "{notes:?}");
}

/// Columns are sorted together, and what cannot be drawn is named.
#[test]
fn columns_of_points_stay_together() {
    let positions: Vec<DVec3> = (0..50).map(|i| DVec3::new(f64::from(i * 37 % 50), f64::from(i % 7), 0.0)).collect();
    let velocities: Vec<Vec3> = positions.iter().map(|p| p.as_vec3() * 0.5).collect();
    let with = |positions: Vec<DVec3>| {
        Surfels::builder(positions)
            .normals([Vec3::Z; 50])
            .radii([0.5; 50])
            .velocities(velocities.clone(), VelocityUnit::Frame)
            .accelerations([Vec3::Y; 50])
            .build()
            .unwrap()
    };
    let (surfels, notes) = with(positions.clone());
    assert_eq!((surfels.velocity_unit, notes), (VelocityUnit::Frame, vec!["no colours: grey".to_owned()]));
    for (p, velocity) in surfels.position.iter().zip(&surfels.velocity) {
        let place = surfels.origin + p.as_dvec3();
        assert!((place.as_vec3() * 0.5 - *velocity).length() < 1e-5, "{place} {velocity}");
    }
    let mut damaged = positions;
    damaged[3].x = f64::NAN;
    let (surfels, notes) = with(damaged);
    assert_eq!((surfels.len(), surfels.velocity.len()), (49, 49));
    assert!(notes.iter().any(|note| note.starts_with("1 points dropped")), "{notes:?}");
}

fn fog() -> Gaussians {
    Gaussians {
        position: vec![Vec3::ZERO, Vec3::X],
        sigma: vec![Vec3::splat(0.2); 2],
        rotation: vec![Quat::IDENTITY; 2],
        opacity: vec![0.8; 2],
        base: vec![Gaussians::base_of(Vec3::new(0.9, 0.4, 0.1)); 2],
        linear: true,
        ..Gaussians::default()
    }
}

/// Breaks a capture.
type Flaw = fn(&mut Gaussians);

#[test]
fn gaussians_are_checked_when_they_become_an_object() {
    let object = Object::from_gaussians(fog()).unwrap();
    assert_eq!(object.shape.elements(), 2);
    assert!((object.shape.gaussians().unwrap().gaussians().colour(0) - Vec3::new(0.9, 0.4, 0.1)).length() < 1e-6);
    let flaws: [(&str, Flaw); 4] = [
        ("opacity[1]", |g| g.opacity[1] = 1.5),
        ("sigma", |g| g.sigma.truncate(1)),
        ("rotation[0]", |g| g.rotation[0] = Quat::from_xyzw(0.0, 0.0, 0.0, 2.0)),
        ("harmonics", |g| g.degree = 1),
    ];
    for (field, flaw) in flaws {
        let mut gaussians = fog();
        flaw(&mut gaussians);
        let refused = Object::from_gaussians(gaussians).unwrap_err().to_string();
        assert!(refused.starts_with(&format!("`{field}` is ")), "{refused}");
    }
    // A volume's extinction has no such bound.
    let thick = Gaussians { opacity: vec![9.0; 2], optics: Optics::Extinction { layer: 0.1 }, ..fog() };
    assert!(Object::from_gaussians(thick).is_ok());
    assert!(Object::from_gaussians(Gaussians::default()).is_err());
}

fn close(a: DMat4, b: DMat4) -> bool {
    a.abs_diff_eq(b, 1e-12)
}

/// At its time a pose is what was given. Between two, the place is on a line and the turn at constant speed.
#[test]
fn poses_are_kept_and_interpolated() {
    let pose = |angle: f64, x: f64, scale: f64| {
        let turn = DQuat::from_rotation_y(angle);
        DMat4::from_scale_rotation_translation(DVec3::new(scale, 1.0, 1.0), turn, DVec3::X * x)
    };
    // All mirror.
    let poses = [pose(0.0, 1.0, -2.0), pose(1.0, 3.0, -4.0), pose(1.0, 3.0, -4.5)];
    let motion = AnimationBinding::from_poses(25.0, &[-2.0, 5.0, 6.0], &poses).unwrap();
    let at = |frame: f64| motion.node.at(frame / 25.0, Interpolation::Linear).matrix;
    for (frame, pose) in [(-9.0, 0), (-2.0, 0), (5.0, 1), (6.0, 2), (99.0, 2)] {
        assert!(close(at(frame), poses[pose]), "{frame}: {}", at(frame));
    }
    assert!(close(at(1.5), pose(0.5, 2.0, -3.0)), "{}", at(1.5));
    assert!(close(at(-1.0), pose(1.0 / 7.0, 1.0 + 2.0 / 7.0, -2.0 - 2.0 / 7.0)), "{}", at(-1.0));
    // A rigid motion has no keys of scale, so that a camera needs no note of it.
    let rigid = [DMat4::from_rotation_z(0.3), DMat4::from_rotation_z(1.1)];
    assert!(!AnimationBinding::from_poses(25.0, &[0.0, 1.0], &rigid).unwrap().node.has_scale());
}

/// The field that is wrong, the rate, the times and the poses.
type PoseFlaw<'a> = (&'a str, f64, &'a [f64], &'a [DMat4]);

#[test]
fn poses_that_are_none_are_refused() {
    let one = DMat4::IDENTITY;
    let sheared = DMat4::from_cols_array_2d(&[
        [1.0, 0.0, 0.0, 0.0],
        [0.5, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]);
    let flat = DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0));
    // Axes of full length in one plane.
    let plane = DMat4::from_cols(one.x_axis, one.x_axis, one.z_axis, one.w_axis);
    let far = DMat4::from_translation(DVec3::X * f64::NAN);
    let perspective = DMat4::from_cols(one.x_axis, one.y_axis, one.z_axis - one.w_axis, one.w_axis);
    let mirrored = DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0));
    let flaws: [PoseFlaw; 12] = [
        ("rate", 0.0, &[0.0], &[one]),
        ("poses", 24.0, &[], &[]),
        ("poses", 24.0, &[0.0, 1.0], &[one]),
        ("frames[0]", 24.0, &[f64::NAN], &[one]),
        ("frames[2]", 24.0, &[0.0, 2.0, 1.0], &[one; 3]),
        ("frames[1]", 24.0, &[1.0, 1.0], &[one; 2]),
        ("poses[1]", 24.0, &[0.0, 1.0], &[one, flat]),
        ("poses[0]", 24.0, &[0.0, 1.0], &[sheared, one]),
        ("poses[2]", 24.0, &[0.0, 1.0, 2.0], &[mirrored, mirrored, one]),
        ("poses[0]", 24.0, &[0.0], &[plane]),
        ("poses[0]", 24.0, &[0.0], &[far]),
        ("poses[0]", 24.0, &[0.0], &[perspective]),
    ];
    for (field, rate, frames, poses) in flaws {
        let refused = AnimationBinding::from_poses(rate, frames, poses).unwrap_err();
        assert_eq!(refused.field, field, "{refused}");
    }
}
