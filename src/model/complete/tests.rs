//! Tests of completion: what is kept, estimated, dropped and refused.

use super::*;
use crate::model::normals::tests::sphere;
use proptest::prelude::*;

fn quiet(_: &str, _: f32) {}

fn done(cloud: Cloud) -> (Surfels, Vec<String>) {
    complete(cloud, &LoadOptions::default(), &quiet).unwrap()
}

fn cloud(position: Vec<DVec3>) -> Cloud {
    Cloud { position, ..Cloud::default() }
}

fn three() -> Cloud {
    let position = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    Cloud { position, normal: vec![Vec3::Z; 3], radius: vec![1.0, 2.0, 3.0], ..Cloud::default() }
}

fn assert_sound(s: &Surfels) {
    let n = s.len();
    assert!([s.axis_u.len(), s.axis_v.len(), s.normal.len(), s.colour.len()] == [n; 4]);
    assert!((s.material.is_empty() || s.material.len() == n) && (s.velocity.is_empty() || s.velocity.len() == n));
    assert!(s.origin.is_finite());
    for i in 0..n {
        let (u, v) = (s.axis_u[i], s.axis_v[i]);
        assert!(s.position[i].is_finite() && s.position[i].length_squared().is_finite());
        assert!(s.normal[i].is_normalized(), "normal {}", s.normal[i]);
        assert!(u.length() > 0.0 && v.length() > 0.0 && u.length_squared().is_finite(), "axes {u} {v}");
        assert!(u.cross(v).is_finite() && u.cross(v).dot(s.normal[i]) >= 0.0, "axes {u} {v}");
        assert!(u.cross(v) != Vec3::ZERO || u.length() < 1e-15, "parallel axes {u} {v}");
        assert!(s.colour[i].is_finite());
    }
}

#[test]
fn nothing_left_is_an_error() {
    for position in [vec![], vec![DVec3::NAN], vec![DVec3::X * f64::INFINITY, DVec3::Y * 1e19]] {
        let result = complete(cloud(position), &LoadOptions::default(), &quiet);
        assert!(matches!(result, Err(ModelError::NoPoints)));
    }
}

#[test]
fn a_complete_cloud_is_only_recentred() {
    let mut given = three();
    given.colour = vec![Vec3::ONE; 3];
    let (surfels, notes) = done(given);
    assert_sound(&surfels);
    assert_eq!(notes, Vec::<String>::new());
    assert_eq!(surfels.origin, DVec3::new(0.5, 0.5, 0.0));
    assert_eq!(surfels.position[1], Vec3::new(0.5, -0.5, 0.0));
    assert_eq!(surfels.normal, [Vec3::Z; 3]);
    for (i, radius) in [1.0, 2.0, 3.0].into_iter().enumerate() {
        assert!((surfels.axis_u[i].length() - radius).abs() < 1e-6);
        assert!((surfels.axis_v[i].length() - radius).abs() < 1e-6);
        assert!(surfels.axis_u[i].dot(surfels.axis_v[i]).abs() < 1e-6);
        assert!(surfels.axis_u[i].dot(Vec3::Z).abs() < 1e-6);
    }
}

#[test]
fn one_two_and_three_bare_points() {
    for n in 1..=3 {
        let (surfels, notes) = done(cloud([DVec3::ZERO, DVec3::X, DVec3::Y][..n].to_vec()));
        assert_sound(&surfels);
        assert_eq!(surfels.len(), n);
        let start = format!("normals of all {n} points estimated from {} neighbours; open or unclear", n - 1);
        assert!(notes[0].starts_with(&start) && notes[0].ends_with("both sides show"), "{}", notes[0]);
        assert!(surfels.two_sided && surfels.signs_estimated);
        assert_eq!(notes[1], format!("radii of all {n} points estimated from {} neighbours", n - 1));
        assert_eq!(notes[2], "no colours: grey");
    }
}

#[test]
fn far_from_the_origin_nothing_is_lost() {
    let far = DVec3::new(1e8, -1e8, 3e8);
    let near: Vec<DVec3> = sphere(2000).iter().map(|p| p.as_dvec3()).collect();
    let moved = done(cloud(near.iter().map(|p| p + far).collect())).0;
    assert!(moved.origin.distance(far) < 0.01);
    let share = moved.normal.iter().zip(&near).filter(|(n, p)| n.as_dvec3().dot(**p) > 0.99).count();
    assert_eq!(share, 2000);
    let stays = done(cloud(near)).0;
    assert!((moved.median_radius() - stays.median_radius()).abs() < 1e-6);
}

#[test]
fn unusable_points_are_dropped_from_every_column() {
    let mut given = three();
    given.position[1].y = f64::NAN;
    given.colour = vec![Vec3::ZERO, Vec3::ONE, Vec3::ONE];
    given.velocity = vec![Vec3::X, Vec3::Y, Vec3::Z];
    let (surfels, notes) = done(given);
    assert_sound(&surfels);
    assert_eq!(notes, ["1 points dropped: position not finite or beyond 1e18"]);
    assert_eq!(surfels.velocity, [Vec3::X, Vec3::Z]);
    assert_eq!(surfels.colour, [Vec3::ZERO, Vec3::ONE]);
    assert!((surfels.radius(1) - 3.0).abs() < 1e-6);
}

#[test]
fn only_the_missing_radii_are_estimated() {
    for missing in [0.0, -1.0, f32::NAN, f32::INFINITY, 2e18] {
        let mut given = three();
        given.radius[0] = missing;
        let (surfels, notes) = done(given);
        assert!(notes.contains(&"radii of 1 of 3 points estimated from 2 neighbours".to_owned()), "{notes:?}");
        assert!((surfels.radius(0) - 1.0).abs() < 0.3, "{}", surfels.radius(0));
        assert!((surfels.radius(2) - 3.0).abs() < 1e-6);
    }
}

#[test]
fn ellipses_keep_their_axes_and_give_a_missing_normal() {
    let mut given = three();
    given.normal[2] = Vec3::ZERO;
    given.axes = vec![[Vec3::X, 2.0 * Vec3::Y], [2.0 * Vec3::Y, Vec3::X], [Vec3::Y, 3.0 * Vec3::X]];
    let (surfels, notes) = done(given);
    assert_sound(&surfels);
    assert_eq!(notes, ["no colours: grey"]);
    assert_eq!((surfels.axis_u[0], surfels.axis_v[0]), (Vec3::X, 2.0 * Vec3::Y));
    assert_eq!((surfels.axis_u[1], surfels.axis_v[1]), (Vec3::X, 2.0 * Vec3::Y), "swapped to agree with the normal");
    assert_eq!(surfels.normal[2], -Vec3::Z);
}

#[test]
fn broken_axes_become_discs() {
    let mut given = three();
    given.axes = vec![[Vec3::X, Vec3::new(2.0, 1e-6, 0.0)], [Vec3::NAN, 0.5 * Vec3::X], [Vec3::ZERO; 2]];
    let (surfels, notes) = done(given);
    assert_sound(&surfels);
    assert_eq!(notes[0], "axes of 3 points are zero, parallel or not finite: drawn as discs");
    // The longer axis; the usable axis; the file's radius.
    for (i, radius) in [2.0, 0.5, 3.0].into_iter().enumerate() {
        assert!((surfels.radius(i) - radius).abs() < 1e-6, "{}", surfels.radius(i));
    }
}

#[test]
fn axes_of_any_lengths_keep_their_directions() {
    let mut given = three();
    let [u, v] = [Vec3::new(-1.32, -0.78, -1.57), Vec3::splat(1e-45)];
    given.axes = vec![[u, v], [v, u], [1e17 * u, v]];
    let (surfels, _) = done(given);
    assert_sound(&surfels);
    let direction = |a: Vec3| a.as_dvec3().normalize();
    for (&u_found, &v_found) in surfels.axis_u.iter().zip(&surfels.axis_v) {
        let found = [direction(u_found), direction(v_found)];
        let is_found = |wanted: Vec3| found.iter().any(|f| f.dot(direction(wanted)) > 0.9999);
        assert!(is_found(u) && is_found(v), "axes {u_found} {v_found}");
    }
}

#[test]
fn radius_scale_multiplies() {
    let options = LoadOptions { radius_scale: 2.5, ..LoadOptions::default() };
    let mut given = three();
    given.axes = vec![[Vec3::X, Vec3::Y], [Vec3::ZERO; 2], [Vec3::ZERO; 2]];
    let surfels = complete(given, &options, &quiet).unwrap().0;
    assert_eq!(surfels.axis_u[0], 2.5 * Vec3::X);
    assert!((surfels.radius(1) - 5.0).abs() < 1e-5);
    for radius_scale in [1e300, 1e-300] {
        assert_sound(&complete(three(), &LoadOptions { radius_scale, ..LoadOptions::default() }, &quiet).unwrap().0);
    }
}

#[test]
fn colours_become_linear_by_storage_or_by_option() {
    let of = |storage, colour_space| {
        let colour = vec![Vec3::splat(128.0 / 255.0), Vec3::splat(0.3), Vec3::NAN];
        let given = Cloud { colour, colour_storage: storage, ..three() };
        let (surfels, notes) =
            complete(given, &LoadOptions { colour_space, ..LoadOptions::default() }, &quiet).unwrap();
        assert_eq!(notes, ["colours of 1 points are not finite: white"]);
        assert_eq!(surfels.colour[2], Vec3::ONE);
        [surfels.colour[0].x, surfels.colour[1].y]
    };
    let (stored, linear) = ([128.0 / 255.0, 0.3], [128.0 / 255.0, 0.3].map(srgb::to_linear));
    assert_eq!(of(ColourStorage::Integer, None), linear);
    assert_eq!(of(ColourStorage::Float, None), stored);
    assert_eq!(of(ColourStorage::Integer, Some(ColourSpace::Linear)), stored);
    assert_eq!(of(ColourStorage::Float, Some(ColourSpace::Srgb)), linear);
}

#[test]
fn other_columns_are_repaired_or_ignored() {
    let mut given = three();
    given.material = vec![Material::default(); 3];
    given.material[1].shininess = f32::NAN;
    given.velocity = vec![Vec3::X; 2];
    given.notes = vec!["from the file".to_owned()];
    let (surfels, notes) = done(given);
    assert_eq!(surfels.material, [Material::default(); 3]);
    assert!(surfels.velocity.is_empty());
    assert_eq!(notes[0], "from the file");
    assert_eq!(notes[1], "velocities ignored: 2 of them for 3 points");
    assert_eq!(notes[3], "reflection coefficients of 1 points are not valid: replaced by the default");
}

/// Ordinary numbers, and extreme ones of every kind.
fn wild() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -2.0_f32..2.0,
        1 => (-2_i8..=2).prop_map(f32::from),
        1 => prop::sample::select(vec![
            f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, 1e-45, 1e-20, 1e18, -1e18, 1e8
        ]),
    ]
}

fn wild3() -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(wild()).prop_map(Vec3::from)
}

proptest! {
    #[test]
    fn anything_gives_sound_surfels(
        rows in prop::collection::vec((wild3(), wild3(), wild(), (wild3(), wild3()), wild3(), wild3()), 1..60),
        has in prop::array::uniform5(any::<bool>()),
        scale in prop_oneof![Just(1.0), 1e-3..1e3, Just(1e30), Just(1e-30)],
    ) {
        let column = |i: usize| if has[i] { rows.len() } else { 0 };
        let given = Cloud {
            position: rows.iter().map(|r| r.0.as_dvec3()).collect(),
            normal: rows.iter().map(|r| r.1).take(column(0)).collect(),
            radius: rows.iter().map(|r| r.2).take(column(1)).collect(),
            axes: rows.iter().map(|r| [r.3.0, r.3.1]).take(column(2)).collect(),
            colour: rows.iter().map(|r| r.4).take(column(3)).collect(),
            velocity: rows.iter().map(|r| r.5).take(column(4)).collect(),
            ..Cloud::default()
        };
        match complete(given, &LoadOptions { radius_scale: scale, ..LoadOptions::default() }, &quiet) {
            Ok((surfels, _)) => {
                assert_sound(&surfels);
                assert_sound(&surfels.spatially_ordered());
            }
            Err(why) => prop_assert!(matches!(why, ModelError::NoPoints)),
        }
    }
}
